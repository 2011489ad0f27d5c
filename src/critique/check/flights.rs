//! Some flights among all of a set: how many say something, and a finding that names them. What single flights say is measured elsewhere.

use super::finding::{Finding, Severity, finding};
use crate::flight::{Column, Flight};

pub(super) const CONTROLS: [Column; 4] = [Column::U1, Column::U2, Column::U3, Column::U4];
/// A flight by itself is believed where twice its interval says so: there are many flights and many relations.
pub(super) const WIDER: f64 = 2.0;
/// Flights at least in which a single stick is late or scaled, or a clock another: there are many flights and many sticks, and manoeuvres do the like.
pub(super) const FEWEST: usize = 3;
/// Where more than this share of the flights breaks a relation, it is the set that does.
pub(super) const MOST: f64 = 0.8;

/// A fault of some flights.
pub(super) fn in_flights(name: &str, indices: &[usize], message: &str, flights: &[Flight]) -> Finding {
    let names: Vec<&str> = indices.iter().map(|&index| flights[index].name.as_str()).collect();
    let message = format!("in {} of {} flights ({}): {message}", indices.len(), flights.len(), named(&names));
    Finding {
        set: Some(left_out(&names)),
        flights: names.into_iter().map(str::to_owned).collect(),
        ..finding(name, Severity::Fault, message, None)
    }
}

/// So many flights are named.
const NAMED: usize = 4;

/// Names, of many the first few.
pub(super) fn named(names: &[&str]) -> String {
    match names.len().checked_sub(NAMED) {
        None | Some(0) => names.join(", "),
        Some(more) => format!("{} and {more} more", names[..NAMED].join(", ")),
    }
}

/// The rule of `dataset.toml` that leaves flights out.
pub(super) fn left_out(names: &[&str]) -> String {
    format!("leave_out = [{}]", names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", "))
}

/// A column of all flights with their steps; each flight leaves the memory behind it.
pub(super) fn of_all<'f>(flights: impl IntoIterator<Item = &'f Flight>, column: Column) -> impl Iterator<Item = (f64, f64)> {
    flights.into_iter().flat_map(move |flight| {
        let left = std::iter::from_fn(move || {
            flight.rest();
            None
        });
        flight.column(column).iter().map(|value| (*value, flight.step_s)).chain(left)
    })
}

/// A fault of the set where more than [`MOST`] of the flights that tell are such, mended by `set`, and of these flights elsewhere.
pub(super) fn of_set_or_flights(
    name: &str,
    indices: &[usize],
    telling: usize,
    message: &str,
    set: Option<&str>,
    flights: &[Flight],
) -> Finding {
    if indices.len() as f64 > MOST * telling as f64 {
        finding(name, Severity::Fault, message.into(), set)
    } else {
        in_flights(name, indices, message, flights)
    }
}
