//! Which number stands behind which column of which channel, and the reduction of flights to those columns. What is then
//! solved, and how often, is calibration's business.

use super::by_flight;
use super::catalogue;
use super::columns::{Columns, Regressor};
use super::compose::Free;
use super::evaluate::not_finite;
use super::least_squares::{Cluster, Factor, Failure, Problem};
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel};
use crate::formula::Node;

/// Which number stands behind which column of which channel: first those common to all flights, then those of a flight, and
/// last the regressand.
pub(super) struct Layout {
    /// Numbers common to all flights.
    pub free: Vec<Free>,
    /// For each channel, its columns as indices into `free`.
    pub channels: PerChannel<Vec<usize>>,
    /// Coefficients that belong to a flight.
    pub own: Vec<Free>,
    /// For each channel, its further columns as indices into `own`.
    pub own_channels: PerChannel<Vec<usize>>,
    regressors: Vec<Regressor>,
}

impl Layout {
    pub(super) fn of(model: &Model, regressors: Vec<Regressor>) -> Self {
        let none = || PerChannel::splat(Vec::new());
        let mut layout = Self { free: Vec::new(), channels: none(), own: Vec::new(), own_channels: none(), regressors };
        for regressor in &layout.regressors {
            let Some(number) = regressor.number else { continue };
            let place = (regressor.effect, number);
            let belongs_to_flight = model.effects[place.0].number(number).is_some_and(|number| number.by_flight.is_some());
            let known = if belongs_to_flight { &mut layout.own } else { &mut layout.free };
            if !known.contains(&place) {
                known.push(place);
            }
        }
        layout.free.sort_unstable();
        layout.own.sort_unstable();
        for regressor in &layout.regressors {
            let Some(number) = regressor.number else { continue };
            let place = (regressor.effect, number);
            let (known, channels) = match layout.free.binary_search(&place) {
                Ok(index) => (index, &mut layout.channels),
                Err(_) => (layout.own.binary_search(&place).expect("listed above"), &mut layout.own_channels),
            };
            let columns = &mut channels[regressor.channel];
            if !columns.contains(&known) {
                columns.push(known);
            }
        }
        layout.channels.iter_mut().chain(&mut layout.own_channels).for_each(|columns| columns.sort_unstable());
        layout
    }

    /// Refuses coefficients that act nowhere, whatever their value: what they multiply is zero.
    pub(super) fn check_complete(&self, model: &Model) -> Result<()> {
        for (index, effect) in model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled) {
            for coefficient in 0..effect.coefficients.len() {
                let place = (index, coefficient);
                if !self.free.contains(&place) && !self.own.contains(&place) {
                    return Err(self.explain(model, &[place], &Failure::Zero(0)));
                }
            }
        }
        Ok(())
    }

    /// Every number that is found, in the order of the model.
    pub(super) fn all(&self) -> Vec<Free> {
        let mut all: Vec<Free> = self.free.iter().chain(&self.own).copied().collect();
        all.sort_unstable();
        all
    }

    /// The coefficients of a flight with what is known of them beforehand.
    pub(super) fn own_columns(&self, model: &Model) -> by_flight::Own {
        let deviation = |&(effect, index): &Free| {
            let effect = model.effects.get(effect)?;
            catalogue::definition(&effect.kind)?.coefficient(&effect.coefficients.get(index)?.name)?.deviation_in(effect)
        };
        // A coefficient of a flight that is not from the catalogue: one of its unit.
        by_flight::Own {
            deviations: self.own.iter().map(|place| deviation(place).unwrap_or(1.0)).collect(),
            channels: self.own_channels.values().to_vec(),
        }
    }

    /// Column of a regressor in its channel; `None` for what is fixed.
    fn column(&self, regressor: &Regressor) -> Option<usize> {
        let wanted = (regressor.effect, regressor.number?);
        let columns = &self.channels[regressor.channel];
        if let Ok(free) = self.free.binary_search(&wanted) {
            return columns.iter().position(|&column| column == free);
        }
        let own = self.own.binary_search(&wanted).ok()?;
        self.own_channels[regressor.channel].iter().position(|&column| column == own).map(|column| columns.len() + column)
    }

    /// Columns of each channel without the regressand.
    fn widths(&self) -> PerChannel<usize> {
        PerChannel::from_fn(|channel| self.channels[channel].len() + self.own_channels[channel].len())
    }

    /// Reduces the chosen rows of one flight, multiplied by a factor a channel, to clusters of about equal length.
    pub(super) fn reduce(
        &self,
        (model, columns): (&Model, &Columns),
        (index, flight): (usize, &Flight),
        (ranges, factors): (&[(usize, usize)], &PerChannel<f64>),
        clusters: usize,
    ) -> Result<Vec<Cluster>> {
        let nodes: Vec<Node> = self.regressors.iter().map(|regressor| regressor.node).collect();
        let targets: Vec<Option<usize>> = self.regressors.iter().map(|regressor| self.column(regressor)).collect();
        let empty = Cluster { flight: index, factors: self.widths().into_iter().map(|columns| Factor::new(columns + 1)).collect() };
        let mut reduced = vec![empty; clusters];
        let rows: usize = ranges.iter().map(|range| range.1 - range.0).sum();
        let mut seen = 0;
        let mut pieces: Vec<(usize, usize)> = ranges.to_vec();
        pieces.reverse();
        // One matrix a channel: its regressors, then the measured acceleration minus what is fixed.
        let mut matrices: PerChannel<Vec<Vec<f64>>> = self.widths().map(|columns| vec![Vec::new(); columns + 1]);
        columns.evaluate(&nodes, flight, ranges.last().map_or(0, |range| range.1), &mut |range, values| {
            for (channel, matrix) in matrices.pairs_mut() {
                matrix.iter_mut().for_each(|column| column.clear());
                let (measured, columns) = matrix.split_last_mut().expect("the regressand is there");
                measured.extend_from_slice(&flight.column(channel.column())[range.clone()]);
                columns.iter_mut().for_each(|column| column.resize(range.len(), 0.0));
            }
            for (place, (regressor, target)) in self.regressors.iter().zip(&targets).enumerate() {
                let matrix = &mut matrices[regressor.channel];
                let (column, sign) = match target {
                    Some(column) => (*column, 1.0),
                    None => (matrix.len() - 1, -1.0),
                };
                matrix[column].iter_mut().zip(values.column(place)).for_each(|(sum, value)| *sum += sign * value);
            }
            for (channel, matrix) in matrices.pairs_mut().filter(|(channel, _)| factors[*channel] != 1.0) {
                matrix.iter_mut().flatten().for_each(|value| *value *= factors[channel]);
            }
            while let Some((start, end)) = pieces.pop() {
                if start >= range.end {
                    pieces.push((start, end));
                    break;
                }
                // As far as this block and this row's cluster reach: row i belongs to cluster floor(i clusters / rows).
                let cluster = seen * clusters / rows;
                let cluster_end = ((cluster + 1) * rows).div_ceil(clusters);
                let stop = end.min(range.end).min(start + cluster_end - seen);
                let part = start - range.start..stop - range.start;
                for (place, regressor) in self.regressors.iter().enumerate() {
                    if let Some(at) = values.column(place)[part.clone()].iter().position(|value| !value.is_finite()) {
                        return Err(not_finite(model, flight, (regressor.effect, regressor.channel), start + at));
                    }
                }
                for (factor, matrix) in reduced[cluster].factors.iter_mut().zip(&matrices) {
                    let columns: Vec<&[f64]> = matrix.iter().map(|column| &column[part.clone()]).collect();
                    factor.add(&columns);
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
        let mut group: Vec<usize> = (0..Channel::COUNT).collect();
        for (left, left_columns) in self.channels.iter().enumerate() {
            for (right, right_columns) in self.channels.iter().enumerate().skip(left + 1) {
                if left_columns.iter().any(|column| right_columns.contains(column)) {
                    let (from, to) = (group[right], group[left]);
                    group.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
                }
            }
        }
        let mut problems = Vec::new();
        for root in 0..Channel::COUNT {
            let is_in = |channel: &Channel| group[channel.index()] == root && !self.channels[*channel].is_empty();
            let channels: Vec<Channel> = Channel::ALL.into_iter().filter(is_in).collect();
            let mut members: Vec<usize> = channels.iter().flat_map(|&channel| self.channels[channel].iter().copied()).collect();
            members.sort_unstable();
            members.dedup();
            if members.is_empty() {
                continue;
            }
            let place = |column: &usize| members.binary_search(column).unwrap_or_default();
            let channels =
                channels.into_iter().map(|channel| (channel.index(), self.channels[channel].iter().map(place).collect())).collect();
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
            let number = effect.zip(members.get(index)).and_then(|(effect, free)| effect.number(free.1));
            let (Some(effect), Some(number)) = (effect, number) else { return Default::default() };
            let terms = effect.terms.iter().filter(|term| term.coefficient.as_ref() == Some(&number.name));
            let swaps = effect.swaps.iter().filter(|swap| swap.with.names().contains(&number.name.as_str()));
            let regressors: Vec<String> =
                terms.map(|term| term.regressor.to_string()).chain(swaps.map(|swap| swap.with.to_string())).collect();
            (format!("`{}` of effect `{}`", number.name, effect.name), format!("`{}`", regressors.join("`, `")))
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
