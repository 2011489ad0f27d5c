//! `calibrate`: least squares of the model's coefficients on the training part, and a model file to go on with.

use crate::arguments::{Data, Division};
use crate::context::Context;
use phyture::critique::wrap::wrapped;
use phyture::flight::split::Split;
use phyture::flight::{Column, DataSet};
use phyture::physics::{Calibration, Effect, Entry, Model, calibrate};
use phyture::{Error, Result};
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::process::ExitCode;

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    #[serde(flatten)]
    calibration: Calibration,
    rmse: Map<String, Value>,
}

/// Least squares of the model's coefficients on the training part
#[derive(clap::Args)]
#[command(after_help = "Example:\n  phyture calibrate flights -m n9.toml -o n9-calibrated.toml")]
pub struct Args {
    /// Flights.
    #[command(flatten)]
    pub data: Data,
    /// Model file [default: DATA/model.toml if there is one, or the paper's baseline and vehicle]
    #[arg(short, long)]
    pub model: Option<PathBuf>,
    /// Calibrated model file to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// What trains and what tests.
    #[command(flatten)]
    pub division: Division,
}

/// Calibrates a model on the training part and writes it.
pub fn run(context: &Context, Args { data, model, output, division }: &Args) -> Result<ExitCode> {
    let model = model.as_deref();
    let target = context.new_file(output, model.as_slice())?;
    let set = context.flights(data, 1)?;
    let model = context.model(model, data)?;
    let split = context.split(&set.flights, &model, division)?;
    let (mut calibrated, calibration, rmse) = fit(context, &set, &model, &split)?;
    calibrated.data.locked.extend(division.lock.iter().filter(|name| !model.data.locked.contains(name)).cloned());
    calibrated.data.split = division.split.clone().unwrap_or(calibrated.data.split);
    calibrated.note_source(&set.source, context.seed());
    let on = format!("{} of {} s", spans_s(&set, &split.training), set.duration_s().round());
    calibrated.provenance.insert("calibrated_on".into(), Entry::Text(on));
    calibrated.write(context.ready(&target)?)?;
    context.say(format!("\nwritten to {}", output.display()));
    context.json(&Output { calibration, rmse })?;
    Ok(ExitCode::SUCCESS)
}

fn spans_s(set: &DataSet, spans: &[phyture::flight::Span]) -> f64 {
    spans.iter().map(|span| (span.end - span.start) as f64 * set.flights[span.flight].step_s).sum::<f64>().round()
}

/// Calibrates, prints coefficients and errors, and gives the errors by part as JSON.
pub fn fit(context: &Context, set: &DataSet, model: &Model, split: &Split) -> Result<(Model, Calibration, Map<String, Value>)> {
    let (calibrated, calibration) = calibrate(model, &set.flights, &split.training)?;
    context.say(format!("\n{calibration}"));
    let cautions = calibrated.effects.iter().filter(|effect| effect.enabled).filter_map(Effect::caution);
    cautions.for_each(|caution| context.say(wrapped("note: ", &caution)));
    calibrated.assumptions().iter().for_each(|text| context.say(wrapped("note: ", text)));
    let parts = [
        ("train", &split.training),
        ("validation", &split.validation),
        (if split.tested == phyture::flight::split::Part::Locked { "locked" } else { "test" }, &split.test),
    ];
    let mut rmse = Map::new();
    context.say(format!("\nRMSE        {}", Column::TARGETS.map(|column| format!("{:>9}", column.name())).concat()));
    for (part, spans) in parts.into_iter().filter(|(_, spans)| !spans.is_empty()) {
        let errors = calibrated.rmse(&set.flights, spans)?;
        context.say(format!("{part:<11} {}", errors.map(|error| format!("{error:>9.3}")).concat()));
        rmse.insert(part.into(), per_channel(&errors)?);
    }
    Ok((calibrated, calibration, rmse))
}

/// Six numbers by channel name, with their mean.
fn per_channel(values: &[f64; 6]) -> Result<Value> {
    let mean = values.iter().sum::<f64>() / 6.0;
    let pairs = Column::TARGETS.iter().map(|column| column.name()).zip(values.iter().copied()).chain([("mean", mean)]);
    pairs.map(|(name, value)| Ok((name.to_owned(), number(value)?))).collect::<Result<Map<_, _>>>().map(Value::Object)
}

fn number(value: f64) -> Result<Value> {
    serde_json::to_value(value).map_err(|error| Error::Undetermined(error.to_string()))
}
