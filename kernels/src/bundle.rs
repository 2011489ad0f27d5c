//! Products of one large matrix with the matrices of several samples, so that it comes from memory once for all of them.
//!
//! | function | result | a | b |
//! | --- | --- | --- | --- |
//! | [`ab`] | cₛ += a·bₛ | `[m, k]` | `[k, n]` each |
//! | [`atb`] | cₛ {=, +=} aᵀ·bₛ | `[k, m]` | `[k, n]` each |
//! | [`abt`] | c {=, +=} Σₛ aₛ·bₛᵀ | `[m, n]` each | `[k, n]` each |
//!
//! The samples' matrices lie side by side in the panels, as one right operand of samples·n columns. The first two give the bits of
//! products with one sample at a time (gemm.rs); the third sums along the samples first.
//!
//! Not here: for which weights it is worth while to have several samples in flight. That is the caller's to know.

use crate::level::{Isa, Level, Tiled};
use crate::tile::{self, LeftRows, Sink, Store};
use crate::{Real, Rows, RowsMut, Write, gemm};

/// Scratch, in numbers, that any function of this file needs for a matrix of `rows` by `columns` (either may be m) and samples of
/// n columns.
pub fn scratch_len(rows: usize, columns: usize, n: usize, samples: usize) -> usize {
    gemm::scratch_len(rows, columns, samples * n).max(tile::panels_len(samples * n, rows.max(columns)))
}

fn check_samples<T>(name: &str, count: usize, of: &[Rows<'_, T>], rows: usize) {
    assert_eq!(of.len(), count, "{name}: numbers of samples");
    assert!(of.iter().all(|x| x.rows() == rows && x.cols() == of[0].cols()), "{name}: shapes of the samples differ");
}

fn check_results<T>(name: &str, c: &[RowsMut<'_, T>], (rows, columns): (usize, usize)) {
    assert!(c.iter().all(|c| c.rows() == rows && c.cols() == columns), "{name}: shapes do not chain");
}

/// cₛ += a·bₛ for every sample s.
///
/// # Panics
/// If there is no sample, or shapes disagree.
pub fn ab<'a, T: Real>(level: Level, a: Rows<'a, T>, b: &'a [Rows<'a, T>], c: &'a mut [RowsMut<'a, T>], scratch: &'a mut [T]) {
    check_samples("a·b", c.len(), b, a.cols());
    check_results("a·b", c, (a.rows(), b[0].cols()));
    T::bundle_product(level, Product { a, b, c, scratch });
}

/// cₛ {=, +=} aᵀ·bₛ for every sample s.
///
/// # Panics
/// If there is no sample, or shapes disagree.
pub fn atb<'a, T: Real>(level: Level, a: Rows<'a, T>, b: &'a [Rows<'a, T>], c: &'a mut [RowsMut<'a, T>], write: Write) {
    check_samples("aᵀ·b", c.len(), b, a.rows());
    check_results("aᵀ·b", c, (a.cols(), b[0].cols()));
    T::bundle_transposed_product(level, TransposedProduct { a, b, c, write });
}

/// c {=, +=} Σₛ aₛ·bₛᵀ.
///
/// # Panics
/// If there is no sample, or shapes disagree.
pub fn abt<'a, T: Real>(
    level: Level,
    a: &'a [Rows<'a, T>],
    b: &'a [Rows<'a, T>],
    c: RowsMut<'a, T>,
    write: Write,
    scratch: &'a mut [T],
) {
    check_samples("a·bᵀ", b.len(), a, c.rows());
    check_samples("a·bᵀ", a.len(), b, c.cols());
    assert_eq!(a[0].cols(), b[0].cols(), "a·bᵀ: shapes do not chain");
    T::bundle_sum_of_products(level, SumOfProducts { a, b, c, write, scratch });
}

/// Stretches of equal sample among columns `first…first + count` of samples side by side: sample, its first column, where that is in
/// the stretch, and how many.
fn stretches(n: usize, first: usize, count: usize) -> impl Iterator<Item = (usize, usize, usize, usize)> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let (at, column) = (done, (first + done) % n);
        let width = (n - column).min(count - done);
        done += width;
        (width > 0).then_some(((first + at) / n, column, at, width))
    })
}

/// One panel of columns `first…` of the samples side by side, filled up with zeros; one line for each row of the samples in `rows`.
#[inline(always)]
fn pack_panel<T: Real, const NR: usize>(b: &[Rows<'_, T>], rows: std::ops::Range<usize>, first: usize, panel: &mut [[T; NR]]) {
    let n = b[0].cols();
    let count = NR.min(b.len() * n - first);
    for (sample, column, lane, width) in stretches(n, first, count) {
        for (line, row) in panel.iter_mut().zip(rows.clone()) {
            // A loop, and not a copy: the stretches are short.
            for (to, from) in line[lane..lane + width].iter_mut().zip(&b[sample].row(row)[column..]) {
                *to = *from;
            }
        }
    }
    if count < NR {
        for line in panel {
            line[count..].fill(T::ZERO);
        }
    }
}

/// Columns of samples side by side, each to its own matrix.
struct Beside<'a, 'b, T> {
    c: &'b mut [RowsMut<'a, T>],
    write: Write,
}

impl<T: Real> Sink<T> for Beside<'_, '_, T> {
    #[inline(always)]
    fn store<I: Isa>(&mut self, i: usize, j: usize, sums: &[T]) {
        for (sample, column, at, width) in stretches(self.c[0].cols(), j, sums.len()) {
            let pairs = self.c[sample].row_mut(i)[column..].iter_mut().zip(&sums[at..at + width]);
            match self.write {
                Write::Set => {
                    for (c, sum) in pairs {
                        *c = *sum;
                    }
                }
                Write::Add => {
                    for (c, sum) in pairs {
                        *c += *sum;
                    }
                }
            }
        }
    }
}

pub(crate) struct Product<'a, T> {
    a: Rows<'a, T>,
    b: &'a [Rows<'a, T>],
    c: &'a mut [RowsMut<'a, T>],
    scratch: &'a mut [T],
}

impl<T: Real> Tiled<T> for Product<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        tile::run_for::<T, I, MR, NR>(self.b.len() * self.b[0].cols(), ByTiles(self));
    }
}

/// The product with a tile of either shape.
struct ByTiles<K>(K);

impl<T: Real> Tiled<T> for ByTiles<Product<'_, T>> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Product { a, b, c, scratch } = self.0;
        let n = b.len() * b[0].cols();
        for (start, end) in gemm::blocks(a.cols()) {
            let depth = end - start;
            let panels = &mut scratch[..depth * n.next_multiple_of(NR)];
            if depth == 0 {
                return;
            }
            for (panel, first) in panels.chunks_exact_mut(depth * NR).zip((0..).step_by(NR)) {
                pack_panel(b, start..end, first, panel.as_chunks_mut::<NR>().0);
            }
            tile::rows::<T, I, _, _, MR, NR>(&a.columns(start, depth), n, panels, &mut Beside { c, write: Write::Add });
        }
    }
}

pub(crate) struct TransposedProduct<'a, T> {
    a: Rows<'a, T>,
    b: &'a [Rows<'a, T>],
    c: &'a mut [RowsMut<'a, T>],
    write: Write,
}

impl<T: Real> Tiled<T> for TransposedProduct<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        tile::run_for::<T, I, MR, NR>(self.b.len() * self.b[0].cols(), ByTiles(self));
    }
}

impl<T: Real> Tiled<T> for ByTiles<TransposedProduct<'_, T>> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let TransposedProduct { a, b, c, write } = self.0;
        let n = b.len() * b[0].cols();
        if a.rows() == 0 && write == Write::Set {
            for c in c.iter_mut() {
                (0..c.rows()).for_each(|i| c.row_mut(i).fill(T::ZERO));
            }
        }
        let mut panel = [[T::ZERO; NR]; tile::COLUMN_DEPTH];
        for start in (0..a.rows()).step_by(tile::COLUMN_DEPTH) {
            let end = a.rows().min(start + tile::COLUMN_DEPTH);
            let a = a.range(start, end);
            let write = if start == 0 { write } else { Write::Add };
            for j in (0..n).step_by(NR) {
                let panel = &mut panel[..end - start];
                pack_panel(b, start..end, j, panel);
                tile::columns::<T, I, _, MR, NR>((|p| a.row(p), a.cols()), panel, (j, NR.min(n - j)), &mut Beside { c, write });
            }
        }
    }
}

pub(crate) struct SumOfProducts<'a, T> {
    a: &'a [Rows<'a, T>],
    b: &'a [Rows<'a, T>],
    c: RowsMut<'a, T>,
    write: Write,
    scratch: &'a mut [T],
}

/// Rows that go on in the next sample.
struct Chained<'a, T>(&'a [Rows<'a, T>]);

impl<T> LeftRows<T> for Chained<'_, T> {
    #[inline(always)]
    fn rows(&self) -> usize {
        self.0[0].rows()
    }
    #[inline(always)]
    fn taps(&self) -> usize {
        self.0.len()
    }
    #[inline(always)]
    fn depth(&self) -> usize {
        self.0[0].cols()
    }
    #[inline(always)]
    fn piece(&self, i: usize, tap: usize) -> &[T] {
        self.0[tap].row(i)
    }
}

impl<T: Real> Tiled<T> for SumOfProducts<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { a, b, c, write, scratch } = self;
        let (n, columns) = (b[0].cols(), c.cols());
        let lines = b.len() * n;
        let panels = &mut scratch[..lines * columns.next_multiple_of(NR)];
        for (sample, b) in b.iter().enumerate().filter(|_| n > 0) {
            tile::pack_transposed::<T, NR>(n, columns, 1, |j| b.row(j), lines * NR, &mut panels[sample * n * NR..]);
        }
        tile::rows::<T, I, _, _, MR, NR>(&Chained(a), columns, panels, &mut Store { c, bias: None, write });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Matrix, assert_near};
    use crate::tolerance::Tolerance;

    fn views<T: Real>(of: &[Matrix<T>]) -> Vec<Rows<'_, T>> {
        of.iter().map(Matrix::view).collect()
    }

    /// Random matrices of the samples.
    fn random<T: Real>(seed: u64, samples: usize, shape: (usize, usize)) -> Vec<Matrix<T>> {
        (0..samples as u64).map(|sample| Matrix::random(seed + 100 * sample, shape)).collect()
    }

    fn assert_same<T: Real>(what: &str, found: &[Matrix<T>], expected: &[Matrix<T>]) {
        for (found, expected) in found.iter().zip(expected) {
            assert_near(what, &found.to_vec(), &expected.to_vec(), Tolerance::Exact);
            found.check_gaps();
        }
    }

    fn check<T: Real>((m, k, n): (usize, usize, usize), samples: usize, write: Write, seed: u64) {
        let a = Matrix::<T>::random(seed, (m, k));
        let (from_k, from_m) = (random::<T>(seed + 1, samples, (k, n)), random::<T>(seed + 2, samples, (m, n)));
        for level in Level::available() {
            let mut scratch = vec![T::NAN; scratch_len(m, k, n, samples).max(gemm::scratch_len(m, k, n))];
            let what = |form: &str| format!("{form} {m} x {k} x {n}, {samples} samples, at level {level}");

            let (mut found, mut expected) = (random::<T>(seed + 3, samples, (m, n)), random::<T>(seed + 3, samples, (m, n)));
            for (b, c) in from_k.iter().zip(&mut expected) {
                gemm::ab(level, a.view(), b.view(), c.view_mut(), Write::Add, &mut scratch);
            }
            let mut results: Vec<RowsMut<'_, T>> = found.iter_mut().map(Matrix::view_mut).collect();
            ab(level, a.view(), &views(&from_k), &mut results, &mut scratch);
            assert_same(&what("ab"), &found, &expected);

            let (mut found, mut expected) = (random::<T>(seed + 4, samples, (k, n)), random::<T>(seed + 4, samples, (k, n)));
            for (b, c) in from_m.iter().zip(&mut expected) {
                gemm::atb(level, a.view(), b.view(), c.view_mut(), write, &mut scratch);
            }
            let mut results: Vec<RowsMut<'_, T>> = found.iter_mut().map(Matrix::view_mut).collect();
            atb(level, a.view(), &views(&from_m), &mut results, write);
            assert_same(&what("atb"), &found, &expected);

            let (mut found, mut expected) = (Matrix::<T>::random(seed + 5, (m, k)), Matrix::<T>::random(seed + 5, (m, k)));
            for (sample, (a, b)) in from_m.iter().zip(&from_k).enumerate() {
                let write = if sample == 0 { write } else { Write::Add };
                gemm::abt(level, a.view(), b.view(), expected.view_mut(), write, &mut scratch);
            }
            abt(level, &views(&from_m), &views(&from_k), found.view_mut(), write, &mut scratch);
            assert_near(&what("abt"), &found.to_vec(), &expected.to_vec(), Tolerance::Close);
            found.check_gaps();
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn give_what_one_sample_at_a_time_gives(
            m in 4_usize..70, k in 4_usize..300, n in 1_usize..40, samples in 1_usize..6, add in any::<bool>(), seed in 0_u64..1000,
        ) {
            let write = if add { Write::Add } else { Write::Set };
            check::<f32>((m, k, n), samples, write, seed);
            check::<f64>((m, k, n), samples, write, seed);
        }
    }

    #[test]
    fn sizes_of_the_networks() {
        for (m, k, n) in [(500, 1000, 16), (125, 250, 16), (128, 800, 1)] {
            check::<f32>((m, k, n), 4, Write::Set, 3);
        }
    }
}
