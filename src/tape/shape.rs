//! Shapes of the values on the tape: one to three axes, of one sample. There is no batch axis: a plan is replayed once a
//! sample.

use crate::tape::error::{Error, Result};
use std::fmt;

/// Largest number of axes: a convolution's weight `[out, in, k]`.
pub const MAX_RANK: usize = 3;

/// Lengths of the axes of one value, row-major.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Shape {
    lengths: [usize; MAX_RANK],
    rank: usize,
}

impl Shape {
    /// A shape of one to three axes, each at least 1 long.
    ///
    /// # Errors
    /// [`Error::Shape`] naming `operation` otherwise, or if the number of elements does not fit a `usize`.
    pub fn new(operation: &'static str, lengths: &[usize]) -> Result<Self> {
        let product = lengths.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
        if lengths.is_empty() || lengths.len() > MAX_RANK || product.is_none_or(|product| product == 0) {
            let message = format!("a shape of {lengths:?}; expected one to {MAX_RANK} axes, each at least 1 long");
            return Err(Error::Shape { operation, message });
        }
        let mut shape = Self { rank: lengths.len(), ..Self::default() };
        for (to, from) in shape.lengths.iter_mut().zip(lengths) {
            *to = *from;
        }
        Ok(shape)
    }

    /// The lengths of the axes.
    pub fn lengths(&self) -> &[usize] {
        self.lengths.get(..self.rank).unwrap_or_default()
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.lengths().iter().product()
    }

    /// Never true of a shape made by [`Shape::new`].
    pub fn is_empty(&self) -> bool {
        self.rank == 0
    }

    /// `(rows, columns)` of a value seen as rows: the last axis is the columns, all before it the rows.
    pub fn rows(&self) -> (usize, usize) {
        let columns = self.lengths().last().copied().unwrap_or(1);
        (self.len() / columns.max(1), columns)
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.lengths(), f)
    }
}

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_has_one_to_three_axes_and_no_empty_one() -> Result<()> {
        let shape = Shape::new("test", &[7, 64])?;
        assert_eq!((shape.len(), shape.rows(), shape.to_string().as_str()), (448, (7, 64), "[7, 64]"));
        assert_eq!(Shape::new("test", &[5])?.rows(), (1, 5));
        for wrong in [&[][..], &[0], &[3, 0], &[1, 1, 1, 1], &[usize::MAX, 2]] {
            assert!(matches!(Shape::new("test", wrong), Err(Error::Shape { operation: "test", .. })), "{wrong:?}");
        }
        Ok(())
    }
}
