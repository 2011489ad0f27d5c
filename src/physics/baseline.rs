//! The paper's physical baseline as a list of effects (eqs. 14-15), 14 free scalars:
//!
//! v̇ = −ω×v + R_inᵇ g + A v + C₁ [0, 0, u₄]ᵀ + D₁, ω̇ = I⁻¹(−ω×(Iω)) + B ω + C₂ [u₁, u₂, u₃]ᵀ + D₂
//!
//! with diagonal A, B, C₂ and I, and C₁, D₁ along body z alone (all printed values have this form). No values: those are
//! calibrated.

use super::definition::{Definition, coefficient};
use crate::flight::Channel;

/// Name of the built-in list in a model file.
pub const PAPER: &str = "paper";

/// Kinds of the paper's baseline, in the order of eqs. 14-15.
const DEFINITIONS: [Definition; 9] = [
    Definition {
        kind: "gravity",
        meaning: "weight, written in body axes: R_in^b g",
        coefficients: &[],
        parameters: &[],
        terms: &[(Channel::VxDot, None, "g_x"), (Channel::VyDot, None, "g_y"), (Channel::VzDot, None, "g_z")],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "coriolis",
        meaning: "velocity is written in turning axes: -w x v",
        coefficients: &[],
        parameters: &[],
        terms: &[
            (Channel::VxDot, None, "vy * wz - vz * wy"),
            (Channel::VyDot, None, "vz * wx - vx * wz"),
            (Channel::VzDot, None, "vx * wy - vy * wx"),
        ],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "gyroscopic",
        meaning: "angular momentum is written in turning axes: I^-1 (-w x (I w)), I diagonal",
        coefficients: &[],
        parameters: &[],
        terms: &[
            (Channel::WxDot, None, "(iy - iz) / ix * wy * wz"),
            (Channel::WyDot, None, "(iz - ix) / iy * wz * wx"),
            (Channel::WzDot, None, "(ix - iy) / iz * wx * wy"),
        ],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "linear_drag",
        meaning: "force against the velocity, in proportion to it: A v, A diagonal",
        coefficients: &[
            coefficient("a_x", "1/s", "along the nose").negative("drag that pushes"),
            coefficient("a_y", "1/s", "to starboard").negative("drag that pushes"),
            coefficient("a_z", "1/s", "along body down (heave)").negative("drag that pushes"),
        ],
        parameters: &[],
        terms: &[
            (Channel::VxDot, Some("a_x"), "air_vx"),
            (Channel::VyDot, Some("a_y"), "air_vy"),
            (Channel::VzDot, Some("a_z"), "air_vz"),
        ],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "collective_thrust",
        meaning: "rotor thrust along body z, in proportion to the collective: C1 u4",
        coefficients: &[coefficient("c_z", "m/s²", "thrust over mass at full collective")],
        parameters: &[],
        terms: &[(Channel::VzDot, Some("c_z"), "u4")],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "vertical_bias",
        meaning: "thrust at zero collective, and what else is constant: D1",
        coefficients: &[coefficient("d_z", "m/s²", "constant along body down")],
        parameters: &[],
        terms: &[(Channel::VzDot, Some("d_z"), "1")],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "rate_damping",
        meaning: "moment against the angular velocity, in proportion to it: B w, B diagonal",
        coefficients: &[
            coefficient("b_x", "1/s", "roll").negative("anti-damping"),
            coefficient("b_y", "1/s", "pitch").negative("anti-damping"),
            coefficient("b_z", "1/s", "yaw").negative("anti-damping"),
        ],
        parameters: &[],
        terms: &[(Channel::WxDot, Some("b_x"), "wx"), (Channel::WyDot, Some("b_y"), "wy"), (Channel::WzDot, Some("b_z"), "wz")],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "control_moment",
        meaning: "moment in proportion to the stick: C2 [u1, u2, u3], C2 diagonal",
        coefficients: &[
            coefficient("c_x", "rad/s²", "full lateral cyclic"),
            coefficient("c_y", "rad/s²", "full longitudinal cyclic"),
            coefficient("c_z", "rad/s²", "full tail"),
        ],
        parameters: &[],
        terms: &[(Channel::WxDot, Some("c_x"), "u1"), (Channel::WyDot, Some("c_y"), "u2"), (Channel::WzDot, Some("c_z"), "u3")],
        swaps: &[],
        notes: None,
    },
    Definition {
        kind: "moment_bias",
        meaning: "constant moment, as of an untrimmed stick: D2",
        coefficients: &[
            coefficient("d_x", "rad/s²", "roll"),
            coefficient("d_y", "rad/s²", "pitch"),
            coefficient("d_z", "rad/s²", "yaw"),
        ],
        parameters: &[],
        terms: &[(Channel::WxDot, Some("d_x"), "1"), (Channel::WyDot, Some("d_y"), "1"), (Channel::WzDot, Some("d_z"), "1")],
        swaps: &[],
        notes: None,
    },
];

/// The definitions of the paper's baseline, in the order of eqs. 14-15.
pub fn definitions() -> &'static [Definition] {
    &DEFINITIONS
}

#[cfg(test)]
mod tests {
    use super::super::{Model, catalogue};

    #[test]
    fn every_effect_of_the_baseline_is_whole_and_has_a_name_of_its_own() -> crate::Result<()> {
        let effects = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8).effects;
        for (index, effect) in effects.iter().enumerate() {
            effect.check("built-in")?;
            assert!(effects.iter().skip(index + 1).all(|other| other.name != effect.name));
            assert_eq!(catalogue::definition(&effect.kind).map(|definition| definition.effect(4.58, 0.8)).as_ref(), Some(effect));
        }
        assert_eq!(effects.iter().map(|effect| effect.coefficients.len()).sum::<usize>(), 14);
        assert_eq!(effects.len(), 9);
        Ok(())
    }
}
