//! Inner product with a constant: y = Σ w∘x,  dx = dy·w.
//!
//! One number a sample. Its gradient is that of whatever has w for its derivative by x, so a chain that goes on outside the tape can be
//! pulled back through it.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, strided};

/// Operands x and w, of one shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InnerProduct;

impl<T: Real> Op<T> for InnerProduct {
    fn name(&self) -> &'static str {
        "inner_product"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "two of the same shape";
        let [x, w] = exactly("inner_product", operands, EXPECTED)?;
        if x == w { Shape::new("inner_product", &[1]) } else { Err(misfit("inner_product", operands, EXPECTED)) }
    }

    fn forward(&self, io: Forward<'_, T>) {
        io.y.fill(T::of(io.x[0].iter().zip(io.x[1]).map(|(x, w)| x.f64() * w.f64()).sum()));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for InnerProduct {
    fn reads(&self) -> Reads {
        Reads::operands(&[1])
    }

    fn reaches(&self, operand: usize) -> bool {
        operand == 0
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..], [dy, ..]) = (io.shapes, io.dx, io.dy) else { return };
        strided::scale(io.isa, *dy, rows(io.x[1], shape), rows_mut(dx.values, shape), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(inner_product: InnerProduct, [[3, 6], [3, 6]], [[1, 1], [1, 1]]);
}
