//! Convolution along time with replicate padding, bias, and what follows it in the same pass.
//!   z[t, o] = b[o] + Σ_{c,j} W[j, c, o]·x[clamp(t + j − left), c],   y = dropout(f(z))
//! x [n, in], W [k, in, out] (files: [out, in, k]), b [out] or absent, y [n + left + right − k + 1, out]. The backward pass reads
//! x, W, and y instead of z; a dropout mask is drawn again.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{
    Backward, Differentiable, Forward, MICRO_BATCH, Memory, MicroBatched, Op, Pack, Pass, Reads, WEIGHT, misfit,
};
use phyture_kernels::activation::Activation;
use phyture_kernels::conv1d::{self, Geometry, Weight, sequences};
use phyture_kernels::dropout::Mask;
use phyture_kernels::instruction_set::InstructionSet;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Rows, RowsMut, Write};

/// The operand after the weight.
pub(super) const BIAS: usize = WEIGHT + 1;

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
pub(super) fn weight<'a, T>(plain: &'a [T], packed: &'a [T]) -> Weight<'a, T> {
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

impl Sizes {
    /// Numbers of y.
    const fn results(&self) -> usize {
        self.geometry.output_rows(self.rows) * self.outputs
    }
}

impl Conv1d {
    /// Into `io.y`, in parts where there are threads to spare.
    fn forward_alone<T: Real>(&self, io: &mut Forward<'_, T>) {
        let Some(Sizes { geometry, rows, inputs, outputs }) = self.sizes(io.shapes) else { return };
        let (x, weight) = (Rows::packed(io.x[0], rows, inputs), weight(io.x[WEIGHT], io.packed));
        let bias = (io.shapes.len() > BIAS).then_some(io.x[BIAS]);
        let (isa, epilogue) = (io.isa, self.epilogue.kernel(io.stream));
        io.parts.rows(geometry.output_rows(rows), conv1d::CUT, [&mut *io.y], &mut *io.scratch, |piece, [y], scratch| {
            let y = RowsMut::packed(y, piece.len(), outputs);
            conv1d::forward_rows(isa, geometry, x, (weight, bias), epilogue, (piece.start, y), scratch);
        });
    }

    /// dz, in `to` where something follows the convolution.
    fn backward_epilogue<'a, T: Real>(
        &self,
        sizes: &Sizes,
        (isa, stream): (InstructionSet, Option<Stream>),
        y: &[T],
        dy: &'a [T],
        to: &'a mut [T],
    ) -> Rows<'a, T> {
        let (rows, outputs) = (sizes.geometry.output_rows(sizes.rows), sizes.outputs);
        let dy = Rows::packed(dy, rows, outputs);
        if self.epilogue == Epilogue::None {
            return dy;
        }
        let dz = RowsMut::packed(&mut *to, rows, outputs);
        conv1d::backward_epilogue(isa, self.epilogue.kernel(stream), Rows::packed(y, rows, outputs), dy, dz);
        Rows::packed(to, rows, outputs)
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
        let scratch = if sequences::applies(geometry, inputs, outputs) {
            conv1d::scratch_len_of(MICRO_BATCH, geometry, inputs, outputs)
        } else {
            conv1d::scratch_len(geometry, inputs, outputs)
        };
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

    fn forward(&self, mut io: Forward<'_, T>) {
        self.forward_alone(&mut io);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }

    fn micro_batched(&self, operands: &[Shape]) -> Option<&dyn MicroBatched<T>> {
        let Sizes { geometry, inputs, outputs, .. } = self.sizes(operands)?;
        sequences::applies(geometry, inputs, outputs).then_some(self as _)
    }
}

impl<T: Real> Differentiable<T> for Conv1d {
    fn reads(&self) -> Reads {
        let reads = Reads::operands(&[0, 1]);
        if self.epilogue == Epilogue::None { reads } else { reads.and_result() }
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], Some(sizes)) = (io.shapes, self.sizes(io.shapes)) else { return };
        let geometry = sizes.geometry;
        let (dz, scratch) = io.scratch.split_at_mut(sizes.results());
        let dz = self.backward_epilogue(&sizes, (io.isa, io.stream), io.y, io.dy, dz);
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

impl<T: Real> MicroBatched<T> for Conv1d {
    fn forward_micro_batch(&self, micro_batch: &mut [Forward<'_, T>]) {
        let [first, others @ ..] = micro_batch else { return };
        let Some(Sizes { geometry, rows, inputs, outputs }) = self.sizes(first.shapes) else { return };
        if others.is_empty() {
            return self.forward_alone(first);
        }
        let bias = (first.shapes.len() > BIAS).then_some(first.x[BIAS]);
        let (isa, weight, scratch) = (first.isa, weight(first.x[WEIGHT], first.packed), std::mem::take(&mut first.scratch));
        let mut xs = [Rows::packed(first.x[0], rows, inputs); MICRO_BATCH];
        xs.iter_mut().zip(&*micro_batch).for_each(|(x, io)| *x = Rows::packed(io.x[0], rows, inputs));
        let count = micro_batch.len();
        let mut samples = micro_batch.iter_mut();
        let activation = self.epilogue.kernel(None).activation;
        let mut ys: [_; MICRO_BATCH] = std::array::from_fn(|_| match samples.next() {
            Some(io) => sequences::Output {
                y: RowsMut::packed(&mut *io.y, geometry.output_rows(rows), outputs),
                dropout: self.epilogue.kernel(io.stream).dropout,
            },
            None => sequences::Output { y: RowsMut::packed(&mut [], 0, outputs), dropout: None },
        });
        sequences::forward(isa, geometry, &xs[..count], (weight, bias), activation, &mut ys[..count], scratch);
    }

    fn backward_micro_batch(&self, micro_batch: &mut [Backward<'_, T>]) {
        let count = micro_batch.len();
        let Some(first) = micro_batch.first_mut() else { return };
        let (Some(sizes), isa) = (self.sizes(first.shapes), first.isa) else { return };
        let Sizes { geometry, rows, inputs, outputs } = sizes;
        let weight = weight(first.x[WEIGHT], first.packed);
        let (dweight, dbias) = (first.dx[WEIGHT].take(), first.dx[BIAS].take());
        // Each has dz in its own scratch; the products work in that of the first.
        let (own, scratch) = std::mem::take(&mut first.scratch).split_at_mut(sizes.results());
        first.scratch = own;
        let mut xs = [Rows::packed(&[], 0, inputs); MICRO_BATCH];
        let mut dzs = [Rows::packed(&[], 0, outputs); MICRO_BATCH];
        let mut dxs: [RowsMut<'_, T>; MICRO_BATCH] = std::array::from_fn(|_| RowsMut::packed(&mut [], 0, inputs));
        let mut write = None;
        for (index, io) in micro_batch.iter_mut().enumerate() {
            xs[index] = Rows::packed(io.x[0], rows, inputs);
            let dz = &mut io.scratch[..sizes.results()];
            dzs[index] = self.backward_epilogue(&sizes, (isa, io.stream), io.y, io.dy, dz);
            // All samples ask for the gradient of x, or none does.
            if let Some(dx) = &mut io.dx[0] {
                dxs[index] = RowsMut::packed(&mut *dx.values, rows, inputs);
                write = Some(dx.write);
            }
        }
        if let Some(write) = write {
            sequences::backward_input(isa, geometry, &dzs[..count], weight, &mut dxs[..count], write, &mut *scratch);
        }
        if let Some(dweight) = dweight {
            sequences::backward_weight(isa, geometry, &xs[..count], &dzs[..count], dweight.values, dweight.write, scratch);
        }
        if let Some(dbias) = dbias {
            for (index, dz) in dzs[..count].iter().enumerate() {
                let write = if index == 0 { dbias.write } else { Write::Add };
                conv1d::backward_bias(isa, *dz, dbias.values, write);
            }
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
