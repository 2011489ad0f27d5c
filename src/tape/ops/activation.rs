//! Elementwise functions: leaky rectifier, rectifier, tanh, logistic, ELU, GELU. y = f(x), dx = dy∘f′(x).
//!
//! The backward pass reads x or y, whichever the function's derivative is written in.

use super::{rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Op, Reads, exactly};
use phyture_kernels::Real;
use phyture_kernels::activation::{self, Saves};

/// y = f(x), any shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// f.
    pub kind: activation::Activation,
}

impl<T: Real> Op<T> for Activation {
    fn name(&self) -> &'static str {
        "activation"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        exactly::<1>("activation", operands, "one operand").map(|[x]| x)
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, ..] = io.shapes else { return };
        activation::forward(io.isa, self.kind, rows(io.x[0], shape), rows_mut(io.y, shape));
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Activation {
    fn reads(&self) -> Reads {
        match self.kind.saves() {
            Saves::Input => Reads::operands(&[0]),
            Saves::Output => Reads::result(),
        }
    }

    fn backward(&self, io: Backward<'_, T>) {
        let ([shape, ..], [Some(dx), ..]) = (io.shapes, io.dx) else { return };
        let saved = match self.kind.saves() {
            Saves::Input => io.x[0],
            Saves::Output => io.y,
        };
        activation::backward(io.isa, self.kind, rows(saved, shape), rows(io.dy, shape), rows_mut(dx.values, shape), dx.write);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use activation::Activation as Kind;

    gradcheck!(leaky_relu: Activation { kind: Kind::LeakyRelu { slope: 0.01 } }, [[7, 5]], [[1, 1]]);
    gradcheck!(relu: Activation { kind: Kind::Relu }, [[7, 5]]);
    gradcheck!(tanh: Activation { kind: Kind::Tanh }, [[7, 5]], [[9]]);
    gradcheck!(sigmoid: Activation { kind: Kind::Sigmoid }, [[7, 5]]);
    gradcheck!(elu: Activation { kind: Kind::Elu }, [[7, 5]]);
    gradcheck!(gelu: Activation { kind: Kind::Gelu }, [[7, 5]]);
}
