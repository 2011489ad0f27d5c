//! Packets of one sensor that were lost: its columns are 0 all at once, or all repeat the row before for a while, and then leap back. Where all that is measured
//! stands still, or all sticks, it is the recorder or the receiver: that is the business of `dropouts`; streams that are slow throughout are that of `streams`.

use super::dropouts::{JUMP, JUMPING, LEAP, LONG_S, MUCH, usual_change};
use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, named};
use crate::flight::{Column, Flight};

/// A longer run of zeros, s, is a rest.
const LONGEST_S: f64 = 2.0;
/// So many such runs, in all flights, are no chance.
const FEWEST: usize = 3;
/// A stream of which more rows repeat the row before is slow, not lost now and then.
const SLOW: f64 = 0.4;
/// Where one lasted longer, s, no straight line bridges it, and flights are cut at those that last half as long.
const BRIDGED_S: f64 = 1.0;

const POSE: [Column; 6] = [Column::X, Column::Y, Column::Z, Column::Roll, Column::Pitch, Column::Yaw];

/// What comes in one packet, the more before its parts.
const PACKETS: [(&str, &[Column]); 7] = [
    ("position and attitude", &POSE),
    ("position", POSE.split_at(3).0),
    ("attitude", POSE.split_at(3).1),
    ("velocity", &[Column::Vx, Column::Vy, Column::Vz]),
    ("rates", &[Column::Wx, Column::Wy, Column::Wz]),
    ("linear accelerations", &[Column::VxDot, Column::VyDot, Column::VzDot]),
    ("angular accelerations", &[Column::WxDot, Column::WyDot, Column::WzDot]),
];

/// How a recorder fills the rows of a packet that it did not get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Filled {
    Zero,
    Held,
}

/// Runs of lost packets: how many, in how many rows, and the longest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Runs {
    times: usize,
    rows: usize,
    longest: usize,
}

/// A finding for each packet that was lost, and the flights in which it was.
pub(super) fn findings(flights: &[Flight]) -> Vec<(Finding, Vec<usize>)> {
    let mut found = Vec::new();
    for filled in [Filled::Zero, Filled::Held] {
        let mut told: Vec<Column> = Vec::new();
        for (name, columns) in PACKETS {
            if columns.iter().all(|column| told.contains(column)) {
                continue;
            }
            if let Some(one) = of_packet(flights, name, columns, filled) {
                told.extend(columns);
                found.push(one);
            }
        }
    }
    found
}

fn of_packet(flights: &[Flight], name: &str, columns: &[Column], filled: Filled) -> Option<(Finding, Vec<usize>)> {
    if columns.iter().any(|column| flights.iter().any(|flight| flight.absent.contains(column))) {
        return None;
    }
    let each = flights.iter().enumerate().map(|(index, flight)| {
        let values: Vec<&[f64]> = columns.iter().map(|column| flight.column(*column)).collect();
        let others: Vec<&[f64]> = others(columns).map(|column| flight.column(column)).collect();
        let runs = runs(&values, &others, filled, flight.step_s);
        flight.rest();
        (index, runs, flight)
    });
    let lost: Vec<(usize, Runs, &Flight)> = each.filter(|(_, runs, _)| runs.times > 0).collect();
    let times: usize = lost.iter().map(|(_, runs, _)| runs.times).sum();
    let rows: usize = lost.iter().map(|(_, runs, _)| runs.rows).sum();
    let longest_s = lost.iter().map(|(_, runs, flight)| runs.longest as f64 * flight.step_s).reduce(f64::max)?;
    let of_them = rows as f64 / lost.iter().map(|(_, _, flight)| flight.len()).sum::<usize>() as f64;
    if times < FEWEST {
        return None;
    }
    let names: Vec<&str> = lost.iter().map(|(_, _, flight)| flight.name.as_str()).collect();
    let place = if lost.len() as f64 > MOST * flights.len() as f64 { String::new() } else { format!("in {}: ", named(&names)) };
    let (stem, how, key) = match filled {
        Filled::Zero => ("zeros", "are 0 all at once", "zero"),
        Filled::Held => ("held_packets", "are frozen, each at its last value,", "held"),
    };
    let list: Vec<&str> = columns.iter().map(|column| column.name()).collect();
    let message = format!(
        "{place}{name} ({}) {how} {times} times, for up to {longest_s:.2} s, {:.1} % of these flights, and leap back while the rest moves on: nothing was received",
        list.join(", "),
        100.0 * of_them
    );
    let bridged = if longest_s <= BRIDGED_S {
        format!("max_gap_s = {:.3}", 1.5 * longest_s)
    } else {
        format!("max_gap_s = {:.3}, longer = \"cut\"", 0.5 * BRIDGED_S)
    };
    let rule = format!("[[repair]] columns = {list:?}, {key} = true, {bridged}, with the file's names");
    let verdict = if of_them > MUCH { Severity::Fault } else { Severity::Warning };
    let first = columns.first().map_or("", |column| column.name());
    Some((finding(&format!("{stem}_{first}"), verdict, message, Some(&rule)), lost.iter().map(|(index, ..)| *index).collect()))
}

/// What is measured besides.
fn others(columns: &[Column]) -> impl Iterator<Item = Column> {
    let state = [Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz].into_iter().chain(POSE);
    state.filter(|column| !columns.contains(column))
}

/// Runs of rows that were filled so, between rows from which the columns leap, while something else moves.
fn runs(values: &[&[f64]], others: &[&[f64]], filled: Filled, step_s: f64) -> Runs {
    let usual: Vec<f64> = values.iter().map(|values| usual_change(values)).collect();
    let rows = values.first().map_or(0, |values| values.len());
    let is_filled = |row: usize| match filled {
        Filled::Zero => values.iter().all(|values| values[row] == 0.0),
        Filled::Held => {
            row > 0 && values.iter().all(|values| values[row] == values[row - 1]) && values.iter().any(|values| values[row] != 0.0)
        }
    };
    let (least, most, times) = match filled {
        Filled::Zero => (1, LONGEST_S / step_s, LEAP),
        Filled::Held => ((LONG_S / step_s).ceil().max(2.0) as usize, f64::INFINITY, JUMP),
    };
    let leaps = |row: usize| {
        let leap = |(values, usual): (&&[f64], &f64)| (values[row] - values[row - 1]).abs() > times * usual;
        row > 0 && row < rows && values.iter().zip(&usual).filter(|pair| leap((pair.0, pair.1))).count() >= JUMPING
    };
    let moves = |from: usize, to: usize| others.iter().any(|values| values[from..to].windows(2).any(|pair| pair[0] != pair[1]));
    let (mut found, mut standing, mut row) = (Runs::default(), 0, 0);
    while row < rows {
        let run = (row..rows).take_while(|row| is_filled(*row)).count();
        standing += run;
        let is_bounded = match filled {
            Filled::Zero => leaps(row) && (leaps(row + run) || row + run == rows),
            Filled::Held => leaps(row + run),
        };
        if run >= least && run as f64 <= most && is_bounded && moves(row.saturating_sub(1), row + run) {
            found = Runs { times: found.times + 1, rows: found.rows + run, longest: found.longest.max(run) };
        }
        row += run.max(1);
    }
    if filled == Filled::Held && standing as f64 > SLOW * rows as f64 { Runs::default() } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three columns that move, and one beside them.
    fn series() -> ([Vec<f64>; 3], Vec<f64>) {
        let of = |phase: f64| (0..1000).map(|row| 1.0 + (0.02 * row as f64 + phase).sin()).collect();
        ([of(0.1), of(1.0), of(2.0)], of(3.0))
    }

    fn found(change: impl Fn(&mut [Vec<f64>; 3]), filled: Filled) -> Runs {
        let (mut columns, other) = series();
        change(&mut columns);
        let values: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        runs(&values, &[&other], filled, 0.01)
    }

    fn in_runs(columns: &mut [Vec<f64>; 3], value: impl Fn(&[f64], usize) -> f64) {
        for values in columns {
            for start in [100, 300, 500] {
                let with = value(values, start);
                values[start..start + 40].fill(with);
            }
        }
    }

    #[test]
    fn runs_of_zeros_and_of_repeated_rows_are_counted_and_told_from_each_other() {
        let expected = Runs { times: 3, rows: 120, longest: 40 };
        assert_eq!(found(|columns| in_runs(columns, |_, _| 0.0), Filled::Zero), expected);
        let held = |columns: &mut [Vec<f64>; 3]| in_runs(columns, |values, start| values[start - 1]);
        assert_eq!(found(held, Filled::Held), expected);
        assert_eq!(found(held, Filled::Zero), Runs::default());
        assert_eq!([Filled::Zero, Filled::Held].map(|filled| found(|_| {}, filled)), [Runs::default(); 2]);
    }

    #[test]
    fn one_column_at_zero_and_a_slow_stream_are_no_lost_packets() {
        assert_eq!(found(|columns| columns[0][100..140].fill(0.0), Filled::Zero), Runs::default());
        let slow = |columns: &mut [Vec<f64>; 3]| {
            columns.iter_mut().for_each(|values| (0..values.len()).for_each(|row| values[row] = values[row - row % 20]));
        };
        assert_eq!(found(slow, Filled::Held), Runs::default());
    }
}
