//! Sticks that were recorded behind something that moves no faster than so much: where the stick is quicker, the record runs after it in straight lines of
//! one slope. A servo that is in the way of the command itself does so in all flights.

use super::finding::{Finding, Severity, finding};
use super::flights::{CONTROLS, MOST, in_flights};
use super::robust::median;
use crate::flight::{Column, Flight};

/// Steps are at the limit to this part of it …
const EXACT: f64 = 1e-3;
/// … in this share of those that are steps, and so often.
const SHARE: f64 = 0.05;
const FEWEST: usize = 50;

/// The largest rate, 1/s, of a stick that stands at it again and again.
fn limit(flight: &Flight, column: Column) -> Option<f64> {
    let values = flight.column(column);
    let steps = || values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let (largest, moving) = steps().fold((0.0, 0), |(largest, moving), step| (step.max(largest), moving + usize::from(step > 0.0)));
    let at_limit = steps().filter(|step| *step > (1.0 - EXACT) * largest).count();
    flight.rest();
    (largest > 0.0 && at_limit >= FEWEST && at_limit as f64 > SHARE * moving as f64).then_some(largest / flight.step_s)
}

/// Sticks that are so; `is_rounded` ones have few steps to choose from.
pub(super) fn findings(flights: &[Flight], is_rounded: &dyn Fn(Column) -> bool) -> Vec<Finding> {
    let present = |column: &Column| flights.iter().all(|flight| !flight.absent.contains(column));
    let of = |column: Column| {
        let each: Vec<(usize, f64)> =
            flights.iter().enumerate().filter_map(|(index, flight)| Some((index, limit(flight, column)?))).collect();
        let rate = median(each.iter().map(|entry| entry.1).collect())?;
        let name = column.name();
        let message = format!(
            "{name} never moves faster than {rate:.2} a second, and stands at that rate again and again: recorded behind a servo, or behind a slew limit, \
             that need not be the one that moves the axis"
        );
        let indices: Vec<usize> = each.into_iter().map(|entry| entry.0).collect();
        let id = format!("slew_{name}");
        let is_set = indices.len() as f64 > MOST * flights.len() as f64;
        Some(if is_set { finding(&id, Severity::Warning, message, None) } else { in_flights(&id, &indices, &message, flights) })
    };
    CONTROLS.into_iter().filter(present).filter(|column| !is_rounded(*column)).filter_map(of).collect()
}
