//! Planning: from a graph to two flat lists of steps and one slab in which every buffer has a fixed place.
//!
//! 1. Keep what the loss and the outputs need.
//! 2. Derive the backward list: the operations on a path from a parameter (or an input whose gradient is asked for) to the loss,
//!    in reverse.
//! 3. The first writer of each gradient sets, later ones add: no pass fills zeros.
//! 4. From the lifetimes, place buffers greedily by size, first fit, 64-byte aligned.
//!
//! A plan holds no numbers; `session` replays it.

use super::graph::{Graph, Source, Var};
use super::op::{BUNDLE, Memory, Op, WEIGHT};
use super::shape::Shape;
use crate::error::{Error, Result};
use large_weights::{Bundles, complement};
use phyture_kernels::{Real, Write};
use std::ops::Range;
use std::sync::Arc;

mod large_weights;

pub(crate) use large_weights::LargeWeight;

/// Alignment of every buffer, bytes: one cache line, one 512-bit vector.
pub(crate) const ALIGNMENT_BYTES: usize = 64;

/// Most numbers that one sample may take: 4 GiB in f32, some hundred times what the paper's network takes. Sizes that come from a file
/// meet this bound before any memory is asked for.
pub(crate) const LARGEST_SLAB: usize = 1 << 30;

/// Elements of `T` in [`ALIGNMENT_BYTES`].
pub(crate) const fn alignment<T>() -> usize {
    let size = size_of::<T>();
    if size == 0 || size > ALIGNMENT_BYTES { 1 } else { ALIGNMENT_BYTES / size }
}

/// What a piece of the slab is to the step that borrows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    X(usize),
    Y,
    Workspace,
    Scratch,
    Dy,
    Dx(usize, Write),
}

/// A stretch of the slab (or of the flat parameter gradients), borrowed by one step.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub start: usize,
    pub len: usize,
    pub role: Role,
}

/// One call of one operation.
pub(crate) struct Step<T> {
    pub op: Arc<dyn Op<T>>,
    pub site: u64,
    pub shapes: Vec<Shape>,
    /// Disjoint, sorted by start.
    pub pieces: Vec<Piece>,
    /// Operands that are parameters, and their place in the flat slab.
    pub parameters: Vec<(usize, Range<usize>)>,
    /// Parameter gradients to write, by their place in a shard; disjoint, sorted by start. `Write::Set` means: set for the first sample
    /// of a shard.
    pub parameter_gradients: Vec<Piece>,
    /// The weight's place in the flat slab, and its packed form's place in that of the pass; `None` if nothing is packed.
    pub packed: Option<(Range<usize>, Range<usize>)>,
    /// Whether the operation takes some samples at once.
    pub bundled: bool,
    /// In the backward list, for the gradient of a large weight.
    pub kept: Option<Kept>,
}

/// What of a sample is kept until all samples are through: operand 0 and the gradient of the result.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    /// Their places in the slab.
    pub from: [Range<usize>; 2],
    /// Their places among what is kept of a sample.
    pub to: [Range<usize>; 2],
}

/// A stretch of the slab and the times in which it is in use, both ends included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Buffer {
    pub offset: usize,
    pub len: usize,
    pub first: usize,
    pub last: usize,
}

/// What a session replays for each sample.
pub(crate) struct Plan<T> {
    pub forward: Vec<Step<T>>,
    pub backward: Vec<Step<T>>,
    /// Input pieces, sorted by start; the role's index is the input's.
    pub inputs: Vec<Piece>,
    pub outputs: Vec<Range<usize>>,
    /// By input; `None` if not asked for or not connected to the loss.
    pub input_gradients: Vec<Option<Range<usize>>>,
    /// Value and gradient of the loss in the slab.
    pub loss: Option<(usize, usize)>,
    pub slab_len: usize,
    /// Samples that are in flight together on one worker.
    pub bundle: usize,
    /// Packed weights of the forward and of the backward list, one after another in the order of the list.
    pub packed_len: [usize; 2],
    pub parameter_len: usize,
    /// Parameters whose gradients are summed over the shards: their places in the flat slab, and in a shard.
    pub summed: Vec<(Range<usize>, usize)>,
    /// The other parameters, sorted by start.
    pub large_weights: Vec<LargeWeight>,
    /// Numbers kept of a sample for them, and scratch for their gradients.
    pub kept_len: usize,
    pub large_weight_scratch: usize,
    /// Parameters that no path joins to the loss: their gradient is zero.
    pub unreached: Vec<Range<usize>>,
    /// Of the forward and of the backward list: runs of steps without a coupling but, perhaps, at their start.
    pub stretches: [Vec<Range<usize>>; 2],
    #[cfg(test)]
    pub buffers: Vec<Buffer>,
}

/// Buffers while their lifetimes are being found; a value is referred to by its index.
struct Lifetimes {
    buffers: Vec<Buffer>,
}

impl Lifetimes {
    fn open(&mut self, len: usize, at: usize) -> usize {
        self.buffers.push(Buffer { offset: 0, len, first: at, last: at });
        self.buffers.len() - 1
    }

    fn used(&mut self, buffer: usize, at: usize) {
        let buffer = &mut self.buffers[buffer];
        buffer.first = buffer.first.min(at);
        buffer.last = buffer.last.max(at);
    }

    /// Greedy by size, first fit; returns the length of the slab.
    fn place(&mut self, alignment: usize) -> usize {
        let mut order: Vec<usize> = (0..self.buffers.len()).filter(|&index| self.buffers[index].len > 0).collect();
        order.sort_by_key(|&index| (std::cmp::Reverse(self.buffers[index].len), self.buffers[index].first, index));
        let mut placed: Vec<Buffer> = Vec::with_capacity(order.len());
        let mut slab_len = 0;
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
            slab_len = slab_len.max(offset + buffer.len);
        }
        slab_len
    }

    fn piece(&self, buffer: usize, role: Role) -> Piece {
        let Buffer { offset, len, .. } = self.buffers[buffer];
        Piece { start: offset, len, role }
    }

    fn range(&self, buffer: usize) -> Range<usize> {
        let Buffer { offset, len, .. } = self.buffers[buffer];
        offset..offset + len
    }
}

impl<T: Real> Plan<T> {
    /// Forward only: nothing is kept for a backward pass.
    pub fn infer(graph: &Graph<T>, outputs: &[Var]) -> Result<Self> {
        Self::compile(graph, None, outputs)
    }

    /// Forward and backward from `loss`, a value of one element.
    pub fn train(graph: &Graph<T>, loss: Var, outputs: &[Var]) -> Result<Self> {
        // A handle of another graph has no shape, and is refused with the outputs.
        if !graph.shape(loss).is_empty() && graph.shape(loss).len() != 1 {
            let message = format!("the loss has shape {}; expected [1]", graph.shape(loss));
            return Err(Error::Shape { operation: "train", message });
        }
        Self::compile(graph, Some(loss), outputs)
    }

    /// Gradients of a shard.
    pub fn shard_len(&self) -> usize {
        self.summed.iter().map(|(range, _)| range.len()).sum()
    }

    /// Numbers from one sample's slab to the next one's in a bundle.
    pub const fn lane_len(&self) -> usize {
        self.slab_len.next_multiple_of(alignment::<T>())
    }

    fn compile(graph: &Graph<T>, loss: Option<Var>, outputs: &[Var]) -> Result<Self> {
        let nodes = &graph.nodes;
        for var in loss.iter().chain(outputs) {
            if !graph.node(*var).is_some_and(|node| matches!(node.source, Source::Op { .. })) {
                let message = "a loss or output that no operation of this graph computes".into();
                return Err(Error::Shape { operation: "plan", message });
            }
        }
        let needed = ancestors(graph, loss.iter().chain(outputs).map(|var| var.0));
        let backward = loss.map_or(Ok(vec![false; nodes.len()]), |loss| paths(graph, loss))?;
        let is_op = |node: usize| matches!(nodes[node].source, Source::Op { .. });
        let forward_order: Vec<usize> = (0..nodes.len()).filter(|&node| needed[node] && is_op(node)).collect();
        let backward_order: Vec<usize> = forward_order.iter().rev().copied().filter(|&node| backward[node]).collect();
        let end = forward_order.len() + backward_order.len() + 1;

        // Lifetimes. Time 0 fills the inputs; each step takes one unit; `end` reads the results.
        let mut lifetimes = Lifetimes { buffers: Vec::new() };
        let mut values = vec![None; nodes.len()];
        let mut gradients: Vec<Option<usize>> = vec![None; nodes.len()];
        let mut workspaces = vec![None; nodes.len()];
        let mut scratches = vec![[None; 2]; nodes.len()];
        for &(_, var) in graph.inputs() {
            values[var.0] = Some(lifetimes.open(nodes[var.0].shape.len(), 0));
        }
        for (at, &node) in forward_order.iter().enumerate() {
            let at = at + 1;
            let Source::Op { op, operands } = &nodes[node].source else { continue };
            let memory: Memory = op.memory(&shapes_of(graph, operands));
            values[node] = Some(lifetimes.open(nodes[node].shape.len(), at));
            workspaces[node] = Some(lifetimes.open(memory.workspace, at));
            scratches[node] = [Some(lifetimes.open(memory.forward_scratch, at)), None];
            for buffer in operands.iter().filter_map(|var| values[var.0]) {
                lifetimes.used(buffer, at);
            }
        }
        let start_of_backward = forward_order.len() + 1;
        if let Some(loss) = loss {
            gradients[loss.0] = Some(lifetimes.open(1, start_of_backward));
        }
        for (at, &node) in backward_order.iter().enumerate() {
            let at = start_of_backward + at;
            let Source::Op { op, operands } = &nodes[node].source else { continue };
            let Some(differentiable) = op.differentiable() else { continue };
            let reads = differentiable.reads();
            let memory: Memory = op.memory(&shapes_of(graph, operands));
            scratches[node][1] = Some(lifetimes.open(memory.backward_scratch, at));
            let read = operands.iter().zip(reads.operands).filter(|(_, read)| *read).filter_map(|(var, _)| values[var.0]);
            let own = [workspaces[node], gradients[node], values[node].filter(|_| reads.result)];
            for buffer in read.chain(own.into_iter().flatten()) {
                lifetimes.used(buffer, at);
            }
            for (index, var) in operands.iter().enumerate() {
                if backward[var.0] && differentiable.reaches(index) && !matches!(nodes[var.0].source, Source::Parameter(_)) {
                    let buffer = *gradients[var.0].get_or_insert_with(|| lifetimes.open(nodes[var.0].shape.len(), at));
                    lifetimes.used(buffer, at);
                }
            }
        }
        for buffer in outputs.iter().chain(&loss).filter_map(|var| values[var.0]) {
            lifetimes.used(buffer, end);
        }
        let with_gradient = |var: &Var| matches!(nodes[var.0].source, Source::Input { gradient: true });
        for buffer in graph.inputs().iter().filter(|(_, var)| with_gradient(var)).filter_map(|(_, var)| gradients[var.0]) {
            lifetimes.used(buffer, end);
        }
        let slab_len = lifetimes.place(alignment::<T>());
        if slab_len > LARGEST_SLAB {
            let message = format!(
                "one sample takes {slab_len} numbers of memory; at most {LARGEST_SLAB} are allowed: make history or width smaller"
            );
            return Err(Error::Shape { operation: "plan", message });
        }

        // Steps, now that every place is known.
        let parameter_range = |node: usize| match nodes[node].source {
            Source::Parameter(index) => graph.parameters().get(index).map(|parameter| parameter.range()),
            _ => None,
        };
        let bundles = Bundles::of(graph, &forward_order, &backward_order);
        let mut large_weights = bundles.large_weights(graph);
        let summed = complement(large_weights.iter().map(|(_, weight)| weight.range.clone()), graph.parameter_count());
        let in_shard = |range: Range<usize>| {
            let (stretch, place) = summed.iter().find(|(stretch, _)| stretch.contains(&range.start))?;
            Some(place + range.start - stretch.start)
        };
        let step = |node: usize, backward: bool, written: &mut [bool], packed_len: &mut usize| -> Option<Step<T>> {
            let Source::Op { op, operands } = &nodes[node].source else { return None };
            let reads = if backward { Some(op.differentiable()?.reads()) } else { None };
            let mut pieces = Vec::new();
            let mut parameters = Vec::new();
            let mut parameter_gradients = Vec::new();
            for (index, &var) in operands.iter().enumerate() {
                if reads.is_none_or(|reads| reads.operands[index]) {
                    match parameter_range(var.0) {
                        Some(range) => parameters.push((index, range)),
                        None => pieces.push(lifetimes.piece(values[var.0]?, Role::X(index))),
                    }
                }
                let parameter = parameter_range(var.0);
                let wanted = backward && op.differentiable()?.reaches(index) && (parameter.is_some() || gradients[var.0].is_some());
                if wanted {
                    let write = if std::mem::replace(&mut written[var.0], true) { Write::Add } else { Write::Set };
                    let role = Role::Dx(index, write);
                    match parameter {
                        Some(_) if bundles.weights.contains(&var.0) => {}
                        Some(range) => {
                            let len = range.len();
                            parameter_gradients.push(Piece { start: in_shard(range)?, len, role });
                        }
                        None => pieces.push(lifetimes.piece(gradients[var.0]?, role)),
                    }
                }
            }
            pieces.push(lifetimes.piece(workspaces[node]?, Role::Workspace));
            pieces.push(lifetimes.piece(scratches[node][usize::from(backward)]?, Role::Scratch));
            if reads.is_none_or(|reads| reads.result) {
                pieces.push(lifetimes.piece(values[node]?, Role::Y));
            }
            if backward {
                pieces.push(lifetimes.piece(gradients[node]?, Role::Dy));
            }
            pieces.retain(|piece| piece.len > 0);
            pieces.sort_by_key(|piece| piece.start);
            parameter_gradients.sort_by_key(|piece| piece.start);
            let (op, shapes) = (Arc::clone(op), shapes_of(graph, operands));
            let memory: Memory = op.memory(&shapes);
            let len = if backward { memory.backward_packed } else { memory.forward_packed };
            let weight = operands.get(WEIGHT).and_then(|&var| parameter_range(var.0)).filter(|_| len > 0);
            let packed = weight.map(|weight| (weight, *packed_len..*packed_len + len));
            *packed_len += packed.as_ref().map_or(0, |(_, packed)| packed.len());
            let bundled = bundles.nodes.contains(&node);
            Some(Step { op, site: node as u64, shapes, pieces, parameters, parameter_gradients, packed, bundled, kept: None })
        };
        let mut written = vec![false; nodes.len()];
        let mut packed_len = [0; 2];
        let mut steps = |order: &[usize], backward: bool| -> Vec<Step<T>> {
            let packed_len = &mut packed_len[usize::from(backward)];
            order.iter().filter_map(|&node| step(node, backward, &mut written, packed_len)).collect()
        };
        let forward_steps = steps(&forward_order, false);
        let mut backward_steps = steps(&backward_order, true);
        let bundle = if forward_steps.iter().any(|step| step.bundled) { BUNDLE } else { 1 };
        let (mut kept_len, mut large_weight_scratch) = (0, 0);
        for (index, (&node, step)) in backward_order.iter().zip(&mut backward_steps).enumerate() {
            let Source::Op { operands, .. } = &nodes[node].source else { continue };
            let weight = operands.get(WEIGHT).filter(|_| step.bundled);
            let weight = weight.and_then(|var| large_weights.iter_mut().find(|(node, _)| *node == var.0));
            let (Some((_, weight)), Some(x), Some(dy)) = (weight, values[operands[0].0], gradients[node]) else { continue };
            weight.steps.push(index);
            let from = [x, dy].map(|buffer| lifetimes.range(buffer));
            let middle = kept_len + from[0].len();
            let end = middle + from[1].len();
            step.kept = Some(Kept { from, to: [kept_len..middle, middle..end] });
            kept_len = end;
            let scratch = step.op.bundled(&step.shapes).map_or(0, |op| op.weight_scratch(&step.shapes, weight.piece));
            large_weight_scratch = large_weight_scratch.max(scratch);
        }
        // Every step borrows only buffers opened above.
        debug_assert_eq!((forward_steps.len(), backward_steps.len()), (forward_order.len(), backward_order.len()));

        let mut inputs: Vec<Piece> = (graph.inputs().iter().enumerate())
            .filter_map(|(index, (_, var))| Some(lifetimes.piece(values[var.0]?, Role::X(index))))
            .collect();
        inputs.sort_by_key(|piece| piece.start);
        let unreached = (0..nodes.len()).filter(|&node| !written[node]).filter_map(parameter_range).collect();
        Ok(Self {
            stretches: [&forward_steps, &backward_steps].map(|steps| stretches(steps)),
            forward: forward_steps,
            backward: backward_steps,
            inputs,
            outputs: outputs.iter().filter_map(|var| values[var.0]).map(|buffer| lifetimes.range(buffer)).collect(),
            input_gradients: (graph.inputs().iter())
                .map(|(_, var)| gradients[var.0].filter(|_| with_gradient(var)).map(|buffer| lifetimes.range(buffer)))
                .collect(),
            loss: loss.and_then(|loss| Some((lifetimes.range(values[loss.0]?).start, lifetimes.range(gradients[loss.0]?).start))),
            slab_len,
            bundle,
            packed_len,
            parameter_len: graph.parameter_count(),
            summed,
            large_weights: large_weights.into_iter().map(|(_, weight)| weight).collect(),
            kept_len,
            large_weight_scratch,
            unreached,
            #[cfg(test)]
            buffers: lifetimes.buffers,
        })
    }
}

fn stretches<T: Real>(steps: &[Step<T>]) -> Vec<Range<usize>> {
    let couplings = steps.iter().enumerate().filter(|(_, step)| step.op.coupling().is_some()).map(|(index, _)| index);
    let starts: Vec<usize> = std::iter::once(0).chain(couplings).collect();
    let ends = starts.iter().skip(1).copied().chain([steps.len()]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

fn shapes_of<T: Real>(graph: &Graph<T>, operands: &[Var]) -> Vec<Shape> {
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

#[cfg(test)]
pub(crate) mod tests {
    use super::super::graph::Graph;
    use super::super::op::{Forward, Op};
    use super::super::ops::{Activation, Add, Half, Interleave, Linear, ScaleExp, SquaredError, Subtract};
    use super::*;
    use phyture_kernels::activation::Activation as Kind;
    use proptest::prelude::*;

    /// Rows and channels of every value of a random graph.
    const SHAPE: [usize; 2] = [6, 3];

    /// A graph of one operation for each number, on operands that the other two numbers choose among the earlier values.
    pub(crate) fn random_graph(recipe: &[(u8, usize, usize)]) -> Result<(Graph<f64>, Var, Vec<Var>)> {
        let mut graph = Graph::<f64>::new();
        let mut values = vec![graph.input_with_gradient("x", &SHAPE)?];
        for (index, &(kind, a, b)) in recipe.iter().enumerate() {
            let (a, b) = (values[a % values.len()], values[b % values.len()]);
            let value = match kind % 6 {
                0 => graph.apply(Add, &[a, b])?,
                1 => graph.apply(Subtract, &[a, b])?,
                2 => graph.apply(Activation { kind: Kind::Tanh }, &[a])?,
                3 => {
                    let bounded = graph.apply(Activation { kind: Kind::Tanh }, &[b])?;
                    graph.apply(ScaleExp, &[a, bounded])?
                }
                4 => {
                    let halves = (graph.apply(Half::Even, &[a])?, graph.apply(Half::Odd, &[b])?);
                    graph.apply(Interleave, &[halves.1, halves.0])?
                }
                _ => {
                    let weight = graph.parameter(&format!("{index}.weight"), &[SHAPE[1], SHAPE[1]])?;
                    let bias = graph.parameter(&format!("{index}.bias"), &[SHAPE[1]])?;
                    graph.apply(Linear, &[a, weight, bias])?
                }
            };
            values.push(value);
        }
        let target = graph.input("target", &SHAPE)?;
        let last = values[values.len() - 1];
        // Bounded, so that no chain of sums and exponentials leaves the range in which differences are exact enough.
        let bounded = graph.apply(Activation { kind: Kind::Tanh }, &[last])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[bounded, target])?;
        values.remove(0);
        Ok((graph, loss, values))
    }

    pub(crate) fn recipe() -> impl Strategy<Value = Vec<(u8, usize, usize)>> {
        proptest::collection::vec((0_u8..6, 0_usize..64, 0_usize..64), 1..24)
    }

    fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
        a.start < b.end && b.start < a.end
    }

    fn sound(plan: &Plan<f64>) -> Result<(), TestCaseError> {
        let used: Vec<&Buffer> = plan.buffers.iter().filter(|buffer| buffer.len > 0).collect();
        for (index, a) in used.iter().enumerate() {
            prop_assert_eq!(a.offset % alignment::<f64>(), 0);
            prop_assert!(a.offset + a.len <= plan.slab_len);
            for b in &used[index + 1..] {
                let together = a.first <= b.last && b.first <= a.last;
                let meet = overlap(&(a.offset..a.offset + a.len), &(b.offset..b.offset + b.len));
                prop_assert!(!(together && meet), "{:?} and {:?}", a, b);
            }
        }
        for step in plan.forward.iter().chain(&plan.backward) {
            for pieces in [&step.pieces, &step.parameter_gradients] {
                prop_assert!(pieces.windows(2).all(|pair| pair[0].start + pair[0].len <= pair[1].start));
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn live_buffers_never_overlap_and_gradients_are_set_once(recipe in recipe()) {
            let (graph, loss, values) = random_graph(&recipe)?;
            let train = Plan::train(&graph, loss, &values[..1])?;
            sound(&train)?;
            sound(&Plan::infer(&graph, &values)?)?;
            // Every gradient is first set, then added to.
            let mut seen = std::collections::BTreeSet::new();
            for step in &train.backward {
                for piece in &step.parameter_gradients {
                    let first = seen.insert(piece.start);
                    prop_assert_eq!(matches!(piece.role, Role::Dx(_, Write::Set)), first);
                }
            }
        }
    }

    #[test]
    fn inference_needs_less_memory_than_training() -> Result<()> {
        let chain: Vec<_> = (0..20).map(|at| (2, at, 0)).collect();
        let (graph, loss, values) = random_graph(&chain)?;
        let train = Plan::train(&graph, loss, &[])?.slab_len;
        let infer = Plan::infer(&graph, &values[values.len() - 1..])?.slab_len;
        // A chain needs an operand and a result at a time, beside the inputs.
        assert!(infer * 4 < train, "{infer} against {train}");
        Ok(())
    }

    struct OneWay;

    impl Op<f64> for OneWay {
        fn name(&self) -> &'static str {
            "one_way"
        }
        fn shape(&self, operands: &[Shape]) -> Result<Shape> {
            super::super::op::exactly::<1>("one_way", operands, "one").map(|[x]| x)
        }
        fn forward(&self, io: Forward<'_, f64>) {
            io.y.copy_from_slice(io.x[0]);
        }
    }

    #[test]
    fn a_graph_that_no_machine_can_hold_is_refused_before_its_slab_is_asked_for() -> Result<()> {
        let mut graph = Graph::<f64>::new();
        let x = graph.input("x", &[1 << 20, 1 << 10])?;
        let y = graph.apply(Activation { kind: Kind::Tanh }, &[x])?;
        let refused = Plan::infer(&graph, &[y]).map(|_| ());
        assert!(refused.is_err_and(|error| error.to_string().contains("make history or width smaller")));
        Ok(())
    }

    #[test]
    fn an_operation_without_backward_is_refused_by_name_only_where_it_matters() -> Result<()> {
        let mut graph = Graph::<f64>::new();
        let (x, target) = (graph.input("x", &[2, 2])?, graph.input("target", &[2, 2])?);
        let weight = graph.parameter("weight", &[2, 2])?;
        let constant = graph.apply(OneWay, &[x])?;
        let y = graph.apply(Linear, &[constant, weight])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[y, target])?;
        assert!(Plan::train(&graph, loss, &[]).is_ok(), "before the parameters it does no harm");
        let lost = graph.apply(OneWay, &[y])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[lost, target])?;
        assert!(matches!(Plan::train(&graph, loss, &[]), Err(Error::Shape { operation: "one_way", .. })));
        assert!(Plan::infer(&graph, &[lost]).is_ok());
        assert!(Plan::train(&graph, y, &[]).is_err(), "a loss of four numbers was accepted");
        assert!(Plan::infer(&graph, &[weight]).is_err(), "a parameter is no output");
        Ok(())
    }
}
