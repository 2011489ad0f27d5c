//! Moving average along time with the first and the last row repeated at the ends (paper eq. 29).
//!   y[t] = 1/w Σ_{|j| ≤ (w−1)/2} x[clamp(t + j)];   dx is the exact adjoint
//! x, y [n, C]; w odd.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, moving_average};

/// One operand x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingAverage {
    /// w, odd.
    pub width: usize,
}

impl<T: Real> Op<T> for MovingAverage {
    fn name(&self) -> &'static str {
        "moving_average"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one sequence [n, C], and an odd width";
        let [x] = exactly("moving_average", operands, EXPECTED)?;
        let fits = x.lengths().len() == 2 && !self.width.is_multiple_of(2);
        if fits { Ok(x) } else { Err(misfit("moving_average", operands, EXPECTED)) }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let (n, channels) = operands.first().map(Shape::rows).unwrap_or_default();
        let scratch = moving_average::scratch_len(n, channels);
        Memory { forward_scratch: scratch, backward_scratch: scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        moving_average::forward(io.isa, self.width, rows(io.x[0], shape), rows_mut(io.y, shape), io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for MovingAverage {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        moving_average::backward(io.isa, self.width, rows(io.dy, shape), rows_mut(dx.values, shape), dx.write, io.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(moving_average: MovingAverage { width: 5 }, [[12, 3]], [[7, 2]], [[2, 1]], [[1, 1]]);
    gradcheck!(width_one: MovingAverage { width: 1 }, [[6, 2]]);
    gradcheck!(wider_than_the_sequence: MovingAverage { width: 25 }, [[6, 2]]);
}
