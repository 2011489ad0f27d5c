//! The catalogue: physical effects that the paper's baseline lacks, each with formula, units, bounds, usual size, what it is mistaken
//! for and the manoeuvre that would tell. Data, in the order of its subjects; how one is found missing is the critique's business.
//!
//! Notation: v = (vx, vy, vz) m/s, w = (wx, wy, wz) rad/s, u1 lateral, u2 longitudinal, u3 tail, u4 collective; body axes point forward,
//! to starboard and down, so an upright rotor's thrust is negative. Formulas read and change the signals of the model (`SIGNALS`), so that
//! effects see each other: what the air does reads the velocity against the air, what the rotor does its thrust. Accelerations that a
//! formula needs are those that the model predicts: a measured acceleration as an input would answer the question with itself.
//!
//! The order of the list is the order in which effects change one signal: a delay comes before a servo's limit, that before a lag,
//! and the shape of the linkage last.

mod aerodynamics;
mod body;
mod control;
mod measurement;
mod rotor;
mod rotors;
mod thrust;

use super::baseline;
use super::definition::{Definition, Vehicle};

/// Effects of the main rotor and of the fuselage apply to helicopters, those of rotors that change their speed to multirotors, others to
/// everything that flies.
const HELICOPTER: &[Vehicle] = &[Vehicle::Helicopter];
const MULTIROTOR: &[Vehicle] = &[Vehicle::Multirotor];
const ANY: &[Vehicle] = &Vehicle::ALL;

/// Every effect of the catalogue.
pub fn definitions() -> impl Iterator<Item = &'static Definition> {
    let subjects = [
        control::DEFINITIONS,
        aerodynamics::DEFINITIONS,
        thrust::DEFINITIONS,
        rotor::DEFINITIONS,
        rotors::DEFINITIONS,
        body::DEFINITIONS,
        measurement::DEFINITIONS,
    ];
    subjects.into_iter().flatten()
}

/// A built-in effect, of the baseline or of the catalogue, by identifier.
pub fn definition(kind: &str) -> Option<&'static Definition> {
    baseline::definitions().iter().chain(definitions()).find(|definition| definition.kind == kind)
}

/// Identifiers of all built-in effects, the baseline's first.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    baseline::definitions().iter().chain(definitions()).map(|definition| definition.kind)
}

#[cfg(test)]
mod derivations;
#[cfg(test)]
pub(super) mod tests;
