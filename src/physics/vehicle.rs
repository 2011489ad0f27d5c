//! Mass, inertia and rotor of a vehicle: what is possible, and what was assumed for want of a number. Which effects such an assumption reaches is in
//! `assumptions`. No model, no file and no flight here.

use serde::{Deserialize, Serialize};

/// Masses of unmanned aircraft, kg: from 1 g to a tonne.
pub const MASS_KG: [f64; 2] = [0.001, 1000.0];

/// Rotor radii of unmanned aircraft, m: from 5 mm to 20 m.
pub const ROTOR_RADIUS_M: [f64; 2] = [0.005, 20.0];

/// Slack of the triangle inequality of moments of inertia, relative: a flat plate meets it with equality, up to rounding.
const FLAT: f64 = 1e-9;

/// Numbers of the vehicle that nobody gave and that are taken from the paper's aircraft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Assumed {
    /// The mass.
    pub mass: bool,
    /// The moments of inertia.
    pub inertia: bool,
    /// The rotor radius.
    pub rotor_radius: bool,
}

impl Assumed {
    /// Everything about the vehicle.
    pub const ALL: Self = Self { mass: true, inertia: true, rotor_radius: true };

    /// Whether everything was given.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }
}

/// A number of the vehicle that cannot be.
pub(super) struct Fault {
    /// Key of the model file.
    pub field: &'static str,
    /// What was found.
    pub found: String,
    /// What was expected, and a guess at the slip.
    pub expected: String,
}

/// The first number of a vehicle that no unmanned aircraft has.
pub(super) fn fault(mass_kg: f64, inertia: [f64; 3], rotor_radius_m: f64) -> Option<Fault> {
    if let Some(value) = inertia.into_iter().find(|value| !(*value > 0.0 && value.is_finite())) {
        return Some(Fault { field: "inertia", found: value.to_string(), expected: "positive, finite moments, kg m²".into() });
    }
    let bounded =
        [("mass_kg", mass_kg, MASS_KG, "kg", "grams"), ("rotor_radius_m", rotor_radius_m, ROTOR_RADIUS_M, "m", "millimetres")];
    for (field, value, [low, high], unit, thousandth) in bounded {
        if (low..=high).contains(&value) {
            continue;
        }
        let small = value / 1000.0;
        let slip = if (low..=high).contains(&small) && value > high {
            format!("; {value} looks like {thousandth}: {small} {unit}?")
        } else {
            String::new()
        };
        let expected = format!("a positive number of {low} to {high} {unit}, as unmanned aircraft have{slip}");
        return Some(Fault { field, found: value.to_string(), expected });
    }
    let [ix, iy, iz] = inertia;
    let axes = [("x", ix, "y", iy, "z", iz), ("y", iy, "x", ix, "z", iz), ("z", iz, "x", ix, "y", iy)];
    axes.into_iter().find(|(_, one, _, other, _, third)| *one > (other + third) * (1.0 + FLAT)).map(
        |(axis, one, b, other, c, third)| Fault {
            field: "inertia",
            found: format!("[{ix}, {iy}, {iz}]: the moment about {axis}, {one}, exceeds the sum of the others, {}", other + third),
            expected: format!(
                "moments that some body can have: about {axis} no more than about {b} and {c} together (a mix-up of units or axes?)"
            ),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const INERTIA: [f64; 3] = [0.18, 0.34, 0.28];

    #[test]
    fn grams_and_millimetres_are_recognised_and_what_no_aircraft_has_is_refused() {
        for (mass, inertia, radius, field, hint) in [
            (4580.0, INERTIA, 0.8, "mass_kg", "grams: 4.58 kg?"),
            (0.0, INERTIA, 0.8, "mass_kg", "positive"),
            (f64::NAN, INERTIA, 0.8, "mass_kg", "0.001 to 1000 kg"),
            (4.58, INERTIA, 800.0, "rotor_radius_m", "millimetres: 0.8 m?"),
            (4.58, [0.18, 0.34, 0.6], 0.8, "inertia", "about z no more than"),
            (4.58, [0.7, 0.34, 0.28], 0.8, "inertia", "about x no more than"),
            (4.58, [0.18, -0.34, 0.28], 0.8, "inertia", "positive"),
        ] {
            let found = fault(mass, inertia, radius);
            let says = found.as_ref().is_some_and(|fault| fault.field == field && fault.expected.contains(hint));
            assert!(says, "{mass} {inertia:?} {radius}: {:?}", found.map(|fault| fault.expected));
        }
        // From a gram to a tonne, and a flat plate.
        for (mass, inertia) in [(0.001, INERTIA), (1000.0, INERTIA), (0.045, [1.66e-5, 1.66e-5, 3.32e-5])] {
            assert!(fault(mass, inertia, 0.0275).is_none(), "{mass}");
        }
    }
}
