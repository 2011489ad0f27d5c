//! Reading as the command line shows it: names of flights, what is never overwritten, what is said and how it looks on a terminal.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::{Error, Result};
use program::{folder, phyture};
use std::path::Path;

/// Standard output and standard error of a command, and whether it ended well.
fn told(folder: &Path, arguments: &[&str]) -> Result<(bool, String)> {
    let output = phyture(folder, arguments)?;
    let text = [output.stdout, output.stderr].concat();
    Ok((output.status.success(), String::from_utf8_lossy(&text).into_owned()))
}

/// The files named `*.csv` of a folder of class folders.
fn logs(folder: &Path) -> Vec<std::path::PathBuf> {
    let inside = |folder: &Path| -> Vec<std::path::PathBuf> {
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
    };
    let mut found: Vec<_> = inside(folder).iter().flat_map(|class| inside(class)).collect();
    found.retain(|path| path.extension().is_some_and(|ending| ending == "csv"));
    found.sort();
    found
}

#[test]
fn equal_file_names_in_two_classes_are_two_flights_and_old_model_files_keep_their_meaning() -> Result<()> {
    let place = folder()?;
    let path = |name: &str| place.path().join(name);
    assert!(told(place.path(), &["simulate", "made", "--minutes", "2", "--seed", "7300"])?.0);
    for (number, log) in logs(&path("made")).iter().enumerate() {
        let class = if number % 2 == 0 { "data/one" } else { "data/two" };
        std::fs::create_dir_all(path(class)).map_err(Error::io(path(class)))?;
        let to = path(class).join(format!("flight_{}.csv", number / 2));
        std::fs::copy(log, &to).map_err(Error::io(to))?;
    }
    let (done, text) = told(place.path(), &["calibrate", "data", "-o", "m.toml", "--lock", "two/flight_0"])?;
    assert!(done, "{text}");
    let (done, text) = told(place.path(), &["calibrate", "data", "-o", "no.toml", "--lock", "flight_0"])?;
    assert!(!done && text.contains("the name of 2 flights") && text.contains("`one/flight_0`, `two/flight_0`"), "{text}");

    // Numbers by flight are written by path, and a file that has them by bare name reads on where only one flight can be meant.
    assert!(told(place.path(), &["effect", "add", "wind", "-m", "m.toml", "-o", "wind.toml"])?.0);
    let (done, text) = told(place.path(), &["calibrate", "data", "-m", "wind.toml", "-o", "by_path.toml"])?;
    assert!(done, "{text}");
    let by_path = std::fs::read_to_string(path("by_path.toml")).map_err(Error::io("by_path.toml"))?;
    assert!(by_path.contains("\"one/flight_0\" = {"), "{by_path}");
    let bare = by_path.replace("\"one/flight_0\" = {", "flight_0 = {").replace("\"two/flight_0\" = {", "other = {");
    std::fs::write(path("bare.toml"), bare).map_err(Error::io("bare.toml"))?;
    let (done, text) = told(place.path(), &["compare", "data", "-m", "bare.toml"])?;
    assert!(!done && text.contains("flights.flight_0") && text.contains("could mean `one/flight_0`, `two/flight_0`"), "{text}");
    let errors = |data: &str, model: &str| -> Result<serde_json::Value> {
        let output = phyture(place.path(), &["compare", data, "-m", model, "--all", "--json", "-"])?;
        let value: serde_json::Value = serde_json::from_slice(&output.stdout)
            .map_err(|_| Error::Undetermined(String::from_utf8_lossy(&output.stderr).into_owned()))?;
        Ok(value["models"][1]["rmse"].clone())
    };
    std::fs::remove_file(path("data/two/flight_0.csv")).map_err(Error::io("flight_0.csv"))?;
    assert_eq!(errors("data", "bare.toml")?, errors("data", "by_path.toml")?);
    Ok(())
}

#[test]
fn implanting_never_writes_over_recorded_flights() -> Result<()> {
    let place = folder()?;
    assert!(told(place.path(), &["simulate", "data", "--minutes", "2", "--baseline", "--seed", "7302"])?.0);
    let flights = || -> Result<Vec<Vec<u8>>> {
        logs(&place.path().join("data")).iter().map(|path| std::fs::read(path).map_err(Error::io(path))).collect()
    };
    let before = flights()?;
    assert!(before.len() > 1);
    let class = logs(&place.path().join("data"))[0].parent().map(|class| class.display().to_string()).unwrap_or_default();
    std::os::unix::fs::symlink("data", place.path().join("link")).map_err(Error::io("link"))?;
    for (data, target, part) in [
        ("data", "data", "the folder of the recorded flights"),
        ("data", "./link", "the folder of the recorded flights"),
        (class.as_str(), "data", "is a recorded flight"),
    ] {
        let (done, text) = told(place.path(), &["implant", data, target, "--effect", "quad_drag"])?;
        assert!(!done && text.contains(part) && text.contains("no option changes that"), "{data} {target}: {text}");
    }
    assert!(flights()? == before, "a recorded flight has changed");
    let (done, text) = told(place.path(), &["implant", "data", "other", "--effect", "quad_drag"])?;
    assert!(done, "{text}");
    assert_eq!(logs(&place.path().join("other")).len(), before.len());
    Ok(())
}

#[test]
fn a_name_cannot_command_the_terminal() -> Result<()> {
    let place = folder()?;
    let class = place.path().join("data/ho\u{1b}[31mver");
    std::fs::create_dir_all(&class).map_err(Error::io(&class))?;
    let log = class.join("a\u{1b}]0;owned\u{7}.csv");
    std::fs::write(&log, "t,x\u{9b}2J\n0,1\n0.01,no\n").map_err(Error::io(&log))?;
    for arguments in [&["check", "data"][..], &["check", "no\u{1b}[2Jwhere"]] {
        let (done, text) = told(place.path(), arguments)?;
        assert!(!done && !text.contains(['\u{1b}', '\u{7}', '\u{9b}']) && text.contains("\\u{1b}"), "{text:?}");
    }
    Ok(())
}

#[test]
fn too_little_data_is_refused_with_a_sentence() -> Result<()> {
    let place = folder()?;
    assert!(told(place.path(), &["simulate", "made", "--minutes", "1", "--seed", "7300"])?.0);
    let log = std::fs::read_to_string(&logs(&place.path().join("made"))[0]).map_err(Error::io("log"))?;
    for rows in [31, 61, 101, 201, 301] {
        let cut: String = log.lines().take(rows).map(|line| format!("{line}\n")).collect();
        std::fs::write(place.path().join("short.csv"), cut).map_err(Error::io("short.csv"))?;
        let (done, text) = told(place.path(), &["calibrate", "short.csv", "-o", "m.toml", "--split", "first 0.75"])?;
        assert!(!done && text.contains("s of one flight, too little to tell") && text.contains("at least 2.5 s"), "{rows}: {text}");
        assert!(!place.path().join("m.toml").exists() && !text.contains("NaN"));
    }
    let enough: String = log.lines().take(401).map(|line| format!("{line}\n")).collect();
    std::fs::write(place.path().join("short.csv"), enough).map_err(Error::io("short.csv"))?;
    let (done, text) = told(place.path(), &["calibrate", "short.csv", "-o", "m.toml", "--split", "first 0.75"])?;
    assert!(done && !text.contains("NaN") && !text.contains("inf"), "{text}");
    Ok(())
}

#[test]
fn missing_files_and_folders_are_told_in_plain_words() -> Result<()> {
    let place = folder()?;
    for (arguments, part) in [
        (&["check", "nowhere"][..], "nowhere: there is no such file or folder"),
        (&["check", "far/away"], "far/away: the folder far does not exist"),
        (&["check", "data", "-m", "none.toml"], "there is no such file or folder"),
    ] {
        let (done, text) = told(place.path(), arguments)?;
        assert!(!done && text.contains(part) && !text.contains("os error") && !text.contains("entity"), "{arguments:?}: {text}");
    }
    Ok(())
}
