//! Signs that physics fixes, in a search: a coefficient whose whole interval lies on the wrong side of zero is held on the right one,
//! and the search is done once more. What then still removes error is there; what only the wrong sign made useful is not.

use super::found::Found;
use super::report::Number;
use super::search::Search;
use crate::error::Result;
use crate::physics::{Model, SignFinding, doubt};

/// Coefficients of accepted effects found on the wrong side of zero, by kind of effect and name.
pub(super) fn wrong(found: &[Found]) -> Vec<(String, String)> {
    let of = |found: &Found| {
        let kind = found.model.effect(&found.step.effect).map(|effect| effect.kind.clone()).unwrap_or_default();
        let wrong = found.step.coefficients.iter().filter(|number| number.sign == Some(SignFinding::Wrong));
        wrong.map(|number| (kind.clone(), number.name.clone())).collect::<Vec<_>>()
    };
    found.iter().flat_map(of).collect()
}

impl Search<'_> {
    /// Judges the signs of the accepted effects' numbers, as they stand in `model` with their intervals.
    pub(super) fn judge_signs(&self, model: &Model, found: &mut [Found]) {
        for found in found {
            let Some(effect) = model.effect(&found.step.effect) else { continue };
            for (number, coefficient) in found.step.coefficients.iter_mut().zip(&effect.coefficients) {
                number.sign = doubt(effect, coefficient).map(|doubt| doubt.finding);
                number.held = self.engine.held.iter().any(|(kind, name)| *kind == effect.kind && *name == coefficient.name);
            }
        }
    }

    /// What is to be said of the model's own numbers: those with the wrong sign.
    pub(super) fn sign_notes(&self, model: &Model) -> Result<Vec<String>> {
        let mut model = model.clone();
        for ((effect, coefficient), interval) in super::resample::resampled(&self.engine, &model, self.options.seed)?.intervals {
            if let Some(coefficient) = model.effects.get_mut(effect).and_then(|effect| effect.coefficients.get_mut(coefficient)) {
                coefficient.ci95 = Some(interval);
            }
        }
        Ok(wrong_signs(&model))
    }
}

/// What is to be said of the numbers whose intervals lie on the wrong side of zero.
pub(super) fn wrong_signs(model: &Model) -> Vec<String> {
    let doubts = model.sign_doubts();
    doubts.iter().filter(|doubt| doubt.finding == SignFinding::Wrong).map(ToString::to_string).collect()
}

/// What there is to say of the sign of an accepted effect's number, to stand behind it; nothing where it is as physics has it.
pub fn number_remark(number: &Number) -> &'static str {
    match (number.held, number.sign) {
        (true, _) => "; held at the sign that physics gives it, only the other one would fit",
        (false, Some(SignFinding::NotDetermined)) => "; sign not determined",
        (false, Some(SignFinding::Wrong)) => "; WRONG SIGN",
        (false, _) => "",
    }
}
