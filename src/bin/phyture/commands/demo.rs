//! `demo`: the whole story on built-in data, with nothing to prepare.
//!
//! Flights of the truth helicopter with every mechanism on; two manoeuvre classes locked away; the paper's baseline calibrated
//! on the rest; the residual network trained on the rest; both judged on the locked flights.

use super::compare::Contest;
use super::train::Task;
use super::{CHECK_FAILED, Context, calibrate, interruption, simulate::starting_model};
use phyture::critique::Comparison;
use phyture::critique::check::check;
use phyture::flight::split::{Protocol, Split};
use phyture::flight::write;
use phyture::nn::PhyTureConfig;
use phyture::sim::{Simulation, simulate};
use phyture::train::TrainConfig;
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Classes that neither calibration nor training sees: one gentle, one aerobatic.
const LOCKED: [&str; 2] = ["turn_demos1", "chaos"];

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
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
        let network = PhyTureConfig { history: 128, d_model: 32, ..PhyTureConfig::default() };
        let full = TrainConfig { network, epochs: 6, stride: 12, seed, ..TrainConfig::default() };
        if !quick {
            return Self { minutes: 20.0, config: full };
        }
        // 20 flights of 30 s: one of each class, so that the locked ones are among them.
        let network = PhyTureConfig { history: 64, d_model: 16, ..full.network.clone() };
        Self { minutes: 10.0, config: TrainConfig { network, epochs: 6, ..full } }
    }
}

/// Tells the story and writes data, models, network and page into `out`.
pub fn run(context: &Context, out: &Path, quick: bool) -> Result<ExitCode> {
    let begun = Instant::now();
    let interrupted = interruption()?;
    std::fs::create_dir_all(out).map_err(Error::io(out))?;
    let Scale { minutes, config } = Scale::new(quick, context.seed());

    context.say("1. Flights of the built-in truth helicopter, every mechanism on");
    let set = simulate(&Simulation { minutes, seed: context.seed(), ..Simulation::default() })?;
    write::data_set_csv(&out.join("flights"), &set.flights)?;
    context.say(format!(
        "   {} flights of {} classes, {:.0} s; locked: {}",
        set.flights.len(),
        set.manoeuvres().len(),
        set.duration_s(),
        LOCKED.join(", ")
    ));

    context.say("\n2. Conventions and timing of the data");
    let report = check(&set, None);
    context.say(&report);
    if report.fault {
        return Ok(ExitCode::from(CHECK_FAILED));
    }

    context.say("\n3. The paper's baseline, calibrated on the flights that are not locked");
    let locked: Vec<String> = LOCKED.map(str::to_owned).into();
    let split = Split::new(&set.flights, &locked, &Protocol::Segments, context.seed())?;
    let mut model = starting_model();
    model.data.locked = locked;
    let (model, _, _) = calibrate::fit(context, &set, &model, &split)?;
    model.write(out.join("model.toml"))?;

    context.say("\n4. The residual network, trained on the same flights");
    let run = out.join("run");
    let task = Task { set: &set, split: &split, model: &model, config: &config, identity: "demo", folder: &run };
    let hybrid = task.hybrid(context, &interrupted)?;

    context.say("\n5. Measured against predicted on the locked flights, which neither saw");
    let history = config.network.history;
    let contest = Contest {
        models: &[("baseline".into(), model)],
        networks: &[("hybrid".into(), hybrid)],
        ridge: None,
        history,
        stride: 5,
        uncertainty: false,
    };
    let judged = contest.run(context, &set, &split)?;
    context.say(format!("\n{}", judged.comparison));
    let provenance = [
        ("data".to_owned(), format!("built-in truth helicopter, seed {}, {minutes} min", context.seed())),
        ("locked".to_owned(), LOCKED.join(", ")),
    ];
    let page = judged.write_page(&set, out, &provenance)?;
    let seconds = begun.elapsed().as_secs_f64();
    context.say(format!("report: {}   ({seconds:.0} s)", page.display()));
    context.json(&Output { comparison: judged.comparison, report: page, seconds })?;
    Ok(ExitCode::SUCCESS)
}
