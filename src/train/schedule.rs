//! The learning rate: linear warm-up, then half a cosine to nearly zero (paper section 4.2).

/// Epochs of warm-up in the paper.
pub const WARMUP_EPOCHS: usize = 10;

/// Learning rate as a function of the step, over a fixed number of epochs.
///
/// With N steps an epoch, E epochs and W = min(`warmup_epochs`, ⌈E/10⌉) of warm-up, for s = 0, 1, …:
/// s < W·N: rate = peak·(s+1)/(W·N); otherwise rate = ½·peak·(1 + cos(π·(s−W·N)/((E−W)·N))).
/// The paper warms up for 10 epochs of an unstated number; short runs scale the warm-up so that it never eats the training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    peak: f64,
    warmup_steps: usize,
    steps: usize,
}

impl Schedule {
    /// A schedule of `epochs` epochs of `steps_an_epoch` steps, both at least 1.
    pub fn new(peak: f64, warmup_epochs: usize, epochs: usize, steps_an_epoch: usize) -> Self {
        let warmup = warmup_epochs.min(epochs.div_ceil(10));
        Self { peak, warmup_steps: warmup * steps_an_epoch, steps: epochs * steps_an_epoch }
    }

    /// Rate of step `step`, counted from 0.
    pub fn rate(&self, step: usize) -> f64 {
        if step < self.warmup_steps {
            return self.peak * (step + 1) as f64 / self.warmup_steps as f64;
        }
        let progress = (step - self.warmup_steps) as f64 / (self.steps - self.warmup_steps).max(1) as f64;
        0.5 * self.peak * (1.0 + (std::f64::consts::PI * progress.min(1.0)).cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_peak_middle_and_end() {
        let schedule = Schedule::new(1e-3, WARMUP_EPOCHS, 100, 7);
        let close = |step: usize, rate: f64| assert!((schedule.rate(step) - rate).abs() < 1e-15, "{step}: {}", schedule.rate(step));
        close(0, 1e-3 / 70.0);
        close(69, 1e-3);
        close(70, 1e-3);
        close(70 + 315, 0.5e-3);
        assert!(schedule.rate(699) > 0.0 && schedule.rate(699) < 1e-6);
    }

    #[test]
    fn a_short_run_warms_up_for_a_tenth_of_it() {
        let schedule = Schedule::new(1.0, WARMUP_EPOCHS, 5, 10);
        assert!((schedule.rate(9) - 1.0).abs() < 1e-15);
        assert!(schedule.rate(49) > 0.0 && schedule.rate(49) < 0.01);
    }
}
