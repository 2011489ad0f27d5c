//! A trained network with its physical model in Python: read, looked at, written.

use crate::error::raised;
use crate::model::Model;
use crate::work::{Interrupted, work};
use phyture::hybrid::Hybrid;
use phyture::workflow::read_network;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A calibrated model with a trained residual network.
#[pyclass(frozen, module = "phyture")]
pub struct Network {
    /// Physics and network.
    pub hybrid: Arc<Hybrid>,
}

#[pymethods]
impl Network {
    /// Reads a trained network: a run folder, or its `network.safetensors`.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let hybrid = work(py, None, Interrupted::IsLeft, move |_| read_network(&path))?;
        Ok(Self { hybrid: Arc::new(hybrid) })
    }

    /// Writes its one file, with model and scales.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.hybrid.write(&path).map_err(|error| raised(&error))
    }

    /// The model that it was trained on.
    #[getter]
    fn model(&self) -> Model {
        Model::new(self.hybrid.description().model.clone())
    }

    /// Samples that a prediction needs.
    #[getter]
    fn history(&self) -> usize {
        self.hybrid.description().config.history()
    }

    /// Step of the data that it was trained on, s.
    #[getter]
    fn step_s(&self) -> f64 {
        self.hybrid.description().step_s
    }

    fn __repr__(&self) -> String {
        let description = self.hybrid.description();
        let (name, history) = (description.config.name(), description.config.history());
        format!("<phyture.Network {name} on `{}`: {history} samples of {} s>", description.model.name, description.step_s)
    }
}
