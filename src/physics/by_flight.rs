//! Coefficients that belong to a flight (wind, bias): a ridge estimate for each flight beside the least squares of what all flights have
//! in common. Columns are numbers here, as in `least_squares`.
//!
//! Wanted are the common θ and the flights' b_f that minimise
//! Σ_c Σ_f |y − X θ − Z b_f|² / σ_c² + Σ_f |b_f / s|², s being the prior standard deviations and σ_c² the channels' residual variances.
//! Alternating between θ and b converges too slowly where the two are alike (the mean of a bias over the flights and a common constant
//! differ by the prior alone), so each flight's b_f is eliminated by a triangular factor, which is exact; only the σ_c are iterated.
//! Rows count as independent: with minutes of a flight the prior decides only what the data leave open.

use super::least_squares::{Cluster, Factor, Failure, Fit, Hold};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Rounds of new residual variances, at most.
const MOST_ROUNDS: usize = 30;

/// Settled, when no coefficient of a flight moves by more than this share of its size and prior deviation.
const SETTLED: f64 = 1e-9;

/// The columns that belong to a flight.
pub(super) struct Own {
    /// Prior standard deviation of each coefficient, in its unit.
    pub deviations: Vec<f64>,
    /// For each channel, the coefficients behind its columns, which follow the common ones.
    pub channels: Vec<Vec<usize>>,
}

/// What stands in the columns of the clusters' factors: common columns, those of a flight, the regressand.
pub(super) struct Shape<'a> {
    /// Number of common coefficients.
    pub free: usize,
    /// For each channel, the common coefficients behind its columns.
    pub channels: &'a [Vec<usize>],
    /// What belongs to a flight.
    pub own: &'a Own,
    /// What holds the common coefficients.
    pub hold: Option<&'a Hold>,
}

/// What came out.
pub(super) struct Settled {
    /// Coefficients by flight.
    pub values: BTreeMap<usize, Vec<f64>>,
    /// The clusters with the flights' own part taken off the regressand: common columns and the rest.
    pub clusters: Vec<Cluster>,
}

/// The rows of one channel of one flight: `[X | Z | y]` with a column for every coefficient there is.
struct Part {
    channel: usize,
    rows: usize,
    wide: DMatrix<f64>,
}

impl Shape<'_> {
    fn own_count(&self) -> usize {
        self.own.deviations.len()
    }

    /// Where the columns of a channel go, in the order own, common, regressand.
    fn places(&self, channel: usize) -> Vec<usize> {
        let free = self.channels.get(channel).into_iter().flatten().map(|column| self.own_count() + column);
        let own = self.own.channels.get(channel).into_iter().flatten().copied();
        free.chain(own).chain([self.own_count() + self.free]).collect()
    }

    /// The triangles of each flight, channel by channel.
    fn parts(&self, clusters: &mut [Cluster]) -> BTreeMap<usize, Vec<Part>> {
        let mut sums: BTreeMap<(usize, usize), Factor> = BTreeMap::new();
        for cluster in clusters {
            for (channel, factor) in cluster.factors.iter_mut().enumerate() {
                let (triangle, rows) = factor.finish();
                let sum = sums.entry((cluster.flight, channel)).or_insert_with(|| Factor::new(triangle.ncols()));
                sum.add_factor(triangle, rows, 1.0);
            }
        }
        let mut parts: BTreeMap<usize, Vec<Part>> = BTreeMap::new();
        for ((flight, channel), mut sum) in sums {
            let (triangle, rows) = sum.finish();
            let mut wide = DMatrix::zeros(triangle.nrows(), self.own_count() + self.free + 1);
            for (source, target) in self.places(channel).into_iter().enumerate() {
                wide.column_mut(target).copy_from(&triangle.column(source));
            }
            parts.entry(flight).or_default().push(Part { channel, rows, wide });
        }
        parts
    }

    /// θ and every b_f for given weights 1/σ of the channels.
    fn joint(&self, parts: &BTreeMap<usize, Vec<Part>>, weights: &[f64]) -> Result<(DVector<f64>, Vec<DVector<f64>>), Failure> {
        let (own, width) = (self.own_count(), self.own_count() + self.free + 1);
        let mut common = Factor::new(self.free + 1);
        let mut tops = Vec::with_capacity(parts.len());
        for parts in parts.values() {
            let mut stacked = Factor::new(width);
            let mut prior = DMatrix::zeros(own, width);
            for (index, deviation) in self.own.deviations.iter().enumerate() {
                prior[(index, index)] = deviation.recip();
            }
            stacked.add_factor(&prior, 0, 1.0);
            for part in parts {
                stacked.add_factor(&part.wide, part.rows, weights.get(part.channel).copied().unwrap_or(1.0));
            }
            let (triangle, rows) = stacked.finish();
            tops.push(triangle.rows(0, own).into_owned());
            common.add_factor(&triangle.view((own, own), (self.free + 1, self.free + 1)).into_owned(), rows, 1.0);
        }
        if let Some(hold) = self.hold {
            common.add_factor(&hold.factor(), 0, 1.0);
        }
        let (triangle, rows) = common.finish();
        if rows <= self.free {
            return Err(Failure::TooFewRows(rows));
        }
        // Without a common coefficient there is nothing left to solve.
        let values = match self.free {
            0 => DVector::zeros(0),
            free => Fit::new(&[(triangle.clone(), rows)], &[1.0], free)?.values,
        };
        let flights = tops
            .iter()
            .map(|top| {
                let wanted = top.column(width - 1) - top.columns(own, self.free) * &values;
                // The prior keeps the diagonal away from zero.
                top.columns(0, own).solve_upper_triangular(&wanted).unwrap_or_else(|| DVector::zeros(own))
            })
            .collect();
        Ok((values, flights))
    }
}

/// Finds the coefficients of the flights, and takes their part off the clusters.
pub(super) fn settle(shape: &Shape<'_>, clusters: &mut [Cluster]) -> Result<Settled, Failure> {
    let parts = shape.parts(clusters);
    let own = shape.own_count();
    let mut weights = shape.hold.map_or_else(|| vec![1.0; shape.channels.len()], |hold| hold.weights.clone());
    let (mut values, mut flights) = shape.joint(&parts, &weights)?;
    // Where the weights are given, they are those of the step before; the next step has better ones.
    for _ in 0..if shape.hold.is_some() { 0 } else { MOST_ROUNDS } {
        let mut sums = vec![(0.0, 0.0, 0); weights.len()];
        for (parts, of_flight) in parts.values().zip(&flights) {
            for part in parts {
                let Some((squares, level, rows)) = sums.get_mut(part.channel) else { continue };
                let measured = part.wide.column(own + shape.free);
                let residual = measured - part.wide.columns(0, own) * of_flight - part.wide.columns(own, shape.free) * &values;
                *squares += residual.norm_squared();
                *level += measured.norm_squared() * f64::EPSILON;
                *rows += part.rows;
            }
        }
        for (weight, (squares, level, rows)) in weights.iter_mut().zip(sums) {
            *weight = (rows as f64 / squares.max(level).max(f64::MIN_POSITIVE)).sqrt();
        }
        let before = flights;
        (values, flights) = shape.joint(&parts, &weights)?;
        let still = before.iter().zip(&flights).all(|(before, now)| {
            let sizes = now.iter().zip(&shape.own.deviations).map(|(now, deviation)| now.abs() + deviation);
            before.iter().zip(now.iter()).zip(sizes).all(|((before, now), size)| (before - now).abs() <= SETTLED * size)
        });
        if still {
            break;
        }
    }
    let values: BTreeMap<usize, Vec<f64>> =
        parts.keys().copied().zip(flights.iter().map(|values| values.iter().copied().collect())).collect();
    let clusters = clusters.iter_mut().map(|cluster| narrowed(shape, cluster, values.get(&cluster.flight))).collect();
    Ok(Settled { values, clusters })
}

/// A cluster without the columns that belong to its flight, their part being taken off the regressand.
fn narrowed(shape: &Shape<'_>, cluster: &mut Cluster, values: Option<&Vec<f64>>) -> Cluster {
    let mut factors = Vec::with_capacity(cluster.factors.len());
    for (channel, factor) in cluster.factors.iter_mut().enumerate() {
        let (triangle, rows) = factor.finish();
        let free = shape.channels.get(channel).map_or(0, Vec::len);
        let mut narrow = DMatrix::zeros(triangle.nrows(), free + 1);
        narrow.columns_mut(0, free).copy_from(&triangle.columns(0, free));
        let mut rest = triangle.column(triangle.ncols() - 1).into_owned();
        for (source, &index) in shape.own.channels.get(channel).into_iter().flatten().enumerate() {
            rest.axpy(
                -values.and_then(|values| values.get(index)).copied().unwrap_or_default(),
                &triangle.column(free + source),
                1.0,
            );
        }
        narrow.set_column(free, &rest);
        let mut kept = Factor::new(free + 1);
        kept.add_factor(&narrow, rows, 1.0);
        factors.push(kept);
    }
    Cluster { flight: cluster.flight, factors }
}
