//! Fixed affine scales, from the training part only: inputs to unit scale, and the network's outputs back to physical units.

use crate::flight::{PerChannel, Span};
use serde::{Deserialize, Serialize};

/// Mean and standard deviation of one channel: scaled = (value − mean) / deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Mean over the training spans, in the channel's unit.
    pub mean: f64,
    /// Standard deviation over the training spans, in the channel's unit; 1 for a channel that never changes.
    pub deviation: f64,
}

impl Scale {
    /// The scale of `columns[flight]` over `spans`. Two passes in f64.
    pub fn of(columns: &[&[f64]], spans: &[Span]) -> Self {
        let values = || spans.iter().flat_map(|span| &columns[span.flight][span.start..span.end]);
        let count = values().count().max(1) as f64;
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        // A constant channel has only rounding for a variance; blowing that up to unit scale would feed noise.
        let constant = variance.sqrt() <= 1e-12 * mean.abs().max(1.0);
        Self { mean, deviation: if constant { 1.0 } else { variance.sqrt() } }
    }

    /// (value − mean) / deviation
    pub fn apply(self, value: f64) -> f64 {
        (value - self.mean) / self.deviation
    }
}

/// The scales of a hybrid: every channel of the state sequence S, of the physics sequence P, and of the output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scaling {
    /// Of the state-control channels, in the order of the hybrid's inputs.
    pub state: Vec<Scale>,
    /// Of the baseline accelerations a^p.
    pub physics: PerChannel<Scale>,
    /// Of what the network predicts (the residual, or the acceleration itself): r̂ = deviation ∘ net + mean. Fixed, so that
    /// the loss stays in physical units (paper eq. 13) while the last layer works at unit scale.
    pub output: PerChannel<Scale>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn scaled_training_data_have_mean_zero_and_deviation_one(values in prop::collection::vec(-1e3f64..1e3, 10..100), shift in -1e4f64..1e4) {
            let shifted: Vec<f64> = values.iter().map(|value| value + shift).collect();
            let span = Span { flight: 0, start: 2, end: shifted.len() };
            let scale = Scale::of(&[&shifted], &[span]);
            let scaled: Vec<f64> = shifted[2..].iter().map(|value| scale.apply(*value)).collect();
            let mean = scaled.iter().sum::<f64>() / scaled.len() as f64;
            let deviation = (scaled.iter().map(|value| value * value).sum::<f64>() / scaled.len() as f64).sqrt();
            prop_assert!(mean.abs() < phyture_kernels::Tolerance::Approximate.relative_f64());
            prop_assert!((deviation - 1.0).abs() < phyture_kernels::Tolerance::Approximate.relative_f64());
        }
    }

    #[test]
    fn a_constant_channel_is_only_shifted() {
        let scale = Scale::of(&[&[0.1; 50]], &[Span { flight: 0, start: 0, end: 50 }]);
        assert_eq!(scale.deviation.to_bits(), 1.0f64.to_bits());
    }

    #[test]
    fn samples_outside_the_training_spans_do_not_count() {
        let values = [1.0, 3.0, 1e9, f64::MAX];
        let scale = Scale::of(&[&values], &[Span { flight: 0, start: 0, end: 2 }]);
        assert_eq!(scale, Scale { mean: 2.0, deviation: 1.0 });
    }
}
