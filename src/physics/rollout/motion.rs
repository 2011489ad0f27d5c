//! How a rigid body moves, in many lanes at once: position, attitude, velocity and rates, and their derivatives by kinematics alone. What
//! accelerates it, nothing here knows.

use crate::flight::attitude::{dot, euler_to_quaternion, quaternion_to_rotation, rotate, rotation_to_euler};
use crate::flight::{Column, Flight, GRAVITY_M_S2};

/// Where a body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// North-east-down position, m.
    pub position: [f64; 3],
    /// Unit quaternion body → inertial, scalar last.
    pub attitude: [f64; 4],
    /// Velocity in north-east-down axes, m/s.
    pub velocity: [f64; 3],
    /// Body rates, rad/s.
    pub rates: [f64; 3],
}

impl State {
    /// As a flight recorded it.
    pub fn recorded(flight: &Flight, sample: usize) -> Self {
        let of = |column: Column| flight.column(column)[sample];
        let attitude = euler_to_quaternion(of(Column::Roll), of(Column::Pitch), of(Column::Yaw));
        Self {
            position: [Column::X, Column::Y, Column::Z].map(of),
            attitude,
            velocity: rotate(&quaternion_to_rotation(attitude), [Column::Vx, Column::Vy, Column::Vz].map(of)),
            rates: [Column::Wx, Column::Wy, Column::Wz].map(of),
        }
    }
}

/// The recorded states of a whole flight. Where the log has no position it is the way that the velocity makes, from 0 on (trapezoidal rule).
pub fn recorded_states(flight: &Flight) -> Vec<State> {
    let mut states: Vec<State> = (0..flight.len()).map(|sample| State::recorded(flight, sample)).collect();
    if has_position(flight) {
        return states;
    }
    let mut position = [0.0; 3];
    for sample in 0..states.len() {
        if let Some(before) = sample.checked_sub(1).and_then(|before| states.get(before)) {
            let velocity = states[sample].velocity;
            position = std::array::from_fn(|axis| position[axis] + 0.5 * flight.step_s * (before.velocity[axis] + velocity[axis]));
        }
        states[sample].position = position;
    }
    states
}

/// Whether position is in the log of a flight.
pub fn has_position(flight: &Flight) -> bool {
    ![Column::X, Column::Y, Column::Z].iter().any(|column| flight.absent.contains(column))
}

/// Columns of a [`Motion`]: position, quaternion, velocity in body axes, rates.
pub const NUMBERS: usize = 13;
const POSITION: usize = 0;
const ATTITUDE: usize = 3;
const VELOCITY: usize = 7;
const RATES: usize = 10;

/// The state of every lane, one column a number, one entry a lane. Velocity is in body axes here.
#[derive(Clone, Debug)]
pub struct Motion {
    columns: [Vec<f64>; NUMBERS],
}

/// What formulas see of a motion beyond its own columns, and what its kinematics need.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Roll, pitch, yaw, rad; empty where nothing reads them.
    euler: [Vec<f64>; 3],
    /// Gravity in body axes, m/s².
    gravity: [Vec<f64>; 3],
    /// Velocity in north-east-down axes, m/s.
    world: [Vec<f64>; 3],
    angles: bool,
}

impl Motion {
    /// The recorded states at some samples of a flight.
    pub fn recorded(flight: &Flight, samples: &[usize]) -> Self {
        let of = |column: Column| samples.iter().map(|&sample| flight.column(column)[sample]).collect::<Vec<f64>>();
        let mut columns: [Vec<f64>; NUMBERS] = std::array::from_fn(|_| vec![0.0; samples.len()]);
        for (axis, column) in [Column::X, Column::Y, Column::Z].into_iter().enumerate() {
            columns[POSITION + axis] = of(column);
        }
        for (axis, column) in [Column::Vx, Column::Vy, Column::Vz].into_iter().enumerate() {
            columns[VELOCITY + axis] = of(column);
        }
        for (axis, column) in [Column::Wx, Column::Wy, Column::Wz].into_iter().enumerate() {
            columns[RATES + axis] = of(column);
        }
        for (lane, &sample) in samples.iter().enumerate() {
            let [roll, pitch, yaw] = [Column::Roll, Column::Pitch, Column::Yaw].map(|column| flight.column(column)[sample]);
            for (part, value) in euler_to_quaternion(roll, pitch, yaw).into_iter().enumerate() {
                columns[ATTITUDE + part][lane] = value;
            }
        }
        Self { columns }
    }

    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.columns[0].len()
    }

    fn at<const N: usize>(&self, first: usize, lane: usize) -> [f64; N] {
        std::array::from_fn(|part| self.columns[first + part][lane])
    }

    /// The state of one lane.
    pub fn state(&self, lane: usize) -> State {
        let attitude = self.at(ATTITUDE, lane);
        State {
            position: self.at(POSITION, lane),
            attitude,
            velocity: rotate(&quaternion_to_rotation(attitude), self.at(VELOCITY, lane)),
            rates: self.at(RATES, lane),
        }
    }

    /// The column of a canonical state column other than the angles.
    pub fn column(&self, column: Column) -> &[f64] {
        let index = column as usize;
        let place = if index < Column::Vx as usize { POSITION + index } else { VELOCITY + index - Column::Vx as usize };
        &self.columns[place]
    }

    /// All lanes so many times, one copy behind the other.
    pub fn repeated(&self, copies: usize) -> Self {
        Self { columns: std::array::from_fn(|number| self.columns[number].repeat(copies)) }
    }

    /// Some lanes.
    pub fn part(&self, lanes: std::ops::Range<usize>) -> Self {
        Self { columns: std::array::from_fn(|number| self.columns[number][lanes.clone()].to_vec()) }
    }

    /// One of the [`NUMBERS`], by lane.
    pub fn number(&self, number: usize) -> &[f64] {
        &self.columns[number]
    }

    /// One of the [`NUMBERS`], by lane, to be changed.
    pub fn number_mut(&mut self, number: usize) -> &mut [f64] {
        &mut self.columns[number]
    }

    /// Takes over one lane of another motion.
    pub fn keep(&mut self, lane: usize, other: &Self) {
        self.columns.iter_mut().zip(&other.columns).for_each(|(own, other)| own[lane] = other[lane]);
    }

    /// Whether a lane is finite, no faster than `speed_m_s` and turns no faster than `rate_rad_s`.
    pub fn is_bounded(&self, lane: usize, speed_m_s: f64, rate_rad_s: f64) -> bool {
        let size = |vector: [f64; 3]| dot(vector, vector).sqrt();
        self.columns.iter().all(|column| column[lane].is_finite())
            && size(self.at(VELOCITY, lane)) <= speed_m_s
            && size(self.at(RATES, lane)) <= rate_rad_s
    }

    /// `self = start + by * slope`.
    pub fn set(&mut self, start: &Self, by: f64, slope: &Self) {
        for ((to, start), slope) in self.columns.iter_mut().zip(&start.columns).zip(&slope.columns) {
            to.iter_mut().zip(start).zip(slope).for_each(|((to, start), slope)| *to = start + by * slope);
        }
    }

    /// `self += by * slope`.
    pub fn add(&mut self, by: f64, slope: &Self) {
        for (to, slope) in self.columns.iter_mut().zip(&slope.columns) {
            to.iter_mut().zip(slope).for_each(|(to, slope)| *to += by * slope);
        }
    }

    /// Makes quaternions unit ones again.
    pub fn renormalise(&mut self) {
        for lane in 0..self.lanes() {
            let quaternion: [f64; 4] = self.at(ATTITUDE, lane);
            let scale = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt().recip();
            (0..4).for_each(|part| self.columns[ATTITUDE + part][lane] *= scale);
        }
    }

    /// Its derivative into `slope`, but for the derivatives of velocity and rates.
    pub fn kinematics(&self, seen: &Seen, slope: &mut Self) {
        for (to, velocity) in slope.columns[POSITION..].iter_mut().zip(&seen.world) {
            to.copy_from_slice(velocity);
        }
        // q' = q ⊗ (ω, 0) / 2.
        for lane in 0..self.lanes() {
            let [x, y, z, w]: [f64; 4] = self.at(ATTITUDE, lane);
            let [p, q, r]: [f64; 3] = self.at(RATES, lane);
            let rate = [w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p, -(x * p + y * q + z * r)];
            rate.into_iter().enumerate().for_each(|(part, value)| slope.columns[ATTITUDE + part][lane] = 0.5 * value);
        }
    }

    /// The derivatives of velocity (0 to 2) and rates (3 to 5).
    pub fn accelerations_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.columns[VELOCITY..]
    }
}

impl Seen {
    /// Of so many lanes; with `angles` roll, pitch and yaw, too.
    pub fn new(lanes: usize, angles: bool) -> Self {
        let blank = || std::array::from_fn(|_| vec![0.0; lanes]);
        Self { euler: blank(), gravity: blank(), world: blank(), angles }
    }

    /// Looks at a motion.
    pub fn look(&mut self, motion: &Motion) {
        for lane in 0..motion.lanes() {
            let matrix = quaternion_to_rotation(motion.at(ATTITUDE, lane));
            let world = rotate(&matrix, motion.at(VELOCITY, lane));
            for axis in 0..3 {
                self.gravity[axis][lane] = GRAVITY_M_S2 * matrix[2][axis];
                self.world[axis][lane] = world[axis];
            }
            if self.angles {
                let angles = rotation_to_euler(&matrix);
                (0..3).for_each(|axis| self.euler[axis][lane] = angles[axis]);
            }
        }
    }

    /// Roll, pitch or yaw.
    pub fn angle(&self, axis: usize) -> &[f64] {
        &self.euler[axis]
    }

    /// Gravity along a body axis.
    pub fn gravity(&self, axis: usize) -> &[f64] {
        &self.gravity[axis]
    }
}
