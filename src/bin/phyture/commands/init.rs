//! `init`: a description and a model file for logs that have none.

use super::CHECK_FAILED;
use crate::context::Context;
use phyture::Result;
use phyture::critique::init::{Initial, init};
use phyture::critique::wrap::wrapped;
use phyture::disk::write_atomically;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Guess how logs are written, and write a dataset.toml and a model.toml for them; exit code 3 if something is left at fault
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  phyture init flights\n  phyture init log.ulg\n  phyture init flight.csv --output described")]
pub struct Args {
    /// Folder of logs, or one log
    pub data: PathBuf,
    /// Folder for the two files [default: that of the logs]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Output<'a> {
    dataset: PathBuf,
    model: PathBuf,
    #[serde(flatten)]
    initial: &'a Initial,
}

/// Guesses, says what is known and what is not, and writes the two files.
pub fn run(context: &Context, Args { data, output }: &Args) -> Result<ExitCode> {
    let folder = match output {
        Some(folder) => {
            std::fs::create_dir_all(folder).map_err(phyture::Error::io(folder))?;
            folder.clone()
        }
        None if data.is_dir() => data.clone(),
        None => data.parent().map_or_else(PathBuf::new, Into::into),
    };
    let dataset = context.new_file(&folder.join("dataset.toml"), &[])?;
    let model = context.new_file(&folder.join("model.toml"), &[])?;
    let initial = init(data)?;
    context.say(format!("looked at `{}`", initial.log));
    initial.sure.iter().for_each(|sure| context.say(wrapped("known:   ", sure)));
    if !initial.mended.is_empty() {
        context.say(wrapped("known:   ", &format!("by `check`: {}", initial.mended.join(", "))));
    }
    for unknown in &initial.unknown {
        context.say(wrapped("unknown: ", &format!("{}; to find out: {}", unknown.what, unknown.how)));
    }
    for (target, text) in [(&dataset, &initial.dataset), (&model, &initial.model)] {
        write_atomically(context.ready(target)?, |file| file.write_all(text.as_bytes()))?;
        context.say(format!("written to {}", target.path().display()));
    }
    let of = if output.is_some() { format!(" --dataset {}", dataset.path().display()) } else { String::new() };
    context.say(format!("next: read the two files, then phyture check {}{of}", data.display()));
    context.json(&Output { dataset: dataset.path().into(), model: model.path().into(), initial: &initial })?;
    Ok(if initial.reads { ExitCode::SUCCESS } else { ExitCode::from(CHECK_FAILED) })
}
