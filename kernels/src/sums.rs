//! Sums along a row in many lanes at once: a float sum in one chain is never vectorised, because the order of its terms counts.
//!
//! Not here: sums down the rows, which vectorise as they are written.

use crate::Real;
use crate::level::Isa;

/// Lanes of a sum along a row: four registers of the widest level in f32.
const LANES: usize = 64;

/// Σ f(x)·g(y) over two rows of one length.
#[inline(always)]
pub(crate) fn of_products<T: Real, I: Isa>(x: &[T], y: &[T], f: impl Fn(T) -> T, g: impl Fn(T) -> T) -> T {
    let mut lanes = [T::ZERO; LANES];
    let (x_blocks, x_rest) = x.as_chunks::<LANES>();
    let (y_blocks, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in x_blocks.iter().zip(y_blocks) {
        for ((lane, x), y) in lanes.iter_mut().zip(x).zip(y) {
            *lane = I::mul_add(f(*x), g(*y), *lane);
        }
    }
    for ((lane, x), y) in lanes.iter_mut().zip(x_rest).zip(y_rest) {
        *lane = I::mul_add(f(*x), g(*y), *lane);
    }
    // Halves onto halves: log₂ steps.
    let mut width = LANES / 2;
    while width > 0 {
        let (low, high) = lanes.split_at_mut(width);
        low.iter_mut().zip(high).for_each(|(low, high)| *low += *high);
        width /= 2;
    }
    lanes[0]
}

/// Σ x·y
#[inline(always)]
pub(crate) fn dot<T: Real, I: Isa>(x: &[T], y: &[T]) -> T {
    of_products::<T, I>(x, y, |x| x, |y| y)
}

/// Σ f(x)
#[inline(always)]
pub(crate) fn of<T: Real, I: Isa>(x: &[T], f: impl Fn(T) -> T) -> T {
    of_products::<T, I>(x, x, f, |_| T::ONE)
}
