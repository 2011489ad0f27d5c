//! A model with all its numbers open at once, coefficients, times and shapes: its error near its present numbers as one quadratic form, the steps
//! that lower it, and the errors of the model without some of its effects. Which effects are needed is the business of `backward`.
//!
//! Near its numbers θ₀ the model is `J θ + rest`, J being its derivatives; without the effect e its columns are those of the others, and `A_e` is
//! added ([`Columns::absence`]). So one pass over the flights brings the Gram matrices of `[J | A | y - rest]`, and every choice among the effects
//! is least squares on them. Each number but the baseline's has its usual size as a prior, so that many effects at once stay determined.

mod intervals;
mod normal;
mod spread;

use super::design::{Design, Free, Layout};
use super::engine::{Engine, Errors, FOLDS};
use super::fit::Reduced;
use super::gram::grams;
use super::known::{Known, known};
use super::own::prediction_errors;
use crate::error::{Error, Result};
use crate::flight::{Channel, PerChannel};
use crate::physics::{Model, Wanted};
use nalgebra::{Cholesky, DMatrix, DVector};
use normal::Normal;
use std::collections::{BTreeMap, BTreeSet};

/// Weight at first of what holds numbers where they are, beside that of their usual sizes; and its factor with each step that succeeds or fails.
const DAMPING: f64 = 1.0;
const DAMPING_FACTOR: f64 = 10.0;
const LARGEST_DAMPING: f64 = 1e8;

/// A step has settled when it changes twice the logarithm of the likelihood by less than this, in independent samples: no
/// choice between effects hangs on so little.
const SETTLED: f64 = 0.5;

/// A model at its numbers, and its neighbourhood.
pub(super) struct Point {
    pub model: Model,
    /// Effects that may be left out, by their index in the model.
    pub optional: Vec<usize>,
    layout: Layout,
    /// What may move beside the numbers of each flight; all, where nothing is said.
    movable: Option<Vec<usize>>,
    known: Vec<Known>,
    /// By channel, the squares of `[J | A | y - rest]` of each block; columns are numbered as in `layout.free`, then `optional`.
    reduced: PerChannel<Reduced>,
    /// Names of the flights by index.
    names: Vec<String>,
    correlation: f64,
    /// Mean squared error of each channel.
    pub mse: PerChannel<f64>,
    /// Minus twice the logarithm of likelihood and prior, in independent samples, but for a constant.
    pub cost: f64,
}

/// Which numbers a fit moves; those of each flight always.
#[derive(Clone, Copy, Debug)]
pub(super) enum Moving<'a> {
    All,
    /// All that act on an acceleration on which this effect acts.
    Beside(&'a str),
    /// Those of this effect.
    Own(&'a str),
}

/// The blocks of all folds but one, for each fold, with these numbers of each flight.
pub(super) struct Folds {
    locals: Vec<usize>,
    normals: Vec<Normal>,
}

impl Point {
    /// The neighbourhood of a model; `optional` effects may then be left out.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn at(engine: &Engine<'_>, model: Model, optional: Vec<usize>) -> Result<Self> {
        let mut design = Design::default();
        let regressors = design.columns.regressors(&model, Wanted { parameters: true, ..Wanted::default() })?;
        let mut layout = design.add(&model, &regressors);
        let numbers = layout.free.len();
        for (place, &effect) in optional.iter().enumerate() {
            for absence in design.columns.absence(&model, &regressors, effect)? {
                let column = design.column(&model, &absence);
                layout.channels[absence.channel].free.push((numbers + place, vec![(column, 1.0)]));
            }
        }
        let grams = grams(engine.flights, &engine.blocks, &design)?;
        let reduced = PerChannel::from_fn(|channel| Reduced::new(&layout, channel, &grams));
        drop(grams);
        let known = layout.free.iter().map(|&free| known(&model, free)).collect();
        let names = engine.flights.iter().map(|flight| flight.name.clone()).collect();
        let correlation = engine.correlation;
        let (mse, cost) = (PerChannel::splat(0.0), 0.0);
        let mut point = Self { model, optional, layout, movable: None, known, reduced, names, correlation, mse, cost };
        point.weigh(engine);
        Ok(point)
    }

    /// Error and cost at the present numbers.
    fn weigh(&mut self, engine: &Engine<'_>) {
        let mut sums = PerChannel::splat(0.0);
        for run in engine.runs() {
            let values = self.values(engine.blocks[run.start].flight);
            for block in run {
                let errors = self.errors(block, &values);
                sums.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error);
            }
        }
        let (mse, cost) = self.likelihood(engine, &sums);
        (self.mse, self.cost) = (mse, cost + self.prior(engine, &self.model));
    }

    /// Numbers, absences (none) and the one of what is measured, for a flight.
    fn values(&self, flight: usize) -> Vec<f64> {
        self.values_of(&self.model, flight)
    }

    fn values_of(&self, model: &Model, flight: usize) -> Vec<f64> {
        let name = self.names.get(flight).map_or("", String::as_str);
        let of = |free: &Free| {
            let number = model.effects[free.effect].number(free.coefficient);
            number.map_or(0.0, |number| if flight == usize::MAX { number.value } else { number.in_flight(name) })
        };
        let numbers = self.layout.free.iter().map(of);
        numbers.chain(self.optional.iter().map(|_| 0.0)).chain([1.0]).collect()
    }

    fn size(&self) -> usize {
        self.layout.free.len() + self.optional.len() + 1
    }

    /// Squared error of a block, by channel.
    fn errors(&self, block: usize, values: &[f64]) -> PerChannel<f64> {
        PerChannel::from_fn(|channel| self.reduced[channel].error(block, &|place| values[place]))
    }

    /// The numbers that each flight has for itself, those of effects that are left out excepted.
    fn locals(&self, absent: &[usize]) -> Vec<usize> {
        (0..self.known.len()).filter(|&at| self.known[at].is_local && !self.is_absent(at, absent)).collect()
    }

    /// Whether a number belongs to an effect that is left out; `absent` are places in `optional`.
    fn is_absent(&self, number: usize, absent: &[usize]) -> bool {
        absent.iter().any(|&place| self.optional[place] == self.layout.free[number].effect)
    }

    fn movable(&self, moving: Moving<'_>) -> Option<Vec<usize>> {
        let is_of = |name: &str, number: usize| self.model.effects[self.layout.free[number].effect].name == name;
        let numbers = 0..self.known.len();
        match moving {
            Moving::All => None,
            Moving::Own(name) => Some(numbers.filter(|&number| is_of(name, number)).collect()),
            Moving::Beside(name) => {
                let of_channel = |channel: Channel| self.layout.channels[channel].free.iter().map(|entry| entry.0);
                let changed = Channel::ALL
                    .into_iter()
                    .filter(|&channel| of_channel(channel).any(|number| number < self.known.len() && is_of(name, number)));
                let beside: BTreeSet<usize> = changed.flat_map(of_channel).collect();
                Some(numbers.filter(|number| beside.contains(number)).collect())
            }
        }
    }

    fn may_move(&self, number: usize, absent: &[usize]) -> bool {
        !self.is_absent(number, absent) && self.movable.as_ref().is_none_or(|movable| movable.contains(&number))
    }

    /// Values of the numbers common to all flights, the others 0; `values` holds those that are not `open`, and the absences.
    fn solve(&self, normal: &Normal, open: &[usize], values: &[f64], damping: f64) -> Option<Vec<f64>> {
        let target = self.size() - 1;
        let fixed: Vec<usize> = (0..target).filter(|at| values[*at] != 0.0 && open.binary_search(at).is_err()).collect();
        let mut matrix = DMatrix::from_fn(open.len(), open.len(), |i, j| normal.matrix[(open[i], open[j])]);
        let mut side = DVector::from_fn(open.len(), |i, _| {
            normal.matrix[(open[i], target)] - fixed.iter().map(|&at| normal.matrix[(open[i], at)] * values[at]).sum::<f64>()
        });
        for (index, &number) in open.iter().enumerate() {
            let (known, now) = (&self.known[number], values[number]);
            let precision = self.correlation * known.precision(damping, now);
            matrix[(index, index)] += precision;
            side[index] += self.correlation
                * (known.precision(0.0, now) * known.centre + (known.precision(damping, now) - known.precision(0.0, now)) * now);
        }
        let scale = DVector::from_fn(open.len(), |index, _| 1.0 / matrix[(index, index)].sqrt());
        if scale.iter().any(|scale| !scale.is_finite()) {
            return None;
        }
        let scaled = DMatrix::from_fn(open.len(), open.len(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let found = Cholesky::new(scaled)?.solve(&side.component_mul(&scale));
        let mut solved = values.to_vec();
        for (index, &number) in open.iter().enumerate() {
            solved[number] = found[index] * scale[index];
        }
        Some(solved)
    }

    /// The model without some effects after a damped step of the others on all blocks; `None` where they do not determine it.
    pub fn without(&self, engine: &Engine<'_>, absent: &[usize]) -> Option<Model> {
        self.step(&self.normal(engine, &self.locals(absent))?, absent, DAMPING)
    }

    fn step(&self, normal: &Normal, absent: &[usize], damping: f64) -> Option<Model> {
        let locals = self.locals(absent);
        let (mut values, mut open) = self.start(absent);
        open.extend((0..self.known.len()).filter(|&at| self.is_on_bound(at) && self.may_move(at, absent)));
        open.sort_unstable();
        let solved = loop {
            let solved = self.solve(normal, &open, &values, damping)?;
            let excess = |at: &usize| self.known[*at].excess(solved[*at]);
            let worst =
                open.iter().copied().filter(|at| excess(at) > 0.0).max_by(|left, right| excess(left).total_cmp(&excess(right)));
            let Some(worst) = worst else { break solved };
            let [low, high] = self.known[worst].bounds;
            values[worst] = solved[worst].clamp(low, high);
            open.retain(|at| *at != worst);
        };
        let mut model = self.model.clone();
        for (number, free) in self.layout.free.iter().enumerate() {
            let effect = &mut model.effects[free.effect];
            if let Some(place) = locals.iter().position(|local| *local == number) {
                let of = |(flight, made_of): (&usize, &DMatrix<f64>)| (self.names[*flight].clone(), own(made_of, &solved)[place]);
                let by_flight: BTreeMap<String, f64> = normal.by_flight.iter().map(of).collect();
                let coefficient = &mut effect.coefficients[free.coefficient];
                coefficient.value = by_flight.values().sum::<f64>() / by_flight.len().max(1) as f64;
                coefficient.by_flight = Some(by_flight);
            } else if let Some((value, _)) = effect.number_mut(free.coefficient) {
                *value = solved[number];
            }
        }
        let gone: Vec<usize> = absent.iter().map(|&place| self.optional[place]).collect();
        let mut index = 0;
        model.effects.retain(|_| {
            index += 1;
            !gone.contains(&(index - 1))
        });
        Some(model)
    }

    /// The best numbers of a model, by damped Gauss-Newton steps, with what is presumed of them.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where the blocks do not determine the numbers of the baseline; as [`Model::predict`].
    pub fn fitted(engine: &Engine<'_>, model: Model, most: usize) -> Result<Model> {
        Self::fitted_in(engine, model, Moving::All, most)
    }

    /// As [`Point::fitted`], with numbers held that are not among the moving.
    ///
    /// # Errors
    /// As [`Point::fitted`].
    pub fn fitted_in(engine: &Engine<'_>, model: Model, moving: Moving<'_>, most: usize) -> Result<Model> {
        let near = |model: Model| {
            let point = Self::at(engine, model, Vec::new())?;
            Ok::<_, Error>(Self { movable: point.movable(moving), ..point })
        };
        let mut point = near(model)?;
        let mut damping = DAMPING;
        for step in 1..=most {
            let Some((model, cost, found)) = point.best_step(engine, damping)? else { break };
            damping = found;
            if point.cost - cost < SETTLED || step == most {
                return Ok(model);
            }
            point = near(model)?;
        }
        Ok(point.model)
    }

    /// The model after the best of some steps, the damping before and after it having been tried, with its cost and damping; `None` where
    /// none lowers the cost.
    fn best_step(&self, engine: &Engine<'_>, damping: f64) -> Result<Option<(Model, f64, f64)>> {
        let normal = self.normal(engine, &self.locals(&[])).ok_or_else(undetermined)?;
        let mut best: Option<(Model, f64, f64)> = None;
        let mut tried = damping / DAMPING_FACTOR;
        while tried <= LARGEST_DAMPING {
            let model = self.step(&normal, &[], tried).ok_or_else(undetermined)?;
            let cost = self.cost_of(engine, &model)?;
            let bar = best.as_ref().map_or(self.cost, |best| best.1);
            if cost < bar {
                best = Some((model, cost, tried));
            } else if best.is_some() {
                break;
            }
            if best.is_some() && tried >= damping {
                break;
            }
            tried *= DAMPING_FACTOR;
        }
        Ok(best)
    }

    /// The cost of the same model with other numbers; infinite where a formula is no number.
    fn cost_of(&self, engine: &Engine<'_>, model: &Model) -> Result<f64> {
        let total = prediction_errors(engine, model)?.map(|errors| errors.iter().sum());
        let cost = self.likelihood(engine, &total).1 + self.prior(engine, model);
        Ok(if cost.is_finite() { cost } else { f64::INFINITY })
    }

    /// Mean squared errors, and minus twice the logarithm of the likelihood in independent samples, but for a constant.
    fn likelihood(&self, engine: &Engine<'_>, sums: &PerChannel<f64>) -> (PerChannel<f64>, f64) {
        let rows = engine.rows().max(1) as f64;
        let mse = sums.map(|sum| (sum / rows).max(f64::MIN_POSITIVE));
        (mse, mse.iter().map(|mse| rows / self.correlation * mse.ln()).sum())
    }

    /// What is presumed of the numbers, as the misfit of a model's.
    fn prior(&self, engine: &Engine<'_>, model: &Model) -> f64 {
        let misfit = |values: &[f64], is_local: bool| {
            let known = self.known.iter().zip(values).filter(|(known, _)| known.is_local == is_local);
            known.map(|(known, value)| known.misfit(*value)).sum::<f64>()
        };
        let of_flights = engine.runs().map(|run| misfit(&self.values_of(model, engine.blocks[run.start].flight), true));
        of_flights.sum::<f64>() + misfit(&self.values_of(model, usize::MAX), false)
    }

    /// Present values, those of effects that are left out and of each flight 0, absences 1; and the numbers within their bounds.
    fn start(&self, absent: &[usize]) -> (Vec<f64>, Vec<usize>) {
        let mut values = self.values(usize::MAX);
        let mut open = Vec::new();
        for (number, value) in values.iter_mut().enumerate().take(self.known.len()) {
            if self.known[number].is_local || self.is_absent(number, absent) {
                *value = 0.0;
            } else if !self.is_on_bound(number) && self.may_move(number, absent) {
                open.push(number);
            }
        }
        absent.iter().for_each(|&place| values[self.known.len() + place] = 1.0);
        (values, open)
    }

    fn is_on_bound(&self, number: usize) -> bool {
        let free = self.layout.free[number];
        let value = self.model.effects[free.effect].number(free.coefficient).map_or(0.0, |number| number.value);
        !self.known[number].is_local && self.known[number].excess(value) >= 0.0
    }

    /// What errors in fold 0 are made of under numbers of each flight that the other fold shows.
    pub fn first_halves(&self, engine: &Engine<'_>, absent: &[usize]) -> Option<Folds> {
        let locals = self.locals(absent);
        let normals = self.normals(engine, &locals, &[Some(0)])?;
        Some(Folds { locals, normals })
    }

    /// What held-out errors are made of where these effects are left out.
    pub fn folds(&self, engine: &Engine<'_>, absent: &[usize]) -> Option<Folds> {
        let locals = self.locals(absent);
        let held: Vec<Option<usize>> = (0..FOLDS).map(Some).collect();
        let normals = self.normals(engine, &locals, &held)?;
        Some(Folds { locals, normals })
    }

    /// Whether leaving out an effect changes which numbers each flight has for itself.
    pub fn has_locals(&self, place: usize) -> bool {
        (0..self.known.len()).any(|at| self.known[at].is_local && self.layout.free[at].effect == self.optional[place])
    }

    /// Squared errors of each block under numbers fitted to the other folds, some effects being left out. Numbers on their bounds stay there.
    pub fn held_out(&self, engine: &Engine<'_>, folds: &Folds, absent: &[usize]) -> Option<Errors> {
        let (start, open) = self.start(absent);
        let mut errors: Errors = PerChannel::from_fn(|_| vec![0.0; engine.blocks.len()]);
        for (fold, normal) in folds.normals.iter().enumerate() {
            let solved = self.solve(normal, &open, &start, 0.0)?;
            self.errors_of_fold(engine, (folds, fold), &solved, &mut errors);
        }
        Some(errors)
    }

    /// The numbers common to all flights, fitted to all blocks, some effects being left out.
    pub fn refitted(&self, engine: &Engine<'_>, absent: &[usize]) -> Option<Vec<f64>> {
        let (start, open) = self.start(absent);
        self.solve(&self.normal(engine, &self.locals(absent))?, &open, &start, 0.0)
    }

    /// The numbers common to all flights as they are, some effects being left out.
    pub fn unchanged(&self, absent: &[usize]) -> Vec<f64> {
        self.start(absent).0
    }

    /// Squared errors of each block under such numbers, found on other flights ([`Point::refitted`] of the same model there); those of each
    /// flight are found from its blocks of other folds, or are those of the model where there is none.
    pub fn errors_under(&self, engine: &Engine<'_>, folds: &Folds, solved: &[f64]) -> Errors {
        let mut errors: Errors = PerChannel::from_fn(|_| vec![0.0; engine.blocks.len()]);
        (0..folds.normals.len()).for_each(|fold| self.errors_of_fold(engine, (folds, fold), solved, &mut errors));
        errors
    }

    fn errors_of_fold(&self, engine: &Engine<'_>, (folds, fold): (&Folds, usize), solved: &[f64], errors: &mut Errors) {
        for run in engine.runs() {
            let mut values = solved.to_vec();
            let flight = engine.blocks[run.start].flight;
            match folds.normals[fold].by_flight.get(&flight) {
                Some(made_of) => {
                    let own = own(made_of, solved);
                    folds.locals.iter().zip(own.iter()).for_each(|(&local, value)| values[local] = *value);
                }
                None => {
                    let present = self.values(flight);
                    folds.locals.iter().for_each(|&local| values[local] = present[local]);
                }
            }
            for block in run.filter(|&block| engine.fold[block] == fold) {
                let found = self.errors(block, &values);
                errors.iter_mut().zip(found).for_each(|(errors, found)| errors[block] = found);
            }
        }
    }

    /// For each effect that may be left out, how little these blocks know of it: the standard error of its best known number in usual sizes.
    pub fn looseness(&self, engine: &Engine<'_>) -> Option<Vec<f64>> {
        let (_, open) = self.start(&[]);
        let normal = self.normal(engine, &self.locals(&[]))?;
        let matrix = DMatrix::from_fn(open.len(), open.len(), |i, j| {
            let prior = if i == j { self.correlation * self.known[open[i]].precision(0.0, 0.0) } else { 0.0 };
            normal.matrix[(open[i], open[j])] + prior
        });
        let inverse = Cholesky::new(matrix)?.inverse();
        let of = |effect: &usize| {
            let own = (0..self.known.len()).filter(|&at| self.layout.free[at].effect == *effect);
            let relative = own.map(|number| {
                // What is on its bound, and what each flight shows of itself, is known.
                let Ok(place) = open.binary_search(&number) else { return 0.0 };
                // Of a number without a usual size none is asked.
                self.known[number].size.map_or(0.0, |size| (self.correlation * inverse[(place, place)]).sqrt() / size)
            });
            relative.fold(f64::INFINITY, f64::min)
        };
        Some(self.optional.iter().map(of).collect())
    }

    /// Channels in which an effect acts.
    pub fn channels(&self, place: usize) -> PerChannel<bool> {
        let column = self.known.len() + place;
        PerChannel::from_fn(|channel| self.reduced[channel].free.contains(&column))
    }
}

/// Why there is no next step.
pub(super) fn undetermined() -> Error {
    Error::Undetermined("the flights do not determine the numbers of the model's own effects".into())
}

/// The numbers of a flight from those common to all.
fn own(made_of: &DMatrix<f64>, solved: &[f64]) -> DVector<f64> {
    let target = solved.len() - 1;
    let common = DVector::from_column_slice(&solved[..target]);
    made_of.column(target) - made_of.columns(0, target) * common
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::candidate::with;
    use super::super::gram::blocks;
    use super::super::gram::tests::{model, near, noise, whole};
    use super::*;
    use crate::flight::Flight;
    use crate::physics::{Effect, calibrate, catalogue};

    pub(super) fn engine(flights: &[Flight]) -> Engine<'_> {
        let blocks = blocks(flights, &whole(flights), 2.0);
        let fold = (0..blocks.len()).map(|block| block % FOLDS).collect();
        Engine { flights, blocks, fold, correlation: 100.0, held: Vec::new() }
    }

    /// An effect at its usual size.
    fn usual(kind: &str) -> Effect {
        let definition = catalogue::definition(kind).expect("in the catalogue");
        let mut effect = definition.effect(4.58, 0.8);
        for (coefficient, known) in effect.coefficients.iter_mut().zip(definition.coefficients) {
            coefficient.value = known.expected.map_or(0.5, |[low, high]| 0.25 * low + 0.75 * high);
        }
        effect
    }

    fn baseline() -> Model {
        let mut model = model();
        for (effect, value) in [("collective_thrust", -20.0), ("control_moment", 30.0)] {
            let effect = model.effects.iter_mut().find(|known| known.name == effect).expect("of the baseline");
            effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = value);
        }
        model
    }

    #[test]
    fn errors_without_an_effect_are_those_of_the_model_that_lacks_it() -> Result<()> {
        let flights = noise(21, &[1200, 900]);
        let engine = engine(&flights);
        let base = with(&with(&baseline(), &usual("cyclic_lag")), &usual("transl_lift"));
        for definition in catalogue::definitions().filter(|definition| definition.notes.is_some_and(|notes| notes.searched)) {
            if base.effect(definition.kind).is_some() || usual(definition.kind).reads_rotors() {
                continue;
            }
            let whole = with(&base, &usual(definition.kind));
            let place = whole.effects.len() - 1;
            let point = Point::at(&engine, whole.clone(), vec![place])?;
            for (absent, model) in [(&[][..], &whole), (&[0][..], &base)] {
                let expected = prediction_errors(&engine, model)?;
                for (block, cut) in engine.blocks.iter().enumerate() {
                    let mut values = point.values(cut.flight);
                    (0..point.known.len())
                        .filter(|number| point.is_absent(*number, absent))
                        .for_each(|number| values[number] = 0.0);
                    absent.iter().for_each(|place| values[point.known.len() + place] = 1.0);
                    let found = point.errors(block, &values);
                    for (channel, &found) in found.pairs() {
                        let scale = expected[channel][block].max(1.0);
                        let difference = (found - expected[channel][block]).abs() / scale;
                        assert!(difference < 1e-6, "{} channel {channel}: {found} {}", definition.kind, expected[channel][block]);
                    }
                }
            }
        }
        Ok(())
    }

    #[test]
    fn a_linear_model_is_fitted_as_calibration_does_and_its_folds_as_the_search() -> Result<()> {
        let flights = noise(22, &[4000, 3000]);
        let engine = engine(&flights);
        let (calibrated, _) = calibrate(&model(), &flights, &whole(&flights))?;
        let fitted = Point::fitted(&engine, model(), 10)?;
        let best = Point::at(&engine, calibrated, Vec::new())?.cost;
        let mut point = Point::at(&engine, fitted, Vec::new())?;
        assert!((best - 1e-6..best + SETTLED).contains(&point.cost), "{} {best}", point.cost);
        let folds = point.folds(&engine, &[]).expect("determined");
        let errors = point.held_out(&engine, &folds, &[]).expect("determined");
        let expected = engine.pass(&model(), &[])?.base.errors;
        errors.iter().zip(&expected).for_each(|(errors, expected)| assert!(near(errors, expected)));
        point.note_intervals(&folds);
        let intervals = point.model.effects.iter().flat_map(|effect| &effect.coefficients).map(|coefficient| coefficient.ci95);
        let widths: Vec<f64> = intervals.map(|ci95| ci95.map_or(f64::NAN, |[low, high]| high - low)).collect();
        assert!(widths.iter().all(|width| *width > 0.0 && *width < 1.0), "{widths:?}");
        Ok(())
    }

    #[test]
    fn numbers_stay_within_their_bounds() -> Result<()> {
        // Data of a drag that pushes: the bound is at none.
        let truth = Effect { kind: "quad_drag".into(), ..usual("quad_drag") };
        let mut pushing = truth.clone();
        pushing.coefficients.iter_mut().for_each(|coefficient| coefficient.value = 0.05);
        let mut flights = noise(23, &[4000]);
        for flight in &mut flights {
            let predicted = with(&baseline(), &pushing).predict(flight)?;
            *flight = flight.with_accelerations(&predicted)?;
        }
        let fitted = Point::fitted(&engine(&flights), with(&baseline(), &truth), 10)?;
        let drag = fitted.effect("quad_drag").expect("still in");
        assert!(drag.coefficients.iter().all(|coefficient| coefficient.value <= 0.0), "{drag}");
        Ok(())
    }
}
