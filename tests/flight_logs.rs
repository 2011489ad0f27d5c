//! Reading flight logs: what is refused and how it is said, and every key of `dataset.toml`.
#![cfg(feature = "files")]

mod support;

use phyture::flight::attitude::{Axes, cross, euler_to_quaternion, gravity_body, rotate, rotation_body_to_inertial};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight, Targets};
use phyture_kernels::Tolerance;
use std::f64::consts::{FRAC_PI_2, PI};
use support::*;

const CLOSE: f64 = Tolerance::Close.relative_f64();
const V: [&str; 3] = ["vx", "vy", "vz"];
const W: [&str; 3] = ["wx", "wy", "wz"];
const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];
const V_DOT: [&str; 3] = ["vx_dot", "vy_dot", "vz_dot"];
const W_DOT: [&str; 3] = ["wx_dot", "wy_dot", "wz_dot"];

fn triple(sheet: &Sheet, names: [&str; 3], row: usize) -> [f64; 3] {
    names.map(|name| sheet.get(name)[row])
}

fn add(a: [f64; 3], b: [f64; 3], factor: f64) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + factor * b[axis])
}

fn to_inertial(sheet: &Sheet, row: usize, v: [f64; 3]) -> [f64; 3] {
    let [roll, pitch, yaw] = triple(sheet, ANGLES, row);
    rotate(&rotation_body_to_inertial(roll, pitch, yaw), v)
}

/// ω × v.
fn transport(sheet: &Sheet, row: usize) -> [f64; 3] {
    cross(triple(sheet, W, row), triple(sheet, V, row))
}

#[test]
fn a_canonical_log_is_taken_bit_by_bit() -> Outcome {
    let sheet = Sheet::canonical(200).with("rotor_rpm", vec![1800.0; 200]);
    let data = read_one(&sheet.csv(), "")?;
    let flight = only(&data);
    assert_same(flight, &sheet, Tolerance::Exact.relative_f64());
    assert_eq!((flight.name.as_str(), flight.manoeuvre.as_str(), flight.targets), ("hover/a", "hover", Targets::Recorded));
    assert_eq!((flight.step_s.to_bits(), flight.absent.len()), (STEP_S.to_bits(), 0));
    assert_eq!(flight.named("rotor_rpm"), Some(sheet.get("rotor_rpm")));
    assert_eq!(data.notes, Vec::<String>::new());
    Ok(())
}

#[test]
fn bad_logs_are_refused_with_file_line_column_found_and_expected() {
    let good = Sheet::canonical(60);
    let text = |from: &str, to: &str| good.csv().replacen(from, to, 1);
    let cases: Vec<(String, &[&str])> = vec![
        (
            good.clone().cell("vy", 7, f64::NAN).csv(),
            &["a.csv, line 9, column `vy`: found NaN or an empty cell, expected a finite"],
        ),
        (good.clone().cell("u3", 0, f64::INFINITY).csv(), &["line 2, column `u3`: found inf"]),
        (good.clone().without("wz").csv(), &["line 1, column `wz`: found no such column in the header"]),
        (good.clone().without("vx").rename("vy", "vyy").csv(), &["`vx`", "also missing: `vy`"]),
        (good.clone().rename("roll", "rol").csv(), &["column `roll`", "did you mean `rol`?", "q1 q2 q3 q4"]),
        (good.clone().without("vz_dot").csv(), &["`vz_dot`", "all three accelerations of a kind or none"]),
        (good.clone().without_all(&W_DOT).csv(), &["`wx_dot`", "all six accelerations, or none"]),
        (good.clone().without("z").csv(), &["column `z`", "`missing` of dataset.toml"]),
        (good.clone().rename("x", "y").csv(), &["line 1, column `y`: found the same name twice in the header"]),
        (text("0.02,", "soon,"), &["column `t`: found `soon`, expected a number"]),
        (good.clone().cell("t", 9, 0.05).csv(), &["line 11, column `t`: found time that steps back: 0.05 s after 0.08 s"]),
        (good.clone().cell("t", 9, 0.08).csv(), &["line 11, column `t`: found time that repeats"]),
        (
            good.clone().keep_rows(|row| !(20..45).contains(&row)).csv(),
            &["line 22, column `t`: found a jump of 0.26", "after 0.19 s", "--split-at-gaps"],
        ),
        (
            good.clone().map("pitch", |pitch| pitch * 180.0 / PI).csv(),
            &["column `pitch`", "looks like degrees", "angles = \"deg\""],
        ),
        (String::new(), &["an empty file"]),
        (good.clone().keep_rows(|_| false).csv(), &["a header and no rows"]),
        (good.clone().keep_rows(|row| row == 0).csv(), &["a single row"]),
        ("PAR1 and so on".into(), &["binary content in a file named .csv"]),
    ];
    for (csv, parts) in cases {
        assert_says(&refusal(read_one(&csv, "")), parts);
    }
}

#[test]
fn degrees_in_a_gentle_flight_are_found_by_how_fast_they_change() {
    // Within ±1.2: too small to be found by size.
    let gentle =
        Sheet::canonical(300).map("roll", |roll| roll * 0.04).map("wx", |w| w * 0.04).map("pitch", |_| 0.0).map("wy", |_| 0.0);
    let degrees = gentle.clone().map("roll", |roll| roll * 180.0 / PI);
    assert_eq!(refusal(read_one(&gentle.csv(), "")), "accepted");
    assert_says(&refusal(read_one(&degrees.csv(), "")), &["column `roll`", "times as fast as wx says", "looks like degrees"]);
}

#[test]
fn a_flight_shorter_than_the_history_is_refused() {
    let options = ReadOptions { minimum_rows: 100, ..ReadOptions::default() };
    let message = refusal(read_with(&Sheet::canonical(60).csv(), "", &options));
    assert_says(&message, &["a.csv: found 60 samples, expected at least 100, the length of the history"]);
    let message = refusal(read_with(&Sheet::canonical(60).csv(), "use = \"height > 0\"", &options));
    assert_says(&message, &["found 60 samples, expected at least 100"]);
}

#[test]
fn gaps_split_on_request_and_short_pieces_are_left_out_aloud() -> Outcome {
    let sheet = Sheet::canonical(300).keep_rows(|row| !(100..120).contains(&row) && !(130..150).contains(&row));
    let options = ReadOptions { split_at_gaps: true, minimum_rows: 50, ..ReadOptions::default() };
    let data = read_with(&sheet.csv(), "", &options)?;
    let lengths: Vec<(&str, usize)> = data.flights.iter().map(|flight| (flight.name.as_str(), flight.len())).collect();
    assert_eq!(lengths, [("hover/a[1]", 100), ("hover/a[2]", 150)]);
    assert_eq!(data.flights[1].start_s.to_bits(), sheet.get("t")[110].to_bits());
    let notes = data.notes.join("\n");
    assert_says(
        &notes,
        &["cut at a jump of 0.210 s before t = 1.200 s", "the piece of 0.10 s (10 samples) from t = 1.20 s on is left out"],
    );
    Ok(())
}

#[test]
fn a_sample_alone_between_gaps_is_no_flight() -> Outcome {
    let sheet = Sheet::canonical(200).keep_rows(|row| !(90..110).contains(&row) || row == 100);
    let data = read_with(&sheet.csv(), "", &ReadOptions { split_at_gaps: true, ..ReadOptions::default() })?;
    assert_eq!(data.flights.iter().map(Flight::len).collect::<Vec<_>>(), [90, 90]);
    assert_says(&data.notes.join("\n"), &["the piece of 0.01 s (1 sample) from t = 1.00 s on is left out"]);
    Ok(())
}

#[test]
fn accelerations_are_derived_when_all_six_are_absent_and_this_is_said() -> Outcome {
    let sheet = Sheet::canonical(400);
    let data = read_one(&sheet.clone().without_all(&V_DOT).without_all(&W_DOT).csv(), "")?;
    let flight = only(&data);
    assert_eq!(flight.targets, Targets::Derived);
    assert_says(&data.notes.join("\n"), &["linear accelerations are derived from v", "-3 dB at 10 Hz", "angular accelerations"]);
    for column in Column::TARGETS {
        // The waves lie below 0.5 Hz: inside, the differentiator's error is its next order, some 1e-5 of the signal.
        let inside = 30..370;
        let error = difference(&flight.column(column)[inside.clone()], &sheet.get(column.name())[inside]);
        assert!(error < 1e-4, "{} by {error:e}", column.name());
    }
    let slow = read_one(&sheet.without_all(&V_DOT).without_all(&W_DOT).csv(), "cutoff_hz = 4")?;
    assert_says(&slow.notes.join("\n"), &["-3 dB at 4 Hz"]);
    Ok(())
}

#[test]
fn controls_are_held_to_the_band_of_derived_accelerations_where_that_is_asked_for_and_else_it_is_said() -> Outcome {
    let sheet = Sheet::canonical(400);
    let slow: Vec<f64> = sheet.get("u1").to_vec();
    let quick = slow.iter().enumerate().map(|(row, u1)| u1 + if row % 2 == 0 { 0.5 } else { -0.5 }).collect();
    let sheet = sheet.with("u1", quick);
    let bare = sheet.clone().without_all(&V_DOT).without_all(&W_DOT);
    let said = "some control moves faster than accelerations derived up to 10 Hz can show";
    let as_it_is = read_one(&bare.csv(), "")?;
    assert_says(&as_it_is.notes.join("\n"), &[said, "smooth_controls = true"]);
    assert_eq!(only(&as_it_is).column(Column::U1), sheet.get("u1"));
    let smooth = read_one(&bare.csv(), "smooth_controls = true")?;
    let notes = smooth.notes.join("\n");
    assert_says(&notes, &["the controls are smoothed", "-3 dB at 10 Hz", "not for a network that is to stream"]);
    assert!(!notes.contains(said), "{notes}");
    // What alternates from row to row is gone, what is slow is left.
    let error = difference(&only(&smooth).column(Column::U1)[30..370], &slow[30..370]);
    assert!(error < 0.01, "{error}");
    // Controls that are slow enough are not worth a word; recorded accelerations need nothing of the kind.
    let canonical = Sheet::canonical(400);
    let notes = read_one(&canonical.clone().without_all(&V_DOT).without_all(&W_DOT).csv(), "")?.notes.join("\n");
    assert!(!notes.contains(said), "{notes}");
    assert_says(
        &refusal(read_one(&canonical.csv(), "smooth_controls = true")),
        &["smooth_controls", "angular accelerations are derived"],
    );
    assert_says(&refusal(read_one(&bare.csv(), "smooth_controls = 1")), &["`smooth_controls`", "true or false"]);
    Ok(())
}

#[test]
fn the_two_descriptions_of_the_crazyflie_read_the_same_columns_in_the_same_way() -> Outcome {
    let fixture = |name: &str| -> Result<toml::Table, Box<dyn std::error::Error>> {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/crazyflie").join(name);
        Ok(std::fs::read_to_string(path)?.parse()?)
    };
    let (whole, mut samples) = (fixture("dataset.toml")?, fixture("samples.toml")?);
    assert!(samples.remove("cutoff_hz").is_some() && samples.remove("smooth_controls").is_some());
    // What bridges rows that were repeated comes on top.
    let repairs = samples.get_mut("repair").and_then(|repairs| repairs.as_array_mut()).ok_or("no repair")?;
    repairs.retain(|rule| rule.get("held").is_none());
    assert_eq!(samples, whole);
    Ok(())
}

#[test]
fn a_quaternion_may_stand_in_place_of_the_angles() -> Outcome {
    let sheet = Sheet::canonical(120);
    let parts: Vec<[f64; 4]> =
        (0..120).map(|row| triple(&sheet, ANGLES, row)).map(|[r, p, y]| euler_to_quaternion(r, p, y)).collect();
    let mut other = sheet.clone().without_all(&ANGLES);
    for (axis, name) in ["q1", "q2", "q3", "q4"].iter().enumerate() {
        other = other.with(name, parts.iter().map(|part| part[axis]).collect());
    }
    assert_same(only(&read_one(&other.csv(), "")?), &sheet, CLOSE);
    assert_says(
        &refusal(read_one(&other.clone().cell("q4", 5, 0.5).csv(), "")),
        &["line 7", "a quaternion of norm", "unit quaternion"],
    );
    assert_says(&refusal(read_one(&other.without("q3").csv(), "")), &["column `q3`", "scalar last"]);
    Ok(())
}

#[test]
fn other_axes_and_frames_come_to_the_same_flight() -> Outcome {
    let sheet = Sheet::canonical(150);
    for (name, axes) in Axes::NAMES {
        for frame in ["body", "inertial"] {
            // Each change of axes is its own inverse, and so is that of the angles.
            let inertial = frame == "inertial";
            let other = sheet
                .clone()
                .map_triple(
                    V,
                    |row, v| if inertial { axes.inertial_to_ned(to_inertial(&sheet, row, v)) } else { axes.body_to_frd(v) },
                )
                .map_triple(["x", "y", "z"], |_, p| axes.inertial_to_ned(p))
                .map_triple(ANGLES, |_, [roll, pitch, yaw]| match axes {
                    Axes::NedFrd => [roll, pitch, yaw],
                    Axes::EnuFlu => [roll, -pitch, FRAC_PI_2 - yaw],
                    Axes::NwuFlu => [roll, -pitch, -yaw],
                })
                .map_triple(W, |_, w| axes.body_to_frd(w))
                .map_triple(V_DOT, |_, a| axes.body_to_frd(a))
                .map_triple(W_DOT, |_, a| axes.body_to_frd(a));
            let data = read_one(&other.csv(), &format!("axes = \"{name}\"\nvelocity = \"{frame}\""))?;
            assert_same(only(&data), &sheet, CLOSE);
        }
    }
    Ok(())
}

#[test]
fn other_accelerations_come_to_the_derivative_of_the_body_components() -> Outcome {
    let sheet = Sheet::canonical(150);
    let body = |row: usize, v_dot: [f64; 3]| add(v_dot, transport(&sheet, row), 1.0);
    let force =
        |row: usize, v_dot: [f64; 3]| add(body(row, v_dot), gravity_body(sheet.get("roll")[row], sheet.get("pitch")[row]), -1.0);
    let inertial = |row: usize, _: [f64; 3]| inertial_acceleration(sheet.get("t")[row]);
    for (kind, other) in [
        ("specific_force", sheet.clone().map_triple(V_DOT, force)),
        ("body_acceleration", sheet.clone().map_triple(V_DOT, body)),
        ("inertial", sheet.clone().map_triple(V_DOT, inertial)),
    ] {
        let data = read_one(&other.csv(), &format!("targets = \"{kind}\""))?;
        // The sheet's own second derivatives are differences of differences.
        assert_same(only(&data), &sheet, Tolerance::Approximate.relative_f64());
    }
    Ok(())
}

#[test]
fn units_are_converted() -> Outcome {
    let sheet = Sheet::canonical(100);
    let degrees = |angle: f64| angle * 180.0 / PI;
    let mut other = sheet.clone().map("t", |t| t * 1e3).map("z", |z| z / 0.3048).map("vz_dot", |a| a / 9.80665);
    for name in ANGLES.into_iter().chain(W).chain(W_DOT) {
        other = other.map(name, degrees);
    }
    let description = r#"
        [units]
        time = "ms"
        z = "ft"
        angles = "deg"
        rates = "deg/s"
        angular_acceleration = "deg/s^2"
        vz_dot = "g"
    "#;
    let data = read_one(&other.csv(), description)?;
    assert_same(only(&data), &sheet, CLOSE);
    assert!((only(&data).step_s - STEP_S).abs() <= CLOSE);
    Ok(())
}

#[test]
fn columns_by_another_name_a_formula_or_the_first_that_is_there() -> Outcome {
    let sheet = Sheet::canonical(80);
    let other = sheet
        .clone()
        .rename("vx", "v nose")
        .without("u4")
        .with("m1", sheet.get("u4").iter().map(|u| (u * 0.5e10).sqrt()).collect())
        .with("m2", sheet.get("u4").iter().map(|u| (u * 0.5e10).sqrt()).collect());
    let description = r#"
        [columns]
        vx = ["v_nose", "v nose"]
        u4 = "1e-10 * (m1^2 + m2^2)"
    "#;
    let data = read_one(&other.csv(), description)?;
    assert_same(only(&data), &sheet, CLOSE);
    assert_eq!(only(&data).extra.keys().collect::<Vec<_>>(), ["m1", "m2"]);

    let unknown = read_one(&other.csv(), &description.replace("m2^2", "m3^2"));
    assert_says(&refusal(unknown), &["column `u4`", "unknown name `m3`"]);
    let slip = read_one(&other.csv(), "[columns]\nvx = \"v noze\"\nu4 = \"m1\"");
    assert_says(&refusal(slip), &["line 1, column `vx`", "no column `v noze`", "did you mean `v nose`?"]);
    Ok(())
}

#[test]
fn a_row_filter_keeps_pieces_and_says_what_it_kept() -> Outcome {
    let sheet = Sheet::canonical(700);
    // Height is 10 + 2 sin(0.9 t): above 11 twice in 7 s, the second time only shortly.
    let data = read_one(&sheet.csv(), "use = [\"height > 11\", \"airspeed > 0\"]\nminimum_length_s = 0.1")?;
    let flight = only(&data);
    assert_eq!(flight.name, "hover/a");
    assert!(flight.column(Column::Z).iter().all(|&z| z < -11.0));
    assert_says(&data.notes.join("\n"), &["`hover/a`: `use` keeps", "of 700 samples"]);

    let two = read_one(&sheet.csv(), "use = \"abs(height - 10) > 1\"\nminimum_length_s = 0.5")?;
    assert_eq!(two.flights.iter().map(|flight| flight.name.as_str()).collect::<Vec<_>>(), ["hover/a[1]", "hover/a[2]"]);
    let whole = two.flights.iter().map(phyture::flight::Flight::len).sum::<usize>();
    assert_eq!(whole, sheet.get("z").iter().filter(|z| (-**z - 10.0).abs() > 1.0).count());

    assert_says(&refusal(read_one(&sheet.csv(), "use = \"heigth > 11\"")), &["unknown name `heigth`", "did you mean `height`?"]);
    assert_says(&refusal(read_one(&sheet.csv(), "use = \"height > 99\"")), &["no piece is left", "keeps 0 of 700"]);
    Ok(())
}

#[test]
fn cells_are_repaired_only_by_a_stated_rule_and_counted() -> Outcome {
    let bad = Sheet::canonical(100).with("m1", (0..100).map(f64::from).collect()).cell("m1", 10, f64::NAN).cell("m1", 11, 1e6);
    assert_says(&refusal(read_one(&bad.csv(), "")), &["line 12, column `m1`", "[[repair]]"]);
    let rule = "[[repair]]\ncolumns = [\"m1\"]\nvalid = \"value < 1000\"\nmax_gap_s = ";
    let data = read_one(&bad.csv(), &format!("{rule}0.05"))?;
    assert_eq!(only(&data).named("m1").map(|values| values[9..13].to_vec()), Some(vec![9.0, 10.0, 11.0, 12.0]));
    assert_says(&data.notes.join("\n"), &["`hover/a`: bad cells interpolated linearly, longest run 0.020 s: 2 of `m1`"]);
    // A run that is too long stays bad: refused where it is in use, harmless where the filter leaves it out.
    assert_says(&refusal(read_one(&bad.csv(), &format!("{rule}0.01"))), &["line 12, column `m1`", "`use` keeps"]);
    let cut = read_one(&bad.csv(), &format!("use = \"m1 >= 20\"\n{rule}0.01"))?;
    assert_eq!(only(&cut).len(), 80);
    Ok(())
}

#[test]
fn rows_near_bridged_cells_are_set_aside_as_asked_also_where_streams_move_and_rates_change() -> Outcome {
    let bad = Sheet::canonical(400).with("m1", (0..400).map(f64::from).collect()).cell("m1", 60, f64::NAN).cell("m1", 61, f64::NAN);
    let rule = "[[repair]]\ncolumns = [\"m1\"]\nmax_gap_s = 0.05";
    let aside = |data: &DataSet| only(data).set_aside.iter().map(|rows| (rows.start, rows.end)).collect::<Vec<_>>();
    assert_eq!(aside(&read_one(&bad.csv(), rule)?), []);
    let data = read_one(&bad.csv(), &format!("{rule}\nset_aside_s = 0.02"))?;
    assert_eq!(aside(&data), [(58, 64)]);
    assert_says(&data.notes.join("\n"), &["`hover/a`: 6 of 400 samples are set aside as near bridged cells"]);
    assert_eq!(aside(&read_one(&bad.csv(), &format!("{rule}\nset_aside_s = 0"))?), [(60, 62)]);
    // Controls come three rows late: sample 57 has those of row 60. The last three have none, and are left out.
    let late = read_one(&bad.csv(), &format!("{rule}\nset_aside_s = 0\n[late]\ncontrols = 0.03"))?;
    assert_eq!((aside(&late), only(&late).len()), (vec![(57, 62)], 397));
    // Of pieces that `use` keeps, from their own first samples; at half the rate by time.
    let pieces = read_one(&bad.csv(), &format!("use = \"m1 >= 61\"\n{rule}\nset_aside_s = 0.02"))?;
    assert_eq!(aside(&pieces), [(0, 3)]);
    let slow = read_one(&bad.csv(), &format!("resample_hz = 50\n{rule}\nset_aside_s = 0"))?;
    assert_eq!(aside(&slow), [(30, 32)]);
    assert_eq!(aside(&read_one(&bad.csv(), &format!("{rule}\nset_aside_s = 1e300"))?), [(0, 400)]);
    assert_says(&refusal(read_one(&bad.csv(), &format!("{rule}\nset_aside_s = -1"))), &["set_aside_s", "-1"]);
    Ok(())
}

#[test]
fn position_and_heading_may_be_missing_if_the_description_says_so() -> Outcome {
    let sheet = Sheet::canonical(300);
    let other = sheet.clone().without_all(&["x", "y", "z", "yaw"]);
    let data = read_one(&other.csv(), "missing = [\"x\", \"y\", \"z\", \"yaw\"]")?;
    let flight = only(&data);
    assert_eq!(flight.absent, [Column::X, Column::Y, Column::Z, Column::Yaw]);
    assert_says(&data.notes.join("\n"), &["`z` is not in the logs and is zero", "the integral of the Euler yaw rate from zero"]);
    let from_zero: Vec<f64> = sheet.get("yaw").iter().map(|yaw| yaw - sheet.get("yaw")[0]).collect();
    // Trapezoids of 0.01 s on waves of about 1 rad/s: h²/12 times their second derivative.
    assert!(difference(flight.column(Column::Yaw), &from_zero) < 1e-4);
    let inertial = read_one(&other.csv(), "missing = [\"x\", \"y\", \"z\", \"yaw\"]\nvelocity = \"inertial\"");
    assert_says(&refusal(inertial), &["velocity", "a heading"]);
    Ok(())
}

#[test]
fn another_rate_and_jittering_stamps_are_resampled() -> Outcome {
    let sheet = Sheet::canonical(400);
    let stamps: Vec<f64> = (0..400).map(|row| STEP_S * f64::from(row) * 1.25 + 0.002 * f64::from(row).sin()).collect();
    // Samples of the same waves on the slower, jittering clock: stretch time instead of the waves.
    let stretched = sheet.clone().with("t", stamps.clone());
    assert_says(&refusal(read_one(&stretched.csv(), "")), &["column `t`", "one constant step within 1 %"]);
    let data = read_one(&stretched.csv(), "resample_hz = 100")?;
    let flight = only(&data);
    assert_eq!((flight.step_s.to_bits(), flight.len()), (0.01_f64.to_bits(), (stamps[399] / 0.01) as usize + 1));
    assert_says(&data.notes.join("\n"), &["resampled from 80.00 Hz to 100 Hz"]);
    for sample in 0..flight.len() {
        // The value recorded next to this time, corrected to first order.
        let at = stamps.partition_point(|&stamp| stamp <= flight.time_s(sample)).clamp(1, 399);
        let part = (flight.time_s(sample) - stamps[at - 1]) / (stamps[at] - stamps[at - 1]);
        for name in ["vx", "roll", "yaw"] {
            let (before, after) = (sheet.get(name)[at - 1], sheet.get(name)[at]);
            let found = flight.named(name).map(|values| values[sample]);
            // Linear interpolation itself is within h²/8 times the second derivative, some 1e-3 here.
            assert!(found.is_some_and(|value| (value - before - part * (after - before)).abs() < 2e-3), "{name} at {sample}");
        }
    }
    Ok(())
}

#[test]
fn the_folder_gives_names_and_classes() -> Outcome {
    let folder = tempfile::tempdir()?;
    let (csv, root) = (Sheet::canonical(50).csv(), folder.path());
    let other = |samples: usize| Sheet::canonical(samples).csv();
    let names = |path: &std::path::Path, options: &ReadOptions| -> phyture::Result<Vec<String>> {
        Ok(data_set(path, options)?.flights.iter().map(|flight| format!("{}: {}", flight.manoeuvre, flight.name)).collect())
    };
    put(root, "turn/b.csv", &csv)?;
    put(root, "hover/a10.csv", &other(51))?;
    put(root, "hover/a9.csv", &other(52))?;
    put(root, "hover/notes.txt", "windy")?;
    let plain = ReadOptions::default();
    assert_eq!(names(root, &plain)?, ["hover: hover/a9", "hover: hover/a10", "turn: turn/b"]);
    assert_says(&data_set(root, &plain)?.notes.join("\n"), &["1 file that is no log was not read: hover/notes.txt"]);
    assert_eq!(names(&root.join("hover"), &plain)?, ["hover: a9", "hover: a10"]);
    assert_eq!(names(&root.join("turn/b.csv"), &plain)?, ["turn: b"]);

    put(root, "turn/a9.csv", &other(53))?;
    assert_eq!(names(root, &plain)?, ["hover: hover/a9", "hover: hover/a10", "turn: turn/b", "turn: turn/a9"]);
    put(root, "turn/a9.CSV", &csv)?;
    assert_says(&refusal(data_set(root, &plain)), &["two flights named `turn/a9`", "a9.CSV", "a9.csv", "rename one"]);
    std::fs::remove_file(root.join("turn/a9.CSV"))?;
    put(root, "dataset.toml", "exclude = [\"turn\"]\nmanoeuvre = { separator = \"9\", part = 1 }")?;
    let data = data_set(root, &plain)?;
    assert_eq!(data.flights.iter().map(|flight| flight.manoeuvre.as_str()).collect::<Vec<_>>(), ["a", "a10"]);
    assert_says(&data.notes.join("\n"), &["left out, as dataset.toml says: `turn`"]);

    put(root, "dataset.toml", "leave_out = [\"b\", \"hover/a9\"]")?;
    let data = data_set(root, &plain)?;
    assert_eq!(data.flights.iter().map(|flight| flight.name.as_str()).collect::<Vec<_>>(), ["hover/a10", "turn/a9"]);
    assert_says(&data.notes.join("\n"), &["left out, as dataset.toml says: hover/a9, turn/b"]);
    // A part of the set need not hold them all.
    let part = data_set(&root.join("hover"), &plain)?;
    assert_eq!(part.flights.iter().map(|flight| flight.name.as_str()).collect::<Vec<_>>(), ["a10"]);
    assert_says(&part.notes.join("\n"), &["left out, as dataset.toml says: a9", "not among these flights: b"]);
    for (wrong, meant) in [("hovr/a10", "hover/a10"), ("a19", "a10")] {
        put(root, "dataset.toml", &format!("leave_out = [\"{wrong}\"]"))?;
        let says = ["dataset.toml: `leave_out` is", "no flight of this data set", "one of the flights `hover/a10`, `hover/a9`"];
        let refused = refusal(data_set(root, &plain));
        assert_says(&refused, &says);
        assert_says(&refused, &[&format!("did you mean `{meant}`?")]);
    }
    put(root, "dataset.toml", "leave_out = [\"a9\"]")?;
    assert_says(
        &refusal(data_set(root, &plain)),
        &["dataset.toml: `leave_out` is `a9`, which 2 flights are called", "a flight's path"],
    );

    // A description elsewhere is taken instead, and its faults name it.
    put(root, "other.toml", "exclud = \"turn\"")?;
    let options = ReadOptions { dataset: Some(root.join("other.toml")), ..ReadOptions::default() };
    assert_says(&refusal(data_set(root, &options)), &["other.toml", "`exclud` is an unknown key", "did you mean `exclude`?"]);

    put(root, "loose.csv", &other(54))?;
    assert_says(&refusal(data_set(root, &plain)), &["logs beside folders of logs: loose.csv"]);
    assert_says(
        &refusal(data_set(&root.join("hover/notes.txt"), &plain)),
        &["a file of the kind `.txt`", "a .csv, .parquet, .ulg or .bin file"],
    );
    assert_says(&refusal(data_set(&root.join("nowhere"), &plain)), &["nowhere"]);
    std::fs::create_dir(root.join("empty"))?;
    assert_says(&refusal(data_set(&root.join("empty"), &plain)), &["no logs", "DATA/<manoeuvre>/<flight>.csv"]);
    Ok(())
}

#[test]
fn what_is_left_out_may_be_unreadable() -> Outcome {
    let folder = tempfile::tempdir()?;
    let root = folder.path();
    put(root, "a.csv", &Sheet::canonical(50).csv())?;
    put(root, "b.csv", "t,roll\nnonsense,0")?;
    assert_says(&refusal(data_set(root, &ReadOptions::default())), &["b.csv"]);
    put(root, "dataset.toml", "leave_out = [\"b\"]")?;
    let data = data_set(root, &ReadOptions::default())?;
    assert_eq!(data.flights.iter().map(|flight| flight.name.as_str()).collect::<Vec<_>>(), ["a"]);
    assert_says(&data.notes.join("\n"), &["left out, as dataset.toml says: b; it cannot be read:"]);
    Ok(())
}

#[test]
fn a_stream_that_comes_late_is_moved_back() -> Outcome {
    let folder = tempfile::tempdir()?;
    let root = folder.path();
    put(root, "a.csv", &Sheet::canonical(60).csv())?;
    let plain = data_set(root, &ReadOptions::default())?;
    let step_s = plain.flights[0].step_s;
    put(root, "dataset.toml", &format!("[late]\nrates = {}\nu1 = {}", 3.0 * step_s, -2.0 * step_s))?;
    let moved = data_set(root, &ReadOptions::default())?;
    let (before, after) = (&plain.flights[0], &moved.flights[0]);
    // Of the first two rows no u1 is known, of the last three no rates.
    assert_eq!((after.len(), after.start_s), (55, before.time_s(2)));
    assert_eq!(after.column(Column::Wy)[..], before.column(Column::Wy)[5..60]);
    assert_eq!(after.column(Column::U1)[..], before.column(Column::U1)[..55]);
    assert_eq!(after.column(Column::Vx)[..], before.column(Column::Vx)[2..57]);
    assert_says(&moved.notes.join("\n"), &["moved back in time, as dataset.toml says"]);
    for (late, says) in [
        ("rates = 2.0", "a time from -1 to 1 s"),
        ("t = 0.1", "`late.t` is an unknown key"),
        ("rate = 0.1", "did you mean `rates`"),
    ] {
        put(root, "dataset.toml", &format!("[late]\n{late}"))?;
        assert_says(&refusal(data_set(root, &ReadOptions::default())), &[says]);
    }
    Ok(())
}

#[test]
fn a_log_is_cut_where_rows_are_said_to_be_lost() -> Outcome {
    let folder = tempfile::tempdir()?;
    let root = folder.path();
    put(root, "a.csv", &Sheet::canonical(60).csv())?;
    put(root, "b.csv", &Sheet::canonical(61).csv())?;
    let plain = data_set(root, &ReadOptions::default())?;
    let at = |sample: usize| plain.flights[1].time_s(sample);
    let rule = |at_s: f64| format!("[[cut]]\nflights = \"b\"\nat = [{at_s}, {}]\n", at(40));
    put(root, "dataset.toml", &rule(at(20)))?;
    let cut = data_set(root, &ReadOptions::default())?;
    let pieces: Vec<(&str, usize)> = cut.flights.iter().map(|flight| (flight.name.as_str(), flight.len())).collect();
    assert_eq!(pieces, [("a", 60), ("b[1]", 20), ("b[2]", 20), ("b[3]", 21)]);
    assert_eq!(cut.flights[2].column(Column::Wx)[..], plain.flights[1].column(Column::Wx)[20..40]);
    assert_says(&cut.notes.join("\n"), &["`b`: cut before t = ", "as dataset.toml says"]);
    put(root, "dataset.toml", &rule(1e3))?;
    assert_says(&refusal(data_set(root, &ReadOptions::default())), &["b.csv", "a cut at t = 1000 s", "a time after"]);
    put(root, "dataset.toml", &rule(at(20)).replace("\"b\"", "\"c\""))?;
    assert_says(&refusal(data_set(root, &ReadOptions::default())), &["`cut.flights` is `c`, which is no log of this data set"]);
    Ok(())
}

#[test]
fn a_stream_that_comes_late_in_one_log_is_moved_there_alone() -> Outcome {
    let folder = tempfile::tempdir()?;
    let root = folder.path();
    put(root, "a.csv", &Sheet::canonical(60).csv())?;
    let other = Sheet::canonical(61).csv();
    put(root, "b.csv", &other)?;
    let plain = data_set(root, &ReadOptions::default())?;
    let step_s = plain.flights[0].step_s;
    let rule = |name: &str| format!("[late]\nu1 = {step_s}\n[[late_in]]\nflights = [\"{name}\"]\nu1 = {step_s}\nu2 = {step_s}\n");
    put(root, "dataset.toml", &rule("b"))?;
    let moved = data_set(root, &ReadOptions::default())?;
    let u1 = |data: &DataSet, flight: usize| data.flights[flight].column(Column::U1).to_vec();
    // One sample in all, and another one on top of it.
    assert_eq!((u1(&moved, 0), u1(&moved, 1)), (u1(&plain, 0)[1..].to_vec(), u1(&plain, 1)[2..].to_vec()));
    assert_eq!(moved.flights[1].column(Column::U2)[..], plain.flights[1].column(Column::U2)[1..60]);
    put(root, "dataset.toml", &rule("c"))?;
    assert_says(&refusal(data_set(root, &ReadOptions::default())), &["`late_in.flights` is `c`, which is no log of this data set"]);
    // A description from elsewhere may be of several sets.
    std::fs::rename(root.join("dataset.toml"), root.join("elsewhere.toml"))?;
    let shared = data_set(root, &ReadOptions { dataset: Some(root.join("elsewhere.toml")), ..ReadOptions::default() })?;
    assert_says(&shared.notes.join("\n"), &["but not among these flights: c"]);
    // A log read alone is a part of the set that the description is of.
    put(root, "dataset.toml", &rule("b"))?;
    let alone = data_set(&root.join("a.csv"), &ReadOptions::default())?;
    assert_says(&alone.notes.join("\n"), &["to be moved in time, as dataset.toml says, but not among these flights: b"]);
    Ok(())
}
