//! From one suggestion to a description with which nothing is at fault: what is behind a first fault shows once that is mended, so the flights are read and
//! looked at again with each. Which line mends what is the business of `suggestion`; reading is the caller's.

use super::report::CheckReport;
use super::suggestion::Suggestion;
use super::{Severity, check};
use crate::error::Result;
use crate::flight::DataSet;
use crate::physics::Model;

/// Rounds after which what is still at fault is left to a person.
const ROUNDS: usize = 5;

/// A description, and what `check` says of the flights as it reads them.
#[derive(Clone, Debug)]
pub struct Mending {
    /// The last text, all findings that it mends, and what it leaves open.
    pub suggestion: Suggestion,
    /// How often the flights were read.
    pub rounds: usize,
    /// Of the flights as they are read with it; `None` where they cannot be.
    pub report: Option<CheckReport>,
    /// These flights.
    pub set: Option<DataSet>,
}

impl Mending {
    /// Whether nothing is at fault any more.
    pub fn is_free(&self) -> bool {
        self.report.as_ref().is_some_and(|report| !report.fault)
    }
}

/// Suggests, reads the flights with that (`read`), and looks at them again, until nothing is at fault or nothing more can be said. `None` where no line of a
/// description mends anything.
///
/// # Examples
/// ```
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// # #[cfg(feature = "sim")]
/// # fn main() -> phyture::Result<()> {
/// use phyture::critique::check::{check, mend};
/// use phyture::sim::{Simulation, simulate};
///
/// let set = simulate(&Simulation { minutes: 4.0, ..Simulation::baseline() })?;
/// let report = check(&set, None);
/// assert!(mend(&set, &report, None, |_| unreachable!("nothing is at fault")).is_none());
/// # Ok(())
/// # }
/// ```
pub fn mend(
    set: &DataSet,
    report: &CheckReport,
    model: Option<&Model>,
    mut read: impl FnMut(&str) -> Result<DataSet>,
) -> Option<Mending> {
    let is_of_use = |suggestion: &Suggestion| !suggestion.mends.is_empty();
    let suggestion = report.suggestion(&set.source).filter(is_of_use)?;
    let Ok(first) = read(&suggestion.text) else { return Some(Mending { suggestion, rounds: 1, report: None, set: None }) };
    let report = check(&first, model);
    let (mut made, mut set, mut report, mut rounds) = (suggestion, first, report, 1);
    while rounds < ROUNDS {
        let next = report.suggestion(&set.source).filter(is_of_use).filter(|next| next.text != made.text);
        // What cannot be read is not suggested, …
        let Some((mut next, again)) = next.and_then(|next| read(&next.text).ok().map(|again| (next, again))) else { break };
        let seen = check(&again, model);
        // … nor what brings a fault back where none is left.
        if seen.fault && !report.fault {
            break;
        }
        next.mends.splice(0..0, made.mends);
        (made, set, report) = (next, again, seen);
        rounds += 1;
    }
    let open = faults(&report);
    made.open.retain(|known| open.contains(&known.name));
    Some(Mending { suggestion: made, rounds, report: Some(report), set: Some(set) })
}

fn faults(report: &CheckReport) -> Vec<String> {
    report.findings.iter().filter(|finding| finding.verdict == Severity::Fault).map(|finding| finding.name.clone()).collect()
}
