//! The main rotor as a whole: its torque, its speed, and the tilt of its disc.

use super::super::definition::{Definition, Notes, Origin, change, coefficient, parameter};
use super::{HELICOPTER, MULTIROTOR};
use crate::flight::Channel;

/// Speed squared of the rotor, relative: power beyond hover, in induced powers of hover, behind the rotor's and governor's lag. Momentum
/// theory: T (v_i + v_c), the induced part as thrust to the 3/2, the climbing part with the speed along the thrust.
/// Power in induced powers of hover: of a thrust, and of climbing with it.
macro_rules! power {
    ($thrust:expr) => {
        concat!("(abs(", $thrust, " / 9.80665)^1.5 + ", $thrust, " / 9.80665 * air_vz / induced_m_s)")
    };
}

/// Speed squared as the governor has it behind its lag. The guards are for windmills.
macro_rules! behind_governor {
    ($error:expr) => {
        concat!("clamp(1 + 0.5 * k * lag(", $error, ", tau_s), 0.2, 2)^2")
    };
}

/// Speed squared. A rotor that has slowed down to the share r takes less power P, r³ of it but for the climb, and its speed follows that:
/// r + tau r' = 1 + k/2 (P - 1). Solved for r - 1 to first order, then once more with the thrust that is left at that speed.
macro_rules! speed_squared {
    () => {
        behind_governor!(concat!(power!(concat!("(thrust * ", first_speed_squared!(), ")")), " - 1"))
    };
}

macro_rules! first_speed_squared {
    () => {
        behind_governor!(concat!("(", power!("thrust"), " - 1) / max(1 - 1.5 * k * ", power!("thrust"), ", 0.3)"))
    };
}

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "collective_torque",
        meaning: "the torque that drives the main rotor turns the fuselage the other way",
        coefficients: &[coefficient("k", "rad/s²", "yaw acceleration at 1 g of thrust").within(-60.0, 60.0).usually(-6.0, 6.0)],
        parameters: &[parameter("exponent", "1", "power of the thrust").starting(1.5).tried(&[1.0, 1.5, 2.0]).within(1.0, 2.0)],
        terms: &[(Channel::WzDot, Some("k"), "abs(thrust / 9.80665)^exponent")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "collective over half of its range",
            confusable_with: &["heave_torque", "rotor_droop", "tail_lag"],
            would_tell_apart: "slow and fast collective steps with the tail held still",
            fault_of_log: None,
            source: "momentum theory: power goes as thrust to the 3/2",
            searched: true,
        }),
    },
    Definition {
        kind: "heave_torque",
        meaning: "climbing takes torque and descending gives it back, which turns the nose",
        coefficients: &[coefficient("n_w", "rad/(m s)", "yaw by descent at 1 g of thrust").within(-20.0, 20.0).usually(-6.0, 6.0)],
        parameters: &[],
        // Power is thrust times climb: inverted, the sign turns over.
        terms: &[(Channel::WzDot, Some("n_w"), "-thrust / 9.80665 * air_vz")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "climbs and descents beyond 2 m/s",
            confusable_with: &["collective_torque"],
            would_tell_apart: "steady climbs and descents against quick collective doublets",
            fault_of_log: None,
            source: "power T v_z over rotor speed, T in g; N_w 5.8: Walker & Tischler 2021",
            searched: true,
        }),
    },
    Definition {
        kind: "rotor_droop",
        meaning: "under load the rotor slows down before the governor catches it, and thrust and control power fall with its speed squared",
        coefficients: &[coefficient("k", "1", "change of speed squared by one more induced power of hover")
            .within(-0.6, 0.0)
            .usually(-0.25, -0.03)],
        parameters: &[
            parameter("tau_s", "s", "time constant of rotor and governor")
                .starting(0.3)
                .tried(&[0.15, 0.3, 0.6, 1.2])
                .within(0.03, 4.0),
            parameter("damping_share", "1", "share of the roll and pitch damping that comes through the rotor")
                .starting(1.0)
                .tried(&[0.5, 1.0])
                .within(0.0, 1.5),
            parameter("induced_m_s", "m/s", "induced velocity in hover").known_by(Origin::HoverInduced).within(0.1, 30.0),
        ],
        terms: &[
            (Channel::WxDot, None, concat!("damping_share * rate_damping_b_x * wx * (", speed_squared!(), " - 1)")),
            (Channel::WyDot, None, concat!("damping_share * rate_damping_b_y * wy * (", speed_squared!(), " - 1)")),
        ],
        swaps: &[
            change("rotor_speed", concat!("rotor_speed * sqrt(", speed_squared!(), ")")),
            change("thrust", concat!("thrust * ", speed_squared!())),
            change("rotor_roll", concat!("rotor_roll * ", speed_squared!())),
            change("rotor_pitch", concat!("rotor_pitch * ", speed_squared!())),
            change("tail_thrust", concat!("tail_thrust * ", speed_squared!())),
        ],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "collective pulses of half a second and longer",
            confusable_with: &[
                "ground_effect",
                "collective_torque",
                "inflow_lag",
                "collective_lag",
                "mass_drift",
                "stall_saturation",
                "ctrl_nonlin",
            ],
            would_tell_apart: "collective steps held for 3 s with small cyclic and tail doublets during them, or a log of the rotor speed",
            fault_of_log: None,
            source: "Gavrilets: Omega' = (Q_e - Q) / I_rot with a PI governor, thrust as Omega squared",
            searched: true,
        }),
    },
    Definition {
        kind: "rotor_acceleration",
        meaning: "rotors that speed up turn the body the other way, by the rate at which they do so",
        coefficients: &[coefficient("k", "rad/s", "yaw rate that goes over to the body when the yaw control goes to 1")
            .within(-20.0, 20.0)
            .usually(-3.0, 3.0)],
        parameters: &[parameter("tau_s", "s", "lag from the control, or the speeds in the log, to the rotors")
            .starting(0.02)
            .tried(&[0.005, 0.01, 0.02, 0.04, 0.08])
            .within(0.002, 0.3)],
        terms: &[(Channel::WzDot, Some("k"), "rate(lag(u3, tau_s))")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "quick yaw inputs",
            confusable_with: &["ctrl_delay", "ctrl_nonlin"],
            would_tell_apart: "yaw steps that are held: the reaction comes and goes with the step, the drag of the blades stays",
            fault_of_log: None,
            source: "reaction of a spinning mass, I_r dOmega/dt: Mahony, Kumar & Corke, IEEE Robot. Autom. Mag. 19(3), 2012",
            searched: true,
        }),
    },
    // The disc's tilt makes the moment, so the moment tells the tilt, whatever tilted it: signs hold for any convention of the sticks.
    Definition {
        kind: "flap_tilt",
        meaning: "the thrust tilts with the disc: with the cyclic, and behind the fuselage when it turns",
        coefficients: &[
            coefficient("tilt", "rad", "tilt at full cyclic").within(0.0, 0.5).usually(0.05, 0.15),
            coefficient("lag_s", "s", "by how long the disc stays behind the fuselage").within(0.0, 0.3).usually(0.005, 0.1),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("tilt"), "rotor_pitch / max(abs(control_moment_c_y), 1e-3) * thrust"),
            (Channel::VyDot, Some("tilt"), "-rotor_roll / max(abs(control_moment_c_x), 1e-3) * thrust"),
            (Channel::VxDot, Some("lag_s"), "-wy * thrust"),
            (Channel::VyDot, Some("lag_s"), "wx * thrust"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "cyclic inputs and rolls",
            confusable_with: &["imu_lever", "tail_side_force"],
            would_tell_apart: "cyclic doublets at low and at high collective: the tilt goes with the thrust, a lever arm does not",
            fault_of_log: None,
            source: "Gavrilets: X = -T a1, Y = T b1, quasi-steady a1 = -tau q + A u2",
            searched: true,
        }),
    },
];
