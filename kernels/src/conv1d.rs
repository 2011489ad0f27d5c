//! One-dimensional convolution of a channels-last sequence, stride 1, ends padded by repeating the first and the last row.
//!
//! ```text
//! z[t, o] = b[o] + Σ_{c,j} W[j, c, o]·x[clamp(t + j − left, 0, n − 1), c],   t = 0 … n + left + right − taps
//! y = dropout(f(z))
//! ```
//!
//! (cross-correlation, as PyTorch's Conv1d after a replication pad). x `[n, in]`, y `[n′, out]`, W `[taps, in, out]`: the matrix of the
//! product, so that neither it nor its gradient is ever transposed (PyTorch keeps `[out, in, taps]`). The padded sequence is never made:
//! the product reads shifted rows of x where they lie. Only y is kept: for the leaky relu its sign tells the branch, and a
//! dropped element is told from a kept zero by the zero's sign (dropped +0, kept −0), so the backward pass of the epilogue
//! needs neither z nor a mask.
//!
//! ```text
//! dx̃[s, c] = Σ_{o,j} dz[s − j, o]·W[j, c, o] on the padded rows s, of which the ends fold into dx[0] and dx[n − 1]
//! dW[j, c, o] = Σ_t dz[t, o]·x[clamp(t + j − left), c],   db = Σ_t dz
//! ```

use crate::activation::{self, Activation};
use crate::dropout::Mask;
use crate::level::{Isa, Kernel, Level, Tiled};
use crate::tile::{self, LeftRows, Sink, Store};
use crate::{Real, Rows, RowsMut, Write, linear, rows};

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

/// What follows the convolution in the same pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epilogue {
    /// f; not gelu, whose derivative needs z.
    pub activation: Activation,
    /// Dropout of f(z); element (t, o) of the mask.
    pub dropout: Option<Mask>,
}

impl Epilogue {
    /// y = z.
    pub const NONE: Self = Self { activation: Activation::Identity, dropout: None };
}

/// Scratch, in numbers, that any function of this file needs.
pub fn scratch_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    let Geometry { left, right, .. } = geometry;
    let input = packed_len(geometry, outputs, inputs) + outputs + (left + right) * inputs;
    packed_len(geometry, inputs, outputs).max(input)
}

/// Numbers of a weight packed by [`pack`]; by [`pack_transposed`] with inputs and outputs exchanged.
pub const fn packed_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    tile::panels_len(geometry.taps * inputs, outputs)
}

/// A weight `[taps, in, out]`, as it is or as packed once for many calls.
#[derive(Clone, Copy, Debug)]
pub enum Weight<'a, T> {
    /// Packed by the call, in its scratch.
    Plain(&'a [T]),
    /// By [`pack`] for [`forward`], by [`pack_transposed`] for [`backward_input`], at the same level.
    Packed(&'a [T]),
}

/// Packs a weight for [`forward`].
///
/// # Panics
/// If lengths disagree.
pub fn pack<T: Real>(level: Level, geometry: Geometry, (inputs, outputs): (usize, usize), weight: &[T], packed: &mut [T]) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d: length of the weight");
    T::conv1d_pack(level, Pack { geometry, inputs, outputs, weight, packed, transposed: false });
}

/// Packs a weight for [`backward_input`].
///
/// # Panics
/// If lengths disagree.
pub fn pack_transposed<T: Real>(
    level: Level,
    geometry: Geometry,
    (inputs, outputs): (usize, usize),
    weight: &[T],
    packed: &mut [T],
) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d: length of the weight");
    T::conv1d_pack(level, Pack { geometry, inputs, outputs, weight, packed, transposed: true });
}

pub(crate) struct Pack<'a, T> {
    geometry: Geometry,
    inputs: usize,
    outputs: usize,
    weight: &'a [T],
    packed: &'a mut [T],
    transposed: bool,
}

impl<T: Real> Tiled<T> for Pack<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry: Geometry { taps, .. }, inputs, outputs, weight, packed, transposed } = self;
        if weight.is_empty() {
            return;
        }
        if !transposed {
            let panels = &mut packed[..taps * inputs * outputs.next_multiple_of(NR)];
            return tile::pack::<T, NR>(Rows::packed(weight, taps * inputs, outputs), panels);
        }
        let panels = &mut packed[..taps * outputs * inputs.next_multiple_of(NR)];
        for j in 0..taps {
            let row = |c: usize| &weight[(j * inputs + c) * outputs..][..outputs];
            tile::pack_transposed::<T, NR>(outputs, inputs, 1, row, taps * outputs * NR, &mut panels[j * outputs * NR..]);
        }
    }
}

/// y = dropout(f(conv(x) + b)).
///
/// # Panics
/// If shapes disagree.
pub fn forward<T: Real>(
    level: Level,
    geometry: Geometry,
    x: Rows<'_, T>,
    weight: Weight<'_, T>,
    bias: Option<&[T]>,
    epilogue: Epilogue,
    y: RowsMut<'_, T>,
    scratch: &mut [T],
) {
    assert_eq!(y.rows(), geometry.output_rows(x.rows()), "conv1d: rows of y");
    assert!(bias.is_none_or(|bias| bias.len() == y.cols()), "conv1d: length of the bias");
    let packed = match weight {
        Weight::Packed(packed) => packed,
        Weight::Plain(weight) => {
            pack(level, geometry, (x.cols(), y.cols()), weight, scratch);
            scratch
        }
    };
    T::conv1d_forward(level, Forward { geometry, x, packed, bias, epilogue, y });
}

pub(crate) struct Forward<'a, T> {
    geometry: Geometry,
    x: Rows<'a, T>,
    packed: &'a [T],
    bias: Option<&'a [T]>,
    epilogue: Epilogue,
    y: RowsMut<'a, T>,
}

impl<T: Real> Tiled<T> for Forward<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Geometry { taps, left, .. } = self.geometry;
        let (inputs, outputs) = (self.x.cols(), self.y.cols());
        let panels = &self.packed[..taps * inputs * outputs.next_multiple_of(NR)];
        let shifted = Shifted { x: self.x, taps, left, rows: self.y.rows() };
        let scale = T::of(self.epilogue.dropout.map_or(1.0, Mask::scale));
        let mut sink = Finish { y: self.y, bias: self.bias, epilogue: self.epilogue, scale };
        tile::rows::<T, I, _, _, MR, NR>(&shifted, outputs, panels, &mut sink);
    }
}

/// Output row t, tap j ↦ x[clamp(t + j − left)].
struct Shifted<'a, T> {
    x: Rows<'a, T>,
    taps: usize,
    left: usize,
    rows: usize,
}

impl<T> Shifted<'_, T> {
    #[inline(always)]
    fn source(&self, t: usize, j: usize) -> usize {
        (t + j).saturating_sub(self.left).min(self.x.rows() - 1)
    }
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
        self.x.row(self.source(i, tap))
    }
}

/// y = dropout(f(sums + b)).
struct Finish<'a, T> {
    y: RowsMut<'a, T>,
    bias: Option<&'a [T]>,
    epilogue: Epilogue,
    scale: T,
}

impl<T: Real> Finish<'_, T> {
    /// Row `i`, columns `j…` of z without its bias becomes y. The numbers are a variable of the caller's own, which nothing else can
    /// point to: only then do these loops become one pass over registers.
    #[inline(always)]
    fn apply<I: Isa>(&self, i: usize, j: usize, z: &mut [T]) {
        if let Some(bias) = self.bias {
            z.iter_mut().zip(&bias[j..]).for_each(|(z, b)| *z += *b);
        }
        if let Activation::LeakyRelu { slope } = self.epilogue.activation {
            let slope = T::of(slope);
            z.iter_mut().for_each(|z| *z = if *z > T::ZERO { *z } else { -(slope * z.abs()) });
        } else {
            activation::map::<T, I>(self.epilogue.activation, z);
        }
        if let Some(mask) = self.epilogue.dropout {
            let mask = mask.row(i);
            z.iter_mut().enumerate().for_each(|(c, z)| *z = if mask.keeps(j + c) { *z * self.scale } else { T::ZERO });
        }
    }
}

impl<T: Real> Sink<T> for Finish<'_, T> {
    #[inline(always)]
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]) {
        let mut z = [T::ZERO; tile::WIDEST];
        let z = &mut z[..sums.len()];
        z.copy_from_slice(sums);
        self.apply::<I>(i, j, z);
        self.y.row_mut(i)[j..][..z.len()].copy_from_slice(z);
    }

    #[inline(always)]
    fn store_whole<I: Isa, const NR: usize>(&mut self, i: usize, j: usize, sums: tile::Pair<T, I>) {
        let mut z = tile::unload::<T, I, NR>(sums);
        self.apply::<I>(i, j, &mut z);
        self.y.row_mut(i)[j..][..NR].copy_from_slice(&z);
    }
}

/// dz = dy∘f′(z)∘mask/(1 − p) `[n′, out]`, from the y that [`forward`] gave.
///
/// # Panics
/// If shapes disagree or the activation is gelu, whose derivative y does not tell.
pub fn backward_epilogue<T: Real>(level: Level, epilogue: Epilogue, y: Rows<'_, T>, dy: Rows<'_, T>, dz: RowsMut<'_, T>) {
    rows::same_shape(&y, &dy);
    rows::same_shape(&y, &dz.view());
    assert!(epilogue.activation != Activation::Gelu, "conv1d: the derivative of gelu cannot be told from its output");
    T::conv1d_backward_epilogue(level, BackwardEpilogue { epilogue, y, dy, dz });
}

pub(crate) struct BackwardEpilogue<'a, T> {
    epilogue: Epilogue,
    y: Rows<'a, T>,
    dy: Rows<'a, T>,
    dz: RowsMut<'a, T>,
}

impl<T: Real> Kernel for BackwardEpilogue<'_, T> {
    #[inline(always)]
    fn run<I: Isa>(mut self) {
        let scale = self.epilogue.dropout.map_or(1.0, Mask::scale);
        let (scale, unscale) = (T::of(scale), T::of(1.0 / scale));
        for i in 0..self.y.rows() {
            let (dz, y) = (self.dz.row_mut(i), self.y.row(i));
            dz.copy_from_slice(self.dy.row(i));
            let pairs = dz.iter_mut().zip(y);
            match self.epilogue.activation {
                Activation::LeakyRelu { slope } => {
                    let below = scale * T::of(slope);
                    pairs.for_each(|(dz, y)| {
                        let negative = if y.is_sign_negative() { below } else { T::ZERO };
                        *dz *= if *y > T::ZERO { scale } else { negative };
                    });
                    continue;
                }
                Activation::Relu => pairs.for_each(|(dz, y)| *dz = if *y > T::ZERO { *dz * scale } else { T::ZERO }),
                Activation::Tanh => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * (T::ONE - y * y);
                }),
                Activation::Sigmoid => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * y * (T::ONE - y);
                }),
                Activation::Elu => pairs.for_each(|(dz, y)| {
                    let y = *y * unscale;
                    *dz = *dz * scale * if y > T::ZERO { T::ONE } else { y + T::ONE };
                }),
                Activation::Identity | Activation::Gelu => pairs.for_each(|(dz, _)| *dz *= scale),
            }
            if let Some(mask) = self.epilogue.dropout {
                let mask = mask.row(i);
                dz.iter_mut().enumerate().for_each(|(c, dz)| *dz = if mask.keeps(c) { *dz } else { T::ZERO });
            }
        }
    }
}

/// dx {=, +=} the adjoint of the convolution and of its padding, applied to dz.
///
/// # Panics
/// If shapes disagree.
pub fn backward_input<T: Real>(
    level: Level,
    geometry: Geometry,
    dz: Rows<'_, T>,
    weight: Weight<'_, T>,
    dx: RowsMut<'_, T>,
    write: Write,
    scratch: &mut [T],
) {
    assert_eq!(dz.rows(), geometry.output_rows(dx.rows()), "conv1d: rows of dz");
    let (inputs, outputs) = (dx.cols(), dz.cols());
    let (ends, rest) = scratch.split_at_mut(outputs + (geometry.left + geometry.right) * inputs);
    let packed = match weight {
        Weight::Packed(packed) => packed,
        Weight::Plain(weight) => {
            pack_transposed(level, geometry, (inputs, outputs), weight, rest);
            rest
        }
    };
    T::conv1d_backward_input(level, BackwardInput { geometry, dz, packed, dx, write, ends });
}

pub(crate) struct BackwardInput<'a, T> {
    geometry: Geometry,
    dz: Rows<'a, T>,
    packed: &'a [T],
    dx: RowsMut<'a, T>,
    write: Write,
    /// A row of zeros, and the gradients of the padded rows.
    ends: &'a mut [T],
}

impl<T: Real> Tiled<T> for BackwardInput<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(mut self) {
        let Geometry { taps, left, right } = self.geometry;
        let (n, inputs, outputs) = (self.dx.rows(), self.dx.cols(), self.dz.cols());
        if n == 0 {
            return;
        }
        let (zeros, ends) = self.ends.split_at_mut(outputs);
        let panels = &self.packed[..taps * outputs * inputs.next_multiple_of(NR)];
        zeros.fill(T::ZERO);
        let part = |first, jump_at, jump, rows| Reversed { dz: self.dz, zeros, taps, first, jump_at, jump, rows };
        let mut sink = Store { c: self.dx.reborrow(), bias: None, write: self.write };
        tile::rows::<T, I, _, _, MR, NR>(&part(left, n, 0, n), inputs, panels, &mut sink);
        // The padded rows in front and behind, as one operand.
        let mut sink = Store { c: RowsMut::packed(ends, left + right, inputs), bias: None, write: Write::Set };
        tile::rows::<T, I, _, _, MR, NR>(&part(0, left, n, left + right), inputs, panels, &mut sink);
        for (s, end) in ends.chunks_exact(inputs.max(1)).enumerate() {
            let target = self.dx.row_mut(if s < left { 0 } else { n - 1 });
            target.iter_mut().zip(end).for_each(|(d, e)| *d += *e);
        }
    }
}

/// Row i, tap j ↦ dz[s − j] of padded row s = first + i (+ jump from row `jump_at` on), or zeros outside dz.
struct Reversed<'a, T> {
    dz: Rows<'a, T>,
    zeros: &'a [T],
    taps: usize,
    first: usize,
    jump_at: usize,
    jump: usize,
    rows: usize,
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
        let s = self.first + i + if i < self.jump_at { 0 } else { self.jump };
        // Before the first row the difference wraps to a huge number.
        let t = s.wrapping_sub(tap);
        if t < self.dz.rows() { self.dz.row(t) } else { self.zeros }
    }
}

/// dW {=, +=} `Σ_t dz[t, o]·x[clamp(t + j − left), c]`.
///
/// # Panics
/// If shapes disagree.
pub fn backward_weight<T: Real>(
    level: Level,
    geometry: Geometry,
    x: Rows<'_, T>,
    dz: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
) {
    assert_eq!(dz.rows(), geometry.output_rows(x.rows()), "conv1d: rows of dz");
    assert_eq!(dweight.len(), geometry.taps * x.cols() * dz.cols(), "conv1d: length of the weight's gradient");
    T::conv1d_backward_weight(level, BackwardWeight { geometry, x, dz, dweight, write });
}

pub(crate) struct BackwardWeight<'a, T> {
    geometry: Geometry,
    x: Rows<'a, T>,
    dz: Rows<'a, T>,
    dweight: &'a mut [T],
    write: Write,
}

impl<T: Real> Tiled<T> for BackwardWeight<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let (n, inputs, outputs) = (self.dz.rows(), self.x.cols(), self.dz.cols());
        let Geometry { left, .. } = self.geometry;
        if n == 0 && self.write == Write::Set {
            self.dweight.fill(T::ZERO);
        }
        let mut panel = [[T::ZERO; NR]; tile::COLUMN_DEPTH];
        // For each block of rows, x and one panel of dz stay in the first-level cache for all taps.
        for start in (0..n).step_by(tile::COLUMN_DEPTH) {
            let end = n.min(start + tile::COLUMN_DEPTH);
            let write = if start == 0 { self.write } else { Write::Add };
            for column in (0..outputs).step_by(NR) {
                let panel = &mut panel[..end - start];
                tile::pack_panel(&self.dz.range(start, end), column, panel);
                for (j, dw) in self.dweight.chunks_exact_mut((inputs * outputs).max(1)).enumerate() {
                    // Output rows up to `inner` read the first row of x, from `behind` on the last one.
                    let inner = left.saturating_sub(j).clamp(start, end);
                    let behind = (self.x.rows() + left).saturating_sub(j).clamp(inner, end);
                    let parts = [
                        (start, inner, Rows::repeated(self.x.row(0), inner - start)),
                        (inner, behind, self.x.range((inner + j).saturating_sub(left).min(self.x.rows()), self.x.rows())),
                        (behind, end, Rows::repeated(self.x.row(self.x.rows() - 1), end - behind)),
                    ];
                    let mut write = write;
                    for (first, last, x) in parts {
                        if first < last {
                            let mut sink = Store { c: RowsMut::packed(dw, inputs, outputs), bias: None, write };
                            let panel = &panel[first - start..last - start];
                            tile::columns::<T, I, _, MR, NR>(
                                (|p| x.row(p), inputs),
                                panel,
                                (column, NR.min(outputs - column)),
                                &mut sink,
                            );
                            write = Write::Add;
                        }
                    }
                }
            }
        }
    }
}

/// db {=, +=} Σ_t dz.
pub fn backward_bias<T: Real>(level: Level, dz: Rows<'_, T>, dbias: &mut [T], write: Write) {
    linear::backward_bias(level, dz, dbias, write);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random::Stream;
    use crate::testing::{Matrix, assert_near, check_writes, inner, numbers};
    use crate::tolerance::Tolerance;
    use crate::{linear, reference};

    const LEAKY: Activation = Activation::LeakyRelu { slope: 0.01 };

    #[derive(Clone, Copy, Debug)]
    struct Problem {
        geometry: Geometry,
        rows: usize,
        inputs: usize,
        outputs: usize,
        seed: u64,
    }

    fn problem() -> impl Strategy<Value = Problem> {
        (1_usize..6, 0_usize..5, 0_usize..5, 0_usize..200, 1_usize..35, 1_usize..35, 0_u64..1000).prop_map(
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
        for level in Level::available() {
            let mut scratch = vec![T::NAN; scratch_len(geometry, inputs, outputs)];
            let mut y = Matrix::<T>::poisoned(seed, (after, outputs));
            let mut packed = vec![T::NAN; packed_len(geometry, inputs, outputs)];
            pack(level, geometry, (inputs, outputs), &weight, &mut packed);
            for weight in [Weight::Plain(&weight), Weight::Packed(&packed)] {
                forward(level, geometry, x.view(), weight, Some(&bias), Epilogue::NONE, y.view_mut(), &mut scratch);
                y.check_gaps();
                assert_near(&format!("forward at {level}"), &y.to_vec(), &z.to_vec(), Tolerance::Close);
            }
            let mut packed = vec![T::NAN; packed_len(geometry, outputs, inputs)];
            pack_transposed(level, geometry, (inputs, outputs), &weight, &mut packed);
            for weight in [Weight::Plain(&weight), Weight::Packed(&packed)] {
                check_writes(&format!("dx at {level}"), &dx, Tolerance::Close, |dx, write| {
                    backward_input(level, geometry, dz.view(), weight, dx, write, &mut scratch);
                });
            }
            check_writes(&format!("dW at {level}"), &dw, Tolerance::Close, |mut dw, write| {
                backward_weight(level, geometry, x.view(), dz.view(), dw.row_mut(0), write);
            });
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
        fn backward_is_the_adjoint(p in problem()) {
            let Problem { geometry, rows, inputs, outputs, seed } = p;
            let after = geometry.output_rows(rows);
            let (x, dz) = (numbers::<f64>(seed, rows * inputs), numbers::<f64>(seed + 1, after * outputs));
            let weight = numbers::<f64>(seed + 2, geometry.taps * inputs * outputs);
            for level in Level::available() {
                let mut scratch = vec![f64::NAN; scratch_len(geometry, inputs, outputs)];
                let (mut y, mut dx) = (vec![f64::NAN; dz.len()], vec![f64::NAN; x.len()]);
                let x_view = Rows::packed(&x, rows, inputs);
                forward(level, geometry, x_view, Weight::Plain(&weight), None, Epilogue::NONE, RowsMut::packed(&mut y, after, outputs), &mut scratch);
                let dx_view = RowsMut::packed(&mut dx, rows, inputs);
                backward_input(level, geometry, Rows::packed(&dz, after, outputs), Weight::Plain(&weight), dx_view, Write::Set, &mut scratch);
                assert_near("<Ax, y> and <x, A'y>", &[inner(&y, &dz)], &[inner(&x, &dx)], Tolerance::Close);
            }
        }

        #[test]
        fn epilogue_and_its_gradient(p in problem(), which in 0_usize..5, rate in prop_oneof![Just(None), Just(Some(0.2))]) {
            let Problem { geometry, rows, inputs, outputs, seed } = p;
            let after = geometry.output_rows(rows);
            let activation = [Activation::Identity, Activation::Relu, LEAKY, Activation::Tanh, Activation::Sigmoid][which];
            let dropout = rate.map(|rate| Mask::new(Stream::new(seed, 1, 2, 3), rate));
            let epilogue = Epilogue { activation, dropout };
            let x = Matrix::<f64>::random(seed, (rows, inputs));
            let dy = Matrix::<f64>::random(seed + 4, (after, outputs));
            let weight = numbers::<f64>(seed + 1, geometry.taps * inputs * outputs);
            let mut z = Matrix::<f64>::poisoned(seed, (after, outputs));
            reference::conv1d(geometry, x.view(), &weight, None, z.view_mut());
            let factor = |t: usize, o: usize| dropout.map_or(1.0, |mask| if mask.keeps(t, o) { mask.scale() } else { 0.0 });
            let expected = |f: &dyn Fn(f64) -> f64, g: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
                (0..after * outputs).map(|i| (i / outputs, i % outputs)).map(|(t, o)| f(z.view().row(t)[o]) * factor(t, o) * g(t, o)).collect()
            };
            let y_expected = expected(&|z| reference::activation(activation, z), &|_, _| 1.0);
            let dz_expected = expected(&|z| reference::activation_derivative(activation, z), &|t, o| dy.view().row(t)[o]);
            for level in Level::available() {
                let mut scratch = vec![f64::NAN; scratch_len(geometry, inputs, outputs)];
                let (mut y, mut dz) = (Matrix::<f64>::poisoned(seed, (after, outputs)), Matrix::<f64>::poisoned(seed, (after, outputs)));
                forward(level, geometry, x.view(), Weight::Plain(&weight), None, epilogue, y.view_mut(), &mut scratch);
                assert_near("y", &y.to_vec(), &y_expected, Tolerance::Close);
                backward_epilogue(level, epilogue, y.view(), dy.view(), dz.view_mut());
                assert_near("dz", &dz.to_vec(), &dz_expected, Tolerance::Close);
            }
        }
    }

    #[test]
    fn sizes_of_the_network() {
        for (rows, taps, pad) in [(500, 5, 3), (502, 3, 0), (125, 5, 3)] {
            let geometry = Geometry { taps, left: pad, right: pad };
            check::<f32>(Problem { geometry, rows, inputs: 64, outputs: 64, seed: 1 });
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
        forward(Level::PLAIN, geometry, x.view(), Weight::Plain(&turned), None, Epilogue::NONE, conv.view_mut(), &mut scratch);
        linear::forward(Level::PLAIN, x.view(), &weight, None, map.view_mut(), &mut scratch);
        assert_near("conv1d with one tap", &conv.to_vec(), &map.to_vec(), Tolerance::Exact);
    }

    #[test]
    fn a_kept_zero_still_passes_its_gradient() {
        let geometry = Geometry { taps: 1, left: 0, right: 0 };
        let mask = Mask::new(Stream::new(5, 0, 0, 0), 0.5);
        let epilogue = Epilogue { activation: LEAKY, dropout: Some(mask) };
        for level in Level::available() {
            let (x, dy) = (vec![1.0_f32; 64], vec![1.0_f32; 64]);
            let (mut y, mut dz, mut scratch) = (vec![f32::NAN; 64], vec![f32::NAN; 64], vec![0.0; 64]);
            forward(
                level,
                geometry,
                Rows::packed(&x, 64, 1),
                Weight::Plain(&[0.0]),
                None,
                epilogue,
                RowsMut::packed(&mut y, 64, 1),
                &mut scratch,
            );
            backward_epilogue(level, epilogue, Rows::packed(&y, 64, 1), Rows::packed(&dy, 64, 1), RowsMut::packed(&mut dz, 64, 1));
            let expected: Vec<f32> = (0..64).map(|t| if mask.keeps(t, 0) { 0.01 * mask.scale() as f32 } else { 0.0 }).collect();
            assert!(y.iter().all(|y| *y == 0.0));
            assert_near("dz of zeros", &dz, &expected, Tolerance::Close);
        }
    }
}
