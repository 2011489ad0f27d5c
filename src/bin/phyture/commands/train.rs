//! `train`: the residual network of a calibrated model.

use crate::arguments::{Data, Division, count};
use crate::context::{Context, interruption};
use crate::output::{Progress, warn};
use crate::pages::Pages;
use phyture::critique::digits::significant;
use phyture::critique::wrap::wrapped;
use phyture::hybrid::Hybrid;
use phyture::physics::Model;
use phyture::report::{TrainingReport, training_page};
use phyture::train::{Begun, Event, RunFolder, TrainConfig, Training, diverges_in};
use phyture::workflow::{Epoch, Run, TrainedNetwork, provenance, train, training_digest};
use phyture::{Error, Result};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Train the residual network; crash-safe checkpoints, Ctrl-C saves
///
/// Without a configuration: a history of 128 samples, width 32, 20 epochs, a window every 12 samples, and a gate that leaves to the
/// physics each channel in which the network brings nothing on flight that did not train. On two cores and 20 min of flight at 100 Hz
/// that takes a few minutes. With --paper: a history of 1000 samples, width 64, 100 epochs, a window every 50 samples, no gate; days
/// on two cores. After each epoch the loss on the validation part (of the split `segments`) is shown.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture train flights -m n9-calibrated.toml -o run\n  phyture train flights -m n9-calibrated.toml -o run --resume\n  phyture train flights -m n9-calibrated.toml -o run --report run/report\n  phyture train --print-config > train.toml\n  phyture train flights -m n9-calibrated.toml -o run --config train.toml --epochs 5"
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
    /// What is written for people to look at.
    #[command(flatten)]
    pub pages: Pages,
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
    let page = wanted.pages.open(context, "training.html")?;
    let folder = RunFolder::create(output)?;
    if !wanted.resume && folder.is_begun() {
        context.existing().refuse(output, "a training run (which --resume goes on with)")?;
    }
    let set = context.flights(data, config.network.history())?;
    let names = [model.display().to_string()];
    let model = Model::read(model)?;
    let split = context.split(&set.flights, &model, &wanted.division)?;
    let interrupted = interruption()?;
    let training = Training {
        flights: &set.flights,
        split: &split,
        model: &model,
        config: &config,
        data: training_digest(&set, &model, &split)?,
        folder: &folder,
        with_losses: true,
        threads: context.threads(),
    };
    let run = Told { training, resume: wanted.resume, interrupted: &interrupted }.run(context)?;
    if let Some(page) = page {
        let provenance = provenance("train", &data.data, &set, &names.each_ref().map(String::as_str), config.seed);
        let TrainedNetwork { curve, epoch, parameters, windows, validation_windows, .. } = &run.network;
        let report = TrainingReport {
            config: &config,
            curve,
            epoch: *epoch,
            parameters: *parameters,
            windows: [*windows, *validation_windows],
            provenance: &provenance,
        };
        page.write(context, &training_page(&report))?;
    }
    context.json(&run.network)?;
    Ok(ExitCode::SUCCESS)
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

impl Told<'_> {
    /// Trains to the end, writes the network and reads back the hybrid.
    pub fn hybrid(&self, context: &Context) -> Result<Hybrid> {
        Hybrid::read(&self.run(context)?.network.network)
    }

    fn run(&self, context: &Context) -> Result<Run> {
        let mut epoch = Epoch::default();
        let mut progress = None;
        let run = train(&self.training, self.resume, &mut |event| {
            match event {
                Event::Begins(begun) => {
                    say_begun(context, self.training.config, &begun);
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
        say_trained(context, &run);
        Ok(run)
    }
}

fn say_begun(context: &Context, config: &TrainConfig, begun: &Begun) {
    let rollouts = config.rollout.as_ref().map_or_else(String::new, |rollout| {
        format!(" and {} of {} rollouts of {} steps", rollout.starts.min(begun.rollouts), begun.rollouts, rollout.horizon)
    });
    context.say(format!(
        "\n{} parameters; {} windows of {} samples, {} steps of up to {} windows{} in {} epochs; {}",
        begun.parameters,
        begun.windows,
        config.network.history(),
        begun.steps,
        config.batch,
        rollouts,
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

/// Says what came of it.
fn say_trained(context: &Context, Run { hybrid, network }: &Run) {
    if let Some(gate) = network.gate_in_words() {
        context.say(wrapped("", &format!("gate: {gate}")));
    }
    say_intervals(context, hybrid);
    let validation = network.validation_loss.map_or("none, no validation part".to_owned(), |loss| format!("{loss:.4}"));
    context.say(format!(
        "trained in {:.0} s: {}, weights of epoch {} of {}, training loss {:.4}, validation loss {validation}",
        network.seconds,
        network.network.display(),
        network.epoch,
        network.curve.len(),
        network.training_loss
    ));
    if let Some(epoch) = diverges_in(network.curve.iter().map(|losses| losses.training)) {
        warn(&format!(
            "in epoch {} the training loss went up to more than twice the least before: the learning rate is too fast; set a `peak_rate` of a third in the \
             training configuration and train again",
            epoch + 1
        ));
    }
}
