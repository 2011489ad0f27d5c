//! Models and networks that lie in one folder, beside the present state: what they are, when they were written, and their errors on flights that no fit
//! of this studio sees. Nothing is changed; a file that does not read, or does not go with these flights, is a row that says why.

use super::found::Found;
use super::judge::MOST_SAMPLES;
use super::recent::Recent;
use super::{Studio, fault, held};
use crate::critique::{ChannelValues, Comparison, Intervals};
use crate::error::{Error, Result};
use crate::flight::windows::windows;
use crate::hybrid::Hybrid;
use crate::physics::Model;
use crate::tape::Threads;
use crate::workflow::{Contest, read_network, rows_needed};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Windows that are judged where there is a network: some seconds of its work at most.
const MOST_WINDOWS: usize = 1000;

/// Files that are listed at most, the newest of them.
const MOST_FILES: usize = 200;

/// Bytes that a model file may have; the largest known have some hundred thousand.
const LARGEST_MODEL: u64 = 8 << 20;

/// A network's file in the folder of a run.
const NETWORK: &str = "network.safetensors";

/// What describes flights, and is no model.
const DESCRIPTION: &str = "dataset.toml";

/// What is in a folder.
#[derive(Clone, Debug, Serialize)]
pub struct RunsText {
    /// The folder.
    pub folder: String,
    /// Its models and networks, the newest first.
    pub rows: Vec<RunText>,
    /// Files that are left out, as there are so many.
    pub left_out: usize,
    /// Why the folder cannot be looked into.
    pub why: Option<String>,
}

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A physical model.
    Model,
    /// A model with a network that learned its residual.
    Network,
}

/// A model or network.
#[derive(Clone, Debug, Serialize)]
pub struct RunText {
    /// Its name in the folder.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// When it was written, s since 1970, UTC.
    pub written_s: u64,
    /// Whether it is the file of this studio's model.
    pub open: bool,
    /// What is in it, in words.
    pub says: String,
    /// Why it does not read.
    pub error: Option<String>,
}

/// Errors of a model or network.
#[derive(Clone, Debug, Serialize)]
pub struct RunErrors {
    /// Root mean square error by channel.
    pub rmse: ChannelValues,
    /// Their 95 % intervals.
    pub ci95: Intervals,
    /// What was judged, in words.
    pub basis: String,
}

/// A file that may hold a model or network.
#[derive(Clone, Debug)]
struct Entry {
    name: String,
    path: PathBuf,
    kind: Kind,
    written: SystemTime,
    bytes: u64,
}

/// A file as it was: another date or size is another file.
pub(super) type Version = (PathBuf, SystemTime, u64);

/// What a file holds, as a comparison takes it: one model, or one network.
#[derive(Default)]
pub(super) struct Content {
    pub models: Vec<(String, Model)>,
    pub networks: Vec<(String, Hybrid)>,
}

/// Who is judged: a file, or a state.
#[derive(PartialEq)]
enum Whose {
    File(Version),
    State(u64),
}

/// What was read and judged.
pub(super) struct Runs {
    contents: Recent<Version, Content>,
    /// By whose errors they are, rows of history and stride.
    errors: Recent<(Whose, usize, usize), RunErrors>,
}

impl Default for Runs {
    fn default() -> Self {
        Self { contents: Recent::new(MOST_FILES), errors: Recent::new(2 * MOST_FILES) }
    }
}

impl Studio {
    /// The models and networks in the folder of the model, or in that of the flights where the model has no file.
    pub fn runs(&self) -> RunsText {
        let (folder, own) = self.folder();
        let (listed, why) = match entries(&folder) {
            Ok(listed) => (listed, None),
            Err(error) => (Default::default(), Some(error.to_string())),
        };
        let (entries, left_out) = listed;
        let row = |entry: &Entry| {
            let content = self.content(entry);
            let (says, error) = match &content {
                Ok(content) => (content.says(), None),
                Err(error) => (String::new(), Some(error.to_string())),
            };
            let written_s = entry.written.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
            let open = own.as_deref().is_some_and(|own| own.file_name() == entry.path.file_name()) && entry.kind == Kind::Model;
            RunText { name: entry.name.clone(), kind: entry.kind, written_s, open, says, error }
        };
        RunsText { folder: folder.display().to_string(), rows: entries.iter().map(row).collect(), left_out, why }
    }

    /// The errors of one of them, by its name, or of the present state; all on the same samples, those that the longest history of all allows.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is not in the folder.
    pub fn run_errors(&self, name: Option<&str>) -> Result<Found<RunErrors>> {
        // A folder that cannot be read has nothing to be named, and the present state is judged without it.
        let (entries, _) = entries(&self.folder().0).unwrap_or_default();
        let contents: Vec<Arc<Content>> = entries.iter().filter_map(|entry| self.content(entry).ok()).collect();
        let (history, stride) = self.windows_of(&contents);
        let judged = |content: &Content| self.judged(content, history, stride);
        let Some(name) = name else {
            let now = self.now();
            let content = Content { models: vec![(now.did.clone(), now.model.clone())], ..Content::default() };
            let made = self.runs.errors.get((Whose::State(now.id), history, stride), || judged(&content));
            return told(made);
        };
        let entry = named(&entries, name)?;
        told(
            self.content(entry)
                .and_then(|content| self.runs.errors.get((Whose::File(entry.version()), history, stride), || judged(&content))),
        )
    }

    /// A network of the folder by its name, and which version of its file it is.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is no network of the folder; as [`read_network`].
    pub(super) fn network(&self, name: &str) -> Result<(Version, Arc<Content>)> {
        let (entries, _) = entries(&self.folder().0)?;
        let entry = named(&entries, name)?;
        let content = self.content(entry)?;
        if content.networks.is_empty() {
            return Err(fault("name", format!("`{name}`, a model"), "a network"));
        }
        Ok((entry.version(), content))
    }

    /// Rows that a window must have before it for all of these, and the samples between windows.
    pub(super) fn windows_of(&self, contents: &[Arc<Content>]) -> (usize, usize) {
        let needed = contents.iter().map(|content| rows_needed(&content.networks, None)).max().unwrap_or(1);
        let history = needed.max(rows_needed(&[], None));
        let most = if contents.iter().any(|content| !content.networks.is_empty()) { MOST_WINDOWS } else { MOST_SAMPLES };
        (history, windows(&self.split.test, history, 1).len().div_ceil(most).max(1))
    }

    /// The folder that is looked into, and the file of the model.
    pub(super) fn folder(&self) -> (PathBuf, Option<PathBuf>) {
        let file = held(&self.file).path().map(Path::to_path_buf);
        let beside = file
            .as_deref()
            .and_then(Path::parent)
            .map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        let of_data = || if self.data.is_file() { self.data.parent().unwrap_or(Path::new(".")) } else { self.data.as_path() };
        (beside.unwrap_or_else(of_data).to_path_buf(), file)
    }

    fn content(&self, entry: &Entry) -> Result<Arc<Content>> {
        self.runs.contents.get(entry.version(), || entry.read())
    }

    fn judged(&self, content: &Content, history: usize, stride: usize) -> Result<RunErrors> {
        let models = content.models.iter().map(|(_, model)| model);
        let of_networks = content.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        models.chain(of_networks).try_for_each(|model| model.check_flights(&self.set.flights))?;
        let comparison = self.contest(&content.models, &content.networks, history, stride)?;
        let nothing = || Error::Undetermined("nothing was judged".into());
        let last = comparison.models.last().ok_or_else(nothing)?;
        Ok(RunErrors { rmse: last.rmse, ci95: last.rmse_ci95, basis: comparison.basis() })
    }

    /// Models and networks on what no fit sees.
    pub(super) fn contest(
        &self,
        models: &[(String, Model)],
        networks: &[(String, Hybrid)],
        history: usize,
        stride: usize,
    ) -> Result<Comparison> {
        let contest =
            Contest { models, networks, ridge: None, history, stride, uncertainty: false, seed: self.seed, threads: Threads(0) };
        Ok(contest.run(&self.set, &self.split)?.comparison)
    }
}

impl Entry {
    fn version(&self) -> Version {
        (self.path.clone(), self.written, self.bytes)
    }

    fn read(&self) -> Result<Content> {
        match self.kind {
            Kind::Model if self.bytes > LARGEST_MODEL => {
                Err(Error::File { path: self.path.clone(), message: format!("{} bytes are no model file", self.bytes) })
            }
            Kind::Model => Ok(Content { models: vec![(self.name.clone(), Model::read(&self.path)?)], ..Content::default() }),
            Kind::Network => Ok(Content { networks: vec![(self.name.clone(), read_network(&self.path)?)], ..Content::default() }),
        }
    }
}

impl Content {
    /// What is in it, in words.
    pub fn says(&self) -> String {
        let of_model = |model: &Model| {
            let known = Model::paper("", 1.0, [1.0; 3], 1.0);
            let added = |name: &str| known.effect(name).is_none();
            let added: Vec<&str> = model
                .effects
                .iter()
                .filter(|effect| effect.enabled && added(&effect.name))
                .map(|effect| effect.name.as_str())
                .collect();
            if added.is_empty() { "the baseline".to_owned() } else { format!("the baseline with {}", added.join(", ")) }
        };
        let of_network = |hybrid: &Hybrid| {
            let description = hybrid.description();
            let (name, history) = (description.config.name(), description.config.history());
            format!("{name}, {:.2} s of history, on {}", history as f64 * description.step_s, of_model(&description.model))
        };
        let models = self.models.iter().map(|(_, model)| of_model(model));
        models.chain(self.networks.iter().map(|(_, hybrid)| of_network(hybrid))).collect()
    }
}

/// An entry by its name.
fn named<'a>(entries: &'a [Entry], name: &str) -> Result<&'a Entry> {
    let missing = || fault("name", format!("`{name}`"), "a model or network in the folder of the model; the list may have changed");
    entries.iter().find(|entry| entry.name == name).ok_or_else(missing)
}

/// Whatever is wrong with one file is told in its row.
fn told(made: Result<Arc<RunErrors>>) -> Result<Found<RunErrors>> {
    Ok(made.map_or_else(|error| Found::Missing { why: error.to_string() }, |made| Found::Known(RunErrors::clone(&made))))
}

/// What may be a model or network in a folder, the newest first, and how many are left out.
fn entries(folder: &Path) -> Result<(Vec<Entry>, usize)> {
    let listed = std::fs::read_dir(folder).map_err(Error::io(folder))?;
    let entry = |path: PathBuf| {
        let name = path.file_name()?.to_str()?.to_owned();
        let ends = |ending: &str| path.extension().is_some_and(|found| found == ending);
        let (path, kind) = match () {
            () if path.is_dir() => (path.join(NETWORK), Kind::Network),
            () if ends("toml") && name != DESCRIPTION => (path, Kind::Model),
            () if ends("safetensors") => (path, Kind::Network),
            () => return None,
        };
        // Pipes and devices would be waited for.
        let known = std::fs::metadata(&path).ok().filter(std::fs::Metadata::is_file)?;
        let written = known.modified().unwrap_or(UNIX_EPOCH);
        Some(Entry { name, path, kind, written, bytes: known.len() })
    };
    let mut found: Vec<Entry> = listed.filter_map(|listed| entry(listed.ok()?.path())).collect();
    found.sort_by(|left, right| right.written.cmp(&left.written).then_with(|| left.name.cmp(&right.name)));
    let left_out = found.len().saturating_sub(MOST_FILES);
    found.truncate(MOST_FILES);
    Ok((found, left_out))
}
