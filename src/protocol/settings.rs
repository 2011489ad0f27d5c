//! How much of the paper's experiment is done: sizes, budget, seeds; and the sentence that says what is less than the paper's.

use crate::error::{Error, Result};
use crate::flight::split::BENCHMARK_SEED;
use crate::nn::{Architecture, PhyTureConfig};
use crate::train::TrainConfig;
use serde::{Deserialize, Serialize};

/// Random seeds of the paper (section 4.2).
pub const PAPER_SEEDS: usize = 10;

/// Folds of the manoeuvre-class protocol (paper section 4.4).
pub const PAPER_FOLDS: usize = 10;

/// Peak learning rates of [`Settings::question`]: the paper's, and half a decade to either side.
const RATES: [f64; 3] = [3e-4, 1e-3, 3e-3];

/// Methods of [`Settings::question`] of which one seed says enough: the slow peers, and Phy-Ture with something left out.
const ONE_SEED: [&str; 7] =
    ["timesnet", "informer", "phyture_without_dropout", "without_paf", "without_mstfe", "without_tsdp_linear", "without_tsdp_last"];

/// What all runs of a plan share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Phy-Ture, and the budget that every network is given. Its seed is replaced by each run's.
    pub training: TrainConfig,
    /// Runs of each network: seeds 1, 2, …
    pub seeds: usize,
    /// Samples between test windows.
    pub test_stride: usize,
    /// Folds of the manoeuvre-class protocol.
    pub folds: usize,
    /// Seed of the division into segments.
    pub split_seed: u64,
    /// Peak learning rates that each network chooses from, on the validation part; empty: the training configuration's, for all.
    pub rates: Vec<f64>,
    /// Epochs for which each of them is tried, with a schedule of that length.
    pub rate_epochs: usize,
    /// Networks of which one seed is enough, by identifier of the method.
    pub one_seed: Vec<String>,
}

impl Settings {
    /// Most seeds of a network.
    pub const MOST_SEEDS: usize = 1000;
    /// Most parts that the manoeuvre classes are cut into.
    pub const MOST_FOLDS: usize = 1000;

    /// The paper's sizes; where it states none, our reading: 100 epochs, a training window every 0.5 s, a test window every 0.1 s.
    pub fn paper() -> Self {
        let training = TrainConfig::default();
        Self {
            training,
            seeds: PAPER_SEEDS,
            test_stride: 10,
            folds: PAPER_FOLDS,
            split_seed: BENCHMARK_SEED,
            rates: Vec::new(),
            rate_epochs: 2,
            one_seed: Vec::new(),
        }
    }

    /// Whether the network is worth having, trained to the end of a shorter history: the paper's schedule at 1.28 s, the best epoch and the best of
    /// three learning rates by the validation part, for all networks alike.
    pub fn question() -> Self {
        let network = PhyTureConfig { history: 128, ..PhyTureConfig::default() };
        let training = TrainConfig { network: network.into(), epochs: 20, stride: 10, keep_best: true, ..TrainConfig::default() };
        Self {
            training,
            seeds: 3,
            rates: RATES.into(),
            one_seed: ONE_SEED.iter().map(|&id| id.to_owned()).collect(),
            ..Self::paper()
        }
    }

    /// The comparison of the methods on two hours of flight in an hour on two cores.
    pub fn hour() -> Self {
        let network = PhyTureConfig { history: 128, d_model: 32, ..PhyTureConfig::default() };
        let training = TrainConfig { network: network.into(), epochs: 5, keep_best: true, ..TrainConfig::default() };
        Self { training, seeds: 3, ..Self::paper() }
    }

    /// Everything at a size that shows that it works and nothing else.
    pub fn quick() -> Self {
        let network = PhyTureConfig { history: 64, d_model: 16, levels: 2, stacks: 1, ..PhyTureConfig::default() };
        let training = TrainConfig { network: network.into(), epochs: 2, stride: 100, keep_best: true, ..TrainConfig::default() };
        Self { training, seeds: 1, test_stride: 50, folds: 2, ..Self::paper() }
    }

    /// Phy-Ture, on which every other network is sized.
    ///
    /// # Errors
    /// [`Error::Config`] if the configuration is of another network.
    pub fn phyture(&self) -> Result<&PhyTureConfig> {
        match &self.training.network {
            Architecture::PhyTure(config) => Ok(config),
            other => Err(Error::Config {
                place: "benchmark".into(),
                field: "network.kind".into(),
                found: other.name().into(),
                expected: "Phy-Ture (no `kind`): the other networks take history and inputs from it".into(),
            }),
        }
    }

    /// Checks sizes and counts.
    ///
    /// # Errors
    /// [`Error::Config`] naming the field.
    pub fn check(&self) -> Result<()> {
        self.phyture()?;
        self.training.check()?;
        let counts = [
            ("seeds", self.seeds, Self::MOST_SEEDS),
            ("test_stride", self.test_stride, TrainConfig::MOST_STRIDE),
            ("folds", self.folds, Self::MOST_FOLDS),
            ("rate_epochs", self.rate_epochs, TrainConfig::MOST_EPOCHS),
        ];
        for &peak_rate in &self.rates {
            TrainConfig { peak_rate, ..self.training.clone() }.check()?;
        }
        counts.into_iter().find(|(_, count, most)| !(1..=*most).contains(count)).map_or(Ok(()), |(field, count, most)| {
            let (place, expected) = ("benchmark".into(), format!("1 to {most}"));
            Err(Error::Config { place, field: field.into(), found: count.to_string(), expected })
        })
    }

    /// Learning rates that each network may choose from on the validation part, and the epochs for which each is tried.
    pub fn rate_budget(&self) -> (&[f64], usize) {
        (&self.rates, self.rate_epochs)
    }

    /// Whether a part of the training flights validates where whole classes are held out: where something is chosen on it.
    pub const fn chooses_on_validation(&self) -> bool {
        self.training.keep_best || !self.rates.is_empty()
    }

    /// The budget in a sentence; what is not as in the paper (or in our reading of it) is named with the paper's figure.
    pub fn budget(&self, step_s: f64) -> String {
        let paper = Self::paper();
        let (Ok(ours), Ok(whole)) = (self.figures(step_s), paper.figures(0.01)) else { return String::new() };
        let is_whole = ours.iter().zip(&whole).all(|(ours, whole)| ours.found == whole.found);
        let label = if is_whole { "Full budget" } else { "SCALED DOWN" };
        let words =
            ours.iter().zip(&whole).filter(|(ours, whole)| ours.always || ours.found != whole.found).map(|(ours, whole)| {
                let Figure { name, found, .. } = ours;
                let stated = if whole.stated { "" } else { "not stated, read as " };
                let of_paper = if whole.found.is_empty() { "none" } else { &whole.found };
                if found == &whole.found {
                    format!("{name} {found}")
                } else {
                    format!("{name} {found} (paper: {stated}{of_paper})")
                }
            });
        let words: Vec<String> = words.collect();
        let rates = match self.rate_budget() {
            ([], _) => String::new(),
            (rates, epochs) => {
                let rates: Vec<String> = rates.iter().map(f64::to_string).collect();
                format!(
                    "; each network's learning rate is the best of {} on the validation part after {epochs} epochs, or the next slower one where training diverges",
                    rates.join(", ")
                )
            }
        };
        format!("{label}: {}; test windows every {:.2} s{rates}", words.join(", "), self.test_stride as f64 * step_s)
    }

    /// Everything that may differ from the paper, in order.
    fn figures(&self, step_s: f64) -> Result<Vec<Figure>> {
        let (network, training) = (self.phyture()?, &self.training);
        let seconds = |samples: usize| format!("{:.2} s", samples as f64 * step_s);
        let shown = |name, found: String| Figure { name, found, stated: true, always: true };
        let quiet = |name, found: String| Figure { always: false, ..shown(name, found) };
        let unstated = |figure: Figure| Figure { stated: false, ..figure };
        let weights = if training.keep_best { "of the best epoch on the validation part" } else { "of the last epoch" };
        Ok(vec![
            shown("history", seconds(network.history)),
            shown("width of Phy-Ture (all other widths in proportion)", network.d_model.to_string()),
            shown("trees", network.stacks.to_string()),
            quiet("levels of a tree", network.levels.to_string()),
            quiet("heads", network.heads.to_string()),
            quiet("dropout", network.dropout.to_string()),
            quiet("width of the moving average", network.moving_average.to_string()),
            quiet("inputs", training.inputs.len().to_string()),
            quiet("a linear history below", training.linear.as_ref().map_or("no", |_| "yes").into()),
            unstated(shown("epochs", training.epochs.to_string())),
            unstated(quiet("windows a step", training.batch.to_string())),
            quiet("peak learning rate", training.peak_rate.to_string()),
            quiet("epochs of warm-up", training.warmup_epochs.to_string()),
            unstated(shown("a training window every", seconds(training.stride))),
            unstated(quiet("weights", weights.into())),
            shown("seeds", self.seeds.to_string()),
            quiet("of one seed alone", self.one_seed.join(" ")),
            quiet("folds", self.folds.to_string()),
        ])
    }
}

/// A figure of the budget.
struct Figure {
    name: &'static str,
    found: String,
    /// Whether the paper states it.
    stated: bool,
    /// Whether it is said even where it is the paper's.
    always: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_possible_and_say_what_they_are() -> Result<()> {
        let scaled = [Settings::hour(), Settings::quick(), Settings::question()];
        for (settings, label) in [(Settings::paper(), "Full budget")].into_iter().chain(scaled.map(|settings| (settings, "SCALED")))
        {
            settings.check()?;
            assert!(settings.budget(0.01).starts_with(label), "{}", settings.budget(0.01));
        }
        assert!(Settings::hour().budget(0.01).contains("history 1.28 s (paper: 10.00 s)"));
        let question = Settings::question().budget(0.01);
        assert!(
            question.contains("epochs 20 (paper: not stated, read as 100)") && question.contains("best of 0.0003, 0.001, 0.003")
        );
        Ok(())
    }

    #[test]
    fn whatever_differs_from_the_paper_is_named() {
        let of = |network: PhyTureConfig, training: TrainConfig| {
            Settings { training: TrainConfig { network: network.into(), ..training }, ..Settings::paper() }.budget(0.01)
        };
        let (network, training) = (PhyTureConfig::default(), TrainConfig::default());
        let changed = [
            (of(PhyTureConfig { levels: 2, ..network.clone() }, training.clone()), "levels of a tree 2 (paper: 3)"),
            (of(PhyTureConfig { heads: 2, ..network.clone() }, training.clone()), "heads 2 (paper: 4)"),
            (of(PhyTureConfig { dropout: 0.0, ..network.clone() }, training.clone()), "dropout 0 (paper: "),
            (
                of(network.clone(), TrainConfig { batch: 64, ..training.clone() }),
                "windows a step 64 (paper: not stated, read as 32)",
            ),
            (of(network, TrainConfig { keep_best: true, ..training }), "weights of the best epoch"),
            (Settings { folds: 5, ..Settings::paper() }.budget(0.01), "folds 5 (paper: 10)"),
        ];
        for (budget, words) in changed {
            assert!(budget.starts_with("SCALED DOWN") && budget.contains(words), "{budget}");
        }
        assert!(!Settings::paper().budget(0.01).contains("heads"), "what is the paper's is not told");
    }

    #[test]
    fn impossible_settings_are_named() {
        let message = |settings: Settings| settings.check().map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message(Settings { seeds: 0, ..Settings::quick() }).contains("`seeds` is 0"));
        let mut other = Settings::quick();
        other.training.network = crate::nn::peers::TcnConfig::default().into();
        assert!(message(other).contains("TCN"));
    }
}
