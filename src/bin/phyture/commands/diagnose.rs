//! `diagnose` and `loop`: which physical effect is missing; and the same with adding and calibrating until nothing is left.

use super::compare::{DATA_NOTE, write_page};
use super::predict::read_network;
use super::{CHECK_FAILED, explainable};
use crate::arguments::{Data, Division, count};
use crate::context::{Context, data_sha256};
use phyture::critique::check;
use phyture::critique::diagnose::{self, Amended, Diagnosis, LoopText, Options, Outcome, Verdict, calibrated, searched};
use phyture::critique::floor_of_spans;
use phyture::critique::wrap::wrapped;
use phyture::disk::{Target, append_lines};
use phyture::flight::split::{Part, Split};
use phyture::flight::{DataSet, Flight, Span};
use phyture::hybrid::network_target;
use phyture::physics::Model;
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
    /// The explainable part of the flights, where it is known.
    pub explainable: Option<Vec<Flight>>,
}

impl Task<'_> {
    /// Searches once.
    pub fn diagnose(&self, model: &Model) -> Result<Outcome> {
        let (searched, locked) = (searched(self.split), &self.split.test);
        let mut outcome = diagnose::diagnose(&self.set.flights, model, &searched, locked, self.split.tested.name(), &self.options)?;
        self.label(&mut outcome.diagnosis)?;
        diagnose::weigh(&mut outcome.diagnosis, &self.set.flights, &outcome.model, self.split)?;
        Ok(outcome)
    }

    /// Notes what the search does not know: the hash of the files and the floor.
    fn label(&self, diagnosis: &mut Diagnosis) -> Result<()> {
        diagnosis.data_sha256.clone_from(&self.data_sha256);
        if let (Some(locked), Some(explainable)) = (&mut diagnosis.locked, &self.explainable) {
            locked.set_floor(floor_of_spans(&self.set.flights, &locked.spans, explainable)?);
        }
        Ok(())
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

    /// Writes the page: of one diagnosis, or of the rounds of a loop and those together.
    fn write(
        &self,
        context: &Context,
        [diagnoses, together]: [&[Diagnosis]; 2],
        flights: &[Flight],
        split: &Split,
        models: [&Model; 2],
    ) -> Result<()> {
        let searched = searched(split);
        let [before, after] = models;
        let report = DiagnoseReport {
            title: &self.title,
            diagnoses,
            together: together.first(),
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
            paper.write(context, [std::slice::from_ref(&diagnosis), &[]], &set.flights, &split, [model, model])?;
        }
        context.json(&diagnosis)?;
        return Ok(None);
    }
    context.say(wrapped("check: ", &report.summary));
    let split = context.search_split(&set.flights, model, division)?;
    Ok(Some((set, split, sha)))
}

/// Effects that a search names, at most.
const MOST_EFFECTS: usize = 100;

/// Which physical effect is missing, and how sure that is; exit code 3 on a convention fault
///
/// Effects that are found are one list, the largest first, each with what of the error on flights that no search has seen would come
/// back if it alone were taken away.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture diagnose flights -m n9.toml --report report --json diagnosis.json\n  phyture diagnose flights -m n9.toml --explainable floor     # simulated flights: how much could be removed at all"
)]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]; effects switched off in it are tried too
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Search what a trained network learned (a run folder), in place of the measured accelerations; the run's model unless one is given
    #[arg(long, value_name = "RUN")]
    pub of_network: Option<PathBuf>,
    /// Folder for the page diagnosis.html
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Stop after so many effects, one found after the other; without it, where much is missing, all effects that apply are fitted at once
    /// and the needless left out
    #[arg(long, allow_negative_numbers = true, value_parser = count(1..=MOST_EFFECTS))]
    pub max_effects: Option<usize>,
    /// Explainable part of simulated flights, as `simulate --explainable` writes it: shows the floor of the error on flights that no search
    /// has seen, and how much of what lies above it the effects remove
    #[arg(long, value_name = "DIR", conflicts_with = "of_network")]
    pub explainable: Option<PathBuf>,
    /// What is searched and what only confirms.
    #[command(flatten)]
    pub division: Division,
}

/// The explainable part of the flights, where there is one and something is kept to judge on.
fn read_explainable(data: &Data, folder: Option<&Path>, split: &Split) -> Result<Option<Vec<Flight>>> {
    folder.filter(|_| !split.test.is_empty()).map(|folder| explainable::read(data, folder)).transpose()
}

/// `diagnose`.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let Args { data, division, explainable: truth, .. } = wanted;
    let truth = truth.as_deref();
    let hybrid = wanted.of_network.as_deref().map(read_network).transpose()?;
    let model = match (&hybrid, wanted.model.as_deref()) {
        (Some(hybrid), None) => hybrid.description().model.clone(),
        (_, model) => context.model(model, data)?,
    };
    truth.map_or(Ok(()), |folder| explainable::apart(data, folder))?;
    let target = wanted.report.as_deref().map(|folder| context.new_page(folder, PAGE)).transpose()?;
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
    let explainable = read_explainable(data, truth, &split)?;
    let task = Task { set: &set, split: &split, data_sha256, options, explainable };
    let outcome = task.diagnose(&model)?;
    context.say(format!("\n{}", told(context, &outcome.diagnosis)));
    if let Some(paper) = paper {
        let before = calibrated(&model, &set.flights, &split)?;
        let after = if outcome.diagnosis.accepted.is_empty() { &before } else { &outcome.model };
        paper.write(context, [std::slice::from_ref(&outcome.diagnosis), &[]], &set.flights, &split, [&before, after])?;
    }
    context.json(&outcome.diagnosis)?;
    Ok(ExitCode::SUCCESS)
}

/// A diagnosis as text: in short, or with every effect that was tried.
fn told(context: &Context, diagnosis: &Diagnosis) -> String {
    if context.is_verbose() { format!("{diagnosis:#}") } else { diagnosis.to_string() }
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
    /// The rounds as one: what was added, what it is worth, the errors before and after.
    together: Diagnosis,
    model: PathBuf,
    /// There is one once something was added to a model.
    ledger: Option<PathBuf>,
}

/// Diagnoses, adds and calibrates until nothing worthwhile is left; appends to the ledger. A round by itself is told only in the verbose
/// text; what all found is the caller's to tell (see [`told_together`]).
pub fn amend(context: &Context, task: &Task<'_>, model: &Model, ledger: &Path) -> Result<Amended> {
    diagnose::amend(&task.set.flights, model, task.split, &task.options, &mut |round, diagnosis| {
        task.label(diagnosis)?;
        if context.is_verbose() {
            context.say(format!("\nRound {round}\n{diagnosis:#}"));
        } else {
            context.say(progress(diagnosis));
        }
        if diagnosis.is_confirmed() {
            append(ledger, round, diagnosis)?;
        }
        Ok(())
    })
}

/// One line for a search of minutes; its findings are told once all are known.
fn progress(diagnosis: &Diagnosis) -> String {
    let found = match diagnosis.accepted.len() {
        0 => "nothing more".to_owned(),
        1 => "1 effect".to_owned(),
        count => format!("{count} effects"),
    };
    let next = if diagnosis.is_confirmed() { "; added, and searched on" } else { "" };
    format!("search: {found} found in {:.1} s{next}", diagnosis.seconds)
}

/// The rounds of a loop as one diagnosis, which is told: all effects as one list, and what they did to the errors. `before` is the model as
/// it was given, calibrated.
pub fn told_together(context: &Context, task: &Task<'_>, before: &Model, amended: &Amended) -> Result<Diagnosis> {
    let mut together = diagnose::together(&task.set.flights, before, amended, task.split)?;
    task.label(&mut together)?;
    let text = LoopText(&together);
    let text = if context.is_verbose() { format!("{text:#}") } else { text.to_string() };
    context.say(format!("\n{}", text.trim_end()));
    Ok(together)
}

/// Adds lines at the end of the ledger and never changes what is there. A round that a killed run has written stands in it once.
fn append(ledger: &Path, round: usize, diagnosis: &Diagnosis) -> Result<()> {
    let mut lines = Vec::new();
    for step in &diagnosis.steps {
        let line = LedgerLine {
            round,
            effect: &step.effect,
            coefficients: &step.coefficients,
            parameters: &step.parameters,
            selection_frequency: step.selection_frequency,
            indistinguishable: &step.indistinguishable,
            p_value: step.p_value,
            rmse_locked: diagnosis
                .locked
                .as_ref()
                .and_then(|locked| locked.waterfall.iter().find(|bar| bar.added.contains(&step.effect)))
                .map(|bar| bar.rmse),
            data_sha256: &diagnosis.data_sha256,
            version: &diagnosis.version,
        };
        lines.push(serde_json::to_string(&line).map_err(|error| Error::Undetermined(error.to_string()))?);
    }
    append_lines(ledger, &lines)
}

/// Diagnose, add, calibrate, until nothing worthwhile is left; appends to a ledger beside the model
///
/// All effects that were added are one list, the largest first; the errors before and after, by channel, are the last table. Every round by
/// itself is in the JSON, in the page and, with --verbose, in the text.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture loop flights -m n9.toml -o n9-amended.toml --report report\n  phyture loop flights -m n9.toml -o n9-amended.toml --explainable floor     # simulated flights"
)]
pub struct LoopArgs {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Model file to write; the ledger is beside it, ending in `.ledger.jsonl`
    #[arg(short, long)]
    pub output: PathBuf,
    /// Folder for the page diagnosis.html
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Explainable part of simulated flights, as `simulate --explainable` writes it: shows the floor of the error on flights that no search
    /// has seen, and how much of what lies above it the effects remove
    #[arg(long, value_name = "DIR")]
    pub explainable: Option<PathBuf>,
    /// What is searched and what only confirms.
    #[command(flatten)]
    pub division: Division,
}

/// `loop`.
pub fn run_loop(context: &Context, wanted: &LoopArgs) -> Result<ExitCode> {
    let LoopArgs { data, output, division, .. } = wanted;
    let (model, truth) = (wanted.model.as_deref(), wanted.explainable.as_deref());
    let target = context.new_file(output, model.as_slice())?;
    let page = wanted.report.as_deref().map(|folder| context.new_page(folder, PAGE)).transpose()?;
    truth.map_or(Ok(()), |folder| explainable::apart(data, folder))?;
    let model = context.model(model, data)?;
    let mut paper = page.as_ref().map(|page| Paper::new(context, "loop", data, &model, page));
    let Some((set, split, data_sha256)) = prepare(context, data, &model, division, &mut paper)? else {
        return Ok(ExitCode::from(CHECK_FAILED));
    };
    let options = Options { seed: context.seed(), ..Options::default() };
    let explainable = read_explainable(data, truth, &split)?;
    let task = Task { set: &set, split: &split, data_sha256: data_sha256.clone(), options, explainable };
    let ledger = output.with_extension("ledger.jsonl");
    let before = calibrated(&model, &set.flights, &split)?;
    let mut amended = amend(context, &task, &model, &ledger)?;
    let model = &mut amended.model;
    model.data.locked.extend(division.lock.iter().filter(|name| !model.data.locked.contains(name)).cloned().collect::<Vec<_>>());
    model.note_source(&set.source, context.seed());
    // Before anything else is measured: what the search found is then safe.
    model.write(context.ready(&target)?)?;
    let together = told_together(context, &task, &before, &amended)?;
    context.say(format!("\nmodel written to {}", output.display()));
    let ledger = ledger.exists().then_some(ledger);
    if let Some(ledger) = &ledger {
        context.say(wrapped("ledger: ", &written(ledger, &amended.rounds)));
    }
    if let Some(paper) = paper {
        let after = if amended.rounds.iter().any(Diagnosis::is_confirmed) { &amended.model } else { &before };
        let told = [amended.rounds.as_slice(), std::slice::from_ref(&together)];
        paper.write(context, told, &set.flights, &split, [&before, after])?;
    }
    context.json(&LoopOutput { rounds: amended.rounds, together, model: output.into(), ledger })?;
    Ok(ExitCode::SUCCESS)
}

/// `amended.ledger.jsonl: a line for each effect, in order of acceptance: wind, drag`.
fn written(ledger: &Path, rounds: &[Diagnosis]) -> String {
    let steps = rounds.iter().filter(|round| round.is_confirmed()).flat_map(|round| &round.steps);
    let mut names: Vec<&str> = Vec::new();
    steps.map(|step| step.effect.as_str()).for_each(|name| {
        if !names.contains(&name) {
            names.push(name)
        }
    });
    let what = match names.as_slice() {
        [] => "nothing added; what it holds is of an earlier run".to_owned(),
        [one] => format!("a line for {one}"),
        many => format!("a line for each effect, in order of acceptance: {}", many.join(", ")),
    };
    format!("{}, {what}", ledger.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture::critique::diagnose::{Locked, Step};

    fn round(effects: &[&str], confirmed: bool) -> Diagnosis {
        let step = |effect: &&str| Step { effect: (*effect).into(), channels: vec!["vx_dot".into()], ..Step::default() };
        let fall = if confirmed { [0.4, 0.3, 0.5] } else { [0.0, -0.1, 0.1] };
        Diagnosis {
            accepted: effects.iter().map(|effect| (*effect).to_owned()).collect(),
            steps: effects.iter().map(step).collect(),
            locked: Some(Locked { mse_fall: [("vx_dot".to_owned(), fall)].into(), ..Locked::default() }),
            seconds: 2.04,
            ..Diagnosis::nothing(Verdict::EffectsMissing, String::new())
        }
    }

    #[test]
    fn a_search_is_a_line_and_the_ledger_names_what_was_added_in_order() {
        let rounds = [round(&["wind", "drag"], true), round(&["lag"], true), round(&["chance"], false)];
        assert_eq!(progress(&rounds[0]), "search: 2 effects found in 2.0 s; added, and searched on");
        assert_eq!(progress(&rounds[2]), "search: 1 effect found in 2.0 s");
        assert_eq!(progress(&round(&[], false)), "search: nothing more found in 2.0 s");
        let said = written(Path::new("a.ledger.jsonl"), &rounds);
        assert_eq!(said, "a.ledger.jsonl, a line for each effect, in order of acceptance: wind, drag, lag");
        let again = [round(&["wind", "drag"], true), round(&["lag", "wind"], true)];
        assert!(written(Path::new("l"), &again).ends_with(": wind, drag, lag"), "one that a later search names again");
        assert_eq!(written(Path::new("l"), &rounds[1..]), "l, a line for lag");
        assert!(written(Path::new("l"), &rounds[2..]).contains("of an earlier run"));
    }
}
