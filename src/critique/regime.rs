//! Flight regimes: a plain name for what the helicopter does at one instant, by simple rules with units.
//!
//! The regimes are exclusive: a sample has the first one, in the order of [`Regime::ALL`], whose rule holds. They depend on
//! the recorded state alone, never on a model. Manoeuvre classes, which a person gives, are another matter.

use crate::flight::attitude::{rotate, rotation_body_to_inertial};
use crate::flight::{Column, Flight};

/// Rotation rate above which a sample is `rotation`, rad/s (57°/s: beyond station-keeping and cruise turns).
pub const ROTATION_RAD_S: f64 = 1.0;
/// Height below which a sample is `low`, m. Above 2 m a rotor of 0.8 m radius is more than two radii high, and ground effect is small.
pub const LOW_M: f64 = 2.0;
/// Speed below which a sample is `hover`, m/s.
pub const HOVER_M_S: f64 = 2.0;
/// Sine of the flight path angle from which a sample is `climb` or `descent` (30°).
pub const STEEP: f64 = 0.5;

/// What the helicopter does at one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Regime {
    /// The rotor axis points below the horizon: cos(roll) cos(pitch) < 0.
    Inverted,
    /// |w| ≥ [`ROTATION_RAD_S`]: pirouettes, flips, rolls.
    Rotation,
    /// Height −z < [`LOW_M`]; never where position was not recorded.
    Low,
    /// |v| < [`HOVER_M_S`].
    Hover,
    /// Upward speed ≥ [`STEEP`] · |v|.
    Climb,
    /// Downward speed ≥ [`STEEP`] · |v|.
    Descent,
    /// Horizontal velocity within 45° of the heading.
    Forward,
    /// Horizontal velocity within 45° of the reverse of the heading.
    Backward,
    /// Horizontal velocity more than 45° to either side.
    Sideward,
}

impl Regime {
    /// Number of regimes.
    pub const COUNT: usize = 9;

    /// All, in the order in which their rules are tried.
    #[rustfmt::skip]
    pub const ALL: [Self; Self::COUNT] = [
        Self::Inverted, Self::Rotation, Self::Low, Self::Hover, Self::Climb, Self::Descent, Self::Forward, Self::Backward, Self::Sideward,
    ];

    /// Name in files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inverted => "inverted",
            Self::Rotation => "rotation",
            Self::Low => "low",
            Self::Hover => "hover",
            Self::Climb => "climb",
            Self::Descent => "descent",
            Self::Forward => "forward",
            Self::Backward => "backward",
            Self::Sideward => "sideways",
        }
    }

    /// The rule in words, for legends.
    pub const fn rule(self) -> &'static str {
        match self {
            Self::Inverted => "rotor axis below the horizon",
            Self::Rotation => "|w| ≥ 1 rad/s",
            Self::Low => "height < 2 m",
            Self::Hover => "|v| < 2 m/s",
            Self::Climb => "flight path ≥ 30° up",
            Self::Descent => "flight path ≥ 30° down",
            Self::Forward => "velocity within 45° of the heading",
            Self::Backward => "velocity within 45° of the reverse heading",
            Self::Sideward => "velocity more than 45° to a side",
        }
    }

    /// The regime of one sample of a flight; of its last sample if `sample` is beyond the end.
    pub fn of(flight: &Flight, sample: usize) -> Self {
        let at = |column: Column| {
            let values = flight.column(column);
            values.get(sample).or(values.last()).copied().unwrap_or(0.0)
        };
        // Body to level axes: along the heading, to its right, and down.
        let level = rotation_body_to_inertial(at(Column::Roll), at(Column::Pitch), 0.0);
        if level[2][2] < 0.0 {
            return Self::Inverted;
        }
        if norm([at(Column::Wx), at(Column::Wy), at(Column::Wz)]) >= ROTATION_RAD_S {
            return Self::Rotation;
        }
        if !flight.absent.contains(&Column::Z) && -at(Column::Z) < LOW_M {
            return Self::Low;
        }
        let velocity = [at(Column::Vx), at(Column::Vy), at(Column::Vz)];
        let speed = norm(velocity);
        if speed < HOVER_M_S {
            return Self::Hover;
        }
        let [ahead, right, down] = rotate(&level, velocity);
        if down <= -STEEP * speed {
            Self::Climb
        } else if down >= STEEP * speed {
            Self::Descent
        } else if right.abs() > ahead.abs() {
            Self::Sideward
        } else if ahead < 0.0 {
            Self::Backward
        } else {
            Self::Forward
        }
    }
}

fn norm([x, y, z]: [f64; 3]) -> f64 {
    x.hypot(y).hypot(z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;
    use crate::flight::Targets;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// One sample at 10 m with the given columns.
    fn regime(set: &[(Column, f64)], absent: &[Column]) -> Result<Regime> {
        let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0]);
        columns[Column::Z as usize] = vec![-10.0];
        for (column, value) in set {
            columns[*column as usize] = vec![*value];
        }
        let mut flight = Flight::new("a", "m", 0.0, 0.01, columns, Targets::Recorded)?;
        flight.absent = absent.to_vec();
        Ok(Regime::of(&flight, 0))
    }

    #[test]
    fn each_rule_has_its_flight() -> Result<()> {
        use Column::{Pitch, Roll, Vx, Vy, Vz, Wz, Z};
        assert_eq!(regime(&[], &[])?, Regime::Hover);
        assert_eq!(regime(&[(Vx, 8.0)], &[])?, Regime::Forward);
        assert_eq!(regime(&[(Vx, -8.0)], &[])?, Regime::Backward);
        assert_eq!(regime(&[(Vy, -8.0)], &[])?, Regime::Sideward);
        assert_eq!(regime(&[(Vz, -5.0)], &[])?, Regime::Climb);
        assert_eq!(regime(&[(Vz, 5.0)], &[])?, Regime::Descent);
        assert_eq!(regime(&[(Wz, -2.0), (Vx, 8.0)], &[])?, Regime::Rotation);
        assert_eq!(regime(&[(Roll, PI), (Vx, 8.0)], &[])?, Regime::Inverted);
        assert_eq!(regime(&[(Z, -1.0), (Vx, 8.0)], &[])?, Regime::Low);
        assert_eq!(regime(&[(Z, -1.0), (Vx, 8.0)], &[Z])?, Regime::Forward);
        // Nose up by almost a right angle and moving along the nose is a climb; on the side, moving along body down is sideways.
        assert_eq!(regime(&[(Pitch, FRAC_PI_2 - 0.1), (Vx, 8.0)], &[])?, Regime::Climb);
        assert_eq!(regime(&[(Roll, FRAC_PI_2 - 0.1), (Vz, 8.0)], &[])?, Regime::Sideward);
        Ok(())
    }

    #[test]
    fn all_is_in_the_order_of_the_enum() {
        assert!(Regime::ALL.iter().enumerate().all(|(index, regime)| *regime as usize == index));
    }
}
