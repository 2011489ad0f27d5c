//! ProbSparse attention (Zhou et al. 2021, and their code): full attention for the queries that look at few keys, the mean of the values
//! for all others.
//!
//! ```text
//! M_i = max_s q_i·k_s − 1/L_K·Σ_s q_i·k_s   over U sampled keys s, the same for all heads
//! o_i = softmax(q_i·kᵀ/√d_k)·v   for the u queries of the largest M;   o_i = mean of v for the others
//! ```
//!
//! and masked: keys j ≤ i only, and the sum of v_0 … v_i in the place of the mean. U and u are factor·⌈ln L⌉ of the keys and of the
//! queries, at most all. q, o `[L_Q, d]`; k, v `[L_K, d]`; head h is columns h·d_k … (h + 1)·d_k. Kept for the backward pass: the
//! chosen queries `[heads, u]` and their probabilities `[heads, u, L_K]`. The choice has no gradient.
//!
//! With u = L_Q this is attention.

use crate::elementary::exp;
use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::random::Stream;
use crate::strided::{copy, fill};
use crate::{Real, Rows, RowsMut, Write, gemm};

/// Heads, sampling factor, mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sparse {
    /// Heads; a divisor of d.
    pub heads: usize,
    /// Factor before the logarithm of the length.
    pub factor: usize,
    /// Whether query i sees keys up to i alone.
    pub masked: bool,
}

impl Sparse {
    /// U of the keys, or u of the queries, for so many.
    pub fn chosen(self, length: usize) -> usize {
        (self.factor * Real::ceil(Real::ln(length as f64)) as usize).clamp(1, length.max(1))
    }

    /// Numbers kept for the backward pass.
    pub fn kept_len(self, queries: usize, keys: usize) -> usize {
        self.heads * self.chosen(queries) * (1 + keys)
    }

    /// Scratch, in numbers, of both passes.
    pub fn scratch_len(self, queries: usize, keys: usize, d: usize) -> usize {
        let (chosen, size) = (self.chosen(queries), d / self.heads.max(1));
        let products = gemm::scratch_len(chosen, size, keys)
            .max(gemm::scratch_len(chosen, keys, size))
            .max(gemm::scratch_len(keys, chosen, size));
        // Scores of all queries and heads; gathered rows and their results; gradients of probabilities; a row of sums.
        self.heads * queries + 3 * chosen * size + chosen * keys + d + products
    }
}

/// o, the chosen queries and their probabilities.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    sparse: Sparse,
    stream: Stream,
    [q, k, v]: [Rows<'_, T>; 3],
    mut o: RowsMut<'_, T>,
    kept: &mut [T],
    scratch: &mut [T],
) {
    let (queries, keys, heads) = (q.rows(), k.rows(), sparse.heads);
    let (size, count) = (q.cols() / heads, sparse.chosen(queries));
    assert!(q.cols() == heads * size && k.cols() == q.cols() && v.cols() == q.cols() && v.rows() == keys, "prob_sparse: shapes");
    assert!(!sparse.masked || queries == keys, "prob_sparse: a mask takes as many queries as keys");
    let (scores, scratch) = scratch.split_at_mut(heads * queries);
    T::prob_sparse_scores(isa, Scores { sparse, stream, q, k, scores: &mut *scores });
    T::prob_sparse_rest(isa, Rest { masked: sparse.masked, v, o: o.reborrow() });
    let (chosen, probabilities) = kept.split_at_mut(heads * count);
    let (gathered, scratch) = scratch.split_at_mut(count * size);
    let (result, scratch) = scratch.split_at_mut(count * size);
    for h in 0..heads {
        let chosen = &mut chosen[h * count..][..count];
        largest(&mut scores[h * queries..][..queries], chosen);
        gather(q.columns(h * size, size), chosen, gathered);
        let gathered = Rows::packed(gathered, count, size);
        let mut map = RowsMut::packed(&mut probabilities[h * count * keys..][..count * keys], count, keys);
        gemm::abt(isa, gathered, k.columns(h * size, size), map.reborrow(), Write::Set, scratch);
        let scale = T::of(1.0 / Real::sqrt(size as f64));
        T::prob_sparse_softmax(isa, Softmax { scale, chosen: sparse.masked.then_some(&*chosen), map: map.reborrow() });
        let mut sums = RowsMut::packed(&mut *result, count, size);
        gemm::ab(isa, map.view(), v.columns(h * size, size), sums.reborrow(), Write::Set, scratch);
        for (place, i) in chosen.iter().enumerate() {
            o.row_mut(i.f64() as usize)[h * size..][..size].copy_from_slice(sums.view().row(place));
        }
    }
}

/// M of every head and query, `[heads, L_Q]`.
pub(crate) struct Scores<'a, T> {
    sparse: Sparse,
    stream: Stream,
    q: Rows<'a, T>,
    k: Rows<'a, T>,
    scores: &'a mut [T],
}

/// Lanes of a product along the width of a head.
const LANES: usize = 8;

#[inline(always)]
fn dot<T: Real, I: Isa>(x: &[T], y: &[T]) -> T {
    let mut lanes = [T::ZERO; LANES];
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (x, y) in x.iter().zip(y) {
        for k in 0..LANES {
            lanes[k] = I::mul_add(x[k], y[k], lanes[k]);
        }
    }
    let rest: T = x_rest.iter().zip(y_rest).map(|(x, y)| *x * *y).sum();
    lanes.iter().fold(rest, |sum, lane| sum + *lane)
}

impl<T: Real> Kernel for Scores<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (queries, keys, heads) = (self.q.rows(), self.k.rows(), self.sparse.heads);
        let (size, samples) = (self.q.cols() / heads, self.sparse.chosen(keys));
        let share = T::of(1.0 / keys as f64);
        for i in 0..queries {
            let stream = self.stream.sub(i as u64);
            for h in 0..heads {
                let (mut most, mut sum) = (T::NEG_INFINITY, T::ZERO);
                let q = &self.q.row(i)[h * size..][..size];
                for s in 0..samples {
                    // A uniform word times the number of keys, its upper half: uniform on the keys.
                    let key = (u64::from(stream.word(s as u32)) * keys as u64) >> 32;
                    let product = dot::<T, I>(q, &self.k.row(key as usize)[h * size..][..size]);
                    most = if product > most { product } else { most };
                    sum += product;
                }
                self.scores[h * queries + i] = most - share * sum;
            }
        }
    }
}

/// o = mean of v in every row, or the running sum.
pub(crate) struct Rest<'a, T> {
    masked: bool,
    v: Rows<'a, T>,
    o: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Rest<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        if self.masked {
            for i in 0..self.o.rows() {
                self.o.row_mut(i).copy_from_slice(self.v.row(i));
                if i > 0 {
                    let [before, now] = two_rows(&mut self.o, i);
                    now.iter_mut().zip(before).for_each(|(now, before)| *now += *before);
                }
            }
            return;
        }
        let Some(last) = self.o.rows().checked_sub(1) else { return };
        let share = T::of(1.0 / self.v.rows() as f64);
        self.o.row_mut(0).fill(T::ZERO);
        for j in 0..self.v.rows() {
            for (sum, v) in self.o.row_mut(0).iter_mut().zip(self.v.row(j)) {
                *sum = I::mul_add(share, *v, *sum);
            }
        }
        for i in 1..=last {
            let [before, now] = two_rows(&mut self.o, i);
            now.copy_from_slice(before);
        }
    }
}

/// Rows i − 1 and i.
#[inline(always)]
fn two_rows<'a, T>(x: &'a mut RowsMut<'_, T>, i: usize) -> [&'a mut [T]; 2] {
    let cols = x.cols();
    let stride = x.stride();
    let both = x.reborrow().range(i - 1, i + 1).into_slice();
    let (before, now) = both.split_at_mut(stride);
    [&mut before[..cols], &mut now[..cols]]
}

/// The places of the largest scores; the scores taken are lost.
fn largest<T: Real>(scores: &mut [T], chosen: &mut [T]) {
    for place in chosen {
        let better = |best: usize, i: usize| if scores[i] > scores[best] { i } else { best };
        let best = (0..scores.len()).reduce(better).unwrap_or_default();
        scores[best] = T::NEG_INFINITY;
        *place = T::of(best as f64);
    }
}

/// The chosen rows, packed.
fn gather<T: Real>(x: Rows<'_, T>, chosen: &[T], to: &mut [T]) {
    for (to, i) in to.chunks_exact_mut(x.cols().max(1)).zip(chosen) {
        to.copy_from_slice(x.row(i.f64() as usize));
    }
}

/// Each row of products becomes probabilities; with a mask, row i sees keys up to `chosen[i]`.
pub(crate) struct Softmax<'a, T> {
    scale: T,
    chosen: Option<&'a [T]>,
    map: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Softmax<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.map.rows() {
            let row = self.map.row_mut(i);
            let seen = self.chosen.map_or(row.len(), |chosen| chosen[i].f64() as usize + 1);
            let (row, hidden) = row.split_at_mut(seen);
            hidden.fill(T::ZERO);
            let most = row.iter().fold(T::NEG_INFINITY, |most, x| if *x > most { *x } else { most });
            for x in row.iter_mut() {
                *x = exp::<T, I>((*x - most) * self.scale);
            }
            let inverse = T::ONE / crate::row_reductions::of::<T, I>(row, |x| x);
            row.iter_mut().for_each(|x| *x *= inverse);
        }
    }
}

/// Where the gradients go, and how.
pub struct Gradients<'a, T> {
    /// Gradient of q.
    pub dq: RowsMut<'a, T>,
    /// Gradient of k.
    pub dk: RowsMut<'a, T>,
    /// Gradient of v.
    pub dv: RowsMut<'a, T>,
    /// Set or add, for q, k and v.
    pub writes: [Write; 3],
}

/// dq, dk and dv {=, +=}, from q, k, v, do and what [`forward`] kept.
///
/// # Panics
/// If shapes disagree.
pub fn backward<T: Real>(
    isa: InstructionSet,
    sparse: Sparse,
    [q, k, v]: [Rows<'_, T>; 3],
    d_o: Rows<'_, T>,
    kept: &[T],
    gradients: Gradients<'_, T>,
    scratch: &mut [T],
) {
    let (queries, keys, heads) = (q.rows(), k.rows(), sparse.heads);
    let (size, count) = (q.cols() / heads, sparse.chosen(queries));
    let Gradients { mut dq, mut dk, mut dv, writes } = gradients;
    for (to, write) in [&mut dq, &mut dk, &mut dv].into_iter().zip(writes) {
        if write == Write::Set {
            fill(to.reborrow(), T::ZERO);
        }
    }
    let (chosen, probabilities) = kept.split_at(heads * count);
    let (taken, scratch) = scratch.split_at_mut(heads * queries);
    let (sum, scratch) = scratch.split_at_mut(q.cols());
    taken.fill(T::ONE);
    for (h, chosen) in chosen.chunks_exact(count).enumerate() {
        chosen.iter().for_each(|i| taken[h * queries + i.f64() as usize] = T::ZERO);
    }
    T::prob_sparse_backward_rest(isa, BackwardRest { sparse, others: taken, d_o, sum, dv: dv.reborrow() });
    let (gathered_q, scratch) = scratch.split_at_mut(count * size);
    let (gathered_o, scratch) = scratch.split_at_mut(count * size);
    let (result, scratch) = scratch.split_at_mut(count * size);
    let (dmap, scratch) = scratch.split_at_mut(count * keys);
    let scale = T::of(1.0 / Real::sqrt(size as f64));
    for (h, chosen) in chosen.chunks_exact(count).enumerate() {
        let (start, width) = (h * size, size);
        gather(q.columns(start, width), chosen, gathered_q);
        gather(d_o.columns(start, width), chosen, gathered_o);
        let (q_rows, o_rows) = (Rows::packed(gathered_q, count, size), Rows::packed(gathered_o, count, size));
        let map = Rows::packed(&probabilities[h * count * keys..][..count * keys], count, keys);
        gemm::atb(isa, map, o_rows, dv.reborrow().columns(start, width), Write::Add, scratch);
        let mut dscores = RowsMut::packed(&mut *dmap, count, keys);
        gemm::abt(isa, o_rows, v.columns(start, width), dscores.reborrow(), Write::Set, scratch);
        T::prob_sparse_backward_softmax(isa, BackwardSoftmax { scale, map, dmap: dscores.reborrow() });
        gemm::atb(isa, dscores.view(), q_rows, dk.reborrow().columns(start, width), Write::Add, scratch);
        let mut sums = RowsMut::packed(&mut *result, count, size);
        gemm::ab(isa, dscores.view(), k.columns(start, width), sums.reborrow(), Write::Set, scratch);
        for (place, i) in chosen.iter().enumerate() {
            let i = i.f64() as usize;
            let to = dq.reborrow().columns(start, width).range(i, i + 1);
            copy(isa, sums.view().range(place, place + 1), to, Write::Add);
        }
    }
}

/// dv += what reaches it through the rows that were not chosen.
pub(crate) struct BackwardRest<'a, T> {
    sparse: Sparse,
    /// 1 where query i of head h was not chosen, else 0; `[heads, L_Q]`.
    others: &'a [T],
    d_o: Rows<'a, T>,
    sum: &'a mut [T],
    dv: RowsMut<'a, T>,
}

impl<T: Real> BackwardRest<'_, T> {
    #[inline(always)]
    fn add<I: Isa>(&mut self, i: usize) {
        let (queries, size) = (self.d_o.rows(), self.d_o.cols() / self.sparse.heads);
        for h in 0..self.sparse.heads {
            let other = self.others[h * queries + i];
            let sums = self.sum[h * size..][..size].iter_mut().zip(&self.d_o.row(i)[h * size..]);
            for (sum, d) in sums {
                *sum = I::mul_add(other, *d, *sum);
            }
        }
    }
}

impl<T: Real> Kernel for BackwardRest<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        self.sum.fill(T::ZERO);
        if self.sparse.masked {
            for i in (0..self.d_o.rows()).rev() {
                self.add::<I>(i);
                self.dv.row_mut(i).iter_mut().zip(&*self.sum).for_each(|(dv, sum)| *dv += *sum);
            }
            return;
        }
        for i in 0..self.d_o.rows() {
            self.add::<I>(i);
        }
        let share = T::of(1.0 / self.dv.rows().max(1) as f64);
        for j in 0..self.dv.rows() {
            for (dv, sum) in self.dv.row_mut(j).iter_mut().zip(&*self.sum) {
                *dv = I::mul_add(share, *sum, *dv);
            }
        }
    }
}

/// dS = scale·P∘(dP − Σ P∘dP), row by row, in the place of dP.
pub(crate) struct BackwardSoftmax<'a, T> {
    scale: T,
    map: Rows<'a, T>,
    dmap: RowsMut<'a, T>,
}

impl<T: Real> Kernel for BackwardSoftmax<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.map.rows() {
            let (map, dmap) = (self.map.row(i), self.dmap.row_mut(i));
            let mean = crate::row_reductions::dot::<T, I>(map, dmap);
            dmap.iter_mut().zip(map).for_each(|(d, p)| *d = self.scale * *p * (*d - mean));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(sparse: Sparse, queries: usize, keys: usize, size: usize, seed: u64) {
        let (d, stream) = (sparse.heads * size, Stream::new(seed, 1, 2, 3));
        let (q, d_o) = (Matrix::<T>::random(seed, (queries, d)), Matrix::<T>::random(seed + 1, (queries, d)));
        let (k, v) = (Matrix::<T>::random(seed + 2, (keys, d)), Matrix::<T>::random(seed + 3, (keys, d)));
        for isa in InstructionSet::available() {
            let mut kept = vec![T::NAN; sparse.kept_len(queries, keys)];
            let mut scratch = vec![T::NAN; sparse.scratch_len(queries, keys, d)];
            let mut o = Matrix::<T>::poisoned(seed, (queries, d));
            forward(isa, sparse, stream, [q.view(), k.view(), v.view()], o.view_mut(), &mut kept, &mut scratch);
            o.check_gaps();
            let count = sparse.chosen(queries);
            let chosen: Vec<usize> = kept[..sparse.heads * count].iter().map(|i| i.f64() as usize).collect();
            // The choice itself: no other query has a larger measure (up to rounding).
            for (h, chosen) in chosen.chunks(count).enumerate() {
                let measure = |i: usize| reference::sparsity(sparse, stream, q.view(), k.view(), h, i);
                let least = chosen.iter().map(|i| measure(*i)).fold(f64::INFINITY, f64::min);
                let others = (0..queries).filter(|i| !chosen.contains(i));
                assert!(others.map(measure).all(|measure| measure <= least + 1e-5), "another query should have been chosen");
            }
            let expected = reference::prob_sparse(sparse, &chosen, q.view(), k.view(), v.view(), d_o.view());
            let of = |rows: usize, values: &[f64]| Matrix::<T>::filled((rows, d), 0, 0, |i, j| T::of(values[i * d + j]));
            assert_near("o", &o.to_vec(), &of(queries, &expected[0]).to_vec(), Tolerance::Close);
            for which in 0..3 {
                let rows = if which == 0 { queries } else { keys };
                check_writes(["dq", "dk", "dv"][which], &of(rows, &expected[which + 1]), Tolerance::Close, |target, write| {
                    let mut others = [(queries, 0), (keys, 1), (keys, 2)].map(|(rows, _)| Matrix::<T>::poisoned(seed, (rows, d)));
                    let [a, b, c] = &mut others;
                    let mut writes = [Write::Set; 3];
                    writes[which] = write;
                    let (mut dq, mut dk, mut dv) = (a.view_mut(), b.view_mut(), c.view_mut());
                    *[&mut dq, &mut dk, &mut dv][which] = target;
                    let gradients = Gradients { dq, dk, dv, writes };
                    scratch.fill(T::NAN);
                    backward(isa, sparse, [q.view(), k.view(), v.view()], d_o.view(), &kept, gradients, &mut scratch);
                });
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn equals_its_sums(
            heads in 1_usize..4, factor in 1_usize..8, masked: bool, queries in 1_usize..60, keys in 1_usize..60, size in 1_usize..20,
            seed in 0_u64..1000
        ) {
            let keys = if masked { queries } else { keys };
            check::<f32>(Sparse { heads, factor, masked }, queries, keys, size, seed);
            check::<f64>(Sparse { heads, factor, masked }, queries, keys, size, seed);
        }
    }

    #[test]
    fn thirty_five_of_a_thousand() {
        let sparse = Sparse { heads: 2, factor: 5, masked: false };
        assert_eq!([sparse.chosen(1000), sparse.chosen(500), sparse.chosen(3), sparse.chosen(1)], [35, 35, 3, 1]);
        check::<f32>(sparse, 200, 200, 16, 1);
    }
}
