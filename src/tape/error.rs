//! What the engine refuses. It knows nothing of flights and files: [`crate::Error`] is made from it elsewhere.

use phyture_kernels::instruction_set::InstructionSetError;

/// Result with the engine's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What recording, planning and replaying refuse.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Shapes, handles or sizes that do not fit an operation.
    #[error("{operation}: {message}")]
    Shape {
        /// Operation by name.
        operation: &'static str,
        /// Both shapes and what would fit.
        message: String,
    },
    /// A number of threads that a session cannot have.
    #[error("session: `threads` is {found}, expected {expected}")]
    Threads {
        /// The number asked for, with the system's reason where it has one.
        found: String,
        /// What would do.
        expected: String,
    },
    /// The environment asks for an instruction set that this processor does not have.
    #[error(transparent)]
    InstructionSet(#[from] InstructionSetError),
}
