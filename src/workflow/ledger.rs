//! The ledger of a loop: a line of JSON for each effect that was added to a model, and what spoke for it.

use crate::critique::ChannelValues;
use crate::critique::diagnose::{Diagnosis, Number, ParameterValue};
use crate::disk::append_lines;
use crate::error::{Error, Result};
use serde::Serialize;
use std::path::Path;

/// One line of the ledger.
#[derive(Serialize)]
struct LedgerLine<'a> {
    round: usize,
    effect: &'a str,
    coefficients: &'a [Number],
    parameters: &'a [ParameterValue],
    selection_frequency: f64,
    indistinguishable: &'a [String],
    p_value: f64,
    rmse_locked: Option<ChannelValues>,
    data_sha256: &'a str,
    version: &'a str,
}

/// Adds the effects of a round at the end of a ledger, a line each, and never changes what is there. A round that a killed run has written stands
/// in it once.
///
/// # Errors
/// [`Error::Io`].
pub fn append_to_ledger(ledger: &Path, round: usize, diagnosis: &Diagnosis) -> Result<()> {
    let mut lines = Vec::new();
    for step in &diagnosis.steps {
        let line = LedgerLine {
            round,
            effect: &step.effect,
            coefficients: &step.coefficients,
            parameters: &step.parameters,
            selection_frequency: step.selection_frequency,
            indistinguishable: &step.indistinguishable,
            p_value: step.p_value,
            rmse_locked: diagnosis
                .locked
                .as_ref()
                .and_then(|locked| locked.waterfall.iter().find(|bar| bar.added.contains(&step.effect)))
                .map(|bar| bar.rmse),
            data_sha256: &diagnosis.data_sha256,
            version: &diagnosis.version,
        };
        lines.push(serde_json::to_string(&line).map_err(|error| Error::Undetermined(error.to_string()))?);
    }
    append_lines(ledger, &lines)
}
