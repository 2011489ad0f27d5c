//! A flight log as columns: what every other part of the program reads.
//!
//! This file holds the plain types. Reading files, checking them, deriving accelerations, cutting into blocks and windows
//! are in the sibling files. No physics here: a [`Flight`] knows what was recorded, not why.

#[cfg(feature = "files")]
mod assemble;
pub mod attitude;
mod bounds;
#[cfg(feature = "files")]
mod bytes;
mod channel;
mod column;
#[cfg(feature = "files")]
mod convert;
#[cfg(feature = "files")]
mod csv;
#[cfg(feature = "files")]
mod dataflash;
pub mod derived;
#[cfg(feature = "files")]
mod description;
pub mod differentiate;
#[cfg(feature = "files")]
mod format;
#[cfg(feature = "files")]
mod formats;
#[cfg(feature = "files")]
mod given;
#[cfg(feature = "parquet")]
pub mod guard;
#[cfg(feature = "files")]
pub mod guess;
#[cfg(feature = "files")]
mod hypotheses;
#[cfg(feature = "files")]
mod join;
#[cfg(feature = "files")]
mod keys;
#[cfg(feature = "files")]
mod late;
#[cfg(feature = "files")]
mod listing;
mod local_polynomial;
pub mod names;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "parquet")]
mod parquet_sizes;
#[cfg(feature = "files")]
pub mod read;
#[cfg(feature = "files")]
mod repair;
#[cfg(feature = "files")]
mod resample;
#[cfg(feature = "files")]
mod schema;
mod source;
pub mod split;
#[cfg(feature = "files")]
pub mod stanford;
mod store;
#[cfg(feature = "files")]
mod table;
#[cfg(feature = "files")]
mod taint;
#[cfg(feature = "files")]
mod timing;
#[cfg(feature = "files")]
mod ulog;
#[cfg(feature = "files")]
mod units;
#[cfg(feature = "files")]
mod values;
pub mod windows;
#[cfg(feature = "files")]
pub mod write;

pub use attitude::Axes;
pub use channel::{Channel, PerChannel};
pub use column::Column;
#[cfg(feature = "files")]
pub(crate) use description::Description;
#[cfg(feature = "files")]
pub use given::Given;
#[cfg(feature = "files")]
pub(crate) use schema::{Frame, Schema, TargetKind};
pub use source::Source;
#[cfg(feature = "files")]
pub(crate) use units::{column_names, columns_of};

use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::ops::Range;
use store::Store;

/// Standard gravity g₀, m/s² (exact by definition; 3rd CGPM 1901).
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// Why nothing that predicts an acceleration may read one.
pub const TARGET: &str = "it is one of the six accelerations that are to be predicted";

/// Where the six acceleration targets of a flight come from. Every output that shows errors says which.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Targets {
    /// The log carries `vx_dot … wz_dot`.
    Recorded,
    /// They were derived from `v` and `w` with a zero-phase differentiator.
    Derived,
}

/// One flight: 22 canonical columns of equal length at one constant step, plus the log's own further columns.
///
/// Invariants, held by [`Flight::new`]: at least one sample, all columns equally long, every value finite, step from 1 µs to 10 000 s.
/// A canonical column that the log lacks and may lack (position, heading) is all zero and listed in [`Flight::absent`].
#[derive(Clone, Debug)]
pub struct Flight {
    /// Name of the flight, unique in its data set: for one that was read, the path of its log below the data set without the ending, as
    /// in `chaos/flight_0` (see [`names`]).
    pub name: String,
    /// Manoeuvre class.
    pub manoeuvre: String,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Sampling step, s.
    pub step_s: f64,
    /// Whether the targets were recorded or derived.
    pub targets: Targets,
    /// Canonical columns that were not in the log and are zero here.
    pub absent: Vec<Column>,
    /// Further columns of the log, by name, usable in formulas.
    pub extra: BTreeMap<String, Vec<f64>>,
    /// Columns, canonical or further ones, that give an acceleration away as the log's description computes columns, with the reason;
    /// see [`Flight::gives_target_away`].
    pub tainted: BTreeMap<String, String>,
    /// Rows whose accelerations nothing is fitted to and nothing judged by, though they are part of the record: those near a cell that a repair
    /// rule with `set_aside_s` bridged. In order and apart from each other; empty unless a description asks for it.
    pub set_aside: Vec<Range<usize>>,
    /// `[22, samples]`, one row a [`Column`], in the order of [`Column::ALL`].
    canonical: Store,
}

impl Flight {
    /// Builds a flight from its canonical columns in the order of [`Column::ALL`], checking the invariants above.
    ///
    /// # Errors
    /// [`Error::Log`] naming the column if lengths differ, a value is not finite, or the flight is empty.
    pub fn new(
        name: impl Into<String>,
        manoeuvre: impl Into<String>,
        start_s: f64,
        step_s: f64,
        columns: [Vec<f64>; Column::COUNT],
        targets: Targets,
    ) -> Result<Self> {
        let name = name.into();
        let fault = |found: String, expected: &str| Error::Log { path: name.clone().into(), found, expected: expected.into() };
        let samples = columns[0].len();
        if samples == 0 {
            return Err(fault("no samples".into(), "at least one sample"));
        }
        if !bounds::STEPS_S.contains(&step_s) {
            let expected = format!("a step from {} s to {} s", bounds::STEPS_S.start(), bounds::STEPS_S.end());
            return Err(fault(format!("a step of {step_s} s"), &expected));
        }
        let mut canonical = Array2::zeros((Column::COUNT, samples));
        for (column, values) in Column::ALL.into_iter().zip(&columns) {
            if values.len() != samples {
                let found = format!("{} samples in `{}` and {samples} in `x`", values.len(), column.name());
                return Err(fault(found, "columns of one length"));
            }
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(fault(format!("{} in `{}`, sample {at}", values[at], column.name()), "finite numbers"));
            }
            canonical.row_mut(column as usize).assign(&ndarray::ArrayView1::from(values));
        }
        Ok(Self {
            manoeuvre: manoeuvre.into(),
            start_s,
            step_s,
            targets,
            absent: Vec::new(),
            extra: BTreeMap::new(),
            tainted: BTreeMap::new(),
            set_aside: Vec::new(),
            canonical: Store::Held(canonical),
            name,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.canonical.samples()
    }

    /// Never true: a flight has at least one sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One canonical column.
    pub fn column(&self, column: Column) -> &[f64] {
        let samples = self.len();
        let start = column as usize * samples;
        &self.canonical.as_slice()[start..start + samples]
    }

    /// A column by the name it has in the log: canonical, or one of [`Flight::extra`].
    pub fn named(&self, name: &str) -> Option<&[f64]> {
        Column::from_name(name).map(|column| self.column(column)).or_else(|| self.extra.get(name).map(Vec::as_slice))
    }

    /// State and controls of a sample, in the order of [`Column::STATE`].
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn state(&self, sample: usize) -> [f64; 16] {
        std::array::from_fn(|index| self.column(Column::STATE[index])[sample])
    }

    /// Why a quantity of this name gives one of the six accelerations away, if it does: it is one, it is made of one, or one is made of
    /// it. Nothing that predicts accelerations may read it.
    pub fn gives_target_away(&self, name: &str) -> Option<String> {
        if Column::TARGETS.iter().any(|target| target.name() == name) {
            return Some(TARGET.into());
        }
        let reads = derived::Derived::from_name(name).map_or(&[][..], derived::Derived::reads);
        let made_of = reads.iter().map(|column| column.name());
        made_of.chain([name]).find_map(|name| self.tainted.get(name)).cloned()
    }

    /// All canonical columns as a `[22, samples]` view, rows in the order of [`Column::ALL`].
    pub fn canonical(&self) -> ndarray::ArrayView2<'_, f64> {
        self.canonical.view()
    }

    /// Says that its columns are not needed for now: of a very long set, which is read from a temporary file, they leave the memory until the
    /// next look. Values do not change.
    pub fn rest(&self) {
        self.canonical.rest();
    }

    /// The same flight with its canonical columns in a temporary file, which goes with the process; in memory where there can be none.
    #[cfg(feature = "files")]
    pub(crate) fn out_of_memory(self) -> Self {
        Self { canonical: self.canonical.out_of_memory(), ..self }
    }

    /// The parts of `rows` whose accelerations are fitted and judged: all that is not [set aside](Flight::set_aside).
    pub fn counted(&self, rows: Range<usize>) -> impl Iterator<Item = Range<usize>> + '_ {
        let end = rows.end.min(self.len());
        let first = self.set_aside.partition_point(|aside| aside.end <= rows.start);
        let mut aside = self.set_aside[first..].iter();
        let mut next = rows.start;
        std::iter::from_fn(move || {
            while next < end {
                let (stop, after) = aside.next().map_or((end, end), |aside| (aside.start.min(end), aside.end));
                let part = next..stop;
                next = after;
                if !part.is_empty() {
                    return Some(part);
                }
            }
            None
        })
    }

    /// How many of `rows` are fitted and judged.
    pub fn count(&self, rows: Range<usize>) -> usize {
        self.counted(rows).map(|part| part.len()).sum()
    }

    /// Time of a sample, s.
    pub fn time_s(&self, sample: usize) -> f64 {
        self.start_s + self.step_s * sample as f64
    }

    /// Length of the flight, s.
    pub fn duration_s(&self) -> f64 {
        self.step_s * self.len() as f64
    }

    /// The six acceleration targets.
    pub fn accelerations(&self) -> Accelerations {
        PerChannel::from_fn(|channel| self.column(channel.column()).to_vec())
    }

    /// The same flight with other accelerations.
    ///
    /// # Errors
    /// [`Error::Log`] as [`Flight::new`].
    pub fn with_accelerations(&self, accelerations: &Accelerations) -> Result<Self> {
        self.with_columns(|column| Some(accelerations[Channel::of_column(column)?].clone()))
    }

    /// The same flight with other values in the columns for which `other` has some.
    ///
    /// # Errors
    /// [`Error::Log`] as [`Flight::new`].
    pub fn with_columns(&self, other: impl Fn(Column) -> Option<Vec<f64>>) -> Result<Self> {
        let columns = Column::ALL.map(|column| other(column).unwrap_or_else(|| self.column(column).to_vec()));
        let made = Self::new(self.name.clone(), self.manoeuvre.clone(), self.start_s, self.step_s, columns, self.targets)?;
        let (absent, extra, tainted) = (self.absent.clone(), self.extra.clone(), self.tainted.clone());
        Ok(Self { absent, extra, tainted, set_aside: self.set_aside.clone(), ..made })
    }

    /// The samples `range` as a flight of its own, with a new name. Panics never: the range is cut to what is there.
    pub fn slice(&self, range: Range<usize>, name: impl Into<String>) -> Option<Self> {
        let range = range.start.min(self.len())..range.end.min(self.len());
        if range.is_empty() {
            return None;
        }
        Some(Self {
            name: name.into(),
            manoeuvre: self.manoeuvre.clone(),
            start_s: self.time_s(range.start),
            step_s: self.step_s,
            targets: self.targets,
            absent: self.absent.clone(),
            extra: self.extra.iter().map(|(name, values)| (name.clone(), values[range.clone()].to_vec())).collect(),
            tainted: self.tainted.clone(),
            set_aside: within(&self.set_aside, &range),
            canonical: self.canonical.slice(range),
        })
    }
}

/// What of `ranges` lies within `rows`, counted from the first of these.
fn within(ranges: &[Range<usize>], rows: &Range<usize>) -> Vec<Range<usize>> {
    let shift = |at: usize| at.clamp(rows.start, rows.end) - rows.start;
    ranges.iter().map(|range| shift(range.start)..shift(range.end)).filter(|range| !range.is_empty()).collect()
}

/// Samples `[start, end)` of one flight of a data set, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span {
    /// Index of the flight.
    pub flight: usize,
    /// First sample.
    pub start: usize,
    /// One past the last sample.
    pub end: usize,
}

/// A history of H rows that ends with, and includes, row `last`; the target is that row's acceleration (paper eqs. 10–11).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Window {
    /// Index of the flight.
    pub flight: usize,
    /// Last row of the history.
    pub last: usize,
}

/// Six acceleration columns in the order of [`Column::TARGETS`]: m/s², then rad/s².
pub type Accelerations = PerChannel<Vec<f64>>;

/// The flights of one data set, sorted by manoeuvre and name.
#[derive(Clone, Debug, Default)]
pub struct DataSet {
    /// The flights.
    pub flights: Vec<Flight>,
    /// What the reader did that a person should know (derived accelerations, rows left out by a filter, resampling).
    pub notes: Vec<String>,
    /// What was read; empty for flights that were made.
    pub source: Source,
}

impl DataSet {
    /// Manoeuvre classes, sorted, each once.
    pub fn manoeuvres(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.flights.iter().map(|flight| flight.manoeuvre.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Total length, s.
    pub fn duration_s(&self) -> f64 {
        self.flights.iter().map(Flight::duration_s).sum()
    }

    /// Leaves flights out, by their paths or, where only one has it, by their own names, with a note that says why.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that no flight has, with the nearest that one has, and for a name that several have; all flights stay then.
    ///
    /// # Examples
    /// ```
    /// # #[cfg(feature = "sim")]
    /// # use phyture::sim::{Simulation, simulate};
    /// # #[cfg(not(feature = "sim"))]
    /// # fn main() {}
    /// # #[cfg(feature = "sim")]
    /// # fn main() -> phyture::Result<()> {
    /// let mut set = simulate(&Simulation { minutes: 2.0, ..Simulation::baseline() })?;
    /// let name = set.flights[0].name.clone();
    /// let notes = set.notes.len();
    /// set.leave_out(&[name.clone()], "as asked")?;
    /// assert!(set.flights.iter().all(|flight| flight.name != name));
    /// assert_eq!(set.notes[notes..], [format!("left out, as asked: {name}")]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn leave_out(&mut self, wanted: &[String], why: &str) -> Result<()> {
        let mut known = Vec::new();
        for name in wanted {
            let fault = |found: &str, expected: String| Error::Config {
                place: "flights".into(),
                field: "leave_out".into(),
                found: format!("`{name}`, which {found}"),
                expected,
            };
            match names::find(&self.flights, name).as_slice() {
                [] => return Err(fault("is no flight of this data set", self.one_like(name))),
                [one] => known.push(*one),
                several => {
                    let found = format!("{} flights are called", several.len());
                    return Err(fault(&found, "a flight's path below the data folder".into()));
                }
            }
        }
        known.sort_unstable();
        known.dedup();
        if !known.is_empty() {
            let names: Vec<&str> = known.iter().map(|&flight| self.flights[flight].name.as_str()).collect();
            self.notes.push(format!("left out, {why}: {}", names.join(", ")));
            self.source.left_out.extend(names.into_iter().map(str::to_owned));
        }
        let mut index = 0;
        self.flights.retain(|_| {
            index += 1;
            known.binary_search(&(index - 1)).is_err()
        });
        Ok(())
    }

    /// What could have been written for a name that no flight has.
    fn one_like(&self, name: &str) -> String {
        let known = || self.flights.iter().map(|flight| flight.name.as_str());
        let hint = did_you_mean(name, known().chain(known().map(names::own_name)));
        format!("one of the flights {}{hint}", names::listed(known().collect::<Vec<_>>().into_iter()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp(samples: usize) -> [Vec<f64>; Column::COUNT] {
        std::array::from_fn(|column| (0..samples).map(|sample| (column * 1000 + sample) as f64).collect())
    }

    proptest! {
        #[test]
        fn what_counts_is_all_that_is_not_set_aside(
            is_aside in proptest::collection::vec(any::<bool>(), 1..60), start in 0usize..70, end in 0usize..70
        ) {
            let samples = is_aside.len();
            let mut flight = Flight::new("a", "hover", 0.0, 0.01, ramp(samples), Targets::Recorded).expect("a flight");
            for row in (0..samples).filter(|&row| is_aside[row]) {
                match flight.set_aside.last_mut() {
                    Some(last) if last.end == row => last.end += 1,
                    _ => flight.set_aside.push(row..row + 1),
                }
            }
            let expected: Vec<usize> = (start..end.min(samples)).filter(|&row| !is_aside[row]).collect();
            prop_assert_eq!(flight.counted(start..end).flatten().collect::<Vec<_>>(), expected.clone());
            prop_assert!(flight.counted(start..end).all(|part| !part.is_empty()));
            prop_assert_eq!(flight.count(start..end), expected.len());
            if let Some(part) = flight.slice(start..end, "b") {
                let of_part: Vec<usize> = part.counted(0..part.len()).flatten().map(|row| row + start).collect();
                prop_assert_eq!(of_part, expected);
            }
        }
    }

    #[test]
    fn columns_are_found_by_name_and_sliced() -> Result<()> {
        let flight = Flight::new("a", "hover", 2.0, 0.01, ramp(50), Targets::Recorded)?;
        assert_eq!(flight.named("wz_dot"), Some(flight.column(Column::WzDot)));
        let part = flight.slice(10..20, "a[1]").ok_or(Error::Undetermined("empty".into()))?;
        assert_eq!(part.column(Column::U1), &flight.column(Column::U1)[10..20]);
        assert_eq!(part.start_s.to_bits(), flight.time_s(10).to_bits());
        Ok(())
    }

    #[test]
    fn a_nan_is_refused_by_column_and_sample() {
        let mut columns = ramp(5);
        columns[Column::Roll as usize][3] = f64::NAN;
        let message = Flight::new("a", "m", 0.0, 0.01, columns, Targets::Recorded).map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("NaN in `roll`, sample 3")));
    }
}
