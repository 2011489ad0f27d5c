//! What a training run is told: sizes, budget, seeds. Checked once, before any work.

use super::schedule::WARMUP_EPOCHS;
use crate::error::{Error, Result};
use crate::flight::windows::TRAINING_STRIDE;
use crate::hybrid::linear::LinearConfig;
use crate::nn::Architecture;
use serde::{Deserialize, Serialize};

/// Settings of a training run. Every field has a default, the paper's where it states one.
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
    /// Passes over the training windows. Default 100; the paper does not state its number.
    pub epochs: usize,
    /// Windows a step. Default 32.
    pub batch: usize,
    /// Peak learning rate. Default 1e-3 (paper section 4.2).
    pub peak_rate: f64,
    /// Epochs of warm-up, at most a tenth of all. Default 10 (paper section 4.2).
    pub warmup_epochs: usize,
    /// Samples between training windows. Default 50.
    pub stride: usize,
    /// Weight of each channel's squared error in the loss is 1/σ² of the residual instead of 1. Default off (paper eq. 13).
    pub standardise_loss: bool,
    /// Every so many-th 10-s block of the training part is kept from the network to fit its gate on, one factor a channel
    /// between 0 and 1; 0 keeps none and sets no gate, as in the paper. Default 0.
    pub gate_every: usize,
    /// Seed of initial weights, order and dropout. Default 0.
    pub seed: u64,
    /// Seconds between checkpoints. Default 30.
    pub checkpoint_s: f64,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            network: Architecture::default(),
            inputs: crate::flight::Column::STATE.iter().map(|column| column.name().to_owned()).collect(),
            linear: None,
            epochs: 100,
            batch: 32,
            peak_rate: 1e-3,
            warmup_epochs: WARMUP_EPOCHS,
            stride: TRAINING_STRIDE,
            standardise_loss: false,
            gate_every: 0,
            seed: 0,
            checkpoint_s: 30.0,
        }
    }
}

impl TrainConfig {
    /// Reads a TOML file; what it leaves out keeps its default.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Config`] naming line and field, with the fields there are.
    #[cfg(feature = "files")]
    pub fn read(path: &std::path::Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        let config: Self = toml::from_str(&text).map_err(|error| Error::File { path: path.into(), message: error.to_string() })?;
        config.check()?;
        Ok(config)
    }

    /// Checks every field against its range.
    ///
    /// # Errors
    /// [`Error::Config`] naming the field, its value and its range.
    pub fn check(&self) -> Result<()> {
        let at_least_one = [("epochs", self.epochs), ("batch", self.batch), ("stride", self.stride)];
        if let Some((field, value)) = at_least_one.into_iter().find(|(_, value)| *value == 0) {
            return Err(fault(field, value, "at least 1"));
        }
        if !(self.peak_rate > 0.0 && self.peak_rate <= 1.0) {
            return Err(fault("peak_rate", self.peak_rate, "a learning rate above 0 and at most 1"));
        }
        if !(self.checkpoint_s >= 0.0 && self.checkpoint_s.is_finite()) {
            return Err(fault("checkpoint_s", self.checkpoint_s, "seconds, 0 or more"));
        }
        if self.inputs.len() != self.network.state_channels() {
            return Err(fault(
                "network.state_channels",
                self.network.state_channels(),
                &format!("the number of inputs, {}", self.inputs.len()),
            ));
        }
        if self.gate_every == 1 {
            return Err(fault("gate_every", 1, "0 (no gate), or 2 and more: 1 would leave nothing to train on"));
        }
        self.linear.as_ref().map_or(Ok(()), LinearConfig::check)?;
        self.network.check()
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
        assert!(message(TrainConfig { inputs: vec!["vx".into()], ..Default::default() }).contains("state_channels"));
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
