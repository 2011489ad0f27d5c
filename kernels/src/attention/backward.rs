//! Gradients of attention: p = 2^(s − ℓ) and the dropout mask m are made again, block by block (Dao 2023, FlashAttention-2).
//!
//! ```text
//! D = rowsum(do∘o),  dp = m∘(do·vᵀ)/(1 − rate),  ds = p∘(dp − D)
//! dq = ds·k/√d_k,  dk = dsᵀ·q/√d_k,  dv = (m∘p/(1 − rate))ᵀ·do           (ds is the gradient of q·kᵀ/√d_k)
//! ```

use super::{Inputs, KEYS, Product, QUERIES, Shape, TransposedProduct, block_of_queries, lanes, pair_of_rows, panels, take};
use crate::dropout::{Keep, Mask, MaskLanes};
use crate::elementary::power_of_two;
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile;
use crate::{Real, Rows, RowsMut, Write};

/// Where [`backward`] puts its three gradients, and whether it overwrites or adds.
#[derive(Debug)]
pub struct Gradients<'a, T> {
    /// Gradient of q, `[queries, heads·d_k]`.
    pub dq: RowsMut<'a, T>,
    /// Gradient of k, `[keys, heads·d_k]`.
    pub dk: RowsMut<'a, T>,
    /// Gradient of v, `[keys, heads·d_k]`.
    pub dv: RowsMut<'a, T>,
    /// Set or add for dq.
    pub write_q: Write,
    /// Set or add for dk.
    pub write_k: Write,
    /// Set or add for dv.
    pub write_v: Write,
}

/// dq, dk, dv {=, +=} from do and what the forward pass took and gave.
///
/// # Panics
/// As [`forward`](super::forward).
pub fn backward<T: Real>(
    isa: InstructionSet,
    inputs: Inputs<'_, T>,
    (o, log_sum_exp): (Rows<'_, T>, &[T]),
    d_o: Rows<'_, T>,
    gradients: Gradients<'_, T>,
    scratch: &mut [T],
) {
    let Inputs { heads, q, k, v, dropout } = inputs;
    let shape = Shape::of(heads, &q, &k, &v, &o, log_sum_exp);
    crate::strided::same_shape(&q, &o);
    crate::strided::same_shape(&o, &d_o);
    crate::strided::same_shape(&q, &gradients.dq.view());
    crate::strided::same_shape(&k, &gradients.dk.view());
    crate::strided::same_shape(&v, &gradients.dv.view());
    T::attention_backward(isa, Backward { shape, q, k, v, dropout, o, log_sum_exp, d_o, gradients, scratch });
}

pub(crate) struct Backward<'a, T> {
    shape: Shape,
    q: Rows<'a, T>,
    k: Rows<'a, T>,
    v: Rows<'a, T>,
    dropout: Option<Mask>,
    o: Rows<'a, T>,
    log_sum_exp: &'a [T],
    d_o: Rows<'a, T>,
    gradients: Gradients<'a, T>,
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Shape { heads, queries, keys, size } = self.shape;
        let (most, columns) = (block_of_queries::<NR>(), tile::panel_width::<NR>(size));
        let wide = size.next_multiple_of(columns);
        let Gradients { mut dq, mut dk, mut dv, write_q, write_k, write_v } = self.gradients;
        let mut scratch = self.scratch;
        let [key_panels, key_sums, value_sums] = [(); 3].map(|()| take(&mut scratch, keys * wide));
        let [query_lanes, output_lanes] = [(); 2].map(|()| take(&mut scratch, size * most));
        let [query_panels, output_panels, query_sums] = [(); 3].map(|()| take(&mut scratch, most * wide));
        let [scores, d_scores] = [(); 2].map(|()| take(&mut scratch, KEYS * most));
        let [log_sum_exp, means] = [(); 2].map(|()| take(&mut scratch, most));
        let (scale, keep_scale) = (self.shape.scale::<T>(), T::of(self.dropout.map_or(1.0, Mask::scale)));
        for h in 0..heads {
            let (q, k, v) = (self.q.columns(h * size, size), self.k.columns(h * size, size), self.v.columns(h * size, size));
            let (o, d_o) = (self.o.columns(h * size, size), self.d_o.columns(h * size, size));
            panels(k, scale, keys, columns, key_panels);
            key_sums.fill(T::ZERO);
            value_sums.fill(T::ZERO);
            for first in (0..queries).step_by(most) {
                let end = queries.min(first + most);
                let block = (end - first).next_multiple_of(NR);
                let (q_block, d_block) = (q.range(first, end), d_o.range(first, end));
                let [query_lanes, output_lanes] = [&mut query_lanes[..size * block], &mut output_lanes[..size * block]];
                let [query_panels, output_panels] = [&mut query_panels[..block * wide], &mut output_panels[..block * wide]];
                let [log_sum_exp, means] = [&mut log_sum_exp[..block], &mut means[..block]];
                // The dropout scale rides on do, the score scale on q and k.
                lanes::<T, NR>(q_block, self.shape.score_scale(), query_lanes);
                lanes::<T, NR>(d_block, keep_scale, output_lanes);
                panels(q_block, scale, block, columns, query_panels);
                panels(d_block, keep_scale, block, columns, output_panels);
                log_sum_exp.fill(T::ZERO);
                let rows = self.log_sum_exp[first * heads..end * heads].chunks_exact(heads);
                log_sum_exp.iter_mut().zip(rows).for_each(|(lane, row)| *lane = row[h]);
                means.fill(T::ZERO);
                for (lane, mean) in means[..end - first].iter_mut().enumerate() {
                    *mean = o.row(first + lane).iter().zip(d_block.row(lane)).map(|(o, d)| *o * *d).sum();
                }
                let mask = self.dropout.map(|mask| MaskLanes::<QUERIES>::new(mask, h * queries + first));
                query_sums.fill(T::ZERO);
                for key in (0..keys).step_by(KEYS) {
                    let (key_end, count) = (keys.min(key + KEYS), KEYS.min(keys - key));
                    let [scores, d_scores] = [&mut scores[..count * block], &mut d_scores[..count * block]];
                    for (rows, panels, scores) in [(k, &*query_lanes, &mut *scores), (v, &*output_lanes, &mut *d_scores)] {
                        let (rows, c) = (rows.range(key, key_end), RowsMut::packed(scores, count, block));
                        Product { rows, panels, c, write: Write::Set }.run::<I, MR, NR>();
                    }
                    gradient_block::<T, I, NR>(block, key, mask.as_ref(), scores, d_scores, log_sum_exp, means);
                    let (s, ds) = (Rows::packed(scores, count, block), Rows::packed(d_scores, count, block));
                    for (rows, panels, sums) in [(s, &*output_panels, &mut *value_sums), (ds, &*query_panels, &mut *key_sums)] {
                        let c = RowsMut::packed(&mut sums[key * wide..key_end * wide], count, wide);
                        tile::run_for::<T, I, MR, NR>(size, Product { rows, panels, c, write: Write::Add });
                    }
                    let c = RowsMut::packed(query_sums, block, wide);
                    tile::run_for::<T, I, MR, NR>(size, TransposedProduct { s: ds, panels: key_panels, keys, key, c });
                }
                emit(query_sums, wide, end - first, dq.reborrow().columns(h * size, size).range(first, end), write_q);
            }
            emit(key_sums, wide, keys, dk.reborrow().columns(h * size, size), write_k);
            emit(value_sums, wide, keys, dv.reborrow().columns(h * size, size), write_v);
        }
    }
}

/// Over a block `[keys, queries]` from key `first_key`, which is even: scores become m∘p, and the gradients of m∘p become those of the
/// scores, p∘(m∘dp − D).
#[inline(always)]
fn gradient_block<T: Real, I: Isa, const NR: usize>(
    block: usize,
    first_key: usize,
    mask: Option<&MaskLanes<QUERIES>>,
    scores: &mut [T],
    d_scores: &mut [T],
    log_sum_exp: &[T],
    means: &[T],
) {
    let lanes = log_sum_exp.as_chunks::<NR>().0.iter().zip(means.as_chunks::<NR>().0);
    for (chunk, (&log_sum_exp, &means)) in lanes.enumerate() {
        let pairs = scores.chunks_mut(2 * block).zip(d_scores.chunks_mut(2 * block));
        for ((rows, d_rows), key) in pairs.zip((first_key..).step_by(2)) {
            let keeps = mask.map(|mask| mask.chunk::<NR>(chunk).pair(key));
            let (first, second) = pair_of_rows::<T, NR>(rows, block, chunk);
            let (d_first, d_second) = pair_of_rows::<T, NR>(d_rows, block, chunk);
            let keep = keeps.as_ref().map(|keeps| &keeps[0]);
            (*first, *d_first) = gradient_row::<T, I, NR>(*first, *d_first, &log_sum_exp, &means, keep);
            if let (Some(second), Some(d_second)) = (second, d_second) {
                let keep = keeps.as_ref().map(|keeps| &keeps[1]);
                (*second, *d_second) = gradient_row::<T, I, NR>(*second, *d_second, &log_sum_exp, &means, keep);
            }
        }
    }
}

/// One key of [`gradient_block`]: m∘p and the gradient of the scores. By value: nothing else can point to these numbers, which stay in
/// registers.
#[inline(always)]
fn gradient_row<T: Real, I: Isa, const NR: usize>(
    s: [T; NR],
    dp: [T; NR],
    log_sum_exp: &[T; NR],
    means: &[T; NR],
    keep: Option<&Keep<NR>>,
) -> ([T; NR], [T; NR]) {
    let (mut p, mut ds) = (s, dp);
    for (p, l) in p.iter_mut().zip(log_sum_exp) {
        *p = power_of_two::<T, I>(*p - *l);
    }
    if let Some(keep) = keep {
        ds = keep.of(ds);
    }
    for ((ds, p), mean) in ds.iter_mut().zip(&p).zip(means) {
        *ds = *p * (*ds - *mean);
    }
    if let Some(keep) = keep {
        p = keep.of(p);
    }
    (p, ds)
}

/// Stores the first `rows` of padded sums.
#[inline(always)]
fn emit<T: Real>(sums: &[T], wide: usize, rows: usize, mut y: RowsMut<'_, T>, write: Write) {
    for (i, sums) in sums.chunks_exact(wide).take(rows).enumerate() {
        let pairs = y.row_mut(i).iter_mut().zip(sums);
        match write {
            Write::Set => pairs.for_each(|(y, x)| *y = *x),
            Write::Add => pairs.for_each(|(y, x)| *y += *x),
        }
    }
}
