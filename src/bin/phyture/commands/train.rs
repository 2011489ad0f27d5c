//! `train`: the residual network of a calibrated model.

use crate::arguments::{Data, Division, count};
use crate::context::{Context, data_sha256, interruption};
use crate::output::Progress;
use phyture::critique::digits::significant;
use phyture::critique::wrap::wrapped;
use phyture::flight::Column;
use phyture::hybrid::Hybrid;
use phyture::physics::Model;
use phyture::train::{Begun, Ended, Event, Report, RunFolder, TrainConfig, Trained, Training};
use phyture::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Train the residual network; crash-safe checkpoints, Ctrl-C saves
///
/// Without a configuration: a history of 128 samples, width 32, 20 epochs, a window every 12 samples. On two cores and 20 min of
/// flight at 100 Hz that takes a few minutes. With --paper: a history of 1000 samples, width 64, 100 epochs, a window every 50
/// samples; days on two cores. After each epoch the loss on the validation part (of the split `segments`) is shown.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture train flights -m n9-calibrated.toml -o run\n  phyture train flights -m n9-calibrated.toml -o run --resume\n  phyture train --print-config > train.toml\n  phyture train flights -m n9-calibrated.toml -o run --config train.toml --epochs 5"
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Option<Data>,
    /// Calibrated model file
    #[arg(short, long, required_unless_present = "print_config")]
    pub model: Option<PathBuf>,
    /// Run folder to write
    #[arg(short, long, required_unless_present = "print_config")]
    pub output: Option<PathBuf>,
    /// Training configuration (TOML); what it leaves out keeps the default
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The paper's sizes, stride and our reading of its epochs as defaults
    #[arg(long)]
    pub paper: bool,
    /// Passes over the training windows, 1 to 1000000, in place of the configuration's
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count(1..=TrainConfig::MOST_EPOCHS))]
    pub epochs: Option<usize>,
    /// Train nothing; print the configuration in force as commented TOML, for --config
    #[arg(long)]
    pub print_config: bool,
    /// Go on from the run folder's last checkpoint
    #[arg(long)]
    pub resume: bool,
    /// What trains and what tests.
    #[command(flatten)]
    pub division: Division,
}

impl Args {
    /// The configuration in force: the file over the defaults, the command line over the file.
    fn config(&self, context: &Context) -> Result<TrainConfig> {
        let base = if self.paper { TrainConfig::default() } else { TrainConfig::in_minutes() };
        let file = self.config.as_deref();
        let mut config = file.map_or_else(|| Ok(base.clone()), |path| TrainConfig::read_over(path, &base))?;
        config.seed = context.common.seed.unwrap_or(config.seed);
        config.epochs = self.epochs.unwrap_or(config.epochs);
        config.check()?;
        Ok(config)
    }
}

/// Prints the configuration in force, on standard output whatever else is asked for.
fn print_config(context: &Context, config: &TrainConfig) -> Result<ExitCode> {
    match context.common.json {
        Some(_) => context.json(config)?,
        None => context.say(config.template()?.trim_end()),
    }
    Ok(ExitCode::SUCCESS)
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    network: PathBuf,
    parameters: usize,
    windows: usize,
    steps: u64,
    /// Of the network as it is written, on the windows that trained it, without dropout: mean of the squared errors, summed over the
    /// channels, (m/s²)² + (rad/s²)².
    training_loss: f64,
    /// The same on the validation part, which it was not trained on; none if the split has no validation part.
    validation_loss: Option<f64>,
    validation_windows: usize,
    /// Mean over the steps of the last epoch, dropout on; none if a finished run was gone on with.
    last_epoch_loss: Option<f64>,
    seconds: f64,
}

/// Trains on the training part, with checkpoints, until the end or Ctrl-C.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let config = wanted.config(context)?;
    if wanted.print_config {
        return print_config(context, &config);
    }
    let (Some(data), Some(model), Some(output)) = (&wanted.data, &wanted.model, &wanted.output) else {
        return Err(Error::Config {
            place: "command line".into(),
            field: "DATA".into(),
            found: "nothing".into(),
            expected: "the flights to train on: phyture train DATA -m MODEL -o RUN".into(),
        });
    };
    let folder = RunFolder::create(output)?;
    if !wanted.resume && folder.is_begun() {
        context.existing().refuse(output, "a training run (which --resume goes on with)")?;
    }
    let set = context.flights(data, config.network.history())?;
    let model = Model::read(model)?;
    let split = context.split(&set.flights, &model, &wanted.division)?;
    let identity = format!("{}\n{}\n{split:?}", data_sha256(&set), model.to_toml()?);
    let interrupted = interruption()?;
    let training = Training {
        flights: &set.flights,
        split: &split,
        model: &model,
        config: &config,
        data: digest(&identity),
        folder: &folder,
        with_losses: true,
        threads: context.threads(),
    };
    let output = Told { training, resume: wanted.resume, interrupted: &interrupted }.run(context)?;
    context.json(&output)?;
    Ok(ExitCode::SUCCESS)
}

/// The epoch under way, for the display.
#[derive(Default)]
struct Epoch {
    number: usize,
    sum: f64,
    steps: u32,
    /// Of the last epoch that ended.
    validation: Option<f64>,
}

impl Epoch {
    fn take(&mut self, report: &Report) {
        if report.step.epoch != self.number {
            (self.number, self.sum, self.steps) = (report.step.epoch, 0.0, 0);
        }
        self.sum += report.step.loss;
        self.steps += 1;
        self.validation = report.validation_loss.or(self.validation);
    }

    /// Mean over its steps so far.
    fn loss(&self) -> Option<f64> {
        (self.steps > 0).then(|| self.sum / f64::from(self.steps))
    }
}

impl std::fmt::Display for Epoch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "epoch {}  loss {:.4}", self.number + 1, self.loss().unwrap_or(f64::NAN))?;
        self.validation.map_or(Ok(()), |loss| write!(f, "  validation {loss:.4}"))
    }
}

/// A training run, as it is told.
pub struct Told<'a> {
    /// What is done.
    pub training: Training<'a>,
    /// Go on from the checkpoint.
    pub resume: bool,
    /// Raised by Ctrl-C.
    pub interrupted: &'a AtomicBool,
}

/// What tells one set of training data from another, as a number.
pub fn digest(identity: &str) -> u64 {
    let digest = Sha256::digest(identity.as_bytes());
    u64::from_le_bytes(*digest.first_chunk().expect("it has 32 bytes"))
}

impl Told<'_> {
    /// Trains to the end, writes the network and reads back the hybrid.
    pub fn hybrid(&self, context: &Context) -> Result<Hybrid> {
        Hybrid::read(&self.run(context)?.network)
    }

    fn run(&self, context: &Context) -> Result<Output> {
        let Training { config, folder, data, .. } = self.training;
        let begun = Instant::now();
        let state = self.resume.then(|| folder.resume(config, data)).transpose()?;
        let mut epoch = Epoch::default();
        let mut progress = None;
        let ended = self.training.run(state, &mut |event| {
            match event {
                Event::Begins(begun) => {
                    say_begun(context, config, &begun);
                    if !self.resume {
                        // Only now does the old run go, if there is one: everything that the new one needs has been read.
                        folder.clear()?;
                    }
                    progress = Some(Progress::new("training", begun.steps, begun.done));
                }
                Event::Step(report) => {
                    epoch.take(report);
                    let progress = progress.as_mut().expect("a run begins before its steps");
                    progress.at(report.step.step, || format!("{epoch}  rate {:.2e}", report.step.rate));
                }
            }
            Ok(!self.interrupted.load(Ordering::Relaxed))
        })?;
        drop(progress);
        match ended {
            Ended::Trained(trained) => write(context, folder, &trained, epoch.loss(), begun),
            Ended::Stopped { done, steps } => {
                let saved = format!("saved after step {done} of {steps} in {}; go on with --resume", folder.checkpoint().display());
                Err(Error::Interrupted { saved })
            }
        }
    }
}

fn say_begun(context: &Context, config: &TrainConfig, begun: &Begun) {
    context.say(format!(
        "\n{} parameters; {} windows of {} samples, {} steps of up to {} windows in {} epochs; {}",
        begun.parameters,
        begun.windows,
        config.network.history(),
        begun.steps,
        config.batch,
        config.epochs,
        match begun.validation_windows {
            0 => "this split has no validation part".to_owned(),
            windows => format!("{windows} windows validate"),
        }
    ));
}

/// Says how far measurements may lie from what the network predicts.
fn say_intervals(context: &Context, hybrid: &Hybrid) {
    let Some(intervals) = &hybrid.description().intervals else {
        return context.say("no prediction intervals: too few blocks of flight were kept from training (`interval_every`)");
    };
    let (windows, blocks) = intervals.made_from();
    let shown: Vec<String> = intervals
        .typical()
        .pairs()
        .map(|(channel, half)| format!("{} ±{} {}", channel.name(), significant(*half, 2), channel.unit()))
        .collect();
    context.say(wrapped(
        "",
        &format!(
            "{:.0} % intervals in typical motion, from {windows} windows in {blocks} blocks kept from training: {}",
            100.0 * intervals.coverage(),
            shown.join(", ")
        ),
    ));
}

/// Writes the network and says what came of it.
fn write(context: &Context, folder: &RunFolder, trained: &Trained, last_epoch_loss: Option<f64>, begun: Instant) -> Result<Output> {
    let Trained { hybrid, begun: Begun { parameters, windows, validation_windows, steps, .. }, gate_windows, losses } = trained;
    let losses = losses.expect("they were asked for");
    if *gate_windows > 0 {
        let factors = Column::TARGETS.iter().zip(hybrid.description().gate);
        let shown: Vec<String> = factors.map(|(column, factor)| format!("{} {factor:.2}", column.name())).collect();
        context.say(format!("gate, from {gate_windows} windows kept from training: {}", shown.join("  ")));
    }
    say_intervals(context, hybrid);
    hybrid.write(&folder.network())?;
    let validation = losses.validation.map_or("none, no validation part".to_owned(), |loss| format!("{loss:.4}"));
    let seconds = begun.elapsed().as_secs_f64();
    context.say(format!(
        "trained in {seconds:.0} s: {}, training loss {:.4}, validation loss {validation}",
        folder.network().display(),
        losses.training
    ));
    Ok(Output {
        network: folder.network(),
        parameters: *parameters,
        windows: *windows,
        steps: *steps,
        training_loss: losses.training,
        validation_loss: losses.validation,
        validation_windows: *validation_windows,
        last_epoch_loss,
        seconds,
    })
}
