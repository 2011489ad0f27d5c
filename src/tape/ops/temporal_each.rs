//! A weighted sum over time with weights of its own for each channel: y[c] = b[c] + Σ_t W[c, t]·x[t, c].
//!   dx[t, c] = W[c, t]·dy[c],  dW[c, t] = x[t, c]·dy[c],  db = dy
//! x [n, C], W [C, n], b [C], y [1, C]. The backward pass reads x and W.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, strided, temporal_each};

/// Operands x, W, b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemporalEach;

impl<T: Real> Op<T> for TemporalEach {
    fn name(&self) -> &'static str {
        "temporal_each"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, C], weight [C, n], bias [C]";
        let [x, weight, bias] = exactly("temporal_each", operands, EXPECTED)?;
        match x.lengths() {
            [n, channels] if weight.lengths() == [*channels, *n] && bias.lengths() == [*channels] => {
                Shape::new("temporal_each", &[1, *channels])
            }
            _ => Err(misfit("temporal_each", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, weight, ..] = io.shapes else { return };
        temporal_each::forward(io.isa, rows(io.x[0], x), rows(io.x[1], weight), io.x[2], io.y);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for TemporalEach {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [x, weight, ..] = io.shapes else { return };
        let [dx, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            temporal_each::backward_input(io.isa, rows(io.x[1], weight), io.dy, rows_mut(dx.values, x), dx.write);
        }
        if let Some(dweight) = dweight {
            let to = rows_mut(dweight.values, weight);
            temporal_each::backward_weight(io.isa, rows(io.x[0], x), io.dy, to, dweight.write);
        }
        if let Some(dbias) = dbias {
            let channels = io.dy.len();
            strided::copy(io.isa, Rows::packed(io.dy, 1, channels), RowsMut::packed(dbias.values, 1, channels), dbias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(temporal_each: TemporalEach, [[5, 3], [3, 5], [3]], [[1, 1], [1, 1], [1]], [[30, 8], [8, 30], [8]]);
}
