//! Linear least squares in one pass over the rows, with intervals that stay honest when residuals are autocorrelated.
//! Columns are numbers here; what they stand for is calibration's business.
//!
//! Rows are reduced, cluster by cluster (stretches of consecutive samples), to triangular factors: `[X | y] = Q R`. The factors
//! of clusters stack and reduce again (tall-skinny QR), so the rows are never held, and the normal equations, which square the
//! condition number, are never formed for the estimate. From each cluster's factor follows what the estimate would have been
//! without that cluster: the cluster jackknife (MacKinnon, Nielsen & Webb 2023, J. Applied Econometrics 38:671, "CV3"), valid
//! under any correlation within a cluster.

use crate::student_t::quantile_975;
use nalgebra::{DMatrix, DVector};

/// Rows collected before they are reduced.
const ROWS_AT_ONCE: usize = 256;

/// From so many columns on the normal equations are formed after all: their products run at ten times the speed of reflections, and a
/// model of so many numbers is not known to half of the digits. Columns are those of flights, whose noise is far above rounding.
const WIDE: usize = 40;

/// Share of a column's square that must be left beside the columns before it; less is rounding, and the column is taken for dependent.
const SMALLEST_SQUARE: f64 = 1e-13;

/// Condition number of the scaled columns beyond which the data do not determine the coefficients: half of the digits are gone.
pub(super) const LARGEST_CONDITION: f64 = 1e8;

/// Smallest share of information that may remain when one cluster is left out. A cluster that alone determines a coefficient
/// would make the interval infinite; it is made a thousand times wider instead, which stays printable.
const SMALLEST_REMAINDER: f64 = 1e-3;

/// Triangular factor of the rows `[X | y]` seen so far, the regressand being the last column.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    columns: usize,
    rows: usize,
    /// Upper triangle, `columns` square.
    triangle: DMatrix<f64>,
    /// Of a wide factor, `[X | y]ᵀ [X | y]`; the triangle follows when it is asked for.
    squares: Option<DMatrix<f64>>,
    /// Rows not yet reduced, row-major.
    pending: Vec<f64>,
}

impl Factor {
    pub(super) fn new(columns: usize) -> Self {
        let square = || DMatrix::zeros(columns, columns);
        Self { columns, rows: 0, triangle: square(), squares: (columns > WIDE).then(square), pending: Vec::new() }
    }

    /// Adds the same stretch of every column.
    pub(super) fn add(&mut self, columns: &[&[f64]]) {
        let rows = columns.iter().map(|column| column.len()).min().unwrap_or_default();
        for row in 0..rows {
            self.pending.extend(columns.iter().map(|column| column[row]));
            self.rows += 1;
            if self.pending.len() >= ROWS_AT_ONCE * self.columns {
                self.reduce();
            }
        }
    }

    /// Adds the rows behind another factor, scaled.
    pub(super) fn add_factor(&mut self, other: &DMatrix<f64>, rows: usize, scale: f64) {
        for row in other.row_iter() {
            self.pending.extend(row.iter().map(|value| value * scale));
        }
        self.rows += rows;
        if self.pending.len() >= ROWS_AT_ONCE * self.columns {
            self.reduce();
        }
    }

    /// Columns, the regressand's included.
    pub(super) fn width(&self) -> usize {
        self.columns
    }

    fn reduce(&mut self) {
        let pending = self.pending.len() / self.columns.max(1);
        if pending == 0 {
            return;
        }
        if let Some(squares) = &mut self.squares {
            let transposed = DMatrix::from_column_slice(self.columns, pending, &self.pending);
            squares.gemm(1.0, &transposed, &transposed.transpose(), 1.0);
        } else {
            let mut stacked = DMatrix::zeros(self.columns + pending, self.columns);
            stacked.rows_mut(0, self.columns).copy_from(&self.triangle);
            stacked.rows_mut(self.columns, pending).copy_from(&DMatrix::from_row_slice(pending, self.columns, &self.pending));
            self.triangle = stacked.qr().r();
        }
        self.pending.clear();
    }

    pub(super) fn finish(&mut self) -> (&DMatrix<f64>, usize) {
        self.reduce();
        if let Some(squares) = &self.squares {
            self.triangle = root(squares);
        }
        (&self.triangle, self.rows)
    }
}

/// The upper triangle R with `RᵀR` the given squares; the row of a column that depends on those before it is zero.
fn root(squares: &DMatrix<f64>) -> DMatrix<f64> {
    let size = squares.nrows();
    let mut triangle: DMatrix<f64> = DMatrix::zeros(size, size);
    for row in 0..size {
        let above: f64 = triangle.view((0, row), (row, 1)).norm_squared();
        let left = squares[(row, row)] - above;
        // What is no number must not be taken for nothing.
        if left <= SMALLEST_SQUARE * squares[(row, row)] {
            continue;
        }
        let pivot = left.sqrt();
        triangle[(row, row)] = pivot;
        for column in row + 1..size {
            let above: f64 = triangle.view((0, row), (row, 1)).dot(&triangle.view((0, column), (row, 1)));
            triangle[(row, column)] = (squares[(row, column)] - above) / pivot;
        }
    }
    triangle
}

/// A stretch of consecutive rows, one factor a channel.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    /// Flight it belongs to: neighbours are merged within a flight only.
    pub flight: usize,
    /// One a channel, each with the channel's own columns.
    pub factors: Vec<Factor>,
}

/// Coefficients that are found together: channels, and for each the coefficient behind each of its columns.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    /// Number of coefficients.
    pub coefficients: usize,
    /// Channel and the coefficient index of each column of its factor (without the regressand).
    pub channels: Vec<(usize, Vec<usize>)>,
}

/// What holds numbers near where they were: rows `weight (θ - target)` beside those of the flights, which are in units of their channel's
/// standard deviation.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    /// One over the standard deviation of the residual, for each channel there is.
    pub weights: Vec<f64>,
    /// For each coefficient of the problem, weight and target.
    pub rows: Vec<(f64, f64)>,
}

impl Hold {
    /// The rows as a factor beside those of the channels.
    pub(super) fn factor(&self) -> DMatrix<f64> {
        let size = self.rows.len();
        let mut rows = DMatrix::zeros(size, size + 1);
        for (index, &(weight, target)) in self.rows.iter().enumerate() {
            rows[(index, index)] = weight;
            rows[(index, size)] = weight * target;
        }
        rows
    }
}

/// What came out.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub values: Vec<f64>,
    pub ci95: Vec<[f64; 2]>,
    /// By how much the values are others without each cluster: what their covariances are made of.
    pub deviations: Vec<Vec<f64>>,
    pub condition_number: f64,
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Failure {
    /// The column of this coefficient is zero in every row.
    Zero(usize),
    /// These coefficients' columns are linearly dependent, to the given condition number.
    Dependent(Vec<usize>, f64),
    /// Some number behind this coefficient's column is too large to square.
    Overflow(usize),
    /// Fewer rows than coefficients, or no more.
    TooFewRows(usize),
    /// One cluster holds all that is known of this coefficient.
    OneCluster(usize),
}

/// Every coefficient's column next to each other, and the regressand, for one channel's triangle.
fn embed(triangle: &DMatrix<f64>, columns: &[usize], coefficients: usize) -> DMatrix<f64> {
    let mut wide = DMatrix::zeros(triangle.nrows(), coefficients + 1);
    for (source, &target) in columns.iter().chain(std::iter::once(&coefficients)).enumerate() {
        wide.column_mut(target).copy_from(&triangle.column(source));
    }
    wide
}

/// The triangle of all clusters of one channel, and the number of rows.
fn total(clusters: &[Cluster], channel: usize, columns: usize) -> (DMatrix<f64>, usize) {
    let mut sum = Factor::new(columns);
    for factor in clusters.iter().filter_map(|cluster| cluster.factors.get(channel)) {
        sum.add_factor(&factor.triangle, factor.rows, 1.0);
    }
    let (triangle, rows) = sum.finish();
    (triangle.clone(), rows)
}

/// Solves a problem from the clusters' factors.
///
/// Channels that share coefficients are weighted by the inverse of their residual variance (feasible generalised least squares,
/// three rounds); a channel by itself is unweighted (paper eq. 33). Intervals: estimate ± t · s, where s² is the cluster
/// jackknife variance; the clusters' length is accounted for by s² = max(V, 2 V − V_half) with V_half from clusters of half the
/// length, which cancels the first-order bias of correlation across cluster borders ("lugsail", Vats & Flegal 2022,
/// Biometrika 109:735); and t has one degree of freedom less than the number of clusters that effectively carry the
/// coefficient (Carter, Schnepel & Steigerwald 2017, Rev. Economics and Statistics 99:698).
///
/// With `hold`, its weights are taken as they are, and its rows count with those of the flights.
pub(super) fn solve(problem: &Problem, clusters: &mut [Cluster], hold: Option<&Hold>) -> Result<Solution, Failure> {
    let Step { fit, weights } = step(problem, clusters, hold)?;
    let wanted = problem.coefficients;
    let fine: Vec<Information> = clusters.iter().map(|cluster| Information::of(cluster, problem, &weights, &fit)).collect();
    let coarse = merge_neighbours(&fine);
    let changes = jackknife(&fit, &coarse);
    let (half_length, full_length) = (variances(&jackknife(&fit, &fine), wanted), variances(&changes, wanted));
    let ci95 = (0..wanted)
        .map(|index| {
            let variance = full_length[index].max(2.0 * full_length[index] - half_length[index]);
            let reach = quantile_975(fit.effective_clusters(&coarse, index) - 1.0) * variance.sqrt();
            [fit.values[index] - reach, fit.values[index] + reach]
        })
        .collect();
    let deviations = changes.iter().map(|change| change.iter().copied().collect()).collect();
    Ok(Solution { values: fit.values.iter().copied().collect(), ci95, deviations, condition_number: fit.condition_number })
}

/// An estimate without intervals, and the weights of the channels that it rests on.
pub(super) struct Step {
    pub fit: Fit,
    weights: Vec<f64>,
}

/// As [`solve`], without intervals.
pub(super) fn step(problem: &Problem, clusters: &mut [Cluster], hold: Option<&Hold>) -> Result<Step, Failure> {
    clusters.iter_mut().flat_map(|cluster| &mut cluster.factors).for_each(|factor| {
        factor.finish();
    });
    let wanted = problem.coefficients;
    let mut totals: Vec<(DMatrix<f64>, usize)> = problem
        .channels
        .iter()
        .map(|(channel, columns)| {
            let (triangle, rows) = total(clusters, *channel, columns.len() + 1);
            (embed(&triangle, columns, wanted), rows)
        })
        .collect();
    let rows: usize = totals.iter().map(|total| total.1).sum();
    if rows <= wanted {
        return Err(Failure::TooFewRows(rows));
    }

    let mut weights = vec![1.0; totals.len()];
    if let Some(hold) = hold {
        weights = problem.channels.iter().map(|(channel, _)| hold.weights[*channel]).collect();
        totals.push((hold.factor(), 0));
        weights.push(1.0);
    }
    let mut fit = Fit::new(&totals, &weights, wanted)?;
    if totals.len() > 1 && hold.is_none() {
        for _ in 0..3 {
            for (weight, (wide, rows)) in weights.iter_mut().zip(&totals) {
                let squares = residual(wide, &fit.values).norm_squared();
                let level = wide.column(wanted).norm_squared() * f64::EPSILON;
                *weight = (*rows as f64 / squares.max(level).max(f64::MIN_POSITIVE)).sqrt();
            }
            fit = Fit::new(&totals, &weights, wanted)?;
        }
    }
    Ok(Step { fit, weights })
}

/// `y − X θ` of a wide triangle: the part of the residual that the rows of the triangle carry.
pub(super) fn residual(wide: &DMatrix<f64>, values: &DVector<f64>) -> DVector<f64> {
    wide.column(values.len()) - wide.columns(0, values.len()) * values
}

/// An estimate and the triangle it came from.
pub(super) struct Fit {
    pub values: DVector<f64>,
    /// Inverse of the triangle of X: `θ = inverse Qᵀ y`.
    inverse: DMatrix<f64>,
    condition_number: f64,
}

impl Fit {
    pub(super) fn new(totals: &[(DMatrix<f64>, usize)], weights: &[f64], wanted: usize) -> Result<Self, Failure> {
        let mut stacked = Factor::new(wanted + 1);
        for ((wide, rows), weight) in totals.iter().zip(weights) {
            stacked.add_factor(wide, *rows, *weight);
        }
        let triangle = stacked.finish().0;
        let design = triangle.view((0, 0), (wanted, wanted));
        let norms: Vec<f64> = design.column_iter().map(|column| column.norm()).collect();
        // Not-a-number must not reach the iterations below. It spreads to the right, so the first column is the culprit.
        if let Some(index) = triangle.column_iter().position(|column| !column.norm_squared().is_finite()) {
            return Err(Failure::Overflow(index.min(wanted - 1)));
        }
        if let Some(index) = norms.iter().position(|norm| *norm < f64::MIN_POSITIVE / f64::EPSILON) {
            return Err(Failure::Zero(index));
        }
        let scale = DMatrix::from_diagonal(&DVector::from_iterator(wanted, norms.iter().map(|norm| 1.0 / norm)));
        let scaled = design * &scale;
        let singular = scaled.clone().svd(false, true);
        let (largest, smallest) = (singular.singular_values.max(), singular.singular_values.min());
        let condition_number = if smallest > 0.0 { largest / smallest } else { f64::INFINITY };
        let inverse = scaled.try_inverse().filter(|_| condition_number <= LARGEST_CONDITION);
        let Some(inverse) = inverse else {
            let weakest = singular.singular_values.imin();
            let direction: Vec<f64> = singular.v_t.map(|v_t| v_t.row(weakest).iter().copied().collect()).unwrap_or_default();
            let peak = direction.iter().fold(0.0_f64, |peak, part| peak.max(part.abs()));
            let involved = (0..direction.len()).filter(|&index| direction[index].abs() > 0.1 * peak).collect();
            return Err(Failure::Dependent(involved, condition_number));
        };
        let inverse = scale * inverse;
        let values = &inverse * triangle.view((0, wanted), (wanted, 1)).column(0);
        Ok(Self { values, inverse, condition_number })
    }

    /// Standard error of a coefficient if residuals were independent, of variance 1.
    pub(super) fn standard_error(&self, index: usize) -> f64 {
        self.inverse.row(index).norm()
    }

    pub(super) fn condition_number(&self) -> f64 {
        self.condition_number
    }

    /// How many equally informative clusters would carry a coefficient as evenly: 1 / Σ share².
    fn effective_clusters(&self, clusters: &[Information], index: usize) -> f64 {
        // In the orthonormal coordinates of Q, coefficient `index` is read off along this row.
        let row = self.inverse.row(index);
        let whole = row.norm_squared();
        let squares: f64 = clusters.iter().map(|cluster| ((row * &cluster.share * row.transpose())[(0, 0)] / whole).powi(2)).sum();
        if squares > 0.0 { 1.0 / squares } else { 1.0 }
    }
}

/// What one cluster knows, in the orthonormal coordinates `Q = X R⁻¹` of the whole.
#[derive(Clone)]
struct Information {
    flight: usize,
    /// `Q_bᵀ Q_b`; all clusters sum to the identity.
    share: DMatrix<f64>,
    /// `Q_bᵀ e_b`; all clusters sum to zero.
    score: DVector<f64>,
}

impl Information {
    fn of(cluster: &Cluster, problem: &Problem, weights: &[f64], fit: &Fit) -> Self {
        let wanted = problem.coefficients;
        let mut share = DMatrix::zeros(wanted, wanted);
        let mut score = DVector::zeros(wanted);
        // What holds numbers is no knowledge of the flights: its weight comes after those of the channels.
        for ((channel, columns), weight) in problem.channels.iter().zip(weights) {
            let Some(factor) = cluster.factors.get(*channel) else { continue };
            let wide = embed(&factor.triangle, columns, wanted) * *weight;
            let orthonormal = wide.columns(0, wanted) * &fit.inverse;
            share += orthonormal.transpose() * &orthonormal;
            score += orthonormal.transpose() * residual(&wide, &fit.values);
        }
        Self { flight: cluster.flight, share, score }
    }
}

/// Clusters of twice the length: pairs of neighbours of one flight.
fn merge_neighbours(fine: &[Information]) -> Vec<Information> {
    let mut merged: Vec<Information> = Vec::new();
    let mut open = false;
    for cluster in fine {
        match merged.last_mut() {
            Some(last) if open && last.flight == cluster.flight => {
                last.share += &cluster.share;
                last.score += &cluster.score;
                open = false;
            }
            _ => {
                merged.push(cluster.clone());
                open = true;
            }
        }
    }
    merged
}

/// By how much the coefficients are others without each cluster: `θ₋ᵦ − θ = −R⁻¹ (I − Q_bᵀQ_b)⁻¹ Q_bᵀ e_b`.
fn jackknife(fit: &Fit, clusters: &[Information]) -> Vec<DVector<f64>> {
    let without = |cluster: &Information| {
        let eigen = cluster.share.clone().symmetric_eigen();
        let mut along = eigen.eigenvectors.transpose() * &cluster.score;
        for (part, information) in along.iter_mut().zip(eigen.eigenvalues.iter()) {
            *part /= (1.0 - information).max(SMALLEST_REMAINDER);
        }
        &fit.inverse * (eigen.eigenvectors * along)
    };
    clusters.iter().map(without).collect()
}

/// The jackknife variance of each coefficient.
fn variances(changes: &[DVector<f64>], coefficients: usize) -> Vec<f64> {
    let count = changes.len() as f64;
    let mut variances = vec![0.0; coefficients];
    for change in changes {
        for (variance, change) in variances.iter_mut().zip(change.iter()) {
            *variance += change * change * (count - 1.0) / count;
        }
    }
    variances
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    /// Rows `[x1, x2, y]` of a wobbly plane, in clusters of unequal length, two to the first flight.
    fn rows() -> Vec<Vec<[f64; 3]>> {
        let wobble = |k: usize, a: f64| ((k as f64 * a).sin() * 43.7).fract();
        let mut next = 0;
        [300, 420, 700, 90, 511]
            .map(|length| {
                next += length;
                (next - length..next)
                    .map(|k| [wobble(k, 0.7), 0.3 + wobble(k, 1.3), 2.0 * wobble(k, 0.7) + wobble(k / 40, 2.1)])
                    .collect()
            })
            .to_vec()
    }

    fn clusters(rows: &[Vec<[f64; 3]>], flights: &[usize]) -> Vec<Cluster> {
        rows.iter()
            .zip(flights)
            .map(|(rows, &flight)| {
                let mut factor = Factor::new(3);
                let columns: Vec<Vec<f64>> = (0..3).map(|column| rows.iter().map(|row| row[column]).collect()).collect();
                // Added in pieces of a length that fits no block.
                for start in (0..rows.len()).step_by(77) {
                    let end = (start + 77).min(rows.len());
                    factor.add(&columns.iter().map(|column| &column[start..end]).collect::<Vec<_>>());
                }
                Cluster { flight, factors: vec![factor] }
            })
            .collect()
    }

    fn by_normal_equations<'a>(rows: impl Iterator<Item = &'a [f64; 3]>) -> [f64; 2] {
        let (mut a, mut b, mut c, mut d, mut e) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for [x1, x2, y] in rows {
            (a, b, c, d, e) = (a + x1 * x1, b + x1 * x2, c + x2 * x2, d + x1 * y, e + x2 * y);
        }
        let determinant = a * c - b * b;
        [(c * d - b * e) / determinant, (a * e - b * d) / determinant]
    }

    fn problem() -> Problem {
        Problem { coefficients: 2, channels: vec![(0, vec![0, 1])] }
    }

    #[test]
    fn estimate_and_jackknife_are_those_of_refitting() -> Result<(), Failure> {
        let rows = rows();
        let mut clusters = clusters(&rows, &[0, 0, 1, 2, 3]);
        let solution = solve(&problem(), &mut clusters, None)?;
        let expected = by_normal_equations(rows.iter().flatten());
        let (wide, count) = (embed(&total(&clusters, 0, 3).0, &[0, 1], 2), 2021);
        let fit = Fit::new(&[(wide, count)], &[1.0], 2)?;
        let information: Vec<Information> =
            clusters.iter().map(|cluster| Information::of(cluster, &problem(), &[1.0], &fit)).collect();
        let variances = variances(&jackknife(&fit, &information), 2);
        for index in 0..2 {
            assert!((solution.values[index] - expected[index]).abs() < Tolerance::Close.relative_f64());
            let refitted: f64 = (0..5)
                .map(|left_out| {
                    let others = rows.iter().enumerate().filter(|(cluster, _)| *cluster != left_out).flat_map(|(_, rows)| rows);
                    (by_normal_equations(others)[index] - expected[index]).powi(2) * 4.0 / 5.0
                })
                .sum();
            assert!((variances[index] - refitted).abs() < Tolerance::Close.relative_f64() * refitted, "{variances:?} {refitted}");
            assert!(fit.effective_clusters(&information, index) <= 5.0);
        }
        assert_eq!(merge_neighbours(&information).len(), 4);
        Ok(())
    }

    #[test]
    fn shared_coefficients_trust_the_quieter_channel() -> Result<(), Failure> {
        // y = 2 x exactly in one channel, y = 5 x plus a lot of noise in the other.
        let noise = |k: usize| 100.0 * (k as f64 * 12.9898).sin();
        let x: Vec<f64> = (0..4000).map(|k| (k as f64 * 0.37).cos()).collect();
        let quiet: Vec<f64> = x.iter().enumerate().map(|(k, x)| 2.0 * x + 1e-3 * noise(k)).collect();
        let loud: Vec<f64> = x.iter().enumerate().map(|(k, x)| 5.0 * x + noise(k)).collect();
        let mut clusters: Vec<Cluster> = (0..8)
            .map(|index| {
                let part = index * 500..(index + 1) * 500;
                let mut factors = vec![Factor::new(2), Factor::new(2)];
                factors[0].add(&[&x[part.clone()], &quiet[part.clone()]]);
                factors[1].add(&[&x[part.clone()], &loud[part]]);
                Cluster { flight: 0, factors }
            })
            .collect();
        let problem = Problem { coefficients: 1, channels: vec![(0, vec![0]), (1, vec![0])] };
        let found = solve(&problem, &mut clusters, None)?.values[0];
        // The loud channel's variance is 1e6 times the quiet one's, and pulls by 3 / 1e6 at most; its noise by about as much.
        assert!((found - 2.0).abs() < 1e-2, "{found}");
        Ok(())
    }

    #[test]
    fn columns_that_cannot_be_told_apart_or_squared_are_reported() {
        let case = |f: &dyn Fn(f64) -> [f64; 2]| {
            let x: Vec<f64> = (0..600).map(|k| 1.0 + (f64::from(k) * 0.1).sin()).collect();
            let columns: [Vec<f64>; 2] = [x.iter().map(|x| f(*x)[0]).collect(), x.iter().map(|x| f(*x)[1]).collect()];
            let mut factor = Factor::new(3);
            factor.add(&[&columns[0], &columns[1], &x]);
            solve(&problem(), &mut [Cluster { flight: 0, factors: vec![factor] }], None).map(|solution| solution.values)
        };
        assert_eq!(case(&|x| [x, 0.0]), Err(Failure::Zero(1)));
        assert!(matches!(case(&|x| [x, 3.0 * x]), Err(Failure::Dependent(both, _)) if both == [0, 1]));
        assert_eq!(case(&|x| [x, 1e300 * x]), Err(Failure::Overflow(1)));
        assert_eq!(case(&|x| [x, 1e-310 * x]), Err(Failure::Zero(1)));
    }
}
