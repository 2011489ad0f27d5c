//! y = W·x + b with one large W for a micro-batch of samples: what `linear` and `temporal` share. Not an operation of its own.
//!   dx = Wᵀ·dy,  dW = Σ_samples dy·xᵀ,  db = Σ_samples Σ_channels dy
//! x [inputs, channels], W [outputs, inputs], b [outputs] or absent, y [outputs, channels].
//!
//! Samples are laid side by side, `[.., samples·channels]`, so that each product is one: a micro-batch of them for y and dx, and for dW as
//! many as a kernel sums over at once. Samples of one channel are laid below each other, `[samples, ..]`, for they are rows already. Beside a large
//! W these copies are small.

use crate::tape::Shape;
use crate::tape::op::{
    Backward, Differentiable, Forward, LARGE_WEIGHT, LargeWeight, MICRO_BATCH, MicroBatched, WEIGHT, WeightGradient,
};
use phyture_kernels::instruction_set::InstructionSet;
use phyture_kernels::{Real, Rows, RowsMut, Write, gemm, linear, strided, temporal};

/// The operand after the weight.
const BIAS: usize = WEIGHT + 1;

/// Columns of samples that dW sums over at once, as the kernel does.
const COLUMNS: usize = gemm::LONGEST_BLOCK;

/// Sizes of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sizes {
    pub inputs: usize,
    pub outputs: usize,
    pub channels: usize,
}

impl Sizes {
    /// Whether the weight is worth a micro-batch.
    pub const fn are_large(self) -> bool {
        self.inputs * self.outputs >= LARGE_WEIGHT
    }

    /// Scratch that the first sample of a micro-batch has to bring; 0 if there will be none.
    pub fn micro_batch_scratch_len(self) -> usize {
        let Self { inputs, outputs, channels } = self;
        let columns = MICRO_BATCH * channels;
        let product = gemm::scratch_len(outputs, inputs, columns).max(gemm::scratch_len(inputs, outputs, columns));
        if self.are_large() { (inputs + outputs) * columns + product } else { 0 }
    }

    /// Samples that dW sums over at once.
    fn together(self) -> usize {
        (COLUMNS / self.channels).max(1)
    }

    /// Scratch for some rows of dW.
    fn weight_scratch_len(self, rows: usize) -> usize {
        let columns = self.together() * self.channels;
        (self.inputs + rows) * columns + gemm::scratch_len(rows, columns, self.inputs)
    }

    /// Scratch for matrices of `[inputs, samples·channels]` and `[outputs, samples·channels]`, and for a product.
    fn divide<T>(self, samples: usize, scratch: &mut [T]) -> (RowsMut<'_, T>, RowsMut<'_, T>, &mut [T]) {
        let columns = samples * self.channels;
        let (low, rest) = scratch.split_at_mut(self.inputs * columns);
        let (high, rest) = rest.split_at_mut(self.outputs * columns);
        (RowsMut::packed(low, self.inputs, columns), RowsMut::packed(high, self.outputs, columns), rest)
    }

    fn weight<T>(self, weight: &[T]) -> Rows<'_, T> {
        Rows::packed(weight, self.outputs, self.inputs)
    }

    /// Columns of a sample among those of all.
    fn sample<T>(self, index: usize, all: RowsMut<'_, T>) -> RowsMut<'_, T> {
        all.columns(index * self.channels, self.channels)
    }
}

/// An operation that is this product, for some shapes of its operands at least.
pub(super) trait Product {
    /// Sizes, if it is.
    fn sizes(&self, operands: &[Shape]) -> Option<Sizes>;
}

/// The operation as one that works on micro-batches, if its weight is worth it.
pub(super) fn micro_batched<'a, T: Real, O: Product + Differentiable<T>>(
    op: &'a O,
    operands: &[Shape],
) -> Option<&'a dyn MicroBatched<T>> {
    op.sizes(operands).filter(|sizes| sizes.are_large()).map(|_| op as _)
}

/// The operation as one whose weight has its gradient made from all samples, if that is worth it.
pub(super) fn large_weight<'a, T: Real, O: Product + Differentiable<T>>(
    op: &'a O,
    operands: &[Shape],
) -> Option<&'a dyn LargeWeight<T>> {
    op.sizes(operands).filter(|sizes| sizes.are_large()).map(|_| op as _)
}

impl<T: Real, O: Product + Differentiable<T>> MicroBatched<T> for O {
    fn forward_micro_batch(&self, micro_batch: &mut [Forward<'_, T>]) {
        if let Some(sizes) = micro_batch.first().and_then(|io| self.sizes(io.shapes)) {
            if sizes.channels == 1 { forward_rows(micro_batch, sizes) } else { forward(micro_batch, sizes) }
        }
    }

    fn backward_micro_batch(&self, micro_batch: &mut [Backward<'_, T>]) {
        if let Some(sizes) = micro_batch.first().and_then(|io| self.sizes(io.shapes)) {
            if sizes.channels == 1 { backward_rows(micro_batch, sizes) } else { backward(micro_batch, sizes) }
        }
    }
}

impl<T: Real, O: Product + Differentiable<T>> LargeWeight<T> for O {
    fn weight_gradient(&self, io: WeightGradient<'_, T>) {
        if let Some(sizes) = self.sizes(io.shapes) {
            weight_gradient(io, sizes);
        }
    }

    fn weight_scratch(&self, operands: &[Shape], rows: usize) -> usize {
        self.sizes(operands).map_or(0, |sizes| sizes.weight_scratch_len(rows))
    }
}

/// Lays matrices side by side.
fn join<'a, T: Real>(isa: InstructionSet, sizes: Sizes, values: impl Iterator<Item = &'a [T]>, all: &mut RowsMut<'_, T>) {
    let rows = all.rows();
    for (index, values) in values.enumerate() {
        let x = Rows::packed(values, rows, sizes.channels);
        strided::copy(isa, x, sizes.sample(index, all.reborrow()), Write::Set);
    }
}

/// Copies samples of one channel below each other.
fn stack<'a, T: Real>(values: impl Iterator<Item = &'a [T]>, all: &mut [T], length: usize) {
    all.chunks_exact_mut(length).zip(values).for_each(|(row, values)| row.copy_from_slice(values));
}

/// y of every sample of one channel: the rows of x·Wᵀ + b.
fn forward_rows<T: Real>(samples: &mut [Forward<'_, T>], sizes: Sizes) {
    let (count, Sizes { inputs, outputs, .. }) = (samples.len(), sizes);
    let Some(first) = samples.first_mut() else { return };
    let (isa, [_, weight, bias, ..], scratch) = (first.isa, first.x, std::mem::take(&mut first.scratch));
    let (x, rest) = scratch.split_at_mut(count * inputs);
    let (y, scratch) = rest.split_at_mut(count * outputs);
    stack(samples.iter().map(|io| io.x[0]), x, inputs);
    let bias = (!bias.is_empty()).then_some(bias);
    linear::forward(isa, Rows::packed(x, count, inputs), weight, bias, RowsMut::packed(y, count, outputs), scratch);
    samples.iter_mut().zip(y.chunks_exact(outputs)).for_each(|(io, y)| io.y.copy_from_slice(y));
}

/// Gradients of x of every sample of one channel, the rows of dy·W; and that of b.
fn backward_rows<T: Real>(samples: &mut [Backward<'_, T>], sizes: Sizes) {
    let (count, Sizes { inputs, outputs, .. }) = (samples.len(), sizes);
    let Some(first) = samples.first_mut() else { return };
    let (isa, weight, scratch) = (first.isa, first.x[WEIGHT], std::mem::take(&mut first.scratch));
    let dbias = first.dx[BIAS].take();
    let (dx, rest) = scratch.split_at_mut(count * inputs);
    let (dy, scratch) = rest.split_at_mut(count * outputs);
    stack(samples.iter().map(|io| io.dy), dy, outputs);
    let dy = Rows::packed(dy, count, outputs);
    if let Some(dbias) = dbias {
        linear::backward_bias(isa, dy, dbias.values, dbias.write);
    }
    // All samples ask for the gradient of x, or none does.
    if samples.iter().all(|io| io.dx[0].is_none()) {
        return;
    }
    linear::backward_input(isa, dy, weight, RowsMut::packed(dx, count, inputs), Write::Set, scratch);
    for (gradient, dx) in samples.iter_mut().map(|io| io.dx[0].as_mut()).zip(dx.chunks_exact(inputs)) {
        if let Some(gradient) = gradient {
            let to = RowsMut::packed(&mut *gradient.values, 1, inputs);
            strided::copy(isa, Rows::packed(dx, 1, inputs), to, gradient.write);
        }
    }
}

/// y of every sample.
fn forward<T: Real>(samples: &mut [Forward<'_, T>], sizes: Sizes) {
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (isa, [_, weight, bias, ..], scratch) = (first.isa, first.x, std::mem::take(&mut first.scratch));
    let (mut x, mut y, scratch) = sizes.divide(count, scratch);
    join(isa, sizes, samples.iter().map(|io| io.x[0]), &mut x);
    gemm::ab(isa, sizes.weight(weight), x.view(), y.reborrow(), Write::Set, scratch);
    let all = y.view();
    for (index, io) in samples.iter_mut().enumerate() {
        let write = if bias.is_empty() { Write::Set } else { Write::Add };
        for (row, bias) in io.y.chunks_exact_mut(sizes.channels).zip(bias) {
            row.fill(*bias);
        }
        let y = RowsMut::packed(&mut *io.y, sizes.outputs, sizes.channels);
        strided::copy(isa, all.columns(index * sizes.channels, sizes.channels), y, write);
    }
}

/// Gradients of x of every sample; that of b, of all together, where the first sample asks for it.
fn backward<T: Real>(samples: &mut [Backward<'_, T>], sizes: Sizes) {
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (isa, weight, scratch) = (first.isa, first.x[WEIGHT], std::mem::take(&mut first.scratch));
    let dbias = first.dx[BIAS].take();
    let (mut dx, mut dy, scratch) = sizes.divide(count, scratch);
    join(isa, sizes, samples.iter().map(|io| io.dy), &mut dy);
    if let Some(dbias) = dbias {
        temporal::backward_bias(isa, dy.view(), dbias.values, dbias.write);
    }
    // All samples ask for the gradient of x, or none does.
    if samples.iter().all(|io| io.dx[0].is_none()) {
        return;
    }
    gemm::atb(isa, sizes.weight(weight), dy.view(), dx.reborrow(), Write::Set, scratch);
    let all = dx.view();
    for (index, gradient) in samples.iter_mut().map(|io| io.dx[0].as_mut()).enumerate() {
        if let Some(gradient) = gradient {
            let dx = RowsMut::packed(&mut *gradient.values, sizes.inputs, sizes.channels);
            strided::copy(isa, all.columns(index * sizes.channels, sizes.channels), dx, gradient.write);
        }
    }
}

/// Rows of the gradient of W.
fn weight_gradient<T: Real>(io: WeightGradient<'_, T>, sizes: Sizes) {
    let WeightGradient { x, dy, rows: asked, gradient, scratch, isa, .. } = io;
    let Sizes { inputs, channels, .. } = sizes;
    let sizes = Sizes { outputs: asked.len(), ..sizes };
    let dy = dy.columns(asked.start * channels, asked.len() * channels);
    let mut values = RowsMut::packed(gradient.values, asked.len(), inputs);
    if x.rows() == 0 && gradient.write == Write::Set {
        strided::fill(values.reborrow(), T::ZERO);
    }
    for start in (0..x.rows()).step_by(sizes.together()) {
        let end = x.rows().min(start + sizes.together());
        let (x, dy) = (x.range(start, end), dy.range(start, end));
        let write = if start == 0 { gradient.write } else { Write::Add };
        if channels == 1 {
            // One column a sample: the samples are the rows of the matrices to be multiplied.
            gemm::atb(isa, dy, x, values.reborrow(), write, scratch);
        } else {
            let (mut all_x, mut all_dy, scratch) = sizes.divide(end - start, scratch);
            join(isa, sizes, (0..end - start).map(|sample| x.row(sample)), &mut all_x);
            join(isa, sizes, (0..end - start).map(|sample| dy.row(sample)), &mut all_dy);
            gemm::abt(isa, all_dy.view(), all_x.view(), values.reborrow(), write, scratch);
        }
    }
}
