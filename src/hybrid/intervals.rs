//! Prediction intervals: how far a measured acceleration may lie from the predicted one.
//!
//! Split conformal prediction (Vovk et al., *Algorithmic Learning in a Random World*, 2005) with a local scale (Lei et al., Journal of the
//! American Statistical Association 113, 2018): errors on blocks of flight that the network was not trained on, in units of a spread that
//! grows with the motion, and the quantile of these. The promise is an average over flights like those it was made from. A manoeuvre wilder
//! than any of them is told by `envelope`, not by a wider interval.

use crate::flight::{Column, Flight, PerChannel, Span};
use crate::hybrid::Scale;
use serde::{Deserialize, Serialize};

/// Share of measurements that intervals are to hold.
pub const COVERAGE: f64 = 0.9;

/// Fewest blocks that intervals are made from: of fewer, none left out says much of the others.
pub const FEWEST_BLOCKS: usize = 5;

/// What the motion of a sample is made of: velocities, rates and controls.
const MOTION: &[Column] = Column::STATE.split_at(6).1;

/// Smallest variance without motion, as a share of the mean squared error: a spread of nothing has no use as a scale.
const LEAST_VARIANCE: f64 = 0.01;

/// Rounds of new weights in the fit of a spread.
const ROUNDS: usize = 8;

/// Halvings of the step in which the level of the quantile is found.
const HALVINGS: usize = 20;

/// Prediction intervals around what a hybrid predicts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PredictionIntervals {
    /// Share of measurements that they hold on flights like those they were made from.
    coverage: f64,
    /// Windows that they were made from.
    windows: usize,
    /// Blocks of ten seconds that these lie in.
    blocks: usize,
    /// Of velocities, rates and controls, over the training part.
    motion: Vec<Scale>,
    widths: PerChannel<Width>,
}

/// Half of an interval: √(at_rest² + by_motion² · m²), m² being the mean square of the motion's scaled quantities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Width {
    at_rest: f64,
    by_motion: f64,
}

impl Width {
    fn half(self, motion: f64) -> f64 {
        (self.at_rest.powi(2) + self.by_motion.powi(2) * motion).sqrt()
    }
}

/// One error of the hybrid, of one channel.
#[derive(Clone, Copy, Debug)]
struct Stray {
    /// |measured − predicted|.
    size: f64,
    /// Mean square of the motion's scaled quantities.
    motion: f64,
    /// Block it lies in.
    block: usize,
}

/// A window that the network was not trained on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept<'f> {
    /// Its flight.
    pub flight: &'f Flight,
    /// Its last row.
    pub sample: usize,
    /// What the hybrid predicts there.
    pub predicted: PerChannel<f64>,
    /// The block it lies in, numbered from 0 without gaps.
    pub block: usize,
}

impl PredictionIntervals {
    /// Intervals from windows that the network was not trained on; none from fewer than [`FEWEST_BLOCKS`] blocks. `spans` is what trained,
    /// which gives the motion its scale.
    pub(super) fn new(flights: &[Flight], spans: &[Span], kept: &[Kept<'_>]) -> Option<Self> {
        let blocks = kept.iter().map(|kept| kept.block + 1).max().unwrap_or(0);
        if blocks < FEWEST_BLOCKS {
            return None;
        }
        let scale = |column: &Column| Scale::of(&flights.iter().map(|flight| flight.column(*column)).collect::<Vec<_>>(), spans);
        let mut intervals = Self {
            coverage: COVERAGE,
            windows: kept.len(),
            blocks,
            motion: MOTION.iter().map(scale).collect(),
            widths: PerChannel::splat(Width { at_rest: 0.0, by_motion: 0.0 }),
        };
        let motion: Vec<f64> = kept.iter().map(|kept| intervals.motion(&kept.flight.state(kept.sample))).collect();
        intervals.widths = PerChannel::from_fn(|channel| {
            let stray = |(kept, motion): (&Kept<'_>, &f64)| {
                let measured = kept.flight.column(channel.column())[kept.sample];
                Stray { size: (measured - kept.predicted[channel]).abs(), motion: *motion, block: kept.block }
            };
            width(&kept.iter().zip(&motion).map(stray).collect::<Vec<_>>(), blocks)
        });
        Some(intervals)
    }

    /// Share of measurements that they hold on flights like those they were made from.
    pub const fn coverage(&self) -> f64 {
        self.coverage
    }

    /// Windows, and the blocks of ten seconds they lie in, that they were made from.
    pub const fn made_from(&self) -> (usize, usize) {
        (self.windows, self.blocks)
    }

    /// Half of each interval at a state in the order of [`Column::STATE`], m/s² and rad/s².
    pub fn half_width(&self, state: &[f64; 16]) -> PerChannel<f64> {
        let motion = self.motion(state);
        self.widths.map(|width| width.half(motion))
    }

    /// Half of each interval in the mean motion of the training part.
    pub fn typical(&self) -> PerChannel<f64> {
        self.widths.map(|width| width.half(1.0))
    }

    /// Mean square of the scaled velocities, rates and controls; about 1 over the training part.
    fn motion(&self, state: &[f64; 16]) -> f64 {
        let squares = MOTION.iter().zip(&self.motion).map(|(column, scale)| scale.apply(state[*column as usize]).powi(2));
        squares.sum::<f64>() / MOTION.len() as f64
    }

    /// Refuses numbers that cannot be intervals: a description may come from any file.
    pub(super) fn check(&self) -> std::result::Result<(), String> {
        if !(self.coverage > 0.0 && self.coverage < 1.0) {
            return Err(format!("a coverage of {}", self.coverage));
        }
        if self.motion.len() != MOTION.len() {
            return Err(format!("scales of {} quantities, and motion has {}", self.motion.len(), MOTION.len()));
        }
        if let Some(scale) = self.motion.iter().find(|scale| !(scale.mean.is_finite() && scale.deviation.is_normal())) {
            return Err(format!("a scale of mean {:e} and deviation {:e}", scale.mean, scale.deviation));
        }
        let possible = |width: &&Width| [width.at_rest, width.by_motion].iter().all(|value| value.is_finite() && *value >= 0.0);
        match self.widths.iter().find(|width| !possible(width)) {
            Some(Width { at_rest, by_motion }) => Err(format!("half a width of {at_rest:e} at rest and {by_motion:e} by motion")),
            None => Ok(()),
        }
    }
}

/// The width of a channel: a spread fitted to its errors, times the quantile that holds.
fn width(strays: &[Stray], blocks: usize) -> Width {
    let (at_rest, by_motion) = variance(strays);
    let spread = Width { at_rest: at_rest.sqrt(), by_motion: by_motion.sqrt() };
    if at_rest == 0.0 {
        // Not one error at all: there is nothing to measure in.
        return spread;
    }
    let mut scores: Vec<(f64, usize)> = strays.iter().map(|stray| (stray.size / spread.half(stray.motion), stray.block)).collect();
    scores.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
    let factor = quantile(&scores, blocks);
    Width { at_rest: spread.at_rest * factor, by_motion: spread.by_motion * factor }
}

/// The variance of the errors as a + b m², a and b not negative: least squares on the squares, weighted by the inverse of the variance
/// squared (Gaussian pseudo-likelihood; Davidian & Carroll, Journal of the American Statistical Association 82, 1987).
fn variance(strays: &[Stray]) -> (f64, f64) {
    let mean = strays.iter().map(|stray| stray.size.powi(2)).sum::<f64>() / strays.len() as f64;
    if mean == 0.0 {
        return (0.0, 0.0);
    }
    let least = LEAST_VARIANCE * mean;
    let (mut rest, mut slope) = (mean, 0.0);
    for _ in 0..ROUNDS {
        let mut sums = [0.0; 5];
        for Stray { size, motion, .. } in strays {
            let weight = (rest + slope * motion).max(least).powi(-2);
            let square = size.powi(2);
            let terms = [1.0, *motion, motion * motion, square, square * motion];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        }
        let [ones, m, mm, y, my] = sums;
        let determinant = ones * mm - m * m;
        if determinant <= f64::EPSILON * ones * mm {
            // The motion never changes: nothing depends on it.
            return (y / ones, 0.0);
        }
        let (free_rest, free_slope) = ((mm * y - m * my) / determinant, (ones * my - m * y) / determinant);
        (rest, slope) = match (free_rest >= least, free_slope >= 0.0) {
            (true, true) => (free_rest, free_slope),
            (false, true) => (least, ((my - least * m) / mm).max(0.0)),
            (_, false) => (y / ones, 0.0),
        };
    }
    (rest, slope)
}

/// The score within which a new block's measurements lie on average with [`COVERAGE`]: the quantile at the level at which blocks that are left out,
/// one after the other, are held so on the average by the others. The plain quantile of few blocks is too small, that which is sure for
/// every one (conformal prediction with a block as one score) nearly the largest of all. `scores` with their blocks, sorted.
fn quantile(scores: &[(f64, usize)], blocks: usize) -> f64 {
    let mut count = vec![0_usize; blocks];
    scores.iter().for_each(|(_, block)| count[*block] += 1);
    let holds = |level: f64| {
        let of_block = |block: usize| {
            let others = scores.len() - count[block];
            let wanted = ((others as f64 * level).ceil() as usize).clamp(1, others);
            let (mut seen, mut inside) = (0, 0);
            for (_, other) in scores {
                if *other == block {
                    inside += usize::from(seen < wanted);
                } else {
                    seen += 1;
                }
            }
            inside as f64 / count[block] as f64
        };
        (0..blocks).map(of_block).sum::<f64>() / blocks as f64
    };
    let (mut low, mut high) = (COVERAGE / 2.0, 1.0);
    for _ in 0..HALVINGS {
        let level = f64::midpoint(low, high);
        if holds(level) < COVERAGE { low = level } else { high = level }
    }
    let place = ((scores.len() as f64 * high).ceil() as usize).clamp(1, scores.len());
    scores[place - 1].0
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::random::Stream;
    use std::f64::consts::TAU;

    /// A normal number (Box & Muller 1958).
    fn normal(stream: Stream, index: u64) -> f64 {
        (-2.0 * (1.0 - stream.uniform(2 * index)).ln()).sqrt() * (TAU * stream.uniform(2 * index + 1)).cos()
    }

    /// Errors whose spread is √(a + b m²), normal, in `blocks` blocks of `of_each`, each with a size of its own around that.
    fn strays(stream: Stream, blocks: usize, of_each: usize, (a, b): (f64, f64)) -> Vec<Stray> {
        let one = |index: usize| {
            let block = index / of_each;
            let of_block = 0.7 + 0.6 * stream.sub(0).uniform(block as u64);
            let motion = 3.0 * stream.sub(1).uniform(index as u64);
            Stray { size: (normal(stream.sub(2), index as u64) * of_block * (a + b * motion).sqrt()).abs(), motion, block }
        };
        (0..blocks * of_each).map(one).collect()
    }

    #[test]
    fn a_spread_that_grows_with_the_motion_is_found() {
        let (rest, slope) = variance(&strays(Stream::new(7, 0, 0, 0), 200, 100, (0.25, 1.0)));
        // The sizes of the blocks have a mean square of 1.03.
        assert!((rest / 0.25 - 1.03).abs() < 0.15 && (slope - 1.03).abs() < 0.15, "{rest} {slope}");
    }

    #[test]
    fn a_spread_that_falls_with_the_motion_is_taken_as_constant() {
        let mut falling = strays(Stream::new(8, 0, 0, 0), 20, 50, (1.0, 0.0));
        falling.iter_mut().for_each(|stray| stray.size /= 1.0 + stray.motion);
        assert_eq!(variance(&falling).1.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn new_blocks_are_held_with_the_coverage_that_is_promised() {
        // Twelve blocks are what twenty minutes leave; the promise is of the mean over many such sets, and the mean of 300 scatters by 0.3 %.
        let (mut inside, mut all) = (0_usize, 0_usize);
        for set in 0..300 {
            let width = width(&strays(Stream::new(9, set, 0, 0), 12, 80, (0.2, 0.8)), 12);
            for stray in strays(Stream::new(9, set, 1, 0), 40, 10, (0.2, 0.8)) {
                inside += usize::from(stray.size <= width.half(stray.motion));
                all += 1;
            }
        }
        let found = inside as f64 / all as f64;
        assert!((found - COVERAGE).abs() < 0.01, "{found}");
    }

    #[test]
    fn where_the_motion_never_changes_there_is_one_width() {
        let mut still = strays(Stream::new(10, 0, 0, 0), 20, 50, (1.0, 0.0));
        still.iter_mut().for_each(|stray| stray.motion = 0.3);
        assert_eq!(width(&still, 20).by_motion.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn errors_of_nothing_have_an_interval_of_nothing() {
        let nothing: Vec<Stray> =
            (0..60).map(|index| Stray { size: 0.0, motion: f64::from(index), block: index as usize / 10 }).collect();
        assert_eq!(width(&nothing, 6).half(1.0).to_bits(), 0.0_f64.to_bits());
    }
}
