//! Streams that were written only when they had changed by enough, to spare a link, and stay as they are in between. Streams that come at a lower rate, or
//! that are rounded, are the business of `streams`.

use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, in_flights};
use super::robust::median;
use super::streams::POSITION;
use crate::flight::{Column, Flight};

/// A column that was sent on change steps so often …
const FEWEST_STEPS: usize = 20;
/// … and its smallest steps, but for one in twenty, are this part of the usual one: none is smaller than what had to be reached.
const SMALLEST: f64 = 0.6;
const OF_TWENTY: usize = 20;
/// Rounding makes steps that are whole multiples of the smallest: this share of them …
const WHOLE: f64 = 0.8;
/// … to this part of it.
const EXACT: f64 = 0.02;

/// How names of these findings begin.
const ON_CHANGE: &str = "on_change_";

/// The change that has to be reached in a flight in which most samples are those before them; `None` where there is none.
fn least(flight: &Flight, column: Column) -> Option<f64> {
    let values = flight.column(column);
    let mut steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect();
    flight.rest();
    if steps.len() < FEWEST_STEPS {
        return None;
    }
    steps.sort_unstable_by(f64::total_cmp);
    let (smallest, usual) = (steps[steps.len() / OF_TWENTY], steps[steps.len() / 2]);
    let is_whole = |step: &&f64| (*step / smallest - (*step / smallest).round()).abs() < EXACT;
    let is_rounded = steps.iter().filter(is_whole).count() as f64 > WHOLE * steps.len() as f64;
    (smallest > SMALLEST * usual && !is_rounded).then_some(smallest)
}

/// Columns that were sent on change, those of the same flights in one finding; `columns` with the flights in which they rest most of the time.
pub(super) fn findings(flights: &[Flight], columns: impl Iterator<Item = (Column, Vec<usize>)>) -> Vec<(Finding, Vec<Column>)> {
    let mut alike: Vec<(Vec<usize>, Vec<Column>, Vec<f64>)> = Vec::new();
    for (column, resting) in columns {
        let each: Vec<(usize, f64)> =
            resting.into_iter().filter_map(|index| Some((index, least(&flights[index], column)?))).collect();
        let Some(change) = median(each.iter().map(|entry| entry.1).collect()) else { continue };
        let indices: Vec<usize> = each.into_iter().map(|entry| entry.0).collect();
        match alike.iter_mut().find(|(others, of, _)| shares(others, &indices) && of[0].unit() == column.unit()) {
            Some((others, columns, changes)) => {
                others.extend(indices);
                others.sort_unstable();
                others.dedup();
                columns.push(column);
                changes.push(change);
            }
            None => alike.push((indices, vec![column], vec![change])),
        }
    }
    alike.into_iter().map(|(indices, columns, changes)| (told(&indices, &columns, &changes, flights), columns)).collect()
}

/// Whether two lists have a flight in common.
fn shares(one: &[usize], other: &[usize]) -> bool {
    one.iter().any(|index| other.contains(index))
}

fn told(indices: &[usize], columns: &[Column], changes: &[f64], flights: &[Flight]) -> Finding {
    let names = columns.iter().map(|column| column.name()).collect::<Vec<_>>().join(", ");
    let change = median(changes.to_vec()).unwrap_or(0.0);
    let message = format!(
        "{names} {} held until the next change of {change:.3} {} or so (sent on change): late by then, and rounded to that",
        if columns.len() > 1 { "are" } else { "is" },
        columns[0].unit()
    );
    let name = format!("{ON_CHANGE}{}", columns[0].name());
    let found = if indices.len() as f64 > MOST * flights.len() as f64 {
        finding(&name, Severity::Fault, message, None)
    } else {
        in_flights(&name, indices, &message, flights)
    };
    // Where the aircraft is drives nothing but the effect of the ground.
    let is_position = columns.iter().all(|column| POSITION.contains(column));
    if is_position { Finding { verdict: Severity::Warning, ..found } } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Targets;

    fn flight(name: &str, of: impl Fn(usize) -> f64) -> Flight {
        let columns = Column::ALL.map(|column| {
            let values = (0..3000).map(|k| if column == Column::Roll { of(k) } else { (0.01 * k as f64).sin() });
            values.collect()
        });
        Flight::new(name, "test", 0.0, 0.01, columns, Targets::Recorded).expect("a sound flight")
    }

    #[test]
    fn what_is_sent_on_change_is_told_from_what_is_rounded_or_held() {
        let smooth = |k: usize| 0.5 * (0.011 * k as f64).sin() + 0.2 * (0.037 * k as f64).cos();
        let sent = std::cell::Cell::new(0.0);
        let on_change = flight("sent", |k| {
            if (smooth(k) - sent.get()).abs() >= 0.06 {
                sent.set(smooth(k));
            }
            sent.get()
        });
        let change = least(&on_change, Column::Roll).expect("it was sent on change");
        assert!((0.06..0.07).contains(&change), "{change}");
        for (how, other) in [
            ("rounded", flight("rounded", |k| (smooth(k) / 0.06).round() * 0.06)),
            ("held", flight("held", |k| smooth(k - k % 20))),
        ] {
            assert_eq!(least(&other, Column::Roll), None, "{how}");
        }
    }
}
