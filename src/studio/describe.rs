//! What there is: flights, channels, variables, and the model with its effects and numbers, for a person to read.

use super::judge::PartWanted;
use super::{Studio, history::State};
use crate::critique::locate::Variable;
use crate::error::Result;
use crate::flight::{Column, Flight, Targets};
use crate::physics::{Calibration, Effect, SIGNALS, catalogue, standard_names};
use serde::Serialize;

/// Everything that does not change while a studio is open.
#[derive(Clone, Debug, Serialize)]
pub struct Overview {
    /// Version of the program.
    pub version: &'static str,
    /// Where the flights were read from.
    pub data: String,
    /// Time of all flights, s.
    pub duration_s: f64,
    /// Time of what is fitted on, and of what judges, s.
    pub parts_s: [f64; 2],
    /// What judges, in words.
    pub judging: String,
    /// Flights.
    pub flights: Vec<FlightText>,
    /// The six accelerations.
    pub channels: Vec<ChannelText>,
    /// Variables over which residuals are shown.
    pub variables: Vec<[&'static str; 2]>,
    /// Names that formulas may read on every log: columns and derived quantities.
    pub names: Vec<String>,
    /// Signals that formulas may read and change: name, unit, meaning.
    pub signals: Vec<[&'static str; 3]>,
    /// What the check of the log says.
    pub check: String,
    /// Whether the log is not what the program takes it for.
    pub fault: bool,
}

/// A flight.
#[derive(Clone, Debug, Serialize)]
pub struct FlightText {
    /// Name.
    pub name: String,
    /// Manoeuvre class.
    pub manoeuvre: String,
    /// Length, s.
    pub duration_s: f64,
    /// Step, s.
    pub step_s: f64,
    /// Whether its accelerations were derived from velocity and rates.
    pub derived: bool,
    /// Share of its samples that judges.
    pub judges: f64,
}

/// An acceleration.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelText {
    /// Symbol.
    pub symbol: &'static str,
    /// Name in words.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
}

/// Names of the accelerations in words, in the order of [`Column::TARGETS`].
const CHANNELS: [&str; 6] = [
    "forward acceleration",
    "sideways acceleration",
    "vertical acceleration",
    "roll acceleration",
    "pitch acceleration",
    "yaw acceleration",
];

/// The model of a state.
#[derive(Clone, Debug, Serialize)]
pub struct ModelText {
    /// Name.
    pub name: String,
    /// Mass, rotor radius and inertia in words.
    pub vehicle: String,
    /// Identifier of its state.
    pub state: u64,
    /// Effects in the order of the model.
    pub effects: Vec<EffectText>,
    /// Effects of the catalogue that are not in it and make sense for its vehicle: identifier and meaning.
    pub addable: Vec<[String; 2]>,
    /// The calibration of its numbers, if they come from one.
    pub calibration: Option<Calibration>,
    /// Doubts about signs, in words.
    pub doubts: Vec<String>,
    /// The model file as text.
    pub toml: Option<String>,
}

/// An effect.
#[derive(Clone, Debug, Serialize)]
pub struct EffectText {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: String,
    /// The physics in a sentence.
    pub meaning: String,
    /// With its numbers in place.
    pub formula: String,
    /// Whether it takes part.
    pub enabled: bool,
    /// Whether it is of the baseline.
    pub baseline: bool,
    /// What put it there.
    pub added_by: Option<String>,
    /// Its numbers.
    pub numbers: Vec<NumberText>,
}

/// A number of an effect.
#[derive(Clone, Debug, Serialize)]
pub struct NumberText {
    /// Name.
    pub name: String,
    /// What it stands for.
    pub meaning: String,
    /// Value; of a property of each flight the mean.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// Usual values for a 5 kg helicopter.
    pub usual: Option<[f64; 2]>,
    /// Values that physics allows; an open end is absent.
    pub bounds: [Option<f64>; 2],
    /// Ends of a slider.
    pub slider: [f64; 2],
    /// Known beforehand: geometry.
    pub fixed: bool,
    /// Flights that have a value of their own, and the least and the largest of these.
    pub by_flight: Option<(usize, f64, f64)>,
}

impl Studio {
    /// What does not change.
    pub fn overview(&self) -> Overview {
        let seconds = |spans: &[crate::flight::Span]| -> f64 {
            spans.iter().map(|span| (span.end - span.start) as f64 * self.set.flights[span.flight].step_s).sum()
        };
        let fitted = seconds(&self.split.training) + seconds(&self.split.validation);
        let text = |(index, flight): (usize, &Flight)| {
            let judged: usize = self.split.test.iter().filter(|span| span.flight == index).map(|span| span.end - span.start).sum();
            FlightText {
                name: flight.name.clone(),
                manoeuvre: flight.manoeuvre.clone(),
                duration_s: flight.duration_s(),
                step_s: flight.step_s,
                derived: flight.targets == Targets::Derived,
                judges: judged as f64 / flight.len() as f64,
            }
        };
        let flights: Vec<FlightText> = self.set.flights.iter().enumerate().map(text).collect();
        let whole = flights.iter().filter(|flight| flight.judges > 0.999).count();
        let judging = match flights.iter().filter(|flight| flight.judges > 0.0).count() {
            count if count == whole => format!("{whole} of {} flights that no fit and no search sees", flights.len()),
            count => format!("parts of {count} of {} flights that no fit and no search sees", flights.len()),
        };
        let channel = |(column, name): (&Column, &'static str)| ChannelText { symbol: column.name(), name, unit: column.unit() };
        let extra = self.set.flights.first().into_iter().flat_map(|flight| flight.extra.keys().cloned());
        Overview {
            version: env!("CARGO_PKG_VERSION"),
            data: self.data.display().to_string(),
            duration_s: self.set.duration_s(),
            parts_s: [fitted, seconds(&self.split.test)],
            judging,
            flights,
            channels: Column::TARGETS.iter().zip(CHANNELS).map(channel).collect(),
            variables: Variable::ALL.iter().map(|variable| [variable.name(), variable.unit()]).collect(),
            names: standard_names().into_iter().map(str::to_owned).chain(extra).collect(),
            signals: SIGNALS.iter().map(|signal| [signal.name, signal.unit, signal.meaning]).collect(),
            check: self.check.summary.clone(),
            fault: self.check.fault,
        }
    }

    /// The model of a state; of the present one without.
    ///
    /// # Errors
    /// [`crate::Error::Config`] where there is no such state.
    pub fn model(&self, state: Option<u64>) -> Result<ModelText> {
        let state = self.state(state)?;
        let State { model, calibration, id, .. } = &*state;
        let is_addable = |definition: &&crate::physics::Definition| {
            definition.notes.is_some_and(|notes| notes.vehicles.contains(&model.vehicle))
                && model.effect(definition.kind).is_none()
                && !model.lacks_rotors_of(&definition.effect(model.mass_kg, model.rotor_radius_m))
        };
        let addable = catalogue::definitions().filter(is_addable);
        Ok(ModelText {
            name: model.name.clone(),
            vehicle: model.vehicle_text(),
            state: *id,
            effects: model.effects.iter().map(effect_text).collect(),
            addable: addable.map(|definition| [definition.kind.to_owned(), definition.meaning.to_owned()]).collect(),
            calibration: calibration.clone(),
            doubts: model.sign_doubts().iter().map(ToString::to_string).collect(),
            toml: model.to_toml().ok(),
        })
    }

    /// Views that a person looks at first, made ready: the history and the map.
    ///
    /// # Errors
    /// As [`Studio::map`].
    pub fn prepare(&self) -> Result<()> {
        self.steps()?;
        self.map(PartWanted::Judged, super::By::Manoeuvre).map(drop)
    }
}

fn effect_text(effect: &Effect) -> EffectText {
    let definition = catalogue::definition(&effect.kind);
    let coefficients = effect.coefficients.iter().map(|coefficient| {
        let known = definition.and_then(|definition| definition.coefficient(&coefficient.name));
        let usual = known.and_then(|known| known.expected);
        let values = coefficient.by_flight.iter().flat_map(|values| values.values().copied());
        let ends = values.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let count = values.count();
        NumberText {
            name: coefficient.name.clone(),
            meaning: coefficient.meaning.clone(),
            value: coefficient.value,
            unit: coefficient.unit.clone(),
            ci95: coefficient.ci95,
            usual,
            bounds: finite(known.map(|known| known.bounds)),
            slider: slider(coefficient.value, coefficient.ci95, usual, known.map(|known| known.bounds)),
            fixed: false,
            by_flight: (count > 0).then_some((count, ends.0, ends.1)),
        }
    });
    let parameters = effect.parameters.iter().map(|parameter| {
        let known = definition.and_then(|definition| definition.parameter(&parameter.name));
        let bounds = known.map(|known| known.bounds);
        NumberText {
            name: parameter.name.clone(),
            meaning: known.map_or_else(String::new, |known| known.meaning.to_owned()),
            value: parameter.value,
            unit: parameter.unit.clone(),
            ci95: parameter.ci95,
            usual: None,
            bounds: finite(bounds),
            slider: slider(parameter.value, parameter.ci95, None, bounds),
            fixed: parameter.fixed,
            by_flight: None,
        }
    });
    EffectText {
        name: effect.name.clone(),
        kind: effect.kind.clone(),
        meaning: effect.meaning.clone(),
        formula: effect.to_string(),
        enabled: effect.enabled,
        baseline: definition.is_some_and(|definition| definition.notes.is_none()),
        added_by: effect.added_by.clone(),
        numbers: coefficients.chain(parameters).collect(),
    }
}

/// Bounds without infinite ends, which JSON has no number for.
fn finite(bounds: Option<[f64; 2]>) -> [Option<f64>; 2] {
    bounds.map_or([None, None], |bounds| bounds.map(|bound| Some(bound).filter(|bound| bound.is_finite())))
}

/// Ends of a slider: zero, the value, its interval and what is usual lie within, with room, but not beyond what physics allows.
fn slider(value: f64, ci95: Option<[f64; 2]>, usual: Option<[f64; 2]>, bounds: Option<[f64; 2]>) -> [f64; 2] {
    let places = [Some(0.0), Some(value), Some(2.0 * value)].into_iter().flatten();
    let places = places.chain(ci95.into_iter().flatten()).chain(usual.into_iter().flatten()).filter(|place| place.is_finite());
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
    let room = if high > low { 0.1 * (high - low) } else { 1.0 };
    let [least, most] = bounds.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    [(low - room).max(least.min(value)), (high + room).min(most.max(value))]
}

#[cfg(test)]
mod tests {
    use super::slider;

    #[test]
    fn a_slider_holds_what_matters_and_ends_where_physics_does() {
        let [low, high] = slider(2.0, Some([1.5, 2.5]), Some([0.5, 8.0]), Some([0.0, 100.0]));
        assert!(low == 0.0 && high > 8.0 && high < 10.0, "{low} {high}");
        let [low, high] = slider(-3.0, None, None, None);
        assert!(low < -6.0 && high > 0.0);
        assert_eq!(slider(0.0, None, None, None), [-1.0, 1.0]);
        let [low, _] = slider(-1.0, None, None, Some([0.0, 5.0]));
        assert_eq!(low, -1.0, "a value beyond its bounds is still on the slider");
    }
}
