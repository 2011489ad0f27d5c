//! `diagnose` and `loop` for Python: which physical effect is missing.

use crate::division::Division;
use crate::flights::Flights;
use crate::found::Found;
use crate::model::Model;
use crate::network::Network;
use crate::ranges;
use crate::work::{Interrupted, Watched, work};
use phyture::critique::check::check;
use phyture::critique::diagnose::{Diagnosis, LoopText, Options, calibrated, searched};
use phyture::flight::split::{Part, Split};
use phyture::flight::{DataSet, Flight};
use phyture::hybrid::Hybrid;
use phyture::physics::Model as Physics;
use phyture::report::{DiagnoseReport, Page, diagnose_page};
use phyture::tape::Threads;
use phyture::workflow::{Looped, SearchTask, append_to_ledger, convention_fault, network_search, provenance};
use phyture::{Error, Result};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// How a search is done.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Searching {
    max_effects: Option<usize>,
    formulas: bool,
    /// Model file of a loop; its ledger lies beside it.
    output: Option<PathBuf>,
}

/// Flights that are searched, and everything that a page about them says.
struct Searched {
    set: Arc<DataSet>,
    split: Split,
    place: PathBuf,
    command: &'static str,
    seed: u64,
    explainable: Option<Vec<Flight>>,
}

impl Searched {
    fn new(flights: &Flights, command: &'static str, division: &Division, explainable: Option<&Flights>) -> Self {
        let nothing = Split { training: Vec::new(), validation: Vec::new(), test: Vec::new(), tested: Part::Test };
        Self {
            set: Arc::clone(&flights.set),
            split: nothing,
            place: flights.place.clone(),
            command,
            seed: division.seed,
            explainable: explainable.map(|flights| flights.set.flights.clone()),
        }
    }

    /// Divides the flights, if a check finds no fault; else what the diagnosis says of that.
    fn divide(&mut self, model: &Physics, division: &Division, watched: &Watched) -> Result<Option<Diagnosis>> {
        watched.watch.at("checking the log")?;
        let report = check(&self.set, Some(model));
        if report.fault {
            return Ok(Some(convention_fault(&report, self.set.source.sha256.clone())));
        }
        self.split = division.wanted()?.search_split(&self.set.flights, model, self.seed)?;
        Ok(None)
    }

    fn task(&self, data_sha256: String, options: Options) -> SearchTask<'_> {
        let explainable = self.explainable.clone().filter(|_| !self.split.test.is_empty());
        SearchTask { set: &self.set, split: &self.split, data_sha256, options, explainable }
    }

    fn page(&self, diagnoses: &[Diagnosis], together: Option<&Diagnosis>, [before, after]: [&Physics; 2]) -> Result<Page> {
        let name = self.place.file_name().unwrap_or(self.place.as_os_str()).to_string_lossy();
        let title = format!("Which physics is missing: {} on {name}", before.name);
        let provenance = provenance(self.command, &self.place, &self.set, &[&before.name], self.seed);
        let searched = searched(&self.split);
        diagnose_page(&DiagnoseReport {
            title: &title,
            diagnoses,
            together,
            flights: &self.set.flights,
            searched: &searched,
            locked: &self.split.test,
            before,
            after,
            compared: None,
            provenance: &provenance,
        })
    }
}

/// What a search found as it crosses, the model as it goes on, and the page, which is made when it is asked for.
fn told(searched: Searched, diagnosis: Diagnosis, before: Arc<Physics>, after: Arc<Physics>) -> Result<(Found, Model)> {
    let found = Found::new(&diagnosis, &diagnosis)?;
    let model = Model { physics: Arc::clone(&after) };
    let draws = move || {
        let before = if searched.split.training.is_empty() {
            Physics::clone(&before)
        } else {
            calibrated(&before, &searched.set.flights, &searched.split)?
        };
        let after = if diagnosis.accepted.is_empty() { &before } else { after.as_ref() };
        searched.page(std::slice::from_ref(&diagnosis), None, [&before, after])
    };
    Ok((found.drawn(Arc::new(draws)), model))
}

/// Searches what a network learned, in place of what was measured.
fn in_network(searched: &mut Searched, hybrid: &Hybrid) -> Result<()> {
    let found = network_search(hybrid, &searched.set, &searched.split, Threads(0))?;
    (searched.set, searched.split) = (Arc::new(found.set), found.split);
    Ok(())
}

/// Which physical effect is missing, and how sure that is.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    flights: &Flights,
    who: (Option<Py<Model>>, Option<Py<Network>>),
    division: Division,
    searching: Searching,
    explainable: Option<&Flights>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Model)> {
    let mut searched = Searched::new(flights, "diagnose", &division, explainable);
    let (model, network) = who;
    let hybrid = network.map(|network| Arc::clone(&network.get().hybrid));
    let of_network = || hybrid.as_ref().map(|hybrid| Arc::new(hybrid.description().model.clone()));
    let Some(model) = model.map(|model| Arc::clone(&model.get().physics)).or_else(of_network) else {
        let expected = "a model, or a network, whose own model is taken then".into();
        let (place, field) = ("diagnose".into(), "model".into());
        return Err(crate::error::raised(&phyture::Error::Config { place, field, found: "nothing".into(), expected }));
    };
    work(py, progress, Interrupted::IsLeft, move |watched| {
        ranges::check("max_effects", searching.max_effects, &ranges::EFFECTS)?;
        if let Some(fault) = searched.divide(&model, &division, watched)? {
            return told(searched, fault, Arc::clone(&model), model);
        }
        let data_sha256 = searched.set.source.sha256.clone();
        if let Some(hybrid) = &hybrid {
            in_network(&mut searched, hybrid)?;
        }
        let seed = searched.seed;
        let options = Options { max_effects: searching.max_effects, seed, watch: watched.watch.clone(), ..Options::default() };
        let outcome = searched.task(data_sha256, options).diagnose(&model)?;
        told(searched, outcome.diagnosis, model, Arc::new(outcome.model))
    })
}

/// Diagnoses, adds and calibrates until nothing worthwhile is left.
#[pyfunction]
pub fn amend(
    py: Python<'_>,
    flights: &Flights,
    model: &Model,
    division: Division,
    searching: Searching,
    explainable: Option<&Flights>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Found, Model)> {
    let mut searched = Searched::new(flights, "loop", &division, explainable);
    let model = Arc::clone(&model.physics);
    work(py, progress, Interrupted::IsLeft, move |watched| {
        if let Some(fault) = searched.divide(&model, &division, watched)? {
            return told(searched, fault, Arc::clone(&model), model);
        }
        looped(searched, &model, &division, &searching, watched)
    })
}

fn looped(
    searched: Searched,
    model: &Physics,
    division: &Division,
    searching: &Searching,
    watched: &Watched,
) -> Result<(Found, Model)> {
    let ledger = searching.output.as_ref().map(|output| output.with_extension("ledger.jsonl"));
    let options = Options { seed: searched.seed, formulas: searching.formulas, watch: watched.watch.clone(), ..Options::default() };
    let task = searched.task(searched.set.source.sha256.clone(), options);
    let before = calibrated(model, &searched.set.flights, &searched.split)?;
    let mut amended = task.amend(model, &mut |round, diagnosis| match &ledger {
        Some(ledger) if diagnosis.is_confirmed() => append_to_ledger(ledger, round, diagnosis),
        _ => Ok(()),
    })?;
    if amended.stopped {
        return Err(Error::Interrupted { saved: "the search was stopped, and nothing was written but the ledger".into() });
    }
    division.wanted()?.note(&mut amended.model);
    amended.model.note_source(&searched.set.source, searched.seed);
    if let Some(output) = &searching.output {
        amended.model.write(output)?;
    }
    let together = task.together(&before, &amended)?;
    let ledger = ledger.filter(|ledger| ledger.exists());
    let result = Looped { rounds: amended.rounds, together, model: searching.output.clone(), ledger };
    let found = Found::new(&result, LoopText(&result.together))?;
    let after = Arc::new(amended.model);
    let model = Model { physics: Arc::clone(&after) };
    let draws = move || {
        let after = if result.rounds.iter().any(Diagnosis::is_confirmed) { after.as_ref() } else { &before };
        searched.page(&result.rounds, Some(&result.together), [&before, after])
    };
    Ok((found.drawn(Arc::new(draws)), model))
}
