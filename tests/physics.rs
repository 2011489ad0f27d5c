//! The physical model as a whole: what the baseline predicts, the same numbers sample by sample, and formula effects.

mod flights;

use flights::{STEP_S, message, random};
use phyture::flight::attitude::{cross, dot};
use phyture::flight::{Channel, Column, Flight, GRAVITY_M_S2, PerChannel, Targets};
use phyture::formula::Formula;
use phyture::physics::{Effect, Model, Parameter, Swap};
use phyture::{Error, Result};
use phyture_kernels::Tolerance;
use proptest::prelude::*;

const INERTIA: [f64; 3] = [0.18, 0.34, 0.28];

fn paper() -> Model {
    Model::paper("n9", 4.58, INERTIA, 0.8)
}

fn set(model: &mut Model, effect: &str, name: &str, value: f64) -> Result<()> {
    let coefficient = model.effect_mut(effect).and_then(|effect| effect.coefficient_mut(name));
    coefficient.ok_or_else(|| Error::Undetermined(format!("no {effect}.{name}")))?.value = value;
    Ok(())
}

/// One sample of the given state (order of `Column::STATE`), predicted.
fn at(model: &Model, state: [f64; 16]) -> Result<PerChannel<f64>> {
    let columns = std::array::from_fn(|column| vec![state.get(column).copied().unwrap_or(0.0)]);
    let predicted = model.predict(&Flight::new("one", "state", 0.0, STEP_S, columns, Targets::Recorded)?)?;
    Ok(predicted.map(|channel| channel[0]))
}

fn assert_close(found: &[f64], expected: &[f64]) {
    let scale = expected.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
    for (found_one, expected_one) in found.iter().zip(expected) {
        assert!((found_one - expected_one).abs() <= Tolerance::Close.relative_f64() * scale, "{found:?} against {expected:?}");
    }
}

#[test]
fn the_baseline_is_equations_14_and_15_by_hand() -> Result<()> {
    let mut model = paper();
    for (effect, name, value) in [
        ("linear_drag", "a_x", -0.05),
        ("linear_drag", "a_y", -0.06),
        ("linear_drag", "a_z", -1.42),
        ("collective_thrust", "c_z", -20.0),
        ("vertical_bias", "d_z", -0.5),
        ("rate_damping", "b_x", -5.0),
        ("rate_damping", "b_y", -4.0),
        ("rate_damping", "b_z", -3.0),
        ("control_moment", "c_x", 20.0),
        ("control_moment", "c_y", 10.0),
        ("control_moment", "c_z", 30.0),
        ("moment_bias", "d_x", -1.0),
        ("moment_bias", "d_y", 0.5),
        ("moment_bias", "d_z", 0.25),
    ] {
        set(&mut model, effect, name, value)?;
    }
    // Level, at rest, collective 0.5: gravity down, thrust -10, bias -0.5.
    let mut level = [0.0; 16];
    level[Column::U4 as usize] = 0.5;
    assert_close(at(&model, level)?.values(), &[0.0, 0.0, GRAVITY_M_S2 - 10.5, -1.0, 0.5, 0.25]);

    // Rolled 90 degrees to starboard: gravity along body y. v = (10, 2, -1), w = (1, 2, 3):
    // -w x v = -(2·(-1) - 3·2, 3·10 - 1·(-1), 1·2 - 2·10) = (8, -31, 18).
    // Gyroscopic: (0.06/0.18)·6, (0.10/0.34)·3, (-0.16/0.28)·2.
    let mut rolled = [0.0; 16];
    rolled[Column::Roll as usize] = std::f64::consts::FRAC_PI_2;
    rolled[6..12].copy_from_slice(&[10.0, 2.0, -1.0, 1.0, 2.0, 3.0]);
    rolled[12..16].copy_from_slice(&[0.1, -0.2, 0.3, 0.0]);
    let expected = [
        8.0 - 0.5,
        -31.0 + GRAVITY_M_S2 - 0.12,
        18.0 + 1.42 - 0.5,
        2.0 - 5.0 + 2.0 - 1.0,
        0.30 / 0.34 - 8.0 - 2.0 + 0.5,
        -0.32 / 0.28 - 9.0 + 9.0 + 0.25,
    ];
    assert_close(at(&model, rolled)?.values(), &expected);

    // Nose straight up: gravity pulls towards the tail.
    let mut up = [0.0; 16];
    up[Column::Pitch as usize] = std::f64::consts::FRAC_PI_2;
    assert_close(at(&model, up)?.values(), &[-GRAVITY_M_S2, 0.0, -0.5, -1.0, 0.5, 0.25]);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn turning_axes_do_no_work_and_gravity_keeps_its_length(state in prop::array::uniform16(-3.0..3.0f64)) {
        let v: [f64; 3] = [state[6], state[7], state[8]];
        let w: [f64; 3] = [state[9], state[10], state[11]];
        let alone = |kind: &str| {
            let mut model = paper();
            model.effects.retain(|effect| effect.name == kind);
            at(&model, state)
        };
        let scale = 1e2 * Tolerance::Close.relative_f64();
        let coriolis = alone("coriolis")?;
        // Perpendicular to both v and w, and -w x v itself.
        prop_assert!(dot([coriolis[Channel::VxDot], coriolis[Channel::VyDot], coriolis[Channel::VzDot]], v).abs() < scale);
        prop_assert!(dot([coriolis[Channel::VxDot], coriolis[Channel::VyDot], coriolis[Channel::VzDot]], w).abs() < scale);
        assert_close(&coriolis.values()[..3], &cross(w, v).map(|part| -part));
        // The gyroscopic moment changes neither the energy w·Iw nor the angular momentum |Iw|².
        let gyroscopic = alone("gyroscopic")?;
        let energy: f64 = (0..3).map(|axis| INERTIA[axis] * w[axis] * gyroscopic.values()[3 + axis]).sum();
        let momentum: f64 = (0..3).map(|axis| INERTIA[axis].powi(2) * w[axis] * gyroscopic.values()[3 + axis]).sum();
        prop_assert!(energy.abs() < scale && momentum.abs() < scale);
        let gravity = alone("gravity")?;
        assert_close(&[dot([gravity[Channel::VxDot], gravity[Channel::VyDot], gravity[Channel::VzDot]], [gravity[Channel::VxDot], gravity[Channel::VyDot], gravity[Channel::VzDot]]).sqrt()], &[GRAVITY_M_S2]);
    }
}

/// A model with every kind of hidden state: a control delay, a lag, a rate, a swap with a parameter.
fn with_memory() -> Result<Model> {
    let mut model = paper();
    for (index, effect) in model.effects.iter_mut().enumerate() {
        for (place, coefficient) in effect.coefficients.iter_mut().enumerate() {
            coefficient.value = -0.3 - 0.7 * index as f64 - 0.1 * place as f64;
        }
    }
    model.data.control_delay_s = 0.005;
    let mut blowback = Effect::formula("blowback", Channel::WxDot, "lag(vy, tau_s) * hypot(vx, vy) + rate(wx)", 0.02)?;
    blowback.parameters.push(Parameter { name: "tau_s".into(), value: 0.07, unit: "s".into(), fixed: true, ci95: None });
    model.effects.push(blowback);
    model.effects.push(Effect::formula(
        "wake",
        Channel::VzDot,
        "battery * exp(-height / rotor_radius_m) + 0.01 * t + sin(beta) - cos(alpha)",
        -0.4,
    )?);
    let mut servo = Effect::formula("servo", Channel::VxDot, "airspeed", 0.0)?;
    servo.parameters.push(Parameter { name: "tau_s".into(), value: 0.03, unit: "s".into(), fixed: false, ci95: None });
    servo.swaps.push(Swap { name: "u1".into(), with: Formula::parse("lag(u1, tau_s)")?, within: vec!["control_moment".into()] });
    model.effects.push(servo);
    Ok(model)
}

#[test]
fn a_stream_gives_the_same_bits_as_a_flight() -> Result<()> {
    let model = with_memory()?;
    let mut flight = random(7, 2500)?;
    flight.start_s = 12.5;
    flight.extra.insert("battery".into(), (0..flight.len()).map(|sample| 12.0 - 1e-3 * sample as f64).collect());
    let predicted = model.predict(&flight)?;
    let mut stream = model.stream(STEP_S)?;
    assert_eq!(stream.extra_inputs(), ["battery"]);
    for round in 0..2 {
        stream.reset(flight.start_s);
        for sample in 0..flight.len() {
            let state = flight.state(sample);
            if sample == 100 {
                // What is no number is not taken: nothing of it stays in what remembers.
                let mut broken = state;
                broken[Column::Vy as usize] = f64::NAN;
                let refused = |found: Result<PerChannel<f64>>| found.map_err(|error| error.to_string()).err().unwrap_or_default();
                let said = refused(stream.push_with(&broken, &[12.0]));
                assert!(said.contains("sample 100: `vy` is NaN"), "{said}");
                assert!(refused(stream.push_with(&state, &[f64::INFINITY])).contains("`battery` is inf"));
            }
            let found = stream.push_with(&state, &[flight.extra["battery"][sample]])?;
            for (channel, values) in predicted.pairs() {
                assert_eq!(found[channel].to_bits(), values[sample].to_bits(), "round {round}, sample {sample}, channel {channel}");
            }
        }
    }
    Ok(())
}

#[test]
fn a_swap_and_the_control_delay_change_the_controls_the_terms_see() -> Result<()> {
    let model = with_memory()?;
    let mut bare = paper();
    bare.effects.retain(|effect| effect.name == "control_moment");
    set(&mut bare, "control_moment", "c_x", 1.0)?;
    let mut swapped = bare.clone();
    let mut servo = model.effects.last().cloned().ok_or_else(|| Error::Undetermined("no servo".into()))?;
    servo.terms.clear();
    servo.coefficients.clear();
    swapped.effects.push(servo);
    swapped.data.control_delay_s = 0.005;
    let flight = random(3, 400)?;
    let expected = Formula::parse("lag(delay(u1, 0.005), 0.03)")?
        .evaluate(flight.len(), STEP_S, &|name| (name == "u1").then(|| flight.column(Column::U1).into()))?;
    assert_close(&swapped.predict(&flight)?[Channel::WxDot], &expected);
    assert_close(&bare.predict(&flight)?[Channel::WxDot], flight.column(Column::U1));
    // A disabled effect swaps nothing.
    swapped.effects.iter_mut().filter(|effect| effect.name == "servo").for_each(|effect| effect.enabled = false);
    swapped.data.control_delay_s = 0.0;
    assert_close(&swapped.predict(&flight)?[Channel::WxDot], flight.column(Column::U1));
    Ok(())
}

#[test]
fn what_a_flight_does_not_carry_is_refused_by_name() -> Result<()> {
    let mut flight = random(1, 50)?;
    let mut model = paper();
    model.effects.push(Effect::formula("wake", Channel::VzDot, "exp(-hieght)", 1.0)?);
    let text = message(model.predict(&flight))?;
    assert!(text.contains("effect `wake`: unknown name `hieght`; did you mean `height`?"), "{text}");

    model.effects.pop();
    model.effects.push(Effect::formula("wake", Channel::VzDot, "1 / height", 1.0)?);
    assert!(model.predict(&flight).is_ok());
    flight.absent.push(Column::Z);
    let text = message(model.predict(&flight))?;
    assert!(text.contains("no column `z`") && text.contains("effect `wake` reads it"), "{text}");

    model.effects.pop();
    model.effects.push(Effect::formula("log", Channel::VzDot, "log(vx - 1e6)", 0.0)?);
    let text = message(model.predict(&flight))?;
    assert!(text.contains("effect `log` is not a finite number for `vz_dot` in flight `flight1` at t = 0.000 s"), "{text}");

    model.effects.pop();
    model.effects.push(Effect::formula("cheat", Channel::VzDot, "2 * vz_dot", 0.0)?);
    let text = message(model.predict(&flight))?;
    assert!(text.contains("effect `cheat`: an acceleration cannot be an input") && text.ends_with("2 * vz_dot\n      ^"), "{text}");
    Ok(())
}

#[test]
fn rmse_counts_the_rows_of_the_spans() -> Result<()> {
    let flight = random(1, 300)?;
    let model = Model { effects: Vec::new(), ..paper() };
    let targets = PerChannel::from_fn(|channel| (0..300).map(|k| if k < 100 { 9.0 } else { channel.index() as f64 }).collect());
    let flight = flights::with_targets(&flight, &targets)?;
    let span = phyture::flight::Span { flight: 0, start: 100, end: 9999 };
    let flights = [flight];
    assert_close(model.rmse(&flights, &[span])?.values(), &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert!(message(model.rmse(&flights, &[]))?.contains("spans are empty"));
    Ok(())
}
