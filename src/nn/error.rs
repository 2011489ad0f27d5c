//! What a network refuses: sizes out of their range, or what the tape refuses. And how the errors of both become those of the crate, which
//! neither the tape nor [`crate::error`] has to know.

use crate::tape;

/// Result with a network's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What recording a network refuses. Files of networks, in `safetensors` and `parity`, have the errors of files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A size is out of its range, or does not fit the others.
    #[error("network: `{field}` is {found}, expected {expected}")]
    Size {
        /// Name of the size.
        field: String,
        /// The value found.
        found: String,
        /// The range or form expected.
        expected: String,
    },
    /// The tape refuses an operation.
    #[error(transparent)]
    Tape(#[from] tape::Error),
}

impl From<tape::Error> for crate::Error {
    fn from(error: tape::Error) -> Self {
        match error {
            tape::Error::Shape { operation, message } => Self::Shape { operation, message },
            tape::Error::Threads { found, expected } => {
                Self::Config { place: "session".into(), field: "threads".into(), found, expected }
            }
            tape::Error::InstructionSet(error) => Self::instruction_set(error),
        }
    }
}

impl From<Error> for crate::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Size { field, found, expected } => Self::Config { place: "network".into(), field, found, expected },
            Error::Tape(error) => error.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::{Graph, Threads};

    #[test]
    fn the_crates_errors_say_the_same_and_are_of_the_kind_that_programs_know() {
        let refused = Graph::<f32>::new().input("x", &[]).map(|_| ()).expect_err("an empty shape");
        let size = super::super::configuration::refused("history", 0, "1 to 10");
        let threads = tape::Error::Threads { found: "2000".into(), expected: format!("0 to {}", Threads::MOST) };
        for (error, kind) in [(Error::from(refused), "shape"), (size, "config"), (Error::from(threads), "config")] {
            let said = error.to_string();
            let error = crate::Error::from(error);
            assert_eq!((error.to_string(), error.kind()), (said, kind));
        }
    }
}
