//! From what a search found to what is said of it. No measuring here.

use super::amend::numbers_of;
use super::candidate::{Candidate, is_found};
use super::engine::Trial;
use super::found::Found;
use super::gates::SMALLEST_FALL;
use super::influence::{Influences, decisive_flight};
use super::judged::{Fitted, Judged};
use super::report::{CandidateReport, Confirmation, Diagnosis, Number, ParameterValue, Status, Step, Verdict};
use super::resample::{RESAMPLES, draw};
use super::scored::Scored;
use super::search::Search;
use super::sentences;
use crate::error::Result;
use crate::flight::{Channel, Column, PerChannel};
use crate::physics::{Coefficient, Definition, Effect, FORMULA_KIND, Parameter, catalogue};
use std::collections::BTreeMap;

impl Search<'_> {
    pub(super) fn step(&self, chosen: &Scored<'_>, refined: &Trial, indistinguishable: Vec<String>) -> Step {
        let effect = refined.model.effects.last().unwrap_or(&chosen.candidate.effect);
        let told = told_of(effect, chosen.candidate.definition, refined.model.is_usual(), &chosen.falls);
        Step {
            effect: chosen.candidate.id.clone(),
            p_value: chosen.p_value,
            indistinguishable,
            rests_on_flight: decisive_flight(&self.engine, &chosen.gains),
            ..told
        }
    }

    /// An effect that the backward road keeps, in the model with all that it keeps.
    pub(super) fn needed(&self, judged: &Judged, Fitted { model, influences }: &Fitted) -> Option<Found> {
        let index = model.effects.iter().position(|effect| effect.name == judged.effect)?;
        let effect = &model.effects[index];
        let definition = catalogue::definition(&effect.kind).filter(|definition| definition.notes.is_some());
        let selection_frequency = self.frequency(&judged.gains);
        let mut step = Step {
            p_value: judged.p_value,
            selection_frequency,
            stability: stability(selection_frequency).into(),
            rests_on_flight: judged.rests_on.clone(),
            indistinguishable: judged.ties.clone(),
            ..told_of(effect, definition, model.is_usual(), &judged.falls)
        };
        note_influences(&mut step, index, influences);
        Some(Found {
            step,
            gain: judged.gain(),
            model: model.clone(),
            channels: judged.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL).map(|(&channel, _)| channel).collect(),
            confusable: definition.and_then(|definition| definition.notes).map_or(&[][..], |notes| notes.confusable_with),
            mse_before: PerChannel::splat(0.0),
            removed: PerChannel::splat(0.0),
        })
    }

    /// The numbers of what was found beside many effects, with their intervals: numbers of many effects lean on each other and on lags, so
    /// all are fitted at once, as on the backward road.
    ///
    /// # Errors
    /// As [`Search::refitted`].
    pub(super) fn numbers_at_once(&self, found: &mut [Found]) -> Result<()> {
        let Some((last, earlier)) = found.split_last_mut() else { return Ok(()) };
        let Fitted { model, influences } = self.refitted(&last.model, &[])?;
        // The models on the way may have been fitted on a part.
        for found in earlier {
            found.model = self.engine.pass(&found.model, &[])?.base.model;
        }
        for found in found.iter_mut() {
            numbers_of(&mut found.step, &model);
            let index = model.effects.iter().position(|effect| effect.name == found.step.effect);
            index.into_iter().for_each(|index| note_influences(&mut found.step, index, &influences));
        }
        self.judge_signs(&model, found);
        found.last_mut().into_iter().for_each(|last| last.model.clone_from(&model));
        Ok(())
    }

    /// Share of resampled block sets in which the model with an effect is better than that without.
    fn frequency(&self, gains: &[f64]) -> f64 {
        let better =
            |world: &usize| draw(gains.len(), self.options.seed, *world).iter().map(|&block| gains[block]).sum::<f64>() > 0.0;
        (0..RESAMPLES).filter(better).count() as f64 / RESAMPLES as f64
    }

    /// What is said of an effect that the backward road leaves out.
    pub(super) fn needless(&self, judged: &Judged) -> CandidateReport {
        let status = match () {
            () if judged.mends.is_some() || judged.gave_way_to.is_some() => Status::SamePhysics,
            () if !judged.is_excited() => Status::NotExcited,
            () if judged.largest_fall() < SMALLEST_FALL => Status::Negligible,
            () => Status::NotSignificant,
        };
        let best = judged.falls.iter().max_by(|left, right| left.1.total_cmp(right.1));
        let too_little = || best.map_or_else(String::new, |(&channel, &fall)| sentences::too_little(channel.name(), fall));
        let notes = catalogue::definition(&judged.effect).and_then(|definition| definition.notes);
        CandidateReport {
            effect: judged.effect.clone(),
            status,
            held_out_mse_fall: judged.falls.iter().map(|(&channel, &fall)| (channel.name().to_owned(), fall)).collect(),
            p_value: Some(judged.p_value),
            detection_limit_mse_fall: None,
            reason: match status {
                Status::SamePhysics => match &judged.gave_way_to {
                    Some(other) => sentences::gave_way(other),
                    None => sentences::mends(judged.mends.as_deref().unwrap_or("?")),
                },
                Status::NotExcited => sentences::loose(judged.looseness),
                Status::Negligible => too_little(),
                _ => sentences::could_be_chance(judged.p_value, self.largest_p),
            },
            note: notes.filter(|_| status == Status::NotExcited).map(|notes| format!("wanted: {}", notes.excitation)),
        }
    }

    pub(super) fn reports(&self, open: &[&Candidate], scored: &[Scored<'_>]) -> Vec<CandidateReport> {
        let mut reports: Vec<CandidateReport> = open
            .iter()
            .map(|candidate| match scored.iter().find(|scored| scored.candidate.id == candidate.id) {
                Some(scored) => {
                    let status = scored.status(self.largest_p);
                    let notes = candidate.definition.and_then(|definition| definition.notes);
                    CandidateReport {
                        effect: candidate.id.clone(),
                        status,
                        held_out_mse_fall: scored.falls.iter().map(|(&channel, &fall)| (channel.name().to_owned(), fall)).collect(),
                        p_value: Some(scored.p_value),
                        detection_limit_mse_fall: scored.detection.filter(|_| scored.excited),
                        reason: scored.reason(self.largest_p, &self.engine.held),
                        note: notes.filter(|_| status == Status::NotExcited).map(|notes| format!("wanted: {}", notes.excitation)),
                    }
                }
                None => CandidateReport {
                    effect: candidate.id.clone(),
                    status: Status::NotExcited,
                    held_out_mse_fall: BTreeMap::new(),
                    p_value: None,
                    detection_limit_mse_fall: None,
                    reason: candidate.inapplicable.clone().unwrap_or_else(|| {
                        "these flights do not tell its regressors from those of the model, or one part of them alone carries it"
                            .into()
                    }),
                    note: None,
                },
            })
            .collect();
        let largest = |report: &CandidateReport| report.held_out_mse_fall.values().copied().fold(f64::NEG_INFINITY, f64::max);
        reports.sort_by(|left, right| largest(right).total_cmp(&largest(left)));
        reports
    }
}

/// Notes which numbers of an effect hang on one flight: its coefficients, then its parameters.
fn note_influences(step: &mut Step, effect: usize, influences: &Influences) {
    let coefficients = step.coefficients.iter_mut().map(|number| &mut number.influence);
    let numbers = coefficients.chain(step.parameters.iter_mut().map(|parameter| &mut parameter.influence));
    numbers.enumerate().for_each(|(position, influence)| *influence = influences.get(&(effect, position)).cloned());
}

/// What there is to tell of an accepted effect as it stands in a model.
fn told_of(effect: &Effect, definition: Option<&Definition>, is_usual: bool, falls: &BTreeMap<Channel, f64>) -> Step {
    let number = |coefficient: &Coefficient| {
        let known = definition.and_then(|definition| definition.coefficient(&coefficient.name));
        let rms = coefficient
            .by_flight
            .as_ref()
            .map(|values| (values.values().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt());
        Number {
            name: coefficient.name.clone(),
            value: coefficient.value,
            ci95: coefficient.ci95,
            unit: coefficient.unit.clone(),
            // Usual values are those of one size of vehicle.
            expected: known.and_then(|known| known.expected).filter(|_| is_usual),
            sign: None,
            held: false,
            rms_over_flights: rms,
            by_flight: coefficient.by_flight.clone().unwrap_or_default(),
            influence: None,
        }
    };
    let value = |parameter: &Parameter| ParameterValue {
        name: parameter.name.clone(),
        value: parameter.value,
        fixed: parameter.fixed,
        unit: parameter.unit.clone(),
        profile: parameter.ci95,
        influence: None,
    };
    let worthy = falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL);
    Step {
        effect: effect.name.clone(),
        meaning: if effect.kind == FORMULA_KIND && is_found(effect) { sentences::SUGGESTED.into() } else { effect.meaning.clone() },
        channels: worthy.map(|(&channel, _)| channel.name().to_owned()).collect(),
        held_out_mse_fall: falls.iter().map(|(&channel, &fall)| (channel.name().to_owned(), fall)).collect(),
        coefficients: effect.coefficients.iter().map(number).collect(),
        parameters: effect.parameters.iter().map(value).collect(),
        would_tell_apart: definition
            .and_then(|definition| definition.notes)
            .map_or_else(String::new, |notes| notes.would_tell_apart.into()),
        fault_of_log: definition.and_then(|definition| definition.notes?.fault_of_log).map(str::to_owned),
        formula: effect.to_string(),
        ..Step::default()
    }
}

/// What is said of an accepted effect among the candidates.
pub(super) fn accepted(step: &Step) -> CandidateReport {
    CandidateReport {
        effect: step.effect.clone(),
        status: Status::Accepted,
        held_out_mse_fall: step.held_out_mse_fall.clone(),
        p_value: Some(step.p_value),
        detection_limit_mse_fall: None,
        reason: "passes every gate".into(),
        note: None,
    }
}

/// What is said of an effect that was found and is not named, and why.
pub(super) fn taken_back(found: &Found, reason: &str) -> CandidateReport {
    CandidateReport { status: Status::SamePhysics, reason: reason.into(), ..accepted(&found.step) }
}

/// What is said of an effect that was accepted and is needless beside the later ones, with the shares that it still removes by channel.
pub(super) fn dropped(found: &Found, falls: &PerChannel<f64>) -> CandidateReport {
    let acts = |name: &str| found.step.held_out_mse_fall.contains_key(name);
    let still = Column::TARGETS.into_iter().zip(falls).map(|(column, fall)| (column.name(), *fall));
    CandidateReport {
        status: Status::Negligible,
        held_out_mse_fall: still.filter(|(name, _)| acts(name)).map(|(name, fall)| (name.to_owned(), fall)).collect(),
        reason: format!(
            "accepted at first and dropped: beside the effects accepted later it removes less than {:.0} % of any channel's error",
            100.0 * SMALLEST_FALL
        ),
        ..accepted(&found.step)
    }
}

/// An effect that wins in nearly every resampled world.
pub(super) const STABLE: &str = "stable";

/// A selection frequency in a word.
pub(super) fn stability(frequency: f64) -> &'static str {
    match frequency {
        frequency if frequency >= 0.9 => STABLE,
        frequency if frequency >= 0.6 => "likely",
        _ => "tentative",
    }
}

/// What was found in some sentences: effects or their absence, then where the model fails most.
pub(super) fn summary(diagnosis: &Diagnosis) -> String {
    let unknown = diagnosis.unknown.as_deref().unwrap_or_default();
    let found = match diagnosis.verdict {
        Verdict::EffectsMissing => {
            let confirmation = diagnosis.confirmation.unwrap_or(Confirmation::NothingKept);
            sentences::effects(diagnosis, confirmation)
        }
        Verdict::NotInCatalogue => sentences::not_in_catalogue(unknown),
        Verdict::Explained => sentences::explained(),
        Verdict::TooLittleData | Verdict::ConventionFault => String::new(),
    };
    let failure = diagnosis.failure.as_ref().and_then(sentences::failure);
    [Some(found), failure].into_iter().flatten().filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" ")
}
