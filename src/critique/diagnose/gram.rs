//! One pass over the flights: for every block and channel the Gram matrix of all columns and the measured acceleration. Everything
//! that a search does afterwards touches only these; they add, so flights can be read in pieces.

use super::design::Design;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, Span};
use ndarray::Array2;
use ndarray::linalg::general_mat_mul;

/// A stretch of consecutive samples of one flight: the unit that is resampled, left out or flipped as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub flight: usize,
    pub start: usize,
    pub end: usize,
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
            if end > start {
                blocks.push(Block { flight: span.flight, start, end });
            }
        }
    }
    blocks.sort_unstable_by_key(|block| (block.flight, block.start));
    blocks
}

/// Of one block: samples, and for each channel the symmetric matrix `[X | y]ᵀ [X | y]` with y the measured acceleration in the last
/// row and column.
#[derive(Clone, Debug)]
pub(super) struct BlockGram {
    pub rows: usize,
    pub channels: [Array2<f64>; 6],
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
    let size = |channel: usize| design.channels[channel].len() + 1;
    let empty = || BlockGram { rows: 0, channels: std::array::from_fn(|channel| Array2::zeros((size(channel), size(channel)))) };
    let mut found: Vec<BlockGram> = blocks.iter().map(|_| empty()).collect();
    let end = blocks.iter().map(|block| block.end).max().unwrap_or(0);
    let mut scratch = Vec::new();
    design.columns.evaluate(&design.nodes, flight, end, &mut |range, values| {
        for (block, gram) in blocks.iter().zip(&mut found) {
            let (start, end) = (block.start.max(range.start), block.end.min(range.end));
            if start >= end {
                continue;
            }
            gram.rows += end - start;
            let part = start - range.start..end - range.start;
            for ((columns, target), sum) in design.channels.iter().zip(Column::TARGETS).zip(&mut gram.channels) {
                scratch.clear();
                for &column in columns {
                    scratch.extend_from_slice(&values.column(column)[part.clone()]);
                }
                scratch.extend_from_slice(&flight.column(target)[start..end]);
                let shape = (columns.len() + 1, part.len());
                let Ok(matrix) = ndarray::ArrayView2::from_shape(shape, &scratch) else { continue };
                general_mat_mul(1.0, &matrix, &matrix.t(), 1.0, sum);
            }
        }
        Ok(())
    })?;
    for (block, gram) in blocks.iter().zip(&found) {
        for (columns, matrix) in design.channels.iter().zip(&gram.channels) {
            if let Some(column) = matrix.diag().iter().position(|value| !value.is_finite()) {
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
    use crate::flight::Targets;
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
            for channel in 0..6 {
                let mut total = Array2::<f64>::zeros(one[0].channels[channel].dim());
                parts.iter().for_each(|part| total += &part.channels[channel]);
                let expected: Vec<f64> = one[0].channels[channel].iter().copied().collect();
                prop_assert!(near(&total.iter().copied().collect::<Vec<_>>(), &expected));
            }
        }
    }

    #[test]
    fn a_formula_that_is_no_number_somewhere_is_named() -> Result<()> {
        let flights = noise(2, &[600]);
        let mut design = Design::default();
        let mut model = model();
        model.effects.push(crate::physics::Effect::formula("root", 0, "sqrt(vx)", 0.0)?);
        design.model(&model)?;
        let message = grams(&flights, &blocks(&flights, &whole(&flights), 3.0), &design).map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("sqrt(vx)") && text.contains("`f0`")));
        Ok(())
    }
}
