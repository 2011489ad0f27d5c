//! The part of the hidden-effect benchmark that runs in the test suite: something is hidden in simulated flights, and the search has to
//! name it, or to keep quiet. The whole benchmark is `benches/hidden_effect`.
//!
//! Seeds 31 to 39 and from 1100 on; the search is deterministic, so a count that holds here holds on every run. What chance has a part
//! in is counted all the same, so that a harmless change of the simulator or of the search does not hang on one data set: the
//! reasoning stands at each count.
#![cfg(all(feature = "files", feature = "sim"))]

#[allow(dead_code, reason = "the benchmark uses the rest")]
#[path = "../benches/hidden_effect/cases.rs"]
mod cases;

use cases::SINGLES;
use phyture::Result;
use phyture::critique::diagnose::{Diagnosis, Options, Verdict, amend, calibrated, diagnose, together};
use phyture::critique::floor_of_spans;
use phyture::flight::split::Split;
use phyture::flight::{Column, Flight};
use phyture::formula::Formula;
use phyture::physics::{Model, evaluate};
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, Mechanisms, ROTOR_RADIUS_M, Simulation, simulate, simulate_with_explainable};

/// Removable share of the best channel's held-out mean squared error at which effects are hidden: between medium and large. Effects in
/// time are hidden at their physical size: this share would be a delay of less than a sample, and all of them look alike then.
const SHARE: f64 = 0.3;

/// A session with these mechanisms and no others. At level two, as in a real field, there is wind.
fn session(minutes: f64, hidden: &[&str], level: Level, seed: u64) -> Result<Vec<Flight>> {
    Ok(simulate(&simulation(minutes, hidden, level, seed)?)?.flights)
}

fn simulation(minutes: f64, hidden: &[&str], level: Level, seed: u64) -> Result<Simulation> {
    let mut simulation = Simulation { minutes, seed, level, mechanisms: Mechanisms::none(), ..Simulation::default() };
    if level == Level::TWO && !hidden.contains(&"wind") {
        simulation = simulation.hide("wind", 1.0)?;
    }
    for id in hidden {
        let single = SINGLES.iter().find(|single| single.id == *id && !single.dynamic);
        let scale = single.map_or(1.0, |single| single.scale(SHARE));
        simulation = simulation.hide(id, scale)?;
    }
    Ok(simulation)
}

fn search(flights: &[Flight], seed: u64) -> Result<Diagnosis> {
    let model = Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let split = Split::for_search(flights, seed);
    let options = Options { seed, ..Options::default() };
    let diagnosis = diagnose(flights, &model, &split.training, &split.test, "test", &options)?.diagnosis;
    println!("seed {seed}: {} {:?}, {:.1} s", diagnosis.verdict.words(), diagnosis.accepted, diagnosis.seconds);
    if std::env::var_os("PRINT_ALL").is_some() {
        println!("{diagnosis}");
    }
    Ok(diagnosis)
}

/// Effects named; without the wind of level two, which is there.
fn named(diagnosis: &Diagnosis, level: Level) -> Vec<&str> {
    let names = diagnosis.accepted.iter().map(String::as_str);
    names.filter(|name| !(level == Level::TWO && *name == "wind")).collect()
}

/// Half of level one, half of level two.
fn level(seed: u64) -> Level {
    if seed.is_multiple_of(2) { Level::ONE } else { Level::TWO }
}

/// Of six effects that are hidden at once, wind beside them, the search is to name five at least and at most one more, and to remove nine
/// tenths of what lies above the floor on flights that it has not seen.
#[test]
fn many_effects_hidden_at_once_are_named_from_both_ends() -> Result<()> {
    let hidden = ["ctrl_cross", "cyclic_lag", "collective_torque", "dihedral_speedstab", "weathercock", "transl_lift"];
    let (set, explainable) = simulate_with_explainable(&simulation(15.0, &hidden, Level::TWO, 1190)?)?;
    let diagnosis = search(&set.flights, 1190)?;
    let named = named(&diagnosis, Level::TWO);
    assert!(diagnosis.both_roads && diagnosis.accepted.iter().any(|name| name == "wind"), "{diagnosis}");
    let right = named.iter().filter(|name| hidden.contains(name)).count();
    assert!(right >= 5 && named.len() - right <= 1, "{diagnosis}");
    let mut locked = diagnosis.locked.expect("a part is kept");
    assert!(locked.own_from_first_half, "the wind of a flight that was kept is found from its first half");
    locked.set_floor(floor_of_spans(&set.flights, &locked.spans, &explainable.flights)?);
    let removed = locked.removable_removed.expect("a floor was set");
    assert!(removed.mean.is_some_and(|mean| mean > 0.9), "{removed:?}");
    Ok(())
}

/// Wind moves vz_dot more than all else here, and a sensor's lever ties the numbers of all channels together: neither may hide from the test of
/// another effect what that removes, be it a change of a signal in time or a number of its own.
#[test]
fn what_a_flight_has_for_itself_hides_nothing_else() -> Result<()> {
    for (others, seed) in [(&["inflow_lag"][..], 1191), (&["imu_lever", "mass_drift"][..], 1193)] {
        let diagnosis = search(&session(15.0, others, Level::TWO, seed)?, seed)?;
        let mut named = named(&diagnosis, Level::TWO);
        named.sort_unstable();
        assert!(named == others && diagnosis.accepted.iter().any(|name| name == "wind"), "{diagnosis:#}");
    }
    Ok(())
}

/// Of the twelve the search is to name 97 % first: eleven or more then with a probability of 95 %, ten or more with 99.5 %. Ten are
/// asked. A name drawn from the catalogue would be right once in thirty.
#[test]
fn a_single_hidden_effect_is_named_first() -> Result<()> {
    let cases = [
        ("quad_drag", 31),
        ("inertia_cross", 32),
        ("ctrl_cross", 33),
        ("collective_torque", 34),
        ("transl_lift", 34),
        ("rate_cross", 35),
        ("cyclic_lag", 36),
        ("ctrl_delay", 37),
        ("weathercock", 38),
        ("tail_lag", 38),
        ("cg_offset", 39),
        ("tail_side_force", 32),
    ];
    let mut missed = Vec::new();
    for (id, seed) in cases {
        let level = level(seed);
        let diagnosis = search(&session(20.0, &[id], level, seed)?, seed)?;
        if named(&diagnosis, level).first() != Some(&id) {
            missed.push(format!("{id} (seed {seed}): {diagnosis}"));
        }
    }
    assert!(missed.len() <= 2, "{}", missed.join("\n"));
    Ok(())
}

/// At most 2 % of data sets may name what is not there: of fourteen then none with 75 %, one or none with 97 %. One is let pass.
#[test]
fn nothing_is_named_where_nothing_is_hidden() -> Result<()> {
    let mut alarms = Vec::new();
    for seed in 1100..1114 {
        let level = level(seed);
        let diagnosis = search(&session(15.0, &[], level, seed)?, seed)?;
        if !named(&diagnosis, level).is_empty() {
            alarms.push(format!("seed {seed}: {diagnosis}"));
        }
    }
    assert!(alarms.len() <= 1, "{}", alarms.join("\n"));
    Ok(())
}

/// Each effect by itself would remove 30 % of a channel's error, ten times what is certain to be found; nothing is left to chance.
#[test]
fn of_two_hidden_effects_both_are_named_and_nothing_else() -> Result<()> {
    for (pair, seed) in [(["collective_torque", "quad_drag"], 1130), (["dihedral_speedstab", "rate_cross"], 1132)] {
        let diagnosis = search(&session(20.0, &pair, Level::ONE, seed)?, seed)?;
        let mut names = named(&diagnosis, Level::ONE);
        names.sort_unstable();
        assert_eq!(names, pair, "{diagnosis}");
        let doubted = diagnosis.steps.iter().flat_map(|step| &step.indistinguishable);
        assert_eq!(doubted.filter(|other| pair.contains(&other.as_str())).count(), 0, "{diagnosis}");
    }
    Ok(())
}

/// Adds a formula to a recorded acceleration.
fn implant(flight: &Flight, channel: Column, formula: &Formula) -> Result<Flight> {
    let added = evaluate(formula, flight)?;
    let columns = Column::ALL.map(|column| {
        let mut values = flight.column(column).to_vec();
        if column == channel {
            values.iter_mut().zip(&added).for_each(|(value, added)| *value += added);
        }
        values
    });
    Flight::new(flight.name.clone(), flight.manoeuvre.clone(), flight.start_s, flight.step_s, columns, flight.targets)
}

/// The added wave is as strong as the gusts and more; nothing is left to chance.
#[test]
fn an_effect_outside_the_catalogue_gets_no_name_but_its_variable() -> Result<()> {
    for (channel, formula, variable, seed) in
        [(Column::VxDot, "0.6 * sin(2 * height)", "height", 1140), (Column::WxDot, "0.8 * cos(2 * yaw)", "yaw", 1142)]
    {
        let formula = Formula::parse(formula)?;
        let flights = session(20.0, &[], Level::ONE, seed)?;
        let flights: Vec<Flight> = flights.iter().map(|flight| implant(flight, channel, &formula)).collect::<Result<_>>()?;
        let diagnosis = search(&flights, seed)?;
        assert_eq!(diagnosis.accepted, [""; 0], "{diagnosis}");
        assert_eq!(diagnosis.verdict, Verdict::NotInCatalogue, "{diagnosis}");
        let unknown = diagnosis.unknown.iter().flatten().find(|unknown| unknown.channel == channel.name());
        let first = unknown.and_then(|unknown| unknown.depends_on.first()).map(|on| on.variable.as_str());
        assert_eq!(first, Some(variable), "{diagnosis}");
    }
    Ok(())
}

/// The main rotor's wake sweeps over the tail at 7 m/s against the air, 4 rad/s² within 2 m/s, in a wind that blurs it over ground: no effect of the
/// catalogue, but a loop that may add formulas finds where it is, and removes most of what it did.
#[test]
fn a_bump_against_the_air_is_added_as_a_formula() -> Result<()> {
    let (set, explainable) = simulate_with_explainable(&simulation(20.0, &["tail_wake"], Level::TWO, 1194)?)?;
    let split = Split::for_search(&set.flights, 1194);
    let model = Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let before = calibrated(&model, &set.flights, &split)?;
    let options = Options { seed: 1194, formulas: true, ..Options::default() };
    let amended = amend(&set.flights, &model, &split, &options, &mut |_, _| Ok(()))?;
    let mut whole = together(&set.flights, &before, &amended, &split)?;
    assert_eq!(whole.accepted, ["wind", "suggested_wy_dot"], "{whole}");
    let added = amended.model.effect("suggested_wy_dot").expect("it was accepted");
    let formula = added.terms[0].regressor.to_string();
    assert!(added.enabled && formula.starts_with("exp(") && formula.contains("air_vx"), "{formula}");
    assert!(added.coefficients[0].value > 2.0, "{added}");
    let written = Model::from_toml(&amended.model.to_toml()?, "amended.toml".as_ref())?;
    assert!(written.effect("suggested_wy_dot").is_some_and(|effect| effect.enabled), "a model file holds it");
    let locked = whole.locked.as_mut().expect("a part is kept");
    locked.set_floor(floor_of_spans(&set.flights, &locked.spans, &explainable.flights)?);
    let removed = locked.removable_removed.as_ref().expect("a floor was set");
    assert!(removed.wy_dot.is_some_and(|share| share > 0.7), "{removed:?}");
    Ok(())
}
