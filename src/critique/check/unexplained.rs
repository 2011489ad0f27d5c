//! Flights in which something is left unexplained that the others explain, whatever its cause: the last question, asked of flights of which no
//! reading has named one.
//!
//! Each kinematic relation, and the answer of each axis to state and sticks, is fitted in each flight by itself, with gains and a constant of its
//! own. What such a fit leaves is noise, gusts and physics that is missing everywhere. A flight in which it leaves many times what it leaves in the others, both
//! in its own unit and as a share of what moves, has something that they have not. Of a relation that is pure mechanics this is a fault of the log. An
//! axis that answers to nothing may also be an aircraft that lost its rotor speed, so that is a warning.

use super::finding::{Finding, Severity};
use super::flights::{MOST, in_flights};
use super::increments::SHORT_BLOCK_S;
use super::regression::BlockRegression;
use super::robust::lower_quartile;
use crate::flight::Flight;
use std::collections::BTreeSet;

/// A flight stands out where a fit leaves so many times what it leaves in the quieter flights. On simulated flights with nothing wrong, some of them
/// aerobatic, windy, or with every mechanism on, no relation left more than 2.2 times as much …
const OUTSTANDING: f64 = 4.0;
/// … and it matters from this share of the root mean square of the changes on.
const LEAST_SHARE: f64 = 0.04;
/// An axis answers to nothing where this share is left: a vortex ring or a tumble leave 0.7.
const DEAF_SHARE: f64 = 0.8;

/// Errors lie in places where so much of their squares …
const HELD: f64 = 0.8;
/// … lies in this share of the blocks.
const IN_PLACES: f64 = 0.2;

/// How names of these findings begin.
pub(super) const UNEXPLAINED: &str = "unexplained_";

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fit {
    /// A relation of mechanics: its name, what changes in it, and what says how much.
    Mechanics { name: &'static str, changes: &'static str, says: &'static str },
    /// The answer of an axis to state and sticks.
    Answer { axis: &'static str },
}

/// Of the position.
pub(super) const POSITION: Fit =
    Fit::Mechanics { name: "position", changes: "the position (x, y, z)", says: "velocity and attitude say" };

/// Whether a relation of mechanics leaves so much that it is worth asking why.
pub(super) fn is_worth_asking(left: &[Left]) -> bool {
    left.iter().any(|left| matches!(left.fit, Fit::Mechanics { .. }) && left.share > LEAST_SHARE)
}

/// What a fit leaves in one flight.
#[derive(Clone, Debug)]
pub(super) struct Left {
    fit: Fit,
    /// Root mean square of the error over a piece, in the unit of what changes.
    error: f64,
    /// The same over the root mean square of the change.
    share: f64,
    /// Where most of it lies, s, if it lies in few places.
    places_s: Vec<f64>,
}

impl Left {
    /// `None` where there is too little for a fit, or nothing moves.
    pub fn of<const K: usize>(fit: Fit, regression: &BlockRegression<K>) -> Option<Self> {
        let errors = regression.errors()?;
        let error = (errors.iter().sum::<f64>() / regression.rows()).sqrt();
        let response = regression.response();
        let places_s = places(&errors).into_iter().map(|block| SHORT_BLOCK_S * block as f64).collect();
        (response > 0.0).then(|| Self { fit, error, share: error / response, places_s })
    }
}

/// The few blocks that hold most of the squared errors, in order; none where they do not.
fn places(errors: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_unstable_by(|one, other| errors[*other].total_cmp(&errors[*one]));
    let mut rest = HELD * errors.iter().sum::<f64>();
    let held = order.iter().position(|&block| {
        rest -= errors[block];
        rest <= 0.0
    });
    let count = held.map_or(errors.len(), |last| last + 1);
    if count as f64 > IN_PLACES * errors.len() as f64 {
        return Vec::new();
    }
    order.truncate(count);
    order.sort_unstable();
    order
}

/// A flight by its place, and what is left in it.
pub(super) type OfFlight = (usize, Vec<Left>);

/// Flights that break with mechanics where others do not.
pub(super) fn outstanding(each: &[OfFlight]) -> BTreeSet<usize> {
    let broken = broken(each, |fit| matches!(fit, Fit::Mechanics { .. }), &BTreeSet::new());
    broken.iter().flat_map(|one| one.flights.iter().map(|entry| entry.0)).collect()
}

/// Flights that break with mechanics, in one finding for all relations; none of those in `except`, of which more is known.
pub(super) fn of_mechanics(each: &[OfFlight], except: &BTreeSet<usize>, flights: &[Flight]) -> Option<Finding> {
    let broken = broken(each, |fit| matches!(fit, Fit::Mechanics { .. }), except);
    let worst = broken.iter().max_by(|one, other| one.share.total_cmp(&other.share))?;
    let says = |one: &Broken<'_>| match one.fit {
        Fit::Mechanics { changes, says, .. } => format!("{changes} changes otherwise than {says}"),
        Fit::Answer { .. } => unreachable!("only mechanics was asked"),
    };
    let others = match broken.len() - 1 {
        0 => String::new(),
        1 => ", and another relation is broken".into(),
        others => format!(", and {others} other relations are broken"),
    };
    let message = format!("{}{others}: {}. No reading of the columns that is known here mends it", says(worst), worst.how());
    let indices: BTreeSet<usize> = broken.iter().flat_map(|one| one.flights.iter().map(|entry| entry.0)).collect();
    let name = match worst.fit {
        Fit::Mechanics { name, .. } => format!("{UNEXPLAINED}{name}"),
        Fit::Answer { .. } => unreachable!("only mechanics was asked"),
    };
    let finding = in_flights(&name, &indices.iter().copied().collect::<Vec<_>>(), &message, flights);
    // Where the aircraft is drives nothing but the effect of the ground; and derived accelerations agree with any velocity, be it right or wrong.
    let knows_velocity = |entry: &OfFlight| entry.1.iter().any(|left| matches!(left.fit, Fit::Mechanics { name: "vx_dot", .. }));
    let is_position = worst.fit == POSITION && broken.len() == 1;
    let is_harmless = is_position && each.iter().filter(|entry| indices.contains(&entry.0)).all(knows_velocity);
    Some(if is_harmless { Finding { verdict: Severity::Warning, ..finding } } else { finding })
}

/// Flights whose axes answer to nothing, a finding for each axis; none of those in `except`.
pub(super) fn of_answers(each: &[OfFlight], except: &BTreeSet<usize>, flights: &[Flight]) -> Vec<Finding> {
    let told = |one: Broken<'_>| {
        let Fit::Answer { axis } = one.fit else { unreachable!("only answers were asked") };
        let message = format!(
            "{axis} answers to no stick as in the other flights, and moves as there: {}. A stick that was not recorded, or another aircraft",
            one.how()
        );
        let indices: Vec<usize> = one.flights.iter().map(|entry| entry.0).collect();
        Finding { verdict: Severity::Warning, ..in_flights(&format!("{UNEXPLAINED}{axis}"), &indices, &message, flights) }
    };
    broken(each, |fit| matches!(fit, Fit::Answer { .. }), except).into_iter().map(told).collect()
}

/// A fit that leaves much in some flights.
struct Broken<'a> {
    fit: Fit,
    flights: Vec<(usize, &'a Left)>,
    /// The largest share that is left …
    share: f64,
    /// … and the usual one.
    usual: f64,
}

fn broken<'a>(each: &'a [OfFlight], is_asked: fn(Fit) -> bool, except: &BTreeSet<usize>) -> Vec<Broken<'a>> {
    let fits: BTreeSet<Fit> = each.iter().flat_map(|(_, left)| left.iter().map(|left| left.fit)).collect();
    let of = |fit: Fit| -> Option<Broken<'a>> {
        let such = each.iter().filter_map(|(flight, left)| Some((*flight, left.iter().find(|left| left.fit == fit)?)));
        let all: Vec<(usize, &Left)> = such.collect();
        let error = lower_quartile(all.iter().map(|entry| entry.1.error).collect())?;
        let usual = lower_quartile(all.iter().map(|entry| entry.1.share).collect())?;
        let least = match fit {
            Fit::Mechanics { .. } => LEAST_SHARE,
            Fit::Answer { .. } => DEAF_SHARE,
        };
        let stands_out = |left: &Left| (left.error / error).min(left.share / usual) > OUTSTANDING && left.share > least;
        let such = all.iter().filter(|(_, left)| stands_out(left));
        if such.clone().count() as f64 > MOST * all.len() as f64 {
            return None;
        }
        let flights: Vec<(usize, &Left)> = such.filter(|(flight, _)| !except.contains(flight)).copied().collect();
        let share = flights.iter().map(|entry| entry.1.share).fold(0.0, f64::max);
        (!flights.is_empty()).then_some(Broken { fit, flights, share, usual })
    };
    fits.into_iter().filter(|fit| is_asked(*fit)).filter_map(of).collect()
}

impl Broken<'_> {
    fn how(&self) -> String {
        let [left, usually] = [self.share, self.usual].map(|share| 100.0 * share * share);
        let places = told(&self.flights);
        format!("up to {left:.0} % of the squares of its changes is left, where quiet flights leave {usually:.2} %{places}")
    }
}

/// Where in the flights the errors lie, if in few places.
fn told(such: &[(usize, &Left)]) -> String {
    let in_places = such.iter().filter(|(_, left)| !left.places_s.is_empty()).count();
    if 2 * in_places <= such.len() {
        return String::new();
    }
    let first = such.iter().find(|(_, left)| !left.places_s.is_empty());
    let at: Vec<String> =
        first.iter().flat_map(|(_, left)| left.places_s.iter().take(5).map(|at_s| format!("{at_s:.0} s"))).collect();
    format!("; most of it in few places, as of leaps, missing or repeated rows (in the first of them from {} on)", at.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIT: Fit = POSITION;

    /// A regression of 30 blocks of ten rows, with an error of this size in each block.
    fn regression(error: impl Fn(usize) -> f64) -> BlockRegression<1> {
        let mut regression = BlockRegression::new();
        for block in 0..30 {
            for row in 0..10 {
                let x = f64::from(row) - 4.5;
                let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
                regression.add((0, block), &[x], 2.0 * x + sign * error(block));
            }
        }
        regression
    }

    #[test]
    fn errors_that_lie_in_few_blocks_are_placed_and_others_are_not() {
        let leaps = Left::of(FIT, &regression(|block| if block == 7 || block == 21 { 50.0 } else { 0.1 })).expect("a fit");
        assert_eq!(leaps.places_s, [14.0, 42.0]);
        let even = Left::of(FIT, &regression(|_| 1.0)).expect("a fit");
        assert!(even.places_s.is_empty());
        assert!((even.error - 1.0).abs() < 0.1);
    }
}
