//! `predict`: hybrid predictions for every sample with a full history, as CSV or Parquet.

use super::Context;
use crate::arguments::Data;
use crate::output::Progress;
use phyture::flight::windows::windows;
use phyture::flight::write::{self, Values};
use phyture::flight::{Column, Span};
use phyture::hybrid::Hybrid;
use phyture::physics::Model;
use phyture::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What was asked for.
pub struct Wanted<'a> {
    /// Model file, to be the one that the network was trained on.
    pub model: Option<&'a Path>,
    /// Run folder or network file.
    pub network: &'a Path,
    /// File to write.
    pub output: &'a Path,
    /// Samples between predictions.
    pub stride: usize,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    predictions: PathBuf,
    rows: usize,
    flights: usize,
}

/// A network by its run folder or by its file.
pub fn read_network(path: &Path) -> Result<Hybrid> {
    Hybrid::read(&if path.is_dir() { path.join("network.safetensors") } else { path.into() })
}

/// Predicts and writes one table: flight, manoeuvre, t, measured and predicted accelerations.
pub fn run(context: &Context, data: &Data, wanted: &Wanted) -> Result<ExitCode> {
    let target = context.new_file(wanted.output, &[])?;
    let hybrid = read_network(wanted.network)?;
    if let Some(path) = wanted.model {
        let model = Model::read(path)?;
        if model.effects != hybrid.description().model.effects {
            return Err(Error::Config {
                place: path.display().to_string(),
                field: "effect".into(),
                found: "effects or coefficients other than those the network was trained on".into(),
                expected: "the model of the run (a residual belongs to its baseline); train again, or leave out -m".into(),
            });
        }
    }
    let set = context.flights(data, hybrid.description().config.history())?;
    let history = hybrid.description().config.history();
    let whole = |flight: usize| Span { flight, start: 0, end: set.flights[flight].len() };
    let all = windows(&(0..set.flights.len()).map(whole).collect::<Vec<_>>(), history, wanted.stride);
    let mut predicted = Vec::with_capacity(all.len());
    let mut progress = Progress::new("predicting", all.len() as u64, 0);
    for flight in &set.flights {
        // One flight at a time, so that there is something to show.
        let of_flight = windows(&[Span { flight: 0, start: 0, end: flight.len() }], history, wanted.stride);
        predicted.extend(hybrid.predict(std::slice::from_ref(flight), &of_flight, context.threads())?);
        progress.at(predicted.len() as u64, String::new);
    }
    drop(progress);
    let windows = all;
    let numbers = |value: &dyn Fn(usize) -> f64| (0..windows.len()).map(value).collect::<Vec<f64>>();
    let flight_of = |row: usize| &set.flights[windows[row].flight];
    let text = |value: &dyn Fn(usize) -> String| (0..windows.len()).map(value).collect::<Vec<String>>();
    let (manoeuvres, flights) = (text(&|row| flight_of(row).manoeuvre.clone()), text(&|row| flight_of(row).name.clone()));
    let mut columns = vec![("t".to_owned(), numbers(&|row| flight_of(row).time_s(windows[row].last)))];
    for (channel, column) in Column::TARGETS.into_iter().enumerate() {
        columns.push((column.name().to_owned(), numbers(&|row| flight_of(row).column(column)[windows[row].last])));
        columns.push((format!("{}_predicted", column.name()), numbers(&|row| predicted[row][channel])));
    }
    let mut table = vec![("manoeuvre", Values::Text(&manoeuvres)), ("flight", Values::Text(&flights))];
    table.extend(columns.iter().map(|(name, values)| (name.as_str(), Values::Numbers(values))));
    match wanted.output.extension().and_then(|ending| ending.to_str()) {
        Some("parquet") => write::table_parquet(context.ready(&target)?, &table)?,
        _ => write::table_csv(context.ready(&target)?, &table)?,
    }
    context.say(format!("{} predictions written to {}", windows.len(), wanted.output.display()));
    context.json(&Output { predictions: wanted.output.into(), rows: windows.len(), flights: set.flights.len() })?;
    Ok(ExitCode::SUCCESS)
}
