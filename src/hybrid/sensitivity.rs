//! How a hybrid's prediction moves with the coefficients of its model: by reverse mode through the network, and by drawing
//! coefficients anew. Numbers a window only; what they mean for the error is in `critique`.
//!
//! Weights of network and linear history, scales and gate stay as they were trained: the question is what another value of a
//! coefficient would do to *this* hybrid, not to one that is trained anew.

use super::sequence::{Sequence, sequences};
use super::{CHUNK, Description, Hybrid};
use crate::error::Result;
use crate::flight::{Accelerations, Channel, Flight, PerChannel, Window};
use crate::nn::{LossRule, Network};
use crate::physics::{Estimate, Model, correlation_matrix};
use crate::tape::ops::{LastRows, Linear};
use crate::tape::{Graph, Session, Threads, Var};
use nalgebra::{DMatrix, DVector};
use phyture_kernels::random::Stream;
use std::collections::BTreeMap;

/// Half-width of a 95 % interval over the standard deviation of a normal distribution. Intervals that were made with Student's t
/// are wider: taken for normal they give a standard deviation that is up to 4 % too large with 30 and more degrees of freedom.
pub const HALF_WIDTH: f64 = 1.959_963_984_540_054;

/// What one coefficient does at one window, m/s² and rad/s²: the change of the prediction when it moves by half the width of its
/// 95 % interval, upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Movement {
    /// Of the model alone, ∂a^p/∂θ · h.
    pub physics: PerChannel<f64>,
    /// Of the whole hybrid, ∂â/∂θ · h.
    pub hybrid: PerChannel<f64>,
}

impl Hybrid {
    /// The coefficients of the model's enabled effects that have an interval.
    pub fn estimates(&self) -> Vec<Estimate> {
        let effects = self.description.model.effects.iter().filter(|effect| effect.enabled);
        let all = effects.flat_map(|effect| effect.coefficients.iter().map(move |coefficient| (effect, coefficient)));
        all.filter_map(|(effect, coefficient)| {
            Some(Estimate {
                effect: effect.name.clone(),
                name: coefficient.name.clone(),
                value: coefficient.value,
                ci95: Some(coefficient.ci95.filter(|bounds| bounds.iter().all(|bound| bound.is_finite()))?),
                unit: coefficient.unit.clone(),
                bounds: None,
                by_flight: None,
            })
        })
        .collect()
    }

    /// The correlations of these estimates, as the model keeps them.
    pub fn correlations(&self, estimates: &[Estimate]) -> DMatrix<f64> {
        let label = |estimate: &Estimate| format!("{}.{}", estimate.effect, estimate.name);
        correlation_matrix(&self.description.model.correlations, &estimates.iter().map(label).collect::<Vec<_>>())
    }

    /// For each estimate, its [`Movement`] at the last row t of each window.
    ///
    /// With physics history P, scaled by mean μ and deviation σ, gate γ and h half the width of the interval,
    ///
    /// ∂â_c/∂θ = ∂a^p_c/∂θ (t) + γ_c Σ_(k, p) ∂net_c/∂P_(k, p) · ∂a^p_p/∂θ (t − H + 1 + k) / σ_p,
    ///
    /// the first summand only where the network predicts a residual. ∂net/∂P comes from the tape, one backward pass a channel;
    /// ∂a^p/∂θ is the difference of the model at θ ± h over 2 h, exact where a^p is linear in θ (always, but for a formula that
    /// names another effect's coefficient). State-control inputs and linear history are formulas of the log with fixed weights,
    /// so no coefficient moves them. A coefficient that differs from flight to flight moves by h in all of them.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn movements(
        &self,
        flights: &[Flight],
        windows: &[Window],
        estimates: &[Estimate],
        threads: Threads,
    ) -> Result<Vec<Vec<Movement>>> {
        self.check_windows(flights, windows)?;
        let description = &self.description;
        let probe = Probe::new(description)?;
        let mut session = Session::train(&probe.graph, probe.chosen, &[], threads)?;
        let mut parameters = self.parameters.clone();
        let weights = parameters.len();
        parameters.resize(weights + 6, 0.0);
        let residual = description.config.predicts_residual();
        let mut found = vec![vec![Movement::default(); windows.len()]; estimates.len()];
        for (flight, members) in by_flight(windows) {
            let Some(flight) = flights.get(flight) else { continue };
            let changes: Vec<Change> =
                estimates.iter().map(|estimate| Change::new(&description.model, flight, estimate)).collect::<Result<_>>()?;
            for (found, change) in found.iter_mut().zip(&changes) {
                for (channel, values) in &change.channels {
                    for &index in &members {
                        let value = values[windows[index].last];
                        found[index].physics[*channel] = value;
                        found[index].hybrid[*channel] = if residual { value } else { 0.0 };
                    }
                }
            }
            if !description.config.reads_physics() {
                continue;
            }
            let sequences = sequences(std::slice::from_ref(flight), description)?;
            let Some(sequence) = sequences.first() else { continue };
            for chunk in members.chunks(CHUNK) {
                let last = |sample: usize| chunk.get(sample).map_or(0, |&index| windows[index].last);
                for channel in Channel::ALL {
                    parameters[weights..].fill(0.0);
                    parameters[weights + channel.index()] = 1.0;
                    step(&mut session, &parameters, chunk.len(), sequence, &last)?;
                    // The session's gradient is that of the mean over the chunk.
                    let factor = description.gate[channel] * chunk.len() as f64;
                    for (sample, &index) in chunk.iter().enumerate() {
                        let gradient = session.input_gradient(1, sample)?;
                        for (found, change) in found.iter_mut().zip(&changes) {
                            found[index].hybrid[channel] += factor * change.through(gradient, last(sample), description);
                        }
                    }
                }
            }
        }
        Ok(found)
    }

    /// The standard deviation of the prediction at each window over `draws` hybrids whose coefficients are drawn from a normal
    /// distribution about their values, with half the width of the 95 % interval as 1.96 standard deviations and the model's
    /// correlations. The whole hybrid is run for each: no linearisation.
    ///
    /// The same seed draws the same coefficients. The relative standard error of a standard deviation from n draws is about
    /// 1/√(2 n − 2): 13 % for 30.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn resampled(
        &self,
        flights: &[Flight],
        windows: &[Window],
        estimates: &[Estimate],
        draws: usize,
        seed: u64,
        threads: Threads,
    ) -> Result<Vec<PerChannel<f64>>> {
        self.check_windows(flights, windows)?;
        // Mean and sum of squared deviations, updated draw by draw (Welford 1962).
        let mut moments = vec![PerChannel::splat((0.0, 0.0)); windows.len()];
        let root = square_root(self.correlations(estimates));
        for draw in 0..draws {
            let mut model = self.description.model.clone();
            let drawn = &root * DVector::from_fn(estimates.len(), |index, _| normal(seed, draw as u64, index as u64));
            for (estimate, drawn) in estimates.iter().zip(drawn.iter()) {
                shift(&mut model, estimate, half_width(estimate) / HALF_WIDTH * drawn);
            }
            let hybrid = Self::new(Description { model, ..self.description.clone() }, self.parameters.clone())?;
            for (flight, members) in by_flight(windows) {
                let Some(flight) = flights.get(flight) else { continue };
                let own: Vec<Window> = members.iter().map(|&index| Window { flight: 0, last: windows[index].last }).collect();
                let predicted = hybrid.predict(std::slice::from_ref(flight), &own, threads)?;
                for (&index, predicted) in members.iter().zip(&predicted) {
                    for ((mean, squares), value) in moments[index].iter_mut().zip(predicted) {
                        let before = value - *mean;
                        *mean += before / (draw + 1) as f64;
                        *squares += before * (value - *mean);
                    }
                }
            }
        }
        let freedom = draws.saturating_sub(1).max(1) as f64;
        Ok(moments.into_iter().map(|window| window.map(|(_, squares)| (squares / freedom).sqrt())).collect())
    }
}

/// The symmetric square root of a matrix of correlations. Rounded ones, and those of fewer worlds than numbers, may have an eigenvalue below zero,
/// which counts as zero.
fn square_root(correlations: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = correlations.symmetric_eigen();
    let roots = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0).sqrt()));
    &eigen.eigenvectors * roots * eigen.eigenvectors.transpose()
}

/// Half the width of the 95 % interval; zero without one.
pub fn half_width(estimate: &Estimate) -> f64 {
    estimate.ci95.map_or(0.0, |[low, high]| 0.5 * (high - low))
}

/// Standard normal (Box & Muller 1958), number `index` of draw `draw`.
fn normal(seed: u64, draw: u64, index: u64) -> f64 {
    /// A site that neither dropout nor the order of windows has.
    const SITE: u64 = u64::MAX - 1;
    let stream = Stream::new(seed, draw, SITE, index);
    (-2.0 * (1.0 - stream.uniform(0)).ln()).sqrt() * (std::f64::consts::TAU * stream.uniform(1)).cos()
}

/// Adds `by` to a coefficient, in every flight.
fn shift(model: &mut Model, estimate: &Estimate, by: f64) {
    let coefficient = model.effect_mut(&estimate.effect).and_then(|effect| effect.coefficient_mut(&estimate.name));
    if let Some(coefficient) = coefficient {
        coefficient.value += by;
        coefficient.by_flight.iter_mut().flatten().for_each(|(_, value)| *value += by);
    }
}

/// Indices of the windows of each flight.
fn by_flight(windows: &[Window]) -> BTreeMap<usize, Vec<usize>> {
    let mut found = BTreeMap::<usize, Vec<usize>>::new();
    windows.iter().enumerate().for_each(|(index, window)| found.entry(window.flight).or_default().push(index));
    found
}

/// The change of a^p over a flight when one coefficient moves by half the width of its interval.
struct Change {
    /// Channels that change, each with one value a sample.
    channels: Vec<(Channel, Vec<f64>)>,
}

impl Change {
    fn new(model: &Model, flight: &Flight, estimate: &Estimate) -> Result<Self> {
        let at = |sign: f64| -> Result<Accelerations> {
            let mut moved = model.clone();
            shift(&mut moved, estimate, sign * half_width(estimate));
            moved.predict(flight)
        };
        let pairs = Channel::ALL.into_iter().zip(at(1.0)?.into_iter().zip(at(-1.0)?));
        let changed = pairs.map(|(channel, (up, down))| {
            (channel, up.into_iter().zip(down).map(|(up, down)| 0.5 * (up - down)).collect::<Vec<f64>>())
        });
        Ok(Self { channels: changed.filter(|(_, values)| values.iter().any(|value| *value != 0.0)).collect() })
    }

    /// Σ gradient · change / σ over the history that ends at row `last`; `gradient` is `[H, 6]`, empty if none reaches the input.
    fn through(&self, gradient: &[f32], last: usize, description: &Description) -> f64 {
        let start = (last + 1).saturating_sub(gradient.len() / 6);
        let of_channel = |(channel, values): &(Channel, Vec<f64>)| {
            let along = gradient.iter().skip(channel.index()).step_by(6).zip(values.iter().skip(start));
            along.map(|(gradient, change)| f64::from(*gradient) * change).sum::<f64>()
                / description.scaling.physics[*channel].deviation
        };
        self.channels.iter().map(of_channel).sum()
    }
}

/// The network with one of its six outputs as the number to differentiate; which one, six further weights after its own say.
struct Probe {
    graph: Graph<f32>,
    chosen: Var,
}

impl Probe {
    fn new(description: &Description) -> Result<Self> {
        let rule = LossRule { scale: 1.0, standardise: false, input_gradients: true };
        let network = Network::<f32>::record(&description.config, &description.output_scale(), rule)?;
        let mut graph = network.graph().clone();
        let weight = graph.parameter("sensitivity.channel", &[1, description.config.outputs()])?;
        let rows = graph.apply(Linear, &[network.output(), weight])?;
        let chosen = graph.apply(LastRows { count: 1 }, &[rows])?;
        Ok(Self { graph, chosen })
    }
}

/// One forward and backward pass over the windows of one flight that end at `last(sample)`.
fn step(
    session: &mut Session<f32>,
    parameters: &[f32],
    samples: usize,
    sequence: &Sequence,
    last: &(dyn Fn(usize) -> usize + Sync),
) -> Result<()> {
    let fill = |sample: usize, slabs: &mut [&mut [f32]]| {
        if let [state, physics, ..] = slabs {
            sequence.history(last(sample), state, physics);
        }
    };
    session.step(parameters, samples, None, &fill)?;
    Ok(())
}
