//! Gradient-boosted regression trees on binned features: small, squared error, stopped early on rows set aside.
//!
//! Before the trees come means by bin of single features: a ripple with many periods has no first split worth making, so trees
//! alone would not begin to see it.
//!
//! A detector of dependence, not a model to keep: no missing values, no categories, no other losses, nothing is stored in files.
//! Source: Friedman 2001, *Greedy function approximation: a gradient boosting machine*; histograms as in Ke et al. 2017 (LightGBM).

/// Most bins of a feature.
pub(super) const BINS: usize = 32;
/// Splits from root to leaf.
const DEPTH: usize = 3;
/// Inner nodes and leaves of a full tree.
const NODES: usize = (1 << DEPTH) - 1;
const LEAVES: usize = 1 << DEPTH;
/// Share of a leaf's mean that a tree adds.
const SHRINKAGE: f32 = 0.2;
/// Most trees.
const TREES: usize = 120;
/// Trees without a better error on the rows set aside before growing ends.
const PATIENCE: usize = 6;
/// Rows of value zero that every leaf is taken to hold besides its own: neighbouring rows share their gust, so few rows are
/// fewer than they look.
const PRIOR_ROWS: f32 = 20.0;
/// The same for a mean by bin; a bin holds fewer rows than most leaves.
const PRIOR_ROWS_OF_BIN: f32 = 100.0;
/// Most means by bin before the trees.
const TABLES: usize = 6;
/// A leaf holds at least this share of the rows.
const LEAF_SHARE: f64 = 0.005;
/// Rows from which the bin edges are taken.
const EDGE_ROWS: usize = 4096;

/// Features of all rows as bin numbers, row by row.
#[derive(Clone, Debug)]
pub(super) struct Binned {
    features: usize,
    bins: Vec<u8>,
    edges: Vec<Vec<f64>>,
}

impl Binned {
    /// Cuts each column at its own quantiles into at most [`BINS`] bins. Columns are equally long.
    pub(super) fn new(columns: &[Vec<f64>]) -> Self {
        let edges = columns.iter().map(|column| {
            let mut sorted: Vec<f64> = column.iter().copied().step_by(column.len().div_ceil(EDGE_ROWS).max(1)).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let mut edges: Vec<f64> = (1..BINS).filter_map(|bin| sorted.get(bin * sorted.len() / BINS).copied()).collect();
            edges.dedup();
            edges
        });
        Self { features: 0, bins: Vec::new(), edges: edges.collect() }.like(columns)
    }

    /// Other rows of the same features, cut at the same edges.
    pub(super) fn like(&self, columns: &[Vec<f64>]) -> Self {
        let (features, rows) = (columns.len(), columns.first().map_or(0, Vec::len));
        let mut bins = vec![0; features * rows];
        for (feature, (column, edges)) in columns.iter().zip(&self.edges).enumerate() {
            for (row, value) in bins.chunks_exact_mut(features).zip(column) {
                // At most 31 edges, so a bin number fits.
                row[feature] = edges.partition_point(|edge| edge <= value) as u8;
            }
        }
        Self { features, bins, edges: self.edges.clone() }
    }

    /// The same rows with some of the features.
    pub(super) fn select(&self, chosen: &[usize]) -> Self {
        let rows = self.bins.chunks_exact(self.features.max(1));
        let bins = rows.flat_map(|row| chosen.iter().map(|feature| row.get(*feature).copied().unwrap_or_default())).collect();
        let edges = chosen.iter().filter_map(|feature| self.edges.get(*feature).cloned()).collect();
        Self { features: chosen.len(), bins, edges }
    }

    /// Ends and edges of a feature, rising, at least two.
    pub(super) fn knots(&self, columns: &[Vec<f64>], feature: usize) -> Vec<f64> {
        let values = columns.get(feature).map(Vec::as_slice).unwrap_or_default();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let edges = self.edges.get(feature).map(Vec::as_slice).unwrap_or_default();
        let inner = edges.iter().copied().filter(|edge| *edge > low && *edge < high);
        let mut knots: Vec<f64> = std::iter::once(low).chain(inner).collect();
        knots.push(if high > low { high } else { low + 1.0 });
        knots
    }

    /// The bins of one row.
    pub(super) fn row(&self, row: usize) -> &[u8] {
        self.bins.get(row * self.features..(row + 1) * self.features).unwrap_or_default()
    }
}

/// One tree of full depth; a node that did not split sends every row to the left.
#[derive(Clone, Debug)]
struct Tree {
    /// Feature and last bin that goes left.
    splits: [(u32, u8); NODES],
    leaves: [f32; LEAVES],
}

impl Tree {
    fn leaf(&self, row: &[u8]) -> usize {
        let mut node = 0;
        while let Some((feature, last)) = self.splits.get(node) {
            let right = row.get(*feature as usize).is_some_and(|bin| bin > last);
            node = 2 * node + 1 + usize::from(right);
        }
        node - NODES
    }
}

/// Values by bin of one feature.
#[derive(Clone, Debug)]
struct Table {
    feature: usize,
    values: [f32; BINS],
}

impl Table {
    fn at(&self, row: &[u8]) -> f32 {
        row.get(self.feature).and_then(|bin| self.values.get(*bin as usize)).copied().unwrap_or_default()
    }
}

/// A sum of means by bin and of trees.
#[derive(Clone, Debug)]
pub(super) struct Boosted {
    base: f32,
    tables: Vec<Table>,
    trees: Vec<Tree>,
}

impl Boosted {
    /// Fits `target` (one value a row of `features`) on the rows `fit`; grows while the error on the rows `aside` falls.
    pub(super) fn fit(features: &Binned, target: &[f32], fit: &[u32], aside: &[u32]) -> Self {
        let at = |row: &u32| target.get(*row as usize).copied().unwrap_or_default();
        let base = fit.iter().map(|row| f64::from(at(row))).sum::<f64>() / fit.len().max(1) as f64;
        let base = base as f32;
        let mut left: Vec<f32> = fit.iter().map(|row| at(row) - base).collect();
        let mut left_aside: Vec<f32> = aside.iter().map(|row| at(row) - base).collect();
        let squares = |values: &[f32]| values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>();
        let (mut best, mut kept, mut trees) = (squares(&left_aside), 0, Vec::new());
        let mut grower = Grower::new(features, fit.len());
        let mut tables = Vec::new();
        for _ in 0..TABLES {
            let Some(table) = grower.table(features, fit, &left) else { break };
            let off = |values: &[f32], rows: &[u32]| -> Vec<f32> {
                values.iter().zip(rows).map(|(value, row)| value - table.at(features.row(*row as usize))).collect()
            };
            let tried = off(&left_aside, aside);
            let error = squares(&tried);
            if error >= best {
                break;
            }
            (best, left_aside, left) = (error, tried, off(&left, fit));
            tables.push(table);
        }
        while trees.len() < TREES && trees.len() < kept + PATIENCE {
            let tree = grower.grow(features, fit, &mut left);
            for (value, row) in left_aside.iter_mut().zip(aside) {
                *value -= tree.leaves[tree.leaf(features.row(*row as usize))];
            }
            trees.push(tree);
            let error = squares(&left_aside);
            if error < best {
                (best, kept) = (error, trees.len());
            }
        }
        trees.truncate(kept);
        Self { base, tables, trees }
    }

    /// The fitted value of a row.
    pub(super) fn predict(&self, row: &[u8]) -> f64 {
        let sum: f32 = self.trees.iter().map(|tree| tree.leaves[tree.leaf(row)]).sum();
        let tables: f32 = self.tables.iter().map(|table| table.at(row)).sum();
        f64::from(self.base + tables + sum)
    }

    /// Whether it is a constant: nothing made the error on rows set aside smaller.
    pub(super) fn is_constant(&self) -> bool {
        self.trees.is_empty() && self.tables.is_empty()
    }
}

/// Sum of the target and number of rows, bin by bin.
type Histogram = Vec<[[f32; 2]; BINS]>;

/// Buffers for growing trees on the same rows.
struct Grower {
    /// Positions within the fitted rows, ordered so that every node's are adjacent.
    order: Vec<u32>,
    scratch: Vec<u32>,
    histograms: Vec<Histogram>,
    fewest: f32,
}

impl Grower {
    fn new(features: &Binned, rows: usize) -> Self {
        let positions = 0..u32::try_from(rows).unwrap_or(u32::MAX);
        Self {
            order: positions.collect(),
            scratch: Vec::with_capacity(rows),
            histograms: vec![vec![[[0.0; 2]; BINS]; features.features]; NODES],
            fewest: (LEAF_SHARE * rows as f64).max(10.0) as f32,
        }
    }

    /// Grows one tree for `left` (target minus what was fitted, in the order of `rows`) and takes its values off.
    fn grow(&mut self, features: &Binned, rows: &[u32], left: &mut [f32]) -> Tree {
        let mut tree = Tree { splits: [(0, u8::MAX); NODES], leaves: [0.0; LEAVES] };
        let mut ranges = [(0_usize, 0_usize); NODES + LEAVES];
        ranges[0] = (0, self.order.len());
        self.fill(0, ranges[0], features, rows, left);
        for node in 0..NODES {
            let (start, end) = ranges[node];
            let mut middle = end;
            if let Some((feature, last)) = self.best(node) {
                tree.splits[node] = (feature as u32, last);
                middle = self.part((start, end), features, rows, feature, last);
            }
            let (low, high) = (2 * node + 1, 2 * node + 2);
            (ranges[low], ranges[high]) = ((start, middle), (middle, end));
            if high < NODES {
                // The larger child is the parent less the smaller one.
                let small = if middle - start < end - middle { low } else { high };
                self.fill(small, ranges[small], features, rows, left);
                let (upper, lower) = self.histograms.split_at_mut(low);
                let (smaller, larger) = lower.split_at_mut(1);
                let (smaller, larger) = if small == low { (&smaller[0], &mut larger[0]) } else { (&larger[0], &mut smaller[0]) };
                for ((large, parent), small) in larger.iter_mut().zip(&upper[node]).zip(smaller) {
                    for ((large, parent), small) in large.iter_mut().zip(parent).zip(small) {
                        *large = [parent[0] - small[0], parent[1] - small[1]];
                    }
                }
            }
        }
        for (leaf, value) in tree.leaves.iter_mut().enumerate() {
            let (start, end) = ranges[NODES + leaf];
            let positions = &self.order[start..end];
            let sum: f32 = positions.iter().map(|position| left[*position as usize]).sum();
            *value = SHRINKAGE * sum / (positions.len() as f32 + PRIOR_ROWS);
            positions.iter().for_each(|position| left[*position as usize] -= *value);
        }
        tree
    }

    /// Means by bin of the feature whose means take most off the squared error.
    fn table(&mut self, features: &Binned, rows: &[u32], left: &[f32]) -> Option<Table> {
        self.fill(0, (0, self.order.len()), features, rows, left);
        let value = |cell: &[f32; 2]| cell[0] / (cell[1] + PRIOR_ROWS_OF_BIN);
        let gain = |cells: &[[f32; 2]; BINS]| cells.iter().map(|cell| value(cell) * cell[0]).sum::<f32>();
        let gains = self.histograms.first()?.iter().map(gain).enumerate();
        let (feature, _) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let values = self.histograms.first()?.get(feature)?.each_ref().map(value);
        Some(Table { feature, values })
    }

    fn fill(&mut self, node: usize, (start, end): (usize, usize), features: &Binned, rows: &[u32], left: &[f32]) {
        let histogram = &mut self.histograms[node];
        histogram.fill([[0.0; 2]; BINS]);
        for position in &self.order[start..end] {
            let value = left[*position as usize];
            for (cells, bin) in histogram.iter_mut().zip(features.row(rows[*position as usize] as usize)) {
                let cell = &mut cells[*bin as usize % BINS];
                cell[0] += value;
                cell[1] += 1.0;
            }
        }
    }

    /// The split of a node with the largest fall of squared error, if any split lowers it.
    fn best(&self, node: usize) -> Option<(usize, u8)> {
        let score = |sum: f32, count: f32| sum * sum / (count + PRIOR_ROWS);
        let (mut found, mut gain) = (None, 0.0);
        for (feature, cells) in self.histograms[node].iter().enumerate() {
            let (all, count) = cells.iter().fold((0.0, 0.0), |(sum, count), cell| (sum + cell[0], count + cell[1]));
            let (mut sum, mut below) = (0.0, 0.0);
            for (last, cell) in cells.iter().enumerate().take(BINS - 1) {
                sum += cell[0];
                below += cell[1];
                if below < self.fewest || cell[1] == 0.0 {
                    continue;
                }
                if count - below < self.fewest {
                    break;
                }
                let gained = score(sum, below) + score(all - sum, count - below) - score(all, count);
                if gained > gain {
                    (found, gain) = (Some((feature, last as u8)), gained);
                }
            }
        }
        found
    }

    /// Orders a node's positions by side of the split and returns where the right side starts.
    fn part(&mut self, (start, end): (usize, usize), features: &Binned, rows: &[u32], feature: usize, last: u8) -> usize {
        self.scratch.clear();
        let mut write = start;
        for read in start..end {
            let position = self.order[read];
            if features.row(rows[position as usize] as usize)[feature] > last {
                self.scratch.push(position);
            } else {
                self.order[write] = position;
                write += 1;
            }
        }
        self.order[write..end].copy_from_slice(&self.scratch);
        write
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    fn rows(range: std::ops::Range<u32>) -> Vec<u32> {
        range.collect()
    }

    #[test]
    fn a_step_of_one_feature_is_learned() {
        let stream = Stream::new(1, 0, 0, 0);
        let columns: Vec<Vec<f64>> =
            (0..4).map(|feature| (0..3000).map(|row| stream.sub(feature).uniform(row)).collect()).collect();
        let target: Vec<f32> = columns[2].iter().map(|value| if *value > 0.6 { 3.0 } else { 1.0 }).collect();
        let features = Binned::new(&columns);
        let model = Boosted::fit(&features, &target, &rows(0..1500), &rows(1500..2000));
        let error = (2000..3000).map(|row| (model.predict(features.row(row)) - f64::from(target[row])).powi(2)).sum::<f64>();
        // A bin edge may lie up to 1/32 from the step: 4 · 1/32 is the largest mean square of it.
        assert!(error / 1000.0 < 0.13, "{error}");
        assert!(!model.is_constant());
    }

    #[test]
    fn nothing_to_learn_gives_a_constant_and_no_rows_no_panic() {
        let columns = vec![(0..400).map(f64::from).collect::<Vec<_>>()];
        let features = Binned::new(&columns);
        let model = Boosted::fit(&features, &vec![2.5; 400], &rows(0..300), &rows(300..400));
        assert!(model.is_constant() && model.predict(features.row(3)).to_bits() == 2.5_f64.to_bits());
        assert!(Boosted::fit(&features, &[], &[], &[]).is_constant());
        assert!(Boosted::fit(&Binned::new(&[]), &[1.0; 4], &[0, 1], &[2, 3]).is_constant());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn monotone_maps_of_a_feature_change_nothing(seed: u64) {
            let stream = Stream::new(seed, 0, 0, 0);
            let columns: Vec<Vec<f64>> =
                (0..3).map(|feature| (0..600).map(|row| stream.sub(feature).uniform(row)).collect()).collect();
            let target: Vec<f32> = (0..600).map(|row| (columns[0][row] * columns[1][row]) as f32).collect();
            let mapped: Vec<Vec<f64>> = columns.iter().map(|column| column.iter().map(|value| value.exp()).collect()).collect();
            let (plain, mapped) = (Binned::new(&columns), Binned::new(&mapped));
            prop_assert_eq!(&plain.bins, &mapped.bins);
            let model = Boosted::fit(&plain, &target, &rows(0..400), &rows(400..600));
            let error = |constant: bool| {
                let mean = target[..400].iter().map(|value| f64::from(*value)).sum::<f64>() / 400.0;
                let of = |row: usize| if constant { mean } else { model.predict(plain.row(row)) };
                (400..600).map(|row| (of(row) - f64::from(target[row])).powi(2)).sum::<f64>()
            };
            prop_assert!(error(false) <= error(true) * (1.0 + 1e-6), "never worse on the rows it was stopped on");
        }
    }
}
