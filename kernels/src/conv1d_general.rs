//! One-dimensional convolution of a channels-last sequence with a stride, a dilation, and zeros or the sequence itself, once
//! around, beyond its ends.
//!
//! ```text
//! z[t, o] = b[o] + Σ_{c,j} W[o, c, j]·x[t·stride + j·dilation − left, c],   t = 0 … rows − 1,   y = dropout(f(z))
//! ```
//!
//! x `[n, in]`, W `[out, in, taps]` as PyTorch stores it, y `[rows, out]`. The number of rows is free, and `left` may be negative:
//! a causal network of which only the last row is wanted computes just the rows that reach it. Neither a padded nor an unfolded
//! sequence is made; the product reads rows of x where they lie. The backward pass of the epilogue is that of `conv1d`.
//!
//! ```text
//! dx[s, c] = Σ_{o,j} dz[(s + left − j·dilation)/stride, o]·W[o, c, j] over the taps j for which the quotient is whole
//! dW[o, c, j] = Σ_t dz[t, o]·x[t·stride + j·dilation − left, c],   db = Σ_t dz
//! ```
//!
//! Rows s of one remainder by the stride share their taps; so dx is one product for each remainder, none of it on zeros.

use crate::activation::{self, Activation};
use crate::conv1d::Epilogue;
pub use crate::conv1d::Weight;
use crate::dropout::Mask;
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, LeftRows, Sink, Store};
use crate::{Real, Rows, RowsMut, Write};

mod packing;

pub(crate) use packing::Pack;
pub use packing::{pack, pack_adjoint, packed_len};

/// What lies beyond the ends of x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Zeros.
    Zero,
    /// x again, once around; for stride 1 only.
    Circular,
}

/// Kernel length, steps, place and ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Kernel length.
    pub taps: usize,
    /// Rows of x from one row of y to the next.
    pub stride: usize,
    /// Rows of x from one tap to the next.
    pub dilation: usize,
    /// Rows before x that the first tap of the first row of y reads; negative: it begins inside x.
    pub left: isize,
    /// Rows of y.
    pub rows: usize,
    /// What lies beyond the ends.
    pub ends: Ends,
}

impl Geometry {
    /// As many rows as PyTorch's Conv1d gives for n = `rows` rows with `padding` on both sides; 0 if the kernel does not fit.
    pub const fn padded(taps: usize, stride: usize, dilation: usize, padding: usize, rows: usize, ends: Ends) -> Self {
        let reach = dilation * taps.saturating_sub(1) + 1;
        let whole = rows + 2 * padding;
        let rows = if rows == 0 || whole < reach { 0 } else { (whole - reach) / stride + 1 };
        Self { taps, stride, dilation, left: padding.cast_signed(), rows, ends }
    }

    /// The last `rows` rows, `stride` apart, of a causal convolution: the last tap of the last row reads row n − 1 of x.
    pub const fn causal(taps: usize, stride: usize, dilation: usize, n: usize, rows: usize) -> Self {
        let last = (rows.saturating_sub(1) * stride + taps.saturating_sub(1) * dilation).cast_signed();
        Self { taps, stride, dilation, left: last + 1 - n.cast_signed(), rows, ends: Ends::Zero }
    }

    /// Whether steps are positive and, on a circle, the kernel reaches around at most once.
    pub const fn is_sound(self, n: usize) -> bool {
        let behind = (self.rows + self.dilation * self.taps).cast_signed() - self.left;
        let once = n > 0 && self.stride == 1 && self.left >= 0 && self.left <= n.cast_signed() && behind <= 2 * n.cast_signed();
        self.taps > 0 && self.stride > 0 && self.dilation > 0 && (matches!(self.ends, Ends::Zero) || once)
    }

    /// Row `at` of n, if there is one there.
    #[inline(always)]
    fn row(self, at: isize, n: usize) -> Option<usize> {
        let n = n.cast_signed();
        let at = match self.ends {
            Ends::Zero => at,
            Ends::Circular if at < 0 => at + n,
            Ends::Circular if at >= n => at - n,
            Ends::Circular => at,
        };
        (at >= 0 && at < n).then_some(at.cast_unsigned())
    }

    /// Row of x that tap `tap` of row `t` of y reads; none where there are zeros.
    #[inline(always)]
    pub fn source(self, t: usize, tap: usize, n: usize) -> Option<usize> {
        self.row((t * self.stride + tap * self.dilation).cast_signed() - self.left, n)
    }

    /// Row s = `remainder` of x is read by tap j as that of row `reader(s, j)/stride` of y, if the division leaves nothing.
    #[inline(always)]
    const fn reader(self, remainder: usize, tap: usize) -> isize {
        remainder.cast_signed() + self.left - (tap * self.dilation).cast_signed()
    }

    /// The taps that read rows `remainder + q·stride` of x.
    #[inline(always)]
    fn reading(self, remainder: usize) -> impl Iterator<Item = usize> + Clone {
        (0..self.taps).filter(move |j| self.reader(remainder, *j).rem_euclid(self.stride.cast_signed()) == 0)
    }
}

/// Scratch, in numbers, that any function of this file needs.
pub fn scratch_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    let forward = packed_len(geometry, inputs, outputs) + inputs;
    let input = packed_len(geometry, outputs, inputs) + outputs;
    forward.max(input).max(geometry.taps * inputs * outputs)
}

fn check(geometry: Geometry, n: usize, rows: usize) {
    assert!(geometry.is_sound(n) || rows == 0, "conv1d_general: {geometry:?} on {n} rows");
    assert_eq!(rows, geometry.rows, "conv1d_general: rows of y");
}

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
    check(geometry, x.rows(), y.rows());
    assert!(bias.is_none_or(|bias| bias.len() == y.cols()), "conv1d_general: length of the bias");
    let (zeros, scratch) = scratch.split_at_mut(x.cols());
    zeros.fill(T::ZERO);
    let sizes = (x.cols(), y.cols());
    let (packed, _) = weight.panels(packed_len(geometry, sizes.0, sizes.1), scratch, |weight, packed| {
        pack(isa, geometry, sizes, weight, packed);
    });
    T::conv1d_general_forward(isa, Forward { left: Sources { geometry, x, zeros }, packed, bias, epilogue, y });
}

pub(crate) struct Forward<'a, T> {
    left: Sources<'a, T>,
    packed: &'a [T],
    bias: Option<&'a [T]>,
    epilogue: Epilogue,
    y: RowsMut<'a, T>,
}

impl<T: Real> Tiled<T> for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { left, packed, bias, epilogue, y } = self;
        let outputs = y.cols();
        if y.rows() == 0 {
            return;
        }
        let panels = &packed[..left.geometry.taps * left.x.cols() * outputs.next_multiple_of(NR)];
        let scale = T::of(epilogue.dropout.map_or(1.0, Mask::scale));
        tile::rows::<T, I, _, _, MR, NR>(&left, outputs, panels, &mut Finish { y, bias, epilogue, scale });
    }
}

/// Row t of y, tap j ↦ the row of x it reads, or zeros.
struct Sources<'a, T> {
    geometry: Geometry,
    x: Rows<'a, T>,
    zeros: &'a [T],
}

impl<T> LeftRows<T> for Sources<'_, T> {
    #[inline(always)]
    fn rows(&self) -> usize {
        self.geometry.rows
    }
    #[inline(always)]
    fn taps(&self) -> usize {
        self.geometry.taps
    }
    #[inline(always)]
    fn depth(&self) -> usize {
        self.x.cols()
    }
    #[inline(always)]
    fn piece(&self, i: usize, tap: usize) -> &[T] {
        self.geometry.source(i, tap, self.x.rows()).map_or(self.zeros, |row| self.x.row(row))
    }
}

/// y = dropout(f(sums + b)).
struct Finish<'a, T> {
    y: RowsMut<'a, T>,
    bias: Option<&'a [T]>,
    epilogue: Epilogue,
    scale: T,
}

impl<T: Real> Sink<T> for Finish<'_, T> {
    #[inline(always)]
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]) {
        let y = &mut self.y.row_mut(i)[j..][..sums.len()];
        match self.bias {
            Some(bias) => y.iter_mut().zip(sums).zip(&bias[j..]).for_each(|((y, s), b)| *y = *s + *b),
            None => y.copy_from_slice(sums),
        }
        if let Activation::LeakyRelu { slope } = self.epilogue.activation {
            // A kept zero is −0, a dropped element +0, as `conv1d` tells them apart.
            let slope = T::of(slope);
            y.iter_mut().for_each(|y| *y = if *y > T::ZERO { *y } else { -(slope * y.abs()) });
        } else {
            activation::map::<T, I>(self.epilogue.activation, y);
        }
        if let Some(mask) = self.epilogue.dropout {
            let mask = mask.row(i);
            y.iter_mut().enumerate().for_each(|(c, y)| *y = if mask.keeps(j + c) { *y * self.scale } else { T::ZERO });
        }
    }
}

/// dx {=, +=} the adjoint of the convolution, applied to dz.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    dz: Rows<'_, T>,
    weight: Weight<'_, T>,
    dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    check(geometry, dx.rows(), dz.rows());
    let (zeros, scratch) = scratch.split_at_mut(dz.cols());
    zeros.fill(T::ZERO);
    let sizes = (dx.cols(), dz.cols());
    let (packed, _) = weight.panels(packed_len(geometry, sizes.1, sizes.0), scratch, |weight, packed| {
        pack_adjoint(isa, geometry, sizes, weight, packed);
    });
    T::conv1d_general_backward_input(isa, BackwardInput { geometry, dz, zeros, packed, dx, write });
}

pub(crate) struct BackwardInput<'a, T> {
    geometry: Geometry,
    dz: Rows<'a, T>,
    zeros: &'a [T],
    packed: &'a [T],
    dx: RowsMut<'a, T>,
    write: Write,
}

impl<T: Real> Tiled<T> for BackwardInput<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(mut self) {
        let Self { geometry, dz, zeros, .. } = self;
        let (n, inputs, outputs) = (self.dx.rows(), self.dx.cols(), dz.cols());
        let mut packed = self.packed;
        for remainder in 0..geometry.stride.min(n) {
            // Row remainder + q·stride reads row q + reader/stride of dz.
            let mut reading = geometry.reading(remainder);
            let taps = reading.clone().count();
            let mut row = || reading.next().map_or(0, |j| geometry.reader(remainder, j) / geometry.stride.cast_signed());
            let (first, next) = (row(), row());
            let rows = (n - remainder).div_ceil(geometry.stride);
            let reversed = Reversed { dz, zeros, taps, first, step: first - next, rows, ends: geometry.ends };
            let (panels, rest) = packed.split_at(taps * outputs * inputs.next_multiple_of(NR));
            packed = rest;
            let mut sink = Store { c: self.dx.reborrow().every(remainder, geometry.stride), bias: None, write: self.write };
            tile::rows::<T, I, _, _, MR, NR>(&reversed, inputs, panels, &mut sink);
        }
    }
}

/// Row q, tap i ↦ row q + first − i·step of dz, or zeros.
struct Reversed<'a, T> {
    dz: Rows<'a, T>,
    zeros: &'a [T],
    taps: usize,
    first: isize,
    step: isize,
    rows: usize,
    ends: Ends,
}

impl<T> LeftRows<T> for Reversed<'_, T> {
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
        self.dz.cols()
    }
    #[inline(always)]
    fn piece(&self, i: usize, tap: usize) -> &[T] {
        let mut t = i.cast_signed() + self.first - tap.cast_signed() * self.step;
        let n = self.rows.cast_signed();
        if self.ends == Ends::Circular {
            t += if t < 0 { n } else { 0 };
            t -= if t >= n { n } else { 0 };
        }
        if t >= 0 && t < self.dz.rows().cast_signed() { self.dz.row(t.cast_unsigned()) } else { self.zeros }
    }
}

/// dW {=, +=} `Σ_t dz[t, o]·x[t·stride + j·dilation − left, c]`, of one sequence or summed over several of the same shape.
///
/// # Panics
/// If shapes disagree.
pub fn backward_weight<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    sequences: &[(Rows<'_, T>, Rows<'_, T>)],
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    let (inputs, outputs) = sequences.first().map_or((0, 0), |(x, dz)| (x.cols(), dz.cols()));
    let taps = geometry.taps;
    assert_eq!(dweight.len(), taps * inputs * outputs, "conv1d_general: length of the weight's gradient");
    let gradient = &mut scratch[..dweight.len()];
    gradient.fill(T::ZERO);
    for &(x, dz) in sequences {
        check(geometry, x.rows(), dz.rows());
        assert_eq!((x.cols(), dz.cols()), (inputs, outputs), "conv1d_general: channels of the sequences");
        T::conv1d_general_backward_weight(isa, BackwardWeight { geometry, x, dz, gradient });
    }
    // To the order of the weight once, whatever the number of sequences.
    for (o, target) in dweight.chunks_exact_mut((inputs * taps).max(1)).enumerate() {
        for (c, target) in target.chunks_exact_mut(taps).enumerate() {
            let source = gradient.iter().skip(c * outputs + o).step_by(inputs * outputs);
            match write {
                Write::Set => target.iter_mut().zip(source).for_each(|(d, s)| *d = *s),
                Write::Add => target.iter_mut().zip(source).for_each(|(d, s)| *d += *s),
            }
        }
    }
}

pub(crate) struct BackwardWeight<'a, T> {
    geometry: Geometry,
    x: Rows<'a, T>,
    dz: Rows<'a, T>,
    /// `[taps, in, out]`, added to.
    gradient: &'a mut [T],
}

impl<T: Real> Tiled<T> for BackwardWeight<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let (n, inputs, outputs) = (self.x.rows(), self.x.cols(), self.dz.cols());
        let geometry = self.geometry;
        let mut panel = [[T::ZERO; NR]; tile::COLUMN_DEPTH];
        for start in (0..geometry.rows).step_by(tile::COLUMN_DEPTH) {
            let end = geometry.rows.min(start + tile::COLUMN_DEPTH);
            for column in (0..outputs).step_by(NR) {
                let panel = &mut panel[..end - start];
                tile::pack_panel(&self.dz.range(start, end), column, panel);
                for (j, dw) in self.gradient.chunks_exact_mut((inputs * outputs).max(1)).enumerate() {
                    // The rows that read x at all lie together: in front and behind there are only zeros.
                    let reads = |t: &usize| geometry.source(*t, j, n).is_some();
                    let Some(first) = (start..end).find(reads) else { continue };
                    let last = (first..end).rev().find(reads).unwrap_or(first);
                    let mut sink = Store { c: RowsMut::packed(dw, inputs, outputs), bias: None, write: Write::Add };
                    let left = |p| self.x.row(geometry.source(first + p, j, n).unwrap_or_default());
                    let panel = &panel[first - start..=last - start];
                    tile::columns::<T, I, _, MR, NR>((left, inputs), panel, (column, NR.min(outputs - column)), &mut sink);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::conv1d;
    use crate::random::Stream;
    use crate::reference_peers as reference;
    use crate::testing::{Matrix, assert_near, check_writes, numbers};
    use crate::tolerance::Tolerance;

    #[derive(Clone, Copy, Debug)]
    struct Problem {
        geometry: Geometry,
        n: usize,
        inputs: usize,
        outputs: usize,
        seed: u64,
    }

    fn problem() -> impl Strategy<Value = Problem> {
        let sizes = (1_usize..8, 1_usize..5, 1_usize..9, -20_isize..20, 0_usize..200);
        (sizes, 0_usize..200, 1_usize..35, 1_usize..35, 0_u64..1000).prop_map(
            |((taps, stride, dilation, left, rows), n, inputs, outputs, seed)| {
                let zero = Geometry { taps, stride, dilation, left, rows, ends: Ends::Zero };
                let circle = Geometry { stride: 1, rows: n, left: left.abs(), ends: Ends::Circular, ..zero };
                let geometry = if seed % 3 == 0 && circle.is_sound(n) { circle } else { zero };
                Problem { geometry, n, inputs, outputs, seed }
            },
        )
    }

    fn check<T: Real>(p: Problem) {
        let Problem { geometry, n, inputs, outputs, seed } = p;
        let x = Matrix::<T>::random(seed, (n, inputs));
        let weight = numbers::<T>(seed + 1, geometry.taps * inputs * outputs);
        let bias = numbers::<T>(seed + 2, outputs);
        let dz = Matrix::<T>::random(seed + 3, (geometry.rows, outputs));
        let mut z = Matrix::<T>::poisoned(seed, (geometry.rows, outputs));
        reference::conv1d(geometry, x.view(), &weight, Some(&bias), z.view_mut());
        let mut dx = Matrix::<T>::poisoned(seed, (n, inputs));
        let mut dw = Matrix::<T>::poisoned(0, (1, weight.len()));
        reference::conv1d_backward(geometry, x.view(), &weight, dz.view(), dx.view_mut(), dw.view_mut().row_mut(0));
        for isa in InstructionSet::available() {
            let mut scratch = vec![T::NAN; scratch_len(geometry, inputs, outputs)];
            let mut y = Matrix::<T>::poisoned(seed, (geometry.rows, outputs));
            forward(isa, geometry, x.view(), (Weight::Plain(&weight), Some(&bias)), Epilogue::NONE, y.view_mut(), &mut scratch);
            y.check_gaps();
            assert_near(&format!("forward at {isa}"), &y.to_vec(), &z.to_vec(), Tolerance::Close);
            check_writes(&format!("dx at {isa}"), &dx, Tolerance::Close, |dx, write| {
                backward_input(isa, geometry, dz.view(), Weight::Plain(&weight), dx, write, &mut scratch);
            });
            check_writes(&format!("dW at {isa}"), &dw, Tolerance::Close, |mut dw, write| {
                backward_weight(isa, geometry, &[(x.view(), dz.view())], dw.row_mut(0), write, &mut scratch);
            });
            check_packed(isa, p, (&x, &weight, &bias, &dz), &y, &mut scratch);
        }
    }

    /// A weight that is packed beforehand gives the same bits, and two sequences give the sum of their gradients.
    fn check_packed<T: Real>(
        isa: InstructionSet,
        p: Problem,
        (x, weight, bias, dz): (&Matrix<T>, &[T], &[T], &Matrix<T>),
        y: &Matrix<T>,
        scratch: &mut [T],
    ) {
        let Problem { geometry, n, inputs, outputs, seed } = p;
        let mut packed = vec![T::NAN; packed_len(geometry, inputs, outputs)];
        pack(isa, geometry, (inputs, outputs), weight, &mut packed);
        let mut again = Matrix::<T>::poisoned(seed, (geometry.rows, outputs));
        let weights = (Weight::Packed(&packed[..]), Some(bias));
        forward(isa, geometry, x.view(), weights, Epilogue::NONE, again.view_mut(), scratch);
        assert_near("forward, packed", &again.to_vec(), &y.to_vec(), Tolerance::Exact);

        let mut packed = vec![T::NAN; packed_len(geometry, outputs, inputs)];
        pack_adjoint(isa, geometry, (inputs, outputs), weight, &mut packed);
        let [plain, packed] = [Weight::Plain(weight), Weight::Packed(&packed)].map(|weight| {
            let mut dx = Matrix::<T>::poisoned(seed, (n, inputs));
            backward_input(isa, geometry, dz.view(), weight, dx.view_mut(), Write::Set, scratch);
            dx.to_vec()
        });
        assert_near("dx, packed", &packed, &plain, Tolerance::Exact);

        let (other, other_dz) =
            (Matrix::<T>::random(seed + 4, (n, inputs)), Matrix::<T>::random(seed + 5, (geometry.rows, outputs)));
        let pairs = [(x.view(), dz.view()), (other.view(), other_dz.view())];
        let [mut both, mut one_by_one] = [(); 2].map(|()| vec![T::NAN; weight.len()]);
        backward_weight(isa, geometry, &pairs, &mut both, Write::Set, scratch);
        backward_weight(isa, geometry, &pairs[..1], &mut one_by_one, Write::Set, scratch);
        backward_weight(isa, geometry, &pairs[1..], &mut one_by_one, Write::Add, scratch);
        assert_near("dW of two sequences", &both, &one_by_one, Tolerance::Close);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn equals_its_sums(p in problem()) {
            check::<f32>(p);
            check::<f64>(p);
        }

        #[test]
        fn the_epilogue_is_that_of_conv1d(rows in 1_usize..40, channels in 1_usize..20, seed in 0_u64..1000) {
            let same = conv1d::Geometry { taps: 3, left: 0, right: 0 };
            let n = rows + 2;
            let geometry = Geometry::padded(3, 1, 1, 0, n, Ends::Zero);
            let (x, weight) = (Matrix::<f32>::random(seed, (n, channels)), numbers::<f32>(seed, 9 * channels));
            // conv1d keeps its weight as [taps, in, out].
            let turned: Vec<f32> = (0..9 * channels)
                .map(|at| (at / (3 * channels), at / 3 % channels, at % 3))
                .map(|(tap, input, output)| weight[(output * channels + input) * 3 + tap])
                .collect();
            for activation in [Activation::Relu, Activation::LeakyRelu { slope: 0.01 }, Activation::Tanh] {
                let epilogue = Epilogue { activation, dropout: Some(Mask::new(Stream::new(seed, 1, 2, 3), 0.3)) };
                for isa in InstructionSet::available() {
                    let mut scratch = vec![f32::NAN; scratch_len(geometry, channels, 3).max(conv1d::scratch_len(same, channels, 3))];
                    let [mut y, mut expected] = [(); 2].map(|()| Matrix::<f32>::poisoned(seed, (rows, 3)));
                    forward(isa, geometry, x.view(), (Weight::Plain(&weight), None), epilogue, y.view_mut(), &mut scratch);
                    conv1d::forward(isa, same, x.view(), (Weight::Plain(&turned), None), epilogue, expected.view_mut(), &mut scratch);
                    assert_near("conv1d and conv1d_general", &y.to_vec(), &expected.to_vec(), Tolerance::Exact);
                }
            }
        }
    }

    #[test]
    fn sizes_of_the_peers() {
        let causal = |n: usize, stride: usize, rows: usize| Geometry::causal(7, stride, 1, n, rows);
        for (geometry, n, inputs, outputs) in [
            (Geometry::padded(7, 2, 1, 3, 1000, Ends::Zero), 1000, 16, 32),
            (Geometry::padded(3, 2, 1, 1, 125, Ends::Zero), 125, 64, 128),
            (Geometry::padded(3, 1, 1, 1, 500, Ends::Circular), 500, 64, 64),
            (causal(1000, 2, 500), 1000, 30, 30),
            (causal(8, 1, 7), 8, 30, 30),
            (causal(7, 1, 1), 7, 30, 30),
        ] {
            check::<f32>(Problem { geometry, n, inputs, outputs, seed: 1 });
        }
        assert_eq!(Geometry::padded(3, 2, 1, 1, 125, Ends::Zero).rows, 63);
        assert_eq!(causal(1000, 1, 1000).left, 6);
    }
}
