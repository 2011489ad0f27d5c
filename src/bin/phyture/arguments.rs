//! The commands and their options, as `phyture <command> --help` shows them.

use crate::commands::Shard;
use clap::builder::RangedU64ValueParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use phyture::flight::split::Protocol;
use phyture::hybrid::linear::LinearConfig;
use phyture::protocol::{Settings, TableId};
use phyture::tape::Threads;
use phyture::train::TrainConfig;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Longest simulated flight time, minutes: a day, 2 GB of memory.
const MOST_MINUTES: f64 = 1440.0;

/// Most tasks of a job array, and effects that a search names.
const MOST_SHARDS: usize = 10_000;
const MOST_EFFECTS: usize = 100;

/// Samples between windows.
const STRIDES: RangeInclusive<usize> = 1..=TrainConfig::MOST_STRIDE;

/// A count in a range, which the error message states.
fn count(range: RangeInclusive<usize>) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(*range.start() as u64..=*range.end() as u64)
}

/// A flight time.
fn minutes(text: &str) -> Result<f64, String> {
    let minutes = text.parse::<f64>().map_err(|error| error.to_string())?;
    if minutes > 0.0 && minutes <= MOST_MINUTES {
        Ok(minutes)
    } else {
        Err(format!("expected more than 0 and at most {MOST_MINUTES}"))
    }
}

/// A factor.
fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().map_err(|error| error.to_string())?;
    if number.is_finite() { Ok(number) } else { Err("expected a finite number".into()) }
}

/// Where to begin, and what a script has to know.
const HELP: &str = "\
Start with: phyture demo

Exit codes: 0 done; 2 bad usage or bad input; 3 a check failed (its report is written); 130 interrupted (state saved).
With --json a failure is JSON too: { \"schema\": 1, \"error\": { \"kind\", \"message\" }, \"exit_code\" }.";

/// Calibrate a first-principles model of an unmanned helicopter on recorded flights, see where it fails, and learn the rest.
#[derive(Parser)]
#[command(version, about, max_term_width = 110, after_help = HELP)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Options of every command.
    #[command(flatten)]
    pub common: Common,
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
    /// Data folder, DATA/<manoeuvre>/<flight>.csv; or one CSV or Parquet file
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
    /// Without locked flights: `segments` (random 10-s segments, 70/20/10) or `first SHARE` [default: the model file's, or segments]
    #[arg(long)]
    pub split: Option<Protocol>,
}

/// The commands.
#[derive(Subcommand)]
pub enum Command {
    /// The whole story on built-in data: hidden effects found, added, the rest learned, judged on flights that nothing saw
    #[command(after_help = "Example:\n  phyture demo --out demo\n  phyture demo --quick        # two minutes, a smaller network")]
    Demo {
        /// Folder for data, models and the report
        #[arg(long, default_value = "phyture-demo")]
        out: PathBuf,
        /// A smaller data set and a shorter training
        #[arg(long)]
        quick: bool,
    },
    /// Flights of the built-in truth helicopter
    #[command(
        after_help = "Examples:\n  phyture simulate flights --minutes 30 --seed 7\n  phyture simulate flights --baseline --hide ground_effect --hide cyclic_lag=0.5\n  phyture simulate flights --like stanford\n  phyture simulate flights --level 2 --wind 5 --explainable floor"
    )]
    Simulate {
        /// Folder to write
        dir: PathBuf,
        /// Flight time, minutes, at most 1440
        #[arg(long, default_value_t = 30.0, allow_negative_numbers = true, value_parser = minutes)]
        minutes: f64,
        /// Switch one effect on in the truth that the model file beside the data does not list; EFFECT or EFFECT=SCALE; repeatable
        #[arg(long, value_name = "EFFECT[=SCALE]")]
        hide: Vec<String>,
        /// Switch every mechanism off but those of --hide: the truth is then the paper's baseline, gusts and noise
        #[arg(long)]
        baseline: bool,
        /// `stanford`: 20 manoeuvre classes and 7376 s, as the paper's data
        #[arg(long, value_name = "SET", value_parser = ["stanford"])]
        like: Option<String>,
        /// Layout of the files: canonical CSV or the Stanford set's own
        #[arg(long, default_value = "csv", value_parser = ["csv", "stanford"])]
        layout: String,
        /// Disturbances, noise and smoothing: `quiet` has none; 0 white gusts and little noise; 1 gusts that last, and noise; 2 the same
        /// smoothed [default: 2, with --baseline or --hide 0]
        #[arg(long, value_name = "LEVEL", value_parser = ["quiet", "0", "1", "2"])]
        level: Option<String>,
        /// Scale of the instrument noise [default: the level's, 0.3 at level 0, else 1]
        #[arg(long, value_name = "SCALE")]
        noise: Option<f64>,
        /// Mean wind of every flight from anywhere, m/s [default: 3, with --baseline or --hide 0]
        #[arg(long, value_name = "M_S")]
        wind: Option<f64>,
        /// Folder for the explainable part of each flight, without gusts, turbulence and noise: --explainable of `compare`, `diagnose`
        /// and `loop` then shows the floor that no model can go below
        #[arg(long, value_name = "DIR")]
        explainable: Option<PathBuf>,
    },
    /// Conventions, timing and excitation of a data set; exit code 3 on a convention fault
    #[command(
        after_help = "Examples:\n  phyture check flights --json check.json\n  phyture check flights --suggest flights/dataset.toml"
    )]
    Check {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file [default: DATA/model.toml if there is one]
        #[arg(short, long)]
        model: Option<PathBuf>,
        /// Write a dataset.toml that mends what is at fault, on top of the one in force; where it takes the name of that one, the old one is kept
        /// beside it
        #[arg(long, value_name = "FILE")]
        suggest: Option<PathBuf>,
    },
    /// Least squares of the model's coefficients on the training part
    #[command(after_help = "Example:\n  phyture calibrate flights -m n9.toml -o n9-calibrated.toml")]
    Calibrate {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
        #[arg(short, long)]
        model: Option<PathBuf>,
        /// Calibrated model file to write
        #[arg(short, long)]
        output: PathBuf,
        /// What trains and what tests.
        #[command(flatten)]
        division: Division,
    },
    /// Measured against predicted for each model given, per channel, manoeuvre and regime
    #[command(
        after_help = "Examples:\n  phyture compare flights -m n9-calibrated.toml -n run --report report\n  phyture compare flights -m n9-calibrated.toml --explainable floor     # simulated flights: with the floor"
    )]
    Compare {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file; repeatable
        #[arg(short, long, required_unless_present = "network")]
        model: Vec<PathBuf>,
        /// Trained network: a run folder; repeatable
        #[arg(short, long)]
        network: Vec<PathBuf>,
        /// Folder for the page comparison.html
        #[arg(long, value_name = "DIR")]
        report: Option<PathBuf>,
        /// Samples between evaluated windows [default: 1, or what lets the networks take about a minute]
        #[arg(long, allow_negative_numbers = true, value_parser = count(STRIDES))]
        stride: Option<usize>,
        /// Evaluate every flight, also those that were trained on
        #[arg(long)]
        all: bool,
        /// Add a ridge regression on so many lags (1 to 157), fitted on the training part, as a further row
        #[arg(long, value_name = "LAGS", allow_negative_numbers = true, value_parser = count(1..=LinearConfig::MOST_LAGS))]
        ridge: Option<usize>,
        /// Show how far each network's prediction moves with the intervals of its model's coefficients
        #[arg(long, requires = "network")]
        uncertainty: bool,
        /// Explainable part of simulated flights, as `simulate --explainable` writes it: adds the floor that no model can go below
        #[arg(long, value_name = "DIR")]
        explainable: Option<PathBuf>,
        /// What trains and what tests.
        #[command(flatten)]
        division: Division,
    },
    /// Which physical effect is missing, and how sure that is; exit code 3 on a convention fault
    ///
    /// Effects that are found are one list, the largest first, each with what of the error on flights that no search has seen would come
    /// back if it alone were taken away.
    #[command(
        after_help = "Examples:\n  phyture diagnose flights -m n9.toml --report report --json diagnosis.json\n  phyture diagnose flights -m n9.toml --explainable floor     # simulated flights: how much could be removed at all"
    )]
    Diagnose {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]; effects switched off in it are tried too
        #[arg(short, long)]
        model: Option<PathBuf>,
        /// Search what a trained network learned (a run folder), in place of the measured accelerations; the run's model unless one is given
        #[arg(long, value_name = "RUN")]
        of_network: Option<PathBuf>,
        /// Folder for the page diagnosis.html
        #[arg(long, value_name = "DIR")]
        report: Option<PathBuf>,
        /// Stop after so many effects, one found after the other; without it, where much is missing, all effects that apply are fitted at once
        /// and the needless left out
        #[arg(long, allow_negative_numbers = true, value_parser = count(1..=MOST_EFFECTS))]
        max_effects: Option<usize>,
        /// Explainable part of simulated flights, as `simulate --explainable` writes it: shows the floor of the error on flights that no search
        /// has seen, and how much of what lies above it the effects remove
        #[arg(long, value_name = "DIR", conflicts_with = "of_network")]
        explainable: Option<PathBuf>,
        /// What is searched and what only confirms.
        #[command(flatten)]
        division: Division,
    },
    /// Diagnose, add, calibrate, until nothing worthwhile is left; appends to a ledger beside the model
    ///
    /// All effects that were added are one list, the largest first; the errors before and after, by channel, are the last table. Every round by
    /// itself is in the JSON, in the page and, with --verbose, in the text.
    #[command(
        after_help = "Examples:\n  phyture loop flights -m n9.toml -o n9-amended.toml --report report\n  phyture loop flights -m n9.toml -o n9-amended.toml --explainable floor     # simulated flights"
    )]
    Loop {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
        #[arg(short, long)]
        model: Option<PathBuf>,
        /// Model file to write; the ledger is beside it, ending in `.ledger.jsonl`
        #[arg(short, long)]
        output: PathBuf,
        /// Folder for the page diagnosis.html
        #[arg(long, value_name = "DIR")]
        report: Option<PathBuf>,
        /// Explainable part of simulated flights, as `simulate --explainable` writes it: shows the floor of the error on flights that no search
        /// has seen, and how much of what lies above it the effects remove
        #[arg(long, value_name = "DIR")]
        explainable: Option<PathBuf>,
        /// What is searched and what only confirms.
        #[command(flatten)]
        division: Division,
    },
    /// Train the residual network; crash-safe checkpoints, Ctrl-C saves
    ///
    /// Without a configuration: a history of 128 samples, width 32, 20 epochs, a window every 12 samples. On two cores and 20 min of
    /// flight at 100 Hz that takes a few minutes. With --paper: a history of 1000 samples, width 64, 100 epochs, a window every 50
    /// samples; days on two cores. After each epoch the loss on the validation part (of the split `segments`) is shown.
    #[command(
        mut_arg("data", |data| data.required(false).required_unless_present("print_config")),
        after_help = "Examples:\n  phyture train flights -m n9-calibrated.toml -o run\n  phyture train flights -m n9-calibrated.toml -o run --resume\n  phyture train --print-config > train.toml\n  phyture train flights -m n9-calibrated.toml -o run --config train.toml --epochs 5"
    )]
    Train {
        /// Flights.
        #[command(flatten)]
        data: Option<Data>,
        /// Calibrated model file
        #[arg(short, long, required_unless_present = "print_config")]
        model: Option<PathBuf>,
        /// Run folder to write
        #[arg(short, long, required_unless_present = "print_config")]
        output: Option<PathBuf>,
        /// Training configuration (TOML); what it leaves out keeps the default
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        /// The paper's sizes, stride and our reading of its epochs as defaults
        #[arg(long)]
        paper: bool,
        /// Passes over the training windows, 1 to 1000000, in place of the configuration's
        #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count(1..=TrainConfig::MOST_EPOCHS))]
        epochs: Option<usize>,
        /// Train nothing; print the configuration in force as commented TOML, for --config
        #[arg(long)]
        print_config: bool,
        /// Go on from the run folder's last checkpoint
        #[arg(long)]
        resume: bool,
        /// What trains and what tests.
        #[command(flatten)]
        division: Division,
    },
    /// Predictions for every sample: of a network, where there is a full history; or of a model alone
    #[command(
        after_help = "Examples:\n  phyture predict flights -n run -o predictions.parquet\n  phyture predict flights -m n9-calibrated.toml -o physics.csv     # physics alone"
    )]
    Predict {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Model file: predicts alone without -n; with -n it has to be the run's own, which is taken where it is left out
        #[arg(short, long, required_unless_present = "network")]
        model: Option<PathBuf>,
        /// Run folder
        #[arg(short, long)]
        network: Option<PathBuf>,
        /// File to write: .csv or .parquet
        #[arg(short, long)]
        output: PathBuf,
        /// Samples between predictions
        #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_parser = count(STRIDES))]
        stride: usize,
    },
    /// The catalogue of physical effects; add one to a model
    #[command(
        after_help = "Examples:\n  phyture effect list\n  phyture effect show ground_effect\n  phyture effect add ground_effect -m n9.toml -o n9-ground.toml"
    )]
    Effect {
        /// What to do with it.
        #[command(subcommand)]
        command: EffectCommand,
    },
    /// Add a known effect to recorded flights, so that the truth is known under real noise
    #[command(
        after_help = "Examples:\n  phyture implant flights implanted --effect ground_effect --scale 2 -m n9-calibrated.toml\n  phyture implant flights implanted --effect rotor_droop --size k=-0.2 --size tau_s=0.5\n  phyture implant flights implanted --formula \"wx_dot = 1.5*sin(3*height)\""
    )]
    Implant {
        /// Flights.
        #[command(flatten)]
        data: Data,
        /// Folder to write
        dir: PathBuf,
        /// Effect of the catalogue
        #[arg(long, required_unless_present = "formula", conflicts_with = "formula")]
        effect: Option<String>,
        /// Something else: `channel = formula`
        #[arg(long, value_name = "FORMULA")]
        formula: Option<String>,
        /// Times its usual size
        #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_parser = finite)]
        scale: f64,
        /// A coefficient or parameter in place of the usual one; repeatable
        #[arg(long, value_name = "NAME=VALUE", conflicts_with = "formula")]
        size: Vec<String>,
        /// Calibrated model file [default: DATA/model.toml or the paper's baseline, calibrated on the flights]
        #[arg(short, long)]
        model: Option<PathBuf>,
    },
    /// The paper's tables: every method, on the same splits, with several seeds
    #[command(
        args_conflicts_with_subcommands = true,
        subcommand_negates_reqs = true,
        after_help = "Examples:\n  phyture benchmark flights -o bench --plan hour --table 1\n  phyture benchmark flights -o bench --plan hour --table 1 --resume   # after a kill\n  phyture benchmark flights -o bench --shard 2/8                       # one part of eight\n  phyture benchmark flights -o bench --emit slurm --shards 20 > array.sh\n  phyture benchmark collect bench"
    )]
    Benchmark {
        /// Finished runs to tables.
        #[command(subcommand)]
        command: Option<BenchmarkCommand>,
        /// Flights.
        #[command(flatten)]
        data: Option<Data>,
        /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
        #[arg(short, long)]
        model: Option<PathBuf>,
        /// Folder of the benchmark
        #[arg(short, long, required = true)]
        output: Option<PathBuf>,
        /// Table of the paper, 1 to 6, or `robustness`; repeatable [default: all]
        #[arg(long, value_name = "TABLE")]
        table: Vec<TableId>,
        /// Row of the tables by identifier, such as `timesnet`; repeatable [default: all]
        #[arg(long, value_name = "METHOD")]
        method: Vec<String>,
        /// Seeds of each network, at most 1000 [default: the plan's]
        #[arg(long, allow_negative_numbers = true, value_parser = count(1..=Settings::MOST_SEEDS))]
        seeds: Option<usize>,
        /// Budget: the paper's (days), an hour's for table 1, or one that only shows that it works
        #[arg(long, value_enum, default_value_t = Plans::Paper)]
        plan: Plans,
        /// Training configuration (TOML) in place of the plan's: sizes of Phy-Ture, inputs, epochs, strides
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
        /// Make one part of the plan: every N-th run, from the I-th
        #[arg(long, value_name = "I/N")]
        shard: Option<Shard>,
        /// Go on in a folder that holds runs of this plan
        #[arg(long)]
        resume: bool,
        /// Run nothing; print the script of a job array for this batch system, one task a shard, `--threads` processors each
        #[arg(long, value_name = "SYSTEM", value_parser = ["slurm"], conflicts_with = "shard")]
        emit: Option<String>,
        /// Tasks of the job array
        #[arg(long, default_value_t = 10, requires = "emit", allow_negative_numbers = true, value_parser = count(1..=MOST_SHARDS))]
        shards: usize,
    },
    /// The language of formulas: its operators, functions and names; or what a formula of yours is read as
    #[command(
        after_help = crate::commands::grammar()
    )]
    Formula {
        /// Formula to read
        formula: Option<String>,
    },
    /// Completions for a shell, to standard output
    #[command(after_help = "Example:\n  phyture completions bash > ~/.local/share/bash-completion/completions/phyture")]
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Manual pages, one a command
    #[command(after_help = "Example:\n  phyture man ~/.local/share/man/man1")]
    Man {
        /// Folder to write them to
        dir: PathBuf,
    },
    /// Forward, backward and an Adam step against the figures a file brings from PyTorch
    #[command(after_help = "Example:\n  phyture parity small_f32.safetensors --json -")]
    Parity {
        /// Safetensors file with weights, inputs, outputs and gradients
        file: PathBuf,
    },
}

/// What to do with the catalogue.
#[derive(Subcommand)]
pub enum EffectCommand {
    /// Every effect in a line
    List,
    /// The signals that effects read and change, which formulas of your own may read and change too
    Signals,
    /// All that is known about one effect
    Show {
        /// Effect
        effect: String,
    },
    /// Put an effect with coefficients 0 into a model file, to be calibrated
    Add {
        /// Effect
        effect: String,
        /// Model file
        #[arg(short, long)]
        model: PathBuf,
        /// Model file to write
        #[arg(short, long)]
        output: PathBuf,
    },
}

/// What to do with a benchmark's folder.
#[derive(Subcommand)]
pub enum BenchmarkCommand {
    /// The tables of all runs that are done
    Collect {
        /// Folder of the benchmark
        folder: PathBuf,
        /// Folders of the same plan whose runs are taken over first
        from: Vec<PathBuf>,
    },
}

/// How much of the paper's experiment is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Plans {
    /// The paper's sizes, 100 epochs, 10 seeds.
    Paper,
    /// Table 1 in an hour on two cores.
    Hour,
    /// A few minutes; the figures mean nothing.
    Quick,
}
