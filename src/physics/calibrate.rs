//! Calibration: the numbers of a model's enabled effects by least squares on recorded flights (paper eq. 33), with units,
//! 95 % intervals and a condition number; and a refusal that names the reason where the data do not determine them.
//!
//! What stands in which column is in `layout`, the algebra in `least_squares`, and coefficients that belong to a flight in `by_flight`.

use super::by_flight;
use super::catalogue;
use super::columns::{Columns, Wanted};
use super::compose::Free;
use super::correlation::Correlation;
use super::digits::printer;
use super::effect::Effect;
use super::evaluate::{composed_for, standard_names};
use super::layout::Layout;
use super::least_squares::{Cluster, Failure, Hold, residual, solve, step};
use super::model::Model;
use super::sign_doubt::{SignDoubt, SignFinding};
use super::signal::{Stage, signal_named};
use super::weights::Weights;
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::formula::Formula;
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Clusters that the whole of the data is cut into for the intervals, unless it is cut into more by flights.
const CLUSTERS: usize = 40;

/// Clusters are not made shorter than this, s.
const SHORTEST_CLUSTER_S: f64 = 1.0;

/// Passes over the flights, at most; a model of twenty effects takes about ten.
const MOST_ROUNDS: usize = 40;

/// Numbers have settled when none would move by more than this share of its standard error, were residuals independent. They are not,
/// so the intervals are some times wider.
const SETTLED: f64 = 1e-2;

/// A standard error counts as at least this share of the number: where the flights know it to the last digit, that digit does not matter.
const SMALLEST_ERROR: f64 = 1e-7;

/// Weight at first of what holds the numbers where they are, in independent samples that would know each to its usual size; and the
/// factor by which it changes with each step that succeeds or fails (Levenberg 1944, Marquardt 1963). In units of the usual sizes, not of
/// the columns: a number that the flights hardly know then moves no further than it may.
const DAMPING: f64 = 1.0;
const DAMPING_FACTOR: f64 = 10.0;
const LARGEST_DAMPING: f64 = 1e12;

/// Share of its usual size at which a coefficient starts whose effect has shape parameters: at 0 these do nothing, and have no slope.
const START: f64 = 0.1;

/// One calibrated coefficient.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Value, in [`Estimate::unit`]; for a property of each flight, the mean over the flights.
    pub value: f64,
    /// 95 % confidence interval, valid for residuals that are correlated in time. `None` for a property of each flight; the intervals
    /// of the others hold given those properties, whose own uncertainty they leave out.
    pub ci95: Option<[f64; 2]>,
    /// Unit.
    pub unit: String,
    /// Values that physics allows, where the catalogue knows them. Calibration does not enforce them.
    pub bounds: Option<[f64; 2]>,
    /// For a property of each flight: its value by name of the flight.
    pub by_flight: Option<BTreeMap<String, f64>>,
}

impl Estimate {
    /// Whether the value lies where physics does not allow it.
    pub fn is_implausible(&self) -> bool {
        self.bounds.is_some_and(|[low, high]| !(low..=high).contains(&self.value))
    }
}

/// What a calibration found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Calibration {
    /// Coefficients in the order of the model.
    pub coefficients: Vec<Estimate>,
    /// Largest condition number of the column-scaled regressor matrices.
    pub condition_number: f64,
    /// Rows used, each with six accelerations.
    pub rows: usize,
    /// Stretches of consecutive rows that the intervals rest on.
    pub clusters: usize,
    /// What counted alike.
    #[serde(default)]
    pub weights: Weights,
    /// Passes over the flights; one, if the model is linear in its numbers.
    pub rounds: usize,
    /// By how much a number would still move, in half intervals.
    pub last_change: f64,
    /// Coefficients whose sign physics fixes and this calibration does not show.
    #[serde(default)]
    pub signs: Vec<SignDoubt>,
}

impl std::fmt::Display for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<20} {:<8} {:>12}   {:<27} unit", "effect", "name", "value", "95 % interval")?;
        for estimate in &self.coefficients {
            let Estimate { effect, name, value, ci95, unit, bounds, by_flight } = estimate;
            let shown = printer(5, ci95.iter().flatten().copied().chain([*value]));
            let interval = match (ci95, by_flight) {
                (Some([low, high]), _) => format!("[{:>11}, {:>11}]", shown(*low), shown(*high)),
                (None, Some(flights)) => {
                    let (low, high) = flights
                        .values()
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
                    format!("{low:.3} to {high:.3} in {} flights", flights.len())
                }
                (None, None) => String::new(),
            };
            write!(f, "{effect:<20} {name:<8} {:>12}   {interval:<27} {unit}", shown(*value))?;
            let doubt = self.signs.iter().find(|doubt| doubt.effect == *effect && doubt.name == *name);
            match (bounds, doubt.map(|doubt| doubt.finding)) {
                (Some([low, high]), _) if estimate.is_implausible() => {
                    writeln!(f, "   outside its physical bounds {low} to {high}")?
                }
                (_, Some(SignFinding::Wrong)) => writeln!(f, "   WRONG SIGN")?,
                (_, Some(SignFinding::NotDetermined)) => writeln!(f, "   sign not determined")?,
                _ => writeln!(f)?,
            }
        }
        if self.last_change > SETTLED {
            let change = self.last_change;
            writeln!(f, "numbers still moved by {change:.1e} of half their intervals after {} passes", self.rounds)?;
        }
        write!(
            f,
            "{} rows; condition number {:.1}; intervals from {} stretches of consecutive rows",
            self.rows, self.condition_number, self.clusters
        )?;
        let wrong: Vec<&SignDoubt> = self.signs.iter().filter(|doubt| doubt.finding == SignFinding::Wrong).collect();
        wrong.iter().try_for_each(|doubt| write!(f, "\nCAUTION: {doubt}"))?;
        if !wrong.is_empty() {
            write!(
                f,
                "\n         Such a number stands in for physics that the model lacks, or a control acts otherwise than the log says."
            )?;
        }
        if self.signs.iter().any(|doubt| doubt.finding == SignFinding::NotDetermined) {
            write!(
                f,
                "\nWhere a sign is not determined, zero is possible: leave the effect out, or fly what moves it more and calibrate again."
            )?;
        }
        Ok(())
    }
}

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

/// The rows that a calibration sees.
struct Rows<'a> {
    flights: &'a [Flight],
    ranges: Vec<Vec<(usize, usize)>>,
    /// Flights with rows, and how many clusters each is cut into.
    jobs: Vec<(usize, usize)>,
    total: usize,
    weights: Weights,
    /// Of each flight, what its columns are multiplied by.
    factors: Vec<PerChannel<f64>>,
}

impl<'a> Rows<'a> {
    fn of(flights: &'a [Flight], spans: &[Span], weights: Weights) -> Result<Self> {
        let ranges: Vec<Vec<(usize, usize)>> = (0..flights.len()).map(|flight| union(flight, spans, flights)).collect();
        let rows: Vec<usize> = ranges.iter().map(|ranges| ranges.iter().map(|range| range.1 - range.0).sum()).collect();
        let total: usize = rows.iter().sum();
        if total == 0 {
            return Err(Error::Undetermined("no rows to calibrate on: the spans are empty; give at least one flight".into()));
        }
        let (jobs, factors) = (cut(flights, &rows)?, weights.of(flights, &ranges));
        Ok(Self { flights, ranges, jobs, total, weights, factors })
    }
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
        let layout = &self.layout;
        let mut clusters = self.clusters.clone();
        let mut found = model.clone();
        found.correlations.clear();
        let hold = |members: &[Free]| {
            damped.map(|(damping, held)| Hold {
                weights: self.weights.clone(),
                rows: members
                    .iter()
                    .map(|free| match held.get(free) {
                        Some(&bound) => (1e9 / usual_size(model, *free), bound),
                        None => (
                            damping.sqrt() / usual_size(model, *free),
                            model.effects[free.0].number(free.1).map_or(0.0, |number| number.value),
                        ),
                    })
                    .collect(),
            })
        };
        if !layout.own.is_empty() {
            let all = hold(&layout.free);
            let shape = by_flight::Shape {
                free: layout.free.len(),
                channels: layout.channels.values(),
                own: &layout.own_columns(model),
                hold: all.as_ref(),
            };
            let settled =
                by_flight::settle(&shape, &mut clusters).map_err(|failure| layout.explain(model, &layout.free, &failure))?;
            clusters = settled.clusters;
            for (place, &(effect, index)) in layout.own.iter().enumerate() {
                let coefficient = &mut found.effects[effect].coefficients[index];
                let values: BTreeMap<String, f64> = settled
                    .values
                    .iter()
                    .filter_map(|(&flight, values)| Some((rows.flights.get(flight)?.name.clone(), *values.get(place)?)))
                    .collect();
                coefficient.value = values.values().sum::<f64>() / values.len().max(1) as f64;
                (coefficient.ci95, coefficient.by_flight) = (None, Some(values));
            }
        }
        let (mut condition_number, mut largest_move) = (1.0_f64, 0.0_f64);
        for (members, problem) in layout.problems() {
            let failed = |failure: Failure| layout.explain(model, &members, &failure);
            let hold = hold(&members);
            let (values, errors, ci95): (Vec<f64>, Vec<f64>, Vec<Option<[f64; 2]>>) = if with_intervals {
                let solution = solve(&problem, &mut clusters, hold.as_ref()).map_err(failed)?;
                condition_number = condition_number.max(solution.condition_number);
                if let Some(vague) = (0..members.len()).find(|&at| !solution.ci95[at].iter().all(|end| end.is_finite())) {
                    return Err(failed(Failure::OneCluster(vague)));
                }
                let label = |&(effect, index): &Free| {
                    let number = model.effects[effect].number(index).expect("a number of the model");
                    Correlation::label(&model.effects[effect], &number.name)
                };
                found.correlations.extend(Correlation::of_deviations(members.iter().map(label).collect(), &solution.deviations));
                let halves = solution.ci95.iter().map(|[low, high]| 0.5 * (high - low)).collect();
                (solution.values, halves, solution.ci95.into_iter().map(Some).collect())
            } else {
                let step = step(&problem, &mut clusters, hold.as_ref()).map_err(failed)?;
                condition_number = condition_number.max(step.fit.condition_number());
                let errors = (0..members.len()).map(|at| step.fit.standard_error(at)).collect();
                (step.fit.values.iter().copied().collect(), errors, vec![None; members.len()])
            };
            for (at, &(effect, index)) in members.iter().enumerate() {
                // On a bound to the last digit.
                let value = damped.and_then(|(_, held)| held.get(&(effect, index)).copied()).unwrap_or(values[at]);
                if let Some((known, interval)) = found.effects[effect].number_mut(index) {
                    let error = errors[at].max(SMALLEST_ERROR * value.abs());
                    if error > 0.0 {
                        largest_move = largest_move.max((value - *known).abs() / error);
                    }
                    (*known, *interval) = (value, ci95[at]);
                }
            }
        }
        Ok(Solved { model: found, condition_number, clusters: clusters.len(), largest_move })
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

/// How many clusters each flight with rows is cut into.
///
/// # Errors
/// [`Error::Undetermined`] where intervals would rest on nothing: they need two clusters of twice the length.
fn cut(flights: &[Flight], rows: &[usize]) -> Result<Vec<(usize, usize)>> {
    let total: usize = rows.iter().sum();
    let jobs: Vec<(usize, usize)> = (0..flights.len())
        .filter(|&flight| rows[flight] > 0)
        .map(|flight| {
            let shortest = (SHORTEST_CLUSTER_S / flights[flight].step_s) as usize;
            let length = (total / CLUSTERS).max(shortest).max(1);
            (flight, ((rows[flight] + length / 2) / length).max(1).min(rows[flight]))
        })
        .collect();
    if jobs.iter().map(|(_, clusters)| clusters.div_ceil(2)).sum::<usize>() < 2 {
        let length_s: f64 = jobs.iter().map(|&(flight, _)| rows[flight] as f64 * flights[flight].step_s).sum();
        return Err(Error::Undetermined(format!(
            "the training part is {length_s:.2} s of one flight, too little to tell how certain a coefficient is; give at least \
             {:.1} s, or a second flight",
            2.5 * SHORTEST_CLUSTER_S
        )));
    }
    Ok(jobs)
}

pub(super) fn estimate(model: &Model, effect: usize, index: usize) -> Option<Estimate> {
    let effect = model.effects.get(effect)?;
    let number = effect.number(index)?;
    let definition = catalogue::definition(&effect.kind);
    let of_coefficient = definition.and_then(|definition| definition.coefficient(&number.name)).map(|known| known.bounds);
    let of_parameter = definition.and_then(|definition| definition.parameter(&number.name)).map(|known| known.bounds);
    Some(Estimate {
        effect: effect.name.clone(),
        name: number.name,
        value: number.value,
        ci95: number.ci95,
        unit: number.unit,
        bounds: of_coefficient.or(of_parameter).filter(|bounds| bounds.iter().all(|bound| bound.is_finite())),
        by_flight: number.by_flight,
    })
}

/// The samples of one flight that the spans cover and that count, in order, without overlap.
fn union(flight: usize, spans: &[Span], flights: &[Flight]) -> Vec<(usize, usize)> {
    let length = flights.get(flight).map_or(0, Flight::len);
    let mut ranges: Vec<(usize, usize)> =
        spans.iter().filter(|span| span.flight == flight).map(|span| (span.start.min(length), span.end.min(length))).collect();
    ranges.retain(|range| range.0 < range.1);
    ranges.sort_unstable();
    let mut merged: Vec<(usize, usize)> = Vec::new();
    for (start, end) in ranges {
        match merged.last_mut() {
            Some(last) if start <= last.1 => last.1 = last.1.max(end),
            _ => merged.push((start, end)),
        }
    }
    match flights.get(flight) {
        Some(flight) => {
            merged.into_iter().flat_map(|(start, end)| flight.counted(start..end)).map(|rows| (rows.start, rows.end)).collect()
        }
        None => merged,
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
