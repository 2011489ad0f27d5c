//! Sinusoidal position encoding (paper eqs. 19–20).
//!
//!   PE(p, 2i) = sin(p·10000^(−2i/d)),  PE(p, 2i+1) = cos(p·10000^(−2i/d)),   p = 0 … H − 1
//!
//! A table [H, d], made once; computed in f64 and rounded.

use crate::{Real, RowsMut};

/// Base of the geometric row of wavelengths (Vaswani et al. 2017).
const BASE: f64 = 10_000.0;

/// Writes the table for H = rows and d = columns.
pub fn sinusoidal<T: Real>(mut table: RowsMut<'_, T>) {
    let width = table.cols() as f64;
    for p in 0..table.rows() {
        for (c, value) in table.row_mut(p).iter_mut().enumerate() {
            let angle = p as f64 * BASE.powf(-((c - c % 2) as f64) / width);
            *value = T::of(if c % 2 == 0 { angle.sin() } else { angle.cos() });
        }
    }
}
