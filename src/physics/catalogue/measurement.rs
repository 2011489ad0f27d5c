//! What an instrument makes of the motion: where it sits, how it is mounted, its bias and its delay.
//!
//! The rest of the model is made of the true motion: each effect here turns what was recorded into it, and adds what the recorded
//! derivative has beside that of the true quantity.

use super::super::definition::{Definition, Notes, change, coefficient, spread};
use super::ANY;
use crate::flight::Channel;

pub(super) const DEFINITIONS: &[Definition] = &[
    // The recorded velocity is v + w x r, so v = v_rec - w x r, and v'_rec = v' + w' x r. What turning axes do to v gives w x (w x r).
    Definition {
        kind: "imu_lever",
        meaning: "velocity is recorded at a point away from the centre of mass: w' x r + w x (w x r) - A (w x r)",
        coefficients: &[
            coefficient("r_x", "m", "point of measurement ahead of the centre of mass").within(-0.35, 0.35).usually(-0.1, 0.1),
            coefficient("r_y", "m", "point of measurement to starboard of it").within(-0.35, 0.35).usually(-0.05, 0.05),
            coefficient("r_z", "m", "point of measurement below it").within(-0.35, 0.35).usually(-0.1, 0.1),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("r_y"), "-predicted_wz"),
            (Channel::VxDot, Some("r_z"), "predicted_wy"),
            (Channel::VyDot, Some("r_x"), "predicted_wz"),
            (Channel::VyDot, Some("r_z"), "-predicted_wx"),
            (Channel::VzDot, Some("r_x"), "-predicted_wy"),
            (Channel::VzDot, Some("r_y"), "predicted_wx"),
        ],
        swaps: &[
            change("vx", "vx - (wy * r_z - wz * r_y)"),
            change("vy", "vy - (wz * r_x - wx * r_z)"),
            change("vz", "vz - (wx * r_y - wy * r_x)"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick rolls, flips and pirouettes",
            confusable_with: &["flap_tilt", "tail_side_force"],
            would_tell_apart: "fast steady rolls and pirouettes: w x (w x r) has no stick in it",
            fault_of_log: Some("velocity late against the rates: a lever arm needs no change of the rates to show"),
            source: "kinematics of a rigid body: Stevens & Lewis sec. 1.3",
            searched: true,
        }),
    },
    // R_true = R_rec exp([d]x), hence g_true = g_rec + g_rec x d.
    Definition {
        kind: "tilt_misalign",
        meaning: "the attitude sensor is mounted askew: gravity acts along g + g x d",
        coefficients: &[
            coefficient("d_x", "rad", "turn about the nose from recorded to true axes").within(-0.12, 0.12).usually(-0.03, 0.03),
            coefficient("d_y", "rad", "turn about starboard").within(-0.12, 0.12).usually(-0.03, 0.03),
            coefficient("d_z", "rad", "turn about body down").within(-0.12, 0.12).usually(-0.03, 0.03),
        ],
        parameters: &[],
        terms: &[],
        swaps: &[
            change("g_x", "g_x + g_y * d_z - g_z * d_y"),
            change("g_y", "g_y + g_z * d_x - g_x * d_z"),
            change("g_z", "g_z + g_x * d_y - g_y * d_x"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "banks beyond 30 degrees",
            confusable_with: &["wind", "vel_cross", "sensor_bias"],
            would_tell_apart: "hover on four headings, and inverted or knife-edge flight",
            fault_of_log: Some("an attitude that drifts, as estimators in long turns do: it would differ from flight to flight"),
            source: "first order of a small rotation",
            searched: true,
        }),
    },
    Definition {
        kind: "sensor_bias",
        meaning: "velocity and rates are recorded with a constant bias",
        coefficients: &[
            coefficient("b_vx", "m/s", "recorded minus true forward velocity")
                .within(-1.5, 1.5)
                .usually(-0.3, 0.3)
                .each_flight(0.2),
            coefficient("b_vy", "m/s", "recorded minus true starboard velocity")
                .within(-1.5, 1.5)
                .usually(-0.3, 0.3)
                .each_flight(0.2),
            coefficient("b_vz", "m/s", "recorded minus true downward velocity")
                .within(-1.5, 1.5)
                .usually(-0.3, 0.3)
                .each_flight(0.2),
            coefficient("b_wx", "rad/s", "recorded minus true roll rate").within(-0.2, 0.2).usually(-0.03, 0.03).each_flight(0.02),
            coefficient("b_wy", "rad/s", "recorded minus true pitch rate").within(-0.2, 0.2).usually(-0.03, 0.03).each_flight(0.02),
            coefficient("b_wz", "rad/s", "recorded minus true yaw rate").within(-0.2, 0.2).usually(-0.03, 0.03).each_flight(0.02),
        ],
        parameters: &[spread()],
        terms: &[],
        swaps: &[
            change("vx", "vx - b_vx"),
            change("vy", "vy - b_vy"),
            change("vz", "vz - b_vz"),
            change("wx", "wx - b_wx"),
            change("wy", "wy - b_wy"),
            change("wz", "wz - b_wz"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "several flights, each with turns at speed",
            confusable_with: &["wind", "tilt_misalign", "ground_effect"],
            would_tell_apart: "a minute at rest on the ground before take-off; steady turns at speed to both sides",
            fault_of_log: Some("it is one of the log itself"),
            source: "first order in the bias; 0.2 m/s and 1 degree/s are usual after integration with satellite positions",
            searched: true,
        }),
    },
    // Attitude: g_true(t) = g_rec(t + s) = g_rec + s g', and g' = -w x g exactly. Velocity: v_true = v_rec + s v', v' as predicted.
    Definition {
        kind: "sync",
        meaning: "attitude or velocity is recorded late against the rest: model(x + s x') - model(x)",
        coefficients: &[
            coefficient("attitude_s", "s", "by how much the attitude is late").within(-0.05, 0.05).usually(-0.02, 0.02),
            coefficient("velocity_s", "s", "by how much the velocity is late").within(-0.05, 0.05).usually(-0.02, 0.02),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("velocity_s"), "wz * predicted_vy - wy * predicted_vz + linear_drag_a_x * predicted_vx"),
            (Channel::VyDot, Some("velocity_s"), "wx * predicted_vz - wz * predicted_vx + linear_drag_a_y * predicted_vy"),
            (Channel::VzDot, Some("velocity_s"), "wy * predicted_vx - wx * predicted_vy + linear_drag_a_z * predicted_vz"),
        ],
        swaps: &[
            change("g_x", "g_x + attitude_s * (wz * g_y - wy * g_z)"),
            change("g_y", "g_y + attitude_s * (wx * g_z - wz * g_x)"),
            change("g_z", "g_z + attitude_s * (wy * g_x - wx * g_y)"),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick rolls and flips",
            confusable_with: &["ctrl_delay", "inflow_lag"],
            would_tell_apart: "coasting rolls with the sticks held: a control delay has no part in them",
            fault_of_log: Some("it is one of the log itself"),
            source: "first order of a shift in time; g' = -w x g is kinematics",
            searched: true,
        }),
    },
];
