//! What trains and what tests, and the seed, as Python gives them: beside the numbers of every piece of work that divides flights.

use phyture::workflow;
use pyo3::prelude::*;

/// What is locked, how the rest is divided, and the seed of that.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Division {
    /// Manoeuvre classes or flights that nothing is fitted to.
    lock: Vec<String>,
    /// `segments`, `stretches` or `first SHARE`.
    split: Option<String>,
    /// Seed of everything random.
    pub seed: u64,
}

impl Division {
    /// As the library takes it.
    pub fn wanted(&self) -> phyture::Result<workflow::Division> {
        let split = self.split.as_deref().map(str::parse).transpose()?;
        Ok(workflow::Division { lock: self.lock.clone(), split })
    }
}
