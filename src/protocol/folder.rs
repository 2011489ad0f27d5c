//! The folder of a benchmark: its plan and one file a finished run.
//!
//! | file | content |
//! | --- | --- |
//! | `plan.json` | the plan |
//! | `runs/KEY.json` | the outcome of the run of that key, sealed; written in one piece when the run is at its end |
//! | `working/KEY/` | checkpoints of a run that is under way |
//! | `amended/KEY.toml` | what `loop` made of the model in one division: searched once |
//! | `tables/` | what `collect` made |
//!
//! Several processes may work in one folder: a run is made by the one that has claimed it.

use super::outcome::Outcome;
use super::plan::{Plan, Run};
use crate::disk::{Lock, write_atomically};
use crate::error::{Error, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long another program may hold the plan.
const PATIENCE: Duration = Duration::from_secs(10);

/// An outcome with what tells whether it is whole, and where its last digits come from.
#[derive(Serialize, Deserialize)]
struct Sealed {
    /// SHA-256 of the outcome as compact JSON.
    sha256: String,
    /// Instruction set of the kernels: outcomes of another differ in the last digits.
    instruction_set: String,
    outcome: Outcome,
}

fn seal(path: &Path, outcome: &Outcome) -> Result<String> {
    let text = serde_json::to_vec(outcome).map_err(|error| Error::File { path: path.into(), message: error.to_string() })?;
    Ok(Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The instruction set of this process's kernels by name.
///
/// # Errors
/// [`Error::Config`] if the environment asks for one that this machine does not have.
pub fn instruction_set() -> Result<&'static str> {
    Ok(crate::tape::instruction_set()?.name())
}

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
        for part in [folder.runs(), folder.path.join("working"), folder.amended(), folder.tables()] {
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

    /// Where amended models are kept.
    pub fn amended(&self) -> PathBuf {
        self.path.join("amended")
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

    /// Holds the plan against other programs that want to read and write it. They hold it for a moment, and it is waited for.
    ///
    /// # Errors
    /// [`Error::Busy`] if another holds it for longer than ten seconds; [`Error::Io`].
    pub fn hold_plan(&self) -> Result<Lock> {
        let begun = Instant::now();
        loop {
            match Lock::of_file(&self.plan_file()) {
                Err(Error::Busy { .. }) if begun.elapsed() < PATIENCE => std::thread::sleep(PATIENCE / 200),
                held => return held,
            }
        }
    }

    /// Takes a run, so that no other program makes it at the same time.
    ///
    /// # Errors
    /// [`Error::Busy`] if another program makes it; [`Error::Io`].
    pub fn claim(&self, key: &str) -> Result<Lock> {
        Lock::of_file(&self.working(key))
    }

    /// The outcome of a run and the instruction set that made it; `None` if the run is not at its end.
    ///
    /// # Errors
    /// [`Error::File`] if the file is empty, cut, edited, or of another run.
    pub fn outcome(&self, plan: &Plan, run: &Run) -> Result<Option<(Outcome, String)>> {
        Ok(self.sealed(plan, run)?.map(|sealed| (sealed.outcome, sealed.instruction_set)))
    }

    fn sealed(&self, plan: &Plan, run: &Run) -> Result<Option<Sealed>> {
        let key = plan.key(run)?;
        let path = self.outcome_file(&key);
        if !path.exists() {
            return Ok(None);
        }
        let fault = |message: String| Error::File {
            path: path.clone(),
            message: format!("{message}; remove the file, and `--resume` makes the run again"),
        };
        let text = fs::read(&path).map_err(Error::io(&path))?;
        let sealed: Sealed = serde_json::from_slice(&text).map_err(|error| fault(format!("is no outcome of a run ({error})")))?;
        if sealed.sha256 != seal(&path, &sealed.outcome)? {
            return Err(fault("has been changed since it was written: its checksum does not fit".into()));
        }
        // Rows that are one network share a file under the name of whichever came first.
        if plan.key(&sealed.outcome.run)? == key {
            return Ok(Some(sealed));
        }
        Err(fault(format!("is of the run `{}`", sealed.outcome.run)))
    }

    /// Writes the outcome of a run and removes its checkpoints.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(&self, plan: &Plan, outcome: &Outcome) -> Result<()> {
        let key = plan.key(&outcome.run)?;
        let path = self.outcome_file(&key);
        let instruction_set = instruction_set()?.into();
        write(&path, &Sealed { sha256: seal(&path, outcome)?, instruction_set, outcome: outcome.clone() })?;
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
            if let (None, Some(sealed)) = (self.sealed(plan, &run)?, other.sealed(plan, &run)?) {
                write(&self.outcome_file(&key), &sealed)?;
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
