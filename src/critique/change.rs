//! What an added effect did: how the prediction changes from one model to another, binned over recorded variables as a residual is, and over which of
//! them that is worth looking at. Where the change runs through the residual of the first model, nothing is left. No figures, no tests.

use super::locate::{Dependence, Variable, dependences};
use super::predictions::{Row, check_row, measured};
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, Window};
use crate::physics::Effect;

/// Share of a residual below which a variable is not looked at, unless an added effect reads it.
const SHARE_SHOWN: f64 = 0.01;

/// Residuals, or changes, of the six channels against variables.
pub type Dependences = Vec<(Variable, PerChannel<Dependence>)>;

/// The change from one prediction to another against each variable.
///
/// # Errors
/// As [`dependences`].
pub fn change(flights: &[Flight], windows: &[Window], [before, after]: [&Row; 2], variables: &[Variable]) -> Result<Dependences> {
    check_row(before, windows)?;
    check_row(after, windows)?;
    // As if the change were all that the model misses: its residual is the change.
    let predicted = measured(flights, windows)?.into_iter().zip(&before.predicted).zip(&after.predicted);
    let predicted = predicted
        .map(|((measured, before), after)| PerChannel::from_fn(|channel| measured[channel] - (after[channel] - before[channel])));
    dependences(flights, windows, &Row { name: "change".into(), predicted: predicted.collect() }, variables)
}

/// The variables of a channel that tell most of its residual, and those that added effects read; in the order of their shares, so many at most.
pub fn telling(residual: &Dependences, channel: Channel, added: &[&Effect], most: usize) -> Vec<Variable> {
    let mut order: Vec<(f64, Variable)> = residual.iter().map(|(variable, of)| (of[channel].share, *variable)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let read = |variable: Variable| added.iter().any(|effect| reads(effect, channel, variable));
    let telling = order.iter().filter(|(share, variable)| *share >= SHARE_SHOWN || read(*variable));
    telling.take(most).map(|(_, variable)| *variable).collect()
}

/// Whether an effect acts on a channel without memory and reads the variable there.
pub fn reads(effect: &Effect, channel: Channel, variable: Variable) -> bool {
    let formulas = || {
        let terms = effect.terms.iter().filter(|term| term.channel == channel).map(|term| &term.regressor);
        terms.chain(effect.swaps.iter().map(|swap| &swap.with))
    };
    let stands_for = |name: &str| {
        name.strip_prefix("air_").unwrap_or(name) == variable.name() || (variable == Variable::Height && name == Column::Z.name())
    };
    formulas().all(|formula| !formula.remembers()) && formulas().any(|formula| formula.names().into_iter().any(stands_for))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::compare::tests::{every_window, flights};
    use crate::physics::catalogue;

    #[test]
    fn the_change_of_a_prediction_is_binned_whatever_was_measured() -> Result<()> {
        // vx rises from 0 to 9.9 m/s in both flights; what was measured has nothing to do with it.
        let flights = flights(|flight, sample, _| ((7 * sample + flight) % 5) as f64)?;
        let windows = every_window(&flights);
        let row = |of: &dyn Fn(&Window) -> f64| Row {
            name: String::new(),
            predicted: windows.iter().map(|at| PerChannel::splat(of(at))).collect(),
        };
        let vx = |window: &Window| flights[window.flight].column(Column::Vx)[window.last];
        let (before, after) = (row(&|_| 1.0), row(&|window| 1.0 + 2.0 * vx(window)));
        let found = change(&flights, &windows, [&before, &after], &[Variable::Column(Column::Vx)])?;
        let bins = &found[0].1[Channel::WyDot].bins;
        assert!(bins.len() > 5 && bins.iter().all(|bin| (bin.mean - 2.0 * bin.at).abs() < 1e-9), "{bins:?}");
        let telling = telling(&found, Channel::WyDot, &[], 3);
        assert_eq!(telling, [Variable::Column(Column::Vx)]);
        assert!(change(&flights, &windows[1..], [&before, &after], &[]).is_err(), "a prediction for each window");
        Ok(())
    }

    #[test]
    fn an_effect_reads_what_its_terms_name_in_a_channel() {
        let effect = catalogue::definition("weathercock").expect("in the catalogue").effect(4.58, 0.8);
        let of = |channel, column| reads(&effect, channel, Variable::Column(column));
        assert!(of(Channel::WzDot, Column::Vy) && !of(Channel::WzDot, Column::Wx));
        let lagged = catalogue::definition("cyclic_lag").map(|definition| definition.effect(4.58, 0.8));
        let of_lag = lagged.map(|effect| reads(&effect, Channel::WzDot, Variable::Column(Column::U1)));
        assert_eq!(of_lag, Some(false), "with a memory it is no curve");
    }
}
