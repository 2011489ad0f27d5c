//! Sum and difference of two values of one shape.
//!   y = a + b,  da = dy,  db = dy;     y = a − b,  da = dy,  db = −dy

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, strided};

/// y = a + b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Add;

/// y = a − b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subtract;

fn same(operation: &'static str, operands: &[Shape]) -> Result<Shape> {
    const EXPECTED: &str = "two of the same shape";
    let [a, b] = exactly(operation, operands, EXPECTED)?;
    if a == b { Ok(a) } else { Err(misfit(operation, operands, EXPECTED)) }
}

fn backward<T: Real>(io: Backward<'_, T>, signs: [T; 2]) {
    let [shape, ..] = io.shapes else { return };
    for (dx, sign) in io.dx.into_iter().zip(signs) {
        if let Some(dx) = dx {
            strided::scale(io.isa, sign, rows(io.dy, shape), rows_mut(dx.values, shape), dx.write);
        }
    }
}

impl<T: Real> Op<T> for Add {
    fn name(&self) -> &'static str {
        "add"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        same("add", operands)
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        strided::add(io.isa, rows(io.x[0], shape), rows(io.x[1], shape), rows_mut(io.y, shape));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Add {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        backward(io, [T::ONE, T::ONE]);
    }
}

impl<T: Real> Op<T> for Subtract {
    fn name(&self) -> &'static str {
        "subtract"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        same("subtract", operands)
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        strided::subtract(io.isa, rows(io.x[0], shape), rows(io.x[1], shape), rows_mut(io.y, shape));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Subtract {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        backward(io, [T::ONE, -T::ONE]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(add: Add, [[7, 5], [7, 5]], [[1, 1], [1, 1]]);
    gradcheck!(subtract: Subtract, [[7, 5], [7, 5]], [[1, 1], [1, 1]]);
}
