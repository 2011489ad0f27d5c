//! Formulas on predicted states. What they make of controls, further columns and time alone is worked out once a flight, on the flight's own
//! samples, by the machine that also predicts; only what reads a state is left for the lanes. What remembers a state has seen the measured
//! flight up to a lane's start.

use super::motion::{Motion, Seen};
use crate::error::{Error, Result};
use crate::flight::derived::Derived;
use crate::flight::{Column, Flight};
use crate::formula::{Formula, Lanes, Machine, Node, Remembered};
use crate::physics::compose::{Composer, Free};
use crate::physics::evaluate::{Bound, state_columns};
use crate::physics::model::Model;
use std::ops::Range;

/// The columns that move when a state is predicted: all of [`Column::STATE`] but the controls.
const MOVING: usize = Column::U1 as usize;

/// Values of symbols by their nodes.
pub(super) type OfSymbol<'a> = &'a dyn Fn(Node) -> Option<f64>;

/// Formulas put together.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    composer: Composer,
    roots: Vec<Node>,
    /// What no state is behind.
    exogenous: Vec<Node>,
    /// The numbers of a model with their symbols.
    pub(super) numbers: Vec<(Free, Node)>,
}

/// Where an input of the lanes comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    State(Column),
    Derived(Derived),
    Exogenous(usize),
}

/// Whether a quantity is predicted, not measured, in a rollout.
fn moves(name: &str) -> bool {
    Column::STATE[..MOVING].iter().any(|column| column.name() == name)
        || Derived::from_name(name).is_some_and(|derived| derived != Derived::Time)
}

impl Program {
    /// The six accelerations of a model, all of whose numbers may be given other values.
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn of_model(model: &Model) -> Result<Self> {
        model.check()?;
        let mut composer = Composer::new();
        let composed = composer.add(model, None, true)?;
        composed.numbers.iter().for_each(|(_, symbol)| composer.graph.let_vary(*symbol));
        Ok(Self::new(composer, composed.channels.values().to_vec(), composed.numbers))
    }

    /// Formulas of standard quantities and further columns.
    ///
    /// # Errors
    /// [`Error::Formula`] as [`crate::formula::Graph::add`].
    pub fn of_formulas(formulas: &[Formula]) -> Result<Self> {
        let mut composer = Composer::new();
        let roots = formulas.iter().map(|formula| composer.graph.add(formula, &mut |_, _| Ok(None))).collect::<Result<_>>()?;
        Ok(Self::new(composer, roots, Vec::new()))
    }

    fn new(composer: Composer, roots: Vec<Node>, numbers: Vec<(Free, Node)>) -> Self {
        let exogenous = composer.graph.apart_from(&roots, &moves);
        Self { composer, roots, exogenous, numbers }
    }

    /// Whether a formula reads roll, pitch or yaw themselves.
    pub fn reads_angles(&self) -> bool {
        let angles = [Column::Roll, Column::Pitch, Column::Yaw].map(Column::name);
        self.roots.iter().flat_map(|root| self.composer.graph.reads(*root)).any(|name| angles.contains(&name))
    }

    fn source(&self, input: usize) -> Source {
        let Some(name) = self.composer.graph.inputs().get(input) else {
            return Source::Exogenous(input - self.composer.graph.inputs().len());
        };
        let column = Column::STATE.iter().find(|column| column.name() == name);
        let derived = || Derived::from_name(name).map(Source::Derived);
        column.map(|column| Source::State(*column)).or_else(derived).expect("what does not move is given")
    }

    /// Makes ready for lanes on a flight that look at no sample from `end` on; `cuts` are the first samples of batches, in order.
    ///
    /// # Errors
    /// [`Error::Log`] where the flight lacks a column; [`Error::Config`] for a number that its operator cannot have.
    pub fn on(&self, flight: &Flight, end: usize, cuts: &[usize], number: OfSymbol<'_>) -> Result<Prepared> {
        let mut exogenous: Vec<Vec<f64>> = self.exogenous.iter().map(|_| Vec::with_capacity(end)).collect();
        Bound::with_numbers(&self.composer, &self.exogenous, flight.step_s, number)?.run(flight, end, &mut |_, block| {
            exogenous.iter_mut().enumerate().for_each(|(index, values)| values.extend_from_slice(block.column(index)));
            Ok(())
        })?;
        let machine = Machine::with_given(&self.composer.graph, &self.roots, &self.exogenous, flight.step_s, number)?;
        let sources = machine.inputs().iter().map(|&input| self.source(input)).collect();
        let mut prepared = Prepared { exogenous, sources, machine, past: Vec::new() };
        if prepared.machine.remembers() {
            let (mut machine, mut done) = (prepared.machine.clone(), 0);
            for &cut in cuts {
                prepared.warm(&mut machine, flight, done..cut);
                prepared.past.push(machine.remembered());
                done = cut;
            }
        }
        Ok(prepared)
    }
}

/// Formulas on one flight.
#[derive(Debug)]
pub(crate) struct Prepared {
    exogenous: Vec<Vec<f64>>,
    /// One for each column that the machine asks for.
    sources: Vec<Source>,
    machine: Machine,
    /// What the machine remembers where each batch begins.
    past: Vec<Remembered>,
}

impl Prepared {
    /// Most lanes at once.
    pub fn block(&self) -> usize {
        self.machine.block()
    }

    /// Whether values depend on states before the moment.
    pub fn remembers(&self) -> bool {
        self.machine.remembers()
    }

    /// Takes measured samples.
    fn warm(&self, machine: &mut Machine, flight: &Flight, samples: Range<usize>) {
        let mut derived: Vec<Vec<f64>> = vec![Vec::new(); self.sources.len()];
        for start in samples.clone().step_by(machine.block()) {
            let range = start..(start + machine.block()).min(samples.end);
            let state = state_columns(flight, range.clone());
            for (buffer, source) in derived.iter_mut().zip(&self.sources) {
                if let Source::Derived(kind) = source {
                    buffer.clear();
                    kind.extend(&state, &|sample| flight.time_s(start + sample), range.len(), buffer);
                }
            }
            machine.advance(range.len(), &|input| match self.sources[input] {
                Source::State(column) => state[column as usize],
                Source::Derived(_) => &derived[input],
                Source::Exogenous(index) => &self.exogenous[index][range.clone()],
            });
        }
    }

    /// The lanes of a batch, which start at `samples`, in order.
    ///
    /// # Errors
    /// [`Error::Shape`] as [`Machine::lanes`].
    pub fn lanes(&self, flight: &Flight, batch: usize, samples: &[usize]) -> Result<LaneProgram<'_>> {
        let mut machine = self.machine.clone();
        let mut lanes = machine.lanes()?;
        if let (Some(past), Some(&first)) = (self.past.get(batch), samples.first()) {
            machine.recall(past);
            let mut done = first;
            for &sample in samples {
                self.warm(&mut machine, flight, done..sample);
                machine.add_lane(&mut lanes);
                done = sample;
            }
        }
        let column = || vec![0.0; samples.len()];
        Ok(LaneProgram {
            prepared: self,
            machine,
            lanes,
            gathered: self.exogenous.iter().map(|_| column()).collect(),
            derived: self.sources.iter().map(|_| Vec::new()).collect(),
        })
    }
}

/// When within a step formulas are evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum When {
    /// At the next sample: what remembers takes it.
    Sample,
    /// A part of a step after the last sample: nothing is taken.
    Ahead(f64),
}

/// Formulas at work in lanes.
#[derive(Debug)]
pub(crate) struct LaneProgram<'a> {
    prepared: &'a Prepared,
    machine: Machine,
    lanes: Lanes,
    /// What no state is behind, at each lane's sample.
    gathered: Vec<Vec<f64>>,
    derived: Vec<Vec<f64>>,
}

impl LaneProgram<'_> {
    /// Holds what no state is behind at its value so many samples after each start.
    pub fn hold(&mut self, starts: &[usize], step: usize) {
        for (to, from) in self.gathered.iter_mut().zip(&self.prepared.exogenous) {
            to.iter_mut().zip(starts).for_each(|(to, start)| *to = from[start + step]);
        }
    }

    /// Evaluates on a motion.
    pub fn evaluate(&mut self, when: When, motion: &Motion, seen: &Seen) {
        let Self { prepared, machine, lanes, gathered, derived } = self;
        let sources = &prepared.sources;
        let column = |column: Column| match column {
            Column::Roll => seen.angle(0),
            Column::Pitch => seen.angle(1),
            Column::Yaw => seen.angle(2),
            other => motion.column(other),
        };
        let state: [&[f64]; 16] =
            std::array::from_fn(|index| if index < MOVING { column(Column::STATE[index]) } else { Default::default() });
        for (buffer, source) in derived.iter_mut().zip(sources) {
            if let Source::Derived(kind) = source
                && gravity(*kind).is_none()
            {
                buffer.clear();
                kind.extend(&state, &|_| f64::NAN, motion.lanes(), buffer);
            }
        }
        let input = |input: usize| match sources[input] {
            Source::State(column) => state[column as usize],
            Source::Derived(kind) => gravity(kind).map_or(derived[input].as_slice(), |axis| seen.gravity(axis)),
            Source::Exogenous(index) => gathered[index].as_slice(),
        };
        match when {
            When::Sample => machine.advance_lanes(lanes, motion.lanes(), &input),
            When::Ahead(part) => machine.look_ahead(lanes, part, motion.lanes(), &input),
        }
    }

    /// Number of formulas.
    pub fn roots(&self) -> usize {
        self.machine.roots()
    }

    /// Values of a formula, one a lane, in front.
    pub fn root(&self, index: usize) -> &[f64] {
        self.machine.root(index)
    }
}

/// The body axis of a component of gravity.
fn gravity(kind: Derived) -> Option<usize> {
    [Derived::GravityX, Derived::GravityY, Derived::GravityZ].iter().position(|one| *one == kind)
}

/// Refuses a batch of more lanes than a machine takes.
pub(super) fn check_lanes(prepared: &Prepared, lanes: usize) -> Result<()> {
    if lanes <= prepared.block() {
        return Ok(());
    }
    let message = format!("{lanes} lanes at once, at most {}", prepared.block());
    Err(Error::Shape { operation: "rollout", message })
}
