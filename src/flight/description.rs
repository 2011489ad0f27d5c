//! The text of a `dataset.toml` while lines are added to it: what stands there stays as it is, with its order and its comments. What the lines mean
//! is `schema`'s, which of them to add is the caller's.
//!
//! Every change is read back: if the text then holds anything but what it held and the line, as where it is written in an unusual form, it is not made.

use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

/// A description, which is TOML.
#[derive(Clone, Debug)]
pub(crate) struct Description {
    text: String,
    table: Table,
}

impl Description {
    /// `None` for a text that is not TOML.
    pub fn parse(text: &str) -> Option<Self> {
        Some(Self { text: text.into(), table: text.parse().ok()? })
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The value of a key of a section; the section of the keys before all sections is "".
    pub fn get(&self, section: &str, key: &str) -> Option<&Value> {
        if section.is_empty() { self.table.get(key) } else { self.table.get(section)?.get(key) }
    }

    /// The description with this value for a key, below a comment of whole lines. `None` if it is written in a form that is not changed here.
    pub fn with(&self, section: &str, key: &str, value: &Value, comment: &str) -> Option<Self> {
        let mut table = self.table.clone();
        let place = if section.is_empty() {
            Some(&mut table)
        } else {
            table.entry(section).or_insert_with(|| Value::Table(Table::new())).as_table_mut()
        };
        place?.insert(key.into(), value.clone());
        let spans = DeTable::parse(&self.text).ok()?;
        let root = spans.get_ref();
        let inside = if section.is_empty() { Some(root) } else { root.get(section).and_then(|value| value.get_ref().as_table()) };
        let new = format!("{key} = {value}");
        let text = match inside.map(|inside| (inside, inside.get_key_value(key))) {
            Some((_, Some((name, old)))) => self.replaced(&name.span(), old, value, comment),
            Some((_, None)) if section.is_empty() => self.before_sections(root, &format!("{comment}{new}\n")),
            Some((inside, None)) => {
                let (name, _) = root.get_key_value(section)?;
                self.inserted(inside, &name.span(), &new, comment)
            }
            None => self.at_end(&format!("{comment}[{section}]\n{new}\n")),
        };
        Self::parse(&text).filter(|made| made.table == table)
    }

    /// The description with a section that it does not have, as [`Description::with`].
    pub fn with_section(&self, section: &str, keys: &Table) -> Option<Self> {
        let mut table = self.table.clone();
        table.insert(section.into(), Value::Table(keys.clone()));
        let lines: String = keys.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        Self::parse(&self.at_end(&format!("[{section}]\n{lines}"))).filter(|made| made.table == table)
    }

    /// The description with one more rule `[[section]]`, as [`Description::with`].
    pub fn with_rule(&self, section: &str, rule: &Table, comment: &str) -> Option<Self> {
        let mut table = self.table.clone();
        let rules = table.entry(section).or_insert_with(|| Value::Array(Vec::new())).as_array_mut()?;
        rules.push(Value::Table(rule.clone()));
        let lines: String = rule.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        Self::parse(&self.at_end(&format!("{comment}[[{section}]]\n{lines}"))).filter(|made| made.table == table)
    }

    /// Another value in the place of one that is there. A list that only grows keeps what stands in it.
    fn replaced(&self, name: &Range<usize>, old: &Spanned<DeValue>, value: &Value, comment: &str) -> String {
        let text = &self.text;
        let line = line_start(text, name.start);
        let (before, between) = (&text[..line], &text[line..old.span().start]);
        let last = old.get_ref().as_array().and_then(|elements| elements.last());
        let kept = old.get_ref().as_array().map_or(0, |elements| elements.len());
        let new = match (last, value) {
            (Some(last), Value::Array(values)) if values.len() >= kept => {
                let more: String = values[kept..].iter().map(|value| format!(", {value}")).collect();
                format!("{}{more}{}", &text[old.span().start..last.span().end], &text[last.span().end..old.span().end])
            }
            _ => value.to_string(),
        };
        format!("{before}{comment}{between}{new}{}", &text[old.span().end..])
    }

    /// After the last key before the first section.
    fn before_sections(&self, root: &DeTable, lines: &str) -> String {
        let starts = root.keys().map(|key| line_start(&self.text, key.span().start));
        let header = starts.filter(|&start| self.text[start..].trim_start().starts_with('[')).min();
        let Some(header) = header else { return self.at_end(lines) };
        let (mut content, mut comments, mut at) = (0, header, 0);
        for line in self.text[..header].split_inclusive('\n') {
            let is_comment = line.trim_start().starts_with('#');
            at += line.len();
            if line.trim().is_empty() {
                comments = header;
            } else if !is_comment {
                (content, comments) = (at, header);
            } else if comments == header {
                comments = at - line.len();
            }
        }
        // A comment right above the section is the section's.
        let at = if content > 0 { content } else { comments };
        let gap = if content > 0 { "" } else { "\n" };
        format!("{}{lines}{gap}{}", &self.text[..at], &self.text[at..])
    }

    /// After the last key of a section, in the form of that one; in an empty one below its header.
    fn inserted(&self, inside: &DeTable, header: &Range<usize>, new: &str, comment: &str) -> String {
        let text = &self.text;
        let last = inside.iter().max_by_key(|(_, value)| value.span().end);
        let Some((name, value)) = last else {
            let at = line_end(text, header.end);
            return format!("{}{comment}{new}\n{}", ended(&text[..at]), &text[at..]);
        };
        // Before the name stand blanks, or the section in a dotted key, or the bracket of a table in one line.
        let form = &text[line_start(text, name.span().start)..name.span().start];
        if form.contains('{') {
            let (line, end) = (line_start(text, header.start), value.span().end);
            return format!("{}{comment}{}, {new}{}", &text[..line], &text[line..end], &text[end..]);
        }
        let at = line_end(text, value.span().end);
        format!("{}{comment}{form}{new}\n{}", ended(&text[..at]), &text[at..])
    }

    fn at_end(&self, lines: &str) -> String {
        let text = self.text.trim_end();
        if text.is_empty() { lines.into() } else { format!("{text}\n\n{lines}") }
    }
}

fn line_start(text: &str, at: usize) -> usize {
    text[..at].rfind('\n').map_or(0, |end| end + 1)
}

/// Behind the end of the line.
fn line_end(text: &str, at: usize) -> usize {
    text[at..].find('\n').map_or(text.len(), |end| at + end + 1)
}

/// The lines, the last one ended, too.
fn ended(lines: &str) -> String {
    if lines.ends_with('\n') { lines.into() } else { format!("{lines}\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(text: &str, section: &str, key: &str, value: &str) -> Option<String> {
        let value = format!("it = {value}").parse::<Table>().ok()?.remove("it")?;
        Some(Description::parse(text)?.with(section, key, &value, "# why\n")?.text().to_owned())
    }

    #[test]
    fn lines_go_where_they_belong_and_all_else_stays() {
        for (text, section, key, value, expected) in [
            ("", "", "axes", "\"NED/FRD\"", "# why\naxes = \"NED/FRD\"\n"),
            ("", "late", "rates", "0.1", "# why\n[late]\nrates = 0.1\n"),
            (
                "use = []  # all\n\n# Units.\n[units]\n",
                "",
                "axes",
                "\"a\"",
                "use = []  # all\n# why\naxes = \"a\"\n\n# Units.\n[units]\n",
            ),
            ("# Flights.\n\n# Units.\n[units]\n", "", "a", "1", "# Flights.\n\n# why\na = 1\n\n# Units.\n[units]\n"),
            ("# Flights.", "", "a", "1", "# Flights.\n\n# why\na = 1\n"),
            ("a = 1 # one\n", "", "a", "2", "# why\na = 2 # one\n"),
            ("a = [\n  \"x\", # first\n]\n", "", "a", "[\"x\", \"y\"]", "# why\na = [\n  \"x\", \"y\", # first\n]\n"),
            ("a = [\"x\",]", "", "a", "[\"x\", \"y\"]", "# why\na = [\"x\", \"y\",]"),
            ("a = \"x\"\n", "", "a", "[\"x\", \"y\"]", "# why\na = [\"x\", \"y\"]\n"),
            ("[units] # of old\n", "units", "a", "\"b\"", "[units] # of old\n# why\na = \"b\"\n"),
            ("[units]\n  a = \"b\" # old\n\n[late]\n", "units", "c", "1", "[units]\n  a = \"b\" # old\n# why\n  c = 1\n\n[late]\n"),
            ("units = { a = \"b\" } # old\n", "units", "c", "1", "# why\nunits = { a = \"b\", c = 1 } # old\n"),
            ("units.a = \"b\"\nz = 1\n", "units", "c", "1", "units.a = \"b\"\n# why\nunits.c = 1\nz = 1\n"),
            ("[units]\na = \"b\"", "units", "c", "1", "[units]\na = \"b\"\n# why\nc = 1\n"),
            ("[[repair]]\na = 1\n", "units", "c", "1", "[[repair]]\na = 1\n\n# why\n[units]\nc = 1\n"),
        ] {
            assert_eq!(with(text, section, key, value).as_deref(), Some(expected), "{text}");
        }
    }

    #[test]
    fn what_is_written_in_an_unusual_form_is_left_alone() {
        assert_eq!(with("units = \"deg\"", "units", "a", "1"), None);
        assert_eq!(with("units = {}", "units", "a", "1"), None);
        let rule = Table::from_iter([("a".to_owned(), Value::Integer(1))]);
        let with_rule = |text: &str| Some(Description::parse(text)?.with_rule("repair", &rule, "# why\n")?.text().to_owned());
        assert_eq!(with_rule("[repair]\na = 2"), None);
        assert_eq!(with_rule("repair = [{ a = 2 }]"), None);
        assert_eq!(with_rule("x = 1\n").as_deref(), Some("x = 1\n\n# why\n[[repair]]\na = 1\n"));
        assert_eq!(with_rule("[[repair]]\na = 2\n").as_deref(), Some("[[repair]]\na = 2\n\n# why\n[[repair]]\na = 1\n"));
    }
}
