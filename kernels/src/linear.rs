//! Linear map of every row: y = x·Wᵀ + b, with W `[out, in]` as PyTorch keeps it.
//!
//! ```text
//! dx = dy·W,  dW = dyᵀ·x,  db = Σ_rows dy
//! ```
//!
//! x `[n, in]`, y `[n, out]`. The backward pass reads x and W.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Rows, RowsMut, Write, gemm};

/// Scratch, in numbers, that any function of this file needs for n = `rows`.
pub fn scratch_len(rows: usize, inputs: usize, outputs: usize) -> usize {
    gemm::scratch_len(rows, inputs, outputs)
        .max(gemm::scratch_len(rows, outputs, inputs))
        .max(gemm::scratch_len(outputs, rows, inputs))
}

/// y = x·Wᵀ + b.
pub fn forward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    weight: &[T],
    bias: Option<&[T]>,
    y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let weight = Rows::packed(weight, y.cols(), x.cols());
    gemm::abt_bias(isa, x, weight, bias, y, Write::Set, scratch);
}

/// dx {=, +=} dy·W.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    dy: Rows<'_, T>,
    weight: &[T],
    dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    gemm::ab(isa, dy, Rows::packed(weight, dy.cols(), dx.cols()), dx, write, scratch);
}

/// dW {=, +=} dyᵀ·x, `[out, in]`.
pub fn backward_weight<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    dy: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    gemm::atb(isa, dy, x, RowsMut::packed(dweight, dy.cols(), x.cols()), write, scratch);
}

/// db {=, +=} Σ_rows dy, `[out]`.
pub fn backward_bias<T: Real>(isa: InstructionSet, dy: Rows<'_, T>, dbias: &mut [T], write: Write) {
    assert_eq!(dy.cols(), dbias.len(), "bias gradient");
    T::linear_sum_rows(isa, SumRows { x: dy, total: dbias, write });
}

pub(crate) struct SumRows<'a, T> {
    x: Rows<'a, T>,
    total: &'a mut [T],
    write: Write,
}

impl<T: Real> Kernel for SumRows<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        if self.write == Write::Set {
            self.total.fill(T::ZERO);
        }
        for i in 0..self.x.rows() {
            self.total.iter_mut().zip(self.x.row(i)).for_each(|(total, x)| *total += *x);
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

    fn check<T: Real>(rows: usize, inputs: usize, outputs: usize, seed: u64) {
        let (x, dy) = (Matrix::<T>::random(seed, (rows, inputs)), Matrix::<T>::random(seed + 1, (rows, outputs)));
        let (weight, bias) = (numbers::<T>(seed + 2, outputs * inputs), numbers::<T>(seed + 3, outputs));
        let weight_rows = Rows::packed(&weight, outputs, inputs);
        let mut product = Matrix::<T>::poisoned(seed, (rows, outputs));
        reference::gemm_abt(x.view(), weight_rows, product.view_mut());
        let y_expected = Matrix::filled((rows, outputs), 0, 0, |i, o| product.view().row(i)[o] + bias[o]);
        let mut dx = Matrix::<T>::poisoned(seed, (rows, inputs));
        reference::gemm_ab(dy.view(), weight_rows, dx.view_mut());
        let mut dw = Matrix::<T>::poisoned(0, (1, weight.len()));
        reference::gemm_atb(dy.view(), x.view(), RowsMut::packed(dw.view_mut().row_mut(0), outputs, inputs));
        let ones = Matrix::<T>::filled((rows, 1), 0, 0, |_, _| T::ONE);
        let mut db = Matrix::<T>::poisoned(0, (1, outputs));
        reference::gemm_atb(ones.view(), dy.view(), db.view_mut());
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(rows, inputs, outputs)];
            let mut y = Matrix::<T>::poisoned(seed, (rows, outputs));
            forward(isa, x.view(), &weight, Some(&bias), y.view_mut(), &mut scratch);
            assert_near("y", &y.to_vec(), &y_expected.to_vec(), Tolerance::Close);
            forward(isa, x.view(), &weight, None, y.view_mut(), &mut scratch);
            assert_near("y without bias", &y.to_vec(), &product.to_vec(), Tolerance::Close);
            y.check_gaps();
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
        fn equals_the_matrix_product(rows in 0_usize..100, inputs in 1_usize..70, outputs in 1_usize..70, seed in 0_u64..1000) {
            check::<f32>(rows, inputs, outputs, seed);
            check::<f64>(rows, inputs, outputs, seed);
        }
    }
}
