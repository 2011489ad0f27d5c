//! The steps of the two lists, now that every buffer has its place. Where that is, is the business of `layout`.

use super::super::graph::{Graph, Source};
use super::super::op::{Memory, WEIGHT};
use super::large_weights::{LargeWeight, MicroBatches};
use super::layout::Layout;
use super::orders::{operation, shapes_of};
use super::step::{Kept, Piece, Role, Step};
use phyture_kernels::{Real, Write};
use std::ops::Range;
use std::sync::Arc;

/// Which of the two lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Backward,
}

/// What is kept of a sample for the gradients of large weights.
pub(super) struct KeptSize {
    pub len: usize,
    /// Scratch of the largest of these gradients.
    pub scratch: usize,
}

/// Makes steps, in the order in which they will run: the first that writes a gradient sets it, later ones add.
pub(super) struct Steps<'a, T> {
    graph: &'a Graph<T>,
    layout: &'a Layout,
    micro_batches: &'a MicroBatches,
    summed: &'a [(Range<usize>, usize)],
    /// By node, whether a step made so far writes its gradient.
    written: Vec<bool>,
}

impl<'a, T: Real> Steps<'a, T> {
    pub fn new(
        graph: &'a Graph<T>,
        layout: &'a Layout,
        micro_batches: &'a MicroBatches,
        summed: &'a [(Range<usize>, usize)],
    ) -> Self {
        Self { graph, layout, micro_batches, summed, written: vec![false; graph.nodes.len()] }
    }

    /// The steps of a list, and the length of its packed weights.
    pub fn list(&mut self, order: &[usize], direction: Direction) -> (Vec<Step<T>>, usize) {
        let mut packed_len = 0;
        let steps = order.iter().map(|&node| self.step(node, direction, &mut packed_len)).collect();
        (steps, packed_len)
    }

    fn step(&mut self, node: usize, direction: Direction, packed_len: &mut usize) -> Step<T> {
        let (op, operands) = operation(self.graph, node);
        let (op, shapes) = (Arc::clone(op), shapes_of(self.graph, operands));
        let (mut pieces, parameters) = self.read(node, direction);
        let mut parameter_gradients = Vec::new();
        if direction == Direction::Backward {
            self.write(node, &mut pieces, &mut parameter_gradients);
        }
        pieces.retain(|piece| piece.len > 0);
        pieces.sort_by_key(|piece| piece.start);
        parameter_gradients.sort_by_key(|piece| piece.start);
        let memory: Memory = op.memory(&shapes);
        let len = match direction {
            Direction::Forward => memory.forward_packed,
            Direction::Backward => memory.backward_packed,
        };
        let weight = operands.get(WEIGHT).and_then(|&var| self.parameter(var.0)).filter(|_| len > 0);
        let packed = weight.map(|weight| (weight, *packed_len..*packed_len + len));
        *packed_len += packed.as_ref().map_or(0, |(_, packed)| packed.len());
        let micro_batched = self.micro_batches.nodes.contains(&node);
        Step { op, site: node as u64, shapes, pieces, parameters, parameter_gradients, packed, micro_batched, kept: None }
    }

    /// What a step reads, with its workspace and scratch, and the result of a forward step; and the parameters among its operands.
    fn read(&self, node: usize, direction: Direction) -> (Vec<Piece>, Vec<(usize, Range<usize>)>) {
        let (op, operands) = operation(self.graph, node);
        let reads = match direction {
            Direction::Forward => None,
            Direction::Backward => Some(op.differentiable().expect("a path without it was refused").reads()),
        };
        let (mut pieces, mut parameters) = (Vec::new(), Vec::new());
        for (index, &var) in operands.iter().enumerate().filter(|(index, _)| reads.is_none_or(|reads| reads.operands[*index])) {
            match self.parameter(var.0) {
                Some(range) => parameters.push((index, range)),
                None => pieces.push(Piece::new(self.layout.value(var.0), Role::X(index))),
            }
        }
        pieces.push(Piece::new(self.layout.workspace(node), Role::Workspace));
        pieces.push(Piece::new(self.layout.scratch(node, direction as usize), Role::Scratch));
        if reads.is_none_or(|reads| reads.result) {
            pieces.push(Piece::new(self.layout.value(node), Role::Y));
        }
        if direction == Direction::Backward {
            pieces.push(Piece::new(self.layout.gradient(node), Role::Dy));
        }
        (pieces, parameters)
    }

    /// The gradients that a backward step writes. Those of weights that are large are made apart, when all samples are through.
    fn write(&mut self, node: usize, pieces: &mut Vec<Piece>, parameter_gradients: &mut Vec<Piece>) {
        let (op, operands) = operation(self.graph, node);
        let differentiable = op.differentiable().expect("a path without it was refused");
        for (index, &var) in operands.iter().enumerate() {
            let parameter = self.parameter(var.0);
            let is_wanted = parameter.is_some() || self.layout.has_gradient(var.0);
            if !(is_wanted && differentiable.reaches(index)) {
                continue;
            }
            let write = if std::mem::replace(&mut self.written[var.0], true) { Write::Add } else { Write::Set };
            let role = Role::Dx(index, write);
            match parameter {
                Some(_) if self.micro_batches.weights.contains(&var.0) => {}
                Some(range) => parameter_gradients.push(Piece::new(self.in_shard(&range), role)),
                None => pieces.push(Piece::new(self.layout.gradient(var.0), role)),
            }
        }
    }

    /// Notes in the backward steps of large weights what is kept of a sample for their gradients.
    pub fn keep(&self, order: &[usize], steps: &mut [Step<T>], large_weights: &mut [(usize, LargeWeight)]) -> KeptSize {
        let mut size = KeptSize { len: 0, scratch: 0 };
        for (index, (&node, step)) in order.iter().zip(steps).enumerate().filter(|(_, (_, step))| step.micro_batched) {
            let (_, operands) = operation(self.graph, node);
            let own = operands.get(WEIGHT).and_then(|var| large_weights.iter_mut().find(|(node, _)| *node == var.0));
            let Some((_, weight)) = own else { continue };
            weight.steps.push(index);
            let from = [self.layout.value(operands[0].0), self.layout.gradient(node)];
            let middle = size.len + from[0].len();
            let end = middle + from[1].len();
            step.kept = Some(Kept { from, to: [size.len..middle, middle..end] });
            size.len = end;
            let scratch = step.op.large_weight(&step.shapes).map_or(0, |op| op.weight_scratch(&step.shapes, weight.piece));
            size.scratch = size.scratch.max(scratch);
        }
        size
    }

    /// The parameters that no step made so far gives a gradient.
    pub fn unreached(&self) -> Vec<Range<usize>> {
        let nodes = 0..self.graph.nodes.len();
        nodes.filter(|&node| !self.written[node]).filter_map(|node| self.parameter(node)).collect()
    }

    /// Place of a parameter in the flat slab; `None` if the node is no parameter.
    fn parameter(&self, node: usize) -> Option<Range<usize>> {
        match self.graph.nodes[node].source {
            Source::Parameter(index) => Some(self.graph.parameters()[index].range()),
            _ => None,
        }
    }

    /// Place in a shard of a parameter that is summed over the shards.
    fn in_shard(&self, range: &Range<usize>) -> Range<usize> {
        let summed = self.summed.iter().find(|(stretch, _)| stretch.contains(&range.start));
        let (stretch, place) = summed.expect("all but the large weights are summed");
        let start = place + range.start - stretch.start;
        start..start + range.len()
    }
}
