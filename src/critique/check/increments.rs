//! A flight as the checks see it: sample by sample for the geometry, in pieces of 0.2 s for the comparison.
//!
//! Every relation ṡ = f is checked in its integral form, s(t₁) − s(t₀) = ∫ f dt over a piece (trapezoidal rule). That needs no
//! differentiator, and noise enters at the two ends only. No verdicts here.

use crate::flight::attitude::{
    Axes, Matrix3, QuaternionOrder, euler_to_quaternion, gravity_body, quaternion_to_euler, rotation_body_to_inertial,
};
use crate::flight::{Column, Flight, Source, Targets};
use std::ops::Range;

/// Three components.
pub(super) type Vector = [f64; 3];

/// Length of a block of one flight, s: ten pieces, so that a flight of half a minute still has an interval.
pub(super) const SHORT_BLOCK_S: f64 = 2.0;
/// So many of them are a block where many flights are judged together ([`crate::blocks::BLOCK_S`]).
pub(super) const TOGETHER: usize = 5;

/// Length of a piece, s: short against manoeuvres, long against the noise of one sample.
const PIECE_S: f64 = 0.2;

/// One sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    /// m, north-east-down.
    pub position: Vector,
    /// Roll, pitch, yaw, rad.
    pub angles: Vector,
    /// R_b^in of the angles.
    pub rotation: Matrix3,
    /// R_b^in of a quaternion written in the other order; of a log without quaternions the same as [`Instant::rotation`].
    pub reordered: Matrix3,
    /// R_in^b g, m/s².
    pub gravity: Vector,
    /// Velocity in body axes, m/s.
    pub velocity: Vector,
    /// Body rates, rad/s.
    pub rates: Vector,
    /// v̇ as the log has it, m/s².
    pub linear_target: Vector,
    /// ω̇ as the log has it, rad/s².
    pub angular_target: Vector,
    /// u1 … u4.
    pub controls: [f64; 4],
}

/// The samples of one flight, and what of them was recorded.
pub(super) struct Motion {
    pub step_s: f64,
    pub instants: Vec<Instant>,
    /// Position is in the log.
    pub position: bool,
    /// Heading is in the log.
    pub heading: bool,
    /// The accelerations are in the log.
    pub recorded: bool,
}

impl Motion {
    pub fn new(flight: &Flight, source: &Source) -> Self {
        let at = |columns: [Column; 3], sample: usize| columns.map(|column| flight.column(column)[sample]);
        let instant = |sample: usize| {
            let angles = at([Column::Roll, Column::Pitch, Column::Yaw], sample);
            let rotation = rotation_body_to_inertial(angles[0], angles[1], angles[2]);
            Instant {
                position: at([Column::X, Column::Y, Column::Z], sample),
                angles,
                rotation,
                reordered: source.quaternion.map_or(rotation, |order| reordered(angles, source.axes, order)),
                gravity: gravity_body(angles[0], angles[1]),
                velocity: at([Column::Vx, Column::Vy, Column::Vz], sample),
                rates: at([Column::Wx, Column::Wy, Column::Wz], sample),
                linear_target: at([Column::VxDot, Column::VyDot, Column::VzDot], sample),
                angular_target: at([Column::WxDot, Column::WyDot, Column::WzDot], sample),
                controls: [Column::U1, Column::U2, Column::U3, Column::U4].map(|column| flight.column(column)[sample]),
            }
        };
        let lacks = |column: Column| flight.absent.contains(&column);
        Self {
            step_s: flight.step_s,
            instants: (0..flight.len()).map(instant).collect(),
            position: ![Column::X, Column::Y, Column::Z].into_iter().any(lacks),
            heading: !lacks(Column::Yaw),
            recorded: flight.targets == Targets::Recorded,
        }
    }

    /// Samples of a short block.
    pub fn block_samples(&self) -> usize {
        (SHORT_BLOCK_S / self.step_s).round().max(1.0) as usize
    }

    /// First and last sample of each piece, `margin` samples away from the ends of the flight, with its short block in this flight.
    pub fn pieces(&self, margin: usize) -> impl Iterator<Item = (Range<usize>, usize)> + '_ {
        let length = ((PIECE_S / self.step_s).round() as usize).max(1);
        let last = self.instants.len().saturating_sub(margin + 1);
        (margin..)
            .step_by(length)
            .take_while(move |start| start + length <= last)
            .map(move |start| (start..start + length, start / self.block_samples()))
    }

    /// ∫ f dt over a piece, with `f` given the sample.
    pub fn integral<const N: usize>(&self, piece: &Range<usize>, f: impl Fn(usize) -> [f64; N]) -> [f64; N] {
        let mut sum = [0.0; N];
        for sample in piece.start..=piece.end {
            let weight = if sample == piece.start || sample == piece.end { 0.5 } else { 1.0 };
            sum.iter_mut().zip(f(sample)).for_each(|(sum, value)| *sum += weight * self.step_s * value);
        }
        sum
    }
}

/// R_b^in as it would be had the log's quaternion been read in the other order. A change of axes is its own inverse.
fn reordered(angles: Vector, axes: Axes, order: QuaternionOrder) -> Matrix3 {
    let [roll, pitch, yaw] = axes.euler_to_ned(angles);
    let written = order.written(euler_to_quaternion(roll, pitch, yaw));
    let [roll, pitch, yaw] = axes.euler_to_ned(quaternion_to_euler(order.other().scalar_last(written)));
    rotation_body_to_inertial(roll, pitch, yaw)
}

/// Length of a piece of this flight, s.
pub(super) fn length_s(motion: &Motion, piece: &Range<usize>) -> f64 {
    motion.step_s * (piece.end - piece.start) as f64
}
