//! Which network: Phy-Ture with its variants, or one of the peers it is compared with.
//!
//! In a file a network is a table of its sizes with a `kind`; without one it is Phy-Ture, as in files from before there were
//! peers. What the sizes mean is in the file of each network, how its graph is judged in `network`.

use super::config::PhyTureConfig;
use super::configuration::Configuration;
use super::layers::Recorder;
use super::peers::{CnnConfig, CnnLstmConfig, DLinearConfig, InformerConfig, TcnConfig, TimeMixerConfig, TimesNetConfig};
use crate::nn::error::Result;
use crate::tape::Var;
use phyture_kernels::Real;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

/// Key in a file that tells the networks apart.
const KIND: &str = "kind";

/// A network and its sizes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Architecture {
    /// CNN hybrid.
    Cnn(CnnConfig),
    /// CNN–LSTM hybrid.
    #[serde(rename = "cnn_lstm")]
    CnnLstm(CnnLstmConfig),
    /// TCN.
    Tcn(TcnConfig),
    /// DLinear.
    DLinear(DLinearConfig),
    /// TimeMixer.
    TimeMixer(TimeMixerConfig),
    /// TimesNet.
    TimesNet(TimesNetConfig),
    /// Conv–Informer.
    Informer(InformerConfig),
    /// Phy-Ture, its ablations and fusion variants. Written without a `kind`, so that earlier programs read it, too.
    #[serde(untagged)]
    PhyTure(PhyTureConfig),
}

/// An expression of the configuration, whichever it is.
macro_rules! of_each {
    ($architecture:expr, $config:ident => $value:expr) => {
        match $architecture {
            Architecture::PhyTure($config) => $value,
            Architecture::Cnn($config) => $value,
            Architecture::CnnLstm($config) => $value,
            Architecture::Tcn($config) => $value,
            Architecture::DLinear($config) => $value,
            Architecture::TimeMixer($config) => $value,
            Architecture::TimesNet($config) => $value,
            Architecture::Informer($config) => $value,
        }
    };
}

impl Architecture {
    /// As it stands in tables, for example `Phy-Ture`.
    pub fn name(&self) -> &'static str {
        of_each!(self, config => config.name())
    }

    /// H, samples of the history.
    pub fn history(&self) -> usize {
        of_each!(self, config => Configuration::history(config))
    }

    /// Channels of S.
    pub fn state_channels(&self) -> usize {
        of_each!(self, config => Configuration::state_channels(config))
    }

    /// Channels of P: 6.
    pub fn physics_channels(&self) -> usize {
        of_each!(self, config => Configuration::physics_channels(config))
    }

    /// Channels predicted: 6.
    pub fn outputs(&self) -> usize {
        of_each!(self, config => Configuration::outputs(config))
    }

    /// P, rows predicted: 1, the last of the history, but for some settings of Phy-Ture.
    pub fn horizon(&self) -> usize {
        of_each!(self, config => Configuration::horizon(config))
    }

    /// Whether the output is the residual r̂ of eq. 11 (true), to which the physical baseline is added (eq. 12), or the
    /// acceleration itself (false).
    pub fn predicts_residual(&self) -> bool {
        of_each!(self, config => Configuration::predicts_residual(config))
    }

    /// Whether the history of the physical baseline is an input that reaches the output.
    pub fn reads_physics(&self) -> bool {
        of_each!(self, config => Configuration::reads_physics(config))
    }

    /// Whether training draws random numbers (dropout, sampled keys).
    pub fn is_random(&self) -> bool {
        of_each!(self, config => Configuration::is_random(config))
    }

    /// Checks each size and how they fit together.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size) with the field, its value and its range.
    pub fn check(&self) -> Result<()> {
        of_each!(self, config => Configuration::check(config))
    }

    /// Records the network on the inputs S `[H, state_channels]` and P `[H, physics_channels]`; gives `[horizon, outputs]` at
    /// unit scale.
    ///
    /// # Errors
    /// As [`Graph::apply`](crate::tape::Graph::apply).
    pub fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, physics: Var) -> Result<Var> {
        of_each!(self, config => config.record(recorder, state, physics))
    }
}

impl Default for Architecture {
    /// Phy-Ture with the paper's sizes.
    fn default() -> Self {
        Self::PhyTure(PhyTureConfig::default())
    }
}

impl From<&Self> for Architecture {
    fn from(architecture: &Self) -> Self {
        architecture.clone()
    }
}

/// From a network's own configuration, owned or borrowed.
macro_rules! from_configuration {
    ($($variant:ident($config:ty)),* $(,)?) => {$(
        impl From<$config> for Architecture {
            fn from(config: $config) -> Self {
                Self::$variant(config)
            }
        }
        impl From<&$config> for Architecture {
            fn from(config: &$config) -> Self {
                Self::$variant(config.clone())
            }
        }
    )*};
}

from_configuration!(
    PhyTure(PhyTureConfig),
    Cnn(CnnConfig),
    CnnLstm(CnnLstmConfig),
    Tcn(TcnConfig),
    DLinear(DLinearConfig),
    TimeMixer(TimeMixerConfig),
    TimesNet(TimesNetConfig),
    Informer(InformerConfig),
);

impl<'de> Deserialize<'de> for Architecture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut fields = Map::<String, Value>::deserialize(deserializer)?;
        let kind = fields.remove(KIND);
        let fields = Value::Object(fields);
        let read = match kind.as_ref().map(|kind| kind.as_str().unwrap_or_default()) {
            None | Some("phyture") => serde_json::from_value(fields).map(Self::PhyTure),
            Some("cnn") => serde_json::from_value(fields).map(Self::Cnn),
            Some("cnn_lstm") => serde_json::from_value(fields).map(Self::CnnLstm),
            Some("tcn") => serde_json::from_value(fields).map(Self::Tcn),
            Some("dlinear") => serde_json::from_value(fields).map(Self::DLinear),
            Some("timemixer") => serde_json::from_value(fields).map(Self::TimeMixer),
            Some("timesnet") => serde_json::from_value(fields).map(Self::TimesNet),
            Some("informer") => serde_json::from_value(fields).map(Self::Informer),
            Some(_) => {
                let found = kind.unwrap_or_default();
                return Err(D::Error::custom(format!("network kind {found}; expected one of: {}", Self::KINDS.join(", "))));
            }
        };
        read.map_err(|error| D::Error::custom(format!("network: {error}")))
    }
}

impl Architecture {
    /// Kinds as they stand in files.
    pub const KINDS: [&'static str; 8] = ["phyture", "cnn", "cnn_lstm", "tcn", "dlinear", "timemixer", "timesnet", "informer"];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_without_a_kind_is_phy_ture_and_every_kind_comes_back() -> Result<(), serde_json::Error> {
        assert_eq!(
            serde_json::from_str::<Architecture>(r#"{"heads": 2}"#)?,
            PhyTureConfig { heads: 2, ..PhyTureConfig::default() }.into()
        );
        for kind in Architecture::KINDS {
            let network: Architecture = serde_json::from_str(&format!(r#"{{"kind": "{kind}", "history": 64}}"#))?;
            assert_eq!(network.history(), 64);
            let text = serde_json::to_string(&network)?;
            assert_eq!(text.contains(KIND), kind != "phyture", "{text}");
            assert_eq!(serde_json::from_str::<Architecture>(&text)?, network);
        }
        Ok(())
    }

    #[test]
    fn the_defaults_fit_together() -> Result<(), Box<dyn std::error::Error>> {
        for kind in Architecture::KINDS {
            serde_json::from_str::<Architecture>(&format!(r#"{{"kind": "{kind}"}}"#))?.check()?;
        }
        Ok(())
    }

    #[test]
    fn wrong_kinds_and_fields_are_named() {
        let message =
            |text: &str| serde_json::from_str::<Architecture>(text).map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message(r#"{"kind": "transformer"}"#).contains("transformer"));
        assert!(message(r#"{"kind": 7}"#).contains("phyture"));
        assert!(message(r#"{"kind": "phyture", "head": 4}"#).contains("head"));
    }
}
