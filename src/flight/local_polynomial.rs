//! Weights of a local polynomial fit: the one tool behind differentiation and resampling.
//!
//! Around a point, samples y_i at offsets s_i (in units of the half-width h) are fitted by Σ_j b_j s^j with the weights
//! w(s) = cos²(π s / 2), |s| < 1. Value b_0 and slope b_1 / h are linear in y, so a set of weights is a filter. A
//! Savitzky–Golay filter is the same with w = 1; the smooth window removes its side lobes.
//! Source: Schmid, Rath & Diebold, ACS Meas. Sci. Au 2 (2022) 185, section "SG filters with fit weights".

use nalgebra::{Matrix4, Vector4};
use std::f64::consts::FRAC_PI_2;

/// What of the fitted polynomial is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Its value at the point.
    #[cfg_attr(not(feature = "files"), allow(dead_code, reason = "only logs are resampled"))]
    Value,
    /// Its derivative at the point, by the unit of the offsets.
    Slope,
}

/// Weights c_i such that Σ c_i y_i is the value or slope at 0 of a polynomial of `degree` (at most 3) fitted to samples at
/// `offsets`; `half_width` is in the same unit. `None` if the samples inside the window do not determine the polynomial.
pub(super) fn weights(offsets: &[f64], half_width: f64, degree: usize, quantity: Quantity) -> Option<Vec<f64>> {
    let window = |s: f64| if s.abs() < 1.0 { (FRAC_PI_2 * s).cos().powi(2) } else { 0.0 };
    let powers = |s: f64| Vector4::from_fn(|power, _| if power <= degree { s.powi(power as i32) } else { 0.0 });
    let mut normal = Matrix4::zeros();
    for s in offsets.iter().map(|offset| offset / half_width) {
        let basis = powers(s);
        normal += basis * basis.transpose() * window(s);
    }
    for unused in degree + 1..4 {
        normal[(unused, unused)] = 1.0;
    }
    let mut wanted = Vector4::zeros();
    match quantity {
        Quantity::Value => wanted[0] = 1.0,
        Quantity::Slope => wanted[1] = 1.0 / half_width,
    }
    let solution = normal.cholesky()?.solve(&wanted);
    if !solution.iter().all(|part| part.is_finite()) {
        return None;
    }
    let weights: Vec<f64> =
        offsets.iter().map(|offset| offset / half_width).map(|s| window(s) * powers(s).dot(&solution)).collect();
    // Nearly as many samples as numbers, some of them at the window's edge: then rounding may be all that is left.
    let moments = weights.iter().zip(offsets).fold(Vector4::zeros(), |sum, (w, offset)| sum + powers(offset / half_width) * *w);
    ((moments - wanted).amax() <= EXACT * wanted.amax()).then_some(weights)
}

/// Polynomials of the degree are reproduced to this, or the samples do not determine them.
const EXACT: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn polynomials_of_the_degree_are_reproduced_on_any_grid(
            jitter in prop::collection::vec(-0.3..0.3, 9), b in prop::array::uniform4(-3.0_f64..3.0), degree in 1_usize..4,
        ) {
            let offsets: Vec<f64> = jitter.iter().enumerate().map(|(index, jitter)| index as f64 - 4.0 + jitter).collect();
            let value = |s: f64| (0..=degree).map(|power| b[power] * s.powi(power as i32)).sum::<f64>();
            for (quantity, truth) in [(Quantity::Value, b[0]), (Quantity::Slope, b[1])] {
                let weights = weights(&offsets, 5.0, degree, quantity);
                prop_assert!(weights.is_some());
                let found: f64 = weights.iter().flatten().zip(&offsets).map(|(weight, &s)| weight * value(s)).sum();
                // Relative to the largest sample, |b| 4.3³ summed.
                prop_assert!((found - truth).abs() <= Tolerance::Close.relative_f64() * 300.0);
            }
        }
    }

    #[test]
    fn samples_that_determine_a_polynomial_by_rounding_alone_do_not() {
        // The fourth lies where the window ends.
        let edge = weights(&[0.0, 0.3, 0.6, 0.999_999_9], 1.0, 3, Quantity::Value);
        assert!(edge.is_none_or(|weights| (weights.iter().sum::<f64>() - 1.0).abs() <= EXACT));
    }

    #[test]
    fn too_few_samples_are_said_so() {
        assert_eq!(weights(&[0.0, 1.0], 3.0, 3, Quantity::Slope), None);
    }
}
