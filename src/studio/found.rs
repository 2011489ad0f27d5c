//! A result, or why the data or a file has none: a state that a view shows in its place, not a failure of a request.

use crate::error::{Error, Result};
use serde::Serialize;

/// A result, or why there is none and what to do.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Found<T> {
    /// It is there.
    Known(T),
    /// It cannot be had.
    Missing {
        /// Why, and what to do.
        why: String,
    },
}

impl<T> Found<T> {
    /// What a log lacks, or a model asks in vain of it, is told in the place of a result.
    pub(super) fn of_log(made: Result<T>) -> Result<Self> {
        match made {
            Ok(known) => Ok(Self::Known(known)),
            Err(error @ (Error::Log { .. } | Error::Undetermined(_) | Error::Config { .. } | Error::Formula { .. })) => {
                Ok(Self::Missing { why: error.to_string() })
            }
            Err(error) => Err(error),
        }
    }

    /// With a function of what is there.
    pub(super) fn map<U>(self, of: impl FnOnce(T) -> U) -> Found<U> {
        match self {
            Self::Known(known) => Found::Known(of(known)),
            Self::Missing { why } => Found::Missing { why },
        }
    }

    /// What is there.
    pub fn known(self) -> Option<T> {
        match self {
            Self::Known(known) => Some(known),
            Self::Missing { .. } => None,
        }
    }
}
