//! Multi-head attention that never stores a score map (paper eqs. 21–23 without the projections).
//!
//!   s = q·kᵀ/√d_k,  p = softmax(s) a row,  o = (m∘p/(1 − rate))·v       for each head
//!
//! q, o [queries, heads·d_k]; k, v [keys, heads·d_k]; head h is columns h·d_k … (h+1)·d_k. The forward pass goes over blocks of
//! keys with an online softmax and keeps only ℓ = log Σ eˢ, `[heads, queries]`. The backward pass makes p = e^(s − ℓ) and the
//! dropout mask m again, block by block (Dao 2023, FlashAttention-2):
//!
//!   D = rowsum(do∘o),  dp = m∘(do·vᵀ)/(1 − rate),  ds = p∘(dp − D)
//!   dq = ds·k/√d_k,  dk = dsᵀ·q/√d_k,  dv = (m∘p/(1 − rate))ᵀ·do
//!
//! Mask element of head h, query i, key j: row h·queries + i, column j.

use crate::dropout::Mask;
use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write};

/// Scratch, in numbers, that [`forward`] and [`backward`] need.
pub fn scratch_len(heads: usize, queries: usize, keys: usize, head_size: usize) -> usize {
    3 * heads * head_size * queries.max(keys)
}

/// o and `log_sum_exp` [heads, queries] from q, k, v.
///
/// # Panics
/// If shapes disagree, `heads` does not divide the width, or there is no key.
pub fn forward<T: Real>(
    level: Level,
    heads: usize,
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    v: Rows<'_, T>,
    dropout: Option<Mask>,
    o: RowsMut<'_, T>,
    log_sum_exp: &mut [T],
    scratch: &mut [T],
) {
    let _ = (level, scratch);
    crate::reference::attention(heads, q, k, v, dropout, o, log_sum_exp);
}

/// dq, dk, dv {=, +=} from do and what the forward pass took and gave.
///
/// # Panics
/// As [`forward`].
pub fn backward<T: Real>(
    level: Level,
    heads: usize,
    q: Rows<'_, T>,
    k: Rows<'_, T>,
    v: Rows<'_, T>,
    dropout: Option<Mask>,
    o: Rows<'_, T>,
    log_sum_exp: &[T],
    d_o: Rows<'_, T>,
    gradients: Gradients<'_, T>,
    scratch: &mut [T],
) {
    let _ = (o, log_sum_exp);
    let Gradients { dq, dk, dv, write_q, write_k, write_v } = gradients;
    let (query, key) = (q.rows() * q.cols(), k.rows() * k.cols());
    let (sq, rest) = scratch.split_at_mut(query);
    let (sk, rest) = rest.split_at_mut(key);
    let view = RowsMut::packed;
    crate::reference::attention_backward(
        heads,
        q,
        k,
        v,
        dropout,
        d_o,
        view(sq, q.rows(), q.cols()),
        view(sk, k.rows(), k.cols()),
        view(rest, k.rows(), k.cols()),
    );
    crate::rows::copy(level, Rows::packed(sq, q.rows(), q.cols()), dq, write_q);
    crate::rows::copy(level, Rows::packed(sk, k.rows(), k.cols()), dk, write_k);
    crate::rows::copy(level, Rows::packed(rest, k.rows(), k.cols()), dv, write_v);
}

/// Where [`backward`] puts its three gradients, and whether it overwrites or adds.
#[derive(Debug)]
pub struct Gradients<'a, T> {
    /// Gradient of q, [queries, heads·d_k].
    pub dq: RowsMut<'a, T>,
    /// Gradient of k, [keys, heads·d_k].
    pub dk: RowsMut<'a, T>,
    /// Gradient of v, [keys, heads·d_k].
    pub dv: RowsMut<'a, T>,
    /// Set or add for dq.
    pub write_q: Write,
    /// Set or add for dk.
    pub write_k: Write,
    /// Set or add for dv.
    pub write_v: Write,
}
