//! What is not saved is not lost: drafts beside the model, offered, taken up, thrown away, and gone after a save.

use crate::support::{HIDDEN, folder, studio};
use phyture::studio::{Edit, Move, Progress, Steps, Studio};
use phyture::{Error, Result};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The error of the yaw acceleration at the present step, to the bit.
fn yaw(steps: &Steps) -> Option<u64> {
    steps.steps[steps.at].rmse.and_then(|rmse| rmse.wz_dot).map(f64::to_bits)
}

/// Names of the files in a folder, hidden ones left out.
fn names(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder).map_err(Error::io(folder))?;
    let mut names: Vec<String> = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| !name.starts_with('.'));
    names.sort();
    Ok(names)
}

fn searched(studio: &Arc<Studio>) -> Result<()> {
    studio.diagnose()?;
    let begun = Instant::now();
    while studio.pulse().search == Progress::Running {
        assert!(begun.elapsed() < Duration::from_secs(300), "at {}", studio.job().stage);
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

#[test]
fn what_a_studio_leaves_is_offered_by_the_next_and_goes_with_a_save() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("model.toml");
    let first = studio(Some(&file))?;
    assert_eq!(names(place.path())?, ["model.toml"], "nothing is written before a step");
    searched(&first)?;
    first.edit(&Edit::Add { effect: HIDDEN.into() })?;
    first.edit(&Edit::Move(Move { effect: "control_moment".into(), number: "c_z".into(), value: 1.0 }))?;
    let left = first.undo()?;
    assert!(left.kept.is_some() && left.unkept.is_none() && left.left.is_empty());
    assert_eq!(names(place.path())?, ["model.toml", "model.unsaved.json"]);
    drop(first);

    let next = studio(Some(&file))?;
    let offered = next.steps()?.left;
    assert_eq!((offered.len(), offered[0].fault.as_deref()), (1, None));
    assert!(offered[0].steps.len() == 2 && offered[0].steps[0] == format!("added {HIDDEN}"), "{offered:?}");
    assert!(offered[0].search.is_some());
    // A step that is taken before the offer is answered does not touch what is offered.
    next.edit(&Edit::Switch { effect: "control_moment".into(), on: false })?;
    assert_eq!(names(place.path())?, ["model.toml", "model.unsaved-2.json", "model.unsaved.json"]);
    next.undo()?;
    let taken = next.take_up(&offered[0].file)?;
    assert_eq!((yaw(&taken), taken.steps.len(), taken.at), (yaw(&left), 3, 1), "the same state, with what was undone behind it");
    assert!(taken.left.is_empty() && names(place.path())? == ["model.toml", "model.unsaved-2.json"]);
    assert!(next.job().diagnosis.is_some_and(|found| found.accepted.contains(&HIDDEN.to_owned())), "and what the search found");
    next.go_to(taken.steps[2].id)?;
    let saved = next.save(&file.display().to_string(), true)?;
    assert!(saved.ledger.is_some(), "the ledger knows the search");
    assert!(
        next.steps()?.kept.is_none() && !names(place.path())?.iter().any(|name| name.contains("unsaved")),
        "it goes with a save"
    );
    Ok(())
}

#[test]
fn two_studios_on_one_model_keep_their_steps_apart() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("model.toml");
    let (one, other) = (studio(Some(&file))?, studio(Some(&file))?);
    let switch = Edit::Switch { effect: "control_moment".into(), on: false };
    let (kept, apart) = (one.edit(&switch)?.kept, other.edit(&switch)?.kept);
    assert!(kept.is_some() && apart.is_some() && kept != apart);
    assert!(studio(Some(&file))?.steps()?.left.is_empty(), "what is held by a studio that runs is no offer");
    drop((one, other));
    let left = studio(Some(&file))?.steps()?.left;
    assert_eq!(left.len(), 2);
    Ok(())
}

#[test]
fn a_draft_that_cannot_be_taken_up_says_why_and_stays_until_it_is_thrown_away() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("model.toml");
    let first = studio(Some(&file))?;
    first.edit(&Edit::Switch { effect: "control_moment".into(), on: false })?;
    drop(first);
    let draft = place.path().join("model.unsaved.json");
    let text = std::fs::read_to_string(&draft).map_err(Error::io(&draft))?;
    for (bad, says) in [
        ("{\"format\": 1".to_owned(), "cannot be read"),
        (text.replacen("\"data_sha256\":\"", "\"data_sha256\":\"0", 1), "other flights"),
        (text.replacen("\"format\":1", "\"format\":2", 1), "version"),
    ] {
        std::fs::write(&draft, &bad).map_err(Error::io(&draft))?;
        let next = studio(Some(&file))?;
        let left = next.steps()?.left;
        assert!(left[0].fault.as_deref().is_some_and(|fault| fault.contains(says)), "{left:?}");
        assert!(next.take_up(&left[0].file).is_err());
        let kept = std::fs::read_to_string(&draft).map_err(Error::io(&draft))?;
        assert_eq!(kept, bad, "it is as it was");
    }
    let next = studio(Some(&file))?;
    assert!(matches!(next.discard("/etc/hostname"), Err(Error::Config { .. })), "only what is offered");
    assert!(next.discard(&draft.display().to_string())?.left.is_empty() && !draft.exists());
    Ok(())
}

#[test]
fn steps_that_can_be_kept_nowhere_are_told() -> Result<()> {
    let studio = studio(None)?;
    assert!(studio.edit(&Edit::Switch { effect: "control_moment".into(), on: false })?.unkept.is_some());
    Ok(())
}
