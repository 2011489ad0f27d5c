//! Mass and its distribution: products of inertia, centre of mass, fuel, displaced air.

use super::super::definition::{Definition, Notes, coefficient, spread};
use super::{ANY, HELICOPTER, MULTIROTOR};
use crate::flight::Channel;

pub(super) const DEFINITIONS: &[Definition] = &[
    // Euler's equation with the tensor I - J, J symmetric with a zero diagonal, solved to first order in J:
    // I w' = I w'_0 + J w'_0 + w x (J w), w'_0 being the baseline's prediction.
    Definition {
        kind: "inertia_cross",
        meaning: "products of inertia couple the axes, and the ratios of the moments of inertia may be wrong",
        coefficients: &[
            coefficient("i_xz", "kg m²", "product of inertia xz").within(-0.1, 0.1).usually(0.01, 0.04),
            coefficient("i_xy", "kg m²", "product of inertia xy").within(-0.1, 0.1).usually(-0.01, 0.01),
            coefficient("i_yz", "kg m²", "product of inertia yz").within(-0.1, 0.1).usually(-0.01, 0.01),
            coefficient("ratio_x", "1", "error of (iy - iz) / ix").within(-1.0, 1.0).usually(-0.2, 0.2),
            coefficient("ratio_y", "1", "error of (iz - ix) / iy").within(-1.0, 1.0).usually(-0.2, 0.2),
            coefficient("ratio_z", "1", "error of (ix - iy) / iz").within(-1.0, 1.0).usually(-0.2, 0.2),
        ],
        parameters: &[],
        terms: &[
            (Channel::WxDot, Some("i_xz"), "(predicted_wz + wx * wy) / ix"),
            (Channel::WyDot, Some("i_xz"), "(wz^2 - wx^2) / iy"),
            (Channel::WzDot, Some("i_xz"), "(predicted_wx - wy * wz) / iz"),
            (Channel::WxDot, Some("i_xy"), "(predicted_wy - wx * wz) / ix"),
            (Channel::WyDot, Some("i_xy"), "(predicted_wx + wy * wz) / iy"),
            (Channel::WzDot, Some("i_xy"), "(wx^2 - wy^2) / iz"),
            (Channel::WxDot, Some("i_yz"), "(wy^2 - wz^2) / ix"),
            (Channel::WyDot, Some("i_yz"), "(predicted_wz - wx * wy) / iy"),
            (Channel::WzDot, Some("i_yz"), "(predicted_wy + wx * wz) / iz"),
            (Channel::WxDot, Some("ratio_x"), "wy * wz"),
            (Channel::WyDot, Some("ratio_y"), "wz * wx"),
            (Channel::WzDot, Some("ratio_z"), "wx * wy"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "turning about two axes at once, beyond 2 rad/s",
            confusable_with: &["rate_cross", "rotor_gyro"],
            would_tell_apart: "rolls and flips during a pirouette, and the same without it",
            fault_of_log: None,
            source: "Euler's equation: Stevens & Lewis, Aircraft Control and Simulation, 2nd ed., sec. 1.4",
            searched: true,
        }),
    },
    Definition {
        kind: "cg_offset",
        meaning: "the thrust does not pass through the centre of mass",
        coefficients: &[
            coefficient("x_m", "m", "centre of mass ahead of the mast").within(-0.05, 0.05).usually(-0.01, 0.01),
            coefficient("y_m", "m", "centre of mass to starboard of the mast").within(-0.05, 0.05).usually(-0.01, 0.01),
        ],
        parameters: &[],
        terms: &[(Channel::WyDot, Some("x_m"), "mass_kg / iy * thrust"), (Channel::WxDot, Some("y_m"), "-mass_kg / ix * thrust")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "collective over half of its range",
            confusable_with: &["ctrl_cross", "dihedral_speedstab", "trim_shift"],
            would_tell_apart: "collective steps with the cyclic held",
            fault_of_log: None,
            source: "moment m T times the offset: 1 cm is 0.45 N m in hover",
            searched: true,
        }),
    },
    Definition {
        kind: "trim_shift",
        meaning: "each flight has moments of its own: a battery or a load that was put in anew, a rotor that was changed or bent",
        coefficients: &[
            coefficient("roll", "rad/s²", "roll at 1 g of thrust").within(-60.0, 60.0).usually(-5.0, 5.0).each_flight(2.0),
            coefficient("pitch", "rad/s²", "pitch at 1 g of thrust").within(-60.0, 60.0).usually(-5.0, 5.0).each_flight(2.0),
            coefficient("yaw", "rad/s²", "yaw at 1 g of thrust").within(-60.0, 60.0).usually(-1.0, 1.0).each_flight(0.5),
        ],
        parameters: &[spread()],
        terms: &[
            (Channel::WxDot, Some("roll"), "-thrust / 9.80665"),
            (Channel::WyDot, Some("pitch"), "-thrust / 9.80665"),
            (Channel::WzDot, Some("yaw"), "-thrust / 9.80665"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "several flights, with the battery changed in between",
            confusable_with: &["wind", "cg_offset"],
            would_tell_apart: "hover on four headings: wind turns with the heading, the centre of mass does not",
            fault_of_log: Some("controls that are off by a constant of each flight: their mean in hover would move with it"),
            source: "moment m T times the offset over the moment of inertia: 0.1 mm turns a Crazyflie by 2.7 rad/s²",
            searched: true,
        }),
    },
    Definition {
        kind: "mass_drift",
        meaning: "fuel burns, the mass falls, and the same thrust accelerates it more",
        coefficients: &[coefficient("k", "1/s", "share of the mass lost per second").within(0.0, 0.01).usually(0.0002, 0.002)],
        parameters: &[],
        // Time as the log counts it: each flight is taken to start with full tanks at t = 0. The force stays as it is, and so do the moments that
        // it makes: what changes is the acceleration, not the signal.
        terms: &[(Channel::VzDot, Some("k"), "thrust * t")],
        swaps: &[],
        notes: Some(Notes {
            vehicles: HELICOPTER,
            excitation: "flights of several minutes each, with the time counted from take-off",
            confusable_with: &["rotor_droop"],
            would_tell_apart: "the same hover at the beginning and at the end of a flight",
            fault_of_log: None,
            source: "0.5 kg of fuel in 4.6 kg; drag and tilted thrust over mass change too, by less",
            searched: true,
        }),
    },
    Definition {
        kind: "added_mass",
        meaning: "the aircraft moves some air along: every force accelerates a little more mass",
        coefficients: &[coefficient("k", "1", "mass of that air over the aircraft's").within(0.0, 0.05).usually(0.002, 0.01)],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("k"), "-(g_x + linear_drag_a_x * air_vx)"),
            (Channel::VyDot, Some("k"), "-(g_y + linear_drag_a_y * air_vy)"),
            (Channel::VzDot, Some("k"), "-(g_z + thrust)"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: ANY,
            excitation: "nothing that flies like this: below 1 % of any force",
            confusable_with: &[],
            would_tell_apart: "no manoeuvre; it is listed so that it is known to be negligible",
            fault_of_log: None,
            source: "displaced air of about 0.02 kg",
            searched: false,
        }),
    },
];
