//! The two float types the kernels are written for, as one trait.

use core::fmt::{Debug, Display};
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::compiled::Compiled;
use crate::elementary::Elementary;
use crate::maths;
use crate::registers::Registers;

/// f32 or f64: one generic source, two instantiations.
#[rustfmt::skip]
pub trait Real:
    Copy + Default + Debug + Display + PartialOrd + Send + Sync + 'static + Sum
    + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
    + AddAssign + SubAssign + MulAssign + DivAssign + Elementary + Compiled + Registers
{
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;
    /// −∞
    const NEG_INFINITY: Self;
    /// Not a number; used to poison buffers in tests.
    const NAN: Self;
    /// Nearest value to an f64.
    fn of(value: f64) -> Self;
    /// Exact widening to f64.
    fn f64(self) -> f64;
    /// eˣ
    fn exp(self) -> Self;
    /// ln x
    fn ln(self) -> Self;
    /// tanh x
    fn tanh(self) -> Self;
    /// sin x
    fn sin(self) -> Self;
    /// cos x
    fn cos(self) -> Self;
    /// √x
    fn sqrt(self) -> Self;
    /// x to a power
    fn powf(self, exponent: Self) -> Self;
    /// The smallest whole number that is not below x.
    fn ceil(self) -> Self;
    /// The nearest whole number, from the middle between two away from 0.
    fn round(self) -> Self;
    /// |x|
    fn abs(self) -> Self;
    /// self·a + b, rounded once
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Sign bit set: negative, or −0.
    fn is_sign_negative(self) -> bool;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
}

macro_rules! real {
    ($t:ident, $maths:ident) => {
        impl Real for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const NEG_INFINITY: Self = $t::NEG_INFINITY;
            const NAN: Self = $t::NAN;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $t
            }
            #[inline(always)]
            fn f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                maths::$maths::exp(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                maths::$maths::ln(self)
            }
            #[inline(always)]
            fn tanh(self) -> Self {
                maths::$maths::tanh(self)
            }
            #[inline(always)]
            fn sin(self) -> Self {
                maths::$maths::sin(self)
            }
            #[inline(always)]
            fn cos(self) -> Self {
                maths::$maths::cos(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                maths::$maths::sqrt(self)
            }
            #[inline(always)]
            fn powf(self, exponent: Self) -> Self {
                maths::$maths::powf(self, exponent)
            }
            #[inline(always)]
            fn ceil(self) -> Self {
                maths::$maths::ceil(self)
            }
            #[inline(always)]
            fn round(self) -> Self {
                maths::$maths::round(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $t::abs(self)
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                maths::$maths::mul_add(self, a, b)
            }
            #[inline(always)]
            fn is_sign_negative(self) -> bool {
                $t::is_sign_negative(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $t::is_finite(self)
            }
        }
    };
}

real!(f32, single);
real!(f64, double);
