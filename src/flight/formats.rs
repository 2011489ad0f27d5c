//! The formats of logs that are read: one line each in [`FORMATS`], and a file that knows the format.
//!
//! Listing, messages and reading ask this list. What a file holds is the business of the format's own file.

use super::assemble::{Assembled, Cuts};
use super::listing::Log;
use super::schema::Schema;
#[cfg(not(feature = "parquet"))]
use super::table::fault;
use super::{stanford, table};
use crate::error::Result;
use std::path::Path;

/// Where a log of a format lies.
pub(super) enum Place {
    /// A file with this ending, in lower case.
    File(&'static str),
    /// A folder that this says is one flight.
    Folder(fn(&Path) -> bool),
}

/// What reads a log.
pub(super) enum Reader {
    /// This function.
    Of(fn(&Log, &Schema, Cuts) -> Result<Assembled>),
    /// Nothing: what the file is, and the feature without which the program was built.
    #[cfg(not(feature = "parquet"))]
    LeftOut { kind: &'static str, feature: &'static str },
}

/// A format of logs.
pub(super) struct Format {
    pub place: Place,
    pub reader: Reader,
}

/// All of them.
pub(super) static FORMATS: &[Format] = &[
    table::CSV,
    #[cfg(feature = "parquet")]
    super::parquet::PARQUET,
    #[cfg(not(feature = "parquet"))]
    Format::left_out("a Parquet file", "parquet", "parquet"),
    stanford::FORMAT,
];

impl Format {
    #[cfg(not(feature = "parquet"))]
    const fn left_out(kind: &'static str, ending: &'static str, feature: &'static str) -> Self {
        Self { place: Place::File(ending), reader: Reader::LeftOut { kind, feature } }
    }

    /// The flights of a log.
    ///
    /// # Errors
    /// What is wrong with the log; [`crate::Error::Log`] where the program was built without what reads it.
    pub fn read(&self, log: &Log, schema: &Schema, cuts: Cuts) -> Result<Assembled> {
        match self.reader {
            Reader::Of(read) => read(log, schema, cuts),
            #[cfg(not(feature = "parquet"))]
            Reader::LeftOut { kind, feature } => {
                Err(fault(&log.path, kind, format!("CSV; this program was built without the feature `{feature}`")))
            }
        }
    }
}

/// The format of a file, by its ending.
pub(super) fn of_file(path: &Path) -> Option<&'static Format> {
    let ending = ending(path);
    FORMATS.iter().find(|format| matches!(format.place, Place::File(own) if own == ending))
}

/// The format of a folder that is one flight.
pub(super) fn of_folder(path: &Path) -> Option<&'static Format> {
    FORMATS.iter().find(|format| matches!(format.place, Place::Folder(is_flight) if is_flight(path)))
}

/// The ending in lower case, without its dot.
pub(super) fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// The files that are logs, in words: "a .csv or .parquet file".
pub(super) fn files() -> String {
    let endings = FORMATS.iter().filter_map(|format| match format.place {
        Place::File(ending) => Some(format!(".{ending}")),
        Place::Folder(_) => None,
    });
    let endings: Vec<String> = endings.collect();
    match endings.split_last() {
        Some((last, others)) if !others.is_empty() => format!("a {} or {last} file", others.join(", ")),
        _ => format!("a {} file", endings.concat()),
    }
}

/// What other programs' files are, and how they become logs.
const CONVERTERS: [(&str, &str); 7] = [
    (
        "ulg",
        "a PX4 log: `ulog2csv FILE` (Python package pyulog) writes its topics as CSV; join those that are needed into one table",
    ),
    (
        "bin",
        "an ArduPilot log: `mavlogdump.py --format csv --types ATT FILE` (Python package pymavlink) writes a message type as CSV",
    ),
    ("gz", "compressed: `gunzip FILE` first"),
    ("zip", "compressed: unpack it first"),
    ("mat", "a MATLAB file: `writetable` writes CSV"),
    ("xlsx", "a spreadsheet: save it as CSV"),
    ("bag", "a ROS bag: `rostopic echo -b FILE -p TOPIC` writes CSV"),
];

/// How a file of another program becomes a log.
pub(super) fn converter(path: &Path) -> Option<&'static str> {
    let ending = ending(path);
    CONVERTERS.iter().find(|known| known.0 == ending).map(|known| known.1)
}
