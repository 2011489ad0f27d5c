//! Effects of the catalogue on made-up flights: calibrated back when formulas read other coefficients, flight by flight for wind and
//! bias, and implanted into recorded flights.
#![cfg(feature = "files")]

mod flights;

use flights::{Normal, STEP_S, message, random, with_targets};
use phyture::flight::{Column, DataSet, Flight, Span, Targets};
use phyture::physics::{Effect, Model, calibrate, catalogue, implant, spread_over_flights, typical};
use phyture::{Error, Result};
use phyture_kernels::Tolerance;

fn missing(what: &str) -> Error {
    Error::Undetermined(format!("no {what}"))
}

/// The paper's model with numbers of a helicopter's size.
fn helicopter() -> Model {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    let values = [-0.35, -0.4, -1.42, -20.0, -0.51, -9.0, -8.0, -5.5, 70.0, 60.0, 50.0, -1.23, -0.21, 0.14];
    let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
    coefficients.zip(values).for_each(|(coefficient, value)| coefficient.value = value);
    model
}

fn entry(kind: &str, scale: f64) -> Result<Effect> {
    let definition = catalogue::definition(kind).ok_or_else(|| missing(kind))?;
    Ok(typical(definition, scale, &helicopter()))
}

fn whole(flights: &[Flight]) -> Vec<Span> {
    flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect()
}

/// The model with every coefficient zero and no flight known.
fn blank(model: &Model) -> Model {
    let mut model = model.clone();
    for coefficient in model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients) {
        coefficient.value = 0.0;
        coefficient.by_flight.iter_mut().for_each(std::collections::BTreeMap::clear);
    }
    model
}

/// A flight whose accelerations are the model's plus white noise.
fn flown_by(model: &Model, seed: u64, samples: usize, noise: f64) -> Result<Flight> {
    let flight = random(seed, samples)?;
    let mut normal = Normal::new(seed + 1000);
    let mut targets = model.predict(&flight)?;
    targets.iter_mut().flatten().for_each(|value| *value += noise * normal.next());
    with_targets(&flight, &targets)
}

#[test]
fn formulas_that_read_coefficients_are_calibrated_with_them() -> Result<()> {
    let mut truth = helicopter();
    for kind in ["ground_effect", "imu_lever", "flap_tilt", "cg_offset"] {
        truth.effects.push(entry(kind, 1.0)?);
    }
    let flights = [flown_by(&truth, 1, 4000, 0.0)?, flown_by(&truth, 2, 4000, 0.0)?];
    // Near the ground, or nothing of it would show.
    let near = |flight: &Flight| -> Result<Flight> {
        let columns = Column::ALL.map(|column| match column {
            Column::Z => flight.column(column).iter().map(|z| 0.1 * z).collect(),
            _ => flight.column(column).to_vec(),
        });
        let flight = Flight::new(flight.name.clone(), "low", 0.0, STEP_S, columns, Targets::Recorded)?;
        with_targets(&flight, &truth.predict(&flight)?)
    };
    let flights = [near(&flights[0])?, near(&flights[1])?];
    let (found, calibration) = calibrate(&blank(&truth), &flights, &whole(&flights))?;
    assert!(calibration.rounds > 1 && calibration.rounds <= 8, "{calibration}");
    let pairs = found.effects.iter().zip(&truth.effects).flat_map(|(found, truth)| {
        found.coefficients.iter().zip(&truth.coefficients).map(|(found, truth)| (&found.name, found.value, truth.value))
    });
    for (name, found, truth) in pairs {
        assert!((found - truth).abs() < 1e-5 * truth.abs().max(1.0), "{name}: {found} for {truth}; {calibration}");
    }
    // Once more changes nothing that matters.
    let (_, again) = calibrate(&found, &flights, &whole(&flights))?;
    assert!(again.last_change < 1e-2, "{again}");
    assert!(!calibration.coefficients.iter().any(phyture::physics::Estimate::is_implausible));
    Ok(())
}

#[test]
fn what_physics_does_not_allow_is_marked() -> Result<()> {
    let mut truth = helicopter();
    let mut drag = entry("quad_drag", 1.0)?;
    drag.coefficients.iter_mut().for_each(|coefficient| coefficient.value = 0.02);
    truth.effects.push(drag);
    let flights = [flown_by(&truth, 3, 4000, 0.1)?];
    let (_, calibration) = calibrate(&blank(&truth), &flights, &whole(&flights))?;
    assert_eq!(calibration.coefficients.iter().filter(|estimate| estimate.is_implausible()).count(), 3);
    assert!(calibration.to_string().contains("outside its physical bounds -0.1 to 0"), "{calibration}");
    Ok(())
}

/// Found and true values by flight of every coefficient of an effect.
fn by_flight<'a>(found: &'a Model, truth: &'a Model, kind: &str) -> Result<Vec<(&'a str, f64, f64)>> {
    let (found, truth) = (found.effect(kind).ok_or_else(|| missing(kind))?, truth.effect(kind).ok_or_else(|| missing(kind))?);
    let mut pairs = Vec::new();
    for (found, truth) in found.coefficients.iter().zip(&truth.coefficients) {
        let (found_all, truth_all) = (found.by_flight.iter().flatten(), truth.by_flight.iter().flatten());
        for ((name, value), (flight, expected)) in found_all.zip(truth_all) {
            assert_eq!(name, flight);
            pairs.push((found.name.as_str(), *value, *expected));
        }
        let mean = found.by_flight.iter().flatten().map(|(_, value)| value).sum::<f64>() / 6.0;
        assert!((found.value - mean).abs() < 1e-9 && found.ci95.is_none());
    }
    Ok(pairs)
}

#[test]
fn wind_is_found_flight_by_flight() -> Result<()> {
    let mut truth = helicopter();
    let blank_flights = (1..=6).map(|seed| random(seed, 10)).collect::<Result<Vec<_>>>()?;
    truth.effects.push(spread_over_flights(entry("wind", 1.0)?, &blank_flights));
    let flights = (1..=6).map(|seed| flown_by(&truth, seed, 3000, 0.3)).collect::<Result<Vec<_>>>()?;
    let (found, calibration) = calibrate(&blank(&truth), &flights, &whole(&flights))?;
    let pairs = by_flight(&found, &truth, "wind")?;
    assert_eq!(pairs.len(), 12);
    for (name, found, truth) in &pairs {
        // Noise of 0.3 on 3000 samples of a regressor of 0.35 gives 0.016 m/s; the drag itself is estimated too.
        assert!((found - truth).abs() < 0.1, "{name}: {found} for {truth}");
    }
    assert!(pairs.iter().map(|(_, _, truth)| truth * truth).sum::<f64>() > 50.0, "the winds are winds");
    let wind: Vec<_> = calibration.coefficients.iter().filter(|estimate| estimate.effect == "wind").collect();
    assert!(
        wind.iter().all(|estimate| estimate.ci95.is_none() && estimate.by_flight.as_ref().is_some_and(|values| values.len() == 6))
    );
    assert!(calibration.to_string().contains("in 6 flights"), "{calibration}");
    // Without it the drag is wrong by more than its interval says.
    let x = found.effect("linear_drag").and_then(|drag| drag.coefficient("a_x")).ok_or_else(|| missing("a_x"))?;
    assert!((x.value + 0.35).abs() < 0.01 && x.ci95.is_some_and(|[low, high]| high - low < 0.02), "{x:?}");
    // A stored model says the same of every flight.
    let read = Model::from_toml(&found.to_toml()?, std::path::Path::new("n9"))?;
    assert_eq!(read, found);
    Ok(())
}

#[test]
fn a_bias_is_found_flight_by_flight() -> Result<()> {
    let mut truth = helicopter();
    let names = (1..=6).map(|seed| random(seed, 10)).collect::<Result<Vec<_>>>()?;
    truth.effects.push(spread_over_flights(entry("sensor_bias", 1.0)?, &names));
    let flights = (1..=6).map(|seed| flown_by(&truth, seed, 3000, 0.1)).collect::<Result<Vec<_>>>()?;
    let (found, calibration) = calibrate(&blank(&truth), &flights, &whole(&flights))?;
    let pairs = by_flight(&found, &truth, "sensor_bias")?;
    assert_eq!(pairs.len(), 36);
    for (name, found, truth) in &pairs {
        let allowed = if name.starts_with("b_w") { 0.003 } else { 0.02 };
        assert!((found - truth).abs() < allowed, "{name}: {found} for {truth}\n{calibration}");
    }
    Ok(())
}

#[test]
fn what_is_implanted_is_found_again() -> Result<()> {
    let model = helicopter();
    let data = DataSet { flights: vec![flown_by(&model, 1, 3000, 0.3)?, flown_by(&model, 2, 3000, 0.3)?], ..DataSet::default() };
    let effect = entry("quad_drag", 2.0)?;
    let changed = implant(&data, &model, &effect)?;
    let (before, after) = (&data.flights[0], &changed.flights[0]);
    for column in Column::STATE.iter().copied().chain([Column::WxDot, Column::WyDot, Column::WzDot]) {
        assert_eq!(before.column(column), after.column(column), "{}", column.name());
    }
    let mut searched = blank(&model);
    searched
        .effects
        .push(Effect { added_by: None, ..blank(&Model { effects: vec![effect.clone()], ..model.clone() }).effects.remove(0) });
    let (found, _) = calibrate(&searched, &changed.flights, &whole(&changed.flights))?;
    let found = found.effect("quad_drag").ok_or_else(|| missing("drag"))?;
    for (found, truth) in found.coefficients.iter().zip(&effect.coefficients) {
        assert!((found.value - truth.value).abs() < 0.1 * truth.value.abs(), "{} {} {}", found.name, found.value, truth.value);
    }
    let mut twice = model.clone();
    twice.effects.push(effect.clone());
    assert!(message(implant(&data, &twice, &effect))?.contains("a model without it"));
    Ok(())
}

#[test]
fn an_implanted_lag_is_the_lagged_model() -> Result<()> {
    let model = helicopter();
    let data = DataSet { flights: vec![flown_by(&model, 1, 800, 0.0)?], ..DataSet::default() };
    let lag = entry("cyclic_lag", 2.0)?;
    let value = |name: &str| lag.parameters.iter().find(|parameter| parameter.name == name).map(|parameter| parameter.value);
    assert_eq!((value("tau_x_s"), value("share")), (Some(0.1), Some(0.7)), "times are scaled, shares are not");
    let slow = entry("servo_rate_limit", 2.0)?;
    assert_eq!(slow.parameters[0].value.to_bits(), 1.5_f64.to_bits(), "twice the effect is half the rate");
    let changed = implant(&data, &model, &lag)?;
    let mut with = model.clone();
    with.effects.push(lag);
    for (found, expected) in changed.flights[0].accelerations().iter().zip(with.predict(&data.flights[0])?) {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e3 * Tolerance::Close.relative_f64());
        }
    }
    assert_eq!(changed.flights[0].column(Column::VzDot), data.flights[0].column(Column::VzDot));
    Ok(())
}
