//! What a training run learns from, and the hybrid it will end in but for its weights: windows, inputs and scales, all from the
//! training part alone. No optimiser and no files here.

use super::config::TrainConfig;
use super::rollout_loss::{RolloutLoss, RolloutRule, Rollouts};
use crate::blocks::Blocks;
use crate::error::Result;
use crate::flight::split::Split;
use crate::flight::windows::{counted, windows};
use crate::flight::{Flight, PerChannel, Span, Window};
use crate::hybrid::intervals::FEWEST_BLOCKS;
use crate::hybrid::{Description, Hybrid, sequence};
use crate::physics::Model;
use crate::tape::Threads;

/// Training data, prepared once a run.
pub struct Job {
    /// The hybrid but for its weights.
    pub description: Description,
    /// All flights as the network sees them.
    pub sequences: Vec<sequence::Sequence>,
    /// Windows that train.
    pub windows: Vec<Window>,
    /// Windows that did not train, for the gate: the validation part, else blocks of the training part; empty without a gate, and
    /// of a network that predicts the acceleration itself.
    pub gate_windows: Vec<Window>,
    /// Windows that did not train, for the intervals: the validation part, else blocks of the training part.
    pub interval_windows: Vec<Window>,
    /// Where rollouts may train: the training part, without what is kept from training.
    pub rollout_spans: Vec<Span>,
    /// Windows of the split's validation part, as dense as those that train; empty if the split has none.
    pub validation: Vec<Window>,
}

impl Job {
    /// Prepares the training part of `split` for the residual (or acceleration) of `model`.
    ///
    /// # Errors
    /// As [`TrainConfig::check`], [`sequence::sequences`] and [`sequence::linear`].
    pub fn new(flights: &[Flight], split: &Split, model: &Model, config: &TrainConfig) -> Result<Self> {
        config.check()?;
        let spans = &split.training;
        let linear = config.linear.as_ref().map(|linear| sequence::linear(flights, spans, model, linear)).transpose()?;
        let mut description = Description {
            model: model.clone(),
            config: config.network.clone(),
            inputs: config.inputs.clone(),
            scaling: sequence::scaling(flights, spans, model, &config.inputs, linear.as_ref(), &config.network)?,
            linear,
            gate: PerChannel::splat(1.0),
            step_s: flights.first().map_or(0.01, |flight| flight.step_s),
            envelope: None,
            intervals: None,
        };
        description.set_envelope(flights, spans)?;
        let sequences = sequence::sequences(flights, &description)?;
        let of = |spans: &[Span]| counted(flights, windows(spans, config.network.history(), config.stride));
        let (all, validation) = (of(spans), of(&split.validation));
        let Blocks { of_window: blocks, keys } = Blocks::new(flights, &all);
        let every = match config.gate_every {
            _ if !validation.is_empty() => 0,
            // Of too few blocks no intervals are made: then all of them train.
            0 if keys.len() < config.interval_every * FEWEST_BLOCKS => 0,
            0 => config.interval_every,
            every => every,
        };
        let is_kept = |block: usize| every > 0 && block % every == every - 1;
        let choose =
            |wanted: bool| all.iter().zip(&blocks).filter(move |(_, block)| is_kept(**block) == wanted).map(|(window, _)| *window);
        let (training, kept): (Vec<Window>, Vec<Window>) = (choose(false).collect(), choose(true).collect());
        let rollout_spans = match kept.is_empty() {
            true => spans.clone(),
            false => between(&all, &blocks.iter().map(|block| is_kept(*block)).collect::<Vec<_>>(), config.network.history()),
        };
        // The gate is six numbers: what they were fitted on is hardly flattered by them, and serves the intervals as well.
        let interval_windows = if kept.is_empty() { validation.clone() } else { kept };
        let gated = config.gate_every > 0 && config.network.predicts_residual();
        let gate_windows = if gated { interval_windows.clone() } else { Vec::new() };
        Ok(Self { description, sequences, windows: training, gate_windows, interval_windows, rollout_spans, validation })
    }

    /// The rollouts of a configuration that has some: those that train, and those of the validation part, if the split has one.
    ///
    /// # Errors
    /// As [`RolloutLoss::new`].
    pub fn rollouts<'j>(
        &'j self,
        flights: &'j [Flight],
        split: &Split,
        config: &TrainConfig,
        threads: Threads,
    ) -> Result<Option<Rollouts<'j>>> {
        let Some(rule) = RolloutRule::of(config) else { return Ok(None) };
        let of = |spans: &[Span]| RolloutLoss::new(&self.description, flights, &self.sequences, spans, &rule, threads);
        let training = of(&self.rollout_spans)?;
        let validation = if split.validation.is_empty() { None } else { Some(of(&split.validation)?) };
        Ok(Some(Rollouts { training, validation }))
    }

    /// The hybrid with these weights, its gate fitted where windows were kept for one.
    ///
    /// # Errors
    /// As [`Hybrid::new`] and [`Hybrid::fit_gate`].
    pub fn hybrid(self, flights: &[Flight], parameters: Vec<f32>, threads: Threads) -> Result<Hybrid> {
        let mut hybrid = Hybrid::new(self.description, parameters)?;
        if !self.gate_windows.is_empty() {
            hybrid.fit_gate(flights, &self.gate_windows, threads)?;
        }
        Ok(hybrid)
    }
}

/// The runs of windows that are not kept, each with the history of its first one. Windows are in order.
fn between(windows: &[Window], kept: &[bool], history: usize) -> Vec<Span> {
    let all: Vec<(&Window, bool)> = windows.iter().zip(kept.iter().copied()).collect();
    let runs = all.chunk_by(|(left, left_kept), (right, right_kept)| left.flight == right.flight && left_kept == right_kept);
    let span = |run: &[(&Window, bool)]| {
        let ((first, kept), (last, _)) = (run[0], run[run.len() - 1]);
        (!kept).then_some(Span { flight: first.flight, start: first.last + 1 - history, end: last.last + 1 })
    };
    runs.filter_map(span).collect()
}
