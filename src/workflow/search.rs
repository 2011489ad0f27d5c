//! Which physical effect is missing, asked of a data set: one search, or searches with adding and calibrating until nothing is left. The searching itself
//! is done in `critique::diagnose`.

use crate::critique::check::{self, CheckReport};
use crate::critique::diagnose::{self, Amended, Diagnosis, Mends, Options, Outcome, Verdict, searched};
use crate::critique::floor_of_spans;
use crate::error::Result;
use crate::flight::split::Split;
use crate::flight::{DataSet, Flight, Span};
use crate::hybrid::{Hybrid, network_target};
use crate::physics::Model;
use crate::tape::Threads;
use serde::Serialize;
use std::path::PathBuf;

/// Most windows of a network with a short history that are evaluated when its output is searched; a long one costs ten times as much.
const MOST_WINDOWS: usize = 100_000;
/// A history of at most this many rows is short.
const SHORT_HISTORY: usize = 256;

/// Flights, and what may be searched of them.
pub struct SearchTask<'a> {
    /// Flights.
    pub set: &'a DataSet,
    /// What is searched and what only confirms.
    pub split: &'a Split,
    /// Hash of the files.
    pub data_sha256: String,
    /// How to search.
    pub options: Options,
    /// The explainable part of the flights, where it is known.
    pub explainable: Option<Vec<Flight>>,
}

impl SearchTask<'_> {
    /// Searches once.
    ///
    /// # Errors
    /// As [`diagnose::diagnose`].
    pub fn diagnose(&self, model: &Model) -> Result<Outcome> {
        let (searched, locked) = (searched(self.split), &self.split.test);
        let mut outcome =
            diagnose::diagnose(&self.set.flights, model, &searched, locked, self.split.tested.name(), &self.options())?;
        self.label(&mut outcome.diagnosis)?;
        diagnose::weigh(&mut outcome.diagnosis, &self.set.flights, &outcome.model, self.split)?;
        Ok(outcome)
    }

    /// Diagnoses, adds and calibrates until nothing worthwhile is left. `heard` is given each round as it ends.
    ///
    /// # Errors
    /// As [`diagnose::amend`]; those of `heard`.
    pub fn amend(&self, model: &Model, heard: &mut dyn FnMut(usize, &Diagnosis) -> Result<()>) -> Result<Amended> {
        diagnose::amend(&self.set.flights, model, self.split, &self.options(), &mut |round, diagnosis| {
            self.label(diagnosis)?;
            heard(round, diagnosis)
        })
    }

    /// The rounds of a loop as one diagnosis: all effects as one list, and what they did to the errors. `before` is the model as it was given,
    /// calibrated.
    ///
    /// # Errors
    /// As [`diagnose::together`].
    pub fn together(&self, before: &Model, amended: &Amended) -> Result<Diagnosis> {
        let mut together = diagnose::together(&self.set.flights, before, amended, self.split)?;
        self.label(&mut together)?;
        Ok(together)
    }

    /// With what the description of these flights mends.
    fn options(&self) -> Options {
        Options { mends: Mends::of(&self.set.source), ..self.options.clone() }
    }

    /// Notes what the search does not know: the hash of the files and the floor.
    fn label(&self, diagnosis: &mut Diagnosis) -> Result<()> {
        diagnosis.data_sha256.clone_from(&self.data_sha256);
        if let (Some(locked), Some(explainable)) = (&mut diagnosis.locked, &self.explainable) {
            locked.set_floor(floor_of_spans(&self.set.flights, &locked.spans, explainable)?);
        }
        Ok(())
    }
}

/// The verdict where the log is not what the program takes it for: the faults of a check, and nothing searched.
pub fn convention_fault(report: &CheckReport, data_sha256: String) -> Diagnosis {
    let faults = report.findings.iter().filter(|finding| finding.verdict == check::Severity::Fault);
    let notes = faults.map(|finding| match &finding.set {
        Some(set) => format!("{}; set {set}", finding.message),
        None => finding.message.clone(),
    });
    let nothing = Diagnosis::nothing(Verdict::ConventionFault, report.summary.clone());
    Diagnosis { data_sha256, notes: notes.collect(), ..nothing }
}

/// Flights whose accelerations are what a network says, and how they are divided.
pub struct NetworkSearch {
    /// The flights.
    pub set: DataSet,
    /// What of them is searched and what confirms.
    pub split: Split,
    /// So manieth samples were evaluated.
    pub stride: usize,
}

/// What a network learned, to be searched in place of the measured accelerations.
///
/// # Errors
/// As [`network_target`].
pub fn network_search(hybrid: &Hybrid, set: &DataSet, split: &Split, threads: Threads) -> Result<NetworkSearch> {
    let samples: usize = set.flights.iter().map(Flight::len).sum();
    let affordable = if hybrid.description().config.history() <= SHORT_HISTORY { MOST_WINDOWS } else { MOST_WINDOWS / 10 };
    let stride = samples.div_ceil(affordable).max(1);
    let whole: Vec<Span> = set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
    let target = network_target(hybrid, &set.flights, &whole, stride, threads)?;
    let split = Split {
        training: target.spans(&split.training),
        validation: target.spans(&split.validation),
        test: target.spans(&split.test),
        tested: split.tested,
    };
    Ok(NetworkSearch { set: target.set, split, stride })
}

/// What a loop did, as data.
#[derive(Serialize)]
pub struct Looped {
    /// Diagnoses, one a round.
    pub rounds: Vec<Diagnosis>,
    /// The rounds as one: what was added, what it is worth, the errors before and after.
    pub together: Diagnosis,
    /// The file of the model, if it was written.
    pub model: Option<PathBuf>,
    /// There is one once something was added to a model.
    pub ledger: Option<PathBuf>,
}
