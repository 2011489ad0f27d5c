//! How large a log and what is made of it may be: the one place for such numbers.
//!
//! A description or a damaged file can ask for any rate and any number of columns. Each is compared with a bound here before
//! anything is allocated for it. The bounds lie far beyond what is flown and far within what a computer holds.

use std::ops::RangeInclusive;

/// Rates a log may have, Hz: below two samples a second nothing of an aircraft's motion is left, and above 100 kHz no sensor records it. A time
/// column in other units than it is read in falls outside.
#[cfg(feature = "files")]
pub(super) const RATES_HZ: RangeInclusive<f64> = 2.0..=1e5;

/// Steps that a flight may have however it was made, s. Every time in the program over the step is then a number of samples that
/// can be counted.
pub(super) const STEPS_S: RangeInclusive<f64> = 1e-6..=1e4;

/// Columns of a log that are read.
#[cfg(feature = "files")]
pub(super) const MOST_COLUMNS: usize = 10_000;

/// Samples that resampling may make of one log: 55 hours at 100 Hz, 4 GB.
#[cfg(feature = "files")]
pub(super) const MOST_SAMPLES: f64 = 2e7;

/// Samples that resampling may make for each one recorded: a receiver's 5 Hz at 500 Hz. More add nothing, and a small file would become a large flight.
#[cfg(feature = "files")]
pub(super) const MOST_NEW_PER_OLD: f64 = 100.0;

/// Lowest cut-off of the differentiator as a part of the sampling rate: a window of some 40 000 samples.
pub(super) const LOWEST_CUTOFF: f64 = 5e-5;

/// Numbers of a Parquet file: a hundred for each of its bytes. Equal numbers take next to no bytes there, so a small file could hold any amount; of a
/// flight's numbers few are equal.
#[cfg(feature = "parquet")]
pub(super) const MOST_NUMBERS_A_BYTE: usize = 100;

/// Numbers that a Parquet file may hold however small it is: quarter of an hour of 22 columns at 100 Hz.
#[cfg(feature = "parquet")]
pub(super) const FEW_NUMBERS: usize = 2_000_000;
