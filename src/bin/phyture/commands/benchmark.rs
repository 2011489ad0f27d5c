//! `benchmark`: the runs of the paper's tables, and the tables of finished runs.

use super::explainable;
use crate::arguments::{Data, count};
use crate::context::{Context, data_sha256, interruption};
use crate::output::Progress;
use crate::pages::write_page;
use phyture::disk::{Existing, Target};
use phyture::flight::DataSet;
use phyture::flight::split::{Protocol, class_folds};
use phyture::physics::Model;
use phyture::protocol::{
    Division, Experiment, Extent, Finished, Folder, JobArray, Plan, Run, Settings, TableId, Treatment, estimate, instruction_set,
    method, text,
};
use phyture::report::benchmark_page;
use phyture::train::TrainConfig;
use phyture::{Error, Result};
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A part of a plan, written `2/8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub number: usize,
    /// Of so many.
    pub count: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, count)| Some((number.parse().ok()?, count.parse().ok()?)));
        parts
            .filter(|(number, count)| (1..=*count).contains(number))
            .map(|(number, count)| Self { number, count })
            .ok_or_else(|| format!("`{text}` is no part of a plan; expected I/N with I from 1 to N, as in 2/8"))
    }
}

/// Most tasks of a job array.
const MOST_SHARDS: usize = 10_000;

/// The paper's tables: every method, on the same splits, with several seeds
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  phyture benchmark flights -o bench --plan hour --table 1\n  phyture benchmark flights -o bench --plan hour --table 1 --resume   # after a kill\n  phyture benchmark flights -o bench --plan question --estimate\n  phyture benchmark flights -o bench --shard 2/8                       # one part of eight\n  phyture benchmark flights -o bench --emit slurm --shards 20 > array.sh\n  phyture benchmark collect bench"
)]
pub struct Args {
    /// Finished runs to tables.
    #[command(subcommand)]
    pub command: Option<Action>,
    /// Flights.
    #[command(flatten)]
    pub data: Option<Data>,
    /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Folder of the benchmark
    #[arg(short, long, required = true)]
    pub output: Option<PathBuf>,
    /// Table of the paper, 1 to 6, `robustness` or `noise`; repeatable [default: all]
    #[arg(long, value_name = "TABLE")]
    pub table: Vec<TableId>,
    /// Row of the tables by identifier, such as `timesnet`; repeatable [default: all]
    #[arg(long, value_name = "METHOD")]
    pub method: Vec<String>,
    /// Seeds of each network, at most 1000 [default: the plan's]
    #[arg(long, allow_negative_numbers = true, value_parser = count(1..=Settings::MOST_SEEDS))]
    pub seeds: Option<usize>,
    /// Budget: the paper's (on two cores some fifteen days for table 1 alone, months for all), `question` (a history of 1.28 s trained to the end, a
    /// day and a half), an hour's for table 1, or one that only shows that it works
    #[arg(long, value_enum, default_value_t = Plans::Paper)]
    pub plan: Plans,
    /// How flights are divided where none is locked: `segments`, `stretches` or `first SHARE` [default: stretches in the plans `paper` and
    /// `question`, else the model file's]
    #[arg(long)]
    pub split: Option<Protocol>,
    /// The explainable part of simulated flights, as `simulate --explainable` writes it: adds the row of the floor
    #[arg(long, value_name = "DIR")]
    pub explainable: Option<PathBuf>,
    /// Run nothing; say what there is to do and how long it would take here
    #[arg(long)]
    pub estimate: bool,
    /// Training configuration (TOML) in place of the plan's: sizes of Phy-Ture, inputs, epochs, strides
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Make one part of the plan: every N-th run, from the I-th
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Go on in a folder that holds runs of this plan
    #[arg(long)]
    pub resume: bool,
    /// Run nothing; print the script of a job array for this batch system, one task a shard, `--threads` processors each
    #[arg(long, value_name = "SYSTEM", value_parser = ["slurm"], conflicts_with = "shard")]
    pub emit: Option<String>,
    /// Tasks of the job array
    #[arg(long, default_value_t = 10, requires = "emit", allow_negative_numbers = true, value_parser = count(1..=MOST_SHARDS))]
    pub shards: usize,
}

/// What to do with a benchmark's folder.
#[derive(clap::Subcommand)]
pub enum Action {
    /// The tables of all runs that are done
    Collect {
        /// Folder of the benchmark
        folder: PathBuf,
        /// Folders of the same plan whose runs are taken over first
        from: Vec<PathBuf>,
    },
}

/// How much of the paper's experiment is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Plans {
    /// The paper's sizes, 100 epochs, 10 seeds.
    Paper,
    /// 1.28 s of history, the paper's width, 20 epochs of dense windows, 3 seeds, learning rate and epoch chosen on the validation part.
    Question,
    /// Table 1 in an hour on two cores.
    Hour,
    /// A few minutes; the figures mean nothing.
    Quick,
}

impl Plans {
    /// How a plan divides the flights unless asked otherwise. Of a segment of ten seconds a history of ten seconds leaves nothing to judge.
    fn split(self) -> Option<Protocol> {
        matches!(self, Self::Paper | Self::Question).then_some(Protocol::Stretches)
    }
}

/// What `--json` writes after runs.
#[derive(Serialize)]
struct Output<'a> {
    plan: &'a Plan,
    runs: usize,
    done_before: usize,
    done_now: usize,
    seconds: f64,
}

/// Makes runs, prints the script of a job array, or collects.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    if let Some(Action::Collect { folder, from }) = &wanted.command {
        return collect(context, folder, from);
    }
    let (Some(data), Some(output)) = (&wanted.data, &wanted.output) else {
        let (place, field) = ("command line".into(), "DATA, --output".into());
        return Err(Error::Config { place, field, found: "nothing".into(), expected: "flights and a folder".into() });
    };
    match wanted.emit {
        Some(_) => emit(context, output, wanted.shards),
        None => make(context, data, output, wanted),
    }
}

/// Makes the runs that are not done yet.
fn make(context: &Context, data: &Data, output: &Path, wanted: &Args) -> Result<ExitCode> {
    let begun = Instant::now();
    let (settings, mut model) = (settings(context, wanted)?, context.model(wanted.model.as_deref(), data)?);
    model.data.split = wanted.split.clone().or(wanted.plan.split()).unwrap_or(model.data.split);
    let set = context.flights(data, settings.phyture()?.history)?;
    let explainable = wanted.explainable.as_deref().map(|folder| explainable::read_set(data, folder)).transpose()?;
    let plan = plan(&set, explainable.as_ref(), data, settings, &model, wanted)?;
    if wanted.estimate {
        return estimate_only(context, &plan, &set, &model);
    }
    let folder = Folder::create(output)?;
    open(&folder, &plan, wanted)?;
    context.say(format!("\n{}", plan.settings.budget(plan.step_s)));
    let runs = match wanted.shard {
        None => plan.runs()?,
        Some(shard) => plan.shard(shard.number, shard.count)?,
    };
    let here = instruction_set()?;
    let (mut left, mut made_elsewhere) = (Vec::new(), BTreeSet::new());
    for run in &runs {
        match folder.outcome(&plan, run)? {
            None => left.push(run.clone()),
            Some((_, instruction_set)) if instruction_set == here => {}
            Some((_, other)) => {
                made_elsewhere.insert(other);
            }
        }
    }
    if !made_elsewhere.is_empty() {
        let others: Vec<String> = made_elsewhere.into_iter().collect();
        context.say(format!(
            "note: runs in this folder were made at instruction set {}; this process works at {here}, and its last digits differ",
            others.join(", ")
        ));
    }
    let done_before = runs.len() - left.len();
    let mut experiment = Experiment::new(&plan, &set.flights, &model, context.threads(), folder.amended());
    experiment.explainable = explainable.as_ref().map(|set| &set.flights[..]);
    let interrupted = interruption()?;
    Queue { context, folder: &folder, experiment: &experiment, left: &left }.work(&interrupted)?;
    context.say(format!(
        "{} runs are done, {done_before} of them before; tables: phyture benchmark collect {}",
        runs.len(),
        folder.path().display()
    ));
    let seconds = begun.elapsed().as_secs_f64();
    context.json(&Output { plan: &plan, runs: runs.len(), done_before, done_now: left.len(), seconds })?;
    Ok(ExitCode::SUCCESS)
}

/// The budget: a preset, or a training configuration with the preset's seeds and strides.
fn settings(context: &Context, wanted: &Args) -> Result<Settings> {
    let mut settings = match wanted.plan {
        Plans::Paper => Settings::paper(),
        Plans::Question => Settings::question(),
        Plans::Hour => Settings::hour(),
        Plans::Quick => Settings::quick(),
    };
    if let Some(path) = &wanted.config {
        settings.training = TrainConfig::read(path)?;
    }
    settings.seeds = wanted.seeds.unwrap_or(settings.seeds);
    settings.split_seed = context.common.seed.unwrap_or(settings.split_seed);
    settings.check()?;
    Ok(settings)
}

/// Says what there is to do and how long it would take, and does nothing.
fn estimate_only(context: &Context, plan: &Plan, set: &DataSet, model: &Model) -> Result<ExitCode> {
    let runs = plan.runs()?;
    let experiment = Experiment::new(plan, &set.flights, model, context.threads(), "");
    let work = Work::of(&experiment, &runs)?;
    context.say(format!("\n{}", plan.settings.budget(plan.step_s)));
    announce(context, &model.data.split, &runs, &work);
    let judged = |least: fn(usize, usize) -> usize| work.extents.iter().map(|(.., extent)| extent.test).reduce(least);
    context.json(&json!({
        "plan": plan,
        "runs": runs.len(),
        "estimated_seconds": work.costs.iter().sum::<f64>(),
        "judged_windows": [judged(usize::min), judged(usize::max)],
    }))?;
    Ok(ExitCode::SUCCESS)
}

fn plan(
    set: &DataSet,
    explainable: Option<&DataSet>,
    data: &Data,
    settings: Settings,
    model: &Model,
    wanted: &Args,
) -> Result<Plan> {
    let folds = class_folds(&set.manoeuvres(), settings.folds);
    let all = TableId::ALL.into_iter().filter(|table| wanted.table.is_empty() || wanted.table.contains(table));
    let possible = |table: &TableId| *table != TableId::Paper(3) || folds.len() > 1;
    if wanted.table.contains(&TableId::Paper(3)) && folds.len() < 2 {
        return Err(Error::Undetermined("table 3 holds manoeuvre classes out, and these flights are of one class".into()));
    }
    let plan = Plan {
        data_sha256: data_sha256(set),
        data: data.data.display().to_string(),
        model: model.to_toml()?,
        step_s: set.flights.first().map_or(f64::NAN, |flight| flight.step_s),
        explainable_sha256: explainable.map(data_sha256),
        tables: all.filter(possible).collect(),
        folds: if folds.len() > 1 { folds } else { Vec::new() },
        settings,
        version: env!("CARGO_PKG_VERSION").into(),
        methods: wanted.method.clone(),
    };
    plan.check()?;
    Ok(plan)
}

/// Puts the plan into the folder. One that holds another plan is refused, and one that holds this plan is gone on with only when asked.
fn open(folder: &Folder, plan: &Plan, wanted: &Args) -> Result<()> {
    let _held = folder.hold_plan()?;
    if !folder.plan_file().exists() {
        return folder.write_plan(plan);
    }
    let refuse = |found: &str, expected: &str| {
        let (place, field) = (folder.path().display().to_string(), "plan.json".into());
        Err(Error::Config { place, field, found: found.into(), expected: expected.into() })
    };
    let there = folder.plan()?;
    if !plan.continues(&there) {
        return refuse("another plan (data, model, settings or version differ)", "another folder with -o for this one");
    }
    if !wanted.resume && wanted.shard.is_none() {
        return refuse("a plan with runs", "--resume to go on with it, or another folder");
    }
    let joined = plan.joined(&there);
    if there == joined { Ok(()) } else { folder.write_plan(&joined) }
}

/// Between two looks at a run that another program makes.
const WAIT: Duration = Duration::from_millis(200);

/// Runs that are to be made one after the other.
struct Queue<'a> {
    context: &'a Context<'a>,
    folder: &'a Folder,
    experiment: &'a Experiment<'a>,
    left: &'a [Run],
}

impl Queue<'_> {
    fn work(&self, interrupted: &AtomicBool) -> Result<()> {
        let plan = self.experiment.plan;
        let work = Work::of(self.experiment, self.left)?;
        announce(self.context, &self.experiment.model.data.split, self.left, &work);
        let Work { costs, .. } = work;
        let total: f64 = costs.iter().sum();
        // In milliseconds of the estimate.
        let mut progress = Progress::new("benchmark", (1e3 * total) as u64, 0);
        let mut behind = 0.0;
        let mut queue: VecDeque<(usize, &Run, f64)> =
            self.left.iter().zip(costs).enumerate().map(|(index, (run, cost))| (index, run, cost)).collect();
        // Runs that other programs make, since the last one that could be made here.
        let mut elsewhere = 0;
        while let Some((index, run, cost)) = queue.pop_front() {
            let begun = Instant::now();
            let key = plan.key(run)?;
            let claim = match self.folder.claim(&key) {
                Err(Error::Busy { .. }) => {
                    queue.push_back((index, run, cost));
                    elsewhere += 1;
                    self.wait(elsewhere, queue.len(), interrupted)?;
                    continue;
                }
                claim => claim?,
            };
            elsewhere = 0;
            // Another program may have made it meanwhile.
            if self.folder.outcome(plan, run)?.is_some() {
                behind += cost;
                continue;
            }
            let working = self.folder.working(&key);
            let outcome = self.experiment.run(run, &working, &mut |share| {
                self.experiment.take_notes().iter().for_each(|note| self.context.say(note));
                // What has no steps to count is taken to need its time; steps are believed, however long they take.
                let gone = if share > 0.0 { share * cost } else { begun.elapsed().as_secs_f64().min(0.95 * cost) };
                progress.at((1e3 * (behind + gone)) as u64, || format!("run {} of {}: {run}", index + 1, self.left.len()));
                !interrupted.load(Ordering::Relaxed)
            })?;
            self.folder.finish(plan, &outcome)?;
            drop(claim);
            behind += cost;
            self.context.say(format!("{:>4}/{}  {run}: {}", index + 1, self.left.len(), duration(begun.elapsed().as_secs_f64())));
            if interrupted.load(Ordering::Relaxed) {
                return Err(Error::Interrupted { saved: "every finished run is in its file; go on with --resume".into() });
            }
        }
        Ok(())
    }

    /// Waits a little where all the runs that are left are made by other programs: should one of them end early, its run is made here.
    fn wait(&self, elsewhere: usize, left: usize, interrupted: &AtomicBool) -> Result<()> {
        if elsewhere < left {
            return Ok(());
        }
        if elsewhere == left {
            self.context.say(format!("{left} runs are being made by other programs; waiting for them"));
        }
        std::thread::sleep(WAIT);
        if interrupted.load(Ordering::Relaxed) {
            return Err(Error::Interrupted { saved: "what other programs make goes on".into() });
        }
        Ok(())
    }
}

/// Windows that a test part should have: at the plans' tenth of a second from one to the next, five minutes of flight.
const FEW_JUDGED: usize = 3000;

/// What is to be done, on how many windows, and by method the time that it will take.
fn announce(context: &Context, split: &Protocol, left: &[Run], Work { costs, extents }: &Work) {
    if left.is_empty() {
        context.say("nothing left to do");
        return;
    }
    context.say(format!("{} runs to do, about {} on this machine", left.len(), duration(costs.iter().sum())));
    let counted = |of: fn(&Extent) -> usize| {
        let counts = extents.iter().map(|(.., extent)| of(extent));
        match (counts.clone().min(), counts.max()) {
            (Some(least), Some(most)) if least < most => format!("{least} to {most}"),
            (least, _) => least.unwrap_or(0).to_string(),
        }
    };
    let counts = [counted(|extent| extent.training), counted(|extent| extent.validation), counted(|extent| extent.test)];
    context.say(format!("windows: {} train, {} validate, {} are judged", counts[0], counts[1], counts[2]));
    if extents.iter().any(|(.., extent)| extent.test < FEW_JUDGED) {
        let hint = if *split == Protocol::Segments { "; --split stretches judges more where the history is long" } else { "" };
        context
            .say(format!("note: with fewer than {FEW_JUDGED} windows judged, methods that are close cannot be told apart{hint}"));
    }
    let mut methods: Vec<(&str, Vec<f64>)> = Vec::new();
    for (run, cost) in left.iter().zip(costs) {
        match methods.iter_mut().find(|(id, _)| *id == run.method) {
            Some((_, known)) => known.push(*cost),
            None => methods.push((&run.method, vec![*cost])),
        }
    }
    for (id, costs) in methods {
        let name = method(id).map_or(id, |method| method.name);
        context.say(format!("{:>6} x {name}, {} in all", costs.len(), duration(costs.iter().sum())));
    }
}

/// What there is to do.
struct Work {
    /// Seconds that each run will take, about.
    costs: Vec<f64>,
    /// Windows of each part that runs train and are judged on.
    extents: Vec<(Division, Treatment, Extent)>,
}

impl Work {
    fn of(experiment: &Experiment<'_>, left: &[Run]) -> Result<Self> {
        let plan = experiment.plan;
        let mut window_s: BTreeMap<String, f64> = BTreeMap::new();
        let mut extents: Vec<(Division, Treatment, Extent)> = Vec::new();
        let mut costs = Vec::new();
        for run in left {
            if let (Some(config), None) = (plan.training(run)?, window_s.get(&run.method)) {
                window_s.insert(run.method.clone(), estimate::window_s(&config, experiment.threads)?);
            }
            let known = extents.iter().find(|(division, treatment, _)| (*division, *treatment) == (run.division, run.treatment));
            let extent = match known {
                Some((.., extent)) => *extent,
                None => {
                    let extent = experiment.extent(run)?;
                    extents.push((run.division, run.treatment, extent));
                    extent
                }
            };
            costs.push(estimate::run_s(plan, run, window_s.get(&run.method).copied().unwrap_or(0.0), extent)?);
        }
        Ok(Self { costs, extents })
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        seconds if seconds < 120.0 => format!("{seconds:.0} s"),
        seconds if seconds < 7200.0 => format!("{:.0} min", seconds / 60.0),
        seconds if seconds < 100.0 * 3600.0 => format!("{:.1} h", seconds / 3600.0),
        seconds => format!("{:.0} days", seconds / 86_400.0),
    }
}

/// Options of the command line that are not a task's: the script gives each its own.
const NOT_OF_A_TASK: [&str; 4] = ["--emit", "--shards", "--threads", "--json"];

/// Prints the script of a job array whose tasks are what this command line asks for.
fn emit(context: &Context, output: &Path, shards: usize) -> Result<ExitCode> {
    let program = std::env::current_exe().map_err(Error::io("phyture"))?;
    let mut arguments = Vec::new();
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        let name = argument.split_once('=').map_or(argument.as_str(), |(name, _)| name);
        if !NOT_OF_A_TASK.contains(&name) {
            arguments.push(argument);
        } else if name == argument {
            // Its value is a word of its own.
            given.next();
        }
    }
    let cpus = context.common.threads.filter(|threads| *threads > 0);
    let cpus = cpus.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get));
    let program = program.to_string_lossy().into_owned();
    let array = JobArray { program, arguments, shards, cpus, output: output.into(), time_limit: None };
    context.print(array.script()?.trim_end());
    Ok(ExitCode::SUCCESS)
}

/// Takes over the runs of other folders and writes the tables of all runs that are done.
fn collect(context: &Context, folder: &Path, from: &[PathBuf]) -> Result<ExitCode> {
    if !folder.join("plan.json").exists() {
        let (place, field) = (folder.display().to_string(), "plan.json".into());
        return Err(Error::Config { place, field, found: "nothing".into(), expected: "the folder of a benchmark".into() });
    }
    let folder = Folder::create(folder)?;
    let plan = folder.plan()?;
    for other in from {
        let taken = folder.merge(&plan, &Folder::create(other)?)?;
        context.say(format!("{}: {taken} runs taken over", other.display()));
    }
    let finished = Finished::read(&folder)?;
    if finished.instruction_sets.len() > 1 {
        let sets: Vec<&str> = finished.instruction_sets.iter().map(String::as_str).collect();
        context.say(format!("note: runs were made at different instruction sets ({}); their last digits differ", sets.join(", ")));
    }
    text::write(&finished, &folder.tables())?;
    // Tables are made anew from the runs whenever they are asked for.
    let page = Target::file(&folder.tables().join("report.html"), Existing::Replace, &[])?;
    write_page(&benchmark_page(&finished), &page)?;
    for table in finished.tables() {
        context.say(format!("\n{}", text::markdown(&finished, &table)));
    }
    context.say(format!("tables: {}", folder.tables().display()));
    context.json(&json!({ "tables": finished.tables() }))?;
    Ok(ExitCode::SUCCESS)
}
