//! The networks that the paper compares Phy-Ture with, one file each.
//!
//! All read the history S `[H, 16]` and predict the six accelerations at its last row; the two hybrids predict what the physical
//! baseline leaves over. None normalises a window by itself: that would remove the level on which acceleration depends. Sizes are
//! our recommendations where the paper states none, and every reconstruction is named as one.

mod cnn;
mod cnn_lstm;
mod dlinear;
mod informer;
mod tcn;
mod timemixer;
mod timesnet;

pub use cnn::CnnConfig;
pub use cnn_lstm::CnnLstmConfig;
pub use dlinear::DLinearConfig;
pub use informer::InformerConfig;
pub use tcn::TcnConfig;
pub use timemixer::TimeMixerConfig;
pub use timesnet::TimesNetConfig;

/// A configuration's answers about its own fields, which every peer has.
macro_rules! common_fields {
    () => {
        fn history(&self) -> usize {
            self.history
        }

        fn state_channels(&self) -> usize {
            self.state_channels
        }

        fn is_random(&self) -> bool {
            self.dropout > 0.0
        }
    };
}
use common_fields;
