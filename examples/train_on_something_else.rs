//! The tape knows nothing of flying: here a small network learns sin(x) on it.
//!
//! ```text
//! cargo run --release --example train_on_something_else
//! ```

use phyture::nn::Recorder;
use phyture::tape::ops::{Activation, SquaredError};
use phyture::tape::{Result, Session, Threads};
use phyture_kernels::activation::Activation as Kind;
use phyture_kernels::adam::Adam;
use phyture_kernels::random::Stream;
use std::f64::consts::PI;

const SEED: u64 = 1;
const WIDTH: usize = 32;
const BATCH: usize = 64;
const STEPS: u64 = 2000;
const PEAK_RATE: f64 = 1e-2;

/// A point of the training data: uniform between -π and π, the same whenever it is asked for.
fn point(step: u64, sample: usize) -> f64 {
    PI * (2.0 * Stream::new(SEED, step, 0, sample as u64).uniform(0) - 1.0)
}

fn main() -> Result<()> {
    // Record: shapes are those of one sample; there is no batch axis.
    let mut recorder = Recorder::<f32>::default();
    let x = recorder.graph.input("x", &[1, 1])?;
    let target = recorder.graph.input("target", &[1, 1])?;
    let mut hidden = x;
    for layer in ["first", "second"] {
        hidden = recorder.linear(layer, hidden, WIDTH, true)?;
        hidden = recorder.graph.apply(Activation { kind: Kind::Tanh }, &[hidden])?;
    }
    let output = recorder.linear("output", hidden, 1, true)?;
    let loss = recorder.graph.apply(SquaredError { scale: 1.0 }, &[output, target])?;
    let Recorder { graph, inits } = recorder;

    // All parameters are one flat slab, which belongs to whoever trains.
    let mut parameters = vec![0.0_f32; graph.parameter_count()];
    for (tensor, (parameter, init)) in graph.parameters().iter().zip(&inits).enumerate() {
        init.fill(Stream::new(SEED, 0, tensor as u64, 1), &[], &mut parameters[parameter.range()]);
    }
    let (mut first, mut second) = (vec![0.0_f32; parameters.len()], vec![0.0_f32; parameters.len()]);

    // Plan once, replay each step: forward and backward for every sample of the batch, then Adam.
    let mut session = Session::train(&graph, loss, &[], Threads(1))?;
    for step in 1..=STEPS {
        let fill = |sample: usize, inputs: &mut [&mut [f32]]| {
            if let [x, target] = inputs {
                let at = point(step, sample);
                x.fill(at as f32);
                target.fill(at.sin() as f32);
            }
        };
        let mean = session.step(&parameters, BATCH, None, &fill)?;
        let learning_rate = PEAK_RATE * (1.0 - step as f64 / (STEPS + 1) as f64);
        session.adam(&Adam { learning_rate, ..Adam::default() }, step, &mut parameters, &mut first, &mut second)?;
        if step.is_multiple_of(500) {
            println!("step {step}: mean squared error {mean:.1e}");
        }
    }

    // Predict: nothing is kept for a backward pass, and the weights are prepared once.
    let mut session = Session::infer(&graph, &[output], Threads(1))?;
    session.load(&parameters)?;
    let at = |sample: usize| PI * (sample as f64 / 4.0 - 1.0);
    let fill = |sample: usize, inputs: &mut [&mut [f32]]| inputs[0].fill(at(sample) as f32);
    session.predict(9, &fill, &mut |sample, y| println!("sin({:6.3}) = {:6.3}, learned {:6.3}", at(sample), at(sample).sin(), y[0]))
}
