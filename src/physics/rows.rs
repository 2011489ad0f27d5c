//! The rows that a calibration sees: which samples of which flights, cut into clusters that its intervals rest on, and weighted. What is
//! fitted to them is in `calibrate`.

use super::weights::Weights;
use crate::error::{Error, Result};
use crate::flight::{Flight, PerChannel, Span};

/// Clusters that the whole of the data is cut into for the intervals, unless it is cut into more by flights.
const CLUSTERS: usize = 40;

/// Clusters are not made shorter than this, s.
const SHORTEST_CLUSTER_S: f64 = 1.0;

/// The rows that a calibration sees.
pub(super) struct Rows<'a> {
    /// All flights, with rows or without.
    pub flights: &'a [Flight],
    /// Of each flight, its rows as ranges from a sample to before another.
    pub ranges: Vec<Vec<(usize, usize)>>,
    /// Flights with rows, and how many clusters each is cut into.
    pub jobs: Vec<(usize, usize)>,
    /// Rows of all flights.
    pub total: usize,
    /// What counts alike.
    pub weights: Weights,
    /// Of each flight, what its columns are multiplied by.
    pub factors: Vec<PerChannel<f64>>,
}

impl<'a> Rows<'a> {
    /// The rows of `spans` that count.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where there are none, or too few for intervals.
    pub fn of(flights: &'a [Flight], spans: &[Span], weights: Weights) -> Result<Self> {
        let ranges: Vec<Vec<(usize, usize)>> = (0..flights.len()).map(|flight| union(flight, spans, flights)).collect();
        let rows: Vec<usize> = ranges.iter().map(|ranges| ranges.iter().map(|range| range.1 - range.0).sum()).collect();
        let total: usize = rows.iter().sum();
        if total == 0 {
            return Err(Error::Undetermined("no rows to calibrate on: the spans are empty; give at least one flight".into()));
        }
        let (jobs, factors) = (cut(flights, &rows)?, weights.of(flights, &ranges));
        Ok(Self { flights, ranges, jobs, total, weights, factors })
    }
}

/// How many clusters each flight with rows is cut into.
///
/// # Errors
/// [`Error::Undetermined`] where intervals would rest on nothing: they need two clusters of twice the length.
fn cut(flights: &[Flight], rows: &[usize]) -> Result<Vec<(usize, usize)>> {
    let total: usize = rows.iter().sum();
    let jobs: Vec<(usize, usize)> = (0..flights.len())
        .filter(|&flight| rows[flight] > 0)
        .map(|flight| {
            let shortest = (SHORTEST_CLUSTER_S / flights[flight].step_s) as usize;
            let length = (total / CLUSTERS).max(shortest).max(1);
            (flight, ((rows[flight] + length / 2) / length).max(1).min(rows[flight]))
        })
        .collect();
    if jobs.iter().map(|(_, clusters)| clusters.div_ceil(2)).sum::<usize>() < 2 {
        let length_s: f64 = jobs.iter().map(|&(flight, _)| rows[flight] as f64 * flights[flight].step_s).sum();
        return Err(Error::Undetermined(format!(
            "the training part is {length_s:.2} s of one flight, too little to tell how certain a coefficient is; give at least \
             {:.1} s, or a second flight",
            2.5 * SHORTEST_CLUSTER_S
        )));
    }
    Ok(jobs)
}

/// The samples of one flight that the spans cover and that count, in order, without overlap.
fn union(flight: usize, spans: &[Span], flights: &[Flight]) -> Vec<(usize, usize)> {
    let length = flights.get(flight).map_or(0, Flight::len);
    let mut ranges: Vec<(usize, usize)> =
        spans.iter().filter(|span| span.flight == flight).map(|span| (span.start.min(length), span.end.min(length))).collect();
    ranges.retain(|range| range.0 < range.1);
    ranges.sort_unstable();
    let mut merged: Vec<(usize, usize)> = Vec::new();
    for (start, end) in ranges {
        match merged.last_mut() {
            Some(last) if start <= last.1 => last.1 = last.1.max(end),
            _ => merged.push((start, end)),
        }
    }
    match flights.get(flight) {
        Some(flight) => {
            merged.into_iter().flat_map(|(start, end)| flight.counted(start..end)).map(|rows| (rows.start, rows.end)).collect()
        }
        None => merged,
    }
}
