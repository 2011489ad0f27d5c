//! The text of a guessed `dataset.toml`: keys, sections, and above each line why it stands there.

use crate::flight::column_names;
use std::fmt::Write;

/// Lines of a description, in the order they were found.
#[derive(Default)]
pub(super) struct Draft {
    top: Vec<(String, String)>,
    columns: Vec<(&'static str, String)>,
    units: Vec<(&'static str, &'static str, String)>,
}

/// A text as TOML has it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

impl Draft {
    /// A key before all sections; `value` as TOML has it.
    pub fn key(&mut self, key: &str, value: &str, why: &str) {
        self.top.push((why.into(), format!("{key} = {value}")));
    }

    /// A key whose value is a text.
    pub fn word(&mut self, key: &str, value: &str, why: &str) {
        self.key(key, &quoted(value), why);
    }

    /// A list of texts.
    pub fn list<'a>(&mut self, key: &str, values: impl Iterator<Item = &'a str>, why: &str) {
        let values: Vec<String> = values.map(quoted).collect();
        self.key(key, &format!("[{}]", values.join(", ")), why);
    }

    /// Where a canonical column comes from.
    pub fn column(&mut self, name: &'static str, source: &str) {
        self.columns.push((name, source.into()));
    }

    /// Takes back where columns come from.
    pub fn forget_columns(&mut self, names: &[&str]) {
        self.columns.retain(|(name, _)| !names.contains(name));
    }

    pub fn unit(&mut self, word: &'static str, unit: &'static str, why: String) {
        self.units.push((word, unit, why));
    }

    /// The file.
    pub fn text(mut self, log: &str) -> String {
        let mut text =
            format!("# How these flights are read: guessed by `phyture init` from `{log}`. Above each line stands why.\n");
        let comment = |text: &mut String, why: &str| {
            if !why.is_empty() {
                let _ = writeln!(text, "# {why}");
            }
        };
        for (why, line) in &self.top {
            comment(&mut text, why);
            let _ = writeln!(text, "{line}");
        }
        if !self.columns.is_empty() {
            text.push_str("\n# By their names.\n[columns]\n");
            let place = |name: &str| column_names().position(|known| known == name);
            self.columns.sort_by_key(|(name, _)| place(name));
            self.columns.iter().for_each(|(name, source)| text.push_str(&format!("{name} = {}\n", quoted(source))));
        }
        if !self.units.is_empty() {
            text.push_str("\n[units]\n");
            for (word, unit, why) in &self.units {
                comment(&mut text, why);
                let _ = writeln!(text, "{word} = {}", quoted(unit));
            }
        }
        text
    }
}
