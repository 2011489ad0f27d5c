//! Single columns in the kinematic relations: how many metres, radians, metres a second a column of rates gives for one of its state's, and by which
//! constant it is off. Each gain is 1 and each offset 0 unless a column has another sign or another unit; all gains are another if the time step is wrong.
//! Of the heading the angle is asked by which it is turned. This is what flight test calls data compatibility (Klein & Morelli 2006, ch. 10), one
//! linear regression a relation. Other readings of whole relations are in `relations`.

use super::finding::{Finding, Severity, finding, unjudged};
use super::increments::{Motion, Vector, length_s};
use super::regression::{BlockRegression, Estimate};
use super::told::plus;
use super::unexplained::{self, Fit, Left};
use crate::blocks::FEW_BLOCKS;
use crate::flight::attitude::{cross, rotate};

/// Certainly nearer to another convention than to 1 …
const FAULT_MARGIN: f64 = 0.5;
/// … or to that of a unit than to 1: knots are nearly half a metre a second.
const UNIT_MARGIN: f64 = 0.4;
/// Ten per cent is more than smoothing and noise do to a gain, and less than a wrong time step.
const WARNING_MARGIN: f64 = 0.1;

/// An offset from here on is no drift of a sensor: of velocities, m/s, and of rates, rad/s (6°/s, what a small gyroscope is allowed before it is
/// calibrated). Half of it is worth a warning.
pub(super) const OFFSETS: [f64; 2] = [1.0, 0.1];
/// A heading that is turned by so much, rad, is no matter of declination.
const TURNED: f64 = 0.17;
/// Where the nose turns faster, rad/s, a heading that comes late looks turned.
const SLOW: f64 = 0.5;

/// Angles whose gains are less than this hardly move with the rates.
const FLAT: f64 = 0.3;

/// How a message begins of a gain that no unit explains.
pub(super) const FAR: &str = "the gain of this axis is far from 1";
/// Gains of three axes that agree to this share are one scale.
pub(super) const ONE_SCALE: f64 = 0.03;

/// How findings on offsets begin, and the name of that on the heading.
pub(super) const OFFSET: &str = "offset_";
pub(super) const HEADING: &str = "heading";

/// As they end the names of gains.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Accumulates the gains over flights.
pub(super) struct Gains {
    /// Of the velocities along the nose, to the right and down, and their offsets: all three together move a position.
    position: BlockRegression<6>,
    /// Way gone over the ground on that way and on the one to its right.
    heading: BlockRegression<2>,
    /// Of the three rates and their offsets, since turning one axis moves the two others.
    attitude: BlockRegression<6>,
    linear: [BlockRegression<1>; 3],
    angular: [BlockRegression<1>; 3],
}

fn single() -> [BlockRegression<1>; 3] {
    std::array::from_fn(|_| BlockRegression::new())
}

impl Gains {
    pub fn new() -> Self {
        Self {
            position: BlockRegression::new(),
            heading: BlockRegression::new(),
            attitude: BlockRegression::new(),
            linear: single(),
            angular: single(),
        }
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        for (piece, number) in motion.pieces(0) {
            let block = (flight, number);
            let (start, end) = (&motion.instants[piece.start], &motion.instants[piece.end]);
            if motion.position && motion.heading {
                self.add_position(block, motion, &piece);
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
                let by = |rates: Vector, axis: Vector| {
                    let [p, q, r] =
                        [[rates[0], 0.0, 0.0], [0.0, rates[1], 0.0], [0.0, 0.0, rates[2]]].map(|rate| cross(axis, rate));
                    [p[0], q[0], r[0], p[1], q[1], r[1], p[2], q[2], r[2]]
                };
                let turned = motion.integral(&piece, |k| by(motion.instants[k].rates, motion.instants[k].rotation[row]));
                let offset = motion.integral(&piece, |k| by([1.0; 3], motion.instants[k].rotation[row]));
                for axis in 0..3 {
                    let change = end.rotation[row][axis] - start.rotation[row][axis];
                    let columns: [f64; 6] =
                        std::array::from_fn(|at| if at < 3 { turned[3 * axis + at] } else { offset[3 * axis + at - 3] });
                    self.attitude.add(block, &columns, change);
                }
            }
        }
    }

    fn add_position(&mut self, block: (usize, usize), motion: &Motion, piece: &std::ops::Range<usize>) {
        let at = |k: usize| &motion.instants[k];
        let gone: Vector = std::array::from_fn(|axis| at(piece.end).position[axis] - at(piece.start).position[axis]);
        for (row, gone) in gone.into_iter().enumerate() {
            let columns = motion.integral(piece, |k| {
                let direction = at(k).rotation[row];
                let moved: Vector = std::array::from_fn(|axis| direction[axis] * at(k).velocity[axis]);
                [moved[0], moved[1], moved[2], direction[0], direction[1], direction[2]]
            });
            self.position.add(block, &columns, gone);
        }
        let [turned] = motion.integral(piece, |k| [at(k).rates[2]]);
        if turned.abs() < SLOW * length_s(motion, piece) {
            let [north, east, _] = motion.integral(piece, |k| rotate(&at(k).rotation, at(k).velocity));
            self.heading.add(block, &[north, -east], gone[0]);
            self.heading.add(block, &[east, north], gone[1]);
        }
    }

    /// Adds the blocks of others, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        self.position.absorb(&other.position, together);
        self.heading.absorb(&other.heading, together);
        self.attitude.absorb(&other.attitude, together);
        for axis in 0..3 {
            self.linear[axis].absorb(&other.linear[axis], together);
            self.angular[axis].absorb(&other.angular[axis], together);
        }
    }

    /// Share of the changes of a relation's state that its columns leave unexplained, each with its own gain; of the position also a heading that is turned.
    pub fn left(&self, relation: &str) -> f64 {
        let of = |explained: Option<f64>| explained.map_or(f64::INFINITY, |share| 1.0 - share);
        let three = |regressions: &[BlockRegression<1>; 3]| {
            let whole: f64 = regressions.iter().map(BlockRegression::square).sum();
            let errors = regressions.iter().map(|one| Some(one.errors()?.iter().sum::<f64>())).sum::<Option<f64>>();
            errors.map_or(f64::INFINITY, |errors| errors / whole)
        };
        match relation {
            "position_rate" => of(self.position.explained()).min(of(self.heading.explained())),
            "velocity_targets" => three(&self.linear),
            "rate_targets" => three(&self.angular),
            _ => of(self.attitude.explained()),
        }
    }

    /// What each relation leaves unexplained.
    pub fn unexplained(&self) -> Vec<Left> {
        type Names = [[&'static str; 3]; 3];
        const LINEAR: Names = [["vx", "vx_dot", "vx_dot says"], ["vy", "vy_dot", "vy_dot says"], ["vz", "vz_dot", "vz_dot says"]];
        const ANGULAR: Names = [["wx", "wx_dot", "wx_dot says"], ["wy", "wy_dot", "wy_dot says"], ["wz", "wz_dot", "wz_dot says"]];
        let position = unexplained::POSITION;
        let attitude = Fit::Mechanics { name: "attitude", changes: "the attitude (roll, pitch, yaw)", says: "the rates say" };
        let three = |names: Names, all: &[BlockRegression<1>; 3]| {
            let of = |(names, one): ([&'static str; 3], &BlockRegression<1>)| {
                let [changes, name, says] = names;
                Left::of(Fit::Mechanics { name, changes, says }, one)
            };
            names.into_iter().zip(all).filter_map(of).collect::<Vec<_>>()
        };
        let mut left: Vec<Left> = Left::of(position, &self.position).into_iter().collect();
        left.extend(Left::of(attitude, &self.attitude));
        left.extend(three(LINEAR, &self.linear));
        left.extend(three(ANGULAR, &self.angular));
        left
    }

    /// Findings of the relation of this name, see [`super::relations`]; of no column of which less is explained.
    pub fn findings(&self, relation: &str, least_explained: f64) -> Vec<Finding> {
        let three = |regressions: &[BlockRegression<1>; 3]| {
            let estimate = |regression: &BlockRegression<1>| {
                enough(regression, least_explained).map(|[estimate]| reversed(estimate, regression.explained()))
            };
            (regressions[0].blocks() > 0).then(|| regressions.each_ref().map(estimate))
        };
        let six = |regression: &BlockRegression<6>| {
            let estimates = enough(regression, least_explained);
            let gain = |axis: usize| Some(reversed(estimates?[axis], regression.explained()));
            (regression.blocks() > 0).then(|| [gain(0), gain(1), gain(2)])
        };
        let (estimates, columns, units) = match relation {
            "position_rate" => {
                let turned = self.turned().filter(|turned| turned.verdict == Severity::Fault);
                if let Some(turned) = turned.filter(|_| self.heading.explained() > self.position.explained()) {
                    return vec![turned];
                }
                (six(&self.position), ["vx", "vy", "vz"], "position or velocity")
            }
            "velocity_targets" => (three(&self.linear), ["vx_dot", "vy_dot", "vz_dot"], "acceleration or velocity"),
            "rate_targets" => (three(&self.angular), ["wx_dot", "wy_dot", "wz_dot"], "angular_acceleration or rates"),
            _ => (six(&self.attitude), ["wx", "wy", "wz"], "rates or angles"),
        };
        let gains = estimates.into_iter().flatten().zip(AXES).zip(columns);
        let mut findings: Vec<Finding> =
            gains.map(|((estimate, axis), column)| gain(relation, axis, column, units, estimate)).collect();
        alone(&mut findings, columns);
        // Rates and what was made of them have one scale; what stands beside them has another unit.
        if ["attitude_rate", "rate_targets"].contains(&relation) {
            alike(&mut findings, columns);
        }
        if relation == "attitude_rate" {
            without_gyros(&mut findings);
        }
        let offsets = match relation {
            "position_rate" => enough(&self.position, least_explained).map(|all| (all, OFFSETS[0], "m/s")),
            "attitude_rate" => enough(&self.attitude, least_explained).map(|all| (all, OFFSETS[1], "rad/s")),
            _ => None,
        };
        if let Some((estimates, least, unit)) = offsets {
            findings.extend((0..3).map(|axis| offset(columns[axis], estimates[3 + axis], least, unit)));
        }
        // A single column that is read wrongly turns the way as well.
        findings.extend(self.turned().filter(|turned| relation == "position_rate" && turned.verdict != Severity::Fault));
        findings
    }

    /// The heading against the way that is gone. `None` where that is not known, or the length of the way is another too.
    fn turned(&self) -> Option<Finding> {
        let [along, aside] = enough(&self.heading, 0.0)?;
        let angle = aside.value.atan2(along.value);
        let size = along.value.hypot(aside.value);
        let half = 0.5 * (aside.interval[1] - aside.interval[0]).max(along.interval[1] - along.interval[0]) / size;
        let estimate = Estimate { value: angle, interval: [angle - half, angle + half] };
        let says = format!(
            "the heading is turned by {:.0}° to the {}: the position moves otherwise than nose and velocity say",
            angle.abs().to_degrees(),
            if angle < 0.0 { "right" } else { "left" }
        );
        let set = format!("[columns] yaw = \"yaw {}\", with the file's name", plus(angle, 4));
        ((size - 1.0).abs() < WARNING_MARGIN).then(|| constant(HEADING, estimate, TURNED, "rad", says, set))
    }
}

/// What is said of one column and not of all three names that column, and sets its unit alone.
fn alone(findings: &mut [Finding], columns: [&str; 3]) {
    let is_fault = |finding: &Finding| finding.verdict == Severity::Fault;
    let sets: Vec<Option<String>> =
        findings.iter().filter(|finding| is_fault(finding)).map(|finding| finding.set.clone()).collect();
    let told = findings.iter().filter(|finding| finding.verdict != Severity::Undetermined).count();
    if sets.len() == told && sets.windows(2).all(|pair| pair[0] == pair[1]) && told > 1 {
        return;
    }
    for (finding, column) in findings.iter_mut().zip(columns).filter(|(finding, _)| is_fault(finding)) {
        finding.message = format!("{column}: {}", finding.message);
        let unit = finding.set.as_ref().and_then(|set| set.strip_prefix("[units] ")?.split_once(" = "));
        if let Some((_, unit)) = unit {
            finding.set = Some(format!("[units] {column} = {unit}"));
        }
    }
}

/// Three gains that are the same, and far from 1, are a scale: a range or a sensitivity that was taken for another. It is that of the columns, since angles
/// that are scaled are none that turn.
fn alike(findings: &mut [Finding], columns: [&str; 3]) {
    let far = |finding: &Finding| finding.measured.filter(|_| finding.message.contains(FAR));
    let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|axis| findings.get(axis).and_then(far)) else { return };
    let mean = (x + y + z) / 3.0;
    if [x, y, z].iter().any(|value| (value / mean - 1.0).abs() > ONE_SCALE) {
        return;
    }
    for (finding, column) in findings.iter_mut().zip(columns) {
        finding.set = Some(format!("[columns] {column} = \"{mean:.4} * {column}\", with the file's name"));
    }
}

/// Angles of tilt that stay where they are while the aircraft turns are not those of an attitude.
fn without_gyros(findings: &mut [Finding]) {
    let value = |axis: usize| findings[axis].measured.filter(|_| findings[axis].verdict == Severity::Fault);
    let is_flat = |value: Option<f64>| value.is_some_and(|value| value.abs() < FLAT);
    if !(is_flat(value(0)) && is_flat(value(1))) {
        return;
    }
    for finding in &mut findings[..2] {
        finding.message = format!(
            "{}; roll and pitch hardly follow the rates: the tilt against apparent gravity, as accelerometers alone show it, is no attitude",
            finding.message
        );
    }
}

/// A constant that a column has too much against the change of its state.
fn offset(column: &str, estimate: Estimate, least: f64, unit: &str) -> Finding {
    // What is regressed lacks it: the column less its offset is the rate.
    let (value, [low, high]) = (-estimate.value, [-estimate.interval[1], -estimate.interval[0]]);
    let says = format!("{column} has an offset of {value:.2} {unit} against the change of its state");
    let set = format!("[columns] {column} = \"{column} {}\", with the file's name", plus(-value, 4));
    constant(&format!("{OFFSET}{column}"), Estimate { value, interval: [low, high] }, least, unit, says, set)
}

/// A finding on what should be 0, and is at fault from `least` on.
fn constant(name: &str, estimate: Estimate, least: f64, unit: &str, says: String, set: String) -> Finding {
    let Estimate { value, interval: [low, high] } = estimate;
    let (verdict, message, set) = match () {
        () if low > least || high < -least => (Severity::Fault, says, Some(set)),
        () if low > 0.5 * least || high < -0.5 * least => (Severity::Warning, says, Some(set)),
        () if high - low > 2.0 * least => (Severity::Undetermined, "these flights move too little to say".into(), None),
        () => (Severity::Ok, "none that is more than a sensor's drift".into(), None),
    };
    Finding {
        measured: Some(value),
        interval: Some([low, high]),
        expected: Some(0.0),
        unit: unit.into(),
        ..finding(name, verdict, message, set.as_deref())
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
    let mut finding = unjudged(&format!("{relation}_{axis}"), estimate);
    let Some(Estimate { interval: [low, high], value }) = estimate else { return finding };
    let beyond = |margin: f64| low > 1.0 + margin || high < 1.0 - margin;
    let off = |gain: f64| (value / gain).ln().abs();
    let known = of_units(relation).iter().filter(|unit| value > 0.0 && off(unit.0) < WARNING_MARGIN);
    let known = known.min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    if beyond(FAULT_MARGIN) || (beyond(UNIT_MARGIN) && known.is_some()) {
        finding.verdict = Severity::Fault;
        finding.message = match known {
            _ if (value + 1.0).abs() < WARNING_MARGIN => "the gain of this axis is that of the other sign".into(),
            Some((_, says, _)) => format!("the gain of this axis is that of {says}"),
            None => format!("{FAR}: what {column} says, times {value:.2}, is what happens"),
        };
        finding.set = Some(match known {
            _ if value < 0.0 => format!("[columns] {column} = \"-{column}\", with the file's name"),
            Some((_, _, unit)) => format!("[units] {unit}"),
            None => format!("[units] {units}; or the columns of this axis are others"),
        });
    } else if high - low > 4.0 * FAULT_MARGIN || (low <= 0.0 && high >= 1.0) {
        finding.message = "these flights move too little about this axis to say".into();
    } else if beyond(WARNING_MARGIN) {
        finding.verdict = Severity::Warning;
        finding.message = "off 1: a wrong time step, a filter on one of the streams, or noise".into();
    } else {
        finding.verdict = Severity::Ok;
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
    (3.6, "velocity in km/h", "velocity = \"km/h\""),
    (3.6 / 1.852, "velocity in knots", "velocity = \"kt\""),
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
