//! The models between the one that was given and the one with all that was found, by which it shows how the error falls. Nothing is
//! searched or decided here, and no error measured on flights that are kept.

use super::candidate::with;
use super::confirm::Rung;
use super::engine::Engine;
use super::found::Found;
use super::gates::BLOCK_S;
use super::joint::{Moving, Point};
use super::own::{Halves, judged_errors};
use super::search::Search;
use super::selection::selection;
use crate::error::{Error, Result};
use crate::flight::{Channel, Span};
use crate::physics::{Effect, Model};

/// Effects that were found at once and have a rung of their own, at most; the others share the last one.
const RUNGS: usize = 9;

/// Effects that are tried for a rung, at most.
const TRIES: usize = 6;

/// Time of flight by which they are judged, s, and flights at least.
const JUDGED: (f64, usize) = (700.0, 10);

/// By how much the error of an acceleration may rise from rung to rung there: numbers that several share give a little.
const LARGEST_RISE: f64 = 1e-3;

/// Steps in which a rung's numbers are fitted, at most, from those of the rung before.
const STEPS: usize = 8;

/// Where the models on the way are fitted, and the flights that judge them, others where there are others.
struct Ground<'a> {
    fitted: Engine<'a>,
    judged: Vec<Span>,
}

impl Ground<'_> {
    /// A model with one effect more, from the numbers that it has beside all others: with the numbers of all that act on the same accelerations
    /// fitted again, or its own alone. `None` where both raise the error of some acceleration: numbers that must do for what is missing yet
    /// are bent.
    fn step(&self, model: &Model, effect: &Effect) -> Result<Option<Model>> {
        let name = effect.name.as_str();
        for moving in [Moving::Beside(name), Moving::Own(name)] {
            match Point::fitted_in(&self.fitted, with(model, effect), moving, STEPS) {
                Ok(next) if !self.rises(model, &next)? => return Ok(Some(next)),
                // Or the flights do not determine the others' numbers yet.
                Ok(_) | Err(Error::Undetermined(_)) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    fn rises(&self, before: &Model, after: &Model) -> Result<bool> {
        let Engine { flights, correlation, .. } = self.fitted;
        let models = [before, after];
        let halves = Halves::of(flights, &models, &self.judged);
        let judged = judged_errors(flights, &models, &halves, BLOCK_S, correlation)?;
        let sum = |errors: &[f64]| errors.iter().sum::<f64>();
        let higher = |[before, after]: [&Vec<f64>; 2]| sum(after) > (1.0 + LARGEST_RISE) * sum(before);
        Ok(judged.is_some_and(|judged| {
            Channel::ALL.into_iter().any(|channel| higher([&judged.errors[0][channel], &judged.errors[1][channel]]))
        }))
    }
}

impl Search<'_> {
    fn ground(&self) -> Ground<'_> {
        let fitted = self.quick();
        let is_other = |span: &Span| fitted.blocks.iter().all(|block| block.flight != span.flight);
        let others: Vec<Span> = self.engine.spans().filter(is_other).collect();
        let judged = if others.is_empty() { fitted.spans().collect() } else { selection(fitted.flights, &others, JUDGED) };
        Ground { fitted, judged }
    }

    /// The given model, then with one effect after the other as they were found. Effects that were found at once are added by what they
    /// bring, the most first, on a part of long flights; one that would raise the error of some acceleration waits until others are in, and what
    /// is left at the end comes in together.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub(super) fn ladder(&self, before: &Model, found: &[Found], at_once: bool) -> Result<Vec<Rung>> {
        let mut rungs: Vec<Rung> = vec![(Vec::new(), before.clone())];
        let Some(last) = found.last() else { return Ok(rungs) };
        if !at_once {
            rungs.extend(found.iter().map(|found| (vec![found.step.effect.clone()], found.model.clone())));
            return Ok(rungs);
        }
        let is_new = |found: &&Found| before.effect(&found.step.effect).is_none();
        let in_the_end = |found: &Found| last.model.effect(&found.step.effect).expect("it was found");
        let mut waiting: Vec<&Effect> = found.iter().filter(is_new).map(in_the_end).collect();
        let ground = self.ground();
        let mut model = before.clone();
        while waiting.len() > 1 && rungs.len() <= RUNGS {
            let tried = waiting.iter().take(TRIES).enumerate();
            let steps = tried.filter_map(|(place, effect)| Some((place, ground.step(&model, effect).transpose()?)));
            let Some((place, next)) = { steps }.next() else { break };
            model = next?;
            rungs.push((vec![waiting.remove(place).name.clone()], model.clone()));
        }
        rungs.push((waiting.iter().map(|effect| effect.name.clone()).collect(), last.model.clone()));
        Ok(rungs)
    }
}
