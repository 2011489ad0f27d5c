//! Gains of single axes in the kinematic relations: how many metres, radians, metres a second the log's rates give for one of
//! its states'. Each is 1 unless an axis has another sign, another unit, or the time step is wrong.

use super::increments::Motion;
use super::regression::{BlockRegression, Estimate};
use super::report::{Finding, Subject, Verdict};
use crate::blocks::FEW_BLOCKS;
use crate::flight::attitude::{cross, rotate};

/// Certainly nearer to another convention than to 1.
const FAULT_MARGIN: f64 = 0.5;
/// Ten per cent is more than smoothing and noise do to a gain, and less than a wrong time step.
const WARNING_MARGIN: f64 = 0.1;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Accumulates the gains over flights.
pub(super) struct Gains {
    position: [BlockRegression<1>; 3],
    /// On the three rates together, since turning one axis moves the two others.
    attitude: BlockRegression<3>,
    linear: [BlockRegression<1>; 3],
    angular: [BlockRegression<1>; 3],
}

fn single() -> [BlockRegression<1>; 3] {
    std::array::from_fn(|_| BlockRegression::new())
}

impl Gains {
    pub fn new() -> Self {
        Self { position: single(), attitude: BlockRegression::new(), linear: single(), angular: single() }
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        for (piece, number) in motion.pieces(0) {
            let block = (flight, number);
            let (start, end) = (&motion.instants[piece.start], &motion.instants[piece.end]);
            if motion.position && motion.heading {
                let travel = motion.integral(&piece, |k| rotate(&motion.instants[k].rotation, motion.instants[k].velocity));
                for (axis, regression) in self.position.iter_mut().enumerate() {
                    regression.add(block, &[travel[axis]], end.position[axis] - start.position[axis]);
                }
            }
            if motion.recorded {
                let (linear, angular) = (
                    motion.integral(&piece, |k| motion.instants[k].linear_target),
                    motion.integral(&piece, |k| motion.instants[k].angular_target),
                );
                for axis in 0..3 {
                    self.linear[axis].add(block, &[linear[axis]], end.velocity[axis] - start.velocity[axis]);
                    self.angular[axis].add(block, &[angular[axis]], end.rates[axis] - start.rates[axis]);
                }
            }
            // Without heading only the vertical axis is known.
            for row in if motion.heading { 0..3 } else { 2..3 } {
                let turned = motion.integral(&piece, |k| {
                    let Motion { instants, .. } = motion;
                    let (axis, rates) = (instants[k].rotation[row], instants[k].rates);
                    let by = [[rates[0], 0.0, 0.0], [0.0, rates[1], 0.0], [0.0, 0.0, rates[2]]].map(|rate| cross(axis, rate));
                    [by[0][0], by[1][0], by[2][0], by[0][1], by[1][1], by[2][1], by[0][2], by[1][2], by[2][2]]
                });
                for axis in 0..3 {
                    let change = end.rotation[row][axis] - start.rotation[row][axis];
                    self.attitude.add(block, &[turned[3 * axis], turned[3 * axis + 1], turned[3 * axis + 2]], change);
                }
            }
        }
    }

    /// Adds the blocks of others, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        for axis in 0..3 {
            self.position[axis].absorb(&other.position[axis], together);
            self.linear[axis].absorb(&other.linear[axis], together);
            self.angular[axis].absorb(&other.angular[axis], together);
        }
        self.attitude.absorb(&other.attitude, together);
    }

    /// Findings of the relation of this name, see [`super::relations`]; of no axis of which less is explained.
    pub fn findings(&self, relation: &str, least_explained: f64) -> Vec<Finding> {
        let three = |regressions: &[BlockRegression<1>; 3]| {
            let estimate = |regression: &BlockRegression<1>| {
                enough(regression, least_explained).map(|[estimate]| reversed(estimate, regression.explained()))
            };
            let estimates = regressions.each_ref().map(estimate);
            (regressions[0].blocks() > 0).then_some(estimates)
        };
        let (estimates, columns, units) = match relation {
            "position_rate" => (three(&self.position), ["x", "y", "z"], "position or velocity"),
            "velocity_targets" => (three(&self.linear), ["vx_dot", "vy_dot", "vz_dot"], "acceleration or velocity"),
            "rate_targets" => (three(&self.angular), ["wx_dot", "wy_dot", "wz_dot"], "angular_acceleration or rates"),
            _ => {
                let estimates = enough(&self.attitude, least_explained);
                let of = |axis: usize| estimates.map(|estimates| estimates[axis]);
                ((self.attitude.blocks() > 0).then(|| [of(0), of(1), of(2)]), ["wx", "wy", "wz"], "rates or angles")
            }
        };
        let findings = estimates.into_iter().flatten().zip(AXES).zip(columns);
        findings.map(|((estimate, axis), column)| gain(relation, axis, column, units, estimate)).collect()
    }
}

fn enough<const K: usize>(regression: &BlockRegression<K>, least_explained: f64) -> Option<[Estimate; K]> {
    let is_enough = regression.blocks() >= FEW_BLOCKS;
    let explains = || least_explained == 0.0 || regression.explained().is_some_and(|share| share >= least_explained);
    if is_enough && explains() { regression.estimates() } else { None }
}

/// The interval of a gain, as far as the regression of the rate on the change reaches: noise in the rate makes the gain too small, noise in the change
/// the other one, and the true one lies between the two (Frisch 1934).
fn reversed(estimate: Estimate, explained: Option<f64>) -> Estimate {
    let Estimate { value, interval: [low, high] } = estimate;
    let other = explained.filter(|share| *share > 0.0).map_or(value, |share| value / share);
    Estimate { value, interval: [low.min(other), high.max(other)] }
}

fn gain(relation: &str, axis: &str, column: &str, units: &str, estimate: Option<Estimate>) -> Finding {
    let mut finding = Finding {
        name: format!("{relation}_{axis}"),
        subject: Subject::Conventions,
        verdict: Verdict::Undetermined,
        measured: estimate.map(|estimate| estimate.value),
        interval: estimate.map(|estimate| estimate.interval),
        expected: Some(1.0),
        unit: "1".into(),
        message: "not determined by these flights".into(),
        set: None,
        flights: Vec::new(),
    };
    let Some(Estimate { interval: [low, high], value }) = estimate else { return finding };
    let beyond = |margin: f64| low > 1.0 + margin || high < 1.0 - margin;
    if beyond(FAULT_MARGIN) {
        finding.verdict = Verdict::Fault;
        let off = |gain: f64| (value / gain).ln().abs();
        let known = of_units(relation).iter().filter(|unit| value > 0.0 && off(unit.0) < WARNING_MARGIN);
        let known = known.min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
        finding.message = match known {
            _ if (value + 1.0).abs() < WARNING_MARGIN => "the gain of this axis is that of the other sign".into(),
            Some((_, says, _)) => format!("the gain of this axis is that of {says}"),
            None => "the gain of this axis is far from 1".into(),
        };
        finding.set = Some(match known {
            _ if value < 0.0 => format!("[columns] {column} = \"-{column}\", with the file's name"),
            Some((_, _, unit)) => format!("[units] {unit}"),
            None => format!("[units] {units}; or the columns of this axis are others"),
        });
    } else if high - low > 4.0 * FAULT_MARGIN || (low <= 0.0 && high >= 1.0) {
        finding.message = "these flights move too little about this axis to say".into();
    } else if beyond(WARNING_MARGIN) {
        finding.verdict = Verdict::Warning;
        finding.message = "off 1: a wrong time step, a filter on one of the streams, or noise".into();
    } else {
        finding.verdict = Verdict::Ok;
        finding.message = "as it should be".into();
    }
    finding
}

/// Gains that a wrong unit gives: the gain, the mistake, and what mends it under `[units]`.
type Units = [(f64, &'static str, &'static str)];

const FOOT_M: f64 = 0.3048;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

const POSITION: &Units = &[
    (FOOT_M, "velocity in feet a second", "velocity = \"ft/s\""),
    (1.0 / 3.6, "velocity in km/h", "velocity = \"km/h\""),
    (1.852 / 3.6, "velocity in knots", "velocity = \"kt\""),
    (1e-2, "velocity in cm/s", "velocity = \"cm/s\""),
    (1e-3, "velocity in mm/s", "velocity = \"mm/s\""),
    (1.0 / FOOT_M, "position in feet", "position = \"ft\""),
    (1e2, "position in cm", "position = \"cm\""),
    (1e3, "position in mm", "position = \"mm\""),
];
const ATTITUDE: &Units =
    &[(DEGREE, "rates in degrees a second", "rates = \"deg/s\""), (1.0 / DEGREE, "angles in degrees", "angles = \"deg\"")];
const LINEAR: &Units = &[
    (crate::flight::GRAVITY_M_S2, "accelerations in units of g", "acceleration = \"g\""),
    (crate::flight::GRAVITY_M_S2 * 1e-3, "accelerations in thousandths of g", "acceleration = \"mg\""),
    (FOOT_M, "accelerations in ft/s²", "acceleration = \"ft/s^2\""),
    (1e-2, "accelerations in cm/s²", "acceleration = \"cm/s^2\""),
    (1e-3, "accelerations in mm/s²", "acceleration = \"mm/s^2\""),
    (1.0 / FOOT_M, "velocity in feet a second", "velocity = \"ft/s\""),
    (1e2, "velocity in cm/s", "velocity = \"cm/s\""),
    (1e3, "velocity in mm/s", "velocity = \"mm/s\""),
];
const ANGULAR: &Units = &[
    (DEGREE, "angular accelerations in degrees", "angular_acceleration = \"deg/s^2\""),
    (1.0 / DEGREE, "rates in degrees a second", "rates = \"deg/s\""),
];

fn of_units(relation: &str) -> &'static Units {
    match relation {
        "position_rate" => POSITION,
        "velocity_targets" => LINEAR,
        "rate_targets" => ANGULAR,
        _ => ATTITUDE,
    }
}
