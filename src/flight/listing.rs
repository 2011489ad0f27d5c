//! Which files of a folder are the logs of a data set, what their flights are called, and what was left unread.
//!
//! Names, endings and kinds of nodes are looked at; no log is opened. Only plain files are logs: pipes and devices are never opened,
//! and a symbolic link that leads back to the folder itself is not followed.

use super::csv::CSV;
use super::format::{Format, Log};
use super::formats;
use super::given::Given;
use super::names::own_name;
use super::schema::{Manoeuvre, Schema};
use super::table::fault;
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// What a data set's folder holds.
#[derive(Default)]
pub(super) struct Listing {
    pub logs: Vec<Log>,
    /// Sentences about what was not read.
    pub notes: Vec<String>,
}

/// What was met on the way and is no log.
#[derive(Default)]
struct Unread {
    excluded: Vec<String>,
    files: Vec<String>,
    empty: Vec<String>,
    deep: Vec<String>,
    loops: Vec<String>,
}

pub(super) const DESCRIPTION: &str = "dataset.toml";

/// Files that this program writes beside flights and that are no news to anybody.
const COMPANIONS: [&str; 3] = [DESCRIPTION, "model.toml", "truth.json"];

pub(super) fn text(name: Option<&OsStr>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The folder's own name, also where it is given as `.`.
fn folder_name(folder: &Path) -> String {
    let name = text(folder.file_name());
    if name.is_empty() { folder.canonicalize().map(|full| text(full.file_name())).unwrap_or_default() } else { name }
}

/// Entries of a folder without hidden ones, sorted by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        if !entry.file_name().to_string_lossy().starts_with('.') {
            paths.push(entry.path());
        }
    }
    paths.sort();
    Ok(paths)
}

/// Whether an entry that is named as a log is one that can be read.
///
/// # Errors
/// [`Error::Log`] for a link that leads nowhere: its flight would be missed.
fn is_log(path: &Path) -> Result<bool> {
    if formats::of_file(path).is_none() || path.is_dir() {
        return Ok(false);
    }
    if path.is_symlink() && matches!(path.try_exists(), Ok(false)) {
        return Err(fault(path, "a symbolic link to a file that is not there", "a log; mend the link, or remove it"));
    }
    Ok(path.is_file())
}

/// Finds the logs of a data set.
pub(super) fn list(path: &Path, schema: &Schema) -> Result<Listing> {
    let kind = std::fs::metadata(path).map_err(Error::io(path))?;
    if !kind.is_dir() {
        return single(path, kind.is_file(), schema);
    }
    if let Some(format) = formats::of_folder(path) {
        return Ok(Listing { logs: vec![folder_log(path, format, None)], notes: Vec::new() });
    }
    let mut unread = Unread::default();
    let (mut loose, mut logs) = (Vec::new(), Vec::new());
    for entry in entries(path)? {
        let name = text(entry.file_name());
        if schema.exclude.contains(&name) {
            unread.excluded.push(format!("`{name}`"));
        } else if is_log(&entry)? {
            loose.push(log(&entry, None, &folder_name(path), schema)?);
        } else if entry.is_dir() {
            of_class(path, &entry, schema, &mut logs, &mut unread)?;
        } else if !COMPANIONS.contains(&name.as_str()) {
            unread.files.push(name);
        }
    }
    let notes = unread.notes();
    match (loose.is_empty(), logs.is_empty()) {
        (false, true) => Ok(Listing { logs: loose, notes }),
        (true, false) => Ok(Listing { logs, notes }),
        (true, true) => Err(none(path, &unread)),
        (false, false) => {
            let names: Vec<String> = loose.iter().map(|log| text(log.path.file_name())).collect();
            let expected =
                "logs either all in folders of manoeuvres or all in one folder; move them, or `exclude` them in dataset.toml";
            Err(fault(path, format!("logs beside folders of logs: {}", names.join(", ")), expected))
        }
    }
}

/// A log given by itself.
fn single(path: &Path, plain: bool, schema: &Schema) -> Result<Listing> {
    if formats::of_file(path).is_none() {
        let kinds = format!("{}, or a folder of them", formats::files());
        let expected = formats::converter(path).map_or_else(|| kinds.clone(), |how| format!("{kinds}; this is {how}"));
        return Err(fault(path, format!("a file of the kind `.{}`", formats::ending(path)), expected));
    }
    if !plain {
        return Err(fault(path, "a pipe or a device", "a plain file; copy what it gives into one"));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok(Listing { logs: vec![log(path, None, &folder_name(folder), schema)?], notes: Vec::new() })
}

/// The logs in the folder of one manoeuvre.
fn of_class(data: &Path, class: &Path, schema: &Schema, logs: &mut Vec<Log>, unread: &mut Unread) -> Result<()> {
    let class_name = text(class.file_name());
    if leads_back(data, class) {
        unread.loops.push(class_name);
        return Ok(());
    }
    if let Some(format) = formats::of_folder(class) {
        logs.push(folder_log(class, format, None));
        return Ok(());
    }
    let before = logs.len();
    for entry in entries(class)? {
        let name = text(entry.file_name());
        if schema.exclude.contains(&name) {
            unread.excluded.push(format!("`{class_name}/{name}`"));
        } else if let Some(format) = formats::of_folder(&entry) {
            logs.push(folder_log(&entry, format, Some(class)));
        } else if is_log(&entry)? {
            logs.push(log(&entry, Some(&class_name), &class_name, schema)?);
        } else if entry.is_dir() {
            unread.deep.push(format!("{class_name}/{name}"));
        } else if !COMPANIONS.contains(&name.as_str()) {
            unread.files.push(format!("{class_name}/{name}"));
        }
    }
    if logs.len() == before {
        unread.empty.push(class_name);
    } else if class.join(DESCRIPTION).is_file() {
        let expected = format!("one {DESCRIPTION}, in the folder of the data set; move it there");
        return Err(fault(class, format!("a {DESCRIPTION} in the folder of a manoeuvre"), expected));
    }
    Ok(())
}

/// Whether a symbolic link leads to the data set itself or to a folder that it is in.
fn leads_back(data: &Path, class: &Path) -> bool {
    class.is_symlink() && matches!((data.canonicalize(), class.canonicalize()), (Ok(data), Ok(class)) if data.starts_with(&class))
}

/// The first few names of many.
fn few(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let more = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    format!("{}{more}", names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", "))
}

impl Unread {
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.excluded.is_empty() {
            notes.push(format!("left out, as dataset.toml says: {}", self.excluded.join(", ")));
        }
        let counted = |names: &[String], one: &str, many: &str| {
            let (number, verb) = if names.len() == 1 { (one, "was") } else { (many, "were") };
            (!names.is_empty()).then(|| format!("{} {number} {verb} not read: {}", names.len(), few(names)))
        };
        notes.extend(counted(&self.files, "file that is no log", "files that are no logs"));
        notes.extend(counted(&self.empty, "folder without logs", "folders without logs"));
        let deep = counted(&self.deep, "folder inside the folder of a manoeuvre", "folders inside folders of manoeuvres");
        notes.extend(deep.map(|note| format!("{note}; logs lie in DATA/<manoeuvre>/")));
        let loops =
            counted(&self.loops, "symbolic link that leads back to the data set", "symbolic links that lead back to the data set");
        notes.extend(loops);
        notes
    }
}

/// A folder in which nothing is a log.
fn none(path: &Path, unread: &Unread) -> Error {
    let mut expected = "DATA/<manoeuvre>/<flight>.csv, a folder of CSV files, or the Stanford layout".to_owned();
    if let Some((file, how)) = unread.files.iter().find_map(|file| Some((file, formats::converter(Path::new(file))?))) {
        expected = format!("{expected}; {file} is {how}");
    }
    let found = match unread.notes().as_slice() {
        [] => "no logs".to_owned(),
        notes => format!("no logs ({})", notes.join("; ")),
    };
    fault(path, found, expected)
}

/// A file's flight; `below` is the folder between it and the data set.
fn log(path: &Path, below: Option<&str>, folder: &str, schema: &Schema) -> Result<Log> {
    let format = formats::of_file(path).ok_or_else(|| fault(path, "a file of another kind", formats::files()))?;
    let own = text(path.file_stem());
    let manoeuvre = class(path, &own, folder, schema)?;
    let name = below.map_or(own.clone(), |below| format!("{below}/{own}"));
    Ok(Log { path: path.into(), format, name, manoeuvre, given: None })
}

/// The class of a flight with this own name, whose folder is called `folder`, as the description says.
fn class(path: &Path, own: &str, folder: &str, schema: &Schema) -> Result<String> {
    match &schema.manoeuvre {
        Manoeuvre::Folder => Ok(folder.to_owned()),
        Manoeuvre::FilePart { separator, part } => own.split(separator).nth(part - 1).map(str::to_owned).ok_or_else(|| {
            fault(
                path,
                format!("a file name without a part {part} between `{separator}`"),
                "a name as `manoeuvre` in dataset.toml says",
            )
        }),
    }
}

/// A log whose columns are given, as a CSV file of this name would be.
///
/// # Errors
/// As [`Given::table`]; [`Error::Log`] for a name that the description finds no class in.
pub(super) fn given(log: Given, schema: &Schema) -> Result<Log> {
    let (path, name) = (PathBuf::from(&log.name), log.name.clone());
    let own = own_name(&name);
    let folder = name.rsplit_once('/').map_or_else(|| without_number(own), |(above, _)| own_name(above));
    let manoeuvre = class(&path, own, folder, schema)?;
    Ok(Log { path, format: &CSV, manoeuvre, given: Some(log.table(&|name| schema.wants(name))?), name })
}

/// A name without an underscore and a number at its end: `hover` of `hover_03`.
fn without_number(own: &str) -> &str {
    own.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix('_').unwrap_or(own)
}

/// The class is the folder above the flight's, or else the flight's name without a number at its end (`hover_03`).
fn folder_log(path: &Path, format: &'static Format, class: Option<&Path>) -> Log {
    let own = folder_name(path);
    let class = class.map(|class| text(class.file_name()));
    let manoeuvre = class.clone().unwrap_or_else(|| without_number(&own).to_owned());
    let name = class.map_or(own.clone(), |class| format!("{class}/{own}"));
    Log { path: path.into(), format, name, manoeuvre, given: None }
}

/// Refuses two logs of one name: `a.csv` beside `a.parquet`.
pub(super) fn check_unique(path: &Path, logs: &[Log]) -> Result<()> {
    let mut seen: BTreeMap<&str, &Path> = BTreeMap::new();
    for log in logs {
        if let Some(other) = seen.insert(&log.name, &log.path) {
            let found = format!("two flights named `{}`: {} and {}", log.name, other.display(), log.path.display());
            return Err(fault(path, found, "names that occur once in the data set; rename one, or `exclude` it in dataset.toml"));
        }
    }
    Ok(())
}
