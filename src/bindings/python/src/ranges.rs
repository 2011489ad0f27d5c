//! Ranges of whole numbers that Python gives: beyond them nothing would be computed, or nothing be left of the memory.

use phyture::hybrid::linear::LinearConfig;
use phyture::train::TrainConfig;
use phyture::{Error, Result};
use std::ops::RangeInclusive;

/// Samples between windows, or between starts of rollouts.
pub const STRIDES: RangeInclusive<usize> = 1..=TrainConfig::MOST_STRIDE;
/// Steps of a rollout.
pub const HORIZONS: RangeInclusive<usize> = 1..=100_000;
/// Lags of a ridge regression.
pub const LAGS: RangeInclusive<usize> = 1..=LinearConfig::MOST_LAGS;
/// Effects that a search names, at most.
pub const EFFECTS: RangeInclusive<usize> = 1..=100;

/// Refuses a number outside its range.
pub fn check(field: &str, value: Option<usize>, range: &RangeInclusive<usize>) -> Result<()> {
    match value.filter(|value| !range.contains(value)) {
        None => Ok(()),
        Some(value) => Err(Error::Config {
            place: "arguments".into(),
            field: field.into(),
            found: value.to_string(),
            expected: format!("{} to {}", range.start(), range.end()),
        }),
    }
}
