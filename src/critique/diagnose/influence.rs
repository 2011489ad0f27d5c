//! Whether an effect or a number hangs on one flight. Of an effect told is the flight without which its gain would be gone. Of a
//! number the fit is repeated without each flight (deletion diagnostics, Belsley, Kuh & Welsch 1980, "Regression Diagnostics", chapter
//! 2), and told is the flight without which the number would leave its own 95 % interval. The fits themselves are in `fit` and `joint`.
//! No block is weighed down for its size: an effect that acts in few manoeuvres is all in blocks that look like outliers.

use super::engine::Engine;
use super::gains::by_flight_of;
use super::report::Influence;
use crate::flight::Flight;
use crate::physics::digits::printer;
use std::collections::BTreeMap;
use std::fmt;

/// The flights on which the numbers of a model hang, by effect and position of the number in it.
pub(super) type Influences = BTreeMap<(usize, usize), Influence>;

/// The flight without which a number is furthest outside its interval, one without which it is not determined before all; `without` holds the
/// flights by index and the number on all others.
pub(super) fn decisive(
    [low, high]: [f64; 2],
    without: impl Iterator<Item = (usize, Option<f64>)>,
    flights: &[Flight],
) -> Option<Influence> {
    let excess = |value: Option<f64>| value.map_or(f64::INFINITY, |value| (low - value).max(value - high));
    let outside = without.filter(|(_, value)| excess(*value) > 0.0);
    let (flight, without) = outside.max_by(|left, right| excess(left.1).total_cmp(&excess(right.1)))?;
    Some(Influence { flight: flights[flight].name.clone(), without })
}

/// A flight without which the gain would be gone.
pub(super) fn decisive_flight(engine: &Engine<'_>, gains: &[f64]) -> Option<String> {
    let total: f64 = gains.iter().sum();
    let mut flights: Vec<usize> = engine.blocks.iter().map(|block| block.flight).collect();
    flights.dedup();
    let flight = flights.iter().zip(by_flight_of(engine, gains)).find(|(_, gain)| total - gain <= 0.0)?.0;
    engine.flights.get(*flight).map(|flight| flight.name.clone()).filter(|_| flights.len() > 1)
}

impl fmt::Display for Influence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.without {
            Some(value) => write!(f, "without flight `{}` {}", self.flight, printer(4, [value])(value)),
            None => write!(f, "not determined without flight `{}`", self.flight),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gram::tests::noise;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_flight_is_named_only_where_the_number_leaves_its_interval(values in prop::collection::vec(-3.0..3.0_f64, 1..6)) {
            let flights = noise(1, &[10; 6]);
            let found = decisive([-1.0, 2.0], values.iter().copied().map(Some).enumerate(), &flights);
            let furthest = values.iter().map(|value| (-1.0 - value).max(value - 2.0)).fold(f64::NEG_INFINITY, f64::max);
            match found {
                Some(Influence { without: Some(value), .. }) => prop_assert!(((-1.0 - value).max(value - 2.0) - furthest).abs() < 1e-12 && furthest > 0.0),
                Some(_) => prop_assert!(false),
                None => prop_assert!(furthest <= 0.0),
            }
        }
    }

    #[test]
    fn not_to_be_determined_is_furthest_of_all() {
        let found = decisive([0.0, 1.0], [(0, Some(99.0)), (1, None)].into_iter(), &noise(1, &[10; 2])).expect("outside");
        assert_eq!(found.to_string(), "not determined without flight `f1`");
    }
}
