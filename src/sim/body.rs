//! The equations of motion: a rigid body with quaternion, and on it the paper's baseline plus every mechanism that is on.
//!
//! With every mechanism off the accelerations are exactly eqs. 14-15 plus the gusts. The rotation code here is this simulator's
//! own. Servo delay and rate limit are in `actuators.rs`, what a sensor makes of the motion in `sensors.rs`.

use super::mechanisms::{Mechanism, Mechanisms};
use super::rotor::{Rotor, ground_effect, stall, vortex_ring};
use super::vehicle::{
    AIR_DENSITY_KG_M3, COEFFICIENTS, Coefficients, FIN_AREA_M2, FIN_LIFT_SLOPE, FLAP_TIME_S, FUSELAGE_AREA_M2, HOVER_TORQUE_N_M,
    HUB_HEIGHT_M, INERTIA_KG_M2, MASS_KG, ROTOR_DAMPING_SHARE, ROTOR_SPEED_RAD_S, TAIL_ARM_M,
};
use super::wind::Disturbance;
use crate::flight::GRAVITY_M_S2;

/// Time constant of the tail servo with its gyro, s, at scale 1.
const TAIL_TIME_S: f64 = 0.060;
/// Time constant of the collective servo, s, at scale 1.
const COLLECTIVE_TIME_S: f64 = 0.060;
/// Time constant of rotor speed and governor, s.
const DROOP_TIME_S: f64 = 0.4;
/// Steady loss of rotor speed per hover power beyond hover, at scale 1.
const DROOP: f64 = 0.05;
/// Product of inertia Ixz at scale 1, kg m².
const INERTIA_XZ_KG_M2: f64 = 0.025;
/// Thrust axis tilt per unit of cyclic, rad, at scale 1.
const TILT_RAD: f64 = 0.08;
/// Offset of the centre of mass from the mast, forward and to starboard, m, at scale 1 (the thrust acts opposite to it).
const CG_OFFSET_M: [f64; 2] = [0.008, 0.005];

/// Everything that moves, flat for the integrator.
pub(super) type Flat = [f64; 19];

/// The state of the aircraft by name.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// North, east, down, m.
    pub(super) position: [f64; 3],
    /// Body to local, scalar last.
    pub(super) attitude: [f64; 4],
    /// Inertial velocity in body axes, m/s.
    pub(super) velocity: [f64; 3],
    /// Body rates, rad/s.
    pub(super) rate: [f64; 3],
    /// Lateral and longitudinal flapping in units of cyclic.
    pub(super) flap: [f64; 2],
    /// Tail and collective behind their servo lags.
    pub(super) servo: [f64; 2],
    /// Induced velocity, m/s.
    pub(super) induced: f64,
    /// Rotor speed over its nominal value.
    pub(super) rotor_speed: f64,
}

impl State {
    pub(super) fn flat(&self) -> Flat {
        let ([x, y, z], [a, b, c, d], [u, v, w], [p, q, r]) = (self.position, self.attitude, self.velocity, self.rate);
        let ([b1, a1], [tail, collective]) = (self.flap, self.servo);
        [x, y, z, a, b, c, d, u, v, w, p, q, r, b1, a1, tail, collective, self.induced, self.rotor_speed]
    }

    pub(super) fn from_flat(flat: &Flat) -> Self {
        let [x, y, z, a, b, c, d, u, v, w, p, q, r, b1, a1, tail, collective, induced, rotor_speed] = *flat;
        Self {
            position: [x, y, z],
            attitude: [a, b, c, d],
            velocity: [u, v, w],
            rate: [p, q, r],
            flap: [b1, a1],
            servo: [tail, collective],
            induced,
            rotor_speed,
        }
    }
}

/// Rotation from body to local axes of a unit quaternion, scalar last (paper eq. 3).
pub(super) fn rotation([x, y, z, w]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// R v.
pub(super) fn to_local(rotation: &[[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    rotation.map(|row| row[0] * x + row[1] * y + row[2] * z)
}

/// Rᵀ v.
pub(super) fn to_body(rotation: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| rotation[0][axis] * v[0] + rotation[1][axis] * v[1] + rotation[2][axis] * v[2])
}

pub(super) fn cross([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Product of two quaternions, scalar last: the rotation `right` first, then `left`.
pub(super) fn product([a, b, c, d]: [f64; 4], [x, y, z, w]: [f64; 4]) -> [f64; 4] {
    [d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z]
}

/// The aircraft with the mechanisms it has.
#[derive(Clone, Debug)]
pub(super) struct Body {
    on: Mechanisms,
    rotor: Rotor,
    /// Whether any mechanism needs blade element theory.
    blade_element: bool,
}

impl Body {
    pub(super) fn new(mechanisms: &Mechanisms) -> Self {
        use Mechanism::{ClimbInflow, InflowLag, ThrustCurve, TranslLift};
        let blade_element = [ThrustCurve, TranslLift, ClimbInflow, InflowLag].iter().any(|&m| mechanisms.has(m));
        Self { on: mechanisms.clone(), rotor: Rotor::new(), blade_element }
    }

    /// At rest in the air, level, at a height (m) and heading (rad).
    pub(super) fn hover(&self, height: f64, heading: f64) -> State {
        let collective = (-GRAVITY_M_S2 - COEFFICIENTS.d1_z) / COEFFICIENTS.c1_z;
        State {
            position: [0.0, 0.0, -height],
            attitude: [0.0, 0.0, (0.5 * heading).sin(), (0.5 * heading).cos()],
            velocity: [0.0; 3],
            rate: [0.0; 3],
            flap: [0.0; 2],
            servo: [0.0, collective],
            induced: self.rotor.hover_induced,
            rotor_speed: 1.0,
        }
    }

    /// Collective part of the specific thrust, up: the baseline's line plus the differences of blade element theory. Also the
    /// rate of the induced velocity.
    fn thrust(&self, collective: f64, axial: f64, in_plane: f64, induced: f64) -> (f64, f64) {
        let line = -(COEFFICIENTS.c1_z * collective + COEFFICIENTS.d1_z);
        if !self.blade_element {
            return (line, 0.0);
        }
        let scale = |mechanism| self.on.scale(mechanism);
        let rotor = &self.rotor;
        let still = rotor.thrust(collective, 0.0, 0.0);
        let along = rotor.thrust(collective, 0.0, in_plane);
        let full = rotor.thrust(collective, axial, in_plane);
        let lagged = rotor.blade_thrust(collective, axial, in_plane, induced);
        let thrust = line
            + scale(Mechanism::ThrustCurve) * (still - line)
            + scale(Mechanism::TranslLift) * (along - still)
            + scale(Mechanism::ClimbInflow) * (full - along - rotor.hover_damping * axial)
            + scale(Mechanism::InflowLag) * (lagged - full);
        (thrust, rotor.induced_rate(collective, axial, in_plane, induced))
    }

    /// Time derivative of the state under the controls that leave the servos; `burnt` is the share of the flight that is over.
    pub(super) fn derivative(&self, flat: &Flat, controls: [f64; 4], disturbance: &Disturbance, burnt: f64) -> Flat {
        let state = State::from_flat(flat);
        let scale = |mechanism| self.on.scale(mechanism);
        let Coefficients { a, b, c2, d2, .. } = COEFFICIENTS;
        let [p, q, r] = state.rate;
        let rotation = rotation(state.attitude);
        let air = to_body(&rotation, disturbance.air);
        let v: [f64; 3] = std::array::from_fn(|axis| state.velocity[axis] - air[axis]);
        let (in_plane, speed) = (v[0].hypot(v[1]), norm(v));

        // Controls: linkage, servo lags, flapping. Each lagged value is the quasi-steady one when its lag is off.
        let expo = 0.2 * scale(Mechanism::CtrlNonlin);
        let u = controls.map(|u| u * (1.0 - expo) + expo * u * u * u);
        let lag = |mechanism, time_s: f64, steady: f64, value: f64| {
            let scale = self.on.scale(mechanism);
            if scale > 0.0 { (value, (steady - value) / (time_s * scale)) } else { (steady, 0.0) }
        };
        let tail = lag(Mechanism::TailLag, TAIL_TIME_S, u[2], state.servo[0]);
        let collective = lag(Mechanism::CollectiveLag, COLLECTIVE_TIME_S, u[3], state.servo[1]);
        let steady_flap = |axis: usize, rate: f64| u[axis] + ROTOR_DAMPING_SHARE * b[axis] / c2[axis] * rate;
        let lateral = lag(Mechanism::CyclicLag, FLAP_TIME_S, steady_flap(0, p), state.flap[0]);
        let longitudinal = lag(Mechanism::CyclicLag, FLAP_TIME_S, steady_flap(1, q), state.flap[1]);

        // Thrust along the mast, up. The baseline's heave damping is the rotor's, too: what changes the thrust changes the whole of it.
        let (thrust, induced_rate) = self.thrust(collective.0, v[2], in_plane, state.induced);
        let undisturbed = thrust - a[2] * v[2];
        let speed_squared = if self.on.has(Mechanism::RotorDroop) { state.rotor_speed * state.rotor_speed } else { 1.0 };
        let mut whole = undisturbed * speed_squared;
        if self.on.has(Mechanism::VortexRing) {
            let descent = v[2] * whole.signum();
            let depth = vortex_ring(descent, in_plane, self.rotor.hover_induced);
            whole *= 1.0 - scale(Mechanism::VortexRing) * depth * (0.25 + 0.1 * disturbance.roughness);
        }
        if self.on.has(Mechanism::GroundEffect) {
            let gain = ground_effect(HUB_HEIGHT_M - state.position[2], speed, self.rotor.hover_induced);
            whole *= 1.0 + scale(Mechanism::GroundEffect) * (gain - 1.0);
        }
        if self.on.has(Mechanism::StallSaturation) {
            whole = stall(whole, 1.3 * GRAVITY_M_S2 / scale(Mechanism::StallSaturation));
        }
        // What is added to the heave damping, which the baseline has by itself.
        let thrust = thrust + (whole - undisturbed);
        let load = whole / GRAVITY_M_S2;
        let power = 0.2 + 0.8 * load.abs().powf(1.5) - load * v[2] / self.rotor.hover_induced * 0.8;
        let droop = 1.0 - scale(Mechanism::RotorDroop) * DROOP * (power - 1.0) - state.rotor_speed;

        let force = self.force(&Air { v, speed }, [thrust, whole], [lateral.0, longitudinal.0], tail.0);
        let lighter = 1.0 / (1.0 - 0.1 * scale(Mechanism::MassDrift) * burnt);
        let gravity = to_body(&rotation, [0.0, 0.0, GRAVITY_M_S2]);
        let turning = cross(state.rate, state.velocity);
        let acceleration: [f64; 3] = std::array::from_fn(|axis| {
            gravity[axis] - turning[axis] + lighter * (a[axis] * v[axis] + force[axis]) + disturbance.force[axis]
        });

        // Angular acceleration times the diagonal inertia is the moment; the gyroscopic term uses the tensor there is.
        let extra = self.moment(&Air { v, speed }, state.rate, whole, [u[0], u[1], tail.0, collective.0]);
        let damping = [(1.0 - ROTOR_DAMPING_SHARE) * b[0] * p, (1.0 - ROTOR_DAMPING_SHARE) * b[1] * q, b[2] * r];
        let controlled = [lateral.0, longitudinal.0, tail.0];
        let direct: [f64; 3] = std::array::from_fn(|axis| {
            speed_squared * c2[axis] * controlled[axis] + damping[axis] + d2[axis] + extra[axis] + disturbance.moment[axis]
        });
        let angular = self.angular_acceleration(state.rate, direct);

        let [qx, qy, qz, qw] = product(state.attitude, [p, q, r, 0.0]).map(|x| 0.5 * x);
        let [vn, ve, vd] = to_local(&rotation, state.velocity);
        let [au, av, aw] = acceleration;
        let [ap, aq, ar] = angular;
        let induced_rate = if self.on.has(Mechanism::InflowLag) { induced_rate } else { 0.0 };
        let droop_rate = if self.on.has(Mechanism::RotorDroop) { droop / DROOP_TIME_S } else { 0.0 };
        [
            vn,
            ve,
            vd,
            qx,
            qy,
            qz,
            qw,
            au,
            av,
            aw,
            ap,
            aq,
            ar,
            lateral.1,
            longitudinal.1,
            tail.1,
            collective.1,
            induced_rate,
            droop_rate,
        ]
    }

    /// Specific aerodynamic force beyond A v, m/s²; thrust without and with the heave damping.
    fn force(&self, air: &Air, [thrust, whole]: [f64; 2], flap: [f64; 2], tail: f64) -> [f64; 3] {
        let scale = |mechanism| self.on.scale(mechanism);
        let Air { v, speed } = *air;
        let drag = scale(Mechanism::QuadDrag) * -0.5 * AIR_DENSITY_KG_M3 / MASS_KG * speed;
        let cross = scale(Mechanism::VelCross);
        // The disc tilts with the flapping: aft for a nose-up, to starboard for a right-roll cyclic.
        let tilt = scale(Mechanism::FlapTilt) * TILT_RAD * whole;
        let side = scale(Mechanism::TailSideForce) * COEFFICIENTS.c2[2] * INERTIA_KG_M2[2] / (MASS_KG * TAIL_ARM_M);
        let mut force = [
            drag * FUSELAGE_AREA_M2[0] * v[0] + cross * (0.06 * v[1] + 0.10 * v[2]) - tilt * flap[1],
            drag * FUSELAGE_AREA_M2[1] * v[1] + cross * (-0.06 * v[0] - 0.08 * v[2]) + tilt * flap[0] - side * tail,
            drag * FUSELAGE_AREA_M2[2] * v[2] + cross * (0.08 * v[0] + 0.04 * v[1]) - thrust,
        ];
        if self.on.has(Mechanism::FuselageWake) {
            // Gavrilets: the fuselage sees the induced velocity on top of the axial one.
            let wake = self.rotor.hover_induced * (whole.abs() / GRAVITY_M_S2).sqrt().copysign(whole);
            let washed = norm([v[0], v[1], v[2] + wake]);
            let factor = scale(Mechanism::FuselageWake) * -0.5 * AIR_DENSITY_KG_M3 / MASS_KG;
            let seen = [v[0], v[1], v[2] + wake];
            for axis in 0..3 {
                force[axis] += factor * FUSELAGE_AREA_M2[axis] * (washed * seen[axis] - speed * v[axis]);
            }
        }
        force
    }

    /// Angular acceleration beyond B ω + C₂ u + D₂, rad/s²; `u` are the controls behind linkage and servos.
    fn moment(&self, air: &Air, rate: [f64; 3], thrust: f64, u: [f64; 4]) -> [f64; 3] {
        let scale = |mechanism| self.on.scale(mechanism);
        let Air { v, speed } = *air;
        let [p, q, r] = rate;
        let (b, c2) = (COEFFICIENTS.b, COEFFICIENTS.c2);
        let load = thrust / GRAVITY_M_S2;
        let phase = scale(Mechanism::CtrlCross) * 0.105;
        let arm = CG_OFFSET_M.map(|metres| scale(Mechanism::CgOffset) * metres * MASS_KG * thrust);
        let fin = 0.5 * AIR_DENSITY_KG_M3 * FIN_AREA_M2 * FIN_LIFT_SLOPE * TAIL_ARM_M / INERTIA_KG_M2[2];
        let torque = HOVER_TORQUE_N_M / INERTIA_KG_M2[2];
        let climb = MASS_KG * thrust / (ROTOR_SPEED_RAD_S * INERTIA_KG_M2[2]);
        let damping = scale(Mechanism::SpeedDamping) * 0.025 * speed;
        let along = v[0].hypot(v[1]);
        let wake = (v[0] - 7.0) / 2.0;
        let stab = scale(Mechanism::DihedralSpeedstab);
        [
            phase * (c2[0] * u[1] - 30.0 * u[3]) + scale(Mechanism::RateCross) * 2.2 * q - stab * 0.5 * v[1]
                + arm[1] / INERTIA_KG_M2[0]
                + damping * b[0] * p,
            phase * (-c2[1] * u[0] + 20.0 * u[3]) - scale(Mechanism::RateCross) * 1.8 * p + stab * 0.4 * v[0]
                - arm[0] / INERTIA_KG_M2[1]
                + damping * b[1] * q
                + scale(Mechanism::TailWake) * 4.0 * (-wake * wake).exp(),
            phase * (20.0 * u[0] - 10.0 * u[1]) - scale(Mechanism::CollectiveTorque) * torque * load.abs().powf(1.5)
                + scale(Mechanism::HeaveTorque) * climb * v[2]
                + scale(Mechanism::Weathercock) * fin * speed * v[1]
                + damping * b[2] * r
                + scale(Mechanism::TailRotorInflow) * (0.02 * along * c2[2] * u[2] - 0.25 * r * r.abs()),
        ]
    }

    /// Euler's equation: `direct` is the moment over the diagonal inertia.
    fn angular_acceleration(&self, [p, q, r]: [f64; 3], direct: [f64; 3]) -> [f64; 3] {
        let [ix, iy, iz] = INERTIA_KG_M2;
        let xz = INERTIA_XZ_KG_M2 * self.on.scale(Mechanism::InertiaCross);
        // I ω with Ixz entering with a minus sign off the diagonal.
        let momentum = [ix * p - xz * r, iy * q, iz * r - xz * p];
        let turning = cross([p, q, r], momentum);
        let moment = [ix * direct[0] - turning[0], iy * direct[1] - turning[1], iz * direct[2] - turning[2]];
        if xz == 0.0 {
            return [moment[0] / ix, moment[1] / iy, moment[2] / iz];
        }
        let determinant = ix * iz - xz * xz;
        [(iz * moment[0] + xz * moment[2]) / determinant, moment[1] / iy, (xz * moment[0] + ix * moment[2]) / determinant]
    }

    /// One step of the classical fourth-order Runge-Kutta method with the controls at its start, middle and end.
    pub(super) fn step(&self, flat: &mut Flat, controls: [[f64; 4]; 3], disturbance: &Disturbance, burnt: f64, step_s: f64) {
        let slope = |at: &Flat, controls| self.derivative(at, controls, disturbance, burnt);
        let ahead = |slope: &Flat, part: f64| -> Flat { std::array::from_fn(|i| flat[i] + part * step_s * slope[i]) };
        let k1 = slope(flat, controls[0]);
        let k2 = slope(&ahead(&k1, 0.5), controls[1]);
        let k3 = slope(&ahead(&k2, 0.5), controls[1]);
        let k4 = slope(&ahead(&k3, 1.0), controls[2]);
        for i in 0..flat.len() {
            flat[i] += step_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        let length = flat[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
        flat[3..7].iter_mut().for_each(|x| *x /= length);
    }
}

/// Air past the aircraft in body axes, m/s.
struct Air {
    v: [f64; 3],
    speed: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    fn unit(q: [f64; 4]) -> Option<[f64; 4]> {
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        (length > 0.1).then(|| q.map(|x| x / length))
    }

    fn close(a: [f64; 3], b: [f64; 3], size: f64) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < Tolerance::Close.relative_f64() * size)
    }

    proptest! {
        #[test]
        fn a_product_rotates_right_first(
            left in prop::array::uniform4(-1.0..1.0_f64),
            right in prop::array::uniform4(-1.0..1.0_f64),
            v in prop::array::uniform3(-10.0..10.0_f64),
        ) {
            let (Some(left), Some(right)) = (unit(left), unit(right)) else { return Ok(()) };
            let both = to_local(&rotation(product(left, right)), v);
            let one_by_one = to_local(&rotation(left), to_local(&rotation(right), v));
            prop_assert!(close(both, one_by_one, 20.0));
            prop_assert!(close(to_body(&rotation(left), to_local(&rotation(left), v)), v, 20.0));
        }

        #[test]
        fn the_full_tensor_satisfies_euler_s_equation(
            rate in prop::array::uniform3(-5.0..5.0_f64),
            direct in prop::array::uniform3(-50.0..50.0_f64),
        ) {
            let body = Body::new(&Mechanisms::none().with(Mechanism::InertiaCross, 1.0));
            let ([ix, iy, iz], xz) = (INERTIA_KG_M2, INERTIA_XZ_KG_M2);
            let tensor = |[x, y, z]: [f64; 3]| [ix * x - xz * z, iy * y, iz * z - xz * x];
            let inertial = tensor(body.angular_acceleration(rate, direct));
            let turning = cross(rate, tensor(rate));
            let sum = std::array::from_fn(|axis| inertial[axis] + turning[axis]);
            prop_assert!(close(sum, [ix * direct[0], iy * direct[1], iz * direct[2]], 20.0));
        }
    }

    #[test]
    fn the_baseline_hovers_at_its_trim() {
        let body = Body::new(&Mechanisms::none());
        let state = body.hover(10.0, 0.7);
        let trim: [f64; 3] = std::array::from_fn(|axis| -COEFFICIENTS.d2[axis] / COEFFICIENTS.c2[axis]);
        let controls = [trim[0], trim[1], trim[2], state.servo[1]];
        let rates = body.derivative(&state.flat(), controls, &Disturbance::default(), 0.0);
        assert!(rates.iter().all(|rate| rate.abs() < Tolerance::Close.relative_f64() * GRAVITY_M_S2), "{rates:?}");
    }

    #[test]
    fn lags_change_the_way_there_and_not_the_steady_response() {
        let on = [Mechanism::CyclicLag, Mechanism::TailLag, Mechanism::CollectiveLag]
            .into_iter()
            .fold(Mechanisms::none(), |mechanisms, mechanism| mechanisms.with(mechanism, 1.0));
        let (quick, slow) = (Body::new(&Mechanisms::none()), Body::new(&on));
        let fly = |body: &Body, steps: usize| {
            let mut flat = body.hover(10.0, 0.0).flat();
            let controls = [0.02, -0.01, 0.03, 0.465];
            (0..steps).for_each(|_| body.step(&mut flat, [controls; 3], &Disturbance::default(), 0.0, 0.002));
            State::from_flat(&flat).rate
        };
        let (early, late) = ((fly(&quick, 20), fly(&slow, 20)), (fly(&quick, 2000), fly(&slow, 2000)));
        for axis in 0..3 {
            let left = |early: [f64; 3], late: [f64; 3]| (early[axis] - late[axis]).abs();
            assert!(left(early.1, late.1) > 1.1 * left(early.0, late.0), "axis {axis}: {early:?}");
            // After 4 s only the gyroscopic terms tell the histories apart.
            assert!((late.1[axis] - late.0[axis]).abs() < 0.02 * late.0[axis].abs(), "axis {axis}: {late:?}");
        }
    }
}
