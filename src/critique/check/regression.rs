//! Least squares on sums by block, and intervals that hold where errors within a block depend on each other.

use crate::student_t::quantile_975;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Sums of one block: XᵀX, Xᵀy and Σy².
#[derive(Clone)]
struct Sums<const K: usize> {
    /// XᵀX, of which the diagonal and what is below it are kept up.
    lower: [[f64; K]; K],
    moment: [f64; K],
    square: f64,
    rows: f64,
}

impl<const K: usize> Sums<K> {
    const NOTHING: Self = Self { lower: [[0.0; K]; K], moment: [0.0; K], square: 0.0, rows: 0.0 };

    /// Of XᵀX.
    fn gram(&self, i: usize, j: usize) -> f64 {
        self.lower[i.max(j)][i.min(j)]
    }

    fn total(several: &[Self]) -> Self {
        several.iter().fold(Self::NOTHING, |mut sum, one| {
            sum.take(one);
            sum
        })
    }

    fn take(&mut self, one: &Self) {
        self.lower.as_flattened_mut().iter_mut().zip(one.lower.as_flattened()).for_each(|(sum, one)| *sum += one);
        self.moment.iter_mut().zip(one.moment).for_each(|(sum, one)| *sum += one);
        self.square += one.square;
        self.rows += one.rows;
    }

    /// With one column more, that is `column` of some of the rows, whose sums are `after`, and 0 in the others. `J` is `K` + 1.
    fn stepped<const J: usize>(&self, column: usize, after: &Self) -> Sums<J> {
        assert_eq!(J, K + 1, "one column more");
        let place = |i: usize| if i < K { i } else { column };
        let gram = |i: usize, j: usize| {
            let sums = if i < K && j < K { self } else { after };
            sums.gram(place(i), place(j))
        };
        Sums {
            lower: std::array::from_fn(|i| std::array::from_fn(|j| gram(i, j))),
            moment: std::array::from_fn(|i| if i < K { self.moment[i] } else { after.moment[column] }),
            square: self.square,
            rows: self.rows,
        }
    }

    /// The least-squares fit on these sums. `None` where the columns do not determine β.
    fn solution(&self) -> Option<Solution<K>> {
        // Columns in units of their own length, so that the factorisation sees correlations and not units.
        let scale: [f64; K] = std::array::from_fn(|i| self.gram(i, i).sqrt());
        if scale.iter().any(|scale| !(*scale > 0.0 && scale.is_finite())) {
            return None;
        }
        let gram = DMatrix::from_fn(K, K, |i, j| self.gram(i, j) / (scale[i] * scale[j]));
        let inverse = Cholesky::new(gram)?.inverse();
        let scaled = &inverse * DVector::from_fn(K, |i, _| self.moment[i] / scale[i]);
        let beta: [f64; K] = std::array::from_fn(|i| scaled[i] / scale[i]);
        beta.iter().all(|beta| beta.is_finite()).then_some(Solution { beta, scale, inverse })
    }

    /// Squared errors that β leaves.
    fn error(&self, beta: &[f64; K]) -> f64 {
        let fitted = |i: usize| (0..K).map(|j| self.gram(i, j) * beta[j]).sum::<f64>();
        (self.square + (0..K).map(|i| beta[i] * (fitted(i) - 2.0 * self.moment[i])).sum::<f64>()).max(0.0)
    }
}

/// A regression y = Xβ + e on K columns, kept as sums by block.
#[derive(Clone)]
pub(super) struct BlockRegression<const K: usize> {
    blocks: Vec<Sums<K>>,
    open: Option<(usize, usize)>,
}

/// β, the lengths of the columns, and (XᵀX)⁻¹ in units of these.
struct Solution<const K: usize> {
    beta: [f64; K],
    scale: [f64; K],
    inverse: DMatrix<f64>,
}

/// One coefficient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub value: f64,
    /// 95 % interval.
    pub interval: [f64; 2],
}

impl<const K: usize> BlockRegression<K> {
    pub fn new() -> Self {
        Self { blocks: Vec::new(), open: None }
    }

    /// Adds one row. Rows of one block (flight, number) come together.
    pub fn add(&mut self, block: (usize, usize), row: &[f64; K], value: f64) {
        if self.open != Some(block) {
            self.open = Some(block);
            self.blocks.push(Sums::NOTHING);
        }
        let Some(sums) = self.blocks.last_mut() else { return };
        sums.square += value * value;
        sums.rows += 1.0;
        for (i, left) in row.iter().enumerate() {
            sums.moment[i] += left * value;
            row[..=i].iter().enumerate().for_each(|(j, right)| sums.lower[i][j] += left * right);
        }
    }

    /// Adds the blocks of another, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        self.blocks.extend(other.blocks.chunks(together).map(Sums::total));
        self.open = None;
    }

    /// Of these blocks only.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        Self { blocks: self.blocks.iter().take(range.end).skip(range.start).cloned().collect(), open: None }
    }

    /// On some of the columns.
    pub fn on<const J: usize>(&self, columns: [usize; J]) -> BlockRegression<J> {
        let of = |sums: &Sums<K>| Sums {
            lower: columns.map(|i| columns.map(|j| sums.gram(i, j))),
            moment: columns.map(|i| sums.moment[i]),
            square: sums.square,
            rows: sums.rows,
        };
        BlockRegression { blocks: self.blocks.iter().map(of).collect(), open: None }
    }

    /// With one column more: one of the others from this block on, and 0 before. `J` is `K` + 1.
    pub fn stepped<const J: usize>(&self, column: usize, from: usize) -> BlockRegression<J> {
        let of = |(block, sums): (usize, &Sums<K>)| sums.stepped(column, if block < from { &Sums::NOTHING } else { sums });
        BlockRegression { blocks: self.blocks.iter().enumerate().map(of).collect(), open: None }
    }

    /// Of [`BlockRegression::stepped`] from each of some blocks on: the squared errors of its fit, and that block, where the fit is determined. In one pass
    /// over the blocks.
    pub fn steps<const J: usize>(&self, column: usize, places: std::ops::Range<usize>) -> Vec<(f64, usize)> {
        if self.blocks.len() <= J || places.end > self.blocks.len() {
            return Vec::new();
        }
        let total = Sums::total(&self.blocks);
        let mut after = Sums::total(&self.blocks[places.end..]);
        let of = |from: usize| {
            after.take(&self.blocks[from]);
            let stepped = total.stepped::<J>(column, &after);
            Some((stepped.error(&stepped.solution()?.beta), from))
        };
        let mut left: Vec<(f64, usize)> = places.rev().filter_map(of).collect();
        left.reverse();
        left
    }

    /// The blocks of several as one.
    pub fn merged<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        Self { blocks: parts.flat_map(|part| part.blocks.iter().cloned()).collect(), open: None }
    }

    /// Standard deviation of a column over rows, the 1 being column `constant`, in units of that one.
    pub fn deviation(&self, column: usize, constant: usize) -> f64 {
        let total = |i: usize, j: usize| self.blocks.iter().map(|sums| sums.gram(i, j)).sum::<f64>();
        let weight = total(constant, constant);
        let mean = total(column, constant) / weight;
        (total(column, column) / weight - mean * mean).max(0.0).sqrt()
    }

    /// Sum of the squares of what is regressed.
    pub fn square(&self) -> f64 {
        self.blocks.iter().map(|sums| sums.square).sum()
    }

    /// The same of each block.
    pub fn squares(&self) -> Vec<f64> {
        self.blocks.iter().map(|sums| sums.square).collect()
    }

    /// Share of the squares of what is regressed that the fit explains. `None` as in [`BlockRegression::estimates`].
    pub fn explained(&self) -> Option<f64> {
        Some(1.0 - self.errors()?.iter().sum::<f64>() / self.square())
    }

    /// Root mean square of what is regressed.
    pub fn response(&self) -> f64 {
        (self.square() / self.rows()).sqrt()
    }

    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// β and its intervals from the sandwich (XᵀX)⁻¹ (Σ s_b s_bᵀ) (XᵀX)⁻¹ with block scores s_b = X_bᵀ e_b (Liang & Zeger
    /// 1986), times B/(B − 1), and Student's t with B − K degrees of freedom. `None` if there are too few blocks or the columns
    /// do not determine β.
    pub fn estimates(&self) -> Option<[Estimate; K]> {
        let Solution { beta, scale, inverse } = self.solution()?;
        let mut meat = DMatrix::<f64>::zeros(K, K);
        for sums in &self.blocks {
            let fitted = |i: usize| (0..K).map(|j| sums.gram(i, j) * beta[j]).sum::<f64>();
            let score = DVector::from_fn(K, |i, _| (sums.moment[i] - fitted(i)) / scale[i]);
            meat += &score * score.transpose();
        }
        let blocks = self.blocks.len() as f64;
        let covariance = &inverse * meat * &inverse * (blocks / (blocks - 1.0));
        let quantile = quantile_975((self.blocks.len() - K) as f64);
        let estimates = std::array::from_fn(|i| {
            let half = quantile * covariance[(i, i)].max(0.0).sqrt() / scale[i];
            Estimate { value: beta[i], interval: [beta[i] - half, beta[i] + half] }
        });
        estimates.iter().all(|estimate| estimate.interval.iter().all(|bound| bound.is_finite())).then_some(estimates)
    }

    /// The common least-squares fit. `None` as in [`BlockRegression::estimates`].
    fn solution(&self) -> Option<Solution<K>> {
        if self.blocks.len() <= K {
            return None;
        }
        Sums::total(&self.blocks).solution()
    }

    /// The fit to this part of the blocks, those that it explains best: blocks of another kind do not bend it (least trimmed squares by concentration steps,
    /// Rousseeuw & Van Driessen 2006). `None` as in [`BlockRegression::estimates`].
    pub fn fit_to_best(&self, part: f64) -> Option<[f64; K]> {
        const STEPS: usize = 5;
        let mut beta = self.solution()?.beta;
        for _ in 0..STEPS {
            let now = self.errors_of(&beta);
            let share = |at: &usize| now[*at] / self.blocks[*at].square.max(f64::MIN_POSITIVE);
            let mut order: Vec<usize> = (0..self.blocks.len()).collect();
            order.sort_unstable_by(|one, other| share(one).total_cmp(&share(other)));
            order.truncate((part * order.len() as f64).ceil() as usize);
            let best = order.iter().fold(Sums::NOTHING, |mut sum, at| {
                sum.take(&self.blocks[*at]);
                sum
            });
            beta = best.solution()?.beta;
        }
        Some(beta)
    }

    /// Sum of squared errors of each block under these coefficients.
    pub fn errors_of(&self, beta: &[f64; K]) -> Vec<f64> {
        self.blocks.iter().map(|sums| sums.error(beta)).collect()
    }

    /// Rows added.
    pub fn rows(&self) -> f64 {
        self.blocks.iter().map(|sums| sums.rows).sum()
    }

    /// Sum of squared errors of each block under the common least-squares fit. `None` as in [`BlockRegression::estimates`].
    pub fn errors(&self) -> Option<Vec<f64>> {
        Some(self.errors_of(&self.solution()?.beta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::random::Stream;

    #[test]
    fn steps_are_those_of_the_stepped_regressions() {
        let stream = Stream::new(5, 0, 0, 0);
        let drawn = |index: u64| stream.uniform(index) - 0.5;
        let mut regression = BlockRegression::<3>::new();
        for index in 0..600 {
            let row = [1.0, drawn(3 * index), drawn(3 * index + 1)];
            let block = index as usize / 20;
            let gain = if block < 17 { 2.0 } else { 3.0 };
            regression.add((0, block), &row, 0.5 + gain * row[1] - row[2] + 0.3 * drawn(3 * index + 2));
        }
        let found = regression.steps::<4>(1, 4..27);
        assert_eq!(found.iter().map(|step| step.1).collect::<Vec<_>>(), (4..27).collect::<Vec<_>>());
        for (left, from) in &found {
            let errors = regression.stepped::<4>(1, *from).errors().map(|errors| errors.iter().sum::<f64>());
            assert!(errors.is_some_and(|errors| (left / errors - 1.0).abs() < 1e-9), "{from}: {left} {errors:?}");
        }
        assert_eq!(found.iter().min_by(|one, other| one.0.total_cmp(&other.0)).map(|step| step.1), Some(17));
        assert!(regression.part(0..4).steps::<4>(1, 1..3).is_empty() && regression.steps::<4>(1, 4..31).is_empty());
    }
}
