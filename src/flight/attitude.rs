//! Attitude: ZYX Euler angles, unit quaternions (scalar last) and rotation matrices, and the change of axes conventions.
//!
//! Geometry only: what gravity does to the aircraft is physics; here stands just the gravity vector written in body axes.
//! Convention (paper eqs. 1-4): R_b^in takes body components to inertial ones, R_b^in = R_z(yaw) R_y(pitch) R_x(roll).

use super::GRAVITY_M_S2;
use std::f64::consts::FRAC_PI_2;

/// A 3x3 matrix, row-major.
pub type Matrix3 = [[f64; 3]; 3];

/// R_b^in from ZYX Euler angles in rad: body components to inertial components (paper eq. 2).
pub fn rotation_body_to_inertial(roll: f64, pitch: f64, yaw: f64) -> Matrix3 {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
}

/// Gravity in body axes, R_in^b [0, 0, g₀]ᵀ, m/s² (paper eqs. 3-4): g₀ times the third row of R_b^in.
pub fn gravity_body(roll: f64, pitch: f64) -> [f64; 3] {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    [-GRAVITY_M_S2 * sp, GRAVITY_M_S2 * cp * sr, GRAVITY_M_S2 * cp * cr]
}

/// Rates of the ZYX Euler angles `[roll', pitch', yaw']`, rad/s, from the body rates ω, rad/s.
///
/// Infinite at pitch = ±90°, where the angles themselves jump.
/// Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, 3rd ed., eq. 1.4-4.
pub fn euler_rates(roll: f64, pitch: f64, rates: [f64; 3]) -> [f64; 3] {
    let (sr, cr) = roll.sin_cos();
    let across = rates[1] * sr + rates[2] * cr;
    [rates[0] + across * pitch.tan(), rates[1] * cr - rates[2] * sr, across / pitch.cos()]
}

/// Body rates of the rates of roll, pitch and yaw, rad/s: the way back of [`euler_rates`], at any pitch (Stevens, Lewis & Johnson, Aircraft Control and
/// Simulation, 3rd ed., eq. 1.4-3).
pub fn body_rates(roll: f64, pitch: f64, [roll_rate, pitch_rate, yaw_rate]: [f64; 3]) -> [f64; 3] {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    [roll_rate - yaw_rate * sp, pitch_rate * cr + yaw_rate * sr * cp, yaw_rate * cr * cp - pitch_rate * sr]
}

/// R v.
pub fn rotate(matrix: &Matrix3, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| dot(row, vector))
}

/// Rᵀ v: the way back of [`rotate`].
pub fn rotate_back(matrix: &Matrix3, vector: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|column| (0..3).map(|row| matrix[row][column] * vector[row]).sum())
}

/// a × b.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a · b.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Unit quaternion `[q1, q2, q3, q4]`, scalar last (paper eq. 1), of the rotation body → inertial.
pub fn euler_to_quaternion(roll: f64, pitch: f64, yaw: f64) -> [f64; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) = ((roll / 2.0).sin_cos(), (pitch / 2.0).sin_cos(), (yaw / 2.0).sin_cos());
    [sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy]
}

/// ZYX Euler angles `[roll, pitch, yaw]` in rad of a quaternion (scalar last, body → inertial) of any positive norm.
///
/// Roll and yaw are in (−π, π], pitch in [−π/2, π/2]. At pitch = ±π/2 only yaw ∓ roll is determined; roll is then 0.
pub fn quaternion_to_euler(quaternion: [f64; 4]) -> [f64; 3] {
    rotation_to_euler(&quaternion_to_rotation(quaternion))
}

/// R_b^in of a quaternion (scalar last, body → inertial) of any positive norm.
pub fn quaternion_to_rotation(quaternion: [f64; 4]) -> Matrix3 {
    let scale = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt().recip();
    let [x, y, z, w] = quaternion.map(|part| part * scale);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// ZYX Euler angles `[roll, pitch, yaw]` in rad of R_b^in. Ranges and the singular case as in [`quaternion_to_euler`].
pub fn rotation_to_euler(matrix: &Matrix3) -> [f64; 3] {
    // cos(pitch) from the first column: exact near ±90°, where asin of the third row loses half of the digits.
    let level = matrix[0][0].hypot(matrix[1][0]);
    let pitch = (-matrix[2][0]).atan2(level);
    if level > f64::EPSILON {
        [matrix[2][1].atan2(matrix[2][2]), pitch, matrix[1][0].atan2(matrix[0][0])]
    } else {
        [0.0, pitch, (-matrix[0][1]).atan2(matrix[1][1])]
    }
}

/// Order in which a log writes a unit quaternion. The program itself knows [`QuaternionOrder::ScalarLast`] only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// x, y, z, w (paper eq. 1; ROS, motion capture).
    #[default]
    ScalarLast,
    /// w, x, y, z (PX4, ArduPilot, Eigen's constructor).
    ScalarFirst,
}

impl QuaternionOrder {
    /// Names as written in `dataset.toml`.
    pub const NAMES: [(&'static str, Self); 2] = [("xyzw", Self::ScalarLast), ("wxyz", Self::ScalarFirst)];

    /// Four numbers in this order, as a quaternion with the scalar last.
    pub fn scalar_last(self, [a, b, c, d]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::ScalarLast => [a, b, c, d],
            Self::ScalarFirst => [b, c, d, a],
        }
    }

    /// A quaternion with the scalar last, in this order.
    pub fn written(self, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::ScalarLast => [x, y, z, w],
            Self::ScalarFirst => [w, x, y, z],
        }
    }

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::ScalarLast => Self::ScalarFirst,
            Self::ScalarFirst => Self::ScalarLast,
        }
    }
}

/// Axes that logs are written in. The program itself knows [`Axes::NedFrd`] only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axes {
    /// North-east-down; body nose-starboard-down.
    #[default]
    NedFrd,
    /// East-north-up; body nose-port-up (ROS REP 103). Yaw is counted from east, counterclockwise seen from above.
    EnuFlu,
    /// x forward or north, y left or west, z up; body nose-port-up: motion capture and small-drone logs.
    NwuFlu,
}

impl Axes {
    /// Names as written in `dataset.toml`.
    pub const NAMES: [(&'static str, Self); 3] = [("NED/FRD", Self::NedFrd), ("ENU/FLU", Self::EnuFlu), ("NWU/FLU", Self::NwuFlu)];

    /// Inertial components (position, inertial velocity) in north-east-down.
    pub fn inertial_to_ned(self, [a, b, c]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::NedFrd => [a, b, c],
            Self::EnuFlu => [b, a, -c],
            Self::NwuFlu => [a, -b, -c],
        }
    }

    /// Body components (velocity, rates, specific force) in nose-starboard-down.
    pub fn body_to_frd(self, [a, b, c]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::NedFrd => [a, b, c],
            Self::EnuFlu | Self::NwuFlu => [a, -b, -c],
        }
    }

    /// ZYX Euler angles, rad, of these axes as ZYX Euler angles from NED to FRD.
    ///
    /// With F = diag(1, −1, −1) and T the change of inertial axes, T R_z(ψ) R_y(θ) R_x(φ) F = R_z(ψ') R_y(−θ) R_x(φ), where
    /// ψ' is −ψ (NWU) or π/2 − ψ (ENU). Yaw is not wrapped: an unwrapped record stays one.
    pub fn euler_to_ned(self, [roll, pitch, yaw]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::NedFrd => [roll, pitch, yaw],
            Self::EnuFlu => [roll, -pitch, FRAC_PI_2 - yaw],
            Self::NwuFlu => [roll, -pitch, -yaw],
        }
    }
}

/// The rotation vector, rad, from one attitude (unit quaternion, scalar last) to another, in the axes of the first.
pub fn rotation_vector(from: [f64; 4], to: [f64; 4]) -> [f64; 3] {
    let [ax, ay, az, aw] = from;
    let [bx, by, bz, bw] = to;
    let vector =
        [aw * bx - ax * bw - ay * bz + az * by, aw * by + ax * bz - ay * bw - az * bx, aw * bz - ax * by + ay * bx - az * bw];
    let scalar = ax * bx + ay * by + az * bz + aw * bw;
    let sine = dot(vector, vector).sqrt();
    // A quaternion and its negative are one attitude; a turn by nothing has no axis.
    let angle = 2.0 * sine.atan2(scalar.abs());
    let factor = if sine > 0.0 { angle / sine * scalar.signum() } else { 0.0 };
    vector.map(|part| part * factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    fn near(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= CLOSE * b.abs().max(1.0))
    }

    fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
        std::array::from_fn(|row| std::array::from_fn(|column| (0..3).map(|k| a[row][k] * b[k][column]).sum()))
    }

    #[test]
    fn a_climbing_right_turn_points_where_it_should() {
        // Nose up 30°, heading east: the nose points east and up; rolled right, gravity pulls to starboard.
        let nose = rotate(&rotation_body_to_inertial(0.3, PI / 6.0, FRAC_PI_2), [1.0, 0.0, 0.0]);
        assert!(near(&nose, &[0.0, 0.75_f64.sqrt(), -0.5]));
        assert!(gravity_body(0.3, 0.0)[1] > 0.0 && gravity_body(0.0, 0.3)[0] < 0.0);
    }

    #[test]
    fn the_singular_attitude_keeps_its_rotation() {
        for pitch in [FRAC_PI_2, -FRAC_PI_2] {
            let quaternion = euler_to_quaternion(0.4, pitch, 1.1);
            let [roll, pitch, yaw] = quaternion_to_euler(quaternion);
            let (a, b) = (quaternion_to_rotation(quaternion), rotation_body_to_inertial(roll, pitch, yaw));
            assert!(a.iter().zip(&b).all(|(a, b)| near(a, b)), "{a:?} against {b:?}");
        }
    }

    proptest! {
        #[test]
        fn the_turn_from_one_attitude_to_another_leads_there(
            q in prop::array::uniform4(-1.0..1.0_f64), by in prop::array::uniform3(-1.7..1.7_f64), sign in prop::bool::ANY,
        ) {
            let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
            prop_assume!(length > 0.1 && dot(by, by).sqrt() < 3.1);
            let [x, y, z, w] = q.map(|part| part / length);
            let angle = dot(by, by).sqrt();
            let half = if angle > 0.0 { (0.5 * angle).sin() / angle } else { 0.5 };
            let ([a, b, c], s) = (by.map(|part| part * half), (0.5 * angle).cos());
            let to = [w * a + x * s + y * c - z * b, w * b + y * s + z * a - x * c, w * c + z * s + x * b - y * a, w * s - x * a - y * b - z * c];
            let to = if sign { to } else { to.map(|part| -part) };
            let found = rotation_vector([x, y, z, w], to);
            prop_assert!((0..3).all(|axis| (found[axis] - by[axis]).abs() <= CLOSE), "{:?} {:?}", found, by);
        }

        #[test]
        fn rotations_are_orthogonal_and_gravity_is_their_third_row(roll in -PI..PI, pitch in -1.57..1.57, yaw in -10.0..10.0) {
            let matrix = rotation_body_to_inertial(roll, pitch, yaw);
            for row in 0..3 {
                for column in 0..3 {
                    let identity = f64::from(u8::from(row == column));
                    prop_assert!((dot(matrix[row], matrix[column]) - identity).abs() <= CLOSE);
                }
            }
            prop_assert!(near(&cross(matrix[0], matrix[1]), &matrix[2]));
            prop_assert!(near(&gravity_body(roll, pitch), &matrix[2].map(|part| part * GRAVITY_M_S2)));
            let vector = [1.0, -2.0, 3.0];
            prop_assert!(near(&rotate_back(&matrix, rotate(&matrix, vector)), &vector));
        }

        #[test]
        fn euler_quaternion_and_matrix_agree(roll in -3.1..3.1, pitch in -1.5..1.5, yaw in -3.1..3.1, norm in 0.5..2.0) {
            let quaternion = euler_to_quaternion(roll, pitch, yaw).map(|part| part * norm);
            prop_assert!(near(&quaternion_to_euler(quaternion), &[roll, pitch, yaw]));
            prop_assert!(near(&rotation_to_euler(&rotation_body_to_inertial(roll, pitch, yaw)), &[roll, pitch, yaw]));
        }

        #[test]
        fn euler_rates_are_the_derivative_of_the_angles(
            roll in -3.0..3.0, pitch in -1.4..1.4, yaw in -3.0..3.0, p in -3.0..3.0, q in -3.0..3.0, r in -3.0..3.0,
        ) {
            // R' = R [ω]×, so after a short time dt the matrix is R (I + dt [ω]×) up to dt².
            let dt = 1e-6;
            let [a, b, c] = [p, q, r].map(|rate: f64| rate * dt);
            let step = [[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]];
            let after = rotation_to_euler(&product(&rotation_body_to_inertial(roll, pitch, yaw), &step));
            let rates = euler_rates(roll, pitch, [p, q, r]);
            for ((after, before), rate) in after.iter().zip([roll, pitch, yaw]).zip(rates) {
                // Truncation of the step is of order dt ω² / cos² pitch, and ω² / cos² is below 2000 here.
                prop_assert!(((after - before) / dt - rate).abs() <= dt * 2000.0);
            }
        }

        #[test]
        fn body_rates_are_the_way_back_of_euler_rates(
            roll in -3.0..3.0, pitch in -1.4..1.4, p in -3.0..3.0, q in -3.0..3.0, r in -3.0..3.0,
        ) {
            let back = body_rates(roll, pitch, euler_rates(roll, pitch, [p, q, r]));
            prop_assert!(near(&back, &[p, q, r]), "{back:?}");
        }

        #[test]
        fn axes_conversions_are_the_same_rotation(roll in -3.0..3.0, pitch in -1.5..1.5, yaw in -3.0..3.0) {
            let body = [0.3, -1.2, 2.0];
            for (_, axes) in Axes::NAMES {
                let inertial = axes.inertial_to_ned(rotate(&rotation_body_to_inertial(roll, pitch, yaw), body));
                let [r, p, y] = axes.euler_to_ned([roll, pitch, yaw]);
                prop_assert!(near(&rotate(&rotation_body_to_inertial(r, p, y), axes.body_to_frd(body)), &inertial));
            }
        }
    }
}
