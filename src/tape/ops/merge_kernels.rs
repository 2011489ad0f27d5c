//! Square kernels of sizes 1, 3, 5, … as the one kernel that does what the mean of all does (see `phyture_kernels::inception`).
//!   W = 1/m·Σ_j w_j between zeros;  dw_j = 1/m·(what of dW lies under w_j)
//! w_j [out, in, (2j + 1)²] for j = 0 … m − 1, W [(2m − 1)², in, out]. The backward pass reads nothing.

use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, MAX_OPERANDS, Op, Reads, misfit};
use phyture_kernels::{Real, inception};

/// Operands w_0, w_1, …
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MergeKernels;

/// Channels in and out.
fn channels(operands: &[Shape]) -> (usize, usize) {
    let [outputs, inputs, ..] = operands.first().map(Shape::lengths).unwrap_or_default() else { return (0, 0) };
    (*inputs, *outputs)
}

impl<T: Real> Op<T> for MergeKernels {
    fn name(&self) -> &'static str {
        "merge_kernels"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        let (inputs, outputs) = channels(operands);
        let fits = |(j, kernel): (usize, &Shape)| kernel.lengths() == [outputs, inputs, inception::taps(j + 1)];
        let count = operands.len();
        if (1..=MAX_OPERANDS.min(inception::MOST_KERNELS)).contains(&count) && operands.iter().enumerate().all(fits) {
            return Shape::new("merge_kernels", &[inception::taps(count), inputs, outputs]);
        }
        Err(misfit("merge_kernels", operands, "kernels [out, in, 1], [out, in, 9], [out, in, 25], …"))
    }

    fn forward(&self, io: Forward<'_, T>) {
        let (inputs, outputs) = channels(io.shapes);
        inception::merge(&io.x[..io.shapes.len()], inputs, outputs, io.y);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for MergeKernels {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ((inputs, outputs), count) = (channels(io.shapes), io.shapes.len());
        for (j, dkernel) in io.dx.into_iter().enumerate() {
            if let Some(dkernel) = dkernel {
                inception::split(count, j, io.dy, inputs, outputs, dkernel.values, dkernel.write);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    gradcheck!(merge_kernels: MergeKernels, [[2, 3, 1], [2, 3, 9], [2, 3, 25]], [[1, 1, 1], [1, 1, 9]], [[3, 2, 1]]);
}
