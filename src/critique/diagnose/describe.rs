//! From what a search found to what is said of it. No measuring here.

use super::candidate::Candidate;
use super::engine::Trial;
use super::gates::SMALLEST_FALL;
use super::report::{CandidateReport, Confirmation, Diagnosis, Number, ParameterValue, Status, Step, Verdict};
use super::score::Scored;
use super::search::{Found, Search};
use super::sentences;
use crate::flight::Column;
use crate::physics::{Coefficient, Parameter};
use std::collections::BTreeMap;

impl Search<'_> {
    pub(super) fn step(&self, chosen: &Scored<'_>, refined: &Trial, indistinguishable: Vec<String>) -> Step {
        let definition = chosen.candidate.definition;
        let empty = Vec::new();
        let effect = refined.model.effects.last();
        let name = |channel: usize| Column::TARGETS.get(channel).map_or("?", |column| column.name()).to_owned();
        let worthy = chosen.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL);
        let number = |coefficient: &Coefficient| {
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
                // Usual values are those of one size of vehicle.
                expected: known.and_then(|known| known.expected).filter(|_| refined.model.is_usual()),
                sign: None,
                held: false,
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
                let value = |parameter: &Parameter| ParameterValue {
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
    pub(super) fn decisive_flight(&self, gains: &[f64]) -> Option<String> {
        let total: f64 = gains.iter().sum();
        let mut flights: Vec<usize> = self.engine.blocks.iter().map(|block| block.flight).collect();
        flights.dedup();
        let flight = flights.iter().zip(self.by_flight(gains)).find(|(_, gain)| total - gain <= 0.0)?.0;
        self.engine.flights.get(*flight).map(|flight| flight.name.clone()).filter(|_| flights.len() > 1)
    }

    pub(super) fn reports(&self, open: &[&Candidate], scored: &[Scored<'_>]) -> Vec<CandidateReport> {
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

/// What is said of an effect that only stands in for something else.
pub(super) fn taken_back(found: &Found) -> CandidateReport {
    let reason = "stands in for a stronger dependence that is in no effect of the catalogue".into();
    CandidateReport { status: Status::SamePhysics, reason, ..accepted(&found.step) }
}

/// What is said of an effect that was accepted and is needless beside the later ones, with the shares that it still removes by channel.
pub(super) fn dropped(found: &Found, falls: &[f64; 6]) -> CandidateReport {
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
