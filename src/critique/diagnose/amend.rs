//! The loop: diagnose, add what is confirmed, calibrate, until nothing worthwhile is left. No file is written here: the caller is
//! told of every round.

use super::report::Step;
use super::suggest::{is_suggested, standing};
use super::{Diagnosis, Options, diagnose};
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{Flight, Span};
use crate::physics::{Effect, Model, calibrate, catalogue, doubt};

/// Rounds before the loop stops by itself.
const MOST_ROUNDS: usize = 4;

/// What the loop did.
pub struct Amended {
    /// Diagnoses, one a round; the last found nothing more.
    pub rounds: Vec<Diagnosis>,
    /// The calibrated model with all that was added.
    pub model: Model,
    /// Whether [`Options::watch`] stopped it after these rounds, before nothing more was found.
    pub stopped: bool,
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
    diagnosis.steps.iter_mut().for_each(|step| numbers_of(step, model));
}

/// The same for one effect.
pub(super) fn numbers_of(step: &mut Step, model: &Model) {
    let Some(effect) = model.effect(&step.effect) else { return };
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

/// Diagnoses, adds and calibrates until nothing is found that the confirming flights confirm. `told` hears of every round, from 1,
/// and may add to its diagnosis. Effects that are switched off stay in the model, switched off, unless they were found.
///
/// With [`Options::formulas`], once the catalogue has no more to give, formulas that the rest of the error suggests and the confirming flights
/// bear out are tried as effects are, by themselves and beside all that was found.
///
/// # Errors
/// As [`diagnose`], but for a stop after a round that added something, whose findings are kept; what `told` gives.
pub fn amend(
    flights: &[Flight],
    model: &Model,
    split: &Split,
    options: &Options,
    told: &mut dyn FnMut(usize, &mut Diagnosis) -> Result<()>,
) -> Result<Amended> {
    let off: Vec<_> = model.effects.iter().filter(|effect| !effect.enabled).cloned().collect();
    let given = |effect: &Effect| off.iter().any(|known| known.name == effect.name);
    let mut model = calibrated(model, flights, split)?;
    model.effects.extend(off.iter().cloned());
    let mut rounds: Vec<Diagnosis> = Vec::new();
    let mut options = options.clone();
    let (mut at_once, mut of_formulas, mut stopped) = (false, false, false);
    for round in 1..=MOST_ROUNDS {
        let mut outcome = match diagnose(flights, &model, &searched(split), &split.test, split.tested.name(), &options) {
            Err(Error::Interrupted { .. }) if rounds.iter().any(Diagnosis::is_confirmed) => {
                stopped = true;
                break;
            }
            outcome => outcome?,
        };
        let confirmed = outcome.diagnosis.is_confirmed();
        at_once |= outcome.diagnosis.both_roads;
        if confirmed {
            let still_off = |effect: &&Effect| !effect.enabled && outcome.model.effect(&effect.name).is_none();
            let off: Vec<_> = model.effects.iter().filter(still_off).cloned().collect();
            // Where everything was fitted at once, it is calibrated, with what is known of the numbers beforehand.
            model = if at_once { outcome.model } else { calibrated(&outcome.model, flights, split)? };
            as_in_the_model(&mut outcome.diagnosis, &model);
            model.effects.extend(off);
        }
        told(round, &mut outcome.diagnosis)?;
        let suggested = match &outcome.diagnosis.unknown {
            Some(unknown) if options.formulas && (confirmed || !of_formulas) => standing(unknown, &model)?,
            _ => Vec::new(),
        };
        // Everything that applies has then been judged beside everything else.
        let is_last = !confirmed || outcome.diagnosis.both_roads || of_formulas;
        rounds.push(outcome.diagnosis);
        if is_last && suggested.is_empty() {
            break;
        }
        if is_last {
            of_formulas = true;
            options.without = others_than(&suggested, &model);
            model.effects.extend(suggested);
        }
    }
    // A formula that was tried and not taken is no wish of the user's.
    model.effects.retain(|effect| effect.enabled || given(effect) || !is_suggested(&effect.name));
    Ok(Amended { rounds, model, stopped })
}

/// All candidates but these.
fn others_than(suggested: &[Effect], model: &Model) -> Vec<String> {
    let off = model.effects.iter().filter(|effect| !effect.enabled).map(|effect| effect.name.clone());
    let known = catalogue::kinds().map(str::to_owned).chain(off);
    known.filter(|name| suggested.iter().all(|effect| effect.name != *name)).collect()
}
