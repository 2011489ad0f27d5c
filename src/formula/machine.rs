//! Evaluation: a formula bound to a step and to its constants, with its hidden state. Whole columns and single samples go
//! through the same code, block by block or one by one, so that both give the same bits.

use super::memory::{MAX_DELAY_S, MAX_DELAY_SAMPLES, Memory};
use super::operation::{History, Operation};
use super::{Formula, Instruction, Value};
use crate::error::{Error, Result};
use std::borrow::Cow;

/// Samples evaluated at once: a few operands of this length stay in the first-level cache.
const BLOCK: usize = 512;

/// A formula ready to run: constants folded in, hidden state of its `lag`, `delay`, `rate` and `slew` inside.
///
/// Samples must be pushed in order; the first one after [`Formula::stream`] or [`StreamingFormula::reset`] is taken to follow
/// a long rest at its own value.
#[derive(Clone, Debug)]
pub struct StreamingFormula {
    inputs: Vec<String>,
    program: Vec<Step>,
    memory: Vec<Memory>,
    depth: usize,
    scratch: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Number(f64),
    Input(usize),
    Apply(Operation, usize),
    PowerInteger(i32),
    Recall(usize),
}

/// The program while it is put together: constant operands are known by value.
struct Builder<'a> {
    formula: &'a Formula,
    step_s: f64,
    program: Vec<Step>,
    memory: Vec<Memory>,
    /// One entry an operand on the stack: where its steps begin, and its value if it never changes.
    operands: Vec<(usize, Option<f64>)>,
}

impl Builder<'_> {
    fn fault(&self, message: String, at: usize) -> Error {
        Error::Formula { message, formula: self.formula.text.clone(), at }
    }

    fn push(&mut self, step: Step, constant: Option<f64>) {
        self.operands.push((self.program.len(), constant));
        self.program.push(step);
    }

    fn apply(&mut self, operation: Operation, count: usize) {
        let first = self.operands.len().saturating_sub(count);
        let operands = self.operands.split_off(first);
        let start = operands.first().map_or(0, |operand| operand.0);
        if let Some(mut values) = operands.iter().map(|operand| operand.1).collect::<Option<Vec<f64>>>() {
            operation.apply(count, 1, &mut values);
            let value = values.first().copied().unwrap_or(f64::NAN);
            self.program.truncate(start);
            self.push(Step::Number(value), Some(value));
            return;
        }
        self.operands.push((start, None));
        match (operation, operands.last()) {
            (Operation::Power, Some(&(exponent_start, Some(exponent)))) if exponent.fract() == 0.0 && exponent.abs() <= 16.0 => {
                self.program.truncate(exponent_start);
                self.program.push(Step::PowerInteger(exponent as i32));
            }
            _ => self.program.push(Step::Apply(operation, count)),
        }
    }

    fn recall(&mut self, history: History, at: usize) -> Result<()> {
        let memory = match history {
            History::Rate => Memory::rate(self.step_s),
            History::Slew => {
                let (start, constant) = self.operands.pop().unwrap_or((0, None));
                let Some(per_s) = constant.filter(|per_s| *per_s > 0.0) else {
                    let found = constant.map_or("varies in flight".into(), |per_s| format!("is {per_s} per second"));
                    let message = format!("the largest rate of `slew` {found}, expected a number or a parameter above 0");
                    return Err(self.fault(message, at));
                };
                self.program.truncate(start);
                Memory::slew(per_s, self.step_s)
            }
            History::Lag | History::Delay => {
                let (start, constant) = self.operands.pop().unwrap_or((0, None));
                let (name, largest) = if history == History::Lag { ("lag", f64::MAX) } else { ("delay", MAX_DELAY_S) };
                let Some(time_s) = constant else {
                    let message =
                        format!("the time of `{name}` must be a number or a parameter, not something that varies in flight");
                    return Err(self.fault(message, at));
                };
                if !(0.0..=largest).contains(&time_s) {
                    let limit = if history == History::Lag { String::new() } else { format!(" and at most {largest}") };
                    return Err(self.fault(format!("the time of `{name}` is {time_s} s, expected at least 0{limit}"), at));
                }
                let samples = time_s / self.step_s;
                if history == History::Delay && samples > MAX_DELAY_SAMPLES {
                    let step_s = self.step_s;
                    let message = format!(
                        "the time of `delay` is {time_s} s, {samples:.1e} samples of {step_s:e} s; at most {MAX_DELAY_SAMPLES:e} can be kept"
                    );
                    return Err(self.fault(message, at));
                }
                self.program.truncate(start);
                if history == History::Lag { Memory::lag(time_s, self.step_s) } else { Memory::delay(time_s, self.step_s) }
            }
        };
        if let Some((start, Some(value))) = self.operands.last().copied() {
            // At rest since ever: a lag, a delay or a slew passes a constant on, its rate is zero.
            let value = if history == History::Rate { 0.0 } else { value };
            self.operands.pop();
            self.program.truncate(start);
            self.push(Step::Number(value), Some(value));
        } else {
            self.program.push(Step::Recall(self.memory.len()));
            self.memory.push(memory);
        }
        Ok(())
    }
}

impl StreamingFormula {
    pub(super) fn build(formula: &Formula, step_s: f64, constant: &dyn Fn(&str) -> Option<f64>) -> Result<Self> {
        if !(step_s > 0.0 && step_s.is_finite()) {
            let (found, expected) = (step_s.to_string(), "a positive, finite step".into());
            return Err(Error::Config { place: format!("formula `{formula}`"), field: "step_s".into(), found, expected });
        }
        let constants: Vec<Option<f64>> = formula.names.iter().map(|(name, _)| constant(name)).collect();
        let mut slots = Vec::new();
        let mut inputs = Vec::new();
        for ((name, _), constant) in formula.names.iter().zip(&constants) {
            slots.push(inputs.len());
            if constant.is_none() {
                inputs.push(name.clone());
            }
        }
        let mut builder = Builder { formula, step_s, program: Vec::new(), memory: Vec::new(), operands: Vec::new() };
        let mut depth = 1;
        for &(instruction, at) in &formula.program {
            match instruction {
                Instruction::Number(number) => builder.push(Step::Number(number), Some(number)),
                Instruction::Name(index) => match constants.get(index).copied().flatten() {
                    Some(value) => builder.push(Step::Number(value), Some(value)),
                    None => builder.push(Step::Input(slots.get(index).copied().unwrap_or_default()), None),
                },
                Instruction::Apply(operation, count) => builder.apply(operation, count),
                Instruction::Recall(history) => builder.recall(history, at)?,
            }
            depth = depth.max(builder.operands.len());
        }
        let Builder { program, memory, .. } = builder;
        Ok(Self { inputs, program, memory, depth, scratch: Vec::new() })
    }

    /// The columns it reads, in the order in which [`StreamingFormula::push`] takes their samples.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.memory.iter_mut().for_each(Memory::reset);
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
        self.block(1, &|input| sample.get(input..=input).unwrap_or(&[0.0]), &mut value);
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
        for (index, part) in out.chunks_mut(BLOCK).enumerate() {
            let (start, end) = (index * BLOCK, index * BLOCK + part.len());
            self.block(part.len(), &|input| columns.get(input).and_then(|column| column.get(start..end)).unwrap_or(&[]), part);
        }
        Ok(())
    }

    /// Runs `samples` samples through the program.
    fn block<'a>(&mut self, samples: usize, input: &dyn Fn(usize) -> &'a [f64], out: &mut [f64]) {
        let Self { program, memory, depth, scratch, .. } = self;
        if scratch.len() < *depth * samples {
            scratch.resize(*depth * samples, 0.0);
        }
        let mut top = 0;
        for step in program {
            match *step {
                Step::Number(number) => {
                    scratch[top..top + samples].fill(number);
                    top += samples;
                }
                Step::Input(index) => {
                    let column = input(index);
                    scratch[top..top + column.len()].copy_from_slice(column);
                    top += samples;
                }
                Step::Apply(operation, count) => {
                    operation.apply(count, samples, &mut scratch[top - count * samples..top]);
                    top -= (count - 1) * samples;
                }
                Step::PowerInteger(exponent) => {
                    scratch[top - samples..top].iter_mut().for_each(|value| *value = value.powi(exponent));
                }
                Step::Recall(index) => {
                    if let Some(memory) = memory.get_mut(index) {
                        memory.run(&mut scratch[top - samples..top]);
                    }
                }
            }
        }
        out.copy_from_slice(&scratch[..samples]);
    }
}

impl Formula {
    /// Evaluates whole columns of `samples` samples taken every `step_s` seconds; `get` gives a column or a parameter by name.
    ///
    /// # Errors
    /// [`Error::Formula`] at the first name `get` does not know, or at a `lag` or `delay` whose time varies or is out of range;
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
    /// [`Error::Formula`] at a `lag` or `delay` whose time varies or is out of range.
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
