//! Gradients of attention: p = 2^(s − ℓ) and the dropout mask m are made again, block by block (Dao 2023, FlashAttention-2).
//!
//! ```text
//! D = rowsum(do∘o),  dp = m∘(do·vᵀ)/(1 − rate),  ds = p∘(dp − D)
//! dq = ds·k/√d_k,  dk = dsᵀ·q/√d_k,  dv = (m∘p/(1 − rate))ᵀ·do           (ds is the gradient of q·kᵀ/√d_k)
//! ```
//!
//! As in the forward pass a lane is a query; dk and dv sum over lanes.

use super::{BLOCK, Inputs, Shape, add_transposed, lanes, scores, take, turn};
use crate::dropout::{Keep, Mask, MaskLanes};
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, Pair, Store, load, store};
use crate::vector::Vector;
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
        let columns = tile::panel_width::<NR>(size);
        let wide = size.next_multiple_of(columns);
        let Gradients { mut dq, mut dk, mut dv, write_q, write_k, write_v } = self.gradients;
        let mut scratch = self.scratch;
        let [query_lanes, output_lanes, query_sums] = [(); 3].map(|()| take(&mut scratch, size * NR).as_chunks_mut::<NR>().0);
        let [p, ds] = [(); 2].map(|()| take(&mut scratch, BLOCK * NR).as_chunks_mut::<NR>().0);
        let [query_panels, output_panels] = [(); 2].map(|()| take(&mut scratch, NR * wide));
        let [key_sums, value_sums] = [(); 2].map(|()| take(&mut scratch, keys * wide));
        let [turned_keys, turned_values] = [(); 2].map(|()| take(&mut scratch, size * keys));
        let (scale, keep_scale) = (self.shape.scale::<T>(), T::of(self.dropout.map_or(1.0, Mask::scale)));
        for h in 0..heads {
            let [q, k, v, o, d_o] = [self.q, self.k, self.v, self.o, self.d_o].map(|x| x.columns(h * size, size));
            turn(k, T::ONE, turned_keys, keys);
            turn(v, T::ONE, turned_values, keys);
            key_sums.fill(T::ZERO);
            value_sums.fill(T::ZERO);
            for first in (0..queries).step_by(NR) {
                let end = queries.min(first + NR);
                let [q, o, d_o] = [q, o, d_o].map(|x| x.range(first, end));
                // The dropout scale rides on do and dv, the score scale on q.
                lanes(q, self.shape.score_scale(), query_lanes);
                lanes(d_o, keep_scale, output_lanes);
                panels(q, NR, columns, query_panels);
                panels(d_o, NR, columns, output_panels);
                let [mut log_sum_exp, mut means] = [[T::ZERO; NR]; 2];
                for i in 0..end - first {
                    log_sum_exp[i] = self.log_sum_exp[(first + i) * heads + h];
                    means[i] = o.row(i).iter().zip(d_o.row(i)).map(|(o, d)| *o * *d).sum();
                }
                let mask = self.dropout.map(|mask| MaskLanes::<NR>::new(mask, h * queries + first));
                query_sums.as_flattened_mut().fill(T::ZERO);
                for key in (0..keys).step_by(BLOCK) {
                    let key_end = keys.min(key + BLOCK);
                    let count = key_end - key;
                    scores::<T, I, MR, NR>((turned_keys, keys, key), query_lanes, &mut p[..count]);
                    scores::<T, I, MR, NR>((turned_values, keys, key), output_lanes, &mut ds[..count]);
                    gradient_block::<T, I, NR>(key, mask.as_ref(), (&mut p[..count], &mut ds[..count]), (&log_sum_exp, &means));
                    for (left, panels, sums) in [(&*p, &*output_panels, &mut *value_sums), (&*ds, &*query_panels, &mut *key_sums)] {
                        let c = RowsMut::packed(&mut sums[key * wide..key_end * wide], count, wide);
                        tile::run_for::<T, I, MR, NR>(size, OverLanes { left, panels, c });
                    }
                    add_transposed::<T, I, MR, NR>(k.range(key, key_end), &ds[..count], query_sums);
                }
                // The panels are packed anew for the next queries.
                let turned = &mut query_panels[..NR * size];
                turn(Rows::packed(query_sums.as_flattened(), size, NR), T::ONE, turned, size);
                emit(turned, size, scale, dq.reborrow().columns(h * size, size).range(first, end), write_q);
            }
            emit(key_sums, wide, scale, dk.reborrow().columns(h * size, size), write_k);
            emit(value_sums, wide, keep_scale, dv.reborrow().columns(h * size, size), write_v);
        }
    }
}

/// c += left·right for the first rows of a block, as many as c has, and a right operand `[L, ≤ width of c]` in panels.
struct OverLanes<'a, T, const L: usize> {
    left: &'a [[T; L]],
    panels: &'a [T],
    c: RowsMut<'a, T>,
}

impl<T: Real, const L: usize> Tiled<T> for OverLanes<'_, T, L> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let mut sink = Store { c: self.c, bias: None, write: Write::Add };
        for (panel, j) in self.panels.as_chunks::<NR>().0.chunks_exact(L).zip((0..).step_by(NR)) {
            tile::array_rows::<T, I, L, MR, NR>(self.left, panel, j, &mut sink);
        }
    }
}

/// Packs rows `[≤ depth, size]` as a right operand of that depth in panels of `columns`; missing rows and columns are zero.
#[inline(always)]
fn panels<T: Real>(x: Rows<'_, T>, depth: usize, columns: usize, panels: &mut [T]) {
    panels.fill(T::ZERO);
    for (panel, j) in panels.chunks_exact_mut(depth * columns).zip((0..).step_by(columns)) {
        for (i, line) in panel.chunks_exact_mut(columns).enumerate().take(x.rows()) {
            line.iter_mut().zip(&x.row(i)[j..]).for_each(|(y, x)| *y = *x);
        }
    }
}

/// Over a block `[keys, NR]` from key `first_key`, which is even: scores become m∘p, and the gradients of m∘p become those of the scores,
/// p∘(m∘dp − D).
#[inline(always)]
fn gradient_block<T: Real, I: Isa, const NR: usize>(
    first_key: usize,
    mask: Option<&MaskLanes<NR>>,
    (scores, gradients): (&mut [[T; NR]], &mut [[T; NR]]),
    (log_sum_exp, means): (&[T; NR], &[T; NR]),
) {
    let known = (load::<T, I, NR>(log_sum_exp), load::<T, I, NR>(means));
    // Loops, not closures: what is not inlined would be compiled without the level's instructions.
    if let Some(mask) = mask {
        for ((scores, gradients), key) in scores.chunks_mut(2).zip(gradients.chunks_mut(2)).zip((first_key..).step_by(2)) {
            let keeps = mask.pair(key);
            for ((scores, gradients), keep) in scores.iter_mut().zip(gradients).zip(&keeps) {
                gradient_row::<T, I, NR>(scores, gradients, known, Some(keep));
            }
        }
    } else {
        for (scores, gradients) in scores.iter_mut().zip(gradients) {
            gradient_row::<T, I, NR>(scores, gradients, known, None);
        }
    }
}

/// One key of [`gradient_block`].
#[inline(always)]
fn gradient_row<T: Real, I: Isa, const NR: usize>(
    scores: &mut [T; NR],
    gradients: &mut [T; NR],
    (log_sum_exp, means): (Pair<T, I>, Pair<T, I>),
    keep: Option<&Keep<NR>>,
) {
    let (mut p, mut ds) = (load::<T, I, NR>(scores), load::<T, I, NR>(gradients));
    if let Some(keep) = keep {
        ds = keep.of::<T, I>(ds);
    }
    for i in 0..2 {
        p[i] = p[i].sub(log_sum_exp[i]).power_of_two();
        ds[i] = p[i].mul(ds[i].sub(means[i]));
    }
    store::<T, I, NR>(ds, gradients);
    if let Some(keep) = keep {
        p = keep.of::<T, I>(p);
    }
    store::<T, I, NR>(p, scores);
}

/// Stores padded sums times `factor`.
#[inline(always)]
fn emit<T: Real>(sums: &[T], wide: usize, factor: T, mut y: RowsMut<'_, T>, write: Write) {
    for (i, sums) in sums.chunks_exact(wide).enumerate().take(y.rows()) {
        let pairs = y.row_mut(i).iter_mut().zip(sums);
        match write {
            Write::Set => pairs.for_each(|(y, x)| *y = factor * *x),
            Write::Add => pairs.for_each(|(y, x)| *y += factor * *x),
        }
    }
}
