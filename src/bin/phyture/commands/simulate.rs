//! `simulate`: flights of the built-in truth helicopter, with the model file a user would start from.

use crate::context::Context;
use phyture::disk::write_atomically;
use phyture::flight::Flight;
use phyture::flight::write;
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, Level, Like, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate_with_explainable};
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Longest simulated flight time, minutes: a day, 2 GB of memory.
const MOST_MINUTES: f64 = 1440.0;

/// A flight time.
fn minutes(text: &str) -> Result<f64, String> {
    let minutes = text.parse::<f64>().map_err(|error| error.to_string())?;
    if minutes > 0.0 && minutes <= MOST_MINUTES {
        Ok(minutes)
    } else {
        Err(format!("expected more than 0 and at most {MOST_MINUTES}"))
    }
}

/// Flights of the built-in truth helicopter
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture simulate flights --minutes 30 --seed 7\n  phyture simulate flights --baseline --hide ground_effect --hide cyclic_lag=0.5\n  phyture simulate flights --like stanford\n  phyture simulate flights --level 2 --wind 5 --explainable floor"
)]
pub struct Args {
    /// Folder to write
    pub dir: PathBuf,
    /// Flight time, minutes, at most 1440
    #[arg(long, default_value_t = 30.0, allow_negative_numbers = true, value_parser = minutes, conflicts_with = "like")]
    pub minutes: f64,
    /// Switch one effect on in the truth that the model file beside the data does not list; EFFECT or EFFECT=SCALE; repeatable
    #[arg(long, value_name = "EFFECT[=SCALE]")]
    pub hide: Vec<String>,
    /// Switch every mechanism off but those of --hide: the truth is then the paper's baseline, gusts and noise
    #[arg(long)]
    pub baseline: bool,
    /// `stanford`: 20 manoeuvre classes and 7376 s, as the paper's data
    #[arg(long, value_name = "SET", value_parser = ["stanford"])]
    pub like: Option<String>,
    /// Layout of the files: canonical CSV or the Stanford set's own
    #[arg(long, default_value = "csv", value_parser = ["csv", "stanford"])]
    pub layout: String,
    /// Disturbances, noise and smoothing: `quiet` has none; 0 white gusts and little noise; 1 gusts that last, and noise; 2 the same
    /// smoothed [default: 2, with --baseline or --hide 0]
    #[arg(long, value_name = "LEVEL", value_parser = ["quiet", "0", "1", "2"])]
    pub level: Option<String>,
    /// Scale of the instrument noise [default: the level's, 0.3 at level 0, else 1]
    #[arg(long, value_name = "SCALE")]
    pub noise: Option<f64>,
    /// Mean wind of every flight from anywhere, m/s [default: 3, with --baseline or --hide 0]
    #[arg(long, value_name = "M_S")]
    pub wind: Option<f64>,
    /// Folder for the explainable part of each flight, without gusts, turbulence and noise: --explainable of `compare`, `diagnose`
    /// and `loop` then shows the floor that no model can go below
    #[arg(long, value_name = "DIR")]
    pub explainable: Option<PathBuf>,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    data: PathBuf,
    flights: usize,
    seconds_of_flight: f64,
    truth: phyture::sim::Truth,
}

/// The model file that goes with simulated flights: the paper's baseline for the truth vehicle, uncalibrated.
pub fn starting_model() -> Model {
    Model::paper("truth-helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

/// What was asked for, as a session.
fn session(context: &Context, wanted: &Args) -> Result<Simulation> {
    let mut simulation = if wanted.baseline || !wanted.hide.is_empty() { Simulation::baseline() } else { Simulation::default() };
    simulation.minutes = wanted.minutes;
    simulation.seed = context.seed();
    if wanted.like.is_some() {
        simulation.like = Like::Stanford;
    }
    for effect in &wanted.hide {
        let (id, scale) = effect.split_once('=').unwrap_or((effect, "1"));
        let scale = scale.parse().map_err(|_| Error::Config {
            place: "command line".into(),
            field: "--hide".into(),
            found: format!("`{effect}`"),
            expected: "EFFECT or EFFECT=SCALE with a number, as in ground_effect=0.5".into(),
        })?;
        simulation = simulation.hide(id, scale)?;
    }
    simulation.level = match wanted.level.as_deref() {
        Some("quiet") => Level::QUIET,
        Some("0") => Level::ZERO,
        Some("1") => Level::ONE,
        Some("2") => Level::TWO,
        _ => simulation.level,
    };
    let sized = |field: &str, value: f64, largest: f64| {
        if (0.0..=largest).contains(&value) {
            return Ok(value);
        }
        let (place, expected) = ("command line".into(), format!("0 to {largest}"));
        Err(Error::Config { place, field: field.into(), found: value.to_string(), expected })
    };
    if let Some(noise) = wanted.noise {
        simulation.level.noise = sized("--noise", noise, LARGEST_NOISE)?;
    }
    if let Some(wind) = wanted.wind {
        simulation = simulation.with_wind(sized("--wind", wind, LARGEST_WIND_M_S)?)?;
    }
    Ok(simulation)
}

/// Bounds of what can be asked for: beyond them nothing flies, or nothing can be read from the log.
const LARGEST_NOISE: f64 = 100.0;
const LARGEST_WIND_M_S: f64 = 9.0;

/// Writes flights in the layout asked for.
fn write_flights(folder: &Path, layout: &str, flights: &[Flight]) -> Result<()> {
    match layout {
        "stanford" => write::stanford(folder, flights),
        _ => write::data_set_csv(folder, flights),
    }
}

/// Simulates and writes the flights, `model.toml` and `truth.json`; and their explainable part elsewhere.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let (folder, floor_folder) = (&wanted.dir, wanted.explainable.as_deref());
    let simulation = session(context, wanted)?;
    floor_folder.map_or(Ok(()), |floor| outside(folder, floor))?;
    let new = context.new_folder(folder)?;
    let floor = floor_folder.map(|floor| context.new_folder(floor)).transpose()?;
    let (set, explainable) = simulate_with_explainable(&simulation)?;
    write_flights(folder, &wanted.layout, &set.flights)?;
    if let (Some(floor), Some(path)) = (floor, floor_folder) {
        write_flights(path, &wanted.layout, &explainable.flights)?;
        floor.close()?;
    }
    starting_model().write(folder.join("model.toml"))?;
    let truth = simulation.truth();
    let text = serde_json::to_string_pretty(&truth).map_err(|error| Error::Undetermined(error.to_string()))?;
    write_atomically(folder.join("truth.json"), |file| writeln!(file, "{text}"))?;
    new.close()?;
    context.say(format!(
        "{} flights of {} classes, {:.0} s, written to {} with model.toml (the paper's baseline, to be calibrated) and truth.json",
        set.flights.len(),
        set.manoeuvres().len(),
        set.duration_s(),
        folder.display()
    ));
    if let Some(floor) = floor_folder {
        context.say(format!("their explainable part, without gusts, turbulence and noise, is in {}", floor.display()));
    }
    context.json(&Output { data: folder.into(), flights: set.flights.len(), seconds_of_flight: set.duration_s(), truth })?;
    Ok(ExitCode::SUCCESS)
}

/// The truth must not lie in the folder that a search reads.
fn outside(flights: &Path, floor: &Path) -> Result<()> {
    let absolute = |path: &Path| std::path::absolute(path).map_err(Error::io(path));
    if !absolute(floor)?.starts_with(absolute(flights)?) {
        return Ok(());
    }
    let (place, field) = ("command line".into(), "--explainable".into());
    let found = format!("{}, inside the folder of the flights", floor.display());
    Err(Error::Config { place, field, found, expected: "a folder elsewhere: what is searched must not hold the truth".into() })
}
