//! The last rows of a sequence: y = x[n−count..n]; dx is dy there and 0 before.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, Write, strided};

/// x [n, C] to y [count, C].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastRows {
    /// Rows kept, 1 to n.
    pub count: usize,
}

impl<T: Real> Op<T> for LastRows {
    fn name(&self) -> &'static str {
        "last_rows"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one sequence [n, C] with at least as many rows as are kept";
        let [x] = exactly("last_rows", operands, EXPECTED)?;
        match x.lengths() {
            [n, channels] if *n >= self.count => Shape::new("last_rows", &[self.count, *channels]),
            _ => Err(misfit("last_rows", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let y = RowsMut::packed(io.y, self.count, channels);
        strided::copy(io.isa, rows(io.x[0], shape).range(n - self.count, n), y, Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for LastRows {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (n, channels) = shape.rows();
        let mut to = rows_mut(dx.values, shape);
        if dx.write == Write::Set {
            strided::fill(to.reborrow().range(0, n - self.count), T::ZERO);
        }
        strided::copy(io.isa, Rows::packed(io.dy, self.count, channels), to.range(n - self.count, n), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(last_rows: LastRows { count: 3 }, [[7, 4]], [[3, 2]]);
}
