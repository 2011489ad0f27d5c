//! A network trained on what a state leaves over: begun in a run folder, watched, stopped, gone on with; and who explains what once it is there. One
//! at a time. The run itself is `workflow::train`'s, and what it leaves on disk is what `train` on the command line leaves.

use super::found::Found;
use super::history::State;
use super::job::{Progress, unbroken};
use super::recent::Recent;
use super::runs::Version;
use super::{Studio, fault, held};
use crate::critique::shares::Shares;
use crate::critique::{ChannelValues, Intervals};
use crate::error::{Error, Result};
use crate::flight::split::{SEGMENT_S, Split};
use crate::hybrid::linear::LinearConfig;
use crate::nn::{Architecture, PhyTureConfig};
use crate::tape::Threads;
use crate::train::{Begun, Checkpointed, EpochLoss, Event, RunFolder, TrainConfig, Training};
use crate::workflow::{Epoch, TrainedNetwork, train, training_digest};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

/// What a new run's folder is called.
const FOLDER: &str = "run";

/// What becomes of a run that lies in the folder already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Earlier {
    /// It is told, and nothing is done.
    #[default]
    Refuse,
    /// It goes, and a new one is begun.
    Replace,
    /// It is gone on with, as it was set.
    GoOn,
}

/// A training run as it is wanted.
#[derive(Clone, Debug, Deserialize)]
pub struct TrainingWanted {
    /// Its folder.
    pub folder: String,
    /// Samples of history.
    pub history: usize,
    /// Width of the network.
    pub width: usize,
    /// Passes over the training windows.
    pub epochs: usize,
    /// Whether a linear history stands between physics and network.
    #[serde(default)]
    pub linear: bool,
    /// What becomes of a run that lies there.
    #[serde(default)]
    pub earlier: Earlier,
}

/// What a run may be begun with, and which ones may be gone on with.
#[derive(Clone, Debug, Serialize)]
pub struct TrainingPlan {
    /// A folder that is free.
    pub folder: String,
    /// Samples of history.
    pub history: usize,
    /// Width of the network.
    pub width: usize,
    /// Passes over the training windows.
    pub epochs: usize,
    /// Length of a step of the flights, s.
    pub step_s: f64,
    /// Runs that are not at their end.
    pub unfinished: Vec<UnfinishedText>,
}

/// A run that is not at its end.
#[derive(Clone, Debug, Serialize)]
pub struct UnfinishedText {
    /// Its folder.
    pub folder: String,
    /// Name of the folder.
    pub name: String,
    /// What it trains, in words.
    pub says: String,
    /// Why it cannot be gone on with.
    pub why: Option<String>,
}

/// A training run as it stands.
#[derive(Clone, Debug, Serialize)]
pub struct TrainingText {
    /// How far it is.
    pub progress: Progress,
    /// What is trained, in words.
    pub says: String,
    /// Its folder.
    pub folder: String,
    /// Name of the network among the runs.
    pub name: String,
    /// The state that it is trained on.
    pub state: Option<u64>,
    /// What was done to come to that state.
    pub state_did: Option<String>,
    /// Trainable numbers; none before everything is read.
    pub parameters: Option<usize>,
    /// Windows that train, and that validate.
    pub windows: [usize; 2],
    /// Steps done and in all.
    pub steps: [u64; 2],
    /// Epochs that have ended, and all.
    pub epochs: [usize; 2],
    /// Mean loss over the epoch under way.
    pub loss: Option<f64>,
    /// Losses of the epochs that have ended.
    pub curve: Vec<EpochLoss>,
    /// Time since it was begun or gone on with, s; until it ended, if it has.
    pub seconds: f64,
    /// Time left by the pace so far, s.
    pub left_s: Option<f64>,
    /// Why it failed.
    pub error: Option<String>,
    /// The network, once it is written.
    pub trained: Option<TrainedNetwork>,
    /// What its gate lets through, in words.
    pub gate: Option<String>,
}

/// Who explains what of the accelerations on flights that no fit sees.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedText {
    /// The network, in words.
    pub says: String,
    /// Root mean square error by channel of its model alone, and with it.
    pub rmse: [ChannelValues; 2],
    /// Their 95 % intervals.
    pub ci95: [Intervals; 2],
    /// Shares of the variance of the measurements.
    pub shares: Shares,
    /// What was judged, in words.
    pub basis: String,
}

/// Who explains what, by network, rows of history and stride.
pub(super) type Explained = Recent<(Version, usize, usize), ExplainedText>;

/// What is kept of it.
pub(super) const KEPT: usize = 8;

/// A run under way or at its end.
pub(super) struct TrainingJob {
    watched: Arc<Watched>,
    state: Arc<State>,
    folder: PathBuf,
    says: String,
    epochs: usize,
    thread: Option<JoinHandle<()>>,
}

/// What is seen of a run while it goes on.
struct Watched {
    stop: AtomicBool,
    begun: Instant,
    seen: Mutex<Seen>,
}

#[derive(Default)]
struct Seen {
    /// When everything was read, and what the run is.
    began: Option<(Instant, Begun)>,
    step: u64,
    epoch: Epoch,
    curve: Vec<EpochLoss>,
    /// After how long, s, and with what.
    ended: Option<(f64, Result<TrainedNetwork>)>,
}

impl Studio {
    /// What a run may be begun with: the sizes that end in minutes, and a folder beside the model.
    pub fn training_plan(&self) -> TrainingPlan {
        let (folder, _) = self.folder();
        let numbered = |number: usize| folder.join(if number == 1 { FOLDER.into() } else { format!("{FOLDER}-{number}") });
        let free = (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| folder.join(FOLDER));
        let sizes = TrainConfig::in_minutes();
        let Architecture::PhyTure(PhyTureConfig { d_model: width, .. }) = sizes.network else {
            unreachable!("what ends in minutes is a Phy-Ture")
        };
        TrainingPlan {
            folder: free.display().to_string(),
            history: sizes.network.history(),
            width,
            epochs: sizes.epochs,
            step_s: self.step_s(),
            unfinished: self.unfinished(&folder),
        }
    }

    /// Trains a network on what the present state leaves over, or goes on with a run on the state that it was begun on.
    ///
    /// # Errors
    /// [`Error::Config`] while another runs, or for settings that cannot be; [`Error::Exists`] where a run lies in the folder; [`Error::Busy`] where
    /// another program trains in it; [`Error::File`] for a checkpoint that cannot be gone on with.
    pub fn train(self: &Arc<Self>, wanted: &TrainingWanted) -> Result<TrainingText> {
        {
            let mut job = held(&self.training);
            if job.as_ref().is_some_and(|job| held(&job.watched.seen).ended.is_none()) {
                return Err(fault("train", "a training that runs", "none; stop it first"));
            }
            if wanted.folder.trim().is_empty() {
                return Err(fault("folder", "nothing", "the folder of the run"));
            }
            let path = PathBuf::from(wanted.folder.trim());
            let (config, state, curve) = match wanted.earlier {
                Earlier::GoOn => self.begun_on(&path)?,
                Earlier::Refuse | Earlier::Replace => (wanted.config()?, self.now(), Vec::new()),
            };
            check_place(&path)?;
            let folder = RunFolder::create(&path)?;
            if wanted.earlier == Earlier::Refuse && folder.is_begun() {
                return Err(Error::Exists { path, what: "a training run".into() });
            }
            let seen = Mutex::new(Seen { curve, ..Seen::default() });
            let watched = Arc::new(Watched { stop: AtomicBool::new(false), begun: Instant::now(), seen });
            let (studio, own) = (Arc::clone(self), (Arc::clone(&watched), Arc::clone(&state), config.clone()));
            let resume = wanted.earlier == Earlier::GoOn;
            let run = move || {
                let (watched, state, config) = own;
                let trained = unbroken("training", || studio.trained(&state, &config, &folder, resume, &watched));
                drop(folder);
                held(&watched.seen).ended = Some((watched.begun.elapsed().as_secs_f64(), trained));
            };
            let started = std::thread::Builder::new().name("training".into()).spawn(run);
            let thread = started.map_err(|error| Error::Undetermined(format!("the training cannot be started: {error}")))?;
            let (says, epochs) = (of_config(&config, self.step_s()), config.epochs);
            *job = Some(TrainingJob { watched, state, folder: path, says, epochs, thread: Some(thread) });
        }
        Ok(self.training())
    }

    /// Asks the training to stop; it saves where it is.
    pub fn stop_training(&self) -> TrainingText {
        if let Some(job) = held(&self.training).as_ref() {
            job.watched.stop.store(true, Ordering::Relaxed);
        }
        self.training()
    }

    /// Ends what would be lost with the program: the training is stopped, and its save is waited for. Where one was stopped, its folder.
    pub fn finish(&self) -> Option<PathBuf> {
        self.stop_training();
        let (thread, folder) = {
            let mut job = held(&self.training);
            let job = job.as_mut()?;
            let runs = held(&job.watched.seen).ended.is_none();
            (job.thread.take().filter(|_| runs)?, job.folder.clone())
        };
        thread.join().ok().map(|()| folder)
    }

    /// The training as it stands.
    pub fn training(&self) -> TrainingText {
        held(&self.training).as_ref().map_or_else(TrainingText::idle, TrainingJob::text)
    }

    /// How far the training is.
    pub(super) fn training_progress(&self) -> Progress {
        held(&self.training).as_ref().map_or(Progress::Idle, |job| job.progress(&held(&job.watched.seen)))
    }

    /// Who explains what of the accelerations, by a network of the folder: its physics, its linear history, the network, and neither.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is no network of the folder.
    pub fn explained(&self, name: &str) -> Result<Found<ExplainedText>> {
        let (version, content) = self.network(name)?;
        let (history, stride) = self.windows_of(std::slice::from_ref(&content));
        let made = self.explained.get((version, history, stride), || {
            let missing = || Error::Undetermined("nothing was judged".into());
            let own: Vec<_> =
                content.networks.iter().map(|(_, hybrid)| ("physics".into(), hybrid.description().model.clone())).collect();
            let comparison = self.contest(&own, &content.networks, history, stride)?;
            let [_, physics, hybrid] = comparison.models.as_slice() else { return Err(missing()) };
            Ok(ExplainedText {
                says: content.says(),
                rmse: [physics.rmse, hybrid.rmse],
                ci95: [physics.rmse_ci95, hybrid.rmse_ci95],
                shares: comparison.shares.first().cloned().ok_or_else(missing)?,
                basis: comparison.basis(),
            })
        });
        Ok(made.map_or_else(|error| Found::Missing { why: error.to_string() }, |made| Found::Known(ExplainedText::clone(&made))))
    }

    /// The division of a run: what no fit sees tests, and a part of the rest validates.
    fn training_split(&self) -> Split {
        self.split.with_validation(&self.set.flights, SEGMENT_S, self.seed)
    }

    fn trained(
        &self,
        state: &State,
        config: &TrainConfig,
        folder: &RunFolder,
        resume: bool,
        watched: &Watched,
    ) -> Result<TrainedNetwork> {
        let split = self.training_split();
        let training = Training {
            flights: &self.set.flights,
            split: &split,
            model: &state.model,
            config,
            data: training_digest(&self.set, &state.model, &split)?,
            folder,
            with_losses: true,
            threads: Threads(0),
        };
        let run = train(&training, resume, &mut |event| {
            held(&watched.seen).take(&event);
            Ok(!watched.stop.load(Ordering::Relaxed))
        })?;
        Ok(run.network)
    }

    /// How a run was set, the state of this studio that it was begun on, and its losses so far.
    fn begun_on(&self, folder: &Path) -> Result<(TrainConfig, Arc<State>, Vec<EpochLoss>)> {
        let nothing = || Error::File { path: folder.into(), message: "has no checkpoint to go on from".into() };
        let found = Checkpointed::read(folder)?.ok_or_else(nothing)?;
        if found.is_finished {
            return Err(Error::File { path: folder.into(), message: "holds a run that is at its end".into() });
        }
        let state = self.state_of(found.data)?.ok_or_else(|| Error::File {
            path: folder.into(),
            message:
                "was begun on a model, flights or a division that are none of the steps here; open the model that it was begun on"
                    .into(),
        })?;
        Ok((found.config, state, found.curve))
    }

    /// The state whose training data have a digest, the present one first.
    fn state_of(&self, data: u64) -> Result<Option<Arc<State>>> {
        let split = self.training_split();
        let (states, ..) = held(&self.history).unsaved();
        for state in std::iter::once(self.now()).chain(states) {
            if training_digest(&self.set, &state.model, &split)? == data {
                return Ok(Some(state));
            }
        }
        Ok(None)
    }

    /// Runs beside the model that are not at their end, but for the one that goes on.
    fn unfinished(&self, folder: &Path) -> Vec<UnfinishedText> {
        let own = held(&self.training).as_ref().filter(|job| held(&job.watched.seen).ended.is_none()).map(|job| job.folder.clone());
        let Ok(listed) = std::fs::read_dir(folder) else { return Vec::new() };
        let mut folders: Vec<PathBuf> = listed.flatten().map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
        folders.sort();
        let text = |path: PathBuf| {
            let name = path.file_name()?.to_string_lossy().into_owned();
            let (says, why) = match Checkpointed::read(&path) {
                Ok(Some(found)) if !found.is_finished => {
                    let says = format!(
                        "{}, {} of {} epochs done",
                        of_config(&found.config, self.step_s()),
                        found.curve.len(),
                        found.config.epochs
                    );
                    (says, self.begun_on(&path).err().map(|error| error.to_string()))
                }
                Ok(_) => return None,
                Err(error) => (String::new(), Some(error.to_string())),
            };
            Some(UnfinishedText { folder: path.display().to_string(), name, says, why })
        };
        folders.into_iter().filter(|path| Some(path) != own.as_ref()).filter_map(text).collect()
    }

    fn step_s(&self) -> f64 {
        self.set.flights.first().map_or(0.01, |flight| flight.step_s)
    }
}

/// A run has a folder of its own: a new one in a folder that is there, an empty one, or that of an earlier run.
fn check_place(path: &Path) -> Result<()> {
    let refuse = |found: String, expected: &str| Err(fault("folder", found, expected));
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !parent.is_dir() {
        return refuse(
            format!("`{}`, in a folder that is not there", path.display()),
            "a folder that is there, with the name of the run behind it",
        );
    }
    let is_run = Checkpointed::read(path).map_or(true, |found| found.is_some()) || path.join("network.safetensors").is_file();
    let mut listed = std::fs::read_dir(path).into_iter().flatten().flatten();
    if !is_run && listed.any(|entry| !entry.file_name().to_string_lossy().starts_with('.')) {
        return refuse(
            format!("`{}`, which holds other files", path.display()),
            "a folder for the run alone: a new one, or that of an earlier run",
        );
    }
    Ok(())
}

/// What a configuration trains, in words.
fn of_config(config: &TrainConfig, step_s: f64) -> String {
    let history_s = config.network.history() as f64 * step_s;
    let linear = if config.linear.is_some() { " after a linear history" } else { "" };
    format!("{}{linear}, {history_s:.2} s of history, {} epochs", config.network.name(), config.epochs)
}

impl TrainingWanted {
    fn config(&self) -> Result<TrainConfig> {
        let Self { history, width, epochs, linear, .. } = *self;
        let network = PhyTureConfig { history, d_model: width, ..PhyTureConfig::default() };
        let config = TrainConfig {
            network: network.into(),
            epochs,
            linear: linear.then(LinearConfig::default),
            keep_best: true,
            ..TrainConfig::in_minutes()
        };
        config.check()?;
        Ok(config)
    }
}

impl Seen {
    fn take(&mut self, event: &Event<'_>) {
        match event {
            Event::Begins(begun) => (self.began, self.step) = (Some((Instant::now(), *begun)), begun.done),
            Event::Step(report) => {
                self.step = report.step.step;
                self.epoch.take(report);
                self.curve.extend(report.epoch_ended);
            }
        }
    }

    /// Time left by the pace since everything was read, s.
    fn left_s(&self) -> Option<f64> {
        let (at, begun) = self.began?;
        let done = self.step.saturating_sub(begun.done);
        (done > 0).then(|| at.elapsed().as_secs_f64() * begun.steps.saturating_sub(self.step) as f64 / done as f64)
    }
}

impl TrainingJob {
    fn progress(&self, seen: &Seen) -> Progress {
        match &seen.ended {
            None if self.watched.stop.load(Ordering::Relaxed) => Progress::Stopping,
            None => Progress::Running,
            Some((_, Ok(_))) => Progress::Done,
            Some((_, Err(Error::Interrupted { .. }))) => Progress::Stopped,
            Some((_, Err(_))) => Progress::Failed,
        }
    }

    fn text(&self) -> TrainingText {
        let seen = held(&self.watched.seen);
        let progress = self.progress(&seen);
        let begun = seen.began.map(|(_, begun)| begun);
        let (error, trained) = match &seen.ended {
            Some((_, Ok(trained))) => (None, Some(trained.clone())),
            Some((_, Err(error))) if progress == Progress::Failed => (Some(error.to_string()), None),
            _ => (None, None),
        };
        let curve = trained.as_ref().map_or_else(|| seen.curve.clone(), |trained| trained.curve.clone());
        TrainingText {
            progress,
            says: self.says.clone(),
            folder: self.folder.display().to_string(),
            name: self.folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            state: Some(self.state.id),
            state_did: Some(self.state.did.clone()),
            parameters: begun.map(|begun| begun.parameters),
            windows: begun.map_or([0; 2], |begun| [begun.windows, begun.validation_windows]),
            steps: [seen.step, begun.map_or(0, |begun| begun.steps)],
            epochs: [curve.len(), self.epochs],
            loss: seen.epoch.loss(),
            curve,
            seconds: seen.ended.as_ref().map_or_else(|| self.watched.begun.elapsed().as_secs_f64(), |ended| ended.0),
            left_s: seen.ended.is_none().then(|| seen.left_s()).flatten(),
            error,
            gate: trained.as_ref().and_then(TrainedNetwork::gate_in_words),
            trained,
        }
    }
}

impl TrainingText {
    fn idle() -> Self {
        Self {
            progress: Progress::Idle,
            says: String::new(),
            folder: String::new(),
            name: String::new(),
            state: None,
            state_did: None,
            parameters: None,
            windows: [0; 2],
            steps: [0; 2],
            epochs: [0; 2],
            loss: None,
            curve: Vec::new(),
            seconds: 0.0,
            left_s: None,
            error: None,
            trained: None,
            gate: None,
        }
    }
}
