//! A step in which samples wait for each other: for plans with an operation that couples them.
//!
//! Every sample has a slab of its own. All run up to the next coupling, give their parts, these are combined in the order of the samples,
//! and all go on; likewise backward. Shards, their gradients and the order of summation are those of the session, so that again the
//! number of threads changes no bit.

use super::replay::Replay;
use super::shards::Shard;
use crate::tape::op::{Coupled, Pass};
use crate::tape::plan::Plan;
use crate::tape::slab::Slab;
use phyture_kernels::Real;

/// One sample.
struct Lane<T> {
    slab: Slab<T>,
    part: Vec<T>,
}

/// All samples of a step. What is allocated in a step is kept for the next one.
pub(super) struct Lockstep<T> {
    lanes: Vec<Lane<T>>,
    parts: Vec<T>,
    /// Total of each coupling of the last forward pass.
    totals: Vec<Vec<T>>,
    /// Total of the coupling that the backward pass was at last.
    backward_total: Vec<T>,
    /// Samples that gave the totals; 0 once these are settled.
    samples: usize,
}

impl<T> Default for Lockstep<T> {
    fn default() -> Self {
        Self { lanes: Vec::new(), parts: Vec::new(), totals: Vec::new(), backward_total: Vec::new(), samples: 0 }
    }
}

/// What is done with one sample: in its shard, in its lane, by its index, and whether it is the first of the shard.
type Work<'a, T> = &'a (dyn Fn(&mut Shard<T>, &mut Lane<T>, usize, bool) + Sync);

/// The samples of these shards, shards side by side, the samples of each in order.
fn each<T: Real>(replay: &Replay<'_, T>, shards: &mut [Shard<T>], first: usize, lanes: &mut [Lane<T>], work: Work<'_, T>) {
    match shards {
        [] => {}
        [shard] => {
            let start = replay.first_sample(first);
            lanes.iter_mut().enumerate().for_each(|(index, lane)| work(shard, lane, start + index, index == 0));
        }
        _ => {
            let (low, high) = shards.split_at_mut(shards.len() / 2);
            let middle = first + low.len();
            let (low_lanes, high_lanes) = lanes.split_at_mut(replay.first_sample(middle) - replay.first_sample(first));
            replay.parallelism.join(|| each(replay, low, first, low_lanes, work), || each(replay, high, middle, high_lanes, work));
        }
    }
}

impl<T: Real> Lockstep<T> {
    /// One step of a session.
    pub fn run(&mut self, replay: &Replay<'_, T>, shards: &mut [Shard<T>], losses: &mut [f64], results: &mut [T]) {
        let samples = replay.samples;
        while self.lanes.len() < samples {
            self.lanes.push(Lane { slab: Slab::new(replay.plan.slab_len), part: Vec::new() });
        }
        self.samples = samples;
        let couplings = replay.plan.stretches[0].len() - 1;
        self.totals.resize_with(couplings.max(self.totals.len()), Vec::new);
        each(replay, shards, 0, &mut self.lanes[..samples], &|_, lane, sample, _| replay.begin(lane.slab.aligned(), sample));
        self.pass(replay, shards, Pass::Forward);
        if let Some((value, gradient)) = replay.plan.loss {
            for (lane, loss) in self.lanes.iter_mut().zip(losses) {
                let slab = lane.slab.aligned();
                *loss = slab[value].f64();
                slab[gradient] = T::of(1.0 / samples as f64);
            }
            self.pass(replay, shards, Pass::Backward);
        }
        for (lane, result) in self.lanes.iter_mut().zip(results.chunks_exact_mut(replay.result_len.max(1))) {
            replay.finish(lane.slab.aligned(), result);
        }
    }

    /// All steps of one pass.
    fn pass(&mut self, replay: &Replay<'_, T>, shards: &mut [Shard<T>], pass: Pass) {
        let Self { lanes, parts, totals, backward_total, .. } = self;
        let samples = replay.samples;
        let lanes = &mut lanes[..samples];
        let (steps, stretches) = match pass {
            Pass::Forward => (&replay.plan.forward, &replay.plan.stretches[0]),
            Pass::Backward => (&replay.plan.backward, &replay.plan.stretches[1]),
        };
        for (number, stretch) in stretches.iter().enumerate() {
            let next = steps.get(stretch.end).and_then(|step| Some((step, step.op.coupling()?)));
            let part_len = next.map_or(0, |(step, coupling)| coupling.part_len(&step.shapes));
            // The coupling that this stretch begins with; the first one begins with none.
            let total: Option<&[T]> = number.checked_sub(1).map(|before| match pass {
                Pass::Forward => totals[before].as_slice(),
                Pass::Backward => backward_total.as_slice(),
            });
            each(replay, shards, 0, lanes, &|shard, lane, sample, first| {
                let Lane { slab, part } = lane;
                let (slab, gradients) = (slab.aligned(), &mut shard.gradients);
                for (index, step) in steps[stretch.clone()].iter().enumerate() {
                    let coupled = total.filter(|_| index == 0).map(|total| Coupled { total, samples });
                    match pass {
                        Pass::Forward => step.op.forward(replay.forward(step, slab, sample, coupled)),
                        Pass::Backward => {
                            if let Some(differentiable) = step.op.differentiable() {
                                let at = (sample, first);
                                differentiable.backward(replay.backward(step, slab, Some(&mut *gradients), at, coupled));
                            }
                        }
                    }
                }
                let Some((step, coupling)) = next else { return };
                part.resize(part_len, T::ZERO);
                match pass {
                    Pass::Forward => coupling.gather(&replay.forward(step, slab, sample, None), part),
                    Pass::Backward => {
                        let at = (sample, first);
                        coupling.gather_backward(&replay.backward(step, slab, Some(&mut *gradients), at, None), part);
                    }
                }
            });
            let Some((step, coupling)) = next else { continue };
            parts.clear();
            lanes.iter().for_each(|lane| parts.extend_from_slice(&lane.part));
            let total = match pass {
                Pass::Forward => &mut totals[number],
                Pass::Backward => &mut *backward_total,
            };
            total.clear();
            total.resize(part_len, T::ZERO);
            coupling.combine(pass, &step.shapes, parts, total);
        }
    }

    /// There is nothing to settle any more.
    pub fn forget(&mut self) {
        self.samples = 0;
    }

    /// Hands the totals of the last forward pass to the operations, once.
    pub fn settle(&mut self, plan: &Plan<T>, parameters: &mut [T]) {
        let samples = std::mem::take(&mut self.samples);
        if samples == 0 {
            return;
        }
        let coupled = plan.forward.iter().filter_map(|step| Some((step, step.op.coupling()?)));
        for ((step, coupling), total) in coupled.zip(&self.totals) {
            for (operand, range) in &step.parameters {
                if let Some(values) = parameters.get_mut(range.clone()) {
                    coupling.settle(*operand, &step.shapes, Coupled { total, samples }, values);
                }
            }
        }
    }
}
