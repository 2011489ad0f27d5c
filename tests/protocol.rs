//! What a run of the comparison may see: nothing of the part it is judged on.
#![cfg(all(feature = "protocol", feature = "sim"))]

use phyture::flight::split::{Split, class_folds};
use phyture::flight::{Column, Flight};
use phyture::nn::PhyTureConfig;
use phyture::physics::Model;
use phyture::protocol::{Condition, Division, Experiment, METHODS, Outcome, Plan, Run, Settings, TableId, Treatment};
use phyture::sim::{Level, Simulation, simulate};
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

fn perform(plan: &Plan, flights: &[Flight], model: &Model, method: &str) -> Result<Outcome> {
    let working = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let run = Run { method: method.into(), division: Division::Benchmark, treatment: Treatment::Plain, seed: 1 };
    Experiment::new(plan, flights, model, Threads(2)).run(&run, working.path(), &mut |_| true)
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
    for method in METHODS {
        let (first, second) = (perform(&plan, &flights, &model, method.id)?, perform(&plan, &other, &model, method.id)?);
        let (Some(first_trace), Some(second_trace)) = (first.trace, second.trace) else { panic!("{}: no trace", method.id) };
        assert_eq!(first_trace.predicted, second_trace.predicted, "{} saw what it is judged on", method.id);
        assert_ne!(first_trace.measured, second_trace.measured);
        assert_eq!(first.effects, second.effects);
        assert_ne!(first.conditions[&Condition::Clean], second.conditions[&Condition::Clean]);
    }
    Ok(())
}

#[test]
fn the_loop_adds_what_is_hidden_and_noise_and_wrong_coefficients_cost() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let error = |outcome: &Outcome, condition: Condition| {
        phyture::protocol::outcome::Sums::of(&outcome.conditions[&condition]).rmse().wz_dot.unwrap_or(f64::NAN)
    };
    let baseline = perform(&plan, &flights, &model, "physical_baseline")?;
    let amended = perform(&plan, &flights, &model, "amended_physics")?;
    assert_eq!(amended.effects, ["weathercock"]);
    assert!(error(&amended, Condition::Clean) < error(&baseline, Condition::Clean));
    assert!(error(&amended, Condition::StateNoise) > error(&amended, Condition::Clean));
    assert!(error(&amended, Condition::ControlNoise) > error(&amended, Condition::Clean));
    let working = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let off = Run {
        method: "physical_baseline".into(),
        division: Division::Benchmark,
        treatment: Treatment::CoefficientsOff(30),
        seed: 0,
    };
    let off = Experiment::new(&plan, &flights, &model, Threads(2)).run(&off, working.path(), &mut |_| true)?;
    assert!(error(&off, Condition::Clean) > error(&baseline, Condition::Clean));
    Ok(())
}

#[test]
fn a_damaged_checkpoint_is_kept_and_told_and_the_run_begins_anew() -> Result<()> {
    let (flights, model) = (flights()?, model()?);
    let plan = plan(&flights, &model)?;
    let run = Run { method: "phyture".into(), division: Division::Benchmark, treatment: Treatment::Plain, seed: 1 };
    let undamaged = perform(&plan, &flights, &model, "phyture")?;
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let (working, damaged) = (place.path().join("key"), b"PHYTURE\nnot a checkpoint at all");
    std::fs::create_dir(&working).map_err(Error::io(&working))?;
    for number in [1, 2] {
        std::fs::write(working.join("checkpoint.phyture"), damaged).map_err(Error::io(&working))?;
        let experiment = Experiment::new(&plan, &flights, &model, Threads(2));
        let outcome = experiment.run(&run, &working, &mut |_| true)?;
        assert_eq!(outcome.conditions, undamaged.conditions);
        let kept = place.path().join(format!("key.damaged-checkpoint-{number}"));
        assert_eq!(std::fs::read(&kept).map_err(Error::io(&kept))?, damaged);
        let [note] = &experiment.take_notes()[..] else { panic!("one note is expected") };
        let parts = [working.join("checkpoint.phyture").display().to_string(), kept.display().to_string()];
        assert!(parts.iter().all(|part| note.contains(part)) && note.contains("begins anew"), "{note}");
        assert!(experiment.take_notes().is_empty(), "a note is told once");
    }
    // A sound one is gone on with, without a word.
    let experiment = Experiment::new(&plan, &flights, &model, Threads(2));
    experiment.run(&run, &working, &mut |_| true)?;
    assert!(experiment.take_notes().is_empty());
    Ok(())
}
