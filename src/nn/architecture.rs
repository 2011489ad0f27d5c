//! Which network: Phy-Ture with its variants, or one of the peers it is compared with.
//!
//! In a file a network is a table of its sizes with a `kind`; without one it is Phy-Ture, as in files from before there were
//! peers. What the sizes mean is in the file of each network, how its graph is judged in `network`.

use super::config::PhyTureConfig;
use super::configuration::Configuration;
use super::layers::Recorder;
use super::peers::{CnnConfig, CnnLstmConfig, DLinearConfig, InformerConfig, TcnConfig, TimeMixerConfig, TimesNetConfig};
use crate::nn::error::Result;
use crate::tape::{self, Var};
use phyture_kernels::Real;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

/// Key in a file that tells the networks apart.
const KIND: &str = "kind";

/// Kind of a network that a file gives none.
const PHYTURE: &str = "phyture";

/// The one list of the networks: what each is, its kind in files, its variant and its sizes.
macro_rules! architectures {
    ($($(#[$doc:meta])* $kind:literal $variant:ident($config:ty)),* $(,)?) => {
        /// A network and its sizes.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        #[serde(tag = "kind")]
        pub enum Architecture {
            $($(#[$doc])* #[serde(rename = $kind)] $variant($config),)*
            /// Phy-Ture, its ablations and fusion variants. Written without a `kind`, so that earlier programs read it, too.
            #[serde(untagged)]
            PhyTure(PhyTureConfig),
        }

        impl Architecture {
            /// Kinds as they stand in files.
            pub const KINDS: &[&str] = &[PHYTURE, $($kind),*];

            fn configuration(&self) -> &dyn Configuration {
                match self {
                    $(Self::$variant(config) => config,)*
                    Self::PhyTure(config) => config,
                }
            }

            /// Records the network on the inputs S `[H, state_channels]` and P `[H, physics_channels]`; gives `[horizon, outputs]` at
            /// unit scale.
            ///
            /// # Errors
            /// As [`Graph::apply`](crate::tape::Graph::apply).
            pub fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, physics: Var) -> tape::Result<Var> {
                match self {
                    $(Self::$variant(config) => config.record(recorder, state, physics),)*
                    Self::PhyTure(config) => config.record(recorder, state, physics),
                }
            }

            /// The network of a kind from the table of its sizes; `None` if there is no such kind.
            fn of_kind(kind: &str, sizes: Value) -> Option<serde_json::Result<Self>> {
                match kind {
                    PHYTURE => Some(serde_json::from_value(sizes).map(Self::PhyTure)),
                    $($kind => Some(serde_json::from_value(sizes).map(Self::$variant)),)*
                    _ => None,
                }
            }
        }

        from_configuration!(PhyTure(PhyTureConfig), $($variant($config)),*);
    };
}

/// From a network's own configuration, owned or borrowed.
macro_rules! from_configuration {
    ($($variant:ident($config:ty)),*) => {$(
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

architectures!(
    /// CNN hybrid.
    "cnn" Cnn(CnnConfig),
    /// CNN–LSTM hybrid.
    "cnn_lstm" CnnLstm(CnnLstmConfig),
    /// TCN.
    "tcn" Tcn(TcnConfig),
    /// DLinear.
    "dlinear" DLinear(DLinearConfig),
    /// TimeMixer.
    "timemixer" TimeMixer(TimeMixerConfig),
    /// TimesNet.
    "timesnet" TimesNet(TimesNetConfig),
    /// Conv–Informer.
    "informer" Informer(InformerConfig),
);

impl Architecture {
    /// As it stands in tables, for example `Phy-Ture`.
    pub fn name(&self) -> &'static str {
        self.configuration().name()
    }

    /// H, samples of the history.
    pub fn history(&self) -> usize {
        self.configuration().history()
    }

    /// Channels of S.
    pub fn state_channels(&self) -> usize {
        self.configuration().state_channels()
    }

    /// Channels of P: 6.
    pub fn physics_channels(&self) -> usize {
        self.configuration().physics_channels()
    }

    /// Channels predicted: 6.
    pub fn outputs(&self) -> usize {
        self.configuration().outputs()
    }

    /// P, rows predicted: 1, the last of the history, but for some settings of Phy-Ture.
    pub fn horizon(&self) -> usize {
        self.configuration().horizon()
    }

    /// Whether the output is the residual r̂ of eq. 11 (true), to which the physical baseline is added (eq. 12), or the
    /// acceleration itself (false).
    pub fn predicts_residual(&self) -> bool {
        self.configuration().predicts_residual()
    }

    /// Whether the history of the physical baseline is an input that reaches the output.
    pub fn reads_physics(&self) -> bool {
        self.configuration().reads_physics()
    }

    /// Whether training draws random numbers (dropout, sampled keys).
    pub fn is_random(&self) -> bool {
        self.configuration().is_random()
    }

    /// Checks each size and how they fit together.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size) with the field, its value and its range.
    pub fn check(&self) -> Result<()> {
        self.configuration().check()
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

impl<'de> Deserialize<'de> for Architecture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut sizes = Map::<String, Value>::deserialize(deserializer)?;
        let kind = sizes.remove(KIND).unwrap_or_else(|| PHYTURE.into());
        let read = kind.as_str().and_then(|kind| Self::of_kind(kind, Value::Object(sizes)));
        let expected = || D::Error::custom(format!("network kind {kind}; expected one of: {}", Self::KINDS.join(", ")));
        read.ok_or_else(expected)?.map_err(|error| D::Error::custom(format!("network: {error}")))
    }
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
        for &kind in Architecture::KINDS {
            let network: Architecture = serde_json::from_str(&format!(r#"{{"kind": "{kind}", "history": 64}}"#))?;
            assert_eq!(network.history(), 64);
            let text = serde_json::to_string(&network)?;
            assert_eq!(text.contains(KIND), kind != PHYTURE, "{text}");
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
