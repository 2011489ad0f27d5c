//! Streams that come late: each is moved back in time by whole samples. By how much is stated in `[late]` of the description; finding it out is not
//! this file's business.

use super::Column;
use super::convert::Columns;
use std::collections::BTreeMap;
use std::ops::Range;

/// Moves columns that come late by so many seconds (early, if negative) to where they belong, to the nearest sample. Returns the rows that then
/// have a value of every stream; what stands in the others is the nearest there is.
pub(super) fn in_step(columns: &mut Columns, late: &BTreeMap<Column, f64>, step_s: f64, rows: usize) -> Range<usize> {
    let mut whole = 0..rows;
    for (&column, late_s) in late {
        let Some(values) = &mut columns.canonical[column as usize] else { continue };
        let by = (late_s / step_s).round() as isize;
        let last = rows.saturating_sub(1);
        *values = (0..rows).map(|row| values[row.saturating_add_signed(by).min(last)]).collect();
        whole = whole.start.max((-by).max(0) as usize).min(rows)..whole.end.min(rows.saturating_sub(by.max(0) as usize));
    }
    whole.start..whole.end.max(whole.start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_stream_is_moved_back_and_the_rows_without_it_are_not_used() {
        let ramp = |offset: f64| Some((0..10).map(|row| f64::from(row) - offset).collect::<Vec<f64>>());
        let mut columns = Columns { canonical: Default::default(), extra: BTreeMap::new(), quaternion: false };
        columns.canonical[Column::Vx as usize] = ramp(0.0);
        columns.canonical[Column::Wx as usize] = ramp(3.0);
        columns.canonical[Column::U1 as usize] = ramp(-2.0);
        let late = BTreeMap::from([(Column::Wx, 0.3), (Column::U1, -0.2)]);
        let rows = in_step(&mut columns, &late, 0.1, 10);
        assert_eq!(rows, 2..7);
        for row in rows {
            let at = |column: Column| columns.get(column).expect("set above")[row];
            assert_eq!([at(Column::Vx), at(Column::Wx), at(Column::U1)], [row as f64; 3]);
        }
        assert_eq!(in_step(&mut columns, &BTreeMap::from([(Column::Vx, 1.0)]), 0.01, 10).len(), 0);
    }
}
