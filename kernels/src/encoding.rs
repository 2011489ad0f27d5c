//! Sinusoidal position encoding (paper eqs. 19–20).
//!
//! ```text
//! PE(p, 2i) = sin(p·10000^(−2i/d)),  PE(p, 2i+1) = cos(p·10000^(−2i/d)),   p = 0 … H − 1
//! ```
//!
//! A table `[H, d]`, made once; computed in f64 and rounded.

use crate::{Real, RowsMut};

/// Base of the geometric row of wavelengths (Vaswani et al. 2017).
const BASE: f64 = 10_000.0;

/// Writes the table for H = rows and d = columns.
pub fn sinusoidal<T: Real>(mut table: RowsMut<'_, T>) {
    let width = table.cols() as f64;
    for p in 0..table.rows() {
        for (c, value) in table.row_mut(p).iter_mut().enumerate() {
            let angle = p as f64 * Real::powf(BASE, -((c - c % 2) as f64) / width);
            *value = T::of(if c % 2 == 0 { Real::sin(angle) } else { Real::cos(angle) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;
    use crate::tolerance::Tolerance;

    #[test]
    fn sine_and_cosine_of_a_pair_share_their_angle() {
        let (rows, width) = (100, 64);
        let mut table = vec![0.0_f64; rows * width];
        sinusoidal(RowsMut::packed(&mut table, rows, width));
        for (p, row) in table.chunks(width).enumerate() {
            for pair in row.chunks(2) {
                assert_near("sin² + cos²", &[pair[0] * pair[0] + pair[1] * pair[1]], &[1.0], Tolerance::Close);
            }
            let p = p as f64;
            assert_near("first and last pair", &[row[0], row[1]], &[p.sin(), p.cos()], Tolerance::Close);
            let slowest = p / 10_000_f64.powf(62.0 / 64.0);
            assert_near("last pair", &row[62..], &[slowest.sin(), slowest.cos()], Tolerance::Close);
        }
    }

    #[test]
    fn an_odd_width_ends_with_a_sine() {
        let mut table = [0.0_f32; 6];
        sinusoidal(RowsMut::packed(&mut table, 2, 3));
        assert_near("width 3", &table[2..3], &[0.0], Tolerance::Exact);
        assert_near("width 3", &table[5..], &[10_000_f32.powf(-2.0 / 3.0).sin()], Tolerance::Close);
    }
}
