//! Vibration: a line in the spectrum of rates or accelerations, far above what is beside it, as a rotor or a motor shakes a sensor that nothing damps. It says
//! nothing of the flight and makes no effect, but it is an error that no model removes, so it is told. Noise without a line is the business of others.

use super::finding::{Finding, Severity, finding};
use super::flights::{MOST, named};
use super::robust::median;
use super::streams::{ANGULAR, LINEAR};
use super::told::{derived_anew, plus};
use crate::flight::{Column, Flight, Targets};
use std::f64::consts::{PI, TAU};

/// Samples of a block, …
const BLOCK: usize = 128;
/// … of which a flight has so many looked at, at most.
const BLOCKS: usize = 24;
/// Slower lines, Hz, are of the flight: what a pilot and a controller do.
const SLOWEST_HZ: f64 = 6.0;
/// A line's power is so many times the median of those beside it, …
const ABOVE: f64 = 40.0;
/// … which are so many on either side, but for the next ones, into which the window spreads it, …
const BESIDE: usize = 8;
const SPREAD: usize = 2;
/// … and this share of the column's variance within a block.
const LEAST_SHARE: f64 = 0.1;
/// Lines of two flights are the same within so many bins.
const SAME: f64 = 2.0;

/// Where so many of the flights vibrate, all are filtered: it takes little from those that do not.
const MANY: f64 = 0.5;

/// How findings begin.
pub(super) const VIBRATES: &str = "vibration_";

/// A line of a column in a flight.
#[derive(Clone, Copy, Debug)]
struct Line {
    hz: f64,
    /// Half of the way from crest to trough.
    amplitude: f64,
}

/// A warning for each column that vibrates.
pub(super) fn findings(flights: &[Flight]) -> Vec<Finding> {
    let recorded = flights.iter().all(|flight| flight.targets == Targets::Recorded);
    let rates = [Column::Wx, Column::Wy, Column::Wz].into_iter();
    let columns = rates.chain(Column::TARGETS.into_iter().filter(|_| recorded));
    columns.filter_map(|column| of_column(column, flights)).collect()
}

fn of_column(column: Column, flights: &[Flight]) -> Option<Finding> {
    let each = flights.iter().enumerate().filter_map(|(index, flight)| {
        let line = line(flight.column(column), flight.step_s);
        flight.rest();
        Some((index, line?))
    });
    let found: Vec<(usize, Line)> = each.collect();
    let hz = median(found.iter().map(|(_, line)| line.hz).collect())?;
    let bin_hz = 1.0 / (BLOCK as f64 * flights.first()?.step_s);
    let same: Vec<&(usize, Line)> = found.iter().filter(|(_, line)| (line.hz - hz).abs() < SAME * bin_hz).collect();
    let amplitude = median(same.iter().map(|(_, line)| line.amplitude).collect())?;
    let (name, unit) = (column.name(), column.unit());
    let names: Vec<&str> = same.iter().map(|(index, _)| flights[*index].name.as_str()).collect();
    let share = names.len() as f64 / flights.len() as f64;
    let is_set = share > MOST;
    let place = if is_set { String::new() } else { format!("in {}: ", named(&names)) };
    let message = format!(
        "{place}{name} vibrates at {hz:.1} Hz, {amplitude:.2} {unit} up and down: a line in its spectrum, as of a rotor or a motor that shakes the sensor (faster \
         ones show at another frequency, by aliasing); no model removes it, a filter can"
    );
    let set = (share > MANY).then(|| mend(column, hz, flights[0].step_s));
    Some(finding(&format!("{VIBRATES}{name}"), Severity::Warning, message, set.as_deref()))
}

/// A rate through a filter of three taps m samples apart that is 0 at the line, ω₀ = 2π f: y_k = (w_k − 2 cos(m ω₀ Δt) w_{k−m} + w_{k−2m}) / (2 − 2 cos(m ω₀ Δt)),
/// with m nearest to half a period, and late by exactly m samples; accelerations derived anew, with a low-pass.
fn mend(column: Column, hz: f64, step_s: f64) -> String {
    let name = column.name();
    if let Some(stream) = [LINEAR, ANGULAR].iter().find(|stream| stream.contains(&column)) {
        return derived_anew(&stream.map(Column::name));
    }
    let apart_s = (0.5 / (hz * step_s)).round().max(1.0) * step_s;
    let middle = -2.0 * (TAU * hz * apart_s).cos();
    format!(
        "[late] {name} = {apart_s:.4}\n[columns] {name} = \"({name} {} * delay({name}, {apart_s:.4}) + delay({name}, {:.4})) / {:.4}\", with the file's name",
        plus(middle, 4),
        2.0 * apart_s,
        2.0 + middle
    )
}

/// The strongest line of a column; `None` where there is none.
fn line(values: &[f64], step_s: f64) -> Option<Line> {
    let blocks: Vec<&[f64]> = values.chunks_exact(BLOCK).collect();
    let every = blocks.len().div_ceil(BLOCKS).max(1);
    let looked_at: Vec<&[f64]> = blocks.into_iter().step_by(every).collect();
    let (mut power, mut variance) = (vec![0.0; BLOCK / 2], 0.0);
    let turns = turns();
    for block in &looked_at {
        let mean = block.iter().sum::<f64>() / BLOCK as f64;
        let windowed: Vec<f64> = block.iter().enumerate().map(|(at, value)| (value - mean) * window(at)).collect();
        variance += block.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / BLOCK as f64;
        power.iter_mut().enumerate().for_each(|(bin, power)| *power += squared(&windowed, bin, &turns));
    }
    let bin_hz = 1.0 / (BLOCK as f64 * step_s);
    let first = ((SLOWEST_HZ / bin_hz).ceil() as usize).max(SPREAD + 1);
    let at = (first..power.len().saturating_sub(1)).max_by(|one, other| power[*one].total_cmp(&power[*other]))?;
    let beside = (at.saturating_sub(BESIDE).max(1)..(at + BESIDE + 1).min(power.len())).filter(|bin| bin.abs_diff(at) > SPREAD);
    let usual = median(beside.map(|bin| power[bin]).collect())?;
    let count = looked_at.len() as f64;
    // The window halves an amplitude, and a line of amplitude a has BLOCK·a/2 in its bin.
    let amplitude = 4.0 * (power[at] / count).sqrt() / BLOCK as f64;
    let is_line = power[at] > ABOVE * usual && power[at] > power[at - 1] && power[at] > power[at + 1];
    let is_much = 0.5 * amplitude.powi(2) > LEAST_SHARE * variance / count;
    (is_line && is_much).then_some(Line { hz: at as f64 * bin_hz, amplitude })
}

/// Hann's window.
fn window(at: usize) -> f64 {
    (PI * at as f64 / BLOCK as f64).sin().powi(2)
}

/// Cosine and sine of each BLOCKth of a turn.
fn turns() -> [(f64, f64); BLOCK] {
    std::array::from_fn(|at| {
        let (sin, cos) = (TAU * at as f64 / BLOCK as f64).sin_cos();
        (cos, sin)
    })
}

/// Squared magnitude of a bin of the discrete Fourier transform.
fn squared(values: &[f64], bin: usize, turns: &[(f64, f64); BLOCK]) -> f64 {
    let (re, im) = values.iter().enumerate().fold((0.0, 0.0), |(re, im), (at, value)| {
        let (cos, sin) = turns[bin * at % BLOCK];
        (re + value * cos, im + value * sin)
    });
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Noise that is the same every time, and a slow movement.
    fn flight(amplitude: f64, hz: f64) -> Vec<f64> {
        let noise = |at: usize| (((at * 7919 + 13) % 1009) as f64 / 1009.0 - 0.5) * 0.4;
        (0..4000).map(|at| (0.03 * at as f64).sin() + noise(at) + amplitude * (TAU * hz * 0.01 * at as f64 + 0.3).sin()).collect()
    }

    proptest! {
        #[test]
        fn a_line_is_found_with_its_frequency_and_size(amplitude in 0.5..5.0_f64, hz in 10.0..40.0_f64) {
            let found = line(&flight(amplitude, hz), 0.01).expect("a line");
            prop_assert!((found.hz - hz).abs() < 0.8, "{found:?}");
            // Between two bins the window loses 15 %.
            prop_assert!((found.amplitude / amplitude - 1.0).abs() < 0.2, "{found:?}");
        }
    }

    #[test]
    fn noise_and_slow_movements_are_no_vibration() {
        assert!(line(&flight(0.0, 20.0), 0.01).is_none());
        assert!(line(&flight(3.0, 2.0), 0.01).is_none());
        assert!(line(&[0.0; 500], 0.01).is_none(), "at rest");
        assert!(line(&[1.0; 50], 0.01).is_none(), "too short");
    }
}
