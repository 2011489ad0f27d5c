//! `check` and `calibrate` for Python.

use crate::division::Division;
use crate::flights::Flights;
use crate::found::Found;
use crate::model::Model;
use crate::ranges;
use crate::work::{Interrupted, work};
use phyture::critique::check as checking;
use phyture::physics::Weights;
use phyture::workflow::Calibrating;
use pyo3::prelude::*;
use std::sync::Arc;

/// What mends the faults of a log: the text of a description, what it mends, and what is left to a person, with the reason.
type Suggested = (String, Vec<String>, Vec<(String, String)>);

/// Conventions, timing and excitation of the flights.
#[pyfunction]
pub fn check(
    py: Python<'_>,
    flights: &Flights,
    model: Option<&Model>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Option<Suggested>)> {
    let (set, model) = (Arc::clone(&flights.set), model.map(|model| Arc::clone(&model.physics)));
    work(py, progress, Interrupted::IsLeft, move |watched| {
        watched.at("checking", 0, 0);
        let report = checking::check(&set, model.as_deref());
        let suggested = report.suggestion(&set.source).map(|suggestion| {
            let open = suggestion.open.into_iter().map(|open| (open.name, open.reason));
            (suggestion.text, suggestion.mends, open.collect())
        });
        Ok((Found::new(&report, &report)?, suggested))
    })
}

/// Least squares of the model's coefficients on the training part; with `horizon` then on rollouts of so many steps.
#[pyfunction]
pub fn calibrate(
    py: Python<'_>,
    flights: &Flights,
    model: &Model,
    division: Division,
    weights: &str,
    horizon: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Model)> {
    let (set, model, weights) = (Arc::clone(&flights.set), Arc::clone(&model.physics), Weights::named(weights));
    work(py, progress, Interrupted::IsLeft, move |watched| {
        ranges::check("horizon", horizon, &ranges::HORIZONS)?;
        let (wanted, seed) = (division.wanted()?, division.seed);
        let split = wanted.split(&set.flights, &model, seed)?;
        let calibrating = Calibrating { set: &set, split: &split, weights: weights? };
        watched.at("calibrating", 0, 0);
        let mut found = calibrating.fit(&model)?;
        if let Some(horizon) = horizon {
            found = calibrating.fit_rollouts(found, horizon, &mut |step, most| {
                watched.at("fitting rollouts, steps at most", step as u64, most as u64)
            })?;
        }
        calibrating.note(&mut found.model, &wanted, seed);
        let text = match &found.output_error {
            Some(refined) => refined.to_string(),
            None => found.calibration.to_string(),
        };
        Ok((Found::new(&found, text)?, Model::new(found.model)))
    })
}
