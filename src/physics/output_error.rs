//! Calibration by output error: numbers with which the model, integrated forward from measured states, leads to where the aircraft went.
//!
//! Equation error ([`super::calibrate`]) asks of each sample what accelerates it. Where a loop is closed around an unstable aircraft, or inputs are
//! noisy, its numbers can be far from those that predict: here the error after steps 1 … H of many short rollouts is made small (multiple shooting;
//! Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., ch. 4 and 9). Gauss-Newton with Levenberg's damping, derivatives by finite differences
//! of whole rollouts. How a rollout is integrated is in `rollout`.

use super::calibrate::{parameter_bounds, usual_size};
use super::calibration::{Estimate, estimate};
use super::correlation::Correlation;
use super::model::Model;
use super::rollout::{HUBER, Measure, Rollout, size, starts};
use crate::blocks::Blocks;
use crate::error::{Error, Result};
use crate::flight::{Flight, Span, Window};
use crate::student_t::quantile_975;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::collections::BTreeMap;

/// Most rollouts from which numbers are fitted; of more starts every other, every third … is taken.
const MOST_STARTS: usize = 2000;
/// Weight that holds each number to where it starts, in units of its usual size: what no rollout shows stays.
const PRIOR: f64 = 1e-7;
/// Finite differences are taken over this share of a number, or of its usual size.
const DIFFERENCE: f64 = 1e-5;
/// Damping at first, and its change with each step that succeeds or fails (Levenberg 1944, Marquardt 1963).
const DAMPING: f64 = 1e-2;
const DAMPING_FACTOR: f64 = 5.0;
const LARGEST_DAMPING: f64 = 1e8;
/// Steps of Gauss and Newton at most …
const MOST_ROUNDS: usize = 30;
/// … and the relative fall of the cost below which it is enough.
const SETTLED: f64 = 1e-5;

/// What a fit to rollouts found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct OutputError {
    /// The numbers, in the order of the model.
    pub coefficients: Vec<Estimate>,
    /// Steps of a rollout.
    pub horizon: usize,
    /// Rollouts.
    pub starts: usize,
    /// Blocks of ten seconds that they start in, on which the intervals rest.
    pub blocks: usize,
    /// Steps of Gauss and Newton that were taken.
    pub rounds: usize,
    /// Whether a further step would bring less than a hundred-thousandth.
    pub has_settled: bool,
    /// Mean errors of position, velocity, attitude and rates over the judged steps, in those of the model that it began with with its rates held: before …
    pub before: [f64; 4],
    /// … and after. Classes of manoeuvres count alike.
    pub after: [f64; 4],
}

/// Fits the open numbers of a model, those of single flights apart, to rollouts of `horizon` steps in `spans`.
///
/// The error of a rollout after step k is, for each of position, velocity (north-east-down), attitude (rotation vector) and rates, a vector e; the
/// cost is the mean over rollouts of Σ w ρ(|e| / s), where s is the mean error of the same model with its rates held, by class of manoeuvre, step and
/// quantity, ρ Huber's function and w 1, 1, 3, 3. Classes count alike. Intervals are sandwiches over blocks of ten seconds (Liang & Zeger 1986).
/// `progress` is told the step that begins, of so many at most, and may end the fit by saying `false`: the numbers are then the best so far.
///
/// ```
/// use phyture::physics::{Model, output_error};
/// # fn fit(model: &Model, flights: &[phyture::flight::Flight], spans: &[phyture::flight::Span]) -> phyture::Result<()> {
/// let (refined, found) = output_error(model, flights, spans, 50, &mut |_, _| true)?;
/// println!("{}: {found}", refined.name);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Undetermined`] where no rollout fits into the spans, nothing is open, or the rollouts do not determine the numbers; as
/// [`Rollout::new`].
pub fn output_error(
    model: &Model,
    flights: &[Flight],
    spans: &[Span],
    horizon: usize,
    progress: &mut dyn FnMut(usize, usize) -> bool,
) -> Result<(Model, OutputError)> {
    let problem = Problem::new(model, flights, spans, horizon)?;
    let mut at = problem.own_values();
    let begun = at.clone();
    let mut errors = problem.errors(&at)?;
    let before = problem.measure.means(&errors);
    let mut cost = problem.cost(&errors, &at, &begun);
    let (mut damping, mut rounds, mut has_settled) = (DAMPING, 0, false);
    let mut slopes = problem.slopes(&at, &errors)?;
    while rounds < MOST_ROUNDS && !has_settled && progress(rounds, MOST_ROUNDS) {
        rounds += 1;
        let normal = problem.normal(&errors, &slopes, &at, &begun);
        let step = loop {
            let next = problem.bounded(&normal.step(damping, &problem.sizes)?, &at);
            let of_next = problem.errors(&next)?;
            let cost_there = problem.cost(&of_next, &next, &begun);
            if cost_there <= cost {
                break Some((next, of_next, cost_there));
            }
            damping *= DAMPING_FACTOR;
            if damping > LARGEST_DAMPING {
                break None;
            }
        };
        let Some((next, of_next, cost_there)) = step else {
            has_settled = true;
            break;
        };
        has_settled = cost - cost_there <= SETTLED * cost;
        (at, errors, cost) = (next, of_next, cost_there);
        damping = (damping / DAMPING_FACTOR).max(1e-9);
        slopes = problem.slopes(&at, &errors)?;
    }
    problem.finish(&Fit { at, errors, slopes, before, rounds, has_settled }, &begun)
}

/// Where a fit ended.
struct Fit {
    at: Vec<f64>,
    errors: Vec<f64>,
    slopes: Vec<Vec<f64>>,
    before: [f64; 4],
    rounds: usize,
    has_settled: bool,
}

/// Rollouts, and what they are measured by.
struct Problem<'a> {
    model: &'a Model,
    rollout: Rollout<'a>,
    /// Places in [`Rollout::numbers`] of the numbers that are fitted.
    fitted: Vec<usize>,
    /// About how large each of them is.
    sizes: Vec<f64>,
    measure: Measure,
    blocks: Blocks,
}

impl<'a> Problem<'a> {
    fn new(model: &'a Model, flights: &'a [Flight], spans: &[Span], horizon: usize) -> Result<Self> {
        let rollout = Rollout::new(model, flights, horizon)?;
        let is_open = |&(effect, number): &(usize, usize)| {
            model.effects[effect].number(number).is_some_and(|number| number.by_flight.is_none())
        };
        let fitted: Vec<usize> = (0..rollout.numbers().len()).filter(|&place| is_open(&rollout.numbers()[place])).collect();
        if fitted.is_empty() {
            return Err(Error::Undetermined("the model has no number that rollouts could be fitted with".into()));
        }
        // As many as there are rollouts end to end, and as many again between them.
        let stride = (horizon / 2).max(1);
        let all = starts(spans, 1, horizon, stride);
        let starts: Vec<Window> = all.iter().copied().step_by(all.len().div_ceil(MOST_STARTS).max(1)).collect();
        if starts.is_empty() {
            return Err(Error::Undetermined(format!(
                "no run of training samples holds a rollout of {horizon} steps; take a shorter horizon or longer flights"
            )));
        }
        Ok(Self {
            blocks: Blocks::new(flights, &starts),
            sizes: fitted.iter().map(|&place| usual_size(model, rollout.numbers()[place])).collect(),
            measure: Measure::new(model, flights, starts, horizon)?,
            model,
            rollout,
            fitted,
        })
    }

    fn own_values(&self) -> Vec<f64> {
        self.fitted.iter().map(|&place| self.rollout.own(place, 0)).collect()
    }

    /// Errors in units of the usual ones, with some values of the numbers.
    fn errors(&self, values: &[f64]) -> Result<Vec<f64>> {
        let place: BTreeMap<usize, f64> = self.fitted.iter().copied().zip(values.iter().copied()).collect();
        let number = |number: usize, flight: usize| place.get(&number).copied().unwrap_or_else(|| self.rollout.own(number, flight));
        let batches = self.rollout.roll(self.measure.starts(), Some(&number), &|rolled| self.measure.of_batch(rolled))?;
        let mut errors: Vec<f64> = batches.into_iter().flatten().collect();
        self.measure.scale(&mut errors);
        Ok(errors)
    }

    /// Derivatives of the errors by the numbers.
    fn slopes(&self, at: &[f64], errors: &[f64]) -> Result<Vec<Vec<f64>>> {
        let of = |number: usize| {
            let mut moved = at.to_vec();
            let by = DIFFERENCE * at[number].abs().max(self.sizes[number]);
            moved[number] += by;
            if self.bounds(number).is_some_and(|[_, high]| moved[number] > high) {
                moved[number] = at[number] - by;
            }
            let by = moved[number] - at[number];
            let mut slope = self.errors(&moved)?;
            slope.iter_mut().zip(errors).for_each(|(moved, error)| *moved = (*moved - error) / by);
            Ok(slope)
        };
        (0..at.len()).map(of).collect()
    }

    fn bounds(&self, number: usize) -> Option<[f64; 2]> {
        parameter_bounds(self.model, self.rollout.numbers()[self.fitted[number]])
    }

    /// A step from here that leaves no parameter beyond its bounds.
    fn bounded(&self, step: &DVector<f64>, at: &[f64]) -> Vec<f64> {
        let moved = |number: usize| {
            let value = at[number] + step[number];
            self.bounds(number).map_or(value, |[low, high]| value.clamp(low, high))
        };
        (0..at.len()).map(moved).collect()
    }

    fn cost(&self, errors: &[f64], at: &[f64], begun: &[f64]) -> f64 {
        let away = at.iter().zip(begun).zip(&self.sizes).map(|((at, begun), size)| ((at - begun) / size).powi(2));
        self.measure.cost(errors) + 0.5 * PRIOR * away.sum::<f64>()
    }

    fn normal(&self, errors: &[f64], slopes: &[Vec<f64>], at: &[f64], begun: &[f64]) -> Normal {
        let count = at.len();
        let mut normal = Normal {
            matrix: DMatrix::zeros(count, count),
            curvature: DMatrix::zeros(count, count),
            scores: vec![DVector::zeros(count); self.blocks.len()],
            gradient: DVector::zeros(count),
        };
        let mut along = vec![0.0; count];
        for (vector, ((start, weight), error)) in self.measure.vectors().zip(errors.chunks(3)).enumerate() {
            let length = size(error);
            let weight = weight / length.max(HUBER);
            let place = 3 * vector..3 * vector + 3;
            let slope = |number: usize| &slopes[number][place.clone()];
            let score = &mut normal.scores[self.blocks.of_window[start]];
            for number in 0..count {
                along[number] = product(slope(number), error);
                score[number] -= weight * along[number];
            }
            // The size of a vector does not curve along it.
            let taken = if length > HUBER { weight / (length * length) } else { 0.0 };
            for row in 0..count {
                for column in 0..=row {
                    let both = weight * product(slope(row), slope(column));
                    normal.matrix[(row, column)] += both;
                    normal.curvature[(row, column)] += both - taken * along[row] * along[column];
                }
            }
        }
        normal.scores.iter().for_each(|score| normal.gradient += score);
        for number in 0..count {
            let hold = PRIOR / self.sizes[number].powi(2);
            normal.gradient[number] -= hold * (at[number] - begun[number]);
            normal.matrix[(number, number)] += hold;
            normal.curvature[(number, number)] += hold;
        }
        normal.matrix.fill_upper_triangle_with_lower_triangle();
        normal.curvature.fill_upper_triangle_with_lower_triangle();
        normal
    }

    /// The model with the numbers and their intervals, and what is to be said.
    fn finish(&self, fit: &Fit, begun: &[f64]) -> Result<(Model, OutputError)> {
        let normal = self.normal(&fit.errors, &fit.slopes, &fit.at, begun);
        let deviations = normal.deviations()?;
        let blocks = self.blocks.len();
        let quantile = quantile_975((blocks - 1).max(1) as f64);
        let mut found = self.model.clone();
        let numbers: Vec<(usize, usize)> = self.fitted.iter().map(|&place| self.rollout.numbers()[place]).collect();
        for (place, &(effect, number)) in numbers.iter().enumerate() {
            let error = deviations.iter().map(|world| world[place] * world[place]).sum::<f64>().sqrt();
            let value = fit.at[place];
            let on_bound = self.bounds(place).is_some_and(|[low, high]| value <= low || value >= high);
            let interval = (blocks > 1 && !on_bound).then_some([value - quantile * error, value + quantile * error]);
            let (own, ci95) = found.effects[effect].number_mut(number).expect("a number of the model that was put together");
            (*own, *ci95) = (value, interval);
        }
        let label = |&(effect, index): &(usize, usize)| {
            let number = self.model.effects[effect].number(index).expect("a number of the model that was put together");
            Correlation::label(&self.model.effects[effect], &number.name)
        };
        found.correlations = Correlation::of_deviations(numbers.iter().map(label).collect(), &deviations).into_iter().collect();
        let mut in_order = numbers;
        in_order.sort_unstable();
        let result = OutputError {
            coefficients: in_order.into_iter().filter_map(|(effect, number)| estimate(&found, effect, number)).collect(),
            horizon: self.rollout.horizon(),
            starts: self.measure.starts().len(),
            blocks,
            rounds: fit.rounds,
            has_settled: fit.has_settled,
            before: fit.before,
            after: self.measure.means(&fit.errors),
        };
        Ok((found, result))
    }
}

/// Normal equations of one step.
struct Normal {
    /// Of Gauss, Newton and weights that are those of the moment.
    matrix: DMatrix<f64>,
    /// Of the cost itself, where errors are linear in the numbers.
    curvature: DMatrix<f64>,
    /// Minus the gradient of the errors' cost, by block.
    scores: Vec<DVector<f64>>,
    /// Minus the gradient of the cost.
    gradient: DVector<f64>,
}

impl Normal {
    fn step(&self, damping: f64, sizes: &[f64]) -> Result<DVector<f64>> {
        let mut damped = self.matrix.clone();
        for (number, size) in sizes.iter().enumerate() {
            damped[(number, number)] += damping * self.matrix[(number, number)].max(PRIOR / (size * size));
        }
        Ok(solvable(damped)?.solve(&self.gradient))
    }

    /// How far the numbers move with each block, so that the sum of squares is the variance.
    fn deviations(&self) -> Result<Vec<Vec<f64>>> {
        let count = self.scores.len() as f64;
        let factor = (count / (count - 1.0).max(1.0)).sqrt();
        let solve = solvable(self.curvature.clone())?;
        Ok(self.scores.iter().map(|score| (solve.solve(score) * factor).iter().copied().collect()).collect())
    }
}

fn solvable(matrix: DMatrix<f64>) -> Result<Cholesky<f64, nalgebra::Dyn>> {
    Cholesky::new(matrix).ok_or_else(|| {
        Error::Undetermined(
            "rollouts do not determine the numbers: their equations have no solution; leave out an effect that does nothing".into(),
        )
    })
}

impl std::fmt::Display for OutputError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<20} {:<8} {:>12}   {:<27} unit", "effect", "name", "value", "95 % interval")?;
        for estimate in &self.coefficients {
            let Estimate { effect, name, value, ci95, unit, .. } = estimate;
            let interval = ci95.map(|[low, high]| format!("[{low:>11.5}, {high:>11.5}]")).unwrap_or_default();
            writeln!(f, "{effect:<20} {name:<8} {value:>12.5}   {interval:<27} {unit}")?;
        }
        let [p, v, r, w] = std::array::from_fn(|group| format!("{:.2} -> {:.2}", self.before[group], self.after[group]));
        writeln!(
            f,
            "errors over {} steps, in those with rates held: position {p}, velocity {v}, attitude {r}, rates {w}",
            self.horizon
        )?;
        let settled = if self.has_settled { "" } else { "; NOT SETTLED" };
        write!(f, "{} rollouts in {} blocks of 10 s, {} steps of Gauss and Newton{settled}", self.starts, self.blocks, self.rounds)
    }
}

fn product(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::attitude::{quaternion_to_euler, quaternion_to_rotation, rotate_back};
    use crate::flight::{Column, Targets};
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.02;
    const SAMPLES: usize = 700;

    fn truth() -> Model {
        let mut model = Model::paper("small", 0.05, [1.7e-5, 1.7e-5, 2.9e-5], 0.03);
        let numbers: [(&str, &[f64]); 6] = [
            ("linear_drag", &[-0.35, -0.3, -0.45]),
            ("collective_thrust", &[-20.0]),
            ("vertical_bias", &[0.1]),
            ("rate_damping", &[-4.0, -4.5, -3.0]),
            ("control_moment", &[30.0, 25.0, 8.0]),
            ("moment_bias", &[0.2, -0.1, 0.05]),
        ];
        for (kind, values) in numbers {
            let effect = model.effects.iter_mut().find(|effect| effect.kind == kind).expect("an effect of the baseline");
            effect.coefficients.iter_mut().zip(values).for_each(|(coefficient, value)| coefficient.value = *value);
        }
        model
    }

    /// A flight that obeys a model: sticks of a few sines, and where they lead.
    fn flown(model: &Model, seed: u64, name: &str) -> Result<Flight> {
        let draws = Stream::new(seed, 1, 2, 3);
        let stick = |which: usize, sample: usize| {
            let wave = |wave: usize| {
                let (pace, phase) =
                    (draws.uniform(10 * which as u64 + wave as u64), draws.uniform(40 + 10 * which as u64 + wave as u64));
                ((1.0 + 6.0 * pace) * STEP_S * sample as f64 + 6.0 * phase).sin()
            };
            let waves = wave(0) + wave(1) + wave(2);
            if which == 3 { 0.5 + 0.12 * waves } else { 0.03 * waves }
        };
        let blank = Column::ALL.map(|column| match column {
            Column::U1 | Column::U2 | Column::U3 | Column::U4 => {
                (0..SAMPLES).map(|sample| stick(column as usize - Column::U1 as usize, sample)).collect()
            }
            _ => vec![0.0; SAMPLES],
        });
        let sticks = [Flight::new(name, "flown", 0.0, STEP_S, blank.clone(), Targets::Recorded)?];
        let rollout = Rollout::new(model, &sticks, SAMPLES - 2)?;
        let (states, _) = rollout.trajectories(&rollout.starts(SAMPLES)[..1], None)?.remove(0);
        let mut columns = blank;
        for (sample, state) in std::iter::once(&states[0]).chain(&states).enumerate() {
            let [roll, pitch, yaw] = quaternion_to_euler(state.attitude);
            let [vx, vy, vz] = rotate_back(&quaternion_to_rotation(state.attitude), state.velocity);
            let [x, y, z] = state.position;
            let [wx, wy, wz] = state.rates;
            let values = [x, y, z, roll, pitch, yaw, vx, vy, vz, wx, wy, wz];
            let names = [
                Column::X,
                Column::Y,
                Column::Z,
                Column::Roll,
                Column::Pitch,
                Column::Yaw,
                Column::Vx,
                Column::Vy,
                Column::Vz,
                Column::Wx,
                Column::Wy,
                Column::Wz,
            ];
            names.into_iter().zip(values).for_each(|(column, value)| columns[column as usize][sample] = value);
        }
        Flight::new(name, "flown", 0.0, STEP_S, columns, Targets::Recorded)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 6, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn numbers_that_are_a_third_off_are_found_again(seed in any::<u64>()) {
            let truth = truth();
            let flights = [flown(&truth, seed, "a")?, flown(&truth, seed.wrapping_add(1), "b")?];
            // Where the first sample was repeated nothing obeys.
            let spans: Vec<Span> = (0..2).map(|flight| Span { flight, start: 1, end: SAMPLES }).collect();
            let mut off = truth.clone();
            let draws = Stream::new(seed, 9, 9, 9);
            let numbers = off.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
            for (index, coefficient) in numbers.enumerate() {
                coefficient.value *= 1.0 + 0.3 * (2.0 * draws.uniform(index as u64) - 1.0);
            }
            let (found, result) = output_error(&off, &flights, &spans, 25, &mut |_, _| true)?;
            prop_assert!(result.after.iter().zip(result.before).all(|(after, before)| *after < 0.01 * before), "{result}");
            for (found, truth) in found.effects.iter().zip(&truth.effects) {
                for (found, truth) in found.coefficients.iter().zip(&truth.coefficients) {
                    // The prior holds a little.
                    let apart = (found.value - truth.value).abs();
                    prop_assert!(apart < 0.02 * truth.value.abs().max(0.1), "{}: {} for {}\n{result}", truth.name, found.value, truth.value);
                }
            }
        }
    }

    #[test]
    fn a_horizon_beyond_all_spans_and_a_model_without_numbers_are_refused() -> Result<()> {
        let flights = [flown(&truth(), 1, "a")?];
        let spans = [Span { flight: 0, start: 1, end: 20 }];
        let refused = output_error(&truth(), &flights, &spans, 50, &mut |_, _| true).map_err(|error| error.to_string());
        assert!(refused.is_err_and(|text| text.contains("50 steps")));
        let bare = Model { effects: Vec::new(), ..truth() };
        let refused = output_error(&bare, &flights, &[Span { flight: 0, start: 1, end: SAMPLES }], 50, &mut |_, _| true);
        assert!(refused.is_err_and(|error| error.to_string().contains("no number")));
        Ok(())
    }
}
