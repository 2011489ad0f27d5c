//! Sensors that sit turned in the aircraft: by which small angles the attitude is turned against the velocity and against the rates. Other orders and
//! signs of whole columns are in `relations`, single columns in `gains`.
//!
//! If the attitude R is that of axes turned by δ against the body's, ṗ = R (v − δ × v) and ṙ = r × (ω − δ × ω) for its rows r, to first order in δ. Both
//! are linear in δ. An attitude that is off shows the same δ in both; a turned gyro or velocity sensor in one. Offsets of v and ω are fitted beside it: at
//! a constant speed they look the same; and a delay of the attitude, which in a steady roll does.

use super::finding::{Finding, Severity, finding};
use super::increments::{Motion, Vector};
use super::regression::{BlockRegression, Estimate};
use super::robust::median;
use super::told::plus;
use crate::blocks::FEW_BLOCKS;
use crate::flight::attitude::cross;

/// A sensor that sits turned by so much, rad, is not mounted as meant.
const TURNED: f64 = 0.05;
/// The same of an attitude that the description levels: what is left of that is no way of mounting.
const STILL_TURNED: f64 = 0.002;
/// Share of the error that is left at most where a turn is its cause.
const CONVINCING_SHARE: f64 = 0.5;
/// Two estimates of one angle differ at most by this share of it.
const ALIKE: f64 = 0.5;

/// Of the finding.
pub(super) const NAME: &str = "mounts";
/// Of the one on what levelling left.
pub(super) const STILL: &str = "still_tilted";

const AXES: [&str; 3] = ["x", "y", "z"];
const RATES: &str = "rates";

/// Accumulates over flights.
pub(super) struct Mounts {
    /// Against the velocity, where there is a position.
    velocity: BlockRegression<7>,
    rates: BlockRegression<7>,
}

/// What one regression says: δ about each axis.
pub(super) struct Turn {
    angles: [Estimate; 3],
    /// A turn is what is wrong with the relation.
    convinces: bool,
}

impl Turn {
    /// The axis about which the turn is certainly that of another mount.
    fn axis(&self) -> Option<usize> {
        let certain = |axis: &usize| {
            let [low, high] = self.angles[*axis].interval;
            low > TURNED || high < -TURNED
        };
        (0..3).filter(certain).max_by(|one, other| self.size(*one).total_cmp(&self.size(*other)))
    }

    /// Whether it is another mount than the one that is usual, by δ about each axis.
    fn is_beyond(&self, usual: &[f64; 3]) -> bool {
        self.axis().is_some_and(|axis| {
            let [low, high] = self.angles[axis].interval.map(|bound| bound - usual[axis]);
            low > TURNED || high < -TURNED
        })
    }

    fn size(&self, axis: usize) -> f64 {
        self.angles[axis].value.abs()
    }

    fn largest(&self) -> usize {
        (0..3).max_by(|one, other| self.size(*one).total_cmp(&self.size(*other))).expect("there are three axes")
    }
}

/// Against the velocity and against the rates, where they are known.
pub(super) type Turns = [Option<Turn>; 2];

/// δ about each axis, rad, by stream: the median of the flights in which nothing is turned too far. What all share is a property of the aircraft, as an
/// inertial unit is that sits a degree or two off, and no fault of one flight.
pub(super) fn usual<'t>(flights: impl Iterator<Item = &'t Turns>) -> [[f64; 3]; 2] {
    let sound: Vec<&Turns> = flights.filter(|turns| turns.iter().flatten().all(|turn| turn.axis().is_none())).collect();
    let of = |stream: usize, axis: usize| {
        let angles = sound.iter().filter_map(|turns| Some(turns[stream].as_ref()?.angles[axis].value));
        median(angles.collect()).unwrap_or(0.0)
    };
    std::array::from_fn(|stream| std::array::from_fn(|axis| of(stream, axis)))
}

/// Whether a flight has another mount than the usual one.
pub(super) fn is_beyond(turns: &Turns, usual: &[[f64; 3]; 2]) -> bool {
    turns.iter().zip(usual).any(|(turn, usual)| turn.as_ref().is_some_and(|turn| turn.is_beyond(usual)))
}

impl Mounts {
    pub fn new() -> Self {
        Self { velocity: BlockRegression::new(), rates: BlockRegression::new() }
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        for (piece, number) in motion.pieces(0) {
            let block = (flight, number);
            let at = |k: usize| &motion.instants[k];
            for row in if motion.heading { 0..3 } else { 2..3 } {
                if motion.position && motion.heading {
                    // ∫ r·v, and ∫ r × v, which is −∫ r·(e × v) for the three axes e, ∫ r, and ∫ ṙ·v.
                    let [gone, columns @ ..] = motion.integral(&piece, |k| {
                        let (axis, velocity) = (at(k).rotation[row], at(k).velocity);
                        let [x, y, z] = cross(axis, velocity);
                        [dot(axis, velocity), x, y, z, axis[0], axis[1], axis[2], dot(cross(axis, at(k).rates), velocity)]
                    });
                    self.velocity.add(block, &columns, at(piece.end).position[row] - at(piece.start).position[row] - gone);
                }
                // ∫ r_a ω_b, and ∫ r; ∫ ṙ × ω.
                let later = motion.integral(&piece, |k| cross(cross(at(k).rotation[row], at(k).rates), at(k).rates));
                let products: [f64; 12] = motion.integral(&piece, |k| {
                    let axis = at(k).rotation[row];
                    std::array::from_fn(|i| axis[i / 4] * if i % 4 < 3 { at(k).rates[i % 4] } else { 1.0 })
                });
                let product = |a: usize, b: usize| products[4 * a + b];
                let along: f64 = (0..3).map(|axis| product(axis, axis)).sum();
                for (axis, later) in later.into_iter().enumerate() {
                    let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
                    let change = at(piece.end).rotation[row][axis] - at(piece.start).rotation[row][axis];
                    let mut columns = [0.0; 7];
                    columns[6] = later;
                    // r × (e × ω) = e (r·ω) − ω (r·e).
                    for (of, column) in columns[..3].iter_mut().enumerate() {
                        *column = product(of, axis) - if of == axis { along } else { 0.0 };
                    }
                    // r × e.
                    (columns[3 + last], columns[3 + next]) = (product(next, 3), -product(last, 3));
                    self.rates.add(block, &columns, change - (product(next, last) - product(last, next)));
                }
            }
        }
    }

    /// Adds the blocks of others, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        self.velocity.absorb(&other.velocity, together);
        self.rates.absorb(&other.rates, together);
    }

    /// The angles.
    pub fn turns(&self) -> Turns {
        [&self.velocity, &self.rates].map(turn)
    }

    /// What is left of an attitude that the description levels. An offset of an angle is no turn, but to first order: so the first estimate of a large one is off.
    pub fn still_tilted(&self) -> Option<Finding> {
        let turns: Vec<Turn> = self.turns().into_iter().flatten().collect();
        let width = |angle: &Estimate| angle.interval[1] - angle.interval[0];
        let angle = |axis: usize| {
            let angles = turns.iter().map(|turn| turn.angles[axis]);
            let best = angles.min_by(|one, other| width(one).total_cmp(&width(other)))?;
            let [low, high] = best.interval;
            (best.value.abs() > STILL_TURNED && (low > 0.0 || high < 0.0)).then_some(best)
        };
        let angles = [angle(0), angle(1)];
        let largest = angles.iter().flatten().max_by(|one, other| one.value.abs().total_cmp(&other.value.abs()))?;
        let by = std::array::from_fn(|axis| angles.get(axis).copied().flatten().map_or(0.0, |angle| angle.value));
        let [roll, pitch, _] = by.map(f64::to_degrees);
        let message = format!("levelled as dataset.toml says, roll is still off by {roll:.2}°, pitch by {pitch:.2}°");
        Some(Finding { name: STILL.into(), ..of_angle(*largest, Severity::Warning, message, Some(levelled(by))) })
    }

    /// What is turned, or that nothing is; nothing is said of a stream in which a column is known to be read wrongly, as `sound` says of velocity and
    /// rates.
    ///
    /// `with_targets` says that the recorded angular accelerations are those of the rates: what turns the one turns the other.
    pub fn findings(&self, sound: [bool; 2], with_targets: bool) -> Vec<Finding> {
        let of = |regression, sound: bool| turn(regression).filter(|_| sound);
        let (velocity, rates) = (of(&self.velocity, sound[0]), of(&self.rates, sound[1]));
        if let Some((angle, axis)) = velocity.as_ref().zip(rates.as_ref()).and_then(|(velocity, rates)| together(velocity, rates)) {
            return vec![attitude(angle, axis)];
        }
        let turned = [(velocity, "velocity"), (rates, RATES)];
        let known = || turned.iter().filter_map(|(turn, stream)| Some((turn.as_ref()?, *stream)));
        let of_rates = known().find(|(_, stream)| *stream == RATES).map(|(turn, _)| turn);
        let faults = known()
            .filter(|(turn, _)| turn.convinces)
            .filter_map(|(turn, stream)| Some(against(turn, turn.axis()?, stream, of_rates, with_targets)));
        let faults: Vec<Finding> = faults.collect();
        if !faults.is_empty() {
            return faults;
        }
        let most =
            known().map(|(turn, _)| turn.angles[turn.largest()]).max_by(|one, other| one.value.abs().total_cmp(&other.value.abs()));
        let sound = |angle| of_angle(angle, Severity::Ok, "attitude, velocity and rates are in the same axes".into(), None);
        most.map(sound).into_iter().collect()
    }
}

/// Where both say the same angle, and it is what is wrong with one of them: the angle against the velocity, and its axis.
fn together(velocity: &Turn, rates: &Turn) -> Option<(Estimate, usize)> {
    let axis = velocity.axis()?;
    let [one, other] = [velocity, rates].map(|turn| turn.angles[axis].value);
    let is_alike = rates.axis() == Some(axis) && (one - other).abs() < ALIKE * one.abs();
    (is_alike && (velocity.convinces || rates.convinces)).then_some((velocity.angles[axis], axis))
}

fn dot(one: Vector, other: Vector) -> f64 {
    (0..3).map(|axis| one[axis] * other[axis]).sum()
}

fn turn(regression: &BlockRegression<7>) -> Option<Turn> {
    if regression.blocks() < FEW_BLOCKS {
        return None;
    }
    let [x, y, z, ..] = regression.estimates()?;
    let left: f64 = regression.errors()?.iter().sum();
    // Against offsets and delay alone.
    let without: f64 = regression.on([3, 4, 5, 6]).errors()?.iter().sum();
    Some(Turn { angles: [x, y, z], convinces: left < CONVINCING_SHARE * without })
}

/// The attitude is turned against both others.
fn attitude(angle: Estimate, axis: usize) -> Finding {
    let value = angle.value;
    let message = format!(
        "{} is off by {:.1}°: the attitude is turned about {} against velocity and rates",
        ["roll", "pitch", "yaw"][axis],
        value.to_degrees(),
        AXES[axis]
    );
    // A heading that is off is another matter: which way the aircraft goes is known besides.
    let by = std::array::from_fn(|of| if of == axis { value } else { 0.0 });
    of_angle(angle, Severity::Fault, message, (axis < 2).then(|| levelled(by)))
}

/// The line that takes angles off roll and pitch.
fn levelled(by: Vector) -> String {
    let line = |(name, by): (&str, f64)| {
        let angle = format!("{name} {}", plus(-by, 4));
        // There is no pitch beyond the vertical.
        if name == "pitch" { format!("{name} = \"clamp({angle}, -1.5707, 1.5707)\"") } else { format!("{name} = \"{angle}\"") }
    };
    let angles = ["roll", "pitch"].into_iter().zip(by).filter(|(_, by)| *by != 0.0);
    format!("[columns] {}, with the file's names", angles.map(line).collect::<Vec<_>>().join(", "))
}

/// The axes of a stream against the attitude. Where the rates show the turn of the velocity rather than none, it is the attitude that is not level.
fn against(turn: &Turn, axis: usize, stream: &str, of_rates: Option<&Turn>, with_targets: bool) -> Finding {
    let angle = turn.angles[axis];
    let degrees = -angle.value.to_degrees();
    let message = format!("the axes of the {stream} are turned by {degrees:.1}° about {} against the attitude", AXES[axis]);
    if stream == RATES {
        return of_angle(angle, Severity::Fault, message, Some(turned_back(angle.value, axis, with_targets)));
    }
    // About one axis is enough: an offset of the pitch angle is no turn that goes along with the roll, and rates show a part of it.
    let agrees = |rates: &Turn| {
        let is_alike = |of: usize| (rates.angles[of].value / turn.angles[of].value - 1.0).abs() < ALIKE;
        (0..2).any(|of| turn.size(of) > TURNED && is_alike(of))
    };
    let set = (axis < 2 && of_rates.is_some_and(agrees)).then(|| {
        let by = |of: usize| Some(turn.angles[of].value).filter(|value| of < 2 && value.abs() > 0.5 * TURNED).unwrap_or(0.0);
        levelled(std::array::from_fn(by))
    });
    let why = if set.is_some() { ", and so are those of the rates: roll and pitch are not level" } else { "" };
    of_angle(angle, Severity::Fault, format!("{message}{why}"), set)
}

/// The line that turns rates back, and what was made of them.
fn turned_back(angle: f64, axis: usize, with_targets: bool) -> String {
    // What a large turn has in common with a small one is its sine.
    let (sin, cos) = angle.clamp(-1.0, 1.0).asin().sin_cos();
    let [next, last] = [(axis + 1) % 3, (axis + 2) % 3].map(|axis| AXES[axis]);
    let of = |end: &str| {
        let (one, other) = (format!("w{next}{end}"), format!("w{last}{end}"));
        let [with, against] = [sin, -sin].map(|by| plus(by, 4));
        format!("{one} = \"{cos:.4} * {one} {with} * {other}\", {other} = \"{cos:.4} * {other} {against} * {one}\"")
    };
    let ends = if with_targets { vec!["", "_dot"] } else { vec![""] };
    let columns: Vec<String> = ends.into_iter().map(of).collect();
    format!("[columns] {}, with the file's names", columns.join(", "))
}

fn of_angle(angle: Estimate, verdict: Severity, message: String, set: Option<String>) -> Finding {
    Finding {
        measured: Some(angle.value),
        interval: Some(angle.interval),
        expected: Some(0.0),
        unit: "rad".into(),
        ..finding(NAME, verdict, message, set.as_deref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turns(about_x: f64) -> Turns {
        let angle = |value: f64| Estimate { value, interval: [value - 0.002, value + 0.002] };
        [None, Some(Turn { angles: [angle(about_x), angle(0.0), angle(0.0)], convinces: true })]
    }

    #[test]
    fn a_flight_is_turned_against_what_the_most_show() {
        let with = |common: f64, many: usize, others: f64| {
            let all: Vec<Turns> = (0..20).map(|flight| turns(if flight < many { common } else { others })).collect();
            is_beyond(&all[19], &usual(all.iter()))
        };
        // All sit a little off, and one is estimated a little more: the same mount.
        assert!(!with(0.03, 19, 0.063));
        assert!(with(0.03, 19, 0.12));
        assert!(with(-0.03, 19, 0.04 + TURNED));
        // Half of the flights may be turned: those that are not say what is usual.
        assert!(with(0.0, 10, 0.1));
        assert!(with(0.0, 6, -0.1));
    }
}
