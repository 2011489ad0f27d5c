//! Gradients of a step in a fixed number of shards, each the sum over some of its samples, and their sum in a fixed order: so no
//! number of threads changes a bit.

use crate::tape::threads::Parallelism;
use phyture_kernels::Real;

/// Gradient shards of a training session: a constant, so that the order of summation is one. More than this many threads bring
/// nothing in training.
pub const SHARDS: usize = 8;

/// Elements summed over the shards at a time, so that the sum stays in cache.
const REDUCE_BLOCK: usize = 4096;

/// Parameter gradients of the samples of one shard.
pub(super) struct Shard<T> {
    pub gradients: Vec<T>,
}

/// gradients = Σ shards, element by element in the order of the shards.
pub(super) fn reduce<T: Real>(
    parallelism: Parallelism,
    gradients: &mut [T],
    shards: &[Shard<T>],
    used: &(dyn Fn(usize) -> bool + Sync),
    start: usize,
) {
    if gradients.len() > REDUCE_BLOCK {
        let half = (gradients.len() / 2).next_multiple_of(REDUCE_BLOCK);
        let (low, high) = gradients.split_at_mut(half.min(gradients.len()));
        return parallelism
            .join(|| reduce(parallelism, low, shards, used, start), || reduce(parallelism, high, shards, used, start + half));
    }
    gradients.fill(T::ZERO);
    for (_, shard) in shards.iter().enumerate().filter(|(index, _)| used(*index)) {
        let part = shard.gradients.get(start..).unwrap_or_default();
        gradients.iter_mut().zip(part).for_each(|(sum, part)| *sum += *part);
    }
}
