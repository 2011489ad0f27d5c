//! A formula back to text, with no more brackets than it needs; parsing the text gives the same formula.

use super::lexer::{QUOTE, is_plain};
use super::operation::{Function, Operation, binding, function_name, operator};
use super::{Formula, Instruction};
use std::fmt;

impl fmt::Display for Formula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut stack: Vec<(String, u8)> = Vec::new();
        for (instruction, _) in &self.program {
            let printed = match instruction {
                Instruction::Number(number) => (number_text(*number), binding::ATOM),
                Instruction::Name(index) => (self.names.get(*index).map(|name| quoted(&name.0)).unwrap_or_default(), binding::ATOM),
                Instruction::Apply(Operation::Negate, _) => {
                    let operand = bracketed(stack.pop(), binding::NEGATE);
                    (format!("-{operand}"), binding::NEGATE)
                }
                Instruction::Apply(operation, count) => match operator(*operation) {
                    Some((symbol, strength)) => {
                        let (mut left_needs, mut right_needs) = (strength, strength + 1);
                        if *operation == Operation::Power {
                            // Right-associative; a sign may stand unbracketed in the exponent.
                            (left_needs, right_needs) = (strength + 1, binding::NEGATE);
                        } else if strength == binding::COMPARISON {
                            left_needs = strength + 1;
                        }
                        let right = bracketed(stack.pop(), right_needs);
                        let left = bracketed(stack.pop(), left_needs);
                        let gap = if *operation == Operation::Power { "" } else { " " };
                        (format!("{left}{gap}{symbol}{gap}{right}"), strength)
                    }
                    None => call(&mut stack, Function::Plain(*operation), *count),
                },
                Instruction::Recall(history) => call(&mut stack, Function::History(*history), history.operands()),
            };
            stack.push(printed);
        }
        f.write_str(&stack.pop().unwrap_or_default().0)
    }
}

/// A name as it stands in a formula: in quotes where it is not plain. One that holds a quote itself cannot stand in a formula.
pub(crate) fn quoted(name: &str) -> String {
    if is_plain(name) { name.to_owned() } else { format!("{QUOTE}{name}{QUOTE}") }
}

fn bracketed(operand: Option<(String, u8)>, needed: u8) -> String {
    let (text, strength) = operand.unwrap_or_default();
    if strength < needed { format!("({text})") } else { text }
}

fn call(stack: &mut Vec<(String, u8)>, function: Function, count: usize) -> (String, u8) {
    let arguments: Vec<String> = stack.drain(stack.len().saturating_sub(count)..).map(|argument| argument.0).collect();
    (format!("{}({})", function_name(function), arguments.join(", ")), binding::ATOM)
}

/// The shortest text that reads back as the same number, without a useless `.0`.
fn number_text(number: f64) -> String {
    let text = format!("{number:?}");
    text.strip_suffix(".0").map_or_else(|| text.clone(), str::to_owned)
}
