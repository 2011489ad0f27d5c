//! Models and networks compared on flights that were kept back, beside honest yardsticks. The numbers themselves are made in `critique`.

use super::judging::Judging;
use crate::critique::locate::{Traced, stretches};
use crate::critique::shares::{self, shares};
use crate::critique::uncertainty::{Effort, uncertainty};
use crate::critique::{Comparison, Row, compare, coverage, finite_difference, floor, ridge};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::windows::{self, counted, counts};
use crate::flight::{Accelerations, DataSet, Flight, PerChannel, Window};
use crate::hybrid::linear::LinearConfig;
use crate::hybrid::{Hybrid, Stages};
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
        let flights = &set.flights;
        let judging = self.judging(flights, split, self.stride)?.filtered(|window| counts(flights, window));
        let windows = &judging.windows;
        if windows.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of test samples is as long as the {} samples of history{}; give longer flights or lock whole flights with --lock",
                self.history,
                if judging.by_halves() {
                    ", halves of flights judging models that know each flight from its other half"
                } else {
                    ""
                }
            )));
        }
        let mut rows = self.without_networks(set, split, &judging)?;
        let reference = rows.len() - self.models.len();
        let mut judged = Vec::new();
        for (index, (name, hybrid)) in self.networks.iter().enumerate() {
            let stages = self.stages(flights, &judging, index)?;
            let own = &hybrid.description().model;
            // The first model is what the shares are of, unless the network was trained on that very model.
            let other = self.models.first().is_some_and(|(_, model)| model.effects != own.effects);
            let same = self.models.iter().find(|(_, model)| model.effects == own.effects);
            let model = same.map_or(&own.name, |(name, _)| name);
            let row = other.then(|| rows.get(reference)).flatten();
            judged.push(shares(flights, windows, row, &shares::Judged { name, model, stages: &stages })?);
            rows.push(Row { name: name.clone(), predicted: stages.hybrid });
        }
        let mut comparison = compare(flights, windows, &rows, split.tested)?;
        comparison.stride = self.stride;
        comparison.own_from_other_half = judging.by_halves();
        comparison.shares = judged;
        for (name, hybrid) in self.networks {
            comparison.coverage.extend(coverage(name, hybrid, flights, windows, self.threads)?);
        }
        // Movements are of first order about the numbers of the flights: one half tells them.
        let (met, windows) = judging.first().expect("there are windows");
        for (index, (name, hybrid)) in self.networks.iter().enumerate().filter(|_| self.uncertainty) {
            let effort = Effort::for_history(hybrid.description().config.history(), self.seed);
            let hybrid = hybrid.on(met[self.models.len() + index].clone())?;
            comparison.uncertainty.push(uncertainty(name, &hybrid, flights, &windows, effort, self.threads)?);
        }
        Ok(Judged { comparison, windows: judging.windows, rows, traced: Vec::new() })
    }

    /// The windows of the test part with the models, those of the networks behind the others.
    fn judging(&self, flights: &[Flight], split: &Split, stride: usize) -> Result<Judging> {
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Model> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        Judging::new(flights, &all, &split.test, self.history, stride)
    }

    /// What a network predicts, part by part.
    fn stages(&self, flights: &[Flight], judging: &Judging, index: usize) -> Result<Stages> {
        let hybrid = &self.networks[index].1;
        let each = judging.each(|models, windows| {
            let Stages { physics, with_linear, hybrid } =
                hybrid.on(models[self.models.len() + index].clone())?.stages(flights, windows, self.threads)?;
            let with_linear =
                with_linear.map_or_else(|| vec![None; windows.len()], |values| values.into_iter().map(Some).collect());
            Ok(physics.into_iter().zip(with_linear).zip(hybrid).collect())
        })?;
        let (physics, hybrid): (Vec<_>, Vec<_>) = each.into_iter().unzip();
        let (physics, with_linear): (Vec<_>, Vec<_>) = physics.into_iter().unzip();
        Ok(Stages { physics, with_linear: with_linear.into_iter().collect(), hybrid })
    }

    /// The rows of all that has no network.
    fn without_networks(&self, set: &DataSet, split: &Split, judging: &Judging) -> Result<Vec<Row>> {
        let (flights, windows) = (&set.flights, &judging.windows);
        let mut rows = vec![finite_difference(flights, windows)?];
        if let Some(lags) = self.ridge {
            let training = counted(flights, windows::windows(&split.training, lags, 1));
            rows.push(ridge(flights, &training, windows, &LinearConfig { lags, ..LinearConfig::default() })?);
        }
        for (index, (name, _)) in self.models.iter().enumerate() {
            let predicted = judging.each(|models, windows| {
                let judged: BTreeSet<usize> = windows.iter().map(|window| window.flight).collect();
                let columns = predicted(&models[index], flights, &judged)?;
                let at = |window: &Window| PerChannel::from_fn(|channel| columns[window.flight][channel][window.last]);
                Ok(windows.iter().map(at).collect())
            })?;
            rows.push(Row { name: name.clone(), predicted });
        }
        Ok(rows)
    }

    /// Predicts the worst and a typical stretch of the last row at every sample, with all rows.
    ///
    /// # Errors
    /// As [`Contest::run`].
    pub fn trace(&self, set: &DataSet, split: &Split, judged: &mut Judged) -> Result<()> {
        let found = judged.rows.last().map(|row| stretches(&set.flights, &judged.windows, row)).transpose()?.flatten();
        for stretch in found.into_iter().flat_map(|found| [found.worst, found.typical]) {
            let inside = |window: &Window| {
                window.flight == stretch.span.flight && (stretch.span.start..stretch.span.end).contains(&window.last)
            };
            let judging = self.judging(&set.flights, split, 1)?.filtered(inside);
            let mut rows = self.without_networks(set, split, &judging)?;
            for (index, (name, _)) in self.networks.iter().enumerate() {
                rows.push(Row { name: name.clone(), predicted: self.stages(&set.flights, &judging, index)?.hybrid });
            }
            judged.traced.push(Traced { stretch, windows: judging.windows, rows });
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
