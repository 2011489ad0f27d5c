//! A strict look at one TOML table: typed values by key, and errors that name file, line, key, what was found and what was
//! expected. Knows no model.

use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One table of a file.
#[derive(Clone, Copy)]
pub(super) struct Section<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// How errors call the table.
    pub name: &'a str,
    pub table: &'a DeTable<'a>,
}

/// Line, from 1, of a byte of `text`.
pub(super) fn line_of(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|&byte| byte == b'\n').count()
}

impl<'a> Section<'a> {
    /// An error about a key that is there.
    pub(super) fn fault(&self, key: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        let start = self.table.iter().find(|entry| entry.0.get_ref() == key).map(|entry| entry.0.span().start);
        let start = start.or_else(|| self.table.keys().map(|key| key.span().start).min());
        let line = start.map_or(1, |start| line_of(self.text, start));
        Error::Config {
            place: format!("{}, line {line}", self.path.display()),
            field: if self.name.is_empty() { key.into() } else { format!("{}.{key}", self.name) },
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// Refuses keys that are not in `known`.
    pub(super) fn allow(&self, known: &[&str]) -> Result<()> {
        match self.table.keys().find(|key| !known.contains(&key.get_ref().as_ref())) {
            Some(key) => {
                let key = key.get_ref();
                let expected = if known.is_empty() { "no key here".into() } else { format!("one of `{}`", known.join("`, `")) };
                Err(self.fault(key, format!("an unknown key{}", did_you_mean(key, known.iter().copied())), expected))
            }
            None => Ok(()),
        }
    }

    fn value(&self, key: &str) -> Option<&'a DeValue<'a>> {
        self.table.get(key).map(Spanned::get_ref)
    }

    /// A section within this one.
    pub(super) fn section(&self, key: &str, name: &'a str) -> Result<Option<Self>> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Table(table)) => Ok(Some(Self { name, table, ..*self })),
            Some(other) => Err(self.fault(key, describe(other), "a table")),
        }
    }

    /// The tables of `[[key]]`.
    pub(super) fn sections(&self, key: &str, name: &'a str) -> Result<Vec<Self>> {
        let Some(value) = self.value(key) else { return Ok(Vec::new()) };
        let DeValue::Array(values) = value else { return Err(self.fault(key, describe(value), format!("`[[{key}]]` tables"))) };
        values
            .iter()
            .map(|value| match value.get_ref() {
                DeValue::Table(table) => Ok(Self { name, table, ..*self }),
                other => Err(self.fault(key, describe(other), format!("`[[{key}]]` tables"))),
            })
            .collect()
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::String(text)) => Ok(Some(text)),
            Some(other) => Err(self.fault(key, describe(other), "text in quotes")),
        }
    }

    pub(super) fn flag(&self, key: &str) -> Result<Option<bool>> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Boolean(flag)) => Ok(Some(*flag)),
            Some(other) => Err(self.fault(key, describe(other), "`true` or `false`")),
        }
    }

    /// A finite number, written as a float or as an integer.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        number(value).map(Some).ok_or_else(|| self.fault(key, describe(value), "a finite number"))
    }

    /// A list of finite numbers; none if it is not there.
    pub(super) fn list(&self, key: &str) -> Result<Vec<f64>> {
        let Some(value) = self.value(key) else { return Ok(Vec::new()) };
        let list: Option<Vec<f64>> = match value {
            DeValue::Array(values) => values.iter().map(|value| number(value.get_ref())).collect(),
            _ => None,
        };
        list.ok_or_else(|| self.fault(key, describe(value), "a list of finite numbers"))
    }

    /// A list of `COUNT` finite numbers.
    pub(super) fn numbers<const COUNT: usize>(&self, key: &str) -> Result<Option<[f64; COUNT]>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let array = self.list(key).ok().and_then(|list| <[f64; COUNT]>::try_from(list).ok());
        array.map(Some).ok_or_else(|| self.fault(key, describe(value), format!("a list of {COUNT} numbers")))
    }

    pub(super) fn texts(&self, key: &str) -> Result<Vec<String>> {
        let Some(value) = self.value(key) else { return Ok(Vec::new()) };
        let fault = || self.fault(key, describe(value), "a list of texts");
        let DeValue::Array(values) = value else { return Err(fault()) };
        values.iter().map(|value| value.get_ref().as_str().map(str::to_owned).ok_or_else(fault)).collect()
    }

    /// The keys of the table.
    pub(super) fn keys(&self) -> Vec<&'a str> {
        self.table.keys().map(|key| key.get_ref().as_ref()).collect()
    }
}

/// A finite number.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok().filter(|number: &f64| number.is_finite()),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|number| number as f64),
        _ => None,
    }
}

/// A value in a few words.
pub(super) fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text {text:?}"),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.as_str().to_owned(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(datetime) => format!("the date {datetime}"),
        DeValue::Array(values) => format!("a list of {}", values.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
