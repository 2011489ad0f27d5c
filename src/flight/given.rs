//! Logs whose columns are given in memory and not in a file: what is checked of them before they are read as any log is.

use super::source::Read;
use super::table::{RawTable, check_header, fault};
use crate::error::Result;
use std::path::PathBuf;

/// A log whose columns are in memory. Its numbers are NaN where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Given {
    /// Name of the flight. The class is what stands before a `/`, as in `chaos/flight_0`; without one the name without a number at its end, as in
    /// `hover_03`; a description in force may say otherwise.
    pub name: String,
    /// Names of the columns.
    pub names: Vec<String>,
    /// Their values, in this order, all equally long.
    pub columns: Vec<Vec<f64>>,
}

impl Given {
    /// Its columns that `wanted` accepts, as they would stand in a file. Rows are counted as lines of such a file, the header being line 1.
    ///
    /// # Errors
    /// [`Error::Log`](crate::Error::Log) for columns of several lengths, for no rows; [`Error::Cell`](crate::Error::Cell) for a doubled name.
    pub(super) fn table(self, wanted: &dyn Fn(&str) -> bool) -> Result<RawTable> {
        let path = PathBuf::from(&self.name);
        check_header(&path, &self.names, wanted)?;
        let rows = self.columns.first().map_or(0, Vec::len);
        if rows == 0 || self.names.len() != self.columns.len() {
            let found = format!("{} columns, {} names and {rows} rows", self.columns.len(), self.names.len());
            return Err(fault(&path, found, "a name for each column, and at least one row"));
        }
        if let Some((name, values)) = self.names.iter().zip(&self.columns).find(|(_, values)| values.len() != rows) {
            let found = format!("{} values in `{name}` and {rows} in `{}`", values.len(), self.names[0]);
            return Err(fault(&path, found, "columns of one length"));
        }
        let read = Read::of(&path, &self.bytes());
        let kept = self.names.into_iter().zip(self.columns).filter(|(name, _)| wanted(name));
        let (names, columns) = kept.unzip();
        Ok(RawTable { path, names, columns, lines: (2..rows + 2).collect(), read: Some(read) })
    }

    /// Names and values as bytes that no other log has.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (name, values) in self.names.iter().zip(&self.columns) {
            bytes.extend((name.len() as u64).to_le_bytes());
            bytes.extend(name.as_bytes());
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes
    }
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use super::super::read::{ReadOptions, data_set, of_columns};
    use super::super::{Column, Flight, write};
    use super::*;
    use crate::error::Error;
    use crate::sim::{Simulation, simulate};

    fn given(flight: &Flight) -> Given {
        let times = (0..flight.len()).map(|sample| flight.time_s(sample)).collect();
        let names = ["t".to_owned()].into_iter().chain(Column::ALL.map(|column| column.name().to_owned())).collect();
        let columns = [times].into_iter().chain(Column::ALL.map(|column| flight.column(column).to_vec())).collect();
        Given { name: flight.name.clone(), names, columns }
    }

    #[test]
    fn given_columns_are_read_to_the_bits_of_the_same_columns_in_files() -> Result<()> {
        let made = simulate(&Simulation { minutes: 1.0, ..Simulation::baseline() })?;
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        write::data_set_csv(folder.path(), &made.flights)?;
        let read = data_set(folder.path(), &ReadOptions::default())?;
        let held = of_columns(read.flights.iter().map(given).collect(), &ReadOptions::default())?;
        assert_eq!(held.flights.len(), read.flights.len());
        for (one, other) in held.flights.iter().zip(&read.flights) {
            assert_eq!((&one.name, &one.manoeuvre, one.targets), (&other.name, &other.manoeuvre, other.targets));
            assert_eq!((one.step_s.to_bits(), one.canonical()), (other.step_s.to_bits(), other.canonical()));
        }
        assert_eq!(held.source.sha256.len(), 64);
        // A description is in force as it is for files, and the same numbers twice are one flight.
        let mut twice: Vec<Given> = read.flights.iter().map(given).collect();
        let copy = Given { name: "hover_07".into(), ..twice[0].clone() };
        twice.push(copy);
        let described =
            ReadOptions { described: Some("manoeuvre = { separator = \"_\", part = 1 }\n".into()), ..ReadOptions::default() };
        let held = of_columns(twice, &described)?;
        assert_eq!(held.flights.len(), read.flights.len());
        assert!(held.notes.iter().any(|note| note.contains("hover_07")), "{:?}", held.notes);
        Ok(())
    }

    #[test]
    fn what_is_no_table_is_refused_by_the_name_of_its_flight() {
        let refused = |names: &[&str], columns: &[&[f64]]| {
            let names = names.iter().map(|name| (*name).to_owned()).collect();
            let columns = columns.iter().map(|values| values.to_vec()).collect();
            let one = Given { name: "hover/a".into(), names, columns };
            of_columns(vec![one], &ReadOptions::default()).map_err(|error| error.to_string()).err().unwrap_or_default()
        };
        assert!(refused(&["t", "vx"], &[&[0.0, 0.01], &[1.0]]).contains("hover/a: found 1 values in `vx` and 2 in `t`"));
        assert!(refused(&["t", "t"], &[&[0.0], &[1.0]]).contains("column `t`"));
        assert!(refused(&[], &[]).contains("at least one row"));
        assert!(refused(&["t", "vx"], &[&[0.0, 0.01], &[1.0, 2.0]]).starts_with("hover/a"));
        let nothing = of_columns(Vec::new(), &ReadOptions::default());
        assert!(nothing.is_err_and(|error| error.to_string().contains("no logs")));
    }
}
