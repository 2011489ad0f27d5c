//! Physics and network as one model: â = a^p + r̂ (paper eq. 12), on recorded windows or one sample at a time.
//!
//! A [`Hybrid`] holds everything a prediction needs (calibrated model, inputs, scales, weights) and is one file. How it was
//! trained is in `train`.

pub mod envelope;
pub(crate) mod histories;
pub mod inputs;
pub mod intervals;
pub mod linear;
pub mod rollout;
pub mod scaling;
pub mod sensitivity;
pub mod sequence;
mod stages;
mod stream;
mod target;

use envelope::Envelope;
use intervals::{Kept, PredictionIntervals};
use linear::Linear;
pub use rollout::HybridRollout;
pub use scaling::{Scale, Scaling};
pub use stages::Stages;
pub use stream::{Streamed, StreamingHybrid};
pub use target::{NetworkTarget, network_target};

use crate::blocks::Blocks;
use crate::error::{Error, Result};
use crate::flight::{Flight, PerChannel, Span, Window};
use crate::nn::safetensors::{Numbers, SafeTensors, Tensor};
use crate::nn::{Architecture, Network, OutputScale};
use crate::physics::{Model, columns_behind};
use crate::tape::{Parameter, Session, Threads};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// Windows predicted at a time: enough for every worker, few enough to keep memory small.
const CHUNK: usize = 64;

/// Steps of a log may differ from the trained one by this share (the tolerance of a log's own step).
const STEP_TOLERANCE: f64 = 0.01;

/// Longest and shortest step that a description may have, s.
const STEPS_S: std::ops::RangeInclusive<f64> = 1e-6..=1e3;

/// Largest mean and deviation of what the network says, m/s² or rad/s²: the squares of six such errors are finite in f32.
const LARGEST_OUTPUT: f64 = 1e15;

/// Largest mean and deviation of an input, and the reciprocal of the smallest deviation.
const LARGEST_INPUT: f64 = 1e30;

/// Key of the metadata of a hybrid's file.
const METADATA: &str = "phyture_hybrid";

/// What a hybrid is, but for its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// The calibrated physical model.
    pub model: Model,
    /// The network.
    pub config: Architecture,
    /// State-control inputs, as formulas of the log's columns.
    pub inputs: Vec<String>,
    /// Linear history between physics and network, if there is one.
    pub linear: Option<Linear>,
    /// Fixed scales from the training part.
    pub scaling: Scaling,
    /// Factor on what the network says, one a channel: 1 is the network as trained.
    pub gate: PerChannel<f64>,
    /// Sampling step of the training data, s.
    pub step_s: f64,
    /// Where in state and control it was calibrated and trained; none in files of before there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub envelope: Option<Envelope>,
    /// How far measurements may lie from what it predicts; none where no windows were kept from training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<PredictionIntervals>,
}

impl Description {
    /// Records the network with its fixed output scale.
    ///
    /// # Errors
    /// [`Error::Config`] if the configuration is impossible.
    pub fn network(&self, standardise_loss: bool) -> Result<Network<f32>> {
        Ok(Network::new(&self.config, &self.output_scale(), standardise_loss)?)
    }

    /// From the network's unit scale to physical units.
    pub(crate) fn output_scale(&self) -> OutputScale {
        OutputScale {
            scale: self.scaling.output.iter().map(|scale| scale.deviation).collect(),
            offset: self.scaling.output.iter().map(|scale| scale.mean).collect(),
        }
    }

    /// Refuses sizes that do not fit each other and numbers that are not finite: a description may come from any file.
    fn check(&self) -> Result<()> {
        let fault = |field: &str, found: String, expected: String| {
            Err(Error::Config { place: "hybrid".into(), field: field.into(), found, expected })
        };
        let Self { config, inputs, linear, scaling, gate, step_s, .. } = self;
        let sizes = [
            ("network.state_channels", config.state_channels(), inputs.len()),
            ("scaling.state", scaling.state.len(), inputs.len()),
            ("network.physics_channels", config.physics_channels(), 6),
            ("network.outputs", config.outputs(), 6),
        ];
        if let Some((field, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
            return fault(field, found.to_string(), expected.to_string());
        }
        let groups: [(&str, &[Scale], f64); 3] = [
            ("scaling.state", &scaling.state, LARGEST_INPUT),
            ("scaling.physics", scaling.physics.values(), LARGEST_INPUT),
            ("scaling.output", scaling.output.values(), LARGEST_OUTPUT),
        ];
        for (field, scales, largest) in groups {
            let possible = |scale: &&Scale| scale.mean.abs() <= largest && (largest.recip()..=largest).contains(&scale.deviation);
            if let Some(wrong) = scales.iter().find(|scale| !possible(scale)) {
                let found = format!("mean {:e}, deviation {:e}", wrong.mean, wrong.deviation);
                let expected = format!("means up to ±{largest:e} and deviations of {:e} to {largest:e}", largest.recip());
                return fault(field, found, expected);
            }
        }
        if !STEPS_S.contains(step_s) {
            return fault("step_s", step_s.to_string(), format!("{:e} s to {:e} s", STEPS_S.start(), STEPS_S.end()));
        }
        if !gate.iter().all(|factor| (0.0..=1.0).contains(factor)) {
            return fault("gate", format!("{:?}", gate.values()), "six factors between 0 and 1".into());
        }
        inputs::parse(inputs)?;
        self.check_limits()?;
        match linear.as_ref().map_or(Ok(()), Linear::check) {
            Ok(()) => self.model.check(),
            Err(message) => fault("linear", message, "numbers that fit".into()),
        }
    }

    /// Refuses an envelope or intervals whose numbers cannot be any, or an envelope of what the hybrid does not read.
    fn check_limits(&self) -> Result<()> {
        let fault = |field: &str, found: String, expected: &str| {
            Err(Error::Config { place: "hybrid".into(), field: field.into(), found, expected: expected.into() })
        };
        if let Some(envelope) = &self.envelope {
            if let Err(found) = envelope.check() {
                return fault("envelope", found, "finite ranges, and samples with a number for each");
            }
            let read = self.reads()?;
            if let Some(range) = envelope.ranges().iter().find(|range| !read.contains(&range.name)) {
                return fault("envelope", format!("`{}`", range.name), "what physics, linear history or network read");
            }
        }
        match self.intervals.as_ref().map_or(Ok(()), PredictionIntervals::check) {
            Ok(()) => Ok(()),
            Err(found) => fault("intervals", found, "finite numbers that are not negative, and a coverage between 0 and 1"),
        }
    }

    /// Sets the envelope from the samples that it is calibrated and trained on.
    ///
    /// # Errors
    /// As [`Model::stream`]; [`Error::Log`] if a flight lacks a column that the hybrid reads; [`Error::Undetermined`] if the spans hold no sample.
    pub fn set_envelope(&mut self, flights: &[Flight], training: &[Span]) -> Result<()> {
        let names: Vec<String> = self.reads()?.into_iter().collect();
        // What reads nothing but the time has no state to be outside of.
        self.envelope = if names.is_empty() { None } else { Some(Envelope::new(&names, flights, training)?) };
        Ok(())
    }

    /// Columns that physics, linear history and network read: of the state, those behind derived quantities among them, and the log's own.
    ///
    /// # Errors
    /// As [`Model::stream`].
    pub fn reads(&self) -> Result<BTreeSet<String>> {
        let mut read = self.model.stream(self.step_s)?.reads();
        let linear = self.linear.as_ref().map_or(&[][..], |linear| linear.config().inputs.as_slice());
        for formula in inputs::parse(&self.inputs)?.iter().chain(&inputs::parse(linear)?) {
            read.extend(formula.names().into_iter().flat_map(columns_behind));
        }
        Ok(read)
    }

    /// Whether samples so many seconds apart are as far apart as those of the training data, but for the jitter of a log's clock.
    pub fn is_trained_at(&self, step_s: f64) -> bool {
        (step_s / self.step_s - 1.0).abs() <= STEP_TOLERANCE
    }

    /// Refuses a flight sampled at another step than the training data.
    fn check_step(&self, flight: &Flight) -> Result<()> {
        if self.is_trained_at(flight.step_s) {
            return Ok(());
        }
        Err(Error::Config {
            place: format!("flight `{}`", flight.name),
            field: "step".into(),
            found: format!("{} s", flight.step_s),
            expected: format!("the {} s the network was trained at; set `resample_hz` in dataset.toml", self.step_s),
        })
    }
}

/// A calibrated model with a trained network.
pub struct Hybrid {
    description: Description,
    network: Network<f32>,
    parameters: Vec<f32>,
}

impl Hybrid {
    /// Joins a description and weights.
    ///
    /// # Errors
    /// [`Error::Config`] if the configuration is impossible; [`Error::Shape`] if the number of weights is not the network's;
    /// [`Error::Undetermined`] if one of them is not finite.
    pub fn new(description: Description, parameters: Vec<f32>) -> Result<Self> {
        description.check()?;
        let network = description.network(false)?;
        let count = network.graph().parameter_count();
        if parameters.len() != count {
            let message = format!("{} weights, and the network has {count}", parameters.len());
            return Err(Error::Shape { operation: "hybrid", message });
        }
        if let Some(at) = parameters.iter().position(|weight| !weight.is_finite()) {
            return Err(Error::Undetermined(format!("weight {at} of {count} is {}: the training has diverged", parameters[at])));
        }
        Ok(Self { description, network, parameters })
    }

    /// Sets the gate from windows that the network was not trained on, and gives it back: the factor that fits the network's
    /// residual to the measured one by least squares, cut to [0, 1], and 0 where the gain is not one standard error above
    /// nothing (block means of 10 s). So a channel in which the network learned nothing that carries over is left to the
    /// physics. A network that predicts the acceleration itself has no gate.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn fit_gate(&mut self, flights: &[Flight], windows: &[Window], threads: Threads) -> Result<PerChannel<f64>> {
        self.description.gate = PerChannel::splat(1.0);
        if !self.description.config.predicts_residual() || windows.is_empty() {
            return Ok(self.description.gate);
        }
        let sequences = sequence::sequences(flights, &self.description)?;
        let predicted = self.predict(flights, windows, threads)?;
        let blocks = Blocks::new(flights, windows).of_window;
        let gate = PerChannel::from_fn(|channel| {
            let pairs = windows.iter().zip(&predicted).map(|(window, predicted)| {
                let baseline = sequences[window.flight].baseline(window.last)[channel];
                let measured = flights[window.flight].column(channel.column())[window.last];
                (measured - baseline, predicted[channel] - baseline)
            });
            gate(&pairs.collect::<Vec<_>>(), &blocks)
        });
        self.description.gate = gate;
        Ok(gate)
    }

    /// Sets the intervals from windows that the network was not trained on, with the physics as it is on a flight that it does not know: without the
    /// numbers (wind, biases) that calibration found for single flights. Windows in fewer than [`intervals::FEWEST_BLOCKS`] blocks give none.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn set_intervals(&mut self, flights: &[Flight], training: &[Span], windows: &[Window], threads: Threads) -> Result<()> {
        let predicted = self.predict_unknown(flights, windows, threads)?;
        let blocks = Blocks::new(flights, windows).of_window;
        let kept = |((window, predicted), block): ((&Window, &PerChannel<f64>), &usize)| Kept {
            flight: &flights[window.flight],
            sample: window.last,
            predicted: *predicted,
            block: *block,
        };
        let kept: Vec<Kept<'_>> = windows.iter().zip(&predicted).zip(&blocks).map(kept).collect();
        self.description.intervals = PredictionIntervals::new(flights, training, &kept);
        Ok(())
    }

    /// As [`Hybrid::predict`], with the physics as a stream has it: each flight one that calibration did not know.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn predict_unknown(&self, flights: &[Flight], windows: &[Window], threads: Threads) -> Result<Vec<PerChannel<f64>>> {
        self.on(self.description.model.of_unknown_flights())?.predict(flights, windows, threads)
    }

    /// The same network on another model, for one that knows more of some flights than the one it was trained on and is equal otherwise.
    ///
    /// # Errors
    /// As [`Hybrid::new`].
    pub fn on(&self, model: Model) -> Result<Self> {
        Self::new(Description { model, ..self.description.clone() }, self.parameters.clone())
    }

    /// What it is, but for its weights.
    pub const fn description(&self) -> &Description {
        &self.description
    }

    /// Writes [`Hybrid::to_bytes`] to a file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    #[cfg(feature = "disk")]
    pub fn write(&self, path: &Path) -> Result<()> {
        let bytes = self.to_bytes()?;
        crate::disk::write_atomically(path, |file| file.write_all(&bytes))
    }

    /// One safetensors file: the weights under the names of the exchange with PyTorch, everything else as metadata.
    ///
    /// # Errors
    /// [`Error::File`] if what it is cannot be written as JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let text = serde_json::to_string(&self.description)
            .map_err(|error| Error::File { path: "hybrid".into(), message: error.to_string() })?;
        let tensor = |parameter: &Parameter| {
            let numbers = Numbers::F32(parameter.to_file_order(&self.parameters));
            (parameter.name.clone(), Tensor { shape: parameter.file_lengths(), numbers })
        };
        let tensors = self.network.parameters().iter().map(tensor).collect();
        Ok(SafeTensors { metadata: [(METADATA.to_owned(), text)].into(), tensors }.to_bytes())
    }

    /// Reads what [`Hybrid::write`] wrote.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; as [`Hybrid::from_bytes`].
    #[cfg(feature = "disk")]
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_bytes(&std::fs::read(path).map_err(Error::io(path))?, path)
    }

    /// From the bytes of a file, which errors name `path`; nothing is opened. They may come from anywhere: whatever is wrong with them is an error.
    ///
    /// # Errors
    /// [`Error::File`] saying what is wrong.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        let fault = |message: String| Error::File { path: path.into(), message };
        let file = SafeTensors::parse(bytes).map_err(fault)?;
        let text = file.metadata.get(METADATA).ok_or_else(|| fault("holds no hybrid of phyture (no such metadata)".into()))?;
        let description: Description =
            serde_json::from_str(text).map_err(|error| fault(format!("its description does not read: {error}")))?;
        description.check().map_err(|error| fault(error.to_string()))?;
        let network = description.network(false).map_err(|error| fault(error.to_string()))?;
        // Sizes are a claim until the tensors are found to have them: no memory is asked for before.
        let of_file = |parameter| Ok((parameter, numbers_of(&file, parameter).map_err(fault)?));
        let of_file: Vec<(&Parameter, &[f32])> = network.parameters().iter().map(of_file).collect::<Result<_>>()?;
        let mut parameters = vec![0.0; network.graph().parameter_count()];
        for (parameter, numbers) in of_file {
            parameter.put_file_order(numbers, &mut parameters);
        }
        Self::new(description, parameters)
    }

    /// Predicted accelerations â at the last row of each window, in the order of [`crate::flight::Column::TARGETS`], m/s² and
    /// rad/s².
    ///
    /// # Errors
    /// [`Error::Config`] if a flight's step is not the trained one or a window does not hold a full history; [`Error::Undetermined`] if a
    /// prediction is not finite; what evaluating the model gives.
    pub fn predict(&self, flights: &[Flight], windows: &[Window], threads: Threads) -> Result<Vec<PerChannel<f64>>> {
        self.check_windows(flights, windows)?;
        self.complete_windows(flights, &sequence::sequences(flights, &self.description)?, windows, threads)
    }

    /// Refuses a flight sampled at another step than the training data, and a window without a full history.
    fn check_windows(&self, flights: &[Flight], windows: &[Window]) -> Result<()> {
        let config = &self.description.config;
        flights.iter().try_for_each(|flight| self.description.check_step(flight))?;
        let whole = |window: &Window| {
            window.last + 1 >= config.history() && flights.get(window.flight).is_some_and(|flight| window.last < flight.len())
        };
        windows.iter().find(|window| !whole(window)).map_or(Ok(()), |window| {
            Err(Error::Config {
                place: "prediction".into(),
                field: "window".into(),
                found: format!("flight {}, row {}", window.flight, window.last),
                expected: format!("a row with a full history of {} samples", config.history()),
            })
        })
    }

    /// The network on windows that have been checked, on top of the sequences' baselines.
    fn complete_windows(
        &self,
        flights: &[Flight],
        sequences: &[sequence::Sequence],
        windows: &[Window],
        threads: Threads,
    ) -> Result<Vec<PerChannel<f64>>> {
        let mut session = Session::infer(self.network.graph(), &[self.network.output()], threads)?;
        session.load(&self.parameters)?;
        let mut predicted = Vec::with_capacity(windows.len());
        for chunk in windows.chunks(CHUNK) {
            let fill = |sample: usize, slabs: &mut [&mut [f32]]| {
                if let (Some(window), [state, physics, ..]) = (chunk.get(sample), slabs) {
                    sequences[window.flight].history(window.last, state, physics);
                }
            };
            session.predict(chunk.len(), &fill, &mut |sample, output| {
                let window = chunk[sample];
                predicted.push(self.complete(sequences[window.flight].baseline(window.last), self.learned(output)));
            })?;
        }
        for (window, values) in windows.iter().zip(&predicted) {
            check_finite(&flights[window.flight], window.last, values)?;
        }
        Ok(predicted)
    }

    /// What the network says, on top of the baseline where it is a residual.
    fn complete(&self, baseline: PerChannel<f64>, learned: PerChannel<f64>) -> PerChannel<f64> {
        let residual = self.description.config.predicts_residual();
        PerChannel::from_fn(|channel| if residual { baseline[channel] + learned[channel] } else { learned[channel] })
    }

    /// The network's last row behind the gate, m/s² and rad/s².
    fn learned(&self, output: &[f32]) -> PerChannel<f64> {
        let last = &output[output.len().saturating_sub(6)..];
        PerChannel::from_fn(|channel| {
            last.get(channel.index()).copied().map_or(f64::NAN, f64::from) * self.description.gate[channel]
        })
    }

    /// A predictor that takes one sample at a time.
    ///
    /// # Errors
    /// As [`Model::stream`].
    pub fn stream(&self) -> Result<StreamingHybrid<&Self>> {
        StreamingHybrid::new(self)
    }

    /// As [`Hybrid::stream`], for a stream that outlives the place where it is made.
    ///
    /// # Errors
    /// As [`Hybrid::stream`].
    pub fn into_stream(self: Arc<Self>) -> Result<StreamingHybrid<Arc<Self>>> {
        StreamingHybrid::new(self)
    }
}

/// The numbers of a parameter in a network's file, or what is wrong with them.
fn numbers_of<'a>(file: &'a SafeTensors, parameter: &Parameter) -> Result<&'a [f32], String> {
    let (name, lengths) = (&parameter.name, parameter.file_lengths());
    let tensor = file.tensors.get(name).ok_or_else(|| format!("lacks the tensor `{name}`"))?;
    match &tensor.numbers {
        Numbers::F32(numbers) if tensor.shape == lengths && numbers.iter().all(|number| number.is_finite()) => Ok(numbers),
        _ => Err(format!("tensor `{name}` is not finite f32 of shape {lengths:?}, which its description asks for")),
    }
}

/// Refuses a prediction that is no number.
///
/// # Errors
/// [`Error::Undetermined`] naming flight, sample and channel.
pub fn check_finite(flight: &Flight, sample: usize, predicted: &PerChannel<f64>) -> Result<()> {
    let Some((channel, value)) = predicted.pairs().find(|(_, value)| !value.is_finite()) else { return Ok(()) };
    Err(Error::Undetermined(format!(
        "flight `{}`, sample {sample} ({:.2} s): the predicted `{}` is {}, not a finite number; look at the flight there, and at the \
         scales and weights of the network",
        flight.name,
        flight.time_s(sample),
        channel.name(),
        value
    )))
}

/// The factor γ of [`Hybrid::fit_gate`] for pairs (left over by the baseline, said by the network) and the block of each.
fn gate(pairs: &[(f64, f64)], blocks: &[usize]) -> f64 {
    let (cross, square) =
        pairs.iter().fold((0.0, 0.0), |(cross, square), (left, said)| (cross + left * said, square + said * said));
    if cross <= 0.0 || square <= 0.0 {
        return 0.0;
    }
    let factor = (cross / square).min(1.0);
    // Fall of the squared error, block by block.
    let mut gains = vec![0.0; blocks.iter().max().map_or(0, |last| last + 1)];
    for ((left, said), block) in pairs.iter().zip(blocks) {
        gains[*block] += left * left - (left - factor * said).powi(2);
    }
    let count = gains.len() as f64;
    let total: f64 = gains.iter().sum();
    let variance = gains.iter().map(|gain| (gain - total / count).powi(2)).sum::<f64>() * count / (count - 1.0).max(1.0);
    if total > variance.sqrt() { factor } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(said: impl Fn(usize) -> f64) -> (Vec<(f64, f64)>, Vec<usize>) {
        let left = |index: usize| (index as f64 * 0.7).sin();
        ((0..400).map(|index| (left(index), said(index))).collect(), (0..400).map(|index| index / 20).collect())
    }

    #[test]
    fn the_gate_keeps_what_carries_over_shrinks_what_is_too_large_and_shuts_out_noise() {
        let close = |found: f64, expected: f64| (found - expected).abs() < phyture_kernels::Tolerance::Close.relative_f64();
        let (exact, blocks) = pairs(|index| (index as f64 * 0.7).sin());
        assert!(close(gate(&exact, &blocks), 1.0));
        let (large, blocks) = pairs(|index| 2.0 * (index as f64 * 0.7).sin());
        assert!(close(gate(&large, &blocks), 0.5));
        let (small, blocks) = pairs(|index| 0.5 * (index as f64 * 0.7).sin());
        assert!(close(gate(&small, &blocks), 1.0));
        let (opposite, blocks) = pairs(|index| -(index as f64 * 0.7).sin());
        assert!(close(gate(&opposite, &blocks), 0.0));
        // Uncorrelated but for chance: the gain is within its standard error.
        let (noise, blocks) = pairs(|index| (index as f64 * 12.9898 + 1.0).sin() * (index as f64 * 78.233).cos());
        assert!(close(gate(&noise, &blocks), 0.0));
        assert!(close(gate(&[], &[]), 0.0));
    }
}
