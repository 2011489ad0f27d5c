//! Forces and moments of the air on fuselage, fin and tail rotor. The main rotor is in `thrust` and `rotor`.

use super::super::definition::{Definition, Notes, change, coefficient, spread};
use super::{ANY, HELICOPTER, MULTIROTOR};
use crate::flight::Channel;

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "quad_drag",
        meaning: "fuselage drag, 1/2 rho f V v against the air speed",
        coefficients: &[
            coefficient("k_x", "1/m", "along the nose").within(-0.1, 0.0).usually(-0.02, -0.004),
            coefficient("k_y", "1/m", "to starboard").within(-0.1, 0.0).usually(-0.03, -0.007),
            coefficient("k_z", "1/m", "along body down").within(-0.1, 0.0).usually(-0.03, -0.007),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("k_x"), "airspeed * air_vx"),
            (Channel::VyDot, Some("k_y"), "airspeed * air_vy"),
            (Channel::VzDot, Some("k_z"), "airspeed * air_vz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "speeds from hover to well above 5 m/s",
            confusable_with: &["wind", "speed_damping", "climb_inflow", "transl_lift", "vortex_ring", "rotor_drag"],
            would_tell_apart: "straight flight at 4, 8 and 12 m/s, forwards and sideways",
            fault_of_log: Some(
                "a velocity in another unit or scale in some of the flights: the position would then move otherwise than it says",
            ),
            source: "Heffley & Mnich, NASA CR 177476; flat-plate areas of Gavrilets's X-Cell 60",
            searched: true,
        }),
    },
    Definition {
        kind: "vel_cross",
        meaning: "a velocity along one axis makes a force along another: the off-diagonal part of A",
        coefficients: &[
            coefficient("x_vy", "1/s", "forward, from starboard speed").within(-0.5, 0.5).usually(-0.1, 0.1),
            coefficient("x_vz", "1/s", "forward, from descent").within(-0.5, 0.5).usually(-0.2, 0.2),
            coefficient("y_vx", "1/s", "to starboard, from forward speed").within(-0.5, 0.5).usually(-0.1, 0.1),
            coefficient("y_vz", "1/s", "to starboard, from descent").within(-0.5, 0.5).usually(-0.2, 0.2),
            coefficient("z_vx", "1/s", "down, from forward speed").within(-0.5, 0.5).usually(-0.2, 0.2),
            coefficient("z_vy", "1/s", "down, from starboard speed").within(-0.5, 0.5).usually(-0.1, 0.1),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("x_vy"), "air_vy"),
            (Channel::VxDot, Some("x_vz"), "air_vz"),
            (Channel::VyDot, Some("y_vx"), "air_vx"),
            (Channel::VyDot, Some("y_vz"), "air_vz"),
            (Channel::VzDot, Some("z_vx"), "air_vx"),
            (Channel::VzDot, Some("z_vy"), "air_vy"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "flight forwards, sideways and up and down, one at a time",
            confusable_with: &["wind", "tilt_misalign"],
            would_tell_apart: "the same straight flights on four headings",
            fault_of_log: Some(
                "velocities in axes that are turned about the vertical: the position would then move otherwise than they say",
            ),
            source: "stability derivatives X_v, X_w, Y_u, Y_w, Z_u, Z_v: Padfield, Helicopter Flight Dynamics, 2nd ed., ch. 4",
            searched: true,
        }),
    },
    Definition {
        kind: "wind",
        meaning: "a steady wind: all that the air does goes by the velocity against the air, v - R^T W",
        coefficients: &[
            coefficient("wind_n", "m/s", "motion of the air to the north").within(-15.0, 15.0).usually(-5.0, 5.0).each_flight(3.0),
            coefficient("wind_e", "m/s", "motion of the air to the east").within(-15.0, 15.0).usually(-5.0, 5.0).each_flight(3.0),
        ],
        parameters: &[spread()],
        terms: &[],
        swaps: &[
            change("air_vx", "air_vx - wind_n * cos(pitch) * cos(yaw) - wind_e * cos(pitch) * sin(yaw)"),
            change(
                "air_vy",
                "air_vy - wind_n * (sin(roll) * sin(pitch) * cos(yaw) - cos(roll) * sin(yaw)) \
                 - wind_e * (sin(roll) * sin(pitch) * sin(yaw) + cos(roll) * cos(yaw))",
            ),
            change(
                "air_vz",
                "air_vz - wind_n * (cos(roll) * sin(pitch) * cos(yaw) + sin(roll) * sin(yaw)) \
                 - wind_e * (cos(roll) * sin(pitch) * sin(yaw) - sin(roll) * cos(yaw))",
            ),
        ],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "every heading, and banks in which the heave damping meets the wind",
            confusable_with: &[
                "quad_drag",
                "vel_cross",
                "tilt_misalign",
                "sensor_bias",
                "weathercock",
                "dihedral_speedstab",
                "trim_shift",
            ],
            would_tell_apart: "a slow pirouette in hover, and the same straight flight up and down the wind",
            fault_of_log: Some(
                "a heading that is wrong, or velocities in axes that are turned: either follows the nose, wind does not",
            ),
            source: "velocity against the air; ZYX Euler angles: Stevens & Lewis sec. 1.3",
            searched: true,
        }),
    },
    Definition {
        kind: "tail_side_force",
        meaning: "the tail rotor that holds the nose also pushes the aircraft sideways",
        coefficients: &[
            coefficient("k_u", "m/s²", "to starboard at full tail").within(-20.0, 20.0).usually(-3.5, -1.5),
            coefficient("k_r", "m/s", "to starboard by yaw rate")
                .within(-2.0, 2.0)
                .usually(0.05, 0.4)
                .positive("a tail rotor that its own swing speeds up"),
        ],
        parameters: &[],
        // The tail's thrust in full sticks: the sign holds for any convention of the stick.
        terms: &[
            (Channel::VyDot, Some("k_u"), "tail_thrust * control_moment_c_z / max(control_moment_c_z^2, 1e-6)"),
            (Channel::VyDot, Some("k_r"), "wz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "tail inputs over half of the range",
            confusable_with: &["flap_tilt", "imu_lever"],
            would_tell_apart: "pedal steps and reversals in hover with the cyclic held",
            fault_of_log: None,
            source: "thrust over tail arm: c_z iz / (m l) with l = 0.9 m; Y_ped of Walker & Tischler 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "weathercock",
        meaning: "fin and tail rotor turn the nose into the wind of its own motion",
        coefficients: &[
            coefficient("k_fin", "rad/m²", "fin, with speed and sideslip")
                .within(-0.05, 0.5)
                .usually(0.007, 0.1)
                .positive("a fin that turns the tail into the wind"),
            coefficient("k_tail", "rad/(m s)", "tail rotor, with side speed")
                .within(-2.0, 10.0)
                .usually(0.1, 1.7)
                .positive("a tail rotor that turns the tail into the wind"),
        ],
        parameters: &[],
        terms: &[(Channel::WzDot, Some("k_fin"), "airspeed * air_vy")],
        swaps: &[change("tail_thrust", "tail_thrust + k_tail * air_vy")],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "sideslip at several speeds",
            confusable_with: &["wind", "tail_rotor_inflow"],
            would_tell_apart: "sideways flight to both sides, and sideslip at 5 and 10 m/s",
            fault_of_log: None,
            source: "Gavrilets sec. 15.4.4 (fin area, lift slope); N_v 1.7: Walker & Tischler 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "dihedral_speedstab",
        meaning: "the rotor blows back: side speed rolls the aircraft away, forward speed pitches it up",
        coefficients: &[
            coefficient("l_v", "rad/(m s)", "roll by side speed (dihedral)").within(-30.0, 0.0).usually(-3.0, -0.05),
            coefficient("m_u", "rad/(m s)", "pitch by forward speed")
                .within(-30.0, 30.0)
                .usually(0.05, 3.0)
                .positive("a rotor that tilts into its own speed"),
        ],
        parameters: &[],
        terms: &[],
        swaps: &[change("rotor_roll", "rotor_roll + l_v * air_vy"), change("rotor_pitch", "rotor_pitch + m_u * air_vx")],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "accelerations from hover, forwards and sideways",
            confusable_with: &["wind", "cg_offset", "rotor_drag", "blowback_climb", "blowback_thrust"],
            would_tell_apart: "trimmed flight at several speeds in all four directions",
            fault_of_log: None,
            source: "flapping by advance ratio: Gavrilets, da1/dmu; L_v -5.5, M_u 2.75: Walker & Tischler 2021; of multirotors: Hoffmann et al., AIAA 2007-6461",
            searched: true,
        }),
    },
    Definition {
        kind: "blowback_climb",
        meaning: "rotors blow back less while they climb and more while they sink",
        coefficients: &[
            coefficient("l_vw", "rad/m²", "roll by side speed and descent").within(-30.0, 30.0).usually(-3.0, 3.0),
            coefficient("m_uw", "rad/m²", "pitch by forward speed and descent").within(-30.0, 30.0).usually(-3.0, 3.0),
        ],
        parameters: &[],
        terms: &[],
        swaps: &[
            change("rotor_roll", "rotor_roll + l_vw * air_vy * air_vz"),
            change("rotor_pitch", "rotor_pitch + m_uw * air_vx * air_vz"),
        ],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "climbs and descents while flying forwards and sideways",
            confusable_with: &["dihedral_speedstab", "blowback_thrust"],
            would_tell_apart: "level flight, then climbs and descents at the same forward speed",
            fault_of_log: None,
            source: "flapping goes with 4/3 of the collective pitch and the air through the disc from below: Bramwell's Helicopter Dynamics, 2nd ed., ch. 3",
            searched: true,
        }),
    },
    Definition {
        kind: "blowback_thrust",
        meaning: "rotors blow back more the more they lift",
        coefficients: &[
            coefficient("l_vt", "rad/(m s)", "roll by side speed, more of it at 2 g of thrust than at 1 g")
                .within(-30.0, 30.0)
                .usually(-3.0, 3.0),
            coefficient("m_ut", "rad/(m s)", "pitch by forward speed, more of it at 2 g of thrust than at 1 g")
                .within(-30.0, 30.0)
                .usually(-3.0, 3.0),
        ],
        parameters: &[],
        terms: &[],
        swaps: &[
            change("rotor_roll", "rotor_roll - l_vt * air_vy * (thrust / 9.80665 + 1)"),
            change("rotor_pitch", "rotor_pitch - m_ut * air_vx * (thrust / 9.80665 + 1)"),
        ],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "collective steps and turns while flying forwards and sideways",
            confusable_with: &["dihedral_speedstab", "blowback_climb"],
            would_tell_apart: "the same forward speed with more and with less load",
            fault_of_log: None,
            source: "the moment of a thrust that blows back is T h a1, a1 by advance ratio: Mahony, Kumar & Corke 2012; a stiff rotor's goes with its speed",
            searched: true,
        }),
    },
    Definition {
        kind: "speed_damping",
        meaning: "fin, tail rotor and fuselage damp turning more in fast air",
        coefficients: &[
            coefficient("k_x", "1/m", "roll").within(-2.0, 0.0).usually(-0.25, -0.03),
            coefficient("k_y", "1/m", "pitch").within(-2.0, 0.0).usually(-0.25, -0.03),
            coefficient("k_z", "1/m", "yaw").within(-2.0, 0.0).usually(-0.25, -0.03),
        ],
        parameters: &[],
        terms: &[
            (Channel::WxDot, Some("k_x"), "airspeed * wx"),
            (Channel::WyDot, Some("k_y"), "airspeed * wy"),
            (Channel::WzDot, Some("k_z"), "airspeed * wz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "rates in hover and above 8 m/s",
            confusable_with: &["quad_drag", "tail_rotor_inflow", "rotor_inflow"],
            would_tell_apart: "doublets on each stick in hover, at 5 and at 12 m/s",
            fault_of_log: None,
            source: "lifting surface at an arm: damping in proportion to V; Padfield ch. 4",
            searched: true,
        }),
    },
    Definition {
        kind: "tail_rotor_inflow",
        meaning: "the tail rotor pushes differently in moving air: its gain with speed, its loss at high yaw rate",
        coefficients: &[
            coefficient("k_speed", "rad/(m s)", "gain of the tail stick with horizontal speed")
                .within(-10.0, 10.0)
                .usually(0.3, 1.5),
            coefficient("k_rate", "1/rad", "yaw damping in proportion to the rate")
                .within(-5.0, 1.0)
                .usually(-0.5, -0.1)
                .negative("anti-damping at high rate"),
        ],
        parameters: &[],
        terms: &[],
        swaps: &[change("tail_thrust", "tail_thrust + k_speed * u3 * hypot(air_vx, air_vy) + k_rate * abs(wz) * wz")],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "tail inputs at speed, and pirouettes beyond 2 rad/s",
            confusable_with: &["ctrl_nonlin", "speed_damping", "weathercock"],
            would_tell_apart: "pirouettes at 1, 2 and 4 rad/s to both sides, pedal doublets at 0 and 10 m/s",
            fault_of_log: None,
            source: "momentum theory of the tail rotor; Gavrilets sec. 15.4.4",
            searched: true,
        }),
    },
];
