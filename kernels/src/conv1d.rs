//! One-dimensional convolution of a channels-last sequence, stride 1, ends padded by repeating the first and the last row.
//!
//!   z[t, o] = b[o] + Σ_{c,j} W[o, c, j]·x[clamp(t + j − left, 0, n − 1), c],   t = 0 … n + left + right − taps
//!   y = dropout(f(z))
//!
//! (cross-correlation, as PyTorch's Conv1d after a replication pad). x [n, in], y [n′, out]. Only y is kept: for the leaky relu
//! its sign tells the branch, and a dropped element is told from a kept zero by the zero's sign (dropped +0, kept −0), so the
//! backward pass of the epilogue needs neither z nor a mask.

use crate::activation::Activation;
use crate::dropout::Mask;
use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write, linear};

/// How the weight lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightLayout {
    /// [out, in, taps], as PyTorch stores it.
    OutInTap,
    /// [taps, in, out]: the matrix [taps·in, out] of the product; no transposition on the way in or out.
    TapInOut,
}

/// Kernel length, padding and weight layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Kernel length.
    pub taps: usize,
    /// Times the first row is repeated in front.
    pub left: usize,
    /// Times the last row is repeated behind.
    pub right: usize,
    /// How the weight and its gradient lie in memory.
    pub layout: WeightLayout,
}

impl Geometry {
    /// Rows of y for `rows` rows of x; 0 if the kernel is longer than the padded sequence, or there is nothing to repeat.
    pub const fn output_rows(self, rows: usize) -> usize {
        if rows == 0 { 0 } else { (rows + self.left + self.right + 1).saturating_sub(self.taps) }
    }

    /// Place of W[o, c, j] in the weight slice.
    #[inline(always)]
    pub const fn index(self, inputs: usize, outputs: usize, o: usize, c: usize, j: usize) -> usize {
        match self.layout {
            WeightLayout::OutInTap => (o * inputs + c) * self.taps + j,
            WeightLayout::TapInOut => (j * inputs + c) * outputs + o,
        }
    }
}

/// What follows the convolution in the same pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epilogue {
    /// f; not gelu, whose derivative needs z.
    pub activation: Activation,
    /// Dropout of f(z); element (t, o) of the mask.
    pub dropout: Option<Mask>,
}

impl Epilogue {
    /// y = z.
    pub const NONE: Self = Self { activation: Activation::Identity, dropout: None };
}

/// Scratch, in numbers, that any function of this file needs for n = `rows`.
pub fn scratch_len(geometry: Geometry, rows: usize, inputs: usize, outputs: usize) -> usize {
    (rows * inputs).max(geometry.taps * inputs * outputs)
}

/// y = dropout(f(conv(x) + b)).
pub fn forward<T: Real>(
    level: Level,
    geometry: Geometry,
    x: Rows<'_, T>,
    weight: &[T],
    bias: Option<&[T]>,
    epilogue: Epilogue,
    mut y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let _ = (level, scratch);
    crate::reference::conv1d(geometry, x, weight, bias, y.reborrow());
    let keep = |t: usize, o: usize| epilogue.dropout.is_none_or(|mask| mask.keeps(t, o));
    let scale = epilogue.dropout.map_or(1.0, Mask::scale);
    for t in 0..y.rows() {
        for (o, y) in y.row_mut(t).iter_mut().enumerate() {
            let value = crate::reference::activation(epilogue.activation, y.f64()) * scale;
            *y = match (keep(t, o), matches!(epilogue.activation, Activation::LeakyRelu { .. }) && value <= 0.0) {
                (false, _) => T::ZERO,
                (true, false) => T::of(value),
                (true, true) => -T::of(value).abs(),
            };
        }
    }
}

/// dz = dy∘f′(z)∘mask/(1 − p) [n′, out], from the y that [`forward`] gave.
pub fn backward_epilogue<T: Real>(level: Level, epilogue: Epilogue, y: Rows<'_, T>, dy: Rows<'_, T>, mut dz: RowsMut<'_, T>) {
    let _ = level;
    let scale = epilogue.dropout.map_or(1.0, Mask::scale);
    for t in 0..y.rows() {
        for (o, dz) in dz.row_mut(t).iter_mut().enumerate() {
            let kept = epilogue.dropout.is_none_or(|mask| mask.keeps(t, o));
            let y = y.row(t)[o].f64() / scale;
            let slope = match epilogue.activation {
                Activation::Tanh => 1.0 - y * y,
                Activation::Sigmoid => y * (1.0 - y),
                // Of the others the derivative at y is that at x.
                other => crate::reference::activation_derivative(other, y),
            };
            *dz = if kept { T::of(dy.row(t)[o].f64() * slope * scale) } else { T::ZERO };
        }
    }
}

/// dx {=, +=} the adjoint of the convolution and of its padding, applied to dz.
pub fn backward_input<T: Real>(
    level: Level,
    geometry: Geometry,
    dz: Rows<'_, T>,
    weight: &[T],
    dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    let (rows, cols) = (dx.rows(), dx.cols());
    crate::reference::conv1d_backward_input(geometry, dz, weight, RowsMut::packed(scratch, rows, cols));
    crate::rows::copy(level, Rows::packed(scratch, rows, cols), dx, write);
}

/// dW {=, +=} Σ_t dz[t, o]·x[clamp(t + j − left), c], in the layout of the geometry.
pub fn backward_weight<T: Real>(
    level: Level,
    geometry: Geometry,
    x: Rows<'_, T>,
    dz: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    let len = dweight.len();
    crate::reference::conv1d_backward_weight(geometry, x, dz, scratch);
    crate::rows::copy(level, Rows::packed(scratch, 1, len), RowsMut::packed(dweight, 1, len), write);
}

/// db {=, +=} Σ_t dz.
pub fn backward_bias<T: Real>(level: Level, dz: Rows<'_, T>, dbias: &mut [T], write: Write) {
    linear::backward_bias(level, dz, dbias, write);
}
