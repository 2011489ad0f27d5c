//! Replaying a plan: one sample at a time, one worker a core, the same bits on any number of threads.
//!
//! The batch is the outermost loop, or, where a weight is large or all weights are more than what a sample holds, some samples go through the
//! plan side by side, so that a weight comes from memory once for all of them. Samples go to a fixed number of shards by index; a shard is worked off in order and has a
//! gradient slab of its own; shards are summed in order. Where there are fewer samples than threads, large operations work on pieces
//! of their rows, which have the bits of the whole. So neither the number of threads nor their timing can change a bit.
//! In the steady state (no more samples than in an earlier call) nothing is allocated, in plans that couple samples neither.
//!
//! This file owns the memory and is the interface; what happens in a step is in `packing`, `replay` (or `lockstep`) and `shards`.

use super::graph::{Graph, Var};
use super::op::Pass;
use super::plan::Plan;
use super::slab::{Slab, Slabs};
use super::threads::{Threads, Workers};
use crate::tape::error::{Error, Result};
use large_weights::LargeWeights;
use lockstep::Lockstep;
use packing::pack;
use phyture_kernels::Real;
use phyture_kernels::adam::Adam;
use phyture_kernels::instruction_set::InstructionSet;
use replay::Replay;
pub use shards::SHARDS;
use shards::{Shard, reduce};
use update::Update;

mod large_weights;
mod lockstep;
mod packing;
mod replay;
mod shards;
mod update;

/// Most numbers of all samples of a step in which they wait for each other: 32 GiB in f32.
const LARGEST_STEP: u64 = 1 << 33;

/// Key of the random streams of one training step. With the same key the same dropout masks are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DropoutKey {
    /// Seed of the run.
    pub seed: u64,
    /// Optimiser step.
    pub step: u64,
}

/// Fills the inputs of one sample, in the order in which the graph recorded them; called on worker threads.
pub type Fill<'a, T> = &'a (dyn Fn(usize, &mut [&mut [T]]) + Sync);

/// The instruction set of this process's kernels: the best of the processor, or the one that the environment asks for. Results of
/// different ones differ in the last digits.
///
/// # Errors
/// [`Error::InstructionSet`] if the environment asks for one that this processor does not have.
pub fn instruction_set() -> Result<InstructionSet> {
    Ok(InstructionSet::detect()?)
}

/// A plan with its memory, ready to be replayed.
pub struct Session<T> {
    plan: Plan<T>,
    isa: InstructionSet,
    poison: bool,
    /// One for each thread that may work on samples.
    slabs: Slabs<T>,
    /// Weights as the forward and the backward calls of a step want them.
    packed: [Slab<T>; 2],
    /// Parameters that [`Session::load`] was given.
    loaded: Vec<T>,
    shards: Vec<Shard<T>>,
    gradients: Vec<T>,
    /// Samples of the last step. Only of these is anything handed out: the memory behind may be that of an earlier, larger step.
    samples: usize,
    losses: Vec<f64>,
    /// By sample: outputs in order, then the gradients of the inputs that have one, then what is kept for the gradients of large weights.
    results: Vec<T>,
    /// All samples of a step at once, for a plan that couples them.
    lockstep: Option<Lockstep<T>>,
    workers: Workers,
}

impl<T: Real> Session<T> {
    /// A session that computes the loss, its gradients, and `outputs`.
    ///
    /// # Errors
    /// [`Error::Shape`] if the loss is not one number, depends on nothing trainable, or an operation on the way has no backward
    /// pass; [`Error::InstructionSet`] if the one asked for is not available, [`Error::Threads`] if threads cannot be started.
    pub fn train(graph: &Graph<T>, loss: Var, outputs: &[Var], threads: Threads) -> Result<Self> {
        Self::new(Plan::train(graph, loss, outputs)?, threads)
    }

    /// A session that computes `outputs` alone and keeps nothing for a backward pass.
    ///
    /// # Errors
    /// As [`Session::train`].
    pub fn infer(graph: &Graph<T>, outputs: &[Var], threads: Threads) -> Result<Self> {
        Self::new(Plan::infer(graph, outputs)?, threads)
    }

    fn new(plan: Plan<T>, threads: Threads) -> Result<Self> {
        let isa = instruction_set()?;
        let trains = plan.loss.is_some();
        let count = threads.count();
        let workers = Workers::new(count)?;
        // Inference has nothing to sum, so its number of shards is free.
        let shards = if trains { SHARDS } else { SHARDS.max(count) };
        let [gradient_len, shard_len] = [plan.parameter_len, plan.shard_len()].map(|len| if trains { len } else { 0 });
        Ok(Self {
            isa,
            poison: false,
            packed: plan.packed_len.map(Slab::new),
            slabs: Slabs::new(count.min(shards), (plan.micro_batch * plan.lane_len()).max(plan.large_weight_scratch)),
            loaded: Vec::new(),
            shards: (0..shards).map(|_| Shard { gradients: vec![T::ZERO; shard_len] }).collect(),
            gradients: vec![T::ZERO; gradient_len],
            samples: 0,
            losses: Vec::new(),
            results: Vec::new(),
            lockstep: plan.forward.iter().any(|step| step.op.coupling().is_some()).then(Lockstep::default),
            workers,
            plan,
        })
    }

    /// The same at another instruction-set level than the process's, before it is used: results of different levels differ in the last digits.
    ///
    /// # Panics
    /// If weights have been loaded: they are packed for the level before.
    #[must_use]
    pub fn at(mut self, isa: InstructionSet) -> Self {
        assert!(self.loaded.is_empty(), "weights that are loaded are packed for the level before");
        self.isa = isa;
        self
    }

    /// Fills the slab with NaN before each sample: an operation that reads what nobody wrote shows at once. For tests.
    pub fn set_poison(&mut self, poison: bool) {
        self.poison = poison;
    }

    /// The instruction-set level it runs at.
    pub const fn isa(&self) -> InstructionSet {
        self.isa
    }

    /// Numbers in the slab of one worker: the memory of one sample in flight.
    pub fn slab_len(&self) -> usize {
        self.plan.slab_len
    }

    /// Forward, and in a training session backward, for samples `0..samples`.
    ///
    /// Returns the mean loss over the samples, summed in f64; 0 in an inference session. Afterwards [`Session::gradients`]
    /// holds the gradient of that mean. `dropout: None` turns dropout off.
    ///
    /// # Errors
    /// [`Error::Shape`] if `parameters` is not as long as the graph's flat slab, or if the plan couples samples and there are more than
    /// can be held in memory together.
    pub fn step(&mut self, parameters: &[T], samples: usize, dropout: Option<DropoutKey>, fill: Fill<'_, T>) -> Result<f64> {
        self.check_lanes(samples, dropout)?;
        self.pack(parameters)?;
        // What was loaded is not what is packed any more.
        self.loaded.clear();
        Ok(self.replay(parameters, samples, dropout, fill))
    }

    /// Takes over parameters for [`Session::predict`]: what can be prepared of them is prepared once, here.
    ///
    /// # Errors
    /// [`Error::Shape`] if `parameters` is not as long as the graph's flat slab.
    pub fn load(&mut self, parameters: &[T]) -> Result<()> {
        self.pack(parameters)?;
        self.loaded.clear();
        self.loaded.extend_from_slice(parameters);
        Ok(())
    }

    /// Runs samples `0..samples` with the parameters loaded and without dropout, and hands the outputs over in order.
    ///
    /// # Errors
    /// [`Error::Shape`] if no parameters are loaded; [`Session::step`] forgets them.
    pub fn predict(&mut self, samples: usize, fill: Fill<'_, T>, each: &mut dyn FnMut(usize, &[T])) -> Result<()> {
        self.check(&self.loaded)?;
        let loaded = std::mem::take(&mut self.loaded);
        self.replay(&loaded, samples, None, fill);
        self.loaded = loaded;
        let output_len = self.plan.outputs.iter().map(ExactSizeIterator::len).sum();
        let result_len = self.result_len();
        for sample in 0..samples {
            each(sample, &self.results[sample * result_len..][..output_len]);
        }
        Ok(())
    }

    /// Samples that wait for each other have a slab each.
    fn check_lanes(&self, samples: usize, dropout: Option<DropoutKey>) -> Result<()> {
        let numbers = samples.saturating_mul(self.plan.slab_len);
        if self.lockstep.is_none() || dropout.is_none() || numbers as u64 <= LARGEST_STEP {
            return Ok(());
        }
        let most = LARGEST_STEP / self.plan.slab_len.max(1) as u64;
        let message =
            format!("{samples} samples that wait for each other, {numbers} numbers; at most {most} samples: lower `batch`");
        Err(Error::Shape { operation: "session", message })
    }

    fn check(&self, parameters: &[T]) -> Result<()> {
        if parameters.len() == self.plan.parameter_len {
            return Ok(());
        }
        let message = format!("{} parameters; the graph has {}", parameters.len(), self.plan.parameter_len);
        Err(Error::Shape { operation: "session", message })
    }

    /// Weights in the form their kernels want.
    fn pack(&mut self, parameters: &[T]) -> Result<()> {
        self.check(parameters)?;
        let Self { plan, isa, packed, workers, .. } = self;
        workers.run(|parallelism| {
            let [forward, backward] = packed.each_mut().map(Slab::aligned);
            parallelism.join(
                || pack(parallelism, &plan.forward, Pass::Forward, *isa, parameters, 0, forward),
                || pack(parallelism, &plan.backward, Pass::Backward, *isa, parameters, 0, backward),
            );
        });
        Ok(())
    }

    /// The samples of a step, with weights as they are packed; the mean loss.
    fn replay(&mut self, parameters: &[T], samples: usize, dropout: Option<DropoutKey>, fill: Fill<'_, T>) -> f64 {
        let result_len = self.result_len();
        if self.losses.len() < samples {
            self.losses.resize(samples, 0.0);
            self.results.resize(samples * result_len, T::ZERO);
        }
        self.samples = samples;
        if let Some(lockstep) = &mut self.lockstep {
            lockstep.forget();
        }
        let Self { plan, isa, poison, slabs, packed, shards, gradients, losses, results, lockstep, workers, .. } = self;
        let (isa, poison, count) = (*isa, *poison, shards.len());
        let losses = &mut losses[..samples];
        let (losses_mut, results) = (&mut *losses, &mut results[..samples * result_len]);
        workers.run(|parallelism| {
            let packed = packed.each_mut().map(|packed| &*packed.aligned());
            let replay = Replay {
                plan,
                isa,
                poison,
                parallelism,
                slabs,
                packed,
                parameters,
                dropout,
                fill,
                samples,
                result_len,
                shards: count,
            };
            match lockstep.as_mut().filter(|_| dropout.is_some()) {
                Some(lockstep) => lockstep.run(&replay, shards, losses_mut, results),
                None => replay.work(shards, 0, losses_mut, results),
            }
            if plan.loss.is_none() {
                return;
            }
            // A shard without samples has written nothing.
            let used = |shard: usize| replay.first_sample(shard) < replay.first_sample(shard + 1);
            for (range, place) in &plan.summed {
                reduce(parallelism, &mut gradients[range.clone()], shards, &used, *place);
            }
            LargeWeights { replay: &replay, results }.work(&plan.large_weights, gradients, 0);
        });
        for range in &self.plan.unreached {
            if let Some(gradients) = self.gradients.get_mut(range.clone()) {
                gradients.fill(T::ZERO);
            }
        }
        self.losses[..samples].iter().sum::<f64>() / samples.max(1) as f64
    }

    /// Lets operations that couple samples keep what the last step told them (running means of a batch normalisation) in their
    /// parameters. Does nothing for other plans, or after a step without random parts.
    pub fn settle(&mut self, parameters: &mut [T]) {
        if let Some(lockstep) = &mut self.lockstep {
            lockstep.settle(&self.plan, parameters);
        }
    }

    /// Step number `step` of Adam (1 is the first) on the parameters and both moments, with the gradient of the last step.
    ///
    /// # Errors
    /// [`Error::Shape`] if one of the three is not as long as the gradient.
    pub fn adam(
        &self,
        adam: &Adam,
        step: u64,
        parameters: &mut [T],
        first_moment: &mut [T],
        second_moment: &mut [T],
    ) -> Result<()> {
        let lengths = [parameters.len(), first_moment.len(), second_moment.len()];
        if lengths.iter().any(|len| *len != self.gradients.len()) {
            let message = format!("{lengths:?} parameters and moments; the gradient has {}", self.gradients.len());
            return Err(Error::Shape { operation: "adam", message });
        }
        let (isa, gradients) = (self.isa, &self.gradients);
        self.workers.run(|parallelism| {
            Update { parallelism, isa, adam, step }.work(gradients, [parameters, first_moment, second_moment]);
        });
        Ok(())
    }

    /// Gradient of the mean loss of the last step, one number a parameter, in the layout of the flat slab. Empty in an
    /// inference session.
    pub fn gradients(&self) -> &[T] {
        &self.gradients
    }

    /// The same, for whoever adds a part of the loss that is not on the tape before [`Session::adam`].
    pub fn gradients_mut(&mut self) -> &mut [T] {
        &mut self.gradients
    }

    /// Loss of each sample of the last step, and of no other.
    pub fn losses(&self) -> &[f64] {
        &self.losses[..self.samples]
    }

    /// Output `index` of a sample of the last step.
    ///
    /// # Errors
    /// [`Error::Shape`] if there is no such output, or no such sample in the last step.
    pub fn output(&self, index: usize, sample: usize) -> Result<&[T]> {
        let before = self.plan.outputs.iter().take(index).map(ExactSizeIterator::len).sum::<usize>();
        let range = self.plan.outputs.get(index).ok_or_else(|| Error::Shape {
            operation: "session",
            message: format!("output {index} was asked for; it has {} (counted from 0)", self.plan.outputs.len()),
        })?;
        self.result(sample, before, range.len())
    }

    /// Gradient of the mean loss with respect to input `index` of a sample of the last step. Empty if the input was recorded
    /// without gradient, or no path joins it to the loss.
    ///
    /// # Errors
    /// [`Error::Shape`] if there is no such input, or no such sample in the last step.
    pub fn input_gradient(&self, index: usize, sample: usize) -> Result<&[T]> {
        let len = |range: &Option<std::ops::Range<usize>>| range.as_ref().map_or(0, ExactSizeIterator::len);
        let outputs = self.plan.outputs.iter().map(ExactSizeIterator::len).sum::<usize>();
        let before = outputs + self.plan.input_gradients.iter().take(index).map(len).sum::<usize>();
        let own = self.plan.input_gradients.get(index).ok_or_else(|| Error::Shape {
            operation: "session",
            message: format!("the gradient of input {index} was asked for; there are {} inputs", self.plan.input_gradients.len()),
        })?;
        self.result(sample, before, len(own))
    }

    fn result(&self, sample: usize, start: usize, len: usize) -> Result<&[T]> {
        if sample >= self.samples {
            let message = format!("sample {sample} was asked for; the last step had {} (counted from 0)", self.samples);
            return Err(Error::Shape { operation: "session", message });
        }
        let start = sample * self.result_len() + start;
        Ok(&self.results[start..start + len])
    }

    fn result_len(&self) -> usize {
        let copied = self.plan.outputs.iter().chain(self.plan.input_gradients.iter().flatten());
        copied.map(ExactSizeIterator::len).sum::<usize>() + self.plan.kept_len
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradcheck;
    use super::super::op::MICRO_BATCH;
    use super::super::ops::{Conv1d, Dropout, Epilogue, Flatten, Linear, SquaredError, Temporal};
    use super::super::plan::tests::{random_graph, recipe};
    use super::*;
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    const KEY: Option<DropoutKey> = Some(DropoutKey { seed: 4, step: 2 });

    fn fill<T: Real>(sample: usize, inputs: &mut [&mut [T]]) {
        for (index, input) in inputs.iter_mut().enumerate() {
            let stream = Stream::new(1, 0, index as u64, sample as u64);
            input.iter_mut().enumerate().for_each(|(at, value)| *value = T::of(stream.uniform(at as u64) - 0.5));
        }
    }

    fn parameters<T: Real>(count: usize) -> Vec<T> {
        let stream = Stream::new(2, 0, 0, 0);
        (0..count).map(|at| T::of(stream.uniform(at as u64) - 0.5)).collect()
    }

    /// Linear, dropout, linear with the same weight, squared error; and a parameter that nothing reads.
    fn shared_weight<T: Real>() -> Result<(Graph<T>, Var, Var)> {
        let mut graph = Graph::<T>::new();
        let (x, target) = (graph.input_with_gradient("x", &[5, 4])?, graph.input("target", &[5, 4])?);
        graph.parameter("unused", &[3])?;
        let (weight, bias) = (graph.parameter("weight", &[4, 4])?, graph.parameter("bias", &[4])?);
        let first = graph.apply(Linear, &[x, weight, bias])?;
        let dropped = graph.apply(Dropout { rate: 0.3 }, &[first])?;
        let second = graph.apply(Linear, &[dropped, weight, bias])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[second, target])?;
        Ok((graph, loss, second))
    }

    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    fn all<'a>(samples: usize, of: impl Fn(usize) -> Result<&'a [f32]>) -> Result<Vec<u32>> {
        let each = (0..samples).map(|sample| of(sample).map(bits)).collect::<Result<Vec<_>>>()?;
        Ok(each.concat())
    }

    #[test]
    fn a_smaller_step_shows_nothing_of_a_larger_one_before() -> Result<()> {
        let (graph, loss, output) = shared_weight::<f32>()?;
        let parameters = parameters(graph.parameter_count());
        let mut session = Session::train(&graph, loss, &[output], Threads(1))?;
        assert!(session.losses().is_empty() && session.output(0, 0).is_err(), "before the first step");
        session.step(&parameters, 32, None, &fill)?;
        assert!(session.losses().len() == 32 && session.output(0, 31).is_ok());
        session.step(&parameters, 4, None, &fill)?;
        assert_eq!(session.losses().len(), 4);
        assert!(session.output(0, 3).is_ok() && session.input_gradient(0, 3).is_ok());
        for sample in [4, 31, 32, usize::MAX] {
            for refused in [session.output(0, sample), session.input_gradient(0, sample)] {
                assert!(refused.is_err_and(|error| error.to_string().contains("the last step had 4")), "{sample}");
            }
        }
        assert!(session.output(1, 0).is_err() && session.input_gradient(2, 0).is_err(), "no such output or input");
        Ok(())
    }

    #[test]
    fn a_session_works_at_the_level_that_it_is_given() -> Result<()> {
        let (graph, loss, _) = large_weights::<f64>()?;
        let parameters = parameters(graph.parameter_count());
        let at = |isa: InstructionSet| {
            let mut session = Session::train(&graph, loss, &[], Threads(2))?.at(isa);
            assert_eq!(session.isa(), isa);
            let loss = session.step(&parameters, 5, KEY, &fill)?;
            Ok::<_, Error>((loss, session.gradients().to_vec()))
        };
        let plain = at(InstructionSet::PLAIN)?;
        for isa in InstructionSet::available() {
            let (loss, gradients) = at(isa)?;
            let near =
                |found: f64, expected: f64| (found - expected).abs() <= Tolerance::Close.relative_f64() * (1.0 + expected.abs());
            assert!(near(loss, plain.0) && gradients.iter().zip(&plain.1).all(|(found, expected)| near(*found, *expected)));
        }
        Ok(())
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() -> Result<()> {
        let (graph, loss, output) = shared_weight::<f32>()?;
        let parameters = parameters(graph.parameter_count());
        // Fewer samples than shards, as many, more, and not a multiple.
        for samples in [1, 3, SHARDS, 29] {
            let mut found = Vec::new();
            for threads in [1, 2, 16] {
                let mut session = Session::train(&graph, loss, &[output], Threads(threads))?;
                let loss = session.step(&parameters, samples, KEY, &fill)?;
                let outputs: Vec<u32> = all(samples, |sample| session.output(0, sample))?;
                let inputs: Vec<u32> = all(samples, |sample| session.input_gradient(0, sample))?;
                assert!(session.input_gradient(1, 0)?.is_empty(), "a target has no gradient");
                found.push((loss.to_bits(), bits(session.gradients()), outputs, inputs));
            }
            assert!(found.iter().all(|other| *other == found[0]), "{samples} samples");
        }
        Ok(())
    }

    #[test]
    fn a_batch_is_the_mean_of_its_samples_and_a_shared_weight_sums() -> Result<()> {
        let (graph, loss, _) = shared_weight::<f64>()?;
        let parameters = parameters(graph.parameter_count());
        let mut session = Session::train(&graph, loss, &[], Threads(2))?;
        // More samples first, so that nothing of them may show later.
        session.step(&parameters, 11, None, &fill)?;
        let whole = session.step(&parameters, 5, None, &fill)?;
        let gradients = session.gradients().to_vec();
        let (mut sum, mut sums) = (0.0, vec![0.0; gradients.len()]);
        for sample in 0..5 {
            sum += session.step(&parameters, 1, None, &|_, inputs: &mut [&mut [f64]]| fill(sample, inputs))?;
            sums.iter_mut().zip(session.gradients()).for_each(|(sum, value)| *sum += value);
        }
        assert!((whole - sum / 5.0).abs() < Tolerance::Close.relative_f64());
        assert!(gradients.iter().zip(&sums).all(|(whole, sum)| (whole - sum / 5.0).abs() < Tolerance::Close.relative_f64()));
        assert_eq!(gradients[..3], [0.0; 3], "a parameter that nothing reads has gradient zero");
        gradcheck::graph(
            &gradcheck::LossOf { graph: &graph, loss, parameters: &parameters, samples: 3, dropout: KEY, fill: &fill },
            &|name| name == "unused",
            3,
        )
        .map_err(|disagreement| Error::Shape { operation: "gradcheck", message: disagreement.to_string() })
    }

    /// Two large maps over time and a large map of one row, the first shared, with small operations between.
    fn large_weights<T: Real>() -> Result<(Graph<T>, Var, Var)> {
        let (length, channels) = (256, 3);
        let mut graph = Graph::<T>::new();
        let (x, target) = (graph.input_with_gradient("x", &[length, channels])?, graph.input("target", &[1, 384])?);
        let (weight, bias) = (graph.parameter("time", &[length, length])?, graph.parameter("bias", &[length])?);
        let rows = graph.parameter("rows", &[384, length * channels])?;
        let mixed = graph.apply(Temporal, &[x, weight, bias])?;
        let dropped = graph.apply(Dropout { rate: 0.3 }, &[mixed])?;
        let mixed = graph.apply(Temporal, &[dropped, weight])?;
        let flat = graph.apply(Flatten, &[mixed])?;
        let output = graph.apply(Linear, &[flat, rows])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[output, target])?;
        Ok((graph, loss, output))
    }

    /// Convolutions of short sequences, whose weights are more than all that a sample holds, scratch included.
    fn short_sequences<T: Real>() -> Result<(Graph<T>, Var, Var)> {
        let mut graph = Graph::<T>::new();
        let (x, target) = (graph.input_with_gradient("x", &[9, 32])?, graph.input("target", &[11, 32])?);
        let (first, bias) = (graph.parameter("first", &[5, 32, 64])?, graph.parameter("bias", &[64])?);
        let second = graph.parameter("second", &[3, 64, 32])?;
        let leaky = Conv1d { padding: (3, 3), epilogue: Epilogue::Leaky { leak: 0.01, dropout: 0.3 } };
        let mut hidden = graph.apply(leaky, &[x, first, bias])?;
        for layer in 0..6 {
            let weight = graph.parameter(&format!("layer {layer}"), &[5, 64, 64])?;
            hidden = graph.apply(Conv1d { padding: (2, 2), epilogue: Epilogue::Tanh }, &[hidden, weight])?;
        }
        let output = graph.apply(Conv1d { padding: (1, 1), epilogue: Epilogue::Tanh }, &[hidden, second])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[output, target])?;
        Ok((graph, loss, output))
    }

    #[test]
    fn a_sample_does_not_depend_on_its_micro_batch() -> Result<()> {
        let (graph, loss, output) = large_weights::<f64>()?;
        let plan = Plan::train(&graph, loss, &[output])?;
        let weights = &plan.large_weights;
        assert!(weights.iter().any(|weight| weight.steps.len() > 1) && weights.iter().any(|weight| weight.piece < weight.rows));
        samples_are_as_they_are_alone(&graph, loss, output)?;
        let (graph, loss, output) = short_sequences::<f64>()?;
        let plan = Plan::train(&graph, loss, &[output])?;
        let at_once = [&plan.forward, &plan.backward].map(|steps| steps.iter().filter(|step| step.micro_batched).count());
        assert_eq!((at_once, plan.large_weights.len()), ([8, 8], 0));
        assert!(!Plan::infer(&graph, &[output])?.forward.iter().any(|step| step.micro_batched), "a prediction is of one sample");
        samples_are_as_they_are_alone(&graph, loss, output)
    }

    /// Each sample of a step to the bit, the gradients of all up to rounding, and these against differences.
    fn samples_are_as_they_are_alone(graph: &Graph<f64>, loss: Var, output: Var) -> Result<()> {
        let parameters = parameters(graph.parameter_count());
        let mut alone = Session::train(graph, loss, &[output], Threads(1))?;
        assert!(alone.plan.micro_batch > 1, "these weights are not worth a micro_batch");
        // A power of 2, by which a loss can be divided without rounding.
        let samples = SHARDS * MICRO_BATCH;
        let mut session = Session::train(graph, loss, &[output], Threads(2))?;
        session.set_poison(true);
        session.step(&parameters, samples, None, &fill)?;
        let mut sums = vec![0.0; graph.parameter_count()];
        for sample in 0..samples {
            alone.step(&parameters, 1, None, &|_, inputs: &mut [&mut [f64]]| fill(sample, inputs))?;
            assert_eq!(session.output(0, sample)?, alone.output(0, 0)?);
            let scaled: Vec<f64> = alone.input_gradient(0, 0)?.iter().map(|value| value / samples as f64).collect();
            assert_eq!(session.input_gradient(0, sample)?, scaled);
            sums.iter_mut().zip(alone.gradients()).for_each(|(sum, value)| *sum += value / samples as f64);
        }
        let largest = sums.iter().fold(0.0_f64, |largest, sum| largest.max(sum.abs()));
        let allowed = Tolerance::Close.relative_f64() * largest;
        assert!(session.gradients().iter().zip(&sums).all(|(found, sum)| (found - sum).abs() <= allowed));
        gradcheck::graph(
            &gradcheck::LossOf { graph, loss, parameters: &parameters, samples: 11, dropout: KEY, fill: &fill },
            &|_| false,
            3,
        )
        .map_err(|disagreement| Error::Shape { operation: "gradcheck", message: disagreement.to_string() })
    }

    /// Two maps whose weights, none of them large, are more than all that a sample holds; the first is used twice.
    fn little_beside_the_weights<T: Real>() -> Result<(Graph<T>, Var, Var)> {
        let mut graph = Graph::<T>::new();
        let (x, target) = (graph.input_with_gradient("x", &[2, 64])?, graph.input("target", &[2, 40])?);
        let (weight, last) = (graph.parameter("weight", &[64, 64])?, graph.parameter("last", &[40, 64])?);
        let first = graph.apply(Linear, &[x, weight])?;
        let dropped = graph.apply(Dropout { rate: 0.3 }, &[first])?;
        let second = graph.apply(Linear, &[dropped, weight])?;
        let output = graph.apply(Linear, &[second, last])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[output, target])?;
        Ok((graph, loss, output))
    }

    #[test]
    fn samples_take_turns_where_the_weights_are_more_than_a_sample() -> Result<()> {
        let (graph, loss, output) = little_beside_the_weights::<f64>()?;
        let train = Plan::train(&graph, loss, &[output])?;
        assert!(train.micro_batch == MICRO_BATCH && train.large_weights.is_empty());
        assert_eq!(Plan::infer(&graph, &[output])?.micro_batch, 1, "a prediction is of one sample, and its memory counts");
        let (graph, loss, _) = shared_weight::<f64>()?;
        assert_eq!(Plan::train(&graph, loss, &[])?.micro_batch, 1, "these weights are less than a sample");
        let (graph, loss, _) = little_beside_the_weights::<f64>()?;
        let parameters = parameters(graph.parameter_count());
        gradcheck::graph(
            &gradcheck::LossOf { graph: &graph, loss, parameters: &parameters, samples: 11, dropout: KEY, fill: &fill },
            &|_| false,
            3,
        )
        .map_err(|disagreement| Error::Shape { operation: "gradcheck", message: disagreement.to_string() })
    }

    #[test]
    fn micro_batches_give_the_same_bits_on_any_number_of_threads() -> Result<()> {
        for (graph, loss, output) in [large_weights::<f32>()?, little_beside_the_weights()?, short_sequences()?] {
            let parameters = parameters(graph.parameter_count());
            for samples in [2, SHARDS * MICRO_BATCH + 3] {
                let mut found = Vec::new();
                for threads in [1, 2, 5] {
                    let mut session = Session::train(&graph, loss, &[output], Threads(threads))?;
                    let loss = session.step(&parameters, samples, KEY, &fill)?;
                    found.push((loss.to_bits(), bits(session.gradients()), bits(session.output(0, samples - 1)?)));
                }
                assert!(found.iter().all(|other| *other == found[0]), "{samples} samples");
            }
        }
        Ok(())
    }

    #[test]
    fn more_threads_than_there_may_be_are_refused() -> Result<()> {
        let (graph, loss, _) = shared_weight::<f32>()?;
        let refused = Session::train(&graph, loss, &[], Threads(100_000)).map(|_| ());
        assert!(refused.is_err_and(|error| error.to_string().contains("`threads` is 100000, expected 0 (all cores) to 1024")));
        Ok(())
    }

    #[test]
    fn adam_takes_the_same_step_in_blocks() -> Result<()> {
        let (graph, loss, _) = large_weights::<f32>()?;
        let start = parameters::<f32>(graph.parameter_count());
        let mut session = Session::train(&graph, loss, &[], Threads(2))?;
        session.step(&start, 3, None, &fill)?;
        let (mut whole, mut blocks) = ([start.clone(), start.clone(), start.clone()], [start.clone(), start.clone(), start]);
        let adam = Adam::default();
        let [parameters, first, second] = whole.each_mut().map(|values| &mut values[..]);
        phyture_kernels::adam::step(session.isa(), &adam, 7, 1.0, session.gradients(), parameters, (first, second));
        let [parameters, first, second] = blocks.each_mut().map(|values| &mut values[..]);
        session.adam(&adam, 7, parameters, first, second)?;
        assert_eq!(whole.map(|values| bits(&values)), blocks.clone().map(|values| bits(&values)));
        let [parameters, first, second] = blocks.each_mut().map(|values| &mut values[..]);
        assert!(session.adam(&adam, 8, &mut parameters[1..], first, second).is_err());
        Ok(())
    }

    #[test]
    fn dropout_follows_its_key_and_is_off_without_one() -> Result<()> {
        let (graph, loss, output) = shared_weight::<f32>()?;
        let parameters = parameters(graph.parameter_count());
        let mut train = Session::train(&graph, loss, &[output], Threads(1))?;
        let mut run = |key| {
            train.step(&parameters, 2, key, &fill)?;
            Ok::<_, Error>(bits(train.output(0, 1)?))
        };
        let (first, again, off) = (run(KEY)?, run(KEY)?, run(None)?);
        let other = run(Some(DropoutKey { seed: 4, step: 3 }))?;
        assert_eq!(first, again);
        assert!(first != other && first != off);
        let mut order = Vec::new();
        let mut infer = Session::infer(&graph, &[output], Threads(2))?;
        assert!(infer.predict(1, &fill, &mut |_, _| {}).is_err(), "a prediction without parameters");
        infer.load(&parameters)?;
        infer.predict(3, &fill, &mut |sample, output| {
            order.push(sample);
            assert!(sample != 1 || bits(output) == off, "inference differs from training without dropout");
        })?;
        assert_eq!(order, [0, 1, 2]);
        assert!(infer.gradients().is_empty());
        assert!(infer.step(&parameters[1..], 1, None, &fill).is_err(), "too few parameters were accepted");
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn random_graphs_have_exact_gradients_and_read_nothing_unwritten(recipe in recipe()) {
            let (graph, loss, values) = random_graph(&recipe)?;
            let parameters = parameters(graph.parameter_count());
            let mut plain = Session::train(&graph, loss, &values, Threads(1))?;
            let mut poisoned = Session::train(&graph, loss, &values, Threads(1))?;
            poisoned.set_poison(true);
            // The second step meets the first one's numbers, or NaN.
            for _ in 0..2 {
                let (a, b) = (plain.step(&parameters, 3, None, &fill)?, poisoned.step(&parameters, 3, None, &fill)?);
                prop_assert_eq!(a.to_bits(), b.to_bits());
                prop_assert_eq!(plain.gradients(), poisoned.gradients());
                prop_assert_eq!(plain.input_gradient(0, 2)?, poisoned.input_gradient(0, 2)?);
                for index in 0..values.len() {
                    prop_assert_eq!(plain.output(index, 1)?, poisoned.output(index, 1)?);
                }
            }
            // Keeping outputs alive changes the places of buffers, not the numbers.
            let mut lean = Session::train(&graph, loss, &[], Threads(1))?;
            lean.step(&parameters, 3, None, &fill)?;
            prop_assert_eq!(lean.gradients(), plain.gradients());
            // A parameter whose value nothing reads on has no gradient, and behind many saturated operations it is as good as none (to
            // the check's own measure); that the others have the right one is checked.
            let tiny = |value: &f64| value.abs() < Tolerance::Close.relative_f64();
            let still = |parameter: &crate::tape::Parameter| plain.gradients()[parameter.range()].iter().all(tiny);
            let zero = |name: &str| graph.parameters().iter().any(|parameter| parameter.name == name && still(parameter));
            if !graph.parameters().iter().all(still) {
                let checked = gradcheck::graph(&gradcheck::LossOf { graph: &graph, loss, parameters: &parameters, samples: 2, dropout: None, fill: &fill }, &zero, 5);
                prop_assert!(checked.is_ok(), "{:?}", checked);
            }
        }
    }
}
