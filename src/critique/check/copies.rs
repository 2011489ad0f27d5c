//! Columns of a flight that are a copy of another one: a channel that was logged twice, and one that was not logged.

use super::finding::Finding;
use super::flights::in_flights;
use crate::flight::{Column, Flight};
use std::collections::BTreeMap;

/// Columns with the values of another, in the flights where they have them; of all flights, too.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let mut pairs: BTreeMap<(Column, Column), Vec<usize>> = BTreeMap::new();
    for (index, flight) in flights.iter().enumerate() {
        let moves = |column: &Column| flight.column(*column).windows(2).any(|pair| pair[0] != pair[1]);
        let moving: Vec<Column> = Column::ALL.into_iter().filter(|column| !flight.absent.contains(column)).filter(moves).collect();
        for (place, one) in moving.iter().enumerate() {
            let same = moving[place + 1..].iter().filter(|other| flight.column(*one) == flight.column(**other));
            same.for_each(|other| pairs.entry((*one, *other)).or_default().push(index));
        }
        flight.rest();
    }
    let told = |((one, other), indices): ((Column, Column), Vec<usize>)| {
        let (one, other) = (one.name(), other.name());
        let message =
            format!("{one} and {other} are identical: the same channel stands in both columns, and one of them was not logged");
        in_flights(&format!("same_{one}_{other}"), &indices, &message, flights)
    };
    pairs.into_iter().map(told).collect()
}
