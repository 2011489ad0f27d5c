//! One pass over the flights: for every block and channel the Gram matrix of all columns and the measured acceleration. Everything
//! that a search does afterwards touches only these; they add, so flights can be read in pieces.

use super::design::Design;
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, Span};
use crate::physics::evaluate_blocks;
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
    evaluate_blocks(&design.formulas, flight, end, &mut |range, values| {
        for (block, gram) in blocks.iter().zip(&mut found) {
            let (start, end) = (block.start.max(range.start), block.end.min(range.end));
            if start >= end {
                continue;
            }
            gram.rows += end - start;
            let part = start - range.start..end - range.start;
            for ((formulas, target), sum) in design.channels.iter().zip(Column::TARGETS).zip(&mut gram.channels) {
                scratch.clear();
                for &formula in formulas {
                    scratch.extend_from_slice(values.get(formula).and_then(|column| column.get(part.clone())).unwrap_or_default());
                }
                scratch.extend_from_slice(flight.column(target).get(start..end).unwrap_or_default());
                let shape = (formulas.len() + 1, part.len());
                let Ok(matrix) = ndarray::ArrayView2::from_shape(shape, &scratch) else { continue };
                general_mat_mul(1.0, &matrix, &matrix.t(), 1.0, sum);
            }
        }
        Ok(())
    })?;
    for (block, gram) in blocks.iter().zip(&found) {
        for (formulas, matrix) in design.channels.iter().zip(&gram.channels) {
            if let Some(column) = matrix.diag().iter().position(|value| !value.is_finite()) {
                let formula = formulas.get(column).and_then(|&formula| design.formulas.get(formula));
                return Err(Error::Undetermined(format!(
                    "{} is not a finite number somewhere between t = {:.2} s and {:.2} s of flight `{}`; guard the formula, for example \
                     `max(height, 0.1)`",
                    formula.map_or("the measured acceleration".into(), |formula| format!("the regressor `{formula}`")),
                    flight.time_s(block.start),
                    flight.time_s(block.end - 1),
                    flight.name
                )));
            }
        }
    }
    Ok(found)
}
