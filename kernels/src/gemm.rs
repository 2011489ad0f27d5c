//! Matrix products of strided row-major matrices.
//!
//! | function | c | a | b |
//! | --- | --- | --- | --- |
//! | [`ab`] | a·b | `[m, k]` | `[k, n]` |
//! | [`atb`] | aᵀ·b | `[k, m]` | `[k, n]` |
//! | [`abt`] | a·bᵀ | `[m, k]` | `[n, k]` |
//!
//! c is `[m, n]` and is overwritten or added to; an empty k gives zeros. The summed index is taken in blocks whose panel of b
//! stays in the first-level cache; a is read where it lies (tile.rs). A result of a few rows has its own way (few_rows.rs); and the tile is tall or
//! wide as suits the result. Written for the sizes of this project:
//! n from 6 to a few hundred, k up to a few thousand, any m.

use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, Store};
use crate::{Real, Rows, RowsMut, Write};
use few_rows::FEW;

mod few_rows;

/// Longest block of the summed index: a panel of 16 numbers a line is 16 KiB in f32 (8 numbers in f64), half the first-level cache.
pub const LONGEST_BLOCK: usize = 256;

/// Blocks of the summed index, of nearly equal length; one empty block if there is nothing to sum.
fn blocks(k: usize) -> impl Iterator<Item = (usize, usize)> {
    let count = k.div_ceil(LONGEST_BLOCK).max(1);
    let length = k.div_ceil(count);
    (0..count).map(move |i| ((i * length).min(k), ((i + 1) * length).min(k)))
}

/// Scratch, in numbers, that any of the three products needs for these sizes.
pub fn scratch_len(m: usize, k: usize, n: usize) -> usize {
    let _ = m;
    tile::panels_len(k.min(LONGEST_BLOCK), n)
}

/// c {=, +=} a·b; a `[m, k]`, b `[k, n]`, c `[m, n]`.
pub fn ab<T: Real>(isa: InstructionSet, a: Rows<'_, T>, b: Rows<'_, T>, c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(a.rows() == c.rows() && a.cols() == b.rows() && b.cols() == c.cols(), "a·b: shapes do not chain");
    T::gemm_product(isa, Product { a, b: Right::Plain(b), bias: None, c, write, scratch });
}

/// c {=, +=} a·bᵀ; a `[m, k]`, b `[n, k]`, c `[m, n]`.
pub fn abt<T: Real>(isa: InstructionSet, a: Rows<'_, T>, b: Rows<'_, T>, c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    abt_bias(isa, a, b, None, c, write, scratch);
}

/// c {=, +=} a·bᵀ + bias, bias `[n]` on every row.
pub(crate) fn abt_bias<T: Real>(
    isa: InstructionSet,
    a: Rows<'_, T>,
    b: Rows<'_, T>,
    bias: Option<&[T]>,
    c: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    assert!(a.rows() == c.rows() && a.cols() == b.cols() && b.rows() == c.cols(), "a·bᵀ: shapes do not chain");
    assert!(bias.is_none_or(|bias| bias.len() == c.cols()), "a·bᵀ + bias: length of the bias");
    T::gemm_product(isa, Product { a, b: Right::Transposed(b), bias, c, write, scratch });
}

/// c {=, +=} aᵀ·b; a `[k, m]`, b `[k, n]`, c `[m, n]`.
pub fn atb<T: Real>(isa: InstructionSet, a: Rows<'_, T>, b: Rows<'_, T>, c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(a.cols() == c.rows() && a.rows() == b.rows() && b.cols() == c.cols(), "aᵀ·b: shapes do not chain");
    let _ = scratch;
    T::gemm_transposed_product(isa, TransposedProduct { a, b, c, write });
}

enum Right<'a, T> {
    Plain(Rows<'a, T>),
    Transposed(Rows<'a, T>),
}

pub(crate) struct Product<'a, T> {
    a: Rows<'a, T>,
    b: Right<'a, T>,
    bias: Option<&'a [T]>,
    c: RowsMut<'a, T>,
    write: Write,
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for Product<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        if self.c.rows() <= FEW {
            self.few_rows::<I, NR>();
        } else {
            tile::run_for::<T, I, MR, NR>(self.c.cols(), ByTiles(self));
        }
    }
}

/// Rows that lie so far apart are read once in their order, before tiles go down their columns: no processor foresees reading 96 rows
/// side by side.
const FAR_BYTES: usize = 2048;

/// A product by tiles, whatever their shape.
struct ByTiles<'a, T>(Product<'a, T>);

impl<T: Real> Tiled<T> for ByTiles<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Product { a, b, bias, mut c, write, scratch } = self.0;
        let n = c.cols();
        for (start, end) in blocks(a.cols()) {
            let depth = end - start;
            let panels = &mut scratch[..depth * n.next_multiple_of(NR)];
            if depth > 0 {
                match &b {
                    Right::Plain(b) => tile::pack::<T, NR>(b.range(start, end), panels),
                    Right::Transposed(b) => {
                        tile::pack_transposed::<T, NR>(depth, n, 1, |j| &b.row(j)[start..end], depth * NR, panels);
                    }
                }
            }
            let (bias, write) = if start == 0 { (bias, write) } else { (None, Write::Add) };
            let mut sink = Store { c: c.reborrow(), bias, write };
            tile::rows::<T, I, _, _, MR, NR>(&a.columns(start, depth), n, panels, &mut sink);
        }
    }
}

/// Rows of a result that lie far apart are written in blocks of so many, several panels wide: a panel at a time would touch as many places in
/// memory as there are rows, and only two lines of the cache at each.
const FAR_ROWS: usize = 24;

pub(crate) struct TransposedProduct<'a, T> {
    a: Rows<'a, T>,
    b: Rows<'a, T>,
    c: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Tiled<T> for TransposedProduct<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        tile::run_for::<T, I, MR, NR>(self.b.cols(), TransposedByTiles(self));
    }
}

/// A transposed product by tiles, whatever their shape.
struct TransposedByTiles<'a, T>(TransposedProduct<'a, T>);

impl<T: Real> Tiled<T> for TransposedByTiles<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let mut product = self.0;
        let TransposedProduct { a, c, write, .. } = &mut product;
        if a.rows() == 0 && *write == Write::Set {
            (0..c.rows()).for_each(|i| c.row_mut(i).fill(T::ZERO));
        }
        if c.stride() * size_of::<T>() < FAR_BYTES {
            product.by_panels::<I, MR, NR, { tile::COLUMN_DEPTH }>(usize::MAX);
        } else {
            product.by_panels::<I, MR, NR, { 2 * tile::COLUMN_DEPTH }>(FAR_ROWS);
        }
    }
}

impl<T: Real> TransposedProduct<'_, T> {
    /// As many panels at a time as have LINES lines, and for them `height` rows of c, the last time what is left, too.
    #[inline(always)]
    fn by_panels<I: Isa, const MR: usize, const NR: usize, const LINES: usize>(self, height: usize) {
        let TransposedProduct { a, b, mut c, write } = self;
        let mut panels = [[T::ZERO; NR]; LINES];
        for start in (0..a.rows()).step_by(tile::COLUMN_DEPTH) {
            let depth = tile::COLUMN_DEPTH.min(a.rows() - start);
            let write = if start == 0 { write } else { Write::Add };
            let (a, b) = (a.range(start, start + depth), b.range(start, start + depth));
            if a.stride() * size_of::<T>() >= FAR_BYTES {
                a.touch();
            }
            let together = if height < usize::MAX { LINES / depth } else { 1 };
            for first in (0..b.cols()).step_by(together * NR) {
                let columns = (first..b.cols()).step_by(NR).take(together);
                for (panel, j) in panels.chunks_exact_mut(depth).zip(columns.clone()) {
                    tile::pack_panel(&b, j, panel);
                }
                let blocks = (c.rows() / height).max(1);
                for block in 0..blocks {
                    let top = block * height;
                    let bottom = if block + 1 == blocks { c.rows() } else { top + height };
                    for (panel, j) in panels.chunks_exact(depth).zip(columns.clone()) {
                        let mut sink = Store { c: c.reborrow().range(top, bottom), bias: None, write };
                        let left = |p| &a.row(p)[top..bottom];
                        tile::columns::<T, I, _, MR, NR>((left, bottom - top), panel, (j, NR.min(b.cols() - j)), &mut sink);
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
    use crate::reference;
    use crate::testing::{Matrix, check_writes};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(m: usize, k: usize, n: usize, seed: u64) {
        let (a, b) = (Matrix::<T>::random(seed, (m, k)), Matrix::<T>::random(seed + 1, (k, n)));
        let (at, bt) = (Matrix::<T>::random(seed, (k, m)), Matrix::<T>::random(seed + 1, (n, k)));
        let mut expected = [(); 3].map(|()| Matrix::<T>::poisoned(seed, (m, n)));
        reference::gemm_ab(a.view(), b.view(), expected[0].view_mut());
        reference::gemm_atb(at.view(), b.view(), expected[1].view_mut());
        reference::gemm_abt(a.view(), bt.view(), expected[2].view_mut());
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(m, k, n)];
            let what = |form: &str| format!("{form} {m} x {k} x {n} at level {isa}");
            check_writes(&what("ab"), &expected[0], Tolerance::Close, |c, write| {
                ab(isa, a.view(), b.view(), c, write, &mut scratch)
            });
            check_writes(&what("atb"), &expected[1], Tolerance::Close, |c, write| {
                atb(isa, at.view(), b.view(), c, write, &mut scratch)
            });
            check_writes(&what("abt"), &expected[2], Tolerance::Close, |c, write| {
                abt(isa, a.view(), bt.view(), c, write, &mut scratch)
            });
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equal_the_triple_loop(m in 0_usize..70, k in 0_usize..70, n in 0_usize..70, seed in 0_u64..1000) {
            check::<f32>(m, k, n, seed);
            check::<f64>(m, k, n, seed);
        }
    }

    #[test]
    fn sizes_of_the_networks_and_around_the_blocks() {
        for (m, k, n) in [
            (500, 64, 64),
            (251, 320, 64),
            (64, 1000, 64),
            (1, 1000, 64),
            (1000, 1, 64),
            (64, 513, 16),
            (241, 256, 257),
            (3, 9, 35),
            (4, 300, 1100),
            (128, 32, 1100),
            (30, 200, 600),
            (0, 5, 40),
            (0, 5, 600),
        ] {
            check::<f32>(m, k, n, 3);
            check::<f64>(m, k, n, 3);
        }
    }

    #[test]
    fn equal_matrixmultiply() {
        let (m, k, n) = (123, 320, 64);
        let (a, b) = (crate::testing::numbers::<f32>(1, m * k), crate::testing::numbers::<f32>(2, k * n));
        let mut expected = vec![0.0_f32; m * n];
        // SAFETY: the three pointers cover m x k, k x n and m x n numbers at the row strides given.
        unsafe {
            let (row_a, row_b) = (k as isize, n as isize);
            matrixmultiply::sgemm(m, k, n, 1.0, a.as_ptr(), row_a, 1, b.as_ptr(), row_b, 1, 0.0, expected.as_mut_ptr(), row_b, 1);
        }
        for isa in InstructionSet::available() {
            let (mut c, mut scratch) = (vec![f32::NAN; m * n], vec![f32::NAN; scratch_len(m, k, n)]);
            ab(isa, Rows::packed(&a, m, k), Rows::packed(&b, k, n), RowsMut::packed(&mut c, m, n), Write::Set, &mut scratch);
            crate::testing::assert_near("ab against matrixmultiply", &c, &expected, Tolerance::Close);
        }
    }

    #[test]
    fn overlapping_rows_may_be_read() {
        let a = crate::testing::numbers::<f64>(1, 30);
        let b = Matrix::<f64>::random(2, (6, 4));
        let (mut c, mut expected) = (Matrix::<f64>::poisoned(0, (9, 4)), Matrix::<f64>::poisoned(0, (9, 4)));
        let hankel = Rows::new(&a, 9, 6, 3);
        reference::gemm_ab(hankel, b.view(), expected.view_mut());
        let mut scratch = vec![0.0; scratch_len(9, 6, 4)];
        ab(InstructionSet::PLAIN, hankel, b.view(), c.view_mut(), Write::Set, &mut scratch);
        crate::testing::assert_near("hankel", &c.to_vec(), &expected.to_vec(), Tolerance::Close);
    }
}
