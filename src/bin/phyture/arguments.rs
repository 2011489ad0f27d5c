//! Options that several commands share, and how their values are read. A command's own options are in the command's file.

use clap::Args;
use clap::builder::RangedU64ValueParser;
use phyture::flight::split::Protocol;
use phyture::tape::Threads;
use phyture::train::TrainConfig;
use phyture::workflow;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Samples between windows.
pub const STRIDES: RangeInclusive<usize> = 1..=TrainConfig::MOST_STRIDE;

/// Steps of a rollout.
pub const HORIZONS: RangeInclusive<usize> = 1..=100_000;

/// A count in a range, which the error message states.
pub fn count(range: RangeInclusive<usize>) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(*range.start() as u64..=*range.end() as u64)
}

/// Options of every command.
#[derive(Args)]
pub struct Common {
    /// Write the machine-readable result to FILE, `-` for standard output
    #[arg(long, global = true, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Seed of everything random [default: 2030]
    #[arg(long, global = true)]
    pub seed: Option<u64>,
    /// Threads to work on, at most 1024; 0 is all cores [default: 0]
    #[arg(long, global = true, allow_negative_numbers = true, value_parser = count(0..=Threads::MOST))]
    pub threads: Option<usize>,
    /// Overwrite what is there already
    #[arg(long, global = true)]
    pub force: bool,
    /// Say everything: each note on the data, each effect that was tried and why it was not named
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but warnings and errors, on standard error; results go to the files that were asked for
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// Where the flights are and how to read them.
#[derive(Args)]
pub struct Data {
    /// Data folder, DATA/<manoeuvre>/<flight>.csv; or one CSV, Parquet, PX4 or ArduPilot log
    pub data: PathBuf,
    /// Description of logs that differ from the canonical form [default: DATA/dataset.toml if there is one]
    #[arg(long, value_name = "FILE")]
    pub dataset: Option<PathBuf>,
    /// Turn a flight with gaps in its time into several flights
    #[arg(long)]
    pub split_at_gaps: bool,
    /// Flight to leave out, by its name, or `suspects`: all of which `check` says that they are read otherwise than the rest; repeatable
    #[arg(long, value_name = "FLIGHT")]
    pub leave_out: Vec<String>,
}

/// What trains and what tests.
#[derive(Args)]
pub struct Division {
    /// Manoeuvre class or flight that is never trained on; repeatable; adds to `locked` of the model file
    #[arg(long, value_name = "NAME")]
    pub lock: Vec<String>,
    /// Without locked flights: `segments` (random 10-s segments, 70/20/10), `stretches` (of 30 s) or `first SHARE` [default: the model file's, or segments]
    #[arg(long)]
    pub split: Option<Protocol>,
}

impl Division {
    /// As the library takes it.
    pub fn wanted(&self) -> workflow::Division {
        workflow::Division { lock: self.lock.clone(), split: self.split.clone() }
    }
}
