//! Models and networks compared on flights that were kept back, beside honest yardsticks. The numbers themselves are made in `critique`.

use crate::critique::diagnose::{Met, met};
use crate::critique::locate::{Traced, stretches};
use crate::critique::shares::{self, shares};
use crate::critique::uncertainty::{Effort, uncertainty};
use crate::critique::{Comparison, Row, compare, coverage, finite_difference, floor, ridge};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::windows::windows;
use crate::flight::{Accelerations, DataSet, Flight, PerChannel, Window};
use crate::hybrid::Hybrid;
use crate::hybrid::linear::LinearConfig;
use crate::physics::Model;
use crate::stopwatch::Stopwatch;
use crate::tape::Threads;
use std::collections::BTreeSet;

/// Time that the networks together may take by default, s.
const BUDGET_S: f64 = 60.0;
/// A measurement of their speed takes about this long, s.
const MEASURED_S: f64 = 0.3;
/// Windows of the first measurement.
const FIRST_WINDOWS: usize = 16;

/// A stride that the networks can afford.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affordable {
    /// Samples from one window to the next.
    pub stride: usize,
    /// What every window would take, s.
    pub every_s: f64,
}

/// Samples from one window to the next with which all networks take at most about a minute: 1 where they can do every window.
///
/// Measured on a few windows, more of them until it takes long enough to be a measure; then rounded up to 1, 2 or 5 times a power of ten,
/// so that the next run on this machine most likely has the same. Where there is no clock every window is taken.
///
/// # Errors
/// As [`Hybrid::predict`].
pub fn affordable_stride(
    flights: &[Flight],
    every: &[Window],
    networks: &[(String, Hybrid)],
    threads: Threads,
) -> Result<Affordable> {
    let mut seconds = 0.0;
    for (_, hybrid) in networks {
        let mut count = FIRST_WINDOWS;
        loop {
            let some = every.get(..count).unwrap_or(every);
            let begun = Stopwatch::start();
            hybrid.stages(flights, some, threads)?;
            let gone = begun.seconds();
            if gone >= MEASURED_S || some.len() == every.len() {
                seconds += gone / some.len().max(1) as f64;
                break;
            }
            count *= 4;
        }
    }
    let every_s = seconds * every.len() as f64;
    Ok(Affordable { stride: round_stride(every_s / BUDGET_S), every_s })
}

/// Rows that every window must have before it is judged, the same for all: the longest history, of a ridge regression too if there is one.
pub fn rows_needed(networks: &[(String, Hybrid)], ridge: Option<usize>) -> usize {
    let history = networks.iter().map(|(_, hybrid)| hybrid.description().config.history()).max().unwrap_or(1);
    history.max(ridge.unwrap_or(1)).max(2)
}

/// The smallest of 1, 2, 5, 10, 20, 50 … that is no less than `wanted`.
fn round_stride(wanted: f64) -> usize {
    let mut power = 1;
    loop {
        for factor in [1, 2, 5] {
            let stride = factor * power;
            if stride as f64 >= wanted || stride >= 1_000_000 {
                return stride;
            }
        }
        power *= 10;
    }
}

/// Who is compared, and on what.
pub struct Contest<'a> {
    /// Physical models by name.
    pub models: &'a [(String, Model)],
    /// Hybrids by name.
    pub networks: &'a [(String, Hybrid)],
    /// Lags of a ridge regression fitted on the training part, if it is wanted.
    pub ridge: Option<usize>,
    /// Rows that every window must have before it is judged: the longest history of all.
    pub history: usize,
    /// Samples between windows.
    pub stride: usize,
    /// Whether the uncertainty of the physical coefficients is carried through the networks.
    pub uncertainty: bool,
    /// Seed of what is drawn for that.
    pub seed: u64,
    /// Threads of the networks.
    pub threads: Threads,
}

/// A comparison and what it was made from.
pub struct Judged {
    /// The numbers.
    pub comparison: Comparison,
    /// Where it was judged.
    pub windows: Vec<Window>,
    /// What each row predicts there; the first is the yardstick of finite differences.
    pub rows: Vec<Row>,
    /// The worst and a typical stretch of the last row, predicted at every sample by all rows: for lines to be drawn. Empty until
    /// [`Contest::trace`].
    pub traced: Vec<Traced>,
}

impl Contest<'_> {
    /// Predicts and compares on the test part of `split`. The yardsticks come first, the models after them.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where no window fits; as [`Model::predict`] and [`Hybrid::predict`].
    pub fn run(&self, set: &DataSet, split: &Split) -> Result<Judged> {
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        let Met { models: met, judged: spans, own_from_first_half } = met(&set.flights, &all, &split.test)?;
        let (models, of_networks) = met.split_at(self.models.len());
        let windows = windows(&spans, self.history, self.stride);
        if windows.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of test samples is as long as the {} samples of history{}; give longer flights or lock whole flights with --lock",
                self.history,
                if own_from_first_half {
                    ", second halves of flights judging models that know each flight from its first"
                } else {
                    ""
                }
            )));
        }
        let mut rows = self.without_networks(set, split, models, &windows)?;
        let reference = rows.len() - self.models.len();
        let mut judged = Vec::new();
        let networks = self.networks.iter().zip(of_networks).map(|((name, hybrid), model)| Ok((name, hybrid.on(model.clone())?)));
        let networks: Vec<(&String, Hybrid)> = networks.collect::<Result<_>>()?;
        for (name, hybrid) in &networks {
            let stages = hybrid.stages(&set.flights, &windows, self.threads)?;
            let own = &hybrid.description().model;
            // The first model is what the shares are of, unless the network was trained on that very model.
            let other = models.first().is_some_and(|model| model.effects != own.effects);
            let same = models.iter().position(|model| model.effects == own.effects);
            let model = same.map_or(&own.name, |index| &self.models[index].0);
            let row = other.then(|| rows.get(reference)).flatten();
            judged.push(shares(&set.flights, &windows, row, &shares::Judged { name, model, stages: &stages })?);
            rows.push(Row { name: (*name).clone(), predicted: stages.hybrid });
        }
        let mut comparison = compare(&set.flights, &windows, &rows, split.tested)?;
        comparison.stride = self.stride;
        comparison.own_from_first_half = own_from_first_half;
        comparison.shares = judged;
        for (name, hybrid) in &networks {
            comparison.coverage.extend(coverage(name, hybrid, &set.flights, &windows, self.threads)?);
        }
        for (name, hybrid) in networks.iter().filter(|_| self.uncertainty) {
            let effort = Effort::for_history(hybrid.description().config.history(), self.seed);
            comparison.uncertainty.push(uncertainty(name, hybrid, &set.flights, &windows, effort, self.threads)?);
        }
        Ok(Judged { comparison, windows, rows, traced: Vec::new() })
    }

    /// The rows of all that has no network.
    fn without_networks(&self, set: &DataSet, split: &Split, models: &[Model], windows: &[Window]) -> Result<Vec<Row>> {
        let mut rows = vec![finite_difference(&set.flights, windows)?];
        if let Some(lags) = self.ridge {
            let training = crate::flight::windows::windows(&split.training, lags, 1);
            rows.push(ridge(&set.flights, &training, windows, &LinearConfig { lags, ..LinearConfig::default() })?);
        }
        let judged_flights: BTreeSet<usize> = windows.iter().map(|window| window.flight).collect();
        for ((name, _), model) in self.models.iter().zip(models) {
            let columns = predicted(model, &set.flights, &judged_flights)?;
            let at = |window: &Window| PerChannel::from_fn(|channel| columns[window.flight][channel][window.last]);
            rows.push(Row { name: name.clone(), predicted: windows.iter().map(at).collect() });
        }
        Ok(rows)
    }

    /// Predicts the worst and a typical stretch of the last row at every sample, with all rows.
    ///
    /// # Errors
    /// As [`Contest::run`].
    pub fn trace(&self, set: &DataSet, split: &Split, judged: &mut Judged) -> Result<()> {
        let found = judged.rows.last().map(|row| stretches(&set.flights, &judged.windows, row)).transpose()?.flatten();
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        let Met { models, judged: spans, .. } = met(&set.flights, &all, &split.test)?;
        let (models, of_networks) = models.split_at(self.models.len());
        for stretch in found.into_iter().flat_map(|found| [found.worst, found.typical]) {
            let inside = |window: &Window| {
                window.flight == stretch.span.flight && (stretch.span.start..stretch.span.end).contains(&window.last)
            };
            let windows: Vec<Window> = windows(&spans, self.history, 1).into_iter().filter(inside).collect();
            let mut rows = self.without_networks(set, split, models, &windows)?;
            for ((name, hybrid), model) in self.networks.iter().zip(of_networks) {
                let predicted = hybrid.on(model.clone())?.stages(&set.flights, &windows, self.threads)?.hybrid;
                rows.push(Row { name: name.clone(), predicted });
            }
            judged.traced.push(Traced { stretch, windows, rows });
        }
        Ok(())
    }
}

/// What a model predicts of some flights; nothing of the others.
fn predicted(model: &Model, flights: &[Flight], wanted: &BTreeSet<usize>) -> Result<Vec<Accelerations>> {
    let one = |(index, flight): (usize, &Flight)| match wanted.contains(&index) {
        true => model.predict(flight),
        false => Ok(Accelerations::default()),
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        flights.par_iter().enumerate().map(one).collect()
    }
    #[cfg(not(feature = "rayon"))]
    flights.iter().enumerate().map(one).collect()
}

impl Judged {
    /// Adds the floor, from the explainable part of the flights.
    ///
    /// # Errors
    /// As [`floor`].
    pub fn set_floor(&mut self, set: &DataSet, explainable: &[Flight]) -> Result<()> {
        self.comparison.set_floor(floor(&set.flights, &self.windows, explainable)?);
        Ok(())
    }

    /// What a page of it, or a larger one, shows.
    #[cfg(feature = "report")]
    pub fn report<'a>(&'a self, set: &'a DataSet, provenance: &'a [(String, String)]) -> crate::report::CompareReport<'a> {
        crate::report::CompareReport {
            comparison: &self.comparison,
            flights: &set.flights,
            windows: &self.windows,
            rows: &self.rows,
            focus: self.rows.len() - 1,
            yardstick: Some(0),
            traced: &self.traced,
            provenance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::round_stride;

    #[test]
    fn strides_are_one_two_or_five_times_a_power_of_ten_and_never_too_small() {
        for (wanted, stride) in
            [(0.0, 1), (1.0, 1), (1.01, 2), (2.5, 5), (5.1, 10), (73.0, 100), (101.0, 200), (f64::INFINITY, 1_000_000)]
        {
            assert_eq!(round_stride(wanted), stride, "{wanted}");
        }
    }
}
