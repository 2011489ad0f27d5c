//! The memory of one sample in flight: one stretch of numbers at an aligned start. What lies where in it is the plan's.

use super::plan::{ALIGNMENT_BYTES, alignment};
use phyture_kernels::Real;

/// Activations, gradients of activations, workspaces and scratch of one sample, at an aligned start.
pub(super) struct Slab<T> {
    numbers: Vec<T>,
    len: usize,
}

impl<T: Real> Slab<T> {
    pub(super) fn new(len: usize) -> Self {
        Self { numbers: vec![T::ZERO; len + alignment::<T>()], len }
    }

    pub(super) fn aligned(&mut self) -> &mut [T] {
        let skip = self.numbers.as_ptr().align_offset(ALIGNMENT_BYTES).min(alignment::<T>());
        self.numbers.get_mut(skip..skip + self.len).unwrap_or_default()
    }
}
