//! The small functions that an exported file calls, as text: what remembers, as `memory` computes it, and what C has no operator for, as
//! `operation` does. `@` stands for the prefix of all names, `R` makes a number of the file's type, `F` names a function of `math.h` for it.

/// A function of the file, which statements call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Helper {
    Least,
    Greatest,
    Sign,
    WholePower,
    Lag,
    VaryingLag,
    Delay,
    Rate,
    Slew,
}

impl Helper {
    /// Its definition. One may call those that come before it.
    pub(crate) const fn definition(self) -> &'static str {
        match self {
            Self::Least => LEAST,
            Self::Greatest => GREATEST,
            Self::Sign => SIGN,
            Self::WholePower => WHOLE_POWER,
            Self::Lag => LAG,
            Self::VaryingLag => VARYING_LAG,
            Self::Delay => DELAY,
            Self::Rate => RATE,
            Self::Slew => SLEW,
        }
    }
}

const LEAST: &str = "\
static @_real @_least(@_real x, @_real y)
{
    return x <= y || isnan(y) ? x : y;
}
";

const GREATEST: &str = "\
static @_real @_greatest(@_real x, @_real y)
{
    return x >= y || isnan(y) ? x : y;
}
";

const SIGN: &str = "\
static @_real @_sign(@_real x)
{
    return x == R(0.0) || isnan(x) ? x : F(copysign)(R(1.0), x);
}
";

const WHOLE_POWER: &str = "\
static @_real @_whole_power(@_real x, int exponent)
{
    unsigned left = (unsigned)(exponent < 0 ? -exponent : exponent);
    @_real power = R(1.0);
    for (;;) {
        if (left & 1u) {
            power *= x;
        }
        left >>= 1;
        if (left == 0u) {
            return exponent < 0 ? R(1.0) / power : power;
        }
        x *= x;
    }
}
";

const LAG: &str = "\
/* tau y' = x - y for an x that is straight between samples; past: x and y of the last sample. */
static @_real @_lag(@_real past[2], int first, @_real x, @_real approach, @_real ramp)
{
    const @_real x_before = first ? x : past[0];
    const @_real y_before = first ? x : past[1];
    past[0] = x;
    past[1] = y_before + approach * (x_before - y_before) + ramp * (x - x_before);
    return past[1];
}
";

const VARYING_LAG: &str = "\
/* The same where the time constant differs from sample to sample. */
static @_real @_varying_lag(@_real past[2], int first, @_real x, @_real tau_s, @_real step_s)
{
    const @_real approach = tau_s <= R(0.0) ? R(1.0) : -F(expm1)(-step_s / tau_s);
    const @_real ramp = tau_s <= R(0.0) ? R(1.0) : R(1.0) - approach * tau_s / step_s;
    return @_lag(past, first, x, approach, ramp);
}
";

const DELAY: &str = "\
/* x some samples ago and a part of the way to the one before; past: a ring of the samples since then. */
static @_real @_delay(@_real *past, unsigned long length, unsigned long *newest, int first, @_real x, @_real part)
{
    @_real x_then, x_before;
    if (first) {
        unsigned long place;
        for (place = 0; place < length; place++) {
            past[place] = x;
        }
        *newest = 0;
    }
    *newest = (*newest + 1) % length;
    past[*newest] = x;
    x_then = past[(*newest + 2) % length];
    x_before = past[(*newest + 1) % length];
    return part == R(0.0) ? x_then : x_then + part * (x_before - x_then);
}
";

const RATE: &str = "\
/* Change over the last step, per second. */
static @_real @_rate(@_real *past, int first, @_real x, @_real step_s)
{
    const @_real before = first ? x : *past;
    *past = x;
    return (x - before) / step_s;
}
";

const SLEW: &str = "\
/* Follows x by at most so much a step. */
static @_real @_slew(@_real *past, int *known, int first, @_real x, @_real limit)
{
    const @_real before = first || !*known ? x : *past;
    const @_real change = x - before;
    const @_real y = F(fabs)(change) > limit ? before + F(copysign)(limit, change) : x;
    *past = y;
    *known = isfinite(y);
    return y;
}
";
