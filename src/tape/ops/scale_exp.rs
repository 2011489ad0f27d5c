//! The interaction of an SCI block (paper eqs. 25–26): y = x∘eˢ;  dx = dy∘eˢ,  ds = dy∘x∘eˢ.
//!
//! x, s, y of one shape. The backward pass reads x and s.

use super::{or_scratch, rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, sci};

/// Operands x, s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleExp;

impl<T: Real> Op<T> for ScaleExp {
    fn name(&self) -> &'static str {
        "scale_exp"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "two of the same shape";
        let [x, s] = exactly("scale_exp", operands, EXPECTED)?;
        if x == s { Ok(x) } else { Err(misfit("scale_exp", operands, EXPECTED)) }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        // For the gradient nobody asks for, if there is one: the kernel makes both.
        Memory { backward_scratch: operands.first().map_or(0, Shape::len), ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        sci::scale(io.isa, rows(io.x[0], shape), rows(io.x[1], shape), rows_mut(io.y, shape));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for ScaleExp {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (x, s, dy) = (rows(io.x[0], shape), rows(io.x[1], shape), rows(io.dy, shape));
        let [dx, ds, ..] = io.dx;
        if dx.is_none() && ds.is_none() {
            return;
        }
        let mut scratch = io.scratch;
        let dx = or_scratch(dx, &mut scratch, shape.len());
        let ds = or_scratch(ds, &mut scratch, shape.len());
        sci::scale_backward(io.isa, x, s, dy, (rows_mut(dx.values, shape), dx.write), (rows_mut(ds.values, shape), ds.write));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(scale_exp: ScaleExp, [[7, 5], [7, 5]], [[1, 1], [1, 1]]);
}
