//! One step of Adam (Kingma & Ba 2015) in PyTorch's form, over flat slices.
//!
//! ```text
//! m ← β₁m + (1 − β₁)g,   v ← β₂v + (1 − β₂)g²,   θ ← θ − lr/(1 − β₁ᵗ) · m / (√v/√(1 − β₂ᵗ) + ε)
//! ```

use crate::Real;
use crate::instruction_set::{InstructionSet, Isa, Kernel};

/// The constants of a step. The default is PyTorch's: 1e-3, 0.9, 0.999, 1e-8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adam {
    /// lr
    pub learning_rate: f64,
    /// β₁
    pub beta1: f64,
    /// β₂
    pub beta2: f64,
    /// ε, added after the bias-corrected root
    pub epsilon: f64,
}

impl Default for Adam {
    fn default() -> Self {
        Self { learning_rate: 1e-3, beta1: 0.9, beta2: 0.999, epsilon: 1e-8 }
    }
}

/// Step number `step` (1 is the first). `first` and `second` are the two moments; `gradient` is multiplied by `scale` on reading (1, or one over a number of samples).
pub fn step<T: Real>(
    isa: InstructionSet,
    adam: &Adam,
    step: u64,
    scale: f64,
    gradient: &[T],
    parameters: &mut [T],
    (first, second): (&mut [T], &mut [T]),
) {
    let n = parameters.len();
    assert!(gradient.len() == n && first.len() == n && second.len() == n, "adam: {n} parameters, other slices differ");
    // powi takes i32; powf keeps every step number.
    let correction1 = 1.0 - Real::powf(adam.beta1, step as f64);
    let correction2 = 1.0 - Real::powf(adam.beta2, step as f64);
    T::adam_step(
        isa,
        Step {
            scale: T::of(scale),
            beta1: T::of(adam.beta1),
            beta2: T::of(adam.beta2),
            rest1: T::of(1.0 - adam.beta1),
            rest2: T::of(1.0 - adam.beta2),
            rate: T::of(adam.learning_rate / correction1),
            root: T::of(1.0 / Real::sqrt(correction2)),
            epsilon: T::of(adam.epsilon),
            gradient,
            parameters,
            first,
            second,
        },
    );
}

pub(crate) struct Step<'a, T> {
    scale: T,
    beta1: T,
    beta2: T,
    rest1: T,
    rest2: T,
    rate: T,
    root: T,
    epsilon: T,
    gradient: &'a [T],
    parameters: &'a mut [T],
    first: &'a mut [T],
    second: &'a mut [T],
}

impl<T: Real> Kernel for Step<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        for (((theta, g), m), v) in self.parameters.iter_mut().zip(self.gradient).zip(self.first).zip(self.second) {
            let g = *g * self.scale;
            *m = self.beta1 * *m + self.rest1 * g;
            *v = self.beta2 * *v + self.rest2 * g * g;
            *theta -= self.rate * *m / (v.sqrt() * self.root + self.epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference;
    use crate::testing::{assert_near, numbers};
    use crate::tolerance::Tolerance;

    fn check<T: Real>(len: usize, start: usize, scale: f64, seed: u64) {
        let adam = Adam::default();
        for isa in InstructionSet::available() {
            let (mut theta, mut m, mut v) = (numbers::<T>(seed, len), vec![T::ZERO; len], vec![T::ZERO; len]);
            let widen = |x: &[T]| x.iter().map(|x| x.f64()).collect::<Vec<f64>>();
            let mut expected = (widen(&theta), widen(&m), widen(&v));
            let start = start.min(len);
            for t in 1..=10 {
                let gradient = numbers::<T>(seed + t, len);
                step(isa, &adam, t, scale, &gradient[start..], &mut theta[start..], (&mut m[start..], &mut v[start..]));
                let moments = expected.1.iter_mut().zip(&mut expected.2);
                for ((theta, (m, v)), g) in expected.0.iter_mut().zip(moments).zip(&gradient).skip(start) {
                    (*theta, *m, *v) = reference::adam(&adam, t, *theta, g.f64() * scale, *m, *v);
                }
            }
            let narrow = |x: &[f64]| x.iter().map(|x| T::of(*x)).collect::<Vec<T>>();
            assert_near("parameters", &theta, &narrow(&expected.0), Tolerance::Close);
            assert_near("first moment", &m, &narrow(&expected.1), Tolerance::Close);
            assert_near("second moment", &v, &narrow(&expected.2), Tolerance::Close);
        }
    }

    proptest! {
        #[test]
        fn ten_steps_equal_the_formula(len in 0_usize..200, start in 0_usize..9, scale in 0.1_f64..2.0, seed in 0_u64..1000) {
            check::<f32>(len, start, scale, seed);
            check::<f64>(len, start, scale, seed);
        }
    }

    #[test]
    fn the_first_step_is_one_learning_rate_against_the_sign_of_the_gradient() {
        let (mut theta, mut m, mut v) = ([1.0_f64, 1.0], [0.0; 2], [0.0; 2]);
        step(InstructionSet::PLAIN, &Adam::default(), 1, 1.0, &[3.0, -40.0], &mut theta, (&mut m, &mut v));
        assert_near("parameters", &theta, &[1.0 - 1e-3, 1.0 + 1e-3], Tolerance::Close);
    }
}
