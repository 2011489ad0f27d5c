//! The linear history: ridge regression of six values on the last rows of the log.
//!
//! What a linear filter of the recent past explains needs no network. It is fitted in closed form, before the network, to what
//! the physics leaves over; and, fitted to the accelerations themselves, it is the yardstick of the same name. It never sees a
//! target at prediction time. What it learns has no physical name.

use super::inputs;
use crate::blocks::{BLOCK_S, Blocks};
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel, Window};
use crate::formula::Formula;
use nalgebra::{Cholesky, DMatrix};
use ndarray::{Array1, Array2};
use serde::{Deserialize, Serialize};

/// Folds of the cross-validation over blocks.
const FOLDS: usize = 5;

/// Decades of the penalties tried, λ a window in units of the standardised inputs: 10⁻⁸ … 10².
const PENALTY_EXPONENTS: std::ops::RangeInclusive<i32> = -8..=2;

/// Most numbers that a prediction is a sum over, the constant included: with the normal matrices of all folds, half a GiB.
const MOST_FEATURES: usize = 2048;

/// Signals of each row, where nothing else is asked for.
const INPUTS: [&str; 13] = ["vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4", "g_x", "g_y", "g_z"];

/// Rows gathered before one matrix product adds them to the normal matrix.
const BATCH: usize = 512;

/// What the linear history sees.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinearConfig {
    /// Rows of history, the window's last row included. Default 11.
    pub lags: usize,
    /// Signals of each row, as formulas of the log's columns. Default: body velocity, body rates, controls, gravity in body axes.
    pub inputs: Vec<String>,
}

impl Default for LinearConfig {
    fn default() -> Self {
        Self { lags: 11, inputs: INPUTS.map(str::to_owned).into() }
    }
}

impl LinearConfig {
    /// Most lags of the default inputs.
    pub const MOST_LAGS: usize = (MOST_FEATURES - 1) / INPUTS.len();

    /// Checks that there are inputs, that none of them gives a target away, and that lags times inputs is at most 2047.
    ///
    /// # Errors
    /// [`Error::Config`] naming the field; [`Error::Formula`] pointing at what is wrong in an input.
    pub fn check(&self) -> Result<()> {
        let fault = |field: &str, found: String, expected: String| {
            Err(Error::Config { place: "linear history".into(), field: field.into(), found, expected })
        };
        let count = self.inputs.len();
        if count == 0 || count >= MOST_FEATURES {
            return fault("linear.inputs", format!("a list of {count}"), format!("1 to {}", MOST_FEATURES - 1));
        }
        let most = (MOST_FEATURES - 1) / count;
        if self.lags == 0 || self.lags > most {
            let expected = format!("1 to {most}: with {count} inputs, lags · inputs is then at most {}", MOST_FEATURES - 1);
            return fault("linear.lags", self.lags.to_string(), expected);
        }
        inputs::parse(&self.inputs).map(|_| ())
    }

    /// Numbers that a prediction is a sum over, the constant included. Few enough for its matrices once checked.
    pub fn features(&self) -> usize {
        self.lags * self.inputs.len() + 1
    }
}

/// The inputs of a flight, `[sample, input]` row-major.
pub struct Signals {
    rows: Vec<f64>,
    inputs: usize,
}

impl Signals {
    /// Evaluates the inputs on a flight.
    ///
    /// # Errors
    /// [`Error::Formula`] pointing at a name that the flight lacks, or that is a target or gives one away: it would predict itself.
    pub fn new(flight: &Flight, config: &LinearConfig) -> Result<Self> {
        let count = config.inputs.len();
        let mut rows = vec![0.0; flight.len() * count];
        for (index, text) in config.inputs.iter().enumerate() {
            let column = inputs::values(&Formula::parse(text)?, flight)?;
            rows.chunks_exact_mut(count).zip(column).for_each(|(row, value)| row[index] = value);
        }
        Ok(Self { rows, inputs: count })
    }

    /// A row; before the first one, the first one.
    pub(super) fn row(&self, sample: usize, lag: usize) -> &[f64] {
        let start = sample.saturating_sub(lag) * self.inputs;
        &self.rows[start..start + self.inputs]
    }
}

/// Ridge regression: minimises Σ (y − b − wᵀx)² + N λ |w|² over the training windows, with inputs x standardised on them; b is
/// not penalised.
///
/// λ is chosen for each channel by cross-validation over 10-s blocks (Hoerl & Kennard 1970 for ridge; blocks because
/// neighbouring rows are not independent).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Linear {
    config: LinearConfig,
    /// Mean of each input on the training windows' last rows.
    mean: Vec<f64>,
    /// 1/standard deviation of each input; 0 for an input that does not move.
    inverse_deviation: Vec<f64>,
    /// `[6, lags · inputs + 1]` row-major: the last row of the history first, the intercept last.
    weights: Vec<f64>,
    /// λ chosen, one a channel.
    penalty: PerChannel<f64>,
}

impl Linear {
    /// Fits to any six values a window.
    ///
    /// # Errors
    /// [`Error::Shape`] if a window lies outside its flight, or targets and windows differ in number; [`Error::Config`] or
    /// [`Error::Formula`] for the inputs, or for more unknowns than windows; [`Error::Undetermined`] if the windows fill fewer than two
    /// 10-s blocks.
    pub fn fit(flights: &[Flight], windows: &[Window], targets: &[PerChannel<f64>], config: &LinearConfig) -> Result<Self> {
        config.check()?;
        let inside = |window: &Window| flights.get(window.flight).is_some_and(|flight| window.last < flight.len());
        if targets.len() != windows.len() || !windows.iter().all(inside) {
            let message = format!("{} targets for {} windows, which must lie in the flights", targets.len(), windows.len());
            return Err(Error::Shape { operation: "linear history", message });
        }
        let folds = folds(flights, windows)?;
        let features = config.features();
        if features > windows.len() {
            let (count, windows) = (config.inputs.len(), windows.len());
            return Err(Error::Config {
                place: "linear history".into(),
                field: "lags".into(),
                found: format!("{} of {count} inputs, {features} unknowns for {windows} training windows", config.lags),
                expected: format!("at most {} on these flights, or more of them", (windows - 1) / count),
            });
        }
        let signals: Vec<Signals> = flights.iter().map(|flight| Signals::new(flight, config)).collect::<Result<_>>()?;
        let (mean, inverse_deviation) = moments(&signals, windows, config.inputs.len());
        let mut linear =
            Self { config: config.clone(), mean, inverse_deviation, weights: Vec::new(), penalty: PerChannel::splat(0.0) };
        let mut sums: Vec<Normal> = (0..FOLDS).map(|_| Normal::zero(features)).collect();
        let mut design = Array2::zeros((BATCH, features));
        for (fold, sum) in sums.iter_mut().enumerate() {
            let members: Vec<usize> = (0..windows.len()).filter(|&index| folds[index] == fold).collect();
            for batch in members.chunks(BATCH) {
                if batch.len() != design.nrows() {
                    design = Array2::zeros((batch.len(), features));
                }
                for (mut row, &index) in design.rows_mut().into_iter().zip(batch) {
                    let window = windows[index];
                    linear.features(|lag| signals[window.flight].row(window.last, lag), row.as_slice_mut().unwrap_or_default());
                }
                let values: Vec<[f64; Channel::COUNT]> = batch.iter().map(|&index| targets[index].into_array()).collect();
                sum.add(&design, &Array2::from(values));
            }
        }
        sums.retain(|sum| sum.count > 0.0);
        let (weights, penalty) = solve(&sums)?;
        linear.weights = weights.t().iter().copied().collect();
        linear.penalty = penalty;
        Ok(linear)
    }

    /// The standardised rows t, t−1, … of a history, then 1.
    fn features<'a>(&self, row: impl Fn(usize) -> &'a [f64], out: &mut [f64]) {
        let inputs = self.mean.len();
        for (lag, out) in out.chunks_exact_mut(inputs).take(self.config.lags).enumerate() {
            let scales = self.mean.iter().zip(&self.inverse_deviation);
            out.iter_mut().zip(row(lag)).zip(scales).for_each(|((out, value), (mean, inverse))| *out = (value - mean) * inverse);
        }
        if let Some(one) = out.last_mut() {
            *one = 1.0;
        }
    }

    /// The six values at a sample; `row(lag)` is the row of inputs so many samples ago. `values` holds [`LinearConfig::features`] numbers
    /// to work on.
    pub fn predict<'a>(&self, row: impl Fn(usize) -> &'a [f64], values: &mut [f64]) -> PerChannel<f64> {
        let features = self.config.features();
        self.features(row, values);
        PerChannel::from_fn(|channel| {
            let weights = &self.weights[channel.index() * features..][..features];
            weights.iter().zip(&*values).map(|(weight, value)| weight * value).sum()
        })
    }

    /// Of a number with these derivatives by the six values, those by the inputs, as `each(lag, input, slope)`.
    pub(super) fn pull(&self, by: &PerChannel<f64>, each: &mut dyn FnMut(usize, usize, f64)) {
        let (features, inputs) = (self.config.features(), self.mean.len());
        for place in 0..self.config.lags * inputs {
            let slope: f64 = by.pairs().map(|(channel, by)| by * self.weights[channel.index() * features + place]).sum();
            each(place / inputs, place % inputs, slope * self.inverse_deviation[place % inputs]);
        }
    }

    /// The six values at a sample of a flight. Before the flight's first row, its first row stands in.
    pub fn at(&self, signals: &Signals, sample: usize) -> PerChannel<f64> {
        self.predict(|lag| signals.row(sample, lag), &mut vec![0.0; self.config.features()])
    }

    /// What it sees.
    pub const fn config(&self) -> &LinearConfig {
        &self.config
    }

    /// λ chosen by cross-validation for each channel.
    pub const fn penalty(&self) -> PerChannel<f64> {
        self.penalty
    }

    /// Checks what came from a file.
    ///
    /// # Errors
    /// A text for a person.
    pub fn check(&self) -> Result<(), String> {
        self.config.check().map_err(|error| error.to_string())?;
        let inputs = self.config.inputs.len();
        let sizes =
            [(self.mean.len(), inputs), (self.inverse_deviation.len(), inputs), (self.weights.len(), 6 * self.config.features())];
        let mut numbers = self.mean.iter().chain(&self.inverse_deviation).chain(&self.weights);
        if sizes.iter().any(|(found, expected)| found != expected) || !numbers.all(|number| number.is_finite()) {
            return Err("the linear history's numbers do not fit its inputs and lags".into());
        }
        Ok(())
    }
}

/// The fold of each window: blocks in turn go to fold 0, 1, … .
fn folds(flights: &[Flight], windows: &[Window]) -> Result<Vec<usize>> {
    let blocks = Blocks::new(flights, windows);
    if blocks.len() < 2 {
        return Err(Error::Undetermined(format!(
            "the linear history chooses its penalty by leaving out blocks of {BLOCK_S} s, and the {} training windows fill {}; \
             train on longer flights",
            windows.len(),
            blocks.len()
        )));
    }
    Ok(blocks.of_window.into_iter().map(|block| block % FOLDS).collect())
}

/// Mean and inverse standard deviation of each input over the windows' last rows.
fn moments(signals: &[Signals], windows: &[Window], inputs: usize) -> (Vec<f64>, Vec<f64>) {
    let count = windows.len() as f64;
    let row = |window: &Window| signals[window.flight].row(window.last, 0);
    let mut mean = vec![0.0; inputs];
    for window in windows {
        mean.iter_mut().zip(row(window)).for_each(|(mean, value)| *mean += value / count);
    }
    let mut variance = vec![0.0; inputs];
    for window in windows {
        variance
            .iter_mut()
            .zip(row(window))
            .zip(&mean)
            .for_each(|((variance, value), mean)| *variance += (value - mean).powi(2) / count);
    }
    // Below the rounding of the mean a deviation is no movement.
    let inverse = |(variance, mean): (f64, &f64)| {
        let deviation = variance.sqrt();
        if deviation > f64::EPSILON.sqrt() * mean.abs() { deviation.recip() } else { 0.0 }
    };
    let inverse_deviation = variance.into_iter().zip(&mean).map(inverse).collect();
    (mean, inverse_deviation)
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
fn solve(folds: &[Normal]) -> Result<(Array2<f64>, PerChannel<f64>)> {
    let features = folds.first().map_or(0, |fold| fold.gram.nrows());
    let mut best = PerChannel::splat((f64::INFINITY, f64::NAN));
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
                "linear history: the normal equations of the training windows have no solution; look for inputs with extreme values".into(),
            )
        })?;
        weights.column_mut(channel).assign(&fitted.column(channel));
    }
    Ok((weights, best.map(|(_, penalty)| penalty)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Column, Targets};
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
    fn flight(samples: usize, seed: u64, mut target: impl FnMut(&[Vec<f64>; Column::COUNT], usize, Channel) -> f64) -> Flight {
        let mut noise = Noise(seed);
        let mut columns: [Vec<f64>; Column::COUNT] =
            std::array::from_fn(|column| (0..samples).map(|_| if column < 16 { noise.next() } else { 0.0 }).collect());
        for channel in Channel::ALL {
            let values = (0..samples).map(|row| target(&columns, row, channel)).collect();
            columns[channel.column() as usize] = values;
        }
        Flight::new("noise", "noise", 0.0, 0.01, columns, Targets::Recorded).unwrap()
    }

    fn fitted(flights: &[Flight], windows: &[Window], config: &LinearConfig) -> Result<Linear> {
        let target = |window: &Window| PerChannel::from_fn(|channel| flights[window.flight].column(channel.column())[window.last]);
        Linear::fit(flights, windows, &windows.iter().map(target).collect::<Vec<_>>(), config)
    }

    fn predicted(linear: &Linear, flights: &[Flight], windows: &[Window]) -> Vec<PerChannel<f64>> {
        let signals: Vec<Signals> = flights.iter().map(|flight| Signals::new(flight, linear.config()).unwrap()).collect();
        windows.iter().map(|window| linear.at(&signals[window.flight], window.last)).collect()
    }

    fn windows(flight: usize, rows: std::ops::Range<usize>) -> Vec<Window> {
        rows.map(|last| Window { flight, last }).collect()
    }

    fn close(found: &[PerChannel<f64>], expected: impl Fn(usize, Channel) -> f64, bound: f64) -> bool {
        let errors = found
            .iter()
            .enumerate()
            .flat_map(|(row, values)| values.pairs().map(move |(channel, value)| (row, channel, *value)).collect::<Vec<_>>());
        errors.into_iter().all(|(row, channel, value)| (value - expected(row, channel)).abs() <= bound)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        /// Any linear law of the last three rows is found, and predicted on flights not seen.
        #[test]
        fn a_linear_law_of_the_history_is_found(seed in any::<u64>(), gain in -3.0..3.0_f64, offset in -10.0..10.0_f64) {
            let law = |columns: &[Vec<f64>; Column::COUNT], row: usize, channel: Channel| {
                let u = &columns[Column::U1 as usize + channel.index() % 4];
                let w = &columns[Column::Wx as usize];
                let at = |values: &[f64], lag: usize| row.checked_sub(lag).map_or(0.0, |row| values[row]);
                offset + gain * at(u, 2) - 0.5 * at(w, 0) + 0.25 * at(w, 1)
            };
            let flights = [flight(4000, seed, law), flight(300, seed ^ 1, law)];
            let config = LinearConfig { lags: 3, ..LinearConfig::default() };
            let ridge = fitted(&flights, &windows(0, 2..4000), &config).unwrap();
            let test = windows(1, 2..300);
            let found = predicted(&ridge, &flights, &test);
            let truth = |index: usize, channel: Channel| flights[1].column(channel.column())[test[index].last];
            // The smallest penalty tried, 1e-8, shrinks by that share: sums of order 10 stay within the scheme's tolerance.
            prop_assert!(close(&found, truth, 10.0 * Tolerance::Approximate.relative_f64()));
        }
    }

    #[test]
    fn predictions_do_not_change_when_targets_and_later_rows_do() {
        let law = |columns: &[Vec<f64>; Column::COUNT], row: usize, _: Channel| columns[Column::Vx as usize][row];
        let flights = [flight(3000, 5, law)];
        let ridge = fitted(&flights, &windows(0, 10..3000), &LinearConfig::default()).unwrap();
        let cut: [Vec<f64>; Column::COUNT] = std::array::from_fn(|column| {
            let values = &flights[0].column(Column::ALL[column])[..200];
            values.iter().map(|value| if column < 16 { *value } else { 1e6 }).collect()
        });
        let other = [Flight::new("cut", "cut", 0.0, 0.01, cut, Targets::Recorded).unwrap()];
        let test = windows(0, 10..200);
        assert_eq!(predicted(&ridge, &flights, &test), predicted(&ridge, &other, &test));
    }

    #[test]
    fn noise_draws_a_larger_penalty_than_a_law() {
        let mut noise = Noise(99);
        let flights = [flight(6000, 7, |columns, row, channel| match channel {
            Channel::VxDot => columns[Column::Vx as usize][row],
            _ => noise.next(),
        })];
        let ridge = fitted(&flights, &windows(0, 10..6000), &LinearConfig::default()).unwrap();
        let [law, others @ ..] = ridge.penalty().into_array();
        assert!(others.iter().all(|penalty| *penalty > 100.0 * law), "{:?}", ridge.penalty());
    }

    #[test]
    fn numbers_of_a_file_that_do_not_fit_are_refused_before_they_are_multiplied() {
        let linear = |lags: usize, weights: usize| Linear {
            config: LinearConfig { lags, inputs: vec!["vx".into(); 4] },
            mean: vec![0.0; 4],
            inverse_deviation: vec![1.0; 4],
            weights: vec![0.0; weights],
            penalty: PerChannel::splat(0.0),
        };
        assert_eq!(linear(2, 54).check(), Ok(()));
        assert!(linear(2, 53).check().is_err_and(|message| message.contains("do not fit")));
        // 4 · (2^62 + 1) + 1 wraps to 5: thirty weights would fit.
        for (lags, weights) in [(1 << 63, 6), ((1 << 62) + 1, 30)] {
            assert!(linear(lags, weights).check().is_err_and(|message| message.contains("linear.lags")), "{lags}");
        }
    }

    #[test]
    fn an_input_that_stands_still_does_no_harm() {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.3; 3000]);
        let mut noise = Noise(3);
        columns[Column::Wx as usize] = (0..3000).map(|_| noise.next()).collect();
        columns[Column::WxDot as usize] = columns[Column::Wx as usize].iter().map(|w| 2.0 - 3.0 * w).collect();
        let flights = [Flight::new("a", "a", 0.0, 0.01, columns, Targets::Recorded).unwrap()];
        let ridge = fitted(&flights, &windows(0, 10..3000), &LinearConfig::default()).unwrap();
        let found = predicted(&ridge, &flights, &windows(0, 10..3000));
        let truth = |index: usize, channel: Channel| flights[0].column(channel.column())[index + 10];
        assert!(close(&found, truth, 10.0 * Tolerance::Approximate.relative_f64()));
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_the_reason() {
        let flights = [flight(3000, 1, |_, _, _| 0.0)];
        let refused = |windows: &[Window], config: &LinearConfig| {
            fitted(&flights, windows, config).map_err(|error| error.to_string()).err().unwrap_or_default()
        };
        let standard = LinearConfig::default();
        assert!(refused(&windows(0, 10..500), &standard).contains("longer flights"));
        assert!(refused(&[], &standard).contains("longer flights"));
        for lags in [0, LinearConfig::MOST_LAGS + 1, 1 << 62, (1 << 62) + 1, 1 << 63, usize::MAX] {
            let message = refused(&windows(0, 10..3000), &LinearConfig { lags, ..standard.clone() });
            assert!(message.contains(&format!("`linear.lags` is {lags}, expected 1 to 157")), "{message}");
        }
        let most = LinearConfig { lags: LinearConfig::MOST_LAGS, ..standard.clone() };
        assert!(most.check().is_ok());
        let message = refused(&windows(0, 1000..3000), &most);
        assert!(message.contains("2042 unknowns for 2000 training windows, expected at most 153"), "{message}");
        assert!(refused(&windows(0, 10..3000), &LinearConfig { inputs: vec![], ..standard }).contains("linear.inputs"));
        let of = |name: &str| LinearConfig { lags: 1, inputs: vec![name.into()] };
        assert!(refused(&windows(0, 10..3000), &of("rpm")).contains("`rpm`"));
    }
}
