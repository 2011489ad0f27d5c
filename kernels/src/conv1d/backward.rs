//! Gradients of the convolution with respect to its input, its weight and its bias, from dz.
//!
//! ```text
//! dx̃[s, c] = Σ_{o,j} dz[s − j, o]·W[j, c, o] on the padded rows s, of which the ends fold into dx[0] and dx[n − 1]
//! dW[j, c, o] = Σ_t dz[t, o]·x[clamp(t + j − left), c],   db = Σ_t dz
//! ```

use super::packing::panels;
use super::{Geometry, Weight, ends_len, sequences, winograd};
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::tile::{self, LeftRows, Store};
use crate::{Real, Rows, RowsMut, Write, linear};

/// dx {=, +=} the adjoint of the convolution and of its padding, applied to dz.
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
    assert_eq!(dz.rows(), geometry.output_rows(dx.rows()), "conv1d: rows of dz");
    let (inputs, outputs) = (dx.cols(), dz.cols());
    if winograd::applies(geometry, inputs, outputs) {
        return sequences::backward_input(isa, geometry, &[dz], weight, &mut [dx], write, scratch);
    }
    let (ends, rest) = scratch.split_at_mut(ends_len(1, geometry, inputs, outputs));
    let (packed, _) = panels(isa, geometry, (inputs, outputs), (weight, true), rest);
    T::conv1d_backward_input(isa, BackwardInput { geometry, dz, packed, dx, write, ends });
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
        zeros.fill(T::ZERO);
        let part = |first, jump_at, jump, rows| Reversed { dz: self.dz, zeros, taps, first, jump_at, jump, rows };
        let mut inner = Store { c: self.dx.reborrow(), bias: None, write: self.write };
        let mut outer = Store { c: RowsMut::packed(ends, left + right, inputs), bias: None, write: Write::Set };
        let panels = &self.packed[..taps * outputs * inputs.next_multiple_of(NR)];
        tile::rows::<T, I, _, _, MR, NR>(&part(left, n, 0, n), inputs, panels, &mut inner);
        // The padded rows in front and behind, as one operand.
        tile::rows::<T, I, _, _, MR, NR>(&part(0, left, n, left + right), inputs, panels, &mut outer);
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
    isa: InstructionSet,
    geometry: Geometry,
    x: Rows<'_, T>,
    dz: Rows<'_, T>,
    dweight: &mut [T],
    write: Write,
    scratch: &mut [T],
) {
    assert_eq!(dz.rows(), geometry.output_rows(x.rows()), "conv1d: rows of dz");
    assert_eq!(dweight.len(), geometry.taps * x.cols() * dz.cols(), "conv1d: length of the weight's gradient");
    if winograd::applies(geometry, x.cols(), dz.cols()) {
        return sequences::backward_weight(isa, geometry, &[x], &[dz], dweight, write, scratch);
    }
    T::conv1d_backward_weight(isa, BackwardWeight { geometry, x, dz, dweight, write });
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
        let left = self.geometry.left;
        if n == 0 {
            if self.write == Write::Set {
                self.dweight.fill(T::ZERO);
            }
            return;
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
pub fn backward_bias<T: Real>(isa: InstructionSet, dz: Rows<'_, T>, dbias: &mut [T], write: Write) {
    linear::backward_bias(isa, dz, dbias, write);
}
