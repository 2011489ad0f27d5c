//! PX4 and ArduPilot logs as they are: what `fixtures/logs/generate.py` wrote from a simulated flight is read back.
#![cfg(feature = "files")]

mod support;

use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight, Targets};
use std::path::{Path, PathBuf};
use support::Outcome;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/logs").join(name)
}

fn read(path: &Path, description: &str) -> phyture::Result<DataSet> {
    data_set(path, &ReadOptions { described: Some(description.into()), ..ReadOptions::default() })
}

/// Root mean square of the difference from the flight that the log was written from, relative to that of the flight without its mean.
fn off(flight: &Flight, truth: &Flight, boot_s: f64, column: Column) -> f64 {
    let (values, expected) = (flight.column(column), truth.column(column));
    let unwrapped = |difference: f64| match column {
        Column::Roll | Column::Yaw => difference.sin().atan2(difference.cos()),
        _ => difference,
    };
    let (mut error, mut count) = (0.0, 0.0);
    for (row, value) in values.iter().enumerate() {
        let at = (flight.start_s + flight.step_s * row as f64 - boot_s - truth.start_s) / truth.step_s;
        let (low, part) = (at.floor() as usize, at.fract());
        if let Some([a, b]) = expected.get(low..low + 2) {
            error += unwrapped(value - (a + part * unwrapped(b - a))).powi(2);
            count += 1.0;
        }
    }
    let mean = expected.iter().sum::<f64>() / expected.len() as f64;
    let size: f64 = expected.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / expected.len() as f64;
    assert!(count > 400.0, "{count} samples");
    (error / count / size).sqrt()
}

#[test]
fn what_the_script_wrote_comes_back() -> Outcome {
    let truth = data_set(&fixture("flight.csv"), &ReadOptions::default())?;
    // Angles in hundredths of a degree, and streams of 25 to 100 Hz onto 100 Hz.
    for (name, boot_s) in [("px4.ulg", 30.0), ("ardupilot.bin", 40.0)] {
        let data = data_set(&fixture(name), &ReadOptions::default())?;
        let flight = &data.flights[0];
        assert_eq!((data.flights.len(), flight.targets, flight.step_s), (1, Targets::Derived, 0.01), "{name}");
        for &column in Column::STATE {
            let off = off(flight, &truth.flights[0], boot_s, column);
            assert!(off < 0.05, "{name}: {column:?} is off by {off:.4}");
        }
        assert!(flight.extra.keys().any(|name| name == "battery_status.voltage_v" || name == "BAT.Volt"), "{name}");
        let notes = data.notes.join("\n");
        assert!(notes.contains("joined at 100 Hz with a local cubic") && notes.contains("held at the last value"), "{notes}");
    }
    Ok(())
}

#[test]
fn a_description_goes_before_what_the_format_says() -> Outcome {
    let text = "resample_hz = 50\nextra = []\n[columns]\nu4 = \"-2 * 'vehicle_thrust_setpoint.xyz[2]'\"\nwx = \"'vehicle_angular_velocity.xyz[0]' * 1\"\n";
    let (plain, own) = (read(&fixture("px4.ulg"), "resample_hz = 50")?, read(&fixture("px4.ulg"), text)?);
    let (plain, own) = (&plain.flights[0], &own.flights[0]);
    let extra: Vec<&str> = own.extra.keys().map(String::as_str).collect();
    assert_eq!((own.step_s, extra), (0.02, vec!["vehicle_angular_velocity.xyz[0]", "vehicle_thrust_setpoint.xyz[2]"]));
    assert!(own.column(Column::U4).iter().zip(plain.column(Column::U4)).all(|(a, b)| (a - 2.0 * b).abs() < 1e-12));
    assert_eq!(own.column(Column::Wx), plain.column(Column::Wx));
    Ok(())
}

#[test]
fn a_log_that_ends_in_a_message_is_refused_with_the_place_or_read_up_to_it() -> Outcome {
    let folder = tempfile::tempdir()?;
    for name in ["px4.ulg", "ardupilot.bin"] {
        let whole = std::fs::read(fixture(name))?;
        let path = folder.path().join(name);
        std::fs::write(&path, &whole[..whole.len() - whole.len() / 8 - 1])?;
        let refused = read(&path, "").map(|_| ()).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains("at byte") && text.contains("damaged = \"stop\"")), "{refused:?}");
        let data = read(&path, "damaged = \"stop\"")?;
        assert!(data.flights[0].len() > 300 && data.notes.join("\n").contains("read up to where it is damaged"));
    }
    // Both in one folder: a description holds for one format.
    std::fs::copy(fixture("px4.ulg"), folder.path().join("px4.ulg"))?;
    let refused = data_set(folder.path(), &ReadOptions::default()).map(|_| ()).map_err(|error| error.to_string());
    assert!(
        matches!(&refused, Err(text) if text.contains("beside an ArduPilot log") || text.contains("beside a PX4 log")),
        "{refused:?}"
    );
    Ok(())
}

#[test]
fn classes_are_given_by_name() -> Outcome {
    let folder = tempfile::tempdir()?;
    for name in ["log_1.ulg", "log_2.ulg"] {
        std::fs::copy(fixture("px4.ulg"), folder.path().join(name))?;
    }
    let text = "resample_hz = 100\n[classes]\nchaos = [\"log_2\"]\n";
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert_eq!(data.manoeuvres().len(), 1);
    std::fs::write(folder.path().join("dataset.toml"), text.replace("log_2", "log_3"))?;
    let refused = data_set(folder.path(), &ReadOptions::default()).map(|_| ()).map_err(|error| error.to_string());
    assert!(
        matches!(&refused, Err(text) if text.contains("`classes`") && text.contains("is no log of this data set")),
        "{refused:?}"
    );
    std::fs::write(folder.path().join("dataset.toml"), text.replace("log_2", "log_1"))?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert!(data.flights.iter().any(|flight| flight.manoeuvre == "chaos"));
    Ok(())
}
