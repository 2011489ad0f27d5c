//! `parity`: forward, backward and one Adam step against the figures that a file brings from PyTorch.

use crate::context::Context;
use phyture::Result;
use phyture::nn::parity::compare;
use std::path::PathBuf;
use std::process::ExitCode;

/// Forward, backward and an Adam step against the figures a file brings from PyTorch
#[derive(clap::Args)]
#[command(after_help = "Example:\n  phyture parity small_f32.safetensors --json -")]
pub struct Args {
    /// Safetensors file with weights, inputs, outputs and gradients
    pub file: PathBuf,
}

/// Computes, compares and prints the largest relative error of every tensor.
pub fn run(context: &Context, Args { file }: &Args) -> Result<ExitCode> {
    let report = compare(file, context.threads())?;
    context.say(&report);
    context.json(&report)?;
    Ok(ExitCode::SUCCESS)
}
