//! Views of a matrix or of a sequence: rows of equal length at a fixed distance; and the moves between such views.
//!
//! A sequence is `[time, channel]`, row-major. Because the distance between rows (`stride`) is free, the even rows, the odd
//! rows, a range of columns (an attention head) are views of the same numbers and cost nothing. A read-only view may even
//! overlap itself (`stride < cols`). This file holds no arithmetic but sum and difference of two views.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Write};

/// Bytes of a cache line.
const CACHE_LINE_BYTES: usize = 64;

/// Read-only rows: element (i, j) is `data[i·stride + j]`.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a, T> {
    data: &'a [T],
    rows: usize,
    cols: usize,
    stride: usize,
}

/// Writable rows: element (i, j) is `data[i·stride + j]`, `stride ≥ cols`.
#[derive(Debug)]
pub struct RowsMut<'a, T> {
    data: &'a mut [T],
    rows: usize,
    cols: usize,
    stride: usize,
}

/// Numbers that a view of this shape reaches: (rows − 1)·stride + cols, or 0 when it is empty.
const fn reach(rows: usize, cols: usize, stride: usize) -> usize {
    if rows == 0 || cols == 0 { 0 } else { (rows - 1) * stride + cols }
}

impl<'a, T> Rows<'a, T> {
    /// A view of `rows` rows of `cols` numbers, `stride` apart.
    ///
    /// # Panics
    /// If the slice is shorter than the view reaches: a mistake in a plan, not in data.
    pub fn new(data: &'a [T], rows: usize, cols: usize, stride: usize) -> Self {
        assert!(data.len() >= reach(rows, cols, stride), "{} numbers hold no {rows} x {cols} view of stride {stride}", data.len());
        Self { data, rows, cols, stride }
    }

    /// Rows without a gap between them.
    ///
    /// # Panics
    /// If the slice is shorter than `rows·cols`.
    pub fn packed(data: &'a [T], rows: usize, cols: usize) -> Self {
        Self::new(data, rows, cols, cols)
    }

    /// The same row `rows` times.
    pub fn repeated(row: &'a [T], rows: usize) -> Self {
        Self { data: row, rows, cols: row.len(), stride: 0 }
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Distance between the first elements of two neighbouring rows.
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// Row `i`.
    ///
    /// # Panics
    /// If `i` is out of range.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &'a [T] {
        &self.data[i * self.stride..][..self.cols]
    }

    /// Reads a number of every cache line, row by row, to have them in the cache.
    #[inline(always)]
    pub(crate) fn touch(self)
    where
        T: Copy,
    {
        for i in 0..self.rows {
            for x in self.row(i).iter().step_by(CACHE_LINE_BYTES / size_of::<T>()) {
                core::hint::black_box(*x);
            }
        }
    }

    /// Rows `start..end`.
    pub fn range(self, start: usize, end: usize) -> Self {
        assert!(start <= end && end <= self.rows, "rows {start}..{end} of {}", self.rows);
        Self { data: self.data.get(start * self.stride..).unwrap_or(&[]), rows: end - start, ..self }
    }

    /// Rows `first`, `first + step`, `first + 2·step`, …
    pub fn every(self, first: usize, step: usize) -> Self {
        let rows = self.rows.saturating_sub(first).div_ceil(step);
        Self { data: self.data.get(first * self.stride..).unwrap_or(&[]), rows, stride: self.stride * step, ..self }
    }

    /// Rows 0, 2, 4, …
    pub fn even(self) -> Self {
        self.every(0, 2)
    }

    /// Rows 1, 3, 5, …
    pub fn odd(self) -> Self {
        self.every(1, 2)
    }

    /// Columns `start..start + count` of every row.
    pub fn columns(self, start: usize, count: usize) -> Self {
        assert!(start + count <= self.cols, "columns {start}..{} of {}", start + count, self.cols);
        Self { data: self.data.get(start..).unwrap_or(&[]), cols: count, ..self }
    }
}

impl<'a, T> RowsMut<'a, T> {
    /// A view of `rows` rows of `cols` numbers, `stride` apart.
    ///
    /// # Panics
    /// If the slice is shorter than the view reaches, or rows would overlap.
    pub fn new(data: &'a mut [T], rows: usize, cols: usize, stride: usize) -> Self {
        assert!(data.len() >= reach(rows, cols, stride), "{} numbers hold no {rows} x {cols} view of stride {stride}", data.len());
        assert!(stride >= cols || rows <= 1, "writable rows of {cols} overlap at stride {stride}");
        Self { data, rows, cols, stride }
    }

    /// Rows without a gap between them.
    ///
    /// # Panics
    /// If the slice is shorter than `rows·cols`.
    pub fn packed(data: &'a mut [T], rows: usize, cols: usize) -> Self {
        Self::new(data, rows, cols, cols)
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Distance between the first elements of two neighbouring rows.
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// Row `i`, to be written.
    ///
    /// # Panics
    /// If `i` is out of range.
    #[inline(always)]
    pub fn row_mut(&mut self, i: usize) -> &mut [T] {
        &mut self.data[i * self.stride..][..self.cols]
    }

    /// The numbers from the first row on, as they lie.
    pub(crate) fn into_slice(self) -> &'a mut [T] {
        self.data
    }

    /// The same rows, to be read.
    #[inline(always)]
    pub fn view(&self) -> Rows<'_, T> {
        Rows { data: self.data, rows: self.rows, cols: self.cols, stride: self.stride }
    }

    /// The same rows under a shorter borrow.
    #[inline(always)]
    pub fn reborrow(&mut self) -> RowsMut<'_, T> {
        RowsMut { data: self.data, rows: self.rows, cols: self.cols, stride: self.stride }
    }

    /// Rows `start..end`.
    pub fn range(self, start: usize, end: usize) -> Self {
        assert!(start <= end && end <= self.rows, "rows {start}..{end} of {}", self.rows);
        Self { data: self.data.get_mut(start * self.stride..).unwrap_or(&mut []), rows: end - start, ..self }
    }

    /// Rows `first`, `first + step`, `first + 2·step`, …
    pub fn every(self, first: usize, step: usize) -> Self {
        let rows = self.rows.saturating_sub(first).div_ceil(step);
        Self { data: self.data.get_mut(first * self.stride..).unwrap_or(&mut []), rows, stride: self.stride * step, ..self }
    }

    /// Rows 0, 2, 4, …
    pub fn even(self) -> Self {
        self.every(0, 2)
    }

    /// Rows 1, 3, 5, …
    pub fn odd(self) -> Self {
        self.every(1, 2)
    }

    /// Columns `start..start + count` of every row.
    pub fn columns(self, start: usize, count: usize) -> Self {
        assert!(start + count <= self.cols, "columns {start}..{} of {}", start + count, self.cols);
        Self { data: self.data.get_mut(start..).unwrap_or(&mut []), cols: count, ..self }
    }
}

/// Panics unless two shapes agree.
#[inline(always)]
pub(crate) fn same_shape<T, U>(x: &Rows<'_, T>, y: &Rows<'_, U>) {
    assert!(x.rows == y.rows && x.cols == y.cols, "shapes {} x {} and {} x {} differ", x.rows, x.cols, y.rows, y.cols);
}

/// y {=, +=} factor·x.
pub(crate) struct Scale<'a, T> {
    factor: T,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Scale<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.x.rows {
            let pairs = self.y.row_mut(i).iter_mut().zip(self.x.row(i));
            match self.write {
                Write::Set => pairs.for_each(|(y, x)| *y = self.factor * *x),
                Write::Add => pairs.for_each(|(y, x)| *y += self.factor * *x),
            }
        }
    }
}

/// y {=, +=} x, both `[n, C]`.
pub fn copy<T: Real>(isa: InstructionSet, x: Rows<'_, T>, y: RowsMut<'_, T>, write: Write) {
    scale(isa, T::ONE, x, y, write);
}

/// y {=, +=} factor·x, both `[n, C]`.
pub fn scale<T: Real>(isa: InstructionSet, factor: T, x: Rows<'_, T>, y: RowsMut<'_, T>, write: Write) {
    same_shape(&x, &y.view());
    T::rows_scale(isa, Scale { factor, x, y, write });
}

/// y = a + sign·b.
pub(crate) struct Combine<'a, T> {
    a: Rows<'a, T>,
    b: Rows<'a, T>,
    sign: T,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Combine<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.a.rows {
            for ((y, a), b) in self.y.row_mut(i).iter_mut().zip(self.a.row(i)).zip(self.b.row(i)) {
                *y = *a + self.sign * *b;
            }
        }
    }
}

/// y = a + b, all `[n, C]`.
pub fn add<T: Real>(isa: InstructionSet, a: Rows<'_, T>, b: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&a, &b);
    same_shape(&a, &y.view());
    T::rows_combine(isa, Combine { a, b, sign: T::ONE, y });
}

/// y = a − b, all `[n, C]`.
pub fn subtract<T: Real>(isa: InstructionSet, a: Rows<'_, T>, b: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&a, &b);
    same_shape(&a, &y.view());
    T::rows_combine(isa, Combine { a, b, sign: -T::ONE, y });
}

/// Splits a sequence x `[n, C]` into its even rows `[⌈n/2⌉, C]` and odd rows `[⌊n/2⌋, C]`. Exact.
pub fn split<T: Real>(isa: InstructionSet, x: Rows<'_, T>, even: RowsMut<'_, T>, odd: RowsMut<'_, T>) {
    copy(isa, x.even(), even, Write::Set);
    copy(isa, x.odd(), odd, Write::Set);
}

/// The inverse of [`split`], and with `Write::Add` its adjoint's accumulating form: `y[2i] {=, +=} even[i]`, `y[2i+1] {=, +=} odd[i]`.
pub fn interleave<T: Real>(isa: InstructionSet, even: Rows<'_, T>, odd: Rows<'_, T>, mut y: RowsMut<'_, T>, write: Write) {
    copy(isa, even, y.reborrow().even(), write);
    copy(isa, odd, y.odd(), write);
}

/// Σ x∘y over all elements, both `[n, C]`.
pub fn inner<T: Real>(isa: InstructionSet, x: Rows<'_, T>, y: Rows<'_, T>) -> T {
    same_shape(&x, &y);
    let mut sum = T::ZERO;
    T::rows_inner(isa, Inner { x, y, sum: &mut sum });
    sum
}

pub(crate) struct Inner<'a, T> {
    x: Rows<'a, T>,
    y: Rows<'a, T>,
    sum: &'a mut T,
}

impl<T: Real> Kernel for Inner<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        *self.sum = T::ZERO;
        for i in 0..self.x.rows {
            *self.sum += crate::row_reductions::dot::<T, I>(self.x.row(i), self.y.row(i));
        }
    }
}

/// Every element of y becomes `value`.
pub fn fill<T: Real>(mut y: RowsMut<'_, T>, value: T) {
    for i in 0..y.rows {
        y.row_mut(i).fill(value);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes, inner};
    use crate::tolerance::Tolerance;

    proptest! {
        #[test]
        fn interleave_undoes_split_bit_for_bit(rows in 0_usize..200, cols in 0_usize..40, seed in 0_u64..1000) {
            let x = Matrix::<f32>::random(seed, (rows, cols));
            for isa in InstructionSet::available() {
                let mut even = Matrix::<f32>::poisoned(seed, (rows.div_ceil(2), cols));
                let mut odd = Matrix::<f32>::poisoned(seed + 1, (rows / 2, cols));
                let mut back = Matrix::<f32>::poisoned(seed + 2, (rows, cols));
                split(isa, x.view(), even.view_mut(), odd.view_mut());
                interleave(isa, even.view(), odd.view(), back.view_mut(), Write::Set);
                assert_eq!(back.to_vec(), x.to_vec());
                back.check_gaps();
            }
        }

        #[test]
        fn interleave_is_the_adjoint_of_split(rows in 0_usize..100, cols in 1_usize..20, seed in 0_u64..1000) {
            let (x, y) = (Matrix::<f64>::random(seed, (rows, cols)), Matrix::<f64>::random(seed + 1, (rows, cols)));
            let (even, odd) = (y.view().even(), y.view().odd());
            let mut back = Matrix::<f64>::poisoned(seed, (rows, cols));
            interleave(InstructionSet::PLAIN, even, odd, back.view_mut(), Write::Set);
            let of = |x: &Matrix<f64>| inner(&x.to_vec(), &y.to_vec());
            assert_near("<split x, y> and <x, interleave y>", &[of(&x)], &[inner(&x.to_vec(), &back.to_vec())], Tolerance::Close);
        }

        #[test]
        fn sums_and_differences(rows in 0_usize..60, cols in 0_usize..200, seed in 0_u64..1000) {
            let (a, b) = (Matrix::<f32>::random(seed, (rows, cols)), Matrix::<f32>::random(seed + 1, (rows, cols)));
            let (a_values, b_values) = (a.to_vec(), b.to_vec());
            for isa in InstructionSet::available() {
                let mut y = Matrix::<f32>::poisoned(seed, (rows, cols));
                add(isa, a.view(), b.view(), y.view_mut());
                assert_eq!(y.to_vec(), a_values.iter().zip(&b_values).map(|(a, b)| a + b).collect::<Vec<_>>());
                subtract(isa, a.view(), b.view(), y.view_mut());
                assert_eq!(y.to_vec(), a_values.iter().zip(&b_values).map(|(a, b)| a - b).collect::<Vec<_>>());
                y.check_gaps();
                let expected: f64 = a_values.iter().zip(&b_values).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                assert_near("inner", &[super::inner(isa, a.view(), b.view())], &[expected as f32], Tolerance::Approximate);
                check_writes("copy", &a, Tolerance::Close, |y, write| copy(isa, a.view(), y, write));
            }
        }
    }

    #[test]
    fn views_pick_the_rows_and_columns_they_say() {
        let mut data: Vec<u32> = (0..30).collect();
        let x = Rows::new(&data, 5, 4, 6);
        let first = |x: Rows<'_, u32>| (0..x.rows()).map(|i| x.row(i)[0]).collect::<Vec<_>>();
        assert_eq!(first(x.even()), [0, 12, 24]);
        assert_eq!(first(x.odd()), [6, 18]);
        assert_eq!(first(x.odd().odd()), [18]);
        assert_eq!(first(x.range(2, 4).columns(1, 2)), [13, 19]);
        assert_eq!(x.every(7, 2).rows(), 0);
        assert_eq!(x.range(5, 5).rows(), 0);
        fill_numbers(RowsMut::new(&mut data, 5, 4, 6).odd().columns(2, 1));
        assert_eq!((data[8], data[20], data[2]), (99, 99, 2));
    }

    fn fill_numbers(mut y: RowsMut<'_, u32>) {
        for i in 0..y.rows() {
            y.row_mut(i).fill(99);
        }
    }

    #[test]
    #[should_panic(expected = "hold no 2 x 3 view")]
    fn a_view_beyond_its_slice_is_refused() {
        let _ = Rows::new(&[0.0; 6], 2, 3, 4);
    }

    #[test]
    #[should_panic(expected = "overlap")]
    fn overlapping_rows_cannot_be_written() {
        let _ = RowsMut::new(&mut [0.0; 6], 2, 3, 2);
    }
}
