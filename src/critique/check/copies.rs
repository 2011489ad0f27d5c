//! Copies that are none by their numbers: columns of a flight with the values of another one, a channel that was logged twice in the place of one that was not
//! logged; and flights with the values of another but for signs, mirrored to have more. Flights with the same numbers are left out when they are read.

use super::finding::Finding;
use super::flights::in_flights;
use crate::flight::{Column, Flight};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

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
    pairs.into_iter().map(told).chain(mirrored(flights)).collect()
}

/// Flights that are others with some signs reversed.
fn mirrored(flights: &[Flight]) -> Option<Finding> {
    // Sums of magnitudes are the same to the last bit, whatever the signs; two columns tell nearly all flights apart, and those that they do not are looked at.
    let sizes = |flight: &Flight| -> [u64; 2] {
        let of = |column: Column| flight.column(column).iter().map(|value| value.abs()).sum::<f64>().to_bits();
        let sums = [Column::U4, Column::Wy].map(of);
        flight.rest();
        sums
    };
    let mut first: BTreeMap<[u64; 2], usize> = BTreeMap::new();
    let mut such = Vec::new();
    for (index, flight) in flights.iter().enumerate() {
        match first.entry(sizes(flight)) {
            Entry::Occupied(other) if is_mirrored(&flights[*other.get()], flight) => such.push(index),
            Entry::Occupied(_) => {}
            Entry::Vacant(place) => drop(place.insert(index)),
        }
    }
    let message = "each holds the numbers of another flight with some signs reversed, a mirrored copy: no helicopter flies so, its rotors have one sense of turning";
    (!such.is_empty()).then(|| in_flights("mirrored", &such, message, flights))
}

/// Whether each column is that of the other flight, or its negative, and one that moves is a negative.
fn is_mirrored(one: &Flight, other: &Flight) -> bool {
    let of = |column: Column| {
        let pairs = || one.column(column).iter().zip(other.column(column));
        (pairs().all(|(one, other)| one == other), pairs().all(|(one, other)| *one == -other))
    };
    let each = Column::ALL.map(of);
    one.len() == other.len() && each.iter().all(|(same, reversed)| *same || *reversed) && each.iter().any(|(same, _)| !same)
}
