//! What follows the convolution in the same pass, and the gradient of that: y = dropout(f(z)).
//!
//! Only y is kept: for the leaky relu its sign tells the branch, and a dropped element is told from a kept zero by the zero's sign
//! (dropped +0, kept −0), so the backward pass needs neither z nor a mask.

use crate::activation::{self, Activation};
use crate::dropout::Mask;
use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::tile::{self, Sink};
use crate::{Real, Rows, RowsMut, strided};

/// What follows the convolution in the same pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epilogue {
    /// f; not gelu, whose derivative needs z.
    pub activation: Activation,
    /// Dropout of f(z); element (t, o) of the mask.
    pub dropout: Option<Mask>,
}

impl Epilogue {
    /// y = z.
    pub const NONE: Self = Self { activation: Activation::Identity, dropout: None };

    /// What dropout multiplies a kept element with.
    #[inline(always)]
    pub(super) fn scale<T: Real>(self) -> T {
        T::of(self.dropout.map_or(1.0, Mask::scale))
    }
}

/// y = dropout(f(sums + b)), rows `first…`.
pub(super) struct Finish<'a, T> {
    pub first: usize,
    pub y: RowsMut<'a, T>,
    pub bias: Option<&'a [T]>,
    pub epilogue: Epilogue,
    pub scale: T,
}

impl<'a, T: Real> Finish<'a, T> {
    #[inline(always)]
    pub(super) fn new(first: usize, y: RowsMut<'a, T>, bias: Option<&'a [T]>, epilogue: Epilogue) -> Self {
        Self { first, y, bias, epilogue, scale: epilogue.scale() }
    }

    /// y of row `i`, columns `j…`, from z without its bias. By value, so that nothing else can point to these numbers and the steps
    /// become one pass over registers.
    #[inline(always)]
    fn apply<I: Isa, const N: usize>(&self, i: usize, j: usize, mut z: [T; N], bias: Option<&[T; N]>) -> [T; N] {
        if let Some(bias) = bias {
            z.iter_mut().zip(bias).for_each(|(z, b)| *z += *b);
        }
        if let Activation::LeakyRelu { slope } = self.epilogue.activation {
            let slope = T::of(slope);
            z.iter_mut().for_each(|z| *z = if *z > T::ZERO { *z } else { -(slope * z.abs()) });
        } else {
            activation::map::<T, I>(self.epilogue.activation, &mut z);
        }
        if let Some(mask) = self.epilogue.dropout {
            let mask = mask.row(self.first + i);
            z.iter_mut().enumerate().for_each(|(c, z)| *z = if mask.keeps(j + c) { *z * self.scale } else { T::ZERO });
        }
        z
    }
}

impl<T: Real> Sink<T> for Finish<'_, T> {
    #[inline(always)]
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]) {
        let widened = |x: &[T]| {
            let mut wide = [T::ZERO; tile::WIDEST];
            wide[..sums.len()].copy_from_slice(&x[..sums.len()]);
            wide
        };
        let bias = self.bias.map(|bias| widened(&bias[j..]));
        let y = self.apply::<I, { tile::WIDEST }>(i, j, widened(sums), bias.as_ref());
        self.y.row_mut(i)[j..][..sums.len()].copy_from_slice(&y[..sums.len()]);
    }

    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, i: usize, j: usize, sums: tile::Pair<T, I>) {
        let bias = self.bias.and_then(|bias| bias[j..].first_chunk::<NR>());
        let y = self.apply::<I, NR>(i, j, tile::unload::<T, I, NR>(sums), bias);
        if let Some(to) = self.y.row_mut(i)[j..].first_chunk_mut::<NR>() {
            *to = y;
        }
    }
}

/// dz = dy∘f′(z)∘mask/(1 − p) `[n′, out]`, from the y that [`forward`](super::forward) gave.
///
/// # Panics
/// If shapes disagree or the activation is gelu, whose derivative y does not tell.
pub fn backward_epilogue<T: Real>(isa: InstructionSet, epilogue: Epilogue, y: Rows<'_, T>, dy: Rows<'_, T>, dz: RowsMut<'_, T>) {
    strided::same_shape(&y, &dy);
    strided::same_shape(&y, &dz.view());
    assert!(epilogue.activation != Activation::Gelu, "conv1d: the derivative of gelu cannot be told from its output");
    T::conv1d_backward_epilogue(isa, BackwardEpilogue { epilogue, y, dy, dz });
}

pub(crate) struct BackwardEpilogue<'a, T> {
    epilogue: Epilogue,
    y: Rows<'a, T>,
    dy: Rows<'a, T>,
    dz: RowsMut<'a, T>,
}

impl<T: Real> Kernel for BackwardEpilogue<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let scale = self.epilogue.dropout.map_or(1.0, Mask::scale);
        let (scale, unscale) = (T::of(scale), T::of(1.0 / scale));
        for i in 0..self.y.rows() {
            let (dz, y) = (self.dz.row_mut(i), self.y.row(i));
            dz.copy_from_slice(self.dy.row(i));
            let pairs = dz.iter_mut().zip(y);
            match self.epilogue.activation {
                Activation::LeakyRelu { slope } => {
                    let below = scale * T::of(slope);
                    pairs.for_each(|(dz, y)| {
                        let negative = if y.is_sign_negative() { below } else { T::ZERO };
                        *dz *= if *y > T::ZERO { scale } else { negative };
                    });
                    continue;
                }
                Activation::Relu => pairs.for_each(|(dz, y)| *dz = if *y > T::ZERO { *dz * scale } else { T::ZERO }),
                Activation::Tanh => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * (T::ONE - y * y);
                }),
                Activation::Sigmoid => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * y * (T::ONE - y);
                }),
                Activation::Elu => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * if y > T::ZERO { T::ONE } else { y + T::ONE };
                }),
                Activation::Identity | Activation::Gelu => pairs.for_each(|(dz, _)| *dz *= scale),
            }
            if let Some(mask) = self.epilogue.dropout {
                let mask = mask.row(i);
                dz.iter_mut().enumerate().for_each(|(c, dz)| *dz = if mask.keeps(c) { *dz } else { T::ZERO });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::tests::{Problem, problem};
    use super::super::{Geometry, Weight, forward, scratch_len};
    use super::*;
    use crate::random::Stream;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, numbers};
    use crate::tolerance::Tolerance;

    const LEAKY: Activation = Activation::LeakyRelu { slope: 0.01 };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn epilogue_and_its_gradient(p in problem(), which in 0_usize..5, rate in prop_oneof![Just(None), Just(Some(0.2))]) {
            let Problem { geometry, rows, inputs, outputs, seed } = p;
            let after = geometry.output_rows(rows);
            let activation = [Activation::Identity, Activation::Relu, LEAKY, Activation::Tanh, Activation::Sigmoid][which];
            let dropout = rate.map(|rate| Mask::new(Stream::new(seed, 1, 2, 3), rate));
            let epilogue = Epilogue { activation, dropout };
            let x = Matrix::<f64>::random(seed, (rows, inputs));
            let dy = Matrix::<f64>::random(seed + 4, (after, outputs));
            let weight = numbers::<f64>(seed + 1, geometry.taps * inputs * outputs);
            let mut z = Matrix::<f64>::poisoned(seed, (after, outputs));
            reference::conv1d(geometry, x.view(), &weight, None, z.view_mut());
            let factor = |t: usize, o: usize| dropout.map_or(1.0, |mask| if mask.keeps(t, o) { mask.scale() } else { 0.0 });
            let expected = |f: &dyn Fn(f64) -> f64, g: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
                (0..after * outputs).map(|i| (i / outputs, i % outputs)).map(|(t, o)| f(z.view().row(t)[o]) * factor(t, o) * g(t, o)).collect()
            };
            let y_expected = expected(&|z| reference::activation(activation, z), &|_, _| 1.0);
            let dz_expected = expected(&|z| reference::activation_derivative(activation, z), &|t, o| dy.view().row(t)[o]);
            for isa in InstructionSet::available() {
                let mut scratch = vec![f64::NAN; scratch_len(geometry, inputs, outputs)];
                let (mut y, mut dz) = (Matrix::<f64>::poisoned(seed, (after, outputs)), Matrix::<f64>::poisoned(seed, (after, outputs)));
                forward(isa, geometry, x.view(), (Weight::Plain(&weight), None), epilogue, y.view_mut(), &mut scratch);
                assert_near("y", &y.to_vec(), &y_expected, Tolerance::Close);
                backward_epilogue(isa, epilogue, y.view(), dy.view(), dz.view_mut());
                assert_near("dz", &dz.to_vec(), &dz_expected, Tolerance::Close);
            }
        }
    }

    #[test]
    fn a_kept_zero_still_passes_its_gradient() {
        let geometry = Geometry { taps: 1, left: 0, right: 0 };
        let mask = Mask::new(Stream::new(5, 0, 0, 0), 0.5);
        let epilogue = Epilogue { activation: LEAKY, dropout: Some(mask) };
        for isa in InstructionSet::available() {
            let (x, dy) = (vec![1.0_f32; 64], vec![1.0_f32; 64]);
            let (mut y, mut dz, mut scratch) = (vec![f32::NAN; 64], vec![f32::NAN; 64], vec![0.0; scratch_len(geometry, 1, 1)]);
            forward(
                isa,
                geometry,
                Rows::packed(&x, 64, 1),
                (Weight::Plain(&[0.0]), None),
                epilogue,
                RowsMut::packed(&mut y, 64, 1),
                &mut scratch,
            );
            backward_epilogue(isa, epilogue, Rows::packed(&y, 64, 1), Rows::packed(&dy, 64, 1), RowsMut::packed(&mut dz, 64, 1));
            let expected: Vec<f32> = (0..64).map(|t| if mask.keeps(t, 0) { 0.01 * mask.scale() as f32 } else { 0.0 }).collect();
            assert!(y.iter().all(|y| *y == 0.0));
            assert_near("dz of zeros", &dz, &expected, Tolerance::Close);
        }
    }
}
