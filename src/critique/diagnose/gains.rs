//! Gains of blocks: what a change of the model does for the held-out error of each, bounded, so that no few blocks decide.

use super::engine::{Engine, Errors, Trial};
use super::gates::LARGEST_GAIN;
use crate::flight::{Channel, PerChannel};

/// A block's gain: half the logarithm of the ratio of its held-out errors, over the channels, within bounds.
pub(super) fn gains(base: &Trial, trial: &Trial) -> Vec<f64> {
    gains_of(&base.errors, &trial.errors, &trial.changed)
}

/// The same of squared errors before and after, by channel and block, over some channels.
pub(super) fn gains_of(before: &Errors, after: &Errors, channels: &PerChannel<bool>) -> Vec<f64> {
    (0..before[Channel::VxDot].len())
        .map(|block| {
            Channel::ALL
                .into_iter()
                .filter(|&channel| channels[channel])
                .map(|channel| {
                    let gain = 0.5 * (before[channel][block] / after[channel][block]).ln();
                    if gain.is_finite() { gain.clamp(-LARGEST_GAIN, LARGEST_GAIN) } else { 0.0 }
                })
                .sum()
        })
        .collect()
}

/// Gains of blocks, added up by flight.
pub(super) fn by_flight_of(engine: &Engine<'_>, gains: &[f64]) -> Vec<f64> {
    engine.runs().map(|run| gains[run].iter().sum()).collect()
}

/// Mean difference of paired gains times their number, and its standard error.
pub(super) fn paired(left: &[f64], right: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> = left.iter().zip(right).map(|(left, right)| left - right).collect();
    let count = differences.len().max(1) as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean * count, (variance * count).sqrt())
}
