//! `calibrate`: least squares of the model's coefficients on the training part, and a model file to go on with.

use crate::arguments::{Data, Division, HORIZONS, count};
use crate::context::{Context, interruption};
use crate::output::Progress;
use phyture::Result;
use phyture::critique::wrap::wrapped;
use phyture::flight::Column;
use phyture::physics::{Effect, Model, Weights};
use phyture::workflow::{Calibrated, Calibrating, PartRmse};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Least squares of the model's coefficients on the training part
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture calibrate flights -m n9.toml -o n9-calibrated.toml\n  phyture calibrate flights -m n9.toml -o n9-ahead.toml --output-error     # so that rollouts of 50 steps fit\n  phyture calibrate flights -m n9.toml -o n9-even.toml --weights flights   # calm flights count as much as wild ones"
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
    /// What counts alike: every row, or the rows of every flight relative to how much it accelerates, so that a few wild flights do not
    /// outvote the calm ones
    #[arg(long, default_value = "rows", value_name = "WHAT", value_parser = Weights::NAMES.map(|(name, _)| name))]
    pub weights: String,
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
    let calibrating = Calibrating { set: &set, split: &split, weights: Weights::named(&wanted.weights)? };
    let mut calibrated = fit(context, &calibrating, &model)?;
    if wanted.output_error {
        calibrated = fit_rollouts(context, &calibrating, calibrated, wanted.horizon)?;
    }
    calibrating.note(&mut calibrated.model, &division.wanted(), context.seed());
    calibrated.model.write(context.ready(&target)?)?;
    context.say(format!("\nwritten to {}", output.display()));
    context.json(&calibrated)?;
    Ok(ExitCode::SUCCESS)
}

/// Calibrates, and prints coefficients and errors.
pub fn fit(context: &Context, calibrating: &Calibrating<'_>, model: &Model) -> Result<Calibrated> {
    let found = calibrating.fit(model)?;
    context.say(format!("\n{}", found.calibration));
    let cautions = found.model.effects.iter().filter(|effect| effect.enabled).filter_map(Effect::caution);
    cautions.for_each(|caution| context.say(wrapped("note: ", &caution)));
    found.model.assumptions().iter().for_each(|text| context.say(wrapped("note: ", text)));
    print_errors(context, &found);
    Ok(found)
}

/// Fits the numbers to rollouts; an interruption leaves those of the last step.
fn fit_rollouts(context: &Context, calibrating: &Calibrating<'_>, calibrated: Calibrated, horizon: usize) -> Result<Calibrated> {
    let interrupted = interruption()?;
    let mut progress: Option<Progress> = None;
    let fitted = calibrating.fit_rollouts(calibrated, horizon, &mut |step, most| {
        let progress = progress.get_or_insert_with(|| Progress::new("fitting rollouts, steps at most", most as u64, 0));
        progress.at(step as u64, String::new);
        !interrupted.load(Ordering::Relaxed)
    })?;
    drop(progress);
    if let Some(found) = &fitted.output_error {
        context.say(format!("\nOutput error, begun with these numbers:\n{found}"));
    }
    fitted.model.sign_doubts().iter().for_each(|doubt| context.say(wrapped("note: ", &doubt.to_string())));
    print_errors(context, &fitted);
    Ok(fitted)
}

/// Prints the errors of the accelerations by part.
fn print_errors(context: &Context, calibrated: &Calibrated) {
    context.say(format!("\nRMSE        {}", Column::TARGETS.map(|column| format!("{:>9}", column.name())).concat()));
    for PartRmse { part, rmse } in &calibrated.rmse {
        context.say(format!("{part:<11} {}", rmse.map(|error| format!("{error:>9.3}")).values().concat()));
    }
}
