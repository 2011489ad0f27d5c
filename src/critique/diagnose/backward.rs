//! The backward road: every effect that applies at once, all numbers fitted together, then what is needless left out. Forms interact, so
//! an effect can look small by itself and be large beside the others; a search that adds one after the other underrates it.

use super::candidate::{Candidate, is_found, with};
use super::engine::{Engine, Errors, permuted_folds};
use super::exchange::{Exchange, Ground, Rivals};
use super::gains::{by_flight_of, gains_of};
use super::gates::{BLOCK_S, SMALLEST_FALL};
use super::gram::blocks;
use super::influence::decisive_flight;
use super::joint::{Folds, Point, undetermined};
use super::judged::{Fitted, Judged};
use super::search::Search;
use super::selection::selection;
use super::significance::Flips;
use crate::error::Result;
use crate::flight::{Channel, PerChannel, Span};
use crate::physics::{Effect, Model, off_zero};
use std::collections::BTreeMap;

/// Time of flight on which everything is fitted first, s, and flights at least: many steps on it cost as much as few on all.
const QUICK: (f64, usize) = (700.0, 10);

/// Time of flight and flights on which effects are judged: on half an hour an effect that is worth a fiftieth of a channel's error shows.
const JUDGED: (f64, usize) = (1800.0, 20);

/// Steps on these, at most, and on all that was searched.
const STEPS: [usize; 3] = [30, 3, 2];

/// Length of a block where only the numbers and their intervals are asked for, s: fewer squares to keep.
const LONG_BLOCK_S: f64 = 40.0;

/// Times that what is left is fitted and judged again, at most.
const MOST_ROUNDS: usize = 6;

/// Several are left out at once where that costs no more than this beyond what each costs by itself, in the logarithm of the likelihood of
/// held-out blocks: two of which one is needed cost more together.
const SLACK: f64 = 0.5;

/// What the road came to.
pub(super) struct Backward {
    /// With what is needed, fitted, with intervals.
    pub fitted: Fitted,
    /// The largest gain first.
    pub needed: Vec<Judged>,
    /// As they were when they were left out.
    pub needless: Vec<Judged>,
}

/// Effects by place in [`Point::optional`].
struct Pruned {
    absent: Vec<usize>,
    needed: Vec<Judged>,
    needless: Vec<Judged>,
}

impl Search<'_> {
    /// Fits everything at once and leaves out what is needless, effects that a search added before not excepted.
    ///
    /// # Errors
    /// As [`Model::predict`]; [`crate::Error::Undetermined`] where the flights do not determine the baseline's numbers.
    pub(super) fn backward_road(&self, before: &Model, candidates: &[Candidate]) -> Result<Backward> {
        let mut model = before.clone();
        for candidate in candidates.iter().filter(|candidate| candidate.inapplicable.is_none()) {
            let mut effect = candidate.effect.clone();
            off_zero(&mut effect);
            model = with(&model, &effect);
        }
        let may_go = |effect: &Effect| is_found(effect) || candidates.iter().any(|candidate| candidate.id == effect.name);
        let optional = |model: &Model| (0..model.effects.len()).filter(|&index| may_go(&model.effects[index])).collect::<Vec<_>>();
        let (quick, judging) = (self.quick(), self.judging());
        let road = Road { flips: Flips::new(judging.blocks.len(), self.options.seed), engine: judging, largest_p: self.largest_p };
        let mut gone: Vec<Judged> = Vec::new();
        let mut rivals = Rivals::default();
        let mut round = 1;
        let mut needed = loop {
            self.options.watch.at(format!("round {round}: fitting {} effects together", optional(&model).len()))?;
            model = Point::fitted(&quick, model, STEPS[0])?;
            self.options.watch.at(format!("round {round}: fitting them on more flights"))?;
            model = Point::fitted(&road.engine, model, STEPS[1])?;
            let places = optional(&model);
            let mut point = Point::at(&road.engine, model, places)?;
            point.choose_spreads(&road.engine);
            self.options.watch.at(format!("round {round}: leaving out what no flight misses"))?;
            let Pruned { absent, needed, needless } = road.pruned(&point)?;
            gone.extend(needless);
            model = point.without(&road.engine, &absent).ok_or_else(undetermined)?;
            if round == MOST_ROUNDS {
                break needed;
            }
            if absent.is_empty() {
                self.options.watch.at(format!("round {round}: holding {} effects against their rivals", needed.len()))?;
                let ground = Ground { quick: &quick, judging: &road.engine, candidates };
                let Some(Exchange { model: exchanged, out, by }) = rivals.exchange(&ground, &model, &needed)? else { break needed };
                model = exchanged;
                let went = needed.into_iter().find(|judged| judged.effect == out);
                gone.extend(went.map(|judged| Judged { gave_way_to: Some(by), ..judged }));
            }
            round += 1;
        };
        for judged in &mut needed {
            judged.ties = rivals.ties.remove(&judged.effect).unwrap_or_default();
        }
        gone.retain(|judged| needed.iter().all(|needed| needed.effect != judged.effect));
        self.options.watch.at("numbers and intervals on all that is searched")?;
        Ok(Backward { fitted: self.refitted(&model, &[])?, needed, needless: gone })
    }

    /// A model without some effects, its numbers and their intervals from all that was searched.
    ///
    /// # Errors
    /// As [`Search::backward_road`].
    pub(super) fn refitted(&self, model: &Model, without: &[String]) -> Result<Fitted> {
        let mut model = model.clone();
        model.effects.retain(|effect| !without.contains(&effect.name));
        let whole = self.even((f64::INFINITY, 1), LONG_BLOCK_S);
        let mut point = Point::at(&whole, Point::fitted(&whole, model, STEPS[2])?, Vec::new())?;
        point.note_intervals(&point.folds(&whole, &[]).ok_or_else(undetermined)?);
        let influences = point.influences(&whole).ok_or_else(undetermined)?;
        Ok(Fitted { model: point.model, influences })
    }

    /// The same search on as much of the flights as judges effects, where there is at least twice as much.
    pub(super) fn part(&self) -> Option<Search<'_>> {
        let engine = Engine { held: self.engine.held.clone(), ..self.judging() };
        let flips = (2 * engine.rows() <= self.engine.rows()).then(|| Flips::new(engine.blocks.len(), self.options.seed))?;
        Some(Search { engine, flips, largest_p: self.largest_p, options: self.options })
    }

    /// What is cheap to fit on.
    pub(super) fn quick(&self) -> Engine<'_> {
        self.even(QUICK, BLOCK_S)
    }

    /// What effects are judged on.
    pub(super) fn judging(&self) -> Engine<'_> {
        self.even(JUDGED, BLOCK_S)
    }

    /// An even selection of the searched flights, cut into blocks.
    fn even(&self, most: (f64, usize), block_s: f64) -> Engine<'_> {
        let Engine { flights, correlation, .. } = self.engine;
        let spans: Vec<Span> = self.engine.spans().collect();
        let cut = blocks(flights, &joined(selection(flights, &spans, most)), block_s);
        let fold = permuted_folds(cut.len(), self.options.seed);
        Engine { flights, blocks: cut, fold, correlation, held: Vec::new() }
    }
}

/// Spans that follow each other as one.
fn joined(spans: Vec<Span>) -> Vec<Span> {
    let mut joined: Vec<Span> = Vec::new();
    for span in spans {
        match joined.last_mut() {
            Some(last) if last.flight == span.flight && last.end == span.start => last.end = span.end,
            _ => joined.push(span),
        }
    }
    joined
}

/// What judges effects.
struct Road<'a> {
    engine: Engine<'a>,
    flips: Flips,
    largest_p: f64,
}

impl Road<'_> {
    /// Leaves out what is needless, the least useful first.
    fn pruned(&self, point: &Point) -> Result<Pruned> {
        let looseness = point.looseness(&self.engine).ok_or_else(undetermined)?;
        let mut pruned = Pruned { absent: Vec::new(), needed: Vec::new(), needless: Vec::new() };
        let mut folds = point.folds(&self.engine, &[]).ok_or_else(undetermined)?;
        let mut base = point.held_out(&self.engine, &folds, &[]).ok_or_else(undetermined)?;
        // Those that were needless when they were last looked at; empty is all.
        let mut doubtful: Vec<usize> = Vec::new();
        // What each was worth when it was last needed.
        let mut worth: BTreeMap<usize, Judged> = BTreeMap::new();
        loop {
            let open = (0..point.optional.len()).filter(|place| !pruned.absent.contains(place));
            let looked: Vec<usize> = if doubtful.is_empty() { open.collect() } else { doubtful.clone() };
            let was_all = doubtful.is_empty();
            let judged = self.judged(point, (&folds, &base), &pruned.absent, &looked).ok_or_else(undetermined)?;
            let (mut needless, needed): (Vec<_>, Vec<_>) = judged.into_iter().partition(|(_, judged)| !self.is_needed(judged));
            needless.iter().for_each(|entry| drop(worth.remove(&entry.0)));
            worth.extend(needed);
            if needless.is_empty() && was_all {
                // Only beside all that are needed does it show what mends the form of another.
                let flaws: Vec<(usize, String)> =
                    worth.iter().filter_map(|(&place, judged)| Some((place, judged.flaw_of(worth.values())?.to_owned()))).collect();
                for (place, other) in flaws {
                    let judged = worth.remove(&place).expect("listed above");
                    needless.push((place, Judged { mends: Some(other), ..judged }));
                }
            }
            needless.sort_by(|left, right| left.1.gain().total_cmp(&right.1.gain()));
            if needless.is_empty() {
                if was_all {
                    pruned.needed = worth.into_values().collect();
                    pruned.needed.sort_by(|left, right| right.gain().total_cmp(&left.gain()));
                    note_looseness(point, &looseness, &mut pruned);
                    return Ok(pruned);
                }
                doubtful.clear();
                continue;
            }
            // What mends a form costs something, and leaves by itself.
            let mut count = if needless.iter().any(|entry| entry.1.mends.is_some()) { 1 } else { needless.len().div_ceil(2) };
            loop {
                let batch: Vec<usize> = needless[..count].iter().map(|entry| entry.0).collect();
                let without: Vec<usize> = pruned.absent.iter().chain(&batch).copied().collect();
                let new_folds =
                    if batch.iter().any(|&place| point.has_locals(place)) { point.folds(&self.engine, &without) } else { None };
                let errors =
                    point.held_out(&self.engine, new_folds.as_ref().unwrap_or(&folds), &without).ok_or_else(undetermined)?;
                let lost: f64 = gains_of(&errors, &base, &PerChannel::splat(true)).iter().sum();
                let each: f64 = needless[..count].iter().map(|entry| entry.1.gain().max(0.0)).sum();
                if count == 1 || lost <= each + SLACK {
                    doubtful = needless[count..].iter().filter(|entry| entry.1.mends.is_none()).map(|entry| entry.0).collect();
                    pruned.needless.extend(needless.drain(..count).map(|entry| entry.1));
                    (pruned.absent, base) = (without, errors);
                    if let Some(new) = new_folds {
                        folds = new;
                    }
                    break;
                }
                count = count.div_ceil(2);
            }
        }
    }

    fn is_needed(&self, judged: &Judged) -> bool {
        judged.largest_fall() >= SMALLEST_FALL && judged.p_value <= self.largest_p
    }

    /// What each of some effects brings beside all that are in.
    fn judged(
        &self,
        point: &Point,
        (folds, base): (&Folds, &Errors),
        absent: &[usize],
        places: &[usize],
    ) -> Option<Vec<(usize, Judged)>> {
        let one = |&place: &usize| Some((place, self.beside(point, (folds, base), absent, place)?));
        #[cfg(feature = "rayon")]
        {
            use rayon::prelude::*;
            places.par_iter().map(one).collect()
        }
        #[cfg(not(feature = "rayon"))]
        places.iter().map(one).collect()
    }

    fn beside(&self, point: &Point, (folds, base): (&Folds, &Errors), absent: &[usize], place: usize) -> Option<Judged> {
        let mut without = absent.to_vec();
        without.push(place);
        let errors = if point.has_locals(place) {
            point.held_out(&self.engine, &point.folds(&self.engine, &without)?, &without)?
        } else {
            point.held_out(&self.engine, folds, &without)?
        };
        let effect = &point.model.effects[point.optional[place]];
        let channels = point.channels(place);
        let gains = gains_of(&errors, base, &PerChannel::splat(true));
        let sum = |errors: &[f64]| errors.iter().sum::<f64>();
        let fall = |channel: Channel| (channel, 1.0 - sum(&base[channel]) / sum(&errors[channel]));
        let by_flight = effect.coefficients.iter().any(|coefficient| coefficient.by_flight.is_some());
        let p_value = match by_flight {
            true => self.flips.p_value_of_sums(&by_flight_of(&self.engine, &gains)),
            false => self.flips.p_value_of_sums(&gains),
        };
        let falls = Channel::ALL.into_iter().filter(|&channel| channels[channel]).map(fall).collect();
        let rests_on = decisive_flight(&self.engine, &gains);
        let name = effect.name.clone();
        Some(Judged {
            effect: name,
            falls,
            p_value,
            gains,
            looseness: f64::INFINITY,
            rests_on,
            by_flight,
            mends: None,
            gave_way_to: None,
            ties: Vec::new(),
        })
    }
}

fn note_looseness(point: &Point, looseness: &[f64], pruned: &mut Pruned) {
    for judged in pruned.needed.iter_mut().chain(&mut pruned.needless) {
        let place = point.optional.iter().position(|&effect| point.model.effects[effect].name == judged.effect);
        judged.looseness = place.map_or(f64::INFINITY, |place| looseness[place]);
    }
}
