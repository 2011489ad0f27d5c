//! A formula that the shape of a dependence suggests is tried before it is given to anybody: calibrated with the model on what was
//! searched, and measured on what was not.

use super::candidate::{FOUND, with};
use super::confirm::confirm;
use super::engine::Engine;
use super::report::{TriedFormula, UnknownChannel};
use crate::critique::unknown::Unknown;
use crate::error::{Error, Result};
use crate::flight::{Channel, Span};
use crate::physics::{Effect, FORMULA_COEFFICIENT, Model};

/// What confirms a formula.
pub(super) struct Unseen<'a> {
    /// The spans that no search has seen.
    pub spans: &'a [Span],
    /// Their name.
    pub part: &'a str,
    /// Length of a block, s.
    pub block_s: f64,
}

/// What the names of suggested effects begin with.
const SUGGESTED: &str = "suggested_";

/// Name of the effect that a suggestion becomes in a model file.
pub(super) fn name(channel: &str) -> String {
    format!("{SUGGESTED}{channel}")
}

/// Whether an effect of this name is a formula that the rest of the error suggested.
pub(super) fn is_suggested(effect: &str) -> bool {
    effect.starts_with(SUGGESTED)
}

/// The formulas that held on unseen flights as effects of a model, switched off, under names that are free in it.
///
/// # Errors
/// [`Error::Formula`] for one that cannot be read.
pub(super) fn standing(unknown: &[UnknownChannel], model: &Model) -> Result<Vec<Effect>> {
    let effect = |unknown: &UnknownChannel| {
        let (formula, coefficient) = unknown.suggested_formula.as_ref().zip(unknown.suggested_coefficient)?;
        let channel = Channel::from_name(&unknown.channel)?;
        let plain = name(&unknown.channel);
        let numbered = (2..).map(|number| format!("{plain}_{number}"));
        let free = std::iter::once(plain.clone()).chain(numbered).find(|name| model.effect(name).is_none())?;
        let made = Effect::formula(free, channel, formula, coefficient);
        Some(made.map(|effect| Effect { enabled: false, added_by: Some(FOUND.into()), ..effect }))
    };
    unknown.iter().filter_map(effect).collect()
}

/// The suggested formula of one dependence beside `model`, on its own. `None` without a suggestion, or where the blocks do not
/// determine its coefficient beside the model's.
pub(super) fn tried(engine: &Engine<'_>, model: &Model, unknown: &Unknown, unseen: &Unseen<'_>) -> Result<Option<TriedFormula>> {
    let Some(suggested) = &unknown.suggested_formula else { return Ok(None) };
    let Some(channel) = Channel::from_name(unknown.channel) else { return Ok(None) };
    let effect = Effect::formula(name(unknown.channel), channel, &suggested.formula, suggested.coefficient)?;
    let pass = match engine.pass(model, &[with(model, &effect)]) {
        Err(Error::Undetermined(_)) => return Ok(None),
        pass => pass?,
    };
    let Some(trial) = pass.trials.into_iter().next().flatten() else { return Ok(None) };
    let held_out_mse_fall = 1.0 - engine.mse(&trial)[channel] / engine.mse(&pass.base)[channel];
    let coefficient = trial.model.effect(&effect.name).and_then(|effect| effect.coefficient(FORMULA_COEFFICIENT));
    let coefficient = coefficient.map_or(f64::NAN, |coefficient| coefficient.value);
    let locked = confirm(
        engine.flights,
        &[(Vec::new(), model.clone()), (Vec::new(), trial.model)],
        unseen.spans,
        unseen.part,
        unseen.block_s,
        engine.correlation,
    )?;
    Ok(Some(TriedFormula {
        formula: suggested.formula.clone(),
        coefficient,
        held_out_mse_fall,
        locked_mse_fall: locked.as_ref().map(|locked| locked.mse_fall.get(unknown.channel).copied().unwrap_or_default()),
        locked_rmse: locked.and_then(|locked| locked.rmse_after.channels()[channel]),
    }))
}

#[cfg(test)]
mod tests {
    use super::super::engine::FOLDS;
    use super::super::gram::blocks;
    use super::super::gram::tests::{model, noise, whole};
    use super::*;
    use crate::critique::unknown::{Dependence, SuggestedFormula};
    use crate::flight::{Column, Flight};

    fn unknown(formula: &str) -> Unknown {
        Unknown {
            channel: "wx_dot",
            r2: 0.5,
            r2_with_feedback: 0.5,
            null_r2_95: 0.01,
            depends_on: vec![Dependence { variable: "u1".into(), share: 1.0 }],
            suggested_formula: Some(SuggestedFormula { channel: "wx_dot", formula: formula.into(), coefficient: 1.0, r2: 0.5 }),
            skeleton: String::new(),
        }
    }

    /// Flights in which roll acceleration follows u1 |u1|; in the second the other way round if `turned`.
    fn flights(turned: bool) -> Result<Vec<Flight>> {
        let mut flights = noise(5, &[60_000, 20_000]);
        for (index, flight) in flights.iter_mut().enumerate() {
            let mut accelerations = flight.accelerations();
            let sign = if turned && index == 1 { -2.0 } else { 2.0 };
            accelerations[Channel::WxDot]
                .iter_mut()
                .zip(flight.column(Column::U1))
                .for_each(|(value, u)| *value += sign * u * u.abs());
            *flight = flight.with_accelerations(&accelerations)?;
        }
        Ok(flights)
    }

    fn of(turned: bool, formula: &str) -> Result<Option<TriedFormula>> {
        let flights = flights(turned)?;
        let spans = whole(&flights);
        let cut = blocks(&flights, &spans[..1], 10.0);
        let fold = (0..cut.len()).map(|block| block % FOLDS).collect();
        let engine = Engine { flights: &flights, blocks: cut, fold, correlation: 100.0, held: Vec::new() };
        let base = engine.pass(&model(), &[])?.base.model;
        tried(&engine, &base, &unknown(formula), &Unseen { spans: &spans[1..], part: "locked", block_s: 10.0 })
    }

    #[test]
    fn a_formula_stands_only_where_unseen_flights_bear_it_out() -> Result<()> {
        let held = of(false, "u1 * abs(u1)")?;
        assert!(held.as_ref().is_some_and(|held| held.holds() && (held.coefficient - 2.0).abs() < 0.2), "{held:?}");
        assert!(held.is_some_and(|held| held.held_out_mse_fall > 0.05 && held.locked_rmse.is_some()));
        let turned = of(true, "u1 * abs(u1)")?;
        assert!(turned.as_ref().is_some_and(|turned| !turned.holds() && turned.held_out_mse_fall > 0.05), "{turned:?}");
        let needless = of(false, "sin(40 * yaw)")?;
        assert!(needless.as_ref().is_some_and(|needless| !needless.holds()), "{needless:?}");
        Ok(())
    }
}
