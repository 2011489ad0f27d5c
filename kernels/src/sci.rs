//! The exchange of an SCI block (paper eqs. 25–28): scale by an exponential, then add or subtract.
//!
//! ```text
//! scaling:  y = x∘eˢ;     dx = dy∘eˢ,  ds = dy∘x∘eˢ
//! update:   y = a ± b;    da = dy,  db = ±dy
//! ```
//!
//! All `[n, C]`, any strides. The update is [`crate::strided::add`] and [`crate::strided::subtract`]; its gradients are copies.

use crate::elementary::exp;
use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::strided::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// y = x∘eˢ.
pub fn scale<T: Real>(isa: InstructionSet, x: Rows<'_, T>, s: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &s);
    same_shape(&x, &y.view());
    T::sci_scale(isa, Scale { x, s, y });
}

/// dx {=, +=} dy∘eˢ and ds {=, +=} dy∘x∘eˢ.
pub fn scale_backward<T: Real>(
    isa: InstructionSet,
    x: Rows<'_, T>,
    s: Rows<'_, T>,
    dy: Rows<'_, T>,
    (dx, write_x): (RowsMut<'_, T>, Write),
    (ds, write_s): (RowsMut<'_, T>, Write),
) {
    same_shape(&x, &s);
    same_shape(&x, &dy);
    same_shape(&x, &dx.view());
    same_shape(&x, &ds.view());
    T::sci_backward(isa, Backward { x, s, dy, dx, write_x, ds, write_s });
}

pub(crate) struct Scale<'a, T> {
    x: Rows<'a, T>,
    s: Rows<'a, T>,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Scale<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.x.rows() {
            for ((y, x), s) in self.y.row_mut(i).iter_mut().zip(self.x.row(i)).zip(self.s.row(i)) {
                *y = *x * exp::<T, I>(*s);
            }
        }
    }
}

pub(crate) struct Backward<'a, T> {
    x: Rows<'a, T>,
    s: Rows<'a, T>,
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
    write_x: Write,
    ds: RowsMut<'a, T>,
    write_s: Write,
}

impl<T: Real> Kernel for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.x.rows() {
            let inputs = self.x.row(i).iter().zip(self.s.row(i)).zip(self.dy.row(i));
            let outputs = self.dx.row_mut(i).iter_mut().zip(self.ds.row_mut(i));
            // What was there counts with 1 or not at all; a select, because 0·NaN would be NaN.
            let (keep_x, keep_s) = (self.write_x == Write::Add, self.write_s == Write::Add);
            for (((x, s), dy), (dx, ds)) in inputs.zip(outputs) {
                let g = *dy * exp::<T, I>(*s);
                *dx = g + if keep_x { *dx } else { T::ZERO };
                *ds = g * *x + if keep_s { *ds } else { T::ZERO };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near, check_writes};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(shape: (usize, usize), seed: u64) {
        let [x, s, dy] = [0, 1, 2].map(|k| Matrix::<T>::random(seed + k, shape));
        let of = |m: &Matrix<T>, i: usize, j: usize| m.view().row(i)[j].f64();
        let y_expected = Matrix::filled(shape, 0, 0, |i, j| T::of(of(&x, i, j) * of(&s, i, j).exp()));
        let dx_expected = Matrix::filled(shape, 0, 0, |i, j| T::of(of(&dy, i, j) * of(&s, i, j).exp()));
        let ds_expected = Matrix::filled(shape, 0, 0, |i, j| T::of(of(&dy, i, j) * of(&x, i, j) * of(&s, i, j).exp()));
        for isa in InstructionSet::available() {
            let mut y = Matrix::<T>::poisoned(seed, shape);
            scale(isa, x.view(), s.view(), y.view_mut());
            y.check_gaps();
            assert_near("y", &y.to_vec(), &y_expected.to_vec(), Tolerance::Close);
            for other in crate::testing::WRITES {
                check_writes("dx", &dx_expected, Tolerance::Close, |dx, write| {
                    let mut ds = Matrix::<T>::random(seed, shape);
                    scale_backward(isa, x.view(), s.view(), dy.view(), (dx, write), (ds.view_mut(), other));
                });
                check_writes("ds", &ds_expected, Tolerance::Close, |ds, write| {
                    let mut dx = Matrix::<T>::random(seed, shape);
                    scale_backward(isa, x.view(), s.view(), dy.view(), (dx.view_mut(), other), (ds, write));
                });
            }
        }
    }

    proptest! {
        #[test]
        fn equals_its_definition(rows in 0_usize..20, cols in 0_usize..200, seed in 0_u64..1000) {
            check::<f32>((rows, cols), seed);
            check::<f64>((rows, cols), seed);
        }
    }
}
