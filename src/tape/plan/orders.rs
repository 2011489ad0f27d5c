//! Which operations a plan runs, and in which order: all that the loss and the outputs need, and back along every path from a parameter to the loss.

use super::super::graph::{Graph, Source, Var};
use super::super::op::Op;
use super::super::shape::Shape;
use crate::tape::error::{Error, Result};
use phyture_kernels::Real;
use std::sync::Arc;

/// Which operations run, in the order of the graph and back.
pub(super) struct Orders {
    pub forward: Vec<usize>,
    pub backward: Vec<usize>,
    /// By node, whether its gradient is wanted.
    pub backpropagated: Vec<bool>,
}

impl Orders {
    pub fn of<T: Real>(graph: &Graph<T>, loss: Option<Var>, outputs: &[Var]) -> Result<Self> {
        let nodes = &graph.nodes;
        for var in loss.iter().chain(outputs) {
            if !graph.node(*var).is_some_and(|node| matches!(node.source, Source::Op { .. })) {
                let message = "a loss or output that no operation of this graph computes".into();
                return Err(Error::Shape { operation: "plan", message });
            }
        }
        let needed = ancestors(graph, loss.iter().chain(outputs).map(|var| var.0));
        let backpropagated = loss.map_or(Ok(vec![false; nodes.len()]), |loss| paths(graph, loss))?;
        let is_op = |node: usize| matches!(nodes[node].source, Source::Op { .. });
        let forward: Vec<usize> = (0..nodes.len()).filter(|&node| needed[node] && is_op(node)).collect();
        let backward = forward.iter().rev().copied().filter(|&node| backpropagated[node]).collect();
        Ok(Self { forward, backward, backpropagated })
    }

    /// Whether samples wait for each other at some operation.
    pub fn wait<T: Real>(&self, graph: &Graph<T>) -> bool {
        self.forward.iter().any(|&node| operation(graph, node).0.coupling().is_some())
    }
}

/// An operation of the graph and its operands, by a node of one of the lists.
pub(super) fn operation<T: Real>(graph: &Graph<T>, node: usize) -> (&Arc<dyn Op<T>>, &[Var]) {
    match &graph.nodes[node].source {
        Source::Op { op, operands } => (op, operands),
        Source::Input { .. } | Source::Parameter(_) => unreachable!("the lists hold operations alone"),
    }
}

/// Shapes of the operands.
pub(super) fn shapes_of<T: Real>(graph: &Graph<T>, operands: &[Var]) -> Vec<Shape> {
    operands.iter().map(|&var| graph.shape(var)).collect()
}

fn ancestors<T: Real>(graph: &Graph<T>, targets: impl Iterator<Item = usize>) -> Vec<bool> {
    let mut needed = vec![false; graph.nodes.len()];
    targets.for_each(|target| needed[target] = true);
    for node in (0..needed.len()).rev() {
        if let (true, Source::Op { operands, .. }) = (needed[node], &graph.nodes[node].source) {
            operands.iter().for_each(|var| needed[var.0] = true);
        }
    }
    needed
}

/// The nodes on a path from a parameter, or an input with gradient, to the loss.
fn paths<T: Real>(graph: &Graph<T>, loss: Var) -> Result<Vec<bool>> {
    // An operation without a backward pass counts as reaching all its operands, so that it is found and refused.
    let reaches = |op: &Arc<dyn Op<T>>, index| op.differentiable().is_none_or(|differentiable| differentiable.reaches(index));
    let mut from_parameter = vec![false; graph.nodes.len()];
    for (index, node) in graph.nodes.iter().enumerate() {
        from_parameter[index] = match &node.source {
            Source::Input { gradient } => *gradient,
            Source::Parameter(_) => true,
            Source::Op { op, operands } => operands.iter().enumerate().any(|(at, var)| from_parameter[var.0] && reaches(op, at)),
        };
    }
    let mut to_loss = vec![false; graph.nodes.len()];
    to_loss[loss.0] = true;
    for index in (0..graph.nodes.len()).rev() {
        if let (true, Source::Op { op, operands }) = (to_loss[index], &graph.nodes[index].source) {
            for (at, var) in operands.iter().enumerate() {
                to_loss[var.0] |= reaches(op, at);
            }
            if from_parameter[index] && op.differentiable().is_none() {
                let message = "it has no backward pass but stands between a parameter and the loss; \
                               give it one, or use it for inference only"
                    .into();
                return Err(Error::Shape { operation: op.name(), message });
            }
        }
    }
    if !from_parameter[loss.0] {
        let message = "the loss depends on no parameter and on no input whose gradient is asked for".into();
        return Err(Error::Shape { operation: "train", message });
    }
    Ok(from_parameter.iter().zip(&to_loss).map(|(from, to)| *from && *to).collect())
}
