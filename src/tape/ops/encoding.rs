//! Sinusoidal positions added to a sequence (paper eqs. 19–20): y = x + PE, dx = dy.
//!   PE(p, 2i) = sin(p/10000^(2i/d)),  PE(p, 2i+1) = cos(p/10000^(2i/d))

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, RowsMut, encoding, strided};
use std::sync::OnceLock;

/// The table `[rows, channels]`, made once, when it is first read: recording a graph costs nothing that grows with its sizes, for these
/// may be a file's claim.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionalEncoding {
    table: OnceLock<Vec<f64>>,
    rows: usize,
    channels: usize,
}

impl PositionalEncoding {
    /// The table for sequences of this length and width.
    pub const fn new(rows: usize, channels: usize) -> Self {
        Self { table: OnceLock::new(), rows, channels }
    }

    fn table(&self) -> &[f64] {
        self.table.get_or_init(|| {
            let mut table = vec![0.0; self.rows * self.channels];
            encoding::sinusoidal(RowsMut::packed(&mut table, self.rows, self.channels));
            table
        })
    }
}

impl<T: Real> Op<T> for PositionalEncoding {
    fn name(&self) -> &'static str {
        "positional_encoding"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one sequence of the table's shape";
        let [x] = exactly("positional_encoding", operands, EXPECTED)?;
        let fits = x.lengths() == [self.rows, self.channels];
        if fits { Ok(x) } else { Err(misfit("positional_encoding", operands, EXPECTED)) }
    }

    fn forward(&self, io: Forward<'_, T>) {
        for ((y, x), position) in io.y.iter_mut().zip(io.x[0]).zip(self.table()) {
            *y = *x + T::of(*position);
        }
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for PositionalEncoding {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        strided::copy(io.isa, rows(io.dy, shape), rows_mut(dx.values, shape), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recording_makes_no_table_and_reading_makes_it_once() {
        let claimed = PositionalEncoding::new(100_000, 4096);
        assert!(claimed.table.get().is_none());
        let encoding = PositionalEncoding::new(3, 2);
        assert_eq!(encoding.table()[..2], [0.0, 1.0]);
        assert!(std::ptr::eq(encoding.table(), encoding.table()));
    }

    gradcheck!(positional_encoding: PositionalEncoding::new(7, 4), [[7, 4]]);
}
