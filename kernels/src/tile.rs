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

use crate::instruction_set::{Isa, Tiled};
use crate::vector::Vector;
use crate::{Real, Rows, RowsMut, Write};

/// Widest panel of any level, in numbers.
pub(crate) const WIDEST: usize = 32;

/// Rows of the left operand that pass over one panel before the next panel is taken: they stay in the second-level cache.
const ROW_BLOCK: usize = 240;

/// The same for a wide result, which is then written nearly in the order in which it lies in memory; the panels are read from the
/// second-level cache.
const ROW_BLOCK_OF_WIDE: usize = 24;

/// From this many columns on a result is wide.
const WIDE_RESULT: usize = 128;

/// A multiple of the height of every level's wide tile: cut here, rows are in the same tiles as uncut.
pub(crate) const CUT: usize = 12;

/// Lines of a panel that the column form takes at a time: with a left operand of 64 columns, 30 KiB in f32.
pub(crate) const COLUMN_DEPTH: usize = 96;

/// Columns of a panel for a result of `n` columns, where the wide tile has `NR`: half of that, the tall tile's, if it leaves less of
/// the last panel empty.
#[inline(always)]
pub(crate) const fn panel_width<const NR: usize>(n: usize) -> usize {
    if n.next_multiple_of(NR / 2) < n.next_multiple_of(NR) { NR / 2 } else { NR }
}

/// Runs a product whose result has `n` columns with the tile that suits them.
#[inline(always)]
pub(crate) fn run_for<T: Real, I: Isa, const MR: usize, const NR: usize>(n: usize, product: impl Tiled<T>) {
    if panel_width::<NR>(n) < NR { I::tall(product) } else { product.run::<I, MR, NR>() }
}

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

/// A row of a tile in registers, NR numbers: both of them, or in a tall tile the first alone. The other one is then never
/// computed with, and the compiler drops it.
pub(crate) type Pair<T, I> = [<I as Isa>::Vector<T>; 2];

/// Whether rows of NR numbers take two registers.
#[inline(always)]
pub(crate) fn is_pair<T: Real, I: Isa, const NR: usize>() -> bool {
    let lanes = I::Vector::<T>::LANES;
    assert!(NR == lanes || NR == 2 * lanes, "a panel is one or two registers wide");
    NR > lanes
}

/// Where finished sums go.
pub(crate) trait Sink<T: Real> {
    /// `sums` belong to row `i`, columns `j…`.
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]);

    /// The same for a whole row of a tile, still in its registers.
    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, i: usize, j: usize, sums: Pair<T, I>) {
        self.store::<I>(i, j, &unload::<T, I, NR>(sums));
    }
}

/// Registers as numbers in memory.
#[inline(always)]
pub(crate) fn unload<T: Real, I: Isa, const NR: usize>(pair: Pair<T, I>) -> [T; NR] {
    let mut numbers = [T::ZERO; NR];
    store::<T, I, NR>(pair, &mut numbers);
    numbers
}

/// Writes a row of a tile.
#[inline(always)]
pub(crate) fn store<T: Real, I: Isa, const NR: usize>(pair: Pair<T, I>, numbers: &mut [T; NR]) {
    let to = numbers.as_mut_ptr();
    // SAFETY: the array holds one register, and two where there is a pair.
    unsafe {
        pair[0].store(to);
        if is_pair::<T, I, NR>() {
            pair[1].store(to.add(I::Vector::<T>::LANES));
        }
    }
}

/// NR numbers as registers.
#[inline(always)]
pub(crate) fn load<T: Real, I: Isa, const NR: usize>(numbers: &[T; NR]) -> Pair<T, I> {
    let from = numbers.as_ptr();
    // SAFETY: the array holds one register, and two where there is a pair.
    unsafe {
        let first = I::Vector::load(from);
        [first, if is_pair::<T, I, NR>() { I::Vector::load(from.add(I::Vector::<T>::LANES)) } else { first }]
    }
}

/// A row of a tile plus the first NR of at least as many numbers.
#[inline(always)]
pub(crate) fn plus<T: Real, I: Isa, const NR: usize>(pair: Pair<T, I>, numbers: &[T]) -> Pair<T, I> {
    let Some(numbers) = numbers.first_chunk::<NR>() else { return pair };
    let more = load::<T, I, NR>(numbers);
    [pair[0].add(more[0]), if is_pair::<T, I, NR>() { pair[1].add(more[1]) } else { pair[1] }]
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

    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, i: usize, j: usize, mut sums: Pair<T, I>) {
        if let Some(bias) = self.bias {
            sums = plus::<T, I, NR>(sums, &bias[j..]);
        }
        let Some(c) = self.c.row_mut(i)[j..].first_chunk_mut::<NR>() else { return };
        if self.write == Write::Add {
            sums = plus::<T, I, NR>(sums, c);
        }
        store::<T, I, NR>(sums, c);
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

/// Stores the rows of a whole tile. Written out, so that no variable indexes the accumulators: otherwise the compiler would keep
/// them in memory, all through the inner loop.
macro_rules! store_rows {
    ($acc:ident, |$i:ident, $sums:ident| $store:expr) => {
        const { assert!(MR <= 24, "a tile has more rows than are written out here") };
        store_rows!(@ $acc, |$i, $sums| $store, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23)
    };
    (@ $acc:ident, |$i:ident, $sums:ident| $store:expr, $($row:literal)*) => {
        $(if $row < MR {
            let ($i, $sums) = ($row, $acc[$row]);
            $store;
        })*
    };
}

/// The accumulators in memory, where variables may index them, for the tiles at the edges.
#[inline(always)]
pub(crate) fn spill<T: Real, I: Isa, const MR: usize, const NR: usize>(acc: [Pair<T, I>; MR]) -> [[T; NR]; MR] {
    let mut rows = [[T::ZERO; NR]; MR];
    // A loop, not a closure: a closure that is not inlined would be compiled without the level's instructions.
    for (row, pair) in rows.iter_mut().zip(acc) {
        *row = unload::<T, I, NR>(pair);
    }
    rows
}

/// `acc[i] += a·b` for a row of NR numbers.
#[inline(always)]
pub(crate) fn accumulate<T: Real, I: Isa, const NR: usize>(acc: &mut Pair<T, I>, a: T, b: Pair<T, I>) {
    let a = I::Vector::splat(a);
    acc[0] = a.mul_add(b[0], acc[0]);
    if is_pair::<T, I, NR>() {
        acc[1] = a.mul_add(b[1], acc[1]);
    }
}

/// One tile of the row form: rows `first…first + MR` (the last row again beyond the end), one panel.
#[inline(always)]
fn row_tile<T: Real, I: Isa, L: LeftRows<T>, const MR: usize, const NR: usize>(
    left: &L,
    first: usize,
    panel: &[[T; NR]],
) -> [Pair<T, I>; MR] {
    let (depth, last) = (left.depth(), left.rows() - 1);
    let mut acc = [[I::Vector::splat(T::ZERO); 2]; MR];
    for (tap, lines) in panel.chunks_exact(depth).enumerate() {
        // Not array::from_fn: its closure is not always inlined, and then the lengths are lost.
        let mut pieces: [&[T]; MR] = [&[]; MR];
        for (i, piece) in pieces.iter_mut().enumerate() {
            *piece = &left.piece((first + i).min(last), tap)[..depth];
        }
        for (p, line) in lines.iter().enumerate() {
            let b = load::<T, I, NR>(line);
            for i in 0..MR {
                // SAFETY: a chunk has `depth` lines, and each piece was cut to `depth` above.
                let a = unsafe { *pieces[i].get_unchecked(p) };
                accumulate::<T, I, NR>(&mut acc[i], a, b);
            }
        }
    }
    acc
}

/// sink ← left·right for a right operand of `n` columns in panels of depth taps·depth.
#[inline(always)]
pub(crate) fn rows<T: Real, I: Isa, L: LeftRows<T>, S: Sink<T>, const MR: usize, const NR: usize>(
    left: &L,
    n: usize,
    panels: &[T],
    sink: &mut S,
) {
    const {
        let blocks_end_with_a_tile = ROW_BLOCK.is_multiple_of(MR) && ROW_BLOCK_OF_WIDE.is_multiple_of(MR);
        let blocks_end_at_a_cut = ROW_BLOCK.is_multiple_of(CUT) && ROW_BLOCK_OF_WIDE.is_multiple_of(CUT);
        assert!(blocks_end_with_a_tile && blocks_end_at_a_cut, "a block ends inside a tile, or between cuts");
    }
    let (m, lines) = (left.rows(), left.taps() * left.depth());
    if lines == 0 {
        for (i, j) in (0..m).flat_map(|i| (0..n).step_by(NR).map(move |j| (i, j))) {
            sink.store::<I>(i, j, &[T::ZERO; NR][..NR.min(n - j)]);
        }
        return;
    }
    let height = if n < WIDE_RESULT { ROW_BLOCK } else { ROW_BLOCK_OF_WIDE };
    for block in (0..m).step_by(height) {
        let block_end = m.min(block + height);
        for (panel, j) in panels.chunks_exact(lines * NR).zip((0..n).step_by(NR)) {
            let panel = panel.as_chunks::<NR>().0;
            let width = NR.min(n - j);
            for first in (block..block_end).step_by(MR) {
                let acc = row_tile::<T, I, L, MR, NR>(left, first, panel);
                if width == NR && first + MR <= block_end {
                    store_rows!(acc, |i, sums| sink.store_whole::<I, NR>(first + i, j, sums));
                } else {
                    for (i, sums) in spill::<T, I, MR, NR>(acc).iter().enumerate().take(block_end - first) {
                        sink.store::<I>(first + i, j, &sums[..width]);
                    }
                }
            }
        }
    }
}

/// sink ← left·panel for the first rows of an array, as many as the sink has: rows at a fixed distance need one pointer for a whole tile, where
/// [`rows`] needs one each. The array has a multiple of MR rows, so that the last tile finds numbers to read; a panel's columns belong to columns `j…`.
#[inline(always)]
pub(crate) fn array_rows<T: Real, I: Isa, const L: usize, const MR: usize, const NR: usize>(
    left: &[[T; L]],
    panel: &[[T; NR]],
    j: usize,
    sink: &mut Store<'_, T>,
) {
    let (count, width) = (sink.c.rows(), NR.min(sink.c.cols() - j));
    assert!(left.len().is_multiple_of(MR) && left.len() >= count && panel.len() == L, "a tile reaches beyond the array");
    for (tile, first) in left.as_chunks::<MR>().0.iter().zip((0..count).step_by(MR)) {
        let mut acc = [[I::Vector::splat(T::ZERO); 2]; MR];
        for (p, line) in panel.iter().enumerate().take(L) {
            let b = load::<T, I, NR>(line);
            for i in 0..MR {
                accumulate::<T, I, NR>(&mut acc[i], tile[i][p], b);
            }
        }
        if width == NR && first + MR <= count {
            store_rows!(acc, |i, sums| sink.store_whole::<I, NR>(first + i, j, sums));
        } else {
            for (i, sums) in spill::<T, I, MR, NR>(acc).iter().enumerate().take(count - first) {
                sink.store::<I>(first + i, j, &sums[..width]);
            }
        }
    }
}

/// Packs columns `j…` of b as one panel, filled up with zeros.
#[inline(always)]
pub(crate) fn pack_panel<T: Real, const NR: usize>(b: &Rows<'_, T>, j: usize, panel: &mut [[T; NR]]) {
    let width = NR.min(b.cols() - j);
    for (p, line) in panel.iter_mut().enumerate() {
        line[width..].fill(T::ZERO);
        line[..width].copy_from_slice(&b.row(p)[j..][..width]);
    }
}

/// One tile of the column form: `acc[i][j] = Σ_p left[p][i₀ + i]·panel[p][j]`.
#[inline(always)]
fn column_tile<'a, T: Real, I: Isa, const MR: usize, const NR: usize>(
    left: impl Fn(usize) -> &'a [T],
    i_first: usize,
    panel: &[[T; NR]],
) -> [Pair<T, I>; MR] {
    let mut acc = [[I::Vector::splat(T::ZERO); 2]; MR];
    for (p, line) in panel.iter().enumerate() {
        let b = load::<T, I, NR>(line);
        let a = &left(p)[i_first..][..MR];
        for i in 0..MR {
            accumulate::<T, I, NR>(&mut acc[i], a[i], b);
        }
    }
    acc
}

/// sink ← leftᵀ·panel; row p of the left operand is `left(p)` `[m]`; panel `[depth, NR]`, of which `width` columns belong to columns `j…` of the result. Left
/// and panel should fit in the first-level cache together; the left one is passed over once, the panel m/MR times.
#[inline(always)]
pub(crate) fn columns<'a, T: Real, I: Isa, S: Sink<T>, const MR: usize, const NR: usize>(
    (left, m): (impl Fn(usize) -> &'a [T], usize),
    panel: &[[T; NR]],
    (j, width): (usize, usize),
    sink: &mut S,
) {
    if m < MR {
        for i in 0..m {
            let mut sums = [T::ZERO; NR];
            for (p, line) in panel.iter().enumerate() {
                let a = left(p)[i];
                for (sum, b) in sums.iter_mut().zip(line) {
                    *sum = I::mul_add(a, *b, *sum);
                }
            }
            sink.store::<I>(i, j, &sums[..width]);
        }
        return;
    }
    for i_wanted in (0..m).step_by(MR) {
        // The last tile starts early enough to be whole; what it repeats is not stored again.
        let i = i_wanted.min(m - MR);
        let acc = column_tile::<T, I, MR, NR>(&left, i, panel);
        if i == i_wanted && width == NR {
            store_rows!(acc, |row, sums| sink.store_whole::<I, NR>(i + row, j, sums));
        } else {
            for (row, sums) in spill::<T, I, MR, NR>(acc).iter().enumerate().skip(i_wanted - i) {
                sink.store::<I>(i + row, j, &sums[..width]);
            }
        }
    }
}
