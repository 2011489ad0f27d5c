//! The rows of one operation's result in pieces, worked on side by side: what a session does with threads for which it has no sample.
//!
//! ```text
//! rows 0 … n  =  [0, a) ∪ [a, b) ∪ …,   a, b, … multiples of a step
//! ```
//!
//! Where rows may be cut without changing a bit is for the operation to say, as its kernel does; this file cuts and hands out.

use super::slab::Slabs;
use super::threads::Parallelism;
use phyture_kernels::Real;
use std::ops::Range;

/// In how many pieces an operation may work: an argument of its forward pass.
#[derive(Clone, Copy)]
pub struct Parts<'a, T>(Option<Shared<'a, T>>);

/// How pieces are shared between threads.
#[derive(Clone, Copy)]
struct Shared<'a, T> {
    count: usize,
    parallelism: Parallelism,
    /// Scratch: every piece but the first borrows one.
    slabs: &'a Slabs<T>,
}

impl<'a, T: Real> Parts<'a, T> {
    /// All in one piece.
    pub const ONE: Self = Self(None);

    /// As many pieces as there are slabs for each of these samples; one of them is the sample's own.
    pub(super) fn of(parallelism: Parallelism, slabs: &'a Slabs<T>, samples: usize) -> Self {
        let count = slabs.count() / samples.max(1);
        Self((count > 1).then_some(Shared { count, parallelism, slabs }))
    }

    /// Calls `work` for pieces of `rows` rows, cut at multiples of `step`: with the rows of the piece, its rows of each of the `outputs`
    /// (`[rows, any width]`, packed), and scratch as long as `scratch`.
    pub fn rows<const N: usize>(
        self,
        rows: usize,
        step: usize,
        outputs: [&mut [T]; N],
        scratch: &mut [T],
        work: impl Fn(Range<usize>, [&mut [T]; N], &mut [T]) + Sync,
    ) {
        match self.0 {
            None => work(0..rows, outputs, scratch),
            Some(shared) => {
                let (count, len) = (shared.count.min(rows / step.max(1)), scratch.len());
                shared.cut(count, step, Piece { rows: 0..rows, outputs, scratch: Some(scratch) }, len, &work);
            }
        }
    }
}

impl<T: Real> Shared<'_, T> {
    /// Halves the piece, and these again, until there are `count`.
    fn cut<const N: usize>(
        self,
        count: usize,
        step: usize,
        piece: Piece<'_, T, N>,
        scratch_len: usize,
        work: &(impl Fn(Range<usize>, [&mut [T]; N], &mut [T]) + Sync),
    ) {
        if count > 1 {
            let (low, high) = piece.halves(count, step);
            return self.parallelism.join(
                || self.cut(count / 2, step, low, scratch_len, work),
                || self.cut(count - count / 2, step, high, scratch_len, work),
            );
        }
        let Piece { rows, outputs, scratch } = piece;
        match scratch {
            Some(scratch) => work(rows, outputs, scratch),
            None => self.slabs.lend(|slab| work(rows, outputs, &mut slab[..scratch_len])),
        }
    }
}

/// Some rows, and what they are worked on with.
struct Piece<'a, T, const N: usize> {
    rows: Range<usize>,
    outputs: [&'a mut [T]; N],
    /// Only the first piece has the operation's own.
    scratch: Option<&'a mut [T]>,
}

impl<T, const N: usize> Piece<'_, T, N> {
    /// The first `count / 2` of `count` equal parts and the rest, cut at the multiple of `step` nearest to that.
    fn halves(self, count: usize, step: usize) -> (Self, Self) {
        let Self { rows, outputs: mut low, scratch } = self;
        let len = rows.len();
        let wanted = len * (count / 2) / count;
        let cut = (wanted + step / 2) / step * step;
        let high = low.each_mut().map(|output| {
            let width = output.len() / len.max(1);
            let (head, tail) = std::mem::take(output).split_at_mut(cut * width);
            *output = head;
            tail
        });
        let middle = rows.start + cut;
        let low = Self { rows: rows.start..middle, outputs: low, scratch };
        (low, Self { rows: middle..rows.end, outputs: high, scratch: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::Threads;
    use crate::tape::threads::Workers;
    use std::sync::Mutex;

    #[test]
    fn every_row_is_in_one_piece_and_pieces_are_steps() {
        for (rows, step, count, expected) in [
            (1000, 96, 2, vec![0, 480]),
            (125, 12, 2, vec![0, 60]),
            (100, 12, 3, vec![0, 36, 72]),
            (126, 12, 5, vec![0, 24, 48, 72, 96]),
            (23, 12, 2, vec![0]),
            (24, 12, 5, vec![0, 12]),
            (0, 12, 2, vec![0]),
        ] {
            let workers = Workers::new(Threads(count).count()).expect("threads for a test");
            let slabs = Slabs::new(count, 7);
            let (mut single, mut double, mut scratch) = (vec![0.0_f32; rows], vec![0.0_f32; 2 * rows], [0.0; 5]);
            let pieces = Mutex::new(Vec::new());
            workers.run(|parallelism| {
                let parts = Parts::of(parallelism, &slabs, 1);
                parts.rows(rows, step, [&mut single, &mut double], &mut scratch, |rows, [single, double], scratch| {
                    assert_eq!((single.len(), double.len(), scratch.len()), (rows.len(), 2 * rows.len(), 5));
                    single.iter_mut().zip(rows.clone()).for_each(|(value, row)| *value += row as f32);
                    double.iter_mut().for_each(|value| *value += 1.0);
                    if let Ok(mut pieces) = pieces.lock() {
                        pieces.push(rows.start);
                    }
                });
            });
            let mut pieces = pieces.into_inner().expect("no piece panicked");
            pieces.sort_unstable();
            assert_eq!(pieces, expected);
            assert!(single.iter().enumerate().all(|(row, value)| *value == row as f32));
            assert!(double.iter().all(|value| *value == 1.0));
        }
    }
}
