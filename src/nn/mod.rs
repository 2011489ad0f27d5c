//! Networks on the tape: layers, Phy-Ture, its ablations and fusion variants, the peers, and their weights in safetensors files.
//!
//! A network is a recorded graph plus the rule by which its parameters start. It holds no numbers: parameters are one flat
//! slab, owned by whoever trains or predicts.

mod architecture;
mod config;
mod configuration;
mod error;
mod layers;
mod network;
#[cfg(feature = "disk")]
pub mod parity;
pub mod peers;
mod phyture;
pub mod safetensors;

pub use architecture::Architecture;
pub use config::{PhyTureConfig, Variant};
pub use error::{Error, Result};
pub use layers::{Init, Recorder};
pub(crate) use network::LossRule;
pub use network::{Network, OutputScale};
