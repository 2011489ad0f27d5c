//! Gravity and the Coriolis term in the accelerations: do they enter with the coefficient 1 that mechanics gives them?
//!
//! Two questions. Of the readings of attitude and velocity, which leaves the least force along the nose and to the side? A
//! rotor's thrust is along the body's z axis, so the two are small. And: with free coefficients on gravity and −ω × v, are they 1? Drag and trim
//! are fitted beside them; what else acts on the helicopter biases a coefficient by some per cent, a wrong convention by 1 or more.

use super::finding::{Finding, Severity, Subject, unjudged};
use super::increments::{Instant, Motion, Vector, length_s};
use super::regression::{BlockRegression, Estimate};
use crate::blocks::{BlockMean, BlockSum, FEW_BLOCKS};
use crate::flight::GRAVITY_M_S2;
use crate::flight::attitude::{cross, gravity_body, rotate_back};

/// A coefficient of which 95 % certainly lies nearer to another convention's value (0, 2, −1) than to 1.
const FAULT_MARGIN: f64 = 0.5;
/// The same along z, where thrust acts: its own errors (stall, droop, inflow) take half of a coefficient away.
const FAULT_MARGIN_THRUST: f64 = 0.8;
/// Beyond what unmodelled forces usually do to it.
const WARNING_MARGIN: f64 = 0.2;
/// A reading has to leave at most this share of the lateral force of the nominal one.
const CONVINCING_SHARE: f64 = 0.5;

const AXES: [&str; 3] = ["x", "y", "z"];

/// A reading of attitude and velocity.
struct Reading {
    says: &'static str,
    set: &'static str,
    velocity: fn(&Instant) -> Vector,
    gravity: fn(&Instant) -> Vector,
    /// Force by mass along x and y on velocity and a constant.
    lateral: [BlockRegression<2>; 2],
}

/// Accumulates both questions over flights.
pub(super) struct Forces {
    readings: Vec<Reading>,
    /// By axis: acceleration on gravity, −ω × v, v, u4, 1.
    free: [BlockRegression<5>; 3],
}

impl Forces {
    #[rustfmt::skip]
    /// `quaternion` is how to say the other order, where the attitude is one.
    pub fn new(quaternion: Option<&'static str>) -> Self {
        const V: fn(&Instant) -> Vector = |i| i.velocity;
        const G: fn(&Instant) -> Vector = |i| i.gravity;
        const DEGREE: f64 = std::f64::consts::PI / 180.0;
        let read = |says, set, velocity, gravity| Reading { says, set, velocity, gravity, lateral: [BlockRegression::new(), BlockRegression::new()] };
        let mut readings = vec![
            read("", "", V, G),
            read("the velocity is written in inertial axes", "velocity = \"inertial\"", |i| rotate_back(&i.rotation, i.velocity), G),
            read("roll has the other sign", "[columns] roll = \"-roll\", with the file's name", V, |i| gravity_body(-i.angles[0], i.angles[1])),
            read("pitch has the other sign", "[columns] pitch = \"-pitch\", with the file's name", V, |i| gravity_body(i.angles[0], -i.angles[1])),
            read("roll and pitch have the other sign: z points up (axes ENU/FLU, or NWU/FLU, which differ by the zero of the heading), or, if the rates do not fit either, the attitude is that of the inertial frame seen from the body",
                "axes = \"ENU/FLU\"",
                V, |i| gravity_body(-i.angles[0], -i.angles[1])),
            read("the angles are in degrees", "[units] angles = \"deg\"", V, |i| gravity_body(i.angles[0] * DEGREE, i.angles[1] * DEGREE)),
        ];
        let third: fn(&Instant) -> Vector = |i| i.reordered[2].map(|part| GRAVITY_M_S2 * part);
        readings.extend(quaternion.map(|set| read("the quaternion's scalar stands at its other end", set, V, third)));
        Self { readings, free: std::array::from_fn(|_| BlockRegression::new()) }
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        for (piece, block) in motion.pieces(0) {
            let length_s = length_s(motion, &piece);
            let (start, end) = (&motion.instants[piece.start], &motion.instants[piece.end]);
            for reading in &mut self.readings {
                let [vx, vy, _, fx, fy, _] = motion.integral(&piece, |sample| {
                    let instant = &motion.instants[sample];
                    let (velocity, gravity) = ((reading.velocity)(instant), (reading.gravity)(instant));
                    let turning = cross(instant.rates, velocity);
                    [velocity[0], velocity[1], velocity[2], turning[0] - gravity[0], turning[1] - gravity[1], 0.0]
                });
                let (first, last) = ((reading.velocity)(start), (reading.velocity)(end));
                let rows = [(vx, last[0] - first[0] + fx), (vy, last[1] - first[1] + fy)];
                for (regression, (velocity, force)) in reading.lateral.iter_mut().zip(rows) {
                    regression.add((flight, block), &[velocity / length_s, 1.0], force / length_s);
                }
            }
            let means = motion.integral(&piece, |sample| {
                let instant = &motion.instants[sample];
                let turning = cross(instant.velocity, instant.rates);
                let mut terms = [0.0; 13];
                terms[..3].copy_from_slice(&instant.gravity);
                terms[3..6].copy_from_slice(&turning);
                terms[6..9].copy_from_slice(&instant.velocity);
                terms[9] = instant.controls[3];
                terms[10..].copy_from_slice(&instant.linear_target);
                terms.map(|value| value / length_s)
            });
            for (axis, regression) in self.free.iter_mut().enumerate() {
                let row = [means[axis], means[3 + axis], means[6 + axis], means[9], 1.0];
                let derived = (end.velocity[axis] - start.velocity[axis]) / length_s;
                regression.add((flight, block), &row, if motion.recorded { means[10 + axis] } else { derived });
            }
        }
    }

    /// Adds the blocks of others, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        for (reading, others) in self.readings.iter_mut().zip(&other.readings) {
            reading.lateral.iter_mut().zip(&others.lateral).for_each(|(one, other)| one.absorb(other, together));
        }
        self.free.iter_mut().zip(&other.free).for_each(|(one, other)| one.absorb(other, together));
    }

    /// Which reading leaves the least lateral force.
    pub fn lateral(&self) -> Option<Finding> {
        let errors: Vec<Vec<f64>> = self
            .readings
            .iter()
            .map(|reading| {
                let [x, y] = [reading.lateral[0].errors()?, reading.lateral[1].errors()?];
                Some(x.iter().zip(&y).map(|(x, y)| x + y).collect())
            })
            .collect::<Option<_>>()?;
        let blocks = errors.first()?.len();
        let total = |index: usize| errors[index].iter().sum::<f64>();
        let pieces = self.readings.first()?.lateral[0].rows();
        let rms = |index: usize| (total(index) / pieces.max(1.0)).sqrt();
        let best = (1..errors.len()).min_by(|a, b| total(*a).total_cmp(&total(*b)))?;
        let ratios = errors[best].iter().zip(&errors[0]).filter(|(other, nominal)| **other > 0.0 && **nominal > 0.0);
        let ratios = ratios.map(|(other, nominal)| BlockSum { samples: 1.0, sum: (other / nominal).ln() });
        let interval = BlockMean::new(ratios).and_then(|mean| mean.interval());
        let mut finding = Finding {
            name: "lateral_force".into(),
            subject: Subject::Conventions,
            verdict: Severity::Ok,
            measured: Some(rms(0)),
            interval: None,
            expected: None,
            unit: "m/s²".into(),
            message: format!(
                "force along x and y is smallest as the log is read; next: {} ({:.2} m/s²)",
                self.readings[best].says,
                rms(best)
            ),
            set: None,
            flights: Vec::new(),
        };
        if blocks < FEW_BLOCKS {
            finding.verdict = Severity::Undetermined;
            finding.message = format!("fewer than {FEW_BLOCKS} blocks of 10 s");
        } else if total(best) < CONVINCING_SHARE * total(0) && interval.is_some_and(|[_, high]| high < 0.0) {
            finding.verdict = Severity::Fault;
            finding.message = format!(
                "force along x and y, which should be small, falls to {:.2} m/s² if {}",
                rms(best),
                self.readings[best].says
            );
            finding.set = Some(self.readings[best].set.into());
        } else if total(best) < total(0) && interval.is_some_and(|[_, high]| high < 0.0) {
            finding.verdict = Severity::Warning;
            finding.message =
                format!("force along x and y is a little smaller, {:.2} m/s², if {}", rms(best), self.readings[best].says);
        }
        Some(finding)
    }

    /// Free coefficients of gravity and of −ω × v.
    pub fn coefficients(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        for (axis, regression) in AXES.into_iter().zip(&self.free) {
            // In level flight gravity along z is a constant, and u4 may stand still: leave out what does not move.
            let estimates = if regression.blocks() < FEW_BLOCKS { None } else { regression.estimates() };
            for (index, term) in ["gravity", "coriolis"].into_iter().enumerate() {
                findings.push(coefficient(term, axis, estimates.map(|estimates| estimates[index])));
            }
        }
        findings
    }
}

fn coefficient(term: &str, axis: &str, estimate: Option<Estimate>) -> Finding {
    let mut finding = unjudged(&format!("{term}_{axis}"), estimate);
    let Some(Estimate { interval: [low, high], value }) = estimate else { return finding };
    let what = if term == "gravity" { "gravity in body axes" } else { "the Coriolis term -w x v" };
    let beyond = |margin: f64| low > 1.0 + margin || high < 1.0 - margin;
    if beyond(if axis == "z" { FAULT_MARGIN_THRUST } else { FAULT_MARGIN }) {
        finding.verdict = Severity::Fault;
        let contains = |number: f64| (value - number).abs() < FAULT_MARGIN;
        let (message, set) = match (term, contains(0.0), contains(-1.0)) {
            ("gravity", true, _) => (
                "gravity is not in the accelerations along this axis: they look like specific force",
                "targets = \"specific_force\"; if accelerations are derived, look at the attitude",
            ),
            ("gravity", _, true) => (
                "gravity enters with the other sign: roll or pitch has the other sign, the attitude is transposed, or z points up",
                "axes = \"NWU/FLU\" if z points up; [columns] roll = \"-roll\" or pitch = \"-pitch\"",
            ),
            ("gravity", ..) => (
                "gravity enters with the wrong size: wrong units of angles or accelerations",
                "[units] angles, acceleration or velocity",
            ),
            (_, true, _) => (
                "the Coriolis term is not in the accelerations: they are those of the inertial velocity",
                "targets = \"body_acceleration\" or \"inertial\"; velocity = \"inertial\" if accelerations are derived",
            ),
            (_, _, true) => (
                "the Coriolis term enters with the other sign: look at the signs of rates and velocity",
                "axes = \"NWU/FLU\", or [columns] wx = \"-wx\" and so on",
            ),
            _ => ("the Coriolis term enters with the wrong size: wrong units of rates", "[units] rates"),
        };
        finding.message = message.into();
        finding.set = Some(set.into());
    } else if high - low > 4.0 * FAULT_MARGIN || (low <= 0.0 && high >= 1.0) {
        finding.message = format!("these flights do not tell how {what} enters");
    } else if beyond(WARNING_MARGIN) {
        finding.verdict = Severity::Warning;
        finding.message = format!(
            "{what} enters with a coefficient off 1; forces not modelled here, a tilted sensor or a wrong time step can do that"
        );
    } else {
        finding.verdict = Severity::Ok;
        finding.message = match low <= 1.0 && high >= 1.0 {
            true => format!("{what} enters as it should"),
            false => format!("{what} enters about as it should: what is not modelled yet takes part"),
        };
    }
    finding
}
