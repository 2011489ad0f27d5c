//! Linear map over time, shared by all channels (paper eqs. 31–32): y = W·x + b.
//!
//! ```text
//! y[p, c] = b[p] + Σ_t W[p, t]·x[t, c];    dx = Wᵀ·dy,  dW = dy·xᵀ,  db[p] = Σ_c dy[p, c]
//! ```
//!
//! x `[H, C]`, W `[P, H]`, b `[P]`, y `[P, C]`. The backward pass reads x and W.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Rows, RowsMut, Write, gemm, row_reductions};

/// Below this horizon P a product packed for many rows costs more than it saves; the usual P is 1.
const SMALL: usize = 6;

/// Scratch, in numbers, that any function of this file needs.
pub fn scratch_len(history: usize, horizon: usize, channels: usize) -> usize {
    gemm::scratch_len(horizon, history, channels)
        .max(gemm::scratch_len(history, horizon, channels))
        .max(gemm::scratch_len(horizon, channels, history))
}

/// y = W·x + b.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    weight: &[T],
    bias: Option<&[T]>,
    mut y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    assert!(bias.is_none_or(|bias| bias.len() == y.rows()), "temporal: length of the bias");
    assert!(x.cols() == y.cols() && weight.len() == y.rows() * x.rows(), "temporal: shapes do not chain");
    for p in 0..y.rows() {
        y.row_mut(p).fill(bias.map_or(T::ZERO, |bias| bias[p]));
    }
    let weight = Rows::packed(weight, y.rows(), x.rows());
    if y.rows() < SMALL {
        T::temporal_weighted_sum(isa, WeightedSum { x, weight, y });
    } else {
        gemm::ab(isa, weight, x, y, Write::Add, scratch);
    }
}

/// y += W·x, row by row.
pub(crate) struct WeightedSum<'a, T> {
    x: Rows<'a, T>,
    weight: Rows<'a, T>,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for WeightedSum<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for p in 0..self.y.rows() {
            let y = self.y.row_mut(p);
            for (t, weight) in self.weight.row(p).iter().enumerate() {
                for (y, x) in y.iter_mut().zip(self.x.row(t)) {
                    *y = I::mul_add(*weight, *x, *y);
                }
            }
        }
    }
}

/// dx {=, +=} Wᵀ·dy.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    dy: Rows<'_, T>,
    weight: &[T],
    dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    assert!(dx.cols() == dy.cols() && weight.len() == dy.rows() * dx.rows(), "temporal: shapes do not chain");
    gemm::atb(isa, Rows::packed(weight, dy.rows(), dx.rows()), dy, dx, write, scratch);
}

/// dW {=, +=} dy·xᵀ, `[P, H]`.
///
/// # Panics
/// If shapes disagree.
pub fn backward_weight<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    dy: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    assert!(x.cols() == dy.cols() && dweight.len() == dy.rows() * x.rows(), "temporal: shapes do not chain");
    let dweight = RowsMut::packed(dweight, dy.rows(), x.rows());
    if dy.rows() < SMALL {
        T::temporal_row_dots(isa, RowDots { x, dy, dweight, write });
    } else {
        gemm::abt(isa, dy, x, dweight, write, scratch);
    }
}

/// `dW[p, t] {=, +=} <dy[p], x[t]>`.
pub(crate) struct RowDots<'a, T> {
    x: Rows<'a, T>,
    dy: Rows<'a, T>,
    dweight: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for RowDots<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for p in 0..self.dy.rows() {
            for (t, dweight) in self.dweight.row_mut(p).iter_mut().enumerate() {
                let value = row_reductions::dot::<T, I>(self.dy.row(p), self.x.row(t));
                *dweight = value + if self.write == Write::Add { *dweight } else { T::ZERO };
            }
        }
    }
}

/// db {=, +=} `Σ_c dy[p, c]`, `[P]`.
///
/// # Panics
/// If lengths disagree.
pub fn backward_bias<T: Real>(isa: InstructionSet, dy: Rows<'_, T>, dbias: &mut [T], write: Write) {
    assert_eq!(dy.rows(), dbias.len(), "temporal: length of the bias gradient");
    T::temporal_row_sums(isa, RowSums { dy, dbias, write });
}

pub(crate) struct RowSums<'a, T> {
    dy: Rows<'a, T>,
    dbias: &'a mut [T],
    write: Write,
}

impl<T: Real> Kernel for RowSums<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (p, dbias) in self.dbias.iter_mut().enumerate() {
            let value = row_reductions::of::<T, I>(self.dy.row(p), |x| x);
            *dbias = value + if self.write == Write::Add { *dbias } else { T::ZERO };
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(history: usize, horizon: usize, channels: usize, seed: u64) {
        let (x, dy) = (Matrix::<T>::random(seed, (history, channels)), Matrix::<T>::random(seed + 1, (horizon, channels)));
        let (weight, bias) = (numbers::<T>(seed + 2, horizon * history), numbers::<T>(seed + 3, horizon));
        let weight_rows = Rows::packed(&weight, horizon, history);
        let mut y_expected = Matrix::<T>::poisoned(seed, (horizon, channels));
        reference::gemm_ab(weight_rows, x.view(), y_expected.view_mut());
        let y_expected: Vec<T> = y_expected.to_vec().iter().enumerate().map(|(i, y)| *y + bias[i / channels]).collect();
        let mut dx = Matrix::<T>::poisoned(seed, (history, channels));
        reference::gemm_atb(weight_rows, dy.view(), dx.view_mut());
        let mut dw = Matrix::<T>::poisoned(0, (1, horizon * history));
        reference::gemm_abt(dy.view(), x.view(), RowsMut::packed(dw.view_mut().row_mut(0), horizon, history));
        let ones = Matrix::<T>::filled((1, channels), 0, 0, |_, _| T::ONE);
        let mut db = Matrix::<T>::poisoned(0, (1, horizon));
        reference::gemm_abt(ones.view(), dy.view(), db.view_mut());
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(history, horizon, channels)];
            let mut y = Matrix::<T>::poisoned(seed, (horizon, channels));
            forward(isa, x.view(), &weight, Some(&bias), y.view_mut(), &mut scratch);
            assert_near("y", &y.to_vec(), &y_expected, Tolerance::Close);
            check_writes("dx", &dx, Tolerance::Close, |dx, write| backward_input(isa, dy.view(), &weight, dx, write, &mut scratch));
            check_writes("dW", &dw, Tolerance::Close, |mut dw, write| {
                backward_weight(isa, x.view(), dy.view(), dw.row_mut(0), write, &mut scratch);
            });
            check_writes("db", &db, Tolerance::Close, |mut db, write| backward_bias(isa, dy.view(), db.row_mut(0), write));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn equals_the_matrix_product(history in 1_usize..200, horizon in 1_usize..20, channels in 1_usize..80, seed in 0_u64..1000) {
            check::<f32>(history, horizon, channels, seed);
            check::<f64>(history, horizon, channels, seed);
        }
    }
}
