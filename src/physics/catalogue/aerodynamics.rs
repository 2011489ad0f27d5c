//! Forces and moments of the air on rotor, tail and fuselage.

use super::super::definition::{CoefficientDefinition, Definition, Notes, Origin, ParameterDefinition, coefficient};
use super::{ANY, HELICOPTER};

const QUAD_DRAG: [CoefficientDefinition; 3] = [
    coefficient("k_x", "1/m", "along the nose").within(-0.1, 0.0).usually(-0.02, -0.004),
    coefficient("k_y", "1/m", "to starboard").within(-0.1, 0.0).usually(-0.03, -0.007),
    coefficient("k_z", "1/m", "along body down").within(-0.1, 0.0).usually(-0.03, -0.007),
];

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "quad_drag",
        meaning: "fuselage drag, 1/2 rho f V v against the air speed",
        coefficients: &QUAD_DRAG,
        parameters: &[],
        terms: &[(0, Some("k_x"), "airspeed * vx"), (1, Some("k_y"), "airspeed * vy"), (2, Some("k_z"), "airspeed * vz")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "speeds from hover to well above 5 m/s",
            confusable_with: &["wind", "speed_damping", "climb_inflow"],
            would_tell_apart: "straight flight at 4, 8 and 12 m/s, forwards and sideways",
            source: "Heffley & Mnich, NASA CR 177476; flat-plate areas of Gavrilets's X-Cell 60",
            searched: true,
        }),
    },
    Definition {
        kind: "ground_effect",
        meaning: "near the ground the rotor's wake is blocked and the same power lifts more: T/T_inf = 1 / (1 - (R/4z)^2 / (1 + (V/v_i)^2))",
        coefficients: &[coefficient("k", "1", "share of the theoretical gain").within(0.0, 3.0).usually(0.6, 1.3)],
        parameters: &[
            ParameterDefinition {
                name: "radius_m",
                unit: "m",
                meaning: "rotor radius",
                origin: Origin::RotorRadius,
                grid: &[],
                bounds: [0.01, 20.0],
                tied_to: None,
            },
            ParameterDefinition {
                name: "hub_m",
                unit: "m",
                meaning: "height of the rotor hub above the recorded position",
                origin: Origin::Number(0.2),
                grid: &[0.0, 0.2, 0.4],
                bounds: [0.0, 0.6],
                tied_to: None,
            },
            ParameterDefinition {
                name: "induced_m_s",
                unit: "m/s",
                meaning: "induced velocity in hover",
                origin: Origin::HoverInduced,
                grid: &[],
                bounds: [0.1, 30.0],
                tied_to: None,
            },
        ],
        terms: &[(
            2,
            Some("k"),
            "(collective_thrust_c_z * u4 + vertical_bias_d_z) * (1 / (1 - (radius_m / (4 * max(height + hub_m, 0.5 * radius_m)))^2 / (1 + (airspeed / induced_m_s)^2)) - 1)",
        )],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "flight below two rotor radii",
            confusable_with: &["rotor_droop", "sensor_bias"],
            would_tell_apart: "hover at 0.5, 1, 2 and 4 m",
            source: "Cheeseman & Bennett 1955, ARC R&M 3021",
            searched: true,
        }),
    },
    Definition {
        kind: "collective_torque",
        meaning: "the torque that drives the main rotor turns the fuselage the other way",
        coefficients: &[coefficient("k", "rad/s²", "yaw acceleration at 1 g of thrust").within(-60.0, 60.0).usually(-6.0, 6.0)],
        parameters: &[ParameterDefinition {
            name: "exponent",
            unit: "1",
            meaning: "power of the thrust",
            origin: Origin::Number(1.5),
            grid: &[1.0, 1.5, 2.0],
            bounds: [1.0, 2.0],
            tied_to: None,
        }],
        terms: &[(5, Some("k"), "abs((collective_thrust_c_z * u4 + vertical_bias_d_z) / 9.80665)^exponent")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "collective over half of its range",
            confusable_with: &["heave_torque", "rotor_droop", "tail_lag"],
            would_tell_apart: "slow and fast collective steps with the tail held still",
            source: "momentum theory: power goes as thrust to the 3/2",
            searched: true,
        }),
    },
];
