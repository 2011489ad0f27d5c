//! Colour on a terminal: warnings, verdicts and best values stand out. Bold, dim, yellow and blue alone, which every kind of colour
//! vision tells apart, and never without the word or mark that says the same. Which stream is a terminal is asked here, once a text.

use std::io::IsTerminal;

const BOLD: &str = "\u{1b}[1m";
const DIM: &str = "\u{1b}[2m";
const WARNING: &str = "\u{1b}[1;33m";
const BEST: &str = "\u{1b}[1;34m";
const PLAIN: &str = "\u{1b}[0m";

/// Whether colour is wanted on a stream: a terminal, `NO_COLOR` not set, and not one that says it is dumb.
fn wanted(is_terminal: bool, no_color: Option<&str>, term: Option<&str>) -> bool {
    is_terminal && no_color.is_none_or(str::is_empty) && term != Some("dumb")
}

fn in_colour(is_terminal: bool) -> bool {
    let [no_color, term] = ["NO_COLOR", "TERM"].map(|name| std::env::var(name).ok());
    wanted(is_terminal, no_color.as_deref(), term.as_deref())
}

/// Text for standard output.
pub fn for_output(text: &str) -> String {
    dressed(text, in_colour(std::io::stdout().is_terminal()))
}

/// Text for standard error.
pub fn for_error(text: &str) -> String {
    dressed(text, in_colour(std::io::stderr().is_terminal()))
}

/// Names come from files: what a terminal would obey is shown instead.
fn harmless(text: &str) -> String {
    let obeyed = |c: char| c.is_control() && c != '\n' && c != '\t';
    if !text.contains(obeyed) {
        return text.to_owned();
    }
    text.chars().map(|c| if obeyed(c) { c.escape_unicode().to_string() } else { c.to_string() }).collect()
}

fn dressed(text: &str, colour: bool) -> String {
    let text = harmless(text);
    if !colour {
        return text;
    }
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

fn line(line: &str) -> String {
    let start = line.trim_start();
    if ["CAUTION", "warning:", "Beware"].iter().any(|word| start.starts_with(word)) || line.contains("WRONG SIGN") {
        return format!("{WARNING}{line}{PLAIN}");
    }
    if start.starts_with("note:") {
        return format!("{DIM}{line}{PLAIN}");
    }
    if let Some(label) = ["Verdict:", "Unknown:", "error:"].into_iter().find(|label| line.starts_with(label)) {
        return format!("{BOLD}{label}{PLAIN}{}", &line[label.len()..]);
    }
    if line.starts_with("Round ") {
        return format!("{BOLD}{line}{PLAIN}");
    }
    starred(line)
}

/// Numbers with a star behind them.
fn starred(line: &str) -> String {
    let is_best = |word: &str| word.strip_suffix('*').is_some_and(|number| number.parse::<f64>().is_ok());
    let words: Vec<String> =
        line.split(' ').map(|word| if is_best(word) { format!("{BEST}{word}{PLAIN}") } else { word.to_owned() }).collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_is_for_terminals_that_want_it() {
        assert!(wanted(true, None, Some("xterm")) && wanted(true, Some(""), None));
        assert!(!wanted(false, None, Some("xterm")), "a pipe gets none");
        assert!(!wanted(true, Some("1"), Some("xterm")) && !wanted(true, None, Some("dumb")));
    }

    #[test]
    fn colour_adds_nothing_but_itself() {
        let text = "Verdict: explained.\n  note: small\nwarning: assumed\n  model  0.30*   0.4\nplain";
        assert_eq!(dressed(text, false), text);
        let colour = dressed(text, true);
        assert!(
            colour.contains("\u{1b}[1mVerdict:\u{1b}[0m explained.") && colour.contains("\u{1b}[1;34m0.30*\u{1b}[0m"),
            "{colour:?}"
        );
        let mut bare = colour;
        for code in [BOLD, DIM, WARNING, BEST, PLAIN] {
            bare = bare.replace(code, "");
        }
        assert_eq!(bare, text);
    }

    #[test]
    fn a_name_cannot_command_the_terminal() {
        assert_eq!(dressed("flight \u{1b}[2Jx\r\n\tok", false), "flight \\u{1b}[2Jx\\u{d}\n\tok");
    }
}
