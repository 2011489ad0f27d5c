//! Sticks that are the demand of a rate controller, as with a gyro that holds the heading: the rate is what the stick said a moment before, nearly without rest. What
//! moves the axis is then not in the log, and the lag of the loop looks like one of the aircraft.

use super::finding::Finding;
use super::flights::of_set_or_flights;
use super::increments::Motion;
use super::repairs::lagged;
use super::robust::median;
use super::sticks::STICKS;
use crate::flight::Flight;

/// The stick of some time before leaves this share of the variance of the rate at most …
const LEFT: f64 = 0.01;
/// … and this part of what the stick behind a lag leaves: an axis that damps itself is behind one, and gusts and other sticks move it besides.
const LESS: f64 = 0.25;
/// Latest that the rate follows, s, and in how many steps it is looked for.
const LATEST_S: f64 = 0.5;
const STEPS: usize = 50;
/// Time constants of such an axis, s.
const LAGS_S: [f64; 8] = [0.03, 0.05, 0.08, 0.12, 0.18, 0.27, 0.4, 0.6];
/// Samples of a flight that are looked at, about.
const LOOKED_AT: usize = 3_000;

/// By stick, the time after which the rate is there, s, in a flight where it follows.
pub(super) type Followed = [Option<f64>; 3];

/// Looks at one flight.
pub(super) fn of(motion: &Motion) -> Followed {
    let most = (LATEST_S / motion.step_s).round() as usize;
    let samples = motion.instants.len().saturating_sub(most);
    let every = samples.div_ceil(LOOKED_AT).max(1);
    std::array::from_fn(|axis| {
        let stick: Vec<f64> = motion.instants.iter().map(|instant| instant.controls[axis]).collect();
        let rate = |sample: usize| motion.instants[sample].rates[axis];
        let left = |stick: &[f64], shift: usize| {
            1.0 - correlation((0..samples).step_by(every).map(|k| [stick[k], rate(k + shift)])).powi(2)
        };
        let shifts = (0..=most).step_by(most.div_ceil(STEPS).max(1));
        let (least, shift) = shifts.map(|shift| (left(&stick, shift), shift)).min_by(|one, other| one.0.total_cmp(&other.0))?;
        if least > LEFT {
            return None;
        }
        let behind = LAGS_S.map(|time_s| left(&lagged(&stick, time_s, motion.step_s), 0));
        let is_shift = behind.into_iter().all(|behind| least < LESS * behind);
        is_shift.then_some(shift as f64 * motion.step_s)
    })
}

/// Of pairs; 0 where one of the two stands still.
fn correlation(pairs: impl Iterator<Item = [f64; 2]>) -> f64 {
    let mut sums = [0.0; 6];
    for [x, y] in pairs {
        sums.iter_mut().zip([1.0, x, y, x * x, y * y, x * y]).for_each(|(sum, value)| *sum += value);
    }
    let [count, x, y, xx, yy, xy] = sums;
    let variances = (xx - x * x / count) * (yy - y * y / count);
    if variances > 0.0 { (xy - x * y / count) / variances.sqrt() } else { 0.0 }
}

/// A finding for each stick.
pub(super) fn findings(each: &[(usize, Followed)], flights: &[Flight]) -> Vec<Finding> {
    let of = |stick: usize| {
        let such: Vec<(usize, f64)> = each.iter().filter_map(|(flight, followed)| Some((*flight, followed[stick]?))).collect();
        let after_s = median(such.iter().map(|entry| entry.1).collect())?;
        let (name, rate) = (STICKS[stick], ["roll", "pitch", "yaw"][stick]);
        let message = format!(
            "{name} is the {rate} rate of {:.0} ms later: the demand of a rate controller, such as a gyro that holds the heading, and not what moves the \
             axis. Record what goes to the servo",
            1e3 * after_s
        );
        let indices: Vec<usize> = such.iter().map(|entry| entry.0).collect();
        Some(of_set_or_flights(&format!("demand_{name}"), &indices, each.len(), &message, None, flights))
    };
    (0..3).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_that_of_the_textbook() {
        let pairs = [[1.0, 2.0], [2.0, 1.0], [3.0, 4.0], [4.0, 3.0]];
        assert!((correlation(pairs.into_iter()) - 0.6).abs() < 1e-12);
        assert_eq!(correlation([[1.0, 2.0], [1.0, 3.0]].into_iter()), 0.0);
    }
}
