//! How a built-in effect is written down in this crate: its formulas, and what is known about its numbers before any data.
//! The baseline and the catalogue are lists of these; no evaluation and no search here.

use super::effect::{Coefficient, Effect, Parameter, Swap, Term};
use super::sign::Sign;
use crate::flight::{Channel, GRAVITY_M_S2};
use crate::formula::Formula;

/// Air density of the standard atmosphere at about 200 m, kg/m³: for the induced velocity in hover.
pub const AIR_DENSITY_KG_M3: f64 = 1.2;

/// What kind of aircraft an effect makes sense for, and a model describes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Vehicle {
    /// A single main rotor with swash plate, and a tail rotor.
    #[default]
    Helicopter,
    /// Several rotors that differ in speed.
    Multirotor,
}

impl Vehicle {
    /// All.
    pub const ALL: [Self; 2] = [Self::Helicopter, Self::Multirotor];

    /// Name in model files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Helicopter => "helicopter",
            Self::Multirotor => "multirotor",
        }
    }
}

/// Where the number of a parameter comes from before any search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// This number.
    Number(f64),
    /// The model's rotor radius, m.
    RotorRadius,
    /// Induced velocity in hover by momentum theory, √(m g / (2 ρ π R²)), m/s.
    HoverInduced,
}

/// A number that calibration finds, before it has.
#[derive(Clone, Copy, Debug)]
pub struct CoefficientDefinition {
    /// Name, unique in its effect.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// What it stands for, in a few words.
    pub meaning: &'static str,
    /// Values that physics allows; a search refuses others.
    pub bounds: [f64; 2],
    /// Usual values for a 5 kg helicopter, for a person to compare with.
    pub expected: Option<[f64; 2]>,
    /// For a property of each flight (wind, bias): its usual standard deviation from flight to flight. `None` is one number for all.
    pub by_flight: Option<f64>,
    /// The sign that physics fixes, and what the other one would mean. Bounds may reach a little beyond zero, so that an estimate near
    /// zero is not bent.
    pub sign: Option<(Sign, &'static str)>,
}

impl CoefficientDefinition {
    /// One of the baseline: nothing is presumed about its value.
    const fn free(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { name, unit, meaning, bounds: [f64::NEG_INFINITY, f64::INFINITY], expected: None, by_flight: None, sign: None }
    }

    /// The same, to lie within bounds.
    #[must_use]
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.bounds = [low, high];
        self
    }

    /// The same, usually within these.
    #[must_use]
    pub const fn usually(mut self, low: f64, high: f64) -> Self {
        self.expected = Some([low, high]);
        self
    }

    /// The same, positive by physics; a negative one would be what `otherwise` says.
    #[must_use]
    pub const fn positive(mut self, otherwise: &'static str) -> Self {
        self.sign = Some((Sign::Positive, otherwise));
        self
    }

    /// The same, negative by physics; a positive one would be what `otherwise` says.
    #[must_use]
    pub const fn negative(mut self, otherwise: &'static str) -> Self {
        self.sign = Some((Sign::Negative, otherwise));
        self
    }

    /// The sign that physics fixes, stated or by bounds that end at zero, and what the other one would mean.
    pub fn physical_sign(&self) -> Option<(Sign, &'static str)> {
        let [low, high] = self.bounds;
        let bounded = (low >= 0.0).then_some(Sign::Positive).or((high <= 0.0).then_some(Sign::Negative));
        self.sign.or(bounded.map(|sign| (sign, "the opposite of its physics")))
    }

    /// Of a property of each flight: its standard deviation from flight to flight in an effect, at the effect's [`SPREAD`].
    pub fn deviation_in(&self, effect: &Effect) -> Option<f64> {
        let spread = effect.parameters.iter().find(|parameter| parameter.name == SPREAD);
        Some(self.by_flight? * spread.map_or(1.0, |spread| spread.value))
    }

    /// The same as a property of each flight with this standard deviation.
    #[must_use]
    pub const fn each_flight(mut self, deviation: f64) -> Self {
        self.by_flight = Some(deviation);
        self
    }
}

/// A coefficient without bounds; see the methods of [`CoefficientDefinition`] for more.
pub const fn coefficient(name: &'static str, unit: &'static str, meaning: &'static str) -> CoefficientDefinition {
    CoefficientDefinition::free(name, unit, meaning)
}

/// A number inside the formulas.
#[derive(Clone, Copy, Debug)]
pub struct ParameterDefinition {
    /// Name in the formulas.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// What it stands for, in a few words.
    pub meaning: &'static str,
    /// Its value before any search.
    pub origin: Origin,
    /// Values that a search tries; empty if it is known beforehand.
    pub grid: &'static [f64],
    /// Values that a refinement may reach.
    pub bounds: [f64; 2],
    /// A parameter of the same effect with which it moves on the grid (the same time constant in roll and pitch); refined by itself.
    pub tied_to: Option<&'static str>,
}

impl ParameterDefinition {
    /// The same with this number before any search.
    #[must_use]
    pub const fn starting(mut self, number: f64) -> Self {
        self.origin = Origin::Number(number);
        self
    }

    /// The same, taken from what the model knows about the vehicle.
    #[must_use]
    pub const fn known_by(mut self, origin: Origin) -> Self {
        self.origin = origin;
        self
    }

    /// The same, these values being tried by a search.
    #[must_use]
    pub const fn tried(mut self, grid: &'static [f64]) -> Self {
        self.grid = grid;
        self
    }

    /// The same, to lie within bounds.
    #[must_use]
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.bounds = [low, high];
        self
    }

    /// The same, moving on the grid together with another parameter of the effect.
    #[must_use]
    pub const fn tied(mut self, to: &'static str) -> Self {
        self.tied_to = Some(to);
        self
    }
}

/// A parameter that is zero, known and without bounds; see the methods of [`ParameterDefinition`] for more.
pub const fn parameter(name: &'static str, unit: &'static str, meaning: &'static str) -> ParameterDefinition {
    let bounds = [f64::NEG_INFINITY, f64::INFINITY];
    ParameterDefinition { name, unit, meaning, origin: Origin::Number(0.0), grid: &[], bounds, tied_to: None }
}

/// Name of the parameter that says how far the numbers of flights spread, as a share of the usual.
pub const SPREAD: &str = "spread";

/// How far what each flight has for itself (wind, biases) spreads from flight to flight, as a share of what is usual. No formula reads it: it scales
/// the prior of these numbers, and a search chooses it by the error on blocks that a flight's numbers have not seen (empirical Bayes;
/// Efron & Morris 1973, J. American Statistical Association 68:117). With the usual spread alone a light wind costs more error than it removes.
pub const fn spread() -> ParameterDefinition {
    parameter(SPREAD, "1", "standard deviation from flight to flight, as a share of the usual")
        .starting(1.0)
        .tried(&[0.06, 0.15, 0.4, 1.0])
        .within(0.02, 2.0)
}

/// A change to signals that other effects read; see [`Swap`].
#[derive(Clone, Copy, Debug)]
pub struct SwapDefinition {
    /// Name replaced.
    pub name: &'static str,
    /// What stands there instead.
    pub with: &'static str,
    /// Effects it changes; empty means all.
    pub within: &'static [&'static str],
}

impl SwapDefinition {
    /// The same for these effects alone.
    #[must_use]
    pub const fn within(mut self, effects: &'static [&'static str]) -> Self {
        self.within = effects;
        self
    }
}

/// A change to a signal for all who read it.
pub const fn change(name: &'static str, with: &'static str) -> SwapDefinition {
    SwapDefinition { name, with, within: &[] }
}

/// What a search and a person need to know about an effect that may be missing.
#[derive(Clone, Copy, Debug)]
pub struct Notes {
    /// Vehicles it makes sense for.
    pub vehicles: &'static [Vehicle],
    /// What the flights have to contain for it to show.
    pub excitation: &'static str,
    /// Identifiers of effects that look alike.
    pub confusable_with: &'static [&'static str],
    /// The manoeuvre that would tell it from those.
    pub would_tell_apart: &'static str,
    /// What is wrong with a log that looks like it, and how the two would differ.
    pub fault_of_log: Option<&'static str>,
    /// Where the formula and the sizes come from.
    pub source: &'static str,
    /// Whether a search tries it; a negligible effect is listed only.
    pub searched: bool,
}

/// A built-in effect.
///
/// Formulas may name, besides columns, [signals](super::SIGNALS) and their own numbers, the model's numbers (`mass_kg`, `ix`, …) and
/// a coefficient of another effect as `<effect>_<coefficient>`, for example `control_moment_c_x`.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// Identifier.
    pub kind: &'static str,
    /// The physics in one sentence.
    pub meaning: &'static str,
    /// Numbers that calibration finds.
    pub coefficients: &'static [CoefficientDefinition],
    /// Numbers inside the formulas.
    pub parameters: &'static [ParameterDefinition],
    /// Channel (order of `Column::TARGETS`), coefficient (`None` is a fixed 1), regressor.
    pub terms: &'static [(Channel, Option<&'static str>, &'static str)],
    /// Changes to signals.
    pub swaps: &'static [SwapDefinition],
    /// Set for the effects of the catalogue; the baseline has none.
    pub notes: Option<Notes>,
}

impl Definition {
    /// The effect with all coefficients zero and every parameter at its origin, for a vehicle of this mass (kg) and rotor radius (m).
    pub fn effect(&self, mass_kg: f64, rotor_radius_m: f64) -> Effect {
        let coefficient = |definition: &CoefficientDefinition| Coefficient {
            name: definition.name.into(),
            value: 0.0,
            unit: definition.unit.into(),
            ci95: None,
            meaning: definition.meaning.into(),
            by_flight: definition.by_flight.map(|_| std::collections::BTreeMap::new()),
        };
        let disc_m2 = std::f64::consts::PI * rotor_radius_m * rotor_radius_m;
        let parameter = |definition: &ParameterDefinition| Parameter {
            name: definition.name.into(),
            value: match definition.origin {
                Origin::Number(number) => number,
                Origin::RotorRadius => rotor_radius_m,
                Origin::HoverInduced => (mass_kg * GRAVITY_M_S2 / (2.0 * AIR_DENSITY_KG_M3 * disc_m2)).sqrt(),
            },
            unit: definition.unit.into(),
            fixed: definition.grid.is_empty(),
            ci95: None,
        };
        // Formulas here are constants of this crate; a test parses each.
        let parse = |text: &str| Formula::parse(text).expect("a built-in formula parses");
        Effect {
            kind: self.kind.into(),
            name: self.kind.into(),
            meaning: self.meaning.into(),
            terms: self
                .terms
                .iter()
                .map(|&(channel, coefficient, regressor)| Term {
                    channel,
                    coefficient: coefficient.map(str::to_owned),
                    regressor: parse(regressor),
                })
                .collect(),
            coefficients: self.coefficients.iter().map(coefficient).collect(),
            parameters: self.parameters.iter().map(parameter).collect(),
            swaps: self
                .swaps
                .iter()
                .map(|swap| Swap {
                    name: swap.name.into(),
                    with: parse(swap.with),
                    within: swap.within.iter().map(|&name| name.into()).collect(),
                })
                .collect(),
            enabled: true,
            added_by: None,
        }
    }

    /// The coefficient of this name.
    pub fn coefficient(&self, name: &str) -> Option<&CoefficientDefinition> {
        self.coefficients.iter().find(|coefficient| coefficient.name == name)
    }

    /// The parameter of this name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterDefinition> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}
