//! A model calibrated on the part of the flights that trains, with its errors by part. The fits themselves are `physics`'s.

use super::Division;
use crate::error::Result;
use crate::flight::split::{Part, Split};
use crate::flight::{Column, DataSet, PerChannel};
use crate::physics::{Calibration, Entry, Model, OutputError, Weights, calibrate_weighed, output_error};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

/// Flights, and what of them trains.
#[derive(Clone, Copy)]
pub struct Calibrating<'a> {
    /// Flights.
    pub set: &'a DataSet,
    /// What trains and what tests.
    pub split: &'a Split,
    /// What counts alike in the fit to samples.
    pub weights: Weights,
}

/// The errors of a model's accelerations on one part of the flights.
#[derive(Clone, Debug, PartialEq)]
pub struct PartRmse {
    /// `train`, `validation`, `test` or `locked`.
    pub part: &'static str,
    /// Root mean square error, m/s² and rad/s².
    pub rmse: PerChannel<f64>,
}

/// A calibrated model and what is known of it. As data it is the calibration, the errors by part, and the fit to rollouts, without the model.
#[derive(Clone, Debug, Serialize)]
pub struct Calibrated {
    /// The model with its numbers.
    #[serde(skip)]
    pub model: Model,
    /// What was fitted.
    #[serde(flatten)]
    pub calibration: Calibration,
    /// Errors of the model as it is now, of every part that there is.
    #[serde(serialize_with = "by_part")]
    pub rmse: Vec<PartRmse>,
    /// The fit to rollouts, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_error: Option<OutputError>,
}

impl Calibrating<'_> {
    /// Least squares of the model's coefficients on the accelerations of the training part.
    ///
    /// # Errors
    /// As [`calibrate_weighed`] and [`Model::rmse`].
    pub fn fit(&self, model: &Model) -> Result<Calibrated> {
        let (mut model, calibration) = calibrate_weighed(model, &self.set.flights, &self.split.training, self.weights)?;
        match self.weights {
            Weights::Rows => drop(model.provenance.remove("weights")),
            Weights::Flights => drop(model.provenance.insert("weights".into(), Entry::Text("flights".into()))),
        }
        let rmse = self.rmse(&model)?;
        Ok(Calibrated { model, calibration, rmse, output_error: None })
    }

    /// Then fits the numbers to rollouts of `horizon` steps. `progress` is told the step that begins, of so many at most, and ends the fit by
    /// saying `false`: the numbers are then the best so far.
    ///
    /// # Errors
    /// As [`output_error`] and [`Model::rmse`].
    pub fn fit_rollouts(
        &self,
        calibrated: Calibrated,
        horizon: usize,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<Calibrated> {
        let (mut model, found) = output_error(&calibrated.model, &self.set.flights, &self.split.training, horizon, progress)?;
        let rmse = self.rmse(&model)?;
        model.provenance.insert("fitted_to".into(), Entry::Text(format!("rollouts of {horizon} steps")));
        Ok(Calibrated { model, rmse, output_error: Some(found), ..calibrated })
    }

    /// Notes in the model what its file says beside its numbers: how the flights are divided, and what it was calibrated on.
    pub fn note(&self, model: &mut Model, division: &Division, seed: u64) {
        division.note(model);
        if let Some(split) = &division.split {
            model.data.split = split.clone();
        }
        model.note_source(&self.set.source, seed);
        let spans = self.split.training.iter();
        let trained_s: f64 = spans.map(|span| (span.end - span.start) as f64 * self.set.flights[span.flight].step_s).sum();
        let on = format!("{} of {} s", trained_s.round(), self.set.duration_s().round());
        model.provenance.insert("calibrated_on".into(), Entry::Text(on));
    }

    fn rmse(&self, model: &Model) -> Result<Vec<PartRmse>> {
        let Split { training, validation, test, tested } = self.split;
        let test_part = if *tested == Part::Locked { "locked" } else { "test" };
        let parts = [("train", training), ("validation", validation), (test_part, test)];
        let flights = &self.set.flights;
        let there_is = parts.into_iter().filter(|(_, spans)| !spans.is_empty());
        there_is.map(|(part, spans)| Ok(PartRmse { part, rmse: model.rmse(flights, spans)? })).collect()
    }
}

/// `{"train": {"vx_dot": …, "mean": …}, …}`; a number that is not finite is null.
fn by_part<S: Serializer>(parts: &[PartRmse], serializer: S) -> Result<S::Ok, S::Error> {
    let object = |PartRmse { part, rmse }: &PartRmse| {
        let mean = rmse.iter().sum::<f64>() / 6.0;
        let named = Column::TARGETS.iter().map(|column| column.name()).zip(rmse.iter().copied()).chain([("mean", mean)]);
        let channels: Map<String, Value> = named.map(|(name, value)| (name.to_owned(), Value::from(value))).collect();
        ((*part).to_owned(), Value::Object(channels))
    };
    parts.iter().map(object).collect::<Map<String, Value>>().serialize(serializer)
}
