//! Sticks that act on each other's axes in some flights and not in the rest: recorded behind a mixer, or before it, or turned against the swash plate. An
//! aircraft in which they do so in all flights has a cross-coupling; that is the business of a search.

use super::finding::Finding;
use super::flights::{FEWEST, MOST, in_flights};
use super::robust::{NORMAL, median};
use super::sticks::{AXES, EXPLAINED, FIRST, Regressions, STICKS, Sticks};
use crate::flight::Flight;
use std::collections::BTreeSet;

/// Gains of a stick on another axis, over that of the axis' own stick, are of two kinds from here on apart …
const LEAST: f64 = 0.15;
/// … where they are so many times as far apart as each kind scatters.
const APART: f64 = 6.0;

/// What a flight says of a stick on another axis.
struct Cross {
    flight: usize,
    /// Its gain over that of the axis' own stick.
    ratio: f64,
    /// Half of the interval of it.
    half: f64,
}

/// A finding for each cyclic axis; nothing of flights in `except`.
pub(super) fn findings(sticks: &Sticks, flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    let judged: Vec<&(usize, Regressions)> = sticks.flights.iter().filter(|(flight, _)| !except.contains(flight)).collect();
    let of = |[axis, stick]: [usize; 2]| {
        let ratios: Vec<Cross> = judged.iter().filter_map(|(flight, all)| cross(*flight, all, axis, stick)).collect();
        let (fewer, by) = apart(ratios)?;
        let (own, other) = (STICKS[axis], STICKS[stick]);
        let message = format!(
            "{own} and {other} are mixed or turned: {other} acts on {} by {by:.2} times what {own} does, as it does not in the other flights",
            AXES[axis]
        );
        Some(in_flights(&format!("mixed_{own}_{other}"), &fewer, &message, flights))
    };
    [[0, 1], [1, 0]].into_iter().filter_map(of).collect()
}

fn cross(flight: usize, regressions: &Regressions, axis: usize, stick: usize) -> Option<Cross> {
    let estimates = regressions[axis].estimates()?;
    let (own, other) = (estimates[FIRST + axis], estimates[FIRST + stick]);
    let is_sure = own.interval[0] * own.interval[1] > 0.0 && regressions[axis].explained()? > EXPLAINED;
    let half = 0.5 * (other.interval[1] - other.interval[0]) / own.value.abs();
    (is_sure && half < LEAST).then_some(Cross { flight, ratio: other.value / own.value, half })
}

/// The smaller of two groups of flights far apart, and by how much; `None` where there is one group.
fn apart(mut all: Vec<Cross>) -> Option<(Vec<usize>, f64)> {
    all.sort_unstable_by(|one, other| one.ratio.total_cmp(&other.ratio));
    let gap = |at: usize| all[at].ratio - all[at - 1].ratio;
    let split = (1..all.len()).max_by(|one, other| gap(*one).total_cmp(&gap(*other)))?;
    let gap = gap(split);
    let count = all.len();
    let high = all.split_off(split);
    let middle = |group: &[Cross]| median(group.iter().map(|one| one.ratio).collect());
    let [below, above] = [middle(&all)?, middle(&high)?];
    let scatter = all.iter().map(|one| one.ratio - below).chain(high.iter().map(|one| one.ratio - above));
    let scatter = NORMAL * median(scatter.map(f64::abs).collect())?;
    let by = above - below;
    let (fewer, by) = if high.len() <= all.len() { (high, by) } else { (all, -by) };
    let unsure = median(fewer.iter().map(|one| one.half).collect())?;
    let is_apart = by.abs() > LEAST + unsure && by.abs() > APART * scatter && gap > 0.4 * by.abs();
    let mut indices: Vec<usize> = fewer.iter().map(|one| one.flight).collect();
    indices.sort_unstable();
    (is_apart && indices.len() >= FEWEST && (indices.len() as f64) < MOST * count as f64).then_some((indices, by))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratios(of: &[f64]) -> Vec<Cross> {
        of.iter().enumerate().map(|(flight, &ratio)| Cross { flight, ratio, half: 0.02 }).collect()
    }

    #[test]
    fn two_kinds_of_flights_are_told_and_a_coupling_that_all_have_is_not() {
        let (flights, by) = apart(ratios(&[0.0, 0.37, 0.01, 0.35, -0.01, 0.36, 0.02])).expect("two kinds");
        assert_eq!(flights, [1, 3, 5]);
        assert!((by - 0.36).abs() < 0.02, "{by}");
        assert!(apart(ratios(&[0.35, 0.37, 0.34, 0.36, 0.38])).is_none());
        assert!(apart(ratios(&[0.0, 0.4, 0.01, 0.0, 0.02])).is_none(), "one flight may be flown so");
    }
}
