//! Multi-head attention without the projections (paper eqs. 21–23), with dropout on the probabilities while training.
//!   o = (m∘softmax(q·kᵀ/√d_k)/(1−p))·v for each head;  dq, dk, dv by recomputation from the kept log-sum-exp
//! q, o [queries, d]; k, v [keys, d]; head h is columns h·d_k … (h+1)·d_k. No score map is stored. Kept: `[queries, heads]`.

use super::{or_scratch, rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::attention::{self, Gradients, Inputs};
use phyture_kernels::dropout::Mask;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, RowsMut};

/// Operands q, k, v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attention {
    /// Heads; a divisor of d.
    pub heads: usize,
    /// Probability of dropping a probability, in [0, 1).
    pub dropout: f64,
}

impl Attention {
    fn mask(&self, stream: Option<Stream>) -> Option<Mask> {
        stream.filter(|_| self.dropout > 0.0).map(|stream| Mask::new(stream, self.dropout))
    }
}

impl<T: Real> Op<T> for Attention {
    fn name(&self) -> &'static str {
        "attention"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "queries [n, d], keys and values [m, d], and a number of heads that divides d";
        let [q, k, v] = exactly("attention", operands, EXPECTED)?;
        match (q.lengths(), k.lengths()) {
            ([_, d], [_, width]) if d == width && k == v && self.heads > 0 && d.is_multiple_of(self.heads) => Ok(q),
            _ => Err(misfit("attention", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let [q, k, ..] = operands else { return Memory::default() };
        let ((queries, d), (keys, _)) = (q.rows(), k.rows());
        let scratch = attention::scratch_len(self.heads, queries, keys, d / self.heads);
        // The kernel makes all three gradients; those nobody asks for go to scratch.
        let backward_scratch = scratch + q.len() + 2 * k.len();
        Memory { workspace: self.heads * queries, forward_scratch: scratch, backward_scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [shape, keys, ..] = io.shapes else { return };
        let (q, k, v) = (rows(io.x[0], shape), rows(io.x[1], keys), rows(io.x[2], keys));
        let inputs = Inputs { heads: self.heads, q, k, v, dropout: self.mask(io.stream) };
        io.parts.rows(q.rows(), attention::CUT, [io.y, io.workspace], io.scratch, |piece, [o, lse], scratch| {
            let o = RowsMut::packed(o, piece.len(), q.cols());
            attention::forward_rows(io.isa, inputs, piece.start, o, lse, scratch);
        });
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for Attention {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1, 2]).and_result()
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [q, k, ..] = io.shapes else { return };
        let [dq, dk, dv, ..] = io.dx;
        let mut scratch = io.scratch;
        let (dq, dk, dv) =
            (or_scratch(dq, &mut scratch, q.len()), or_scratch(dk, &mut scratch, k.len()), or_scratch(dv, &mut scratch, k.len()));
        let gradients = Gradients {
            dq: rows_mut(dq.values, q),
            dk: rows_mut(dk.values, k),
            dv: rows_mut(dv.values, k),
            write_q: dq.write,
            write_k: dk.write,
            write_v: dv.write,
        };
        let inputs = Inputs {
            heads: self.heads,
            q: rows(io.x[0], q),
            k: rows(io.x[1], k),
            v: rows(io.x[2], k),
            dropout: self.mask(io.stream),
        };
        attention::backward(io.isa, inputs, (rows(io.y, q), io.workspace), rows(io.dy, q), gradients, scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_HEADS: Attention = Attention { heads: 2, dropout: 0.3 };

    gradcheck!(attention: TWO_HEADS, [[5, 6], [7, 6], [7, 6]], [[3, 2], [2, 2], [2, 2]], [[1, 2], [1, 2], [1, 2]]);
    gradcheck!(several_blocks: TWO_HEADS, [[70, 4], [90, 4], [90, 4]]);
    gradcheck!(in_pieces: TWO_HEADS, [[300, 4], [7, 4], [7, 4]]);
    gradcheck!(one_head_as_wide_as_the_paper: Attention { heads: 1, dropout: 0.0 }, [[9, 16], [9, 16], [9, 16]]);
}
