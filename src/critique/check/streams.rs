//! Streams that hold less than the log they stand in: a value frozen for seconds, one held from each sample of a slower stream to the next, one
//! rounded coarsely. All are seen in a column by itself, without physics.

use super::odd::in_flights;
use super::report::{Finding, Verdict};
use super::{finding, of_all};
use crate::flight::{Column, Flight};
use std::ops::Range;

/// A column that rests this long, s …
const FROZEN_S: f64 = 2.0;
/// … and so many times as long as it usually does, is frozen if the others move.
const UNUSUAL: usize = 20;
/// A stream is held if this share of its rests is a multiple of the usual one.
const REGULAR: f64 = 0.9;
/// Held this long, s, a stream that the physics reads is late by as much as the lags of an aircraft.
const LONG_S: f64 = 0.05;
/// Rests longer than this many samples are counted as one kind.
const LONGEST: usize = 4096;
/// Values that the grain of a column is taken from, at most.
const LOOKED_AT: usize = 20_000;
/// So many samples to each value that occurs, where a column is rounded.
const PER_VALUE: usize = 10;
/// Rounding by this share of the variance of a column is worth a word …
const NOTICED: f64 = 1e-3;
/// … and by this share makes effects of its own.
const COARSE: f64 = 1e-2;

/// How findings of held streams begin.
pub(super) const HELD: &str = "held_";

/// Columns whose rests mean something: a stick may rest.
const MEASURED: [Column; 18] = [
    Column::X,
    Column::Y,
    Column::Z,
    Column::Roll,
    Column::Pitch,
    Column::Yaw,
    Column::Vx,
    Column::Vy,
    Column::Vz,
    Column::Wx,
    Column::Wy,
    Column::Wz,
    Column::VxDot,
    Column::VyDot,
    Column::VzDot,
    Column::WxDot,
    Column::WyDot,
    Column::WzDot,
];
/// Position matters for the height above ground alone.
const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];
/// What the physics is driven by.
const DRIVING: [Column; 13] = [
    Column::Roll,
    Column::Pitch,
    Column::Yaw,
    Column::Vx,
    Column::Vy,
    Column::Vz,
    Column::Wx,
    Column::Wy,
    Column::Wz,
    Column::U1,
    Column::U2,
    Column::U3,
    Column::U4,
];

/// Frozen, held and rounded columns.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let present = |column: &Column| flights.iter().all(|flight| !flight.absent.contains(column));
    let grains: Vec<(Column, Option<f64>)> =
        DRIVING.into_iter().filter(present).map(|column| (column, grain(flights, column))).collect();
    let is_rounded = |column: Column| grains.iter().any(|entry| entry.0 == column && entry.1.is_some());
    let mut findings = Vec::new();
    let mut held: Vec<(f64, Vec<Column>)> = Vec::new();
    for column in MEASURED.into_iter().filter(present) {
        let rests = Rests::of(flights, column);
        findings.extend(rests.frozen(flights, column));
        let Some(hold_s) = rests.held(flights).filter(|_| !is_rounded(column)) else { continue };
        match held.iter_mut().find(|(other, _)| *other == hold_s) {
            Some((_, columns)) => columns.push(column),
            None => held.push((hold_s, vec![column])),
        }
    }
    findings.extend(held.into_iter().map(|(hold_s, columns)| of_hold(hold_s, &columns)));
    findings.extend(grains.into_iter().filter_map(|(column, grain)| of_grain(flights, column, grain?)));
    findings
}

/// How long a column keeps a value: how often for each number of samples, and the longest time in each flight.
struct Rests {
    counts: Vec<usize>,
    longest: Vec<Range<usize>>,
}

impl Rests {
    fn of(flights: &[Flight], column: Column) -> Self {
        let mut counts = vec![0; LONGEST + 1];
        let longest = flights.iter().map(|flight| {
            let mut longest = 0..0;
            let mut start = 0;
            for rest in flight.column(column).chunk_by(|one, next| one == next) {
                counts[rest.len().min(LONGEST)] += 1;
                if rest.len() > longest.len() {
                    longest = start..start + rest.len();
                }
                start += rest.len();
            }
            flight.rest();
            longest
        });
        let longest = longest.collect();
        Self { counts, longest }
    }

    /// The rest to which half of all samples belong at most.
    fn usual(&self) -> usize {
        let samples: usize = self.counts.iter().enumerate().map(|(length, count)| length * count).sum();
        let mut sum = 0;
        let below = self.counts.iter().enumerate().take_while(|(length, count)| {
            sum += length * *count;
            2 * sum < samples
        });
        below.count()
    }

    fn frozen(&self, flights: &[Flight], column: Column) -> Option<Finding> {
        let usual = self.usual();
        let is_frozen = |(index, rest): &(usize, &Range<usize>)| {
            let flight = &flights[*index];
            let lasts = rest.len() as f64 * flight.step_s >= FROZEN_S && rest.len() >= UNUSUAL * usual;
            let frozen = lasts && others_move(flight, column, rest);
            flight.rest();
            frozen
        };
        let such: Vec<usize> = self.longest.iter().enumerate().filter(is_frozen).map(|entry| entry.0).collect();
        let longest = such.iter().map(|&index| self.longest[index].len() as f64 * flights[index].step_s).fold(0.0, f64::max);
        let name = column.name();
        let message = format!("{name} keeps one value for up to {longest:.1} s while the rest moves: it was not recorded there");
        (!such.is_empty()).then(|| in_flights(&format!("frozen_{name}"), &such, &message, flights))
    }

    /// Time for which each value is held, s, if the column comes from a slower stream.
    fn held(&self, flights: &[Flight]) -> Option<f64> {
        let (hold, _) = self.counts.iter().enumerate().max_by_key(|(_, count)| **count)?;
        let rests: usize = self.counts.iter().sum();
        let regular: usize = self.counts.iter().step_by(hold.max(1)).sum();
        let step_s = flights.first()?.step_s;
        (hold >= 2 && hold < LONGEST && regular as f64 >= REGULAR * rests as f64).then_some(hold as f64 * step_s)
    }
}

/// Whether most other measured columns change within these samples.
fn others_move(flight: &Flight, column: Column, samples: &Range<usize>) -> bool {
    let others = MEASURED.into_iter().filter(|other| *other != column && !flight.absent.contains(other));
    let moves = |other: Column| {
        let values = &flight.column(other)[samples.clone()];
        values.windows(2).filter(|pair| pair[0] != pair[1]).count() * 4 > values.len()
    };
    let (moving, resting): (Vec<Column>, Vec<Column>) = others.partition(|&other| moves(other));
    moving.len() > resting.len()
}

fn of_hold(hold_s: f64, columns: &[Column]) -> Finding {
    let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
    let matters = columns.iter().any(|column| !POSITION.contains(column));
    let verdict = if matters && hold_s > LONG_S { Verdict::Fault } else { Verdict::Warning };
    let message = format!(
        "{} come at {:.3} Hz and are held in between: half of {:.0} ms late on the average",
        names.join(", "),
        1.0 / hold_s,
        1e3 * hold_s
    );
    finding(&format!("{HELD}{}", names[0]), verdict, message, Some(&format!("resample_hz = {:.3}", 1.0 / hold_s)))
}

/// The step to which a column is rounded.
fn grain(flights: &[Flight], column: Column) -> Option<f64> {
    let samples: usize = flights.iter().map(Flight::len).sum();
    let every = samples.div_ceil(LOOKED_AT).max(1);
    let mut values: Vec<f64> = of_all(flights, column).step_by(every).map(|(value, _)| value).collect();
    let looked_at = values.len();
    values.sort_unstable_by(f64::total_cmp);
    let range = values.last()? - values.first()?;
    // Conversion of units leaves the last digits open.
    values.dedup_by(|next, before| *next - *before <= 1e-9 * range);
    if values.len() < 3 || values.len() * PER_VALUE > looked_at {
        return None;
    }
    let gaps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let grain = gaps().fold(f64::INFINITY, f64::min);
    let is_whole = |gap: f64| (gap / grain - (gap / grain).round()).abs() < 0.02 * (gap / grain).round();
    gaps().all(is_whole).then_some(grain)
}

fn of_grain(flights: &[Flight], column: Column, grain: f64) -> Option<Finding> {
    let (count, sum, square) = of_all(flights, column)
        .fold((0.0, 0.0, 0.0), |(count, sum, square), (value, _)| (count + 1.0, sum + value, square + value * value));
    let variance: f64 = square / count - (sum / count) * (sum / count);
    // An error that is as likely anywhere within a step has a twelfth of its square as variance.
    let share = grain * grain / 12.0 / variance;
    if !(share > NOTICED && share.is_finite()) {
        return None;
    }
    let name = column.name();
    let message = format!(
        "{name} is rounded to {grain:.3}, {:.1} % of its variance: what it moves comes out too small by about that, and the rounding can look \
         like an effect of that size",
        100.0 * share
    );
    let verdict = if share > COARSE { Verdict::Fault } else { Verdict::Warning };
    Some(finding(&format!("rounding_{name}"), verdict, message, None))
}
