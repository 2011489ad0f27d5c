//! Centred moving average over time, ends padded by repeating the first and the last row (paper eq. 29).
//!
//! ```text
//! y[t] = 1/w · Σ_{|j| ≤ (w−1)/2} x[clamp(t + j, 0, n − 1)],   w odd
//! ```
//!
//! x, y `[n, C]`. The backward pass is the exact adjoint, the padding's share folded into the two end rows.
//! A running sum over time, every channel a lane; it starts afresh every `RESTART` rows, so that rounding does not build up.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// Rows after which the running sum is formed anew.
const RESTART: usize = 64;

/// Scratch, in numbers, that both functions need for C = `channels`.
pub const fn scratch_len(rows: usize, channels: usize) -> usize {
    let _ = rows;
    channels
}

/// y = moving average of x.
///
/// # Panics
/// If `width` is even or 0, or the shapes differ.
pub fn forward<T: Real>(isa: InstructionSet, width: usize, x: Rows<'_, T>, y: RowsMut<'_, T>, scratch: &mut [T]) {
    assert!(width % 2 == 1, "a centred moving average has an odd width, not {width}");
    same_shape(&x, &y.view());
    T::moving_average(
        isa,
        Average { half: width / 2, ends: Ends::Repeated, x, y, write: Write::Set, sum: &mut scratch[..x.cols()] },
    );
}

/// dx {=, +=} adjoint of the moving average of dy.
///
/// # Panics
/// As [`forward`].
pub fn backward<T: Real>(isa: InstructionSet, width: usize, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(width % 2 == 1, "a centred moving average has an odd width, not {width}");
    same_shape(&dy, &dx.view());
    T::moving_average(isa, Average { half: width / 2, ends: Ends::Folded, x: dy, y: dx, write, sum: &mut scratch[..dy.cols()] });
}

/// What lies beyond the ends.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ends {
    /// The end rows again.
    Repeated,
    /// Nothing; but what the repeated rows received goes to the end rows (the adjoint).
    Folded,
}

pub(crate) struct Average<'a, T> {
    half: usize,
    ends: Ends,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
    write: Write,
    sum: &'a mut [T],
}

/// y += factor·x
#[inline(always)]
fn add_scaled<T: Real, I: Isa>(y: &mut [T], factor: T, x: &[T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = I::mul_add(factor, *x, *y);
    }
}

impl<T: Real> Kernel for Average<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let (n, half, sum) = (self.x.rows(), self.half, self.sum);
        if n == 0 {
            return;
        }
        let share = T::ONE / T::of((2 * half + 1) as f64);
        for t in 0..n {
            // Row t + j − half for a j of 0 ≤ j ≤ 2·half + 1, or none beyond the ends.
            let source = |j: usize| match self.ends {
                Ends::Repeated => Some(self.x.row((t + j).saturating_sub(half).min(n - 1))),
                Ends::Folded => (t + j).checked_sub(half).filter(|&s| s < n).map(|s| self.x.row(s)),
            };
            if t % RESTART == 0 {
                sum.fill(T::ZERO);
                for x in (0..2 * half + 1).filter_map(source) {
                    add_scaled::<T, I>(sum, T::ONE, x);
                }
            }
            let pairs = self.y.row_mut(t).iter_mut().zip(sum.iter());
            match self.write {
                Write::Set => pairs.for_each(|(y, sum)| *y = share * *sum),
                Write::Add => {
                    for (y, sum) in pairs {
                        *y = I::mul_add(share, *sum, *y);
                    }
                }
            }
            match (source(2 * half + 1), source(0)) {
                (Some(enters), Some(leaves)) => sum.iter_mut().zip(enters).zip(leaves).for_each(|((s, e), l)| *s += *e - *l),
                (Some(enters), None) => add_scaled::<T, I>(sum, T::ONE, enters),
                (None, Some(leaves)) => add_scaled::<T, I>(sum, -T::ONE, leaves),
                (None, None) => {}
            }
        }
        if self.ends == Ends::Folded {
            // Row t was averaged over half − t repetitions of row 0, and as many of the last row seen from the other end.
            for t in 0..half.min(n) {
                let weight = share * T::of((half - t) as f64);
                add_scaled::<T, I>(self.y.row_mut(0), weight, self.x.row(t));
                add_scaled::<T, I>(self.y.row_mut(n - 1), weight, self.x.row(n - 1 - t));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, check_writes, inner};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(width: usize, shape: (usize, usize), seed: u64) {
        let x = Matrix::<T>::random(seed, shape);
        let (mut y_expected, mut dx_expected) = (Matrix::<T>::poisoned(seed, shape), Matrix::<T>::poisoned(seed, shape));
        reference::moving_average(width, x.view(), y_expected.view_mut());
        reference::moving_average_backward(width, x.view(), dx_expected.view_mut());
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(shape.0, shape.1)];
            let mut y = Matrix::<T>::poisoned(seed, shape);
            forward(isa, width, x.view(), y.view_mut(), &mut scratch);
            y.check_gaps();
            assert_near("forward", &y.to_vec(), &y_expected.to_vec(), Tolerance::Close);
            check_writes("backward", &dx_expected, Tolerance::Close, |dx, write| {
                backward(isa, width, x.view(), dx, write, &mut scratch);
            });
        }
    }

    proptest! {
        #[test]
        fn equals_its_definition(half in 0_usize..30, rows in 0_usize..200, cols in 1_usize..20, seed in 0_u64..1000) {
            check::<f32>(2 * half + 1, (rows, cols), seed);
            check::<f64>(2 * half + 1, (rows, cols), seed);
        }

        #[test]
        fn backward_is_the_adjoint(half in 0_usize..30, rows in 0_usize..200, cols in 1_usize..20, seed in 0_u64..1000) {
            let (x, dy) = (Matrix::<f64>::random(seed, (rows, cols)), Matrix::<f64>::random(seed + 1, (rows, cols)));
            let (mut y, mut dx) = (Matrix::<f64>::poisoned(1, (rows, cols)), Matrix::<f64>::poisoned(1, (rows, cols)));
            let mut scratch = vec![f64::NAN; scratch_len(rows, cols)];
            forward(InstructionSet::PLAIN, 2 * half + 1, x.view(), y.view_mut(), &mut scratch);
            backward(InstructionSet::PLAIN, 2 * half + 1, dy.view(), dx.view_mut(), Write::Set, &mut scratch);
            let sides = (inner(&y.to_vec(), &dy.to_vec()), inner(&x.to_vec(), &dx.to_vec()));
            assert_near("<Ax, y> and <x, A'y>", &[sides.0], &[sides.1], Tolerance::Close);
        }
    }

    #[test]
    fn a_constant_stays_and_drift_stays_small() {
        let x = vec![0.1_f32; 5000];
        for isa in InstructionSet::available() {
            let (mut y, mut scratch) = (vec![f32::NAN; 5000], [f32::NAN; 1]);
            forward(isa, 25, Rows::packed(&x, 5000, 1), RowsMut::packed(&mut y, 5000, 1), &mut scratch);
            assert_near("constant", &y, &x, Tolerance::Close);
        }
    }

    #[test]
    #[should_panic(expected = "odd width")]
    fn an_even_width_is_refused() {
        forward(InstructionSet::PLAIN, 4, Rows::packed(&[0.0_f64; 3], 3, 1), RowsMut::packed(&mut [0.0; 3], 3, 1), &mut [0.0]);
    }
}
