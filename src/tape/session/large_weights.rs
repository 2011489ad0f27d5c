//! Gradients of large weights, made once from all samples of a step, rows side by side: summed over shards, a weight of a million numbers
//! would be written for each of them and read again.
//!
//! Pieces of rows depend on the sizes alone, so that no number of threads changes a bit. The products are the operations' own.

use super::replay::Replay;
use crate::tape::op::{Gradient, WeightGradient};
use crate::tape::plan::LargeWeight;
use phyture_kernels::{Real, Rows, Write};
use std::ops::Range;

/// The results of a step, in which its samples have left what the gradients are made of.
pub(super) struct LargeWeights<'a, T> {
    pub replay: &'a Replay<'a, T>,
    pub results: &'a [T],
}

impl<T: Real> LargeWeights<'_, T> {
    /// Gradients of some weights; `gradients` begin at `start` of the flat slab.
    pub fn work(&self, weights: &[LargeWeight], gradients: &mut [T], start: usize) {
        match weights {
            [] => {}
            [weight] => self.rows(weight, 0..weight.rows, &mut gradients[weight.range.start - start..weight.range.end - start]),
            _ => {
                let (low, high) = weights.split_at(weights.len() / 2);
                let middle = high[0].range.start;
                let (low_gradients, high_gradients) = gradients.split_at_mut(middle - start);
                let parallelism = self.replay.parallelism;
                parallelism.join(|| self.work(low, low_gradients, start), || self.work(high, high_gradients, middle));
            }
        }
    }

    /// Halves the rows, and these again, until they are a piece.
    fn rows(&self, weight: &LargeWeight, rows: Range<usize>, gradient: &mut [T]) {
        let pieces = rows.len().div_ceil(weight.piece.max(1));
        if pieces > 1 {
            let cut = pieces / 2 * weight.piece;
            let (low, high) = gradient.split_at_mut(cut * (gradient.len() / rows.len()));
            let middle = rows.start + cut;
            return self
                .replay
                .parallelism
                .join(|| self.rows(weight, rows.start..middle, low), || self.rows(weight, middle..rows.end, high));
        }
        self.replay.slabs.lend(|scratch| {
            for (index, step) in weight.steps.iter().enumerate() {
                let write = if index == 0 { Write::Set } else { Write::Add };
                self.piece(*step, rows.clone(), Gradient { values: &mut *gradient, write }, scratch);
            }
        });
    }

    /// What one step of the backward list gives to some rows.
    fn piece(&self, step: usize, rows: Range<usize>, gradient: Gradient<'_, T>, scratch: &mut [T]) {
        let Replay { plan, isa, samples, result_len, .. } = *self.replay;
        let step = &plan.backward[step];
        let (Some(op), Some(kept)) = (step.op.large_weight(&step.shapes), &step.kept) else { return };
        let [x, dy] = kept.to.each_ref().map(|place| {
            let first = result_len - plan.kept_len + place.start;
            Rows::new(self.results.get(first..).unwrap_or_default(), samples, place.len(), result_len)
        });
        op.weight_gradient(WeightGradient { x, dy, rows, gradient, scratch, shapes: &step.shapes, isa });
    }
}
