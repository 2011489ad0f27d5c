//! A comparison as text for a person at a terminal: aligned columns, units, the best value of each column marked with `*`.
//!
//! Only layout; every number comes from [`Comparison`].

use super::channels::ChannelValues;
use super::compare::{Comparison, ModelError, PartError};
use super::digits::{Kind, significant};
use super::regime::Regime;
use super::shares::Shares;
use super::wrap::{WIDTH, clipped, wrapped};
use crate::blocks::FEW_BLOCKS;
use crate::flight::split::Part;
use crate::flight::{Column, Targets};
use std::collections::BTreeMap;
use std::fmt;

/// A measure with its title and where to find it.
type Measure = (&'static str, &'static str, Kind, fn(&ModelError) -> ChannelValues);

/// The four measures in the order in which they are shown: short title, explanation, kind, value.
pub const MEASURES: [Measure; 4] = [
    ("RMSE", "root mean square error", Kind::Error, |model| model.rmse),
    ("MAE", "mean absolute error", Kind::Error, |model| model.mae),
    ("MaxAE", "largest absolute error", Kind::Error, |model| model.max_abs),
    ("R²", "share of the variance predicted", Kind::Share, |model| model.r2),
];

impl Comparison {
    /// One sentence on what is compared: number of windows, part of the data, distance between windows, where the targets come from.
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
        let every = match self.stride {
            0 | 1 => "every sample".to_owned(),
            stride => format!("every {stride}{} sample", ordinal(stride)),
        };
        format!("{windows} windows of {part}, {every}, against {target}")
    }

    /// What so few blocks of ten seconds can say, if they are few.
    pub fn caution(&self) -> Option<String> {
        match self.blocks {
            0 => None,
            1 => Some(
                "All windows lie in one block of ten seconds: nothing can be said of chance, so there are no intervals and no best. Give \
                 longer flights, or lock whole flights with --lock."
                    .into(),
            ),
            blocks if blocks < FEW_BLOCKS => {
                Some(format!("The windows lie in {blocks} blocks of ten seconds: the intervals are a rough guide."))
            }
            _ => None,
        }
    }

    /// Whether a model is the best in a measure and column (`vx_dot` … `mean`), beyond chance.
    pub fn is_best(&self, measure: &str, column: &str, model: usize) -> bool {
        self.best.get(measure).and_then(|columns| columns.get(column)).is_some_and(|best| *best == model)
    }

    /// What matters first: what is compared, the root mean square errors with their intervals, and who explains how much, in a sentence.
    ///
    /// # Examples
    /// ```
    /// use phyture::critique::Comparison;
    ///
    /// fn tell(comparison: &Comparison) {
    ///     println!("{}", comparison.in_short());
    /// }
    /// ```
    pub const fn in_short(&self) -> InShort<'_> {
        InShort(self)
    }

    fn what_is_compared(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", wrapped("", &self.basis()))?;
        if self.own_from_other_half {
            writeln!(f, "{}", wrapped("", OWN_FROM_OTHER_HALF))?;
        }
        if let Some(caution) = self.caution() {
            writeln!(f, "{}", wrapped("", &caution))?;
        }
        Ok(())
    }

    fn not_finite(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(model) = self.models.iter().find(|model| model.not_finite > 0) else { return Ok(()) };
        let text = "predictions are not finite numbers; its measures are left open (–) in the channels they hit";
        writeln!(f, "\n{}", wrapped("", &format!("`{}`: {} {text}", model.name, model.not_finite)))
    }

    fn measure_table(&self, f: &mut fmt::Formatter<'_>, (title, words, kind, measure): Measure) -> fmt::Result {
        let mut columns: Vec<(String, String)> =
            Column::TARGETS.iter().map(|column| (column.name().to_owned(), column.unit().to_owned())).collect();
        if kind == Kind::Share {
            columns.iter_mut().for_each(|(_, unit)| unit.clear());
        }
        columns.push(("mean".to_owned(), String::new()));
        let mut rows = Vec::new();
        for (index, model) in self.models.iter().enumerate() {
            let found = measure(model);
            let values = found.channels().into_iter().chain([found.mean]);
            let cell = |(value, (name, _)): (Option<f64>, &(String, String))| {
                (kind.text(value), key(title).is_some_and(|key| self.is_best(key, name, index)))
            };
            rows.push((clipped(&model.name, NAME), values.zip(&columns).map(cell).collect()));
            if title == "RMSE" {
                let intervals = model.rmse_ci95.channels().into_iter().chain([None]);
                rows.push((String::new(), intervals.map(|interval| (interval_text(interval), false)).collect()));
            }
        }
        if let Some(floor) = self.floor.filter(|_| title == "RMSE") {
            let values = floor.channels().into_iter().chain([floor.mean]);
            rows.push(("floor".to_owned(), values.map(|value| (kind.text(value), false)).collect()));
        }
        if wide(&columns, &rows) > WIDTH {
            // Very small numbers; the intervals are in the JSON and on the page.
            rows.retain(|(name, _)| !name.is_empty());
        }
        writeln!(f)?;
        grid(f, &format!("{title}, {words}"), &columns, &rows)
    }

    /// How far each RMSE is from that of the best, paired.
    fn difference_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(to) = self.models.iter().find_map(|model| Some(&model.difference_to_best.as_ref()?.to)) else { return Ok(()) };
        let mut columns: Vec<(String, String)> =
            Column::TARGETS.iter().map(|column| (column.name().to_owned(), column.unit().to_owned())).collect();
        columns.push(("mean".to_owned(), String::new()));
        let mut rows = Vec::new();
        for (model, apart) in self.models.iter().filter_map(|model| Some((model, model.difference_to_best.as_ref()?))) {
            let signed = |value: Option<f64>| {
                value.map_or_else(|| "–".to_owned(), |value| format!("{}{}", plus(value), significant(value, 2)))
            };
            let values = apart.rmse.channels().into_iter().chain([apart.rmse.mean]);
            rows.push((clipped(&model.name, NAME), values.map(|value| (signed(value), false)).collect()));
            // The interval is symmetric.
            let intervals = apart.ci95.channels().into_iter().chain([apart.ci95.mean]);
            let half = |interval: Option<[f64; 2]>| {
                interval.map_or_else(String::new, |[low, high]| format!("±{}", significant(0.5 * (high - low), 2)))
            };
            rows.push((String::new(), intervals.map(|interval| (half(interval), false)).collect()));
        }
        writeln!(f)?;
        let title = format!(
            "RMSE less that of `{}`, with half of the 95 % interval, paired over {} block{} of ten seconds",
            clipped(to, NAME),
            self.blocks,
            if self.blocks == 1 { "" } else { "s" }
        );
        grid(f, &title, &columns, &rows)
    }

    /// Mean RMSE by manoeuvre or regime; parts with one window have no figures.
    fn part_table(&self, f: &mut fmt::Formatter<'_>, what: &str) -> fmt::Result {
        let Some(first) = self.models.first() else { return Ok(()) };
        let (parts, best): (Parts, _) = match what {
            "regime" => (|model| &model.by_regime, &self.best_by_regime),
            _ => (|model| &model.by_manoeuvre, &self.best_by_manoeuvre),
        };
        let names: Vec<String> = match what {
            "regime" => Regime::ALL.map(|regime| regime.name().to_owned()).into(),
            _ => parts(first).keys().cloned().collect(),
        };
        let heads: Vec<String> = self.models.iter().map(|model| clipped(&model.name, NAME)).collect();
        let shown = names.iter().filter(|name| parts(first).get(*name).is_some_and(|part| part.n > 0));
        let rows: Vec<(String, Vec<(String, bool)>)> = shown
            .map(|name| {
                let of = |model: &ModelError| parts(model).get(name).copied().unwrap_or_default();
                let count = (of(first).n.to_string(), false);
                let errors = self.models.iter().enumerate().map(|(index, model)| {
                    (Kind::Error.text(of(model).rmse.mean), best.get(name).is_some_and(|best| *best == index))
                });
                (clipped(name, NAME), [count].into_iter().chain(errors).collect())
            })
            .collect();
        // Long names of many models do not fit side by side; they get numbers then.
        let first = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).max(8);
        let wide: usize = 2 + first + 10 + heads.iter().map(|head| head.chars().count().max(6) + 3).sum::<usize>();
        let numbers: Vec<String> = (1..=heads.len()).map(|number| format!("({number})")).collect();
        let narrow = wide > WIDTH;
        let columns = if narrow { &numbers } else { &heads }.iter().map(|head| (head.clone(), String::new()));
        let columns: Vec<(String, String)> = [("windows".to_owned(), String::new())].into_iter().chain(columns).collect();
        writeln!(f)?;
        grid(f, &format!("RMSE by {what}, mean of the six channels"), &columns, &rows)?;
        if narrow {
            let legend: Vec<String> = numbers.iter().zip(&heads).map(|(number, head)| format!("{number} {head}")).collect();
            writeln!(f, "{}", wrapped("  ", &legend.join(", ")))?;
        }
        Ok(())
    }
}

/// The parts of a model's windows: manoeuvres or regimes.
type Parts = fn(&ModelError) -> &BTreeMap<String, PartError>;

/// Widest name of a model in a table.
const NAME: usize = 26;

/// The key of [`Comparison::best`] for a measure; the largest error has none, as one window decides it.
fn key(title: &str) -> Option<&'static str> {
    match title {
        "RMSE" => Some("rmse"),
        "MAE" => Some("mae"),
        "R²" => Some("r2"),
        _ => None,
    }
}

/// `0.21…0.34`; empty where there is none.
fn interval_text(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(String::new, |[low, high]| format!("{}…{}", significant(low, 2), significant(high, 2)))
}

fn plus(value: f64) -> &'static str {
    if value > 0.0 { "+" } else { "" }
}

/// `nd` of 2nd.
pub fn ordinal(number: usize) -> &'static str {
    match (number % 100, number % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    }
}

/// What the marks and the second lines of a table mean.
pub const LEGEND: &str = "* best of the column (of the row, by manoeuvre and regime), where the paired 95 % interval of its difference to every \
                          other model lies beyond zero; below each RMSE its own 95 % interval, from blocks of ten seconds.";

/// What the row `floor` means.
pub const FLOOR: &str = "Floor: what is left of the recorded accelerations without their explainable part, gusts, turbulence and noise; no model can \
                         remove it.";

/// How flights that no fit has seen are judged, where a model has numbers of each flight, in a comparison.
pub const OWN_FROM_OTHER_HALF: &str = "What each flight has for itself, wind, biases and trims, is found from its other half: the second half of a \
                                       flight is judged with numbers from the first, the first with numbers from the second. The same for every row.";

/// The same elsewhere.
pub const OWN_FROM_FIRST_HALF: &str = "Second halves of these flights: what each flight has for itself, wind and biases, is found from its \
                                       first half. The same for every row.";

/// A comparison without its tables of other measures, parts, shares and intervals: [`Comparison::in_short`].
pub struct InShort<'a>(&'a Comparison);

impl fmt::Display for InShort<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(comparison) = self;
        comparison.what_is_compared(f)?;
        comparison.measure_table(f, MEASURES[0])?;
        comparison.not_finite(f)?;
        writeln!(f, "\n{}", wrapped("", LEGEND))?;
        if comparison.floor.is_some() {
            writeln!(f, "{}", wrapped("", FLOOR))?;
        }
        let mut sentences = comparison.shares.iter().filter_map(Shares::sentence);
        sentences.try_for_each(|sentence| write!(f, "\n{}", wrapped("", &sentence)))
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.what_is_compared(f)?;
        for (index, measure) in MEASURES.into_iter().enumerate() {
            self.measure_table(f, measure)?;
            if index == 0 {
                self.difference_table(f)?;
            }
        }
        if self.models.is_empty() {
            return Ok(());
        }
        self.part_table(f, "manoeuvre")?;
        self.part_table(f, "regime")?;
        self.not_finite(f)?;
        writeln!(f, "\n{}", wrapped("", LEGEND))?;
        if self.floor.is_some() {
            writeln!(f, "{}", wrapped("", FLOOR))?;
        }
        self.shares.iter().try_for_each(|shares| writeln!(f, "\n{shares}"))?;
        self.coverage.iter().try_for_each(|coverage| writeln!(f, "\n{coverage}"))?;
        self.uncertainty.iter().try_for_each(|uncertainty| writeln!(f, "\n{uncertainty}"))?;
        Ok(())
    }
}

/// Width of a table as [`grid`] writes it.
fn wide(columns: &[(String, String)], rows: &[(String, Vec<(String, bool)>)]) -> usize {
    let wide = |text: &str| text.chars().count();
    let first = rows.iter().map(|(name, _)| wide(name)).max().unwrap_or(0).max(8);
    let of = |(column, head): (usize, &(String, String))| {
        let cells = rows.iter().filter_map(|(_, cells)| cells.get(column)).map(|(cell, _)| wide(cell));
        cells.chain([wide(&head.0), wide(&head.1)]).max().unwrap_or(0) + 2
    };
    2 + first + columns.iter().enumerate().map(of).sum::<usize>()
}

/// Writes one table: rows of texts, each marked or not, under headings with units.
fn grid(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    columns: &[(String, String)],
    rows: &[(String, Vec<(String, bool)>)],
) -> fmt::Result {
    let wide = |text: &str| text.chars().count();
    let first = rows.iter().map(|(name, _)| wide(name)).max().unwrap_or(0).max(8);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|(_, cells)| cells.get(column)).map(|(cell, _)| wide(cell));
        cells.chain([wide(&columns[column].0), wide(&columns[column].1)]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    // Two blanks between columns where there is room.
    let roomy = self::wide(columns, rows) + columns.len() <= WIDTH;
    let gap = if roomy { "  " } else { " " };
    writeln!(f, "{}", wrapped("", title))?;
    let header = |f: &mut fmt::Formatter<'_>, pick: fn(&(String, String)) -> &str| {
        let mut line = " ".repeat(first + 2);
        for (column, width) in columns.iter().zip(&widths) {
            line.push_str(&format!("{gap}{:>width$} ", pick(column)));
        }
        writeln!(f, "{}", line.trim_end())
    };
    header(f, |column| &column.0)?;
    if columns.iter().any(|column| !column.1.is_empty()) {
        header(f, |column| &column.1)?;
    }
    for (name, cells) in rows.iter().filter(|(_, cells)| cells.iter().any(|(cell, _)| !cell.is_empty())) {
        let mut line = format!("  {name:<first$}");
        for ((cell, mark), width) in cells.iter().zip(&widths) {
            line.push_str(&format!("{gap}{cell:>width$}{}", if *mark { "*" } else { " " }));
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
    use crate::flight::PerChannel;
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
        let row = |name: &str, value: f64| Row { name: name.into(), predicted: vec![PerChannel::splat(value); windows.len()] };
        let compared = compare(&flights, &windows, &[row("mean of the data", 3.0), row("zero", 0.0)], Part::All)?;
        let (text, short) = (compared.to_string(), compared.in_short().to_string());
        assert!(text.lines().take(6).eq(short.lines().take(6)) && !short.contains("RMSE by"), "{short}");
        assert!(text.starts_with("200 windows of all flights, those used for fitting included, every sample"), "{text}");
        assert!(text.contains("rad/s²") && text.contains("RMSE by manoeuvre") && text.contains("forward"), "{text}");
        let rmse: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("RMSE")).skip(3).take(4).collect();
        assert!(rmse.first().is_some_and(|line| line.matches('*').count() == 7), "{text}");
        assert!(rmse.get(1).is_some_and(|line| line.matches('…').count() == 6), "an interval below each RMSE: {text}");
        assert!(rmse.get(2).is_some_and(|line| line.contains("zero") && !line.contains('*')), "{text}");
        assert!(
            text.contains("RMSE less that of `mean of the data`, with half of the 95 % interval, paired over 10 blocks"),
            "{text}"
        );
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        Ok(())
    }

    #[test]
    fn a_difference_within_chance_gets_no_star_and_one_window_no_figures() -> Result<()> {
        // Which of the two is better changes from block to block (20 samples each).
        let flights = flights(|flight, sample, _| if (sample / 20 + flight) % 2 == 0 { 1.0 } else { -1.0 })?;
        let windows = every_window(&flights);
        let row = |name: &str, value: f64| Row { name: name.into(), predicted: vec![PerChannel::splat(value); windows.len()] };
        let rows = [row("up", 0.5), row("down", -0.52)];
        let found = compare(&flights, &windows, &rows, Part::Test)?;
        let text = found.to_string();
        assert!(found.best.values().all(BTreeMap::is_empty) && found.best_by_regime.is_empty(), "{found:?}");
        assert!(!text.lines().any(|line| line.contains("0.") && line.contains('*')), "{text}");
        // One window of class b.
        let few: Vec<_> = windows.iter().copied().filter(|window| window.flight == 0 || window.last == 7).collect();
        let short = |row: &Row| Row { predicted: vec![row.predicted[0]; few.len()], ..row.clone() };
        let found = compare(&flights, &few, &[short(&rows[0]), short(&rows[1])], Part::Test)?;
        assert_eq!(found.models[0].by_manoeuvre["b"].rmse, ChannelValues::default());
        let text = found.to_string();
        let line = text.lines().find(|line| line.trim_start().starts_with("b "));
        assert!(line.is_some_and(|line| line.matches('–').count() == 2), "{text}");
        Ok(())
    }

    #[test]
    fn many_models_with_long_names_fit_the_terminal_and_one_block_says_so() -> Result<()> {
        let flights = flights(|_, sample, _| (sample % 7) as f64)?;
        let windows: Vec<_> = every_window(&flights).into_iter().take(12).collect();
        let row = |number: usize| Row {
            name: format!("a model with a very long name, number {number}"),
            predicted: vec![PerChannel::splat(number as f64 * 1234.5); windows.len()],
        };
        let rows: Vec<Row> = (1..8).map(row).collect();
        let mut found = compare(&flights, &windows, &rows, Part::All)?;
        found.stride = 20;
        let text = found.to_string();
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains("every 20th sample") && words.contains("(7) a model with") && words.contains("number 7"), "{text}");
        assert!(text.contains("one block of ten seconds: nothing can be said of chance"), "{text}");
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
