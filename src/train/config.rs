//! What a training run is told: sizes, budget, seeds. Checked once, before any work.

use super::schedule::WARMUP_EPOCHS;
use crate::error::{Error, Result};
use crate::flight::windows::TRAINING_STRIDE;
use crate::hybrid::inputs;
use crate::hybrid::linear::LinearConfig;
use crate::nn::{Architecture, PhyTureConfig};
use serde::{Deserialize, Serialize};

/// Longest time between checkpoints, s.
const LONGEST_CHECKPOINT_S: f64 = 86_400.0;

/// Largest distance of the blocks that are kept from training.
const MOST_EVERY: usize = 1_000_000;

/// Settings of a training run. Every field has a default, the paper's where it states one; what fits into minutes is
/// [`TrainConfig::in_minutes`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// The network: its sizes, and its `kind` if it is not Phy-Ture.
    pub network: Architecture,
    /// State-control inputs, as formulas of the log's columns. Default: the 16 of paper eq. 10 (position, Euler angles,
    /// velocity, rates, controls).
    pub inputs: Vec<String>,
    /// A linear history between physics and network: ridge regression of what physics leaves over, fitted in closed form before
    /// the network. Default none, as in the paper.
    pub linear: Option<LinearConfig>,
    /// A loss of predictions that run ahead, on top of that of single samples. Default none, as in the paper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rollout: Option<RolloutConfig>,
    /// Passes over the training windows, at most 1 000 000. Default 100; the paper does not state its number.
    pub epochs: usize,
    /// Windows a step, at most 65 536. Default 32.
    pub batch: usize,
    /// Peak learning rate. Default 1e-3 (paper section 4.2).
    pub peak_rate: f64,
    /// Epochs of warm-up; at most a tenth of all where there are ten or fewer, or no more than these. Default 10 (paper section 4.2).
    pub warmup_epochs: usize,
    /// Samples between training windows, at most 1 000 000. Default 50.
    pub stride: usize,
    /// Weight of each channel's squared error in the loss is 1/σ² of the residual instead of 1. Default off (paper eq. 13).
    pub standardise_loss: bool,
    /// Every so many-th 10-s block of the training part is kept from the network to fit its gate on, one factor a channel
    /// between 0 and 1 ([`Hybrid::fit_gate`](crate::hybrid::Hybrid::fit_gate)); where the split has a validation part, that serves and no block is kept.
    /// 0 sets no gate, as in the paper. Default 0; in [`TrainConfig::in_minutes`] 8, and in a file over these that leaves it out as
    /// `interval_every`, or 0 beside `rollout`.
    pub gate_every: usize,
    /// Every so many-th 10-s block of the training part is kept from the network to measure how far its predictions stray, where neither a gate
    /// nor the split keeps any; 0 keeps none, and then there are no intervals. Default 0; 8 in [`TrainConfig::in_minutes`].
    pub interval_every: usize,
    /// Whether the weights of the epoch with the smallest loss on the validation part are kept instead of the last epoch's. Default off, as in the
    /// paper.
    pub keep_best: bool,
    /// Seed of initial weights, order and dropout. Default 0.
    pub seed: u64,
    /// Seconds between checkpoints, at most a day. Default 30.
    pub checkpoint_s: f64,
}

/// Rollouts that train: the hybrid integrated forward from measured states, whose errors count, too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RolloutConfig {
    /// Steps of a rollout, at most 10 000. Default 50.
    pub horizon: usize,
    /// Rollouts beside the windows of a step, at most 64. Default 8.
    pub starts: usize,
    /// Weight of their loss: with 1, an error of rollouts as large as that of the physics with body rates held counts as much as all of the residual
    /// does in single samples. Above 0, at most 1000. Default 10.
    pub weight: f64,
}

impl Default for RolloutConfig {
    fn default() -> Self {
        Self { horizon: 50, starts: 8, weight: 10.0 }
    }
}

impl RolloutConfig {
    /// Most steps.
    pub const MOST_STEPS: usize = 10_000;
    /// Most rollouts of a step.
    pub const MOST_STARTS: usize = 64;
    /// Largest weight.
    pub const LARGEST_WEIGHT: f64 = 1000.0;

    fn check(&self) -> Result<()> {
        let counts = [("rollout.horizon", self.horizon, Self::MOST_STEPS), ("rollout.starts", self.starts, Self::MOST_STARTS)];
        if let Some((field, value, most)) = counts.into_iter().find(|(_, value, most)| *value < 1 || value > most) {
            return Err(fault(field, value, &format!("1 to {most}")));
        }
        if !(self.weight > 0.0 && self.weight <= Self::LARGEST_WEIGHT) {
            return Err(fault("rollout.weight", self.weight, &format!("a weight above 0 and at most {}", Self::LARGEST_WEIGHT)));
        }
        Ok(())
    }
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            network: Architecture::default(),
            inputs: crate::flight::Column::STATE.iter().map(|column| column.name().to_owned()).collect(),
            linear: None,
            rollout: None,
            epochs: 100,
            batch: 32,
            peak_rate: 1e-3,
            warmup_epochs: WARMUP_EPOCHS,
            stride: TRAINING_STRIDE,
            standardise_loss: false,
            gate_every: 0,
            interval_every: 0,
            keep_best: false,
            seed: 0,
            checkpoint_s: 30.0,
        }
    }
}

impl TrainConfig {
    /// Most epochs.
    pub const MOST_EPOCHS: usize = 1_000_000;
    /// Most windows a step.
    pub const MOST_BATCH: usize = 65_536;
    /// Most samples between windows.
    pub const MOST_STRIDE: usize = 1_000_000;

    /// What ends in a few minutes on two cores and half an hour of flight at 100 Hz: a history of 128 samples, width 32, 20 epochs, a
    /// window every 12 samples; a gate, since so many epochs, which a bare baseline needs, are too many where physics leaves little to learn.
    pub fn in_minutes() -> Self {
        let network = PhyTureConfig { history: 128, d_model: 32, ..PhyTureConfig::default() };
        let kept = Self { gate_every: 8, interval_every: 8, ..Self::default() };
        Self { network: network.into(), epochs: 20, warmup_epochs: 2, stride: 12, ..kept }
    }

    /// Checks every field against its range, and that no input is a target or made of one.
    ///
    /// # Errors
    /// [`Error::Config`] naming the field, its value and its range; [`Error::Formula`] pointing into an input.
    pub fn check(&self) -> Result<()> {
        let counts = [
            ("epochs", self.epochs, 1, Self::MOST_EPOCHS),
            ("batch", self.batch, 1, Self::MOST_BATCH),
            ("stride", self.stride, 1, Self::MOST_STRIDE),
            ("warmup_epochs", self.warmup_epochs, 0, Self::MOST_EPOCHS),
            ("gate_every", self.gate_every, 0, MOST_EVERY),
            ("interval_every", self.interval_every, 0, MOST_EVERY),
        ];
        if let Some((field, value, least, most)) = counts.into_iter().find(|(_, value, least, most)| value < least || value > most)
        {
            return Err(fault(field, value, &format!("{least} to {most}")));
        }
        if !(self.peak_rate > 0.0 && self.peak_rate <= 1.0) {
            return Err(fault("peak_rate", self.peak_rate, "a learning rate above 0 and at most 1"));
        }
        if !(0.0..=LONGEST_CHECKPOINT_S).contains(&self.checkpoint_s) {
            return Err(fault("checkpoint_s", self.checkpoint_s, &format!("0 to {LONGEST_CHECKPOINT_S} seconds")));
        }
        inputs::parse(&self.inputs)?;
        if self.inputs.len() != self.network.state_channels() {
            return Err(fault(
                "network.state_channels",
                self.network.state_channels(),
                &format!("the number of inputs, {}", self.inputs.len()),
            ));
        }
        for (field, every) in [("gate_every", self.gate_every), ("interval_every", self.interval_every)] {
            if every == 1 {
                return Err(fault(field, 1, "0 (none is kept), or 2 and more: 1 would leave nothing to train on"));
            }
        }
        self.linear.as_ref().map_or(Ok(()), LinearConfig::check)?;
        self.rollout.as_ref().map_or(Ok(()), RolloutConfig::check)?;
        if self.rollout.is_some() && self.gate_every > 0 {
            let expected = "0 beside `[rollout]`: a gate is fitted to single samples and would undo what rollouts have taught";
            return Err(fault("gate_every", self.gate_every, expected));
        }
        Ok(self.network.check()?)
    }
}

fn fault(field: &str, found: impl std::fmt::Display, expected: &str) -> Error {
    Error::Config {
        place: "training configuration".into(),
        field: field.into(),
        found: found.to_string(),
        expected: expected.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_impossible_values_are_named() {
        assert!(TrainConfig::default().check().is_ok());
        let message = |config: TrainConfig| config.check().map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message(TrainConfig { epochs: 0, ..Default::default() }).contains("`epochs` is 0"));
        assert!(message(TrainConfig { peak_rate: f64::NAN, ..Default::default() }).contains("`peak_rate` is NaN"));
        let of = |rollout: RolloutConfig| message(TrainConfig { rollout: Some(rollout), ..Default::default() });
        assert!(of(RolloutConfig { horizon: 0, ..Default::default() }).contains("`rollout.horizon` is 0, expected 1 to 10000"));
        assert!(of(RolloutConfig { starts: 65, ..Default::default() }).contains("`rollout.starts` is 65, expected 1 to 64"));
        assert!(of(RolloutConfig { weight: f64::INFINITY, ..Default::default() }).contains("`rollout.weight` is inf"));
        assert_eq!(of(RolloutConfig::default()), "");
        let gated = TrainConfig { rollout: Some(RolloutConfig::default()), gate_every: 5, ..Default::default() };
        assert!(message(gated).contains("`gate_every` is 5, expected 0 beside `[rollout]`"));
        assert!(message(TrainConfig { inputs: vec!["vx".into()], ..Default::default() }).contains("state_channels"));
    }

    #[test]
    fn every_count_has_a_bound_and_no_product_of_bounds_overflows() {
        type Set = fn(&mut TrainConfig, usize);
        let set: [(&str, Set); 6] = [
            ("epochs", |config, value| config.epochs = value),
            ("batch", |config, value| config.batch = value),
            ("stride", |config, value| config.stride = value),
            ("warmup_epochs", |config, value| config.warmup_epochs = value),
            ("gate_every", |config, value| config.gate_every = value),
            ("interval_every", |config, value| config.interval_every = value),
        ];
        for (field, set) in set {
            for value in [1 << 62, 1 << 63, usize::MAX, 1_000_001] {
                let mut config = TrainConfig::default();
                set(&mut config, value);
                let message = config.check().map_err(|error| error.to_string()).err().unwrap_or_default();
                assert!(message.contains(&format!("`{field}` is {value}, expected ")), "{message}");
            }
        }
        // Windows are counted in 32 bits.
        assert!(TrainConfig::MOST_EPOCHS.checked_mul(u32::MAX as usize).is_some());
        assert!(TrainConfig::in_minutes().check().is_ok());
        for seconds in [-1.0, f64::INFINITY, f64::NAN, 1e300] {
            assert!(TrainConfig { checkpoint_s: seconds, ..Default::default() }.check().is_err());
        }
    }

    #[cfg(feature = "files")]
    #[test]
    fn the_network_is_named_by_its_kind_and_is_phy_ture_without_one() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("train.toml");
        for (text, name) in [
            ("[network]\nkind = \"tcn\"\nhistory = 128\nchannels = 16\n", "TCN"),
            ("[network]\nhistory = 128\nd_model = 16\n", "Phy-Ture"),
            ("epochs = 3\n", "Phy-Ture"),
        ] {
            std::fs::write(&path, text).map_err(Error::io(&path))?;
            let config = TrainConfig::read(&path)?;
            assert_eq!(config.network.name(), name);
            assert_eq!(config.network.history(), if text.contains("128") { 128 } else { 1000 });
        }
        std::fs::write(&path, "[network]\nkind = \"tcn\"\nheads = 4\n").map_err(Error::io(&path))?;
        assert!(TrainConfig::read(&path).is_err_and(|error| error.to_string().contains("heads")));
        Ok(())
    }

    #[cfg(feature = "files")]
    #[test]
    fn an_unknown_key_is_refused_with_its_line() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("train.toml");
        std::fs::write(&path, "epochs = 3\nepoch = 4\n").map_err(Error::io(&path))?;
        let message = TrainConfig::read(&path).map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message.contains("line 2") && message.contains("epoch"), "{message}");
        Ok(())
    }
}
