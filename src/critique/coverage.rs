//! Do a hybrid's intervals keep their promise on the flights judged, and how much of these lies outside what it was trained on? Counts; the
//! intervals and the envelope are the hybrid's own.

use super::channels::{ChannelValues, Intervals};
use super::digits::{Kind, aligned, significant};
use super::wrap::wrapped;
use crate::blocks::{BlockMean, BlockSum, Blocks};
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, Window};
use crate::hybrid::Hybrid;
use crate::hybrid::envelope::{Envelope, Place};
use crate::tape::Threads;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Name of what no single quantity is to blame for.
pub const TOGETHER: &str = "all together";

/// How a network's intervals and its envelope do on some windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Name of the network.
    pub name: String,
    /// Share of measurements that the intervals promise to hold.
    pub promised: f64,
    /// Windows, and blocks of ten seconds, that they were made from.
    pub made_from: (usize, usize),
    /// Share of the measurements judged that they hold, with the physics as on flights that it does not know.
    pub held: ChannelValues,
    /// 95 % interval of that share, from blocks of ten seconds.
    pub held_ci95: Intervals,
    /// Mean of half an interval, m/s² and rad/s².
    pub half_width: ChannelValues,
    /// Share of the samples judged that lie outside the envelope of training; none if the network has no envelope.
    pub outside: Option<f64>,
    /// The same by the quantity that is farthest out, [`TOGETHER`] where each is within its range.
    pub outside_by: BTreeMap<String, f64>,
}

/// Counts a network's promises on some windows; `None` if it makes none.
///
/// # Errors
/// As [`Hybrid::predict`].
pub fn coverage(name: &str, hybrid: &Hybrid, flights: &[Flight], windows: &[Window], threads: Threads) -> Result<Option<Coverage>> {
    let Some(intervals) = &hybrid.description().intervals else { return Ok(None) };
    let predicted = hybrid.predict_unknown(flights, windows, threads)?;
    let blocks = Blocks::new(flights, windows);
    let mut held = PerChannel::from_fn(|_| vec![BlockSum::default(); blocks.len()]);
    let mut half = PerChannel::splat(0.0);
    for ((window, predicted), block) in windows.iter().zip(&predicted).zip(&blocks.of_window) {
        let flight = &flights[window.flight];
        let of_sample = intervals.half_width(&flight.state(window.last));
        for channel in Channel::ALL {
            let error = (flight.column(channel.column())[window.last] - predicted[channel]).abs();
            let sum = &mut held[channel][*block];
            sum.samples += 1.0;
            sum.sum += f64::from(u8::from(error <= of_sample[channel]));
            half[channel] += of_sample[channel] / windows.len() as f64;
        }
    }
    let means = held.map(|sums| BlockMean::new(sums.into_iter()));
    let within = |[low, high]: [f64; 2]| [low.max(0.0), high.min(1.0)];
    let outside_by = outside_by(hybrid, flights, windows);
    Ok(Some(Coverage {
        name: name.to_owned(),
        promised: intervals.coverage(),
        made_from: intervals.made_from(),
        held: ChannelValues::new(means.map(|mean| mean.map(|mean| mean.mean))),
        held_ci95: Intervals::new(means.map(|mean| mean.and_then(|mean| mean.interval()).map(within))),
        half_width: ChannelValues::new(half.map(Some)),
        outside: outside_by.as_ref().map(|shares| shares.values().sum()),
        outside_by: outside_by.unwrap_or_default(),
    }))
}

/// What a sample is outside of: the quantity that is farthest beyond its range, or [`TOGETHER`]; `None` inside. A quantity that the flight lacks was
/// refused when it was predicted.
pub fn outside<'e>(envelope: &'e Envelope, flight: &Flight, sample: usize) -> Option<&'e str> {
    let columns = envelope.ranges().iter().filter_map(|range| flight.named(&range.name));
    match envelope.place(&columns.map(|column| column[sample]).collect::<Vec<f64>>()) {
        Place::Inside => None,
        Place::Beyond { quantity, .. } => Some(&envelope.ranges()[quantity].name),
        Place::Apart { .. } => Some(TOGETHER),
    }
}

/// Shares of the windows that lie outside the envelope, by quantity.
fn outside_by(hybrid: &Hybrid, flights: &[Flight], windows: &[Window]) -> Option<BTreeMap<String, f64>> {
    let envelope = hybrid.description().envelope.as_ref()?;
    let mut shares = BTreeMap::new();
    for blamed in windows.iter().filter_map(|window| outside(envelope, &flights[window.flight], window.last)) {
        *shares.entry(blamed.to_owned()).or_insert(0.0) += 1.0 / windows.len() as f64;
    }
    Some(shares)
}

impl Coverage {
    /// Rows of a table: name and a text for each channel.
    pub fn rows(&self) -> Vec<(String, Vec<String>)> {
        let percent = |value: &Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{:.0}", 100.0 * value));
        let interval = |value: &Option<[f64; 2]>| {
            value.map_or_else(String::new, |[low, high]| format!("{:.0}…{:.0}", 100.0 * low, 100.0 * high))
        };
        vec![
            (
                format!("measurements held, % ({:.0} promised)", 100.0 * self.promised),
                self.held.channels().iter().map(percent).collect(),
            ),
            (String::new(), self.held_ci95.channels().iter().map(interval).collect()),
            (
                "half of an interval, mean".to_owned(),
                self.half_width.channels().iter().map(|value| Kind::Error.text(*value)).collect(),
            ),
        ]
    }

    /// What the numbers rest on, and where the network was not trained.
    pub fn note(&self) -> String {
        let (windows, blocks) = self.made_from;
        let mut note = format!(
            "Made from {windows} windows in {blocks} blocks of ten seconds that the network was not trained on, with the physics as on a flight that it \
             does not know."
        );
        match self.outside {
            Some(outside) if outside > 0.0 => {
                let mut by: Vec<(&String, &f64)> = self.outside_by.iter().collect();
                by.sort_by(|one, other| other.1.total_cmp(one.1));
                let by: Vec<String> =
                    by.iter().map(|(name, share)| format!("{name} {} %", significant(100.0 * **share, 2))).collect();
                let outside = significant(100.0 * outside, 2);
                note.push_str(&format!(
                    " {outside} % of these samples lie outside of what calibration and training saw ({}).",
                    by.join(", ")
                ));
            }
            Some(_) => note.push_str(" All of these samples lie within what calibration and training saw."),
            None => (),
        }
        note
    }
}

impl fmt::Display for Coverage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Prediction intervals of `{}`", self.name)?;
        let heads: Vec<(&str, &str)> = Column::TARGETS.iter().map(|column| (column.name(), column.unit())).collect();
        aligned(f, &heads, &self.rows())?;
        write!(f, "{}", wrapped("  ", &self.note()))
    }
}
