//! What a check says of a whole set: its findings, the tables beside them, and the same as aligned text. No measuring here.

use super::excitation::{Collinearity, Excitation};
use super::finding::{Finding, Severity, Subject};
use super::timing::DelayProfile;
use crate::critique::wrap::wrapped;
use crate::flight::Targets;
use serde::{Deserialize, Serialize};
use std::fmt;

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
        let faults = self.findings.iter().filter(|finding| finding.verdict == Severity::Fault);
        let mut names: Vec<String> = faults.flat_map(|finding| finding.flights.iter().cloned()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// What a person has to know first: the summary, and each finding that is not as expected.
    ///
    /// # Examples
    /// ```
    /// # #[cfg(not(feature = "sim"))]
    /// # fn main() {}
    /// # #[cfg(feature = "sim")]
    /// # fn main() -> phyture::Result<()> {
    /// use phyture::critique::check::check;
    /// use phyture::sim::{Simulation, simulate};
    ///
    /// let report = check(&simulate(&Simulation { minutes: 4.0, ..Simulation::baseline() })?, None);
    /// assert!(report.in_short().lines().count() < report.to_string().lines().count());
    /// # Ok(())
    /// # }
    /// ```
    pub fn in_short(&self) -> String {
        let is_expected = |finding: &&Finding| finding.verdict == Severity::Ok;
        let (expected, others): (Vec<&Finding>, Vec<&Finding>) = self.findings.iter().partition(is_expected);
        let basis = format!(
            "{} flights, {:.0} s; accelerations {}; {} of {} findings are as expected",
            self.flights,
            self.duration_s,
            self.origin(),
            expected.len(),
            self.findings.len()
        );
        let lines = [wrapped("", &self.summary), wrapped("", &basis)];
        lines.into_iter().chain(others.iter().map(ToString::to_string)).collect::<Vec<_>>().join("\n")
    }

    const fn origin(&self) -> &'static str {
        match self.targets {
            Targets::Recorded => "recorded",
            Targets::Derived => "derived from v and w by a zero-phase differentiator",
        }
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", wrapped("", &self.summary))?;
        writeln!(f, "{} flights, {:.0} s; accelerations {}", self.flights, self.duration_s, self.origin())?;
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
