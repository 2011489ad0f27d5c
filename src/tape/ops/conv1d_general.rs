//! Convolution along time with a stride, a dilation, zeros or the sequence itself beyond the ends, and what follows it.
//!   z[t, o] = b[o] + Σ_{c,j} W[o, c, j]·x[t·stride + j·dilation − left, c],   y = dropout(f(z))
//!   dx, dW, db: the adjoint on dz = dy∘f′(z)∘mask/(1 − p)
//! x [n, in], W [out, in, k] as PyTorch stores it, b [out] or absent, y [rows, out]. The backward pass reads x, W, and y instead of z;
//! a dropout mask is drawn again.

use super::conv1d::{BIAS, weight};
use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{
    Backward, Differentiable, Forward, MICRO_BATCH, Memory, MicroBatched, Op, Pack, Pass, Reads, WEIGHT, misfit,
};
use phyture_kernels::activation::Activation;
use phyture_kernels::conv1d::{self, Epilogue};
pub use phyture_kernels::conv1d_general::Ends;
use phyture_kernels::conv1d_general::{self, Geometry};
use phyture_kernels::dropout::Mask;
use phyture_kernels::random::Stream;
use phyture_kernels::{InstructionSet, Real, Rows, RowsMut, Write};

/// Which rows are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// As many as fit between `padding` rows on both sides.
    Padded {
        /// Rows beyond each end.
        padding: usize,
        /// What they hold.
        ends: Ends,
    },
    /// So many, the last of which ends with the last row of x; before x there are zeros.
    Causal {
        /// Rows of y.
        rows: usize,
    },
}

/// Operands x, W and, optionally, b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralConv1d {
    /// Rows of x from one row of y to the next.
    pub stride: usize,
    /// Rows of x from one tap to the next.
    pub dilation: usize,
    /// Which rows.
    pub place: Place,
    /// f; not GELU, whose derivative y does not tell.
    pub activation: Activation,
    /// Probability of dropping while training, in [0, 1).
    pub dropout: f64,
}

/// Lengths of one convolution.
struct Sizes {
    geometry: Geometry,
    inputs: usize,
    outputs: usize,
}

impl GeneralConv1d {
    /// Stride 1, so many zeros on both sides, nothing after it.
    pub const fn padded(padding: usize) -> Self {
        let place = Place::Padded { padding, ends: Ends::Zero };
        Self { stride: 1, dilation: 1, place, activation: Activation::Identity, dropout: 0.0 }
    }

    /// Kernel of 3 on a circle.
    pub const fn circular() -> Self {
        Self { place: Place::Padded { padding: 1, ends: Ends::Circular }, ..Self::padded(0) }
    }

    fn sizes(&self, operands: &[Shape]) -> Option<Sizes> {
        let [x, weight, ..] = operands else { return None };
        let ([n, inputs], [outputs, reads, taps]) = (x.lengths(), weight.lengths()) else { return None };
        if inputs != reads || self.stride == 0 || self.dilation == 0 || self.activation == Activation::Gelu {
            return None;
        }
        let geometry = match self.place {
            Place::Padded { padding, ends } => Geometry::padded(*taps, self.stride, self.dilation, padding, *n, ends),
            Place::Causal { rows } => Geometry::causal(*taps, self.stride, self.dilation, *n, rows),
        };
        (geometry.rows > 0 && geometry.is_sound(*n)).then_some(Sizes { geometry, inputs: *inputs, outputs: *outputs })
    }

    fn epilogue(&self, stream: Option<Stream>) -> Epilogue {
        let dropout = stream.filter(|_| self.dropout > 0.0).map(|stream| Mask::new(stream, self.dropout));
        Epilogue { activation: self.activation, dropout }
    }

    fn is_bare(&self) -> bool {
        self.activation == Activation::Identity && self.dropout <= 0.0
    }

    fn forward_one<T: Real>(&self, io: &mut Forward<'_, T>) {
        let ([x, _, bias @ ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let y = RowsMut::packed(io.y, sizes.geometry.rows, sizes.outputs);
        let bias = (!bias.is_empty()).then_some(io.x[BIAS]);
        let weight = weight(io.x[WEIGHT], io.packed);
        conv1d_general::forward(io.isa, sizes.geometry, rows(io.x[0], x), (weight, bias), self.epilogue(io.stream), y, io.scratch);
    }

    /// dz of one sample: dy itself where nothing follows the sums, else in `to`.
    fn backward_epilogue<'a, T: Real>(
        &self,
        (geometry, outputs): (Geometry, usize),
        (isa, stream): (InstructionSet, Option<Stream>),
        (y, dy): (&[T], &'a [T]),
        to: &'a mut [T],
    ) -> Rows<'a, T> {
        let dy = Rows::packed(dy, geometry.rows, outputs);
        if self.is_bare() {
            return dy;
        }
        let y = Rows::packed(y, geometry.rows, outputs);
        conv1d::backward_epilogue(isa, self.epilogue(stream), y, dy, RowsMut::packed(&mut *to, geometry.rows, outputs));
        Rows::packed(to, geometry.rows, outputs)
    }
}

impl<T: Real> Op<T> for GeneralConv1d {
    fn name(&self) -> &'static str {
        "general_conv1d"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        let fits = |sizes: &Sizes| match operands {
            [_, _] => true,
            [_, _, bias] => bias.lengths() == [sizes.outputs],
            _ => false,
        };
        match self.sizes(operands).filter(fits) {
            Some(Sizes { geometry, outputs, .. }) => Shape::new("general_conv1d", &[geometry.rows, outputs]),
            None => {
                let expected = "x [n, in], weight [out, in, k] with k no longer than the padded sequence (which reaches around a \
                                circle at most once, at stride 1), and a bias [out] or none";
                Err(misfit("general_conv1d", operands, expected))
            }
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let Some(Sizes { geometry, inputs, outputs }) = self.sizes(operands) else { return Memory::default() };
        let scratch = conv1d_general::scratch_len(geometry, inputs, outputs);
        Memory {
            workspace: 0,
            forward_scratch: scratch,
            // Gradient of z in front.
            backward_scratch: geometry.rows * outputs + scratch,
            forward_packed: conv1d_general::packed_len(geometry, inputs, outputs),
            backward_packed: conv1d_general::packed_len(geometry, outputs, inputs),
        }
    }

    fn pack(&self, io: Pack<'_, T>) {
        let Some(Sizes { geometry, inputs, outputs }) = self.sizes(io.shapes) else { return };
        match io.pass {
            Pass::Forward => conv1d_general::pack(io.isa, geometry, (inputs, outputs), io.weight, io.packed),
            Pass::Backward => conv1d_general::pack_adjoint(io.isa, geometry, (inputs, outputs), io.weight, io.packed),
        }
    }

    fn forward(&self, mut io: Forward<'_, T>) {
        self.forward_one(&mut io);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }

    fn micro_batched(&self, _operands: &[Shape]) -> Option<&dyn MicroBatched<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for GeneralConv1d {
    fn reads(&self) -> Reads {
        let reads = Reads::operands(&[0, 1]);
        if self.is_bare() { reads } else { reads.and_result() }
    }

    fn backward(&self, io: Backward<'_, T>) {
        self.backward_micro_batch(&mut [io]);
    }
}

impl<T: Real> MicroBatched<T> for GeneralConv1d {
    fn forward_micro_batch(&self, micro_batch: &mut [Forward<'_, T>]) {
        micro_batch.iter_mut().for_each(|io| self.forward_one(io));
    }

    fn backward_micro_batch(&self, micro_batch: &mut [Backward<'_, T>]) {
        let count = micro_batch.len();
        let Some(first) = micro_batch.first_mut() else { return };
        let ([x, ..], Some(sizes), isa) = (first.shapes, self.sizes(first.shapes), first.isa) else { return };
        let Sizes { geometry, inputs, outputs } = sizes;
        let (dweight, dbias) = (first.dx[WEIGHT].take(), first.dx[BIAS].take());
        // Each has dz in its own scratch; the products work in that of the first.
        let (own, scratch) = std::mem::take(&mut first.scratch).split_at_mut(geometry.rows * outputs);
        first.scratch = own;
        let mut pairs = [(Rows::packed(&[], 0, inputs), Rows::packed(&[], 0, outputs)); MICRO_BATCH];
        for (pair, io) in pairs.iter_mut().zip(micro_batch) {
            let dz = &mut io.scratch[..geometry.rows * outputs];
            let dz = self.backward_epilogue((geometry, outputs), (isa, io.stream), (io.y, io.dy), dz);
            *pair = (rows(io.x[0], x), dz);
            if let Some(dx) = &mut io.dx[0] {
                let weight = weight(io.x[WEIGHT], io.packed);
                conv1d_general::backward_input(isa, geometry, dz, weight, rows_mut(dx.values, x), dx.write, scratch);
            }
        }
        let pairs = &pairs[..count];
        if let Some(dweight) = dweight {
            conv1d_general::backward_weight(isa, geometry, pairs, dweight.values, dweight.write, scratch);
        }
        if let Some(dbias) = dbias {
            for (index, (_, dz)) in pairs.iter().enumerate() {
                let write = if index == 0 { dbias.write } else { Write::Add };
                conv1d::backward_bias(isa, *dz, dbias.values, write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRIDED: GeneralConv1d =
        GeneralConv1d { stride: 2, activation: Activation::Relu, dropout: 0.3, ..GeneralConv1d::padded(2) };
    const DILATED: GeneralConv1d = GeneralConv1d { dilation: 2, place: Place::Causal { rows: 9 }, ..GeneralConv1d::padded(0) };
    const LAST: GeneralConv1d = GeneralConv1d { stride: 3, place: Place::Causal { rows: 2 }, ..GeneralConv1d::padded(0) };

    gradcheck!(strided_relu_dropout: STRIDED, [[9, 3], [4, 3, 5], [4]], [[1, 1], [1, 1, 5], [1]], [[4, 2], [1, 2, 3]]);
    gradcheck!(dilated_causal: DILATED, [[9, 3], [4, 3, 3], [4]], [[9, 1], [1, 1, 2]]);
    gradcheck!(last_rows: LAST, [[9, 2], [3, 2, 4], [3]], [[3, 1], [1, 1, 2]]);
    gradcheck!(circular: GeneralConv1d::circular(), [[6, 3], [4, 3, 3]], [[2, 1], [1, 1, 3], [1]]);
}
