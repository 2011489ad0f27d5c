//! Where the error lies: by manoeuvre or regime and channel, the ten seconds to look at in each, and the residual over recorded variables.

use super::Studio;
use super::judge::{PartWanted, row};
use super::recent::Recent;
use crate::critique::compare::{ModelError, PartError};
use crate::critique::locate::{Bin, Dependence, Variable, dependences, stretches_in};
use crate::critique::predictions::deviation;
use crate::critique::{ChannelValues, Regime, Row};
use crate::error::Result;
use crate::flight::{Channel, PerChannel, Window};
use crate::report::colour::shade;
use crate::workflow::Judged;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// By what the error is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// Manoeuvre class, which a person gave.
    #[default]
    Manoeuvre,
    /// Regime, by rules.
    Regime,
}

/// An error map.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorMap {
    /// Rows that hold samples, the largest error first.
    pub rows: Vec<MapRow>,
    /// All samples.
    pub whole: MapRow,
    /// Standard deviation of what was measured, by channel: a relative error of 1 is as bad as predicting the mean.
    pub deviation: ChannelValues,
    /// What was judged, in words.
    pub basis: String,
    /// What so few blocks can say, if they are few.
    pub caution: Option<String>,
}

/// A manoeuvre class or regime.
#[derive(Clone, Debug, Serialize)]
pub struct MapRow {
    /// Name.
    pub name: String,
    /// The rule of a regime.
    pub rule: Option<&'static str>,
    /// Samples judged.
    pub n: usize,
    /// Blocks of ten seconds that they lie in.
    pub blocks: usize,
    /// By channel.
    pub cells: Vec<MapCell>,
}

/// A cell.
#[derive(Clone, Debug, Serialize)]
pub struct MapCell {
    /// Root mean square error, m/s² or rad/s².
    pub rmse: Option<f64>,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// The error over the standard deviation of the channel.
    pub relative: Option<f64>,
    /// Colour of the cell and of what is written in it.
    pub paper: String,
    /// See there.
    pub ink: &'static str,
}

/// Which ten seconds are looked for.
#[derive(Clone, Debug, Deserialize)]
pub struct PlaceWanted {
    /// Part of the data.
    #[serde(default)]
    pub part: PartWanted,
    /// By what the error is divided.
    #[serde(default)]
    pub by: By,
    /// Manoeuvre class or regime; everything without.
    #[serde(default)]
    pub name: Option<String>,
    /// Index of the acceleration; all without.
    #[serde(default)]
    pub channel: Option<Channel>,
    /// The median in place of the worst.
    #[serde(default)]
    pub typical: bool,
}

/// Ten seconds of a flight.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Place {
    /// Index of the flight.
    pub flight: usize,
    /// From, s.
    pub from_s: f64,
    /// To, s.
    pub to_s: f64,
    /// Error there over the standard deviation of what was measured.
    pub error: f64,
}

/// The residual over one variable.
#[derive(Clone, Debug, Serialize)]
pub struct VariableText {
    /// Name as in formulas.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Share of the residual's variance that the bin means account for.
    pub share: f64,
    /// Bins in the order of the variable.
    pub bins: Vec<Bin>,
}

/// The residual of one channel over every variable.
#[derive(Clone, Debug, Serialize)]
pub struct DependenceText {
    /// The variable that accounts for most first.
    pub variables: Vec<VariableText>,
    /// What was judged, in words.
    pub basis: String,
}

impl Studio {
    /// Errors by manoeuvre or regime, and channel.
    ///
    /// # Errors
    /// As [`crate::physics::Model::predict`].
    pub fn map(&self, part: PartWanted, by: By) -> Result<ErrorMap> {
        let judged = self.judge.state(&self.set, &self.split, &self.now(), part)?;
        let deviation = deviation(&self.set.flights, &judged.windows)?;
        let model = &judged.comparison.models[1];
        let mut rows: Vec<MapRow> = match by {
            By::Manoeuvre => model.by_manoeuvre.iter().map(|(name, part)| map_row(name, None, part, &deviation)).collect(),
            By::Regime => {
                let of = |regime: Regime| {
                    Some(map_row(regime.name(), Some(regime.rule()), model.by_regime.get(regime.name())?, &deviation))
                };
                Regime::ALL.into_iter().filter_map(of).collect()
            }
        };
        rows.retain(|row| row.n > 0);
        let size = |row: &MapRow| row.cells.iter().filter_map(|cell| cell.relative).sum::<f64>();
        rows.sort_by(|left, right| size(right).total_cmp(&size(left)));
        let whole = map_row("all", None, &whole(model, judged.comparison.blocks), &deviation);
        Ok(ErrorMap { rows, whole, deviation, basis: judged.comparison.basis(), caution: judged.comparison.caution() })
    }

    /// The worst or a typical ten seconds of a cell; `None` where nothing is judged.
    ///
    /// # Errors
    /// As [`Studio::map`].
    pub fn place(&self, wanted: &PlaceWanted) -> Result<Option<Place>> {
        let judged = self.judge.state(&self.set, &self.split, &self.now(), wanted.part)?;
        let channels = PerChannel::from_fn(|channel| wanted.channel.is_none_or(|only| only == channel));
        let (windows, row) = self.within(&judged, wanted.by, wanted.name.as_deref());
        let Some(found) = stretches_in(&self.set.flights, &windows, &row, channels)? else { return Ok(None) };
        let stretch = if wanted.typical { found.typical } else { found.worst };
        let flight = &self.set.flights[stretch.span.flight];
        let time = |sample: usize| flight.time_s(sample);
        let (from_s, to_s) = (time(stretch.span.start), time(stretch.span.end.min(flight.len()) - 1));
        Ok(Some(Place { flight: stretch.span.flight, from_s, to_s, error: stretch.error }))
    }

    /// The samples of a manoeuvre class or regime, and what is predicted there.
    fn within(&self, judged: &Judged, by: By, name: Option<&str>) -> (Vec<Window>, Row) {
        let is_in = |window: &Window| {
            let flight = &self.set.flights[window.flight];
            name.is_none_or(|name| match by {
                By::Manoeuvre => flight.manoeuvre == name,
                By::Regime => Regime::of(flight, window.last).name() == name,
            })
        };
        let row = row(judged);
        let kept = judged.windows.iter().zip(&row.predicted).filter(|(window, _)| is_in(window));
        let (windows, predicted) = kept.map(|(window, predicted)| (*window, *predicted)).unzip();
        (windows, Row { name: row.name.clone(), predicted })
    }

    /// The residual of a channel over every recorded variable.
    ///
    /// # Errors
    /// As [`Studio::map`].
    pub fn dependence(&self, part: PartWanted, channel: Channel) -> Result<DependenceText> {
        let now = self.now();
        let judged = self.judge.state(&self.set, &self.split, &now, part)?;
        let found = self.dependences(&judged, (now.id, part))?;
        let text = |(variable, channels): &(Variable, PerChannel<Dependence>)| {
            let Dependence { bins, share } = channels[channel].clone();
            VariableText { name: variable.name(), unit: variable.unit(), share, bins }
        };
        let mut variables: Vec<VariableText> = found.iter().map(text).collect();
        variables.sort_by(|left, right| right.share.total_cmp(&left.share));
        Ok(DependenceText { variables, basis: judged.comparison.basis() })
    }
}

/// The residuals over every variable, by state and part; kept, as a person looks at one channel after the other.
pub(super) type Dependences = Recent<(u64, PartWanted), Vec<OverVariable>>;

/// The residuals of the six channels over a variable.
pub(super) type OverVariable = (Variable, PerChannel<Dependence>);

/// States whose residuals over variables are kept.
pub(super) const KEPT: usize = 6;

impl Studio {
    /// The residuals over every variable.
    fn dependences(&self, judged: &Judged, key: (u64, PartWanted)) -> Result<Arc<Vec<OverVariable>>> {
        self.dependences.get(key, || {
            let share = Variable::ALL.len().div_ceil(rayon::current_num_threads());
            let of = |variables: &[Variable]| dependences(&self.set.flights, &judged.windows, row(judged), variables);
            let found: Vec<Vec<OverVariable>> = Variable::ALL.par_chunks(share).map(of).collect::<Result<_>>()?;
            Ok(found.into_iter().flatten().collect())
        })
    }
}

/// All samples as one part.
fn whole(model: &ModelError, blocks: usize) -> PartError {
    PartError { rmse: model.rmse, rmse_ci95: model.rmse_ci95, n: model.windows, blocks }
}

fn map_row(name: &str, rule: Option<&'static str>, part: &PartError, deviation: &ChannelValues) -> MapRow {
    let (rmse, ci95, deviation) = (part.rmse.channels(), part.rmse_ci95.channels(), deviation.channels());
    let cell = |channel: Channel| {
        let relative = rmse[channel].zip(deviation[channel]).map(|(rmse, deviation)| rmse / deviation);
        let (paper, ink) = shade(relative.unwrap_or(0.0));
        MapCell { rmse: rmse[channel], ci95: ci95[channel], relative, paper, ink }
    };
    MapRow { name: name.into(), rule, n: part.n, blocks: part.blocks, cells: Channel::ALL.into_iter().map(cell).collect() }
}
