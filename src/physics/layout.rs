//! Which coefficient stands behind which column of which channel, and the reduction of flights to those columns. What is then
//! solved, and how often, is calibration's business.

use super::by_flight;
use super::catalogue;
use super::evaluate::{Place, Program, not_finite};
use super::least_squares::{Cluster, Factor, Failure, Problem};
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight};

/// One coefficient: indices of its effect and of itself in the effect.
pub(super) type Free = (usize, usize);

/// Which coefficient stands behind which column of which channel: first those common to all flights, then those of a flight, and
/// last the regressand.
pub(super) struct Layout {
    /// Coefficients common to all flights.
    pub free: Vec<Free>,
    /// For each channel, its columns as indices into `free`.
    pub channels: Vec<Vec<usize>>,
    /// Coefficients that belong to a flight.
    pub own: Vec<Free>,
    /// For each channel, its further columns as indices into `own`.
    own_channels: Vec<Vec<usize>>,
}

impl Layout {
    pub(super) fn of(model: &Model) -> Self {
        let none = || vec![Vec::new(); Column::TARGETS.len()];
        let mut layout = Self { free: Vec::new(), channels: none(), own: Vec::new(), own_channels: none() };
        for (effect_index, effect) in model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled) {
            for (index, coefficient) in effect.coefficients.iter().enumerate() {
                let (known, channels) = match coefficient.by_flight {
                    None => (&mut layout.free, &mut layout.channels),
                    Some(_) => (&mut layout.own, &mut layout.own_channels),
                };
                let column = known.len();
                known.push((effect_index, index));
                for term in effect.terms.iter().filter(|term| term.coefficient.as_ref() == Some(&coefficient.name)) {
                    if let Some(columns) = channels.get_mut(term.channel).filter(|columns| columns.last() != Some(&column)) {
                        columns.push(column);
                    }
                }
            }
        }
        layout
    }

    /// Every coefficient that is found, in the order of the model.
    pub(super) fn all(&self) -> Vec<Free> {
        let mut all: Vec<Free> = self.free.iter().chain(&self.own).copied().collect();
        all.sort_unstable();
        all
    }

    /// The coefficients of a flight with what is known of them beforehand.
    pub(super) fn own_columns(&self, model: &Model) -> by_flight::Own {
        let deviation = |&(effect, index): &Free| {
            let effect = model.effects.get(effect)?;
            catalogue::definition(&effect.kind)?.coefficient(&effect.coefficients.get(index)?.name)?.by_flight
        };
        // A coefficient of a flight that is not from the catalogue: one of its unit.
        by_flight::Own {
            deviations: self.own.iter().map(|place| deviation(place).unwrap_or(1.0)).collect(),
            channels: self.own_channels.clone(),
        }
    }

    /// Column of a term in its channel; `None` for fixed terms.
    fn column(&self, place: Place) -> Option<usize> {
        let wanted = Some((place.effect, place.coefficient?));
        let columns = self.channels.get(place.channel)?;
        if let Some(free) = self.free.iter().position(|&free| Some(free) == wanted) {
            return columns.iter().position(|&column| column == free);
        }
        let own = self.own.iter().position(|&own| Some(own) == wanted)?;
        self.own_channels.get(place.channel)?.iter().position(|&column| column == own).map(|column| columns.len() + column)
    }

    /// Columns of each channel without the regressand.
    fn widths(&self) -> impl Iterator<Item = usize> + '_ {
        self.channels.iter().zip(&self.own_channels).map(|(free, own)| free.len() + own.len())
    }

    /// Reduces the chosen rows of one flight to clusters of about equal length.
    pub(super) fn reduce(
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
        let empty = Cluster { flight: index, factors: self.widths().map(|columns| Factor::new(columns + 1)).collect() };
        let mut reduced = vec![empty; clusters];
        let rows: usize = ranges.iter().map(|range| range.1 - range.0).sum();
        let mut seen = 0;
        let mut pieces: Vec<(usize, usize)> = ranges.to_vec();
        pieces.reverse();
        program.run(flight, ranges.last().map_or(0, |range| range.1), &mut |block, values| {
            // One matrix a channel: its regressors, then the measured acceleration minus the fixed terms.
            let mut matrices: Vec<Vec<Vec<f64>>> = Vec::with_capacity(self.channels.len());
            for (columns, target) in self.widths().zip(Column::TARGETS) {
                let mut matrix = vec![vec![0.0; block.len()]; columns];
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
    pub(super) fn problems(&self) -> Vec<(Vec<Free>, Problem)> {
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
    pub(super) fn explain(&self, model: &Model, members: &[Free], failure: &Failure) -> Error {
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
            Failure::OneCluster(index) => {
                let (name, _) = describe(*index);
                format!(
                    "all that is known of {name} comes from one short stretch, so there is no telling how certain it is; {advice}"
                )
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
