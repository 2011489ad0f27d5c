//! What a reader must survive and must not overlook: nodes that are no files, damaged files, sizes beyond reason, what was read and what
//! was not. What a log says is the subject of `flight_logs`.
#![cfg(all(feature = "files", unix))]

mod support;

use phyture::flight::read::{ReadOptions, data_set};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use support::*;

fn sha256(path: &Path) -> Result<String, phyture::Error> {
    Ok(data_set(path, &ReadOptions::default())?.source.sha256)
}

fn pipe(path: &Path) -> Outcome {
    let made = Command::new("mkfifo").arg(path).status()?;
    assert!(made.success(), "mkfifo {}", path.display());
    Ok(())
}

#[test]
fn the_hash_is_of_what_was_read_and_of_nothing_else() -> Outcome {
    let folder = tempfile::tempdir()?;
    let (root, csv) = (folder.path(), Sheet::canonical(60).csv());
    put(root, "data/hover/a.csv", &csv)?;
    put(root, "data/turn/a.csv", &csv)?;
    let data = root.join("data");
    let first = data_set(&data, &ReadOptions::default())?;
    let hash = first.source.sha256.clone();
    assert!(hash.len() == 64 && hash.chars().all(|c| c.is_ascii_hexdigit()), "{hash}");
    assert_eq!(first.source.files, [data.join("hover/a.csv"), data.join("turn/a.csv")]);

    // A run folder, notes, a pipe, a link that goes round, a file that nobody may read.
    put(&data, "run/checkpoint", "weights")?;
    put(&data, "hover/notes.txt", "windy")?;
    put(&data, "secret.txt", "x")?;
    std::fs::set_permissions(data.join("secret.txt"), std::os::unix::fs::PermissionsExt::from_mode(0o000))?;
    pipe(&data.join("hover/live.csv"))?;
    pipe(&data.join("pipe"))?;
    symlink(&data, data.join("round"))?;
    symlink("..", data.join("hover/up"))?;
    let set = data_set(&data, &ReadOptions::default())?;
    assert_eq!(set.source.sha256, hash);
    let notes = set.notes.join("\n");
    assert_says(&notes, &["5 files that are no logs were not read", "hover/live.csv", "1 folder without logs was not read: run"]);
    assert_says(&notes, &["1 symbolic link that leads back to the data set was not read: round", "hover/up"]);

    // The same elsewhere is the same; another name, another number are not.
    let moved = root.join("moved");
    put(&moved, "hover/a.csv", &csv)?;
    put(&moved, "turn/a.csv", &csv)?;
    assert_eq!(sha256(&moved)?, hash);
    std::fs::rename(moved.join("turn/a.csv"), moved.join("turn/b.csv"))?;
    assert_ne!(sha256(&moved)?, hash);
    put(&data, "turn/a.csv", &Sheet::canonical(60).cell("u1", 3, 0.5).csv())?;
    assert_ne!(sha256(&data)?, hash);
    Ok(())
}

#[test]
fn the_description_in_force_is_part_of_the_hash_wherever_it_lies() -> Outcome {
    let folder = tempfile::tempdir()?;
    let (root, csv) = (folder.path(), Sheet::canonical(60).csv());
    put(root, "data/hover/a.csv", &csv)?;
    let (data, class, log) = (root.join("data"), root.join("data/hover"), root.join("data/hover/a.csv"));
    let before = [sha256(&data)?, sha256(&class)?, sha256(&log)?];
    // One folder up of the class, two of the log.
    put(root, "data/dataset.toml", "notes = \"a\"")?;
    let with = [sha256(&data)?, sha256(&class)?];
    put(root, "data/dataset.toml", "notes = \"b\"")?;
    let changed = [sha256(&data)?, sha256(&class)?];
    for (index, name) in ["data", "class"].iter().enumerate() {
        assert!(before[index] != with[index] && with[index] != changed[index], "{name}");
    }
    // Beside the single log, and above the data set.
    std::fs::rename(root.join("data/dataset.toml"), root.join("dataset.toml"))?;
    assert_eq!(sha256(&data)?, changed[0], "a description that moves and stays the same changes nothing");
    std::fs::rename(root.join("dataset.toml"), root.join("data/hover/dataset.toml"))?;
    let beside = sha256(&log)?;
    assert_ne!(beside, before[2]);
    put(root, "data/hover/dataset.toml", "notes = \"c\"")?;
    assert_ne!(sha256(&log)?, beside);
    Ok(())
}

#[test]
fn what_was_not_read_is_counted_and_what_could_be_converted_is_told() -> Outcome {
    let folder = tempfile::tempdir()?;
    let (root, csv) = (folder.path(), Sheet::canonical(60).csv());
    put(root, "data/hover/a.csv", &csv)?;
    for name in ["b.csv.gz", "c.txt", "d.xlsx", "old/e.csv", "model.toml"] {
        put(&root.join("data/hover"), name, "x")?;
    }
    let notes = data_set(&root.join("data"), &ReadOptions::default())?.notes;
    assert_eq!(
        notes,
        [
            "3 files that are no logs were not read: hover/b.csv.gz, hover/c.txt, hover/d.xlsx",
            "1 folder inside the folder of a manoeuvre was not read: hover/old; logs lie in DATA/<manoeuvre>/",
        ]
    );
    put(root, "px4/log.ulg", "ULog")?;
    put(root, "apm/00000001.BIN", "x")?;
    for (path, parts) in [
        ("px4", ["log.ulg", "does not begin as a PX4 log"]),
        ("px4/log.ulg", ["does not begin as a PX4 log", "written by PX4"]),
        ("apm/00000001.BIN", ["does not begin as an ArduPilot log", "written by ArduPilot"]),
        ("data/hover/b.csv.gz", ["a file of the kind `.gz`", "gunzip"]),
    ] {
        assert_says(&refusal(data_set(&root.join(path), &ReadOptions::default())), &parts);
    }
    pipe(&root.join("live.csv"))?;
    assert_says(&refusal(data_set(&root.join("live.csv"), &ReadOptions::default())), &["a pipe or a device", "a plain file"]);
    symlink("nowhere.csv", root.join("data/hover/z.csv"))?;
    assert_says(
        &refusal(data_set(&root.join("data"), &ReadOptions::default())),
        &["z.csv: found a symbolic link to a file that is not"],
    );
    Ok(())
}

#[test]
fn sizes_and_rates_beyond_reason_are_refused_before_anything_is_made_of_them() -> Outcome {
    let sheet = Sheet::canonical(60);
    let derived = sheet.clone().without_all(&["vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot"]);
    for (csv, description, parts) in [
        (sheet.csv(), "resample_hz = 1e9", &["`resample_hz` is 1000000000, expected a rate from 2 to 100000 Hz"][..]),
        (derived.csv(), "cutoff_hz = 1e-300", &["`cutoff_hz`", "from 0.005 Hz to 30.000 Hz"]),
        (sheet.csv(), "[units]\nt = \"ns\"", &["column `t`: found a step of", "`[units] t = \"ns\"` in dataset.toml does not fit"]),
        (sheet.clone().map("t", |t| t * 1e-300).csv(), "", &["2 to 100000 samples a second"]),
        (sheet.clone().map("t", |t| t * 1e3).csv(), "", &["if time is in ms, which would be 100 Hz, say [units] t = \"ms\""]),
        (sheet.clone().map("t", |t| t * 1e6).csv(), "", &["if time is in us, which would be 100 Hz, say [units] t = \"us\""]),
    ] {
        assert_says(&refusal(read_one(&csv, description)), parts);
    }
    // A day on two stamps a second, resampled to 100 kHz, would be 8.6 thousand million samples.
    let slow = sheet.clone().map("t", |t| t * 49.0);
    let long = (0..200).map(|block| slow.clone().map("t", |t| t + 29.4 * f64::from(block))).reduce(|mut all, more| {
        all.columns.iter_mut().zip(more.columns).for_each(|(all, more)| all.extend(more));
        all
    });
    let text = long.map(|sheet| sheet.csv()).unwrap_or_default();
    assert_says(&refusal(read_one(&text, "resample_hz = 100000")), &["would make 5.9e8 samples, more than 2e7"]);
    let header: String = (0..200_000).map(|column| format!(",c{column}")).collect();
    assert_says(&refusal(read_one(&format!("t{header}\n0\n"), "")), &["200001 columns", "at most 10000"]);
    Ok(())
}

#[test]
fn a_jittering_clock_is_told_of_resampling_first() {
    let sheet = Sheet::canonical(300);
    let stamps = (0..300).map(|row| 0.01 * (f64::from(row) + 0.1 * (1.3 * f64::from(row)).sin())).collect();
    let message = refusal(read_one(&sheet.with("t", stamps).csv(), ""));
    assert_says(&message, &["steps are uneven", "`resample_hz = 100` in dataset.toml"]);
    assert!(!message.contains("--split-at-gaps"), "{message}");
}

#[test]
fn a_quaternion_may_stand_scalar_first() -> Outcome {
    use phyture::flight::attitude::{QuaternionOrder, euler_to_quaternion};
    let sheet = Sheet::canonical(120);
    let parts: Vec<[f64; 4]> = (0..120)
        .map(|row| euler_to_quaternion(sheet.get("roll")[row], sheet.get("pitch")[row], sheet.get("yaw")[row]))
        .map(|quaternion| QuaternionOrder::ScalarFirst.written(quaternion))
        .collect();
    let mut other = sheet.clone().without_all(&["roll", "pitch", "yaw"]);
    for (axis, name) in ["q1", "q2", "q3", "q4"].iter().enumerate() {
        other = other.with(name, parts.iter().map(|part| part[axis]).collect());
    }
    let data = read_one(&other.csv(), "quaternion = \"wxyz\"")?;
    assert_same(only(&data), &sheet, phyture_kernels::Tolerance::Close.relative_f64());
    assert_eq!(data.source.quaternion, Some(QuaternionOrder::ScalarFirst));
    assert_eq!(data.source.stated.get("quaternion").map(String::as_str), Some("wxyz"));
    Ok(())
}

#[cfg(feature = "parquet")]
#[test]
fn no_bit_of_a_damaged_parquet_file_gets_a_panic_past_the_reader() -> Outcome {
    use phyture::flight::{Column, Flight, Targets, guard, write};
    // A panic that is caught behind the border is not worth a trace.
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !guard::inside() {
            report(panic);
        }
    }));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("a.parquet");
    let sheet = Sheet::canonical(12);
    let columns = Column::ALL.map(|column| sheet.get(column.name()).to_vec());
    write::parquet(&Flight::new("a", "hover", 0.0, STEP_S, columns, Targets::Recorded)?, &path)?;
    let bytes = std::fs::read(&path)?;
    let (mut accepted, mut refused) = (0_usize, 0_usize);
    // Every bit of the footer, where the structure is, and every bit of the headers and values of the first columns; then each seventh.
    let footer = bytes.len() - bytes.len() / 3;
    for bit in (0..8 * bytes.len()).filter(|bit| bit % 7 == 0 || *bit / 8 < 600 || *bit / 8 >= footer) {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(&path, &damaged)?;
        match data_set(&path, &ReadOptions::default()) {
            Ok(_) => accepted += 1,
            Err(phyture::Error::Log { .. } | phyture::Error::Cell { .. }) => refused += 1,
            Err(other) => panic!("bit {bit}: {other}"),
        }
    }
    assert!(refused > 1000 && accepted > 0, "{refused} refused, {accepted} accepted");
    Ok(())
}

#[test]
fn a_copy_of_a_flight_under_another_name_is_left_out_and_said() -> Outcome {
    let folder = tempfile::tempdir()?;
    let data = folder.path().join("data");
    let sheet = Sheet::canonical(60);
    put(&data, "hover/a.csv", &sheet.csv())?;
    put(&data, "hover/b.csv", &Sheet::canonical(60).cell("u1", 3, 0.5).csv())?;
    put(&data, "turn/a.csv", &sheet.csv())?;
    put(&data, "turn/c.csv", &sheet.csv())?;
    let set = data_set(&data, &ReadOptions::default())?;
    let names: Vec<&str> = set.flights.iter().map(|flight| flight.name.as_str()).collect();
    assert_eq!(names, ["hover/a", "hover/b"]);
    assert_says(&set.notes.join("\n"), &["left out, since they hold the same numbers as `hover/a`: turn/a, turn/c"]);
    // It was read, and the hash says so.
    assert_eq!(set.source.files.len(), 4);
    Ok(())
}
