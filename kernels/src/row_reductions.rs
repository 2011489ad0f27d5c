//! Sums along a row in many lanes at once: a float sum in one chain is never vectorised, because the order of its terms counts.
//!
//! Not here: sums down the rows, which vectorise as they are written.

use crate::Real;
use crate::instruction_set::Isa;

/// Lanes of a sum along a row: four registers of the widest level in f32.
const LANES: usize = 64;

/// Σ f(x)·g(y) over two rows of one length.
#[inline(always)]
pub(crate) fn of_products<T: Real, I: Isa>(x: &[T], y: &[T], f: impl Fn(T) -> T, g: impl Fn(T) -> T) -> T {
    let (x_blocks, x_rest) = x.as_chunks::<LANES>();
    let (y_blocks, y_rest) = y.as_chunks::<LANES>();
    let mut sum = T::ZERO;
    if !x_blocks.is_empty() {
        let mut lanes = [T::ZERO; LANES];
        for (x, y) in x_blocks.iter().zip(y_blocks) {
            lanes = plus_products::<T, I>(lanes, x, y, &f, &g);
        }
        sum = total(lanes);
    }
    if !x_rest.is_empty() {
        // Lanes of their own: these are indexed by variables, and so in memory.
        let mut lanes = [T::ZERO; LANES];
        for ((lane, x), y) in lanes.iter_mut().zip(x_rest).zip(y_rest) {
            *lane = f(*x) * g(*y);
        }
        sum += total(lanes);
    }
    sum
}

/// By value: nothing else can point to these numbers, which stay in registers.
#[inline(always)]
fn plus_products<T: Real, I: Isa>(
    mut lanes: [T; LANES],
    x: &[T; LANES],
    y: &[T; LANES],
    f: &impl Fn(T) -> T,
    g: &impl Fn(T) -> T,
) -> [T; LANES] {
    for ((lane, x), y) in lanes.iter_mut().zip(x).zip(y) {
        *lane = I::mul_add(f(*x), g(*y), *lane);
    }
    lanes
}

/// Halves onto halves: log₂ steps.
#[inline(always)]
fn total<T: Real>(lanes: [T; LANES]) -> T {
    let lanes: [T; 32] = halves(lanes);
    let lanes: [T; 16] = halves(lanes);
    let lanes: [T; 8] = halves(lanes);
    let lanes: [T; 4] = halves(lanes);
    let [a, b, c, d] = lanes;
    (a + c) + (b + d)
}

/// The upper half onto the lower one.
#[inline(always)]
fn halves<T: Real, const N: usize, const HALF: usize>(lanes: [T; N]) -> [T; HALF] {
    let mut sums = [T::ZERO; HALF];
    for i in 0..HALF {
        sums[i] = lanes[i] + lanes[i + HALF];
    }
    sums
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
