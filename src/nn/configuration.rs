//! What the sizes of every network have in common: what they say about it, and the bounds they keep. Which networks there are, nothing here
//! knows.

use super::layers::Recorder;
use crate::nn::error::{Error, Result};
use crate::tape::{self, Var};
use phyture_kernels::Real;

/// Channels of P and of the prediction: three linear and three angular accelerations (eqs. 11 and 16).
pub(crate) const ACCELERATIONS: usize = 6;

/// Bounds of any size, far above every sensible one: a hostile file cannot ask for a graph or a slab that exhausts the machine.
pub(crate) const LARGEST_HISTORY: usize = 100_000;
pub(crate) const LARGEST_WIDTH: usize = 4096;
pub(crate) const LARGEST_KERNEL: usize = 255;

/// What a network's sizes have to say about it.
pub(crate) trait Configuration {
    /// As it stands in tables.
    fn name(&self) -> &'static str;

    /// H, samples of the history.
    fn history(&self) -> usize;

    /// Channels of S.
    fn state_channels(&self) -> usize;

    /// Channels of P.
    fn physics_channels(&self) -> usize {
        ACCELERATIONS
    }

    /// Channels predicted.
    fn outputs(&self) -> usize {
        ACCELERATIONS
    }

    /// Rows predicted.
    fn horizon(&self) -> usize {
        1
    }

    /// Whether the output is the residual, to which the baseline is added, or the acceleration itself.
    fn predicts_residual(&self) -> bool {
        false
    }

    /// Whether P reaches the output.
    fn reads_physics(&self) -> bool {
        false
    }

    /// Whether training draws random numbers.
    fn is_random(&self) -> bool;

    /// Checks each field and how they fit together.
    fn check(&self) -> Result<()>;

    /// Records the network: S `[H, state_channels]` and P `[H, physics_channels]` to `[horizon, outputs]` at unit scale.
    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, physics: Var) -> tape::Result<Var>
    where
        Self: Sized;
}

/// Checks that sizes lie in 1 to their largest value, and numbers in their range.
pub(crate) fn check_ranges(sizes: &[(&str, usize, usize)], reals: &[(&str, f64, f64, f64)]) -> Result<()> {
    for &(field, value, largest) in sizes {
        if value == 0 || value > largest {
            return Err(refused(field, value, format!("1 to {largest}")));
        }
    }
    for &(field, value, smallest, largest) in reals {
        if !(value >= smallest && value <= largest) {
            return Err(refused(field, value, format!("{smallest} to {largest}")));
        }
    }
    Ok(())
}

/// Checks sizes, and those of a stack of convolutions whose kernels have a middle, with dropout after them.
pub(crate) fn check_convolutions(
    sizes: &[(&'static str, usize, usize)],
    channels: &[usize],
    kernels: &[usize],
    dropout: f64,
) -> Result<()> {
    let channels = channels.iter().map(|&channels| ("channels", channels, LARGEST_WIDTH));
    let each = channels.chain(kernels.iter().map(|&kernel| ("kernels", kernel, LARGEST_KERNEL)));
    check_ranges(&sizes.iter().copied().chain(each).collect::<Vec<_>>(), &[("dropout", dropout, 0.0, 0.95)])?;
    if kernels.iter().any(|kernel| kernel.is_multiple_of(2)) {
        return Err(refused("kernels", format!("{kernels:?}"), "odd kernels, which have a middle"));
    }
    Ok(())
}

/// The error for a size that cannot be.
pub(crate) fn refused(field: &str, found: impl std::fmt::Display, expected: impl Into<String>) -> Error {
    Error::Size { field: field.into(), found: found.to_string(), expected: expected.into() }
}
