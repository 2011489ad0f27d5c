//! Causes of single flights, gathered: flights with the same cause make one finding, and a cause that most flights share is one of the set. What the
//! causes are, and how they are found, is in `causes`.

use super::causes::{Cause, Kind};
use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, in_flights};
use super::gains::OFFSETS;
use super::robust::median;
use crate::flight::{Column, Flight};
use std::collections::{BTreeMap, BTreeSet};

/// What was found, and in which flights.
#[derive(Default)]
pub(super) struct Blamed {
    pub findings: Vec<Finding>,
    /// The flights that have a cause which others have not.
    pub flights: BTreeSet<usize>,
}

/// Streams this much apart, or filtered so, change verdicts, s: lags of rotor and servo are as long.
const SLOW_S: f64 = 0.04;

/// A cause of the set is one of so many of its flights.
const HALF: f64 = 0.5;

/// The name of a kind, and the stream that it is wrong with.
type Named = (&'static str, Option<&'static str>);
/// A flight by its place, and a cause in it.
type OfFlight<'a> = (usize, &'a Cause);

/// Gathers the causes of flights; of a flight with sound relations there are none to look for. Noise is one in `outstanding` flights alone, since every sensor
/// has some, and leaps elsewhere are a warning.
pub(super) fn gathered(causes: &[(usize, Option<&[Cause]>)], outstanding: &BTreeSet<usize>, flights: &[Flight]) -> Blamed {
    let sound = causes.iter().filter(|entry| entry.1.is_none()).count();
    let mut alike: BTreeMap<Named, Vec<OfFlight<'_>>> = BTreeMap::new();
    for (flight, of_flight) in causes {
        let is_one = |cause: &&Cause| match cause.kind {
            Kind::Noise(_) => outstanding.contains(flight),
            // Every derivative is smoothed a little.
            Kind::Averaged(time_s) => as_lag_s(time_s) > SLOW_S,
            _ => true,
        };
        for cause in of_flight.iter().copied().flatten().filter(is_one) {
            let stream = cause.columns.first().map(|column| stream_of(*column));
            alike.entry((cause.kind.name(), stream)).or_default().push((*flight, cause));
        }
    }
    let mut order: Vec<Vec<OfFlight<'_>>> = alike.into_values().collect();
    order.sort_by_key(|alike| std::cmp::Reverse(alike.len()));
    let mut blamed = Blamed { findings: Vec::new(), flights: BTreeSet::new() };
    for alike in order {
        let columns = common(&alike);
        let of_all: Vec<&Cause> = alike.iter().map(|entry| entry.1).collect();
        let first = columns.first().map_or("", |column| column.name());
        let name = if first.is_empty() { alike[0].1.kind.name().to_owned() } else { format!("{}_{first}", alike[0].1.kind.name()) };
        let message = told(&of_all, &columns);
        let indices: BTreeSet<usize> = alike.iter().map(|entry| entry.0).collect();
        let indices: Vec<usize> = indices.into_iter().collect();
        let of_those = indices.len() as f64;
        let is_set = of_those > MOST * (sound as f64 + of_those) && of_those > HALF * causes.len() as f64;
        let found = if is_set {
            finding(&name, Severity::Fault, message, mend(&of_all, &columns).as_deref())
        } else {
            in_flights(&name, &indices, &message, flights)
        };
        let leaps_as_usual = alike[0].1.kind == Kind::Leaps && !indices.iter().all(|flight| outstanding.contains(flight));
        let is_fault = matters(&of_all, &columns) && !leaps_as_usual;
        let verdict = if is_fault { Severity::Fault } else { Severity::Warning };
        blamed.findings.push(Finding { verdict, ..found });
        // Of a position that is wrong all is said; a flight that is a little late is as good as any.
        if !is_set && (is_fault || columns.iter().all(|column| stream_of(*column) == "position")) {
            blamed.flights.extend(indices);
        }
    }
    blamed
}

/// Columns of a kind are a stream.
const fn stream_of(column: Column) -> &'static str {
    match column {
        Column::X | Column::Y | Column::Z => "position",
        Column::Roll | Column::Pitch | Column::Yaw => "attitude",
        Column::Vx | Column::Vy | Column::Vz => "velocity",
        Column::Wx | Column::Wy | Column::Wz => "rates",
        Column::U1 | Column::U2 | Column::U3 | Column::U4 => "controls",
        Column::VxDot | Column::VyDot | Column::VzDot => "linear accelerations",
        Column::WxDot | Column::WyDot | Column::WzDot => "angular accelerations",
    }
}

/// The time constant of the filter of first order that takes as much off slow oscillations as a mean over this time does: τ² ω² / 2 = T² ω² / 24.
fn as_lag_s(mean_s: f64) -> f64 {
    mean_s / 12.0_f64.sqrt()
}

/// Whether the physics would be wrong: where the aircraft is drives nothing but the effect of the ground, if it is the position that is wrong.
fn matters(all: &[&Cause], columns: &[Column]) -> bool {
    let slow_s = usual(all, |kind| match *kind {
        Kind::Late(time_s) | Kind::Filtered(time_s) => time_s.abs(),
        Kind::Averaged(time_s) => as_lag_s(time_s),
        _ => f64::INFINITY,
    });
    if slow_s < SLOW_S {
        return false;
    }
    let off = usual(all, |kind| if let Kind::Off(by) = *kind { by.abs() } else { f64::INFINITY });
    if off < OFFSETS[1] && columns.iter().all(|column| stream_of(*column) == "rates") {
        return false;
    }
    let is_position = columns.iter().all(|column| stream_of(*column) == "position");
    columns.is_empty() || !is_position || all.iter().any(|cause| cause.or.is_some())
}

/// Columns that at least half of the flights name, or else the one that most do.
fn common(alike: &[OfFlight<'_>]) -> Vec<Column> {
    let mut counts: BTreeMap<Column, usize> = BTreeMap::new();
    alike.iter().flat_map(|entry| &entry.1.columns).for_each(|column| *counts.entry(*column).or_default() += 1);
    let most = counts.values().copied().max().unwrap_or(0);
    let least = alike.len().div_ceil(2).min(most);
    counts.into_iter().filter(|(_, count)| *count >= least).map(|entry| entry.0).collect()
}

/// A number of the kinds, as usual among the flights.
fn usual(all: &[&Cause], of: impl Fn(&Kind) -> f64) -> f64 {
    median(all.iter().map(|cause| of(&cause.kind)).collect()).unwrap_or(0.0)
}

const CONTROLS: [&str; 4] = ["u1", "u2", "u3", "u4"];

fn off_centre(all: &[&Cause]) -> String {
    let [x, y, z] = [0, 1, 2].map(|axis| usual(all, |kind| if let Kind::OffCentre(arm) = kind { arm[axis] } else { 0.0 }));
    format!(
        "the linear accelerations are those of a sensor that is mounted off the centre of gravity by ({x:.2}, {y:.2}, {z:.2}) m, a lever arm: forward, \
         to the right, down"
    )
}

fn uneven_time(all: &[&Cause]) -> String {
    let [short, long] = [0, 1].map(|end| usual(all, |kind| if let Kind::Pace(ends) = kind { ends[end] } else { 1.0 }));
    format!(
        "the time stamps are not those of the rows: all that changes does so {short:.2} to {long:.2} times as fast as they say, by turns; steps of uneven \
         length, or rows that are missing"
    )
}

/// A ratio with the digits that count.
fn short(ratio: f64) -> String {
    if ratio.abs() < 0.1 { format!("{ratio:.3e}") } else { format!("{ratio:.4}") }
}

/// What is wrong, as a sentence.
fn told(all: &[&Cause], columns: &[Column]) -> String {
    let names = columns.iter().map(|column| column.name()).collect::<Vec<_>>().join(", ");
    let (stream, unit) = columns.first().map_or(("", ""), |column| (stream_of(*column), column.unit()));
    let names = if columns.len() == 3 { format!("{stream} ({names})") } else { names };
    let or = all[0].or.map(|or| format!(", or {or} the other way")).unwrap_or_default();
    let first_s = all.iter().filter_map(|cause| cause.from_s).reduce(f64::min);
    let since = first_s.map(|from_s| format!(", from {from_s:.0} s on in the first of them")).unwrap_or_default();
    let places = first_s.map(|from_s| format!(", first at {from_s:.0} s")).unwrap_or_default();
    let number = |of: fn(&Kind) -> f64| usual(all, of);
    let value = number(Kind::size);
    // "the velocity (vx, vy, vz) comes", "the rates (wx, wy, wz) come", "vx, vy come".
    let are_several = columns.len() > 1 && (columns.len() < 3 || stream.ends_with('s'));
    let does = |one: &'static str, more: &'static str| if are_several { more } else { one };
    match all[0].kind {
        Kind::Late(_) => {
            let how = if value < 0.0 { "early" } else { "late" };
            format!("{names} {} {how} by about {:.0} ms{or}{since}", does("comes", "come"), 1e3 * value.abs())
        }
        Kind::Filtered(_) => format!(
            "{names} {} as behind a filter with a time constant of about {value:.2} s: smoothed, slow and late{or}{since}",
            does("comes", "come")
        ),
        Kind::Averaged(_) => format!(
            "{names} {} a mean over about {value:.2} s (averaged, smoothed in both directions of time): what is quick is gone{or}{since}",
            does("is", "are")
        ),
        Kind::Scaled(_) => format!(
            "{names} {} about {} times as large as {} should be: other units or a wrong scale{or}{since}",
            does("is", "are"),
            short(value),
            does("it", "they")
        ),
        Kind::Off(_) => format!("{names} {} an offset of about {value:.3} {unit}{or}{since}", does("has", "have")),
        Kind::Drifts(_) => {
            format!("{names} {}: an offset that grows by about {value:.4} {unit} each second{or}{since}", does("drifts", "drift"))
        }
        Kind::Follows(control, _) => format!(
            "{names} {} with {}: {value:.3} {unit} for one of it that no motion explains, a disturbance by what the control drives, such as a \
             magnetic one{since}",
            does("goes", "go"),
            CONTROLS[control]
        ),
        Kind::Settles(..) => {
            let time_s = number(|kind| if let Kind::Settles(_, time_s) = kind { *time_s } else { 0.0 });
            format!(
                "{names} {} about {value:.3} {unit} off and settles with a time constant of about {time_s:.1} s: a filter that converges from a wrong start",
                does("starts", "start")
            )
        }
        Kind::SignLost => format!(
            "{names} {} never on both sides of 0 and would fit with both signs: the minus signs were lost",
            does("is", "are")
        ),
        Kind::Overflows(_) => format!(
            "{names} {} from one end to the other of ±{value:.2} {unit}: an overflow, after which counts wrap round{places}",
            does("leaps", "leap")
        ),
        Kind::Leaps => format!(
            "{names} {}, and what says how fast it changes does not: errors in few places, as of an estimator that corrects itself or a sensor that \
             slips{places}",
            does("leaps", "leap")
        ),
        Kind::Rounded(_) => format!("{names} {} rounded to steps of {value:.3} {unit}", does("is", "are")),
        Kind::Noise(_) => format!(
            "{names} {} noise or vibration of about {value:.3} {unit} (rms) that nothing it belongs to has{or}",
            does("has", "have")
        ),
        Kind::OffCentre(_) => off_centre(all),
        Kind::Pace(_) => uneven_time(all),
        Kind::Rows => format!(
            "rows do not follow each other: most columns leap at once; a gap, rows repeated or in the wrong order, or parts joined so{places}"
        ),
    }
}

/// The line of `dataset.toml` that mends all flights, where one can.
fn mend(all: &[&Cause], columns: &[Column]) -> Option<String> {
    if all.iter().any(|cause| cause.or.is_some() || cause.from_s.is_some()) {
        return None;
    }
    let lines = |line: &dyn Fn(&str) -> String| columns.iter().map(|column| line(column.name())).collect::<Vec<_>>().join(", ");
    match all[0].kind {
        Kind::Late(_) => {
            let late_s = usual(all, |kind| if let Kind::Late(late_s) = kind { *late_s } else { 0.0 });
            Some(format!("[late] {}", lines(&|name| format!("{name} = {late_s:.3}"))))
        }
        Kind::Scaled(_) => {
            let times = usual(all, |kind| if let Kind::Scaled(times) = kind { *times } else { 1.0 });
            Some(format!("[columns] {}, with the file's name", lines(&|name| format!("{name} = \"{name} / {}\"", short(times)))))
        }
        Kind::Off(_) => {
            let by = usual(all, |kind| if let Kind::Off(by) = kind { *by } else { 0.0 });
            let sign = if by < 0.0 { '+' } else { '-' };
            Some(format!(
                "[columns] {}, with the file's name",
                lines(&|name| format!("{name} = \"{name} {sign} {:.4}\"", by.abs()))
            ))
        }
        _ => None,
    }
}
