//! What the main rotor's thrust depends on beside the collective: ground, speed, climb, descent, stall.

use super::super::definition::{Definition, Notes, Origin, change, coefficient, parameter};
use super::{ANY, HELICOPTER};

/// Square of the induced velocity that the thrust of the moment has in hover, m²/s².
macro_rules! hover_flow {
    () => {
        "(induced_m_s^2 * abs(thrust) / 9.80665)"
    };
}

/// Square of the speed in the disc's plane, m²/s².
macro_rules! across {
    () => {
        "(air_vx^2 + air_vy^2)"
    };
}

/// h = V^2/2 + v^2 of this thrust in level flight, m²/s². Glauert's v sqrt(V^2 + v^2) = v_h^2, with v_h the induced velocity that it has
/// in hover, gives h = sqrt(V^4/4 + v_h^4). The guard is for no thrust and no speed.
macro_rules! level_flow {
    () => {
        concat!("max(hypot(0.5 * ", across!(), ", ", hover_flow!(), "), 1e-6)")
    };
}

/// Speed of the air at the disc in level flight, m/s: sqrt(V^2 + v^2).
macro_rules! flow_at_disc {
    () => {
        concat!("sqrt(", level_flow!(), " + 0.5 * ", across!(), ")")
    };
}

/// By how much a climb takes from the flow it meets, m/s: half of the climb in hover, little at speed.
macro_rules! relief {
    () => {
        concat!("0.5 * sign(thrust) * air_vz * (1 - 0.5 * ", across!(), " / ", level_flow!(), ")")
    };
}

/// Induced velocity, m/s, up negative as the thrust. Exact in level flight and in a climb from hover; to the first order of the climb between.
macro_rules! induced {
    () => {
        concat!("sign(thrust) * (hypot(", relief!(), ", ", hover_flow!(), " / ", flow_at_disc!(), ") - ", relief!(), ")")
    };
}

/// Pitt and Peters' mass-flow parameter over that of hover: by how much thrust grows with the induced velocity.
macro_rules! mass_flow {
    () => {
        concat!(level_flow!(), " / (", flow_at_disc!(), " * induced_m_s)")
    };
}

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "ground_effect",
        meaning: "near the ground the rotor's wake is blocked and the same power lifts more: T/T_inf = 1 / (1 - (R/4z)^2 / (1 + (V/v_i)^2))",
        coefficients: &[coefficient("k", "1", "share of the theoretical gain").within(0.0, 3.0).usually(0.6, 1.3)],
        parameters: &[
            parameter("radius_m", "m", "rotor radius").known_by(Origin::RotorRadius).within(0.01, 20.0),
            parameter("hub_m", "m", "height of the rotor hub above the recorded position")
                .starting(0.2)
                .tried(&[0.0, 0.2, 0.4])
                .within(0.0, 0.6),
            parameter("induced_m_s", "m/s", "induced velocity in hover").known_by(Origin::HoverInduced).within(0.1, 30.0),
        ],
        terms: &[],
        swaps: &[change(
            "thrust",
            "thrust * (1 + k * (1 / (1 - (radius_m / (4 * max(height + hub_m, 0.5 * radius_m)))^2 / (1 + (airspeed / induced_m_s)^2)) - 1))",
        )],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "flight below two rotor radii",
            confusable_with: &["rotor_droop", "sensor_bias"],
            would_tell_apart: "hover at 0.5, 1, 2 and 4 m",
            fault_of_log: None,
            source: "Cheeseman & Bennett 1955, ARC R&M 3021",
            searched: true,
        }),
    },
    Definition {
        kind: "transl_lift",
        meaning: "in forward flight the rotor meets undisturbed air, the induced velocity falls and the same collective lifts more",
        coefficients: &[
            coefficient("k", "1/s", "thrust gained by induced velocity lost").within(0.0, 10.0).usually(1.5, 4.0),
            coefficient("k_mu", "1", "thrust gained by the advancing blade")
                .within(-0.05, 0.1)
                .usually(0.0, 0.01)
                .positive("an advancing blade that lifts less"),
        ],
        parameters: &[parameter("induced_m_s", "m/s", "induced velocity in hover")
            .known_by(Origin::HoverInduced)
            .within(0.1, 30.0)],
        terms: &[],
        swaps: &[change(
            "thrust",
            concat!(
                "thrust + k * sign(thrust) * (sqrt",
                hover_flow!(),
                " - ",
                hover_flow!(),
                " / ",
                flow_at_disc!(),
                ") + k_mu * thrust * (hypot(air_vx, air_vy) / induced_m_s)^2"
            ),
        )],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "speeds from hover to three times the induced velocity",
            confusable_with: &["climb_inflow", "inflow_lag", "quad_drag", "ctrl_nonlin"],
            would_tell_apart: "level flight at constant height at 0, 3, 6 and 12 m/s, and climbs at each",
            fault_of_log: None,
            source: "Glauert: v_i = T / (2 rho A sqrt(V^2 + v_i^2)); thrust as 1/3 + mu^2/2: Gavrilets eq. 15.12, Padfield ch. 3",
            searched: true,
        }),
    },
    Definition {
        kind: "climb_inflow",
        meaning: "how strongly climb and descent change the thrust depends on speed and on the climb itself",
        coefficients: &[
            coefficient("k_speed", "1/s", "heave damping gained at high speed")
                .within(-10.0, 1.0)
                .usually(-4.0, -1.0)
                .negative("heave damping lost with speed"),
            coefficient("k_climb", "1/m", "heave damping in proportion to the climb").within(-1.0, 1.0).usually(-0.2, 0.2),
        ],
        parameters: &[
            parameter("ratio", "1", "speed of half the gain over the induced velocity in hover")
                .starting(1.5)
                .tried(&[0.7, 1.5, 3.0])
                .within(0.3, 8.0),
            parameter("induced_m_s", "m/s", "induced velocity in hover").known_by(Origin::HoverInduced).within(0.1, 30.0),
        ],
        terms: &[],
        swaps: &[change(
            "thrust",
            "thrust + k_speed * air_vz * hypot(air_vx, air_vy) / (hypot(air_vx, air_vy) + ratio * induced_m_s) \
             + k_climb * air_vz * abs(air_vz)",
        )],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "climbs and descents in hover and above 6 m/s",
            confusable_with: &["transl_lift", "quad_drag", "vortex_ring", "inflow_lag"],
            would_tell_apart: "collective doublets in hover and at 10 m/s, climbs and descents at 1 and 3 m/s",
            fault_of_log: None,
            source: "blade element and momentum theory: Z_w from -1.6 1/s in hover to -3.9 1/s at 10 m/s; Heffley & Mnich",
            searched: true,
        }),
    },
    Definition {
        kind: "vortex_ring",
        meaning: "descending into its own wake at about the induced velocity, the rotor loses thrust",
        coefficients: &[coefficient("k", "1", "share of the thrust at the worst rate of descent")
            .within(-1.0, 0.0)
            .usually(-0.4, -0.1)],
        parameters: &[
            parameter("centre", "1", "worst rate of descent over the induced velocity in hover")
                .starting(1.0)
                .tried(&[0.7, 1.0, 1.3])
                .within(0.4, 1.8),
            parameter("width", "1", "width of the range over the induced velocity in hover").starting(0.4).within(0.1, 1.0),
            parameter("induced_m_s", "m/s", "induced velocity in hover").known_by(Origin::HoverInduced).within(0.1, 30.0),
        ],
        // Descent is motion against the thrust: along +z for an upright rotor.
        terms: &[],
        swaps: &[change(
            "thrust",
            "thrust * (1 + k * exp(-((-sign(thrust) * air_vz / induced_m_s - centre) / width)^2) \
             * exp(-(hypot(air_vx, air_vy) / induced_m_s)^2))",
        )],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "steep descents faster than half the induced velocity",
            confusable_with: &["climb_inflow", "quad_drag", "ctrl_nonlin"],
            would_tell_apart: "vertical descents at 1, 2, 3 and 4 m/s, and the same descents at 6 m/s forward",
            fault_of_log: None,
            source: "Leishman, Principles of Helicopter Aerodynamics, sec. 2.13.6; Johnson, NASA TP 2005-213477",
            searched: true,
        }),
    },
    Definition {
        kind: "stall_saturation",
        meaning: "beyond some load the blades stall and more collective gives less thrust than before",
        coefficients: &[coefficient("k", "1", "change of the thrust's slope beyond the knee")
            .within(-1.0, 0.0)
            .usually(-0.8, -0.2)],
        parameters: &[parameter("knee_g", "1", "load at which it begins, in g")
            .starting(1.3)
            .tried(&[1.1, 1.3, 1.6, 2.0])
            .within(1.0, 4.0)],
        terms: &[],
        swaps: &[change("thrust", "thrust + k * sign(thrust) * max(abs(thrust) - knee_g * 9.80665, 0)")],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "collective to the ends of its range, right way up and inverted",
            confusable_with: &["ctrl_nonlin", "rotor_droop"],
            would_tell_apart: "collective steps of growing size, each held for a second",
            fault_of_log: None,
            source: "Gavrilets: CT limited to 0.0055, T to 2.5 m g",
            searched: true,
        }),
    },
    Definition {
        kind: "inflow_lag",
        meaning: "thrust follows a change of pitch or climb at once and in excess, then the induced flow builds up and takes some back, \
                  the sooner and the less the more air passes the rotor",
        coefficients: &[],
        parameters: &[
            parameter("tau_s", "s", "time constant of the induced flow in hover")
                .starting(0.06)
                .tried(&[0.03, 0.06, 0.12, 0.25])
                .within(0.005, 0.6),
            parameter("overshoot", "1", "excess at once over the steady change, in hover")
                .starting(0.4)
                .tried(&[0.02, 0.05, 0.12, 0.3, 0.8])
                .within(0.0, 2.0),
            parameter("induced_m_s", "m/s", "induced velocity in hover").known_by(Origin::HoverInduced).within(0.1, 30.0),
        ],
        terms: &[],
        // Momentum: m_a v' = T - 2 rho A v |V|. Blade elements: T = T_0 - B (v + climb). About the steady flow v_s the thrust is
        // T_s + B (v_s - v), and v follows v_s with the time constant m_a / (S + B), where S = 2 rho A * mass flow is dT/dv of the momentum. In hover
        // S is 2 g / v_h of the mass, and overshoot = B / S; with s = S over that of hover tau is tau_s (1 + overshoot) / (s + overshoot).
        swaps: &[change(
            "thrust",
            concat!(
                "thrust + overshoot * 2 * 9.80665 / induced_m_s * (",
                induced!(),
                " - lag(",
                induced!(),
                ", tau_s * (1 + overshoot) / (",
                mass_flow!(),
                " + overshoot)))"
            ),
        )],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "quick collective inputs",
            confusable_with: &["collective_lag", "rotor_droop", "climb_inflow", "transl_lift", "sync"],
            would_tell_apart: "collective steps: the flow overshoots, a servo lag never does",
            fault_of_log: Some("u4 or vz_dot with early or late time stamps: a shift is the same in climb and at speed"),
            source: "Carpenter & Fridovich, NACA TN 3044, 1953; apparent mass 8/3 rho R^3 and mass-flow parameter: Pitt & Peters 1981",
            searched: true,
        }),
    },
];
