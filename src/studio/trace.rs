//! Predictions beside measurements over time, reduced to what a screen can show: in each pixel the smallest and the largest value, so that
//! peaks stay.

use super::history::State;
use super::recent::Recent;
use super::{Studio, fault};
use crate::error::Result;
use crate::flight::{Accelerations, Channel, Column, Flight};
use crate::physics::Model;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Pixels that may be asked for.
const MOST_PIXELS: usize = 8192;

/// The sticks, in the order of the log.
const STICKS: [Column; 4] = [Column::U1, Column::U2, Column::U3, Column::U4];

/// A number of an effect at another value than it has.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Move {
    /// Effect by name.
    pub effect: String,
    /// Coefficient or parameter by name.
    pub number: String,
    /// Its value, in the unit of the number.
    pub value: f64,
}

/// What is to be shown.
#[derive(Clone, Debug, Deserialize)]
pub struct TraceWanted {
    /// Index of the flight.
    pub flight: usize,
    /// Index of the acceleration.
    pub channel: Channel,
    /// From this time on, s; the whole flight without.
    #[serde(default)]
    pub from_s: Option<f64>,
    /// Up to this time, s.
    #[serde(default)]
    pub to_s: Option<f64>,
    /// Width of the picture.
    pub pixels: usize,
    /// Another state to lay beside.
    #[serde(default)]
    pub against: Option<u64>,
    /// A number that is being moved.
    #[serde(default)]
    pub moved: Option<Move>,
}

/// Lines over one time axis. Values are rounded to seven digits.
#[derive(Clone, Debug, Serialize)]
pub struct Trace {
    /// Time, s.
    pub t: Vec<f64>,
    /// Measured acceleration, m/s² or rad/s².
    pub measured: Vec<f32>,
    /// Predicted by the present state.
    pub predicted: Vec<f32>,
    /// Measured − predicted.
    pub residual: Vec<f32>,
    /// Predicted by the other state.
    pub against: Option<Vec<f32>>,
    /// Measured − predicted by the other state.
    pub against_residual: Option<Vec<f32>>,
    /// The four sticks.
    pub sticks: Vec<Vec<f32>>,
    /// First and last time of the whole flight, s.
    pub whole_s: [f64; 2],
    /// Samples that a point stands for; 1 where every sample is drawn.
    pub samples_per_point: f64,
    /// Root mean square of the residual over all samples shown, m/s² or rad/s².
    pub rmse: f64,
    /// The same of the other state.
    pub against_rmse: Option<f64>,
}

impl Studio {
    /// Lines of one channel over a stretch of a flight.
    ///
    /// # Errors
    /// [`crate::Error::Config`] where flight, width, state or number are not there; as [`Model::predict`].
    pub fn trace(&self, wanted: &TraceWanted) -> Result<Trace> {
        let flights = &self.set.flights;
        let flight = flights.get(wanted.flight).ok_or_else(|| {
            fault("flight", wanted.flight.to_string(), format!("an index below {}, the number of flights", flights.len()))
        })?;
        let channel = wanted.channel;
        if !(16..=MOST_PIXELS).contains(&wanted.pixels) {
            return Err(fault("pixels", wanted.pixels.to_string(), format!("16 to {MOST_PIXELS}")));
        }
        let now = self.now();
        let predicted = match &wanted.moved {
            Some(moved) => Arc::new(moved_model(&now.model, moved)?.predict(flight)?),
            None => self.predicted(&now, wanted.flight, flight)?,
        };
        let other = wanted.against.map(|id| self.predicted(&*self.state(Some(id))?, wanted.flight, flight)).transpose()?;
        let range = samples(flight, wanted.from_s, wanted.to_s);
        let measured = &flight.column(channel.column())[range.clone()];
        let line = |of: &Accelerations| of[channel][range.clone()].to_vec();
        let residual = |line: &[f64]| measured.iter().zip(line).map(|(measured, value)| measured - value).collect::<Vec<f64>>();
        let predicted = line(&predicted);
        let left = residual(&predicted);
        let against = other.as_deref().map(line);
        let against_left = against.as_deref().map(residual);
        let grid = Grid::new(range.len(), wanted.pixels);
        let reduced = |values: &[f64]| grid.reduced(values);
        Ok(Trace {
            t: grid.places().map(|place| flight.time_s(range.start + place)).collect(),
            measured: reduced(measured),
            predicted: reduced(&predicted),
            residual: reduced(&left),
            sticks: STICKS.iter().map(|stick| reduced(&flight.column(*stick)[range.clone()])).collect(),
            whole_s: [flight.time_s(0), flight.time_s(flight.len() - 1)],
            samples_per_point: grid.samples_per_point(),
            rmse: root_mean_square(&left),
            against_rmse: against_left.as_deref().map(root_mean_square),
            against: against.as_deref().map(reduced),
            against_residual: against_left.as_deref().map(reduced),
        })
    }

    /// What a state predicts of a flight.
    fn predicted(&self, state: &State, index: usize, flight: &Flight) -> Result<Arc<Accelerations>> {
        self.predictions.get((state.id, index), || state.model.predict(flight))
    }
}

/// Predictions of flights that are kept: a person zooms in one flight, and compares two states.
pub(super) const PREDICTIONS: usize = 8;

/// Predictions by state and flight.
pub(super) type Predictions = Recent<(u64, usize), Accelerations>;

/// A model with one number moved.
pub(super) fn moved_model(model: &Model, moved: &Move) -> Result<Model> {
    let Move { effect: name, number, value } = moved;
    if !value.is_finite() {
        return Err(fault("value", value.to_string(), "a finite number"));
    }
    let mut model = model.clone();
    let effect = model.effect_mut(name).ok_or_else(|| fault("effect", format!("`{name}`"), "an effect of the model"))?;
    let missing = || fault("number", format!("`{number}`"), format!("a coefficient or parameter of `{name}`"));
    if let Some(coefficient) = effect.coefficient_mut(number) {
        // A property of each flight moves in all of them by the same.
        let by = value - coefficient.value;
        coefficient.by_flight.iter_mut().flat_map(|values| values.values_mut()).for_each(|own| *own += by);
        (coefficient.value, coefficient.ci95) = (*value, None);
    } else {
        let parameter = effect.parameters.iter_mut().find(|parameter| parameter.name == *number).ok_or_else(missing)?;
        (parameter.value, parameter.ci95) = (*value, None);
    }
    Ok(model)
}

/// The samples between two times; at least two where the flight has them.
fn samples(flight: &Flight, from_s: Option<f64>, to_s: Option<f64>) -> std::ops::Range<usize> {
    let last = flight.len() - 1;
    // Not a number becomes 0, the first sample.
    let place = |time_s: f64| ((time_s - flight.start_s) / flight.step_s).clamp(0.0, last as f64);
    let start = from_s.map_or(0, |time_s| place(time_s).floor() as usize).min(last.saturating_sub(1));
    let end = to_s.map_or(last, |time_s| place(time_s).ceil() as usize).max(start + 1).min(last);
    start..end + 1
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Samples gathered into pixels.
struct Grid {
    samples: usize,
    /// None where every sample is drawn.
    bins: Option<usize>,
}

impl Grid {
    fn new(samples: usize, pixels: usize) -> Self {
        Self { samples, bins: (samples > 2 * pixels).then_some(pixels) }
    }

    /// First sample of a bin.
    const fn start(&self, bin: usize, bins: usize) -> usize {
        bin * self.samples / bins
    }

    /// The sample at whose time each point is drawn: of each bin the first and the middle one.
    fn places(&self) -> Box<dyn Iterator<Item = usize> + '_> {
        match self.bins {
            None => Box::new(0..self.samples),
            Some(bins) => Box::new((0..bins).flat_map(move |bin| {
                let (start, end) = (self.start(bin, bins), self.start(bin + 1, bins));
                [start, usize::midpoint(start, end)]
            })),
        }
    }

    /// Of each bin the smallest and the largest value, in the order in which they come.
    fn reduced(&self, values: &[f64]) -> Vec<f32> {
        let Some(bins) = self.bins else { return values.iter().map(|value| *value as f32).collect() };
        let mut points = Vec::with_capacity(2 * bins);
        for bin in 0..bins {
            let within = &values[self.start(bin, bins)..self.start(bin + 1, bins)];
            let (mut low, mut high) = (0, 0);
            for (place, value) in within.iter().enumerate() {
                if *value < within[low] {
                    low = place;
                }
                if *value > within[high] {
                    high = place;
                }
            }
            points.extend([within[low.min(high)] as f32, within[low.max(high)] as f32]);
        }
        points
    }

    fn samples_per_point(&self) -> f64 {
        self.bins.map_or(1.0, |bins| self.samples as f64 / (2 * bins) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_peak_of_one_sample_survives() {
        let mut values = vec![0.0; 100_000];
        values[77_777] = 9.0;
        values[77_778] = -5.0;
        let grid = Grid::new(values.len(), 300);
        let points = grid.reduced(&values);
        assert_eq!((points.len(), grid.places().count()), (600, 600));
        let high = points.iter().position(|value| *value == 9.0);
        let low = points.iter().position(|value| *value == -5.0);
        assert!(high.is_some() && low == high.map(|place| place + 1), "in the order of time: {high:?} {low:?}");
    }

    proptest! {
        #[test]
        fn reduced_lines_keep_extremes_and_their_places_grow(samples in 1usize..5000, pixels in 16usize..300) {
            let values: Vec<f64> = (0..samples).map(|sample| ((sample * 7919) % 1013) as f64).collect();
            let grid = Grid::new(samples, pixels);
            let places: Vec<usize> = grid.places().collect();
            prop_assert!(places.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(places.iter().all(|place| *place < samples));
            let points = grid.reduced(&values);
            prop_assert_eq!(points.len(), places.len());
            let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
            prop_assert_eq!(most(&mut points.iter().map(|point| f64::from(*point))), most(&mut values.iter().copied()));
        }
    }
}
