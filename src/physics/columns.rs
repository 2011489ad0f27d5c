//! A model's regressors as formulas with every number in place, and their values on a flight. For whoever wants the columns of many
//! models at once: equal formulas are equal columns. No fitting here.

use super::evaluate::{Program, Visit};
use super::model::Model;
use crate::error::Result;
use crate::flight::{Column, Flight, derived::Derived};
use crate::formula::Formula;

/// One summand of a predicted acceleration as it is evaluated: swaps and control delay applied, parameters and constants as numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Regressor {
    /// Index into [`Column::TARGETS`].
    pub channel: usize,
    /// Index of the effect in the model.
    pub effect: usize,
    /// Index of the coefficient in the effect; `None` is a fixed 1.
    pub coefficient: Option<usize>,
    /// Columns and derived quantities alone.
    pub formula: Formula,
}

impl Model {
    /// The regressors of the enabled effects that `wanted` admits, by index of the effect.
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn regressors(&self, wanted: impl Fn(usize) -> bool) -> Result<Vec<Regressor>> {
        let mut regressors = Vec::new();
        for (index, effect) in self.effects.iter().enumerate().filter(|(index, effect)| effect.enabled && wanted(*index)) {
            for term in &effect.terms {
                let regressor = self.effective_regressor(effect, &term.regressor)?;
                let number =
                    |name: &str| self.constant(effect, name).and_then(|value| Formula::parse(&format!("({value:?})")).ok());
                let formula = regressor.substitute(&number).map_err(|error| effect.name_error(error))?;
                let coefficient =
                    term.coefficient.as_ref().and_then(|name| effect.coefficients.iter().position(|c| c.name == *name));
                regressors.push(Regressor { channel: term.channel, effect: index, coefficient, formula });
            }
        }
        Ok(regressors)
    }
}

/// The first name in a formula that a flight does not carry.
pub fn missing_input<'a>(formula: &'a Formula, flight: &Flight) -> Option<&'a str> {
    let absent = |column: &Column| flight.absent.contains(column);
    let carried = |name: &str| match (Derived::from_name(name), Column::from_name(name)) {
        (Some(derived), _) => !derived.reads().iter().any(absent),
        (None, Some(column)) => !absent(&column) && !Column::TARGETS.contains(&column),
        (None, None) => flight.extra.contains_key(name),
    };
    formula.names().into_iter().find(|name| !carried(name))
}

/// Evaluates formulas from a flight's first sample to `end`, block by block: `visit` is given each block's range and one column of
/// values for each formula.
///
/// # Errors
/// [`crate::Error::Formula`] at a name the flight does not carry; those of `visit`.
pub fn evaluate_blocks(formulas: &[Formula], flight: &Flight, end: usize, visit: &mut Visit<'_>) -> Result<()> {
    Program::of_formulas(formulas, flight)?.run(flight, end, visit)
}
