//! The program as a shell sees it: exit codes, messages on standard error, JSON on standard output, Ctrl-C.
#![cfg(all(feature = "cli", unix))]

use phyture::{Error, Result};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn phyture(folder: &Path, arguments: &[&str]) -> Result<Output> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phyture"));
    command.args(arguments).current_dir(folder).output().map_err(Error::io("phyture"))
}

fn folder() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(Error::io("temporary folder"))
}

#[test]
fn bad_usage_and_bad_input_exit_with_2_and_say_what_is_wrong() -> Result<()> {
    let place = folder()?;
    let wrong = [
        (&["calibrat", "data"][..], "unrecognized subcommand"),
        (&["check", "nowhere"], "nowhere"),
        (&["simulate", "data", "--hide", "ground_efect"], "ground_effect"),
        (&["simulate", "data", "--hide", "ground_effect=much"], "EFFECT=SCALE"),
        (&["parity", "nothing.safetensors"], "nothing.safetensors"),
    ];
    for (arguments, message) in wrong {
        let output = phyture(place.path(), arguments)?;
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
    Ok(())
}

#[test]
fn results_go_to_standard_output_as_json_alone_when_asked() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7300"])?.status.success());
    let commands = [
        (&["check", "data", "--json", "-"][..], "fault"),
        (&["calibrate", "data", "-o", "model.toml", "--lock", "chaos", "--json", "-"], "condition_number"),
        (&["compare", "data", "-m", "model.toml", "--json", "-"], "models"),
    ];
    for (arguments, key) in commands {
        let output = phyture(place.path(), arguments)?;
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        let parsed: std::result::Result<serde_json::Value, _> = serde_json::from_slice(&output.stdout);
        assert!(parsed.is_ok_and(|value| value.get(key).is_some()), "{arguments:?}");
    }
    Ok(())
}

#[test]
fn a_convention_fault_exits_with_3_after_its_report_is_written() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7301"])?.status.success());
    // The log says z is down; read it as if it were up.
    std::fs::write(place.path().join("data/dataset.toml"), "axes = \"ENU/FLU\"\n").map_err(Error::io("dataset.toml"))?;
    let output = phyture(place.path(), &["check", "data", "--json", "check.json"])?;
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(place.path().join("check.json").exists());
    Ok(())
}

#[test]
fn an_interrupted_training_saves_and_exits_with_130() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7302"])?.status.success());
    assert!(phyture(place.path(), &["calibrate", "data", "-o", "model.toml"])?.status.success());
    let config = "epochs = 100000\nstride = 20\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";
    std::fs::write(place.path().join("train.toml"), config).map_err(Error::io("train.toml"))?;
    let mut command = Command::new(env!("CARGO_BIN_EXE_phyture"));
    command.args(["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml"]).current_dir(place.path());
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(Error::io("phyture"))?;
    // The first checkpoint is written when the run begins.
    let begun = Instant::now();
    while !place.path().join("run/checkpoint.phyture").exists() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(100));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().map_err(Error::io("kill"))?;
    assert!(sent.success());
    let output = child.wait_with_output().map_err(Error::io("phyture"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{text}");
    assert!(text.contains("saved after step"), "{text}");
    Ok(())
}
