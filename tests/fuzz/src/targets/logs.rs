//! Recorded flights and their descriptions: whatever is accepted is made of finite numbers, and comes back the same when it is written.

use super::seeds::ULOG;
use super::{Folder, check_error, flight, same_bits};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight, guess, write};
use std::fmt::Write;
use std::sync::OnceLock;

/// Stands between the two files of a flight in the Stanford layout.
pub(super) const BETWEEN: &[u8] = b"=====\n";

/// A CSV log; one of an odd length is cut at gaps, and a description is guessed for one of an even length.
pub fn csv(bytes: &[u8]) -> bool {
    let folder = Folder::new();
    let path = folder.put("hover/log.csv", bytes);
    let is_odd = bytes.len() % 2 == 1;
    let is_taken = read(&folder, "hover", &["log.csv"], ReadOptions { split_at_gaps: is_odd, ..ReadOptions::default() });
    if is_odd {
        return is_taken;
    }
    match guess::guess(&path) {
        Ok(guess) => {
            let described = Some(guess.text);
            read(&folder, "hover", &["log.csv", "dataset.toml"], ReadOptions { described, ..ReadOptions::default() });
            is_taken
        }
        Err(error) => check_error(&error, &["log.csv"]),
    }
}

/// A Parquet log.
pub fn parquet(bytes: &[u8]) -> bool {
    let folder = Folder::new();
    folder.put("hover/log.parquet", bytes);
    read(&folder, "hover", &["log.parquet"], ReadOptions::default())
}

/// A PX4 log, whole or up to where it is damaged.
pub fn ulog(bytes: &[u8]) -> bool {
    streams("log.ulg", bytes)
}

/// An ArduPilot log, whole or up to where it is damaged.
pub fn dataflash(bytes: &[u8]) -> bool {
    streams("log.bin", bytes)
}

fn streams(name: &str, bytes: &[u8]) -> bool {
    let folder = Folder::new();
    folder.put(&format!("hover/{name}"), bytes);
    // Most of what a fuzzer makes is damaged somewhere.
    let described = Some("damaged = \"stop\"\nresample_hz = 50\n".into());
    read(&folder, "hover", &[name], ReadOptions { described, split_at_gaps: bytes.len() % 2 == 1, ..ReadOptions::default() })
}

/// A flight in the Stanford layout: states, a line, controls.
pub fn stanford(bytes: &[u8]) -> bool {
    let folder = Folder::new();
    let at = bytes.windows(BETWEEN.len()).position(|window| window == BETWEEN);
    let (states, controls) = at.map_or((bytes, &[][..]), |at| (&bytes[..at], &bytes[at + BETWEEN.len()..]));
    folder.put("a/smoother.txt", states);
    folder.put("a/controls.txt", controls);
    read(
        &folder,
        "a",
        &["smoother.txt", "controls.txt"],
        ReadOptions { split_at_gaps: bytes.len() % 2 == 1, ..ReadOptions::default() },
    )
}

/// A `dataset.toml`: one of an even length for a log in the canonical form that has columns beyond it, one of an odd length for a PX4 log, which says
/// much by itself.
pub fn dataset(bytes: &[u8]) -> bool {
    let folder = Folder::new();
    let (name, content) = if bytes.len().is_multiple_of(2) { ("log.csv", log().as_bytes()) } else { ("log.ulg", ULOG) };
    folder.put(&format!("data/hover/{name}"), content);
    folder.put("data/dataset.toml", bytes);
    read(&folder, "data", &["dataset.toml", name], ReadOptions::default())
}

/// The log that descriptions are tried on.
fn log() -> &'static str {
    static LOG: OnceLock<String> = OnceLock::new();
    LOG.get_or_init(|| {
        let flight = flight();
        let mut text = "t".to_owned();
        Column::ALL.iter().for_each(|column| text += &format!(",{}", column.name()));
        text += ",rpm,q1,q2,q3,q4,on\n";
        for row in 0..flight.len() {
            let values = Column::ALL.iter().map(|column| flight.column(*column)[row]);
            // Writing to a String does not fail.
            let _ = write!(text, "{:?}", flight.time_s(row));
            values.for_each(|value| text += &format!(",{value:?}"));
            let _ = writeln!(text, ",{},0,0,0,1,{}", 1500 + row, row % 3);
        }
        text
    })
}

/// Reads; an error names one of the files.
fn read(folder: &Folder, inside: &str, files: &[&str], options: ReadOptions) -> bool {
    match data_set(&folder.path(inside), &options) {
        Ok(data) => check(folder, &data),
        Err(error) => check_error(&error, files),
    }
}

/// What is accepted is finite throughout and survives a file.
fn check(folder: &Folder, data: &DataSet) -> bool {
    assert!(!data.flights.is_empty(), "a data set without a flight");
    for flight in &data.flights {
        let lengths = flight.extra.values().map(Vec::len);
        assert!(!flight.is_empty() && lengths.into_iter().all(|length| length == flight.len()), "columns of several lengths");
        assert!(flight.canonical().iter().all(|value| value.is_finite()), "a number that is none");
        assert!(flight.step_s > 0.0 && flight.step_s.is_finite() && flight.start_s.is_finite(), "a time that is none");
    }
    write::data_set_csv(&folder.path("again"), &data.flights).expect("what was read can be written");
    let again = data_set(&folder.path("again"), &ReadOptions::default()).expect("what was written can be read");
    assert_eq!(again.flights.len(), data.flights.len(), "flights that come back");
    for (flight, again) in data.flights.iter().zip(&again.flights) {
        check_same(flight, again);
    }
    true
}

fn check_same(flight: &Flight, again: &Flight) {
    assert!(flight.len() == again.len() && flight.absent == again.absent, "another shape of `{}`", flight.name);
    for column in Column::ALL {
        assert!(same_bits(flight.column(column), again.column(column)), "other numbers in `{}`", column.name());
    }
}
