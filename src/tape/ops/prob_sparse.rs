//! ProbSparse attention without the projections (Informer): full attention for the queries that look at few keys, the mean of the
//! values, or with a mask their running sum, for all others. The mathematics is in `phyture_kernels::prob_sparse`.
//!   o_i = softmax(q_i·kᵀ/√d_k)·v for the chosen queries of each head, mean(v) for the others
//!   dv from all rows; dq and dk from the chosen ones; the choice itself is a step, without gradient
//! q, o [L_Q, d]; k, v [L_K, d]. Kept: the chosen queries and their probabilities. The backward pass reads q, k, v.
//!
//! Keys are sampled from the operation's random stream while training, and from a fixed one, given by its seed, when random parts are
//! off: a prediction is reproducible, and does not depend on the batch.

use super::{or_scratch, rows, rows_mut};
use crate::tape::Shape;
use crate::tape::error::Result;
use crate::tape::op::{Backward, Differentiable, Forward, Memory, Op, Reads, exactly, misfit};
use phyture_kernels::Real;
use phyture_kernels::prob_sparse::{self, Gradients, Sparse};
use phyture_kernels::random::Stream;

/// Operands q, k, v.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbSparse {
    /// Heads, factor, mask.
    pub sparse: Sparse,
    /// Of the fixed sample of keys.
    pub seed: u64,
}

impl<T: Real> Op<T> for ProbSparse {
    fn name(&self) -> &'static str {
        "prob_sparse"
    }

    fn shape(&self, operands: &[Shape]) -> Result<Shape> {
        const EXPECTED: &str = "queries [n, d], keys and values [m, d] (m = n with a mask), and a number of heads that divides d";
        let [q, k, v] = exactly("prob_sparse", operands, EXPECTED)?;
        let Sparse { heads, masked, .. } = self.sparse;
        match (q.lengths(), k.lengths()) {
            ([n, d], [m, width]) if d == width && k == v && heads > 0 && d.is_multiple_of(heads) && (!masked || n == m) => Ok(q),
            _ => Err(misfit("prob_sparse", operands, EXPECTED)),
        }
    }

    fn memory(&self, operands: &[Shape]) -> Memory {
        let [q, k, ..] = operands else { return Memory::default() };
        let ((queries, d), (keys, _)) = (q.rows(), k.rows());
        let scratch = self.sparse.scratch_len(queries, keys, d);
        // The kernel makes all three gradients; those nobody asks for go to scratch.
        let backward_scratch = scratch + q.len() + 2 * k.len();
        Memory { workspace: self.sparse.kept_len(queries, keys), forward_scratch: scratch, backward_scratch, ..Memory::default() }
    }

    fn forward(&self, io: Forward<'_, T>) {
        let [q, k, ..] = io.shapes else { return };
        let stream = io.stream.unwrap_or(Stream::new(self.seed, 0, 0, 0));
        let operands = [rows(io.x[0], q), rows(io.x[1], k), rows(io.x[2], k)];
        let o = rows_mut(io.y, q);
        prob_sparse::forward(io.isa, self.sparse, stream, operands, o, io.workspace, io.scratch);
    }

    fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
        Some(self)
    }
}

impl<T: Real> Differentiable<T> for ProbSparse {
    fn reads(&self) -> Reads {
        Reads::operands(&[0, 1, 2])
    }

    fn backward(&self, io: Backward<'_, T>) {
        let [q, k, ..] = io.shapes else { return };
        let [dq, dk, dv, ..] = io.dx;
        let mut scratch = io.scratch;
        let dq = or_scratch(dq, &mut scratch, q.len());
        let dk = or_scratch(dk, &mut scratch, k.len());
        let dv = or_scratch(dv, &mut scratch, k.len());
        let writes = [dq.write, dk.write, dv.write];
        let gradients = Gradients { dq: rows_mut(dq.values, q), dk: rows_mut(dk.values, k), dv: rows_mut(dv.values, k), writes };
        let operands = [rows(io.x[0], q), rows(io.x[1], k), rows(io.x[2], k)];
        let (d_o, kept) = (rows(io.dy, q), io.workspace);
        prob_sparse::backward(io.isa, self.sparse, operands, d_o, kept, gradients, scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Attention;
    use super::*;
    use crate::tape::{Graph, Session, Threads};
    use phyture_kernels::Tolerance;

    const FEW: ProbSparse = ProbSparse { sparse: Sparse { heads: 2, factor: 1, masked: false }, seed: 3 };
    const MASKED: ProbSparse = ProbSparse { sparse: Sparse { masked: true, ..FEW.sparse }, ..FEW };

    gradcheck!(prob_sparse: FEW, [[9, 4], [7, 4], [7, 4]], [[3, 2], [2, 2], [2, 2]], [[1, 2], [1, 2], [1, 2]]);
    gradcheck!(masked: MASKED, [[9, 4], [9, 4], [9, 4]], [[1, 2], [1, 2], [1, 2]]);

    #[test]
    fn with_every_query_chosen_it_is_attention() -> Result<()> {
        let mut graph = Graph::<f64>::new();
        let vars = [graph.input("q", &[12, 6])?, graph.input("k", &[9, 6])?, graph.input("v", &[9, 6])?];
        let all = ProbSparse { sparse: Sparse { heads: 3, factor: 12, masked: false }, seed: 1 };
        let sparse = graph.apply(all, &vars)?;
        let full = graph.apply(Attention { heads: 3, dropout: 0.0 }, &vars)?;
        let mut session = Session::infer(&graph, &[sparse, full], Threads(1))?;
        session.step(&[], 1, None, &|_, inputs: &mut [&mut [f64]]| {
            for (index, input) in inputs.iter_mut().enumerate() {
                let stream = Stream::new(7, 0, 0, index as u64);
                input.iter_mut().enumerate().for_each(|(at, value)| *value = 2.0 * stream.uniform(at as u64) - 1.0);
            }
        })?;
        let pairs = session.output(0, 0)?.iter().zip(session.output(1, 0)?);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < Tolerance::Close.relative_f64()));
        Ok(())
    }
}
