//! Flights in Python: read from files, given as columns, or simulated; looked at, written, and never changed.

use crate::columns::{array, bytes, frame, given};
use crate::error::raised;
use crate::work::{Interrupted, work};
use phyture::flight::read::{ReadOptions, data_set, of_columns};
use phyture::flight::{Column, DataSet, Flight, write};
use phyture::sim::{Level, Simulation, simulate_with_explainable};
use phyture::workflow::without;
use phyture::{Error, Result};
use pyo3::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

/// Flights of one data set, sorted by manoeuvre and name.
#[pyclass(frozen, module = "phyture")]
pub struct Flights {
    /// The flights.
    pub set: Arc<DataSet>,
    /// Where they come from, for pages.
    pub place: PathBuf,
    /// What a model could explain of them, where that is known.
    pub explainable: Option<Arc<DataSet>>,
}

impl Flights {
    fn new(set: DataSet, place: impl Into<PathBuf>) -> Self {
        Self { set: Arc::new(set), place: place.into(), explainable: None }
    }

    fn flight(&self, name: &str) -> Result<&Flight> {
        let found = phyture::flight::names::find(&self.set.flights, name);
        if let [one] = found.as_slice() {
            return Ok(&self.set.flights[*one]);
        }
        let known: Vec<&str> = self.set.flights.iter().map(|flight| flight.name.as_str()).collect();
        Err(Error::Config {
            place: "flights".into(),
            field: "flight".into(),
            found: format!("`{name}`, which is the name of {} flights", found.len()),
            expected: format!("the name of one: {}", known.join(", ")),
        })
    }
}

/// How flights are read, as the library takes it.
fn options(dataset: Option<PathBuf>, described: Option<String>, split_at_gaps: bool, minimum_rows: usize) -> ReadOptions {
    ReadOptions { minimum_rows, split_at_gaps, dataset, described }
}

#[pymethods]
impl Flights {
    /// Reads flights as the command line does: a folder `DATA/<manoeuvre>/<flight>.csv`, or one CSV, Parquet, PX4 or ArduPilot log.
    ///
    /// `dataset` is the file of a description, `described` its text, in place of a `dataset.toml` beside the logs. `leave_out` names
    /// flights, or "suspects": all that a check finds read otherwise than the rest. Logs shorter than `minimum_rows` are refused;
    /// `split_at_gaps` turns a flight with gaps in its time into several.
    #[staticmethod]
    #[pyo3(signature = (path, *, dataset=None, described=None, split_at_gaps=false, leave_out=Vec::new(), minimum_rows=1))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        dataset: Option<PathBuf>,
        described: Option<String>,
        split_at_gaps: bool,
        leave_out: Vec<String>,
        minimum_rows: usize,
    ) -> PyResult<Self> {
        let place = path.clone();
        let options = options(dataset, described, split_at_gaps, minimum_rows);
        let set = work(py, None, Interrupted::IsLeft, move |_| without(data_set(&path, &options)?, &leave_out))?;
        Ok(Self::new(set, place))
    }

    /// Flights of columns in memory: by the name of the flight, a mapping of names to arrays, or a frame of pandas or polars.
    ///
    /// A name is "hover/flight_0" (the class before the slash) or "hover_03". Columns are those of a log in a file: `t` in s, `x y z` in m,
    /// `roll pitch yaw` in rad, `vx vy vz` in m/s in body axes, `wx wy wz` in rad/s, `u1 u2 u3 u4`, and the accelerations `vx_dot vy_dot vz_dot`
    /// in m/s² and `wx_dot wy_dot wz_dot` in rad/s², which are derived where they are not there. `described` is the text of a `dataset.toml` for
    /// columns that differ. In errors the first sample stands in line 2, as it does in a file.
    #[staticmethod]
    #[pyo3(signature = (flights, *, dataset=None, described=None, split_at_gaps=false, leave_out=Vec::new(), minimum_rows=1))]
    fn from_columns(
        py: Python<'_>,
        flights: &Bound<'_, PyAny>,
        dataset: Option<PathBuf>,
        described: Option<String>,
        split_at_gaps: bool,
        leave_out: Vec<String>,
        minimum_rows: usize,
    ) -> PyResult<Self> {
        let logs = given(flights)?;
        let options = options(dataset, described, split_at_gaps, minimum_rows);
        let set = work(py, None, Interrupted::IsLeft, move |_| without(of_columns(logs, &options)?, &leave_out))?;
        Ok(Self::new(set, "columns"))
    }

    fn __len__(&self) -> usize {
        self.set.flights.len()
    }

    fn __repr__(&self) -> String {
        let (flights, classes) = (self.set.flights.len(), self.set.manoeuvres().len());
        format!("<phyture.Flights: {flights} flights, {classes} manoeuvre classes, {:.0} s>", self.set.duration_s())
    }

    /// Names of the flights, in their order.
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.set.flights.iter().map(|flight| flight.name.as_str()).collect()
    }

    /// Manoeuvre class of each flight.
    #[getter]
    fn manoeuvres(&self) -> Vec<&str> {
        self.set.flights.iter().map(|flight| flight.manoeuvre.as_str()).collect()
    }

    /// Step of each flight, s.
    #[getter]
    fn steps_s(&self) -> Vec<f64> {
        self.set.flights.iter().map(|flight| flight.step_s).collect()
    }

    /// Length of all flights together, s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.set.duration_s()
    }

    /// What the reader did that a person should know.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.set.notes.clone()
    }

    /// SHA-256 over names and contents of what was read; empty for simulated flights.
    #[getter]
    fn sha256(&self) -> &str {
        &self.set.source.sha256
    }

    /// What a model could explain of simulated flights, for `explainable` of `compare`, `diagnose` and `loop`; None for others.
    #[getter]
    fn explainable(&self) -> Option<Self> {
        let set = self.explainable.clone()?;
        Some(Self { set, place: self.place.join("explainable"), explainable: None })
    }

    /// The same flights without those of these names, or without "suspects".
    fn leave_out(&self, py: Python<'_>, names: Vec<String>) -> PyResult<Self> {
        let set = Arc::clone(&self.set);
        let set = work(py, None, Interrupted::IsLeft, move |_| without(DataSet::clone(&set), &names))?;
        Ok(Self::new(set, self.place.clone()))
    }

    /// Writes the flights as `folder/<manoeuvre>/<flight>.csv`, as `read` and the command line read them; numbers keep their bits.
    fn write(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let set = Arc::clone(&self.set);
        work(py, None, Interrupted::IsWaitedFor, move |_| write::data_set_csv(&folder, &set.flights))
    }

    /// One column of one flight as a NumPy array, in the unit of the column.
    fn column<'py>(&self, py: Python<'py>, flight: &str, column: &str) -> PyResult<Bound<'py, PyAny>> {
        let flight = self.flight(flight).map_err(|error| raised(&error))?;
        let unknown = || Error::Config {
            place: format!("flight `{}`", flight.name),
            field: "column".into(),
            found: format!("`{column}`"),
            expected: "a canonical column or one of the log's own".into(),
        };
        array(py, flight.named(column).ok_or_else(unknown).map_err(|error| raised(&error))?)
    }

    /// All flights as one pandas frame: `manoeuvre`, `flight`, `t` in s, then the columns of the logs.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let flights = &self.set.flights;
        let text = |of: &dyn Fn(&Flight) -> &str| -> Vec<String> {
            flights.iter().flat_map(|flight| std::iter::repeat_n(of(flight).to_owned(), flight.len())).collect()
        };
        let texts =
            vec![("manoeuvre".to_owned(), text(&|flight| &flight.manoeuvre)), ("flight".to_owned(), text(&|flight| &flight.name))];
        let times: Vec<f64> = flights.iter().flat_map(|flight| (0..flight.len()).map(|sample| flight.time_s(sample))).collect();
        let mut numbers = vec![("t".to_owned(), bytes(py, &times)?)];
        let own = flights.iter().flat_map(|flight| flight.extra.keys().cloned());
        let own: BTreeSet<String> = own.collect();
        for name in Column::ALL.map(|column| column.name().to_owned()).into_iter().chain(own) {
            let of_flight = |flight: &Flight| flight.named(&name).map_or_else(|| vec![f64::NAN; flight.len()], <[f64]>::to_vec);
            let values: Vec<f64> = flights.iter().flat_map(of_flight).collect();
            numbers.push((name, bytes(py, &values)?));
        }
        frame(py, (texts, numbers))
    }
}

/// What is simulated.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Session {
    minutes: f64,
    seed: u64,
    /// Mechanisms and their scales; the full truth without.
    hide: Option<BTreeMap<String, f64>>,
    level: Option<String>,
    classes: Option<Vec<String>>,
}

impl Session {
    fn simulation(self) -> Result<Simulation> {
        let base = if self.hide.is_some() { Simulation::baseline() } else { Simulation::default() };
        let level = match self.level.as_deref() {
            None => base.level,
            Some("quiet") => Level::QUIET,
            Some("0") => Level::ZERO,
            Some("1") => Level::ONE,
            Some("2") => Level::TWO,
            Some(other) => {
                let (place, field) = ("simulation".into(), "level".into());
                let expected = "`quiet`, `0`, `1` or `2`".into();
                return Err(Error::Config { place, field, found: format!("`{other}`"), expected });
            }
        };
        let simulation = Simulation { minutes: self.minutes, seed: self.seed, level, classes: self.classes, ..base };
        self.hide.unwrap_or_default().into_iter().try_fold(simulation, |simulation, (id, scale)| simulation.hide(&id, scale))
    }
}

/// Flies the built-in truth helicopter.
#[pyfunction]
pub fn simulate(py: Python<'_>, session: Session) -> PyResult<Flights> {
    let (set, explainable) = work(py, None, Interrupted::IsLeft, move |_| simulate_with_explainable(&session.simulation()?))?;
    Ok(Flights { explainable: Some(Arc::new(explainable)), ..Flights::new(set, "simulation") })
}
