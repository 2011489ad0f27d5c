//! A format of logs: where its logs lie, and what reads one. Which formats there are is `formats`' list; what a file holds is the business of the
//! format's own file.

use super::assemble::{Assembled, Cuts, assemble};
use super::join::{Joined, Stream, Turn, join};
use super::schema::Schema;
use super::source::Read;
use super::table::RawTable;
#[cfg(not(feature = "parquet"))]
use super::table::fault;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Where a log of a format lies.
pub(super) enum Place {
    /// A file with this ending, in lower case.
    File(&'static str),
    /// A folder that this says is one flight.
    Folder(fn(&Path) -> bool),
}

/// What reads those columns of a table that are wanted.
pub(super) type ReadTable = fn(&Path, &dyn Fn(&str) -> bool) -> Result<RawTable>;

/// What finds the streams of a binary log that a description names, and says what of it is damaged.
pub(super) type ParseStreams = fn(&Path, &[u8], &Schema) -> Result<(Vec<Stream>, Option<String>)>;

/// What reads a log.
pub(super) enum Reader {
    /// This function, of a log that is one table.
    Table(ReadTable),
    /// The streams that this function finds, joined on one clock; attitudes among them, by the name of the stream.
    Streams { parse: ParseStreams, turns: &'static [(&'static str, Turn)] },
    /// This function.
    Of(fn(&Log, &Schema, Cuts) -> Result<Assembled>),
    /// Nothing, as the program was built without this feature.
    #[cfg(not(feature = "parquet"))]
    LeftOut(&'static str),
}

/// A log file or a flight's folder, what it is, and what its flights are called.
pub(super) struct Log {
    pub path: PathBuf,
    pub format: &'static Format,
    pub name: String,
    pub manoeuvre: String,
    /// Its columns, where they were given and are in no file.
    pub given: Option<RawTable>,
}

/// A format of logs.
pub(super) struct Format {
    /// What its file is, in words: "a CSV file".
    pub kind: &'static str,
    pub place: Place,
    /// What the format states by itself, in the words of `dataset.toml`; in force below the one of the data set.
    pub description: Option<&'static str>,
    pub reader: Reader,
}

impl Format {
    #[cfg(not(feature = "parquet"))]
    /// A format whose feature is off.
    pub const fn left_out(kind: &'static str, ending: &'static str, feature: &'static str) -> Self {
        Self { kind, place: Place::File(ending), description: None, reader: Reader::LeftOut(feature) }
    }

    /// The flights of a log.
    ///
    /// # Errors
    /// What is wrong with the log; [`crate::Error::Log`] where the program was built without what reads it.
    pub fn read(&self, log: &Log, schema: &Schema, cuts: Cuts) -> Result<Assembled> {
        if let Some(table) = &log.given {
            return assemble(table.clone(), &log.name, &log.manoeuvre, schema, cuts);
        }
        match self.reader {
            Reader::Table(read) => {
                let table = read(&log.path, &|name| schema.wants(name))?;
                assemble(table, &log.name, &log.manoeuvre, schema, cuts)
            }
            Reader::Streams { parse, turns } => {
                let bytes = std::fs::read(&log.path).map_err(Error::io(&log.path))?;
                let (streams, damage) = parse(&log.path, &bytes, schema)?;
                let read = Read::of(&log.path, &bytes);
                let Joined { table, note } = join(&log.path, streams, turns, schema, cuts.split_at_gaps, read)?;
                let joined = Schema { resample_hz: None, ..schema.clone() };
                let mut done = assemble(table, &log.name, &log.manoeuvre, &joined, cuts)?;
                done.own_notes.extend([Some(note), damage].into_iter().flatten().map(|note| format!("`{}`: {note}", log.name)));
                Ok(done)
            }
            Reader::Of(read) => read(log, schema, cuts),
            #[cfg(not(feature = "parquet"))]
            Reader::LeftOut(feature) => {
                Err(fault(&log.path, self.kind, format!("CSV; this program was built without the feature `{feature}`")))
            }
        }
    }
}
