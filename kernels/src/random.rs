//! Random words without a state: word i of a stream is a function of i and of the stream's key.
//!
//! A dropout mask is made in the forward pass and made again, in any order, in the backward pass; nothing of it is stored. Only
//! integer operations: the same bits at every level, on every machine, in every order, on any number of threads.
//!
//! Keys are mixed with SplitMix64's finaliser (Steele, Lea & Flood 2014); words with MurmurHash3's 32-bit finaliser (Appleby
//! 2011), keyed before its first and inside its second round, so that two streams are not shifted copies of each other.
//! For dropout and initial weights; not for secrets.

use alloc::vec::Vec;

/// Where in a run random words are drawn: the seed, and what makes this draw different from all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    key: u64,
}

/// SplitMix64's finaliser: a bijection of 64 bits in which every input bit moves every output bit.
#[inline(always)]
const fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// 2⁶⁴ over the golden ratio: SplitMix64's increment.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

impl Stream {
    /// The stream of one dropout site (or one initialised tensor) for one sample of one training step.
    pub const fn new(seed: u64, step: u64, site: u64, sample: u64) -> Self {
        Self { key: mix64(seed.wrapping_add(GOLDEN)) }.sub(step).sub(site).sub(sample)
    }

    /// A stream of its own for part `index` of this one, for example a row.
    #[inline(always)]
    pub const fn sub(self, index: u64) -> Self {
        Self { key: mix64(self.key.wrapping_add(index.wrapping_mul(GOLDEN)).wrapping_add(GOLDEN)) }
    }

    /// Word `index` of the stream, uniform on 0..2³².
    #[inline(always)]
    pub const fn word(self, index: u32) -> u32 {
        let (low, high) = self.halves();
        word(low, high, index)
    }

    /// The key as [`word`] takes it.
    #[inline(always)]
    pub(crate) const fn halves(self) -> (u32, u32) {
        (self.key as u32, (self.key >> 32) as u32)
    }

    /// Uniform on [0, 1) with 53 bits, from a sub-stream of its own: for initial weights and shuffles.
    #[inline(always)]
    pub const fn uniform(self, index: u64) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (mix64(self.sub(index).key) >> 11) as f64 * STEP
    }
}

/// A random order of `0..count`, another for each `round` of a run (Fisher & Yates 1938; Durstenfeld 1964).
pub fn permutation(count: usize, seed: u64, round: u64) -> Vec<u32> {
    /// A site no dropout has: sites count from 0.
    const ORDER: u64 = u64::MAX;
    let stream = Stream::new(seed, round, ORDER, 0);
    let mut order: Vec<u32> = (0..u32::try_from(count).unwrap_or(u32::MAX)).collect();
    for last in (1..order.len()).rev() {
        let chosen = (stream.uniform(last as u64) * (last + 1) as f64) as usize;
        order.swap(last, chosen.min(last));
    }
    order
}

/// Word `index` of the stream whose key has these halves; apart from [`Stream`] so that a loop over streams vectorises.
#[inline(always)]
pub(crate) const fn word(low: u32, high: u32, index: u32) -> u32 {
    let x = index ^ low;
    let x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    let x = (x ^ (x >> 13)).wrapping_add(high).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Half-width of an interval that a mean of `count` draws of variance `variance` leaves with probability 1e-9 (6.1 σ).
    fn six_sigma(variance: f64, count: u32) -> f64 {
        6.1 * (variance / f64::from(count)).sqrt()
    }

    const COUNT: u32 = 1 << 18;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn every_bit_is_fair_and_neighbours_are_independent(seed: u64, step in 0_u64..100, site in 0_u64..100, sample in 0_u64..100) {
            let stream = Stream::new(seed, step, site, sample);
            for lag in [1, 2, 16, 64, 1000] {
                let (mut ones, mut equal) = ([0_u32; 32], [0_u32; 32]);
                for i in 0..COUNT {
                    let (x, y) = (stream.word(i), stream.word(i + lag));
                    for bit in 0..32 {
                        ones[bit] += x >> bit & 1;
                        equal[bit] += !(x ^ y) >> bit & 1;
                    }
                }
                for bit in 0..32 {
                    for count in [ones[bit], equal[bit]] {
                        let share = f64::from(count) / f64::from(COUNT);
                        prop_assert!((share - 0.5).abs() < six_sigma(0.25, COUNT), "bit {bit}, lag {lag}: {share}");
                    }
                }
            }
        }

        #[test]
        fn streams_that_differ_in_one_number_are_independent(seed: u64, which in 0_usize..4, distance in 1_u64..4) {
            let mut other = [seed, 5, 6, 7];
            other[which] = other[which].wrapping_add(distance);
            let (a, b) = (Stream::new(seed, 5, 6, 7), Stream::new(other[0], other[1], other[2], other[3]));
            for shift in [0, 1, 64] {
                let product = |i: u32| (f64::from(a.word(i)) / TWO_POW_32 - 0.5) * (f64::from(b.word(i + shift)) / TWO_POW_32 - 0.5);
                let mean = (0..COUNT).map(product).sum::<f64>() / f64::from(COUNT);
                prop_assert!(mean.abs() < six_sigma(1.0 / 144.0, COUNT), "covariance {mean} at shift {shift}");
            }
        }

        #[test]
        fn words_fill_their_range_evenly(seed: u64) {
            const BINS: usize = 256;
            let stream = Stream::new(seed, 0, 0, 0);
            let mut counts = [0_u32; BINS];
            (0..COUNT).for_each(|i| counts[(stream.word(i) >> 24) as usize] += 1);
            let expected = f64::from(COUNT) / BINS as f64;
            let chi_squared: f64 = counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
            // 255 degrees of freedom: mean 255, σ = √510; 8 σ on either side.
            prop_assert!((chi_squared - 255.0).abs() < 8.0 * 510_f64.sqrt(), "chi squared {chi_squared}");
        }

        #[test]
        fn uniform_numbers_have_the_moments_of_their_range(seed: u64) {
            let stream = Stream::new(seed, 1, 2, 3);
            let draws: Vec<f64> = (0..u64::from(COUNT)).map(|i| stream.uniform(i)).collect();
            prop_assert!(draws.iter().all(|x| (0.0..1.0).contains(x)));
            let mean = draws.iter().sum::<f64>() / f64::from(COUNT);
            let square = draws.iter().map(|x| x * x).sum::<f64>() / f64::from(COUNT);
            prop_assert!((mean - 0.5).abs() < six_sigma(1.0 / 12.0, COUNT));
            prop_assert!((square - 1.0 / 3.0).abs() < six_sigma(4.0 / 45.0, COUNT));
        }
    }

    const TWO_POW_32: f64 = 4_294_967_296.0;

    /// Masks of resumed runs depend on these bits: they may never change. (Computed from the definition in another language.)
    #[test]
    fn the_bits_are_fixed() {
        let stream = Stream::new(1, 2, 3, 4);
        assert_eq!([stream.word(0), stream.word(1), stream.sub(9).word(u32::MAX)], FIXED);
    }

    const FIXED: [u32; 3] = [1_458_222_062, 3_681_150_238, 1_027_769_888];
}
