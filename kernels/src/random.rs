//! Random words without a state: word i of a stream is a function of i and of the stream's key.
//!
//! A dropout mask is made in the forward pass and made again, in any order, in the backward pass; nothing of it is stored. Only
//! integer operations: the same bits at every level, on every machine, in every order, on any number of threads.
//!
//! Keys are mixed with SplitMix64's finaliser (Steele, Lea & Flood 2014); words with MurmurHash3's 32-bit finaliser (Appleby
//! 2011), keyed before its first and inside its second round, so that two streams are not shifted copies of each other.
//! For dropout and initial weights; not for secrets.

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
