//! Where the numbers of a flight are: in memory, or, of very long sets, in a file without a name of which no more is in memory than is looked at.
//! Knows nothing of what the numbers are.

#[cfg(feature = "files")]
use phyture_kernels::mapped::Mapped;
#[cfg(feature = "files")]
use std::sync::Arc;

use ndarray::{Array2, ArrayView2, Axis};
use std::ops::Range;

/// Columns of one length.
#[derive(Clone, Debug)]
pub(super) enum Store {
    Held(Array2<f64>),
    #[cfg(feature = "files")]
    Mapped {
        columns: usize,
        numbers: Arc<Mapped>,
    },
}

impl Store {
    /// All columns, one after the other.
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Self::Held(columns) => columns.as_slice().expect("made in this order"),
            #[cfg(feature = "files")]
            Self::Mapped { numbers, .. } => numbers.as_slice(),
        }
    }

    pub fn columns(&self) -> usize {
        match self {
            Self::Held(columns) => columns.nrows(),
            #[cfg(feature = "files")]
            Self::Mapped { columns, .. } => *columns,
        }
    }

    pub fn samples(&self) -> usize {
        self.as_slice().len() / self.columns()
    }

    /// `[column, sample]`.
    pub fn view(&self) -> ArrayView2<'_, f64> {
        ArrayView2::from_shape((self.columns(), self.samples()), self.as_slice()).expect("columns of one length")
    }

    /// Some samples of each column, in memory.
    pub fn slice(&self, samples: Range<usize>) -> Self {
        Self::Held(self.view().slice_axis(Axis(1), samples.into()).as_standard_layout().into_owned())
    }

    /// Gives the memory back for now, if the numbers are elsewhere as well.
    pub fn rest(&self) {
        #[cfg(feature = "files")]
        if let Self::Mapped { numbers, .. } = self {
            numbers.rest();
        }
    }

    /// The same in a file of the folder for temporary files; in memory where that cannot be.
    #[cfg(feature = "files")]
    pub fn out_of_memory(self) -> Self {
        if matches!(self, Self::Mapped { .. }) {
            return self;
        }
        match Mapped::new(&std::env::temp_dir(), &[self.as_slice()]) {
            Ok(numbers) => Self::Mapped { columns: self.columns(), numbers: Arc::new(numbers) },
            Err(_) => self,
        }
    }
}

#[cfg(all(test, feature = "files"))]
mod tests {
    use super::super::{Column, Flight, Targets};
    use crate::error::Result;

    #[test]
    fn a_flight_out_of_memory_is_the_same_flight() -> Result<()> {
        let columns = std::array::from_fn(|column| (0..700).map(|k| f64::from(k).sin() / (1.0 + column as f64)).collect());
        let held = Flight::new("one", "made_up", 0.0, 0.01, columns, Targets::Recorded)?;
        let elsewhere = held.clone().out_of_memory().out_of_memory();
        for rests in [false, true] {
            if rests {
                elsewhere.rest();
            }
            assert_eq!((elsewhere.len(), elsewhere.canonical()), (held.len(), held.canonical()));
            assert!(Column::ALL.into_iter().all(|column| elsewhere.column(column) == held.column(column)));
        }
        let slices = [&held, &elsewhere].map(|flight| flight.slice(100..350, "part").map(|part| part.column(Column::U4).to_vec()));
        assert_eq!(slices[0], slices[1]);
        // What was made from it outlives it.
        let copy = elsewhere.clone();
        drop(elsewhere);
        assert_eq!(copy.column(Column::WzDot), held.column(Column::WzDot));
        Ok(())
    }
}
