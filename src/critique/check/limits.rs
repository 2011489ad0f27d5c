//! Sticks that a log cuts off: their values pile up at an end that is not the end of their travel, and while they stand there the axis goes on
//! answering. A stick that stands at its real end moves its axis no further.

use super::finding::Finding;
use super::flights::{WIDER, of_set_or_flights};
use super::increments::{Motion, length_s};
use super::regression::BlockRegression;
use super::robust::median;
use super::sticks::{STICKS, change_of, state_of};
use crate::flight::Flight;
use std::collections::BTreeSet;

/// A stick stands at an end for this share of a flight …
const PILED: f64 = 0.01;
/// … in so many pieces of it.
const TIMES: usize = 3;
/// Beyond the end its axis answers to this share of the travel up to there.
const BEYOND: f64 = 0.1;

/// What flights say of a stick at its ends: change of its axis on the axis's own state, the stick, 1, and the ends (+1 and −1).
type Ends = BlockRegression<4>;

/// What one flight says of each stick: how far it goes and, where its values pile up there, what its axis does meanwhile.
pub(super) type Piled = [Option<(f64, Ends)>; 4];

/// Looks at one flight.
pub(super) fn of(motion: &Motion) -> Piled {
    std::array::from_fn(|stick| of_stick(motion, stick))
}

fn of_stick(motion: &Motion, stick: usize) -> Option<(f64, Ends)> {
    let value = |sample: usize| motion.instants[sample].controls[stick];
    let range = |of: fn(f64, f64) -> f64| (0..motion.instants.len()).map(value).reduce(of);
    let [low, high] = [range(f64::min)?, range(f64::max)?];
    if low == high {
        return None;
    }
    let at = |end: f64| (0..motion.instants.len()).filter(|&sample| value(sample) == end).count();
    let runs = |end: f64| (1..motion.instants.len()).filter(|&sample| value(sample) == end && value(sample - 1) != end).count();
    let is_end = |end: f64| at(end) as f64 > PILED * motion.instants.len() as f64 && runs(end) >= TIMES && at(end) > 3 * runs(end);
    let ends = [low, high].map(is_end);
    if ends == [false, false] {
        return None;
    }
    let side = |sample: usize| match value(sample) {
        end if ends[1] && end == high => 1.0,
        end if ends[0] && end == low => -1.0,
        _ => 0.0,
    };
    let mut regression = BlockRegression::new();
    for (piece, number) in motion.pieces(0) {
        let [state, controls, sides] =
            motion.integral(&piece, |sample| [state_of(motion, sample, stick), value(sample), side(sample)]);
        let row = [state, controls, length_s(motion, &piece), sides];
        regression.add((0, number), &row, change_of(motion, &piece, stick));
    }
    Some((low.abs().max(high.abs()), regression))
}

/// Sticks that are cut off; of flights of which nothing else is known to be wrong.
pub(super) fn findings(each: &[(usize, Piled)], flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
    (0..4).filter_map(|stick| cut_off(stick, each, flights, except)).collect()
}

fn cut_off(stick: usize, each: &[(usize, Piled)], flights: &[Flight], except: &BTreeSet<usize>) -> Option<Finding> {
    let judged = each.iter().filter(|(flight, _)| !except.contains(flight));
    let piled: Vec<(usize, f64, &Ends)> =
        judged.filter_map(|(flight, piled)| piled[stick].as_ref().map(|(end, ends)| (*flight, *end, ends))).collect();
    let end = median(piled.iter().map(|entry| entry.1).collect())?;
    let merged = BlockRegression::merged(piled.iter().map(|entry| entry.2));
    let [_, gain, _, beyond] = merged.estimates()?;
    let [low, high] = beyond.interval;
    let (low, high) = (beyond.value - WIDER * (beyond.value - low), beyond.value + WIDER * (high - beyond.value));
    let share = beyond.value / (gain.value * end);
    if (low <= 0.0 && high >= 0.0) || share < BEYOND || share.is_nan() {
        return None;
    }
    let name = STICKS[stick];
    let message = format!(
        "{name} is cut off at {end:.2}: its axis goes on answering there, by {:.0} % of that travel more on the average, so the stick went further than the log",
        100.0 * share
    );
    let indices: Vec<usize> = piled.iter().map(|entry| entry.0).collect();
    Some(of_set_or_flights(&format!("cut_off_{name}"), &indices, flights.len(), &message, None, flights))
}
