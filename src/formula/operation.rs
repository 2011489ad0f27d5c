//! The words of the grammar: operators and functions, their names, argument counts and what they compute. No parsing here.

use phyture_kernels::{InstructionSet, columns};

/// An operation without memory: its result depends on this sample's operands alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Operation {
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Abs,
    Sqrt,
    Exp,
    Log,
    Sin,
    Cos,
    Tan,
    Atan2,
    Tanh,
    Min,
    Max,
    Sign,
    Hypot,
    Clamp,
}

/// Longest delay, s: bounds the memory a formula can ask for.
pub(super) const MAX_DELAY_S: f64 = 60.0;

/// An operation that remembers earlier samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum History {
    Lag,
    Delay,
    Rate,
    Slew,
}

/// What a function name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Plain(Operation),
    History(History),
}

/// Every function: name, operation, fewest and most arguments.
#[rustfmt::skip]
pub(super) const FUNCTIONS: [(&str, Function, usize, usize); 18] = [
    ("abs", Function::Plain(Operation::Abs), 1, 1),
    ("sqrt", Function::Plain(Operation::Sqrt), 1, 1),
    ("exp", Function::Plain(Operation::Exp), 1, 1),
    ("log", Function::Plain(Operation::Log), 1, 1),
    ("sin", Function::Plain(Operation::Sin), 1, 1),
    ("cos", Function::Plain(Operation::Cos), 1, 1),
    ("tan", Function::Plain(Operation::Tan), 1, 1),
    ("atan2", Function::Plain(Operation::Atan2), 2, 2),
    ("tanh", Function::Plain(Operation::Tanh), 1, 1),
    ("min", Function::Plain(Operation::Min), 2, usize::MAX),
    ("max", Function::Plain(Operation::Max), 2, usize::MAX),
    ("sign", Function::Plain(Operation::Sign), 1, 1),
    ("hypot", Function::Plain(Operation::Hypot), 2, usize::MAX),
    ("clamp", Function::Plain(Operation::Clamp), 3, 3),
    ("lag", Function::History(History::Lag), 2, 2),
    ("delay", Function::History(History::Delay), 2, 2),
    ("rate", Function::History(History::Rate), 1, 1),
    ("slew", Function::History(History::Slew), 2, 2),
];

/// How a function is called and what it gives, for a person.
pub(super) const fn described(function: Function) -> (&'static str, &'static str) {
    match function {
        Function::Plain(operation) => match operation {
            Operation::Abs => ("abs(x)", "size without sign"),
            Operation::Sqrt => ("sqrt(x)", "square root"),
            Operation::Exp => ("exp(x)", "e to the power x"),
            Operation::Log => ("log(x)", "natural logarithm"),
            Operation::Sin => ("sin(x)", "sine of an angle in rad"),
            Operation::Cos => ("cos(x)", "cosine of an angle in rad"),
            Operation::Tan => ("tan(x)", "tangent of an angle in rad"),
            Operation::Atan2 => ("atan2(y, x)", "angle of the point (x, y), rad, -π to π"),
            Operation::Tanh => ("tanh(x)", "hyperbolic tangent"),
            Operation::Min => ("min(a, b, …)", "the least"),
            Operation::Max => ("max(a, b, …)", "the greatest"),
            Operation::Sign => ("sign(x)", "-1, 0 or 1"),
            Operation::Hypot => ("hypot(a, b, …)", "root of the sum of squares"),
            Operation::Clamp => ("clamp(x, low, high)", "x held between two bounds; where they cross, high wins"),
            Operation::Negate
            | Operation::Add
            | Operation::Subtract
            | Operation::Multiply
            | Operation::Divide
            | Operation::Power => ("a op b", "arithmetic"),
            Operation::Less | Operation::LessOrEqual | Operation::Greater | Operation::GreaterOrEqual => ("a op b", "comparison"),
        },
        Function::History(history) => match history {
            History::Lag => ("lag(x, tau_s)", "first-order lag, tau y' = x - y, tau in s; may vary"),
            History::Delay => ("delay(x, s)", "x so many seconds ago, 0 to 60 s"),
            History::Rate => ("rate(x)", "change over the last step, per second"),
            History::Slew => ("slew(x, per_s)", "follows x, changing by at most so much per second"),
        },
    }
}

/// The name a function is printed with.
pub(super) fn function_name(function: Function) -> &'static str {
    FUNCTIONS.iter().find(|entry| entry.1 == function).map_or("?", |entry| entry.0)
}

/// How a binary operator is written and how tightly it binds, if `operation` is one.
pub(super) fn operator(operation: Operation) -> Option<(&'static str, u8)> {
    match operation {
        Operation::Less => Some(("<", binding::COMPARISON)),
        Operation::LessOrEqual => Some(("<=", binding::COMPARISON)),
        Operation::Greater => Some((">", binding::COMPARISON)),
        Operation::GreaterOrEqual => Some((">=", binding::COMPARISON)),
        Operation::Add => Some(("+", binding::SUM)),
        Operation::Subtract => Some(("-", binding::SUM)),
        Operation::Multiply => Some(("*", binding::PRODUCT)),
        Operation::Divide => Some(("/", binding::PRODUCT)),
        Operation::Power => Some(("^", binding::POWER)),
        _ => None,
    }
}

/// Binding strengths, loosest first. `-x^2` is `-(x^2)`, `a^b^c` is `a^(b^c)`, comparisons do not chain.
pub(super) mod binding {
    pub const COMPARISON: u8 = 1;
    pub const SUM: u8 = 3;
    pub const PRODUCT: u8 = 5;
    pub const NEGATE: u8 = 7;
    pub const POWER: u8 = 9;
    pub const ATOM: u8 = 11;
}

/// The function behind an operation, taken apart here once so that loops over samples know it while they are compiled.
macro_rules! with_unary {
    ($operation:expr, $f:ident => $body:expr) => {
        match $operation {
            Operation::Negate => {
                let $f = |x: f64| -x;
                $body
            }
            Operation::Abs => {
                let $f = f64::abs;
                $body
            }
            Operation::Sqrt => {
                let $f = f64::sqrt;
                $body
            }
            Operation::Exp => {
                let $f = f64::exp;
                $body
            }
            Operation::Log => {
                let $f = f64::ln;
                $body
            }
            Operation::Sin => {
                let $f = f64::sin;
                $body
            }
            Operation::Cos => {
                let $f = f64::cos;
                $body
            }
            Operation::Tan => {
                let $f = f64::tan;
                $body
            }
            Operation::Tanh => {
                let $f = f64::tanh;
                $body
            }
            Operation::Sign => {
                let $f = |x: f64| if x == 0.0 || x.is_nan() { x } else { x.signum() };
                $body
            }
            _ => unreachable!("an operation of two operands"),
        }
    };
}

macro_rules! with_binary {
    ($operation:expr, $f:ident => $body:expr) => {{
        let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
        match $operation {
            Operation::Add => {
                let $f = |x: f64, y: f64| x + y;
                $body
            }
            Operation::Subtract => {
                let $f = |x: f64, y: f64| x - y;
                $body
            }
            Operation::Multiply => {
                let $f = |x: f64, y: f64| x * y;
                $body
            }
            Operation::Divide => {
                let $f = |x: f64, y: f64| x / y;
                $body
            }
            Operation::Power => {
                let $f = f64::powf;
                $body
            }
            Operation::Less => {
                let $f = |x: f64, y: f64| truth(x < y);
                $body
            }
            Operation::LessOrEqual => {
                let $f = |x: f64, y: f64| truth(x <= y);
                $body
            }
            Operation::Greater => {
                let $f = |x: f64, y: f64| truth(x > y);
                $body
            }
            Operation::GreaterOrEqual => {
                let $f = |x: f64, y: f64| truth(x >= y);
                $body
            }
            Operation::Atan2 => {
                let $f = f64::atan2;
                $body
            }
            // Of zeros of both signs the first: `f64::min` leaves open which.
            Operation::Min => {
                let $f = |x: f64, y: f64| if x <= y || y.is_nan() { x } else { y };
                $body
            }
            Operation::Max => {
                let $f = |x: f64, y: f64| if x >= y || y.is_nan() { x } else { y };
                $body
            }
            Operation::Hypot => {
                let $f = f64::hypot;
                $body
            }
            _ => unreachable!("an operation of one operand, or one that was taken apart"),
        }
    }};
}

impl Operation {
    /// Of one number.
    pub(super) fn of_one(self, x: f64) -> f64 {
        with_unary!(self, f => f(x))
    }

    /// Of two numbers.
    pub(super) fn of_two(self, x: f64, y: f64) -> f64 {
        with_binary!(self, f => f(x, y))
    }

    /// Of one column.
    pub(super) fn of_column(self, isa: InstructionSet, x: &[f64], out: &mut [f64]) {
        with_unary!(self, f => columns::map(isa, f, x, out));
    }

    /// Of two columns.
    pub(super) fn of_columns(self, isa: InstructionSet, x: &[f64], y: &[f64], out: &mut [f64]) {
        with_binary!(self, f => columns::zip(isa, f, x, y, out));
    }
}

/// A whole power of a column, with the bits of [`f64::powi`]; those that are common vectorise.
pub(super) fn whole_power_of_column(isa: InstructionSet, exponent: i32, x: &[f64], out: &mut [f64]) {
    match exponent {
        2 => columns::map(isa, |x| x * x, x, out),
        3 => columns::map(isa, |x| x * (x * x), x, out),
        4 => columns::map(isa, |x| (x * x) * (x * x), x, out),
        -1 => columns::map(isa, |x| 1.0 / x, x, out),
        -2 => columns::map(isa, |x| 1.0 / (x * x), x, out),
        _ => columns::map(isa, |x| x.powi(exponent), x, out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    #[test]
    fn corner_cases_are_defined() {
        assert_eq!(Operation::Sign.of_one(-0.0), 0.0);
        assert_eq!(Operation::Sign.of_one(-3.0), -1.0);
        assert!(Operation::Sign.of_one(f64::NAN).is_nan());
        assert!((Operation::Hypot.of_two(3.0, 4.0) - 5.0).abs() < Tolerance::Close.relative_f64());
        assert_eq!(Operation::GreaterOrEqual.of_two(1.0, 1.0), 1.0);
        assert_eq!(Operation::Less.of_two(1.0, f64::NAN), 0.0);
    }

    #[test]
    fn columns_are_numbers_one_by_one() {
        let (x, y) = ([0.5, -2.0, 3.0], [2.0, 0.25, -1.0]);
        let mut out = [0.0; 3];
        for isa in InstructionSet::available() {
            Operation::Atan2.of_columns(isa, &x, &y, &mut out);
            assert_eq!(out, std::array::from_fn(|index| Operation::Atan2.of_two(x[index], y[index])));
            Operation::Tanh.of_column(isa, &x, &mut out);
            assert_eq!(out, x.map(f64::tanh));
            for exponent in -16..=16 {
                whole_power_of_column(isa, exponent, &x, &mut out);
                assert_eq!(out, x.map(|x| x.powi(exponent)), "{exponent}");
            }
        }
    }

    #[test]
    fn every_function_has_one_meaning_and_a_name() {
        for (index, (name, function, fewest, most)) in FUNCTIONS.iter().enumerate() {
            assert!(fewest <= most);
            assert!(FUNCTIONS.iter().skip(index + 1).all(|other| other.0 != *name));
            assert_ne!(function_name(*function), "?");
        }
    }
}
