//! How numbers are printed: significant digits, shares, columns under each other. What the numbers are, nothing here knows.

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
            // Far from any share: what is predicted has nothing to do with the measurements.
            (Self::Share, Some(value)) if value.abs() >= 1000.0 => format!("{value:.1e}"),
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
