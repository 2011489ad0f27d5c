//! Which stick moves which axis, with what sign and gain, flight by flight: a stick that is exchanged with another, reversed, still or scaled in some
//! flights is told from missing physics by the flights themselves. What signs and gains should be nobody knows before a calibration; that they
//! are the same in all flights is what is asked.
//!
//! Each axis is a regression of its change over a piece on its own state, all four sticks and 1, all integrated over the piece. Nothing is differentiated, and the
//! recorded accelerations are not looked at: a stream of theirs that is late says nothing about sticks.

use super::finding::{Finding, Severity, finding};
use super::flights::{FEWEST, MOST, WIDER, in_flights};
use super::increments::Motion;
use super::regression::{BlockRegression, Estimate};
use super::robust::median;
use super::throws::Sides;
use super::unexplained::{Fit, Left};
use crate::critique::prose::listed;
use crate::flight::Flight;
use crate::flight::attitude::cross;
use std::collections::BTreeSet;
use std::ops::Range;

/// The accelerations by which sticks are told, and the stick that moves each: the conventions of this program.
pub(super) const AXES: [&str; 4] = ["wx_dot", "wy_dot", "wz_dot", "vz_dot"];
pub(super) const STICKS: [&str; 4] = ["u1", "u2", "u3", "u4"];

/// Place of the first stick among the columns, and of the 1.
pub(super) const FIRST: usize = 1;
pub(super) const CONSTANT: usize = 5;
pub(super) const COLUMNS: usize = 6;

/// An axis answers to another stick if that one moves it so many times as much as its own.
const EXCHANGED: f64 = 3.0;
/// A stick that moves by less than this share of what it does in other flights stands still …
const STILL: f64 = 1e-3;
/// … and is missed where its axis moves by this share of what it does there.
const MOVING: f64 = 0.5;
/// An axis tells of sticks where state and sticks explain this share of its changes: in a loop that is closed fast a stick answers to what moves the
/// axis, and its gain is no gain.
pub(super) const EXPLAINED: f64 = 0.5;
/// Gains of one aircraft differ by less than this factor from flight to flight: square of the rotor speed, weight, density.
const LARGEST_RATIO: f64 = 3.0;
/// Two groups of flights write a stick differently from this ratio of its gains on …
const LEAST_RATIO: f64 = 1.7;
/// … where they are so many times as far apart as the gains of each scatter.
const APART: f64 = 8.0;
/// … and, where two sticks have one that is alike, from this one on: their logarithms differ by less than this part, …
const LEAST_RATIO_TOGETHER: f64 = 1.25;
const ALIKE: f64 = 0.25;
/// … and that of a third stick by less than this part of them.
const KEPT: f64 = 0.3;
/// So many axes that answer to no stick make the controls those of another motion.
const DEAF: usize = 3;

pub(super) type Regressions = [BlockRegression<COLUMNS>; 4];

/// Accumulates flights, each by itself.
pub(super) struct Sticks {
    pub flights: Vec<(usize, Regressions)>,
}

/// What one flight, or all of them, say of the sticks.
struct Answers {
    /// `[axis][stick]`: change of the acceleration by a unit of the stick.
    gains: [[Estimate; 4]; 4],
    /// By stick, how far it moves.
    moves: [f64; 4],
    /// By axis, the share of its changes that is explained.
    explained: [f64; 4],
}

impl Answers {
    fn of(regressions: &Regressions) -> [Option<[Estimate; 4]>; 4] {
        std::array::from_fn(|axis| {
            let estimates = regressions[axis].estimates()?;
            Some(std::array::from_fn(|stick| estimates[FIRST + stick]))
        })
    }

    /// `None` where an axis is not determined.
    fn new(regressions: &Regressions) -> Option<Self> {
        let [x, y, z, heave] = Self::of(regressions);
        let moves = std::array::from_fn(|stick| regressions[0].deviation(FIRST + stick, CONSTANT));
        let explained = std::array::from_fn(|axis| regressions[axis].explained().unwrap_or(0.0));
        Some(Self { gains: [x?, y?, z?, heave?], moves, explained })
    }

    /// How far a stick moves an axis.
    fn strength(&self, axis: usize, stick: usize) -> f64 {
        self.gains[axis][stick].value.abs() * self.moves[stick]
    }

    fn is_certain(&self, axis: usize, stick: usize) -> bool {
        let Estimate { value, interval: [low, high] } = self.gains[axis][stick];
        let (low, high) = (value - WIDER * (value - low), value + WIDER * (high - value));
        self.explained[axis] > EXPLAINED && (low > 0.0 || high < 0.0)
    }

    /// Whether an axis answers to its own stick more than to any other.
    fn is_own(&self, axis: usize) -> bool {
        self.is_certain(axis, axis) && (0..4).all(|stick| self.strength(axis, stick) <= self.strength(axis, axis))
    }

    /// The stick to which each axis answers, if they are a permutation other than that of the conventions.
    fn order(&self) -> Option<[usize; 4]> {
        let order: [usize; 4] = std::array::from_fn(|axis| {
            let strongest = (0..4).max_by(|left, right| self.strength(axis, *left).total_cmp(&self.strength(axis, *right)));
            let other = strongest.filter(|&stick| {
                self.is_certain(axis, stick) && self.strength(axis, stick) > EXCHANGED * self.strength(axis, axis)
            });
            other.unwrap_or(axis)
        });
        let mut seen = order;
        seen.sort_unstable();
        (seen == [0, 1, 2, 3] && order != seen).then_some(order)
    }
}

impl Sticks {
    pub fn new() -> Self {
        Self { flights: Vec::new() }
    }

    /// What one flight says, with the magnitude of each axis's own stick beside it.
    pub fn of(motion: &Motion) -> [Sides; 4] {
        let mut regressions: [Sides; 4] = std::array::from_fn(|_| BlockRegression::new());
        for (piece, number) in motion.pieces(0) {
            let block = (0, number);
            let integrals: [f64; 12] = motion.integral(&piece, |sample| {
                let [p, q, r, w] = [0, 1, 2, 3].map(|axis| state_of(motion, sample, axis));
                let [one, two, three, four] = motion.instants[sample].controls;
                [p, q, r, w, one, two, three, four, one.abs(), two.abs(), three.abs(), four.abs()]
            });
            let [states, sticks, sizes] = [&integrals[..4], &integrals[4..8], &integrals[8..]];
            let length_s = super::increments::length_s(motion, &piece);
            for (axis, regression) in regressions.iter_mut().enumerate() {
                let row = [states[axis], sticks[0], sticks[1], sticks[2], sticks[3], length_s, sizes[axis]];
                regression.add(block, &row, change_of(motion, &piece, axis));
            }
        }
        regressions
    }

    /// Adds what a flight says.
    pub fn push(&mut self, flight: usize, sides: &[Sides; 4]) {
        let regressions = std::array::from_fn(|axis| sides[axis].on(std::array::from_fn(|column| column)));
        self.flights.push((flight, regressions));
    }

    /// What state and sticks leave unexplained of each axis in a flight.
    pub fn unexplained(&self, flight: usize) -> Vec<Left> {
        let of = |entry: &(usize, Regressions)| {
            AXES.into_iter().zip(&entry.1).filter_map(|(axis, one)| Left::of(Fit::Answer { axis }, one)).collect()
        };
        self.flights.iter().find(|entry| entry.0 == flight).map_or_else(Vec::new, of)
    }

    /// What is wrong with sticks, worst first; one finding that nothing is, or that these flights do not tell. Flights of which something else is
    /// known to be wrong are left out.
    pub fn findings(&self, flights: &[Flight], except: &BTreeSet<usize>) -> Vec<Finding> {
        let judged = || self.flights.iter().filter(|(flight, _)| !except.contains(flight));
        let all: Regressions =
            std::array::from_fn(|axis| BlockRegression::merged(judged().map(|(_, regressions)| &regressions[axis])));
        let each: Vec<(usize, Option<Answers>)> =
            judged().map(|(flight, regressions)| (*flight, Answers::new(regressions))).collect();
        let known: Vec<(usize, &Answers)> =
            each.iter().filter_map(|(flight, answers)| Some((*flight, answers.as_ref()?))).collect();
        let mut findings = Vec::new();
        let exchanged: Vec<(usize, [usize; 4])> =
            known.iter().filter_map(|(flight, answers)| Some((*flight, answers.order()?))).collect();
        let whole = Answers::new(&all);
        // An order that most flights have shows in all together.
        let common = whole.as_ref().and_then(Answers::order).filter(|order| {
            let alike = exchanged.iter().filter(|entry| entry.1 == *order).count();
            alike as f64 > MOST * known.len() as f64 || exchanged.is_empty()
        });
        match common {
            Some(order) => findings.push(finding("stick_order", Severity::Fault, exchange(&order), Some(&swap(&order)))),
            None => {
                let mut orders: Vec<[usize; 4]> = exchanged.iter().map(|entry| entry.1).collect();
                orders.sort_unstable();
                orders.dedup();
                for order in orders {
                    let such: Vec<usize> = exchanged.iter().filter(|entry| entry.1 == order).map(|entry| entry.0).collect();
                    findings.push(in_flights("stick_order", &such, &exchange(&order), flights));
                }
            }
        }
        if findings.is_empty() {
            findings.extend((0..4).filter_map(|stick| of_sign(stick, &known, flights)));
            findings.extend(of_size(&known, flights));
            let moves: Vec<&(usize, Regressions)> = judged().collect();
            findings.extend((0..4).filter_map(|stick| of_rest(stick, &moves, flights)));
            findings.extend(findings.is_empty().then(|| foreign(&known, &moves, flights)).flatten());
        }
        if findings.is_empty() {
            let open: Vec<&str> =
                (0..4).filter(|&axis| !whole.as_ref().is_some_and(|all| all.is_own(axis))).map(|axis| AXES[axis]).collect();
            let (verdict, message) = match open.as_slice() {
                [] => (Severity::Ok, "each axis answers to its own stick, alike in all flights".into()),
                open => (Severity::Undetermined, format!("these flights do not tell which stick moves {}", listed(open))),
            };
            findings.push(finding("sticks", verdict, message, None));
        }
        findings
    }
}

/// What an axis damps: its rate, or the velocity along z.
pub(super) fn state_of(motion: &Motion, sample: usize, axis: usize) -> f64 {
    let now = &motion.instants[sample];
    now.rates.get(axis).copied().unwrap_or(now.velocity[2])
}

/// What an axis does over a piece: the change of its rate, or of the velocity along z less what moves that beside the rotor.
pub(super) fn change_of(motion: &Motion, piece: &Range<usize>, axis: usize) -> f64 {
    let change = state_of(motion, piece.end, axis) - state_of(motion, piece.start, axis);
    if axis < 3 {
        return change;
    }
    let known = |sample: usize| {
        let now = &motion.instants[sample];
        [now.gravity[2] - cross(now.rates, now.velocity)[2]]
    };
    change - motion.integral(piece, known)[0]
}

/// A stick that stands still in some flights while its axis moves as in the others.
fn of_rest(stick: usize, each: &[&(usize, Regressions)], flights: &[Flight]) -> Option<Finding> {
    let moves: Vec<[f64; 2]> = each
        .iter()
        .map(|(_, regressions)| [regressions[stick].deviation(FIRST + stick, CONSTANT), regressions[stick].response()])
        .collect();
    let usual = |place: usize| {
        let active = moves.iter().filter(|entry| entry[0] > 0.0).map(|entry| entry[place]);
        median(active.collect())
    };
    let [stick_moves, axis_moves] = [usual(0)?, usual(1)?];
    let still = |entry: &[f64; 2]| entry[0] < STILL * stick_moves && entry[1] > MOVING * axis_moves;
    let such: Vec<usize> = each.iter().zip(&moves).filter(|(_, entry)| still(entry)).map(|((flight, _), _)| *flight).collect();
    let (name, axis) = (STICKS[stick], AXES[stick]);
    let message = format!("{name} stands still while {axis} moves as in the others: it was not recorded there");
    (!such.is_empty()).then(|| in_flights(&format!("still_{name}"), &such, &message, flights))
}

/// A stick that acts with one sign in some flights and with the other in the rest.
fn of_sign(stick: usize, known: &[(usize, &Answers)], flights: &[Flight]) -> Option<Finding> {
    let certain: Vec<(usize, f64)> = known
        .iter()
        .filter(|(_, answers)| answers.is_certain(stick, stick))
        .map(|(flight, answers)| (*flight, answers.gains[stick][stick].value))
        .collect();
    let size = median(certain.iter().map(|entry| entry.1.abs()).collect())?;
    // A gain near nothing has no sign.
    let clear = |positive: bool| -> Vec<usize> {
        let large = certain.iter().filter(|entry| entry.1.abs() * LARGEST_RATIO > size);
        large.filter(|entry| (entry.1 > 0.0) == positive).map(|entry| entry.0).collect()
    };
    let [with, against] = [clear(true), clear(false)];
    let fewer = if with.len() < against.len() { with } else { against };
    let name = STICKS[stick];
    let message = format!("{name} acts with the other sign than in the rest");
    (!fewer.is_empty()).then(|| in_flights(&format!("sign_{name}"), &fewer, &message, flights))
}

/// Sticks whose gain in some flights is a multiple of that in the others, and whose travel is that much smaller: what takes the gain away from a
/// rotor, a vortex ring or stall, leaves the stick its travel. Gains of one aircraft scatter from flight to flight; two groups far apart, each close
/// together, are two ways of writing. So are smaller ratios of two sticks, alike and in the same flights, where another stick keeps its gain: another rotor
/// speed or air density changes that one, too.
fn of_size(known: &[(usize, &Answers)], flights: &[Flight]) -> Vec<Finding> {
    let splits: [Option<Groups>; 4] = std::array::from_fn(|stick| Groups::of(stick, known));
    let is_together = |stick: usize, own: &Groups| {
        let alike = |other: &Groups| own.is_alike(other);
        let partner = (0..4).find(|&other| other != stick && splits[other].as_ref().is_some_and(alike));
        partner.is_some_and(|partner| {
            let rest = (0..4).filter(|other| ![stick, partner].contains(other));
            own.ratio.abs() > LEAST_RATIO_TOGETHER.ln() && rest.into_iter().any(|other| own.keeps(other, known))
        })
    };
    let is_other = |stick: usize, groups: &Groups| groups.is_far() || is_together(stick, groups);
    let of = |stick: usize| {
        let groups = splits[stick].as_ref().filter(|groups| is_other(stick, groups))?;
        let (name, ratio) = (STICKS[stick], groups.ratio.exp());
        let message = format!(
            "{name} has {ratio:.2} times the gain of the other flights: in other units there, or scaled, as by a switch of rates"
        );
        Some(in_flights(&format!("gain_{name}"), &groups.fewer, &message, flights))
    };
    (0..4).filter_map(of).collect()
}

/// Two groups of flights with gains of a stick of their own.
struct Groups {
    /// The smaller one, in order, …
    fewer: Vec<usize>,
    /// … and the others.
    others: Vec<usize>,
    /// Logarithm of its gain over that of the others.
    ratio: f64,
}

impl Groups {
    fn of(stick: usize, known: &[(usize, &Answers)]) -> Option<Self> {
        let mut certain: Vec<Sized> = known
            .iter()
            .filter(|(_, answers)| answers.is_certain(stick, stick))
            .map(|(flight, answers)| Sized {
                flight: *flight,
                gain: answers.gains[stick][stick].value.abs().ln(),
                strength: answers.strength(stick, stick).ln(),
            })
            .collect();
        certain.sort_unstable_by(|one, other| one.gain.total_cmp(&other.gain));
        let split = (1..certain.len()).max_by(|one, other| {
            let gap = |at: usize| certain[at].gain - certain[at - 1].gain;
            gap(*one).total_cmp(&gap(*other))
        })?;
        let (small, large) = certain.split_at(split);
        let middle = |group: &[Sized], of: fn(&Sized) -> f64| median(group.iter().map(of).collect());
        let [low, high] = [middle(small, |one| one.gain)?, middle(large, |one| one.gain)?];
        let scatter = small.iter().map(|one| (one.gain - low).abs()).chain(large.iter().map(|one| (one.gain - high).abs()));
        let scatter = median(scatter.collect())?;
        let (apart, gap) = (high - low, large[0].gain - small[split - 1].gain);
        let travel = middle(large, |one| one.strength)? - middle(small, |one| one.strength)?;
        if gap < 0.5 * apart || apart < APART * scatter || travel.abs() > 0.5 * apart {
            return None;
        }
        let flights = |group: &[Sized]| {
            let mut flights: Vec<usize> = group.iter().map(|one| one.flight).collect();
            flights.sort_unstable();
            flights
        };
        let [low, high] = [flights(small), flights(large)];
        let is_high = high.len() <= low.len();
        let (fewer, others, ratio) = if is_high { (high, low, apart) } else { (low, high, -apart) };
        Some(Self { fewer, others, ratio })
    }

    /// Whether another stick has the same ratio between the same flights. In some of them one of the two may not be told, and which group is the smaller one may differ.
    fn is_alike(&self, other: &Self) -> bool {
        let is_turned = self.ratio * other.ratio < 0.0;
        let [fewer, others] = if is_turned { [&other.others, &other.fewer] } else { [&other.fewer, &other.others] };
        let is_apart = |own: &[usize], theirs: &[usize]| own.iter().all(|flight| !theirs.contains(flight));
        let is_shared = |own: &[usize], theirs: &[usize]| own.iter().any(|flight| theirs.contains(flight));
        is_apart(&self.fewer, others)
            && is_apart(&self.others, fewer)
            && is_shared(&self.fewer, fewer)
            && (self.ratio.abs() - other.ratio.abs()).abs() < ALIKE * self.ratio.abs()
    }

    /// Whether the ratio says enough by itself. What is flown in it can take half of a stick's gain in one flight.
    fn is_far(&self) -> bool {
        let least = if self.fewer.len() < FEWEST { LARGEST_RATIO } else { LEAST_RATIO };
        self.ratio.abs() > least.ln()
    }

    /// Whether another stick has the same gain in these flights as in the others.
    fn keeps(&self, stick: usize, known: &[(usize, &Answers)]) -> bool {
        let gain = |is_of: bool| {
            let of =
                known.iter().filter(|(flight, answers)| self.fewer.contains(flight) == is_of && answers.is_certain(stick, stick));
            median(of.map(|(_, answers)| answers.gains[stick][stick].value.abs().ln()).collect())
        };
        gain(true).zip(gain(false)).is_some_and(|(own, others)| (own - others).abs() < KEPT * self.ratio.abs())
    }
}

/// What a flight says of the gain of a stick: the logarithms of the gain and of how far it moves its axis.
struct Sized {
    flight: usize,
    gain: f64,
    strength: f64,
}

/// Flights whose axes move as in the others and answer to no stick: these are of another flight, or of another time.
fn foreign(known: &[(usize, &Answers)], each: &[&(usize, Regressions)], flights: &[Flight]) -> Option<Finding> {
    let usual = |axis: usize| {
        let certain = known.iter().filter(|(_, answers)| answers.is_certain(axis, axis));
        let gains: Vec<f64> = certain.map(|(_, answers)| answers.gains[axis][axis].value.abs()).collect();
        median(gains.clone()).filter(|_| 2 * gains.len() > known.len())
    };
    let usual: [Option<f64>; 4] = std::array::from_fn(usual);
    let response = |axis: usize| median(each.iter().map(|(_, regressions)| regressions[axis].response()).collect());
    let responses: [Option<f64>; 4] = std::array::from_fn(response);
    let is_deaf = |flight: usize, answers: &Answers, axis: usize| {
        let own = each.iter().find(|(index, _)| *index == flight).map(|(_, regressions)| regressions[axis].response());
        let moves = own.zip(responses[axis]).is_some_and(|(own, usual)| own > MOVING * usual);
        let [low, high] = answers.gains[axis][axis].interval.map(f64::abs);
        moves && usual[axis].is_some_and(|usual| low.max(high) * LARGEST_RATIO < usual)
    };
    let such = known.iter().filter(|(flight, answers)| (0..4).filter(|&axis| is_deaf(*flight, answers, axis)).count() >= DEAF);
    let such: Vec<usize> = such.map(|entry| entry.0).collect();
    let message = "the axes move as in the other flights and answer to no stick: the controls do not belong to this motion, or are of another time";
    (!such.is_empty()).then(|| in_flights("foreign_controls", &such, message, flights))
}

/// Which axes answer to which sticks, where these stand in each other's columns.
fn exchange(order: &[usize; 4]) -> String {
    let moved = || (0..4).filter(|&axis| order[axis] != axis);
    let answers: Vec<String> = moved().map(|axis| format!("{} answers to {}", AXES[axis], STICKS[order[axis]])).collect();
    let sticks: Vec<&str> = moved().map(|axis| STICKS[axis]).collect();
    format!("{} are exchanged: {}", listed(&sticks), answers.join(", "))
}

/// What mends it.
fn swap(order: &[usize; 4]) -> String {
    let moved = (0..4).filter(|&axis| order[axis] != axis);
    let set: Vec<String> = moved.map(|axis| format!("{} = \"{}\"", STICKS[axis], STICKS[order[axis]])).collect();
    format!("[columns] {}, with the file's names", set.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sticks_are_switched_together_whichever_group_is_the_smaller() {
        let groups = |fewer: &[usize], others: &[usize], ratio: f64| Groups { fewer: fewer.into(), others: others.into(), ratio };
        let one = groups(&[0, 2], &[1, 3, 5], -0.5);
        assert!(
            one.is_alike(&groups(&[1, 3], &[0, 2, 4], 0.52)),
            "the other way round, and flights that one of them does not tell"
        );
        assert!(one.is_alike(&groups(&[0, 2], &[1, 3], -0.45)));
        assert!(!one.is_alike(&groups(&[0, 2], &[1, 3], -0.9)), "another ratio");
        assert!(!one.is_alike(&groups(&[0, 3], &[1, 2], -0.5)), "other flights");
        assert!(!one.is_alike(&groups(&[0, 2], &[1, 3], 0.5)), "the other way");
    }
}
