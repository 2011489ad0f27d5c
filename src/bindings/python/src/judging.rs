//! `compare` and `rollout` for Python: models and networks judged on flights that were kept back.

use crate::division::Division;
use crate::flights::Flights;
use crate::found::Found;
use crate::model::Model;
use crate::network::Network;
use crate::ranges;
use crate::work::{Interrupted, Watched, work};
use phyture::Result;
use phyture::flight::DataSet;
use phyture::flight::split::Split;
use phyture::flight::windows::windows;
use phyture::hybrid::Hybrid;
use phyture::physics::Model as Physics;
use phyture::report::{Page, compare_page, rollout_page};
use phyture::tape::Threads;
use phyture::workflow::{Contest, Judged, Rolling, affordable_stride, provenance, rows_needed};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Models and networks by name, as Python gives them.
type Named<T> = Vec<(String, Py<T>)>;

/// Those that are judged.
type Who = (Named<Model>, Named<Network>);

/// Who is judged, and on what.
struct Judging {
    set: Arc<DataSet>,
    place: PathBuf,
    models: Vec<(String, Physics)>,
    networks: Vec<(String, Hybrid)>,
    division: Division,
    all: bool,
}

impl Judging {
    fn new(flights: &Flights, (models, networks): &Who, division: Division, all: bool) -> Result<Self> {
        let copy = |hybrid: &Hybrid| hybrid.on(hybrid.description().model.clone());
        Ok(Self {
            set: Arc::clone(&flights.set),
            place: flights.place.clone(),
            models: models.iter().map(|(name, model)| (name.clone(), Physics::clone(&model.get().physics))).collect(),
            networks: networks
                .iter()
                .map(|(name, network)| Ok((name.clone(), copy(&network.get().hybrid)?)))
                .collect::<Result<_>>()?,
            division,
            all,
        })
    }

    fn split(&self) -> Result<Split> {
        let of_networks = self.networks.iter().map(|(_, hybrid)| &hybrid.description().model);
        let all: Vec<&Physics> = self.models.iter().map(|(_, model)| model).chain(of_networks).collect();
        self.division.wanted()?.judged(&self.set.flights, &all, self.division.seed, self.all)
    }

    fn provenance(&self, command: &str) -> Vec<(String, String)> {
        let of_networks = self.networks.iter().map(|(name, _)| name.as_str());
        let names: Vec<&str> = self.models.iter().map(|(name, _)| name.as_str()).chain(of_networks).collect();
        provenance(command, &self.place, &self.set, &names, self.division.seed)
    }
}

/// How models are compared.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Comparing {
    all: bool,
    stride: Option<usize>,
    ridge: Option<usize>,
    uncertainty: bool,
}

impl Comparing {
    fn contest<'a>(&self, judging: &'a Judging, stride: usize) -> Contest<'a> {
        Contest {
            models: &judging.models,
            networks: &judging.networks,
            ridge: self.ridge,
            history: rows_needed(&judging.networks, self.ridge),
            stride,
            uncertainty: self.uncertainty,
            seed: judging.division.seed,
            threads: Threads(0),
        }
    }

    fn judged(&self, judging: &Judging, split: &Split, explainable: Option<&DataSet>, watched: &Watched) -> Result<Judged> {
        let set = &judging.set;
        ranges::check("stride", self.stride, &ranges::STRIDES)?;
        ranges::check("ridge", self.ridge, &ranges::LAGS)?;
        let every = windows(&split.test, rows_needed(&judging.networks, self.ridge), 1);
        watched.at("timing the networks", 0, 0);
        let stride = match self.stride {
            Some(stride) => stride,
            None => affordable_stride(&set.flights, &every, &judging.networks, Threads(0))?.stride,
        };
        watched.at("comparing", 0, 0);
        let mut judged = self.contest(judging, stride).run(set, split)?;
        if let Some(explainable) = explainable {
            judged.set_floor(set, &explainable.flights)?;
        }
        Ok(judged)
    }

    /// The page, with lines of the worst and a typical stretch.
    fn page(&self, judging: &Judging, split: &Split, judged: &Judged) -> Result<Page> {
        let mut traced = Judged {
            comparison: judged.comparison.clone(),
            windows: judged.windows.clone(),
            rows: judged.rows.clone(),
            traced: Vec::new(),
        };
        self.contest(judging, judged.comparison.stride).trace(&judging.set, split, &mut traced)?;
        compare_page(&traced.report(&judging.set, &judging.provenance("compare")))
    }
}

/// Measured against predicted for each model and network, beside honest yardsticks.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    flights: &Flights,
    who: Who,
    division: Division,
    comparing: Comparing,
    explainable: Option<&Flights>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let explainable = explainable.map(|flights| Arc::clone(&flights.set));
    let judging = Judging::new(flights, &who, division, comparing.all).map_err(|error| crate::error::raised(&error))?;
    work(py, progress, Interrupted::IsLeft, move |watched| {
        let split = judging.split()?;
        let judged = comparing.judged(&judging, &split, explainable.as_deref(), watched)?;
        let found = Found::new(&judged.comparison, &judged.comparison)?;
        Ok(found.drawn(Arc::new(move || comparing.page(&judging, &split, &judged))))
    })
}

/// How models are rolled out.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RollingOut {
    all: bool,
    horizon: usize,
    stride: usize,
}

/// Open-loop prediction from measured states under the measured controls.
#[pyfunction]
pub fn rollout(
    py: Python<'_>,
    flights: &Flights,
    who: Who,
    division: Division,
    rolling: RollingOut,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let judging = Judging::new(flights, &who, division, rolling.all).map_err(|error| crate::error::raised(&error))?;
    work(py, progress, Interrupted::IsLeft, move |watched| {
        let split = judging.split()?;
        watched.at("rolling out", 0, 0);
        let (horizon, stride) = (rolling.horizon, rolling.stride);
        ranges::check("horizon", Some(horizon), &ranges::HORIZONS)?;
        ranges::check("stride", Some(stride), &ranges::STRIDES)?;
        let result = Rolling { models: &judging.models, networks: &judging.networks, horizon, stride }.run(&judging.set, &split)?;
        let found = Found::new(&result, &result)?;
        Ok(found.drawn(Arc::new(move || Ok(rollout_page(&result, &judging.provenance("rollout"))))))
    })
}
