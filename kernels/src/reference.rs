//! Every kernel once more, in the clearest loops that can be written: the oracle of tests and the slow row of benches.
//!
//! No level, no scratch, no blocking, no approximation of elementary functions. Sums run in f64 whatever the element type, so
//! that a comparison measures the kernel's rounding and not this file's. Outputs are overwritten.

use crate::activation::Activation;
use crate::attention::Inputs;
use crate::conv1d::Geometry;
use crate::dropout::Mask;
use crate::{Real, Rows, RowsMut};

fn sum<T: Real>(terms: impl Iterator<Item = f64>) -> T {
    T::of(terms.sum())
}

/// c = a·b; a `[m, k]`, b `[k, n]`.
pub fn gemm_ab<T: Real>(a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>) {
    for i in 0..c.rows() {
        for j in 0..c.cols() {
            c.row_mut(i)[j] = sum((0..a.cols()).map(|p| a.row(i)[p].f64() * b.row(p)[j].f64()));
        }
    }
}

/// c = aᵀ·b; a `[k, m]`, b `[k, n]`.
pub fn gemm_atb<T: Real>(a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>) {
    for i in 0..c.rows() {
        for j in 0..c.cols() {
            c.row_mut(i)[j] = sum((0..a.rows()).map(|p| a.row(p)[i].f64() * b.row(p)[j].f64()));
        }
    }
}

/// c = a·bᵀ; a `[m, k]`, b `[n, k]`.
pub fn gemm_abt<T: Real>(a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>) {
    for i in 0..c.rows() {
        for j in 0..c.cols() {
            c.row_mut(i)[j] = sum((0..a.cols()).map(|p| a.row(i)[p].f64() * b.row(j)[p].f64()));
        }
    }
}

/// Activation of one number.
pub fn activation(kind: Activation, x: f64) -> f64 {
    match kind {
        Activation::Identity => x,
        Activation::Relu => x.max(0.0),
        Activation::LeakyRelu { slope } => {
            if x > 0.0 {
                x
            } else {
                slope * x
            }
        }
        Activation::Tanh => x.tanh(),
        Activation::Sigmoid => 1.0 / (1.0 + (-x).exp()),
        Activation::Elu => {
            if x > 0.0 {
                x
            } else {
                x.exp_m1()
            }
        }
        Activation::Gelu => x * 0.5 * (1.0 + erf(x / std::f64::consts::SQRT_2)),
    }
}

/// Derivative of [`activation`] at one number.
pub fn activation_derivative(kind: Activation, x: f64) -> f64 {
    match kind {
        Activation::Identity => 1.0,
        Activation::Relu => f64::from(x > 0.0),
        Activation::LeakyRelu { slope } => {
            if x > 0.0 {
                1.0
            } else {
                slope
            }
        }
        Activation::Tanh => 1.0 - x.tanh() * x.tanh(),
        Activation::Sigmoid => (1.0 / (1.0 + (-x).exp())) * (1.0 / (1.0 + x.exp())),
        Activation::Elu => x.min(0.0).exp(),
        Activation::Gelu => {
            let density = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
            0.5 * (1.0 + erf(x / std::f64::consts::SQRT_2)) + x * density
        }
    }
}

/// erf x: below 1 the series 2/√π · e^(−x²) · Σₙ 2ⁿ x²ⁿ⁺¹ / (2n+1)!!, all terms of one sign; above, 1 − erfc x by Laplace's
/// continued fraction (Abramowitz & Stegun 7.1.6 and 7.1.14).
pub fn erf(x: f64) -> f64 {
    if x.abs() >= 1.0 {
        const LEVELS: u32 = 200;
        let z = x.abs();
        let fraction = (1..=LEVELS).rev().fold(z, |below, n| z + 0.5 * f64::from(n) / below);
        return (1.0 - (-z * z).exp() / (fraction * std::f64::consts::PI.sqrt())).copysign(x);
    }
    let (mut term, mut total, mut n) = (x, x, 1.0);
    while term.abs() > total.abs() * f64::EPSILON / 16.0 {
        term *= 2.0 * x * x / (2.0 * n + 1.0);
        total += term;
        n += 1.0;
    }
    total * (-x * x).exp() * std::f64::consts::FRAC_2_SQRT_PI
}

/// o = dropout(softmax(q·kᵀ/√d_k))·v a head, every map stored; also the row log-sum-exp `[queries, heads]`.
pub fn attention<T: Real>(
    heads: usize,
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    v: Rows<'_, T>,
    dropout: Option<Mask>,
    mut o: RowsMut<'_, T>,
    log_sum_exp: &mut [T],
) {
    let size = q.cols() / heads;
    for h in 0..heads {
        let (dropped, lse) = probabilities(heads, h, q, k, dropout);
        for i in 0..q.rows() {
            log_sum_exp[i * heads + h] = T::of(lse[i] * std::f64::consts::LOG2_E);
            for c in 0..size {
                o.row_mut(i)[h * size + c] = sum((0..k.rows()).map(|j| dropped[i][j].1 * v.row(j)[h * size + c].f64()));
            }
        }
    }
}

/// (probability, probability after dropout) of every query and key of one head, and the log-sum-exp of each query.
#[allow(clippy::type_complexity)]
fn probabilities<T: Real>(
    heads: usize,
    h: usize,
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    dropout: Option<Mask>,
) -> (Vec<Vec<(f64, f64)>>, Vec<f64>) {
    let size = q.cols() / heads;
    let scale = 1.0 / (size as f64).sqrt();
    let (mut map, mut log_sum_exp) = (Vec::new(), Vec::new());
    for i in 0..q.rows() {
        let score = |j: usize| (0..size).map(|c| q.row(i)[h * size + c].f64() * k.row(j)[h * size + c].f64()).sum::<f64>() * scale;
        let scores: Vec<f64> = (0..k.rows()).map(score).collect();
        let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lse = largest + scores.iter().map(|s| (s - largest).exp()).sum::<f64>().ln();
        let keep = |j: usize| dropout.map_or(1.0, |mask| if mask.keeps(h * q.rows() + i, j) { mask.scale() } else { 0.0 });
        map.push(scores.iter().enumerate().map(|(j, s)| ((s - lse).exp(), (s - lse).exp() * keep(j))).collect());
        log_sum_exp.push(lse);
    }
    (map, log_sum_exp)
}

/// Gradients of [`attention`], from the stored maps.
pub fn attention_backward<T: Real>(inputs: Inputs<'_, T>, d_o: Rows<'_, T>, [mut dq, mut dk, mut dv]: [RowsMut<'_, T>; 3]) {
    let Inputs { heads, q, k, v, dropout } = inputs;
    let size = q.cols() / heads;
    let scale = 1.0 / (size as f64).sqrt();
    for h in 0..heads {
        let (map, _) = probabilities(heads, h, q, k, dropout);
        let at = |m: &Rows<'_, T>, i: usize, c: usize| m.row(i)[h * size + c].f64();
        // dS = P∘(dP − Σ_j P∘dP), where dP holds the dropout factor of each element.
        let mut d_scores = vec![vec![0.0; k.rows()]; q.rows()];
        for (i, d_scores) in d_scores.iter_mut().enumerate() {
            let d_probability = |j: usize| {
                let factor = dropout.map_or(1.0, |mask| if mask.keeps(h * q.rows() + i, j) { mask.scale() } else { 0.0 });
                factor * (0..size).map(|c| at(&d_o, i, c) * at(&v, j, c)).sum::<f64>()
            };
            let mean: f64 = (0..k.rows()).map(|j| map[i][j].0 * d_probability(j)).sum();
            for j in 0..k.rows() {
                d_scores[j] = map[i][j].0 * (d_probability(j) - mean) * scale;
            }
        }
        for c in 0..size {
            for (i, d_scores) in d_scores.iter().enumerate() {
                dq.row_mut(i)[h * size + c] = sum(d_scores.iter().enumerate().map(|(j, ds)| ds * at(&k, j, c)));
            }
            for j in 0..k.rows() {
                dk.row_mut(j)[h * size + c] = sum((0..q.rows()).map(|i| d_scores[i][j] * at(&q, i, c)));
                dv.row_mut(j)[h * size + c] = sum((0..q.rows()).map(|i| map[i][j].1 * at(&d_o, i, c)));
            }
        }
    }
}

/// The row of x that tap j of output row t reads, under replicate padding.
fn tap_row(geometry: Geometry, rows: usize, t: usize, j: usize) -> usize {
    (t + j).saturating_sub(geometry.left).min(rows - 1)
}

/// `y[t, o] = b[o] + Σ_{c,j} W[o,c,j]·x[clamp(t + j − left), c]`; no activation, no dropout.
pub fn conv1d<T: Real>(geometry: Geometry, x: Rows<'_, T>, weight: &[T], bias: Option<&[T]>, mut y: RowsMut<'_, T>) {
    let (inputs, outputs) = (x.cols(), y.cols());
    for t in 0..y.rows() {
        for o in 0..outputs {
            let product = |c: usize, j: usize| {
                weight[(j * inputs + c) * outputs + o].f64() * x.row(tap_row(geometry, x.rows(), t, j))[c].f64()
            };
            let start = bias.map_or(0.0, |b| b[o].f64());
            y.row_mut(t)[o] = T::of(start + (0..inputs).flat_map(|c| (0..geometry.taps).map(move |j| product(c, j))).sum::<f64>());
        }
    }
}

/// Adjoint of [`conv1d`] in x.
pub fn conv1d_backward_input<T: Real>(geometry: Geometry, dz: Rows<'_, T>, weight: &[T], mut dx: RowsMut<'_, T>) {
    let (rows, inputs, outputs) = (dx.rows(), dx.cols(), dz.cols());
    let mut total = vec![0.0; rows * inputs];
    for t in 0..dz.rows() {
        for j in 0..geometry.taps {
            for c in 0..inputs {
                total[tap_row(geometry, rows, t, j) * inputs + c] +=
                    (0..outputs).map(|o| dz.row(t)[o].f64() * weight[(j * inputs + c) * outputs + o].f64()).sum::<f64>();
            }
        }
    }
    for i in 0..rows {
        dx.row_mut(i).iter_mut().zip(&total[i * inputs..]).for_each(|(d, t)| *d = T::of(*t));
    }
}

/// Gradient of [`conv1d`] in the weight.
pub fn conv1d_backward_weight<T: Real>(geometry: Geometry, x: Rows<'_, T>, dz: Rows<'_, T>, dweight: &mut [T]) {
    let (inputs, outputs) = (x.cols(), dz.cols());
    for o in 0..outputs {
        for c in 0..inputs {
            for j in 0..geometry.taps {
                dweight[(j * inputs + c) * outputs + o] =
                    sum((0..dz.rows()).map(|t| dz.row(t)[o].f64() * x.row(tap_row(geometry, x.rows(), t, j))[c].f64()));
            }
        }
    }
}

/// y = γ∘(x − μ)·r + β a row, with μ and r = (σ² + ε)^−½ of each row.
pub fn layer_norm<T: Real>(
    x: Rows<'_, T>,
    gamma: &[T],
    beta: &[T],
    epsilon: f64,
    mut y: RowsMut<'_, T>,
    mean: &mut [T],
    rstd: &mut [T],
) {
    let n = x.cols() as f64;
    for i in 0..x.rows() {
        let m = x.row(i).iter().map(|x| x.f64()).sum::<f64>() / n;
        let variance = x.row(i).iter().map(|x| (x.f64() - m).powi(2)).sum::<f64>() / n;
        let r = 1.0 / (variance + epsilon).sqrt();
        (mean[i], rstd[i]) = (T::of(m), T::of(r));
        for c in 0..x.cols() {
            y.row_mut(i)[c] = T::of(gamma[c].f64() * (x.row(i)[c].f64() - m) * r + beta[c].f64());
        }
    }
}

/// Gradients of [`layer_norm`]; μ and r are computed again.
pub fn layer_norm_backward<T: Real>(
    x: Rows<'_, T>,
    gamma: &[T],
    epsilon: f64,
    dy: Rows<'_, T>,
    mut dx: RowsMut<'_, T>,
    dgamma: &mut [T],
    dbeta: &mut [T],
) {
    let n = x.cols() as f64;
    let (mut total_gamma, mut total_beta) = (vec![0.0; x.cols()], vec![0.0; x.cols()]);
    for i in 0..x.rows() {
        let m = x.row(i).iter().map(|x| x.f64()).sum::<f64>() / n;
        let variance = x.row(i).iter().map(|x| (x.f64() - m).powi(2)).sum::<f64>() / n;
        let r = 1.0 / (variance + epsilon).sqrt();
        let normal: Vec<f64> = x.row(i).iter().map(|x| (x.f64() - m) * r).collect();
        let g: Vec<f64> = dy.row(i).iter().zip(gamma).map(|(d, g)| d.f64() * g.f64()).collect();
        let mean_g = g.iter().sum::<f64>() / n;
        let mean_g_normal = g.iter().zip(&normal).map(|(g, x)| g * x).sum::<f64>() / n;
        for c in 0..x.cols() {
            dx.row_mut(i)[c] = T::of(r * (g[c] - mean_g - normal[c] * mean_g_normal));
            total_gamma[c] += dy.row(i)[c].f64() * normal[c];
            total_beta[c] += dy.row(i)[c].f64();
        }
    }
    for c in 0..x.cols() {
        (dgamma[c], dbeta[c]) = (T::of(total_gamma[c]), T::of(total_beta[c]));
    }
}

/// `y[t]` = mean of `x[clamp(t − (w−1)/2 … t + (w−1)/2)]`.
pub fn moving_average<T: Real>(width: usize, x: Rows<'_, T>, mut y: RowsMut<'_, T>) {
    let half = width / 2;
    for t in 0..x.rows() {
        for c in 0..x.cols() {
            let value = |j: usize| x.row((t + j).saturating_sub(half).min(x.rows() - 1))[c].f64();
            y.row_mut(t)[c] = T::of((0..width).map(value).sum::<f64>() / width as f64);
        }
    }
}

/// Adjoint of [`moving_average`].
pub fn moving_average_backward<T: Real>(width: usize, dy: Rows<'_, T>, mut dx: RowsMut<'_, T>) {
    let (half, rows) = (width / 2, dy.rows());
    for c in 0..dy.cols() {
        let mut total = vec![0.0; rows];
        for t in 0..rows {
            for j in 0..width {
                total[(t + j).saturating_sub(half).min(rows - 1)] += dy.row(t)[c].f64() / width as f64;
            }
        }
        for (t, total) in total.iter().enumerate() {
            dx.row_mut(t)[c] = T::of(*total);
        }
    }
}

/// One step of Adam on one parameter; returns (θ, m, v).
pub fn adam(adam: &crate::adam::Adam, step: u64, parameter: f64, gradient: f64, first: f64, second: f64) -> (f64, f64, f64) {
    let first = adam.beta1 * first + (1.0 - adam.beta1) * gradient;
    let second = adam.beta2 * second + (1.0 - adam.beta2) * gradient * gradient;
    let first_hat = first / (1.0 - adam.beta1.powf(step as f64));
    let second_hat = second / (1.0 - adam.beta2.powf(step as f64));
    (parameter - adam.learning_rate * first_hat / (second_hat.sqrt() + adam.epsilon), first, second)
}
