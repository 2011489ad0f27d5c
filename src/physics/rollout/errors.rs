//! How far rollouts lead astray, as numbers that can be made small: errors at some steps from each start, in units of what the same model
//! leaves with its rates held. What is fitted to them, nothing here knows.

use super::batch::Rolled;
use super::motion::{State, recorded_states};
use super::{Model, Rollout};
use crate::error::Result;
use crate::flight::attitude::rotation_vector;
use crate::flight::{Flight, Window};
use std::collections::BTreeMap;

/// Steps of a rollout at which its error counts: every tenth part of the horizon.
const JUDGED: usize = 10;
/// What is judged at each of them: position, velocity, attitude, rates, three components each.
pub(crate) const GROUPS: usize = 4;
pub(crate) const COMPONENTS: usize = 3 * GROUPS;
/// Weights of the four. Attitude and rates come before position and velocity, which follow from them.
const WEIGHTS: [f64; GROUPS] = [1.0, 1.0, 3.0, 3.0];
/// From this share of the usual error on, an error counts by its size, below by its square: what is judged in the end are mean sizes, and a mean
/// of squares would be made by the few rollouts that go far astray (Huber 1964).
pub(crate) const HUBER: f64 = 0.1;

/// Rollouts, and what their errors are measured in.
///
/// The error of a rollout after step k is, for each of position, velocity (north-east-down), attitude (rotation vector) and rates, a vector e; the
/// cost is the mean over rollouts and judged steps of Σ w ρ(|e| / s), where s is the mean error of the same model with its rates held, by class of
/// manoeuvre, step and quantity, ρ Huber's function and w 1, 1, 3, 3. Classes count alike.
pub(crate) struct Measure {
    starts: Vec<Window>,
    steps: Vec<usize>,
    /// By start and judged step, positions counted from the start.
    measured: Vec<State>,
    /// By start: its weight, so that classes count alike; together 1.
    weights: Vec<f64>,
    /// By start, judged step and group: one over the usual error.
    scales: Vec<f64>,
}

impl Measure {
    /// What a cost of rollouts is that err as those with rates held do, all by the same size.
    pub const USUAL: f64 = WEIGHTS[0] + WEIGHTS[1] + WEIGHTS[2] + WEIGHTS[3];

    /// For some starts, by flight and in order of time, and rollouts of `horizon` steps.
    ///
    /// # Errors
    /// As [`Rollout::roll`].
    pub fn new(model: &Model, flights: &[Flight], starts: Vec<Window>, horizon: usize) -> Result<Self> {
        let mut steps: Vec<usize> = (1..=JUDGED).map(|part| (part * horizon).div_ceil(JUDGED)).collect();
        steps.dedup();
        let mut classes: BTreeMap<&str, f64> = BTreeMap::new();
        let class = |start: &Window| flights[start.flight].manoeuvre.as_str();
        starts.iter().for_each(|start| *classes.entry(class(start)).or_default() += 1.0);
        let weights = starts.iter().map(|start| 1.0 / (classes[class(start)] * classes.len() as f64)).collect();
        let measured = measured(flights, &starts, &steps);
        let mut measure = Self { starts, steps, measured, weights, scales: Vec::new() };
        measure.scales = measure.usual_errors(model, flights, horizon)?;
        Ok(measure)
    }

    /// One over the mean error with rates held, by start, judged step and group; the same for all starts of a class.
    fn usual_errors(&self, model: &Model, flights: &[Flight], horizon: usize) -> Result<Vec<f64>> {
        let held = Rollout::new(model, flights, horizon)?.with_rates_held();
        let batches = held.roll(&self.starts, None, &|rolled| self.of_batch(rolled))?;
        let errors: Vec<f64> = batches.into_iter().flatten().collect();
        let by_start = self.steps.len() * GROUPS;
        let mut classes: BTreeMap<&str, (f64, Vec<f64>)> = BTreeMap::new();
        let class = |start: &Window| flights[start.flight].manoeuvre.as_str();
        for (start, errors) in self.starts.iter().zip(errors.chunks(3 * by_start)) {
            let (count, sums) = classes.entry(class(start)).or_insert_with(|| (0.0, vec![0.0; by_start]));
            *count += 1.0;
            sums.iter_mut().zip(errors.chunks(3)).for_each(|(sum, error)| *sum += size(error));
        }
        let of = |start: &Window| {
            let (count, sums) = &classes[class(start)];
            // Where nothing errs, nothing is to be gained.
            sums.iter().map(|sum| if *sum > 0.0 { *count / *sum } else { 0.0 }).collect::<Vec<f64>>()
        };
        Ok(self.starts.iter().flat_map(of).collect())
    }

    /// The starts.
    pub fn starts(&self) -> &[Window] {
        &self.starts
    }

    /// The steps at which errors count.
    pub fn steps(&self) -> &[usize] {
        &self.steps
    }

    /// Errors of the lanes of a batch at the judged steps, twelve numbers each, in the units of the states.
    pub fn of_batch(&self, rolled: &Rolled) -> Vec<f64> {
        let mut errors = Vec::with_capacity(rolled.lanes() * self.steps.len() * COMPONENTS);
        let first = self.starts.partition_point(|start| (start.flight, start.last) < (rolled.flight, rolled.starts[0]));
        for lane in 0..rolled.lanes() {
            let from = rolled.state(lane, 0).position;
            for (judged, &step) in self.steps.iter().enumerate() {
                errors.extend(self.apart(first + lane, judged, from, &rolled.state(lane, step)));
            }
        }
        errors
    }

    /// What a predicted state has more than the measured one, at a judged step, by its index, from a start, by its index; positions are counted
    /// from `from`.
    fn apart(&self, start: usize, judged: usize, from: [f64; 3], state: &State) -> [f64; COMPONENTS] {
        let measured = &self.measured[start * self.steps.len() + judged];
        let predicted = State { position: std::array::from_fn(|axis| state.position[axis] - from[axis]), ..*state };
        apart(measured, &predicted)
    }

    /// Errors of all starts, into units of the usual ones.
    pub fn scale(&self, errors: &mut [f64]) {
        errors.chunks_mut(3).zip(&self.scales).for_each(|(error, scale)| error.iter_mut().for_each(|part| *part *= scale));
    }

    /// Index of the start and weight of each error vector, in the order of the errors.
    pub fn vectors(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let steps = self.steps.len();
        let of = move |(start, weight): (usize, &f64)| {
            let weight = *weight / steps as f64;
            (0..steps).flat_map(move |_| WEIGHTS.map(|of_group| (start, weight * of_group)))
        };
        self.weights.iter().enumerate().flat_map(of)
    }

    /// The cost of scaled errors of all starts.
    pub fn cost(&self, errors: &[f64]) -> f64 {
        self.vectors().zip(errors.chunks(3)).map(|((_, weight), error)| weight * huber(size(error))).sum()
    }

    /// The part of the cost that one start has at one judged step, by their indices, for where it led; its position at the start was `from`.
    pub fn cost_at(&self, start: usize, judged: usize, from: [f64; 3], state: &State) -> f64 {
        let steps = self.steps.len();
        let scales = &self.scales[(start * steps + judged) * GROUPS..][..GROUPS];
        let errors = self.apart(start, judged, from, state);
        let of_group = |(group, error): (usize, &[f64])| WEIGHTS[group] * huber(size(error) * scales[group]);
        self.weights[start] / steps as f64 * errors.chunks(3).enumerate().map(of_group).sum::<f64>()
    }

    /// Mean sizes of scaled errors by group, classes alike.
    pub fn means(&self, errors: &[f64]) -> [f64; GROUPS] {
        let mut means = [0.0; GROUPS];
        let steps = self.steps.len() as f64;
        for (start, errors) in self.weights.iter().zip(errors.chunks(self.steps.len() * COMPONENTS)) {
            for (vector, error) in errors.chunks(3).enumerate() {
                means[vector % GROUPS] += start / steps * size(error);
            }
        }
        means
    }
}

/// The recorded states after each of some steps from each start, positions counted from the start.
fn measured(flights: &[Flight], starts: &[Window], steps: &[usize]) -> Vec<State> {
    let mut measured = Vec::with_capacity(starts.len() * steps.len());
    for of_flight in starts.chunk_by(|left, right| left.flight == right.flight) {
        let states = recorded_states(&flights[of_flight[0].flight]);
        for start in of_flight {
            let from = states[start.last].position;
            measured.extend(steps.iter().map(|step| {
                let state = states[start.last + step];
                State { position: std::array::from_fn(|axis| state.position[axis] - from[axis]), ..state }
            }));
        }
    }
    measured
}

/// ρ of an error's size.
fn huber(size: f64) -> f64 {
    if size > HUBER { size - 0.5 * HUBER } else { 0.5 * size * size / HUBER }
}

/// The length of a vector.
pub(crate) fn size(vector: &[f64]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// What a predicted state has more than a measured one: position, velocity, the vector of the rotation that leads there, rates.
fn apart(measured: &State, predicted: &State) -> [f64; COMPONENTS] {
    let less = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| b[axis] - a[axis]) };
    let parts = [
        less(measured.position, predicted.position),
        less(measured.velocity, predicted.velocity),
        rotation_vector(measured.attitude, predicted.attitude),
        less(measured.rates, predicted.rates),
    ];
    std::array::from_fn(|index| parts[index / 3][index % 3])
}
