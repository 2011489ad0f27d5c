//! `init` on ten kinds of logs: what it writes reads them as they were meant, without a hand.
//!
//! Simulated flights are written in other names, units, axes and orders, and read back as `init` says; the recorded ones are compared with the
//! descriptions that were written for them by hand.
#![cfg(all(feature = "files", feature = "sim"))]

mod support;

use phyture::critique::init::{Initial, init};
use phyture::flight::attitude::{Axes, euler_to_quaternion, gravity_body, rotate, rotation_body_to_inertial};
use phyture::flight::read::{ReadOptions, data_set};
use phyture::flight::{Column, DataSet, Flight};
use phyture::sim::{Level, Simulation, simulate};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use support::Outcome;

/// A column of a log by its name: the value at a sample of a flight.
type Written = Vec<(&'static str, Box<dyn Fn(&Flight, usize) -> f64>)>;

const DEGREES: f64 = 180.0 / std::f64::consts::PI;
const FEET: f64 = 1.0 / 0.3048;

fn flights(seed: u64) -> phyture::Result<DataSet> {
    simulate(&Simulation { minutes: 4.0, seed, level: Level::ONE, ..Simulation::default() })
}

fn at(flight: &Flight, row: usize, columns: [Column; 3]) -> [f64; 3] {
    columns.map(|column| flight.column(column)[row])
}

const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];
const ANGLES: [Column; 3] = [Column::Roll, Column::Pitch, Column::Yaw];
const VELOCITY: [Column; 3] = [Column::Vx, Column::Vy, Column::Vz];
const RATES: [Column; 3] = [Column::Wx, Column::Wy, Column::Wz];
const LINEAR: [Column; 3] = [Column::VxDot, Column::VyDot, Column::VzDot];
const ANGULAR: [Column; 3] = [Column::WxDot, Column::WyDot, Column::WzDot];

fn over_ground(flight: &Flight, row: usize) -> [f64; 3] {
    let [roll, pitch, yaw] = at(flight, row, ANGLES);
    rotate(&rotation_body_to_inertial(roll, pitch, yaw), at(flight, row, VELOCITY))
}

fn time(name: &'static str, factor: f64) -> Written {
    vec![(name, Box::new(move |flight, row| (flight.start_s + flight.step_s * row as f64) * factor))]
}

fn triple(names: [&'static str; 3], of: impl Fn(&Flight, usize) -> [f64; 3] + Copy + 'static) -> Written {
    (0..3).map(|axis| (names[axis], Box::new(move |flight: &Flight, row| of(flight, row)[axis]) as Box<_>)).collect()
}

fn scaled(names: [&'static str; 3], columns: [Column; 3], factor: f64) -> Written {
    triple(names, move |flight, row| at(flight, row, columns).map(|value| value * factor))
}

fn controls(names: [&'static str; 4], columns: [Column; 4]) -> Written {
    let one =
        |(name, column): (&'static str, Column)| (name, Box::new(move |f: &Flight, row: usize| f.column(column)[row]) as Box<_>);
    names.into_iter().zip(columns).map(one).collect()
}

const STICKS: [Column; 4] = [Column::U1, Column::U2, Column::U3, Column::U4];
const OWN: [&str; 4] = ["u1", "u2", "u3", "u4"];

fn canonical(name: &'static str, columns: [Column; 3]) -> Written {
    assert!(!name.is_empty());
    scaled(columns.map(Column::name), columns, 1.0)
}

/// Flights as they were simulated, in other words.
fn renamed() -> Written {
    let mut log = controls(["collective", "rudder", "elevator", "aileron"], [Column::U4, Column::U3, Column::U2, Column::U1]);
    log.extend(scaled(["p", "q", "r"], RATES, 1.0));
    log.extend(scaled(["theta", "psi", "phi"], [Column::Pitch, Column::Yaw, Column::Roll], 1.0));
    log.extend(scaled(["w", "u", "v"], [Column::Vz, Column::Vx, Column::Vy], 1.0));
    log.extend(scaled(["pos_x", "pos_y", "pos_z"], POSITION, 1.0));
    log.extend(time("time", 1.0));
    log
}

fn feet_and_degrees() -> Written {
    let mut log = time("t", 1e3);
    log.extend(scaled(["x", "y", "z"], POSITION, FEET));
    log.extend(scaled(["roll", "pitch", "yaw"], ANGLES, DEGREES));
    log.extend(scaled(["vx", "vy", "vz"], VELOCITY, FEET));
    log.extend(scaled(["wx", "wy", "wz"], RATES, DEGREES));
    log.extend(controls(OWN, STICKS));
    log
}

/// With an accelerometer in thousandths of g, and time in µs.
fn accelerometer() -> Written {
    let mut log = time("time_us", 1e6);
    log.extend(canonical("position", POSITION));
    log.extend(canonical("angles", ANGLES));
    log.extend(canonical("velocity", VELOCITY));
    log.extend(scaled(["gyro_x", "gyro_y", "gyro_z"], RATES, 1.0));
    log.extend(triple(["ax", "ay", "az"], |flight, row| {
        let ([roll, pitch, _], v, w) = (at(flight, row, ANGLES), at(flight, row, VELOCITY), at(flight, row, RATES));
        let (rate, gravity) = (at(flight, row, LINEAR), gravity_body(roll, pitch));
        let transport = [w[1] * v[2] - w[2] * v[1], w[2] * v[0] - w[0] * v[2], w[0] * v[1] - w[1] * v[0]];
        std::array::from_fn(|axis| (rate[axis] + transport[axis] - gravity[axis]) / 9.806_65e-3)
    }));
    log.extend(controls(OWN, STICKS));
    log
}

/// East, north, up; forward, left, up.
fn east_north_up() -> Written {
    let mut log = time("t", 1.0);
    log.extend(triple(["east", "north", "up"], |flight, row| {
        let [x, y, z] = at(flight, row, POSITION);
        [y, x, -z]
    }));
    log.extend(triple(["v_east", "v_north", "v_up"], |flight, row| {
        let [x, y, z] = over_ground(flight, row);
        [y, x, -z]
    }));
    log.extend(triple(["roll", "pitch", "yaw"], |flight, row| {
        let [roll, pitch, yaw] = at(flight, row, ANGLES);
        [roll, -pitch, std::f64::consts::FRAC_PI_2 - yaw]
    }));
    log.extend(triple(["wx", "wy", "wz"], |flight, row| {
        let [p, q, r] = at(flight, row, RATES);
        [p, -q, -r]
    }));
    log.extend(controls(OWN, STICKS));
    log
}

/// A quaternion with its scalar first, and velocity over ground.
fn scalar_first() -> Written {
    let quaternion = |flight: &Flight, row| {
        let [roll, pitch, yaw] = at(flight, row, ANGLES);
        euler_to_quaternion(roll, pitch, yaw)
    };
    let mut log = time("t", 1.0);
    log.extend(canonical("position", POSITION));
    for (name, part) in [("q0", 3), ("q1", 0), ("q2", 1), ("q3", 2)] {
        log.push((name, Box::new(move |flight, row| quaternion(flight, row)[part])));
    }
    log.extend(triple(["vx", "vy", "vz"], over_ground));
    log.extend(canonical("rates", RATES));
    log.extend(controls(OWN, STICKS));
    log
}

fn swapped_sticks() -> Written {
    let mut log = time("t", 1.0);
    for columns in [POSITION, ANGLES, VELOCITY, RATES, LINEAR, ANGULAR] {
        log.extend(canonical("own", columns));
    }
    log.extend(controls(OWN, [Column::U2, Column::U1, Column::U3, Column::U4]));
    log
}

fn write(folder: &Path, data: &DataSet, log: &Written) -> Outcome {
    for flight in &data.flights {
        let mut text = log.iter().map(|column| column.0).collect::<Vec<_>>().join(",");
        for row in 0..flight.len() {
            text.push('\n');
            for (place, (_, value)) in log.iter().enumerate() {
                let _ = write!(text, "{}{:.7}", if place > 0 { "," } else { "" }, value(flight, row));
            }
        }
        let class = folder.join(&flight.manoeuvre);
        std::fs::create_dir_all(&class)?;
        std::fs::write(class.join(format!("{}.csv", flight.name.rsplit('/').next().unwrap_or_default())), text)?;
    }
    Ok(())
}

fn described(data: &Path, text: &str) -> phyture::Result<DataSet> {
    data_set(data, &ReadOptions { described: Some(text.into()), ..ReadOptions::default() })
}

/// What of the first flight that both sets have is read otherwise.
fn otherwise(read: &DataSet, truth: &DataSet) -> Vec<String> {
    let own = |flight: &Flight| flight.name.rsplit('/').next().unwrap_or_default().to_owned();
    let pair = truth.flights.iter().find_map(|t| read.flights.iter().find(|r| own(r) == own(t)).map(|r| (r, t)));
    let Some((read, truth)) = pair else { return vec!["no flight in common".into()] };
    let mut found = Vec::new();
    for &column in Column::STATE.iter().filter(|column| !truth.absent.contains(column)) {
        let count = read.len().min(truth.len());
        let pairs = || read.column(column)[..count].iter().zip(&truth.column(column)[..count]);
        let turn = |difference: f64| if ANGLES.contains(&column) { difference.sin().atan2(difference.cos()) } else { difference };
        let error: f64 = pairs().map(|(a, b)| turn(a - b).powi(2)).sum();
        let size: f64 = pairs().map(|(_, b)| b * b).sum();
        if error > 0.02_f64.powi(2) * size {
            found.push(format!("{} is off by {:.0} %", column.name(), 100.0 * (error / size).sqrt()));
        }
    }
    found
}

struct Case {
    name: &'static str,
    initial: Initial,
    wrong: Vec<String>,
}

/// `more` are keys for the comparison that say nothing about how columns are to be read.
fn case(name: &'static str, data: &Path, truth: &DataSet, more: &str) -> phyture::Result<Case> {
    let initial = init(data)?;
    let wrong = described(data, &format!("{more}{}", initial.dataset))
        .map_or_else(|error| vec![error.to_string()], |read| otherwise(&read, truth));
    Ok(Case { name, initial, wrong })
}

fn shared(set: &str) -> Option<(PathBuf, DataSet)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("../shared/data").join(set);
    if !folder.is_dir() {
        eprintln!("skipped: no {set} flights at hand");
        return None;
    }
    let dataset = Some(root.join("fixtures").join(set).join("dataset.toml"));
    data_set(&folder, &ReadOptions { dataset, ..ReadOptions::default() }).ok().map(|data| (folder, data))
}

/// Simulated flights in other words.
fn simulated(place: &Path, seed: u64) -> Result<Vec<Case>, Box<dyn std::error::Error>> {
    let truth = flights(seed)?;
    let mut cases = Vec::new();
    for (name, log) in [
        ("other names, in another order", renamed()),
        ("feet, degrees, milliseconds", feet_and_degrees()),
        ("accelerometer in mg, microseconds", accelerometer()),
        ("east-north-up, forward-left-up", east_north_up()),
        ("quaternion with its scalar first", scalar_first()),
        ("exchanged sticks", swapped_sticks()),
    ] {
        let folder = place.join(format!("{seed}-{}", cases.len()));
        write(&folder, &truth, &log)?;
        cases.push(case(name, &folder, &truth, "")?);
    }
    Ok(cases)
}

/// At most `most` are wrong, and what is not right is not said to be known.
fn assert_right(cases: &[Case], most: usize) {
    for case in cases {
        eprintln!("{:<36}{}", case.name, if case.wrong.is_empty() { "right".into() } else { case.wrong.join("; ") });
        case.initial.sure.iter().for_each(|sure| eprintln!("    known:   {sure}"));
        case.initial.mended.iter().for_each(|mended| eprintln!("    mended:  {mended}"));
        case.initial.unknown.iter().for_each(|unknown| eprintln!("    unknown: {}", unknown.what));
    }
    let wrong: Vec<&Case> = cases.iter().filter(|case| !case.wrong.is_empty()).collect();
    assert!(wrong.len() <= most, "{} of {} are wrong", wrong.len(), cases.len());
    assert!(wrong.iter().all(|case| !case.initial.unknown.is_empty()));
}

#[test]
fn other_flights_are_described_as_well() -> Outcome {
    let place = tempfile::tempdir()?;
    let mut cases = Vec::new();
    for seed in [7001, 7002, 7003] {
        cases.extend(simulated(place.path(), seed)?);
    }
    assert_right(&cases, 1);
    Ok(())
}

#[test]
fn ten_kinds_of_logs_are_described_without_a_hand() -> Outcome {
    let place = tempfile::tempdir()?;
    let mut cases = simulated(place.path(), 11)?;
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/logs");
    for (name, file) in [("PX4", "px4.ulg"), ("ArduPilot", "ardupilot.bin")] {
        let path = fixtures.join(file);
        let truth = data_set(&path, &ReadOptions::default())?;
        cases.push(case(name, &path, &truth, "")?);
    }
    for (name, set, more) in [("Crazyflie", "crazyflie", ""), ("TREX 550", "trex550", "resample_hz = 100\n")] {
        if let Some((folder, truth)) = shared(set) {
            cases.push(case(name, &folder, &truth, more)?);
        }
    }
    assert_right(&cases, 1);
    Ok(())
}

/// The coordinates' turn that the test writes is the one that is read.
#[test]
fn the_axes_of_the_test_are_those_of_the_program() {
    let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    let axes = Axes::EnuFlu;
    assert!(close(axes.inertial_to_ned([2.0, 1.0, -3.0]), [1.0, 2.0, 3.0]));
    assert!(close(axes.body_to_frd([1.0, -2.0, -3.0]), [1.0, 2.0, 3.0]));
    assert!(close(axes.euler_to_ned([0.1, -0.2, std::f64::consts::FRAC_PI_2 - 0.3]), [0.1, 0.2, 0.3]));
}
