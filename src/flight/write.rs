//! Writing flights and tables of predictions as CSV or Parquet, in the layout that [`super::read`] reads.
//!
//! Numbers are printed in the shortest form that reads back to the same bits; each file appears in one step (see
//! [`crate::disk`]). What stands in a prediction table is the caller's business.

use super::names::own_name;
use super::{Column, Flight, Targets};
use crate::disk::write_atomically;
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

pub use super::stanford::write as stanford;
pub use super::values::{Table, Values};

/// Writes a table as CSV: one header line, `\n` line ends, text quoted where it needs to be.
///
/// # Errors
/// [`Error::Shape`] if the columns differ in length; [`Error::Io`].
pub fn table_csv(path: &Path, table: &Table) -> Result<()> {
    let rows = common_length(table)?;
    write_atomically(path, |out| {
        for (index, (name, _)) in table.iter().enumerate() {
            separate(out, index)?;
            write_text(out, name)?;
        }
        out.write_all(b"\n")?;
        for row in 0..rows {
            for (index, (_, values)) in table.iter().enumerate() {
                separate(out, index)?;
                match values {
                    Values::Numbers(values) => write!(out, "{:?}", values[row])?,
                    Values::Text(values) => write_text(out, &values[row])?,
                }
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })
}

fn separate(out: &mut dyn Write, index: usize) -> io::Result<()> {
    if index == 0 { Ok(()) } else { out.write_all(b",") }
}

fn write_text(out: &mut dyn Write, text: &str) -> io::Result<()> {
    if text.contains([',', '"', '\n', '\r']) {
        write!(out, "\"{}\"", text.replace('"', "\"\""))
    } else {
        out.write_all(text.as_bytes())
    }
}

fn common_length(table: &Table) -> Result<usize> {
    let rows = table.first().map_or(0, |(_, values)| values.len());
    match table.iter().find(|(_, values)| values.len() != rows) {
        None => Ok(rows),
        Some((name, values)) => Err(Error::Shape {
            operation: "write table",
            message: format!("column `{name}` has {} rows and the first one {rows}; all must have the same", values.len()),
        }),
    }
}

/// Writes a table as Parquet: one row group, doubles and UTF-8 strings, all required, Snappy-compressed.
///
/// # Errors
/// [`Error::Shape`] if the columns differ in length; [`Error::Io`].
#[cfg(feature = "parquet")]
pub fn table_parquet(path: &Path, table: &Table) -> Result<()> {
    common_length(table)?;
    let bytes = super::parquet::encode(table).map_err(|error| Error::io(path)(io::Error::other(error)))?;
    write_atomically(path, |out| out.write_all(&bytes))
}

/// Writes one flight as CSV with the canonical header, then its further columns by name, but for those that give an acceleration
/// away ([`Flight::tainted`]).
///
/// Columns that the flight's log did not have ([`Flight::absent`]) are left out, so that they stay absent for the next reader.
///
/// # Errors
/// [`Error::Io`].
pub fn csv(flight: &Flight, path: &Path) -> Result<()> {
    with_table(flight, &flight.absent, |table| table_csv(path, table))
}

/// Writes one flight as Parquet with the same columns as [`csv()`].
///
/// # Errors
/// [`Error::Io`].
#[cfg(feature = "parquet")]
pub fn parquet(flight: &Flight, path: &Path) -> Result<()> {
    with_table(flight, &flight.absent, |table| table_parquet(path, table))
}

fn with_table<T>(flight: &Flight, without: &[Column], then: impl FnOnce(&Table) -> T) -> T {
    let time_s: Vec<f64> = (0..flight.len()).map(|sample| flight.time_s(sample)).collect();
    let mut table: Vec<(&str, Values)> = vec![("t", Values::Numbers(&time_s))];
    let kept = Column::ALL.into_iter().filter(|column| !without.contains(column));
    table.extend(kept.map(|column| (column.name(), Values::Numbers(flight.column(column)))));
    // Columns do not say where they come from: what gives an acceleration away would be a plain column for the next reader.
    let kept = flight.extra.iter().filter(|(name, _)| !flight.tainted.contains_key(*name));
    table.extend(kept.map(|(name, values)| (name.as_str(), Values::Numbers(values))));
    then(&table)
}

/// Where [`data_set_csv`] writes a flight: `folder/<manoeuvre>/<flight>.csv`, the flight by the last part of its name.
pub fn csv_path(folder: &Path, flight: &Flight) -> PathBuf {
    folder.join(&flight.manoeuvre).join(format!("{}.csv", own_name(&flight.name)))
}

/// Writes flights as `folder/<manoeuvre>/<flight>.csv`, making the folders.
///
/// What plain columns cannot say goes to a `dataset.toml`: columns that are absent, and accelerations that were derived and
/// not recorded. If only some of the flights have derived accelerations, these are left out of their files, and the next reader
/// derives them anew.
///
/// # Errors
/// [`Error::Log`] if a flight's or manoeuvre's name is no file name or two flights have one name; [`Error::Io`].
pub fn data_set_csv(folder: &Path, flights: &[Flight]) -> Result<()> {
    check_names(folder, flights)?;
    let all_derived = flights.iter().all(|flight| flight.targets == Targets::Derived);
    let absent: BTreeSet<Column> = flights.iter().flat_map(|flight| flight.absent.iter().copied()).collect();
    for flight in flights {
        let class = folder.join(&flight.manoeuvre);
        std::fs::create_dir_all(&class).map_err(Error::io(&class))?;
        let mut without = flight.absent.clone();
        if flight.targets == Targets::Derived && !all_derived {
            without.extend(Column::TARGETS);
        }
        let path = csv_path(folder, flight);
        with_table(flight, &without, |table| table_csv(&path, table))?;
    }
    let mut description = String::new();
    if all_derived && !flights.is_empty() {
        description.push_str("target_origin = \"derived\"\n");
    }
    if !absent.is_empty() {
        let names: Vec<String> = absent.iter().map(|column| format!("\"{}\"", column.name())).collect();
        description.push_str(&format!("missing = [{}]\n", names.join(", ")));
    }
    if description.is_empty() {
        return Ok(());
    }
    write_atomically(folder.join("dataset.toml"), |out| out.write_all(description.as_bytes()))
}

/// Refuses names that would leave the folder or fall on one another.
pub(super) fn check_names(folder: &Path, flights: &[Flight]) -> Result<()> {
    let fault = |found: String, expected: &str| Error::Log { path: folder.into(), found, expected: expected.into() };
    let mut seen = BTreeSet::new();
    for flight in flights {
        let own = own_name(&flight.name);
        for name in [own, flight.manoeuvre.as_str()] {
            let mut parts = Path::new(name).components();
            if !matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None)) || name.ends_with('/') {
                return Err(fault(format!("the name `{name}`"), "a name that can be a file's: not empty, no slash, not `..`"));
            }
        }
        if !seen.insert((&flight.manoeuvre, own)) {
            let found = format!("two flights that would be written as {}/{own}.csv", flight.manoeuvre);
            return Err(fault(found, "names of files that occur once in a manoeuvre; rename one"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_quoted_where_needed_and_numbers_are_short() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("predictions.csv");
        let names = ["plain".to_owned(), "a,\"b\"".to_owned()];
        table_csv(&path, &[("flight", Values::Text(&names)), ("vx_dot", Values::Numbers(&[0.1, -1e-20]))])?;
        assert_eq!(std::fs::read_to_string(&path)?, "flight,vx_dot\nplain,0.1\n\"a,\"\"b\"\"\",-1e-20\n");
        let uneven = table_csv(&path, &[("a", Values::Numbers(&[1.0])), ("b", Values::Numbers(&[]))]);
        assert!(matches!(uneven, Err(error) if error.to_string().contains("column `b` has 0 rows and the first one 1")));
        Ok(())
    }

    #[test]
    fn a_name_cannot_leave_the_folder() -> Result<()> {
        for name in ["..", "a/..", "", "a/", "../.."] {
            let columns = std::array::from_fn(|_| vec![0.0]);
            let flight = Flight::new(name, "hover", 0.0, 0.01, columns, Targets::Recorded)?;
            let refused = data_set_csv(Path::new("no_such_folder"), &[flight]);
            assert!(matches!(refused, Err(Error::Log { .. })), "{name}");
        }
        let columns = || std::array::from_fn(|_| vec![0.0]);
        let flight = |name: &str, manoeuvre: &str| Flight::new(name, manoeuvre, 0.0, 0.01, columns(), Targets::Recorded);
        assert_eq!(csv_path(Path::new("out"), &flight("../up/a", "hover")?), Path::new("out/hover/a.csv"));
        let twice = data_set_csv(Path::new("no_such_folder"), &[flight("day1/a", "hover")?, flight("day2/a", "hover")?]);
        assert!(matches!(twice, Err(error) if error.to_string().contains("two flights that would be written as hover/a.csv")));
        Ok(())
    }
}
