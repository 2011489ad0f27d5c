//! From the logged stick to what leaves the servos: interpolation between samples, delay and rate limit. The first-order lags
//! are states of the body (`body.rs`).
//!
//! Convention: between the logged samples k and k+1 a control moves in a straight line from u_k to u_{k+1}, and u_{k+1} is decided
//! with what is known at k. So u_k is exactly what acts at the instant of sample k, recorded derivatives and centred differences of
//! the recorded velocity agree, and the delay to state for these logs is 0 s plus that of `ctrl_delay`.

use super::mechanisms::{Mechanism, Mechanisms};

/// Delay at scale 1, s (Walker and Tischler 2021).
const DELAY_S: f64 = 0.040;
/// Slew rate at scale 1, units/s.
const RATE_PER_S: f64 = 4.0;
/// Log samples of history; enough for `DELAY_S` at the largest scale.
const HISTORY: usize = 16;

/// Controls of one flight, past and one sample ahead.
#[derive(Clone, Debug)]
pub(super) struct Actuators {
    /// `history[0]` is u_{k+1}, `history[1]` is u_k, and so on back.
    history: [[f64; 4]; HISTORY],
    /// Delay in log samples.
    delay: f64,
    /// Largest change in a log sample, or none.
    slew: Option<f64>,
    /// What left the servos last.
    output: [f64; 4],
}

impl Actuators {
    pub(super) fn new(mechanisms: &Mechanisms, initial: [f64; 4], log_step_s: f64) -> Self {
        let rate = mechanisms.scale(Mechanism::ServoRateLimit);
        Self {
            history: [initial; HISTORY],
            delay: mechanisms.scale(Mechanism::CtrlDelay) * DELAY_S / log_step_s,
            slew: (rate > 0.0).then(|| RATE_PER_S * log_step_s / rate),
            output: initial,
        }
    }

    /// Moves on by one log sample; `next` is what the sticks will be at its end.
    pub(super) fn push(&mut self, next: [f64; 4]) {
        self.history.rotate_right(1);
        self.history[0] = next;
    }

    /// The logged controls u_k.
    pub(super) fn logged(&self) -> [f64; 4] {
        self.history[1]
    }

    /// What leaves the servos at the present instant.
    pub(super) fn output(&self) -> [f64; 4] {
        self.output
    }

    /// What leaves the servos `fraction` of a log sample after sample k, having moved for `moved` of one since the last call.
    pub(super) fn advance(&mut self, fraction: f64, moved: f64) -> [f64; 4] {
        let back = (1.0 - fraction + self.delay).clamp(0.0, (HISTORY - 2) as f64);
        let (at, part) = (back as usize, back.fract());
        for (channel, output) in self.output.iter_mut().enumerate() {
            let stick = self.history[at][channel] + part * (self.history[at + 1][channel] - self.history[at][channel]);
            *output = match self.slew {
                Some(slew) => *output + (stick - *output).clamp(-slew * moved, slew * moved),
                None => stick,
            };
        }
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    fn step_response(mechanisms: &Mechanisms, samples: usize) -> Vec<f64> {
        let mut actuators = Actuators::new(mechanisms, [0.0; 4], 0.01);
        (0..samples)
            .map(|_| {
                actuators.push([0.4; 4]);
                (1..=5).map(|substep| actuators.advance(f64::from(substep) / 5.0, 0.2)[0]).last().unwrap_or_default()
            })
            .collect()
    }

    #[test]
    fn without_mechanisms_the_output_is_the_log() {
        let mut actuators = Actuators::new(&Mechanisms::none(), [0.1; 4], 0.01);
        actuators.push([0.3; 4]);
        assert_eq!(actuators.logged(), [0.1; 4]);
        assert!((actuators.advance(0.5, 0.5)[2] - 0.2).abs() < Tolerance::Close.relative_f64());
        actuators.advance(1.0, 0.5);
        actuators.push([0.5; 4]);
        assert_eq!(actuators.output(), actuators.logged());
    }

    #[test]
    fn delay_and_slew_are_those_stated() {
        let delayed = step_response(&Mechanisms::none().with(Mechanism::CtrlDelay, 1.0), 10);
        assert_eq!(delayed.iter().position(|&u| u > 0.39), Some(4));
        let slewed = step_response(&Mechanisms::none().with(Mechanism::ServoRateLimit, 1.0), 20);
        assert!((slewed[4] - 0.2).abs() < Tolerance::Close.relative_f64(), "{slewed:?}");
        assert!((slewed[12] - 0.4).abs() < Tolerance::Close.relative_f64());
    }
}
