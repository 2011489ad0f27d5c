//! Derivatives of a graph by its symbols, as further nodes of the same graph: exact, with equal parts shared, and causal, since an
//! operator that remembers has one that remembers the same as its derivative.
//!
//! Where a function has no derivative, at the corner of `max` or of `abs`, one side's is taken; where it has none that is
//! finite (a root at 0), it is 0.

use super::graph::{Graph, Kind, Node, Recall, Symbol};
use super::operation::{History, Operation};
use std::collections::HashMap;

impl Graph {
    /// Derivatives of some values by a symbol; `None` where a value does not depend on it. A symbol that is 0 wherever this graph is
    /// evaluated is taken for the number 0 in them.
    pub fn derivatives(&mut self, values: &[Node], symbol: Node) -> Vec<Option<Node>> {
        let behind = self.behind(values);
        let mut known: HashMap<Node, Node> = HashMap::new();
        let one = self.number(1.0);
        for node in behind {
            if node == symbol {
                known.insert(node, one);
            } else if let Some(derivative) = self.derivative_of(node, &|node| known.get(&node).copied()) {
                known.insert(node, derivative);
            }
        }
        let mut found: Vec<Option<Node>> = values.iter().map(|value| known.get(value).copied()).collect();
        let settled = self.settled(&found.iter().flatten().copied().collect::<Vec<_>>());
        for (node, settled) in found.iter_mut().flatten().zip(settled) {
            *node = settled;
        }
        found.into_iter().map(|node| node.filter(|node| !self.is(*node, 0.0))).collect()
    }

    /// The same values with what never acts left out: products with 0, sums with 0, products with 1, and symbols that are 0
    /// wherever this graph is evaluated.
    pub fn settled(&mut self, values: &[Node]) -> Vec<Node> {
        self.with_zeros(values, &|symbol, _| symbol.value == 0.0 && !symbol.varies)
    }

    /// A value where these symbols are 0, with what then never acts left out.
    pub fn without(&mut self, value: Node, symbols: &[Node]) -> Node {
        self.with_zeros(&[value], &|_, node| symbols.contains(&node))[0]
    }

    fn with_zeros(&mut self, values: &[Node], is_zero: &dyn Fn(Symbol, Node) -> bool) -> Vec<Node> {
        let mut known: HashMap<Node, Node> = HashMap::new();
        for node in self.behind(values) {
            let of = |node: Node| known.get(&node).copied().expect("operands come first");
            let settled = match self.nodes[node.0 as usize] {
                Kind::Number(_) | Kind::Input(_) => node,
                Kind::Symbol(index) => {
                    if is_zero(self.symbols[index as usize], node) {
                        self.number(0.0)
                    } else {
                        node
                    }
                }
                Kind::One(operation, operand) => {
                    let operand = of(operand);
                    self.unary(operation, operand)
                }
                Kind::Two(operation, left, right) => {
                    let (left, right) = (of(left), of(right));
                    self.binary(operation, left, right)
                }
                Kind::Recall(recall, operands) => {
                    let operands = operands.map(of);
                    self.remembering(recall, operands)
                }
            };
            known.insert(node, settled);
        }
        values.iter().map(|value| known[value]).collect()
    }

    fn is(&self, node: Node, number: f64) -> bool {
        self.literal(node) == Some(number)
    }

    fn literal(&self, node: Node) -> Option<f64> {
        match self.nodes[node.0 as usize] {
            Kind::Number(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// A value that is made of plain numbers alone is one.
    fn folded(&mut self, node: Node) -> Node {
        let value = self.uniform(node).filter(|_| self.operands(node).all(|operand| self.literal(operand).is_some()));
        value.map_or(node, |value| self.number(value))
    }

    fn unary(&mut self, operation: Operation, operand: Node) -> Node {
        let node = self.one(operation, operand);
        self.folded(node)
    }

    fn binary(&mut self, operation: Operation, left: Node, right: Node) -> Node {
        let (zero, one) = (|graph: &Self, node| graph.is(node, 0.0), |graph: &Self, node| graph.is(node, 1.0));
        match operation {
            Operation::Add if zero(self, left) => right,
            Operation::Add | Operation::Subtract if zero(self, right) => left,
            Operation::Subtract if zero(self, left) => self.one(Operation::Negate, right),
            Operation::Multiply if zero(self, left) || one(self, right) => left,
            Operation::Multiply if zero(self, right) || one(self, left) => right,
            Operation::Divide if zero(self, left) || one(self, right) => left,
            Operation::Power if one(self, right) => left,
            Operation::Power if zero(self, right) => self.number(1.0),
            _ => {
                let node = self.two(operation, left, right);
                self.folded(node)
            }
        }
    }

    fn remembering(&mut self, recall: Recall, operands: [Node; 4]) -> Node {
        let [signal, time, tangent, limit] = operands;
        let is_zero = |graph: &Self, node| graph.is(node, 0.0);
        let nothing = match recall {
            Recall::LagTangent | Recall::SlewTangent => is_zero(self, tangent) && is_zero(self, limit),
            _ => is_zero(self, signal),
        };
        // A lag or a delay of no time passes its signal on.
        if nothing {
            self.number(0.0)
        } else if matches!(recall, Recall::History(History::Lag | History::Delay)) && is_zero(self, time) {
            signal
        } else {
            self.remember(recall, operands)
        }
    }

    fn add_up(&mut self, left: Option<Node>, right: Option<Node>) -> Option<Node> {
        match (left, right) {
            (Some(left), Some(right)) => Some(self.binary(Operation::Add, left, right)),
            (left, right) => left.or(right),
        }
    }

    fn times(&mut self, left: Node, right: Node) -> Node {
        self.binary(Operation::Multiply, left, right)
    }

    /// `x` where it is not 0, and 1 where it is: a divisor.
    fn divisor(&mut self, x: Node) -> Node {
        let (zero, size) = (self.number(0.0), self.one(Operation::Abs, x));
        let vanishes = self.two(Operation::LessOrEqual, size, zero);
        self.two(Operation::Add, x, vanishes)
    }

    /// The derivative of one node from those of its operands.
    fn derivative_of(&mut self, node: Node, of: &dyn Fn(Node) -> Option<Node>) -> Option<Node> {
        match self.nodes[node.0 as usize] {
            Kind::Number(_) | Kind::Symbol(_) | Kind::Input(_) => None,
            Kind::One(operation, x) => {
                let dx = of(x)?;
                self.derivative_of_one(operation, node, x, dx)
            }
            Kind::Two(operation, x, y) => {
                let (dx, dy) = (of(x), of(y));
                if dx.is_none() && dy.is_none() {
                    return None;
                }
                self.derivative_of_two(operation, node, (x, dx), (y, dy))
            }
            Kind::Recall(recall, [x, time, ..]) => {
                let (dx, dtime) = (of(x), of(time));
                match recall {
                    Recall::History(History::Rate) => dx.map(|dx| self.remember(Recall::History(History::Rate), [dx])),
                    Recall::History(History::Lag) if dtime.is_some() && self.uniform(time).is_none() => {
                        let zero = self.number(0.0);
                        Some(self.remember(Recall::LagTangent, [x, time, dx.unwrap_or(zero), dtime.unwrap_or(zero)]))
                    }
                    Recall::History(history @ (History::Lag | History::Delay)) => {
                        let by_signal = dx.map(|dx| self.remember(Recall::History(history), [dx, time]));
                        let by_time = dtime.map(|dtime| {
                            let kind = if history == History::Lag { Recall::LagByTime } else { Recall::DelayByTime };
                            let slope = self.remember(kind, [x, time]);
                            self.times(slope, dtime)
                        });
                        self.add_up(by_signal, by_time)
                    }
                    Recall::History(History::Slew) => {
                        let zero = self.number(0.0);
                        (dx.is_some() || dtime.is_some())
                            .then(|| self.remember(Recall::SlewTangent, [x, time, dx.unwrap_or(zero), dtime.unwrap_or(zero)]))
                    }
                    Recall::LagByTime | Recall::LagTangent | Recall::DelayByTime | Recall::SlewTangent => {
                        unreachable!("derivatives are taken of formulas, not of derivatives")
                    }
                }
            }
        }
    }

    fn derivative_of_one(&mut self, operation: Operation, node: Node, x: Node, dx: Node) -> Option<Node> {
        let one = self.number(1.0);
        let slope = match operation {
            Operation::Negate => return Some(self.unary(Operation::Negate, dx)),
            Operation::Abs => self.one(Operation::Sign, x),
            Operation::Sqrt => {
                let (zero, two) = (self.number(0.0), self.number(2.0));
                let (positive, divisor) = (self.two(Operation::Greater, node, zero), self.divisor(node));
                let twice = self.two(Operation::Multiply, two, divisor);
                self.two(Operation::Divide, positive, twice)
            }
            Operation::Exp => node,
            Operation::Log => self.two(Operation::Divide, one, x),
            Operation::Sin => self.one(Operation::Cos, x),
            Operation::Cos => {
                let sine = self.one(Operation::Sin, x);
                self.one(Operation::Negate, sine)
            }
            Operation::Tan => {
                let square = self.two(Operation::Multiply, node, node);
                self.two(Operation::Add, one, square)
            }
            Operation::Tanh => {
                let square = self.two(Operation::Multiply, node, node);
                self.two(Operation::Subtract, one, square)
            }
            Operation::Sign => return None,
            _ => unreachable!("an operation of two operands"),
        };
        Some(self.times(slope, dx))
    }

    fn derivative_of_two(
        &mut self,
        operation: Operation,
        node: Node,
        (x, dx): (Node, Option<Node>),
        (y, dy): (Node, Option<Node>),
    ) -> Option<Node> {
        match operation {
            Operation::Add => self.add_up(dx, dy),
            Operation::Subtract => {
                let minus = dy.map(|dy| self.unary(Operation::Negate, dy));
                match (dx, dy) {
                    (Some(dx), Some(dy)) => Some(self.binary(Operation::Subtract, dx, dy)),
                    _ => dx.or(minus),
                }
            }
            Operation::Multiply => {
                let (left, right) = (dx.map(|dx| self.times(dx, y)), dy.map(|dy| self.times(x, dy)));
                self.add_up(left, right)
            }
            Operation::Divide => {
                let left = dx.map(|dx| self.binary(Operation::Divide, dx, y));
                let right = dy.map(|dy| {
                    let product = self.times(node, dy);
                    let share = self.binary(Operation::Divide, product, y);
                    self.unary(Operation::Negate, share)
                });
                self.add_up(left, right)
            }
            Operation::Power => {
                let base = dx.map(|dx| self.power_by_base(node, x, y, dx));
                let exponent = dy.map(|dy| {
                    // x^y log x, 0 where x is 0; a negative base has no derivative by its exponent.
                    let tiny = self.number(f64::MIN_POSITIVE);
                    let guarded = self.two(Operation::Max, x, tiny);
                    let logarithm = self.one(Operation::Log, guarded);
                    let slope = self.times(node, logarithm);
                    self.times(slope, dy)
                });
                self.add_up(base, exponent)
            }
            Operation::Less | Operation::LessOrEqual | Operation::Greater | Operation::GreaterOrEqual => None,
            Operation::Atan2 => {
                // atan2(y, x) is called with y first: here x is the ordinate.
                let ((ordinate, abscissa), (of_ordinate, of_abscissa)) = ((x, y), (dx, dy));
                let squares = [ordinate, abscissa].map(|side| self.two(Operation::Multiply, side, side));
                let square = self.two(Operation::Add, squares[0], squares[1]);
                let divisor = self.divisor(square);
                let left = of_ordinate.map(|d| self.times(abscissa, d));
                let right = of_abscissa.map(|d| {
                    let product = self.times(ordinate, d);
                    self.unary(Operation::Negate, product)
                });
                let top = self.add_up(left, right)?;
                Some(self.binary(Operation::Divide, top, divisor))
            }
            Operation::Min | Operation::Max => {
                let first = if operation == Operation::Max { Operation::GreaterOrEqual } else { Operation::LessOrEqual };
                let second = if operation == Operation::Max { Operation::Less } else { Operation::Greater };
                let left = dx.map(|dx| {
                    let chosen = self.two(first, x, y);
                    self.times(chosen, dx)
                });
                let right = dy.map(|dy| {
                    let chosen = self.two(second, x, y);
                    self.times(chosen, dy)
                });
                self.add_up(left, right)
            }
            Operation::Hypot => {
                let (left, right) = (dx.map(|dx| self.times(x, dx)), dy.map(|dy| self.times(y, dy)));
                let top = self.add_up(left, right)?;
                let divisor = self.divisor(node);
                Some(self.binary(Operation::Divide, top, divisor))
            }
            _ => unreachable!("an operation of one operand, or one that was taken apart"),
        }
    }

    /// `y x^(y-1) dx`; where the exponent is below 1 or varies, `y x^y / x dx` with 0 where x is 0.
    fn power_by_base(&mut self, node: Node, x: Node, y: Node, dx: Node) -> Node {
        let slope = if self.uniform(y).is_some_and(|exponent| exponent >= 1.0) {
            let one = self.number(1.0);
            let less = self.two(Operation::Subtract, y, one);
            let less = self.uniform(less).map_or(less, |value| if value == 1.0 { one } else { less });
            let power = self.binary(Operation::Power, x, less);
            self.times(y, power)
        } else {
            let (zero, divisor) = (self.number(0.0), self.divisor(x));
            let size = self.one(Operation::Abs, x);
            let there = self.two(Operation::Greater, size, zero);
            let product = self.times(y, node);
            let ratio = self.two(Operation::Divide, product, divisor);
            self.times(there, ratio)
        };
        self.times(slope, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Formula, Machine};
    use super::*;
    use crate::error::Result;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.01;
    const SAMPLES: usize = 160;

    /// Random smooth formulas of the columns `a`, `b` and the numbers `p`, `q`, with values of about 1.
    fn formulas() -> impl Strategy<Value = String> {
        let leaf = prop::sample::select(vec!["a", "b", "p", "q", "a * p", "b - q", "0.75"]).prop_map(str::to_owned);
        leaf.prop_recursive(5, 40, 3, |inner| {
            let one = prop::sample::select(vec![
                "tanh(X)",
                "sin(X)",
                "cos(X)",
                "exp(tanh(X))",
                "sqrt(1.5 + tanh(X))",
                "log(2 + sin(X))",
                "tan(0.5 * sin(X))",
                "-X",
                "tanh(X)^2",
                "(2 + sin(X))^-1.5",
                "tanh(rate(lag(X, 0.05)) / 50)",
                "lag(X, 0.1 + p / 10)",
                "lag(X, q * q / 20)",
                "lag(a, 0.05 + p * (1 + tanh(X)) / 20)",
                "lag(X, 0.03 + q * b * b / 10)",
                "delay(X, 0.017 + p / 1000)",
            ]);
            let two = prop::sample::select(vec![
                "X + Y",
                "X - Y",
                "tanh(X) * Y",
                "X / (2 + sin(Y))",
                "(2 + sin(X))^tanh(Y)",
                "hypot(X, 1 + tanh(Y))",
                "atan2(X, 3 + tanh(Y))",
            ]);
            prop_oneof![
                (one, inner.clone()).prop_map(|(form, x)| form.replace('X', &format!("({x})"))),
                (two, inner.clone(), inner).prop_map(|(form, x, y)| {
                    form.replace('X', "\u{1}").replace('Y', &format!("({y})")).replace('\u{1}', &format!("({x})"))
                }),
            ]
        })
    }

    fn columns() -> [Vec<f64>; 2] {
        let wave = |rate: f64, phase: f64| (0..SAMPLES).map(|k| (rate * k as f64 + phase).sin()).collect();
        [wave(0.11, 0.3), wave(0.047, 1.2)]
    }

    /// Values of some roots, with `p` and `q` among the symbols at other values.
    fn run(graph: &Graph, roots: &[Node], number: &dyn Fn(Node) -> Option<f64>) -> Vec<Vec<f64>> {
        let [a, b] = columns();
        let mut machine = Machine::new(graph, roots, STEP_S, number).expect("a step and short delays");
        let inputs: Vec<usize> = machine.inputs().to_vec();
        let mut found = vec![Vec::new(); roots.len()];
        let block = machine.block();
        for start in (0..SAMPLES).step_by(block) {
            let range = start..(start + block).min(SAMPLES);
            let column = |input: usize| if graph.inputs()[inputs[input]] == "a" { &a[range.clone()] } else { &b[range.clone()] };
            machine.advance(range.len(), &column);
            for (index, found) in found.iter_mut().enumerate() {
                found.extend_from_slice(&machine.root(index)[..range.len()]);
            }
        }
        found
    }

    /// A formula with its symbols `p` and `q`.
    fn graph(text: &str, p: f64, q: f64) -> Result<(Graph, Node, [Node; 2])> {
        let mut graph = Graph::new();
        let symbols = [graph.symbol(p, true), graph.symbol(q, true)];
        let root = graph.add(&Formula::parse(text)?, &mut |_, name| {
            Ok(["p", "q"].iter().position(|known| *known == name).map(|index| symbols[index]))
        })?;
        Ok((graph, root, symbols))
    }

    /// Largest difference between the derivative and a central difference, beside the largest derivative, for both symbols.
    fn deviation(text: &str, p: f64, q: f64) -> Result<f64> {
        let (mut graph, root, symbols) = graph(text, p, q)?;
        let mut worst = 0.0_f64;
        for (symbol, value) in symbols.into_iter().zip([p, q]) {
            let derivative = graph.derivatives(&[root], symbol)[0];
            let found = derivative.map_or_else(|| vec![0.0; SAMPLES], |node| run(&graph, &[node], &|_| None).remove(0));
            let moved = |by: f64| run(&graph, &[root], &|node| (node == symbol).then_some(value + by)).remove(0);
            let h = 1e-5;
            // Five points: the error is of fourth order in h.
            let [far_up, up, down, far_down] = [2.0 * h, h, -h, -2.0 * h].map(moved);
            let scale = found.iter().fold(1.0_f64, |largest, value| largest.max(value.abs()));
            for k in 0..SAMPLES {
                let expected = (far_down[k] - 8.0 * down[k] + 8.0 * up[k] - far_up[k]) / (12.0 * h);
                worst = worst.max((found[k] - expected).abs() / scale);
            }
        }
        Ok(worst)
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_differences(text in formulas(), p in 0.2..1.2f64, q in 0.2..1.2f64) {
            let worst = deviation(&text, p, q)?;
            prop_assert!(worst < 1e-6, "{worst:.1e}: {text}");
        }
    }

    #[test]
    fn functions_with_corners_have_the_derivative_of_the_side_they_are_on() -> Result<()> {
        for text in [
            "abs(a * p + 0.013)",
            "max(a * p, 0.123, b * q)",
            "min(a * p, q - 0.5)",
            "clamp(a * p, -q / 3, 0.311)",
            "slew(a * p, q * 3)",
            "slew(lag(b, p), 2.5)",
            "sign(a) * abs(a)^p",
            "(a < p) * q",
        ] {
            // Some samples lie on a corner, where a difference sees both sides: few, and those do not count.
            let (mut graph, root, symbols) = graph(text, 0.83, 0.61)?;
            for (symbol, value) in symbols.into_iter().zip([0.83, 0.61]) {
                let Some(derivative) = graph.derivatives(&[root], symbol)[0] else { continue };
                let found = run(&graph, &[derivative], &|_| None).remove(0);
                let moved = |by: f64| run(&graph, &[root], &|node| (node == symbol).then_some(value + by)).remove(0);
                let (up, down) = (moved(1e-6), moved(-1e-6));
                let wrong = (0..SAMPLES).filter(|&k| (found[k] - (up[k] - down[k]) / 2e-6).abs() > 1e-5).count();
                assert!(wrong <= 3, "`{text}`: {wrong} of {SAMPLES} samples");
                assert!(found.iter().any(|value| *value != 0.0), "`{text}`");
            }
        }
        Ok(())
    }

    #[test]
    fn derivatives_are_finite_where_a_root_or_a_ratio_of_nothing_is_taken() -> Result<()> {
        for text in ["sqrt(p * max(a, 0))", "hypot(p * max(a, 0), p * max(a, 0))", "abs(max(a, 0) * p)^0.5", "max(a, 0)^p"] {
            let (mut graph, root, [p, _]) = graph(text, 0.7, 1.0)?;
            let derivative = graph.derivatives(&[root], p)[0].expect("it depends on p");
            assert!(run(&graph, &[derivative], &|_| None)[0].iter().all(|value| value.is_finite()), "`{text}`");
        }
        Ok(())
    }

    #[test]
    fn a_lag_and_a_delay_of_no_time_have_the_derivative_of_a_short_one() -> Result<()> {
        for text in ["lag(a, p)", "delay(a, p)"] {
            let (mut graph, root, [p, _]) = graph(text, 0.0, 1.0)?;
            let derivative = graph.derivatives(&[root], p)[0].expect("it depends on p");
            let found = run(&graph, &[derivative], &|_| None).remove(0);
            let (none, short) = (run(&graph, &[root], &|_| None).remove(0), run(&graph, &[root], &|_| Some(1e-7)).remove(0));
            for k in 0..SAMPLES {
                assert!((found[k] - (short[k] - none[k]) / 1e-7).abs() < 1e-3 * 11.0, "{text} at {k}: {}", found[k]);
            }
        }
        Ok(())
    }

    #[test]
    fn equal_parts_are_one_and_numbers_that_are_zero_leave_nothing_behind() -> Result<()> {
        let mut graph = Graph::new();
        let (off, on) = (graph.symbol(0.0, false), graph.symbol(2.0, false));
        let add = |graph: &mut Graph, text: &str| {
            graph.add(&Formula::parse(text)?, &mut |_, name| {
                Ok(match name {
                    "off" => Some(off),
                    "on" => Some(on),
                    _ => None,
                })
            })
        };
        let plain = add(&mut graph, "b")?;
        let model = add(&mut graph, "on * (b + off * sin(a)) + off * a")?;
        assert_eq!(graph.derivatives(&[model], on), [Some(plain)]);
        let by_off = add(&mut graph, "on * sin(a) + a")?;
        assert_eq!(graph.derivatives(&[model], off), [Some(by_off)]);
        assert_eq!(graph.reads(by_off), ["a"]);
        Ok(())
    }
}
