//! What physics says of a number before any flight: its usual size, its bounds, its sign. Data of the catalogue turned into priors; what is made of
//! them is the business of `joint` and `own`.

use super::design::Free;
use crate::physics::{Model, catalogue};

/// What is known of a number before any flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub centre: f64,
    /// Standard deviation; `None` where nothing is presumed.
    pub size: Option<f64>,
    pub bounds: [f64; 2],
    /// Whether each flight has its own.
    pub is_local: bool,
}

impl Known {
    /// Weight in independent samples, with `damping` that holds the number at its present value.
    pub fn precision(&self, damping: f64, now: f64) -> f64 {
        match self.size {
            Some(size) => (1.0 + damping) / (size * size),
            None => damping / if now == 0.0 { 1.0 } else { now * now },
        }
    }

    pub fn misfit(&self, value: f64) -> f64 {
        self.size.map_or(0.0, |size| ((value - self.centre) / size).powi(2))
    }

    /// How far a value is beyond its bounds, in usual sizes; 0 on one of them, negative within.
    pub fn excess(&self, value: f64) -> f64 {
        let [low, high] = self.bounds;
        (low - value).max(value - high) / self.size.unwrap_or(1.0)
    }
}

/// Usual spread of a number that each flight has for itself.
pub(super) fn size_of(model: &Model, effect: usize, coefficient: usize) -> f64 {
    known(model, Free { effect, coefficient }).size.unwrap_or(1.0)
}

/// What is known of a number of a model before any flight. Signs that physics fixes are kept: an effect that needs the other one stands in for
/// something else.
pub(super) fn known(model: &Model, free: Free) -> Known {
    let effect = &model.effects[free.effect];
    let nothing = Known { centre: 0.0, size: None, bounds: [f64::NEG_INFINITY, f64::INFINITY], is_local: false };
    let Some(number) = effect.number(free.coefficient) else { return nothing };
    let definition = catalogue::definition(&effect.kind).filter(|definition| definition.notes.is_some());
    let Some(definition) = definition else {
        let is_local = number.by_flight.is_some();
        return Known { size: is_local.then_some(1.0), is_local, ..nothing };
    };
    if let Some(known) = definition.coefficient(&number.name) {
        let bounds = known.physical_sign().map_or(known.bounds, |(sign, _)| sign.bounds(known.bounds));
        let usual = known.expected.map(|[low, high]| low.abs().max(high.abs()));
        return Known { centre: 0.0, size: known.deviation_in(effect).or(usual), bounds, is_local: number.by_flight.is_some() };
    }
    let plain = definition.effect(model.mass_kg, model.rotor_radius_m);
    let start = plain.parameters.iter().find(|parameter| parameter.name == number.name).map_or(0.0, |parameter| parameter.value);
    let bounds = definition.parameter(&number.name).map_or(nothing.bounds, |known| known.bounds);
    let half = 0.5 * (bounds[1] - bounds[0]);
    Known { centre: start, size: half.is_finite().then_some(half), bounds, is_local: false }
}
