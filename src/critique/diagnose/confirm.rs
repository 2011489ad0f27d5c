//! The confirmation: errors on flights that no search has seen, with none, one, two … of the accepted effects.

use super::engine::Errors;
use super::own::{Halves, Judgement, judged_errors};
use super::report::{Bar, Kept, Locked};
use super::resample::{RESAMPLES, draw, quantile};
use crate::blocks::{BlockMean, BlockSum};
use crate::critique::channels::{ChannelValues, Intervals};
use crate::critique::shares::Share;
use crate::error::Result;
use crate::flight::{Channel, Flight, PerChannel, Span};
use crate::physics::Model;
use std::collections::BTreeMap;

/// A rise by less than this share of the error is one of rounding: the same numbers, found on another way.
const ROUNDING: f64 = 1e-6;

/// A model, and the effects that it adds to the one before it.
pub(super) type Rung = (Vec<String>, Model);

/// Errors on flights that no search has seen, of each of the models.
pub(super) fn confirm(
    flights: &[Flight],
    rungs: &[Rung],
    locked: &[Span],
    part: &str,
    block_s: f64,
    correlation: f64,
) -> Result<Option<Locked>> {
    let models: Vec<&Model> = rungs.iter().map(|rung| &rung.1).collect();
    let halves = Halves::of(flights, &models, locked);
    let judged = judged_errors(flights, &models, &halves, block_s, correlation)?;
    let Some(Judgement { counts, errors }) = judged else { return Ok(None) };
    let rows = counts.iter().sum::<usize>() as f64;
    let rmse = |errors: &PerChannel<Vec<f64>>| {
        ChannelValues::new(PerChannel::from_fn(|channel| Some((errors[channel].iter().sum::<f64>() / rows).sqrt())))
    };
    let (Some(first), Some(last)) = (errors.first(), errors.last()) else { return Ok(None) };
    let mse_fall = Channel::ALL
        .into_iter()
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
            let name = channel.name().to_owned();
            (name, [whole, quantile(&worlds, 0.025), quantile(&worlds, 0.975)])
        })
        .collect();
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    Ok(Some(Locked {
        part: part.into(),
        kept: kept(flights, locked),
        own_from_first_half: !halves.first.is_empty(),
        spans: halves.judged(),
        duration_s: rows * step_s,
        rmse_before: rmse(first),
        rmse_after: rmse(last),
        mse_fall,
        waterfall: waterfall(rungs, &errors, &counts, &rmse),
        floor: None,
        removable_removed: None,
    }))
}

/// A bar for each model.
fn waterfall(rungs: &[Rung], errors: &[Errors], counts: &[usize], rmse: &dyn Fn(&Errors) -> ChannelValues) -> Vec<Bar> {
    let pairs: Vec<[&Errors; 2]> = errors.windows(2).map(|pair| [&pair[0], &pair[1]]).collect();
    let differing =
        |[before, after]: &[&Errors; 2]| Channel::ALL.into_iter().filter(|&channel| before[channel] != after[channel]).count();
    let comparisons: usize = pairs.iter().map(differing).sum();
    let bar = |((added, _), own): (&Rung, &Errors)| Bar {
        added: added.clone(),
        rmse: rmse(own),
        rmse_ci95: intervals(own, counts),
        rises: BTreeMap::new(),
    };
    let mut bars: Vec<Bar> = rungs.iter().zip(errors).map(bar).collect();
    for (bar, pair) in bars.iter_mut().skip(1).zip(pairs) {
        bar.rises = rises(pair, comparisons);
    }
    bars
}

/// The interval of each root mean square error, from the blocks' sums of squares and their rows.
fn intervals(errors: &Errors, counts: &[usize]) -> Intervals {
    let of = |channel: Channel| {
        let blocks = errors[channel].iter().zip(counts);
        BlockMean::new(blocks.map(|(sum, rows)| BlockSum { samples: *rows as f64, sum: *sum }))?.root_interval()
    };
    Intervals::new(PerChannel::from_fn(of))
}

/// Channels whose error is larger than before by more than chance, block against block; one of so many comparisons.
fn rises([before, after]: [&Errors; 2], comparisons: usize) -> BTreeMap<String, Share> {
    let of = |channel: Channel| {
        let pairs = before[channel].iter().zip(&after[channel]);
        let mean = BlockMean::ratio(pairs.map(|(before, after)| BlockSum { samples: *before, sum: after - before }))?;
        let rise = Share { share: mean.mean, ci95: mean.interval_of(comparisons) };
        rise.ci95.is_some_and(|[low, _]| low > ROUNDING).then(|| (channel.name().to_owned(), rise))
    };
    Channel::ALL.into_iter().filter_map(of).collect()
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

#[cfg(test)]
mod tests {
    use super::super::candidate::with;
    use super::super::gram::tests::{model, whole};
    use super::*;
    use crate::flight::Targets;
    use crate::flight::split::{Protocol, Split};
    use crate::physics::catalogue;

    #[test]
    fn a_rise_beyond_chance_is_noted_and_one_within_is_not() {
        let blocks = |values: [f64; 4]| -> Errors {
            PerChannel::from_fn(|channel| if channel == Channel::VzDot { values.into() } else { vec![1.0; 4] })
        };
        let before = blocks([1.0, 1.1, 0.9, 1.0]);
        let found = rises([&before, &blocks([1.2, 1.31, 1.1, 1.19])], 6);
        assert!(found.len() == 1 && (found["vz_dot"].share - 0.2).abs() < 1e-12, "{found:?}");
        assert!(rises([&before, &blocks([1.5, 0.9, 1.3, 0.8])], 6).is_empty(), "some blocks up, some down");
        assert!(rises([&before, &blocks([0.8, 0.9, 0.7, 0.8])], 6).is_empty(), "a fall");
        assert!(rises([&before, &blocks([1.0, 1.1, 0.9, 1.0].map(|error| error * (1.0 + 1e-12)))], 6).is_empty(), "rounding");
        // Half the difference in every block, and its scatter: enough for one comparison, too little for many.
        let little = blocks([1.1, 1.14, 0.97, 1.06]);
        assert_eq!([1, 60].map(|count| rises([&before, &little], count).len()), [1, 0]);
    }

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
        let models: Vec<Rung> = models.into_iter().flatten().map(|model| (Vec::new(), model)).collect();
        let found = confirm(&flights, &models, &whole(&flights), "test", 5.0, 100.0)?;
        let rmse = found.map(|found| [found.rmse_before, found.rmse_after].map(|rmse| rmse.channels()));
        assert!(
            models.len() == 2 && rmse.is_some_and(|[before, after]| before == after && before[Channel::VxDot] == Some(0.0)),
            "{rmse:?}"
        );
        Ok(())
    }
}
