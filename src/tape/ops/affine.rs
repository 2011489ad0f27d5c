//! Fixed affine map of each channel: y[t, c] = scale[c]·x[t, c] + offset[c];  dx = scale ∘ dy.
//!
//! Not trainable. The networks end with it: their last layer works at unit scale, the loss in physical units (eq. 13).

use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly, misfit};
use phyture_kernels::{Real, Write};

/// Scale and offset of each channel, in the units of y per unit of x, and of y.
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    /// One a channel.
    pub scale: Vec<f64>,
    /// One a channel.
    pub offset: Vec<f64>,
}

impl<T: Real> Op<T> for Affine {
    fn name(&self) -> &'static str {
        "affine"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "one operand with as many channels as there are scales and offsets";
        let [x] = exactly("affine", operands, EXPECTED)?;
        let channels = x.rows().1;
        let fits = self.scale.len() == channels && self.offset.len() == channels;
        if fits { Ok(x) } else { Err(misfit("affine", operands, EXPECTED)) }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let channels = self.scale.len();
        for (y, x) in io.y.chunks_exact_mut(channels).zip(io.x[0].chunks_exact(channels)) {
            for (((y, x), scale), offset) in y.iter_mut().zip(x).zip(&self.scale).zip(&self.offset) {
                *y = T::of(*scale) * *x + T::of(*offset);
            }
        }
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Affine {
    fn reads(&self) -> Reads {
        Reads::NOTHING
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [Some(dx), ..] = io.dx else { return };
        let channels = self.scale.len();
        for (dx_row, dy) in dx.values.chunks_exact_mut(channels).zip(io.dy.chunks_exact(channels)) {
            for ((to, dy), scale) in dx_row.iter_mut().zip(dy).zip(&self.scale) {
                let value = T::of(*scale) * *dy;
                match dx.write {
                    Write::Set => *to = value,
                    Write::Add => *to += value,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Affine {
        Affine { scale: vec![0.5, -2.0, 3.0], offset: vec![1.0, 0.0, -1.0] }
    }

    gradcheck!(affine: three(), [[4, 3]], [[3]]);
}
