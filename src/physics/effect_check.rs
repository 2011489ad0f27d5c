//! Whether an effect is whole: every number of it used, every formula free of what a model predicts, every change one of a signal. What an effect is
//! stands in `effect`.

use super::compose::check_changeable;
use super::effect::Effect;
use super::evaluate::standard_names;
use crate::error::{Error, Result};
use crate::flight::Column;
use crate::formula::Formula;

impl Effect {
    /// Checks that the effect is whole: terms name coefficients it has, every coefficient is used, values are
    /// finite, and no regressor reads an acceleration.
    ///
    /// # Errors
    /// [`Error::Config`] or [`Error::Formula`] naming what is wrong; `place` is the model or file.
    pub fn check(&self, place: &str) -> Result<()> {
        let fault = |field: &str, found: String, expected: &str| {
            let field = format!("{}.{field}", self.name);
            Err(Error::Config { place: place.into(), field, found, expected: expected.into() })
        };
        for term in &self.terms {
            if let Some(name) = term.coefficient.as_deref().filter(|name| self.coefficient(name).is_none()) {
                return fault(name, "used by a term but not listed".into(), "a coefficient of the effect");
            }
            self.check_inputs(&term.regressor)?;
        }
        for swap in &self.swaps {
            self.check_inputs(&swap.with)?;
            if let Some(found) = check_changeable(swap) {
                return fault("changes", found, "a signal of the model, as `phyture effect signals` lists them");
            }
        }
        for coefficient in &self.coefficients {
            if !coefficient.value.is_finite() {
                return fault(&coefficient.name, coefficient.value.to_string(), "a finite number");
            }
            let is_read = self.formulas().flat_map(Formula::names).any(|name| name == coefficient.name);
            if !is_read && !self.terms.iter().any(|term| term.coefficient.as_ref() == Some(&coefficient.name)) {
                return fault(&coefficient.name, "listed but used by no term".into(), "a coefficient that a term multiplies");
            }
        }
        if let Some(parameter) = self.parameters.iter().find(|parameter| standard_names().contains(&parameter.name.as_str())) {
            return fault(&parameter.name, "a parameter with the name of a column".into(), "a name that no column has");
        }
        match self.parameters.iter().find(|parameter| !parameter.value.is_finite()) {
            Some(parameter) => fault(&parameter.name, parameter.value.to_string(), "a finite number"),
            None => Ok(()),
        }
    }

    /// Accelerations are what a model predicts; a regressor that reads one would answer the question with itself.
    fn check_inputs(&self, formula: &Formula) -> Result<()> {
        let is_target = |name: &str| Column::from_name(name).is_some_and(|column| Column::TARGETS.contains(&column));
        let Some(error) = formula.unknown_name(&|name| !is_target(name)) else { return Ok(()) };
        Err(match error {
            Error::Formula { formula, at, .. } => {
                let message = "an acceleration cannot be an input of the model; use `rate(…)` of the velocity".into();
                self.name_error(Error::Formula { message, formula, at })
            }
            other => other,
        })
    }
}
