//! Intervals of coefficients from resampled blocks: the spread of the estimate over data sets made of the same blocks, drawn with
//! replacement (block bootstrap, Künsch 1989, Annals of Statistics 17:1217).

use super::engine::{Engine, priors};
use super::fit::{Reduced, components};
use super::influence::{Influences, decisive};
use crate::error::Result;
use crate::physics::{Correlation, Model};
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

/// What resampled blocks say of the coefficients of a model; properties of a flight are left out.
pub(super) struct Resampled {
    /// 95 % intervals, by effect and coefficient.
    pub intervals: BTreeMap<(usize, usize), [f64; 2]>,
    /// How the coefficients vary together.
    pub correlations: Vec<Correlation>,
    /// Coefficients that hang on one flight.
    pub influences: Influences,
}

/// Intervals and correlations of the coefficients of a model.
pub(super) fn resampled(engine: &Engine<'_>, model: &Model, seed: u64) -> Result<Resampled> {
    let pass = engine.pass(model, &[])?;
    let layout = &pass.base.layout;
    let (weights, priors) = (engine.weights(&pass.base), priors(model, layout, &engine.held));
    let mut found = Resampled { intervals: BTreeMap::new(), correlations: Vec::new(), influences: Influences::new() };
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
        let common: Vec<usize> = (0..members.len()).filter(|&at| priors[members[at]].by_flight.is_none()).collect();
        let label = |&at: &usize| {
            let effect = &model.effects[layout.free[members[at]].effect];
            Correlation::label(effect, &effect.coefficients[layout.free[members[at]].coefficient].name)
        };
        let mean = |at: usize| worlds.iter().map(|values| values[at]).sum::<f64>() / worlds.len() as f64;
        let means: Vec<f64> = common.iter().map(|&at| mean(at)).collect();
        let deviations = |values: &Vec<f64>| common.iter().zip(&means).map(|(&at, mean)| values[at] - mean).collect();
        let deviations: Vec<Vec<f64>> = worlds.iter().map(deviations).collect();
        found.correlations.extend(Correlation::of_deviations(common.iter().map(label).collect(), &deviations));
        let without = component.without_each_flight();
        for position in common {
            let mut values: Vec<f64> = worlds.iter().map(|values| values[position]).collect();
            values.sort_by(f64::total_cmp);
            let free = layout.free[members[position]];
            let interval = [quantile(&values, 0.025), quantile(&values, 0.975)];
            found.intervals.insert((free.effect, free.coefficient), interval);
            let of_flight = without.iter().map(|(flight, values)| (*flight, values.as_ref().map(|values| values[position])));
            let influence = decisive(interval, of_flight, engine.flights);
            found.influences.extend(influence.map(|influence| ((free.effect, free.coefficient), influence)));
        }
    }
    Ok(found)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::gram::tests::{model, noise, whole};
    use super::super::gram::{Block, blocks};
    use super::*;
    use crate::flight::Channel;
    use crate::flight::Column;
    use proptest::prelude::*;

    /// A flight in which the roll acceleration answers to the stick.
    pub(in super::super) fn pulled_by(flight: &mut crate::flight::Flight) -> Result<()> {
        let mut accelerations = flight.accelerations();
        accelerations[Channel::WxDot].iter_mut().zip(flight.column(Column::U1)).for_each(|(value, stick)| *value += 3.0 * stick);
        *flight = flight.with_accelerations(&accelerations)?;
        Ok(())
    }

    proptest! {
        #[test]
        fn draws_are_of_the_blocks_and_repeat(count in 1usize..300, seed: u64, world in 0usize..500) {
            let drawn = draw(count, seed, world);
            prop_assert_eq!(drawn.len(), count);
            prop_assert!(drawn.iter().all(|block| *block < count));
            prop_assert_eq!(drawn, draw(count, seed, world));
        }

        #[test]
        fn a_quantile_is_one_of_the_numbers_and_grows(mut values in prop::collection::vec(-1e6..1e6_f64, 1..200), a in 0.0..1.0_f64, b in 0.0..1.0_f64) {
            values.sort_by(f64::total_cmp);
            let (low, high) = (quantile(&values, a.min(b)), quantile(&values, a.max(b)));
            prop_assert!(low <= high && values.contains(&low) && values.contains(&high));
            prop_assert_eq!(quantile(&values, 0.0), values[0]);
            prop_assert_eq!(quantile(&values, 1.0), values[values.len() - 1]);
        }
    }

    #[test]
    fn worlds_differ_and_the_quantile_of_nothing_is_no_number() {
        assert_ne!(draw(60, 1, 0), draw(60, 1, 1));
        assert_ne!(draw(60, 1, 0), draw(60, 2, 0));
        assert!(quantile(&[], 0.5).is_nan());
    }

    /// Everything lasts for two seconds, the error too: an interval that took rows for observations would be narrower by the root of
    /// the number of rows that say the same.
    #[test]
    fn intervals_from_blocks_are_wider_than_from_rows_where_errors_last() -> Result<()> {
        let mut flights = noise(3, &[24_000]);
        let hold = |values: &[f64]| -> Vec<f64> { (0..values.len()).map(|sample| values[sample / 200 * 200]).collect() };
        let columns = Column::ALL.map(|column| hold(flights[0].column(column)));
        flights = vec![crate::flight::Flight::new("held", "noise", 0.0, 0.01, columns, crate::flight::Targets::Recorded)?];
        let width = |block_s: f64| -> Result<f64> {
            let cut: Vec<Block> = blocks(&flights, &whole(&flights), block_s);
            let fold = (0..cut.len()).map(|block| block % 10).collect();
            let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
            let found = resampled(&engine, &model(), 1)?.intervals;
            Ok(found.get(&(index(), 0)).map_or(f64::NAN, |[low, high]| high - low))
        };
        let (by_block, by_row) = (width(10.0)?, width(0.1)?);
        assert!(by_block > 2.0 * by_row, "{by_block} from blocks, {by_row} from rows");
        Ok(())
    }

    #[test]
    fn a_number_that_hangs_on_one_flight_names_it() -> Result<()> {
        let mut flights = noise(8, &[3000; 12]);
        let found = |flights: &[crate::flight::Flight]| {
            let cut: Vec<Block> = blocks(flights, &whole(flights), 2.0);
            let fold = (0..cut.len()).map(|block| block % 10).collect();
            let engine = Engine { flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
            resampled(&engine, &model(), 1).map(|found| found.influences)
        };
        assert!(found(&flights)?.is_empty());
        pulled_by(&mut flights[11])?;
        let influences = found(&flights)?;
        let named: Vec<&str> = influences.values().map(|influence| influence.flight.as_str()).collect();
        assert_eq!(named, ["f11"], "{influences:?}");
        assert!(influences.values().all(|influence| influence.without.is_some_and(|value| value.abs() < 0.1)), "{influences:?}");
        Ok(())
    }

    /// Where the drag stands in the model.
    fn index() -> usize {
        model().effects.iter().position(|effect| effect.name == "linear_drag").unwrap_or(usize::MAX)
    }
}
