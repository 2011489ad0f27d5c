//! Calibration: the numbers of a model's enabled effects by least squares on recorded flights (paper eq. 33), with units,
//! 95 % intervals and a condition number; and a refusal that names the reason where the data do not determine them.
//!
//! Which samples count is in `rows`, what stands in which column in `layout`, the algebra in `least_squares`, coefficients that belong to a
//! flight in `by_flight`, and what came of it in `calibration`.

use super::by_flight;
use super::calibration::{Calibration, SETTLED, estimate};
use super::catalogue;
use super::columns::{Columns, Wanted};
use super::compose::Free;
use super::correlation::Correlation;
use super::effect::Effect;
use super::evaluate::{composed_for, standard_names};
use super::layout::Layout;
use super::least_squares::{Cluster, Failure, Hold, Problem, Step, residual, solve, step};
use super::model::Model;
use super::rows::Rows;
use super::signal::{Stage, signal_named};
use super::weights::Weights;
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::formula::Formula;
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Passes over the flights, at most; a model of twenty effects takes about ten.
const MOST_ROUNDS: usize = 40;

/// A standard error counts as at least this share of the number: where the flights know it to the last digit, that digit does not matter.
const SMALLEST_ERROR: f64 = 1e-7;

/// Weight at first of what holds the numbers where they are, in independent samples that would know each to its usual size; and the
/// factor by which it changes with each step that succeeds or fails (Levenberg 1944, Marquardt 1963). In units of the usual sizes, not of
/// the columns: a number that the flights hardly know then moves no further than it may.
const DAMPING: f64 = 1.0;
const DAMPING_FACTOR: f64 = 10.0;
const LARGEST_DAMPING: f64 = 1e12;

/// Weight of what holds a number on a value, in units of its usual size: beyond anything that flights say.
const HELD: f64 = 1e9;

/// Share of its usual size at which a coefficient starts whose effect has shape parameters: at 0 these do nothing, and have no slope.
const START: f64 = 0.1;

/// Fits the numbers of the enabled effects to the measured accelerations in `spans` and returns the model with the values and
/// intervals set: coefficients, and parameters that are not known beforehand (time constants, shapes).
///
/// Gauss-Newton: near its numbers the model is the sum of its columns, and each step is the least squares of these. A model that is linear in
/// its numbers takes one step. The regressand is the measured acceleration minus what has no number. Every channel is fitted by itself in
/// physical units, unweighted; channels that share a number are fitted together, weighted by residual variance. Steps are damped
/// as far as they have to be for the likelihood to rise. Overlapping spans count once. Hidden state (lags, delays) runs from the start of
/// each flight.
///
/// If a coefficient of the baseline is still zero, the baseline is fitted first by itself: what scales with a thrust of zero vanishes. A
/// parameter stays within its bounds; one whose effect is zero, or that is on a bound, is left where it is, without an interval. Coefficients of
/// a flight (wind, bias) are estimated with the others at once, with a prior from the catalogue; a flight outside the spans gets
/// their mean, and the intervals of the others hold given them.
///
/// # Errors
/// [`Error::Undetermined`] naming the numbers and why the data do not determine them; otherwise as [`Model::predict`].
///
/// # Examples
/// ```
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// # #[cfg(feature = "sim")]
/// # fn main() -> phyture::Result<()> {
/// use phyture::flight::split::Split;
/// use phyture::physics::{Model, calibrate};
/// use phyture::sim::{INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
///
/// let set = simulate(&Simulation { minutes: 6.0, ..Simulation::baseline() })?;
/// let model = Model::paper("helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
/// let (model, calibration) = calibrate(&model, &set.flights, &Split::for_search(&set.flights, 1).training)?;
/// for estimate in &calibration.coefficients {
///     let [low, high] = estimate.ci95.expect("six minutes hold blocks enough");
///     println!("{} = {:.3} [{low:.3}, {high:.3}] {}", estimate.name, estimate.value, estimate.unit);
/// }
/// assert!(model.effects.iter().flat_map(|effect| &effect.coefficients).all(|number| number.ci95.is_some()));
/// # Ok(())
/// # }
/// ```
pub fn calibrate(model: &Model, flights: &[Flight], spans: &[Span]) -> Result<(Model, Calibration)> {
    calibrate_weighed(model, flights, spans, Weights::Rows)
}

/// As [`calibrate`], with rows weighted as `weights` says; intervals and errors allow for it.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_weighed(model: &Model, flights: &[Flight], spans: &[Span], weights: Weights) -> Result<(Model, Calibration)> {
    model.check()?;
    if let Some(span) = spans.iter().find(|span| span.flight >= flights.len()) {
        let (found, expected) = (span.flight.to_string(), format!("an index of the {} flights", flights.len()));
        return Err(Error::Config { place: "calibrate".into(), field: "span.flight".into(), found, expected });
    }
    let rows = Rows::of(flights, spans, weights)?;
    rows.jobs.iter().try_for_each(|&(flight, _)| composed_for(model, &flights[flight]).map(drop))?;
    let mut current = started(model, &rows)?;
    let mut pass = Pass::at(&current, &rows)?;
    if pass.is_linear {
        let solved = pass.solve(&current, &rows, None, true)?;
        return Ok((solved.model.clone(), solved.calibration(&pass, &rows, 1, 0.0)));
    }
    let mut damping = DAMPING;
    for round in 2..=MOST_ROUNDS {
        let solved = pass.bounded(&current, &rows, damping)?;
        if solved.largest_move <= SETTLED {
            return pass.finished(&current, &rows, round - 1);
        }
        // A step may lead to where a formula is no number, or where the flights determine nothing: then it was too long.
        match Pass::at(&solved.model, &rows) {
            Ok(next) if next.cost <= pass.cost => {
                (pass, current) = (next, solved.model);
                damping /= DAMPING_FACTOR;
            }
            Ok(_) | Err(Error::Undetermined(_)) if damping < LARGEST_DAMPING => damping *= DAMPING_FACTOR,
            Ok(_) => return pass.finished(&current, &rows, round),
            Err(error) => return Err(error),
        }
    }
    pass.finished(&current, &rows, MOST_ROUNDS)
}

/// A model from which steps lead somewhere: its baseline fitted if it is blank, and no amplitude of a shape at zero.
fn started(model: &Model, rows: &Rows<'_>) -> Result<Model> {
    let mut current = model.clone();
    if !model.effects.iter().any(|effect| effect.enabled && leans_on_others(model, effect)) {
        return Ok(current);
    }
    let of_baseline = |kind: &str| catalogue::definition(kind).is_some_and(|definition| definition.notes.is_none());
    let is_blank = |effect: &Effect| effect.coefficients.iter().any(|coefficient| coefficient.value == 0.0);
    if model.effects.iter().any(|effect| effect.enabled && of_baseline(&effect.kind) && is_blank(effect)) {
        let mut bare = model.clone();
        bare.effects.iter_mut().for_each(|effect| effect.enabled &= of_baseline(&effect.kind));
        let pass = Pass::at(&bare, rows)?;
        let found = pass.solve(&bare, rows, None, false)?.model;
        for (effect, found) in current.effects.iter_mut().zip(found.effects).filter(|(_, found)| found.enabled) {
            effect.coefficients = found.coefficients;
        }
    }
    current.effects.iter_mut().filter(|effect| effect.enabled).for_each(off_zero);
    Ok(current)
}

/// Gives the amplitudes that are zero a tenth of their usual size, if the effect has shapes or times: steps then lead somewhere.
pub(crate) fn off_zero(effect: &mut Effect) {
    let Some(definition) = catalogue::definition(&effect.kind) else { return };
    if effect.parameters.iter().all(|parameter| parameter.fixed) {
        return;
    }
    for coefficient in effect.coefficients.iter_mut().filter(|c| c.value == 0.0 && c.by_flight.is_none()) {
        let usual = definition.coefficient(&coefficient.name).and_then(|known| known.expected);
        coefficient.value =
            START * usual.map_or(1.0, |[low, high]| if low < 0.0 && 0.0 < high { high } else { 0.5 * (low + high) });
    }
}

/// Whether an effect acts through the numbers of others: it changes a signal, reads one that the baseline makes, or reads a coefficient.
fn leans_on_others(model: &Model, effect: &Effect) -> bool {
    let reads = |name: &str| match signal_named(name) {
        Some(signal) => signal.stage >= Stage::Rotor,
        None => !standard_names().contains(&name) && effect.number_named(name).is_none() && model.coefficient_named(name).is_some(),
    };
    !effect.swaps.is_empty() || effect.formulas().flat_map(Formula::names).any(reads)
}

/// A model's columns on the rows, at its present numbers.
struct Pass {
    layout: Layout,
    clusters: Vec<Cluster>,
    is_linear: bool,
    /// One over the standard deviation of each channel's residual.
    weights: Vec<f64>,
    /// Minus twice the logarithm of the likelihood, the channels' variances being those of their residuals, but for a constant.
    cost: f64,
}

/// What one solution brought.
struct Solved {
    model: Model,
    condition_number: f64,
    clusters: usize,
    /// By how much a number moved at most, in half intervals or, without these, in standard errors.
    largest_move: f64,
}

impl Solved {
    fn calibration(&self, pass: &Pass, rows: &Rows<'_>, rounds: usize, last_change: f64) -> Calibration {
        let numbers = pass.layout.all();
        Calibration {
            coefficients: numbers.into_iter().filter_map(|(effect, index)| estimate(&self.model, effect, index)).collect(),
            condition_number: self.condition_number,
            rows: rows.total,
            clusters: self.clusters,
            weights: rows.weights,
            rounds,
            last_change,
            signs: self.model.sign_doubts(),
        }
    }
}

impl Pass {
    fn at(model: &Model, rows: &Rows<'_>) -> Result<Self> {
        let mut columns = Columns::default();
        let wanted = Wanted { parameters: true, ..Wanted::default() };
        let regressors = columns.regressors(model, wanted)?;
        let is_linear = columns.is_linear(model, &regressors, wanted)?;
        let layout = Layout::of(model, regressors);
        layout.check_complete(model)?;
        let reduce = |&(flight, clusters): &(usize, usize)| {
            layout.reduce(
                (model, &columns),
                (flight, &rows.flights[flight]),
                (&rows.ranges[flight], &rows.factors[flight]),
                clusters,
            )
        };
        #[cfg(feature = "rayon")]
        let reduced: Result<Vec<Vec<Cluster>>> = {
            use rayon::prelude::*;
            rows.jobs.par_iter().map(reduce).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let reduced: Result<Vec<Vec<Cluster>>> = rows.jobs.iter().map(reduce).collect();
        let clusters: Vec<Cluster> = reduced?.into_iter().flatten().collect();
        let mut pass = Self { layout, clusters, is_linear, weights: Vec::new(), cost: 0.0 };
        if !is_linear {
            pass.weigh(model, rows);
        }
        Ok(pass)
    }

    /// Residuals of the model at its numbers.
    fn weigh(&mut self, model: &Model, rows: &Rows<'_>) {
        let value = |&(effect, index): &Free, flight: usize| {
            model.effects[effect].number(index).map_or(0.0, |number| number.in_flight(&rows.flights[flight].name))
        };
        let mut squares = PerChannel::splat(0.0);
        for cluster in &mut self.clusters {
            for (channel, factor) in Channel::ALL.into_iter().zip(&mut cluster.factors) {
                let free = self.layout.channels[channel].iter().map(|&column| value(&self.layout.free[column], cluster.flight));
                let own = self.layout.own_channels[channel].iter().map(|&column| value(&self.layout.own[column], cluster.flight));
                let values = DVector::from_iterator(factor.width() - 1, free.chain(own));
                squares[channel] += residual(factor.finish().0, &values).norm_squared();
            }
        }
        let deviations = self.layout.own_columns(model).deviations;
        let mut prior = 0.0;
        for &(flight, _) in &rows.jobs {
            prior += self
                .layout
                .own
                .iter()
                .zip(&deviations)
                .map(|(own, deviation)| (value(own, flight) / deviation).powi(2))
                .sum::<f64>();
        }
        let count = rows.total as f64;
        self.weights = squares.iter().map(|squares| (count / squares.max(f64::MIN_POSITIVE)).sqrt()).collect();
        self.cost = prior + squares.iter().map(|squares| count * (squares.max(f64::MIN_POSITIVE) / count).ln()).sum::<f64>();
    }

    /// A damped step that leaves no parameter beyond its bounds: the one that goes furthest is put on its bound, until none is left.
    fn bounded(&self, model: &Model, rows: &Rows<'_>, damping: f64) -> Result<Solved> {
        let mut held: BTreeMap<Free, f64> = BTreeMap::new();
        loop {
            let solved = self.solve(model, rows, Some((damping, &held)), false)?;
            let beyond = self.layout.free.iter().filter(|free| !held.contains_key(*free)).filter_map(|&free| {
                let [low, high] = parameter_bounds(model, free)?;
                let value = solved.model.effects[free.0].number(free.1)?.value;
                let excess = (low - value).max(value - high);
                (excess > 0.0).then(|| (excess / usual_size(model, free), free, value.clamp(low, high)))
            });
            match beyond.max_by(|left, right| left.0.total_cmp(&right.0)) {
                None => return Ok(solved),
                Some((_, free, bound)) => drop(held.insert(free, bound)),
            }
        }
    }

    /// The model at its numbers, with the intervals of a step that is not damped.
    fn finished(&self, model: &Model, rows: &Rows<'_>, rounds: usize) -> Result<(Model, Calibration)> {
        let on_bound = |free: &&Free| {
            let value = model.effects[free.0].number(free.1).map(|number| number.value);
            parameter_bounds(model, **free).zip(value).is_some_and(|([low, high], value)| value <= low || value >= high)
        };
        let held: BTreeMap<Free, f64> = self
            .layout
            .free
            .iter()
            .filter(on_bound)
            .filter_map(|&free| Some((free, model.effects[free.0].number(free.1)?.value)))
            .collect();
        let mut solved = self.solve(model, rows, Some((0.0, &held)), true)?;
        for &(effect, index) in &self.layout.free {
            let before = model.effects[effect].number(index).map_or(0.0, |number| number.value);
            if let Some((value, ci95)) = solved.model.effects[effect].number_mut(index) {
                let moved = *value - before;
                *ci95 = ci95.map(|ends| ends.map(|end| end - moved)).filter(|_| !held.contains_key(&(effect, index)));
                *value = before;
            }
        }
        let last_change = solved.largest_move;
        let calibration = solved.calibration(self, rows, rounds, last_change);
        Ok((solved.model, calibration))
    }

    /// Least squares of the columns, by groups of channels that share numbers; damped and with some numbers held where that is asked for.
    fn solve(
        &self,
        model: &Model,
        rows: &Rows<'_>,
        damped: Option<(f64, &BTreeMap<Free, f64>)>,
        with_intervals: bool,
    ) -> Result<Solved> {
        let mut found = model.clone();
        found.correlations.clear();
        let mut clusters = self.clusters.clone();
        if !self.layout.own.is_empty() {
            let all = damped.map(|damped| self.hold(model, &self.layout.free, damped));
            clusters = self.settle(model, rows, all.as_ref(), clusters, &mut found)?;
        }
        let (mut condition_number, mut largest_move) = (1.0_f64, 0.0_f64);
        for (members, problem) in self.layout.problems() {
            let hold = damped.map(|damped| self.hold(model, &members, damped));
            let failed = |failure: Failure| self.layout.explain(model, &members, &failure);
            let fitted = Fitted::of(&problem, &mut clusters, hold.as_ref(), with_intervals).map_err(failed)?;
            condition_number = condition_number.max(fitted.condition_number);
            if with_intervals {
                let label = |&(effect, index): &Free| {
                    let number = model.effects[effect].number(index).expect("a number of the model");
                    Correlation::label(&model.effects[effect], &number.name)
                };
                found.correlations.extend(Correlation::of_deviations(members.iter().map(label).collect(), &fitted.deviations));
            }
            for (at, &(effect, index)) in members.iter().enumerate() {
                // On a bound to the last digit.
                let value = damped.and_then(|(_, held)| held.get(&(effect, index)).copied()).unwrap_or(fitted.values[at]);
                if let Some((known, interval)) = found.effects[effect].number_mut(index) {
                    let error = fitted.errors[at].max(SMALLEST_ERROR * value.abs());
                    if error > 0.0 {
                        largest_move = largest_move.max((value - *known).abs() / error);
                    }
                    (*known, *interval) = (value, fitted.ci95[at]);
                }
            }
        }
        Ok(Solved { model: found, condition_number, clusters: clusters.len(), largest_move })
    }

    /// What keeps numbers where they are, as far as they are damped, and on the values where they are held.
    fn hold(&self, model: &Model, members: &[Free], (damping, held): (f64, &BTreeMap<Free, f64>)) -> Hold {
        let row = |free: &Free| match held.get(free) {
            Some(&bound) => (HELD / usual_size(model, *free), bound),
            None => {
                let value = model.effects[free.0].number(free.1).map_or(0.0, |number| number.value);
                (damping.sqrt() / usual_size(model, *free), value)
            }
        };
        Hold { weights: self.weights.clone(), rows: members.iter().map(row).collect() }
    }

    /// Puts the coefficients that belong to a flight into `found`; the clusters that come back are without them.
    fn settle(
        &self,
        model: &Model,
        rows: &Rows<'_>,
        hold: Option<&Hold>,
        mut clusters: Vec<Cluster>,
        found: &mut Model,
    ) -> Result<Vec<Cluster>> {
        let layout = &self.layout;
        let own = &layout.own_columns(model);
        let shape = by_flight::Shape { free: layout.free.len(), channels: layout.channels.values(), own, hold };
        let settled = by_flight::settle(&shape, &mut clusters).map_err(|failure| layout.explain(model, &layout.free, &failure))?;
        for (place, &(effect, index)) in layout.own.iter().enumerate() {
            let of_flight =
                |(&flight, values): (&usize, &Vec<f64>)| Some((rows.flights.get(flight)?.name.clone(), *values.get(place)?));
            let values: BTreeMap<String, f64> = settled.values.iter().filter_map(of_flight).collect();
            let coefficient = &mut found.effects[effect].coefficients[index];
            coefficient.value = values.values().sum::<f64>() / values.len().max(1) as f64;
            (coefficient.ci95, coefficient.by_flight) = (None, Some(values));
        }
        Ok(settled.clusters)
    }
}

/// The numbers of one group of channels.
struct Fitted {
    values: Vec<f64>,
    /// Half intervals or, without these, standard errors.
    errors: Vec<f64>,
    ci95: Vec<Option<[f64; 2]>>,
    /// How each cluster pulls the numbers; empty without intervals.
    deviations: Vec<Vec<f64>>,
    condition_number: f64,
}

impl Fitted {
    fn of(
        problem: &Problem,
        clusters: &mut [Cluster],
        hold: Option<&Hold>,
        with_intervals: bool,
    ) -> std::result::Result<Self, Failure> {
        if !with_intervals {
            let Step { fit, .. } = step(problem, clusters, hold)?;
            let numbers = 0..fit.values.len();
            return Ok(Self {
                values: fit.values.iter().copied().collect(),
                errors: numbers.clone().map(|at| fit.standard_error(at)).collect(),
                ci95: numbers.map(|_| None).collect(),
                deviations: Vec::new(),
                condition_number: fit.condition_number(),
            });
        }
        let solution = solve(problem, clusters, hold)?;
        if let Some(vague) = solution.ci95.iter().position(|ends| !ends.iter().all(|end| end.is_finite())) {
            return Err(Failure::OneCluster(vague));
        }
        Ok(Self {
            values: solution.values,
            errors: solution.ci95.iter().map(|[low, high]| 0.5 * (high - low)).collect(),
            ci95: solution.ci95.into_iter().map(Some).collect(),
            deviations: solution.deviations,
            condition_number: solution.condition_number,
        })
    }
}

/// Bounds of a parameter; coefficients have none here.
pub(super) fn parameter_bounds(model: &Model, (effect, index): Free) -> Option<[f64; 2]> {
    let effect = model.effects.get(effect)?;
    let parameter = effect.parameters.get(index.checked_sub(effect.coefficients.len())?)?;
    Some(catalogue::definition(&effect.kind)?.parameter(&parameter.name)?.bounds)
}

/// About how large a number usually is.
pub(super) fn usual_size(model: &Model, (effect, index): Free) -> f64 {
    let effect = &model.effects[effect];
    let Some(number) = effect.number(index) else { return 1.0 };
    let definition = catalogue::definition(&effect.kind);
    let expected = definition.and_then(|definition| definition.coefficient(&number.name)).and_then(|known| known.expected);
    match expected {
        Some([low, high]) => low.abs().max(high.abs()),
        None if number.value != 0.0 => number.value.abs(),
        None => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::catalogue::tests::{helicopter, motion};
    use super::*;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    /// Effects that smooth motion far from the ground determines, whatever others there are.
    const DETERMINED: [&str; 16] = [
        "cyclic_lag",
        "tail_lag",
        "collective_lag",
        "ctrl_cross",
        "rate_cross",
        "quad_drag",
        "weathercock",
        "dihedral_speedstab",
        "speed_damping",
        "transl_lift",
        "stall_saturation",
        "collective_torque",
        "heave_torque",
        "flap_tilt",
        "cg_offset",
        "tilt_misalign",
    ];

    fn machine(chosen: &[bool]) -> Model {
        let mut model = helicopter();
        for (kind, _) in DETERMINED.iter().zip(chosen).filter(|(_, chosen)| **chosen) {
            let definition = catalogue::definition(kind).expect("an effect of the catalogue");
            let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
            for (coefficient, known) in effect.coefficients.iter_mut().zip(definition.coefficients) {
                let [low, high] = known.expected.expect("the catalogue gives usual sizes");
                coefficient.value = 0.25 * low + 0.75 * high;
            }
            model.effects.push(effect);
        }
        model
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn numbers_that_are_a_third_off_are_found_again(
            seed in any::<u64>(),
            chosen in prop::collection::vec(any::<bool>(), DETERMINED.len()),
        ) {
            let truth = machine(&chosen);
            let flights: Vec<Flight> = (0..3)
                .map(|index| {
                    let mut flight = motion(seed.wrapping_add(index), 2000)?;
                    flight.name = format!("flight_{index}");
                    flight.with_accelerations(&truth.predict(&flight)?)
                })
                .collect::<Result<_>>()?;
            let spans: Vec<Span> = (0..3).map(|flight| Span { flight, start: 0, end: 2000 }).collect();
            let mut off = truth.clone();
            let (draws, mut draw) = (Stream::new(seed, 9, 9, 9), 0);
            for effect in &mut off.effects {
                for index in 0..effect.coefficients.len() + effect.parameters.len() {
                    let is_fixed = index.checked_sub(effect.coefficients.len()).is_some_and(|place| effect.parameters[place].fixed);
                    if let Some((value, _)) = effect.number_mut(index).filter(|_| !is_fixed) {
                        *value *= 1.0 + 0.3 * (2.0 * draws.uniform(draw) - 1.0);
                        draw += 1;
                    }
                }
            }
            let (found, calibration) = calibrate(&off, &flights, &spans)?;
            for (found, truth) in found.effects.iter().zip(&truth.effects) {
                for index in 0..truth.coefficients.len() + truth.parameters.len() {
                    let (found, number) = (found.number(index), truth.number(index));
                    let pair = found.zip(number).map(|(found, number)| (found.value, number.value, number.name));
                    let (value, expected, name) = pair.expect("the same effects");
                    let size = expected.abs().max(0.01);
                    prop_assert!((value - expected).abs() < 1e-3 * size, "{}.{name}: {value} for {expected}\n{calibration}", truth.name);
                }
            }
        }
    }
}
