//! `demo`: the whole story on built-in data, with nothing to prepare.
//!
//! Flights of the truth helicopter with hidden effects, eight of which the catalogue knows and one it does not; two manoeuvre classes
//! locked away; the paper's baseline calibrated on the rest; what is missing found, added, calibrated; the residual network trained on
//! the baseline and on the amended model; everything judged on the locked flights.

use super::diagnose;
use super::train::Told;
use super::{CHECK_FAILED, calibrate, simulate::starting_model};
use crate::context::{Context, interruption, typed};
use crate::pages::Figures;
use phyture::Result;
use phyture::critique::check::{CheckReport, check};
use phyture::critique::diagnose::{Amended, Diagnosis, Options};
use phyture::critique::digits::significant;
use phyture::critique::{ChannelValues, Comparison};
use phyture::flight::split::{Protocol, Split};
use phyture::flight::{DataSet, write};
use phyture::hybrid::Hybrid;
use phyture::nn::PhyTureConfig;
use phyture::physics::{Model, Weights};
use phyture::report::{DiagnoseReport, diagnose_page};
use phyture::sim::{Level, Simulation, simulate_with_explainable};
use phyture::train::{RunFolder, TrainConfig, Training};
use phyture::workflow::{Calibrating, Contest, SearchTask, digest};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Classes that neither calibration nor training sees: one gentle, one aerobatic.
const LOCKED: [&str; 2] = ["turn_demos1", "chaos"];

/// What the truth has beyond the baseline, in aerodynamics, rotor, controls and sensors; all but the last, the rotor wake on the tail, are in
/// the catalogue.
const HIDDEN: [(&str, f64); 9] = [
    ("transl_lift", 0.7),
    ("cyclic_lag", 1.0),
    ("dihedral_speedstab", 0.5),
    ("imu_lever", 1.0),
    ("ctrl_cross", 0.5),
    ("collective_torque", 0.3),
    ("weathercock", 0.5),
    ("quad_drag", 1.5),
    ("tail_wake", 0.5),
];

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    rounds: Vec<Diagnosis>,
    /// The rounds as one.
    together: Diagnosis,
    comparison: Comparison,
    report: PathBuf,
    seconds: f64,
}

/// How much of everything.
struct Scale {
    minutes: f64,
    config: TrainConfig,
}

impl Scale {
    fn new(quick: bool, seed: u64) -> Self {
        let full = TrainConfig { epochs: 6, seed, ..TrainConfig::in_minutes() };
        if !quick {
            return Self { minutes: 20.0, config: full };
        }
        // 20 flights of 30 s: one of each class, so that the locked ones are among them.
        let network = PhyTureConfig { history: 64, d_model: 16, ..PhyTureConfig::default() };
        Self { minutes: 10.0, config: TrainConfig { network: network.into(), ..full } }
    }
}

/// The whole story on built-in data: hidden effects found, added, the rest learned, judged on flights that nothing saw
#[derive(clap::Args)]
#[command(after_help = "Example:\n  phyture demo --out demo\n  phyture demo --quick        # two minutes, a smaller network")]
pub struct Args {
    /// Folder for data, models and the report
    #[arg(long, default_value = "phyture-demo")]
    pub out: PathBuf,
    /// A smaller data set and a shorter training
    #[arg(long)]
    pub quick: bool,
    /// Figures.
    #[command(flatten)]
    pub figures: Figures,
}

/// The flights of the truth, what a model could explain of them, and what they hide, in words.
struct Flown {
    set: DataSet,
    explainable: DataSet,
    hidden: String,
}

/// Simulates the flights and writes them.
fn fly(context: &Context, out: &Path, minutes: f64) -> Result<Flown> {
    context.say("1. Flights of the built-in truth helicopter, with hidden effects");
    let mut simulation = Simulation { minutes, seed: context.seed(), level: Level::TWO, ..Simulation::baseline() };
    for (id, scale) in HIDDEN {
        simulation = simulation.hide(id, scale)?;
    }
    let (set, explainable) = simulate_with_explainable(&simulation)?;
    write::data_set_csv(&out.join("flights"), &set.flights)?;
    let hidden = HIDDEN.map(|(id, scale)| format!("{id} x {scale}")).join(", ");
    context.say(format!(
        "   {} flights of {} classes, {:.0} s; hidden: {hidden}; locked: {}",
        set.flights.len(),
        set.manoeuvres().len(),
        set.duration_s(),
        LOCKED.join(", ")
    ));
    Ok(Flown { set, explainable, hidden })
}

/// Checks the flights, and says what is not as expected, or with `--verbose` everything.
fn checked(context: &Context, out: &Path, set: &DataSet) -> CheckReport {
    context.say("\n2. Conventions and timing of the data");
    let report = check(set, None);
    if context.is_verbose() {
        context.say(&report);
    } else {
        context.say(report.in_short());
        context.say(format!("each finding: {} check {}/flights", typed(), out.display()));
    }
    if !report.fault {
        context.say("What is hidden shows here, too: a lag looks like a delay, aerobatics with much missing like a moved trim. The demo goes on as it is.");
    }
    report
}

/// Says the errors, or with `--verbose` all that was compared.
fn tell(context: &Context, comparison: &Comparison) {
    if context.is_verbose() {
        context.say(format!("\n{comparison}"));
    } else {
        context.say(format!("\n{}", comparison.in_short()));
        context.say("\nOther measures, manoeuvres, regimes, shares and prediction intervals: on the page, and here with --verbose");
    }
}

/// What both networks are trained with.
struct Settings<'a> {
    out: &'a Path,
    set: &'a DataSet,
    split: &'a Split,
    config: &'a TrainConfig,
}

/// Trains the network on a model, in a run folder of this name.
fn trained(context: &Context, settings: &Settings, model: &Model, name: &str, interrupted: &AtomicBool) -> Result<Hybrid> {
    let folder = RunFolder::create(settings.out.join(name))?;
    let training = Training {
        flights: &settings.set.flights,
        split: settings.split,
        model,
        config: settings.config,
        data: digest(name),
        folder: &folder,
        with_losses: true,
        threads: context.threads(),
    };
    Told { training, resume: false, interrupted }.hybrid(context)
}

/// The mean error over the channels of each step of the story, in one sentence.
fn in_short(comparison: &Comparison) -> String {
    let mean = |values: &ChannelValues| values.mean.map(|mean| significant(mean, 3));
    let of = |name: &str| comparison.models.iter().find(|model| model.name == name).and_then(|model| mean(&model.rmse));
    let steps =
        [("baseline", "as calibrated"), ("amended", "with the named physics"), ("amended + network", "with a network on top")];
    let told: Vec<String> = steps.iter().filter_map(|(name, says)| Some(format!("{} {says}", of(name)?))).collect();
    let floor = comparison.floor.as_ref().and_then(mean).map(|floor| format!("; {floor} is the floor")).unwrap_or_default();
    format!("Mean error on flights that nothing saw: {}{floor}", told.join(", "))
}

/// Tells the story and writes data, models, network and page into `out`.
pub fn run(context: &Context, Args { out, quick, figures }: &Args) -> Result<ExitCode> {
    let begun = Instant::now();
    let interrupted = interruption()?;
    let folder = context.new_folder(out)?;
    let target = context.new_page(out, "report.html")?;
    let report_path = target.path().to_path_buf();
    let outlet = figures.beside(context, target)?;
    let Scale { minutes, config } = Scale::new(*quick, context.seed());

    context.say(format!("{minutes} minutes of flight and the whole story on them, in six steps; the full demo takes about two minutes on two cores at rest"));
    let Flown { set, explainable, hidden } = fly(context, out, minutes)?;

    if checked(context, out, &set).fault {
        return Ok(ExitCode::from(CHECK_FAILED));
    }

    context.say("\n3. The paper's baseline, calibrated on the flights that are not locked");
    let locked: Vec<String> = LOCKED.map(str::to_owned).into();
    let split = Split::new(&set.flights, &locked, &Protocol::Segments, context.seed())?;
    let mut model = starting_model();
    model.data.locked = locked;
    let model = calibrate::fit(context, &Calibrating { set: &set, split: &split, weights: Weights::Rows }, &model)?.model;
    model.write(out.join("model.toml"))?;

    context.say("\n4. What is missing? Found, added, calibrated, until nothing worthwhile is left");
    let options = Options { seed: context.seed(), ..Options::default() };
    let calm = Some(explainable.flights.clone());
    let search = SearchTask { set: &set, split: &split, data_sha256: String::new(), options, explainable: calm };
    let ledger = out.join("amended.ledger.jsonl");
    let found = diagnose::amend(context, &search, &model, &ledger, &interrupted)?;
    found.model.write(out.join("amended.toml"))?;
    diagnose::not_stopped(&found, &out.join("amended.toml"))?;
    let together = diagnose::told_together(context, &search, &model, &found)?;
    let Amended { rounds, model: amended, .. } = found;

    context.say("\n5. The residual network, trained on the baseline and on the amended model");
    let of = Settings { out, set: &set, split: &split, config: &config };
    let train = |model: &Model, name: &str| trained(context, &of, model, name, &interrupted);
    let (on_baseline, on_amended) = (train(&model, "run")?, train(&amended, "run-amended")?);

    context.say("\n6. Measured against predicted on the locked flights, which nothing saw");
    let models = [("baseline".into(), model.clone()), ("amended".into(), amended.clone())];
    let networks = [("baseline + network".into(), on_baseline), ("amended + network".into(), on_amended)];
    let contest = Contest {
        models: &models,
        networks: &networks,
        ridge: None,
        history: config.network.history(),
        stride: 5,
        uncertainty: false,
        seed: context.seed(),
        threads: context.threads(),
    };
    let mut judged = contest.run(&set, &split)?;
    judged.set_floor(&set, &explainable.flights)?;
    contest.trace(&set, &split, &mut judged)?;
    tell(context, &judged.comparison);
    let provenance = [
        ("data".to_owned(), format!("built-in truth helicopter, seed {}, {minutes} min; hidden: {hidden}", context.seed())),
        ("locked".to_owned(), LOCKED.join(", ")),
    ];
    let title = "Hidden effects found, added, and the rest learned".to_owned();
    let told = DiagnoseReport {
        title: &title,
        diagnoses: &rounds,
        together: Some(&together),
        flights: &set.flights,
        searched: &split.training,
        locked: &split.test,
        before: &model,
        after: &amended,
        compared: Some(&judged.report(&set, &[])),
        provenance: &provenance,
    };
    outlet.write(context, &diagnose_page(&told)?)?;
    folder.close()?;
    let (report, seconds) = (report_path, begun.elapsed().as_secs_f64());
    context.say(format!("\nDone in {seconds:.0} s. {}", in_short(&judged.comparison)));
    context.say(format!("the page to read:               {}", report.display()));
    context.say(format!("the same flights in a browser:  {1} studio {0}/flights -m {0}/model.toml", out.display(), typed()));
    context.json(&Output { rounds, together, comparison: judged.comparison, report, seconds })?;
    Ok(ExitCode::SUCCESS)
}
