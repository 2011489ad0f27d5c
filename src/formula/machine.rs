//! Evaluation: a graph of formulas bound to its numbers, with its hidden state. Whole columns and single samples go through the same
//! code, block by block or one by one, so that both give the same bits.

use super::graph::{Graph, Kind, Node, Recall, whole_power};
use super::memory::{MOST_DELAYED, Memory};
use super::operation::{History, Operation, whole_power_of_column};
use super::{Formula, Value};
use crate::error::{Error, Result};
use phyture_kernels::InstructionSet;
use std::borrow::Cow;

/// Longest run of samples that is evaluated at once …
const LONGEST_BLOCK: usize = 512;
/// … and shortest: what a step costs beside its samples is then small.
const SHORTEST_BLOCK: usize = 64;
/// Numbers that all columns of a block hold together, about: they stay in the second-level cache.
const NUMBERS_AT_ONCE: usize = 64 * 1024;

/// A column of the block at hand.
type Slot = u32;

/// One operation: where its operands lie, and where its result goes.
#[derive(Clone, Copy, Debug)]
enum Step {
    Input { input: u32, out: Slot },
    One { operation: Operation, x: Slot, out: Slot },
    Two { operation: Operation, x: Slot, y: Slot, out: Slot },
    PowerInteger { x: Slot, exponent: i32, out: Slot },
    Recall { memory: u32, x: Slot, number: Slot, tangents: [Slot; 2], out: Slot },
}

/// The columns that an operator which remembers reads at the samples at hand, and the one that it fills.
pub(super) struct Recalled<'a> {
    pub isa: InstructionSet,
    pub signal: &'a [f64],
    /// Time or limit.
    pub number: &'a [f64],
    pub tangents: [&'a [f64]; 2],
    pub out: &'a mut [f64],
}

/// Some values of a [`Graph`] ready to be evaluated, with the hidden state of what remembers. Samples come in order; the first one after
/// [`Machine::new`] or [`Machine::reset`] is taken to follow a long rest at its own value.
#[derive(Clone, Debug)]
pub struct Machine {
    steps: Vec<Step>,
    pub(super) memory: Vec<Memory>,
    /// The columns, one behind the other, each as long as a block; those of constants are filled once.
    columns: Vec<f64>,
    roots: Vec<Slot>,
    /// Index in the graph's inputs of each column that is read; those of values that are given follow them.
    inputs: Vec<usize>,
    /// Samples that its delays keep.
    delayed: f64,
    block: usize,
    isa: InstructionSet,
    pub(super) step_s: f64,
}

/// Gives out columns, and takes back those that are no longer read.
struct Slots {
    count: usize,
    free: Vec<Slot>,
    /// By node.
    of: Vec<Option<Slot>>,
}

impl Slots {
    fn take(&mut self, node: Node) -> Slot {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count as Slot - 1
        });
        self.of[node.0 as usize] = Some(slot);
        slot
    }

    fn of(&self, node: Node) -> Slot {
        self.of[node.0 as usize].expect("operands come before what is made of them")
    }
}

impl Machine {
    /// Binds the values at `roots` to samples that are `step_s` seconds apart; `number` gives the value of each symbol that varies, by its
    /// node, where it is not the symbol's own.
    ///
    /// # Errors
    /// [`Error::Config`] for a step that is not positive and finite, a delay of too many steps, or an instruction set that was asked for
    /// and is not there.
    pub fn new(graph: &Graph, roots: &[Node], step_s: f64, number: &dyn Fn(Node) -> Option<f64>) -> Result<Self> {
        Self::with_given(graph, roots, &[], step_s, number)
    }

    /// As [`Machine::new`], with values that are not worked out but given, as if they were columns: in [`Machine::inputs`] the index of
    /// the n-th of `given` is n more than the graph has inputs. None of them may be the same at all samples.
    ///
    /// # Errors
    /// As [`Machine::new`].
    pub fn with_given(
        graph: &Graph,
        roots: &[Node],
        given: &[Node],
        step_s: f64,
        number: &dyn Fn(Node) -> Option<f64>,
    ) -> Result<Self> {
        if !(step_s > 0.0 && step_s.is_finite()) {
            let (found, expected) = (step_s.to_string(), "a positive, finite step".into());
            return Err(Error::Config { place: "formula".into(), field: "step_s".into(), found, expected });
        }
        let behind = graph.behind_given(roots, given);
        let uniform = uniform(graph, &behind, number);
        let is_uniform = |node: &Node| uniform[node.0 as usize].is_some();
        let operands = |node: Node| graph.operands(node).filter(move |_| !given.contains(&node));
        let mut last_use: Vec<Option<usize>> = vec![None; graph.nodes.len()];
        for (place, &node) in behind.iter().enumerate() {
            operands(node).for_each(|operand| last_use[operand.0 as usize] = Some(place));
        }
        roots.iter().for_each(|root| last_use[root.0 as usize] = Some(usize::MAX));
        let mut machine = Self {
            steps: Vec::new(),
            memory: Vec::new(),
            columns: Vec::new(),
            roots: Vec::new(),
            inputs: Vec::new(),
            delayed: 0.0,
            block: 0,
            isa: InstructionSet::detect().map_err(Error::instruction_set)?,
            step_s,
        };
        // All of them before any is made.
        machine.delayed = delayed(graph, behind.iter().filter(|node| !given.contains(node)), &uniform) / step_s;
        check_delayed(machine.delayed, step_s)?;
        let mut slots = Slots { count: 0, free: Vec::new(), of: vec![None; graph.nodes.len()] };
        // Columns of constants are filled once, so they are never given to anything else.
        let of_constant = |node: &Node| Some((slots.take(*node), uniform[node.0 as usize]?));
        let constants: Vec<(Slot, f64)> = behind.iter().filter(|node| is_uniform(node)).filter_map(of_constant).collect();
        for (place, &node) in behind.iter().enumerate().filter(|(_, node)| !is_uniform(node)) {
            match given.iter().position(|given| *given == node) {
                Some(place) => machine.input(graph.inputs().len() + place, node, &mut slots),
                None => machine.step(graph, node, &uniform, &mut slots)?,
            }
            for operand in operands(node).filter(|operand| !is_uniform(operand)) {
                // Once, also for one that is both operands.
                if last_use[operand.0 as usize].take_if(|last| *last == place).is_some() {
                    let slot = slots.of(operand);
                    slots.free.push(slot);
                }
            }
        }
        machine.roots = roots.iter().map(|root| slots.of(*root)).collect();
        machine.block = (NUMBERS_AT_ONCE / slots.count.max(1)).clamp(SHORTEST_BLOCK, LONGEST_BLOCK);
        machine.columns = vec![0.0; machine.block * slots.count];
        let block = machine.block;
        constants.iter().for_each(|&(slot, value)| machine.columns[slot as usize * block..][..block].fill(value));
        Ok(machine)
    }

    /// The same for one sample at a time. What a sample touches then lies side by side: in flight, long after the last one, it comes from far away.
    #[must_use]
    pub fn one_by_one(self) -> Self {
        let columns = self.columns.iter().step_by(self.block).copied().collect();
        Self { columns, block: 1, ..self }
    }

    /// Adds what takes a column from outside.
    fn input(&mut self, input: usize, node: Node, slots: &mut Slots) {
        let known = self.inputs.iter().position(|known| *known == input);
        let place = known.unwrap_or_else(|| {
            self.inputs.push(input);
            self.inputs.len() - 1
        });
        self.steps.push(Step::Input { input: place as u32, out: slots.take(node) });
    }

    /// Adds what computes one node.
    fn step(&mut self, graph: &Graph, node: Node, uniform: &[Option<f64>], slots: &mut Slots) -> Result<()> {
        let step_s = self.step_s;
        let step = match graph.nodes[node.0 as usize] {
            Kind::Number(_) | Kind::Symbol(_) => unreachable!("a number is the same at all samples"),
            Kind::Input(input) => {
                self.input(input as usize, node, slots);
                return Ok(());
            }
            Kind::One(operation, x) => Step::One { operation, x: slots.of(x), out: slots.take(node) },
            Kind::Two(operation, x, y) => {
                let (left, right) = (slots.of(x), slots.of(y));
                match whole_power(operation, uniform[y.0 as usize]) {
                    Some(exponent) => Step::PowerInteger { x: left, exponent, out: slots.take(node) },
                    None => Step::Two { operation, x: left, y: right, out: slots.take(node) },
                }
            }
            Kind::Recall(recall, [x, time, tangent, limit]) => {
                let number = uniform[time.0 as usize];
                check_time(recall, number)?;
                self.memory.push(Memory::new(recall, number, step_s));
                let (x, number, tangents) = (slots.of(x), slots.of(time), [slots.of(tangent), slots.of(limit)]);
                Step::Recall { memory: self.memory.len() as u32 - 1, x, number, tangents, out: slots.take(node) }
            }
        };
        self.steps.push(step);
        Ok(())
    }

    /// For each column that is read, its index in [`Graph::inputs`]; [`Machine::advance`] asks for them in this order.
    pub fn inputs(&self) -> &[usize] {
        &self.inputs
    }

    /// Most samples that are taken at once.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.memory.iter_mut().for_each(Memory::reset);
    }

    /// Takes the next samples, at most [`Machine::block`] of them; `input` gives their columns in the order of [`Machine::inputs`].
    pub fn advance<'a>(&mut self, samples: usize, input: &dyn Fn(usize) -> &'a [f64]) {
        let Self { memory, .. } = self;
        let mut memory = std::mem::take(memory);
        self.evaluate(samples, input, &mut |index, recalled| {
            let Recalled { isa, signal, number, tangents, out } = recalled;
            memory[index].run(isa, signal, number, tangents, out);
        });
        self.memory = memory;
    }

    /// Works through the steps; `recall` fills the columns of what remembers, by its number.
    pub(super) fn evaluate<'a>(
        &mut self,
        samples: usize,
        input: &dyn Fn(usize) -> &'a [f64],
        recall: &mut dyn FnMut(usize, Recalled<'_>),
    ) {
        assert!(samples <= self.block, "{samples} samples at once, at most {}", self.block);
        let Self { steps, columns, isa, block, .. } = self;
        let block = *block;
        for step in steps {
            let (Step::Input { out, .. }
            | Step::One { out, .. }
            | Step::Two { out, .. }
            | Step::PowerInteger { out, .. }
            | Step::Recall { out, .. }) = *step;
            // What is filled, and the columns before and behind it, which are read.
            let (before, rest) = columns.split_at_mut(out as usize * block);
            let (result, behind) = rest.split_at_mut(block);
            let values = &mut result[..samples];
            let column = |slot: Slot| match slot.checked_sub(out + 1) {
                Some(slot) => &behind[slot as usize * block..][..samples],
                None => &before[slot as usize * block..][..samples],
            };
            match *step {
                Step::Input { input: index, .. } => values.copy_from_slice(input(index as usize)),
                Step::One { operation, x, .. } => operation.of_column(*isa, column(x), values),
                Step::Two { operation, x, y, .. } => operation.of_columns(*isa, column(x), column(y), values),
                Step::PowerInteger { x, exponent, .. } => whole_power_of_column(*isa, exponent, column(x), values),
                Step::Recall { memory: index, x, number, tangents, .. } => {
                    let (signal, number, tangents) = (column(x), column(number), tangents.map(column));
                    recall(index as usize, Recalled { isa: *isa, signal, number, tangents, out: values });
                }
            }
        }
    }

    /// Number of roots.
    pub fn roots(&self) -> usize {
        self.roots.len()
    }

    /// Values of a root at the samples last taken, in front.
    pub fn root(&self, index: usize) -> &[f64] {
        &self.columns[self.roots[index] as usize * self.block..][..self.block]
    }
}

/// Seconds that the delays among these nodes keep, but for those of what is the same at all samples.
fn delayed<'a>(graph: &Graph, nodes: impl Iterator<Item = &'a Node>, uniform: &[Option<f64>]) -> f64 {
    let one = |node: &Node| match graph.nodes[node.0 as usize] {
        Kind::Recall(Recall::History(History::Delay) | Recall::DelayByTime, [_, time, ..]) => uniform[time.0 as usize],
        _ => None,
    };
    nodes.filter(|node| uniform[node.0 as usize].is_none()).filter_map(one).map(|time_s| time_s.max(0.0)).sum()
}

/// Refuses delays that would keep too much.
fn check_delayed(samples: f64, step_s: f64) -> Result<()> {
    if samples <= MOST_DELAYED {
        return Ok(());
    }
    Err(Error::Config {
        place: "formula".into(),
        field: "delay".into(),
        found: format!("{} s in all, {samples:.2e} samples of {step_s:e} s", (1e6 * samples * step_s).round() / 1e6),
        expected: format!("at most {MOST_DELAYED:e} samples, which can be kept"),
    })
}

/// Refuses a time or a limit that its operator cannot have: one that a symbol was given, as the graph has looked at its own.
fn check_time(recall: Recall, number: Option<f64>) -> Result<()> {
    let Some(number) = number else { return Ok(()) };
    let (field, possible, expected) = match recall {
        Recall::History(History::Lag) => ("lag", number >= 0.0, "a time of at least 0 s"),
        Recall::History(History::Delay) => ("delay", number >= 0.0, "a time of at least 0 s"),
        Recall::History(History::Slew) => ("slew", number > 0.0, "a largest rate above 0"),
        _ => return Ok(()),
    };
    if possible {
        return Ok(());
    }
    let (place, found, expected) = ("formula".into(), number.to_string(), expected.into());
    Err(Error::Config { place, field: field.into(), found, expected })
}

/// By node, the values that are the same at all samples, with the symbols that vary at the values of this evaluation.
fn uniform(graph: &Graph, behind: &[Node], number: &dyn Fn(Node) -> Option<f64>) -> Vec<Option<f64>> {
    let mut known: Vec<Option<f64>> = vec![None; graph.nodes.len()];
    for &node in behind.iter().filter(|node| graph.uniform[node.0 as usize].is_some()) {
        let symbol = |index: usize| {
            let symbol = graph.symbols[index];
            if symbol.varies { number(node).unwrap_or(symbol.value) } else { symbol.value }
        };
        let value = graph.value_of(graph.nodes[node.0 as usize], &|operand| known[operand.0 as usize], &symbol);
        known[node.0 as usize] = Some(value.expect("what is the same at all samples has operands that are"));
    }
    known
}

/// A formula ready to run: constants folded in, hidden state of its `lag`, `delay`, `rate` and `slew` inside.
///
/// Samples must be pushed in order; the first one after [`Formula::stream`] or [`StreamingFormula::reset`] is taken to follow
/// a long rest at its own value.
#[derive(Clone, Debug)]
pub struct StreamingFormula {
    inputs: Vec<String>,
    /// Index in `inputs` of each column that the machine asks for.
    order: Vec<usize>,
    machine: Machine,
}

impl StreamingFormula {
    fn build(formula: &Formula, step_s: f64, constant: &dyn Fn(&str) -> Option<f64>) -> Result<Self> {
        let mut graph = Graph::new();
        let root = graph.add(formula, &mut |graph, name| Ok(constant(name).map(|value| graph.number(value))))?;
        let machine = Machine::new(&graph, &[root], step_s, &|_| None)?;
        Ok(Self { inputs: graph.inputs().to_vec(), order: machine.inputs().to_vec(), machine })
    }

    /// A stream of each formula, for one sample at a time ([`Machine::one_by_one`]), which together keep no more than one may.
    pub(crate) fn of_each(formulas: &[Formula], step_s: f64) -> Result<Vec<Self>> {
        let mut delayed = 0.0;
        let mut one = |formula: &Formula| {
            let stream = formula.stream(step_s)?;
            delayed += stream.machine.delayed;
            check_delayed(delayed, step_s).map(|()| Self { machine: stream.machine.one_by_one(), ..stream })
        };
        formulas.iter().map(&mut one).collect()
    }

    /// The columns it reads, in the order in which [`StreamingFormula::push`] takes their samples.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.machine.reset();
    }

    /// The value at the next sample; `sample` holds one number for each of [`StreamingFormula::inputs`].
    ///
    /// # Errors
    /// [`Error::Shape`] if the count differs.
    pub fn push(&mut self, sample: &[f64]) -> Result<f64> {
        if sample.len() != self.inputs.len() {
            let message = format!("{} numbers for the {} inputs {:?}", sample.len(), self.inputs.len(), self.inputs);
            return Err(Error::Shape { operation: "formula", message });
        }
        let mut value = [0.0];
        self.run(1, &|input| &sample[input..=input], &mut value);
        Ok(value[0])
    }

    /// The values at the next `out.len()` samples; `columns` holds one slice of that length for each input.
    ///
    /// # Errors
    /// [`Error::Shape`] if the number of columns or a length differs.
    pub fn extend(&mut self, columns: &[&[f64]], out: &mut [f64]) -> Result<()> {
        if columns.len() != self.inputs.len() {
            let message = format!("{} columns for the {} inputs {:?}", columns.len(), self.inputs.len(), self.inputs);
            return Err(Error::Shape { operation: "formula", message });
        }
        if let Some((name, column)) = self.inputs.iter().zip(columns).find(|(_, column)| column.len() != out.len()) {
            let message = format!("column `{name}` has {} samples, expected {}", column.len(), out.len());
            return Err(Error::Shape { operation: "formula", message });
        }
        let block = self.machine.block();
        for (index, part) in out.chunks_mut(block).enumerate() {
            let (start, end) = (index * block, index * block + part.len());
            self.run(part.len(), &|input| &columns[input][start..end], part);
        }
        Ok(())
    }

    /// Runs some samples; `column` gives those of an input by its index in `inputs`.
    fn run<'a>(&mut self, samples: usize, column: &dyn Fn(usize) -> &'a [f64], out: &mut [f64]) {
        let Self { machine, order, .. } = self;
        machine.advance(samples, &|input| column(order[input]));
        out.copy_from_slice(&machine.root(0)[..samples]);
    }
}

impl Formula {
    /// Evaluates whole columns of `samples` samples taken every `step_s` seconds; `get` gives a column or a parameter by name.
    ///
    /// # Errors
    /// [`Error::Formula`] at the first name `get` does not know, or at a `delay` whose time varies or one or a `lag` whose is out of range;
    /// [`Error::Shape`] if a column's length is not `samples`.
    pub fn evaluate<'a>(&self, samples: usize, step_s: f64, get: &dyn Fn(&str) -> Option<Value<'a>>) -> Result<Vec<f64>> {
        let mut columns: Vec<Cow<'a, [f64]>> = Vec::new();
        let mut constants: Vec<(&str, f64)> = Vec::new();
        for (name, at) in &self.names {
            match get(name) {
                Some(Value::Constant(value)) => constants.push((name, value)),
                Some(Value::Column(column)) => columns.push(column),
                None => return Err(self.unknown(name, *at, "")),
            }
        }
        let constant = |name: &str| constants.iter().find(|known| known.0 == name).map(|known| known.1);
        let mut machine = self.stream_with(step_s, &constant)?;
        let columns: Vec<&[f64]> = columns.iter().map(AsRef::as_ref).collect();
        let mut values = vec![0.0; samples];
        machine.extend(&columns, &mut values)?;
        Ok(values)
    }

    /// The formula for one sample at a time, every name being a column.
    ///
    /// # Errors
    /// [`Error::Formula`] at a `delay` whose time varies, or one or a `lag` whose is out of range.
    pub fn stream(&self, step_s: f64) -> Result<StreamingFormula> {
        self.stream_with(step_s, &|_| None)
    }

    /// As [`Formula::stream`], with parameters: names for which `constant` gives a value.
    ///
    /// # Errors
    /// As [`Formula::stream`].
    pub fn stream_with(&self, step_s: f64, constant: &dyn Fn(&str) -> Option<f64>) -> Result<StreamingFormula> {
        StreamingFormula::build(self, step_s, constant)
    }
}
