//! A step in which samples wait for each other: for plans with an operation that couples them.
//!
//! Every sample has a slab of its own. All run up to the next coupling, give their parts, these are combined in the order of the samples,
//! and all go on; likewise backward. Shards, their gradients and the order of summation are those of the session, so that again the
//! number of threads changes no bit.

use super::replay::Replay;
use super::shards::Shard;
use crate::tape::op::{Coupled, Pass};
use crate::tape::plan::{Plan, Step};
use crate::tape::slab::Slab;
use phyture_kernels::Real;
use std::ops::Range;

/// One sample.
struct Lane<T> {
    slab: Slab<T>,
    part: Vec<T>,
}

/// All samples of a step.
pub(super) struct Lockstep<T> {
    lanes: Vec<Lane<T>>,
    parts: Vec<T>,
    /// Total of each coupling of the last forward pass, and of how many samples.
    totals: Vec<Vec<T>>,
    samples: usize,
}

impl<T> Default for Lockstep<T> {
    fn default() -> Self {
        Self { lanes: Vec::new(), parts: Vec::new(), totals: Vec::new(), samples: 0 }
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

/// Stretches of steps without a coupling but, perhaps, at their start.
fn stretches<T: Real>(steps: &[Step<T>]) -> Vec<Range<usize>> {
    let couplings = steps.iter().enumerate().filter(|(_, step)| step.op.coupling().is_some()).map(|(index, _)| index);
    let starts: Vec<usize> = std::iter::once(0).chain(couplings).collect();
    let ends = starts.iter().skip(1).copied().chain([steps.len()]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

impl<T: Real> Lockstep<T> {
    /// One step of a session.
    pub fn run(&mut self, replay: &Replay<'_, T>, shards: &mut [Shard<T>], losses: &mut [f64], results: &mut [T]) {
        let samples = replay.samples;
        while self.lanes.len() < samples {
            self.lanes.push(Lane { slab: Slab::new(replay.plan.slab_len), part: Vec::new() });
        }
        self.samples = samples;
        each(replay, shards, 0, &mut self.lanes[..samples], &|_, lane, sample, _| replay.begin(lane.slab.aligned(), sample));
        self.totals.clear();
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
        let samples = replay.samples;
        let steps = if pass == Pass::Forward { &replay.plan.forward } else { &replay.plan.backward };
        let mut total: Option<Vec<T>> = None;
        for stretch in stretches(steps) {
            let next = steps.get(stretch.end).and_then(|step| Some((step, step.op.coupling()?)));
            let part_len = next.map_or(0, |(step, coupling)| coupling.part_len(&step.shapes));
            each(replay, shards, 0, &mut self.lanes[..samples], &|shard, lane, sample, first| {
                let Lane { slab, part } = lane;
                let (slab, gradients) = (slab.aligned(), &mut shard.gradients);
                for (index, step) in steps[stretch.clone()].iter().enumerate() {
                    let coupled = total.as_deref().filter(|_| index == 0).map(|total| Coupled { total, samples });
                    match pass {
                        Pass::Forward => step.op.forward(replay.forward(step, slab, sample, coupled)),
                        Pass::Backward => {
                            if let Some(differentiable) = step.op.differentiable() {
                                differentiable.backward(replay.backward(
                                    step,
                                    slab,
                                    Some(&mut *gradients),
                                    (sample, first),
                                    coupled,
                                ));
                            }
                        }
                    }
                }
                if let Some((step, coupling)) = next {
                    part.resize(part_len, T::ZERO);
                    match pass {
                        Pass::Forward => coupling.gather(&replay.forward(step, slab, sample, None), part),
                        Pass::Backward => {
                            coupling
                                .gather_backward(&replay.backward(step, slab, Some(&mut *gradients), (sample, first), None), part);
                        }
                    }
                }
            });
            total = next.map(|(step, coupling)| {
                self.parts.clear();
                self.lanes[..samples].iter().for_each(|lane| self.parts.extend_from_slice(&lane.part));
                let mut total = vec![T::ZERO; part_len];
                coupling.combine(pass, &step.shapes, &self.parts, &mut total);
                if pass == Pass::Forward {
                    self.totals.push(total.clone());
                }
                total
            });
        }
    }

    /// Hands the totals of the last forward pass to the operations, once.
    pub fn settle(&mut self, plan: &Plan<T>, parameters: &mut [T]) {
        let coupled = plan.forward.iter().filter_map(|step| Some((step, step.op.coupling()?)));
        for ((step, coupling), total) in coupled.zip(self.totals.drain(..)) {
            for (operand, range) in &step.parameters {
                if let Some(values) = parameters.get_mut(range.clone()) {
                    coupling.settle(*operand, &step.shapes, Coupled { total: &total, samples: self.samples }, values);
                }
            }
        }
    }
}
