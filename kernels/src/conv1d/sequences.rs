//! Some sequences of the same length through one convolution at once, where it goes the shorter way of `winograd`: the weight is read once, tiles are
//! full although each sequence is short, and the gradient of the weight is turned back from its points once for all.
//!
//! ```text
//! y_s = dropout(f(conv(x_s) + b)),   dx_s {=, +=} the adjoint of dz_s,   dW {=, +=} Σ_s of the gradients of each
//! ```
//!
//! y and dx of a sequence have the bits that it has alone. Not here: the sums themselves, and convolutions that go the long way, which would gain
//! nothing.

use super::epilogue::{Epilogue, Finish};
use super::packing::panels;
use super::{Geometry, Weight, ends_len, winograd};
use crate::activation::Activation;
use crate::dropout::Mask;
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{Pair, Sink, Store};
use crate::{Real, Rows, RowsMut, Write};
use winograd::Extent;

/// Whether a convolution of these sizes takes some sequences at once.
pub const fn applies(geometry: Geometry, inputs: usize, outputs: usize) -> bool {
    winograd::applies(geometry, inputs, outputs)
}

/// What becomes of one sequence.
pub struct Output<'a, T> {
    /// y, or rows of it.
    pub y: RowsMut<'a, T>,
    /// Dropout of f(z); element (t, o) of the mask. All sequences have one, with the same share that is dropped, or none has.
    pub dropout: Option<Mask>,
}

/// y of each sequence x `[n, in]`, all with the same weight, bias `[out]` and activation.
///
/// # Panics
/// If shapes disagree, or [`applies`] says no.
pub fn forward<'a, T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    xs: &'a [Rows<'a, T>],
    weight: (Weight<'a, T>, Option<&'a [T]>),
    activation: Activation,
    ys: &'a mut [Output<'a, T>],
    scratch: &'a mut [T],
) {
    for (x, Output { y, .. }) in xs.iter().zip(&*ys) {
        assert_eq!(y.rows(), geometry.output_rows(x.rows()), "conv1d: rows of y");
    }
    forward_rows(isa, geometry, xs, weight, activation, (0, ys), scratch);
}

/// Rows `first…` of what [`forward`] gives, as many as each y has.
pub(super) fn forward_rows<'a, T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    xs: &'a [Rows<'a, T>],
    (weight, bias): (Weight<'a, T>, Option<&'a [T]>),
    activation: Activation,
    (first, ys): (usize, &'a mut [Output<'a, T>]),
    scratch: &'a mut [T],
) {
    assert_eq!(xs.len(), ys.len(), "conv1d: sequences");
    let (Some(x), Some(Output { y, dropout })) = (xs.first(), ys.first()) else { return };
    let (sizes, rows) = ((x.cols(), y.cols()), y.rows());
    assert!(applies(geometry, sizes.0, sizes.1), "conv1d: sequences of {sizes:?} channels go one by one");
    assert!(xs.iter().all(|other| (other.rows(), other.cols()) == (x.rows(), sizes.0)), "conv1d: rows of x");
    assert!(ys.iter().all(|other| (other.y.rows(), other.y.cols()) == (rows, sizes.1)), "conv1d: rows of y");
    assert!(ys.iter().all(|other| other.dropout.map(Mask::scale) == dropout.map(Mask::scale)), "conv1d: shares that are dropped");
    assert!(first + rows <= geometry.output_rows(x.rows()), "conv1d: rows of y");
    assert!(bias.is_none_or(|bias| bias.len() == sizes.1), "conv1d: length of the bias");
    let epilogue = Epilogue { activation, dropout: *dropout };
    let (packed, scratch) = panels(isa, geometry, sizes, (weight, false), scratch);
    T::conv1d_forward_sequences(isa, ForwardSequences { geometry, xs, packed, bias, epilogue, first, ys, scratch });
}

pub(crate) struct ForwardSequences<'a, T> {
    geometry: Geometry,
    xs: &'a [Rows<'a, T>],
    packed: &'a [T],
    bias: Option<&'a [T]>,
    /// Of the first sequence.
    epilogue: Epilogue,
    first: usize,
    ys: &'a mut [Output<'a, T>],
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for ForwardSequences<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry: Geometry { taps, left, .. }, xs, bias, epilogue, first, ys, .. } = self;
        let (rows, inputs, outputs) = (ys[0].y.rows(), xs[0].cols(), ys[0].y.cols());
        let packed = &self.packed[..winograd::packed_len(inputs, outputs)];
        let extent = Extent { sequences: xs.len(), rows, inputs };
        let mut sinks = Finishes { first, ys, bias, epilogue, scale: epilogue.scale() };
        winograd::product::<T, I, _, _, MR, NR>(taps, &Shifted { xs, left, first }, extent, packed, &mut sinks, self.scratch);
    }
}

/// Row s ↦ x[clamp(first + s − left)].
struct Shifted<'a, T> {
    xs: &'a [Rows<'a, T>],
    left: usize,
    first: usize,
}

impl<T> winograd::Sequences<T> for Shifted<'_, T> {
    #[inline(always)]
    fn row(&self, sequence: usize, s: usize) -> &[T] {
        let x = &self.xs[sequence];
        x.row((self.first + s).saturating_sub(self.left).min(x.rows() - 1))
    }
}

/// What is the same for all sequences lies here by value: the compiler then decides once, outside of the loops, what is done with sums.
struct Finishes<'a, 'b, T> {
    first: usize,
    ys: &'b mut [Output<'a, T>],
    bias: Option<&'b [T]>,
    epilogue: Epilogue,
    scale: T,
}

impl<T: Real> winograd::Sinks<T> for Finishes<'_, '_, T> {
    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, sequence: usize, i: usize, j: usize, sums: Pair<T, I>) {
        let Self { first, bias, epilogue, scale, .. } = *self;
        let Output { y, dropout } = &mut self.ys[sequence];
        let epilogue = Epilogue { dropout: epilogue.dropout.and(*dropout), ..epilogue };
        Finish { first, y: y.reborrow(), bias, epilogue, scale }.store_whole::<I, NR>(i, j, sums);
    }
}

/// dx {=, +=} the adjoint of the convolution and of its padding, applied to dz, for each sequence.
///
/// # Panics
/// If shapes disagree, or [`applies`] says no.
pub fn backward_input<'a, T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    dzs: &'a [Rows<'a, T>],
    weight: Weight<'a, T>,
    dxs: &'a mut [RowsMut<'a, T>],
    write: Write,
    scratch: &'a mut [T],
) {
    assert_eq!(dzs.len(), dxs.len(), "conv1d: sequences");
    let (Some(dz), Some(dx)) = (dzs.first(), dxs.first()) else { return };
    let (n, inputs, outputs) = (dx.rows(), dx.cols(), dz.cols());
    assert!(applies(geometry, inputs, outputs), "conv1d: sequences of {inputs} and {outputs} channels go one by one");
    let after = geometry.output_rows(n);
    assert!(dzs.iter().all(|other| (other.rows(), other.cols()) == (after, outputs)), "conv1d: rows of dz");
    assert!(dxs.iter().all(|other| (other.rows(), other.cols()) == (n, inputs)), "conv1d: rows of dx");
    let (ends, rest) = scratch.split_at_mut(ends_len(dzs.len(), geometry, inputs, outputs));
    let (packed, scratch) = panels(isa, geometry, (inputs, outputs), (weight, true), rest);
    T::conv1d_backward_input_sequences(isa, BackwardInputSequences { geometry, dzs, packed, dxs, write, ends, scratch });
}

pub(crate) struct BackwardInputSequences<'a, T> {
    geometry: Geometry,
    dzs: &'a [Rows<'a, T>],
    packed: &'a [T],
    dxs: &'a mut [RowsMut<'a, T>],
    write: Write,
    /// A row of zeros, and the gradients of the padded rows of each sequence.
    ends: &'a mut [T],
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for BackwardInputSequences<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry: Geometry { taps, left, right }, dzs, dxs, write, .. } = self;
        let (n, inputs, outputs) = (dxs[0].rows(), dxs[0].cols(), dzs[0].cols());
        if n == 0 {
            return;
        }
        let (zeros, ends) = self.ends.split_at_mut(outputs);
        zeros.fill(T::ZERO);
        let packed = &self.packed[..winograd::packed_len(outputs, inputs)];
        let extent = Extent { sequences: dzs.len(), rows: n + left + right, inputs: outputs };
        let x = Reversed { dzs, zeros, taps };
        let mut sinks = Padded { left, n, write, dxs: &mut *dxs, ends: &mut *ends };
        winograd::product::<T, I, _, _, MR, NR>(taps, &x, extent, packed, &mut sinks, self.scratch);
        for (end, place) in ends.chunks_exact(inputs).zip(0..) {
            let (sequence, s) = (place / (left + right), place % (left + right));
            let target = dxs[sequence].row_mut(if s < left { 0 } else { n - 1 });
            target.iter_mut().zip(end).for_each(|(d, e)| *d += *e);
        }
    }
}

/// Row s ↦ dz[s − taps + 1], or zeros outside dz; the taps of the adjoint are in reverse.
struct Reversed<'a, T> {
    dzs: &'a [Rows<'a, T>],
    zeros: &'a [T],
    taps: usize,
}

impl<T> winograd::Sequences<T> for Reversed<'_, T> {
    #[inline(always)]
    fn row(&self, sequence: usize, s: usize) -> &[T] {
        // Before the first row the difference wraps to a huge number.
        let (dz, t) = (&self.dzs[sequence], s.wrapping_sub(self.taps - 1));
        if t < dz.rows() { dz.row(t) } else { self.zeros }
    }
}

/// Rows of padded sequences, sent to the sequence or to its padding.
struct Padded<'a, 'b, T> {
    left: usize,
    n: usize,
    write: Write,
    dxs: &'b mut [RowsMut<'a, T>],
    /// `[sequence][padded row][in]`
    ends: &'b mut [T],
}

impl<T: Real> winograd::Sinks<T> for Padded<'_, '_, T> {
    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, sequence: usize, i: usize, j: usize, sums: Pair<T, I>) {
        let Self { left, n, .. } = *self;
        let dx = &mut self.dxs[sequence];
        if (left..left + n).contains(&i) {
            let mut store = Store { c: dx.reborrow(), bias: None, write: self.write };
            return store.store_whole::<I, NR>(i - left, j, sums);
        }
        let inputs = dx.cols();
        let padded = self.ends.len() / inputs / self.dxs.len();
        let place = sequence * padded + if i < left { i } else { i - n };
        let end = RowsMut::packed(&mut self.ends[place * inputs..][..inputs], 1, inputs);
        Store { c: end, bias: None, write: Write::Set }.store_whole::<I, NR>(0, j, sums);
    }
}

/// dW {=, +=} `Σ_s Σ_t dz_s[t, o]·x_s[clamp(t + j − left), c]`.
///
/// # Panics
/// If shapes disagree, or [`applies`] says no.
pub fn backward_weight<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    xs: &[Rows<'_, T>],
    dzs: &[Rows<'_, T>],
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    assert_eq!(xs.len(), dzs.len(), "conv1d: sequences");
    let (Some(x), Some(dz)) = (xs.first(), dzs.first()) else { return };
    let (inputs, outputs) = (x.cols(), dz.cols());
    assert!(applies(geometry, inputs, outputs), "conv1d: sequences of {inputs} and {outputs} channels go one by one");
    let after = geometry.output_rows(x.rows());
    assert!(xs.iter().all(|other| (other.rows(), other.cols()) == (x.rows(), inputs)), "conv1d: rows of x");
    assert!(dzs.iter().all(|other| (other.rows(), other.cols()) == (after, outputs)), "conv1d: rows of dz");
    assert_eq!(dweight.len(), geometry.taps * inputs * outputs, "conv1d: length of the weight's gradient");
    T::conv1d_backward_weight_sequences(isa, BackwardWeightSequences { geometry, xs, dzs, dweight, write, scratch });
}

pub(crate) struct BackwardWeightSequences<'a, T> {
    geometry: Geometry,
    xs: &'a [Rows<'a, T>],
    dzs: &'a [Rows<'a, T>],
    dweight: &'a mut [T],
    write: Write,
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for BackwardWeightSequences<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry: Geometry { taps, left, .. }, xs, dzs, dweight, write, scratch } = self;
        if dzs[0].rows() == 0 {
            if write == Write::Set {
                dweight.fill(T::ZERO);
            }
            return;
        }
        let x = Shifted { xs, left, first: 0 };
        winograd::weight_gradient::<T, I, _, MR, NR>(taps, &x, xs[0].cols(), dzs, (dweight, write), scratch);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{self as conv1d, scratch_len, scratch_len_of};
    use super::*;
    use crate::random::Stream;
    use crate::reference;
    use crate::testing::{Matrix, assert_near, bits, numbers};
    use crate::tolerance::Tolerance;

    /// Sequences, kernel length, rows, and channels in panels.
    fn problem() -> impl Strategy<Value = (usize, Geometry, usize, [usize; 2], u64)> {
        let geometry = (prop_oneof![Just(3_usize), Just(5)], 0_usize..4, 0_usize..4);
        let geometry = geometry.prop_map(|(taps, left, right)| Geometry { taps, left, right });
        (1_usize..5, geometry, 0_usize..90, [1_usize..3, 1_usize..3], 0_u64..1000)
    }

    fn check<T: Real>(sequences: usize, geometry: Geometry, rows: usize, panels: [usize; 2], seed: u64) {
        let [inputs, outputs] = panels.map(|panels| 32 * panels);
        let after = geometry.output_rows(rows);
        let of = |offset: u64, shape| (0..sequences as u64).map(move |one| Matrix::<T>::random(seed + offset + 10 * one, shape));
        let xs: Vec<Matrix<T>> = of(0, (rows, inputs)).collect();
        let dzs: Vec<Matrix<T>> = of(5, (after, outputs)).collect();
        let weight = numbers::<T>(seed + 1, geometry.taps * inputs * outputs);
        let bias = numbers::<T>(seed + 2, outputs);
        let epilogue = |sequence: usize| Epilogue {
            activation: Activation::LeakyRelu { slope: 0.01 },
            dropout: Some(Mask::new(Stream::new(seed, 1, 2, sequence as u64), 0.2)),
        };
        let views: Vec<Rows<'_, T>> = xs.iter().map(Matrix::view).collect();
        let dz_views: Vec<Rows<'_, T>> = dzs.iter().map(Matrix::view).collect();
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len_of(sequences, geometry, inputs, outputs)];
            let mut alone = vec![T::NAN; scratch_len(geometry, inputs, outputs)];
            let mut ys: Vec<Matrix<T>> = (0..sequences).map(|_| Matrix::poisoned(seed, (after, outputs))).collect();
            let targets = ys.iter_mut().enumerate();
            let mut targets: Vec<Output<'_, T>> =
                targets.map(|(sequence, y)| Output { y: y.view_mut(), dropout: epilogue(sequence).dropout }).collect();
            let of_weight = (Weight::Plain(weight.as_slice()), Some(bias.as_slice()));
            forward(isa, geometry, &views, of_weight, epilogue(0).activation, &mut targets, &mut scratch);
            let mut dxs: Vec<Matrix<T>> = of(7, (rows, inputs)).collect();
            let mut dx_alone = dxs.clone();
            let mut targets: Vec<RowsMut<'_, T>> = dxs.iter_mut().map(Matrix::view_mut).collect();
            backward_input(isa, geometry, &dz_views, Weight::Plain(&weight), &mut targets, Write::Add, &mut scratch);
            for sequence in 0..sequences {
                let mut y = Matrix::<T>::poisoned(seed, (after, outputs));
                conv1d::forward(isa, geometry, views[sequence], of_weight, epilogue(sequence), y.view_mut(), &mut alone);
                assert_eq!(bits(&ys[sequence].to_vec()), bits(&y.to_vec()), "y {sequence} at {isa}");
                let (dz, dx) = (dz_views[sequence], dx_alone[sequence].view_mut());
                conv1d::backward_input(isa, geometry, dz, Weight::Plain(&weight), dx, Write::Add, &mut alone);
                assert_eq!(bits(&dxs[sequence].to_vec()), bits(&dx_alone[sequence].to_vec()), "dx {sequence} at {isa}");
            }
            for write in [Write::Set, Write::Add] {
                let mut dw = numbers::<T>(seed + 3, weight.len());
                let mut expected = if write == Write::Add { dw.clone() } else { vec![T::ZERO; dw.len()] };
                backward_weight(isa, geometry, &views, &dz_views, &mut dw, write, &mut scratch);
                for (x, dz) in views.iter().zip(&dz_views) {
                    let mut own = vec![T::ZERO; dw.len()];
                    reference::conv1d_backward_weight(geometry, *x, *dz, &mut own);
                    expected.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
                }
                assert_near(&format!("dW at {isa}"), &dw, &expected, Tolerance::Close);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn sequences_at_once_have_the_bits_of_each_alone((sequences, geometry, rows, panels, seed) in problem()) {
            check::<f32>(sequences, geometry, rows, panels, seed);
            check::<f64>(sequences, geometry, rows, panels, seed);
        }
    }

    #[test]
    fn those_of_short_histories() {
        for rows in [16, 32, 64] {
            check::<f32>(4, Geometry { taps: 5, left: 3, right: 3 }, rows, [2, 2], 1);
        }
    }
}
