//! Largest value, or mean, of windows along time, channel by channel.
//!   y[t, c] = max or mean of x[s, c] for t·stride − padding ≤ s < t·stride − padding + width
//!   dx[s, c] = Σ dy[t, c] over the windows whose largest value stands at s; or the mean's share of all
//! x [n, C], y [rows, C]. The backward pass of a maximum reads x and y; of several equal values the first has the gradient.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::pool::{self, Geometry};
use phyture_kernels::{Real, Rows, RowsMut};

/// Operand x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pool {
    /// Which number of a window.
    pub kind: pool::Pool,
    /// Windows.
    pub geometry: Geometry,
}

impl Pool {
    /// Windows of this width, one beside the other.
    pub const fn blocks(kind: pool::Pool, width: usize) -> Self {
        Self { kind, geometry: Geometry { width, stride: width, padding: 0 } }
    }
}

impl<T: Real> Op<T> for Pool {
    fn name(&self) -> &'static str {
        "pool"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, C], at least as long as a window, and a padding of at most half a window";
        let [x] = exactly("pool", operands, EXPECTED)?;
        match x.lengths() {
            [n, channels] if self.geometry.is_sound() && self.geometry.output_rows(*n) > 0 => {
                Shape::new("pool", &[self.geometry.output_rows(*n), *channels])
            }
            _ => Err(misfit("pool", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let channels = operands.first().map_or(0, |x| x.rows().1);
        Memory { backward_scratch: channels, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, ..] = io.shapes else { return };
        let (n, channels) = x.rows();
        let y = RowsMut::packed(io.y, self.geometry.output_rows(n), channels);
        pool::forward(io.isa, self.kind, self.geometry, rows(io.x[0], x), y);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Pool {
    fn reads(&self) -> Reads {
        match self.kind {
            pool::Pool::Max => Reads::operands(&[0]).and_result(),
            pool::Pool::Mean => Reads::NOTHING,
        }
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let (n, channels) = x.rows();
        let after = self.geometry.output_rows(n);
        let pair = match self.kind {
            pool::Pool::Max => (rows(io.x[0], x), Rows::packed(io.y, after, channels)),
            pool::Pool::Mean => (Rows::packed(&[], 0, channels), Rows::packed(&[], 0, channels)),
        };
        let dy = Rows::packed(io.dy, after, channels);
        pool::backward(io.isa, self.kind, self.geometry, pair, dy, (rows_mut(dx.values, x), dx.write), io.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISTIL: Geometry = Geometry { width: 3, stride: 2, padding: 1 };

    gradcheck!(max_of_pairs: Pool::blocks(pool::Pool::Max, 2), [[8, 3]], [[9, 2]], [[2, 1]]);
    gradcheck!(max_of_overlapping_windows: Pool { kind: pool::Pool::Max, geometry: DISTIL }, [[8, 3]], [[1, 2]]);
    gradcheck!(mean: Pool::blocks(pool::Pool::Mean, 2), [[8, 3]], [[2, 1]]);
    gradcheck!(mean_of_overlapping_windows: Pool { kind: pool::Pool::Mean, geometry: DISTIL }, [[7, 3]]);
}
