//! Values of a graph as statements of C99: the operations of the machine in its order, on one sample. What remembers is a member of a struct
//! and a call of a small function. Which file the statements stand in, and where columns come from, is the caller's business.

use super::c_helpers::Helper;
use super::graph::{Graph, Kind, Node, Recall, whole_power};
use super::memory::lag_coefficients;
use super::operation::{History, Operation};
use std::collections::BTreeSet;

/// Expressions that are used once stand where they are used, up to this length.
const LONGEST: usize = 90;

/// Some values of a graph in C.
#[derive(Debug, Default)]
pub(crate) struct Statements {
    /// In order, without indentation.
    pub lines: Vec<String>,
    /// An expression for each root.
    pub roots: Vec<String>,
    /// Declarations of what is remembered from sample to sample.
    pub members: Vec<String>,
    /// Functions that are called.
    pub helpers: BTreeSet<Helper>,
    /// Whether all numbers in it are numbers in single precision, too, neither too large nor too small.
    pub fits_single: bool,
}

/// How tightly the outermost operator of an expression binds, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Sign,
    Atom,
}

#[derive(Clone, Debug)]
struct Expression {
    text: String,
    binding: Binding,
}

impl Expression {
    fn atom(text: impl Into<String>) -> Self {
        Self { text: text.into(), binding: Binding::Atom }
    }

    /// In brackets where it binds less tightly than this.
    fn at_least(&self, binding: Binding) -> String {
        if self.binding < binding { format!("({})", self.text) } else { self.text.clone() }
    }
}

struct Writer<'a> {
    graph: &'a Graph,
    step_s: f64,
    /// By node: how often its text would stand somewhere.
    uses: Vec<usize>,
    /// By node.
    known: Vec<Option<Expression>>,
    variables: usize,
    made: Statements,
}

/// A number of the file's type.
fn number(value: f64) -> Result<String, String> {
    if value.is_finite() { Ok(format!("R({value:?})")) } else { Err(format!("{value}, which C has no constant for")) }
}

fn is_single(value: f64) -> bool {
    value == 0.0 || (f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX)).contains(&value.abs())
}

/// The statements for some values, every symbol at its own value. `input` gives for each column that is read the name of a variable
/// and its value.
///
/// # Errors
/// The number that C cannot write, as the end of a sentence.
pub(crate) fn statements(
    graph: &Graph,
    roots: &[Node],
    step_s: f64,
    input: &dyn Fn(&str) -> (String, String),
) -> Result<Statements, String> {
    let behind: Vec<Node> = graph.behind(roots).into_iter().filter(|node| graph.uniform(*node).is_none()).collect();
    let mut uses = vec![0; graph.nodes.len()];
    let mut used = |node: Node, times: usize| uses[node.0 as usize] += times;
    roots.iter().for_each(|root| used(*root, 1));
    for &node in &behind {
        match graph.nodes[node.0 as usize] {
            // A whole power names its operand as often as it multiplies by it.
            Kind::Two(operation, x, y) if whole_power(operation, graph.uniform(y)).is_some() => used(x, 2),
            _ => graph.operands(node).for_each(|operand| used(operand, 1)),
        }
    }
    let read = behind.iter().flat_map(|node| graph.operands(*node)).chain(roots.iter().copied());
    let fits_single = read.filter_map(|node| graph.uniform(node)).chain([step_s]).all(is_single);
    let known = vec![None; graph.nodes.len()];
    let mut writer = Writer { graph, step_s, uses, known, variables: 0, made: Statements { fits_single, ..Statements::default() } };
    for node in behind {
        let expression = writer.expression(node, input)?;
        writer.known[node.0 as usize] = Some(expression);
    }
    writer.made.roots = roots.iter().map(|root| Ok(writer.operand(*root)?.text)).collect::<Result<_, String>>()?;
    Ok(writer.made)
}

impl Writer<'_> {
    fn operand(&self, node: Node) -> Result<Expression, String> {
        match self.graph.uniform(node) {
            Some(value) => number(value).map(Expression::atom),
            None => Ok(self.known[node.0 as usize].clone().expect("operands come before what is made of them")),
        }
    }

    /// A variable of this name, or the next one.
    fn variable(&mut self, name: Option<String>, value: &str) -> Expression {
        let name = name.unwrap_or_else(|| {
            self.variables += 1;
            format!("v{}", self.variables)
        });
        self.made.lines.push(format!("const @_real {name} = {value};"));
        Expression::atom(name)
    }

    fn expression(&mut self, node: Node, input: &dyn Fn(&str) -> (String, String)) -> Result<Expression, String> {
        let expression = match self.graph.nodes[node.0 as usize] {
            Kind::Number(_) | Kind::Symbol(_) => unreachable!("a number is the same at all samples"),
            Kind::Input(index) => {
                let (name, value) = input(&self.graph.inputs[index as usize]);
                return Ok(self.variable(Some(name), &value));
            }
            Kind::One(operation, x) => {
                let x = self.operand(x)?;
                self.one(operation, &x)
            }
            Kind::Two(operation, x, y) => match whole_power(operation, self.graph.uniform(y)) {
                Some(exponent) => {
                    let x = self.operand(x)?;
                    self.whole_power(&x, exponent)
                }
                None => {
                    let (x, y) = (self.operand(x)?, self.operand(y)?);
                    self.two(operation, &x, &y)
                }
            },
            Kind::Recall(recall, [x, time, ..]) => {
                let call = self.recall(recall, x, time)?;
                return Ok(self.variable(None, &call));
            }
        };
        let stays = self.uses[node.0 as usize] <= 1 && expression.text.len() <= LONGEST;
        Ok(if stays { expression } else { self.variable(None, &expression.text) })
    }

    /// A call of a function of the file.
    fn call(&mut self, helper: Helper, name: &str, arguments: &[&str]) -> Expression {
        self.made.helpers.insert(helper);
        Expression::atom(format!("@_{name}({})", arguments.join(", ")))
    }

    fn one(&mut self, operation: Operation, x: &Expression) -> Expression {
        let name = match operation {
            Operation::Negate => {
                return Expression { text: format!("-{}", x.at_least(Binding::Atom)), binding: Binding::Sign };
            }
            Operation::Sign => return self.call(Helper::Sign, "sign", &[&x.text]),
            Operation::Abs => "fabs",
            Operation::Sqrt => "sqrt",
            Operation::Exp => "exp",
            Operation::Log => "log",
            Operation::Sin => "sin",
            Operation::Cos => "cos",
            Operation::Tan => "tan",
            Operation::Tanh => "tanh",
            _ => unreachable!("an operation of two operands"),
        };
        Expression::atom(format!("F({name})({})", x.text))
    }

    fn two(&mut self, operation: Operation, x: &Expression, y: &Expression) -> Expression {
        // The right operand of a minus or a division is not regrouped, nor is that of a sum or a product: rounding depends on the order.
        let infix = |symbol: &str, binding: Binding, right: Binding| Expression {
            text: format!("{} {symbol} {}", x.at_least(binding), y.at_least(right)),
            binding,
        };
        let truth = |symbol: &str| {
            let text = format!("R({} {symbol} {})", x.at_least(Binding::Sum), y.at_least(Binding::Sum));
            Expression::atom(text)
        };
        let function = |name: &str| Expression::atom(format!("F({name})({}, {})", x.text, y.text));
        match operation {
            Operation::Add => infix("+", Binding::Sum, Binding::Product),
            Operation::Subtract => infix("-", Binding::Sum, Binding::Product),
            Operation::Multiply => infix("*", Binding::Product, Binding::Sign),
            Operation::Divide => infix("/", Binding::Product, Binding::Sign),
            Operation::Less => truth("<"),
            Operation::LessOrEqual => truth("<="),
            Operation::Greater => truth(">"),
            Operation::GreaterOrEqual => truth(">="),
            Operation::Power => function("pow"),
            Operation::Atan2 => function("atan2"),
            Operation::Hypot => function("hypot"),
            Operation::Min => self.call(Helper::Least, "least", &[&x.text, &y.text]),
            Operation::Max => self.call(Helper::Greatest, "greatest", &[&x.text, &y.text]),
            _ => unreachable!("an operation of one operand, or one that was taken apart"),
        }
    }

    /// As the machine multiplies.
    fn whole_power(&mut self, x: &Expression, exponent: i32) -> Expression {
        let factor = x.at_least(Binding::Atom);
        let text = match exponent {
            2 => format!("{factor} * {factor}"),
            3 => format!("{factor} * ({factor} * {factor})"),
            4 => format!("({factor} * {factor}) * ({factor} * {factor})"),
            -1 => format!("R(1.0) / {factor}"),
            -2 => format!("R(1.0) / ({factor} * {factor})"),
            _ => return self.call(Helper::WholePower, "whole_power", &[&x.text, &exponent.to_string()]),
        };
        Expression { text, binding: Binding::Product }
    }

    /// What remembers: a member of the memory, and the call that brings it up to this sample.
    fn recall(&mut self, recall: Recall, x: Node, time: Node) -> Result<String, String> {
        let Recall::History(history) = recall else { unreachable!("derivatives are not asked for") };
        let (x, value, step_s) = (self.operand(x)?.text, self.graph.uniform(time), number(self.step_s)?);
        let place = self.made.members.len();
        let fixed = || value.expect("only the time of a lag varies");
        let (member, helper, call) = match (history, value) {
            (History::Lag, Some(tau_s)) => {
                let [approach, ramp] = lag_coefficients(tau_s, self.step_s);
                let call = format!("@_lag(memory->lag_{place}, first, {x}, {}, {})", number(approach)?, number(ramp)?);
                (format!("@_real lag_{place}[2];"), Helper::Lag, call)
            }
            (History::Lag, None) => {
                let tau_s = self.operand(time)?.text;
                self.made.helpers.insert(Helper::Lag);
                let call = format!("@_varying_lag(memory->lag_{place}, first, {x}, {tau_s}, {step_s})");
                (format!("@_real lag_{place}[2];"), Helper::VaryingLag, call)
            }
            (History::Delay, _) => {
                let steps = fixed() / self.step_s;
                // The sample at hand, those that are waited for, and the one before.
                let length = steps.floor() as u64 + 2;
                let part = number(steps - steps.floor())?;
                let call = format!("@_delay(memory->delay_{place}, {length}ul, &memory->newest_{place}, first, {x}, {part})");
                (format!("@_real delay_{place}[{length}];\nunsigned long newest_{place};"), Helper::Delay, call)
            }
            (History::Rate, _) => {
                (format!("@_real rate_{place};"), Helper::Rate, format!("@_rate(&memory->rate_{place}, first, {x}, {step_s})"))
            }
            (History::Slew, _) => {
                let limit = number(fixed() * self.step_s)?;
                let call = format!("@_slew(&memory->slew_{place}, &memory->known_{place}, first, {x}, {limit})");
                (format!("@_real slew_{place};\nint known_{place};"), Helper::Slew, call)
            }
        };
        self.made.members.push(member);
        self.made.helpers.insert(helper);
        Ok(call)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::Formula;

    fn written(text: &str) -> Result<Statements, String> {
        let mut graph = Graph::new();
        let formula = Formula::parse(text).map_err(|error| error.to_string())?;
        let root = graph.add(&formula, &mut |_, _| Ok(None)).map_err(|error| error.to_string())?;
        statements(&graph, &[root], 0.01, &|name| (name.to_owned(), format!("in_{name}")))
    }

    #[test]
    fn operations_keep_their_order_and_brackets() -> Result<(), String> {
        for (formula, expected) in [
            ("x - (y - z)", "x - (y - z)"),
            ("x + (y + z)", "x + (y + z)"),
            ("x - y - z", "x - y - z"),
            ("x / (y * z)", "x / (y * z)"),
            ("-(x + 1) * y", "-(x + R(1.0)) * y"),
            ("- -x", "-(-x)"),
            ("x - -y", "x - -y"),
            ("(x < y) * z", "R(x < y) * z"),
            ("x^2 * y", "x * x * y"),
            ("y * x^2", "y * (x * x)"),
            ("y / x^-1", "y / (R(1.0) / x)"),
            ("x^0.5", "F(pow)(x, R(0.5))"),
            ("x^7", "@_whole_power(x, 7)"),
            ("clamp(x, -1, y)", "@_least(@_greatest(x, R(-1.0)), y)"),
            ("2 * 3 + 1", "R(7.0)"),
        ] {
            assert_eq!(written(formula)?.roots, [expected], "{formula}");
        }
        // A factor that is no name becomes one.
        let squared = written("(x + y)^2")?;
        assert_eq!(
            (squared.lines.last().map(String::as_str), squared.roots[0].as_str()),
            (Some("const @_real v1 = x + y;"), "v1 * v1")
        );
        Ok(())
    }

    #[test]
    fn what_remembers_has_a_member_and_constants_of_its_own() -> Result<(), String> {
        let made = written("lag(x, 0.1) + delay(x, 0.025) + rate(y) + slew(y, 3) + lag(x, y)")?;
        let members = [
            "@_real lag_0[2];",
            "@_real delay_1[4];\nunsigned long newest_1;",
            "@_real rate_2;",
            "@_real slew_3;\nint known_3;",
            "@_real lag_4[2];",
        ];
        assert_eq!(made.members, members);
        assert_eq!(made.helpers.len(), 5);
        assert!(
            made.lines.iter().any(|line| line.ends_with("@_delay(memory->delay_1, 4ul, &memory->newest_1, first, x, R(0.5));"))
        );
        Ok(())
    }

    #[test]
    fn numbers_beyond_single_precision_are_seen() -> Result<(), String> {
        for (formula, fits) in [("1 / max(x, 1e-9)", true), ("1 / max(x, 1e-50)", false), ("x * 1e40", false), ("x + 0", true)] {
            assert_eq!(written(formula)?.fits_single, fits, "{formula}");
        }
        Ok(())
    }

    #[test]
    fn a_constant_that_c_cannot_write_is_refused() {
        assert!(written("x * (1 / 0)").is_err_and(|message| message.contains("inf")));
        // Where it does not get into the result, it does no harm.
        assert!(written("x * (1 / (1 / 0))").is_ok());
    }
}
