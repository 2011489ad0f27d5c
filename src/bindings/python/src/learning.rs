//! `train` and `predict` for Python: the residual network of a model, and what it or the model alone predicts.

use crate::columns::{Table, bytes};
use crate::division::Division;
use crate::flights::Flights;
use crate::found::Found;
use crate::model::Model;
use crate::network::Network;
use crate::ranges;
use crate::work::{Interrupted, Watched, work};
use phyture::disk::Existing;
use phyture::flight::DataSet;
use phyture::physics::Model as Physics;
use phyture::tape::Threads;
use phyture::train::{Event, RunFolder, TrainConfig, Training};
use phyture::workflow::{Epoch, Predictor, Run, training_digest};
use phyture::{Result, workflow};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A training run.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Learning {
    /// TOML that goes before the defaults.
    config: String,
    /// What errors about it name.
    place: PathBuf,
    /// The paper's sizes as defaults.
    paper: bool,
    epochs: Option<usize>,
    seed: Option<u64>,
    folder: PathBuf,
    resume: bool,
    /// Whether an earlier run in the folder may go.
    force: bool,
}

fn config(text: &str, place: &Path, paper: bool) -> Result<TrainConfig> {
    let base = if paper { TrainConfig::default() } else { TrainConfig::in_minutes() };
    TrainConfig::from_text(text, place, &base)
}

/// The configuration in force as commented TOML: `text` over the defaults.
#[pyfunction]
pub fn training_config(text: &str, place: PathBuf, paper: bool) -> PyResult<String> {
    config(text, &place, paper).and_then(|config| config.template()).map_err(|error| crate::error::raised(&error))
}

impl Learning {
    fn config(&self) -> Result<TrainConfig> {
        let mut config = config(&self.config, &self.place, self.paper)?;
        config.seed = self.seed.unwrap_or(config.seed);
        config.epochs = self.epochs.unwrap_or(config.epochs);
        config.check()?;
        Ok(config)
    }

    fn run(&self, set: &DataSet, model: &Physics, division: &Division, watched: &Watched) -> Result<Run> {
        let config = self.config()?;
        let folder = RunFolder::create(&self.folder)?;
        if !self.resume && folder.is_begun() {
            let existing = if self.force { Existing::Replace } else { Existing::Keep };
            existing.refuse(&self.folder, "a training run (which resume=True goes on with)")?;
        }
        let split = division.wanted()?.split(&set.flights, model, division.seed)?;
        let training = Training {
            flights: &set.flights,
            split: &split,
            model,
            config: &config,
            data: training_digest(set, model, &split)?,
            folder: &folder,
            with_losses: true,
            threads: Threads(0),
        };
        let (mut epoch, mut steps) = (Epoch::default(), 0);
        workflow::train(&training, self.resume, &mut |event| {
            Ok(match event {
                Event::Begins(begun) => {
                    steps = begun.steps;
                    watched.at("training", begun.done, steps)
                }
                Event::Step(report) => {
                    epoch.take(report);
                    watched.at(format!("training, {epoch}"), report.step.step, steps)
                }
            })
        })
    }
}

/// Trains the residual network of a calibrated model; interrupted, its state is saved in the run's folder.
#[pyfunction]
pub fn train(
    py: Python<'_>,
    flights: &Flights,
    model: &Model,
    division: Division,
    learning: Learning,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Network)> {
    let (set, model) = (Arc::clone(&flights.set), Arc::clone(&model.physics));
    work(py, progress, Interrupted::IsWaitedFor, move |watched| {
        let Run { hybrid, network, .. } = learning.run(&set, &model, &division, watched)?;
        let text = format!("trained in {:.0} s: training loss {:.4}", network.seconds, network.training_loss);
        Ok((Found::new(&network, text)?, Network { hybrid: Arc::new(hybrid) }))
    })
}

/// Predictions for every sample that has a full history, beside what was measured.
#[pyfunction]
pub fn predict<'py>(
    py: Python<'py>,
    flights: &Flights,
    who: (Option<Py<Model>>, Option<Py<Network>>),
    stride: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Table<'py>)> {
    let set = Arc::clone(&flights.set);
    let (model, network) = who;
    let model = model.map(|model| Arc::clone(&model.get().physics));
    let hybrid = network.map(|network| Arc::clone(&network.get().hybrid));
    let (found, table) = work(py, progress, Interrupted::IsLeft, move |watched| {
        ranges::check("stride", Some(stride), &ranges::STRIDES)?;
        let predictor = Predictor::new(model.as_deref(), hybrid.as_deref(), "predict")?;
        let predictions =
            predictor.predict(&set, stride, Threads(0), &mut |done, all| watched.at("predicting", done as u64, all as u64))?;
        let summary = predictions.summary(&set, None);
        let text = format!("{} predictions of the {}", summary.rows, summary.of);
        Ok((Found::new(&summary, text)?, predictions.table(&set)))
    })?;
    let numbers = table.numbers.iter().map(|(name, values)| Ok((name.clone(), bytes(py, values)?)));
    let numbers = numbers.collect::<PyResult<_>>()?;
    Ok((found, (table.text, numbers)))
}
