//! A weight as length times direction (Salimans & Kingma 2016), the length of each output channel on its own.
//!
//! ```text
//! w(o) = g(o)·v(o)/‖v(o)‖
//! dg(o) = <dw(o), v(o)>/‖v(o)‖,   dv(o) = g(o)/‖v(o)‖·(dw(o) − v(o)·<dw(o), v(o)>/‖v(o)‖²)
//! ```
//!
//! v, w `[out, n]`, g `[out]`: for a convolution n = in·taps. A direction of length 0 gives what is not a number, as in PyTorch.

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write, row_reductions};

/// w from v and g.
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(isa: InstructionSet, v: Rows<'_, T>, g: &[T], w: RowsMut<'_, T>) {
    same_shape(&v, &w.view());
    assert_eq!(v.rows(), g.len(), "weight norm: number of lengths");
    T::weight_norm_forward(isa, Forward { v, g, w });
}

pub(crate) struct Forward<'a, T> {
    v: Rows<'a, T>,
    g: &'a [T],
    w: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for (o, g) in self.g.iter().enumerate() {
            let v = self.v.row(o);
            let factor = *g / row_reductions::dot::<T, I>(v, v).sqrt();
            self.w.row_mut(o).iter_mut().zip(v).for_each(|(w, v)| *w = factor * *v);
        }
    }
}

/// dv {=, +=}, from v, g and dw.
///
/// # Panics
/// If shapes disagree.
pub fn backward_direction<T: Real>(
    isa: InstructionSet,
    v: Rows<'_, T>,
    g: &[T],
    dw: Rows<'_, T>,
    dv: RowsMut<'_, T>,
    write: Write,
) {
    same_shape(&v, &dw);
    same_shape(&v, &dv.view());
    assert_eq!(v.rows(), g.len(), "weight norm: number of lengths");
    T::weight_norm_direction(isa, Direction { v, g, dw, dv, write });
}

pub(crate) struct Direction<'a, T> {
    v: Rows<'a, T>,
    g: &'a [T],
    dw: Rows<'a, T>,
    dv: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Kernel for Direction<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for (o, g) in self.g.iter().enumerate() {
            let (v, dw) = (self.v.row(o), self.dw.row(o));
            let square = row_reductions::dot::<T, I>(v, v);
            let (factor, along) = (*g / square.sqrt(), row_reductions::dot::<T, I>(v, dw) / square);
            let pairs = self.dv.row_mut(o).iter_mut().zip(v.iter().zip(dw));
            match self.write {
                Write::Set => pairs.for_each(|(dv, (v, dw))| *dv = factor * (*dw - *v * along)),
                Write::Add => pairs.for_each(|(dv, (v, dw))| *dv += factor * (*dw - *v * along)),
            }
        }
    }
}

/// dg {=, +=}, from v and dw.
///
/// # Panics
/// If shapes disagree.
pub fn backward_length<T: Real>(isa: InstructionSet, v: Rows<'_, T>, dw: Rows<'_, T>, dg: &mut [T], write: Write) {
    same_shape(&v, &dw);
    assert_eq!(v.rows(), dg.len(), "weight norm: number of lengths");
    T::weight_norm_length(isa, Length { v, dw, dg, write });
}

pub(crate) struct Length<'a, T> {
    v: Rows<'a, T>,
    dw: Rows<'a, T>,
    dg: &'a mut [T],
    write: Write,
}

impl<T: Real> Kernel for Length<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (o, dg) in self.dg.iter_mut().enumerate() {
            let (v, dw) = (self.v.row(o), self.dw.row(o));
            let value = row_reductions::dot::<T, I>(v, dw) / row_reductions::dot::<T, I>(v, v).sqrt();
            *dg = value + if self.write == Write::Add { *dg } else { T::ZERO };
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(shape: (usize, usize), seed: u64) {
        let (v, dw, g) = (Matrix::<T>::random(seed, shape), Matrix::<T>::random(seed + 1, shape), numbers::<T>(seed + 2, shape.0));
        let [mut w_expected, mut dv] = [(); 2].map(|()| Matrix::<T>::poisoned(seed, shape));
        let mut dg = Matrix::<T>::poisoned(0, (1, shape.0));
        reference::weight_norm(v.view(), &g, w_expected.view_mut());
        reference::weight_norm_backward(v.view(), &g, dw.view(), dv.view_mut(), dg.view_mut().row_mut(0));
        for isa in InstructionSet::available() {
            let mut w = Matrix::<T>::poisoned(seed, shape);
            forward(isa, v.view(), &g, w.view_mut());
            w.check_gaps();
            assert_near("w", &w.to_vec(), &w_expected.to_vec(), Tolerance::Close);
            check_writes("dv", &dv, Tolerance::Close, |dv, write| backward_direction(isa, v.view(), &g, dw.view(), dv, write));
            check_writes("dg", &dg, Tolerance::Close, |mut dg, write| {
                backward_length(isa, v.view(), dw.view(), dg.row_mut(0), write);
            });
        }
    }

    proptest! {
        #[test]
        fn equals_its_definition(outputs in 0_usize..40, n in 2_usize..200, seed in 0_u64..1000) {
            check::<f32>((outputs, n), seed);
            check::<f64>((outputs, n), seed);
        }
    }
}
