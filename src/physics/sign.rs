//! On which side of zero a number lies by physics. Knows no effect; what was found is laid beside it in `sign_doubt`.

use serde::{Deserialize, Serialize};

/// On which side of zero a coefficient lies by physics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// Above zero.
    Positive,
    /// Below zero.
    Negative,
}

impl Sign {
    /// In a word.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Positive => "positive",
            Self::Negative => "negative",
        }
    }

    /// Bounds without the wrong side.
    pub(crate) const fn bounds(self, [low, high]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Positive => [low.max(0.0), high],
            Self::Negative => [low, high.min(0.0)],
        }
    }
}
