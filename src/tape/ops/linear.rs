//! Linear map of each row: y = x·Wᵀ + b (paper eqs. 17–18, 21, 23).
//!   dx = dy·W,  dW = dyᵀ·x,  db = Σ_rows dy
//! x [n, in], W [out, in] as PyTorch stores it, b [out] or absent, y [n, out]. The backward pass reads x and W.

use super::large_weight::{self, Product, Sizes};
use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, LargeWeight, Memory, MicroBatched, Op, Reads, misfit};
use phyture_kernels::{Real, Rows, RowsMut, linear};

/// Operands x, W and, optionally, b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Linear;

impl Product for Linear {
    // The product with a single row is W·xᵀ; more rows are a product worth its weight by themselves.
    fn sizes(&self, operands: &[Shape]) -> Option<Sizes> {
        let [x, weight, ..] = operands else { return None };
        let (rows, inputs) = x.rows();
        (rows == 1).then_some(Sizes { inputs, outputs: weight.rows().0, channels: 1 })
    }
}

impl<T: Real> Op<T> for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        if let [x, weight, bias @ ..] = operands
            && let ([n, inputs], [outputs, reads]) = (x.lengths(), weight.lengths())
            && inputs == reads
            && bias.len() <= 1
            && bias.iter().all(|bias| bias.lengths() == [*outputs])
        {
            return Shape::new("linear", &[*n, *outputs]);
        }
        Err(misfit("linear", operands, "x [n, in], weight [out, in], and a bias [out] or none"))
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let [x, weight, ..] = operands else { return Memory::default() };
        let scratch = linear::scratch_len(x.rows().0, x.rows().1, weight.rows().0);
        let scratch = scratch.max(self.sizes(operands).map_or(0, Sizes::micro_batch_scratch_len));
        Memory { forward_scratch: scratch, backward_scratch: scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, weight, bias @ ..] = io.shapes else { return };
        let y = RowsMut::packed(io.y, x.rows().0, weight.rows().0);
        let bias = (!bias.is_empty()).then_some(io.x[2]);
        linear::forward(io.isa, rows(io.x[0], x), io.x[1], bias, y, io.scratch);
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

impl<T: Real> Differentiable<T> for Linear {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [x, weight, ..] = io.shapes else { return };
        let dy = Rows::packed(io.dy, x.rows().0, weight.rows().0);
        let [dx, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            linear::backward_input(io.isa, dy, io.x[1], rows_mut(dx.values, x), dx.write, io.scratch);
        }
        if let Some(dweight) = dweight {
            linear::backward_weight(io.isa, rows(io.x[0], x), dy, dweight.values, dweight.write, io.scratch);
        }
        if let Some(dbias) = dbias {
            linear::backward_bias(io.isa, dy, dbias.values, dbias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(linear: Linear, [[7, 6], [5, 6], [5]], [[7, 6], [5, 6]], [[3, 2], [2, 2], [2]], [[1, 1], [1, 1], [1]], [[1, 9], [4, 9], [4]]);
}
