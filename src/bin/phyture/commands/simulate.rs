//! `simulate`: flights of the built-in truth helicopter, with the model file a user would start from.

use super::Context;
use phyture::disk::write_atomically;
use phyture::flight::write;
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, Like, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What was asked for.
pub struct Wanted<'a> {
    /// Flight time, min.
    pub minutes: f64,
    /// EFFECT or EFFECT=SCALE.
    pub hide: &'a [String],
    /// Every mechanism off but the hidden ones.
    pub baseline: bool,
    /// `stanford`.
    pub like: Option<&'a str>,
    /// `csv` or `stanford`.
    pub layout: &'a str,
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

/// Simulates and writes the flights, `model.toml` and `truth.json`.
pub fn run(context: &Context, folder: &Path, wanted: &Wanted) -> Result<ExitCode> {
    let mut simulation = if wanted.baseline || !wanted.hide.is_empty() { Simulation::baseline() } else { Simulation::default() };
    simulation.minutes = wanted.minutes;
    simulation.seed = context.seed();
    if wanted.like.is_some() {
        simulation.like = Like::Stanford;
    }
    for effect in wanted.hide {
        let (id, scale) = effect.split_once('=').unwrap_or((effect, "1"));
        let scale = scale.parse().map_err(|_| Error::Config {
            place: "command line".into(),
            field: "--hide".into(),
            found: format!("`{effect}`"),
            expected: "EFFECT or EFFECT=SCALE with a number, as in ground_effect=0.5".into(),
        })?;
        simulation = simulation.hide(id, scale)?;
    }
    let new = context.new_folder(folder)?;
    let set = simulate(&simulation)?;
    match wanted.layout {
        "stanford" => write::stanford(folder, &set.flights)?,
        _ => write::data_set_csv(folder, &set.flights)?,
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
    context.json(&Output { data: folder.into(), flights: set.flights.len(), seconds_of_flight: set.duration_s(), truth })?;
    Ok(ExitCode::SUCCESS)
}
