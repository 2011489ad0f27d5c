//! The four operators that remember: lag, delay, rate, slew, and the derivatives of their recursions. Each is one state that takes
//! samples in order.
//!
//! Lag and delay take the signal between two samples to be a straight line;
//! all take it to have been at rest at its first value before the first sample.

use super::graph::Recall;
use super::operation::History;
use phyture_kernels::{InstructionSet, columns};

impl History {
    /// Number of arguments.
    pub(super) const fn operands(self) -> usize {
        match self {
            Self::Lag | Self::Delay | Self::Slew => 2,
            Self::Rate => 1,
        }
    }
}

/// Samples that a delay keeps beyond those it needs, so that it forgets seldom.
const SPARE: usize = 512;

/// Samples that all delays of a model, or of the inputs of a network, may keep: 60 s at more than 100 kHz. Sixteen bytes each are asked for before
/// the first sample, whatever a file says of times and step.
pub(super) const MOST_DELAYED: f64 = 1e7;

/// State of one operator. T is the step.
#[derive(Clone, Debug)]
pub(super) enum Memory {
    /// `y' = (x - y) / tau`, exact for a piecewise linear `x`:
    /// `y[k] = y[k-1] + (1 - a) (x[k-1] - y[k-1]) + ramp (x[k] - x[k-1])`, `a = exp(-T/tau)`, `ramp = 1 - (1 - a) tau/T`.
    Lag { approach: f64, ramp: f64, last: Option<(f64, f64)> },
    /// The same where the time constant varies: the coefficients of a step are those of its end.
    VaryingLag { step_s: f64, last: Option<(f64, f64)> },
    /// Derivative of that by a number, from those of `x` and of the time constant. The last `x`, `y`, `dx` and `dy`.
    LagTangent { step_s: f64, last: Option<[f64; 4]> },
    /// `dy/dtau` of the recursion of a lag; `slopes` are those of `1 - a` and `ramp`. The last `x`, `y` and `dy/dtau`.
    LagByTime { approach: f64, ramp: f64, slopes: [f64; 2], last: Option<(f64, f64, f64)> },
    /// `y(t) = x(t - s)`: `whole` samples back, and `part` of the way to the one before.
    Delay { whole: usize, part: f64, past: Past },
    /// `dy/ds` of that: the slope between the two samples.
    DelayByTime { whole: usize, step_s: f64, past: Past },
    /// `y[k] = (x[k] - x[k-1]) / T`, zero at the first sample: causal, so half a sample late.
    /// The last two samples are kept, for [`Memory::ahead`].
    Rate { step_s: f64, last: Option<[f64; 2]> },
    /// `y[k] = y[k-1] + clamp(x[k] - y[k-1], -limit, limit)`: a servo at its largest speed.
    Slew { limit: f64, last: Option<f64> },
    /// Derivative of that by a number, from those of `x` and of the largest rate. The last `y` and its derivative.
    SlewTangent { limit: f64, step_s: f64, last: Option<(f64, f64)> },
}

/// `1 - a` and `ramp` of a lag.
#[inline]
pub(super) fn lag_coefficients(tau_s: f64, step_s: f64) -> [f64; 2] {
    if tau_s <= 0.0 {
        return [1.0, 1.0];
    }
    let approach = -(-step_s / tau_s).exp_m1();
    [approach, 1.0 - approach * tau_s / step_s]
}

/// These, and their derivatives by the time constant.
#[inline]
fn lag_slopes(tau_s: f64, step_s: f64) -> [[f64; 2]; 2] {
    let [approach, ramp] = lag_coefficients(tau_s, step_s);
    if tau_s <= 0.0 {
        return [[approach, ramp], [0.0, -1.0 / step_s]];
    }
    // da/dtau is a T/tau², and a is 1 - approach.
    let slope = -(1.0 - approach) * step_s / (tau_s * tau_s);
    [[approach, ramp], [slope, -(approach + tau_s * slope) / step_s]]
}

/// The latest samples of a signal, the newest at the back; before the first one it was at rest.
#[derive(Clone, Debug)]
pub(super) struct Past(Vec<f64>);

impl Past {
    /// With room for all that it ever keeps while samples come one at a time: taking them allocates nothing.
    fn new(whole: usize) -> Self {
        Self(Vec::with_capacity(2 * (whole + 1) + SPARE + 1))
    }

    /// Takes the next samples; gives, for each of them, the ones that lie so far back, and those before these.
    fn delayed<'a>(&'a mut self, whole: usize, next: &'a [f64]) -> (&'a [f64], &'a [f64]) {
        let Self(samples) = self;
        let Some(&first) = next.first() else { return (next, next) };
        if samples.is_empty() {
            samples.resize(whole + 1, first);
        } else if samples.len() > 2 * (whole + 1) + SPARE {
            // What is long past is let go in large pieces.
            samples.drain(..samples.len() - (whole + 1));
        }
        samples.extend_from_slice(next);
        let before = &samples[samples.len() - next.len() - (whole + 1)..];
        (&before[1..=next.len()], &before[..next.len()])
    }
}

impl Memory {
    /// Of an operator with its time or limit; a rate has none, and that of a lag may vary.
    pub(super) fn new(recall: Recall, number: Option<f64>, step_s: f64) -> Self {
        let number = match (recall, number) {
            (_, Some(number)) => number,
            (Recall::History(History::Rate), None) => 0.0,
            (Recall::History(History::Lag), None) => {
                return Self::VaryingLag { step_s, last: None };
            }
            (Recall::LagTangent, None) => 0.0,
            _ => unreachable!("a time that varies is that of a lag"),
        };
        let whole = (number / step_s).floor();
        match recall {
            Recall::History(History::Lag) => {
                let [approach, ramp] = lag_coefficients(number, step_s);
                Self::Lag { approach, ramp, last: None }
            }
            Recall::LagTangent => Self::LagTangent { step_s, last: None },
            Recall::LagByTime => {
                let [[approach, ramp], slopes] = lag_slopes(number, step_s);
                Self::LagByTime { approach, ramp, slopes, last: None }
            }
            Recall::History(History::Delay) => {
                Self::Delay { whole: whole as usize, part: number / step_s - whole, past: Past::new(whole as usize) }
            }
            Recall::DelayByTime => Self::DelayByTime { whole: whole as usize, step_s, past: Past::new(whole as usize) },
            Recall::History(History::Rate) => Self::Rate { step_s, last: None },
            Recall::History(History::Slew) => Self::Slew { limit: number * step_s, last: None },
            Recall::SlewTangent => Self::SlewTangent { limit: number * step_s, step_s, last: None },
        }
    }

    /// Forgets everything: the next sample is a first one.
    pub(super) fn reset(&mut self) {
        match self {
            Self::Lag { last, .. } | Self::VaryingLag { last, .. } | Self::SlewTangent { last, .. } => *last = None,
            Self::LagTangent { last, .. } => *last = None,
            Self::LagByTime { last, .. } => *last = None,
            Self::Delay { past, .. } | Self::DelayByTime { past, .. } => past.0.clear(),
            Self::Rate { last, .. } => *last = None,
            Self::Slew { last, .. } => *last = None,
        }
    }

    /// Takes samples in order. `number` is the time or limit, `tangents` are those of the signal and of that; they are read where they vary.
    pub(super) fn run(&mut self, isa: InstructionSet, signal: &[f64], number: &[f64], tangents: [&[f64]; 2], out: &mut [f64]) {
        let samples = out.iter_mut().zip(signal.iter().copied());
        match self {
            Self::Lag { approach, ramp, last } => {
                for (out, x) in samples {
                    let (x_before, y_before) = last.unwrap_or((x, x));
                    *out = y_before + *approach * (x_before - y_before) + *ramp * (x - x_before);
                    *last = Some((x, *out));
                }
            }
            Self::VaryingLag { step_s, last } => {
                // Worked out where the time constant changes.
                let (mut known, mut coefficients) = (0.0, lag_coefficients(0.0, *step_s));
                for ((out, x), &tau_s) in samples.zip(number) {
                    if tau_s != known {
                        (known, coefficients) = (tau_s, lag_coefficients(tau_s, *step_s));
                    }
                    let [approach, ramp] = coefficients;
                    let (x_before, y_before) = last.unwrap_or((x, x));
                    *out = y_before + approach * (x_before - y_before) + ramp * (x - x_before);
                    *last = Some((x, *out));
                }
            }
            Self::LagTangent { step_s, last } => {
                let [of_signal, of_time] = tangents;
                let (mut known, mut slopes) = (0.0, lag_slopes(0.0, *step_s));
                for (((out, x), &tau_s), (&dx, &dtau)) in samples.zip(number).zip(of_signal.iter().zip(of_time)) {
                    if tau_s != known {
                        (known, slopes) = (tau_s, lag_slopes(tau_s, *step_s));
                    }
                    let [[approach, ramp], [of_approach, of_ramp]] = slopes;
                    let [x_before, y_before, dx_before, dy_before] = last.unwrap_or([x, x, dx, dx]);
                    let by_signal = dy_before + approach * (dx_before - dy_before) + ramp * (dx - dx_before);
                    *out = by_signal + dtau * (of_approach * (x_before - y_before) + of_ramp * (x - x_before));
                    let y = y_before + approach * (x_before - y_before) + ramp * (x - x_before);
                    *last = Some([x, y, dx, *out]);
                }
            }
            Self::LagByTime { approach, ramp, slopes: [of_approach, of_ramp], last } => {
                for (out, x) in samples {
                    let (x_before, y_before, slope) = last.unwrap_or((x, x, 0.0));
                    *out = slope - *approach * slope + *of_approach * (x_before - y_before) + *of_ramp * (x - x_before);
                    let y = y_before + *approach * (x_before - y_before) + *ramp * (x - x_before);
                    *last = Some((x, y, *out));
                }
            }
            Self::Delay { whole, part, past } => {
                let (near, far) = past.delayed(*whole, signal);
                if *part == 0.0 {
                    out.copy_from_slice(near);
                } else {
                    columns::zip(isa, |near, far| near + *part * (far - near), near, far, out);
                }
            }
            Self::DelayByTime { whole, step_s, past } => {
                let (near, far) = past.delayed(*whole, signal);
                columns::zip(isa, |near, far| (far - near) / *step_s, near, far, out);
            }
            Self::Rate { step_s, last } => {
                for (out, x) in samples {
                    let [before, _] = last.unwrap_or([x, x]);
                    *out = (x - before) / *step_s;
                    *last = Some([x, before]);
                }
            }
            Self::Slew { limit, last } => {
                for (out, x) in samples {
                    *out = slewed(x, last.unwrap_or(x), *limit);
                    // A not-a-number passes through and is forgotten, so that what follows is defined again.
                    *last = Some(*out).filter(|value| value.is_finite());
                }
            }
            Self::SlewTangent { limit, step_s, last } => {
                let [of_signal, of_limit] = tangents;
                for ((out, x), (&dx, &dlimit)) in samples.zip(of_signal.iter().zip(of_limit)) {
                    let (before, tangent) = last.unwrap_or((x, dx));
                    let change = x - before;
                    *out = if change.abs() > *limit { tangent + (dlimit * *step_s).copysign(change * dlimit) } else { dx };
                    *last = Some((slewed(x, before, *limit), *out)).filter(|(value, _)| value.is_finite());
                }
            }
        }
    }
}

impl Memory {
    /// Whether it is an operator of the grammar, not a derivative of one: [`Memory::ahead`] knows these.
    pub(super) const fn looks_ahead(&self) -> bool {
        !matches!(self, Self::LagTangent { .. } | Self::LagByTime { .. } | Self::DelayByTime { .. } | Self::SlewTangent { .. })
    }

    /// The value a part of a step (0 to 1) after the last sample, where the signal is `x` by then and went there in a straight line; nothing
    /// is taken. At 1 it is what [`Memory::run`] would give for `x` next. `number` is the time or limit.
    pub(super) fn ahead(&self, part: f64, step_s: f64, x: f64, number: f64) -> f64 {
        match self {
            Self::Lag { last, .. } | Self::VaryingLag { last, .. } => {
                let [approach, ramp] = lag_coefficients(number, part * step_s);
                let (x_before, y_before) = last.unwrap_or((x, x));
                y_before + approach * (x_before - y_before) + ramp * (x - x_before)
            }
            Self::Delay { whole, part: fraction, past: Past(samples) } => {
                let Some(&newest) = samples.last() else { return x };
                let back = *whole as f64 + fraction - part;
                if back <= 0.0 {
                    return newest + (x - newest) * (-back / part);
                }
                let near = samples.len() - 1 - back.floor() as usize;
                samples[near] + back.fract() * (samples[near.saturating_sub(1)] - samples[near])
            }
            Self::Rate { last, .. } => {
                let [newest, before] = last.unwrap_or([x, x]);
                (x - (newest + (1.0 - part) * (before - newest))) / step_s
            }
            Self::Slew { limit, last } => slewed(x, last.unwrap_or(x), part * limit),
            Self::LagTangent { .. } | Self::LagByTime { .. } | Self::DelayByTime { .. } | Self::SlewTangent { .. } => {
                unreachable!("refused where lanes are made")
            }
        }
    }

    /// The same without what it will not look at again.
    pub(super) fn slim(&self) -> Self {
        match self {
            Self::Delay { whole, part, past: Past(samples) } => {
                let kept = samples[samples.len().saturating_sub(whole + 2)..].to_vec();
                Self::Delay { whole: *whole, part: *part, past: Past(kept) }
            }
            other => other.clone(),
        }
    }
}

fn slewed(x: f64, before: f64, limit: f64) -> f64 {
    let change = x - before;
    if change.abs() > limit { before + limit.copysign(change) } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    const STEP_S: f64 = 0.01;

    fn run(history: History, number: f64, values: &[f64]) -> Vec<f64> {
        recalled(Recall::History(history), number, STEP_S, values)
    }

    fn recalled(recall: Recall, number: f64, step_s: f64, values: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; values.len()];
        Memory::new(recall, Some(number), step_s).run(InstructionSet::PLAIN, values, &[], [&[], &[]], &mut out);
        out
    }

    #[test]
    fn a_lag_of_a_ramp_is_the_exact_solution() {
        let tau_s = 0.04;
        let found = run(History::Lag, tau_s, &(0..200).map(|k| 3.0 * STEP_S * f64::from(k)).collect::<Vec<_>>());
        for (k, y) in found.iter().enumerate() {
            let t = STEP_S * k as f64;
            let exact = 3.0 * (t - tau_s * (1.0 - (-t / tau_s).exp()));
            assert!((y - exact).abs() < Tolerance::Close.relative_f64(), "{k}: {y} against {exact}");
        }
    }

    #[test]
    fn a_lag_whose_time_varies_is_the_exact_solution_of_its_equation() {
        // tau = (1 + t) / 4 and x = 0 from 1: y = (1 + t)^-4; steps are taken with the time constant of their ends.
        let error = |step_s: f64| {
            let samples = (1.0 / step_s).round() as usize;
            let signal: Vec<f64> = (0..=samples).map(|k| f64::from(u8::from(k == 0))).collect();
            let times: Vec<f64> = (0..=samples).map(|k| (1.0 + step_s * k as f64) / 4.0).collect();
            let mut out = vec![0.0; signal.len()];
            let mut memory = Memory::new(Recall::History(History::Lag), None, step_s);
            memory.run(InstructionSet::PLAIN, &signal, &times, [&[], &[]], &mut out);
            (out[samples] - 1.0 / 16.0).abs()
        };
        assert!(error(1e-3) < 1e-3 && error(1e-4) < 0.11 * error(1e-3), "{:e} {:e}", error(1e-3), error(1e-4));
    }

    #[test]
    fn a_time_that_could_vary_and_does_not_gives_the_bits_of_a_constant() {
        let values: Vec<f64> = (0..300).map(|k| (f64::from(k) * 0.13).sin()).collect();
        let mut out = vec![0.0; values.len()];
        let mut memory = Memory::new(Recall::History(History::Lag), None, STEP_S);
        memory.run(InstructionSet::PLAIN, &values, &[0.04; 300], [&[], &[]], &mut out);
        assert_eq!(out, run(History::Lag, 0.04, &values));
    }

    #[test]
    fn no_lag_and_no_delay_change_nothing() {
        let values: Vec<f64> = (0..50).map(|k| (f64::from(k) * 0.7).sin()).collect();
        assert_eq!(run(History::Delay, 0.0, &values), values);
        for (y, x) in run(History::Lag, 0.0, &values).iter().zip(&values) {
            assert!((y - x).abs() < Tolerance::Close.relative_f64());
        }
    }

    #[test]
    fn delays_hold_the_first_value_then_follow() {
        let values: Vec<f64> = (0..8).map(f64::from).collect();
        assert_eq!(run(History::Delay, 0.02, &values), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(run(History::Delay, 0.005, &values), [0.0, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5]);
    }

    #[test]
    fn a_slew_follows_no_faster_than_its_limit() {
        let found = run(History::Slew, 100.0, &[0.0, 3.0, 3.0, 3.5, 3.2, -9.0, f64::NAN, 5.0]);
        assert_eq!(found[..6], [0.0, 1.0, 2.0, 3.0, 3.2, 2.2]);
        assert!(found[6].is_nan() && found[7] == 5.0);
    }

    #[test]
    fn a_rate_is_the_backward_difference() {
        let found = recalled(Recall::History(History::Rate), 0.0, 0.5, &[1.0, 2.0, 4.0]);
        assert_eq!(found, [0.0, 2.0, 4.0]);
    }
}
