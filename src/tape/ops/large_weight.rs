//! y = W·x + b with one large W for a bundle of samples: what `linear` and `temporal` share. Not an operation of its own.
//!   dx = Wᵀ·dy,  dW = Σ_samples dy·xᵀ,  db = Σ_samples Σ_channels dy
//! x [inputs, channels], W [outputs, inputs], b [outputs] or absent, y [outputs, channels].

use crate::tape::op::{BUNDLE, Backward, Forward, LARGE_WEIGHT, WEIGHT};
use phyture_kernels::{Real, Rows, RowsMut, Write, bundle, temporal};

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

    /// Scratch of the first sample of a bundle; 0 if there will be none.
    pub fn bundle_scratch_len(self) -> usize {
        if self.are_large() { bundle::scratch_len(self.outputs, self.inputs, self.channels, BUNDLE) } else { 0 }
    }

    fn weight<T>(self, weight: &[T]) -> Rows<'_, T> {
        Rows::packed(weight, self.outputs, self.inputs)
    }
}

/// One matrix of each sample, where it lies.
fn each<'a, T: Real>(mut values: impl Iterator<Item = &'a [T]>, rows: usize, columns: usize) -> [Rows<'a, T>; BUNDLE] {
    std::array::from_fn(|_| values.next().map_or(Rows::packed(&[], 0, 0), |values| Rows::packed(values, rows, columns)))
}

/// The same, to be written.
fn each_mut<'a, T: Real>(mut values: impl Iterator<Item = &'a mut [T]>, rows: usize, columns: usize) -> [RowsMut<'a, T>; BUNDLE] {
    std::array::from_fn(|_| match values.next() {
        Some(values) => RowsMut::packed(values, rows, columns),
        None => RowsMut::packed(&mut [], 0, 0),
    })
}

/// y of every sample.
pub(super) fn forward<T: Real>(samples: &mut [Forward<'_, T>], sizes: Sizes) {
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (level, [_, weight, bias, ..], scratch) = (first.level, first.x, std::mem::take(&mut first.scratch));
    for io in &mut *samples {
        io.y.fill(T::ZERO);
        for (row, bias) in io.y.chunks_exact_mut(sizes.channels).zip(bias) {
            row.fill(*bias);
        }
    }
    let x = each(samples.iter().map(|io| io.x[0]), sizes.inputs, sizes.channels);
    let mut y = each_mut(samples.iter_mut().map(|io| &mut *io.y), sizes.outputs, sizes.channels);
    bundle::ab(level, sizes.weight(weight), &x[..count], &mut y[..count], scratch);
}

/// Gradients of x of every sample; those of W and b, of all together, where the first sample asks for them.
pub(super) fn backward<T: Real>(samples: &mut [Backward<'_, T>], sizes: Sizes) {
    let Sizes { inputs, outputs, channels } = sizes;
    let count = samples.len();
    let Some(first) = samples.first_mut() else { return };
    let (level, weight, scratch) = (first.level, first.x[WEIGHT], std::mem::take(&mut first.scratch));
    let [dweight, dbias] = [WEIGHT, BIAS].map(|operand| first.dx[operand].take());
    let x = each(samples.iter().map(|io| io.x[0]), inputs, channels);
    let dy = each(samples.iter().map(|io| io.dy), outputs, channels);
    if let Some(dweight) = dweight {
        let values = RowsMut::packed(dweight.values, outputs, inputs);
        bundle::abt(level, &dy[..count], &x[..count], values, dweight.write, scratch);
    }
    if let Some(dbias) = dbias {
        for (index, dy) in dy[..count].iter().enumerate() {
            temporal::backward_bias(level, *dy, dbias.values, if index == 0 { dbias.write } else { Write::Add });
        }
    }
    // All samples ask for the gradient of x, or none.
    let Some(write) = samples[0].dx[0].as_ref().map(|dx| dx.write) else { return };
    let dx = samples.iter_mut().filter_map(|io| io.dx[0].as_mut()).map(|dx| &mut *dx.values);
    let mut dx = each_mut(dx, inputs, channels);
    bundle::atb(level, sizes.weight(weight), &dy[..count], &mut dx[..count], write);
}
