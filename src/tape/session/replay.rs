//! The steps of a plan on the samples of a step: shards side by side, the samples of a shard in order, one or a micro-batch at a time.
//!
//! This file moves borrowed pieces of slabs to operations; it knows no operation and no arithmetic.

use super::shards::Shard;
use super::{DropoutKey, Fill};
use crate::tape::graph::MAX_INPUTS;
use crate::tape::op::{Backward, Coupled, Forward, Gradient, MAX_OPERANDS, MICRO_BATCH};
use crate::tape::parts::Parts;
use crate::tape::plan::{Piece, Plan, Role, Step};
use crate::tape::slab::Slabs;
use crate::tape::threads::Parallelism;
use phyture_kernels::instruction_set::InstructionSet;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Write};

/// What all workers of one step share.
pub(super) struct Replay<'a, T> {
    pub plan: &'a Plan<T>,
    pub isa: InstructionSet,
    pub poison: bool,
    pub parallelism: Parallelism,
    pub slabs: &'a Slabs<T>,
    pub packed: [&'a [T]; 2],
    pub parameters: &'a [T],
    pub dropout: Option<DropoutKey>,
    pub fill: Fill<'a, T>,
    pub samples: usize,
    pub result_len: usize,
    pub shards: usize,
}

impl<T: Real> Replay<'_, T> {
    /// First sample of a shard: shards are as equal as they can be, and depend on the number of samples alone.
    pub const fn first_sample(&self, shard: usize) -> usize {
        shard * self.samples / self.shards
    }

    pub fn work(&self, shards: &mut [Shard<T>], first: usize, losses: &mut [f64], results: &mut [T]) {
        match shards {
            [] => {}
            [shard] => self.shard(shard, self.first_sample(first), losses, results),
            _ => {
                let (low, high) = shards.split_at_mut(shards.len() / 2);
                let middle = first + low.len();
                let samples = self.first_sample(middle) - self.first_sample(first);
                let (low_losses, high_losses) = losses.split_at_mut(samples);
                let (low_results, high_results) = results.split_at_mut(samples * self.result_len);
                self.parallelism
                    .join(|| self.work(low, first, low_losses, low_results), || self.work(high, middle, high_losses, high_results));
            }
        }
    }

    fn shard(&self, shard: &mut Shard<T>, first: usize, losses: &mut [f64], results: &mut [T]) {
        if losses.is_empty() {
            return;
        }
        self.slabs.lend(|slab| {
            let most = self.plan.micro_batch;
            for (index, losses) in losses.chunks_mut(most).enumerate() {
                let results = &mut results[index * most * self.result_len..][..losses.len() * self.result_len];
                self.micro_batch(slab, &mut shard.gradients, (first + index * most, index == 0), losses, results);
            }
        });
    }

    /// Fills the inputs of a sample.
    pub fn begin(&self, slab: &mut [T], sample: usize) {
        if self.poison {
            slab.fill(T::NAN);
        }
        let mut inputs: [&mut [T]; MAX_INPUTS] = std::array::from_fn(|_| Default::default());
        let count = self.plan.inputs.len();
        carve(slab, &self.plan.inputs, |role, piece| {
            if let Role::X(index) = role {
                inputs[index] = piece;
            }
        });
        (self.fill)(sample, &mut inputs[..count]);
    }

    /// Samples `first…`, step by step side by side, each in a stretch of the slab; the first micro-batch of a shard sets its gradients.
    fn micro_batch(
        &self,
        slab: &mut [T],
        gradients: &mut [T],
        (first, sets): (usize, bool),
        losses: &mut [f64],
        results: &mut [T],
    ) {
        let mut stretches = slab.chunks_mut(self.plan.lane_len().max(1));
        let mut lanes: [&mut [T]; MICRO_BATCH] = std::array::from_fn(|_| stretches.next().unwrap_or_default());
        let lanes = &mut lanes[..losses.len()];
        for (index, lane) in lanes.iter_mut().enumerate() {
            self.begin(lane, first + index);
        }
        for step in &self.plan.forward {
            self.forward_step(step, lanes, first);
        }
        if let Some((value, gradient)) = self.plan.loss {
            for (lane, loss) in lanes.iter_mut().zip(losses) {
                *loss = lane[value].f64();
                lane[gradient] = T::of(1.0 / self.samples as f64);
            }
            for step in &self.plan.backward {
                self.backward_step(step, lanes, gradients, (first, sets));
                self.keep(step, lanes, results);
            }
        }
        for (lane, result) in lanes.iter().zip(results.chunks_exact_mut(self.result_len.max(1))) {
            self.finish(lane, result);
        }
    }

    fn forward_step(&self, step: &Step<T>, lanes: &mut [&mut [T]], first: usize) {
        let count = lanes.len();
        let mut samples = (first..).zip(lanes);
        match step.op.micro_batched(&step.shapes).filter(|_| step.micro_batched) {
            Some(op) => {
                let mut micro_batch: [Forward<'_, T>; MICRO_BATCH] = std::array::from_fn(|_| match samples.next() {
                    Some((sample, lane)) => self.forward(step, lane, sample, None),
                    None => self.forward_of_nothing(step, first, None),
                });
                op.forward_micro_batch(&mut micro_batch[..count]);
            }
            None => {
                for (sample, lane) in samples {
                    step.op.forward(self.forward(step, lane, sample, None));
                }
            }
        }
    }

    fn backward_step(&self, step: &Step<T>, lanes: &mut [&mut [T]], gradients: &mut [T], (first, sets): (usize, bool)) {
        let count = lanes.len();
        let mut samples = (first..).zip(lanes);
        match step.op.micro_batched(&step.shapes).filter(|_| step.micro_batched) {
            Some(op) => {
                // Of all together: the first one's.
                let mut gradients = Some(gradients);
                let mut micro_batch: [Backward<'_, T>; MICRO_BATCH] = std::array::from_fn(|_| match samples.next() {
                    Some((sample, lane)) => self.backward(step, lane, gradients.take(), (sample, sets), None),
                    None => self.backward_of_nothing(step, first, None),
                });
                op.backward_micro_batch(&mut micro_batch[..count]);
            }
            None => {
                if let Some(op) = step.op.differentiable() {
                    for (sample, lane) in samples {
                        op.backward(self.backward(step, lane, Some(&mut *gradients), (sample, sets && sample == first), None));
                    }
                }
            }
        }
    }

    /// Copies what the gradient of a large weight will be made of, to the end of the sample's results. No step overwrites what it reads.
    fn keep(&self, step: &Step<T>, lanes: &[&mut [T]], results: &mut [T]) {
        let Some(kept) = &step.kept else { return };
        for (lane, result) in lanes.iter().zip(results.chunks_exact_mut(self.result_len.max(1))) {
            let record = &mut result[self.result_len - self.plan.kept_len..];
            for (from, to) in kept.from.iter().zip(&kept.to) {
                record[to.clone()].copy_from_slice(&lane[from.clone()]);
            }
        }
    }

    /// Copies outputs and gradients of inputs.
    pub fn finish(&self, slab: &[T], result: &mut [T]) {
        let mut result = result;
        for range in self.plan.outputs.iter().chain(self.plan.input_gradients.iter().flatten()) {
            let (now, later) = result.split_at_mut(range.len());
            now.copy_from_slice(&slab[range.clone()]);
            result = later;
        }
    }

    fn stream(&self, step: &Step<T>, sample: usize) -> Option<Stream> {
        self.dropout.map(|key| Stream::new(key.seed, key.step, step.site, sample as u64))
    }

    /// What the forward pass of a step is given, but for the sample's numbers.
    fn forward_of_nothing<'b>(&'b self, step: &'b Step<T>, sample: usize, coupled: Option<Coupled<'b, T>>) -> Forward<'b, T> {
        let mut io = Forward {
            x: [&[]; MAX_OPERANDS],
            y: Default::default(),
            workspace: Default::default(),
            scratch: Default::default(),
            packed: step.packed.as_ref().map_or(&[], |(_, range)| &self.packed[0][range.clone()]),
            shapes: &step.shapes,
            isa: self.isa,
            parts: Parts::of(self.parallelism, self.slabs, self.samples),
            stream: self.stream(step, sample),
            coupled,
        };
        for (index, range) in &step.parameters {
            io.x[*index] = &self.parameters[range.clone()];
        }
        io
    }

    /// What the forward pass of a step is given.
    pub fn forward<'b>(
        &'b self,
        step: &'b Step<T>,
        slab: &'b mut [T],
        sample: usize,
        coupled: Option<Coupled<'b, T>>,
    ) -> Forward<'b, T> {
        let mut io = self.forward_of_nothing(step, sample, coupled);
        carve(slab, &step.pieces, |role, piece| match role {
            Role::X(index) => io.x[index] = piece,
            Role::Y => io.y = piece,
            Role::Workspace => io.workspace = piece,
            Role::Scratch => io.scratch = piece,
            Role::Dy | Role::Dx(..) => {}
        });
        io
    }

    /// What the backward pass of a step is given, but for the sample's numbers.
    fn backward_of_nothing<'b>(&'b self, step: &'b Step<T>, sample: usize, coupled: Option<Coupled<'b, T>>) -> Backward<'b, T> {
        let mut io = Backward {
            x: [&[]; MAX_OPERANDS],
            y: &[],
            dy: &[],
            workspace: &[],
            dx: [const { None }; MAX_OPERANDS],
            scratch: Default::default(),
            packed: step.packed.as_ref().map_or(&[], |(_, range)| &self.packed[1][range.clone()]),
            shapes: &step.shapes,
            isa: self.isa,
            stream: self.stream(step, sample),
            coupled,
        };
        for (index, range) in &step.parameters {
            io.x[*index] = &self.parameters[range.clone()];
        }
        io
    }

    /// What the backward pass of a step is given; `gradients` of parameters, if these are wanted, are set if `sets`, else added to.
    pub fn backward<'b>(
        &'b self,
        step: &'b Step<T>,
        slab: &'b mut [T],
        gradients: Option<&'b mut [T]>,
        (sample, sets): (usize, bool),
        coupled: Option<Coupled<'b, T>>,
    ) -> Backward<'b, T> {
        let mut io = self.backward_of_nothing(step, sample, coupled);
        carve(slab, &step.pieces, |role, piece| match role {
            Role::X(index) => io.x[index] = piece,
            Role::Y => io.y = piece,
            Role::Workspace => io.workspace = piece,
            Role::Scratch => io.scratch = piece,
            Role::Dy => io.dy = piece,
            Role::Dx(index, write) => io.dx[index] = Some(Gradient { values: piece, write }),
        });
        if let Some(gradients) = gradients {
            carve(gradients, &step.parameter_gradients, |role, piece| {
                if let Role::Dx(index, write) = role {
                    // Over the samples of a shard the gradients add up.
                    let write = if sets { write } else { Write::Add };
                    io.dx[index] = Some(Gradient { values: piece, write });
                }
            });
        }
        io
    }
}

/// Hands out disjoint pieces of a slab, sorted by start.
fn carve<'a, T>(slab: &'a mut [T], pieces: &[Piece], mut take: impl FnMut(Role, &'a mut [T])) {
    let mut rest = slab;
    let mut position = 0;
    for piece in pieces {
        let (_, tail) = std::mem::take(&mut rest).split_at_mut(piece.start - position);
        let (taken, tail) = tail.split_at_mut(piece.len);
        take(piece.role, taken);
        rest = tail;
        position = piece.start + piece.len;
    }
}
