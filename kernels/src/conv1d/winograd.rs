//! Convolution with fewer products: m = 7 − taps neighbouring output rows from six products in the place of m·taps (minimal filtering,
//! Winograd 1980, by the interpolation of Toom 1963 and Cook 1966; in networks Lavin & Gray 2016).
//!
//! ```text
//! v_τ = Σ_k B[τ, k]·x[s + k],   u_τ = Σ_j G[τ, j]·W[j],   z[s + i] = Σ_τ A[i, τ]·(v_τ·u_τ),       τ, k < 6,  i < m
//! G[τ, j] = g_τ·a_τʲ,   A[i, τ] = a_τⁱ      at the points a = 0, 1, −1, 2, −½, ∞ (whose powers are 0, but for the highest, 1)
//! ```
//!
//! Equal in exact arithmetic for any B that belongs to the points, of which there is one. For 3 taps 12 products become 6, for 5 taps
//! 10. In f32 the error is about three times that of the sum as it stands (5·10⁻⁷ of the root mean square of z beside 1.5·10⁻⁷, 64
//! channels): points of larger magnitude, or more of them, would save more and cost digits.
//!
//! Taken for kernels of 3 and 5 taps whose channels fill whole panels at every level ([`applies`]). Not here: what is done with z.

use super::Geometry;
use crate::instruction_set::Isa;
use crate::tile::{self, Pair, Store};
use crate::vector::Vector;
use crate::{Real, Rows, RowsMut, Write};

/// Points, and products.
const POINTS: usize = 6;

/// The finite points.
const AT: [f64; POINTS - 1] = [0.0, 1.0, -1.0, 2.0, -0.5];

/// g: whatever makes the numbers of [`INPUT`] small integers.
const SCALE: [f64; POINTS] = [1.0 / 2.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 30.0, 8.0 / 15.0, 1.0 / 2.0];

/// B: the inverse of the transposed matrix of the powers of the points, rows divided by g.
const INPUT: [[f64; POINTS]; POINTS] = [
    [2.0, 3.0, -4.0, -3.0, 2.0, 0.0],
    [0.0, 2.0, 5.0, 1.0, -2.0, 0.0],
    [0.0, 2.0, 1.0, -5.0, 2.0, 0.0],
    [0.0, -1.0, -2.0, 1.0, 2.0, 0.0],
    [0.0, -4.0, 2.0, 4.0, -2.0, 0.0],
    [0.0, 2.0, 3.0, -4.0, -3.0, 2.0],
];

/// Rounding error in f32, root mean square of a result of 64 channels over that of the sums; as they stand it is 1.5·10⁻⁷.
#[cfg(test)]
pub(super) const ROUNDING: f64 = 6e-7;

/// Groups of output rows that are worked on at a time.
const GROUPS: usize = tile::CUT;

/// Groups of a block in the gradient of the weight, where the sum runs along them.
const WEIGHT_GROUPS: usize = 96;

/// Numbers of one point in a buffer of several: a few cache lines more than it holds, since otherwise the same place of all points
/// would be in the same few lines of the first-level cache.
const fn apart(numbers: usize) -> usize {
    numbers + 80
}

/// A multiple of m for every number of taps, and of m·[`GROUPS`].
pub(super) const CUT: usize = 4 * GROUPS;

/// a_τ to a power below `count`.
const fn power(point: usize, exponent: usize, count: usize) -> f64 {
    if point == POINTS - 1 {
        return if exponent == count - 1 { 1.0 } else { 0.0 };
    }
    let (mut product, mut factors) = (1.0, 0);
    while factors < exponent {
        product *= AT[point];
        factors += 1;
    }
    product
}

/// Whether a convolution of these sizes is computed this way.
pub(super) const fn applies(geometry: Geometry, inputs: usize, outputs: usize) -> bool {
    matches!(geometry.taps, 3 | 5)
        && inputs > 0
        && outputs > 0
        && inputs.is_multiple_of(tile::WIDEST)
        && outputs.is_multiple_of(tile::WIDEST)
}

/// Numbers of a packed weight.
pub(super) const fn packed_len(inputs: usize, outputs: usize) -> usize {
    POINTS * inputs * outputs
}

/// Scratch, in numbers, of [`product`].
pub(super) const fn product_scratch_len(inputs: usize) -> usize {
    POINTS * (apart(GROUPS * inputs) + apart(GROUPS * tile::WIDEST))
}

/// Scratch, in numbers, of [`weight_gradient`].
pub(super) const fn gradient_scratch_len(inputs: usize, outputs: usize) -> usize {
    POINTS * (apart(WEIGHT_GROUPS * inputs) + apart(WEIGHT_GROUPS * outputs) + apart(inputs * outputs))
}

/// u of a weight `[taps, in, out]`, as panels `[out/NR][τ][in][NR]`.
#[inline(always)]
pub(super) fn pack<T: Real, I: Isa, const NR: usize>(taps: usize, inputs: usize, outputs: usize, weight: &[T], packed: &mut [T]) {
    for (panel, packed) in packed.chunks_exact_mut(POINTS * inputs * NR).enumerate() {
        for (point, lines) in packed.chunks_exact_mut(inputs * NR).enumerate() {
            for (c, line) in lines.as_chunks_mut::<NR>().0.iter_mut().enumerate() {
                let row = Weights { weight, start: c * outputs + panel * NR, tap: (inputs * outputs).cast_signed() };
                tile::store::<T, I, NR>(row.combined::<I, NR>(point, taps), line);
            }
        }
    }
}

/// u of the adjoint's weight, whose taps are in reverse and whose inputs are the outputs, as panels `[in/NR][τ][out][NR]`.
#[inline(always)]
pub(super) fn pack_transposed<T: Real, I: Isa, const NR: usize>(
    taps: usize,
    inputs: usize,
    outputs: usize,
    weight: &[T],
    packed: &mut [T],
) {
    let last = (taps - 1) * inputs * outputs;
    for (panel, packed) in packed.chunks_exact_mut(POINTS * outputs * NR).enumerate() {
        for (point, lines) in packed.chunks_exact_mut(outputs * NR).enumerate() {
            for (block, lines) in lines.as_chunks_mut::<NR>().0.chunks_exact_mut(NR).enumerate() {
                // A square of u as W has it, turned while it is in the first-level cache.
                let mut square = [[T::ZERO; NR]; NR];
                for (c, line) in square.iter_mut().enumerate() {
                    let start = last + (panel * NR + c) * outputs + block * NR;
                    let row = Weights { weight, start, tap: -(inputs * outputs).cast_signed() };
                    tile::store::<T, I, NR>(row.combined::<I, NR>(point, taps), line);
                }
                for (o, line) in lines.iter_mut().enumerate() {
                    line.iter_mut().zip(&square).for_each(|(to, row)| *to = row[o]);
                }
            }
        }
    }
}

/// NR neighbouring numbers of a weight, tap by tap.
struct Weights<'a, T> {
    weight: &'a [T],
    /// Of the first tap taken.
    start: usize,
    /// Distance to the next.
    tap: isize,
}

impl<T: Real> Weights<'_, T> {
    /// `Σ_j G[point, j]·W[j]`
    #[inline(always)]
    fn combined<I: Isa, const NR: usize>(&self, point: usize, taps: usize) -> Pair<T, I> {
        let mut sum = [I::Vector::splat(T::ZERO); 2];
        for j in 0..taps {
            let start = self.start.wrapping_add_signed(j.cast_signed() * self.tap);
            if let Some(row) = self.weight[start..].first_chunk::<NR>() {
                add_multiple::<T, I, NR>(&mut sum, SCALE[point] * power(point, j, taps), tile::load::<T, I, NR>(row));
            }
        }
        sum
    }
}

/// Some sequences of the same length with their ends: row s of one of them as a slice, for any s.
pub(super) trait Sequences<T> {
    fn row(&self, sequence: usize, s: usize) -> &[T];
}

/// Where the rows of as many results go: row i of one of them, columns `j…`.
pub(super) trait Sinks<T: Real> {
    fn store_whole<I: Isa, const NR: usize>(&mut self, sequence: usize, i: usize, j: usize, sums: Pair<T, I>);
}

/// How many sequences, and for each how many rows of z, and channels of x.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub sequences: usize,
    pub rows: usize,
    pub inputs: usize,
}

/// Groups of m rows, those of one sequence after those of another.
#[derive(Clone, Copy)]
struct Groups {
    m: usize,
    of_each: usize,
    in_all: usize,
}

impl Groups {
    #[inline(always)]
    const fn new(m: usize, sequences: usize, rows: usize) -> Self {
        let of_each = rows.div_ceil(m);
        Self { m, of_each, in_all: sequences * of_each }
    }

    /// Sequence and first row of a group.
    #[inline(always)]
    const fn place(self, group: usize) -> (usize, usize) {
        (group / self.of_each, group % self.of_each * self.m)
    }
}

/// sinks ← z of each sequence x `[rows + taps − 1, inputs]`, from the packed weight.
#[inline(always)]
pub(super) fn product<T: Real, I: Isa, X: Sequences<T>, S: Sinks<T>, const MR: usize, const NR: usize>(
    taps: usize,
    x: &X,
    extent: Extent,
    packed: &[T],
    sinks: &mut S,
    scratch: &mut [T],
) {
    // The number of rows of a group is a constant of the loops that combine it.
    match taps {
        3 => groups::<T, I, X, S, 4, MR, NR>(x, extent, packed, sinks, scratch),
        _ => groups::<T, I, X, S, 2, MR, NR>(x, extent, packed, sinks, scratch),
    }
}

#[inline(always)]
fn groups<T: Real, I: Isa, X: Sequences<T>, S: Sinks<T>, const M: usize, const MR: usize, const NR: usize>(
    x: &X,
    Extent { sequences, rows, inputs }: Extent,
    packed: &[T],
    sinks: &mut S,
    scratch: &mut [T],
) {
    const { assert!(GROUPS.is_multiple_of(MR), "a block of groups ends inside a tile") };
    let (v, products) = scratch.split_at_mut(POINTS * apart(GROUPS * inputs));
    let products = &mut products[..POINTS * apart(GROUPS * NR)];
    let groups = Groups::new(M, sequences, rows);
    for start in (0..groups.in_all).step_by(GROUPS) {
        let count = (groups.in_all - start).min(GROUPS);
        transform::<T, I, X, NR>(x, (groups, start), (count, apart(GROUPS * inputs)), inputs, v);
        for (panel, j) in packed.chunks_exact(POINTS * inputs * NR).zip((0..).step_by(NR)) {
            let points = v.chunks_exact(apart(GROUPS * inputs)).zip(panel.chunks_exact(inputs * NR));
            let points = points.zip(products.chunks_exact_mut(apart(GROUPS * NR)));
            for ((v, u), product) in points {
                let mut sink = Store { c: RowsMut::packed(product, count, NR), bias: None, write: Write::Set };
                tile::rows::<T, I, _, _, MR, NR>(&Rows::packed(v, count, inputs), NR, u, &mut sink);
            }
            for group in 0..count {
                let mut z = [[I::Vector::splat(T::ZERO); 2]; M];
                for point in 0..POINTS {
                    let Some(product) = products[point * apart(GROUPS * NR) + group * NR..].first_chunk::<NR>() else { return };
                    let product = tile::load::<T, I, NR>(product);
                    for (i, z) in z.iter_mut().enumerate() {
                        add_multiple::<T, I, NR>(z, power(point, i, M), product);
                    }
                }
                let (sequence, first) = groups.place(start + group);
                for (i, z) in z.into_iter().enumerate() {
                    if first + i < rows {
                        sinks.store_whole::<I, NR>(sequence, first + i, j, z);
                    }
                }
            }
        }
    }
}

/// sum += factor·x, and nothing for 0.
#[inline(always)]
fn add_multiple<T: Real, I: Isa, const NR: usize>(sum: &mut Pair<T, I>, factor: f64, x: Pair<T, I>) {
    if factor != 0.0 {
        tile::accumulate::<T, I, NR>(sum, T::of(factor), x);
    }
}

/// v of `count` groups from group `first` on, `[τ][groups][inputs]` with points `distance` apart.
#[inline(always)]
fn transform<T: Real, I: Isa, X: Sequences<T>, const NR: usize>(
    x: &X,
    (groups, first): (Groups, usize),
    (count, distance): (usize, usize),
    inputs: usize,
    v: &mut [T],
) {
    for group in 0..count {
        let (sequence, start) = groups.place(first + group);
        let mut rows: [&[T]; POINTS] = [&[]; POINTS];
        for (k, row) in rows.iter_mut().enumerate() {
            *row = &x.row(sequence, start + k)[..inputs];
        }
        for c in (0..inputs).step_by(NR) {
            let mut x = [[I::Vector::splat(T::ZERO); 2]; POINTS];
            for (x, row) in x.iter_mut().zip(rows) {
                let Some(row) = row[c..].first_chunk::<NR>() else { return };
                *x = tile::load::<T, I, NR>(row);
            }
            for (point, factors) in INPUT.iter().enumerate() {
                let mut sum = [I::Vector::splat(T::ZERO); 2];
                for (factor, x) in factors.iter().zip(x) {
                    add_multiple::<T, I, NR>(&mut sum, *factor, x);
                }
                let Some(to) = v[point * distance + group * inputs + c..].first_chunk_mut::<NR>() else { return };
                tile::store::<T, I, NR>(sum, to);
            }
        }
    }
}

/// dW {=, +=} the gradient of the weight `[taps, in, out]` from sequences x `[rows + taps − 1, inputs]` and dz `[rows, outputs]` of each, at least one.
#[inline(always)]
pub(super) fn weight_gradient<T: Real, I: Isa, X: Sequences<T>, const MR: usize, const NR: usize>(
    taps: usize,
    x: &X,
    inputs: usize,
    dzs: &[Rows<'_, T>],
    (dweight, write): (&mut [T], Write),
    scratch: &mut [T],
) {
    match taps {
        3 => gradient_groups::<T, I, X, 4, MR, NR>(x, inputs, dzs, (dweight, write), scratch),
        _ => gradient_groups::<T, I, X, 2, MR, NR>(x, inputs, dzs, (dweight, write), scratch),
    }
}

#[inline(always)]
fn gradient_groups<T: Real, I: Isa, X: Sequences<T>, const M: usize, const MR: usize, const NR: usize>(
    x: &X,
    inputs: usize,
    dzs: &[Rows<'_, T>],
    (dweight, write): (&mut [T], Write),
    scratch: &mut [T],
) {
    let outputs = dzs[0].cols();
    let (v, rest) = scratch.split_at_mut(POINTS * apart(WEIGHT_GROUPS * inputs));
    let (d_products, rest) = rest.split_at_mut(POINTS * apart(WEIGHT_GROUPS * outputs));
    let du = &mut rest[..POINTS * apart(inputs * outputs)];
    let groups = Groups::new(M, dzs.len(), dzs[0].rows());
    for start in (0..groups.in_all).step_by(WEIGHT_GROUPS) {
        let count = (groups.in_all - start).min(WEIGHT_GROUPS);
        let write = if start == 0 { Write::Set } else { Write::Add };
        transform::<T, I, X, NR>(x, (groups, start), (count, apart(WEIGHT_GROUPS * inputs)), inputs, v);
        spread::<T, I, M, NR>(dzs, (groups, start, count), d_products);
        let points = v.chunks_exact(apart(WEIGHT_GROUPS * inputs)).zip(d_products.chunks_exact(apart(WEIGHT_GROUPS * outputs)));
        for ((v, d_products), du) in points.zip(du.chunks_exact_mut(apart(inputs * outputs))) {
            let v = Rows::packed(v, count, inputs);
            let mut sink = Store { c: RowsMut::packed(du, inputs, outputs), bias: None, write };
            for (panel, j) in d_products.chunks_exact(WEIGHT_GROUPS * NR).zip((0..).step_by(NR)) {
                let panel = &panel.as_chunks::<NR>().0[..count];
                // Channels are a multiple of 8 and not of 12.
                if MR == 12 {
                    tile::columns::<T, I, _, 8, NR>((|p| v.row(p), inputs), panel, (j, NR), &mut sink);
                } else {
                    tile::columns::<T, I, _, MR, NR>((|p| v.row(p), inputs), panel, (j, NR), &mut sink);
                }
            }
        }
    }
    // dW[j] = Σ_τ G[τ, j]·du[τ]
    let (taps, size) = (POINTS + 1 - M, inputs * outputs);
    for at in (0..size).step_by(NR) {
        let mut sums = [[I::Vector::splat(T::ZERO); 2]; POINTS];
        for point in 0..POINTS {
            let Some(du) = du[point * apart(size) + at..].first_chunk::<NR>() else { return };
            let du = tile::load::<T, I, NR>(du);
            for (j, sum) in sums.iter_mut().enumerate().take(taps) {
                add_multiple::<T, I, NR>(sum, SCALE[point] * power(point, j, taps), du);
            }
        }
        for (j, sum) in sums.into_iter().enumerate().take(taps) {
            let Some(dw) = dweight[j * size + at..].first_chunk_mut::<NR>() else { return };
            let sum = if write == Write::Add { tile::plus::<T, I, NR>(sum, dw) } else { sum };
            tile::store::<T, I, NR>(sum, dw);
        }
    }
}

/// Gradients of the products of `count` groups from dz, from group `start` on, as panels `[τ][out/NR][WEIGHT_GROUPS][NR]`.
#[inline(always)]
fn spread<T: Real, I: Isa, const M: usize, const NR: usize>(
    dzs: &[Rows<'_, T>],
    (groups, start, count): (Groups, usize, usize),
    d_products: &mut [T],
) {
    let outputs = dzs[0].cols();
    for group in 0..count {
        let (sequence, first) = groups.place(start + group);
        let dz = &dzs[sequence];
        for (panel, j) in (0..outputs).step_by(NR).enumerate() {
            let mut z = [[I::Vector::splat(T::ZERO); 2]; M];
            for (i, z) in z.iter_mut().enumerate() {
                if first + i < dz.rows()
                    && let Some(row) = dz.row(first + i)[j..].first_chunk::<NR>()
                {
                    *z = tile::load::<T, I, NR>(row);
                }
            }
            for point in 0..POINTS {
                let mut sum = [I::Vector::splat(T::ZERO); 2];
                for (i, z) in z.iter().enumerate() {
                    add_multiple::<T, I, NR>(&mut sum, power(point, i, M), *z);
                }
                let at = point * apart(WEIGHT_GROUPS * outputs) + (panel * WEIGHT_GROUPS + group) * NR;
                let Some(to) = d_products[at..].first_chunk_mut::<NR>() else { return };
                tile::store::<T, I, NR>(sum, to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_matrices_belong_together() {
        for taps in 2..6 {
            let m = POINTS + 1 - taps;
            for (i, j, k) in (0..m).flat_map(|i| (0..taps).flat_map(move |j| (0..POINTS).map(move |k| (i, j, k)))) {
                let factor = |point: usize| power(point, i, m) * SCALE[point] * power(point, j, taps) * INPUT[point][k];
                let found: f64 = (0..POINTS).map(factor).sum();
                assert!(
                    (found - f64::from(u8::from(i + j == k))).abs() < 1e-14,
                    "{taps} taps: output {i}, tap {j}, input {k}: {found}"
                );
            }
        }
    }
}
