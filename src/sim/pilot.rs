//! The pilot: turns a goal and what is seen into stick positions, with a human's bandwidth, habits and restlessness.
//!
//! Cascaded as a person flies: path to a wanted thrust direction, thrust direction to body rates, rates to sticks with a feel for
//! the machine's nominal response. The pilot knows the baseline's coefficients, as feel, and none of the mechanisms.

use super::body::{State, cross, product, rotation, to_body, to_local};
use super::manoeuvres::{Goal, Segment};
use super::random::{GaussMarkov, Random};
use super::vehicle::COEFFICIENTS;
use crate::flight::GRAVITY_M_S2;
use std::f64::consts::TAU;

/// Lag between the wanted and the actual stick position, s (neuromuscular lag, about 0.1 s in McRuer's pilot models; experts on
/// thumb sticks are faster).
const HAND_TIME_S: f64 = 0.05;
/// Restlessness of the four sticks, rms, and its correlation time, s: it keeps the inputs from being a function of the state.
const DITHER: [f64; 4] = [0.035, 0.035, 0.06, 0.035];
const DITHER_TIME_S: f64 = 0.12;
/// Velocity error to acceleration, 1/s, and its integral, 1/s².
const VELOCITY_GAIN: [f64; 2] = [1.3, 0.3];
/// The same for the vertical, where the stick acts on the acceleration itself.
const CLIMB_GAIN: [f64; 2] = [2.2, 0.9];
/// Largest heave damping the hand allows for, m/s². Beyond, it would chase a fall with less and less collective.
const FELT_DAMPING_M_S2: f64 = 6.0;
/// Height error to climb, 1/s.
const HEIGHT_GAIN: f64 = 1.3;
/// Attitude error to rate, 1/s.
const ATTITUDE_GAIN: f64 = 3.5;
/// Rate error to angular acceleration, 1/s, and its integral, 1/s².
const RATE_GAIN: [f64; 2] = [2.0, 4.0];
/// Largest rate a path asks for, rad/s.
const PATH_RATE_RAD_S: f64 = 4.0;
/// Largest horizontal acceleration a path asks for, m/s²: 45 degrees of bank.
const HORIZONTAL_M_S2: f64 = 9.8;
/// How fast the wanted velocity may change, m/s².
const SLEW_M_S2: f64 = 8.0;
/// Distance from home at which the pilot starts to bring the aircraft back, m.
const LEASH_M: f64 = 60.0;
/// With less than this height in hand (m), or faster than `FASTEST_M_S`, aerobatics are broken off.
const FLOOR_M: f64 = 15.0;
const FASTEST_M_S: f64 = 22.0;
/// Height at which a commanded descent ends, m.
const DESCENT_END_M: f64 = 6.0;

/// The pilot's memory during one flight.
#[derive(Clone, Debug)]
pub(super) struct Pilot {
    home: f64,
    segments: Vec<Segment>,
    current: usize,
    elapsed: f64,
    broken_off: bool,
    heading: f64,
    nose: f64,
    velocity: [f64; 3],
    velocity_sum: [f64; 3],
    rate_sum: [f64; 3],
    sticks: [f64; 4],
    dither: [GaussMarkov; 4],
    random: Random,
    step_s: f64,
}

/// What the inner loops are to do.
struct Wanted {
    rates: [f64; 3],
    /// Specific thrust along the mast, up, m/s².
    thrust: f64,
}

/// What the outer loop is to fly at a moment.
struct Course {
    /// Above the ground, m, unless `climb` says more.
    height: f64,
    /// Ahead and to the right of the path's heading, m/s.
    velocity: [f64; 2],
    /// m/s; `None` holds the height.
    climb: Option<f64>,
    /// Of the nose and of the path, rad/s.
    turns: [f64; 2],
    inverted: bool,
}

impl Pilot {
    pub(super) fn new(home: f64, segments: Vec<Segment>, heading: f64, sticks: [f64; 4], step_s: f64, mut random: Random) -> Self {
        let dither = DITHER.map(|rms| GaussMarkov::new(rms, DITHER_TIME_S, step_s, &mut random));
        Self {
            home,
            segments,
            current: 0,
            elapsed: 0.0,
            broken_off: false,
            heading,
            nose: heading,
            velocity: [0.0; 3],
            velocity_sum: [0.0; 3],
            rate_sum: [0.0; 3],
            sticks,
            dither,
            random,
            step_s,
        }
    }

    /// Stick positions one step ahead, each in [-1, 1], from the state now. Until the script starts, the pilot hovers.
    pub(super) fn fly(&mut self, state: &State, started: bool) -> [f64; 4] {
        let rotation = rotation(state.attitude);
        let hover = Goal::Path { ahead: 0.0, right: 0.0, climb: None, nose_turn: 0.0, path_turn: 0.0, inverted: false };
        let segment = if started { self.segments.get(self.current).copied() } else { None };
        let Segment { seconds, height, mut goal } =
            segment.unwrap_or(Segment { seconds: f64::INFINITY, height: self.home, goal: hover });
        let speed = state.velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        // Height left if the fall is stopped at half a g.
        let fall = to_local(&rotation, state.velocity)[2].max(0.0);
        let margin = -state.position[2] - fall * fall / GRAVITY_M_S2;
        if matches!(goal, Goal::Rates { .. }) && (self.broken_off || margin < FLOOR_M || speed > FASTEST_M_S) {
            self.broken_off = true;
            goal = hover;
        }
        let wanted = match goal {
            Goal::Rates { rates, thrust } => {
                // Whatever path follows starts from where the nose and the motion are then.
                self.velocity = to_local(&rotation, state.velocity);
                self.nose = rotation[1][0].atan2(rotation[0][0]);
                self.heading = self.nose;
                let sink = (0.1 * (height + state.position[2]) + 0.15 * self.velocity[2]).clamp(-0.5, 0.5);
                let upright = thrust.upright * (1.0 + sink);
                Wanted { rates, thrust: GRAVITY_M_S2 * (thrust.constant + upright * rotation[2][2]) }
            }
            Goal::Lean { bank, pitch, period } => self.lean(state, &rotation, height, [bank, pitch, period]),
            Goal::Path { ahead, right, climb, nose_turn, path_turn, inverted } => {
                let course = Course { height, velocity: [ahead, right], climb, turns: [nose_turn, path_turn], inverted };
                self.path(state, &rotation, &course)
            }
            Goal::Stick { ahead, .. } => {
                let course = Course { height, velocity: [ahead, 0.0], climb: None, turns: [0.0; 2], inverted: false };
                self.path(state, &rotation, &course)
            }
            Goal::Sweep { ahead, right, climb, turn, periods: [first, last], inverted } => {
                // Phase of a sine whose frequency goes linearly from 1/first to 1/last.
                let phase = TAU * self.elapsed * (1.0 / first + 0.5 * self.elapsed / seconds * (1.0 / last - 1.0 / first));
                let (sine, cosine) = phase.sin_cos();
                let climb = climb * sine + 0.3 * (height + state.position[2]);
                let velocity = [ahead * sine, right * cosine];
                let course = Course { height, velocity, climb: Some(climb), turns: [turn * cosine; 2], inverted };
                self.path(state, &rotation, &course)
            }
        };
        let mut sticks = self.sticks_for(state, &wanted);
        if let Goal::Stick { channel, amplitude, unit_s, pattern, .. } = goal {
            let unit = (self.elapsed / unit_s) as usize;
            sticks[channel] += amplitude * pattern.get(unit).copied().unwrap_or(0.0);
        }
        let follow = 1.0 - (-self.step_s / HAND_TIME_S).exp();
        for (channel, stick) in self.sticks.iter_mut().enumerate() {
            let restless = sticks[channel] + self.dither[channel].next(&mut self.random);
            *stick = (*stick + follow * (restless - *stick)).clamp(-1.0, 1.0);
        }
        self.elapsed += if started { self.step_s } else { 0.0 };
        if self.elapsed >= seconds {
            self.elapsed = 0.0;
            self.current += 1;
            self.broken_off = false;
        }
        self.sticks
    }

    /// Outer loop: velocity to thrust direction to rates.
    fn path(&mut self, state: &State, rotation: &[[f64; 3]; 3], course: &Course) -> Wanted {
        let Course { height, velocity: [ahead, right], climb, turns: [nose_turn, path_turn], inverted } = *course;
        self.heading += path_turn * self.step_s;
        self.nose += nose_turn * self.step_s;
        let (sine, cosine) = self.heading.sin_cos();
        let mut goal = [ahead * cosine - right * sine, ahead * sine + right * cosine, 0.0];
        let away = state.position[0].hypot(state.position[1]);
        if away > LEASH_M {
            let back = 0.25 * (away - LEASH_M) / away;
            goal = [goal[0] - back * state.position[0], goal[1] - back * state.position[1], 0.0];
        }
        let climb = match climb {
            // A commanded descent fades out well above the ground.
            Some(climb) => climb.max(HEIGHT_GAIN * (DESCENT_END_M + state.position[2])),
            // Towards the ground ever more slowly.
            None => (HEIGHT_GAIN * (height + state.position[2])).clamp((0.6 * state.position[2]).clamp(-3.5, 0.0), 4.5),
        };
        goal[2] = -climb;
        let achieved = to_local(rotation, state.velocity);
        let mut acceleration = [0.0; 3];
        for axis in 0..3 {
            let reach = SLEW_M_S2 * self.step_s;
            self.velocity[axis] += (goal[axis] - self.velocity[axis]).clamp(-reach, reach);
            let error = self.velocity[axis] - achieved[axis];
            self.velocity_sum[axis] = (self.velocity_sum[axis] + error * self.step_s).clamp(-6.0, 6.0);
            let gain = if axis == 2 { CLIMB_GAIN } else { VELOCITY_GAIN };
            acceleration[axis] = gain[0] * error + gain[1] * self.velocity_sum[axis];
        }
        // Falling fast: first stop that, then care for the rest.
        let limit = HORIZONTAL_M_S2 / (1.0 + (achieved[2] - 5.0).max(0.0));
        let horizontal = acceleration[0].hypot(acceleration[1]);
        let cut = (limit / horizontal.max(limit)).min(1.0);
        let vertical = acceleration[2].clamp(-9.0, 5.0);
        let force = [cut * acceleration[0], cut * acceleration[1], vertical - GRAVITY_M_S2];
        let turn = to_body(rotation, [0.0, 0.0, nose_turn]);
        self.aim(rotation, force, turn, inverted)
    }

    /// Rates and thrust that bring the mast onto a specific force (local axes, m/s²) with the nose on its heading.
    fn aim(&self, rotation: &[[f64; 3]; 3], force: [f64; 3], turn: [f64; 3], inverted: bool) -> Wanted {
        let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
        let sign = if inverted { 1.0 } else { -1.0 };
        let down = force.map(|f| sign * f / size);
        let (sine, cosine) = self.nose.sin_cos();
        let right = cross(down, [cosine, sine, 0.0]);
        let length = right.iter().map(|x| x * x).sum::<f64>().sqrt().max(0.1);
        let right = right.map(|x| x / length);
        let nose = cross(right, down);
        // Columns of the wanted rotation are nose, right, down; the error is taken into body axes.
        let [x, y, z] = [nose, right, down].map(|column| to_body(rotation, column));
        let error = quaternion([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]);
        let twice = 2.0_f64.copysign(error[3]);
        let rates =
            std::array::from_fn(|axis| (ATTITUDE_GAIN * twice * error[axis] + turn[axis]).clamp(-PATH_RATE_RAD_S, PATH_RATE_RAD_S));
        let mast = to_local(rotation, [0.0, 0.0, -1.0]);
        let thrust: f64 = force.iter().zip(mast).map(|(f, m)| f * m).sum();
        Wanted { rates, thrust }
    }

    /// Bank and pitch swept about hover, height held.
    fn lean(&mut self, state: &State, rotation: &[[f64; 3]; 3], height: f64, [bank, pitch, period]: [f64; 3]) -> Wanted {
        let phase = TAU * self.elapsed / period;
        let (bank, pitch) = (bank * phase.sin(), pitch * phase.sin());
        let half = |angle: f64| (0.5 * angle).sin_cos();
        let ((sb, cb), (sp, cp), (sn, cn)) = (half(bank), half(pitch), half(self.nose));
        let wanted = product(product([0.0, 0.0, sn, cn], [0.0, sp, 0.0, cp]), [sb, 0.0, 0.0, cb]);
        let [x, y, z, w] = state.attitude;
        let error = product([-x, -y, -z, w], wanted);
        let twice = 2.0_f64.copysign(error[3]);
        let rates = std::array::from_fn(|axis| (ATTITUDE_GAIN * twice * error[axis]).clamp(-PATH_RATE_RAD_S, PATH_RATE_RAD_S));
        self.velocity = to_local(rotation, state.velocity);
        let climb = 1.5 * (HEIGHT_GAIN * (height + state.position[2]).clamp(-4.0, 4.0) + self.velocity[2]);
        let thrust = (GRAVITY_M_S2 + climb) / rotation[2][2].abs().max(0.5) * rotation[2][2].signum();
        Wanted { rates, thrust }
    }

    /// Inner loop: sticks that give these rates and this thrust on the nominal machine.
    fn sticks_for(&mut self, state: &State, wanted: &Wanted) -> [f64; 4] {
        let mut sticks = [0.0; 4];
        for (axis, stick) in sticks.iter_mut().take(3).enumerate() {
            let error = wanted.rates[axis] - state.rate[axis];
            self.rate_sum[axis] = (self.rate_sum[axis] + error * self.step_s).clamp(-3.0, 3.0);
            let moment = RATE_GAIN[0] * error + RATE_GAIN[1] * self.rate_sum[axis] - COEFFICIENTS.b[axis] * wanted.rates[axis];
            *stick = ((moment - COEFFICIENTS.d2[axis]) / COEFFICIENTS.c2[axis]).clamp(-0.9, 0.9);
        }
        let thrust = wanted.thrust.clamp(-1.6 * GRAVITY_M_S2, 2.0 * GRAVITY_M_S2);
        let damping = (COEFFICIENTS.a[2] * state.velocity[2]).clamp(-FELT_DAMPING_M_S2, FELT_DAMPING_M_S2);
        let down = -thrust - COEFFICIENTS.d1_z - damping;
        sticks[3] = (down / COEFFICIENTS.c1_z).clamp(-0.95, 0.95);
        sticks
    }
}

/// Unit quaternion, scalar last, of a rotation matrix (Shepperd 1978: divide by the largest component).
fn quaternion(m: [[f64; 3]; 3]) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let sizes = [1.0 + 2.0 * m[0][0] - trace, 1.0 + 2.0 * m[1][1] - trace, 1.0 + 2.0 * m[2][2] - trace, 1.0 + trace];
    let largest = (0..4).fold(0, |best, index| if sizes[index] > sizes[best] { index } else { best });
    let [xy, xz, yz] = [m[1][0] + m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2]];
    let [wx, wy, wz] = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let size = sizes[largest];
    let row = match largest {
        0 => [size, xy, xz, wx],
        1 => [xy, size, yz, wy],
        2 => [xz, yz, size, wz],
        _ => [wx, wy, wz, size],
    };
    let length = 0.5 / size.sqrt();
    row.map(|x| x * length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_rotation_matrix_gives_back_its_quaternion(q in prop::array::uniform4(-1.0..1.0_f64)) {
            let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            prop_assume!(length > 0.1);
            let q = q.map(|x| x / length);
            let back = quaternion(rotation(q));
            let same: f64 = q.iter().zip(back).map(|(a, b)| a * b).sum();
            prop_assert!((same.abs() - 1.0).abs() < Tolerance::Close.relative_f64());
        }
    }
}
