//! Formulas put together into one graph in which equal parts are one node, whoever wrote them: a model is a chain of formulas that
//! read each other, and many models that differ in little share the rest. Derivatives are in `derivative`, evaluation in `machine`.

use super::operation::{History, MAX_DELAY_S, Operation};
use super::{Formula, Instruction};
use crate::error::{Error, Result};
use std::collections::HashMap;

/// A value in a [`Graph`]: one number a sample, or one for all samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node(pub(super) u32);

/// What remembers: the operators of the grammar, and their derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Recall {
    /// One of the grammar: signal, and its time or limit.
    History(History),
    /// Derivative of a lag by its time constant: signal, time constant.
    LagByTime,
    /// Derivative of a lag whose time constant varies: signal, time constant, derivative of the signal, derivative of the time constant.
    LagTangent,
    /// Derivative of a delay by its time: signal, time.
    DelayByTime,
    /// Derivative of a slew: signal, limit, derivative of the signal, derivative of the limit.
    SlewTangent,
}

/// How a node is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// A number, by its bits.
    Number(u64),
    /// A number that may be differentiated by; index into the symbols.
    Symbol(u32),
    /// A column; index into the inputs.
    Input(u32),
    One(Operation, Node),
    Two(Operation, Node, Node),
    /// Unused operands are 0.
    Recall(Recall, [Node; 4]),
}

/// A number with an identity: derivatives are taken by it, and its value may differ where the graph is evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Symbol {
    pub value: f64,
    /// Whether an evaluation may give it another value.
    pub varies: bool,
}

/// Formulas as one graph.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    pub(super) nodes: Vec<Kind>,
    /// The value of each node that is the same at all samples, with every symbol at its own value.
    pub(super) uniform: Vec<Option<f64>>,
    pub(super) inputs: Vec<String>,
    pub(super) symbols: Vec<Symbol>,
    index: HashMap<Kind, Node>,
}

impl Graph {
    /// An empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// A number.
    pub fn number(&mut self, value: f64) -> Node {
        self.intern(Kind::Number(value.to_bits()))
    }

    /// A number of its own, by which derivatives can be taken. One that `varies` may have another value in each evaluation.
    pub fn symbol(&mut self, value: f64, varies: bool) -> Node {
        self.symbols.push(Symbol { value, varies });
        self.intern(Kind::Symbol(self.symbols.len() as u32 - 1))
    }

    /// Lets each evaluation give a symbol another value.
    pub fn let_vary(&mut self, symbol: Node) {
        if let Kind::Symbol(index) = self.nodes[symbol.0 as usize] {
            self.symbols[index as usize].varies = true;
        }
    }

    /// A column by name.
    pub fn input(&mut self, name: &str) -> Node {
        let known = self.inputs.iter().position(|known| known == name);
        let index = known.unwrap_or_else(|| {
            self.inputs.push(name.into());
            self.inputs.len() - 1
        });
        self.intern(Kind::Input(index as u32))
    }

    /// Names of the columns, in the order of their first use.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// The value of a node that is the same at all samples.
    pub fn uniform(&self, node: Node) -> Option<f64> {
        self.uniform[node.0 as usize]
    }

    /// A formula whose names stand for what `resolve` gives; a name for which it gives nothing is a column.
    ///
    /// # Errors
    /// [`Error::Formula`] at a `delay` or `slew` whose second argument varies, or one or a `lag` whose is out of range; those of `resolve`.
    pub fn add(&mut self, formula: &Formula, resolve: &mut dyn FnMut(&mut Self, &str) -> Result<Option<Node>>) -> Result<Node> {
        let mut names = Vec::with_capacity(formula.names.len());
        for (name, _) in &formula.names {
            let found = resolve(self, name)?;
            names.push(found.unwrap_or_else(|| self.input(name)));
        }
        let mut stack: Vec<Node> = Vec::new();
        for &(instruction, at) in &formula.program {
            let node = match instruction {
                Instruction::Number(number) => self.number(number),
                Instruction::Name(index) => names[index],
                Instruction::Apply(operation, count) => {
                    let operands = stack.split_off(stack.len() - count);
                    self.apply(operation, &operands)
                }
                Instruction::Recall(history) => {
                    let operands = stack.split_off(stack.len() - history.operands());
                    self.recall(history, &operands).map_err(|message| Error::Formula {
                        message,
                        formula: formula.text.clone(),
                        at,
                    })?
                }
            };
            stack.push(node);
        }
        Ok(stack.pop().expect("a parsed formula leaves one value"))
    }

    /// The sum of two values.
    pub fn sum(&mut self, left: Node, right: Node) -> Node {
        self.two(Operation::Add, left, right)
    }

    /// The difference of two values.
    pub fn difference(&mut self, left: Node, right: Node) -> Node {
        self.two(Operation::Subtract, left, right)
    }

    /// The product of two values.
    pub fn product(&mut self, left: Node, right: Node) -> Node {
        self.two(Operation::Multiply, left, right)
    }

    /// A delay of so many seconds; its range is the caller's to check.
    pub fn delayed(&mut self, node: Node, seconds: Node) -> Node {
        self.remember(Recall::History(History::Delay), [node, seconds])
    }

    /// Operations on more than two operands become operations on two.
    fn apply(&mut self, operation: Operation, operands: &[Node]) -> Node {
        match (operation, operands) {
            (Operation::Clamp, &[value, low, high]) => {
                // Not `f64::clamp`, which panics when the bounds cross; here the upper bound wins.
                let raised = self.two(Operation::Max, value, low);
                self.two(Operation::Min, raised, high)
            }
            (_, &[only]) => self.one(operation, only),
            (_, [first, rest @ ..]) => rest.iter().fold(*first, |left, &right| self.two(operation, left, right)),
            (_, []) => unreachable!("the parser counts arguments"),
        }
    }

    pub(super) fn one(&mut self, operation: Operation, operand: Node) -> Node {
        self.intern(Kind::One(operation, operand))
    }

    pub(super) fn two(&mut self, operation: Operation, left: Node, right: Node) -> Node {
        self.intern(Kind::Two(operation, left, right))
    }

    pub(super) fn remember<const N: usize>(&mut self, recall: Recall, operands: [Node; N]) -> Node {
        let zero = self.number(0.0);
        let mut all = [zero; 4];
        all[..N].copy_from_slice(&operands);
        self.intern(Kind::Recall(recall, all))
    }

    /// An operator of the grammar that remembers, with what is wrong about its second argument.
    fn recall(&mut self, history: History, operands: &[Node]) -> Result<Node, String> {
        let signal = operands[0];
        let Some(&second) = operands.get(1) else { return Ok(self.remember(Recall::History(history), [signal])) };
        let value = self.uniform(second);
        match history {
            History::Slew => {
                if value.is_none_or(|per_s| per_s.is_nan() || per_s <= 0.0) {
                    let found = value.map_or("varies in flight".into(), |per_s| format!("is {per_s} per second"));
                    return Err(format!("the largest rate of `slew` {found}, expected a number or a parameter above 0"));
                }
            }
            History::Lag | History::Delay => {
                let (name, largest) = if history == History::Lag { ("lag", f64::MAX) } else { ("delay", MAX_DELAY_S) };
                let time_s = match value {
                    Some(time_s) => time_s,
                    None if history == History::Lag => 0.0,
                    None => {
                        let message = "the time of `delay` must be a number or a parameter, not something that varies in flight";
                        return Err(message.into());
                    }
                };
                if !(0.0..=largest).contains(&time_s) {
                    let limit = if history == History::Lag { String::new() } else { format!(" and at most {largest}") };
                    return Err(format!("the time of `{name}` is {time_s} s, expected at least 0{limit}"));
                }
            }
            History::Rate => {}
        }
        Ok(self.remember(Recall::History(history), [signal, second]))
    }

    fn intern(&mut self, kind: Kind) -> Node {
        if let Some(known) = self.index.get(&kind) {
            return *known;
        }
        let uniform = self.value_of(kind, &|node| self.uniform[node.0 as usize], &|symbol| self.symbols[symbol].value);
        let node = Node(u32::try_from(self.nodes.len()).expect("fewer than four thousand million parts"));
        self.nodes.push(kind);
        self.uniform.push(uniform);
        self.index.insert(kind, node);
        node
    }

    /// The value of a node that is the same at all samples, from those of its operands.
    pub(super) fn value_of(&self, kind: Kind, of: &dyn Fn(Node) -> Option<f64>, symbol: &dyn Fn(usize) -> f64) -> Option<f64> {
        match kind {
            Kind::Number(bits) => Some(f64::from_bits(bits)),
            Kind::Symbol(index) => Some(symbol(index as usize)),
            Kind::Input(_) => None,
            Kind::One(operation, operand) => of(operand).map(|value| operation.of_one(value)),
            Kind::Two(operation, left, right) => {
                of(left).zip(of(right)).map(|(left, right)| match whole_power(operation, Some(right)) {
                    Some(exponent) => left.powi(exponent),
                    None => operation.of_two(left, right),
                })
            }
            // At rest since ever: a lag, a delay or a slew passes a constant on, its rate and its derivatives are zero.
            Kind::Recall(Recall::History(History::Rate) | Recall::LagByTime | Recall::DelayByTime, [signal, ..]) => {
                of(signal).map(|_| 0.0)
            }
            Kind::Recall(Recall::History(_), [signal, ..]) => of(signal),
            Kind::Recall(Recall::LagTangent | Recall::SlewTangent, [signal, _, tangent, _]) => of(signal).and(of(tangent)),
        }
    }

    /// The nodes that a node is made of.
    pub(super) fn operands(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        let (operands, count) = match self.nodes[node.0 as usize] {
            Kind::Number(_) | Kind::Symbol(_) | Kind::Input(_) => ([node; 4], 0),
            Kind::One(_, operand) => ([operand; 4], 1),
            Kind::Two(_, left, right) => ([left, right, left, left], 2),
            Kind::Recall(_, operands) => (operands, 4),
        };
        operands.into_iter().take(count)
    }

    /// The nodes behind some roots, themselves included, operands before what is made of them.
    pub(super) fn behind(&self, roots: &[Node]) -> Vec<Node> {
        self.behind_given(roots, &[])
    }

    /// The same without what stands behind those that are given.
    pub(super) fn behind_given(&self, roots: &[Node], given: &[Node]) -> Vec<Node> {
        let mut needed = vec![false; self.nodes.len()];
        roots.iter().for_each(|root| needed[root.0 as usize] = true);
        for index in (0..self.nodes.len()).rev() {
            if needed[index] && !given.contains(&Node(index as u32)) {
                self.operands(Node(index as u32)).for_each(|operand| needed[operand.0 as usize] = true);
            }
        }
        (0..self.nodes.len()).filter(|&index| needed[index]).map(|index| Node(index as u32)).collect()
    }

    /// The largest parts of some values that no column named by `moves` is behind, and that are not the same at all samples: what can be worked
    /// out before it is known how those columns move.
    pub fn apart_from(&self, roots: &[Node], moves: &dyn Fn(&str) -> bool) -> Vec<Node> {
        let behind = self.behind(roots);
        let mut moved = vec![false; self.nodes.len()];
        let mut asked_for = vec![false; self.nodes.len()];
        roots.iter().for_each(|root| asked_for[root.0 as usize] = true);
        for &node in &behind {
            let at = node.0 as usize;
            moved[at] = match self.nodes[at] {
                Kind::Input(index) => moves(&self.inputs[index as usize]),
                _ => self.operands(node).any(|operand| moved[operand.0 as usize]),
            };
            if moved[at] {
                self.operands(node).for_each(|operand| asked_for[operand.0 as usize] = true);
            }
        }
        let is_apart = |node: &Node| {
            let at = node.0 as usize;
            asked_for[at] && !moved[at] && self.uniform[at].is_none()
        };
        behind.into_iter().filter(is_apart).collect()
    }

    /// Whether a value is made of any of these.
    pub fn depends(&self, node: Node, on: &[Node]) -> bool {
        self.behind(&[node]).iter().any(|part| on.contains(part))
    }

    /// The columns that a value is made of.
    pub fn reads(&self, node: Node) -> Vec<&str> {
        let input = |node: &Node| match self.nodes[node.0 as usize] {
            Kind::Input(index) => Some(self.inputs[index as usize].as_str()),
            _ => None,
        };
        self.behind(&[node]).iter().filter_map(input).collect()
    }
}

/// The exponent of a power that is a small whole number: taken by multiplication.
pub(super) fn whole_power(operation: Operation, exponent: Option<f64>) -> Option<i32> {
    let small = |exponent: &f64| exponent.fract() == 0.0 && exponent.abs() <= 16.0;
    exponent.filter(|exponent| operation == Operation::Power && small(exponent)).map(|exponent| exponent as i32)
}
