//! Rollouts against closed forms, against the batch and the stream of the same formulas, and against each other.

use super::*;
use crate::flight::attitude::euler_to_quaternion;
use crate::flight::{Channel, Targets};
use crate::formula::Formula;
use crate::physics::Effect;
use phyture_kernels::Tolerance;
use proptest::prelude::*;

const CLOSE: f64 = Tolerance::Close.relative_f64();
const STEP_S: f64 = 0.01;

/// A flight whose columns are `of(column, sample)`.
fn flight(samples: usize, step_s: f64, of: impl Fn(Column, usize) -> f64) -> Result<Flight> {
    let columns = Column::ALL.map(|column| (0..samples).map(|sample| of(column, sample)).collect());
    Flight::new("f", "hover", 0.0, step_s, columns, Targets::Recorded)
}

/// A state that a flight holds at every sample.
fn still(state: [f64; 12]) -> impl Fn(Column, usize) -> f64 {
    move |column, _| state.get(column as usize).copied().unwrap_or(0.2)
}

/// The paper's baseline with equal moments of inertia and all coefficients zero: weight, and axes that turn.
fn bare() -> Model {
    Model::paper("bare", 1.0, [1.0; 3], 0.5)
}

/// These effects alone.
fn of_effects(effects: Vec<Effect>) -> Model {
    Model { effects, ..bare() }
}

fn with(mut model: Model, effect: &str, values: &[(&str, f64)]) -> Model {
    for (name, value) in values {
        let coefficient = model.effect_mut(effect).and_then(|effect| effect.coefficient_mut(name));
        coefficient.expect("of the baseline").value = *value;
    }
    model
}

/// Where the first start after sample `start` leads.
fn path(model: &Model, flight: &Flight, start: usize, horizon: usize) -> Result<Vec<State>> {
    let flights = std::slice::from_ref(flight);
    let rollout = Rollout::new(model, flights, horizon)?;
    let found = rollout.trajectories(&[Window { flight: 0, last: start }], None)?;
    assert_eq!(found[0].1, None, "not stopped");
    Ok(found.into_iter().next().unwrap_or_default().0)
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn state() -> impl Strategy<Value = [f64; 12]> {
    prop::array::uniform12(-1.0..1.0_f64).prop_map(|mut state| {
        state[0..3].iter_mut().for_each(|place| *place *= 50.0);
        state[6..9].iter_mut().for_each(|speed| *speed *= 20.0);
        state[9..12].iter_mut().for_each(|rate| *rate *= 5.0);
        state
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn a_falling_body_falls_as_it_does_whatever_its_attitude(state in state()) {
        let mut state = state;
        state[9..12].fill(0.0);
        let found = path(&bare(), &flight(80, STEP_S, still(state))?, 5, 60)?;
        for (step, found_at) in found.iter().enumerate() {
            let t = step as f64 * STEP_S;
            let expected: Vec<f64> = (0..3)
                .map(|axis| {
                    let fall = if axis == 2 { 0.5 * crate::flight::GRAVITY_M_S2 * t * t } else { 0.0 };
                    found[0].position[axis] + found[0].velocity[axis] * t + fall
                })
                .collect();
            prop_assert!(apart(&found_at.position, &expected) <= CLOSE * 100.0, "{found_at:?} {expected:?}");
            prop_assert!(apart(&found_at.attitude, &found[0].attitude) <= CLOSE);
        }
    }

    #[test]
    fn constant_rates_turn_it_by_their_exponential(state in state()) {
        let found = path(&bare(), &flight(80, STEP_S, still(state))?, 5, 60)?;
        let rate = apart(&found[0].rates, &[0.0; 3]);
        for (step, found_at) in found.iter().enumerate() {
            let half = 0.5 * rate * STEP_S * step as f64;
            let [x, y, z] = found[0].rates.map(|part| part / rate * half.sin());
            let [a, b, c, w] = found[0].attitude;
            let s = half.cos();
            let expected = [w * x + a * s + b * z - c * y, w * y + b * s + c * x - a * z, w * z + c * s + a * y - b * x, w * s - a * x - b * y - c * z];
            // A step's exponential without its terms from the fifth on, and rounding.
            let truncated = step as f64 * (0.5 * rate * STEP_S).powi(5) / 60.0;
            prop_assert!(apart(&found_at.attitude, &expected) <= truncated + CLOSE, "{} {}", apart(&found_at.attitude, &expected), truncated);
            prop_assert!(apart(&found_at.rates, &found[0].rates) <= CLOSE);
        }
    }

    #[test]
    fn a_step_with_drag_is_the_polynomial_of_the_method(speed in -20.0..20.0_f64, drag in -3.0..-0.1_f64, thrust in -9.0..9.0_f64) {
        let model = with(with(bare(), "linear_drag", &[("a_z", drag)]), "collective_thrust", &[("c_z", thrust)]);
        let at_rest = |column: Column, _: usize| match column {
            Column::Vz => speed,
            Column::U4 => 1.0,
            _ => 0.0,
        };
        let found = path(&model, &flight(10, STEP_S, at_rest)?, 3, 1)?;
        // v' = drag v + a; with z = drag T the method multiplies by 1 + z + z²/2 + z³/6 + z⁴/24.
        let (z, a) = (drag * STEP_S, crate::flight::GRAVITY_M_S2 + thrust);
        let growth = 1.0 + z + z * z / 2.0 + z.powi(3) / 6.0 + z.powi(4) / 24.0;
        let expected = speed * growth + a / drag * (growth - 1.0);
        prop_assert!((found[1].velocity[2] - expected).abs() <= CLOSE * expected.abs().max(1.0));
        // Position by the same method: p' = v.
        let moved = STEP_S * (speed + 0.5 * STEP_S * (drag * speed + a) * (1.0 + z / 3.0 + z * z / 12.0));
        prop_assert!((found[1].position[2] - found[0].position[2] - moved).abs() <= CLOSE);
    }

    #[test]
    fn a_lag_of_a_control_is_that_of_the_batch_to_the_bit(
        controls in prop::collection::vec(-1.0..1.0_f64, 60), tau in 0.01..0.3_f64, start in 1_usize..20,
    ) {
        let model = of_effects(vec![Effect::formula("lagged", Channel::WzDot, &format!("lag(u3, {tau})"), 2.0)?]);
        let flight = flight(60, STEP_S, |column, sample| if column == Column::U3 { controls[sample] } else { 0.0 })?;
        let batch = &model.predict(&flight)?[Channel::WzDot];
        let found = path(&model, &flight, start, 30)?;
        let mut rate = 0.0;
        for (step, found_at) in found.iter().enumerate().skip(1) {
            // The sum of the method for a derivative that is held.
            let held = batch[start + step - 1];
            let slopes = [1.0, 2.0, 2.0, 1.0].map(|weight| weight * STEP_S / 6.0 * held);
            rate = slopes.iter().fold(rate, |rate, slope| rate + slope);
            prop_assert_eq!(found_at.rates[2].to_bits(), rate.to_bits());
        }
    }

    #[test]
    fn what_remembers_a_state_has_seen_the_measured_flight_and_goes_on_from_there(
        rates in prop::collection::vec(-1.0..1.0_f64, 60), tau in 0.01..0.3_f64, start in 1_usize..20,
    ) {
        // A lag of a rate that nothing changes once it is predicted: it goes to that rate exponentially.
        let model = of_effects(vec![Effect::formula("blowback", Channel::VzDot, &format!("lag(wz, {tau})"), 3.0)?]);
        let flight = flight(60, STEP_S, |column, sample| if column == Column::Wz { rates[sample] } else { 0.0 })?;
        let mut stream = Formula::parse(&format!("lag(wz, {tau})"))?.stream(STEP_S)?;
        let mut lagged = 0.0;
        for rate in &rates[..=start] {
            lagged = stream.push(&[*rate])?;
        }
        let found = path(&model, &flight, start, 30)?;
        let mut speed = 0.0;
        for found_at in found.iter().skip(1) {
            let after = |time_s: f64| rates[start] + (lagged - rates[start]) * (-time_s / tau).exp();
            speed += 3.0 * STEP_S / 6.0 * (lagged + 4.0 * after(0.5 * STEP_S) + after(STEP_S));
            prop_assert!((found_at.velocity[2] - speed).abs() <= CLOSE, "{} {}", found_at.velocity[2], speed);
            lagged = stream.push(&[rates[start]])?;
        }
    }
}

/// Everything on: drag, damping, moments, and what remembers states and controls.
fn lively() -> Result<Model> {
    let mut model = with(bare(), "linear_drag", &[("a_x", -0.3), ("a_y", -0.2), ("a_z", -1.0)]);
    model = with(model, "rate_damping", &[("b_x", -4.0), ("b_y", -3.0), ("b_z", -2.0)]);
    model = with(model, "control_moment", &[("c_x", 20.0), ("c_y", 15.0), ("c_z", 10.0)]);
    model = with(model, "collective_thrust", &[("c_z", -15.0)]);
    model.effects.push(Effect::formula("blowback", Channel::WyDot, "lag(vx, 0.07) * airspeed", -0.05)?);
    model.effects.push(Effect::formula("late", Channel::WxDot, "delay(wy, 0.023) + rate(vy) * sin(yaw)", 0.4)?);
    Ok(model)
}

fn lively_flight(samples: usize) -> Result<Flight> {
    flight(samples, STEP_S, |column, sample| (0.05 * sample as f64 + column as usize as f64).sin() * 0.5)
}

#[test]
fn the_method_is_of_order_four() -> Result<()> {
    let mut model = lively()?;
    model.effects.retain(|effect| effect.name != "late" && effect.name != "blowback");
    model.effects.push(Effect::formula("square", Channel::VxDot, "abs(vx) * vx", -0.1)?);
    let state = [0.0, 0.0, -10.0, 0.3, -0.2, 0.5, 8.0, -3.0, 2.0, 2.0, -1.5, 1.0];
    let end = |steps: usize| -> Result<State> {
        let flight = flight(steps + 3, 0.8 / steps as f64, still(state))?;
        Ok(path(&model, &flight, 1, steps)?[steps])
    };
    let numbers = |state: State| [&state.position[..], &state.attitude, &state.velocity, &state.rates].concat();
    let fine = numbers(end(640)?);
    let [coarse, half] = [end(20)?, end(40)?].map(|state| apart(&numbers(state), &fine));
    let gain = coarse / half;
    assert!((12.0..22.0).contains(&gain), "halving the step takes {coarse:e} to {half:e}, {gain} times less");
    Ok(())
}

#[test]
fn other_numbers_give_the_bits_of_a_model_that_has_them() -> Result<()> {
    let flights = [lively_flight(300)?, lively_flight(200)?];
    let mut model = lively()?;
    // A time constant inside a formula of the catalogue, to be moved as well.
    model.effects.push(crate::physics::catalogue::definition("cyclic_lag").expect("of the catalogue").effect(1.0, 0.5));
    let rollout = Rollout::new(&model, &flights, 20)?;
    let starts = rollout.starts(7);
    let changed = |number: usize, flight: usize| rollout.own(number, flight) * (1.0 + 0.1 * (number % 3) as f64);
    let found = rollout.trajectories(&starts, Some(&changed))?;
    let mut other = model.clone();
    for (place, &(effect, number)) in rollout.numbers().iter().enumerate() {
        *other.effects[effect].number_mut(number).expect("a number of the model").0 = changed(place, 0);
    }
    let expected = Rollout::new(&other, &flights, 20)?.trajectories(&starts, None)?;
    assert!(rollout.numbers().len() > 10 && found != rollout.trajectories(&starts, None)?);
    assert_eq!(found, expected);
    Ok(())
}

#[test]
fn a_start_goes_the_same_way_alone_and_among_others_on_any_number_of_threads() -> Result<()> {
    let flights = [lively_flight(500)?, lively_flight(200)?];
    let model = lively()?;
    let rollout = Rollout::new(&model, &flights, 25)?;
    let starts = rollout.starts(1);
    assert_eq!(starts.len(), 500 - 26 + 200 - 26);
    let all = rollout.trajectories(&starts, None)?;
    for index in [0, 100, starts.len() - 1] {
        assert_eq!(rollout.trajectories(&starts[index..=index], None)?[0], all[index]);
    }
    #[cfg(feature = "rayon")]
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert_eq!(pool.install(|| rollout.trajectories(&starts, None))?, all);
    }
    Ok(())
}

#[test]
fn held_rates_stay_and_a_body_that_runs_away_is_stopped_within_bounds() -> Result<()> {
    let flights = [lively_flight(200)?];
    let model = with(bare(), "rate_damping", &[("b_x", 80.0)]);
    let rollout = Rollout::new(&model, &flights, 50)?;
    let starts = rollout.starts(3);
    let found = rollout.trajectories(&starts, None)?;
    assert!(found.iter().filter(|(_, stopped)| stopped.is_some()).count() > found.len() / 2);
    for (path, stopped) in &found {
        let numbers = path.iter().flat_map(|state| state.rates.into_iter().chain(state.velocity).chain(state.position));
        assert!(numbers.into_iter().all(f64::is_finite));
        assert!(path.iter().all(|state| apart(&state.rates, &[0.0; 3]) <= MOST_RATE_RAD_S));
        if let Some(step) = stopped {
            assert!(path[*step..].iter().all(|state| *state == path[step - 1]));
        }
    }
    let held = Rollout::new(&model, &flights, 50)?.with_rates_held().trajectories(&starts, None)?;
    assert!(held.iter().all(|(path, stopped)| stopped.is_none() && path.iter().all(|state| state.rates == path[0].rates)));
    Ok(())
}

#[test]
fn starts_are_recorded_states() -> Result<()> {
    let flight = lively_flight(100)?;
    let found = path(&lively()?, &flight, 30, 1)?[0];
    let of = |column: Column| flight.column(column)[30];
    let attitude = euler_to_quaternion(of(Column::Roll), of(Column::Pitch), of(Column::Yaw));
    assert_eq!((found, found.attitude), (State::recorded(&flight, 30), attitude));
    Ok(())
}

#[test]
fn what_cannot_be_rolled_out_is_refused_by_name() -> Result<()> {
    let flights = [lively_flight(40)?];
    let model = lively()?;
    let said = |model: &Model, flights: &[Flight], horizon: usize| {
        Rollout::new(model, flights, horizon).map(drop).map_err(|error| error.to_string()).err().unwrap_or_default()
    };
    assert_eq!(said(&model, &flights, 0), "rollout: `horizon` is 0, expected at least 1 step");
    let long = said(&model, &flights, 39);
    assert_eq!(long, "rollout: `horizon` is 39 steps, expected at most 38: the longest flight, `f`, has 40 samples");
    let mut without = flights[0].clone();
    without.absent = vec![Column::Vy];
    let lacks = said(&of_effects(Vec::new()), &[without], 10);
    assert!(lacks.starts_with("f: found no column `vy`, expected attitude, velocity and rates"), "{lacks}");
    let reads = of_effects(vec![Effect::formula("motor", Channel::VzDot, "rpm", 1.0)?]);
    assert!(said(&reads, &flights, 10).contains("unknown name `rpm`"));
    let other = flight(40, 0.02, |_, _| 0.0)?;
    assert!(said(&model, &[flights[0].clone(), other], 10).contains("`step` is 0.02 s, expected the 0.01 s of flight `f`"));
    let late = Rollout::new(&model, &flights, 20)?.trajectories(&[Window { flight: 0, last: 20 }], None);
    assert!(late.is_err_and(|error| error.to_string().contains("sample 20 of flight 0 has no 20 samples after it")));
    Ok(())
}

#[test]
fn a_log_without_position_has_the_way_that_its_velocity_makes() -> Result<()> {
    let mut without = lively_flight(60)?;
    without.absent = vec![Column::X, Column::Y, Column::Z];
    let states = recorded_states(&without);
    assert!(!has_position(&without) && states[0].position == [0.0; 3]);
    // Step by step the mean of two velocities.
    for (pair, axis) in states.windows(2).flat_map(|pair| (0..3).map(move |axis| (pair, axis))) {
        let moved = 0.5 * without.step_s * (pair[0].velocity[axis] + pair[1].velocity[axis]);
        assert!((pair[1].position[axis] - pair[0].position[axis] - moved).abs() <= CLOSE, "{pair:?}");
    }
    assert!(states.iter().any(|state| state.position != [0.0; 3]), "a lively flight goes somewhere");
    assert!(Rollout::new(&lively()?, &[without], 10).is_ok());
    Ok(())
}
