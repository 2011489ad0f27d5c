//! The catalogue: physical effects that the paper's baseline lacks, each with formula, units, bounds, usual size, what it is mistaken
//! for and the manoeuvre that would tell. Data, in the order of its subjects; how one is found missing is the critique's business.
//!
//! Notation: v = (vx, vy, vz) m/s, w = (wx, wy, wz) rad/s, u1 lateral, u2 longitudinal, u3 tail, u4 collective; body axes point forward,
//! to starboard and down, so an upright rotor's thrust is negative. The specific thrust T along body z is written
//! `collective_thrust_c_z * u4 + vertical_bias_d_z`, and accelerations that a formula needs are written out as the baseline predicts
//! them, with its calibrated coefficients: a measured acceleration as an input would answer the question with itself.

/// Specific thrust along body z, m/s², up negative.
macro_rules! thrust {
    () => {
        "(collective_thrust_c_z * u4 + vertical_bias_d_z)"
    };
}

/// An acceleration as the baseline predicts it: m/s² along body x, y, z, then rad/s² about them.
macro_rules! predicted {
    (vx) => {
        "(vy * wz - vz * wy + g_x + linear_drag_a_x * vx)"
    };
    (vy) => {
        "(vz * wx - vx * wz + g_y + linear_drag_a_y * vy)"
    };
    (vz) => {
        "(vx * wy - vy * wx + g_z + linear_drag_a_z * vz + collective_thrust_c_z * u4 + vertical_bias_d_z)"
    };
    (wx) => {
        "((iy - iz) / ix * wy * wz + rate_damping_b_x * wx + control_moment_c_x * u1 + moment_bias_d_x)"
    };
    (wy) => {
        "((iz - ix) / iy * wz * wx + rate_damping_b_y * wy + control_moment_c_y * u2 + moment_bias_d_y)"
    };
    (wz) => {
        "((ix - iy) / iz * wx * wy + rate_damping_b_z * wz + control_moment_c_z * u3 + moment_bias_d_z)"
    };
}

mod aerodynamics;
mod body;
mod control;
mod measurement;
mod rotor;
mod thrust;

use super::baseline;
use super::definition::{Definition, Vehicle};

/// Effects of the main rotor and of the fuselage apply to helicopters, or to everything that flies.
const HELICOPTER: &[Vehicle] = &[Vehicle::Helicopter];
const ANY: &[Vehicle] = &Vehicle::ALL;

/// Every effect of the catalogue.
pub fn definitions() -> impl Iterator<Item = &'static Definition> {
    let subjects = [
        aerodynamics::DEFINITIONS,
        thrust::DEFINITIONS,
        rotor::DEFINITIONS,
        control::DEFINITIONS,
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
mod tests;
