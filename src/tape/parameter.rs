//! A parameter tensor: its name, its place in the flat slab of all parameters, and how it lies there.
//!
//! Files hold tensors as PyTorch does. In memory a convolution's weight lies as the matrix of its product, so that neither it nor
//! its gradient is ever transposed; this file is the one place where the two are turned into each other.

use super::shape::Shape;
use std::ops::Range;

/// How a tensor lies in the slab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// As in files.
    AsInFiles,
    /// A convolution's weight: `[taps, in, out]` in the slab, `[out, in, taps]` in files.
    Convolution,
}

/// A parameter tensor and its place in the flat slab of all parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Unique name, dotted.
    pub name: String,
    /// Shape in the slab, row-major.
    pub shape: Shape,
    /// How it lies there.
    pub storage: Storage,
    /// First element in the flat slab.
    pub offset: usize,
}

impl Parameter {
    /// Its elements in the flat slab.
    pub fn range(&self) -> Range<usize> {
        self.offset..self.offset + self.shape.len()
    }

    /// Lengths of the axes in files, row-major.
    pub fn file_lengths(&self) -> Vec<usize> {
        let mut lengths = self.shape.lengths().to_vec();
        if self.storage == Storage::Convolution {
            lengths.reverse();
        }
        lengths
    }

    /// Its elements in the order of files, from the flat slab of all parameters (or of their gradients).
    pub fn to_file_order<T: Copy>(&self, slab: &[T]) -> Vec<T> {
        let stored = slab.get(self.range()).unwrap_or_default();
        let mut numbers = stored.to_vec();
        self.places().for_each(|(stored_at, file_at)| numbers[file_at] = stored[stored_at]);
        numbers
    }

    /// Puts numbers in the order of files into the flat slab of all parameters. Nothing happens if their count is not its own.
    pub fn put_file_order<T: Copy>(&self, numbers: &[T], slab: &mut [T]) {
        if let Some(stored) = slab.get_mut(self.range()).filter(|stored| stored.len() == numbers.len()) {
            stored.copy_from_slice(numbers);
            self.places().for_each(|(stored_at, file_at)| stored[stored_at] = numbers[file_at]);
        }
    }

    /// Pairs of places, in the slab and in files, that differ.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let [taps, inputs, outputs] = match (self.storage, self.shape.lengths()) {
            (Storage::Convolution, &[taps, inputs, outputs]) => [taps, inputs, outputs],
            _ => [0; 3],
        };
        (0..taps * inputs * outputs).map(move |at| {
            let (tap, input, output) = (at / (inputs * outputs), at / outputs % inputs, at % outputs);
            (at, (output * inputs + input) * taps + tap)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::error::Result;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn there_and_back(taps in 1_usize..5, inputs in 1_usize..5, outputs in 1_usize..5, offset in 0_usize..7) {
            let shape = Shape::new("test", &[taps, inputs, outputs])?;
            let parameter = Parameter { name: "w".into(), shape, storage: Storage::Convolution, offset };
            let slab: Vec<usize> = (0..offset + shape.len()).collect();
            let file = parameter.to_file_order(&slab);
            for (o, i, t) in (0..outputs).flat_map(|o| (0..inputs).flat_map(move |i| (0..taps).map(move |t| (o, i, t)))) {
                prop_assert_eq!(file[(o * inputs + i) * taps + t], offset + (t * inputs + i) * outputs + o);
            }
            prop_assert_eq!(parameter.file_lengths(), vec![outputs, inputs, taps]);
            let mut back: Vec<usize> = vec![0; slab.len()];
            parameter.put_file_order(&file, &mut back);
            prop_assert_eq!(&back[offset..], &slab[offset..]);
        }
    }

    #[test]
    fn others_lie_as_in_files() -> Result<()> {
        let shape = Shape::new("test", &[2, 3])?;
        let parameter = Parameter { name: "w".into(), shape, storage: Storage::AsInFiles, offset: 1 };
        assert_eq!(parameter.to_file_order(&[9, 1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(parameter.file_lengths(), [2, 3]);
        Ok(())
    }
}
