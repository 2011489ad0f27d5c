//! The strongest periods of a sequence and their weights (TimesNet).
//!   A_f = mean over channels of |Σ_t x[t, c]·e^(−2πi·f·t/n)|;  f_1 … f_k the frequencies of the largest, from 1 to n/2;
//!   y[i] = (⌊n/f_i⌋, w_i),  w = softmax(A_f1 … A_fk)
//!   dA_fi = w_i·(dw_i − Σ_j w_j·dw_j);  dx as in `phyture_kernels::spectrum`; the periods themselves are steps, without gradient
//! x [n, C], y [k, 2]. Kept: the frequencies [k] and X at them [k, 2, C]. The backward pass reads y.
//!
//! The reference chooses the periods of a whole batch from its mean amplitude, so that a prediction depends on its neighbours. Here
//! each sample has its own, in training and in prediction.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::elementary::or_zero;
use phyture_kernels::spectrum::{self, Transform};
use phyture_kernels::{Real, Write};

/// Operand x.
#[derive(Clone, Debug, PartialEq)]
pub struct FftPeriods {
    count: usize,
    transform: Transform,
}

impl FftPeriods {
    /// The `count` strongest periods of sequences of this length.
    pub fn new(count: usize, length: usize) -> Self {
        Self { count, transform: Transform::new(length) }
    }
}

impl<T: Real> Op<T> for FftPeriods {
    fn name(&self) -> &'static str {
        "periods"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [n, C] of the transform's length, with at least as many frequencies as are chosen";
        let [x] = exactly("periods", operands, EXPECTED)?;
        match x.lengths() {
            [n, _] if *n == self.transform.rows() && (1..=spectrum::frequencies(*n)).contains(&self.count) => {
                Shape::new("periods", &[self.count, 2])
            }
            _ => Err(misfit("periods", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let (n, channels) = operands.first().map(Shape::rows).unwrap_or_default();
        Memory {
            workspace: self.count * (1 + 2 * channels),
            forward_scratch: spectrum::frequencies(n) + self.transform.scratch_len(channels),
            backward_scratch: 2 * channels,
            ..Memory::default()
        }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, ..] = io.shapes else { return };
        let (n, channels) = x.rows();
        let (amplitudes, scratch) = io.scratch.split_at_mut(spectrum::frequencies(n));
        spectrum::amplitudes(io.isa, &self.transform, rows(io.x[0], x), amplitudes, scratch);
        let (real, imaginary) = scratch.split_at(n * channels);
        let (chosen, parts) = io.workspace.split_at_mut(self.count);
        let y = io.y;
        spectrum::strongest(amplitudes, self.count, |place, f| {
            chosen[place] = T::of(f as f64);
            let (re, im) = parts[2 * place * channels..][..2 * channels].split_at_mut(channels);
            re.copy_from_slice(&real[f * channels..][..channels]);
            im.copy_from_slice(&imaginary[f * channels..][..channels]);
            y[2 * place] = T::of((n / f) as f64);
            y[2 * place + 1] = amplitudes[f - 1];
        });
        // The first is the largest.
        let largest = y[1];
        let mut sum = T::ZERO;
        for weight in y.iter_mut().skip(1).step_by(2) {
            // A share too small to show would make all gradients behind it subnormal.
            *weight = or_zero((*weight - largest).exp());
            sum += *weight;
        }
        y.iter_mut().skip(1).step_by(2).for_each(|weight| *weight /= sum);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for FftPeriods {
    fn reads(&self) -> Reads {
        Reads::result()
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([x, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let channels = x.rows().1;
        if dx.write == Write::Set {
            dx.values.fill(T::ZERO);
        }
        let weights = || io.y.iter().skip(1).step_by(2).zip(io.dy.iter().skip(1).step_by(2));
        let mean: T = weights().map(|(weight, dweight)| *weight * *dweight).sum();
        let (chosen, parts) = io.workspace.split_at(self.count);
        for (place, (weight, dweight)) in weights().enumerate() {
            let parts = parts[2 * place * channels..][..2 * channels].split_at(channels);
            let (f, damplitude) = (chosen[place].f64() as usize, *weight * (*dweight - mean));
            spectrum::backward(io.isa, &self.transform, f, parts, damplitude, rows_mut(dx.values, x), io.scratch);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::{Graph, Session, Threads};
    use phyture_kernels::Tolerance;
    use std::f64::consts::TAU;

    gradcheck!(periods: FftPeriods::new(3, 12), [[12, 3]]);
    gradcheck!(one_period_of_a_prime_length: FftPeriods::new(1, 7), [[7, 2]]);

    #[test]
    fn the_periods_of_sinusoids_are_found_and_the_stronger_comes_first() -> Result<()> {
        let (n, channels) = (1000, 2);
        let mut graph = Graph::<f64>::new();
        let x = graph.input("x", &[n, channels])?;
        let y = graph.apply(FftPeriods::new(3, n), &[x])?;
        let mut session = Session::infer(&graph, &[y], Threads(1))?;
        // 20 and 3 periods in both channels, 7 in one of them; and a mean, which does not count.
        let wave = |f: f64, t: usize, phase: f64| (TAU * f * t as f64 / n as f64 + phase).sin();
        session.step(&[], 1, None, &|_, inputs: &mut [&mut [f64]]| {
            for (at, value) in inputs[0].iter_mut().enumerate() {
                let (t, c) = (at / channels, at % channels);
                let third = if c == 0 { 0.006 * wave(7.0, t, 0.0) } else { 0.0 };
                *value = 5.0 + 0.012 * wave(20.0, t, c as f64) + 0.008 * wave(3.0, t, 1.0) + third;
            }
        })?;
        let found = session.output(0, 0)?;
        assert_eq!([found[0], found[2], found[4]], [50.0, 333.0, 142.0]);
        // |X| = amplitude·n/2.
        let amplitudes = [0.012 * 500.0, 0.008 * 500.0, 0.006 * 500.0 / 2.0_f64];
        let sum: f64 = amplitudes.iter().map(|amplitude| amplitude.exp()).sum();
        for (weight, amplitude) in found.iter().skip(1).step_by(2).zip(amplitudes) {
            assert!((weight - amplitude.exp() / sum).abs() < Tolerance::Close.relative_f64(), "{found:?}");
        }
        Ok(())
    }
}
