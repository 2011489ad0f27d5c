//! Planning: from a graph to two flat lists of steps and one slab in which every buffer has a fixed place.
//!
//! 1. Keep what the loss and the outputs need.
//! 2. Derive the backward list: the operations on a path from a parameter (or an input whose gradient is asked for) to the loss,
//!    in reverse.
//! 3. The first writer of each gradient sets, later ones add: no pass fills zeros.
//! 4. From the lifetimes, place buffers greedily by size, first fit, 64-byte aligned.
//!
//! Points 1 and 2 are in `plan/orders`, point 3 in `plan/steps`, point 4 in `plan/layout`. A plan holds no numbers; `session` replays it.

use super::graph::{Graph, Var};
use super::op::MICRO_BATCH;
use super::slab::alignment;
use crate::tape::error::{Error, Result};
use large_weights::{MicroBatches, complement};
use layout::Layout;
use orders::Orders;
use phyture_kernels::Real;
use std::ops::Range;
use steps::{Direction, Steps};

mod large_weights;
mod layout;
mod orders;
mod step;
mod steps;

pub(crate) use large_weights::LargeWeight;
pub(crate) use step::{Piece, Role, Step};

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
    pub micro_batch: usize,
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
    pub buffers: Vec<layout::Buffer>,
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

    /// Numbers from one sample's slab to the next one's in a micro-batch.
    pub const fn lane_len(&self) -> usize {
        self.slab_len.next_multiple_of(alignment::<T>())
    }

    fn compile(graph: &Graph<T>, loss: Option<Var>, outputs: &[Var]) -> Result<Self> {
        let orders = Orders::of(graph, loss, outputs)?;
        let layout = Layout::of(graph, &orders, loss, outputs)?;
        // Where the weights are more than what a sample holds, reading them from memory is what a step of training waits for; samples that
        // take turns at an operation find them in the cache.
        let take_turns = loss.is_some() && !orders.wait(graph) && layout.slab_len < graph.parameter_count();
        let micro_batches = MicroBatches::of(graph, &orders, take_turns);
        let mut large_weights = micro_batches.large_weights(graph);
        let summed = complement(large_weights.iter().map(|(_, weight)| weight.range.clone()), graph.parameter_count());
        let mut steps = Steps::new(graph, &layout, &micro_batches, &summed);
        let (forward, forward_packed) = steps.list(&orders.forward, Direction::Forward);
        let (mut backward, backward_packed) = steps.list(&orders.backward, Direction::Backward);
        let kept = steps.keep(&orders.backward, &mut backward, &mut large_weights);
        let takes_some = forward.iter().any(|step| step.micro_batched);
        Ok(Self {
            stretches: [&forward, &backward].map(|steps| stretches(steps)),
            forward,
            backward,
            inputs: layout.inputs(graph),
            outputs: outputs.iter().map(|var| layout.value(var.0)).collect(),
            input_gradients: layout.input_gradients(graph),
            loss: loss.map(|loss| (layout.value(loss.0).start, layout.gradient(loss.0).start)),
            slab_len: layout.slab_len,
            micro_batch: if takes_some || take_turns { MICRO_BATCH } else { 1 },
            packed_len: [forward_packed, backward_packed],
            parameter_len: graph.parameter_count(),
            unreached: steps.unreached(),
            large_weights: large_weights.into_iter().map(|(_, weight)| weight).collect(),
            kept_len: kept.len,
            large_weight_scratch: kept.scratch,
            #[cfg(test)]
            buffers: layout.buffers,
            summed,
        })
    }
}

fn stretches<T: Real>(steps: &[Step<T>]) -> Vec<Range<usize>> {
    let couplings = steps.iter().enumerate().filter(|(_, step)| step.op.coupling().is_some()).map(|(index, _)| index);
    let starts: Vec<usize> = std::iter::once(0).chain(couplings).collect();
    let ends = starts.iter().skip(1).copied().chain([steps.len()]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::graph::Graph;
    use super::super::op::{Forward, Op};
    use super::super::ops::{Activation, Add, Half, Interleave, Linear, ScaleExp, SquaredError, Subtract};
    use super::super::shape::Shape;
    use super::*;
    use phyture_kernels::Write;
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
        let used: Vec<&layout::Buffer> = plan.buffers.iter().filter(|buffer| buffer.len > 0).collect();
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
