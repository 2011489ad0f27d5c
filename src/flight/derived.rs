//! Quantities that formulas may name besides a log's columns: `height airspeed alpha beta g_x g_y g_z`.
//!
//! Each is one line of geometry on canonical columns, without a model of anything.

use super::attitude::gravity_body;
use super::{Column, Flight};

/// Names, units and meanings.
pub const DERIVED: [(&str, &str, &str); 7] = [
    ("height", "m", "height above ground, -z"),
    ("airspeed", "m/s", "|v|: speed through still air"),
    ("alpha", "rad", "angle of attack, atan2(vz, vx)"),
    ("beta", "rad", "sideslip, atan2(vy, hypot(vx, vz))"),
    ("g_x", "m/s^2", "gravity along the nose (paper eqs. 3-4)"),
    ("g_y", "m/s^2", "gravity to starboard"),
    ("g_z", "m/s^2", "gravity along body down"),
];

/// A derived quantity as a column, from the canonical columns that `get` gives; `None` for another name or a missing column.
pub fn derived<'a>(name: &str, get: &dyn Fn(Column) -> Option<&'a [f64]>) -> Option<Vec<f64>> {
    let gravity = |axis: usize| {
        let (roll, pitch) = (get(Column::Roll)?, get(Column::Pitch)?);
        Some(roll.iter().zip(pitch).map(|(&roll, &pitch)| gravity_body(roll, pitch)[axis]).collect())
    };
    let of_velocity = |formula: fn([f64; 3]) -> f64| {
        let (x, y, z) = (get(Column::Vx)?, get(Column::Vy)?, get(Column::Vz)?);
        Some(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| formula([x, y, z])).collect())
    };
    match name {
        "height" => Some(get(Column::Z)?.iter().map(|z| -z).collect()),
        "airspeed" => of_velocity(|[x, y, z]| (x * x + y * y + z * z).sqrt()),
        "alpha" => of_velocity(|[x, _, z]| z.atan2(x)),
        "beta" => of_velocity(|[x, y, z]| y.atan2(x.hypot(z))),
        "g_x" => gravity(0),
        "g_y" => gravity(1),
        "g_z" => gravity(2),
        _ => None,
    }
}

/// A derived quantity of a flight; `None` for another name, or if a column it needs was not in the log.
pub fn of_flight(flight: &Flight, name: &str) -> Option<Vec<f64>> {
    derived(name, &|column| (!flight.absent.contains(&column)).then(|| flight.column(column)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Targets;
    use phyture_kernels::Tolerance;

    #[test]
    fn every_name_is_known_and_absent_columns_give_nothing() -> crate::Result<()> {
        let columns = std::array::from_fn(|column| vec![if column == 2 { -3.0 } else { 0.3 }]);
        let mut flight = Flight::new("a", "hover", 0.0, 0.01, columns, Targets::Recorded)?;
        for (name, ..) in DERIVED {
            assert!(of_flight(&flight, name).is_some_and(|values| values.len() == 1 && values[0].is_finite()), "{name}");
        }
        assert_eq!(of_flight(&flight, "height"), Some(vec![3.0]));
        let speed = of_flight(&flight, "airspeed").unwrap_or_default();
        assert!((speed[0] - 0.27_f64.sqrt()).abs() <= Tolerance::Close.relative_f64());
        flight.absent = vec![Column::Z];
        assert_eq!(of_flight(&flight, "height"), None);
        assert_eq!(of_flight(&flight, "vx"), None);
        Ok(())
    }
}
