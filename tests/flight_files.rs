//! Flights to files and back: CSV, Parquet, the Stanford layout; and the two real sets, where they are at hand.
#![cfg(feature = "files")]

mod support;

use phyture::flight::attitude::{cross, euler_to_quaternion, gravity_body, rotate, rotate_back, rotation_body_to_inertial};
use phyture::flight::names::own_name;
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight, Targets, write};
use phyture_kernels::Tolerance;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use support::*;

fn flight(name: &str, manoeuvre: &str, sheet: &Sheet) -> phyture::Result<Flight> {
    let columns = Column::ALL.map(|column| sheet.get(column.name()).to_vec());
    Flight::new(name, manoeuvre, sheet.get("t")[0], STEP_S, columns, Targets::Recorded)
}

fn same_bits(a: &Flight, b: &Flight) -> bool {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    Column::ALL.into_iter().all(|column| bits(a.column(column)) == bits(b.column(column)))
        && (a.start_s.to_bits(), a.step_s.to_bits()) == (b.start_s.to_bits(), b.step_s.to_bits())
        && a.extra.keys().eq(b.extra.keys())
        && a.extra.values().zip(b.extra.values()).all(|(a, b)| bits(a) == bits(b))
}

fn finite() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn every_finite_number_survives_a_file(
        noise in prop::collection::vec(finite(), 8..40), start in 0_u32..100_000, step_ms in 1_u32..50,
    ) {
        let samples = noise.len();
        let mut columns = Column::ALL.map(|_| noise.clone());
        for angle in [Column::Roll, Column::Pitch, Column::Yaw] {
            columns[angle as usize] = noise.iter().map(|value| value.sin()).collect();
        }
        // Rates that the angles do not follow, so that nothing looks like degrees.
        columns[Column::Wx as usize] = vec![0.0; samples];
        columns[Column::Wy as usize] = vec![0.0; samples];
        let (start_s, step_s) = (f64::from(start) / 1e3, f64::from(step_ms) / 1e3);
        let mut flight = Flight::new("a", "noise", start_s, step_s, columns, Targets::Recorded)?;
        flight.extra.insert("rotor_rpm".into(), noise);
        let folder = tempfile::tempdir()?;
        write::data_set_csv(folder.path(), std::slice::from_ref(&flight))?;
        let read = data_set(folder.path(), &ReadOptions::default())?;
        prop_assert!(read.flights.len() == 1 && same_bits(&read.flights[0], &flight), "{:?} {:?}", read.flights, flight);
        #[cfg(feature = "parquet")]
        {
            std::fs::remove_file(folder.path().join("noise/a.csv"))?;
            write::parquet(&flight, &folder.path().join("noise/a.parquet"))?;
            let read = data_set(folder.path(), &ReadOptions::default())?;
            prop_assert!(same_bits(&read.flights[0], &flight));
        }
    }
}

#[test]
fn what_was_derived_or_absent_stays_so_through_files() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut derived = flight("a", "hover", &Sheet::canonical(80))?;
    (derived.targets, derived.absent) = (Targets::Derived, vec![Column::X]);
    let recorded = flight("b", "turn", &Sheet::canonical(80))?;
    write::data_set_csv(folder.path(), std::slice::from_ref(&derived))?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert_eq!((only(&data).targets, only(&data).absent.as_slice()), (Targets::Derived, [Column::X].as_slice()));
    assert_eq!(only(&data).column(Column::VxDot), derived.column(Column::VxDot));
    assert_says(&data.notes.join("\n"), &["the accelerations in the logs were derived from v and w"]);

    write::data_set_csv(folder.path(), &[derived, recorded])?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert_eq!(data.flights.iter().map(|flight| flight.targets).collect::<Vec<_>>(), [Targets::Derived, Targets::Recorded]);
    Ok(())
}

/// Changes velocity, ω, v', ω', Euler angles and the quaternion of a row.
type Bend<'a> = dyn Fn(usize, &mut [[f64; 3]; 5], &mut [f64; 4]) + 'a;

/// A flight in the Stanford layout under one of the hypotheses, with so many seconds of standing at its start.
fn stanford(folder: &Path, name: &str, sheet: &Sheet, idle_s: f64, bend: &Bend) -> Outcome {
    let (mut smoother, mut controls) = (String::new(), String::new());
    let idle = (idle_s / STEP_S).round() as usize;
    let samples = sheet.get("t").len();
    for line in 0..idle + samples {
        let row = line.saturating_sub(idle);
        let of = |names: [&str; 3]| names.map(|name| sheet.get(name)[row]);
        let euler @ [roll, pitch, yaw] = of(["roll", "pitch", "yaw"]);
        let matrix = rotation_body_to_inertial(roll, pitch, yaw);
        let (v, w) = (of(["vx", "vy", "vz"]), of(["wx", "wy", "wz"]));
        let (v_dot, around) = (of(["vx_dot", "vy_dot", "vz_dot"]), cross(w, v));
        let acceleration = rotate(&matrix, std::array::from_fn(|axis| v_dot[axis] + around[axis]));
        let mut quaternion = euler_to_quaternion(roll, pitch, yaw);
        let mut parts = [rotate(&matrix, v), w, acceleration, of(["wx_dot", "wy_dot", "wz_dot"]), euler];
        bend(row, &mut parts, &mut quaternion);
        if line < idle {
            parts[..4].fill([0.0; 3]);
        }
        let [velocity, w, v_dot, w_dot, euler] = parts;
        let time = 1_217_980_000.0 + STEP_S * line as f64;
        let values =
            of(["x", "y", "z"]).into_iter().chain(quaternion).chain(velocity).chain(w).chain(v_dot).chain(w_dot).chain(euler);
        smoother += &format!("{line} {time:?} {}\n", values.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(" "));
        // Controls come at half the rate, as percent.
        if line % 2 == 0 {
            let u = ["u1", "u2", "u3", "u4"].map(|name| format!("{:?}", 100.0 * sheet.get(name)[row]));
            controls += &format!("{line} {time:?} {}\n", u.join(" "));
        }
    }
    put(folder, &format!("{name}/smoother.txt"), &smoother)?;
    put(folder, &format!("{name}/controls.txt"), &controls)?;
    Ok(())
}

const KINEMATIC: [Column; 18] = {
    let mut columns = [Column::X; 18];
    let mut at = 0;
    while at < 18 {
        columns[at] = Column::ALL[if at < 12 { at } else { at + 4 }];
        at += 1;
    }
    columns
};

#[test]
fn the_stanford_layout_is_read_under_each_hypothesis() -> Outcome {
    let sheet = Sheet::canonical(600);
    let turn = |row: usize| rotation_body_to_inertial(sheet.get("roll")[row], sheet.get("pitch")[row], sheet.get("yaw")[row]);
    let cases: [(&str, Box<Bend>); 5] = [
        ("the quaternion turns body to NED, w in body axes", Box::new(|_, _, _| {})),
        (
            "the quaternion turns body to NED, w in NED",
            Box::new(|row, parts, _| (parts[1], parts[3]) = (rotate(&turn(row), parts[1]), rotate(&turn(row), parts[3]))),
        ),
        ("the quaternion turns NED to body, w in body axes", Box::new(|_, _, q| q[3] = -q[3])),
        (
            "v' is that without gravity, in body axes",
            Box::new(|row, parts, _| {
                let gravity = gravity_body(sheet.get("roll")[row], sheet.get("pitch")[row]);
                let body = rotate_back(&turn(row), parts[2]);
                parts[2] = std::array::from_fn(|axis| body[axis] - gravity[axis]);
            }),
        ),
        ("Euler angles of body to NED in degrees", Box::new(|_, parts, _| parts[4] = parts[4].map(f64::to_degrees))),
    ];
    for (expected, bend) in cases {
        let folder = tempfile::tempdir()?;
        stanford(folder.path(), "turn_demos1", &sheet, 0.0, &*bend)?;
        let data = data_set(folder.path(), &ReadOptions::default())?;
        assert_says(&data.notes.join("\n"), &[expected, "controls: percent"]);
        let flight = only(&data);
        assert_eq!((flight.manoeuvre.as_str(), flight.targets), ("turn_demos1", Targets::Recorded));
        for column in KINEMATIC {
            let error = difference(flight.column(column), sheet.get(column.name()));
            assert!(error <= Tolerance::Close.relative_f64(), "{expected}: {} by {error:e}", column.name());
        }
        // Held from each stamp to the next.
        let held: Vec<f64> = (0..600).map(|row| sheet.get("u4")[row / 2 * 2]).collect();
        assert!(difference(flight.column(Column::U4), &held) <= Tolerance::Close.relative_f64());
    }
    Ok(())
}

#[test]
fn what_fits_no_hypothesis_is_refused_with_all_errors_and_short_rows_with_their_line() -> Outcome {
    let folder = tempfile::tempdir()?;
    let sheet = Sheet::canonical(300);
    stanford(folder.path(), "chaos_01", &sheet, 0.0, &|_, parts, _| parts[1] = [parts[1][2], -parts[1][0], 3.0])?;
    let message = refusal(data_set(folder.path(), &ReadOptions::default()));
    assert_says(
        &message,
        &["smoother.txt: found a log that fits none", "w in body axes: ", "turns NED to body, w in NED: ", "at most 0.5"],
    );

    stanford(folder.path(), "chaos_01", &sheet, 0.0, &|_, _, _| {})?;
    let path = folder.path().join("chaos_01/controls.txt");
    let text = std::fs::read_to_string(&path)?;
    std::fs::write(&path, text + "300 1217980003.0 1 2 3\n")?;
    let message = refusal(data_set(folder.path(), &ReadOptions::default()));
    assert_says(&message, &["controls.txt, line 151, column `collective`: found 5 cells in the row, expected 6"]);
    Ok(())
}

#[test]
fn standing_on_the_ground_is_left_out_and_said() -> Outcome {
    let folder = tempfile::tempdir()?;
    stanford(folder.path(), "hover_02", &Sheet::canonical(400), 12.0, &|_, _, _| {})?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert_eq!((only(&data).len(), only(&data).manoeuvre.as_str()), (400, "hover"));
    assert_says(&data.notes.join("\n"), &["`hover_02`: 12.00 s motionless on the ground at the start are left out"]);
    Ok(())
}

#[test]
fn of_a_description_the_stanford_layout_obeys_what_it_can_and_says_what_it_cannot() -> Outcome {
    let folder = tempfile::tempdir()?;
    stanford(folder.path(), "hover_02", &Sheet::canonical(400), 0.0, &|_, _, _| {})?;
    put(
        folder.path(),
        "dataset.toml",
        "resample_hz = 50\nuse = \"vx > -1e9\"\naxes = \"ENU/FLU\"\n[units]\nvelocity = \"ft/s\"\n",
    )?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    let flight = only(&data);
    assert_eq!([flight.step_s, flight.start_s].map(f64::to_bits), [0.02, 1_217_980_000.0].map(f64::to_bits));
    assert_says(
        &data.notes.join("\n"),
        &[
            "resampled from 100.00 Hz to 50 Hz",
            "`use` keeps 200 of 200 samples",
            "`axes`, `units` of dataset.toml do not hold for a flight in the Stanford layout",
        ],
    );
    Ok(())
}

#[test]
fn what_is_written_in_the_stanford_layout_is_read_again() -> Outcome {
    let folder = tempfile::tempdir()?;
    let [chaos, loops] = [Sheet::canonical(300), Sheet::canonical(400)];
    write::stanford(folder.path(), &[flight("loops_1", "loops", &loops)?, flight("chaos_1", "chaos", &chaos)?])?;
    let data = data_set(folder.path(), &ReadOptions::default())?;
    assert_eq!(data.manoeuvres(), ["chaos", "loops"]);
    for (flight, sheet) in data.flights.iter().zip([chaos, loops]) {
        assert_same(flight, &sheet, Tolerance::Close.relative_f64());
    }
    Ok(())
}

/// A real set described by ours, if it is at hand.
fn real(set: &str, inside: &str) -> Option<phyture::Result<DataSet>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder: PathBuf = root.join("../shared/data").join(set).join(inside);
    if !folder.is_dir() {
        eprintln!("skipped: no {set} flights at hand");
        return None;
    }
    let options = ReadOptions { dataset: Some(root.join("fixtures").join(set).join("dataset.toml")), ..ReadOptions::default() };
    Some(data_set(&folder, &options))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a.iter().copied()), mean(b.iter().copied()));
    let sum = |x: &[f64], mx: f64, y: &[f64], my: f64| x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    sum(a, mean_a, b, mean_b) / (sum(a, mean_a, a, mean_a) * sum(b, mean_b, b, mean_b)).sqrt()
}

/// Mean force along body down without gravity, v̇ + ω × v − R_in^b g, m/s²: about −g₀ in flight.
fn lift(flight: &Flight) -> f64 {
    let row = |row: usize| {
        let at = |column: Column| flight.column(column)[row];
        let transport = at(Column::Wx) * at(Column::Vy) - at(Column::Wy) * at(Column::Vx);
        at(Column::VzDot) + transport - gravity_body(at(Column::Roll), at(Column::Pitch))[2]
    };
    mean((0..flight.len()).map(row))
}

#[test]
fn the_quadrotor_set_is_read_and_flies() -> Outcome {
    let Some(data) = real("crazyflie", "") else { return Ok(()) };
    let data = data?;
    assert!(["multisine", "random1", "random2", "square"].iter().all(|class| data.manoeuvres().contains(class)));
    assert_says(
        &data.notes.join("\n"),
        &["bad cells interpolated linearly", "`use` keeps", "left out, as dataset.toml says: `parquet`"],
    );
    for flight in &data.flights {
        assert_eq!(flight.targets, Targets::Derived);
        // Thrust from the rotors' speed by mass is 9.9 to 10.7 m/s²; tilt and manoeuvres need a little more than g.
        let lift = lift(flight);
        assert!(lift < -9.5 && lift > -11.0, "{} hangs on {lift}", flight.name);
        for (control, target, sign) in [
            (Column::U1, Column::WxDot, 1.0),
            (Column::U2, Column::WyDot, 1.0),
            (Column::U3, Column::WzDot, 1.0),
            (Column::U4, Column::VzDot, -1.0),
        ] {
            let found = sign * correlation(flight.column(control), flight.column(target));
            // Closed loops hide much of it; its sign they do not turn.
            assert!(found > 0.0, "{}: {} on {}: {found}", flight.name, control.name(), target.name());
        }
    }
    Ok(())
}

#[cfg(feature = "parquet")]
#[test]
fn the_same_flights_as_parquet_are_the_same() -> Outcome {
    let (Some(csv), Some(parquet)) = (real("crazyflie", ""), real("crazyflie", "parquet")) else { return Ok(()) };
    let (csv, parquet) = (csv?, parquet?);
    for flight in &parquet.flights {
        let Some(other) = csv.flights.iter().find(|other| own_name(&other.name) == flight.name) else {
            panic!("{} is only one", flight.name)
        };
        assert_eq!((other.len(), &other.manoeuvre), (flight.len(), &flight.manoeuvre));
        for column in &Column::ALL[..16] {
            // The CSV is printed with seven digits.
            let error = difference(flight.column(*column), other.column(*column));
            assert!(error <= 10.0 * Tolerance::Approximate.relative_f64(), "{}: {} by {error:e}", flight.name, column.name());
        }
    }
    Ok(())
}

#[test]
fn the_helicopter_flight_is_read_and_flies() -> Outcome {
    let Some(data) = real("trex550", "") else { return Ok(()) };
    let data = data?;
    let flight = only(&data);
    assert_eq!(
        (flight.step_s.to_bits(), flight.absent.as_slice()),
        (0.01_f64.to_bits(), [Column::X, Column::Y, Column::Z].as_slice())
    );
    assert_says(
        &data.notes.join("\n"),
        &["resampled from 123.46 Hz to 100 Hz", "heading is not measured", "`z` is not in the logs"],
    );
    let lift = lift(flight);
    assert!((lift + phyture::flight::GRAVITY_M_S2).abs() < 0.1, "it hangs on {lift}");
    Ok(())
}
