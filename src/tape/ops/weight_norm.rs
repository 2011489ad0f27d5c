//! A weight as length times direction, the length of each output channel on its own (Salimans & Kingma 2016; PyTorch's `weight_norm`).
//!   w(o) = g(o)·v(o)/‖v(o)‖
//!   dg(o) = <dw(o), v(o)>/‖v(o)‖,  dv(o) = g(o)/‖v(o)‖·(dw(o) − v(o)·<dw(o), v(o)>/‖v(o)‖²)
//! v, w [out, in, k], g [out, 1, 1] as PyTorch stores it. The backward pass reads v and g.

use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, weight_norm};

/// Operands v, g.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeightNorm;

/// Output channels, and numbers of each.
fn sizes(v: &Shape) -> (usize, usize) {
    let outputs = v.lengths().first().copied().unwrap_or(1);
    (outputs, v.len() / outputs.max(1))
}

impl<T: Real> Op<T> for WeightNorm {
    fn name(&self) -> &'static str {
        "weight_norm"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "directions [out, in, k] and lengths [out, 1, 1]";
        let [v, g] = exactly("weight_norm", operands, EXPECTED)?;
        if g.lengths() == [sizes(&v).0, 1, 1] { Ok(v) } else { Err(misfit("weight_norm", operands, EXPECTED)) }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [v, ..] = io.shapes else { return };
        let (outputs, each) = sizes(v);
        weight_norm::forward(io.isa, Rows::packed(io.x[0], outputs, each), io.x[1], RowsMut::packed(io.y, outputs, each));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for WeightNorm {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [v, ..] = io.shapes else { return };
        let (outputs, each) = sizes(v);
        let (v, dw) = (Rows::packed(io.x[0], outputs, each), Rows::packed(io.dy, outputs, each));
        let [dv, dg, ..] = io.dx;
        if let Some(dv) = dv {
            weight_norm::backward_direction(io.isa, v, io.x[1], dw, RowsMut::packed(dv.values, outputs, each), dv.write);
        }
        if let Some(dg) = dg {
            weight_norm::backward_length(io.isa, v, dw, dg.values, dg.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(weight_norm: WeightNorm, [[4, 3, 5], [4, 1, 1]], [[2, 2, 1], [2, 1, 1]], [[1, 9, 7], [1, 1, 1]]);
}
