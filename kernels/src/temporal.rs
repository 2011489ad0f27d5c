//! Linear map over time, shared by all channels (paper eqs. 31–32): y = W·x + b.
//!
//!   y[p, c] = b[p] + Σ_t W[p, t]·x[t, c];    dx = Wᵀ·dy,  dW = dy·xᵀ,  db[p] = Σ_c dy[p, c]
//!
//! x [H, C], W [P, H], b [P], y [P, C]. The backward pass reads x and W.

use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write, gemm};

/// Scratch, in numbers, that any function of this file needs.
pub fn scratch_len(history: usize, horizon: usize, channels: usize) -> usize {
    gemm::scratch_len(horizon, history, channels)
        .max(gemm::scratch_len(history, horizon, channels))
        .max(gemm::scratch_len(horizon, channels, history))
}

/// y = W·x + b.
pub fn forward<T: Real>(level: Level, x: Rows<'_, T>, weight: &[T], bias: Option<&[T]>, mut y: RowsMut<'_, T>, scratch: &mut [T]) {
    assert!(bias.is_none_or(|bias| bias.len() == y.rows()), "temporal: length of the bias");
    let weight = Rows::packed(weight, y.rows(), x.rows());
    let write = if let Some(bias) = bias {
        for (p, bias) in bias.iter().enumerate() {
            y.row_mut(p).fill(*bias);
        }
        Write::Add
    } else {
        Write::Set
    };
    gemm::ab(level, weight, x, y, write, scratch);
}

/// dx {=, +=} Wᵀ·dy.
pub fn backward_input<T: Real>(level: Level, dy: Rows<'_, T>, weight: &[T], dx: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    gemm::atb(level, Rows::packed(weight, dy.rows(), dx.rows()), dy, dx, write, scratch);
}

/// dW {=, +=} dy·xᵀ, [P, H].
pub fn backward_weight<T: Real>(level: Level, x: Rows<'_, T>, dy: Rows<'_, T>, dweight: &mut [T], write: Write, scratch: &mut [T]) {
    gemm::abt(level, dy, x, RowsMut::packed(dweight, dy.rows(), x.rows()), write, scratch);
}

/// db {=, +=} Σ_c dy[p, c], [P].
pub fn backward_bias<T: Real>(level: Level, dy: Rows<'_, T>, dbias: &mut [T], write: Write) {
    let _ = level;
    for (p, dbias) in dbias.iter_mut().enumerate() {
        let total = dy.row(p).iter().copied().sum::<T>();
        match write {
            Write::Set => *dbias = total,
            Write::Add => *dbias += total,
        }
    }
}
