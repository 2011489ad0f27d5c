//! Models and networks rolled out on flights that were kept back, beside yardsticks that predict no change; from many starts at once, or from one
//! with all states on the way. The errors themselves are made in `critique`.

use crate::critique::diagnose::{Met, met};
use crate::critique::rollout::{Judge, PerQuantity, Rollouts, Sums, at_place_of};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{DataSet, Flight, Span, Window};
use crate::hybrid::{Hybrid, HybridRollout};
use crate::physics::Model;
use crate::physics::rollout::{Each, Rolled, Rollout, State, check_horizon, has_position, starts};

/// Who is rolled out, and from where. Work is shared with the other threads of the pool it runs in.
pub struct Rolling<'a> {
    /// Physical models by name.
    pub models: &'a [(String, Model)],
    /// Hybrids by name.
    pub networks: &'a [(String, Hybrid)],
    /// Steps.
    pub horizon: usize,
    /// Samples between starts.
    pub stride: usize,
}

/// Where all predictors lead from one start.
#[derive(Clone, Debug)]
pub struct FromOne {
    /// Length of a step, s.
    pub step_s: f64,
    /// The measured states, at the start and after each step.
    pub measured: Vec<State>,
    /// Whether the log has no position, and the way that the recorded velocity makes stands for it.
    pub position_from_velocity: bool,
    /// The yardsticks, then models, then networks.
    pub paths: Vec<Path>,
}

/// Where one predictor leads from one start.
#[derive(Clone, Debug)]
pub struct Path {
    /// Name of the predictor.
    pub name: String,
    /// The predicted states, at the start and after each step.
    pub states: Vec<State>,
    /// The step at which it ran out of bounds, if it did.
    pub stopped: Option<usize>,
    /// Error after 1 … H steps.
    pub error: PerQuantity<Vec<f64>>,
}

/// The row of the yardstick that differences are relative to.
const RATES_HELD: usize = 1;

/// What the first yardstick is called.
const STATE_HELD: &str = "state held";

impl Rolling<'_> {
    /// Rolls out from the same starts in the test part of `split` for all rows. The yardsticks come first: the state held, and the first model
    /// (of the first network, where there is none) with its rates held.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where no start fits; as [`Rollout::new`] and [`HybridRollout::new`]; [`Error::Config`] without any model.
    pub fn run(&self, set: &DataSet, split: &Split) -> Result<Rollouts> {
        let (flights, horizon) = (&set.flights, self.horizon);
        // Said before what the division of the flights leaves.
        check_horizon(flights, horizon)?;
        let Met { models: met, judged: spans, own_from_first_half } = met(flights, &self.all()?, &split.test)?;
        let history = self.networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
        let starts = starts(&spans, history, horizon, self.stride);
        if starts.is_empty() {
            let rows = history.max(2);
            return Err(Error::Undetermined(format!(
                "no run of test samples holds the {horizon} samples of the horizon after {rows} before them; give a shorter --horizon, longer \
                 flights, or lock whole flights with --lock"
            )));
        }
        let judge = Judge::new(flights, &starts, horizon);
        let mut rows: Vec<(String, Vec<Sums>)> = vec![(STATE_HELD.into(), judge.state_held())];
        let predictors = self.predictors(flights, &met, &starts, &|rolled| judge.sums(rolled))?;
        rows.extend(predictors.into_iter().map(|(name, batches)| (name, batches.into_iter().flatten().collect())));
        let rows = judge.rows(rows, RATES_HELD);
        let mut result = judge.result(rows, RATES_HELD, self.stride, split.tested);
        result.own_from_first_half = own_from_first_half;
        Ok(result)
    }

    /// Rolls out from one sample, `start.last`, of one flight, with the same rows as [`Rolling::run`] and all states on the way. Positions of
    /// predictors count from the measured one.
    ///
    /// # Errors
    /// As [`Rolling::run`]; [`Error::Shape`] for a start without room for the horizon.
    pub fn from_one(&self, set: &DataSet, split: &Split, start: Window) -> Result<FromOne> {
        let missing = || Error::Shape { operation: "rollout", message: format!("there is no flight {}", start.flight) };
        let flight = set.flights.get(start.flight).ok_or_else(missing)?;
        // A set of this flight alone: no other has to be looked at.
        let flights = std::slice::from_ref(flight);
        let spans: Vec<Span> =
            split.test.iter().filter(|span| span.flight == start.flight).map(|span| Span { flight: 0, ..*span }).collect();
        let Met { models: met, .. } = met(flights, &self.all()?, &spans)?;
        let starts = [Window { flight: 0, last: start.last }];
        if start.last + self.horizon >= flight.len() {
            let message = format!("sample {} of `{}` has no {} samples after it", start.last, flight.name, self.horizon);
            return Err(Error::Shape { operation: "rollout", message });
        }
        let judge = Judge::new(flights, &starts, self.horizon);
        let measured: Vec<State> = (0..=self.horizon).map(|step| judge.measured(0, start.last + step)).collect();
        let lane = |rolled: &Rolled| {
            let states: Vec<State> = (0..=self.horizon).map(|step| rolled.state(0, step)).collect();
            (judge.sums(rolled), states, rolled.stopped.first().copied().flatten())
        };
        let held = (judge.state_held(), vec![measured[0]; self.horizon + 1], None);
        let mut lanes = vec![(STATE_HELD.to_owned(), vec![held])];
        lanes.extend(self.predictors(flights, &met, &starts, &lane)?);
        let (mut sums, mut ways) = (Vec::new(), Vec::new());
        for (name, (of, states, stopped)) in
            lanes.into_iter().flat_map(|(name, made)| made.into_iter().map(move |one| (name.clone(), one)))
        {
            sums.push((name, of));
            ways.push((states, stopped));
        }
        let path = |(row, (states, stopped)): (crate::critique::rollout::RolloutRow, (Vec<State>, Option<usize>))| {
            let begun = states.first().copied().unwrap_or(measured[0]);
            let states = states.into_iter().map(|there| at_place_of(&measured[0], &begun, there)).collect();
            Path { name: row.name, states, stopped, error: row.error }
        };
        let paths = judge.rows(sums, RATES_HELD).into_iter().zip(ways).map(path).collect();
        Ok(FromOne { step_s: flight.step_s, measured, position_from_velocity: !has_position(flight), paths })
    }

    /// The models, then those of the networks.
    fn all(&self) -> Result<Vec<&Model>> {
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        if all.is_empty() {
            let (place, field) = ("rollout".into(), "models".into());
            return Err(Error::Config { place, field, found: "none".into(), expected: "a model or a network".into() });
        }
        Ok(all)
    }

    /// What `each` makes of every batch of the first model with its rates held, of the models, and of the networks, by name; `met` are the models of
    /// [`Rolling::all`] with the numbers of these flights.
    fn predictors<T: Send>(
        &self,
        flights: &[Flight],
        met: &[Model],
        starts: &[Window],
        each: Each<'_, T>,
    ) -> Result<Vec<(String, Vec<T>)>> {
        let Some(first) = met.first() else { return Ok(Vec::new()) };
        let first_name = self.models.iter().map(|(name, _)| name).chain(self.networks.iter().map(|(name, _)| name)).next();
        let first = Rollout::new(first, flights, self.horizon)?;
        let held = first.clone().with_rates_held();
        let mut rows = vec![(format!("{}, rates held", first_name.map_or("", String::as_str)), held.roll(starts, None, each)?)];
        for (index, ((name, _), model)) in self.models.iter().zip(met).enumerate() {
            let other = (index > 0).then(|| Rollout::new(model, flights, self.horizon)).transpose()?;
            rows.push((name.clone(), other.as_ref().unwrap_or(&first).roll(starts, None, each)?));
        }
        for ((name, hybrid), model) in self.networks.iter().zip(&met[self.models.len()..]) {
            let hybrid = hybrid.on(model.clone())?;
            rows.push((name.clone(), HybridRollout::new(&hybrid, flights, self.horizon)?.roll(starts, each)?));
        }
        Ok(rows)
    }
}
