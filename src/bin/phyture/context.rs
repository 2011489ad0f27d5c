//! What every command works with: the options of all, ways of speaking, and flights, models and splits as the command line says. Which command
//! it is, nothing here knows.

use crate::arguments::{Common, Data, Division};
use crate::folder::NewFolder;
use crate::{notes, output};
use phyture::critique::wrap::wrapped;
use phyture::disk::{Existing, Target};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::split::{BENCHMARK_SEED, Split};
use phyture::flight::{DataSet, Flight};
use phyture::physics::Model;
use phyture::tape::Threads;
use phyture::{Error, Result, workflow};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the model file that lies beside flights.
const MODEL_FILE: &str = "model.toml";

/// The place of what was given in vain.
const COMMAND_LINE: &str = "command line";

/// What was typed before the name of the command: cargo tells a program that it has started.
pub fn typed() -> &'static str {
    if std::env::var_os("CARGO_MANIFEST_DIR").is_some() { "cargo phyture" } else { "phyture" }
}

/// The options of every command, and the ways of speaking that follow from them.
pub struct Context<'a> {
    /// As given.
    pub common: &'a Common,
    /// Holds the file of the machine-readable result.
    _json: Option<Target>,
}

impl<'a> Context<'a> {
    /// Looks at once whether the machine-readable result can be written.
    pub fn new(common: &'a Common) -> Result<Self> {
        let file = common.json.as_deref().filter(|path| *path != Path::new("-"));
        let is_free = common.force || file.is_some_and(output::is_failure);
        let existing = if is_free { Existing::Replace } else { Existing::Keep };
        Ok(Self { common, _json: file.map(|path| Target::file(path, existing, &[])).transpose()? })
    }

    /// What becomes of something that exists.
    pub fn existing(&self) -> Existing {
        if self.common.force { Existing::Replace } else { Existing::Keep }
    }

    /// A file that is going to be written, looked at before the work; `read` are the files that the work starts from.
    pub fn new_file(&self, path: &Path, read: &[&Path]) -> Result<Target> {
        Target::file(path, self.existing(), read)
    }

    /// A page that is going to be written into a folder, which is made if it is not there.
    pub fn new_page(&self, folder: &Path, name: &str) -> Result<Target> {
        std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        self.new_file(&folder.join(name), &[])
    }

    /// A folder that is going to be filled: new, or empty, or to be written over.
    pub fn new_folder(&self, folder: &Path) -> Result<NewFolder> {
        NewFolder::open(folder, self.existing())
    }

    /// The path of a file, to be written now. Where the file that was read has this name, it is kept beside with the date.
    pub fn ready<'t>(&self, target: &'t Target) -> Result<&'t Path> {
        let (path, kept) = target.ready()?;
        if let Some(kept) = kept {
            self.say(format!("the file that was there is kept as {}", kept.display()));
        }
        Ok(path)
    }

    /// Text for a person; nothing with `--quiet`.
    pub fn say(&self, text: impl std::fmt::Display) {
        if !self.common.quiet {
            output::say(self.common.json.as_deref(), text);
        }
    }

    /// What was asked for as text (a script, a list), also with `--quiet`.
    pub fn print(&self, text: impl std::fmt::Display) {
        output::say(self.common.json.as_deref(), text);
    }

    /// What must not be missed, on standard error.
    pub fn warn(&self, text: &str) {
        output::warn(text);
    }

    /// Whether everything is to be said.
    pub fn is_verbose(&self) -> bool {
        self.common.verbose
    }

    /// The machine-readable result.
    pub fn json(&self, value: &impl serde::Serialize) -> Result<()> {
        output::json(self.common.json.as_deref(), value)
    }

    /// Threads of a session; 0 is all cores.
    pub fn threads(&self) -> Threads {
        Threads(self.common.threads.unwrap_or(0))
    }

    /// The seed, or the paper's.
    pub fn seed(&self) -> u64 {
        self.common.seed.unwrap_or(BENCHMARK_SEED)
    }

    pub fn limit_threads(&self) {
        if let Some(threads) = self.common.threads.filter(|threads| *threads > 0) {
            // It can be built once in a process; this is the once.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        }
    }

    /// Reads the flights, and says what the reader has to say.
    pub fn flights(&self, data: &Data, history: usize) -> Result<DataSet> {
        let (split_at_gaps, dataset) = (data.split_at_gaps, data.dataset.clone());
        let options = ReadOptions { minimum_rows: history, split_at_gaps, dataset, ..ReadOptions::default() };
        let set = without(data_set(&data.data, &options)?, data)?;
        self.say(format!(
            "{}: {}, {}, {:.0} s at {:.0} Hz",
            data.data.display(),
            counted(set.flights.len(), "flight", "flights"),
            counted(set.manoeuvres().len(), "manoeuvre class", "manoeuvre classes"),
            set.duration_s(),
            1.0 / set.flights.first().map_or(f64::NAN, |flight| flight.step_s)
        ));
        let notes = if self.is_verbose() { set.notes.clone() } else { notes::folded(&set.notes) };
        notes.iter().for_each(|note| self.say(wrapped("  note: ", note)));
        Ok(set)
    }

    /// The same flights as another description reads them; nothing is said.
    pub fn flights_described(data: &Data, text: &str) -> Result<DataSet> {
        let options = ReadOptions { described: Some(text.into()), split_at_gaps: data.split_at_gaps, ..ReadOptions::default() };
        without(data_set(&data.data, &options)?, data)
    }

    /// The model of a file; without one that of a `model.toml` beside the flights, which is said; without that the paper's baseline
    /// for the vehicle of the paper, which is a warning, as the vehicle is a guess.
    pub fn model(&self, path: Option<&Path>, data: &Data) -> Result<Model> {
        if let Some(model) = self.model_if_any(path, data)? {
            return Ok(model);
        }
        let model = Model::from_toml("[model]\nbaseline = \"paper\"\n", Path::new("paper"))?;
        self.warn(&format!(
            "no model was given and {} has no {MODEL_FILE}: the paper's baseline and vehicle are assumed ({}). For another vehicle write its \
             mass_kg, inertia and rotor_radius_m, vehicle and baseline = \"paper\" under [model] into a file and give it with -m FILE",
            data.data.display(),
            model.vehicle_text()
        ));
        Ok(model)
    }

    /// As [`Context::model`], but nothing is assumed where there is no file.
    pub fn model_if_any(&self, path: Option<&Path>, data: &Data) -> Result<Option<Model>> {
        if let Some(path) = path {
            let model = Model::read(path)?;
            self.tell_assumed(&model, path);
            return Ok(Some(model));
        }
        let Some(found) = Self::model_file(data) else { return Ok(None) };
        let model = Model::read(&found)?;
        self.say(wrapped("model: ", &format!("{} (`{}`, {})", found.display(), model.name, model.vehicle_text())));
        self.tell_assumed(&model, &found);
        Ok(Some(model))
    }

    /// The model file that lies with the flights, if one does: beside a single log, or in the folder itself; a folder above may hold the model of
    /// something else.
    pub fn model_file(data: &Data) -> Option<PathBuf> {
        let folder = if data.data.is_dir() { Some(data.data.as_path()) } else { data.data.parent() };
        folder.map(|folder| folder.join(MODEL_FILE)).filter(|found| found.is_file())
    }

    fn tell_assumed(&self, model: &Model, path: &Path) {
        if !model.assumed.is_nothing() {
            let keys = [
                ("mass_kg", model.assumed.mass),
                ("inertia", model.assumed.inertia),
                ("rotor_radius_m", model.assumed.rotor_radius),
            ];
            let missing: Vec<&str> = keys.into_iter().filter(|entry| entry.1).map(|entry| entry.0).collect();
            self.warn(&format!(
                "{} does not give {}: the paper's vehicle is assumed there ({})",
                path.display(),
                missing.join(", "),
                model.vehicle_text()
            ));
        }
    }

    /// Divides the flights as the command line and the model file say.
    pub fn split(&self, flights: &[Flight], model: &Model, division: &Division) -> Result<Split> {
        division.wanted().split(flights, model, self.seed()).map_err(of_the_line)
    }

    /// Divides the flights for a search, where something is kept in any case.
    pub fn search_split(&self, flights: &[Flight], model: &Model, division: &Division) -> Result<Split> {
        division.wanted().search_split(flights, model, self.seed()).map_err(of_the_line)
    }

    /// Divides the flights for these models to be judged: as the first of them says, or with `all` on every flight.
    pub fn judged_split(&self, flights: &[Flight], models: &[&Model], division: &Division, all: bool) -> Result<Split> {
        division.wanted().judged(flights, models, self.seed(), all).map_err(of_the_line)
    }
}

/// An error about the division with the option that it is about.
fn of_the_line(error: Error) -> Error {
    match error {
        Error::Config { place, field, found, expected } if place == workflow::Division::PLACE => {
            Error::Config { place: COMMAND_LINE.into(), field: format!("--{field}"), found, expected }
        }
        other => other,
    }
}

/// SHA-256 of the names and contents of the files that a data set was read from, the description in force among them.
pub fn data_sha256(set: &DataSet) -> String {
    set.source.sha256.clone()
}

/// Work that Ctrl-C (and a polite kill) asks to stop, as long as this lives: a flag that it raises. The second time, and once this is gone, it ends
/// the program at once.
pub struct Interruption {
    raised: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
}

impl Deref for Interruption {
    type Target = AtomicBool;

    fn deref(&self) -> &AtomicBool {
        &self.raised
    }
}

impl Drop for Interruption {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// Listens to Ctrl-C. Installed once.
pub fn interruption() -> Result<Interruption> {
    let made = Interruption { raised: Arc::default(), over: Arc::default() };
    let (raised, over) = (Arc::clone(&made.raised), Arc::clone(&made.over));
    let raise = move || {
        if raised.swap(true, Ordering::Relaxed) || over.load(Ordering::Relaxed) {
            std::process::exit(crate::INTERRUPTED.into());
        }
    };
    ctrlc::set_handler(raise)
        .map_err(|error| Error::Undetermined(format!("the handler of Ctrl-C cannot be installed: {error}")))?;
    Ok(made)
}

/// A number of things, in words for one and for several.
fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// The flights without those that were asked to be left out.
fn without(set: DataSet, data: &Data) -> Result<DataSet> {
    workflow::without(set, &data.leave_out).map_err(|error| match error {
        Error::Config { found, expected, .. } => {
            Error::Config { place: COMMAND_LINE.into(), field: "--leave-out".into(), found, expected }
        }
        other => other,
    })
}
