//! From flights and a model to a diagnosis: blocks, search, what is left, confirmation, verdict.

use super::backward::Backward;
use super::candidate::{Candidate, candidates, is_found};
use super::confirm::confirm;
use super::describe::{accepted, summary, taken_back};
use super::engine::{Engine, permuted_folds};
use super::failure::{Measured, failure, variance};
use super::forward::has_many;
use super::found::Found;
use super::gates::{
    BLOCK_S, CORRELATION_S, ENOUGH_BLOCKS, FAMILY_WISE, FEWEST_BLOCKS, MOST_BLOCKS, SHORTEST_BLOCK_S, SMALLEST_FALL,
};
use super::gram::blocks;
use super::own::prediction_errors;
use super::report::{CandidateReport, Diagnosis, Method, Verdict};
use super::rest::{STANDS_IN, Share, channel, dependences, stands_in};
use super::search::{Options, Search};
use super::significance::Flips;
use super::signs::wrong_signs;
use super::support::doubt;
use super::{sentences, signs, suggest};
use crate::critique::unknown::Unknown;
use crate::error::{Error, Result};
use crate::flight::{Flight, PerChannel, Span};
use crate::physics::{Effect, Model};
use crate::stopwatch::Stopwatch;

/// Effects that are looked for one after the other, at most, where they cannot be fitted at once.
const MOST_FORWARD: usize = 6;

/// A diagnosis and the model with what it found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The verdict and its figures.
    pub diagnosis: Diagnosis,
    /// The model with the accepted effects, fitted on the searched blocks.
    pub model: Model,
}

/// Searches the catalogue for effects that `model` lacks on `searched` spans, and confirms them on `locked` ones (named `part`).
///
/// Coefficients of `model` are fitted anew; effects that are switched off in it are candidates. Verdict `convention_fault` is the
/// caller's to give, before.
///
/// # Errors
/// As [`Model::predict`]; [`Error::Interrupted`] where [`Options::watch`] stops it.
pub fn diagnose(
    flights: &[Flight],
    model: &Model,
    searched: &[Span],
    locked: &[Span],
    part: &str,
    options: &Options,
) -> Result<Outcome> {
    let begun = Stopwatch::start();
    let mut base = model.clone();
    base.effects.retain(|effect| effect.enabled);
    let mut block_s = BLOCK_S;
    let mut cut = blocks(flights, searched, block_s);
    if cut.len() < ENOUGH_BLOCKS {
        block_s = SHORTEST_BLOCK_S;
        cut = blocks(flights, searched, block_s);
    } else if cut.len() > MOST_BLOCKS {
        block_s *= cut.len() as f64 / MOST_BLOCKS as f64;
        cut = blocks(flights, searched, block_s);
    }
    let fold = permuted_folds(cut.len(), options.seed);
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    let engine = Engine { flights, blocks: cut, fold, correlation: 2.0 * CORRELATION_S / step_s, held: Vec::new() };
    let mut candidates = candidates(model, flights);
    candidates.retain(|candidate| !options.without.contains(&candidate.id));
    let in_play = candidates.iter().filter(|candidate| candidate.inapplicable.is_none()).count().max(1);
    let largest_p = FAMILY_WISE / in_play as f64;
    let count = engine.blocks.len();
    let method = Method {
        blocks: count,
        block_s,
        correlation_s: CORRELATION_S,
        searched_s: engine.rows() as f64 * step_s,
        seed: options.seed,
        effects_in_play: in_play,
        largest_p_value: largest_p,
        smallest_fall: SMALLEST_FALL,
    };
    if count < FEWEST_BLOCKS {
        let summary = sentences::too_few_blocks(count, block_s, FEWEST_BLOCKS, SHORTEST_BLOCK_S);
        let seconds = begun.seconds();
        let diagnosis = Diagnosis { method: Some(method), seconds, ..Diagnosis::nothing(Verdict::TooLittleData, summary) };
        return Ok(Outcome { diagnosis, model: base });
    }
    let notes: Vec<String> = model.effects.iter().filter_map(Effect::caution).collect();
    let mut diagnosis = Diagnosis { method: Some(method), notes, ..Diagnosis::nothing(Verdict::Explained, String::new()) };
    let mut search = Search { engine, flips: Flips::new(count, options.seed), largest_p, options };
    options.watch.at("fitting the model, and when the controls act")?;
    let (before, held) = search.timing(&base)?;
    if let Some(delay_s) = held {
        diagnosis.notes.push(format!(
            "the controls act {:.1} ms after their sample, half a step: they are held from one sample to the next. Taken as a property of \
             the log (`control_delay_s = {delay_s}` under [data]), not as a missing effect",
            1e3 * delay_s
        ));
    }
    let ground = Ground { flights, searched, locked, part, block_s, before: &before };
    // What fits only with the wrong sign is tried once more with the right one.
    let heard = loop {
        let heard = search.hear(&ground, &candidates)?;
        let wrong = signs::wrong(&heard.found);
        let known = search.engine.held.len();
        search.engine.held.extend(wrong);
        search.engine.held.sort_unstable();
        search.engine.held.dedup();
        if search.engine.held.len() == known {
            break heard;
        }
    };
    diagnosis.seconds = begun.seconds();
    search.conclude(&ground, heard, diagnosis)
}

/// What a search stands on.
struct Ground<'a> {
    flights: &'a [Flight],
    searched: &'a [Span],
    locked: &'a [Span],
    part: &'a str,
    block_s: f64,
    /// The model as it was given, fitted.
    before: &'a Model,
}

/// What a search came back with.
struct Heard {
    found: Vec<Found>,
    left: Vec<CandidateReport>,
    unknown: Vec<Unknown>,
    /// How both roads went, where both were taken.
    roads: Option<String>,
    /// Whether what was found was found at once, and stands in one model.
    at_once: bool,
}

impl Search<'_> {
    /// The whole search: forward, what the rest depends on, stand-ins taken back, intervals.
    fn hear(&self, ground: &Ground<'_>, candidates: &[Candidate]) -> Result<Heard> {
        let before = ground.before;
        let limit = self.options.max_effects;
        let is_many = |found: &[Found]| limit.is_none() && found.len() == Self::enough(before);
        // Where much is missing, or is in the model already, a part of long flights shows it as well.
        let part = self.part().filter(|_| limit.is_none());
        let of_part = part.map(|part| part.forward(before, candidates, None)).transpose()?;
        let (mut found, mut left) = match of_part.filter(|(found, _)| is_many(found) || has_many(before)) {
            Some(of_part) => of_part,
            None => self.forward(before, candidates, limit)?,
        };
        let mut roads = None;
        if is_many(&found) {
            match self.hear_all(ground, candidates, &found) {
                // Some effect cannot be fitted beside all others: what one after the other brings is still worth having.
                Err(Error::Undetermined(why)) => {
                    (found, left) = self.forward(before, candidates, Some(MOST_FORWARD))?;
                    roads = Some(sentences::one_road(&why));
                }
                heard => return heard,
            }
        }
        let fitted = |found: &[Found]| found.last().map_or(before, |last| &last.model).clone();
        let unknown_of = |model: &Model| dependences(ground.flights, model, ground.searched, ground.block_s, self.options.seed);
        self.options.watch.at("what the rest of the error depends on")?;
        let mut unknown = unknown_of(&fitted(&found))?;
        let unfounded = self.unfounded(ground, &found, &unknown)?;
        if !unfounded.is_empty() {
            left.splice(0..0, unfounded.reports(&found));
            self.without(&mut found, &unfounded.names(), before)?;
            unknown = unknown_of(&fitted(&found))?;
        }
        self.options.watch.at("intervals of the numbers")?;
        let numbers = if has_many(before) { self.numbers_at_once(&mut found) } else { self.intervals(&mut found) };
        match numbers {
            // Lags and delays may be what these flights leave open; the coefficients by themselves are not.
            Err(Error::Undetermined(_)) if has_many(before) => self.intervals(&mut found)?,
            done => done?,
        }
        Ok(Heard { found, left, unknown, roads, at_once: false })
    }

    /// The search from the other end: everything at once, the needless left out, what the rest depends on. `first` is what the forward search
    /// had found when it was left.
    fn hear_all(&self, ground: &Ground<'_>, candidates: &[Candidate], first: &[Found]) -> Result<Heard> {
        let Backward { fitted, needed, needless } = self.backward_road(ground.before, candidates)?;
        let mut found: Vec<Found> = needed.iter().filter_map(|judged| self.needed(judged, &fitted)).collect();
        let model = fitted.model;
        self.judge_signs(&model, &mut found);
        let applicable = candidates.iter().filter(|candidate| candidate.inapplicable.is_none());
        let tried = applicable.count() + ground.before.effects.iter().filter(|effect| is_found(effect)).count();
        let names: Vec<String> = first.iter().map(|found| found.step.effect.clone()).collect();
        let dropped: Vec<String> = names.iter().filter(|name| model.effect(name).is_none()).cloned().collect();
        let roads = sentences::both_roads(tried, &names, &dropped);
        let mut left: Vec<CandidateReport> = needless.iter().map(|judged| self.needless(judged)).collect();
        let refused: Vec<&Candidate> = candidates.iter().filter(|candidate| candidate.inapplicable.is_some()).collect();
        left.extend(self.reports(&refused, &[]));
        self.options.watch.at("what the rest of the error depends on")?;
        let unknown = dependences(ground.flights, &model, ground.searched, ground.block_s, self.options.seed)?;
        let unfounded = self.unfounded(ground, &found, &unknown)?;
        if unfounded.is_empty() {
            return Ok(Heard { found, left, unknown, roads: Some(roads), at_once: true });
        }
        left.splice(0..0, unfounded.reports(&found));
        let names = unfounded.names();
        let fitted = self.refitted(&model, &names)?;
        let needed = needed.iter().filter(|judged| !names.contains(&judged.effect));
        let mut found: Vec<Found> = needed.filter_map(|judged| self.needed(judged, &fitted)).collect();
        let model = fitted.model;
        self.judge_signs(&model, &mut found);
        let unknown = dependences(ground.flights, &model, ground.searched, ground.block_s, self.options.seed)?;
        Ok(Heard { found, left, unknown, roads: Some(roads), at_once: true })
    }

    /// From what was found to the verdict: confirmation, suggestions tried, where the rest of the error lies, words.
    fn conclude(&self, ground: &Ground<'_>, heard: Heard, mut diagnosis: Diagnosis) -> Result<Outcome> {
        let begun = Stopwatch::start();
        let Heard { mut found, left, unknown, roads, at_once } = heard;
        let Ground { flights, locked, part, block_s, .. } = *ground;
        self.options.watch.at("what each effect does to flights that the search has not seen")?;
        let rungs = self.ladder(ground.before, &found, at_once)?;
        diagnosis.both_roads = at_once;
        diagnosis.notes.extend(roads);
        let after = rungs.last().map_or_else(|| ground.before.clone(), |rung| rung.1.clone());
        diagnosis.accepted = found.iter().map(|found| found.step.effect.clone()).collect();
        // Two that were accepted beside each other have been told apart.
        for found in &mut found {
            found.step.indistinguishable.retain(|other| !diagnosis.accepted.contains(other));
        }
        diagnosis.steps = found.into_iter().map(|found| found.step).collect();
        diagnosis.candidates = left;
        diagnosis.candidates.splice(0..0, diagnosis.steps.iter().map(accepted).collect::<Vec<_>>());
        self.options.watch.at("confirming on flights that the search has not seen")?;
        diagnosis.locked = confirm(flights, &rungs, locked, part, block_s, self.engine.correlation)?;
        diagnosis.confirmation = diagnosis.confirmed();
        diagnosis.verdict = match (diagnosis.accepted.is_empty(), unknown.is_empty()) {
            (false, _) => Verdict::EffectsMissing,
            (true, false) => Verdict::NotInCatalogue,
            (true, true) => Verdict::Explained,
        };
        let unseen = suggest::Unseen { spans: locked, part, block_s };
        let tried = |unknown: &Unknown| Ok(channel(unknown, suggest::tried(&self.engine, &after, unknown, &unseen)?));
        let channels = unknown.iter().map(tried).collect::<Result<Vec<_>>>()?;
        diagnosis.unknown = (!channels.is_empty()).then_some(channels);
        diagnosis.failure = match &diagnosis.locked {
            Some(confirmed) => failure(flights, &Measured::of_locked(confirmed, &confirmed.spans), &unknown),
            None => {
                let mse = self.engine.mse(&self.engine.pass(&after, &[])?.base);
                failure(flights, &Measured { on: "searched", spans: ground.searched, mse }, &unknown)
            }
        };
        let judged = diagnosis.both_roads || has_many(ground.before) && has_intervals(&after);
        diagnosis.notes.extend(if judged { wrong_signs(&after) } else { self.sign_notes(&after)? });
        diagnosis.notes.extend(after.assumptions());
        diagnosis.summary = summary(&diagnosis);
        diagnosis.seconds += begun.seconds();
        Ok(Outcome { diagnosis, model: after })
    }

    /// Effects that only stand in for a dependence outside the catalogue, or beside which too much stays unexplained, by what the models before and
    /// after predict.
    fn unfounded(&self, ground: &Ground<'_>, found: &[Found], unknown: &[Unknown]) -> Result<Unfounded> {
        let Some(last) = found.last() else { return Ok(Unfounded::default()) };
        let rows = self.engine.rows().max(1) as f64;
        let mse = |model| Ok::<_, Error>(prediction_errors(&self.engine, model)?.map(|errors| errors.iter().sum::<f64>() / rows));
        let left = mse(&last.model)?;
        let whole = if unknown.is_empty() { left } else { mse(&self.bare(ground.before, found)?)? };
        let variance =
            PerChannel::from_fn(|channel| variance(ground.flights, ground.searched, channel.column()).unwrap_or(f64::NAN));
        let why = |found: &Found| {
            let shares = PerChannel::from_fn(|channel| Share {
                by_all: whole[channel] - left[channel],
                by_itself: found.took(channel, left[channel]),
                left: left[channel],
            });
            let effect = found.model.effect(&found.step.effect)?;
            let stands = !unknown.is_empty() && stands_in(effect, &found.channels, &shares, unknown);
            let of_mends = || self.options.mends.doubt(effect, ground.flights.first()?.step_s);
            stands.then_some(STANDS_IN).or_else(of_mends).or_else(|| doubt(&effect.kind, &found.channels, &shares, &variance))
        };
        Ok(Unfounded(found.iter().filter_map(|found| Some((found.step.effect.clone(), why(found)?))).collect()))
    }

    /// The model that was given without what was found: what an earlier search had found is in it, and, too, is held against what is left without it.
    fn bare(&self, before: &Model, found: &[Found]) -> Result<Model> {
        let mut bare = before.clone();
        bare.effects.retain(|effect| !found.iter().any(|found| found.step.effect == effect.name));
        if bare.effects.len() < before.effects.len() {
            bare = self.engine.pass(&bare, &[])?.base.model;
        }
        Ok(bare)
    }
}

/// Effects that were found and are not named, and why.
#[derive(Default)]
struct Unfounded(Vec<(String, &'static str)>);

impl Unfounded {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn names(&self) -> Vec<String> {
        self.0.iter().map(|(name, _)| name.clone()).collect()
    }

    /// What is said of them.
    fn reports(&self, found: &[Found]) -> Vec<CandidateReport> {
        let of = |name: &str| found.iter().find(|found| found.step.effect == name);
        self.0.iter().filter_map(|(name, why)| Some(taken_back(of(name)?, why))).collect()
    }
}

/// Whether every number of a model that is not of each flight has its interval.
fn has_intervals(model: &Model) -> bool {
    let mut numbers = model.effects.iter().flat_map(|effect| &effect.coefficients);
    numbers.all(|number| number.by_flight.is_some() || number.ci95.is_some())
}

#[cfg(test)]
mod tests {
    use super::super::candidate::with;
    use super::super::gram::tests::{model, noise, whole};
    use super::super::report::{Status, Step};
    use super::*;
    use crate::critique::unknown::Dependence;
    use crate::flight::Channel;
    use crate::flight::Column;
    use crate::physics::{calibrate, catalogue};

    /// Flights in which a stick rests but for one stretch of the first flight.
    fn resting(stick: Column, moves: std::ops::Range<usize>) -> Result<Vec<Flight>> {
        let one = |(index, flight): (usize, Flight)| {
            let moved = |sample: usize| index == 0 && moves.contains(&sample);
            let still = |(sample, value): (usize, &f64)| if moved(sample) { *value } else { 0.0 };
            let column = |column: Column| match flight.column(column) {
                values if column == stick => values.iter().enumerate().map(still).collect(),
                values => values.to_vec(),
            };
            Flight::new(flight.name.clone(), "noise", 0.0, flight.step_s, Column::ALL.map(column), flight.targets)
        };
        noise(1, &[6000; 6]).into_iter().enumerate().map(one).collect()
    }

    /// An effect that an earlier search found is in the model that is given: what it removes is what is left without it.
    #[test]
    fn an_effect_of_an_earlier_search_is_no_stand_in_for_being_in_already() -> Result<()> {
        let mut flights = noise(5, &[6000; 6]);
        for flight in &mut flights {
            let mut accelerations = model().predict(flight)?;
            for (channel, values) in accelerations.pairs_mut() {
                let noise = flight.column(channel.column());
                let stick = flight.column(Column::U1).iter().map(|u1| if channel == Channel::VxDot { *u1 } else { 0.0 });
                values.iter_mut().zip(noise).zip(stick).for_each(|((value, noise), stick)| *value += 0.1 * noise + stick);
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        let spans = whole(&flights);
        let (before, _) = calibrate(&with(&model(), &Effect::formula("stick", Channel::VxDot, "u1", 0.0)?), &flights, &spans)?;
        let cut = blocks(&flights, &spans, 10.0);
        let fold = (0..cut.len()).map(|block| block % 10).collect();
        let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
        let options = Options::default();
        let search = Search { flips: Flips::new(engine.blocks.len(), 1), engine, largest_p: 0.05, options: &options };
        let found = [Found {
            step: Step { effect: "stick".into(), held_out_mse_fall: [("vx_dot".into(), 0.99)].into(), ..Step::default() },
            gain: 1.0,
            model: before.clone(),
            channels: vec![Channel::VxDot],
            confusable: &[],
            mse_before: PerChannel::splat(1.0),
            removed: PerChannel::splat(0.0),
        }];
        let unknown = Unknown {
            channel: "vx_dot",
            r2: 0.5,
            r2_with_feedback: 0.5,
            null_r2_95: 0.1,
            depends_on: vec![Dependence { variable: "u1".into(), share: 1.0 }],
            suggested_formula: None,
            skeleton: String::new(),
        };
        let bare = model();
        for (before, whose) in [(&before, "of an earlier search"), (&bare, "of this search")] {
            let ground = Ground { flights: &flights, searched: &spans, locked: &[], part: "test", block_s: 10.0, before };
            assert!(search.unfounded(&ground, &found, std::slice::from_ref(&unknown))?.is_empty(), "{whose}");
        }
        Ok(())
    }

    fn refusal(flights: &[Flight]) -> String {
        let found = diagnose(flights, &model(), &whole(flights), &[], "test", &Options::default());
        found.map_or_else(|error| error.to_string(), |outcome| outcome.diagnosis.to_string())
    }

    #[test]
    fn a_model_that_the_flights_do_not_determine_is_refused_as_calibration_does() -> Result<()> {
        let flights = resting(Column::U3, 0..0)?;
        let expected = calibrate(&model(), &flights, &whole(&flights)).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(expected.contains("`c_z` of effect `control_moment`"), "{expected}");
        assert_eq!(refusal(&flights), expected);
        Ok(())
    }

    /// A sum of three signals is the best single guess at two of them, and needless once both have names.
    #[test]
    fn an_effect_that_later_ones_make_needless_stays_among_the_candidates() -> Result<()> {
        let mut flights = noise(1, &[6000; 6]);
        for flight in &mut flights {
            let mut accelerations = model().predict(flight)?;
            for ((sample, value), (one, other)) in accelerations[Channel::VxDot]
                .iter_mut()
                .enumerate()
                .zip(flight.column(Column::U1).iter().zip(flight.column(Column::U2)))
            {
                *value += one + other + 0.1 * flight.column(Column::VyDot)[sample];
            }
            // What the model says of the others would leave no error at all.
            for (channel, values) in accelerations.pairs_mut().skip(1) {
                values.iter_mut().zip(flight.column(channel.column())).for_each(|(value, noise)| *value += noise);
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        let mut model = model();
        for (name, formula) in [("sum", "u1 + u2 + u3"), ("one", "u1"), ("other", "u2")] {
            model.effects.push(Effect { enabled: false, ..Effect::formula(name, Channel::VxDot, formula, 0.0)? });
        }
        let without: Vec<String> = catalogue::definitions().map(|definition| definition.kind.to_owned()).collect();
        let found = |max_effects: Option<usize>| {
            let options = Options { without: without.clone(), max_effects, ..Options::default() };
            Ok::<_, crate::Error>(diagnose(&flights, &model, &whole(&flights), &[], "test", &options)?.diagnosis)
        };
        // From the other end it is needless from the beginning.
        let both = found(None)?;
        assert!(both.both_roads && both.accepted.len() == 2 && !both.accepted.contains(&"sum".to_owned()), "{both}");
        assert!(
            both.candidates.iter().any(|candidate| candidate.effect == "sum" && candidate.status == Status::Negligible),
            "{both:#}"
        );
        let found = found(Some(6))?;
        let mut accepted = found.accepted.clone();
        accepted.sort();
        assert_eq!(accepted, ["one", "other"], "{found}");
        let sum: Vec<&CandidateReport> = found.candidates.iter().filter(|candidate| candidate.effect == "sum").collect();
        assert!(matches!(sum.as_slice(), [sum] if sum.status == Status::Negligible && sum.reason.contains("dropped")), "{found}");
        assert!(sum[0].held_out_mse_fall.values().all(|fall| fall.abs() < SMALLEST_FALL), "{found}");
        Ok(())
    }

    #[test]
    fn a_model_that_one_block_alone_determines_is_refused() -> Result<()> {
        let found = refusal(&resting(Column::U3, 1000..1200)?);
        assert!(found.contains("`c_z` of effect `control_moment`") && found.contains("one tenth of the blocks"), "{found}");
        Ok(())
    }
}
