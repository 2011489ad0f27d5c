//! One register of floats: what the innermost loops of tile.rs are written in.
//!
//! Loops over whole rows vectorise by themselves. A tile of accumulators does not reliably: the compiler splits registers or moves
//! accumulators to memory when code around the loop changes. So the tile names its registers, and so does attention, which is half
//! products and half powers of 2. A few operations are all they need; an instruction set is one short block below. Where there is none,
//! an array does the same arithmetic.
//!
//! Not here: masks and other element-wise arithmetic, which stay plain loops.

use crate::Real;

/// `LANES` numbers that are worked on at once.
pub(crate) trait Vector<T>: Copy {
    /// Numbers in a register.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(x: T) -> Self;

    /// Reads `LANES` numbers.
    ///
    /// # Safety
    /// `from` must be the start of `LANES` readable numbers; no alignment is needed.
    unsafe fn load(from: *const T) -> Self;

    /// Writes `LANES` numbers.
    ///
    /// # Safety
    /// `to` must be the start of `LANES` writable numbers; no alignment is needed.
    unsafe fn store(self, to: *mut T);

    /// self + other
    fn add(self, other: Self) -> Self;

    /// self − other
    fn sub(self, other: Self) -> Self;

    /// self·other
    fn mul(self, other: Self) -> Self;

    /// self·a + b, rounded once where the level can.
    fn mul_add(self, a: Self, b: Self) -> Self;

    /// The larger of x and self in each lane; NaN where self is NaN.
    fn at_least(self, x: T) -> Self;

    /// [`Elementary::times_normal_power_of_two`](crate::elementary::Elementary::times_normal_power_of_two), lane by lane.
    fn times_power_of_two(self, rounded: Self) -> Self;

    /// Lanes whose word is at least `bound`, and 0 in the others.
    ///
    /// # Safety
    /// `words` must be the start of `LANES` readable words.
    unsafe fn where_at_least(self, words: *const i32, bound: i32) -> Self;

    /// 2ˣ, lane by lane, for x below the largest exponent, and nothing smaller than [`Elementary::LEAST`](crate::elementary::Elementary::LEAST),
    /// which is nothing beside 1. NaN gives NaN. The same bits at all levels that multiply and add in one.
    #[inline(always)]
    fn power_of_two(self) -> Self
    where
        T: Real,
    {
        let x = self.at_least(T::LEAST_POWER);
        let rounded = x.add(Self::splat(T::ROUNDER));
        let r = x.sub(rounded.sub(Self::splat(T::ROUNDER)));
        Self::power_of_fraction(r).times_power_of_two(rounded)
    }

    /// 2ʳ for |r| ≤ ½.
    #[inline(always)]
    fn power_of_fraction(r: Self) -> Self
    where
        T: Real,
    {
        let mut sum = Self::splat(T::ZERO);
        for (i, c) in T::POWER.iter().rev().enumerate() {
            sum = if i == 0 { Self::splat(*c) } else { sum.mul_add(r, Self::splat(*c)) };
        }
        sum.mul_add(r, Self::splat(T::ONE))
    }
}

/// An array in the place of a register; `FMA` says whether a multiply-add is one instruction.
#[derive(Clone, Copy)]
#[cfg_attr(all(target_arch = "x86_64", not(test)), expect(dead_code, reason = "every level of this architecture has registers"))]
pub struct Array<T, const N: usize, const FMA: bool>([T; N]);

impl<T: Real, const N: usize, const FMA: bool> Vector<T> for Array<T, N, FMA> {
    const LANES: usize = N;
    #[inline(always)]
    fn splat(x: T) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    unsafe fn load(from: *const T) -> Self {
        // SAFETY: the caller vouches for N readable numbers.
        Self(unsafe { from.cast::<[T; N]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut T) {
        // SAFETY: the caller vouches for N writable numbers.
        unsafe { to.cast::<[T; N]>().write_unaligned(self.0) }
    }
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(x, y)| *x += y);
        self
    }
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(x, y)| *x -= y);
        self
    }
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(x, y)| *x *= y);
        self
    }
    #[inline(always)]
    fn mul_add(mut self, a: Self, b: Self) -> Self {
        for lane in 0..N {
            let x = &mut self.0[lane];
            *x = if FMA { x.mul_add(a.0[lane], b.0[lane]) } else { *x * a.0[lane] + b.0[lane] };
        }
        self
    }
    #[inline(always)]
    fn at_least(mut self, least: T) -> Self {
        self.0.iter_mut().for_each(|x| *x = if *x < least { least } else { *x });
        self
    }
    #[inline(always)]
    fn times_power_of_two(mut self, rounded: Self) -> Self {
        self.0.iter_mut().zip(rounded.0).for_each(|(x, rounded)| *x = x.times_normal_power_of_two(rounded));
        self
    }
    #[inline(always)]
    unsafe fn where_at_least(mut self, words: *const i32, bound: i32) -> Self {
        // SAFETY: the caller vouches for N words.
        let words = unsafe { words.cast::<[i32; N]>().read_unaligned() };
        self.0.iter_mut().zip(words).for_each(|(x, word)| *x = if word >= bound { *x } else { T::ZERO });
        self
    }
}

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
#[cfg_attr(target_arch = "aarch64", allow(unused_unsafe, reason = "every processor of that architecture has these instructions"))]
mod instructions {
    #[cfg(target_arch = "aarch64")]
    use core::arch::aarch64 as arch;
    #[cfg(target_arch = "x86_64")]
    use core::arch::x86_64 as arch;

    use super::Vector;
    use crate::elementary::Elementary;

    macro_rules! register {
        ($register:ident of $lanes:literal $t:ident: $splat:ident $load:ident $store:ident $add:ident $sub:ident $mul:ident $mul_add:expr,
            $max:expr, $times_power:expr, $kept:expr $(, $power_of_two:expr)?) => {
            // SAFETY, of every block here: the instructions exist. A kernel meets this type only as the register of its level, and a
            // level's kernel runs only inside the function of instruction_set.rs that enables the level's instructions, where the processor
            // has them. Pointers are the caller's to vouch for.
            impl Vector<$t> for arch::$register {
                const LANES: usize = $lanes;
                #[inline(always)]
                fn splat(x: $t) -> Self {
                    // SAFETY: as said above.
                    unsafe { arch::$splat(x) }
                }
                #[inline(always)]
                unsafe fn load(from: *const $t) -> Self {
                    // SAFETY: as said above.
                    unsafe { arch::$load(from) }
                }
                #[inline(always)]
                unsafe fn store(self, to: *mut $t) {
                    // SAFETY: as said above.
                    unsafe { arch::$store(to, self) }
                }
                #[inline(always)]
                fn add(self, other: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { arch::$add(self, other) }
                }
                #[inline(always)]
                fn sub(self, other: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { arch::$sub(self, other) }
                }
                #[inline(always)]
                fn mul(self, other: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { arch::$mul(self, other) }
                }
                #[inline(always)]
                fn mul_add(self, a: Self, b: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { ($mul_add)(self, a, b) }
                }
                #[inline(always)]
                fn at_least(self, x: $t) -> Self {
                    // SAFETY: as said above.
                    unsafe { ($max)(arch::$splat(x), self) }
                }
                #[inline(always)]
                fn times_power_of_two(self, rounded: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { ($times_power)(self, rounded) }
                }
                #[inline(always)]
                unsafe fn where_at_least(self, words: *const i32, bound: i32) -> Self {
                    // SAFETY: as said above.
                    unsafe { ($kept)(self, words, bound) }
                }
                $(
                    #[inline(always)]
                    fn power_of_two(self) -> Self {
                        let x = self.at_least(<$t as Elementary>::LEAST_POWER);
                        // SAFETY: as said above.
                        unsafe { ($power_of_two)(x) }
                    }
                )?
            }
        };
    }

    // The larger number: on x86-64 the second operand where one is NaN. Bits of a power of 2 are added to those of the exponent.
    #[cfg(target_arch = "aarch64")]
    register!(float32x4_t of 4 f32: vdupq_n_f32 vld1q_f32 vst1q_f32 vaddq_f32 vsubq_f32 vmulq_f32 |x, a, b| arch::vfmaq_f32(b, x, a),
        |least, x| arch::vmaxq_f32(least, x),
        |x, k| arch::vreinterpretq_f32_s32(arch::vaddq_s32(arch::vreinterpretq_s32_f32(x), arch::vshlq_n_s32::<23>(arch::vreinterpretq_s32_f32(k)))),
        |x, words, bound| arch::vbslq_f32(arch::vcgeq_s32(arch::vld1q_s32(words), arch::vdupq_n_s32(bound)), x, arch::vdupq_n_f32(0.0)));
    #[cfg(target_arch = "aarch64")]
    register!(float64x2_t of 2 f64: vdupq_n_f64 vld1q_f64 vst1q_f64 vaddq_f64 vsubq_f64 vmulq_f64 |x, a, b| arch::vfmaq_f64(b, x, a),
    |least, x| arch::vmaxq_f64(least, x),
    |x, k| arch::vreinterpretq_f64_s64(arch::vaddq_s64(arch::vreinterpretq_s64_f64(x), arch::vshlq_n_s64::<52>(arch::vreinterpretq_s64_f64(k)))),
    |x, words, bound| {
        let kept = arch::vmovl_s32(arch::vreinterpret_s32_u32(arch::vcge_s32(arch::vld1_s32(words), arch::vdup_n_s32(bound))));
        arch::vbslq_f64(arch::vreinterpretq_u64_s64(kept), x, arch::vdupq_n_f64(0.0))
    });
    // SSE has no multiply-add: two instructions, rounded twice.
    #[cfg(target_arch = "x86_64")]
    register!(__m128 of 4 f32: _mm_set1_ps _mm_loadu_ps _mm_storeu_ps _mm_add_ps _mm_sub_ps _mm_mul_ps |x, a, b| arch::_mm_add_ps(arch::_mm_mul_ps(x, a), b),
    arch::_mm_max_ps,
    |x, k| arch::_mm_castsi128_ps(arch::_mm_add_epi32(arch::_mm_castps_si128(x), arch::_mm_slli_epi32::<23>(arch::_mm_castps_si128(k)))),
    |x, words: *const i32, bound| {
        let dropped = arch::_mm_cmpgt_epi32(arch::_mm_set1_epi32(bound), arch::_mm_loadu_si128(words.cast()));
        arch::_mm_andnot_ps(arch::_mm_castsi128_ps(dropped), x)
    });
    #[cfg(target_arch = "x86_64")]
    register!(__m128d of 2 f64: _mm_set1_pd _mm_loadu_pd _mm_storeu_pd _mm_add_pd _mm_sub_pd _mm_mul_pd |x, a, b| arch::_mm_add_pd(arch::_mm_mul_pd(x, a), b),
    arch::_mm_max_pd,
    |x, k| arch::_mm_castsi128_pd(arch::_mm_add_epi64(arch::_mm_castpd_si128(x), arch::_mm_slli_epi64::<52>(arch::_mm_castpd_si128(k)))),
    |x, words: *const i32, bound| {
        let dropped = arch::_mm_cmpgt_epi32(arch::_mm_set1_epi32(bound), arch::_mm_loadl_epi64(words.cast()));
        arch::_mm_andnot_pd(arch::_mm_castsi128_pd(arch::_mm_unpacklo_epi32(dropped, dropped)), x)
    });
    #[cfg(target_arch = "x86_64")]
    register!(__m256 of 8 f32: _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps arch::_mm256_fmadd_ps,
    arch::_mm256_max_ps,
    |x, k| arch::_mm256_castsi256_ps(arch::_mm256_add_epi32(arch::_mm256_castps_si256(x), arch::_mm256_slli_epi32::<23>(arch::_mm256_castps_si256(k)))),
    |x, words: *const i32, bound| {
        let dropped = arch::_mm256_cmpgt_epi32(arch::_mm256_set1_epi32(bound), arch::_mm256_loadu_si256(words.cast()));
        arch::_mm256_andnot_ps(arch::_mm256_castsi256_ps(dropped), x)
    });
    #[cfg(target_arch = "x86_64")]
    register!(__m256d of 4 f64: _mm256_set1_pd _mm256_loadu_pd _mm256_storeu_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd arch::_mm256_fmadd_pd,
    arch::_mm256_max_pd,
    |x, k| arch::_mm256_castsi256_pd(arch::_mm256_add_epi64(arch::_mm256_castpd_si256(x), arch::_mm256_slli_epi64::<52>(arch::_mm256_castpd_si256(k)))),
    |x, words: *const i32, bound| {
        let dropped = arch::_mm_cmpgt_epi32(arch::_mm_set1_epi32(bound), arch::_mm_loadu_si128(words.cast()));
        arch::_mm256_andnot_pd(arch::_mm256_castsi256_pd(arch::_mm256_cvtepi32_epi64(dropped)), x)
    });
    // The distance to the nearest integer, and the scaling, are an instruction each.
    #[cfg(target_arch = "x86_64")]
    register!(__m512 of 16 f32: _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps arch::_mm512_fmadd_ps,
    arch::_mm512_max_ps,
    |x, k| arch::_mm512_castsi512_ps(arch::_mm512_add_epi32(arch::_mm512_castps_si512(x), arch::_mm512_slli_epi32::<23>(arch::_mm512_castps_si512(k)))),
    |x, words: *const i32, bound| {
        let kept = arch::_mm512_cmpge_epi32_mask(arch::_mm512_loadu_si512(words.cast()), arch::_mm512_set1_epi32(bound));
        arch::_mm512_maskz_mov_ps(kept, x)
    },
    |x| {
        let r = arch::_mm512_reduce_ps::<0>(x);
        arch::_mm512_scalef_ps(Self::power_of_fraction(r), arch::_mm512_sub_ps(x, r))
    });
    #[cfg(target_arch = "x86_64")]
    register!(__m512d of 8 f64: _mm512_set1_pd _mm512_loadu_pd _mm512_storeu_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd arch::_mm512_fmadd_pd,
    arch::_mm512_max_pd,
    |x, k| arch::_mm512_castsi512_pd(arch::_mm512_add_epi64(arch::_mm512_castpd_si512(x), arch::_mm512_slli_epi64::<52>(arch::_mm512_castpd_si512(k)))),
    |x, words: *const i32, bound| {
        let kept = arch::_mm256_cmpge_epi32_mask(arch::_mm256_loadu_si256(words.cast()), arch::_mm256_set1_epi32(bound));
        arch::_mm512_maskz_mov_pd(kept, x)
    },
    |x| {
        let r = arch::_mm512_reduce_pd::<0>(x);
        arch::_mm512_scalef_pd(Self::power_of_fraction(r), arch::_mm512_sub_pd(x, r))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruction_set::{InstructionSet, Isa, Kernel};
    use crate::testing::numbers;

    #[test]
    fn an_array_does_the_arithmetic_of_a_register() {
        let numbers = [1.5_f32, -2.0, 0.25, 4.0];
        // SAFETY: four numbers are read.
        let x = unsafe { Array::<f32, 4, true>::load(numbers.as_ptr()) };
        let y = x.mul_add(Vector::splat(2.0), x).add(Vector::splat(1.0));
        let mut found = [0.0_f32; 4];
        // SAFETY: four numbers are written.
        unsafe { y.store(found.as_mut_ptr()) };
        assert_eq!(found, numbers.map(|x| 2.0_f32.mul_add(x, x) + 1.0));
        assert_eq!(<Array<f64, 8, false> as Vector<f64>>::LANES, 8);
        // SAFETY: as many words as numbers are read, and written.
        unsafe { x.where_at_least([1, 2, 3, i32::MIN].as_ptr(), 2).at_least(-1.0).store(found.as_mut_ptr()) };
        assert_eq!(found, [0.0, -1.0, 0.25, 0.0]);
        assert_eq!(Array::<f32, 2, false>([3.0, -2.0]).power_of_two().0, [8.0, 0.25]);
    }

    /// Every operation on the first numbers of two rows, results side by side.
    struct Operations<'a, T>(&'a [T], &'a [i32], &'a mut Vec<Vec<T>>);

    impl<T: Real> Kernel for Operations<'_, T> {
        #[inline(always)]
        fn run<I: Isa>(self) {
            let Self(x, words, results) = self;
            let lanes = I::Vector::<T>::LANES;
            assert!(x.len() >= 2 * lanes && words.len() >= lanes);
            // SAFETY: there are as many numbers and words as are read.
            let (a, b) = unsafe { (I::Vector::<T>::load(x.as_ptr()), I::Vector::<T>::load(x[lanes..].as_ptr())) };
            let least = T::of(0.1);
            // SAFETY: as above.
            let kept = unsafe { [a.where_at_least(words.as_ptr(), -3), a.where_at_least(words.as_ptr(), i32::MIN)] };
            for y in [a.add(b), a.sub(b), a.mul(b), a.at_least(least), kept[0], kept[1]] {
                let mut numbers = vec![T::ZERO; lanes];
                // SAFETY: room for one register.
                unsafe { y.store(numbers.as_mut_ptr()) };
                results.push(numbers);
            }
        }
    }

    #[test]
    fn registers_do_the_arithmetic_of_numbers() {
        fn check<T: Real>(isa: InstructionSet) {
            let x = numbers::<T>(1, 64);
            let words: Vec<i32> = (0..32).map(|i| [5, -4, i32::MIN, -3, i32::MAX, -5][i % 6]).collect();
            let mut results = Vec::new();
            isa.run(Operations(&x, &words, &mut results));
            let lanes = results[0].len();
            for i in 0..lanes {
                let (a, b, word) = (x[i], x[lanes + i], words[i]);
                let larger = if a < T::of(0.1) { T::of(0.1) } else { a };
                let expected = [a + b, a - b, a * b, larger, if word >= -3 { a } else { T::ZERO }, a];
                for (operation, (found, expected)) in results.iter().zip(expected).enumerate() {
                    assert_eq!(found[i].f64().to_bits(), expected.f64().to_bits(), "operation {operation}, lane {i} at {isa}");
                }
            }
        }
        for isa in InstructionSet::available() {
            check::<f32>(isa);
            check::<f64>(isa);
        }
    }
}
