//! Two searches of the literature on the same columns and blocks, as yardsticks for this one: stepwise regression (partial F above 20,
//! predicted squared error; Klein & Morelli, *Aircraft System Identification*, 2006, ch. 5, as in SIDPAC, without the analyst) and sequentially
//! thresholded least squares (STLSQ; Brunton, Proctor & Kutz 2016, PNAS 113:3932, as in PySINDy, threshold chosen on held-out blocks).
//!
//! Both work channel by channel with one free coefficient a column. A static effect brings its regressors with parameters at their
//! origin; a swap brings the regressors it changes, beside those they would replace. No effect is named twice; what a user is told is the
//! list of effects whose columns were kept.

use super::candidate::{candidates, with};
use super::design::{Design, Layout};
use super::engine::Engine;
use super::gram::{BlockGram, blocks, grams};
use crate::error::Result;
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::physics::Model;
use nalgebra::{Cholesky, DMatrix, DVector};
use ndarray::Array2;

/// A column enters or stays above this partial F (SIDPAC's default: four times the 95 % value of some 5).
const F_TO_ENTER: f64 = 20.0;
/// Every so many-th block chooses the threshold.
const HELD_OUT: usize = 5;
/// Thresholds tried, relative to the largest coefficient of normalised columns.
const THRESHOLDS: [f64; 8] = [0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7];

/// What a method reports: effects, the one that explains most first.
pub type Named = Vec<String>;

/// Both methods on one data set: `(stepwise, STLSQ)`. `dynamic` keeps the columns of effects without a coefficient (lags, delays) in the library.
///
/// # Errors
/// As [`super::diagnose`].
pub fn stepwise_and_stlsq(flights: &[Flight], model: &Model, searched: &[Span], dynamic: bool) -> Result<(Named, Named)> {
    let cut = blocks(flights, searched, 10.0);
    let fold = (0..cut.len()).map(|block| block % HELD_OUT).collect();
    let engine = Engine { flights, blocks: cut, fold, correlation: 1.0, held: Vec::new() };
    let base = engine.pass(model, &[])?.base.model;
    let tried: Vec<_> = candidates(&base, flights)
        .into_iter()
        .filter(|candidate| candidate.inapplicable.is_none() && (dynamic || !candidate.effect.coefficients.is_empty()))
        .collect();
    let mut design = Design::default();
    let own = design.model(&base)?;
    let mut libraries: PerChannel<Vec<(usize, String)>> = PerChannel::default();
    for candidate in &tried {
        let layout = design.model(&with(&base, &candidate.effect))?;
        for (channel, library) in libraries.pairs_mut() {
            for column in columns(&layout, channel) {
                if !columns(&own, channel).contains(&column) && !library.iter().any(|known| known.0 == column) {
                    library.push((column, candidate.id.clone()));
                }
            }
        }
    }
    design.mix();
    let all = grams(flights, &engine.blocks, &design)?;
    let (mut stepped, mut sparse) = (Vec::new(), Vec::new());
    for (channel, library) in libraries.pairs() {
        let problem = Problem::new(&all, &engine.fold, channel, &own, library);
        stepped.extend(problem.stepwise());
        sparse.extend(problem.thresholded());
    }
    Ok((ranked(stepped), ranked(sparse)))
}

/// Columns of a layout in a channel, free ones only.
fn columns(layout: &Layout, channel: Channel) -> Vec<usize> {
    layout.channels[channel].free.iter().flat_map(|entry| entry.1.iter().map(|column| column.0)).collect()
}

/// Names by the largest share of a channel's error they explain.
fn ranked(mut found: Vec<(String, f64)>) -> Named {
    found.sort_by(|left, right| right.1.total_cmp(&left.1));
    let mut names = Vec::new();
    for (name, _) in found {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// One channel: normal matrices of `[own columns | library | y − fixed]`, for learning and held out.
struct Problem<'a> {
    learn: DMatrix<f64>,
    held: DMatrix<f64>,
    rows: f64,
    own: usize,
    library: &'a [(usize, String)],
}

impl<'a> Problem<'a> {
    fn new(grams: &[BlockGram], fold: &[usize], channel: Channel, own: &Layout, library: &'a [(usize, String)]) -> Self {
        let fixed = &own.channels[channel].fixed;
        let mut order = columns(own, channel);
        let count = order.len();
        order.extend(library.iter().map(|entry| entry.0));
        let sum = |wanted: &dyn Fn(usize) -> bool| {
            let target = grams.first().map_or(0, |gram| gram.channels[channel].size() - 1);
            let mut total = Array2::<f64>::zeros((target + 1, target + 1));
            let mut rows = 0;
            for (gram, _) in grams.iter().zip(fold).filter(|(_, fold)| wanted(**fold)) {
                total
                    .indexed_iter_mut()
                    .for_each(|((i, j), sum)| *sum += gram.channels[channel].at(gram.channels[channel].place(i, j)));
                rows += gram.rows;
            }
            let parts = |index: usize| -> Vec<(usize, f64)> {
                match order.get(index) {
                    Some(&column) => vec![(column, 1.0)],
                    None => std::iter::once((target, 1.0)).chain(fixed.iter().map(|&column| (column, -1.0))).collect(),
                }
            };
            let entry = |row: usize, column: usize| {
                let mut sum = 0.0;
                for (i, a) in parts(row) {
                    for (j, b) in parts(column) {
                        sum += a * b * total[(i, j)];
                    }
                }
                sum
            };
            (DMatrix::from_fn(order.len() + 1, order.len() + 1, entry), rows as f64)
        };
        let ((learn, rows), (held, _)) = (sum(&|fold| fold != 0), sum(&|fold| fold == 0));
        Self { learn, held, rows, own: count, library }
    }

    fn last(&self) -> usize {
        self.learn.nrows() - 1
    }

    /// Coefficients and squared error of least squares on some columns.
    fn solve(&self, chosen: &[usize]) -> Option<(DVector<f64>, f64)> {
        let last = self.last();
        let scale: Vec<f64> = chosen.iter().map(|&column| self.learn[(column, column)].sqrt()).collect();
        if !scale.iter().all(|scale| *scale > 0.0) {
            return None;
        }
        let matrix = DMatrix::from_fn(chosen.len(), chosen.len(), |i, j| {
            self.learn[(chosen[i], chosen[j])] / (scale[i] * scale[j]) + if i == j { 1e-9 } else { 0.0 }
        });
        let side = DVector::from_fn(chosen.len(), |i, _| self.learn[(chosen[i], last)] / scale[i]);
        let scaled = Cholesky::new(matrix)?.solve(&side);
        let error = self.learn[(last, last)] - scaled.dot(&side);
        Some((DVector::from_fn(chosen.len(), |i, _| scaled[i] / scale[i]), error.max(f64::MIN_POSITIVE)))
    }

    /// Share of the error that each named effect's columns explain, given the other chosen ones.
    fn named(&self, chosen: &[usize]) -> Vec<(String, f64)> {
        let Some((_, whole)) = self.solve(chosen) else { return Vec::new() };
        let Some((_, start)) = self.solve(&(0..self.own).collect::<Vec<_>>()) else { return Vec::new() };
        let mut names: Vec<&String> = chosen
            .iter()
            .filter_map(|&column| column.checked_sub(self.own).and_then(|at| self.library.get(at)))
            .map(|entry| &entry.1)
            .collect();
        names.sort();
        names.dedup();
        names
            .into_iter()
            .map(|name| {
                let without: Vec<usize> = chosen
                    .iter()
                    .copied()
                    .filter(|&column| {
                        column.checked_sub(self.own).and_then(|at| self.library.get(at)).is_none_or(|entry| entry.1 != *name)
                    })
                    .collect();
                let error = self.solve(&without).map_or(start, |solved| solved.1);
                (name.clone(), (error - whole) / start)
            })
            .collect()
    }

    /// Forward steps with backward elimination, until no partial F is above the limit or the predicted squared error rises:
    /// PSE = SSE/N + σ² p/N with σ² half of the variance of the regressand.
    fn stepwise(&self) -> Vec<(String, f64)> {
        let last = self.last();
        let mut chosen: Vec<usize> = (0..self.own).collect();
        let penalty = 0.5 * self.learn[(last, last)] / self.rows;
        let predicted = |error: f64, terms: usize| (error + penalty * terms as f64) / self.rows;
        let Some((_, mut error)) = self.solve(&chosen) else { return Vec::new() };
        for _ in 0..3 * self.library.len() {
            let enter = (self.own..last).filter(|column| !chosen.contains(column)).filter_map(|column| {
                let mut more = chosen.clone();
                more.push(column);
                self.solve(&more).map(|solved| (column, solved.1))
            });
            let Some((column, less)) = enter.min_by(|left, right| left.1.total_cmp(&right.1)) else { break };
            let freedom = self.rows - chosen.len() as f64 - 1.0;
            if (error - less) / (less / freedom) < F_TO_ENTER || predicted(less, chosen.len() + 1) > predicted(error, chosen.len())
            {
                break;
            }
            chosen.push(column);
            error = less;
            let leave = chosen.iter().copied().filter(|&column| column >= self.own).filter_map(|column| {
                let fewer: Vec<usize> = chosen.iter().copied().filter(|&other| other != column).collect();
                self.solve(&fewer).map(|solved| (column, solved.1))
            });
            if let Some((column, more)) = leave.min_by(|left, right| left.1.total_cmp(&right.1))
                && (more - error) / (error / freedom) < F_TO_ENTER
            {
                chosen.retain(|&other| other != column);
                error = more;
            }
        }
        self.named(&chosen)
    }

    /// Least squares, drop what is small, again; the threshold with the smallest held-out error.
    fn thresholded(&self) -> Vec<(String, f64)> {
        let last = self.last();
        let size = |column: usize| self.learn[(column, column)].sqrt();
        let mut best: Option<(f64, Vec<usize>)> = None;
        for threshold in THRESHOLDS {
            let mut chosen: Vec<usize> = (0..last).filter(|&column| size(column) > 0.0).collect();
            let mut values = DVector::zeros(0);
            for _ in 0..20 {
                let Some((found, _)) = self.solve(&chosen) else { break };
                let normalised: Vec<f64> =
                    chosen.iter().zip(found.iter()).map(|(&column, value)| (value * size(column)).abs()).collect();
                let largest = normalised.iter().copied().fold(0.0, f64::max);
                let kept: Vec<usize> = chosen
                    .iter()
                    .zip(&normalised)
                    .filter(|(_, value)| **value >= threshold * largest)
                    .map(|(column, _)| *column)
                    .collect();
                let settled = kept.len() == chosen.len();
                (chosen, values) = (kept, found);
                if settled {
                    break;
                }
            }
            if chosen.len() != values.len() {
                continue;
            }
            let mut held = self.held[(last, last)];
            for (i, &a) in chosen.iter().enumerate() {
                held -= 2.0 * values[i] * self.held[(a, last)];
                for (j, &b) in chosen.iter().enumerate() {
                    held += values[i] * values[j] * self.held[(a, b)];
                }
            }
            if best.as_ref().is_none_or(|best| held < best.0) {
                best = Some((held, chosen));
            }
        }
        best.map_or_else(Vec::new, |(_, chosen)| self.named(&chosen))
    }
}
