//! What a network and a linear history may see: formulas of states, controls and further columns, and nothing that gives an
//! acceleration away. Scaling and windows are elsewhere.

use crate::error::Result;
use crate::flight::{Column, Flight, TARGET};
use crate::formula::Formula;
use crate::physics::evaluate;

/// Parses inputs and refuses each that names an acceleration, however deep in the formula. What can only be told from a flight (further
/// columns that a description makes accelerations of) is refused where its values are taken.
///
/// # Errors
/// [`crate::Error::Formula`] pointing at the character.
pub fn parse(inputs: &[String]) -> Result<Vec<Formula>> {
    let is_target = |name: &str| Column::TARGETS.iter().any(|target| target.name() == name).then(|| TARGET.to_owned());
    let one = |text: &String| {
        let formula = Formula::parse(text)?;
        formula.refused_name(&is_target).map_or(Ok(formula), Err)
    };
    inputs.iter().map(one).collect()
}

/// An input on a whole flight.
///
/// # Errors
/// [`crate::Error::Formula`] pointing at a name that the flight lacks, or that gives an acceleration away.
pub(super) fn values(formula: &Formula, flight: &Flight) -> Result<Vec<f64>> {
    match formula.refused_name(&|name| flight.gives_target_away(name)) {
        Some(error) => Err(error),
        None => evaluate(formula, flight),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::flight::Targets;
    use crate::flight::derived::Derived;
    use crate::hybrid::linear::{LinearConfig, Signals};
    use crate::train::TrainConfig;
    use proptest::prelude::*;

    /// A name that may be read.
    fn allowed() -> impl Strategy<Value = String> {
        let names: Vec<&str> =
            Column::STATE.iter().map(|column| column.name()).chain(Derived::ALL.map(Derived::name)).chain(["rpm"]).collect();
        prop::sample::select(names).prop_map(str::to_owned)
    }

    /// A target, or something that a description computes from one or one from it.
    fn forbidden() -> impl Strategy<Value = String> {
        let names: Vec<&str> = Column::TARGETS.iter().map(|column| column.name()).chain(["ax_mg", "u1", "height"]).collect();
        prop::sample::select(names).prop_map(str::to_owned)
    }

    /// Formulas of every operator and function around `core`.
    fn around(
        core: impl Strategy<Value = String> + 'static,
        others: impl Strategy<Value = String> + 'static,
    ) -> BoxedStrategy<String> {
        let others = others.boxed();
        core.prop_recursive(4, 16, 2, move |inner| {
            let binary = prop::sample::select(vec!["+", "-", "*", "/", "^", "<", "<=", ">", ">="]);
            let unary = prop::sample::select(vec!["abs", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "sign", "rate", "-"]);
            let several = prop::sample::select(vec!["min", "max", "hypot", "atan2"]);
            prop_oneof![
                (inner.clone(), binary.clone(), others.clone()).prop_map(|(x, op, y)| format!("({x}) {op} ({y})")),
                (others.clone(), binary, inner.clone()).prop_map(|(x, op, y)| format!("({x}) {op} ({y})")),
                (unary, inner.clone()).prop_map(|(f, x)| format!("{f}({x})")),
                (several, others.clone(), inner.clone()).prop_map(|(f, x, y)| format!("{f}({x}, {y})")),
                (inner.clone(), others.clone()).prop_map(|(x, y)| format!("clamp({y}, -1, {x})")),
                inner.clone().prop_map(|x| format!("0 * ({x})")),
                inner.clone().prop_map(|x| format!("lag({x}, 0.1)")),
                inner.clone().prop_map(|x| format!("delay({x}, 0.02)")),
                inner.prop_map(|x| format!("slew({x}, 2)")),
            ]
        })
        .boxed()
    }

    /// A flight whose description makes `vx_dot` of `ax_mg`, and `u1` and `z` of that.
    fn flight(tainted: &[&str]) -> Result<Flight> {
        let columns = std::array::from_fn(|_| vec![0.1, 0.2, 0.3]);
        let mut flight = Flight::new("a", "hover", 0.0, 0.01, columns, Targets::Recorded)?;
        flight.extra = ["ax_mg", "rpm"].map(|name| (name.to_owned(), vec![1.0, 2.0, 3.0])).into();
        flight.tainted = tainted.iter().map(|name| ((*name).to_owned(), "for the test".to_owned())).collect();
        Ok(flight)
    }

    proptest! {
        #[test]
        fn no_formula_brings_a_target_or_what_is_made_of_one_into_the_inputs(
            text in around(forbidden(), allowed()), others in proptest::collection::vec(allowed(), 0..3)
        ) {
            let flight = flight(&["ax_mg", "u1", "z"])?;
            let inputs: Vec<String> = others.into_iter().chain([text.clone()]).collect();
            let refused = |result: Result<()>| matches!(result, Err(Error::Formula { message, .. }) if message.contains("cannot be read"));
            // On a flight.
            let linear = LinearConfig { lags: 1, inputs: inputs.clone() };
            let signals = linear.check().and_then(|()| Signals::new(&flight, &linear).map(|_| ()));
            prop_assert!(refused(signals), "{}", text);
            let values = parse(&inputs).and_then(|formulas| formulas.iter().try_for_each(|input| values(input, &flight).map(|_| ())));
            prop_assert!(refused(values), "{}", text);
            // By name alone, in a configuration, before there is a flight.
            let names = Formula::parse(&text)?;
            if names.names().iter().any(|name| name.ends_with("_dot")) {
                let mut config = TrainConfig { linear: Some(linear), ..TrainConfig::default() };
                prop_assert!(refused(config.check()), "[linear] {}", text);
                config.linear = None;
                config.inputs[7] = text.clone();
                prop_assert!(refused(config.check()), "{}", text);
            }
        }

        #[test]
        fn what_is_made_of_states_alone_is_allowed(text in around(allowed(), allowed())) {
            let flight = flight(&["ax_mg"])?;
            let formulas = parse(std::slice::from_ref(&text))?;
            prop_assert!(values(&formulas[0], &flight).is_ok(), "{}", text);
        }
    }
}
