//! One step of the search: every candidate tried beside a model, with its gain, its share of the error and its p-value.

use super::candidate::{Candidate, with};
use super::engine::{Engine, Pass, Trial, priors};
use super::gains::gains;
use super::gates::{CARRIED_SHARE, DETECTION, FEWEST_CARRYING, SMALLEST_FALL, SMALLEST_MOVEMENT};
use super::scored::Scored;
use super::search::Search;
use super::significance::{OwnBlocks, Raw, block_weights, raw_scores};
use crate::error::Result;
use crate::flight::{Channel, PerChannel};
use crate::physics::Model;
use std::collections::BTreeMap;
use std::ops::Range;

pub(super) struct Movement {
    pub share: f64,
    pub detection: f64,
    pub carrying: usize,
    pub excited: bool,
}

impl Search<'_> {
    /// Tries every candidate beside a model.
    pub(super) fn score<'c>(&self, model: &Model, open: &[&'c Candidate]) -> Result<(Trial, Vec<Scored<'c>>)> {
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
        let even: PerChannel<Vec<f64>> = {
            let channel = self.engine.weights(&pass.base);
            channel.map(|weight| vec![weight; rows.len()])
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

    pub(super) fn scored<'c>(
        &self,
        candidate: &'c Candidate,
        trials: &[&Trial],
        pass: &Pass,
        weights: &PerChannel<Vec<f64>>,
        even: &PerChannel<Vec<f64>>,
    ) -> Option<Scored<'c>> {
        let gains: Vec<Vec<f64>> = trials.iter().map(|trial| gains(&pass.base, trial)).collect();
        let total = |gains: &Vec<f64>| gains.iter().sum::<f64>();
        let best = (0..trials.len()).max_by(|&left, &right| total(&gains[left]).total_cmp(&total(&gains[right])))?;
        let (flights, locals) = (self.flights(), self.locals(&pass.base));
        let raw_scores = |trial: &&Trial, weights| raw_scores(&pass.base, trial, &pass.grams, weights, &flights, &locals);
        let raw: Vec<Option<Raw>> = trials.iter().map(|trial| raw_scores(trial, weights)).collect();
        let p_value = if candidate.is_by_flight() {
            // Its variants differ in their spread alone, and have the same scores.
            let runs: Vec<Range<usize>> = self.engine.runs().collect();
            let of = |raw: &Raw| self.flips.p_value_between_flights(&raw.scores, &usual_spreads(candidate), &runs);
            raw.first().and_then(Option::as_ref).map_or(1.0, of)
        } else {
            let whitened: Vec<_> = raw.iter().flatten().filter_map(Raw::whitened).collect();
            if whitened.is_empty() { 1.0 } else { self.flips.p_value(&whitened) }
        };
        let movement = trials.iter().filter_map(|trial| {
            let raw = raw_scores(trial, even)?;
            Some(self.movement(candidate, trial, &raw))
        });
        let movement = movement.max_by(|left, right| left.share.total_cmp(&right.share));
        let trial = trials[best];
        Some(Scored {
            candidate,
            best: trial.clone(),
            gain: total(&gains[best]),
            gains: gains[best].clone(),
            falls: self.falls(&pass.base, trial),
            p_value,
            detection: movement.as_ref().map(|movement| movement.detection.max(SMALLEST_FALL)),
            excited: movement.as_ref().is_some_and(|movement| movement.excited),
            plausible: plausible(&pass.base.model, trial),
            carrying: movement.map_or(0, |movement| movement.carrying),
            rival: None,
            profiles: BTreeMap::new(),
        })
    }

    /// The flights with their blocks.
    fn flights(&self) -> Vec<OwnBlocks<'_>> {
        let Engine { flights, blocks, correlation, .. } = &self.engine;
        let one = |range: Range<usize>| {
            let name = &flights[blocks[range.start].flight].name;
            OwnBlocks { name, blocks: range, correlation: *correlation }
        };
        self.engine.runs().map(one).collect()
    }

    /// What a model has for each flight: place in its layout, and usual spread.
    fn locals(&self, base: &Trial) -> Vec<(usize, f64)> {
        let priors = priors(&base.model, &base.layout, &self.engine.held);
        priors.iter().enumerate().filter_map(|(place, prior)| Some((place, prior.by_flight?))).collect()
    }

    /// Share of the held-out mean squared error that a trial removes, by channel that it acts in.
    pub(super) fn falls(&self, base: &Trial, trial: &Trial) -> BTreeMap<Channel, f64> {
        let (before, after) = (self.engine.mse(base), self.engine.mse(trial));
        Channel::ALL
            .into_iter()
            .filter(|&channel| trial.changed[channel] && self.touches(trial, base, channel))
            .map(|channel| (channel, 1.0 - after[channel] / before[channel]))
            .collect()
    }

    /// Whether a trial has other columns than the base in a channel, or only shares coefficients with one that has.
    pub(super) fn touches(&self, trial: &Trial, base: &Trial, channel: Channel) -> bool {
        trial.layout.channels[channel] != base.layout.channels[channel]
    }

    pub(super) fn movement(&self, candidate: &Candidate, trial: &Trial, raw: &Raw) -> Movement {
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
}

/// How far the numbers of a candidate usually spread from flight to flight.
fn usual_spreads(candidate: &Candidate) -> Vec<f64> {
    let known = |name: &str| candidate.definition?.coefficient(name)?.by_flight;
    candidate.effect.coefficients.iter().map(|coefficient| known(&coefficient.name).unwrap_or(1.0)).collect()
}

/// The controls must keep acting the way they act without the effect; an effect whose every coefficient had to be put on a bound of
/// zero does nothing.
pub(super) fn plausible(base: &Model, trial: &Trial) -> bool {
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
