//! The formats of logs that are read: one line each in [`FORMATS`], and a file that knows the format.
//!
//! Listing, messages and reading ask this list. What a file holds is the business of the format's own file.

use super::format::{Format, Log, Place};
use super::table::fault;
use super::{Description, csv, stanford};
use crate::error::Result;
use std::path::Path;

/// All of them.
pub(super) static FORMATS: &[Format] = &[
    csv::CSV,
    #[cfg(feature = "parquet")]
    super::parquet::PARQUET,
    #[cfg(not(feature = "parquet"))]
    Format::left_out("a Parquet file", "parquet", "parquet"),
    super::ulog::ULOG,
    super::dataflash::DATAFLASH,
    stanford::FORMAT,
];

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
            toml::Value::Table(mut inside) => {
                inside.retain(|name, _| !(key == "columns" && unwanted.contains(&name)) && own.get(&key, name).is_none());
                // Every key by itself would be read back by itself.
                if own.get("", &key).is_none() && !inside.is_empty() {
                    made = made.with_section(&key, &inside)?;
                    continue;
                }
                for (name, value) in inside {
                    made = made.with(&key, &name, &value, "")?;
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
