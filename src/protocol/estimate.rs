//! How long a run will take: a few steps of its network on made-up numbers are timed before the work begins. For the display of time
//! left; nothing that is written down depends on it.

use super::experiment::Extent;
use super::plan::{Plan, Run};
use crate::error::Result;
use crate::nn::{Network, OutputScale};
use crate::tape::{Session, Threads};
use crate::train::TrainConfig;
use std::time::Instant;

/// Steps that are timed; the fastest counts, since other work can only slow a step down.
const TIMED: usize = 3;

/// Share of a training step that a prediction costs.
const FORWARD_SHARE: f64 = 1.0 / 3.0;

/// A run that trains nothing, s.
const UNTRAINED_S: f64 = 2.0;

/// Searches of the loop, in seconds a second of training flight; how many effects it will find is not known beforehand.
const LOOP_SHARE: f64 = 0.04;

/// Seconds of one training window, forward and backward, on so many threads.
///
/// # Errors
/// As [`Network::new`] and [`Session::train`].
pub fn window_s(config: &TrainConfig, threads: Threads) -> Result<f64> {
    let outputs = config.network.outputs();
    let network =
        Network::<f32>::new(&config.network, &OutputScale { scale: vec![1.0; outputs], offset: vec![0.0; outputs] }, false)?;
    let mut session = Session::train(network.graph(), network.loss(), &[], threads)?;
    let parameters = network.initial(0);
    // Anything but zeros: the kernels take the same time for any ordinary numbers.
    let fill = |sample: usize, inputs: &mut [&mut [f32]]| {
        for input in inputs {
            input.iter_mut().enumerate().for_each(|(index, value)| *value = ((index + sample) as f32 * 0.37).sin());
        }
    };
    let samples = config.batch.min(8);
    session.step(&parameters, samples, None, &fill)?;
    let mut least = f64::INFINITY;
    for _ in 0..TIMED {
        let begun = Instant::now();
        session.step(&parameters, samples, None, &fill)?;
        least = least.min(begun.elapsed().as_secs_f64());
    }
    Ok(least / samples as f64)
}

/// Seconds of a run, `window_s` being a training window's: its trainings, what validates after each epoch, and what is judged.
///
/// # Errors
/// As [`Plan::training`].
pub fn run_s(plan: &Plan, run: &Run, window_s: f64, extent: Extent) -> Result<f64> {
    let Extent { training, validation, test, training_s } = extent;
    let amended = if run.method()?.predictor.amended() { LOOP_SHARE * training_s } else { 0.0 };
    let Some(config) = plan.training(run)? else { return Ok(UNTRAINED_S + amended) };
    let (rates, tried) = plan.settings.rate_budget();
    let chosen = !rates.is_empty();
    let judged = |keeps: bool| if keeps { FORWARD_SHARE * validation as f64 } else { 0.0 };
    let trials = (rates.len() * tried) as f64 * (training as f64 + judged(chosen));
    let whole = config.epochs as f64 * (training as f64 + judged(config.keep_best));
    Ok(UNTRAINED_S + amended + window_s * (trials + whole + FORWARD_SHARE * test as f64))
}

#[cfg(test)]
mod tests {
    use super::super::plan::tests::plan;
    use super::super::plan::{Division, TableId, Treatment};
    use super::super::settings::Settings;
    use super::*;

    #[test]
    fn an_estimate_counts_every_window_of_every_training() -> Result<()> {
        let base = plan(&TableId::ALL);
        let training = TrainConfig { epochs: 10, keep_best: false, ..base.settings.training.clone() };
        let plain = Plan { settings: Settings { training, rates: Vec::new(), ..base.settings.clone() }, ..base };
        let run = Run { method: "tcn".into(), division: Division::Benchmark, treatment: Treatment::Plain, seed: 1 };
        let extent = Extent { training: 100, validation: 30, test: 60, training_s: 1000.0 };
        let seconds = |plan: &Plan| run_s(plan, &run, 2.0, extent);
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
        assert!(near(seconds(&plain)?, 2.0 + 2.0 * (10.0 * 100.0 + 20.0)));
        let mut best = plain.clone();
        best.settings.training.keep_best = true;
        assert!(near(seconds(&best)?, 2.0 + 2.0 * (10.0 * 110.0 + 20.0)));
        (best.settings.rates, best.settings.rate_epochs) = (vec![1e-3, 3e-3], 2);
        assert!(near(seconds(&best)?, 2.0 + 2.0 * (14.0 * 110.0 + 20.0)));
        let ridge = Run { method: "amended_physics".into(), ..run.clone() };
        assert!(near(run_s(&plain, &ridge, 2.0, extent)?, 2.0 + 40.0));
        Ok(())
    }
}
