//! Columns that come by turns of two sources: every other sample is older than those beside it, or differs from them by a constant. Streams that are held or
//! interpolated are the business of `streams` and `lines`.

use super::finding::Finding;
use super::flights::of_set_or_flights;
use super::robust::median;
use crate::flight::{Column, Flight, Targets};

/// Age or offset explain this share of the squares of what alternates; of noise they explain nothing.
const EXPLAINED: f64 = 0.5;
/// A stream at half of the rate that is held is older by one step at every other sample. That is another finding.
const OLDER_STEPS: f64 = 1.5;
/// Samples at least.
const FEWEST: usize = 200;

/// A finding for the columns that alternate in the same flights and in the same way.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let recorded = flights.iter().all(|flight| flight.targets == Targets::Recorded);
    // The heading jumps by a turn.
    let is_smooth = |column: &Column| *column != Column::Yaw && (recorded || !Column::TARGETS.contains(column));
    let present = |column: &Column| is_smooth(column) && flights.iter().all(|flight| !flight.absent.contains(column));
    let mut alike: Vec<Alike> = Vec::new();
    for column in Column::ALL.into_iter().filter(present) {
        let each = flights.iter().enumerate().filter_map(|(index, flight)| {
            let turn = turn(flight.column(column), flight.step_s);
            flight.rest();
            Some((index, turn?))
        });
        let such: Vec<(usize, Turn)> = each.collect();
        for older in [true, false] {
            let of = |(index, turn): &(usize, Turn)| match turn {
                Turn::Older(age_s) => older.then_some((*index, *age_s)),
                Turn::Off(by) => (!older).then_some((*index, *by)),
            };
            let such: Vec<(usize, f64)> = such.iter().filter_map(of).collect();
            let indices: Vec<usize> = such.iter().map(|entry| entry.0).collect();
            let Some(size) = median(such.iter().map(|entry| entry.1).collect()) else { continue };
            match alike.iter_mut().find(|one| one.older == older && one.indices == indices) {
                Some(one) => one.columns.push((column, size)),
                None => alike.push(Alike { older, indices, columns: vec![(column, size)] }),
            }
        }
    }
    alike.iter().map(|one| told(flights, one)).collect()
}

/// Columns that alternate in the same flights in the same way: by an age, s, or by a constant, in the unit of each.
struct Alike {
    older: bool,
    indices: Vec<usize>,
    columns: Vec<(Column, f64)>,
}

fn told(flights: &[Flight], Alike { older, indices, columns }: &Alike) -> Finding {
    let names = columns.iter().map(|entry| entry.0.name()).collect::<Vec<_>>().join(", ");
    let (first, size) = columns[0];
    let how = if *older {
        format!("every other sample is about {:.0} ms older than those beside it", 1e3 * size)
    } else {
        format!("every other sample differs from those beside it by {size:.3} {}", first.unit())
    };
    let message = format!("{names}: {how}, as where two sources are written by turns");
    of_set_or_flights(&format!("by_turns_{}", first.name()), indices, flights.len(), &message, None, flights)
}

/// What alternates.
#[derive(Debug, PartialEq)]
enum Turn {
    /// By an age, s.
    Older(f64),
    /// By a constant.
    Off(f64),
}

/// (−1)ᵏ (xₖ − (xₖ₋₁ + xₖ₊₁)/2) is τ x' of two sources of which one is older by τ, or their difference, and mean zero otherwise. The slope x' is that between
/// samples of one source.
fn turn(values: &[f64], step_s: f64) -> Option<Turn> {
    if values.len() < FEWEST {
        return None;
    }
    let (mut moment, mut square, mut sum, mut total, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (k, w) in values.windows(5).enumerate() {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let odd = sign * (w[2] - 0.5 * (w[1] + w[3]));
        let slope = (w[4] - w[0]) / (4.0 * step_s);
        moment += odd * slope;
        square += slope * slope;
        sum += odd;
        total += odd * odd;
        count += 1.0;
    }
    let age_s = moment / square;
    let [by_age, by_offset] = [moment * moment / square, sum * sum / count];
    if by_age > EXPLAINED * total && age_s.abs() > OLDER_STEPS * step_s {
        Some(Turn::Older(age_s.abs()))
    } else {
        (by_offset > EXPLAINED * total).then(|| Turn::Off((sum / count).abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sources_are_told_from_one_and_from_one_that_is_held() {
        let at = |time_s: f64| (1.3 * time_s).sin() + 0.4 * (4.1 * time_s).cos();
        let series = |of: &dyn Fn(usize) -> f64| (0..2000).map(of).collect::<Vec<_>>();
        let age_s = |k: usize| if k.is_multiple_of(2) { 0.0 } else { 0.04 };
        let Some(Turn::Older(found_s)) = turn(&series(&|k| at(0.01 * k as f64 - age_s(k))), 0.01) else { panic!("two ages") };
        assert!((found_s - 0.04).abs() < 0.004, "{found_s}");
        let Some(Turn::Off(by)) = turn(&series(&|k| at(0.01 * k as f64) + age_s(k)), 0.01) else { panic!("two offsets") };
        assert!((by - 0.04).abs() < 0.004, "{by}");
        assert_eq!(turn(&series(&|k| at(0.01 * k as f64)), 0.01), None);
        assert_eq!(turn(&series(&|k| at(0.02 * (k / 2) as f64)), 0.01), None);
    }
}
