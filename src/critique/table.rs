//! A comparison as text for a person at a terminal: aligned columns, units, the best value of each column marked with `*`.
//!
//! Only layout; every number comes from [`Comparison`].

use super::compare::{Comparison, ModelError, PerChannel};
use super::regime::Regime;
use crate::flight::split::Part;
use crate::flight::{Column, Targets};
use std::fmt;

/// Significant digits of an error measure in tables.
pub const DIGITS: usize = 3;

/// A number with `digits` significant digits, without an exponent between 1e-4 and 1e6.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&magnitude) {
        return format!("{value:.*e}", digits.saturating_sub(1));
    }
    let decimals = (digits as i32 - 1 - magnitude).max(0) as usize;
    format!("{value:.decimals$}")
}

/// Kind of a measure: how it is printed and what is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An error in the unit of its channel: [`DIGITS`] significant digits, smaller is better.
    Error,
    /// A share such as R²: three decimals, larger is better.
    Share,
}

impl Kind {
    /// The value as text; a dash where there is none.
    pub fn text(self, value: Option<f64>) -> String {
        match (self, value) {
            (_, None) => "–".to_owned(),
            (Self::Error, Some(value)) => significant(value, DIGITS),
            (Self::Share, Some(value)) => format!("{value:.3}"),
        }
    }

    /// The indices of the best values; more than one on a tie of the printed text, none with fewer than two values.
    pub fn best(self, values: &[Option<f64>]) -> Vec<usize> {
        let present = values.iter().flatten().copied();
        if present.clone().count() < 2 {
            return Vec::new();
        }
        let printed = self.text(match self {
            Self::Error => present.reduce(f64::min),
            Self::Share => present.reduce(f64::max),
        });
        let is_best = |value: &Option<f64>| value.is_some() && self.text(*value) == printed;
        values.iter().enumerate().filter(|(_, value)| is_best(value)).map(|(index, _)| index).collect()
    }
}

/// A measure with its title and where to find it.
type Measure = (&'static str, &'static str, Kind, fn(&ModelError) -> PerChannel);

/// The four measures in the order in which they are shown: short title, explanation, kind, value.
pub const MEASURES: [Measure; 4] = [
    ("RMSE", "root mean square error", Kind::Error, |model| model.rmse),
    ("MAE", "mean absolute error", Kind::Error, |model| model.mae),
    ("MaxAE", "largest absolute error", Kind::Error, |model| model.max_abs),
    ("R²", "share of the variance predicted", Kind::Share, |model| model.r2),
];

impl Comparison {
    /// One sentence on what is compared: number of windows, part of the data, where the targets come from.
    pub fn basis(&self) -> String {
        let windows = self.models.first().map_or(0, |model| model.windows);
        let target = match self.target {
            Targets::Recorded => "recorded accelerations",
            Targets::Derived => "accelerations derived from the recorded velocity and rates",
        };
        let part = match self.split {
            Part::Locked => "the locked flights",
            Part::Test => "the test part",
            Part::All => "all flights, those used for fitting included",
        };
        format!("{windows} windows of {part}, against {target}")
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.basis())?;
        let names: Vec<String> = self.models.iter().map(|model| model.name.clone()).collect();
        let channels: Vec<(String, String)> =
            Column::TARGETS.iter().map(|column| (column.name().to_owned(), column.unit().to_owned())).collect();
        for (title, words, kind, measure) in MEASURES {
            let mut columns = channels.clone();
            if kind == Kind::Share {
                columns.iter_mut().for_each(|(_, unit)| unit.clear());
            }
            columns.push(("mean".to_owned(), String::new()));
            let values = self.models.iter().map(|model| {
                let found = measure(model);
                found.channels().into_iter().chain([found.mean]).collect()
            });
            writeln!(f)?;
            grid(f, &format!("{title}, {words}"), &columns, &names, &values.collect::<Vec<_>>(), Some(kind))?;
        }
        let columns: Vec<(String, String)> = [("windows".to_owned(), String::new())]
            .into_iter()
            .chain(names.iter().map(|name| (name.clone(), String::new())))
            .collect();
        let Some(first) = self.models.first() else { return Ok(()) };
        let regimes = Regime::ALL.map(|regime| regime.name().to_owned());
        let flown = |name: &&String| first.by_regime.get(*name).is_some_and(|part| part.n > 0);
        let parts = [
            ("manoeuvre", first.by_manoeuvre.keys().cloned().collect::<Vec<_>>()),
            ("regime", regimes.iter().filter(flown).cloned().collect()),
        ];
        for (what, names) in parts {
            let of = |model: &ModelError, name: &String| {
                let parts = if what == "regime" { &model.by_regime } else { &model.by_manoeuvre };
                parts.get(name).copied().unwrap_or_default()
            };
            let row = |name: &String| {
                let errors = self.models.iter().map(|model| of(model, name).rmse.mean);
                [Some(of(first, name).n as f64)].into_iter().chain(errors).collect::<Vec<_>>()
            };
            writeln!(f)?;
            let values: Vec<_> = names.iter().map(row).collect();
            grid(f, &format!("RMSE by {what}, mean of the six channels"), &columns, &names, &values, None)?;
        }
        if let Some(model) = self.models.iter().find(|model| model.not_finite > 0) {
            let text = "predictions are not finite numbers; its measures are left open (–) in the channels they hit";
            writeln!(f, "\n`{}`: {} {text}", model.name, model.not_finite)?;
        }
        if self.models.len() > 1 {
            writeln!(f, "\n* best of the column (of the row, by manoeuvre and regime)")?;
        }
        self.shares.iter().try_for_each(|shares| writeln!(f, "\n{shares}"))?;
        self.uncertainty.iter().try_for_each(|uncertainty| writeln!(f, "\n{uncertainty}"))?;
        Ok(())
    }
}

/// Writes rows of texts under headings with units, right-aligned, indented by two.
pub(super) fn aligned(f: &mut fmt::Formatter<'_>, heads: &[(&str, &str)], rows: &[(String, Vec<String>)]) -> fmt::Result {
    let wide = |text: &str| text.chars().count();
    let first = rows.iter().map(|(name, _)| wide(name)).max().unwrap_or(0);
    let width = |(column, head): (usize, &(&str, &str))| {
        let cells = rows.iter().filter_map(|(_, cells)| cells.get(column)).map(|cell| wide(cell));
        cells.chain([wide(head.0), wide(head.1)]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = heads.iter().enumerate().map(width).collect();
    let mut line = |name: &str, cells: &mut dyn Iterator<Item = &str>| {
        let mut text = format!("  {name:<first$}");
        cells.zip(&widths).for_each(|(cell, width)| text.push_str(&format!("  {cell:>width$}")));
        writeln!(f, "{}", text.trim_end())
    };
    line("", &mut heads.iter().map(|head| head.0))?;
    if heads.iter().any(|head| !head.1.is_empty()) {
        line("", &mut heads.iter().map(|head| head.1))?;
    }
    rows.iter().try_for_each(|(name, cells)| line(name, &mut cells.iter().map(String::as_str)))
}

/// Writes one table. With a `kind`, the best of each column is marked; without, the first column is a count and the best
/// (smallest) of the others is marked in each row.
fn grid(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    columns: &[(String, String)],
    names: &[String],
    values: &[Vec<Option<f64>>],
    kind: Option<Kind>,
) -> fmt::Result {
    let mut text: Vec<Vec<String>> =
        values.iter().map(|row| row.iter().map(|value| kind.unwrap_or(Kind::Error).text(*value)).collect()).collect();
    let mut marks: Vec<Vec<bool>> = values.iter().map(|row| vec![false; row.len()]).collect();
    if let Some(kind) = kind {
        (0..columns.len()).for_each(|column| {
            let one: Vec<Option<f64>> = values.iter().map(|row| row.get(column).copied().flatten()).collect();
            kind.best(&one).into_iter().for_each(|row| marks[row][column] = true);
        });
    } else {
        for (row, of_row) in values.iter().enumerate() {
            Kind::Error.best(of_row.get(1..).unwrap_or_default()).into_iter().for_each(|column| marks[row][column + 1] = true);
            if let (Some(count), Some(Some(windows))) = (text[row].first_mut(), of_row.first()) {
                *count = format!("{windows:.0}");
            }
        }
    }
    let wide = |text: &str| text.chars().count();
    let first = names.iter().map(|name| wide(name)).max().unwrap_or(0).max(8);
    let width = |column: usize| {
        let cells = text.iter().filter_map(|row| row.get(column)).map(|cell| wide(cell));
        cells.chain([wide(&columns[column].0), wide(&columns[column].1)]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    writeln!(f, "{title}")?;
    let header = |f: &mut fmt::Formatter<'_>, pick: fn(&(String, String)) -> &str| {
        let mut line = " ".repeat(first + 2);
        for (column, width) in columns.iter().zip(&widths) {
            line.push_str(&format!("  {:>width$} ", pick(column)));
        }
        writeln!(f, "{}", line.trim_end())
    };
    header(f, |column| &column.0)?;
    if columns.iter().any(|column| !column.1.is_empty()) {
        header(f, |column| &column.1)?;
    }
    for ((name, row), marks) in names.iter().zip(&text).zip(&marks) {
        let mut line = format!("  {name:<first$}");
        for ((cell, width), mark) in row.iter().zip(&widths).zip(marks) {
            line.push_str(&format!("  {cell:>width$}{}", if *mark { "*" } else { " " }));
        }
        writeln!(f, "{}", line.trim_end())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::compare::tests::{every_window, flights};
    use crate::critique::{Row, compare};
    use crate::error::Result;
    use proptest::prelude::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        let cases = [(0.812_34, "0.812"), (12.345, "12.3"), (1_234.5, "1234"), (-0.000_512_3, "-0.000512"), (3.2e-7, "3.20e-7")];
        assert!(cases.iter().all(|(value, text)| significant(*value, 3) == *text));
        assert_eq!(Kind::Error.text(None), "–");
        assert_eq!(Kind::Share.text(Some(-0.000_618)), "-0.001");
    }

    #[test]
    fn the_table_names_units_and_marks_the_best() -> Result<()> {
        let flights = flights(|_, sample, _| (sample % 7) as f64)?;
        let windows = every_window(&flights);
        let row = |name: &str, value: f64| Row { name: name.into(), predicted: vec![[value; 6]; windows.len()] };
        let text = compare(&flights, &windows, &[row("mean of the data", 3.0), row("zero", 0.0)], Part::All)?.to_string();
        assert!(text.starts_with("200 windows of all flights"), "{text}");
        assert!(text.contains("rad/s²") && text.contains("RMSE by manoeuvre") && text.contains("forward"), "{text}");
        let rmse: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("RMSE")).skip(3).take(2).collect();
        assert!(rmse.first().is_some_and(|line| line.matches('*').count() == 7), "{text}");
        assert!(rmse.last().is_some_and(|line| line.contains("zero") && !line.contains('*')), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
        Ok(())
    }

    proptest! {
        #[test]
        fn significant_digits_are_kept(value in prop::num::f64::NORMAL, digits in 3..7_usize) {
            let back: f64 = significant(value, digits).parse().unwrap_or(f64::NAN);
            // Half a unit of the last digit kept, relative to the smallest mantissa 1.
            let half_unit = 0.5 * 10.0_f64.powi(1 - digits as i32);
            prop_assert!((back - value).abs() <= value.abs() * half_unit * (1.0 + f64::EPSILON * 8.0) || !back.is_finite());
        }
    }
}
