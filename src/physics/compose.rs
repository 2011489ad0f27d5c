//! A model put together: its effects as one chain of formulas, from the sticks and the motion through the signals to six accelerations,
//! with exact derivatives by its numbers. Evaluating it is in `evaluate`, fitting it in `calibrate`.
//!
//! With no effect that changes a signal each signal is what it is called, and the sums are those of the terms in their order.

use super::catalogue;
use super::effect::{Coefficient, Effect, Swap};
use super::model::Model;
use super::rotors::{Part, Rotors, Total};
use super::signal::{Plain, SIGNALS, Stage, changeable, signal_named, stage_of};
use crate::error::Result;
use crate::flight::{Channel, Column, PerChannel};
use crate::formula::{Formula, Graph, Node};
use std::collections::{BTreeMap, HashMap};

/// One summand of a predicted acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Summand {
    /// The acceleration it adds to.
    pub channel: Channel,
    /// Index of the effect that brings it.
    pub effect: usize,
    /// Its value, coefficient included.
    pub node: Node,
}

/// A number of a model that a fit may find: index of the effect, and of the number in it ([`Effect::number`]).
pub(super) type Free = (usize, usize);

/// A model in a [`Graph`].
#[derive(Clone, Debug)]
pub(super) struct Composed {
    /// In the order of the sums.
    pub summands: Vec<Summand>,
    /// Predicted accelerations.
    pub channels: PerChannel<Node>,
    /// The numbers with their symbols.
    pub numbers: Vec<(Free, Node)>,
    /// Velocity against the air.
    pub air: [Node; 3],
    /// Whether some effect makes it another than that over ground.
    pub feels_wind: bool,
}

/// Puts models into one graph, in which what they share is one.
#[derive(Clone, Debug)]
pub(super) struct Composer {
    pub graph: Graph,
    /// Symbols by names of effect and number, each with what it was made for.
    symbols: HashMap<(String, String), Vec<(Coefficient, Node)>>,
    /// Symbols whose value differs from flight to flight.
    by_flight: HashMap<Node, Coefficient>,
}

impl Composer {
    pub fn new() -> Self {
        Self { graph: Graph::new(), symbols: HashMap::new(), by_flight: HashMap::new() }
    }

    /// The value of a symbol in a flight, for those that differ from flight to flight.
    pub fn in_flight(&self, symbol: Node, flight: &str) -> Option<f64> {
        self.by_flight.get(&symbol).map(|coefficient| coefficient.in_flight(flight))
    }

    /// Adds a model. Its open parameters are symbols only `with_parameters`; else they are plain numbers.
    ///
    /// # Errors
    /// [`Error::Formula`] at a name that nothing gives (`known` lists what a flight carries beside the standard names; `None` takes
    /// any name for a column), or where effects read each other in a circle.
    pub fn add(&mut self, model: &Model, known: Option<&[&str]>, with_parameters: bool) -> Result<Composed> {
        let mut chain = Chain {
            composer: self,
            model,
            known,
            with_parameters,
            signals: BTreeMap::new(),
            within: HashMap::new(),
            predicted: None,
            numbers: BTreeMap::new(),
        };
        let summands = chain.build()?;
        let air = chain.air(None);
        let numbers = std::mem::take(&mut chain.numbers).into_iter().collect();
        let channels = PerChannel::from_fn(|channel| sum(&mut self.graph, &summands, channel));
        let ground = ["vx", "vy", "vz"].map(|name| self.graph.input(name));
        Ok(Composed { summands, channels, numbers, air, feels_wind: air != ground })
    }

    /// The symbol of a number; one for each value that it has among the models.
    fn symbol(&mut self, effect: &Effect, number: &Coefficient) -> Node {
        let key = (effect.name.clone(), number.name.clone());
        let same = |known: &Coefficient| known.value.to_bits() == number.value.to_bits() && known.by_flight == number.by_flight;
        if let Some((_, node)) = self.symbols.get(&key).into_iter().flatten().find(|(known, _)| same(known)) {
            return *node;
        }
        let varies = number.by_flight.as_ref().is_some_and(|values| values.values().any(|value| *value != 0.0));
        let node = self.graph.symbol(number.value, varies);
        if varies {
            self.by_flight.insert(node, number.clone());
        }
        self.symbols.entry(key).or_default().push((number.clone(), node));
        node
    }
}

/// The terms of one channel, added up in order.
fn sum(graph: &mut Graph, summands: &[Summand], channel: Channel) -> Node {
    let zero = graph.number(0.0);
    summands.iter().filter(|summand| summand.channel == channel).fold(zero, |sum, summand| graph.sum(sum, summand.node))
}

/// A model while it is put together.
struct Chain<'a> {
    composer: &'a mut Composer,
    model: &'a Model,
    known: Option<&'a [&'a str]>,
    with_parameters: bool,
    /// What a name stands for by now.
    signals: BTreeMap<String, Node>,
    /// What it stands for in the formulas of one effect, where that differs.
    within: HashMap<(usize, String), Node>,
    /// The accelerations so far, for the formulas that read them.
    predicted: Option<PerChannel<Node>>,
    numbers: BTreeMap<Free, Node>,
}

/// What one effect changes at one stage.
struct Job {
    stage: Stage,
    rank: usize,
    effect: usize,
}

/// Effects of the catalogue act in its order, the user's own after them in the order of the model.
fn rank(effect: &Effect) -> usize {
    catalogue::kinds().position(|kind| kind == effect.kind).unwrap_or(usize::MAX)
}

/// Whether a formula of the effect reads a predicted acceleration.
fn reads_prediction(effect: &Effect) -> bool {
    effect.terms.iter().flat_map(|term| term.regressor.names()).any(|name| stage_of(name) == Stage::Outcome)
}

impl Chain<'_> {
    fn effects(&self) -> impl Iterator<Item = (usize, &Effect)> {
        self.model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled)
    }

    fn build(&mut self) -> Result<Vec<Summand>> {
        self.check_names()?;
        self.delay_controls();
        let mut jobs: Vec<Job> = Vec::new();
        for (index, effect) in self.effects() {
            for swap in &effect.swaps {
                let job = Job { stage: stage_of(&swap.name), rank: rank(effect), effect: index };
                if !jobs.iter().any(|known| known.stage == job.stage && known.effect == index) {
                    jobs.push(job);
                }
            }
        }
        jobs.sort_by_key(|job| (job.stage, job.rank));
        let (rotor, before): (Vec<Job>, Vec<Job>) = jobs.into_iter().partition(|job| job.stage >= Stage::Rotor);
        for job in before {
            self.change(&job)?;
        }
        let plain = self.rotor_signals()?;
        for job in rotor {
            self.change(&job)?;
        }
        self.summands(&plain)
    }

    /// Refuses names that nothing gives.
    fn check_names(&self) -> Result<()> {
        let Some(extra) = self.known else { return Ok(()) };
        for (_, effect) in self.effects() {
            for formula in effect.formulas() {
                let own = effect.parameters.iter().map(|parameter| parameter.name.as_str());
                let own = own.chain(effect.coefficients.iter().map(|coefficient| coefficient.name.as_str()));
                let mut known: Vec<&str> = super::standard_names();
                known.extend(
                    extra.iter().copied().chain(own).chain(Model::CONSTANTS).chain(SIGNALS.iter().map(|signal| signal.name)),
                );
                known.extend(formula.names().into_iter().filter(|name| self.model.coefficient_named(name).is_some()));
                formula.check_names(&known).map_err(|error| effect.name_error(error))?;
            }
        }
        if self.effects().any(|(_, effect)| effect.reads_rotors()) {
            let known: Vec<&str> =
                super::standard_names().into_iter().chain(extra.iter().copied()).chain(Model::CONSTANTS).collect();
            self.model.rotors.iter().try_for_each(|rotor| rotor.speed.check_names(&known))?;
        }
        Ok(())
    }

    /// Controls act late by the delay that the model gives for the data.
    fn delay_controls(&mut self) {
        let seconds = self.model.data.control_delay_s;
        if seconds > 0.0 {
            let graph = &mut self.composer.graph;
            for name in ["u1", "u2", "u3", "u4"] {
                let (stick, seconds) = (graph.input(name), graph.number(seconds));
                let delayed = graph.delayed(stick, seconds);
                self.signals.insert(name.into(), delayed);
            }
        }
    }

    /// What an effect changes at one stage: all of it is made from what was before.
    fn change(&mut self, job: &Job) -> Result<()> {
        let model = self.model;
        let effect = &model.effects[job.effect];
        let mut changed: Vec<(Option<usize>, &str, Node)> = Vec::new();
        for swap in effect.swaps.iter().filter(|swap| stage_of(&swap.name) == job.stage) {
            self.check_swap(effect, swap)?;
            let special: Vec<usize> =
                self.within.keys().filter(|(_, name)| *name == swap.name).map(|(reader, _)| *reader).collect();
            if swap.within.is_empty() {
                changed.push((None, &swap.name, self.swapped(job.effect, swap, None)?));
                for reader in special {
                    changed.push((Some(reader), &swap.name, self.swapped(job.effect, swap, Some(reader))?));
                }
            } else {
                for (reader, _) in
                    model.effects.iter().enumerate().filter(|(_, reader)| reader.enabled && swap.within.contains(&reader.name))
                {
                    changed.push((Some(reader), &swap.name, self.swapped(job.effect, swap, Some(reader))?));
                }
            }
        }
        for (reader, name, node) in changed {
            match reader {
                None => drop(self.signals.insert(name.into(), node)),
                Some(reader) => drop(self.within.insert((reader, name.into()), node)),
            }
        }
        Ok(())
    }

    fn check_swap(&self, effect: &Effect, swap: &Swap) -> Result<()> {
        let stage = stage_of(&swap.name);
        let later = |name: &str| {
            (stage_of(name) > stage && effect.number_named(name).is_none())
                .then(|| format!("it follows from `{}`, which this formula changes", swap.name))
        };
        match swap.with.refused_name(&later) {
            Some(error) => Err(effect.name_error(error)),
            None => Ok(()),
        }
    }

    /// What a swap makes of its signal as an effect reads it, or as all others do.
    fn swapped(&mut self, owner: usize, swap: &Swap, reader: Option<usize>) -> Result<Node> {
        self.formula(owner, &swap.with, Some((&swap.name, reader)))
    }

    /// A formula of an effect. `swapped` is a name that stands for what another effect reads under it.
    fn formula(&mut self, owner: usize, formula: &Formula, swapped: Option<(&str, Option<usize>)>) -> Result<Node> {
        let mut names: HashMap<&str, Node> = HashMap::new();
        for name in formula.names() {
            let reader = match swapped {
                Some((own, reader)) if own == name => reader,
                Some(_) => None,
                None => Some(owner),
            };
            if let Some(node) = self.resolve(owner, reader, name) {
                names.insert(name, node);
            }
        }
        let effect = &self.model.effects[owner];
        let found = self.composer.graph.add(formula, &mut |_, name| Ok(names.get(name).copied()));
        found.map_err(|error| effect.name_error(error))
    }

    /// What a name stands for: a number of the effect, one of the model, a signal, or the coefficient of another effect; else a column.
    fn resolve(&mut self, owner: usize, reader: Option<usize>, name: &str) -> Option<Node> {
        let model = self.model;
        if let Some(number) = model.effects[owner].number_named(name) {
            return Some(self.number((owner, number)));
        }
        if let Some(value) = model.constant(name) {
            return Some(self.composer.graph.number(value));
        }
        if let Some(node) = self.signal(reader, name) {
            return Some(node);
        }
        // A quantity of this name comes before the coefficient of an effect.
        if super::standard_names().contains(&name) {
            return None;
        }
        model.coefficient_named(name).map(|free| self.number(free))
    }

    fn signal(&mut self, reader: Option<usize>, name: &str) -> Option<Node> {
        if let Some(node) = reader.and_then(|reader| self.within.get(&(reader, name.to_owned()))) {
            return Some(*node);
        }
        if let Some(node) = self.signals.get(name) {
            return Some(*node);
        }
        match signal_named(name)?.plain {
            Plain::Quantity(column) => Some(self.composer.graph.input(column)),
            Plain::Signal(other) => {
                let node = self.signal(reader, other);
                Some(node.unwrap_or_else(|| self.composer.graph.input(other)))
            }
            Plain::OfAir => self.of_air(reader, name),
            Plain::One => Some(self.composer.graph.number(1.0)),
            Plain::OverRotors(total, part) => Some(self.over_rotors(reader, total, part)),
            Plain::Terms(..) => unreachable!("the rotor's signals are made before anything reads them"),
            Plain::Predicted(channel) => Some(self.predicted.expect("read after all else is summed")[channel]),
        }
    }

    /// A component of a sum over the rotors.
    fn over_rotors(&mut self, reader: Option<usize>, total: Total, part: Part) -> Node {
        let model = self.model;
        let speeds: Vec<Node> = model.rotors.iter().map(|rotor| self.rotor_speed(&rotor.speed)).collect();
        let air = self.air(reader);
        let rates = ["wx", "wy", "wz"].map(|name| self.signal(reader, name).expect("a signal of the table"));
        Rotors { rotors: &model.rotors, speeds: &speeds, air, rates }.total(&mut self.composer.graph, total, part)
    }

    /// Speed of a rotor. What is recorded of the rotors acts late by the delay of the controls, as these do.
    fn rotor_speed(&mut self, speed: &Formula) -> Node {
        let mut names: HashMap<&str, Node> = HashMap::new();
        for name in speed.names() {
            let node = match (self.model.constant(name), self.signal(None, name)) {
                (Some(value), _) => self.composer.graph.number(value),
                (None, Some(signal)) => signal,
                (None, None) => self.recorded(name),
            };
            names.insert(name, node);
        }
        self.composer.graph.add(speed, &mut |_, name| Ok(names.get(name).copied())).expect("checked with the model")
    }

    /// A further column of the log, delayed as the controls are; derived quantities are of the motion.
    fn recorded(&mut self, name: &str) -> Node {
        let seconds = self.model.data.control_delay_s;
        let graph = &mut self.composer.graph;
        let column = graph.input(name);
        if seconds == 0.0 || super::standard_names().contains(&name) {
            return column;
        }
        let seconds = graph.number(seconds);
        graph.delayed(column, seconds)
    }

    /// Velocity against the air.
    fn air(&mut self, reader: Option<usize>) -> [Node; 3] {
        ["air_vx", "air_vy", "air_vz"].map(|name| self.signal(reader, name).expect("a signal of the table"))
    }

    /// Speed and angles of the air: as derived from the log where nothing changes it.
    fn of_air(&mut self, reader: Option<usize>, name: &str) -> Option<Node> {
        let columns = ["vx", "vy", "vz"];
        let air = self.air(reader);
        if columns.map(|name| self.composer.graph.input(name)) == air {
            return Some(self.composer.graph.input(name));
        }
        let text = match name {
            "airspeed" => "hypot(x, y, z)",
            "alpha" => "atan2(z, x)",
            _ => "atan2(y, hypot(x, z))",
        };
        let formula = Formula::parse(text).expect("a built-in formula parses");
        let place = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name).map(|axis| air[axis]);
        Some(self.composer.graph.add(&formula, &mut |_, name| Ok(place(name))).expect("no time in it"))
    }

    /// The symbol or the plain number of an effect's number.
    fn number(&mut self, free: Free) -> Node {
        let effect = &self.model.effects[free.0];
        match effect.coefficients.get(free.1) {
            Some(coefficient) => {
                let node = self.composer.symbol(effect, coefficient);
                self.numbers.insert(free, node);
                node
            }
            None => {
                let parameter = &effect.parameters[free.1 - effect.coefficients.len()];
                if parameter.fixed || !self.with_parameters {
                    return self.composer.graph.number(parameter.value);
                }
                let node = self.composer.symbol(effect, &parameter.as_coefficient());
                self.numbers.insert(free, node);
                node
            }
        }
    }

    /// A term's value.
    fn term(&mut self, effect: usize, term: usize) -> Result<Node> {
        let model = self.model;
        let owner = &model.effects[effect];
        let term = &owner.terms[term];
        let regressor = self.formula(effect, &term.regressor, None)?;
        let Some(name) = &term.coefficient else { return Ok(regressor) };
        let coefficient = owner.number_named(name).expect("checked: a term's coefficient is listed");
        let factor = self.number((effect, coefficient));
        Ok(self.composer.graph.product(factor, regressor))
    }

    /// The signals that are sums of terms, before any effect changes them.
    fn rotor_signals(&mut self) -> Result<Vec<(&'static str, Channel, Node)>> {
        let mut plain = Vec::new();
        for signal in &SIGNALS {
            let Plain::Terms(kinds, channel) = signal.plain else { continue };
            let mut node = self.composer.graph.number(0.0);
            for (effect, term) in self.carried(kinds, channel) {
                let value = self.term(effect, term)?;
                node = self.composer.graph.sum(node, value);
            }
            self.signals.insert(signal.name.into(), node);
            plain.push((signal.name, channel, node));
        }
        Ok(plain)
    }

    /// The terms behind a signal: indices of effect and term.
    fn carried(&self, kinds: &[&str], channel: Channel) -> Vec<(usize, usize)> {
        let of = |(index, effect): (usize, &Effect)| {
            let terms = effect.terms.iter().enumerate().filter(|(_, term)| term.channel == channel);
            terms.map(|(term, _)| (index, term)).collect::<Vec<_>>()
        };
        self.effects().filter(|(_, effect)| kinds.contains(&effect.kind.as_str())).flat_map(of).collect()
    }

    /// All summands in the order of the sums: the terms in the order of the model, a changed signal in the place of its first term, and
    /// last the effects that read the sum of the others, in the order of the catalogue.
    fn summands(&mut self, plain: &[(&'static str, Channel, Node)]) -> Result<Vec<Summand>> {
        let mut inside: HashMap<(usize, usize), Option<Summand>> = HashMap::new();
        let mut carried: Vec<Summand> = Vec::new();
        for &(name, channel, before) in plain {
            let node = self.signals[name];
            if node == before {
                continue;
            }
            let Some(Plain::Terms(kinds, _)) = signal_named(name).map(|signal| signal.plain) else { continue };
            let terms = self.carried(kinds, channel);
            let changer = self.effects().find(|(_, effect)| effect.swaps.iter().any(|swap| swap.name == name));
            let effect = changer.map_or(0, |(index, _)| index);
            match terms.split_first() {
                Some((&(effect, term), rest)) => {
                    inside.insert((effect, term), Some(Summand { channel, effect, node }));
                    inside.extend(rest.iter().map(|&place| (place, None)));
                }
                None => carried.push(Summand { channel, effect, node }),
            }
        }
        let model = self.model;
        let mut summands: Vec<Summand> = Vec::new();
        let mut readers: Vec<usize> = Vec::new();
        for (index, effect) in model.effects.iter().enumerate().filter(|(_, effect)| effect.enabled) {
            if reads_prediction(effect) {
                readers.push(index);
                continue;
            }
            for term in 0..effect.terms.len() {
                match inside.get(&(index, term)) {
                    Some(whole) => summands.extend(whole),
                    None => {
                        summands.push(Summand { channel: effect.terms[term].channel, effect: index, node: self.term(index, term)? })
                    }
                }
            }
        }
        summands.extend(carried);
        readers.sort_by_key(|&index| rank(&model.effects[index]));
        for index in readers {
            let graph = &mut self.composer.graph;
            self.predicted = Some(PerChannel::from_fn(|channel| sum(graph, &summands, channel)));
            let own: Vec<Summand> = (0..model.effects[index].terms.len())
                .map(|term| {
                    Ok(Summand { channel: model.effects[index].terms[term].channel, effect: index, node: self.term(index, term)? })
                })
                .collect::<Result<_>>()?;
            summands.extend(own);
        }
        Ok(summands)
    }
}

/// Refuses to change what cannot be changed.
pub(super) fn check_changeable(swap: &Swap) -> Option<String> {
    let is_target = Column::from_name(&swap.name).is_some_and(|column| Column::TARGETS.contains(&column));
    (is_target || !changeable(&swap.name)).then(|| format!("`{}`, which no effect can change", swap.name))
}
