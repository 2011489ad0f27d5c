//! One log file as it stands on disk: named columns of numbers with the line each row came from. What reads a file into one
//! is its format's; nothing is converted, checked against physics, or repaired here.

use super::bounds::MOST_COLUMNS;
use super::source::Read;
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Columns of one file, equally long.
#[derive(Clone, Debug, Default)]
pub(super) struct RawTable {
    /// The file.
    pub path: PathBuf,
    /// Names as in the file, in its order.
    pub names: Vec<String>,
    /// Values, one vector a name.
    pub columns: Vec<Vec<f64>>,
    /// Line of each row, the header being line 1. For Parquet, which has no lines, row number + 1, as if it were CSV.
    pub lines: Vec<usize>,
    /// The file as it was read.
    pub read: Option<Read>,
}

impl RawTable {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Place of a column in the file.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// A column by its name in the file.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.index(name).and_then(|index| self.columns.get(index)).map(Vec::as_slice)
    }

    /// An [`Error::Cell`] at a row of this table.
    pub fn cell(&self, row: usize, column: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Cell {
            path: self.path.clone(),
            line: self.lines.get(row).copied().unwrap_or(row + 2),
            column: column.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// An [`Error::Cell`] at the header.
    pub fn cell_of_header(&self, column: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Cell { path: self.path.clone(), line: 1, column: column.into(), found: found.into(), expected: expected.into() }
    }

    /// An [`Error::Log`] about this file as a whole.
    pub fn fault(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        fault(&self.path, found, expected)
    }

    /// The rows `range` as a table of their own.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            path: self.path.clone(),
            names: self.names.clone(),
            columns: self.columns.iter().map(|values| values[range.clone()].to_vec()).collect(),
            lines: self.lines[range].to_vec(),
            read: self.read.clone(),
        }
    }
}

pub(super) fn fault(path: &Path, found: impl Into<String>, expected: impl Into<String>) -> Error {
    Error::Log { path: path.into(), found: found.into(), expected: expected.into() }
}

/// Refuses a header that cannot be read unambiguously; `wanted` says which names matter.
pub(super) fn check_header(path: &Path, names: &[String], wanted: &dyn Fn(&str) -> bool) -> Result<()> {
    if names.len() > MOST_COLUMNS {
        return Err(fault(
            path,
            format!("{} columns", names.len()),
            format!("at most {MOST_COLUMNS}; write those that are needed"),
        ));
    }
    let mut seen = BTreeSet::new();
    for (index, name) in names.iter().enumerate().filter(|(_, name)| wanted(name)) {
        if name.is_empty() {
            let found = format!("a column without a name, number {} in the header", index + 1);
            return Err(fault(path, found, "a name for each column; `ignore = [\"\"]` in dataset.toml leaves it out"));
        }
        if !seen.insert(name) {
            let expected = "each column once; rename or remove one of the two";
            let found = "the same name twice in the header".to_owned();
            return Err(Error::Cell { path: path.into(), line: 1, column: name.clone(), found, expected: expected.into() });
        }
    }
    Ok(())
}
