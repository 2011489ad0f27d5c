//! Changes to the model, each a step of the history: effects added, switched, taken out, numbers moved, formulas of the user's own. After a change of
//! its effects the model is calibrated again; a number that is moved by hand stays where it was put.

use super::history::{State, Steps};
use super::trace::{Move, moved_model};
use super::{Studio, fault, held};
use crate::critique::diagnose::{Diagnosis, searched};
use crate::error::{Error, Result};
use crate::flight::Channel;
use crate::physics::{Effect, Model, calibrate, catalogue, signal_named};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What put an effect into a model here, unless a search did.
const ADDED_BY: &str = "studio";

/// What a formula is called while it is tried.
const DRAFT: &str = "formula_being_written";

/// What a formula of the user's own adds to.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Owner {
    /// An acceleration.
    Channel(Channel),
    /// The signal of this name.
    Signal(String),
}

/// A change.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Edit {
    /// Adds an effect: with the numbers of the last search if it found it, else from the catalogue.
    Add {
        /// Identifier.
        effect: String,
    },
    /// Adds everything that the last search found.
    AddAll,
    /// Adds a formula of the user's own.
    Formula {
        /// Name of the effect.
        name: String,
        /// What it adds to.
        owner: Owner,
        /// The formula, without its coefficient.
        formula: String,
    },
    /// Switches an effect on or off.
    Switch {
        /// Effect by name.
        effect: String,
        /// On.
        on: bool,
    },
    /// Takes an effect out of the model.
    Remove {
        /// Effect by name.
        effect: String,
    },
    /// Moves a number by hand; nothing is calibrated.
    Move(Move),
    /// Calibrates.
    Calibrate,
}

/// What is wrong with a formula, if anything.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FormulaCheck {
    /// What is wrong; absent if nothing is.
    pub message: Option<String>,
    /// The character (from 0) that it is about, where it is about one.
    pub at: Option<usize>,
    /// What a person should know of a formula that is right.
    pub caution: Option<String>,
}

impl Studio {
    /// Makes a change, and tells the history with it.
    ///
    /// # Errors
    /// [`Error::Config`] where what is named is not there, or there already; [`Error::Formula`] pointing at the character; as [`calibrate`]. The
    /// model is then as before.
    pub fn edit(&self, edit: &Edit) -> Result<Steps> {
        {
            let _one_at_a_time = held(&self.changing);
            let changed = self.changed(edit)?;
            let (id, mut path) = {
                let mut history = held(&self.history);
                (history.new_id(), history.path())
            };
            let state = Arc::new(State { id, ..changed });
            path.push(Arc::clone(&state));
            // What cannot be judged, such as a formula that is no number in some flight, is no step.
            self.judge.path(&self.set, &self.split, &path)?;
            held(&self.history).push(state);
            self.keep();
        }
        self.steps()
    }

    /// The state after a change.
    fn changed(&self, edit: &Edit) -> Result<State> {
        let now = self.now();
        let mut model = now.model.clone();
        let mut found = None;
        let did = match edit {
            Edit::Add { effect } => {
                let (did, by) = self.add(&mut model, effect)?;
                found = by;
                did
            }
            Edit::AddAll => {
                let outcome = self.outcome().ok_or_else(|| fault("add_all", "no search", "a finished search; start one first"))?;
                let open: Vec<String> = outcome.0.accepted.iter().filter(|name| !is_on(&model, name)).cloned().collect();
                if open.is_empty() {
                    return Err(fault("add_all", "nothing", "an effect that the last search found and the model does not have"));
                }
                for name in &open {
                    found = self.add(&mut model, name)?.1;
                }
                format!("added {}", open.join(", "))
            }
            Edit::Formula { name, owner, formula } => {
                model.effects.push(own_effect(&model, name, owner, formula)?);
                self.check_inputs(&model, formula)?;
                format!("added the formula {name}")
            }
            Edit::Switch { effect, on } => {
                known(&mut model, effect)?.enabled = *on;
                format!("{effect} {}", if *on { "on" } else { "off" })
            }
            Edit::Remove { effect } => {
                known(&mut model, effect)?;
                model.effects.retain(|known| known.name != *effect);
                format!("took {effect} out")
            }
            Edit::Move(moved) => {
                let model = moved_model(&model, moved)?;
                let did = format!(
                    "{} of {} moved to {}",
                    moved.number,
                    moved.effect,
                    crate::critique::digits::significant(moved.value, 4)
                );
                return Ok(State { id: 0, did, model, calibration: None, found: None });
            }
            Edit::Calibrate => "calibrated".to_owned(),
        };
        let (model, calibration) = self.calibrated(&model)?;
        Ok(State { id: 0, did, model, calibration: Some(calibration), found })
    }

    /// The model with its numbers fitted on what may be fitted on; what is switched off stays as it is.
    fn calibrated(&self, model: &Model) -> Result<(Model, crate::physics::Calibration)> {
        calibrate(model, &self.set.flights, &searched(&self.split))
    }

    /// Adds an effect; what was done, and the search that had found it.
    fn add(&self, model: &mut Model, name: &str) -> Result<(String, Option<Arc<Diagnosis>>)> {
        if is_on(model, name) {
            return Err(fault("effect", format!("`{name}`, which is in the model"), "an effect that is not"));
        }
        let of_search = self.outcome().and_then(|(diagnosis, found)| Some((found.effect(name)?.clone(), diagnosis)));
        let of_search = of_search.filter(|(_, diagnosis)| diagnosis.accepted.iter().any(|accepted| accepted == name));
        let (effect, found) = match of_search {
            Some((effect, diagnosis)) => (effect, Some(diagnosis)),
            None => (of_catalogue(model, name)?, None),
        };
        model.effects.retain(|known| known.name != name);
        model.effects.push(Effect { enabled: true, ..effect });
        if !model.acts(model.effects.len() - 1)?.values().contains(&true) {
            return Err(fault(
                "effect",
                format!("`{name}`, which changes nothing here"),
                "an effect whose signals some effect of the model reads",
            ));
        }
        Ok((format!("added {name}"), found))
    }

    /// Refuses a formula that reads what the flights do not carry, pointing at the character; tries the model on one flight.
    fn check_inputs(&self, model: &Model, formula: &str) -> Result<()> {
        let Some(flight) = self.set.flights.first() else { return Ok(()) };
        match model.predict(flight) {
            // Of a formula that became part of another, the place is found again in what was written.
            Err(Error::Formula { message, formula: whole, at }) if whole != formula => {
                let at = whole.find(formula).and_then(|start| at.checked_sub(whole[..start].chars().count()));
                Err(Error::Formula { message, formula: formula.into(), at: at.unwrap_or(0) })
            }
            tried => tried.map(drop),
        }
    }

    /// Whether a formula could be added, without adding it.
    pub fn check_formula(&self, owner: &Owner, formula: &str) -> FormulaCheck {
        let mut model = self.now().model.clone();
        let tried = own_effect(&model, DRAFT, owner, formula).and_then(|effect| {
            let caution = effect.caution();
            model.effects.push(effect);
            self.check_inputs(&model, formula)?;
            Ok(caution)
        });
        match tried {
            Ok(caution) => FormulaCheck { caution, ..FormulaCheck::default() },
            Err(Error::Formula { message, at, .. }) => {
                let message = message.strip_prefix(&format!("effect `{DRAFT}`: ")).unwrap_or(&message).to_owned();
                FormulaCheck { message: Some(message), at: Some(at), caution: None }
            }
            Err(error) => FormulaCheck { message: Some(error.to_string()), ..FormulaCheck::default() },
        }
    }
}

/// Whether an effect takes part in a model.
fn is_on(model: &Model, name: &str) -> bool {
    model.effect(name).is_some_and(|effect| effect.enabled)
}

/// An effect of the model.
fn known<'a>(model: &'a mut Model, name: &str) -> Result<&'a mut Effect> {
    model.effect_mut(name).ok_or_else(|| fault("effect", format!("`{name}`"), "an effect of the model"))
}

/// An effect of the catalogue that makes sense for the model's vehicle.
fn of_catalogue(model: &Model, name: &str) -> Result<Effect> {
    let definition =
        catalogue::definition(name).ok_or_else(|| fault("effect", format!("`{name}`"), "an effect of the catalogue"))?;
    if definition.notes.is_some_and(|notes| !notes.vehicles.contains(&model.vehicle)) {
        return Err(fault("effect", format!("`{name}`"), format!("an effect that makes sense for a {}", model.vehicle.name())));
    }
    Ok(Effect { added_by: Some(ADDED_BY.into()), ..definition.effect(model.mass_kg, model.rotor_radius_m) })
}

/// An effect of the user's own.
fn own_effect(model: &Model, name: &str, owner: &Owner, formula: &str) -> Result<Effect> {
    let is_name = |name: &str| {
        name.starts_with(|first: char| first.is_ascii_lowercase())
            && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    };
    if !is_name(name) {
        return Err(fault("name", format!("`{name}`"), "small letters, digits and `_`, a letter first"));
    }
    if model.effect(name).is_some() || catalogue::definition(name).is_some() {
        return Err(fault("name", format!("`{name}`, the name of an effect"), "a name that no effect has"));
    }
    let effect = match owner {
        Owner::Channel(channel) => Effect::formula(name, *channel, formula, 0.0)?,
        Owner::Signal(signal) if signal_named(signal).is_some() => Effect::change(name, signal, formula, 0.0)?,
        Owner::Signal(signal) => return Err(fault("signal", format!("`{signal}`"), "a signal of the model")),
    };
    Ok(Effect { added_by: Some(ADDED_BY.into()), ..effect })
}
