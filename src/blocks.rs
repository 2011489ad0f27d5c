//! Blocks of ten seconds and the intervals that rest on them.
//!
//! Neighbouring samples of a flight are far from independent: an error lasts as long as the manoeuvre that causes it. A mean
//! over samples is therefore given an interval from means over *blocks*, which are taken as independent. This file cuts
//! windows into blocks and turns block sums into a mean and its 95 % interval. It does not know what is averaged.

use crate::flight::{Flight, Window};
use crate::student_t::{quantile_975, upper_quantile};

/// Length of a block, s. Longer than the manoeuvres and the slow attitude and speed modes of a small helicopter (1 s to 5 s).
pub const BLOCK_S: f64 = 10.0;

/// Blocks below which an interval is shown but marked: Student's t is then above 2.8 and rests on the block means being normal.
pub const FEW_BLOCKS: usize = 5;

/// The block of every window, numbered from 0 without gaps in the order of flight and time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// One entry a window: the number of its block.
    pub of_window: Vec<usize>,
    /// One entry a block: the flight and the ten seconds of that flight, counted from its first sample.
    pub keys: Vec<(usize, usize)>,
}

impl Blocks {
    /// Cuts windows into blocks of [`BLOCK_S`] by the time of their last row. A flight starts a new block.
    ///
    /// A window whose flight is not in `flights` is given the block of a flight with a step of one second; callers check before.
    pub fn new(flights: &[Flight], windows: &[Window]) -> Self {
        let key = |window: &Window| {
            let step_s = flights.get(window.flight).map_or(1.0, |flight| flight.step_s);
            // A block holds a whole number of samples, so that rounding of the step cannot move a sample across.
            let samples = (BLOCK_S / step_s).round().max(1.0) as usize;
            (window.flight, window.last / samples)
        };
        let mut keys: Vec<(usize, usize)> = windows.iter().map(key).collect();
        keys.sort_unstable();
        keys.dedup();
        let of_window = windows.iter().map(|window| keys.partition_point(|other| *other < key(window))).collect();
        Self { of_window, keys }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there is no block, which is to say no window.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }
}

/// Number of samples of one block and the sum of a quantity over them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockSum {
    /// Samples.
    pub samples: f64,
    /// Sum over the samples.
    pub sum: f64,
}

/// A mean over samples with the standard error that the scatter between blocks gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockMean {
    /// Σ sums / Σ samples.
    pub mean: f64,
    /// Standard error of the mean; absent with fewer than two blocks.
    pub standard_error: Option<f64>,
    /// Blocks that hold at least one sample.
    pub blocks: usize,
}

impl BlockMean {
    /// The ratio estimate m = Σ sᵦ / Σ nᵦ over blocks b and its sandwich variance
    /// B/(B−1) · Σ (sᵦ − m nᵦ)² / (Σ nᵦ)² (Cochran, *Sampling Techniques*, 3rd ed., eq. 6.13 without the finite-population
    /// factor). Blocks without samples are left out. `None` if there is no sample at all.
    pub fn new(sums: impl Iterator<Item = BlockSum> + Clone) -> Option<Self> {
        Self::ratio(sums.filter(|block| block.samples > 0.0))
    }

    /// The same estimate for the ratio of any two sums over the same blocks, paired block by block: [`BlockSum::samples`] is then
    /// the part of the denominator that lies in the block and may be zero. `None` if the denominators do not add up to a
    /// positive number.
    pub fn ratio(sums: impl Iterator<Item = BlockSum> + Clone) -> Option<Self> {
        let (mut blocks, mut samples, mut sum) = (0_usize, 0.0, 0.0);
        for block in sums.clone() {
            blocks += 1;
            samples += block.samples;
            sum += block.sum;
        }
        if !(samples > 0.0 && samples.is_finite()) {
            return None;
        }
        let mean = sum / samples;
        let standard_error = (blocks > 1).then(|| {
            let scatter: f64 = sums.map(|block| (block.sum - mean * block.samples).powi(2)).sum();
            let count = blocks as f64;
            (count / (count - 1.0) * scatter).sqrt() / samples
        });
        Some(Self { mean, standard_error, blocks })
    }

    /// 95 % interval of the mean, mean ± t · standard error with B − 1 degrees of freedom.
    pub fn interval(&self) -> Option<[f64; 2]> {
        self.interval_of(1)
    }

    /// One of so many intervals that all hold together with 95 % (Bonferroni).
    pub fn interval_of(&self, count: usize) -> Option<[f64; 2]> {
        let half = upper_quantile(0.025 / count.max(1) as f64, self.blocks.saturating_sub(1) as f64) * self.standard_error?;
        Some([self.mean - half, self.mean + half])
    }

    /// 95 % interval of a mean that cannot be negative, made on the logarithm so that it stays so: m · exp(± t · se / m) (delta
    /// method).
    pub fn positive_interval(&self) -> Option<[f64; 2]> {
        let standard_error = self.standard_error?;
        if self.mean <= 0.0 {
            return Some([0.0, 0.0]);
        }
        let half = quantile_975(self.blocks.saturating_sub(1) as f64) * standard_error / self.mean;
        Some([self.mean * (-half).exp(), self.mean * half.exp()])
    }

    /// 95 % interval of the square root of a mean of squares, made on the logarithm so that it stays positive:
    /// √m · exp(± t · se / (2 m)) (delta method).
    pub fn root_interval(&self) -> Option<[f64; 2]> {
        let standard_error = self.standard_error?;
        if self.mean <= 0.0 {
            return Some([0.0, 0.0]);
        }
        let half = quantile_975(self.blocks.saturating_sub(1) as f64) * standard_error / (2.0 * self.mean);
        let root = self.mean.sqrt();
        Some([root * (-half).exp(), root * half.exp()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    #[test]
    fn equal_blocks_give_the_textbook_standard_error() {
        // Block means 1, 2, 3, 4 of 5 samples each: s² = 5/3, se = sqrt(s² / 4).
        let sums = [1.0, 2.0, 3.0, 4.0].map(|mean| BlockSum { samples: 5.0, sum: 5.0 * mean });
        let mean = BlockMean::new(sums.into_iter());
        let expected = (5.0_f64 / 3.0 / 4.0).sqrt();
        assert!(mean.is_some_and(|mean| (mean.mean - 2.5).abs() <= CLOSE && mean.blocks == 4));
        assert!(mean.and_then(|mean| mean.standard_error).is_some_and(|error| (error - expected).abs() <= CLOSE));
    }

    #[test]
    fn one_block_has_no_interval_and_none_has_no_mean() {
        let one = BlockMean::new([BlockSum { samples: 3.0, sum: 6.0 }].into_iter());
        assert!(one.is_some_and(|mean| mean.mean.to_bits() == 2.0_f64.to_bits() && mean.interval().is_none()));
        assert_eq!(BlockMean::new([BlockSum::default()].into_iter()), None);
    }

    proptest! {
        #[test]
        fn the_interval_holds_the_mean_and_scales(sums in prop::collection::vec((1.0..50.0_f64, 0.0..9.0_f64), 2..20), by in 0.1..10.0_f64) {
            let make = |by: f64| BlockMean::new(sums.iter().map(move |(samples, value)| BlockSum { samples: *samples, sum: by * samples * value }));
            let (one, other) = (make(1.0), make(by));
            let inside = |mean: BlockMean| mean.interval().is_some_and(|[low, high]| low <= mean.mean && mean.mean <= high);
            prop_assert!(one.is_some_and(inside));
            let scaled = one.zip(other).is_some_and(|(a, b)| (a.mean * by - b.mean).abs() <= CLOSE * b.mean.abs().max(1.0));
            prop_assert!(scaled);
            let positive = one.and_then(|mean| mean.root_interval()).is_some_and(|[low, high]| 0.0 <= low && low <= high);
            prop_assert!(positive);
            // Its square root is the interval of the square root.
            let squared = one.and_then(|mean| Some((mean.positive_interval()?, mean.root_interval()?)));
            let same = |(of, root): ([f64; 2], [f64; 2])| (0..2).all(|end| (of[end].sqrt() - root[end]).abs() <= CLOSE * root[end].max(1.0));
            prop_assert!(squared.is_some_and(same));
        }
    }
}
