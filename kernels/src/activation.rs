//! Activation functions, elementwise.
//!
//! | kind | y | dy/dx, from |
//! | --- | --- | --- |
//! | identity | x | 1 |
//! | relu | max(x, 0) | 1 if y > 0 else 0 |
//! | leaky relu | x if x > 0 else slope·x, slope ≥ 0 | 1 if y > 0 else slope |
//! | tanh | tanh x | 1 − y² |
//! | sigmoid | 1/(1 + e⁻ˣ) | y·(1 − y) |
//! | elu | x if x > 0 else eˣ − 1 | 1 if y > 0 else y + 1 |
//! | gelu | x·Φ(x) = x/2·(1 + erf(x/√2)), the exact form | Φ(x) + x·φ(x), from x |
//!
//! All but gelu take their derivative from their own output, so that the input need not be kept.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI};

use crate::elementary::{erf, exp, sigmoid, tanh};
use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
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
    /// x above 0, eˣ − 1 otherwise
    Elu,
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

/// Replaces every number by f of it.
#[inline(always)]
pub(crate) fn map<T: Real, I: Isa>(kind: Activation, values: &mut [T]) {
    let values = values.iter_mut();
    let half = T::of(0.5);
    match kind {
        Activation::Identity => {}
        Activation::Relu => values.for_each(|x| *x = if *x > T::ZERO { *x } else { T::ZERO }),
        Activation::LeakyRelu { slope } => {
            let slope = T::of(slope);
            values.for_each(|x| *x = if *x > T::ZERO { *x } else { slope * *x });
        }
        Activation::Tanh => {
            for x in values {
                *x = tanh::<T, I>(*x);
            }
        }
        Activation::Sigmoid => {
            for x in values {
                *x = sigmoid::<T, I>(*x);
            }
        }
        Activation::Elu => {
            for x in values {
                *x = if *x > T::ZERO { *x } else { exp::<T, I>(*x) - T::ONE };
            }
        }
        Activation::Gelu => {
            for x in values {
                *x = *x * half * (T::ONE + erf::<T, I>(*x * T::of(FRAC_1_SQRT_2)));
            }
        }
    }
}

/// f′ at one number, given x or y as [`Activation::saves`] says.
#[inline(always)]
fn derivative<T: Real, I: Isa>(kind: Activation, saved: T) -> T {
    match kind {
        Activation::Identity => T::ONE,
        Activation::Relu => {
            if saved > T::ZERO {
                T::ONE
            } else {
                T::ZERO
            }
        }
        Activation::LeakyRelu { slope } => {
            if saved > T::ZERO {
                T::ONE
            } else {
                T::of(slope)
            }
        }
        Activation::Tanh => T::ONE - saved * saved,
        Activation::Sigmoid => saved * (T::ONE - saved),
        Activation::Elu => {
            if saved > T::ZERO {
                T::ONE
            } else {
                saved + T::ONE
            }
        }
        Activation::Gelu => {
            let density = T::of(FRAC_1_SQRT_2 * 0.5 * FRAC_2_SQRT_PI) * exp::<T, I>(T::of(-0.5) * saved * saved);
            T::of(0.5) * (T::ONE + erf::<T, I>(saved * T::of(FRAC_1_SQRT_2))) + saved * density
        }
    }
}

/// y = f(x), both `[n, C]`.
pub fn forward<T: Real>(isa: InstructionSet, kind: Activation, x: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &y.view());
    T::activation_forward(isa, Forward { kind, x, y });
}

pub(crate) struct Forward<'a, T> {
    kind: Activation,
    x: Rows<'a, T>,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.x.rows() {
            let y = self.y.row_mut(i);
            y.copy_from_slice(self.x.row(i));
            map::<T, I>(self.kind, y);
        }
    }
}

/// dx {=, +=} dy∘f′, all `[n, C]`; `saved` is x or y as [`Activation::saves`] says.
pub fn backward<T: Real>(
    isa: InstructionSet,
    kind: Activation,
    saved: Rows<'_, T>,
    dy: Rows<'_, T>,
    dx: RowsMut<'_, T>,
    write: Write,
) {
    same_shape(&saved, &dy);
    same_shape(&dy, &dx.view());
    T::activation_backward(isa, Backward { kind, saved, dy, dx, write });
}

pub(crate) struct Backward<'a, T> {
    kind: Activation,
    saved: Rows<'a, T>,
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        // Each arm has a loop of its own in which the kind is a constant: a choice inside the loop would keep it from vectorising.
        match self.kind {
            Activation::Identity => self.each::<I>(Activation::Identity),
            Activation::Relu => self.each::<I>(Activation::Relu),
            Activation::LeakyRelu { slope } => self.each::<I>(Activation::LeakyRelu { slope }),
            Activation::Tanh => self.each::<I>(Activation::Tanh),
            Activation::Sigmoid => self.each::<I>(Activation::Sigmoid),
            Activation::Elu => self.each::<I>(Activation::Elu),
            Activation::Gelu => self.each::<I>(Activation::Gelu),
        }
    }
}

impl<T: Real> Backward<'_, T> {
    #[inline(always)]
    fn each<I: Isa>(mut self, kind: Activation) {
        for i in 0..self.dy.rows() {
            let triples = self.dx.row_mut(i).iter_mut().zip(self.dy.row(i)).zip(self.saved.row(i));
            // Loops, not closures: a closure that is not inlined would be compiled without the level's instructions.
            if self.write == Write::Set {
                for ((dx, dy), saved) in triples {
                    *dx = *dy * derivative::<T, I>(kind, *saved);
                }
            } else {
                for ((dx, dy), saved) in triples {
                    *dx += *dy * derivative::<T, I>(kind, *saved);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, check_writes};
    use crate::tolerance::Tolerance;

    const ALL: [Activation; 7] = [
        Activation::Identity,
        Activation::Relu,
        Activation::LeakyRelu { slope: 0.01 },
        Activation::Tanh,
        Activation::Sigmoid,
        Activation::Elu,
        Activation::Gelu,
    ];

    fn check<T: Real>(kind: Activation, shape: (usize, usize), stretch: f64, seed: u64) {
        let (unit, dy) = (Matrix::<T>::random(seed, shape), Matrix::<T>::random(seed + 1, shape));
        let x = Matrix::<T>::filled(shape, 3, 2, |i, j| unit.view().row(i)[j] * T::of(stretch));
        let y_expected = Matrix::filled(shape, 0, 0, |i, j| T::of(reference::activation(kind, x.view().row(i)[j].f64())));
        let dx_expected = Matrix::filled(shape, 0, 0, |i, j| {
            T::of(reference::activation_derivative(kind, x.view().row(i)[j].f64()) * dy.view().row(i)[j].f64())
        });
        for isa in InstructionSet::available() {
            let mut y = Matrix::<T>::poisoned(seed, shape);
            forward(isa, kind, x.view(), y.view_mut());
            y.check_gaps();
            assert_near(&format!("{kind:?} at {isa}"), &y.to_vec(), &y_expected.to_vec(), Tolerance::Close);
            let saved = if kind.saves() == Saves::Input { x.view() } else { y.view() };
            check_writes(&format!("{kind:?} backward at {isa}"), &dx_expected, Tolerance::Close, |dx, write| {
                backward(isa, kind, saved, dy.view(), dx, write);
            });
        }
    }

    proptest! {
        #[test]
        fn equals_its_definition(rows in 0_usize..10, cols in 0_usize..200, stretch in 0.1_f64..20.0, seed in 0_u64..1000) {
            for kind in ALL {
                check::<f32>(kind, (rows, cols), stretch, seed);
                check::<f64>(kind, (rows, cols), stretch, seed);
            }
        }
    }
}
