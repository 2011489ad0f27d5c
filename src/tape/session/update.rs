//! One step of Adam in blocks side by side: for weights larger than a cache it is as long as memory takes, and one core does not
//! reach all of it. The arithmetic is the kernel's, element by element, so that blocks change no bit.

use crate::tape::threads::Parallelism;
use phyture_kernels::Real;
use phyture_kernels::adam::{self, Adam};
use phyture_kernels::instruction_set::InstructionSet;

/// Most numbers that one thread takes at a time.
const BLOCK: usize = 1 << 16;

/// What all blocks share.
#[derive(Clone, Copy)]
pub(super) struct Update<'a> {
    pub parallelism: Parallelism,
    pub isa: InstructionSet,
    pub adam: &'a Adam,
    pub step: u64,
}

impl Update<'_> {
    /// Parameters and both moments, from the gradient.
    pub fn work<T: Real>(self, gradient: &[T], [parameters, first, second]: [&mut [T]; 3]) {
        if gradient.len() <= BLOCK {
            return adam::step(self.isa, self.adam, self.step, 1.0, gradient, parameters, (first, second));
        }
        let half = (gradient.len() / 2).next_multiple_of(BLOCK / 2);
        let (low_gradient, high_gradient) = gradient.split_at(half);
        let [(low_parameters, high_parameters), (low_first, high_first), (low_second, high_second)] =
            [parameters, first, second].map(|values| values.split_at_mut(half));
        self.parallelism.join(
            || self.work(low_gradient, [low_parameters, low_first, low_second]),
            || self.work(high_gradient, [high_parameters, high_first, high_second]),
        );
    }
}
