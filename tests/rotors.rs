//! Rotors one by one (`[[rotor]]` of a model file): read and written, refused with a reason, their numbers calibrated back, and an effect of theirs
//! named where it was hidden.
//!
//! Seeds 71 to 79, 711 and 712; searches are deterministic.
#![cfg(feature = "files")]

mod flights;

use flights::{Normal, message, random, with_targets};
use phyture::critique::diagnose::{Options, diagnose};
use phyture::flight::split::Split;
use phyture::flight::{Channel, Column, Flight, Span, Targets};
use phyture::physics::{Effect, Model, calibrate, catalogue};
use phyture::{Error, Result};
use phyture_kernels::Tolerance;
use std::path::Path;

/// A quadrotor of 1.2 kg whose log has the speed of each rotor in revolutions per minute.
const QUADROTOR: &str = r#"
[model]
format = 4
name = "quadrotor"
mass_kg = 1.2
inertia = [0.011, 0.012, 0.02]
rotor_radius_m = 0.12
vehicle = "multirotor"
baseline = "paper"
[[rotor]]
speed = "m1_rpm * 0.10471976"
position_m = [0.15, 0.15, -0.03]
turns = "counterclockwise"
[[rotor]]
speed = "m2_rpm * 0.10471976"
position_m = [-0.15, 0.15, -0.03]
turns = "clockwise"
[[rotor]]
speed = "m3_rpm * 0.10471976"
position_m = [-0.15, -0.15, -0.03]
axis = [0.0, 0.0, -2.0]
turns = "counterclockwise"
[[rotor]]
speed = "m4_rpm * 0.10471976"
position_m = [0.15, -0.15, -0.03]
turns = "clockwise"
"#;

fn read(text: &str) -> Result<Model> {
    Model::from_toml(text, Path::new("quadrotor.toml"))
}

/// The quadrotor with numbers of its size, and one of its rotors' effects.
fn quadrotor(hidden: Option<(&str, f64)>) -> Result<Model> {
    let mut model = read(QUADROTOR)?;
    let values = [-0.1, -0.1, -0.2, -20.0, -0.5, -1.0, -1.0, -0.5, 40.0, 40.0, 10.0, 0.1, 0.1, 0.05];
    let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
    coefficients.zip(values).for_each(|(coefficient, value)| coefficient.value = value);
    if let Some((kind, value)) = hidden {
        let definition = catalogue::definition(kind).ok_or_else(|| Error::Undetermined(format!("no {kind}")))?;
        let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
        effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = value);
        model.effects.push(effect);
    }
    Ok(model)
}

/// Flights of the model with white noise on their accelerations; speeds of rotors follow the controls and a wandering of their own.
fn flown(model: &Model, seed: u64, noise: f64) -> Result<Vec<Flight>> {
    let mut flights = Vec::new();
    for number in 0..4 {
        let mut flight = random(10 * seed + number, 5000)?;
        flight.name = format!("made_up/{number}");
        let mut normal = Normal::new(10 * seed + number + 5000);
        for (rotor, [roll, pitch, yaw]) in
            [[-1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]].iter().enumerate()
        {
            let wandering = normal.path(flight.len(), 0.5);
            let speed = |sample: usize| {
                let [u1, u2, u3, u4] = flight.state(sample)[12..16] else { unreachable!("16 numbers") };
                4500.0 + 1500.0 * (u4 - 0.45) + 600.0 * (roll * u1 + pitch * u2 + yaw * u3) + 500.0 * wandering[sample]
            };
            let speeds = (0..flight.len()).map(speed).collect();
            flight.extra.insert(format!("m{}_rpm", rotor + 1), speeds);
        }
        let mut targets = model.predict(&flight)?;
        targets.iter_mut().flatten().for_each(|value| *value += noise * normal.next());
        let extra = std::mem::take(&mut flight.extra);
        flight = with_targets(&flight, &targets)?;
        flight.extra = extra;
        flights.push(flight);
    }
    Ok(flights)
}

#[test]
fn rotors_read_back_as_they_were_written() -> Result<()> {
    let model = read(QUADROTOR)?;
    assert_eq!(model.rotors.len(), 4);
    assert_eq!(model.rotors[0].axis, [0.0, 0.0, -1.0], "a rotor lifts, unless it is said");
    assert_eq!(read(&model.to_toml()?)?, model);
    // The length of an axis means nothing.
    let mut short = model.clone();
    short.rotors[2].axis = [0.0, 0.0, -1.0];
    let hidden = |model: &Model| -> Result<Model> {
        let mut model = model.clone();
        model.effects.extend(quadrotor(Some(("rotor_inflow", 1e-4)))?.effects.pop());
        Ok(model)
    };
    let flight = &flown(&quadrotor(None)?, 71, 0.0)?[0];
    assert_eq!(hidden(&model)?.predict(flight)?, hidden(&short)?.predict(flight)?);
    Ok(())
}

#[test]
fn what_cannot_be_a_rotor_is_refused_with_line_and_reason() -> Result<()> {
    let rotor = |lines: &str| format!("[model]\nbaseline = \"paper\"\n[[rotor]]\n{lines}\n");
    let whole = "speed = \"u4 * 300\"\nposition_m = [0.1, 0, 0]\nturns = \"clockwise\"\n";
    read(&rotor(whole))?;
    for (lines, expected) in [
        ("position_m = [0.1, 0, 0]\nturns = \"clockwise\"".to_owned(), "`rotor.speed` is nothing"),
        (whole.replace("clockwise", "clockwize"), "did you mean `clockwise`"),
        (whole.replace("u4 * 300", "u4 * (300"), "line 4"),
        (whole.replace("u4 * 300", "thrust * 3"), "`thrust` in it"),
        (whole.replace("u4 * 300", "delay(u4, u1)"), "rotor 1, speed"),
        (whole.replace("[0.1, 0, 0]", "[100, 0, 0]"), "at most 20 m"),
        (whole.replace("[0.1, 0, 0]", "[0.1, 0]"), "position_m"),
        (format!("{whole}axis = [0, 0, 0]"), "`[0, 0, -1]` lifts"),
        (format!("{whole}radius = 3"), "unknown key"),
    ] {
        let text = message(read(&rotor(&lines)))?;
        assert!(text.contains(expected) && text.contains("quadrotor.toml"), "{lines}: {text}");
    }
    let none = message(read("[model]\nbaseline = \"paper\"\n[[effect]]\nkind = \"rotor_drag\"\n"))?;
    assert!(none.contains("effect `rotor_drag` sums over rotors") && none.contains("[[rotor]]"), "{none}");
    // A log without the columns.
    let model = quadrotor(Some(("rotor_drag", 1e-4)))?;
    let text = message(model.predict(&random(71, 100)?))?;
    assert!(text.contains("m1_rpm"), "{text}");
    Ok(())
}

#[test]
fn recorded_speeds_act_late_as_the_controls_do() -> Result<()> {
    let mut late = quadrotor(Some(("rotor_drag", 2e-4)))?;
    let flight = flown(&late, 72, 0.0)?.swap_remove(0);
    let plain = late.predict(&flight)?;
    late.data.control_delay_s = 0.02;
    let mut moved = flight.clone();
    for values in moved.extra.values_mut() {
        let first = values[0];
        values.rotate_right(2);
        values[..2].fill(first);
    }
    late.effects.retain(|effect| effect.kind == "rotor_drag");
    let mut prompt = late.clone();
    prompt.data.control_delay_s = 0.0;
    assert_eq!(late.predict(&flight)?, prompt.predict(&moved)?);
    assert_ne!(plain, prompt.predict(&flight)?);
    Ok(())
}

#[test]
fn rotors_of_the_crazyflie_make_its_controls() -> Result<()> {
    let mut model = Model::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/crazyflie/rotors.toml"))?;
    model.data.control_delay_s = 0.0;
    // Moments of speed squared at the arms are the mixes, up to their scale: 4e6 and 24e6 (rad/s)², arms of 0.033 m.
    let of_controls = [
        (Channel::WxDot, "rotors_thrust_mx / (0.033 * 4e6) - u1"),
        (Channel::WyDot, "rotors_thrust_my / (0.033 * 4e6) - u2"),
        (Channel::WzDot, "rotors_torque_z / 4e6 - u3"),
        (Channel::VzDot, "-rotors_thrust_z / 24e6 - u4"),
    ];
    model.effects.clear();
    for (channel, formula) in of_controls {
        model.effects.push(Effect::formula(channel.name(), channel, formula, 1.0)?);
    }
    // Near hover, where no speed is at zero.
    let flight = random(78, 500)?;
    let columns = Column::ALL.map(|column| {
        let near = |value: &f64| if column == Column::U4 { 0.5 + 0.1 * value } else { 0.3 * value };
        flight.column(column).iter().map(near).collect()
    });
    let flight = Flight::new("near_hover", "made_up", 0.0, flight.step_s, columns, Targets::Recorded)?;
    for (channel, values) in model.predict(&flight)?.pairs() {
        let largest = values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        assert!(largest <= Tolerance::Close.relative_f64(), "{channel:?}: {largest}");
    }
    Ok(())
}

#[test]
fn numbers_of_rotors_are_calibrated_back() -> Result<()> {
    let wanted = [("rotor_inflow", 4e-4), ("rotor_drag", 2e-4), ("rotor_gyro", 3e-5)];
    let mut truth = quadrotor(None)?;
    for (kind, value) in wanted {
        truth.effects.extend(quadrotor(Some((kind, value)))?.effects.pop());
    }
    let flights = flown(&truth, 73, 0.05)?;
    let spans: Vec<Span> = flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
    let mut blank = truth.clone();
    blank.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).for_each(|coefficient| coefficient.value = 0.0);
    let (found, _) = calibrate(&blank, &flights, &spans)?;
    for (kind, value) in wanted {
        let coefficient = &found.effect(kind).ok_or_else(|| Error::Undetermined(kind.into()))?.coefficients[0];
        let [low, high] = coefficient.ci95.ok_or_else(|| Error::Undetermined("no interval".into()))?;
        assert!(high - low < 0.2 * value, "{kind}: {low} to {high}");
        // Three intervals, so one and a half times their half width each.
        assert!(
            (coefficient.value - value).abs() < 0.75 * (high - low),
            "{kind}: {} in {low} to {high}, true {value}",
            coefficient.value
        );
    }
    Ok(())
}

#[test]
fn what_a_multirotor_lacks_is_named_where_it_was_hidden() -> Result<()> {
    for (hidden, seed) in [("trim_shift", 711), ("blowback_climb", 712), ("blowback_thrust", 713)] {
        let mut truth = quadrotor(Some((hidden, 0.5)))?;
        // Of each flight as if the battery had been put in anew.
        let own = truth.effects.last_mut().into_iter().flat_map(|effect| &mut effect.coefficients);
        for (place, values) in own.filter_map(|coefficient| coefficient.by_flight.as_mut()).enumerate() {
            let shift = |flight: u32| [3.0, -2.5, 2.0, -3.5][(flight as usize + place) % 4] / if place == 2 { 4.0 } else { 1.0 };
            values.extend((0..4).map(|flight| (format!("made_up/{flight}"), shift(flight))));
        }
        let flights = flown(&truth, seed, 0.3)?;
        let split = Split::for_search(&flights, seed);
        let options = Options { seed, ..Options::default() };
        let found = diagnose(&flights, &read(QUADROTOR)?, &split.training, &split.test, "test", &options)?;
        assert_eq!(found.diagnosis.accepted, [hidden], "{}", found.diagnosis);
    }
    Ok(())
}

#[test]
fn an_effect_of_the_rotors_is_named_where_it_was_hidden_and_not_without_them() -> Result<()> {
    for (hidden, seed) in
        [(Some(("rotor_inflow", 6e-4)), 74), (Some(("rotor_drag", 6e-4)), 75), (Some(("rotor_gyro", 2e-4)), 76), (None, 77)]
    {
        let flights = flown(&quadrotor(hidden)?, seed, 0.3)?;
        let model = read(QUADROTOR)?;
        let split = Split::for_search(&flights, seed);
        let options = Options { seed, ..Options::default() };
        let found = diagnose(&flights, &model, &split.training, &split.test, "test", &options)?;
        let expected: Vec<&str> = hidden.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(found.diagnosis.accepted, expected, "{}", found.diagnosis);
        if let Some((kind, value)) = hidden {
            let number = found.model.effect(kind).map_or(0.0, |effect| effect.coefficients[0].value);
            assert!((number - value).abs() < 0.2 * value, "{kind}: {number} for {value}");
        }
        // Without its rotors the model cannot be searched for what they do.
        let mut without = model;
        without.rotors.clear();
        let candidates = diagnose(&flights, &without, &split.training, &split.test, "test", &options)?.diagnosis.candidates;
        assert!(
            !candidates.iter().any(|candidate| candidate.effect.starts_with("rotor_") && candidate.effect != "rotor_acceleration")
        );
    }
    Ok(())
}
