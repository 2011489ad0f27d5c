//! What is refused, and how it is said: a status and one JSON object.

use crate::error::Error;
use serde::Serialize;

/// An error as the page gets it.
#[derive(Clone, Debug, Serialize)]
pub struct FaultText {
    /// The kind in one word.
    pub kind: &'static str,
    /// What is wrong, and what to do.
    pub message: String,
    /// The character of a formula that it is about.
    pub at: Option<usize>,
}

/// A request that is not fulfilled.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// HTTP status.
    pub status: u16,
    /// Why.
    pub text: FaultText,
}

impl Refusal {
    pub(super) fn new(status: u16, kind: &'static str, message: impl Into<String>) -> Self {
        Self { status, text: FaultText { kind, message: message.into(), at: None } }
    }

    /// The object, as JSON.
    pub(super) fn body(&self) -> String {
        // Strings and a number: this does not fail.
        serde_json::to_string(&serde_json::json!({ "error": self.text })).unwrap_or_default()
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Exists { .. } | Error::Busy { .. } => 409,
            Error::Io { .. } => 500,
            _ => 422,
        };
        let at = match &error {
            Error::Formula { at, .. } => Some(*at),
            _ => None,
        };
        let message = match &error {
            Error::Formula { message, .. } => message.clone(),
            Error::Exists { path, what } => format!("{}: {what} is there already", path.display()),
            Error::Config { found, expected, field, .. } => format!("{field}: found {found}, expected {expected}"),
            other => other.to_string(),
        };
        Self { status, text: FaultText { kind: error.kind(), message, at } }
    }
}
