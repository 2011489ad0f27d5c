//! How surely an effect is more than chance: sign flips of block scores.
//!
//! A block's score is the covariance of the effect's regressors, made orthogonal to the model's, with what the model leaves over in
//! the block. Were the effect absent, each block's score would be as likely with the other sign, whatever the noise is like inside
//! the block; so the share of random sign choices that reach the observed statistic is a p-value that needs neither whiteness nor
//! normality (Hemerik, Goeman & Finos 2020, J. Royal Statistical Society B 82:841). The statistic is studentised, S = sᵀ V⁻¹ s with
//! s the sum and V the sum of squares of the block scores, and the largest over the effect's grid, under the same signs.
//!
//! Numbers that each flight has for itself are tested as a variance between flights: the scores of a flight's blocks then lean one way.
//!
//! A lag or a delay has no coefficient; its regressor is the change it makes to the prediction, and its test is one-sided. Blocks are weighted by the
//! inverse of their error, or a few aerobatic ones would decide everything.

use super::design::Layout;
use super::engine::Trial;
use super::fit::{Reduced, components};
use super::gram::BlockGram;
use crate::flight::{Channel, PerChannel};
use nalgebra::{Cholesky, DMatrix, DVector};
use phyture_kernels::random::Stream;
use std::ops::Range;

/// Where in a run the signs are drawn; other draws have other sites.
const SITE: u64 = 0x7369_676e;

/// Random sign choices.
pub(super) const FLIPS: usize = 10_000;

/// Whitened block scores of one variant: `Σ z_b` is standard normal in each column if the effect is absent.
#[derive(Clone, Debug)]
pub(super) struct Scores {
    /// Blocks by columns.
    pub blocks: DMatrix<f64>,
    /// Only a positive sum speaks for the effect.
    pub one_sided: bool,
}

/// Block scores of a variant's own coefficients, and how much its regressors move.
pub(super) struct Raw {
    /// Blocks by coefficients: `x̃ᵀ e`.
    pub scores: DMatrix<f64>,
    /// Blocks by coefficients: `x̃ᵀ x̃`.
    pub energy: DMatrix<f64>,
    /// As of [`Scores::one_sided`].
    pub one_sided: bool,
}

/// The blocks of a flight.
pub(super) struct OwnBlocks<'a> {
    pub name: &'a str,
    pub blocks: Range<usize>,
    /// Samples that tell as much as one independent one.
    pub correlation: f64,
}

/// Scores of a variant against the model it would enlarge. `None` where its regressors are those of the model.
///
/// What the model has for each flight, wind or a bias, is taken out of all columns flight by flight. `locals` are those numbers by index in the
/// model's layout, with their usual spread.
pub(super) fn raw_scores(
    base: &Trial,
    trial: &Trial,
    grams: &[BlockGram],
    weights: &PerChannel<Vec<f64>>,
    flights: &[OwnBlocks<'_>],
    locals: &[(usize, f64)],
) -> Option<Raw> {
    let effect = trial.model.effects.last()?;
    let one_sided = effect.coefficients.is_empty();
    let known = base.layout.free.len();
    // A number that acts in several channels is known from all of them.
    let acts = |channel: &Channel| match one_sided {
        true => trial.changed[*channel],
        false => trial.layout.channels[*channel].free.iter().any(|entry| entry.0 >= known),
    };
    let fitted_together = components(&trial.layout).into_iter().map(|(channels, _)| channels);
    let mut channels: Vec<Channel> = fitted_together.filter(|channels| channels.iter().any(acts)).flatten().collect();
    channels.sort_unstable();
    // The model's own coefficients that act in these channels, then the effect's; of a swap that is the change it makes.
    let of_channel = |&channel: &Channel| {
        let layout = if one_sided { &base.layout } else { &trial.layout };
        layout.channels[channel].free.iter().map(|entry| entry.0).collect::<Vec<_>>()
    };
    let mut members: Vec<usize> = channels.iter().flat_map(of_channel).chain(one_sided.then_some(known)).collect();
    members.sort_unstable();
    members.dedup();
    let is_local = |member: &usize| locals.iter().any(|local| local.0 == *member);
    let (own, members): (Vec<usize>, Vec<usize>) = members.into_iter().partition(is_local);
    let own: Vec<(usize, f64)> = locals.iter().filter(|local| own.contains(&local.0)).copied().collect();
    let split = members.partition_point(|&member| member < known);
    let columns = Places { members: &members, own: &own };
    let mut blocks: Vec<DMatrix<f64>> = Vec::with_capacity(grams.len());
    for flight in flights {
        let layout = if one_sided { &difference(base, trial, flight.name) } else { &trial.layout };
        let squares = columns.squares(layout, &channels, (grams, weights), flight.blocks.clone());
        blocks.extend(columns.without_own(squares, flight.correlation)?);
    }
    scores(&blocks, split, one_sided)
}

/// Block scores of the columns from `split` on against those before, from squares of all columns and what was measured in the last place.
fn scores(blocks: &[DMatrix<f64>], split: usize, one_sided: bool) -> Option<Raw> {
    let size = blocks.first()?.nrows() - 1;
    let new = size - split;
    let mut total = DMatrix::zeros(size + 1, size + 1);
    blocks.iter().for_each(|block| total += block);
    let scale = DVector::from_fn(size, |index, _| 1.0 / total[(index, index)].sqrt());
    if scale.iter().any(|scale| !scale.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(size, size, |row, column| total[(row, column)] * scale[row] * scale[column]);
    let own = Cholesky::new(scaled.view((0, 0), (split, split)).into_owned())?;
    let null = own.solve(&DVector::from_fn(split, |row, _| total[(row, size)] * scale[row]));
    let onto = own.solve(&scaled.view((0, split), (split, new)).into_owned());
    // Each of the effect's regressors as it is after the model's have been taken out, and the residual, in terms of the columns.
    let mut tilde = DMatrix::zeros(size + 1, new);
    let mut residual = DVector::zeros(size + 1);
    residual[size] = 1.0;
    for row in 0..split {
        residual[row] = -null[row] * scale[row];
        for column in 0..new {
            tilde[(row, column)] = -onto[(row, column)] * scale[row] / scale[split + column];
        }
    }
    for column in 0..new {
        tilde[(split + column, column)] = 1.0;
    }
    let (mut scores, mut energy) = (DMatrix::zeros(blocks.len(), new), DMatrix::zeros(blocks.len(), new));
    for (index, block) in blocks.iter().enumerate() {
        let half = block * &tilde;
        for column in 0..new {
            scores[(index, column)] = half.column(column).dot(&residual);
            energy[(index, column)] = half.column(column).dot(&tilde.column(column)).max(0.0);
        }
    }
    // What the model's columns already say is not the effect's.
    let independent =
        (0..new).all(|column| energy.column(column).sum() > SMALLEST_REMAINDER * total[(split + column, split + column)]);
    independent.then_some(Raw { scores, energy, one_sided })
}

/// Where the numbers of a test stand among its columns: those common to all flights, the measured acceleration, those of each flight.
struct Places<'a> {
    members: &'a [usize],
    own: &'a [(usize, f64)],
}

impl Places<'_> {
    fn of(&self, free: usize) -> usize {
        let own = || self.members.len() + 1 + self.own.iter().position(|own| own.0 == free).expect("common to all or of each");
        self.members.binary_search(&free).unwrap_or_else(|_| own())
    }

    /// One square a block: `[X | y | X of the flight]ᵀ W [X | y | X of the flight]` over the channels.
    fn squares(
        &self,
        layout: &Layout,
        channels: &[Channel],
        (grams, weights): (&[BlockGram], &PerChannel<Vec<f64>>),
        range: Range<usize>,
    ) -> Vec<DMatrix<f64>> {
        let size = self.members.len() + 1 + self.own.len();
        let mut squares = vec![DMatrix::zeros(size, size); range.len()];
        for &channel in channels {
            let reduced = Reduced::new(layout, channel, &grams[range.clone()]);
            let places: Vec<usize> = reduced.free.iter().map(|&free| self.of(free)).chain([self.members.len()]).collect();
            for ((sum, square), block) in squares.iter_mut().zip(&reduced.blocks).zip(range.clone()) {
                for (column, &to) in places.iter().enumerate() {
                    for (row, &from) in places.iter().enumerate() {
                        sum[(from, to)] += weights[channel][block] * square[(row, column)];
                    }
                }
            }
        }
        squares
    }

    /// The squares of a flight's blocks after its own numbers, held near zero by their usual spread, have been fitted to each column.
    fn without_own(&self, squares: Vec<DMatrix<f64>>, correlation: f64) -> Option<Vec<DMatrix<f64>>> {
        let common = self.members.len() + 1;
        if self.own.is_empty() {
            return Some(squares);
        }
        let size = common + self.own.len();
        let total = squares.iter().fold(DMatrix::zeros(size, size), |total, square| total + square);
        let mut matrix = total.view((common, common), (self.own.len(), self.own.len())).into_owned();
        self.own.iter().enumerate().for_each(|(place, (_, spread))| matrix[(place, place)] += correlation / (spread * spread));
        let made_of = Cholesky::new(matrix)?.solve(&total.view((common, 0), (self.own.len(), common)).into_owned());
        // A column x becomes x - L m: squares, products and what was measured alike.
        let one = |square: DMatrix<f64>| {
            let mut left = square.view((0, 0), (common, common)).into_owned();
            let across = square.view((common, 0), (self.own.len(), common));
            let inner = square.view((common, common), (self.own.len(), self.own.len())) * &made_of - across;
            left.gemm_tr(1.0, &made_of, &inner, 1.0);
            left.gemm_tr(-1.0, &across, &made_of, 1.0);
            left
        };
        Some(squares.into_iter().map(one).collect())
    }
}

/// Share of a regressor that must remain once the model's regressors are taken out; less is rounding or collinearity.
const SMALLEST_REMAINDER: f64 = 1e-6;

impl Raw {
    /// Studentised.
    pub fn whitened(&self) -> Option<Scores> {
        let variance = self.scores.transpose() * &self.scores;
        let size = variance.nrows();
        let scale = DVector::from_fn(size, |index, _| 1.0 / variance[(index, index)].sqrt());
        if scale.iter().any(|scale| !scale.is_finite()) {
            return None;
        }
        let correlation = DMatrix::from_fn(size, size, |row, column| variance[(row, column)] * scale[row] * scale[column]);
        let scaled = DMatrix::from_fn(size, self.scores.nrows(), |row, column| self.scores[(column, row)] * scale[row]);
        let whitened = Cholesky::new(correlation)?.l().solve_lower_triangular(&scaled)?;
        Some(Scores { blocks: whitened.transpose(), one_sided: self.one_sided })
    }
}

/// The layout of `base` and one coefficient more, that of the change a swap makes to the prediction in a flight.
fn difference(base: &Trial, trial: &Trial, flight: &str) -> Layout {
    let mut layout = base.layout.clone();
    let new = layout.free.len();
    layout.free.push(super::design::Free { effect: trial.model.effects.len() - 1, coefficient: 0 });
    for channel in Channel::ALL.into_iter().filter(|&channel| trial.changed[channel]) {
        let mut columns: Vec<(usize, f64)> = Vec::new();
        let mut add = |column: usize, weight: f64| match columns.iter_mut().find(|known| known.0 == column) {
            Some(known) => known.1 += weight,
            None => columns.push((column, weight)),
        };
        for (layout, sign) in [(&trial.layout, 1.0), (&base.layout, -1.0)] {
            for (free, weighted) in &layout.channels[channel].free {
                let value = trial.value_in(*free, flight);
                weighted.iter().for_each(|&(column, weight)| add(column, sign * weight * value));
            }
            layout.channels[channel].fixed.iter().for_each(|&column| add(column, sign));
        }
        layout.channels[channel].free.push((new, columns));
    }
    layout
}

/// Weights of blocks: 2/(1 + e/m) of the channel's inverse error, with e the block's mean squared error and m the channel's.
pub(super) fn block_weights(base: &Trial, rows: &[usize]) -> PerChannel<Vec<f64>> {
    let total: usize = rows.iter().sum();
    PerChannel::from_fn(|channel| {
        let mse = base.errors[channel].iter().sum::<f64>() / total.max(1) as f64;
        let weight = |(error, rows): (&f64, &usize)| 2.0 / (1.0 + error / *rows as f64 / mse) / mse;
        base.errors[channel].iter().zip(rows).map(weight).collect()
    })
}

/// Random signs, the same for every candidate of a step.
pub(super) struct Flips {
    /// Of eight blocks after the other a byte a choice, blocks before choices; a bit is set where the sign is minus.
    signs: Vec<u8>,
}

/// Blocks whose signs are one byte.
const OCTET: usize = 8;

impl Flips {
    pub fn new(blocks: usize, seed: u64) -> Self {
        let stream = Stream::new(seed, 0, SITE, 0);
        let octets = blocks.div_ceil(OCTET);
        let mut signs = vec![0; octets * FLIPS];
        for choice in 0..FLIPS {
            let words = stream.sub(choice as u64);
            for octet in 0..octets {
                signs[octet * FLIPS + choice] = words.word((octet / 4) as u32).to_le_bytes()[octet % 4];
            }
        }
        Self { signs }
    }

    /// `Σ ± value(block)` over some blocks under each choice. The sums that eight blocks can make are looked up by their signs.
    fn sums(&self, blocks: Range<usize>, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; FLIPS];
        for octet in blocks.start / OCTET..blocks.end.div_ceil(OCTET) {
            let own: [f64; OCTET] = std::array::from_fn(|bit| {
                let block = octet * OCTET + bit;
                if blocks.contains(&block) { value(block) } else { 0.0 }
            });
            let mut table = [own.iter().sum::<f64>(); 1 << OCTET];
            for signs in 1..table.len() {
                table[signs] = table[signs & (signs - 1)] - 2.0 * own[signs.trailing_zeros() as usize];
            }
            let signs = &self.signs[octet * FLIPS..(octet + 1) * FLIPS];
            sums.iter_mut().zip(signs).for_each(|(sum, &signs)| *sum += table[usize::from(signs)]);
        }
        sums
    }

    /// p-value of the largest statistic over the variants of one effect.
    pub fn p_value(&self, variants: &[Scores]) -> f64 {
        let mut observed = f64::NEG_INFINITY;
        let mut largest = vec![f64::NEG_INFINITY; FLIPS];
        for Scores { blocks, one_sided } in variants {
            let mut flipped = vec![0.0; FLIPS];
            let mut unflipped = 0.0;
            for column in blocks.column_iter() {
                let sums = self.sums(0..column.len(), |block| column[block]);
                let statistic = |sum: f64| if *one_sided { sum } else { sum * sum };
                flipped.iter_mut().zip(sums).for_each(|(total, sum)| *total += statistic(sum));
                unflipped += statistic(column.sum());
            }
            observed = observed.max(unflipped);
            largest.iter_mut().zip(flipped).for_each(|(largest, value)| *largest = largest.max(value));
        }
        self.share(observed, &largest)
    }

    /// p-value of numbers that each flight has for itself. `scores` are of their columns, blocks by numbers, `spreads` what is usual of the numbers,
    /// `runs` the blocks of each flight.
    ///
    /// The statistic is the locally most powerful one for a variance between groups, Σ_f Σ_k (s_k Σ_b u_bk)² (Lin 1997, Biometrika 84:309):
    /// in a flight all blocks' scores lean the way of its number, and signs of blocks, chosen at random, undo that.
    pub fn p_value_between_flights(&self, scores: &DMatrix<f64>, spreads: &[f64], runs: &[Range<usize>]) -> f64 {
        let (mut observed, mut flipped) = (0.0, vec![0.0; FLIPS]);
        for run in runs {
            for (column, spread) in scores.column_iter().zip(spreads) {
                let sums = self.sums(run.clone(), |block| spread * column[block]);
                flipped.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum * sum);
                observed += run.clone().map(|block| spread * column[block]).sum::<f64>().powi(2);
            }
        }
        self.share(observed, &flipped)
    }

    /// p-value of a sum of independent gains, one for each block that is used.
    pub fn p_value_of_sums(&self, gains: &[f64]) -> f64 {
        self.share(gains.iter().sum(), &self.sums(0..gains.len(), |block| gains[block]))
    }

    fn share(&self, observed: f64, flipped: &[f64]) -> f64 {
        // What differs by rounding alone counts against the effect.
        let bar = observed - 1e-9 * observed.abs();
        let reached = flipped.iter().filter(|value| **value >= bar).count();
        (reached + 1) as f64 / (FLIPS + 1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    /// Scores of pure noise: symmetric, and louder in some blocks than in others.
    fn noise(seed: u64, blocks: usize, columns: usize) -> Raw {
        let stream = Stream::new(seed, 1, 2, 3);
        let score = |block: usize, column: usize| {
            let loud = 1.0 + 9.0 * stream.uniform(block as u64).powi(4);
            loud * (2.0 * stream.uniform((1000 + block * columns + column) as u64) - 1.0)
        };
        Raw {
            scores: DMatrix::from_fn(blocks, columns, score),
            energy: DMatrix::from_element(blocks, columns, 1.0),
            one_sided: false,
        }
    }

    /// Of 200 p-values of pure noise 10 are expected below 0.05; fewer than 2 or more than 21 come with a probability of 0.1 % together
    /// (binomial).
    #[test]
    fn p_values_of_pure_noise_are_below_five_percent_one_time_in_twenty() {
        let flips = Flips::new(60, 1);
        for columns in [1, 3] {
            let p = |seed: u64| noise(seed, 60, columns).whitened().map_or(f64::NAN, |scores| flips.p_value(&[scores]));
            let values: Vec<f64> = (0..200).map(p).collect();
            assert!(values.iter().all(|p| (0.0..=1.0).contains(p)));
            let below = values.iter().filter(|p| **p < 0.05).count();
            assert!((2..=21).contains(&below), "{columns} columns: {below} of 200");
            // And half of them below one half: 72 to 128 with a probability of 99.99 %.
            let below = values.iter().filter(|p| **p < 0.5).count();
            assert!((72..=128).contains(&below), "{columns} columns: {below} of 200");
        }
    }

    #[test]
    fn p_values_of_sums_of_pure_noise_are_uniform_too() {
        let flips = Flips::new(60, 1);
        let p = |seed: u64| flips.p_value_of_sums(noise(seed, 60, 1).scores.column(0).as_slice());
        let below = (300..500).map(p).filter(|p| *p < 0.05).count();
        assert!((2..=21).contains(&below), "{below} of 200");
    }

    #[test]
    fn what_leans_one_way_in_each_flight_is_significant_and_noise_is_uniform() {
        let flips = Flips::new(60, 1);
        let runs: Vec<Range<usize>> = (0..15).map(|flight| 4 * flight..4 * flight + 4).collect();
        let p = |seed: u64, lean: f64| {
            let raw = noise(seed, 60, 2);
            let way = |flight: usize| if flight.is_multiple_of(2) { lean } else { -lean };
            let scores = DMatrix::from_fn(60, 2, |block, column| raw.scores[(block, column)] + way(block / 4));
            flips.p_value_between_flights(&scores, &[1.0, 0.5], &runs)
        };
        let below = (500..700).filter(|&seed| p(seed, 0.0) < 0.05).count();
        assert!((2..=21).contains(&below), "{below} of 200");
        assert!(p(7, 2.0) < 0.001);
    }

    /// One block a flight says nothing of what flights have for themselves.
    #[test]
    fn flights_of_one_block_show_nothing_of_their_own() {
        let scores = DMatrix::from_fn(60, 1, |block, _| if block % 2 == 0 { 5.0 } else { -3.0 });
        let runs: Vec<Range<usize>> = (0..60).map(|block| block..block + 1).collect();
        assert!(Flips::new(60, 1).p_value_between_flights(&scores, &[1.0], &runs) > 0.99);
    }

    #[test]
    fn what_is_in_every_block_is_significant_and_what_is_in_one_is_not() {
        let flips = Flips::new(60, 1);
        let p = |shift: &dyn Fn(usize) -> f64| {
            let mut raw = noise(7, 60, 1);
            (0..60).for_each(|block| raw.scores[(block, 0)] += shift(block));
            raw.whitened().map_or(f64::NAN, |scores| flips.p_value(&[scores]))
        };
        assert!(p(&|_| 3.0) < 0.001);
        assert!(p(&|block| if block == 5 { 1e4 } else { 0.0 }) > 0.3);
    }

    /// Two blocks of a flight with two columns in common, what was measured, and one column of the flight's own.
    #[test]
    fn what_a_flight_has_for_itself_is_taken_out_of_every_column() -> Result<(), &'static str> {
        let stream = Stream::new(5, 1, 2, 3);
        let rows: Vec<DMatrix<f64>> = (0..2)
            .map(|block| DMatrix::from_fn(30, 4, |row, column| stream.uniform(200 * block + 4 * row as u64 + column as u64)))
            .collect();
        let places = Places { members: &[0, 2], own: &[(1, 0.5)] };
        assert_eq!([0, 1, 2].map(|free| places.of(free)), [0, 3, 1]);
        let correlation = 7.0;
        let squares = rows.iter().map(|rows| rows.tr_mul(rows)).collect();
        let found = places.without_own(squares, correlation).ok_or("the flight's own number is determined")?;
        let sum = |left: usize, right: usize| rows.iter().map(|rows| rows.column(left).dot(&rows.column(right))).sum::<f64>();
        let share = |column: usize| sum(3, column) / (sum(3, 3) + correlation / 0.25);
        for (rows, found) in rows.iter().zip(found) {
            let left = DMatrix::from_fn(30, 3, |row, column| rows[(row, column)] - share(column) * rows[(row, 3)]);
            assert!((left.tr_mul(&left) - found).amax() < Tolerance::Close.relative_f64() * 30.0);
        }
        Ok(())
    }

    #[test]
    fn a_swap_has_to_gain() {
        let flips = Flips::new(60, 1);
        let p = |shift: f64| {
            let mut raw = Raw { one_sided: true, ..noise(7, 60, 1) };
            (0..60).for_each(|block| raw.scores[(block, 0)] += shift);
            raw.whitened().map_or(f64::NAN, |scores| flips.p_value(&[scores]))
        };
        assert!(p(3.0) < 0.001 && p(-3.0) > 0.999);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn sums_are_those_of_the_signs_one_by_one(seed: u64, values in prop::collection::vec(-1.0..1.0_f64, 1..90), from in 0.0..1.0_f64) {
            let start = (from * values.len() as f64) as usize;
            let found = Flips::new(values.len(), seed).sums(start..values.len(), |block| values[block]);
            for choice in [0, 1, 4999, FLIPS - 1] {
                let words = Stream::new(seed, 0, SITE, 0).sub(choice as u64);
                let is_minus = |block: usize| words.word((block / 32) as u32) >> (block % 32) & 1 == 1;
                let expected: f64 = (start..values.len()).map(|block| if is_minus(block) { -values[block] } else { values[block] }).sum();
                prop_assert!((found[choice] - expected).abs() < 1e-12, "{} {expected}", found[choice]);
            }
        }

        #[test]
        fn studentised_scores_do_not_depend_on_units(seed: u64, factors in prop::collection::vec(1e-3..1e3_f64, 3)) {
            let raw = noise(seed, 40, 3);
            let scores = DMatrix::from_fn(40, 3, |block, column| raw.scores[(block, column)] * factors[column]);
            let other = Raw { scores, ..noise(seed, 40, 3) };
            let (Some(one), Some(other)) = (raw.whitened(), other.whitened()) else { return Err(TestCaseError::fail("singular")) };
            prop_assert!((one.blocks.clone() - other.blocks).amax() < Tolerance::Close.relative_f64());
            // And their squares add up to one in each column, with nothing between columns.
            let square = one.blocks.transpose() * &one.blocks;
            prop_assert!((square - DMatrix::identity(3, 3)).amax() < Tolerance::Close.relative_f64());
        }
    }
}
