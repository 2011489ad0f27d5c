//! The studio without a server: the way of a person from the error to the effect and back.

use crate::support::{HIDDEN, blank, folder, studio};
use phyture::critique::locate::Bin;
use phyture::flight::Channel;
use phyture::physics::Model;
use phyture::studio::{
    By, Edit, Move, Owner, PartWanted, PlaceWanted, Progress, RegionText, Steps, Studio, SurfaceWanted, TraceWanted,
};
use phyture::{Error, Result};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The error of the yaw acceleration at the present step.
fn yaw(steps: &Steps) -> f64 {
    steps.steps[steps.at].rmse.and_then(|rmse| rmse.wz_dot).unwrap_or(f64::NAN)
}

fn diagnosed(studio: &Arc<Studio>) -> Result<()> {
    studio.diagnose()?;
    let begun = Instant::now();
    while studio.job().progress == Progress::Running {
        assert!(begun.elapsed() < Duration::from_secs(300), "at {}", studio.job().stage);
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

fn wanted(flight: usize, channel: Channel, pixels: usize) -> TraceWanted {
    TraceWanted { flight, channel, from_s: None, to_s: None, pixels, against: None, moved: None }
}

/// The curve of what was found, and the page of the search, as they are after a search.
fn curve_and_page(studio: &Studio, place: &Path) -> Result<()> {
    let missing = |what: &str| Error::Undetermined(format!("no {what}"));
    let curve = studio.curve(HIDDEN)?.known().ok_or_else(|| missing("curve"))?;
    assert_eq!(curve.channel, Channel::WzDot.index());
    let panel = curve.panels.first().ok_or_else(|| missing("panel"))?;
    assert!(
        panel.name == "vy" && panel.read && panel.before.len() == panel.change.len() && panel.before.len() == panel.after.len()
    );
    // The curve runs through the points: what is left behind it is small.
    let size = |of: &[Bin]| of.iter().map(|bin| bin.n as f64 * bin.mean.powi(2)).sum::<f64>();
    assert!(size(&panel.after) < 0.05 * size(&panel.before), "{panel:?}");
    let apart: Vec<Bin> =
        panel.before.iter().zip(&panel.change).map(|(before, change)| Bin { mean: before.mean - change.mean, ..*before }).collect();
    assert!((size(&apart) / size(&panel.after) - 1.0).abs() < 1e-6, "what is left is the residual less the change");
    assert!(matches!(studio.curve("ground_effect"), Err(Error::Config { .. })), "only what was found");
    let path = place.join("diagnosis.html").display().to_string();
    studio.save_diagnosis(&path, false)?;
    let html = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    assert!(html.contains(HIDDEN) && html.contains("What was tried and not named"), "the page of `diagnose`");
    assert!(matches!(studio.save_diagnosis(&path, false), Err(Error::Exists { .. })), "not unasked");
    Ok(())
}

#[test]
fn a_hidden_effect_is_found_added_and_the_error_falls_and_comes_back() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("model.toml");
    let studio = studio(Some(&file))?;
    let first = studio.steps()?;
    assert_eq!((first.steps.len(), first.steps[0].did.as_str()), (1, "baseline, calibrated"));
    assert!(!first.saved && !first.file_changed);
    diagnosed(&studio)?;
    let job = studio.job();
    assert_eq!((job.progress, job.error.as_deref()), (Progress::Done, None));
    assert!(job.diagnosis.is_some_and(|diagnosis| diagnosis.accepted.contains(&HIDDEN.to_owned())));
    curve_and_page(&studio, place.path())?;
    let added = studio.edit(&Edit::Add { effect: HIDDEN.into() })?;
    assert!(yaw(&added) < 0.8 * yaw(&first), "{} to {}", yaw(&first), yaw(&added));
    assert!(matches!(studio.edit(&Edit::Add { effect: HIDDEN.into() }), Err(Error::Config { .. })), "it is in already");
    let off = studio.edit(&Edit::Switch { effect: HIDDEN.into(), on: false })?;
    assert!((yaw(&off) - yaw(&first)).abs() < 1e-6 * yaw(&first), "without it the error is that of the beginning");
    let back = studio.undo()?;
    assert_eq!(yaw(&back).to_bits(), yaw(&added).to_bits());
    assert!(back.steps[back.at + 1].rmse.is_none(), "what was undone is not judged");
    assert_eq!(studio.redo()?.at, 2);
    studio.undo()?;

    // Saved, and the ledger names what the search found.
    let other = place.path().join("amended.toml");
    let path = other.display().to_string();
    let saved = studio.save(&path, false)?;
    let ledger = std::fs::read_to_string(saved.ledger.unwrap_or_default()).map_err(Error::io("ledger"))?;
    assert!(ledger.contains(HIDDEN) && ledger.lines().count() == 1, "{ledger}");
    let read = Model::read(&other)?;
    assert!(read.effect(HIDDEN).is_some_and(|effect| effect.enabled));
    assert!(studio.steps()?.saved);
    assert!(matches!(studio.save(&path, false), Err(Error::Exists { .. })), "not unasked");
    let kept = studio.save(&path, true)?.kept;
    assert!(kept.is_some_and(|kept| std::path::Path::new(&kept).is_file()), "the file that was there is kept");
    std::fs::write(&other, "[model]\n").map_err(Error::io(&other))?;
    assert!(studio.steps()?.file_changed, "another program wrote it");
    assert!(matches!(studio.save("amended.txt", true), Err(Error::Config { .. })));
    let page = place.path().join("page.html");
    studio.save_page(&page.display().to_string(), false)?;
    let html = std::fs::read_to_string(&page).map_err(Error::io(&page))?;
    assert!(html.contains("added weathercock"), "the page has both states");
    Ok(())
}

#[test]
fn a_number_moved_by_hand_moves_the_lines_and_a_calibration_brings_it_back() -> Result<()> {
    let studio = studio(None)?;
    let first = studio.steps()?;
    let model = studio.model(None)?;
    let effect =
        model.effects.iter().find(|effect| effect.name == "control_moment").ok_or_else(|| Error::Undetermined("none".into()))?;
    let number = effect.numbers.iter().find(|number| number.name == "c_z").ok_or_else(|| Error::Undetermined("none".into()))?;
    assert!(number.slider[0] < number.value && number.value < number.slider[1]);
    let moved = Move { effect: effect.name.clone(), number: number.name.clone(), value: 0.5 * number.value };
    let still = studio.trace(&wanted(0, Channel::WzDot, 400))?;
    let other = studio.trace(&TraceWanted {
        moved: Some(moved.clone()),
        against: Some(first.steps[0].id),
        ..wanted(0, Channel::WzDot, 400)
    })?;
    assert!(other.rmse > still.rmse, "half of the tail stick is wrong");
    assert_eq!(other.against_rmse.map(f64::to_bits), Some(still.rmse.to_bits()));
    let after = studio.edit(&Edit::Move(moved))?;
    assert!(yaw(&after) > yaw(&first) && !after.steps[after.at].calibrated);
    let again = studio.edit(&Edit::Calibrate)?;
    assert!((yaw(&again) - yaw(&first)).abs() < 1e-9 && again.steps[again.at].calibrated);
    let unknown = Move { effect: "control_moment".into(), number: "c_w".into(), value: 1.0 };
    assert!(matches!(studio.edit(&Edit::Move(unknown)), Err(Error::Config { .. })));
    assert_eq!(studio.steps()?.steps.len(), 3, "what is refused leaves no step");
    Ok(())
}

#[test]
fn a_formula_of_ones_own_is_told_the_character_that_is_wrong() -> Result<()> {
    let studio = studio(None)?;
    let channel = Owner::Channel(Channel::WzDot);
    let check = |formula: &str| studio.check_formula(&channel, formula);
    let wrong = check("airspeed * vq");
    assert_eq!(wrong.at, Some(11));
    assert!(wrong.message.as_deref().is_some_and(|message| message.starts_with("unknown name `vq`")), "{wrong:?}");
    assert!(check("airspeed * (vy").message.is_some());
    assert!(check("wz_dot").message.is_some_and(|message| message.contains("acceleration")), "no answer from the question");
    assert!(check("airspeed * vy").message.is_none());
    assert!(check("lag(u1, 0.1)").caution.is_some());
    let of_signal = studio.check_formula(&Owner::Signal("thrust".into()), "thrust * vq");
    assert_eq!(of_signal.at, Some(9), "{of_signal:?}");
    let before = studio.steps()?;
    let formula = Edit::Formula { name: "fin".into(), owner: channel.clone(), formula: "airspeed * vy".into() };
    let after = studio.edit(&formula)?;
    assert!(yaw(&after) < 0.9 * yaw(&before), "it is nearly the hidden effect: {} to {}", yaw(&before), yaw(&after));
    assert!(matches!(studio.edit(&formula), Err(Error::Config { .. })), "the name is taken");
    let infinite = Edit::Formula { name: "pole".into(), owner: channel, formula: "1 / (t - t)".into() };
    assert!(studio.edit(&infinite).is_err() && studio.steps()?.steps.len() == 2, "what is no number is no step");
    Ok(())
}

#[test]
fn views_lead_to_where_the_error_is() -> Result<()> {
    let studio = studio(None)?;
    let map = studio.map(PartWanted::Judged, By::Manoeuvre)?;
    assert!(map.rows.len() == 4 && map.rows.iter().all(|row| row.cells.len() == 6), "a fifth of twenty classes");
    let worst = PlaceWanted {
        part: PartWanted::Judged,
        by: By::Manoeuvre,
        name: Some(map.rows[0].name.clone()),
        channel: Some(Channel::WzDot),
        typical: false,
    };
    let place = studio.place(&worst)?.ok_or_else(|| Error::Undetermined("no place".into()))?;
    assert_eq!(studio.overview().flights[place.flight].manoeuvre, map.rows[0].name);
    assert!((5.0..=10.0).contains(&(place.to_s - place.from_s)));
    let typical = studio.place(&PlaceWanted { typical: true, ..worst })?;
    assert!(typical.is_some_and(|typical| typical.error <= place.error));
    let depends = studio.dependence(PartWanted::Judged, Channel::WzDot)?;
    assert_eq!(depends.variables.first().map(|variable| variable.name), Some("vy"), "the side wind on the fin");
    let over = |variables| studio.surface(&SurfaceWanted { part: PartWanted::Judged, channel: Channel::WzDot, variables });
    let surface = over(Some(["vy".into(), "airspeed".into()]))?.surface.ok_or_else(|| Error::Undetermined("no surface".into()))?;
    assert!(surface.share > depends.variables[0].share, "two tell more than one: {}", surface.share);
    assert!(over(Some(["vy".into(), "no_such".into()])).is_err());
    assert!(over(None)?.surface.is_some_and(|surface| surface.variables.contains(&"vy".to_owned())), "the pair that tells most");
    let all = studio.map(PartWanted::All, By::Regime)?;
    assert!(all.whole.n > map.whole.n && all.rows.iter().all(|row| row.rule.is_some()));
    // Peaks stay where little is drawn.
    let coarse = studio.trace(&wanted(place.flight, Channel::WzDot, 50))?;
    let fine = studio.trace(&wanted(place.flight, Channel::WzDot, 4000))?;
    let most = |values: &[f32]| values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    assert!(coarse.t.len() == 100 && fine.samples_per_point.to_bits() == 1_f64.to_bits());
    assert_eq!(most(&coarse.measured).to_bits(), most(&fine.measured).to_bits());
    for refused in [studio.trace(&wanted(99, Channel::VxDot, 400)), studio.trace(&wanted(0, Channel::VxDot, 1))] {
        assert!(matches!(refused, Err(Error::Config { .. })));
    }
    Ok(())
}

#[test]
fn what_is_left_is_parted_by_rules_and_looked_at_in_time() -> Result<()> {
    let studio = studio(None)?;
    let before = studio.regions(PartWanted::Judged, Channel::WzDot)?;
    let whole = before.whole.ok_or_else(|| Error::Undetermined("no region".into()))?;
    assert!(!before.even && before.why.is_none());
    let loudest = &before.regions[0];
    assert!(loudest.rule.contains("vy"), "the fin answers to the side wind: {loudest:?}");
    assert!(loudest.rmse > 1.25 * whole.rmse && loudest.share_of_error > loudest.share_of_time);
    assert!(before.regions.windows(2).all(|pair| pair[0].rmse >= pair[1].rmse), "the loudest first");
    let sum = |of: fn(&RegionText) -> f64| before.regions.iter().map(of).sum::<f64>();
    assert!((sum(|one| one.share_of_error) - 1.0).abs() < 1e-9 && (sum(|one| one.share_of_time) - 1.0).abs() < 1e-9);
    let in_time = studio.in_time(PartWanted::Judged, Channel::WzDot)?;
    let lasting = in_time.autocorrelation.ok_or_else(|| Error::Undetermined("no autocorrelation".into()))?;
    assert_eq!((lasting.channel, lasting.lag_s[0].to_bits()), ("wz_dot", 0.0_f64.to_bits()));
    assert!((lasting.correlation[0] - 1.0).abs() < 1e-12 && lasting.lasts_s.is_some_and(|lasts_s| lasts_s > 0.3), "{lasting:?}");
    let spectrum = in_time.spectrum.ok_or_else(|| Error::Undetermined("no spectrum".into()))?;
    assert!(spectrum.channel == "wz_dot" && spectrum.segments > 10 && spectrum.density.len() == spectrum.frequency_hz.len());
    let sticks: Vec<_> = in_time.sticks.iter().map(|one| (one.stick, one.channel)).collect();
    assert_eq!(sticks, ["u1", "u2", "u3", "u4"].map(|stick| (stick, "wz_dot")));
    // With what was missing the error falls, and what is left is another residual.
    studio.edit(&Edit::Add { effect: HIDDEN.into() })?;
    let after = studio.regions(PartWanted::Judged, Channel::WzDot)?;
    assert!(after.whole.is_some_and(|after| after.rmse < 0.8 * whole.rmse));
    assert_ne!(studio.in_time(PartWanted::Judged, Channel::WzDot)?.autocorrelation, Some(lasting));
    Ok(())
}

#[test]
fn a_search_stops_when_it_is_asked_to_and_another_may_begin() -> Result<()> {
    let studio = studio(None)?;
    assert_eq!(studio.job().progress, Progress::Idle);
    assert!(matches!(studio.curve(HIDDEN), Err(Error::Config { .. })) && studio.save_diagnosis("page.html", false).is_err());
    studio.diagnose()?;
    assert!(matches!(studio.diagnose(), Err(Error::Config { .. })), "one at a time");
    let begun = Instant::now();
    while studio.job().stage.is_empty() {
        assert!(begun.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(5));
    }
    studio.stop();
    let begun = Instant::now();
    while studio.job().progress == Progress::Stopping {
        assert!(begun.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(10));
    }
    let ended = studio.job();
    assert!(ended.progress == Progress::Stopped && ended.diagnosis.is_none() && !ended.stage.is_empty(), "{ended:?}");
    assert!(matches!(studio.edit(&Edit::AddAll), Err(Error::Config { .. })), "nothing was found");
    studio.diagnose()?;
    studio.stop();
    Ok(())
}

#[test]
fn a_model_with_numbers_is_opened_as_it_is() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("model.toml");
    let one = studio(None)?;
    one.save(&file.display().to_string(), false)?;
    let set = phyture::sim::simulate(&phyture::sim::Simulation { minutes: 5.0, seed: 9, ..phyture::sim::Simulation::baseline() })?;
    let split = phyture::flight::split::Split::for_search(&set.flights, 9);
    let model = Model::read(&file)?;
    assert_ne!(model.effects, blank().effects);
    let opening = phyture::studio::Opening { set, split, model, data: "other".into(), file: Some(file), seed: 9 };
    let steps = Studio::open(opening)?.steps()?;
    assert!(steps.saved && steps.steps[0].did == "model as it was opened");
    Ok(())
}
