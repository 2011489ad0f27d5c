//! Regions of flight that hold the error: a small tree that splits on the mean square residual of one channel.
//!
//! The tree splits on the metric that it shows. It describes the flights it was grown on; its intervals do not allow for the search
//! over splits.

use super::{blocks, channel, plain_features};
use crate::blocks::{BlockMean, BlockSum, FEW_BLOCKS};
use crate::critique::digits::significant;
use crate::critique::unknown::ResidualTable;
use crate::error::Result;
use crate::flight::Channel;
use serde::Serialize;

/// Splits from root to leaf.
pub const DEPTH: usize = 3;
/// Thresholds tried per feature, at quantiles.
const THRESHOLDS: usize = 24;
/// Least share of all rows in a region.
const LEAST_ROWS: f64 = 0.01;
/// Standard errors by which the mean squares on the two sides of a split differ at least. More than two, because the split is the
/// best of some hundreds.
const APART: f64 = 3.0;
/// RMSE of the loudest region over that of all flights from which regions are shown.
const UNEVEN: f64 = 1.25;

/// How a region is parted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Split {
    /// Feature by name.
    pub variable: String,
    /// SI unit.
    pub unit: String,
    /// The first part lies at or below it, the second above.
    pub threshold: f64,
}

/// A block of ten seconds, or what of one was recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Where {
    /// Index of the flight.
    pub flight: usize,
    /// Its first and its last row, s since the flight's first sample.
    pub between_s: [f64; 2],
}

/// A region of flight and the error in it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Region {
    /// Rows.
    pub n: usize,
    /// Blocks.
    pub blocks: usize,
    /// Root mean square of the residual, m/s² or rad/s².
    pub rmse: f64,
    /// Its 95 % interval from the scatter between blocks.
    pub ci95: Option<[f64; 2]>,
    /// Share of the channel's sum of squares that lies here, 0 to 1.
    pub share_of_error: f64,
    /// Share of the rows that lie here, 0 to 1.
    pub share_of_rows: f64,
    /// The block that holds most of its squares.
    pub worst: Option<Where>,
    /// How it is parted; absent in a leaf.
    pub split: Option<Split>,
    /// Its parts: none or two.
    pub parts: Vec<Self>,
}

impl Region {
    /// The regions that are not parted further, in order.
    pub fn leaves(&self) -> Vec<&Self> {
        if self.parts.is_empty() { vec![self] } else { self.parts.iter().flat_map(Self::leaves).collect() }
    }

    /// Whether the error is nearly the same everywhere: no region has a quarter more than all flights.
    pub fn is_even(&self) -> bool {
        let loudest = self.leaves().iter().map(|leaf| leaf.rmse).fold(0.0, f64::max);
        self.split.is_none() || loudest < UNEVEN * self.rmse
    }

    /// The leaves, each with the rules that lead to it as a person reads them, the loudest first.
    pub fn by_rule(&self) -> Vec<(String, &Self)> {
        let mut found = Vec::new();
        self.gather(&[], &mut found);
        found.sort_by(|(_, left), (_, right)| right.rmse.total_cmp(&left.rmse));
        found
    }

    fn gather<'a>(&'a self, rules: &[String], found: &mut Vec<(String, &'a Self)>) {
        let Some(split) = &self.split else {
            found.push((rules.join(", "), self));
            return;
        };
        for (part, sign) in self.parts.iter().zip(["≤", ">"]) {
            let start = format!("{} {sign}", split.variable);
            // A later rule on the same side of the same variable says more.
            let mut own: Vec<String> = rules.iter().filter(|rule| !rule.starts_with(&start)).cloned().collect();
            own.push(format!("{start} {}", significant(split.threshold, 2)));
            part.gather(&own, found);
        }
    }
}

/// Parts the flights into regions of different mean square residual of channel `of`, with at least [`FEW_BLOCKS`] blocks each.
///
/// A split is the one with the largest fall of Σ (r² − mean of r²)², among those whose sides differ by three standard
/// errors from blocks.
///
/// # Errors
/// [`crate::Error::Shape`] without such a channel.
pub fn regions(table: &ResidualTable, of: Channel) -> Result<Region> {
    let (residual, _) = channel(table, of)?;
    let squares: Vec<f64> = residual.iter().map(|value| value * value).collect();
    let features: Vec<(&str, &[f64], Vec<f64>)> =
        plain_features(table).map(|(name, values)| (name, values, thresholds(values))).collect();
    let grown = Growing { table, blocks: blocks(table), total: squares.iter().sum(), squares, features };
    Ok(grown.region((0..table.len()).collect(), DEPTH))
}

fn thresholds(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut found: Vec<f64> =
        (1..=THRESHOLDS).filter_map(|part| sorted.get(part * sorted.len() / (THRESHOLDS + 1)).copied()).collect();
    found.dedup();
    found
}

struct Growing<'a> {
    table: &'a ResidualTable,
    blocks: usize,
    squares: Vec<f64>,
    total: f64,
    features: Vec<(&'a str, &'a [f64], Vec<f64>)>,
}

impl Growing<'_> {
    fn mean(&self, rows: impl Iterator<Item = usize>) -> Option<BlockMean> {
        let mut sums = vec![BlockSum::default(); self.blocks];
        for row in rows {
            sums[self.table.block[row]].samples += 1.0;
            sums[self.table.block[row]].sum += self.squares[row];
        }
        BlockMean::new(sums.into_iter())
    }

    fn region(&self, rows: Vec<usize>, depth: usize) -> Region {
        let sum: f64 = rows.iter().map(|row| self.squares[*row]).sum();
        let mean = self.mean(rows.iter().copied());
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        let mut region = Region {
            n: rows.len(),
            blocks: mean.map_or(0, |mean| mean.blocks),
            rmse: share(sum, rows.len() as f64).sqrt(),
            ci95: mean.and_then(|mean| mean.root_interval()),
            share_of_error: share(sum, self.total),
            share_of_rows: share(rows.len() as f64, self.table.len() as f64),
            worst: self.worst(&rows),
            split: None,
            parts: Vec::new(),
        };
        if let Some((feature, threshold)) = if depth > 0 { self.split(&rows) } else { None } {
            let (name, values, _) = &self.features[feature];
            let (low, high): (Vec<usize>, Vec<usize>) = rows.iter().partition(|row| values[**row] <= threshold);
            let unit = self.table.names.iter().position(|known| known == name).and_then(|index| self.table.units.get(index));
            region.split = Some(Split { variable: (*name).to_owned(), unit: unit.cloned().unwrap_or_default(), threshold });
            region.parts = vec![self.region(low, depth - 1), self.region(high, depth - 1)];
        }
        region
    }

    /// The block in which most of the squares of some rows lie.
    fn worst(&self, rows: &[usize]) -> Option<Where> {
        let mut sums = vec![0.0; self.blocks];
        rows.iter().for_each(|row| sums[self.table.block[*row]] += self.squares[*row]);
        let worst = (0..self.blocks).max_by(|left, right| sums[*left].total_cmp(&sums[*right]))?;
        // Blocks never fall, so a block is a stretch of rows.
        let first = self.table.block.partition_point(|block| *block < worst);
        let last = self.table.block.partition_point(|block| *block <= worst).checked_sub(1)?;
        Some(Where { flight: self.table.flight[first], between_s: [self.table.time_s[first], self.table.time_s[last]] })
    }

    /// The best split of some rows: feature and threshold.
    fn split(&self, rows: &[usize]) -> Option<(usize, f64)> {
        let fewest = LEAST_ROWS * self.table.len() as f64;
        let mut tried: Vec<(f64, usize, f64)> = Vec::new();
        let all: f64 = rows.iter().map(|row| self.squares[*row]).sum();
        for (feature, (_, values, thresholds)) in self.features.iter().enumerate() {
            // Rows and squares between neighbouring thresholds.
            let mut cells = vec![(0.0, 0.0); thresholds.len() + 1];
            for row in rows {
                let cell = &mut cells[thresholds.partition_point(|threshold| *threshold < values[*row])];
                cell.0 += 1.0;
                cell.1 += self.squares[*row];
            }
            let (mut count, mut sum) = (0.0, 0.0);
            for ((cell_count, cell_sum), threshold) in cells.iter().zip(thresholds) {
                count += cell_count;
                sum += cell_sum;
                let (rest, rest_sum) = (rows.len() as f64 - count, all - sum);
                if count >= fewest && rest >= fewest {
                    tried.push((sum * sum / count + rest_sum * rest_sum / rest, feature, *threshold));
                }
            }
        }
        // Nearly all first candidates stand; block means are made only until one does.
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        tried
            .into_iter()
            .take(50)
            .find(|(_, feature, threshold)| self.stands(rows, *feature, *threshold))
            .map(|found| (found.1, found.2))
    }

    fn stands(&self, rows: &[usize], feature: usize, threshold: f64) -> bool {
        let values = self.features[feature].1;
        let side = |low: bool| self.mean(rows.iter().copied().filter(|row| (values[*row] <= threshold) == low));
        let enough = |mean: &BlockMean| mean.blocks >= FEW_BLOCKS;
        let (Some(low), Some(high)) = (side(true).filter(enough), side(false).filter(enough)) else { return false };
        let error = low.standard_error.unwrap_or(f64::INFINITY).hypot(high.standard_error.unwrap_or(f64::INFINITY));
        (low.mean - high.mean).abs() > APART * error
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::table;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_region_of_large_errors_is_found() -> Result<()> {
        let mut table = table(1, 40);
        for row in 0..table.len() {
            if table.features[1][row] < -0.5 {
                table.residual[Channel::WxDot][row] *= 4.0;
            }
        }
        let tree = regions(&table, Channel::WxDot)?;
        let split = tree.split.clone().unwrap_or(Split { variable: String::new(), unit: String::new(), threshold: 0.0 });
        assert!(split.variable == "height" && split.unit == "m" && (split.threshold + 0.5).abs() < 0.15, "{split:?}");
        assert!(tree.parts[0].share_of_error > 0.7 && tree.parts[0].rmse > 3.0 * tree.parts[1].rmse);
        assert!(tree.parts[0].ci95.is_some_and(|[low, high]| low < 4.0 && 4.0 < high), "{:?}", tree.parts[0]);
        // The block with the most of it, counted by hand.
        let within = |row: &usize| table.features[1][*row] <= split.threshold;
        let mut sums = std::collections::BTreeMap::<usize, f64>::new();
        for row in (0..table.len()).filter(within) {
            *sums.entry(table.block[row]).or_default() += table.residual[Channel::WxDot][row].powi(2);
        }
        let (block, _) = sums.into_iter().fold((0, 0.0), |most, one| if one.1 > most.1 { one } else { most });
        let rows: Vec<usize> = (0..table.len()).filter(|row| table.block[*row] == block).collect();
        let between_s = [table.time_s[rows[0]], table.time_s[rows[rows.len() - 1]]];
        assert_eq!(tree.parts[0].worst, Some(Where { flight: table.flight[rows[0]], between_s }));
        Ok(())
    }

    #[test]
    fn a_leaf_is_called_by_the_narrowest_rules_that_lead_to_it() {
        let leaf = |rmse: f64| Region {
            n: 10,
            blocks: 5,
            rmse,
            ci95: None,
            share_of_error: 0.5,
            share_of_rows: 0.5,
            worst: None,
            split: None,
            parts: Vec::new(),
        };
        let at = |threshold: f64| Some(Split { variable: "vx".into(), unit: "m/s".into(), threshold });
        let inner = Region { split: at(1.25), parts: vec![leaf(0.5), leaf(3.0)], ..leaf(2.0) };
        let tree = Region { split: at(4.0), parts: vec![inner, leaf(1.0)], ..leaf(1.5) };
        let named: Vec<String> = tree.by_rule().into_iter().map(|(rules, leaf)| format!("{rules}: {}", leaf.rmse)).collect();
        assert_eq!(named, ["vx ≤ 4.0, vx > 1.2: 3", "vx > 4.0: 1", "vx ≤ 1.2: 0.5"]);
        assert!(!tree.is_even() && leaf(1.0).is_even());
        assert!(Region { rmse: 2.9, ..tree }.is_even(), "3.0 is hardly more than 2.9");
    }

    #[test]
    fn even_noise_is_hardly_parted() -> Result<()> {
        let leaves: usize =
            (0..10).map(|seed| regions(&table(seed, 30), Channel::VxDot).map_or(9, |tree| tree.leaves().len())).sum();
        assert!(leaves <= 16, "{leaves} leaves in ten trees");
        assert_eq!(regions(&table(1, 1), Channel::VxDot)?.leaves().len(), 1, "two blocks are too few to part");
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        #[test]
        fn leaves_make_up_the_whole(seed: u64, loud in 1.0..5.0_f64) {
            let mut table = table(seed, 20);
            for row in 0..table.len() {
                if table.features[0][row] * table.features[2][row] > 0.0 {
                    table.residual[Channel::VxDot][row] *= loud;
                }
            }
            let tree = regions(&table, Channel::VxDot)?;
            let leaves = tree.leaves();
            prop_assert_eq!(leaves.iter().map(|leaf| leaf.n).sum::<usize>(), table.len());
            prop_assert!((leaves.iter().map(|leaf| leaf.share_of_error).sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(leaves.len() <= 1 << DEPTH && leaves.iter().all(|leaf| leaf.blocks >= FEW_BLOCKS));
        }
    }
}
