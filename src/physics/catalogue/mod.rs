//! The catalogue: physical effects that the paper's baseline lacks, each with formula, units, bounds, usual size, what it is mistaken
//! for and the manoeuvre that would tell. Data, in the order of its subjects; how one is found missing is the critique's business.
//!
//! Notation: v = (vx, vy, vz) m/s, w = (wx, wy, wz) rad/s, u1 lateral, u2 longitudinal, u3 tail, u4 collective; the specific thrust along body z
//! (up is negative) is written `collective_thrust_c_z * u4 + vertical_bias_d_z`, with the calibrated coefficients of the baseline.

mod aerodynamics;
mod control;

use super::baseline;
use super::definition::{Definition, Vehicle};

/// Effects of the main rotor and of the fuselage apply to helicopters, or to everything that flies.
const HELICOPTER: &[Vehicle] = &[Vehicle::Helicopter];
const ANY: &[Vehicle] = &Vehicle::ALL;

/// Every effect of the catalogue.
pub fn definitions() -> impl Iterator<Item = &'static Definition> {
    aerodynamics::DEFINITIONS.iter().chain(control::DEFINITIONS)
}

/// A built-in effect, of the baseline or of the catalogue, by identifier.
pub fn definition(kind: &str) -> Option<&'static Definition> {
    baseline::definitions().iter().chain(definitions()).find(|definition| definition.kind == kind)
}

/// Identifiers of all built-in effects, the baseline's first.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    baseline::definitions().iter().chain(definitions()).map(|definition| definition.kind)
}
