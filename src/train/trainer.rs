//! The optimiser loop, one step at a time: order of windows, loss and gradients, Adam. No files, no clock.

use super::config::TrainConfig;
use super::rollout_loss::Rollouts;
use super::schedule::Schedule;
use crate::error::{Error, Result};
use crate::flight::Window;
use crate::hybrid::sequence::Sequence;
use crate::nn::Network;
use crate::tape::{DropoutKey, Session, Threads};
use phyture_kernels::adam::Adam;
use phyture_kernels::random::permutation;
use serde::{Deserialize, Serialize};

/// Everything that training changes. With configuration and data, this is the whole run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Steps done.
    pub step: u64,
    /// θ, flat.
    pub parameters: Vec<f32>,
    /// Adam's m.
    pub first_moment: Vec<f32>,
    /// Adam's v.
    pub second_moment: Vec<f32>,
    /// Σ of the losses of the steps of the epoch under way.
    pub loss_sum: f64,
    /// Losses of the epochs that have ended.
    pub curve: Vec<EpochLoss>,
    /// The epoch with the smallest validation loss so far, where it is to be kept.
    pub best: Option<Best>,
}

/// Losses of an epoch, in the unit of [`StepReport::loss`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochLoss {
    /// Mean over its steps, dropout on, while the weights moved.
    pub training: f64,
    /// Of its last weights on the validation windows, without dropout; none if there are none.
    pub validation: Option<f64>,
}

/// Where an epoch's training loss is more than so many times the least of those before it, the learning rate is too fast. Losses of epochs, means over
/// many steps, do not rise so by chance.
const DIVERGED: f64 = 2.0;

/// The first epoch, from 0, whose training loss shows that training diverges: more than twice the least of the epochs before, or no number.
///
/// # Examples
/// ```
/// use phyture::train::diverges_in;
///
/// assert_eq!(diverges_in([19.0, 5.0, 2.8, 5.5, 2.7]), None);
/// assert_eq!(diverges_in([19.0, 5.0, 2.8, 5.7, 2.7]), Some(3));
/// ```
pub fn diverges_in(training: impl IntoIterator<Item = f64>) -> Option<usize> {
    let mut least = f64::INFINITY;
    training.into_iter().position(|loss| {
        let rises = loss.is_nan() || loss > DIVERGED * least;
        least = least.min(loss);
        rises
    })
}

/// The weights of an epoch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Epoch, from 0.
    pub epoch: usize,
    /// Loss on the validation windows.
    pub loss: f64,
    /// θ, flat.
    pub parameters: Vec<f32>,
}

/// What one step did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepReport {
    /// Steps done, this one included.
    pub step: u64,
    /// Epoch of the step, from 0.
    pub epoch: usize,
    /// Mean over the batch of the squared 2-norm over the channels, (m/s²)² and (rad/s²)² summed (paper eq. 13), and the loss of rollouts where
    /// there is one.
    pub loss: f64,
    /// The part that rollouts have in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_rollouts: Option<f64>,
    /// Learning rate of the step.
    pub rate: f64,
    /// Euclidean norm of the gradient. Logged, not clipped.
    pub gradient_norm: f64,
}

/// Windows that are judged at a time.
const CHUNK: usize = 64;

/// A training run in memory.
pub struct Trainer<'a> {
    config: &'a TrainConfig,
    network: &'a Network<f32>,
    sequences: &'a [Sequence],
    windows: &'a [Window],
    /// Windows that nothing is learned from.
    validation: &'a [Window],
    rollouts: Option<Rollouts<'a>>,
    session: Session<f32>,
    /// For losses without dropout; made when the first is asked for.
    judge: Option<Session<f32>>,
    threads: Threads,
    schedule: Schedule,
    state: State,
    /// Order of the windows in `epoch_of_order`.
    order: Vec<u32>,
    epoch_of_order: Option<usize>,
}

impl<'a> Trainer<'a> {
    /// A run from its beginning, or from `state`.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if there are no windows; [`Error::File`] if the state is not one of this network.
    pub fn new(
        config: &'a TrainConfig,
        network: &'a Network<f32>,
        sequences: &'a [Sequence],
        windows: &'a [Window],
        state: Option<State>,
        threads: Threads,
    ) -> Result<Self> {
        if windows.is_empty() {
            return Err(Error::Undetermined(format!(
                "no training window: no run of training samples is as long as the history of {} samples; shorten `network.history` or give longer flights",
                config.network.history()
            )));
        }
        if u32::try_from(windows.len()).is_err() {
            let message =
                format!("{} training windows; at most {} can be put in order: make `stride` larger", windows.len(), u32::MAX);
            return Err(Error::Undetermined(message));
        }
        let count = network.graph().parameter_count();
        let state = state.unwrap_or_else(|| State {
            step: 0,
            parameters: network.initial(config.seed),
            first_moment: vec![0.0; count],
            second_moment: vec![0.0; count],
            loss_sum: 0.0,
            curve: Vec::new(),
            best: None,
        });
        let kept = state.best.as_ref().map_or(&state.parameters, |best| &best.parameters);
        if [kept, &state.parameters, &state.first_moment, &state.second_moment].iter().any(|slab| slab.len() != count) {
            let message = format!("holds {} parameters, and the network of this configuration has {count}", state.parameters.len());
            return Err(Error::File { path: "checkpoint".into(), message });
        }
        let schedule = Schedule::new(config.peak_rate, config.warmup_epochs, config.epochs, windows.len().div_ceil(config.batch));
        let session = Session::train(network.graph(), network.loss(), &[], threads)?;
        Ok(Self {
            config,
            network,
            sequences,
            windows,
            validation: &[],
            rollouts: None,
            session,
            judge: None,
            threads,
            schedule,
            state,
            order: Vec::new(),
            epoch_of_order: None,
        })
    }

    /// The same run with windows to judge it by, of the same sequences; they change nothing of what is learned.
    #[must_use]
    pub fn with_validation(mut self, windows: &'a [Window]) -> Self {
        self.validation = windows;
        self
    }

    /// The same run with rollouts that it learns from beside the windows, and others to judge it by.
    #[must_use]
    pub fn with_rollouts(mut self, rollouts: Rollouts<'a>) -> Self {
        self.rollouts = Some(rollouts);
        self
    }

    /// Steps in one epoch; the last may have fewer windows than the others.
    pub fn steps_an_epoch(&self) -> usize {
        self.windows.len().div_ceil(self.config.batch)
    }

    /// Steps of the whole run.
    pub fn steps(&self) -> u64 {
        (self.steps_an_epoch() * self.config.epochs) as u64
    }

    /// What has been learned so far.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// What has been learned; nothing more is.
    pub fn into_state(self) -> State {
        self.state
    }

    /// Ends an epoch after its last step: notes its losses, and its weights where they are the best so far and to be kept. Gives the losses.
    ///
    /// # Errors
    /// As [`Trainer::training_loss`].
    pub fn end_epoch(&mut self) -> Result<EpochLoss> {
        let validation = self.validation_loss()?;
        let keep = self.config.keep_best;
        let steps = self.steps_an_epoch() as f64;
        let state = &mut self.state;
        let epoch = state.curve.len();
        let losses = EpochLoss { training: state.loss_sum / steps, validation };
        state.curve.push(losses);
        state.loss_sum = 0.0;
        let is_best = |loss: &f64| keep && state.best.as_ref().is_none_or(|best| *loss < best.loss);
        if let Some(loss) = validation.filter(is_best) {
            state.best = Some(Best { epoch, loss, parameters: state.parameters.clone() });
        }
        Ok(losses)
    }

    /// Goes back to the weights of the best epoch at the end of a run, where they were kept.
    pub fn take_best(&mut self) {
        if let Some(best) = &self.state.best {
            self.state.parameters.clone_from(&best.parameters);
        }
    }

    /// Mean loss of the present weights on the training windows, without dropout, and on rollouts where there are some; the unit is that of
    /// [`StepReport::loss`].
    ///
    /// # Errors
    /// [`Error::Undetermined`] if it is not finite.
    pub fn training_loss(&mut self) -> Result<f64> {
        let rollouts = self.rollouts.as_mut().map(|rollouts| &mut rollouts.training);
        let of_rollouts = rollouts.map(|rollouts| rollouts.judge(&self.state.parameters)).transpose()?;
        Ok(self.loss_on(self.windows)? + of_rollouts.unwrap_or(0.0))
    }

    /// The same on the validation windows; `None` if there are none.
    ///
    /// # Errors
    /// As [`Trainer::training_loss`].
    pub fn validation_loss(&mut self) -> Result<Option<f64>> {
        if self.validation.is_empty() {
            return Ok(None);
        }
        let rollouts = self.rollouts.as_mut().and_then(|rollouts| rollouts.validation.as_mut());
        let of_rollouts = rollouts.map(|rollouts| rollouts.judge(&self.state.parameters)).transpose()?;
        Ok(Some(self.loss_on(self.validation)? + of_rollouts.unwrap_or(0.0)))
    }

    fn loss_on(&mut self, windows: &[Window]) -> Result<f64> {
        let Self { network, sequences, judge, state, threads, .. } = self;
        let session = match judge {
            Some(session) => session,
            None => judge.insert(Session::infer(network.graph(), &[network.loss()], *threads)?),
        };
        session.load(&state.parameters)?;
        let mut sum = 0.0;
        for chunk in windows.chunks(CHUNK) {
            let fill = |sample: usize, inputs: &mut [&mut [f32]]| fill_window(sequences, chunk[sample], inputs);
            session.predict(chunk.len(), &fill, &mut |_, loss| sum += loss.iter().copied().map(f64::from).sum::<f64>())?;
        }
        let mean = sum / windows.len() as f64;
        if !mean.is_finite() {
            let (step, rate) = (state.step, self.config.peak_rate);
            let message = format!("training diverged: after step {step} the loss is {mean}; lower `peak_rate` ({rate})");
            return Err(Error::Undetermined(message));
        }
        Ok(mean)
    }

    /// One step; `None` when the run is at its end.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if loss or gradient are not finite: the run has diverged, and its state is that of the step before.
    pub fn step(&mut self) -> Result<Option<StepReport>> {
        let done = self.state.step;
        if done >= self.steps() {
            return Ok(None);
        }
        let (epoch, batch) = (done as usize / self.steps_an_epoch(), done as usize % self.steps_an_epoch());
        if self.epoch_of_order != Some(epoch) {
            self.order = permutation(self.windows.len(), self.config.seed, epoch as u64);
            self.epoch_of_order = Some(epoch);
        }
        let start = batch * self.config.batch;
        let chosen = &self.order[start..(start + self.config.batch).min(self.order.len())];
        let (sequences, windows) = (self.sequences, self.windows);
        let fill = |sample: usize, inputs: &mut [&mut [f32]]| fill_window(sequences, windows[chosen[sample] as usize], inputs);
        let dropout = self.config.network.is_random().then_some(DropoutKey { seed: self.config.seed, step: done });
        let mut loss = self.session.step(&self.state.parameters, chosen.len(), dropout, &fill)?;
        let gradient = self.session.gradients_mut();
        let rollouts = self.rollouts.as_mut().map(|rollouts| &mut rollouts.training);
        let of_rollouts = rollouts.map(|rollouts| rollouts.step(&self.state.parameters, done, gradient)).transpose()?;
        loss += of_rollouts.unwrap_or(0.0);
        let gradient_norm = norm(self.session.gradients());
        if !(loss.is_finite() && gradient_norm.is_finite()) {
            return Err(Error::Undetermined(format!(
                "training diverged at step {}: loss {loss}, gradient norm {gradient_norm}; lower `peak_rate` ({})",
                done + 1,
                self.config.peak_rate
            )));
        }
        let rate = self.schedule.rate(done as usize);
        let State { parameters, first_moment, second_moment, .. } = &mut self.state;
        let adam = Adam { learning_rate: rate, ..Adam::default() };
        self.session.adam(&adam, done + 1, parameters, first_moment, second_moment)?;
        self.session.settle(parameters);
        self.state.step += 1;
        self.state.loss_sum += loss;
        Ok(Some(StepReport { step: done + 1, epoch, loss, of_rollouts, rate, gradient_norm }))
    }
}

/// History and target of a window, as the network's inputs.
fn fill_window(sequences: &[Sequence], window: Window, inputs: &mut [&mut [f32]]) {
    if let [state, physics, target] = inputs {
        sequences[window.flight].history(window.last, state, physics);
        sequences[window.flight].target(window.last, target);
    }
}

/// Euclidean length, in f64. Eight sums: in a single one each addition would wait for the last.
fn norm(gradients: &[f32]) -> f64 {
    let mut sums = [0.0_f64; 8];
    for chunk in gradients.chunks(sums.len()) {
        sums.iter_mut().zip(chunk).for_each(|(sum, gradient)| *sum += f64::from(*gradient).powi(2));
    }
    sums.iter().sum::<f64>().sqrt()
}
