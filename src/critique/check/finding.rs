//! One thing that was measured, and what it means: as data, and as a line of text. Knows no check.

use super::regression::Estimate;
use crate::critique::wrap::{WIDTH, wrapped};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Relations whose readings say how a log is written: how the names of their findings begin.
pub(super) const RELATIONS: [&str; 4] = ["position_rate", "attitude_rate", "velocity_targets", "rate_targets"];

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// Axes, frames, signs, units.
    Conventions,
    /// Streams of the log against each other.
    Timing,
    /// What the flights contain.
    Excitation,
}

/// Outcome of one check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// As expected.
    Ok,
    /// The data do not say.
    Undetermined,
    /// Worth a look; what follows is still meaningful.
    Warning,
    /// A convention is wrong: nothing that follows would mean anything.
    Fault,
}

/// One thing that was measured, and what it means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Identifier, stable between versions.
    pub name: String,
    /// What it is about.
    pub subject: Subject,
    /// Outcome.
    pub verdict: Severity,
    /// Measured value, if it is a number.
    pub measured: Option<f64>,
    /// 95 % interval of the value, from blocks of 10 s.
    pub interval: Option<[f64; 2]>,
    /// Value expected.
    pub expected: Option<f64>,
    /// Unit of the three.
    pub unit: String,
    /// In words.
    pub message: String,
    /// What to set in `dataset.toml` (or the model file, if it says so).
    pub set: Option<String>,
    /// The flights that it is about, where it is not about all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub flights: Vec<String>,
}

impl Severity {
    /// Word for tables.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Undetermined => "unclear",
            Self::Warning => "WARNING",
            Self::Fault => "FAULT",
        }
    }
}

/// Columns of a finding's verdict and name.
const PLACE: usize = 35;
/// Of a finding with many lines so many are shown.
const SHOWN: usize = 3;

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<8}{:<27}", self.verdict.word(), self.name)?;
        let interval = self.interval.map(|[low, high]| format!(" [{low:.3}, {high:.3}]")).unwrap_or_default();
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        let measured = self.measured.map(|value| format!("{value:.3}{interval}{unit}")).unwrap_or_default();
        let expected = self.expected.map(|value| format!("expected {value}")).unwrap_or_default();
        let figures = format!("{measured:<32}{expected:<14}");
        if PLACE + figures.chars().count() + self.message.chars().count() <= WIDTH {
            write!(f, "{figures}{}", self.message)?;
        } else {
            write!(f, "{}\n{}", figures.trim_end(), wrapped(&" ".repeat(8), &self.message))?;
        }
        let Some(set) = &self.set else { return Ok(()) };
        let lines: Vec<&str> = set.lines().collect();
        let shown = lines[..lines.len().min(SHOWN)].join("; ");
        write!(f, "\n{:>8}set: {shown}", "")?;
        match lines.len().checked_sub(SHOWN) {
            None | Some(0) => Ok(()),
            Some(more) => write!(f, "; and {more} more lines, all of which `check --suggest FILE` writes"),
        }
    }
}

/// A coefficient that is 1 where the conventions hold, and is not judged yet.
pub(super) fn unjudged(name: &str, estimate: Option<Estimate>) -> Finding {
    Finding {
        measured: estimate.map(|estimate| estimate.value),
        interval: estimate.map(|estimate| estimate.interval),
        expected: Some(1.0),
        ..finding(name, Severity::Undetermined, "not determined by these flights".into(), None)
    }
}

/// A finding on conventions that brings no number.
pub(super) fn finding(name: &str, verdict: Severity, message: String, set: Option<&str>) -> Finding {
    Finding {
        name: name.into(),
        subject: Subject::Conventions,
        verdict,
        measured: None,
        interval: None,
        expected: None,
        unit: "1".into(),
        message,
        set: set.map(Into::into),
        flights: Vec::new(),
    }
}
