//! Rollouts as the studio gives them: that they begin where they are asked to, that errors are those of the states, and what is said where a log does
//! not allow them.

use crate::support::{blank, studio};
use phyture::flight::split::Split;
use phyture::flight::{Column, DataSet};
use phyture::sim::{Simulation, simulate};
use phyture::studio::{Found, Opening, PathText, RolloutText, RolloutWanted, Studio};
use phyture::{Error, Result};
use std::sync::Arc;

fn known<T>(found: Found<T>) -> Result<T> {
    found.known().ok_or_else(|| Error::Undetermined("nothing was rolled out".into()))
}

fn rolled(studio: &Studio, at_s: f64, ahead_s: f64) -> Result<RolloutText> {
    known(studio.rollout(&RolloutWanted { flight: 0, at_s: Some(at_s), ahead_s, network: None })?)
}

/// The distance of two columns of three at a place.
fn apart(a: &[Vec<f32>; 3], b: &[Vec<f32>; 3], at: [usize; 2]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a[at[0]] - b[at[1]]).powi(2));
    squares.sum::<f64>().sqrt()
}

#[test]
fn a_rollout_begins_where_it_is_asked_to_and_its_errors_are_those_of_its_states() -> Result<()> {
    let studio = studio(None)?;
    let found = rolled(&studio, 5.0, 1.0)?;
    let end = found.ahead_s.len() - 1;
    assert!((found.at_s - 5.0).abs() < 0.01 && (found.ahead_s[end] - 1.0).abs() < 1e-9 && found.ahead_s[0] == 0.0);
    let names: Vec<&str> = found.paths.iter().map(|path| path.name.as_str()).collect();
    assert_eq!(names, ["state held", "model, rates held", "model"]);
    let [held, without_turning, model] = found.paths.as_slice() else { return Err(Error::Undetermined("three rows".into())) };
    for path in &found.paths {
        let of =
            |error: &[f32], apart: f64| assert!((f64::from(error[end]) - apart).abs() < 1e-4, "{}: {error:?} {apart}", path.name);
        of(&path.error.position, apart(&found.measured.position, &path.states.position, [end, end]));
        of(&path.error.velocity, apart(&found.measured.velocity, &path.states.velocity, [end, end]));
        of(&path.error.rates, apart(&found.measured.rates, &path.states.rates, [end, end]));
        assert_eq!([path.error.position[0], path.error.attitude[0]], [0.0; 2], "nothing is wrong at the start");
        assert_eq!(apart(&path.states.position, &path.states.position, [0, 0]).to_bits(), 0.0_f64.to_bits());
    }
    let moves = |path: &PathText| apart(&path.states.velocity, &path.states.velocity, [0, end]);
    assert!(moves(held) == 0.0 && moves(model) > 0.0);
    assert_eq!(apart(&without_turning.states.rates, &without_turning.states.rates, [0, end]).to_bits(), 0.0_f64.to_bits());
    assert!(apart(&model.states.rates, &model.states.rates, [0, end]) > 0.0);
    // A moment too late is moved forward, one before the flight to its beginning.
    let duration_s = studio.overview().flights[0].duration_s;
    let late = rolled(&studio, 1e6, 1.0)?.at_s;
    assert!((duration_s - 1.1..duration_s - 0.9).contains(&late), "{late} of {duration_s}");
    assert!(rolled(&studio, -3.0, 1.0)?.at_s < 0.1);
    // Points are thinned, not the steps of the integration.
    let long = rolled(&studio, 5.0, 10.0)?;
    assert!(long.ahead_s.len() <= 201 && (long.ahead_s[long.ahead_s.len() - 1] - 10.0).abs() < 1e-9);
    let refused = |wanted| assert!(matches!(studio.rollout(&wanted), Err(Error::Config { .. })), "{wanted:?}");
    refused(RolloutWanted { flight: 99, at_s: None, ahead_s: 1.0, network: None });
    [0.0, -1.0, 1e3, f64::NAN]
        .into_iter()
        .for_each(|ahead_s| refused(RolloutWanted { flight: 0, at_s: None, ahead_s, network: None }));
    refused(RolloutWanted { flight: 0, at_s: Some(f64::NAN), ahead_s: 1.0, network: None });
    Ok(())
}

#[test]
fn over_all_starts_the_model_predicts_more_than_no_change() -> Result<()> {
    let studio = studio(None)?;
    let found = known(studio.rollouts(0.5, None)?)?;
    let rows = &found.rollouts.rows;
    assert!(rows[0].whole.n > 100 && found.rollouts.relative_to == "model, rates held", "{}", found.basis);
    let [held, model] = [&rows[0].whole.sum, &rows[2].whole.sum];
    assert!(model.velocity < held.velocity && model.position < held.position && model.rates < held.rates, "{rows:?}");
    assert!(matches!(studio.rollouts(0.0, None), Err(Error::Config { .. })));
    Ok(())
}

/// A studio on five minutes of flight that are changed before.
fn on(change: impl FnOnce(&mut DataSet)) -> Result<Arc<Studio>> {
    let mut set = simulate(&Simulation { minutes: 5.0, seed: 3, ..Simulation::baseline() })?;
    change(&mut set);
    let split = Split::for_search(&set.flights, 3);
    Ok(Arc::new(Studio::open(Opening { set, split, model: blank(), data: "changed".into(), file: None, seed: 3 })?))
}

fn why<T>(found: Found<T>) -> String {
    match found {
        Found::Known(_) => "it is known".into(),
        Found::Missing { why } => why,
    }
}

#[test]
fn a_log_that_does_not_allow_it_is_told_what_to_do() -> Result<()> {
    let blind = on(|set| {
        let position = [Column::X, Column::Y, Column::Z];
        set.flights.iter_mut().for_each(|flight| flight.absent.extend(position));
    })?;
    let found = rolled(&blind, 5.0, 1.0)?;
    assert!(found.note.is_some_and(|note| note.contains("recorded velocity")), "the way made stands for the position");
    assert!(found.paths[2].error.position.last().is_some_and(|error| error.is_finite() && *error > 0.0));
    assert!(known(blind.rollouts(1.0, None)?)?.rollouts.position_from_velocity);
    // No flight has room for a minute.
    let short = why(blind.rollout(&RolloutWanted { flight: 0, at_s: None, ahead_s: 60.0, network: None })?);
    assert!(short.contains("too short") && short.contains("choose a longer flight"), "{short}");
    let all = why(blind.rollouts(60.0, None)?);
    assert!(all.contains("long enough to look 60 s ahead; look at most"), "{all}");
    Ok(())
}
