//! Long short-term memory over a sequence, one layer, zero initial state (Hochreiter & Schmidhuber 1997; Gers et al. 2000).
//!
//! ```text
//! [i f g o](t) = W_x·x(t) + b_x + W_h·h(t−1) + b_h,   i, f, o ← σ, g ← tanh
//! c(t) = f∘c(t−1) + i∘g,   h(t) = o∘tanh c(t)
//! ```
//!
//! x `[n, in]`, W_x `[4h, in]`, W_h `[4h, h]`, b_x and b_h `[4h]` with PyTorch's gate order i, f, g, o; result `[n, h]`, all steps.
//! Kept for the backward pass: the gates `[n, 4h]` and the cells `[n, h]`.
//!
//! All input maps are one matrix product. What is left of a step is a vector times W_h, packed so that a block of results stays in
//! registers while W_h streams from the second-level cache, and the gates. The backward pass gathers the gradients of the gates of all
//! steps and then forms every weight gradient as one product.

use crate::elementary::{or_zero, sigmoid, tanh};
use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Rows, RowsMut, Write, gemm, linear};

/// Results of the vector–matrix product that are formed at a time: eight registers of 256 bits in f32.
const BLOCK: usize = 64;

/// Weights and biases.
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a, T> {
    /// W_x `[4h, in]`.
    pub input: &'a [T],
    /// W_h `[4h, h]`.
    pub recurrent: &'a [T],
    /// b_x `[4h]`.
    pub input_bias: &'a [T],
    /// b_h `[4h]`.
    pub recurrent_bias: &'a [T],
}

/// Numbers that a packed `[depth, n]` matrix takes.
const fn packed_len(depth: usize, n: usize) -> usize {
    depth * n.next_multiple_of(BLOCK)
}

/// Scratch, in numbers, of [`forward`].
pub fn forward_scratch_len(rows: usize, inputs: usize, hidden: usize) -> usize {
    packed_len(hidden, 4 * hidden) + 4 * hidden + linear::scratch_len(rows, inputs, 4 * hidden)
}

/// Scratch, in numbers, of [`backward_gates`].
pub const fn backward_scratch_len(hidden: usize) -> usize {
    packed_len(4 * hidden, hidden) + 2 * hidden
}

/// h(t) for all t; gates and cells are kept.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    weights: Weights<'_, T>,
    h: RowsMut<'_, T>,
    gates: RowsMut<'_, T>,
    cells: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let (n, hidden) = (x.rows(), h.cols());
    let wide = 4 * hidden;
    assert!(h.rows() == n && gates.rows() == n && gates.cols() == wide, "lstm: rows of the results");
    assert!(cells.rows() == n && cells.cols() == hidden, "lstm: shape of the cells");
    assert!(weights.input.len() == wide * x.cols() && weights.recurrent.len() == wide * hidden, "lstm: weights");
    assert!(weights.input_bias.len() == wide && weights.recurrent_bias.len() == wide, "lstm: biases");
    let mut gates = gates;
    let (bias, rest) = scratch.split_at_mut(wide);
    bias.iter_mut().zip(weights.input_bias).zip(weights.recurrent_bias).for_each(|((sum, a), b)| *sum = *a + *b);
    let (packed, rest) = rest.split_at_mut(packed_len(hidden, wide));
    linear::forward(isa, x, weights.input, Some(bias), gates.reborrow(), rest);
    // W_hᵀ: element (j, o) is W_h[o, j].
    pack(packed, hidden, wide, |j, o| weights.recurrent[o * hidden + j]);
    T::lstm_forward(isa, Forward { packed, h, gates, cells });
}

/// Packs b `[depth, n]` into blocks of columns, the last one filled up with zeros.
fn pack<T: Real>(packed: &mut [T], depth: usize, n: usize, b: impl Fn(usize, usize) -> T) {
    for (block, first) in packed.chunks_exact_mut((depth * BLOCK).max(1)).zip((0..n).step_by(BLOCK)) {
        for (j, line) in block.chunks_exact_mut(BLOCK).enumerate() {
            for (k, to) in line.iter_mut().enumerate() {
                *to = if first + k < n { b(j, first + k) } else { T::ZERO };
            }
        }
    }
}

/// y += x·b, for b in blocks.
#[inline(always)]
fn add_product<T: Real, I: Isa>(y: &mut [T], x: &[T], packed: &[T]) {
    for (y, block) in y.chunks_mut(BLOCK).zip(packed.chunks_exact((x.len() * BLOCK).max(1))) {
        let mut sums = [T::ZERO; BLOCK];
        for (x, line) in x.iter().zip(block.as_chunks::<BLOCK>().0) {
            for k in 0..BLOCK {
                sums[k] = I::mul_add(*x, line[k], sums[k]);
            }
        }
        y.iter_mut().zip(&sums).for_each(|(y, sum)| *y += *sum);
    }
}

pub(crate) struct Forward<'a, T> {
    packed: &'a [T],
    h: RowsMut<'a, T>,
    gates: RowsMut<'a, T>,
    cells: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let hidden = self.h.cols();
        for t in 0..self.h.rows() {
            let gates = self.gates.row_mut(t);
            if t > 0 {
                add_product::<T, I>(gates, self.h.view().row(t - 1), self.packed);
            }
            let (input_forget, rest) = gates.split_at_mut(2 * hidden);
            let (candidate, output) = rest.split_at_mut(hidden);
            for gate in input_forget.iter_mut() {
                *gate = sigmoid::<T, I>(*gate);
            }
            for gate in output.iter_mut() {
                *gate = sigmoid::<T, I>(*gate);
            }
            for gate in candidate.iter_mut() {
                *gate = tanh::<T, I>(*gate);
            }
            let (input, forget) = input_forget.split_at(hidden);
            for k in 0..hidden {
                let before = if t > 0 { self.cells.view().row(t - 1)[k] } else { T::ZERO };
                self.cells.row_mut(t)[k] = I::mul_add(forget[k], before, input[k] * candidate[k]);
            }
            for ((h, c), o) in self.h.row_mut(t).iter_mut().zip(self.cells.view().row(t)).zip(&*output) {
                *h = *o * tanh::<T, I>(*c);
            }
        }
    }
}

/// Gradients of the gates before σ and tanh `[n, 4h]`, from dy `[n, h]` and what [`forward`] kept.
///
/// # Panics
/// If shapes disagree.
pub fn backward_gates<T: Real>(
    isa: InstructionSet,
    recurrent: &[T],
    gates: Rows<'_, T>,
    cells: Rows<'_, T>,
    dy: Rows<'_, T>,
    dgates: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let (n, hidden) = (dy.rows(), dy.cols());
    assert!(gates.rows() == n && gates.cols() == 4 * hidden && cells.rows() == n && cells.cols() == hidden, "lstm: what was kept");
    assert!(dgates.rows() == n && dgates.cols() == 4 * hidden && recurrent.len() == 4 * hidden * hidden, "lstm: gradients");
    let (packed, rest) = scratch.split_at_mut(packed_len(4 * hidden, hidden));
    let (dh, rest) = rest.split_at_mut(hidden);
    pack(packed, 4 * hidden, hidden, |o, j| recurrent[o * hidden + j]);
    T::lstm_backward(isa, Backward { packed, gates, cells, dy, dgates, dh, dc: &mut rest[..hidden] });
}

pub(crate) struct Backward<'a, T> {
    packed: &'a [T],
    gates: Rows<'a, T>,
    cells: Rows<'a, T>,
    dy: Rows<'a, T>,
    dgates: RowsMut<'a, T>,
    dh: &'a mut [T],
    dc: &'a mut [T],
}

impl<T: Real> Kernel for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let hidden = self.dy.cols();
        self.dc.fill(T::ZERO);
        for t in (0..self.dy.rows()).rev() {
            self.dh.copy_from_slice(self.dy.row(t));
            if t + 1 < self.dy.rows() {
                add_product::<T, I>(self.dh, self.dgates.view().row(t + 1), self.packed);
            }
            for dh in self.dh.iter_mut() {
                *dh = or_zero(*dh);
            }
            let (gates, cells) = (self.gates.row(t), self.cells.row(t));
            let (dinput, rest) = self.dgates.row_mut(t).split_at_mut(hidden);
            let (dforget, rest) = rest.split_at_mut(hidden);
            let (dcandidate, doutput) = rest.split_at_mut(hidden);
            let (input, rest) = gates.split_at(hidden);
            let (forget, rest) = rest.split_at(hidden);
            let (candidate, output) = rest.split_at(hidden);
            for k in 0..hidden {
                let bent = tanh::<T, I>(cells[k]);
                let before = if t > 0 { self.cells.row(t - 1)[k] } else { T::ZERO };
                doutput[k] = self.dh[k] * bent * output[k] * (T::ONE - output[k]);
                let dc = I::mul_add(self.dh[k] * output[k], T::ONE - bent * bent, self.dc[k]);
                dinput[k] = dc * candidate[k] * input[k] * (T::ONE - input[k]);
                dforget[k] = dc * before * forget[k] * (T::ONE - forget[k]);
                dcandidate[k] = dc * input[k] * (T::ONE - candidate[k] * candidate[k]);
                // Gradients die out along time: better at once than through subnormal numbers.
                self.dc[k] = or_zero(dc * forget[k]);
            }
        }
    }
}

/// dW_h {=, +=} Σ_t dgates(t)·h(t−1)ᵀ, `[4h, h]`.
pub fn backward_recurrent<T: Real>(isa: InstructionSet, h: Rows<'_, T>, dgates: Rows<'_, T>, dweight: &mut [T], write: Write) {
    let (n, hidden) = (h.rows(), h.cols());
    let dweight = RowsMut::packed(dweight, dgates.cols(), hidden);
    let last = n.saturating_sub(1);
    gemm::atb(isa, dgates.range(1.min(n), n), h.range(0, last), dweight, write, &mut []);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(n: usize, inputs: usize, hidden: usize, seed: u64) {
        let wide = 4 * hidden;
        let x = Matrix::<T>::random(seed, (n, inputs));
        let scaled = |seed: u64, len: usize| -> Vec<T> { numbers::<T>(seed, len).iter().map(|x| *x * T::of(0.3)).collect() };
        let (input, recurrent) = (scaled(seed + 1, wide * inputs), scaled(seed + 2, wide * hidden));
        let (input_bias, recurrent_bias) = (scaled(seed + 3, wide), scaled(seed + 4, wide));
        let weights = Weights { input: &input, recurrent: &recurrent, input_bias: &input_bias, recurrent_bias: &recurrent_bias };
        let dy = Matrix::<T>::random(seed + 5, (n, hidden));
        let expected = reference::lstm(x.view(), weights, dy.view());
        let of = |shape: (usize, usize), values: &[f64]| Matrix::<T>::filled(shape, 0, 0, |i, j| T::of(values[i * shape.1 + j]));
        for isa in InstructionSet::available() {
            let [mut h, mut cells] = [(); 2].map(|()| Matrix::<T>::poisoned(seed, (n, hidden)));
            let [mut gates, mut dgates] = [(); 2].map(|()| Matrix::<T>::poisoned(seed, (n, wide)));
            let mut scratch = vec![T::NAN; forward_scratch_len(n, inputs, hidden).max(backward_scratch_len(hidden))];
            forward(isa, x.view(), weights, h.view_mut(), gates.view_mut(), cells.view_mut(), &mut scratch);
            assert_near("h", &h.to_vec(), &of((n, hidden), &expected.h).to_vec(), Tolerance::Close);
            scratch.fill(T::NAN);
            backward_gates(isa, &recurrent, gates.view(), cells.view(), dy.view(), dgates.view_mut(), &mut scratch);
            assert_near("gates", &dgates.to_vec(), &of((n, wide), &expected.dgates).to_vec(), Tolerance::Approximate);
            [&h, &cells, &gates, &dgates].into_iter().for_each(Matrix::check_gaps);
            check_writes("dW_h", &of((1, wide * hidden), &expected.drecurrent), Tolerance::Approximate, |mut dw, write| {
                backward_recurrent(isa, h.view(), dgates.view(), dw.row_mut(0), write);
            });
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn equals_its_recurrence(n in 0_usize..200, inputs in 1_usize..20, hidden in 1_usize..40, seed in 0_u64..1000) {
            check::<f32>(n, inputs, hidden, seed);
            check::<f64>(n, inputs, hidden, seed);
        }
    }

    #[test]
    fn sizes_of_the_peer() {
        check::<f32>(250, 64, 64, 1);
        check::<f32>(9, 5, 80, 2);
    }
}
