//! Where a stick stands: one that keeps its last value to the end of a flight while its axis moves on, one that stands elsewhere in some flights than
//! in the others for the same answer, and one that does so from somewhere in a flight on. Signs, gains and order of the sticks are the business of `sticks`.

use super::finding::{Finding, Severity};
use super::flights::{CONTROLS, in_flights};
use super::groups::{Of, apart};
use super::increments::SHORT_BLOCK_S;
use super::regression::BlockRegression;
use super::robust::median;
use super::sticks::{AXES, CONSTANT, FIRST, Regressions, STICKS, Sticks};
use crate::flight::Flight;
use std::collections::BTreeSet;

/// A stick has stopped where it stands for so long, s …
const STANDS_S: f64 = 6.0;
/// … and for this share of the flight …
const STANDS_SHARE: f64 = 0.15;
/// … while its axis moves by this share of what it did before.
const MOVING: f64 = 0.5;
/// Another stick moves where it does so by more than this share of what it did before.
const STILL: f64 = 1e-3;
/// A pilot who lets a stick go has let it go before: it stood at the same value for so long, s.
const AT_REST_S: f64 = 0.3;

/// A trim differs from that of the others from here on, in units of the stick's usual deviation.
const TRIMMED: f64 = 0.5;

/// How findings begin of a stick that stands elsewhere in whole flights.
pub(super) const TRIMMED_STICK: &str = "trim_u";

/// In so many flights the same other trim is a fault.
const MANY: usize = 3;

/// A trim was moved where the same answer needs the stick elsewhere from a time on by this many usual deviations of it …
const MOVED: f64 = 0.3;
/// … that is so many times its interval, and leaves this part of the squared errors at most, …
const CERTAIN: f64 = 5.0;
const LEFT: f64 = 0.5;
/// … with so many blocks on either side.
const BESIDE: usize = 2;

/// What is wrong with where sticks stand; nothing of flights in `except`.
pub(super) fn findings(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    let judged: Vec<&(usize, Regressions)> = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    let mut findings: Vec<Finding> = (0..4).filter_map(|stick| stopped(stick, &judged, flights)).collect();
    let stands: BTreeSet<&String> = findings.iter().flat_map(|finding| &finding.flights).collect();
    let rest: Vec<&(usize, Regressions)> =
        judged.into_iter().filter(|(flight, _)| !stands.contains(&flights[*flight].name)).collect();
    // The tail holds against the torque of the rotor and the collective carries the weight: where these stand is what is flown.
    let of_trim: Vec<Finding> =
        (0..2).flat_map(|stick| [trimmed(stick, &rest, flights), moved(stick, &rest, flights)]).flatten().collect();
    findings.extend(of_trim);
    findings
}

/// Flights in which a stick keeps its last value while its axis moves on.
fn stopped(stick: usize, judged: &[&(usize, Regressions)], flights: &[Flight]) -> Option<Finding> {
    let has_stopped = |(index, regressions): &&&(usize, Regressions)| {
        let flight = &flights[*index];
        let values = flight.column(CONTROLS[stick]);
        let stops = last_run(values);
        let (samples, stood_s) = (values.len(), (values.len() - stops) as f64 * flight.step_s);
        let at_rest = values.last().is_some_and(|last| longest_at(&values[..stops], *last) as f64 * flight.step_s >= AT_REST_S);
        flight.rest();
        if at_rest || stood_s < STANDS_S || stood_s < STANDS_SHARE * samples as f64 * flight.step_s {
            return false;
        }
        let block = (stops as f64 * flight.step_s / SHORT_BLOCK_S).ceil() as usize;
        let own = &regressions[stick];
        let (before, after) = (own.part(0..block), own.part(block..own.blocks()));
        let moves = |other: usize| after.deviation(FIRST + other, CONSTANT) > STILL * before.deviation(FIRST + other, CONSTANT);
        let others = (0..4).filter(|other| *other != stick && moves(*other)).count();
        others >= 2 && before.deviation(FIRST + stick, CONSTANT) > 0.0 && after.response() > MOVING * before.response()
    };
    let such: Vec<usize> = judged.iter().filter(has_stopped).map(|entry| entry.0).collect();
    let (name, axis) = (STICKS[stick], AXES[stick]);
    let message =
        format!("{name} stands still from somewhere in the flight to its end while {axis} moves on: it was no longer recorded");
    (!such.is_empty()).then(|| in_flights(&format!("still_{name}"), &such, &message, flights))
}

/// The first sample of the run of equal values at the end.
fn last_run(values: &[f64]) -> usize {
    values.chunk_by(|one, next| one == next).last().map_or(0, |run| values.len() - run.len())
}

/// Samples for which a value is kept at most.
fn longest_at(values: &[f64], value: f64) -> usize {
    values.chunk_by(|one, next| one == next).filter(|run| run[0] == value).map(<[f64]>::len).max().unwrap_or(0)
}

/// Flights in which the same answer needs the stick elsewhere than in the others. A centre of mass that lies elsewhere does the same, so in a flight or two it is a
/// warning; where many differ by the same, whatever it is, one model does not hold for both.
fn trimmed(stick: usize, judged: &[&(usize, Regressions)], flights: &[Flight]) -> Option<Finding> {
    let of = |(flight, regressions): &&(usize, Regressions)| {
        let estimates = regressions[stick].estimates()?;
        let (constant, gain) = (estimates[CONSTANT], estimates[FIRST + stick]);
        // Where the gain is not sure, nothing is.
        let is_sure = gain.interval[0] * gain.interval[1] > 0.0;
        let half = 0.5 * (constant.interval[1] - constant.interval[0]) / gain.value.abs();
        is_sure.then(|| Of { flight: *flight, value: -constant.value / gain.value, half })
    };
    let trims: Vec<Of> = judged.iter().filter_map(of).collect();
    let moves = median(judged.iter().map(|(_, regressions)| regressions[stick].deviation(FIRST + stick, CONSTANT)).collect())?;
    let (indices, by) = apart(trims, TRIMMED * moves)?;
    let name = STICKS[stick];
    let message = format!(
        "{name} stands {:.3} {} than in the other flights for the same answer: a trim or an offset of {name} there, or a centre of mass that lies \
         elsewhere",
        by.abs(),
        if by > 0.0 { "higher" } else { "lower" }
    );
    let verdict = if indices.len() < MANY { Severity::Warning } else { Severity::Fault };
    Some(Finding { verdict, ..in_flights(&format!("trim_{name}"), &indices, &message, flights) })
}

/// Flights in which the same answer needs the stick elsewhere from a time on. What shifts a centre of mass in flight does the same, so it is a warning.
fn moved(stick: usize, judged: &[&(usize, Regressions)], flights: &[Flight]) -> Option<Finding> {
    let moves = median(judged.iter().map(|(_, regressions)| regressions[stick].deviation(FIRST + stick, CONSTANT)).collect())?;
    let of = |(flight, regressions): &&(usize, Regressions)| Some((*flight, step(&regressions[stick], stick, MOVED * moves)?));
    let such: Vec<(usize, (f64, usize))> = judged.iter().filter_map(of).collect();
    let by = median(such.iter().map(|entry| entry.1.0).collect())?;
    let (_, (_, first)) = such.first()?;
    let name = STICKS[stick];
    let message = format!(
        "{name} stands {:.3} {} for the same answer from somewhere in the flight on ({:.0} s in the first of them): a trim that was moved and recorded, an          offset of {name}, or a centre of mass that shifted",
        by.abs(),
        if by > 0.0 { "higher" } else { "lower" },
        *first as f64 * SHORT_BLOCK_S
    );
    let indices: Vec<usize> = such.iter().map(|entry| entry.0).collect();
    Some(Finding { verdict: Severity::Warning, ..in_flights(&format!("trim_moved_{name}"), &indices, &message, flights) })
}

/// By how much a stick stands elsewhere from a block on, and that block.
fn step(regression: &BlockRegression<{ CONSTANT + 1 }>, stick: usize, least: f64) -> Option<(f64, usize)> {
    let errors = |errors: Option<Vec<f64>>| errors.map(|errors| errors.iter().sum::<f64>());
    let whole = errors(regression.errors())?;
    let with = |from: usize| regression.stepped::<{ CONSTANT + 2 }>(CONSTANT, from);
    let places = BESIDE..regression.blocks().saturating_sub(BESIDE) + 1;
    let left = regression.steps::<{ CONSTANT + 2 }>(CONSTANT, places);
    let (left, from) = left.into_iter().min_by(|one, other| one.0.total_cmp(&other.0))?;
    let estimates = with(from).estimates()?;
    let (gain, step) = (estimates[FIRST + stick], estimates[CONSTANT + 1]);
    let half = 0.5 * (step.interval[1] - step.interval[0]);
    let by = -step.value / gain.value;
    let is_certain = gain.interval[0] * gain.interval[1] > 0.0 && step.value.abs() > CERTAIN * half;
    (is_certain && left < LEFT * whole && by.abs() > least).then_some((by, from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_run_at_the_end_is_found_and_an_earlier_rest_at_its_value_too() {
        assert_eq!(last_run(&[1.0, 2.0, 2.0, 2.0]), 1);
        assert_eq!(last_run(&[]), 0);
        assert_eq!(longest_at(&[2.0, 2.0, 1.0, 2.0], 2.0), 2);
        assert_eq!(longest_at(&[1.0], 2.0), 0);
    }
}
