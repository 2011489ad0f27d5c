//! One-dimensional convolution of a channels-last sequence, stride 1, ends padded by repeating the first and the last row.
//!
//! ```text
//! z[t, o] = b[o] + Σ_{c,j} W[j, c, o]·x[clamp(t + j − left, 0, n − 1), c],   t = 0 … n + left + right − taps
//! y = dropout(f(z))
//! ```
//!
//! (cross-correlation, as PyTorch's Conv1d after a replication pad). x `[n, in]`, y `[n′, out]`, W `[taps, in, out]`: the matrix of the
//! product, so that neither it nor its gradient is ever transposed (PyTorch keeps `[out, in, taps]`). The padded sequence is never made:
//! the product reads shifted rows of x where they lie.
//!
//! Kernels of 3 and 5 taps between many channels take the shorter way of `winograd`: the same sums in another order.
//!
//! Here: shapes and the forward product. f and dropout are in `epilogue`, gradients in `backward`, packed weights in `packing`.

use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, LeftRows};
use crate::{Real, Rows, RowsMut};

mod backward;
mod epilogue;
mod packing;
pub mod sequences;
mod winograd;

pub(crate) use backward::{BackwardInput, BackwardWeight};
pub use backward::{backward_bias, backward_input, backward_weight};
pub(crate) use epilogue::BackwardEpilogue;
use epilogue::Finish;
pub use epilogue::{Epilogue, backward_epilogue};
pub(crate) use packing::Pack;
use packing::panels;
pub use packing::{Weight, pack, pack_transposed, packed_len};
pub(crate) use sequences::{BackwardInputSequences, BackwardWeightSequences, ForwardSequences};

/// Kernel length and padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Kernel length.
    pub taps: usize,
    /// Times the first row is repeated in front.
    pub left: usize,
    /// Times the last row is repeated behind.
    pub right: usize,
}

impl Geometry {
    /// Rows of y for `rows` rows of x; 0 if the kernel is longer than the padded sequence, or there is nothing to repeat.
    pub const fn output_rows(self, rows: usize) -> usize {
        if rows == 0 { 0 } else { (rows + self.left + self.right + 1).saturating_sub(self.taps) }
    }
}

/// Scratch, in numbers, that any function here needs, but for those on [`sequences`].
pub fn scratch_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    scratch_len_of(1, geometry, inputs, outputs)
}

/// Scratch, in numbers, that any function here needs for so many sequences at once.
pub fn scratch_len_of(sequences: usize, geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    let forward = packed_len(geometry, inputs, outputs);
    let backward = packed_len(geometry, outputs, inputs) + ends_len(sequences, geometry, inputs, outputs);
    if winograd::applies(geometry, inputs, outputs) {
        let product = winograd::product_scratch_len(inputs.max(outputs));
        (forward.max(backward) + product).max(winograd::gradient_scratch_len(inputs, outputs))
    } else {
        forward.max(backward)
    }
}

/// A row of zeros, and the gradients of the padded rows.
const fn ends_len(sequences: usize, geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    outputs + sequences * (geometry.left + geometry.right) * inputs
}

/// Where y may be cut for [`forward_rows`]: at multiples of this many rows, every row is computed by the same instructions as uncut.
pub const CUT: usize = winograd::CUT;

/// y = dropout(f(conv(x) + b)).
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    x: Rows<'_, T>,
    (weight, bias): (Weight<'_, T>, Option<&[T]>),
    epilogue: Epilogue,
    y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    assert_eq!(y.rows(), geometry.output_rows(x.rows()), "conv1d: rows of y");
    forward_rows(isa, geometry, x, (weight, bias), epilogue, (0, y), scratch);
}

/// Rows `first…` of what [`forward`] gives, as many as y `[≤ n′ − first, out]` has; x and the dropout mask are those of the whole.
///
/// # Panics
/// If shapes disagree.
pub fn forward_rows<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    x: Rows<'_, T>,
    (weight, bias): (Weight<'_, T>, Option<&[T]>),
    epilogue: Epilogue,
    (first, y): (usize, RowsMut<'_, T>),
    scratch: &mut [T],
) {
    assert!(first + y.rows() <= geometry.output_rows(x.rows()), "conv1d: rows of y");
    assert!(bias.is_none_or(|bias| bias.len() == y.cols()), "conv1d: length of the bias");
    let sizes = (x.cols(), y.cols());
    if winograd::applies(geometry, sizes.0, sizes.1) {
        let y = sequences::Output { y, dropout: epilogue.dropout };
        return sequences::forward_rows(isa, geometry, &[x], (weight, bias), epilogue.activation, (first, &mut [y]), scratch);
    }
    let (packed, _) = panels(isa, geometry, sizes, (weight, false), scratch);
    T::conv1d_forward(isa, Forward { geometry, x, packed, bias, epilogue, first, y });
}

pub(crate) struct Forward<'a, T> {
    geometry: Geometry,
    x: Rows<'a, T>,
    packed: &'a [T],
    bias: Option<&'a [T]>,
    epilogue: Epilogue,
    first: usize,
    y: RowsMut<'a, T>,
}

impl<T: Real> Tiled<T> for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        const { assert!(CUT.is_multiple_of(MR), "a cut ends inside a tile") };
        let Geometry { taps, left, .. } = self.geometry;
        let (inputs, outputs) = (self.x.cols(), self.y.cols());
        let shifted = Shifted { x: self.x, taps, left, first: self.first, rows: self.y.rows() };
        let panels = &self.packed[..taps * inputs * outputs.next_multiple_of(NR)];
        let mut sink = Finish::new(self.first, self.y, self.bias, self.epilogue);
        tile::rows::<T, I, _, _, MR, NR>(&shifted, outputs, panels, &mut sink);
    }
}

/// Row i, tap j ↦ x[clamp(t + j − left)] for output row t = first + i.
struct Shifted<'a, T> {
    x: Rows<'a, T>,
    taps: usize,
    left: usize,
    first: usize,
    rows: usize,
}

impl<T> LeftRows<T> for Shifted<'_, T> {
    #[inline(always)]
    fn rows(&self) -> usize {
        self.rows
    }
    #[inline(always)]
    fn taps(&self) -> usize {
        self.taps
    }
    #[inline(always)]
    fn depth(&self) -> usize {
        self.x.cols()
    }
    #[inline(always)]
    fn piece(&self, i: usize, tap: usize) -> &[T] {
        self.x.row((self.first + i + tap).saturating_sub(self.left).min(self.x.rows() - 1))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::activation::Activation;
    use crate::dropout::Mask;
    use crate::random::Stream;
    use crate::testing::{Matrix, assert_near, bits, check_writes, inner, numbers};
    use crate::tolerance::Tolerance;
    use crate::{Write, linear, reference};

    #[derive(Clone, Copy, Debug)]
    pub(super) struct Problem {
        pub geometry: Geometry,
        pub rows: usize,
        pub inputs: usize,
        pub outputs: usize,
        pub seed: u64,
    }

    pub(super) fn problem() -> impl Strategy<Value = Problem> {
        let channels = || prop_oneof![3 => 1_usize..35, 1 => Just(32), 1 => Just(64)];
        (1_usize..6, 0_usize..5, 0_usize..5, 0_usize..200, channels(), channels(), 0_u64..1000).prop_map(
            |(taps, left, right, rows, inputs, outputs, seed)| Problem {
                geometry: Geometry { taps, left, right },
                rows,
                inputs,
                outputs,
                seed,
            },
        )
    }

    fn check<T: Real>(p: Problem) {
        let Problem { geometry, rows, inputs, outputs, seed } = p;
        let after = geometry.output_rows(rows);
        let x = Matrix::<T>::random(seed, (rows, inputs));
        let weight = numbers::<T>(seed + 1, geometry.taps * inputs * outputs);
        let bias = numbers::<T>(seed + 2, outputs);
        let dz = Matrix::<T>::random(seed + 3, (after, outputs));
        let mut z = Matrix::<T>::poisoned(seed, (after, outputs));
        reference::conv1d(geometry, x.view(), &weight, Some(&bias), z.view_mut());
        let mut dx = Matrix::<T>::poisoned(seed, (rows, inputs));
        reference::conv1d_backward_input(geometry, dz.view(), &weight, dx.view_mut());
        let mut dw = Matrix::<T>::poisoned(0, (1, weight.len()));
        reference::conv1d_backward_weight(geometry, x.view(), dz.view(), dw.view_mut().row_mut(0));
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(geometry, inputs, outputs)];
            let mut y = Matrix::<T>::poisoned(seed, (after, outputs));
            let mut packed = vec![T::NAN; packed_len(geometry, inputs, outputs)];
            pack(isa, geometry, (inputs, outputs), &weight, &mut packed);
            for weight in [Weight::Plain(&weight), Weight::Packed(&packed)] {
                forward(isa, geometry, x.view(), (weight, Some(&bias)), Epilogue::NONE, y.view_mut(), &mut scratch);
                y.check_gaps();
                assert_near(&format!("forward at {isa}"), &y.to_vec(), &z.to_vec(), Tolerance::Close);
            }
            let mut packed = vec![T::NAN; packed_len(geometry, outputs, inputs)];
            pack_transposed(isa, geometry, (inputs, outputs), &weight, &mut packed);
            for weight in [Weight::Plain(&weight), Weight::Packed(&packed)] {
                check_writes(&format!("dx at {isa}"), &dx, Tolerance::Close, |dx, write| {
                    backward_input(isa, geometry, dz.view(), weight, dx, write, &mut scratch);
                });
            }
            check_writes(&format!("dW at {isa}"), &dw, Tolerance::Close, |mut dw, write| {
                backward_weight(isa, geometry, x.view(), dz.view(), dw.row_mut(0), write, &mut scratch);
            });
        }
    }

    fn check_pieces<T: Real>(p: Problem, epilogue: Epilogue, step: usize) {
        let Problem { geometry, rows, inputs, outputs, seed } = p;
        let after = geometry.output_rows(rows);
        let x = Matrix::<T>::random(seed, (rows, inputs));
        let (weight, bias) = (numbers::<T>(seed + 1, geometry.taps * inputs * outputs), numbers::<T>(seed + 2, outputs));
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(geometry, inputs, outputs)];
            let mut found = |step: usize| {
                let mut y = Matrix::<T>::poisoned(seed, (after, outputs));
                for first in (0..after).step_by(step) {
                    let y = y.view_mut().range(first, after.min(first + step));
                    let weight = Weight::Plain(&weight);
                    forward_rows(isa, geometry, x.view(), (weight, Some(&bias)), epilogue, (first, y), &mut scratch);
                }
                y.check_gaps();
                bits(&y.to_vec())
            };
            assert!(found(step) == found(after.max(1)), "{p:?} in pieces of {step} at {isa}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn equals_its_sums(p in problem()) {
            check::<f32>(p);
            check::<f64>(p);
        }

        #[test]
        fn pieces_have_the_bits_of_the_whole(p in problem(), which in 0_usize..3, rate in prop_oneof![Just(None), Just(Some(0.2))], cuts in 1_usize..5) {
            let activation = [Activation::Identity, Activation::LeakyRelu { slope: 0.01 }, Activation::Tanh][which];
            let epilogue = Epilogue { activation, dropout: rate.map(|rate| Mask::new(Stream::new(p.seed, 1, 2, 3), rate)) };
            check_pieces::<f32>(p, epilogue, cuts * CUT);
            check_pieces::<f64>(p, epilogue, cuts * CUT);
        }

        #[test]
        fn backward_is_the_adjoint(p in problem()) {
            let Problem { geometry, rows, inputs, outputs, seed } = p;
            let after = geometry.output_rows(rows);
            let (x, dz) = (numbers::<f64>(seed, rows * inputs), numbers::<f64>(seed + 1, after * outputs));
            let weight = numbers::<f64>(seed + 2, geometry.taps * inputs * outputs);
            for isa in InstructionSet::available() {
                let mut scratch = vec![f64::NAN; scratch_len(geometry, inputs, outputs)];
                let (mut y, mut dx) = (vec![f64::NAN; dz.len()], vec![f64::NAN; x.len()]);
                let x_view = Rows::packed(&x, rows, inputs);
                forward(isa, geometry, x_view, (Weight::Plain(&weight), None), Epilogue::NONE, RowsMut::packed(&mut y, after, outputs), &mut scratch);
                let dx_view = RowsMut::packed(&mut dx, rows, inputs);
                backward_input(isa, geometry, Rows::packed(&dz, after, outputs), Weight::Plain(&weight), dx_view, Write::Set, &mut scratch);
                assert_near("<Ax, y> and <x, A'y>", &[inner(&y, &dz)], &[inner(&x, &dx)], Tolerance::Close);
            }
        }
    }

    #[test]
    fn sizes_of_the_network() {
        for (rows, taps, pad) in [(500, 5, 3), (502, 3, 0), (125, 5, 3)] {
            let geometry = Geometry { taps, left: pad, right: pad };
            let problem = Problem { geometry, rows, inputs: 64, outputs: 64, seed: 1 };
            check::<f32>(problem);
            check_pieces::<f32>(problem, Epilogue { activation: Activation::Tanh, dropout: None }, 5 * CUT);
        }
    }

    #[test]
    fn one_tap_is_a_linear_map() {
        let geometry = Geometry { taps: 1, left: 0, right: 0 };
        let (x, weight) = (Matrix::<f64>::random(1, (30, 7)), numbers::<f64>(2, 7 * 9));
        let (mut conv, mut map) = (Matrix::<f64>::poisoned(1, (30, 9)), Matrix::<f64>::poisoned(2, (30, 9)));
        let mut scratch = vec![0.0; scratch_len(geometry, 7, 9).max(linear::scratch_len(30, 7, 9))];
        // The linear map keeps its weight the other way round.
        let turned: Vec<f64> = (0..7 * 9).map(|at| weight[at % 9 * 7 + at / 9]).collect();
        forward(
            InstructionSet::PLAIN,
            geometry,
            x.view(),
            (Weight::Plain(&turned), None),
            Epilogue::NONE,
            conv.view_mut(),
            &mut scratch,
        );
        linear::forward(InstructionSet::PLAIN, x.view(), &weight, None, map.view_mut(), &mut scratch);
        assert_near("conv1d with one tap", &conv.to_vec(), &map.to_vec(), Tolerance::Exact);
    }

    #[test]
    fn six_points_round_no_more_than_they_say() {
        let (rows, channels) = (500, 64);
        let x = numbers::<f64>(1, rows * channels).iter().map(|x| f64::from(*x as f32)).collect::<Vec<_>>();
        let single: Vec<f32> = x.iter().map(|x| *x as f32).collect();
        for taps in [3, 5] {
            let geometry = Geometry { taps, left: taps / 2, right: taps / 2 };
            let weight: Vec<f32> = numbers(2, taps * channels * channels);
            let exact: Vec<f64> = weight.iter().map(|w| f64::from(*w)).collect();
            let mut z = vec![0.0; rows * channels];
            reference::conv1d(geometry, Rows::packed(&x, rows, channels), &exact, None, RowsMut::packed(&mut z, rows, channels));
            for isa in InstructionSet::available() {
                let (mut y, mut scratch) =
                    (vec![f32::NAN; rows * channels], vec![f32::NAN; scratch_len(geometry, channels, channels)]);
                let (x, to) = (Rows::packed(&single, rows, channels), RowsMut::packed(&mut y, rows, channels));
                forward(isa, geometry, x, (Weight::Plain(&weight), None), Epilogue::NONE, to, &mut scratch);
                let squares = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(|x| x * x).sum::<f64>().sqrt();
                let error = squares(&mut y.iter().zip(&z).map(|(y, z)| f64::from(*y) - z)) / squares(&mut z.iter().copied());
                println!("{taps} taps, level {isa}: {error:.1e} of the root mean square");
                assert!(error <= winograd::ROUNDING, "{taps} taps, level {isa}: {error:e}");
            }
        }
    }
}
