//! A training configuration as TOML: read over defaults, and written with a comment at each field. What the fields mean and may be is
//! `config`'s.

use super::config::{RolloutConfig, TrainConfig};
use crate::error::{Error, Result};
use crate::hybrid::linear::LinearConfig;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use toml::{Table, Value};

/// Table of the network, its key that tells kinds apart, and the kind where that is left out.
const NETWORK: &str = "network";
const KIND: &str = "kind";
const PHYTURE: &str = "phyture";

/// Field whose default follows from others.
const GATE: &str = "gate_every";

/// Comments of the fields, in the order in which they are written.
const FIELDS: [(&str, &str); 14] = [
    ("epochs", "Passes over the training windows; the paper does not state its number."),
    ("batch", "Windows a step."),
    ("stride", "Samples between training windows."),
    ("peak_rate", "Peak learning rate."),
    ("warmup_epochs", "Epochs of linear warm-up; at most a tenth of all where there are ten or fewer. Half a cosine follows."),
    ("standardise_loss", "Divide each channel's error by its standard deviation in the loss."),
    (
        "gate_every",
        "Keep every so many-th 10-s block from the network to fit a gate on, a factor a channel, where the split has no validation part; 0: no gate.",
    ),
    (
        "interval_every",
        "Keep every so many-th 10-s block from the network for its intervals, where neither gate nor split keeps any; 0: no intervals.",
    ),
    ("keep_best", "Keep the weights of the epoch with the smallest loss on the validation part, not the last epoch's."),
    ("seed", "Seed of initial weights, order and dropout; --seed goes before it."),
    ("checkpoint_s", "Seconds between checkpoints."),
    ("inputs", "What the network sees, as formulas of the log's columns; as many as network.state_channels. No acceleration."),
    ("linear", ""),
    ("rollout", ""),
];

/// Comments of the fields of `[rollout]`.
const OF_ROLLOUT: [(&str, &str); 3] = [
    ("horizon", "Steps of a rollout."),
    ("starts", "Rollouts beside the windows of a step."),
    ("weight", "Of their loss: 1 makes an error as with body rates held count as much as all of the residual."),
];

/// Comments of a network's fields that mean the same in all networks.
const COMMON: [(&str, &str); 4] = [
    ("history", "Samples of the history."),
    ("state_channels", "Number of inputs."),
    ("d_model", "Width."),
    ("dropout", "Share of activations dropped in training."),
];

/// Comments of Phy-Ture's own fields.
const OF_PHYTURE: [(&str, &str); 14] = [
    ("physics_channels", "Accelerations of the physical model."),
    ("heads", "Attention heads; a divisor of d_model."),
    ("levels", "Levels of a tree; the history is a multiple of 2^levels."),
    ("stacks", "Trees one after another."),
    ("moving_average", "Width of the moving average that splits trend and season, odd."),
    ("horizon", "Rows predicted: the last of the history."),
    ("outputs", "Accelerations predicted."),
    ("kernel1", "Kernel of the first convolution of a module."),
    ("kernel2", "Kernel of the second one."),
    ("hidden", "Channels between the two, as a multiple of d_model."),
    ("leak", "Slope of the leaky rectifier for negative numbers."),
    ("norm_eps", "Inside the root of the layer norm."),
    ("biases", "Whether linear maps have biases."),
    (
        "variant",
        "phy_ture, without_paf, without_mstfe, without_tsdp_temporal_linear, without_tsdp_last_row, state_control_only, direct_concatenation.",
    ),
];

impl TrainConfig {
    /// Reads a TOML file; what it leaves out keeps the paper's value, or our reading of it ([`TrainConfig::default`]).
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] naming line and field, with the fields there are; as [`TrainConfig::check`].
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_over(path, &Self::default())
    }

    /// As [`TrainConfig::read`], with other values for what is left out. Of another kind of network the sizes that are left out are its
    /// own defaults, but for the history.
    ///
    /// # Errors
    /// As [`TrainConfig::read`].
    pub fn read_over(path: &Path, base: &Self) -> Result<Self> {
        Self::from_text(&std::fs::read_to_string(path).map_err(Error::io(path))?, path, base)
    }

    /// As [`TrainConfig::read_over`], of a text; `path` is named in errors.
    ///
    /// # Errors
    /// As [`TrainConfig::read`], but for [`Error::Io`].
    pub fn from_text(text: &str, path: &Path, base: &Self) -> Result<Self> {
        let fault = |error: &dyn std::fmt::Display| Error::File { path: path.into(), message: error.to_string() };
        // By itself first: the line of a mistake is known only here.
        toml::from_str::<Self>(text).map_err(|error| fault(&error))?;
        let given: Table = text.parse().map_err(|error: toml::de::Error| fault(&error))?;
        let mut merged = table(base)?;
        let leaves_gate = !given.contains_key(GATE);
        overlay(&mut merged, given);
        let mut config: Self = merged.try_into().map_err(|error: toml::de::Error| fault(&error))?;
        if leaves_gate && base.gate_every > 0 {
            // The blocks that are kept anyway; a gate and rollouts exclude each other, and what was asked for goes before a default.
            config.gate_every = if config.rollout.is_some() { 0 } else { config.interval_every };
        }
        config.check().map_err(|error| match error {
            Error::Config { field, found, expected, .. } => {
                Error::Config { place: path.display().to_string(), field, found, expected }
            }
            other => other.standing_in(&path.display().to_string()),
        })?;
        Ok(config)
    }

    /// The configuration as TOML with a comment at each field; [`TrainConfig::read`] gives it back.
    ///
    /// # Errors
    /// [`Error::Config`] for a seed that TOML cannot hold.
    pub fn template(&self) -> Result<String> {
        let mut table = table(self)?;
        let mut text = String::from(
            "# Training configuration, for `phyture train --config FILE`. Fields that are left out keep their default.\n",
        );
        for (field, comment) in FIELDS {
            match table.remove(field) {
                Some(Value::Table(own)) => table_text(&mut text, field, &own, &|key| {
                    OF_ROLLOUT.iter().find(|(known, _)| field == "rollout" && *known == key).map(|(_, comment)| *comment)
                }),
                Some(value) => line(&mut text, field, &value, Some(comment)),
                None if field == "rollout" => as_comment(&mut text, field, NO_ROLLOUT, &RolloutConfig::default())?,
                None => as_comment(&mut text, field, NO_LINEAR, &LinearConfig::default())?,
            }
        }
        if let Some(Value::Table(mut network)) = table.remove(NETWORK) {
            network.entry(KIND).or_insert_with(|| PHYTURE.into());
            let is_phyture = network.get(KIND).and_then(Value::as_str) == Some(PHYTURE);
            let comment = |field: &str| {
                let own = OF_PHYTURE.iter().filter(|_| is_phyture);
                COMMON.iter().chain(own).find(|(known, _)| *known == field).map(|(_, comment)| *comment)
            };
            table_text(&mut text, NETWORK, &network, &comment);
        }
        Ok(text)
    }
}

fn table(config: &impl Serialize) -> Result<Table> {
    Table::try_from(config).map_err(|error| Error::Config {
        place: "training configuration".into(),
        field: "seed".into(),
        found: format!("something that TOML cannot hold ({error})"),
        expected: format!("a seed of at most {}", i64::MAX),
    })
}

/// Puts what was given over the defaults.
fn overlay(base: &mut Table, given: Table) {
    for (field, value) in given {
        match (base.get_mut(&field), value) {
            (Some(Value::Table(defaults)), Value::Table(mut given)) if field == NETWORK => {
                let kind = |table: &Table| table.get(KIND).and_then(Value::as_str).unwrap_or(PHYTURE).to_owned();
                if kind(defaults) == kind(&given) {
                    defaults.extend(given);
                } else {
                    if let Some(history) = defaults.get("history") {
                        given.entry("history").or_insert_with(|| history.clone());
                    }
                    *defaults = given;
                }
            }
            (_, value) => {
                base.insert(field, value);
            }
        }
    }
}

fn table_text(text: &mut String, name: &str, table: &Table, comment: &dyn Fn(&str) -> Option<&'static str>) {
    // Writing to a text cannot fail.
    let _ = write!(text, "\n[{name}]\n");
    if name == NETWORK {
        let kinds = crate::nn::Architecture::KINDS.join(", ");
        let _ = writeln!(text, "# One of {kinds}.");
    }
    let first = table.get_key_value(KIND);
    for (field, value) in first.into_iter().chain(table.iter().filter(|(field, _)| *field != KIND)) {
        line(text, field, value, comment(field));
    }
}

fn line(text: &mut String, field: &str, value: &Value, comment: Option<&str>) {
    let comment = comment.map(|comment| format!("# {comment}\n")).unwrap_or_default();
    let _ = writeln!(text, "{comment}{field} = {value}");
}

const NO_LINEAR: &str = "A linear history between physics and network: ridge regression of what physics leaves over.";
const NO_ROLLOUT: &str = "A loss of predictions that run ahead, on top of that of single samples.";

/// What a table would look like that is not there, as a comment.
fn as_comment(text: &mut String, name: &str, what: &str, defaults: &impl Serialize) -> Result<()> {
    // Writing to a text cannot fail.
    let _ = write!(text, "\n# {what}\n# [{name}]\n");
    for (field, value) in table(defaults)? {
        let _ = writeln!(text, "# {field} = {value}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Architecture, PhyTureConfig, Variant};

    fn read(text: &str, base: &TrainConfig) -> Result<TrainConfig> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("train.toml");
        std::fs::write(&path, text).map_err(Error::io(&path))?;
        TrainConfig::read_over(&path, base)
    }

    #[test]
    fn a_template_is_read_back_as_it_was_whatever_the_defaults() -> Result<()> {
        let kinds = Architecture::KINDS.iter().map(|kind| serde_json::from_str(&format!(r#"{{"kind": "{kind}", "history": 64}}"#)));
        let networks = kinds.into_iter().collect::<Result<Vec<Architecture>, _>>();
        let networks = networks.map_err(|error| Error::Undetermined(error.to_string()))?;
        let variants = Variant::ALL.map(|variant| PhyTureConfig { variant, norm_eps: 1e-7, ..PhyTureConfig::default() }.into());
        let mut inputs = TrainConfig::default().inputs;
        inputs[3] = "sin(roll) * (vx > 1e-9)".into();
        for network in networks.into_iter().chain(variants) {
            for linear in [None, Some(LinearConfig { lags: 3, inputs: vec!["lag(u1, 0.1)".into()] })] {
                let rollout = linear.is_some().then_some(RolloutConfig { horizon: 20, starts: 3, weight: 1.0 / 3.0 });
                let config = TrainConfig {
                    network: network.clone(),
                    inputs: inputs.clone(),
                    gate_every: if rollout.is_some() { 0 } else { 5 },
                    linear,
                    rollout,
                    peak_rate: 1.0 / 3.0,
                    standardise_loss: true,
                    interval_every: 7,
                    keep_best: true,
                    seed: i64::MAX as u64,
                    checkpoint_s: 0.1,
                    ..TrainConfig::in_minutes()
                };
                let text = config.template()?;
                for base in [TrainConfig::default(), TrainConfig::in_minutes()] {
                    assert_eq!(read(&text, &base)?, config, "{text}");
                }
            }
        }
        let text = TrainConfig::default().template()?;
        let fields: Vec<&str> = text.lines().filter_map(|line| line.split_once(" = ")).map(|(field, _)| field).collect();
        let uncommented = fields.iter().filter(|field| !field.starts_with('#')).count();
        // Twelve fields, nineteen of the network; and a comment for each.
        assert_eq!(uncommented, 12 + 19, "{text}");
        assert!(text.lines().filter(|line| line.starts_with("# ")).count() > uncommented, "{text}");
        Ok(())
    }

    #[test]
    fn a_seed_that_toml_cannot_hold_is_named() {
        let refused = TrainConfig { seed: u64::MAX, ..TrainConfig::default() }.template();
        assert!(refused.is_err_and(|error| error.to_string().contains("`seed`")));
    }

    #[test]
    fn what_is_left_out_is_the_base_s() -> Result<()> {
        let base = TrainConfig::in_minutes();
        let config = read("batch = 8\n[network]\nheads = 2\n", &base)?;
        let network = PhyTureConfig { history: 128, d_model: 32, heads: 2, ..PhyTureConfig::default() };
        assert_eq!(config, TrainConfig { batch: 8, network: network.into(), ..base.clone() });
        let other = read("[network]\nkind = \"tcn\"\n", &base)?;
        assert_eq!((other.network.name(), other.network.history(), other.epochs), ("TCN", 128, 20));
        assert_eq!(read("[network]\nkind = \"tcn\"\nhistory = 64\n", &base)?.network.history(), 64);
        assert_eq!(read("", &TrainConfig::default())?, TrainConfig::default());
        Ok(())
    }

    #[test]
    fn a_gate_that_is_left_out_takes_the_blocks_of_the_intervals_and_none_beside_rollouts() -> Result<()> {
        let gate = |text: &str| Ok::<_, Error>(read(text, &TrainConfig::in_minutes())?.gate_every);
        assert_eq!((gate("epochs = 3\n")?, gate("interval_every = 5\n")?, gate("interval_every = 0\n")?), (8, 5, 0));
        assert_eq!((gate("gate_every = 3\n")?, gate("gate_every = 0\n")?, gate("[rollout]\n")?), (3, 0, 0));
        // Asked for, it is refused there as ever; and the paper has none.
        assert!(gate("gate_every = 8\n[rollout]\n").is_err_and(|error| error.to_string().contains("`gate_every` is 8")));
        assert_eq!(read("interval_every = 8\n", &TrainConfig::default())?.gate_every, 0);
        Ok(())
    }
}
