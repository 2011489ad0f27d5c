//! eˣ, tanh and erf in polynomials, so that loops over them vectorise; one source for f32 and f64.
//!
//! | function | how | largest error found, f32 / f64 |
//! | --- | --- | --- |
//! | eˣ | x = k·ln 2 + r with |r| ≤ ln 2/2 (Cody & Waite 1980), eʳ = 1 + r + r²·q(r), scaled by 2ᵏ | 1.1 / 2 ULP |
//! | 2ˣ, over registers (vector.rs) | x = k + r with |r| ≤ ½, 2ʳ = 1 + r·q(r), scaled by 2ᵏ; x not above the largest exponent | 1.2 / 1.0 ULP |
//! | tanh x | x + x³·q(x²) below 5/8, else 1 − 2e⁻²ˣ/(1 + e⁻²ˣ) | 1.4 / 2 ULP |
//! | 1/(1 + e⁻ˣ) | as written | 2.3 / 4 ULP |
//! | erf x | x + x·q(x²) below 1, else 1 − e^(−x²)·q(2/(2 + x)), as for 6 beyond 6 | 1.3 / 8 ULP |
//!
//! The polynomials q interpolate their functions at Chebyshev nodes of the range given (computed with 60 digits). Infinities
//! give the limits, NaN gives NaN, eˣ goes through the subnormal numbers to 0.
//!
//! Not here: the functions over matrices (activation.rs, sci.rs).

use crate::Real;
use crate::instruction_set::{InstructionSet, Isa, Kernel};

/// Constants and the bits of one float type.
pub trait Elementary: Sized + 'static {
    /// (eʳ − 1 − r)/r² on |r| ≤ ln 2/2, by powers of r.
    const EXP: &'static [Self];
    /// (2ʳ − 1)/r on |r| ≤ ½, by powers of r.
    const POWER: &'static [Self];
    /// (tanh √u − √u)/√u³ on 0 ≤ u ≤ 0.4, by powers of u.
    const TANH: &'static [Self];
    /// erf √u/√u − 1 on 0 ≤ u ≤ 1, by powers of u.
    const ERF: &'static [Self];
    /// e^(z²)·(1 − erf z) as a function of t = 2/(2 + z), 1 ≤ z ≤ 6, by powers of t.
    const ERFCX: &'static [Self];
    /// ln 2 in two parts; the first has so few bits that k·part is exact.
    const LN_2: [Self; 2];
    /// log₂ e
    const LOG2_E: Self;
    /// Below this eˣ rounds to 0; above the second it is infinite.
    const EXP_RANGE: [Self; 2];
    /// Adding this leaves the nearest integer in the low bits of the mantissa.
    const ROUNDER: Self;
    /// self·2ᵏ, where `rounded` = k + [`Self::ROUNDER`]; in two steps, so that k may leave the range of exponents.
    fn times_power_of_two(self, rounded: Self) -> Self;
    /// The same where self·2ᵏ is neither subnormal nor infinite: one addition of integers.
    fn times_normal_power_of_two(self, rounded: Self) -> Self;
    /// Below this eˣ is subnormal, or 0.
    const EXP_SUBNORMAL: Self;
    /// The exponent of the square of the distance from 1 to the next number. What is smaller beside 1 is kept out of products: it cannot
    /// show in a sum, but a few factors later it is subnormal, and some processors compute a hundred times slower with those.
    const LEAST_POWER: Self;
    /// 2 to [`Self::LEAST_POWER`].
    const LEAST: Self;
}

#[expect(clippy::excessive_precision, reason = "decimal digits enough for the exact binary value")]
impl Elementary for f32 {
    const EXP: &'static [Self] = &[0.5, 0.166665768, 0.0416665544, 0.00836320297, 0.00139262135];
    const POWER: &'static [Self] = &[0.693147188, 0.240226508, 0.0555035711, 0.00961808256, 0.00133908634, 0.000154531629];
    const TANH: &'static [Self] = &[-0.333333284, 0.133327188, -0.0538432632, 0.0209613291, -0.0060451651];
    const ERF: &'static [Self] =
        &[0.128379166, -0.376126267, 0.112835947, -0.026854212, 0.00518908742, -0.000801686429, 7.87587506e-5];
    const ERFCX: &'static [Self] =
        &[-9.56533318e-5, 0.284014921, 0.265512955, 0.327061703, -0.0598443775, 0.50851586, -0.433586576, 0.108398193];
    const LN_2: [Self; 2] = [0.693_359_375, -2.121_944_4e-4];
    const LOG2_E: Self = core::f32::consts::LOG2_E;
    const EXP_RANGE: [Self; 2] = [-104.0, 89.0];
    const ROUNDER: Self = 12_582_912.0;
    const EXP_SUBNORMAL: Self = -87.0;
    const LEAST_POWER: Self = -46.0;
    const LEAST: Self = Self::EPSILON * Self::EPSILON;
    #[inline(always)]
    fn times_normal_power_of_two(self, rounded: Self) -> Self {
        // The low bits of the rounder are 0: what is shifted out of `rounded` is the rounder, what remains is k.
        Self::from_bits(self.to_bits().wrapping_add(rounded.to_bits() << 23))
    }
    #[inline(always)]
    fn times_power_of_two(self, rounded: Self) -> Self {
        let k = (rounded.to_bits() as i32).wrapping_sub(Self::ROUNDER.to_bits() as i32);
        let half = k >> 1;
        let power = |k: i32| Self::from_bits((k.wrapping_add(127) as u32) << 23);
        self * power(half) * power(k.wrapping_sub(half))
    }
}

#[expect(clippy::excessive_precision, reason = "decimal digits enough for the exact binary value")]
impl Elementary for f64 {
    const EXP: &'static [Self] = &[
        0.5000000000000001,
        0.16666666666666667,
        0.041666666666623992,
        0.0083333333333300513,
        0.0013888888917281793,
        0.00019841269863105969,
        2.4801521190217728e-5,
        2.7557268378684193e-6,
        2.7620138719733996e-7,
        2.5100424157005067e-8,
    ];
    const POWER: &'static [Self] = &[
        core::f64::consts::LN_2,
        0.24022650695910071,
        0.055504108664821627,
        0.0096181291076284795,
        0.0013333558146406471,
        0.00015403530393370733,
        1.5252733841556773e-5,
        1.3215486808705563e-6,
        1.0178057087733941e-7,
        7.0548973041554993e-9,
        4.4558179083360645e-10,
        2.5729324177362304e-11,
    ];
    const TANH: &'static [Self] = &[
        -0.33333333333333333,
        0.13333333333332962,
        -0.05396825396781054,
        0.021869488515352347,
        -0.008863235024306106,
        0.003592120760870841,
        -0.0014557676940659455,
        0.00058962214868720599,
        -0.00023746756598223251,
        9.232749708085371e-5,
        -3.092912547386467e-5,
        6.3543408148597192e-6,
    ];
    const ERF: &'static [Self] = &[
        0.12837916709551257,
        -0.37612638903183748,
        0.11283791670954879,
        -0.026866170645076793,
        0.0052239776248180145,
        -0.00085483269808337899,
        0.00012055331111642711,
        -1.4925595266831182e-5,
        1.6461000484121368e-6,
        -1.6350312701054695e-7,
        1.4659775274047436e-8,
        -1.1372848856791674e-9,
        5.9571761477489114e-11,
    ];
    const ERFCX: &'static [Self] = &[
        1.2965841302986556e-7,
        0.2820897599291754,
        0.28218525546082206,
        0.24583414322512833,
        0.18387516618731221,
        0.042165810841716533,
        0.16640235642296914,
        -0.58838049845297753,
        1.2007988921739575,
        -2.2161112958308113,
        2.8689114876168768,
        -2.3603463108671057,
        1.171209502392138,
        -0.29910874031127391,
        0.013174502501744025,
        0.007301134995856917,
    ];
    const LN_2: [Self; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
    const LOG2_E: Self = core::f64::consts::LOG2_E;
    const EXP_RANGE: [Self; 2] = [-746.0, 710.0];
    const ROUNDER: Self = 6_755_399_441_055_744.0;
    const EXP_SUBNORMAL: Self = -708.0;
    const LEAST_POWER: Self = -104.0;
    const LEAST: Self = Self::EPSILON * Self::EPSILON;
    #[inline(always)]
    fn times_normal_power_of_two(self, rounded: Self) -> Self {
        Self::from_bits(self.to_bits().wrapping_add(rounded.to_bits() << 52))
    }
    #[inline(always)]
    fn times_power_of_two(self, rounded: Self) -> Self {
        // The difference of the bit patterns fits 32 bits, which every level can shift arithmetically.
        let k = rounded.to_bits().wrapping_sub(Self::ROUNDER.to_bits()) as i32;
        let half = k >> 1;
        let power = |k: i32| Self::from_bits((k.wrapping_add(1023) as u32 as u64) << 52);
        self * power(half) * power(k.wrapping_sub(half))
    }
}

/// c₀ + c₁x + c₂x² + … by Horner's rule.
#[inline(always)]
fn polynomial<T: Real, I: Isa>(coefficients: &'static [T], x: T) -> T {
    let Some((highest, lower)) = coefficients.split_last() else { return T::ZERO };
    lower.iter().rev().fold(*highest, |sum, c| I::mul_add(sum, x, *c))
}

/// eˣ
#[inline(always)]
pub(crate) fn exp<T: Real, I: Isa>(x: T) -> T {
    let [low, high] = T::EXP_RANGE;
    let x = if x < low { low } else { x };
    let x = if x > high { high } else { x };
    let rounded = I::mul_add(x, T::LOG2_E, T::ROUNDER);
    let k = rounded - T::ROUNDER;
    let r = I::mul_add(-k, T::LN_2[1], I::mul_add(-k, T::LN_2[0], x));
    let power = I::mul_add(polynomial::<T, I>(T::EXP, r), r * r, r) + T::ONE;
    power.times_power_of_two(rounded)
}

/// eˣ for x ≤ 0, and 0 in the place of subnormal numbers: two thirds of the instructions of [`exp`]. The
/// processor's own NaN gives NaN.
#[inline(always)]
pub(crate) fn exp_negative<T: Real, I: Isa>(x: T) -> T {
    let rounded = I::mul_add(x, T::LOG2_E, T::ROUNDER);
    let k = rounded - T::ROUNDER;
    let r = I::mul_add(-k, T::LN_2[1], I::mul_add(-k, T::LN_2[0], x));
    let power = I::mul_add(polynomial::<T, I>(T::EXP, r), r * r, r) + T::ONE;
    if x < T::EXP_SUBNORMAL { T::ZERO } else { power.times_normal_power_of_two(rounded) }
}

/// x, or 0 for a number of less than [`Elementary::LEAST`].
#[inline(always)]
pub fn or_zero<T: Real>(x: T) -> T {
    if x.abs() < T::LEAST { T::ZERO } else { x }
}

/// tanh x
#[inline(always)]
pub(crate) fn tanh<T: Real, I: Isa>(x: T) -> T {
    let magnitude = x.abs();
    let u = x * x;
    let small = I::mul_add(polynomial::<T, I>(T::TANH, u), u * magnitude, magnitude);
    let e = exp_negative::<T, I>(-(magnitude + magnitude));
    let large = T::ONE - (e + e) / (T::ONE + e);
    let y = if magnitude < T::of(0.625) { small } else { large };
    if x < T::ZERO { -y } else { y }
}

/// 1/(1 + e⁻ˣ)
#[inline(always)]
pub(crate) fn sigmoid<T: Real, I: Isa>(x: T) -> T {
    T::ONE / (T::ONE + exp::<T, I>(-x))
}

/// erf x
#[inline(always)]
pub(crate) fn erf<T: Real, I: Isa>(x: T) -> T {
    let magnitude = x.abs();
    let small = I::mul_add(polynomial::<T, I>(T::ERF, x * x), magnitude, magnitude);
    // From 6 on the rest is far below half a unit in the last place of 1.
    let z = if magnitude > T::of(6.0) { T::of(6.0) } else { magnitude };
    let t = T::of(2.0) / (T::of(2.0) + z);
    let large = T::ONE - exp::<T, I>(-(z * z)) * polynomial::<T, I>(T::ERFCX, t);
    let y = if magnitude < T::ONE { small } else { large };
    if x < T::ZERO { -y } else { y }
}

/// Which function [`apply`] takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// eˣ
    Exp,
    /// tanh x
    Tanh,
    /// 1/(1 + e⁻ˣ)
    Sigmoid,
    /// erf x
    Erf,
}

/// Replaces every number by the function of it.
pub fn apply<T: Real>(isa: InstructionSet, function: Function, values: &mut [T]) {
    T::elementary_apply(isa, Apply { function, values });
}

pub(crate) struct Apply<'a, T> {
    function: Function,
    values: &'a mut [T],
}

impl<T: Real> Kernel for Apply<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        match self.function {
            Function::Exp => {
                for x in self.values.iter_mut() {
                    *x = exp::<T, I>(*x);
                }
            }
            Function::Tanh => {
                for x in self.values.iter_mut() {
                    *x = tanh::<T, I>(*x);
                }
            }
            Function::Sigmoid => {
                for x in self.values.iter_mut() {
                    *x = sigmoid::<T, I>(*x);
                }
            }
            Function::Erf => {
                for x in self.values.iter_mut() {
                    *x = erf::<T, I>(*x);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::Vector;

    /// Distance in units in the last place of the exact value, given in more digits than the type has.
    fn ulps<T: Real>(value: T, exact: f64) -> f64 {
        let exact_rounded = T::of(exact);
        let next = next_up(exact_rounded.abs());
        (value.f64() - exact).abs() / (next.f64() - exact_rounded.abs().f64())
    }

    fn next_up<T: Real>(x: T) -> T {
        if size_of::<T>() == 4 { T::of(f64::from((x.f64() as f32).next_up())) } else { T::of(x.f64().next_up()) }
    }

    /// Largest distance from `exact` over `count` + 1 points of `[low, high]`, in units in the last place, and where.
    fn worst<T: Real>(isa: InstructionSet, function: Function, exact: impl Fn(f64) -> f64, low: f64, high: f64) -> (f64, f64) {
        let count = 400_000;
        let points: Vec<T> = (0..=count).map(|i| T::of(low + (high - low) * f64::from(i) / f64::from(count))).collect();
        let mut values = points.clone();
        apply(isa, function, &mut values);
        points.iter().zip(&values).fold((0.0, 0.0), |worst, (x, y)| {
            let found = ulps(*y, exact(x.f64()));
            assert!(!found.is_nan(), "{function:?}({x}) = {y}");
            if found > worst.0 { (found, x.f64()) } else { worst }
        })
    }

    /// In f64 the reference is rounded too: its own unit is part of the bound.
    fn check<T: Real>(function: Function, exact: impl Fn(f64) -> f64, low: f64, high: f64, bound: f64) {
        for isa in InstructionSet::available() {
            let (found, at) = worst::<T>(isa, function, &exact, low, high);
            println!("{function:?} {} {isa}: {found:.3} ULP at {at}", std::any::type_name::<T>());
            assert!(found <= bound, "{function:?} at level {isa}: {found} ULP at {at}");
        }
    }

    #[test]
    fn exp_stays_within_its_bound() {
        check::<f32>(Function::Exp, f64::exp, -87.0, 88.7, 2.0);
        check::<f32>(Function::Exp, f64::exp, -1.0, 1.0, 2.0);
        check::<f64>(Function::Exp, f64::exp, -708.0, 709.7, 2.0);
        check::<f64>(Function::Exp, f64::exp, -1.0, 1.0, 2.0);
    }

    /// [`exp_negative`] over numbers.
    struct Negative<'a, T>(&'a mut [T]);

    impl<T: Real> Kernel for Negative<'_, T> {
        #[inline(always)]
        fn run<I: Isa>(self) {
            self.0.iter_mut().for_each(|x| *x = exp_negative::<T, I>(*x));
        }
    }

    #[test]
    fn exp_of_negative_numbers_is_exp_without_subnormals() {
        fn check<T: Real>(isa: InstructionSet) {
            let low = T::EXP_SUBNORMAL.f64();
            let points: Vec<T> = (0..=100_000).map(|i| T::of(low * f64::from(i) / 100_000.0)).collect();
            let (mut found, mut expected) = (points.clone(), points);
            isa.run(Negative(&mut found));
            apply(isa, Function::Exp, &mut expected);
            // Both round the same polynomial; the scaling by a power of two is exact.
            assert!(found.iter().zip(&expected).all(|(a, b)| a.f64().to_bits() == b.f64().to_bits()), "level {isa}");
            let mut ends = [T::NEG_INFINITY, T::of(2.0 * low), T::ZERO, T::NAN];
            isa.run(Negative(&mut ends));
            assert_eq!(ends[..3].iter().map(|x| x.f64()).collect::<Vec<_>>(), [0.0, 0.0, 1.0]);
            assert!(ends[3].f64().is_nan(), "NaN is not hidden");
        }
        for isa in InstructionSet::available() {
            check::<f32>(isa);
            check::<f64>(isa);
        }
    }

    /// [`Vector::power_of_two`] over numbers, a multiple of 16.
    struct Power<'a, T>(&'a mut [T]);

    impl<T: Real> Kernel for Power<'_, T> {
        #[inline(always)]
        fn run<I: Isa>(self) {
            for x in self.0.chunks_exact_mut(I::Vector::<T>::LANES) {
                // SAFETY: a chunk is a register.
                unsafe { I::Vector::load(x.as_ptr()).power_of_two().store(x.as_mut_ptr()) };
            }
        }
    }

    #[test]
    fn powers_of_two_stay_within_their_bound() {
        fn check<T: Real>(isa: InstructionSet) -> Vec<u64> {
            let low = T::LEAST_POWER.f64();
            let points: Vec<T> = (1..=400_000).map(|i| T::of(low + (20.0 - low) * f64::from(i) / 400_000.0)).collect();
            let mut found = points.clone();
            isa.run(Power(&mut found));
            let worst = points.iter().zip(&found).map(|(x, y)| ulps(*y, x.f64().exp2())).fold(0.0, f64::max);
            println!("2^x {} {isa}: {worst:.3} ULP", std::any::type_name::<T>());
            assert!(worst <= 1.2, "level {isa}: {worst} ULP");
            let mut ends = [T::NEG_INFINITY, T::of(2.0 * low), T::ZERO, T::NAN].repeat(4);
            isa.run(Power(&mut ends));
            for ends in ends.chunks_exact(4) {
                assert_eq!(ends[..3].iter().map(|x| x.f64()).collect::<Vec<_>>(), [low.exp2(), low.exp2(), 1.0]);
                assert!(ends[3].f64().is_nan(), "NaN is not hidden");
            }
            let kept = [T::LEAST, T::ONE, T::NEG_INFINITY].map(|x| or_zero(x).f64());
            assert_eq!(kept, [low.exp2(), 1.0, f64::NEG_INFINITY]);
            assert!(or_zero(T::LEAST * T::of(-0.5)).f64().to_bits() == 0 && or_zero(T::NAN).f64().is_nan());
            found.iter().map(|x| x.f64().to_bits()).collect()
        }
        let of_levels: Vec<_> =
            InstructionSet::available().into_iter().map(|isa| (isa, check::<f32>(isa), check::<f64>(isa))).collect();
        // Levels that multiply and add in one compute the same in different ways.
        for pair in of_levels.windows(2).filter(|pair| pair[0].0 != InstructionSet::PLAIN) {
            assert!(pair[0].1 == pair[1].1 && pair[0].2 == pair[1].2, "{} and {}", pair[0].0, pair[1].0);
        }
    }

    #[test]
    fn tanh_stays_within_its_bound() {
        check::<f32>(Function::Tanh, f64::tanh, -12.0, 12.0, 2.0);
        check::<f32>(Function::Tanh, f64::tanh, -0.7, 0.7, 2.0);
        check::<f64>(Function::Tanh, f64::tanh, -25.0, 25.0, 2.0);
        check::<f64>(Function::Tanh, f64::tanh, -0.7, 0.7, 2.0);
    }

    #[test]
    fn erf_stays_within_its_bound() {
        check::<f32>(Function::Erf, crate::reference::erf, -8.0, 8.0, 2.0);
        // The series of the reference itself is good to a few units.
        check::<f64>(Function::Erf, crate::reference::erf, -8.0, 8.0, 8.0);
    }

    #[test]
    fn sigmoid_stays_within_its_bound() {
        check::<f32>(Function::Sigmoid, |x| 1.0 / (1.0 + (-x).exp()), -80.0, 80.0, 4.0);
        check::<f64>(Function::Sigmoid, |x| 1.0 / (1.0 + (-x).exp()), -80.0, 80.0, 4.0);
    }

    #[test]
    fn ends_of_the_line() {
        fn ends<T: Real>(isa: InstructionSet, subnormal: f64) {
            let value = |function, x: f64| {
                let mut values = [T::of(x); 17];
                apply(isa, function, &mut values);
                let [first, ..] = values.map(T::f64);
                // The sign and payload of NaN are nobody's promise.
                assert!(values.iter().all(|v| v.f64().to_bits() == first.to_bits() || (v.f64().is_nan() && first.is_nan())));
                first
            };
            assert_eq!(value(Function::Exp, f64::NEG_INFINITY), 0.0);
            assert_eq!(value(Function::Exp, f64::INFINITY), f64::INFINITY);
            assert_eq!(value(Function::Exp, 0.0), 1.0);
            assert!(value(Function::Exp, subnormal) > 0.0 && value(Function::Exp, subnormal) < f64::from(f32::MIN_POSITIVE));
            assert_eq!(value(Function::Tanh, f64::INFINITY), 1.0);
            assert_eq!(value(Function::Tanh, f64::NEG_INFINITY), -1.0);
            assert_eq!(value(Function::Tanh, 0.0), 0.0);
            assert_eq!(value(Function::Erf, f64::NEG_INFINITY), -1.0);
            assert_eq!(value(Function::Sigmoid, f64::INFINITY), 1.0);
            assert_eq!(value(Function::Sigmoid, f64::NEG_INFINITY), 0.0);
            for function in [Function::Exp, Function::Tanh, Function::Sigmoid, Function::Erf] {
                assert!(value(function, f64::NAN).is_nan(), "{function:?}(NaN)");
            }
        }
        for isa in InstructionSet::available() {
            ends::<f32>(isa, -100.0);
            ends::<f64>(isa, -740.0);
        }
    }
}
