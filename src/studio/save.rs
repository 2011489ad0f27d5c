//! The model on disk: written without overwriting unasked, with the ledger of what searches found, and watched for changes by others.

use super::{Studio, fault, held};
use crate::critique::diagnose::Diagnosis;
use crate::disk::{Existing, Target, write_atomically};
use crate::error::Result;
use crate::physics::{Entry, Model};
use crate::workflow::{append_to_ledger, provenance};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The file of the model, and what was last read from it or written to it.
pub(super) struct ModelFile {
    path: Option<PathBuf>,
    text: Option<String>,
    model: Option<Model>,
}

impl ModelFile {
    pub fn of(path: Option<PathBuf>) -> Self {
        let text = path.as_ref().and_then(|path| std::fs::read_to_string(path).ok());
        let model = path.as_ref().and_then(|path| Model::read(path).ok());
        Self { path, text, model }
    }

    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    pub fn name(&self) -> Option<String> {
        self.path.as_ref().map(|path| path.display().to_string())
    }

    /// Whether the file is another than the one that was read or written here.
    pub fn is_changed(&self) -> bool {
        let Some(path) = &self.path else { return false };
        std::fs::read_to_string(path).ok() != self.text
    }

    /// Whether the file has this model; what a save notes beside the numbers does not count.
    pub fn holds(&self, model: &Model) -> bool {
        self.model.as_ref().is_some_and(|known| known.effects == model.effects && known.correlations == model.correlations)
    }
}

/// What was written.
#[derive(Clone, Debug, Serialize)]
pub struct Saved {
    /// The file.
    pub file: String,
    /// The file that stood there before, kept under this name.
    pub kept: Option<String>,
    /// The ledger, where a search found something that is in the model.
    pub ledger: Option<String>,
}

impl Studio {
    /// Writes the present state to a model file, and what searches found of it to the ledger beside it.
    ///
    /// The file that the model was read from may be overwritten, too; it is then kept beside with the date.
    ///
    /// # Errors
    /// [`crate::Error::Exists`] where a file has that name and `overwrite` is not given; [`crate::Error::Config`] for a name that does not end in `.toml`; as
    /// [`Target::file`] and [`Model::write`].
    pub fn save(&self, path: &str, overwrite: bool) -> Result<Saved> {
        let path = ending_in(path, "toml")?;
        let mut file = held(&self.file);
        let read: Vec<&Path> = file.path.iter().filter(|_| overwrite).map(PathBuf::as_path).collect();
        let target = Target::file(&path, if overwrite { Existing::Replace } else { Existing::Keep }, &read)?;
        let now = self.now();
        let mut model = now.model.clone();
        model.note_source(&self.set.source, self.seed);
        let spans = crate::critique::diagnose::searched(&self.split);
        let seconds: f64 = spans.iter().map(|span| (span.end - span.start) as f64 * self.set.flights[span.flight].step_s).sum();
        let on = format!("{} of {} s", seconds.round(), self.set.duration_s().round());
        model.provenance.insert("calibrated_on".into(), Entry::Text(on));
        let (ready, kept) = target.ready()?;
        model.write(ready)?;
        let ledger = self.note_found(&model, &path.with_extension("ledger.jsonl"))?;
        *file = ModelFile::of(Some(path.clone()));
        drop(file);
        held(&self.history).is_saved(now.id);
        held(&self.drafts).saved = Some(Instant::now());
        self.keep();
        Ok(Saved { file: path.display().to_string(), kept: kept.map(|kept| kept.display().to_string()), ledger })
    }

    /// Adds to the ledger what searches on the way to the present state found, as far as it is in the model.
    fn note_found(&self, model: &Model, ledger: &Path) -> Result<Option<String>> {
        let path = held(&self.history).path();
        let mut round = 0;
        let mut noted: Vec<String> = Vec::new();
        for found in path.iter().filter_map(|state| state.found.as_ref()) {
            let new =
                |name: &str| model.effect(name).is_some_and(|effect| effect.enabled) && !noted.iter().any(|known| known == name);
            let steps: Vec<_> = found.steps.iter().filter(|step| new(&step.effect)).cloned().collect();
            if steps.is_empty() {
                continue;
            }
            round += 1;
            noted.extend(steps.iter().map(|step| step.effect.clone()));
            append_to_ledger(ledger, round, &Diagnosis { steps, ..Diagnosis::clone(found) })?;
        }
        Ok((round > 0).then(|| ledger.display().to_string()))
    }

    /// Writes a page that lays the first and the present state beside the measurements.
    ///
    /// # Errors
    /// [`crate::Error::Exists`] where a file has that name and `overwrite` is not given; [`crate::Error::Config`] for a name that does not end in `.html`; as
    /// [`crate::report::compare_page`].
    pub fn save_page(&self, path: &str, overwrite: bool) -> Result<Saved> {
        let path = ending_in(path, "html")?;
        let target = Target::file(&path, if overwrite { Existing::Replace } else { Existing::Keep }, &[])?;
        let states = held(&self.history).path();
        let ends = if states.len() > 1 { vec![&states[0], &states[states.len() - 1]] } else { vec![&states[0]] };
        let models: Vec<(String, Model)> = ends.iter().map(|state| (state.did.clone(), state.model.clone())).collect();
        let judged = self.judge.traced(&self.set, &self.split, &models)?;
        let names: Vec<&str> = models.iter().map(|(name, _)| name.as_str()).collect();
        let provenance = provenance("studio", &self.data, &self.set, &names, self.seed);
        let html = crate::report::page(&crate::report::compare_page(&judged.report(&self.set, &provenance))?);
        write_atomically(target.path(), |file| file.write_all(html.as_bytes()))?;
        Ok(Saved { file: path.display().to_string(), kept: None, ledger: None })
    }
}

/// A path that ends as it should.
pub(super) fn ending_in(path: &str, ending: &str) -> Result<PathBuf> {
    let path = PathBuf::from(path.trim());
    if path.file_stem().is_none() || path.extension().is_none_or(|found| found != ending) {
        return Err(fault("path", format!("`{}`", path.display()), format!("a file name that ends in .{ending}")));
    }
    Ok(path)
}
