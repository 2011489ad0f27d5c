//! What a search tries: the effects of the catalogue that make sense, and the user's own that are switched off, each with the
//! values of its open parameters.

use crate::flight::Flight;
use crate::physics::{Columns, Definition, Effect, Model, Parameter, SPREAD, Wanted, catalogue};

/// What effects that a search puts into a model are marked with.
pub(super) const FOUND: &str = "diagnose";

/// An effect that may be missing.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Identifier: the kind, or the name of a user's effect.
    pub id: String,
    /// What is known about it beforehand; `None` for a user's formula.
    pub definition: Option<&'static Definition>,
    /// With parameters at their origin.
    pub effect: Effect,
    /// One effect for each choice of the open parameters.
    pub variants: Vec<Effect>,
    /// Why it cannot be tried on these flights.
    pub inapplicable: Option<String>,
}

impl Candidate {
    /// Coefficients and open parameters: what a fit can turn. A spread holds numbers back and turns nothing.
    pub fn freedom(&self) -> usize {
        freedom(&self.effect)
    }

    /// Whether its coefficients are properties of each flight.
    pub fn is_by_flight(&self) -> bool {
        self.effect.coefficients.iter().any(|coefficient| coefficient.by_flight.is_some())
    }
}

/// All candidates for a model on these flights.
pub(super) fn candidates(model: &Model, flights: &[Flight]) -> Vec<Candidate> {
    let of_catalogue = catalogue::definitions().filter_map(|definition| {
        let notes = definition.notes.as_ref()?;
        let in_model = model.effects.iter().any(|effect| effect.kind == definition.kind && effect.enabled);
        if in_model || !notes.searched || !notes.vehicles.contains(&model.vehicle) {
            return None;
        }
        let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
        if model.lacks_rotors_of(&effect) {
            return None;
        }
        effect.added_by = Some(FOUND.into());
        let variants = grid(definition, &effect);
        Some((Some(definition), effect, variants))
    });
    let own = model.effects.iter().filter(|effect| !effect.enabled).map(|effect| {
        let effect = Effect { enabled: true, ..effect.clone() };
        (None, effect.clone(), vec![effect])
    });
    of_catalogue
        .chain(own)
        .map(|(definition, effect, variants)| {
            let inapplicable = inapplicable(model, &effect, flights);
            Candidate { id: effect.name.clone(), definition, effect, variants, inapplicable }
        })
        .collect()
}

/// Every combination of the grids of the open parameters; a tied one moves with its master.
fn grid(definition: &Definition, effect: &Effect) -> Vec<Effect> {
    let mut variants = vec![effect.clone()];
    for open in definition.parameters.iter().filter(|parameter| !parameter.grid.is_empty() && parameter.tied_to.is_none()) {
        variants = variants
            .iter()
            .flat_map(|variant| {
                open.grid.iter().map(|&value| {
                    let mut variant = variant.clone();
                    let tied = |name: &str| definition.parameter(name).is_some_and(|other| other.tied_to == Some(open.name));
                    for parameter in variant.parameters.iter_mut().filter(|p| p.name == open.name || tied(&p.name)) {
                        parameter.value = value;
                    }
                    variant
                })
            })
            .collect();
    }
    variants
}

fn inapplicable(model: &Model, effect: &Effect, flights: &[Flight]) -> Option<String> {
    let has = |name: &String| model.effect(name).is_some_and(|effect| effect.enabled);
    if let Some(swap) = effect.swaps.iter().find(|swap| !swap.within.is_empty() && !swap.within.iter().any(has)) {
        return Some(format!("the model has no effect `{}`, which it would change", swap.within.join("` or `")));
    }
    let mut enlarged = model.clone();
    enlarged.effects.retain(|other| other.name != effect.name);
    enlarged.effects.push(effect.clone());
    let mut columns = Columns::default();
    let regressors = match columns.regressors(&enlarged, Wanted::default()) {
        Ok(regressors) => regressors,
        Err(error) => return Some(error.to_string()),
    };
    let missing = regressors
        .iter()
        .find_map(|regressor| flights.iter().find_map(|flight| columns.missing_input(regressor.node, flight).map(str::to_owned)));
    missing.map(|name| format!("the flights or the model do not carry `{name}`"))
}

/// A model with one effect more, at its end; the user's own moves there from where it was switched off.
pub(super) fn with(model: &Model, effect: &Effect) -> Model {
    let mut enlarged = model.clone();
    enlarged.effects.retain(|other| other.name != effect.name);
    enlarged.effects.push(effect.clone());
    enlarged
}

/// Times and shapes of an effect that are found, a spread aside.
pub(super) fn open(effect: &Effect) -> impl Iterator<Item = &Parameter> {
    effect.parameters.iter().filter(|parameter| !parameter.fixed && parameter.name != SPREAD)
}

/// Numbers of an effect that a fit can turn.
pub(super) fn freedom(effect: &Effect) -> usize {
    effect.coefficients.len() + open(effect).count()
}

/// Whether a search put an effect into the model.
pub(super) fn is_found(effect: &Effect) -> bool {
    effect.added_by.as_deref() == Some(FOUND)
}
