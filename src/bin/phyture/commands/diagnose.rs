//! `diagnose` and `loop`: which physical effect is missing; and the same with adding and calibrating until nothing is left.

use super::compare::{DATA_NOTE, write_page};
use super::predict::read_network;
use super::{CHECK_FAILED, Context, data_sha256};
use crate::arguments::{Data, Division};
use phyture::critique::check;
use phyture::critique::diagnose::{self, Amended, Diagnosis, Options, Outcome, Verdict, calibrated, searched, sentences};
use phyture::critique::table::significant;
use phyture::critique::wrap::wrapped;
use phyture::disk::{Target, append_lines};
use phyture::flight::split::{Part, Split};
use phyture::flight::{Column, DataSet, Flight, Span};
use phyture::hybrid::network_target;
use phyture::physics::{Entry, Model};
use phyture::report::{DiagnoseReport, diagnose_page};
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Most windows of a network with a short history that are evaluated when its output is searched; a long one costs ten times as much.
const MOST_WINDOWS: usize = 100_000;
/// A history of at most this many rows is short.
const SHORT_HISTORY: usize = 256;

/// Flights, and what may be searched of them.
pub struct Task<'a> {
    /// Flights.
    pub set: &'a DataSet,
    /// What is searched and what only confirms.
    pub split: &'a Split,
    /// Hash of the files.
    pub data_sha256: String,
    /// How to search.
    pub options: Options,
}

impl Task<'_> {
    /// Searches once.
    pub fn diagnose(&self, model: &Model) -> Result<Outcome> {
        let (searched, locked) = (searched(self.split), &self.split.test);
        let mut outcome = diagnose::diagnose(&self.set.flights, model, &searched, locked, self.split.tested.name(), &self.options)?;
        outcome.diagnosis.data_sha256.clone_from(&self.data_sha256);
        Ok(outcome)
    }
}

/// The verdict where the log is not what the program takes it for.
fn convention_fault(summary: String, data_sha256: String) -> Diagnosis {
    Diagnosis { data_sha256, ..Diagnosis::nothing(Verdict::ConventionFault, summary) }
}

/// A folder for a page and what stands in it besides the diagnosis.
struct Paper<'a> {
    title: String,
    target: &'a Target,
    provenance: Vec<(String, String)>,
}

/// The page of `diagnose` and of `loop`.
const PAGE: &str = "diagnosis.html";

impl<'a> Paper<'a> {
    fn new(context: &Context, command: &str, data: &Data, model: &Model, target: &'a Target) -> Self {
        let provenance = [
            ("command", command.to_owned()),
            ("data", data.data.display().to_string()),
            ("model", model.name.clone()),
            ("seed", context.seed().to_string()),
        ];
        let name = data.data.file_name().unwrap_or(data.data.as_os_str()).to_string_lossy();
        Self {
            title: format!("Which physics is missing: {} on {name}", model.name),
            target,
            provenance: provenance.map(|(what, value)| (what.to_owned(), value)).into(),
        }
    }

    /// Notes of the reader, each a line of provenance.
    fn note(&mut self, notes: &[String]) {
        self.provenance.extend(notes.iter().map(|note| (DATA_NOTE.to_owned(), note.clone())));
    }

    /// Writes the page.
    fn write(
        &self,
        context: &Context,
        diagnoses: &[Diagnosis],
        flights: &[Flight],
        split: &Split,
        models: [&Model; 2],
    ) -> Result<()> {
        let searched = searched(split);
        let [before, after] = models;
        let report = DiagnoseReport {
            title: &self.title,
            diagnoses,
            flights,
            searched: &searched,
            locked: &split.test,
            before,
            after,
            provenance: &self.provenance,
        };
        write_page(&diagnose_page(&report)?, self.target)?;
        context.say(format!("report: {}", self.target.path().display()));
        Ok(())
    }
}

/// Reads and checks the flights and divides them. `None` after a convention fault, which is reported.
fn prepare(
    context: &Context,
    data: &Data,
    model: &Model,
    division: &Division,
    paper: &mut Option<Paper<'_>>,
) -> Result<Option<(DataSet, Split, String)>> {
    let set = context.flights(data, 1)?;
    paper.iter_mut().for_each(|paper| paper.note(&set.notes));
    let sha = data_sha256(&set);
    let report = check::check(&set, Some(model));
    if report.fault {
        // The notes on the data have been said, and folded.
        context.say(format!("\n{}", check::CheckReport { notes: Vec::new(), ..report.clone() }));
        let faults = report.findings.iter().filter(|finding| finding.verdict == check::Verdict::Fault);
        let notes = faults.map(|finding| match &finding.set {
            Some(set) => format!("{}; set {set}", finding.message),
            None => finding.message.clone(),
        });
        let diagnosis = Diagnosis { notes: notes.collect(), ..convention_fault(report.summary.clone(), sha) };
        if let Some(paper) = &paper {
            let split = Split { training: Vec::new(), validation: Vec::new(), test: Vec::new(), tested: Part::Test };
            paper.write(context, std::slice::from_ref(&diagnosis), &set.flights, &split, [model, model])?;
        }
        context.json(&diagnosis)?;
        return Ok(None);
    }
    context.say(wrapped("check: ", &report.summary));
    let split = context.search_split(&set.flights, model, division)?;
    Ok(Some((set, split, sha)))
}

/// What `diagnose` was asked for.
pub struct Wanted<'a> {
    /// Model file.
    pub model: Option<&'a Path>,
    /// Run folder: search what its network learned.
    pub of_network: Option<&'a Path>,
    /// Folder for the page.
    pub report: Option<&'a Path>,
    /// Most effects to name.
    pub max_effects: usize,
}

/// `diagnose`.
pub fn run(context: &Context, data: &Data, wanted: &Wanted<'_>, division: &Division) -> Result<ExitCode> {
    let hybrid = wanted.of_network.map(read_network).transpose()?;
    let model = match (&hybrid, wanted.model) {
        (Some(hybrid), None) => hybrid.description().model.clone(),
        (_, model) => context.model(model, data)?,
    };
    let target = wanted.report.map(|folder| context.new_page(folder, PAGE)).transpose()?;
    let mut paper = target.as_ref().map(|target| Paper::new(context, "diagnose", data, &model, target));
    let Some((mut set, mut split, data_sha256)) = prepare(context, data, &model, division, &mut paper)? else {
        return Ok(ExitCode::from(CHECK_FAILED));
    };
    if let Some(hybrid) = hybrid {
        let samples: usize = set.flights.iter().map(Flight::len).sum();
        let affordable = if hybrid.description().config.history() <= SHORT_HISTORY { MOST_WINDOWS } else { MOST_WINDOWS / 10 };
        let stride = samples.div_ceil(affordable).max(1);
        context.say(format!(
            "searching what the network learned, in place of the measured accelerations: every {stride}{} sample",
            if stride == 1 { "st" } else { "th" }
        ));
        let whole: Vec<Span> =
            set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
        let target = network_target(&hybrid, &set.flights, &whole, stride, context.threads())?;
        split = Split {
            training: target.spans(&split.training),
            validation: target.spans(&split.validation),
            test: target.spans(&split.test),
            tested: split.tested,
        };
        set = target.set;
    }
    let options = Options { max_effects: wanted.max_effects, seed: context.seed(), ..Options::default() };
    let task = Task { set: &set, split: &split, data_sha256, options };
    let outcome = task.diagnose(&model)?;
    context.say(format!("\n{}", told(context, &outcome.diagnosis)));
    if let Some(paper) = paper {
        let before = calibrated(&model, &set.flights, &split)?;
        let after = if outcome.diagnosis.accepted.is_empty() { &before } else { &outcome.model };
        paper.write(context, std::slice::from_ref(&outcome.diagnosis), &set.flights, &split, [&before, after])?;
    }
    context.json(&outcome.diagnosis)?;
    Ok(ExitCode::SUCCESS)
}

/// A diagnosis as text: in short, or with every effect that was tried.
fn told(context: &Context, diagnosis: &Diagnosis) -> String {
    if context.is_verbose() { format!("{diagnosis:#}") } else { diagnosis.to_string() }
}

/// What the loop did to the errors that no search has seen, by channel.
fn before_and_after(before: [f64; 6], after: [f64; 6], on: &str, added: &[&str]) -> String {
    let row = |name: &str, cells: [String; 6]| format!("  {name:<18}{}", cells.map(|cell| format!("{cell:>10}")).concat());
    let numbers = |values: [f64; 6]| values.map(|value| significant(value, 4));
    let change: [String; 6] = std::array::from_fn(|channel| {
        let percent = 100.0 * (after[channel] / before[channel] - 1.0);
        // What rounds to nothing has no sign.
        if percent.abs() < 0.05 { "0.0 %".into() } else { format!("{percent:+.1} %") }
    });
    let what = if added.is_empty() { "nothing was added".to_owned() } else { format!("added: {}", added.join(", ")) };
    [
        wrapped("", &format!("RMSE on {on}; {what}")),
        row("", Column::TARGETS.map(|column| column.name().to_owned())),
        row("", Column::TARGETS.map(|column| column.unit().to_owned())),
        row("before", numbers(before)),
        row("after", numbers(after)),
        row("change", change),
    ]
    .join("\n")
}

/// One line of the ledger.
#[derive(Serialize)]
struct LedgerLine<'a> {
    round: usize,
    effect: &'a str,
    coefficients: &'a [phyture::critique::diagnose::Number],
    parameters: &'a [phyture::critique::diagnose::ParameterValue],
    selection_frequency: f64,
    indistinguishable: &'a [String],
    p_value: f64,
    rmse_locked: Option<phyture::critique::PerChannel>,
    data_sha256: &'a str,
    version: &'a str,
}

/// What `loop --json` writes.
#[derive(Serialize)]
struct LoopOutput {
    rounds: Vec<Diagnosis>,
    model: PathBuf,
}

/// Diagnoses, adds and calibrates until nothing worthwhile is left; appends to the ledger.
pub fn amend(context: &Context, task: &Task<'_>, model: &Model, ledger: &Path) -> Result<Amended> {
    diagnose::amend(&task.set.flights, model, task.split, &task.options, &mut |round, diagnosis| {
        diagnosis.data_sha256.clone_from(&task.data_sha256);
        context.say(format!("\nRound {round}\n{}", told(context, diagnosis)));
        if diagnosis.is_confirmed() {
            append(ledger, round, diagnosis)?;
        }
        Ok(())
    })
}

/// Adds lines at the end of the ledger and never changes what is there. A round that a killed run has written stands in it once.
fn append(ledger: &Path, round: usize, diagnosis: &Diagnosis) -> Result<()> {
    let mut lines = Vec::new();
    for (index, step) in diagnosis.steps.iter().enumerate() {
        let line = LedgerLine {
            round,
            effect: &step.effect,
            coefficients: &step.coefficients,
            parameters: &step.parameters,
            selection_frequency: step.selection_frequency,
            indistinguishable: &step.indistinguishable,
            p_value: step.p_value,
            rmse_locked: diagnosis.locked.as_ref().and_then(|locked| locked.waterfall.get(index + 1).copied()),
            data_sha256: &diagnosis.data_sha256,
            version: &diagnosis.version,
        };
        lines.push(serde_json::to_string(&line).map_err(|error| Error::Undetermined(error.to_string()))?);
    }
    append_lines(ledger, &lines)
}

/// `loop`.
pub fn run_loop(
    context: &Context,
    data: &Data,
    model: Option<&Path>,
    output: &Path,
    report: Option<&Path>,
    division: &Division,
) -> Result<ExitCode> {
    let target = context.new_file(output, model.as_slice())?;
    let page = report.map(|folder| context.new_page(folder, PAGE)).transpose()?;
    let model = context.model(model, data)?;
    let mut paper = page.as_ref().map(|page| Paper::new(context, "loop", data, &model, page));
    let Some((set, split, data_sha256)) = prepare(context, data, &model, division, &mut paper)? else {
        return Ok(ExitCode::from(CHECK_FAILED));
    };
    let options = Options { seed: context.seed(), ..Options::default() };
    let task = Task { set: &set, split: &split, data_sha256: data_sha256.clone(), options };
    let ledger = output.with_extension("ledger.jsonl");
    let before = calibrated(&model, &set.flights, &split)?;
    let Amended { rounds, mut model } = amend(context, &task, &model, &ledger)?;
    model.data.locked.extend(division.lock.iter().filter(|name| !model.data.locked.contains(name)).cloned().collect::<Vec<_>>());
    model.provenance.insert("data_sha256".into(), Entry::Text(data_sha256));
    model.provenance.insert("seed".into(), Entry::Text(context.seed().to_string()));
    model.provenance.insert("version".into(), Entry::Text(env!("CARGO_PKG_VERSION").into()));
    model.write(context.ready(&target)?)?;
    let added: Vec<&str> =
        rounds.iter().filter(|round| round.is_confirmed()).flat_map(|round| &round.accepted).map(String::as_str).collect();
    if let Some(locked) = rounds.iter().find_map(|round| round.locked.as_ref()) {
        let errors = |model: &Model| model.rmse(&set.flights, &split.test);
        let on = sentences::unseen(locked.kept, locked.duration_s);
        context.say(format!("\n{}", before_and_after(errors(&before)?, errors(&model)?, &on, &added)));
    }
    // There is a ledger once something was added to the model.
    let beside = if ledger.exists() { format!(", ledger {}", ledger.display()) } else { String::new() };
    context.say(format!("\nmodel written to {}{beside}", output.display()));
    if let Some(paper) = paper {
        let after = if rounds.iter().any(Diagnosis::is_confirmed) { &model } else { &before };
        paper.write(context, &rounds, &set.flights, &split, [&before, after])?;
    }
    context.json(&LoopOutput { rounds, model: output.into() })?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_ends_with_what_it_changed() {
        let before = [0.30, 0.30, 0.40, 1.74, 1.55, 0.68];
        let after = [0.30, 0.30, 0.36, 0.33, 0.33, 0.70];
        let text = before_and_after(before, after, "120 s of flights that no search has seen", &["cyclic_lag", "weathercock"]);
        assert!(text.starts_with("RMSE on 120 s of flights that no search has seen; added: cyclic_lag, weathercock"), "{text}");
        assert!(text.contains("-81.0 %") && text.contains("+2.9 %") && text.contains("     0.0 %"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
        assert!(before_and_after(before, before, "x", &[]).contains("nothing was added"));
    }
}
