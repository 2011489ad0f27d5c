//! The words of the grammar: operators and functions, their names, argument counts and what they compute. No parsing here.

/// An operation without memory: its result depends on this sample's operands alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// An operation that remembers earlier samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
            History::Lag => ("lag(x, tau_s)", "first-order lag, tau y' = x - y, tau in s"),
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

impl Operation {
    /// Computes in place: `stack` holds `operands` runs of `samples` values; the result replaces the first run.
    pub(super) fn apply(self, operands: usize, samples: usize, stack: &mut [f64]) {
        let (first, rest) = stack.split_at_mut(samples.min(stack.len()));
        let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
        match self {
            Self::Negate => one(first, |x| -x),
            Self::Add => two(first, rest, |x, y| x + y),
            Self::Subtract => two(first, rest, |x, y| x - y),
            Self::Multiply => two(first, rest, |x, y| x * y),
            Self::Divide => two(first, rest, |x, y| x / y),
            Self::Power => two(first, rest, f64::powf),
            Self::Less => two(first, rest, |x, y| truth(x < y)),
            Self::LessOrEqual => two(first, rest, |x, y| truth(x <= y)),
            Self::Greater => two(first, rest, |x, y| truth(x > y)),
            Self::GreaterOrEqual => two(first, rest, |x, y| truth(x >= y)),
            Self::Abs => one(first, f64::abs),
            Self::Sqrt => one(first, f64::sqrt),
            Self::Exp => one(first, f64::exp),
            Self::Log => one(first, f64::ln),
            Self::Sin => one(first, f64::sin),
            Self::Cos => one(first, f64::cos),
            Self::Tan => one(first, f64::tan),
            Self::Tanh => one(first, f64::tanh),
            Self::Sign => one(first, |x| if x == 0.0 || x.is_nan() { x } else { x.signum() }),
            Self::Atan2 => two(first, rest, f64::atan2),
            Self::Min => many(first, rest, operands, f64::min),
            Self::Max => many(first, rest, operands, f64::max),
            Self::Hypot => many(first, rest, operands, f64::hypot),
            Self::Clamp => {
                // Not `f64::clamp`, which panics when the bounds cross; here the upper bound wins.
                let (low, high) = rest.split_at(samples.min(rest.len()));
                two(first, low, f64::max);
                two(first, high, f64::min);
            }
        }
    }
}

fn one(values: &mut [f64], f: impl Fn(f64) -> f64) {
    for value in values {
        *value = f(*value);
    }
}

fn two(left: &mut [f64], right: &[f64], f: impl Fn(f64, f64) -> f64) {
    for (value, &other) in left.iter_mut().zip(right) {
        *value = f(*value, other);
    }
}

fn many(first: &mut [f64], rest: &[f64], operands: usize, f: impl Fn(f64, f64) -> f64) {
    let samples = first.len().max(1);
    for other in rest.chunks_exact(samples).take(operands.saturating_sub(1)) {
        two(first, other, &f);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;

    fn value(operation: Operation, operands: &[f64]) -> f64 {
        let mut stack = operands.to_vec();
        operation.apply(operands.len(), 1, &mut stack);
        stack[0]
    }

    #[test]
    fn corner_cases_are_defined() {
        assert_eq!(value(Operation::Sign, &[-0.0]), 0.0);
        assert_eq!(value(Operation::Sign, &[-3.0]), -1.0);
        assert!(value(Operation::Sign, &[f64::NAN]).is_nan());
        assert_eq!(value(Operation::Clamp, &[5.0, 0.0, 1.0]), 1.0);
        assert_eq!(value(Operation::Clamp, &[5.0, 2.0, 1.0]), 1.0);
        assert_eq!(value(Operation::Min, &[3.0, 2.0, 7.0]), 2.0);
        assert!((value(Operation::Hypot, &[2.0, 3.0, 6.0]) - 7.0).abs() < Tolerance::Close.relative_f64());
        assert_eq!(value(Operation::GreaterOrEqual, &[1.0, 1.0]), 1.0);
        assert_eq!(value(Operation::Less, &[1.0, f64::NAN]), 0.0);
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
