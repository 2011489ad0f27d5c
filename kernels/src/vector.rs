//! One register of floats: what the innermost loops of tile.rs are written in.
//!
//! Loops over whole rows vectorise by themselves. A tile of accumulators does not reliably: the compiler splits registers or moves
//! accumulators to memory when code around the loop changes. So the tile names its registers. Five operations are all it needs;
//! an instruction set is one short block below. Where there is none, an array does the same arithmetic.
//!
//! Not here: exp, masks and other element-wise arithmetic, which stay plain loops.

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

    /// self·a + b, rounded once where the level can.
    fn mul_add(self, a: Self, b: Self) -> Self;
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
    fn mul_add(mut self, a: Self, b: Self) -> Self {
        for lane in 0..N {
            let x = &mut self.0[lane];
            *x = if FMA { x.mul_add(a.0[lane], b.0[lane]) } else { *x * a.0[lane] + b.0[lane] };
        }
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

    macro_rules! register {
        ($register:ident of $lanes:literal $t:ident: $splat:ident $load:ident $store:ident $add:ident $mul_add:expr) => {
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
                fn mul_add(self, a: Self, b: Self) -> Self {
                    // SAFETY: as said above.
                    unsafe { ($mul_add)(self, a, b) }
                }
            }
        };
    }

    #[cfg(target_arch = "aarch64")]
    register!(float32x4_t of 4 f32: vdupq_n_f32 vld1q_f32 vst1q_f32 vaddq_f32 |x, a, b| arch::vfmaq_f32(b, x, a));
    #[cfg(target_arch = "aarch64")]
    register!(float64x2_t of 2 f64: vdupq_n_f64 vld1q_f64 vst1q_f64 vaddq_f64 |x, a, b| arch::vfmaq_f64(b, x, a));
    // SSE has no multiply-add: two instructions, rounded twice.
    #[cfg(target_arch = "x86_64")]
    register!(__m128 of 4 f32: _mm_set1_ps _mm_loadu_ps _mm_storeu_ps _mm_add_ps |x, a, b| arch::_mm_add_ps(arch::_mm_mul_ps(x, a), b));
    #[cfg(target_arch = "x86_64")]
    register!(__m128d of 2 f64: _mm_set1_pd _mm_loadu_pd _mm_storeu_pd _mm_add_pd |x, a, b| arch::_mm_add_pd(arch::_mm_mul_pd(x, a), b));
    #[cfg(target_arch = "x86_64")]
    register!(__m256 of 8 f32: _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_add_ps arch::_mm256_fmadd_ps);
    #[cfg(target_arch = "x86_64")]
    register!(__m256d of 4 f64: _mm256_set1_pd _mm256_loadu_pd _mm256_storeu_pd _mm256_add_pd arch::_mm256_fmadd_pd);
    #[cfg(target_arch = "x86_64")]
    register!(__m512 of 16 f32: _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_add_ps arch::_mm512_fmadd_ps);
    #[cfg(target_arch = "x86_64")]
    register!(__m512d of 8 f64: _mm512_set1_pd _mm512_loadu_pd _mm512_storeu_pd _mm512_add_pd arch::_mm512_fmadd_pd);
}

#[cfg(test)]
mod tests {
    use super::*;

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
    }
}
