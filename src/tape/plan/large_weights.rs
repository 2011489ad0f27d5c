//! Which operations take some samples at once: those on weights that are large, whose gradients are made once from all samples of a step, and where
//! samples take turns those that gain by it. Where their other buffers lie is the plan's; the arithmetic is that of `ops` and of the session.

use super::orders::{Orders, operation, shapes_of};
use crate::tape::graph::{Graph, Source, Var};
use crate::tape::op::WEIGHT;
use phyture_kernels::Real;
use std::collections::BTreeSet;
use std::ops::Range;

/// A parameter whose gradient is made once from all samples of a step.
#[derive(Clone, Debug)]
pub(crate) struct LargeWeight {
    /// Its place in the flat slab.
    pub range: Range<usize>,
    /// Its rows, and how many of them are worked on at a time.
    pub rows: usize,
    pub piece: usize,
    /// The steps of the backward list that it takes part in.
    pub steps: Vec<usize>,
}

/// Numbers of a large weight whose gradient one thread makes at a time: a megabyte in f32.
const LARGE_WEIGHT_PIECE: usize = 1 << 18;

/// Which operations take some samples at once, and which parameters have their gradients made from all samples of a step.
pub(super) struct MicroBatches {
    /// Operations, by node.
    pub nodes: BTreeSet<usize>,
    /// Parameters, by node.
    pub weights: BTreeSet<usize>,
}

impl MicroBatches {
    /// None where samples wait for each other. A weight of which a part of the gradient comes sample by sample is no large weight. Where samples take
    /// turns, be it for the sake of a large weight, operations take some at once that gain by it.
    pub fn of<T: Real>(graph: &Graph<T>, orders: &Orders, take_turns: bool) -> Self {
        if orders.wait(graph) {
            return Self { nodes: BTreeSet::new(), weights: BTreeSet::new() };
        }
        let nodes = &graph.nodes;
        let is_parameter = |var: &Var| matches!(nodes[var.0].source, Source::Parameter(_));
        let suits = |&node: &usize| {
            let (op, operands) = operation(graph, node);
            let (x, weights) = operands.split_at(WEIGHT.min(operands.len()));
            !x.iter().any(is_parameter)
                && weights.iter().all(is_parameter)
                && op.micro_batched(&shapes_of(graph, operands)).is_some()
        };
        let is_large = |&node: &usize| {
            let (op, operands) = operation(graph, node);
            op.large_weight(&shapes_of(graph, operands)).is_some()
        };
        let (mut weights, mut others) = (BTreeSet::new(), BTreeSet::new());
        for node in &orders.backward {
            let is_large = suits(node) && is_large(node);
            for (index, var) in operation(graph, *node).1.iter().enumerate().filter(|(_, var)| is_parameter(var)) {
                if is_large && index == WEIGHT {
                    weights.insert(var.0)
                } else {
                    others.insert(var.0)
                };
            }
        }
        weights.retain(|weight| !others.contains(weight));
        let is_whole = |node: &usize| operation(graph, *node).1.get(WEIGHT).is_some_and(|weight| !others.contains(&weight.0));
        let (large, gaining): (Vec<usize>, Vec<usize>) = orders.forward.iter().copied().filter(suits).partition(is_large);
        let mut nodes: BTreeSet<usize> = large.into_iter().filter(is_whole).collect();
        if take_turns || !nodes.is_empty() {
            nodes.extend(gaining);
        }
        Self { nodes, weights }
    }

    /// The weights with their places in the flat slab, sorted by these, each with its node; no steps yet.
    pub fn large_weights<T: Real>(&self, graph: &Graph<T>) -> Vec<(usize, LargeWeight)> {
        let weight = |&node: &usize| {
            let Source::Parameter(index) = graph.nodes[node].source else { return None };
            let (range, (rows, inputs)) = (graph.parameters().get(index)?.range(), graph.nodes[node].shape.rows());
            Some((node, LargeWeight { range, rows, piece: (LARGE_WEIGHT_PIECE / inputs).max(1).min(rows), steps: Vec::new() }))
        };
        let mut weights: Vec<_> = self.weights.iter().filter_map(weight).collect();
        weights.sort_by_key(|(_, weight)| weight.range.start);
        weights
    }
}

/// The stretches of `0..len` between some ranges, sorted by start, each with its place if they are laid one after another.
pub(super) fn complement(ranges: impl Iterator<Item = Range<usize>>, len: usize) -> Vec<(Range<usize>, usize)> {
    let (mut at, mut place, mut stretches) = (0, 0, Vec::new());
    for range in ranges.chain(std::iter::once(len..len)) {
        if at < range.start {
            stretches.push((at..range.start, place));
            place += range.start - at;
        }
        at = range.end;
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::super::Plan;
    use super::*;
    use crate::tape::error::Result;
    use crate::tape::ops::{Add, Linear, SquaredError, Temporal};

    #[test]
    fn a_weight_with_a_use_of_another_kind_is_no_large_weight() -> Result<()> {
        for other_use in [false, true] {
            let mut graph = Graph::<f64>::new();
            let (x, rows) = (graph.input("x", &[256, 2])?, graph.input("rows", &[2, 256])?);
            let weight = graph.parameter("weight", &[256, 256])?;
            let over_time = graph.apply(Temporal, &[x, weight])?;
            let target = graph.input("target", &[256, 2])?;
            let mut loss = graph.apply(SquaredError { scale: 1.0 }, &[over_time, target])?;
            if other_use {
                let target = graph.input("another", &[2, 256])?;
                let linear = graph.apply(Linear, &[rows, weight])?;
                let error = graph.apply(SquaredError { scale: 1.0 }, &[linear, target])?;
                loss = graph.apply(Add, &[loss, error])?;
            }
            let plan = Plan::train(&graph, loss, &[])?;
            let at_once = plan.forward.iter().any(|step| step.micro_batched);
            assert_eq!((at_once, plan.large_weights.len()), (!other_use, usize::from(!other_use)));
            assert_eq!(plan.shard_len(), if other_use { 256 * 256 } else { 0 });
        }
        Ok(())
    }

    #[test]
    fn a_complement_is_what_is_left_laid_end_to_end() {
        let found = complement([2..5, 5..6, 9..12].into_iter(), 12);
        assert_eq!(found, [(0..2, 0), (6..9, 2)]);
        assert_eq!(complement(std::iter::empty(), 3), [(0..3, 0)]);
        assert_eq!(complement(std::iter::once(0..3), 3), []);
    }
}
