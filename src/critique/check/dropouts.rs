//! Samples that a recorder dropped and filled with the last ones: all that is measured stands still for a while and then jumps. A single column
//! that stands still is the business of `streams`.

use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, in_flights, named};
use super::robust::median;
use crate::flight::{Column, Flight};

/// A rest of all measurements from here on, s, is no chance.
const LONG_S: f64 = 0.05;
/// The rest ends with a jump that is so many times the usual change from sample to sample …
const JUMP: f64 = 3.0;
/// … in so many columns.
const JUMPING: usize = 2;
/// Lost for this share of a flight, samples make effects of their own.
const MUCH: f64 = 0.03;

const STATE: [Column; 9] =
    [Column::Roll, Column::Pitch, Column::Yaw, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// What one flight lost.
struct Lost {
    flight: usize,
    times: usize,
    longest_s: f64,
    share: f64,
}

/// Flights that lost samples.
pub(super) fn findings(flights: &[Flight]) -> Option<Finding> {
    let lost: Vec<Lost> = flights.iter().enumerate().filter_map(|(index, flight)| of_flight(index, flight)).collect();
    let longest_s = lost.iter().map(|one| one.longest_s).reduce(f64::max)?;
    let share = lost.iter().map(|one| one.share).sum::<f64>() / lost.len() as f64;
    let times: usize = lost.iter().map(|one| one.times).sum();
    let message = format!(
        "all measurements are held, {times} times and for up to {longest_s:.2} s, and then jump: dropped samples, {:.1} % of these flights",
        100.0 * share
    );
    let indices: Vec<usize> = lost.iter().map(|one| one.flight).collect();
    let verdict = if share > MUCH { Severity::Fault } else { Severity::Warning };
    if indices.len() as f64 > MOST * flights.len() as f64 {
        return Some(finding("dropouts", verdict, message, None));
    }
    let names: Vec<&str> = indices.iter().map(|&index| flights[index].name.as_str()).collect();
    Some(match verdict {
        Severity::Fault => in_flights("dropouts", &indices, &message, flights),
        _ => finding("dropouts", verdict, format!("in {}: {message}", named(&names)), None),
    })
}

fn of_flight(index: usize, flight: &Flight) -> Option<Lost> {
    let columns: Vec<&[f64]> =
        STATE.into_iter().filter(|column| !flight.absent.contains(column)).map(|column| flight.column(column)).collect();
    let least = (LONG_S / flight.step_s).ceil().max(2.0) as usize;
    let usual: Vec<f64> = columns.iter().map(|values| usual_change(values)).collect();
    let stands = |sample: usize| columns.iter().all(|values| values[sample] == values[sample - 1]);
    let jumps = |sample: usize| {
        let is_jump = |(values, usual): (&&[f64], &f64)| (values[sample] - values[sample - 1]).abs() > JUMP * usual;
        columns.iter().zip(&usual).filter(|pair| is_jump((pair.0, pair.1))).count() >= JUMPING
    };
    let (mut times, mut longest, mut total, mut run) = (0, 0, 0, 0);
    for sample in 1..flight.len() {
        if stands(sample) {
            run += 1;
            continue;
        }
        if run >= least && jumps(sample) {
            times += 1;
            longest = longest.max(run);
            total += run;
        }
        run = 0;
    }
    flight.rest();
    (times > 0).then(|| Lost {
        flight: index,
        times,
        longest_s: longest as f64 * flight.step_s,
        share: total as f64 / flight.len() as f64,
    })
}

/// The median change from sample to sample, of those that change anything.
fn usual_change(values: &[f64]) -> f64 {
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0);
    median(changes.collect()).unwrap_or(0.0)
}
