//! Open-loop prediction of the present state: from one moment of a flight with all states on the way, and its errors over all starts on flights that
//! no fit has seen. Both are those of `rollout`; here they are asked for by time and thinned for a screen.

use super::found::Found;
use super::recent::Recent;
use super::runs::{Content, Version};
use super::{Studio, fault};
use crate::critique::rollout::{PerQuantity, Quantity, Rollouts};
use crate::error::Result;
use crate::flight::attitude::quaternion_to_euler;
use crate::flight::{Flight, Window};
use crate::physics::rollout::State;
use crate::workflow::{FromOne, Rolling};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::Arc;

/// How far ahead may be looked, s.
const LONGEST_S: f64 = 60.0;

/// Points of a line at most.
const POINTS: usize = 200;

/// Steps that are predicted over all starts at most: an answer has to come while a person looks.
const MOST_STEPS: usize = 150_000;

/// The same where a network takes part.
const MOST_NETWORK_STEPS: usize = 10_000;

/// What the present state is called in rollouts.
const NAME: &str = "model";

/// Where a rollout begins, and how far it goes.
#[derive(Clone, Debug, Deserialize)]
pub struct RolloutWanted {
    /// Index of the flight.
    pub flight: usize,
    /// The moment, s; the first that can be without. One without room before the end is moved forward.
    #[serde(default)]
    pub at_s: Option<f64>,
    /// How far ahead, s.
    pub ahead_s: f64,
    /// Name of a network in the folder of the model that is rolled out beside the present state.
    #[serde(default)]
    pub network: Option<String>,
}

/// A rollout from one moment.
#[derive(Clone, Debug, Serialize)]
pub struct RolloutText {
    /// The moment, s.
    pub at_s: f64,
    /// Time after it, s, from 0 on.
    pub ahead_s: Vec<f64>,
    /// What was measured.
    pub measured: PerQuantity<[Vec<f32>; 3]>,
    /// What is predicted: both yardsticks, then the model, then the network.
    pub paths: Vec<PathText>,
    /// What stands for the position, where the log has none.
    pub note: Option<&'static str>,
}

/// What one predictor says.
#[derive(Clone, Debug, Serialize)]
pub struct PathText {
    /// Its name.
    pub name: String,
    /// Components: position from the start and velocity, north, east, down (m, m/s); roll, pitch, yaw (rad); body rates (rad/s).
    pub states: PerQuantity<[Vec<f32>; 3]>,
    /// Size of the error.
    pub error: PerQuantity<Vec<f32>>,
    /// When it ran out of bounds, s after the start.
    pub stopped_s: Option<f64>,
}

/// Rollouts from all starts.
#[derive(Clone, Debug, Serialize)]
pub struct RolloutsText {
    /// Errors by step.
    pub rollouts: Rollouts,
    /// What was rolled out, in words.
    pub basis: String,
    /// What so few blocks can say, if they are few.
    pub caution: Option<String>,
    /// What the figures mean.
    pub legend: String,
}

/// Errors over all starts by state, network and steps.
pub(super) type AllStarts = Recent<(u64, Option<Version>, usize), Rollouts>;

/// States and horizons whose errors over all starts are kept.
pub(super) const KEPT: usize = 8;

impl Studio {
    /// Rolls the present state out from one moment of a flight, beside the yardsticks.
    ///
    /// # Errors
    /// [`crate::Error::Config`] for a flight that is not there, or times that cannot be; as [`crate::physics::Model::predict`].
    pub fn rollout(&self, wanted: &RolloutWanted) -> Result<Found<RolloutText>> {
        let flights = &self.set.flights;
        let flight = flights.get(wanted.flight).ok_or_else(|| {
            fault("flight", wanted.flight.to_string(), format!("an index below {}, the number of flights", flights.len()))
        })?;
        let horizon = steps(flight, wanted.ahead_s)?;
        if wanted.at_s.is_some_and(|at_s| !at_s.is_finite()) {
            return Err(fault("at_s", "no finite number", "a time of the flight, s"));
        }
        if flight.len() < horizon + 2 {
            let longest_s = flight.len().saturating_sub(2) as f64 * flight.step_s;
            let why = format!(
                "`{}` is too short to look {} s ahead; look at most {longest_s:.1} s ahead, or choose a longer flight",
                flight.name, wanted.ahead_s
            );
            return Ok(Found::Missing { why });
        }
        let (_, content) = self.rolled(wanted.network.as_deref())?;
        let first = content.networks.iter().map(|(_, hybrid)| hybrid.description().config.history() - 1).max().unwrap_or(1);
        if flight.len() < first + horizon + 1 {
            let why = format!("`{}` is too short for the history of the network and {} s ahead", flight.name, wanted.ahead_s);
            return Ok(Found::Missing { why });
        }
        let sample = wanted.at_s.map_or(0.0, |at_s| ((at_s - flight.start_s) / flight.step_s).round());
        // The first sample has none before it, from which rates of change are known; a network needs its history.
        let last = (sample.max(0.0) as usize).clamp(first.max(1), flight.len() - 1 - horizon);
        let models = [(NAME.to_owned(), self.now().model.clone())];
        let rolling = Rolling { models: &models, networks: &content.networks, horizon, stride: 1 };
        let found = Found::of_log(rolling.from_one(&self.set, &self.split, Window { flight: wanted.flight, last }))?;
        Ok(found.map(|from_one| text(&from_one, flight.time_s(last))))
    }

    /// Errors of rollouts of the present state from many starts on flights that no fit has seen.
    ///
    /// # Errors
    /// As [`Studio::rollout`].
    pub fn rollouts(&self, ahead_s: f64, network: Option<&str>) -> Result<Found<RolloutsText>> {
        let Some(first) = self.set.flights.first() else { return Err(fault("flights", "none", "at least one")) };
        let (horizon, now) = (steps(first, ahead_s)?, self.now());
        let longest = self.split.test.iter().map(|span| span.end - span.start).max().unwrap_or(0);
        if longest < horizon + 2 {
            let most_s = longest.saturating_sub(2) as f64 * first.step_s;
            let why = format!(
                "no flight that no fit sees is long enough to look {ahead_s} s ahead; look at most {most_s:.1} s ahead, or lock a longer flight with --lock"
            );
            return Ok(Found::Missing { why });
        }
        let (version, content) = self.rolled(network)?;
        let most = if content.networks.is_empty() { MOST_STEPS } else { MOST_NETWORK_STEPS };
        let made = self.all_starts.get((now.id, version, horizon), || {
            let samples: usize = self.split.test.iter().map(|span| span.end - span.start).sum();
            let stride = (samples * horizon).div_ceil(most).max(1);
            let models = [(NAME.to_owned(), now.model.clone())];
            Rolling { models: &models, networks: &content.networks, horizon, stride }.run(&self.set, &self.split)
        });
        Ok(Found::of_log(made)?.map(|made| RolloutsText {
            basis: made.basis(),
            caution: made.caution(),
            legend: made.legend(),
            rollouts: Rollouts::clone(&made),
        }))
    }

    /// The network that is rolled out, and which version of its file it is; neither without a name.
    fn rolled(&self, network: Option<&str>) -> Result<(Option<Version>, Arc<Content>)> {
        let Some(name) = network else { return Ok((None, Arc::default())) };
        let (version, content) = self.network(name)?;
        Ok((Some(version), content))
    }
}

/// Steps of a flight in a time.
fn steps(flight: &Flight, ahead_s: f64) -> Result<usize> {
    let steps = (ahead_s / flight.step_s).round();
    if !(ahead_s <= LONGEST_S && steps >= 1.0) {
        return Err(fault("ahead_s", ahead_s.to_string(), format!("{} to {LONGEST_S} s", flight.step_s)));
    }
    Ok(steps as usize)
}

fn text(found: &FromOne, at_s: f64) -> RolloutText {
    let horizon = found.measured.len() - 1;
    let every = horizon.div_ceil(POINTS).max(1);
    let mut kept: Vec<usize> = (0..horizon).step_by(every).collect();
    kept.push(horizon);
    let thinned = |values: &[f64]| kept.iter().map(|step| values[*step] as f32).collect::<Vec<f32>>();
    let measured = components(&found.measured);
    let path = |path: &crate::workflow::Path| PathText {
        name: path.name.clone(),
        states: components(&path.states).map(|columns| columns.each_ref().map(|column| thinned(column))),
        error: PerQuantity::new(|quantity| {
            let from_start: Vec<f64> = [0.0].iter().chain(path.error.of(quantity)).copied().collect();
            thinned(&from_start)
        }),
        stopped_s: path.stopped.map(|step| step as f64 * found.step_s),
    };
    RolloutText {
        at_s,
        ahead_s: kept.iter().map(|step| *step as f64 * found.step_s).collect(),
        measured: measured.map(|columns| columns.each_ref().map(|column| thinned(column))),
        paths: found.paths.iter().map(path).collect(),
        note: found.position_from_velocity.then_some(crate::critique::rollout::POSITION_FROM_VELOCITY),
    }
}

/// States as columns; angles go on where they pass half a turn.
fn components(states: &[State]) -> PerQuantity<[Vec<f64>; 3]> {
    let from = states.first().map_or([0.0; 3], |state| state.position);
    let columns = |of: &dyn Fn(&State) -> [f64; 3]| {
        let values: Vec<[f64; 3]> = states.iter().map(of).collect();
        std::array::from_fn(|axis| values.iter().map(|value| value[axis]).collect::<Vec<f64>>())
    };
    PerQuantity::new(|quantity| match quantity {
        Quantity::Position => columns(&|state| std::array::from_fn(|axis| state.position[axis] - from[axis])),
        Quantity::Velocity => columns(&|state| state.velocity),
        Quantity::Attitude => columns(&|state| quaternion_to_euler(state.attitude)).map(going_on),
        Quantity::Rates => columns(&|state| state.rates),
    })
}

/// An angle without leaps of whole turns.
fn going_on(mut angles: Vec<f64>) -> Vec<f64> {
    for place in 1..angles.len() {
        let turns = ((angles[place] - angles[place - 1]) / TAU).round();
        angles[place] -= turns * TAU;
    }
    angles
}
