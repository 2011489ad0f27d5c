//! Streams that come late: each is moved back in time by whole samples. By how much is stated in `[late]` of the description; finding it out is not
//! this file's business.

use super::Column;
use super::convert::Columns;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Moves columns that come late by so many seconds (early, if negative) to where they belong, to the nearest sample, and with them the further columns
/// that nothing else is made of. Returns the rows that then have a value of every stream (what stands in the others is the nearest there is), and
/// the names of the further columns.
pub(super) fn in_step(
    columns: &mut Columns,
    late: &BTreeMap<Column, f64>,
    step_s: f64,
    rows: usize,
) -> (Range<usize>, Vec<String>) {
    let samples = |late_s: &f64| (late_s / step_s).round() as isize;
    let moved = |values: &[f64], by: isize| -> Vec<f64> {
        let last = rows.saturating_sub(1);
        (0..rows).map(|row| values[row.saturating_add_signed(by).min(last)]).collect()
    };
    let mut whole = 0..rows;
    for (&column, late_s) in late {
        let Some(values) = &mut columns.canonical[column as usize] else { continue };
        let by = samples(late_s);
        *values = moved(values, by);
        whole = whole.start.max((-by).max(0) as usize).min(rows)..whole.end.min(rows.saturating_sub(by.max(0) as usize));
    }
    let mut with_them = Vec::new();
    for (name, values) in &mut columns.extra {
        let Some(made) = columns.made.get(name) else { continue };
        let by: BTreeSet<isize> = made.iter().map(|column| late.get(column).map_or(0, samples)).collect();
        if let (Some(&by), 1) = (by.first(), by.len())
            && by != 0
        {
            *values = moved(values, by);
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
        let late = BTreeMap::from([(Column::Wx, 0.3), (Column::U1, -0.2)]);
        let (rows, with_them) = in_step(&mut columns, &late, 0.1, 10);
        assert_eq!((rows.clone(), with_them), (2..7, vec!["rotor".to_owned()]));
        for row in rows {
            let at = |column: Column| columns.get(column).expect("set above")[row];
            assert_eq!([at(Column::Vx), at(Column::Wx), at(Column::U1), columns.extra["rotor"][row]], [row as f64; 4]);
            // One of which something is made that is in time, and one of which nothing is, stay.
            assert_eq!([columns.extra["battery"][row], columns.extra["wind"][row]], [row as f64 + 2.0; 2]);
        }
        assert_eq!(in_step(&mut columns, &BTreeMap::from([(Column::Vx, 1.0)]), 0.01, 10).0.len(), 0);
    }
}
