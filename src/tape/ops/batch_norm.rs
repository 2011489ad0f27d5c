//! Batch normalisation over the rows of all samples of a step, channel by channel (Ioffe & Szegedy 2015).
//!   y = γ·x̂ + β,  x̂ = (x − μ)·r,  r = (σ² + ε)^-½;  while training μ and σ² (biased) are those of all N rows of the step
//!   dx = γ·r·(dy − Σdy/N − x̂·Σ(dy·x̂)/N),  dγ = Σ dy·x̂,  dβ = Σ dy
//!   running ← (1 − m)·running + m·(μ, or σ²·N/(N − 1)): as in PyTorch, the running variance is the unbiased one
//! Where random parts are off, μ and σ² are the running ones, and constants. x, y [n, C]; γ, β, running mean, running variance [C]. Kept: μ
//! and r. The backward pass reads x and γ.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Coupled, Coupling, Differentiable, Forward, Memory, Op, Pass, Reads, exactly, misfit};
use phyture_kernels::{Real, Rows, RowsMut, batch_norm, strided};

/// Operands x, γ, β, running mean, running variance; the last two are parameters without gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchNorm {
    /// ε inside the root.
    pub eps: f64,
    /// m, the weight of a step in the running values.
    pub momentum: f64,
}

fn channels(operands: &[Shape]) -> usize {
    operands.first().map_or(0, |x| x.rows().1)
}

impl<T: Real> Op<T> for BatchNorm {
    fn name(&self) -> &'static str {
        "batch_norm"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, C]; weight, bias, running mean and running variance [C]";
        let [x, each @ ..] = exactly::<5>("batch_norm", operands, EXPECTED)?;
        match x.lengths() {
            [_, channels] if each.iter().all(|other| other.lengths() == [*channels]) => Ok(x),
            _ => Err(misfit("batch_norm", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let channels = channels(operands);
        Memory { workspace: 2 * channels, backward_scratch: 2 * channels, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let channels = shape.rows().1;
        let [x, gamma, beta, running_mean, running_variance, ..] = io.x;
        let (mean, rstd) = io.workspace.split_at_mut(channels);
        let (from_mean, variance) = io.coupled.map_or((running_mean, running_variance), |coupled| coupled.total.split_at(channels));
        mean.copy_from_slice(from_mean);
        for (rstd, variance) in rstd.iter_mut().zip(variance) {
            // A variance below 0, which only a damaged file can hold, counts as 0.
            *rstd = T::of(1.0 / (variance.f64().max(0.0) + self.eps).sqrt());
        }
        batch_norm::forward(io.isa, rows(x, shape), (mean, rstd), gamma, beta, rows_mut(io.y, shape));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }

    fn coupling(&self) -> Option<&dyn Coupling<T>> {
        Some(self)
    }
}

impl<T: Real> Coupling<T> for BatchNorm {
    fn part_len(&self, operands: &[Shape]) -> usize {
        2 * channels(operands)
    }

    fn gather(&self, io: &Forward<'_, T>, part: &mut [T]) {
        let [shape, ..] = io.shapes else { return };
        batch_norm::moments(io.isa, rows(io.x[0], shape), part);
    }

    fn gather_backward(&self, io: &Backward<'_, T>, part: &mut [T]) {
        let [shape, ..] = io.shapes else { return };
        let kept = io.workspace.split_at(shape.rows().1);
        batch_norm::backward_sums(io.isa, rows(io.x[0], shape), kept, rows(io.dy, shape), part);
    }

    fn combine(&self, pass: Pass, operands: &[Shape], parts: &[T], total: &mut [T]) {
        match pass {
            Pass::Forward => batch_norm::combine(parts, operands.first().map_or(1, |x| x.rows().0), total),
            Pass::Backward => batch_norm::sum(parts, total),
        }
    }

    fn settle(&self, operand: usize, operands: &[Shape], coupled: Coupled<'_, T>, values: &mut [T]) {
        let (n, channels) = operands.first().map(Shape::rows).unwrap_or_default();
        let count = (coupled.samples * n) as f64;
        let (mean, variance) = coupled.total.split_at(channels);
        let (now, unbiased) = match operand {
            3 => (mean, 1.0),
            4 => (variance, count / (count - 1.0).max(1.0)),
            _ => return,
        };
        for (running, now) in values.iter_mut().zip(now) {
            *running = T::of((1.0 - self.momentum) * running.f64() + self.momentum * unbiased * now.f64());
        }
    }
}

impl<T: Real> Differentiable<T> for BatchNorm {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1])
    }

    fn reaches(&self, operand: usize) -> bool {
        operand < 3
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        let (n, channels) = shape.rows();
        let (x, dy, kept) = (rows(io.x[0], shape), rows(io.dy, shape), io.workspace.split_at(channels));
        let [dx, dgamma, dbeta, ..] = io.dx;
        if let Some(dx) = dx {
            let sums = io.coupled.map(|coupled| (coupled.total, coupled.samples * n));
            batch_norm::backward_input(io.isa, x, kept, io.x[1], dy, sums, (rows_mut(dx.values, shape), dx.write));
        }
        // A sample gives its own share of the sums; the session adds the shares.
        batch_norm::backward_sums(io.isa, x, kept, dy, &mut io.scratch[..2 * channels]);
        for (to, from) in [dgamma, dbeta].into_iter().zip(io.scratch.chunks_exact(channels)) {
            if let Some(to) = to {
                strided::copy(io.isa, Rows::packed(from, 1, channels), RowsMut::packed(to.values, 1, channels), to.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::SquaredError;
    use super::*;
    use crate::tape::error::Error;
    use crate::tape::{DropoutKey, Fill, Graph, Session, Threads, Var, gradcheck};
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;

    const OP: BatchNorm = BatchNorm { eps: 1e-5, momentum: 0.1 };
    const KEY: Option<DropoutKey> = Some(DropoutKey { seed: 1, step: 0 });

    // Without a step's total: the running values.
    gradcheck!(running_values: OP, [[5, 3], [3], [3], [3], [3]], [[1, 1], [1], [1], [1], [1]]);

    /// Two batch norms with a linear map before each, and the squared error.
    fn graph<T: Real>() -> Result<(Graph<T>, Var)> {
        let mut graph = Graph::<T>::new();
        let mut x = graph.input("x", &[4, 3])?;
        for layer in 0..2 {
            let name = |part: &str| format!("{layer}.{part}");
            let weight = graph.parameter(&name("weight"), &[3, 3])?;
            x = graph.apply(super::super::Linear, &[x, weight])?;
            let mut operands = vec![x];
            for part in ["gamma", "beta", "running_mean", "running_variance"] {
                operands.push(graph.parameter(&name(part), &[3])?);
            }
            x = graph.apply(OP, &operands)?;
        }
        let target = graph.input("target", &[4, 3])?;
        let loss = graph.apply(SquaredError { scale: 1.0 }, &[x, target])?;
        Ok((graph, loss))
    }

    fn fill<T: Real>(sample: usize, inputs: &mut [&mut [T]]) {
        for (index, input) in inputs.iter_mut().enumerate() {
            let stream = Stream::new(3, 0, index as u64, sample as u64);
            input.iter_mut().enumerate().for_each(|(at, value)| *value = T::of(3.0 * stream.uniform(at as u64) - 1.0));
        }
    }

    fn parameters<T: Real>(count: usize) -> Vec<T> {
        (0..count).map(|at| T::of(0.2 + Stream::new(4, 0, 0, 0).uniform(at as u64))).collect()
    }

    #[test]
    fn coupled_samples_have_the_gradients_of_their_common_loss() -> Result<()> {
        let (graph, loss) = graph::<f64>()?;
        let parameters = parameters(graph.parameter_count());
        // The second batch norm takes off what the first one's bias adds to every row.
        let zero = |name: &str| name.contains("running") || name == "0.beta";
        gradcheck::graph(
            &gradcheck::LossOf { graph: &graph, loss, parameters: &parameters, samples: 5, dropout: KEY, fill: &fill },
            &zero,
            1,
        )
        .map_err(|disagreement| Error::Shape { operation: "gradcheck", message: disagreement.to_string() })
    }

    #[test]
    fn threads_change_no_bit_of_a_coupled_step() -> Result<()> {
        let (graph, loss) = graph::<f32>()?;
        let parameters = parameters(graph.parameter_count());
        let mut found = Vec::new();
        for threads in [1, 2, 5] {
            let mut session = Session::train(&graph, loss, &[], Threads(threads))?;
            session.step(&parameters, 11, KEY, &fill)?;
            found.push(session.gradients().iter().map(|value| value.to_bits()).collect::<Vec<_>>());
        }
        assert!(found.iter().all(|bits| bits == &found[0]));
        Ok(())
    }

    #[test]
    fn the_running_variance_is_unbiased_and_prediction_uses_the_running_values() -> Result<()> {
        let mut graph = Graph::<f64>::new();
        let mut operands = vec![graph.input("x", &[4, 1])?];
        for part in ["gamma", "beta", "running_mean", "running_variance"] {
            operands.push(graph.parameter(part, &[1])?);
        }
        let y = graph.apply(OP, &operands)?;
        let mut session = Session::infer(&graph, &[y], Threads(1))?;
        // Two samples of four rows: 0 … 7, mean 3.5, biased variance 5.25, unbiased 6.
        let rows: Fill<'_, f64> = &|sample, inputs| {
            inputs[0].iter_mut().enumerate().for_each(|(at, value)| *value = (4 * sample + at) as f64);
        };
        let mut parameters = vec![2.0, 1.0, 0.0, 1.0];
        let close = |found: f64, expected: f64| (found - expected).abs() < Tolerance::Close.relative_f64();
        session.step(&parameters, 2, KEY, rows)?;
        assert!(close(session.output(0, 1)?[3], 2.0 * 3.5 / (5.25_f64 + 1e-5).sqrt() + 1.0));
        session.settle(&mut parameters);
        assert!(close(parameters[2], 0.1 * 3.5) && close(parameters[3], 0.9 + 0.1 * 6.0), "{parameters:?}");
        session.step(&parameters, 2, None, rows)?;
        assert!(close(session.output(0, 1)?[3], 2.0 * (7.0 - 0.35) / (1.5_f64 + 1e-5).sqrt() + 1.0));
        // Nothing new to settle.
        session.settle(&mut parameters);
        assert!(close(parameters[2], 0.35));
        Ok(())
    }
}
