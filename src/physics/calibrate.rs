//! Calibration: the coefficients of a model's enabled effects by least squares on recorded flights (paper eq. 33), with units,
//! 95 % intervals and a condition number; and a refusal that names the reason where the data do not determine them.

use super::evaluate::{Place, Program, not_finite};
use super::least_squares::{Cluster, Factor, Failure, Problem, solve};
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, Span};

/// Clusters that the whole of the data is cut into for the intervals, unless it is cut into more by flights.
const CLUSTERS: usize = 40;

/// Clusters are not made shorter than this, s.
const SHORTEST_CLUSTER_S: f64 = 1.0;

/// One calibrated coefficient.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Value, in [`Estimate::unit`].
    pub value: f64,
    /// 95 % confidence interval, valid for residuals that are correlated in time.
    pub ci95: [f64; 2],
    /// Unit.
    pub unit: String,
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
}

impl std::fmt::Display for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<20} {:<8} {:>12}   {:<27} unit", "effect", "name", "value", "95 % interval")?;
        for Estimate { effect, name, value, ci95: [low, high], unit } in &self.coefficients {
            writeln!(f, "{effect:<20} {name:<8} {value:>12.5}   [{low:>11.5}, {high:>11.5}]    {unit}")?;
        }
        write!(
            f,
            "{} rows; condition number {:.1}; intervals from {} stretches of consecutive rows",
            self.rows, self.condition_number, self.clusters
        )
    }
}

/// One free coefficient: indices of its effect and of itself in the effect.
type Free = (usize, usize);

/// Fits the free coefficients of the enabled effects to the measured accelerations in `spans` and returns the model with the
/// values and intervals set.
///
/// The regressand is the measured acceleration minus the terms without a coefficient. Every channel is fitted by itself in
/// physical units, unweighted; channels that share a coefficient are fitted together, weighted by residual variance.
/// Overlapping spans count once. Hidden state (lags, delays) runs from the start of each flight.
///
/// # Errors
/// [`Error::Undetermined`] naming the coefficients and why the data do not determine them; otherwise as [`Model::predict`].
pub fn calibrate(model: &Model, flights: &[Flight], spans: &[Span]) -> Result<(Model, Calibration)> {
    model.check()?;
    if let Some(span) = spans.iter().find(|span| span.flight >= flights.len()) {
        let (found, expected) = (span.flight.to_string(), format!("an index of the {} flights", flights.len()));
        return Err(Error::Config { place: "calibrate".into(), field: "span.flight".into(), found, expected });
    }
    let layout = Layout::of(model);
    let ranges: Vec<Vec<(usize, usize)>> = (0..flights.len()).map(|flight| union(flight, spans, flights)).collect();
    let rows: Vec<usize> = ranges.iter().map(|ranges| ranges.iter().map(|range| range.1 - range.0).sum()).collect();
    let total: usize = rows.iter().sum();
    if total == 0 {
        return Err(Error::Undetermined("no rows to calibrate on: the spans are empty; give at least one flight".into()));
    }
    let used = rows.iter().filter(|rows| **rows > 0).count();
    let jobs: Vec<(usize, usize)> = (0..flights.len())
        .filter(|&flight| rows[flight] > 0)
        .map(|flight| {
            let shortest = (SHORTEST_CLUSTER_S / flights[flight].step_s) as usize;
            let length = (total / CLUSTERS).max(shortest).max(1);
            let fewest = if used == 1 { 2 } else { 1 };
            (flight, ((rows[flight] + length / 2) / length).max(fewest).min(rows[flight]))
        })
        .collect();
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
    let mut condition_number = 1.0_f64;
    for (members, problem) in layout.problems() {
        let solution = solve(&problem, &mut clusters).map_err(|failure| layout.explain(model, &members, &failure))?;
        condition_number = condition_number.max(solution.condition_number);
        for ((&(effect, index), value), ci95) in members.iter().zip(&solution.values).zip(&solution.ci95) {
            let coefficient = calibrated.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(index));
            if let Some(coefficient) = coefficient {
                (coefficient.value, coefficient.ci95) = (*value, Some(*ci95));
            }
        }
    }
    let coefficients = layout.free.iter().filter_map(|&(effect, index)| estimate(&calibrated, effect, index)).collect();
    let calibration = Calibration { coefficients, condition_number, rows: total, clusters: clusters.len() };
    Ok((calibrated, calibration))
}

fn estimate(model: &Model, effect: usize, index: usize) -> Option<Estimate> {
    let effect = model.effects.get(effect)?;
    let coefficient = effect.coefficients.get(index)?;
    Some(Estimate {
        effect: effect.name.clone(),
        name: coefficient.name.clone(),
        value: coefficient.value,
        ci95: coefficient.ci95?,
        unit: coefficient.unit.clone(),
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

/// Which coefficient stands behind which column of which channel.
struct Layout {
    free: Vec<Free>,
    /// For each channel, its columns as indices into `free`.
    channels: Vec<Vec<usize>>,
}

impl Layout {
    fn of(model: &Model) -> Self {
        let mut layout = Self { free: Vec::new(), channels: vec![Vec::new(); Column::TARGETS.len()] };
        for (effect_index, effect) in model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled) {
            for (index, coefficient) in effect.coefficients.iter().enumerate() {
                layout.free.push((effect_index, index));
                for term in effect.terms.iter().filter(|term| term.coefficient.as_ref() == Some(&coefficient.name)) {
                    if let Some(columns) =
                        layout.channels.get_mut(term.channel).filter(|columns| columns.last() != Some(&(layout.free.len() - 1)))
                    {
                        columns.push(layout.free.len() - 1);
                    }
                }
            }
        }
        layout
    }

    /// Column of a term in its channel; `None` for fixed terms.
    fn column(&self, place: Place) -> Option<usize> {
        let free = self.free.iter().position(|&free| Some(free) == place.coefficient.map(|index| (place.effect, index)))?;
        self.channels.get(place.channel)?.iter().position(|&column| column == free)
    }

    /// Reduces the chosen rows of one flight to clusters of about equal length.
    fn reduce(
        &self,
        model: &Model,
        index: usize,
        flight: &Flight,
        ranges: &[(usize, usize)],
        clusters: usize,
    ) -> Result<Vec<Cluster>> {
        let mut program = Program::for_flight(model, flight)?;
        let places: Vec<Place> = program.places().collect();
        let targets: Vec<Option<usize>> = places.iter().map(|&place| self.column(place)).collect();
        let empty =
            Cluster { flight: index, factors: self.channels.iter().map(|columns| Factor::new(columns.len() + 1)).collect() };
        let mut reduced = vec![empty; clusters];
        let rows: usize = ranges.iter().map(|range| range.1 - range.0).sum();
        let mut seen = 0;
        let mut pieces: Vec<(usize, usize)> = ranges.to_vec();
        pieces.reverse();
        program.run(flight, ranges.last().map_or(0, |range| range.1), &mut |block, values| {
            // One matrix a channel: its regressors, then the measured acceleration minus the fixed terms.
            let mut matrices: Vec<Vec<Vec<f64>>> = Vec::with_capacity(self.channels.len());
            for (columns, target) in self.channels.iter().zip(Column::TARGETS) {
                let mut matrix = vec![vec![0.0; block.len()]; columns.len()];
                matrix.push(flight.column(target).get(block.clone()).unwrap_or_default().to_vec());
                matrices.push(matrix);
            }
            for ((place, target), values) in places.iter().zip(&targets).zip(values) {
                let Some(matrix) = matrices.get_mut(place.channel) else { continue };
                let (column, sign) = match target {
                    Some(column) => (matrix.get_mut(*column), 1.0),
                    None => (matrix.last_mut(), -1.0),
                };
                for (sum, value) in column.into_iter().flatten().zip(values) {
                    *sum += sign * value;
                }
            }
            while let Some((start, end)) = pieces.pop() {
                if start >= block.end {
                    pieces.push((start, end));
                    break;
                }
                // As far as this block and this row's cluster reach: row i belongs to cluster floor(i clusters / rows).
                let cluster = seen * clusters / rows;
                let cluster_end = ((cluster + 1) * rows).div_ceil(clusters);
                let stop = end.min(block.end).min(start + cluster_end - seen);
                let part = start - block.start..stop - block.start;
                for ((place, _), values) in places.iter().zip(&targets).zip(values) {
                    if let Some(at) = values.iter().skip(part.start).take(part.len()).position(|value| !value.is_finite()) {
                        return Err(not_finite(model, flight, *place, start + at));
                    }
                }
                if let Some(cluster) = reduced.get_mut(cluster) {
                    for (factor, matrix) in cluster.factors.iter_mut().zip(&matrices) {
                        let columns: Vec<&[f64]> =
                            matrix.iter().map(|column| column.get(part.clone()).unwrap_or_default()).collect();
                        factor.add(&columns);
                    }
                }
                seen += stop - start;
                if stop < end {
                    pieces.push((stop, end));
                }
            }
            Ok(())
        })?;
        Ok(reduced)
    }

    /// Groups of channels that share coefficients, each with its coefficients.
    fn problems(&self) -> Vec<(Vec<Free>, Problem)> {
        let mut group: Vec<usize> = (0..self.channels.len()).collect();
        for (left, left_columns) in self.channels.iter().enumerate() {
            for (right, right_columns) in self.channels.iter().enumerate().skip(left + 1) {
                if left_columns.iter().any(|column| right_columns.contains(column)) {
                    let (from, to) = (group[right], group[left]);
                    group.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
                }
            }
        }
        let mut problems = Vec::new();
        for root in 0..self.channels.len() {
            let channels: Vec<usize> =
                (0..self.channels.len()).filter(|&channel| group[channel] == root && !self.channels[channel].is_empty()).collect();
            let mut members: Vec<usize> = channels.iter().flat_map(|&channel| self.channels[channel].iter().copied()).collect();
            members.sort_unstable();
            members.dedup();
            if members.is_empty() {
                continue;
            }
            let place = |column: &usize| members.binary_search(column).unwrap_or_default();
            let channels =
                channels.into_iter().map(|channel| (channel, self.channels[channel].iter().map(place).collect())).collect();
            problems.push((
                members.iter().map(|&member| self.free[member]).collect(),
                Problem { coefficients: members.len(), channels },
            ));
        }
        problems
    }

    /// A failure in words.
    fn explain(&self, model: &Model, members: &[Free], failure: &Failure) -> Error {
        let describe = |index: usize| -> (String, String) {
            let effect = members.get(index).and_then(|free| model.effects.get(free.0));
            let coefficient = effect.zip(members.get(index)).and_then(|(effect, free)| effect.coefficients.get(free.1));
            let (Some(effect), Some(coefficient)) = (effect, coefficient) else { return Default::default() };
            let regressors: Vec<String> = effect
                .terms
                .iter()
                .filter(|term| term.coefficient.as_ref() == Some(&coefficient.name))
                .map(|term| term.regressor.to_string())
                .collect();
            (format!("`{}` of effect `{}`", coefficient.name, effect.name), format!("`{}`", regressors.join("`, `")))
        };
        let advice = "give flights that move it, or set `enabled = false` on the effect";
        Error::Undetermined(match failure {
            Failure::Zero(index) => {
                let (name, regressor) = describe(*index);
                format!("the flights do not determine {name}: its regressor {regressor} is zero in every row; {advice}")
            }
            Failure::Overflow(index) => {
                let (name, regressor) = describe(*index);
                format!("the regressor {regressor} behind {name} reaches numbers too large to square; scale the formula down")
            }
            Failure::TooFewRows(rows) => {
                format!("{rows} rows cannot determine {} coefficients; give longer flights", members.len())
            }
            Failure::Dependent(involved, condition) => {
                let described: Vec<(String, String)> = involved.iter().map(|&index| describe(index)).collect();
                let constant = described.iter().position(|(_, regressor)| regressor == "`1`");
                match (described.as_slice(), constant) {
                    ([_, _], Some(constant)) => {
                        let (name, regressor) = &described[1 - constant];
                        let bias = &described[constant].0;
                        format!(
                            "the flights do not determine {name}: its regressor {regressor} never varies, so {bias} does the same; {advice}"
                        )
                    }
                    _ => {
                        let names: Vec<&str> = described.iter().map(|(name, _)| name.as_str()).collect();
                        let regressors: Vec<&str> = described.iter().map(|(_, regressor)| regressor.as_str()).collect();
                        format!(
                            "the flights do not determine {}: their regressors {} are linearly dependent in these rows (condition number {condition:.1e}); \
                             give flights that move them apart, or set `enabled = false` on one of the effects",
                            names.join(" and "),
                            regressors.join(" and ")
                        )
                    }
                }
            }
        })
    }
}
