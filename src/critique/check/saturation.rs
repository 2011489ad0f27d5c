//! Measured columns that are cut off: values pile up at an end, while just below it none does. The range of a sensor, or of what wrote its
//! numbers, ends there. Sticks at their ends are the business of `limits`.

use super::finding::Finding;
use super::flights::of_set_or_flights;
use super::robust::median;
use crate::flight::{Column, Flight, Targets};

/// The end is reached in this share of a flight, …
const PILED: f64 = 0.002;
/// … so often at least, …
const TIMES: usize = 3;
/// … for so many samples each time on the average, …
const STAYS: usize = 3;
/// … and so many times as often as the value next to it, which rounding makes as frequent.
const ALONE: usize = 5;
/// One that stands there for longer than this share of the flight does not move.
const RESTS: f64 = 0.5;

/// Where the aircraft stands on the ground, position and heading rest.
const LOOKED_AT: [Column; 8] =
    [Column::Roll, Column::Pitch, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// A finding for the columns that are cut off in the same flights.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let recorded = flights.iter().all(|flight| flight.targets == Targets::Recorded);
    let looked_at = LOOKED_AT.into_iter().chain(Column::TARGETS.into_iter().filter(|_| recorded));
    let mut alike: Vec<Alike> = Vec::new();
    for column in looked_at.filter(|column| flights.iter().all(|flight| !flight.absent.contains(column))) {
        let each = flights.iter().enumerate().filter_map(|(index, flight)| {
            let cut = cut(flight.column(column));
            flight.rest();
            Some((index, cut?))
        });
        let such: Vec<(usize, Cut)> = each.collect();
        let number = |of: fn(&Cut) -> f64| median(such.iter().map(|entry| of(&entry.1)).collect());
        let Some((end, share)) = number(|cut| cut.end).zip(number(|cut| cut.share)) else { continue };
        let indices: Vec<usize> = such.iter().map(|entry| entry.0).collect();
        match alike.iter_mut().find(|one| one.indices == indices) {
            Some(one) => one.columns.push((column, Cut { end, share })),
            None => alike.push(Alike { indices, columns: vec![(column, Cut { end, share })] }),
        }
    }
    alike.iter().map(|one| told(flights, one)).collect()
}

/// Columns that are cut off in the same flights.
struct Alike {
    indices: Vec<usize>,
    columns: Vec<(Column, Cut)>,
}

fn told(flights: &[Flight], Alike { indices, columns }: &Alike) -> Finding {
    let each: Vec<String> = columns
        .iter()
        .map(|(column, Cut { end, share })| {
            format!("{} at {end:.3} {} for {:.1} % of the time", column.name(), column.unit(), 100.0 * share)
        })
        .collect();
    let message = format!("cut off at the end of a range (saturated), where the same value stands: {}", each.join(", "));
    of_set_or_flights(&format!("saturated_{}", columns[0].0.name()), indices, flights.len(), &message, None, flights)
}

/// Where values pile up.
struct Cut {
    /// Magnitude of the end.
    end: f64,
    /// Share of the samples that stand at an end.
    share: f64,
}

/// The ends at which a column is cut off.
fn cut(values: &[f64]) -> Option<Cut> {
    let samples = values.len() as f64;
    let piled = |sign: f64| {
        let high = values.iter().map(|value| sign * value).reduce(f64::max)?;
        let (mut at, mut runs, mut second, mut at_second) = (0_usize, 0_usize, f64::NEG_INFINITY, 0_usize);
        let mut was_there = false;
        for value in values.iter().map(|value| sign * value) {
            let is_there = value == high;
            at += usize::from(is_there);
            runs += usize::from(is_there && !was_there);
            was_there = is_there;
            if !is_there && value >= second {
                at_second = if value > second { 1 } else { at_second + 1 };
                second = value;
            }
        }
        let is_end = at as f64 > PILED * samples && runs >= TIMES && at >= STAYS * runs && at >= ALONE * at_second;
        (is_end && (at as f64) < RESTS * samples).then_some((high.abs(), at))
    };
    let ends = [piled(1.0), piled(-1.0)];
    let at: usize = ends.iter().flatten().map(|end| end.1).sum();
    let end = ends.iter().flatten().map(|end| end.0).reduce(f64::min)?;
    Some(Cut { end, share: at as f64 / samples })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clipped_series_is_told_from_one_that_turns_and_from_one_that_is_rounded() {
        let series = |of: &dyn Fn(f64) -> f64| {
            (0..4000).map(|k| (0.031 * k as f64).sin() + 0.3 * (0.17 * k as f64).cos()).map(of).collect::<Vec<_>>()
        };
        let found = cut(&series(&|value| value.clamp(-0.8, 0.8))).expect("clipped");
        assert!((found.end - 0.8).abs() < 1e-12 && found.share > 0.1, "{} {}", found.end, found.share);
        assert!(cut(&series(&|value| value.min(0.8))).is_some(), "one end is enough");
        assert!(cut(&series(&|value| value)).is_none());
        assert!(cut(&series(&|value| (10.0 * value).round() / 10.0)).is_none());
    }
}
