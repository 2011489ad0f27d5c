//! Inverted dropout whose mask is made again where it is needed, never stored.
//!
//! ```text
//! y = m∘x / (1 − p),  m_ij = 0 with probability p;   dx = m∘dy / (1 − p)
//! ```
//!
//! A word of the mask's sub-stream i serves two neighbouring columns: its low half column 2w, its high half column 2w + 1. An
//! element is dropped when its half, as a signed number, lies below a bound chosen so that the share is ⌊p·2¹⁶⌉/2¹⁶. The scale is
//! the reciprocal of the keep probability that this bound realises, so that the mean of y over masks is exactly x.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::random::{Stream, word};
use crate::strided::same_shape;
use crate::tile::Pair;
use crate::vector::Vector;
use crate::{Real, Rows, RowsMut, Write};

/// A mask over a matrix of any shape: a rule, not a buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mask {
    stream: Stream,
    /// Of 2¹⁶ halves, how many are dropped.
    dropped: u16,
}

impl Mask {
    /// Drops each element with probability `rate`, 0 ≤ rate < 1 (other values are clamped into that range; NaN is 0).
    pub fn new(stream: Stream, rate: f64) -> Self {
        // A float-to-integer cast saturates, and so does the rate.
        Self { stream, dropped: Real::round(rate * HALVES) as u16 }
    }

    /// The mask's words for one row.
    #[inline(always)]
    pub(crate) const fn row(self, row: usize) -> MaskRow {
        MaskRow { stream: self.stream.sub(row as u64), bound: self.bound() }
    }

    /// Whether element (row, column) is kept.
    pub const fn keeps(self, row: usize, column: usize) -> bool {
        self.row(row).keeps(column)
    }

    /// What a kept element is multiplied with: 1 / (1 − p).
    pub fn scale(self) -> f64 {
        1.0 / (1.0 - f64::from(self.dropped) / HALVES)
    }

    /// Halves, moved to the upper half of a signed word, are kept from here on: one comparison a register, where an unsigned one
    /// takes two.
    const fn bound(self) -> i32 {
        ((self.dropped as i32) << 16).wrapping_add(i32::MIN)
    }
}

/// 2¹⁶: values of half a word.
const HALVES: f64 = 65_536.0;

/// The mask's words for up to N neighbouring rows, one row a lane.
pub(crate) struct MaskLanes<const N: usize> {
    low: [u32; N],
    high: [u32; N],
    bound: i32,
}

impl<const N: usize> MaskLanes<N> {
    #[inline(always)]
    pub(crate) fn new(mask: Mask, first_row: usize) -> Self {
        let mut lanes = Self { low: [0; N], high: [0; N], bound: mask.bound() };
        for (i, (low, high)) in lanes.low.iter_mut().zip(&mut lanes.high).enumerate() {
            (*low, *high) = mask.stream.sub((first_row + i) as u64).halves();
        }
        lanes
    }

    /// For an even column and the next one, the words that decide about each lane.
    #[inline(always)]
    pub(crate) fn pair(&self, even_column: usize) -> [Keep<N>; 2] {
        let mut halves = [[0; N]; 2];
        for ((to, low), high) in halves[1].iter_mut().zip(&self.low).zip(&self.high) {
            *to = word(*low, *high, even_column as u32 >> 1) as i32;
        }
        let [even, odd] = &mut halves;
        even.iter_mut().zip(odd).for_each(|(even, odd)| *even = *odd << 16);
        halves.map(|words| Keep { words, bound: self.bound })
    }
}

/// What is kept of N elements of a mask, one a lane.
#[repr(align(64))]
pub(crate) struct Keep<const NR: usize> {
    words: [i32; NR],
    bound: i32,
}

impl<const NR: usize> Keep<NR> {
    /// x where it is kept, 0 where it is dropped.
    #[inline(always)]
    pub(crate) fn of<T: Real, I: Isa>(&self, x: Pair<T, I>) -> Pair<T, I> {
        let lanes = I::Vector::<T>::LANES;
        assert!(NR == 2 * lanes, "a pair of registers has as many lanes as there are words");
        let words = self.words.as_ptr();
        // SAFETY: there are words for two registers.
        unsafe { [x[0].where_at_least(words, self.bound), x[1].where_at_least(words.add(lanes), self.bound)] }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct MaskRow {
    stream: Stream,
    bound: i32,
}

impl MaskRow {
    #[inline(always)]
    pub(crate) const fn keeps(self, column: usize) -> bool {
        // An even column's half is moved up; an odd column's is there already.
        let up = 16 & !(column as u32).wrapping_mul(16);
        (self.stream.word(column as u32 >> 1) << up) as i32 >= self.bound
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
pub fn forward<T: Real>(isa: InstructionSet, mask: Mask, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &y.view());
    T::dropout_apply(isa, Apply { mask, x, y, write: Write::Set });
}

/// dx {=, +=} m∘dy / (1 − p), both `[n, C]`, with the mask of the forward pass.
pub fn backward<T: Real>(isa: InstructionSet, mask: Mask, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write) {
    same_shape(&dy, &dx.view());
    T::dropout_apply(isa, Apply { mask, x: dy, y: dx, write });
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
            for isa in InstructionSet::available() {
                let mut y = Matrix::<f32>::poisoned(seed, (rows, cols));
                forward(isa, mask, x.view(), y.view_mut());
                assert_eq!(y.to_vec(), expected.to_vec(), "level {isa}");
                y.check_gaps();
                check_writes("backward", &expected, Tolerance::Close, |dx, write| backward(isa, mask, x.view(), dx, write));
            }
        }

        #[test]
        fn lanes_are_the_rows(row in 0_usize..10_000, column in 0_usize..10_000, seed: u64) {
            let mask = Mask::new(Stream::new(seed, 0, 0, 0), 0.5);
            let (lanes, even) = (MaskLanes::<8>::new(mask, row), 2 * (column / 2));
            for (column, keep) in (even..).zip(lanes.pair(even)) {
                let kept = keep.words.map(|word| word >= keep.bound);
                assert_eq!(kept.to_vec(), (row..row + 8).map(|i| mask.keeps(i, column)).collect::<Vec<_>>());
            }
        }

        #[test]
        fn backward_is_the_adjoint(rows in 1_usize..20, cols in 1_usize..20, seed in 0_u64..1000) {
            let mask = Mask::new(Stream::new(seed, 0, 0, 0), 0.3);
            let (x, dy) = (Matrix::<f64>::random(seed, (rows, cols)), Matrix::<f64>::random(seed + 1, (rows, cols)));
            let (mut y, mut dx) = (Matrix::<f64>::poisoned(1, (rows, cols)), Matrix::<f64>::poisoned(1, (rows, cols)));
            forward(InstructionSet::PLAIN, mask, x.view(), y.view_mut());
            backward(InstructionSet::PLAIN, mask, dy.view(), dx.view_mut(), Write::Set);
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
