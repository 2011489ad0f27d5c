//! `train` and `predict` as typed into a shell: configuration, losses, what may be an input, files by their ending, bounds of counts.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Channel, Column};
use phyture::physics::Model;
use phyture::{Error, Result};
use program::{folder, phyture, refused, succeed};
use serde_json::Value;
use std::path::Path;

const SMALL: &str =
    "epochs = 3\nstride = 40\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";

fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    std::fs::write(folder.join(name), text).map_err(Error::io(name))
}

/// Flights of two minutes, a calibrated model and a small configuration.
fn place() -> Result<tempfile::TempDir> {
    let place = folder()?;
    let at = place.path();
    succeed(at, &["simulate", "data", "--minutes", "2", "--seed", "7310"])?;
    succeed(at, &["calibrate", "data", "-m", "data/model.toml", "-o", "model.toml"])?;
    write(at, "train.toml", SMALL)?;
    Ok(place)
}

#[test]
fn the_configuration_in_force_is_printed_and_read_back() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    let usual = succeed(at, &["train", "--print-config"])?;
    for line in ["epochs = 20", "stride = 12", "history = 128", "d_model = 32", "# [linear]", "# Peak learning rate."] {
        assert!(usual.lines().any(|found| found == line), "{line} in\n{usual}");
    }
    let paper = succeed(at, &["train", "--print-config", "--paper", "--epochs", "7", "--seed", "9"])?;
    for line in ["epochs = 7", "stride = 50", "history = 1000", "d_model = 64", "seed = 9"] {
        assert!(paper.lines().any(|found| found == line), "{line} in\n{paper}");
    }
    // Read back over the other defaults, it is what it was.
    write(at, "usual.toml", &usual)?;
    write(at, "paper.toml", &paper)?;
    assert_eq!(succeed(at, &["train", "--print-config", "--config", "paper.toml"])?, paper);
    assert_eq!(succeed(at, &["train", "--print-config", "--paper", "--config", "usual.toml"])?, usual);
    let help = succeed(at, &["train", "--help"])?;
    for part in ["history of 128 samples", "width 32", "20 epochs", "every 12 samples", "--paper", "history of 1000 samples"] {
        assert!(help.split_whitespace().collect::<Vec<_>>().join(" ").contains(part), "{part} in\n{help}");
    }
    assert!(refused(at, &["train", "-m", "model.toml", "-o", "run"])?.contains("<DATA>"));
    assert!(refused(at, &["train", "data"])?.contains("--model"));
    Ok(())
}

#[test]
fn training_ends_with_one_line_that_says_where_and_how_good() -> Result<()> {
    let place = place()?;
    let at = place.path();
    let train = ["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml", "--epochs", "2"];
    let said = succeed(at, &[&train[..], &["--report", "page"]].concat())?;
    let page = std::fs::read_to_string(at.join("page/training.html")).map_err(Error::io("training.html"))?;
    for part in ["epoch 2 of 2", "Losses by epoch", "validation loss ", "SHA-256 of the data"] {
        assert!(page.contains(part), "{part} is not in the page");
    }
    let last = said.lines().find(|line| line.starts_with("trained in")).unwrap_or_default();
    for part in ["run/network.safetensors", "weights of epoch 2 of 2", "training loss ", "validation loss "] {
        assert!(last.contains(part), "{part} in {last}");
    }
    // A finished run that is gone on with says the same: nothing of it depends on when it was interrupted.
    let again = phyture(at, &[&train[..], &["--resume", "--json", "-"]].concat())?;
    let found: Value = serde_json::from_slice(&again.stdout).unwrap_or_default();
    let (training, validation) = (found["training_loss"].as_f64(), found["validation_loss"].as_f64());
    assert!(found["last_epoch_loss"].is_null() && found["validation_windows"].as_u64() > Some(10), "{found}");
    for loss in [training, validation].into_iter().flatten() {
        assert!(last.contains(&format!("{loss:.4}")), "{loss} in {last}");
    }
    let metrics = std::fs::read_to_string(at.join("run/metrics.jsonl")).map_err(Error::io("metrics.jsonl"))?;
    let lines: Vec<Value> = metrics.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let ends: Vec<&Value> = lines.iter().filter(|line| line.get("validation_loss").is_some()).collect();
    assert_eq!((lines.len() as u64, ends.len()), (found["steps"].as_u64().unwrap_or(0), 2));
    assert_eq!(ends.last().and_then(|line| line["validation_loss"].as_f64()), validation);
    // Where flights are locked, all others train.
    let locked = [&train[..6], &["--config", "train.toml", "--epochs", "1", "--lock", "chaos"]].concat();
    let locked: Vec<&str> = locked.into_iter().map(|word| if word == "run" { "locked" } else { word }).collect();
    assert!(succeed(at, &locked)?.lines().last().is_some_and(|last| last.contains("no validation part")));
    // Where nothing validates no epoch is the best.
    let text = std::fs::read_to_string(at.join("train.toml")).map_err(Error::io("train.toml"))?;
    std::fs::write(at.join("best.toml"), format!("keep_best = true\n{text}")).map_err(Error::io("best.toml"))?;
    let best: Vec<&str> = locked.into_iter().map(|word| if word == "train.toml" { "best.toml" } else { word }).collect();
    assert!(refused(at, &[&best[..], &["--force"]].concat())?.contains("`keep_best` is true, expected false"));
    Ok(())
}

#[test]
fn a_model_alone_predicts_and_files_are_told_by_their_ending() -> Result<()> {
    let place = place()?;
    let at = place.path();
    let said = succeed(at, &["predict", "data", "-m", "model.toml", "-o", "physics.csv", "--stride", "3"])?;
    assert!(said.contains("predictions of the physics"), "{said}");
    let table = std::fs::read_to_string(at.join("physics.csv")).map_err(Error::io("physics.csv"))?;
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| header.iter().position(|found| *found == name).unwrap_or_default();
    let (name, time, predicted) = (column("flight"), column("t"), column("vz_dot_predicted"));
    let set = data_set(&at.join("data"), &ReadOptions::default())?;
    let model = Model::read(at.join("model.toml"))?;
    let mut rows = 0;
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |at: usize| cells[at].parse::<f64>().unwrap_or(f64::NAN);
        if rows % 97 == 0 {
            let flight = set.flights.iter().find(|known| known.name == cells[name]);
            let flight = flight.ok_or_else(|| Error::Undetermined(format!("no flight {}", cells[name])))?;
            let sample = ((number(time) - flight.start_s) / flight.step_s).round() as usize;
            assert_eq!(number(predicted).to_bits(), model.predict(flight)?[Channel::VzDot][sample].to_bits(), "{line}");
            assert_eq!(number(column("vz_dot")).to_bits(), flight.column(Column::VzDot)[sample].to_bits());
        }
        rows += 1;
    }
    // Every third sample of each flight from its first on: no history is needed.
    assert_eq!(rows, set.flights.iter().map(|flight| flight.len().div_ceil(3)).sum::<usize>());
    assert!(succeed(at, &["predict", "data", "-m", "model.toml", "-o", "a.PARQUET", "--json", "-"])?.contains("\"physics\""));
    assert!(std::fs::read(at.join("a.PARQUET")).is_ok_and(|bytes| bytes.starts_with(b"PAR1")));
    for name in ["a.xlsx", "a", "a.csv.gz", "csv"] {
        let message = refused(at, &["predict", "nowhere", "-m", "model.toml", "-o", name])?;
        assert!(message.contains(&format!("`{name}`")) && message.contains(".csv or .parquet"), "{message}");
    }
    assert!(refused(at, &["predict", "data", "-o", "a.csv"])?.contains("--model"));
    Ok(())
}

#[test]
fn accelerations_and_what_gives_them_away_are_no_inputs() -> Result<()> {
    let place = place()?;
    let at = place.path();
    let states =
        "\"x\", \"y\", \"z\", \"roll\", \"pitch\", \"yaw\", \"vx\", \"vy\", \"vz\", \"wx\", \"wy\", \"wz\", \"u1\", \"u2\", \"u3\"";
    let train = ["train", "data", "-m", "model.toml", "-o", "run", "--config", "leak.toml"];
    for leak in ["vx_dot", "rate(wz_dot)", "0 * lag(vz_dot, 1)"] {
        write(at, "leak.toml", &format!("inputs = [{states}, \"{leak}\"]\n{SMALL}"))?;
        let message = refused(at, &train)?;
        assert!(message.contains("cannot be read here: it is one of the six accelerations") && message.contains(leak), "{message}");
        write(at, "leak.toml", &format!("{SMALL}[linear]\nlags = 2\ninputs = [\"vx\", \"{leak}\"]\n"))?;
        assert!(refused(at, &train)?.contains("cannot be read here: it is one of the six accelerations"));
    }
    // The same data with another name for an acceleration, which the description knows.
    let set = data_set(&at.join("data"), &ReadOptions::default())?;
    for flight in &set.flights {
        let path = at.join("data").join(format!("{}.csv", flight.name));
        let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
        std::fs::write(&path, text.replacen("vx_dot", "ax", 1)).map_err(Error::io(&path))?;
    }
    write(at, "data/dataset.toml", "[columns]\nvx_dot = \"1 * ax\"\n")?;
    for inputs in [format!("inputs = [{states}, \"tanh(ax)\"]\n{SMALL}"), format!("{SMALL}[linear]\nlags = 2\ninputs = [\"ax\"]\n")]
    {
        write(at, "leak.toml", &inputs)?;
        let message = refused(at, &train)?;
        assert!(
            message.contains("`ax` cannot be read here: `columns.vx_dot` in dataset.toml makes an acceleration of it"),
            "{message}"
        );
    }
    let own = "[[effect]]\nkind = \"formula\"\nname = \"own\"\nchannel = \"vx_dot\"\nformula = \"ax\"\ncoefficient = 0.0\n";
    write(at, "leak-model.toml", &format!("[model]\nbaseline = \"paper\"\n{own}"))?;
    let message = refused(at, &["calibrate", "data", "-m", "leak-model.toml", "-o", "no.toml"])?;
    assert!(message.contains("effect `own`, which reads `ax`"), "{message}");
    // A control computed from one: no input, by name or by default.
    write(at, "data/dataset.toml", "[columns]\nvx_dot = \"ax\"\nu4 = \"0.1 * ax\"\n")?;
    let message = refused(at, &["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml"])?;
    assert!(message.contains("`columns.u4` in dataset.toml makes it of `ax`"), "{message}");
    Ok(())
}

#[test]
fn counts_out_of_their_range_are_refused_before_anything_is_done() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    let benchmark = |option: &'static str, value: &'static str| vec!["benchmark", "data", "-o", "out", option, value];
    let cases = [
        (benchmark("--seeds", "1000000000"), "1000000000 is not in 1..=1000"),
        (benchmark("--threads", "100000"), "100000 is not in 0..=1024"),
        (benchmark("--threads", "-1"), "invalid value '-1'"),
        (vec!["benchmark", "data", "-o", "out", "--emit", "slurm", "--shards", "0"], "0 is not in 1..=10000"),
        (vec!["compare", "data", "-m", "m.toml", "--ridge", "1000"], "1000 is not in 1..=157"),
        (vec!["compare", "data", "-m", "m.toml", "--stride", "0"], "0 is not in 1..=1000000"),
        (vec!["predict", "data", "-m", "m.toml", "-o", "a.csv", "--stride", "0"], "0 is not in 1..=1000000"),
        (vec!["diagnose", "data", "--max-effects", "0"], "0 is not in 1..=100"),
        (vec!["train", "data", "-m", "m.toml", "-o", "run", "--epochs", "0"], "0 is not in 1..=1000000"),
        (vec!["simulate", "data", "--minutes", "-5"], "expected more than 0 and at most 1440"),
        (vec!["simulate", "data", "--minutes", "1e9"], "expected more than 0 and at most 1440"),
        (vec!["simulate", "data", "--minutes", "NaN"], "expected more than 0 and at most 1440"),
        (vec!["implant", "data", "out", "--effect", "quad_drag", "--scale", "inf"], "expected a finite number"),
    ];
    for (arguments, message) in cases {
        let text = refused(at, &arguments)?;
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
    assert!(std::fs::read_dir(at).is_ok_and(|mut entries| entries.next().is_none()), "something was written");
    Ok(())
}

#[test]
fn a_ridge_with_more_unknowns_than_windows_is_refused() -> Result<()> {
    let place = place()?;
    let message = refused(place.path(), &["compare", "data", "-m", "model.toml", "--split", "first 0.15", "--ridge", "157"])?;
    assert!(message.contains("157 of 13 inputs, 2042 unknowns for ") && message.contains("on these flights"), "{message}");
    Ok(())
}
