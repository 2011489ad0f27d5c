//! As `reference`, for the kernels of the peer networks: the clearest loops that can be written, with sums in f64.

use crate::conv1d_general::Geometry;
use crate::{Real, Rows, RowsMut};

/// `y[t, o] = b[o] + Σ_{c,j} W[o, c, j]·x[t·stride + j·dilation − left, c]`; no activation, no dropout.
pub fn conv1d<T: Real>(geometry: Geometry, x: Rows<'_, T>, weight: &[T], bias: Option<&[T]>, mut y: RowsMut<'_, T>) {
    for t in 0..y.rows() {
        for o in 0..y.cols() {
            let mut sum = bias.map_or(0.0, |bias| bias[o].f64());
            for (c, j) in (0..x.cols()).flat_map(|c| (0..geometry.taps).map(move |j| (c, j))) {
                if let Some(s) = geometry.source(t, j, x.rows()) {
                    sum += weight[(o * x.cols() + c) * geometry.taps + j].f64() * x.row(s)[c].f64();
                }
            }
            y.row_mut(t)[o] = T::of(sum);
        }
    }
}

/// Gradients of [`conv1d`] in x and in the weight.
pub fn conv1d_backward<T: Real>(
    geometry: Geometry,
    x: Rows<'_, T>,
    weight: &[T],
    dy: Rows<'_, T>,
    mut dx: RowsMut<'_, T>,
    dweight: &mut [T],
) {
    let (mut input, mut total) = (vec![0.0; x.rows() * x.cols()], vec![0.0; weight.len()]);
    for t in 0..dy.rows() {
        for j in 0..geometry.taps {
            let Some(s) = geometry.source(t, j, x.rows()) else { continue };
            for (o, c) in (0..dy.cols()).flat_map(|o| (0..x.cols()).map(move |c| (o, c))) {
                let at = (o * x.cols() + c) * geometry.taps + j;
                input[s * x.cols() + c] += dy.row(t)[o].f64() * weight[at].f64();
                total[at] += dy.row(t)[o].f64() * x.row(s)[c].f64();
            }
        }
    }
    store(&input, &mut dx);
    dweight.iter_mut().zip(&total).for_each(|(d, t)| *d = T::of(*t));
}

fn store<T: Real>(from: &[f64], to: &mut RowsMut<'_, T>) {
    for (i, from) in from.chunks_exact(to.cols().max(1)).enumerate() {
        to.row_mut(i).iter_mut().zip(from).for_each(|(to, from)| *to = T::of(*from));
    }
}

/// What [`lstm`] gives, row by row.
pub struct Lstm {
    /// `[n, h]`.
    pub h: Vec<f64>,
    /// Gradients of the gates before their functions, `[n, 4h]`.
    pub dgates: Vec<f64>,
    /// Gradient of the recurrent weight, `[4h, h]`.
    pub drecurrent: Vec<f64>,
}

/// Long short-term memory and its gradients for dy `[n, h]`, gate by gate.
pub fn lstm<T: Real>(x: Rows<'_, T>, weights: crate::lstm::Weights<'_, T>, dy: Rows<'_, T>) -> Lstm {
    let (n, hidden) = (x.rows(), dy.cols());
    let wide = 4 * hidden;
    let sigma = |x: f64| 1.0 / (1.0 + (-x).exp());
    let (mut gates, mut cells, mut h) = (vec![0.0; n * wide], vec![0.0; n * hidden], vec![0.0; n * hidden]);
    for t in 0..n {
        for o in 0..wide {
            let input: f64 = (0..x.cols()).map(|c| weights.input[o * x.cols() + c].f64() * x.row(t)[c].f64()).sum();
            let before = |k: usize| if t > 0 { h[(t - 1) * hidden + k] } else { 0.0 };
            let recurrent: f64 = (0..hidden).map(|k| weights.recurrent[o * hidden + k].f64() * before(k)).sum();
            let sum = input + recurrent + weights.input_bias[o].f64() + weights.recurrent_bias[o].f64();
            gates[t * wide + o] = if o / hidden == 2 { sum.tanh() } else { sigma(sum) };
        }
        for k in 0..hidden {
            let gate = |which: usize| gates[t * wide + which * hidden + k];
            let before = if t > 0 { cells[(t - 1) * hidden + k] } else { 0.0 };
            cells[t * hidden + k] = gate(1) * before + gate(0) * gate(2);
            h[t * hidden + k] = gate(3) * cells[t * hidden + k].tanh();
        }
    }
    let (mut dgates, mut drecurrent) = (vec![0.0; n * wide], vec![0.0; wide * hidden]);
    let mut dcells = vec![0.0; hidden];
    for t in (0..n).rev() {
        for k in 0..hidden {
            let later = |o: usize| if t + 1 < n { dgates[(t + 1) * wide + o] } else { 0.0 };
            let dh = dy.row(t)[k].f64() + (0..wide).map(|o| later(o) * weights.recurrent[o * hidden + k].f64()).sum::<f64>();
            let gate = |which: usize| gates[t * wide + which * hidden + k];
            let bent = cells[t * hidden + k].tanh();
            let before = if t > 0 { cells[(t - 1) * hidden + k] } else { 0.0 };
            let dc = dcells[k] + dh * gate(3) * (1.0 - bent * bent);
            let slope = |which: usize| gate(which) * (1.0 - gate(which));
            let own =
                [dc * gate(2) * slope(0), dc * before * slope(1), dc * gate(0) * (1.0 - gate(2).powi(2)), dh * bent * slope(3)];
            (0..4).for_each(|which| dgates[t * wide + which * hidden + k] = own[which]);
            dcells[k] = dc * gate(1);
        }
    }
    for t in 1..n {
        for (o, k) in (0..wide).flat_map(|o| (0..hidden).map(move |k| (o, k))) {
            drecurrent[o * hidden + k] += dgates[t * wide + o] * h[(t - 1) * hidden + k];
        }
    }
    Lstm { h, dgates, drecurrent }
}

/// w(o) = g(o)·v(o)/‖v(o)‖ for v `[out, n]`.
pub fn weight_norm<T: Real>(v: Rows<'_, T>, g: &[T], mut w: RowsMut<'_, T>) {
    for (o, g) in g.iter().enumerate() {
        let norm = v.row(o).iter().map(|v| v.f64().powi(2)).sum::<f64>().sqrt();
        w.row_mut(o).iter_mut().zip(v.row(o)).for_each(|(w, v)| *w = T::of(g.f64() * v.f64() / norm));
    }
}

/// Gradients of [`weight_norm`].
pub fn weight_norm_backward<T: Real>(v: Rows<'_, T>, g: &[T], dw: Rows<'_, T>, mut dv: RowsMut<'_, T>, dg: &mut [T]) {
    for o in 0..v.rows() {
        let norm = v.row(o).iter().map(|v| v.f64().powi(2)).sum::<f64>().sqrt();
        let along: f64 = v.row(o).iter().zip(dw.row(o)).map(|(v, dw)| v.f64() * dw.f64()).sum::<f64>() / norm;
        dg[o] = T::of(along);
        for ((dv, v), dw) in dv.row_mut(o).iter_mut().zip(v.row(o)).zip(dw.row(o)) {
            *dv = T::of(g[o].f64() / norm * (dw.f64() - v.f64() / norm * along));
        }
    }
}

/// Rows of x that row t of a pooled sequence looks at.
fn window(geometry: crate::pool::Geometry, t: usize, rows: usize) -> std::ops::Range<usize> {
    let first = t * geometry.stride;
    first.saturating_sub(geometry.padding)..(first + geometry.width).saturating_sub(geometry.padding).min(rows)
}

/// Largest, or mean, of each window, by channel; and its adjoint for dy (of several largest, the first has the gradient).
pub fn pool<T: Real>(geometry: crate::pool::Geometry, largest: bool, x: Rows<'_, T>, dy: Rows<'_, T>) -> (Vec<f64>, Vec<f64>) {
    let (mut y, mut dx) = (vec![0.0; dy.rows() * dy.cols()], vec![0.0; x.rows() * x.cols()]);
    for (t, c) in (0..dy.rows()).flat_map(|t| (0..x.cols()).map(move |c| (t, c))) {
        let rows = window(geometry, t, x.rows());
        let at = |s: usize| x.row(s)[c].f64();
        if largest {
            let best = rows.clone().fold(rows.start, |best, s| if at(s) > at(best) { s } else { best });
            y[t * x.cols() + c] = at(best);
            dx[best * x.cols() + c] += dy.row(t)[c].f64();
        } else {
            y[t * x.cols() + c] = rows.clone().map(at).sum::<f64>() / geometry.width as f64;
            rows.for_each(|s| dx[s * x.cols() + c] += dy.row(t)[c].f64() / geometry.width as f64);
        }
    }
    (y, dx)
}

/// What [`fold`] gives.
pub struct Folded {
    /// Result.
    pub y: Vec<f64>,
    /// Gradient of the sequence.
    pub dx: Vec<f64>,
    /// Gradient of the weight.
    pub dweight: Vec<f64>,
    /// Gradient of the bias.
    pub dbias: Vec<f64>,
}

/// Two-dimensional convolution of the folded sequence and its gradients, all kernel rows and columns, tested one by one.
pub fn fold<T: Real>(fold: crate::fold::Fold, x: Rows<'_, T>, weight: &[T], bias: &[T], dy: Rows<'_, T>) -> Folded {
    let (inputs, outputs, kernel, half) = (x.cols(), dy.cols(), fold.kernel, fold.kernel / 2);
    let mut found = Folded {
        y: vec![0.0; dy.rows() * outputs],
        dx: vec![0.0; x.rows() * inputs],
        dweight: vec![0.0; weight.len()],
        dbias: vec![0.0; outputs],
    };
    for n in 0..fold.positions().min(dy.rows()) {
        let (r, c) = (n / fold.period, n % fold.period);
        for (o, bias) in bias.iter().enumerate() {
            found.y[n * outputs + o] += bias.f64();
            found.dbias[o] += dy.row(n)[o].f64();
        }
        for (a, b) in (0..kernel).flat_map(|a| (0..kernel).map(move |b| (a, b))) {
            let (row, column) = (r + a, c + b);
            if row < half || row - half >= fold.height() || column < half || column - half >= fold.period {
                continue;
            }
            let from = (row - half) * fold.period + column - half;
            if from >= x.rows() {
                continue;
            }
            for (i, o) in (0..inputs).flat_map(|i| (0..outputs).map(move |o| (i, o))) {
                let at = ((a * kernel + b) * inputs + i) * outputs + o;
                found.y[n * outputs + o] += weight[at].f64() * x.row(from)[i].f64();
                found.dx[from * inputs + i] += weight[at].f64() * dy.row(n)[o].f64();
                found.dweight[at] += x.row(from)[i].f64() * dy.row(n)[o].f64();
            }
        }
    }
    found
}

/// Mean over the channels of |X_f|, and its gradient `[n, C]`.
pub fn amplitude<T: Real>(x: Rows<'_, T>, f: usize) -> (f64, Vec<f64>) {
    let (n, channels) = (x.rows(), x.cols());
    let angle = |t: usize| std::f64::consts::TAU * (f * t % n) as f64 / n as f64;
    let (mut sum, mut dx) = (0.0, vec![0.0; n * channels]);
    for c in 0..channels {
        let re: f64 = (0..n).map(|t| x.row(t)[c].f64() * angle(t).cos()).sum();
        let im: f64 = (0..n).map(|t| -x.row(t)[c].f64() * angle(t).sin()).sum();
        let size = re.hypot(im);
        sum += size / channels as f64;
        (0..n).for_each(|t| dx[t * channels + c] = (re * angle(t).cos() - im * angle(t).sin()) / size / channels as f64);
    }
    (sum, dx)
}

/// Sparsity measure of query `i` of head `h`: the largest of the sampled products less their sum over the number of keys.
pub fn sparsity<T: Real>(
    sparse: crate::prob_sparse::Sparse,
    stream: crate::random::Stream,
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    h: usize,
    i: usize,
) -> f64 {
    let (size, keys) = (q.cols() / sparse.heads, k.rows());
    let sample = |s: usize| ((u64::from(stream.sub(i as u64).word(s as u32)) * keys as u64) >> 32) as usize;
    let product = |j: usize| (h * size..(h + 1) * size).map(|c| q.row(i)[c].f64() * k.row(j)[c].f64()).sum::<f64>();
    let products: Vec<f64> = (0..sparse.chosen(keys)).map(|s| product(sample(s))).collect();
    products.iter().copied().fold(f64::NEG_INFINITY, f64::max) - products.iter().sum::<f64>() / keys as f64
}

/// o, dq, dk, dv of ProbSparse attention for the queries `chosen` of each head.
pub fn prob_sparse<T: Real>(
    sparse: crate::prob_sparse::Sparse,
    chosen: &[usize],
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    v: Rows<'_, T>,
    d_o: Rows<'_, T>,
) -> [Vec<f64>; 4] {
    let (queries, keys, d) = (q.rows(), k.rows(), q.cols());
    let (size, count) = (d / sparse.heads, chosen.len() / sparse.heads);
    let scale = 1.0 / (size as f64).sqrt();
    let [mut o, mut dq, mut dk, mut dv] = [queries, queries, keys, keys].map(|rows| vec![0.0; rows * d]);
    for (h, i) in (0..sparse.heads).flat_map(|h| (0..queries).map(move |i| (h, i))) {
        let head = h * size..(h + 1) * size;
        let seen = if sparse.masked { i + 1 } else { keys };
        let is_chosen = chosen[h * count..(h + 1) * count].contains(&i);
        let weights: Vec<f64> = if is_chosen {
            let score = |j: usize| head.clone().map(|c| q.row(i)[c].f64() * k.row(j)[c].f64()).sum::<f64>() * scale;
            let scores: Vec<f64> = (0..seen).map(score).collect();
            let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = scores.iter().map(|score| (score - most).exp()).sum();
            scores.iter().map(|score| (score - most).exp() / sum).collect()
        } else {
            vec![if sparse.masked { 1.0 } else { 1.0 / keys as f64 }; seen]
        };
        let dweight = |j: usize| head.clone().map(|c| d_o.row(i)[c].f64() * v.row(j)[c].f64()).sum::<f64>();
        let mean: f64 = weights.iter().enumerate().map(|(j, weight)| weight * dweight(j)).sum();
        for (j, weight) in weights.iter().enumerate() {
            let dscore = if is_chosen { weight * (dweight(j) - mean) * scale } else { 0.0 };
            for c in head.clone() {
                o[i * d + c] += weight * v.row(j)[c].f64();
                dv[j * d + c] += weight * d_o.row(i)[c].f64();
                dq[i * d + c] += dscore * k.row(j)[c].f64();
                dk[j * d + c] += dscore * q.row(i)[c].f64();
            }
        }
    }
    [o, dq, dk, dv]
}
