//! A first description of logs that nobody has described: what columns are by their names, and units, axes, frames and orders by what agrees within the
//! log.
//!
//! One log is looked at, the largest. What is decided, and by how much, is said as well as what is not; whether the controls move what they
//! should is asked by `check` of the whole set, not here. Nothing is written.

mod assign;
mod consistency;
mod decide;
mod motion;
mod text;
mod vocabulary;

use super::format::{Log, ReadTable, Reader};
use super::listing::list;
use super::schema::Schema;
use super::table::{RawTable, fault};
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::path::Path;

/// What a log does not say.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Unknown {
    /// The thing.
    pub what: String,
    /// How to find out.
    pub how: String,
}

/// A description that was guessed.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Guess {
    /// The log that was looked at.
    pub log: String,
    /// The `dataset.toml`.
    pub text: String,
    /// What the log itself shows, with the figures.
    pub sure: Vec<String>,
    /// What it does not.
    pub unknown: Vec<Unknown>,
}

/// Columns with text that a log may have.
const MOST_TEXTS: usize = 100;

/// Guesses how the logs at `path` are to be read.
///
/// # Errors
/// [`Error::Io`], [`Error::Log`], [`Error::Cell`] for what is no data set or a log that cannot be read as a table.
pub fn guess(path: &Path) -> Result<Guess> {
    let logs = list(path, &Schema::default())?.logs;
    let size = |log: &&Log| std::fs::metadata(&log.path).map_or(0, |file| file.len());
    let log = logs.iter().max_by_key(size).ok_or_else(|| fault(path, "no logs", "a log"))?;
    if let Some(description) = log.format.description {
        return Ok(Guess {
            log: log.name.clone(),
            text: format!("# This is {}.\n{description}", log.format.kind),
            sure: vec![format!("axes, quaternion order, units and frames, as this is {}", log.format.kind)],
            unknown: vec![Unknown {
                what: "which outputs turn which axis on this airframe".into(),
                how: "u1 to u4 are what the controllers ask for; `[columns]` can make them of the outputs instead".into(),
            }],
        });
    }
    let Reader::Table(read) = log.format.reader else {
        return Ok(Guess {
            log: log.name.clone(),
            text: format!("# {}: its reader decides by itself how it is written.\n", log.format.kind),
            sure: vec![format!("everything that the reader decides by itself, as this is {}", log.format.kind)],
            unknown: Vec::new(),
        });
    };
    let (table, texts) = numbers(log, read)?;
    Ok(decide::decide(&log.name, &table, &texts))
}

/// The table without the columns that hold text, and these.
fn numbers(log: &Log, read: ReadTable) -> Result<(RawTable, BTreeSet<String>)> {
    let mut texts = BTreeSet::new();
    loop {
        match read(&log.path, &|name| !name.is_empty() && !texts.contains(name)) {
            Err(Error::Cell { column, found, expected, .. })
                if texts.len() < MOST_TEXTS && found.starts_with('`') && expected.starts_with("a number") =>
            {
                texts.insert(column);
            }
            result => return result.map(|table| (table, texts)),
        }
    }
}
