//! Largest value, or mean, of windows along time, channel by channel.
//!
//! ```text
//! y[t, c] = max or mean of x[s, c],   t·stride − padding ≤ s < t·stride − padding + width
//! ```
//!
//! x `[n, C]`, y `[rows, C]`. Beyond the ends a maximum sees −∞ and a mean sees zeros (and divides by the width all the same), as in
//! PyTorch. The maximum's gradient goes to the first of several equal rows; it is found again from x and y.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::fill;
use crate::{Real, Rows, RowsMut, Write};

/// Windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Rows of a window.
    pub width: usize,
    /// Rows from one window to the next.
    pub stride: usize,
    /// Rows before x at which the first window begins, and behind x up to which the last may reach; at most half the width.
    pub padding: usize,
}

impl Geometry {
    /// Rows of y for `rows` rows of x; 0 if no window fits.
    pub const fn output_rows(self, rows: usize) -> usize {
        let whole = rows + 2 * self.padding;
        if rows == 0 || whole < self.width { 0 } else { (whole - self.width) / self.stride + 1 }
    }

    /// Whether every window has a row of x.
    pub const fn is_sound(self) -> bool {
        self.width > 0 && self.stride > 0 && 2 * self.padding <= self.width
    }

    #[inline(always)]
    fn window(self, t: usize, rows: usize) -> core::ops::Range<usize> {
        let first = t * self.stride;
        first.saturating_sub(self.padding)..(first + self.width - self.padding).min(rows)
    }
}

/// Which number of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pool {
    /// The largest.
    Max,
    /// The mean.
    Mean,
}

fn check<T>(geometry: Geometry, x: &Rows<'_, T>, y: &Rows<'_, T>) {
    assert!(geometry.is_sound() && y.rows() == geometry.output_rows(x.rows()), "pool: {geometry:?} and {} rows", y.rows());
    assert_eq!(x.cols(), y.cols(), "pool: channels");
}

/// y from x.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(isa: InstructionSet, pool: Pool, geometry: Geometry, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    check(geometry, &x, &y.view());
    T::pool_forward(isa, Forward { pool, geometry, x, y });
}

pub(crate) struct Forward<'a, T> {
    pool: Pool,
    geometry: Geometry,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let share = T::of(1.0 / self.geometry.width as f64);
        for t in 0..self.y.rows() {
            let y = self.y.row_mut(t);
            let window = self.geometry.window(t, self.x.rows());
            match self.pool {
                Pool::Max => {
                    y.fill(T::NEG_INFINITY);
                    for s in window {
                        y.iter_mut().zip(self.x.row(s)).for_each(|(y, x)| *y = if *x > *y { *x } else { *y });
                    }
                }
                Pool::Mean => {
                    y.fill(T::ZERO);
                    for s in window {
                        for (y, x) in y.iter_mut().zip(self.x.row(s)) {
                            *y = I::mul_add(share, *x, *y);
                        }
                    }
                }
            }
        }
    }
}

/// dx {=, +=} from dy; a maximum reads x and y, a mean does not.
///
/// # Panics
/// If shapes disagree.
pub fn backward<T: Real>(
    isa: InstructionSet,
    pool: Pool,
    geometry: Geometry,
    (x, y): (Rows<'_, T>, Rows<'_, T>),
    dy: Rows<'_, T>,
    (mut dx, write): (RowsMut<'_, T>, Write),
    scratch: &mut [T],
) {
    check(geometry, &dx.view(), &dy);
    if write == Write::Set {
        fill(dx.reborrow(), T::ZERO);
    }
    T::pool_backward(isa, Backward { pool, geometry, x, y, rest: &mut scratch[..dy.cols()], dy, dx });
}

pub(crate) struct Backward<'a, T> {
    pool: Pool,
    geometry: Geometry,
    x: Rows<'a, T>,
    y: Rows<'a, T>,
    /// What of a row of dy has not found its place.
    rest: &'a mut [T],
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let share = T::of(1.0 / self.geometry.width as f64);
        for t in 0..self.dy.rows() {
            self.rest.copy_from_slice(self.dy.row(t));
            for s in self.geometry.window(t, self.dx.rows()) {
                let pairs = self.dx.row_mut(s).iter_mut().zip(&mut *self.rest);
                match self.pool {
                    Pool::Mean => {
                        for (dx, rest) in pairs {
                            *dx = I::mul_add(share, *rest, *dx);
                        }
                    }
                    Pool::Max => {
                        for ((dx, rest), (x, y)) in pairs.zip(self.x.row(s).iter().zip(self.y.row(t))) {
                            let here = *x == *y;
                            *dx += if here { *rest } else { T::ZERO };
                            *rest = if here { T::ZERO } else { *rest };
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(geometry: Geometry, shape: (usize, usize), seed: u64) {
        let whole = Matrix::<T>::random(seed, shape);
        // Rounded coarsely, so that equal rows occur.
        let x = Matrix::<T>::filled(shape, 1, 2, |i, j| T::of((whole.view().row(i)[j].f64() * 4.0).round()));
        let after = (geometry.output_rows(shape.0), shape.1);
        let dy = Matrix::<T>::random(seed + 1, after);
        for pool in [Pool::Max, Pool::Mean] {
            let (y_expected, dx) = reference::pool(geometry, pool == Pool::Max, x.view(), dy.view());
            let dx = Matrix::<T>::filled(shape, 0, 0, |i, j| T::of(dx[i * shape.1 + j]));
            for isa in InstructionSet::available() {
                let mut y = Matrix::<T>::poisoned(seed, after);
                forward(isa, pool, geometry, x.view(), y.view_mut());
                y.check_gaps();
                let expected: Vec<T> = y_expected.iter().map(|y| T::of(*y)).collect();
                assert_near(&format!("{pool:?}"), &y.to_vec(), &expected, Tolerance::Close);
                let mut scratch = vec![T::NAN; shape.1];
                check_writes(&format!("d{pool:?}"), &dx, Tolerance::Close, |dx, write| {
                    backward(isa, pool, geometry, (x.view(), y.view()), dy.view(), (dx, write), &mut scratch);
                });
            }
        }
    }

    proptest! {
        #[test]
        fn equals_its_definition(
            (width, stride, padding) in (1_usize..6, 1_usize..4, 0_usize..3), rows in 0_usize..200, cols in 1_usize..40, seed in 0_u64..1000
        ) {
            let geometry = Geometry { width, stride, padding: padding.min(width / 2) };
            check::<f32>(geometry, (rows, cols), seed);
            check::<f64>(geometry, (rows, cols), seed);
        }
    }

    #[test]
    fn a_pad_of_one_halves_an_even_length() {
        let distil = Geometry { width: 3, stride: 2, padding: 1 };
        assert_eq!((distil.output_rows(1000), distil.output_rows(500)), (500, 250));
    }
}
