//! The way from a stick to what it moves: delay, lags, limits, cross-coupling, linkage.

use super::super::definition::{Definition, Notes, change, coefficient, parameter};
use super::{ANY, HELICOPTER};
use crate::flight::Channel;

/// Delays that a search tries, s.
const DELAYS: &[f64] = &[0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.055, 0.075, 0.1];
/// Largest rates of servos that it tries, full sticks per second.
const SLEWS: &[f64] = &[1.0, 2.0, 3.0, 4.5, 7.0, 12.0];

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "ctrl_delay",
        meaning: "between a recorded control and its effect passes a fixed time",
        coefficients: &[],
        parameters: &[
            parameter("delay_s", "s", "delay of the cyclic").starting(0.02).tried(DELAYS).within(0.0, 0.15),
            parameter("tail_s", "s", "delay of the tail").starting(0.02).tried(DELAYS).within(0.0, 0.15).tied("delay_s"),
            parameter("collective_s", "s", "delay of the collective")
                .starting(0.02)
                .tried(DELAYS)
                .within(0.0, 0.15)
                .tied("delay_s"),
        ],
        terms: &[],
        swaps: &[
            change("u1", "delay(u1, delay_s)"),
            change("u2", "delay(u2, delay_s)"),
            change("u3", "delay(u3, tail_s)"),
            change("u4", "delay(u4, collective_s)"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick stick inputs",
            confusable_with: &["rotor_acceleration", "cyclic_lag", "tail_lag", "collective_lag", "sync"],
            would_tell_apart: "3-2-1-1 inputs on each stick: a lag rounds the corners, a delay does not",
            fault_of_log: Some("controls with late or early time stamps look the same: no flight tells these two"),
            source: "servo and receiver delays of 40 to 50 ms: Walker & Tischler, VFS Forum 77, 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "servo_rate_limit",
        meaning: "servos turn no faster than they can, so quick inputs arrive as ramps",
        coefficients: &[],
        parameters: &[
            parameter("rate_per_s", "1/s", "largest rate of the cyclic, in full sticks per second")
                .starting(3.0)
                .tried(SLEWS)
                .within(0.2, 20.0),
            parameter("tail_per_s", "1/s", "largest rate of the tail")
                .starting(3.0)
                .tried(SLEWS)
                .within(0.2, 20.0)
                .tied("rate_per_s"),
            parameter("collective_per_s", "1/s", "largest rate of the collective")
                .starting(3.0)
                .tried(SLEWS)
                .within(0.2, 20.0)
                .tied("rate_per_s"),
        ],
        terms: &[],
        swaps: &[
            change("u1", "slew(u1, rate_per_s)"),
            change("u2", "slew(u2, rate_per_s)"),
            change("u3", "slew(u3, tail_per_s)"),
            change("u4", "slew(u4, collective_per_s)"),
        ],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "full-stick reversals within a tenth of a second",
            confusable_with: &["cyclic_lag", "ctrl_nonlin"],
            would_tell_apart: "the same step at a tenth and at the whole of the stick: a lag takes as long for both, a limit does not",
            fault_of_log: Some(
                "sticks recorded at a lower rate than they move, and joined by lines: small inputs would be ramps too",
            ),
            source: "model servos: 60 degrees in 0.05 to 0.15 s unloaded",
            searched: true,
        }),
    },
    Definition {
        kind: "cyclic_lag",
        meaning: "the rotor disc tilts with a first-order lag behind the cyclic, and most of the rate damping comes through the disc",
        coefficients: &[],
        parameters: &[
            parameter("tau_x_s", "s", "flapping time constant in roll")
                .starting(0.05)
                .tried(&[0.004, 0.012, 0.03, 0.06, 0.12])
                .within(0.0, 0.4),
            parameter("tau_y_s", "s", "flapping time constant in pitch")
                .starting(0.05)
                .tried(&[0.004, 0.012, 0.03, 0.06, 0.12])
                .within(0.0, 0.4)
                .tied("tau_x_s"),
            parameter("share", "1", "share of the roll and pitch damping that comes through the disc")
                .starting(0.7)
                .tried(&[0.0, 0.5, 1.0])
                .within(0.0, 1.0),
        ],
        terms: &[],
        swaps: &[
            change("u1", "lag(u1, tau_x_s)"),
            change("u2", "lag(u2, tau_y_s)"),
            change("wx", "(1 - share) * wx + share * lag(wx, tau_x_s)").within(&["rate_damping"]),
            change("wy", "(1 - share) * wy + share * lag(wy, tau_y_s)").within(&["rate_damping"]),
        ],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "quick cyclic inputs",
            confusable_with: &["ctrl_delay", "servo_rate_limit", "rate_cross", "ctrl_cross", "ctrl_nonlin"],
            would_tell_apart: "3-2-1-1 inputs on the cyclic",
            fault_of_log: Some("u1 and u2, or the angular accelerations, recorded late: all three axes would then shift alike"),
            source: "tau = 16 / (gamma Omega): 35 to 100 ms, Mettler, Tischler & Kanade CMU-RI-TR-00-03; Walker & Tischler 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "tail_lag",
        meaning: "tail servo and yaw gyro act with a first-order lag behind the tail stick",
        coefficients: &[],
        parameters: &[parameter("tau_s", "s", "time constant")
            .starting(0.06)
            .tried(&[0.004, 0.012, 0.03, 0.06, 0.12])
            .within(0.0, 0.5)],
        terms: &[],
        swaps: &[change("u3", "lag(u3, tau_s)")],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "quick tail inputs",
            confusable_with: &["ctrl_delay", "collective_torque"],
            would_tell_apart: "3-2-1-1 inputs on the tail at constant collective",
            fault_of_log: Some("u3 recorded late: its steps would come late and stay sharp"),
            source: "Gavrilets: tail servo of 7 Hz, damping 0.6",
            searched: true,
        }),
    },
    Definition {
        kind: "collective_lag",
        meaning: "the collective servos act with a first-order lag behind the stick",
        coefficients: &[],
        parameters: &[parameter("tau_s", "s", "time constant")
            .starting(0.06)
            .tried(&[0.004, 0.012, 0.03, 0.06, 0.12])
            .within(0.0, 0.5)],
        terms: &[],
        swaps: &[change("u4", "lag(u4, tau_s)")],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick collective inputs",
            confusable_with: &["ctrl_delay", "inflow_lag", "rotor_droop"],
            would_tell_apart: "3-2-1-1 inputs on the collective in hover",
            fault_of_log: Some("u4 recorded late: its steps would come late and stay sharp"),
            source: "Gavrilets: servos of 36 rad/s, damping 0.5, with a slow pole",
            searched: true,
        }),
    },
    Definition {
        kind: "ctrl_nonlin",
        meaning: "linkage and exponential curves: a stick's effect is not in proportion to its travel",
        coefficients: &[
            coefficient("k_x", "rad/s²", "lateral cyclic").within(-100.0, 100.0).usually(-7.0, 7.0),
            coefficient("k_y", "rad/s²", "longitudinal cyclic").within(-100.0, 100.0).usually(-6.0, 6.0),
            coefficient("k_z", "rad/s²", "tail").within(-100.0, 100.0).usually(-5.0, 5.0),
            coefficient("k_c", "m/s²", "collective").within(-30.0, 30.0).usually(-2.0, 2.0),
        ],
        parameters: &[parameter("exponent", "1", "power of the travel").starting(3.0).tried(&[2.0, 3.0]).within(2.0, 4.0)],
        terms: &[],
        swaps: &[
            change("rotor_roll", "rotor_roll + k_x * sign(u1) * abs(u1)^exponent"),
            change("rotor_pitch", "rotor_pitch + k_y * sign(u2) * abs(u2)^exponent"),
            change("tail_thrust", "tail_thrust + k_z * sign(u3) * abs(u3)^exponent"),
            change("thrust", "thrust + k_c * sign(u4) * abs(u4)^exponent"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "each stick over most of its travel",
            confusable_with: &[
                "rotor_acceleration",
                "cyclic_lag",
                "servo_rate_limit",
                "stall_saturation",
                "tail_rotor_inflow",
                "transl_lift",
                "rotor_droop",
                "vortex_ring",
            ],
            would_tell_apart: "slow ramps of each stick from end to end",
            fault_of_log: Some(
                "a stick that the log clips or rounds: its recorded values would pile up at the ends, or stand in steps",
            ),
            source: "crank geometry of servo linkages; a transmitter's exponential curve",
            searched: true,
        }),
    },
    Definition {
        kind: "ctrl_cross",
        meaning: "a stick moves another axis too: swash plate phase, delta-3, linkage",
        coefficients: &[
            coefficient("x_u2", "rad/s²", "roll by longitudinal cyclic").within(-40.0, 40.0).usually(-10.0, 10.0),
            coefficient("x_u3", "rad/s²", "roll by tail").within(-40.0, 40.0).usually(-3.0, 3.0),
            coefficient("x_u4", "rad/s²", "roll by collective").within(-40.0, 40.0).usually(-5.0, 5.0),
            coefficient("y_u1", "rad/s²", "pitch by lateral cyclic").within(-40.0, 40.0).usually(-10.0, 10.0),
            coefficient("y_u3", "rad/s²", "pitch by tail").within(-40.0, 40.0).usually(-3.0, 3.0),
            coefficient("y_u4", "rad/s²", "pitch by collective").within(-40.0, 40.0).usually(-5.0, 5.0),
            coefficient("z_u1", "rad/s²", "yaw by lateral cyclic").within(-40.0, 40.0).usually(-3.0, 3.0),
            coefficient("z_u2", "rad/s²", "yaw by longitudinal cyclic").within(-40.0, 40.0).usually(-3.0, 3.0),
        ],
        parameters: &[],
        // The cyclic's cross-coupling turns the disc's tilt; what tail and collective do to roll and pitch does not pass through it.
        terms: &[
            (Channel::WxDot, Some("x_u3"), "u3"),
            (Channel::WxDot, Some("x_u4"), "u4"),
            (Channel::WyDot, Some("y_u3"), "u3"),
            (Channel::WyDot, Some("y_u4"), "u4"),
            (Channel::WzDot, Some("z_u1"), "u1"),
            (Channel::WzDot, Some("z_u2"), "u2"),
        ],
        swaps: &[change("rotor_roll", "rotor_roll + x_u2 * u2"), change("rotor_pitch", "rotor_pitch + y_u1 * u1")],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "each stick moved on its own",
            confusable_with: &["rate_cross", "cyclic_lag", "cg_offset"],
            would_tell_apart: "doublets on one stick at a time, the others held",
            fault_of_log: Some(
                "a log of what the servos get after mixing, not of the sticks: the recorded columns would never move one at a time",
            ),
            source: "cyclic cross-feed of 12 to 35 %: Walker & Tischler 2021 and ArduPilot's identified models",
            searched: true,
        }),
    },
    Definition {
        kind: "rate_cross",
        meaning: "pitching rolls the rotor and rolling pitches it: flapping and the rotor's angular momentum",
        coefficients: &[
            coefficient("x_q", "1/s", "roll by pitch rate").within(-15.0, 15.0).usually(-5.0, 5.0),
            coefficient("y_p", "1/s", "pitch by roll rate").within(-15.0, 15.0).usually(-5.0, 5.0),
        ],
        parameters: &[],
        terms: &[(Channel::WxDot, Some("x_q"), "wy"), (Channel::WyDot, Some("y_p"), "wx")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "rolls without pitch and flips without roll",
            confusable_with: &["ctrl_cross", "inertia_cross", "cyclic_lag", "rotor_gyro"],
            would_tell_apart: "coasting after a roll or flip input with the cyclic centred",
            fault_of_log: Some(
                "a rate sensor that is turned about the vertical axis: the attitude would then turn otherwise than the rates say",
            ),
            source: "flap cross coupling of 1 to 1.3 over the flapping time constant: Walker & Tischler 2021; Padfield ch. 4",
            searched: true,
        }),
    },
];
