//! Hidden effects: data whose cause is known, and what `diagnose` says of them. A program, not a timed test.
//!
//!     cargo bench --features files,sim --bench hidden_effect                                  a few cases of each kind, some two minutes
//!     cargo bench --features files,sim --bench hidden_effect -- run OUT.jsonl [PART…]         everything, resumable; PART is singles, pairs, nulls, aliens,
//!                                                                        confusables or textbook; names of effects choose among singles
//!     cargo bench --features files,sim --bench hidden_effect -- development OUT.jsonl [PART…] the same on development seeds
//!     cargo bench --features files,sim --bench hidden_effect -- table OUT.jsonl               the tables
//!     cargo bench --features files,sim --bench hidden_effect -- implants DATA FIXTURES        known effects in recorded flights, described by the files in FIXTURES
//!
//! Each run is a line of JSON, appended; a run that is there already is not repeated. Truth comes from `sim/`, which shares no code
//! with the catalogue.

mod cases;
mod implants;
mod run;
mod tables;

use std::path::Path;

fn main() -> phyture::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["run", out, parts @ ..] => run::all(Path::new(out), parts, run::REPORTED),
        ["development", out, parts @ ..] => run::all(Path::new(out), parts, run::DEVELOPMENT),
        ["table", out] => tables::print(Path::new(out)),
        ["implants", data, fixtures] => implants::print(Path::new(data), Path::new(fixtures)),
        _ => {
            let out = std::env::temp_dir().join(format!("hidden_effect_{}.jsonl", std::process::id()));
            run::few(&out)?;
            tables::print(&out)?;
            std::fs::remove_file(&out).map_err(phyture::Error::io(&out))
        }
    }
}
