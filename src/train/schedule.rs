//! The learning rate: linear warm-up, then half a cosine to nearly zero (paper section 4.2).

/// Epochs of warm-up in the paper.
pub const WARMUP_EPOCHS: usize = 10;

/// Learning rate as a function of the step, over a fixed number of epochs.
///
/// With N steps an epoch, E epochs and W epochs of warm-up, for s = 0, 1, …:
/// s < W·N: rate = peak·(s+1)/(W·N); otherwise rate = ½·peak·(1 + cos(π·(s−W·N)/((E−W)·N))).
/// W = `warmup_epochs`, but at most ⌈E/10⌉ where E is 10 or less or no more than `warmup_epochs`: the paper warms up for 10 epochs of an unstated
/// number, and nothing would be left of so short a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    peak: f64,
    warmup_steps: usize,
    steps: usize,
}

impl Schedule {
    /// A schedule of `epochs` epochs of `steps_an_epoch` steps, both at least 1.
    pub fn new(peak: f64, warmup_epochs: usize, epochs: usize, steps_an_epoch: usize) -> Self {
        let is_short = epochs <= WARMUP_EPOCHS.max(warmup_epochs);
        let warmup = if is_short { warmup_epochs.min(epochs.div_ceil(10)) } else { warmup_epochs };
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
    fn a_run_of_ten_epochs_and_fewer_warms_up_for_a_tenth_of_it_and_a_longer_one_for_ten() {
        for (epochs, warm) in [(1, 1), (5, 1), (10, 1), (11, 10), (20, 10), (100, 10)] {
            let schedule = Schedule::new(1.0, WARMUP_EPOCHS, epochs, 10);
            assert!((schedule.rate(10 * warm - 1) - 1.0).abs() < 1e-15, "{epochs}");
            assert!((schedule.rate(0) - 0.1 / warm as f64).abs() < 1e-15, "{epochs}");
            let last = schedule.rate(10 * epochs - 1);
            assert!(epochs == 1 || last > 0.0 && last < 0.03, "{epochs}: {last}");
        }
        assert!((Schedule::new(1.0, 0, 5, 10).rate(0) - 1.0).abs() < 1e-15, "none at all");
    }
}
