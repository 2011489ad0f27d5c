//! Reading a data set: a folder of class folders, a folder of logs, a single log, or the Stanford layout.
//!
//! This file finds the flights' files and their names, reads them side by side, and puts the result in a fixed order. What is in
//! a file is judged by its siblings. Everything that is wrong is refused with one error that names the place; nothing is half-loaded,
//! and whatever was left out, filled in, or mended on the description's word is said in [`DataSet::notes`].

use super::assemble::{Assembled, Cuts, assemble, gather};
use super::schema::{Manoeuvre, Schema};
use super::table::{fault, read_csv};
use super::{DataSet, stanford};
use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// How to read a data set.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Samples a flight must have, the length of the history. A shorter log is refused, a shorter piece of one left out with a note.
    pub minimum_rows: usize,
    /// Makes a flight of each part between jumps of time, instead of refusing the log.
    pub split_at_gaps: bool,
    /// A `dataset.toml` that lies elsewhere; it is taken in place of the one in the folder.
    pub dataset: Option<PathBuf>,
}

/// A log file, and what its flights are called.
struct Log {
    path: PathBuf,
    name: String,
    manoeuvre: String,
}

const DESCRIPTION: &str = "dataset.toml";

/// Reads a data set. `path` is a folder `DATA/<manoeuvre>/<flight>.csv`, a folder of logs (one class, named after it), a single
/// log, or a folder in the Stanford layout (one folder a flight, or class folders of these). Parquet is read beside CSV with the
/// feature `parquet`. A `dataset.toml` in the folder, or else in the one above it, describes logs that differ from the
/// canonical form.
///
/// # Errors
/// [`Error::Io`]; [`Error::Log`], [`Error::Cell`] for what is wrong with a log (of several, the first by name); [`Error::Config`], [`Error::File`],
/// [`Error::Formula`] for the description.
pub fn data_set(path: &Path, options: &ReadOptions) -> Result<DataSet> {
    let mut notes = Vec::new();
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    let schema = match options.dataset.clone().or_else(|| description(folder)) {
        Some(description) => {
            notes.push(format!("read as {} describes", description.display()));
            Schema::read(&description)?
        }
        None => Schema::default(),
    };
    let logs = logs(path, &schema, &mut notes)?;
    check_unique(path, &logs)?;
    let cuts = Cuts { minimum_rows: options.minimum_rows, split_at_gaps: options.split_at_gaps };

    let results = in_parallel(&logs, |log| read_log(log, &schema, cuts));
    let mut data = DataSet { flights: Vec::new(), notes };
    let mut common: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut own = Vec::new();
    for (log, result) in logs.iter().zip(results) {
        let done = result?;
        data.flights.extend(done.flights);
        own.extend(done.own_notes);
        for note in done.common_notes {
            common.entry(note).or_default().push(log.name.clone());
        }
    }
    data.notes.extend(schema.notes.iter().cloned());
    data.notes.extend(gather(common, logs.len()));
    data.notes.extend(own);
    if data.flights.is_empty() {
        let found = format!("{} logs of which no piece is left", logs.len());
        let expected = format!("at least one flight; what was left out: {}", data.notes.join("; "));
        return Err(fault(path, found, expected));
    }
    data.flights.sort_by(|a, b| (&a.manoeuvre, a.name.len(), &a.name).cmp(&(&b.manoeuvre, b.name.len(), &b.name)));
    Ok(data)
}

#[cfg(feature = "rayon")]
fn in_parallel<T: Send>(logs: &[Log], read: impl Fn(&Log) -> T + Send + Sync) -> Vec<T> {
    use rayon::prelude::*;
    logs.par_iter().map(read).collect()
}

#[cfg(not(feature = "rayon"))]
fn in_parallel<T>(logs: &[Log], read: impl Fn(&Log) -> T) -> Vec<T> {
    logs.iter().map(read).collect()
}

fn read_log(log: &Log, schema: &Schema, cuts: Cuts) -> Result<Assembled> {
    let wanted = |name: &str| schema.wants(name);
    let table = match ending(&log.path).as_deref() {
        None => return stanford::read(&log.path, &log.name, &log.manoeuvre, cuts),
        #[cfg(feature = "parquet")]
        Some("parquet") => super::parquet::read_parquet(&log.path, &wanted)?,
        _ => read_csv(&log.path, &wanted)?,
    };
    assemble(table, &log.name, &log.manoeuvre, schema, cuts)
}

/// The description in the folder, or else in the one above it (a class folder or a log of a described set).
fn description(folder: &Path) -> Option<PathBuf> {
    let above = std::path::absolute(folder).ok()?.parent().map(|above| above.join(DESCRIPTION));
    [Some(folder.join(DESCRIPTION)), above].into_iter().flatten().find(|path| path.is_file())
}

/// `csv` or `parquet`, in lower case; `None` for a folder.
fn ending(path: &Path) -> Option<String> {
    if path.is_dir() {
        return None;
    }
    Some(path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default())
}

fn is_log(path: &Path) -> bool {
    matches!(ending(path).as_deref(), Some("csv" | "parquet"))
}

fn text(name: Option<&OsStr>) -> String {
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

/// Finds the logs of a data set.
fn logs(path: &Path, schema: &Schema, notes: &mut Vec<String>) -> Result<Vec<Log>> {
    if !path.exists() {
        return Err(Error::io(path)(std::io::ErrorKind::NotFound.into()));
    }
    if !path.is_dir() {
        if !is_log(path) {
            return Err(fault(path, format!("a file of the kind `.{}`", ending(path).unwrap_or_default()), KINDS));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        return Ok(vec![log(path, &folder_name(folder), schema)?]);
    }
    if stanford::is_flight(path) {
        return Ok(vec![stanford_log(path, None)]);
    }
    let mut excluded = Vec::new();
    let mut inside = entries(path)?;
    inside.retain(|entry| {
        let out = schema.exclude.contains(&text(entry.file_name()));
        if out {
            excluded.push(format!("`{}`", text(entry.file_name())));
        }
        !out
    });
    if !excluded.is_empty() {
        notes.push(format!("left out, as dataset.toml says: {}", excluded.join(", ")));
    }
    let loose: Vec<Log> =
        inside.iter().filter(|entry| is_log(entry)).map(|entry| log(entry, &folder_name(path), schema)).collect::<Result<_>>()?;
    let mut logs = Vec::new();
    for class in inside.iter().filter(|entry| entry.is_dir()) {
        if stanford::is_flight(class) {
            logs.push(stanford_log(class, None));
            continue;
        }
        let before = logs.len();
        for entry in entries(class)? {
            if stanford::is_flight(&entry) {
                logs.push(stanford_log(&entry, Some(class)));
            } else if is_log(&entry) && !schema.exclude.contains(&text(entry.file_name())) {
                logs.push(log(&entry, &text(class.file_name()), schema)?);
            }
        }
        if logs.len() == before {
            notes.push(format!("the folder `{}` holds no logs", text(class.file_name())));
        } else if class.join(DESCRIPTION).is_file() {
            let expected = format!("one {DESCRIPTION}, in the folder of the data set; move it there");
            return Err(fault(class, format!("a {DESCRIPTION} in the folder of a manoeuvre"), expected));
        }
    }
    match (loose.is_empty(), logs.is_empty()) {
        (false, true) => Ok(loose),
        (true, false) => Ok(logs),
        (true, true) => Err(fault(path, "no logs", "DATA/<manoeuvre>/<flight>.csv, a folder of CSV files, or the Stanford layout")),
        (false, false) => {
            let names: Vec<String> = loose.iter().map(|log| text(log.path.file_name())).collect();
            let expected =
                "logs either all in folders of manoeuvres or all in one folder; move them, or `exclude` them in dataset.toml";
            Err(fault(path, format!("logs beside folders of logs: {}", names.join(", ")), expected))
        }
    }
}

const KINDS: &str = "a .csv or .parquet file, or a folder of them";

fn log(path: &Path, folder: &str, schema: &Schema) -> Result<Log> {
    if cfg!(not(feature = "parquet")) && ending(path).as_deref() == Some("parquet") {
        return Err(fault(path, "a Parquet file", "CSV; this program was built without the feature `parquet`"));
    }
    let name = text(path.file_stem());
    let manoeuvre = match &schema.manoeuvre {
        Manoeuvre::Folder => folder.to_owned(),
        Manoeuvre::FilePart { separator, part } => name.split(separator).nth(part - 1).map(str::to_owned).ok_or_else(|| {
            fault(
                path,
                format!("a file name without a part {part} between `{separator}`"),
                "a name as `manoeuvre` in dataset.toml says",
            )
        })?,
    };
    Ok(Log { path: path.into(), name, manoeuvre })
}

/// The class is the folder above the flight's, or else the flight's name without a number at its end (`hover_03`).
fn stanford_log(path: &Path, class: Option<&Path>) -> Log {
    let name = folder_name(path);
    let without_number = name.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix('_');
    let manoeuvre = class.map_or_else(|| without_number.unwrap_or(&name).to_owned(), |class| text(class.file_name()));
    Log { path: path.into(), name, manoeuvre }
}

fn check_unique(path: &Path, logs: &[Log]) -> Result<()> {
    let mut seen: BTreeMap<&str, &Path> = BTreeMap::new();
    for log in logs {
        if let Some(other) = seen.insert(&log.name, &log.path) {
            let found = format!("two flights named `{}`: {} and {}", log.name, other.display(), log.path.display());
            return Err(fault(path, found, "names that occur once in the data set; rename one, or `exclude` it in dataset.toml"));
        }
    }
    debug_assert_eq!(seen.len(), logs.iter().map(|log| &log.path).collect::<BTreeSet<_>>().len());
    Ok(())
}
