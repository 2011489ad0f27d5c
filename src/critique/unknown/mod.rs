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
pub use table::{ROW_S, ROWS_MAX, ResidualTable};

use crate::error::{Error, Result};
use crate::flight::Column;
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
/// Share of a dependence that has to remain once the residual's past is known.
const PERSISTS: f64 = 0.5;
/// Variables that compete for the first place.
const RIVALS: usize = 4;
/// Share of the whole dependence from which a variable alone is "nearly all of it".
const NEARLY_ALL: f64 = 0.8;
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
/// maximum over channels under pairings that cannot depend, and where κ is at least one half. The result does not depend on the
/// number of threads.
///
/// # Errors
/// [`Error::Undetermined`] below [`FEWEST_BLOCKS`] blocks or without a feature that varies: then the question cannot be answered.
/// [`Error::Shape`] if the columns of the table differ in length or its block numbers fall.
pub fn unknown(table: &ResidualTable, options: &UnknownOptions) -> Result<Vec<Unknown>> {
    check(table)?;
    let search = Search::new(table, options);
    let whole = map(6, &|channel| search.dependence(&search.features, &table.residual[channel]));
    let worth = |(_, found): &(usize, &Found)| found.r2_with_feedback > options.worth;
    if !whole.iter().enumerate().any(|found| worth(&found)) {
        return Ok(Vec::new());
    }
    let null_r2_95 = search.null(options.nulls);
    let candidates = whole.iter().enumerate().filter(worth).filter(|(_, found)| found.r2_with_feedback > null_r2_95);
    let candidates: Vec<(usize, &Found)> = candidates.collect();
    let described = map(candidates.len(), &|index| {
        let (channel, found) = candidates[index];
        search.describe(channel, found, null_r2_95, options.worth)
    });
    let mut described: Vec<Unknown> = described.into_iter().flatten().collect();
    described.sort_by(|a, b| b.r2.total_cmp(&a.r2));
    Ok(described)
}

fn check(table: &ResidualTable) -> Result<()> {
    let rows = table.len();
    let even = table.features.iter().chain(&table.residual).all(|column| column.len() == rows);
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
struct Found {
    r2: f64,
    r2_with_feedback: f64,
    /// κ, the mean of both ways.
    persists: f64,
    models: [Boosted; 2],
}

/// The halves of the blocks, binned features and the groups of features that are one variable.
struct Search<'a> {
    table: &'a ResidualTable,
    seed: u64,
    blocks: Vec<Range<usize>>,
    /// Blocks of each half, in the order of time.
    halves: [Vec<Range<usize>>; 2],
    /// Rows of each half to fit, and to stop on.
    rows: [[Vec<u32>; 2]; 2],
    features: Binned,
    groups: Vec<(String, Vec<usize>)>,
}

impl<'a> Search<'a> {
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
        Self { table, seed: options.seed, blocks, halves, rows, features: Binned::new(&table.features), groups }
    }

    /// Fits each half and judges on the other.
    fn dependence(&self, features: &Binned, residual: &[f64]) -> Found {
        let target: Vec<f32> = residual.iter().map(|value| *value as f32).collect();
        let models = self.rows.each_ref().map(|[fit, aside]| Boosted::fit(features, &target, fit, aside));
        let mut found = Found { r2: 0.0, r2_with_feedback: 0.0, persists: 0.0, models };
        for (model, judged) in found.models.iter().zip([&self.halves[1], &self.halves[0]]) {
            if model.is_constant() {
                continue;
            }
            let mut fit = vec![0.0; residual.len()];
            judged.iter().cloned().flatten().for_each(|row| fit[row] = model.predict(features.row(row)));
            let moments = Moments::new(judged, residual, &fit);
            let factor = moments.factor();
            found.r2 += 0.5 * moments.r2(factor);
            found.r2_with_feedback += 0.5 * moments.r2(1.0);
            found.persists += 0.5 * factor;
        }
        found
    }

    /// 95 % quantile of the largest R² of the six channels over pairings of residuals with the features of another block.
    fn null(&self, count: usize) -> f64 {
        let pairings: Vec<Vec<usize>> = (0..count as u64).map(|index| self.pairing(index)).collect();
        let r2 = map(pairings.len() * 6, &|task| {
            let channel = &self.table.residual[task % 6];
            let residual: Vec<f64> = pairings[task / 6].iter().map(|row| channel[*row]).collect();
            self.dependence(&self.features, &residual).r2_with_feedback
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

    /// Names the variables behind a dependence; `None` if it is one of feedback.
    fn describe(&self, channel: usize, found: &Found, null_r2_95: f64, worth: f64) -> Option<Unknown> {
        let residual = &self.table.residual[channel];
        let mut shares = self.importance(found, residual);
        // Rivals often move together (height and thrust, speed and its components): each is tried alone.
        let alone: Vec<Found> = shares
            .iter()
            .take(RIVALS)
            .map(|(group, _)| self.dependence(&self.features.select(&self.groups[*group].1), residual))
            .collect();
        let stands = |found: &Found| found.persists >= PERSISTS && found.r2 > worth && found.r2 > null_r2_95;
        let best = (0..alone.len()).max_by(|a, b| alone[*a].r2.total_cmp(&alone[*b].r2))?;
        let (mut r2, mut r2_with_feedback) = (found.r2, found.r2_with_feedback);
        if !stands(found) {
            // Feedback of other variables may hide one that is a cause.
            if !stands(&alone[best]) {
                return None;
            }
            (r2, r2_with_feedback) = (alone[best].r2, alone[best].r2_with_feedback);
        }
        let of_it = (alone[best].r2 / r2).min(1.0);
        if of_it >= NEARLY_ALL {
            let (first, was) = shares.remove(best);
            shares.iter_mut().for_each(|(_, share)| *share *= if was < 1.0 { (1.0 - of_it) / (1.0 - was) } else { 0.0 });
            shares.insert(0, (first, of_it));
        }
        let named = |(group, share): &(usize, f64)| Dependence { variable: self.groups[*group].0.clone(), share: *share };
        let depends_on: Vec<Dependence> = shares.iter().filter(|(_, share)| *share >= 0.01).map(named).collect();
        let first = shares.first().map(|(group, _)| self.groups[*group].1.as_slice()).unwrap_or_default();
        let second = shares.get(1).filter(|_| of_it < NEARLY_ALL).map(|(group, _)| self.groups[*group].1.as_slice());
        let name = Column::TARGETS.get(channel).map_or("?", |column| column.name());
        let (suggested_formula, skeleton) = skeleton::suggest(self.table, channel, first, second.unwrap_or_default(), &self.halves);
        Some(Unknown { channel: name, r2, r2_with_feedback, null_r2_95, depends_on, suggested_formula, skeleton })
    }

    /// Groups and their shares of the rise of the squared error when the group's values are shuffled among the judged rows
    /// (Breiman 2001), largest first.
    fn importance(&self, found: &Found, residual: &[f64]) -> Vec<(usize, f64)> {
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
