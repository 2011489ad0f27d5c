//! The layout of the Stanford Autonomous Helicopter data set: one folder a flight, with `smoother.txt` and `controls.txt`.
//!
//! Separated by spaces, without a header. `smoother.txt` has 24 columns: number, time (s), position NED (m), quaternion (x, y, z, w),
//! velocity, angular velocity, their derivatives, Euler angles; `controls.txt` has 6: number, time, aileron, elevator,
//! rudder, collective. What the files' authors do not state (which way the quaternion turns, axes of the rates and accelerations,
//! whether these contain gravity, scale of the controls) is decided by consistency within each file; see `hypotheses.rs`.
//! Source of the layout: the set's own notes (P. Abbeel, A. Coates, A. Y. Ng, Int. J. Robotics Research 29 (2010) 1608).

use super::assemble::{Assembled, Cuts, assemble};
use super::attitude::{cross, rotate, rotate_back, rotation_body_to_inertial};
use super::convert::check_finite;
use super::format::{Format, Place, Reader};
use super::hypotheses::{Decided, Smoother, control_scale, decide};
use super::names::own_name;
use super::schema::Schema;
use super::source::Read;
use super::table::RawTable;
use super::timing::{Clock, parts};
use super::write::check_names;
use super::{Column, Flight, attitude};
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::path::Path;

use crate::disk::write_atomically;

const SMOOTHER: &str = "smoother.txt";
const CONTROLS: &str = "controls.txt";
const SMOOTHER_COLUMNS: [&str; 24] = [
    "id",
    "time",
    "pos_n",
    "pos_e",
    "pos_d",
    "q_x",
    "q_y",
    "q_z",
    "q_w",
    "vel_n",
    "vel_e",
    "vel_d",
    "w_n",
    "w_e",
    "w_d",
    "vdot_n",
    "vdot_e",
    "vdot_d",
    "wdot_n",
    "wdot_e",
    "wdot_d",
    "euler_roll",
    "euler_pitch",
    "euler_yaw",
];
const CONTROL_COLUMNS: [&str; 6] = ["id", "time", "aileron", "elevator", "rudder", "collective"];

/// Motionless: slower than this, m/s and rad/s, …
const IDLE_SPEED_M_S: f64 = 0.3;
const IDLE_RATE_RAD_S: f64 = 0.05;
/// … for at least so long from the start of the flight, s (the set's notes say at least 10 s).
const IDLE_LEAST_S: f64 = 8.0;

/// The layout among the formats.
pub(super) const FORMAT: Format = Format {
    kind: "a flight in the Stanford layout",
    place: Place::Folder(is_flight),
    description: None,
    reader: Reader::Of(|log, schema, cuts| read(&log.path, &log.name, &log.manoeuvre, schema, cuts)),
};

/// Whether a folder is one flight in this layout.
fn is_flight(folder: &Path) -> bool {
    folder.join(SMOOTHER).is_file() && folder.join(CONTROLS).is_file()
}

/// Reads one flight's folder. What a description says of canonical columns holds; of what it says besides, a note tells.
///
/// # Errors
/// [`Error::Io`], [`Error::Cell`]; [`Error::Log`] if the files fit no hypothesis, with each one's error.
fn read(folder: &Path, name: &str, manoeuvre: &str, schema: &Schema, cuts: Cuts) -> Result<Assembled> {
    let smoother = read_table(&folder.join(SMOOTHER), &SMOOTHER_COLUMNS)?;
    let controls = read_table(&folder.join(CONTROLS), &CONTROL_COLUMNS)?;
    let times = column(&smoother, "time");
    let parts =
        parts(&smoother, "time", times, Clock { split: cuts.split_at_gaps, resampled: schema.resample_hz.is_some(), unit: None })?;
    parts_of_controls(&controls)?;

    let idle = idle_rows(&smoother, times);
    // What is decided is decided on the longest stretch in flight.
    let flying = parts.iter().map(|part| part.rows.start.max(idle)..part.rows.end);
    let longest = flying.max_by_key(ExactSizeIterator::len).unwrap_or_default();
    if longest.len() < 3 {
        return Err(smoother.fault("no motion: the aircraft stands on the ground throughout", "a flight"));
    }
    let step_s = parts.first().map_or(0.0, |part| part.step_s);
    let decided = decide(&Smoother::new(&smoother.slice(longest), step_s))?;
    let scale = control_scale(&controls)?;

    let (first, last) = overlap(&smoother, &controls, idle)?;
    let table = canonical(&smoother.slice(first..last), &controls, &decided, scale.1);
    let mut done = assemble(table, name, manoeuvre, &schema.of_canonical_columns(), cuts)?;
    done.files.extend(controls.read);
    if idle > 0 {
        let idle_s = times[idle] - times[0];
        done.own_notes.push(format!("`{name}`: {idle_s:.2} s motionless on the ground at the start are left out"));
    }
    let (before, after) = (first - idle, smoother.rows() - last);
    if before + after > 0 {
        done.own_notes.push(format!("`{name}`: {} samples without controls are left out", before + after));
    }
    done.common_notes.insert(format!("decided from the data: {}; controls: {}", decided.sentence, scale.0));
    let not_held = schema.not_of_canonical_columns();
    if !not_held.is_empty() {
        let keys = not_held.into_iter().collect::<Vec<_>>().join("`, `");
        done.common_notes
            .insert(format!("`{keys}` of dataset.toml do not hold for {}, which is read by what it says itself", FORMAT.kind));
    }
    Ok(done)
}

fn column<'a>(table: &'a RawTable, name: &str) -> &'a [f64] {
    table.column(name).unwrap_or_default()
}

fn read_table(path: &Path, names: &[&str]) -> Result<RawTable> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let text = String::from_utf8_lossy(&bytes);
    let mut table = RawTable {
        path: path.into(),
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        columns: vec![Vec::new(); names.len()],
        lines: Vec::new(),
        read: Some(Read::of(path, &bytes)),
    };
    for (line, row) in (1..).zip(text.lines()).filter(|(_, row)| !row.trim().is_empty()) {
        let cells: Vec<&str> = row.split_ascii_whitespace().collect();
        table.lines.push(line);
        let at = table.lines.len() - 1;
        if cells.len() != names.len() {
            let name = names.get(cells.len().min(names.len() - 1)).copied().unwrap_or_default();
            let expected = format!("{} separated by spaces: {}", names.len(), names.join(", "));
            return Err(table.cell(at, name, format!("{} cells in the row", cells.len()), expected));
        }
        for ((values, cell), name) in table.columns.iter_mut().zip(&cells).zip(names) {
            let Ok(value) = cell.parse() else {
                return Err(Error::Cell {
                    path: path.into(),
                    line,
                    column: (*name).into(),
                    found: format!("`{cell}`"),
                    expected: "a number".into(),
                });
            };
            values.push(value);
        }
    }
    if table.rows() == 0 {
        return Err(table.fault("no rows", "rows of numbers separated by spaces"));
    }
    check_finite(&table, &BTreeSet::new())?;
    Ok(table)
}

/// Stamps of the controls must increase; they are held until the next one, so their step may vary.
fn parts_of_controls(controls: &RawTable) -> Result<()> {
    let times = column(controls, "time");
    match times.windows(2).position(|pair| pair[1] <= pair[0]) {
        None => Ok(()),
        Some(at) => {
            let found = format!("{} s after {} s", times[at + 1], times[at]);
            Err(controls.cell(at + 1, "time", found, "time that increases from row to row"))
        }
    }
}

/// Rows at the start in which the aircraft stands; 0 if it never stood long.
fn idle_rows(smoother: &RawTable, times: &[f64]) -> usize {
    let length = |names: [&str; 3], row: usize| names.map(|name| column(smoother, name)[row].powi(2)).iter().sum::<f64>().sqrt();
    let moves = |row: usize| {
        length(["vel_n", "vel_e", "vel_d"], row) > IDLE_SPEED_M_S || length(["w_n", "w_e", "w_d"], row) > IDLE_RATE_RAD_S
    };
    let first = (0..smoother.rows()).find(|&row| moves(row)).unwrap_or(smoother.rows() - 1);
    if times[first] - times[0] >= IDLE_LEAST_S { first } else { 0 }
}

/// Rows of the smoother, after the idle ones, for which there is a control: from the first stamp on, until one hold after the last.
fn overlap(smoother: &RawTable, controls: &RawTable, idle: usize) -> Result<(usize, usize)> {
    let (times, stamps) = (column(smoother, "time"), column(controls, "time"));
    let (Some(&begin), Some(&end)) = (stamps.first(), stamps.last()) else { return Ok((idle, idle)) };
    let hold = if stamps.len() > 1 { (end - begin) / (stamps.len() - 1) as f64 } else { 0.0 };
    let first = times.partition_point(|&time| time < begin).max(idle);
    let last = times.partition_point(|&time| time <= end + hold);
    if first + 1 < last {
        return Ok((first, last));
    }
    let found = format!("controls from {begin} s to {end} s and states from {} s to {} s", times[idle], times[times.len() - 1]);
    Err(controls.fault(found, "stamps that overlap"))
}

/// The flight in canonical columns, controls held from their stamp on.
fn canonical(smoother: &RawTable, controls: &RawTable, decided: &Decided, scale: impl Fn(f64) -> f64) -> RawTable {
    let names: Vec<String> = std::iter::once("t").chain(Column::ALL.map(Column::name)).map(str::to_owned).collect();
    let mut columns = vec![Vec::with_capacity(smoother.rows()); names.len()];
    let triple = |names: [&str; 3], row: usize| names.map(|name| column(smoother, name)[row]);
    let stamps = column(controls, "time");
    for row in 0..smoother.rows() {
        let time = column(smoother, "time")[row];
        let matrix = decided.rotation(["q_x", "q_y", "q_z", "q_w"].map(|name| column(smoother, name)[row]));
        let w = decided.rates(&matrix, triple(["w_n", "w_e", "w_d"], row));
        let v_inertial = decided.velocity(&matrix, triple(["vel_n", "vel_e", "vel_d"], row));
        let v = rotate_back(&matrix, v_inertial);
        let acceleration = decided.acceleration(&matrix, triple(["vdot_n", "vdot_e", "vdot_d"], row), w, v);
        let transport = cross(w, v);
        let body = rotate_back(&matrix, acceleration);
        let v_dot: [f64; 3] = std::array::from_fn(|axis| body[axis] - transport[axis]);
        let w_dot = decided.angular_acceleration(&matrix, triple(["wdot_n", "wdot_e", "wdot_d"], row));
        let held = stamps.partition_point(|&stamp| stamp <= time).saturating_sub(1);
        let u = ["aileron", "elevator", "rudder", "collective"].map(|name| scale(column(controls, name)[held]));
        let position = triple(["pos_n", "pos_e", "pos_d"], row);
        let euler = attitude::rotation_to_euler(&matrix);
        let values = std::iter::once(time).chain(position).chain(euler).chain(v).chain(w).chain(u).chain(v_dot).chain(w_dot);
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    RawTable { path: smoother.path.clone(), names, columns, lines: smoother.lines.clone(), read: smoother.read.clone() }
}

/// Writes flights in this layout, `folder/<flight>/`, or `folder/<manoeuvre>/<flight>/` for flights that were read from folders: quaternion from body to NED, rates and their derivatives in body axes, velocity and its
/// derivative (gravity included) in NED, controls on the same stamps. Further columns are not written.
///
/// # Errors
/// [`Error::Log`] if a flight's name is no file name, occurs twice, or the flight lacks position or heading; [`Error::Io`].
pub fn write(folder: &Path, flights: &[Flight]) -> Result<()> {
    check_names(folder, flights)?;
    for flight in flights {
        if let Some(column) = flight.absent.first() {
            return Err(Error::Log {
                path: folder.into(),
                found: format!("the flight `{}` without `{}`", flight.name, column.name()),
                expected: "every canonical column; this layout has no way to say that one is missing".into(),
            });
        }
        let own = own_name(&flight.name);
        let inside = if own == flight.name { folder.join(own) } else { folder.join(&flight.manoeuvre).join(own) };
        std::fs::create_dir_all(&inside).map_err(Error::io(&inside))?;
        let triple = |first: Column, row: usize| -> [f64; 3] {
            std::array::from_fn(|axis| flight.column(Column::ALL[first as usize + axis])[row])
        };
        write_atomically(inside.join(SMOOTHER), |out| {
            for row in 0..flight.len() {
                let euler @ [roll, pitch, yaw] = triple(Column::Roll, row);
                let matrix = rotation_body_to_inertial(roll, pitch, yaw);
                let (v, w) = (triple(Column::Vx, row), triple(Column::Wx, row));
                let (transport, v_dot) = (cross(w, v), triple(Column::VxDot, row));
                let acceleration = rotate(&matrix, std::array::from_fn(|axis| v_dot[axis] + transport[axis]));
                write!(out, "{row} {:?}", flight.time_s(row))?;
                let quaternion = attitude::euler_to_quaternion(roll, pitch, yaw);
                let values = triple(Column::X, row).into_iter().chain(quaternion).chain(rotate(&matrix, v)).chain(w);
                for value in values.chain(acceleration).chain(triple(Column::WxDot, row)).chain(euler) {
                    write!(out, " {value:?}")?;
                }
                out.write_all(b"\n")?;
            }
            Ok(())
        })?;
        write_atomically(inside.join(CONTROLS), |out| {
            for row in 0..flight.len() {
                let u = [Column::U1, Column::U2, Column::U3, Column::U4].map(|column| flight.column(column)[row]);
                writeln!(out, "{row} {:?} {:?} {:?} {:?} {:?}", flight.time_s(row), u[0], u[1], u[2], u[3])?;
            }
            Ok(())
        })?;
    }
    Ok(())
}
