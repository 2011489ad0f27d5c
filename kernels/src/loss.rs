//! Squared error: L = weight·Σ (y − target)², dL/dy = 2·weight·(y − target).
//!
//! With weight = 1/B it is the mean over samples of the squared norm over channels (paper eq. 13); with one over the number of
//! elements, PyTorch's mean squared error. y, target `[n, C]`.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// weight·Σ (y − target)², summed in f64.
pub fn squared_error<T: Real>(y: Rows<'_, T>, target: Rows<'_, T>, weight: f64) -> f64 {
    same_shape(&y, &target);
    let square = |(y, t): (&T, &T)| (y.f64() - t.f64()) * (y.f64() - t.f64());
    let row = |i: usize| y.row(i).iter().zip(target.row(i)).map(square).sum::<f64>();
    weight * (0..y.rows()).map(row).sum::<f64>()
}

/// dy {=, +=} 2·weight·(y − target).
pub fn squared_error_gradient<T: Real>(
    isa: InstructionSet,
    y: Rows<'_, T>,
    target: Rows<'_, T>,
    weight: f64,
    dy: RowsMut<'_, T>,
    write: Write,
) {
    same_shape(&y, &target);
    same_shape(&y, &dy.view());
    T::loss_gradient(isa, Gradient { y, target, factor: T::of(2.0 * weight), dy, write });
}

pub(crate) struct Gradient<'a, T> {
    y: Rows<'a, T>,
    target: Rows<'a, T>,
    factor: T,
    dy: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Gradient<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.y.rows() {
            for ((dy, y), target) in self.dy.row_mut(i).iter_mut().zip(self.y.row(i)).zip(self.target.row(i)) {
                let value = self.factor * (*y - *target);
                match self.write {
                    Write::Set => *dy = value,
                    Write::Add => *dy += value,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes};
    use crate::tolerance::Tolerance;

    proptest! {
        #[test]
        fn value_and_gradient(rows in 0_usize..40, cols in 0_usize..20, weight in 0.01_f64..2.0, seed in 0_u64..1000) {
            let (y, target) = (Matrix::<f64>::random(seed, (rows, cols)), Matrix::<f64>::random(seed + 1, (rows, cols)));
            let expected: f64 = y.to_vec().iter().zip(target.to_vec()).map(|(y, t)| weight * (y - t) * (y - t)).sum();
            assert_near("value", &[squared_error(y.view(), target.view(), weight)], &[expected], Tolerance::Close);
            let gradient = Matrix::filled((rows, cols), 0, 0, |i, j| 2.0 * weight * (y.view().row(i)[j] - target.view().row(i)[j]));
            for isa in InstructionSet::available() {
                check_writes("gradient", &gradient, Tolerance::Close, |dy, write| {
                    squared_error_gradient(isa, y.view(), target.view(), weight, dy, write);
                });
            }
        }
    }
}
