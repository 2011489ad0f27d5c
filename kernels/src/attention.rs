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
//! Scores lie as `[keys, queries]`: what is done to a score is done to a register of queries.
//!
//! Mask element of head h, query i, key j: row h·queries + i, column j.

use crate::dropout::{Keep, Mask, MaskLanes};
use crate::elementary::power_of_two;
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, Store};
use crate::{Real, Rows, RowsMut, Write};

mod backward;

pub(crate) use backward::Backward;
pub use backward::{Gradients, backward};

/// Queries of a block: one lane each. A multiple of every level's tile in both directions.
const QUERIES: usize = 96;

/// Where o may be cut for [`forward_rows`]: at multiples of this many queries, every query is in the same block as uncut.
pub const CUT: usize = QUERIES;

/// Keys of a block: on x86-64 a multiple of every tile's rows. A block of scores, at most 96 x 72 numbers, stays in the first-level cache.
const KEYS: usize = 72;

/// Queries a block really has at a level whose tile is `NR` wide: short blocks waste less of a history of 1000.
const fn block_of_queries<const NR: usize>() -> usize {
    if NR > 16 { QUERIES } else { QUERIES / 2 }
}

/// Scratch, in numbers, that [`forward`] and [`backward()`] need.
pub fn scratch_len(heads: usize, queries: usize, keys: usize, head_size: usize) -> usize {
    let _ = (heads, queries);
    let wide = head_size.next_multiple_of(tile::WIDEST);
    3 * keys * wide + 2 * head_size * QUERIES + 3 * QUERIES * wide + 2 * KEYS * QUERIES + 3 * QUERIES
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

/// Copies the rows of a head into rows of `width` numbers, filled up with zeros, times `factor`.
#[inline(always)]
fn pad<T: Real>(x: Rows<'_, T>, factor: T, width: usize, padded: &mut [T]) {
    for (i, line) in padded.chunks_exact_mut(width).enumerate() {
        line.fill(T::ZERO);
        if i < x.rows() {
            line.iter_mut().zip(x.row(i)).for_each(|(y, x)| *y = factor * *x);
        }
    }
}

/// Panels of xᵀ for a block of rows, one row a lane, times `factor`; lanes beyond the last row are zero.
#[inline(always)]
fn lanes<T: Real, const NR: usize>(x: Rows<'_, T>, factor: T, panels: &mut [T]) {
    let size = x.cols();
    for (panel, first) in panels.chunks_exact_mut(size * NR).zip((0..).step_by(NR)) {
        for lane in 0..NR {
            let lines = panel.as_chunks_mut::<NR>().0.iter_mut();
            if first + lane < x.rows() {
                lines.zip(x.row(first + lane)).for_each(|(line, x)| line[lane] = factor * *x);
            } else {
                lines.for_each(|line| line[lane] = T::ZERO);
            }
        }
    }
}

/// Packs a block of rows `[≤ block, size]` as a right operand of depth `block` in panels of `columns`, times `factor`; missing rows are zero.
#[inline(always)]
fn panels<T: Real>(x: Rows<'_, T>, factor: T, block: usize, columns: usize, panels: &mut [T]) {
    for (panel, c) in panels.chunks_exact_mut(block * columns).zip((0..).step_by(columns)) {
        pad(x.columns(c, columns.min(x.cols() - c)), factor, columns, panel);
    }
}

/// c {=, +=} rows·panels.
struct Product<'a, T> {
    rows: Rows<'a, T>,
    panels: &'a [T],
    c: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Tiled<T> for Product<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let n = self.c.cols();
        tile::rows::<T, I, _, _, MR, NR>(&self.rows, n, self.panels, &mut Store { c: self.c, bias: None, write: self.write });
    }
}

/// c += sᵀ·b for a block s `[keys, queries]`, with b `[all keys, width]` in panels, from line `key` on.
struct TransposedProduct<'a, T> {
    s: Rows<'a, T>,
    panels: &'a [T],
    keys: usize,
    key: usize,
    c: RowsMut<'a, T>,
}

impl<T: Real> Tiled<T> for TransposedProduct<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let s = self.s;
        let mut sink = Store { c: self.c, bias: None, write: Write::Add };
        for (panel, j) in self.panels.chunks_exact(self.keys * NR).zip((0..).step_by(NR)) {
            let panel = &panel.as_chunks::<NR>().0[self.key..self.key + s.rows()];
            tile::columns::<T, I, _, MR, NR>((|p| s.row(p), s.cols()), panel, (j, NR), &mut sink);
        }
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
        let (most, columns) = (block_of_queries::<NR>(), tile::panel_width::<NR>(size));
        let wide = size.next_multiple_of(columns);
        let mut scratch = self.scratch;
        let values = take(&mut scratch, keys * wide);
        let query_lanes = take(&mut scratch, size * most);
        let sums = take(&mut scratch, most * wide);
        let scores = take(&mut scratch, KEYS * most);
        let [largest, total, factor] = [(); 3].map(|()| take(&mut scratch, most));
        let keep_scale = T::of(self.dropout.map_or(1.0, Mask::scale));
        let stop = self.first + self.o.rows();
        for h in 0..heads {
            let (q, k) = (self.q.columns(h * size, size), self.k.columns(h * size, size));
            panels(self.v.columns(h * size, size), T::ONE, keys, columns, values);
            for first in (self.first..stop).step_by(most) {
                let end = stop.min(first + most);
                let block = (end - first).next_multiple_of(NR);
                let query_lanes = &mut query_lanes[..size * block];
                lanes::<T, NR>(q.range(first, end), self.shape.score_scale(), query_lanes);
                let mask = self.dropout.map(|mask| MaskLanes::<QUERIES>::new(mask, h * queries + first));
                let [largest, total, factor] = [&mut largest[..block], &mut total[..block], &mut factor[..block]];
                largest.fill(T::NEG_INFINITY);
                total.fill(T::ZERO);
                sums.fill(T::ZERO);
                for key in (0..keys).step_by(KEYS) {
                    let key_end = keys.min(key + KEYS);
                    let scores = &mut scores[..(key_end - key) * block];
                    let rows = k.range(key, key_end);
                    let c = RowsMut::packed(scores, key_end - key, block);
                    Product { rows, panels: query_lanes, c, write: Write::Set }.run::<I, MR, NR>();
                    softmax_block::<T, I, NR>(block, key, mask.as_ref(), scores, largest, total, factor);
                    for (row, factor) in sums.chunks_exact_mut(wide).zip(factor.iter()) {
                        row.iter_mut().for_each(|x| *x *= *factor);
                    }
                    let s = Rows::packed(scores, key_end - key, block);
                    let c = RowsMut::packed(sums, block, wide);
                    tile::run_for::<T, I, MR, NR>(size, TransposedProduct { s, panels: values, keys, key, c });
                }
                for (lane, i) in (first - self.first..end - self.first).enumerate() {
                    let target = &mut self.o.row_mut(i)[h * size..][..size];
                    let normalise = keep_scale / total[lane];
                    target.iter_mut().zip(&sums[lane * wide..]).for_each(|(o, x)| *o = *x * normalise);
                    self.log_sum_exp[i * heads + h] = largest[lane] + total[lane].ln() * T::LOG2_E;
                }
            }
        }
    }
}

/// One step of the online softmax over a block of scores `[keys, queries]`, from key `first_key`, which is even. Scores become
/// m∘2^(s − largest) with the new largest score of each query and the dropout mask m; `total`, of 2^(s − largest), and what else was
/// summed so far is to be multiplied with `factor` = 2^(old − new).
#[inline(always)]
fn softmax_block<T: Real, I: Isa, const NR: usize>(
    block: usize,
    first_key: usize,
    mask: Option<&MaskLanes<QUERIES>>,
    scores: &mut [T],
    largest: &mut [T],
    total: &mut [T],
    factor: &mut [T],
) {
    let chunks = largest.as_chunks_mut::<NR>().0.iter_mut().zip(total.as_chunks_mut::<NR>().0).zip(factor.as_chunks_mut::<NR>().0);
    for (chunk, ((largest, total), factor)) in chunks.enumerate() {
        let m = largest_of_block(block, chunk, scores, *largest);
        for ((factor, old), new) in factor.iter_mut().zip(*largest).zip(m) {
            *factor = power_of_two::<T, I>(old - new);
        }
        let mut sum = [T::ZERO; NR];
        for (rows, key) in scores.chunks_mut(2 * block).zip((first_key..).step_by(2)) {
            let keeps = mask.map(|mask| mask.chunk::<NR>(chunk).pair(key));
            let (first, second) = pair_of_rows::<T, NR>(rows, block, chunk);
            *first = softmax_row::<T, I, NR>(*first, &m, &mut sum, keeps.as_ref().map(|keeps| &keeps[0]));
            if let Some(second) = second {
                *second = softmax_row::<T, I, NR>(*second, &m, &mut sum, keeps.as_ref().map(|keeps| &keeps[1]));
            }
        }
        for ((total, factor), sum) in total.iter_mut().zip(factor).zip(sum) {
            *total = *total * *factor + sum;
        }
        *largest = m;
    }
}

/// Chunk `chunk` of the first row of a block, and of the second if there is one.
#[inline(always)]
fn pair_of_rows<T, const NR: usize>(rows: &mut [T], block: usize, chunk: usize) -> (&mut [T; NR], Option<&mut [T; NR]>) {
    let (first, second) = rows.split_at_mut(block);
    (&mut first.as_chunks_mut::<NR>().0[chunk], second.as_chunks_mut::<NR>().0.get_mut(chunk))
}

/// One key of [`softmax_block`]. By value: nothing else can point to these numbers, which stay in registers.
#[inline(always)]
fn softmax_row<T: Real, I: Isa, const NR: usize>(s: [T; NR], m: &[T; NR], sum: &mut [T; NR], keep: Option<&Keep<NR>>) -> [T; NR] {
    let mut p = s;
    for (p, m) in p.iter_mut().zip(m) {
        *p = power_of_two::<T, I>(*p - *m);
    }
    for (sum, p) in sum.iter_mut().zip(&p) {
        *sum += *p;
    }
    if let Some(keep) = keep { keep.of(p) } else { p }
}

/// The largest score of each query of a chunk, `so_far` included. Odd and even keys apart: a maximum takes several cycles, and in one
/// chain each would wait for the last.
#[inline(always)]
fn largest_of_block<T: Real, const NR: usize>(block: usize, chunk: usize, scores: &[T], so_far: [T; NR]) -> [T; NR] {
    let (mut even, mut odd) = (so_far, so_far);
    for rows in scores.chunks(2 * block) {
        let (first, second) = rows.split_at(block);
        larger(&mut even, &first.as_chunks::<NR>().0[chunk]);
        if let Some(second) = second.as_chunks::<NR>().0.get(chunk) {
            larger(&mut odd, second);
        }
    }
    larger(&mut even, &odd);
    even
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
