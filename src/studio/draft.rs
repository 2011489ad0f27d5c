//! Steps that are not saved yet, kept in a file beside the model after each of them, so that a program that is killed takes nothing with it. What such
//! a file holds is offered by the next studio on the same model, and never overwritten: it goes when it was taken up, saved or thrown away.
//!
//! The files are this program's own and no exchange format. Each is locked while its studio runs, so that a second one leaves it alone.

use super::history::State;
use super::{Steps, Studio, fault, held};
use crate::critique::diagnose::Diagnosis;
use crate::disk::{Lock, write_atomically};
use crate::error::{Error, Result};
use crate::physics::{Calibration, Model};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Instant, UNIX_EPOCH};

/// Raised when an older program could not read a file any more.
const FORMAT: u32 = 1;

/// End of a draft's name, before its number.
const KIND: &str = "unsaved";

/// Drafts beside one model that are looked for, and made.
const MOST: usize = 99;

/// A draft that an earlier studio left.
#[derive(Clone, Debug, Serialize)]
pub struct LeftText {
    /// The file.
    pub file: String,
    /// When it was written last, s since 1970, UTC.
    pub written_s: u64,
    /// What was done, without the state that the studio began with.
    pub steps: Vec<String>,
    /// What a search had found, in a sentence.
    pub search: Option<String>,
    /// Why it cannot be taken up.
    pub fault: Option<String>,
}

/// The history on disk.
#[derive(Serialize, Deserialize)]
struct Draft {
    format: u32,
    version: String,
    data_sha256: String,
    at: usize,
    steps: Vec<DraftStep>,
    searches: Vec<Diagnosis>,
    search: Option<DraftSearch>,
}

/// A state. The model is text as in a model file, so that a person can cut it out.
#[derive(Serialize, Deserialize)]
struct DraftStep {
    did: String,
    model: String,
    calibration: Option<Calibration>,
    found: Option<usize>,
}

/// The last search: its index among `searches`, and the step that it searched.
#[derive(Serialize, Deserialize)]
struct DraftSearch {
    step: usize,
    found: usize,
    model: String,
    seconds: f64,
}

/// A file that is held against other studios.
struct Left {
    path: PathBuf,
    _lock: Lock,
    draft: Result<Draft>,
}

/// Drafts beside one model.
pub(super) struct Drafts {
    /// The name without kind and number.
    base: Option<PathBuf>,
    own: Option<(PathBuf, Lock)>,
    left: Vec<Left>,
    fault: Option<String>,
    /// When the model was saved last.
    pub saved: Option<Instant>,
}

impl Drafts {
    /// Looks what earlier studios left beside the model file, or in the folder of the flights where there is none.
    pub fn beside(file: Option<&Path>, data: &Path, data_sha256: &str) -> Self {
        let folder = if data.is_dir() { Some(data) } else { data.parent().filter(|_| data.is_file()) };
        let base = file.map(|file| file.with_extension("")).or_else(|| folder.map(|folder| folder.join("studio")));
        let none = || format!("there is no model file, and `{}` is no folder", data.display());
        let fault = base.is_none().then(none);
        let mut drafts = Self { base, own: None, left: Vec::new(), fault, saved: None };
        let paths: Vec<PathBuf> = drafts.names().filter(|path| path.is_file()).collect();
        for path in paths {
            // Whoever holds it is another studio, and alive.
            let Ok(lock) = Lock::of_file(&path) else { continue };
            let draft = Draft::read(&path, data_sha256);
            drafts.left.push(Left { path, _lock: lock, draft });
        }
        drafts
    }

    /// `model.unsaved.json`, `model.unsaved-2.json`, and so on.
    fn names(&self) -> impl Iterator<Item = PathBuf> {
        let name = |base: &PathBuf, count: usize| {
            let number = if count == 1 { String::new() } else { format!("-{count}") };
            base.with_file_name(format!("{}.{KIND}{number}.json", base.file_name().unwrap_or_default().to_string_lossy()))
        };
        self.base.clone().into_iter().flat_map(move |base| (1..=MOST).map(move |count| name(&base, count)))
    }

    /// Writes the draft, or removes it where nothing is unsaved. Why it could not be written is remembered and told.
    fn put(&mut self, draft: Option<&Draft>) {
        let Some(draft) = draft else {
            if let Some((path, _lock)) = self.own.take() {
                // One that stays is offered once more, which is no loss.
                let _ = std::fs::remove_file(path);
            }
            return;
        };
        let written = self.claimed().and_then(|path| {
            let text = serde_json::to_string(draft).map_err(|error| Error::Undetermined(error.to_string()))?;
            write_atomically(path, |file| file.write_all(text.as_bytes()))
        });
        match written {
            Ok(()) => self.fault = None,
            Err(error) => self.fault = Some(error.to_string()),
        }
    }

    /// The own file: the first name that nothing stands at and no other studio holds.
    fn claimed(&mut self) -> Result<PathBuf> {
        if self.own.is_none() {
            let told = self.fault.clone().unwrap_or_else(|| format!("there are {MOST} of them already"));
            let free: Vec<PathBuf> = self.names().filter(|path| !path.exists()).collect();
            for path in free {
                match Lock::of_file(&path) {
                    Ok(lock) => {
                        self.own = Some((path, lock));
                        break;
                    }
                    Err(Error::Busy { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            if self.own.is_none() {
                return Err(Error::Undetermined(told));
            }
        }
        Ok(self.own.as_ref().map(|own| own.0.clone()).unwrap_or_default())
    }

    /// Where the unsaved steps lie.
    pub fn file(&self) -> Option<String> {
        self.own.as_ref().filter(|_| self.fault.is_none()).map(|own| own.0.display().to_string())
    }

    /// Why they lie nowhere.
    pub fn fault(&self) -> Option<String> {
        self.fault.clone()
    }

    /// What earlier studios left.
    pub fn left(&self) -> Vec<LeftText> {
        let text = |left: &Left| {
            let changed = std::fs::metadata(&left.path).and_then(|there| there.modified()).ok();
            let since = changed.and_then(|changed| changed.duration_since(UNIX_EPOCH).ok());
            let draft = left.draft.as_ref().ok();
            let did = |draft: &Draft| draft.steps.iter().skip(1).map(|step| step.did.clone()).collect();
            LeftText {
                file: left.path.display().to_string(),
                written_s: since.map_or(0, |since| since.as_secs()),
                steps: draft.map(did).unwrap_or_default(),
                search: draft.and_then(|draft| Some(draft.searches.get(draft.search.as_ref()?.found)?.summary.clone())),
                fault: left.draft.as_ref().err().map(ToString::to_string),
            }
        };
        self.left.iter().map(text).collect()
    }

    /// The place of a draft among those that are offered.
    fn place(&self, file: &str) -> Result<usize> {
        let place = self.left.iter().position(|left| left.path.display().to_string() == file);
        place.ok_or_else(|| fault("file", format!("`{file}`"), "one of the files with unsaved steps"))
    }

    /// Removes one that was taken up or thrown away.
    fn remove(&mut self, file: &str) -> Result<()> {
        let place = self.place(file)?;
        let path = &self.left[place].path;
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(path)(error)),
            _ => {}
        }
        self.left.remove(place);
        Ok(())
    }
}

impl Draft {
    fn read(path: &Path, data_sha256: &str) -> Result<Self> {
        let damaged = |message: String| Error::File { path: path.into(), message };
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        let draft: Self = serde_json::from_str(&text).map_err(|error| damaged(format!("cannot be read: {error}")))?;
        if draft.format != FORMAT {
            return Err(damaged(format!("was written by version {}; take it up with that one", draft.version)));
        }
        if draft.data_sha256 != data_sha256 {
            return Err(damaged("belongs to other flights; open the studio on those".into()));
        }
        Ok(draft)
    }

    /// The states, without identifiers, and what of them is the last search.
    fn states(&self, path: &Path) -> Result<Vec<State>> {
        let searches: Vec<Arc<Diagnosis>> = self.searches.iter().cloned().map(Arc::new).collect();
        let state = |step: &DraftStep| {
            let found = step.found.and_then(|found| searches.get(found).cloned());
            let model = Model::from_toml(&step.model, path)?;
            Ok(State { id: 0, did: step.did.clone(), model, calibration: step.calibration.clone(), found })
        };
        self.steps.iter().map(state).collect()
    }
}

impl Studio {
    /// Says that something changed, and keeps what is not saved on disk.
    pub(super) fn keep(&self) {
        self.revision.fetch_add(1, Ordering::Relaxed);
        let mut drafts = held(&self.drafts);
        match self.draft(&drafts) {
            Ok(draft) => drafts.put(draft.as_ref()),
            Err(error) => drafts.fault = Some(error.to_string()),
        }
    }

    /// The history as it is written; nothing where all of it is saved.
    ///
    /// # Errors
    /// As [`Model::to_toml`].
    fn draft(&self, drafts: &Drafts) -> Result<Option<Draft>> {
        let (states, at, unsaved) = held(&self.history).unsaved();
        let heard = self.heard().filter(|heard| drafts.saved.is_none_or(|saved| heard.ended > saved));
        if !unsaved && heard.is_none() {
            return Ok(None);
        }
        let mut searches: Vec<Arc<Diagnosis>> = Vec::new();
        let mut place = |found: &Arc<Diagnosis>| {
            searches.iter().position(|known| Arc::ptr_eq(known, found)).unwrap_or_else(|| {
                searches.push(Arc::clone(found));
                searches.len() - 1
            })
        };
        let mut steps = Vec::with_capacity(states.len());
        for state in &states {
            let model = state.model.to_toml()?;
            let found = state.found.as_ref().map(&mut place);
            steps.push(DraftStep { did: state.did.clone(), model, calibration: state.calibration.clone(), found });
        }
        // A search of a step that was replaced since goes with it.
        let searched = heard.and_then(|heard| Some((states.iter().position(|state| state.id == heard.state.id)?, heard)));
        let search = searched.map(|(step, heard)| {
            let (found, model) = (place(&heard.diagnosis), heard.model.to_toml()?);
            Ok::<_, Error>(DraftSearch { step, found, model, seconds: heard.seconds })
        });
        let search = search.transpose()?;
        let searches = searches.iter().map(|found| Diagnosis::clone(found)).collect();
        let (version, data_sha256) = (env!("CARGO_PKG_VERSION").into(), self.set.source.sha256.clone());
        Ok(Some(Draft { format: FORMAT, version, data_sha256, at, steps, searches, search }))
    }

    /// Takes up the steps that an earlier studio left unsaved, as steps after the present one.
    ///
    /// # Errors
    /// [`Error::Config`] for a file that is not offered; [`Error::File`] for one that is damaged or of other flights; as [`Studio::edit`]. The
    /// history and the file are then as before.
    pub fn take_up(&self, file: &str) -> Result<Steps> {
        {
            let _one_at_a_time = held(&self.changing);
            let (states, at, search) = {
                let drafts = held(&self.drafts);
                let left = &drafts.left[drafts.place(file)?];
                let draft = match &left.draft {
                    Ok(draft) => draft,
                    Err(error) => return Err(Error::File { path: left.path.clone(), message: error.to_string() }),
                };
                let states = draft.states(&left.path)?;
                let search = draft.search.as_ref().zip(draft.search.as_ref().and_then(|search| draft.searches.get(search.found)));
                let search = search.map(|(search, found)| {
                    Ok::<_, Error>((search.step, search.seconds, found.clone(), Model::from_toml(&search.model, &left.path)?))
                });
                (states, draft.at, search.transpose()?)
            };
            states.iter().try_for_each(|state| state.model.check_flights(&self.set.flights))?;
            let ids = self.follow_up(states, at)?;
            if let Some((step, seconds, diagnosis, model)) = search {
                let state = ids.get(step).and_then(|id| held(&self.history).state(*id));
                state.into_iter().for_each(|state| self.hear(state, seconds, diagnosis.clone(), model.clone()));
            }
            self.keep();
            held(&self.drafts).remove(file)?;
        }
        self.steps()
    }

    /// Adds states behind the present one and shows the one at `at`; their identifiers.
    fn follow_up(&self, states: Vec<State>, at: usize) -> Result<Vec<u64>> {
        let now = self.now();
        let mut history = held(&self.history).clone();
        let mut ids = Vec::with_capacity(states.len());
        for (index, state) in states.into_iter().enumerate() {
            // The state that the earlier studio began with is mostly the one that this one began with.
            if index == 0 && state.model.effects == now.model.effects {
                ids.push(now.id);
                continue;
            }
            let id = history.new_id();
            ids.push(id);
            history.push(Arc::new(State { id, ..state }));
        }
        ids.get(at).into_iter().for_each(|id| {
            history.go_to(*id);
        });
        self.judge.path(&self.set, &self.split, &history.path())?;
        *held(&self.history) = history;
        Ok(ids)
    }

    /// Throws away what an earlier studio left unsaved.
    ///
    /// # Errors
    /// [`Error::Config`] for a file that is not offered; [`Error::Io`] where it cannot be removed.
    pub fn discard(&self, file: &str) -> Result<Steps> {
        held(&self.drafts).remove(file)?;
        self.revision.fetch_add(1, Ordering::Relaxed);
        self.steps()
    }

    /// Where the steps lie that are not saved, if any are not.
    pub fn kept(&self) -> Option<String> {
        held(&self.drafts).file()
    }
}
