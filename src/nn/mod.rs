//! Networks on the tape: layers, Phy-Ture, its ablations and fusion variants, and their weights in safetensors files.
//!
//! A network is a recorded graph plus the rule by which its parameters start. It holds no numbers: parameters are one flat
//! slab, owned by whoever trains or predicts.

mod config;
mod layers;
pub mod parity;
mod phyture;
pub mod safetensors;

pub use config::{PhyTureConfig, Variant};
pub use layers::{Init, Recorder};
pub(crate) use phyture::LossRule;
pub use phyture::{Network, OutputScale};
