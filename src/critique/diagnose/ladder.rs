//! The models between the one that was given and the one with all that was found, by which it shows how the error falls. Nothing is
//! searched or decided here, and no error measured.

use super::confirm::Rung;
use super::joint::Point;
use super::search::{Found, Search};
use crate::error::{Error, Result};
use crate::physics::Model;

/// Effects that were found at once and have a rung of their own, at most; the others share the last one.
const RUNGS: usize = 9;

/// Steps in which a rung's numbers are fitted, at most, from where they are best beside all others.
const STEPS: usize = 4;

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
        let place = |name: &&str| last.model.effects.iter().position(|effect| effect.name == **name);
        let point = Point::at(&engine, last.model.clone(), added.iter().filter_map(place).collect())?;
        let mut waiting: Vec<String> = Vec::new();
        for (index, effect) in added.iter().enumerate().take(alone) {
            waiting.push((*effect).to_owned());
            let absent: Vec<usize> = (index + 1..added.len()).collect();
            // Where the flights do not determine the others without all these, the effect shares the next rung.
            let Some(model) = point.without(&engine, &absent) else { continue };
            match Point::fitted(&engine, model, STEPS) {
                Ok(model) => rungs.push((std::mem::take(&mut waiting), model)),
                Err(Error::Undetermined(_)) => {}
                Err(error) => return Err(error),
            }
        }
        waiting.extend(added[alone..].iter().map(|effect| (*effect).to_owned()));
        rungs.push((waiting, last.model.clone()));
        Ok(rungs)
    }
}
