//! From logs that nobody has described to a description and a model to start from: what the log's numbers say ([`guess`]), then the lines
//! that [`check`] finds to mend, as long as they mend something. What stays open is told with how to find out.

use super::check::{CheckReport, Finding, Severity, Subject, Suggestion, check};
use crate::error::{Error, Result};
use crate::flight::DataSet;
use crate::flight::guess::{Guess, Unknown, guess};
use crate::flight::read::{ReadOptions, data_set};
use serde::Serialize;
use std::path::Path;

/// How often lines that mend something are put in before the rest is left to a person.
const ROUNDS: usize = 4;

/// What is written for logs that had no description.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Initial {
    /// The log that was looked at first.
    pub log: String,
    /// The text of the `dataset.toml`.
    #[serde(skip)]
    pub dataset: String,
    /// The text of the `model.toml`.
    #[serde(skip)]
    pub model: String,
    /// What the log itself shows.
    pub sure: Vec<String>,
    /// The findings of `check` whose lines are in the description.
    pub mended: Vec<String>,
    /// What is not known.
    pub unknown: Vec<Unknown>,
    /// Whether the logs are read with it and nothing is found at fault.
    pub reads: bool,
    /// Flights that are read.
    pub flights: usize,
}

/// A description and a model for the logs at `data`, which stay as they are.
///
/// # Errors
/// [`Error::Io`], [`Error::Log`], [`Error::Cell`] where there is no log that can be read as columns.
pub fn init(data: &Path) -> Result<Initial> {
    let Guess { log, text, sure, unknown } = guess(data)?;
    let name = data.file_stem().map_or("aircraft".into(), |name| name.to_string_lossy().into_owned());
    let model = model(&name);
    let mut made = Initial { log, dataset: text, model, sure, mended: Vec::new(), unknown, reads: false, flights: 0 };
    let (mut set, mut report) = match judged(data, &made.dataset) {
        Ok(judged) => judged,
        Err(error) => {
            let how = "mend that, or say it in dataset.toml (docs/flight-logs.md), and ask `phyture check`".into();
            made.unknown.push(Unknown { what: format!("more than that: so described the logs are not read: {error}"), how });
            return Ok(made);
        }
    };
    for _ in 0..ROUNDS {
        let Some(suggestion) = mending(&set, &report) else { break };
        // A line may contradict what the log itself showed; then it mends nothing.
        let Ok((next, better)) = judged(data, &suggestion.text) else { break };
        if faults(&better).count() >= faults(&report).count() {
            break;
        }
        made.dataset = suggestion.text;
        made.mended.extend(suggestion.mends);
        (set, report) = (next, better);
    }
    made.flights = set.flights.len();
    made.reads = faults(&report).next().is_none();
    made.unknown.extend(open(&report.findings));
    Ok(made)
}

fn judged(data: &Path, text: &str) -> Result<(DataSet, CheckReport)> {
    let read =
        |split_at_gaps| data_set(data, &ReadOptions { described: Some(text.into()), split_at_gaps, ..ReadOptions::default() });
    let set = match read(false) {
        // Gaps are another question than how the columns are to be read.
        Err(error) if matches!(&error, Error::Cell { expected, .. } | Error::Log { expected, .. } if expected.contains("--split-at-gaps")) => {
            read(true)?
        }
        result => result?,
    };
    let report = check(&set, None);
    Ok((set, report))
}

/// Lines that may mend what is at fault. Of logs that nobody has described none is the odd one: what a fault says of some flights, as others do not
/// tell, is asked of those alone, and then tried on all. No flight is left out.
fn mending(set: &DataSet, report: &CheckReport) -> Option<Suggestion> {
    let suspects = report.suspects();
    let own = if suspects.is_empty() {
        report.suggestion(&set.source)
    } else {
        let flights = set.flights.iter().filter(|flight| suspects.contains(&flight.name)).cloned().collect();
        let some = DataSet { flights, ..set.clone() };
        check(&some, None).suggestion(&set.source)
    };
    own.filter(|suggestion| !suggestion.mends.is_empty() && !suggestion.text.contains("\nleave_out = "))
}

fn faults(report: &CheckReport) -> impl Iterator<Item = &Finding> {
    report.findings.iter().filter(|finding| finding.verdict == Severity::Fault)
}

/// What the findings leave open: each fault, and in one what these flights do not tell.
fn open(findings: &[Finding]) -> Vec<Unknown> {
    let fault = |finding: &Finding| Unknown {
        what: format!("{}: {}", finding.name, finding.message),
        how: finding.set.clone().unwrap_or_else(|| "no line of a description mends it".into()),
    };
    let mut open: Vec<Unknown> = findings.iter().filter(|finding| finding.verdict == Severity::Fault).map(fault).collect();
    let is_untold = |finding: &&Finding| (finding.verdict, finding.subject) == (Severity::Undetermined, Subject::Conventions);
    let untold: Vec<&str> = findings.iter().filter(is_untold).map(|finding| finding.name.as_str()).collect();
    if !untold.is_empty() {
        open.push(Unknown {
            what: format!("what these flights do not tell `check`: {}", untold.join(", ")),
            how: "longer flights, and such that move more; `phyture check` says of each what it lacks".into(),
        });
    }
    open
}

/// A model to start from. What no log says stays open in it.
fn model(name: &str) -> String {
    let name = toml::Value::String(name.into());
    format!(
        "# A model to start from: the paper's baseline, to be calibrated (`phyture calibrate`).
[model]
name = {name}
baseline = \"paper\"
# No log says these; without them the paper's helicopter is assumed, which every command then tells. Put in the aircraft's own:
# mass_kg = 3.2                   # kg
# inertia = [0.04, 0.10, 0.08]    # kg m², about the roll, pitch and yaw axis
# rotor_radius_m = 0.60           # m
"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::Model;

    #[test]
    fn the_model_is_one_with_what_is_open_assumed() -> Result<()> {
        let read = Model::from_toml(&model("a \"b\""), Path::new("model.toml"))?;
        assert!(read.name == "a \"b\"" && read.assumed.mass && read.assumed.inertia && read.assumed.rotor_radius);
        Ok(())
    }
}
