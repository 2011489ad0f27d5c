//! A physical model in Python: read, made, looked at, changed by making another.

use crate::error::raised;
use phyture::flight::Channel;
use phyture::physics::{Effect, Model as Physics};
use phyture::{Error, Result};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A first-principles model of a helicopter: what its file holds.
#[pyclass(frozen, eq, module = "phyture")]
#[derive(PartialEq)]
pub struct Model {
    /// The model.
    pub physics: Arc<Physics>,
}

impl Model {
    /// As Python holds it.
    pub fn new(physics: Physics) -> Self {
        Self { physics: Arc::new(physics) }
    }
}

fn own_effect(name: &str, channel: &str, formula: &str, value: f64) -> Result<Effect> {
    let known = || Channel::ALL.map(Channel::name).join(", ");
    let channel = Channel::ALL.into_iter().find(|known| known.name() == channel).ok_or_else(|| Error::Config {
        place: "formula".into(),
        field: "channel".into(),
        found: format!("`{channel}`"),
        expected: format!("one of {}", known()),
    })?;
    Effect::formula(name, channel, formula, value)
}

#[pymethods]
impl Model {
    /// Reads a model file (TOML).
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Physics::read(&path).map(Self::new).map_err(|error| raised(&error))
    }

    /// Reads the text of a model file.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        Physics::from_toml(text, Path::new("model")).map(Self::new).map_err(|error| raised(&error))
    }

    /// The paper's baseline with all coefficients zero: mass in kg, diagonal inertia in kg m² (ratios matter), rotor radius in m.
    #[staticmethod]
    fn paper(name: &str, mass_kg: f64, inertia: [f64; 3], rotor_radius_m: f64) -> PyResult<Self> {
        // By way of its file, which refuses numbers that no aircraft has.
        Self::from_toml(&Physics::paper(name, mass_kg, inertia, rotor_radius_m).to_toml().map_err(|error| raised(&error))?)
    }

    /// Writes a model file, in one step, over what is there.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.physics.write(&path).map_err(|error| raised(&error))
    }

    /// The text of its file.
    fn to_toml(&self) -> PyResult<String> {
        self.physics.to_toml().map_err(|error| raised(&error))
    }

    #[pyo3(signature = (name, channel, formula, value=0.0))]
    /// The same model with one effect more, `coefficient * formula` on one acceleration (`vx_dot` … `wz_dot`), in place of one of this name.
    fn with_formula(&self, name: &str, channel: &str, formula: &str, value: f64) -> PyResult<Self> {
        let effect = own_effect(name, channel, formula, value).map_err(|error| raised(&error))?;
        let mut physics = Physics::clone(&self.physics);
        physics.effects.retain(|known| known.name != name);
        physics.effects.push(effect);
        Ok(Self::new(physics))
    }

    /// The same model without one effect.
    fn without(&self, name: &str) -> PyResult<Self> {
        let mut physics = Physics::clone(&self.physics);
        physics.effects.retain(|known| known.name != name);
        if physics.effects.len() == self.physics.effects.len() {
            let known: Vec<&str> = physics.effects.iter().map(|effect| effect.name.as_str()).collect();
            return Err(raised(&Error::Config {
                place: format!("model `{}`", physics.name),
                field: "effect".into(),
                found: format!("`{name}`"),
                expected: format!("one of {}", known.join(", ")),
            }));
        }
        Ok(Self::new(physics))
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.physics.name
    }

    /// Mass, kg.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.physics.mass_kg
    }

    /// Diagonal of the inertia tensor, kg m².
    #[getter]
    fn inertia(&self) -> [f64; 3] {
        self.physics.inertia
    }

    /// Rotor radius, m.
    #[getter]
    fn rotor_radius_m(&self) -> f64 {
        self.physics.rotor_radius_m
    }

    /// The effects in the order in which they are summed, each a dict of what the library knows of it.
    #[getter]
    fn effects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.physics.effects);
        let text = text.map_err(|error| raised(&Error::Undetermined(error.to_string())))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        let enabled = self.physics.effects.iter().filter(|effect| effect.enabled).count();
        format!("<phyture.Model `{}`: {enabled} effects, {}>", self.physics.name, self.physics.vehicle_text())
    }
}
