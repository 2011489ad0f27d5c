//! Channels of two sequences side by side: y[t] = [a[t], b[t]]; da and db are the column ranges of dy.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, Write, strided};

/// a [n, A] and b [n, B] to y [n, A + B].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Concatenate;

impl<T: Real> Op<T> for Concatenate {
    fn name(&self) -> &'static str {
        "concatenate"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "two sequences [n, A] and [n, B]";
        let [a, b] = exactly("concatenate", operands, EXPECTED)?;
        match (a.lengths(), b.lengths()) {
            ([n, first], [m, second]) if n == m => Shape::new("concatenate", &[*n, first + second]),
            _ => Err(misfit("concatenate", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [a, b, ..] = io.shapes else { return };
        let ((n, first), (_, second)) = (a.rows(), b.rows());
        let mut y = RowsMut::packed(io.y, n, first + second);
        strided::copy(io.isa, rows(io.x[0], a), y.reborrow().columns(0, first), Write::Set);
        strided::copy(io.isa, rows(io.x[1], b), y.columns(first, second), Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Concatenate {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [a, b, ..] = io.shapes else { return };
        let ((n, first), (_, second)) = (a.rows(), b.rows());
        let dy = Rows::packed(io.dy, n, first + second);
        let [da, db, ..] = io.dx;
        for (dx, shape, from, count) in [(da, a, 0, first), (db, b, first, second)] {
            if let Some(dx) = dx {
                strided::copy(io.isa, dy.columns(from, count), rows_mut(dx.values, shape), dx.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(concatenate: Concatenate, [[5, 3], [5, 2]], [[1, 1], [1, 1]]);
}
