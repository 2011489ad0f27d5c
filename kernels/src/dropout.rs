//! Inverted dropout whose mask is made again where it is needed, never stored.
//!
//! ```text
//! y = m∘x / (1 − p),  m_ij = 0 with probability p;   dx = m∘dy / (1 − p)
//! ```
//!
//! Element (i, j) is dropped when word j of the mask's sub-stream i lies below ⌊p·2³²⌉. The scale is the reciprocal of the keep
//! probability that this threshold realises, so that the mean of y over masks is exactly x.

use crate::level::{Isa, Kernel, Level};
use crate::random::{Stream, word};
use crate::rows::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// A mask over a matrix of any shape: a rule, not a buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mask {
    stream: Stream,
    threshold: u32,
}

impl Mask {
    /// Drops each element with probability `rate`, 0 ≤ rate < 1 (other values are clamped into that range; NaN is 0).
    pub fn new(stream: Stream, rate: f64) -> Self {
        // A float-to-integer cast saturates, and so does the rate.
        Self { stream, threshold: (rate * TWO_POW_32).round() as u32 }
    }

    /// The mask's words for one row.
    #[inline(always)]
    pub(crate) const fn row(self, row: usize) -> MaskRow {
        MaskRow { stream: self.stream.sub(row as u64), threshold: self.threshold }
    }

    /// Whether element (row, column) is kept.
    pub const fn keeps(self, row: usize, column: usize) -> bool {
        self.row(row).keeps(column)
    }

    /// What a kept element is multiplied with: 1 / (1 − p).
    pub fn scale(self) -> f64 {
        1.0 / (1.0 - f64::from(self.threshold) / TWO_POW_32)
    }
}

const TWO_POW_32: f64 = 4_294_967_296.0;

/// The mask's words for up to N neighbouring rows, one row a lane.
pub(crate) struct MaskLanes<const N: usize> {
    low: [u32; N],
    high: [u32; N],
    threshold: u32,
}

impl<const N: usize> MaskLanes<N> {
    #[inline(always)]
    pub(crate) fn new(mask: Mask, first_row: usize) -> Self {
        let mut lanes = Self { low: [0; N], high: [0; N], threshold: mask.threshold };
        for (i, (low, high)) in lanes.low.iter_mut().zip(&mut lanes.high).enumerate() {
            (*low, *high) = mask.stream.sub((first_row + i) as u64).halves();
        }
        lanes
    }

    /// Makes the values of dropped elements 0: lane i of `values` is element (first row + i, column).
    #[inline(always)]
    pub(crate) fn drop<T: Real>(&self, column: usize, values: &mut [T]) {
        for ((x, low), high) in values.iter_mut().zip(&self.low).zip(&self.high) {
            *x = if word(*low, *high, column as u32) >= self.threshold { *x } else { T::ZERO };
        }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct MaskRow {
    stream: Stream,
    threshold: u32,
}

impl MaskRow {
    #[inline(always)]
    pub(crate) const fn keeps(self, column: usize) -> bool {
        self.stream.word(column as u32) >= self.threshold
    }
}

pub(crate) struct Apply<'a, T> {
    mask: Mask,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Apply<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let scale = T::of(self.mask.scale());
        for i in 0..self.x.rows() {
            let mask = self.mask.row(i);
            let pairs = self.y.row_mut(i).iter_mut().zip(self.x.row(i)).enumerate();
            match self.write {
                Write::Set => pairs.for_each(|(j, (y, x))| *y = if mask.keeps(j) { *x * scale } else { T::ZERO }),
                Write::Add => pairs.for_each(|(j, (y, x))| *y += if mask.keeps(j) { *x * scale } else { T::ZERO }),
            }
        }
    }
}

/// y = m∘x / (1 − p), both `[n, C]`.
pub fn forward<T: Real>(level: Level, mask: Mask, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &y.view());
    T::dropout_apply(level, Apply { mask, x, y, write: Write::Set });
}

/// dx {=, +=} m∘dy / (1 − p), both `[n, C]`, with the mask of the forward pass.
pub fn backward<T: Real>(level: Level, mask: Mask, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write) {
    same_shape(&dy, &dx.view());
    T::dropout_apply(level, Apply { mask, x: dy, y: dx, write });
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes, inner};
    use crate::tolerance::Tolerance;

    proptest! {
        #[test]
        fn every_level_makes_the_mask_that_keeps_says(
            rows in 0_usize..40, cols in 0_usize..200, rate in 0.0_f64..0.99, seed in 0_u64..1000,
        ) {
            let mask = Mask::new(Stream::new(seed, 0, 0, 0), rate);
            let x = Matrix::<f32>::random(seed, (rows, cols));
            let scale = mask.scale() as f32;
            let expected = Matrix::filled((rows, cols), 0, 0, |i, j| if mask.keeps(i, j) { x.view().row(i)[j] * scale } else { 0.0 });
            for level in Level::available() {
                let mut y = Matrix::<f32>::poisoned(seed, (rows, cols));
                forward(level, mask, x.view(), y.view_mut());
                assert_eq!(y.to_vec(), expected.to_vec(), "level {level}");
                y.check_gaps();
                check_writes("backward", &expected, Tolerance::Close, |dx, write| backward(level, mask, x.view(), dx, write));
            }
        }

        #[test]
        fn lanes_are_the_rows(row in 0_usize..10_000, column in 0_usize..10_000, seed: u64) {
            let mask = Mask::new(Stream::new(seed, 0, 0, 0), 0.5);
            let mut values = [1.0_f32; 8];
            MaskLanes::<8>::new(mask, row).drop(column, &mut values);
            let expected: Vec<f32> = (row..row + 8).map(|i| f32::from(u8::from(mask.keeps(i, column)))).collect();
            assert_eq!(values.to_vec(), expected);
        }

        #[test]
        fn backward_is_the_adjoint(rows in 1_usize..20, cols in 1_usize..20, seed in 0_u64..1000) {
            let mask = Mask::new(Stream::new(seed, 0, 0, 0), 0.3);
            let (x, dy) = (Matrix::<f64>::random(seed, (rows, cols)), Matrix::<f64>::random(seed + 1, (rows, cols)));
            let (mut y, mut dx) = (Matrix::<f64>::poisoned(1, (rows, cols)), Matrix::<f64>::poisoned(1, (rows, cols)));
            forward(Level::PLAIN, mask, x.view(), y.view_mut());
            backward(Level::PLAIN, mask, dy.view(), dx.view_mut(), Write::Set);
            let sides = (inner(&y.to_vec(), &dy.to_vec()), inner(&x.to_vec(), &dx.to_vec()));
            assert_near("<Ax, y> and <x, A'y>", &[sides.0], &[sides.1], Tolerance::Close);
        }
    }

    #[test]
    fn the_share_dropped_is_the_rate_and_rate_zero_drops_nothing() {
        const SIDE: usize = 1000;
        for rate in [0.0, 0.05, 0.2, 0.5, 0.9] {
            let mask = Mask::new(Stream::new(3, 0, 0, 0), rate);
            let dropped = (0..SIDE * SIDE).filter(|i| !mask.keeps(i / SIDE, i % SIDE)).count() as f64 / (SIDE * SIDE) as f64;
            // 6 standard deviations of a share of a million draws.
            let bound = 6.0 * (rate * (1.0 - rate)).sqrt() / SIDE as f64;
            assert!((dropped - rate).abs() <= bound, "rate {rate}: {dropped}");
        }
    }

    #[test]
    fn the_scale_is_one_over_the_keep_probability() {
        let stream = Stream::new(0, 0, 0, 0);
        assert_near("rate 0.5", &[Mask::new(stream, 0.5).scale()], &[2.0], Tolerance::Close);
        assert_near("rate 0", &[Mask::new(stream, 0.0).scale()], &[1.0], Tolerance::Close);
        assert!(Mask::new(stream, 5.0).scale().is_finite() && Mask::new(stream, f64::NAN) == Mask::new(stream, 0.0));
    }
}
