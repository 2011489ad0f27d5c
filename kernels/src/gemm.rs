//! Matrix products of strided row-major matrices.
//!
//! | function | c | a | b |
//! | --- | --- | --- | --- |
//! | [`ab`] | a·b | [m, k] | [k, n] |
//! | [`atb`] | aᵀ·b | [k, m] | [k, n] |
//! | [`abt`] | a·bᵀ | [m, k] | [n, k] |
//!
//! c is [m, n] and is overwritten or added to. An empty k gives zeros.

use crate::level::Level;
use crate::{Real, Rows, RowsMut, Write};

/// Scratch, in numbers, that any of the three products needs for these sizes.
pub const fn scratch_len(m: usize, k: usize, n: usize) -> usize {
    let _ = (m, k);
    n.next_multiple_of(64)
}

/// c {=, +=} a·b; a [m, k], b [k, n], c [m, n].
pub fn ab<T: Real>(level: Level, a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(a.rows() == c.rows() && a.cols() == b.rows() && b.cols() == c.cols(), "a·b: shapes do not chain");
    let _ = level;
    for i in 0..c.rows() {
        crate::reference::gemm_ab(a.range(i, i + 1), b, RowsMut::packed(scratch, 1, b.cols()));
        store(&scratch[..b.cols()], c.row_mut(i), write);
    }
}

/// c {=, +=} aᵀ·b; a [k, m], b [k, n], c [m, n].
pub fn atb<T: Real>(level: Level, a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(a.cols() == c.rows() && a.rows() == b.rows() && b.cols() == c.cols(), "aᵀ·b: shapes do not chain");
    let _ = level;
    for i in 0..c.rows() {
        crate::reference::gemm_atb(a.columns(i, 1), b, RowsMut::packed(scratch, 1, b.cols()));
        store(&scratch[..b.cols()], c.row_mut(i), write);
    }
}

/// c {=, +=} a·bᵀ; a [m, k], b [n, k], c [m, n].
pub fn abt<T: Real>(level: Level, a: Rows<'_, T>, b: Rows<'_, T>, mut c: RowsMut<'_, T>, write: Write, scratch: &mut [T]) {
    assert!(a.rows() == c.rows() && a.cols() == b.cols() && b.rows() == c.cols(), "a·bᵀ: shapes do not chain");
    let _ = level;
    for i in 0..c.rows() {
        crate::reference::gemm_abt(a.range(i, i + 1), b, RowsMut::packed(scratch, 1, b.rows()));
        store(&scratch[..b.rows()], c.row_mut(i), write);
    }
}

#[inline(always)]
fn store<T: Real>(x: &[T], y: &mut [T], write: Write) {
    match write {
        Write::Set => y.iter_mut().zip(x).for_each(|(y, x)| *y = *x),
        Write::Add => y.iter_mut().zip(x).for_each(|(y, x)| *y += *x),
    }
}
