//! Copy: y = x, dx = dy. The graph inserts it where one operation takes the same value twice.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly};
use phyture_kernels::{Real, Write, strided};

/// y = x, any shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Copy;

impl<T: Real> Op<T> for Copy {
    fn name(&self) -> &'static str {
        "copy"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        exactly::<1>("copy", operands, "one operand").map(|[x]| x)
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, ..] = io.shapes else { return };
        strided::copy(io.isa, rows(io.x[0], x), rows_mut(io.y, x), Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Copy {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        strided::copy(io.isa, rows(io.dy, x), rows_mut(dx.values, x), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(copy: Copy, [[7, 5]], [[1, 1]], [[4]]);
}
