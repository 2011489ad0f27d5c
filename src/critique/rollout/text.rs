//! Errors by step as text for a person at a terminal. Only layout; every number comes from [`Rollouts`].

use super::{Quantity, RolloutError, RolloutRow, Rollouts};
use crate::critique::digits::{Kind, aligned, significant};
use crate::critique::table::{OWN_FROM_FIRST_HALF, ordinal};
use crate::critique::wrap::{clipped, wrapped};
use crate::flight::split::Part;
use std::fmt;

/// Widest name of a row.
const NAME: usize = 26;

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
        writeln!(f, "\n{} error", capital(quantity.name()))?;
        aligned(f, &heads, &self.rows.iter().map(cells).collect::<Vec<_>>())
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
        let signed = |value: f64| format!("{value:+.1}");
        match *self.difference_percent_ci95.of(quantity) {
            Some([low, high]) if low < high => format!("{} ({}…{})", signed(percent), signed(low), signed(high)),
            _ => signed(percent),
        }
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

impl fmt::Display for Rollouts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", wrapped("", &self.basis()))?;
        if self.own_from_first_half {
            writeln!(f, "{}", wrapped("", OWN_FROM_FIRST_HALF))?;
        }
        Quantity::ALL.into_iter().try_for_each(|quantity| self.quantity_table(f, quantity))?;
        self.manoeuvre_table(f)?;
        writeln!(f, "\n{}", wrapped("", &self.legend()))
    }
}
