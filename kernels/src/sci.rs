//! The exchange of an SCI block (paper eqs. 25–28): scale by an exponential, then add or subtract.
//!
//!   scaling:  y = x∘eˢ;     dx = dy∘eˢ,  ds = dy∘x∘eˢ
//!   update:   y = a ± b;    da = dy,  db = ±dy
//!
//! All [n, C], any strides. The update is [`crate::rows::add`] and [`crate::rows::subtract`]; its gradients are copies.

use crate::elementary::exp;
use crate::level::{Isa, Kernel, Level};
use crate::rows::same_shape;
use crate::{Real, Rows, RowsMut, Write};

/// y = x∘eˢ.
pub fn scale<T: Real>(level: Level, x: Rows<'_, T>, s: Rows<'_, T>, y: RowsMut<'_, T>) {
    same_shape(&x, &s);
    same_shape(&x, &y.view());
    level.run(Scale { x, s, y });
}

/// dx {=, +=} dy∘eˢ and ds {=, +=} dy∘x∘eˢ.
pub fn scale_backward<T: Real>(
    level: Level,
    x: Rows<'_, T>,
    s: Rows<'_, T>,
    dy: Rows<'_, T>,
    dx: RowsMut<'_, T>,
    write_x: Write,
    ds: RowsMut<'_, T>,
    write_s: Write,
) {
    same_shape(&x, &s);
    same_shape(&x, &dy);
    same_shape(&x, &dx.view());
    same_shape(&x, &ds.view());
    level.run(Backward { x, s, dy, dx, write_x, ds, write_s });
}

struct Scale<'a, T> {
    x: Rows<'a, T>,
    s: Rows<'a, T>,
    y: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Scale<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        for i in 0..self.x.rows() {
            for ((y, x), s) in self.y.row_mut(i).iter_mut().zip(self.x.row(i)).zip(self.s.row(i)) {
                *y = *x * exp::<T, I>(*s);
            }
        }
    }
}

struct Backward<'a, T> {
    x: Rows<'a, T>,
    s: Rows<'a, T>,
    dy: Rows<'a, T>,
    dx: RowsMut<'a, T>,
    write_x: Write,
    ds: RowsMut<'a, T>,
    write_s: Write,
}

impl<T: Real> Kernel for Backward<'_, T> {
    type Output = ();
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
