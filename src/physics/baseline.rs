//! The paper's physical baseline as a list of effects (eqs. 14-15), 14 free scalars:
//!
//! v̇ = −ω×v + R_inᵇ g + A v + C₁ [0, 0, u₄]ᵀ + D₁, ω̇ = I⁻¹(−ω×(Iω)) + B ω + C₂ [u₁, u₂, u₃]ᵀ + D₂
//!
//! with diagonal A, B, C₂ and I, and C₁, D₁ along body z alone (all printed values have this form). No values: those are
//! calibrated.

use super::effect::{Coefficient, Effect, Term};
use crate::formula::Formula;

/// Name of the built-in list in a model file.
pub const PAPER: &str = "paper";

/// A built-in effect as written here.
struct Definition {
    kind: &'static str,
    meaning: &'static str,
    /// Name, unit, meaning.
    coefficients: &'static [(&'static str, &'static str, &'static str)],
    /// Channel (order of `Column::TARGETS`), coefficient, regressor.
    terms: &'static [(usize, Option<&'static str>, &'static str)],
}

/// Kinds of the paper's baseline, in the order of eqs. 14-15.
const DEFINITIONS: [Definition; 9] = [
    Definition {
        kind: "gravity",
        meaning: "weight, written in body axes: R_in^b g",
        coefficients: &[],
        terms: &[(0, None, "g_x"), (1, None, "g_y"), (2, None, "g_z")],
    },
    Definition {
        kind: "coriolis",
        meaning: "velocity is written in turning axes: -w x v",
        coefficients: &[],
        terms: &[(0, None, "vy * wz - vz * wy"), (1, None, "vz * wx - vx * wz"), (2, None, "vx * wy - vy * wx")],
    },
    Definition {
        kind: "gyroscopic",
        meaning: "angular momentum is written in turning axes: I^-1 (-w x (I w)), I diagonal",
        coefficients: &[],
        terms: &[
            (3, None, "(iy - iz) / ix * wy * wz"),
            (4, None, "(iz - ix) / iy * wz * wx"),
            (5, None, "(ix - iy) / iz * wx * wy"),
        ],
    },
    Definition {
        kind: "linear_drag",
        meaning: "force against the velocity, in proportion to it: A v, A diagonal",
        coefficients: &[
            ("a_x", "1/s", "along the nose"),
            ("a_y", "1/s", "to starboard"),
            ("a_z", "1/s", "along body down (heave)"),
        ],
        terms: &[(0, Some("a_x"), "vx"), (1, Some("a_y"), "vy"), (2, Some("a_z"), "vz")],
    },
    Definition {
        kind: "collective_thrust",
        meaning: "rotor thrust along body z, in proportion to the collective: C1 u4",
        coefficients: &[("c_z", "m/s²", "thrust over mass at full collective")],
        terms: &[(2, Some("c_z"), "u4")],
    },
    Definition {
        kind: "vertical_bias",
        meaning: "thrust at zero collective, and what else is constant: D1",
        coefficients: &[("d_z", "m/s²", "constant along body down")],
        terms: &[(2, Some("d_z"), "1")],
    },
    Definition {
        kind: "rate_damping",
        meaning: "moment against the angular velocity, in proportion to it: B w, B diagonal",
        coefficients: &[("b_x", "1/s", "roll"), ("b_y", "1/s", "pitch"), ("b_z", "1/s", "yaw")],
        terms: &[(3, Some("b_x"), "wx"), (4, Some("b_y"), "wy"), (5, Some("b_z"), "wz")],
    },
    Definition {
        kind: "control_moment",
        meaning: "moment in proportion to the stick: C2 [u1, u2, u3], C2 diagonal",
        coefficients: &[
            ("c_x", "rad/s²", "full lateral cyclic"),
            ("c_y", "rad/s²", "full longitudinal cyclic"),
            ("c_z", "rad/s²", "full tail"),
        ],
        terms: &[(3, Some("c_x"), "u1"), (4, Some("c_y"), "u2"), (5, Some("c_z"), "u3")],
    },
    Definition {
        kind: "moment_bias",
        meaning: "constant moment, as of an untrimmed stick: D2",
        coefficients: &[("d_x", "rad/s²", "roll"), ("d_y", "rad/s²", "pitch"), ("d_z", "rad/s²", "yaw")],
        terms: &[(3, Some("d_x"), "1"), (4, Some("d_y"), "1"), (5, Some("d_z"), "1")],
    },
];

/// Every built-in kind.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    DEFINITIONS.iter().map(|definition| definition.kind)
}

/// A built-in effect by kind, all coefficients zero.
pub fn built_in(kind: &str) -> Option<Effect> {
    DEFINITIONS.iter().find(|definition| definition.kind == kind).map(Definition::effect)
}

/// The paper's list, all coefficients zero.
pub fn paper() -> Vec<Effect> {
    DEFINITIONS.iter().map(Definition::effect).collect()
}

impl Definition {
    fn effect(&self) -> Effect {
        let coefficient = |&(name, unit, meaning): &(&str, &str, &str)| Coefficient {
            name: name.into(),
            value: 0.0,
            unit: unit.into(),
            ci95: None,
            meaning: meaning.into(),
        };
        let term = |&(channel, coefficient, regressor): &(usize, Option<&str>, &str)| Term {
            channel,
            coefficient: coefficient.map(str::to_owned),
            // Constants of this file, each parsed by the test below.
            regressor: Formula::parse(regressor).expect("a built-in formula parses"),
        };
        Effect {
            kind: self.kind.into(),
            name: self.kind.into(),
            meaning: self.meaning.into(),
            terms: self.terms.iter().map(term).collect(),
            coefficients: self.coefficients.iter().map(coefficient).collect(),
            parameters: Vec::new(),
            swaps: Vec::new(),
            enabled: true,
            added_by: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_effect_is_whole_and_has_a_name_of_its_own() -> crate::Result<()> {
        let effects = paper();
        for (index, effect) in effects.iter().enumerate() {
            effect.check("built-in")?;
            assert!(effects.iter().skip(index + 1).all(|other| other.name != effect.name));
            assert_eq!(built_in(&effect.kind).as_ref(), Some(effect));
        }
        assert_eq!(effects.iter().map(|effect| effect.coefficients.len()).sum::<usize>(), 14);
        assert_eq!(kinds().count(), 9);
        assert!(built_in("phlogiston").is_none());
        Ok(())
    }
}
