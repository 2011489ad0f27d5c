//! How long a run will take: two steps of its network on made-up numbers are timed before the work begins. For the display of time
//! left; nothing that is written down depends on it.

use super::plan::{Plan, Run};
use crate::error::Result;
use crate::nn::{Network, OutputScale};
use crate::tape::{Session, Threads};
use crate::train::TrainConfig;
use std::time::Instant;

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
    let begun = Instant::now();
    session.step(&parameters, samples, None, &fill)?;
    Ok(begun.elapsed().as_secs_f64() / samples as f64)
}

/// Seconds of a run with so many training and test windows, `window_s` being a training window's and `flight_s` the length of the
/// training part.
///
/// # Errors
/// As [`Plan::training`].
pub fn run_s(plan: &Plan, run: &Run, window_s: f64, flight_s: f64, training: usize, test: usize) -> Result<f64> {
    let amended = if run.method()?.predictor.amended() { LOOP_SHARE * flight_s } else { 0.0 };
    let Some(config) = plan.training(run)? else { return Ok(UNTRAINED_S + amended) };
    let steps = (training * config.epochs) as f64 + FORWARD_SHARE * test as f64;
    Ok(UNTRAINED_S + amended + window_s * steps)
}
