//! The forward road: one effect after the other, the gates that each must pass, and the check backward.

use super::candidate::{Candidate, is_found, with};
use super::describe::{dropped, stability};
use super::engine::Trial;
use super::found::Found;
use super::gains::{gains, paired};
use super::gates::{CONTENDER, MANY, MOST_CONTENDERS, SMALLEST_FALL};
use super::report::CandidateReport;
use super::resample::{RESAMPLES, Resampled, draw, resampled};
use super::scored::Scored;
use super::search::Search;
use crate::error::{Error, Result};
use crate::flight::PerChannel;
use crate::physics::{Model, catalogue};
use std::collections::BTreeMap;

impl Search<'_> {
    /// The fitted model; with half a step of control delay, if it states none and half a step is better than none and than a little
    /// less or more: then the controls are held between samples, which is how the log was made and no effect. Another delay is one, and where it
    /// is in the model nothing is asked.
    pub(super) fn timing(&self, base: &Model) -> Result<(Model, Option<f64>)> {
        let step_s = self.engine.flights.first().map_or(0.01, |flight| flight.step_s);
        let delays: Vec<f64> = [0.5, 0.35, 0.65, 1.0, 1.5, 2.0].iter().map(|steps| steps * step_s).collect();
        let delayed = |delay_s: &f64| {
            let mut model = base.clone();
            model.data.control_delay_s = *delay_s;
            model
        };
        let stated = base.data.control_delay_s > 0.0 || base.effects.iter().any(|effect| effect.kind == "ctrl_delay");
        let models: Vec<Model> = if stated { Vec::new() } else { delays.iter().map(delayed).collect() };
        // All columns of a model change with its delay, and one of many effects has many: a part of long flights tells it as well.
        let part = self.part().filter(|_| !models.is_empty() && has_many(base));
        let pass = part.as_ref().unwrap_or(self).engine.pass(base, &models)?;
        let fitted = |model: &Model| match part {
            Some(_) => Ok::<_, Error>(self.engine.pass(model, &[])?.base.model),
            None => Ok(model.clone()),
        };
        let gains: Vec<Vec<f64>> =
            pass.trials.iter().map(|trial| trial.as_ref().map_or_else(Vec::new, |trial| gains(&pass.base, trial))).collect();
        let total = |gains: &Vec<f64>| gains.iter().sum::<f64>();
        if let (Some(half), Some(Some(trial))) = (gains.first(), pass.trials.first()) {
            let (difference, error) = paired(half, &vec![0.0; half.len()]);
            if difference > 2.0 * error && gains.iter().skip(1).all(|longer| total(longer) < total(half)) {
                return Ok((fitted(&trial.model)?, delays.first().copied()));
            }
        }
        Ok((fitted(&pass.base.model)?, None))
    }

    /// With how many effects more it is time to begin from the other end: those that earlier searches found count, unless they were as many.
    pub(super) fn enough(before: &Model) -> usize {
        let known = before.effects.iter().filter(|effect| is_found(effect)).count();
        if known < MANY { MANY - known } else { MANY }
    }

    /// Adds one effect after the other; `most` of them, or as many as there are until it is time to begin from the other end: then nothing is
    /// said of the others.
    pub(super) fn forward(
        &self,
        before: &Model,
        candidates: &[Candidate],
        most: Option<usize>,
    ) -> Result<(Vec<Found>, Vec<CandidateReport>)> {
        let mut model = before.clone();
        let mut found: Vec<Found> = Vec::new();
        // Gains of all that passed at the last step.
        let mut earlier: BTreeMap<String, f64> = BTreeMap::new();
        let enough = Self::enough(before);
        let limit = most.unwrap_or(enough);
        loop {
            if most.is_none() && found.len() == enough {
                return Ok((found, Vec::new()));
            }
            let open: Vec<&Candidate> = candidates.iter().filter(|candidate| model.effect(&candidate.id).is_none()).collect();
            self.options.watch.at(format!("{}; trying {} effects beside the model", so_far(&found), open.len()))?;
            let (base, mut scored) = self.score(&model, &open)?;
            let mse = self.engine.mse(&base);
            if let Some(last) = found.last_mut() {
                last.shadows(&scored, &earlier);
                last.removed = PerChannel::from_fn(|channel| last.mse_before[channel] - mse[channel]);
            }
            for scored in &mut scored {
                scored.rival = found.iter().find(|found| found.is_flawed_by(scored, &mse)).map(|found| found.step.effect.clone());
            }
            if found.len() < limit {
                self.refine_contenders(&base, &mut scored)?;
            }
            let passing: Vec<&Scored<'_>> = scored.iter().filter(|scored| scored.passes(self.largest_p)).collect();
            let best = passing.iter().max_by(|left, right| left.gain.total_cmp(&right.gain));
            let Some(best) = best.filter(|_| found.len() < limit) else {
                let mut reports = self.reports(&open, &scored);
                reports.splice(0..0, self.backward(&mut found, before)?);
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
            let refined = &chosen.best;
            let mut step = self.step(chosen, refined, tied.iter().map(|entry| entry.0.to_owned()).collect());
            step.selection_frequency = self.selection_frequency(chosen, &passing);
            step.stability = stability(step.selection_frequency).into();
            for parameter in &mut step.parameters {
                parameter.profile = chosen.profiles.get(&parameter.name).copied();
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
                removed: PerChannel::splat(0.0),
            });
            model = found.last().map_or(model, |last| last.model.clone());
        }
    }

    /// Refines the open parameters of all that could win: on a coarse grid an effect with a lag would lose to one whose coefficients
    /// are found exactly.
    fn refine_contenders(&self, base: &Trial, scored: &mut [Scored<'_>]) -> Result<()> {
        let gains_of = |scored: &Scored<'_>| if scored.passes(self.largest_p) { scored.gain } else { 0.0 };
        let largest = scored.iter().map(gains_of).fold(0.0, f64::max);
        let mut contenders: Vec<&mut Scored<'_>> =
            scored.iter_mut().filter(|scored| scored.passes(self.largest_p) && scored.gain >= CONTENDER * largest).collect();
        contenders.sort_by(|left, right| right.gain.total_cmp(&left.gain));
        for contender in contenders.into_iter().take(MOST_CONTENDERS) {
            self.options.watch.at(format!("finer numbers of {}", contender.candidate.id))?;
            let (refined, profiles) = self.refine(base, contender)?;
            contender.gains = gains(base, &refined);
            contender.gain = contender.gains.iter().sum();
            contender.falls = self.falls(base, &refined);
            contender.best = refined;
            contender.profiles = profiles;
        }
        Ok(())
    }

    /// Drops accepted effects that the later ones have made needless, and refits; says which.
    fn backward(&self, found: &mut Vec<Found>, before: &Model) -> Result<Vec<CandidateReport>> {
        let mut reports = Vec::new();
        while found.len() > 1 {
            let Some(last) = found.last() else { break };
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
            // What it removes beside the others, by channel.
            let falls = |trial: &Trial| {
                let mse = self.engine.mse(trial);
                PerChannel::from_fn(|channel| 1.0 - whole[channel] / mse[channel])
            };
            let cost = |falls: &PerChannel<f64>| falls.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let costs = found.iter().zip(&pass.trials).filter_map(|(found, trial)| Some((found, falls(trial.as_ref()?))));
            let least = costs.min_by(|left, right| cost(&left.1).total_cmp(&cost(&right.1)));
            let Some((needless, falls)) = least.filter(|least| cost(&least.1) < SMALLEST_FALL) else { break };
            reports.push(dropped(needless, &falls));
            let needless = needless.step.effect.clone();
            self.without(found, &[needless], before)?;
        }
        Ok(reports)
    }

    /// Takes effects back and fits the models of all steps again.
    pub(super) fn without(&self, found: &mut Vec<Found>, names: &[String], before: &Model) -> Result<()> {
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
    pub(super) fn intervals(&self, found: &mut [Found]) -> Result<()> {
        let Some(model) = found.last().map(|last| last.model.clone()) else { return Ok(()) };
        let Resampled { intervals, correlations, influences } = resampled(&self.engine, &model, self.options.seed)?;
        for found in found.iter_mut() {
            let Some(index) = model.effects.iter().position(|effect| effect.name == found.step.effect) else { continue };
            for (position, number) in found.step.coefficients.iter_mut().enumerate() {
                number.value =
                    model.effects[index].coefficients.get(position).map_or(number.value, |coefficient| coefficient.value);
                number.ci95 = intervals.get(&(index, position)).copied();
                number.influence = influences.get(&(index, position)).cloned();
            }
            // The formula with the numbers that are printed beside it.
            found.step.formula = model.effects[index].to_string();
        }
        if let Some(last) = found.last_mut() {
            last.model.correlations = correlations;
            for (&(effect, coefficient), interval) in &intervals {
                if let Some(coefficient) =
                    last.model.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(coefficient))
                {
                    coefficient.ci95 = Some(*interval);
                }
            }
        }
        let judged = found.last().map_or(model, |last| last.model.clone());
        self.judge_signs(&judged, found);
        Ok(())
    }

    /// Share of resampled block sets in which a candidate has the largest gain of those that pass.
    pub(super) fn selection_frequency(&self, chosen: &Scored<'_>, passing: &[&Scored<'_>]) -> f64 {
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
}

/// Whether a model has so many effects beyond a baseline as make a search begin from the other end.
pub(super) fn has_many(model: &Model) -> bool {
    let is_searched = |kind: &str| catalogue::definition(kind).is_some_and(|definition| definition.notes.is_some());
    model.effects.iter().filter(|effect| is_found(effect) || is_searched(&effect.kind)).count() >= MANY
}

/// What a search has found by now, in words.
fn so_far(found: &[Found]) -> String {
    match found {
        [] => "nothing found yet".into(),
        [one] => format!("found {}", one.step.effect),
        several => format!("found {} effects", several.len()),
    }
}

/// How much better a less simple rival may be without counting as a win: it was passed over for its complexity.
fn tolerance(chosen: &Scored<'_>, other: &Scored<'_>) -> f64 {
    if other.candidate.freedom() > chosen.candidate.freedom() { paired(&other.gains, &chosen.gains).1 } else { 0.0 }
}
