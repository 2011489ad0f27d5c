//! The inner loops of every matrix product and convolution: a tile of accumulators that stays in registers.
//!
//! ```text
//! acc[i][j] = Σ_p left(i, p)·right(p, j),   i < MR, j < NR
//! ```
//!
//! The left operand is never copied. It comes as rows ([`LeftRows`]: row i of tap τ is a slice along p, which covers a matrix,
//! a shifted sequence with replicated ends, and a sequence with zeros outside) or as columns ([`columns`]: row p is a slice
//! along i, which is the transposed product). The right operand of the first kind is packed into panels `[n/NR][p][NR]`.
//!
//! Not here: blocking for the caches (gemm.rs), shapes, dispatch.

use crate::level::Isa;
use crate::{Real, Rows, RowsMut, Write};

/// Widest panel of any level, in numbers.
const WIDEST: usize = 32;

/// Rows of the left operand that pass over one panel before the next panel is taken: they stay in the second-level cache.
const ROW_BLOCK: usize = 240;

/// Numbers that the panels of a right operand `[depth, n]` take at any level.
pub(crate) const fn panels_len(depth: usize, n: usize) -> usize {
    depth * n.next_multiple_of(WIDEST)
}

/// A left operand whose rows are slices along the summed index, given in `taps` pieces.
pub(crate) trait LeftRows<T> {
    /// Number of rows.
    fn rows(&self) -> usize;
    /// Number of pieces of a row.
    fn taps(&self) -> usize;
    /// Length of a piece.
    fn depth(&self) -> usize;
    /// Piece `tap` of row `i`, of length `depth`.
    fn piece(&self, i: usize, tap: usize) -> &[T];
}

impl<T> LeftRows<T> for Rows<'_, T> {
    #[inline(always)]
    fn rows(&self) -> usize {
        Rows::rows(self)
    }
    #[inline(always)]
    fn taps(&self) -> usize {
        1
    }
    #[inline(always)]
    fn depth(&self) -> usize {
        self.cols()
    }
    #[inline(always)]
    fn piece(&self, i: usize, _: usize) -> &[T] {
        self.row(i)
    }
}

/// Where finished sums go.
pub(crate) trait Sink<T> {
    /// `sums` belong to row `i`, columns `j…`.
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]);
}

/// Overwrites or adds, after adding a bias a column if there is one.
pub(crate) struct Store<'a, T> {
    pub c: RowsMut<'a, T>,
    pub bias: Option<&'a [T]>,
    pub write: Write,
}

impl<T: Real> Sink<T> for Store<'_, T> {
    #[inline(always)]
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]) {
        let c = &mut self.c.row_mut(i)[j..][..sums.len()];
        match (self.write, self.bias) {
            (Write::Set, None) => c.copy_from_slice(sums),
            (Write::Add, None) => c.iter_mut().zip(sums).for_each(|(c, s)| *c += *s),
            (Write::Set, Some(b)) => c.iter_mut().zip(sums).zip(&b[j..]).for_each(|((c, s), b)| *c = *s + *b),
            (Write::Add, Some(b)) => c.iter_mut().zip(sums).zip(&b[j..]).for_each(|((c, s), b)| *c += *s + *b),
        }
    }
}

/// Packs b `[depth, n]` into panels, the last one filled up with zeros.
#[inline(always)]
pub(crate) fn pack<T: Real, const NR: usize>(b: Rows<'_, T>, panels: &mut [T]) {
    let (depth, n) = (b.rows(), b.cols());
    for (panel, j) in panels.chunks_exact_mut(depth * NR).zip((0..n).step_by(NR)) {
        let width = NR.min(n - j);
        for (p, line) in panel.as_chunks_mut::<NR>().0.iter_mut().enumerate() {
            let from = &b.row(p)[j..][..width];
            if width == NR {
                line.copy_from_slice(from);
            } else {
                line.fill(T::ZERO);
                line[..width].copy_from_slice(from);
            }
        }
    }
}

/// Packs bᵀ for b `[n, depth]`: element (p, j) of the panels is `b[j][p]`, where row j of b is `row(j)`, elements `step` apart.
#[inline(always)]
pub(crate) fn pack_transposed<'b, T: Real, const NR: usize>(
    depth: usize,
    n: usize,
    step: usize,
    row: impl Fn(usize) -> &'b [T],
    panel_stride: usize,
    panels: &mut [T],
) {
    for (panel, j) in panels.chunks_mut(panel_stride).zip((0..n).step_by(NR)) {
        let lines = &mut panel.as_chunks_mut::<NR>().0[..depth];
        for column in 0..NR {
            if j + column < n {
                lines.iter_mut().zip(row(j + column).iter().step_by(step)).for_each(|(line, b)| line[column] = *b);
            } else {
                lines.iter_mut().for_each(|line| line[column] = T::ZERO);
            }
        }
    }
}

/// The accumulators in memory, where variables may index them. The originals are touched at fixed places only: otherwise the
/// compiler would keep them in memory all through the inner loop.
#[inline(always)]
fn spill<T: Real, const MR: usize, const NR: usize>(acc: &[[T; NR]; MR]) -> [[T; NR]; MR] {
    let mut copy = [[T::ZERO; NR]; MR];
    copy.iter_mut().zip(acc).for_each(|(copy, acc)| *copy = *acc);
    copy
}

/// One tile of the row form: rows `first…first + MR` (the last row again beyond the end), one panel.
#[inline(always)]
fn row_tile<T: Real, I: Isa, L: LeftRows<T>, const MR: usize, const NR: usize>(
    left: &L,
    first: usize,
    panel: &[[T; NR]],
) -> [[T; NR]; MR] {
    let (depth, last) = (left.depth(), left.rows() - 1);
    let mut acc = [[T::ZERO; NR]; MR];
    for (tap, lines) in panel.chunks_exact(depth).enumerate() {
        // Not array::from_fn: its closure is not always inlined, and then the lengths are lost.
        let mut pieces: [&[T]; MR] = [&[]; MR];
        for (i, piece) in pieces.iter_mut().enumerate() {
            *piece = &left.piece((first + i).min(last), tap)[..depth];
        }
        for (p, line) in lines.iter().enumerate().take(depth) {
            for i in 0..MR {
                let a = pieces[i][p];
                for j in 0..NR {
                    acc[i][j] = I::mul_add(a, line[j], acc[i][j]);
                }
            }
        }
    }
    spill(&acc)
}

/// sink ← left·right for a right operand of `n` columns in panels of depth taps·depth.
#[inline(always)]
pub(crate) fn rows<T: Real, I: Isa, L: LeftRows<T>, S: Sink<T>, const MR: usize, const NR: usize>(
    left: &L,
    n: usize,
    panels: &[T],
    sink: &mut S,
) {
    let (m, lines) = (left.rows(), left.taps() * left.depth());
    if lines == 0 {
        for (i, j) in (0..m).flat_map(|i| (0..n).step_by(NR).map(move |j| (i, j))) {
            sink.store::<I>(i, j, &[T::ZERO; NR][..NR.min(n - j)]);
        }
        return;
    }
    for block in (0..m).step_by(ROW_BLOCK) {
        let block_end = m.min(block + ROW_BLOCK);
        for (panel, j) in panels.chunks_exact(lines * NR).zip((0..n).step_by(NR)) {
            let panel = panel.as_chunks::<NR>().0;
            let width = NR.min(n - j);
            for first in (block..block_end).step_by(MR) {
                let acc: [[T; NR]; MR] = row_tile::<T, I, L, MR, NR>(left, first, panel);
                if width == NR && first + MR <= block_end {
                    for (i, sums) in acc.iter().enumerate() {
                        sink.store::<I>(first + i, j, sums);
                    }
                } else {
                    for (i, sums) in acc.iter().enumerate().take(block_end - first) {
                        sink.store::<I>(first + i, j, &sums[..width]);
                    }
                }
            }
        }
    }
}

/// One tile of the column form: `acc[i][j] = Σ_p left(p)[i]·right(p)[j]`.
#[inline(always)]
fn column_tile<'a, T: Real, I: Isa, const MR: usize, const NR: usize>(
    depth: usize,
    left: impl Fn(usize) -> &'a [T],
    right: impl Fn(usize) -> &'a [T],
) -> [[T; NR]; MR] {
    let mut acc = [[T::ZERO; NR]; MR];
    for p in 0..depth {
        let (a, b) = (&left(p)[..MR], &right(p)[..NR]);
        for i in 0..MR {
            for j in 0..NR {
                acc[i][j] = I::mul_add(a[i], b[j], acc[i][j]);
            }
        }
    }
    spill(&acc)
}

/// sink ← leftᵀ·right: row p of the left operand is `left(p)` `[m]`, of the right one `right(p)` `[n]`; p < depth.
#[inline(always)]
pub(crate) fn columns<'a, T: Real, I: Isa, S: Sink<T>, const MR: usize, const NR: usize>(
    (depth, m, n): (usize, usize, usize),
    left: impl Fn(usize) -> &'a [T],
    right: impl Fn(usize) -> &'a [T],
    sink: &mut S,
) {
    // The last tile starts early enough to be whole; what it repeats is not stored again.
    for j_wanted in (0..n).step_by(NR) {
        let j = j_wanted.min(n.saturating_sub(NR));
        for i_wanted in (0..m).step_by(MR) {
            let i = i_wanted.min(m.saturating_sub(MR));
            if m >= MR && n >= NR {
                let acc: [[T; NR]; MR] = column_tile::<T, I, MR, NR>(depth, |p| &left(p)[i..], |p| &right(p)[j..]);
                if i == i_wanted && j == j_wanted {
                    for (row, sums) in acc.iter().enumerate() {
                        sink.store::<I>(i + row, j, sums);
                    }
                } else {
                    for (row, sums) in acc.iter().enumerate().skip(i_wanted - i) {
                        sink.store::<I>(i + row, j_wanted, &sums[j_wanted - j..]);
                    }
                }
            } else {
                narrow_columns::<T, I, S, MR, NR>(
                    depth,
                    (i_wanted, MR.min(m - i_wanted)),
                    (j_wanted, NR.min(n - j_wanted)),
                    &left,
                    &right,
                    sink,
                );
            }
        }
    }
}

/// A tile of [`columns`] for operands narrower than a tile.
#[inline(always)]
fn narrow_columns<'a, T: Real, I: Isa, S: Sink<T>, const MR: usize, const NR: usize>(
    depth: usize,
    (i, height): (usize, usize),
    (j, width): (usize, usize),
    left: &impl Fn(usize) -> &'a [T],
    right: &impl Fn(usize) -> &'a [T],
    sink: &mut S,
) {
    let mut acc = [[T::ZERO; NR]; MR];
    for p in 0..depth {
        let b = &right(p)[j..][..width];
        for (acc, a) in acc.iter_mut().zip(&left(p)[i..][..height]) {
            acc.iter_mut().zip(b).for_each(|(acc, b)| *acc = I::mul_add(*a, *b, *acc));
        }
    }
    for (row, sums) in acc.iter().enumerate().take(height) {
        sink.store::<I>(i + row, j, &sums[..width]);
    }
}
