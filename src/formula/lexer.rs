//! Text to tokens, each with the character it starts at. Knows no grammar beyond single words.

use crate::error::{Error, Result};

/// One word of a formula.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Name(String),
    /// A name in quotes, which is never a function's.
    Quoted(String),
    /// One of `+ - * / ^ ( ) , < <= > >=`.
    Symbol(&'static str),
}

/// What a name stands in that holds other characters than a plain one.
pub(super) const QUOTE: char = '\'';

/// Whether a name needs no quotes: a letter or "_", then letters, digits and "_".
pub(super) fn is_plain(name: &str) -> bool {
    let mut characters = name.chars();
    characters.next().is_some_and(|first| first.is_alphabetic() || first == '_')
        && characters.all(|character| character.is_alphanumeric() || character == '_')
}

/// Longer formulas are refused: nobody writes them, and every later step is bounded by this.
pub(super) const MAX_CHARACTERS: usize = 4096;

/// Symbols, longer ones before their beginnings.
const SYMBOLS: [&str; 12] = ["<=", ">=", "<", ">", "+", "-", "*", "/", "^", "(", ")", ","];

/// Cuts `text` into tokens.
pub(super) fn tokens(text: &str) -> Result<Vec<(Token, usize)>> {
    let characters: Vec<char> = text.chars().collect();
    let fault = |message: String, at: usize| Error::Formula { message, formula: text.into(), at };
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(&character) = characters.get(at) {
        let start = at;
        let run = |from: usize, belongs: &dyn Fn(char) -> bool| {
            from + characters.iter().skip(from).take_while(|&&character| belongs(character)).count()
        };
        let starts_with =
            |symbol: &str| symbol.chars().enumerate().all(|(offset, wanted)| characters.get(start + offset) == Some(&wanted));
        if character.is_whitespace() {
            at += 1;
        } else if character.is_ascii_digit() || character == '.' {
            at = run(at, &|c| c.is_ascii_digit());
            if characters.get(at) == Some(&'.') {
                at = run(at + 1, &|c| c.is_ascii_digit());
            }
            if matches!(characters.get(at), Some('e' | 'E')) {
                let sign = usize::from(matches!(characters.get(at + 1), Some('+' | '-')));
                let end = run(at + 1 + sign, &|c| c.is_ascii_digit());
                if end > at + 1 + sign {
                    at = end;
                }
            }
            // `2x` or `1e`: a number that runs into a word is a slip, not a product.
            at = run(at, &|c| c.is_alphanumeric() || c == '_' || c == '.');
            let word: String = characters.iter().skip(start).take(at - start).collect();
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => tokens.push((Token::Number(number), start)),
                Ok(_) => return Err(fault(format!("number `{word}` is too large"), start)),
                Err(_) => return Err(fault(format!("`{word}` is not a number; write products with `*`"), start)),
            }
        } else if character.is_alphabetic() || character == '_' {
            at = run(at, &|c| c.is_alphanumeric() || c == '_');
            tokens.push((Token::Name(characters.iter().skip(start).take(at - start).collect()), start));
        } else if character == QUOTE {
            let end = run(at + 1, &|c| c != QUOTE);
            let name: String = characters.iter().skip(at + 1).take(end - at - 1).collect();
            if end >= characters.len() {
                return Err(fault(format!("the quote is not closed; a name in quotes ends in {QUOTE}"), start));
            }
            if name.is_empty() {
                return Err(fault("a name without a character".into(), start));
            }
            at = end + 1;
            tokens.push((Token::Quoted(name), start));
        } else if let Some(symbol) = SYMBOLS.into_iter().find(|symbol| starts_with(symbol)) {
            at += symbol.len();
            tokens.push((Token::Symbol(symbol), start));
        } else {
            let hint = match character {
                '=' | '!' => "; comparisons are `<`, `<=`, `>`, `>=`",
                '&' | '|' => "; join conditions with `*` (and) or `max` (or)",
                '[' | ']' | '{' | '}' => "; group with `(` and `)`, and put a column's name in quotes: 'q[0]'",
                '"' | '`' => "; a name with other characters than letters, digits and `_` stands in single quotes: 'q[0]'",
                _ => "",
            };
            return Err(fault(format!("unexpected character `{character}`{hint}"), start));
        }
    }
    Ok(tokens)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_names_and_symbols() -> Result<()> {
        let found = tokens("-1.5e-3*m1 >= .5")?;
        let expected = [
            (Token::Symbol("-"), 0),
            (Token::Number(1.5e-3), 1),
            (Token::Symbol("*"), 7),
            (Token::Name("m1".into()), 8),
            (Token::Symbol(">="), 11),
            (Token::Number(0.5), 14),
        ];
        assert_eq!(found, expected);
        Ok(())
    }

    #[test]
    fn slips_are_named_where_they_stand() {
        for (text, place, part) in [
            ("vx * 2y", 5, "`2y` is not a number"),
            ("1e999", 0, "too large"),
            ("a == b", 2, "comparisons"),
            ("1.2.3", 0, "not a number"),
            ("2 * 'q[0]", 4, "not closed"),
            ("''", 0, "without a character"),
            ("q[0]", 1, "in quotes"),
        ] {
            match tokens(text) {
                Err(Error::Formula { message, at, .. }) => {
                    assert!(message.contains(part) && at == place, "{text}: {message} at {at}")
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
