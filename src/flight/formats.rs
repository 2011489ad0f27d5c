//! The formats of logs that are read: one line each in [`FORMATS`], and a file that knows the format.
//!
//! Listing, messages and reading ask this list. What a file holds is the business of the format's own file.

use super::assemble::{Assembled, Cuts, assemble};
use super::join::{Joined, Stream, Turn, join};
use super::listing::Log;
use super::schema::Schema;
use super::source::Read;
use super::table::{RawTable, fault};
use super::{Description, stanford, table};
use crate::error::{Error, Result};
use std::path::Path;

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

/// A format of logs.
pub(super) struct Format {
    /// What its file is, in words: "a CSV file".
    pub kind: &'static str,
    pub place: Place,
    /// What the format states by itself, in the words of `dataset.toml`; in force below the one of the data set.
    pub description: Option<&'static str>,
    pub reader: Reader,
}

/// All of them.
pub(super) static FORMATS: &[Format] = &[
    table::CSV,
    #[cfg(feature = "parquet")]
    super::parquet::PARQUET,
    #[cfg(not(feature = "parquet"))]
    Format::left_out("a Parquet file", "parquet", "parquet"),
    super::ulog::ULOG,
    super::dataflash::DATAFLASH,
    stanford::FORMAT,
];

impl Format {
    #[cfg(not(feature = "parquet"))]
    const fn left_out(kind: &'static str, ending: &'static str, feature: &'static str) -> Self {
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

/// The description of logs whose format has one of its own: what `stated` says, and below that what the format does. `None` where no log's format
/// has one.
///
/// # Errors
/// [`crate::Error::Log`] for logs of such a format beside logs of another: a description holds for one.
pub(super) fn description(path: &Path, logs: &[Log], stated: &str) -> Result<Option<String>> {
    let Some(first) = logs.iter().find(|log| log.format.description.is_some()) else { return Ok(None) };
    let own = first.format.description.unwrap_or_default();
    if let Some(other) = logs.iter().find(|log| !std::ptr::eq(log.format, first.format)) {
        let found = format!("{} beside {}: {} and {}", first.format.kind, other.format.kind, first.name, other.name);
        let expected = "logs of one format, or folders for each; dataset.toml can `exclude` files";
        return Err(fault(path, found, expected));
    }
    let unusual = || fault(path, "a dataset.toml in an unusual form", "one key a line, and sections as `[columns]`");
    Ok(Some(below(stated, own).ok_or_else(unusual)?))
}

/// A description with the keys of another that it does not state.
fn below(stated: &str, other: &str) -> Option<String> {
    let mut made = Description::parse(stated)?;
    let own = made.clone();
    let has = |names: &[&str]| names.iter().any(|name| own.get("columns", name).is_some());
    let (angles, quaternion) = (["roll", "pitch", "yaw"], ["q1", "q2", "q3", "q4"]);
    // Whichever attitude is stated stands alone: angles would go before a quaternion.
    let unwanted: &[&str] = if has(&quaternion) { &angles } else { &[] };
    for (key, value) in other.parse::<toml::Table>().ok()? {
        match value {
            toml::Value::Table(inside) => {
                for (name, value) in inside {
                    let is_unwanted = key == "columns" && unwanted.contains(&name.as_str());
                    if own.get(&key, &name).is_none() && !is_unwanted {
                        made = made.with(&key, &name, &value, "")?;
                    }
                }
            }
            value if own.get("", &key).is_none() => made = made.with("", &key, &value, "")?,
            _ => {}
        }
    }
    Some(made.text().to_owned())
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
const CONVERTERS: [(&str, &str); 5] = [
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_description_states_goes_before_what_the_format_says() {
        let format = "axes = \"NED/FRD\"\nresample_hz = 100\n[columns]\nroll = \"ATT.Roll\"\nu1 = \"RATE.ROut\"\n[units]\nangles = \"deg\"\n";
        let made = below("# mine\nresample_hz = 50\n[columns]\nq1 = \"XKQ.Q1\"\n", format);
        let expected = "# mine\nresample_hz = 50\naxes = \"NED/FRD\"\n[columns]\nq1 = \"XKQ.Q1\"\nu1 = \"RATE.ROut\"\n\n[units]\nangles = \"deg\"\n";
        assert_eq!(made.as_deref(), Some(expected));
    }

    #[test]
    fn each_ending_is_in_the_list_once() {
        let endings: Vec<&str> =
            FORMATS.iter().filter_map(|format| if let Place::File(own) = format.place { Some(own) } else { None }).collect();
        assert_eq!(endings, ["csv", "parquet", "ulg", "bin"]);
        assert_eq!(files(), "a .csv, .parquet, .ulg or .bin file");
        assert!(of_file(Path::new("a/LOG.BIN")).is_some() && of_file(Path::new("a/log")).is_none());
    }
}
