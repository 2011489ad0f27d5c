//! The loop: diagnose, add what is confirmed, calibrate, until nothing worthwhile is left. No file is written here: the caller is
//! told of every round.

use super::{Diagnosis, Options, diagnose};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{Flight, Span};
use crate::physics::{Effect, Model, calibrate, doubt};

/// Rounds before the loop stops by itself.
const MOST_ROUNDS: usize = 4;

/// What the loop did.
pub struct Amended {
    /// Diagnoses, one a round; the last found nothing more.
    pub rounds: Vec<Diagnosis>,
    /// The calibrated model with all that was added.
    pub model: Model,
}

/// What a search reads of a split: everything but the part that confirms.
pub fn searched(split: &Split) -> Vec<Span> {
    split.training.iter().chain(&split.validation).copied().collect()
}

/// The model without what is switched off, calibrated on what is searched; as it stands if the flights do not determine its
/// coefficients.
///
/// # Errors
/// As [`calibrate`], but for coefficients that the flights do not determine.
pub fn calibrated(model: &Model, flights: &[Flight], split: &Split) -> Result<Model> {
    let mut model = model.clone();
    model.effects.retain(|effect| effect.enabled);
    match calibrate(&model, flights, &searched(split)) {
        Err(Error::Undetermined(_)) => Ok(model),
        calibrated => Ok(calibrated?.0),
    }
}

/// Puts the numbers of the model that goes on into what is said of its effects: one coefficient, one value, and that of the model
/// file. A property of each flight keeps its mean.
pub(super) fn as_in_the_model(diagnosis: &mut Diagnosis, model: &Model) {
    for step in &mut diagnosis.steps {
        let Some(effect) = model.effect(&step.effect) else { continue };
        for number in &mut step.coefficients {
            let Some(coefficient) = effect.coefficient(&number.name) else { continue };
            (number.value, number.ci95) = (coefficient.value, coefficient.ci95.or(number.ci95));
            number.sign = doubt(effect, coefficient).map(|doubt| doubt.finding);
        }
        for value in &mut step.parameters {
            let known = effect.parameters.iter().find(|parameter| parameter.name == value.name);
            value.value = known.map_or(value.value, |known| known.value);
            value.profile = known.and_then(|known| known.ci95).or(value.profile);
        }
        step.formula = effect.to_string();
    }
}

/// Diagnoses, adds and calibrates until nothing is found that the confirming flights confirm. `told` hears of every round, from 1,
/// and may add to its diagnosis. Effects that are switched off stay in the model, switched off, unless they were found.
///
/// # Errors
/// As [`diagnose`]; what `told` gives.
pub fn amend(
    flights: &[Flight],
    model: &Model,
    split: &Split,
    options: &Options,
    told: &mut dyn FnMut(usize, &mut Diagnosis) -> Result<()>,
) -> Result<Amended> {
    let off: Vec<_> = model.effects.iter().filter(|effect| !effect.enabled).cloned().collect();
    let mut model = calibrated(model, flights, split)?;
    model.effects.extend(off);
    let mut rounds = Vec::new();
    for round in 1..=MOST_ROUNDS {
        let mut outcome = diagnose(flights, &model, &searched(split), &split.test, split.tested.name(), options)?;
        let confirmed = outcome.diagnosis.is_confirmed();
        if confirmed {
            let still_off = |effect: &&Effect| !effect.enabled && outcome.model.effect(&effect.name).is_none();
            let off: Vec<_> = model.effects.iter().filter(still_off).cloned().collect();
            // Where everything was fitted at once, it is calibrated, with what is known of the numbers beforehand.
            model = if outcome.diagnosis.both_roads { outcome.model } else { calibrated(&outcome.model, flights, split)? };
            as_in_the_model(&mut outcome.diagnosis, &model);
            model.effects.extend(off);
        }
        told(round, &mut outcome.diagnosis)?;
        // Everything that applies has then been judged beside everything else.
        let is_last = !confirmed || outcome.diagnosis.both_roads;
        rounds.push(outcome.diagnosis);
        if is_last {
            break;
        }
    }
    Ok(Amended { rounds, model })
}
