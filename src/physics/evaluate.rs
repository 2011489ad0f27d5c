//! A model at work: its formulas bound to the columns they read, block by block over a flight or one sample at a time.
//!
//! Both ways run the same machine, so they give the same bits. How a model is put together is in `compose`; fitting its numbers is
//! calibration's business.

use super::compose::{Composed, Composer};
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::derived::Derived;
use crate::flight::{Accelerations, Channel, Column, Flight, PerChannel};
use crate::formula::{Formula, Machine, Node, Value};
use std::collections::BTreeSet;
use std::ops::Range;

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
    Some(Derived::from_name(name)?.at(|column| state[column as usize], || time_s))
}

/// The columns behind a name that a formula reads: those that a derived quantity is made from, or the name itself.
pub fn columns_behind(name: &str) -> Vec<String> {
    match Derived::from_name(name) {
        Some(derived) => derived.reads().iter().map(|column| column.name().to_owned()).collect(),
        None => vec![name.to_owned()],
    }
}

/// A formula of standard quantities on a whole flight.
///
/// # Errors
/// [`Error::Formula`] pointing at a name that the flight lacks.
pub fn evaluate(formula: &Formula, flight: &Flight) -> Result<Vec<f64>> {
    formula.evaluate(flight.len(), flight.step_s, &|name| quantity(flight, name).map(Value::from))
}

/// The state columns of some samples of a flight.
pub(super) fn state_columns(flight: &Flight, range: Range<usize>) -> [&[f64]; 16] {
    std::array::from_fn(|index| {
        Column::STATE.get(index).and_then(|column| flight.column(*column).get(range.clone())).unwrap_or_default()
    })
}

/// The values of a block of consecutive samples.
#[derive(Clone, Copy, Debug)]
pub struct Block<'a> {
    machine: &'a Machine,
    samples: usize,
}

impl Block<'_> {
    /// One column, in the order in which columns were asked for.
    pub fn column(&self, index: usize) -> &[f64] {
        &self.machine.root(index)[..self.samples]
    }
}

/// What is done with a block: its range of samples, and its values.
pub type Visit<'a> = dyn FnMut(Range<usize>, Block<'_>) -> Result<()> + 'a;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    State(Column),
    Derived(Derived),
    Extra(usize),
}

/// Values of a graph bound to what a flight or a stream carries.
#[derive(Clone, Debug)]
pub(super) struct Bound {
    machine: Machine,
    /// One for each column that the machine asks for.
    sources: Vec<Source>,
    /// Names of the log's further columns that are read.
    extras: Vec<String>,
}

impl Bound {
    /// Binds nodes of a graph to samples `step_s` seconds apart; `flight`, if it is known, gives the numbers that differ from flight to flight.
    pub(super) fn new(composer: &Composer, nodes: &[Node], step_s: f64, flight: Option<&Flight>) -> Result<Self> {
        Self::with_numbers(composer, nodes, step_s, &|symbol| flight.and_then(|flight| composer.in_flight(symbol, &flight.name)))
    }

    /// The same with the values of symbols that vary given by their nodes.
    pub(super) fn with_numbers(
        composer: &Composer,
        nodes: &[Node],
        step_s: f64,
        number: &dyn Fn(Node) -> Option<f64>,
    ) -> Result<Self> {
        let machine = Machine::new(&composer.graph, nodes, step_s, number)?;
        let mut bound = Self { sources: Vec::new(), extras: Vec::new(), machine };
        for &input in bound.machine.inputs() {
            let name = composer.graph.inputs()[input].as_str();
            bound.sources.push(if let Some(column) = Column::STATE.iter().find(|column| column.name() == name) {
                Source::State(*column)
            } else if let Some(derived) = Derived::from_name(name) {
                Source::Derived(derived)
            } else {
                bound.extras.push(name.into());
                Source::Extra(bound.extras.len() - 1)
            });
        }
        Ok(bound)
    }

    /// Runs from the flight's first sample to `end`, and hands over each block's range and its values.
    pub(super) fn run(&mut self, flight: &Flight, end: usize, visit: &mut Visit<'_>) -> Result<()> {
        let end = end.min(flight.len());
        let Self { sources, extras, machine } = self;
        let mut whole: Vec<&[f64]> = Vec::with_capacity(sources.len());
        for source in sources.iter() {
            whole.push(match source {
                Source::State(column) => flight.column(*column),
                Source::Extra(index) => flight.named(&extras[*index]).ok_or_else(|| missing(flight, &extras[*index]))?,
                Source::Derived(_) => &[],
            });
        }
        let mut derived: Vec<Vec<f64>> = vec![Vec::new(); sources.len()];
        for start in (0..end).step_by(machine.block()) {
            let range = start..(start + machine.block()).min(end);
            let state = state_columns(flight, range.clone());
            for (buffer, source) in derived.iter_mut().zip(sources.iter()) {
                if let Source::Derived(kind) = source {
                    buffer.clear();
                    kind.extend(&state, &|sample| flight.time_s(start + sample), range.len(), buffer);
                }
            }
            let column = |input: usize| match sources[input] {
                Source::Derived(_) => derived[input].as_slice(),
                Source::State(_) | Source::Extra(_) => &whole[input][range.clone()],
            };
            machine.advance(range.len(), &column);
            visit(range.clone(), Block { machine, samples: range.len() })?;
        }
        flight.rest();
        Ok(())
    }
}

fn missing(flight: &Flight, name: &str) -> Error {
    Error::Log {
        path: (&flight.name).into(),
        found: format!("no column `{name}`"),
        expected: "it, because a formula reads it".into(),
    }
}

/// Refuses a model that reads what a flight does not carry.
fn check_flight(model: &Model, composer: &Composer, composed: &Composed, flight: &Flight) -> Result<()> {
    for summand in &composed.summands {
        let effect = model.effects.get(summand.effect).map_or("?", |effect| effect.name.as_str());
        for name in composer.graph.reads(summand.node) {
            if let Some(reason) = flight.gives_target_away(name) {
                return Err(Error::Log {
                    path: (&flight.name).into(),
                    found: format!("effect `{effect}`, which reads `{name}`: {reason}"),
                    expected: "effects of measured states and controls, which predict accelerations and are not made of them"
                        .into(),
                });
            }
            let column = Column::STATE.iter().find(|column| column.name() == name);
            let reads = column.map(std::slice::from_ref).or_else(|| Derived::from_name(name).map(Derived::reads));
            if let Some(column) = reads.unwrap_or_default().iter().find(|column| flight.absent.contains(column)) {
                return Err(Error::Log {
                    path: (&flight.name).into(),
                    found: format!("no column `{}`", column.name()),
                    expected: format!("it, because effect `{effect}` reads it; log it or set `enabled = false` on the effect"),
                });
            }
        }
    }
    Ok(())
}

/// A value of a model that is no number, as an error that says where.
pub(super) fn not_finite(model: &Model, flight: &Flight, (effect, channel): (usize, Channel), sample: usize) -> Error {
    let effect = model.effects.get(effect).map_or("?", |effect| effect.name.as_str());
    let channel = channel.name();
    Error::Undetermined(format!(
        "effect `{effect}` is not a finite number for `{channel}` in flight `{}` at t = {:.3} s; guard its formula, for example \
         `max(height, 0.1)`",
        flight.name,
        flight.time_s(sample)
    ))
}

/// A model put together for a flight, which carries all that it reads.
///
/// # Errors
/// As [`Model::predict`].
pub(super) fn composed_for(model: &Model, flight: &Flight) -> Result<(Composer, Composed)> {
    model.check()?;
    let mut composer = Composer::new();
    let extra: Vec<&str> = flight.extra.keys().map(String::as_str).collect();
    let composed = composer.add(model, Some(&extra), false)?;
    check_flight(model, &composer, &composed, flight)?;
    Ok((composer, composed))
}

/// Predicted accelerations of a whole flight.
fn predict(model: &Model, flight: &Flight) -> Result<Accelerations> {
    let (composer, composed) = composed_for(model, flight)?;
    let nodes: Vec<Node> = composed.channels.iter().copied().chain(composed.summands.iter().map(|summand| summand.node)).collect();
    let mut predicted: Accelerations = PerChannel::from_fn(|_| vec![0.0; flight.len()]);
    Bound::new(&composer, &nodes, flight.step_s, Some(flight))?.run(flight, flight.len(), &mut |range, block| {
        for (channel, values) in predicted.iter_mut().enumerate() {
            values[range.clone()].copy_from_slice(block.column(channel));
        }
        for (index, summand) in composed.summands.iter().enumerate() {
            if let Some(at) = block.column(6 + index).iter().position(|value| !value.is_finite()) {
                return Err(not_finite(model, flight, (summand.effect, summand.channel), range.start + at));
            }
        }
        Ok(())
    })?;
    Ok(predicted)
}

impl Model {
    /// Baseline accelerations a^p, one vector a channel in the order of [`Column::TARGETS`] (m/s², then rad/s²).
    ///
    /// # Errors
    /// [`Error::Formula`] at a name the flight does not carry, [`Error::Log`] if an effect reads a column that is absent from
    /// the flight, [`Error::Undetermined`] where a formula gives no finite number, [`Error::Config`] if the model is not whole.
    pub fn predict(&self, flight: &Flight) -> Result<Accelerations> {
        predict(self, flight)
    }

    /// Whether an effect (wind) makes the velocity against the air another than that over ground.
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn feels_wind(&self) -> Result<bool> {
        Ok(Composer::new().add(self, None, false)?.feels_wind)
    }

    /// Velocity against the air along the body axes, as the model's effects make it of that over ground, m/s.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn air_velocity(&self, flight: &Flight) -> Result<[Vec<f64>; 3]> {
        let (composer, composed) = composed_for(self, flight)?;
        let mut velocity = [(); 3].map(|()| Vec::with_capacity(flight.len()));
        Bound::new(&composer, &composed.air, flight.step_s, Some(flight))?.run(flight, flight.len(), &mut |_, block| {
            velocity.iter_mut().enumerate().for_each(|(axis, values)| values.extend_from_slice(block.column(axis)));
            Ok(())
        })?;
        Ok(velocity)
    }

    /// The model for one sample at a time, `step_s` seconds apart; equals [`Model::predict`] sample for sample. It knows no flight: numbers that belong
    /// to single flights are those of [`Model::of_unknown_flights`].
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn stream(&self, step_s: f64) -> Result<StreamingModel> {
        StreamingModel::new(self, step_s)
    }

    /// Root mean square of measured minus predicted acceleration over the given spans, by channel (m/s², rad/s²); rows of
    /// overlapping spans count once each time they are listed, those [set aside](Flight::set_aside) not at all.
    ///
    /// # Errors
    /// As [`Model::predict`]; [`Error::Undetermined`] if the spans hold no row.
    pub fn rmse(&self, flights: &[Flight], spans: &[crate::flight::Span]) -> Result<PerChannel<f64>> {
        let mut squares = PerChannel::splat(0.0);
        let mut rows = 0;
        for (index, flight) in flights.iter().enumerate() {
            let mut spans = spans.iter().filter(|span| span.flight == index).peekable();
            if spans.peek().is_none() {
                continue;
            }
            let predicted = self.predict(flight)?;
            for span in spans {
                for range in flight.counted(span.start..span.end) {
                    rows += range.len();
                    for ((sum, predicted), target) in squares.iter_mut().zip(&predicted).zip(Column::TARGETS) {
                        let pairs = predicted[range.clone()].iter().zip(&flight.column(target)[range.clone()]);
                        *sum += pairs.map(|(predicted, measured)| (measured - predicted).powi(2)).sum::<f64>();
                    }
                }
            }
        }
        if rows == 0 {
            return Err(Error::Undetermined("no rows to compare: the spans are empty; give at least one flight".into()));
        }
        Ok(squares.map(|sum| (sum / rows as f64).sqrt()))
    }
}

/// A model that takes one sample at a time, for real-time use. Samples come in order, one step apart; taking one allocates nothing.
#[derive(Clone, Debug)]
pub struct StreamingModel {
    bound: Bound,
    step_s: f64,
    start_s: f64,
    samples: usize,
    /// One number a source.
    values: Vec<f64>,
}

impl StreamingModel {
    pub(super) fn new(model: &Model, step_s: f64) -> Result<Self> {
        model.check()?;
        let mut composer = Composer::new();
        let composed = composer.add(model, None, false)?;
        let Bound { sources, extras, machine } = Bound::new(&composer, composed.channels.values(), step_s, None)?;
        let bound = Bound { sources, extras, machine: machine.one_by_one() };
        // Pushing allocates nothing.
        let values = Vec::with_capacity(bound.sources.len());
        Ok(Self { bound, step_s, start_s: 0.0, samples: 0, values })
    }

    /// Names of the log's further columns that the model reads; [`StreamingModel::push_with`] takes them in this order. Empty
    /// unless a formula names one.
    pub fn extra_inputs(&self) -> &[String] {
        &self.bound.extras
    }

    /// Columns that the model reads: of the state, those behind derived quantities among them, and the log's further ones.
    pub fn reads(&self) -> BTreeSet<String> {
        let of = |source: &Source| match source {
            Source::State(column) => vec![column.name().to_owned()],
            Source::Derived(derived) => columns_behind(derived.name()),
            Source::Extra(index) => vec![self.bound.extras[*index].clone()],
        };
        self.bound.sources.iter().flat_map(of).collect()
    }

    /// Starts anew: the next sample is the first one, at time `start_s`.
    pub fn reset(&mut self, start_s: f64) {
        self.bound.machine.reset();
        (self.start_s, self.samples) = (start_s, 0);
    }

    /// Predicted accelerations (m/s², rad/s², order of [`Column::TARGETS`]) at the next sample; `state` in the order of
    /// [`Column::STATE`].
    ///
    /// # Errors
    /// [`Error::Shape`] if the model reads further columns; [`Error::Undetermined`] if something that it reads is no finite number: operators that remember
    /// would not forget it. The sample is then not taken.
    pub fn push(&mut self, state: &[f64; 16]) -> Result<PerChannel<f64>> {
        self.push_with(state, &[])
    }

    /// As [`StreamingModel::push`], with one number for each of [`StreamingModel::extra_inputs`].
    ///
    /// # Errors
    /// As [`StreamingModel::push`]; [`Error::Shape`] if their count differs.
    pub fn push_with(&mut self, state: &[f64; 16], extra: &[f64]) -> Result<PerChannel<f64>> {
        let Bound { sources, extras, machine } = &mut self.bound;
        if extra.len() != extras.len() {
            let message = format!("{} further values for the columns {extras:?}", extra.len());
            return Err(Error::Shape { operation: "streaming model", message });
        }
        let time_s = self.start_s + self.step_s * self.samples as f64;
        self.values.clear();
        for source in sources.iter() {
            match source {
                Source::State(column) => self.values.push(state[*column as usize]),
                Source::Derived(derived) => self.values.push(derived.at(|column| state[column as usize], || time_s)),
                Source::Extra(index) => self.values.push(extra[*index]),
            }
        }
        if let Some(place) = self.values.iter().position(|value| !value.is_finite()) {
            let name = match &sources[place] {
                Source::State(column) => column.name(),
                Source::Derived(derived) => derived.name(),
                Source::Extra(index) => &extras[*index],
            };
            let message = format!("sample {}: `{name}` is {}, not a finite number", self.samples, self.values[place]);
            return Err(Error::Undetermined(message));
        }
        self.samples += 1;
        let values = &self.values;
        machine.advance(1, &|input| &values[input..=input]);
        Ok(PerChannel::from_fn(|channel| machine.root(channel.index())[0]))
    }
}
