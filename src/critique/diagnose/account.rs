//! The account of what was found: what each effect is worth on flights that no search has seen with all others in, and the rounds of a
//! loop as one. Nothing is searched or decided here; errors are measured as in `confirm`, and models fitted as in the search.

use super::amend::{Amended, as_in_the_model, searched};
use super::confirm::confirm;
use super::describe::{accepted, summary};
use super::engine::{Engine, Errors, FOLDS};
use super::gates::{BLOCK_S, CORRELATION_S};
use super::gram::blocks;
use super::joint::{Point, undetermined};
use super::own::Halves;
use super::report::{Bar, Diagnosis, Locked, Status, Step, Verdict, Worth};
use super::selection::selection;
use super::sentences;
use super::suggest::is_suggested;
use crate::blocks::{BlockMean, BlockSum};
use crate::critique::channels::ChannelValues;
use crate::critique::shares::Share;
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{Channel, Flight, PerChannel};
use crate::physics::Model;
use std::collections::BTreeMap;

/// Time of flight that a model without one of its effects is fitted to, s, where more was searched, and flights at least: half an hour settles the
/// others' numbers well enough to tell what comes back.
const REFIT: (f64, usize) = (1800.0, 20);

/// Measures what each accepted effect is worth on the part that no search has seen, and notes it in the diagnosis. `after` is the model
/// with all of them. Nothing is noted where nothing was accepted or nothing kept.
///
/// For each effect the others are fitted again without it, on what was searched or on an even selection of at least 1800 s of its flights; the
/// model that it is compared with is fitted to the same. What the effect itself changes is exact, the others move along their derivatives.
///
/// # Errors
/// As [`Model::predict`]; where the flights do not determine the others without an effect, they stay as they are.
pub fn weigh(diagnosis: &mut Diagnosis, flights: &[Flight], after: &Model, split: &Split) -> Result<()> {
    let Some(before) = diagnosis.locked.as_ref().map(|locked| locked.rmse_before) else { return Ok(()) };
    let effects: Vec<&str> = diagnosis.steps.iter().map(|step| step.effect.as_str()).collect();
    diagnosis.worth = worth(flights, after, &effects, split, &before)?;
    if !diagnosis.worth.is_empty() {
        diagnosis.summary = summary(diagnosis);
    }
    Ok(())
}

fn worth(flights: &[Flight], after: &Model, effects: &[&str], split: &Split, before: &ChannelValues) -> Result<Vec<Worth>> {
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    let correlation = 2.0 * CORRELATION_S / step_s;
    let all = Model { effects: after.effects.iter().filter(|effect| effect.enabled).cloned().collect(), ..after.clone() };
    let cut = blocks(flights, &selection(flights, &searched(split), REFIT), BLOCK_S);
    let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
    let searched = Engine { flights, blocks: cut, fold, correlation, held: Vec::new() };
    let halves = Halves::of(flights, &[&all], &split.test);
    let kept = halves.engine(flights, BLOCK_S, correlation);
    if effects.is_empty() || kept.blocks.is_empty() {
        return Ok(Vec::new());
    }
    let named: Vec<&str> = effects.iter().copied().filter(|effect| all.effect(effect).is_some()).collect();
    let place = |name: &&str| all.effects.iter().position(|effect| effect.name == **name);
    let optional: Vec<usize> = named.iter().filter_map(place).collect();
    let near = Point::at(&searched, all.clone(), optional.clone())?;
    let there = Point::at(&kept, halves.met(flights, &all, correlation)?, optional)?;
    let judged: Vec<usize> = (0..kept.blocks.len()).filter(|&block| kept.fold[block] == 0).collect();
    let rows = judged.iter().map(|&block| kept.blocks[block].count(kept.flights)).sum::<usize>() as f64;
    // Errors there under the others' numbers without some effects, found here; as they are where the flights do not determine them.
    let errors = |absent: &[usize]| {
        let refitted = near.refitted(&searched, absent);
        let numbers = refitted.clone().unwrap_or_else(|| there.unchanged(absent));
        let halves = there.first_halves(&kept, absent).ok_or_else(undetermined)?;
        let errors = there.errors_under(&kept, &halves, &numbers);
        let errors: Errors = PerChannel::from_fn(|channel| judged.iter().map(|&block| errors[channel][block]).collect());
        Ok::<_, Error>((errors, refitted.is_some()))
    };
    let (with, with_refitted) = errors(&[])?;
    let (bare, _) = errors(&(0..named.len()).collect::<Vec<_>>())?;
    let whole = whole_error(&bare, before, rows);
    let of = |(place, effect): (usize, &&str)| {
        let (without, refitted) = errors(&[place])?;
        let (share, rise) = held_against(&with, &without, &whole);
        Ok(Worth { effect: (*effect).to_owned(), share, rise, refitted: refitted && with_refitted })
    };
    let mut worth: Vec<Worth> = named.iter().enumerate().map(of).collect::<Result<_>>()?;
    worth.sort_by(|left, right| right.at_least().total_cmp(&left.at_least()));
    Ok(worth)
}

/// Squared error of each block before anything was added: of the model without all that was found, brought to the sum that was measured.
fn whole_error(bare: &Errors, before: &ChannelValues, rows: f64) -> Errors {
    PerChannel::from_fn(|channel| {
        let measured = before.channels()[channel].map_or(0.0, |rmse| rmse * rmse * rows);
        let sum: f64 = bare[channel].iter().sum();
        let scale = if sum > 0.0 { measured / sum } else { 0.0 };
        bare[channel].iter().map(|error| scale * error).collect()
    })
}

/// By channel that differs, the share of the error `before` that comes back without an effect, and the rise. The interval of a share pairs
/// both block by block, so that a hard block does not count as scatter twice.
fn held_against(with: &Errors, without: &Errors, before: &Errors) -> (BTreeMap<String, Share>, BTreeMap<String, f64>) {
    let (mut shares, mut rises) = (BTreeMap::new(), BTreeMap::new());
    for channel in Channel::ALL {
        let (with, without) = (&with[channel], &without[channel]);
        let differences = with.iter().zip(without).zip(&before[channel]);
        let sums = differences.map(|((with, without), before)| BlockSum { samples: *before, sum: without - with });
        let Some(mean) = BlockMean::ratio(sums).filter(|mean| mean.mean != 0.0) else { continue };
        shares.insert(channel.name().to_owned(), Share { share: mean.mean, ci95: mean.interval() });
        let left: f64 = with.iter().sum();
        if left > 0.0 {
            rises.insert(channel.name().to_owned(), without.iter().sum::<f64>() / left - 1.0);
        }
    }
    (shares, rises)
}

/// The rounds of a loop as one diagnosis: every effect that was added, with the numbers of the final model; the errors before anything
/// was added and after all; what each effect is worth; and of the last round what it found besides, could not judge, and suggests.
/// `before` is the model as it was given, calibrated on what was searched.
///
/// # Errors
/// As [`weigh`]; [`Error::Shape`] without a round.
pub fn together(flights: &[Flight], before: &Model, amended: &Amended, split: &Split) -> Result<Diagnosis> {
    let Amended { rounds, model, .. } = amended;
    let nothing = || Error::Shape { operation: "loop", message: "there is no round to tell of".into() };
    let last = rounds.last().ok_or_else(nothing)?;
    let added: Vec<&Diagnosis> = rounds.iter().filter(|round| round.is_confirmed()).collect();
    // A round that tried suggested formulas alone says nothing of the catalogue.
    let of_catalogue = |round: &&Diagnosis| round.candidates.iter().any(|candidate| !is_suggested(&candidate.effect));
    let searched_last = rounds.iter().rfind(of_catalogue).unwrap_or(last);
    let mut whole = Diagnosis {
        notes: notes(rounds),
        seconds: rounds.iter().map(|round| round.seconds).sum(),
        unknown: last.unknown.clone(),
        failure: last.failure.clone(),
        ..searched_last.clone()
    };
    if added.is_empty() {
        return Ok(whole);
    }
    let is_in = |step: &&Step| model.effect(&step.effect).is_some_and(|effect| effect.enabled);
    whole.verdict = Verdict::EffectsMissing;
    whole.steps = each_once(added.iter().flat_map(|round| &round.steps).filter(is_in));
    whole.accepted = whole.steps.iter().map(|step| step.effect.clone()).collect();
    for step in &mut whole.steps {
        step.indistinguishable.retain(|other| !whole.accepted.contains(other));
    }
    as_in_the_model(&mut whole, model);
    let (open, refused) = (searched_last.candidates.iter(), Status::Accepted);
    let left = open.filter(|candidate| candidate.status != refused).cloned();
    whole.candidates = whole.steps.iter().map(accepted).chain(left).collect();
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    let mut enabled = model.clone();
    enabled.effects.retain(|effect| effect.enabled);
    let rungs = [(Vec::new(), before.clone()), (whole.accepted.clone(), enabled)];
    whole.locked = confirm(flights, &rungs, &split.test, split.tested.name(), BLOCK_S, 2.0 * CORRELATION_S / step_s)?;
    if let Some(locked) = &mut whole.locked {
        let bars = waterfall(&added);
        // With an effect that a later round took out again the rounds are no ladder.
        if bars.iter().map(|bar| bar.added.len()).sum::<usize>() == whole.accepted.len() {
            locked.waterfall = bars;
        }
    }
    whole.confirmation = whole.confirmed();
    let besides: Vec<String> = last.accepted.iter().filter(|effect| !whole.accepted.contains(effect)).cloned().collect();
    if !last.is_confirmed() && !besides.is_empty() {
        let on = last.locked.as_ref().map_or_else(String::new, |locked| sentences::unseen(locked.kept, locked.duration_s));
        whole.notes.push(sentences::not_added(&besides, &on));
    }
    whole.summary = summary(&whole);
    weigh(&mut whole, flights, model, split)?;
    Ok(whole)
}

/// Each effect once, where it was accepted first, as the last round has it: a search from the other end names again what an earlier one had found.
fn each_once<'s>(steps: impl Iterator<Item = &'s Step>) -> Vec<Step> {
    let mut kept: Vec<Step> = Vec::new();
    for step in steps {
        match kept.iter_mut().find(|known| known.effect == step.effect) {
            Some(known) => known.clone_from(step),
            None => kept.push(step.clone()),
        }
    }
    kept
}

/// The bars of several rounds in one row: what a round begins with is what the one before has ended with.
fn waterfall(rounds: &[&Diagnosis]) -> Vec<Bar> {
    let of = |(index, locked): (usize, &Locked)| locked.waterfall.iter().skip(usize::from(index > 0)).cloned().collect::<Vec<_>>();
    rounds.iter().filter_map(|round| round.locked.as_ref()).enumerate().flat_map(of).collect()
}

/// What the rounds have to say besides, each once.
fn notes(rounds: &[Diagnosis]) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    for note in rounds.iter().flat_map(|round| &round.notes) {
        if !said.contains(note) {
            said.push(note.clone());
        }
    }
    said
}

#[cfg(test)]
mod tests {
    use super::super::candidate::with;
    use super::super::gram::tests::{model, noise};
    use super::super::{Options, amend, calibrated};
    use super::*;
    use crate::flight::split::Part;
    use crate::flight::{Column, Span};
    use crate::physics::{Effect, catalogue};

    fn split(flights: &[Flight], locked: usize) -> Split {
        let span = |flight: usize| Span { flight, start: 0, end: flights[flight].len() };
        let (searched, test) = (flights.len() - locked, flights.len());
        Split {
            training: (0..searched).map(span).collect(),
            validation: Vec::new(),
            test: (searched..test).map(span).collect(),
            tested: Part::Locked,
        }
    }

    /// The model's own flights, with `u1`, `u2` and their sum in the first channel beside noise.
    fn flights() -> Result<Vec<Flight>> {
        let mut flights = noise(3, &[6000; 8]);
        for flight in &mut flights {
            let mut accelerations = model().predict(flight)?;
            for (channel, values) in accelerations.pairs_mut() {
                let noise = flight.column(channel.column());
                let sticks = flight.column(Column::U1).iter().zip(flight.column(Column::U2));
                for ((value, noise), (one, other)) in values.iter_mut().zip(noise).zip(sticks) {
                    *value += 0.1 * noise + if channel == Channel::VxDot { one + 0.5 * other } else { 0.0 };
                }
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        Ok(flights)
    }

    fn formula(name: &str, formula: &str) -> Result<Effect> {
        Effect::formula(name, Channel::VxDot, formula, 0.0)
    }

    #[test]
    fn an_effect_is_worth_what_its_absence_costs_after_the_others_are_fitted_again() -> Result<()> {
        let flights = flights()?;
        let split = split(&flights, 2);
        let before = calibrated(&model(), &flights, &split)?;
        // The sum stands in for most of the first stick once that is gone; the second is in nothing else.
        let mut after = model();
        for (name, text) in [("one", "u1"), ("double", "2 * u1 + 0.001 * u3"), ("other", "u2")] {
            after = with(&after, &formula(name, text)?);
        }
        let after = calibrated(&after, &flights, &split)?;
        let names = ["one", "double", "other"];
        let mse = before.rmse(&flights, &split.test)?.map(Some);
        let found = worth(&flights, &after, &names, &split, &ChannelValues::new(mse))?;
        assert_eq!(found[0].effect, "other", "{found:?}");
        let share = found[0].share.get("vx_dot").copied().ok_or_else(|| Error::Undetermined("no share".into()))?;
        // What u2 removes: its quarter of the variance beside that of u1 and a hundredth of noise; all as large as each other.
        let without = with(&with(&model(), &formula("one", "u1")?), &formula("double", "2 * u1 + 0.001 * u3")?);
        let without = calibrated(&without, &flights, &split)?;
        let square = |model: &Model| Ok::<_, Error>(model.rmse(&flights, &split.test)?[Channel::VxDot].powi(2));
        let expected = (square(&without)? - square(&after)?) / square(&before)?;
        assert!((share.share - expected).abs() < 1e-6 && expected > 0.1, "{share:?} {expected}");
        assert!(share.ci95.is_some_and(|[low, high]| low < expected && expected < high && low > 0.5 * expected), "{share:?}");
        let rise = square(&without)? / square(&after)? - 1.0;
        assert!(found[0].rise.get("vx_dot").is_some_and(|found| (found - rise).abs() < 1e-6 * rise), "{found:?} {rise}");
        assert!(found.iter().all(|worth| worth.refitted && worth.share.keys().all(|channel| channel == "vx_dot")), "{found:?}");
        // Frozen, the loss of either would cost most of the first stick; fitted again, the one takes the other's place.
        assert!(found[1..].iter().all(|worth| worth.at_least().abs() < 0.01), "{found:?}");
        Ok(())
    }

    #[test]
    fn a_loop_is_told_as_one_list_with_the_numbers_of_the_final_model() -> Result<()> {
        let flights = flights()?;
        let split = split(&flights, 2);
        let mut model = model();
        for (name, text) in [("one", "u1"), ("other", "u2")] {
            model.effects.push(Effect { enabled: false, ..formula(name, text)? });
        }
        let without = catalogue::definitions().map(|definition| definition.kind.to_owned()).collect();
        let options = Options { without, max_effects: Some(1), ..Options::default() };
        let before = calibrated(&model, &flights, &split)?;
        let amended = amend(&flights, &model, &split, &options, &mut |_, _| Ok(()))?;
        assert!(amended.rounds.len() == 3, "an effect a round, and one that finds nothing");
        let whole = together(&flights, &before, &amended, &split)?;
        assert_eq!(whole.accepted, ["one", "other"]);
        assert_eq!(whole.worth.iter().map(|worth| worth.effect.as_str()).collect::<Vec<_>>(), ["one", "other"]);
        for step in &whole.steps {
            let value =
                amended.model.effect(&step.effect).and_then(|effect| effect.coefficients.first()).map(|number| number.value);
            assert_eq!(step.coefficients.first().map(|number| number.value), value, "{}", step.effect);
        }
        let locked = whole.locked.clone().unwrap_or_default();
        assert_eq!(locked.waterfall.len(), 3, "a bar for the model and one for each effect");
        let [first, last] =
            [before.rmse(&flights, &split.test)?[Channel::VxDot], amended.model.rmse(&flights, &split.test)?[Channel::VxDot]];
        let found = [locked.rmse_before.vx_dot, locked.rmse_after.vx_dot].map(|rmse| rmse.unwrap_or(f64::NAN));
        assert!((found[0] - first).abs() < 1e-9 && (found[1] - last).abs() < 1e-9, "{found:?} {first} {last}");
        assert_eq!((whole.verdict, whole.is_confirmed()), (Verdict::EffectsMissing, true));
        Ok(())
    }

    #[test]
    fn a_loop_that_is_stopped_keeps_what_it_had_added() -> Result<()> {
        let flights = flights()?;
        let split = split(&flights, 2);
        let mut model = model();
        model.effects.push(Effect { enabled: false, ..formula("one", "u1")? });
        let without: Vec<String> = catalogue::definitions().map(|definition| definition.kind.to_owned()).collect();
        let stopped_in = |stop: usize| {
            let options = Options { without: without.clone(), max_effects: Some(1), ..Options::default() };
            if stop == 0 {
                options.watch.stop();
            }
            amend(&flights, &model, &split, &options, &mut |round, _| {
                if round == stop {
                    options.watch.stop();
                }
                Ok(())
            })
        };
        let amended = stopped_in(1)?;
        assert!(amended.stopped && amended.rounds.len() == 1);
        assert!(amended.model.effect("one").is_some_and(|effect| effect.enabled));
        assert!(matches!(stopped_in(0), Err(Error::Interrupted { .. })), "with nothing found there is nothing to keep");
        assert!(!stopped_in(9)?.stopped);
        Ok(())
    }

    #[test]
    fn what_two_rounds_name_is_told_once_as_the_last_has_it() {
        let step = |effect: &str, p_value: f64| Step { effect: effect.into(), p_value, ..Step::default() };
        let rounds = [vec![step("one", 0.1), step("two", 0.2)], vec![step("three", 0.3), step("one", 0.4)]];
        let kept = each_once(rounds.iter().flatten());
        let told: Vec<(&str, f64)> = kept.iter().map(|step| (step.effect.as_str(), step.p_value)).collect();
        assert_eq!(told, [("one", 0.4), ("two", 0.2), ("three", 0.3)]);
    }
}
