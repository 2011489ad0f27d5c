//! Rows of a sequence at a fixed distance, counted from its end: y[m] = x[n − 1 − (count − 1 − m)·stride]; dx is dy there and 0
//! elsewhere.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, Write, strided};

/// x [n, C] to y [count, C]; the last row of y is that of x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpacedRows {
    /// Rows of x from one row of y to the next, at least 1.
    pub stride: usize,
    /// Rows of y.
    pub count: usize,
}

impl SpacedRows {
    /// The row of x that is the first of y.
    const fn first(self, n: usize) -> usize {
        n - 1 - (self.count - 1) * self.stride
    }
}

impl<T: Real> Op<T> for SpacedRows {
    fn name(&self) -> &'static str {
        "spaced_rows"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one sequence [n, C] that is as long as the rows reach";
        let [x] = exactly("spaced_rows", operands, EXPECTED)?;
        match x.lengths() {
            [n, channels] if self.stride > 0 && self.count > 0 && (self.count - 1) * self.stride < *n => {
                Shape::new("spaced_rows", &[self.count, *channels])
            }
            _ => Err(misfit("spaced_rows", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let from = rows(io.x[0], shape).every(self.first(n), self.stride);
        strided::copy(io.isa, from, RowsMut::packed(io.y, self.count, channels), Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for SpacedRows {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (n, channels) = shape.rows();
        if dx.write == Write::Set {
            dx.values.fill(T::ZERO);
        }
        let to = rows_mut(dx.values, shape).every(self.first(n), self.stride);
        strided::copy(io.isa, Rows::packed(io.dy, self.count, channels), to, Write::Add);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(every_second: SpacedRows { stride: 2, count: 3 }, [[5, 3]], [[6, 1]]);
    gradcheck!(last: SpacedRows { stride: 1, count: 1 }, [[5, 3]], [[1, 1]]);
}
