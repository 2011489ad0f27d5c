//! The four operators that remember: lag, delay, rate, slew. Each is one state that takes samples in order.
//!
//! Lag and delay take the signal between two samples to be a straight line;
//! all take it to have been at rest at its first value before the first sample.

use super::operation::History;
use std::collections::VecDeque;

impl History {
    /// Number of arguments.
    pub(super) const fn operands(self) -> usize {
        match self {
            Self::Lag | Self::Delay | Self::Slew => 2,
            Self::Rate => 1,
        }
    }
}

/// Longest delay, s: bounds the memory a formula can ask for.
pub(super) const MAX_DELAY_S: f64 = 60.0;

/// Longest delay, samples: 60 s at more than 100 kHz.
pub(super) const MAX_DELAY_SAMPLES: f64 = 1e7;

/// State of one operator.
#[derive(Clone, Debug)]
pub(super) enum Memory {
    /// `y' = (x - y) / tau`, exact for a piecewise linear `x`:
    /// `y[k] = y[k-1] + (1 - a) (x[k-1] - y[k-1]) + ramp (x[k] - x[k-1])`, `a = exp(-T/tau)`, `ramp = 1 - (1 - a) tau/T`.
    Lag { approach: f64, ramp: f64, last: Option<(f64, f64)> },
    /// `y(t) = x(t - s)`: `whole` samples back, and `part` of the way to the one before. The newest value is at the back.
    Delay { whole: usize, part: f64, past: VecDeque<f64> },
    /// `y[k] = (x[k] - x[k-1]) / T`, zero at the first sample: causal, so half a sample late.
    Rate { step_s: f64, last: Option<f64> },
    /// `y[k] = y[k-1] + clamp(x[k] - y[k-1], -limit, limit)`: a servo at its largest speed.
    Slew { limit: f64, last: Option<f64> },
}

impl Memory {
    pub(super) fn lag(tau_s: f64, step_s: f64) -> Self {
        if tau_s <= 0.0 {
            return Self::Lag { approach: 1.0, ramp: 1.0, last: None };
        }
        let approach = -(-step_s / tau_s).exp_m1();
        Self::Lag { approach, ramp: 1.0 - approach * tau_s / step_s, last: None }
    }

    pub(super) fn delay(delay_s: f64, step_s: f64) -> Self {
        let samples = delay_s / step_s;
        let whole = samples.floor();
        Self::Delay { whole: whole as usize, part: samples - whole, past: VecDeque::new() }
    }

    pub(super) const fn rate(step_s: f64) -> Self {
        Self::Rate { step_s, last: None }
    }

    pub(super) fn slew(per_s: f64, step_s: f64) -> Self {
        Self::Slew { limit: per_s * step_s, last: None }
    }

    /// Forgets everything: the next sample is a first one.
    pub(super) fn reset(&mut self) {
        match self {
            Self::Lag { last, .. } => *last = None,
            Self::Delay { past, .. } => past.clear(),
            Self::Rate { last, .. } | Self::Slew { last, .. } => *last = None,
        }
    }

    /// Replaces the samples, in order, by the operator's output.
    pub(super) fn run(&mut self, values: &mut [f64]) {
        match self {
            Self::Lag { approach, ramp, last } => {
                for value in values {
                    let x = *value;
                    let (x_before, y_before) = last.unwrap_or((x, x));
                    *value = y_before + *approach * (x_before - y_before) + *ramp * (x - x_before);
                    *last = Some((x, *value));
                }
            }
            Self::Delay { whole, part, past } => {
                for value in values {
                    past.push_back(*value);
                    if past.len() > *whole + 2 {
                        past.pop_front();
                    }
                    let newest = past.len() - 1;
                    let at = |back: usize| past.get(newest.saturating_sub(back)).copied().unwrap_or(*value);
                    let near = at(*whole);
                    *value = if *part == 0.0 { near } else { near + *part * (at(*whole + 1) - near) };
                }
            }
            Self::Rate { step_s, last } => {
                for value in values {
                    let x = *value;
                    *value = (x - last.unwrap_or(x)) / *step_s;
                    *last = Some(x);
                }
            }
            Self::Slew { limit, last } => {
                for value in values {
                    let before = last.unwrap_or(*value);
                    // A not-a-number passes through and is forgotten, so that what follows is defined again.
                    let change = *value - before;
                    if change.abs() > *limit {
                        *value = before + limit.copysign(change);
                    }
                    *last = Some(*value).filter(|value| value.is_finite());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    const STEP_S: f64 = 0.01;

    fn run(mut memory: Memory, mut values: Vec<f64>) -> Vec<f64> {
        memory.run(&mut values);
        values
    }

    #[test]
    fn a_lag_of_a_ramp_is_the_exact_solution() {
        let tau_s = 0.04;
        let found = run(Memory::lag(tau_s, STEP_S), (0..200).map(|k| 3.0 * STEP_S * f64::from(k)).collect());
        for (k, y) in found.iter().enumerate() {
            let t = STEP_S * k as f64;
            let exact = 3.0 * (t - tau_s * (1.0 - (-t / tau_s).exp()));
            assert!((y - exact).abs() < Tolerance::Close.relative_f64(), "{k}: {y} against {exact}");
        }
    }

    #[test]
    fn no_lag_and_no_delay_change_nothing() {
        let values: Vec<f64> = (0..50).map(|k| (f64::from(k) * 0.7).sin()).collect();
        assert_eq!(run(Memory::delay(0.0, STEP_S), values.clone()), values);
        for (y, x) in run(Memory::lag(0.0, STEP_S), values.clone()).iter().zip(&values) {
            assert!((y - x).abs() < Tolerance::Close.relative_f64());
        }
    }

    #[test]
    fn delays_hold_the_first_value_then_follow() {
        let values: Vec<f64> = (0..8).map(f64::from).collect();
        assert_eq!(run(Memory::delay(0.02, STEP_S), values.clone()), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(run(Memory::delay(0.005, STEP_S), values), [0.0, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5]);
    }

    #[test]
    fn a_slew_follows_no_faster_than_its_limit() {
        let found = run(Memory::slew(100.0, STEP_S), vec![0.0, 3.0, 3.0, 3.5, 3.2, -9.0, f64::NAN, 5.0]);
        assert_eq!(found[..6], [0.0, 1.0, 2.0, 3.0, 3.2, 2.2]);
        assert!(found[6].is_nan() && found[7] == 5.0);
    }

    #[test]
    fn a_rate_is_the_backward_difference() {
        let found = run(Memory::rate(0.5), vec![1.0, 2.0, 4.0]);
        assert_eq!(found, [0.0, 2.0, 4.0]);
    }
}
