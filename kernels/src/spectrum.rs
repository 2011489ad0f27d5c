//! Amplitudes of a sequence at whole numbers of periods, and the strongest of them.
//!
//! ```text
//! X_f[c] = Σ_t x[t, c]·e^(−2πi·f·t/n),   A_f = 1/C·Σ_c |X_f[c]|,   f = 1 … ⌊n/2⌋
//! dx[t, c] = Σ_f dA_f/C·(Re X_f[c]·cos θ − Im X_f[c]·sin θ)/|X_f[c]|,   θ = 2π·f·t/n
//! ```
//!
//! x `[n, C]`. The transform is Stockham's for any n, one pass a prime factor, in natural order without a permutation; a pass of
//! radix r combines r stretches of rows, all channels of a stretch side by side. 1000 = 2³·5³ takes six passes; a prime length is its
//! own definition. The gradient needs the chosen frequencies only.

use alloc::vec::Vec;
use core::cmp::Ordering;

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::{Real, Rows, RowsMut};

/// Frequencies of a sequence of `n` rows: 1 to this; the mean is none.
pub const fn frequencies(n: usize) -> usize {
    n / 2
}

/// Prime factors of a length, and its points on the circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    n: usize,
    factors: Vec<usize>,
    /// (cos, −sin) of 2π·k/n.
    circle: Vec<(f64, f64)>,
}

impl Transform {
    /// For sequences of `n` rows.
    pub fn new(n: usize) -> Self {
        let (mut factors, mut rest, mut divisor) = (Vec::new(), n, 2);
        while rest > 1 {
            if rest.is_multiple_of(divisor) {
                factors.push(divisor);
                rest /= divisor;
            } else {
                divisor += 1;
            }
        }
        let angle = |k: usize| core::f64::consts::TAU * k as f64 / n as f64;
        Self { n, factors, circle: (0..n).map(angle).map(|angle| (Real::cos(angle), -Real::sin(angle))).collect() }
    }

    /// Rows of the sequences it is for.
    pub const fn rows(&self) -> usize {
        self.n
    }

    /// Scratch, in numbers, of [`amplitudes`] for so many channels.
    pub const fn scratch_len(&self, channels: usize) -> usize {
        4 * self.n * channels
    }
}

/// A `[frequencies]`; and X in the front of the scratch: real parts `[n, C]`, then imaginary parts.
///
/// # Panics
/// If shapes disagree.
pub fn amplitudes<T: Real>(isa: InstructionSet, transform: &Transform, x: Rows<'_, T>, amplitudes: &mut [T], scratch: &mut [T]) {
    let (n, channels) = (x.rows(), x.cols());
    assert!(n == transform.n && amplitudes.len() == frequencies(n), "spectrum: number of rows or frequencies");
    T::spectrum_amplitudes(isa, Amplitudes { transform, x, amplitudes, scratch: &mut scratch[..4 * n * channels] });
}

pub(crate) struct Amplitudes<'a, T> {
    transform: &'a Transform,
    x: Rows<'a, T>,
    amplitudes: &'a mut [T],
    scratch: &'a mut [T],
}

impl<T: Real> Kernel for Amplitudes<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        let Transform { n, factors, circle } = self.transform;
        let (n, channels) = (*n, self.x.cols());
        let len = n * channels;
        let (mut from, mut to) = self.scratch.split_at_mut(2 * len);
        // An odd number of passes begins in the back half, so that the last one ends in the front.
        if factors.len() % 2 == 1 {
            core::mem::swap(&mut from, &mut to);
        }
        for t in 0..n {
            from[t * channels..][..channels].copy_from_slice(self.x.row(t));
        }
        from[len..].fill(T::ZERO);
        // Rows side by side that share their coefficients, and rows of one of the transforms still to be done.
        let (mut stretch, mut size) = (1, n);
        for &radix in factors {
            pass::<T, I>(circle, (n, channels), (radix, stretch, size / radix), from, to);
            core::mem::swap(&mut from, &mut to);
            stretch *= radix;
            size /= radix;
        }
        let share = T::of(1.0 / channels.max(1) as f64);
        let (real, imaginary) = from.split_at(len);
        for (f, amplitude) in self.amplitudes.iter_mut().enumerate() {
            let row = (f + 1) * channels..(f + 2) * channels;
            let pairs = real[row.clone()].iter().zip(&imaginary[row]);
            *amplitude = share * pairs.map(|(re, im)| (*re * *re + *im * *im).sqrt()).sum::<T>();
        }
    }
}

/// One pass: to[s·(r·p + k) + q] = Σ_j from[s·(p + m·j) + q]·e^(−2πi·(j·k/r + p·k·s/n)) for radix r, stretch s, p < m, q < s.
#[inline(always)]
fn pass<T: Real, I: Isa>(
    circle: &[(f64, f64)],
    (n, channels): (usize, usize),
    (radix, stretch, count): (usize, usize, usize),
    from: &[T],
    to: &mut [T],
) {
    let (len, each) = (n * channels, stretch * channels);
    let (from_real, from_imaginary) = from.split_at(len);
    let (to_real, to_imaginary) = to.split_at_mut(len);
    for (p, k) in (0..count).flat_map(|p| (0..radix).map(move |k| (p, k))) {
        let (re, im) = (&mut to_real[(radix * p + k) * each..][..each], &mut to_imaginary[(radix * p + k) * each..][..each]);
        re.fill(T::ZERO);
        im.fill(T::ZERO);
        for j in 0..radix {
            let (cosine, sine) = circle[(j * k * (n / radix) + p * k * stretch) % n];
            let (cosine, sine) = (T::of(cosine), T::of(sine));
            let (a, b) = (&from_real[(p + count * j) * each..][..each], &from_imaginary[(p + count * j) * each..][..each]);
            for (((re, im), a), b) in re.iter_mut().zip(&mut *im).zip(a).zip(b) {
                *re = I::mul_add(*a, cosine, I::mul_add(-*b, sine, *re));
                *im = I::mul_add(*a, sine, I::mul_add(*b, cosine, *im));
            }
        }
    }
}

/// dx += dA_f at frequency `f`, from the row X_f (real and imaginary parts, `[C]` each).
///
/// # Panics
/// If shapes disagree.
pub fn backward<T: Real>(
    isa: InstructionSet,
    transform: &Transform,
    f: usize,
    (real, imaginary): (&[T], &[T]),
    damplitude: T,
    dx: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    let channels = dx.cols();
    assert!(dx.rows() == transform.n && real.len() == channels && imaginary.len() == channels, "spectrum: shapes");
    let (unit_real, rest) = scratch.split_at_mut(channels);
    let unit_imaginary = &mut rest[..channels];
    let factor = damplitude * T::of(1.0 / channels as f64);
    for (c, (re, im)) in real.iter().zip(imaginary).enumerate() {
        let size = (*re * *re + *im * *im).sqrt();
        // At 0 the absolute value has no slope; any number between −1 and 1 is as good.
        let over = if size > T::ZERO { factor / size } else { T::ZERO };
        (unit_real[c], unit_imaginary[c]) = (*re * over, *im * over);
    }
    T::spectrum_backward(isa, Backward { circle: &transform.circle, f, real: unit_real, imaginary: unit_imaginary, dx });
}

pub(crate) struct Backward<'a, T> {
    circle: &'a [(f64, f64)],
    f: usize,
    real: &'a [T],
    imaginary: &'a [T],
    dx: RowsMut<'a, T>,
}

impl<T: Real> Kernel for Backward<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let n = self.circle.len();
        for t in 0..n {
            let (cosine, sine) = self.circle[self.f * t % n];
            let (cosine, sine) = (T::of(cosine), T::of(sine));
            for ((dx, re), im) in self.dx.row_mut(t).iter_mut().zip(self.real).zip(self.imaginary) {
                *dx += I::mul_add(*re, cosine, *im * sine);
            }
        }
    }
}

/// The frequencies (from 1) of the largest amplitudes, the largest first; of equal ones the lower first.
pub fn strongest<T: Real>(amplitudes: &[T], count: usize, mut take: impl FnMut(usize, usize)) {
    // Each is the largest of those that come after the one before it.
    let mut before: Option<(usize, T)> = None;
    for place in 0..count {
        let after = |&(f, amplitude): &(usize, T)| {
            before.is_none_or(|(last, largest)| match amplitude.partial_cmp(&largest) {
                Some(Ordering::Less) => true,
                Some(Ordering::Equal) => f > last,
                _ => false,
            })
        };
        let free = amplitudes.iter().enumerate().map(|(f, amplitude)| (f + 1, *amplitude)).filter(after);
        let best = free.reduce(|best, other| if other.1 > best.1 { other } else { best });
        before = best.or(before);
        take(place, best.map_or(1, |(f, _)| f));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(n: usize, channels: usize, seed: u64) {
        let (x, transform) = (Matrix::<T>::random(seed, (n, channels)), Transform::new(n));
        let count = frequencies(n);
        for isa in InstructionSet::available() {
            let (mut found, mut scratch) = (vec![T::NAN; count], vec![T::NAN; transform.scratch_len(channels)]);
            amplitudes(isa, &transform, x.view(), &mut found, &mut scratch);
            let expected: Vec<T> = (1..=count).map(|f| T::of(reference::amplitude(x.view(), f).0)).collect();
            assert_near("amplitudes", &found, &expected, Tolerance::Close);
            let (real, rest) = scratch.split_at(n * channels);
            for f in (1..=count).step_by(7) {
                let row = f * channels..(f + 1) * channels;
                let mut dx = Matrix::<T>::filled((n, channels), 0, 1, |_, _| T::ZERO);
                let mut units = vec![T::NAN; 2 * channels];
                let pair = (&real[row.clone()], &rest[row]);
                backward(isa, &transform, f, pair, T::of(1.5), dx.view_mut(), &mut units);
                let expected: Vec<T> = reference::amplitude(x.view(), f).1.iter().map(|dx| T::of(1.5 * dx)).collect();
                assert_near("gradient", &dx.to_vec(), &expected, Tolerance::Approximate);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn equals_its_sums(n in 2_usize..200, channels in 1_usize..40, seed in 0_u64..1000) {
            check::<f32>(n, channels, seed);
            check::<f64>(n, channels, seed);
        }
    }

    #[test]
    fn sizes_of_the_peer() {
        check::<f32>(1000, 32, 1);
    }

    #[test]
    fn the_strongest_come_in_order_and_equal_ones_by_frequency() {
        let mut chosen = [0; 4];
        strongest(&[1.0, 3.0, 2.0, 3.0, 0.5], 4, |place, f| chosen[place] = f);
        assert_eq!(chosen, [2, 4, 3, 1]);
    }
}
