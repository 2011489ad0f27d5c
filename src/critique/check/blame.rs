//! Causes of single flights, gathered: flights with the same cause make one finding, and a cause that most flights share is one of the set. What the
//! causes are, and how they are found, is in `causes`.

use super::causes::{Cause, Kind};
use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, in_flights};
use super::gains::OFFSETS;
use super::increments::Vector;
use super::told::{mend, stream_of, told, usual, usual_arm};
use crate::flight::{Column, Flight};
use std::collections::{BTreeMap, BTreeSet};

/// What was found, and in which flights.
#[derive(Default)]
pub(super) struct Blamed {
    pub findings: Vec<Finding>,
    /// The flights that have a cause which others have not.
    pub flights: BTreeSet<usize>,
}

/// Streams this much apart, or filtered so, change verdicts, s: lags of rotor and servo are as long.
const SLOW_S: f64 = 0.04;

/// A cause of the set is one of so many of its flights.
const HALF: f64 = 0.5;
/// A lever arm is one of the set where so many of the flights show the same, and nearly all of them something of its stream …
const FEW_OF_ALL: f64 = 0.25;
/// … within this share of it.
const SAME_ARM: f64 = 0.2;

/// Filters are the same where their time constants are, to this factor.
const SAME_FILTER: f64 = 1.6;

/// The name of a kind, and the stream that it is wrong with.
type Named = (&'static str, Option<&'static str>);
/// A flight by its place, and a cause in it.
type OfFlight<'a> = (usize, &'a Cause);

/// Gathers the causes of flights; of a flight with sound relations there are none to look for. Noise is one in `outstanding` flights alone, since every sensor
/// has some, and leaps elsewhere are a warning.
pub(super) fn gathered(causes: &[(usize, Option<&[Cause]>)], outstanding: &BTreeSet<usize>, flights: &[Flight]) -> Blamed {
    let sound = causes.iter().filter(|entry| entry.1.is_none()).count();
    let mut alike: BTreeMap<Named, Vec<OfFlight<'_>>> = BTreeMap::new();
    for (flight, of_flight) in causes {
        let is_one = |cause: &&Cause| match cause.kind {
            Kind::Noise(_) => outstanding.contains(flight),
            // Every derivative is smoothed a little.
            Kind::Averaged(time_s) => as_lag_s(time_s) > SLOW_S,
            _ => true,
        };
        for cause in of_flight.iter().copied().flatten().filter(is_one) {
            let stream = cause.columns.first().map(|column| stream_of(*column));
            alike.entry((cause.kind.name(), stream)).or_default().push((*flight, cause));
        }
    }
    let mut order: Vec<(Named, Vec<OfFlight<'_>>)> = alike.into_iter().collect();
    order.sort_by_key(|(_, alike)| std::cmp::Reverse(alike.len()));
    let (mut blamed, mut filtered) = (Blamed { findings: Vec::new(), flights: BTreeSet::new() }, Vec::new());
    for ((_, stream), alike) in order {
        let columns = common(&alike);
        let of_all: Vec<&Cause> = alike.iter().map(|entry| entry.1).collect();
        let first = columns.first().map_or("", |column| column.name());
        let name = if first.is_empty() { alike[0].1.kind.name().to_owned() } else { format!("{}_{first}", alike[0].1.kind.name()) };
        let message = told(&of_all, &columns);
        let indices: BTreeSet<usize> = alike.iter().map(|entry| entry.0).collect();
        let indices: Vec<usize> = indices.into_iter().collect();
        let of_those = indices.len() as f64;
        let shared = |by: f64| by > MOST * (sound as f64 + by) && by > HALF * causes.len() as f64;
        // Quiet flights say less of a lever arm or of a filter, and show something else that stands in for it.
        let by_stream = || causes.iter().filter(|entry| is_of_stream(entry.1, stream)).count() as f64;
        let is_set = shared(of_those)
            || ((one_arm(&of_all) || one_filter(&of_all, &columns))
                && of_those > FEW_OF_ALL * causes.len() as f64
                && shared(by_stream()));
        filtered.extend(is_set.then_some(stream).flatten().filter(|_| one_filter(&of_all, &columns)).and_then(state_of));
        let found = if is_set {
            finding(&name, Severity::Fault, message, mend(&of_all, &columns).as_deref())
        } else {
            in_flights(&name, &indices, &message, flights)
        };
        let leaps_as_usual = alike[0].1.kind == Kind::Leaps && !indices.iter().all(|flight| outstanding.contains(flight));
        let is_fault = matters(&of_all, &columns) && !leaps_as_usual;
        let verdict = if is_fault { Severity::Fault } else { Severity::Warning };
        blamed.findings.push(Finding { verdict, ..found });
        // Of a position that is wrong all is said; a flight that is a little late is as good as any.
        if !is_set && (is_fault || columns.iter().all(|column| stream_of(*column) == "position")) {
            blamed.flights.extend(indices);
        }
    }
    // What changes as filtered accelerations say looks early, and is not.
    let is_early = |finding: &Finding| {
        let late = finding.name.strip_prefix("late_").and_then(Column::from_name);
        late.is_some_and(|column| filtered.contains(&stream_of(column)))
    };
    blamed.findings.retain(|finding| !is_early(finding));
    blamed
}

/// The state that changes as accelerations say.
fn state_of(accelerations: &'static str) -> Option<&'static str> {
    match accelerations {
        "linear accelerations" => Some("velocity"),
        "angular accelerations" => Some("rates"),
        _ => None,
    }
}

/// Whether something is wrong with this stream, or with the state that changes as it says.
fn is_of_stream(causes: Option<&[Cause]>, stream: Option<&'static str>) -> bool {
    let of = |cause: &Cause| cause.columns.first().map(|column| stream_of(*column));
    let is_one = |cause: &Cause| of(cause) == stream || stream.and_then(state_of).is_some_and(|state| of(cause) == Some(state));
    causes.into_iter().flatten().any(is_one)
}

/// Whether all are accelerations behind the same filter.
fn one_filter(all: &[&Cause], columns: &[Column]) -> bool {
    let time_s = |kind: &Kind| if let Kind::Filtered(time_s) = *kind { time_s } else { f64::INFINITY };
    let usual_s = usual(all, time_s);
    let is_usual = |cause: &&Cause| (time_s(&cause.kind) / usual_s).ln().abs() < SAME_FILTER.ln();
    columns.iter().all(|column| Column::TARGETS.contains(column)) && usual_s.is_finite() && all.iter().all(is_usual)
}

/// Whether all are the same lever arm.
fn one_arm(all: &[&Cause]) -> bool {
    let usual = usual_arm(all);
    let size = |arm: Vector| arm[0].hypot(arm[1]).hypot(arm[2]);
    let is_usual = |cause: &&Cause| match cause.kind {
        Kind::OffCentre(arm) => size(std::array::from_fn(|axis| arm[axis] - usual[axis])) < SAME_ARM * size(usual),
        _ => false,
    };
    all.iter().all(is_usual)
}

/// The time constant of the filter of first order that takes as much off slow oscillations as a mean over this time does: τ² ω² / 2 = T² ω² / 24.
fn as_lag_s(mean_s: f64) -> f64 {
    mean_s / 12.0_f64.sqrt()
}

/// Whether the physics would be wrong: where the aircraft is drives nothing but the effect of the ground, if it is the position that is wrong.
fn matters(all: &[&Cause], columns: &[Column]) -> bool {
    let slow_s = usual(all, |kind| match *kind {
        Kind::Late(time_s) | Kind::Filtered(time_s) => time_s.abs(),
        Kind::Averaged(time_s) => as_lag_s(time_s),
        _ => f64::INFINITY,
    });
    if slow_s < SLOW_S {
        return false;
    }
    let off = usual(all, |kind| if let Kind::Off(by) = *kind { by.abs() } else { f64::INFINITY });
    if off < OFFSETS[1] && columns.iter().all(|column| stream_of(*column) == "rates") {
        return false;
    }
    let is_position = columns.iter().all(|column| stream_of(*column) == "position");
    columns.is_empty() || !is_position || all.iter().any(|cause| cause.or.is_some())
}

/// Columns that at least half of the flights name, or else the one that most do.
fn common(alike: &[OfFlight<'_>]) -> Vec<Column> {
    let mut counts: BTreeMap<Column, usize> = BTreeMap::new();
    alike.iter().flat_map(|entry| &entry.1.columns).for_each(|column| *counts.entry(*column).or_default() += 1);
    let most = counts.values().copied().max().unwrap_or(0);
    let least = alike.len().div_ceil(2).min(most);
    counts.into_iter().filter(|(_, count)| *count >= least).map(|entry| entry.0).collect()
}
