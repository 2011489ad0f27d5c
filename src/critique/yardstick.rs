//! Yardsticks: predictors without physics or learning to speak of, which any model has to beat before its error means anything.
//!
//! Differences of the measured velocity say how much of the acceleration is already written in the history; ridge regression
//! on lagged rows says what a linear filter of the history reaches. Neither sees a target at prediction time. No comparison
//! here: errors and tables are made by whoever gets the [`Row`]s.

use super::Row;
use super::blocks::{BLOCK_S, Blocks};
use crate::error::{Error, Result};
use crate::flight::attitude::{cross, gravity_body};
use crate::flight::{Column, Flight, Window};
use nalgebra::{Cholesky, DMatrix};
use ndarray::{Array1, Array2};

/// v and ω, whose differences are the targets in the order of [`Column::TARGETS`].
const VELOCITIES: [Column; 6] = [Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// Folds of the cross-validation over blocks.
const FOLDS: usize = 5;

/// Decades of the penalties tried, λ a window in units of the standardised inputs: 10⁻⁸ … 10².
const PENALTY_EXPONENTS: std::ops::RangeInclusive<i32> = -8..=2;

/// Rows gathered before one matrix product adds them to the normal matrix.
const BATCH: usize = 512;

/// Causal backward difference (v_t − v_{t−1})/step of v and ω at the last row of each window: m/s², rad/s².
///
/// Its error is about step/2 times the second derivative, plus √2/step times the noise of one sample.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight or has no row before its last.
pub fn finite_difference(flights: &[Flight], windows: &[Window]) -> Result<Row> {
    let predicted = windows.iter().map(|&window| {
        let flight = flight_of(flights, window, 2)?;
        Ok(VELOCITIES.map(|column| difference(flight, column, window.last - 1, window.last)))
    });
    Ok(Row { name: "finite difference".into(), predicted: predicted.collect::<Result<_>>()? })
}

/// Centred difference (v_{t+1} − v_{t−1})/(2·step) of v and ω: zero phase, so it looks one row ahead and is no predictor.
///
/// It bounds what any differentiation of the same signals can reach. The first and last row of a flight, which have one
/// neighbour only, get the one-sided difference.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight or the flight has one sample only.
pub fn centred_difference(flights: &[Flight], windows: &[Window]) -> Result<Row> {
    let predicted = windows.iter().map(|&window| {
        let flight = flight_of(flights, window, 1)?;
        let (from, to) = (window.last.saturating_sub(1), (window.last + 1).min(flight.len() - 1));
        if from == to {
            return Err(Error::Shape {
                operation: "centred difference",
                message: format!("flight `{}` has one sample; a difference needs two", flight.name),
            });
        }
        Ok(VELOCITIES.map(|column| difference(flight, column, from, to)))
    });
    Ok(Row { name: "centred difference (not causal)".into(), predicted: predicted.collect::<Result<_>>()? })
}

fn difference(flight: &Flight, column: Column, from: usize, to: usize) -> f64 {
    let values = flight.column(column);
    (values[to] - values[from]) / (flight.step_s * (to - from) as f64)
}

/// The flight of a window, once it is sure that the window's last `rows` rows lie in it.
fn flight_of(flights: &[Flight], window: Window, rows: usize) -> Result<&Flight> {
    let flight = flights.get(window.flight).ok_or_else(|| Error::Shape {
        operation: "yardstick",
        message: format!("a window of flight {} among {} flights", window.flight, flights.len()),
    })?;
    if window.last >= flight.len() || window.last + 1 < rows {
        return Err(Error::Shape {
            operation: "yardstick",
            message: format!(
                "a history of {rows} rows that ends at row {} does not lie in flight `{}` of {} rows; \
                 leave out windows with `last` < {} or ask for fewer lags",
                window.last,
                flight.name,
                flight.len(),
                rows - 1
            ),
        });
    }
    Ok(flight)
}

/// One signal that ridge regression may see.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RidgeInput {
    /// A canonical column. A target column is refused.
    Column(Column),
    /// Gravity in body axes, R_inᵇ g (paper eqs. 3–4), m/s²; axis 0, 1, 2 is x, y, z.
    Gravity(usize),
    /// The turning of the body axes, −ω × v (paper eq. 14), m/s²; axis 0, 1, 2 is x, y, z.
    Coriolis(usize),
    /// A further column of the log, by name.
    Named(String),
}

impl RidgeInput {
    /// What the regression sees by default: body velocity, gravity in body axes, body rates, controls.
    pub fn standard() -> Vec<Self> {
        use Column::{U1, U2, U3, U4, Vx, Vy, Vz, Wx, Wy, Wz};
        let mut inputs: Vec<Self> = [Vx, Vy, Vz, Wx, Wy, Wz, U1, U2, U3, U4].map(Self::Column).into();
        inputs.extend((0..3).map(Self::Gravity));
        inputs
    }

    fn values(&self, flight: &Flight) -> Result<Vec<f64>> {
        let fault = |found: String, expected: &str| {
            Err(Error::Config {
                place: format!("ridge regression on flight `{}`", flight.name),
                field: "inputs".into(),
                found,
                expected: expected.into(),
            })
        };
        match self {
            Self::Column(column) if Column::TARGETS.contains(column) => {
                fault(format!("the target `{}`", column.name()), "states and controls: a target predicts itself")
            }
            Self::Named(name) if Column::from_name(name).is_some_and(|column| Column::TARGETS.contains(&column)) => {
                fault(format!("the target `{name}`"), "states and controls: a target predicts itself")
            }
            Self::Column(column) => Ok(flight.column(*column).to_vec()),
            Self::Named(name) => match flight.named(name) {
                Some(values) => Ok(values.to_vec()),
                None => fault(format!("`{name}`"), "a column that every flight has"),
            },
            Self::Gravity(axis) if *axis < 3 => {
                let angles = flight.column(Column::Roll).iter().zip(flight.column(Column::Pitch));
                Ok(angles.map(|(&roll, &pitch)| gravity_body(roll, pitch)[*axis]).collect())
            }
            Self::Coriolis(axis) if *axis < 3 => {
                let at = |columns: [Column; 3], row: usize| columns.map(|column| flight.column(column)[row]);
                let (v, w) = ([Column::Vx, Column::Vy, Column::Vz], [Column::Wx, Column::Wy, Column::Wz]);
                Ok((0..flight.len()).map(|row| cross(at(v, row), at(w, row))[*axis]).collect())
            }
            Self::Gravity(axis) | Self::Coriolis(axis) => fault(format!("axis {axis}"), "axis 0, 1 or 2"),
        }
    }
}

/// What ridge regression sees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RidgeOptions {
    /// Rows of history, the window's last row included.
    pub lags: usize,
    /// Signals of each row.
    pub inputs: Vec<RidgeInput>,
}

impl Default for RidgeOptions {
    /// 11 rows of the standard inputs.
    fn default() -> Self {
        Self { lags: 11, inputs: RidgeInput::standard() }
    }
}

/// Ridge regression of the six targets on the last rows of the history:
/// minimises Σ (y − b − wᵀx)² + N λ |w|² with inputs x standardised on the training windows; b is not penalised.
///
/// λ is chosen for each channel by cross-validation over 10-s blocks (Hoerl & Kennard 1970 for ridge; blocks because
/// neighbouring rows are not independent).
#[derive(Clone, Debug)]
pub struct Ridge {
    options: RidgeOptions,
    /// Mean of each input on the training windows' last rows.
    mean: Vec<f64>,
    /// 1/standard deviation of each input; 0 for an input that does not move.
    inverse_deviation: Vec<f64>,
    /// `[lags · inputs + 1, 6]`: the last row of the history first, the intercept last.
    weights: Array2<f64>,
    /// λ chosen, one a channel.
    penalty: [f64; 6],
}

impl Ridge {
    /// Fits to the targets at the last rows of the training windows.
    ///
    /// # Errors
    /// As [`Ridge::fit_to`].
    pub fn fit(flights: &[Flight], windows: &[Window], options: &RidgeOptions) -> Result<Self> {
        let targets = windows.iter().map(|&window| {
            let flight = flight_of(flights, window, options.lags)?;
            Ok(Column::TARGETS.map(|column| flight.column(column)[window.last]))
        });
        Self::fit_to(flights, windows, &targets.collect::<Result<Vec<_>>>()?, options)
    }

    /// Fits to any six values a window, for example what a model leaves over.
    ///
    /// # Errors
    /// [`Error::Shape`] if a window has fewer rows before it than `lags`, or targets and windows differ in number;
    /// [`Error::Config`] if an input is missing or is a target, or `lags` is 0; [`Error::Undetermined`] if the windows fill
    /// fewer than two 10-s blocks.
    pub fn fit_to(flights: &[Flight], windows: &[Window], targets: &[[f64; 6]], options: &RidgeOptions) -> Result<Self> {
        if options.lags == 0 || options.inputs.is_empty() {
            return Err(Error::Config {
                place: "ridge regression".into(),
                field: if options.lags == 0 { "lags" } else { "inputs" }.into(),
                found: "0".into(),
                expected: "at least 1".into(),
            });
        }
        if targets.len() != windows.len() {
            return Err(Error::Shape {
                operation: "ridge regression",
                message: format!("{} targets for {} windows", targets.len(), windows.len()),
            });
        }
        for &window in windows {
            flight_of(flights, window, options.lags)?;
        }
        let folds = folds(flights, windows)?;
        let signals = Signals::new(flights, windows, options)?;
        let (mean, inverse_deviation) = signals.moments(windows);
        let standard = signals.standardised(&mean, &inverse_deviation);

        let mut sums: Vec<Normal> = (0..FOLDS).map(|_| Normal::zero(standard.features())).collect();
        for (fold, sum) in sums.iter_mut().enumerate() {
            let members: Vec<usize> = (0..windows.len()).filter(|&index| folds[index] == fold).collect();
            for batch in members.chunks(BATCH) {
                let rows: Vec<Window> = batch.iter().map(|&index| windows[index]).collect();
                let values: Vec<[f64; 6]> = batch.iter().map(|&index| targets[index]).collect();
                sum.add(&standard.design(&rows), &Array2::from(values));
            }
        }
        sums.retain(|sum| sum.count > 0.0);
        let (weights, penalty) = solve(&sums)?;
        Ok(Self { options: options.clone(), mean, inverse_deviation, weights, penalty })
    }

    /// Predicts the targets of any windows whose history holds `lags` rows.
    ///
    /// # Errors
    /// As [`Ridge::fit_to`], for windows and inputs.
    pub fn predict(&self, flights: &[Flight], windows: &[Window]) -> Result<Row> {
        for &window in windows {
            flight_of(flights, window, self.options.lags)?;
        }
        let signals = Signals::new(flights, windows, &self.options)?.standardised(&self.mean, &self.inverse_deviation);
        let mut predicted = Vec::with_capacity(windows.len());
        for batch in windows.chunks(BATCH) {
            let values = signals.design(batch).dot(&self.weights);
            predicted.extend(values.rows().into_iter().map(|row| std::array::from_fn(|channel| row[channel])));
        }
        Ok(Row { name: format!("ridge regression, {} lags", self.options.lags), predicted })
    }

    /// λ chosen by cross-validation for each channel.
    pub fn penalty(&self) -> [f64; 6] {
        self.penalty
    }
}

/// The fold of each window: blocks in turn go to fold 0, 1, … .
fn folds(flights: &[Flight], windows: &[Window]) -> Result<Vec<usize>> {
    let blocks = Blocks::new(flights, windows);
    if blocks.len() < 2 {
        return Err(Error::Undetermined(format!(
            "ridge regression chooses its penalty by leaving out blocks of {BLOCK_S} s, and the {} training windows fill {}; \
             train on longer flights",
            windows.len(),
            blocks.len()
        )));
    }
    Ok(blocks.of_window.into_iter().map(|block| block % FOLDS).collect())
}

/// The inputs of every flight that a window needs, row-major `[sample, input]`.
struct Signals {
    flights: Vec<Vec<f64>>,
    inputs: usize,
    lags: usize,
}

impl Signals {
    fn new(flights: &[Flight], windows: &[Window], options: &RidgeOptions) -> Result<Self> {
        let mut needed = vec![false; flights.len()];
        for window in windows {
            needed[window.flight] = true;
        }
        let inputs = options.inputs.len();
        let rows = flights.iter().zip(needed).map(|(flight, needed)| {
            let mut rows = vec![0.0; if needed { flight.len() * inputs } else { 0 }];
            for (index, input) in options.inputs.iter().enumerate().filter(|_| needed) {
                for (row, value) in rows.chunks_exact_mut(inputs).zip(input.values(flight)?) {
                    row[index] = value;
                }
            }
            Ok(rows)
        });
        Ok(Self { flights: rows.collect::<Result<_>>()?, inputs, lags: options.lags })
    }

    fn row(&self, window: Window) -> &[f64] {
        &self.flights[window.flight][window.last * self.inputs..(window.last + 1) * self.inputs]
    }

    /// Mean and inverse standard deviation of each input over the windows' last rows.
    fn moments(&self, windows: &[Window]) -> (Vec<f64>, Vec<f64>) {
        let count = windows.len() as f64;
        let mut mean = vec![0.0; self.inputs];
        for &window in windows {
            mean.iter_mut().zip(self.row(window)).for_each(|(mean, value)| *mean += value / count);
        }
        let mut variance = vec![0.0; self.inputs];
        for &window in windows {
            for ((variance, value), mean) in variance.iter_mut().zip(self.row(window)).zip(&mean) {
                *variance += (value - mean).powi(2) / count;
            }
        }
        // Below the rounding of the mean a deviation is no movement.
        let inverse = |(variance, mean): (f64, &f64)| {
            let deviation = variance.sqrt();
            if deviation > f64::EPSILON.sqrt() * mean.abs() { deviation.recip() } else { 0.0 }
        };
        let inverse_deviation = variance.into_iter().zip(&mean).map(inverse).collect();
        (mean, inverse_deviation)
    }

    fn standardised(mut self, mean: &[f64], inverse_deviation: &[f64]) -> Self {
        for row in self.flights.iter_mut().flat_map(|rows| rows.chunks_exact_mut(self.inputs)) {
            for ((value, mean), inverse) in row.iter_mut().zip(mean).zip(inverse_deviation) {
                *value = (*value - mean) * inverse;
            }
        }
        self
    }

    fn features(&self) -> usize {
        self.inputs * self.lags + 1
    }

    /// `[windows, lags · inputs + 1]`: rows t, t−1, … of the history, then 1.
    fn design(&self, windows: &[Window]) -> Array2<f64> {
        let mut design = Array2::ones((windows.len(), self.features()));
        for (mut row, &window) in design.rows_mut().into_iter().zip(windows) {
            for lag in 0..self.lags {
                let past = self.row(Window { last: window.last - lag, ..window });
                for (index, value) in past.iter().enumerate() {
                    row[lag * self.inputs + index] = *value;
                }
            }
        }
        design
    }
}

/// Sums of a least-squares problem: XᵀX, XᵀY, Σy², N. They add over blocks.
#[derive(Clone)]
struct Normal {
    gram: Array2<f64>,
    moment: Array2<f64>,
    square: Array1<f64>,
    count: f64,
}

impl Normal {
    fn zero(features: usize) -> Self {
        Self {
            gram: Array2::zeros((features, features)),
            moment: Array2::zeros((features, 6)),
            square: Array1::zeros(6),
            count: 0.0,
        }
    }

    fn add(&mut self, design: &Array2<f64>, targets: &Array2<f64>) {
        self.gram += &design.t().dot(design);
        self.moment += &design.t().dot(targets);
        self.square += &targets.mapv(|value| value * value).sum_axis(ndarray::Axis(0));
        self.count += design.nrows() as f64;
    }

    fn merge(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.moment += &other.moment;
        self.square += &other.square;
        self.count += other.count;
    }

    /// Weights for one penalty, `None` if the matrix is not positive definite to working precision.
    fn weights(&self, penalty: f64) -> Option<Array2<f64>> {
        let size = self.gram.nrows();
        let mut matrix = DMatrix::from_fn(size, size, |row, column| self.gram[[row, column]]);
        for index in 0..size - 1 {
            matrix[(index, index)] += penalty * self.count;
        }
        let right = DMatrix::from_fn(size, 6, |row, column| self.moment[[row, column]]);
        let solution = Cholesky::new(matrix)?.solve(&right);
        Some(Array2::from_shape_fn((size, 6), |(row, column)| solution[(row, column)]))
    }

    /// Sum of squared errors of each channel.
    fn squared_error(&self, weights: &Array2<f64>) -> Array1<f64> {
        let cross = (weights * &self.moment).sum_axis(ndarray::Axis(0));
        let quadratic = (weights * &self.gram.dot(weights)).sum_axis(ndarray::Axis(0));
        &self.square - &(2.0 * cross) + quadratic
    }
}

/// Chooses λ of each channel by leaving out one fold at a time, then fits on all.
fn solve(folds: &[Normal]) -> Result<(Array2<f64>, [f64; 6])> {
    let features = folds.first().map_or(0, |fold| fold.gram.nrows());
    let mut best = [(f64::INFINITY, f64::NAN); 6];
    let mut total = Normal::zero(features);
    folds.iter().for_each(|fold| total.merge(fold));
    let training: Vec<Normal> = (0..folds.len())
        .map(|left_out| {
            let mut sum = Normal::zero(features);
            folds.iter().enumerate().filter(|(fold, _)| *fold != left_out).for_each(|(_, fold)| sum.merge(fold));
            sum
        })
        .collect();
    for exponent in PENALTY_EXPONENTS {
        let penalty = 10_f64.powi(exponent);
        let mut error = Some(Array1::<f64>::zeros(6));
        for (left_out, training) in folds.iter().zip(&training) {
            error = error.zip(training.weights(penalty)).map(|(sum, weights)| sum + left_out.squared_error(&weights));
        }
        for (best, error) in best.iter_mut().zip(error.into_iter().flatten()) {
            if error < best.0 {
                *best = (error, penalty);
            }
        }
    }
    let mut weights = Array2::zeros((features, 6));
    for (channel, (_, penalty)) in best.iter().enumerate() {
        let fitted = total.weights(*penalty).ok_or_else(|| {
            Error::Undetermined(
                "ridge regression: the normal equations of the training windows have no solution; look for inputs with extreme values".into(),
            )
        })?;
        weights.column_mut(channel).assign(&fitted.column(channel));
    }
    Ok((weights, best.map(|(_, penalty)| penalty)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Targets;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    /// SplitMix64 (Steele, Lea & Flood 2014), as numbers of mean 0 and variance 1.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut bits = self.0;
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((bits ^ (bits >> 31)) as f64 / u64::MAX as f64 - 0.5) * 12_f64.sqrt()
        }
    }

    /// A flight of noise whose targets are made by `target(columns, row, channel)` from the states and controls.
    fn flight(samples: usize, seed: u64, mut target: impl FnMut(&[Vec<f64>; Column::COUNT], usize, usize) -> f64) -> Flight {
        let mut noise = Noise(seed);
        let mut columns: [Vec<f64>; Column::COUNT] =
            std::array::from_fn(|column| (0..samples).map(|_| if column < 16 { noise.next() } else { 0.0 }).collect());
        for channel in 0..6 {
            let values = (0..samples).map(|row| target(&columns, row, channel)).collect();
            columns[Column::TARGETS[channel] as usize] = values;
        }
        Flight::new("noise", "noise", 0.0, 0.01, columns, Targets::Recorded).unwrap()
    }

    fn windows(flight: usize, rows: std::ops::Range<usize>) -> Vec<Window> {
        rows.map(|last| Window { flight, last }).collect()
    }

    fn close(found: &[[f64; 6]], expected: impl Fn(usize, usize) -> f64, bound: f64) -> bool {
        let errors = found.iter().enumerate().flat_map(|(row, values)| {
            values.iter().enumerate().map(move |(channel, value)| (row, channel, *value)).collect::<Vec<_>>()
        });
        errors.into_iter().all(|(row, channel, value)| (value - expected(row, channel)).abs() <= bound)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        /// Any linear law of the last three rows is found, and predicted on flights not seen.
        #[test]
        fn a_linear_law_of_the_history_is_found(seed in any::<u64>(), gain in -3.0..3.0_f64, offset in -10.0..10.0_f64) {
            let law = |columns: &[Vec<f64>; Column::COUNT], row: usize, channel: usize| {
                let u = &columns[Column::U1 as usize + channel % 4];
                let w = &columns[Column::Wx as usize];
                let at = |values: &[f64], lag: usize| row.checked_sub(lag).map_or(0.0, |row| values[row]);
                offset + gain * at(u, 2) - 0.5 * at(w, 0) + 0.25 * at(w, 1)
            };
            let flights = [flight(4000, seed, law), flight(300, seed ^ 1, law)];
            let options = RidgeOptions { lags: 3, ..RidgeOptions::default() };
            let ridge = Ridge::fit(&flights, &windows(0, 2..4000), &options).unwrap();
            let test = windows(1, 2..300);
            let row = ridge.predict(&flights, &test).unwrap();
            let truth = |index: usize, channel: usize| flights[1].column(Column::TARGETS[channel])[test[index].last];
            // The smallest penalty tried, 1e-8, shrinks by that share: sums of order 10 stay within the scheme's tolerance.
            prop_assert!(close(&row.predicted, truth, 10.0 * Tolerance::Approximate.relative_f64()));
        }
    }

    #[test]
    fn predictions_do_not_change_when_targets_and_later_rows_do() {
        let law = |columns: &[Vec<f64>; Column::COUNT], row: usize, _: usize| columns[Column::Vx as usize][row];
        let flights = [flight(3000, 5, law)];
        let ridge = Ridge::fit(&flights, &windows(0, 10..3000), &RidgeOptions::default()).unwrap();
        let cut: [Vec<f64>; Column::COUNT] = std::array::from_fn(|column| {
            let values = &flights[0].column(Column::ALL[column])[..200];
            values.iter().map(|value| if column < 16 { *value } else { 1e6 }).collect()
        });
        let other = [Flight::new("cut", "cut", 0.0, 0.01, cut, Targets::Recorded).unwrap()];
        let one = ridge.predict(&flights, &windows(0, 10..200)).unwrap();
        assert_eq!(one.predicted, ridge.predict(&other, &windows(0, 10..200)).unwrap().predicted);
        assert_eq!(
            finite_difference(&flights, &windows(0, 1..200)).unwrap().predicted,
            finite_difference(&other, &windows(0, 1..200)).unwrap().predicted
        );
    }

    #[test]
    fn noise_draws_a_larger_penalty_than_a_law() {
        let mut noise = Noise(99);
        let flights = [flight(6000, 7, |columns, row, channel| match channel {
            0 => columns[Column::Vx as usize][row],
            _ => noise.next(),
        })];
        let ridge = Ridge::fit(&flights, &windows(0, 10..6000), &RidgeOptions::default()).unwrap();
        let [law, others @ ..] = ridge.penalty();
        assert!(others.iter().all(|penalty| *penalty > 100.0 * law), "{:?}", ridge.penalty());
    }

    #[test]
    fn an_input_that_stands_still_does_no_harm() {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.3; 3000]);
        let mut noise = Noise(3);
        columns[Column::Wx as usize] = (0..3000).map(|_| noise.next()).collect();
        columns[Column::WxDot as usize] = columns[Column::Wx as usize].iter().map(|w| 2.0 - 3.0 * w).collect();
        let flights = [Flight::new("a", "a", 0.0, 0.01, columns, Targets::Recorded).unwrap()];
        let ridge = Ridge::fit(&flights, &windows(0, 10..3000), &RidgeOptions::default()).unwrap();
        let row = ridge.predict(&flights, &windows(0, 10..3000)).unwrap();
        let truth = |index: usize, channel: usize| flights[0].column(Column::TARGETS[channel])[index + 10];
        assert!(close(&row.predicted, truth, 10.0 * Tolerance::Approximate.relative_f64()));
    }

    #[test]
    fn differences_of_a_parabola_are_what_they_should_be() {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; 50]);
        columns[Column::Wz as usize] = (0..50).map(|k| (0.01 * f64::from(k)).powi(2)).collect();
        let flights = [Flight::new("a", "a", 0.0, 0.01, columns, Targets::Recorded).unwrap()];
        let test = windows(0, 1..49);
        let slope = |channel: usize, time_s: f64| if channel == 5 { 2.0 * time_s } else { 0.0 };
        let causal = finite_difference(&flights, &test).unwrap();
        let bound = Tolerance::Close.relative_f64();
        assert!(close(&causal.predicted, |row, channel| slope(channel, 0.01 * (row as f64 + 0.5)), bound));
        let centred = centred_difference(&flights, &test).unwrap();
        assert!(close(&centred.predicted, |row, channel| slope(channel, 0.01 * (row as f64 + 1.0)), bound));
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_the_reason() {
        let flights = [flight(3000, 1, |_, _, _| 0.0)];
        let refused = |windows: &[Window], options: &RidgeOptions| match Ridge::fit(&flights, windows, options) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        };
        let standard = RidgeOptions::default();
        assert!(refused(&windows(0, 9..3000), &standard).contains("history of 11 rows that ends at row 9"));
        assert!(refused(&windows(1, 10..20), &standard).contains("flight 1 among 1"));
        assert!(refused(&windows(0, 10..500), &standard).contains("longer flights"));
        assert!(refused(&[], &standard).contains("longer flights"));
        let inputs = vec![RidgeInput::Column(Column::WzDot)];
        assert!(refused(&windows(0, 10..3000), &RidgeOptions { lags: 1, inputs }).contains("the target `wz_dot`"));
        let inputs = vec![RidgeInput::Named("rpm".into())];
        assert!(refused(&windows(0, 10..3000), &RidgeOptions { lags: 1, inputs }).contains("`rpm`"));
        assert!(finite_difference(&flights, &windows(0, 0..1)).is_err());
    }
}
