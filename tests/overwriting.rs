//! Nothing that exists is overwritten unasked, nothing is lost by a second run, and two programs do not write one thing.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::{Error, Result};
use program::{command, contents, folder, phyture};
use std::fs;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};

/// A network of seconds.
const SMALL: &str = "epochs = 1\nstride = 50\nbatch = 8\n[network]\nhistory = 32\nd_model = 8\nheads = 2\n";

fn done(folder: &Path, arguments: &[&str]) -> Result<()> {
    let output = phyture(folder, arguments)?;
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(())
}

fn refused(folder: &Path, arguments: &[&str], part: &str) -> Result<()> {
    let output = phyture(folder, arguments)?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
    assert!(text.contains(part), "{arguments:?}: {text}");
    Ok(())
}

#[test]
fn every_command_refuses_what_is_there_and_leaves_it_to_the_byte() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    fs::write(at.join("small.toml"), SMALL).map_err(Error::io("small.toml"))?;
    let commands = [
        &["simulate", "flights", "--minutes", "10", "--baseline", "--seed", "7310"][..],
        &["init", "flights", "--output", "described"],
        &["check", "flights", "--json", "check.json"],
        &["calibrate", "flights", "-m", "flights/model.toml", "-o", "model.toml", "--lock", "chaos"],
        &["effect", "add", "wind", "-m", "model.toml", "-o", "wind.toml"],
        &["diagnose", "flights", "-m", "model.toml", "--report", "report"],
        &["compare", "flights", "-m", "model.toml", "--report", "report"],
        &["loop", "flights", "-m", "model.toml", "-o", "amended.toml"],
        &["train", "flights", "-m", "model.toml", "-o", "run", "--config", "small.toml"],
        &["predict", "flights", "-n", "run", "-o", "hybrid.csv", "--stride", "100"],
        &["implant", "flights", "implanted", "--effect", "quad_drag", "-m", "model.toml"],
        &["export-c", "model.toml", "-o", "model.c", "--hz", "100"],
    ];
    for arguments in commands {
        done(at, arguments)?;
    }
    assert!(at.join("report/diagnosis.html").exists() && at.join("report/comparison.html").exists());
    let before = contents(at)?;
    for arguments in commands {
        refused(at, arguments, "--force")?;
    }
    assert_eq!(contents(at)?, before);
    for arguments in commands {
        done(at, &[arguments, &["--force"]].concat())?;
    }
    assert_eq!(contents(at)?.keys().collect::<Vec<_>>(), before.keys().collect::<Vec<_>>(), "nothing is left over");
    Ok(())
}

#[test]
fn flights_of_two_simulations_do_not_mix_and_the_users_own_are_never_removed() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    done(at, &["simulate", "flights", "--minutes", "10", "--baseline"])?;
    let many = contents(&at.join("flights"))?.len();
    done(at, &["simulate", "flights", "--minutes", "1", "--baseline", "--force"])?;
    let few = contents(&at.join("flights"))?.len();
    assert!(few < many, "{few} files after {many}");
    fs::create_dir_all(at.join("own/hover")).map_err(Error::io("own"))?;
    fs::write(at.join("own/hover/first.csv"), "the only copy").map_err(Error::io("own"))?;
    refused(at, &["simulate", "own", "--minutes", "1", "--force"], "first.csv")?;
    refused(at, &["implant", "flights", "own", "--effect", "quad_drag", "--force"], "first.csv")?;
    refused(at, &["demo", "--out", "own", "--force"], "first.csv")?;
    assert_eq!(fs::read(at.join("own/hover/first.csv")).map_err(Error::io("own"))?, b"the only copy");
    Ok(())
}

#[test]
fn a_model_written_over_itself_is_kept_with_the_date() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    done(at, &["simulate", "flights", "--minutes", "2", "--baseline", "--seed", "7311"])?;
    fs::write(at.join("n9.toml"), "[model]\nbaseline = \"paper\"\n").map_err(Error::io("n9.toml"))?;
    done(at, &["calibrate", "flights", "-m", "n9.toml", "-o", "n9.toml"])?;
    let kept: Vec<_> = contents(at)?.into_iter().filter(|(path, _)| path.to_string_lossy().contains("n9.2")).collect();
    assert!(matches!(&kept[..], [(_, text)] if text == b"[model]\nbaseline = \"paper\"\n"), "{kept:?}");
    assert!(fs::read_to_string(at.join("n9.toml")).is_ok_and(|text| text.contains("ci95")));
    Ok(())
}

#[test]
fn pipes_links_and_devices_stay_what_they_are() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    done(at, &["simulate", "flights", "--minutes", "2", "--baseline", "--seed", "7312"])?;
    let pipe = at.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().map_err(Error::io("mkfifo"))?.success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || fs::read_to_string(pipe)
    });
    done(at, &["check", "flights", "--json", "pipe"])?;
    let text = reader.join().map_err(|_| Error::Undetermined("the reader panicked".into()))?.map_err(Error::io(&pipe))?;
    assert!(text.contains("\"fault\"") && fs::symlink_metadata(&pipe).is_ok_and(|there| there.file_type().is_fifo()));
    symlink("elsewhere.json", at.join("link.json")).map_err(Error::io("link"))?;
    done(at, &["check", "flights", "--json", "link.json"])?;
    assert!(fs::symlink_metadata(at.join("link.json")).is_ok_and(|there| there.is_symlink()));
    assert!(at.join("elsewhere.json").is_file());
    done(at, &["check", "flights", "--json", "/dev/null"])?;
    assert!(fs::metadata("/dev/null").is_ok_and(|there| there.file_type().is_char_device()));
    Ok(())
}

#[test]
fn a_missing_folder_is_said_before_the_work() -> Result<()> {
    let place = folder()?;
    // The flights are missing too: the output comes first.
    for arguments in [
        &["calibrate", "nowhere", "-o", "no/model.toml"][..],
        &["loop", "nowhere", "-o", "no/model.toml"],
        &["predict", "nowhere", "-n", "run", "-o", "no/out.csv"],
        &["check", "nowhere", "--json", "no/check.json"],
    ] {
        refused(place.path(), arguments, "no: the folder to write to is missing")?;
    }
    Ok(())
}

#[test]
fn two_programs_do_not_train_in_one_folder() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    fs::write(at.join("small.toml"), SMALL.replace("epochs = 1", "epochs = 1000")).map_err(Error::io("small.toml"))?;
    done(at, &["simulate", "flights", "--minutes", "4", "--baseline", "--seed", "7313"])?;
    done(at, &["calibrate", "flights", "-m", "flights/model.toml", "-o", "model.toml"])?;
    let train = ["train", "flights", "-m", "model.toml", "-o", "run", "--config", "small.toml"];
    let mut first = command(at, &train).stdout(Stdio::null()).stderr(Stdio::null()).spawn().map_err(Error::io("phyture"))?;
    while !at.join("run/checkpoint.phyture").exists() {
        assert!(first.try_wait().map_err(Error::io("phyture"))?.is_none(), "the first ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    refused(at, &[&train[..], &["--resume"]].concat(), &format!("process {} on ", first.id()))?;
    first.kill().and_then(|()| first.wait()).map_err(Error::io("phyture"))?;
    // Its lock is gone with it.
    refused(at, &train, "a training run")
}

#[test]
fn a_failure_gives_way_to_the_command_put_right() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    refused(at, &["check", "flights", "--json", "check.json"], "flights")?;
    let failure = fs::read_to_string(at.join("check.json")).map_err(Error::io("check.json"))?;
    assert!(failure.contains("\"error\""), "{failure}");
    // The same again fails for the same reason, and not for what stands there.
    refused(at, &["check", "flights", "--json", "check.json"], "flights")?;
    done(at, &["simulate", "flights", "--minutes", "2", "--baseline", "--seed", "7314"])?;
    done(at, &["check", "flights", "--json", "check.json"])?;
    refused(at, &["check", "flights", "--json", "check.json"], "--force")?;
    let other = "{\"error\": \"of somebody else\"}";
    fs::write(at.join("other.json"), other).map_err(Error::io("other.json"))?;
    refused(at, &["check", "flights", "--json", "other.json"], "--force")?;
    assert!(fs::read_to_string(at.join("other.json")).is_ok_and(|text| text == other));
    Ok(())
}
