//! A branch added with a weight that was computed: y = a + w·b, with w the weight of one of the `periods`.
//!   da = dy,  db = w·dy,  dw = <dy, b>
//! a, b, y [n, C]; periods [k, 2], of which element (index, 1) is w. The backward pass reads b and the periods.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Write, strided};

/// Operands a, b, periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AddWeighted {
    /// Which of the periods' weights.
    pub index: usize,
}

impl<T: Real> Op<T> for AddWeighted {
    fn name(&self) -> &'static str {
        "add_weighted"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "two sequences of one shape and periods [k, 2]";
        let [a, b, periods] = exactly("add_weighted", operands, EXPECTED)?;
        match periods.lengths() {
            [count, 2] if a == b && self.index < *count => Ok(a),
            _ => Err(misfit("add_weighted", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        strided::copy(io.isa, rows(io.x[0], shape), rows_mut(io.y, shape), Write::Set);
        let weight = io.x[2][2 * self.index + 1];
        strided::scale(io.isa, weight, rows(io.x[1], shape), rows_mut(io.y, shape), Write::Add);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for AddWeighted {
    fn reads(&self) -> Reads {
        Reads::operands(&[1, 2])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let at = 2 * self.index + 1;
        let dy = rows(io.dy, shape);
        let [da, db, dperiods, ..] = io.dx;
        if let Some(da) = da {
            strided::copy(io.isa, dy, rows_mut(da.values, shape), da.write);
        }
        if let Some(db) = db {
            strided::scale(io.isa, io.x[2][at], dy, rows_mut(db.values, shape), db.write);
        }
        if let Some(dperiods) = dperiods {
            if dperiods.write == Write::Set {
                dperiods.values.fill(T::ZERO);
            }
            dperiods.values[at] += strided::inner(io.isa, dy, rows(io.x[1], shape));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(add_weighted: AddWeighted { index: 1 }, [[4, 3], [4, 3], [3, 2]], [[1, 1], [1, 1], [2, 2]]);
}
