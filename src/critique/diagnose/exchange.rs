//! Lags and delays that stand in each other's place. Beside all effects at once each of two that act alike looks needless, and which of them the
//! backward road leaves out first is chance. So what is kept is held against its rivals, each fitted in its place. Which effects are needed at all
//! is judged in `backward`.

use super::candidate::{Candidate, freedom, open, with};
use super::engine::{Engine, Errors};
use super::gains::{gains_of, paired};
use super::gates::CLEARLY;
use super::joint::Point;
use super::judged::{Judged, related};
use crate::error::{Error, Result};
use crate::flight::PerChannel;
use crate::physics::{Effect, Model, off_zero};
use std::collections::{BTreeMap, BTreeSet};

/// Steps of a rival on the flights that are cheap to fit on, at most, one after the other; it is not looked at further where its cost is then above that
/// of what it would replace by more than this: twice a logarithm of likelihood, in independent samples.
const TRIED: [(usize, f64); 2] = [(2, 100.0), (6, 30.0)];

/// Steps on the flights that judge, at most, and of what is there on the cheap ones.
const STEPS: [usize; 2] = [3, 1];

/// What was held against each other, by what was to go and what was to come: nothing is asked twice.
#[derive(Default)]
pub(super) struct Rivals {
    asked: BTreeSet<(String, String)>,
    /// Effects that fit as well as one that is kept, to within [`CLEARLY`] standard errors.
    pub ties: BTreeMap<String, Vec<String>>,
}

/// One effect that gives way.
pub(super) struct Exchange {
    /// With the other in its place, fitted.
    pub model: Model,
    pub out: String,
    pub by: String,
}

/// Where effects are fitted and judged.
pub(super) struct Ground<'a> {
    pub quick: &'a Engine<'a>,
    pub judging: &'a Engine<'a>,
    pub candidates: &'a [Candidate],
}

impl Rivals {
    /// The first effect of those that are needed whose work another does better by [`CLEARLY`] standard errors, or as well to within one with fewer
    /// numbers; the best where several do. `None` where there is none; ties are noted.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn exchange(&mut self, ground: &Ground<'_>, model: &Model, needed: &[Judged]) -> Result<Option<Exchange>> {
        let mut base: Option<(f64, Errors)> = None;
        for judged in needed {
            let mut best: Option<(f64, Exchange)> = None;
            for (by, rival) in ground.rivals(model, &judged.effect) {
                if !self.asked.insert((judged.effect.clone(), by.clone())) {
                    continue;
                }
                if base.is_none() {
                    base = ground.judged(model)?;
                }
                let Some((cost, errors)) = &base else { return Ok(None) };
                let simpler = numbers(&rival) < numbers(model);
                let Some((fitted, found)) = ground.fitted(rival, *cost)? else { continue };
                let gains = gains_of(errors, &found, &PerChannel::splat(true));
                let (better, deviation) = paired(&gains, &vec![0.0; gains.len()]);
                if better > CLEARLY * deviation || simpler && better >= -deviation {
                    if best.as_ref().is_none_or(|best| better > best.0) {
                        best = Some((better, Exchange { model: fitted, out: judged.effect.clone(), by }));
                    }
                } else if better > -CLEARLY * deviation {
                    self.ties.entry(judged.effect.clone()).or_default().push(by);
                }
            }
            if let Some((_, best)) = best {
                return Ok(Some(best));
            }
        }
        Ok(None)
    }
}

impl Ground<'_> {
    /// Candidates that an effect with times or shapes is mistaken for and that are not in the model, and models with each in its place.
    fn rivals(&self, model: &Model, name: &str) -> Vec<(String, Model)> {
        let mut without = model.clone();
        without.effects.retain(|effect| effect.name != name);
        let is_one = |candidate: &&Candidate| {
            let is_new = candidate.inapplicable.is_none() && model.effect(&candidate.id).is_none();
            is_new && is_open(&candidate.effect) && related(name, &candidate.id)
        };
        let in_place = |candidate: &Candidate| {
            let mut new = candidate.effect.clone();
            off_zero(&mut new);
            (candidate.id.clone(), with(&without, &new))
        };
        match model.effect(name) {
            Some(effect) if is_open(effect) => self.candidates.iter().filter(is_one).map(in_place).collect(),
            _ => Vec::new(),
        }
    }

    /// Cost of a fitted model on the cheap flights, and its held-out errors on those that judge.
    fn judged(&self, model: &Model) -> Result<Option<(f64, Errors)>> {
        let Some(there) = determined(Point::fitted(self.quick, model.clone(), STEPS[1]))? else { return Ok(None) };
        let cost = self.cost(there)?;
        Ok(self.held_out(model.clone())?.map(|errors| (cost, errors)))
    }

    fn cost(&self, model: Model) -> Result<f64> {
        Ok(Point::at(self.quick, model, Vec::new())?.cost)
    }

    /// A rival and its held-out errors; `None` where it is hopeless beside a cost, or not determined.
    fn fitted(&self, rival: Model, cost: f64) -> Result<Option<(Model, Errors)>> {
        let mut model = rival;
        for (steps, hopeless) in TRIED {
            let Some(next) = determined(Point::fitted(self.quick, model, steps))? else { return Ok(None) };
            if self.cost(next.clone())? > cost + hopeless {
                return Ok(None);
            }
            model = next;
        }
        let Some(model) = determined(Point::fitted(self.judging, model, STEPS[0]))? else { return Ok(None) };
        Ok(self.held_out(model.clone())?.map(|errors| (model, errors)))
    }

    fn held_out(&self, model: Model) -> Result<Option<Errors>> {
        let mut point = Point::at(self.judging, model, Vec::new())?;
        point.choose_spreads(self.judging);
        Ok(point.folds(self.judging, &[]).and_then(|folds| point.held_out(self.judging, &folds, &[])))
    }
}

fn determined(fitted: Result<Model>) -> Result<Option<Model>> {
    match fitted {
        Err(Error::Undetermined(_)) => Ok(None),
        fitted => fitted.map(Some),
    }
}

fn is_open(effect: &Effect) -> bool {
    open(effect).next().is_some()
}

fn numbers(model: &Model) -> usize {
    model.effects.iter().map(freedom).sum()
}

#[cfg(test)]
mod tests {
    use super::super::candidate::candidates;
    use super::super::engine::permuted_folds;
    use super::super::gram::blocks;
    use super::super::gram::tests::{model, noise, whole};
    use super::*;
    use crate::flight::Flight;
    use crate::physics::catalogue;

    /// A model with an effect of the catalogue, its numbers where they begin.
    fn lagging(kind: &str) -> Result<Model> {
        let definition = catalogue::definition(kind).ok_or_else(|| Error::Undetermined(format!("no effect `{kind}`")))?;
        Ok(with(&steered(), &definition.effect(4.58, 0.8)))
    }

    /// A model in which sticks move the machine.
    fn steered() -> Model {
        let mut model = model();
        let powers = ["collective_thrust", "control_moment"];
        let effects = model.effects.iter_mut().filter(|effect| powers.contains(&effect.kind.as_str()));
        effects.flat_map(|effect| &mut effect.coefficients).for_each(|number| number.value = 1.0);
        model
    }

    /// Flights of a machine that has an effect, beside noise.
    fn flown(kind: &str) -> Result<Vec<Flight>> {
        let mut flights = noise(7, &[3000; 8]);
        for flight in &mut flights {
            let mut accelerations = lagging(kind)?.predict(flight)?;
            for (channel, values) in accelerations.pairs_mut() {
                values.iter_mut().zip(flight.column(channel.column())).for_each(|(value, noise)| *value += 0.1 * noise);
            }
            *flight = flight.with_accelerations(&accelerations)?;
        }
        Ok(flights)
    }

    /// What takes the place of `kept` in flights of a machine that has `truth`.
    fn in_place_of(kept: &str, truth: &str) -> Result<Option<String>> {
        let flights = flown(truth)?;
        let cut = blocks(&flights, &whole(&flights), 10.0);
        let fold = permuted_folds(cut.len(), 1);
        let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
        let fitted = Point::fitted(&engine, lagging(kept)?, 20)?;
        let candidates = candidates(&steered(), &flights);
        let ground = Ground { quick: &engine, judging: &engine, candidates: &candidates };
        let needed = [Judged {
            effect: kept.into(),
            gains: Vec::new(),
            falls: BTreeMap::new(),
            p_value: 0.0,
            looseness: 0.0,
            rests_on: None,
            by_flight: false,
            mends: None,
            gave_way_to: None,
            ties: Vec::new(),
        }];
        let found = Rivals::default().exchange(&ground, &fitted, &needed)?;
        if let Some(found) = &found {
            assert!(found.out == kept && found.model.effect(kept).is_none() && found.model.effect(&found.by).is_some());
        }
        Ok(found.map(|found| found.by))
    }

    #[test]
    fn a_delay_gives_way_to_the_lag_that_it_stood_for_and_what_is_right_stays() -> Result<()> {
        assert_eq!(in_place_of("ctrl_delay", "collective_lag")?.as_deref(), Some("collective_lag"));
        assert_eq!(in_place_of("ctrl_delay", "tail_lag")?.as_deref(), Some("tail_lag"));
        assert_eq!(in_place_of("collective_lag", "collective_lag")?, None);
        assert_eq!(in_place_of("ctrl_delay", "ctrl_delay")?, None);
        Ok(())
    }
}
