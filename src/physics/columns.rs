//! The columns of a fit: derivatives of models by their numbers, in one graph in which equal columns of many models are one, and
//! their values on a flight. No fitting here.

use super::compose::{Composed, Composer, Free};
use super::effect::Term;
use super::evaluate::{Bound, Visit};
use super::model::Model;
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, derived::Derived};
use crate::formula::{Formula, Node};
use std::collections::HashMap;

/// A column by which a number of a model acts on one acceleration, or what acts whatever the numbers are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regressor {
    /// The acceleration it belongs to.
    pub channel: Channel,
    /// Index of the effect in the model.
    pub effect: usize,
    /// Index of the number in the effect, coefficients first, then parameters; `None` is a fixed 1.
    pub number: Option<usize>,
    /// The values.
    pub node: Node,
}

/// Columns of many models.
#[derive(Clone, Debug)]
pub struct Columns {
    composer: Composer,
}

impl Model {
    /// What a column is called for a person.
    pub fn label(&self, regressor: &Regressor) -> String {
        let effect = &self.effects[regressor.effect];
        let Some(number) = regressor.number.and_then(|number| effect.number(number)) else {
            return format!("effect `{}`", effect.name);
        };
        let own = |term: &&Term| term.channel == regressor.channel && term.coefficient.as_ref() == Some(&number.name);
        match effect.terms.iter().find(own) {
            Some(term) => format!("the regressor `{}` of effect `{}`", term.regressor, effect.name),
            None => format!("the column of `{}` of effect `{}`", number.name, effect.name),
        }
    }

    /// The accelerations that an effect changes, by the other effects that the model has: what adds to one, and what reads a signal.
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn acts(&self, effect: usize) -> Result<PerChannel<bool>> {
        let mut composer = Composer::new();
        let mut with = self.clone();
        with.effects[effect].enabled = true;
        let mut without = self.clone();
        without.effects[effect].enabled = false;
        let (with, without) = (composer.add(&with, None, false)?.channels, composer.add(&without, None, false)?.channels);
        Ok(PerChannel::from_fn(|channel| with[channel] != without[channel]))
    }
}

impl Default for Columns {
    fn default() -> Self {
        Self { composer: Composer::new() }
    }
}

/// What is asked of [`Columns::regressors`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// The columns of this effect's numbers alone.
    pub effect: Option<usize>,
    /// Those of open parameters, too.
    pub parameters: bool,
}

impl Columns {
    /// The model near its present numbers θ₀ as a sum `Σ θ ∂a/∂θ + rest`: a regressor for each number and acceleration it acts in, and the
    /// rest `a(θ₀) - Σ θ₀ ∂a/∂θ`, with number `None`. A model that is linear in its numbers is given exactly, wherever they are.
    ///
    /// # Errors
    /// As [`Model::predict`], where it does not depend on a flight.
    pub fn regressors(&mut self, model: &Model, wanted: Wanted) -> Result<Vec<Regressor>> {
        model.check()?;
        let composed = self.composer.add(model, None, wanted.parameters)?;
        let values: Vec<Node> = composed.summands.iter().map(|summand| summand.node).collect();
        let numbers: Vec<(Free, Node)> =
            composed.numbers.iter().filter(|(free, _)| wanted.effect.is_none_or(|effect| free.0 == effect)).copied().collect();
        let mut slopes: HashMap<(usize, Free), Node> = HashMap::new();
        for &(free, symbol) in &numbers {
            let derivatives = self.composer.graph.derivatives(&values, symbol);
            slopes.extend(derivatives.into_iter().enumerate().filter_map(|(place, node)| Some(((place, free), node?))));
        }
        // One column for each number and acceleration, whatever summands it acts through; and one for the rest.
        let mut found: Vec<Regressor> = Vec::new();
        for (place, summand) in composed.summands.iter().enumerate() {
            for &(free, _) in &numbers {
                if let Some(&node) = slopes.get(&(place, free)) {
                    self.add_up(&mut found, Regressor { channel: summand.channel, effect: free.0, number: Some(free.1), node });
                }
            }
            if wanted.effect.is_none() {
                let own: Vec<(Node, Node)> =
                    numbers.iter().filter_map(|&(free, symbol)| Some((symbol, *slopes.get(&(place, free))?))).collect();
                if let Some(node) = self.rest(&composed, summand.node, &own) {
                    self.add_up(&mut found, Regressor { channel: summand.channel, effect: summand.effect, number: None, node });
                }
            }
        }
        Ok(found)
    }

    /// What a model predicts, by acceleration.
    ///
    /// # Errors
    /// As [`Columns::regressors`].
    pub fn predictions(&mut self, model: &Model) -> Result<PerChannel<Node>> {
        model.check()?;
        Ok(self.composer.add(model, None, false)?.channels)
    }

    /// What an effect's absence changes, as the model near its present numbers has it: by acceleration, `a(θ₀ without it) - a(θ₀)` and its own
    /// part `Σ θ₀ ∂a/∂θ`, which is in `regressors`. With this added and its numbers left out, the sum is the model without the effect, the
    /// others' columns being what they were beside it.
    ///
    /// # Errors
    /// As [`Columns::regressors`].
    pub fn absence(&mut self, model: &Model, regressors: &[Regressor], effect: usize) -> Result<Vec<Regressor>> {
        let whole = self.composer.add(model, None, true)?;
        let mut without = model.clone();
        without.effects[effect].enabled = false;
        let without = self.composer.add(&without, None, true)?;
        let mut found = Vec::new();
        for channel in Channel::ALL.into_iter().filter(|&channel| whole.channels[channel] != without.channels[channel]) {
            let mut node = self.composer.graph.difference(without.channels[channel], whole.channels[channel]);
            for own in regressors.iter().filter(|own| own.effect == effect && own.channel == channel) {
                let symbol = own.number.and_then(|number| whole.numbers.iter().find(|known| known.0 == (effect, number)));
                if let Some(&(_, symbol)) = symbol {
                    let part = self.composer.graph.product(symbol, own.node);
                    node = self.composer.graph.sum(node, part);
                }
            }
            found.push(Regressor { channel, effect, number: None, node: self.composer.graph.settled(&[node])[0] });
        }
        Ok(found)
    }

    fn add_up(&mut self, found: &mut Vec<Regressor>, part: Regressor) {
        let same = |known: &&mut Regressor| {
            known.channel == part.channel && known.number == part.number && (part.number.is_none() || known.effect == part.effect)
        };
        match found.iter_mut().find(same) {
            Some(known) => known.node = self.composer.graph.sum(known.node, part.node),
            None => found.push(part),
        }
    }

    /// A summand less its slopes times their numbers: what is left of it where these are 0, if it is linear in them.
    fn rest(&mut self, composed: &Composed, value: Node, slopes: &[(Node, Node)]) -> Option<Node> {
        let symbols: Vec<Node> = composed.numbers.iter().map(|(_, symbol)| *symbol).collect();
        let graph = &mut self.composer.graph;
        let rest = if slopes.iter().any(|&(_, slope)| graph.depends(slope, &symbols)) {
            let mut rest = value;
            for &(symbol, slope) in slopes {
                let part = graph.product(symbol, slope);
                rest = graph.difference(rest, part);
            }
            rest
        } else {
            graph.without(value, &symbols)
        };
        let rest = graph.settled(&[rest])[0];
        (graph.uniform(rest) != Some(0.0)).then_some(rest)
    }

    /// Whether the model, near its present numbers, is linear in them: its columns do not change with them.
    pub fn is_linear(&mut self, model: &Model, regressors: &[Regressor], wanted: Wanted) -> Result<bool> {
        let composed = self.composer.add(model, None, wanted.parameters)?;
        let symbols: Vec<Node> = composed.numbers.iter().map(|(_, symbol)| *symbol).collect();
        Ok(!regressors.iter().any(|regressor| self.composer.graph.depends(regressor.node, &symbols)))
    }

    /// The name of a quantity that a column is made of and a flight does not carry.
    pub fn missing_input<'a>(&'a self, node: Node, flight: &Flight) -> Option<&'a str> {
        self.composer.graph.reads(node).into_iter().find(|name| !carries(flight, name))
    }

    /// Evaluates columns from a flight's first sample to `end`, block by block: `visit` is given each block's range and its values.
    ///
    /// # Errors
    /// [`crate::Error::Log`] where the flight lacks what a column is made of; those of `visit`.
    pub fn evaluate(&self, nodes: &[Node], flight: &Flight, end: usize, visit: &mut Visit<'_>) -> Result<()> {
        Bound::new(&self.composer, nodes, flight.step_s, Some(flight))?.run(flight, end, visit)
    }
}

fn carries(flight: &Flight, name: &str) -> bool {
    let absent = |column: &Column| flight.absent.contains(column);
    match (Derived::from_name(name), Column::from_name(name)) {
        (Some(derived), _) => !derived.reads().iter().any(absent),
        (None, Some(column)) => !absent(&column) && !Column::TARGETS.contains(&column),
        (None, None) => flight.extra.contains_key(name),
    }
}

/// The first name in a formula that a flight does not carry.
pub fn missing_input<'a>(formula: &'a Formula, flight: &Flight) -> Option<&'a str> {
    formula.names().into_iter().find(|name| !carries(flight, name))
}

/// Evaluates formulas of standard quantities from a flight's first sample to `end`, block by block: `visit` is given each block's range
/// and one column of values for each formula.
///
/// # Errors
/// [`crate::Error::Formula`] at a name the flight does not carry; those of `visit`.
pub fn evaluate_blocks(formulas: &[Formula], flight: &Flight, end: usize, visit: &mut Visit<'_>) -> Result<()> {
    let mut composer = Composer::new();
    let known: Vec<&str> = super::standard_names().into_iter().chain(flight.extra.keys().map(String::as_str)).collect();
    let mut nodes = Vec::with_capacity(formulas.len());
    for formula in formulas {
        formula.check_names(&known)?;
        if let Some(error) = formula.refused_name(&|name| flight.gives_target_away(name)) {
            return Err(error);
        }
        nodes.push(composer.graph.add(formula, &mut |_, _| Ok(None))?);
    }
    Bound::new(&composer, &nodes, flight.step_s, Some(flight))?.run(flight, end, visit)
}
