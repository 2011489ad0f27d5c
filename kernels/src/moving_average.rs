//! Centred moving average over time, ends padded by repeating the first and the last row (paper eq. 29).
//!
//!   y[t] = 1/w · Σ_{|j| ≤ (w−1)/2} x[clamp(t + j, 0, n − 1)],   w odd
//!
//! x, y [n, C]. The backward pass is the exact adjoint, the padding's share folded into the two end rows.

use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write};

/// Scratch, in numbers, that both functions need for C = `channels`.
pub const fn scratch_len(rows: usize, channels: usize) -> usize {
    rows * channels
}

/// y = moving average of x.
///
/// # Panics
/// If `width` is even or 0, or the shapes differ.
pub fn forward<T: Real>(level: Level, width: usize, x: Rows<'_, T>, y: RowsMut<'_, T>, scratch: &mut [T]) {
    assert!(width % 2 == 1, "a centred moving average has an odd width, not {width}");
    let _ = (level, scratch);
    crate::reference::moving_average(width, x, y);
}

/// dx {=, +=} adjoint of the moving average of dy.
///
/// # Panics
/// As [`forward`].
pub fn backward<T: Real>(level: Level, width: usize, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(width % 2 == 1, "a centred moving average has an odd width, not {width}");
    crate::reference::moving_average_backward(width, dy, RowsMut::packed(scratch, dy.rows(), dy.cols()));
    crate::rows::copy(level, Rows::packed(scratch, dy.rows(), dy.cols()), dx, write);
}
