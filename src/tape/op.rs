//! What an operation of the tape is: a shape rule, what it keeps, a forward pass and, if it can be trained through, a
//! backward pass. The operations themselves are in `ops`, one file each; this file knows none of them.

use super::parts::Parts;
use super::shape::Shape;
use crate::tape::error::{Error, Result};
use phyture_kernels::instruction_set::InstructionSet;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Rows, Write};
use std::ops::Range;

/// Largest number of operands of one operation: the kernels that an inception layer merges into one.
pub const MAX_OPERANDS: usize = 8;

/// Buffers of one operation for one sample, in elements.
///
/// *Workspace* is written by the forward pass and read by the backward pass (means of a layer norm, the log-sum-exp of an
/// attention); *scratch* is dead when the call returns; *packed* is made once a step from a weight, for all samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Kept from the forward to the backward pass.
    pub workspace: usize,
    /// For the forward call alone.
    pub forward_scratch: usize,
    /// For the backward call alone.
    pub backward_scratch: usize,
    /// Of the weight as the forward calls of a step want it; see [`Op::pack`].
    pub forward_packed: usize,
    /// Of the weight as the backward calls of a step want it.
    pub backward_packed: usize,
}

/// What a backward pass reads besides dy: all that is not named here is freed, or reused, after its last forward use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    /// By operand.
    pub operands: [bool; MAX_OPERANDS],
    /// The operation's own result.
    pub result: bool,
}

impl Reads {
    /// Nothing: the backward pass needs dy and the shapes alone.
    pub const NOTHING: Self = Self { operands: [false; MAX_OPERANDS], result: false };

    /// The operands with these indices.
    pub fn operands(indices: &[usize]) -> Self {
        Self { operands: std::array::from_fn(|index| indices.contains(&index)), result: false }
    }

    /// The operation's own result, and not its operands.
    pub const fn result() -> Self {
        Self { operands: [false; MAX_OPERANDS], result: true }
    }

    /// And its own result.
    pub const fn and_result(mut self) -> Self {
        self.result = true;
        self
    }
}

/// What all samples of a step have given together to an operation that couples them.
#[derive(Clone, Copy, Debug)]
pub struct Coupled<'a, T> {
    /// Their parts, combined.
    pub total: &'a [T],
    /// How many they are.
    pub samples: usize,
}

/// What a forward pass is given.
pub struct Forward<'a, T> {
    /// Operands, in order; empty beyond the last.
    pub x: [&'a [T]; MAX_OPERANDS],
    /// Result, to be written completely; holds anything before.
    pub y: &'a mut [T],
    /// Workspace, to be written completely; holds anything before.
    pub workspace: &'a mut [T],
    /// Scratch; holds anything before.
    pub scratch: &'a mut [T],
    /// What [`Op::pack`] made of the weight for the forward pass; empty if the weight is no parameter.
    pub packed: &'a [T],
    /// Shapes of the operands.
    pub shapes: &'a [Shape],
    /// Instruction-set level for the kernels.
    pub isa: InstructionSet,
    /// For large operations: in how many pieces to work.
    pub parts: Parts<'a, T>,
    /// Random stream of this operation, step and sample; `None` when random parts are off. Counter-based: the backward pass
    /// and any thread make the same numbers again.
    pub stream: Option<Stream>,
    /// For a [`Coupling`] while training; otherwise `None`.
    pub coupled: Option<Coupled<'a, T>>,
}

/// One gradient to be produced, and how.
pub struct Gradient<'a, T> {
    /// Where to.
    pub values: &'a mut [T],
    /// Whether to set or to add.
    pub write: Write,
}

/// What a backward pass is given.
pub struct Backward<'a, T> {
    /// Operands named in [`Reads`]; the others are empty.
    pub x: [&'a [T]; MAX_OPERANDS],
    /// Result, if named in [`Reads`]; empty otherwise.
    pub y: &'a [T],
    /// Gradient of the loss with respect to the result.
    pub dy: &'a [T],
    /// Workspace as the forward pass left it.
    pub workspace: &'a [T],
    /// Gradients to produce, by operand; `None` where nobody asks.
    pub dx: [Option<Gradient<'a, T>>; MAX_OPERANDS],
    /// Scratch; holds anything before.
    pub scratch: &'a mut [T],
    /// What [`Op::pack`] made of the weight for the backward pass; empty if the weight is no parameter.
    pub packed: &'a [T],
    /// Shapes of the operands.
    pub shapes: &'a [Shape],
    /// Instruction-set level for the kernels.
    pub isa: InstructionSet,
    /// The random stream of the forward pass.
    pub stream: Option<Stream>,
    /// For a [`Coupling`] while training, combined from the parts of the backward pass; otherwise `None`.
    pub coupled: Option<Coupled<'a, T>>,
}

/// The operand that may be packed once a step.
pub const WEIGHT: usize = 1;

/// Which of the two passes a packed weight, or a sample's part of a coupling, is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// For [`Op::forward`].
    Forward,
    /// For [`Differentiable::backward`].
    Backward,
}

/// What packing is given.
pub struct Pack<'a, T> {
    /// Which form is wanted.
    pub pass: Pass,
    /// Operand [`WEIGHT`].
    pub weight: &'a [T],
    /// To be written completely; holds anything before.
    pub packed: &'a mut [T],
    /// Shapes of the operands.
    pub shapes: &'a [Shape],
    /// Instruction-set level for the kernels.
    pub isa: InstructionSet,
}

/// An operation: numbers in, numbers out, for one sample.
pub trait Op<T: Real>: Send + Sync {
    /// Name in errors.
    fn name(&self) -> &'static str;

    /// Shape of the result.
    ///
    /// # Errors
    /// [`Error::Shape`] with the operands' shapes and what would fit.
    fn shape(&self, operands: &[Shape]) -> Result<Shape>;

    /// Buffers for operands of these shapes.
    fn memory(&self, _operands: &[Shape]) -> Memory {
        Memory::default()
    }

    /// Turns operand [`WEIGHT`] into the form the kernels want, once a step for all its samples. Called if [`Memory`] asks for it
    /// and the operand is a parameter.
    fn pack(&self, _io: Pack<'_, T>) {}

    /// Writes the result and the workspace.
    fn forward(&self, io: Forward<'_, T>);

    /// The backward pass, if there is one. An operation without cannot stand on a path from a parameter to a loss: planning a
    /// training session then fails, naming it.
    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        None
    }

    /// How it works on a micro-batch of samples, if that is worth while for operands of these shapes.
    fn micro_batched(&self, _operands: &[Shape]) -> Option<&dyn MicroBatched<T>> {
        None
    }

    /// How the gradient of its weight is made from all samples of a step, if operands of these shapes make that worth while. It is
    /// micro-batched, too.
    fn large_weight(&self, _operands: &[Shape]) -> Option<&dyn LargeWeight<T>> {
        None
    }

    /// How it couples the samples of a step, if it does.
    fn coupling(&self) -> Option<&dyn Coupling<T>> {
        None
    }
}

/// Most samples that an operation is given at once.
pub const MICRO_BATCH: usize = 4;

/// Numbers of a weight from which on it is read once for a micro-batch of samples: with its gradient it fills half of a second-level cache
/// of 512 KiB in f32.
pub(crate) const LARGE_WEIGHT: usize = 1 << 15;

/// What the gradient of a large weight is made of.
pub struct WeightGradient<'a, T> {
    /// Operand 0 of all samples of a step, `[samples, its length]`.
    pub x: Rows<'a, T>,
    /// Gradients of the results of the same samples, `[samples, its length]`.
    pub dy: Rows<'a, T>,
    /// The rows of the weight that are asked for.
    pub rows: Range<usize>,
    /// Their gradient.
    pub gradient: Gradient<'a, T>,
    /// Scratch, as [`LargeWeight::weight_scratch`] says; holds anything.
    pub scratch: &'a mut [T],
    /// Shapes of the operands.
    pub shapes: &'a [Shape],
    /// Instruction-set level for the kernels.
    pub isa: InstructionSet,
}

/// An operation that gains by working on some samples at once, where these take turns at the operations of their plan.
///
/// What a sample gives must not depend on the others in its micro-batch, to the bit. Operands from [`WEIGHT`] on are parameters, and operand 0
/// is none.
pub trait MicroBatched<T: Real>: Differentiable<T> {
    /// [`Op::forward`] for each of 1 to [`MICRO_BATCH`] samples.
    fn forward_micro_batch(&self, micro_batch: &mut [Forward<'_, T>]);

    /// [`Differentiable::backward`] for each. The gradients of parameters are those of all together, and asked of the first sample alone; that of a
    /// [`LargeWeight`] is not asked for.
    fn backward_micro_batch(&self, micro_batch: &mut [Backward<'_, T>]);
}

/// An operation with a weight so large that, sample by sample, it would come from memory for each one: it works on some samples at once,
/// and so do all other operations of its plan, in turn. The gradient of the weight, as large, is made once a step from all samples.
///
/// Its backward pass reads operand 0.
pub trait LargeWeight<T: Real>: MicroBatched<T> {
    /// Some rows of the gradient of the weight. The bits of a row may depend on which rows are asked for together.
    fn weight_gradient(&self, io: WeightGradient<'_, T>);

    /// Scratch, in numbers, for the gradient of this many rows of the weight.
    fn weight_scratch(&self, operands: &[Shape], rows: usize) -> usize;
}

/// An operation whose result for one sample depends on all samples of the step, as that of a batch normalisation does.
///
/// While training (that is, where random parts are on) all samples reach the operation before any goes on: each gives its part, the
/// parts are combined in the order of the samples, and the passes find the total in `coupled`. Where random parts are off there is no
/// total, and the operation takes what earlier steps have left in its parameters.
pub trait Coupling<T: Real>: Op<T> {
    /// Numbers in a part, and in the total.
    fn part_len(&self, operands: &[Shape]) -> usize;

    /// The part of one sample. Of the buffers only operands may be read, and nothing written.
    fn gather(&self, io: &Forward<'_, T>, part: &mut [T]);

    /// The same in the backward pass, where dy and the workspace may be read, too.
    fn gather_backward(&self, io: &Backward<'_, T>, part: &mut [T]);

    /// The total of the parts `[samples, part_len]`.
    fn combine(&self, pass: Pass, operands: &[Shape], parts: &[T], total: &mut [T]);

    /// What the total of a forward pass leaves in operand `operand`, a parameter without gradient, for steps to come.
    fn settle(&self, operand: usize, operands: &[Shape], coupled: Coupled<'_, T>, values: &mut [T]);
}

/// An operation with a backward pass.
pub trait Differentiable<T: Real>: Op<T> {
    /// What the backward pass reads.
    fn reads(&self) -> Reads;

    /// Whether there is a gradient with respect to this operand (a constant such as a target has none).
    fn reaches(&self, _operand: usize) -> bool {
        true
    }

    /// Writes every gradient asked for, as its [`Write`] says.
    fn backward(&self, io: Backward<'_, T>);
}

/// The error for operands that do not fit.
pub(crate) fn misfit(operation: &'static str, operands: &[Shape], expected: &str) -> Error {
    Error::Shape { operation, message: format!("operands of shapes {operands:?}; expected {expected}") }
}

/// The operands as an array of known length.
pub(crate) fn exactly<const N: usize>(operation: &'static str, operands: &[Shape], expected: &str) -> Result<[Shape; N]> {
    <[Shape; N]>::try_from(operands).map_err(|_| misfit(operation, operands, expected))
}
