//! Cells that cannot be: for moments, values far outside of what their column does in all flights, or single ones that stick out from both neighbours as no
//! state of an aircraft can. Nothing is mended here; the finding prints the
//! rule for `dataset.toml` that does.

use super::finding::{Finding, Severity, Subject};
use super::flights::{CONTROLS, named, of_all};
use crate::flight::{Column, Flight};

/// Values of a column that its usual range is taken from, at most.
const LOOKED_AT: usize = 20_000;
/// Share of them at either end that does not belong to it.
const TAIL: f64 = 5e-3;
/// A cell is a spike if it lies outside by so many ranges, and is reached and left in single steps of that size …
const OUTSIDE: f64 = 2.0;
/// … and is over within this time, s …
const LONGEST_S: f64 = 0.25;
/// … or within this, if all of it is one and the same value: such a value stands where nothing was received.
const LONGEST_OF_ONE_S: f64 = 2.0;
/// Where the usual range is so many times that of the middle four fifths, it is not usual.
const STRETCHED: f64 = 200.0;
/// Controls are about [-1, 1]: a stick that is seldom moved is no spike below this, beside its usual range.
const LARGEST_CONTROL: f64 = 1.5;

/// A single cell sticks out where its distance from the middle of its neighbours is so many times that of the cells around it, …
const STICKS_OUT: f64 = 8.0;
/// … so many times what nearly all cells of the flight keep, …
const BEYOND_USUAL: f64 = 10.0;
const NEARLY_ALL: f64 = 0.95;
/// … this part of the column's usual range, and the neighbours differ by this part of it at most.
const OF_RANGE: f64 = 0.02;
const RETURNED: f64 = 0.25;
/// States that no force moves there and back in a sample. Angles wrap round, and pitch turns back at the vertical.
const STATES: [Column; 9] =
    [Column::X, Column::Y, Column::Z, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// A column's spikes: how many cells, in which flights, and the usual range.
struct Spikes {
    cells: usize,
    flights: Vec<usize>,
    longest_s: f64,
    range: [f64; 2],
}

/// A finding for each column with spikes, and the flights that hold them.
pub(super) fn spikes(flights: &[Flight]) -> Vec<(Finding, Vec<usize>)> {
    let present = |column: &Column| flights.iter().all(|flight| !flight.absent.contains(column));
    Column::ALL
        .into_iter()
        .filter(present)
        .filter_map(|column| {
            let far = of_column(flights, column);
            let single = if STATES.contains(&column) { single(flights, column) } else { None };
            // Of those that stick out most lie far outside as well.
            if let Some(single) = single.filter(|single| far.as_ref().is_none_or(|far| far.cells <= 2 * single.cells)) {
                return Some((finding_on_single(column, &single, flights), single.flights));
            }
            let far = far?;
            Some((finding(column, &far, flights), far.flights))
        })
        .collect()
}

fn of_column(flights: &[Flight], column: Column) -> Option<Spikes> {
    let [low, high] = usual(flights, column)?;
    let jump = OUTSIDE * (high - low);
    let is_control = CONTROLS.contains(&column);
    let size = low.abs().max(high.abs()).max(1.0);
    let beyond = if is_control { LARGEST_CONTROL * size } else { f64::NEG_INFINITY };
    let range = [(low - jump).min(-beyond), (high + jump).max(beyond)];
    let far = |value: f64| value < range[0] || value > range[1];
    let mut spikes = Spikes { cells: 0, flights: Vec::new(), longest_s: 0.0, range };
    for (index, flight) in flights.iter().enumerate() {
        let values = flight.column(column);
        let [longest, longest_of_one] =
            [LONGEST_S, LONGEST_OF_ONE_S].map(|longest_s| (longest_s / flight.step_s).round().max(1.0) as usize);
        let mut start = 0;
        while let Some(first) = (start..values.len()).find(|&sample| far(values[sample])) {
            let end = (first..values.len()).find(|&sample| !far(values[sample])).unwrap_or(values.len());
            start = end;
            let leaps =
                |inside: usize, outside: Option<&f64>| outside.is_none_or(|outside| (values[inside] - outside).abs() > jump);
            let before = first.checked_sub(1).and_then(|sample| values.get(sample));
            let is_one = values[first..end].iter().all(|value| *value == values[first]);
            let is_short = end - first <= if is_one { longest_of_one } else { longest };
            if is_short && leaps(first, before) && leaps(end - 1, values.get(end)) {
                spikes.cells += end - first;
                spikes.longest_s = spikes.longest_s.max((end - first) as f64 * flight.step_s);
                if spikes.flights.last() != Some(&index) {
                    spikes.flights.push(index);
                }
            }
        }
        flight.rest();
    }
    (spikes.cells > 0).then_some(spikes)
}

/// Single cells that stick out: how many, in which flights, and the least distance.
struct Single {
    cells: usize,
    flights: Vec<usize>,
    least: f64,
}

fn single(flights: &[Flight], column: Column) -> Option<Single> {
    let [low, high] = usual(flights, column)?;
    let mut found = Single { cells: 0, flights: Vec::new(), least: f64::INFINITY };
    for (index, flight) in flights.iter().enumerate() {
        let own = sticking_out(flight.column(column), OF_RANGE * (high - low));
        flight.rest();
        if let Some(least) = own.iter().copied().reduce(f64::min) {
            found.cells += own.len();
            found.flights.push(index);
            found.least = found.least.min(least);
        }
    }
    (found.cells > 0).then_some(found)
}

/// By how much each cell that sticks out lies beyond the nearer of its neighbours.
fn sticking_out(values: &[f64], least: f64) -> Vec<f64> {
    let off: Vec<f64> = values.windows(3).map(|three| three[1] - 0.5 * (three[0] + three[2])).collect();
    let mut sizes: Vec<f64> = off.iter().map(|off| off.abs()).collect();
    let place = (NEARLY_ALL * sizes.len() as f64) as usize;
    if place >= sizes.len() {
        return Vec::new();
    }
    let usual = *sizes.select_nth_unstable_by(place, f64::total_cmp).1;
    let is_out = |at: usize| {
        let size = off[at].abs();
        // Next to it half of the distance shows, in both.
        let around = [at.wrapping_sub(3), at.wrapping_sub(2), at + 2, at + 3].into_iter().filter_map(|other| off.get(other));
        let around = around.fold(0.0_f64, |most, other| most.max(other.abs()));
        let returns = (values[at + 2] - values[at]).abs() < RETURNED * size;
        size > least && size > BEYOND_USUAL * usual && size > STICKS_OUT * around && returns
    };
    let beyond = |at: usize| (values[at + 1] - values[at]).abs().min((values[at + 1] - values[at + 2]).abs());
    (0..off.len()).filter(|at| is_out(*at)).map(beyond).collect()
}

fn finding_on_single(column: Column, single: &Single, flights: &[Flight]) -> Finding {
    let name = column.name();
    let where_to: Vec<&str> = single.flights.iter().map(|&flight| flights[flight].name.as_str()).collect();
    let message = format!(
        "{} off from both neighbours by {:.3} and more, a spike that no force makes, in {}",
        if single.cells == 1 { format!("1 cell of {name} is") } else { format!("{} cells of {name} are", single.cells) },
        single.least,
        named(&where_to)
    );
    let rule = format!(
        "[[repair]] columns = [\"{name}\"], spike = {:.4}, max_gap_s = {:.3}, with the file's name and in its units",
        0.7 * single.least,
        // Between two spikes a good cell sticks out the other way.
        3.5 * single.flights.first().map_or(0.01, |&flight| flights[flight].step_s)
    );
    Finding {
        measured: Some(single.cells as f64),
        expected: Some(0.0),
        ..super::finding::finding(&format!("spikes_{name}"), Severity::Fault, message, Some(&rule))
    }
}

/// The range that a column keeps to, but for a two-hundredth of its samples at either end, or a tenth where these stretch it; `None` where it does not
/// move.
fn usual(flights: &[Flight], column: Column) -> Option<[f64; 2]> {
    let samples: usize = flights.iter().map(Flight::len).sum();
    let every = samples.div_ceil(LOOKED_AT).max(1);
    let mut values: Vec<f64> = of_all(flights, column).step_by(every).map(|(value, _)| value).collect();
    values.sort_unstable_by(f64::total_cmp);
    let within = |share: f64| {
        let tail = (share * values.len() as f64).ceil() as usize;
        Some([*values.get(tail)?, *values.get(values.len().checked_sub(tail + 1)?)?])
    };
    let ([low, high], [lower, upper]) = (within(TAIL)?, within(0.1)?);
    let [low, high] = if upper > lower && high - low > STRETCHED * (upper - lower) { [lower, upper] } else { [low, high] };
    (high > low).then_some([low, high])
}

fn finding(column: Column, spikes: &Spikes, flights: &[Flight]) -> Finding {
    let name = column.name();
    let [low, high] = spikes.range;
    let where_to: Vec<&str> = spikes.flights.iter().map(|&flight| flights[flight].name.as_str()).collect();
    let message = format!(
        "{} {} of {name}, {:.3} s at most in one piece, {} far outside of what it does otherwise, in {}",
        spikes.cells,
        if spikes.cells == 1 { "cell" } else { "cells" },
        spikes.longest_s,
        if spikes.cells == 1 { "is" } else { "are" },
        named(&where_to)
    );
    let rule = format!(
        "[[repair]] columns = [\"{name}\"], valid = [\"value > {low:.4}\", \"value < {high:.4}\"], max_gap_s = {:.3}, with the file's name and in its units",
        1.5 * spikes.longest_s
    );
    Finding {
        name: format!("spikes_{name}"),
        subject: Subject::Conventions,
        verdict: Severity::Fault,
        measured: Some(spikes.cells as f64),
        interval: None,
        expected: Some(0.0),
        unit: "1".into(),
        message,
        set: Some(rule),
        flights: Vec::new(),
    }
}
