//! The keys of a TOML table, taken one by one: of the right kind, or an error that names the key. Which keys there are is `schema`'s.

use super::{Column, units};
use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use std::collections::BTreeMap;
use toml::{Table, Value};

/// Largest time by which a stream can be late or early, s.
const LATEST_S: f64 = 1.0;
/// Fastest that its delay can grow, s for each second: a clock that is wrong by more is no clock.
const FASTEST_DRIFT: f64 = 0.1;

/// A TOML table whose keys are taken one by one; what is left at the end is unknown.
pub(super) struct Keys {
    /// What errors name as the place.
    pub place: String,
    prefix: &'static str,
    table: Table,
    known: Vec<&'static str>,
}

impl Keys {
    pub fn new(place: &str, prefix: &'static str, table: Table) -> Self {
        Self { place: place.into(), prefix, table, known: Vec::new() }
    }

    pub fn fault(&self, key: &str, found: String, expected: String) -> Error {
        Error::Config { place: self.place.clone(), field: format!("{}{key}", self.prefix), found, expected }
    }

    pub fn take(&mut self, key: &'static str) -> Option<Value> {
        self.known.push(key);
        self.table.remove(key)
    }

    pub fn text(&mut self, key: &'static str) -> Result<Option<String>> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => Err(self.fault(key, other.to_string(), "a text in quotes".into())),
        }
    }

    pub fn texts(&mut self, key: &'static str) -> Result<Option<Vec<String>>> {
        let value = self.take(key);
        let one = |value| match value {
            Value::String(text) => Ok(text),
            other => Err(self.fault(key, other.to_string(), "a text in quotes, or a list of such".into())),
        };
        match value {
            None => Ok(None),
            Some(Value::Array(values)) => values.into_iter().map(one).collect::<Result<_>>().map(Some),
            Some(value) => Ok(Some(vec![one(value)?])),
        }
    }

    pub fn flag(&mut self, key: &'static str) -> Result<Option<bool>> {
        match self.take(key) {
            None => Ok(None),
            Some(Value::Boolean(flag)) => Ok(Some(flag)),
            Some(other) => Err(self.fault(key, other.to_string(), "true or false".into())),
        }
    }

    pub fn number(&mut self, key: &'static str, least: f64) -> Result<Option<f64>> {
        let number = match self.take(key) {
            None => return Ok(None),
            Some(Value::Float(number)) => number,
            Some(Value::Integer(number)) => number as f64,
            Some(other) => return Err(self.fault(key, other.to_string(), "a number".into())),
        };
        if number.is_finite() && number >= least {
            return Ok(Some(number));
        }
        let expected = if least == f64::MIN_POSITIVE { "a number above 0".into() } else { format!("a number of at least {least}") };
        Err(self.fault(key, number.to_string(), expected))
    }

    /// A list of numbers, or one.
    pub fn numbers(&mut self, key: &'static str) -> Result<Option<Vec<f64>>> {
        let value = self.take(key);
        let one = |value| match value {
            Value::Float(number) if number.is_finite() => Ok(number),
            Value::Integer(number) => Ok(number as f64),
            other => Err(self.fault(key, other.to_string(), "a number, or a list of such".into())),
        };
        match value {
            None => Ok(None),
            Some(Value::Array(values)) => values.into_iter().map(one).collect::<Result<_>>().map(Some),
            Some(value) => Ok(Some(vec![one(value)?])),
        }
    }

    /// Times by stream, s.
    pub fn times(&mut self) -> Result<BTreeMap<Column, f64>> {
        self.by_stream(LATEST_S, "a time", " s")
    }

    /// How times by stream grow, s for each second.
    pub fn drifts(&mut self) -> Result<BTreeMap<Column, f64>> {
        self.by_stream(FASTEST_DRIFT, "a drift", " s for each second")
    }

    /// Numbers by stream, none larger than `most`: a group's word first, a single column's over it.
    fn by_stream(&mut self, most: f64, what: &str, unit: &str) -> Result<BTreeMap<Column, f64>> {
        let mut numbers = BTreeMap::new();
        for single in [false, true] {
            for group in units::GROUPS {
                let words: &[&'static str] = if single { group.columns } else { &[group.name] };
                for &word in words {
                    let columns: &[&'static str] = if single { &[word] } else { group.columns };
                    let columns: Vec<Column> = columns.iter().filter_map(|column| Column::from_name(column)).collect();
                    // Time and quaternions are no canonical columns; `finish` refuses them.
                    let Some(number) = (if columns.is_empty() { None } else { self.number(word, -most)? }) else { continue };
                    if number > most {
                        return Err(self.fault(word, number.to_string(), format!("{what} from -{most} to {most}{unit}")));
                    }
                    numbers.extend(columns.into_iter().map(|column| (column, number)));
                }
            }
        }
        Ok(numbers)
    }

    pub fn choice<T: Copy>(&mut self, key: &'static str, choices: &[(&'static str, T)]) -> Result<Option<T>> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        if let Some(choice) = choices.iter().find(|choice| choice.0 == text) {
            return Ok(Some(choice.1));
        }
        let names: Vec<&str> = choices.iter().map(|choice| choice.0).collect();
        let hint = did_you_mean(&text, names.iter().copied());
        Err(self.fault(key, format!("`{text}`"), format!("one of {}{hint}", names.join(", "))))
    }

    pub fn section(&mut self, key: &'static str) -> Result<Option<Self>> {
        let prefix = match key {
            "columns" => "columns.",
            "units" => "units.",
            "late" => "late.",
            "drift" => "drift.",
            "late_in" => "late_in.",
            "cut" => "cut.",
            _ => "repair.",
        };
        match self.take(key) {
            None => Ok(None),
            Some(Value::Table(table)) => Ok(Some(Self::new(&self.place, prefix, table))),
            Some(other) => Err(self.fault(key, other.to_string(), format!("a table, [{key}]"))),
        }
    }

    /// `[[key]]`, any number of times, or `[key]` once.
    pub fn sections(&mut self, key: &'static str) -> Result<Vec<Self>> {
        let values = match self.take(key) {
            None => Vec::new(),
            Some(Value::Array(values)) => values,
            Some(value) => vec![value],
        };
        let single = |value| Self::new(&self.place, "", Table::from_iter([(key.to_owned(), value)])).section(key);
        values.into_iter().filter_map(|value| single(value).transpose()).collect()
    }

    pub fn finish(self) -> Result<()> {
        let Some(key) = self.table.keys().next() else { return Ok(()) };
        let hint = did_you_mean(key, self.known.iter().copied());
        let expected = format!("one of {}{hint}", self.known.join(", "));
        Err(self.fault(key, "an unknown key".into(), expected))
    }
}
