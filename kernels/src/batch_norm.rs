//! Batch normalisation over all rows of all samples of a step, channel by channel, in pieces of one sample.
//!
//! ```text
//! y = γ·x̂ + β,   x̂ = (x − μ)·r,   r = (σ² + ε)^-½   with μ, σ² (biased) over all N rows of the step
//! dx = γ·r·(dy − Σdy/N − x̂·Σ(dy·x̂)/N),   dγ = Σ dy·x̂,   dβ = Σ dy   with sums over all N rows
//! ```
//!
//! x, y `[n, C]` of one sample. A sample gives its moments; these are combined by the rule of Chan, Golub & LeVeque (1979), which does
//! not lose digits to a large mean; then each sample is normalised on its own. The same in the backward pass with the two sums.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// Mean and sum of squared distances from it of one sample, `[2, C]`.
///
/// # Panics
/// If lengths disagree.
pub fn moments<T: Real>(isa: InstructionSet, x: Rows<'_, T>, moments: &mut [T]) {
    assert_eq!(moments.len(), 2 * x.cols(), "batch norm: moments");
    T::batch_norm_moments(isa, Moments { x, moments });
}

pub(crate) struct Moments<'a, T> {
    x: Rows<'a, T>,
    moments: &'a mut [T],
}

impl<T: Real> Kernel for Moments<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (mean, square) = self.moments.split_at_mut(self.x.cols());
        mean.fill(T::ZERO);
        square.fill(T::ZERO);
        let share = T::of(1.0 / self.x.rows().max(1) as f64);
        for t in 0..self.x.rows() {
            mean.iter_mut().zip(self.x.row(t)).for_each(|(mean, x)| *mean += *x);
        }
        mean.iter_mut().for_each(|mean| *mean *= share);
        for t in 0..self.x.rows() {
            for ((square, mean), x) in square.iter_mut().zip(&*mean).zip(self.x.row(t)) {
                let off = *x - *mean;
                *square = I::mul_add(off, off, *square);
            }
        }
    }
}

/// Mean and biased variance `[2, C]` of all samples, from the moments `[samples, 2, C]` of samples of `rows` rows each.
///
/// # Panics
/// If lengths disagree.
pub fn combine<T: Real>(parts: &[T], rows: usize, total: &mut [T]) {
    let channels = total.len() / 2;
    let samples = parts.len() / (2 * channels).max(1);
    let (mean, variance) = total.split_at_mut(channels);
    for (c, (mean, variance)) in mean.iter_mut().zip(variance).enumerate() {
        let of = |at: usize| parts.iter().skip(at).step_by(2 * channels).map(|part| part.f64());
        let all = of(c).sum::<f64>() / samples as f64;
        let between: f64 = of(c).map(|part| (part - all) * (part - all)).sum();
        let within: f64 = of(channels + c).sum();
        *mean = T::of(all);
        *variance = T::of((within / rows as f64 + between) / samples as f64);
    }
}

/// Sum of the parts `[samples, len]` in their order.
pub fn sum<T: Real>(parts: &[T], total: &mut [T]) {
    let len = total.len();
    for (at, total) in total.iter_mut().enumerate() {
        *total = T::of(parts.iter().skip(at).step_by(len).map(|part| part.f64()).sum());
    }
}

/// y from x, μ, r, γ and β.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    (mean, rstd): (&[T], &[T]),
    gamma: &[T],
    beta: &[T],
    y: RowsMut<'_, T>,
) {
    same_shape(&x, &y.view());
    T::batch_norm_forward(isa, Forward { x, mean, rstd, gamma, beta, y });
}

pub(crate) struct Forward<'a, T> {
    x: Rows<'a, T>,
    mean: &'a [T],
    rstd: &'a [T],
    gamma: &'a [T],
    beta: &'a [T],
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for t in 0..self.x.rows() {
            let scales = self.mean.iter().zip(self.rstd).zip(self.gamma.iter().zip(self.beta));
            for ((y, x), ((mean, rstd), (gamma, beta))) in self.y.row_mut(t).iter_mut().zip(self.x.row(t)).zip(scales) {
                *y = I::mul_add(*gamma * *rstd, *x - *mean, *beta);
            }
        }
    }
}

/// Σ dy·x̂ and Σ dy of one sample, `[2, C]`: its shares of dγ and dβ.
///
/// # Panics
/// If shapes disagree.
pub fn backward_sums<T: Real>(isa: InstructionSet, x: Rows<'_, T>, (mean, rstd): (&[T], &[T]), dy: Rows<'_, T>, sums: &mut [T]) {
    same_shape(&x, &dy);
    assert_eq!(sums.len(), 2 * x.cols(), "batch norm: sums");
    T::batch_norm_backward_sums(isa, BackwardSums { x, mean, rstd, dy, sums });
}

pub(crate) struct BackwardSums<'a, T> {
    x: Rows<'a, T>,
    mean: &'a [T],
    rstd: &'a [T],
    dy: Rows<'a, T>,
    sums: &'a mut [T],
}

impl<T: Real> Kernel for BackwardSums<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (products, plain) = self.sums.split_at_mut(self.x.cols());
        products.fill(T::ZERO);
        plain.fill(T::ZERO);
        for t in 0..self.x.rows() {
            let normal = self.x.row(t).iter().zip(self.mean).zip(self.rstd).map(|((x, mean), rstd)| (*x - *mean) * *rstd);
            for (((product, plain), dy), normal) in products.iter_mut().zip(&mut *plain).zip(self.dy.row(t)).zip(normal) {
                *product = I::mul_add(*dy, normal, *product);
                *plain += *dy;
            }
        }
    }
}

/// dx {=, +=} from the sums `[2, C]` over all `count` rows of the step; with none of them, μ and r are constants.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    (mean, rstd): (&[T], &[T]),
    gamma: &[T],
    dy: Rows<'_, T>,
    sums: Option<(&[T], usize)>,
    (dx, write): (RowsMut<'_, T>, Write),
) {
    same_shape(&dy, &dx.view());
    T::batch_norm_backward_input(isa, BackwardInput { x, mean, rstd, gamma, dy, sums, dx, write });
}

pub(crate) struct BackwardInput<'a, T> {
    x: Rows<'a, T>,
    mean: &'a [T],
    rstd: &'a [T],
    gamma: &'a [T],
    dy: Rows<'a, T>,
    sums: Option<(&'a [T], usize)>,
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for BackwardInput<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let channels = self.dy.cols();
        for t in 0..self.dy.rows() {
            for (c, (dx, dy)) in self.dx.row_mut(t).iter_mut().zip(self.dy.row(t)).enumerate() {
                let mut inner = *dy;
                if let Some((sums, count)) = self.sums {
                    let share = T::of(1.0 / count as f64);
                    let normal = (self.x.row(t)[c] - self.mean[c]) * self.rstd[c];
                    inner -= share * (sums[channels + c] + normal * sums[c]);
                }
                let value = self.gamma[c] * self.rstd[c] * inner;
                *dx = value + if self.write == Write::Add { *dx } else { T::ZERO };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    const EPSILON: f64 = 1e-5;

    fn check<T: Real>(samples: usize, rows: usize, channels: usize, seed: u64) {
        let shape = (rows, channels);
        let of =
            |seed: u64| -> Vec<Matrix<T>> { (0..samples as u64).map(|sample| Matrix::random(seed + 10 * sample, shape)).collect() };
        let (x, dy) = (of(seed), of(seed + 1));
        let (gamma, beta) = (numbers::<T>(seed + 2, channels), numbers::<T>(seed + 3, channels));
        // All samples one under the other, in f64.
        let stack = |parts: &[Matrix<T>]| parts.iter().flat_map(Matrix::to_vec).map(|x| x.f64()).collect::<Vec<f64>>();
        let (all_x, all_dy, n) = (stack(&x), stack(&dy), (samples * rows) as f64);
        let column = |values: &[f64], c: usize| values.iter().skip(c).step_by(channels).copied().collect::<Vec<f64>>();
        let mut expected = [vec![0.0; all_x.len()], vec![0.0; all_x.len()]];
        for c in 0..channels {
            let (x, dy) = (column(&all_x, c), column(&all_dy, c));
            let mean = x.iter().sum::<f64>() / n;
            let r = 1.0 / (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n + EPSILON).sqrt();
            let sum: f64 = dy.iter().sum();
            let product: f64 = x.iter().zip(&dy).map(|(x, dy)| dy * (x - mean) * r).sum();
            for (t, (x, dy)) in x.iter().zip(&dy).enumerate() {
                let (normal, gamma) = ((x - mean) * r, gamma[c].f64());
                expected[0][t * channels + c] = gamma * normal + beta[c].f64();
                expected[1][t * channels + c] = gamma * r * (dy - sum / n - normal * product / n);
            }
        }
        for isa in InstructionSet::available() {
            let gather = |work: &dyn Fn(usize, &mut [T])| {
                let mut parts = vec![T::NAN; samples * 2 * channels];
                parts.chunks_exact_mut(2 * channels).enumerate().for_each(|(sample, part)| work(sample, part));
                parts
            };
            let mut total = vec![T::NAN; 2 * channels];
            combine(&gather(&|sample, part| moments(isa, x[sample].view(), part)), rows, &mut total);
            let (mean, variance) = total.split_at(channels);
            let rstd: Vec<T> = variance.iter().map(|variance| T::of(1.0 / (variance.f64() + EPSILON).sqrt())).collect();
            let mut sums = vec![T::NAN; 2 * channels];
            sum(&gather(&|sample, part| backward_sums(isa, x[sample].view(), (mean, &rstd), dy[sample].view(), part)), &mut sums);
            for sample in 0..samples {
                let own =
                    |values: &[f64]| Matrix::<T>::filled(shape, 0, 0, |t, c| T::of(values[(sample * rows + t) * channels + c]));
                let mut y = Matrix::<T>::poisoned(seed, shape);
                forward(isa, x[sample].view(), (mean, &rstd), &gamma, &beta, y.view_mut());
                assert_near("y", &y.to_vec(), &own(&expected[0]).to_vec(), Tolerance::Approximate);
                check_writes("dx", &own(&expected[1]), Tolerance::Approximate, |dx, write| {
                    let sums = Some((sums.as_slice(), samples * rows));
                    backward_input(isa, x[sample].view(), (mean, &rstd), &gamma, dy[sample].view(), sums, (dx, write));
                });
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_its_definition(samples in 1_usize..6, rows in 2_usize..200, channels in 1_usize..40, seed in 0_u64..1000) {
            check::<f32>(samples, rows, channels, seed);
            check::<f64>(samples, rows, channels, seed);
        }
    }
}
