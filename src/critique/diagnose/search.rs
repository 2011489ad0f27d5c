//! The search itself: forward steps, the gates each must pass, refinement, the backward check, the confirmation.

use super::candidate::{Candidate, candidates, with};
use super::engine::{Engine, FOLDS, Pass, Trial, priors};
use super::fit::{Reduced, components};
use super::gram::{blocks, grams};
use super::report::{CandidateReport, Diagnosis, Locked, Method, Number, ParameterValue, Status, Step, Verdict};
use super::resample::{RESAMPLES, draw, intervals, quantile};
use super::rest::{channel, dependences, stands_in};
use super::significance::{Flips, Raw, block_weights, raw_scores};
use crate::critique::compare::PerChannel;
use crate::error::Result;
use crate::flight::{Column, Flight, Span};
use crate::physics::Model;
use phyture_kernels::random::permutation;
use std::collections::BTreeMap;
use std::time::Instant;

/// Length of a block, s: ten times the time over which gusts and manoeuvres of a small helicopter keep a residual correlated.
const BLOCK_S: f64 = 10.0;
/// Where a data set is short, blocks may be as short as this, s.
const SHORTEST_BLOCK_S: f64 = 5.0;
/// Fewer blocks than this give no verdict.
const FEWEST_BLOCKS: usize = 30;
/// With fewer blocks than this they are made shorter.
const ENOUGH_BLOCKS: usize = 60;
/// Time over which a residual is taken to be correlated, s: only for weighing the prior of a property of each flight.
const CORRELATION_S: f64 = 0.5;
/// Probability of naming any effect at all where none is missing, before the worth gate.
const FAMILY_WISE: f64 = 0.05;
/// An effect has to remove this share of a channel's held-out mean squared error.
const SMALLEST_FALL: f64 = 0.01;
/// A block's gain is half the logarithm of its errors' ratio and at most this: heavy-tailed blocks must not decide.
const LARGEST_GAIN: f64 = 1.0;
/// An effect is excited if at its largest usual size it moves the residual by this share of its root mean square …
const SMALLEST_MOVEMENT: f64 = 0.1;
/// … and if so many blocks carry …
const FEWEST_CARRYING: usize = 5;
/// … this share of the movement.
const CARRIED_SHARE: f64 = 0.8;
/// Standard errors at which an effect is found in four of five data sets: 3.1 for the corrected p-value and 0.84 for the power.
const DETECTION: f64 = 4.0;
/// One effect shadows another if that one's gain beside it is less than this share of its gain alone.
const SHADOW: f64 = 0.2;
/// What an effect removes beside an accepted one has to be this share of what that one removed in the same channel: less may be a
/// flaw in the form of the first, in other words …
const SMALLEST_SHARE_OF_ACCEPTED: f64 = 0.05;
/// … and this share, if the two are known to be mistaken for each other.
const SMALLEST_SHARE_OF_RIVAL: f64 = 0.2;

/// How a search is done.
#[derive(Clone, Debug)]
pub struct Options {
    /// Most effects to accept.
    pub max_effects: usize,
    /// Seed of folds, flips and resampling.
    pub seed: u64,
    /// Candidates to leave out.
    pub without: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self { max_effects: 6, seed: 1, without: Vec::new() }
    }
}

/// A diagnosis and the model with what it found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The verdict and its figures.
    pub diagnosis: Diagnosis,
    /// The model with the accepted effects, fitted on the searched blocks.
    pub model: Model,
}

/// One candidate on one step.
struct Scored<'a> {
    candidate: &'a Candidate,
    /// The variant with the largest gain.
    best: Trial,
    gains: Vec<f64>,
    gain: f64,
    falls: BTreeMap<usize, f64>,
    p_value: f64,
    detection: Option<f64>,
    excited: bool,
    plausible: bool,
    carrying: usize,
    /// An accepted effect whose flaw it describes.
    rival: Option<String>,
}

impl Scored<'_> {
    fn largest_fall(&self) -> f64 {
        self.falls.values().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    fn passes(&self, largest_p: f64) -> bool {
        self.rival.is_none()
            && self.excited
            && self.plausible
            && self.gain > 0.0
            && self.p_value <= largest_p
            && self.largest_fall() >= SMALLEST_FALL
    }

    fn status(&self, largest_p: f64) -> Status {
        match () {
            () if !self.excited => Status::NotExcited,
            () if self.p_value > largest_p || self.gain <= 0.0 => Status::NotSignificant,
            () if !self.plausible => Status::Implausible,
            () if self.rival.is_some() && self.largest_fall() >= SMALLEST_FALL => Status::SamePhysics,
            () => Status::Negligible,
        }
    }
}

/// Searches the catalogue for effects that `model` lacks on `searched` spans, and confirms them on `locked` ones (named `part`).
///
/// Coefficients of `model` are fitted anew; effects that are switched off in it are candidates. Verdict `convention_fault` is the
/// caller's to give, before.
///
/// # Errors
/// As [`Model::predict`].
pub fn diagnose(
    flights: &[Flight],
    model: &Model,
    searched: &[Span],
    locked: &[Span],
    part: &str,
    options: &Options,
) -> Result<Outcome> {
    let begun = Instant::now();
    let mut base = model.clone();
    base.effects.retain(|effect| effect.enabled);
    let mut block_s = BLOCK_S;
    let mut cut = blocks(flights, searched, block_s);
    if cut.len() < ENOUGH_BLOCKS {
        block_s = SHORTEST_BLOCK_S;
        cut = blocks(flights, searched, block_s);
    }
    let order = permutation(cut.len(), options.seed, 0);
    let mut fold = vec![0; cut.len()];
    order.iter().enumerate().for_each(|(position, &block)| fold[block as usize] = position % FOLDS);
    let step_s = flights.first().map_or(0.01, |flight| flight.step_s);
    let engine = Engine { flights, blocks: cut, fold, correlation: 2.0 * CORRELATION_S / step_s };
    let mut candidates = candidates(model, flights);
    candidates.retain(|candidate| !options.without.contains(&candidate.id));
    let in_play = candidates.iter().filter(|candidate| candidate.inapplicable.is_none()).count().max(1);
    let search = Search { engine, flips: None, largest_p: FAMILY_WISE / in_play as f64, options };
    let method = Method {
        blocks: search.engine.blocks.len(),
        block_s,
        correlation_s: CORRELATION_S,
        searched_s: search.engine.rows() as f64 * step_s,
        seed: options.seed,
        effects_in_play: in_play,
        largest_p_value: search.largest_p,
        smallest_fall: SMALLEST_FALL,
    };
    let mut diagnosis = Diagnosis {
        verdict: Verdict::TooLittleData,
        summary: String::new(),
        accepted: Vec::new(),
        steps: Vec::new(),
        candidates: Vec::new(),
        unknown: None,
        locked: None,
        method: Some(method),
        notes: Vec::new(),
        seconds: 0.0,
        version: env!("CARGO_PKG_VERSION").into(),
        data_sha256: String::new(),
    };
    let count = search.engine.blocks.len();
    if count < FEWEST_BLOCKS {
        diagnosis.summary = format!(
            "{count} blocks of {block_s:.0} s are too few to tell a missing effect from chance; {FEWEST_BLOCKS} are needed, that is {:.0} s of flight.",
            FEWEST_BLOCKS as f64 * SHORTEST_BLOCK_S
        );
        diagnosis.seconds = begun.elapsed().as_secs_f64();
        return Ok(Outcome { diagnosis, model: base });
    }
    let search = Search { flips: Some(Flips::new(count, options.seed)), ..search };
    let (before, held) = search.timing(&base)?;
    if let Some(delay_s) = held {
        diagnosis.notes.push(format!(
            "the controls act {:.1} ms after their sample, half a step: they are held from one sample to the next. Taken as a property of \
             the log (`control_delay_s = {delay_s}` under [data]), not as a missing effect",
            1e3 * delay_s
        ));
    }
    let (mut found, mut left) = search.forward(&before, &candidates)?;
    let fitted = |found: &[Found]| found.last().map_or(&before, |last| &last.model).clone();
    let mut unknown = dependences(flights, &fitted(&found), searched, block_s, options.seed)?;
    // Effects that only stand in for a dependence outside the catalogue are taken back, all at once.
    let pass = search.engine.pass(&before, &[fitted(&found)])?;
    let remaining = pass.trials.first().and_then(Option::as_ref).map_or([0.0; 6], |trial| search.engine.mse(trial));
    let whole = search.engine.mse(&pass.base);
    let removed: [f64; 6] = std::array::from_fn(|channel| whole[channel] - remaining[channel]);
    let stand_ins: Vec<String> = found
        .iter()
        .filter(|found| {
            let effect = found.model.effect(&found.step.effect);
            effect.is_some_and(|effect| stands_in(effect, &found.channels, &removed, &remaining, &unknown))
        })
        .map(|found| found.step.effect.clone())
        .collect();
    if !stand_ins.is_empty() {
        for found in found.iter().filter(|found| stand_ins.contains(&found.step.effect)) {
            left.insert(
                0,
                CandidateReport {
                    effect: found.step.effect.clone(),
                    status: Status::SamePhysics,
                    held_out_mse_fall: found.step.held_out_mse_fall.clone(),
                    p_value: Some(found.step.p_value),
                    detection_limit_mse_fall: None,
                    note: Some("stands in for a stronger dependence that is in no effect of the catalogue".into()),
                },
            );
        }
        search.without(&mut found, &stand_ins, &before)?;
        unknown = dependences(flights, &fitted(&found), searched, block_s, options.seed)?;
    }
    search.intervals(&mut found)?;
    let mut models = vec![before.clone()];
    models.extend(found.iter().map(|found| found.model.clone()));
    let after = models.last().cloned().unwrap_or(before);

    diagnosis.accepted = found.iter().map(|found| found.step.effect.clone()).collect();
    diagnosis.steps = found.into_iter().map(|found| found.step).collect();
    diagnosis.candidates = left;
    for step in &diagnosis.steps {
        diagnosis.candidates.insert(
            0,
            CandidateReport {
                effect: step.effect.clone(),
                status: Status::Accepted,
                held_out_mse_fall: step.held_out_mse_fall.clone(),
                p_value: Some(step.p_value),
                detection_limit_mse_fall: None,
                note: None,
            },
        );
    }
    diagnosis.locked = confirm(flights, &models, locked, part, block_s, search.engine.correlation)?;
    diagnosis.verdict = match (diagnosis.accepted.is_empty(), unknown.is_empty()) {
        (false, _) => Verdict::EffectsMissing,
        (true, false) => Verdict::NotInCatalogue,
        (true, true) => Verdict::Explained,
    };
    diagnosis.unknown = (!unknown.is_empty()).then(|| unknown.iter().map(channel).collect());
    diagnosis.summary = summary(&diagnosis);
    diagnosis.seconds = begun.elapsed().as_secs_f64();
    Ok(Outcome { diagnosis, model: after })
}

/// One accepted effect and the model that has it.
struct Found {
    step: Step,
    gain: f64,
    model: Model,
    /// Channels in which it is worth while.
    channels: Vec<usize>,
    /// Effects that it is mistaken for.
    confusable: &'static [&'static str],
    /// Mean squared errors before it was accepted, and what it took from them.
    mse_before: [f64; 6],
    removed: [f64; 6],
}

impl Found {
    /// Effects that lose nearly all of their gain beside this one, while this one would lose nearly all of its beside them, cannot be
    /// told from it. `scored` are gains beside it, `earlier` those of the effects that passed when it was chosen.
    fn shadows(&mut self, scored: &[Scored<'_>], earlier: &BTreeMap<String, f64>) {
        for other in scored {
            let Some(&alone) = earlier.get(&other.candidate.id) else { continue };
            let beside = self.gain + other.gain - alone;
            let mutual = other.gain < SHADOW * alone && beside < SHADOW * self.gain;
            if mutual && !self.step.indistinguishable.contains(&other.candidate.id) {
                self.step.indistinguishable.push(other.candidate.id.clone());
            }
        }
    }

    /// Whether a candidate removes so little beside what this effect did, in every channel in which it is worth while, that it may
    /// only mend the form of this one.
    fn is_flawed_by(&self, other: &Scored<'_>, mse: &[f64; 6]) -> bool {
        let notes = other.candidate.definition.and_then(|definition| definition.notes);
        let related = self.confusable.contains(&other.candidate.id.as_str())
            || notes.is_some_and(|notes| notes.confusable_with.contains(&self.step.effect.as_str()));
        let share = if related { SMALLEST_SHARE_OF_RIVAL } else { SMALLEST_SHARE_OF_ACCEPTED };
        let mut worthy = other.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL).peekable();
        worthy.peek().is_some() && worthy.all(|(&channel, fall)| fall * mse[channel] < share * self.removed[channel])
    }
}

/// A selection frequency in a word.
fn stability(frequency: f64) -> &'static str {
    match frequency {
        frequency if frequency >= 0.9 => "stable",
        frequency if frequency >= 0.6 => "likely",
        _ => "tentative",
    }
}

struct Search<'a> {
    engine: Engine<'a>,
    flips: Option<Flips>,
    largest_p: f64,
    options: &'a Options,
}

impl Search<'_> {
    /// The fitted model; with half a step of control delay, if it states none and half a step is better than none and than a whole
    /// one and more: then the controls are held between samples, which is how the log was made and no effect. A longer delay is one.
    fn timing(&self, base: &Model) -> Result<(Model, Option<f64>)> {
        let step_s = self.engine.flights.first().map_or(0.01, |flight| flight.step_s);
        let delays: Vec<f64> = [0.5, 1.0, 1.5, 2.0].iter().map(|steps| steps * step_s).collect();
        let delayed = |delay_s: &f64| {
            let mut model = base.clone();
            model.data.control_delay_s = *delay_s;
            model
        };
        let stated = base.data.control_delay_s > 0.0;
        let models: Vec<Model> = if stated { Vec::new() } else { delays.iter().map(delayed).collect() };
        let pass = self.engine.pass(base, &models)?;
        let gains: Vec<Vec<f64>> =
            pass.trials.iter().map(|trial| trial.as_ref().map_or_else(Vec::new, |trial| gains(&pass.base, trial))).collect();
        let total = |gains: &Vec<f64>| gains.iter().sum::<f64>();
        if let (Some(half), Some(Some(trial))) = (gains.first(), pass.trials.first()) {
            let (difference, error) = paired(half, &vec![0.0; half.len()]);
            if difference > 2.0 * error && gains.iter().skip(1).all(|longer| total(longer) < total(half)) {
                return Ok((trial.model.clone(), delays.first().copied()));
            }
        }
        Ok((pass.base.model, None))
    }

    fn forward(&self, before: &Model, candidates: &[Candidate]) -> Result<(Vec<Found>, Vec<CandidateReport>)> {
        let mut model = before.clone();
        let mut found: Vec<Found> = Vec::new();
        // Gains of all that passed at the last step.
        let mut earlier: BTreeMap<String, f64> = BTreeMap::new();
        loop {
            let open: Vec<&Candidate> = candidates.iter().filter(|candidate| model.effect(&candidate.id).is_none()).collect();
            let (base, mut scored) = self.score(&model, &open)?;
            let mse = self.engine.mse(&base);
            if let Some(last) = found.last_mut() {
                last.shadows(&scored, &earlier);
                last.removed = std::array::from_fn(|channel| last.mse_before[channel] - mse[channel]);
            }
            for scored in &mut scored {
                scored.rival = found.iter().find(|found| found.is_flawed_by(scored, &mse)).map(|found| found.step.effect.clone());
            }
            let passing: Vec<&Scored<'_>> = scored.iter().filter(|scored| scored.passes(self.largest_p)).collect();
            let best = passing.iter().max_by(|left, right| left.gain.total_cmp(&right.gain));
            let Some(best) = best.filter(|_| found.len() < self.options.max_effects) else {
                let reports = self.reports(&open, &scored);
                self.backward(&mut found, before)?;
                return Ok((found, reports));
            };
            // The simplest of those that are as good to within one standard error.
            let as_good = |other: &&&Scored<'_>| {
                let (difference, error) = paired(&best.gains, &other.gains);
                difference <= error
            };
            let simpler = |left: &&&Scored<'_>, right: &&&Scored<'_>| {
                let freedom = left.candidate.freedom().cmp(&right.candidate.freedom());
                freedom.then(right.gain.total_cmp(&left.gain))
            };
            let chosen = passing.iter().filter(as_good).min_by(simpler).unwrap_or(best);
            let mut tied: Vec<(&str, f64)> = passing
                .iter()
                .filter(|other| other.candidate.id != chosen.candidate.id)
                .filter(|other| {
                    let (difference, error) = paired(&chosen.gains, &other.gains);
                    difference < 2.0 * error
                })
                .map(|other| (other.candidate.id.as_str(), other.gain))
                .collect();
            tied.sort_by(|left, right| right.1.total_cmp(&left.1));
            let (refined, profiles) = self.refine(&base, chosen)?;
            let mut step = self.step(chosen, &refined, tied.iter().map(|entry| entry.0.to_owned()).collect());
            step.selection_frequency = self.selection_frequency(chosen, &passing);
            step.stability = stability(step.selection_frequency).into();
            for parameter in &mut step.parameters {
                parameter.profile = profiles.get(&parameter.name).copied();
            }
            earlier = passing.iter().map(|scored| (scored.candidate.id.clone(), scored.gain)).collect();
            let confusable =
                chosen.candidate.definition.and_then(|definition| definition.notes).map_or(&[][..], |notes| notes.confusable_with);
            found.push(Found {
                step,
                gain: chosen.gain,
                model: refined.model.clone(),
                channels: chosen.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL).map(|(&channel, _)| channel).collect(),
                confusable,
                mse_before: mse,
                removed: [0.0; 6],
            });
            model = refined.model;
        }
    }

    /// Drops accepted effects that the later ones have made needless, and refits.
    fn backward(&self, found: &mut Vec<Found>, before: &Model) -> Result<()> {
        while found.len() > 1 {
            let Some(last) = found.last() else { return Ok(()) };
            let without: Vec<Model> = found
                .iter()
                .map(|found| {
                    let mut model = last.model.clone();
                    model.effects.retain(|effect| effect.name != found.step.effect);
                    model
                })
                .collect();
            let pass = self.engine.pass(&last.model, &without)?;
            let whole = self.engine.mse(&pass.base);
            let cost = |trial: &Option<Trial>| {
                let Some(trial) = trial else { return f64::INFINITY };
                let mse = self.engine.mse(trial);
                (0..6).map(|channel| 1.0 - whole[channel] / mse[channel]).fold(f64::NEG_INFINITY, f64::max)
            };
            let costs: Vec<f64> = pass.trials.iter().map(cost).collect();
            let Some(needless) = (0..costs.len()).min_by(|&left, &right| costs[left].total_cmp(&costs[right])) else {
                return Ok(());
            };
            if costs[needless] >= SMALLEST_FALL {
                return Ok(());
            }
            let needless = found[needless].step.effect.clone();
            self.without(found, &[needless], before)?;
        }
        Ok(())
    }

    /// Takes effects back and fits the models of all steps again.
    fn without(&self, found: &mut Vec<Found>, names: &[String], before: &Model) -> Result<()> {
        found.retain(|found| !names.contains(&found.step.effect));
        let mut model = before.clone();
        for found in found {
            let Some(effect) = found.model.effect(&found.step.effect).cloned() else { continue };
            model = self.engine.pass(&with(&model, &effect), &[])?.base.model;
            found.model = model.clone();
        }
        Ok(())
    }

    /// Intervals of the accepted effects' coefficients, all of them in the model.
    fn intervals(&self, found: &mut [Found]) -> Result<()> {
        let Some(model) = found.last().map(|last| last.model.clone()) else { return Ok(()) };
        let intervals = intervals(&self.engine, &model, self.options.seed)?;
        for found in found.iter_mut() {
            let Some(index) = model.effects.iter().position(|effect| effect.name == found.step.effect) else { continue };
            for (position, number) in found.step.coefficients.iter_mut().enumerate() {
                number.value =
                    model.effects[index].coefficients.get(position).map_or(number.value, |coefficient| coefficient.value);
                number.ci95 = intervals.get(&(index, position)).copied();
            }
        }
        if let Some(last) = found.last_mut() {
            for (&(effect, coefficient), interval) in &intervals {
                if let Some(coefficient) =
                    last.model.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(coefficient))
                {
                    coefficient.ci95 = Some(*interval);
                }
            }
        }
        Ok(())
    }

    /// Tries every candidate beside a model.
    fn score<'c>(&self, model: &Model, open: &[&'c Candidate]) -> Result<(Trial, Vec<Scored<'c>>)> {
        let mut models = Vec::new();
        let mut owner = Vec::new();
        for (index, candidate) in open.iter().enumerate().filter(|(_, candidate)| candidate.inapplicable.is_none()) {
            for variant in &candidate.variants {
                models.push(with(model, variant));
                owner.push(index);
            }
        }
        let pass = self.engine.pass(model, &models)?;
        let rows: Vec<usize> = pass.grams.iter().map(|gram| gram.rows).collect();
        let weights = block_weights(&pass.base, &rows);
        let even: [Vec<f64>; 6] = {
            let channel = self.engine.weights(&pass.base);
            std::array::from_fn(|index| vec![channel[index]; rows.len()])
        };
        let one = |(index, candidate): (usize, &&'c Candidate)| {
            let trials: Vec<&Trial> = owner
                .iter()
                .zip(&pass.trials)
                .filter(|(owner, _)| **owner == index)
                .filter_map(|(_, trial)| trial.as_ref())
                .collect();
            self.scored(candidate, &trials, &pass, &weights, &even)
        };
        #[cfg(feature = "rayon")]
        let scored: Vec<Option<Scored<'c>>> = {
            use rayon::prelude::*;
            open.par_iter().enumerate().map(one).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let scored: Vec<Option<Scored<'c>>> = open.iter().enumerate().map(one).collect();
        Ok((pass.base, scored.into_iter().flatten().collect()))
    }

    fn scored<'c>(
        &self,
        candidate: &'c Candidate,
        trials: &[&Trial],
        pass: &Pass,
        weights: &[Vec<f64>; 6],
        even: &[Vec<f64>; 6],
    ) -> Option<Scored<'c>> {
        let gains: Vec<Vec<f64>> = trials.iter().map(|trial| gains(&pass.base, trial)).collect();
        let total = |gains: &Vec<f64>| gains.iter().sum::<f64>();
        let best = (0..trials.len()).max_by(|&left, &right| total(&gains[left]).total_cmp(&total(&gains[right])))?;
        let flips = self.flips.as_ref()?;
        let raw: Vec<Option<Raw>> = trials.iter().map(|trial| raw_scores(&pass.base, trial, &pass.grams, weights)).collect();
        let p_value = if candidate.is_by_flight() {
            // The blocks of a flight share its numbers: a flight is flipped as a whole.
            let by_flight: Vec<Vec<f64>> = gains.iter().map(|gains| self.by_flight(gains)).collect();
            flips.p_value_of_sums(&by_flight)
        } else {
            let whitened: Vec<_> = raw.iter().flatten().filter_map(Raw::whitened).collect();
            if whitened.is_empty() { 1.0 } else { flips.p_value(&whitened) }
        };
        let movement = trials.iter().filter_map(|trial| {
            let raw = raw_scores(&pass.base, trial, &pass.grams, even)?;
            Some(self.movement(candidate, trial, &raw))
        });
        let movement = movement.max_by(|left, right| left.share.total_cmp(&right.share));
        let trial = trials[best];
        let (before, after) = (self.engine.mse(&pass.base), self.engine.mse(trial));
        let falls = (0..6).filter(|&channel| trial.changed[channel] && self.touches(trial, &pass.base, channel));
        let falls = falls.map(|channel| (channel, 1.0 - after[channel] / before[channel])).collect();
        Some(Scored {
            candidate,
            best: trial.clone(),
            gain: total(&gains[best]),
            gains: gains[best].clone(),
            falls,
            p_value,
            detection: movement.as_ref().map(|movement| movement.detection.max(SMALLEST_FALL)),
            excited: movement.as_ref().is_some_and(|movement| movement.excited),
            plausible: plausible(&pass.base.model, trial),
            carrying: movement.map_or(0, |movement| movement.carrying),
            rival: None,
        })
    }

    /// Whether a trial has other columns than the base in a channel, or only shares coefficients with one that has.
    fn touches(&self, trial: &Trial, base: &Trial, channel: usize) -> bool {
        trial.layout.channels[channel] != base.layout.channels[channel]
    }

    fn by_flight(&self, gains: &[f64]) -> Vec<f64> {
        let mut sums: Vec<f64> = Vec::new();
        let mut last = None;
        for (block, gain) in self.engine.blocks.iter().zip(gains) {
            match sums.last_mut() {
                Some(sum) if last == Some(block.flight) => *sum += gain,
                _ => sums.push(*gain),
            }
            last = Some(block.flight);
        }
        sums
    }

    fn movement(&self, candidate: &Candidate, trial: &Trial, raw: &Raw) -> Movement {
        let rows = self.engine.rows() as f64;
        let effect = trial.model.effects.last();
        let mut largest = Movement { share: 0.0, detection: 1.0, carrying: 0, excited: false };
        let mut detection = 0.0_f64;
        for column in 0..raw.scores.ncols() {
            let energy: f64 = raw.energy.column(column).sum();
            let variance = raw.scores.column(column).norm_squared();
            detection = detection.max(DETECTION * DETECTION * variance / (energy * rows));
            let name = effect.and_then(|effect| effect.coefficients.get(column)).map(|coefficient| coefficient.name.as_str());
            let known = candidate.definition.zip(name).and_then(|(definition, name)| definition.coefficient(name));
            let size = match known.map(|known| known.by_flight.or(known.expected.map(|[low, high]| low.abs().max(high.abs())))) {
                Some(Some(size)) => Some(size),
                // A swap has the size it has; of a user's formula none is known.
                Some(None) | None => raw.one_sided.then_some(1.0),
            };
            let share = size.map_or(f64::INFINITY, |size| size * (energy / rows).sqrt());
            let mut parts: Vec<f64> = raw.energy.column(column).iter().copied().collect();
            parts.sort_by(|left, right| right.total_cmp(left));
            let mut sum = 0.0;
            let carrying = 1 + parts
                .iter()
                .take_while(|part| {
                    sum += **part;
                    sum < CARRIED_SHARE * energy
                })
                .count();
            let excited = share >= SMALLEST_MOVEMENT && carrying >= FEWEST_CARRYING;
            if (excited, share) >= (largest.excited, largest.share) {
                largest = Movement { share, detection: 1.0, carrying, excited };
            }
        }
        Movement { detection: detection.min(1.0), ..largest }
    }

    /// Open parameters between the points of the grid: each in turn, three times on an ever finer grid around its best value.
    /// Also the values of each parameter whose gain is within two standard errors of the best.
    fn refine(&self, base: &Trial, chosen: &Scored<'_>) -> Result<(Trial, BTreeMap<String, [f64; 2]>)> {
        let Some(definition) = chosen.candidate.definition else { return Ok((chosen.best.clone(), BTreeMap::new())) };
        let mut tried: Vec<(usize, f64, Vec<f64>)> = Vec::new();
        let open: Vec<usize> =
            (0..definition.parameters.len()).filter(|&index| !definition.parameters[index].grid.is_empty()).collect();
        let mut best = chosen.best.clone();
        let mut gain = chosen.gain;
        let spacing = |index: usize, value: f64| {
            let grid = definition.parameters[index].grid;
            let near = grid.windows(2).filter(|pair| pair[0] <= value && value <= pair[1]).map(|pair| pair[1] - pair[0]);
            near.fold(f64::NAN, f64::max).max(if grid.len() < 2 {
                0.1
            } else {
                (grid[grid.len() - 1] - grid[0]) / grid.len() as f64 * 0.25
            })
        };
        let number = |trial: &Trial, index: usize| {
            trial.model.effects.last().and_then(|effect| effect.parameters.get(index)).map_or(0.0, |parameter| parameter.value)
        };
        let mut steps: Vec<f64> = open.iter().map(|&index| spacing(index, number(&best, index))).collect();
        for _ in 0..3 {
            for (&index, step) in open.iter().zip(&mut steps) {
                let centre = number(&best, index);
                let [low, high] = definition.parameters[index].bounds;
                let values =
                    [-0.8, -0.55, -0.3, -0.12, 0.12, 0.3, 0.55, 0.8].map(|share| (centre + share * *step).clamp(low, high));
                let effect = best.model.effects.last().cloned();
                let Some(effect) = effect else { continue };
                let models: Vec<Model> = values
                    .iter()
                    .map(|&value| {
                        let mut variant = effect.clone();
                        if let Some(parameter) = variant.parameters.get_mut(index) {
                            parameter.value = value;
                        }
                        with(&base.model, &variant)
                    })
                    .collect();
                let pass = self.engine.pass(&base.model, &models)?;
                for trial in pass.trials.into_iter().flatten() {
                    let gains = gains(base, &trial);
                    let found: f64 = gains.iter().sum();
                    tried.push((index, number(&trial, index), gains));
                    if found > gain {
                        (best, gain) = (trial, found);
                    }
                }
                *step *= 0.35;
            }
        }
        let at_best = gains(base, &best);
        let mut profiles = BTreeMap::new();
        for &index in &open {
            let centre = number(&best, index);
            let near = tried.iter().filter(|tried| {
                let (difference, error) = paired(&at_best, &tried.2);
                tried.0 == index && difference <= 2.0 * error
            });
            let profile = near.fold([centre, centre], |[low, high], tried| [low.min(tried.1), high.max(tried.1)]);
            profiles.insert(definition.parameters[index].name.to_owned(), profile);
        }
        Ok((best, profiles))
    }

    /// Share of resampled block sets in which a candidate has the largest gain of those that pass.
    fn selection_frequency(&self, chosen: &Scored<'_>, passing: &[&Scored<'_>]) -> f64 {
        let count = self.engine.blocks.len();
        let wins = (0..RESAMPLES)
            .filter(|&world| {
                let drawn = draw(count, self.options.seed, world);
                let total = |gains: &[f64]| drawn.iter().map(|&block| gains[block]).sum::<f64>();
                let own = total(&chosen.gains);
                own > 0.0 && passing.iter().all(|other| total(&other.gains) <= own + tolerance(chosen, other))
            })
            .count();
        wins as f64 / RESAMPLES as f64
    }

    fn step(&self, chosen: &Scored<'_>, refined: &Trial, indistinguishable: Vec<String>) -> Step {
        let definition = chosen.candidate.definition;
        let empty = Vec::new();
        let effect = refined.model.effects.last();
        let name = |channel: usize| Column::TARGETS.get(channel).map_or("?", |column| column.name()).to_owned();
        let worthy = chosen.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL);
        let number = |coefficient: &crate::physics::Coefficient| {
            let known = definition.and_then(|definition| definition.coefficient(&coefficient.name));
            let rms = coefficient
                .by_flight
                .as_ref()
                .map(|values| (values.values().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt());
            Number {
                name: coefficient.name.clone(),
                value: coefficient.value,
                ci95: None,
                unit: coefficient.unit.clone(),
                expected: known.and_then(|known| known.expected),
                rms_over_flights: rms,
            }
        };
        Step {
            effect: chosen.candidate.id.clone(),
            meaning: chosen.candidate.effect.meaning.clone(),
            channels: worthy.map(|(&channel, _)| name(channel)).collect(),
            held_out_mse_fall: chosen.falls.iter().map(|(&channel, &fall)| (name(channel), fall)).collect(),
            p_value: chosen.p_value,
            selection_frequency: 0.0,
            stability: String::new(),
            indistinguishable,
            coefficients: effect.map_or(&empty, |effect| &effect.coefficients).iter().map(number).collect(),
            parameters: effect.map_or_else(Vec::new, |effect| {
                let value = |parameter: &crate::physics::Parameter| ParameterValue {
                    name: parameter.name.clone(),
                    value: parameter.value,
                    fixed: parameter.fixed,
                    unit: parameter.unit.clone(),
                    profile: None,
                };
                effect.parameters.iter().map(value).collect()
            }),
            would_tell_apart: definition
                .and_then(|definition| definition.notes)
                .map_or_else(String::new, |notes| notes.would_tell_apart.into()),
            formula: effect.map_or_else(String::new, ToString::to_string),
            rests_on_flight: self.decisive_flight(&chosen.gains),
        }
    }

    /// A flight without which the gain would be gone.
    fn decisive_flight(&self, gains: &[f64]) -> Option<String> {
        let total: f64 = gains.iter().sum();
        let mut flights: Vec<usize> = self.engine.blocks.iter().map(|block| block.flight).collect();
        flights.dedup();
        let flight = flights.iter().zip(self.by_flight(gains)).find(|(_, gain)| total - gain <= 0.0)?.0;
        self.engine.flights.get(*flight).map(|flight| flight.name.clone()).filter(|_| flights.len() > 1)
    }

    fn reports(&self, open: &[&Candidate], scored: &[Scored<'_>]) -> Vec<CandidateReport> {
        let name = |channel: usize| Column::TARGETS.get(channel).map_or("?", |column| column.name()).to_owned();
        let mut reports: Vec<CandidateReport> = open
            .iter()
            .map(|candidate| match scored.iter().find(|scored| scored.candidate.id == candidate.id) {
                Some(scored) => {
                    let status = scored.status(self.largest_p);
                    let notes = candidate.definition.and_then(|definition| definition.notes);
                    CandidateReport {
                        effect: candidate.id.clone(),
                        status,
                        held_out_mse_fall: scored.falls.iter().map(|(&channel, &fall)| (name(channel), fall)).collect(),
                        p_value: Some(scored.p_value),
                        detection_limit_mse_fall: scored.detection.filter(|_| scored.excited),
                        note: (status == Status::NotExcited)
                            .then(|| {
                                let wanted = notes.map(|notes| format!("; wanted: {}", notes.excitation)).unwrap_or_default();
                                format!("{} blocks carry it{wanted}", scored.carrying)
                            })
                            .or_else(|| {
                                let rival = scored.rival.as_ref().filter(|_| status == Status::SamePhysics)?;
                                Some(format!("little beside what `{rival}` removed: it may only mend its form"))
                            }),
                    }
                }
                None => CandidateReport {
                    effect: candidate.id.clone(),
                    status: Status::NotExcited,
                    held_out_mse_fall: BTreeMap::new(),
                    p_value: None,
                    detection_limit_mse_fall: None,
                    note: candidate.inapplicable.clone().or_else(|| Some("its regressors are those of the model".into())),
                },
            })
            .collect();
        let largest = |report: &CandidateReport| report.held_out_mse_fall.values().copied().fold(f64::NEG_INFINITY, f64::max);
        reports.sort_by(|left, right| largest(right).total_cmp(&largest(left)));
        reports
    }
}

struct Movement {
    share: f64,
    detection: f64,
    carrying: usize,
    excited: bool,
}

/// A block's gain: half the logarithm of the ratio of its held-out errors, over the channels, within bounds.
fn gains(base: &Trial, trial: &Trial) -> Vec<f64> {
    (0..base.errors[0].len())
        .map(|block| {
            (0..6)
                .filter(|&channel| trial.changed[channel])
                .map(|channel| {
                    let (before, after) = (base.errors[channel][block], trial.errors[channel][block]);
                    let gain = 0.5 * (before / after).ln();
                    if gain.is_finite() { gain.clamp(-LARGEST_GAIN, LARGEST_GAIN) } else { 0.0 }
                })
                .sum()
        })
        .collect()
}

/// Mean difference of paired gains times their number, and its standard error.
fn paired(left: &[f64], right: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> = left.iter().zip(right).map(|(left, right)| left - right).collect();
    let count = differences.len().max(1) as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let variance = differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean * count, (variance * count).sqrt())
}

/// How much better a less simple rival may be without counting as a win: it was passed over for its complexity.
fn tolerance(chosen: &Scored<'_>, other: &Scored<'_>) -> f64 {
    if other.candidate.freedom() > chosen.candidate.freedom() { paired(&other.gains, &chosen.gains).1 } else { 0.0 }
}

/// The controls must keep acting the way they act without the effect; an effect whose every coefficient had to be put on a bound of
/// zero does nothing.
fn plausible(base: &Model, trial: &Trial) -> bool {
    let powers = ["collective_thrust", "control_moment"];
    let keeps = base.effects.iter().filter(|effect| powers.contains(&effect.kind.as_str())).all(|effect| {
        let now = trial.model.effect(&effect.name);
        effect.coefficients.iter().all(|coefficient| {
            let value = now.and_then(|now| now.coefficient(&coefficient.name)).map_or(0.0, |now| now.value);
            value * coefficient.value > 0.0 || coefficient.value == 0.0
        })
    });
    let acts = trial.model.effects.last().is_none_or(|effect| {
        effect.coefficients.is_empty()
            || effect.coefficients.iter().any(|coefficient| coefficient.value != 0.0 || coefficient.by_flight.is_some())
    });
    keeps && acts
}

/// Errors on flights that no search has seen, of each of the models.
fn confirm(
    flights: &[Flight],
    models: &[Model],
    locked: &[Span],
    part: &str,
    block_s: f64,
    correlation: f64,
) -> Result<Option<Locked>> {
    let cut = blocks(flights, locked, block_s);
    if cut.is_empty() {
        return Ok(None);
    }
    let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
    let engine = Engine { flights, blocks: cut, fold, correlation };
    let mut errors = Vec::new();
    for model in models {
        errors.push(errors_under(&engine, model)?);
    }
    let rows = engine.rows() as f64;
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
        duration_s: rows * step_s,
        rmse_before: rmse(first),
        rmse_after: rmse(last),
        mse_fall,
        waterfall: errors.iter().map(rmse).collect(),
    }))
}

/// Squared error of each block of each channel under a model's own numbers; properties of a flight are found from its other blocks.
fn errors_under(engine: &Engine<'_>, model: &Model) -> Result<[Vec<f64>; 6]> {
    let mut design = super::design::Design::default();
    let layout = design.add(&model.regressors(|_| true)?);
    let grams = grams(engine.flights, &engine.blocks, &design)?;
    let priors = priors(model, &layout);
    let mut errors: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::new());
    for (channels, members) in components(&layout) {
        let reduced: Vec<Reduced> = channels.iter().map(|&channel| Reduced::new(&layout, channel, &grams)).collect();
        let value = |free: usize| {
            let free = layout.free[free];
            let local = priors.get(free.coefficient);
            let _ = local;
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
        let solution = super::fit::Solution {
            values: members.iter().map(|&member| if priors[member].by_flight.is_some() { 0.0 } else { value(member) }).collect(),
            bound: vec![false; members.len()],
            by_flight: Vec::new(),
        };
        for (channel, found) in component.errors_under(&solution, FOLDS, &|block| engine.fold[block]).unwrap_or_default() {
            errors[channel] = found;
        }
    }
    Ok(errors)
}

fn summary(diagnosis: &Diagnosis) -> String {
    let falls = |effect: &Step| {
        let best = effect.held_out_mse_fall.iter().max_by(|left, right| left.1.total_cmp(right.1));
        best.map(|(channel, fall)| format!("`{}` ({:.0} % of the error of {channel})", effect.effect, 100.0 * fall))
            .unwrap_or_default()
    };
    match diagnosis.verdict {
        Verdict::EffectsMissing => {
            let names: Vec<String> = diagnosis.steps.iter().map(falls).collect();
            format!("The model lacks {}.", names.join(", then "))
        }
        Verdict::NotInCatalogue => {
            let parts: Vec<String> = diagnosis
                .unknown
                .iter()
                .flatten()
                .map(|unknown| {
                    let on = unknown.depends_on.first().map_or("?", |first| first.variable.as_str());
                    format!("{} depends on {on} ({:.0} % of what is left)", unknown.channel, 100.0 * unknown.r2)
                })
                .collect();
            format!("Something is missing that is not in the catalogue: {}.", parts.join("; "))
        }
        Verdict::Explained => {
            "No effect of the catalogue is missing that these flights could show and that would be worth while.".into()
        }
        _ => String::new(),
    }
}
