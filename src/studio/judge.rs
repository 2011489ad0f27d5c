//! States judged: their errors on flights that no fit has seen, or on all, by the same comparison as `compare`. Results are kept, since a person
//! looks at one state in several ways.

use super::held;
use super::history::State;
use super::recent::Recent;
use crate::critique::{ChannelValues, Intervals, Row};
use crate::error::Result;
use crate::flight::split::{Part, Split};
use crate::flight::windows::windows;
use crate::flight::{DataSet, Flight, Span};
use crate::physics::Model;
use crate::tape::Threads;
use crate::workflow::{Contest, Judged};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

/// Samples that are judged at most: more do not change what a person sees, and an answer has to come while they look.
pub(super) const MOST_SAMPLES: usize = 100_000;

/// Comparisons that are kept whole.
const KEPT: usize = 4;

/// Rows that a sample must have before it: the yardstick of finite differences needs one.
const HISTORY: usize = 2;

/// Which part of the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PartWanted {
    /// What no fit and no search sees.
    #[default]
    Judged,
    /// All flights, those used for fitting included.
    All,
}

/// A state, a part, and whether flights are judged by halves for the sake of another state.
type Key = (u64, PartWanted, bool);

/// How well a state does, by channel.
#[derive(Clone, Copy)]
pub(super) struct Errors {
    /// Root mean square error.
    pub rmse: ChannelValues,
    /// Its 95 % interval.
    pub ci95: Intervals,
    /// Share of the variance predicted.
    pub r2: ChannelValues,
}

/// The errors of a state, what they were judged on, and whether that is by halves, each with numbers from the other.
type Known = (Errors, String, bool);

/// The errors of states on the way to the present one.
pub(super) struct OfPath {
    pub of: Vec<Errors>,
    pub basis: String,
    pub halves: bool,
}

/// Judges states, and remembers.
pub(super) struct Judge {
    strides: BTreeMap<PartWanted, usize>,
    all: Split,
    whole: Recent<Key, Judged>,
    errors: Mutex<BTreeMap<(u64, bool), Known>>,
}

/// What the prediction of a state is called in a comparison.
const NAME: &str = "model";

impl Judge {
    pub fn new(set: &DataSet, split: &Split) -> Self {
        let span = |(flight, log): (usize, &Flight)| Span { flight, start: 0, end: log.len() };
        let test: Vec<Span> = set.flights.iter().enumerate().map(span).collect();
        let all = Split { training: split.training.clone(), validation: Vec::new(), test, tested: Part::All };
        let stride = |spans: &[Span]| windows(spans, HISTORY, 1).len().div_ceil(MOST_SAMPLES).max(1);
        let strides = [(PartWanted::Judged, stride(&split.test)), (PartWanted::All, stride(&all.test))].into();
        Self { strides, all, whole: Recent::new(KEPT), errors: Mutex::default() }
    }

    /// A state on a part of the flights, beside the yardstick of finite differences.
    pub fn state(&self, set: &DataSet, split: &Split, state: &State, part: PartWanted) -> Result<Arc<Judged>> {
        self.beside(set, split, state, part, None)
    }

    /// The same on what `beside`, too, can be judged on.
    fn beside(&self, set: &DataSet, split: &Split, state: &State, part: PartWanted, beside: Option<&State>) -> Result<Arc<Judged>> {
        let key = (state.id, part, beside.is_some());
        self.whole.get(key, || {
            let models: Vec<(String, Model)> =
                std::iter::once(state).chain(beside).map(|state| (NAME.to_owned(), state.model.clone())).collect();
            self.contest(set, split, &models, part)
        })
    }

    /// The samples of a part.
    pub fn spans<'a>(&'a self, split: &'a Split, part: PartWanted) -> &'a [Span] {
        if part == PartWanted::All { &self.all.test } else { &split.test }
    }

    /// Models on a part of the flights.
    pub fn contest(&self, set: &DataSet, split: &Split, models: &[(String, Model)], part: PartWanted) -> Result<Judged> {
        self.task(models, part).run(set, if part == PartWanted::All { &self.all } else { split })
    }

    /// The same on the judged part, with the stretches that a page draws at every sample.
    pub fn traced(&self, set: &DataSet, split: &Split, models: &[(String, Model)]) -> Result<Judged> {
        let task = self.task(models, PartWanted::Judged);
        let mut judged = task.run(set, split)?;
        task.trace(set, split, &mut judged)?;
        Ok(judged)
    }

    fn task<'m>(&self, models: &'m [(String, Model)], part: PartWanted) -> Contest<'m> {
        Contest {
            models,
            networks: &[],
            ridge: None,
            history: HISTORY,
            stride: self.strides[&part],
            uncertainty: false,
            seed: 0,
            threads: Threads(0),
        }
    }

    /// The errors of states that follow each other, on the same samples.
    pub fn path(&self, set: &DataSet, split: &Split, path: &[Arc<State>]) -> Result<OfPath> {
        // Where one state knows each flight, all are judged on the halves that it leaves.
        let own = |state: &&Arc<State>| {
            let effects = state.model.effects.iter().filter(|effect| effect.enabled);
            effects.flat_map(|effect| &effect.coefficients).any(|coefficient| coefficient.by_flight.is_some())
        };
        let knows = path.iter().find(own);
        let mut result = OfPath { of: Vec::new(), basis: String::new(), halves: false };
        for state in path {
            let beside = knows.filter(|knows| knows.id != state.id).map(AsRef::as_ref);
            let key = (state.id, beside.is_some());
            let known = held(&self.errors).get(&key).cloned();
            let (errors, basis, halves) = match known {
                Some(known) => known,
                None => {
                    let judged = self.beside(set, split, state, PartWanted::Judged, beside)?;
                    let model = &judged.comparison.models[1];
                    let errors = Errors { rmse: model.rmse, ci95: model.rmse_ci95, r2: model.r2 };
                    let found = (errors, judged.comparison.basis(), judged.comparison.own_from_other_half);
                    held(&self.errors).insert(key, found.clone());
                    found
                }
            };
            result.of.push(errors);
            (result.basis, result.halves) = (basis, halves);
        }
        Ok(result)
    }
}

/// The predictions of the state in a comparison; the first row is the yardstick.
pub(super) fn row(judged: &Judged) -> &Row {
    &judged.rows[1]
}
