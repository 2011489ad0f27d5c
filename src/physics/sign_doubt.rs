//! Signs that physics fixes, whatever the vehicle: damping takes energy out, a fin turns the nose into the wind. What was found is
//! laid beside them. Signs that depend on how somebody counts a stick are not among them.

use super::catalogue;
use super::digits::printer;
use super::effect::{Coefficient, Effect};
use super::model::Model;
use super::sign::Sign;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What an estimate says of a sign that physics fixes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SignFinding {
    /// As physics has it, the whole interval.
    Physical,
    /// The interval holds zero: the data do not tell.
    NotDetermined,
    /// The other way round, the whole interval.
    Wrong,
}

impl SignFinding {
    /// Judges an interval, or a value that has none, against the sign.
    pub fn of(sign: Sign, value: f64, ci95: Option<[f64; 2]>) -> Self {
        let [low, high] = ci95.unwrap_or([value, value]);
        // Turned so that the physical side is above zero.
        let [low, high] = if sign == Sign::Positive { [low, high] } else { [-high, -low] };
        match () {
            () if low > 0.0 => Self::Physical,
            () if high < 0.0 => Self::Wrong,
            () => Self::NotDetermined,
        }
    }
}

/// A coefficient whose sign physics fixes and the estimate does not show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignDoubt {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// Unit.
    pub unit: String,
    /// The sign that physics asks for.
    pub expected: Sign,
    /// What was found.
    pub finding: SignFinding,
    /// What the other sign would mean.
    pub otherwise: String,
}

impl fmt::Display for SignDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { effect, name, value, unit, .. } = self;
        let shown = printer(4, self.ci95.iter().flatten().copied().chain([*value]));
        let ci95 = self.ci95.map(|[low, high]| format!(" [{}, {}]", shown(low), shown(high))).unwrap_or_default();
        let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
        write!(f, "`{effect}` {name} = {}{ci95}{unit}: {}", shown(*value), self.words())
    }
}

impl SignDoubt {
    /// The doubt in a few words.
    pub fn words(&self) -> String {
        match self.finding {
            SignFinding::Physical => "as physics has it".into(),
            SignFinding::NotDetermined => "sign not determined".into(),
            SignFinding::Wrong => format!("wrong sign ({}); by physics it is {}", self.otherwise, self.expected.word()),
        }
    }
}

/// The sign that physics fixes for a coefficient of an effect, and what the other one would mean; `None` where either is possible.
pub fn physical_sign(effect: &Effect, name: &str) -> Option<(Sign, &'static str)> {
    catalogue::definition(&effect.kind)?.coefficient(name)?.physical_sign()
}

/// Judges one coefficient; `None` where physics fixes no sign, and for a property of each flight.
pub fn doubt(effect: &Effect, coefficient: &Coefficient) -> Option<SignDoubt> {
    let (expected, otherwise) = physical_sign(effect, &coefficient.name).filter(|_| coefficient.by_flight.is_none())?;
    Some(SignDoubt {
        effect: effect.name.clone(),
        name: coefficient.name.clone(),
        value: coefficient.value,
        ci95: coefficient.ci95,
        unit: coefficient.unit.clone(),
        expected,
        finding: SignFinding::of(expected, coefficient.value, coefficient.ci95),
        otherwise: otherwise.into(),
    })
}

impl Model {
    /// The coefficients of enabled effects whose sign is wrong or not determined, in the order of the model.
    pub fn sign_doubts(&self) -> Vec<SignDoubt> {
        let enabled = self.effects.iter().filter(|effect| effect.enabled);
        let all = enabled.flat_map(|effect| effect.coefficients.iter().filter_map(move |coefficient| doubt(effect, coefficient)));
        all.filter(|doubt| doubt.finding != SignFinding::Physical).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_right_wrong_or_holds_zero() {
        use SignFinding::{NotDetermined, Physical, Wrong};
        for (ci, positive, negative) in [
            ([0.1, 0.5], Physical, Wrong),
            ([-0.5, -0.1], Wrong, Physical),
            ([-0.1, 0.5], NotDetermined, NotDetermined),
            ([0.0, 0.5], NotDetermined, NotDetermined),
            ([-0.5, 0.0], NotDetermined, NotDetermined),
            ([0.0, 0.0], NotDetermined, NotDetermined),
        ] {
            let middle = 0.5 * (ci[0] + ci[1]);
            assert_eq!(SignFinding::of(Sign::Positive, middle, Some(ci)), positive, "{ci:?}");
            assert_eq!(SignFinding::of(Sign::Negative, middle, Some(ci)), negative, "{ci:?}");
        }
        assert_eq!(SignFinding::of(Sign::Negative, 1.58, None), Wrong);
    }

    #[test]
    fn anti_damping_is_doubted_and_a_stick_of_either_sign_is_not() {
        let mut model = Model::paper("crazyflie", 0.045, [1.66e-5, 1.66e-5, 2.93e-5], 0.0275);
        for effect in &mut model.effects {
            for coefficient in &mut effect.coefficients {
                (coefficient.value, coefficient.ci95) = (-1.0, Some([-1.5, -0.5]));
            }
        }
        assert!(model.sign_doubts().is_empty(), "{:?}", model.sign_doubts());
        let damping = model.effect_mut("rate_damping").and_then(|effect| effect.coefficient_mut("b_x"));
        damping.into_iter().for_each(|b| (b.value, b.ci95) = (1.58, Some([1.23, 1.93])));
        let moment = model.effect_mut("control_moment").and_then(|effect| effect.coefficient_mut("c_x"));
        moment.into_iter().for_each(|c| (c.value, c.ci95) = (32.8, Some([13.0, 52.0])));
        let doubts = model.sign_doubts();
        let text = doubts.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
        assert_eq!(doubts.len(), 1, "{text}");
        assert!(text.contains("`rate_damping` b_x = 1.5800 [1.2300, 1.9300] 1/s: wrong sign (anti-damping)"), "{text}");
    }

    #[test]
    fn a_fixed_sign_agrees_with_bounds_and_usual_values() {
        for definition in catalogue::definitions() {
            for coefficient in definition.coefficients {
                let Some((sign, otherwise)) = coefficient.physical_sign() else { continue };
                let [low, high] = sign.bounds(coefficient.bounds);
                assert!(low < high && !otherwise.is_empty(), "{}.{}", definition.kind, coefficient.name);
                let usual = coefficient.expected.unwrap_or_default();
                assert!(low <= usual[0] && usual[1] <= high, "{}.{}: {usual:?}", definition.kind, coefficient.name);
            }
        }
    }
}
