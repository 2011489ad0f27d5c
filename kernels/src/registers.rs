//! Which register and which tile of accumulators each float type has at each level. The registers themselves are in `vector`, the choice of a level
//! in `level`.

use crate::instruction_set::{Plain, Tiled};
#[cfg(not(target_arch = "x86_64"))]
use crate::vector::Array;
use crate::vector::Vector;

/// Registers and accumulator tiles of one float type at each level: a wide one, two registers wide and as tall as leaves room for two of
/// the right operand and one of the left; and a tall one, half as wide and twice as tall. A supertrait of [`Real`]; not for use outside this crate.
#[expect(private_bounds, reason = "registers are this crate's own")]
pub trait Registers: Sized {
    /// What every processor of the architecture has.
    #[doc(hidden)]
    type Plain: Vector<Self>;
    /// 256 bits.
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    type Avx2: Vector<Self>;
    /// 512 bits.
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    type Avx512: Vector<Self>;
    /// 128 bits, with a fused multiply-add.
    #[cfg(target_arch = "aarch64")]
    #[doc(hidden)]
    type Neon: Vector<Self>;
    #[doc(hidden)]
    fn plain_tile<K: Tiled<Self>>(kernel: K);
    #[doc(hidden)]
    fn plain_tall_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    fn avx2_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    fn avx2_tall_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    fn avx512_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "x86_64")]
    #[doc(hidden)]
    fn avx512_tall_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "aarch64")]
    #[doc(hidden)]
    fn neon_tile<K: Tiled<Self>>(kernel: K);
    #[cfg(target_arch = "aarch64")]
    #[doc(hidden)]
    fn neon_tall_tile<K: Tiled<Self>>(kernel: K);
}

macro_rules! registers {
    ($t:ident: plain $sse:ident of $lanes:literal $plain:tt avx2 $avx2:ident $avx2_tile:tt avx512 $avx512:ident $avx512_tile:tt neon $neon:ident $neon_tile:tt) => {
        #[expect(private_bounds, reason = "as above")]
        impl Registers for $t {
            #[cfg(target_arch = "x86_64")]
            type Plain = core::arch::x86_64::$sse;
            #[cfg(not(target_arch = "x86_64"))]
            type Plain = Array<$t, { $lanes }, false>;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = core::arch::x86_64::$avx2;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = core::arch::x86_64::$avx512;
            #[cfg(target_arch = "aarch64")]
            type Neon = core::arch::aarch64::$neon;
            registers!(@tiles plain_tile plain_tall_tile Plain $plain);
            #[cfg(target_arch = "x86_64")]
            registers!(@tiles avx2_tile avx2_tall_tile crate::instruction_set::Avx2 $avx2_tile);
            #[cfg(target_arch = "x86_64")]
            registers!(@tiles avx512_tile avx512_tall_tile crate::instruction_set::Avx512 $avx512_tile);
            #[cfg(target_arch = "aarch64")]
            registers!(@tiles neon_tile neon_tall_tile crate::instruction_set::Neon $neon_tile);
        }
    };
    (@tiles $wide:ident $tall:ident $isa:path [$rows:literal x $columns:literal, $tall_rows:literal x $tall_columns:literal]) => {
        #[inline(always)]
        fn $wide<K: Tiled<Self>>(kernel: K) {
            kernel.run::<$isa, $rows, $columns>();
        }
        #[inline(always)]
        fn $tall<K: Tiled<Self>>(kernel: K) {
            kernel.run::<$isa, $tall_rows, $tall_columns>();
        }
    };
}

registers!(f32: plain __m128 of 4 [4 x 8, 8 x 4] avx2 __m256 [6 x 16, 12 x 8] avx512 __m512 [12 x 32, 24 x 16] neon float32x4_t [12 x 8, 24 x 4]);
registers!(f64: plain __m128d of 2 [4 x 4, 8 x 2] avx2 __m256d [6 x 8, 12 x 4] avx512 __m512d [12 x 16, 24 x 8] neon float64x2_t [12 x 4, 24 x 2]);
