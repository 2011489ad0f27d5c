//! `calibrate`: least squares of the model's coefficients on the training part, and a model file to go on with.

use crate::arguments::{Data, Division, HORIZONS, count};
use crate::context::{Context, interruption};
use crate::output::Progress;
use phyture::critique::wrap::wrapped;
use phyture::flight::split::Split;
use phyture::flight::{Column, DataSet, PerChannel};
use phyture::physics::{Calibration, Effect, Entry, Model, OutputError, calibrate, output_error};
use phyture::{Error, Result};
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// What `--json` writes.
#[derive(Serialize)]
struct Output {
    #[serde(flatten)]
    calibration: Calibration,
    rmse: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    output_error: Option<OutputError>,
}

/// Least squares of the model's coefficients on the training part
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture calibrate flights -m n9.toml -o n9-calibrated.toml\n  phyture calibrate flights -m n9.toml -o n9-ahead.toml --output-error     # so that rollouts of 50 steps fit"
)]
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
    /// Then fit the numbers to rollouts (output error): what is predicted over --horizon steps, not the accelerations of each sample
    #[arg(long)]
    pub output_error: bool,
    /// Steps of the log in a rollout, with --output-error
    #[arg(
        long, default_value_t = 50, value_name = "STEPS", allow_negative_numbers = true, requires = "output_error",
        value_parser = count(HORIZONS)
    )]
    pub horizon: usize,
    /// What trains and what tests.
    #[command(flatten)]
    pub division: Division,
}

/// Calibrates a model on the training part and writes it.
pub fn run(context: &Context, wanted: &Args) -> Result<ExitCode> {
    let Args { data, model, output, division, .. } = wanted;
    let model = model.as_deref();
    let target = context.new_file(output, model.as_slice())?;
    let set = context.flights(data, 1)?;
    let model = context.model(model, data)?;
    let split = context.split(&set.flights, &model, division)?;
    let (mut calibrated, calibration, mut rmse) = fit(context, &set, &model, &split)?;
    let mut refined = None;
    if wanted.output_error {
        let (model, found) = fit_rollouts(context, &set, &calibrated, &split, wanted.horizon)?;
        rmse = print_errors(context, &set, &model, &split)?;
        calibrated = model;
        calibrated.provenance.insert("fitted_to".into(), Entry::Text(format!("rollouts of {} steps", wanted.horizon)));
        refined = Some(found);
    }
    calibrated.data.locked.extend(division.lock.iter().filter(|name| !model.data.locked.contains(name)).cloned());
    calibrated.data.split = division.split.clone().unwrap_or(calibrated.data.split);
    calibrated.note_source(&set.source, context.seed());
    let on = format!("{} of {} s", spans_s(&set, &split.training), set.duration_s().round());
    calibrated.provenance.insert("calibrated_on".into(), Entry::Text(on));
    calibrated.write(context.ready(&target)?)?;
    context.say(format!("\nwritten to {}", output.display()));
    context.json(&Output { calibration, rmse, output_error: refined })?;
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
    let rmse = print_errors(context, set, &calibrated, split)?;
    Ok((calibrated, calibration, rmse))
}

/// Fits the numbers to rollouts; an interruption leaves those of the last step.
fn fit_rollouts(context: &Context, set: &DataSet, model: &Model, split: &Split, horizon: usize) -> Result<(Model, OutputError)> {
    let interrupted = interruption()?;
    let mut progress: Option<Progress> = None;
    let fitted = output_error(model, &set.flights, &split.training, horizon, &mut |step, most| {
        let progress = progress.get_or_insert_with(|| Progress::new("fitting rollouts, steps at most", most as u64, 0));
        progress.at(step as u64, String::new);
        !interrupted.load(Ordering::Relaxed)
    })?;
    drop(progress);
    context.say(format!("\nOutput error, begun with these numbers:\n{}", fitted.1));
    fitted.0.sign_doubts().iter().for_each(|doubt| context.say(wrapped("note: ", &doubt.to_string())));
    Ok(fitted)
}

/// Prints the errors of the accelerations by part, and gives them as JSON.
fn print_errors(context: &Context, set: &DataSet, calibrated: &Model, split: &Split) -> Result<Map<String, Value>> {
    let parts = [
        ("train", &split.training),
        ("validation", &split.validation),
        (if split.tested == phyture::flight::split::Part::Locked { "locked" } else { "test" }, &split.test),
    ];
    let mut rmse = Map::new();
    context.say(format!("\nRMSE        {}", Column::TARGETS.map(|column| format!("{:>9}", column.name())).concat()));
    for (part, spans) in parts.into_iter().filter(|(_, spans)| !spans.is_empty()) {
        let errors = calibrated.rmse(&set.flights, spans)?;
        context.say(format!("{part:<11} {}", errors.map(|error| format!("{error:>9.3}")).values().concat()));
        rmse.insert(part.into(), per_channel(&errors)?);
    }
    Ok(rmse)
}

/// Six numbers by channel name, with their mean.
fn per_channel(values: &PerChannel<f64>) -> Result<Value> {
    let mean = values.iter().sum::<f64>() / 6.0;
    let pairs = Column::TARGETS.iter().map(|column| column.name()).zip(values.iter().copied()).chain([("mean", mean)]);
    pairs.map(|(name, value)| Ok((name.to_owned(), number(value)?))).collect::<Result<Map<_, _>>>().map(Value::Object)
}

fn number(value: f64) -> Result<Value> {
    serde_json::to_value(value).map_err(|error| Error::Undetermined(error.to_string()))
}
