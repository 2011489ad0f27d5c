//! An operation that the tape does not have, in a program of one's own: the Huber loss. Its gradient is checked, then a line is fitted with it to
//! points of which some are far off.
//!
//! ```text
//! cargo run --release --example an_operation_of_ones_own
//! ```

use phyture::nn::Recorder;
use phyture::tape::gradcheck;
use phyture::tape::op::{Backward, Differentiable, Forward, Op, Reads};
use phyture::tape::ops::SquaredError;
use phyture::tape::{Error, Result, Session, Shape, Threads};
use phyture_kernels::adam::Adam;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Write};

/// y = Σ h(x − target) with h(e) = e²/2 up to |e| = δ, and δ(|e| − δ/2) beyond (Huber 1964); dx = dy·max(−δ, min(e, δ)). Both operands have one shape; the
/// target is a constant.
struct Huber {
    delta: f64,
}

impl<T: Real> Op<T> for Huber {
    fn name(&self) -> &'static str {
        "huber"
    }

    // Shapes are checked here once, while the operation is recorded, and never again.
    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        match operands {
            [x, target] if x == target => Shape::new("huber", &[1]),
            _ => Err(Error::Shape { operation: "huber", message: format!("{operands:?}; expected two operands of one shape") }),
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let of = |(x, target): (&T, &T)| {
            let error = (*x - *target).f64().abs();
            if error <= self.delta { 0.5 * error * error } else { self.delta * (error - 0.5 * self.delta) }
        };
        io.y[0] = T::of(io.x[0].iter().zip(io.x[1]).map(of).sum());
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Huber {
    // What is not named here may be gone when the backward pass runs.
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn reaches(&self, operand: usize) -> bool {
        operand == 0
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [Some(dx), ..] = io.dx else { return };
        for ((to, x), target) in dx.values.iter_mut().zip(io.x[0]).zip(io.x[1]) {
            let value = io.dy[0] * T::of((*x - *target).f64().clamp(-self.delta, self.delta));
            match dx.write {
                Write::Set => *to = value,
                Write::Add => *to += value,
            }
        }
    }
}

/// Points on y = 2x + 1 with noise; every tenth is 30 too high.
fn point(sample: usize) -> (f32, f32) {
    let stream = Stream::new(5, 0, 0, sample as u64);
    let x = 2.0 * stream.uniform(0) - 1.0;
    let outlier = if sample.is_multiple_of(10) { 30.0 } else { 0.0 };
    (x as f32, (2.0 * x + 1.0 + 0.1 * (stream.uniform(1) - 0.5) + outlier) as f32)
}

/// Slope and offset under a loss.
fn line(loss: impl Op<f32> + 'static) -> Result<[f32; 2]> {
    const POINTS: usize = 200;
    let mut recorder = Recorder::<f32>::default();
    let x = recorder.graph.input("x", &[1, 1])?;
    let target = recorder.graph.input("target", &[1, 1])?;
    let output = recorder.linear("line", x, 1, true)?;
    let loss = recorder.graph.apply(loss, &[output, target])?;
    let mut parameters = vec![0.0_f32; recorder.graph.parameter_count()];
    let [mut first, mut second] = [parameters.clone(), parameters.clone()];
    let mut session = Session::train(&recorder.graph, loss, &[], Threads(1))?;
    let fill = |sample: usize, inputs: &mut [&mut [f32]]| {
        let (x, y) = point(sample);
        inputs[0].fill(x);
        inputs[1].fill(y);
    };
    for step in 1..=2000 {
        session.step(&parameters, POINTS, None, &fill)?;
        let adam = Adam { learning_rate: 3e-2 / (step as f64).sqrt(), ..Adam::default() };
        session.adam(&adam, step, &mut parameters, &mut first, &mut second)?;
    }
    Ok([parameters[0], parameters[1]])
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    // The whole Jacobian against differences in f64, `Set` and `Add`, f32 against f64, every instruction set.
    gradcheck::operation(&Huber { delta: 0.7 }, &[&[3, 2], &[3, 2]])?;
    println!("the gradient of the operation is that of its forward pass");
    let [slope, offset] = line(SquaredError { scale: 0.5 })?;
    println!("least squares: y = {slope:.2} x + {offset:.2}");
    let [slope, offset] = line(Huber { delta: 0.2 })?;
    println!("Huber:         y = {slope:.2} x + {offset:.2}    (true: 2 x + 1)");
    Ok(())
}
