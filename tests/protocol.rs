//! What a run of the comparison may see: nothing of the part it is judged on.
#![cfg(all(feature = "protocol", feature = "sim"))]

use phyture::flight::split::{Protocol, Split, class_folds};
use phyture::flight::{Column, Flight};
use phyture::nn::PhyTureConfig;
use phyture::physics::Model;
use phyture::protocol::outcome::Sums;
use phyture::protocol::{Division, Experiment, METHODS, Outcome, Plan, Run, Settings, TableId, Treatment};
use phyture::sim::{Level, Like, Simulation, simulate};
use phyture::tape::Threads;
use phyture::train::TrainConfig;
use phyture::{Error, Result};
use std::path::Path;

fn plan(flights: &[Flight], model: &Model) -> Result<Plan> {
    let network = PhyTureConfig { history: 32, d_model: 8, heads: 2, levels: 1, stacks: 1, ..PhyTureConfig::default() };
    let training = TrainConfig { network: network.into(), epochs: 1, stride: 400, ..TrainConfig::default() };
    let classes: Vec<&str> = flights.iter().map(|flight| flight.manoeuvre.as_str()).collect();
    Ok(Plan {
        data_sha256: String::new(),
        data: "flights".into(),
        model: model.to_toml()?,
        step_s: 0.01,
        folds: class_folds(&classes, 3),
        explainable_sha256: Some(String::new()),
        tables: TableId::ALL.into(),
        methods: Vec::new(),
        settings: Settings { training, ..Settings::quick() },
        version: "test".into(),
    })
}

fn flights() -> Result<Vec<Flight>> {
    let simulation = Simulation { minutes: 5.0, seed: 61, level: Level::ONE, ..Simulation::baseline() };
    Ok(simulate(&simulation.hide("weathercock", 2.0)?)?.flights)
}

fn model() -> Result<Model> {
    Model::from_toml("[model]\nbaseline = \"paper\"\n", Path::new("paper"))
}

fn run(method: &str, treatment: Treatment) -> Run {
    let is_random =
        phyture::protocol::method(method).is_some_and(|method| method.predictor.network(&PhyTureConfig::default()).is_some());
    Run { method: method.into(), division: Division::Benchmark, treatment, seed: u64::from(is_random) }
}

fn perform(plan: &Plan, flights: &[Flight], model: &Model, run: &Run) -> Result<Outcome> {
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let mut experiment = Experiment::new(plan, flights, model, Threads(2), place.path());
    experiment.explainable = Some(flights);
    experiment.run(run, &place.path().join("working"), &mut |_| true)
}

fn wz(outcome: &Outcome) -> f64 {
    Sums::of(&outcome.segments).rmse().wz_dot.unwrap_or(f64::NAN)
}

/// The flights with other accelerations in the test part.
fn falsified(flights: &[Flight], split: &Split) -> Result<Vec<Flight>> {
    let one = |(index, flight): (usize, &Flight)| {
        flight.with_columns(|column| {
            if !Column::TARGETS.contains(&column) {
                return None;
            }
            let mut values = flight.column(column).to_vec();
            for span in split.test.iter().filter(|span| span.flight == index) {
                values[span.start..span.end].iter_mut().for_each(|value| *value = 100.0 - *value);
            }
            Some(values)
        })
    };
    flights.iter().enumerate().map(one).collect()
}

#[test]
fn no_method_sees_an_acceleration_of_the_part_it_is_judged_on() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let split = Split::new(&flights, &[], &model.data.split, plan.settings.split_seed)?;
    let other = falsified(&flights, &split)?;
    for method in METHODS.iter().filter(|method| method.id != "floor") {
        let run = run(method.id, Treatment::Plain);
        let (first, second) = (perform(&plan, &flights, &model, &run)?, perform(&plan, &other, &model, &run)?);
        let (Some(first_trace), Some(second_trace)) = (first.trace, second.trace) else { panic!("{}: no trace", method.id) };
        assert_eq!(first_trace.predicted, second_trace.predicted, "{} saw what it is judged on", method.id);
        assert_ne!(first_trace.measured, second_trace.measured);
        assert_eq!(first.effects, second.effects);
        assert_ne!(first.segments, second.segments);
    }
    Ok(())
}

#[test]
fn the_loop_adds_what_is_hidden_and_noise_and_wrong_coefficients_cost() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let of = |method: &str, treatment: Treatment| perform(&plan, &flights, &model, &run(method, treatment));
    let baseline = of("physical_baseline", Treatment::Plain)?;
    let amended = of("amended_physics", Treatment::Plain)?;
    assert_eq!(amended.effects, ["weathercock"]);
    assert!(wz(&amended) < wz(&baseline));
    assert!(wz(&of("amended_physics", Treatment::StateNoise)?) > wz(&amended));
    assert!(wz(&of("amended_physics", Treatment::ControlNoise)?) > wz(&amended));
    assert!(wz(&of("physical_baseline", Treatment::CoefficientsOff(30))?) > wz(&baseline));
    // The explainable part of these flights is said to be the flights: nothing is left.
    assert!(wz(&of("floor", Treatment::StateNoise)?) == 0.0);
    Ok(())
}

#[test]
fn noise_is_on_what_trains_as_on_what_is_judged() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let mut plan = plan(&flights, &model)?;
    // Some thousand windows that share no row.
    plan.settings.test_stride = 3;
    let error =
        |method: &str, treatment: Treatment| Ok::<_, Error>(wz(&perform(&plan, &flights, &model, &run(method, treatment))?));
    // A ridge that has seen the noise learns to average; the difference of two rows cannot.
    let (ridge, difference) = (error("ridge", Treatment::StateNoise)?, error("backward_difference", Treatment::StateNoise)?);
    assert!(ridge < 0.8 * difference, "{ridge} {difference}");
    assert!(error("ridge", Treatment::Plain)? < ridge);
    // 0.01 rad/s on both rows of a difference over 0.01 s, beside what it misses without noise.
    let added = difference.powi(2) - error("backward_difference", Treatment::Plain)?.powi(2);
    assert!((added / 2.0 - 1.0).abs() < 0.15, "{added}");
    let windows = error("ridge_windows", Treatment::Plain)?;
    assert!(windows.is_finite() && windows != error("ridge", Treatment::Plain)?, "of other windows and inputs");
    Ok(())
}

#[test]
fn the_learning_rate_and_the_epoch_are_those_that_validate_best() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let mut plan = plan(&flights, &model)?;
    plan.settings.training.keep_best = true;
    plan.settings.training.epochs = 3;
    (plan.settings.rates, plan.settings.rate_epochs) = (vec![1e-7, 3e-3], 1);
    for division in [Division::Benchmark, Division::Fold(0)] {
        let run = Run { division, ..run("dlinear", Treatment::Plain) };
        let outcome = perform(&plan, &flights, &model, &run)?;
        assert_eq!(outcome.peak_rate, Some(3e-3), "one of them stands still");
        let losses: Vec<f64> = outcome.curve.iter().filter_map(|epoch| epoch.validation).collect();
        let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
        assert_eq!((losses.len(), losses[outcome.epoch - 1]), (3, best), "{losses:?}");
    }
    let plain = Plan { settings: Settings { rates: Vec::new(), ..plan.settings.clone() }, ..plan.clone() };
    let run = run("dlinear", Treatment::Plain);
    assert_ne!(plan.key(&run)?, plain.key(&run)?);
    assert_eq!(perform(&plain, &flights, &model, &run)?.peak_rate, None);
    Ok(())
}

#[test]
fn a_model_that_the_loop_has_amended_is_a_file_and_is_searched_once() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let of = |run: &Run| {
        Experiment::new(&plan, &flights, &model, Threads(2), place.path()).run(run, &place.path().join("w"), &mut |_| true)
    };
    let amended = run("amended_physics", Treatment::Plain);
    let first = of(&amended)?;
    let path = place.path().join(format!("{}.toml", plan.amended_key(&amended)?));
    assert!(Model::read(&path)?.effect("weathercock").is_some());
    // What stands in the file is what is used.
    std::fs::write(&path, model.to_toml()?).map_err(Error::io(&path))?;
    assert_eq!((first.effects.len(), of(&amended)?.effects.len()), (1, 0));
    std::fs::write(&path, "no model").map_err(Error::io(&path))?;
    assert!(of(&amended).is_err_and(|error| error.to_string().contains(&path.display().to_string())), "a damaged file is told");
    Ok(())
}

#[test]
fn where_stretches_have_a_lead_every_history_is_judged_on_the_same_samples() -> Result<()> {
    let simulation = Simulation { minutes: 20.0, seed: 62, level: Level::ONE, ..Simulation::baseline() };
    let (flights, mut model) = (simulate(&simulation)?.flights, model()?);
    model.data.split = Protocol::Stretches;
    let judged = |history: usize| {
        let mut plan = plan(&flights, &model)?;
        plan.settings.training.network = PhyTureConfig { history, d_model: 8, heads: 2, ..PhyTureConfig::default() }.into();
        let outcome = perform(&plan, &flights, &model, &run("physical_baseline", Treatment::Plain))?;
        Ok::<_, Error>(outcome.segments.iter().map(|segment| (segment.flight.clone(), segment.windows)).collect::<Vec<_>>())
    };
    let short = judged(32)?;
    assert!(!short.is_empty());
    assert_eq!(short, judged(1000)?);
    Ok(())
}

#[test]
fn of_two_hours_more_than_3000_windows_of_ten_seconds_are_judged() -> Result<()> {
    let (flights, mut model) =
        (simulate(&Simulation { like: Like::Stanford, seed: 63, ..Simulation::baseline() })?.flights, model()?);
    let plan = Plan { settings: Settings::paper(), ..plan(&flights, &model)? };
    let run = run("phyture", Treatment::Plain);
    let mut judged = |split: Protocol| {
        model.data.split = split;
        Ok::<_, Error>(Experiment::new(&plan, &flights, &model, Threads(2), "").extent(&run)?.test)
    };
    let (stretches, segments) = (judged(Protocol::Stretches)?, judged(Protocol::Segments)?);
    assert!(stretches >= 3000 && segments < 1000, "{stretches} of stretches, {segments} where segments happen to join");
    Ok(())
}

#[test]
fn a_damaged_checkpoint_is_kept_and_told_and_the_run_begins_anew() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let run = run("phyture", Treatment::Plain);
    let undamaged = perform(&plan, &flights, &model, &run)?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let (working, damaged) = (place.path().join("key"), b"PHYTURE\nnot a checkpoint at all");
    std::fs::create_dir(&working).map_err(Error::io(&working))?;
    for number in [1, 2] {
        std::fs::write(working.join("checkpoint.phyture"), damaged).map_err(Error::io(&working))?;
        let experiment = Experiment::new(&plan, &flights, &model, Threads(2), place.path());
        let outcome = experiment.run(&run, &working, &mut |_| true)?;
        assert_eq!(outcome.segments, undamaged.segments);
        let kept = place.path().join(format!("key.damaged-checkpoint-{number}"));
        assert_eq!(std::fs::read(&kept).map_err(Error::io(&kept))?, damaged);
        let [note] = &experiment.take_notes()[..] else { panic!("one note is expected") };
        let parts = [working.join("checkpoint.phyture").display().to_string(), kept.display().to_string()];
        assert!(parts.iter().all(|part| note.contains(part)) && note.contains("begins anew"), "{note}");
        assert!(experiment.take_notes().is_empty(), "a note is told once");
    }
    // A sound one is gone on with, without a word.
    let experiment = Experiment::new(&plan, &flights, &model, Threads(2), place.path());
    experiment.run(&run, &working, &mut |_| true)?;
    assert!(experiment.take_notes().is_empty());
    Ok(())
}
