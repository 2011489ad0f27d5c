//! The states that the model went through, as a list with a place in it: undo and redo move the place, a step after an undo replaces what came
//! after. States never change.

use super::{LeftText, Progress, Studio, held};
use crate::critique::diagnose::Diagnosis;
use crate::critique::{ChannelValues, Intervals};
use crate::error::Result;
use crate::physics::{Calibration, Model};
use serde::Serialize;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A model, and how it came about.
#[derive(Clone)]
pub(super) struct State {
    pub id: u64,
    /// What was done, for a person.
    pub did: String,
    pub model: Model,
    /// The calibration that gave its numbers; none after a number was moved by hand.
    pub calibration: Option<Calibration>,
    /// The search that found the effect which this step added.
    pub found: Option<Arc<Diagnosis>>,
}

impl State {
    pub fn first(did: &str, model: Model) -> Self {
        Self { id: 0, did: did.into(), model, calibration: None, found: None }
    }
}

/// All states, and which is shown.
#[derive(Clone)]
pub(super) struct History {
    states: Vec<Arc<State>>,
    at: usize,
    next: u64,
    /// States that a save holds, or is the sum of.
    safe: BTreeSet<u64>,
}

impl History {
    pub fn new(first: State) -> Self {
        // What a studio opens with is read, or calibrated anew.
        let safe = [first.id].into();
        Self { states: vec![Arc::new(first)], at: 0, next: 1, safe }
    }

    /// All states, the place of the present one, and whether any of them would be lost.
    pub fn unsaved(&self) -> (Vec<Arc<State>>, usize, bool) {
        (self.states.clone(), self.at, self.states.iter().any(|state| !self.safe.contains(&state.id)))
    }

    /// A state was saved, and with it what led to it.
    pub fn is_saved(&mut self, id: u64) {
        let end = self.states.iter().position(|state| state.id == id).map_or(0, |at| at + 1);
        self.safe.extend(self.states[..end].iter().map(|state| state.id));
    }

    pub fn now(&self) -> Arc<State> {
        Arc::clone(&self.states[self.at])
    }

    pub fn state(&self, id: u64) -> Option<Arc<State>> {
        self.states.iter().find(|state| state.id == id).cloned()
    }

    /// The states up to the present one.
    pub fn path(&self) -> Vec<Arc<State>> {
        self.states[..=self.at].to_vec()
    }

    /// An identifier that no state has had.
    pub fn new_id(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }

    pub fn push(&mut self, state: Arc<State>) {
        self.states.truncate(self.at + 1);
        self.states.push(state);
        self.at += 1;
    }

    /// Shows another state; whether there is one.
    fn step(&mut self, by: isize) -> bool {
        let to = self.at.checked_add_signed(by).filter(|to| *to < self.states.len());
        self.at = to.unwrap_or(self.at);
        to.is_some()
    }

    pub fn go_to(&mut self, id: u64) -> bool {
        let to = self.states.iter().position(|state| state.id == id);
        self.at = to.unwrap_or(self.at);
        to.is_some()
    }
}

/// One state in the list.
#[derive(Clone, Debug, Serialize)]
pub struct StepText {
    /// Identifier, for requests.
    pub id: u64,
    /// What was done.
    pub did: String,
    /// Root mean square error on what judges, m/s² and rad/s²; absent for states that were undone.
    pub rmse: Option<ChannelValues>,
    /// Its 95 % interval.
    pub ci95: Option<Intervals>,
    /// Share of the variance of what was measured that it predicts.
    pub r2: Option<ChannelValues>,
    /// Whether its numbers come from a calibration of this very model.
    pub calibrated: bool,
}

/// The history as a list.
#[derive(Clone, Debug, Serialize)]
pub struct Steps {
    /// All states, those that were undone behind the present one.
    pub steps: Vec<StepText>,
    /// Index of the present state.
    pub at: usize,
    /// What the errors are judged on, in words.
    pub judged_on: String,
    /// Whether each half of a flight is judged with numbers from its other half, since some state has numbers of each flight.
    pub own_from_other_half: bool,
    /// Whether the present state is on disk.
    pub saved: bool,
    /// The model's file.
    pub file: Option<String>,
    /// Whether that file is another than the one that was read or written here last.
    pub file_changed: bool,
    /// The file in which unsaved steps lie until they are saved.
    pub kept: Option<String>,
    /// Why unsaved steps are not kept on disk.
    pub unkept: Option<String>,
    /// Unsaved steps that earlier studios left.
    pub left: Vec<LeftText>,
    /// As [`Pulse::revision`].
    pub revision: u64,
}

/// What a page asks for every other second.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Pulse {
    /// Grows with every change of the history or of what is saved.
    pub revision: u64,
    /// Whether the model's file is another than the one that was read or written here last.
    pub file_changed: bool,
    /// How far a search is.
    pub search: Progress,
    /// How far a training is.
    pub training: Progress,
}

impl Studio {
    /// The history with the error of every state on the way to the present one, all judged on the same samples.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn steps(&self) -> Result<Steps> {
        // Before the rest: a change meanwhile is then seen by the next pulse.
        let revision = self.revision.load(Ordering::Relaxed);
        let (path, all, at) = {
            let history = held(&self.history);
            (history.path(), history.states.clone(), history.at)
        };
        let errors = self.judge.path(&self.set, &self.split, &path)?;
        let text = |(index, state): (usize, &Arc<State>)| StepText {
            id: state.id,
            did: state.did.clone(),
            rmse: errors.of.get(index).map(|found| found.rmse),
            ci95: errors.of.get(index).map(|found| found.ci95),
            r2: errors.of.get(index).map(|found| found.r2),
            calibrated: state.calibration.is_some(),
        };
        let (kept, unkept, left) = {
            let drafts = held(&self.drafts);
            (drafts.file(), drafts.fault(), drafts.left())
        };
        let file = held(&self.file);
        let file_changed = file.is_changed();
        Ok(Steps {
            steps: all.iter().enumerate().map(text).collect(),
            at,
            judged_on: errors.basis,
            own_from_other_half: errors.halves,
            saved: file.holds(&all[at].model) && !file_changed,
            file: file.name(),
            file_changed,
            kept,
            unkept,
            left,
            revision,
        })
    }

    /// Whether a page still shows what is.
    pub fn pulse(&self) -> Pulse {
        let file_changed = held(&self.file).is_changed();
        let (search, training) = (self.progress(), self.training_progress());
        Pulse { revision: self.revision.load(Ordering::Relaxed), file_changed, search, training }
    }

    /// One step back; nothing at the first.
    ///
    /// # Errors
    /// As [`Studio::steps`].
    pub fn undo(&self) -> Result<Steps> {
        held(&self.history).step(-1);
        self.keep();
        self.steps()
    }

    /// One step forward again; nothing at the last.
    ///
    /// # Errors
    /// As [`Studio::steps`].
    pub fn redo(&self) -> Result<Steps> {
        held(&self.history).step(1);
        self.keep();
        self.steps()
    }

    /// Shows the state with this identifier; nothing where it is gone.
    ///
    /// # Errors
    /// As [`Studio::steps`].
    pub fn go_to(&self, id: u64) -> Result<Steps> {
        held(&self.history).go_to(id);
        self.keep();
        self.steps()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_after_an_undo_replaces_what_came_after() {
        let state = |did: &str| State::first(did, Model::paper("a", 4.0, [0.2, 0.3, 0.3], 0.8));
        let mut history = History::new(state("first"));
        let step = |history: &mut History, did: &str| {
            let id = history.new_id();
            history.push(Arc::new(State { id, ..state(did) }));
        };
        step(&mut history, "second");
        step(&mut history, "third");
        assert!(!history.step(1), "there is nothing after the last");
        assert!(history.step(-1) && history.now().did == "second");
        assert!(history.step(1) && history.now().did == "third");
        assert!(history.go_to(1) && history.now().did == "second" && !history.go_to(9));
        step(&mut history, "other");
        assert_eq!(history.path().iter().map(|state| state.did.as_str()).collect::<Vec<_>>(), ["first", "second", "other"]);
        assert_eq!(history.now().id, 3, "identifiers are not used twice");
        assert!(history.state(2).is_none() && history.state(1).is_some());
        assert!(history.step(-1) && history.step(-1) && !history.step(-1), "and nothing before the first");
    }
}
