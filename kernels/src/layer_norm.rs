//! Layer normalisation over the last axis.
//!
//!   y = γ·x̂ + β,  x̂ = (x − μ)·r,  r = (σ² + ε)^−½            (μ, σ² of each row; σ² with divisor C)
//!   dx = r·(g − mean(g) − x̂·mean(g·x̂)),  g = γ·dy;   dγ = Σ dy·x̂;   dβ = Σ dy
//!
//! x, y [n, C]; γ, β [C]; kept for the backward pass: μ, r [n].

use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write};

/// y, and `mean` and `rstd` [n] for the backward pass.
pub fn forward<T: Real>(
    level: Level,
    x: Rows<'_, T>,
    gamma: &[T],
    beta: &[T],
    epsilon: f64,
    y: RowsMut<'_, T>,
    mean: &mut [T],
    rstd: &mut [T],
) {
    let _ = level;
    crate::reference::layer_norm(x, gamma, beta, epsilon, y, mean, rstd);
}

/// dx {=, +=} from dy and what the forward pass kept.
pub fn backward_input<T: Real>(
    level: Level,
    x: Rows<'_, T>,
    gamma: &[T],
    mean: &[T],
    rstd: &[T],
    dy: Rows<'_, T>,
    mut dx: RowsMut<'_, T>,
    write: Write,
) {
    let _ = level;
    let n = T::of(x.cols() as f64);
    for i in 0..x.rows() {
        let normal = |c: usize| (x.row(i)[c] - mean[i]) * rstd[i];
        let g = |c: usize| gamma[c] * dy.row(i)[c];
        let mean_g = (0..x.cols()).map(g).sum::<T>() / n;
        let mean_g_normal = (0..x.cols()).map(|c| g(c) * normal(c)).sum::<T>() / n;
        for (c, dx) in dx.row_mut(i).iter_mut().enumerate() {
            let value = rstd[i] * (g(c) - mean_g - normal(c) * mean_g_normal);
            match write {
                Write::Set => *dx = value,
                Write::Add => *dx += value,
            }
        }
    }
}

/// dγ, dβ {=, +=} from dy and what the forward pass kept.
pub fn backward_parameters<T: Real>(
    level: Level,
    x: Rows<'_, T>,
    mean: &[T],
    rstd: &[T],
    dy: Rows<'_, T>,
    dgamma: &mut [T],
    dbeta: &mut [T],
    write: Write,
) {
    let _ = level;
    if write == Write::Set {
        dgamma.fill(T::ZERO);
        dbeta.fill(T::ZERO);
    }
    for i in 0..x.rows() {
        for c in 0..x.cols() {
            dgamma[c] += dy.row(i)[c] * (x.row(i)[c] - mean[i]) * rstd[i];
            dbeta[c] += dy.row(i)[c];
        }
    }
}
