//! Sticks with a dead zone: one value stands for all near it, and its neighbours do not occur. Where only the record has it, small deflections are lost;
//! where the servo has it too, the aircraft is as the log says, so in all flights this is a warning. In some of them alone it is a fault of the record.

use super::finding::{Finding, Severity, finding};
use super::flights::{CONTROLS, MOST, in_flights};
use super::robust::median;
use crate::flight::Flight;

/// The value stands in this share of the samples …
const OFTEN: f64 = 0.02;
/// … none is nearer to it than this share of the range on either side, and both sides are alike to this factor …
const WIDE: f64 = 0.02;
const ALIKE: f64 = 1.5;
/// … while as far again on either side so many samples stand.
const BESIDE: f64 = 0.005;
/// So many flights have it, or it may be chance.
const FEWEST_FLIGHTS: usize = 3;
/// Values at least, of a stick that is not rounded.
const FEWEST: usize = 100;

/// A finding for each stick.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let of = |control| {
        let each = flights.iter().enumerate().filter_map(|(index, flight)| {
            let width = width(flight.column(control).to_vec());
            flight.rest();
            Some((index, width?))
        });
        let such: Vec<(usize, f64)> = each.collect();
        let half = 0.5 * median(such.iter().map(|entry| entry.1).collect())?;
        let name = format!("dead_zone_{}", control.name());
        let message = format!("{} has a dead zone: within {half:.3} of one value it is held at that", control.name());
        if such.len() as f64 > MOST * flights.len() as f64 {
            let message = format!(
                "{message}. Unless the servo has it, too, small deflections are missing, and can look like a curve of the stick (`ctrl_nonlin`)"
            );
            return Some(finding(&name, Severity::Warning, message, None));
        }
        let indices: Vec<usize> = such.iter().map(|entry| entry.0).collect();
        let found = in_flights(&name, &indices, &format!("{message}, as it is not in the other flights"), flights);
        Some(if such.len() < FEWEST_FLIGHTS { Finding { verdict: Severity::Warning, ..found } } else { found })
    };
    CONTROLS.into_iter().filter_map(of).collect()
}

/// The width of the zone around the value that occurs most.
fn width(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let samples = values.len() as f64;
    let range = values.last()? - values.first()?;
    let runs: Vec<&[f64]> = values.chunk_by(|one, next| one == next).collect();
    let place = (0..runs.len()).max_by_key(|place| runs[*place].len())?;
    let value = runs[place][0];
    let [below, above] = [value - runs.get(place.checked_sub(1)?)?[0], runs.get(place + 1)?[0] - value];
    let (least, most) = (below.min(above), below.max(above));
    let between = |low: f64, high: f64| values.iter().filter(|other| **other > low && **other < high).count() as f64;
    let is_used = between(value - 2.0 * most, value) > BESIDE * samples && between(value, value + 2.0 * most) > BESIDE * samples;
    let is_zone = runs[place].len() as f64 > OFTEN * samples && least > WIDE * range && most < ALIKE * least;
    (runs.len() >= FEWEST && is_zone && is_used).then_some(below + above)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_zone_is_told_from_a_stick_that_rests_and_from_one_that_is_rounded() {
        let stick = |sample: usize| 0.4 * (0.013 * sample as f64).sin() + 0.1 * (0.11 * sample as f64).cos();
        let series = |of: &dyn Fn(f64) -> f64| (0..4000).map(stick).map(of).collect::<Vec<_>>();
        let zone = width(series(&|u| if u.abs() < 0.05 { 0.0 } else { u })).expect("a zone");
        assert!((zone - 0.1).abs() < 0.01, "{zone}");
        assert_eq!(width(series(&|u| u)), None);
        assert_eq!(width(series(&|u| (u * 10.0).round() / 10.0)), None);
        let resting: Vec<f64> = series(&|u| u).into_iter().chain(std::iter::repeat_n(0.01, 1000)).collect();
        assert_eq!(width(resting), None);
    }
}
