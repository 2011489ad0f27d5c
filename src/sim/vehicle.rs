//! The truth helicopter in numbers: every constant of the simulator's aircraft, with its source. No equations here.
//!
//! A Synergy N9 class machine. The baseline coefficients are in the family the paper prints, with the controls scaled to
//! [-1, 1]: the printed control gains (0.01 to 0.02) are those of a published autorotation model of the same set, whose regressor
//! is the control times the rotor speed in rpm, hence a factor of about 1000 to 1800.

use serde::Serialize;

/// Mass, kg (paper section 4.1).
pub const MASS_KG: f64 = 4.58;
/// Diagonal of the inertia tensor, kg m² (Gavrilets, Dynamic Model for a Miniature Aerobatic Helicopter: X-Cell 60).
pub const INERTIA_KG_M2: [f64; 3] = [0.18, 0.34, 0.28];
/// Main rotor radius, m: blades of 720 mm (paper section 4.1) on an 80 mm hub.
pub const ROTOR_RADIUS_M: f64 = 0.80;
/// Blade chord, m (Gavrilets: 0.058; rounded up for the larger blade).
pub const BLADE_CHORD_M: f64 = 0.060;
/// Number of blades.
pub const BLADES: f64 = 2.0;
/// Lift curve slope of a blade section, 1/rad (Gavrilets).
pub const LIFT_SLOPE: f64 = 5.5;
/// Nominal rotor speed, rad/s: 1800 rpm (README of the Stanford set).
pub const ROTOR_SPEED_RAD_S: f64 = 188.5;
/// Air density, kg/m³ (standard atmosphere at about 200 m).
pub const AIR_DENSITY_KG_M3: f64 = 1.2;
/// Time constant of the first flapping harmonic with its stabiliser bar, s: 16/(γ Ω) with an effective Lock number of 1.7
/// (Gavrilets: 0.1 s with a bar of Lock number 0.8; Walker and Tischler 2021: 0.035 s without a bar).
pub const FLAP_TIME_S: f64 = 16.0 / (1.7 * ROTOR_SPEED_RAD_S);
/// Share of the roll and pitch damping that comes through the flapping rotor, 1.
pub const ROTOR_DAMPING_SHARE: f64 = 0.7;
/// Tail boom length, m (Gavrilets).
pub const TAIL_ARM_M: f64 = 0.91;
/// Height of the rotor hub above the recorded position, m (Gavrilets).
pub const HUB_HEIGHT_M: f64 = 0.235;
/// Flat-plate areas of the fuselage along the nose, to starboard and down, m² (about half of Gavrilets's, who gives a model
/// with a full fuselage).
pub const FUSELAGE_AREA_M2: [f64; 3] = [0.06, 0.15, 0.10];
/// Fin area, m² (Gavrilets).
pub const FIN_AREA_M2: f64 = 0.012;
/// Lift curve slope of the fin, 1/rad (Gavrilets).
pub const FIN_LIFT_SLOPE: f64 = 2.0;
/// Torque of the main rotor on the fuselage in hover, N m, at a figure of merit of 0.6 (negative yaw: the rotor turns
/// clockwise seen from above).
pub const HOVER_TORQUE_N_M: f64 = 1.2;

/// The coefficients of the paper's eqs. 14-15, diagonals and vectors, in m, s and controls in [-1, 1].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Coefficients {
    /// A, 1/s.
    pub a: [f64; 3],
    /// B, 1/s.
    pub b: [f64; 3],
    /// C₁ of the collective, m/s² per unit.
    pub c1_z: f64,
    /// C₂, rad/s² per unit.
    pub c2: [f64; 3],
    /// D₁ down, m/s².
    pub d1_z: f64,
    /// D₂, rad/s².
    pub d2: [f64; 3],
}

/// The truth: A, D₁, D₂ as printed (paper section 4.2); B and C₂ of an agile machine; C₁ such that it hovers at u₄ = 0.465.
pub const COEFFICIENTS: Coefficients = Coefficients {
    a: [-0.05, -0.06, -1.42],
    b: [-9.0, -8.0, -5.5],
    c1_z: -20.0,
    c2: [70.0, 60.0, 50.0],
    d1_z: -0.51,
    d2: [-1.23, -0.21, 0.14],
};
