//! What effects that a search found do to the prediction: the residual of the model that was searched over the variables that an effect reads, and the
//! change of the prediction with all that was found, on the flights that were searched. The same numbers as on the page of `diagnose`, which this can
//! write.

use super::found::Found;
use super::history::State;
use super::recent::Recent;
use super::save::{Saved, ending_in};
use super::{Studio, fault};
use crate::critique::Row;
use crate::critique::change::{Dependences, change, reads, telling};
use crate::critique::diagnose::{Diagnosis, calibrated, searched};
use crate::critique::locate::{Bin, Variable, dependences};
use crate::disk::{Existing, Target, write_atomically};
use crate::error::Result;
use crate::flight::windows::{counted, windows};
use crate::flight::{Accelerations, Channel, PerChannel, Window};
use crate::physics::Model;
use crate::report::{DiagnoseReport, diagnose_page, page};
use crate::workflow::provenance;
use rayon::prelude::*;
use serde::Serialize;

/// Windows that are binned at most, as on the page.
const MOST_WINDOWS: usize = 150_000;

/// Variables that an effect is drawn over.
const PANELS: usize = 2;

/// Variables among which they are chosen.
const TELLING: usize = 6;

/// What an effect does in the channel in which it removes most.
#[derive(Clone, Debug, Serialize)]
pub struct CurveText {
    /// Index of the channel.
    pub channel: usize,
    /// Over the variables that the effect reads first, then over those that tell most.
    pub panels: Vec<CurvePanel>,
}

/// Over one variable.
#[derive(Clone, Debug, Serialize)]
pub struct CurvePanel {
    /// Variable.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Whether the effect reads it; else it only goes with the residual.
    pub read: bool,
    /// The residual before, in bins.
    pub before: Vec<Bin>,
    /// The residual with all that was found.
    pub after: Vec<Bin>,
    /// The change of the whole prediction.
    pub change: Vec<Bin>,
}

/// The residuals before and after a search's findings, and the change.
pub(super) struct Curves {
    before: Dependences,
    after: Dependences,
    change: Dependences,
}

/// By the state that was searched, and how long the search took, bit by bit: that names a search.
pub(super) type Known = Recent<(u64, u64), Curves>;

/// Searches whose curves are kept.
pub(super) const KEPT: usize = 2;

impl Studio {
    /// The curve of an effect that the last search found.
    ///
    /// # Errors
    /// [`crate::Error::Config`] where no search has ended, or found no such effect; as [`Model::predict`].
    pub fn curve(&self, effect: &str) -> Result<Found<CurveText>> {
        let known = self
            .heard()
            .ok_or_else(|| fault("effect", format!("`{effect}`"), "an effect that a search has found; none has ended"))?;
        let step = known.diagnosis.steps.iter().find(|step| step.effect == effect);
        let (step, added) = step
            .zip(known.model.effect(effect))
            .ok_or_else(|| fault("effect", format!("`{effect}`"), "an effect that the last search found"))?;
        let fall = |channel: &Channel| step.held_out_mse_fall.get(channel.name()).copied().unwrap_or(f64::NEG_INFINITY);
        let most = Channel::ALL.into_iter().max_by(|left, right| fall(left).total_cmp(&fall(right)));
        let channel = most.unwrap_or(Channel::VxDot);
        let key = (known.state.id, known.seconds.to_bits());
        let found = Found::of_log(self.curves.get(key, || self.made_curves(&known.state, &known.model)))?;
        let Found::Known(curves) = found else { return Ok(found.map(|_| CurveText { channel: 0, panels: Vec::new() })) };
        let mut shown = telling(&curves.before, channel, &[added], TELLING);
        shown.sort_by_key(|variable| !reads(added, channel, *variable));
        let of = |found: &Dependences, variable: Variable| {
            let known = found.iter().find(|(other, _)| *other == variable);
            known.map_or_else(Vec::new, |(_, of)| of[channel].bins.clone())
        };
        let panel = |variable: Variable| CurvePanel {
            name: variable.name(),
            unit: variable.unit(),
            read: reads(added, channel, variable),
            before: of(&curves.before, variable),
            after: of(&curves.after, variable),
            change: of(&curves.change, variable),
        };
        let panels = shown.into_iter().take(PANELS).map(panel).collect();
        Ok(Found::Known(CurveText { channel: channel.index(), panels }))
    }

    fn made_curves(&self, state: &State, after: &Model) -> Result<Curves> {
        let (flights, spans) = (&self.set.flights, searched(&self.split));
        let samples: usize = spans.iter().map(|span| span.end - span.start).sum();
        let windows = counted(flights, windows(&spans, 1, samples.div_ceil(MOST_WINDOWS).max(1)));
        let before = self.before_search(state)?;
        let row = |model: &Model| -> Result<Row> {
            let wanted = |flight: usize| spans.iter().any(|span| span.flight == flight);
            let of = |flight: usize| if wanted(flight) { model.predict(&flights[flight]) } else { Ok(Accelerations::default()) };
            let predicted: Vec<Accelerations> = (0..flights.len()).into_par_iter().map(of).collect::<Result<_>>()?;
            let at = |window: &Window| PerChannel::from_fn(|channel| predicted[window.flight][channel][window.last]);
            Ok(Row { name: "model".into(), predicted: windows.iter().map(at).collect() })
        };
        let (before, after) = (row(&before)?, row(after)?);
        let of = |row: &Row| dependences(flights, &windows, row, &Variable::ALL);
        let change = change(flights, &windows, [&before, &after], &Variable::ALL)?;
        Ok(Curves { before: of(&before)?, after: of(&after)?, change })
    }

    /// The model of a state calibrated on what was searched, as a search begins with it.
    fn before_search(&self, state: &State) -> Result<Model> {
        calibrated(&state.model, &self.set.flights, &self.split)
    }

    /// Writes the page of the last search, as `diagnose --report` does.
    ///
    /// # Errors
    /// As [`Studio::save_page`]; [`crate::Error::Config`] where no search has ended.
    pub fn save_diagnosis(&self, path: &str, overwrite: bool) -> Result<Saved> {
        let path = ending_in(path, "html")?;
        let target = Target::file(&path, if overwrite { Existing::Replace } else { Existing::Keep }, &[])?;
        let known = self.heard().ok_or_else(|| fault("page", "no search that has ended", "one; press Diagnose first"))?;
        let before = self.before_search(&known.state)?;
        let diagnosis: &Diagnosis = &known.diagnosis;
        let data = self.data.file_name().unwrap_or(self.data.as_os_str()).to_string_lossy();
        let html = page(&diagnose_page(&DiagnoseReport {
            title: &format!("Which physics is missing: {} on {data}", before.name),
            diagnoses: std::slice::from_ref(diagnosis),
            together: None,
            flights: &self.set.flights,
            searched: &searched(&self.split),
            locked: &self.split.test,
            before: &before,
            after: if diagnosis.accepted.is_empty() { &before } else { &known.model },
            compared: None,
            provenance: &provenance("studio", &self.data, &self.set, &[&before.name], self.seed),
        })?);
        write_atomically(target.path(), |file| file.write_all(html.as_bytes()))?;
        Ok(Saved { file: path.display().to_string(), kept: None, ledger: None })
    }
}
