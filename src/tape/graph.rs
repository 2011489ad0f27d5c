//! Recording: a graph of named inputs, named parameters and operations, with shapes checked as it is written.
//!
//! A graph holds no numbers and runs nothing; `plan` decides the order and the memory, `session` replays. Values are copyable
//! handles, so that a network reads as its equations do.

use super::op::{MAX_OPERANDS, Op};
use super::ops::Copy;
use super::parameter::{Parameter, Storage};
use super::shape::Shape;
use crate::error::{Error, Result};
use phyture_kernels::Real;
use std::sync::Arc;

/// Largest number of inputs of one graph.
pub const MAX_INPUTS: usize = 8;

/// Handle to a value of the graph it was recorded on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Var(pub(crate) usize);

pub(crate) enum Source<T> {
    /// Filled by the caller for each sample; `gradient` tells whether its gradient is wanted.
    Input { gradient: bool },
    /// Index into the graph's parameters.
    Parameter(usize),
    /// Computed.
    Op { op: Arc<dyn Op<T>>, operands: Vec<Var> },
}

impl<T> Clone for Source<T> {
    fn clone(&self) -> Self {
        match self {
            Self::Input { gradient } => Self::Input { gradient: *gradient },
            Self::Parameter(index) => Self::Parameter(*index),
            Self::Op { op, operands } => Self::Op { op: Arc::clone(op), operands: operands.clone() },
        }
    }
}

#[derive(Clone)]
pub(crate) struct Node<T> {
    pub source: Source<T>,
    pub shape: Shape,
}

/// A recorded computation of one sample.
#[derive(Clone)]
pub struct Graph<T> {
    pub(crate) nodes: Vec<Node<T>>,
    parameters: Vec<Parameter>,
    inputs: Vec<(String, Var)>,
}

impl<T: Real> Default for Graph<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Graph<T> {
    /// An empty graph.
    pub const fn new() -> Self {
        Self { nodes: Vec::new(), parameters: Vec::new(), inputs: Vec::new() }
    }

    /// A value the caller fills for each sample, in the order in which inputs are recorded.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty shape, a name already taken, or more than [`MAX_INPUTS`] inputs.
    pub fn input(&mut self, name: &str, lengths: &[usize]) -> Result<Var> {
        self.record_input(name, lengths, false)
    }

    /// An input whose gradient a training session gives, too.
    ///
    /// # Errors
    /// As [`Graph::input`].
    pub fn input_with_gradient(&mut self, name: &str, lengths: &[usize]) -> Result<Var> {
        self.record_input(name, lengths, true)
    }

    fn record_input(&mut self, name: &str, lengths: &[usize], gradient: bool) -> Result<Var> {
        let shape = Shape::new("input", lengths)?;
        if self.inputs.len() == MAX_INPUTS || self.inputs.iter().any(|(taken, _)| taken == name) {
            let message = format!("`{name}` is the name of an earlier input, or there are {MAX_INPUTS} inputs already");
            return Err(Error::Shape { operation: "input", message });
        }
        let var = self.push(Node { source: Source::Input { gradient }, shape });
        self.inputs.push((name.to_owned(), var));
        Ok(var)
    }

    /// A trainable tensor; the flat slab holds the tensors in the order in which they are recorded, without gaps.
    ///
    /// # Errors
    /// [`Error::Shape`] for an empty shape or a name already taken.
    pub fn parameter(&mut self, name: &str, lengths: &[usize]) -> Result<Var> {
        self.record_parameter(name, lengths, Storage::AsInFiles)
    }

    /// The trainable weight `[taps, inputs, outputs]` of a convolution; files hold it as `[outputs, inputs, taps]`.
    ///
    /// # Errors
    /// As [`Graph::parameter`].
    pub fn convolution_weight(&mut self, name: &str, [taps, inputs, outputs]: [usize; 3]) -> Result<Var> {
        self.record_parameter(name, &[taps, inputs, outputs], Storage::Convolution)
    }

    fn record_parameter(&mut self, name: &str, lengths: &[usize], storage: Storage) -> Result<Var> {
        let shape = Shape::new("parameter", lengths)?;
        if self.parameters.iter().any(|taken| taken.name == name) {
            return Err(Error::Shape {
                operation: "parameter",
                message: format!("`{name}` is already recorded; names are unique"),
            });
        }
        let offset = self.parameter_count();
        self.parameters.push(Parameter { name: name.to_owned(), shape, storage, offset });
        Ok(self.push(Node { source: Source::Parameter(self.parameters.len() - 1), shape }))
    }

    /// The result of an operation on earlier values.
    ///
    /// An operand given twice is copied, so that every gradient has one writer at a time.
    ///
    /// # Errors
    /// [`Error::Shape`] if the operation refuses the shapes, a handle is not of this graph, or there are too many operands.
    pub fn apply(&mut self, op: impl Op<T> + 'static, operands: &[Var]) -> Result<Var> {
        let operation = op.name();
        let mut shapes = Vec::with_capacity(operands.len());
        for var in operands {
            let Some(node) = self.nodes.get(var.0) else {
                return Err(Error::Shape {
                    operation,
                    message: "an operand belongs to another graph; record it on this one".into(),
                });
            };
            shapes.push(node.shape);
        }
        if operands.len() > MAX_OPERANDS {
            let message = format!("{} operands; at most {MAX_OPERANDS} are possible", operands.len());
            return Err(Error::Shape { operation, message });
        }
        let shape = op.shape(&shapes)?;
        let mut distinct = Vec::with_capacity(operands.len());
        for &var in operands {
            let twice = distinct.contains(&var);
            distinct.push(if twice { self.apply(Copy, &[var])? } else { var });
        }
        Ok(self.push(Node { source: Source::Op { op: Arc::new(op), operands: distinct }, shape }))
    }

    fn push(&mut self, node: Node<T>) -> Var {
        self.nodes.push(node);
        Var(self.nodes.len() - 1)
    }

    /// Shape of a value; the empty shape for a handle of another graph.
    pub fn shape(&self, var: Var) -> Shape {
        self.nodes.get(var.0).map(|node| node.shape).unwrap_or_default()
    }

    /// All parameter tensors, in the order of the flat slab.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Number of trainable numbers: the length of the flat slab.
    pub fn parameter_count(&self) -> usize {
        self.parameters.last().map_or(0, |last| last.range().end)
    }

    /// Inputs by name, in the order in which a session's fill closure gets them.
    pub fn inputs(&self) -> &[(String, Var)] {
        &self.inputs
    }
}

#[cfg(test)]
mod tests {
    use super::super::ops::{Add, Linear};
    use super::*;

    #[test]
    fn shapes_are_refused_while_recording_with_the_operation_and_both_shapes() -> Result<()> {
        let mut graph = Graph::<f64>::new();
        let x = graph.input("x", &[7, 3])?;
        let weight = graph.parameter("weight", &[5, 4])?;
        let Err(error) = graph.apply(Linear, &[x, weight]) else {
            return Err(Error::Undetermined("a [7, 3] input passed a [5, 4] weight".into()));
        };
        let text = error.to_string();
        assert!(text.contains("linear") && text.contains("[7, 3]") && text.contains("[5, 4]"), "{text}");
        assert!(graph.parameter("weight", &[1]).is_err(), "a name was taken twice");
        assert!(graph.input("x", &[1]).is_err(), "an input name was taken twice");
        assert!(graph.apply(Add, &[x, Var(99)]).is_err(), "a handle of another graph was accepted");
        Ok(())
    }

    #[test]
    fn parameters_lie_without_gaps_in_recording_order() -> Result<()> {
        let mut graph = Graph::<f32>::new();
        graph.parameter("a", &[5, 4])?;
        graph.parameter("b", &[3])?;
        let ranges: Vec<_> = graph.parameters().iter().map(Parameter::range).collect();
        assert_eq!((ranges, graph.parameter_count()), (vec![0..20, 20..23], 23));
        Ok(())
    }
}
