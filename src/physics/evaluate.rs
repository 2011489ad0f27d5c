//! A model at work: its terms bound to the columns they read, block by block over a flight or one sample at a time.
//!
//! Both ways run the same compiled formulas, so they give the same bits. Which numbers multiply the terms is the model's
//! business; fitting them is calibration's.

use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::derived::Derived;
use crate::flight::{Accelerations, Column, Flight};
use crate::formula::{Formula, StreamingFormula, Value};
use std::ops::Range;

/// Samples of a flight evaluated at once.
const BLOCK: usize = 1024;

/// Names that formulas may use on every log: the 16 state and control columns and the derived quantities.
pub fn standard_names() -> Vec<&'static str> {
    Column::STATE.iter().map(|column| column.name()).chain(Derived::ALL.iter().map(|derived| derived.name())).collect()
}

/// A standard quantity of a whole flight by name: a column of the log, its own further columns, or a derived quantity.
pub fn quantity(flight: &Flight, name: &str) -> Option<Vec<f64>> {
    if let Some(column) = flight.named(name) {
        return Some(column.to_vec());
    }
    let derived = Derived::from_name(name)?;
    let mut values = Vec::with_capacity(flight.len());
    derived.extend(&state_columns(flight, 0..flight.len()), &|sample| flight.time_s(sample), flight.len(), &mut values);
    Some(values)
}

/// A standard quantity of one sample by name, for streams; `state` in the order of [`Column::STATE`].
pub fn quantity_at(state: &[f64; 16], time_s: f64, name: &str) -> Option<f64> {
    if let Some(column) = Column::STATE.iter().find(|column| column.name() == name) {
        return state.get(*column as usize).copied();
    }
    let derived = Derived::from_name(name)?;
    let columns = std::array::from_fn(|index| state.get(index..=index).unwrap_or_default());
    let mut value = Vec::with_capacity(1);
    derived.extend(&columns, &|_| time_s, 1, &mut value);
    value.first().copied()
}

/// A formula of standard quantities on a whole flight.
///
/// # Errors
/// [`Error::Formula`] pointing at a name that the flight lacks.
pub fn evaluate(formula: &Formula, flight: &Flight) -> Result<Vec<f64>> {
    formula.evaluate(flight.len(), flight.step_s, &|name| quantity(flight, name).map(Value::from))
}

/// The state columns of some samples of a flight.
fn state_columns(flight: &Flight, range: Range<usize>) -> [&[f64]; 16] {
    std::array::from_fn(|index| {
        Column::STATE.get(index).and_then(|column| flight.column(*column).get(range.clone())).unwrap_or_default()
    })
}

/// What is done with a block: its range of samples, and one column a term.
pub type Visit<'a> = dyn FnMut(Range<usize>, &[Vec<f64>]) -> Result<()> + 'a;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    State(Column),
    Derived(Derived),
    Extra(usize),
}

/// Where a term belongs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Index of the effect in the model.
    pub effect: usize,
    /// Index of the coefficient in the effect; `None` is a fixed 1.
    pub coefficient: Option<usize>,
    /// Index into [`Column::TARGETS`].
    pub channel: usize,
}

#[derive(Clone, Debug)]
struct CompiledTerm {
    place: Place,
    factor: f64,
    formula: StreamingFormula,
    /// Indices into the sources, in the order of the formula's inputs.
    inputs: Vec<usize>,
}

/// A model's enabled terms, bound to a step.
#[derive(Clone, Debug)]
pub(super) struct Program {
    sources: Vec<Source>,
    /// Names of the log's further columns that the model reads.
    extras: Vec<String>,
    terms: Vec<CompiledTerm>,
    step_s: f64,
}

impl Program {
    /// `extra` lists the further columns that are there; `None` accepts any name as one. `flight` names the flight, if it is known,
    /// for coefficients that differ from flight to flight.
    fn compile(model: &Model, step_s: f64, extra: Option<&[&str]>, flight: Option<&str>) -> Result<Self> {
        model.check()?;
        let mut program = Self { sources: Vec::new(), extras: Vec::new(), terms: Vec::new(), step_s };
        for (effect_index, effect) in model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled) {
            for term in &effect.terms {
                let regressor = model.effective_regressor(effect, &term.regressor)?;
                let constant = |name: &str| model.constant(effect, name);
                if let Some(extra) = extra {
                    let constants = effect.parameters.iter().map(|parameter| parameter.name.as_str()).chain(Model::CONSTANTS);
                    let mut known: Vec<&str> = standard_names().into_iter().chain(extra.iter().copied()).chain(constants).collect();
                    known.extend(regressor.names().into_iter().filter(|name| model.constant(effect, name).is_some()));
                    regressor.check_names(&known).map_err(|error| effect.name_error(error))?;
                }
                let formula = regressor.stream_with(step_s, &constant).map_err(|error| effect.name_error(error))?;
                let inputs = formula.inputs().iter().map(|name| program.source(name)).collect();
                let coefficient =
                    term.coefficient.as_ref().and_then(|name| effect.coefficients.iter().position(|c| c.name == *name));
                let factor = coefficient
                    .and_then(|index| effect.coefficients.get(index))
                    .map_or(1.0, |coefficient| flight.map_or(coefficient.value, |flight| coefficient.in_flight(flight)));
                let place = Place { effect: effect_index, coefficient, channel: term.channel };
                program.terms.push(CompiledTerm { place, factor, formula, inputs });
            }
        }
        Ok(program)
    }

    /// Formulas without constants, each a term of its own.
    pub(super) fn of_formulas(formulas: &[Formula], flight: &Flight) -> Result<Self> {
        let mut program = Self { sources: Vec::new(), extras: Vec::new(), terms: Vec::new(), step_s: flight.step_s };
        let known: Vec<&str> = standard_names().into_iter().chain(flight.extra.keys().map(String::as_str)).collect();
        for formula in formulas {
            formula.check_names(&known)?;
            if let Some(error) = formula.refused_name(&|name| flight.gives_target_away(name)) {
                return Err(error);
            }
            let formula = formula.stream(flight.step_s)?;
            let inputs = formula.inputs().iter().map(|name| program.source(name)).collect();
            let place = Place { effect: 0, coefficient: None, channel: 0 };
            program.terms.push(CompiledTerm { place, factor: 1.0, formula, inputs });
        }
        Ok(program)
    }

    /// Compiles for one flight, refusing what the flight does not carry.
    pub(super) fn for_flight(model: &Model, flight: &Flight) -> Result<Self> {
        let extra: Vec<&str> = flight.extra.keys().map(String::as_str).collect();
        let program = Self::compile(model, flight.step_s, Some(&extra), Some(&flight.name))?;
        for term in &program.terms {
            for source in term.inputs.iter().filter_map(|&input| program.sources.get(input)) {
                let reads: &[Column] = match source {
                    Source::State(column) => std::slice::from_ref(column),
                    Source::Derived(derived) => derived.reads(),
                    Source::Extra(_) => &[],
                };
                let name = match source {
                    Source::State(column) => column.name(),
                    Source::Derived(derived) => derived.name(),
                    Source::Extra(index) => program.extras.get(*index).map_or("", String::as_str),
                };
                if let Some(reason) = flight.gives_target_away(name) {
                    let effect = model.effects.get(term.place.effect).map_or("?", |effect| effect.name.as_str());
                    return Err(Error::Log {
                        path: (&flight.name).into(),
                        found: format!("effect `{effect}`, which reads `{name}`: {reason}"),
                        expected: "effects of measured states and controls, which predict accelerations and are not made of them"
                            .into(),
                    });
                }
                if let Some(column) = reads.iter().find(|column| flight.absent.contains(column)) {
                    let effect = model.effects.get(term.place.effect).map_or("?", |effect| effect.name.as_str());
                    return Err(Error::Log {
                        path: (&flight.name).into(),
                        found: format!("no column `{}`", column.name()),
                        expected: format!("it, because effect `{effect}` reads it; log it or set `enabled = false` on the effect"),
                    });
                }
            }
        }
        Ok(program)
    }

    fn source(&mut self, name: &str) -> usize {
        let source = if let Some(column) = Column::STATE.iter().find(|column| column.name() == name) {
            Source::State(*column)
        } else if let Some(derived) = Derived::from_name(name) {
            Source::Derived(derived)
        } else {
            let known = self.extras.iter().position(|extra| extra == name);
            Source::Extra(known.unwrap_or_else(|| {
                self.extras.push(name.into());
                self.extras.len() - 1
            }))
        };
        self.sources.iter().position(|known| *known == source).unwrap_or_else(|| {
            self.sources.push(source);
            self.sources.len() - 1
        })
    }

    /// The terms' places, in the order in which blocks come.
    pub(super) fn places(&self) -> impl Iterator<Item = Place> + '_ {
        self.terms.iter().map(|term| term.place)
    }

    /// Runs from the flight's first sample to `end`, and hands over each block's range and its values, one column a term.
    pub(super) fn run(&mut self, flight: &Flight, end: usize, visit: &mut Visit<'_>) -> Result<()> {
        let end = end.min(flight.len());
        let Self { sources, extras, terms, .. } = self;
        let whole: Vec<&[f64]> = sources
            .iter()
            .map(|source| match source {
                Source::State(column) => flight.column(*column),
                Source::Extra(index) => extras.get(*index).and_then(|name| flight.named(name)).unwrap_or_default(),
                Source::Derived(_) => &[],
            })
            .collect();
        let mut derived: Vec<Vec<f64>> = vec![Vec::new(); sources.len()];
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); terms.len()];
        for start in (0..end).step_by(BLOCK) {
            let range = start..(start + BLOCK).min(end);
            let state = state_columns(flight, range.clone());
            for (buffer, source) in derived.iter_mut().zip(sources.iter()) {
                if let Source::Derived(kind) = source {
                    buffer.clear();
                    kind.extend(&state, &|sample| flight.time_s(start + sample), range.len(), buffer);
                }
            }
            let mut columns: Vec<&[f64]> = Vec::new();
            for (term, values) in terms.iter_mut().zip(&mut values) {
                columns.clear();
                for &input in &term.inputs {
                    columns.push(match sources.get(input) {
                        Some(Source::Derived(_)) => derived.get(input).map(Vec::as_slice).unwrap_or_default(),
                        _ => whole.get(input).and_then(|column| column.get(range.clone())).unwrap_or_default(),
                    });
                }
                values.resize(range.len(), 0.0);
                term.formula.extend(&columns, values)?;
            }
            visit(range, &values)?;
        }
        Ok(())
    }
}

/// A value of a model that is no number, as an error that says where.
pub(super) fn not_finite(model: &Model, flight: &Flight, place: Place, sample: usize) -> Error {
    let effect = model.effects.get(place.effect).map_or("?", |effect| effect.name.as_str());
    let channel = Column::TARGETS.get(place.channel).map_or("?", |column| column.name());
    Error::Undetermined(format!(
        "effect `{effect}` is not a finite number for `{channel}` in flight `{}` at t = {:.3} s; guard its formula, for example \
         `max(height, 0.1)`",
        flight.name,
        flight.time_s(sample)
    ))
}

/// Predicted accelerations of a whole flight.
pub(super) fn predict(model: &Model, flight: &Flight) -> Result<Accelerations> {
    let mut program = Program::for_flight(model, flight)?;
    let factors: Vec<(Place, f64)> = program.terms.iter().map(|term| (term.place, term.factor)).collect();
    let mut predicted: Accelerations = std::array::from_fn(|_| vec![0.0; flight.len()]);
    program.run(flight, flight.len(), &mut |range, values| {
        for ((place, factor), values) in factors.iter().zip(values) {
            let Some(sums) = predicted.get_mut(place.channel).and_then(|sums| sums.get_mut(range.clone())) else { continue };
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += factor * value;
            }
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(not_finite(model, flight, *place, range.start + at));
            }
        }
        Ok(())
    })?;
    Ok(predicted)
}

/// A model that takes one sample at a time, for real-time use. Samples come in order, one step apart.
#[derive(Clone, Debug)]
pub struct StreamingModel {
    program: Program,
    start_s: f64,
    samples: usize,
    /// One number a source.
    values: Vec<f64>,
    /// One number an input of the term at hand.
    inputs: Vec<f64>,
}

impl StreamingModel {
    pub(super) fn new(model: &Model, step_s: f64) -> Result<Self> {
        Ok(Self {
            program: Program::compile(model, step_s, None, None)?,
            start_s: 0.0,
            samples: 0,
            values: Vec::new(),
            inputs: Vec::new(),
        })
    }

    /// Names of the log's further columns that the model reads; [`StreamingModel::push_with`] takes them in this order. Empty
    /// unless a formula names one.
    pub fn extra_inputs(&self) -> &[String] {
        &self.program.extras
    }

    /// Starts anew: the next sample is the first one, at time `start_s`.
    pub fn reset(&mut self, start_s: f64) {
        self.program.terms.iter_mut().for_each(|term| term.formula.reset());
        (self.start_s, self.samples) = (start_s, 0);
    }

    /// Predicted accelerations (m/s², rad/s², order of [`Column::TARGETS`]) at the next sample; `state` in the order of
    /// [`Column::STATE`].
    ///
    /// # Errors
    /// [`Error::Shape`] if the model reads further columns.
    pub fn push(&mut self, state: &[f64; 16]) -> Result<[f64; 6]> {
        self.push_with(state, &[])
    }

    /// As [`StreamingModel::push`], with one number for each of [`StreamingModel::extra_inputs`].
    ///
    /// # Errors
    /// [`Error::Shape`] if their count differs.
    pub fn push_with(&mut self, state: &[f64; 16], extra: &[f64]) -> Result<[f64; 6]> {
        let Program { sources, extras, terms, step_s } = &mut self.program;
        if extra.len() != extras.len() {
            let message = format!("{} further values for the columns {extras:?}", extra.len());
            return Err(Error::Shape { operation: "streaming model", message });
        }
        let time_s = self.start_s + *step_s * self.samples as f64;
        self.samples += 1;
        let columns: [&[f64]; 16] = std::array::from_fn(|index| state.get(index..=index).unwrap_or_default());
        self.values.clear();
        for source in sources.iter() {
            match source {
                Source::State(column) => self.values.push(state.get(*column as usize).copied().unwrap_or_default()),
                Source::Derived(derived) => derived.extend(&columns, &|_| time_s, 1, &mut self.values),
                Source::Extra(index) => self.values.push(extra.get(*index).copied().unwrap_or_default()),
            }
        }
        let mut predicted = [0.0; 6];
        for term in terms {
            self.inputs.clear();
            self.inputs.extend(term.inputs.iter().map(|&input| self.values.get(input).copied().unwrap_or_default()));
            let value = term.formula.push(&self.inputs)?;
            if let Some(sum) = predicted.get_mut(term.place.channel) {
                *sum += term.factor * value;
            }
        }
        Ok(predicted)
    }
}
