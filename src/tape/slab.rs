//! The memory of one sample in flight: one stretch of numbers at an aligned start; and the slabs of all threads of a session. What lies
//! where in a slab is the plan's.

use phyture_kernels::Real;
use std::sync::{Mutex, PoisonError};

/// Alignment of every buffer, bytes: one cache line, one 512-bit vector.
pub(crate) const ALIGNMENT_BYTES: usize = 64;

/// Elements of `T` in [`ALIGNMENT_BYTES`].
pub(crate) const fn alignment<T>() -> usize {
    let size = size_of::<T>();
    if size == 0 || size > ALIGNMENT_BYTES { 1 } else { ALIGNMENT_BYTES / size }
}

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

/// Slabs of one length, lent to whoever works: on a sample, or beside its thread on pieces of it (see [`Parts`](super::parts::Parts)).
pub(super) struct Slabs<T> {
    idle: Mutex<Vec<Slab<T>>>,
    count: usize,
    len: usize,
}

impl<T: Real> Slabs<T> {
    pub(super) fn new(count: usize, len: usize) -> Self {
        Self { idle: Mutex::new((0..count).map(|_| Slab::new(len)).collect()), count, len }
    }

    /// How many may be in use at a time.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// Runs some work on an idle slab, which holds anything.
    pub(super) fn lend<R>(&self, work: impl FnOnce(&mut [T]) -> R) -> R {
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        // Always there, unless work panicked and took its slab with it.
        let mut slab = idle().pop().unwrap_or_else(|| Slab::new(self.len));
        let result = work(slab.aligned());
        idle().push(slab);
        result
    }
}
