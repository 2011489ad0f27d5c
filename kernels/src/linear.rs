//! Linear map of every row: y = x·Wᵀ + b, with W [out, in] as PyTorch keeps it.
//!
//!   dx = dy·W,  dW = dyᵀ·x,  db = Σ_rows dy
//!
//! x [n, in], y [n, out]. The backward pass reads x and W.

use crate::level::{Isa, Kernel, Level};
use crate::{Real, Rows, RowsMut, Write, gemm};

/// Scratch, in numbers, that any function of this file needs for n = `rows`.
pub fn scratch_len(rows: usize, inputs: usize, outputs: usize) -> usize {
    gemm::scratch_len(rows, inputs, outputs)
        .max(gemm::scratch_len(rows, outputs, inputs))
        .max(gemm::scratch_len(outputs, rows, inputs))
}

/// y = x·Wᵀ + b.
pub fn forward<T: Real>(level: Level, x: Rows<'_, T>, weight: &[T], bias: Option<&[T]>, y: RowsMut<'_, T>, scratch: &mut [T]) {
    let weight = Rows::packed(weight, y.cols(), x.cols());
    gemm::abt_bias(level, x, weight, bias, y, Write::Set, scratch);
}

/// dx {=, +=} dy·W.
pub fn backward_input<T: Real>(level: Level, dy: Rows<'_, T>, weight: &[T], dx: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    gemm::ab(level, dy, Rows::packed(weight, dy.cols(), dx.cols()), dx, write, scratch);
}

/// dW {=, +=} dyᵀ·x, [out, in].
pub fn backward_weight<T: Real>(level: Level, x: Rows<'_, T>, dy: Rows<'_, T>, dweight: &mut [T], write: Write, scratch: &mut [T]) {
    gemm::atb(level, dy, x, RowsMut::packed(dweight, dy.cols(), x.cols()), write, scratch);
}

/// db {=, +=} Σ_rows dy, [out].
pub fn backward_bias<T: Real>(level: Level, dy: Rows<'_, T>, dbias: &mut [T], write: Write) {
    assert_eq!(dy.cols(), dbias.len(), "bias gradient");
    level.run(SumRows { x: dy, total: dbias, write });
}

struct SumRows<'a, T> {
    x: Rows<'a, T>,
    total: &'a mut [T],
    write: Write,
}

impl<T: Real> Kernel for SumRows<'_, T> {
    type Output = ();
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
