//! Angles of another sequence of turns than z, y, x (yaw, pitch, roll): the attitude that they mean, and the formulas that bring them to that one. Whether a log
//! has such angles is asked in `relations`.

use super::increments::Vector;
use crate::flight::attitude::{Matrix3, rotation_body_to_inertial};

/// A sequence of turns about the aircraft's own axes.
pub(super) struct Sequence {
    order: [usize; 3],
    /// As a clause.
    pub says: &'static str,
    /// The columns of the sequence z, y, x: roll = atan2(r₃₂, r₃₃), pitch = −asin(r₃₁) without the loss of digits near a quarter turn, yaw = atan2(r₂₁, r₁₁).
    pub set: &'static str,
}

impl Sequence {
    /// R_b^in = R₁ R₂ R₃ of roll (about x), pitch (about y) and yaw (about z), rad, in this order.
    pub fn rotation(&self, angles: Vector) -> Matrix3 {
        let about = |axis: usize| {
            let [roll, pitch, yaw] = std::array::from_fn(|other| if other == axis { angles[axis] } else { 0.0 });
            rotation_body_to_inertial(roll, pitch, yaw)
        };
        let product = |left: Matrix3, right: Matrix3| -> Matrix3 {
            std::array::from_fn(|row| std::array::from_fn(|column| (0..3).map(|k| left[row][k] * right[k][column]).sum()))
        };
        product(product(about(self.order[0]), about(self.order[1])), about(self.order[2]))
    }
}

/// First about x, then about y, then about z.
pub(super) const XYZ: Sequence = Sequence {
    order: [0, 1, 2],
    says: "the angles are of the sequence x, y, z of turns, where z, y, x (yaw, pitch, roll) is meant",
    set: "[columns] roll = \"atan2(cos(roll) * sin(pitch) * sin(yaw) + sin(roll) * cos(yaw), cos(roll) * cos(pitch))\", pitch = \"atan2(cos(roll) * sin(pitch) * cos(yaw) - sin(roll) * sin(yaw), hypot(cos(roll) * sin(pitch) * sin(yaw) + sin(roll) * cos(yaw), cos(roll) * cos(pitch)))\", yaw = \"atan2(sin(roll) * sin(pitch) * cos(yaw) + cos(roll) * sin(yaw), cos(pitch) * cos(yaw))\", with the file's names",
};
/// First about x, then about z, then about y.
pub(super) const XZY: Sequence = Sequence {
    order: [0, 2, 1],
    says: "the angles are of the sequence x, z, y of turns, where z, y, x (yaw, pitch, roll) is meant",
    set: "[columns] roll = \"atan2(sin(roll) * cos(yaw), sin(roll) * sin(yaw) * sin(pitch) + cos(roll) * cos(pitch))\", pitch = \"atan2(-sin(roll) * sin(yaw) * cos(pitch) + cos(roll) * sin(pitch), hypot(sin(roll) * cos(yaw), sin(roll) * sin(yaw) * sin(pitch) + cos(roll) * cos(pitch)))\", yaw = \"atan2(cos(roll) * sin(yaw) * cos(pitch) + sin(roll) * sin(pitch), cos(yaw) * cos(pitch))\", with the file's names",
};
/// First about y, then about x, then about z.
pub(super) const YXZ: Sequence = Sequence {
    order: [1, 0, 2],
    says: "the angles are of the sequence y, x, z of turns, where z, y, x (yaw, pitch, roll) is meant",
    set: "[columns] roll = \"atan2(sin(pitch) * sin(yaw) + cos(pitch) * sin(roll) * cos(yaw), cos(pitch) * cos(roll))\", pitch = \"atan2(sin(pitch) * cos(yaw) - cos(pitch) * sin(roll) * sin(yaw), hypot(sin(pitch) * sin(yaw) + cos(pitch) * sin(roll) * cos(yaw), cos(pitch) * cos(roll)))\", yaw = \"atan2(cos(roll) * sin(yaw), cos(pitch) * cos(yaw) + sin(pitch) * sin(roll) * sin(yaw))\", with the file's names",
};
/// First about y, then about z, then about x.
pub(super) const YZX: Sequence = Sequence {
    order: [1, 2, 0],
    says: "the angles are of the sequence y, z, x of turns, where z, y, x (yaw, pitch, roll) is meant",
    set: "[columns] roll = \"atan2(sin(pitch) * sin(yaw) * cos(roll) + cos(pitch) * sin(roll), -sin(pitch) * sin(yaw) * sin(roll) + cos(pitch) * cos(roll))\", pitch = \"atan2(sin(pitch) * cos(yaw), hypot(sin(pitch) * sin(yaw) * cos(roll) + cos(pitch) * sin(roll), -sin(pitch) * sin(yaw) * sin(roll) + cos(pitch) * cos(roll)))\", yaw = \"atan2(sin(yaw), cos(pitch) * cos(yaw))\", with the file's names",
};
/// First about z, then about x, then about y.
pub(super) const ZXY: Sequence = Sequence {
    order: [2, 0, 1],
    says: "the angles are of the sequence z, x, y of turns, where z, y, x (yaw, pitch, roll) is meant",
    set: "[columns] roll = \"atan2(sin(roll), cos(roll) * cos(pitch))\", pitch = \"atan2(cos(roll) * sin(pitch), hypot(sin(roll), cos(roll) * cos(pitch)))\", yaw = \"atan2(sin(yaw) * cos(pitch) + cos(yaw) * sin(roll) * sin(pitch), cos(yaw) * cos(pitch) - sin(yaw) * sin(roll) * sin(pitch))\", with the file's names",
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::{Formula, Value};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_formulas_mean_the_same_attitude(roll in -3.0..3.0_f64, pitch in -3.0..3.0_f64, yaw in -3.0..3.0_f64) {
            for sequence in [XYZ, XZY, YXZ, YZX, ZXY] {
                let value = |name: &str| match name { "roll" => roll, "pitch" => pitch, _ => yaw };
                let formulas: Vec<&str> = sequence.set.split('"').skip(1).step_by(2).collect();
                prop_assert_eq!(formulas.len(), 3);
                let angles: Vec<f64> = formulas.iter().map(|text| {
                    let formula = Formula::parse(text).expect("a formula");
                    let inputs = |name: &str| Some(Value::from(value(name)));
                    formula.evaluate(1, 0.01, &inputs).expect("a value")[0]
                }).collect();
                let meant = rotation_body_to_inertial(angles[0], angles[1], angles[2]);
                let is = sequence.rotation([roll, pitch, yaw]);
                for (meant, is) in meant.as_flattened().iter().zip(is.as_flattened()) {
                    prop_assert!((meant - is).abs() < 1e-12, "{}: {meant} {is}", sequence.says);
                }
            }
        }
    }
}
