//! The studio: one data set and one model that a person looks at, changes and saves, with every state on the way kept.
//!
//! A [`Studio`] is asked in plain methods and answers in plain serialisable types: predictions beside measurements, errors by channel on flights that
//! no fit has seen, where they lie, what they depend on, what a search finds; and it changes its model: effects are added, switched, moved and
//! taken back. Everything that is computed is computed elsewhere (`workflow`, `critique`, `physics`). [`server`] shows it to a browser on this
//! machine; nothing else here knows of one.

mod curves;
mod describe;
mod draft;
mod edits;
mod found;
mod history;
mod job;
mod judge;
mod recent;
mod residual;
mod rollout;
mod runs;
mod save;
pub mod server;
mod surfaces;
mod trace;
mod training;
mod views;

pub use curves::{CurvePanel, CurveText};
pub use describe::{ChannelText, EffectText, FlightText, ModelText, NumberText, Overview};
pub use draft::LeftText;
pub use edits::{Edit, FormulaCheck, Owner};
pub use found::Found;
pub use history::{Pulse, StepText, Steps};
pub use job::{JobText, Progress};
pub use judge::PartWanted;
pub use residual::{InTimeText, RegionText, RegionsText, Spot};
pub use rollout::{PathText, RolloutText, RolloutWanted, RolloutsText};
pub use runs::{Kind, RunErrors, RunText, RunsText};
pub use save::Saved;
pub use surfaces::{SurfaceText, SurfaceWanted};
pub use trace::{Move, Trace, TraceWanted};
pub use training::{Earlier, ExplainedText, TrainingPlan, TrainingText, TrainingWanted, UnfinishedText};
pub use views::{By, DependenceText, ErrorMap, MapCell, MapRow, Place, PlaceWanted, VariableText};

use crate::critique::check::{CheckReport, check};
use crate::error::{Error, Result};
use crate::flight::DataSet;
use crate::flight::split::Split;
use crate::physics::{Model, calibrate};
use history::{History, State};
use job::Job;
use judge::Judge;
use recent::Recent;
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What a studio opens with.
pub struct Opening {
    /// Flights.
    pub set: DataSet,
    /// What is fitted and searched, and what only judges.
    pub split: Split,
    /// The model. Without any number it is calibrated first.
    pub model: Model,
    /// Where the flights were read from.
    pub data: PathBuf,
    /// The model's file, if it has one.
    pub file: Option<PathBuf>,
    /// Seed of searches.
    pub seed: u64,
}

/// Flights, a model, and its history.
pub struct Studio {
    set: DataSet,
    split: Split,
    data: PathBuf,
    seed: u64,
    check: CheckReport,
    judge: Judge,
    history: Mutex<History>,
    /// Held by whoever changes the model, so that changes come one after the other.
    changing: Mutex<()>,
    job: Mutex<Option<Job>>,
    training: Mutex<Option<training::TrainingJob>>,
    explained: training::Explained,
    predictions: trace::Predictions,
    dependences: views::Dependences,
    residuals: residual::Residuals,
    all_starts: rollout::AllStarts,
    runs: runs::Runs,
    curves: curves::Known,
    file: Mutex<save::ModelFile>,
    /// Taken before the locks of history and search, where both are needed.
    drafts: Mutex<draft::Drafts>,
    /// Grows with every change that a page has to show.
    revision: AtomicU64,
}

/// The content of a lock. A panic while it was held left whole states behind: they are replaced as wholes.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Studio {
    /// Opens a studio: checks the log, and calibrates a model that has no numbers yet.
    ///
    /// # Errors
    /// As [`calibrate`]; [`Error::Undetermined`] where nothing is kept to judge on.
    pub fn open(opening: Opening) -> Result<Self> {
        let Opening { set, split, model, data, file, seed } = opening;
        if split.test.is_empty() {
            return Err(Error::Undetermined(
                "nothing is kept from the fit to judge the model on; give more flights, or lock some with --lock".into(),
            ));
        }
        model.check_flights(&set.flights)?;
        let check = check(&set, Some(&model));
        let is_blank = model.effects.iter().flat_map(|effect| &effect.coefficients).all(|coefficient| coefficient.value == 0.0);
        let first = match is_blank {
            true => {
                let (model, found) = calibrate(&model, &set.flights, &crate::critique::diagnose::searched(&split))?;
                State { calibration: Some(found), ..State::first("baseline, calibrated", model) }
            }
            false => State::first("model as it was opened", model),
        };
        let judge = Judge::new(&set, &split);
        let drafts = Mutex::new(draft::Drafts::beside(file.as_deref(), &data, &set.source.sha256));
        let file = Mutex::new(save::ModelFile::of(file));
        Ok(Self {
            set,
            split,
            data,
            seed,
            check,
            judge,
            history: Mutex::new(History::new(first)),
            changing: Mutex::default(),
            job: Mutex::default(),
            training: Mutex::default(),
            explained: Recent::new(training::KEPT),
            predictions: Recent::new(trace::PREDICTIONS),
            dependences: Recent::new(views::KEPT),
            residuals: residual::Residuals::default(),
            all_starts: Recent::new(rollout::KEPT),
            runs: runs::Runs::default(),
            curves: Recent::new(curves::KEPT),
            file,
            drafts,
            revision: AtomicU64::default(),
        })
    }

    /// The state that is shown now.
    fn now(&self) -> Arc<State> {
        held(&self.history).now()
    }

    /// A state by its identifier; the present one without.
    ///
    /// # Errors
    /// [`Error::Config`] where no such state is left.
    fn state(&self, id: Option<u64>) -> Result<Arc<State>> {
        let Some(id) = id else { return Ok(self.now()) };
        held(&self.history)
            .state(id)
            .ok_or_else(|| fault("state", id.to_string(), "a state of the history; it was replaced by a later step"))
    }
}

/// A request that cannot be fulfilled.
fn fault(field: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
    Error::Config { place: "studio".into(), field: field.into(), found: found.into(), expected: expected.into() }
}
