//! Layer normalisation over channels (paper eq. 24).
//!   y = γ·x̂ + β,  x̂ = (x − μ)·r,  r = (σ² + ε)^-½
//!   dx = r·(g − mean(g) − x̂·mean(g·x̂)),  g = γ·dy;   dγ = Σ dy·x̂;   dβ = Σ dy
//! x, y [n, C]; γ, β [C]. Kept: μ and r [n].

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, Write, layer_norm, strided};

/// Operands x, γ, β.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerNorm {
    /// ε inside the root.
    pub eps: f64,
}

impl<T: Real> Op<T> for LayerNorm {
    fn name(&self) -> &'static str {
        "layer_norm"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, C], weight [C], bias [C]";
        let [x, weight, bias] = exactly("layer_norm", operands, EXPECTED)?;
        match x.lengths() {
            [_, channels] if weight.lengths() == [*channels] && weight == bias => Ok(x),
            _ => Err(misfit("layer_norm", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let (n, channels) = operands.first().map(Shape::rows).unwrap_or_default();
        Memory { workspace: 2 * n, backward_scratch: 2 * channels, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, ..] = io.shapes else { return };
        let (mean, rstd) = io.workspace.split_at_mut(x.rows().0);
        layer_norm::forward(io.isa, rows(io.x[0], x), (io.x[1], io.x[2]), self.eps, rows_mut(io.y, x), (mean, rstd));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for LayerNorm {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let (x, dy) = (rows(io.x[0], shape), rows(io.dy, shape));
        let (mean, rstd) = io.workspace.split_at(n);
        let [dx, dgamma, dbeta, ..] = io.dx;
        if let Some(dx) = dx {
            layer_norm::backward_input(io.isa, x, io.x[1], (mean, rstd), dy, rows_mut(dx.values, shape), dx.write);
        }
        if dgamma.is_none() && dbeta.is_none() {
            return;
        }
        // By way of scratch: the two may have different write modes, or only one be asked for.
        let (gamma, beta) = io.scratch.split_at_mut(channels);
        layer_norm::backward_parameters(io.isa, x, (mean, rstd), dy, (gamma, beta), Write::Set);
        for (to, from) in [(dgamma, gamma), (dbeta, beta)] {
            if let Some(to) = to {
                strided::copy(io.isa, Rows::packed(from, 1, channels), RowsMut::packed(to.values, 1, channels), to.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(layer_norm: LayerNorm { eps: 1e-5 }, [[7, 16], [16], [16]], [[2, 5], [5], [5]], [[1, 2], [2], [2]]);
}
