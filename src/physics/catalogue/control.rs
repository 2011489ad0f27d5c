//! The way from a stick to what it moves: delay, lags, limits, cross-coupling, linkage.

use super::super::definition::{Definition, Notes, Origin, ParameterDefinition, SwapDefinition};
use super::{ANY, HELICOPTER};

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "ctrl_delay",
        meaning: "between a recorded control and its effect passes a fixed time",
        coefficients: &[],
        parameters: &[ParameterDefinition {
            name: "delay_s",
            unit: "s",
            meaning: "delay of all four controls",
            origin: Origin::Number(0.02),
            grid: &[0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1],
            bounds: [0.0, 0.15],
            tied_to: None,
        }],
        terms: &[],
        swaps: &[
            SwapDefinition { name: "u1", with: "delay(u1, delay_s)", within: &[] },
            SwapDefinition { name: "u2", with: "delay(u2, delay_s)", within: &[] },
            SwapDefinition { name: "u3", with: "delay(u3, delay_s)", within: &[] },
            SwapDefinition { name: "u4", with: "delay(u4, delay_s)", within: &[] },
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick stick inputs",
            confusable_with: &["cyclic_lag", "tail_lag", "collective_lag", "sync"],
            would_tell_apart: "3-2-1-1 inputs on each stick: a lag rounds the corners, a delay does not",
            source: "servo and receiver delays of 40 to 50 ms: Walker & Tischler, VFS Forum 77, 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "cyclic_lag",
        meaning: "the rotor disc tilts with a first-order lag behind the cyclic, and most of the rate damping comes through the disc",
        coefficients: &[],
        parameters: &[
            ParameterDefinition {
                name: "tau_x_s",
                unit: "s",
                meaning: "flapping time constant in roll",
                origin: Origin::Number(0.05),
                grid: &[0.015, 0.03, 0.05, 0.075, 0.11, 0.15],
                bounds: [0.0, 0.4],
                tied_to: None,
            },
            ParameterDefinition {
                name: "tau_y_s",
                unit: "s",
                meaning: "flapping time constant in pitch",
                origin: Origin::Number(0.05),
                grid: &[0.015, 0.03, 0.05, 0.075, 0.11, 0.15],
                bounds: [0.0, 0.4],
                tied_to: Some("tau_x_s"),
            },
            ParameterDefinition {
                name: "share",
                unit: "1",
                meaning: "share of the roll and pitch damping that comes through the disc",
                origin: Origin::Number(0.7),
                grid: &[0.0, 0.5, 1.0],
                bounds: [0.0, 1.0],
                tied_to: None,
            },
        ],
        terms: &[],
        swaps: &[
            SwapDefinition { name: "u1", with: "lag(u1, tau_x_s)", within: &["control_moment"] },
            SwapDefinition { name: "u2", with: "lag(u2, tau_y_s)", within: &["control_moment"] },
            SwapDefinition { name: "wx", with: "(1 - share) * wx + share * lag(wx, tau_x_s)", within: &["rate_damping"] },
            SwapDefinition { name: "wy", with: "(1 - share) * wy + share * lag(wy, tau_y_s)", within: &["rate_damping"] },
        ],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "quick cyclic inputs",
            confusable_with: &["ctrl_delay", "servo_rate_limit", "rate_cross"],
            would_tell_apart: "3-2-1-1 inputs on the cyclic",
            source: "tau = 16 / (gamma Omega): 35 to 100 ms, Mettler, Tischler & Kanade CMU-RI-TR-00-03; Walker & Tischler 2021",
            searched: true,
        }),
    },
];
