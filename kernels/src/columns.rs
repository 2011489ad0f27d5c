//! Functions of one or two numbers, applied to columns of f64: the loops behind formulas of flight mechanics, where a column holds a number a sample.
//!
//! The function comes from the caller and is compiled into the loop, once a level. It sees one sample at a time and nothing is fused, so
//! all levels give the same bits. Not here: what the functions are, and anything that remembers earlier samples.

use crate::instruction_set::{InstructionSet, Isa, Kernel};

/// out = f(x), element by element.
///
/// # Panics
/// If the lengths differ.
pub fn map(isa: InstructionSet, f: impl Fn(f64) -> f64, x: &[f64], out: &mut [f64]) {
    assert_eq!(x.len(), out.len(), "columns of one length");
    isa.run(Map { f, x, out });
}

/// out = f(x, y), element by element.
///
/// # Panics
/// If the lengths differ.
pub fn zip(isa: InstructionSet, f: impl Fn(f64, f64) -> f64, x: &[f64], y: &[f64], out: &mut [f64]) {
    assert!(x.len() == out.len() && y.len() == out.len(), "columns of one length");
    isa.run(Zip { f, x, y, out });
}

struct Map<'a, F> {
    f: F,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl<F: Fn(f64) -> f64> Kernel for Map<'_, F> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (out, &x) in self.out.iter_mut().zip(self.x) {
            *out = (self.f)(x);
        }
    }
}

struct Zip<'a, F> {
    f: F,
    x: &'a [f64],
    y: &'a [f64],
    out: &'a mut [f64],
}

impl<F: Fn(f64, f64) -> f64> Kernel for Zip<'_, F> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        for ((out, &x), &y) in self.out.iter_mut().zip(self.x).zip(self.y) {
            *out = (self.f)(x, y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::numbers;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_level_gives_the_bits_of_one_number_at_a_time(len in 0_usize..300, seed in 0_u64..1000) {
            let (x, y) = (numbers::<f64>(seed, len), numbers::<f64>(seed + 1, len));
            let product = |x: f64, y: f64| x * y + x / y;
            let root = |x: f64| x.abs().sqrt() - x;
            for isa in InstructionSet::available() {
                let mut out = vec![f64::NAN; len];
                zip(isa, product, &x, &y, &mut out);
                prop_assert!(out.iter().zip(x.iter().zip(&y)).all(|(out, (x, y))| out.to_bits() == product(*x, *y).to_bits()));
                map(isa, root, &x, &mut out);
                prop_assert!(out.iter().zip(&x).all(|(out, x)| out.to_bits() == root(*x).to_bits()));
            }
        }
    }

    #[test]
    #[should_panic(expected = "of one length")]
    fn a_shorter_operand_is_refused() {
        zip(InstructionSet::PLAIN, |x, y| x + y, &[1.0, 2.0], &[1.0], &mut [0.0; 2]);
    }
}
