//! The folder of a training run: its checkpoint, its metrics and the network it ends in; and the loop that keeps them.
//!
//! | file | content |
//! | --- | --- |
//! | `checkpoint.phyture` | state of the run, with the configuration and a digest of the data it belongs to |
//! | `metrics.jsonl` | one line a step; that of an epoch's last step has the validation loss, where the split has a validation part |
//! | `network.safetensors` | the trained hybrid, written when the run is at its end |
//!
//! Killed at any moment, a run loses at most what came after its last checkpoint, and no file is ever half written.

use super::config::TrainConfig;
use super::container;
use super::trainer::{EpochLoss, State, StepReport, Trainer};
use crate::disk::{Lock, write_atomically};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a checkpoint holds.
#[derive(Serialize, Deserialize)]
struct Checkpoint {
    /// Configuration as JSON: readable in the file, and compared on resuming.
    config: String,
    /// Digest of the prepared training data.
    data: u64,
    state: State,
}

const CHECKPOINT: &str = "checkpoint.phyture";
const NETWORK: &str = "network.safetensors";
const METRICS: &str = "metrics.jsonl";

/// What the last checkpoint says of its run.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpointed {
    /// Its configuration.
    pub config: TrainConfig,
    /// Digest of its training data.
    pub data: u64,
    /// Steps done.
    pub step: u64,
    /// Losses of the epochs that have ended.
    pub curve: Vec<EpochLoss>,
    /// Whether the network is written.
    pub is_finished: bool,
}

impl Checkpointed {
    /// Looks into a run's folder without holding it; none where no run was begun or the checkpoint is gone.
    ///
    /// # Errors
    /// [`Error::File`] if the checkpoint is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(CHECKPOINT);
        if !path.is_file() {
            return Ok(None);
        }
        let Checkpoint { config, data, state } = container::read(&path)?;
        let config = serde_json::from_str(&config)
            .map_err(|error| Error::File { path, message: format!("has a configuration that does not read: {error}") })?;
        let is_finished = folder.join(NETWORK).is_file();
        Ok(Some(Self { config, data, step: state.step, curve: state.curve, is_finished }))
    }
}

/// A run folder, held against other programs.
#[derive(Debug)]
pub struct RunFolder {
    folder: PathBuf,
    _lock: Lock,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All steps are done.
    Finished,
    /// The caller asked to stop; the state is in the checkpoint.
    Stopped,
}

/// What the caller is told after each step, and answers.
pub struct Report {
    /// The step.
    pub step: StepReport,
    /// Steps of the whole run.
    pub steps: u64,
    /// Losses of the epoch, after its last step.
    pub epoch_ended: Option<EpochLoss>,
}

impl RunFolder {
    /// The run folder at `folder`, made if it is not there. No other program works on it as long as this value lives.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made; [`Error::Busy`] if another program trains in it.
    pub fn create(folder: impl Into<PathBuf>) -> Result<Self> {
        let folder = folder.into();
        std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
        let lock = Lock::of_folder(&folder)?;
        Ok(Self { folder, _lock: lock })
    }

    /// Whether a run was begun here.
    pub fn is_begun(&self) -> bool {
        self.checkpoint().exists() || self.network().exists()
    }

    /// Removes what an earlier run left: its network must not stand beside the checkpoints of another.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be removed.
    pub fn clear(&self) -> Result<()> {
        let mut left = [self.network(), self.checkpoint(), self.metrics()].into_iter().filter(|path| path.exists());
        left.try_for_each(|path| std::fs::remove_file(&path).map_err(Error::io(path)))
    }

    /// The trained hybrid.
    pub fn network(&self) -> PathBuf {
        self.folder.join(NETWORK)
    }

    /// The checkpoint.
    pub fn checkpoint(&self) -> PathBuf {
        self.folder.join(CHECKPOINT)
    }

    fn metrics(&self) -> PathBuf {
        self.folder.join(METRICS)
    }

    /// The state of an interrupted run of this very configuration on these very data.
    ///
    /// # Errors
    /// [`Error::File`] if there is none, if it is damaged, or if it belongs to another configuration or other data.
    pub fn resume(&self, config: &TrainConfig, data: u64) -> Result<State> {
        let path = self.checkpoint();
        let fault = |message: &str| Error::File { path: path.clone(), message: message.into() };
        if !path.exists() {
            return Err(fault("there is no checkpoint to resume from; leave out --resume to begin a run"));
        }
        let checkpoint: Checkpoint = container::read(&path)?;
        if checkpoint.config != json(config)? {
            return Err(fault(&format!("belongs to another configuration: {}", checkpoint.config)));
        }
        if checkpoint.data != data {
            return Err(fault("belongs to other data, another model or another split than those given"));
        }
        Ok(checkpoint.state)
    }

    /// Trains until the end or until `go_on` says no, with a checkpoint every `config.checkpoint_s` seconds and at the end. Where the
    /// trainer has validation windows, they are judged after each epoch.
    ///
    /// # Errors
    /// What [`Trainer::step`] and writing give. On a diverged run the last good state is saved first.
    pub fn train(
        &self,
        config: &TrainConfig,
        data: u64,
        trainer: &mut Trainer,
        go_on: &mut dyn FnMut(&Report) -> bool,
    ) -> Result<Outcome> {
        let mut metrics = Metrics::open(&self.metrics(), trainer.state().step)?;
        let save =
            |state: &State| container::write(&self.checkpoint(), &Checkpoint { config: json(config)?, data, state: state.clone() });
        save(trainer.state())?;
        let (mut saved, begun) = (Instant::now(), Instant::now());
        loop {
            let step = match trainer.step() {
                Ok(Some(step)) => step,
                Ok(None) => break,
                Err(error) => {
                    save(trainer.state())?;
                    return Err(error);
                }
            };
            let ends_epoch = step.step.is_multiple_of(trainer.steps_an_epoch() as u64);
            let epoch_ended = ends_epoch.then(|| trainer.end_epoch()).transpose()?;
            metrics.line(&step, epoch_ended.and_then(|losses| losses.validation), begun.elapsed().as_secs_f64())?;
            let stop = !go_on(&Report { step, steps: trainer.steps(), epoch_ended });
            if stop || saved.elapsed().as_secs_f64() >= config.checkpoint_s {
                metrics.flush()?;
                save(trainer.state())?;
                saved = Instant::now();
            }
            if stop && step.step < trainer.steps() {
                return Ok(Outcome::Stopped);
            }
        }
        metrics.flush()?;
        save(trainer.state())?;
        Ok(Outcome::Finished)
    }
}

fn json(config: &TrainConfig) -> Result<String> {
    serde_json::to_string(config).map_err(|error| Error::File { path: "training configuration".into(), message: error.to_string() })
}

/// The metrics file: appended to; on resuming, lines after the checkpoint are dropped, for these steps are done again.
struct Metrics {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Metrics {
    fn open(path: &Path, done: u64) -> Result<Self> {
        let text = if done == 0 { String::new() } else { std::fs::read_to_string(path).unwrap_or_default() };
        let kept: Vec<&str> = text.split_inclusive('\n').take(done as usize).collect();
        write_atomically(path, |file| kept.iter().try_for_each(|line| file.write_all(line.as_bytes())))?;
        let file = OpenOptions::new().append(true).open(path).map_err(Error::io(path))?;
        Ok(Self { path: path.into(), file: BufWriter::new(file) })
    }

    fn line(&mut self, step: &StepReport, validation_loss: Option<f64>, seconds: f64) -> Result<()> {
        #[derive(Serialize)]
        struct Line<'a> {
            #[serde(flatten)]
            step: &'a StepReport,
            #[serde(skip_serializing_if = "Option::is_none")]
            validation_loss: Option<f64>,
            seconds: f64,
        }
        let text = serde_json::to_string(&Line { step, validation_loss, seconds })
            .map_err(|error| Error::File { path: self.path.clone(), message: error.to_string() })?;
        writeln!(self.file, "{text}").map_err(Error::io(&self.path))
    }

    fn flush(&mut self) -> Result<()> {
        self.file.flush().map_err(Error::io(&self.path))
    }
}
