//! Does what is left of the error still depend on something that was measured, and on what?
//!
//! Asked once, at the end of a search for missing effects. Trees, which know no physics, predict the residual of half of the
//! blocks from a fit to the other half. A dependence that they find there and that no known effect explains is an effect outside
//! the catalogue; this file names the variable and suggests a formula to start from. It is no physical explanation, and it says
//! nothing about effects that were found.
//!
//! Three guards keep gusts from being taken for physics: blocks that were not fitted (no credit for learning by heart), the same
//! procedure on residuals paired with the features of *other* blocks (chance), and the residual's own past (feedback, see
//! `persistence`).

mod persistence;
mod skeleton;
mod table;
mod trees;

pub use skeleton::SuggestedFormula;
pub use table::{AirOf, ROW_S, ROWS_MAX, ResidualTable};

use crate::error::{Error, Result};
use crate::flight::Channel;
use nalgebra::{DMatrix, DVector};
use persistence::Moments;
use phyture_kernels::random::{Stream, permutation};
use serde::Serialize;
use std::ops::Range;
use table::variable;
use trees::{Binned, Boosted};

/// Least share of a channel's residual variance for a dependence to be reported: a fall of the RMSE by 1 %. Feedback that the past
/// of the residual does not wholly account for stays below it.
pub const WORTH: f64 = 0.02;
/// Blocks below which the question is not answered: halves of four blocks, three to fit and one to stop on, are the fewest.
pub const FEWEST_BLOCKS: usize = 8;
/// Share of a dependence that has to remain once the residual's past is known, both ways.
const PERSISTS: f64 = 0.5;
/// The same for a dependence that is straight lines in states and sticks: calibration leaves few of them, feedback makes them.
const LINES_PERSIST: f64 = 0.75;
/// Variables that compete for the first place.
const RIVALS: usize = 6;
/// Share of the whole dependence from which a variable alone is "nearly all of it".
const NEARLY_ALL: f64 = 0.8;
/// States and sticks in which a model usually has straight lines.
const LINES: [&str; 13] = ["vx", "vy", "vz", "air_vx", "air_vy", "air_vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4"];
/// Rows of value zero that a knot of a broken line is taken to hold beside its own.
const KNOT_RIDGE: f64 = 10.0;
/// Rows of a half on which importance is measured.
const IMPORTANCE_ROWS: usize = 3000;
/// Where pairings are drawn.
const NULL_SITE: u64 = u64::MAX - 1;

/// How [`unknown`] looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownOptions {
    /// Seed of the halves and shuffles.
    pub seed: u64,
    /// Pairings of residuals with the features of other blocks; 19 or more make a 95 % quantile.
    pub nulls: usize,
    /// Least R² to report; [`WORTH`] if there is no reason for another.
    pub worth: f64,
}

impl Default for UnknownOptions {
    fn default() -> Self {
        Self { seed: 1, nulls: 20, worth: WORTH }
    }
}

/// One variable's part in a dependence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dependence {
    /// Name as in formulas.
    pub variable: String,
    /// Its share, 0 to 1; shares of all variables add up to 1. Where one variable alone explains nearly all, its share is what it
    /// explains alone; otherwise shares follow the loss of accuracy when the variable's values are shuffled.
    pub share: f64,
}

/// A dependence of one channel's residual that no effect of the model accounts for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unknown {
    /// Channel by name, `vx_dot` … `wz_dot`.
    pub channel: &'static str,
    /// Share of the residual variance that the variables explain on blocks that were not fitted, less what feedback may explain.
    pub r2: f64,
    /// The same without the reduction for feedback.
    pub r2_with_feedback: f64,
    /// 95 % quantile of the largest R² of the six channels when residuals are paired with features of other blocks.
    pub null_r2_95: f64,
    /// Variables, the most important first; those with less than 1 % are left out.
    pub depends_on: Vec<Dependence>,
    /// A term to start from.
    pub suggested_formula: Option<SuggestedFormula>,
    /// The shape of the dependence in words.
    pub skeleton: String,
}

/// Looks for a dependence of the residual on the features; one entry for each channel that shows one, strongest first. Empty means
/// that nothing measured tells what is left: gusts, noise, or too little data to see more.
///
/// R² = 1 − Σ (r − κ f)² / Σ (r − r̄)² on the half that was not fitted, mean of both ways; f are boosted trees, and κ ≤ 1 is what
/// remains of them once the residual's past is known. Reported where R² exceeds [`UnknownOptions::worth`] and the 95 % quantile of its
/// maximum over channels under pairings that cannot depend, and where κ is at least one half both ways, or three quarters where straight lines in
/// states and sticks are all of it. The result does not depend on the
/// number of threads.
///
/// # Errors
/// [`Error::Undetermined`] below [`FEWEST_BLOCKS`] blocks or without a feature that varies: then the question cannot be answered.
/// [`Error::Shape`] if the columns of the table differ in length or its block numbers fall.
pub fn unknown(table: &ResidualTable, options: &UnknownOptions) -> Result<Vec<Unknown>> {
    check(table)?;
    let halves = CrossFit::new(table, options);
    let whole = map(Channel::COUNT, &|index| halves.dependence(&halves.features, &halves.starts, &table.residual.values()[index]));
    let worth = |(_, found): &(Channel, &Explained)| found.r2_with_feedback > options.worth;
    let by_channel = || Channel::ALL.into_iter().zip(&whole);
    if !by_channel().any(|found| worth(&found)) {
        return Ok(Vec::new());
    }
    let null_r2_95 = halves.null(options.nulls);
    let candidates = by_channel().filter(worth).filter(|(_, found)| found.r2_with_feedback > null_r2_95);
    let candidates: Vec<(Channel, &Explained)> = candidates.collect();
    let described = map(candidates.len(), &|index| {
        let (channel, found) = candidates[index];
        halves.describe(channel, found, null_r2_95, options.worth)
    });
    let mut described: Vec<Unknown> = described.into_iter().flatten().collect();
    described.sort_by(|a, b| b.r2.total_cmp(&a.r2));
    Ok(described)
}

fn check(table: &ResidualTable) -> Result<()> {
    let rows = table.len();
    let even = table.features.iter().chain(&table.at_start).chain(&table.residual).all(|column| column.len() == rows);
    let even = even && (table.at_start.is_empty() || table.at_start.len() == table.features.len());
    let steady = table.block.windows(2).all(|pair| pair[1] == pair[0] || pair[1] == pair[0] + 1);
    if !even || table.names.len() != table.features.len() || !steady || table.block.first().is_some_and(|first| *first != 0) {
        let message = "columns of different length, or block numbers that do not rise by one from 0".into();
        return Err(Error::Shape { operation: "unknown dependence", message });
    }
    let blocks = table.block.last().map_or(0, |last| last + 1);
    if blocks < FEWEST_BLOCKS || table.features.is_empty() {
        let features = table.features.len();
        return Err(Error::Undetermined(format!(
            "{blocks} blocks and {features} features that vary are too little to ask what the residual depends on; \
             give at least {FEWEST_BLOCKS} blocks of flight"
        )));
    }
    Ok(())
}

/// What trees on some of the features find in one channel.
#[derive(Clone, Debug)]
struct Explained {
    r2: f64,
    r2_with_feedback: f64,
    /// κ, the smaller of both ways.
    persists: f64,
    models: [Boosted; 2],
}

/// The halves of the blocks, binned features and the groups of features that are one variable.
struct CrossFit<'a> {
    table: &'a ResidualTable,
    seed: u64,
    blocks: Vec<Range<usize>>,
    /// Blocks of each half, in the order of time.
    halves: [Vec<Range<usize>>; 2],
    /// Rows of each half to fit, and to stop on.
    rows: [[Vec<u32>; 2]; 2],
    features: Binned,
    starts: Binned,
    groups: Vec<(String, Vec<usize>)>,
}

impl<'a> CrossFit<'a> {
    fn new(table: &'a ResidualTable, options: &UnknownOptions) -> Self {
        let blocks = table.blocks();
        let order = permutation(blocks.len(), options.seed, 0);
        let mut chosen: [Vec<usize>; 2] = Default::default();
        order.iter().enumerate().for_each(|(place, block)| chosen[place % 2].push(*block as usize));
        // Every fourth block of a half, in drawn order, is set aside to stop on.
        let rows = chosen.each_ref().map(|half| {
            let mut rows: [Vec<u32>; 2] = Default::default();
            for (place, block) in half.iter().enumerate() {
                let range = blocks.get(*block).cloned().unwrap_or_default();
                rows[usize::from(place % 4 == 3)].extend(range.map(|row| row as u32));
            }
            rows.iter_mut().for_each(|rows| rows.sort_unstable());
            rows
        });
        let halves = chosen.map(|mut half| {
            half.sort_unstable();
            half.iter().filter_map(|block| blocks.get(*block).cloned()).collect()
        });
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        for (feature, name) in table.names.iter().enumerate() {
            let name = variable(name);
            match groups.iter_mut().find(|group| group.0 == name) {
                Some(group) => group.1.push(feature),
                None => groups.push((name.to_owned(), vec![feature])),
            }
        }
        let features = Binned::new(&table.features);
        let starts = if table.at_start.is_empty() { features.clone() } else { features.like(&table.at_start) };
        Self { table, seed: options.seed, blocks, halves, rows, features, starts, groups }
    }

    /// Fits each half and judges on the other; `starts` are the same features at the start of each row.
    fn dependence(&self, features: &Binned, starts: &Binned, residual: &[f64]) -> Explained {
        let models = self.models(features, residual);
        let mut found = Explained { r2: 0.0, r2_with_feedback: 0.0, persists: 1.0, models };
        for (model, judged) in found.models.iter().zip(self.judged()) {
            if model.is_constant() {
                found.persists = 0.0;
                continue;
            }
            let of = |bins: &Binned| {
                let mut values = vec![0.0; residual.len()];
                judged.iter().cloned().flatten().for_each(|row| values[row] = model.predict(bins.row(row)));
                values
            };
            let moments = Moments::new(judged, residual, &of(features), &of(starts));
            let factor = moments.factor();
            found.r2 += 0.5 * moments.r2(factor);
            found.r2_with_feedback += 0.5 * moments.r2(1.0);
            found.persists = found.persists.min(factor);
        }
        found
    }

    /// One model fitted to each half.
    fn models(&self, features: &Binned, residual: &[f64]) -> [Boosted; 2] {
        let target: Vec<f32> = residual.iter().map(|value| *value as f32).collect();
        self.rows.each_ref().map(|[fit, aside]| Boosted::fit(features, &target, fit, aside))
    }

    /// The blocks on which each of the two models is judged.
    fn judged(&self) -> [&[Range<usize>]; 2] {
        [&self.halves[1], &self.halves[0]]
    }

    /// R² on the half that was not fitted, feedback included.
    fn plain_r2(&self, residual: &[f64]) -> f64 {
        let models = self.models(&self.features, residual);
        let r2 = models.iter().zip(self.judged()).map(|(model, judged)| {
            if model.is_constant() {
                return 0.0;
            }
            let rows = || judged.iter().cloned().flatten();
            let count = rows().count().max(1) as f64;
            let of = |row: usize| [residual[row], model.predict(self.features.row(row))];
            let [r, f] = rows().map(of).fold([0.0; 2], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]).map(|sum| sum / count);
            let (left, all) = rows()
                .map(of)
                .fold((0.0, 0.0), |(left, all), pair| (left + (pair[0] - r - (pair[1] - f)).powi(2), all + (pair[0] - r).powi(2)));
            if all > 0.0 { 1.0 - left / all } else { 0.0 }
        });
        0.5 * r2.sum::<f64>()
    }

    /// 95 % quantile of the largest R² of the six channels over pairings of residuals with the features of another block.
    fn null(&self, count: usize) -> f64 {
        let pairings: Vec<Vec<usize>> = (0..count as u64).map(|index| self.pairing(index)).collect();
        let r2 = map(pairings.len() * Channel::COUNT, &|task| {
            let channel = &self.table.residual.values()[task % Channel::COUNT];
            let residual: Vec<f64> = pairings[task / Channel::COUNT].iter().map(|row| channel[*row]).collect();
            self.plain_r2(&residual)
        });
        let mut largest: Vec<f64> = r2.chunks_exact(6).map(|channels| channels.iter().copied().fold(0.0, f64::max)).collect();
        largest.sort_by(f64::total_cmp);
        let rank = (0.95 * largest.len() as f64).ceil() as usize;
        largest.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
    }

    /// For each row, a row of another block whose residual it is given. Stretches stay whole, so that gusts and what differs from
    /// flight to flight last as long as they did.
    ///
    /// A flight is given the rows that lie a shift further on, from a random one on and in random direction, because flights that all
    /// begin alike keep their common clock under a mere shift. A log with one long flight is shifted by blocks.
    fn pairing(&self, index: u64) -> Vec<usize> {
        let rows = self.table.len();
        let draw = Stream::new(self.seed, index, NULL_SITE, 0);
        let flights: Vec<Range<usize>> = runs(&self.table.flight);
        let longest = flights.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        let up_to = |draw: f64, count: usize| ((draw * count as f64) as usize).min(count.saturating_sub(1));
        if 3 * longest > rows {
            let shift = 1 + up_to(draw.uniform(0), self.blocks.len() - 1);
            let paired = self.blocks.iter().enumerate().flat_map(|(number, range)| {
                let from = self.blocks[(number + shift) % self.blocks.len()].clone();
                // A short block is gone through again.
                from.cycle().take(range.len())
            });
            return paired.collect();
        }
        let shift = longest + up_to(draw.uniform(0), rows - 2 * longest + 1);
        let of_flight = |(number, range): (usize, Range<usize>)| {
            let (draw, length) = (draw.sub(number as u64), range.len());
            let (first, back) = (up_to(draw.uniform(1), length), draw.uniform(2) < 0.5);
            range.clone().map(move |row| {
                let place = (row - range.start + first) % length;
                let place = if back { length - 1 - place } else { place };
                (range.start + shift + place) % rows
            })
        };
        flights.into_iter().enumerate().flat_map(of_flight).collect()
    }

    /// R² of straight lines in all states and sticks beside a broken line in each of the `chosen` features, on the half that was not fitted, mean of
    /// both ways; and the lines' part of a fit to all rows, those in `chosen` left out.
    ///
    /// The model was calibrated with such lines beside the effect that it lacks, and they have taken up part of it. What remains
    /// looks like a function of every state that moves with the cause, unless the lines are fitted anew.
    fn beside_lines(&self, chosen: &[usize], residual: &[f64]) -> (f64, Vec<f64>) {
        let lines = || self.table.names.iter().enumerate().filter(|(_, name)| LINES.contains(&name.as_str())).map(|found| found.0);
        let scaled: Vec<Vec<f64>> = lines()
            .map(|feature| {
                let values = &self.table.features[feature];
                let count = values.len().max(1) as f64;
                let mean = values.iter().sum::<f64>() / count;
                let rms = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
                values.iter().map(|value| (value - mean) / rms.max(f64::MIN_POSITIVE)).collect()
            })
            .collect();
        let knots: Vec<(&[f64], Vec<f64>)> = chosen
            .iter()
            .map(|feature| (self.table.features[*feature].as_slice(), self.features.knots(&self.table.features, *feature)))
            .collect();
        let size = 1 + scaled.len() + chosen.len() * (trees::BINS + 1);
        // The regressors of a row that are not zero: a constant, the lines, and two hats a feature, which make a broken line.
        let regressors = |row: usize, out: &mut Vec<(usize, f64)>| {
            out.clear();
            out.push((0, 1.0));
            out.extend(scaled.iter().enumerate().map(|(line, values)| (1 + line, values[row])));
            for (number, (values, knots)) in knots.iter().enumerate() {
                let upper = knots.partition_point(|knot| *knot <= values[row]).clamp(1, knots.len() - 1);
                let share = (values[row] - knots[upper - 1]) / (knots[upper] - knots[upper - 1]);
                let first = 1 + scaled.len() + number * (trees::BINS + 1);
                out.extend([(first + upper - 1, 1.0 - share), (first + upper, share)]);
            }
        };
        let fit = |ranges: &[&Range<usize>]| {
            let (mut gram, mut right, mut row) = (DMatrix::<f64>::zeros(size, size), DVector::zeros(size), Vec::new());
            for index in ranges.iter().flat_map(|range| (*range).clone()) {
                regressors(index, &mut row);
                for (i, value) in &row {
                    right[*i] += value * residual[index];
                    row.iter().for_each(|(j, other)| gram[(*i, *j)] += value * other);
                }
            }
            for index in 0..size {
                gram[(index, index)] += if index > scaled.len() { KNOT_RIDGE } else { 1e-6 * gram[(index, index)] };
            }
            gram.cholesky().map_or_else(|| DVector::zeros(size), |factor| factor.solve(&right))
        };
        let value = |factors: &DVector<f64>, index: usize, row: &mut Vec<(usize, f64)>| {
            regressors(index, row);
            row.iter().map(|(place, value)| factors[*place] * value).sum::<f64>()
        };
        let (mut r2, mut row) = (0.0, Vec::new());
        for (fitted, judged) in self.halves.iter().zip(self.judged()) {
            let factors = fit(&fitted.iter().collect::<Vec<_>>());
            let rows = || judged.iter().cloned().flatten();
            let mean = rows().map(|index| residual[index]).sum::<f64>() / rows().count().max(1) as f64;
            let all: f64 = rows().map(|index| (residual[index] - mean).powi(2)).sum();
            let left: f64 = rows().map(|index| (residual[index] - value(&factors, index, &mut row)).powi(2)).sum();
            r2 += if all > 0.0 { 0.5 * (1.0 - left / all) } else { 0.0 };
        }
        let factors = fit(&self.blocks.iter().collect::<Vec<_>>());
        let others = lines().zip(&scaled).enumerate().filter(|(_, (feature, _))| !chosen.contains(feature));
        let mut part = vec![0.0; residual.len()];
        for (line, (_, values)) in others {
            part.iter_mut().zip(values).for_each(|(part, value)| *part += factors[1 + line] * value);
        }
        (r2, part)
    }

    /// R² of the best function of one variable beside lines. A stick and its lags are tried one by one: three functions in one would
    /// have an advantage.
    fn rival(&self, group: usize, residual: &[f64]) -> f64 {
        let (name, features) = &self.groups[group];
        if name == "yaw" {
            return self.beside_lines(features, residual).0;
        }
        features.iter().map(|feature| self.beside_lines(&[*feature], residual).0).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Names the variables behind a dependence; `None` if it is one of feedback.
    fn describe(&self, channel: Channel, found: &Explained, null_r2_95: f64, worth: f64) -> Option<Unknown> {
        let residual = &self.table.residual[channel];
        let mut shares = self.importance(found, residual);
        // Rivals often move together (height and thrust, speed and its components): each is tried alone.
        let alone: Vec<Explained> = shares
            .iter()
            .take(RIVALS)
            .map(|(group, _)| {
                let features = &self.groups[*group].1;
                self.dependence(&self.features.select(features), &self.starts.select(features), residual)
            })
            .collect();
        // Where straight lines do not already explain it, rivals are compared with the lines fitted anew.
        let lines = self.beside_lines(&[], residual).0;
        let bent = lines < NEARLY_ALL * found.r2_with_feedback;
        let persists = if bent { PERSISTS } else { LINES_PERSIST };
        let stands = |found: &Explained| found.persists >= persists && found.r2 > worth && found.r2 > null_r2_95;
        let best = (0..alone.len()).max_by(|a, b| alone[*a].r2.total_cmp(&alone[*b].r2))?;
        let (mut r2, mut r2_with_feedback) = (found.r2, found.r2_with_feedback);
        if !stands(found) {
            // Feedback of other variables may hide one that is a cause.
            if !stands(&alone[best]) {
                return None;
            }
            (r2, r2_with_feedback) = (alone[best].r2, alone[best].r2_with_feedback);
        }
        let beside: Vec<f64> = if bent {
            shares.iter().take(RIVALS).map(|(group, _)| self.rival(*group, residual)).collect()
        } else {
            alone.iter().map(|found| found.r2_with_feedback).collect()
        };
        let best = (0..beside.len()).max_by(|a, b| beside[*a].total_cmp(&beside[*b])).unwrap_or(best);
        let of_it = (beside[best] / r2_with_feedback).clamp(0.0, 1.0);
        if of_it >= NEARLY_ALL {
            let (first, was) = shares.remove(best);
            shares.iter_mut().for_each(|(_, share)| *share *= if was < 1.0 { (1.0 - of_it) / (1.0 - was) } else { 0.0 });
            shares.insert(0, (first, of_it));
        }
        let named = |(group, share): &(usize, f64)| Dependence { variable: self.groups[*group].0.clone(), share: *share };
        let depends_on: Vec<Dependence> = shares.iter().filter(|(_, share)| *share >= 0.01).map(named).collect();
        let first = shares.first().map(|(group, _)| self.groups[*group].1.as_slice()).unwrap_or_default();
        let second = shares.get(1).filter(|_| of_it < NEARLY_ALL).map(|(group, _)| self.groups[*group].1.as_slice());
        let name = channel.name();
        let shown = [first, second.unwrap_or_default()].concat();
        let part = if bent { self.beside_lines(&shown, residual).1 } else { vec![0.0; residual.len()] };
        let bent: Vec<f64> = residual.iter().zip(part).map(|(residual, part)| residual - part).collect();
        let (suggested_formula, skeleton) =
            skeleton::suggest(self.table, channel, &bent, first, second.unwrap_or_default(), &self.halves);
        Some(Unknown { channel: name, r2, r2_with_feedback, null_r2_95, depends_on, suggested_formula, skeleton })
    }

    /// Groups and their shares of the rise of the squared error when the group's values are shuffled among the judged rows
    /// (Breiman 2001), largest first.
    fn importance(&self, found: &Explained, residual: &[f64]) -> Vec<(usize, f64)> {
        let mut rises = vec![0.0; self.groups.len()];
        for (half, model) in found.models.iter().enumerate() {
            let judged: Vec<usize> = self.halves[1 - half].iter().cloned().flatten().collect();
            let rows: Vec<usize> = judged.iter().copied().step_by(judged.len().div_ceil(IMPORTANCE_ROWS).max(1)).collect();
            let error = |row: usize, bins: &[u8]| (residual[row] - model.predict(bins)).powi(2);
            let plain: f64 = rows.iter().map(|row| error(*row, self.features.row(*row))).sum();
            let order = permutation(rows.len(), self.seed, 2 + half as u64);
            for (rise, (_, features)) in rises.iter_mut().zip(&self.groups) {
                let mut bins = Vec::new();
                let shuffled = rows.iter().zip(&order).map(|(row, other)| {
                    bins.clear();
                    bins.extend_from_slice(self.features.row(*row));
                    let other = self.features.row(rows[*other as usize]);
                    features.iter().for_each(|feature| bins[*feature] = other[*feature]);
                    error(*row, &bins)
                });
                *rise += (shuffled.sum::<f64>() - plain).max(0.0);
            }
        }
        let total: f64 = rises.iter().sum();
        let mut shares: Vec<(usize, f64)> = rises.into_iter().map(|rise| rise / total.max(f64::MIN_POSITIVE)).enumerate().collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }
}

/// Runs of equal values.
fn runs(values: &[usize]) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (row, value) in values.iter().enumerate() {
        match ranges.last_mut().filter(|range| values.get(range.start) == Some(value)) {
            Some(range) => range.end = row + 1,
            None => ranges.push(row..row + 1),
        }
    }
    ranges
}

/// `of` for 0 … `count` − 1, in order, on the threads there are.
fn map<T: Send>(count: usize, of: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map(of).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        (0..count).map(of).collect()
    }
}

#[cfg(test)]
mod tests;
