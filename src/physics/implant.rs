//! A known effect added to recorded flights, so that the truth is known under real noise. Only accelerations change; the states stay
//! those that were flown, so nothing here says how the aircraft would have flown with the effect.

use super::definition::Definition;
use super::effect::Effect;
use super::model::Model;
use crate::error::{Error, Result};
use crate::flight::{Accelerations, DataSet, Flight, Targets};

/// The catalogue's effect at `scale` times its usual size, for the vehicle of a model.
///
/// A coefficient gets the middle of its expected range, or half of the upper end where the range holds zero; one that differs from
/// flight to flight, its usual standard deviation (see [`spread_over_flights`]). An effect without coefficients gets its parameters before
/// any search, times (s) multiplied by the scale and rates (1/s) divided by it, within their bounds.
pub fn typical(definition: &Definition, scale: f64, model: &Model) -> Effect {
    let mut effect = definition.effect(model.mass_kg, model.rotor_radius_m);
    for (coefficient, definition) in effect.coefficients.iter_mut().zip(definition.coefficients) {
        let size = match (definition.by_flight, definition.expected) {
            (Some(deviation), _) => deviation,
            (None, Some([low, high])) if low <= 0.0 && 0.0 <= high => 0.5 * high,
            (None, Some([low, high])) => 0.5 * (low + high),
            (None, None) => 0.0,
        };
        coefficient.value = scale * size;
    }
    if effect.coefficients.is_empty() {
        for (parameter, definition) in effect.parameters.iter_mut().zip(definition.parameters) {
            let [low, high] = definition.bounds;
            match definition.unit {
                "s" => parameter.value = (parameter.value * scale).max(low).min(high),
                "1/s" => parameter.value = (parameter.value / scale).max(low).min(high),
                _ => {}
            }
        }
    }
    effect
}

/// Gives every flight a value of its own to the coefficients that differ from flight to flight: zero on average, with the
/// coefficient's value as the root mean square, and the same for the same names in the same order.
#[must_use]
pub fn spread_over_flights(mut effect: Effect, flights: &[Flight]) -> Effect {
    // The golden angle never comes round: no two flights get the same, and two coefficients are not alike.
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    for (place, coefficient) in effect.coefficients.iter_mut().enumerate() {
        let Some(values) = &mut coefficient.by_flight else { continue };
        let amplitude = std::f64::consts::SQRT_2 * coefficient.value;
        for (index, flight) in flights.iter().enumerate() {
            let angle = golden_angle * ((1 + place) * (1 + index)) as f64;
            values.insert(flight.name.clone(), amplitude * angle.sin());
        }
        coefficient.value = values.values().sum::<f64>() / flights.len().max(1) as f64;
    }
    effect
}

/// The flights with an effect added to their accelerations: what the model predicts with the effect less what it predicts without. For
/// an effect with coefficients these are its terms; for a lag or a delay, the change that it makes to the model's own terms. The
/// model is calibrated beforehand, so that thrusts and moments in the formulas are those of the flights.
///
/// # Errors
/// [`Error::Config`] if the model has the effect already; otherwise as [`Model::predict`].
pub fn implant(data: &DataSet, model: &Model, effect: &Effect) -> Result<DataSet> {
    if model.effect(&effect.name).is_some() {
        return Err(Error::Config {
            place: format!("model `{}`", model.name),
            field: "effect".into(),
            found: format!("`{}`, the effect to implant", effect.name),
            expected: "a model without it; remove it, or implant another".into(),
        });
    }
    let mut with = model.clone();
    with.effects.push(effect.clone());
    // A set that mixes recorded and derived accelerations is written without the derived ones, and what is implanted would be lost.
    let mixed = data.flights.iter().any(|flight| flight.targets != Targets::Derived);
    let mut flights = Vec::with_capacity(data.flights.len());
    for flight in &data.flights {
        let (before, after) = (model.predict(flight)?, with.predict(flight)?);
        let mut changed: Accelerations = flight.accelerations();
        for ((values, before), after) in changed.iter_mut().zip(&before).zip(&after) {
            for ((value, before), after) in values.iter_mut().zip(before).zip(after) {
                *value += after - before;
            }
        }
        let mut flight = flight.with_accelerations(&changed)?;
        if mixed {
            flight.targets = Targets::Recorded;
        }
        flights.push(flight);
    }
    let mut notes = data.notes.clone();
    notes.push(format!("effect `{}` is implanted", effect.name));
    Ok(DataSet { flights, notes, ..DataSet::default() })
}
