//! A network trained in the studio: begun, stopped, gone on with by this studio or the next, explained and rolled out.

use crate::support::{HIDDEN, folder, studio};
use phyture::studio::{Earlier, Edit, Progress, RolloutWanted, Studio, TrainingText, TrainingWanted};
use phyture::{Error, Result};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A small network, trained for two epochs.
fn wanted(folder: &Path, earlier: Earlier) -> TrainingWanted {
    TrainingWanted { folder: folder.display().to_string(), history: 64, width: 8, epochs: 2, linear: true, earlier }
}

/// Waits until something holds of the training.
fn until(studio: &Studio, holds: impl Fn(&TrainingText) -> bool) -> TrainingText {
    let begun = Instant::now();
    loop {
        let now = studio.training();
        if holds(&now) {
            return now;
        }
        assert!(begun.elapsed() < Duration::from_secs(300), "{now:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn ended(training: &TrainingText) -> bool {
    !matches!(training.progress, Progress::Running | Progress::Stopping)
}

/// Begins a run and stops it after some steps.
fn stopped(studio: &Arc<Studio>, run: &Path) -> Result<()> {
    assert_eq!(studio.train(&wanted(run, Earlier::Refuse))?.progress, Progress::Running);
    assert!(matches!(studio.train(&wanted(run, Earlier::Replace)), Err(Error::Config { .. })), "one at a time");
    let seen = until(studio, |training| training.steps[0] >= 3);
    assert!(seen.parameters.is_some_and(|count| count > 100) && seen.windows[0] > 3 * seen.windows[1] && seen.windows[1] > 100);
    studio.stop_training();
    let left = until(studio, ended);
    assert_eq!((left.progress, left.error.as_deref()), (Progress::Stopped, None));
    assert!(left.steps[0] < left.steps[1] && left.trained.is_none());
    assert!(matches!(studio.train(&wanted(run, Earlier::Refuse)), Err(Error::Exists { .. })), "not unasked");
    Ok(())
}

#[test]
fn a_run_that_was_stopped_is_gone_on_with_by_the_next_studio_and_its_network_is_explained() -> Result<()> {
    let place = folder()?;
    let (file, run) = (place.path().join("model.toml"), place.path().join("run"));
    let first = studio(Some(&file))?;
    let plan = first.training_plan();
    assert_eq!((plan.folder.as_str(), plan.unfinished.len()), (run.display().to_string().as_str(), 0));
    stopped(&first, &run)?;
    assert!(first.training_plan().folder.ends_with("run-2"));
    drop(first);

    let next = studio(Some(&file))?;
    let unfinished = next.training_plan().unfinished;
    assert_eq!((unfinished[0].name.as_str(), unfinished[0].why.as_deref()), ("run", None), "{unfinished:?}");
    // On a step that is not the present one.
    next.edit(&Edit::Add { effect: HIDDEN.into() })?;
    next.train(&wanted(&run, Earlier::GoOn))?;
    let done = until(&next, ended);
    assert_eq!((done.progress, done.error.as_deref()), (Progress::Done, None));
    assert_eq!((done.epochs, done.state), ([2, 2], Some(0)), "of the state that it was begun on");
    let trained = done.trained.ok_or_else(|| Error::Undetermined("no network".into()))?;
    assert!(done.curve == trained.curve && done.curve.iter().all(|epoch| epoch.validation.is_some()));
    assert!(next.training_plan().unfinished.is_empty());
    assert!(matches!(next.train(&wanted(&run, Earlier::GoOn)), Err(Error::File { .. })), "it is at its end");

    let explained = next.explained("run")?.known().ok_or_else(|| Error::Undetermined("nothing explained".into()))?;
    for ((physics, network), neither) in
        explained.shares.physics.all().iter().zip(explained.shares.network.all()).zip(explained.shares.neither.all())
    {
        let whole: f64 = [*physics, network, neither].iter().flatten().map(|share| share.share).sum();
        assert!((whole - 1.0).abs() < 1e-9, "{explained:?}");
    }
    assert!(explained.shares.of_network.is_some(), "the linear history has a share of its own");
    let [physics, hybrid] = explained.rmse.map(|rmse| rmse.wz_dot);
    assert!(hybrid < physics, "the fin that physics lacks: {physics:?} {hybrid:?}");
    assert!(matches!(next.explained("model.toml"), Err(Error::Config { .. })), "a model is no network");

    let rolled = next.rollout(&RolloutWanted { flight: 0, at_s: Some(0.0), ahead_s: 0.5, network: Some("run".into()) })?;
    let rolled = rolled.known().ok_or_else(|| Error::Undetermined("nothing was rolled out".into()))?;
    let names: Vec<&str> = rolled.paths.iter().map(|path| path.name.as_str()).collect();
    assert_eq!(names, ["state held", "model, rates held", "model", "run"]);
    assert!((0.6..0.65).contains(&rolled.at_s), "from the first sample with a whole history: {}", rolled.at_s);
    let over = next.rollouts(0.5, Some("run"))?.known().ok_or_else(|| Error::Undetermined("nothing was rolled out".into()))?;
    assert_eq!(over.rollouts.rows.len(), 4);
    assert!(matches!(next.rollouts(0.5, Some("no-run")), Err(Error::Config { .. })));
    Ok(())
}

#[test]
fn a_run_of_another_model_says_so_and_one_that_is_going_is_saved_at_the_end() -> Result<()> {
    let place = folder()?;
    let (file, run) = (place.path().join("model.toml"), place.path().join("run"));
    let first = studio(Some(&file))?;
    first.edit(&Edit::Add { effect: HIDDEN.into() })?;
    first.train(&wanted(&run, Earlier::Refuse))?;
    until(&first, |training| training.steps[0] >= 1);
    assert_eq!(first.finish(), Some(run.clone()), "it is stopped and saved");
    assert_eq!(first.finish(), None);
    assert_eq!(first.training().progress, Progress::Stopped);
    drop(first);
    let next = studio(Some(&file))?;
    let unfinished = next.training_plan().unfinished;
    assert!(unfinished[0].why.as_deref().is_some_and(|why| why.contains("none of the steps here")), "{unfinished:?}");
    assert!(matches!(next.train(&wanted(&run, Earlier::GoOn)), Err(Error::File { .. })));
    // Nothing that cannot be is begun, and nothing among other files.
    let nowhere = place.path().join("nowhere").join("run");
    for wrong in [
        wanted(place.path(), Earlier::Refuse),
        wanted(&nowhere, Earlier::Refuse),
        TrainingWanted { width: 0, ..wanted(&run, Earlier::Replace) },
        TrainingWanted { epochs: 0, ..wanted(&run, Earlier::Replace) },
        TrainingWanted { folder: " ".into(), ..wanted(&run, Earlier::Refuse) },
    ] {
        assert!(next.train(&wrong).is_err(), "{wrong:?}");
        assert_eq!(next.training().progress, Progress::Idle);
    }
    assert!(!nowhere.exists() && !place.path().join("checkpoint.phyture").exists());
    std::fs::write(run.join("checkpoint.phyture"), "torn").map_err(Error::io(&run))?;
    assert!(next.training_plan().unfinished[0].why.as_deref().is_some_and(|why| why.contains("checkpoint")));
    Ok(())
}
