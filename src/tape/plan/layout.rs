//! Where each buffer of a sample lies: its lifetime over the two lists, then a place in the slab. What a step does with a buffer is the
//! business of `steps`.

use super::super::graph::{Graph, Source, Var};
use super::super::op::Memory;
use super::super::slab::alignment;
use super::orders::{Orders, operation, shapes_of};
use super::step::{Piece, Role};
use crate::tape::error::{Error, Result};
use phyture_kernels::Real;
use std::ops::Range;

/// Most numbers that one sample may take: 4 GiB in f32, some hundred times what the paper's network takes. Sizes that come from a file
/// meet this bound before any memory is asked for.
pub(crate) const LARGEST_SLAB: usize = 1 << 30;

/// A stretch of the slab and the times in which it is in use, both ends included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Buffer {
    pub offset: usize,
    pub len: usize,
    pub first: usize,
    pub last: usize,
}

/// The buffers of a sample. Values, gradients, workspaces and scratch are referred to by node; each is an index into `buffers`.
pub(super) struct Layout {
    pub buffers: Vec<Buffer>,
    values: Vec<Option<usize>>,
    gradients: Vec<Option<usize>>,
    workspaces: Vec<Option<usize>>,
    /// Of the forward and of the backward step.
    scratches: Vec<[Option<usize>; 2]>,
    pub slab_len: usize,
}

impl Layout {
    /// Time 0 fills the inputs; each step takes one unit; the results are read at the end.
    pub fn of<T: Real>(graph: &Graph<T>, orders: &Orders, loss: Option<Var>, outputs: &[Var]) -> Result<Self> {
        let count = graph.nodes.len();
        let mut layout = Self {
            buffers: Vec::new(),
            values: vec![None; count],
            gradients: vec![None; count],
            workspaces: vec![None; count],
            scratches: vec![[None; 2]; count],
            slab_len: 0,
        };
        for &(_, var) in graph.inputs() {
            layout.values[var.0] = Some(layout.open(graph.nodes[var.0].shape.len(), 0));
        }
        layout.forward(graph, orders);
        layout.backward(graph, orders, loss);
        layout.keep_results(graph, orders, loss, outputs);
        layout.place(alignment::<T>());
        if layout.slab_len > LARGEST_SLAB {
            let message = format!(
                "one sample takes {} numbers of memory; at most {LARGEST_SLAB} are allowed: make history or width smaller",
                layout.slab_len
            );
            return Err(Error::Shape { operation: "plan", message });
        }
        Ok(layout)
    }

    fn open(&mut self, len: usize, at: usize) -> usize {
        self.buffers.push(Buffer { offset: 0, len, first: at, last: at });
        self.buffers.len() - 1
    }

    fn used(&mut self, buffer: usize, at: usize) {
        let buffer = &mut self.buffers[buffer];
        buffer.first = buffer.first.min(at);
        buffer.last = buffer.last.max(at);
    }

    fn forward<T: Real>(&mut self, graph: &Graph<T>, orders: &Orders) {
        for (at, &node) in orders.forward.iter().enumerate() {
            let at = at + 1;
            let (op, operands) = operation(graph, node);
            let memory: Memory = op.memory(&shapes_of(graph, operands));
            self.values[node] = Some(self.open(graph.nodes[node].shape.len(), at));
            self.workspaces[node] = Some(self.open(memory.workspace, at));
            self.scratches[node][0] = Some(self.open(memory.forward_scratch, at));
            for var in operands {
                if let Some(value) = self.values[var.0] {
                    self.used(value, at);
                }
            }
        }
    }

    fn backward<T: Real>(&mut self, graph: &Graph<T>, orders: &Orders, loss: Option<Var>) {
        let start = orders.forward.len() + 1;
        if let Some(loss) = loss {
            self.gradients[loss.0] = Some(self.open(1, start));
        }
        for (at, &node) in orders.backward.iter().enumerate() {
            let at = start + at;
            let (op, operands) = operation(graph, node);
            let differentiable = op.differentiable().expect("a path without it was refused");
            let reads = differentiable.reads();
            let memory: Memory = op.memory(&shapes_of(graph, operands));
            self.scratches[node][1] = Some(self.open(memory.backward_scratch, at));
            let read = operands.iter().zip(reads.operands).filter(|(_, read)| *read).map(|(var, _)| self.values[var.0]);
            let own = [self.workspaces[node], self.gradients[node], self.values[node].filter(|_| reads.result)];
            let read: Vec<usize> = read.chain(own).flatten().collect();
            read.into_iter().for_each(|buffer| self.used(buffer, at));
            for (index, var) in operands.iter().enumerate() {
                let is_parameter = matches!(graph.nodes[var.0].source, Source::Parameter(_));
                if orders.backpropagated[var.0] && differentiable.reaches(index) && !is_parameter {
                    let known = self.gradients[var.0];
                    let buffer = known.unwrap_or_else(|| self.open(graph.nodes[var.0].shape.len(), at));
                    self.gradients[var.0] = Some(buffer);
                    self.used(buffer, at);
                }
            }
        }
    }

    /// Outputs, the loss and the gradients of inputs live to the end.
    fn keep_results<T: Real>(&mut self, graph: &Graph<T>, orders: &Orders, loss: Option<Var>, outputs: &[Var]) {
        let end = orders.forward.len() + orders.backward.len() + 1;
        let values = outputs.iter().chain(&loss).filter_map(|var| self.values[var.0]);
        let asked = graph.inputs().iter().filter(|(_, var)| has_gradient(graph, *var));
        let gradients = asked.filter_map(|(_, var)| self.gradients[var.0]);
        let kept: Vec<usize> = values.chain(gradients).collect();
        kept.into_iter().for_each(|buffer| self.used(buffer, end));
    }

    /// Greedy by size, first fit.
    fn place(&mut self, alignment: usize) {
        let mut order: Vec<usize> = (0..self.buffers.len()).filter(|&index| self.buffers[index].len > 0).collect();
        order.sort_by_key(|&index| (std::cmp::Reverse(self.buffers[index].len), self.buffers[index].first, index));
        let mut placed: Vec<Buffer> = Vec::with_capacity(order.len());
        for index in order {
            let buffer = self.buffers[index];
            let mut offset = 0;
            // `placed` is sorted by offset, so one pass finds the first gap.
            for other in placed.iter().filter(|other| other.first <= buffer.last && buffer.first <= other.last) {
                if other.offset >= offset + buffer.len {
                    break;
                }
                offset = offset.max((other.offset + other.len).next_multiple_of(alignment));
            }
            self.buffers[index].offset = offset;
            let at = placed.partition_point(|other| other.offset <= offset);
            placed.insert(at, self.buffers[index]);
            self.slab_len = self.slab_len.max(offset + buffer.len);
        }
    }

    fn range(&self, buffer: usize) -> Range<usize> {
        let Buffer { offset, len, .. } = self.buffers[buffer];
        offset..offset + len
    }

    /// Of a value that an operation computes or an input holds.
    pub fn value(&self, node: usize) -> Range<usize> {
        self.range(self.values[node].expect("computed before it is read"))
    }

    /// Of the gradient of a node on a path to the loss.
    pub fn gradient(&self, node: usize) -> Range<usize> {
        self.range(self.gradients[node].expect("a later operation writes it"))
    }

    /// Whether a node that is no parameter has a gradient.
    pub fn has_gradient(&self, node: usize) -> bool {
        self.gradients[node].is_some()
    }

    pub fn workspace(&self, node: usize) -> Range<usize> {
        self.range(self.workspaces[node].expect("opened with its operation"))
    }

    /// Of the forward (0) or the backward step (1) of an operation.
    pub fn scratch(&self, node: usize, direction: usize) -> Range<usize> {
        self.range(self.scratches[node][direction].expect("opened with its step"))
    }

    /// The graph's inputs, sorted by start.
    pub fn inputs<T: Real>(&self, graph: &Graph<T>) -> Vec<Piece> {
        let piece = |(index, (_, var)): (usize, &(String, Var))| Piece::new(self.value(var.0), Role::X(index));
        let mut inputs: Vec<Piece> = graph.inputs().iter().enumerate().map(piece).collect();
        inputs.sort_by_key(|piece| piece.start);
        inputs
    }

    /// By input; `None` if not asked for or not connected to the loss.
    pub fn input_gradients<T: Real>(&self, graph: &Graph<T>) -> Vec<Option<Range<usize>>> {
        let of = |(_, var): &(String, Var)| {
            let gradient = self.gradients[var.0].filter(|_| has_gradient(graph, *var));
            gradient.map(|buffer| self.range(buffer))
        };
        graph.inputs().iter().map(of).collect()
    }
}

/// Whether the gradient of an input is asked for.
fn has_gradient<T: Real>(graph: &Graph<T>, var: Var) -> bool {
    matches!(graph.nodes[var.0].source, Source::Input { gradient: true })
}
