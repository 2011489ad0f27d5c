//! Long short-term memory, one layer, zero initial state; all hidden states.
//!   [i f g o](t) = W_x·x(t) + b_x + W_h·h(t−1) + b_h,  i, f, o ← σ, g ← tanh,  c(t) = f∘c(t−1) + i∘g,  h(t) = o∘tanh c(t)
//!   dc(t) = dh(t)∘o∘(1 − tanh² c) + f(t+1)∘dc(t+1),  dh(t) = dy(t) + W_hᵀ·dgates(t+1),
//!   dx = dgates·W_x,  dW_x = dgatesᵀ·x,  dW_h = Σ_t dgates(t)·h(t−1)ᵀ,  db_x = db_h = Σ_t dgates(t)
//! x [n, in], W_x [4h, in], W_h [4h, h], b_x, b_h [4h], gate order i, f, g, o as in PyTorch; y [n, h]. Kept: gates [n, 4h], cells
//! [n, h]. The backward pass reads x, both weights and y.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::lstm::{self, Weights};
use phyture_kernels::{Real, Rows, RowsMut, linear};

/// Operands x, W_x, W_h, b_x, b_h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lstm;

/// Steps, input channels, hidden channels.
fn sizes(operands: &[Shape]) -> (usize, usize, usize) {
    let [x, _, recurrent, ..] = operands else { return (0, 0, 0) };
    (x.rows().0, x.rows().1, recurrent.rows().1)
}

impl<T: Real> Op<T> for Lstm {
    fn name(&self) -> &'static str {
        "lstm"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, in], weights [4h, in] and [4h, h], two biases [4h]";
        let [x, input, recurrent, input_bias, recurrent_bias] = exactly("lstm", operands, EXPECTED)?;
        let (_, inputs, hidden) = sizes(operands);
        let wide = 4 * hidden;
        let biases = input_bias.lengths() == [wide] && recurrent_bias.lengths() == [wide];
        match x.lengths() {
            [n, _] if biases && input.lengths() == [wide, inputs] && recurrent.lengths() == [wide, hidden] => {
                Shape::new("lstm", &[*n, hidden])
            }
            _ => Err(misfit("lstm", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let (n, inputs, hidden) = sizes(operands);
        let products = linear::scratch_len(n, inputs, 4 * hidden);
        Memory {
            workspace: 5 * n * hidden,
            forward_scratch: lstm::forward_scratch_len(n, inputs, hidden),
            // Gradients of the gates in front.
            backward_scratch: 4 * n * hidden + lstm::backward_scratch_len(hidden).max(products),
            ..Memory::default()
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, ..] = io.shapes else { return };
        let (n, _, hidden) = sizes(io.shapes);
        let [_, input, recurrent, input_bias, recurrent_bias, ..] = io.x;
        let weights = Weights { input, recurrent, input_bias, recurrent_bias };
        let (gates, cells) = io.workspace.split_at_mut(4 * n * hidden);
        let (gates, cells) = (RowsMut::packed(gates, n, 4 * hidden), RowsMut::packed(cells, n, hidden));
        lstm::forward(io.isa, rows(io.x[0], x), weights, RowsMut::packed(io.y, n, hidden), gates, cells, io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Lstm {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1, 2]).and_result()
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [x_shape, ..] = io.shapes else { return };
        let (n, _, hidden) = sizes(io.shapes);
        let (gates, cells) = io.workspace.split_at(4 * n * hidden);
        let (gates, cells) = (Rows::packed(gates, n, 4 * hidden), Rows::packed(cells, n, hidden));
        let (dgates, scratch) = io.scratch.split_at_mut(4 * n * hidden);
        let dy = Rows::packed(io.dy, n, hidden);
        let to = RowsMut::packed(&mut *dgates, n, 4 * hidden);
        lstm::backward_gates(io.isa, io.x[2], gates, cells, dy, to, scratch);
        let dgates = Rows::packed(dgates, n, 4 * hidden);
        let [dx, dinput, drecurrent, dinput_bias, drecurrent_bias, ..] = io.dx;
        if let Some(dx) = dx {
            linear::backward_input(io.isa, dgates, io.x[1], rows_mut(dx.values, x_shape), dx.write, scratch);
        }
        if let Some(dinput) = dinput {
            linear::backward_weight(io.isa, rows(io.x[0], x_shape), dgates, dinput.values, dinput.write, scratch);
        }
        if let Some(drecurrent) = drecurrent {
            let h = Rows::packed(io.y, n, hidden);
            lstm::backward_recurrent(io.isa, h, dgates, drecurrent.values, drecurrent.write);
        }
        for bias in [dinput_bias, drecurrent_bias].into_iter().flatten() {
            linear::backward_bias(io.isa, dgates, bias.values, bias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::error::Result;
    use crate::tape::{Graph, Session, Threads};
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;

    gradcheck!(lstm: Lstm, [[5, 3], [8, 3], [8, 2], [8], [8]], [[1, 1], [4, 1], [4, 1], [4], [4]], [[9, 4], [20, 4], [20, 5], [20], [20]]);

    /// Hidden states for these rows; parameters are those of all rows.
    fn states(x: &[f64], inputs: usize, parameters: &[f64]) -> Result<Vec<f64>> {
        let mut graph = Graph::<f64>::new();
        let mut operands = vec![graph.input("x", &[x.len() / inputs, inputs])?];
        for (name, lengths) in [("wx", &[8, inputs][..]), ("wh", &[8, 2]), ("bx", &[8]), ("bh", &[8])] {
            operands.push(graph.parameter(name, lengths)?);
        }
        let y = graph.apply(Lstm, &operands)?;
        let mut session = Session::infer(&graph, &[y], Threads(1))?;
        session
            .step(parameters, 1, None, &|_, slabs: &mut [&mut [f64]]| slabs.iter_mut().for_each(|slab| slab.copy_from_slice(x)))?;
        Ok(session.output(0, 0)?.to_vec())
    }

    #[test]
    fn the_start_of_a_sequence_does_not_see_its_end() -> Result<()> {
        let numbers = |seed, count: usize| (0..count as u64).map(|at| Stream::new(seed, 0, 0, 0).uniform(at) - 0.5).collect();
        let (x, parameters): (Vec<f64>, Vec<f64>) = (numbers(1, 21), numbers(2, 8 * 3 + 8 * 2 + 16));
        let (whole, start) = (states(&x, 3, &parameters)?, states(&x[..12], 3, &parameters)?);
        assert_eq!(whole.len(), 14);
        assert!(whole.iter().zip(&start).all(|(a, b)| a.to_bits() == b.to_bits()));
        Ok(())
    }

    #[test]
    fn gates_are_input_forget_candidate_output() -> Result<()> {
        // One hidden unit, no recurrent weight, and biases that alone set the gates; two steps.
        let [i, f, g, o] = [0.7, -0.4, 0.9, 0.2_f64];
        let sigma = |x: f64| 1.0 / (1.0 + (-x).exp());
        // Two units, the same gates in both.
        let biases: Vec<f64> = [i, i, f, f, g, g, o, o].to_vec();
        let parameters: Vec<f64> = [vec![0.0; 8], vec![0.0; 16], biases, vec![0.0; 8]].concat();
        let first = sigma(i) * g.tanh();
        let second = sigma(f) * first + sigma(i) * g.tanh();
        let expected = [first, first, second, second].map(|cell| sigma(o) * cell.tanh());
        let found = states(&[1.0, 1.0], 1, &parameters)?;
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < Tolerance::Close.relative_f64()), "{found:?}");
        Ok(())
    }
}
