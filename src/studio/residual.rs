//! What the residual of the present state is like: the regions of flight that hold it, how long it lasts, its spectrum, and whether the sticks
//! follow it; and the table that these and the surfaces read. The same numbers as on the page of `diagnose`, which are made in `critique`.

use super::Studio;
use super::judge::PartWanted;
use super::recent::Recent;
use crate::blocks::BLOCK_S;
use crate::critique::diagnose::{Met, met};
use crate::critique::residual_views::{
    Autocorrelation, Region, Spectrum, StickCorrelation, Where, autocorrelation, regions, spectrum, stick_correlations,
};
use crate::critique::unknown::{ROWS_MAX, ResidualTable};
use crate::error::{Error, Result};
use crate::flight::{Accelerations, Channel, Column};
use serde::Serialize;
use std::sync::Arc;

/// Regions of flight with different errors of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct RegionsText {
    /// All flights.
    pub whole: Option<RegionText>,
    /// Regions, the loudest first; none where no simple rule parts the flights.
    pub regions: Vec<RegionText>,
    /// Whether no region has a quarter more than all flights.
    pub even: bool,
    /// Why there is nothing to show, and what to do.
    pub why: Option<String>,
}

/// Some seconds of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spot {
    /// Index of the flight.
    pub flight: usize,
    /// From, s.
    pub from_s: f64,
    /// To, s.
    pub to_s: f64,
}

/// A region of flight.
#[derive(Clone, Debug, Serialize)]
pub struct RegionText {
    /// The rules that make it, as `vx > 4.0, height ≤ 2.0`.
    pub rule: String,
    /// Root mean square of the residual, m/s² or rad/s².
    pub rmse: f64,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// Share of the channel's sum of squares that lies here.
    pub share_of_error: f64,
    /// Share of the time that lies here.
    pub share_of_time: f64,
    /// Blocks of ten seconds.
    pub blocks: usize,
    /// The ten seconds that hold most of it.
    pub worst: Option<Spot>,
}

/// The residual of one channel in time.
#[derive(Clone, Debug, Serialize)]
pub struct InTimeText {
    /// How long it lasts.
    pub autocorrelation: Option<Autocorrelation>,
    /// At which frequencies it lies.
    pub spectrum: Option<Spectrum>,
    /// Correlation with each stick that was recorded.
    pub sticks: Vec<StickCorrelation>,
    /// Why there is nothing to show, and what to do.
    pub why: Option<String>,
}

/// The residuals of the six channels in time.
pub(super) struct InTime {
    autocorrelation: Vec<Autocorrelation>,
    spectrum: Vec<Spectrum>,
    sticks: Vec<StickCorrelation>,
}

/// What is known of residuals, by state and part of the data.
pub(super) struct Residuals {
    tables: Recent<(u64, PartWanted), ResidualTable>,
    regions: Recent<(u64, PartWanted, Channel), Region>,
    in_time: Recent<(u64, PartWanted), InTime>,
}

/// States whose tables are kept.
const KEPT: usize = 3;

impl Default for Residuals {
    fn default() -> Self {
        Self { tables: Recent::new(KEPT), regions: Recent::new(KEPT * Channel::ALL.len()), in_time: Recent::new(KEPT) }
    }
}

impl Studio {
    /// Regions of flight in which the error of a channel differs.
    ///
    /// # Errors
    /// As [`Studio::map`].
    pub fn regions(&self, part: PartWanted, channel: Channel) -> Result<RegionsText> {
        let nothing = |why| RegionsText { whole: None, regions: Vec::new(), even: true, why: Some(why) };
        let key = (self.now().id, part, channel);
        let tree = self.residuals.regions.get(key, || regions(&*self.table(part)?, channel));
        let tree = match determined(tree)? {
            Ok(tree) => tree,
            Err(why) => return Ok(nothing(why)),
        };
        let text = |(rule, region): (String, &Region)| RegionText {
            rule,
            rmse: region.rmse,
            ci95: region.ci95,
            share_of_error: region.share_of_error,
            share_of_time: region.share_of_rows,
            blocks: region.blocks,
            worst: region.worst.map(|worst| self.around(&worst)),
        };
        let whole = Some(text(("all flights".into(), &tree)));
        let regions = if tree.split.is_some() { tree.by_rule().into_iter().map(text).collect() } else { Vec::new() };
        Ok(RegionsText { whole, regions, even: tree.is_even(), why: None })
    }

    /// The ten seconds around a block.
    fn around(&self, worst: &Where) -> Spot {
        let flight = &self.set.flights[worst.flight];
        let [first, last] = worst.between_s;
        let from_s = (0.5 * (first + last - BLOCK_S)).clamp(0.0, (flight.duration_s() - BLOCK_S).max(0.0));
        let to_s = (from_s + BLOCK_S).min(flight.duration_s());
        Spot { flight: worst.flight, from_s: flight.start_s + from_s, to_s: flight.start_s + to_s }
    }

    /// How long the residual of a channel lasts, its spectrum, and whether the sticks follow it.
    ///
    /// # Errors
    /// As [`Studio::map`].
    pub fn in_time(&self, part: PartWanted, channel: Channel) -> Result<InTimeText> {
        let made = self.residuals.in_time.get((self.now().id, part), || {
            let table = self.table(part)?;
            let (autocorrelation, spectrum) = (autocorrelation(&table)?, spectrum(&table)?);
            Ok(InTime { autocorrelation, spectrum, sticks: stick_correlations(&table)? })
        });
        let found = match determined(made)? {
            Ok(found) => found,
            Err(why) => {
                return Ok(InTimeText { autocorrelation: None, spectrum: None, sticks: Vec::new(), why: Some(why) });
            }
        };
        let name = channel.name();
        // Where no stretch is long enough there are no lines.
        let spectrum = found.spectrum.iter().find(|one| one.channel == name && one.segments > 0);
        Ok(InTimeText {
            autocorrelation: found.autocorrelation.iter().find(|one| one.channel == name).cloned(),
            spectrum: spectrum.cloned(),
            sticks: found.sticks.iter().filter(|one| one.channel == name).cloned().collect(),
            why: None,
        })
    }

    /// The residuals of the present state as means over tenths of a second or longer, flights met as `compare` meets them.
    pub(super) fn table(&self, part: PartWanted) -> Result<Arc<ResidualTable>> {
        let now = self.now();
        self.residuals.tables.get((now.id, part), || {
            let flights = &self.set.flights;
            let Met { models, judged, .. } = met(flights, &[&now.model], self.judge.spans(&self.split, part))?;
            let residual = |flight: usize| -> Result<Accelerations> {
                let mut residual = models[0].predict(&flights[flight])?;
                for (values, target) in residual.iter_mut().zip(Column::TARGETS) {
                    values.iter_mut().zip(flights[flight].column(target)).for_each(|(value, measured)| *value = measured - *value);
                }
                Ok(residual)
            };
            ResidualTable::new(flights, &judged, &residual, BLOCK_S, ROWS_MAX)
        })
    }
}

/// What could not be determined is a state of the data that a view tells in its place, not a failure of the request.
fn determined<T>(found: Result<T>) -> Result<std::result::Result<T, String>> {
    match found {
        Err(Error::Undetermined(why)) => Ok(Err(why)),
        found => found.map(Ok),
    }
}
