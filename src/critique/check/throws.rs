//! Sticks whose gain is another on one side of 0 than on the other in some flights, or another from somewhere in a flight on: an end point that was not taught in, or a
//! range that was switched. What is so in all flights may be the aircraft's own curve; that is the business of a search.

use super::finding::Finding;
use super::flights::{FEWEST, in_flights};
use super::groups::{Of, apart};
use super::increments::SHORT_BLOCK_S;
use super::regression::BlockRegression;
use super::robust::median;
use super::sticks::{COLUMNS, EXPLAINED, FIRST, Regressions, STICKS, Sticks};
use crate::flight::Flight;
use std::collections::BTreeSet;

/// The change of an axis on state, sticks, 1, and the magnitude of its own stick.
pub(super) type Sides = BlockRegression<{ COLUMNS + 1 }>;

/// Half of the difference of the gains on the two sides over their mean is of two kinds from here on apart.
const UNEVEN: f64 = 0.15;

/// A range was switched where the gain after a time is so many times that before, or that part, …
const OTHER: f64 = 1.4;
/// … the difference is so many times its interval, and leaves this part of the squared errors at most, …
const CERTAIN: f64 = 4.0;
const LEFT: f64 = 0.8;
/// … with so many blocks on either side.
const BESIDE: usize = 4;
/// Two sticks are switched at once where it is so near, in blocks.
const AT_ONCE: usize = 2;

/// What one flight says of the two sides of each stick: half of the difference of the gains over their mean, and half of its interval.
pub(super) type Uneven = [Option<(f64, f64)>; 4];

/// Looks at one flight.
pub(super) fn of(sides: &[Sides; 4]) -> Uneven {
    std::array::from_fn(|axis| {
        let estimates = sides[axis].estimates()?;
        let (own, magnitude) = (estimates[FIRST + axis], estimates[COLUMNS]);
        let half = 0.5 * (magnitude.interval[1] - magnitude.interval[0]) / own.value.abs();
        let is_sure = own.interval[0] * own.interval[1] > 0.0 && sides[axis].explained()? > EXPLAINED && half < UNEVEN;
        is_sure.then_some((magnitude.value / own.value, half))
    })
}

/// Uneven and switched sticks; nothing of flights in `except`.
pub(super) fn findings(sticks: &Sticks, sides: &[(usize, Uneven)], flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    let judged: Vec<&(usize, Uneven)> = sides.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    let uneven = (0..4).filter_map(|stick| uneven(stick, &judged, flights));
    uneven.chain(switched(sticks, flights, except)).collect()
}

fn uneven(stick: usize, judged: &[&(usize, Uneven)], flights: &[Flight]) -> Option<Finding> {
    let each = judged.iter().filter_map(|(flight, sides)| {
        let (value, half) = sides[stick]?;
        Some(Of { flight: *flight, value, half })
    });
    let (fewer, by) = apart(each.collect(), UNEVEN)?;
    let name = STICKS[stick];
    let side = if by < 0.0 { "below" } else { "above" };
    let message = format!(
        "{name} has another gain on one side than in the other flights, larger by {:.0} % {side} 0 than on the other side: its values there are scaled, as by an \
         end point that was not taught in",
        100.0 * 2.0 * by.abs() / (1.0 - by.abs().min(0.9))
    );
    (fewer.len() >= FEWEST).then(|| in_flights(&format!("uneven_{name}"), &fewer, &message, flights))
}

/// A stick of a flight whose gain changes, by how much, and from which block on.
struct Switched {
    flight: usize,
    stick: usize,
    ratio: f64,
    from: usize,
}

/// Ranges that were switched in flight. What takes the gain of one stick away in one flight may be a manoeuvre; two at once, or the same in several flights, is
/// none.
fn switched(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Option<Finding> {
    let judged = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight));
    let of_flight = |(flight, regressions): &(usize, Regressions)| {
        let each = (0..4).filter_map(|stick| {
            let (ratio, from) = switch(&regressions[stick], stick)?;
            Some(Switched { flight: *flight, stick, ratio, from })
        });
        let each: Vec<Switched> = each.collect();
        // Where all axes answer otherwise it is the rotor.
        if each.len() > 2 { Vec::new() } else { each }
    };
    let all: Vec<Switched> = judged.flat_map(of_flight).collect();
    let is_shared = |one: &&Switched| {
        let beside =
            |other: &&Switched| other.flight == one.flight && other.stick != one.stick && other.from.abs_diff(one.from) <= AT_ONCE;
        all.iter().any(|other| beside(&other)) || all.iter().filter(|other| other.stick == one.stick).count() >= FEWEST
    };
    let such: Vec<&Switched> = all.iter().filter(is_shared).collect();
    let first = such.first()?;
    let ratio = median(such.iter().map(|one| one.ratio).collect())?;
    let names: BTreeSet<&str> = such.iter().map(|one| STICKS[one.stick]).collect();
    let indices: BTreeSet<usize> = such.iter().map(|one| one.flight).collect();
    let names = names.into_iter().collect::<Vec<_>>();
    let message = format!(
        "{} have {ratio:.2} times the gain from somewhere in the flight on ({:.0} s in the first of them): a range (dual rate) that was switched, and \
         values of another scale from there on",
        names.join(", "),
        first.from as f64 * SHORT_BLOCK_S
    );
    Some(in_flights(&format!("range_{}", names[0]), &indices.into_iter().collect::<Vec<_>>(), &message, flights))
}

/// How many times its gain a stick has from a block on, and that block.
fn switch(regression: &BlockRegression<COLUMNS>, stick: usize) -> Option<(f64, usize)> {
    let errors = |errors: Option<Vec<f64>>| errors.map(|errors| errors.iter().sum::<f64>());
    let whole = errors(regression.errors())?;
    let with = |from: usize| regression.stepped::<{ COLUMNS + 1 }>(FIRST + stick, from);
    let places = BESIDE..(regression.blocks() + 1).saturating_sub(BESIDE);
    let left = regression.steps::<{ COLUMNS + 1 }>(FIRST + stick, places);
    let (left, from) = left.into_iter().min_by(|one, other| one.0.total_cmp(&other.0))?;
    let estimates = with(from).estimates()?;
    let (before, step) = (estimates[FIRST + stick], estimates[COLUMNS]);
    let half = 0.5 * (step.interval[1] - step.interval[0]);
    let ratio = 1.0 + step.value / before.value;
    let is_certain = before.interval[0] * before.interval[1] > 0.0 && step.value.abs() > CERTAIN * half;
    let is_other = ratio > OTHER || (ratio > 0.0 && ratio < 1.0 / OTHER);
    (is_certain && is_other && left < LEFT * whole).then_some((ratio, from))
}
