//! All rows as one: y[0, t·C + c] = x[t, c]; dx is dy, row by row.
//!
//! x of any shape, y [1, its number of elements]. Nothing is read in the backward pass.

use super::rows_mut;
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly};
use phyture_kernels::{Real, Rows, strided};

/// Operand x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flatten;

impl<T: Real> Op<T> for Flatten {
    fn name(&self) -> &'static str {
        "flatten"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        let [x] = exactly("flatten", operands, "one operand")?;
        Shape::new("flatten", &[1, x.len()])
    }

    fn forward(&self, io: Forward<'_, T>) {
        io.y.copy_from_slice(io.x[0]);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Flatten {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (count, columns) = x.rows();
        strided::copy(io.isa, Rows::packed(io.dy, count, columns), rows_mut(dx.values, x), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(flatten: Flatten, [[7, 5]], [[1, 1]], [[2, 3, 4]]);
}
