//! Convolution along time with replicate padding, bias, and what follows it in the same pass.
//!   z[t, o] = b[o] + Σ_{c,j} W[j, c, o]·x[clamp(t + j − left), c],   y = dropout(f(z))
//! x [n, in], W [k, in, out] (files: [out, in, k]), b [out] or absent, y [n + left + right − k + 1, out]. The backward pass reads
//! x, W, and y instead of z; a dropout mask is drawn again.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Pack, Pass, Reads, misfit};
use phyture_kernels::activation::Activation;
use phyture_kernels::conv1d::{self, Geometry, Weight};
use phyture_kernels::dropout::Mask;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Rows, RowsMut};

/// What follows the convolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Epilogue {
    /// Nothing: y = z.
    None,
    /// Leaky rectifier, then dropout while training.
    Leaky {
        /// Slope below 0.
        leak: f64,
        /// Probability of dropping, in [0, 1).
        dropout: f64,
    },
    /// tanh.
    Tanh,
}

impl Epilogue {
    fn kernel(self, stream: Option<Stream>) -> conv1d::Epilogue {
        let (activation, dropout) = match self {
            Self::None => (Activation::Identity, 0.0),
            Self::Leaky { leak, dropout } => (Activation::LeakyRelu { slope: leak }, dropout),
            Self::Tanh => (Activation::Tanh, 0.0),
        };
        conv1d::Epilogue { activation, dropout: stream.filter(|_| dropout > 0.0).map(|stream| Mask::new(stream, dropout)) }
    }
}

/// Operands x, W and, optionally, b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conv1d {
    /// Times the first row is repeated in front, and the last row behind.
    pub padding: (usize, usize),
    /// What follows.
    pub epilogue: Epilogue,
}

/// The weight as it was packed once a step, or as it is.
fn weight<'a, T>(plain: &'a [T], packed: &'a [T]) -> Weight<'a, T> {
    if packed.is_empty() { Weight::Plain(plain) } else { Weight::Packed(packed) }
}

/// Lengths of one convolution.
struct Sizes {
    geometry: Geometry,
    rows: usize,
    inputs: usize,
    outputs: usize,
}

impl Conv1d {
    fn sizes(&self, operands: &[Shape]) -> Option<Sizes> {
        let [x, weight, ..] = operands else { return None };
        let ([rows, inputs], [taps, reads, outputs]) = (x.lengths(), weight.lengths()) else { return None };
        let geometry = Geometry { taps: *taps, left: self.padding.0, right: self.padding.1 };
        (inputs == reads).then_some(Sizes { geometry, rows: *rows, inputs: *inputs, outputs: *outputs })
    }
}

impl<T: Real> Op<T> for Conv1d {
    fn name(&self) -> &'static str {
        "conv1d"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        let fits = |sizes: &Sizes| match operands {
            [_, _] => true,
            [_, _, bias] => bias.lengths() == [sizes.outputs],
            _ => false,
        };
        match self.sizes(operands).filter(fits) {
            Some(sizes) if sizes.geometry.output_rows(sizes.rows) > 0 => {
                Shape::new("conv1d", &[sizes.geometry.output_rows(sizes.rows), sizes.outputs])
            }
            _ => {
                let expected = "x [n, in], weight [k, in, out] with k no longer than the padded sequence, and a bias [out] or none";
                Err(misfit("conv1d", operands, expected))
            }
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let Some(Sizes { geometry, rows, inputs, outputs }) = self.sizes(operands) else { return Memory::default() };
        let scratch = conv1d::scratch_len(geometry, inputs, outputs);
        // Gradient of z in front.
        let backward_scratch = geometry.output_rows(rows) * outputs + scratch;
        let forward_packed = conv1d::packed_len(geometry, inputs, outputs);
        let backward_packed = conv1d::packed_len(geometry, outputs, inputs);
        Memory { workspace: 0, forward_scratch: scratch, backward_scratch, forward_packed, backward_packed }
    }

    fn pack(&self, io: Pack<'_, T>) {
        let Some(Sizes { geometry, inputs, outputs, .. }) = self.sizes(io.shapes) else { return };
        match io.pass {
            Pass::Forward => conv1d::pack(io.isa, geometry, (inputs, outputs), io.weight, io.packed),
            Pass::Backward => conv1d::pack_transposed(io.isa, geometry, (inputs, outputs), io.weight, io.packed),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let ([x, _, bias @ ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let Sizes { geometry, outputs, .. } = sizes;
        let (x, weight) = (rows(io.x[0], x), weight(io.x[1], io.packed));
        let bias = (!bias.is_empty()).then_some(io.x[2]);
        let epilogue = self.epilogue.kernel(io.stream);
        io.parts.rows(geometry.output_rows(sizes.rows), conv1d::CUT, [io.y], io.scratch, |piece, [y], scratch| {
            let y = RowsMut::packed(y, piece.len(), outputs);
            conv1d::forward_rows(io.isa, geometry, x, (weight, bias), epilogue, (piece.start, y), scratch);
        });
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Conv1d {
    fn reads(&self) -> Reads {
        let reads = Reads::operands(&[0, 1]);
        if self.epilogue == Epilogue::None { reads } else { reads.and_result() }
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let Sizes { geometry, outputs, .. } = sizes;
        let count = geometry.output_rows(sizes.rows);
        let (dz, scratch) = io.scratch.split_at_mut(count * outputs);
        let dy = Rows::packed(io.dy, count, outputs);
        let dz = if self.epilogue == Epilogue::None {
            dy
        } else {
            let y = Rows::packed(io.y, count, outputs);
            let to = RowsMut::packed(&mut *dz, count, outputs);
            conv1d::backward_epilogue(io.isa, self.epilogue.kernel(io.stream), y, dy, to);
            Rows::packed(dz, count, outputs)
        };
        let [dx, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            let weight = weight(io.x[1], io.packed);
            conv1d::backward_input(io.isa, geometry, dz, weight, rows_mut(dx.values, x), dx.write, scratch);
        }
        if let Some(dweight) = dweight {
            conv1d::backward_weight(io.isa, geometry, rows(io.x[0], x), dz, dweight.values, dweight.write, scratch);
        }
        if let Some(dbias) = dbias {
            conv1d::backward_bias(io.isa, dz, dbias.values, dbias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Conv1d = Conv1d { padding: (0, 0), epilogue: Epilogue::None };
    const LEAKY: Conv1d = Conv1d { padding: (3, 3), epilogue: Epilogue::Leaky { leak: 0.01, dropout: 0.2 } };
    const TANH: Conv1d = Conv1d { padding: (0, 0), epilogue: Epilogue::Tanh };

    gradcheck!(plain: PLAIN, [[9, 3], [3, 3, 4], [4]], [[9, 3], [3, 3, 4]], [[3, 1], [3, 1, 2], [2]]);
    gradcheck!(padded_leaky_dropout: LEAKY, [[8, 3], [5, 3, 4], [4]], [[1, 1], [5, 1, 1], [1]], [[2, 2], [5, 2, 1], [1]]);
    gradcheck!(in_pieces: LEAKY, [[26, 1], [5, 1, 2], [2]], [[36, 1], [5, 1, 1], [1]]);
    gradcheck!(tanh: TANH, [[9, 3], [3, 3, 4], [4]], [[3, 1], [3, 1, 2], [2]]);
    gradcheck!(uneven_padding: Conv1d { padding: (2, 3), epilogue: Epilogue::None }, [[6, 2], [4, 2, 3], [3]]);
}
