//! What the network learned, as flights that a search for missing physics can read: the measured accelerations replaced by the
//! model's prediction plus what the network (and the linear history) adds to it.
//!
//! No measured acceleration is in these flights, so none of their noise is. What the network passes on from the noise of its
//! inputs is still there, and so is every fault of the network: an effect found here is one the network says it saw, which the
//! measurements themselves have to confirm. No search here.

use super::Hybrid;
use crate::error::{Error, Result};
use crate::flight::{Channel, Column, DataSet, Flight, Span, windows::windows};
use crate::tape::Threads;

/// Flights whose targets are what a hybrid says, at the samples that have a full history.
#[derive(Clone, Debug)]
pub struct NetworkTarget {
    /// The flights, under their own names, without their first H − 1 samples, every `stride`-th of the others. What was done is in
    /// the notes.
    pub set: DataSet,
    /// Samples of the original between two of these.
    pub stride: usize,
    /// First sample of the original that has a full history, H − 1.
    first: usize,
    /// For each flight here, its index in the original.
    originals: Vec<usize>,
}

impl NetworkTarget {
    /// Spans of the original flights as spans of these; what has no full history falls away, and so do spans that keep nothing.
    pub fn spans(&self, spans: &[Span]) -> Vec<Span> {
        let place = |sample: usize| sample.saturating_sub(self.first).div_ceil(self.stride);
        let translate = |span: &Span| {
            let flight = self.originals.iter().position(|&original| original == span.flight)?;
            let length = self.set.flights.get(flight)?.len();
            let (start, end) = (place(span.start).min(length), place(span.end).min(length));
            (start < end).then_some(Span { flight, start, end })
        };
        spans.iter().filter_map(translate).collect()
    }
}

/// Evaluates the hybrid on the flights that `spans` touch and gives them back with the targets a^p + r̂, where r̂ is what the hybrid
/// says beyond the physics (linear history and gate included).
///
/// a^p is the model evaluated on the returned flight itself, so that measured minus predicted is r̂ to rounding for whoever
/// evaluates the same model there: hidden states of lags start at its first sample, and delays interpolate at its step. With
/// `stride` above 1 the step grows by it and columns are picked, not filtered; a search should then not trust time constants
/// below a few of the new steps. One window costs one forward pass of the network.
///
/// A flight too short for one history is left out with a note. A sample's history may reach back before a span: nothing is learned
/// here and no measured acceleration is read.
///
/// # Errors
/// As [`Hybrid::predict`]; [`Error::Config`] for a stride of 0; [`Error::Undetermined`] if no flight is long enough.
pub fn network_target(
    hybrid: &Hybrid,
    flights: &[Flight],
    spans: &[Span],
    stride: usize,
    threads: Threads,
) -> Result<NetworkTarget> {
    if stride == 0 {
        let (found, expected) = ("0".into(), "at least 1".into());
        return Err(Error::Config { place: "network target".into(), field: "stride".into(), found, expected });
    }
    let description = hybrid.description();
    let history = description.config.history();
    let mut target = NetworkTarget { set: DataSet::default(), stride, first: history.saturating_sub(1), originals: Vec::new() };
    for (index, flight) in flights.iter().enumerate().filter(|(index, _)| spans.iter().any(|span| span.flight == *index)) {
        let all = windows(&[Span { flight: 0, start: 0, end: flight.len() }], history, stride);
        if all.is_empty() {
            let note = format!("`{}`: left out, its {} samples hold no history of {history}", flight.name, flight.len());
            target.set.notes.push(note);
            continue;
        }
        let stages = hybrid.stages(std::slice::from_ref(flight), &all, threads)?;
        let pick = |values: &[f64]| all.iter().filter_map(|window| values.get(window.last).copied()).collect::<Vec<f64>>();
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|column| pick(flight.column(Column::ALL[column])));
        let make = |columns: [Vec<f64>; Column::COUNT]| {
            let (start_s, step_s) = (flight.time_s(target.first), flight.step_s * stride as f64);
            let mut made = Flight::new(flight.name.clone(), flight.manoeuvre.clone(), start_s, step_s, columns, flight.targets)?;
            made.absent.clone_from(&flight.absent);
            made.tainted.clone_from(&flight.tainted);
            made.extra = flight.extra.iter().map(|(name, values)| (name.clone(), pick(values))).collect();
            Ok::<_, Error>(made)
        };
        // The model reads no target: what stands in these columns does not matter yet.
        let physics = description.model.predict(&make(columns.clone())?)?;
        for (channel, physics) in Channel::ALL.into_iter().zip(physics) {
            let learned = stages.hybrid.iter().zip(&stages.physics).map(|(hybrid, physics)| hybrid[channel] - physics[channel]);
            columns[channel.column() as usize] =
                physics.into_iter().zip(learned).map(|(physics, learned)| physics + learned).collect();
        }
        target.set.flights.push(make(columns)?);
        target.originals.push(index);
    }
    if target.set.flights.is_empty() {
        return Err(Error::Undetermined(format!(
            "no flight holds the {history} samples of the network's history; give longer flights"
        )));
    }
    target.set.notes.push(format!(
        "the accelerations are not measured: they are the model's plus what the network adds, at every {} sample from number {} on",
        if stride == 1 { "single".to_owned() } else { format!("{stride}th") },
        target.first
    ));
    Ok(target)
}
