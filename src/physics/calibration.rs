//! What a calibration found, and its table: numbers with units and intervals, signs that are in doubt. How it is found is in `calibrate`.

use super::catalogue;
use super::digits::printer;
use super::model::Model;
use super::sign_doubt::{SignDoubt, SignFinding};
use super::weights::Weights;
use std::collections::BTreeMap;

/// Numbers have settled when none would move by more than this share of its standard error, were residuals independent. They are not,
/// so the intervals are some times wider.
pub(super) const SETTLED: f64 = 1e-2;

/// One calibrated coefficient.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Value, in [`Estimate::unit`]; for a property of each flight, the mean over the flights.
    pub value: f64,
    /// 95 % confidence interval, valid for residuals that are correlated in time. `None` for a property of each flight; the intervals
    /// of the others hold given those properties, whose own uncertainty they leave out.
    pub ci95: Option<[f64; 2]>,
    /// Unit.
    pub unit: String,
    /// Values that physics allows, where the catalogue knows them. Calibration does not enforce them.
    pub bounds: Option<[f64; 2]>,
    /// For a property of each flight: its value by name of the flight.
    pub by_flight: Option<BTreeMap<String, f64>>,
}

impl Estimate {
    /// Whether the value lies where physics does not allow it.
    pub fn is_implausible(&self) -> bool {
        self.bounds.is_some_and(|[low, high]| !(low..=high).contains(&self.value))
    }
}

/// What a calibration found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Calibration {
    /// Coefficients in the order of the model.
    pub coefficients: Vec<Estimate>,
    /// Largest condition number of the column-scaled regressor matrices.
    pub condition_number: f64,
    /// Rows used, each with six accelerations.
    pub rows: usize,
    /// Stretches of consecutive rows that the intervals rest on.
    pub clusters: usize,
    /// What counted alike.
    #[serde(default)]
    pub weights: Weights,
    /// Passes over the flights; one, if the model is linear in its numbers.
    pub rounds: usize,
    /// By how much a number would still move, in half intervals.
    pub last_change: f64,
    /// Coefficients whose sign physics fixes and this calibration does not show.
    #[serde(default)]
    pub signs: Vec<SignDoubt>,
}

impl std::fmt::Display for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:<20} {:<8} {:>12}   {:<27} unit", "effect", "name", "value", "95 % interval")?;
        for estimate in &self.coefficients {
            let Estimate { effect, name, value, ci95, unit, bounds, by_flight } = estimate;
            let shown = printer(5, ci95.iter().flatten().copied().chain([*value]));
            let interval = match (ci95, by_flight) {
                (Some([low, high]), _) => format!("[{:>11}, {:>11}]", shown(*low), shown(*high)),
                (None, Some(flights)) => {
                    let (low, high) = flights
                        .values()
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
                    format!("{low:.3} to {high:.3} in {} flights", flights.len())
                }
                (None, None) => String::new(),
            };
            write!(f, "{effect:<20} {name:<8} {:>12}   {interval:<27} {unit}", shown(*value))?;
            let doubt = self.signs.iter().find(|doubt| doubt.effect == *effect && doubt.name == *name);
            match (bounds, doubt.map(|doubt| doubt.finding)) {
                (Some([low, high]), _) if estimate.is_implausible() => {
                    writeln!(f, "   outside its physical bounds {low} to {high}")?
                }
                (_, Some(SignFinding::Wrong)) => writeln!(f, "   WRONG SIGN")?,
                (_, Some(SignFinding::NotDetermined)) => writeln!(f, "   sign not determined")?,
                _ => writeln!(f)?,
            }
        }
        if self.last_change > SETTLED {
            let change = self.last_change;
            writeln!(f, "numbers still moved by {change:.1e} of half their intervals after {} passes", self.rounds)?;
        }
        write!(
            f,
            "{} rows; condition number {:.1}; intervals from {} stretches of consecutive rows",
            self.rows, self.condition_number, self.clusters
        )?;
        let wrong: Vec<&SignDoubt> = self.signs.iter().filter(|doubt| doubt.finding == SignFinding::Wrong).collect();
        wrong.iter().try_for_each(|doubt| write!(f, "\nCAUTION: {doubt}"))?;
        if !wrong.is_empty() {
            write!(
                f,
                "\n         Such a number stands in for physics that the model lacks, or a control acts otherwise than the log says."
            )?;
        }
        if self.signs.iter().any(|doubt| doubt.finding == SignFinding::NotDetermined) {
            write!(
                f,
                "\nWhere a sign is not determined, zero is possible: leave the effect out, or fly what moves it more and calibrate again."
            )?;
        }
        Ok(())
    }
}

/// The estimate of a number of a model: of an effect, a coefficient or, after these, a parameter.
pub(super) fn estimate(model: &Model, effect: usize, index: usize) -> Option<Estimate> {
    let effect = model.effects.get(effect)?;
    let number = effect.number(index)?;
    let definition = catalogue::definition(&effect.kind);
    let of_coefficient = definition.and_then(|definition| definition.coefficient(&number.name)).map(|known| known.bounds);
    let of_parameter = definition.and_then(|definition| definition.parameter(&number.name)).map(|known| known.bounds);
    Some(Estimate {
        effect: effect.name.clone(),
        name: number.name,
        value: number.value,
        ci95: number.ci95,
        unit: number.unit,
        bounds: of_coefficient.or(of_parameter).filter(|bounds| bounds.iter().all(|bound| bound.is_finite())),
        by_flight: number.by_flight,
    })
}
