//! The zero-phase differentiator that gives the accelerations where a log has none.
//!
//! Slope of a local cubic fitted with a cos² window (see `local_polynomial`). Inside a record the weights are the same
//! everywhere and antisymmetric: no phase lag at any frequency, exact on polynomials up to degree 4, and a gain on
//! the true derivative that falls from 1 through −3 dB at the cut-off and stays small above it. Where the window leaves the record the fit is
//! one-sided: a parabola over a window up to twice as wide, exact up to degree 2, with more noise. Derivatives are
//! those of the columns given: for v the *body components* v̇, not the inertial acceleration.

use super::bounds::LOWEST_CUTOFF;
use super::local_polynomial::{Quantity, weights};
use crate::error::{Error, Result};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// −3 dB frequency where nothing else is said, Hz: above the rigid-body and flapping modes of a small helicopter (up to some 6 Hz),
/// below its rotor's once-per-revolution (30 Hz at 1800 rpm).
pub const DEFAULT_CUTOFF_HZ: f64 = 10.0;

/// Highest cut-off as a part of the sampling rate: the narrowest window, five samples, reaches 0.30.
pub const HIGHEST_CUTOFF: f64 = 0.3;
/// Half-width of the narrowest window, samples.
const LEAST_HALF_WIDTH: f64 = 2.05;

/// A differentiator for one sampling step and cut-off.
#[derive(Clone, Debug)]
pub struct Differentiator {
    step_s: f64,
    /// Half-width of the window, samples (not a whole number).
    half_width: f64,
    /// Weights of y[k+1] − y[k−1], y[k+2] − y[k−2], …, 1/s.
    interior: Vec<f64>,
}

impl Differentiator {
    /// A differentiator for records sampled every `step_s` seconds whose gain on the derivative is −3 dB at `cutoff_hz`.
    ///
    /// # Errors
    /// [`Error::Config`] if the cut-off is above 0.3 of the sampling rate (a window of five samples) or below 5·10⁻⁵ of it (40 000 samples).
    pub fn new(step_s: f64, cutoff_hz: f64) -> Result<Self> {
        let relative = cutoff_hz * step_s;
        if !(LOWEST_CUTOFF..=HIGHEST_CUTOFF).contains(&relative) {
            return Err(Error::Config {
                place: "differentiator".into(),
                field: "cutoff_hz".into(),
                found: cutoff_hz.to_string(),
                expected: format!(
                    "from {:.3} Hz to {:.3} Hz at this sampling step of {step_s} s",
                    LOWEST_CUTOFF / step_s,
                    HIGHEST_CUTOFF / step_s
                ),
            });
        }
        // The cut-off falls as the window widens, about as 1/h: bracket, then bisect.
        let (mut narrow, mut wide) = (LEAST_HALF_WIDTH, LEAST_HALF_WIDTH + 2.0 / relative);
        for _ in 0..50 {
            let middle = 0.5 * (narrow + wide);
            if gain(&half_kernel(middle), relative) > FRAC_1_SQRT_2 { narrow = middle } else { wide = middle }
        }
        let interior = half_kernel(narrow).into_iter().map(|weight| weight / step_s).collect();
        Ok(Self { step_s, half_width: narrow, interior })
    }

    /// Gain on the true derivative of a sine of this frequency, Hz, inside a record: 1 is exact; phase is zero throughout.
    pub fn gain(&self, frequency_hz: f64) -> f64 {
        let kernel: Vec<f64> = self.interior.iter().map(|weight| weight * self.step_s).collect();
        gain(&kernel, frequency_hz * self.step_s)
    }

    /// How far, s, the result at a sample depends on samples before and after it.
    pub fn reach_s(&self) -> f64 {
        self.interior.len() as f64 * self.step_s
    }

    /// Time derivative of a column, in its unit a second, one value a sample.
    ///
    /// # Errors
    /// [`Error::Undetermined`] for fewer than three samples.
    pub fn derivative(&self, values: &[f64]) -> Result<Vec<f64>> {
        let (samples, reach) = (values.len(), self.interior.len());
        if samples < 3 {
            return Err(too_few(samples));
        }
        let mut derivative = vec![0.0; samples];
        for (at, out) in derivative.iter_mut().enumerate() {
            *out = if at >= reach && at + reach < samples {
                let pairs = self.interior.iter().enumerate();
                pairs.map(|(k, weight)| weight * (values[at + k + 1] - values[at - k - 1])).sum()
            } else {
                self.one_sided(values, at)?
            };
        }
        Ok(derivative)
    }

    /// What is left of a column in the band of derived accelerations, in its own unit, one value a sample: the derivative of its running
    /// integral, by trapezoids.
    ///
    /// # Errors
    /// As [`Differentiator::derivative`].
    pub fn band(&self, values: &[f64]) -> Result<Vec<f64>> {
        let mut integral = vec![0.0; values.len()];
        for at in 1..values.len() {
            integral[at] = integral[at - 1] + 0.5 * self.step_s * (values[at - 1] + values[at]);
        }
        self.derivative(&integral)
    }

    /// Near an end: the window is widened by as much as the record cuts off.
    fn one_sided(&self, values: &[f64], at: usize) -> Result<f64> {
        let available = (at.min(values.len() - 1 - at) as f64).min(self.half_width);
        let half_width = (2.0 * self.half_width - available).max(LEAST_HALF_WIDTH + 1.0);
        let reach = half_width as usize;
        let (start, end) = (at.saturating_sub(reach), (at + reach + 1).min(values.len()));
        let offsets: Vec<f64> = (start..end).map(|sample| sample as f64 - at as f64).collect();
        let weights = weights(&offsets, half_width, 2, Quantity::Slope).ok_or_else(|| too_few(values.len()))?;
        Ok(weights.iter().zip(&values[start..end]).map(|(weight, value)| weight * value).sum::<f64>() / self.step_s)
    }
}

fn too_few(samples: usize) -> Error {
    Error::Undetermined(format!("{samples} samples do not determine a derivative; at least three are needed"))
}

/// Derivative of one column; see [`Differentiator`].
///
/// # Errors
/// As [`Differentiator::new`] and [`Differentiator::derivative`].
pub fn differentiate(values: &[f64], step_s: f64, cutoff_hz: f64) -> Result<Vec<f64>> {
    Differentiator::new(step_s, cutoff_hz)?.derivative(values)
}

/// Weights at +1, +2, … samples of the antisymmetric interior kernel, for a step of 1.
fn half_kernel(half_width: f64) -> Vec<f64> {
    let reach = half_width.ceil() as usize - 1;
    let offsets: Vec<f64> = (0..=2 * reach).map(|index| index as f64 - reach as f64).collect();
    weights(&offsets, half_width, 3, Quantity::Slope).map(|weights| weights[reach + 1..].to_vec()).unwrap_or_default()
}

/// Σ 2 c_k sin(2π f k) / (2π f), f in cycles a sample.
fn gain(kernel: &[f64], frequency: f64) -> f64 {
    let turn = 2.0 * PI * frequency;
    kernel.iter().enumerate().map(|(k, weight)| 2.0 * weight * (turn * (k + 1) as f64).sin()).sum::<f64>() / turn
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.01;

    fn polynomial(coefficients: &[f64], t: f64) -> f64 {
        coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
    }

    proptest! {
        #[test]
        fn polynomials_are_exact_inside_to_degree_four_and_at_the_ends_to_two(
            b in prop::array::uniform5(-2.0..2.0), cutoff_hz in 1.0..30.0,
        ) {
            let times: Vec<f64> = (0..400).map(|sample| sample as f64 * STEP_S).collect();
            for (degree, everywhere) in [(4, false), (2, true)] {
                let b = &b[..=degree];
                let slope: Vec<f64> = (1..=degree).map(|power| b[power] * power as f64).collect();
                let values: Vec<f64> = times.iter().map(|&t| polynomial(b, t)).collect();
                let differentiator = Differentiator::new(STEP_S, cutoff_hz)?;
                let found = differentiator.derivative(&values)?;
                let reach = if everywhere { 0 } else { (differentiator.reach_s() / STEP_S).round() as usize };
                for sample in reach..400 - reach {
                    // Rounding of values up to 2·4⁴ is divided by the step.
                    let scale = polynomial(&[2.0; 5], 4.0) / STEP_S;
                    prop_assert!((found[sample] - polynomial(&slope, times[sample])).abs() <= Tolerance::Close.relative_f64() * scale);
                }
            }
        }

        #[test]
        fn the_cutoff_is_where_it_was_asked_for(cutoff_hz in 0.5..30.0) {
            let differentiator = Differentiator::new(STEP_S, cutoff_hz)?;
            prop_assert!((differentiator.gain(cutoff_hz) - FRAC_1_SQRT_2).abs() <= Tolerance::Approximate.relative_f64());
            prop_assert!((differentiator.gain(cutoff_hz / 100.0) - 1.0).abs() <= Tolerance::Approximate.relative_f64());
        }

        #[test]
        fn a_column_is_held_to_the_band_in_which_its_derivative_shows(
            cutoff_hz in 2.0..25.0f64, frequency_hz in 0.2..30.0f64, phase in 0.0..6.0f64, level in -5.0..5.0f64,
        ) {
            let differentiator = Differentiator::new(STEP_S, cutoff_hz)?;
            let turn = 2.0 * PI * frequency_hz;
            let wave: Vec<f64> = (0..600).map(|sample: i32| level + f64::sin(turn * STEP_S * f64::from(sample) + phase)).collect();
            let found = differentiator.band(&wave)?;
            // What trapezoids make of the integral of a sine, times what the differentiator makes of it.
            let half = 0.5 * turn * STEP_S;
            let gain = differentiator.gain(frequency_hz) * half / half.tan();
            let reach = (differentiator.reach_s() / STEP_S).round() as usize;
            for sample in reach..600 - reach {
                prop_assert!((found[sample] - level - gain * (wave[sample] - level)).abs() < 1e-9);
            }
        }

        #[test]
        fn a_record_played_backwards_gives_the_same_slopes_negated(values in prop::collection::vec(-1.0..1.0, 3..80)) {
            let forward = differentiate(&values, STEP_S, 10.0)?;
            let reversed: Vec<f64> = values.iter().rev().copied().collect();
            let backward = differentiate(&reversed, STEP_S, 10.0)?;
            for (a, b) in forward.iter().zip(backward.iter().rev()) {
                prop_assert!((a + b).abs() <= Tolerance::Close.relative_f64() / STEP_S);
            }
        }
    }

    #[test]
    fn the_default_at_100_hz_passes_body_motion_and_stops_the_rotor() -> Result<()> {
        let differentiator = Differentiator::new(STEP_S, DEFAULT_CUTOFF_HZ)?;
        // Stated in the user's documentation: within 2 % to 4.5 Hz, under 3 % from 25 Hz on.
        assert!(differentiator.gain(4.5) > 0.98, "{}", differentiator.gain(4.5));
        assert!((25..50).all(|hz| differentiator.gain(f64::from(hz)).abs() < 0.03));
        Ok(())
    }

    #[test]
    fn what_cannot_be_done_is_said() {
        assert!(matches!(differentiate(&[1.0, 2.0], STEP_S, 10.0), Err(Error::Undetermined(_))));
        let refused = Differentiator::new(STEP_S, 40.0).map_err(|error| error.to_string());
        assert!(matches!(refused, Err(text) if text.contains("from 0.005 Hz to 30.000 Hz")));
        assert!(matches!(Differentiator::new(STEP_S, 1e-300), Err(Error::Config { .. })));
    }
}
