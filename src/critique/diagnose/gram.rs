//! One pass over the flights: for every block and channel the Gram matrix of all columns and the measured acceleration. Everything
//! that a search does afterwards touches only these; they add, so flights can be read in pieces.

use super::design::Design;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, PerChannel, Span};
use ndarray::linalg::general_mat_mul;
use ndarray::{Array2, ArrayView2, Axis, Slice};
use std::ops::Range;
use std::sync::Arc;

/// Rows of a square that are multiplied at once, with the columns from the first of them on: the others are known from above the diagonal.
const PANEL: usize = 48;

/// A stretch of consecutive samples of one flight: the unit that is resampled, left out or flipped as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub flight: usize,
    pub start: usize,
    pub end: usize,
}

/// Of a block at least this share counts ([`Flight::set_aside`]), or it is left out: an error over a few rows is no block's.
const LEAST_COUNTED: f64 = 0.25;

impl Block {
    /// How many of its samples count.
    pub fn count(&self, flights: &[Flight]) -> usize {
        flights[self.flight].count(self.start..self.end)
    }
}

/// Cuts spans into blocks of about equal length, `block_s` long; a remainder shorter than half joins its neighbour.
pub(super) fn blocks(flights: &[Flight], spans: &[Span], block_s: f64) -> Vec<Block> {
    let mut blocks = Vec::new();
    for span in spans {
        let Some(flight) = flights.get(span.flight) else { continue };
        let samples = span.end.min(flight.len()).saturating_sub(span.start);
        let wanted = (block_s / flight.step_s).max(1.0);
        let count = ((samples as f64 / wanted).round() as usize).max(1);
        for index in 0..count {
            let (start, end) = (span.start + index * samples / count, span.start + (index + 1) * samples / count);
            if end > start && flight.count(start..end) as f64 >= LEAST_COUNTED * (end - start) as f64 {
                blocks.push(Block { flight: span.flight, start, end });
            }
        }
    }
    blocks.sort_unstable_by_key(|block| (block.flight, block.start));
    blocks
}

/// Of one block: samples, and for each channel the products of `[X | y]` with itself, y being the measured acceleration in the last place.
#[derive(Clone, Debug)]
pub(super) struct BlockGram {
    pub rows: usize,
    pub channels: PerChannel<Square>,
}

/// `[X | y]ᵀ [X | y]` as far as any model needs it: a column that only one model has meets its own and those of several models, but not
/// those that another model has for itself.
#[derive(Clone, Debug)]
pub(super) struct Square {
    places: Arc<Places>,
    /// Columns of several models and y, by all columns; of themselves each with what comes after it, as far as rows are not multiplied at once.
    common: Array2<f64>,
    /// Of each model that has columns of its own, these by themselves.
    own: Vec<Array2<f64>>,
}

/// Where a product of two columns lies in a [`Square`]: among the common columns, or those of one model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Product {
    group: Option<usize>,
    at: (usize, usize),
}

/// Where the columns of a channel lie: first those of several models, then y, then model after model.
#[derive(Clone, Debug, Default)]
struct Places {
    /// For each column in the order of the design, y last: its row, and its group if one model alone has it.
    of: Vec<(usize, Option<usize>)>,
    /// Columns in the order of the rows; `None` is y.
    order: Vec<Option<usize>>,
    /// Rows of each group.
    groups: Vec<Range<usize>>,
}

impl Places {
    fn new(owners: &[Option<usize>]) -> Self {
        let mut models: Vec<usize> = owners.iter().flatten().copied().collect();
        models.sort_unstable();
        models.dedup();
        let mut places = Self { of: vec![(0, None); owners.len() + 1], ..Self::default() };
        let of_owner = |owner: Option<usize>| (0..owners.len()).filter(move |&column| owners[column] == owner);
        places.order.extend(of_owner(None).map(Some));
        places.order.push(None);
        for &model in &models {
            let start = places.order.len();
            places.order.extend(of_owner(Some(model)).map(Some));
            places.groups.push(start..places.order.len());
        }
        for (row, column) in places.order.iter().enumerate() {
            let group = places.groups.iter().position(|group| group.contains(&row));
            places.of[column.unwrap_or(owners.len())] = (row, group);
        }
        places
    }

    fn common(&self) -> usize {
        self.groups.first().map_or(self.order.len(), |group| group.start)
    }
}

impl Square {
    fn zeros(places: &Arc<Places>) -> Self {
        let common = Array2::zeros((places.common(), places.order.len()));
        let own = places.groups.iter().map(|group| Array2::zeros((group.len(), group.len()))).collect();
        Self { places: Arc::clone(places), common, own }
    }

    /// Adds some samples; `rows` holds the columns in the order of [`Places::order`].
    fn add(&mut self, rows: &ArrayView2<'_, f64>) {
        let common = self.places.common();
        for start in (0..common).step_by(PANEL) {
            let end = (start + PANEL).min(common);
            let (panel, after) = (Slice::from(start..end), Slice::from(start..));
            let mut sum = self.common.slice_axis_mut(Axis(0), panel);
            let (left, right) = (rows.slice_axis(Axis(0), panel), rows.slice_axis(Axis(0), after));
            general_mat_mul(1.0, &left, &right.t(), 1.0, &mut sum.slice_axis_mut(Axis(1), after));
        }
        for (group, own) in self.places.groups.iter().zip(&mut self.own) {
            let part = rows.slice_axis(Axis(0), Slice::from(group.clone()));
            general_mat_mul(1.0, &part, &part.t(), 1.0, own);
        }
    }

    /// Columns, y included.
    pub fn size(&self) -> usize {
        self.places.of.len()
    }

    /// Where the product of two columns lies, by their places in the design; y is the last. The same in all squares of a channel.
    pub fn place(&self, row: usize, column: usize) -> Product {
        match (self.places.of[row], self.places.of[column]) {
            ((row, None), (column, _)) | ((column, _), (row, None)) => {
                Product { group: None, at: (row.min(column), row.max(column)) }
            }
            ((row, Some(left)), (column, Some(right))) => {
                assert_eq!(left, right, "columns of two models meet in no fit");
                let start = self.places.groups[left].start;
                Product { group: Some(left), at: (row - start, column - start) }
            }
        }
    }

    /// The product at a place.
    pub fn at(&self, Product { group, at }: Product) -> f64 {
        group.map_or(&self.common, |group| &self.own[group])[at]
    }
}

/// The Gram matrices of all blocks, in their order.
///
/// # Errors
/// Those of evaluating a formula; [`Error::Undetermined`] naming a formula that is no finite number somewhere.
pub(super) fn grams(flights: &[Flight], blocks: &[Block], design: &Design) -> Result<Vec<BlockGram>> {
    let mut runs: Vec<&[Block]> = blocks.chunk_by(|left, right| left.flight == right.flight).collect();
    // The longest first, so that no core waits for a long one at the end.
    let length = |run: &[Block]| run.last().map_or(0, |block| block.end);
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by_key(|&index| std::cmp::Reverse(length(runs[index])));
    let one = |&index: &usize| Ok((index, flight_grams(&flights[runs[index][0].flight], runs[index], design)?));
    #[cfg(feature = "rayon")]
    let mut found: Vec<(usize, Vec<BlockGram>)> = {
        use rayon::prelude::*;
        order.par_iter().with_max_len(1).map(one).collect::<Result<_>>()?
    };
    #[cfg(not(feature = "rayon"))]
    let mut found: Vec<(usize, Vec<BlockGram>)> = order.iter().map(one).collect::<Result<_>>()?;
    found.sort_by_key(|entry| entry.0);
    runs.clear();
    Ok(found.into_iter().flat_map(|entry| entry.1).collect())
}

fn flight_grams(flight: &Flight, blocks: &[Block], design: &Design) -> Result<Vec<BlockGram>> {
    let places: PerChannel<Arc<Places>> = PerChannel::from_fn(|channel| Arc::new(Places::new(&design.owners[channel])));
    let empty = || BlockGram { rows: 0, channels: PerChannel::from_fn(|channel| Square::zeros(&places[channel])) };
    let mut found: Vec<BlockGram> = blocks.iter().map(|_| empty()).collect();
    let end = blocks.iter().map(|block| block.end).max().unwrap_or(0);
    let mut scratch = Vec::new();
    design.columns.evaluate(&design.nodes, flight, end, &mut |range, values| {
        for (block, gram) in blocks.iter().zip(&mut found) {
            let rows = block.start.max(range.start)..block.end.min(range.end);
            let parts: Vec<Range<usize>> = flight.counted(rows).collect();
            let count: usize = parts.iter().map(ExactSizeIterator::len).sum();
            if count == 0 {
                continue;
            }
            gram.rows += count;
            for ((columns, target), sum) in design.channels.iter().zip(Column::TARGETS).zip(&mut gram.channels) {
                scratch.clear();
                for column in &sum.places.order {
                    for part in &parts {
                        scratch.extend_from_slice(match column {
                            Some(column) => &values.column(columns[*column])[part.start - range.start..part.end - range.start],
                            None => &flight.column(target)[part.clone()],
                        });
                    }
                }
                let rows =
                    ArrayView2::from_shape((columns.len() + 1, count), &scratch).expect("as many columns as rows of the square");
                sum.add(&rows);
            }
        }
        Ok(())
    })?;
    for (block, gram) in blocks.iter().zip(&found) {
        for (columns, matrix) in design.channels.iter().zip(&gram.channels) {
            if let Some(column) = (0..matrix.size()).find(|&column| !matrix.at(matrix.place(column, column)).is_finite()) {
                let label = columns.get(column).map(|&column| &design.labels[column]);
                return Err(Error::Undetermined(format!(
                    "{} is not a finite number somewhere between t = {:.2} s and {:.2} s of flight `{}`; guard the formula, for example \
                     `max(height, 0.1)`",
                    label.map_or("the measured acceleration", String::as_str),
                    flight.time_s(block.start),
                    flight.time_s(block.end - 1),
                    flight.name
                )));
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::flight::{Channel, Targets};
    use crate::physics::Model;
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    /// Flights of uniform random columns, targets included.
    pub(in super::super) fn noise(seed: u64, lengths: &[usize]) -> Vec<Flight> {
        let flight = |(index, &samples): (usize, &usize)| {
            let columns = std::array::from_fn(|column| {
                let stream = Stream::new(seed, index as u64, column as u64, 0);
                (0..samples as u64).map(|sample| 2.0 * stream.uniform(sample) - 1.0).collect()
            });
            Flight::new(format!("f{index}"), "noise", 0.0, 0.01, columns, Targets::Recorded)
        };
        lengths.iter().enumerate().filter_map(|entry| flight(entry).ok()).collect()
    }

    pub(in super::super) fn whole(flights: &[Flight]) -> Vec<Span> {
        flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect()
    }

    pub(in super::super) fn model() -> Model {
        Model::paper("noise", 4.58, [0.18, 0.34, 0.28], 0.8)
    }

    /// Equal but for the order of summation, relative to the largest.
    pub(in super::super) fn near(found: &[f64], expected: &[f64]) -> bool {
        let scale = expected.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
        let pairs = found.iter().zip(expected);
        found.len() == expected.len() && pairs.into_iter().all(|(a, b)| (a - b).abs() <= Tolerance::Close.relative_f64() * scale)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn blocks_cover_each_sample_once(lengths in prop::collection::vec(1usize..4000, 1..6), block_s in 0.5..12.0) {
            let flights = noise(1, &lengths);
            let cut = blocks(&flights, &whole(&flights), block_s);
            let mut next = vec![0; flights.len()];
            for block in &cut {
                prop_assert_eq!(block.start, next[block.flight]);
                prop_assert!(block.end > block.start);
                next[block.flight] = block.end;
            }
            prop_assert_eq!(next, lengths);
        }

        #[test]
        fn grams_of_blocks_add_up_to_that_of_the_whole(seed: u64, samples in 300usize..3000, block_s in 0.7..8.0) {
            let flights = noise(seed, &[samples]);
            let mut design = Design::default();
            let failed = |error: Error| TestCaseError::fail(error.to_string());
            design.model(&model()).map_err(failed)?;
            let one = grams(&flights, &[Block { flight: 0, start: 0, end: samples }], &design).map_err(failed)?;
            let parts = grams(&flights, &blocks(&flights, &whole(&flights), block_s), &design).map_err(failed)?;
            prop_assert_eq!(parts.iter().map(|part| part.rows).sum::<usize>(), one[0].rows);
            for channel in Channel::ALL {
                let size = one[0].channels[channel].size();
                let entry = |square: &Square, (i, j)| square.at(square.place(i, j));
                let entries = |gram: &BlockGram| Array2::from_shape_fn((size, size), |at| entry(&gram.channels[channel], at));
                let mut total = Array2::<f64>::zeros((size, size));
                parts.iter().for_each(|part| total += &entries(part));
                let expected: Vec<f64> = entries(&one[0]).iter().copied().collect();
                prop_assert!(near(&total.iter().copied().collect::<Vec<_>>(), &expected));
            }
        }
    }

    #[test]
    fn columns_of_each_model_meet_what_they_are_fitted_with() -> Result<()> {
        let flights = noise(4, &[1500]);
        let with = |formula: &str| -> Result<Model> {
            let mut model = model();
            model.effects.push(crate::physics::Effect::formula("more", Channel::VzDot, formula, 0.0)?);
            Ok(model)
        };
        let models = [model(), with("vx * u4")?, with("wx * wz")?, with("lag(vy, 0.1)")?];
        let (mut apart, mut mixed) = (Design::default(), Design::default());
        let layouts: Vec<_> = models.iter().map(|model| apart.model(model)).collect::<Result<_>>()?;
        models.iter().try_for_each(|model| mixed.model(model).map(drop))?;
        mixed.mix();
        let block = [Block { flight: 0, start: 0, end: 1500 }];
        let (apart, mixed) = (grams(&flights, &block, &apart)?, grams(&flights, &block, &mixed)?);
        let [left, right] = [&apart[0].channels[Channel::VzDot], &mixed[0].channels[Channel::VzDot]];
        assert_eq!(left.own.iter().map(|own| own.dim()).collect::<Vec<_>>(), [(1, 1); 3]);
        for layout in layouts {
            let columns: Vec<usize> =
                layout.channels[Channel::VzDot].free.iter().flat_map(|entry| entry.1.iter().map(|column| column.0)).collect();
            for &i in columns.iter().chain(&[left.size() - 1]) {
                for &j in columns.iter().chain(&[left.size() - 1]) {
                    assert!(near(&[left.at(left.place(i, j))], &[right.at(right.place(i, j))]));
                }
            }
        }
        Ok(())
    }

    #[test]
    fn a_formula_that_is_no_number_somewhere_is_named() -> Result<()> {
        let flights = noise(2, &[600]);
        let mut design = Design::default();
        let mut model = model();
        model.effects.push(crate::physics::Effect::formula("root", Channel::VxDot, "sqrt(vx)", 0.0)?);
        design.model(&model)?;
        let message = grams(&flights, &blocks(&flights, &whole(&flights), 3.0), &design).map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("sqrt(vx)") && text.contains("`f0`")));
        Ok(())
    }
}
