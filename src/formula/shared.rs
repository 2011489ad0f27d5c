//! Formulas for people: long parts that stand in several places are said once, under a name. Nothing is evaluated from these.

use super::{Formula, Instruction};
use std::collections::BTreeMap;
use std::ops::Range;

/// Shortest text of a part that is worth a name.
const SHORTEST: usize = 40;

/// What parts are called, the first that no formula uses.
const NAMES: [&str; 6] = ["s", "q", "m", "a", "b", "c"];

/// Formulas in which long repeated parts are names.
#[derive(Clone, Debug, PartialEq)]
pub struct Shared {
    /// In the order in which they were given.
    pub formulas: Vec<Formula>,
    /// The parts by name, each before those that it is made of.
    pub parts: Vec<(String, Formula)>,
}

/// Names long parts that stand in several places, the longest first.
///
/// ```
/// use phyture::formula::{Formula, shared};
/// let part = "abs(thrust / 9.80665)^1.5 + lag(air_vz, tau_s)";
/// let given = [Formula::parse(&format!("k * ({part})"))?, Formula::parse(&format!("sqrt({part})"))?];
/// let found = shared(&given);
/// assert_eq!(found.formulas[0].to_string(), "k * s");
/// assert_eq!((found.parts[0].0.as_str(), found.parts[0].1.to_string()), ("s", part.to_owned()));
/// # Ok::<(), phyture::Error>(())
/// ```
pub fn shared(formulas: &[Formula]) -> Shared {
    let mut all = formulas.to_vec();
    let mut parts = Vec::new();
    let is_free = |name: &&&str| !formulas.iter().any(|formula| formula.names().contains(*name));
    for name in NAMES.iter().filter(is_free) {
        let Some(text) = longest(&all) else { break };
        let part = all.iter().find_map(|formula| formula.part(formula.ranges_of(&text).next()?)).expect("it stands somewhere");
        all.iter_mut().for_each(|formula| *formula = formula.with_name(&text, name));
        all.push(part);
        parts.push((*name).to_owned());
    }
    let found = all.split_off(formulas.len());
    Shared { formulas: all, parts: parts.into_iter().zip(found).collect() }
}

/// The longest part that stands in several places.
fn longest(formulas: &[Formula]) -> Option<String> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for formula in formulas {
        // A whole formula is no part of itself.
        for range in formula.ranges().filter(|range| range.len() < formula.program.len()) {
            let text = formula.part(range).map_or_else(String::new, |part| part.to_string());
            if text.len() >= SHORTEST {
                *counts.entry(text).or_default() += 1;
            }
        }
    }
    counts.into_iter().filter(|(_, count)| *count > 1).map(|(text, _)| text).max_by_key(String::len)
}

impl Formula {
    /// The instructions of every part: each operation with its operands.
    fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let mut starts: Vec<usize> = Vec::new();
        let one = |(place, (instruction, _)): (usize, &(Instruction, usize))| {
            let operands = match instruction {
                Instruction::Number(_) | Instruction::Name(_) => 0,
                Instruction::Apply(_, count) => *count,
                Instruction::Recall(history) => history.operands(),
            };
            let start = starts.drain(starts.len().saturating_sub(operands)..).next().unwrap_or(place);
            starts.push(start);
            start..place + 1
        };
        self.program.iter().enumerate().map(one).collect::<Vec<_>>().into_iter()
    }

    fn ranges_of(&self, text: &str) -> impl Iterator<Item = Range<usize>> {
        self.ranges().filter(move |range| {
            range.len() < self.program.len() && self.part(range.clone()).is_some_and(|part| part.to_string() == text)
        })
    }

    /// A part as a formula of its own.
    fn part(&self, range: Range<usize>) -> Option<Self> {
        let program = self.program.get(range)?.to_vec();
        Some(Self { program, names: self.names.clone(), text: String::new() }.tidied())
    }

    /// The same with a name in the place of each part that prints as `text`.
    fn with_name(&self, text: &str, name: &str) -> Self {
        let (mut names, mut program, mut next) = (self.names.clone(), Vec::new(), 0);
        names.push((name.to_owned(), 0));
        for range in self.ranges_of(text) {
            program.extend_from_slice(&self.program[next..range.start]);
            program.push((Instruction::Name(names.len() - 1), 0));
            next = range.end;
        }
        program.extend_from_slice(&self.program[next..]);
        Self { program, names, text: String::new() }.tidied()
    }

    /// With the names that it uses, in order of first appearance, and its text.
    fn tidied(mut self) -> Self {
        let old = std::mem::take(&mut self.names);
        for (instruction, _) in &mut self.program {
            let Instruction::Name(index) = instruction else { continue };
            let name = old[*index].clone();
            *index = self.names.iter().position(|known| known.0 == name.0).unwrap_or_else(|| {
                self.names.push(name);
                self.names.len() - 1
            });
        }
        self.text = self.to_string();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::long_formulas;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parts_within_parts_are_named_too_and_short_ones_are_not() -> crate::error::Result<()> {
        let inner = "exp(vx) + exp(vy) * exp(vz) / (1 + s^2) - 12";
        let outer = format!("max(lag({inner}, 0.3), {inner}) + rate(height)");
        let texts = [format!("vx * ({outer})"), format!("abs({outer})"), format!("{inner} + vx^2 + vy * vx^2")];
        let given: Vec<Formula> = texts.iter().map(|text| Formula::parse(text)).collect::<crate::error::Result<_>>()?;
        let found = shared(&given);
        let printed: Vec<String> = found.formulas.iter().map(Formula::to_string).collect();
        // `s` is taken.
        assert_eq!(printed, ["vx * q", "abs(q)", "m + vx^2 + vy * vx^2"]);
        let parts: Vec<String> = found.parts.iter().map(|(name, part)| format!("{name} = {part}")).collect();
        assert_eq!(parts, ["q = max(lag(m, 0.3), m) + rate(height)".to_owned(), format!("m = {inner}")]);
        Ok(())
    }

    proptest! {
        #[test]
        fn names_put_back_give_the_same_formulas(texts in prop::collection::vec(long_formulas(), 1..4)) {
            let given: Vec<Formula> = texts.iter().filter_map(|text| Formula::parse(text).ok()).collect();
            // Each also inside another, so that there is something to share.
            let around = given.iter().filter_map(|formula| Formula::parse(&format!("1 + abs({formula})")).ok());
            let doubled: Vec<Formula> = given.iter().cloned().chain(around).collect();
            let mut found = shared(&doubled);
            for (name, part) in &found.parts {
                for formula in &mut found.formulas {
                    *formula = formula.substitute(&|of| (of == name).then(|| part.clone())).expect("as long as before");
                }
            }
            let texts = |formulas: &[Formula]| formulas.iter().map(Formula::to_string).collect::<Vec<_>>();
            prop_assert_eq!(texts(&found.formulas), texts(&doubled));
        }
    }
}
