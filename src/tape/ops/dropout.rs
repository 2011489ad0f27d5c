//! Inverted dropout: y = m∘x/(1−p), dx = m∘dy/(1−p); the identity when random parts are off.
//!
//! The mask is drawn again in the backward pass from the same counter-based stream; nothing is stored.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly};
use phyture_kernels::dropout::{self, Mask};
use phyture_kernels::{Real, Write, strided};

/// Drops each element with probability `rate`, in [0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability of dropping.
    pub rate: f64,
}

impl<T: Real> Op<T> for Dropout {
    fn name(&self) -> &'static str {
        "dropout"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        exactly::<1>("dropout", operands, "one operand").map(|[x]| x)
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (x, y) = (rows(io.x[0], shape), rows_mut(io.y, shape));
        match io.stream {
            Some(stream) => dropout::forward(io.isa, Mask::new(stream, self.rate), x, y),
            None => strided::copy(io.isa, x, y, Write::Set),
        }
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Dropout {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (dy, to) = (rows(io.dy, shape), rows_mut(dx.values, shape));
        match io.stream {
            Some(stream) => dropout::backward(io.isa, Mask::new(stream, self.rate), dy, to, dx.write),
            None => strided::copy(io.isa, dy, to, dx.write),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(dropout: Dropout { rate: 0.4 }, [[7, 5]], [[1, 1]]);
}
