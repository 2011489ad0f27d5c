//! Squared error: y = scale·Σ (x − target)²,  dx = 2·scale·dy·(x − target).
//!
//! One number a sample; a session takes the mean over samples (paper eq. 13 with scale 1). The target is a constant.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, loss};

/// Operands x and target, of one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredError {
    /// Factor before the sum.
    pub scale: f64,
}

impl<T: Real> Op<T> for SquaredError {
    fn name(&self) -> &'static str {
        "squared_error"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "a prediction and a target of the same shape";
        let [x, target] = exactly("squared_error", operands, EXPECTED)?;
        if x == target { Shape::new("squared_error", &[1]) } else { Err(misfit("squared_error", operands, EXPECTED)) }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        io.y.fill(T::of(loss::squared_error(rows(io.x[0], shape), rows(io.x[1], shape), self.scale)));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for SquaredError {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn reaches(&self, operand: usize) -> bool {
        operand == 0
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..], [dy, ..]) = (io.shapes, io.dx, io.dy) else { return };
        let (x, target, weight) = (rows(io.x[0], shape), rows(io.x[1], shape), self.scale * dy.f64());
        loss::squared_error_gradient(io.isa, x, target, weight, rows_mut(dx.values, shape), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(squared_error: SquaredError { scale: 0.7 }, [[3, 6], [3, 6]], [[1, 1], [1, 1]]);
}
