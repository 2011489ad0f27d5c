//! The folder of a benchmark: its plan and one file a finished run.
//!
//! | file | content |
//! | --- | --- |
//! | `plan.json` | the plan |
//! | `runs/KEY.json` | the outcome of the run of that key; written in one piece when the run is at its end |
//! | `working/KEY/` | checkpoints of a run that is under way |
//! | `tables/` | what `collect` made |
//!
//! Several processes may work in one folder: none touches another's files but to write the same bytes.

use super::outcome::Outcome;
use super::plan::{Plan, Run};
use crate::error::{Error, Result};
use crate::flight::atomic::write_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a benchmark.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// The folder at `path`, made if it is not there.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let folder = Self { path: path.into() };
        for part in [folder.runs(), folder.path.join("working"), folder.tables()] {
            fs::create_dir_all(&part).map_err(Error::io(&part))?;
        }
        Ok(folder)
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The plan's file.
    pub fn plan_file(&self) -> PathBuf {
        self.path.join("plan.json")
    }

    /// Where the tables go.
    pub fn tables(&self) -> PathBuf {
        self.path.join("tables")
    }

    fn runs(&self) -> PathBuf {
        self.path.join("runs")
    }

    /// Where a run under way keeps its checkpoints.
    pub fn working(&self, key: &str) -> PathBuf {
        self.path.join("working").join(key)
    }

    fn outcome_file(&self, key: &str) -> PathBuf {
        self.runs().join(format!("{key}.json"))
    }

    /// The plan.
    ///
    /// # Errors
    /// [`Error::Io`] if there is none, [`Error::File`] if it does not read.
    pub fn plan(&self) -> Result<Plan> {
        read(&self.plan_file())
    }

    /// Writes the plan.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_plan(&self, plan: &Plan) -> Result<()> {
        write(&self.plan_file(), plan)
    }

    /// Whether a run is at its end.
    pub fn is_done(&self, key: &str) -> bool {
        self.outcome_file(key).exists()
    }

    /// The outcome of a run; `None` if it is not at its end.
    ///
    /// # Errors
    /// [`Error::File`] if the file does not read or is of another run.
    pub fn outcome(&self, plan: &Plan, run: &Run) -> Result<Option<Outcome>> {
        let key = plan.key(run)?;
        let path = self.outcome_file(&key);
        if !path.exists() {
            return Ok(None);
        }
        let outcome: Outcome = read(&path)?;
        // Rows that are one network share a file under the name of whichever came first.
        if plan.key(&outcome.run)? == key {
            return Ok(Some(outcome));
        }
        Err(Error::File { path, message: format!("is of the run `{}`; remove it and run again", outcome.run) })
    }

    /// Writes the outcome of a run and removes its checkpoints.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(&self, plan: &Plan, outcome: &Outcome) -> Result<()> {
        let key = plan.key(&outcome.run)?;
        write(&self.outcome_file(&key), outcome)?;
        let working = self.working(&key);
        if working.exists() {
            fs::remove_dir_all(&working).map_err(Error::io(&working))?;
        }
        Ok(())
    }

    /// Takes over the finished runs of another folder that are not here yet; gives their number.
    ///
    /// # Errors
    /// [`Error::Config`] if the other folder is of another plan; [`Error::Io`] or [`Error::File`] if a file does not read.
    pub fn merge(&self, plan: &Plan, other: &Self) -> Result<usize> {
        if !plan.continues(&other.plan()?) {
            return Err(Error::Config {
                place: other.path.display().to_string(),
                field: "plan.json".into(),
                found: "another plan".into(),
                expected: format!("the plan of {}: same data, model, settings and version", self.path.display()),
            });
        }
        let mut taken = 0;
        for run in plan.runs()? {
            let key = plan.key(&run)?;
            if let (false, Some(outcome)) = (self.is_done(&key), other.outcome(plan, &run)?) {
                write(&self.outcome_file(&key), &outcome)?;
                taken += 1;
            }
        }
        Ok(taken)
    }
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = fs::read(path).map_err(Error::io(path))?;
    serde_json::from_slice(&text).map_err(|error| Error::File { path: path.into(), message: error.to_string() })
}

fn write(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|error| Error::File { path: path.into(), message: error.to_string() })?;
    text.push(b'\n');
    write_atomically(path, |file| file.write_all(&text))
}
