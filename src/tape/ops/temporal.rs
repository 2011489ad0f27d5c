//! Linear map along time, the same for every channel: y = W·x + b (paper eqs. 31–32, with W the transpose of the paper's).
//!   dx = Wᵀ·dy,  dW = dy·xᵀ,  db = Σ_channels dy
//! x [n, C], W [rows, n], b [rows] or absent, y [rows, C]. The backward pass reads x and W.

use super::large_weight::{self, Product, Sizes};
use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, LargeWeight, Memory, MicroBatched, Op, Reads, misfit};
use phyture_kernels::{Real, Rows, RowsMut, temporal};

/// Operands x, W and, optionally, b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Temporal;

impl Product for Temporal {
    fn sizes(&self, operands: &[Shape]) -> Option<Sizes> {
        let [x, weight, ..] = operands else { return None };
        let (inputs, channels) = x.rows();
        Some(Sizes { inputs, outputs: weight.rows().0, channels })
    }
}

impl<T: Real> Op<T> for Temporal {
    fn name(&self) -> &'static str {
        "temporal"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        if let [x, weight, bias @ ..] = operands
            && let ([n, channels], [rows, reads]) = (x.lengths(), weight.lengths())
            && n == reads
            && bias.len() <= 1
            && bias.iter().all(|bias| bias.lengths() == [*rows])
        {
            return Shape::new("temporal", &[*rows, *channels]);
        }
        Err(misfit("temporal", operands, "x [n, C], weight [rows, n], and a bias [rows] or none"))
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let Some(sizes @ Sizes { inputs, outputs, channels }) = self.sizes(operands) else { return Memory::default() };
        let scratch = temporal::scratch_len(inputs, outputs, channels).max(sizes.micro_batch_scratch_len());
        Memory { forward_scratch: scratch, backward_scratch: scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, weight, bias @ ..] = io.shapes else { return };
        let y = RowsMut::packed(io.y, weight.rows().0, x.rows().1);
        let bias = (!bias.is_empty()).then_some(io.x[2]);
        temporal::forward(io.isa, rows(io.x[0], x), io.x[1], bias, y, io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }

    fn micro_batched(&self, operands: &[Shape]) -> Option<&dyn MicroBatched<T>> {
        large_weight::micro_batched(self, operands)
    }

    fn large_weight(&self, operands: &[Shape]) -> Option<&dyn LargeWeight<T>> {
        large_weight::large_weight(self, operands)
    }
}

impl<T: Real> Differentiable<T> for Temporal {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [x, weight, ..] = io.shapes else { return };
        let dy = Rows::packed(io.dy, weight.rows().0, x.rows().1);
        let [dx, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            temporal::backward_input(io.isa, dy, io.x[1], rows_mut(dx.values, x), dx.write, io.scratch);
        }
        if let Some(dweight) = dweight {
            temporal::backward_weight(io.isa, rows(io.x[0], x), dy, dweight.values, dweight.write, io.scratch);
        }
        if let Some(dbias) = dbias {
            temporal::backward_bias(io.isa, dy, dbias.values, dbias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(temporal: Temporal, [[9, 6], [5, 9], [5]], [[9, 6], [1, 9]], [[3, 2], [2, 3], [2]], [[1, 1], [1, 1], [1]]);
}
