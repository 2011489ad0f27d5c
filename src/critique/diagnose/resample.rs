//! Intervals of coefficients from resampled blocks: the spread of the estimate over data sets made of the same blocks, drawn with
//! replacement (block bootstrap, Künsch 1989, Annals of Statistics 17:1217).

use super::engine::{Engine, priors};
use super::fit::{Reduced, components};
use crate::error::Result;
use crate::physics::Model;
use phyture_kernels::random::Stream;
use std::collections::BTreeMap;

/// Blocks resampled so many times for intervals and selection frequency.
pub(super) const RESAMPLES: usize = 500;

/// Blocks drawn with replacement.
pub(super) fn draw(count: usize, seed: u64, world: usize) -> Vec<usize> {
    /// Where in a run the draws are made.
    const SITE: u64 = 0x626f_6f74;
    let stream = Stream::new(seed, world as u64, SITE, 0);
    (0..count).map(|index| ((stream.uniform(index as u64) * count as f64) as usize).min(count.saturating_sub(1))).collect()
}

/// The value below which a share of sorted numbers lies.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((last as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
}

/// 95 % intervals of the coefficients of a model, by effect and coefficient; properties of a flight have none.
pub(super) fn intervals(engine: &Engine<'_>, model: &Model, seed: u64) -> Result<BTreeMap<(usize, usize), [f64; 2]>> {
    let pass = engine.pass(model, &[])?;
    let layout = &pass.base.layout;
    let (weights, priors) = (engine.weights(&pass.base), priors(model, layout));
    let mut found = BTreeMap::new();
    for (channels, members) in components(layout) {
        let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(layout, channel, &pass.grams)).collect();
        let component = engine.component(&channels, &members, &reduced, &weights, &priors);
        let one = |world: usize| {
            let mut counts = vec![0.0; engine.blocks.len()];
            draw(engine.blocks.len(), seed, world).into_iter().for_each(|block| counts[block] += 1.0);
            component.solve(&|block| counts[block]).map(|solution| solution.values)
        };
        #[cfg(feature = "rayon")]
        let worlds: Vec<Vec<f64>> = {
            use rayon::prelude::*;
            (0..RESAMPLES).into_par_iter().filter_map(one).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let worlds: Vec<Vec<f64>> = (0..RESAMPLES).filter_map(one).collect();
        // Worlds without a solution are rare; were they not, the interval would be a fiction.
        if worlds.len() < RESAMPLES * 9 / 10 {
            continue;
        }
        for (position, &member) in members.iter().enumerate().filter(|(_, member)| priors[**member].by_flight.is_none()) {
            let mut values: Vec<f64> = worlds.iter().map(|values| values[position]).collect();
            values.sort_by(f64::total_cmp);
            let free = layout.free[member];
            found.insert((free.effect, free.coefficient), [quantile(&values, 0.025), quantile(&values, 0.975)]);
        }
    }
    Ok(found)
}
