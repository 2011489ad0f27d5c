//! Mean of up to eight values of one shape: y = 1/m·Σ x_j, dx_j = dy/m.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, misfit};
use phyture_kernels::{Real, Write, strided};

/// Operands x_0, x_1, …
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mean;

impl<T: Real> Op<T> for Mean {
    fn name(&self) -> &'static str {
        "mean"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        match operands {
            [first, rest @ ..] if rest.iter().all(|other| other == first) => Ok(*first),
            _ => Err(misfit("mean", operands, "one or more values of one shape")),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let share = T::of(1.0 / io.shapes.len() as f64);
        for (index, shape) in io.shapes.iter().enumerate() {
            let write = if index == 0 { Write::Set } else { Write::Add };
            strided::scale(io.isa, share, rows(io.x[index], shape), rows_mut(io.y, shape), write);
        }
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Mean {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let share = T::of(1.0 / io.shapes.len() as f64);
        for (dx, shape) in io.dx.into_iter().zip(io.shapes) {
            if let Some(dx) = dx {
                strided::scale(io.isa, share, rows(io.dy, shape), rows_mut(dx.values, shape), dx.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(mean: Mean, [[4, 3], [4, 3], [4, 3]], [[2]]);
}
