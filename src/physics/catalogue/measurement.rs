//! What an instrument makes of the motion: where it sits, how it is mounted, its bias and its delay.
//!
//! Recorded quantities enter the model in place of the true ones, so each regressor is model(true) - model(recorded), to first order
//! in the error.

use super::super::definition::{Definition, Notes, coefficient};
use super::ANY;

pub(super) const DEFINITIONS: &[Definition] = &[
    // The recorded velocity is v + w x r. With v put back, v' = -w x v + g + A v + f becomes
    // v'_rec = -w x v_rec + g + A v_rec + f + w' x r + w x (w x r) - A (w x r).
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
            (0, Some("r_x"), "-(wy^2 + wz^2)"),
            (0, Some("r_y"), concat!("wx * wy - ", predicted!(wz), " + linear_drag_a_x * wz")),
            (0, Some("r_z"), concat!("wx * wz + ", predicted!(wy), " - linear_drag_a_x * wy")),
            (1, Some("r_x"), concat!("wx * wy + ", predicted!(wz), " - linear_drag_a_y * wz")),
            (1, Some("r_y"), "-(wx^2 + wz^2)"),
            (1, Some("r_z"), concat!("wy * wz - ", predicted!(wx), " + linear_drag_a_y * wx")),
            (2, Some("r_x"), concat!("wx * wz - ", predicted!(wy), " + linear_drag_a_z * wy")),
            (2, Some("r_y"), concat!("wy * wz + ", predicted!(wx), " - linear_drag_a_z * wx")),
            (2, Some("r_z"), "-(wx^2 + wy^2)"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick rolls, flips and pirouettes",
            confusable_with: &["flap_tilt", "tail_side_force"],
            would_tell_apart: "fast steady rolls and pirouettes: w x (w x r) has no stick in it",
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
        terms: &[
            (0, Some("d_y"), "-g_z"),
            (0, Some("d_z"), "g_y"),
            (1, Some("d_x"), "g_z"),
            (1, Some("d_z"), "-g_x"),
            (2, Some("d_x"), "-g_y"),
            (2, Some("d_y"), "g_x"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "banks beyond 30 degrees",
            confusable_with: &["wind", "vel_cross", "sensor_bias"],
            would_tell_apart: "hover on four headings, and inverted or knife-edge flight",
            source: "first order of a small rotation",
            searched: true,
        }),
    },
    // -(w - b_w) x (v - b_v) = -w x v + w x b_v + b_w x v; A and B act on the recorded values less their bias.
    Definition {
        kind: "sensor_bias",
        meaning: "velocity and rates are recorded with a constant bias: + w x b_v - A b_v + b_w x v, and - B b_w with its gyroscopic part",
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
        parameters: &[],
        terms: &[
            (0, Some("b_vx"), "-linear_drag_a_x"),
            (1, Some("b_vx"), "wz"),
            (2, Some("b_vx"), "-wy"),
            (0, Some("b_vy"), "-wz"),
            (1, Some("b_vy"), "-linear_drag_a_y"),
            (2, Some("b_vy"), "wx"),
            (0, Some("b_vz"), "wy"),
            (1, Some("b_vz"), "-wx"),
            (2, Some("b_vz"), "-linear_drag_a_z"),
            (1, Some("b_wx"), "-vz"),
            (2, Some("b_wx"), "vy"),
            (3, Some("b_wx"), "-rate_damping_b_x"),
            (4, Some("b_wx"), "-(iz - ix) / iy * wz"),
            (5, Some("b_wx"), "-(ix - iy) / iz * wy"),
            (0, Some("b_wy"), "vz"),
            (2, Some("b_wy"), "-vx"),
            (3, Some("b_wy"), "-(iy - iz) / ix * wz"),
            (4, Some("b_wy"), "-rate_damping_b_y"),
            (5, Some("b_wy"), "-(ix - iy) / iz * wx"),
            (0, Some("b_wz"), "-vy"),
            (1, Some("b_wz"), "vx"),
            (3, Some("b_wz"), "-(iy - iz) / ix * wy"),
            (4, Some("b_wz"), "-(iz - ix) / iy * wx"),
            (5, Some("b_wz"), "-rate_damping_b_z"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "several flights, each with turns at speed",
            confusable_with: &["wind", "tilt_misalign", "ground_effect"],
            would_tell_apart: "a minute at rest on the ground before take-off; steady turns at speed to both sides",
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
            (0, Some("attitude_s"), "wz * g_y - wy * g_z"),
            (1, Some("attitude_s"), "wx * g_z - wz * g_x"),
            (2, Some("attitude_s"), "wy * g_x - wx * g_y"),
            (
                0,
                Some("velocity_s"),
                concat!("wz * ", predicted!(vy), " - wy * ", predicted!(vz), " + linear_drag_a_x * ", predicted!(vx)),
            ),
            (
                1,
                Some("velocity_s"),
                concat!("wx * ", predicted!(vz), " - wz * ", predicted!(vx), " + linear_drag_a_y * ", predicted!(vy)),
            ),
            (
                2,
                Some("velocity_s"),
                concat!("wy * ", predicted!(vx), " - wx * ", predicted!(vy), " + linear_drag_a_z * ", predicted!(vz)),
            ),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "quick rolls and flips",
            confusable_with: &["ctrl_delay", "inflow_lag"],
            would_tell_apart: "coasting rolls with the sticks held: a control delay has no part in them",
            source: "first order of a shift in time; g' = -w x g is kinematics",
            searched: true,
        }),
    },
];
