//! The decisions on a log, one after the other: names, time, motion (in `motion`), the range of the controls.

use super::assign::{Assigned, Found, assign};
use super::consistency::Rows;
use super::text::Draft;
use super::{Guess, Unknown};
use crate::flight::table::RawTable;
use std::collections::BTreeSet;
use std::ops::Range;

/// Rows that are looked at: ten minutes at 100 Hz.
const MOST_ROWS: usize = 60_000;
/// Fewer say nothing.
const LEAST_ROWS: usize = 200;
/// Rates of logs, Hz, to tell units of time apart.
const USUAL_HZ: std::ops::RangeInclusive<f64> = 8.0..=5000.0;
/// Steps that differ by more are no constant ones.
const JITTER: f64 = 0.01;

/// What is being made.
pub(super) struct State<'a> {
    pub table: &'a RawTable,
    pub assigned: Assigned,
    pub draft: Draft,
    pub sure: Vec<String>,
    pub unknown: Vec<Unknown>,
    pub rows: Range<usize>,
    pub step_s: f64,
}

/// Decides all that the numbers of a log decide.
pub(super) fn decide(log: &str, table: &RawTable, texts: &BTreeSet<String>) -> Guess {
    let mut state = State {
        table,
        assigned: assign(&table.names),
        draft: Draft::default(),
        sure: Vec::new(),
        unknown: Vec::new(),
        rows: 0..0,
        step_s: 0.0,
    };
    if !texts.is_empty() {
        state.draft.list("ignore", texts.iter().map(String::as_str), "They hold text.");
    }
    state.names();
    if state.time() {
        state.motion();
    }
    state.controls();
    Guess { log: log.into(), text: state.draft.text(log), sure: state.sure, unknown: state.unknown }
}

impl State<'_> {
    pub fn doubt(&mut self, what: impl Into<String>, how: impl Into<String>) {
        self.unknown.push(Unknown { what: what.into(), how: how.into() });
    }

    pub fn has(&self, name: &str) -> bool {
        self.assigned.columns.contains_key(name)
    }

    fn lacks(&self, names: &[&str]) -> Vec<String> {
        names.iter().filter(|name| !self.has(name)).map(|name| (*name).to_owned()).collect()
    }

    pub fn hint(&self, name: &str) -> Option<&'static str> {
        self.assigned.columns.get(name).and_then(|found| found.unit)
    }

    pub fn values(&self, name: &str) -> Option<&[f64]> {
        self.assigned.columns.get(name).and_then(|found| self.table.column(&found.name)).map(|values| &values[self.rows.clone()])
    }

    pub fn triple(&self, names: [&str; 3]) -> Option<Rows> {
        let [a, b, c] = names.map(|name| self.values(name));
        let (a, b, c) = (a?, b?, c?);
        Some((0..a.len()).map(|row| [a[row], b[row], c[row]]).collect())
    }

    /// Columns that have other names here, and those that are not there.
    fn names(&mut self) {
        let renamed: Vec<(&'static str, Found)> =
            self.assigned.columns.iter().filter(|(name, found)| **name != found.name).map(|(n, f)| (*n, f.clone())).collect();
        renamed.iter().for_each(|(name, found)| self.draft.column(name, &found.name));
        let others = self.assigned.others.iter().take(12).cloned().collect::<Vec<_>>().join(", ");
        let mut needed = self.lacks(&["t", "vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4"]);
        if !self.has("q1") {
            needed.extend(self.lacks(&["roll", "pitch"]));
        }
        if !needed.is_empty() {
            let how = format!(
                "under [columns], with the name of the file's column or a formula of several, as u1 = \"(m3 + m4 - m1 - m2) / 4\"; of no known name are: {others}"
            );
            self.doubt(format!("which columns are {}", needed.join(", ")), how);
        }
        let mut missing = self.lacks(&["x", "y", "z"]);
        if !self.has("q1") && !self.has("yaw") {
            missing.push("yaw".into());
        }
        let (linear, angular) = (self.has("vx_dot"), self.has("wx_dot"));
        match (linear, angular) {
            (true, false) => missing.extend(["wx_dot", "wy_dot", "wz_dot"].map(str::to_owned)),
            (false, true) => missing.extend(["vx_dot", "vy_dot", "vz_dot"].map(str::to_owned)),
            _ => {}
        }
        if !missing.is_empty() {
            self.draft.list("missing", missing.iter().map(String::as_str), "No column has a name for these.");
        }
    }

    /// Unit and step of time, and the rows that are looked at. False if nothing can be asked of the log.
    fn time(&mut self) -> bool {
        let column = |name: &str| self.assigned.columns.get(name).and_then(|found| self.table.column(&found.name));
        let Some(time) = column("t") else { return false };
        let used = self.assigned.columns.values().filter_map(|found| self.table.column(&found.name));
        let mut finite = vec![true; time.len()];
        used.for_each(|values| finite.iter_mut().zip(values).for_each(|(finite, value)| *finite &= value.is_finite()));
        let (mut longest, mut start) = (0..0, 0);
        for row in 0..=finite.len() {
            let goes_on = row < finite.len() && finite[row] && (row == start || time[row] > time[row - 1]);
            if !goes_on {
                if row - start > longest.len() {
                    longest = start..row;
                }
                start = if row < finite.len() && finite[row] { row } else { row + 1 };
            }
        }
        let spare = longest.len().saturating_sub(MOST_ROWS) / 2;
        self.rows = longest.start + spare..longest.end - spare;
        let times = &time[self.rows.clone()];
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if steps.len() < LEAST_ROWS {
            self.doubt(
                format!(
                    "anything beyond the names: only {} rows in a row have numbers in all columns and time that increases",
                    times.len()
                ),
                "a log with more of them, or `[[repair]]` for the columns with bad cells",
            );
            return false;
        }
        let mean = (times[times.len() - 1] - times[0]) / steps.len() as f64;
        let middle = steps.len() / 2;
        let step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let units = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
        let hinted = self.hint("t").and_then(|hint| units.into_iter().find(|unit| unit.0 == hint));
        let usual = |unit: &(&str, f64)| USUAL_HZ.contains(&(step * unit.1).recip());
        let Some((unit, factor)) = hinted.filter(usual).or_else(|| units.into_iter().find(usual)) else {
            self.doubt(format!("the unit of time: steps of {step} are none of a log in s, ms, us or ns"), "[units] time");
            return false;
        };
        self.step_s = step * factor;
        let hz = self.step_s.recip();
        if unit != "s" {
            self.draft.unit("time", unit, format!("Steps of {step} {unit} are {hz:.0} Hz."));
        }
        self.sure.push(format!("time is in {unit}, {hz:.1} samples a second"));
        let uneven = steps.iter().filter(|other| (**other / step - 1.0).abs() > JITTER).count();
        if uneven as f64 > JITTER * steps.len() as f64 {
            let rate = (mean * factor).recip();
            self.draft.key(
                "resample_hz",
                &format!("{:.0}", rate.round()),
                &format!("{uneven} of {} steps differ by more than 1 %.", steps.len()),
            );
        }
        self.step_s = mean * factor;
        true
    }

    /// Their range; what they move is asked of the whole set.
    fn controls(&mut self) {
        let names = ["u1", "u2", "u3", "u4"];
        let found: Vec<(&'static str, Found)> =
            names.iter().filter_map(|name| Some((*name, self.assigned.columns.get(name)?.clone()))).collect();
        let finite =
            |found: &Found| self.table.column(&found.name).unwrap_or_default().iter().copied().filter(|value| value.is_finite());
        let values = found.iter().flat_map(|(_, found)| finite(found));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(u), high.max(u)));
        if found.len() < names.len() || low > high {
            return;
        }
        if low >= 700.0 && high <= 2300.0 {
            self.draft.forget_columns(&names);
            let pulse = |name: &str| format!("({} - 1500) / 500", crate::formula::quoted(name));
            found.iter().for_each(|(name, found)| self.draft.column(name, &pulse(&found.name)));
            self.sure.push(format!("controls are servo pulses in us, from {low:.0} to {high:.0}"));
        } else if low >= -150.0 && high <= 150.0 && high.max(-low) > 3.0 {
            self.draft.unit("controls", "%", format!("They reach from {low:.0} to {high:.0}."));
            self.sure.push(format!("controls are in percent, from {low:.0} to {high:.0}"));
        } else if low < -3.0 || high > 3.0 {
            self.doubt(
                format!("the scale of the controls, which reach from {low} to {high}"),
                "[columns], with a formula that brings them to about -1 to 1",
            );
        }
    }
}
