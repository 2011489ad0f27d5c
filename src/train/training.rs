//! One training run, from flights and a calibrated model to a hybrid, whoever asked for it: with checkpoints, stopped and gone on with as the
//! caller wants. What trains step by step is the trainer.

use super::{EpochLoss, Job, Outcome, Report, RunFolder, State, TrainConfig, Trainer};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::flight::split::Split;
use crate::hybrid::Hybrid;
use crate::physics::Model;
use crate::tape::Threads;

/// A training run.
#[derive(Clone, Copy)]
pub struct Training<'a> {
    /// Flights.
    pub flights: &'a [Flight],
    /// What trains.
    pub split: &'a Split,
    /// The calibrated model.
    pub model: &'a Model,
    /// Settings.
    pub config: &'a TrainConfig,
    /// Tells one set of training data from another when a run is resumed.
    pub data: u64,
    /// Where checkpoints go.
    pub folder: &'a RunFolder,
    /// Whether the losses of the network at its end, and on the validation part after each epoch, and its intervals are worth their time.
    pub with_losses: bool,
    /// Threads to train on.
    pub threads: Threads,
}

/// What a run is about to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Begun {
    /// Trainable numbers.
    pub parameters: usize,
    /// Windows that train.
    pub windows: usize,
    /// Windows that validate.
    pub validation_windows: usize,
    /// Rollouts that train beside them; 0 without.
    pub rollouts: usize,
    /// Steps in all.
    pub steps: u64,
    /// Steps that are done already.
    pub done: u64,
}

/// What happens in a run.
pub enum Event<'e> {
    /// Everything that the run needs has been read.
    Begins(Begun),
    /// A step was taken.
    Step(&'e Report),
}

/// Mean of the squared errors, summed over the channels, (m/s²)² + (rad/s²)², without dropout, and the loss of rollouts where these train, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Losses {
    /// On the windows that trained the network.
    pub training: f64,
    /// On the validation part; none if the split has none.
    pub validation: Option<f64>,
}

/// A network that has been trained.
pub struct Trained {
    /// Physics and network.
    pub hybrid: Hybrid,
    /// What was done.
    pub begun: Begun,
    /// Windows that did not train and made the gate; 0 if there is none.
    pub gate_windows: usize,
    /// If they were asked for.
    pub losses: Option<Losses>,
    /// Losses of each epoch.
    pub curve: Vec<EpochLoss>,
    /// The epoch whose weights these are, from 0.
    pub epoch: usize,
}

/// How a run ended.
pub enum Ended {
    /// At its end.
    Trained(Box<Trained>),
    /// Stopped after some steps, and saved.
    Stopped {
        /// Steps done.
        done: u64,
        /// Steps in all.
        steps: u64,
    },
}

impl Training<'_> {
    /// Trains from the beginning, or from where `state` was left. `observe` hears what happens, and says after each step whether to go on.
    ///
    /// # Errors
    /// As [`Job::new`], [`Trainer::new`], [`RunFolder::train`]; those of `observe`; [`Error::Config`] if the best epoch is to be kept and nothing
    /// validates.
    pub fn run(&self, state: Option<State>, observe: &mut dyn FnMut(Event<'_>) -> Result<bool>) -> Result<Ended> {
        let Self { flights, split, model, config, data, folder, with_losses, threads } = *self;
        let mut job = Job::new(flights, split, model, config)?;
        if config.keep_best && job.validation.is_empty() {
            return Err(Error::Config {
                place: "training configuration".into(),
                field: "keep_best".into(),
                found: "true".into(),
                expected: "false: this division has no validation part to judge an epoch on, and the split `segments` has one"
                    .into(),
            });
        }
        let network = job.description.network(config.standardise_loss)?;
        let mut trainer = Trainer::new(config, &network, &job.sequences, &job.windows, state, threads)?;
        if with_losses || config.keep_best {
            trainer = trainer.with_validation(&job.validation);
        }
        let rollouts = job.rollouts(flights, split, config, threads)?;
        let starts = rollouts.as_ref().map_or(0, |rollouts| rollouts.training.starts());
        if let Some(rollouts) = rollouts {
            trainer = trainer.with_rollouts(rollouts);
        }
        let begun = Begun {
            parameters: network.graph().parameter_count(),
            windows: job.windows.len(),
            validation_windows: job.validation.len(),
            rollouts: starts,
            steps: trainer.steps(),
            done: trainer.state().step,
        };
        observe(Event::Begins(begun))?;
        let mut failed = None;
        let outcome = folder.train(config, data, &mut trainer, &mut |report| match observe(Event::Step(report)) {
            Ok(goes_on) => goes_on,
            Err(error) => {
                failed = Some(error);
                false
            }
        })?;
        if let Some(error) = failed {
            return Err(error);
        }
        if outcome == Outcome::Stopped {
            return Ok(Ended::Stopped { done: trainer.state().step, steps: begun.steps });
        }
        trainer.take_best();
        let losses = match with_losses {
            true => Some(Losses { training: trainer.training_loss()?, validation: trainer.validation_loss()? }),
            false => None,
        };
        let State { parameters, curve, best, .. } = trainer.into_state();
        let epoch = best.map_or(curve.len().saturating_sub(1), |best| best.epoch);
        let gate_windows = job.gate_windows.len();
        let interval_windows = std::mem::take(&mut job.interval_windows);
        let mut hybrid = job.hybrid(flights, parameters, threads)?;
        if with_losses {
            hybrid.set_intervals(flights, &split.training, &interval_windows, threads)?;
        }
        Ok(Ended::Trained(Box::new(Trained { hybrid, begun, gate_windows, losses, curve, epoch })))
    }
}
