//! What is fuzzed: a function for each reader of what may come from anywhere.
//!
//! Each takes any bytes, and panics where a promise of `SECURITY.md` is broken: where a reader panics, where an error does not say of which file it
//! is, where what was read is written and reads back as something else. How much memory a reading takes is watched by whoever calls. Nothing here
//! knows of a fuzzer: `tests/hostile_files.rs` calls the same functions on what was found.

mod logs;
mod models;
mod networks;
mod seeds;
mod studio;

pub use seeds::{hostile, seeds};

use phyture::Error;
use phyture::flight::Flight;
use phyture::sim::{Level, Simulation, simulate};
use std::path::PathBuf;
use std::sync::OnceLock;

/// Reads any bytes, and tells whether the reader took them.
pub type Target = fn(&[u8]) -> bool;

/// The functions, by the names of their folders in `fixtures/hostile`.
pub const TARGETS: [(&str, Target); 14] = [
    ("csv", logs::csv),
    ("parquet", logs::parquet),
    ("ulog", logs::ulog),
    ("dataflash", logs::dataflash),
    ("stanford", logs::stanford),
    ("dataset", logs::dataset),
    ("formula", models::formula),
    ("model", models::model),
    ("training", networks::training),
    ("network", networks::network),
    ("description", networks::description),
    ("checkpoint", networks::checkpoint),
    ("requests", studio::requests),
    ("http", studio::http),
];

/// Memory that one reading may take, bytes: that of the longest delays which a formula may have, 10⁷ samples of 16 bytes. All else takes some million;
/// the inputs have some thousand bytes, so whatever takes more believes a size.
pub const MOST_BYTES: usize = 192 << 20;

/// Time between two samples, s.
const STEP_S: f64 = 0.01;

/// A folder for one reading.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// A file in it, and the folders on the way.
    fn put(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.path(name);
        path.parent().map_or(Ok(()), std::fs::create_dir_all).expect("a folder in the temporary folder");
        std::fs::write(&path, content).expect("a file in the temporary folder");
        path
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// An error says in which of these files it is. Nothing was taken then.
fn check_error(error: &Error, files: &[&str]) -> bool {
    let text = error.to_string();
    assert!(files.iter().any(|file| text.contains(file)), "an error that names none of {files:?}: {text} ({error:?})");
    false
}

/// Half a second of a simulated flight.
fn flight() -> &'static Flight {
    static FLIGHT: OnceLock<Flight> = OnceLock::new();
    FLIGHT.get_or_init(|| {
        let simulation = Simulation { minutes: 0.2, seed: 7, level: Level::QUIET, ..Simulation::baseline() };
        let set = simulate(&simulation).expect("a simulated flight");
        set.flights.first().and_then(|flight| flight.slice(300..350, "a")).expect("half a second of it")
    })
}

/// Whether the two hold the same numbers, to the bit.
fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
