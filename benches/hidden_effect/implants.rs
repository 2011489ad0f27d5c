//! Known effects implanted into recorded flights, and what the search says of them. Noise, feedback and everything that a recorded flight
//! lacks beside it are real; only the truth that is added is known.

use phyture::Result;
use phyture::critique::diagnose::{Diagnosis, Options, Step, diagnose};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::split::Split;
use phyture::flight::{Channel, DataSet, Span};
use phyture::physics::{Effect, Model, calibrate, catalogue, implant, spread_over_flights, typical};
use std::path::Path;

/// Root mean square of what is implanted, over that of the model's error before, in the channel where that is most. What is usual for
/// one vehicle is absurd for another.
const SIZES: [f64; 2] = [0.5, 0.25];
/// Times the usual size, at least and at most: what is too small for a search at a thousand times its usual size cannot be hidden.
const SCALES: [f64; 2] = [1e-5, 1e3];
/// Halvings of the scale's logarithm.
const HALVINGS: usize = 24;
const SEED: u64 = 1;

/// Implants every effect that applies, in two sizes, into the flights of `data`, described by the files in `fixtures`, and prints a row each.
pub fn print(data: &Path, fixtures: &Path) -> Result<()> {
    let options = ReadOptions { dataset: Some(fixtures.join("dataset.toml")), ..ReadOptions::default() };
    let set = data_set(data, &options)?;
    let whole: Vec<Span> = set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
    let model = calibrate(&Model::read(fixtures.join("model.toml"))?, &set.flights, &whole)?.0;
    let rest = model.rmse(&set.flights, &whole)?;
    let without = search(&set, &model)?;
    println!("{}: {}; without an implant: {}\n", data.display(), without.verdict.words(), listed(&without.accepted));
    println!(
        "| effect | implanted, rms over the model's error | named | found / implanted | other names |\n| --- | --- | --- | --- | --- |"
    );
    for definition in catalogue::definitions().filter(|definition| definition.notes.is_some_and(|notes| notes.searched)) {
        if model.effect(definition.kind).is_some() {
            continue;
        }
        if !without.candidates.iter().any(|candidate| candidate.effect == definition.kind) {
            continue;
        }
        for size in SIZES {
            let of = |scale: f64| spread_over_flights(typical(definition, scale, &model), &set.flights);
            let share = |set: &DataSet, changed: &DataSet| {
                Channel::ALL.into_iter().map(|channel| change(set, changed, channel) / rest[channel]).fold(0.0, f64::max)
            };
            let [mut low, mut high] = SCALES;
            for _ in 0..HALVINGS {
                let middle = (low * high).sqrt();
                if share(&set, &implant(&set, &model, &of(middle))?) < size { low = middle } else { high = middle }
            }
            let changed = implant(&set, &model, &of(high))?;
            let reached = share(&set, &changed);
            let text = if reached < 0.9 * size {
                "cannot be made so large | | ".into()
            } else {
                row(&changed, &model, &of(high), &without)?
            };
            println!("| `{}` | {reached:.2} | {text} |", definition.kind);
        }
    }
    Ok(())
}

fn search(set: &DataSet, model: &Model) -> Result<Diagnosis> {
    let split = Split::for_search(&set.flights, SEED);
    let options = Options { seed: SEED, ..Options::default() };
    Ok(diagnose(&set.flights, model, &split.training, &split.test, "test", &options)?.diagnosis)
}

/// What the search says of an implant.
fn row(implanted: &DataSet, model: &Model, effect: &Effect, without: &Diagnosis) -> Result<String> {
    let found = search(implanted, model)?;
    let is_named = found.accepted.contains(&effect.name);
    let others: Vec<String> =
        found.accepted.iter().filter(|name| **name != effect.name && !without.accepted.contains(name)).cloned().collect();
    let step = |diagnosis: &Diagnosis| diagnosis.steps.iter().find(|step| step.effect == effect.name).map(main_number);
    let ratio = step(&found).zip(main_of(effect)).map(|(found, truth)| {
        // What the flights had of it before is no part of the implant.
        let before = step(without).filter(|_| !effect.coefficients.is_empty()).unwrap_or(0.0);
        format!("{:.2}", (found - before) / truth)
    });
    let named = if is_named { "yes" } else { "no" };
    Ok(format!("{named} | {} | {}", ratio.unwrap_or_else(|| "–".into()), listed(&others)))
}

/// Root mean square of what an implant changed.
fn change(before: &DataSet, after: &DataSet, channel: Channel) -> f64 {
    let column = channel.column();
    let (mut sum, mut count) = (0.0, 0);
    for (before, after) in before.flights.iter().zip(&after.flights) {
        for (before, after) in before.column(column).iter().zip(after.column(column)) {
            sum += (after - before).powi(2);
            count += 1;
        }
    }
    (sum / f64::from(count.max(1))).sqrt()
}

/// The first number, coefficients before parameters; of one that each flight has for itself the root mean square.
fn main_of(effect: &Effect) -> Option<f64> {
    let rms = |values: &std::collections::BTreeMap<String, f64>| {
        (values.values().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
    };
    let coefficient = effect.coefficients.first().map(|number| number.by_flight.as_ref().map_or(number.value, rms));
    coefficient.or_else(|| effect.parameters.first().map(|parameter| parameter.value)).filter(|value| *value != 0.0)
}

fn main_number(step: &Step) -> f64 {
    let coefficient = step.coefficients.first().map(|number| number.rms_over_flights.unwrap_or(number.value));
    coefficient.or_else(|| step.parameters.first().map(|parameter| parameter.value)).unwrap_or(f64::NAN)
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
