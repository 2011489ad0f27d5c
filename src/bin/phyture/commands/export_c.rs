//! `export-c`: a model as one file of C, for a flight computer.

use crate::context::Context;
use phyture::Result;
use phyture::disk::write_atomically;
use phyture::physics::Model;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// What `--json` writes.
#[derive(Serialize)]
struct Output<'a> {
    file: &'a PathBuf,
    name: &'a str,
    /// Nothing for a model that takes any step.
    step_s: Option<f64>,
    own_columns: &'a [String],
    by_flight: &'a [String],
}

/// A model as one C file without dependencies: physics alone, for a flight computer
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  phyture export-c n9-calibrated.toml -o n9.c --hz 100\n  cc -std=c99 -c n9.c                        # double\n  cc -std=c99 -DPHYTURE_SINGLE -c n9.c       # float"
)]
pub struct Args {
    /// Model file
    pub model: PathBuf,
    /// C file to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Samples a second; needed where the model remembers earlier samples (lags, delays) or reads the time
    #[arg(long, allow_negative_numbers = true, value_parser = rate)]
    pub hz: Option<f64>,
    /// What all names in the file begin with [default: the model's name]
    #[arg(long)]
    pub name: Option<String>,
}

/// A rate above 0.
fn rate(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|hz: &f64| *hz > 0.0 && hz.is_finite()).ok_or_else(|| "expected a number above 0".to_owned())
}

/// Writes the model as C.
pub fn run(context: &Context, Args { model, output, hz, name }: &Args) -> Result<ExitCode> {
    let target = context.new_file(output, &[])?;
    let model = Model::read(model)?;
    let step_s = hz.map(f64::recip);
    let file = model.export_c(name.as_deref(), step_s)?;
    write_atomically(context.ready(&target)?, |out| out.write_all(file.text.as_bytes()))?;
    context.say(format!("written to {}: `{}_reset` and `{}_step`", output.display(), file.prefix, file.prefix));
    match step_s.filter(|_| file.of_one_step) {
        Some(step_s) => context.say(format!("for samples {step_s} s apart")),
        None => context.say("for samples at any times: nothing is remembered"),
    }
    if !file.own_columns.is_empty() {
        context.say(format!("reads columns of the log's own, argument `own`: {}", file.own_columns.join(", ")));
    }
    if !file.by_flight.is_empty() {
        context.say(format!("note: of each flight, here as for an unknown one: {}", file.by_flight.join(", ")));
    }
    context.json(&Output {
        file: output,
        name: &file.prefix,
        step_s: step_s.filter(|_| file.of_one_step),
        own_columns: &file.own_columns,
        by_flight: &file.by_flight,
    })?;
    Ok(ExitCode::SUCCESS)
}
