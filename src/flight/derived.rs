//! Quantities that formulas may name besides a log's columns: `t height airspeed alpha beta g_x g_y g_z`.
//!
//! Each is one line of geometry on canonical columns, without a model of anything. Row filters, models and network inputs all read
//! them here.

use super::attitude::gravity_body;
use super::{Column, Flight};

/// A quantity made from the canonical columns of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Derived {
    /// `t`, s.
    Time,
    /// `height` above ground, m: `-z`.
    Height,
    /// `airspeed` in still air, m/s: the length of `v`.
    Airspeed,
    /// `alpha`, angle of attack, rad: `atan2(vz, vx)`.
    Alpha,
    /// `beta`, sideslip, rad: `atan2(vy, hypot(vx, vz))`.
    Beta,
    /// `g_x`, gravity along the nose, m/s² (paper eqs. 3-4).
    GravityX,
    /// `g_y`, gravity to starboard, m/s².
    GravityY,
    /// `g_z`, gravity along body down, m/s².
    GravityZ,
}

impl Derived {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Time, Self::Height, Self::Airspeed, Self::Alpha, Self::Beta, Self::GravityX, Self::GravityY, Self::GravityZ];

    /// Name in formulas.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "t",
            Self::Height => "height",
            Self::Airspeed => "airspeed",
            Self::Alpha => "alpha",
            Self::Beta => "beta",
            Self::GravityX => "g_x",
            Self::GravityY => "g_y",
            Self::GravityZ => "g_z",
        }
    }

    /// The quantity of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|derived| derived.name() == name)
    }

    /// The value at a sample; `of` gives the columns that [`Derived::reads`] names.
    pub fn at(self, of: impl Fn(Column) -> f64, time_s: impl FnOnce() -> f64) -> f64 {
        let [vx, vy, vz] = [Column::Vx, Column::Vy, Column::Vz];
        let gravity = |axis: usize| gravity_body(of(Column::Roll), of(Column::Pitch))[axis];
        match self {
            Self::Time => time_s(),
            Self::Height => -of(Column::Z),
            Self::Airspeed => of(vx).hypot(of(vy)).hypot(of(vz)),
            Self::Alpha => of(vz).atan2(of(vx)),
            Self::Beta => of(vy).atan2(of(vx).hypot(of(vz))),
            Self::GravityX => gravity(0),
            Self::GravityY => gravity(1),
            Self::GravityZ => gravity(2),
        }
    }

    /// Appends the values at consecutive samples to `out`; `state` holds their columns in the order of [`Column::STATE`].
    pub fn extend(self, state: &[&[f64]; 16], time_s: &dyn Fn(usize) -> f64, samples: usize, out: &mut Vec<f64>) {
        let at = |sample: usize| self.at(|column| state[column as usize][sample], || time_s(sample));
        out.extend((0..samples).map(at));
    }

    /// Columns it is made from.
    pub const fn reads(self) -> &'static [Column] {
        match self {
            Self::Time => &[],
            Self::Height => &[Column::Z],
            Self::Airspeed | Self::Alpha | Self::Beta => &[Column::Vx, Column::Vy, Column::Vz],
            Self::GravityX | Self::GravityY | Self::GravityZ => &[Column::Roll, Column::Pitch],
        }
    }
}

/// A derived quantity as a column, from the canonical columns that `get` gives; `None` for another name or a missing column.
/// `time_s` is the time of a sample.
pub fn derived<'a>(
    name: &str,
    samples: usize,
    time_s: &dyn Fn(usize) -> f64,
    get: &dyn Fn(Column) -> Option<&'a [f64]>,
) -> Option<Vec<f64>> {
    let derived = Derived::from_name(name)?;
    let mut state: [&[f64]; 16] = [&[]; 16];
    for column in derived.reads() {
        state[*column as usize] = get(*column)?;
    }
    let mut values = Vec::with_capacity(samples);
    derived.extend(&state, time_s, samples, &mut values);
    Some(values)
}

/// A derived quantity of a flight; `None` for another name, or if a column it needs was not in the log.
pub fn of_flight(flight: &Flight, name: &str) -> Option<Vec<f64>> {
    let get = |column| (!flight.absent.contains(&column)).then(|| flight.column(column));
    derived(name, flight.len(), &|sample| flight.time_s(sample), &get)
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
        for derived in Derived::ALL {
            let name = derived.name();
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
