//! Even and odd rows of a sequence, and their interleaving (paper, text before eqs. 25–28; rows are counted from 0).
//!   Half: y[i] = x[2i + parity];     Interleave: y[2i] = a[i], y[2i+1] = b[i]
//!
//! Each is the other's adjoint. They copy: at the default size that is about 1 % of a sample's time, and a view would carry a
//! stride through every operation and give one buffer two writers.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Write, strided};

/// Every second row of x [n, C], n even: y [n/2, C].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// Rows 0, 2, 4, …
    Even,
    /// Rows 1, 3, 5, …
    Odd,
}

/// Rows of a and b [n, C] in turn, a first: y [2n, C].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interleave;

impl<T: Real> Op<T> for Half {
    fn name(&self) -> &'static str {
        "half"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one sequence [n, C] with even n";
        let [x] = exactly("half", operands, EXPECTED)?;
        match x.lengths() {
            [n, channels] if n % 2 == 0 => Shape::new("half", &[n / 2, *channels]),
            _ => Err(misfit("half", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let x = rows(io.x[0], shape);
        let half = if *self == Self::Even { x.even() } else { x.odd() };
        strided::copy(io.isa, half, phyture_kernels::RowsMut::packed(io.y, half.rows(), half.cols()), Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Half {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (n, channels) = shape.rows();
        let dy = phyture_kernels::Rows::packed(io.dy, n / 2, channels);
        let mut dx_rows = rows_mut(dx.values, shape);
        if dx.write == Write::Set {
            let other = dx_rows.reborrow();
            strided::fill(if *self == Self::Even { other.odd() } else { other.even() }, T::ZERO);
        }
        strided::copy(io.isa, dy, if *self == Self::Even { dx_rows.even() } else { dx_rows.odd() }, dx.write);
    }
}

impl<T: Real> Op<T> for Interleave {
    fn name(&self) -> &'static str {
        "interleave"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "two sequences [n, C] of the same shape";
        let [a, b] = exactly("interleave", operands, EXPECTED)?;
        match a.lengths() {
            [n, channels] if a == b => Shape::new("interleave", &[2 * n, *channels]),
            _ => Err(misfit("interleave", operands, EXPECTED)),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let y = phyture_kernels::RowsMut::packed(io.y, 2 * n, channels);
        strided::interleave(io.isa, rows(io.x[0], shape), rows(io.x[1], shape), y, Write::Set);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Interleave {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let dy = phyture_kernels::Rows::packed(io.dy, 2 * n, channels);
        let [even, odd, ..] = io.dx;
        for (dx, half) in [(even, dy.even()), (odd, dy.odd())] {
            if let Some(dx) = dx {
                strided::copy(io.isa, half, rows_mut(dx.values, shape), dx.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(even: Half::Even, [[8, 5]], [[2, 1]]);
    gradcheck!(odd: Half::Odd, [[8, 5]], [[2, 1]]);
    gradcheck!(interleave: Interleave, [[4, 5], [4, 5]], [[1, 1], [1, 1]]);
}
