//! Stretches of flights in which no axis answers to the sticks as it does in the rest: somebody or something else flew, or the sticks of another moment were
//! recorded. A single axis that answers to nothing, or a whole flight, is the business of `unexplained`.

use super::finding::{Finding, Severity};
use super::flights::of_set_or_flights;
use super::increments::SHORT_BLOCK_S;
use super::regression::BlockRegression;
use super::robust::median;
use super::sticks::{CONSTANT, FIRST, Regressions, Sticks};
use crate::flight::Flight;
use std::collections::{BTreeMap, BTreeSet};

/// The fit is that of this part of the stretches, those that it explains best.
const BEST: f64 = 0.5;
/// A stretch tells of an axis that moves by this part of its usual squares.
const MOVES: f64 = 0.3;
/// What the sticks add to the answer of state alone, in parts of the squares of the movement: an axis answers to them where they mend this much …
const MENDED: f64 = 0.2;
/// … and they are not what moves it where they spoil this much. Physics that is missing leaves an answer unexplained, and does not turn it against the sticks.
const SPOILT: f64 = 0.2;
/// Axes of the four that go deaf, or answer, together.
const TOGETHER: usize = 3;
/// In the flights that are told this part of the stretches is deaf at least …
const SHARE: f64 = 0.1;
/// … and in all together they answer in this part.
const REST: f64 = 0.3;

/// Stretches of a flight: those in which axes go deaf, those in which they answer, all that tell, and when the first deaf one begins, s.
#[derive(Default)]
struct Stretches {
    deaf: usize,
    answering: usize,
    telling: usize,
    first_s: Option<f64>,
}

/// Flights with such stretches; nothing of those in `except`.
pub(super) fn findings(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Option<Finding> {
    let judged: Vec<&(usize, Regressions)> = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    // By stretch, how much of the squares the sticks mend.
    let mended = |axis: usize| -> Option<Vec<Option<f64>>> {
        let merged = BlockRegression::merged(judged.iter().map(|(_, regressions)| &regressions[axis]));
        let with = merged.fit_to_best(BEST)?;
        let without = std::array::from_fn(|column| if (FIRST..CONSTANT).contains(&column) { 0.0 } else { with[column] });
        let errors = merged.errors_of(&without).into_iter().zip(merged.errors_of(&with));
        let squares = merged.squares();
        let usual = median(squares.clone())?;
        let of = |((without, with), square): ((f64, f64), f64)| (square > MOVES * usual).then(|| (without - with) / square);
        Some(errors.zip(squares).map(of).collect())
    };
    let axes: Vec<Vec<Option<f64>>> = (0..4).filter_map(mended).collect();
    let count = |block: usize, is: &dyn Fn(f64) -> bool| axes.iter().filter(|axis| axis[block].is_some_and(is)).count();
    let blocks = judged.iter().flat_map(|(flight, regressions)| {
        let own = regressions[0].blocks();
        (0..own).map(move |block| (*flight, block))
    });
    let mut of_flight: BTreeMap<usize, Stretches> = BTreeMap::new();
    for (at, (flight, block)) in blocks.enumerate() {
        let own = of_flight.entry(flight).or_default();
        let is_deaf = count(at, &|mended| mended < -SPOILT) >= TOGETHER;
        own.deaf += usize::from(is_deaf);
        own.answering += usize::from(count(at, &|mended| mended > MENDED) >= TOGETHER);
        own.telling += usize::from(count(at, &|_| true) >= TOGETHER);
        own.first_s = own.first_s.or_else(|| is_deaf.then_some(SHORT_BLOCK_S * block as f64));
    }
    let part = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    let is_told = |own: &Stretches| own.deaf > 1 && part(own.deaf, own.telling) > SHARE;
    let such: Vec<usize> = of_flight.iter().filter(|(_, own)| is_told(own)).map(|entry| *entry.0).collect();
    let total = |of: fn(&Stretches) -> usize| of_flight.values().map(of).sum::<usize>();
    if such.is_empty() || part(total(|own| own.answering), total(|own| own.telling)) < REST {
        return None;
    }
    let of_such = |of: fn(&Stretches) -> usize| such.iter().map(|flight| of(&of_flight[flight])).sum::<usize>();
    let message = format!(
        "the controls do not move the axes in some stretches as they do in the rest ({} of {} in which it moves enough, in the first flight from {:.0} s on): another \
         pilot or an autopilot flew, or the sticks of another moment were recorded",
        of_such(|own| own.deaf),
        of_such(|own| own.telling),
        of_flight[&such[0]].first_s.unwrap_or(0.0)
    );
    let found = of_set_or_flights("deaf_stretches", &such, of_flight.len(), &message, None, flights);
    Some(Finding { verdict: Severity::Fault, ..found })
}
