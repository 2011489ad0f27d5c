//! y = W·x + b with one large W for a bundle of samples: what `linear` and `temporal` share. Not an operation of its own.
//!   dx = Wᵀ·dy,  dW = Σ_samples dy·xᵀ,  db = Σ_samples Σ_channels dy
//! x [inputs, channels], W [outputs, inputs], b [outputs] or absent, y [outputs, channels].
//!
//! The samples are laid side by side, `[.., samples·channels]`, so that each product is one. Beside a large W these copies are small.

use crate::tape::Shape;
use crate::tape::op::{BUNDLE, Backward, Bundled, Differentiable, Forward, LARGE_WEIGHT, WEIGHT};
use phyture_kernels::level::Level;
use phyture_kernels::{Real, Rows, RowsMut, Write, gemm, rows, temporal};

/// The operand after the weight.
const BIAS: usize = WEIGHT + 1;

/// Sizes of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sizes {
    pub inputs: usize,
    pub outputs: usize,
    pub channels: usize,
}

impl Sizes {
    /// Whether the weight is worth a bundle.
    pub const fn are_large(self) -> bool {
        self.inputs * self.outputs >= LARGE_WEIGHT
    }

    /// Scratch that the first sample of a bundle has to bring; 0 if there will be none.
    pub fn bundle_scratch_len(self) -> usize {
        let Self { inputs, outputs, channels } = self;
        let columns = BUNDLE * channels;
        let products = [(outputs, inputs, columns), (inputs, outputs, columns), (outputs, columns, inputs)];
        let product = products.into_iter().map(|(m, k, n)| gemm::scratch_len(m, k, n)).max();
        if self.are_large() { (inputs + outputs) * columns + product.unwrap_or(0) } else { 0 }
    }

    /// The scratch of a bundle: for matrices of `[inputs, samples·channels]` and `[outputs, samples·channels]`, and for a product.
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

/// The operation as one that works on bundles, if its weight is worth it.
pub(super) fn bundled<'a, T: Real, O: Product + Differentiable<T>>(op: &'a O, operands: &[Shape]) -> Option<&'a dyn Bundled<T>> {
    op.sizes(operands).filter(|sizes| sizes.are_large()).map(|_| op as _)
}

impl<T: Real, O: Product + Differentiable<T>> Bundled<T> for O {
    fn forward_bundle(&self, bundle: &mut [Forward<'_, T>]) {
        if let Some(sizes) = bundle.first().and_then(|io| self.sizes(io.shapes)) {
            forward(bundle, sizes);
        }
    }

    fn backward_bundle(&self, bundle: &mut [Backward<'_, T>]) {
        if let Some(sizes) = bundle.first().and_then(|io| self.sizes(io.shapes)) {
            backward(bundle, sizes);
        }
    }
}

/// Lays matrices side by side.
fn join<'a, T: Real>(level: Level, sizes: Sizes, values: impl Iterator<Item = &'a [T]>, all: &mut RowsMut<'_, T>) {
    let rows = all.rows();
    for (index, values) in values.enumerate() {
        let x = Rows::packed(values, rows, sizes.channels);
        rows::copy(level, x, sizes.sample(index, all.reborrow()), Write::Set);
    }
}

/// y of every sample.
fn forward<T: Real>(samples: &mut [Forward<'_, T>], sizes: Sizes) {
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (level, [_, weight, bias, ..], scratch) = (first.level, first.x, std::mem::take(&mut first.scratch));
    let (mut x, mut y, scratch) = sizes.divide(count, scratch);
    join(level, sizes, samples.iter().map(|io| io.x[0]), &mut x);
    gemm::ab(level, sizes.weight(weight), x.view(), y.reborrow(), Write::Set, scratch);
    let all = y.view();
    for (index, io) in samples.iter_mut().enumerate() {
        let write = if bias.is_empty() { Write::Set } else { Write::Add };
        for (row, bias) in io.y.chunks_exact_mut(sizes.channels).zip(bias) {
            row.fill(*bias);
        }
        let y = RowsMut::packed(&mut *io.y, sizes.outputs, sizes.channels);
        rows::copy(level, all.columns(index * sizes.channels, sizes.channels), y, write);
    }
}

/// Gradients of x of every sample; those of W and b, of all together, where the first sample asks for them.
fn backward<T: Real>(samples: &mut [Backward<'_, T>], sizes: Sizes) {
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (level, weight, scratch) = (first.level, first.x[WEIGHT], std::mem::take(&mut first.scratch));
    let [dweight, dbias] = [WEIGHT, BIAS].map(|operand| first.dx[operand].take());
    let (mut x, mut dy, scratch) = sizes.divide(count, scratch);
    join(level, sizes, samples.iter().map(|io| io.dy), &mut dy);
    if let Some(dweight) = dweight {
        join(level, sizes, samples.iter().map(|io| io.x[0]), &mut x);
        let values = RowsMut::packed(dweight.values, sizes.outputs, sizes.inputs);
        gemm::abt(level, dy.view(), x.view(), values, dweight.write, scratch);
    }
    if let Some(dbias) = dbias {
        temporal::backward_bias(level, dy.view(), dbias.values, dbias.write);
    }
    // All samples ask for the gradient of x, or none does.
    if samples.iter().all(|io| io.dx[0].is_none()) {
        return;
    }
    let mut dx = x;
    gemm::atb(level, sizes.weight(weight), dy.view(), dx.reborrow(), Write::Set, scratch);
    let all = dx.view();
    for (index, gradient) in samples.iter_mut().map(|io| io.dx[0].as_mut()).enumerate() {
        if let Some(gradient) = gradient {
            let dx = RowsMut::packed(&mut *gradient.values, sizes.inputs, sizes.channels);
            rows::copy(level, all.columns(index * sizes.channels, sizes.channels), dx, gradient.write);
        }
    }
}
