//! A step of a plan: one call of one operation, and the stretches of memory that it borrows. Made in `steps`, replayed by `session`.

use super::super::op::Op;
use super::super::shape::Shape;
use phyture_kernels::Write;
use std::ops::Range;
use std::sync::Arc;

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

impl Piece {
    pub(super) fn new(range: Range<usize>, role: Role) -> Self {
        Self { start: range.start, len: range.len(), role }
    }
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
    pub micro_batched: bool,
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
