//! A weighted sum over time with weights of its own for each channel.
//!
//! ```text
//! y[c] = b[c] + Σ_t W[c, t]·x[t, c];    dx[t, c] = W[c, t]·dy[c],  dW[c, t] = x[t, c]·dy[c],  db = dy
//! ```
//!
//! x `[n, C]`, W `[C, n]`, b and y `[C]`. A few thousand products: what counts is that no transposed copy is made.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Rows, RowsMut, Write};

fn check<T>(x: (usize, usize), weight: &Rows<'_, T>, y: usize) {
    assert!(x == (weight.cols(), weight.rows()) && x.1 == y, "temporal_each: shapes do not chain");
}

/// y = b + Σ_t W·x.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(isa: InstructionSet, x: Rows<'_, T>, weight: Rows<'_, T>, bias: &[T], y: &mut [T]) {
    check((x.rows(), x.cols()), &weight, y.len());
    T::temporal_each_forward(isa, Forward { x, weight, bias, y });
}

pub(crate) struct Forward<'a, T> {
    x: Rows<'a, T>,
    weight: Rows<'a, T>,
    bias: &'a [T],
    y: &'a mut [T],
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        self.y.copy_from_slice(self.bias);
        for t in 0..self.x.rows() {
            for (c, (y, x)) in self.y.iter_mut().zip(self.x.row(t)).enumerate() {
                *y = I::mul_add(self.weight.row(c)[t], *x, *y);
            }
        }
    }
}

/// dx {=, +=} W·dy.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(isa: InstructionSet, weight: Rows<'_, T>, dy: &[T], dx: RowsMut<'_, T>, write: Write) {
    check((dx.rows(), dx.cols()), &weight, dy.len());
    T::temporal_each_backward_input(isa, BackwardInput { weight, dy, dx, write });
}

pub(crate) struct BackwardInput<'a, T> {
    weight: Rows<'a, T>,
    dy: &'a [T],
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for BackwardInput<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for t in 0..self.dx.rows() {
            for (c, (dx, dy)) in self.dx.row_mut(t).iter_mut().zip(self.dy).enumerate() {
                let value = self.weight.row(c)[t] * *dy;
                *dx = value + if self.write == Write::Add { *dx } else { T::ZERO };
            }
        }
    }
}

/// dW {=, +=} x·dy.
///
/// # Panics
/// If shapes disagree.
pub fn backward_weight<T: Real>(isa: InstructionSet, x: Rows<'_, T>, dy: &[T], dweight: RowsMut<'_, T>, write: Write) {
    check((x.rows(), x.cols()), &dweight.view(), dy.len());
    T::temporal_each_backward_weight(isa, BackwardWeight { x, dy, dweight, write });
}

pub(crate) struct BackwardWeight<'a, T> {
    x: Rows<'a, T>,
    dy: &'a [T],
    dweight: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for BackwardWeight<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for (c, dy) in self.dy.iter().enumerate() {
            for (t, dweight) in self.dweight.row_mut(c).iter_mut().enumerate() {
                let value = self.x.row(t)[c] * *dy;
                *dweight = value + if self.write == Write::Add { *dweight } else { T::ZERO };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(n: usize, channels: usize, seed: u64) {
        let (x, weight) = (Matrix::<T>::random(seed, (n, channels)), Matrix::<T>::random(seed + 1, (channels, n)));
        let (bias, dy) = (numbers::<T>(seed + 2, channels), numbers::<T>(seed + 3, channels));
        let sum = |c: usize| (0..n).map(|t| weight.view().row(c)[t].f64() * x.view().row(t)[c].f64()).sum::<f64>();
        let expected: Vec<T> = (0..channels).map(|c| T::of(bias[c].f64() + sum(c))).collect();
        let dx = Matrix::<T>::filled((n, channels), 0, 0, |t, c| weight.view().row(c)[t] * dy[c]);
        let dw = Matrix::<T>::filled((channels, n), 0, 0, |c, t| x.view().row(t)[c] * dy[c]);
        for isa in InstructionSet::available() {
            let mut y = vec![T::NAN; channels];
            forward(isa, x.view(), weight.view(), &bias, &mut y);
            assert_near("y", &y, &expected, Tolerance::Close);
            check_writes("dx", &dx, Tolerance::Close, |dx, write| backward_input(isa, weight.view(), &dy, dx, write));
            check_writes("dW", &dw, Tolerance::Close, |dw, write| backward_weight(isa, x.view(), &dy, dw, write));
        }
    }

    proptest! {
        #[test]
        fn equals_its_sums(n in 0_usize..200, channels in 0_usize..200, seed in 0_u64..1000) {
            check::<f32>(n, channels, seed);
            check::<f64>(n, channels, seed);
        }
    }
}
