//! From the true motion to the columns of a log: point of measurement, mounting, bias, delay, noise, zero-phase smoothing.

use super::Level;
use super::body::{cross, product, rotation, to_local};
use super::mechanisms::{Mechanism, Mechanisms};
use super::random::Random;
use crate::error::Result;
use crate::flight::{Column, Flight, Targets};

/// Noise at `Level::noise` 1, rms and white from sample to sample: m, rad, m/s, rad/s, m/s², rad/s².
const POSITION_M: f64 = 0.02;
const ATTITUDE_RAD: f64 = 0.003;
const VELOCITY_M_S: f64 = 0.02;
const RATE_RAD_S: f64 = 0.01;
const ACCELERATION_M_S2: f64 = 0.05;
const ANGULAR_RAD_S2: f64 = 0.10;
/// Mechanisms of the measurement at scale 1.
const LEVER_M: [f64; 3] = [0.08, 0.0, -0.06];
const MISALIGNMENT_RAD: [f64; 2] = [0.026, -0.0175];
const GYRO_BIAS_RAD_S: f64 = 0.02;
const VELOCITY_BIAS_M_S: f64 = 0.2;
const ATTITUDE_DELAY_S: f64 = 0.020;

/// The true motion at one log instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    /// North, east, down, m.
    pub(super) position: [f64; 3],
    /// Body to local, scalar last.
    pub(super) attitude: [f64; 4],
    /// Inertial velocity in body axes, m/s.
    pub(super) velocity: [f64; 3],
    /// Body rates, rad/s.
    pub(super) rate: [f64; 3],
    /// The sticks.
    pub(super) controls: [f64; 4],
    /// d(velocity)/dt of the body components, m/s².
    pub(super) acceleration: [f64; 3],
    /// d(rate)/dt, rad/s².
    pub(super) angular: [f64; 3],
}

fn plus(a: [f64; 3], b: [f64; 3], scale: f64) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + scale * b[axis])
}

/// A small rotation as a quaternion.
fn small([x, y, z]: [f64; 3]) -> [f64; 4] {
    unit([0.5 * x, 0.5 * y, 0.5 * z, 1.0])
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// What the instruments of one flight record of its motion.
///
/// # Errors
/// [`crate::Error::Log`] if the motion is empty or has become infinite.
pub(super) fn record(
    name: &str,
    manoeuvre: &str,
    step_s: f64,
    motion: &[Instant],
    level: &Level,
    mechanisms: &Mechanisms,
    mut random: Random,
) -> Result<Flight> {
    let scale = |mechanism| mechanisms.scale(mechanism);
    let lever = LEVER_M.map(|metres| metres * scale(Mechanism::ImuLever));
    let [roll, pitch] = MISALIGNMENT_RAD.map(|angle| angle * scale(Mechanism::TiltMisalign));
    let gyro_bias = random.normal3().map(|x| x * GYRO_BIAS_RAD_S * scale(Mechanism::SensorBias));
    let velocity_bias = random.normal3().map(|x| x * VELOCITY_BIAS_M_S * scale(Mechanism::SensorBias));
    let late = ATTITUDE_DELAY_S * scale(Mechanism::Sync) / step_s;
    let noise = level.noise;

    // Rows of what is smoothed: position 0-2, attitude 3-6, velocity 7-9, rate 10-12, controls 13-16, accelerations 17-22.
    let mut rows: [Vec<f64>; 23] = std::array::from_fn(|_| Vec::with_capacity(motion.len()));
    for (sample, now) in motion.iter().enumerate() {
        let back = (sample as f64 - late).max(0.0);
        let (at, part) = (back as usize, back.fract());
        let next = motion.get(at + 1).unwrap_or(now).attitude;
        let seen: [f64; 4] = std::array::from_fn(|i| motion[at].attitude[i] + part * (next[i] - motion[at].attitude[i]));
        let shake = plus([roll, pitch, 0.0], random.normal3(), noise * ATTITUDE_RAD);
        let attitude = product(unit(seen), small(shake));
        let point = to_local(&rotation(now.attitude), lever);
        let velocity = plus(plus(now.velocity, cross(now.rate, lever), 1.0), velocity_bias, 1.0);
        let blocks: [&[f64]; 7] = [
            &plus(plus(now.position, point, 1.0), random.normal3(), noise * POSITION_M),
            &attitude,
            &plus(velocity, random.normal3(), noise * VELOCITY_M_S),
            &plus(plus(now.rate, gyro_bias, 1.0), random.normal3(), noise * RATE_RAD_S),
            &now.controls,
            &plus(plus(now.acceleration, cross(now.angular, lever), 1.0), random.normal3(), noise * ACCELERATION_M_S2),
            &plus(now.angular, random.normal3(), noise * ANGULAR_RAD_S2),
        ];
        rows.iter_mut().zip(blocks.iter().copied().flatten()).for_each(|(row, value)| row.push(*value));
    }
    if let Some(cutoff_hz) = level.smoothing_hz {
        let filter = LowPass::new(cutoff_hz * step_s);
        rows.iter_mut().for_each(|row| filter.both_ways(row));
    }
    let [x, y, z, qx, qy, qz, qw, vx, vy, vz, p, q, r, u1, u2, u3, u4, ax, ay, az, ap, aq, ar] = rows;
    let mut angles: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(motion.len()));
    for sample in 0..motion.len() {
        let euler = euler(unit([qx[sample], qy[sample], qz[sample], qw[sample]]));
        angles.iter_mut().zip(euler).for_each(|(angle, value)| angle.push(value));
    }
    let [roll, pitch, yaw] = angles;
    let columns: [Vec<f64>; Column::COUNT] =
        [x, y, z, roll, pitch, yaw, vx, vy, vz, p, q, r, u1, u2, u3, u4, ax, ay, az, ap, aq, ar];
    Flight::new(name, manoeuvre, 0.0, step_s, columns, Targets::Recorded)
}

/// ZYX Euler angles of a unit quaternion: roll, pitch, yaw.
fn euler(q: [f64; 4]) -> [f64; 3] {
    let m = rotation(q);
    [m[2][1].atan2(m[2][2]), (-m[2][0]).clamp(-1.0, 1.0).asin(), m[1][0].atan2(m[0][0])]
}

/// Second-order Butterworth low-pass, run forwards and backwards: no phase, fourth order, as the Kalman smoother of the real
/// set has no phase. Being linear and the same for all columns, it leaves equations that are linear in the columns intact.
struct LowPass {
    feed: f64,
    back: [f64; 2],
}

impl LowPass {
    /// `cutoff` in cycles per sample, below one half.
    fn new(cutoff: f64) -> Self {
        let k = (std::f64::consts::PI * cutoff.clamp(1e-4, 0.49)).tan();
        let scale = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        Self { feed: k * k * scale, back: [2.0 * (k * k - 1.0) * scale, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * scale] }
    }

    fn forwards<'a>(&self, samples: impl Iterator<Item = &'a mut f64>, start: f64) {
        let (mut x1, mut x2, mut y1, mut y2) = (start, start, start, start);
        for sample in samples {
            let x = *sample;
            let y = self.feed * (x + 2.0 * x1 + x2) - self.back[0] * y1 - self.back[1] * y2;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            *sample = y;
        }
    }

    fn both_ways(&self, samples: &mut [f64]) {
        let first = samples.first().copied().unwrap_or_default();
        self.forwards(samples.iter_mut(), first);
        let last = samples.last().copied().unwrap_or_default();
        self.forwards(samples.iter_mut().rev(), last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    #[test]
    fn smoothing_keeps_constants_and_has_no_phase() {
        let filter = LowPass::new(0.08);
        let mut constant = vec![3.0; 200];
        filter.both_ways(&mut constant);
        assert!(constant.iter().all(|x| (x - 3.0).abs() < Tolerance::Close.relative_f64() * 3.0));
        let mut pulse = vec![0.0; 401];
        pulse[200] = 1.0;
        filter.both_ways(&mut pulse);
        let lopsided = (1..150).map(|k| (pulse[200 + k] - pulse[200 - k]).abs()).fold(0.0, f64::max);
        assert!(lopsided < Tolerance::Close.relative_f64(), "{lopsided}");
        // Two passes at the corner frequency leave half.
        let mut wave: Vec<f64> = (0..2000).map(|k| (std::f64::consts::TAU * 0.08 * f64::from(k)).sin()).collect();
        filter.both_ways(&mut wave);
        let peak = wave[500..1500].iter().fold(0.0_f64, |best, x| best.max(x.abs()));
        assert!((0.49..0.51).contains(&peak), "{peak}");
    }
}
