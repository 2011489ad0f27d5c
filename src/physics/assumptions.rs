//! What a model says of its vehicle: whether the catalogue's usual sizes are worth a comparison, and which effects read a number that was only assumed.

use super::definition::{Origin, Vehicle};
use super::effect::Effect;
use super::model::Model;
use super::vehicle::Assumed;
use super::{baseline, catalogue};

/// Vehicle of the catalogue's usual sizes: a helicopter of 5 kg with a rotor radius of 0.8 m.
const USUAL_MASS_KG: f64 = 5.0;
const USUAL_RADIUS_M: f64 = 0.8;
/// Factor by which mass and radius may differ for the usual sizes to be worth comparing with. Accelerations per unit of speed or rate go
/// with area over mass, so three times the mass moves a usual range by about its own width.
const USUAL_FACTOR: f64 = 3.0;

impl Model {
    /// Whether the catalogue's usual sizes, which are those of a 5 kg helicopter with a rotor radius of 0.8 m, are worth a comparison.
    pub fn is_usual(&self) -> bool {
        let near = |value: f64, usual: f64| value <= usual * USUAL_FACTOR && usual <= value * USUAL_FACTOR;
        self.vehicle == Vehicle::Helicopter && near(self.mass_kg, USUAL_MASS_KG) && near(self.rotor_radius_m, USUAL_RADIUS_M)
    }

    /// The vehicle in words: `helicopter, 4.58 kg, inertia 0.18 0.34 0.28 kg m², rotor radius 0.8 m`.
    pub fn vehicle_text(&self) -> String {
        let [ix, iy, iz] = self.inertia;
        let kind = self.vehicle.name();
        format!("{kind}, {} kg, inertia {ix} {iy} {iz} kg m², rotor radius {} m", self.mass_kg, self.rotor_radius_m)
    }

    /// For each enabled effect that reads a number which was only assumed: a sentence that says so and asks for it.
    pub fn assumptions(&self) -> Vec<String> {
        if self.assumed.is_nothing() {
            return Vec::new();
        }
        let reading = |effect: &Effect| {
            let read = reads(effect);
            let [ix, iy, iz] = self.inertia;
            let all = [
                (self.assumed.mass && read.mass, format!("the mass ({} kg)", self.mass_kg), "mass_kg"),
                (self.assumed.inertia && read.inertia, format!("the moments of inertia ({ix}, {iy}, {iz} kg m²)"), "inertia"),
                (
                    self.assumed.rotor_radius && read.rotor_radius,
                    format!("the rotor radius ({} m)", self.rotor_radius_m),
                    "rotor_radius_m",
                ),
            ];
            let told: Vec<(String, &str)> = all.into_iter().filter(|entry| entry.0).map(|(_, words, key)| (words, key)).collect();
            (!told.is_empty()).then(|| {
                let (words, keys): (Vec<String>, Vec<&str>) = told.into_iter().unzip();
                format!(
                    "`{}` reads {}, assumed for want of yours: its numbers are only as good as that; give `{}` under [model]",
                    effect.name,
                    words.join(" and "),
                    keys.join("`, `")
                )
            })
        };
        self.effects.iter().filter(|effect| effect.enabled).filter_map(reading).collect()
    }
}

/// Which numbers of the vehicle the formulas and parameters of an effect are made of.
fn reads(effect: &Effect) -> Assumed {
    let mut read = Assumed::default();
    for name in effect.formulas().flat_map(|formula| formula.names()) {
        match name {
            "mass_kg" => read.mass = true,
            "ix" | "iy" | "iz" => read.inertia = true,
            "rotor_radius_m" => read.rotor_radius = true,
            _ => {}
        }
    }
    let built_in = baseline::definitions().iter().chain(catalogue::definitions()).find(|definition| definition.kind == effect.kind);
    for parameter in built_in.iter().flat_map(|definition| definition.parameters) {
        match parameter.origin {
            Origin::Number(_) => {}
            Origin::RotorRadius => read.rotor_radius = true,
            Origin::HoverInduced => (read.mass, read.rotor_radius) = (true, true),
        }
    }
    read
}

#[cfg(test)]
mod tests {
    use super::*;

    const INERTIA: [f64; 3] = [0.18, 0.34, 0.28];

    #[test]
    fn an_assumption_is_said_of_the_effects_that_read_it() {
        let mut model = Model::paper("n9", 4.58, INERTIA, 0.8);
        assert!(model.assumptions().is_empty(), "everything was given");
        model.assumed = Assumed::ALL;
        let effects = ["ground_effect", "cg_offset", "quad_drag"].into_iter().filter_map(catalogue::definition);
        model.effects.extend(effects.map(|definition| definition.effect(4.58, 0.8)));
        let said = model.assumptions();
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said[0].contains("`gyroscopic` reads the moments of inertia (0.18, 0.34, 0.28 kg m²)"), "{said:?}");
        assert!(said[1].contains("`ground_effect` reads the mass (4.58 kg) and the rotor radius (0.8 m)"), "{said:?}");
        assert!(said[2].contains("`cg_offset`") && said[2].contains("give `mass_kg`, `inertia` under [model]"), "{said:?}");
        model.assumed.mass = false;
        model.assumed.rotor_radius = false;
        assert_eq!(model.assumptions().len(), 2, "the ground effect's numbers were given now");
    }

    #[test]
    fn usual_sizes_are_those_of_a_vehicle_of_that_size() {
        let usual = |mass, radius| Model::paper("v", mass, INERTIA, radius).is_usual();
        assert!(usual(4.58, 0.8) && usual(10.0, 1.0));
        assert!(!usual(0.045, 0.0275) && !usual(90.0, 1.6) && !usual(5.0, 0.1));
        assert!(!Model { vehicle: Vehicle::Multirotor, ..Model::paper("v", 5.0, INERTIA, 0.8) }.is_usual());
    }
}
