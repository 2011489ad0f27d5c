//! From one raw table to flights: timing, repair, conversion, resampling, derivation, row filter, cuts, in this order.
//!
//! Each step's arithmetic is in its own file; here stands the order, and what a person is told about it.

use super::convert::{Columns, check_finite, convert, source};
use super::derived::{Derived, derived};
use super::differentiate::{DEFAULT_CUTOFF_HZ, Differentiator, HIGHEST_CUTOFF};
use super::late::{in_step, reach};
use super::repair::{Repaired, repair};
use super::resample::Resampler;
use super::schema::Schema;
use super::source::Read;
use super::table::RawTable;
use super::taint::tainted;
use super::timing::{Clock, Part, cut, parts};
use super::{Column, Flight, Targets, attitude, within};
use crate::error::{Error, Result};
use crate::formula::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Range, RangeInclusive};

/// What the reader's options say about each flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuts {
    pub minimum_rows: usize,
    pub split_at_gaps: bool,
}

/// The flights of one file and what was done to them.
#[derive(Debug, Default)]
pub(super) struct Assembled {
    pub flights: Vec<Flight>,
    /// Sentences about this file alone, which start with its flight's name.
    pub own_notes: Vec<String>,
    /// Sentences that may hold for many files alike.
    pub common_notes: BTreeSet<String>,
    /// The files behind the flights.
    pub files: Vec<Read>,
    /// The attitude came from a quaternion.
    pub quaternion: bool,
}

/// Makes the flights of one table.
///
/// # Errors
/// [`Error::Cell`](crate::Error::Cell) and [`Error::Log`](crate::Error::Log) for everything that [`super::read`] lists; [`Error::Formula`](crate::Error::Formula), [`Error::Config`](crate::Error::Config) for what
/// the description asks of this file in vain.
pub(super) fn assemble(table: RawTable, name: &str, manoeuvre: &str, schema: &Schema, cuts: Cuts) -> Result<Assembled> {
    let tainted = tainted(&table, schema);
    let covered = schema.repairs.iter().flat_map(|rule| rule.columns.iter().map(String::as_str)).collect();
    check_finite(&table, &covered)?;
    let Some((time_s, time_name)) = source(&table, schema, 1.0, "t")? else {
        return Err(table.cell_of_header("t", "no such column in the header", "time in s, or under `columns` what gives it"));
    };
    let unit = schema.stated.get("units.t").map(String::as_str);
    let clock = Clock { unit, resampled: schema.resample_hz.is_some(), split: cuts.split_at_gaps };
    let parts = cut(parts(&table, &time_name, &time_s, clock)?, &time_s, &schema.cut_at_s)
        .map_err(|at_s| no_place(&table, at_s, &time_s))?;
    let log_start_s = time_s.first().copied().unwrap_or_default();
    let mut done = Assembled { files: table.read.iter().cloned().collect(), ..Assembled::default() };
    if let [whole] = parts.as_slice() {
        of_part(table, &time_s, whole, Identity { name, manoeuvre, alone: true, log_start_s }, schema, cuts, &mut done)?;
    } else {
        for part in &parts {
            if schema.cut_at_s.iter().any(|at_s| within_half_a_step(*at_s, part)) {
                done.own_notes.push(format!("`{name}`: cut before t = {:.3} s, as dataset.toml says", part.start_s));
            } else if part.gap_before_s > 0.0 {
                let gap = format!("`{name}`: cut at a jump of {:.3} s before t = {:.3} s", part.gap_before_s, part.start_s);
                done.own_notes.push(gap);
            }
            if too_short(part.rows.len(), part.step_s, schema, cuts) {
                done.own_notes.push(left_out(name, part.rows.len(), part.start_s, part.step_s));
                continue;
            }
            let times = time_s.get(part.rows.clone()).unwrap_or_default();
            let rows = table.slice(part.rows.clone());
            of_part(rows, times, part, Identity { name, manoeuvre, alone: false, log_start_s }, schema, cuts, &mut done)?;
        }
    }
    if let [only] = done.flights.as_mut_slice() {
        only.name = name.to_owned();
    }
    done.flights.iter_mut().for_each(|flight| flight.tainted.clone_from(&tainted));
    Ok(done)
}

/// Where a cut lies outside the log.
fn no_place(table: &RawTable, at_s: f64, time_s: &[f64]) -> Error {
    let [first, last] = [time_s.first(), time_s.last()].map(|time| time.copied().unwrap_or_default());
    table.fault(format!("a cut at t = {at_s} s, as dataset.toml says"), format!("a time after {first} s, up to {last} s"))
}

fn within_half_a_step(at_s: f64, part: &Part) -> bool {
    (at_s - part.start_s).abs() <= 0.5 * part.step_s
}

/// What a part's flights are called, and whether the part is the whole log.
#[derive(Clone, Copy)]
struct Identity<'a> {
    name: &'a str,
    manoeuvre: &'a str,
    alone: bool,
    /// When the log begins, s.
    log_start_s: f64,
}

/// Rows below which a piece has no step of its own, so that no file of it could be read.
const LEAST_ROWS: usize = 2;

fn too_short(rows: usize, step_s: f64, schema: &Schema, cuts: Cuts) -> bool {
    rows < cuts.minimum_rows.max(LEAST_ROWS) || (rows as f64) * step_s < schema.minimum_length_s
}

fn left_out(name: &str, rows: usize, start_s: f64, step_s: f64) -> String {
    let length_s = rows as f64 * step_s;
    format!(
        "`{name}`: the piece of {length_s:.2} s ({rows} sample{}) from t = {start_s:.2} s on is left out as too short",
        if rows == 1 { "" } else { "s" }
    )
}

/// Adds the flights of a part without jumps, numbered on from those made before.
fn of_part(
    mut table: RawTable,
    time_s: &[f64],
    part: &Part,
    Identity { name, manoeuvre, alone, log_start_s }: Identity,
    schema: &Schema,
    cuts: Cuts,
    done: &mut Assembled,
) -> Result<()> {
    let Repaired { note, cut, aside } = repair(&mut table, schema, part.step_s)?;
    if let Some(note) = note {
        done.own_notes.push(format!("`{name}`: {note}"));
    }
    let mut columns = convert(&table, schema, part.step_s)?;
    done.quaternion = columns.quaternion;

    let (mut start_s, mut step_s) = (part.start_s, part.step_s);
    let mut new_times = None;
    if let Some(hz) = schema.resample_hz {
        let resampler = Resampler::new(time_s, 1.0 / hz)
            .map_err(|error| table.fault(error.to_string(), "a flight and a `resample_hz` that go together"))?;
        resample(&mut columns, &resampler);
        done.common_notes.insert(format!("resampled from {:.2} Hz to {hz} Hz with a local cubic", 1.0 / part.step_s));
        (start_s, step_s) = (time_s.first().copied().unwrap_or(start_s), 1.0 / hz);
        new_times = Some(resampler.time_s);
    }
    let row_of = |sample: usize| match &new_times {
        Some(times) => time_s.partition_point(|&time| time < times[sample]).min(time_s.len().saturating_sub(1)),
        None => sample,
    };
    let recorded = columns.get(Column::Vx).map_or(0, <[f64]>::len);
    let late = schema.late.iter().map(|(column, late)| (*column, late.after(part.start_s - log_start_s))).collect();
    let (whole, with_them) = in_step(&mut columns, &late, &schema.filtered(), step_s, recorded);
    if !schema.late.is_empty() {
        let moved: Vec<String> = schema.late.iter().map(|(column, late)| format!("{} {late}", column.name())).collect();
        let with_them = if with_them.is_empty() { String::new() } else { format!("; with them {}", with_them.join(", ")) };
        done.common_notes.insert(format!("moved back in time, as dataset.toml says: {}{with_them}", moved.join(", ")));
    }
    let absent = fill_absent(&mut columns, schema, step_s, done);
    let targets = derive(&table, &mut columns, schema, step_s, done)?;
    let samples = columns.get(Column::Vx).map_or(0, <[f64]>::len);

    let used = rows_in_use(&columns, &absent, schema, samples, (start_s, step_s));
    let mut used = used.map_err(|error| error.standing_in(&format!("{}, `use` of dataset.toml", table.path.display())))?;
    used.iter_mut().enumerate().for_each(|(sample, used)| *used &= whole.contains(&sample));
    if !schema.repairs.is_empty() {
        let lost = lost_rows(&columns, samples);
        without_cut_rows(
            &mut used,
            &lost,
            &|rows| cuts_near(&cut, row_of(rows.start)..row_of(rows.end - 1) + 1, schema, part),
            name,
            done,
        );
        without_lost_ends(&mut used, &lost, name, done);
    }
    let moved = reach(&late, recorded, step_s);
    let between = usize::from(new_times.is_some());
    let set_aside = set_aside(&aside, samples, &|sample| row_of(sample).saturating_sub(between)..=row_of(sample), moved);
    note_set_aside(&set_aside, &used, name, done);
    let runs = runs(&used);
    if !schema.rows.is_empty() {
        let kept = used.iter().filter(|&&used| used).count();
        done.own_notes.push(format!(
            "`{name}`: `use` keeps {kept} of {samples} samples, in {} piece{}",
            runs.len(),
            if runs.len() == 1 { "" } else { "s" }
        ));
    }
    for run in runs {
        let run_start_s = start_s + step_s * run.start as f64;
        if too_short(run.len(), step_s, schema, cuts) {
            if alone && run.len() == samples {
                let least = cuts.minimum_rows.max(LEAST_ROWS).max((schema.minimum_length_s / step_s).ceil() as usize);
                let expected = format!("at least {least}, the length of the history (or `minimum_length_s` in dataset.toml)");
                return Err(table.fault(format!("{samples} samples"), expected));
            }
            done.own_notes.push(left_out(name, run.len(), run_start_s, step_s));
            continue;
        }
        check_used(&table, &columns, &run, &row_of)?;
        let cut = |values: &[f64]| values.get(run.clone()).unwrap_or_default().to_vec();
        let canonical = std::array::from_fn(|column| columns.canonical[column].as_deref().map(cut).unwrap_or_default());
        let number = done.flights.len() + 1;
        let mut flight = Flight::new(format!("{name}[{number}]"), manoeuvre, run_start_s, step_s, canonical, targets)?;
        flight.absent = absent.clone();
        flight.set_aside = within(&set_aside, &run);
        flight.extra = columns.extra.iter().map(|(name, values)| (name.clone(), cut(values))).collect();
        done.flights.push(flight);
    }
    Ok(())
}

/// Every column to the new times; attitude as a quaternion, so that wrapped angles and loops cost nothing.
fn resample(columns: &mut Columns, resampler: &Resampler) {
    let angles = [Column::Roll, Column::Pitch, Column::Yaw];
    let no_yaw = columns.get(Column::Yaw).is_none();
    let (roll, pitch) = (columns.get(Column::Roll).unwrap_or_default(), columns.get(Column::Pitch).unwrap_or_default());
    let mut parts: [Vec<f64>; 4] = Default::default();
    let mut before = [0.0, 0.0, 0.0, 1.0];
    for (row, (&roll, &pitch)) in roll.iter().zip(pitch).enumerate() {
        let yaw = columns.get(Column::Yaw).and_then(|yaw| yaw.get(row)).copied().unwrap_or(0.0);
        let mut quaternion = attitude::euler_to_quaternion(roll, pitch, yaw);
        // q and -q are one attitude: stay on the side of the sample before.
        if quaternion.iter().zip(before).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            quaternion = quaternion.map(|part| -part);
        }
        before = quaternion;
        parts.iter_mut().zip(quaternion).for_each(|(values, part)| values.push(part));
    }
    let parts = parts.map(|values| resampler.apply(&values));
    let mut euler: [Vec<f64>; 3] = Default::default();
    let [a, b, c, d] = &parts;
    for (((&a, &b), &c), &d) in a.iter().zip(b).zip(c).zip(d) {
        let angles = attitude::quaternion_to_euler([a, b, c, d]);
        euler.iter_mut().zip(angles).for_each(|(values, angle)| values.push(angle));
    }
    for column in Column::ALL.into_iter().filter(|column| !angles.contains(column)) {
        let values = &mut columns.canonical[column as usize];
        *values = values.take().map(|values| resampler.apply(&values));
    }
    for (column, values) in angles.into_iter().zip(euler) {
        columns.canonical[column as usize] = (column != Column::Yaw || !no_yaw).then_some(values);
    }
    columns.extra.values_mut().for_each(|values| *values = resampler.apply(values));
}

/// Position that a log lacks is zero; heading is the integral of the Euler yaw rate from zero.
fn fill_absent(columns: &mut Columns, schema: &Schema, step_s: f64, done: &mut Assembled) -> Vec<Column> {
    let absent: Vec<Column> =
        [Column::X, Column::Y, Column::Z, Column::Yaw].into_iter().filter(|&column| columns.get(column).is_none()).collect();
    let samples = columns.get(Column::Vx).map_or(0, <[f64]>::len);
    for &column in &absent {
        if column != Column::Yaw {
            columns.canonical[column as usize] = Some(vec![0.0; samples]);
            done.common_notes.insert(format!("`{}` is not in the logs and is zero", column.name()));
        }
    }
    if absent.contains(&Column::Yaw) {
        let column = |column| columns.get(column).unwrap_or_default();
        let (roll, pitch) = (column(Column::Roll), column(Column::Pitch));
        let (p, q, r) = (column(Column::Wx), column(Column::Wy), column(Column::Wz));
        let rate = |row: usize| attitude::euler_rates(roll[row], pitch[row], [p[row], q[row], r[row]])[2];
        let mut yaw = vec![0.0; samples];
        for row in 1..samples {
            yaw[row] = yaw[row - 1] + 0.5 * step_s * (rate(row - 1) + rate(row));
        }
        columns.canonical[Column::Yaw as usize] = Some(yaw);
        done.common_notes.insert("`yaw` is not in the logs and is the integral of the Euler yaw rate from zero".into());
    }
    debug_assert!(schema.missing.len() >= absent.len());
    absent
}

/// Accelerations that the log lacks, by the differentiator.
fn derive(table: &RawTable, columns: &mut Columns, schema: &Schema, step_s: f64, done: &mut Assembled) -> Result<Targets> {
    let mut targets = schema.target_origin;
    if targets == Targets::Derived {
        done.common_notes.insert("the accelerations in the logs were derived from v and w, as dataset.toml says".into());
    }
    let cutoff_hz = schema.cutoff_hz.unwrap_or(DEFAULT_CUTOFF_HZ.min(HIGHEST_CUTOFF / step_s));
    let mut of_angular = None;
    for (kind, first, of) in [("linear", Column::VxDot, Column::Vx), ("angular", Column::WxDot, Column::Wx)] {
        if columns.get(first).is_some() {
            continue;
        }
        let differentiator = Differentiator::new(step_s, cutoff_hz)?;
        for axis in 0..3 {
            let values = columns.canonical[of as usize + axis].as_deref().unwrap_or_default();
            let derivative =
                differentiator.derivative(values).map_err(|error| table.fault(error.to_string(), "a longer flight"))?;
            columns.canonical[first as usize + axis] = Some(derivative);
        }
        let symbol = if of == Column::Vx { "v" } else { "w" };
        done.common_notes.insert(format!(
            "{kind} accelerations are derived from {symbol} by a zero-phase differentiator (-3 dB at {cutoff_hz} Hz)"
        ));
        targets = Targets::Derived;
        of_angular = (of == Column::Wx).then_some(differentiator);
    }
    // Velocities move slowly; it is the angular accelerations that a quick stick moves.
    if let Some(differentiator) = of_angular {
        hold_to_band(columns, schema, &differentiator, cutoff_hz, done)?;
    } else if schema.smooth_controls {
        let expected = "a log whose angular accelerations are derived: only such are without what is fast";
        return Err(table.fault("`smooth_controls` of dataset.toml, and `wx_dot wy_dot wz_dot` in the log", expected));
    }
    Ok(targets)
}

/// Of a control's variance, how much may lie where derived accelerations show nothing.
const BEYOND_BAND: f64 = 0.05;

/// Deriving is a low-pass for the accelerations; the same for the controls, where the description asks for it, else a note if they need it. Numbers of
/// a control come out too small where it moves in a band in which the accelerations cannot answer.
fn hold_to_band(
    columns: &mut Columns,
    schema: &Schema,
    differentiator: &Differentiator,
    cutoff_hz: f64,
    done: &mut Assembled,
) -> Result<()> {
    let mut beyond = false;
    for column in [Column::U1, Column::U2, Column::U3, Column::U4] {
        let Some(values) = &mut columns.canonical[column as usize] else { continue };
        let whole = without_gaps(values);
        let smooth = differentiator.band(&whole)?;
        if schema.smooth_controls {
            // A cell without a value stays without one.
            values.iter_mut().zip(smooth).filter(|(value, _)| value.is_finite()).for_each(|(value, smooth)| *value = smooth);
            continue;
        }
        let rest = whole.iter().zip(&smooth).map(|(value, smooth)| (value - smooth).powi(2)).sum::<f64>();
        let mean = whole.iter().sum::<f64>() / whole.len() as f64;
        beyond |= rest > BEYOND_BAND * whole.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    }
    if schema.smooth_controls {
        done.common_notes.insert(format!(
            "the controls are smoothed to the band of the derived accelerations (-3 dB at {cutoff_hz} Hz, zero phase), as dataset.toml says: \
             for numbers of physics, not for a network that is to stream"
        ));
    } else if beyond {
        done.common_notes.insert(format!(
            "some control moves faster than accelerations derived up to {cutoff_hz} Hz can show, so its numbers come out too small; \
             `smooth_controls = true` in dataset.toml holds controls to that band"
        ));
    }
    Ok(())
}

/// The same with the value before in the place of what is no number.
fn without_gaps(values: &[f64]) -> Vec<f64> {
    let mut last = values.iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
    let mut filled = |&value: &f64| {
        last = if value.is_finite() { value } else { last };
        last
    };
    values.iter().map(&mut filled).collect()
}

/// Which samples the filter keeps; all without one. The clock is the time of the first sample and the step, s.
fn rows_in_use(columns: &Columns, absent: &[Column], schema: &Schema, samples: usize, clock: (f64, f64)) -> Result<Vec<bool>> {
    let (start_s, step_s) = clock;
    let time_s = |sample: usize| start_s + step_s * sample as f64;
    let mut used = vec![true; samples];
    let canonical = |column: Column| if absent.contains(&column) { None } else { columns.get(column) };
    let get = |name: &str| -> Option<Value> {
        if let Some(column) = Column::from_name(name) {
            return canonical(column).map(Value::from);
        }
        columns.extra.get(name).map(Value::from).or_else(|| derived(name, samples, &time_s, &canonical).map(Value::from))
    };
    for formula in &schema.rows {
        let names = Column::ALL.map(Column::name).into_iter().chain(columns.extra.keys().map(String::as_str));
        let known: Vec<&str> = names.chain(Derived::ALL.map(Derived::name)).filter(|name| get(name).is_some()).collect();
        formula.check_names(&known)?;
        let holds = formula.evaluate(samples, step_s, &get)?;
        used.iter_mut().zip(holds).for_each(|(used, holds)| *used &= holds.is_finite() && holds != 0.0);
    }
    Ok(used)
}

/// Runs of true.
fn runs(used: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for at in (0..used.len()).filter(|&at| used[at]) {
        match runs.last_mut() {
            Some(run) if run.end == at => run.end += 1,
            _ => runs.push(at..at + 1),
        }
    }
    runs
}

/// Rows in which some column has no value.
fn lost_rows(columns: &Columns, samples: usize) -> Vec<bool> {
    let all = columns.canonical.iter().flatten().chain(columns.extra.values());
    let mut lost = vec![false; samples];
    all.for_each(|values| lost.iter_mut().zip(values).for_each(|(lost, value)| *lost |= value.is_nan()));
    lost
}

/// Rows around a cell that are without a value with it: a resampler and a moved stream reach so far.
const REACH: usize = 3;

/// Whether a rule cuts at one of these rows of the file, or so near that streams that were moved could have come from there.
fn cuts_near(cut: &[bool], rows: Range<usize>, schema: &Schema, part: &Part) -> bool {
    let latest_s = schema.late.values().fold(0.0, |most: f64, late| most.max(late.most_s(part.step_s * cut.len() as f64)));
    let near = REACH + (latest_s / part.step_s).ceil() as usize;
    let rows = rows.start.saturating_sub(near).min(cut.len())..(rows.end + near).min(cut.len());
    cut[rows].contains(&true)
}

fn note_set_aside(set_aside: &[Range<usize>], used: &[bool], name: &str, done: &mut Assembled) {
    let count: usize = set_aside.iter().map(|rows| used[rows.clone()].iter().filter(|&&used| used).count()).sum();
    if count > 0 {
        done.own_notes.push(format!(
            "`{name}`: {count} of {} samples are set aside as near bridged cells: nothing is fitted to their accelerations or judged by them",
            used.len()
        ));
    }
}

/// Samples that are set aside because one of the rows of the file that they are made of is, or one from which a moved stream came.
fn set_aside(
    aside: &[bool],
    samples: usize,
    rows_of: &dyn Fn(usize) -> RangeInclusive<usize>,
    [before, behind]: [usize; 2],
) -> Vec<Range<usize>> {
    if !aside.contains(&true) {
        return Vec::new();
    }
    let is_aside = |sample: usize| {
        let (first, last) = (rows_of(sample.saturating_sub(before)), rows_of((sample + behind).min(samples - 1)));
        aside[*first.start()..=*last.end()].contains(&true)
    };
    runs(&(0..samples).map(is_aside).collect::<Vec<bool>>())
}

/// Runs of rows without a value are not used where a rule `cuts`: the flight is cut there.
fn without_cut_rows(used: &mut [bool], lost: &[bool], cuts: &dyn Fn(&Range<usize>) -> bool, name: &str, done: &mut Assembled) {
    let of_cut: Vec<Range<usize>> = runs(lost).into_iter().filter(cuts).collect();
    of_cut.iter().for_each(|run| used[run.clone()].fill(false));
    if !of_cut.is_empty() {
        done.own_notes.push(format!(
            "`{name}`: cut at {} runs of bad cells that are too long to be bridged, {} of {} samples",
            of_cut.len(),
            of_cut.iter().map(ExactSizeIterator::len).sum::<usize>(),
            used.len()
        ));
    }
}

/// Rows at the ends of a log that repair rules left without a value are not used: there is nothing to bridge them to.
fn without_lost_ends(used: &mut [bool], lost: &[bool], name: &str, done: &mut Assembled) {
    let first = lost.iter().take_while(|lost| **lost).count();
    let last = lost[first..].iter().rev().take_while(|lost| **lost).count();
    let end = used.len() - last;
    if used[..first].iter().chain(&used[end..]).all(|used| !used) {
        return;
    }
    used[..first].fill(false);
    used[end..].fill(false);
    done.own_notes.push(format!(
        "`{name}`: {first} rows at the start and {last} at the end, bad cells without a good one beyond, are left out"
    ));
}

/// Refuses a row in use with a cell that no rule could repair, or a formula that gives no number.
fn check_used(table: &RawTable, columns: &Columns, run: &Range<usize>, row_of: &dyn Fn(usize) -> usize) -> Result<()> {
    let canonical = Column::ALL.into_iter().filter_map(|column| columns.get(column).map(|values| (column.name(), values)));
    for (name, values) in canonical.chain(columns.extra.iter().map(|(name, values)| (name.as_str(), values.as_slice()))) {
        let part = values.get(run.clone()).unwrap_or_default();
        if let Some(at) = part.iter().position(|value| !value.is_finite()) {
            let found = "no number, in a row that `use` keeps".to_owned();
            let expected = "a value that the repair rules can bridge and the formulas give; widen `max_gap_s` or narrow `use`";
            return Err(table.cell(row_of(run.start + at), name, found, expected));
        }
    }
    Ok(())
}

/// Common notes of many files, each with the flights it holds for.
pub(super) fn gather(notes: BTreeMap<String, Vec<String>>, files: usize) -> Vec<String> {
    let mut sentences = Vec::new();
    for (note, names) in notes {
        let which = match names.as_slice() {
            names if names.len() == files && files > 1 => format!("all {files} logs"),
            [first, second, third, _, ..] => format!("`{first}`, `{second}`, `{third}` and {} more", names.len() - 3),
            few => few.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
        };
        sentences.push(format!("{which}: {note}"));
    }
    sentences
}
