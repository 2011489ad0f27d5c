//! Layer normalisation over the last axis.
//!
//! ```text
//! y = γ·x̂ + β,  x̂ = (x − μ)·r,  r = (σ² + ε)^−½            (μ, σ² of each row; σ² with divisor C)
//! dx = r·(g − mean(g) − x̂·mean(g·x̂)),  g = γ·dy;   dγ = Σ dy·x̂;   dβ = Σ dy
//! ```
//!
//! x, y `[n, C]`; γ, β `[C]`; kept for the backward pass: μ, r `[n]`.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write, row_reductions};

/// y, and `mean` and `rstd` `[n]` for the backward pass.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    (gamma, beta): (&[T], &[T]),
    epsilon: f64,
    y: RowsMut<'_, T>,
    (mean, rstd): (&mut [T], &mut [T]),
) {
    same_shape(&x, &y.view());
    assert!(gamma.len() == x.cols() && beta.len() == x.cols(), "layer norm: length of gamma or beta");
    assert!(mean.len() == x.rows() && rstd.len() == x.rows(), "layer norm: length of mean or rstd");
    T::layer_norm_forward(isa, Forward { x, gamma, beta, epsilon: T::of(epsilon), y, mean, rstd });
}

pub(crate) struct Forward<'a, T> {
    x: Rows<'a, T>,
    gamma: &'a [T],
    beta: &'a [T],
    epsilon: T,
    y: RowsMut<'a, T>,
    mean: &'a mut [T],
    rstd: &'a mut [T],
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let share = T::ONE / T::of(self.x.cols() as f64);
        for i in 0..self.x.rows() {
            let x = self.x.row(i);
            let mean = row_reductions::of::<T, I>(x, |x| x) * share;
            let variance = row_reductions::of_products::<T, I>(x, x, |x| x - mean, |x| x - mean) * share;
            let rstd = T::ONE / (variance + self.epsilon).sqrt();
            for (((y, x), gamma), beta) in self.y.row_mut(i).iter_mut().zip(x).zip(self.gamma).zip(self.beta) {
                *y = I::mul_add((*x - mean) * rstd, *gamma, *beta);
            }
            (self.mean[i], self.rstd[i]) = (mean, rstd);
        }
    }
}

/// dx {=, +=} from dy and what the forward pass kept.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    gamma: &[T],
    (mean, rstd): (&[T], &[T]),
    dy: Rows<'_, T>,
    dx: RowsMut<'_, T>,
    write: Write,
) {
    same_shape(&x, &dy);
    same_shape(&x, &dx.view());
    assert!(gamma.len() == x.cols(), "layer norm: length of gamma");
    assert!(mean.len() == x.rows() && rstd.len() == x.rows(), "layer norm: length of mean or rstd");
    T::layer_norm_backward_input(isa, BackwardInput { x, gamma, mean, rstd, dy, dx, write });
}

pub(crate) struct BackwardInput<'a, T> {
    x: Rows<'a, T>,
    gamma: &'a [T],
    mean: &'a [T],
    rstd: &'a [T],
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for BackwardInput<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let share = T::ONE / T::of(self.x.cols() as f64);
        let adds = self.write == Write::Add;
        for (i, (&mean, &rstd)) in self.mean.iter().zip(self.rstd).enumerate() {
            let (x, dy, dx) = (self.x.row(i), self.dy.row(i), self.dx.row_mut(i));
            let mean_g = row_reductions::dot::<T, I>(dy, self.gamma) * share;
            // mean(g·x̂) = r·(Σ g·x − μ·Σ g)/C would cancel; the sum takes x − μ at once.
            let mut mean_g_normal = T::ZERO;
            for ((dy, gamma), x) in dy.chunks(CHUNK).zip(self.gamma.chunks(CHUNK)).zip(x.chunks(CHUNK)) {
                let mut g = [T::ZERO; CHUNK];
                g.iter_mut().zip(dy).zip(gamma).for_each(|((g, dy), gamma)| *g = *dy * *gamma);
                mean_g_normal += row_reductions::of_products::<T, I>(x, &g[..x.len()], |x| (x - mean) * rstd, |g| g);
            }
            mean_g_normal *= share;
            for (((dx, dy), gamma), x) in dx.iter_mut().zip(dy).zip(self.gamma).zip(x) {
                let normal = (*x - mean) * rstd;
                let value = rstd * (*dy * *gamma - mean_g - normal * mean_g_normal);
                *dx = value + if adds { *dx } else { T::ZERO };
            }
        }
    }
}

/// Columns whose g = γ·dy are held at a time.
const CHUNK: usize = 64;

/// dγ, dβ {=, +=} from dy and what the forward pass kept.
///
/// # Panics
/// If shapes disagree.
pub fn backward_parameters<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    (mean, rstd): (&[T], &[T]),
    dy: Rows<'_, T>,
    (dgamma, dbeta): (&mut [T], &mut [T]),
    write: Write,
) {
    same_shape(&x, &dy);
    assert!(dgamma.len() == x.cols() && dbeta.len() == x.cols(), "layer norm: length of the gradients of gamma or beta");
    assert!(mean.len() == x.rows() && rstd.len() == x.rows(), "layer norm: length of mean or rstd");
    T::layer_norm_backward_parameters(isa, BackwardParameters { x, mean, rstd, dy, dgamma, dbeta, write });
}

pub(crate) struct BackwardParameters<'a, T> {
    x: Rows<'a, T>,
    mean: &'a [T],
    rstd: &'a [T],
    dy: Rows<'a, T>,
    dgamma: &'a mut [T],
    dbeta: &'a mut [T],
    write: Write,
}

impl<T: Real> Kernel for BackwardParameters<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        if self.write == Write::Set {
            self.dgamma.fill(T::ZERO);
            self.dbeta.fill(T::ZERO);
        }
        for (i, (&mean, &rstd)) in self.mean.iter().zip(self.rstd).enumerate() {
            let gradients = self.dgamma.iter_mut().zip(self.dbeta.iter_mut());
            for (((dgamma, dbeta), dy), x) in gradients.zip(self.dy.row(i)).zip(self.x.row(i)) {
                *dgamma = I::mul_add(*dy, (*x - mean) * rstd, *dgamma);
                *dbeta += *dy;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, check_writes, inner, numbers};
    use crate::tolerance::Tolerance;

    /// PyTorch's default.
    const EPSILON: f64 = 1e-5;

    fn check<T: Real>(rows: usize, cols: usize, seed: u64) {
        let (x, dy) = (Matrix::<T>::random(seed, (rows, cols)), Matrix::<T>::random(seed + 1, (rows, cols)));
        let (gamma, beta) = (numbers::<T>(seed + 2, cols), numbers::<T>(seed + 3, cols));
        let mut y_expected = Matrix::<T>::poisoned(seed, (rows, cols));
        let (mut mean, mut rstd) = (vec![T::NAN; rows], vec![T::NAN; rows]);
        reference::layer_norm(x.view(), &gamma, &beta, EPSILON, y_expected.view_mut(), &mut mean, &mut rstd);
        let mut dx_expected = Matrix::<T>::poisoned(seed, (rows, cols));
        let mut parameters = (Matrix::<T>::poisoned(0, (1, cols)), Matrix::<T>::poisoned(0, (1, cols)));
        let (dgamma, dbeta) = (&mut parameters.0, &mut parameters.1);
        let (mut dgamma, mut dbeta) = (dgamma.view_mut(), dbeta.view_mut());
        reference::layer_norm_backward(
            x.view(),
            &gamma,
            EPSILON,
            dy.view(),
            dx_expected.view_mut(),
            dgamma.row_mut(0),
            dbeta.row_mut(0),
        );
        for isa in InstructionSet::available() {
            let mut y = Matrix::<T>::poisoned(seed, (rows, cols));
            let (mut mean, mut rstd) = (vec![T::NAN; rows], vec![T::NAN; rows]);
            forward(isa, x.view(), (&gamma, &beta), EPSILON, y.view_mut(), (&mut mean, &mut rstd));
            y.check_gaps();
            assert_near("y", &y.to_vec(), &y_expected.to_vec(), Tolerance::Close);
            check_writes("dx", &dx_expected, Tolerance::Close, |dx, write| {
                backward_input(isa, x.view(), &gamma, (&mean, &rstd), dy.view(), dx, write);
            });
            check_writes("dgamma", &parameters.0, Tolerance::Close, |mut dgamma, write| {
                let mut dbeta = vec![T::ZERO; cols];
                backward_parameters(isa, x.view(), (&mean, &rstd), dy.view(), (dgamma.row_mut(0), &mut dbeta), write);
            });
            check_writes("dbeta", &parameters.1, Tolerance::Close, |mut dbeta, write| {
                let mut dgamma = vec![T::ZERO; cols];
                backward_parameters(isa, x.view(), (&mean, &rstd), dy.view(), (&mut dgamma, dbeta.row_mut(0)), write);
            });
        }
    }

    proptest! {
        #[test]
        // From 8 columns on: the spread of fewer random numbers can be so small that r amplifies any rounding.
        fn equals_its_definition(rows in 0_usize..40, cols in 8_usize..200, seed in 0_u64..1000) {
            check::<f32>(rows, cols, seed);
            check::<f64>(rows, cols, seed);
        }

        /// With γ = 1 and ε = 0, moving or stretching a row changes nothing: dx is orthogonal to 1 and to x̂.
        #[test]
        fn gradient_is_orthogonal_to_shift_and_stretch(cols in 8_usize..100, seed in 0_u64..1000) {
            let (x, dy, gamma, beta) = (numbers::<f64>(seed, cols), numbers::<f64>(seed + 1, cols), vec![1.0; cols], vec![0.0; cols]);
            for isa in InstructionSet::available() {
                let (mut y, mut dx, mut mean, mut rstd) = (vec![0.0; cols], vec![0.0; cols], [0.0], [0.0]);
                let row = |x| Rows::packed(x, 1, cols);
                forward(isa, row(&x), (&gamma, &beta), 0.0, RowsMut::packed(&mut y, 1, cols), (&mut mean, &mut rstd));
                let dx_view = RowsMut::packed(&mut dx, 1, cols);
                backward_input(isa, row(&x), &gamma, (&mean, &rstd), row(&dy), dx_view, Write::Set);
                let found = [inner(&dx, &gamma), inner(&dx, &y)];
                assert_near("dx along 1 and along the normalised row", &found, &[0.0; 2], Tolerance::Close);
            }
        }
    }
}
