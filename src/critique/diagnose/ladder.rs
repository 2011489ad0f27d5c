//! The models between the one that was given and the one with all that was found, by which it shows how the error falls. Nothing is
//! searched or decided here, and no error measured.

use super::candidate::with;
use super::confirm::Rung;
use super::joint::Point;
use super::search::{Found, Search};
use crate::error::{Error, Result};
use crate::physics::Model;

/// Effects that were found at once and have a rung of their own, at most; the others share the last one.
const RUNGS: usize = 9;

/// Steps in which a rung's numbers are fitted, at most, from those of the rung before.
const STEPS: usize = 8;

impl Search<'_> {
    /// The given model, then with one effect after the other as they were found. Effects that were found at once are added by what they
    /// bring, the most first, each time with the numbers of all that are in fitted again, on a part of long flights.
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
        let added: Vec<&str> = found.iter().filter(is_new).map(|found| found.step.effect.as_str()).collect();
        let alone = if added.len() <= RUNGS + 1 { added.len().saturating_sub(1) } else { RUNGS };
        let engine = self.quick();
        let (mut waiting, mut rung) = (Vec::new(), before.clone());
        for effect in added.iter().take(alone) {
            waiting.push((*effect).to_owned());
            // The numbers of the rung before, and the effect with those that it has beside all others.
            rung = with(&rung, last.model.effect(effect).expect("it was found"));
            match Point::fitted(&engine, rung.clone(), STEPS) {
                Ok(model) => {
                    rungs.push((std::mem::take(&mut waiting), model.clone()));
                    rung = model;
                }
                // Where the flights do not determine the others' numbers yet, the effect shares the next rung.
                Err(Error::Undetermined(_)) => {}
                Err(error) => return Err(error),
            }
        }
        waiting.extend(added[alone..].iter().map(|effect| (*effect).to_owned()));
        rungs.push((waiting, last.model.clone()));
        Ok(rungs)
    }
}
