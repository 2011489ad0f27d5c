//! The signs and first orders of the catalogue's formulas, against the equations they come from, worked out another way.

use super::tests::{effect, helicopter};
use crate::Result;
use crate::flight::attitude::{cross, euler_rates, rotate, rotate_back, rotation_body_to_inertial, rotation_to_euler};
use crate::flight::{Channel, Column, Flight, GRAVITY_M_S2, Targets};
use crate::physics::{Effect, Model};
use nalgebra::{Matrix3, Vector3};
use phyture_kernels::Tolerance;
use proptest::prelude::*;

const INERTIA: [f64; 3] = [0.18, 0.34, 0.28];

fn at(model: &Model, state: [f64; 16]) -> Result<[f64; 6]> {
    let columns = std::array::from_fn(|column| vec![state.get(column).copied().unwrap_or(0.0)]);
    let predicted = model.predict(&Flight::new("one", "state", 0.0, 0.01, columns, Targets::Recorded)?)?;
    Ok(predicted.map(|channel| channel[0]).into_array())
}

/// What an effect adds to the helicopter at a state.
fn added(effect: Effect, state: [f64; 16]) -> Result<[f64; 6]> {
    let mut model = helicopter();
    let before = at(&model, state)?;
    model.effects.push(effect);
    let after = at(&model, state)?;
    Ok(std::array::from_fn(|channel| after[channel] - before[channel]))
}

fn plus<const N: usize>(a: [f64; N], b: [f64; N], scale: f64) -> [f64; N] {
    std::array::from_fn(|axis| a[axis] + scale * b[axis])
}

fn triple(state: &[f64], first: Column) -> [f64; 3] {
    std::array::from_fn(|axis| state[first as usize + axis])
}

fn put(state: &mut [f64; 16], first: Column, values: [f64; 3]) {
    state[first as usize..first as usize + 3].copy_from_slice(&values);
}

/// Equal up to `tolerance` of numbers of the given size.
fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= tolerance, "{found:?} against {expected:?}");
    }
}

/// A state in flight: not near the pole of the Euler angles.
fn states() -> impl Strategy<Value = [f64; 16]> {
    prop::array::uniform16(-1.0..1.0f64).prop_map(|unit| {
        let size = [30.0, 30.0, 30.0, 3.0, 1.3, 3.0, 12.0, 8.0, 5.0, 4.0, 4.0, 4.0, 1.0, 1.0, 1.0, 1.0];
        std::array::from_fn(|column| size[column] * unit[column])
    })
}

/// Linear effects are exact to rounding at accelerations of some 100.
const EXACT: f64 = 1e3 * Tolerance::Close.relative_f64();
/// A size whose square is lost, and the bound on what is left of an effect of that size over it.
const SMALL: f64 = 1e-6;
const SECOND_ORDER: f64 = 1e-3;

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_lever_arm_records_another_point(state in states(), lever in prop::array::uniform3(-0.3..0.3f64)) {
        let truth = at(&helicopter(), state)?;
        let (v, w) = (triple(&state, Column::Vx), triple(&state, Column::Wx));
        let turning = [truth[3], truth[4], truth[5]];
        // The point's velocity, and the derivative of its components in body axes.
        let expected = plus([truth[0], truth[1], truth[2]], cross(turning, lever), 1.0);
        let mut recorded = state;
        put(&mut recorded, Column::Vx, plus(v, cross(w, lever), 1.0));
        let mut model = helicopter();
        model.effects.push(effect("imu_lever", &lever)?);
        assert_near(&at(&model, recorded)?[..3], &expected, EXACT);
    }

    #[test]
    fn a_bias_is_taken_off_what_was_recorded(state in states(), bias in prop::array::uniform6(-1.0..1.0f64)) {
        let bias = bias.map(|part| SMALL * part);
        let mut recorded = state;
        let velocity = plus(triple(&state, Column::Vx), [bias[0], bias[1], bias[2]], 1.0);
        put(&mut recorded, Column::Vx, velocity);
        put(&mut recorded, Column::Wx, plus(triple(&state, Column::Wx), [bias[3], bias[4], bias[5]], 1.0));
        let missing = plus(at(&helicopter(), state)?, at(&helicopter(), recorded)?, -1.0);
        let found = added(effect("sensor_bias", &bias)?, recorded)?;
        assert_near(&found, &missing, SECOND_ORDER * SMALL);
    }

    #[test]
    fn wind_moves_the_air_that_drags(state in states(), north in -15.0..15.0f64, east in -15.0..15.0f64) {
        let [roll, pitch, yaw] = triple(&state, Column::Roll);
        let air = rotate_back(&rotation_body_to_inertial(roll, pitch, yaw), [north, east, 0.0]);
        let drag = [-0.05, -0.06, -1.42];
        let expected: [f64; 3] = std::array::from_fn(|axis| -drag[axis] * air[axis]);
        assert_near(&added(effect("wind", &[north, east])?, state)?[..3], &expected, EXACT);
    }

    #[test]
    fn an_askew_mounting_turns_gravity(state in states(), turn in prop::array::uniform3(-1.0..1.0f64)) {
        let [roll, pitch, yaw] = triple(&state, Column::Roll);
        let turn = turn.map(|angle| SMALL * angle);
        // The true axes are the recorded ones, turned: R_true = R_rec (1 + [d]x).
        let recorded = rotation_body_to_inertial(roll, pitch, yaw);
        let columns: [[f64; 3]; 3] = std::array::from_fn(|axis| {
            let unit = std::array::from_fn(|k| if k == axis { 1.0 } else { 0.0 });
            rotate(&recorded, plus(unit, cross(turn, unit), 1.0))
        });
        let mut truth = state;
        put(&mut truth, Column::Roll, rotation_to_euler(&std::array::from_fn(|row| columns.map(|column| column[row]))));
        let missing = plus(at(&helicopter(), truth)?, at(&helicopter(), state)?, -1.0);
        assert_near(&added(effect("tilt_misalign", &turn)?, state)?, &missing, SECOND_ORDER * SMALL);
    }

    #[test]
    fn a_late_stream_is_what_it_will_be(state in states(), late in prop::array::uniform2(-1.0..1.0f64)) {
        let late = late.map(|part| SMALL * part);
        let [roll, pitch, yaw] = triple(&state, Column::Roll);
        let rates = triple(&state, Column::Wx);
        let now = at(&helicopter(), state)?;
        let mut truth = state;
        put(&mut truth, Column::Roll, plus([roll, pitch, yaw], euler_rates(roll, pitch, rates), late[0]));
        put(&mut truth, Column::Vx, plus(triple(&state, Column::Vx), [now[0], now[1], now[2]], late[1]));
        let missing = plus(at(&helicopter(), truth)?, now, -1.0);
        assert_near(&added(effect("sync", &late)?, state)?, &missing, SECOND_ORDER * SMALL);
    }

    #[test]
    fn products_of_inertia_solve_euler_s_equation(state in states(), products in prop::array::uniform3(-1.0..1.0f64)) {
        let [xz, xy, yz] = products.map(|part| SMALL * part);
        let diagonal = Matrix3::from_diagonal(&Vector3::from(INERTIA));
        let tensor = diagonal - Matrix3::new(0.0, xy, xz, xy, 0.0, yz, xz, yz, 0.0);
        let rate = Vector3::from(triple(&state, Column::Wx));
        let without = at(&helicopter(), state)?;
        // The baseline's own moment, gyroscopic part taken back out.
        let moment = diagonal * Vector3::new(without[3], without[4], without[5]) + rate.cross(&(diagonal * rate));
        let Some(inverse) = tensor.try_inverse() else { return Err(TestCaseError::fail("singular tensor")) };
        let with = inverse * (moment - rate.cross(&(tensor * rate)));
        let found = added(effect("inertia_cross", &[xz, xy, yz])?, state)?;
        let expected: [f64; 3] = std::array::from_fn(|axis| with[axis] - without[3 + axis]);
        assert_near(&found[3..], &expected, 10.0 * SECOND_ORDER * SMALL);
    }

    #[test]
    fn thrust_off_the_centre_of_mass_turns(state in states(), ahead in -0.05..0.05f64, starboard in -0.05..0.05f64) {
        let thrust = 4.58 * (-20.0 * state[Column::U4 as usize] - 0.51 - 1.42 * state[Column::Vz as usize]);
        let moment = cross([-ahead, -starboard, 0.0], [0.0, 0.0, thrust]);
        let expected: [f64; 3] = std::array::from_fn(|axis| moment[axis] / INERTIA[axis]);
        assert_near(&added(effect("cg_offset", &[ahead, starboard])?, state)?[3..], &expected, EXACT);
    }
}

/// Level, at rest, with 1 g of thrust.
fn hover() -> [f64; 16] {
    let mut state = [0.0; 16];
    state[Column::Z as usize] = -50.0;
    state[Column::U4 as usize] = (GRAVITY_M_S2 - 0.51) / 20.0;
    state
}

/// The same as columns of a flight.
fn hover_columns(samples: usize) -> [Vec<f64>; Column::COUNT] {
    let state = hover();
    std::array::from_fn(|column| vec![state.get(column).copied().unwrap_or(0.0); samples])
}

#[test]
fn signs_are_those_of_an_upright_helicopter() -> Result<()> {
    let push = |kind: &str, values: &[f64], column: Column, value: f64, channel: Column| -> Result<f64> {
        let mut state = hover();
        state[column as usize] = value;
        Ok(added(effect(kind, values)?, state)?[channel as usize - Column::VxDot as usize])
    };
    // A nose-up stick (c_y > 0) tilts the thrust aft; a right stick to starboard; the disc stays behind a pitching fuselage.
    assert!(push("flap_tilt", &[0.1, 0.0], Column::U2, 0.5, Column::VxDot)? < -0.4);
    assert!(push("flap_tilt", &[0.1, 0.0], Column::U1, 0.5, Column::VyDot)? > 0.4);
    assert!(push("flap_tilt", &[0.0, 0.1], Column::Wy, 1.0, Column::VxDot)? > 0.9);
    assert!(push("flap_tilt", &[0.0, 0.1], Column::Wx, 1.0, Column::VyDot)? < -0.9);
    // Lift by speed, loss in the vortex ring, gain over the ground: 1/15 at one radius.
    assert!(push("transl_lift", &[2.5, 0.0], Column::Vx, 10.0, Column::VzDot)? < -1.0);
    assert!(push("vortex_ring", &[-0.3], Column::Vz, 3.3, Column::VzDot)? > 2.0);
    assert!(push("vortex_ring", &[-0.3], Column::Vz, -3.3, Column::VzDot)? < 0.01);
    let ground = push("ground_effect", &[1.0], Column::Z, -0.6, Column::VzDot)?;
    assert!((ground + GRAVITY_M_S2 / 15.0).abs() < EXACT, "{ground}");
    // A full collective stalls: 20.5 m/s² is 7.8 above the knee of 1.3 g.
    assert!((push("stall_saturation", &[-0.5], Column::U4, 1.0, Column::VzDot)? - 3.88).abs() < 0.01);
    assert!(push("weathercock", &[0.05, 0.5], Column::Vy, 2.0, Column::WzDot)? > 1.0);
    assert!(push("mass_drift", &[1e-3], Column::U4, 0.5, Column::VzDot)?.abs() < EXACT, "nothing is burnt at t = 0");
    Ok(())
}

#[test]
fn a_falling_mass_lifts_more_and_turns_no_more() -> Result<()> {
    let columns = hover_columns(1);
    // A hundred seconds after take-off a tenth of a per cent a second is a tenth: the thrust of 1 g accelerates by a tenth of it more.
    let flight = Flight::new("late", "made_up", 100.0, 0.01, columns, Targets::Recorded)?;
    let mut model = helicopter();
    model.effects.push(effect("collective_torque", &[2.0])?);
    let before = model.predict(&flight)?;
    model.effects.push(effect("mass_drift", &[1e-3])?);
    let after = model.predict(&flight)?;
    assert!((after[Channel::VzDot][0] - before[Channel::VzDot][0] + 0.1 * GRAVITY_M_S2).abs() < EXACT);
    assert_eq!(after[Channel::WzDot][0].to_bits(), before[Channel::WzDot][0].to_bits(), "the torque is that of the same force");
    Ok(())
}

#[test]
fn droop_and_inflow_answer_a_step_of_the_collective() -> Result<()> {
    let step = |effect: Effect| -> Result<Vec<f64>> {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; 400]);
        columns[Column::U4 as usize] = (0..400).map(|k| if k < 100 { 0.465 } else { 0.8 }).collect();
        let flight = Flight::new("step", "made_up", 0.0, 0.01, columns, Targets::Recorded)?;
        let mut model = helicopter();
        let before = model.predict(&flight)?;
        model.effects.push(effect);
        let after = model.predict(&flight)?;
        Ok(after[Channel::VzDot].iter().zip(&before[Channel::VzDot]).map(|(after, before)| after - before).collect())
    };
    // Less thrust (positive is down), and more and more so.
    let droop = step(effect("rotor_droop", &[-0.1])?)?;
    assert!(droop[99].abs() < 0.01 && droop[110] > 0.1 && droop[390] > 2.0 * droop[110]);
    // It overshoots upwards at once, by less than 40 % of 6.7 m/s² as more thrust means more flow, and dies out.
    let inflow = step(effect("inflow_lag", &[])?)?;
    assert!(inflow[99].abs() < EXACT && inflow[100] < -2.0 && inflow[390].abs() < 1e-6, "{} {}", inflow[100], inflow[390]);
    Ok(())
}

#[test]
fn a_shifted_trim_is_a_centre_of_mass_off_the_thrust_and_its_flights_go_by_name() -> Result<()> {
    let mut state = [0.0; 16];
    state[Column::U4 as usize] = 0.6;
    let offset = [0.004, -0.003];
    let [ix, iy, _] = INERTIA;
    // Moment m T d over the moment of inertia, at a thrust of 1 g; upright thrust is negative.
    let moment = |distance: f64, inertia: f64| 4.58 * GRAVITY_M_S2 * distance / inertia;
    let shift = effect("trim_shift", &[moment(offset[1], ix), -moment(offset[0], iy), 0.0])?;
    assert_near(&added(shift.clone(), state)?, &added(effect("cg_offset", &offset)?, state)?, EXACT);
    let mut of_flights = shift;
    if let Some(values) = &mut of_flights.coefficients[1].by_flight {
        values.insert("one".into(), 2.5);
    }
    let found = added(of_flights, state)?[Channel::WyDot.index()];
    assert!((found - 2.5 * (20.0 * 0.6 + 0.51) / GRAVITY_M_S2).abs() < EXACT, "{found}");
    Ok(())
}

#[test]
fn rotors_blow_back_more_in_descent() -> Result<()> {
    let mut state = [0.0; 16];
    put(&mut state, Column::Vx, [2.0, 3.0, -1.5]);
    let found = added(effect("blowback_climb", &[-1.0, 4.0])?, state)?;
    assert_near(&found, &[0.0, 0.0, 0.0, 3.0 * 1.5, -4.0 * 2.0 * 1.5, 0.0], EXACT);
    Ok(())
}

#[test]
fn rotors_blow_back_more_the_more_they_lift_and_at_1_g_as_they_do() -> Result<()> {
    let mut state = [0.0; 16];
    put(&mut state, Column::Vx, [2.0, 3.0, 0.0]);
    let blowback = || effect("blowback_thrust", &[-1.0, 4.0]);
    // The thrust of this helicopter, from `trim_shift` above.
    let hover = (GRAVITY_M_S2 - 0.51) / 20.0;
    for (stick, beyond) in
        [(hover, 0.0), (0.6, (20.0 * 0.6 + 0.51) / GRAVITY_M_S2 - 1.0), (0.2, (20.0 * 0.2 + 0.51) / GRAVITY_M_S2 - 1.0)]
    {
        state[Column::U4 as usize] = stick;
        let found = added(blowback()?, state)?;
        assert_near(&found, &[0.0, 0.0, 0.0, -3.0 * beyond, 4.0 * 2.0 * beyond, 0.0], EXACT);
    }
    Ok(())
}

/// Momentum theory of a rotor whose blades lift, per mass: thrust = pitch - slope * (v + climb) = g / v_h² * v * hypot(speed, v + climb).
struct Rotor {
    hover_m_s: f64,
    slope_per_s: f64,
    /// Of the air that moves with the flow, over that of the aircraft.
    apparent_mass: f64,
}

impl Rotor {
    fn excess(&self, pitch: f64, [speed, climb]: [f64; 2], flow: f64) -> [f64; 2] {
        let thrust = pitch - self.slope_per_s * (flow + climb);
        let carried = GRAVITY_M_S2 / self.hover_m_s.powi(2) * flow * speed.hypot(flow + climb);
        [thrust, thrust - carried]
    }

    /// Induced velocity at which thrust and momentum agree.
    fn steady(&self, pitch: f64, air: [f64; 2]) -> f64 {
        let mut bounds = [0.0, 50.0];
        for _ in 0..80 {
            let middle = 0.5 * (bounds[0] + bounds[1]);
            bounds[usize::from(self.excess(pitch, air, middle)[1] < 0.0)] = middle;
        }
        bounds[0]
    }
}

#[test]
fn the_lag_of_the_inflow_is_that_of_momentum_theory_in_hover_climb_and_forward_flight() -> Result<()> {
    let (step_s, samples, begin) = (0.0005, 1000, 40);
    let rotor = Rotor { hover_m_s: 3.2, slope_per_s: 3.0, apparent_mass: 0.35 };
    // In hover dT/dv of the momentum is 2 g / v_h.
    let stiffness = 2.0 * GRAVITY_M_S2 / rotor.hover_m_s;
    let given = [
        ("tau_s", rotor.apparent_mass / (stiffness + rotor.slope_per_s)),
        ("overshoot", rotor.slope_per_s / stiffness),
        ("induced_m_s", rotor.hover_m_s),
    ];
    let lag = effect("inflow_lag", &[])?;
    for (air, step, bound) in [
        // Steps of pitch in level flight, in climbs and in a descent; then gusts.
        ([0.0, 0.0], [0.5, 0.0], 0.02),
        ([0.0, 0.0], [5.0, 0.0], 0.03),
        ([4.0, 0.0], [0.5, 0.0], 0.02),
        ([15.0, 0.0], [0.5, 0.0], 0.02),
        ([15.0, 0.0], [5.0, 0.0], 0.02),
        ([0.0, 1.5], [0.5, 0.0], 0.02),
        ([10.0, 4.0], [0.5, 0.0], 0.08),
        ([3.0, -1.0], [0.5, 0.0], 0.05),
        ([0.0, 0.0], [0.0, 0.3], 0.02),
        ([10.0, 0.0], [0.0, 0.3], 0.03),
    ] {
        let at = |k: usize| {
            let share = f64::from(u8::from(k >= begin));
            (GRAVITY_M_S2 + 2.0 * rotor.slope_per_s + share * step[0], [air[0], air[1] + share * step[1]])
        };
        let mut flow = rotor.steady(at(0).0, at(0).1);
        let (mut truth, mut steady) = (Vec::new(), Vec::new());
        for k in 0..samples {
            let (pitch, air) = at(k);
            truth.push(rotor.excess(pitch, air, flow)[0]);
            steady.push(-rotor.excess(pitch, air, rotor.steady(pitch, air))[0]);
            for _ in 0..4 {
                flow += step_s / 4.0 * rotor.excess(pitch, air, flow)[1] / rotor.apparent_mass;
            }
        }
        let column = |of: &dyn Fn(usize) -> f64| crate::formula::Value::from((0..samples).map(of).collect::<Vec<_>>());
        let found = lag.swaps[0].with.evaluate(samples, step_s, &|name| match name {
            "thrust" => Some(steady.clone().into()),
            "air_vx" => Some(column(&|k| at(k).1[0])),
            "air_vy" => Some(column(&|_| 0.0)),
            "air_vz" => Some(column(&|k| -at(k).1[1])),
            name => given.iter().find(|known| known.0 == name).map(|known| known.1.into()),
        })?;
        // Of the transient, its size at once: what is left of it where the formula has followed.
        let transient = (truth[begin] + steady[begin]).abs();
        let worst = (begin..samples).map(|k| (found[k] + truth[k]).abs()).fold(0.0, f64::max) / transient;
        assert!(transient > 0.01 && worst < bound, "{air:?} {step:?}: {worst:.3} of {transient:.3}");
    }
    Ok(())
}
