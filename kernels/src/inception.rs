//! Square kernels of sizes 1, 3, 5, … as one (Inception without a nonlinearity between its branches, TimesNet): the mean of parallel
//! convolutions is the convolution with the mean of their kernels, each between zeros.
//!
//! ```text
//! W[a, b, i, o] = 1/m·Σ_j w_j[o, i, a − h + h_j, b − h + h_j],   w_j of 2h_j + 1 = 1, 3, … , 2h + 1 rows and columns, m of them
//! ```
//!
//! w_j `[out, in, k_j²]` as PyTorch stores it, W `[k², in, out]` as the product of `fold` takes it. For six kernels 286 taps become 121.

use crate::Real;
use crate::Write;

/// Most kernels that are merged.
pub const MOST_KERNELS: usize = 8;

/// Taps of the largest of `count` kernels.
pub const fn taps(count: usize) -> usize {
    (2 * count - 1) * (2 * count - 1)
}

/// Tap of the merged kernel for each tap of kernel `j` of `count`.
fn places(count: usize, j: usize) -> impl Iterator<Item = usize> {
    let (side, own) = (2 * count - 1, 2 * j + 1);
    (0..own * own).map(move |tap| (tap / own + count - 1 - j) * side + tap % own + count - 1 - j)
}

/// W from all kernels, smallest first.
///
/// # Panics
/// If lengths disagree.
pub fn merge<T: Real>(kernels: &[&[T]], inputs: usize, outputs: usize, merged: &mut [T]) {
    let count = kernels.len();
    assert!((1..=MOST_KERNELS).contains(&count) && merged.len() == taps(count) * inputs * outputs, "inception: merged length");
    let share = T::of(1.0 / count as f64);
    let mut sums = [T::ZERO; taps(MOST_KERNELS)];
    // Kernels are read as they lie; only the sums of one pair of channels are scattered.
    for (o, i) in (0..outputs).flat_map(|o| (0..inputs).map(move |i| (o, i))) {
        sums[..taps(count)].fill(T::ZERO);
        for (j, kernel) in kernels.iter().enumerate() {
            let own = &kernel[(o * inputs + i) * taps(j + 1)..][..taps(j + 1)];
            places(count, j).zip(own).for_each(|(place, weight)| sums[place] += *weight);
        }
        let to = merged.iter_mut().skip(i * outputs + o).step_by(inputs * outputs);
        to.zip(&sums).for_each(|(to, sum)| *to = share * *sum);
    }
}

/// dw_j {=, +=} from dW: what lies under kernel `j` of `count`.
///
/// # Panics
/// If lengths disagree.
pub fn split<T: Real>(count: usize, j: usize, dmerged: &[T], inputs: usize, outputs: usize, dkernel: &mut [T], write: Write) {
    assert!(
        dmerged.len() == taps(count) * inputs * outputs && dkernel.len() == taps(j + 1) * inputs * outputs,
        "inception: lengths"
    );
    let share = T::of(1.0 / count as f64);
    for (o, i) in (0..outputs).flat_map(|o| (0..inputs).map(move |i| (o, i))) {
        let own = &mut dkernel[(o * inputs + i) * taps(j + 1)..][..taps(j + 1)];
        for (place, to) in places(count, j).zip(own) {
            let value = share * dmerged[(place * inputs + i) * outputs + o];
            *to = value + if write == Write::Add { *to } else { T::ZERO };
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fold::{self, Fold};
    use crate::testing::{assert_near, inner, numbers};
    use crate::tolerance::Tolerance;
    use crate::{InstructionSet, Rows, RowsMut};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn one_merged_kernel_does_what_all_do(
            count in 1_usize..7, length in 2_usize..60, frequency in 1_usize..30, inputs in 1_usize..5, outputs in 1_usize..5, seed in 0_u64..1000
        ) {
            let kernels: Vec<Vec<f64>> = (0..count).map(|j| numbers(seed + j as u64, taps(j + 1) * inputs * outputs)).collect();
            let views: Vec<&[f64]> = kernels.iter().map(Vec::as_slice).collect();
            let mut merged = vec![f64::NAN; taps(count) * inputs * outputs];
            merge(&views, inputs, outputs, &mut merged);
            let x = numbers::<f64>(seed + 100, length * inputs);
            let convolve = |kernel: usize, weight: &[f64]| {
                let fold = Fold { period: length / frequency.min(length / 2), length, kernel };
                let mut y = vec![f64::NAN; length * outputs];
                let mut scratch = vec![f64::NAN; fold::scratch_len(length, kernel, inputs, outputs)];
                let to = RowsMut::packed(&mut y, length, outputs);
                fold::forward(InstructionSet::PLAIN, fold, Rows::packed(&x, length, inputs), weight, &vec![0.0; outputs], to, &mut scratch);
                y
            };
            let mut expected = vec![0.0; length * outputs];
            for (j, kernel) in kernels.iter().enumerate() {
                // One kernel alone, as `fold` takes it.
                let mut weight = vec![0.0; kernel.len()];
                for (at, value) in kernel.iter().enumerate() {
                    let (o, i, tap) = (at / taps(j + 1) / inputs, at / taps(j + 1) % inputs, at % taps(j + 1));
                    weight[(tap * inputs + i) * outputs + o] = *value;
                }
                expected.iter_mut().zip(convolve(2 * j + 1, &weight)).for_each(|(sum, y)| *sum += y / count as f64);
            }
            assert_near("merged", &convolve(2 * count - 1, &merged), &expected, Tolerance::Close);
        }

        #[test]
        fn split_is_the_adjoint(count in 1_usize..7, inputs in 1_usize..5, outputs in 1_usize..5, seed in 0_u64..1000) {
            let kernels: Vec<Vec<f64>> = (0..count).map(|j| numbers(seed + j as u64, taps(j + 1) * inputs * outputs)).collect();
            let views: Vec<&[f64]> = kernels.iter().map(Vec::as_slice).collect();
            let dmerged = numbers::<f64>(seed + 50, taps(count) * inputs * outputs);
            let mut merged = vec![f64::NAN; dmerged.len()];
            merge(&views, inputs, outputs, &mut merged);
            let mut sum = 0.0;
            for (j, kernel) in kernels.iter().enumerate() {
                let mut dkernel = vec![f64::NAN; kernel.len()];
                split(count, j, &dmerged, inputs, outputs, &mut dkernel, Write::Set);
                let once = dkernel.clone();
                split(count, j, &dmerged, inputs, outputs, &mut dkernel, Write::Add);
                assert_near("twice", &dkernel, &once.iter().map(|d| 2.0 * d).collect::<Vec<_>>(), Tolerance::Close);
                sum += inner(kernel, &once);
            }
            assert_near("<merge w, d> and <w, split d>", &[inner(&merged, &dmerged)], &[sum], Tolerance::Close);
        }
    }
}
