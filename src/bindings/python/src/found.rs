//! What a piece of work found, as it crosses to Python: the document of the result, the text for a person, and the page with its figures, which is
//! made when it is asked for.

use crate::error::raised;
use crate::work::{Interrupted, work};
use phyture::report::{Page, page};
use phyture::{Error, Result, workflow};
use pyo3::prelude::*;
use serde::Serialize;
use std::sync::{Arc, OnceLock};

/// Makes a page.
pub type Draws = Arc<dyn Fn() -> Result<Page> + Send + Sync>;

/// A result: its JSON document, its text, its figures.
#[pyclass(frozen, module = "phyture._phyture")]
pub struct Found {
    json: String,
    text: String,
    draws: Option<Draws>,
    page: OnceLock<Page>,
}

impl Found {
    /// A result as data and as text, without figures.
    pub fn new(content: &impl Serialize, text: impl std::fmt::Display) -> Result<Self> {
        let json = workflow::document(content).map_err(|error| Error::Undetermined(error.to_string()))?;
        Ok(Self { json, text: text.to_string().trim_end().to_owned(), draws: None, page: OnceLock::new() })
    }

    /// The same with figures.
    #[must_use]
    pub fn drawn(self, draws: Draws) -> Self {
        Self { draws: Some(draws), ..self }
    }

    fn page_of(&self, py: Python<'_>) -> PyResult<&Page> {
        if let Some(page) = self.page.get() {
            return Ok(page);
        }
        let Some(draws) = self.draws.clone() else {
            return Err(raised(&Error::Undetermined("this result has no figures".into())));
        };
        let made = work(py, None, Interrupted::IsLeft, move |_| draws())?;
        Ok(self.page.get_or_init(|| made))
    }
}

#[pymethods]
impl Found {
    /// The document that the command line writes with `--json`.
    fn json(&self) -> &str {
        &self.json
    }

    /// What the command line shows.
    fn text(&self) -> &str {
        &self.text
    }

    /// Every figure: its name, the picture as SVG, and its numbers as CSV.
    fn figures(&self, py: Python<'_>) -> PyResult<Vec<(String, String, String)>> {
        let figures = self.page_of(py)?.figures();
        Ok(figures.into_iter().map(|(name, figure)| (name, figure.svg(), figure.csv())).collect())
    }

    /// The page that the command line writes with `--report`, as HTML that loads nothing.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        Ok(page(self.page_of(py)?))
    }
}
