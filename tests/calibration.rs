//! Calibration as a whole: recovery, honest intervals under autocorrelated residuals, and refusals that say why.

mod flights;

use flights::{Normal, STEP_S, message, random, with_targets};
use phyture::flight::{Channel, Column, Flight, Span, Targets};
use phyture::physics::{Effect, Model, Parameter, Term, calibrate};
use phyture::{Error, Result};
use phyture_kernels::Tolerance;
use proptest::prelude::*;

fn paper() -> Model {
    Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8)
}

fn whole(flights: &[Flight]) -> Vec<Span> {
    flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect()
}

/// Random coefficients of a helicopter's order of magnitude.
fn randomised(mut model: Model, seed: u64) -> Model {
    let mut normal = Normal::new(seed);
    model
        .effects
        .iter_mut()
        .flat_map(|effect| &mut effect.coefficients)
        .for_each(|coefficient| coefficient.value = 10.0 * normal.next());
    model
}

/// The model without its numbers.
fn blank(model: &Model) -> Model {
    let mut model = model.clone();
    model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).for_each(|coefficient| coefficient.value = 0.0);
    model
}

fn flown_by(model: &Model, seed: u64, samples: usize) -> Result<Flight> {
    let flight = random(seed, samples)?;
    with_targets(&flight, &model.predict(&flight)?)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn exact_data_give_back_the_coefficients(seed in 0u64..1_000_000, delay_s in 0.0..0.05f64) {
        let mut truth = paper();
        truth.data.control_delay_s = delay_s;
        truth.effects.push(Effect::formula("drag", Channel::VxDot, "vx * airspeed", 0.0)?);
        truth.effects.push(Effect::formula("lagged", Channel::WyDot, "lag(vx, 0.2)", 0.0)?);
        // One coefficient shared by two channels.
        let mut shared = Effect::formula("shared", Channel::VyDot, "vx", 0.0)?;
        let twin = Term { channel: Channel::VzDot, coefficient: shared.terms[0].coefficient.clone(), regressor: "-vy".parse()? };
        shared.terms.push(twin);
        truth.effects.push(shared);
        let truth = randomised(truth, seed);
        let flights = [flown_by(&truth, seed, 1500)?, flown_by(&truth, seed + 1, 700)?];
        let (found, calibration) = calibrate(&blank(&truth), &flights, &whole(&flights))?;
        prop_assert_eq!(calibration.rows, 2200);
        prop_assert_eq!(calibration.coefficients.len(), 17);
        for (found, truth) in found.effects.iter().zip(&truth.effects) {
            for (found, truth) in found.coefficients.iter().zip(&truth.coefficients) {
                let error = (found.value - truth.value).abs();
                prop_assert!(error < Tolerance::Close.relative_f64() * truth.value.abs().max(1.0), "{}: {} {}", found.name, found.value, truth.value);
            }
        }
    }

    #[test]
    fn the_way_rows_are_listed_does_not_matter(cut in 100usize..1900, overlap in 0usize..90) {
        let truth = randomised(paper(), 5);
        let flight = flown_by(&truth, 5, 2000)?;
        let mut normal = Normal::new(6);
        let targets = flight.accelerations().map(|values| values.iter().map(|value| value + normal.next()).collect::<Vec<f64>>());
        let flights = [with_targets(&flight, &targets)?];
        let (_, once) = calibrate(&paper(), &flights, &whole(&flights))?;
        let pieces = [Span { flight: 0, start: cut - overlap, end: 2000 }, Span { flight: 0, start: 0, end: cut }];
        let (_, pieced) = calibrate(&paper(), &flights, &pieces)?;
        prop_assert_eq!(once, pieced);
    }
}

#[test]
fn only_the_spans_count() -> Result<()> {
    let truth = randomised(paper(), 9);
    let flight = flown_by(&truth, 9, 3000)?;
    // Spoil everything outside [1000, 2000).
    let targets = flight
        .accelerations()
        .map(|values| values.iter().enumerate().map(|(k, value)| if (1000..2000).contains(&k) { *value } else { 1e3 }).collect());
    let flights = [with_targets(&flight, &targets)?];
    let (found, calibration) = calibrate(&paper(), &flights, &[Span { flight: 0, start: 1000, end: 2000 }])?;
    assert_eq!(calibration.rows, 1000);
    for (found, truth) in found.effects.iter().flat_map(|e| &e.coefficients).zip(truth.effects.iter().flat_map(|e| &e.coefficients))
    {
        assert!((found.value - truth.value).abs() < Tolerance::Close.relative_f64() * truth.value.abs().max(1.0));
    }
    Ok(())
}

/// A flight whose vertical acceleration is `-2 vz - 20 u4 + 3` plus a coloured disturbance; the rest of the model is left out.
fn disturbed(seed: u64, samples: usize, correlation_s: f64) -> Result<Flight> {
    let mut normal = Normal::new(seed);
    let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; samples]);
    let (vz, u4) = (normal.path(samples, 0.5), normal.path(samples, 0.3));
    let gust = normal.path(samples, correlation_s);
    columns[Column::VzDot as usize] = (0..samples).map(|k| -2.0 * vz[k] - 20.0 * u4[k] + 3.0 + gust[k]).collect();
    columns[Column::Vz as usize] = vz;
    columns[Column::U4 as usize] = u4;
    Flight::new(format!("gust{seed}"), "made_up", 0.0, STEP_S, columns, Targets::Recorded)
}

fn vertical() -> Result<Model> {
    let mut model = Model { effects: Vec::new(), ..paper() };
    for (name, formula) in [("heave", "vz"), ("thrust", "u4"), ("bias", "1")] {
        model.effects.push(Effect::formula(name, Channel::VzDot, formula, 0.0)?);
    }
    Ok(model)
}

/// How often, of `replications`, the 95 % intervals hold the truth; one count a coefficient. `shape` gives the flights.
fn coverage(replications: u64, shape: &[usize], correlation_s: f64) -> Result<[u64; 3]> {
    let model = vertical()?;
    let mut hits = [0; 3];
    for replication in 0..replications {
        let flights: Result<Vec<Flight>> = shape
            .iter()
            .enumerate()
            .map(|(index, samples)| disturbed(1 + replication * 1000 + index as u64, *samples, correlation_s))
            .collect();
        let flights = flights?;
        let (_, calibration) = calibrate(&model, &flights, &whole(&flights))?;
        for ((hit, estimate), truth) in hits.iter_mut().zip(&calibration.coefficients).zip([-2.0, -20.0, 3.0]) {
            *hit += u64::from(estimate.ci95.is_some_and(|[low, high]| low <= truth && truth <= high));
        }
    }
    Ok(hits)
}

/// Of 250 intervals that hold the truth with probability 0.95, 225 or fewer do with probability below 1/1000 (binomial, exact
/// sum 8.6e-4). All 250 do with probability 3e-6: such intervals would be far too wide.
const REPLICATIONS: u64 = 250;
const FEWEST_HITS: u64 = 226;

#[test]
fn intervals_cover_under_coloured_disturbances() -> Result<()> {
    for (shape, correlation_s) in [(vec![6000], 0.001), (vec![6000], 0.5), (vec![3000, 3000, 3000], 0.3), (vec![500; 20], 0.2)] {
        let hits = coverage(REPLICATIONS, &shape, correlation_s)?;
        eprintln!("{} flights of {} samples, correlation {correlation_s} s: {hits:?} of {REPLICATIONS}", shape.len(), shape[0]);
        for count in hits {
            assert!((FEWEST_HITS..REPLICATIONS).contains(&count), "{shape:?}, {correlation_s} s: {hits:?}");
        }
    }
    Ok(())
}

/// A flight whose vertical acceleration is `-2 vz - 20 lag(u4, tau) + 3` plus a coloured disturbance.
fn lagged(seed: u64, samples: usize, tau_s: f64, correlation_s: f64) -> Result<Flight> {
    let flight = disturbed(seed, samples, correlation_s)?;
    let stick = flight.column(Column::U4);
    let late =
        format!("-20 * (lag(u4, {tau_s:?}) - u4)")
            .parse::<phyture::formula::Formula>()?
            .evaluate(samples, STEP_S, &|name| (name == "u4").then(|| stick.into()))?;
    let mut targets = flight.accelerations();
    targets[Channel::VzDot].iter_mut().zip(late).for_each(|(target, late)| *target += late);
    with_targets(&flight, &targets)
}

#[test]
fn the_interval_of_a_time_constant_covers_it() -> Result<()> {
    let tau_s = 0.08;
    let mut model = vertical()?;
    let mut servo = Effect::change("servo", "u4", "u4", 0.0)?;
    servo.coefficients.clear();
    servo.swaps[0].with = "lag(u4, tau_s)".parse()?;
    servo.parameters.push(Parameter { name: "tau_s".into(), value: 0.03, unit: "s".into(), fixed: false, ci95: None });
    model.effects.push(servo);
    let (mut hits, replications) = (0, 100);
    for replication in 0..replications {
        let flights = [lagged(7000 + replication, 6000, tau_s, 0.2)?];
        let (found, calibration) = calibrate(&model, &flights, &whole(&flights))?;
        let estimate = calibration.coefficients.iter().find(|estimate| estimate.name == "tau_s");
        let interval = estimate.and_then(|estimate| estimate.ci95).ok_or_else(|| Error::Undetermined("no interval".into()))?;
        let stored = found.effect("servo").map(|servo| (servo.parameters[0].value, servo.parameters[0].ci95));
        assert_eq!(stored, estimate.map(|estimate| (estimate.value, estimate.ci95)));
        hits += u32::from((interval[0]..=interval[1]).contains(&tau_s));
    }
    // Of 100 intervals that hold the truth with probability 0.95, 87 or fewer do with probability below 1/500, all with 0.006.
    assert!((88..=100).contains(&hits), "{hits} of {replications}");
    Ok(())
}

#[test]
fn undetermined_coefficients_are_named_with_the_reason() -> Result<()> {
    let still = |column: Column, value: f64| -> Result<Flight> {
        let flight = random(4, 2000)?;
        let columns = Column::ALL.map(|c| if c == column { vec![value; 2000] } else { flight.column(c).to_vec() });
        Flight::new("still", "made_up", 0.0, STEP_S, columns, Targets::Recorded)
    };
    for (column, value, parts) in [
        (
            Column::U4,
            0.4,
            ["`c_z` of effect `collective_thrust`", "`u4` never varies, so `d_z` of effect `vertical_bias` does the same"],
        ),
        (Column::Vx, 0.0, ["`a_x` of effect `linear_drag`", "`air_vx` is zero in every row"]),
    ] {
        let flights = [still(column, value)?];
        let result = calibrate(&paper(), &flights, &whole(&flights));
        assert!(matches!(result, Err(Error::Undetermined(_))), "{result:?}");
        let text = message(result)?;
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    }

    let flights = [random(4, 2000)?];
    let mut model = paper();
    model.effects.push(Effect::formula("again", Channel::VxDot, "3 * vx", 0.0)?);
    let text = message(calibrate(&model, &flights, &whole(&flights)))?;
    for part in ["`a_x` of effect `linear_drag` and `coefficient` of effect `again`", "`air_vx` and `3 * vx`", "linearly dependent"]
    {
        assert!(text.contains(part), "{text}");
    }
    // Disabled, it takes no part.
    model.effects.iter_mut().filter(|effect| effect.name == "again").for_each(|effect| effect.enabled = false);
    assert_eq!(calibrate(&model, &flights, &whole(&flights))?.1.coefficients.len(), 14);

    let text = message(calibrate(&paper(), &flights, &[Span { flight: 0, start: 10, end: 12 }]))?;
    assert!(text.contains("the training part is 0.02 s of one flight, too little"), "{text}");
    let two = [random(4, 200)?, random(5, 200)?];
    let few = [0, 1].map(|flight| Span { flight, start: 10, end: 11 });
    let text = message(calibrate(&paper(), &two, &few))?;
    assert!(text.contains("2 rows cannot determine 3 coefficients") || text.contains("rows cannot determine 1"), "{text}");
    assert!(message(calibrate(&paper(), &flights, &[]))?.contains("spans are empty"));
    assert!(message(calibrate(&paper(), &flights, &[Span { flight: 3, start: 0, end: 1 }]))?.contains("an index of the 1 flights"));
    model.effects.push(Effect::formula("infinite", Channel::VxDot, "1 / (u1 - u1)", 0.0)?);
    assert!(message(calibrate(&model, &flights, &whole(&flights)))?.contains("effect `infinite` is not a finite number"));
    Ok(())
}

#[test]
fn the_result_is_stored_under_the_agreed_keys() -> Result<()> {
    let truth = randomised(paper(), 2);
    let flights = [flown_by(&truth, 2, 1000)?];
    let (_, calibration) = calibrate(&paper(), &flights, &whole(&flights))?;
    let value = serde_json::to_value(&calibration).map_err(|error| Error::Undetermined(error.to_string()))?;
    let first = &value["coefficients"][0];
    assert_eq!(
        (first["effect"].as_str(), first["name"].as_str(), first["unit"].as_str()),
        (Some("linear_drag"), Some("a_x"), Some("1/s"))
    );
    assert!(first["ci95"][0].as_f64() <= first["value"].as_f64() && first["value"].as_f64() <= first["ci95"][1].as_f64());
    assert!(value["condition_number"].as_f64().is_some_and(|number| number >= 1.0));
    Ok(())
}

#[cfg(feature = "disk")]
#[test]
fn a_model_fits_into_a_binary_container() -> Result<()> {
    let truth = randomised(paper(), 2);
    let flights = [flown_by(&truth, 2, 1000)?];
    let (found, _) = calibrate(&paper(), &flights, &whole(&flights))?;
    let fault = |error: bincode::Error| Error::Undetermined(error.to_string());
    let bytes = bincode::serialize(&found).map_err(fault)?;
    assert_eq!(bincode::deserialize::<Model>(&bytes).map_err(fault)?, found);
    Ok(())
}
