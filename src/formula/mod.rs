//! Formulas of a closed grammar: parsed, printed, evaluated on whole columns or one sample at a time. No code runs, and nothing
//! here knows what a flight or a model is: names are resolved by the caller.
//!
//! | form | meaning |
//! | --- | --- |
//! | `1.5e-3`, `vx`, `( … )` | number, column or parameter, bracket |
//! | `a + b`, `a - b`, `a * b`, `a / b`, `a^b`, `-a` | arithmetic; `-a^2` is `-(a^2)`, `a^b^c` is `a^(b^c)` |
//! | `a < b`, `a <= b`, `a > b`, `a >= b` | 1 where it holds, else 0; loosest of all; do not chain. Join with `*` (and), `max` (or) |
//! | `abs sqrt exp log sin cos tan tanh sign` | one argument; `log` is natural, `sign(0)` is 0 |
//! | `atan2(y, x)`, `clamp(x, low, high)` | rad; where the bounds cross, `high` wins |
//! | `min max hypot` | two or more arguments |
//! | `lag(x, tau_s)` | first-order lag `tau y' = x - y`, exact for a signal that is straight between samples |
//! | `delay(x, s)` | `x` so many seconds ago, linear between samples; 0 to 60 s |
//! | `rate(x)` | backward difference over one step, per second: causal, hence half a step late |
//! | `slew(x, per_s)` | follows `x`, changing by at most so much per second: a servo at its largest speed |
//!
//! The last four remember. Before the first sample their argument is taken to have rested at its first value. The second
//! arguments of `delay` and `slew` are numbers or parameters, never columns; the time constant of a `lag` may vary from step to step, and where it
//! is not above 0 nothing lags.

#[cfg(feature = "files")]
mod c_helpers;
#[cfg(feature = "files")]
pub(crate) mod c_text;
mod derivative;
mod graph;
mod lanes;
mod lexer;
mod machine;
mod memory;
mod operation;
mod parser;
mod print;
mod shared;

pub use graph::{Graph, Node};
pub use lanes::{Lanes, Remembered};
pub use machine::{Machine, StreamingFormula};
#[cfg(feature = "files")]
pub(crate) use print::quoted;
pub use shared::{Shared, shared};

use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use operation::{History, Operation};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// How each function of the grammar is called, and what it gives.
pub fn functions() -> impl Iterator<Item = (&'static str, &'static str)> {
    operation::FUNCTIONS.iter().map(|(_, function, ..)| operation::described(*function))
}

/// A parsed formula. Prints back with the fewest brackets, and is stored as that text.
///
/// # Examples
/// ```
/// use phyture::formula::Formula;
///
/// let formula = Formula::parse("vx * (abs(vx)) + lag(u1, 0.1)")?;
/// assert_eq!(formula.to_string(), "vx * abs(vx) + lag(u1, 0.1)");
/// assert_eq!(formula.names(), ["vx", "u1"]);
/// let error = Formula::parse("vx * abs(vx").unwrap_err();
/// println!("{error}");
/// # Ok::<(), phyture::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Formula {
    /// Postfix: operands before their operation, each with the character it stands at.
    program: Vec<(Instruction, usize)>,
    /// Names in order of first appearance, with the character of that appearance.
    names: Vec<(String, usize)>,
    /// As written, for error messages.
    text: String,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Instruction {
    Number(f64),
    Name(usize),
    Apply(Operation, usize),
    Recall(History),
}

/// What a name stands for when a formula is evaluated.
#[derive(Clone, Debug)]
pub enum Value<'a> {
    /// A parameter.
    Constant(f64),
    /// One number a sample.
    Column(Cow<'a, [f64]>),
}

impl From<f64> for Value<'_> {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl<'a> From<&'a [f64]> for Value<'a> {
    fn from(column: &'a [f64]) -> Self {
        Self::Column(Cow::Borrowed(column))
    }
}

impl<'a> From<&'a Vec<f64>> for Value<'a> {
    fn from(column: &'a Vec<f64>) -> Self {
        Self::Column(Cow::Borrowed(column))
    }
}

impl From<Vec<f64>> for Value<'_> {
    fn from(column: Vec<f64>) -> Self {
        Self::Column(Cow::Owned(column))
    }
}

impl Formula {
    /// Parses a formula; any text is either a formula or an error.
    ///
    /// # Errors
    /// [`Error::Formula`] that points at the character.
    pub fn parse(text: &str) -> Result<Self> {
        parser::parse(text)
    }

    /// The columns and parameters it needs, each once, in order of appearance.
    pub fn names(&self) -> Vec<&str> {
        self.names.iter().map(|name| name.0.as_str()).collect()
    }

    /// The columns and parameters that stand somewhere outside the argument of a `rate`, each once: those whose values, not whose changes,
    /// the formula is made of.
    pub fn names_outside_rates(&self) -> Vec<&str> {
        // One entry an operand on the stack: the names in it.
        let mut stack: Vec<BTreeSet<usize>> = Vec::new();
        for (instruction, _) in &self.program {
            let operands = match instruction {
                Instruction::Number(_) | Instruction::Name(_) => 0,
                Instruction::Apply(_, count) => *count,
                Instruction::Recall(history) => history.operands(),
            };
            let mut names: BTreeSet<usize> = stack.drain(stack.len().saturating_sub(operands)..).flatten().collect();
            match instruction {
                Instruction::Name(index) => {
                    names.insert(*index);
                }
                Instruction::Recall(History::Rate) => names.clear(),
                _ => {}
            }
            stack.push(names);
        }
        let left = stack.pop().unwrap_or_default();
        self.names.iter().enumerate().filter(|(index, _)| left.contains(index)).map(|(_, name)| name.0.as_str()).collect()
    }

    /// An error that points at the first name for which `reason` has a text against it.
    pub fn refused_name(&self, reason: &dyn Fn(&str) -> Option<String>) -> Option<Error> {
        self.names.iter().find_map(|(name, at)| {
            let reason = reason(name)?;
            Some(Error::Formula { message: format!("`{name}` cannot be read here: {reason}"), formula: self.text.clone(), at: *at })
        })
    }

    /// Whether it contains `lag`, `delay`, `rate` or `slew`: then its value depends on earlier samples.
    pub fn remembers(&self) -> bool {
        self.program.iter().any(|(instruction, _)| matches!(instruction, Instruction::Recall(_)))
    }

    /// An error pointing at the first name that is not known, if there is one.
    pub fn unknown_name(&self, known: &dyn Fn(&str) -> bool) -> Option<Error> {
        self.names.iter().find(|(name, _)| !known(name)).map(|(name, at)| self.unknown(name, *at, ""))
    }

    /// Refuses names that are not in `known`, suggesting the nearest one.
    ///
    /// # Errors
    /// [`Error::Formula`] pointing at the first unknown name.
    pub fn check_names(&self, known: &[&str]) -> Result<()> {
        match self.names.iter().find(|(name, _)| !known.contains(&name.as_str())) {
            Some((name, at)) => Err(self.unknown(name, *at, &did_you_mean(name, known.iter().copied()))),
            None => Ok(()),
        }
    }

    /// The formula with names replaced by formulas, all at once: `vz * u4` with `u4` → `lag(u4, tau_s)` is `vz * lag(u4, tau_s)`.
    ///
    /// # Errors
    /// [`Error::Formula`] if the result is longer or more deeply nested than a formula may be.
    pub fn substitute(&self, replacement: &dyn Fn(&str) -> Option<Self>) -> Result<Self> {
        let replacements: Vec<Option<Self>> = self.names.iter().map(|(name, _)| replacement(name)).collect();
        if replacements.iter().all(Option::is_none) {
            return Ok(self.clone());
        }
        let mut result = Self { program: Vec::new(), names: Vec::new(), text: String::new() };
        for (instruction, _) in &self.program {
            let single = [(*instruction, 0)];
            let (program, names) = match instruction {
                Instruction::Name(index) => match replacements.get(*index) {
                    Some(Some(formula)) => (formula.program.as_slice(), &formula.names),
                    _ => (single.as_slice(), &self.names),
                },
                _ => (single.as_slice(), &self.names),
            };
            for &(instruction, at) in program {
                let Instruction::Name(index) = instruction else {
                    result.program.push((instruction, at));
                    continue;
                };
                let Some((name, _)) = names.get(index) else { continue };
                let known = result.names.iter().position(|known| known.0 == *name);
                let index = known.unwrap_or_else(|| {
                    result.names.push((name.clone(), 0));
                    result.names.len() - 1
                });
                result.program.push((Instruction::Name(index), 0));
            }
        }
        // Parsed anew for the limits and for places to point at.
        Self::parse(&result.to_string())
    }

    fn unknown(&self, name: &str, at: usize, hint: &str) -> Error {
        let hint =
            if hint.is_empty() { did_you_mean(name, operation::FUNCTIONS.iter().map(|entry| entry.0)) } else { hint.to_owned() };
        Error::Formula { message: format!("unknown name `{name}`{hint}"), formula: self.text.clone(), at }
    }
}

/// Equal if they compute the same in the same order; spacing and needless brackets do not count.
impl PartialEq for Formula {
    fn eq(&self, other: &Self) -> bool {
        let words = |formula: &Self| formula.program.iter().map(|step| step.0).collect::<Vec<_>>();
        self.names() == other.names() && words(self) == words(other)
    }
}

impl std::str::FromStr for Formula {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text)
    }
}

impl serde::Serialize for Formula {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for Formula {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let text = <String as serde::Deserialize>::deserialize(deserializer)?;
        Self::parse(&text).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests;
