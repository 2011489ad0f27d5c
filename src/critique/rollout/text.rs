//! Errors by step as text for a person at a terminal. Only layout; every number comes from [`Rollouts`].

use super::{Quantity, RolloutError, RolloutRow, Rollouts};
use crate::blocks::FEW_BLOCKS;
use crate::critique::digits::{Kind, aligned, significant};
use crate::critique::table::{OWN_FROM_FIRST_HALF, ordinal};
use crate::critique::wrap::{WIDTH, clipped, wrapped};
use crate::flight::split::Part;
use std::fmt;

/// Widest name of a row.
const NAME: usize = 22;

impl Rollouts {
    /// One sentence on what was rolled out.
    pub fn basis(&self) -> String {
        let part = match self.split {
            Part::Locked => "the locked flights",
            Part::Test => "the test part",
            Part::All => "all flights, those used for fitting included",
        };
        let every = match self.stride {
            0 | 1 => "every sample".to_owned(),
            stride => format!("every {stride}{} sample", ordinal(stride)),
        };
        let starts = self.rows.first().map_or(0, |row| row.whole.n);
        let seconds = significant(self.horizon as f64 * self.step_s, 3);
        format!(
            "{starts} starts in {part}, {every}; {} steps of {} s, {seconds} s in all, under the measured controls",
            self.horizon, self.step_s
        )
    }

    /// What so few blocks of ten seconds can say, if they are few.
    pub fn caution(&self) -> Option<String> {
        match self.rows.first().map_or(0, |row| row.whole.blocks) {
            0 => None,
            1 => {
                Some("All starts lie in one block of ten seconds: nothing can be said of chance, so there are no intervals.".into())
            }
            blocks if blocks < FEW_BLOCKS => {
                Some(format!("The starts lie in {blocks} blocks of ten seconds: the intervals are a rough guide."))
            }
            _ => None,
        }
    }

    /// The steps that a table shows: the first, the tenth and the last of fifty; of another horizon the first, the one after a fifth of it, and the last.
    pub fn shown(&self) -> Vec<usize> {
        let mut steps = vec![1, self.horizon / 5, self.horizon];
        steps.retain(|step| *step > 0);
        steps.dedup();
        steps
    }

    /// What the sums and marks mean.
    pub fn legend(&self) -> String {
        format!(
            "Sizes of errors, mean over starts: Euclidean norm of the differences in position, velocity (north-east-down) and body rates, angle \
             between attitudes. Sum: over the steps 1 … {}. U: Theil's inequality coefficient, position and attitude counted from the start. \
             Less or more: sum against that of `{}`, paired. Intervals are 95 %, from blocks of ten seconds. A start that is faster than {} m/s \
             or {} rad/s or not finite has diverged; its state stays there.",
            self.horizon, self.relative_to, self.most_speed_m_s, self.most_rate_rad_s
        )
    }

    fn quantity_table(&self, f: &mut fmt::Formatter<'_>, quantity: Quantity) -> fmt::Result {
        let shown = self.shown();
        let titles: Vec<String> = shown.iter().map(|step| format!("h = {step}")).collect();
        let unit = quantity.unit();
        let mut heads: Vec<(&str, &str)> = titles.iter().map(|title| (title.as_str(), unit)).collect();
        heads.extend([("sum", unit), ("interval", unit), ("less or more", "%"), ("U", ""), ("diverged", "")]);
        let cells = |row: &RolloutRow| {
            let at = |step: &usize| significant(row.error.of(quantity)[step - 1], 3);
            let mut cells: Vec<String> = shown.iter().map(at).collect();
            cells.push(significant(*row.whole.sum.of(quantity), 3));
            cells.push(interval(*row.whole.sum_ci95.of(quantity)));
            cells.push(row.whole.difference_text(quantity));
            cells.push(Kind::Share.text(*row.whole.theil.of(quantity)));
            cells.push(row.whole.diverged.to_string());
            (clipped(&row.name, NAME), cells)
        };
        let mut rows: Vec<(String, Vec<String>)> = self.rows.iter().map(cells).collect();
        if wide(&heads, &rows) > WIDTH {
            // Of very large or small numbers; the interval is in the JSON and on the page.
            let interval = shown.len() + 1;
            heads.remove(interval);
            rows.iter_mut().for_each(|(_, cells)| drop(cells.remove(interval)));
        }
        writeln!(f, "\n{} error", capital(quantity.name()))?;
        aligned(f, &heads, &rows)
    }

    fn manoeuvre_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = self.rows.first().filter(|row| row.by_manoeuvre.len() > 1) else { return Ok(()) };
        let titles = Quantity::ALL.map(|quantity| format!("sum {}", quantity.letter()));
        let mut heads: Vec<(&str, &str)> = vec![("starts", "")];
        heads.extend(titles.iter().zip(Quantity::ALL).map(|(title, quantity)| (title.as_str(), quantity.unit())));
        heads.push(("diverged", ""));
        for class in first.by_manoeuvre.keys() {
            let of = |row: &RolloutRow| {
                let part = row.by_manoeuvre.get(class)?;
                let sums = Quantity::ALL.map(|quantity| significant(*part.sum.of(quantity), 3));
                let cells = [part.n.to_string()].into_iter().chain(sums).chain([part.diverged.to_string()]).collect();
                Some((clipped(&row.name, NAME), cells))
            };
            writeln!(f, "\nManoeuvre {class}, sums over 1 … {}", self.horizon)?;
            aligned(f, &heads, &self.rows.iter().filter_map(of).collect::<Vec<_>>())?;
        }
        Ok(())
    }
}

/// `10.1…10.5`; empty where there is none.
fn interval(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(|| "–".to_owned(), |[low, high]| format!("{}…{}", significant(low, 3), significant(high, 3)))
}

impl RolloutError {
    /// How much larger the sum is than that of the reference, %, with its interval: `-12.3 (-15.0…-9.8)`.
    pub fn difference_text(&self, quantity: Quantity) -> String {
        let Some(percent) = *self.difference_percent.of(quantity) else { return "–".to_owned() };
        match *self.difference_percent_ci95.of(quantity) {
            Some([low, high]) if signed(low) != signed(high) => format!("{} ({}…{})", signed(percent), signed(low), signed(high)),
            _ => signed(percent),
        }
    }
}

/// Percent with a sign and one decimal; in powers of ten from a thousand on.
fn signed(percent: f64) -> String {
    match percent.abs() {
        // Without the sign of a rounding error.
        0.0..0.05 => "0.0".to_owned(),
        0.05..1000.0 => format!("{percent:+.1}"),
        _ => format!("{percent:+.1e}"),
    }
}

/// Width of a table as [`aligned`] writes it.
fn wide(heads: &[(&str, &str)], rows: &[(String, Vec<String>)]) -> usize {
    let wide = |text: &str| text.chars().count();
    let first = rows.iter().map(|(name, _)| wide(name)).max().unwrap_or(0);
    let column = |(column, head): (usize, &(&str, &str))| {
        let cells = rows.iter().filter_map(|(_, cells)| cells.get(column)).map(|cell| wide(cell));
        2 + cells.chain([wide(head.0), wide(head.1)]).max().unwrap_or(0)
    };
    2 + first + heads.iter().enumerate().map(column).sum::<usize>()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Said where some flight has no position.
pub const POSITION_FROM_VELOCITY: &str =
    "No position in the log of some flights: the way that the recorded velocity makes stands for it.";

impl fmt::Display for Rollouts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", wrapped("", &self.basis()))?;
        if self.own_from_first_half {
            writeln!(f, "{}", wrapped("", OWN_FROM_FIRST_HALF))?;
        }
        if self.position_from_velocity {
            writeln!(f, "{}", wrapped("", POSITION_FROM_VELOCITY))?;
        }
        if let Some(caution) = self.caution() {
            writeln!(f, "{}", wrapped("", &caution))?;
        }
        Quantity::ALL.into_iter().try_for_each(|quantity| self.quantity_table(f, quantity))?;
        self.manoeuvre_table(f)?;
        writeln!(f, "\n{}", wrapped("", &self.legend()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PerQuantity, RolloutError};
    use super::*;
    use std::collections::BTreeMap;

    fn row(name: &str, size: f64) -> RolloutRow {
        let whole = RolloutError {
            n: 1234,
            blocks: 20,
            diverged: 1234,
            sum: PerQuantity::new(|_| 50.0 * size),
            sum_ci95: PerQuantity::new(|_| Some([45.0 * size, 55.0 * size])),
            theil: PerQuantity::new(|_| Some(0.98765)),
            difference_percent: PerQuantity::new(|_| Some(-size)),
            difference_percent_ci95: PerQuantity::new(|_| Some([-1.1 * size, 1.1 * size])),
        };
        RolloutRow {
            name: name.into(),
            error: PerQuantity::new(|_| vec![size; 50]),
            by_manoeuvre: BTreeMap::from([("hover".to_owned(), whole.clone()), ("chaos".to_owned(), whole.clone())]),
            whole,
        }
    }

    #[test]
    fn tables_fit_the_terminal_whatever_the_numbers_and_name_steps_and_units() {
        let long = "a model with a very long name, rates held";
        let of = |size: f64, horizon: usize| Rollouts {
            horizon,
            step_s: 0.01,
            stride: 2,
            split: Part::Locked,
            own_from_first_half: true,
            position_from_velocity: true,
            most_speed_m_s: 200.0,
            most_rate_rad_s: 100.0,
            relative_to: long.into(),
            rows: vec![row("state held", size), row(long, size)],
        };
        for size in [1e-9, 0.0123456, 5.0, 123.456, 9.87654e7] {
            let text = of(size, 50).to_string();
            assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
            assert!(
                text.contains("1234 starts in the locked flights, every 2nd sample; 50 steps of 0.01 s, 0.500 s in all"),
                "{text}"
            );
            assert!(text.contains("h = 10") && text.contains("Manoeuvre chaos") && text.contains("rad/s"), "{text}");
        }
        assert_eq!(of(1.0, 50).shown(), [1, 10, 50]);
        assert_eq!((of(1.0, 4).shown(), of(1.0, 1).shown()), (vec![1, 4], vec![1]));
        assert_eq!([-1e-12, -2.04, 351.93, 12345.6].map(signed), ["0.0", "-2.0", "+351.9", "+1.2e4"]);
    }
}
