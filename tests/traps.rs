//! Ways in which a search for a missing effect is known to go wrong, each laid out as a trap: simulated flights in which a naive search
//! names what is not there, misses what is, or bends a number. Each test says its trap by its name.
#![cfg(feature = "sim")]

use phyture::critique::diagnose::{CandidateReport, Options, Outcome, Status, Verdict, diagnose};
use phyture::flight::attitude::{rotate, rotation_body_to_inertial};
use phyture::flight::split::Split;
use phyture::flight::{Channel, Column, Flight};
use phyture::physics::{Effect, Model};
use phyture::sim::{COEFFICIENTS, INERTIA_KG_M2, Level, MASS_KG, Mechanisms, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::{Error, Result};
use std::sync::OnceLock;

/// Something that several tests look at and one makes.
type Shared<T> = OnceLock<std::result::Result<T, String>>;

fn shared<T>(slot: &'static Shared<T>, make: impl FnOnce() -> Result<T>) -> Result<&'static T> {
    let made = slot.get_or_init(|| make().map_err(|error| error.to_string()));
    made.as_ref().map_err(|message| Error::Undetermined(message.clone()))
}

fn missing(what: &str) -> Error {
    Error::Undetermined(format!("no {what}"))
}

fn session(minutes: f64, hidden: &[(&str, f64)], level: Level, seed: u64) -> Result<Vec<Flight>> {
    let mut simulation = Simulation { minutes, seed, level, mechanisms: Mechanisms::none(), ..Simulation::default() };
    for (id, scale) in hidden {
        simulation = simulation.hide(id, *scale)?;
    }
    Ok(simulate(&simulation)?.flights)
}

fn paper() -> Model {
    Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

/// The model with the coefficients of the simulator.
fn truth() -> Model {
    let c = COEFFICIENTS;
    let values = c.a.into_iter().chain([c.c1_z, c.d1_z]).chain(c.b).chain(c.c2).chain(c.d2);
    let mut model = paper();
    model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients).zip(values).for_each(|(own, value)| own.value = value);
    model
}

const SEED: u64 = 32;

fn search(flights: &[Flight], model: &Model) -> Result<Outcome> {
    let split = Split::for_search(flights, SEED);
    diagnose(flights, model, &split.training, &split.test, "test", &Options { seed: SEED, ..Options::default() })
}

fn report<'a>(outcome: &'a Outcome, id: &str) -> Result<&'a CandidateReport> {
    outcome.diagnosis.candidates.iter().find(|candidate| candidate.effect == id).ok_or_else(|| missing(id))
}

fn largest_fall(report: &CandidateReport) -> f64 {
    report.held_out_mse_fall.values().copied().fold(f64::NEG_INFINITY, f64::max)
}

fn smallest_fall(outcome: &Outcome) -> f64 {
    outcome.diagnosis.method.as_ref().map_or(f64::NAN, |method| method.smallest_fall)
}

fn parameter(outcome: &Outcome, effect: &str, name: &str) -> Result<f64> {
    let effect = outcome.model.effect(effect).ok_or_else(|| missing(effect))?;
    let parameter = effect.parameters.iter().find(|parameter| parameter.name == name);
    parameter.map(|parameter| parameter.value).ok_or_else(|| missing(name))
}

fn coefficient(outcome: &Outcome, effect: &str, name: &str) -> Result<phyture::physics::Coefficient> {
    let effect = outcome.model.effect(effect).ok_or_else(|| missing(effect))?;
    effect.coefficient(name).cloned().ok_or_else(|| missing(name))
}

/// Flights without a hidden effect.
fn clean() -> Result<&'static Vec<Flight>> {
    static FLIGHTS: Shared<Vec<Flight>> = OnceLock::new();
    shared(&FLIGHTS, || session(12.0, &[], Level::ONE, 32))
}

/// What is said of them.
fn clean_outcome() -> Result<&'static Outcome> {
    static OUTCOME: Shared<Outcome> = OnceLock::new();
    shared(&OUTCOME, || search(clean()?, &paper()))
}

/// Flights of a helicopter whose disc lags behind stick and rate by 50 ms.
fn lagging() -> Result<&'static Vec<Flight>> {
    static FLIGHTS: Shared<Vec<Flight>> = OnceLock::new();
    shared(&FLIGHTS, || session(20.0, &[("cyclic_lag", 1.0)], Level::ONE, 34))
}

fn lagging_outcome() -> Result<&'static Outcome> {
    static OUTCOME: Shared<Outcome> = OnceLock::new();
    shared(&OUTCOME, || search(lagging()?, &paper()))
}

/// The same flights had the controls been held from one sample to the next: what acted `late` samples late is now the mean of that
/// sample and the one before.
fn held(flight: &Flight, late: usize) -> Result<Flight> {
    let mut accelerations = flight.accelerations();
    let c = COEFFICIENTS;
    for (channel, column, power) in [
        (Channel::VzDot, Column::U4, c.c1_z),
        (Channel::WxDot, Column::U1, c.c2[0]),
        (Channel::WyDot, Column::U2, c.c2[1]),
        (Channel::WzDot, Column::U3, c.c2[2]),
    ] {
        let stick = flight.column(column);
        for (sample, value) in accelerations[channel].iter_mut().enumerate() {
            let acted = stick[sample.saturating_sub(late)];
            let before = stick[sample.saturating_sub(late + 1)];
            *value += power * (0.5 * (acted + before) - acted);
        }
    }
    flight.with_accelerations(&accelerations)
}

#[test]
fn controls_held_between_samples_are_half_a_step_and_no_delay() -> Result<()> {
    let flights: Vec<Flight> = clean()?.iter().map(|flight| held(flight, 0)).collect::<Result<_>>()?;
    let outcome = search(&flights, &paper())?;
    assert_eq!(outcome.diagnosis.accepted, [""; 0], "{}", outcome.diagnosis);
    assert!(outcome.diagnosis.notes.iter().any(|note| note.contains("half a step")), "{:?}", outcome.diagnosis.notes);
    assert_eq!(outcome.model.data.control_delay_s, 0.005);
    Ok(())
}

#[test]
fn controls_that_act_at_their_sample_are_given_no_half_step() -> Result<()> {
    let outcome = clean_outcome()?;
    assert_eq!(outcome.diagnosis.notes, [""; 0]);
    assert_eq!(outcome.model.data.control_delay_s, 0.0);
    Ok(())
}

#[test]
fn a_true_delay_of_held_controls_is_a_delay() -> Result<()> {
    let flights = session(12.0, &[("ctrl_delay", 1.0)], Level::ONE, 33)?;
    let flights: Vec<Flight> = flights.iter().map(|flight| held(flight, 4)).collect::<Result<_>>()?;
    let outcome = search(&flights, &paper())?;
    assert_eq!(outcome.diagnosis.accepted.first().map(String::as_str), Some("ctrl_delay"), "{}", outcome.diagnosis);
    // 40 ms of transport and the half step.
    let total = parameter(&outcome, "ctrl_delay", "delay_s")? + outcome.model.data.control_delay_s;
    assert!((total - 0.045).abs() < 0.005, "{total}");
    Ok(())
}

/// A pilot who answers gusts makes yesterday's stick tell of today's gust. With a coefficient of its own the lagged stick takes that for
/// the aircraft: the loop's bias, not noise, so no test for noise protects from it.
#[test]
fn a_lag_with_a_free_coefficient_fits_the_pilot_and_a_swap_does_not() -> Result<()> {
    let mut model = paper();
    for (name, channel, stick) in [("free_roll_lag", Channel::WxDot, "u1"), ("free_pitch_lag", Channel::WyDot, "u2")] {
        let effect = Effect::formula(name, channel, &format!("lag({stick}, 0.05)"), 0.0)?;
        model.effects.push(Effect { enabled: false, ..effect });
    }
    let free = search(clean()?, &model)?;
    let swap = clean_outcome()?;
    println!("{}\n{}", free.diagnosis, swap.diagnosis);
    let fall = |id: &str| report(&free, id).map(largest_fall);
    let bent = fall("free_roll_lag")?.max(fall("free_pitch_lag")?);
    let kept = largest_fall(report(swap, "cyclic_lag")?);
    assert!(bent > 10.0 * kept.max(0.0), "free {bent}, swap {kept}");
    assert!(kept < smallest_fall(swap), "{kept}");
    assert!(!free.diagnosis.accepted.contains(&"cyclic_lag".to_owned()), "{}", free.diagnosis);
    for name in ["free_roll_lag", "free_pitch_lag"] {
        assert!(free.diagnosis.notes.iter().any(|note| note.contains(name)), "{:?}", free.diagnosis.notes);
    }
    assert!(!swap.diagnosis.accepted.contains(&"cyclic_lag".to_owned()), "{}", swap.diagnosis);
    Ok(())
}

/// The likeliest coloured-noise model of such data is that of the pilot, with the sign of the controls turned.
#[test]
fn beside_a_lag_the_controls_stay_those_of_the_helicopter() -> Result<()> {
    let outcome = lagging_outcome()?;
    for (name, truth) in [("c_x", 70.0), ("c_y", 60.0)] {
        let found = coefficient(outcome, "control_moment", name)?.value;
        assert!((found - truth).abs() < 0.15 * truth, "{name}: {found} for {truth}");
    }
    Ok(())
}

#[test]
fn the_pseudo_gain_of_nonlinear_controls_is_not_worth_a_name() -> Result<()> {
    let outcome = clean_outcome()?;
    for id in ["ctrl_nonlin", "rotor_droop", "stall_saturation"] {
        let fall = largest_fall(report(outcome, id)?);
        assert!(fall < smallest_fall(outcome), "{id}: {fall}");
    }
    assert_eq!(outcome.diagnosis.accepted, [""; 0], "{}", outcome.diagnosis);
    Ok(())
}

/// Ground effect is strong enough to be named only where a session flies low much of the time.
fn low() -> Result<&'static Vec<Flight>> {
    static FLIGHTS: Shared<Vec<Flight>> = OnceLock::new();
    shared(&FLIGHTS, || session(20.0, &[("ground_effect", 2.0)], Level::ONE, 36))
}

/// A radius and a coefficient that are both free trade off: a small rotor with a large gain fits as well as the true one.
#[test]
fn ground_effect_takes_its_radius_from_geometry() -> Result<()> {
    let outcome = search(low()?, &paper())?;
    let step = outcome.diagnosis.steps.iter().find(|step| step.effect == "ground_effect");
    let step = step.ok_or_else(|| Error::Undetermined(outcome.diagnosis.to_string()))?;
    let radius = step.parameters.iter().find(|parameter| parameter.name == "radius_m").ok_or_else(|| missing("radius"))?;
    assert!(radius.fixed && radius.value == ROTOR_RADIUS_M, "{radius:?}");
    let k = step.coefficients.iter().find(|number| number.name == "k").ok_or_else(|| missing("k"))?;
    println!("k = {k:?}");
    assert!(0.0 < k.value && k.value < 3.0, "{k:?}");
    // Twice the theory is what was hidden.
    assert!(k.ci95.is_some_and(|[low, high]| low <= 2.0 && 2.0 <= high), "{k:?}");
    Ok(())
}

/// With a lag of the wrong length in the model, what it leaves looks like a curved stick or a dihedral.
#[test]
fn a_lag_is_refined_before_anything_else_is_named() -> Result<()> {
    let outcome = lagging_outcome()?;
    assert_eq!(outcome.diagnosis.accepted, ["cyclic_lag"], "{}", outcome.diagnosis);
    for name in ["tau_x_s", "tau_y_s"] {
        let tau = parameter(outcome, "cyclic_lag", name)?;
        assert!((tau - 0.05).abs() < 0.01, "{name}: {tau}");
    }
    Ok(())
}

/// Gusts last for many samples: rows are not independent observations, blocks are.
#[test]
fn intervals_from_rows_would_be_too_narrow() -> Result<()> {
    let (flights, outcome) = (lagging()?, lagging_outcome()?);
    let [low, high] = coefficient(outcome, "linear_drag", "a_x")?.ci95.ok_or_else(|| missing("interval"))?;
    let (mut error, mut energy, mut rows) = (0.0, 0.0, 0.0);
    for span in Split::for_search(flights, SEED).training {
        let flight = &flights[span.flight];
        let predicted = outcome.model.predict(flight)?;
        for ((measured, predicted), vx) in
            flight.column(Column::VxDot).iter().zip(&predicted[Channel::VxDot]).zip(flight.column(Column::Vx))
        {
            error += (measured - predicted).powi(2);
            energy += vx * vx;
            rows += 1.0;
        }
    }
    // One free coefficient acts in this channel.
    let by_rows = 2.0 * 1.96 * (error / rows / energy).sqrt();
    println!("by blocks {}, by rows {by_rows}", high - low);
    assert!(high - low > 2.0 * by_rows, "by blocks {}, by rows {by_rows}", high - low);
    Ok(())
}

/// `clean` with a formula added to ẍ within one flight, and the formula as a candidate.
fn in_one_flight(formula: &str, flight: usize, size: f64) -> Result<Outcome> {
    let mut flights = clean()?.clone();
    let own = flights.get(flight).ok_or_else(|| missing("flight"))?;
    let mut accelerations = own.accelerations();
    let added = phyture::physics::evaluate(&phyture::formula::Formula::parse(formula)?, own)?;
    let third = own.len() / 3;
    accelerations[Channel::VxDot].iter_mut().zip(&added).take(third).for_each(|(value, added)| *value += size * added);
    flights[flight] = own.with_accelerations(&accelerations)?;
    let mut model = paper();
    model.effects.push(Effect { enabled: false, ..Effect::formula("fluke", Channel::VxDot, formula, 0.0)? });
    search(&flights, &model)
}

#[test]
fn one_wild_block_does_not_make_an_effect() -> Result<()> {
    let searched = Split::for_search(clean()?, SEED).training;
    let flight = searched.first().ok_or_else(|| missing("flight"))?.flight;
    // The error of that block outweighs all others together.
    let outcome = in_one_flight("sin(3 * height) + vy", flight, 30.0)?;
    let report = report(&outcome, "fluke")?;
    println!("{report:?}");
    assert_eq!(report.status, Status::NotSignificant, "{}", outcome.diagnosis);
    assert_eq!(outcome.diagnosis.accepted, [""; 0], "{}", outcome.diagnosis);
    Ok(())
}

#[test]
fn an_effect_that_one_manoeuvre_carries_is_not_excited() -> Result<()> {
    let flights = clean()?;
    let peak = |flight: usize| flights[flight].column(Column::Vx).iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut searched: Vec<usize> = Split::for_search(flights, SEED).training.iter().map(|span| span.flight).collect();
    searched.sort_by(|&left, &right| peak(right).total_cmp(&peak(left)));
    // Two flights are faster than the third.
    let (Some(&fastest), Some(&third)) = (searched.first(), searched.get(2)) else { return Err(missing("flights")) };
    let outcome = in_one_flight(&format!("max(vx - {}, 0)", peak(third)), fastest, 5.0)?;
    let report = report(&outcome, "fluke")?;
    println!("{report:?}");
    assert_eq!(report.status, Status::NotExcited, "{}", outcome.diagnosis);
    assert!(!outcome.diagnosis.accepted.contains(&"fluke".to_owned()), "{}", outcome.diagnosis);
    Ok(())
}

/// The disc delays the rate damping with the stick. Were only the stick lagged, cross-coupling of the rates would fit better.
#[test]
fn a_lagging_disc_is_no_cross_coupling_of_rates() -> Result<()> {
    let flights = session(15.0, &[("cyclic_lag", 1.0), ("wind", 1.0)], Level::TWO, 35)?;
    let outcome = search(&flights, &paper())?;
    let mut names = outcome.diagnosis.accepted.clone();
    names.retain(|name| name != "wind");
    assert_eq!(names.first().map(String::as_str), Some("cyclic_lag"), "{}", outcome.diagnosis);
    assert!(!names.contains(&"rate_cross".to_owned()), "{}", outcome.diagnosis);
    Ok(())
}

/// The wind of each flight, north and east: the same session without gusts and noise, in which it is all that the true coefficients
/// leave unexplained.
fn winds(seed: u64, minutes: f64) -> Result<Vec<(String, [f64; 2])>> {
    let model = truth();
    let one = |flight: &Flight| -> Result<(String, [f64; 2])> {
        let predicted = model.predict(flight)?;
        let mut sum = [0.0; 3];
        for (sample, _) in flight.column(Column::Vx).iter().enumerate() {
            let at = |column: Column| flight.column(column)[sample];
            let air: [f64; 3] = std::array::from_fn(|axis| {
                let target = [Column::VxDot, Column::VyDot, Column::VzDot][axis];
                -(at(target) - predicted.values()[axis][sample]) / COEFFICIENTS.a[axis]
            });
            let rotation = rotation_body_to_inertial(at(Column::Roll), at(Column::Pitch), at(Column::Yaw));
            sum.iter_mut().zip(rotate(&rotation, air)).for_each(|(sum, value)| *sum += value / flight.len() as f64);
        }
        Ok((flight.name.clone(), [sum[0], sum[1]]))
    };
    session(minutes, &[("wind", 1.0)], Level::QUIET, seed)?.iter().map(one).collect()
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let count = pairs.len() as f64;
    let (mx, my) = pairs.iter().fold((0.0, 0.0), |(x, y), pair| (x + pair.0 / count, y + pair.1 / count));
    let sum = |term: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, y)| term(x - mx, y - my)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

/// Columns for the whole session cannot say it: the wind blows from elsewhere in each flight.
#[test]
fn wind_that_differs_by_flight_is_found_flight_by_flight() -> Result<()> {
    let (minutes, seed) = (15.0, 38);
    let outcome = search(&session(minutes, &[("wind", 1.0)], Level::ONE, seed)?, &paper())?;
    assert_eq!(outcome.diagnosis.accepted, ["wind"], "{}", outcome.diagnosis);
    let winds = winds(seed, minutes)?;
    for (name, axis) in [("wind_n", 0), ("wind_e", 1)] {
        let found = coefficient(&outcome, "wind", name)?.by_flight.ok_or_else(|| missing("values by flight"))?;
        let pairs: Vec<(f64, f64)> = winds.iter().filter_map(|(flight, wind)| Some((*found.get(flight)?, wind[axis]))).collect();
        println!("{name}: {} flights, correlation {}", pairs.len(), correlation(&pairs));
        assert!(pairs.len() > 20 && correlation(&pairs) > 0.9, "{name}: {pairs:?}");
        // Three metres a second from anywhere.
        let speed = winds.iter().map(|(_, [n, e])| n.hypot(*e)).sum::<f64>() / winds.len() as f64;
        assert!((speed - 3.0).abs() < 0.1, "{speed}");
    }
    Ok(())
}

#[test]
fn two_minutes_are_too_little_data() -> Result<()> {
    let outcome = search(&session(2.0, &[("collective_torque", 1.0)], Level::ONE, 39)?, &paper())?;
    assert_eq!(outcome.diagnosis.verdict, Verdict::TooLittleData, "{}", outcome.diagnosis);
    assert_eq!(outcome.diagnosis.accepted, [""; 0]);
    Ok(())
}

#[test]
fn without_low_flight_ground_effect_is_not_judged() -> Result<()> {
    let high = |flight: &&Flight| flight.column(Column::Z).iter().all(|z| -z > 3.0);
    let flights: Vec<Flight> = low()?.iter().filter(high).cloned().collect();
    println!("{} of {} flights stay above 3 m", flights.len(), low()?.len());
    let outcome = search(&flights, &paper())?;
    assert_ne!(outcome.diagnosis.verdict, Verdict::TooLittleData, "{}", outcome.diagnosis);
    assert_eq!(report(&outcome, "ground_effect")?.status, Status::NotExcited, "{}", outcome.diagnosis);
    assert!(!outcome.diagnosis.accepted.contains(&"ground_effect".to_owned()), "{}", outcome.diagnosis);
    Ok(())
}
