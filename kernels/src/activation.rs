//! Activation functions, elementwise.
//!
//! | kind | y | dy/dx, from |
//! | --- | --- | --- |
//! | identity | x | 1 |
//! | relu | max(x, 0) | 1 if y > 0 else 0 |
//! | leaky relu | x if x > 0 else slope·x, slope ≥ 0 | 1 if y > 0 else slope |
//! | tanh | tanh x | 1 − y² |
//! | sigmoid | 1/(1 + e⁻ˣ) | y·(1 − y) |
//! | gelu | x·Φ(x) = x/2·(1 + erf(x/√2)), the exact form | Φ(x) + x·φ(x), from x |
//!
//! All but gelu take their derivative from their own output, so that the input need not be kept.

use crate::level::{Isa, Kernel, Level};
use crate::rows::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// Which function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Activation {
    /// x
    Identity,
    /// max(x, 0)
    Relu,
    /// x above 0, slope·x otherwise
    LeakyRelu {
        /// Slope below 0; not negative.
        slope: f64,
    },
    /// tanh x
    Tanh,
    /// 1/(1 + e⁻ˣ)
    Sigmoid,
    /// x·Φ(x), erf form
    Gelu,
}

/// What the backward pass of an activation reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saves {
    /// The input x.
    Input,
    /// The output y.
    Output,
}

impl Activation {
    /// What [`backward`] has to be given as `saved`.
    pub const fn saves(self) -> Saves {
        match self {
            Self::Gelu => Saves::Input,
            _ => Saves::Output,
        }
    }
}

/// y = f(x), both [n, C].
pub fn forward<T: Real>(level: Level, kind: Activation, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &y.view());
    let _ = level;
    let mut y = y;
    for i in 0..x.rows() {
        for (y, x) in y.row_mut(i).iter_mut().zip(x.row(i)) {
            *y = T::of(crate::reference::activation(kind, x.f64()));
        }
    }
}

/// dx {=, +=} dy∘f′, all [n, C]; `saved` is x or y as [`Activation::saves`] says.
pub fn backward<T: Real>(level: Level, kind: Activation, saved: Rows<'_, T>, dy: Rows<'_, T>, dx: RowsMut<'_, T>, write: Write) {
    same_shape(&saved, &dy);
    same_shape(&dy, &dx.view());
    level.run(Backward { kind, saved, dy, dx, write });
}

struct Backward<'a, T> {
    kind: Activation,
    saved: Rows<'a, T>,
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Backward<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.dy.rows() {
            for ((dx, dy), saved) in self.dx.row_mut(i).iter_mut().zip(self.dy.row(i)).zip(self.saved.row(i)) {
                let y = *saved;
                let slope = match self.kind {
                    Activation::Identity => T::ONE,
                    Activation::Relu => {
                        if y > T::ZERO {
                            T::ONE
                        } else {
                            T::ZERO
                        }
                    }
                    Activation::LeakyRelu { slope } => {
                        if y > T::ZERO {
                            T::ONE
                        } else {
                            T::of(slope)
                        }
                    }
                    Activation::Tanh => T::ONE - y * y,
                    Activation::Sigmoid => y * (T::ONE - y),
                    Activation::Gelu => T::of(crate::reference::activation_derivative(self.kind, y.f64())),
                };
                match self.write {
                    Write::Set => *dx = *dy * slope,
                    Write::Add => *dx += *dy * slope,
                }
            }
        }
    }
}
