//! Kinematic relations between the streams of a log, each with the ways in which logs are known to break them.
//!
//! A relation is ṡ = f under the conventions of this program. A hypothesis is another reading of the same log, with its own s
//! and f. If another reading leaves less than half of the error, consistently over blocks, the log is in that other reading: no
//! aerodynamics enters, so nothing but a convention can do that. Gains of single axes are in `gains`.

use super::finding::{Finding, Severity, Subject};
use super::increments::{Instant, Motion, Vector};
use super::sequences::{XYZ, XZY, YXZ, YZX, ZXY};
use crate::blocks::{BlockMean, BlockSum, FEW_BLOCKS};
use crate::flight::GRAVITY_M_S2;
use crate::flight::attitude::{
    Matrix3, QuaternionOrder, body_rates, cross, dot, euler_to_quaternion, quaternion_to_rotation, rotate, rotate_back,
    rotation_body_to_inertial,
};
use std::ops::Range;

/// Three vectors, for relations of one vector with the rest zero.
type Stack = [f64; 9];

/// One reading of the log: the state s and its rate f at a sample.
#[derive(Clone, Copy)]
pub(super) struct Hypothesis {
    /// What the log would be, as a clause.
    says: &'static str,
    /// What would make the program read it so.
    set: &'static str,
    state: fn(&Instant) -> Stack,
    rate: fn(&Instant) -> Stack,
}

/// A relation and its readings, the nominal one first.
pub(super) struct Relation {
    pub name: &'static str,
    /// The relation as a formula, for messages.
    formula: &'static str,
    pub applies: fn(&Motion) -> bool,
    hypotheses: Vec<Hypothesis>,
    /// Error and size of the measured change by hypothesis, one entry a block.
    misfit: Vec<Vec<(f64, f64)>>,
    /// The way without its direction: what of it was measured and what the rate says.
    way: Option<Way>,
    /// Error and size of the way, in all flights in which the nominal reading does not hold.
    of_way: (f64, f64),
}

/// Of a piece, how far the state moved and how far its rate says, both without a direction; and what to say where only these agree.
#[derive(Clone, Copy)]
struct Way {
    says: &'static str,
    measured: fn(&Instant, &Instant) -> f64,
    rate: fn(&Instant) -> f64,
}

/// Share of the nominal error that another reading may leave at most to be taken for true.
const CONVINCING_SHARE: f64 = 0.5;
/// Share of the change that the nominal reading has to leave unexplained before another is considered at all.
const MATERIAL_SHARE: f64 = 0.02;
/// A flight in which it leaves less than this holds it, and is not asked for other readings.
const HOLDS: f64 = 0.25 * MATERIAL_SHARE;
/// A reading that leaves more than this of the changes unexplained is none.
const LARGEST_SHARE: f64 = 0.25;
/// A part of a flight that is read otherwise, and the rest of it, are of so many short blocks at least.
const FEWEST_BLOCKS: usize = 3;
/// The ways agree where this share of their squares is left.
const SAME_WAY: f64 = 0.02;
/// Unexplained share above which a relation is worth a warning though no other reading does better.
const POOR_SHARE: f64 = 0.5;

/// So many pieces of a flight tell readings from each other; of a longer one every other, every third … is taken.
const ENOUGH: usize = 600;

/// A reading is the cause where it leaves at most so many times what columns with gains of their own leave …
const OF_COLUMNS: f64 = 2.0;
/// … and this share of the changes.
const SLACK: f64 = 0.005;

/// How readings end in which all rates have the other sign.
const REVERSED: &str = "s have the other sign";

const TRANSPOSED: &str =
    "[columns] q1 = \"-q1\", q2 = \"-q2\", q3 = \"-q3\" (the quaternion goes from inertial to body axes), with the file's names";
const REORDERED: &str = "the quaternion's scalar stands at its other end";
const MADE_OF_WXYZ: &str = "the attitude was made of a quaternion w, x, y, z that was read as x, y, z, w";
const MADE_OF_XYZW: &str = "the attitude was made of a quaternion x, y, z, w that was read as w, x, y, z";
const FROM_QUATERNION: &str =
    "roll, pitch and yaw anew from the quaternion, or its columns in their place, with `quaternion` in the right order";

pub(super) const OTHER_DIRECTION: &str =
    "the velocity is as fast as the position moves, and points elsewhere: it was turned by wrong angles, or the attitude is wrong";
pub(super) const OTHER_AXES: &str = "the attitude turns as fast as the rates say, and about other axes: angles or rates are written in axes or in an order that are not \
                          known here";
const ROLL_SIGN: &str = "[columns] roll = \"-roll\", with the file's name";
const PITCH_SIGN: &str = "[columns] pitch = \"-pitch\", with the file's name";
const ANGLES_DEGREES: &str = "[units] angles = \"deg\"";
const YAW_DEGREES: &str = "[columns] yaw = \"yaw * 0.017453292519943295\", with the file's name";

const EXCHANGED: &str = "roll and pitch are exchanged";
const ROLL_PITCH: &str = "[columns] roll = \"pitch\", pitch = \"roll\", with the file's names";

const WITH_ANGULAR: &str = "linear and angular accelerations are in each other's columns (exchanged)";
const ANGULAR_BACK: &str = "[columns] vx_dot = \"wx_dot\", vy_dot = \"wy_dot\", vz_dot = \"wz_dot\", wx_dot = \"vx_dot\", wy_dot = \"vy_dot\", wz_dot = \"vz_dot\", with the file's names";
const AS_LEVEL: &str =
    "gravity was taken off the accelerations as though the aircraft were level: what its tilt does is left in them";
const TILTED: &str = "[columns] vx_dot = \"vx_dot - 9.80665 * sin(pitch)\", vy_dot = \"vy_dot + 9.80665 * sin(roll) * cos(pitch)\", vz_dot = \"vz_dot + 9.80665 * (cos(roll) * cos(pitch) - 1)\", with the file's names";

const LEVEL: &str = "the velocity is written in level axes, which turn with the heading alone and neither roll nor pitch";
const UNLEVEL: &str = "[columns] vx, vy, vz in body axes: turn them by pitch, then by roll";
const OF_ANGLES: &str = "the rates are those of the angles roll, pitch and yaw (Euler rates), not about the axes of the body";
const TO_BODY: &str = "[columns] wx = \"wx - wz * sin(pitch)\", wy = \"wy * cos(roll) + wz * sin(roll) * cos(pitch)\", wz = \"wz * cos(roll) * cos(pitch) - wy * sin(roll)\", with the file's names";

const ENDS_EXCHANGED: &str = "roll and yaw are exchanged: yaw, pitch, roll in the place of roll, pitch, yaw";
const YAW_ROLL: &str = "[columns] roll = \"yaw\", yaw = \"roll\", with the file's names";
const OF_QUATERNION: &str = "the angles are x, y and z of a quaternion";
const TO_ANGLES: &str = "[columns] roll = \"atan2(2 * (sqrt(max(0, 1 - roll^2 - pitch^2 - yaw^2)) * roll + pitch * yaw), 1 - 2 * (roll^2 + pitch^2))\", pitch = \"atan2(2 * (sqrt(max(0, 1 - roll^2 - pitch^2 - yaw^2)) * pitch - yaw * roll), sqrt(max(0, 1 - (2 * (sqrt(max(0, 1 - roll^2 - pitch^2 - yaw^2)) * pitch - yaw * roll))^2)))\", yaw = \"atan2(2 * (sqrt(max(0, 1 - roll^2 - pitch^2 - yaw^2)) * yaw + roll * pitch), 1 - 2 * (pitch^2 + yaw^2))\", with the file's names";

/// Two columns of a vector in each other's place.
const fn first_two([x, y, z]: Vector) -> Vector {
    [y, x, z]
}

const fn last_two([x, y, z]: Vector) -> Vector {
    [x, z, y]
}

const fn outer_two([x, y, z]: Vector) -> Vector {
    [z, y, x]
}

fn stack(first: Vector) -> Stack {
    let mut stack = [0.0; 9];
    stack[..3].copy_from_slice(&first);
    stack
}

fn flat(rows: &Matrix3) -> Stack {
    let mut stack = [0.0; 9];
    stack.iter_mut().zip(rows.iter().flatten()).for_each(|(out, value)| *out = *value);
    stack
}

fn transposed(matrix: &Matrix3) -> Matrix3 {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]))
}

fn turned(angles: Vector) -> Matrix3 {
    rotation_body_to_inertial(angles[0], angles[1], angles[2])
}

/// R_b^in of angles that were made of a quaternion in this order, read in the other one.
fn reread(angles: Vector, order: QuaternionOrder) -> Matrix3 {
    let parts = order.other().written(euler_to_quaternion(angles[0], angles[1], angles[2]));
    quaternion_to_rotation(order.scalar_last(parts))
}

fn of_wxyz(instant: &Instant) -> Matrix3 {
    reread(instant.angles, QuaternionOrder::ScalarFirst)
}

fn of_xyzw(instant: &Instant) -> Matrix3 {
    reread(instant.angles, QuaternionOrder::ScalarLast)
}

/// R_b^in of a quaternion with scalar w ≥ 0 of which these are x, y, z.
fn of_vector_part([x, y, z]: Vector) -> Matrix3 {
    let w = (1.0 - dot([x, y, z], [x, y, z])).max(0.0).sqrt();
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

fn length(vector: Vector) -> f64 {
    dot(vector, vector).sqrt()
}

/// The angle, rad, of the one turn from an attitude to another.
fn angle_between(one: &Instant, other: &Instant) -> f64 {
    let trace: f64 = one.rotation.iter().zip(&other.rotation).map(|(row, turned)| dot(*row, *turned)).sum();
    (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
}

fn scaled(vector: Vector, by: Vector) -> Vector {
    std::array::from_fn(|axis| vector[axis] * by[axis])
}

/// Port-up axes read as starboard-down ones, and back.
const FLIP: Vector = [1.0, -1.0, -1.0];
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// ṙ = r × ω for the rows r of R: inertial axes seen from the turning body.
fn turning(rotation: &Matrix3, rates: Vector) -> Stack {
    flat(&rotation.map(|row| cross(row, rates)))
}

/// The three inertial axes in body components.
fn axes(rotation: &Matrix3) -> Stack {
    flat(rotation)
}

impl Relation {
    fn new(name: &'static str, formula: &'static str, applies: fn(&Motion) -> bool, hypotheses: Vec<Hypothesis>) -> Self {
        let misfit = hypotheses.iter().map(|_| Vec::new()).collect();
        Self { name, formula, applies, hypotheses, misfit, way: None, of_way: (0.0, 0.0) }
    }

    /// The same with a way.
    const fn along(mut self, way: Way) -> Self {
        self.way = Some(way);
        self
    }

    /// ṗ = R v.
    #[rustfmt::skip]
    pub fn position(quaternion: Option<&'static str>) -> Self {
        let at = |i: &Instant| stack(i.position);
        let read = |says, set, state, rate| Hypothesis { says, set, state, rate };
        // A log of angles does not say what they were made of.
        let order = match quaternion {
            Some(set) => vec![read(REORDERED, set, at, |i| stack(rotate(&i.reordered, i.velocity)))],
            None => vec![
                read(MADE_OF_WXYZ, FROM_QUATERNION, at, |i| stack(rotate(&of_wxyz(i), i.velocity))),
                read(MADE_OF_XYZW, FROM_QUATERNION, at, |i| stack(rotate(&of_xyzw(i), i.velocity))),
                read(ENDS_EXCHANGED, YAW_ROLL, at, |i| stack(rotate(&turned(outer_two(i.angles)), i.velocity))),
                read(OF_QUATERNION, TO_ANGLES, at, |i| stack(rotate(&of_vector_part(i.angles), i.velocity))),
            ],
        };
        Self::new("position_rate", "p' = R v", |motion| motion.position && motion.heading, [vec![
            read("", "", at, |i| stack(rotate(&i.rotation, i.velocity))),
            read("the velocity is written in inertial axes", "velocity = \"inertial\"", at, |i| stack(i.velocity)),
            read("the attitude is that of the inertial frame seen from the body (transposed)", TRANSPOSED, at, |i| stack(rotate_back(&i.rotation, i.velocity))),
            read("z is height (positive up)", "[columns] z = \"-z\", with the file's name", |i| stack(scaled(i.position, [1.0, 1.0, -1.0])), |i| stack(rotate(&i.rotation, i.velocity))),
            read("x is east and y is north", "[columns] x = \"y\", y = \"x\", with the file's names", |i| stack([i.position[1], i.position[0], i.position[2]]), |i| stack(rotate(&i.rotation, i.velocity))),
            read("position is east-north-up while the rest is not", "[columns] x = \"y\", y = \"x\", z = \"-z\", with the file's names", |i| stack([i.position[1], i.position[0], -i.position[2]]), |i| stack(rotate(&i.rotation, i.velocity))),
            read("the velocity is nose-port-up while the rest is not", "[columns] vy = \"-vy\", vz = \"-vz\", with the file's names", at, |i| stack(rotate(&i.rotation, scaled(i.velocity, FLIP)))),
            read("position is north-west-up while the rest is not", "[columns] y = \"-y\", z = \"-z\", with the file's names", |i| stack(scaled(i.position, FLIP)), |i| stack(rotate(&i.rotation, i.velocity))),
            read("roll has the other sign", ROLL_SIGN, at, |i| stack(rotate(&turned(scaled(i.angles, [-1.0, 1.0, 1.0])), i.velocity))),
            read("pitch has the other sign", PITCH_SIGN, at, |i| stack(rotate(&turned(scaled(i.angles, [1.0, -1.0, 1.0])), i.velocity))),
            read("yaw has the other sign", "[columns] yaw = \"-yaw\", with the file's name", at, |i| stack(rotate(&turned(scaled(i.angles, [1.0, 1.0, -1.0])), i.velocity))),
            read("the angles are in degrees", ANGLES_DEGREES, at, |i| stack(rotate(&turned(i.angles.map(|angle| angle * DEGREE)), i.velocity))),
            read("yaw is in degrees and roll and pitch are not", YAW_DEGREES, at, |i| stack(rotate(&turned(scaled(i.angles, [1.0, 1.0, DEGREE])), i.velocity))),
            read("vx and vy are exchanged", "[columns] vx = \"vy\", vy = \"vx\", with the file's names", at, |i| stack(rotate(&i.rotation, first_two(i.velocity)))),
            read("vy and vz are exchanged", "[columns] vy = \"vz\", vz = \"vy\", with the file's names", at, |i| stack(rotate(&i.rotation, last_two(i.velocity)))),
            read("vx and vz are exchanged", "[columns] vx = \"vz\", vz = \"vx\", with the file's names", at, |i| stack(rotate(&i.rotation, outer_two(i.velocity)))),
            read(EXCHANGED, ROLL_PITCH, at, |i| stack(rotate(&turned(first_two(i.angles)), i.velocity))),
            read(XYZ.says, XYZ.set, at, |i| stack(rotate(&XYZ.rotation(i.angles), i.velocity))),
            read(XZY.says, XZY.set, at, |i| stack(rotate(&XZY.rotation(i.angles), i.velocity))),
            read(YXZ.says, YXZ.set, at, |i| stack(rotate(&YXZ.rotation(i.angles), i.velocity))),
            read(YZX.says, YZX.set, at, |i| stack(rotate(&YZX.rotation(i.angles), i.velocity))),
            read(ZXY.says, ZXY.set, at, |i| stack(rotate(&ZXY.rotation(i.angles), i.velocity))),
            read(LEVEL, UNLEVEL, at, |i| stack(rotate(&turned(scaled(i.angles, [0.0, 0.0, 1.0])), i.velocity))),
        ], order].concat()).along(Way {
            says: OTHER_DIRECTION,
            measured: |start, end| length(std::array::from_fn(|axis| end.position[axis] - start.position[axis])),
            rate: |i| length(i.velocity),
        })
    }

    /// `quaternion` is how to say the other order, where the attitude is one.
    ///
    /// ṙ = r × ω for the inertial axes r in body components, or of them the vertical alone where there is no heading.
    #[rustfmt::skip]
    pub fn attitude(heading: bool, quaternion: Option<&'static str>) -> Self {
        let read = |says, set, state, rate| Hypothesis { says, set, state, rate };
        if !heading {
            const DOWN: fn(&Instant) -> Stack = |i| stack(i.rotation[2]);
            return Self::new("attitude_rate", "d(R'k)/dt = (R'k) x w", |motion| !motion.heading, vec![
                read("", "", DOWN, |i| stack(cross(i.rotation[2], i.rates))),
                read("the rates have the other sign", "[columns] wx = \"-wx\", wy = \"-wy\", wz = \"-wz\", with the file's names", DOWN, |i| stack(cross(i.rotation[2], scaled(i.rates, [-1.0; 3])))),
                read("the rates are nose-port-up while the attitude is not", "[columns] wy = \"-wy\", wz = \"-wz\", with the file's names", DOWN, |i| stack(cross(i.rotation[2], scaled(i.rates, FLIP)))),
                read("the roll rate has the other sign", "[columns] wx = \"-wx\", with the file's name", DOWN, |i| stack(cross(i.rotation[2], scaled(i.rates, [-1.0, 1.0, 1.0])))),
                read("the pitch rate has the other sign", "[columns] wy = \"-wy\", with the file's name", DOWN, |i| stack(cross(i.rotation[2], scaled(i.rates, [1.0, -1.0, 1.0])))),
                read("the yaw rate has the other sign", "[columns] wz = \"-wz\", with the file's name", DOWN, |i| stack(cross(i.rotation[2], scaled(i.rates, [1.0, 1.0, -1.0])))),
                read("roll has the other sign", ROLL_SIGN, |i| stack(turned(scaled(i.angles, [-1.0, 1.0, 1.0]))[2]), |i| stack(cross(turned(scaled(i.angles, [-1.0, 1.0, 1.0]))[2], i.rates))),
                read("pitch has the other sign", PITCH_SIGN, |i| stack(turned(scaled(i.angles, [1.0, -1.0, 1.0]))[2]), |i| stack(cross(turned(scaled(i.angles, [1.0, -1.0, 1.0]))[2], i.rates))),
                read("the rates are in degrees a second", "[units] rates = \"deg/s\"", DOWN, |i| stack(cross(i.rotation[2], i.rates.map(|rate| rate * DEGREE)))),
                read("wx and wy are exchanged", "[columns] wx = \"wy\", wy = \"wx\", with the file's names", DOWN, |i| stack(cross(i.rotation[2], first_two(i.rates)))),
                read("wy and wz are exchanged", "[columns] wy = \"wz\", wz = \"wy\", with the file's names", DOWN, |i| stack(cross(i.rotation[2], last_two(i.rates)))),
                read("wx and wz are exchanged", "[columns] wx = \"wz\", wz = \"wx\", with the file's names", DOWN, |i| stack(cross(i.rotation[2], outer_two(i.rates)))),
                read(EXCHANGED, ROLL_PITCH, |i| stack(turned(first_two(i.angles))[2]), |i| stack(cross(turned(first_two(i.angles))[2], i.rates))),
                read("the angles are in degrees", ANGLES_DEGREES, |i| stack(turned(i.angles.map(|angle| angle * DEGREE))[2]), |i| stack(cross(turned(i.angles.map(|angle| angle * DEGREE))[2], i.rates))),
            ]);
        }
        let order = match quaternion {
            Some(set) => vec![read(REORDERED, set, |i| axes(&i.reordered), |i| turning(&i.reordered, i.rates))],
            None => vec![
                read(MADE_OF_WXYZ, FROM_QUATERNION, |i| axes(&of_wxyz(i)), |i| turning(&of_wxyz(i), i.rates)),
                read(MADE_OF_XYZW, FROM_QUATERNION, |i| axes(&of_xyzw(i)), |i| turning(&of_xyzw(i), i.rates)),
                read(ENDS_EXCHANGED, YAW_ROLL, |i| axes(&turned(outer_two(i.angles))), |i| turning(&turned(outer_two(i.angles)), i.rates)),
                read(OF_QUATERNION, TO_ANGLES, |i| axes(&of_vector_part(i.angles)), |i| turning(&of_vector_part(i.angles), i.rates)),
            ],
        };
        Self::new("attitude_rate", "dR'/dt = R' x w", |motion| motion.heading, [vec![
            read("", "", |i| axes(&i.rotation), |i| turning(&i.rotation, i.rates)),
            read("the attitude is that of the inertial frame seen from the body (transposed)", TRANSPOSED, |i| axes(&transposed(&i.rotation)), |i| turning(&transposed(&i.rotation), i.rates)),
            read("the rates are written in inertial axes", "[columns] wx, wy, wz as body rates: the log has inertial ones", |i| axes(&i.rotation), |i| turning(&i.rotation, rotate_back(&i.rotation, i.rates))),
            read("the rates have the other sign", "[columns] wx = \"-wx\", wy = \"-wy\", wz = \"-wz\", with the file's names", |i| axes(&i.rotation), |i| turning(&i.rotation, scaled(i.rates, [-1.0; 3]))),
            read("the rates are nose-port-up while the attitude is not", "[columns] wy = \"-wy\", wz = \"-wz\", with the file's names", |i| axes(&i.rotation), |i| turning(&i.rotation, scaled(i.rates, FLIP))),
            read("the roll rate has the other sign", "[columns] wx = \"-wx\", with the file's name", |i| axes(&i.rotation), |i| turning(&i.rotation, scaled(i.rates, [-1.0, 1.0, 1.0]))),
            read("the pitch rate has the other sign", "[columns] wy = \"-wy\", with the file's name", |i| axes(&i.rotation), |i| turning(&i.rotation, scaled(i.rates, [1.0, -1.0, 1.0]))),
            read("the yaw rate has the other sign", "[columns] wz = \"-wz\", with the file's name", |i| axes(&i.rotation), |i| turning(&i.rotation, scaled(i.rates, [1.0, 1.0, -1.0]))),
            read("roll has the other sign", ROLL_SIGN, |i| axes(&turned(scaled(i.angles, [-1.0, 1.0, 1.0]))), |i| turning(&turned(scaled(i.angles, [-1.0, 1.0, 1.0])), i.rates)),
            read("pitch has the other sign", PITCH_SIGN, |i| axes(&turned(scaled(i.angles, [1.0, -1.0, 1.0]))), |i| turning(&turned(scaled(i.angles, [1.0, -1.0, 1.0])), i.rates)),
            read("yaw has the other sign", "[columns] yaw = \"-yaw\", with the file's name", |i| axes(&turned(scaled(i.angles, [1.0, 1.0, -1.0]))), |i| turning(&turned(scaled(i.angles, [1.0, 1.0, -1.0])), i.rates)),
            read("the rates are in degrees a second", "[units] rates = \"deg/s\"", |i| axes(&i.rotation), |i| turning(&i.rotation, i.rates.map(|rate| rate * DEGREE))),
            read("the angles are in degrees", ANGLES_DEGREES, |i| axes(&turned(i.angles.map(|angle| angle * DEGREE))), |i| turning(&turned(i.angles.map(|angle| angle * DEGREE)), i.rates)),
            read("yaw is in degrees and roll and pitch are not", YAW_DEGREES, |i| axes(&turned(scaled(i.angles, [1.0, 1.0, DEGREE]))), |i| turning(&turned(scaled(i.angles, [1.0, 1.0, DEGREE])), i.rates)),
            read("wx and wy are exchanged", "[columns] wx = \"wy\", wy = \"wx\", with the file's names", |i| axes(&i.rotation), |i| turning(&i.rotation, first_two(i.rates))),
            read("wy and wz are exchanged", "[columns] wy = \"wz\", wz = \"wy\", with the file's names", |i| axes(&i.rotation), |i| turning(&i.rotation, last_two(i.rates))),
            read("wx and wz are exchanged", "[columns] wx = \"wz\", wz = \"wx\", with the file's names", |i| axes(&i.rotation), |i| turning(&i.rotation, outer_two(i.rates))),
            read(EXCHANGED, ROLL_PITCH, |i| axes(&turned(first_two(i.angles))), |i| turning(&turned(first_two(i.angles)), i.rates)),
            read(XYZ.says, XYZ.set, |i| axes(&XYZ.rotation(i.angles)), |i| turning(&XYZ.rotation(i.angles), i.rates)),
            read(XZY.says, XZY.set, |i| axes(&XZY.rotation(i.angles)), |i| turning(&XZY.rotation(i.angles), i.rates)),
            read(YXZ.says, YXZ.set, |i| axes(&YXZ.rotation(i.angles)), |i| turning(&YXZ.rotation(i.angles), i.rates)),
            read(YZX.says, YZX.set, |i| axes(&YZX.rotation(i.angles)), |i| turning(&YZX.rotation(i.angles), i.rates)),
            read(ZXY.says, ZXY.set, |i| axes(&ZXY.rotation(i.angles)), |i| turning(&ZXY.rotation(i.angles), i.rates)),
            read(OF_ANGLES, TO_BODY, |i| axes(&i.rotation), |i| turning(&i.rotation, body_rates(i.angles[0], i.angles[1], i.rates))),
        ], order].concat()).along(Way {
            says: OTHER_AXES,
            measured: angle_between,
            rate: |i| length(i.rates),
        })
    }

    /// The recorded v̇ is the derivative of the body components of v.
    #[rustfmt::skip]
    pub fn linear_targets() -> Self {
        const V: fn(&Instant) -> Stack = |i| stack(i.velocity);
        const UPWARDS: Vector = [0.0, 0.0, -GRAVITY_M_S2];
        // v̇ = a − ω × v for an inertial acceleration a in body axes.
        const fn add(a: Vector, b: Vector) -> Vector { [a[0] + b[0], a[1] + b[1], a[2] + b[2]] }
        fn without_turning(acceleration: Vector, i: &Instant) -> Stack { stack(add(acceleration, cross(i.velocity, i.rates))) }
        let read = |says, set, rate| Hypothesis { says, set, state: V, rate };
        Self::new("velocity_targets", "v_dot = dv/dt", |motion| motion.recorded, vec![
            read("", "", |i| stack(i.linear_target)),
            read("the linear accelerations are specific force, as an accelerometer measures it: gravity and Coriolis terms are missing", "targets = \"specific_force\"", |i| without_turning(add(i.linear_target, i.gravity), i)),
            read("gravity has been taken out of the linear accelerations", "[columns] vx_dot = \"vx_dot + g_x\", vy_dot = \"vy_dot + g_y\", vz_dot = \"vz_dot + g_z\"", |i| stack(add(i.linear_target, i.gravity))),
            read(AS_LEVEL, TILTED, |i| stack(add(add(i.linear_target, i.gravity), UPWARDS))),
            read("the linear accelerations are specific force from which gravity was taken off as though the aircraft were level", "targets = \"specific_force\" and [columns] vz_dot = \"vz_dot - 9.80665\", with the file's name", |i| without_turning(add(add(i.linear_target, i.gravity), UPWARDS), i)),
            read(WITH_ANGULAR, ANGULAR_BACK, |i| stack(i.angular_target)),
            read("the linear accelerations are the inertial acceleration in body axes: the Coriolis term is missing", "targets = \"body_acceleration\"", |i| without_turning(i.linear_target, i)),
            read("the linear accelerations are the derivative of the inertial velocity in inertial axes", "targets = \"inertial\"", |i| without_turning(rotate_back(&i.rotation, i.linear_target), i)),
            read("the linear accelerations are specific force with the sign of a reaction (+9.8 upwards at rest)", "[columns] vx_dot = \"-vx_dot\" and so on, and targets = \"specific_force\"", |i| without_turning(add(i.linear_target.map(|value| -value), i.gravity), i)),
            read("the linear accelerations are specific force in nose-port-up axes", "[columns] vy_dot = \"-vy_dot\", vz_dot = \"-vz_dot\", and targets = \"specific_force\"", |i| without_turning(add(scaled(i.linear_target, FLIP), i.gravity), i)),
            read("the linear accelerations are in units of g", "[units] acceleration = \"g\"", |i| stack(i.linear_target.map(|value| GRAVITY_M_S2 * value))),
            read("the linear accelerations are specific force in units of g", "targets = \"specific_force\" and [units] acceleration = \"g\"", |i| without_turning(add(i.linear_target.map(|value| GRAVITY_M_S2 * value), i.gravity), i)),
            read("the linear accelerations are nose-port-up while the velocity is not", "[columns] vy_dot = \"-vy_dot\", vz_dot = \"-vz_dot\"", |i| stack(scaled(i.linear_target, FLIP))),
            Hypothesis { says: "the velocity is written in inertial axes", set: "velocity = \"inertial\"", state: |i| stack(rotate_back(&i.rotation, i.velocity)), rate: |i| stack(i.linear_target) },
            Hypothesis { says: LEVEL, set: UNLEVEL, state: |i| stack(rotate_back(&turned(scaled(i.angles, [1.0, 1.0, 0.0])), i.velocity)), rate: |i| stack(i.linear_target) },
            read("vx_dot and vy_dot are exchanged", "[columns] vx_dot = \"vy_dot\", vy_dot = \"vx_dot\", with the file's names", |i| stack(first_two(i.linear_target))),
            read("vy_dot and vz_dot are exchanged", "[columns] vy_dot = \"vz_dot\", vz_dot = \"vy_dot\", with the file's names", |i| stack(last_two(i.linear_target))),
            read("vx_dot and vz_dot are exchanged", "[columns] vx_dot = \"vz_dot\", vz_dot = \"vx_dot\", with the file's names", |i| stack(outer_two(i.linear_target))),
            read("the linear accelerations have the other sign", "[columns] vx_dot = \"-vx_dot\", vy_dot = \"-vy_dot\", vz_dot = \"-vz_dot\"", |i| stack(i.linear_target.map(|value| -value))),
        ])
    }

    /// The recorded ω̇ is the derivative of ω.
    #[rustfmt::skip]
    pub fn angular_targets() -> Self {
        const W: fn(&Instant) -> Stack = |i| stack(i.rates);
        let read = |says, set, rate| Hypothesis { says, set, state: W, rate };
        Self::new("rate_targets", "w_dot = dw/dt", |motion| motion.recorded, vec![
            read("", "", |i| stack(i.angular_target)),
            read("the angular targets are in degrees", "[units] angular_acceleration = \"deg/s^2\"", |i| stack(i.angular_target.map(|value| value * DEGREE))),
            read("the rates are in degrees a second and their targets are not", "[units] rates = \"deg/s\"", |i| stack(i.angular_target.map(|value| value / DEGREE))),
            read("the angular targets are nose-port-up while the rates are not", "[columns] wy_dot = \"-wy_dot\", wz_dot = \"-wz_dot\"", |i| stack(scaled(i.angular_target, FLIP))),
            read("wx_dot and wy_dot are exchanged", "[columns] wx_dot = \"wy_dot\", wy_dot = \"wx_dot\", with the file's names", |i| stack(first_two(i.angular_target))),
            read("wy_dot and wz_dot are exchanged", "[columns] wy_dot = \"wz_dot\", wz_dot = \"wy_dot\", with the file's names", |i| stack(last_two(i.angular_target))),
            read("wx_dot and wz_dot are exchanged", "[columns] wx_dot = \"wz_dot\", wz_dot = \"wx_dot\", with the file's names", |i| stack(outer_two(i.angular_target))),
            read(WITH_ANGULAR, ANGULAR_BACK, |i| stack(i.linear_target)),
            read("the angular targets have the other sign", "[columns] wx_dot = \"-wx_dot\", wy_dot = \"-wy_dot\", wz_dot = \"-wz_dot\"", |i| stack(i.angular_target.map(|value| -value))),
            Hypothesis { says: OF_ANGLES, set: TO_BODY, state: |i| stack(body_rates(i.angles[0], i.angles[1], i.rates)), rate: |i| stack(i.angular_target) },
        ])
    }

    /// Adds a flight.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        if !(self.applies)(motion) {
            return;
        }
        let every = motion.pieces(0).count().div_ceil(ENOUGH).max(1);
        let first = self.misfit[0].len();
        self.add_reading(0, flight, motion, every);
        let (error, size) = total(&self.misfit[0][first..]);
        // Where the nominal reading holds another leaves all.
        let holds = error <= HOLDS * size;
        if let Some(way) = self.way.filter(|_| !holds) {
            let of = motion.pieces(0).step_by(every).map(|(piece, _)| way.misfit(motion, &piece));
            self.of_way = of.fold(self.of_way, |sum, one| (sum.0 + one.0, sum.1 + one.1));
        }
        for reading in 1..self.hypotheses.len() {
            if holds {
                let sizes = self.misfit[0][first..].iter().map(|block| (block.1, block.1)).collect::<Vec<_>>();
                self.misfit[reading].extend(sizes);
            } else {
                self.add_reading(reading, flight, motion, every);
            }
        }
    }

    /// Adds the misfits of one reading in a flight, block by block.
    fn add_reading(&mut self, reading: usize, flight: usize, motion: &Motion, every: usize) {
        let blocks = &mut self.misfit[reading];
        let mut open = None;
        for (piece, block) in motion.pieces(0).step_by(every) {
            if open != Some((flight, block)) {
                open = Some((flight, block));
                blocks.push((0.0, 0.0));
            }
            let (error, size) = self.hypotheses[reading].misfit(motion, &piece);
            if let Some(sums) = blocks.last_mut() {
                *sums = (sums.0 + error, sums.1 + size);
            }
        }
    }

    /// Squared error of a reading over that of the measured changes.
    fn share(&self, index: usize) -> f64 {
        let (error, size) = total(&self.misfit[index]);
        if size > 0.0 { error / size } else { f64::NAN }
    }

    /// The reading of which the nominal one is certainly worse. `left` is what single columns leave unexplained, each with a gain of its own: a reading
    /// that leaves more is not the cause.
    pub fn other_reading(&self, left: f64) -> Option<usize> {
        let nominal = self.share(0);
        let best = (1..self.hypotheses.len()).min_by(|a, b| self.share(*a).total_cmp(&self.share(*b)))?;
        // One that explains little itself only leaves out what is wrong.
        let bar = LARGEST_SHARE.min(CONVINCING_SHARE * nominal).min(OF_COLUMNS * left + SLACK);
        (nominal > MATERIAL_SHARE && self.share(best) < bar && self.consistent(best)).then_some(best)
    }

    /// Another reading of a part of a single flight, where the nominal one holds in the rest of it: as a clause, and whether it is the later part, from this
    /// block on, or the earlier one up to there.
    pub fn reading_of_part(&self) -> Option<(&'static str, bool, usize)> {
        if self.share(0).is_nan() || self.share(0) < MATERIAL_SHARE {
            return None;
        }
        let blocks = self.misfit[0].len();
        // Sums up to each block, so that a long flight costs no more than its length.
        let sums: Vec<Vec<(f64, f64)>> = self.misfit.iter().map(|blocks| running(blocks)).collect();
        let sum = |reading: usize, range: &Range<usize>| {
            let [before, up_to] = [range.start, range.end].map(|at| sums[reading][at]);
            (up_to.0 - before.0, up_to.1 - before.1)
        };
        let share = |reading: usize, range: &Range<usize>| {
            let (error, size) = sum(reading, range);
            error / size
        };
        let parts = (FEWEST_BLOCKS..(blocks + 1).saturating_sub(FEWEST_BLOCKS)).flat_map(|at| {
            let (earlier, later) = (0..at, at..blocks);
            [(later.clone(), earlier.clone(), true, at), (earlier, later, false, at)]
        });
        let holds = parts.filter(|(part, rest, ..)| share(0, rest) < MATERIAL_SHARE && share(0, part) > LARGEST_SHARE);
        let read = holds.flat_map(|(part, _, is_later, at)| {
            let of = |reading: usize| (sum(reading, &part).0, share(reading, &part), reading, is_later, at);
            (1..self.hypotheses.len()).map(of).collect::<Vec<_>>()
        });
        // Of several places that one where the nominal reading is given up as late as it holds.
        let left = |found: &(f64, f64, usize, bool, usize)| {
            let rest = if found.3 { 0..found.4 } else { found.4..blocks };
            found.0 + sum(0, &rest).0
        };
        let best = read.min_by(|one, other| left(one).total_cmp(&left(other)))?;
        (best.1 < MATERIAL_SHARE).then_some((self.hypotheses[best.2].says, best.3, best.4))
    }

    /// Whether it applied to anything.
    pub fn has_blocks(&self) -> bool {
        self.misfit.first().is_some_and(|blocks| !blocks.is_empty())
    }

    /// Whether a reading says that the rates have the other sign than the changes.
    pub fn is_reversal(&self, index: usize) -> bool {
        self.hypotheses[index].says.ends_with(REVERSED)
    }

    /// Whether a reading leaves less than the nominal one, be it by little.
    pub fn prefers(&self, index: usize) -> bool {
        self.share(index) < self.share(0)
    }

    /// Adds the blocks of the same relation elsewhere, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        for (blocks, others) in self.misfit.iter_mut().zip(&other.misfit) {
            blocks.extend(others.chunks(together).map(total));
        }
        self.of_way = (self.of_way.0 + other.of_way.0, self.of_way.1 + other.of_way.1);
    }

    /// Severity over all flights, `left` as of [`Relation::other_reading`]; `None` where the relation never applied.
    pub fn finding(&self, left: f64) -> Option<Finding> {
        let blocks = self.misfit.first()?.len();
        if blocks == 0 {
            return None;
        }
        let nominal = self.share(0);
        let mut finding = Finding {
            name: self.name.into(),
            subject: Subject::Conventions,
            verdict: Severity::Ok,
            measured: Some(100.0 * nominal),
            interval: None,
            expected: Some(0.0),
            unit: "% unexplained".into(),
            message: format!("{} holds", self.formula),
            set: None,
            flights: Vec::new(),
        };
        if !nominal.is_finite() || blocks < FEW_BLOCKS {
            finding.verdict = Severity::Undetermined;
            finding.message = format!("{}: too little movement or fewer than {FEW_BLOCKS} blocks of 10 s to say", self.formula);
        } else if let Some(index) = self.other_reading(left) {
            finding.verdict = Severity::Fault;
            finding.message = format!(
                "{} does not hold; {} ({:.1} % unexplained that way)",
                self.formula,
                self.hypotheses[index].says,
                100.0 * self.share(index)
            );
            finding.set = Some(self.hypotheses[index].set.into());
        } else if let Some(way) = self.way.filter(|_| nominal > POOR_SHARE && self.of_way.0 < SAME_WAY * self.of_way.1) {
            finding.verdict = Severity::Fault;
            finding.message = format!("{} does not hold; {}", self.formula, way.says);
        } else if nominal > POOR_SHARE {
            finding.verdict = Severity::Warning;
            finding.message = format!("{} holds poorly, and no other reading of the log does much better", self.formula);
        }
        Some(finding)
    }

    /// Whether a reading beats the nominal one block by block: the mean log ratio of errors is below zero with 95 % confidence.
    fn consistent(&self, index: usize) -> bool {
        let ratios = self.misfit[index].iter().zip(&self.misfit[0]).filter(|(other, nominal)| other.0 > 0.0 && nominal.0 > 0.0);
        let ratios = ratios.map(|(other, nominal)| {
            let relative = |(error, size): (f64, f64)| if size > 0.0 { error / size } else { error };
            BlockSum { samples: 1.0, sum: (relative(*other) / relative(*nominal)).ln() }
        });
        BlockMean::new(ratios).and_then(|mean| mean.interval()).is_some_and(|[_, high]| high < 0.0)
    }
}

/// Errors and sizes of all blocks before each, and of all.
fn running(blocks: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sum = (0.0, 0.0);
    let up_to = blocks.iter().map(|block| {
        sum = (sum.0 + block.0, sum.1 + block.1);
        sum
    });
    std::iter::once((0.0, 0.0)).chain(up_to).collect()
}

/// Errors and sizes of several blocks.
fn total(blocks: &[(f64, f64)]) -> (f64, f64) {
    blocks.iter().fold((0.0, 0.0), |sum, block| (sum.0 + block.0, sum.1 + block.1))
}

impl Way {
    /// Squared error, and the square of the way itself.
    fn misfit(&self, motion: &Motion, piece: &Range<usize>) -> (f64, f64) {
        let measured = (self.measured)(&motion.instants[piece.start], &motion.instants[piece.end]);
        let [says] = motion.integral(piece, |sample| [(self.rate)(&motion.instants[sample])]);
        ((measured - says).powi(2), measured.powi(2))
    }
}

impl Hypothesis {
    /// Squared error of s(t₁) − s(t₀) − ∫ f dt, and the square of the change itself.
    fn misfit(&self, motion: &Motion, piece: &Range<usize>) -> (f64, f64) {
        let (start, end) = ((self.state)(&motion.instants[piece.start]), (self.state)(&motion.instants[piece.end]));
        let predicted = motion.integral(piece, |sample| (self.rate)(&motion.instants[sample]));
        let sums = start.iter().zip(end).zip(predicted).map(|((start, end), predicted)| {
            let change = end - start;
            ((change - predicted).powi(2), change.powi(2))
        });
        sums.fold((0.0, 0.0), |sum, term| (sum.0 + term.0, sum.1 + term.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::{Formula, Value};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angles_made_of_the_parts_of_a_quaternion_mean_its_attitude(x in -0.57..0.57_f64, y in -0.57..0.57_f64, z in -0.57..0.57_f64) {
            let value = |name: &str| match name { "roll" => x, "pitch" => y, _ => z };
            let angles: Vec<f64> = TO_ANGLES.split('"').skip(1).step_by(2).map(|text| {
                let formula = Formula::parse(text).expect("a formula");
                formula.evaluate(1, 0.01, &|name: &str| Some(Value::from(value(name)))).expect("a value")[0]
            }).collect();
            let meant = turned([angles[0], angles[1], angles[2]]);
            for (meant, is) in meant.as_flattened().iter().zip(of_vector_part([x, y, z]).as_flattened()) {
                prop_assert!((meant - is).abs() < 1e-7, "{meant} {is}");
            }
        }
    }
}
