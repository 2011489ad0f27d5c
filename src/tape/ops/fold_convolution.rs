//! Two-dimensional convolution of a sequence folded at a period that is found while running (TimesNet).
//!   y = image(x) ∗ W + b, laid out as a sequence again: position n is row ⌊n/p⌋, column n mod p, zeros outside the image
//! x [m, in], periods [k, 2] (of which one is read; no gradient), W [K², in, out], b [out], y [rows, out]. The image has ⌈length/p⌉
//! full rows: x counts as zero beyond its end, y is zero beyond the image. The backward pass reads x, periods and W.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::fold::{self, Fold};
use phyture_kernels::{Real, Rows, RowsMut};

/// Operands x, periods, W, b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoldConvolution {
    /// Which of the periods.
    pub index: usize,
    /// Length of the sequence that is folded.
    pub length: usize,
    /// Rows of y.
    pub rows: usize,
}

/// Side of the kernel, channels in and out.
fn sizes(weight: &Shape) -> Option<(usize, usize, usize)> {
    let [taps, inputs, outputs] = weight.lengths() else { return None };
    let kernel = taps.isqrt();
    (kernel * kernel == *taps && kernel % 2 == 1).then_some((kernel, *inputs, *outputs))
}

impl FoldConvolution {
    fn fold<T: Real>(&self, periods: &[T], weight: &Shape) -> Fold {
        let period = periods.get(2 * self.index).map_or(1.0, |period| period.f64());
        let kernel = sizes(weight).map_or(1, |(kernel, _, _)| kernel);
        // A diverged network has periods that are not numbers; any one will do then.
        Fold { period: (period as usize).clamp(1, self.length), length: self.length, kernel }
    }
}

impl<T: Real> Op<T> for FoldConvolution {
    fn name(&self) -> &'static str {
        "fold_convolution"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "x [m, in], periods [k, 2], weight [K², in, out] with odd K, bias [out]";
        let [x, periods, weight, bias] = exactly("fold_convolution", operands, EXPECTED)?;
        match (x.lengths(), periods.lengths(), sizes(&weight)) {
            ([_, channels], [count, 2], Some((_, inputs, outputs)))
                if *channels == inputs && self.index < *count && bias.lengths() == [outputs] && self.length > 1 =>
            {
                Shape::new("fold_convolution", &[self.rows, outputs])
            }
            _ => Err(misfit("fold_convolution", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let Some((kernel, inputs, outputs)) = operands.get(2).and_then(sizes) else { return Memory::default() };
        let scratch = fold::scratch_len(self.length, kernel, inputs, outputs);
        Memory { forward_scratch: scratch, backward_scratch: scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [x, _, weight, _] = io.shapes else { return };
        let (fold, outputs) = (self.fold(io.x[1], weight), weight.rows().1);
        let y = RowsMut::packed(io.y, self.rows, outputs);
        fold::forward(io.isa, fold, rows(io.x[0], x), io.x[2], io.x[3], y, io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for FoldConvolution {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1, 2])
    }

    fn reaches(&self, operand: usize) -> bool {
        operand != 1
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [x, _, weight, _] = io.shapes else { return };
        let fold = self.fold(io.x[1], weight);
        let dy = Rows::packed(io.dy, self.rows, weight.rows().1);
        let [dx, _, dweight, dbias, ..] = io.dx;
        if let Some(dx) = dx {
            fold::backward_input(io.isa, fold, dy, io.x[2], rows_mut(dx.values, x), dx.write, io.scratch);
        }
        if let Some(dweight) = dweight {
            fold::backward_weight(io.isa, fold, rows(io.x[0], x), dy, dweight.values, dweight.write, io.scratch);
        }
        if let Some(dbias) = dbias {
            fold::backward_bias(io.isa, fold, dy, dbias.values, dbias.write);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The check's periods are 0.2 to 1.2 of either sign, so that all are 1: one column. Longer ones are checked in the kernel and
    // in the whole network.
    const OP: FoldConvolution = FoldConvolution { index: 1, length: 6, rows: 7 };

    gradcheck!(fold_convolution: OP, [[6, 2], [2, 2], [9, 2, 3], [3]], [[7, 1], [3, 2], [25, 1, 1], [1]]);
}
