//! What a check says: findings with their numbers, and the same as aligned text. No measuring here.

use super::excitation::{Collinearity, Excitation};
use super::timing::DelayProfile;
use crate::critique::wrap::{WIDTH, wrapped};
use crate::flight::Targets;
use serde::{Deserialize, Serialize};
use std::fmt;

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
pub enum Verdict {
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
    pub verdict: Verdict,
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

/// Result of `check`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckReport {
    /// Whether a convention is wrong (exit code 3).
    pub fault: bool,
    /// One or two sentences for a person.
    pub summary: String,
    /// Flights checked.
    pub flights: usize,
    /// Their length, s.
    pub duration_s: f64,
    /// Where the targets come from: derived as soon as one flight's are.
    pub targets: Targets,
    /// The findings by subject, in the order they were made.
    pub findings: Vec<Finding>,
    /// Error of a simple fit against the delay of the controls.
    pub control_delay: Option<DelayProfile>,
    /// What states and controls do in these flights.
    pub excitation: Vec<Excitation>,
    /// How well the baseline's columns can be told apart.
    pub collinearity: Vec<Collinearity>,
    /// What the reader did on the way.
    pub notes: Vec<String>,
}

impl CheckReport {
    /// Flights that some finding of a fault names: they are read otherwise than the rest.
    pub fn suspects(&self) -> Vec<String> {
        let faults = self.findings.iter().filter(|finding| finding.verdict == Verdict::Fault);
        let mut names: Vec<String> = faults.flat_map(|finding| finding.flights.iter().cloned()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}

impl Verdict {
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
const PLACE: usize = 34;

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<8}{:<26}", self.verdict.word(), self.name)?;
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
        self.set.iter().try_for_each(|set| write!(f, "\n{:>8}set: {}", "", set.replace('\n', "; ")))
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let targets = match self.targets {
            Targets::Recorded => "recorded",
            Targets::Derived => "derived from v and w by a zero-phase differentiator",
        };
        writeln!(f, "{}", wrapped("", &self.summary))?;
        writeln!(f, "{} flights, {:.0} s; accelerations {targets}", self.flights, self.duration_s)?;
        self.notes.iter().try_for_each(|note| writeln!(f, "{}", wrapped("note: ", note)))?;
        for (subject, title) in
            [(Subject::Conventions, "Conventions"), (Subject::Timing, "Timing"), (Subject::Excitation, "Excitation")]
        {
            writeln!(f, "\n{title}")?;
            self.findings.iter().filter(|finding| finding.subject == subject).try_for_each(|finding| writeln!(f, "{finding}"))?;
        }
        writeln!(f, "\n{:<8}{:>10}{:>10}{:>10}{:>10}{:>12}{:>8}", "column", "min", "max", "mean", "rms", "dwell, s", "blocks")?;
        for row in &self.excitation {
            writeln!(
                f,
                "{:<8}{:>10.3}{:>10.3}{:>10.3}{:>10.3}{:>12.1}{:>8}  {}",
                row.column, row.minimum, row.maximum, row.mean, row.deviation, row.dwell_s, row.carrying_blocks, row.unit
            )?;
        }
        writeln!(f, "\n{:<8}{:>18}  variance inflation", "channel", "condition number")?;
        self.collinearity.iter().try_for_each(|row| {
            let inflation: Vec<String> = row.variance_inflation.iter().map(|(name, value)| format!("{name} {value:.1}")).collect();
            let place = format!("{:<8}{:>18.1}  ", row.channel, row.condition_number);
            writeln!(f, "{}", wrapped(&place, &inflation.join(", ")))
        })
    }
}
