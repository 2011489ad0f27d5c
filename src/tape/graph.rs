//! Recording: a graph of named inputs, named parameters and operations, with shapes checked as it is written.
//!
//! A graph holds no numbers and runs nothing; `plan` decides the order and the memory, `session` replays. Values are copyable
//! handles, so that a network reads as its equations do.

use super::op::{MAX_OPERANDS, Op};
use super::ops::Copy;
use super::parameter::{Parameter, Storage};
use super::shape::Shape;
use crate::tape::error::{Error, Result};
use phyture_kernels::Real;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Largest number of inputs of one graph.
pub const MAX_INPUTS: usize = 8;

/// Which graph a handle is of: a number that no other graph of the process has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct GraphId(u64);

impl GraphId {
    fn next() -> Self {
        static LAST: AtomicU64 = AtomicU64::new(0);
        Self(LAST.fetch_add(1, Ordering::Relaxed))
    }
}

/// Handle to a value of the graph it was recorded on, and of its clones; any other graph refuses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Var(pub(crate) usize, GraphId);

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

pub(crate) struct Node<T> {
    pub source: Source<T>,
    pub shape: Shape,
}

impl<T> Clone for Node<T> {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), shape: self.shape }
    }
}

/// A recorded computation of one sample.
///
/// A clone takes over the handles recorded so far. What is recorded later on either of the two is its own.
///
/// # Examples
/// A loss (x − 3)² and its value at x = 5.
/// ```
/// use phyture::tape::ops::SquaredError;
/// use phyture::tape::{Graph, Session, Threads};
///
/// let mut graph = Graph::<f64>::default();
/// let x = graph.input("x", &[1, 1])?;
/// let target = graph.input("target", &[1, 1])?;
/// let loss = graph.apply(SquaredError { scale: 1.0 }, &[x, target])?;
/// let mut session = Session::infer(&graph, &[loss], Threads(1))?;
/// session.load(&[])?;
/// let fill = |_: usize, inputs: &mut [&mut [f64]]| {
///     inputs[0].fill(5.0);
///     inputs[1].fill(3.0);
/// };
/// session.predict(1, &fill, &mut |_, y| assert_eq!(y, [4.0]))?;
/// # Ok::<(), phyture::tape::Error>(())
/// ```
pub struct Graph<T> {
    pub(crate) nodes: Vec<Node<T>>,
    parameters: Vec<Parameter>,
    parameter_names: BTreeSet<String>,
    inputs: Vec<(String, Var)>,
    id: GraphId,
    /// Graphs it is a clone of, directly or not, each with how many of its values were recorded before.
    origins: Vec<(GraphId, usize)>,
}

impl<T> Clone for Graph<T> {
    fn clone(&self) -> Self {
        let mut origins = self.origins.clone();
        origins.push((self.id, self.nodes.len()));
        Self {
            nodes: self.nodes.clone(),
            parameters: self.parameters.clone(),
            parameter_names: self.parameter_names.clone(),
            inputs: self.inputs.clone(),
            id: GraphId::next(),
            origins,
        }
    }
}

impl<T: Real> Default for Graph<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Graph<T> {
    /// An empty graph.
    pub fn new() -> Self {
        Self {
            nodes: Vec::new(),
            parameters: Vec::new(),
            parameter_names: BTreeSet::new(),
            inputs: Vec::new(),
            id: GraphId::next(),
            origins: Vec::new(),
        }
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
        if !self.parameter_names.insert(name.to_owned()) {
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
            let Some(node) = self.node(*var) else {
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
        Var(self.nodes.len() - 1, self.id)
    }

    /// What a handle stands for; `None` if it is of another graph.
    pub(crate) fn node(&self, var: Var) -> Option<&Node<T>> {
        let is_origin = |(id, recorded): &(GraphId, usize)| *id == var.1 && var.0 < *recorded;
        let is_ours = var.1 == self.id || self.origins.iter().any(is_origin);
        self.nodes.get(var.0).filter(|_| is_ours)
    }

    /// Shape of a value; the empty shape for a handle of another graph.
    pub fn shape(&self, var: Var) -> Shape {
        self.node(var).map(|node| node.shape).unwrap_or_default()
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
            return Err(Error::Shape { operation: "linear", message: "a [7, 3] input passed a [5, 4] weight".into() });
        };
        let text = error.to_string();
        assert!(text.contains("linear") && text.contains("[7, 3]") && text.contains("[5, 4]"), "{text}");
        assert!(graph.parameter("weight", &[1]).is_err(), "a name was taken twice");
        assert!(graph.input("x", &[1]).is_err(), "an input name was taken twice");
        Ok(())
    }

    #[test]
    fn handles_of_another_graph_are_refused_whatever_their_number() -> Result<()> {
        use super::super::{Session, Threads};
        let record = |graph: &mut Graph<f64>| -> Result<[Var; 3]> {
            let (x, weight) = (graph.input("x", &[7, 3])?, graph.parameter("weight", &[3, 3])?);
            Ok([x, weight, graph.apply(Linear, &[x, weight])?])
        };
        let (mut ours, mut theirs) = (Graph::<f64>::new(), Graph::<f64>::new());
        let (own, foreign) = (record(&mut ours)?, record(&mut theirs)?);
        for foreign in foreign {
            // The same number, and the same shape, in both.
            let refused = ours.apply(Add, &[own[0], foreign]);
            assert!(refused.is_err_and(|error| error.to_string().contains("belongs to another graph")));
            assert!(ours.shape(foreign).is_empty());
        }
        assert!(Session::infer(&ours, &[foreign[2]], Threads(1)).is_err(), "an output of another graph");
        assert!(Session::infer(&ours, &[own[2]], Threads(1)).is_ok());
        // A clone knows the handles from before, and neither knows what the other records afterwards.
        let mut clone = ours.clone();
        let later = ours.apply(Add, &[own[2], own[0]])?;
        let in_clone = clone.apply(Add, &[own[2], own[0]])?;
        assert!(clone.apply(Add, &[own[2], later]).is_err() && ours.apply(Add, &[own[2], in_clone]).is_err());
        assert!(Session::train(&clone, later, &[], Threads(1)).is_err());
        assert!(clone.clone().apply(Add, &[own[0], in_clone]).is_ok(), "a clone's clone");
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
