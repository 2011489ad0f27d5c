//! A part of the flights where all of them would take too long.

use crate::flight::{Flight, Span};
use std::collections::BTreeSet;

/// Some seconds of flight out of the spans: every second, third … flight as long as some flights are left, and the first part of each. What
/// remembers runs from the start of a flight, so a part from its middle would take as long.
pub(super) fn selection(flights: &[Flight], spans: &[Span], (seconds, fewest): (f64, usize)) -> Vec<Span> {
    let length = |span: &Span| flights.get(span.flight).map_or(0.0, |flight| (span.end - span.start) as f64 * flight.step_s);
    let total: f64 = spans.iter().map(length).sum();
    let used: Vec<usize> = spans.iter().map(|span| span.flight).collect::<BTreeSet<_>>().into_iter().collect();
    let every = ((total / seconds) as usize).min(used.len() / fewest).max(1);
    let chosen: Vec<usize> = used.into_iter().step_by(every).collect();
    let whole: f64 = spans.iter().filter(|span| chosen.contains(&span.flight)).map(length).sum();
    let share = (seconds / whole).min(1.0);
    let mut kept = Vec::new();
    for flight in chosen {
        let mut own: Vec<Span> = spans.iter().filter(|span| span.flight == flight).copied().collect();
        own.sort_unstable_by_key(|span| span.start);
        let samples: usize = own.iter().map(|span| span.end - span.start).sum();
        let mut left = (share * samples as f64).ceil() as usize;
        for span in own {
            let end = span.start + left.min(span.end - span.start);
            left -= end - span.start;
            kept.extend((span.start < end).then_some(Span { end, ..span }));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    /// Half an hour, and twenty flights at least.
    const HALF_AN_HOUR: (f64, usize) = (1800.0, 20);

    #[test]
    fn a_selection_keeps_twenty_flights_or_all_and_the_first_part_of_each() -> Result<()> {
        let flight = |name: usize, samples: usize| {
            let columns = std::array::from_fn(|_| vec![0.0; samples]);
            Flight::new(name.to_string(), "rest", 0.0, 1.0, columns, crate::flight::Targets::Recorded)
        };
        for (count, samples, kept) in [(19, 1000, 19), (100, 10, 100), (100, 100, 20), (60, 50, 60), (60, 60, 30), (45, 1000, 23)] {
            let flights: Vec<Flight> = (0..count).map(|name| flight(name, samples)).collect::<Result<_>>()?;
            let spans: Vec<Span> = (0..count).map(|flight| Span { flight, start: 0, end: samples }).collect();
            let selected = selection(&flights, &spans, HALF_AN_HOUR);
            assert_eq!(selected.len(), kept, "{count} of {samples} s");
            // No more than was asked for, but for the rounding of each; and from the start of each flight.
            let total: usize = selected.iter().map(|span| span.end).sum();
            let asked = (count * samples).min(HALF_AN_HOUR.0 as usize);
            assert!((asked..=asked.max(1800) + kept).contains(&total), "{total} s of {count} of {samples} s");
            assert!(selected.iter().all(|span| span.start == 0));
        }
        Ok(())
    }
}
