//! A search for missing effects that runs beside everything else: begun, watched, stopped, heard. One at a time.

use super::history::State;
use super::{Studio, fault, held};
use crate::critique::diagnose::{Diagnosis, Options, Outcome, Watch};
use crate::error::{Error, Result};
use crate::physics::Model;
use crate::workflow::{SearchTask, convention_fault};
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Progress {
    /// Nothing was begun.
    Idle,
    /// It runs.
    Running,
    /// It was asked to stop, and does so at its next step.
    Stopping,
    /// It was stopped.
    Stopped,
    /// It could not be done.
    Failed,
    /// It is done.
    Done,
}

/// A search as it stands.
#[derive(Clone, Debug, Serialize)]
pub struct JobText {
    /// How far it is.
    pub progress: Progress,
    /// What it is at.
    pub stage: String,
    /// Time since it was begun, s; until it ended, if it has.
    pub seconds: f64,
    /// Why it failed.
    pub error: Option<String>,
    /// What it found.
    pub diagnosis: Option<Diagnosis>,
    /// The state that it searched.
    pub state: Option<u64>,
    /// What was done to come to that state.
    pub state_did: Option<String>,
}

/// A search that runs or has run.
pub(super) struct Job {
    watch: Watch,
    begun: Instant,
    state: Arc<State>,
    /// After how long, s, and with what.
    ended: Option<(f64, Result<Heard>)>,
}

/// A search that ended well.
pub(super) struct Known {
    pub state: Arc<State>,
    pub diagnosis: Arc<Diagnosis>,
    pub model: Arc<Model>,
    pub seconds: f64,
    pub ended: Instant,
}

/// What a search found, and the model with it.
type Heard = (Arc<Diagnosis>, Arc<Model>);

/// Work on a thread of its own: a fault in it is told like any other failure, and the studio goes on.
pub(super) fn unbroken<T>(what: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let broken = || Err(Error::Undetermined(format!("the {what} broke off; its message is on the terminal of the studio")));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| broken())
}

impl Studio {
    /// Begins a search for what the present state lacks.
    ///
    /// # Errors
    /// [`Error::Config`] while another runs; [`Error::Undetermined`] where no thread can be had.
    pub fn diagnose(self: &Arc<Self>) -> Result<JobText> {
        {
            let mut job = held(&self.job);
            if job.as_ref().is_some_and(|job| job.ended.is_none()) {
                return Err(fault("diagnose", "a search that runs", "none; stop it first"));
            }
            let watch = Watch::default();
            let state = self.now();
            let (studio, own) = (Arc::clone(self), (watch.clone(), Arc::clone(&state)));
            let begun = Instant::now();
            let run = move || {
                let outcome = unbroken("search", || studio.search(&own.1.model, own.0));
                let outcome = outcome.map(|outcome| (Arc::new(outcome.diagnosis), Arc::new(outcome.model)));
                if let Some(job) = held(&studio.job).as_mut() {
                    job.ended = Some((begun.elapsed().as_secs_f64(), outcome));
                }
                studio.keep();
            };
            let started = std::thread::Builder::new().name("search".into()).spawn(run);
            started.map_err(|error| Error::Undetermined(format!("the search cannot be started: {error}")))?;
            *job = Some(Job { watch, begun, state, ended: None });
        }
        Ok(self.job())
    }

    fn search(&self, model: &Model, watch: Watch) -> Result<Outcome> {
        let data_sha256 = self.set.source.sha256.clone();
        if self.check.fault {
            return Ok(Outcome { diagnosis: convention_fault(&self.check, data_sha256), model: model.clone() });
        }
        let options = Options { seed: self.seed, watch, ..Options::default() };
        SearchTask { set: &self.set, split: &self.split, data_sha256, options, explainable: None }.diagnose(model)
    }

    /// Asks the search to stop.
    pub fn stop(&self) -> JobText {
        if let Some(job) = held(&self.job).as_ref() {
            job.watch.stop();
        }
        self.job()
    }

    /// The search as it stands.
    pub fn job(&self) -> JobText {
        let job = held(&self.job);
        let nothing = JobText {
            progress: Progress::Idle,
            stage: String::new(),
            seconds: 0.0,
            error: None,
            diagnosis: None,
            state: None,
            state_did: None,
        };
        let Some(job) = job.as_ref() else { return nothing };
        let (error, diagnosis) = match &job.ended {
            None | Some((_, Err(Error::Interrupted { .. }))) => (None, None),
            Some((_, Ok((diagnosis, _)))) => (None, Some(Diagnosis::clone(diagnosis))),
            Some((_, Err(error))) => (Some(error.to_string()), None),
        };
        JobText {
            progress: job.progress(),
            stage: job.watch.stage(),
            seconds: job.ended.as_ref().map_or_else(|| job.begun.elapsed().as_secs_f64(), |ended| ended.0),
            error,
            diagnosis,
            state: Some(job.state.id),
            state_did: Some(job.state.did.clone()),
        }
    }

    /// What the last search found, and the model with it.
    pub(super) fn outcome(&self) -> Option<Heard> {
        held(&self.job).as_ref().and_then(|job| Some(job.ended.as_ref()?.1.as_ref().ok()?.clone()))
    }

    /// How far the search is.
    pub(super) fn progress(&self) -> Progress {
        held(&self.job).as_ref().map_or(Progress::Idle, Job::progress)
    }

    /// The last search, if it ended well.
    pub(super) fn heard(&self) -> Option<Known> {
        let job = held(&self.job);
        let job = job.as_ref()?;
        let (seconds, Ok((diagnosis, model))) = job.ended.as_ref()? else { return None };
        let ended = job.begun + Duration::try_from_secs_f64(*seconds).unwrap_or_default();
        let (state, diagnosis, model) = (Arc::clone(&job.state), Arc::clone(diagnosis), Arc::clone(model));
        Some(Known { state, diagnosis, model, seconds: *seconds, ended })
    }

    /// Takes what an earlier studio found for a search of this one, unless this one has searched itself.
    pub(super) fn hear(&self, state: Arc<State>, seconds: f64, diagnosis: Diagnosis, model: Model) {
        let mut job = held(&self.job);
        if job.is_none() {
            let ended = Some((seconds, Ok((Arc::new(diagnosis), Arc::new(model)))));
            let now = Instant::now();
            let begun = Duration::try_from_secs_f64(seconds).ok().and_then(|took| now.checked_sub(took)).unwrap_or(now);
            *job = Some(Job { watch: Watch::default(), begun, state, ended });
        }
    }
}

impl Job {
    fn progress(&self) -> Progress {
        match &self.ended {
            None if self.watch.is_stopped() => Progress::Stopping,
            None => Progress::Running,
            Some((_, Ok(_))) => Progress::Done,
            Some((_, Err(Error::Interrupted { .. }))) => Progress::Stopped,
            Some((_, Err(_))) => Progress::Failed,
        }
    }
}
