//! Units that logs are written in, and their factors to SI. The one place where they stand.

use std::f64::consts::PI;

/// Name as written in `dataset.toml` and the factor to the SI unit of its dimension.
type Units = &'static [(&'static str, f64)];

const FOOT_M: f64 = 0.3048; // international foot, exact
const KNOT_M_S: f64 = 1852.0 / 3600.0; // international nautical mile an hour, exact
const DEGREE_RAD: f64 = PI / 180.0;

const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0)];
const LENGTH: Units = &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("km", 1e3), ("ft", FOOT_M)];
const ANGLE: Units = &[("rad", 1.0), ("deg", DEGREE_RAD)];
const VELOCITY: Units = &[("m/s", 1.0), ("cm/s", 1e-2), ("mm/s", 1e-3), ("km/h", 1.0 / 3.6), ("ft/s", FOOT_M), ("kt", KNOT_M_S)];
const RATE: Units = &[("rad/s", 1.0), ("deg/s", DEGREE_RAD), ("rpm", PI / 30.0)];
const ACCELERATION: Units = &[
    ("m/s^2", 1.0),
    ("m/s²", 1.0),
    ("g", super::GRAVITY_M_S2),
    ("mg", super::GRAVITY_M_S2 * 1e-3),
    ("cm/s^2", 1e-2),
    ("mm/s^2", 1e-3),
    ("ft/s^2", FOOT_M),
];
const ANGULAR_ACCELERATION: Units = &[("rad/s^2", 1.0), ("rad/s²", 1.0), ("deg/s^2", DEGREE_RAD)];
const CONTROL: Units = &[("1", 1.0), ("%", 1e-2)];
const NONE: Units = &[("1", 1.0)];

/// A word in `[units]` that stands for several columns.
pub(super) struct Group {
    /// The word.
    pub name: &'static str,
    /// The columns, by canonical name.
    pub columns: &'static [&'static str],
    units: Units,
}

/// The groups. Each column a log can have is in exactly one of them.
pub(super) const GROUPS: &[Group] = &[
    Group { name: "time", columns: &["t"], units: TIME },
    Group { name: "position", columns: &["x", "y", "z"], units: LENGTH },
    Group { name: "angles", columns: &["roll", "pitch", "yaw"], units: ANGLE },
    Group { name: "quaternion", columns: &["q1", "q2", "q3", "q4"], units: NONE },
    Group { name: "velocity", columns: &["vx", "vy", "vz"], units: VELOCITY },
    Group { name: "rates", columns: &["wx", "wy", "wz"], units: RATE },
    Group { name: "controls", columns: &["u1", "u2", "u3", "u4"], units: CONTROL },
    Group { name: "acceleration", columns: &["vx_dot", "vy_dot", "vz_dot"], units: ACCELERATION },
    Group { name: "angular_acceleration", columns: &["wx_dot", "wy_dot", "wz_dot"], units: ANGULAR_ACCELERATION },
];

impl Group {
    /// Factor from the unit of this name to SI.
    pub fn factor(&self, unit: &str) -> Option<f64> {
        self.units.iter().find(|known| known.0 == unit).map(|known| known.1)
    }

    /// The units' names, for messages.
    pub fn unit_names(&self) -> Vec<&'static str> {
        self.units.iter().map(|known| known.0).collect()
    }
}

/// The columns that a word of `[units]` or `[late]` stands for: those of the group, or the one of that name; none for another word.
pub(crate) fn columns_of(word: &str) -> &'static [&'static str] {
    let single = |group: &'static Group| group.columns.iter().find(|column| **column == word).map(std::slice::from_ref);
    let of_group = |group: &'static Group| if group.name == word { Some(group.columns) } else { single(group) };
    GROUPS.iter().find_map(of_group).unwrap_or_default()
}

/// Factor to SI of a unit of a group.
pub(super) fn factor_of(group: &str, unit: &str) -> Option<f64> {
    GROUPS.iter().find(|known| known.name == group)?.factor(unit)
}

/// All column names a log can give: `t`, the canonical columns, the quaternion.
pub(crate) fn column_names() -> impl Iterator<Item = &'static str> {
    GROUPS.iter().flat_map(|group| group.columns.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Column;

    #[test]
    fn every_column_is_in_one_group_and_si_has_factor_one() {
        for column in Column::ALL {
            assert_eq!(GROUPS.iter().filter(|group| group.columns.contains(&column.name())).count(), 1);
            let group = GROUPS.iter().find(|group| group.columns.contains(&column.name()));
            assert_eq!(group.and_then(|group| group.factor(column.unit())), Some(1.0), "{column:?}");
        }
        assert_eq!(column_names().count(), Column::COUNT + 5);
        assert_eq!((columns_of("angles"), columns_of("u2")), (&["roll", "pitch", "yaw"][..], &["u2"][..]));
        assert!(columns_of("angle").is_empty());
    }
}
