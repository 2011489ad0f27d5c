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
}

impl Settings {
    /// Most seeds of a network.
    pub const MOST_SEEDS: usize = 1000;
    /// Most parts that the manoeuvre classes are cut into.
    pub const MOST_FOLDS: usize = 1000;

    /// The paper's sizes; where it states none, our reading: 100 epochs, a training window every 0.5 s, a test window every 0.1 s.
    pub fn paper() -> Self {
        let training = TrainConfig::default();
        Self { training, seeds: PAPER_SEEDS, test_stride: 10, folds: PAPER_FOLDS, split_seed: BENCHMARK_SEED }
    }

    /// The comparison of the methods on two hours of flight in an hour on two cores.
    pub fn hour() -> Self {
        let network = PhyTureConfig { history: 128, d_model: 32, ..PhyTureConfig::default() };
        let training = TrainConfig { network: network.into(), epochs: 5, ..TrainConfig::default() };
        Self { training, seeds: 3, ..Self::paper() }
    }

    /// Everything at a size that shows that it works and nothing else.
    pub fn quick() -> Self {
        let network = PhyTureConfig { history: 64, d_model: 16, levels: 2, stacks: 1, ..PhyTureConfig::default() };
        let training = TrainConfig { network: network.into(), epochs: 2, stride: 100, ..TrainConfig::default() };
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
        ];
        counts.into_iter().find(|(_, count, most)| !(1..=*most).contains(count)).map_or(Ok(()), |(field, count, most)| {
            let (place, expected) = ("benchmark".into(), format!("1 to {most}"));
            Err(Error::Config { place, field: field.into(), found: count.to_string(), expected })
        })
    }

    /// The budget in a sentence; what is less than in the paper (or than our reading of it) is named with the paper's figure.
    pub fn budget(&self, step_s: f64) -> String {
        let (ours, paper) = (&self.training, Self::paper());
        let (Ok(network), Ok(whole)) = (self.phyture(), paper.phyture()) else { return String::new() };
        let seconds = |samples: usize| format!("{:.2} s", samples as f64 * step_s);
        let figures = [
            (network.history < whole.history, "history", seconds(network.history), "10.00 s".into()),
            (
                network.d_model < whole.d_model,
                "width of Phy-Ture (all other widths in proportion)",
                network.d_model.to_string(),
                whole.d_model.to_string(),
            ),
            (network.stacks < whole.stacks, "trees", network.stacks.to_string(), whole.stacks.to_string()),
            (ours.epochs < paper.training.epochs, "epochs", ours.epochs.to_string(), "not stated, read as 100".into()),
            (
                ours.stride > paper.training.stride,
                "a training window every",
                seconds(ours.stride),
                "not stated, read as 0.50 s".into(),
            ),
            (self.seeds < PAPER_SEEDS, "seeds", self.seeds.to_string(), PAPER_SEEDS.to_string()),
        ];
        let label = if figures.iter().any(|(less, ..)| *less) { "SCALED DOWN" } else { "Full budget" };
        let words =
            figures.map(
                |(_, name, found, expected): (bool, &str, String, String)| {
                    if found == expected { format!("{name} {found}") } else { format!("{name} {found} (paper: {expected})") }
                },
            );
        format!("{label}: {}; test windows every {}", words.join(", "), seconds(self.test_stride))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_possible_and_say_what_they_are() -> Result<()> {
        for (settings, label) in [(Settings::paper(), "Full budget"), (Settings::hour(), "SCALED"), (Settings::quick(), "SCALED")] {
            settings.check()?;
            assert!(settings.budget(0.01).starts_with(label), "{}", settings.budget(0.01));
        }
        assert!(Settings::hour().budget(0.01).contains("history 1.28 s (paper: 10.00 s)"));
        Ok(())
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
