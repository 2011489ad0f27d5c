//! Models and networks rolled out on flights that were kept back, beside yardsticks that predict no change. The errors themselves are made in
//! `critique`.

use crate::critique::diagnose::{Met, met};
use crate::critique::rollout::{Judge, Rollouts, Sums, collected};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{DataSet, Window};
use crate::hybrid::{Hybrid, HybridRollout};
use crate::physics::Model;
use crate::physics::rollout::{Rollout, starts};

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

/// The row of the yardstick that differences are relative to.
const RATES_HELD: usize = 1;

impl Rolling<'_> {
    /// Rolls out from the same starts in the test part of `split` for all rows. The yardsticks come first: the state held, and the first model
    /// (of the first network, where there is none) with its rates held.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where no start fits; as [`Rollout::new`] and [`HybridRollout::new`]; [`Error::Config`] without any model.
    pub fn run(&self, set: &DataSet, split: &Split) -> Result<Rollouts> {
        let (flights, horizon) = (&set.flights, self.horizon);
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        let Met { models: met, judged: spans, own_from_first_half } = met(flights, &all, &split.test)?;
        let Some(first) = met.first() else {
            let (place, field) = ("rollout".into(), "models".into());
            return Err(Error::Config { place, field, found: "none".into(), expected: "a model or a network".into() });
        };
        let first_name = self.models.iter().map(|(name, _)| name).chain(self.networks.iter().map(|(name, _)| name)).next();
        let held = Rollout::new(first, flights, horizon)?.with_rates_held();
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
        let of_physics = |rollout: &Rollout<'_>| collected(rollout.roll(&starts, None, &|rolled| judge.sums(rolled)));
        let mut rows: Vec<(String, Vec<Sums>)> = vec![("state held".into(), judge.state_held())];
        rows.push((format!("{}, rates held", first_name.map_or("", String::as_str)), of_physics(&held)?));
        for ((name, _), model) in self.models.iter().zip(&met) {
            rows.push((name.clone(), of_physics(&Rollout::new(model, flights, horizon)?)?));
        }
        for ((name, hybrid), model) in self.networks.iter().zip(&met[self.models.len()..]) {
            rows.push((name.clone(), of_hybrid(&hybrid.on(model.clone())?, set, &starts, &judge, horizon)?));
        }
        let rows = judge.rows(rows, RATES_HELD);
        let mut result = judge.result(rows, RATES_HELD, self.stride, split.tested);
        result.own_from_first_half = own_from_first_half;
        Ok(result)
    }
}

fn of_hybrid(hybrid: &Hybrid, set: &DataSet, starts: &[Window], judge: &Judge<'_>, horizon: usize) -> Result<Vec<Sums>> {
    let rollout = HybridRollout::new(hybrid, &set.flights, horizon)?;
    collected(rollout.roll(starts, &|rolled| judge.sums(rolled)))
}
