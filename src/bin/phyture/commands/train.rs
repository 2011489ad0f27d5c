//! `train`: the residual network of a calibrated model.

use super::{Context, data_sha256, interruption};
use crate::arguments::{Data, Division};
use crate::output::Progress;
use phyture::flight::split::Split;
use phyture::flight::{Column, DataSet};
use phyture::hybrid::Hybrid;
use phyture::physics::Model;
use phyture::train::{Job, Outcome, RunFolder, TrainConfig, Trainer};
use phyture::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What was asked for.
pub struct Wanted<'a> {
    /// Model file.
    pub model: &'a Path,
    /// Run folder.
    pub output: &'a Path,
    /// Training configuration.
    pub config: Option<&'a Path>,
    /// Go on from the checkpoint.
    pub resume: bool,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    network: PathBuf,
    parameters: usize,
    windows: usize,
    steps: u64,
    /// Mean loss over the steps of the last epoch, (m/s²)² + (rad/s²)².
    last_epoch_loss: f64,
    seconds: f64,
}

/// Trains on the training part, with checkpoints, until the end or Ctrl-C.
pub fn run(context: &Context, data: &Data, wanted: &Wanted, division: &Division) -> Result<ExitCode> {
    let mut config = wanted.config.map_or_else(|| Ok(TrainConfig::default()), TrainConfig::read)?;
    config.seed = context.common.seed.unwrap_or(config.seed);
    let folder = RunFolder::create(wanted.output)?;
    if !wanted.resume && folder.is_begun() {
        context.existing().refuse(wanted.output, "a training run (which --resume goes on with)")?;
        folder.clear()?;
    }
    let set = context.flights(data, config.network.history())?;
    let model = Model::read(wanted.model)?;
    let split = context.split(&set.flights, &model, division)?;
    let identity = format!("{}\n{}\n{split:?}", data_sha256(data)?, model.to_toml()?);
    let interrupted = interruption()?;
    let task = Task { set: &set, split: &split, model: &model, config: &config, identity: &identity, folder: &folder };
    let output = task.run(context, wanted.resume, &interrupted)?;
    context.json(&output)?;
    Ok(ExitCode::SUCCESS)
}

/// A training run, whoever asked for it.
pub struct Task<'a> {
    /// Flights.
    pub set: &'a DataSet,
    /// What trains.
    pub split: &'a Split,
    /// The calibrated model.
    pub model: &'a Model,
    /// Settings.
    pub config: &'a TrainConfig,
    /// Tells one set of training data from another when a run is resumed.
    pub identity: &'a str,
    /// Run folder.
    pub folder: &'a RunFolder,
}

impl Task<'_> {
    /// Trains to the end and reads back the hybrid.
    pub fn hybrid(&self, context: &Context, interrupted: &AtomicBool) -> Result<Hybrid> {
        Hybrid::read(&self.run(context, false, interrupted)?.network)
    }

    fn run(&self, context: &Context, resume: bool, interrupted: &AtomicBool) -> Result<Output> {
        let Task { set, split, model, config, identity, folder } = *self;
        let begun = Instant::now();
        let job = Job::new(&set.flights, split, model, config)?;
        let digest = Sha256::digest(identity.as_bytes());
        let digest = digest.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        let state = resume.then(|| folder.resume(config, digest)).transpose()?;
        let network = job.description.network(config.standardise_loss)?;
        let mut trainer = Trainer::new(config, &network, &job.sequences, &job.windows, state, context.threads())?;
        context.say(format!(
            "\n{} parameters; {} windows of {} samples, {} steps of up to {} windows in {} epochs",
            network.graph().parameter_count(),
            job.windows.len(),
            config.network.history(),
            trainer.steps(),
            config.batch,
            config.epochs
        ));
        let mut progress = Progress::new("training", trainer.steps(), trainer.state().step);
        let (mut sum, mut count, mut epoch) = (0.0, 0_u32, 0);
        let outcome = folder.train(config, digest, &mut trainer, &mut |report| {
            if report.step.epoch != epoch {
                (sum, count, epoch) = (0.0, 0, report.step.epoch);
            }
            sum += report.step.loss;
            count += 1;
            progress.at(report.step.step, || format!("loss {:.4}  rate {:.2e}", sum / f64::from(count), report.step.rate));
            !interrupted.load(Ordering::Relaxed)
        })?;
        drop(progress);
        if outcome == Outcome::Stopped {
            let saved = format!(
                "saved after step {} of {} in {}; go on with --resume",
                trainer.state().step,
                trainer.steps(),
                folder.checkpoint().display()
            );
            return Err(Error::Interrupted { saved });
        }
        let (steps, windows, kept) = (trainer.steps(), job.windows.len(), job.gate_windows.len());
        let parameters = trainer.state().parameters.clone();
        let hybrid = job.hybrid(&set.flights, parameters, context.threads())?;
        if kept > 0 {
            let factors = Column::TARGETS.iter().zip(hybrid.description().gate);
            let shown: Vec<String> = factors.map(|(column, factor)| format!("{} {factor:.2}", column.name())).collect();
            context.say(format!("gate, from {kept} windows kept from training: {}", shown.join("  ")));
        }
        hybrid.write(&folder.network())?;
        let last_epoch_loss = sum / f64::from(count.max(1));
        context.say(format!(
            "trained in {:.0} s, mean loss of the last epoch {last_epoch_loss:.4}; written to {}",
            begun.elapsed().as_secs_f64(),
            folder.network().display()
        ));
        Ok(Output {
            network: folder.network(),
            parameters: network.graph().parameter_count(),
            windows,
            steps,
            last_epoch_loss,
            seconds: begun.elapsed().as_secs_f64(),
        })
    }
}
