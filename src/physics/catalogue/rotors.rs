//! Rotors one by one, of vehicles that list them (`[[rotor]]` in the model file): what moving air and turning do to each, with the moments that follow
//! from where they sit. One number for all of them; the main rotor of a helicopter is in `rotor` and `thrust`.

use super::super::definition::{Definition, Notes, coefficient};
use super::MULTIROTOR;
use crate::flight::Channel;

pub(super) const DEFINITIONS: &[Definition] = &[
    Definition {
        kind: "rotor_inflow",
        meaning: "each rotor loses thrust to the air that comes from above at its place, which damps climbing, rolling and pitching",
        coefficients: &[coefficient("k", "kg/rad", "thrust lost by speed and axial velocity")
            .within(-1e-3, 2e-2)
            .usually(5e-7, 5e-3)
            .positive("rotors that lift more the faster they climb")],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("k"), "rotors_inflow_x / mass_kg"),
            (Channel::VyDot, Some("k"), "rotors_inflow_y / mass_kg"),
            (Channel::VzDot, Some("k"), "rotors_inflow_z / mass_kg"),
            (Channel::WxDot, Some("k"), "rotors_inflow_mx / ix"),
            (Channel::WyDot, Some("k"), "rotors_inflow_my / iy"),
            (Channel::WzDot, Some("k"), "rotors_inflow_mz / iz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "climbs, descents and quick rolls",
            confusable_with: &["speed_damping"],
            would_tell_apart: "climbs and descents at low and at high speed of the rotors: this loss goes with it, a drag of the fuselage does not",
            fault_of_log: None,
            source: "blade elements: thrust falls linearly with inflow, Mahony, Kumar & Corke 2012; 1.03e-6 kg/rad: Förster 2015 (Crazyflie 2.0)",
            searched: true,
        }),
    },
    Definition {
        kind: "rotor_drag",
        meaning: "each rotor is dragged against its motion in its own plane, by its speed; above the centre of mass that also tilts the body",
        coefficients: &[coefficient("k", "kg/rad", "drag by speed and velocity in the plane of the rotor")
            .within(-1e-3, 2e-2)
            .usually(5e-7, 5e-3)
            .positive("rotors that push in the direction of their motion")],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("k"), "rotors_drag_x / mass_kg"),
            (Channel::VyDot, Some("k"), "rotors_drag_y / mass_kg"),
            (Channel::VzDot, Some("k"), "rotors_drag_z / mass_kg"),
            (Channel::WxDot, Some("k"), "rotors_drag_mx / ix"),
            (Channel::WyDot, Some("k"), "rotors_drag_my / iy"),
            (Channel::WzDot, Some("k"), "rotors_drag_mz / iz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "forward and sideward flight",
            confusable_with: &["quad_drag", "dihedral_speedstab"],
            would_tell_apart: "steady flight at one speed with more and with less load: this drag goes with the speed of the rotors",
            fault_of_log: None,
            source: "H-force and tilt of the thrust are of one form, Ω v: Mahony, Kumar & Corke 2012; 0.92e-6 kg/rad: Förster 2015 (Crazyflie 2.0)",
            searched: true,
        }),
    },
    Definition {
        kind: "rotor_gyro",
        meaning: "the spin that the rotors have together turns a roll into a pitch and a pitch into a roll",
        coefficients: &[coefficient("inertia", "kg m²", "moment of inertia of a rotor and its motor about its axis")
            .within(-1e-5, 1e-2)
            .usually(1e-8, 1e-3)
            .positive("a rotor of negative inertia: are directions of turning the wrong way round?")],
        parameters: &[],
        terms: &[
            (Channel::WxDot, Some("inertia"), "(wz * rotors_spin_y - wy * rotors_spin_z) / ix"),
            (Channel::WyDot, Some("inertia"), "(wx * rotors_spin_z - wz * rotors_spin_x) / iy"),
            (Channel::WzDot, Some("inertia"), "(wy * rotors_spin_x - wx * rotors_spin_y) / iz"),
        ],
        swaps: &[],
        notes: Some(Notes {
            vehicles: MULTIROTOR,
            excitation: "rolls and pitches while the nose is turned by the speeds of the rotors",
            confusable_with: &["rate_cross", "inertia_cross"],
            would_tell_apart: "rolls during yaw to the left and to the right: the spin changes its sign with them",
            fault_of_log: None,
            source: "moment -ω × h of the angular momentum h of the rotors: Mahony, Kumar & Corke, IEEE Robot. Autom. Mag. 19(3), 2012",
            searched: true,
        }),
    },
];
