//! Products with a result of a few rows: the right operand is read where it lies, once for all rows, for packing it would cost more than the
//! product.
//!
//! What a row gives does not depend, to the bit, on how many there are beside it.
//!
//! Not here: other results, and what is done with the sums (tile.rs).

use super::{Product, Right};
use crate::instruction_set::Isa;
use crate::tile::{self, Pair, Sink, Store};
use crate::vector::Vector;
use crate::{Real, Rows};

/// Rows of such a result at most: with registers for two vectors of each.
pub(super) const FEW: usize = 4;

impl<T: Real> Product<'_, T> {
    /// The product, of at most [`FEW`] rows.
    #[inline(always)]
    pub(super) fn few_rows<I: Isa, const NR: usize>(self) {
        match self.c.rows() {
            0 => {}
            1 => self.rows::<I, 1, NR>(),
            2 => self.rows::<I, 2, NR>(),
            3 => self.rows::<I, 3, NR>(),
            FEW => self.rows::<I, FEW, NR>(),
            rows => unreachable!("{rows} rows are not few"),
        }
    }

    #[inline(always)]
    fn rows<I: Isa, const R: usize, const NR: usize>(self) {
        let Product { a, b, bias, c, write, .. } = self;
        let mut left: [&[T]; R] = [&[]; R];
        for (i, row) in left.iter_mut().enumerate() {
            *row = a.row(i);
        }
        let mut sink = Store { c, bias, write };
        match b {
            Right::Plain(b) => sums_of_rows::<T, I, R, NR>(left, b, &mut sink),
            Right::Transposed(b) => inner_products::<T, I, R, NR>(left, b, &mut sink),
        }
    }
}

/// c[i] = Σ_p a[i][p]·b[p], NR columns at a time.
#[inline(always)]
fn sums_of_rows<T: Real, I: Isa, const R: usize, const NR: usize>(a: [&[T]; R], b: Rows<'_, T>, sink: &mut Store<'_, T>) {
    let n = b.cols();
    for j in (0..n).step_by(NR) {
        let width = NR.min(n - j);
        let mut acc = [[I::Vector::splat(T::ZERO); 2]; R];
        let mut last = [T::ZERO; NR];
        for (p, row) in (0..b.rows()).map(|p| b.row(p)).enumerate() {
            let columns = &row[j..];
            let line = match columns.first_chunk::<NR>() {
                Some(line) => line,
                None => {
                    last[..width].copy_from_slice(columns);
                    &last
                }
            };
            let line = tile::load::<T, I, NR>(line);
            for i in 0..R {
                tile::accumulate::<T, I, NR>(&mut acc[i], a[i][p], line);
            }
        }
        for (i, sums) in tile::spill::<T, I, R, NR>(acc).iter().enumerate() {
            sink.store::<I>(i, j, &sums[..width]);
        }
    }
}

/// c[i][j] = ⟨a[i], b[j]⟩, NR sums side by side; what is left at the end of the rows is filled up with zeros.
#[inline(always)]
fn inner_products<T: Real, I: Isa, const R: usize, const NR: usize>(a: [&[T]; R], b: Rows<'_, T>, sink: &mut Store<'_, T>) {
    let mut whole: [&[[T; NR]]; R] = [&[]; R];
    let mut ends = [[T::ZERO; NR]; R];
    for i in 0..R {
        (whole[i], ends[i]) = chunks(a[i]);
    }
    for j in 0..b.rows() {
        let (lines, end) = chunks::<T, NR>(b.row(j));
        let mut acc = [[I::Vector::splat(T::ZERO); 2]; R];
        for (p, line) in lines.iter().enumerate() {
            let line = tile::load::<T, I, NR>(line);
            for i in 0..R {
                multiply::<T, I, NR>(&mut acc[i], &whole[i][p], line);
            }
        }
        let line = tile::load::<T, I, NR>(&end);
        for i in 0..R {
            multiply::<T, I, NR>(&mut acc[i], &ends[i], line);
        }
        for (i, sums) in tile::spill::<T, I, R, NR>(acc).into_iter().enumerate() {
            sink.store::<I>(i, j, &[total(sums)]);
        }
    }
}

/// A row in pieces of NR numbers, and what is left of it with zeros behind.
#[inline(always)]
fn chunks<T: Real, const NR: usize>(row: &[T]) -> (&[[T; NR]], [T; NR]) {
    let (chunks, rest) = row.as_chunks::<NR>();
    let mut end = [T::ZERO; NR];
    end[..rest.len()].copy_from_slice(rest);
    (chunks, end)
}

/// `acc += a·b`, number by number.
#[inline(always)]
fn multiply<T: Real, I: Isa, const NR: usize>(acc: &mut Pair<T, I>, a: &[T; NR], b: Pair<T, I>) {
    let a = tile::load::<T, I, NR>(a);
    acc[0] = a[0].mul_add(b[0], acc[0]);
    if tile::is_pair::<T, I, NR>() {
        acc[1] = a[1].mul_add(b[1], acc[1]);
    }
}

/// The sum of NR numbers, a power of two: halves onto halves.
#[inline(always)]
fn total<T: Real, const NR: usize>(mut numbers: [T; NR]) -> T {
    let mut half = NR / 2;
    while half > 0 {
        for i in 0..half {
            let upper = numbers[i + half];
            numbers[i] += upper;
        }
        half /= 2;
    }
    numbers[0]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::gemm::{ab, abt, scratch_len};
    use crate::instruction_set::InstructionSet;
    use crate::testing::{Matrix, assert_near};
    use crate::tolerance::Tolerance;
    use crate::{Write, reference};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn a_row_is_the_same_alone(rows in 1..=FEW, k in 0_usize..150, n in 0_usize..150, seed in 0_u64..1000) {
            let (a, b) = (Matrix::<f32>::random(seed, (rows, k)), Matrix::<f32>::random(seed + 1, (k, n)));
            let bt = Matrix::<f32>::random(seed + 1, (n, k));
            let [mut expected_ab, mut expected_abt] = [(); 2].map(|()| Matrix::<f32>::poisoned(seed, (rows, n)));
            reference::gemm_ab(a.view(), b.view(), expected_ab.view_mut());
            reference::gemm_abt(a.view(), bt.view(), expected_abt.view_mut());
            for isa in InstructionSet::available() {
                let mut scratch = vec![f32::NAN; scratch_len(rows, k, n)];
                let [mut together, mut alone] = [(); 2].map(|()| Matrix::<f32>::poisoned(seed, (rows, n)));
                for (right, is_transposed, expected) in [(&b, false, &expected_ab), (&bt, true, &expected_abt)] {
                    let product = if is_transposed { abt } else { ab };
                    product(isa, a.view(), right.view(), together.view_mut(), Write::Set, &mut scratch);
                    for row in 0..rows {
                        let c = alone.view_mut().range(row, row + 1);
                        product(isa, a.view().range(row, row + 1), right.view(), c, Write::Set, &mut scratch);
                    }
                    assert_near("together and alone", &together.to_vec(), &alone.to_vec(), Tolerance::Exact);
                    assert_near("the triple loop", &together.to_vec(), &expected.to_vec(), Tolerance::Close);
                }
            }
        }
    }
}
