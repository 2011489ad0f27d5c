//! Known-bad cells of sensor columns, bridged by rules that the dataset description states, and counted. Nothing else is mended.

use super::schema::{Between, Longer, Repair, Schema};
use super::table::RawTable;
use crate::error::Result;
use crate::formula::Value;
use std::ops::Range;

/// What was done to a table.
#[derive(Debug)]
pub(super) struct Repaired {
    /// In words; `None` if no cell was bad.
    pub note: Option<String>,
    /// By row, whether a rule that cuts left a cell of it without a value.
    pub cut: Vec<bool>,
    /// By row, whether it is as near a bridged cell as its rule sets rows aside.
    pub aside: Vec<bool>,
}

/// Applies the rules: runs of bad cells up to the rule's length are interpolated between their good neighbours; bad
/// cells that cannot be (longer runs, ends of the record) become NaN, to be refused if a row in use holds them.
///
/// Returns what was found and done, in words, and the rows at which a rule cuts the flight.
///
/// # Errors
/// [`Error::Cell`](crate::Error::Cell) if a rule's column is not in the file.
pub(super) fn repair(table: &mut RawTable, schema: &Schema, step_s: f64) -> Result<Repaired> {
    let (mut found, mut left, mut longest) = (0, Vec::new(), 0);
    let mut bridged: [Vec<String>; 2] = Default::default();
    let mut cut = vec![false; table.columns.first().map_or(0, Vec::len)];
    let mut aside = cut.clone();
    for rule in &schema.repairs {
        let places: Vec<usize> = rule.columns.iter().map(|name| place(table, name)).collect::<Result<_>>()?;
        let together = together(table, rule, &places);
        for (name, index) in rule.columns.iter().zip(places) {
            let values = &mut table.columns[index];
            let mut bad: Vec<bool> = values.iter().map(|value| !value.is_finite()).collect();
            for formula in &rule.valid {
                let holds = formula.evaluate(values.len(), step_s, &|_| Some(Value::from(values.as_slice())))?;
                // Not equal to one, so that a comparison with NaN counts as bad.
                bad.iter_mut().zip(holds).for_each(|(bad, holds)| *bad |= holds != 1.0);
            }
            bad.iter_mut().zip(&together).for_each(|(bad, together)| *bad |= together);
            if let Some(least) = rule.spike {
                spikes(values, least).for_each(|row| bad[row] = true);
            }
            let count = bridge(values, &bad, rule.max_gap_s / step_s, schema.turn_of(name), rule.between);
            found += count.found;
            longest = longest.max(count.longest_bridged);
            if count.bridged > 0 {
                bridged[rule.between as usize].push(format!("{} of `{name}`", count.bridged));
            }
            if let Some(near_s) = rule.set_aside_s {
                let near = (near_s / step_s).round() as usize;
                let around = |run: &Range<usize>| run.start.saturating_sub(near)..run.end.saturating_add(near).min(aside.len());
                count.runs.iter().map(around).collect::<Vec<_>>().into_iter().for_each(|rows| aside[rows].fill(true));
            }
            if rule.longer == Longer::Cut {
                count.left.iter().for_each(|run| cut[run.clone()].fill(true));
            }
            if count.found > count.bridged {
                left.push(format!("{} of `{name}`", count.found - count.bridged));
            }
        }
    }
    if found == 0 {
        return Ok(Repaired { note: None, cut, aside });
    }
    let mut sentences = Vec::new();
    let longest_s = longest as f64 * step_s;
    for (bridged, how) in bridged.iter().zip(["linearly", "by a cubic"]).filter(|(bridged, _)| !bridged.is_empty()) {
        sentences.push(format!("bad cells interpolated {how}, longest run {longest_s:.3} s: {}", bridged.join(", ")));
    }
    if !left.is_empty() {
        sentences.push(format!("bad cells left without a value: {}", left.join(", ")));
    }
    Ok(Repaired { note: Some(sentences.join("; ")), cut, aside })
}

fn place(table: &RawTable, name: &str) -> Result<usize> {
    table.index(name).ok_or_else(|| {
        let found = "no such column, though a repair rule of dataset.toml names it";
        table.cell_of_header(name, found, format!("one of {}", table.names.join(", ")))
    })
}

/// Rows that are bad in all columns of a rule: each has the value of the row before, or is 0.
fn together(table: &RawTable, rule: &Repair, places: &[usize]) -> Vec<bool> {
    let rows = places.first().map_or(0, |&place| table.columns[place].len());
    let all = |is_so: &dyn Fn(&[f64]) -> bool| places.iter().all(|&place| is_so(&table.columns[place]));
    let is_held = |row: usize| rule.held && row > 0 && all(&|values| values[row] == values[row - 1]);
    let is_zero = |row: usize| rule.zero && all(&|values| values[row] == 0.0);
    (0..rows).map(|row| is_held(row) || is_zero(row)).collect()
}

/// Cells that lie farther than `least` beyond both their neighbours, on the same side.
fn spikes(values: &[f64], least: f64) -> impl Iterator<Item = usize> {
    let sticks_out = move |three: &&[f64]| {
        let [from, to] = [three[1] - three[0], three[1] - three[2]];
        from * to > 0.0 && from.abs().min(to.abs()) > least
    };
    let rows: Vec<usize> = (1..).zip(values.windows(3)).filter(|(_, three)| sticks_out(three)).map(|(row, _)| row).collect();
    rows.into_iter()
}

#[derive(Default)]
struct Count {
    found: usize,
    bridged: usize,
    longest_bridged: usize,
    /// Runs that were bridged.
    runs: Vec<Range<usize>>,
    /// Runs that stay without a value.
    left: Vec<Range<usize>>,
}

/// Bridges runs of at most `longest` samples; in a column in which a `turn` is nothing, the short way round.
fn bridge(values: &mut [f64], bad: &[bool], longest: f64, turn: Option<f64>, between: Between) -> Count {
    let mut count = Count::default();
    // The good cell before the one at the start of a run.
    let mut earlier: Option<(usize, f64)> = None;
    let mut start = 0;
    while let Some(offset) = bad[start..].iter().position(|&bad| bad) {
        let first = start + offset;
        let length = bad[first..].iter().position(|&bad| !bad).unwrap_or(bad.len() - first);
        let end = first + length;
        count.found += length;
        earlier = if offset > 1 { Some((first - 2, values[first - 2])) } else { earlier };
        // A hundredth of a sample for the rounding of the quotient.
        if first > 0 && end < values.len() && length as f64 <= longest + 0.01 {
            let before = values[first - 1];
            let beyond = (end + 1..bad.len()).find(|&row| !bad[row]).map(|row| (row, values[row]));
            let shape = match between {
                Between::Line => Shape::line(first - 1, before, end, values[end], turn),
                Between::Cubic => Shape::line(first - 1, before, end, values[end], turn).curved(earlier, beyond, turn),
            };
            (first..end).for_each(|row| values[row] = shape.at(row));
            count.bridged += length;
            count.runs.push(first..end);
            count.longest_bridged = count.longest_bridged.max(length);
        } else {
            values[first..end].fill(f64::NAN);
            count.left.push(first..end);
        }
        earlier = first.checked_sub(1).map(|row| (row, values[row]));
        start = end;
    }
    count
}

/// The short way from one value to another.
fn change(from: f64, to: f64, turn: Option<f64>) -> f64 {
    turn.map_or(to - from, |turn| to - from - turn * ((to - from) / turn).round())
}

/// What lies between two good cells: a cubic with a slope at each end (Hermite).
#[derive(Clone, Copy, Debug)]
struct Shape {
    first: usize,
    value: f64,
    rows: f64,
    change: f64,
    /// A row.
    slopes: [f64; 2],
}

impl Shape {
    fn line(first: usize, value: f64, last: usize, end: f64, turn: Option<f64>) -> Self {
        let (rows, change) = ((last - first) as f64, change(value, end, turn));
        Self { first, value, rows, change, slopes: [change / rows; 2] }
    }

    /// With the slope at each end of the parabola through it, the other end and the good cell beyond; where there is none beyond, as it was.
    fn curved(mut self, earlier: Option<(usize, f64)>, beyond: Option<(usize, f64)>, turn: Option<f64>) -> Self {
        let own = self.change / self.rows;
        let slope = |other: f64, rows: f64| (own * rows + other * self.rows) / (self.rows + rows);
        if let Some((row, value)) = earlier {
            let rows = (self.first - row) as f64;
            self.slopes[0] = slope(change(value, self.value, turn) / rows, rows);
        }
        if let Some((row, value)) = beyond {
            let rows = row as f64 - self.first as f64 - self.rows;
            self.slopes[1] = slope(change(self.value + self.change, value, turn) / rows, rows);
        }
        self
    }

    fn at(&self, row: usize) -> f64 {
        let t = (row - self.first) as f64 / self.rows;
        let [from, to] = self.slopes.map(|slope| slope * self.rows - self.change);
        // What the slopes add to the straight line.
        let bend = t * (1.0 - t) * ((1.0 - t) * from - t * to);
        self.value + self.change * t + bend
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rule(columns: &[&str]) -> Repair {
        let columns = columns.iter().map(|&name| name.to_owned()).collect();
        Repair {
            columns,
            valid: Vec::new(),
            held: false,
            zero: false,
            spike: None,
            max_gap_s: 0.02,
            between: Between::Line,
            longer: Longer::Error,
            set_aside_s: None,
        }
    }

    fn with(rule: Repair) -> Schema {
        Schema { repairs: vec![rule], ..Schema::default() }
    }

    use crate::formula::Formula;

    #[test]
    fn short_runs_are_bridged_long_ones_and_ends_are_not() -> Result<()> {
        let nan = f64::NAN;
        let values = vec![nan, 1.0, nan, 9999.0, 4.0, 5.0, -1.0, nan, nan, 9.0];
        let mut table = RawTable { names: vec!["m1".into()], columns: vec![values], ..RawTable::default() };
        let valid = vec![Formula::parse("value > 0")?, Formula::parse("value < 1000")?];
        let rule = Repair { valid, ..rule(&["m1"]) };
        let Repaired { note, cut, aside } = repair(&mut table, &with(rule), 0.01)?;
        assert!(!aside.contains(&true), "this rule sets nothing aside");
        assert!(!cut.contains(&true), "this rule does not cut");
        let found = &table.columns[0];
        assert_eq!(found[1..6], [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!(found[0].is_nan() && found[6..9].iter().all(|value| value.is_nan()));
        let expected = "bad cells interpolated linearly, longest run 0.020 s: 2 of `m1`; bad cells left without a value: 4 of `m1`";
        assert_eq!(note.as_deref(), Some(expected));
        Ok(())
    }

    #[test]
    fn rows_that_repeat_all_columns_of_a_rule_are_bridged_and_what_stands_still_alone_is_not() -> Result<()> {
        let wx = vec![0.0, 1.0, 1.0, 3.0, 3.0, 5.0, 5.0, 5.0, 5.0, 9.0];
        let wy = vec![2.0, 2.0, 2.0, 4.0, 6.0, 6.0, 6.0, 6.0, 6.0, 8.0];
        let mut table = RawTable { names: vec!["wx".into(), "wy".into()], columns: vec![wx, wy], ..RawTable::default() };
        let rule = Repair { held: true, ..rule(&["wx", "wy"]) };
        let rule = Repair { longer: Longer::Cut, set_aside_s: Some(0.01), ..rule };
        let Repaired { note, cut, aside } = repair(&mut table, &with(rule), 0.01)?;
        // Around row 2, which was bridged; rows 6 to 8 were not.
        assert_eq!((0..10).filter(|&row| aside[row]).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!((0..10).filter(|&row| cut[row]).collect::<Vec<_>>(), [6, 7, 8]);
        // Row 2 repeats row 1; in row 4 wx stands still and wy does not; rows 6 to 8 are longer than can be bridged.
        assert_eq!(table.columns[0][..6], [0.0, 1.0, 2.0, 3.0, 3.0, 5.0]);
        assert_eq!(table.columns[1][..6], [2.0, 2.0, 3.0, 4.0, 6.0, 6.0]);
        assert!(table.columns.iter().all(|values| values[6..9].iter().all(|value| value.is_nan()) && values[9].is_finite()));
        assert!(note.is_some_and(|note| note.contains("1 of `wx`, 1 of `wy`; bad cells left without a value: 3 of `wx`")));
        Ok(())
    }

    #[test]
    fn rows_of_zeros_are_bridged_round_the_turn_and_single_zeros_are_values() -> Result<()> {
        let (yaw, x) = (vec![3.0, 3.1, 0.0, 0.0, -3.0, 0.0], vec![5.0, 0.0, 0.0, 0.0, 2.0, 1.0]);
        let mut table = RawTable { names: vec!["yaw".into(), "x".into()], columns: vec![yaw, x], ..RawTable::default() };
        repair(&mut table, &with(Repair { zero: true, ..rule(&["yaw", "x"]) }), 0.01)?;
        // From 3.1 to −3.0 is 0.183 round the turn.
        let third = (std::f64::consts::TAU - 6.1) / 3.0;
        let expected = [3.0, 3.1, 3.1 + third, 3.1 + 2.0 * third, -3.0, 0.0];
        let near = table.columns[0].iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-5);
        assert!(near, "{:?}", table.columns[0]);
        assert_eq!(table.columns[1][1], 0.0, "yaw was there");
        Ok(())
    }

    proptest! {
        #[test]
        fn a_cubic_is_exact_for_parabolas_at_any_spacing_and_a_line_for_lines(
            [bend, slope, start] in [-2.0..2.0_f64, -3.0..3.0, -1.0..1.0],
            gaps in prop::collection::vec(1..6_usize, 4..12),
        ) {
            let good: Vec<usize> = gaps.iter().scan(0, |row, gap| { *row += gap; Some(*row) }).collect();
            let rows = good[good.len() - 1] + 1;
            let bad: Vec<bool> = (0..rows).map(|row| !good.contains(&row)).collect();
            for (between, bend) in [(Between::Line, 0.0), (Between::Cubic, bend)] {
                let truth = |row: usize| start + slope * row as f64 + bend * (row * row) as f64;
                let mut values: Vec<f64> = (0..rows).map(|row| if bad[row] { 99.0 } else { truth(row) }).collect();
                bridge(&mut values, &bad, 6.0, None, between);
                // The first and the last gap have a slope from one side alone.
                let whole = good[1]..good[good.len() - 2];
                for (row, value) in values.iter().enumerate().filter(|(row, _)| whole.contains(row)) {
                    prop_assert!((value - truth(row)).abs() < 1e-9 * (1.0 + truth(row).abs()), "{between:?} {row}");
                }
            }
        }
    }

    #[test]
    fn a_cubic_goes_the_short_way_round_the_turn() {
        let turn = std::f64::consts::TAU;
        let truth = |row: usize| (2.0 + 0.12 * row as f64) % turn;
        let bad: Vec<bool> = (0..41).map(|row| row % 8 != 0).collect();
        let mut values: Vec<f64> = (0..41).map(|row| if bad[row] { 0.0 } else { truth(row) }).collect();
        bridge(&mut values, &bad, 8.0, Some(turn), Between::Cubic);
        assert!((0..41).all(|row| change(values[row], truth(row), Some(turn)).abs() < 1e-9), "{values:?}");
    }

    #[test]
    fn what_sticks_out_is_a_spike_and_a_step_is_none() -> Result<()> {
        let wx = vec![0.0, 9.0, 0.2, 0.3, 7.0, 7.1, 7.2, -1.0, 7.4];
        let mut table = RawTable { names: vec!["wx".into()], columns: vec![wx], ..RawTable::default() };
        repair(&mut table, &with(Repair { spike: Some(4.0), ..rule(&["wx"]) }), 0.01)?;
        let expected = [0.0, 0.1, 0.2, 0.3, 7.0, 7.1, 7.2, 7.3, 7.4];
        assert!(table.columns[0].iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12), "{table:?}");
        Ok(())
    }
}
