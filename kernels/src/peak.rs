//! The peak of fused multiply-adds of one thread at a level, measured: what shares of the peak are shares of.
//!
//! Twelve independent accumulators of one register, so that two a cycle can start whatever their latency. Not a kernel.

use std::hint::black_box;
use std::time::Instant;

use crate::instruction_set::{InstructionSet, Isa, Kernel};
use crate::vector::Vector;

/// Multiply-adds in a row of each accumulator, in one timed piece: about a millisecond.
const COUNT: usize = 250_000;

/// Accumulators.
const WIDTH: usize = 12;

/// Pieces; the fastest counts, since whatever disturbs makes slower.
const PIECES: usize = 30;

/// 10⁹ operations a second in f32, an addition and a multiplication counted as two.
pub fn f32_gflops(isa: InstructionSet) -> f64 {
    (0..PIECES).map(|_| piece(isa)).fold(0.0, f64::max)
}

fn piece(isa: InstructionSet) -> f64 {
    let mut sum = [0.0_f32; 2];
    let start = Instant::now();
    isa.run(Chain { result: &mut sum });
    let seconds = start.elapsed().as_secs_f64();
    let [result, lanes] = black_box(sum);
    assert!(result.is_finite(), "the chain converges to 1");
    2.0 * f64::from(lanes) * (COUNT * WIDTH) as f64 / seconds * 1e-9
}

struct Chain<'a> {
    /// A number that depends on all sums, so that none is left out; and the lanes of a register.
    result: &'a mut [f32; 2],
}

impl Kernel for Chain<'_> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        let (factor, term) = (I::Vector::splat(black_box(0.999_f32)), I::Vector::splat(black_box(0.001_f32)));
        let mut sums = [I::Vector::splat(1.0_f32); WIDTH];
        for _ in 0..COUNT {
            for sum in &mut sums {
                *sum = sum.mul_add(factor, term);
            }
        }
        let total = sums.into_iter().fold(I::Vector::splat(0.0_f32), Vector::add);
        let mut lanes = [0.0_f32; 64];
        assert!(I::Vector::<f32>::LANES <= lanes.len(), "no register has more lanes");
        // SAFETY: checked above.
        unsafe { total.store(lanes.as_mut_ptr()) };
        *self.result = [lanes[0], I::Vector::<f32>::LANES as f32];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_a_peak() {
        for isa in InstructionSet::available() {
            let found = f32_gflops(isa);
            println!("{isa}: {found:.1} GFLOP/s");
            assert!(found > 0.0 && found.is_finite());
        }
    }
}
