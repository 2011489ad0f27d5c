//! The residual in time: how long it lasts, at which frequencies it lies, and whether the sticks follow it.
//!
//! Correlations and spectra only; a stick that follows the residual is a warning about what regression can tell, not an effect.

use super::{blocks, channel, feature};
use crate::blocks::{BlockMean, BlockSum};
use crate::critique::unknown::ResidualTable;
use crate::error::{Error, Result};
use crate::flight::Channel;
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Longest lag of [`autocorrelation`], s.
pub const AUTOCORRELATION_S: f64 = 3.0;
/// Longest lag of [`stick_correlations`] either way, s.
pub const CROSS_CORRELATION_S: f64 = 1.0;
/// Longest segment of a spectrum, s: lines 0.05 Hz apart.
const SEGMENT_S: f64 = 20.0;
/// Multiple of the 95 % band from which a correlation is clearly beyond it: about four standard errors, because the largest of some
/// hundred correlations is looked at.
const CLEARLY: f64 = 2.0;
/// How much larger the correlation before the stick must be than that at the same instant.
const LEADS: f64 = 1.03;

/// Autocorrelation of one channel's residual.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Autocorrelation {
    /// Channel by name.
    pub channel: &'static str,
    /// Lags, s, from 0 to at most [`AUTOCORRELATION_S`].
    pub lag_s: Vec<f64>,
    /// Correlation at each lag, 1 at lag 0.
    pub correlation: Vec<f64>,
    /// Where the correlation first falls below 1/e, s; absent if it does not.
    pub lasts_s: Option<f64>,
}

/// Spectrum of one channel's residual.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Channel by name.
    pub channel: &'static str,
    /// Frequencies, Hz, up to half the rate of the rows. The mean over a row has already taken off part of the upper end.
    pub frequency_hz: Vec<f64>,
    /// One-sided density, (m/s²)²/Hz or (rad/s²)²/Hz; its integral is the variance within segments.
    pub density: Vec<f64>,
    /// Segments averaged, half overlapping; 0 and no lines if no stretch is long enough.
    pub segments: usize,
}

/// Correlation of one stick with one channel's residual at lags.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StickCorrelation {
    /// Stick by name.
    pub stick: &'static str,
    /// Channel by name.
    pub channel: &'static str,
    /// Lags, s, of the residual behind the stick: at a negative lag the residual comes first.
    pub lag_s: Vec<f64>,
    /// Correlation of stick at t with residual at t + lag, both about their mean in the block.
    pub correlation: Vec<f64>,
    /// Half-width of the 95 % band about zero at each lag, from the scatter between blocks.
    pub band95: Vec<f64>,
    /// Whether the largest correlation lies at a negative lag, clearly beyond the band and above that at lag 0: the stick answers to
    /// the residual. What the stick then explains at lags ≥ 0 need not be its effect.
    pub feedback_warning: bool,
}

/// Time from row to row, s: the median over neighbouring rows of a block.
fn step_s(table: &ResidualTable) -> Result<f64> {
    let pairs = table.time_s.windows(2).zip(table.block.windows(2)).filter(|(_, blocks)| blocks[0] == blocks[1]);
    let mut steps: Vec<f64> = pairs.map(|(times, _)| times[1] - times[0]).collect();
    let middle = steps.len() / 2;
    let missing = || Error::Undetermined("blocks of a single row have no course in time; give longer blocks".into());
    if steps.is_empty() {
        return Err(missing());
    }
    let step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    (step > 0.0 && step.is_finite()).then_some(step).ok_or_else(missing)
}

/// Autocorrelation of each channel's residual, about its mean over all rows, from pairs of rows in one block:
/// ρ(k) = mean of r_t r_{t+k} / mean of r_t².
///
/// # Errors
/// [`Error::Undetermined`] if no block has two rows, [`Error::Shape`] for columns of unequal length.
pub fn autocorrelation(table: &ResidualTable) -> Result<Vec<Autocorrelation>> {
    let (step_s, blocks) = (step_s(table)?, table.blocks());
    let longest = blocks.iter().map(ExactSizeIterator::len).max().unwrap_or(1);
    let lags = ((AUTOCORRELATION_S / step_s).round() as usize).min(longest - 1);
    let of = |of: Channel| {
        let (values, name) = channel(table, of)?;
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let values: Vec<f64> = values.iter().map(|value| value - mean).collect();
        let moment = |lag: usize| {
            let (mut sum, mut count) = (0.0, 0);
            for range in &blocks {
                let values = values.get(range.clone()).unwrap_or_default();
                let later = values.get(lag..).unwrap_or_default();
                sum += values.iter().zip(later).map(|(a, b)| a * b).sum::<f64>();
                count += later.len();
            }
            sum / f64::from(u32::try_from(count.max(1)).unwrap_or(u32::MAX))
        };
        let variance = moment(0);
        let scaled = |lag: usize| if variance > 0.0 { moment(lag) / variance } else { 0.0 };
        let correlation: Vec<f64> = (0..=lags).map(scaled).collect();
        let below = correlation.iter().position(|value| *value < (-1.0_f64).exp()).filter(|at| *at > 0);
        let lasts_s = below.map(|at| {
            let (before, after) = (correlation[at - 1], correlation[at]);
            step_s * (at as f64 - 1.0 + (before - (-1.0_f64).exp()) / (before - after))
        });
        let lag_s = (0..=lags).map(|lag| step_s * lag as f64).collect();
        Ok(Autocorrelation { channel: name, lag_s, correlation, lasts_s })
    };
    Channel::ALL.into_iter().map(of).collect()
}

/// Runs of rows of one flight without a gap.
fn stretches(table: &ResidualTable, step_s: f64) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for row in 0..table.len() {
        let follows = row > 0
            && table.flight[row] == table.flight[row - 1]
            && (table.time_s[row] - table.time_s[row - 1] - step_s).abs() < 0.01 * step_s;
        match found.last_mut().filter(|_| follows) {
            Some(range) => range.end = row + 1,
            None => found.push(row..row + 1),
        }
    }
    found
}

/// Spectral density of each channel's residual: periodograms of segments under a Hann window, half overlapping, averaged
/// (Welch 1967). Segments are the longest power of two of rows within 20 s and within the longest stretch without a gap.
///
/// # Errors
/// As [`autocorrelation`].
pub fn spectrum(table: &ResidualTable) -> Result<Vec<Spectrum>> {
    let step_s = step_s(table)?;
    if table.flight.len() != table.len() || table.time_s.len() != table.len() {
        return Err(Error::Shape { operation: "spectrum", message: "flight and time for every row are needed".into() });
    }
    let stretches = stretches(table, step_s);
    let longest = stretches.iter().map(ExactSizeIterator::len).max().unwrap_or(0).min((SEGMENT_S / step_s).round() as usize);
    let length = if longest >= 8 { 1 << longest.ilog2() } else { 0 };
    let window: Vec<f64> = (0..length).map(|row| 0.5 - 0.5 * (TAU * row as f64 / length as f64).cos()).collect();
    let power: f64 = window.iter().map(|weight| weight * weight).sum();
    let of = |of: Channel| {
        let (values, name) = channel(table, of)?;
        let (mut density, mut segments) = (vec![0.0; if length == 0 { 0 } else { length / 2 + 1 }], 0);
        for range in stretches.iter().filter(|range| length > 0 && range.len() >= length) {
            for start in (range.start..=range.end - length).step_by(length / 2) {
                let segment = &values[start..start + length];
                let mean = segment.iter().sum::<f64>() / length as f64;
                let mut transform: Vec<[f64; 2]> =
                    segment.iter().zip(&window).map(|(value, weight)| [weight * (value - mean), 0.0]).collect();
                fourier(&mut transform);
                for (line, (sum, [real, imaginary])) in density.iter_mut().zip(&transform).enumerate() {
                    let sides = if line == 0 || line == length / 2 { 1.0 } else { 2.0 };
                    *sum += sides * (real * real + imaginary * imaginary) * step_s / power;
                }
                segments += 1;
            }
        }
        density.iter_mut().for_each(|value| *value /= f64::from(segments.max(1)));
        let frequency_hz = (0..density.len()).map(|line| line as f64 / (length as f64 * step_s)).collect();
        Ok(Spectrum { channel: name, frequency_hz, density, segments: segments as usize })
    };
    Channel::ALL.into_iter().map(of).collect()
}

/// Discrete Fourier transform in place, radix two (Cooley & Tukey 1965); the length is a power of two.
fn fourier(values: &mut [[f64; 2]]) {
    let length = values.len();
    if length < 2 {
        return;
    }
    let bits = length.trailing_zeros();
    for index in 0..length {
        let other = index.reverse_bits() >> (usize::BITS - bits);
        if index < other {
            values.swap(index, other);
        }
    }
    let mut half = 1;
    while half < length {
        for (place, (sine, cosine)) in (0..half).map(|place| (place, (-PI * place as f64 / half as f64).sin_cos())) {
            for start in (place..length).step_by(2 * half) {
                let ([a, b], [c, d]) = (values[start], values[start + half]);
                let (c, d) = (c * cosine - d * sine, c * sine + d * cosine);
                values[start] = [a + c, b + d];
                values[start + half] = [a - c, b - d];
            }
        }
        half *= 2;
    }
}

/// Correlation of each stick in the table with each channel's residual at lags of ±[`CROSS_CORRELATION_S`].
///
/// # Errors
/// As [`autocorrelation`].
pub fn stick_correlations(table: &ResidualTable) -> Result<Vec<StickCorrelation>> {
    let (step_s, ranges, count) = (step_s(table)?, table.blocks(), blocks(table));
    let longest = ranges.iter().map(ExactSizeIterator::len).max().unwrap_or(1);
    let reach = ((CROSS_CORRELATION_S / step_s).round() as usize).min(longest / 2);
    let centred = |values: &[f64]| -> Vec<Vec<f64>> {
        let of = |range: &Range<usize>| {
            let values = values.get(range.clone()).unwrap_or_default();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            values.iter().map(|value| value - mean).collect()
        };
        ranges.iter().map(of).collect()
    };
    let rms = |blocks: &[Vec<f64>]| {
        let squares: f64 = blocks.iter().flatten().map(|value| value * value).sum();
        (squares / table.len().max(1) as f64).sqrt()
    };
    let mut found = Vec::new();
    for stick in ["u1", "u2", "u3", "u4"] {
        let Ok(sticks) = feature(table, stick) else { continue };
        let sticks = centred(sticks);
        for of in Channel::ALL {
            let (values, name) = channel(table, of)?;
            let residuals = centred(values);
            let scale = rms(&sticks) * rms(&residuals);
            let mut of = StickCorrelation {
                stick,
                channel: name,
                lag_s: Vec::new(),
                correlation: Vec::new(),
                band95: Vec::new(),
                feedback_warning: false,
            };
            for place in 0..=2 * reach {
                let (before, after) = (reach.saturating_sub(place), place.saturating_sub(reach));
                let sums = sticks.iter().zip(&residuals).map(|(stick, residual)| {
                    let pairs = stick.iter().skip(before).zip(residual.iter().skip(after));
                    let samples = (stick.len().saturating_sub(before + after)) as f64;
                    BlockSum { samples, sum: pairs.map(|(stick, residual)| stick * residual).sum() }
                });
                let mean = BlockMean::new(sums).filter(|_| scale > 0.0);
                of.lag_s.push(step_s * (place as f64 - reach as f64));
                of.correlation.push(mean.map_or(0.0, |mean| mean.mean / scale));
                let half = mean.and_then(|mean| mean.interval()).map(|[low, high]| 0.5 * (high - low) / scale);
                of.band95.push(half.unwrap_or(f64::INFINITY));
            }
            let size = |place: usize| of.correlation.get(place).map_or(0.0, |value| value.abs());
            let largest = (0..=2 * reach).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(reach);
            of.feedback_warning = count > 1
                && largest < reach
                && size(largest) > CLEARLY * of.band95.get(largest).copied().unwrap_or(f64::INFINITY)
                && size(largest) > LEADS * size(reach);
            found.push(of);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::super::testing::table;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn noise_of_half_a_second_lasts_half_a_second() -> Result<()> {
        let found = autocorrelation(&table(1, 40))?;
        assert!(found.len() == 6 && found[0].lag_s.len() == 31);
        for channel in found {
            assert!((channel.correlation[0] - 1.0).abs() < 1e-12);
            assert!(channel.lasts_s.is_some_and(|lasts| (lasts - 0.5).abs() < 0.1), "{:?}", channel.lasts_s);
        }
        assert!(autocorrelation(&ResidualTable::default()).is_err());
        Ok(())
    }

    #[test]
    fn a_tone_stands_in_the_spectrum_at_its_frequency() -> Result<()> {
        let mut table = table(2, 20);
        let tone: Vec<f64> = table.time_s.iter().map(|time| 2.0 * (TAU * 1.875 * time).sin()).collect();
        table.residual[Channel::WyDot].iter_mut().zip(tone).for_each(|(residual, tone)| *residual = 0.1 * *residual + tone);
        let found = spectrum(&table)?;
        let density = &found[4].density;
        let peak = (0..density.len()).max_by(|a, b| density[*a].total_cmp(&density[*b])).unwrap_or(0);
        assert!((found[4].frequency_hz[peak] - 1.875).abs() < 0.06, "{}", found[4].frequency_hz[peak]);
        let power: f64 = density.iter().sum::<f64>() * found[4].frequency_hz[1];
        assert!((power - 2.01).abs() < 0.1, "{power} is the variance");
        assert!(found[4].segments >= 20 * 5);
        Ok(())
    }

    #[test]
    fn a_stick_that_answers_is_warned_of_and_one_that_acts_is_not() -> Result<()> {
        let warned = |table: &ResidualTable| -> Result<Vec<&'static str>> {
            Ok(stick_correlations(table)?.into_iter().filter(|found| found.feedback_warning).map(|found| found.channel).collect())
        };
        let plain = table(3, 40);
        assert_eq!(warned(&plain)?, Vec::<&str>::new());
        let mut answers = plain.clone();
        for row in 3..answers.len() {
            answers.features[2][row] -= 0.8 * answers.residual[Channel::WxDot][row - 3];
        }
        assert_eq!(warned(&answers)?, ["wx_dot"]);
        let found = stick_correlations(&answers)?;
        let wx = &found[3];
        let place = (0..21).max_by(|a, b| wx.correlation[*a].abs().total_cmp(&wx.correlation[*b].abs())).unwrap_or(0);
        assert!((wx.lag_s[place] + 0.3).abs() < 1e-9 && wx.correlation[place] < -0.4);
        let mut acts = plain.clone();
        for row in 2..acts.len() {
            acts.residual[Channel::WxDot][row] += acts.features[2][row - 2];
        }
        assert_eq!(warned(&acts)?, Vec::<&str>::new());
        Ok(())
    }

    #[test]
    fn the_band_holds_what_is_not_there() -> Result<()> {
        let (mut inside, mut all) = (0, 0);
        for seed in 0..5 {
            for found in stick_correlations(&table(100 + seed, 30))? {
                inside += found.correlation.iter().zip(&found.band95).filter(|(value, band)| value.abs() < **band).count();
                all += found.correlation.len();
            }
        }
        let share = inside as f64 / all as f64;
        assert!((0.91..0.99).contains(&share), "{share} of the correlations of independent noises lie in the 95 % band");
        Ok(())
    }

    proptest! {
        #[test]
        fn the_transform_is_the_sum_it_stands_for(values in prop::collection::vec(-3.0..3.0_f64, 16), line in 0..16_usize) {
            let mut fast: Vec<[f64; 2]> = values.iter().map(|value| [*value, 0.0]).collect();
            fourier(&mut fast);
            let angle = |row: usize| -TAU * (line * row) as f64 / 16.0;
            let real: f64 = values.iter().enumerate().map(|(row, value)| value * angle(row).cos()).sum();
            let imaginary: f64 = values.iter().enumerate().map(|(row, value)| value * angle(row).sin()).sum();
            prop_assert!((fast[line][0] - real).abs() < 1e-9 && (fast[line][1] - imaginary).abs() < 1e-9);
        }
    }
}
