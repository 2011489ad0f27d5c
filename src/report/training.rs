//! The page of `train`: how the losses of a network fell, epoch by epoch, and what it was trained with. Arranges numbers of a training run; computes none
//! of its own.

use super::figures::{LineData, log_lines};
use super::page::{Cell, DATA_NOTE, Page, Part, Section, Table, data_notes};
use crate::critique::digits::{DIGITS, significant};
use crate::train::{EpochLoss, RolloutConfig, TrainConfig};

/// What a training run came to.
pub struct TrainingReport<'a> {
    /// What it was told.
    pub config: &'a TrainConfig,
    /// Losses of each epoch.
    pub curve: &'a [EpochLoss],
    /// The epoch whose weights were kept, from 1.
    pub epoch: usize,
    /// Trainable numbers.
    pub parameters: usize,
    /// Windows that trained, and that validated.
    pub windows: [usize; 2],
    /// Where the numbers come from: (what, value).
    pub provenance: &'a [(String, String)],
}

/// The page of one run.
pub fn training_page(report: &TrainingReport<'_>) -> Page {
    let TrainingReport { config, curve, epoch, parameters, windows, provenance } = report;
    let shown = |value: f64| significant(value, DIGITS);
    let of_epoch = |index: usize| {
        let kept = curve.get(index)?;
        Some(kept.validation.map_or_else(
            || format!("training loss {}", shown(kept.training)),
            |loss| format!("validation loss {}, training loss {}", shown(loss), shown(kept.training)),
        ))
    };
    let kept = of_epoch(epoch.saturating_sub(1)).unwrap_or_default();
    let what = if config.keep_best { "the best on the validation part" } else { "the last one" };
    let mut summary = vec![
        format!("{}: the weights are those of epoch {epoch} of {}, {what}: {kept}.", config.network.name(), curve.len()),
        format!(
            "{parameters} parameters, {} windows that train and {} that validate. A loss is the mean of the squared errors, summed over the channels, \
             (m/s²)² + (rad/s²)²; in training while dropout is on and the weights move, so that it may lie above the other.",
            windows[0], windows[1]
        ),
    ];
    let rollouts = config.rollout.as_ref().map(|rollout| {
        let RolloutConfig { horizon, starts, weight } = rollout;
        format!(
            "To it comes, with a weight of {weight}, that of {starts} rollouts of {horizon} steps beside the windows of each step."
        )
    });
    summary.extend(rollouts);
    let x: Vec<f64> = (1..=curve.len()).map(|epoch| epoch as f64).collect();
    let line = |name: &str, of: &dyn Fn(&EpochLoss) -> f64| LineData {
        name: name.into(),
        x: x.clone(),
        y: vec![curve.iter().map(of).collect()],
    };
    let mut lines = vec![line("training", &|epoch| epoch.training)];
    if curve.iter().any(|epoch| epoch.validation.is_some()) {
        lines.push(line("validation", &|epoch| epoch.validation.unwrap_or(f64::NAN)));
    }
    let panels = [("loss".to_owned(), "(m/s²)² + (rad/s²)²".to_owned())];
    let figure = log_lines("Losses by epoch", "On a logarithmic axis.", "epoch", &panels, &lines);
    let rows = provenance.iter().filter(|(what, _)| what != DATA_NOTE);
    let rows = rows.map(|(what, value)| vec![Cell::from(what.clone()), Cell::from(value.clone())]).collect();
    let columns = vec![(String::new(), String::new()), (String::new(), String::new())];
    let mut parts = vec![Part::Table(Table { caption: "Provenance".into(), columns, rows })];
    parts.extend(data_notes(provenance));
    Page {
        title: format!("Training of {}", config.network.name()),
        summary,
        first: vec![Part::Figure(figure)],
        sections: vec![Section { title: "Where these numbers come from".into(), parts }],
    }
}
