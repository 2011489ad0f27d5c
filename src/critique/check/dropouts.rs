//! Samples that a recorder dropped and filled: all that is measured stands still for a while and then jumps, or to the end of the flight; or all sticks
//! leap to one value, stay, and leap back; or single rows that repeat the rates of the row before. A single column that stands still is the business of `streams`.

use super::finding::{Finding, Severity, finding};
use super::flights::{CONTROLS, MOST, in_flights, named};
use super::robust::median;
use crate::flight::{Column, Flight};

/// A rest of all measurements from here on, s, is no chance.
pub(super) const LONG_S: f64 = 0.05;
/// The rest ends with a jump that is so many times the usual change from sample to sample …
pub(super) const JUMP: f64 = 3.0;
/// … in so many columns.
pub(super) const JUMPING: usize = 2;
/// A rest of all measurements at the end of a flight, s.
const LAST_S: f64 = 1.0;
/// A rest of all sticks between leaps, s, …
const STICKS_S: f64 = 0.3;
/// … that are so many times their usual change …
pub(super) const LEAP: f64 = 10.0;
/// … and this part of their range.
const OF_RANGE: f64 = 0.05;
/// Lost for this share of a flight, samples make effects of their own.
pub(super) const MUCH: f64 = 0.03;

/// Rows that repeat the rates of the row before are told from this share of a flight on, …
const REPEATED: f64 = 0.02;
/// … where so many of the rows in which one axis stands are rows in which all three do, …
const TOGETHER: f64 = 0.75;
/// … so many times as often as if axes stood still by themselves, as rounded ones do.
const BY_CHANCE: f64 = 3.0;

const STATE: [Column; 9] =
    [Column::Roll, Column::Pitch, Column::Yaw, Column::Vx, Column::Vy, Column::Vz, Column::Wx, Column::Wy, Column::Wz];

/// What one flight lost.
struct Lost {
    flight: usize,
    times: usize,
    longest_s: f64,
    share: f64,
}

/// Flights that lost samples of all measurements, that were repeated at their end, or that lost those of all sticks.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let all = |of: fn(usize, &Flight) -> Option<Lost>| -> Vec<Lost> {
        flights.iter().enumerate().filter_map(|(index, flight)| of(index, flight)).collect()
    };
    let held = finding_of("dropouts", &all(of_flight), flights, |lost| {
        format!("all measurements are held, {}, and then jump: dropped samples", lost.how())
    });
    let ends = finding_of("padded", &all(at_the_end), flights, |lost| {
        format!("the last row is repeated, {}: the recorder went on when nothing was measured any more", lost.how())
    });
    let sticks = finding_of("controls_dropout", &all(of_sticks), flights, |lost| {
        format!(
            "all controls leap to one value, are held there, {}, and leap back: a dropout or a failsafe of the receiver",
            lost.how()
        )
    });
    held.into_iter().chain(ends).chain(sticks).chain(repeated(flights)).collect()
}

/// Flights in which rows repeat the rates of the row before because packets were lost. A warning: nothing is wrong with the rest of such a log.
fn repeated(flights: &[Flight]) -> Option<Finding> {
    let found: Vec<(usize, f64)> =
        flights.iter().enumerate().filter_map(|(index, flight)| Some((index, repeated_share(flight)?))).collect();
    let most = found.iter().map(|(_, share)| *share).reduce(f64::max)?;
    let names: Vec<&str> = found.iter().map(|(index, _)| flights[*index].name.as_str()).collect();
    let message = format!(
        "in {}: up to {:.0} % of the rows repeat all rates of the row before: packets that were lost, and the last one held; a [[repair]] rule \
         with `held = true` for the columns of a packet bridges them",
        named(&names),
        100.0 * most
    );
    Some(finding("repeated_rows", Severity::Warning, message, None))
}

/// Share of a flight's rows that hold the rates of the row before in the place of those that were lost.
fn repeated_share(flight: &Flight) -> Option<f64> {
    let rates = [Column::Wx, Column::Wy, Column::Wz].map(|column| flight.column(column));
    let stands = |sample: usize| rates.map(|values| values[sample] == values[sample - 1]);
    let longest = ((LONG_S / flight.step_s).ceil() as usize).max(2);
    // Rows in which each axis stands, and all; a rest that is longer is another matter.
    let (mut rows, mut single, mut all, mut run) = (0_usize, [0_usize; 3], 0_usize, 0_usize);
    for sample in 1..flight.len() {
        let standing = stands(sample);
        if standing == [true; 3] {
            run += 1;
            continue;
        }
        let held = if run < longest { run } else { 0 };
        rows += 1 + held;
        all += held;
        single.iter_mut().zip(standing).for_each(|(count, stands)| *count += held + usize::from(stands));
        run = 0;
    }
    flight.rest();
    let share = |count: usize| count as f64 / rows as f64;
    let by_chance: f64 = single.map(share).iter().product();
    let together = all as f64 >= TOGETHER * single.into_iter().min().unwrap_or(0) as f64;
    (share(all) >= REPEATED && together && share(all) >= BY_CHANCE * by_chance).then(|| share(all))
}

impl Lost {
    fn how(&self) -> String {
        let times = if self.times == 1 { "once".to_owned() } else { format!("{} times", self.times) };
        format!("{times} and for up to {:.2} s, {:.1} % of these flights", self.longest_s, 100.0 * self.share)
    }
}

fn finding_of(name: &str, lost: &[Lost], flights: &[Flight], told: impl Fn(&Lost) -> String) -> Option<Finding> {
    let longest_s = lost.iter().map(|one| one.longest_s).reduce(f64::max)?;
    let share = lost.iter().map(|one| one.share).sum::<f64>() / lost.len() as f64;
    let times: usize = lost.iter().map(|one| one.times).sum();
    let message = told(&Lost { flight: 0, times, longest_s, share });
    let indices: Vec<usize> = lost.iter().map(|one| one.flight).collect();
    let verdict = if share > MUCH { Severity::Fault } else { Severity::Warning };
    if indices.len() as f64 > MOST * flights.len() as f64 {
        return Some(finding(name, verdict, message, None));
    }
    let names: Vec<&str> = indices.iter().map(|&index| flights[index].name.as_str()).collect();
    Some(match verdict {
        Severity::Fault => in_flights(name, &indices, &message, flights),
        _ => finding(name, verdict, format!("in {}: {message}", named(&names)), None),
    })
}

fn measured(flight: &Flight) -> Vec<&[f64]> {
    STATE.into_iter().filter(|column| !flight.absent.contains(column)).map(|column| flight.column(column)).collect()
}

fn at_the_end(index: usize, flight: &Flight) -> Option<Lost> {
    let columns = measured(flight);
    let stands = |sample: &usize| columns.iter().all(|values| values[*sample] == values[*sample - 1]);
    let run = (1..flight.len()).rev().take_while(stands).count();
    flight.rest();
    let longest_s = run as f64 * flight.step_s;
    (longest_s >= LAST_S).then(|| Lost { flight: index, times: 1, longest_s, share: run as f64 / flight.len() as f64 })
}

fn of_sticks(index: usize, flight: &Flight) -> Option<Lost> {
    let columns: Vec<&[f64]> = CONTROLS.into_iter().map(|control| flight.column(control)).collect();
    let least = (STICKS_S / flight.step_s).ceil().max(2.0) as usize;
    let range = |values: &[f64]| {
        let [low, high] = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], u| [low.min(*u), high.max(*u)]);
        high - low
    };
    let large: Vec<f64> = columns.iter().map(|values| (LEAP * usual_change(values)).max(OF_RANGE * range(values))).collect();
    let leaps = |sample: usize| {
        let is_leap = |(values, large): &(&&[f64], &f64)| (values[sample] - values[sample - 1]).abs() > **large;
        columns.iter().zip(&large).filter(is_leap).count() >= JUMPING
    };
    let stands = |sample: usize| columns.iter().all(|values| values[sample] == values[sample - 1]);
    let (mut times, mut longest, mut total, mut sample) = (0, 0, 0, 1);
    while sample < flight.len() {
        let run = if leaps(sample) { (sample + 1..flight.len()).take_while(|next| stands(*next)).count() } else { 0 };
        if run + 1 >= least && sample + run + 1 < flight.len() && leaps(sample + run + 1) {
            (times, longest, total) = (times + 1, longest.max(run + 1), total + run + 1);
        }
        sample += run + 1;
    }
    flight.rest();
    let [longest_s, share] = [longest as f64 * flight.step_s, total as f64 / flight.len() as f64];
    (times > 0).then_some(Lost { flight: index, times, longest_s, share })
}

fn of_flight(index: usize, flight: &Flight) -> Option<Lost> {
    let columns = measured(flight);
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
pub(super) fn usual_change(values: &[f64]) -> f64 {
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0);
    median(changes.collect()).unwrap_or(0.0)
}
