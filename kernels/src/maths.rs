//! The functions of floats that `core` does not have: those of the standard library or, without the feature `std`, of the crate `libm`. This file
//! decides which; everything else calls them as methods of [`Real`](crate::Real).

/// Whether a multiply-add becomes the processor's instruction where there is one. That of `libm` is a function of a hundred instructions.
pub(crate) const MUL_ADD_IS_INLINE: bool = cfg!(feature = "std");

/// The functions of one float type, each with its name in `libm`.
macro_rules! functions {
    ($module:ident for $t:ident: $($name:ident($($operand:ident),*) is $libm:ident,)*) => {
        pub(crate) mod $module {
            $(
                #[inline(always)]
                pub(crate) fn $name(x: $t, $($operand: $t),*) -> $t {
                    #[cfg(feature = "std")]
                    return $t::$name(x, $($operand),*);
                    #[cfg(not(feature = "std"))]
                    return libm::$libm(x, $($operand),*);
                }
            )*
        }
    };
}

functions! {
    single for f32:
    ceil() is ceilf,
    cos() is cosf,
    exp() is expf,
    ln() is logf,
    mul_add(a, b) is fmaf,
    powf(exponent) is powf,
    round() is roundf,
    sin() is sinf,
    sqrt() is sqrtf,
    tanh() is tanhf,
}

functions! {
    double for f64:
    ceil() is ceil,
    cos() is cos,
    exp() is exp,
    ln() is log,
    mul_add(a, b) is fma,
    powf(exponent) is pow,
    round() is round,
    sin() is sin,
    sqrt() is sqrt,
    tanh() is tanh,
}

#[cfg(test)]
mod tests {
    use crate::Real;

    /// Tests have the standard library in every configuration, and so `f64`'s own methods as oracle.
    fn check(name: &str, found: fn(f64) -> f64, single: fn(f32) -> f32, expected: fn(f64) -> f64) {
        for k in 1..2000 {
            let x = f64::from(k) / 64.0;
            let near = |found: f64, epsilon: f64| (found - expected(x)).abs() <= 2.0 * epsilon * expected(x).abs().max(epsilon);
            assert!(near(found(x), f64::EPSILON), "{name}({x}) is {}, not {}", found(x), expected(x));
            let rounded = f64::from(single(x as f32));
            assert!(near(rounded, f64::from(f32::EPSILON)) || !expected(x).is_normal(), "{name}({x}) is {rounded} in f32");
        }
    }

    #[test]
    fn each_function_is_the_one_of_its_name() {
        check("ceil", Real::ceil, Real::ceil, f64::ceil);
        check("cos", Real::cos, Real::cos, f64::cos);
        check("exp", |x| Real::exp(-x), |x| Real::exp(-x), |x| (-x).exp());
        check("ln", Real::ln, Real::ln, f64::ln);
        check("mul_add", |x| Real::mul_add(x, x, 1.0), |x| Real::mul_add(x, x, 1.0), |x| x * x + 1.0);
        check("powf", |x| Real::powf(x, 0.3), |x| Real::powf(x, 0.3), |x| x.powf(0.3));
        check("round", Real::round, Real::round, f64::round);
        check("sin", Real::sin, Real::sin, f64::sin);
        check("sqrt", Real::sqrt, Real::sqrt, f64::sqrt);
        check("tanh", Real::tanh, Real::tanh, f64::tanh);
    }
}
