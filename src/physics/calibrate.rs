//! Calibration: the coefficients of a model's enabled effects by least squares on recorded flights (paper eq. 33), with units,
//! 95 % intervals and a condition number; and a refusal that names the reason where the data do not determine them.
//!
//! What stands in which column is in `layout`, the algebra in `least_squares`, and coefficients that belong to a flight in `by_flight`.

use super::by_flight;
use super::catalogue;
use super::layout::Layout;
use super::least_squares::{Cluster, Failure, solve};
use super::model::Model;
use super::sign::{SignDoubt, SignFinding};
use crate::error::{Error, Result};
use crate::flight::{Flight, Span};
use std::collections::BTreeMap;

/// Clusters that the whole of the data is cut into for the intervals, unless it is cut into more by flights.
const CLUSTERS: usize = 40;

/// Clusters are not made shorter than this, s.
const SHORTEST_CLUSTER_S: f64 = 1.0;

/// Formulas may read the values of other coefficients, so a calibration is repeated until those have settled; at most so often.
const MOST_ROUNDS: usize = 8;

/// Coefficients that formulas read have settled when none moves by more than this share of itself.
const SETTLED: f64 = 1e-9;

/// Share from which a person should know that they have not.
const WORTH_SAYING: f64 = 1e-6;

/// How far a round may go, in steps of the plain iteration.
const SHORTEST_STRIDE: f64 = 0.2;
const LONGEST_STRIDE: f64 = 4.0;

/// One calibrated coefficient.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Value, in [`Estimate::unit`]; for a property of each flight, the mean over the flights.
    pub value: f64,
    /// 95 % confidence interval, valid for residuals that are correlated in time. `None` for a property of each flight; the intervals
    /// of the others hold given those properties, whose own uncertainty they leave out.
    pub ci95: Option<[f64; 2]>,
    /// Unit.
    pub unit: String,
    /// Values that physics allows, where the catalogue knows them. Calibration does not enforce them.
    pub bounds: Option<[f64; 2]>,
    /// For a property of each flight: its value by name of the flight.
    pub by_flight: Option<BTreeMap<String, f64>>,
}

impl Estimate {
    /// Whether the value lies where physics does not allow it.
    pub fn is_implausible(&self) -> bool {
        self.bounds.is_some_and(|[low, high]| !(low..=high).contains(&self.value))
    }
}

/// What a calibration found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Calibration {
    /// Coefficients in the order of the model.
    pub coefficients: Vec<Estimate>,
    /// Largest condition number of the column-scaled regressor matrices.
    pub condition_number: f64,
    /// Rows used, each with six accelerations.
    pub rows: usize,
    /// Stretches of consecutive rows that the intervals rest on.
    pub clusters: usize,
    /// Rounds it took; more than one if formulas read the values of coefficients.
    pub rounds: usize,
    /// Largest relative change, in the last round, of a coefficient that formulas read.
    pub last_change: f64,
    /// Coefficients whose sign physics fixes and this calibration does not show.
    #[serde(default)]
    pub signs: Vec<SignDoubt>,
}

impl std::fmt::Display for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<20} {:<8} {:>12}   {:<27} unit", "effect", "name", "value", "95 % interval")?;
        for estimate in &self.coefficients {
            let Estimate { effect, name, value, ci95, unit, bounds, by_flight } = estimate;
            let interval = match (ci95, by_flight) {
                (Some([low, high]), _) => format!("[{low:>11.5}, {high:>11.5}]"),
                (None, Some(flights)) => {
                    let (low, high) = flights
                        .values()
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
                    format!("{low:.3} to {high:.3} in {} flights", flights.len())
                }
                (None, None) => String::new(),
            };
            write!(f, "{effect:<20} {name:<8} {value:>12.5}   {interval:<27} {unit}")?;
            let doubt = self.signs.iter().find(|doubt| doubt.effect == *effect && doubt.name == *name);
            match (bounds, doubt.map(|doubt| doubt.finding)) {
                (Some([low, high]), _) if estimate.is_implausible() => {
                    writeln!(f, "   outside its physical bounds {low} to {high}")?
                }
                (_, Some(SignFinding::Wrong)) => writeln!(f, "   WRONG SIGN")?,
                (_, Some(SignFinding::NotDetermined)) => writeln!(f, "   sign not determined")?,
                _ => writeln!(f)?,
            }
        }
        if self.last_change > WORTH_SAYING {
            let change = self.last_change;
            writeln!(f, "coefficients that formulas read still moved by {change:.1e} of themselves after {} rounds", self.rounds)?;
        }
        write!(
            f,
            "{} rows; condition number {:.1}; intervals from {} stretches of consecutive rows",
            self.rows, self.condition_number, self.clusters
        )?;
        let wrong: Vec<&SignDoubt> = self.signs.iter().filter(|doubt| doubt.finding == SignFinding::Wrong).collect();
        wrong.iter().try_for_each(|doubt| write!(f, "\nCAUTION: {doubt}"))?;
        if !wrong.is_empty() {
            write!(
                f,
                "\n         Such a number stands in for physics that the model lacks, or a control acts otherwise than the log says."
            )?;
        }
        Ok(())
    }
}

/// Fits the free coefficients of the enabled effects to the measured accelerations in `spans` and returns the model with the
/// values and intervals set.
///
/// The regressand is the measured acceleration minus the terms without a coefficient. Every channel is fitted by itself in
/// physical units, unweighted; channels that share a coefficient are fitted together, weighted by residual variance.
/// Overlapping spans count once. Hidden state (lags, delays) runs from the start of each flight.
///
/// Where formulas read the values of coefficients (a thrust, a predicted acceleration), the fit is repeated with the values found until
/// those that are read have settled, at most eight times; if one that is read is still zero, the first fit leaves out the effects
/// that read. Coefficients of a flight (wind, bias) are estimated with the others at once, with a prior from the
/// catalogue; a flight outside the spans gets their mean, and the intervals of the others hold given them.
///
/// # Errors
/// [`Error::Undetermined`] naming the coefficients and why the data do not determine them; otherwise as [`Model::predict`].
pub fn calibrate(model: &Model, flights: &[Flight], spans: &[Span]) -> Result<(Model, Calibration)> {
    model.check()?;
    if let Some(span) = spans.iter().find(|span| span.flight >= flights.len()) {
        let (found, expected) = (span.flight.to_string(), format!("an index of the {} flights", flights.len()));
        return Err(Error::Config { place: "calibrate".into(), field: "span.flight".into(), found, expected });
    }
    let mut read: Vec<(usize, usize)> = Vec::new();
    let mut bare = model.clone();
    for (effect, left_out) in model.effects.iter().zip(&mut bare.effects).filter(|(effect, _)| effect.enabled) {
        let reads = model.coefficients_read(effect)?;
        left_out.enabled = reads.is_empty();
        read.extend(reads);
    }
    // Each once, or it would be moved more than once a round.
    read.sort_unstable();
    read.dedup();
    let values = |model: &Model| -> Vec<f64> {
        let value = |&(effect, index): &(usize, usize)| Some(model.effects.get(effect)?.coefficients.get(index)?.value);
        read.iter().map(|place| value(place).unwrap_or_default()).collect()
    };
    let mut current = model.clone();
    if values(model).contains(&0.0) {
        // A thrust of zero makes the regressors that scale with it vanish.
        let (found, _) = fit(&bare, flights, spans)?;
        for (effect, found) in current.effects.iter_mut().zip(found.effects).filter(|(_, found)| found.enabled) {
            effect.coefficients = found.coefficients;
        }
    }
    // The rounds are a fixed-point iteration of the values read; its steps are lengthened or shortened by what the step before did (Irons &
    // Tuck 1969, Int. J. Numerical Methods in Engineering 1:275), without which alike regressors settle slowly.
    let mut round = 1;
    let (mut stride, mut residual_before): (f64, Option<Vec<f64>>) = (1.0, None);
    loop {
        let before = values(&current);
        let (found, mut calibration) = fit(&current, flights, spans)?;
        let residual: Vec<f64> = values(&found)
            .into_iter()
            .zip(&before)
            .map(|(now, before)| (now - before) / now.abs().max(before.abs()).max(f64::MIN_POSITIVE))
            .collect();
        let last_change = residual.iter().fold(0.0_f64, |largest, change| largest.max(change.abs()));
        (calibration.rounds, calibration.last_change) = (round, last_change);
        if last_change <= SETTLED || round == MOST_ROUNDS {
            return Ok((found, calibration));
        }
        if let Some(earlier) = &residual_before {
            let change: Vec<f64> = residual.iter().zip(earlier).map(|(now, earlier)| now - earlier).collect();
            let along: f64 = change.iter().zip(earlier).map(|(change, earlier)| change * earlier).sum();
            let square: f64 = change.iter().map(|change| change * change).sum();
            stride = if square > 0.0 { (-stride * along / square).clamp(SHORTEST_STRIDE, LONGEST_STRIDE) } else { 1.0 };
        }
        current = found;
        for (&(effect, index), before) in read.iter().zip(before) {
            let coefficient = current.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(index));
            if let Some(coefficient) = coefficient {
                coefficient.value = before + stride * (coefficient.value - before);
            }
        }
        residual_before = Some(residual);
        round += 1;
    }
}

/// One round: every formula reads the values that the model has.
fn fit(model: &Model, flights: &[Flight], spans: &[Span]) -> Result<(Model, Calibration)> {
    let layout = Layout::of(model);
    let ranges: Vec<Vec<(usize, usize)>> = (0..flights.len()).map(|flight| union(flight, spans, flights)).collect();
    let rows: Vec<usize> = ranges.iter().map(|ranges| ranges.iter().map(|range| range.1 - range.0).sum()).collect();
    let total: usize = rows.iter().sum();
    if total == 0 {
        return Err(Error::Undetermined("no rows to calibrate on: the spans are empty; give at least one flight".into()));
    }
    let jobs = cut(flights, &rows)?;
    let reduce = |&(flight, clusters): &(usize, usize)| layout.reduce(model, flight, &flights[flight], &ranges[flight], clusters);
    #[cfg(feature = "rayon")]
    let reduced: Result<Vec<Vec<Cluster>>> = {
        use rayon::prelude::*;
        jobs.par_iter().map(reduce).collect()
    };
    #[cfg(not(feature = "rayon"))]
    let reduced: Result<Vec<Vec<Cluster>>> = jobs.iter().map(reduce).collect();
    let mut clusters: Vec<Cluster> = reduced?.into_iter().flatten().collect();

    let mut calibrated = model.clone();
    if !layout.own.is_empty() {
        let shape = by_flight::Shape { free: layout.free.len(), channels: &layout.channels, own: &layout.own_columns(model) };
        let settled = by_flight::settle(&shape, &mut clusters).map_err(|failure| layout.explain(model, &layout.free, &failure))?;
        clusters = settled.clusters;
        for (place, &(effect, index)) in layout.own.iter().enumerate() {
            let coefficient = calibrated.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(index));
            let Some(coefficient) = coefficient else { continue };
            let values: BTreeMap<String, f64> = settled
                .values
                .iter()
                .filter_map(|(&flight, values)| Some((flights.get(flight)?.name.clone(), *values.get(place)?)))
                .collect();
            coefficient.value = values.values().sum::<f64>() / values.len().max(1) as f64;
            (coefficient.ci95, coefficient.by_flight) = (None, Some(values));
        }
    }
    let mut condition_number = 1.0_f64;
    for (members, problem) in layout.problems() {
        let solution = solve(&problem, &mut clusters).map_err(|failure| layout.explain(model, &members, &failure))?;
        condition_number = condition_number.max(solution.condition_number);
        if let Some(vague) = (0..members.len()).find(|&at| !solution.ci95[at].iter().all(|end| end.is_finite())) {
            return Err(layout.explain(model, &members, &Failure::OneCluster(vague)));
        }
        for ((&(effect, index), value), ci95) in members.iter().zip(&solution.values).zip(&solution.ci95) {
            let coefficient = calibrated.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(index));
            if let Some(coefficient) = coefficient {
                (coefficient.value, coefficient.ci95) = (*value, Some(*ci95));
            }
        }
    }
    let coefficients = layout.all().into_iter().filter_map(|(effect, index)| estimate(&calibrated, effect, index)).collect();
    let signs = calibrated.sign_doubts();
    let calibration =
        Calibration { coefficients, condition_number, rows: total, clusters: clusters.len(), rounds: 1, last_change: 0.0, signs };
    Ok((calibrated, calibration))
}

/// How many clusters each flight with rows is cut into.
///
/// # Errors
/// [`Error::Undetermined`] where intervals would rest on nothing: they need two clusters of twice the length.
fn cut(flights: &[Flight], rows: &[usize]) -> Result<Vec<(usize, usize)>> {
    let total: usize = rows.iter().sum();
    let jobs: Vec<(usize, usize)> = (0..flights.len())
        .filter(|&flight| rows[flight] > 0)
        .map(|flight| {
            let shortest = (SHORTEST_CLUSTER_S / flights[flight].step_s) as usize;
            let length = (total / CLUSTERS).max(shortest).max(1);
            (flight, ((rows[flight] + length / 2) / length).max(1).min(rows[flight]))
        })
        .collect();
    if jobs.iter().map(|(_, clusters)| clusters.div_ceil(2)).sum::<usize>() < 2 {
        let length_s: f64 = jobs.iter().map(|&(flight, _)| rows[flight] as f64 * flights[flight].step_s).sum();
        return Err(Error::Undetermined(format!(
            "the training part is {length_s:.2} s of one flight, too little to tell how certain a coefficient is; give at least \
             {:.1} s, or a second flight",
            2.5 * SHORTEST_CLUSTER_S
        )));
    }
    Ok(jobs)
}

fn estimate(model: &Model, effect: usize, index: usize) -> Option<Estimate> {
    let effect = model.effects.get(effect)?;
    let coefficient = effect.coefficients.get(index)?;
    Some(Estimate {
        effect: effect.name.clone(),
        name: coefficient.name.clone(),
        value: coefficient.value,
        ci95: coefficient.ci95,
        unit: coefficient.unit.clone(),
        bounds: catalogue::definition(&effect.kind)
            .and_then(|definition| definition.coefficient(&coefficient.name))
            .map(|definition| definition.bounds)
            .filter(|bounds| bounds.iter().all(|bound| bound.is_finite())),
        by_flight: coefficient.by_flight.clone(),
    })
}

/// The samples of one flight that the spans cover, in order, without overlap.
fn union(flight: usize, spans: &[Span], flights: &[Flight]) -> Vec<(usize, usize)> {
    let length = flights.get(flight).map_or(0, Flight::len);
    let mut ranges: Vec<(usize, usize)> =
        spans.iter().filter(|span| span.flight == flight).map(|span| (span.start.min(length), span.end.min(length))).collect();
    ranges.retain(|range| range.0 < range.1);
    ranges.sort_unstable();
    let mut merged: Vec<(usize, usize)> = Vec::new();
    for (start, end) in ranges {
        match merged.last_mut() {
            Some(last) if start <= last.1 => last.1 = last.1.max(end),
            _ => merged.push((start, end)),
        }
    }
    merged
}
