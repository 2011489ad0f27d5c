//! Multi-head attention that never stores a score map (paper eqs. 21–23 without the projections).
//!
//! ```text
//! s = log₂e·q·kᵀ/√d_k,  ℓ = log₂ Σ 2ˢ a row,  p = 2^(s − ℓ),  o = (m∘p/(1 − rate))·v       for each head
//! ```
//!
//! that is softmax(q·kᵀ/√d_k), in powers of 2 because they are cheaper than those of e. q, o `[queries, heads·d_k]`; k, v
//! `[keys, heads·d_k]`; head h is columns h·d_k … (h+1)·d_k. The forward pass goes over blocks of keys with an online softmax and keeps
//! only ℓ, `[queries, heads]`, for the gradients, which are in `backward`.
//!
//! Scores lie as `[keys, queries]`, a tile's width of queries at a time: what is done to a score is done to a register of queries, and the sum over
//! keys, too, has a query in each lane.
//!
//! Mask element of head h, query i, key j: row h·queries + i, column j.

use crate::dropout::{Keep, Mask, MaskLanes};
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, Pair, Store, load, store};
use crate::vector::Vector;
use crate::{Real, Rows, RowsMut, Write};

mod backward;

pub(crate) use backward::Backward;
pub use backward::{Gradients, backward};

/// Where o may be cut for [`forward_rows`]: at multiples of this many queries, every query has the same neighbours as uncut.
pub const CUT: usize = tile::WIDEST;

/// Keys of a block of scores; even, and a multiple of every level's tile rows. A block has one tile's width of lanes: at most 9 KiB in f32, so
/// that two of them stay in the first-level cache.
const BLOCK: usize = 72;

/// Scratch, in numbers, that [`forward`] and [`backward()`] need.
pub fn scratch_len(heads: usize, queries: usize, keys: usize, head_size: usize) -> usize {
    let _ = (heads, queries);
    let wide = head_size.next_multiple_of(tile::WIDEST);
    tile::WIDEST * (2 * BLOCK + 3 * head_size + 2 * wide) + 2 * keys * (wide + head_size)
}

/// What attention is computed from, and how.
#[derive(Clone, Copy)]
pub struct Inputs<'a, T> {
    /// Heads, which divide the width.
    pub heads: usize,
    /// Queries, `[queries, heads·d_k]`.
    pub q: Rows<'a, T>,
    /// Keys, `[keys, heads·d_k]`.
    pub k: Rows<'a, T>,
    /// Values, `[keys, heads·d_k]`.
    pub v: Rows<'a, T>,
    /// Dropout of the probabilities, of the whole also where only some rows are computed.
    pub dropout: Option<Mask>,
}

/// Shapes of one call.
#[derive(Clone, Copy)]
struct Shape {
    heads: usize,
    queries: usize,
    keys: usize,
    size: usize,
}

impl Shape {
    fn of<T>(heads: usize, q: &Rows<'_, T>, k: &Rows<'_, T>, v: &Rows<'_, T>, o: &Rows<'_, T>, log_sum_exp: &[T]) -> Self {
        assert!(
            heads > 0 && q.cols() > 0 && q.cols().is_multiple_of(heads),
            "attention: {heads} heads do not divide {} columns",
            q.cols()
        );
        assert!(q.cols() == k.cols() && q.cols() == v.cols() && q.cols() == o.cols(), "attention: widths differ");
        assert!(k.rows() == v.rows(), "attention: rows of k and v differ");
        assert!(k.rows() > 0, "attention: softmax over no key");
        assert_eq!(log_sum_exp.len(), o.rows() * heads, "attention: length of the log-sum-exp");
        Self { heads, queries: q.rows(), keys: k.rows(), size: q.cols() / heads }
    }

    /// 1/√d_k
    fn scale<T: Real>(&self) -> T {
        T::of(1.0 / Real::sqrt(self.size as f64))
    }

    /// log₂e/√d_k
    fn score_scale<T: Real>(&self) -> T {
        T::of(core::f64::consts::LOG2_E / Real::sqrt(self.size as f64))
    }
}

/// Takes `len` numbers off the front of the scratch.
#[inline(always)]
fn take<'a, T>(scratch: &mut &'a mut [T], len: usize) -> &'a mut [T] {
    let (taken, rest) = core::mem::take(scratch).split_at_mut(len);
    *scratch = rest;
    taken
}

/// xᵀ `[cols, rows]` times `factor`, in lines that are `width` numbers apart.
#[inline(always)]
fn turn<T: Real>(x: Rows<'_, T>, factor: T, lines: &mut [T], width: usize) {
    /// Rows and columns of a block: what is read and written at once is a few numbers next to each other, not one.
    const SIDE: usize = 4;
    let (rows, cols) = (x.rows() / SIDE * SIDE, x.cols() / SIDE * SIDE);
    for i in (0..rows).step_by(SIDE) {
        let block = [x.row(i), x.row(i + 1), x.row(i + 2), x.row(i + 3)];
        for c in (0..cols).step_by(SIDE) {
            // Else the compiler would write whole columns number by number, with instructions that are slow on every processor.
            core::hint::black_box(());
            for j in c..c + SIDE {
                let line = &mut lines[j * width + i..][..SIDE];
                for k in 0..SIDE {
                    line[k] = factor * block[k][j];
                }
            }
        }
    }
    for i in 0..x.rows() {
        let first = if i < rows { cols } else { 0 };
        for (c, x) in x.row(i).iter().enumerate().skip(first) {
            lines[c * width + i] = factor * *x;
        }
    }
}

/// xᵀ times `factor` for up to NR rows x, one row a lane; lanes beyond the last row are zero.
#[inline(always)]
fn lanes<T: Real, const NR: usize>(x: Rows<'_, T>, factor: T, lines: &mut [[T; NR]]) {
    let lines = lines.as_flattened_mut();
    lines.fill(T::ZERO);
    turn(x, factor, lines, NR);
}

/// block `[rows, NR]` = leftᵀ·lanes for rows `first…` of what was turned into `left` `[size, width]`, and lanes `[size, NR]`.
#[inline(always)]
fn scores<T: Real, I: Isa, const MR: usize, const NR: usize>(
    (left, width, first): (&[T], usize, usize),
    lanes: &[[T; NR]],
    block: &mut [[T; NR]],
) {
    let rows = block.len();
    let mut sink = Store { c: RowsMut::packed(block.as_flattened_mut(), rows, NR), bias: None, write: Write::Set };
    tile::columns::<T, I, _, MR, NR>((|p| &left[p * width + first..][..rows], rows), lanes, (0, NR), &mut sink);
}

/// sums `[size, NR]` += xᵀ·block for x `[rows, size]` and a block `[rows, NR]`.
#[inline(always)]
fn add_transposed<T: Real, I: Isa, const MR: usize, const NR: usize>(x: Rows<'_, T>, block: &[[T; NR]], sums: &mut [[T; NR]]) {
    /// Divides the usual sizes of a head, which a tile of 12 rows does not; and 16 sums in flight are enough.
    const SHORT: usize = 8;
    let size = x.cols();
    let mut sink = Store { c: RowsMut::packed(sums.as_flattened_mut(), size, NR), bias: None, write: Write::Add };
    if MR > SHORT {
        tile::columns::<T, I, _, SHORT, NR>((|p| x.row(p), size), block, (0, NR), &mut sink);
    } else {
        tile::columns::<T, I, _, MR, NR>((|p| x.row(p), size), block, (0, NR), &mut sink);
    }
}

/// o and `log_sum_exp` `[queries, heads]` from q, k, v.
///
/// # Panics
/// If shapes disagree, `heads` does not divide the width, or there is no key.
pub fn forward<T: Real>(isa: InstructionSet, inputs: Inputs<'_, T>, o: RowsMut<'_, T>, log_sum_exp: &mut [T], scratch: &mut [T]) {
    assert_eq!(inputs.q.rows(), o.rows(), "attention: rows of q and o");
    forward_rows(isa, inputs, 0, o, log_sum_exp, scratch);
}

/// Rows `first…` of what [`forward`] gives, as many as o `[≤ queries − first, heads·d_k]` has, with their rows of `log_sum_exp`; q, k, v
/// and the dropout mask are those of the whole.
///
/// # Panics
/// As [`forward`].
pub fn forward_rows<T: Real>(
    isa: InstructionSet,
    inputs: Inputs<'_, T>,
    first: usize,
    o: RowsMut<'_, T>,
    log_sum_exp: &mut [T],
    scratch: &mut [T],
) {
    let Inputs { heads, q, k, v, dropout } = inputs;
    assert!(first + o.rows() <= q.rows(), "attention: rows of o");
    let shape = Shape::of(heads, &q, &k, &v, &o.view(), log_sum_exp);
    T::attention_forward(isa, Forward { shape, q, k, v, dropout, first, o, log_sum_exp, scratch });
}

pub(crate) struct Forward<'a, T> {
    shape: Shape,
    q: Rows<'a, T>,
    k: Rows<'a, T>,
    v: Rows<'a, T>,
    dropout: Option<Mask>,
    first: usize,
    o: RowsMut<'a, T>,
    log_sum_exp: &'a mut [T],
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(mut self) {
        let Shape { heads, queries, keys, size } = self.shape;
        let mut scratch = self.scratch;
        let [query_lanes, sums] = [(); 2].map(|()| take(&mut scratch, size * NR).as_chunks_mut::<NR>().0);
        let block = take(&mut scratch, BLOCK * NR).as_chunks_mut::<NR>().0;
        let (output, turned_keys) = (take(&mut scratch, NR * size), take(&mut scratch, size * keys));
        let keep_scale = T::of(self.dropout.map_or(1.0, Mask::scale));
        let stop = self.first + self.o.rows();
        for h in 0..heads {
            let [q, k, v] = [self.q, self.k, self.v].map(|x| x.columns(h * size, size));
            turn(k, T::ONE, turned_keys, keys);
            for first in (self.first..stop).step_by(NR) {
                let end = stop.min(first + NR);
                lanes(q.range(first, end), self.shape.score_scale(), query_lanes);
                let mask = self.dropout.map(|mask| MaskLanes::<NR>::new(mask, h * queries + first));
                let (mut largest, mut total) = ([T::NEG_INFINITY; NR], [T::ZERO; NR]);
                sums.as_flattened_mut().fill(T::ZERO);
                for key in (0..keys).step_by(BLOCK) {
                    let key_end = keys.min(key + BLOCK);
                    let block = &mut block[..key_end - key];
                    scores::<T, I, MR, NR>((turned_keys, keys, key), query_lanes, block);
                    let factor = softmax_block::<T, I, NR>(key, mask.as_ref(), block, &mut largest, &mut total);
                    for sums in sums.iter_mut() {
                        let [a, b] = load::<T, I, NR>(sums);
                        store::<T, I, NR>([a.mul(factor[0]), b.mul(factor[1])], sums);
                    }
                    add_transposed::<T, I, MR, NR>(v.range(key, key_end), block, sums);
                }
                turn(Rows::packed(sums.as_flattened(), size, NR), T::ONE, output, size);
                for (lane, i) in (first - self.first..end - self.first).enumerate() {
                    let normalise = keep_scale / total[lane];
                    let target = &mut self.o.row_mut(i)[h * size..][..size];
                    target.iter_mut().zip(&output[lane * size..]).for_each(|(o, sum)| *o = *sum * normalise);
                    self.log_sum_exp[i * heads + h] = largest[lane] + total[lane].ln() * T::LOG2_E;
                }
            }
        }
    }
}

/// One step of the online softmax over a block of scores `[keys, NR]`, from key `first_key`, which is even. Scores become
/// m∘2^(s − largest) with the new largest score of each query and the dropout mask m. What was summed so far, `total` of 2^(s − largest)
/// apart, is to be multiplied with what is given back, 2^(old − new).
#[inline(always)]
fn softmax_block<T: Real, I: Isa, const NR: usize>(
    first_key: usize,
    mask: Option<&MaskLanes<NR>>,
    scores: &mut [[T; NR]],
    largest: &mut [T; NR],
    total: &mut [T; NR],
) -> Pair<T, I> {
    let old = load::<T, I, NR>(largest);
    *largest = largest_of_block(scores, *largest);
    let m = load::<T, I, NR>(largest);
    let mut sum = load::<T, I, NR>(&[T::ZERO; NR]);
    // Loops, not closures: what is not inlined would be compiled without the level's instructions.
    if let Some(mask) = mask {
        for (pair, key) in scores.chunks_mut(2).zip((first_key..).step_by(2)) {
            let keeps = mask.pair(key);
            for (scores, keep) in pair.iter_mut().zip(&keeps) {
                softmax_row::<T, I, NR>(scores, m, &mut sum, Some(keep));
            }
        }
    } else {
        for scores in scores {
            softmax_row::<T, I, NR>(scores, m, &mut sum, None);
        }
    }
    let so_far = load::<T, I, NR>(total);
    let mut factor = old;
    for i in 0..2 {
        factor[i] = old[i].sub(m[i]).power_of_two();
        sum[i] = so_far[i].mul_add(factor[i], sum[i]);
    }
    store::<T, I, NR>(sum, total);
    factor
}

/// One key of [`softmax_block`].
#[inline(always)]
fn softmax_row<T: Real, I: Isa, const NR: usize>(
    scores: &mut [T; NR],
    m: Pair<T, I>,
    sum: &mut Pair<T, I>,
    keep: Option<&Keep<NR>>,
) {
    let mut p = load::<T, I, NR>(scores);
    for i in 0..2 {
        p[i] = p[i].sub(m[i]).power_of_two();
        sum[i] = sum[i].add(p[i]);
    }
    if let Some(keep) = keep {
        p = keep.of::<T, I>(p);
    }
    store::<T, I, NR>(p, scores);
}

/// The largest score of each query, `so_far` included. Every fourth key together: a maximum takes four cycles, and in one chain each would
/// wait for the last.
#[inline(always)]
fn largest_of_block<T: Real, const NR: usize>(scores: &[[T; NR]], so_far: [T; NR]) -> [T; NR] {
    let mut largest = [so_far; 4];
    let (fours, rest) = scores.as_chunks::<4>();
    for four in fours {
        for i in 0..4 {
            larger(&mut largest[i], &four[i]);
        }
    }
    for row in rest {
        larger(&mut largest[0], row);
    }
    let [mut a, b, mut c, d] = largest;
    larger(&mut a, &b);
    larger(&mut c, &d);
    larger(&mut a, &c);
    a
}

/// m = max(m, x), lane by lane.
#[inline(always)]
fn larger<T: Real, const NR: usize>(m: &mut [T; NR], x: &[T; NR]) {
    m.iter_mut().zip(x).for_each(|(m, x)| *m = if *x > *m { *x } else { *m });
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random::Stream;
    use crate::reference;
    use crate::testing::{Matrix, WRITES, assert_near, bits, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>((heads, size): (usize, usize), (queries, keys): (usize, usize), rate: Option<f64>, seed: u64) {
        let width = heads * size;
        let dropout = rate.map(|rate| Mask::new(Stream::new(seed, 0, 0, 0), rate));
        let (q, d_o) = (Matrix::<T>::random(seed, (queries, width)), Matrix::<T>::random(seed + 1, (queries, width)));
        let (k, v) = (Matrix::<T>::random(seed + 2, (keys, width)), Matrix::<T>::random(seed + 3, (keys, width)));
        let query = || Matrix::<T>::poisoned(seed, (queries, width));
        let key = || Matrix::<T>::poisoned(seed + 1, (keys, width));
        let (mut o_expected, mut lse_expected) = (query(), vec![T::NAN; heads * queries]);
        reference::attention(heads, q.view(), k.view(), v.view(), dropout, o_expected.view_mut(), &mut lse_expected);
        let mut expected = (query(), key(), key());
        let views = (expected.0.view_mut(), expected.1.view_mut(), expected.2.view_mut());
        let inputs = Inputs { heads, q: q.view(), k: k.view(), v: v.view(), dropout };
        reference::attention_backward(inputs, d_o.view(), [views.0, views.1, views.2]);
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(heads, queries, keys, size)];
            let (mut o, mut lse) = (query(), vec![T::NAN; heads * queries]);
            forward(isa, inputs, o.view_mut(), &mut lse, &mut scratch);
            o.check_gaps();
            assert_near(&format!("o at {isa}"), &o.to_vec(), &o_expected.to_vec(), Tolerance::Close);
            assert_near(&format!("log-sum-exp at {isa}"), &lse, &lse_expected, Tolerance::Close);
            for write in WRITES {
                let mut found = if write == Write::Set { (query(), key(), key()) } else { expected.clone() };
                let gradients = Gradients {
                    dq: found.0.view_mut(),
                    dk: found.1.view_mut(),
                    dv: found.2.view_mut(),
                    write_q: write,
                    write_k: write,
                    write_v: write,
                };
                backward(isa, inputs, (o.view(), &lse), d_o.view(), gradients, &mut scratch);
                let times = if write == Write::Set { T::ONE } else { T::of(2.0) };
                let pairs = [(&found.0, &expected.0, "dq"), (&found.1, &expected.1, "dk"), (&found.2, &expected.2, "dv")];
                for (found, expected, name) in pairs {
                    found.check_gaps();
                    let expected: Vec<T> = expected.to_vec().iter().map(|x| *x * times).collect();
                    assert_near(&format!("{name} at {isa}, {write:?}"), &found.to_vec(), &expected, Tolerance::Close);
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_the_stored_maps(
            heads in 1_usize..5, size in 1_usize..20, queries in 1_usize..70, keys in 1_usize..140,
            rate in prop_oneof![Just(None), Just(Some(0.2)), Just(Some(0.9))], seed in 0_u64..1000,
        ) {
            check::<f32>((heads, size), (queries, keys), rate, seed);
            check::<f64>((heads, size), (queries, keys), rate, seed);
        }
    }

    #[test]
    fn widths_and_lengths_around_the_blocks() {
        for (size, queries, keys) in
            [(16, 48, 64), (16, 49, 65), (16, 97, 128), (33, 20, 20), (64, 100, 1), (1, 1, 1), (16, 1, 200)]
        {
            check::<f32>((2, size), (queries, keys), Some(0.2), 5);
            check::<f64>((2, size), (queries, keys), None, 5);
        }
    }

    fn check_pieces<T: Real>((heads, size): (usize, usize), (queries, keys): (usize, usize), step: usize) {
        let width = heads * size;
        let q = Matrix::<T>::random(1, (queries, width));
        let (k, v) = (Matrix::<T>::random(2, (keys, width)), Matrix::<T>::random(3, (keys, width)));
        for dropout in [None, Some(Mask::new(Stream::new(4, 0, 0, 0), 0.2))] {
            let inputs = Inputs { heads, q: q.view(), k: k.view(), v: v.view(), dropout };
            for isa in InstructionSet::available() {
                let mut scratch = vec![T::NAN; scratch_len(heads, queries, keys, size)];
                let found = |step: usize, scratch: &mut [T]| {
                    let (mut o, mut lse) = (Matrix::<T>::poisoned(5, (queries, width)), vec![T::NAN; queries * heads]);
                    for (first, lse) in (0..queries).step_by(step).zip(lse.chunks_mut(step * heads)) {
                        let o = o.view_mut().range(first, queries.min(first + step));
                        forward_rows(isa, inputs, first, o, lse, scratch);
                    }
                    o.check_gaps();
                    (bits(&o.to_vec()), bits(&lse))
                };
                let (whole, pieces) = (found(queries, &mut scratch), found(step, &mut scratch));
                assert!(pieces == whole, "{queries} queries in pieces of {step} at {isa}");
            }
        }
    }

    #[test]
    fn pieces_have_the_bits_of_the_whole() {
        for (queries, keys, step) in [(97, 70, CUT), (192, 64, CUT), (250, 33, CUT), (250, 130, 2 * CUT)] {
            check_pieces::<f32>((2, 16), (queries, keys), step);
            check_pieces::<f64>((3, 5), (queries, keys), step);
        }
    }

    fn plain_forward(q: &[f64], k: &[f64], v: &[f64], rows: (usize, usize), width: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut o, mut lse, mut scratch) =
            (vec![0.0; rows.0 * width], vec![0.0; rows.0], vec![0.0; scratch_len(1, rows.0, rows.1, width)]);
        let keys = |x| Rows::packed(x, rows.1, width);
        let o_view = RowsMut::packed(&mut o, rows.0, width);
        let inputs = Inputs { heads: 1, q: Rows::packed(q, rows.0, width), k: keys(k), v: keys(v), dropout: None };
        forward(InstructionSet::PLAIN, inputs, o_view, &mut lse, &mut scratch);
        (o, lse)
    }

    #[test]
    fn the_order_of_keys_does_not_matter() {
        let (queries, keys, width) = (5, 150, 8);
        let (q, k, v) = (numbers::<f64>(1, queries * width), numbers::<f64>(2, keys * width), numbers::<f64>(3, keys * width));
        let turned = |x: &[f64]| -> Vec<f64> { x.chunks(width).rev().flatten().copied().collect() };
        let (o, lse) = plain_forward(&q, &k, &v, (queries, keys), width);
        let (o_turned, lse_turned) = plain_forward(&q, &turned(&k), &turned(&v), (queries, keys), width);
        assert_near("o", &o_turned, &o, Tolerance::Close);
        assert_near("log-sum-exp", &lse_turned, &lse, Tolerance::Close);
    }

    #[test]
    fn large_scores_do_not_overflow() {
        let (keys, width) = (100, 4);
        let q = vec![1e4; width];
        let k: Vec<f64> = (0..keys).flat_map(|j| [j as f64; 4]).collect();
        let v: Vec<f64> = (0..keys).flat_map(|j| [j as f64; 4]).collect();
        let (o, lse) = plain_forward(&q, &k, &v, (1, keys), width);
        assert_near("o is the value of the last key", &o, &[99.0; 4], Tolerance::Close);
        assert_near("ℓ is the last score", &lse, &[99.0 * 4.0 * 1e4 / 2.0 * std::f64::consts::LOG2_E], Tolerance::Close);
    }
}
