//! `diagnose` and `loop`: which physical effect is missing; and the same with adding and calibrating until nothing is left.

use super::{CHECK_FAILED, explainable};
use crate::arguments::{Data, Division, count};
use crate::context::{Context, data_sha256, interruption};
use crate::following::followed;
use crate::pages::{Outlet, Pages};
use phyture::critique::check;
use phyture::critique::diagnose::{Amended, Diagnosis, LoopText, Options, calibrated, searched};
use phyture::critique::wrap::wrapped;
use phyture::flight::split::{Part, Split};
use phyture::flight::{DataSet, Flight};
use phyture::physics::Model;
use phyture::report::{DiagnoseReport, diagnose_page};
use phyture::workflow::{Looped, SearchTask, append_to_ledger, convention_fault, network_search, provenance, read_network};
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// The page of a diagnosis: where it goes, and what stands in it besides.
struct DiagnosisPage {
    title: String,
    outlet: Outlet,
    command: &'static str,
    model: String,
    seed: u64,
    /// Known once the flights are read.
    provenance: Vec<(String, String)>,
}

/// Its name, for `diagnose` and `loop`.
const PAGE: &str = "diagnosis.html";

impl DiagnosisPage {
    fn new(context: &Context, command: &'static str, data: &Data, model: &Model, outlet: Outlet) -> Self {
        let name = data.data.file_name().unwrap_or(data.data.as_os_str()).to_string_lossy();
        Self {
            title: format!("Which physics is missing: {} on {name}", model.name),
            outlet,
            provenance: Vec::new(),
            command,
            seed: context.seed(),
            model: model.name.clone(),
        }
    }

    /// Notes where the flights come from.
    fn note(&mut self, data: &Data, set: &DataSet) {
        self.provenance = provenance(self.command, &data.data, set, &[&self.model], self.seed);
    }

    /// Writes the page: of one diagnosis, or of the rounds of a loop and those together.
    fn write(
        self,
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
            compared: None,
            provenance: &self.provenance,
        };
        self.outlet.write(context, &diagnose_page(&report)?)
    }
}

/// Reads and checks the flights and divides them. `None` after a convention fault, which is reported.
fn prepare(
    context: &Context,
    data: &Data,
    model: &Model,
    division: &Division,
    page: &mut Option<DiagnosisPage>,
) -> Result<Option<(DataSet, Split, String)>> {
    let set = context.flights(data, 1)?;
    page.iter_mut().for_each(|page| page.note(data, &set));
    let sha = data_sha256(&set);
    let report = check::check(&set, Some(model));
    if report.fault {
        // The notes on the data have been said, and folded.
        context.say(format!("\n{}", check::CheckReport { notes: Vec::new(), ..report.clone() }));
        let diagnosis = convention_fault(&report, sha);
        if let Some(page) = page.take() {
            let split = Split { training: Vec::new(), validation: Vec::new(), test: Vec::new(), tested: Part::Test };
            page.write(context, [std::slice::from_ref(&diagnosis), &[]], &set.flights, &split, [model, model])?;
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
    /// The page diagnosis.html.
    #[command(flatten)]
    pub pages: Pages,
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
    let outlet = wanted.pages.open(context, PAGE)?;
    let mut page = outlet.map(|outlet| DiagnosisPage::new(context, "diagnose", data, &model, outlet));
    let Some((mut set, mut split, data_sha256)) = prepare(context, data, &model, division, &mut page)? else {
        return Ok(ExitCode::from(CHECK_FAILED));
    };
    if let Some(hybrid) = hybrid {
        let found = network_search(&hybrid, &set, &split, context.threads())?;
        context.say(format!(
            "searching what the network learned, in place of the measured accelerations: every {}{} sample",
            found.stride,
            if found.stride == 1 { "st" } else { "th" }
        ));
        (set, split) = (found.set, found.split);
    }
    let options = Options { max_effects: wanted.max_effects, seed: context.seed(), ..Options::default() };
    let explainable = read_explainable(data, truth, &split)?;
    let task = SearchTask { set: &set, split: &split, data_sha256, options, explainable };
    let outcome = followed("search", &task.options.watch, &*interruption()?, |_| task.diagnose(&model))?;
    context.say(format!("\n{}", told(context, &outcome.diagnosis)));
    if let Some(page) = page {
        let before = calibrated(&model, &set.flights, &split)?;
        let after = if outcome.diagnosis.accepted.is_empty() { &before } else { &outcome.model };
        page.write(context, [std::slice::from_ref(&outcome.diagnosis), &[]], &set.flights, &split, [&before, after])?;
    }
    context.json(&outcome.diagnosis)?;
    Ok(ExitCode::SUCCESS)
}

/// A diagnosis as text: in short, or with every effect that was tried.
fn told(context: &Context, diagnosis: &Diagnosis) -> String {
    if context.is_verbose() { format!("{diagnosis:#}") } else { diagnosis.to_string() }
}

/// Diagnoses, adds and calibrates until nothing worthwhile is left; appends to the ledger. A round by itself is told only in the verbose
/// text; what all found is the caller's to tell (see [`told_together`]).
pub fn amend(context: &Context, task: &SearchTask<'_>, model: &Model, ledger: &Path, interrupted: &AtomicBool) -> Result<Amended> {
    followed("search", &task.options.watch, interrupted, |line| {
        task.amend(model, &mut |round, diagnosis| {
            let said = if context.is_verbose() { format!("\nRound {round}\n{diagnosis:#}") } else { progress(diagnosis) };
            line.aside(|| context.say(said));
            if diagnosis.is_confirmed() {
                append_to_ledger(ledger, round, diagnosis)?;
            }
            Ok(())
        })
    })
}

/// After a loop that was stopped there is nothing more to do: what it had found is in the model file that was written.
///
/// # Errors
/// [`Error::Interrupted`] if it was.
pub fn not_stopped(amended: &Amended, written: &Path) -> Result<()> {
    let saved = || format!("what was found before is in {}; it has not been searched for more", written.display());
    if amended.stopped { Err(Error::Interrupted { saved: saved() }) } else { Ok(()) }
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
pub fn told_together(context: &Context, task: &SearchTask<'_>, before: &Model, amended: &Amended) -> Result<Diagnosis> {
    let together = task.together(before, amended)?;
    let text = LoopText(&together);
    let text = if context.is_verbose() { format!("{text:#}") } else { text.to_string() };
    context.say(format!("\n{}", text.trim_end()));
    Ok(together)
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
    /// The page diagnosis.html.
    #[command(flatten)]
    pub pages: Pages,
    /// Explainable part of simulated flights, as `simulate --explainable` writes it: shows the floor of the error on flights that no search
    /// has seen, and how much of what lies above it the effects remove
    #[arg(long, value_name = "DIR")]
    pub explainable: Option<PathBuf>,
    /// Add formulas as well that the rest of the error suggests, where flights that no search has seen bear them out: no physics with a name,
    /// and to be looked at before they are flown
    #[arg(long)]
    pub formulas: bool,
    /// What is searched and what only confirms.
    #[command(flatten)]
    pub division: Division,
}

/// `loop`.
pub fn run_loop(context: &Context, wanted: &LoopArgs) -> Result<ExitCode> {
    let LoopArgs { data, output, division, .. } = wanted;
    let (model, truth) = (wanted.model.as_deref(), wanted.explainable.as_deref());
    let target = context.new_file(output, model.as_slice())?;
    let outlet = wanted.pages.open(context, PAGE)?;
    truth.map_or(Ok(()), |folder| explainable::apart(data, folder))?;
    let model = context.model(model, data)?;
    let mut page = outlet.map(|outlet| DiagnosisPage::new(context, "loop", data, &model, outlet));
    let Some((set, split, data_sha256)) = prepare(context, data, &model, division, &mut page)? else {
        return Ok(ExitCode::from(CHECK_FAILED));
    };
    let options = Options { seed: context.seed(), formulas: wanted.formulas, ..Options::default() };
    let explainable = read_explainable(data, truth, &split)?;
    let task = SearchTask { set: &set, split: &split, data_sha256: data_sha256.clone(), options, explainable };
    let ledger = output.with_extension("ledger.jsonl");
    let before = calibrated(&model, &set.flights, &split)?;
    let mut amended = amend(context, &task, &model, &ledger, &*interruption()?)?;
    let model = &mut amended.model;
    division.wanted().note(model);
    model.note_source(&set.source, context.seed());
    // Before anything else is measured: what the search found is then safe.
    model.write(context.ready(&target)?)?;
    not_stopped(&amended, output)?;
    let together = told_together(context, &task, &before, &amended)?;
    context.say(format!("\nmodel written to {}", output.display()));
    let ledger = ledger.exists().then_some(ledger);
    if let Some(ledger) = &ledger {
        context.say(wrapped("ledger: ", &written(ledger, &amended.rounds)));
    }
    if let Some(page) = page {
        let after = if amended.rounds.iter().any(Diagnosis::is_confirmed) { &amended.model } else { &before };
        let told = [amended.rounds.as_slice(), std::slice::from_ref(&together)];
        page.write(context, told, &set.flights, &split, [&before, after])?;
    }
    context.json(&Looped { rounds: amended.rounds, together, model: Some(output.into()), ledger })?;
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
    use phyture::critique::diagnose::{Locked, Step, Verdict};

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
