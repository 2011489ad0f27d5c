//! Asks which physical effect a model lacks, from code: flights, a check of their conventions, a search, its verdict.
//!
//! ```text
//! cargo run --release --features files,sim --example diagnose_from_code                 # simulated flights with one hidden effect
//! cargo run --release --features files,sim --example diagnose_from_code -- FLIGHTS MODEL  # your flights and your model file
//! ```

use phyture::Result;
use phyture::critique::check::check;
use phyture::critique::diagnose::{Options, diagnose, searched};
use phyture::flight::DataSet;
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::split::Split;
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use std::path::Path;

/// Seed of the simulation, of what is kept from the search, and of its folds.
const SEED: u64 = 7;

/// Flights and the model to be searched: those that were named, or ten minutes in which the fin is hidden.
fn flights_and_model() -> Result<(DataSet, Model)> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [flights, model] = words.as_slice() {
        return Ok((data_set(Path::new(flights), &ReadOptions::default())?, Model::read(model)?));
    }
    let truth = Simulation { minutes: 10.0, seed: SEED, ..Simulation::baseline() }.hide("weathercock", 2.0)?;
    // The paper's baseline with all coefficients 0; the search fits them.
    Ok((simulate(&truth)?, Model::paper("helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)))
}

fn main() -> Result<()> {
    let (set, model) = flights_and_model()?;

    // A wrong sign or frame looks like a missing effect, so the log is checked first.
    let report = check(&set, Some(&model));
    println!("check: {}", report.summary);
    if report.fault {
        println!("{report}");
        return Ok(());
    }

    // Every fifth flight is kept from the search and confirms what it finds.
    let split = Split::for_search(&set.flights, SEED);
    let options = Options { seed: SEED, ..Options::default() };
    let outcome = diagnose(&set.flights, &model, &searched(&split), &split.test, split.tested.name(), &options)?;
    let found = &outcome.diagnosis;

    println!("verdict: {}. {}", found.verdict.words(), found.summary);
    for step in &found.steps {
        println!("  {}: {} (p = {:.1e})", step.effect, step.meaning, step.p_value);
        for number in &step.coefficients {
            let interval = number.ci95.map(|[low, high]| format!(" [{low:.4}, {high:.4}]")).unwrap_or_default();
            println!("    {} = {:.4}{interval} {}", number.name, number.value, number.unit);
        }
    }
    println!("confirmed on flights that no search has seen: {}", if found.is_confirmed() { "yes" } else { "no" });

    // The model with what was found, as a model file.
    println!("\n{}", outcome.model.to_toml()?);
    Ok(())
}
