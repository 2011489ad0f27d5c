//! Sticks that act on each other's axes in some flights and not in the rest: recorded behind a mixer, or before it, or turned against the swash plate. An
//! aircraft in which they do so in all flights has a cross-coupling; that is the business of a search.

use super::finding::Finding;
use super::flights::{FEWEST, in_flights};
use super::groups::{Of, apart};
use super::sticks::{AXES, EXPLAINED, FIRST, Regressions, STICKS, Sticks};
use crate::flight::Flight;
use std::collections::BTreeSet;

/// Gains of a stick on another axis, over that of the axis' own stick, are of two kinds from here on apart.
const LEAST: f64 = 0.15;

/// A finding for each cyclic axis; nothing of flights in `except`.
pub(super) fn findings(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    let judged: Vec<&(usize, Regressions)> = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    let of = |[axis, stick]: [usize; 2]| {
        let ratios: Vec<Of> = judged.iter().filter_map(|(flight, all)| cross(*flight, all, axis, stick)).collect();
        let (fewer, by) = apart(ratios, LEAST)?;
        let (own, other) = (STICKS[axis], STICKS[stick]);
        let message = format!(
            "{own} and {other} are mixed or turned: {other} acts on {} by {by:.2} times what {own} does, as it does not in the other flights",
            AXES[axis]
        );
        // One flight may be flown so.
        (fewer.len() >= FEWEST).then(|| in_flights(&format!("mixed_{own}_{other}"), &fewer, &message, flights))
    };
    [[0, 1], [1, 0]].into_iter().filter_map(of).collect()
}

fn cross(flight: usize, regressions: &Regressions, axis: usize, stick: usize) -> Option<Of> {
    let estimates = regressions[axis].estimates()?;
    let (own, other) = (estimates[FIRST + axis], estimates[FIRST + stick]);
    let is_sure = own.interval[0] * own.interval[1] > 0.0 && regressions[axis].explained()? > EXPLAINED;
    let half = 0.5 * (other.interval[1] - other.interval[0]) / own.value.abs();
    (is_sure && half < LEAST).then_some(Of { flight, value: other.value / own.value, half })
}
