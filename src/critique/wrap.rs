//! Text for a terminal: lines of at most 120 characters, broken at blanks. No meaning here, and no colour.

/// Widest line of text that is printed.
pub const WIDTH: usize = 120;

/// Breaks `text` at blanks so that no line is wider than [`WIDTH`]; the first line begins with `first`, the others with as many
/// blanks. A word that is wider stays whole.
pub fn wrapped(first: &str, text: &str) -> String {
    let wide = |text: &str| text.chars().count();
    let indent = " ".repeat(wide(first));
    let mut lines: Vec<String> = Vec::new();
    let mut line = first.to_owned();
    let mut empty = true;
    for word in text.split_whitespace() {
        if !empty && wide(&line) + 1 + wide(word) > WIDTH {
            lines.push(std::mem::replace(&mut line, indent.clone()));
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line.push_str(word);
        empty = false;
    }
    lines.push(line);
    lines.join("\n")
}

/// A name of at most `most` characters; of a longer one the beginning and the end, where names differ, with an ellipsis between.
pub fn clipped(name: &str, most: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= most {
        return name.to_owned();
    }
    let kept = most.saturating_sub(1);
    let (head, tail) = (kept - kept / 2, kept / 2);
    let end = &letters[letters.len() - tail..];
    letters[..head].iter().chain(['…'].iter()).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_indent_is_kept_and_long_words_stay_whole() {
        let long = "x".repeat(150);
        let text = wrapped("note: ", &format!("a b {long} c"));
        assert_eq!(text, format!("note: a b\n      {long}\n      c"));
        assert_eq!(wrapped("  ", ""), "  ");
        assert_eq!((clipped("short", 8), clipped("much too long", 8)), ("short".to_owned(), "much…ong".to_owned()));
    }

    proptest! {
        #[test]
        fn no_line_is_too_wide_and_no_word_is_lost(words in prop::collection::vec("[a-zäµ]{1,30}", 0..80), indent in 0..20_usize) {
            let text = wrapped(&" ".repeat(indent), &words.join(" "));
            prop_assert!(text.lines().all(|line| line.chars().count() <= WIDTH));
            prop_assert_eq!(text.split_whitespace().collect::<Vec<_>>(), words);
        }
    }
}
