//! Streams that were brought to the rate of the log by straight lines from one sample of a slower stream to the next. Those that are held instead are the
//! business of `streams`.

use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, in_flights};
use super::robust::median;
use crate::flight::{Column, Flight};
use std::collections::BTreeMap;

/// Three samples stand in a line where the change of slope is this part of the usual slope at most.
const STRAIGHT: f64 = 1e-4;
/// Of an interpolated stream so many of the samples that move stand in lines …
const MOSTLY: f64 = 0.6;
/// … and this share of the pieces between corners is a multiple of the usual one.
const REGULAR: f64 = 0.8;
/// Corners at least.
const FEWEST: usize = 20;
/// Samples of a flight that are looked at, at most.
const LOOKED_AT: usize = 3_000;
/// From this period on, s, lines hide what an aircraft does.
const LONG_S: f64 = 0.05;

/// How findings of such streams begin.
pub(super) const INTERPOLATED: &str = "interpolated_";

/// Streams of less than the log's rate, a finding for each rate.
pub(super) fn findings(flights: &[Flight], is_rounded: &dyn Fn(Column) -> bool) -> Vec<Finding> {
    let present = |column: &Column| flights.iter().all(|flight| !flight.absent.contains(column)) && !is_rounded(*column);
    let mut by_rate: BTreeMap<(usize, Vec<usize>), Vec<Column>> = BTreeMap::new();
    for column in Column::ALL.into_iter().filter(present) {
        let each = flights.iter().enumerate().map(|(index, flight)| {
            let values = flight.column(column);
            let period = period(&values[..values.len().min(LOOKED_AT)]);
            flight.rest();
            (index, period)
        });
        let such: Vec<(usize, usize)> = each.filter_map(|(index, period)| Some((index, period?))).collect();
        let Some(period) = median(such.iter().map(|entry| entry.1 as f64).collect()) else { continue };
        let indices: Vec<usize> = such.iter().filter(|entry| entry.1 as f64 == period).map(|entry| entry.0).collect();
        by_rate.entry((period as usize, indices)).or_default().push(column);
    }
    by_rate.into_iter().filter_map(|((period, indices), columns)| told(flights, period, &indices, &columns)).collect()
}

/// Samples from corner to corner, where the rest is straight.
fn period(values: &[f64]) -> Option<usize> {
    let slopes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|slope| *slope > 0.0);
    let least = STRAIGHT * median(slopes.collect())?;
    let (mut corners, mut moving, mut last) = (BTreeMap::<usize, usize>::new(), 0_usize, None);
    for (sample, three) in values.windows(3).enumerate() {
        let [before, after] = [three[1] - three[0], three[2] - three[1]];
        moving += usize::from(before != 0.0 && after != 0.0);
        if (after - before).abs() > least {
            last.inspect(|last| *corners.entry(sample - last).or_default() += 1);
            last = Some(sample);
        }
    }
    let count: usize = corners.values().sum();
    let (&period, _) = corners.iter().max_by_key(|entry| *entry.1)?;
    let regular: usize = corners.iter().filter(|(length, _)| *length % period == 0).map(|entry| entry.1).sum();
    let is_straight = count as f64 <= (1.0 - MOSTLY) * moving as f64;
    (count >= FEWEST && period >= 2 && is_straight && regular as f64 >= REGULAR * count as f64).then_some(period)
}

fn told(flights: &[Flight], period: usize, indices: &[usize], columns: &[Column]) -> Option<Finding> {
    let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
    let seconds = period as f64 * flights[*indices.first()?].step_s;
    let matters = seconds > LONG_S && columns.iter().any(|column| !matches!(column, Column::X | Column::Y | Column::Z));
    let (name, rate_hz) = (format!("{INTERPOLATED}{}", names[0]), 1.0 / seconds);
    let message = format!(
        "{} come at {rate_hz:.3} Hz with straight lines in between (interpolated): what is faster is not in the log",
        names.join(", ")
    );
    if indices.len() as f64 > MOST * flights.len() as f64 {
        let verdict = if matters { Severity::Fault } else { Severity::Warning };
        return Some(finding(&name, verdict, message, super::streams::resampled(flights, columns, rate_hz).as_deref()));
    }
    matters.then(|| in_flights(&name, indices, &message, flights))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_told_from_curves_and_from_steps() {
        let curve = |sample: usize| (0.031 * sample as f64).sin() + 0.3 * (0.17 * sample as f64).cos();
        let line = |sample: usize| {
            let (before, part) = (sample / 10 * 10, (sample % 10) as f64 / 10.0);
            curve(before) + part * (curve(before + 10) - curve(before))
        };
        let series = |of: &dyn Fn(usize) -> f64| (0..3000).map(of).collect::<Vec<_>>();
        assert_eq!(period(&series(&line)), Some(10));
        assert_eq!(period(&series(&curve)), None);
        assert_eq!(period(&series(&|sample| curve(sample / 10 * 10))), None);
    }
}
