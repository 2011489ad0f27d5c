//! The benchmark as a user runs it: killed at any moment and gone on with, cut into shards and put together again, the tables are the
//! same bytes.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::{Error, Result};
use program::{command, folder, phyture, succeed};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

/// Little enough that a run takes a fraction of a second; every method is in it.
const CONFIG: &str =
    "epochs = 2\nstride = 250\ncheckpoint_s = 0.0\n\n[network]\nhistory = 64\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\n";

/// Flights of four classes and the configuration.
fn place() -> Result<tempfile::TempDir> {
    let place = folder()?;
    succeed(place.path(), &["simulate", "flights", "--minutes", "3", "--seed", "51"])?;
    std::fs::write(place.path().join("train.toml"), CONFIG).map_err(Error::io("train.toml"))?;
    Ok(place)
}

/// Names and contents of the files of a folder; a kill may leave a temporary file, whose name begins with a dot.
fn files(folder: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
    let entries = std::fs::read_dir(folder).map_err(Error::io(folder))?;
    let entries = entries.filter(|entry| !entry.as_ref().is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with('.')));
    entries
        .map(|entry| {
            let path = entry.map_err(Error::io(folder))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok((name, std::fs::read(&path).map_err(Error::io(&path))?))
        })
        .collect()
}

const PLAN: [&str; 11] =
    ["benchmark", "flights", "--plan", "quick", "--config", "train.toml", "--table", "1", "--table", "4", "-o"];

fn planned<'a>(folder: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    PLAN.into_iter().chain([folder]).chain(more.iter().copied()).collect()
}

#[test]
fn killed_ten_times_cut_into_shards_or_left_alone_the_tables_are_the_same_bytes() -> Result<()> {
    let place = place()?;
    let at = place.path();
    succeed(at, &planned("whole", &["--seeds", "2"]))?;
    let said = succeed(at, &["benchmark", "collect", "whole"])?;
    assert!(
        said.contains("On the flights as they are, Phy-Ture's mean error is ") && said.contains(", the best peer network, which "),
        "{said}"
    );
    assert!(said.contains("95 % interval over segments") && said.contains("± 0.02"), "{said}");
    let page = std::fs::read_to_string(at.join("whole/tables/report.html")).map_err(Error::io("report.html"))?;
    assert!(said.contains("TimesNet: its periods are chosen for each window by itself"), "{said}");
    assert!(page.contains("Losses by epoch"), "the losses of training and validation are drawn");
    assert!(said.contains("SCALED DOWN") && said.contains("Conv–Informer") && said.contains("As the paper prints it"), "{said}");

    // Moments spread over the length of the work by a fixed rule, from the first file on.
    for kill in 0..10_u64 {
        let mut child = command(at, &planned("killed", &["--seeds", "2", "--resume"]))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(Error::io("phyture"))?;
        std::thread::sleep(Duration::from_millis(150 + kill * 977 % 1400));
        child.kill().and_then(|()| child.wait()).map_err(Error::io("phyture"))?;
    }
    succeed(at, &planned("killed", &["--seeds", "2", "--resume", "--threads", "1"]))?;
    succeed(at, &["benchmark", "collect", "killed"])?;

    for shard in ["1/3", "2/3", "3/3"] {
        succeed(at, &planned(&format!("part-{}", &shard[..1]), &["--seeds", "2", "--shard", shard]))?;
    }
    let said = succeed(at, &["benchmark", "collect", "part-1"])?;
    assert!(said.contains("INCOMPLETE"), "a part says that it is one: {said}");
    succeed(at, &["benchmark", "collect", "part-1", "part-2", "part-3"])?;

    let whole = files(&at.join("whole/tables"))?;
    let names: Vec<&str> = whole.keys().map(String::as_str).collect();
    for name in ["table1.md", "table4.csv", "tables.json", "figure6.csv", "figures7_8.csv", "by_manoeuvre.csv", "report.html"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    for other in ["killed", "part-1"] {
        let other = files(&at.join(other).join("tables"))?;
        assert!(other.keys().eq(whole.keys()));
        let differing: Vec<&String> =
            whole.iter().filter(|(name, content)| other.get(*name) != Some(*content)).map(|(name, _)| name).collect();
        assert!(differing.is_empty(), "{differing:?} differ");
    }
    assert_eq!(files(&at.join("whole/runs"))?, files(&at.join("killed/runs"))?);
    Ok(())
}

#[test]
fn an_estimate_is_printed_and_nothing_is_done() -> Result<()> {
    let place = place()?;
    let said = succeed(place.path(), &planned("none", &["--estimate", "--seeds", "3"]))?;
    assert!(said.contains("runs to do, about") && said.contains("3 x TCN") && said.contains("1 x Ridge regression"), "{said}");
    assert!(said.contains("are judged\nnote: with fewer than 3000 windows judged") && said.contains("--split stretches"), "{said}");
    assert!(!place.path().join("none").exists());
    // The paper's plan divides by stretches unasked.
    let paper = ["benchmark", "flights", "--config", "train.toml", "--table", "1", "--method", "ridge", "--estimate", "-o", "none"];
    let said = succeed(place.path(), &paper)?;
    assert!(said.contains("are judged") && !said.contains("--split stretches"), "{said}");
    Ok(())
}

#[test]
fn with_the_explainable_part_there_is_a_floor_below_every_predictor() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    succeed(at, &["simulate", "flights", "--minutes", "3", "--seed", "51", "--explainable", "calm"])?;
    std::fs::write(at.join("train.toml"), CONFIG).map_err(Error::io("train.toml"))?;
    let rows =
        ["--table", "noise", "--method", "floor", "--method", "ridge", "--method", "physical_baseline", "--explainable", "calm"];
    succeed(at, &planned("bench", &rows))?;
    succeed(at, &["benchmark", "collect", "bench"])?;
    let tables = files(&at.join("bench/tables"))?;
    for name in ["table1.csv", "noise.csv"] {
        let text = String::from_utf8_lossy(&tables[name]);
        let mean = |method: &str| {
            let row =
                text.lines().find(|line| line.starts_with(&format!("{method},"))).unwrap_or_else(|| panic!("no {method}: {text}"));
            row.rsplit(',').nth(2).and_then(|value| value.parse::<f64>().ok()).unwrap_or_else(|| panic!("{row}"))
        };
        assert!(mean("floor") < mean("physical_baseline") && mean("floor") > 0.0, "{text}");
    }
    Ok(())
}

#[test]
fn folders_of_other_plans_and_impossible_requests_are_refused() -> Result<()> {
    let place = place()?;
    let at = place.path();
    let first =
        ["benchmark", "flights", "--plan", "quick", "--config", "train.toml", "--table", "5", "--shard", "1/40", "-o", "out"];
    succeed(at, &first)?;
    let refusals = [
        (planned("out", &["--seed", "5"]), "another plan"),
        (first[..8].iter().copied().chain(["-o", "out"]).collect(), "--resume to go on"),
        (vec!["benchmark", "collect", "flights"], "the folder of a benchmark"),
        (planned("new", &["--shard", "4/3"]), "I from 1 to N"),
        (planned("new", &["--table", "8"]), "`robustness`"),
        (planned("new", &["--seeds", "0"]), "0 is not in 1..=1000"),
        (vec!["benchmark", "flights"], "--output"),
    ];
    for (arguments, message) in refusals {
        let output = phyture(at, &arguments)?;
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
    Ok(())
}

#[test]
fn several_programs_share_one_folder() -> Result<()> {
    let place = place()?;
    let at = place.path();
    succeed(at, &planned("alone", &["--method", "ridge", "--method", "dlinear", "--method", "phyture", "--seeds", "2"]))?;
    // The first makes the folder; all go on in it side by side.
    let more = ["--method", "ridge", "--method", "dlinear", "--method", "phyture", "--seeds", "2", "--resume"];
    let start = || command(at, &planned("shared", &more)).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let children: Vec<_> = (0..4).map(|_| start().map_err(Error::io("phyture"))).collect::<Result<_>>()?;
    for child in children {
        let output = child.wait_with_output().map_err(Error::io("phyture"))?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    assert_eq!(files(&at.join("alone/runs"))?, files(&at.join("shared/runs"))?);
    Ok(())
}

#[test]
fn an_empty_an_edited_and_a_foreign_outcome_are_noticed() -> Result<()> {
    let place = place()?;
    let at = place.path();
    let plan = planned("bench", &["--method", "ridge", "--method", "dlinear", "--seeds", "1", "--table", "1"]);
    succeed(at, &plan)?;
    let (name, content) = files(&at.join("bench/runs"))?.into_iter().next().ok_or(Error::Undetermined("no runs".into()))?;
    let path = at.join("bench/runs").join(name);
    let text = String::from_utf8_lossy(&content).into_owned();
    let digit = text.find("\"squares\": [").and_then(|start| text[start..].find(|c: char| c.is_ascii_digit()).map(|at| start + at));
    let digit = digit.ok_or(Error::Undetermined("no errors in an outcome".into()))?;
    let changed = if &text[digit..=digit] == "9" { "8" } else { "9" };
    let edited = format!("{}{changed}{}", &text[..digit], &text[digit + 1..]);
    let resume = [&plan[..], &["--resume"]].concat();
    for (content, part) in [("", "is no outcome of a run"), (&edited, "has been changed since it was written")] {
        std::fs::write(&path, content).map_err(Error::io(&path))?;
        for arguments in [&resume[..], &["benchmark", "collect", "bench"]] {
            let output = phyture(at, arguments)?;
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.code() == Some(2) && said.contains(part) && said.contains("remove the file"), "{said}");
        }
    }
    std::fs::remove_file(&path).map_err(Error::io(&path))?;
    succeed(at, &resume)?;
    assert_eq!(std::fs::read(&path).map_err(Error::io(&path))?, content, "made again as it was");

    let other = text.replace("\"instruction_set\": \"", "\"instruction_set\": \"another-");
    std::fs::write(&path, other).map_err(Error::io(&path))?;
    assert!(succeed(at, &resume)?.contains("made at instruction set another-"));
    Ok(())
}
