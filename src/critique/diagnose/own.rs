//! Numbers that each flight has for itself (wind, a bias) on flights that no fit has seen: found from a flight's first half, so that its second
//! half can judge, or both ways round. Nothing else is fitted here, and nothing judged.

use super::engine::{Engine, Errors, FOLDS};
use super::gates::CORRELATION_S;
use super::gram::blocks;
use super::known::size_of;
use crate::error::Result;
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::formula::Node;
use crate::physics::{Columns, Model, Regressor, Wanted};
use nalgebra::{Cholesky, DMatrix, DVector};
use std::collections::BTreeMap;

/// Gauss-Newton steps, at most; wind bends the columns a little.
const MOST_STEPS: usize = 6;

/// Settled, when no number moves by more than this share of its usual size.
const SETTLED: f64 = 1e-3;

/// Models on flights that no fit has seen.
#[derive(Clone, Debug)]
pub struct Met {
    /// The models, with the numbers that these flights have for themselves.
    pub models: Vec<Model>,
    /// What is left to judge them by.
    pub judged: Vec<Span>,
    /// Whether that leaves out first halves.
    pub own_from_first_half: bool,
}

/// Finds what flights have for themselves (wind, biases) for models that no fit has shown these flights: from the first half of each, so that the
/// second half can judge. Where no model has such numbers, or all are known, everything is judged.
///
/// # Errors
/// As [`Model::predict`].
pub fn met(flights: &[Flight], models: &[&Model], spans: &[Span]) -> Result<Met> {
    Halves::of(flights, models, spans).all_met(flights, models)
}

/// As [`met`], and then the other way round, where there are such flights: their second halves give the numbers and the first halves are judged, so
/// that all is judged by numbers that it had no part in.
///
/// # Errors
/// As [`Model::predict`].
pub fn met_both_ways(flights: &[Flight], models: &[&Model], spans: &[Span]) -> Result<Vec<Met>> {
    let Halves { seen, first, second } = Halves::of(flights, models, spans);
    let mut both = vec![Halves { seen, first: first.clone(), second: second.clone() }.all_met(flights, models)?];
    if !first.is_empty() {
        both.push(Halves { seen: Vec::new(), first: second, second: first }.all_met(flights, models)?);
    }
    Ok(both)
}

/// Spans of flights that some fit has seen, or that need no numbers of their own; and of the others the first halves, and the second.
#[derive(Clone, Debug, Default)]
pub(super) struct Halves {
    pub seen: Vec<Span>,
    pub first: Vec<Span>,
    pub second: Vec<Span>,
}

impl Halves {
    pub fn of(flights: &[Flight], models: &[&Model], spans: &[Span]) -> Self {
        let mut halves = Self::default();
        for (flight, log) in flights.iter().enumerate() {
            let mut own: Vec<Span> = spans.iter().filter(|span| span.flight == flight).copied().collect();
            if models
                .iter()
                .all(|model| own_numbers(model).into_iter().all(|(effect, index)| is_known(model, effect, index, &log.name)))
            {
                halves.seen.extend(own);
                continue;
            }
            own.sort_unstable_by_key(|span| span.start);
            let total: usize = own.iter().map(|span| span.end - span.start).sum();
            let mut left = total / 2;
            for span in own {
                let middle = span.start + left.min(span.end - span.start);
                left -= middle - span.start;
                halves.first.extend((span.start < middle).then_some(Span { end: middle, ..span }));
                halves.second.extend((middle < span.end).then_some(Span { start: middle, ..span }));
            }
        }
        halves
    }

    fn all_met(&self, flights: &[Flight], models: &[&Model]) -> Result<Met> {
        let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
        let met = |model: &&Model| self.met(flights, model, 2.0 * CORRELATION_S / step_s);
        let models = models.iter().map(met).collect::<Result<_>>()?;
        Ok(Met { models, judged: self.judged(), own_from_first_half: !self.first.is_empty() })
    }

    /// What is judged.
    pub fn judged(&self) -> Vec<Span> {
        self.seen.iter().chain(&self.second).copied().collect()
    }

    /// Blocks of what is judged, in fold 0, and of the first halves, in fold 1.
    pub fn engine<'a>(&self, flights: &'a [Flight], block_s: f64, correlation: f64) -> Engine<'a> {
        let mut cut: Vec<_> = blocks(flights, &self.judged(), block_s).into_iter().map(|block| (block, 0)).collect();
        cut.extend(blocks(flights, &self.first, block_s).into_iter().map(|block| (block, 1)));
        cut.sort_unstable_by_key(|(block, _)| (block.flight, block.start));
        let (blocks, fold) = cut.into_iter().unzip();
        Engine { flights, blocks, fold, correlation, held: Vec::new() }
    }

    /// The model with the numbers that the flights have for themselves, from their first halves.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn met(&self, flights: &[Flight], model: &Model, correlation: f64) -> Result<Model> {
        let numbers = own_numbers(model);
        let mut met = model.clone();
        if numbers.is_empty() || self.first.is_empty() {
            return Ok(met);
        }
        let expected: Vec<Expected> = numbers.iter().map(|&(effect, index)| Expected::of(model, effect, index)).collect();
        for _ in 0..MOST_STEPS {
            if step(flights, &self.first, &mut met, (&numbers, &expected), correlation)? < SETTLED {
                break;
            }
        }
        Ok(met)
    }
}

/// What is expected of a number of a flight before that flight has said anything.
#[derive(Clone, Copy, Debug)]
struct Expected {
    centre: f64,
    size: f64,
}

impl Expected {
    /// Around the mean of the flights that are known, which is held near zero itself as one more flight would be: n flights of mean m lead to m n / (n + 1).
    fn of(model: &Model, effect: usize, index: usize) -> Self {
        let known = &model.effects[effect].coefficients[index];
        let flights = known.by_flight.as_ref().map_or(0, BTreeMap::len) as f64;
        Self { centre: known.value * flights / (flights + 1.0), size: size_of(model, effect, index) }
    }
}

/// Numbers that each flight has for itself: index of the effect, and in it.
fn own_numbers(model: &Model) -> Vec<(usize, usize)> {
    let enabled = model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled);
    let of = |(index, effect): (usize, &crate::physics::Effect)| {
        let own = effect.coefficients.iter().enumerate().filter(|(_, coefficient)| coefficient.by_flight.is_some());
        own.map(|(number, _)| (index, number)).collect::<Vec<_>>()
    };
    enabled.flat_map(of).collect()
}

fn is_known(model: &Model, effect: usize, index: usize, flight: &str) -> bool {
    model.effects[effect].coefficients[index].own_in_flight(flight).is_some()
}

/// What one flight says of its own numbers, by channel: `JᵀJ`, `Jᵀr` and `rᵀr`.
type Sums = PerChannel<(DMatrix<f64>, DVector<f64>, f64)>;

/// A model's predictions and their derivatives by the numbers that each flight has for itself.
struct OwnColumns {
    columns: Columns,
    /// Predictions of the six channels, then the derivatives.
    nodes: Vec<Node>,
    /// By channel: which number, and where its derivative stands in `nodes`.
    by_channel: PerChannel<Vec<(usize, usize)>>,
    numbers: usize,
}

impl OwnColumns {
    fn of(model: &Model, numbers: &[(usize, usize)]) -> Result<Self> {
        let mut columns = Columns::default();
        let mut regressors: Vec<Regressor> = Vec::new();
        for (place, &(effect, _)) in numbers.iter().enumerate() {
            if place == 0 || numbers[place - 1].0 != effect {
                let own = columns.regressors(model, Wanted { effect: Some(effect), ..Wanted::default() })?;
                let is_own = |one: &Regressor| one.number.is_some_and(|number| numbers.contains(&(effect, number)));
                regressors.extend(own.into_iter().filter(is_own));
            }
        }
        let mut nodes: Vec<Node> = columns.predictions(model)?.values().to_vec();
        let first = nodes.len();
        nodes.extend(regressors.iter().map(|regressor| regressor.node));
        let place = |one: &Regressor| numbers.iter().position(|number| Some(number.1) == one.number && number.0 == one.effect);
        let of_channel = |channel: Channel| {
            let own = regressors.iter().enumerate().filter(|(_, one)| one.channel == channel);
            own.filter_map(|(column, one)| Some((place(one)?, first + column))).collect()
        };
        let by_channel = PerChannel::from_fn(of_channel);
        Ok(Self { columns, nodes, by_channel, numbers: numbers.len() })
    }

    /// What some spans of one flight say.
    fn sums(&self, log: &Flight, spans: &[&Span]) -> Result<Sums> {
        let end = spans.iter().map(|span| span.end).max().unwrap_or(0);
        let empty = || (DMatrix::zeros(self.numbers, self.numbers), DVector::zeros(self.numbers), 0.0);
        let mut sums: Sums = PerChannel::from_fn(|_| empty());
        let dot = |left: &[f64], right: &[f64]| left.iter().zip(right).map(|(left, right)| left * right).sum::<f64>();
        self.columns.evaluate(&self.nodes, log, end, &mut |range, values| {
            for span in spans {
                for rows in log.counted(span.start.max(range.start)..span.end.min(range.end)) {
                    let part = rows.start - range.start..rows.end - range.start;
                    for (channel, (matrix, side, square)) in sums.pairs_mut() {
                        let measured = &log.column(channel.column())[rows.clone()];
                        let predicted = &values.column(channel.index())[part.clone()];
                        let rest: Vec<f64> = measured.iter().zip(predicted).map(|(measured, value)| measured - value).collect();
                        *square += dot(&rest, &rest);
                        for &(i, left) in &self.by_channel[channel] {
                            let left = &values.column(left)[part.clone()];
                            side[i] += dot(left, &rest);
                            for &(j, right) in &self.by_channel[channel] {
                                matrix[(i, j)] += dot(left, &values.column(right)[part.clone()]);
                            }
                        }
                    }
                }
            }
            Ok(())
        })?;
        Ok(sums)
    }
}

/// One step for all flights; by how much a number moved at most, in usual sizes.
fn step(
    flights: &[Flight],
    spans: &[Span],
    model: &mut Model,
    (numbers, expected): (&[(usize, usize)], &[Expected]),
    correlation: f64,
) -> Result<f64> {
    let columns = OwnColumns::of(model, numbers)?;
    let mut order: Vec<usize> = spans.iter().map(|span| span.flight).collect();
    order.sort_unstable();
    order.dedup();
    let one = |&flight: &usize| {
        let own: Vec<&Span> = spans.iter().filter(|span| span.flight == flight).collect();
        columns.sums(&flights[flight], &own)
    };
    #[cfg(feature = "rayon")]
    let found: Vec<Sums> = {
        use rayon::prelude::*;
        order.par_iter().with_max_len(1).map(one).collect::<Result<_>>()?
    };
    #[cfg(not(feature = "rayon"))]
    let found: Vec<Sums> = order.iter().map(one).collect::<Result<_>>()?;
    let rows: usize = spans.iter().map(|span| flights[span.flight].count(span.start..span.end)).sum();
    let mse = PerChannel::from_fn(|channel| found.iter().map(|sums| sums[channel].2).sum::<f64>() / rows.max(1) as f64);
    let mut moved = 0.0_f64;
    for (&flight, sums) in order.iter().zip(&found) {
        let name = &flights[flight].name;
        let value = |&(effect, index): &(usize, usize)| model.effects[effect].coefficients[index].in_flight(name);
        let now = DVector::from_iterator(numbers.len(), numbers.iter().map(value));
        // A flight without any error says nothing that a computer can hold.
        let Some(change) = change(sums, &mse, &now, expected, correlation) else { continue };
        for (place, &(effect, index)) in numbers.iter().enumerate() {
            moved = moved.max(change[place].abs() / expected[place].size);
            if let Some(values) = &mut model.effects[effect].coefficients[index].by_flight {
                values.insert(name.clone(), now[place] + change[place]);
            }
        }
    }
    Ok(moved)
}

/// By how much the numbers of a flight change, channels weighted by the inverse of their error, each number held near what is expected by its usual size;
/// `None` where the equations have no finite solution.
fn change(sums: &Sums, mse: &PerChannel<f64>, now: &DVector<f64>, expected: &[Expected], correlation: f64) -> Option<DVector<f64>> {
    let (mut matrix, mut side) = (DMatrix::zeros(now.len(), now.len()), DVector::zeros(now.len()));
    for ((own, right, _), mse) in sums.iter().zip(mse) {
        matrix += own / mse.max(f64::MIN_POSITIVE);
        side += right / mse.max(f64::MIN_POSITIVE);
    }
    for (place, Expected { centre, size }) in expected.iter().enumerate() {
        let precision = correlation / (size * size);
        matrix[(place, place)] += precision;
        side[place] += precision * (centre - now[place]);
    }
    Cholesky::new(matrix).map(|factor| factor.solve(&side)).filter(|change| change.iter().all(|number| number.is_finite()))
}

/// Squared errors of a model's predictions, by channel and block.
///
/// # Errors
/// As [`Model::predict`].
pub(super) fn prediction_errors(engine: &Engine<'_>, model: &Model) -> Result<Errors> {
    let mut columns = Columns::default();
    let nodes = columns.predictions(model)?;
    let runs: Vec<_> = engine.blocks.chunk_by(|left, right| left.flight == right.flight).collect();
    let one = |run: &&[super::gram::Block]| -> Result<Vec<PerChannel<f64>>> {
        let flight = &engine.flights[run[0].flight];
        let end = run.iter().map(|block| block.end).max().unwrap_or(0);
        let mut sums = vec![PerChannel::splat(0.0); run.len()];
        columns.evaluate(nodes.values(), flight, end, &mut |range, values| {
            for (block, sums) in run.iter().zip(&mut sums) {
                for rows in flight.counted(block.start.max(range.start)..block.end.min(range.end)) {
                    for (channel, sum) in sums.pairs_mut() {
                        let measured = &flight.column(channel.column())[rows.clone()];
                        let predicted = &values.column(channel.index())[rows.start - range.start..rows.end - range.start];
                        *sum += measured.iter().zip(predicted).map(|(measured, value)| (measured - value).powi(2)).sum::<f64>();
                    }
                }
            }
            Ok(())
        })?;
        Ok(sums)
    };
    #[cfg(feature = "rayon")]
    let sums: Vec<Vec<PerChannel<f64>>> = {
        use rayon::prelude::*;
        runs.par_iter().with_max_len(1).map(one).collect::<Result<_>>()?
    };
    #[cfg(not(feature = "rayon"))]
    let sums: Vec<Vec<PerChannel<f64>>> = runs.iter().map(one).collect::<Result<_>>()?;
    let flat: Vec<PerChannel<f64>> = sums.into_iter().flatten().collect();
    Ok(PerChannel::from_fn(|channel| flat.iter().map(|sums| sums[channel]).collect()))
}

/// Errors of some models on the same blocks.
pub(super) struct Judgement {
    /// Samples of each block.
    pub counts: Vec<usize>,
    /// Of each model.
    pub errors: Vec<Errors>,
}

/// Squared errors of each model on the judged blocks; `None` without a sample.
///
/// # Errors
/// As [`Model::predict`].
pub(super) fn judged_errors(
    flights: &[Flight],
    models: &[&Model],
    halves: &Halves,
    block_s: f64,
    correlation: f64,
) -> Result<Option<Judgement>> {
    let cut = blocks(flights, &halves.judged(), block_s);
    if cut.is_empty() {
        return Ok(None);
    }
    let counts = cut.iter().map(|block| block.count(flights)).collect();
    let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
    let engine = Engine { flights, blocks: cut, fold, correlation, held: Vec::new() };
    let one = |model: &Model| prediction_errors(&engine, &halves.met(flights, model, correlation)?);
    Ok(Some(Judgement { counts, errors: models.iter().copied().map(one).collect::<Result<_>>()? }))
}

#[cfg(test)]
mod tests {
    use super::super::candidate::with;
    use super::super::gram::tests::{model, near, noise, whole};
    use super::*;
    use crate::flight::Column;
    use crate::physics::catalogue;

    /// A model whose every number acts.
    fn flying() -> Model {
        let mut model = model();
        model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).for_each(|coefficient| coefficient.value = -0.5);
        model
    }

    /// Flights whose forward velocity is recorded with a bias of their own, and a little noise; and the model that knows of biases.
    fn biased(biases: &[f64]) -> Result<(Vec<Flight>, Model)> {
        let mut flights = noise(11, &vec![8000; biases.len()]);
        let bias = catalogue::definition("sensor_bias").map(|definition| definition.effect(4.58, 0.8)).expect("in the catalogue");
        let mut truth = with(&flying(), &bias);
        let named: std::collections::BTreeMap<String, f64> =
            flights.iter().map(|flight| flight.name.clone()).zip(biases.iter().copied()).collect();
        truth.effects.last_mut().expect("it has effects").coefficients[0].by_flight = Some(named);
        for flight in &mut flights {
            let mut accelerations = truth.predict(flight)?;
            for (values, target) in accelerations.iter_mut().zip(Column::TARGETS) {
                values.iter_mut().zip(flight.column(target)).for_each(|(value, noise)| *value += 0.02 * noise);
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        Ok((flights, with(&flying(), &bias)))
    }

    #[test]
    fn a_new_flight_is_judged_on_its_second_half_by_every_model() -> Result<()> {
        let biases = [0.3, -0.2];
        let (flights, knows) = biased(&biases)?;
        let models = [&flying(), &knows];
        let halves = Halves::of(&flights, &models, &whole(&flights));
        assert!(halves.seen.is_empty());
        let ends: Vec<[usize; 2]> =
            halves.first.iter().zip(&halves.second).map(|(first, second)| [first.end, second.start]).collect();
        assert_eq!(ends, [[4000, 4000]; 2]);
        let met = halves.met(&flights, &knows, 100.0)?;
        let found = met.effect("sensor_bias").and_then(|effect| effect.coefficients.first()?.by_flight.clone()).unwrap_or_default();
        for (flight, bias) in flights.iter().zip(biases) {
            // Shrunk a little by what is usual.
            let value = found.get(&flight.name).copied().unwrap_or(f64::NAN);
            assert!((value - bias).abs() < 0.1 * bias.abs(), "{value} for {bias}");
        }
        let judged = judged_errors(&flights, &models, &halves, 10.0, 100.0)?.expect("two halves");
        assert_eq!(judged.counts.iter().sum::<usize>(), 8000);
        let sums: Vec<f64> = judged.errors.iter().map(|errors| errors[Channel::VxDot].iter().sum()).collect();
        assert!(sums[1] < 0.1 * sums[0], "{sums:?}");
        Ok(())
    }

    #[test]
    fn a_flight_whose_numbers_are_known_is_judged_whole() -> Result<()> {
        let (flights, mut knows) = biased(&[0.3, -0.2])?;
        for coefficient in &mut knows.effects.last_mut().expect("it has effects").coefficients {
            coefficient.by_flight = Some(flights.iter().map(|flight| (flight.name.clone(), 0.0)).collect());
        }
        let halves = Halves::of(&flights, &[&flying(), &knows], &whole(&flights));
        assert_eq!((halves.seen.len(), halves.first.len(), halves.second.len()), (2, 0, 0));
        Ok(())
    }

    #[test]
    fn errors_of_predictions_are_those_of_predicting() -> Result<()> {
        let flights = noise(3, &[3000, 1700]);
        let halves = Halves::of(&flights, &[&model()], &whole(&flights));
        let engine = halves.engine(&flights, 5.0, 100.0);
        let errors = prediction_errors(&engine, &model())?;
        for (index, block) in engine.blocks.iter().enumerate() {
            let flight = &flights[block.flight];
            let predicted = model().predict(flight)?;
            for (channel, values) in predicted.pairs() {
                let measured = &flight.column(channel.column())[block.start..block.end];
                let sum: f64 = measured.iter().zip(&values[block.start..block.end]).map(|(y, f)| (y - f).powi(2)).sum();
                assert!(near(&[errors[channel][index]], &[sum]));
            }
        }
        Ok(())
    }
}
