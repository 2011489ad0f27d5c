//! The list of runs: what lies in a folder, what of it reads, and that all are judged alike.

use crate::support::{HIDDEN, blank, folder, studio};
use phyture::flight::PerChannel;
use phyture::flight::split::{Protocol, Split};
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::{Architecture, PhyTureConfig};
use phyture::physics::Model;
use phyture::sim::{Level, Simulation, simulate};
use phyture::studio::{Edit, Found, Kind, RunErrors, RunText, Studio};
use phyture::{Error, Result};
use std::path::Path;

/// A small network on a model; with a gate of 0 it says nothing, so that its errors are those of the model.
fn network(model: Model, gate: f64, path: &Path) -> Result<()> {
    let flights = simulate(&Simulation { minutes: 5.0, seed: 4, level: Level::ZERO, ..Simulation::baseline() })?.flights;
    let sizes = PhyTureConfig {
        history: 8,
        d_model: 8,
        heads: 2,
        levels: 1,
        stacks: 1,
        moving_average: 3,
        state_channels: 3,
        ..PhyTureConfig::default()
    };
    let (config, inputs) = (Architecture::from(sizes), ["vx", "wz", "u3"].map(str::to_owned).to_vec());
    let spans = Split::new(&flights, &[], &Protocol::Segments, 1)?.training;
    let description = Description {
        envelope: None,
        intervals: None,
        scaling: sequence::scaling(&flights, &spans, &model, &inputs, None, &config)?,
        model,
        config,
        inputs,
        linear: None,
        gate: PerChannel::splat(gate),
        step_s: flights[0].step_s,
    };
    let parameters = description.network(false)?.initial(11);
    Hybrid::new(description, parameters)?.write(path)
}

fn named<'a>(rows: &'a [RunText], name: &str) -> Result<&'a RunText> {
    rows.iter().find(|row| row.name == name).ok_or_else(|| Error::Undetermined(format!("no row {name}")))
}

fn errors(studio: &Studio, name: Option<&str>) -> Result<RunErrors> {
    studio.run_errors(name)?.known().ok_or_else(|| Error::Undetermined(format!("{name:?} was not judged")))
}

#[test]
fn what_lies_beside_the_model_is_judged_alike_and_what_does_not_read_says_why() -> Result<()> {
    let place = folder()?;
    let path = |name: &str| place.path().join(name);
    let written = |name: &str, text: &str| std::fs::write(path(name), text).map_err(Error::io(name));
    let studio = studio(Some(&path("model.toml")))?;
    // Without a file of the model the folder of the flights is looked into, which these do not have.
    let nowhere = crate::support::studio(None)?;
    assert!(nowhere.runs().why.is_some_and(|why| why.contains("simulated")) && nowhere.runs().rows.is_empty());
    assert_eq!(Some(errors(&nowhere, None)?.rmse), nowhere.steps()?.steps[0].rmse, "the present state is judged all the same");
    studio.save(&path("calibrated.toml").display().to_string(), false)?;
    let calibrated = Model::read(path("calibrated.toml"))?;
    written("dataset.toml", "not a model")?;
    written("broken.toml", "[model]\nname = 3\n")?;
    written("torn.safetensors", "no tensors")?;
    written("notes.txt", "nothing of ours")?;
    std::fs::create_dir(path("empty")).map_err(Error::io("empty"))?;
    std::fs::create_dir(path("run")).map_err(Error::io("run"))?;
    let found = studio.runs();
    assert_eq!(found.folder, place.path().display().to_string());
    let mut names: Vec<&str> = found.rows.iter().map(|row| row.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["broken.toml", "calibrated.toml", "model.toml", "torn.safetensors"]);
    assert!(found.rows.windows(2).all(|pair| pair[0].written_s >= pair[1].written_s), "the newest first");
    assert!(named(&found.rows, "calibrated.toml")?.open && !named(&found.rows, "model.toml")?.open, "the file that was saved last");
    for name in ["broken.toml", "torn.safetensors"] {
        let row = named(&found.rows, name)?;
        assert!(row.error.as_ref().is_some_and(|error| error.contains(name)), "{row:?}");
        assert!(matches!(studio.run_errors(Some(name))?, Found::Missing { why } if why.contains(name)));
    }
    assert!(matches!(studio.run_errors(Some("../model.toml")), Err(Error::Config { .. })), "nothing outside the folder");
    assert!(matches!(studio.run_errors(Some("dataset.toml")), Err(Error::Config { .. })));
    // Without a network every sample is judged, as above the views.
    let steps = studio.steps()?;
    let present = errors(&studio, None)?;
    assert_eq!(Some(present.rmse), steps.steps[steps.at].rmse);
    assert_eq!(errors(&studio, Some("calibrated.toml"))?.rmse, present.rmse, "it is the present state");
    // With networks all are judged on fewer samples, the same for all.
    network(calibrated.clone(), 0.0, &path("run").join("network.safetensors"))?;
    network(calibrated, 1.0, &path("untrained.safetensors"))?;
    let rows = studio.runs().rows;
    assert!(named(&rows, "run")?.kind == Kind::Network && named(&rows, "run")?.says.contains("Phy-Ture"), "{rows:?}");
    let (silent, noisy) = (errors(&studio, Some("run"))?, errors(&studio, Some("untrained.safetensors"))?);
    let fewer = errors(&studio, None)?;
    assert!(fewer.basis != present.basis && [&silent, &noisy].iter().all(|one| one.basis == fewer.basis), "{}", fewer.basis);
    for (one, other) in silent.rmse.channels().iter().zip(fewer.rmse.channels().iter()) {
        let apart = one.zip(*other).map(|(one, other)| (one / other - 1.0).abs());
        assert!(apart.is_some_and(|apart| apart < 1e-5), "a network that says nothing is its model: {one:?} {other:?}");
    }
    assert_ne!(noisy.rmse, fewer.rmse);
    // The present state moves, the files do not.
    studio.edit(&Edit::Add { effect: HIDDEN.into() })?;
    assert_ne!(errors(&studio, None)?.rmse, fewer.rmse);
    assert_eq!(errors(&studio, Some("calibrated.toml"))?.rmse, fewer.rmse);
    let saved = path("amended.toml").display().to_string();
    studio.save(&saved, false)?;
    assert!(named(&studio.runs().rows, "amended.toml")?.says.contains(HIDDEN));
    assert_ne!(blank().effects, Model::read(path("amended.toml"))?.effects);
    Ok(())
}
