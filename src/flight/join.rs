//! Streams of a log that have rates of their own, joined on one clock as a table.
//!
//! The clock runs at `resample_hz` of the description. Streams that a canonical column is made of are resampled with the local cubic of `resample`,
//! attitudes as quaternions; all others hold their last value. Where one of the former has no samples for longer than [`GAP_STEPS`] of its steps
//! and [`GAP_S`], the table has no rows. What the streams are is known by the formats' files, and what is made of them by the description.

use super::attitude::{euler_to_quaternion, quaternion_to_euler};
use super::bounds::{MOST_SAMPLES, RATES_HZ};
use super::resample::Resampler;
use super::schema::Schema;
use super::source::Read;
use super::table::{RawTable, fault};
use crate::error::Result;
use crate::formula::Formula;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

/// Rate of the clock where the description states none, Hz.
const RATE_HZ: f64 = 100.0;
/// A stream has a gap where it misses more than so many of its steps …
const GAP_STEPS: f64 = 2.5;
/// … and so long, s: half a period at 10 Hz, where the differentiator cuts off.
const GAP_S: f64 = 0.05;
/// Rows that a piece between gaps must have.
const LEAST_ROWS: usize = 4;

/// What a log recorded together: a topic or a kind of message.
pub(super) struct Stream {
    /// Name, with the instance in brackets for all but the first: `vehicle_attitude`, `IMU[1]`.
    pub name: String,
    pub time_s: Vec<f64>,
    /// Columns by full name, `IMU[1].GyrX`, each as long as the time.
    pub fields: Vec<(String, Vec<f64>)>,
}

/// Fields of a stream that turn together.
pub(super) enum Turn {
    /// The four parts of a quaternion, in any order.
    Quaternion([&'static str; 4]),
    /// Roll, pitch and yaw in degrees.
    Degrees([&'static str; 3]),
}

/// The table, and what is to be said of it.
pub(super) struct Joined {
    pub table: RawTable,
    pub note: String,
}

/// Joins the streams of the log at `path`; `turns` are the attitudes that the format knows, by stream.
///
/// # Errors
/// [`crate::Error::Log`] where no canonical column is recorded, a stream's time steps back, its rate is none, no time is covered by all, or, unless
/// the log is to be split there, where a stream has a gap.
pub(super) fn join(
    path: &Path,
    mut streams: Vec<Stream>,
    turns: &[(&str, Turn)],
    schema: &Schema,
    split: bool,
    read: Read,
) -> Result<Joined> {
    for stream in &mut streams {
        without_repeats(path, stream)?;
    }
    let needed = needed(&streams, schema);
    let spare = spare(schema, &needed);
    streams.iter_mut().for_each(|stream| stream.fields.retain(|(name, _)| !spare.contains(name)));
    streams.retain(|stream| !stream.time_s.is_empty() && !stream.fields.is_empty());
    let is_needed = |stream: &Stream| stream.fields.iter().any(|(name, _)| needed.contains(name));
    let (main, held): (Vec<Stream>, Vec<Stream>) = streams.into_iter().partition(is_needed);
    if main.is_empty() {
        let found = match held.as_slice() {
            [] => "a log without the streams that the description names".to_owned(),
            held => format!("a log of which only {} is known", list(held)),
        };
        return Err(fault(path, found, "attitude, velocity, rates and controls; `[columns]` in dataset.toml says where they are"));
    }
    let mut spans = vec![f64::NEG_INFINITY..f64::INFINITY];
    let mut runs = Vec::new();
    for stream in &main {
        let own = runs_of(path, stream)?;
        spans =
            intersection(&spans, &own.iter().map(|run| stream.time_s[run.start]..stream.time_s[run.end - 1]).collect::<Vec<_>>());
        runs.push(own);
    }
    let step_s = schema.resample_hz.unwrap_or(RATE_HZ).recip();
    let samples: f64 = spans.iter().map(|span| (span.end - span.start) / step_s).sum();
    if samples >= MOST_SAMPLES {
        let found = format!("{samples:.1e} samples at {:.0} Hz", step_s.recip());
        return Err(fault(path, found, format!("at most {MOST_SAMPLES:.0e}; a lower `resample_hz`")));
    }
    let clock = clock(&spans, step_s);
    let Some(first) = clock.first() else {
        let spans: Vec<String> = main.iter().map(span).collect();
        return Err(fault(
            path,
            format!("streams that no stretch of time has in common: {}", spans.join(", ")),
            "a flight with all of them",
        ));
    };
    if let Some(second) = clock.get(1).filter(|_| !split) {
        let (from_s, to_s) = (first[first.len() - 1], second[0]);
        let in_gap = |(stream, runs): (&Stream, &Vec<Range<usize>>)| {
            let gap =
                runs.windows(2).find(|pair| stream.time_s[pair[1].start] > from_s && stream.time_s[pair[0].end - 1] < to_s)?;
            Some(format!("`{}` from {:.3} s to {:.3} s", stream.name, stream.time_s[gap[0].end - 1], stream.time_s[gap[1].start]))
        };
        let gaps: Vec<String> = main.iter().zip(&runs).filter_map(in_gap).collect();
        let found = format!("streams without samples: {}", gaps.join(", "));
        return Err(fault(path, found, "streams without gaps; --split-at-gaps makes a flight of each part"));
    }
    let mut table = RawTable { path: path.into(), read: Some(read), ..RawTable::default() };
    table.names.push("t".into());
    table.columns.push(clock.concat());
    table.lines = (2..table.columns[0].len() + 2).collect();
    for (stream, runs) in main.iter().zip(&runs) {
        let turn = turns.iter().find(|turn| turn.0 == stream.name.split('[').next().unwrap_or_default());
        resampled(stream, runs, &clock, step_s, turn.map(|turn| &turn.1), &mut table);
    }
    for stream in &held {
        hold(stream, &mut table);
    }
    let rates: Vec<String> = main.iter().map(|stream| format!("{} {:.1} Hz", stream.name, rate_hz(&stream.time_s))).collect();
    let more = if held.is_empty() { String::new() } else { format!("; {} held at the last value", list(&held)) };
    let note = format!("joined at {} Hz with a local cubic: {}{more}", (step_s.recip() * 1e6).round() / 1e6, rates.join(", "));
    Ok(Joined { table, note })
}

fn list(streams: &[Stream]) -> String {
    streams.iter().map(|stream| stream.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn span(stream: &Stream) -> String {
    let (first, last) = (stream.time_s.first(), stream.time_s.last());
    format!("`{}` from {:.3} s to {:.3} s", stream.name, first.unwrap_or(&f64::NAN), last.unwrap_or(&f64::NAN))
}

fn rate_hz(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    steps.select_nth_unstable_by(middle, f64::total_cmp).1.recip()
}

/// Of samples with one stamp the first is kept.
fn without_repeats(path: &Path, stream: &mut Stream) -> Result<()> {
    if let Some(pair) = stream.time_s.windows(2).find(|pair| pair[1] < pair[0] || pair[1].is_nan()) {
        let found = format!("time in `{}` that steps back: {} s after {} s", stream.name, pair[1], pair[0]);
        return Err(fault(path, found, "time that increases; the log is damaged, or two flights are in it"));
    }
    let times = std::mem::take(&mut stream.time_s);
    let kept: Vec<usize> = (0..times.len()).filter(|&at| at == 0 || times[at] > times[at - 1]).collect();
    let pick = |values: &[f64]| kept.iter().map(|&at| values[at]).collect::<Vec<f64>>();
    stream.time_s = pick(&times);
    if kept.len() < times.len() {
        stream.fields.iter_mut().for_each(|(_, values)| *values = pick(values));
    }
    Ok(())
}

/// Columns that a canonical one could have been made of and is not. A second accelerometer among the further columns would give the acceleration away.
fn spare(schema: &Schema, needed: &BTreeSet<String>) -> BTreeSet<String> {
    let names = |text: &String| -> Vec<String> {
        let inside = Formula::parse(text).map(|formula| formula.names().into_iter().map(str::to_owned).collect::<Vec<_>>());
        inside.unwrap_or_default().into_iter().chain([text.clone()]).collect()
    };
    let asked = |name: &String| {
        schema.extra.iter().flatten().any(|extra| extra == name)
            || schema.rows.iter().any(|rule| rule.names().contains(&name.as_str()))
    };
    schema.columns.values().flatten().flat_map(names).filter(|name| !needed.contains(name) && !asked(name)).collect()
}

/// The columns of the log that canonical ones are made of: of alternatives the first that is there whole.
fn needed(streams: &[Stream], schema: &Schema) -> BTreeSet<String> {
    let known: BTreeSet<&str> = streams.iter().flat_map(|stream| stream.fields.iter().map(|(name, _)| name.as_str())).collect();
    let first = |alternatives: &Vec<String>| -> Option<Vec<String>> {
        alternatives.iter().find_map(|text| {
            if known.contains(text.as_str()) {
                return Some(vec![text.clone()]);
            }
            let formula = Formula::parse(text).ok()?;
            let names: Vec<String> = formula.names().into_iter().map(str::to_owned).collect();
            (!names.is_empty() && names.iter().all(|name| known.contains(name.as_str()))).then_some(names)
        })
    };
    let mut found: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (canonical, alternatives) in &schema.columns {
        found.extend(first(alternatives).map(|names| (canonical.as_str(), names)));
    }
    // Angles go before a quaternion, which is not read then.
    if found.contains_key("roll") {
        ["q1", "q2", "q3", "q4"].iter().for_each(|part| drop(found.remove(part)));
    }
    found.into_values().flatten().collect()
}

/// The rows of a stream between its gaps.
///
/// # Errors
/// [`crate::Error::Log`] for a rate that no log has.
fn runs_of(path: &Path, stream: &Stream) -> Result<Vec<Range<usize>>> {
    let rate_hz = rate_hz(&stream.time_s);
    if !RATES_HZ.contains(&rate_hz) {
        let found = format!("{} samples of `{}`, {rate_hz:.3} a second", stream.time_s.len(), stream.name);
        let expected = format!("{} to {} samples a second of what a canonical column is made of", RATES_HZ.start(), RATES_HZ.end());
        return Err(fault(path, found, expected));
    }
    let longest_s = (GAP_STEPS / rate_hz).max(GAP_S);
    let mut runs = Vec::new();
    let mut start = 0;
    for (row, pair) in (1..).zip(stream.time_s.windows(2)) {
        if pair[1] - pair[0] > longest_s {
            runs.push(start..row);
            start = row;
        }
    }
    runs.push(start..stream.time_s.len());
    runs.retain(|run| run.len() >= LEAST_ROWS);
    Ok(runs)
}

fn intersection(a: &[Range<f64>], b: &[Range<f64>]) -> Vec<Range<f64>> {
    let (mut found, mut i, mut j) = (Vec::new(), 0, 0);
    while let (Some(a), Some(b)) = (a.get(i), b.get(j)) {
        let both = a.start.max(b.start)..a.end.min(b.end);
        let is_first = a.end < b.end;
        if both.end > both.start {
            found.push(both);
        }
        if is_first { i += 1 } else { j += 1 }
    }
    found
}

/// Times at one step that lie in the spans; pieces that are too short are left out. Spans have a sample every few steps of a stream, so their times are
/// no more than its samples allow.
fn clock(spans: &[Range<f64>], step_s: f64) -> Vec<Vec<f64>> {
    let Some(zero_s) = spans.first().map(|span| span.start) else { return Vec::new() };
    let times = |span: &Range<f64>| -> Vec<f64> {
        // Rounding must not lose a sample at an end.
        let first = ((span.start - zero_s) / step_s - 1e-6).ceil().max(0.0) as u64;
        let last = ((span.end - zero_s) / step_s + 1e-6).floor() as u64;
        (first..=last).map(|tick| zero_s + tick as f64 * step_s).collect()
    };
    spans.iter().map(times).filter(|times| times.len() >= LEAST_ROWS).collect()
}

/// Adds the columns of a stream at the clock's times.
fn resampled(stream: &Stream, runs: &[Range<usize>], clock: &[Vec<f64>], step_s: f64, turn: Option<&Turn>, table: &mut RawTable) {
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); stream.fields.len()];
    let named =
        |wanted: &str| stream.fields.iter().position(|(name, _)| name.rsplit_once('.').is_some_and(|(_, own)| own == wanted));
    for times in clock {
        let (from_s, to_s) = (times[0], times[times.len() - 1]);
        let middle_s = 0.5 * (from_s + to_s);
        let covers = |run: &&Range<usize>| stream.time_s[run.start] <= middle_s && stream.time_s[run.end - 1] >= middle_s;
        let run = runs.iter().find(covers).expect("the clock has times within every stream's runs alone").clone();
        let resampler = Resampler::onto(&stream.time_s[run.clone()], times.clone(), step_s);
        let resampler = resampler.expect("a run has samples enough for a cubic");
        let mut values: Vec<Vec<f64>> = stream.fields.iter().map(|(_, values)| values[run.clone()].to_vec()).collect();
        let group: Option<Vec<usize>> = match turn {
            Some(Turn::Quaternion(names)) => names.iter().map(|name| named(name)).collect(),
            Some(Turn::Degrees(names)) => names.iter().map(|name| named(name)).collect(),
            None => None,
        };
        let turning = group.map(|group| {
            let rows: Vec<Vec<f64>> = group.iter().map(|&field| std::mem::take(&mut values[field])).collect();
            (group, turned(&rows, &resampler))
        });
        for (column, values) in columns.iter_mut().zip(&values).filter(|(_, values)| !values.is_empty()) {
            column.extend(resampler.apply(values));
        }
        for (field, values) in turning.into_iter().flat_map(|(group, turned)| group.into_iter().zip(turned)) {
            columns[field].extend(values);
        }
    }
    table.names.extend(stream.fields.iter().map(|(name, _)| name.clone()));
    table.columns.extend(columns);
}

/// Four parts of a quaternion, or three angles in degrees, at the new times.
fn turned(rows: &[Vec<f64>], resampler: &Resampler) -> Vec<Vec<f64>> {
    let mut parts: [Vec<f64>; 4] = Default::default();
    let mut before = [0.0; 4];
    for row in 0..rows[0].len() {
        let mut quaternion = match rows {
            [a, b, c, d] => [a[row], b[row], c[row], d[row]],
            rows => euler_to_quaternion(rows[0][row].to_radians(), rows[1][row].to_radians(), rows[2][row].to_radians()),
        };
        // q and -q are one attitude: stay on the side of the sample before.
        if quaternion.iter().zip(before).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            quaternion = quaternion.map(|part| -part);
        }
        before = quaternion;
        parts.iter_mut().zip(quaternion).for_each(|(values, part)| values.push(part));
    }
    let parts = parts.map(|values| resampler.apply(&values));
    if rows.len() == 4 {
        return parts.into();
    }
    let mut angles: [Vec<f64>; 3] = Default::default();
    let [x, y, z, w] = &parts;
    for (((&x, &y), &z), &w) in x.iter().zip(y).zip(z).zip(w) {
        let euler = quaternion_to_euler([x, y, z, w]);
        angles.iter_mut().zip(euler).for_each(|(values, angle)| values.push(angle.to_degrees()));
    }
    angles.into()
}

/// Adds the columns of a stream, each with its last value, or its first one before that.
fn hold(stream: &Stream, table: &mut RawTable) {
    let at = |time: &f64| stream.time_s.partition_point(|stamp| stamp <= time).saturating_sub(1);
    let rows: Vec<usize> = table.columns[0].iter().map(at).collect();
    for (name, values) in &stream.fields {
        table.names.push(name.clone());
        table.columns.push(rows.iter().map(|&row| values[row]).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    const DESCRIPTION: &str =
        "[columns]\nroll = \"ATT.Roll\"\npitch = \"ATT.Pitch\"\nyaw = \"ATT.Yaw\"\nwx = [\"GYR.X\", \"IMU.X\"]\n";
    const TURNS: &[(&str, Turn)] = &[("ATT", Turn::Degrees(["Roll", "Pitch", "Yaw"]))];

    fn stream(name: &str, hz: f64, skip: Range<f64>, fields: &[(&str, &dyn Fn(f64) -> f64)]) -> Stream {
        let time_s: Vec<f64> = (0..).map(|k| 1.0 + k as f64 / hz).take_while(|t| *t < 5.0).filter(|t| !skip.contains(t)).collect();
        let fields = fields.iter().map(|(own, of)| (format!("{name}.{own}"), time_s.iter().map(|t| of(*t)).collect())).collect();
        Stream { name: name.into(), time_s, fields }
    }

    fn streams(skip: Range<f64>) -> Vec<Stream> {
        let heading = |t: f64| (170.0 + 5.0 * t).rem_euclid(360.0);
        vec![
            stream("ATT", 20.0, 0.0..0.0, &[("Roll", &|_| 10.0), ("Pitch", &|t| t), ("Yaw", &heading)]),
            stream("IMU", 250.0, skip, &[("X", &|t| t * t)]),
            stream("BAT", 1.0, 0.0..0.0, &[("Volt", &|t| t.floor())]),
        ]
    }

    fn joined(streams: Vec<Stream>, split: bool) -> Result<Joined> {
        let schema = Schema::parse(DESCRIPTION.as_bytes(), "dataset.toml")?;
        join(Path::new("a.bin"), streams, TURNS, &schema, split, Read::of(Path::new("a.bin"), b""))
    }

    #[test]
    fn smooth_signals_come_through_and_a_heading_turns_past_south() -> Result<()> {
        let mut all = streams(0.0..0.0);
        all.push(stream("GYR", 50.0, 0.0..0.0, &[("Y", &|t| t)]));
        let still = vec![0.0; all[1].time_s.len()];
        all[1].fields.push(("IMU.Z".into(), still));
        let Joined { table, note } = joined(all, false)?;
        assert!(table.column("IMU.Z").is_some());
        let column = |name: &str| table.column(name).unwrap_or_default();
        assert_eq!(note, "joined at 100 Hz with a local cubic: ATT 20.0 Hz, IMU 250.0 Hz; BAT, GYR held at the last value");
        for (row, t) in column("t").iter().enumerate() {
            assert!((column("IMU.X")[row] - t * t).abs() < 1e-9 && column("BAT.Volt")[row] == t.floor());
            let off = (column("ATT.Yaw")[row] - (170.0 + 5.0 * t) + 540.0).rem_euclid(360.0) - 180.0;
            assert!(off.abs() < 1e-3 && (column("ATT.Pitch")[row] - t).abs() < 1e-3, "{off}");
        }
        assert!(table.rows() > 390);
        Ok(())
    }

    #[test]
    fn what_another_column_is_taken_for_is_left_out() -> Result<()> {
        let mut all = streams(0.0..0.0);
        all.push(stream("GYR", 50.0, 0.0..0.0, &[("X", &|t| t)]));
        let table = joined(all, false)?.table;
        assert!(table.column("GYR.X").is_some() && table.column("IMU.X").is_none());
        Ok(())
    }

    #[test]
    fn a_gap_is_named_or_splits_the_table() -> Result<()> {
        let refused = joined(streams(2.0..2.5), false).map(|_| ()).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains("`IMU` from 1.996 s to 2.500 s")), "{refused:?}");
        let table = joined(streams(2.0..2.5), true)?.table;
        let time = table.column("t").unwrap_or_default();
        assert_eq!(time.windows(2).filter(|pair| pair[1] - pair[0] > 0.02).count(), 1);
        assert!(time.iter().all(|t| *t < 2.0 || *t >= 2.5));
        Ok(())
    }

    #[test]
    fn what_cannot_be_joined_is_refused() {
        let mut back = streams(0.0..0.0);
        back[1].time_s[7] = 0.5;
        let mut apart = streams(0.0..0.0);
        apart[1].time_s.iter_mut().for_each(|t| *t += 100.0);
        let mut slow = streams(0.0..0.0);
        slow[1].time_s.iter_mut().for_each(|t| *t *= 1e4);
        let unknown = streams(0.0..0.0).split_off(2);
        let mut long = streams(0.0..0.0).split_off(1);
        long[0].time_s = (0..450_000).map(|k| f64::from(k) / 2.0).collect();
        long[0].fields[0].1 = vec![0.0; 450_000];
        for (streams, part) in [
            (back, "time in `IMU` that steps back"),
            (apart, "no stretch of time"),
            (slow, "samples of `IMU`, 0.025 a second"),
            (unknown, "only BAT is known"),
            (long, "2.2e7 samples at 100 Hz"),
        ] {
            let refused = joined(streams, false).map(|_| ());
            assert!(matches!(&refused, Err(Error::Log { found, .. }) if found.contains(part)), "{refused:?}");
        }
    }
}
