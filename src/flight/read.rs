//! Reading a data set: a folder of class folders, a folder of logs, a single log, or the Stanford layout.
//!
//! This file reads the logs that `listing` finds side by side, and puts the result in a fixed order. What is in a file is judged by its
//! siblings. Everything that is wrong is refused with one error that names the place; nothing is half-loaded, and whatever was left out,
//! filled in, or mended on the description's word is said in [`DataSet::notes`]. What was read is recorded in [`DataSet::source`].

use super::assemble::{Assembled, Cuts, gather};
use super::format::Log;
use super::formats;
use super::listing::{DESCRIPTION, Listing, check_unique, given, list};
use super::schema::{OfLog, Schema};
use super::source::Read;
use super::table::fault;
use super::{DataSet, Flight, Given, Source, names};
use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use std::collections::hash_map::{DefaultHasher, Entry};
use std::collections::{BTreeMap, HashMap};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// How to read a data set.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Samples a flight must have, the length of the history. A shorter log is refused, a shorter piece of one left out with a note.
    pub minimum_rows: usize,
    /// Makes a flight of each part between jumps of time, instead of refusing the log.
    pub split_at_gaps: bool,
    /// A `dataset.toml` that lies elsewhere; it is taken in place of the one in the folder.
    pub dataset: Option<PathBuf>,
    /// The text of a `dataset.toml`, which is taken in place of any file.
    pub described: Option<String>,
}

impl ReadOptions {
    /// Whether they say which description is in force, wherever the logs lie.
    const fn gives_description(&self) -> bool {
        self.dataset.is_some() || self.described.is_some()
    }
}

/// Columns that a data set holds in memory, bytes; four hours of flight at 100 Hz.
const LARGEST_HELD: usize = 256 << 20;

/// Reads a data set. `path` is a folder `DATA/<manoeuvre>/<flight>.csv`, a folder of logs (one class, named after it), a single
/// log, or a folder in the Stanford layout (one folder a flight, or class folders of these). PX4 and ArduPilot logs are read beside
/// CSV, and Parquet with the feature `parquet`. A `dataset.toml` in the folder, or else in the one above it, describes logs that differ from the
/// canonical form.
///
/// # Errors
/// [`Error::Io`]; [`Error::Log`], [`Error::Cell`] for what is wrong with a log (of several, the first by name); [`Error::Config`], [`Error::File`],
/// [`Error::Formula`] for the description.
pub fn data_set(path: &Path, options: &ReadOptions) -> Result<DataSet> {
    let mut notes = Vec::new();
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    let in_force = in_force(Some(folder), options, &mut notes)?;
    let Listing { logs, notes: unread } = list(path, &in_force.schema)?;
    notes.extend(unread);
    // A description that was found above the folder, or beside a single log, is that of a larger set.
    let is_whole = path.is_dir() && (options.gives_description() || folder.join(DESCRIPTION).is_file());
    of_logs(path, logs, in_force, is_whole, options, notes)
}

/// Reads logs whose columns are in memory, as [`data_set`] reads files. Where the set says which files it was read from, the names of the logs stand.
///
/// # Errors
/// As [`data_set`]; [`Error::Log`] for no log, for columns of several lengths, for two logs of one name.
pub fn of_columns(logs: Vec<Given>, options: &ReadOptions) -> Result<DataSet> {
    let mut notes = Vec::new();
    let path = Path::new("columns");
    let in_force = in_force(None, options, &mut notes)?;
    if logs.is_empty() {
        return Err(fault(path, "no logs", "the columns of at least one flight"));
    }
    let logs = logs.into_iter().map(|log| given(log, &in_force.schema)).collect::<Result<Vec<Log>>>()?;
    of_logs(path, logs, in_force, options.gives_description(), options, notes)
}

/// Reads these logs. `is_whole` says whether the description in force is given for all of them and no others that are not here.
fn of_logs(
    path: &Path,
    mut logs: Vec<Log>,
    in_force: InForce,
    is_whole: bool,
    options: &ReadOptions,
    mut notes: Vec<String>,
) -> Result<DataSet> {
    let InForce { mut schema, read: described, mut text } = in_force;
    check_unique(path, &logs)?;
    let cuts = Cuts { minimum_rows: options.minimum_rows, split_at_gaps: options.split_at_gaps };

    // One that lies elsewhere may be that of several sets.
    let is_of_these = is_whole && !options.gives_description();
    let in_description = |error| described.iter().fold(error, |error, read| at(&read.path, error));
    classify(&schema, &mut logs, is_of_these, &mut notes).map_err(in_description)?;
    if let Some(whole) = formats::description(path, &logs, text.as_deref().unwrap_or_default())? {
        schema = Schema::parse(whole.as_bytes(), "dataset.toml")?;
        text = Some(whole);
    }
    let own = of_single_logs(&schema, &logs, is_of_these, &mut notes).map_err(in_description)?;
    let held = AtomicUsize::new(0);
    let results = read_each(&logs, &schema, &own, cuts, &held);
    let mut data = DataSet { notes, ..DataSet::default() };
    let (mut read, mut quaternions) = (Vec::new(), 0);
    let mut common: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut own = Vec::new();
    let (mut seen, mut copies) = (HashMap::new(), BTreeMap::<String, Vec<String>>::new());
    let mut unread = Vec::new();
    for (log, result) in logs.iter().zip(results) {
        let (done, prints): (Assembled, Vec<u64>) = match result {
            // What is left out may be wrong in any way.
            Err(error) if is_left_out(log, &schema, &logs) => {
                data.notes.push(format!("left out, as dataset.toml says: {}; it cannot be read: {error}", log.name));
                unread.push(log.name.as_str());
                continue;
            }
            result => result?,
        };
        for (flight, print) in done.flights.into_iter().zip(prints) {
            match seen.entry(print) {
                Entry::Vacant(entry) => {
                    entry.insert(flight.name.clone());
                    data.flights.push(flight);
                }
                Entry::Occupied(entry) => copies.entry(entry.get().clone()).or_default().push(flight.name),
            }
        }
        read.extend(done.files);
        quaternions += usize::from(done.quaternion);
        own.extend(done.own_notes);
        for note in done.common_notes {
            common.entry(note).or_default().push(log.name.clone());
        }
    }
    data.notes.extend(schema.notes.iter().cloned());
    data.notes.extend(gather(common, logs.len()));
    data.notes.extend(own);
    data.notes.extend(
        copies
            .iter()
            .map(|(first, others)| format!("left out, since they hold the same numbers as `{first}`: {}", others.join(", "))),
    );
    leave_out(&mut data, &schema, &logs, &unread, is_whole)
        .map_err(|error| described.iter().fold(error, |error, read| at(&read.path, error)))?;
    if data.flights.is_empty() {
        let found = format!("{} logs of which no piece is left", logs.len());
        let expected = format!("at least one flight; what was left out: {}", data.notes.join("; "));
        return Err(fault(path, found, expected));
    }
    let quaternion = (quaternions == logs.len()).then_some(schema.quaternion);
    let left_out = unread.into_iter().map(str::to_owned).chain(std::mem::take(&mut data.source.left_out)).collect();
    data.source = Source { axes: schema.axes, quaternion, stated: schema.stated, description: text, left_out, ..Source::default() };
    data.source.record(path, read, described);
    if held.into_inner() > LARGEST_HELD {
        data.flights = data.flights.into_iter().map(Flight::out_of_memory).collect();
    }
    data.flights.sort_by(|a, b| (&a.manoeuvre, a.name.len(), &a.name).cmp(&(&b.manoeuvre, b.name.len(), &b.name)));
    Ok(data)
}

/// The description in force.
struct InForce {
    schema: Schema,
    read: Option<Read>,
    text: Option<String>,
}

/// The description that was given, or else named, or else found beside the logs, if these lie in a folder.
fn in_force(folder: Option<&Path>, options: &ReadOptions, notes: &mut Vec<String>) -> Result<InForce> {
    let given = options.described.as_ref().map(|text| (PathBuf::from(DESCRIPTION), text.clone().into_bytes()));
    let found = || options.dataset.clone().or_else(|| description(folder?));
    let of_file = |path: PathBuf| std::fs::read(&path).map_err(Error::io(&path)).map(|bytes| (path, bytes));
    let Some((path, bytes)) = given.map(Ok).or_else(|| found().map(of_file)).transpose()? else {
        return Ok(InForce { schema: Schema::default(), read: None, text: None });
    };
    notes.push(format!("read as {} describes", path.display()));
    let schema = Schema::parse(&bytes, &path.display().to_string())?;
    Ok(InForce { schema, read: Some(Read::of(&path, &bytes)), text: String::from_utf8(bytes).ok() })
}

/// Each log as the description says of it, with what tells its flights apart.
fn read_each(
    logs: &[Log],
    schema: &Schema,
    own: &BTreeMap<&str, OfLog<'_>>,
    cuts: Cuts,
    held: &AtomicUsize,
) -> Vec<Result<(Assembled, Vec<u64>)>> {
    in_parallel(logs, |log| {
        let done = match own.get(log.name.as_str()) {
            Some(rules) => log.format.read(log, &schema.for_log(rules), cuts)?,
            None => log.format.read(log, schema, cuts)?,
        };
        let prints: Vec<u64> = done.flights.iter().map(fingerprint).collect();
        Ok((sparing(done, held), prints))
    })
}

/// Whether the description leaves this whole log out.
fn is_left_out(log: &Log, schema: &Schema, logs: &[Log]) -> bool {
    let named = |wanted: &String| names::matching(wanted, logs.iter().map(|log| log.name.as_str())) == [log.name.as_str()];
    schema.leave_out.iter().any(named)
}

/// Leaves out what the description says; `unread` is out already. A name that is not among the flights may be that of another part of a larger set, or of a log of which no
/// piece is left: that is told.
fn leave_out(data: &mut DataSet, schema: &Schema, logs: &[Log], unread: &[&str], is_whole: bool) -> Result<()> {
    let is_in = |name: &&String| names::matching(name, unread.iter().copied()).is_empty();
    let has_log = |name: &str| !names::matching(name, logs.iter().map(|log| log.name.as_str())).is_empty();
    let is_asked = |name: &String| !names::find(&data.flights, name).is_empty() || (is_whole && !has_log(name));
    let (asked, gone): (Vec<String>, Vec<String>) = schema.leave_out.iter().filter(is_in).cloned().partition(is_asked);
    if !gone.is_empty() {
        data.notes.push(format!("to be left out, as dataset.toml says, but not among these flights: {}", gone.join(", ")));
    }
    data.leave_out(&asked, "as dataset.toml says")
}

/// What the description says of single logs, by their names. One that is not among the logs may be that of another part of a larger set, or of another
/// set, unless the description is of these.
fn of_single_logs<'s, 'l>(
    schema: &'s Schema,
    logs: &'l [Log],
    is_of_these: bool,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<&'l str, OfLog<'s>>> {
    let mut own: BTreeMap<&str, OfLog<'_>> = BTreeMap::new();
    let mut note = |what: &str, elsewhere: &[&str]| {
        if !elsewhere.is_empty() {
            notes.push(format!("to be {what}, as dataset.toml says, but not among these flights: {}", elsewhere.join(", ")));
        }
    };
    let mut elsewhere = Vec::new();
    for (rule, name) in schema.late_in.iter().flat_map(|rule| rule.flights.iter().map(move |name| (rule, name))) {
        match the_log(name, logs, "late_in.flights", is_of_these)? {
            Some(log) => own.entry(&logs[log].name).or_default().late.push(rule),
            None => elsewhere.push(name.as_str()),
        }
    }
    note("moved in time", &elsewhere);
    elsewhere.clear();
    for (rule, name) in schema.cuts.iter().flat_map(|rule| rule.flights.iter().map(move |name| (rule, name))) {
        match the_log(name, logs, "cut.flights", is_of_these)? {
            Some(log) => own.entry(&logs[log].name).or_default().cut_at_s.extend(&rule.at_s),
            None => elsewhere.push(name.as_str()),
        }
    }
    note("cut", &elsewhere);
    Ok(own)
}

/// Gives the logs that the description names the classes that it says.
fn classify(schema: &Schema, logs: &mut [Log], is_of_these: bool, notes: &mut Vec<String>) -> Result<()> {
    let mut elsewhere = Vec::new();
    for (name, class) in &schema.classes {
        match the_log(name, logs, "classes", is_of_these)? {
            Some(log) => logs[log].manoeuvre.clone_from(class),
            None => elsewhere.push(name.as_str()),
        }
    }
    if !elsewhere.is_empty() {
        notes.push(format!("of a class that dataset.toml says, but not among these flights: {}", elsewhere.join(", ")));
    }
    Ok(())
}

/// The log that a key of the description means by a name. One that is not there is an error if the description is of these logs.
fn the_log(name: &str, logs: &[Log], key: &str, is_of_these: bool) -> Result<Option<usize>> {
    let known = || logs.iter().map(|log| log.name.as_str());
    let fault = |found: &str, expected: String| Error::Config {
        place: "flights".into(),
        field: key.into(),
        found: format!("`{name}`, which {found}"),
        expected,
    };
    match names::matching(name, known()).as_slice() {
        [] if is_of_these => {
            let hint = did_you_mean(name, known().chain(known().map(names::own_name)));
            let listed = names::listed(known().collect::<Vec<_>>().into_iter());
            Err(fault("is no log of this data set", format!("one of {listed}{hint}")))
        }
        [] => Ok(None),
        [one] => Ok(known().position(|log| log == *one)),
        several => {
            let found = format!("{} logs are called", several.len());
            Err(fault(&found, "a log's path below the data folder, without the ending".into()))
        }
    }
}

/// The error with the description that the key stands in.
fn at(description: &Path, error: Error) -> Error {
    match error {
        Error::Config { field, found, expected, .. } => {
            Error::Config { place: description.display().to_string(), field, found, expected }
        }
        other => other,
    }
}

/// What two flights share only if all their numbers are the same.
fn fingerprint(flight: &Flight) -> u64 {
    let mut hasher = DefaultHasher::new();
    flight.step_s.to_bits().hash(&mut hasher);
    flight.canonical().iter().for_each(|value| value.to_bits().hash(&mut hasher));
    for (name, values) in &flight.extra {
        name.hash(&mut hasher);
        values.iter().for_each(|value| value.to_bits().hash(&mut hasher));
    }
    hasher.finish()
}

/// Flights beyond what a set may hold in memory go to temporary files at once.
fn sparing(done: Assembled, held: &AtomicUsize) -> Assembled {
    let place = |flight: Flight| {
        let bytes = size_of_val(flight.canonical().as_slice().unwrap_or_default());
        if held.fetch_add(bytes, Ordering::Relaxed) + bytes <= LARGEST_HELD { flight } else { flight.out_of_memory() }
    };
    Assembled { flights: done.flights.into_iter().map(place).collect(), ..done }
}

#[cfg(feature = "rayon")]
fn in_parallel<T: Send>(logs: &[Log], read: impl Fn(&Log) -> T + Send + Sync) -> Vec<T> {
    use rayon::prelude::*;
    logs.par_iter().with_max_len(1).map(read).collect()
}

#[cfg(not(feature = "rayon"))]
fn in_parallel<T>(logs: &[Log], read: impl Fn(&Log) -> T) -> Vec<T> {
    logs.iter().map(read).collect()
}

/// The description in the folder, or else in the one above it (a class folder or a log of a described set).
fn description(folder: &Path) -> Option<PathBuf> {
    let above = std::path::absolute(folder).ok()?.parent().map(|above| above.join(DESCRIPTION));
    [Some(folder.join(DESCRIPTION)), above].into_iter().flatten().find(|path| path.is_file())
}
