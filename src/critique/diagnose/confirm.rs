//! The confirmation: errors on flights that no search has seen, with none, one, two … of the accepted effects.

use super::design::Design;
use super::engine::{Engine, FOLDS, priors};
use super::fit::{Reduced, Solution, components};
use super::gram::{blocks, grams};
use super::report::{Kept, Locked};
use super::resample::{RESAMPLES, draw, quantile};
use crate::critique::compare::PerChannel;
use crate::error::Result;
use crate::flight::{Column, Flight, Span};
use crate::physics::Model;

/// Errors on flights that no search has seen, of each of the models.
pub(super) fn confirm(
    flights: &[Flight],
    models: &[Model],
    locked: &[Span],
    part: &str,
    block_s: f64,
    correlation: f64,
) -> Result<Option<Locked>> {
    let Some((counts, errors)) = errors_on(flights, models, locked, block_s, correlation)? else { return Ok(None) };
    let rows = counts.iter().sum::<usize>() as f64;
    let rmse = |errors: &[Vec<f64>; 6]| {
        PerChannel::new(std::array::from_fn(|channel| Some((errors[channel].iter().sum::<f64>() / rows).sqrt())))
    };
    let (Some(first), Some(last)) = (errors.first(), errors.last()) else { return Ok(None) };
    let mse_fall = (0..6)
        .filter(|&channel| first[channel] != last[channel])
        .map(|channel| {
            let (before, after) = (&first[channel], &last[channel]);
            let fall = |drawn: &mut dyn Iterator<Item = usize>| {
                let (mut b, mut a) = (0.0, 0.0);
                drawn.for_each(|block| (b, a) = (b + before[block], a + after[block]));
                1.0 - a / b
            };
            let whole = fall(&mut (0..before.len()));
            let mut worlds: Vec<f64> = (0..RESAMPLES).map(|world| fall(&mut draw(before.len(), 0, world).into_iter())).collect();
            worlds.sort_by(f64::total_cmp);
            let name = Column::TARGETS.get(channel).map_or("?", |column| column.name()).to_owned();
            (name, [whole, quantile(&worlds, 0.025), quantile(&worlds, 0.975)])
        })
        .collect();
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    Ok(Some(Locked {
        part: part.into(),
        kept: kept(flights, locked),
        duration_s: rows * step_s,
        rmse_before: rmse(first),
        rmse_after: rmse(last),
        mse_fall,
        waterfall: errors.iter().map(rmse).collect(),
        floor: None,
        removable_removed: None,
    }))
}

/// Squared errors of one model: for each channel one number a block.
pub(super) type BlockErrors = [Vec<f64>; 6];

/// The blocks that spans are cut into, as their numbers of samples, and on them the squared errors of each model under its own numbers.
/// `None` without a sample.
pub(super) fn errors_on(
    flights: &[Flight],
    models: &[Model],
    spans: &[Span],
    block_s: f64,
    correlation: f64,
) -> Result<Option<(Vec<usize>, Vec<BlockErrors>)>> {
    let cut = blocks(flights, spans, block_s);
    if cut.is_empty() {
        return Ok(None);
    }
    let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
    let engine = Engine { flights, blocks: cut, fold, correlation, held: Vec::new() };
    let errors = models.iter().map(|model| errors_under(&engine, model)).collect::<Result<_>>()?;
    Ok(Some((engine.blocks.iter().map(|block| block.end - block.start).collect(), errors)))
}

/// What spans are made of: whole flights, the last part of each, or pieces from anywhere.
fn kept(flights: &[Flight], locked: &[Span]) -> Kept {
    let length = |span: &Span| flights.get(span.flight).map_or(0, Flight::len);
    let alone = |span: &Span| locked.iter().filter(|other| other.flight == span.flight).count() == 1;
    let to_end = |span: &Span| alone(span) && span.end == length(span);
    match () {
        () if locked.iter().all(|span| to_end(span) && span.start == 0) => Kept::Flights,
        () if locked.iter().all(to_end) => Kept::Ends,
        () => Kept::Segments,
    }
}

/// Squared error of each block of each channel under a model's own numbers; properties of a flight are found from its other blocks.
pub(super) fn errors_under(engine: &Engine<'_>, model: &Model) -> Result<BlockErrors> {
    let mut design = Design::default();
    let layout = design.model(model)?;
    let grams = grams(engine.flights, &engine.blocks, &design)?;
    let priors = priors(model, &layout, &engine.held);
    let mut errors: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::new());
    for (channels, members) in components(&layout) {
        let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(&layout, channel, &grams)).collect();
        let value = |free: usize| {
            let free = layout.free[free];
            let effect = model.effects.get(free.effect);
            effect.and_then(|effect| effect.coefficients.get(free.coefficient)).map_or(0.0, |coefficient| coefficient.value)
        };
        // Weights of channels that share a property of a flight: their inverse error without it.
        let weights: [f64; 6] = std::array::from_fn(|channel| {
            let position = channels.iter().position(|&other| other == channel);
            let global = |free: usize| if priors[free].by_flight.is_some() { 0.0 } else { value(free) };
            let error =
                position.map(|position| (0..engine.blocks.len()).map(|block| reduced[position].error(block, &global)).sum::<f64>());
            error.map_or(1.0, |error| engine.rows() as f64 / error.max(f64::MIN_POSITIVE))
        });
        let component = engine.component(&channels, &members, &reduced, &weights, &priors);
        let solution = Solution {
            values: members.iter().map(|&member| if priors[member].by_flight.is_some() { 0.0 } else { value(member) }).collect(),
            bound: vec![false; members.len()],
            by_flight: Vec::new(),
        };
        for (channel, found) in component.errors_under(&solution, FOLDS, &|block| engine.fold[block]) {
            errors[channel] = found;
        }
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::super::candidate::with;
    use super::super::gram::tests::{model, whole};
    use super::*;
    use crate::flight::Targets;
    use crate::flight::split::{Protocol, Split};
    use crate::physics::catalogue;

    #[test]
    fn the_part_kept_is_called_what_it_is() -> Result<()> {
        let columns = || std::array::from_fn(|_| vec![0.0; 6000]);
        let flight = |name: &str| Flight::new(name, "rest", 0.0, 0.01, columns(), Targets::Recorded);
        let flights = [flight("a")?, flight("b")?, flight("c")?];
        let seed = 1;
        let first = Split::new(&flights, &[], &Protocol::First(0.8), seed)?;
        let segments = Split::new(&flights, &[], &Protocol::Segments, seed)?;
        let locked = Split::new(&flights, &["b".to_owned()], &Protocol::Segments, seed)?;
        assert_eq!([first, segments, locked].map(|split| kept(&flights, &split.test)), [Kept::Ends, Kept::Segments, Kept::Flights]);
        Ok(())
    }

    /// At rest, and measured so: channels without any error have no weight that a computer can hold.
    #[test]
    fn flights_without_an_error_do_not_determine_biases_and_are_no_panic() -> Result<()> {
        let still = std::array::from_fn(|_| vec![0.0; 6000]);
        let flights = [Flight::new("still", "rest", 0.0, 0.01, still, Targets::Recorded)?];
        let bias = catalogue::definition("sensor_bias").map(|definition| definition.effect(4.58, 0.8));
        let models = [Some(model()), bias.map(|bias| with(&model(), &bias))];
        let models: Vec<Model> = models.into_iter().flatten().collect();
        let found = confirm(&flights, &models, &whole(&flights), "test", 5.0, 100.0)?;
        let rmse = found.map(|found| [found.rmse_before, found.rmse_after].map(|rmse| rmse.channels()));
        assert!(models.len() == 2 && rmse.is_some_and(|[before, after]| before == after && before[0] == Some(0.0)), "{rmse:?}");
        Ok(())
    }
}
