//! Resampling of a log to another constant rate, also from stamps that jitter.
//!
//! The value at each new time is that of a local cubic with a cos² window (see `local_polynomial`) whose half-width is 2.5 of the
//! longer of the two steps: zero-phase, exact on cubics, and band-limiting when the new rate is the lower one (−3 dB near
//! 0.29 of the new rate, under 6 % from 0.5 on).

use super::bounds::{MOST_NEW_PER_OLD, MOST_SAMPLES};
use super::local_polynomial::{Quantity, weights};
use crate::error::{Error, Result};

/// Half-width of the window in steps.
const HALF_WIDTH_STEPS: f64 = 2.5;

/// New times and, for each, the first old sample and the weights that give the value there.
pub(super) struct Resampler {
    /// The new times, s.
    pub time_s: Vec<f64>,
    taps: Vec<(usize, Vec<f64>)>,
}

impl Resampler {
    /// From samples at increasing `time_s` to one every `step_s` from the first time on.
    ///
    /// # Errors
    /// [`Error::Undetermined`] for fewer than four samples, or more new ones than a log may have or than its own can carry.
    pub fn new(time_s: &[f64], step_s: f64) -> Result<Self> {
        let few = || Error::Undetermined(format!("{} samples are too few to resample; four are needed", time_s.len()));
        let (Some(&first), Some(&last)) = (time_s.first(), time_s.last()) else { return Err(few()) };
        if time_s.len() < 4 {
            return Err(few());
        }
        let old_step_s = (last - first) / (time_s.len() - 1) as f64;
        // Rounding must not lose the last sample.
        let steps = (last - first) / step_s * (1.0 + 4.0 * f64::EPSILON);
        if steps.is_nan() || steps >= MOST_SAMPLES {
            let says = format!(
                "resampling {:.0} s to {} Hz would make {steps:.1e} samples, more than {MOST_SAMPLES:.0e}",
                last - first,
                1.0 / step_s
            );
            return Err(Error::Undetermined(says));
        }
        if steps > MOST_NEW_PER_OLD * time_s.len() as f64 {
            let says = format!(
                "{:.1} samples a second cannot carry {:.0}: at most {MOST_NEW_PER_OLD} new ones are made for each",
                1.0 / old_step_s,
                1.0 / step_s
            );
            return Err(Error::Undetermined(says));
        }
        let count = steps as usize + 1;
        let new_s: Vec<f64> = (0..count).map(|sample| first + step_s * sample as f64).collect();
        Self::at(time_s, new_s, HALF_WIDTH_STEPS * step_s.max(old_step_s)).ok_or_else(few)
    }

    /// From samples at increasing `time_s` to times `step_s` apart that lie among them. `None` for fewer than four samples.
    #[cfg(feature = "files")]
    pub fn onto(time_s: &[f64], new_s: Vec<f64>, step_s: f64) -> Option<Self> {
        let old_step_s = (time_s.last()? - time_s.first()?) / time_s.len().saturating_sub(1).max(1) as f64;
        Self::at(time_s, new_s, HALF_WIDTH_STEPS * step_s.max(old_step_s))
    }

    fn at(time_s: &[f64], new_s: Vec<f64>, half_width_s: f64) -> Option<Self> {
        let taps = new_s.iter().map(|&at| taps(time_s, at, half_width_s)).collect::<Option<_>>()?;
        Some(Self { taps, time_s: new_s })
    }

    /// One column at the new times.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let dot = |(start, weights): &(usize, Vec<f64>)| weights.iter().zip(&values[*start..]).map(|(w, y)| w * y).sum();
        self.taps.iter().map(dot).collect()
    }
}

/// Near an end, or where stamps are sparse, the window is widened until the cubic is determined.
fn taps(time_s: &[f64], at: f64, half_width_s: f64) -> Option<(usize, Vec<f64>)> {
    let mut half_width_s = half_width_s;
    for _ in 0..40 {
        let start = time_s.partition_point(|&time| time <= at - half_width_s);
        let end = time_s.partition_point(|&time| time < at + half_width_s);
        if end >= start + 4 {
            let offsets: Vec<f64> = time_s[start..end].iter().map(|time| time - at).collect();
            if let Some(weights) = weights(&offsets, half_width_s, 3, Quantity::Value) {
                return Some((start, weights));
            }
        }
        half_width_s *= 1.3;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    proptest! {
        #[test]
        fn cubics_are_exact_to_the_ends(
            b in prop::array::uniform4(-2.0..2.0), jitter in prop::collection::vec(-0.3..0.3, 60), hz in 20.0..400.0,
        ) {
            let times: Vec<f64> = jitter.iter().enumerate().map(|(k, jitter)| 0.0081 * (k as f64 + jitter)).collect();
            let value = |t: f64| b[0] + t * (b[1] + t * (b[2] + t * b[3]));
            let resampler = Resampler::new(&times, 1.0 / hz)?;
            let values: Vec<f64> = times.iter().map(|&t| value(t)).collect();
            for (found, &at) in resampler.apply(&values).iter().zip(&resampler.time_s) {
                prop_assert!((found - value(at)).abs() <= Tolerance::Approximate.relative_f64());
            }
        }
    }

    #[test]
    fn a_slow_log_does_not_become_a_long_one() {
        let times: Vec<f64> = (0..1000).map(|k| 0.5 * f64::from(k)).collect();
        assert!(Resampler::new(&times, 0.005).is_ok_and(|resampler| resampler.time_s.len() == 99_901));
        let refused = Resampler::new(&times, 1e-4).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.contains("2.0 samples a second cannot carry 10000: at most 100 new ones"), "{refused}");
    }

    #[test]
    fn a_constant_stays_one_where_stamps_leave_four_samples_at_the_edge_of_the_window() -> Result<()> {
        let jitter = |k: usize| match k {
            0 => -0.257_343_503_340_230_2,
            2 => -0.134_747_153_928_616,
            3 => -0.130_754_889_869_215_88,
            59 => -0.125_754_441_122_138_4,
            _ => 0.0,
        };
        let times: Vec<f64> = (0..60).map(|k| 0.0081 * (k as f64 + jitter(k))).collect();
        let resampler = Resampler::new(&times, 1.0 / 397.591_876_129_598_23)?;
        let far = resampler.apply(&[1.0; 60]).iter().map(|value| (value - 1.0).abs()).fold(0.0, f64::max);
        assert!(far <= Tolerance::Close.relative_f64(), "{far:e}");
        Ok(())
    }

    #[test]
    fn the_same_rate_keeps_every_sample_time_and_almost_the_values() -> Result<()> {
        let times: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let resampler = Resampler::new(&times, 0.01)?;
        assert_eq!(resampler.time_s.len(), 100);
        let wave: Vec<f64> = times.iter().map(|t| (2.0 * PI * 5.0 * t).sin()).collect();
        // 5 Hz at 100 Hz: the cubic's gain differs from 1 by less than 1 %.
        assert!(resampler.apply(&wave).iter().zip(&wave).all(|(a, b)| (a - b).abs() < 0.01));
        Ok(())
    }

    #[test]
    fn what_the_lower_rate_cannot_show_is_stopped() -> Result<()> {
        let times: Vec<f64> = (0..2000).map(|k| 0.001 * f64::from(k)).collect();
        let resampler = Resampler::new(&times, 0.01)?;
        let amplitude = |hz: f64| {
            let wave: Vec<f64> = times.iter().map(|t| (2.0 * PI * hz * t).cos()).collect();
            let found = resampler.apply(&wave);
            found[10..found.len() - 10].iter().fold(0.0_f64, |largest, value| largest.max(value.abs()))
        };
        // As stated at the head of the file; 100 Hz is the new rate, where a plain choice of samples would give 1.
        assert!(amplitude(70.0) < 0.1 && amplitude(100.0) < 0.1, "{} {}", amplitude(70.0), amplitude(100.0));
        Ok(())
    }
}
