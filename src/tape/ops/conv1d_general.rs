//! Convolution along time with a stride, a dilation, zeros or the sequence itself beyond the ends, and what follows it.
//!   z[t, o] = b[o] + Σ_{c,j} W[o, c, j]·x[t·stride + j·dilation − left, c],   y = dropout(f(z))
//!   dx, dW, db: the adjoint on dz = dy∘f′(z)∘mask/(1 − p)
//! x [n, in], W [out, in, k] as PyTorch stores it, b [out] or absent, y [rows, out]. The backward pass reads x, W, and y instead of z;
//! a dropout mask is drawn again.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, misfit};
use phyture_kernels::activation::Activation;
use phyture_kernels::conv1d::{self, Epilogue};
pub use phyture_kernels::conv1d_general::Ends;
use phyture_kernels::conv1d_general::{self, Geometry};
use phyture_kernels::dropout::Mask;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Rows, RowsMut};

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
        // Gradient of z in front.
        Memory { forward_scratch: scratch, backward_scratch: geometry.rows * outputs + scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let ([x, _, bias @ ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let y = RowsMut::packed(io.y, sizes.geometry.rows, sizes.outputs);
        let bias = (!bias.is_empty()).then_some(io.x[2]);
        let epilogue = self.epilogue(io.stream);
        conv1d_general::forward(io.isa, sizes.geometry, rows(io.x[0], x), (io.x[1], bias), epilogue, y, io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for GeneralConv1d {
    fn reads(&self) -> Reads {
        let reads = Reads::operands(&[0, 1]);
        if self.is_bare() { reads } else { reads.and_result() }
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let Sizes { geometry, outputs, .. } = sizes;
        let (dz, scratch) = io.scratch.split_at_mut(geometry.rows * outputs);
        let dy = Rows::packed(io.dy, geometry.rows, outputs);
        let dz = if self.is_bare() {
            dy
        } else {
            let y = Rows::packed(io.y, geometry.rows, outputs);
            let to = RowsMut::packed(&mut *dz, geometry.rows, outputs);
            conv1d::backward_epilogue(io.isa, self.epilogue(io.stream), y, dy, to);
            Rows::packed(dz, geometry.rows, outputs)
        };
        let [dx, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            conv1d_general::backward_input(io.isa, geometry, dz, io.x[1], rows_mut(dx.values, x), dx.write, scratch);
        }
        if let Some(dweight) = dweight {
            let (to, write) = (dweight.values, dweight.write);
            conv1d_general::backward_weight(io.isa, geometry, rows(io.x[0], x), dz, to, write, scratch);
        }
        if let Some(dbias) = dbias {
            conv1d::backward_bias(io.isa, dz, dbias.values, dbias.write);
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
