//! `check`: conventions, timing and excitation of a data set.

use super::{CHECK_FAILED, Context};
use crate::arguments::Data;
use phyture::Result;
use phyture::critique::check::{CheckReport, check};
use std::path::Path;
use std::process::ExitCode;

/// Checks and prints; exit code 3 on a convention fault, after the report is written.
pub fn run(context: &Context, data: &Data, model: Option<&Path>) -> Result<ExitCode> {
    let set = context.flights(data, 1)?;
    let model = context.model_if_any(model, data)?;
    let report = check(&set, model.as_ref());
    // The notes on the data have been said, and folded.
    context.say(format!("\n{}", CheckReport { notes: Vec::new(), ..report.clone() }));
    context.json(&report)?;
    Ok(if report.fault { ExitCode::from(CHECK_FAILED) } else { ExitCode::SUCCESS })
}
