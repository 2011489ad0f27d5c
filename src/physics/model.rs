//! The physical model: a list of effects, the aircraft's geometry, and what is known about the data it fits. How it is written
//! to a file is in `model_file`; how its numbers are found, in `calibrate`.

use super::baseline;
use super::correlation::Correlation;
use super::definition::Vehicle;
use super::effect::Effect;
use super::rotors::{MOST_ROTORS, Rotor};
use super::vehicle::{self, Assumed};
use crate::error::{Error, Result};
use crate::flight::split::Protocol;
use crate::flight::{Flight, Source, names};
use std::collections::BTreeMap;

/// A value of the free table `[provenance]`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Entry {
    /// Text; dates are kept as text.
    Text(String),
    /// Whole number.
    Integer(i64),
    /// Number.
    Number(f64),
    /// Yes or no.
    Boolean(bool),
    /// List.
    List(Vec<Self>),
    /// Table.
    Table(BTreeMap<String, Self>),
}

/// What is known about the data.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ModelData {
    /// Time from a recorded control to its effect, s, at least 0: controls enter every term as `delay(u, control_delay_s)`. A
    /// control that is held over a step acts half a step before a derivative that is centred on the sample.
    pub control_delay_s: f64,
    /// Manoeuvre classes or flights that no search may see.
    pub locked: Vec<String>,
    /// How the flights are divided where none is locked.
    pub split: Protocol,
}

/// A first-principles model of an unmanned helicopter: predicted acceleration = sum of the terms of its enabled effects.
///
/// # Examples
/// ```
/// use phyture::flight::Channel;
/// use phyture::physics::{Effect, Model};
///
/// let mut model = Model::paper("helicopter", 8.1, [0.18, 0.34, 0.28], 0.78);
/// model.effects.push(Effect::formula("tail_in_wake", Channel::WyDot, "exp(-((vx - 7) / 2)^2)", 1.5)?);
/// let added = model.effect("tail_in_wake").expect("it was just added");
/// assert_eq!(added.to_string(), "wy_dot += 1.5 rad/s² per unit * (exp(-((vx - 7) / 2)^2))");
/// # Ok::<(), phyture::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Model {
    /// Name of the aircraft or of the model.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Diagonal of the inertia tensor about body x, y, z, kg m²; only ratios matter to the baseline.
    pub inertia: [f64; 3],
    /// Rotor radius, m.
    pub rotor_radius_m: f64,
    /// What kind of aircraft it is: which effects of the catalogue make sense.
    #[serde(default)]
    pub vehicle: Vehicle,
    /// The rotors one by one, for effects that sum over them; none for a helicopter's main and tail rotor, which the signals stand for.
    #[serde(default)]
    pub rotors: Vec<Rotor>,
    /// Which of these numbers nobody gave: they are then those of the paper's aircraft.
    #[serde(default)]
    pub assumed: Assumed,
    /// Effects, in the order in which they are summed.
    pub effects: Vec<Effect>,
    /// How the errors of the numbers go together, beside their intervals.
    #[serde(default)]
    pub correlations: Vec<Correlation>,
    /// What is known about the data.
    pub data: ModelData,
    /// Where the numbers come from; free form.
    pub provenance: BTreeMap<String, Entry>,
}

impl Model {
    /// Names of the model's own numbers, usable in every formula: `mass_kg`, `ix iy iz` (kg m²), `rotor_radius_m`,
    /// `control_delay_s`. They come before a further column of the log of the same name.
    pub const CONSTANTS: [&'static str; 6] = ["mass_kg", "ix", "iy", "iz", "rotor_radius_m", "control_delay_s"];

    /// The paper's baseline (eqs. 14-15) with all coefficients zero and no control delay.
    ///
    /// Mass in kg, diagonal inertia in kg m² (ratios matter), rotor radius in m.
    pub fn paper(name: impl Into<String>, mass_kg: f64, inertia: [f64; 3], rotor_radius_m: f64) -> Self {
        Self {
            name: name.into(),
            mass_kg,
            inertia,
            rotor_radius_m,
            vehicle: Vehicle::default(),
            rotors: Vec::new(),
            assumed: Assumed::default(),
            effects: baseline::definitions().iter().map(|definition| definition.effect(mass_kg, rotor_radius_m)).collect(),
            correlations: Vec::new(),
            data: ModelData::default(),
            provenance: BTreeMap::new(),
        }
    }

    /// An effect by name.
    pub fn effect(&self, name: &str) -> Option<&Effect> {
        self.effects.iter().find(|effect| effect.name == name)
    }

    /// An effect by name, to change it.
    pub fn effect_mut(&mut self, name: &str) -> Option<&mut Effect> {
        self.effects.iter_mut().find(|effect| effect.name == name)
    }

    /// Notes under `[provenance]` what its numbers come from: the data, the flights of these that were left out, the seed of the split, the version.
    pub fn note_source(&mut self, source: &Source, seed: u64) {
        let mut note = |key: &str, entry: Entry| self.provenance.insert(key.into(), entry);
        note("data_sha256", Entry::Text(source.sha256.clone()));
        note("seed", Entry::Text(seed.to_string()));
        note("version", Entry::Text(env!("CARGO_PKG_VERSION").into()));
        let left_out = source.left_out.iter().cloned().map(Entry::Text).collect();
        // A model that was calibrated before may have left out others.
        if source.left_out.is_empty() {
            self.provenance.remove("left_out")
        } else {
            self.provenance.insert("left_out".into(), Entry::List(left_out))
        };
    }

    /// The model for flights that it does not know: what belongs to single flights (wind, biases) is at the value of any other.
    #[must_use]
    pub fn of_unknown_flights(&self) -> Self {
        let mut model = self.clone();
        let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
        coefficients.filter_map(|coefficient| coefficient.by_flight.as_mut()).for_each(BTreeMap::clear);
        model
    }

    /// Refuses numbers by flight whose names could mean several of these flights: a model file may name a flight by the last part of its
    /// path, where only one flight has that.
    ///
    /// # Errors
    /// [`Error::Config`] with the flights that could be meant.
    pub fn check_flights(&self, flights: &[Flight]) -> Result<()> {
        let coefficients = self.effects.iter().flat_map(|effect| effect.coefficients.iter().map(move |found| (effect, found)));
        for (effect, values) in coefficients.filter_map(|(effect, found)| Some((effect, found.by_flight.as_ref()?))) {
            let keys = || values.keys().map(String::as_str);
            let fault = |name: &str, meant: Vec<&str>| Error::Config {
                place: format!("model `{}`, effect `{}`", self.name, effect.name),
                field: format!("flights.{name}"),
                found: format!("a name that could mean {}", names::listed(meant.into_iter())),
                expected: "the path of one flight below the data, as in `hover/flight_0`; calibrate anew, or write the paths"
                    .into(),
            };
            for key in keys() {
                let meant = names::find(flights, key);
                if meant.len() > 1 {
                    return Err(fault(key, meant.into_iter().map(|flight| flights[flight].name.as_str()).collect()));
                }
            }
            for flight in flights {
                let meant = names::matching(&flight.name, keys());
                if meant.len() > 1 {
                    return Err(fault(&flight.name, meant));
                }
            }
        }
        Ok(())
    }

    /// Checks that the model is whole: mass, inertia and rotor that an unmanned aircraft can have, a delay that is not negative, effects with names of their own.
    ///
    /// # Errors
    /// [`Error::Config`] or [`Error::Formula`] naming what is wrong.
    pub fn check(&self) -> Result<()> {
        self.check_in(&format!("model `{}`", self.name))
    }

    /// As [`Model::check`], naming `place` in errors.
    pub(super) fn check_in(&self, place: &str) -> Result<()> {
        let fault = |field: &str, found: String, expected: &str| {
            Err(Error::Config { place: place.into(), field: field.into(), found, expected: expected.into() })
        };
        if let Some(vehicle::Fault { field, found, expected }) = vehicle::fault(self.mass_kg, self.inertia, self.rotor_radius_m) {
            return fault(field, found, &expected);
        }
        let delay_s = self.data.control_delay_s;
        if !(0.0..=1.0).contains(&delay_s) {
            return fault("data.control_delay_s", delay_s.to_string(), "0 to 1 s; a model cannot act before its control");
        }
        if self.rotors.len() > MOST_ROTORS {
            return fault("rotor", format!("{} rotors", self.rotors.len()), &format!("at most {MOST_ROTORS}"));
        }
        for (index, rotor) in self.rotors.iter().enumerate() {
            if let Some((key, found, expected)) = rotor.fault(&|name| self.constant(name)) {
                return fault(&format!("rotor {}, {key}", index + 1), found, &expected);
            }
        }
        if let Some(effect) = self.effects.iter().find(|effect| effect.enabled && self.lacks_rotors_of(effect)) {
            let found = format!("nothing, and effect `{}` sums over rotors", effect.name);
            return fault("rotor", found, "a table `[[rotor]]` for each: speed (rad/s, a formula of columns), position_m, turns");
        }
        for (index, effect) in self.effects.iter().enumerate() {
            effect.check(place)?;
            if self.effects.iter().take(index).any(|earlier| earlier.name == effect.name) {
                return fault("effect", format!("`{}` twice", effect.name), "effects with names of their own; set `name`");
            }
        }
        Ok(())
    }

    /// Whether an effect sums over rotors and none are listed.
    pub fn lacks_rotors_of(&self, effect: &Effect) -> bool {
        self.rotors.is_empty() && effect.reads_rotors()
    }

    /// One of the model's own numbers by name.
    pub(super) fn constant(&self, name: &str) -> Option<f64> {
        let [ix, iy, iz] = self.inertia;
        let values = [self.mass_kg, ix, iy, iz, self.rotor_radius_m, self.data.control_delay_s];
        Self::CONSTANTS.into_iter().zip(values).find(|known| known.0 == name).map(|known| known.1)
    }

    /// Whether formulas of an effect may read this name as a number: one of its own, of the model's, or the coefficient of an enabled
    /// effect.
    pub fn gives(&self, effect: &Effect, name: &str) -> bool {
        effect.number_named(name).is_some() || self.constant(name).is_some() || self.coefficient_named(name).is_some()
    }

    /// The coefficient that formulas call `<effect>_<coefficient>`: indices of the effect and of the coefficient in it.
    pub(super) fn coefficient_named(&self, name: &str) -> Option<(usize, usize)> {
        self.effects.iter().enumerate().filter(|(_, effect)| effect.enabled).find_map(|(index, effect)| {
            let coefficient = name.strip_prefix(effect.name.as_str())?.strip_prefix('_')?;
            Some((index, effect.coefficients.iter().position(|known| known.name == coefficient)?))
        })
    }
}
