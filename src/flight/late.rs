//! Streams that come late: each is moved back in time, by whole samples, or, where it drifts, to between samples. By how much is stated in `[late]` and
//! `[drift]` of the description; finding it out is not this file's business.

use super::Column;
use super::convert::Columns;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;

/// By how much a stream comes later than the rest: at a time t since the log's first row by s + drift · t, s (negative: earlier).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Late {
    /// At the first row, s.
    pub s: f64,
    /// How that grows, s for each second.
    pub drift: f64,
}

impl Late {
    /// The same where rows are counted from another one, so many seconds later.
    pub fn after(self, since_s: f64) -> Self {
        Self { s: self.s + self.drift * since_s, ..self }
    }

    /// The largest delay within so many seconds, either way, s.
    pub fn most_s(self, duration_s: f64) -> f64 {
        self.s.abs().max((self.s + self.drift * duration_s).abs())
    }

    /// How many rows later stands what belongs to this row: it was written at t' = t + s + drift · t'.
    fn rows(self, row: usize, step_s: f64) -> f64 {
        (self.s / step_s + self.drift * row as f64) / (1.0 - self.drift)
    }

    /// The row nearest to that.
    fn nearest(self, row: usize, step_s: f64) -> isize {
        row as isize + self.rows(row, step_s).round() as isize
    }
}

impl fmt::Display for Late {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} s", self.s)?;
        if self.drift == 0.0 { Ok(()) } else { write!(f, " and {:+.3} ms each second", 1e3 * self.drift) }
    }
}

/// What belongs to a row, from straight lines between samples; past the ends what stands there.
fn between(values: &[f64], row: f64) -> f64 {
    let row = row.clamp(0.0, values.len().saturating_sub(1) as f64);
    let (before, part) = (row as usize, row.fract());
    let value = values[before];
    if part == 0.0 { value } else { value + part * (values[before + 1] - value) }
}

/// By how many rows what belongs to a row stands before it at most, and behind it, in so many rows.
pub(super) fn reach(late: &BTreeMap<Column, Late>, rows: usize, step_s: f64) -> [usize; 2] {
    let ends = [0, rows.saturating_sub(1)];
    let moves = late.values().flat_map(|late| ends.map(|row| late.nearest(row, step_s) - row as isize));
    moves.fold([0, 0], |[before, behind], by| [before.max((-by).max(0).unsigned_abs()), behind.max(by.max(0).unsigned_abs())])
}

/// Moves columns that come late by so much (early, if negative) to where they belong, to the nearest sample, and with them the further columns
/// that nothing else is made of. A stream that drifts would be off by up to half a sample, now here and now there, which is a lag to whoever looks for one:
/// but for angles, which go round, such a canonical column is taken from between its samples.
///
/// A column in `filtered` is made by a formula that remembers: one of linear phase that is late by s remembers twice as long, and has no value before.
///
/// Returns the rows that then have a value of every stream (what stands in the others is the nearest there is), and the names of the further columns.
pub(super) fn in_step(
    columns: &mut Columns,
    late: &BTreeMap<Column, Late>,
    filtered: &BTreeSet<Column>,
    step_s: f64,
    rows: usize,
) -> (Range<usize>, Vec<String>) {
    let last = rows.saturating_sub(1);
    let moved = |values: &[f64], late: Late| -> Vec<f64> {
        (0..rows).map(|row| values[late.nearest(row, step_s).clamp(0, last as isize) as usize]).collect()
    };
    let mut whole = 0..rows;
    for (&column, &late) in late {
        let Some(values) = &mut columns.canonical[column as usize] else { continue };
        let is_angle = [Column::Roll, Column::Pitch, Column::Yaw].contains(&column);
        *values = if late.drift == 0.0 || is_angle {
            moved(values, late)
        } else {
            (0..rows).map(|row| between(values, row as f64 + late.rows(row, step_s))).collect()
        };
        let remembers = if filtered.contains(&column) { 2 * late.nearest(0, step_s).max(0) } else { 0 };
        let is_there = |row: &usize| (remembers..rows as isize).contains(&late.nearest(*row, step_s));
        let first = (0..rows).find(is_there).unwrap_or(rows);
        let end = (first..rows).rev().find(is_there).map_or(first, |row| row + 1);
        whole = whole.start.max(first)..whole.end.min(end);
    }
    let mut with_them = Vec::new();
    for (name, values) in &mut columns.extra {
        let Some(made) = columns.made.get(name) else { continue };
        let mut of_made = made.iter().map(|column| late.get(column).copied().unwrap_or_default());
        if let Some(first) = of_made.next()
            && first != Late::default()
            && of_made.all(|other| other == first)
        {
            *values = moved(values, first);
            with_them.push(name.clone());
        }
    }
    (whole.start..whole.end.max(whole.start), with_them)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_stream_is_moved_back_and_the_rows_without_it_are_not_used() {
        let ramp = |offset: f64| Some((0..10).map(|row| f64::from(row) - offset).collect::<Vec<f64>>());
        let extra = ["rotor", "battery", "wind"].map(|name| (name.to_owned(), ramp(-2.0).expect("made")));
        let made = [("rotor", vec![Column::U1]), ("battery", vec![Column::U1, Column::Vx])];
        let made = made.map(|(name, of)| (name.to_owned(), of.into_iter().collect())).into();
        let mut columns = Columns { canonical: Default::default(), extra: extra.into(), made, quaternion: false };
        columns.canonical[Column::Vx as usize] = ramp(0.0);
        columns.canonical[Column::Wx as usize] = ramp(3.0);
        columns.canonical[Column::U1 as usize] = ramp(-2.0);
        let constant = |s: f64| Late { s, drift: 0.0 };
        let late = BTreeMap::from([(Column::Wx, constant(0.3)), (Column::U1, constant(-0.2))]);
        let (rows, with_them) = in_step(&mut columns, &late, &BTreeSet::new(), 0.1, 10);
        assert_eq!((rows.clone(), with_them), (2..7, vec!["rotor".to_owned()]));
        for row in rows {
            let at = |column: Column| columns.get(column).expect("set above")[row];
            assert_eq!([at(Column::Vx), at(Column::Wx), at(Column::U1), columns.extra["rotor"][row]], [row as f64; 4]);
            // One of which something is made that is in time, and one of which nothing is, stay.
            assert_eq!([columns.extra["battery"][row], columns.extra["wind"][row]], [row as f64 + 2.0; 2]);
        }
        assert_eq!(in_step(&mut columns, &BTreeMap::from([(Column::Vx, constant(1.0))]), &BTreeSet::new(), 0.01, 10).0.len(), 0);
    }

    #[test]
    fn rows_of_a_filter_that_has_no_past_yet_are_not_used() {
        for (filtered, whole) in [(BTreeSet::new(), 0..17), (BTreeSet::from([Column::Wx]), 3..17)] {
            let mut columns =
                Columns { canonical: Default::default(), extra: BTreeMap::new(), made: BTreeMap::new(), quaternion: false };
            columns.canonical[Column::Wx as usize] = Some(vec![1.0; 20]);
            let late = BTreeMap::from([(Column::Wx, Late { s: 0.3, drift: 0.0 })]);
            assert_eq!(in_step(&mut columns, &late, &filtered, 0.1, 20).0, whole);
        }
    }

    #[test]
    fn a_stream_with_a_clock_of_its_own_is_stretched() {
        let (rows, step_s) = (2000, 0.01);
        for drift in [-0.005, 0.0, 0.02] {
            let late = Late { s: 0.05, drift };
            // What is written at t' belongs to t' − late(t').
            let written = |row: usize| row as f64 * step_s - late.s - drift * row as f64 * step_s;
            let mut columns =
                Columns { canonical: Default::default(), extra: BTreeMap::new(), made: BTreeMap::new(), quaternion: false };
            columns.canonical[Column::U3 as usize] = Some((0..rows).map(written).collect());
            let (whole, _) = in_step(&mut columns, &BTreeMap::from([(Column::U3, late)]), &BTreeSet::new(), step_s, rows);
            assert!(whole.len() as f64 > 0.97 * rows as f64, "{drift}: {whole:?}");
            let values = columns.get(Column::U3).expect("set above");
            let inner = whole.start + 1..whole.end - 1;
            let exact = |row: usize| drift == 0.0 || (values[row] - row as f64 * step_s).abs() < 1e-9;
            assert!(inner.into_iter().all(exact), "{drift}");
            assert!(whole.into_iter().all(|row| (values[row] - row as f64 * step_s).abs() < 0.0051), "{drift}");
        }
    }
}
