//! Flights as the network sees them: scaled state and physics rows, ready to be cut into histories.

use super::Description;
use super::inputs;
use super::linear::{Linear, LinearConfig, Signals};
use super::scaling::{Scale, Scaling};
use crate::error::{Error, Result};
use crate::flight::windows::{counted, windows};
use crate::flight::{Accelerations, Flight, PerChannel, Span, Window};
use crate::formula::Formula;
use crate::nn::Architecture;
use crate::physics::Model;

/// What the network learns: the residual r = a − a^p, or the acceleration itself (the variants without residual learning).
fn learned(flight: &Flight, baseline: &Accelerations, residual: bool) -> Accelerations {
    PerChannel::from_fn(|channel| {
        let measured = flight.column(channel.column());
        let offset = |sample: usize| if residual { baseline[channel][sample] } else { 0.0 };
        measured.iter().enumerate().map(|(sample, value)| value - offset(sample)).collect()
    })
}

/// One flight, unscaled.
struct Raw {
    state: Vec<Vec<f64>>,
    baseline: Accelerations,
    learned: Accelerations,
}

impl Raw {
    fn new(flight: &Flight, model: &Model, formulas: &[Formula], linear: Option<&Linear>, residual: bool) -> Result<Self> {
        let state = formulas.iter().map(|formula| inputs::values(formula, flight)).collect::<Result<_>>()?;
        let mut baseline = model.predict(flight)?;
        if let Some(linear) = linear {
            let signals = Signals::new(flight, linear.config())?;
            for sample in 0..flight.len() {
                let filtered = linear.at(&signals, sample);
                baseline.iter_mut().zip(filtered).for_each(|(column, value)| column[sample] += value);
            }
        }
        let learned = learned(flight, &baseline, residual);
        Ok(Self { state, baseline, learned })
    }
}

/// One flight: rows of f32, one a sample.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Scaled state-control rows, `[samples, D_S]`.
    state: Vec<f32>,
    /// Scaled rows of the baseline (physics, and linear history where there is one), `[samples, 6]`.
    physics: Vec<f32>,
    /// What the network is to predict, `[samples, 6]`, physical units.
    learned: Vec<f32>,
    /// Baseline accelerations a^p, physical units, f64.
    baseline: Accelerations,
}

impl Sequence {
    fn new(raw: Raw, scaling: &Scaling) -> Self {
        let rows = |columns: &[Vec<f64>], scales: &[Scale]| {
            let samples = columns.first().map_or(0, Vec::len);
            let row = |sample: usize| columns.iter().zip(scales).map(move |(column, scale)| scale.apply(column[sample]) as f32);
            (0..samples).flat_map(row).collect()
        };
        let physical = PerChannel::splat(Scale { mean: 0.0, deviation: 1.0 });
        Self {
            state: rows(&raw.state, &scaling.state),
            physics: rows(raw.baseline.values(), scaling.physics.values()),
            learned: rows(raw.learned.values(), physical.values()),
            baseline: raw.baseline,
        }
    }

    /// Baseline acceleration of a sample.
    pub fn baseline(&self, sample: usize) -> PerChannel<f64> {
        PerChannel::from_fn(|channel| self.baseline[channel][sample])
    }

    /// Copies the history that ends with row `last` into `state` `[H, D_S]` and `physics` `[H, 6]`.
    pub fn history(&self, last: usize, state: &mut [f32], physics: &mut [f32]) {
        copy_ending_at(&self.physics, last, 6, physics);
        let channels = self.state.len() / (self.physics.len() / 6).max(1);
        copy_ending_at(&self.state, last, channels, state);
    }

    /// Copies the last rows of what is to be learned, up to and including row `last`, into `target` `[P, 6]`.
    pub fn target(&self, last: usize, target: &mut [f32]) {
        copy_ending_at(&self.learned, last, 6, target);
    }
}

fn copy_ending_at(rows: &[f32], last: usize, channels: usize, target: &mut [f32]) {
    let end = (last + 1) * channels;
    target.copy_from_slice(&rows[end - target.len()..end]);
}

/// The flights of a data set as sequences, as the description says.
///
/// # Errors
/// [`Error::Formula`] if an input names a column that a flight lacks, or an acceleration or what gives one away, or if an effect names a
/// column that a flight lacks; [`Error::Undetermined`] if a value is not
/// finite: a NaN never reaches the network.
pub fn sequences(flights: &[Flight], description: &Description) -> Result<Vec<Sequence>> {
    let Description { model, config, inputs, linear, scaling, .. } = description;
    let formulas = inputs::parse(inputs)?;
    let one = |flight: &Flight| {
        let raw = Raw::new(flight, model, &formulas, linear.as_ref(), config.predicts_residual())?;
        let sequence = Sequence::new(raw, scaling);
        check_finite(flight, inputs, &sequence)?;
        Ok(sequence)
    };
    flights.iter().map(one).collect()
}

/// Scales from the training spans alone.
///
/// # Errors
/// As [`sequences`].
pub fn scaling(
    flights: &[Flight],
    spans: &[Span],
    model: &Model,
    inputs: &[String],
    linear: Option<&Linear>,
    network: &Architecture,
) -> Result<Scaling> {
    let formulas = inputs::parse(inputs)?;
    let residual = network.predicts_residual();
    let raw: Vec<Raw> = flights.iter().map(|flight| Raw::new(flight, model, &formulas, linear, residual)).collect::<Result<_>>()?;
    let of = |column: &dyn Fn(&Raw) -> &Vec<f64>| {
        let columns: Vec<&[f64]> = raw.iter().map(|raw| column(raw).as_slice()).collect();
        Scale::of(&columns, spans)
    };
    Ok(Scaling {
        state: (0..inputs.len()).map(|input| of(&|raw| &raw.state[input])).collect(),
        physics: PerChannel::from_fn(|channel| of(&|raw| &raw.baseline[channel])),
        output: PerChannel::from_fn(|channel| of(&|raw| &raw.learned[channel])),
    })
}

/// The linear history of what the model leaves over on the training spans.
///
/// # Errors
/// As [`Linear::fit`] and [`Model::predict`].
pub fn linear(flights: &[Flight], spans: &[Span], model: &Model, config: &LinearConfig) -> Result<Linear> {
    let windows = counted(flights, windows(spans, config.lags, 1));
    let baselines: Vec<Accelerations> = flights.iter().map(|flight| model.predict(flight)).collect::<Result<_>>()?;
    let left_over: Vec<Accelerations> =
        flights.iter().zip(&baselines).map(|(flight, baseline)| learned(flight, baseline, true)).collect();
    let target = |window: &Window| PerChannel::from_fn(|channel| left_over[window.flight][channel][window.last]);
    Linear::fit(flights, &windows, &windows.iter().map(target).collect::<Vec<_>>(), config)
}

fn check_finite(flight: &Flight, inputs: &[String], sequence: &Sequence) -> Result<()> {
    let channels = inputs.len().max(1);
    let state =
        sequence.state.iter().position(|value| !value.is_finite()).map(|at| (at / channels, inputs[at % channels].as_str()));
    let physics = sequence.physics.iter().position(|value| !value.is_finite()).map(|at| (at / 6, "the baseline"));
    match state.or(physics) {
        None => Ok(()),
        Some((sample, what)) => Err(Error::Undetermined(format!(
            "flight `{}`, {:.2} s: {what} is not a finite number there (a division by zero, a root or logarithm of a negative number); \
             change the formula, or filter these rows with `use` in dataset.toml",
            flight.name,
            flight.time_s(sample)
        ))),
    }
}
