//! Sticks that act on each other's axes: recorded behind a mixer, or before it, or turned against the swash plate. In some flights and not in the rest that is
//! seen at once; an aircraft in which they do so in all flights has a cross-coupling, which is the business of a search, unless they do so as much as the
//! axis's own stick.

use super::finding::{Finding, Severity, finding};
use super::flights::{FEWEST, in_flights};
use super::groups::{Of, apart};
use super::robust::median;
use super::sticks::{AXES, EXPLAINED, FIRST, Regressions, STICKS, Sticks};
use super::told::plus;
use crate::critique::prose::listed;
use crate::flight::Flight;
use std::collections::BTreeSet;

/// Gains of a stick on another axis, over that of the axis' own stick, are of two kinds from here on apart.
const LEAST: f64 = 0.15;
/// No aircraft is so cross-coupled in all flights that another stick does this part of what the own one does, on two axes or more.
const AS_MUCH: f64 = 0.4;

/// Groups are about as large where the smaller one is this part of the other.
const AS_MANY: f64 = 0.7;
/// As near to a half or to a whole number a ratio is that.
const SIMPLE: f64 = 0.05;

/// An axis, and another stick than its own.
type Pair = [usize; 2];
/// Pairs with their ratios.
type Ratios = Vec<(Pair, f64)>;

/// Pairs of what the swash plate moves: roll, pitch and heave. Yaw is coupled to the collective in every helicopter.
const OF_SWASH_PLATE: [Pair; 6] = [[0, 1], [1, 0], [0, 3], [1, 3], [3, 0], [3, 1]];

/// Findings; nothing of flights in `except`.
pub(super) fn findings(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    let judged: Vec<&(usize, Regressions)> = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    let ratios =
        |[axis, stick]: Pair| -> Vec<Of> { judged.iter().filter_map(|(flight, all)| cross(*flight, all, axis, stick)).collect() };
    let of_some: Vec<(Pair, Vec<usize>, f64)> = OF_SWASH_PLATE
        .into_iter()
        .filter_map(|pair| odd(ratios(pair)).map(|(flights, by)| (pair, flights, by)))
        // One flight may be flown so.
        .filter(|entry| entry.1.len() >= FEWEST)
        .collect();
    if !of_some.is_empty() {
        return in_some(&of_some, flights);
    }
    let common = |pair: Pair| {
        let such = ratios(pair);
        let value = median(such.iter().map(|one| one.value).collect())?;
        (2 * such.len() > judged.len() && value.abs() > LEAST).then_some((pair, value))
    };
    let of_all: Ratios = OF_SWASH_PLATE.into_iter().filter_map(common).collect();
    let in_all: Ratios = of_all.iter().filter(|(_, value)| value.abs() > AS_MUCH).copied().collect();
    let axes: BTreeSet<usize> = in_all.iter().map(|entry| entry.0[0]).collect();
    let message = format!(
        "{} are mixed: {}; more than any rotor couples them, as where servos of the swash plate, or sticks behind a mixer, were recorded",
        names(in_all.iter().map(|entry| entry.0)),
        told(&in_all)
    );
    (axes.len() > 1).then(|| finding("mixed_sticks", Severity::Fault, message, Some(&unmixed(&of_all)))).into_iter().collect()
}

/// Sticks as they act: what moves an axis, in units of its own stick. Mixers have simple numbers, which a regression meets nearly.
fn unmixed(ratios: &Ratios) -> String {
    let simple = |ratio: f64| {
        let near = (2.0 * ratio).round() / 2.0;
        if (ratio - near).abs() < SIMPLE { near } else { ratio }
    };
    let term = |([_, stick], ratio): &(Pair, f64)| format!(" {} * {}", plus(simple(*ratio), 4), STICKS[*stick]);
    let line = |axis: usize| {
        let terms: String = ratios.iter().filter(|(pair, _)| pair[0] == axis).map(term).collect();
        (!terms.is_empty()).then(|| format!("{} = \"{}{terms}\"", STICKS[axis], STICKS[axis]))
    };
    let lines: Vec<String> = (0..STICKS.len()).filter_map(line).collect();
    format!("[columns] {}, with the file's names", lines.join(", "))
}

/// The flights in which a ratio is another than in the rest, and by how much: the fewer, or of about as many those in which it is farther from 0, as no swash plate
/// mixes by itself.
fn odd(ratios: Vec<Of>) -> Option<(Vec<usize>, f64)> {
    let all: Vec<(usize, f64)> = ratios.iter().map(|one| (one.flight, one.value)).collect();
    let (fewer, by) = apart(ratios, LEAST)?;
    let is_own = |one: &&(usize, f64)| fewer.contains(&one.0);
    let own = median(all.iter().filter(is_own).map(|one| one.1).collect())?;
    let mut others: Vec<usize> = all.iter().filter(|one| !is_own(one)).map(|one| one.0).collect();
    // `by` is from the others to these.
    if fewer.len() as f64 <= AS_MANY * others.len() as f64 || own.abs() >= (own - by).abs() {
        return Some((fewer, by));
    }
    others.sort_unstable();
    Some((others, -by))
}

/// Flights in which the ratio of a pair is another than in the rest; those of the same flights in one finding.
fn in_some(such: &[(Pair, Vec<usize>, f64)], flights: &[Flight]) -> Vec<Finding> {
    let mut alike: Vec<(&[usize], Ratios)> = Vec::new();
    for (pair, fewer, by) in such {
        match alike.iter_mut().find(|(others, _)| others == fewer) {
            Some((_, pairs)) => pairs.push((*pair, *by)),
            None => alike.push((fewer, vec![(*pair, *by)])),
        }
    }
    let of = |(fewer, pairs): (&[usize], Ratios)| {
        let [axis, stick] = pairs[0].0;
        let message = format!(
            "{} are mixed or turned: {}, as {} not in the other flights",
            names(pairs.iter().map(|entry| entry.0)),
            told(&pairs),
            if pairs.len() > 1 { "they do" } else { "it does" }
        );
        in_flights(&format!("mixed_{}_{}", STICKS[axis], STICKS[stick]), fewer, &message, flights)
    };
    alike.into_iter().map(of).collect()
}

/// All sticks of the pairs.
fn names(pairs: impl Iterator<Item = Pair>) -> String {
    let all: BTreeSet<usize> = pairs.flatten().collect();
    listed(&all.into_iter().map(|stick| STICKS[stick]).collect::<Vec<_>>())
}

fn told(pairs: &[(Pair, f64)]) -> String {
    let of = |([axis, stick], ratio): &(Pair, f64)| {
        format!("{} acts on {} by {ratio:.2} times what {} does", STICKS[*stick], AXES[*axis], STICKS[*axis])
    };
    pairs.iter().map(of).collect::<Vec<_>>().join(", ")
}

fn cross(flight: usize, regressions: &Regressions, axis: usize, stick: usize) -> Option<Of> {
    let estimates = regressions[axis].estimates()?;
    let (own, other) = (estimates[FIRST + axis], estimates[FIRST + stick]);
    let is_sure = own.interval[0] * own.interval[1] > 0.0 && regressions[axis].explained()? > EXPLAINED;
    let half = 0.5 * (other.interval[1] - other.interval[0]) / own.value.abs();
    (is_sure && half < LEAST).then_some(Of { flight, value: other.value / own.value, half })
}
