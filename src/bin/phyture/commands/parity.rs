//! `parity`: forward, backward and one Adam step against the figures that a file brings from PyTorch.

use super::Context;
use phyture::Result;
use phyture::nn::parity::compare;
use std::path::Path;
use std::process::ExitCode;

/// Computes, compares and prints the largest relative error of every tensor.
pub fn run(context: &Context, file: &Path) -> Result<ExitCode> {
    let report = compare(file, context.threads())?;
    context.say(&report);
    context.json(&report)?;
    Ok(ExitCode::SUCCESS)
}
