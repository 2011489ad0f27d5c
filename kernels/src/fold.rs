//! Two-dimensional convolution of a sequence folded into rows of one period (TimesNet).
//!
//! ```text
//! position n = r·p + c:   y[n, o] = b[o] + Σ_{a,b,i} W[a, b, i, o]·x[(r + a − h)·p + (c + b − h), i]
//! ```
//!
//! with period p, kernel of k = 2h + 1 rows and columns, rows r = 0 … R − 1 for R = ⌈length/p⌉, and zeros outside 0 ≤ r < R and
//! 0 ≤ c < p. x `[n, in]` counts as zero beyond its last row and is not read beyond R·p; y is zero from R·p on. W is
//! `[k², in, out]`.
//!
//! The image is copied once between zeros; then the k columns of one kernel row lie side by side, and a kernel row is one stretch of
//! k·in numbers of a matrix product. Kernel rows that only ever meet zeros (|a − h| ≥ R) are left out, which is exact.

use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, LeftRows, Store};
use crate::{Real, Rows, RowsMut, Write, strided};

/// Period, length and kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// p, at least 1.
    pub period: usize,
    /// Rows of the sequence that is folded; the image has ⌈length/p⌉ rows.
    pub length: usize,
    /// k, odd.
    pub kernel: usize,
}

impl Fold {
    /// R, rows of the image.
    pub const fn height(self) -> usize {
        self.length.div_ceil(self.period)
    }

    /// R·p, positions of the image.
    pub const fn positions(self) -> usize {
        self.height() * self.period
    }

    /// h, rows and columns on each side of the middle of the kernel.
    const fn half(self) -> usize {
        self.kernel / 2
    }

    /// Kernel rows on each side of the middle that ever meet the image.
    const fn reach(self) -> usize {
        let most = self.height().saturating_sub(1);
        if most < self.half() { most } else { self.half() }
    }

    /// Kernel rows that ever meet the image.
    const fn kernel_rows(self) -> usize {
        2 * self.reach() + 1
    }

    /// Columns of the image between its zeros.
    const fn width(self) -> usize {
        self.period + 2 * self.half()
    }

    /// Positions of the image between its zeros.
    const fn padded(self) -> usize {
        (self.height() + 2 * self.reach()) * self.width()
    }

    /// The largest number of positions for any period ⌊length/f⌋, f = 1 … length/2.
    pub fn most_positions(length: usize) -> usize {
        let positions = |frequency: usize| Self { period: length / frequency, length, kernel: 1 }.positions();
        (1..=(length / 2).max(1)).map(positions).max().unwrap_or(length)
    }

    /// The largest number of positions between zeros for any period at all.
    fn most_padded(length: usize, kernel: usize) -> usize {
        (1..=length).map(|period| Self { period, length, kernel }.padded()).max().unwrap_or(length)
    }
}

/// Scratch, in numbers, that any function of this file needs for sequences of this length and any of their periods.
pub fn scratch_len(length: usize, kernel: usize, inputs: usize, outputs: usize) -> usize {
    let image = Fold::most_padded(length, kernel) * inputs.max(outputs);
    let taps = kernel * kernel;
    image + tile::panels_len(taps * inputs, outputs).max(tile::panels_len(taps * outputs, inputs))
}

fn check<T>(fold: Fold, weight: &[T], inputs: usize, outputs: usize) {
    assert!(fold.period > 0 && fold.kernel % 2 == 1, "fold: {fold:?}");
    assert_eq!(weight.len(), fold.kernel * fold.kernel * inputs * outputs, "fold: length of the weight");
}

/// Copies the first R·p rows of x, as far as there are any, between zeros.
fn surround<T: Real>(fold: Fold, x: &Rows<'_, T>, image: &mut [T]) {
    let (channels, half, reach) = (x.cols(), fold.half(), fold.reach());
    image.fill(T::ZERO);
    for r in 0..fold.height() {
        let line = &mut image[((r + reach) * fold.width() + half) * channels..];
        for (c, to) in line.chunks_exact_mut(channels.max(1)).take(fold.period).enumerate() {
            let n = r * fold.period + c;
            if n < x.rows() {
                to.copy_from_slice(x.row(n));
            }
        }
    }
}

/// Position n, kernel row a ↦ the k·channels numbers under it.
struct Unfolded<'a, T> {
    image: &'a [T],
    fold: Fold,
    channels: usize,
    /// Positions that are computed.
    count: usize,
    /// ⌈2³²/p⌉: a multiplication in the place of a division by p.
    inverse: u64,
}

impl<'a, T> Unfolded<'a, T> {
    fn new(image: &'a [T], fold: Fold, channels: usize, count: usize) -> Self {
        Self { image, fold, channels, count, inverse: (1_u64 << 32).div_ceil(fold.period as u64) }
    }
}

impl<T> LeftRows<T> for Unfolded<'_, T> {
    #[inline(always)]
    fn rows(&self) -> usize {
        self.count
    }
    #[inline(always)]
    fn taps(&self) -> usize {
        self.fold.kernel_rows()
    }
    #[inline(always)]
    fn depth(&self) -> usize {
        self.fold.kernel * self.channels
    }
    #[inline(always)]
    fn piece(&self, i: usize, tap: usize) -> &[T] {
        // Exact while n·p < 2³², far beyond any history.
        let r = ((i as u64 * self.inverse) >> 32) as usize;
        let start = ((r + tap) * self.fold.width() + i - r * self.fold.period) * self.channels;
        &self.image[start..]
    }
}

/// y from x.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    fold: Fold,
    x: Rows<'_, T>,
    weight: &[T],
    bias: &[T],
    mut y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let (inputs, outputs) = (x.cols(), y.cols());
    check(fold, weight, inputs, outputs);
    assert_eq!(bias.len(), outputs, "fold: length of the bias");
    let count = fold.positions().min(y.rows());
    let total = y.rows();
    strided::fill(y.reborrow().range(count, total), T::ZERO);
    let (image, panels) = scratch.split_at_mut(fold.padded() * inputs);
    surround(fold, &x, image);
    T::fold_product(
        isa,
        Product { fold, image, weight, bias: Some(bias), flipped: false, y: y.range(0, count), write: Write::Set, panels },
    );
}

/// dx {=, +=} the adjoint, applied to dy; rows of dx beyond the image are set to zero, or left as they are.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    fold: Fold,
    dy: Rows<'_, T>,
    weight: &[T],
    mut dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    let (inputs, outputs) = (dx.cols(), dy.cols());
    check(fold, weight, inputs, outputs);
    let count = fold.positions().min(dx.rows());
    if write == Write::Set {
        let total = dx.rows();
        strided::fill(dx.reborrow().range(count, total), T::ZERO);
    }
    let (image, panels) = scratch.split_at_mut(fold.padded() * outputs);
    surround(fold, &dy, image);
    T::fold_product(isa, Product { fold, image, weight, bias: None, flipped: true, y: dx.range(0, count), write, panels });
}

/// y {=, +=} image ∗ W + b, or its adjoint: the kernel turned by half a circle, inputs and outputs exchanged.
pub(crate) struct Product<'a, T> {
    fold: Fold,
    image: &'a [T],
    weight: &'a [T],
    bias: Option<&'a [T]>,
    flipped: bool,
    y: RowsMut<'a, T>,
    write: Write,
    panels: &'a mut [T],
}

impl<T: Real> Tiled<T> for Product<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Fold { kernel, .. } = self.fold;
        let (n, taps) = (self.y.cols(), self.fold.kernel_rows() * kernel);
        let each = self.weight.len() / (kernel * kernel);
        let depth = each / n;
        let panels = &mut self.panels[..taps * depth * n.next_multiple_of(NR)];
        // The kernel rows that are used lie together in W.
        let used = &self.weight[(self.fold.half() - self.fold.reach()) * kernel * each..][..taps * each];
        if self.flipped {
            for tap in 0..taps {
                let matrix = &used[(taps - 1 - tap) * each..][..each];
                let row = |i: usize| &matrix[i * depth..][..depth];
                tile::pack_transposed::<T, NR>(depth, n, 1, row, taps * depth * NR, &mut panels[tap * depth * NR..]);
            }
        } else {
            tile::pack::<T, NR>(Rows::packed(used, taps * depth, n), panels);
        }
        let left = Unfolded::new(self.image, self.fold, depth, self.y.rows());
        if left.count > 0 {
            let mut sink = Store { c: self.y, bias: self.bias, write: self.write };
            tile::rows::<T, I, _, _, MR, NR>(&left, n, panels, &mut sink);
        }
    }
}

/// dW {=, +=} from x and dy; kernel rows that only meet zeros get zero.
///
/// # Panics
/// If shapes disagree.
pub fn backward_weight<T: Real>(
    isa: InstructionSet,
    fold: Fold,
    x: Rows<'_, T>,
    dy: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    check(fold, dweight, x.cols(), dy.cols());
    let image = &mut scratch[..fold.padded() * x.cols()];
    surround(fold, &x, image);
    if write == Write::Set {
        dweight.fill(T::ZERO);
    }
    let count = fold.positions().min(dy.rows());
    T::fold_backward_weight(isa, BackwardWeight { fold, image, inputs: x.cols(), dy: dy.range(0, count), dweight });
}

pub(crate) struct BackwardWeight<'a, T> {
    fold: Fold,
    image: &'a [T],
    inputs: usize,
    dy: Rows<'a, T>,
    dweight: &'a mut [T],
}

impl<T: Real> Tiled<T> for BackwardWeight<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let outputs = self.dy.cols();
        let unfolded = Unfolded::new(self.image, self.fold, self.inputs, self.dy.rows());
        let (wide, first) = (self.fold.kernel * self.inputs, self.fold.half() - self.fold.reach());
        let mut panel = [[T::ZERO; NR]; tile::COLUMN_DEPTH];
        for start in (0..self.dy.rows()).step_by(tile::COLUMN_DEPTH) {
            let end = self.dy.rows().min(start + tile::COLUMN_DEPTH);
            for column in (0..outputs).step_by(NR) {
                let panel = &mut panel[..end - start];
                tile::pack_panel(&self.dy.range(start, end), column, panel);
                let lines = self.dweight.chunks_exact_mut((wide * outputs).max(1)).skip(first).take(self.fold.kernel_rows());
                for (a, dw) in lines.enumerate() {
                    let mut sink = Store { c: RowsMut::packed(dw, wide, outputs), bias: None, write: Write::Add };
                    let left = |p| &unfolded.piece(start + p, a)[..wide];
                    tile::columns::<T, I, _, MR, NR>((left, wide), panel, (column, NR.min(outputs - column)), &mut sink);
                }
            }
        }
    }
}

/// db {=, +=} the sum of the rows of dy inside the image.
pub fn backward_bias<T: Real>(isa: InstructionSet, fold: Fold, dy: Rows<'_, T>, dbias: &mut [T], write: Write) {
    let count = fold.positions().min(dy.rows());
    crate::linear::backward_bias(isa, dy.range(0, count), dbias, write);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(fold: Fold, rows: (usize, usize), inputs: usize, outputs: usize, seed: u64) {
        let (x, dy) = (Matrix::<T>::random(seed, (rows.0, inputs)), Matrix::<T>::random(seed + 1, (rows.1, outputs)));
        let (weight, bias) = (numbers::<T>(seed + 2, fold.kernel.pow(2) * inputs * outputs), numbers::<T>(seed + 3, outputs));
        let expected = reference::fold(fold, x.view(), &weight, &bias, dy.view());
        let of = |shape: (usize, usize), values: &[f64]| Matrix::<T>::filled(shape, 0, 0, |i, j| T::of(values[i * shape.1 + j]));
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(fold.length, fold.kernel, inputs, outputs)];
            let mut y = Matrix::<T>::poisoned(seed, (rows.1, outputs));
            forward(isa, fold, x.view(), &weight, &bias, y.view_mut(), &mut scratch);
            y.check_gaps();
            assert_near("y", &y.to_vec(), &of((rows.1, outputs), &expected.y).to_vec(), Tolerance::Close);
            check_writes("dx", &of((rows.0, inputs), &expected.dx), Tolerance::Close, |dx, write| {
                backward_input(isa, fold, dy.view(), &weight, dx, write, &mut scratch);
            });
            check_writes("dW", &of((1, weight.len()), &expected.dweight), Tolerance::Close, |mut dw, write| {
                backward_weight(isa, fold, x.view(), dy.view(), dw.row_mut(0), write, &mut scratch);
            });
            check_writes("db", &of((1, outputs), &expected.dbias), Tolerance::Close, |mut db, write| {
                backward_bias(isa, fold, dy.view(), db.row_mut(0), write);
            });
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_its_sums(
            length in 2_usize..200, period in 1_usize..200, half in 0_usize..4, which in 0_usize..3, inputs in 1_usize..9,
            outputs in 1_usize..9, seed in 0_u64..1000
        ) {
            let fold = Fold { period: period.min(length), length, kernel: 2 * half + 1 };
            // From the sequence into the image, within it, and back.
            let most = Fold::most_positions(length);
            let rows = [(length, most), (most, most), (most, length)][which];
            check::<f32>(fold, rows, inputs, outputs, seed);
            check::<f64>(fold, rows, inputs, outputs, seed);
        }
    }

    #[test]
    fn sizes_of_the_peer() {
        for period in [1000, 333, 2] {
            check::<f32>(Fold { period, length: 1000, kernel: 11 }, (1000, 1332), 4, 32, 1);
        }
        assert_eq!(Fold::most_positions(1000), 1332);
    }
}
