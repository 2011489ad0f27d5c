//! Tokens to a postfix program, by operator precedence (Pratt 1973). Postfix, because then nothing after this file recurses:
//! printing, evaluating and dropping a formula need no call stack, however long it is.

use super::lexer::{self, Token};
use super::operation::{FUNCTIONS, Function, Operation, binding};
use super::{Formula, Instruction};
use crate::error::{Error, Result};
use crate::suggest::did_you_mean;

/// Deepest nesting of brackets, calls, signs and powers.
const MAX_DEPTH: usize = 100;

/// How much longer than its text a formula may print: `9e15` is printed with its zeros, and operators with spaces around them.
const PRINTS_AT_MOST: usize = 8;

/// Parses a whole formula. What is accepted is accepted again as it prints: files hold formulas as printed.
pub(super) fn parse(text: &str) -> Result<Formula> {
    let characters = text.chars().count();
    let too_long = |message: String| {
        let head: String = text.chars().take(60).map(|c| if c.is_control() { ' ' } else { c }).collect();
        Err(Error::Formula { message, formula: format!("{head}…"), at: 0 })
    };
    if characters > lexer::MAX_CHARACTERS {
        return too_long(format!("{characters} characters, at most {} are allowed", lexer::MAX_CHARACTERS));
    }
    let formula = parse_text(text)?;
    if characters * PRINTS_AT_MOST > lexer::MAX_CHARACTERS {
        let printed = formula.to_string().chars().count();
        if printed > lexer::MAX_CHARACTERS {
            let most = lexer::MAX_CHARACTERS;
            return too_long(format!(
                "{printed} characters as it is written to files ({characters} here), at most {most} are allowed"
            ));
        }
    }
    Ok(formula)
}

fn parse_text(text: &str) -> Result<Formula> {
    // One space for each control or blank character: the caret of an error message stays under its place.
    let text: String = text.chars().map(|c| if c.is_whitespace() || c.is_control() { ' ' } else { c }).collect();
    let mut parser = Parser {
        tokens: lexer::tokens(&text)?,
        next: 0,
        end: text.trim_end().chars().count(),
        text: &text,
        program: Vec::new(),
        names: Vec::new(),
    };
    parser.expression(0, 0)?;
    if let Some((token, at)) = parser.tokens.get(parser.next) {
        return Err(parser.fault(format!("expected an operator or the end, found {}", describe(token)), *at));
    }
    let Parser { program, names, .. } = parser;
    Ok(Formula { program, names, text })
}

struct Parser<'a> {
    tokens: Vec<(Token, usize)>,
    next: usize,
    /// Where "the formula ends too early" points.
    end: usize,
    text: &'a str,
    program: Vec<(Instruction, usize)>,
    names: Vec<(String, usize)>,
}

impl Parser<'_> {
    fn fault(&self, message: impl Into<String>, at: usize) -> Error {
        Error::Formula { message: message.into(), formula: self.text.into(), at }
    }

    fn peek_symbol(&self) -> Option<&'static str> {
        match self.tokens.get(self.next) {
            Some((Token::Symbol(symbol), _)) => Some(symbol),
            _ => None,
        }
    }

    fn place(&self) -> usize {
        self.tokens.get(self.next).map_or(self.end, |token| token.1)
    }

    fn expect(&mut self, symbol: &str, context: &str) -> Result<()> {
        if self.peek_symbol() == Some(symbol) {
            self.next += 1;
            return Ok(());
        }
        let found = self.tokens.get(self.next).map_or("the end".into(), |(token, _)| describe(token));
        Err(self.fault(format!("expected `{symbol}` {context}, found {found}"), self.place()))
    }

    /// Parses operators that bind at least as tightly as `weakest`, and emits operands before operators.
    fn expression(&mut self, weakest: u8, depth: usize) -> Result<()> {
        if depth > MAX_DEPTH {
            return Err(self.fault(format!("nested more than {MAX_DEPTH} deep"), self.place()));
        }
        self.operand(depth)?;
        while let Some(symbol) = self.peek_symbol() {
            let Some((operation, left, right)) = infix(symbol) else { break };
            if left < weakest {
                break;
            }
            let at = self.place();
            self.next += 1;
            self.expression(right, depth + 1)?;
            self.program.push((Instruction::Apply(operation, 2), at));
            if left == binding::COMPARISON && self.peek_symbol().and_then(infix).is_some_and(|next| next.1 == left) {
                return Err(self.fault("comparisons do not chain; write `(a < b) * (b < c)`", self.place()));
            }
        }
        Ok(())
    }

    fn operand(&mut self, depth: usize) -> Result<()> {
        let Some((token, at)) = self.tokens.get(self.next).cloned() else {
            return Err(self.fault("expected a number, a column or `(`, found the end", self.end));
        };
        self.next += 1;
        match token {
            Token::Number(number) => self.program.push((Instruction::Number(number), at)),
            Token::Name(name) if self.peek_symbol() == Some("(") => self.call(&name, at, depth)?,
            Token::Name(name) | Token::Quoted(name) => {
                let index = self.names.iter().position(|known| known.0 == name).unwrap_or_else(|| {
                    self.names.push((name, at));
                    self.names.len() - 1
                });
                self.program.push((Instruction::Name(index), at));
            }
            Token::Symbol("(") => {
                self.expression(0, depth + 1)?;
                self.expect(")", "to close the bracket")?;
            }
            Token::Symbol("-") => {
                self.expression(binding::NEGATE, depth + 1)?;
                self.program.push((Instruction::Apply(Operation::Negate, 1), at));
            }
            token => return Err(self.fault(format!("expected a number, a column or `(`, found {}", describe(&token)), at)),
        }
        Ok(())
    }

    fn call(&mut self, name: &str, at: usize, depth: usize) -> Result<()> {
        let Some(&(_, function, fewest, most)) = FUNCTIONS.iter().find(|entry| entry.0 == name) else {
            let hint = did_you_mean(name, FUNCTIONS.iter().map(|entry| entry.0));
            return Err(self.fault(format!("unknown function `{name}`{hint}"), at));
        };
        self.expect("(", "after the function's name")?;
        let mut count = 0;
        if self.peek_symbol() != Some(")") {
            loop {
                self.expression(0, depth + 1)?;
                count += 1;
                if self.peek_symbol() != Some(",") {
                    break;
                }
                self.next += 1;
            }
        }
        self.expect(")", "to end the arguments")?;
        if count < fewest || count > most {
            let wanted = if most == usize::MAX { format!("{fewest} or more") } else { fewest.to_string() };
            return Err(
                self.fault(format!("`{name}` takes {wanted} argument{}, found {count}", if wanted == "1" { "" } else { "s" }), at)
            );
        }
        self.program.push((
            match function {
                Function::Plain(operation) => Instruction::Apply(operation, count),
                Function::History(history) => Instruction::Recall(history),
            },
            at,
        ));
        Ok(())
    }
}

/// Operation, left and right binding strength of an infix symbol.
fn infix(symbol: &str) -> Option<(Operation, u8, u8)> {
    let left_associative = |operation, strength| Some((operation, strength, strength + 1));
    match symbol {
        "<" => left_associative(Operation::Less, binding::COMPARISON),
        "<=" => left_associative(Operation::LessOrEqual, binding::COMPARISON),
        ">" => left_associative(Operation::Greater, binding::COMPARISON),
        ">=" => left_associative(Operation::GreaterOrEqual, binding::COMPARISON),
        "+" => left_associative(Operation::Add, binding::SUM),
        "-" => left_associative(Operation::Subtract, binding::SUM),
        "*" => left_associative(Operation::Multiply, binding::PRODUCT),
        "/" => left_associative(Operation::Divide, binding::PRODUCT),
        "^" => Some((Operation::Power, binding::POWER, binding::POWER)),
        _ => None,
    }
}

fn describe(token: &Token) -> String {
    match token {
        Token::Number(number) => format!("`{number}`"),
        Token::Name(name) | Token::Quoted(name) => format!("`{name}`"),
        Token::Symbol(symbol) => format!("`{symbol}`"),
    }
}
