//! Inverted dropout whose mask is made again where it is needed, never stored.
//!
//!   y = m∘x / (1 − p),  m_ij = 0 with probability p;   dx = m∘dy / (1 − p)
//!
//! Element (i, j) is dropped when word j of the mask's sub-stream i lies below ⌊p·2³²⌉. The scale is the reciprocal of the keep
//! probability that this threshold realises, so that E[y] = x holds exactly.

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

struct Apply<'a, T> {
    mask: Mask,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Apply<'_, T> {
    type Output = ();
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

/// y = m∘x / (1 − p), both [n, C].
pub fn forward<T: Real>(level: Level, mask: Mask, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &y.view());
    level.run(Apply { mask, x, y, write: Write::Set });
}

/// dx {=, +=} m∘dy / (1 − p), both [n, C], with the mask of the forward pass.
pub fn backward<T: Real>(level: Level, mask: Mask, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write) {
    same_shape(&dy, &dx.view());
    level.run(Apply { mask, x: dy, y: dx, write });
}
