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

use super::configuration::{LARGEST_KERNEL, LARGEST_WIDTH, check_ranges, refused};

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

/// Checks sizes, and those of a stack of convolutions whose kernels have a middle, with dropout after them.
fn check_convolutions(
    sizes: &[(&'static str, usize, usize)],
    channels: &[usize],
    kernels: &[usize],
    dropout: f64,
) -> super::Result<()> {
    let channels = channels.iter().map(|&channels| ("channels", channels, LARGEST_WIDTH));
    let each = channels.chain(kernels.iter().map(|&kernel| ("kernels", kernel, LARGEST_KERNEL)));
    check_ranges(&sizes.iter().copied().chain(each).collect::<Vec<_>>(), &[("dropout", dropout, 0.0, 0.95)])?;
    if kernels.iter().any(|kernel| kernel.is_multiple_of(2)) {
        return Err(refused("kernels", format!("{kernels:?}"), "odd kernels, which have a middle"));
    }
    Ok(())
}
