//! The page of `rollout`: errors over the horizon in pictures and tables. Arranges the numbers of [`Rollouts`]; computes none of its own.

use super::figures::{LineData, lines};
use super::page::{Cell, DATA_NOTE, Page, Part, Section, Table, data_notes};
use crate::critique::digits::significant;
use crate::critique::rollout::{POSITION_FROM_VELOCITY, Quantity, RolloutError, RolloutRow, Rollouts};
use crate::critique::table::OWN_FROM_FIRST_HALF;

/// The page of one set of rollouts; `provenance` says where the numbers come from: (what, value).
pub fn rollout_page(rollouts: &Rollouts, provenance: &[(String, String)]) -> Page {
    let mut sections = vec![Section { title: "Errors by step".into(), parts: error_tables(rollouts) }];
    if rollouts.rows.first().is_some_and(|row| row.by_manoeuvre.len() > 1) {
        let classes = format!("{} classes", rollouts.rows[0].by_manoeuvre.len());
        let parts = vec![Part::Details(classes, manoeuvre_tables(rollouts))];
        sections.push(Section { title: "By manoeuvre".into(), parts });
    }
    let rows = provenance.iter().filter(|(what, _)| what != DATA_NOTE);
    let rows = rows.map(|(what, value)| vec![Cell::from(what.clone()), Cell::from(value.clone())]).collect();
    let columns = vec![(String::new(), String::new()), (String::new(), String::new())];
    let mut parts = vec![Part::Table(Table { caption: "Provenance".into(), columns, rows })];
    parts.extend(data_notes(provenance));
    sections.push(Section { title: "Where these numbers come from".into(), parts });
    let focus = rollouts.rows.last().map_or("", |row| row.name.as_str());
    Page {
        title: format!("Open-loop prediction: {focus}"),
        summary: summary(rollouts),
        first: vec![Part::Figure(figure(rollouts))],
        sections,
    }
}

/// The verdict in words.
fn summary(rollouts: &Rollouts) -> Vec<String> {
    let mut out = vec![format!("{}.", rollouts.basis())];
    out.extend(rollouts.own_from_first_half.then(|| OWN_FROM_FIRST_HALF.to_owned()));
    out.extend(rollouts.position_from_velocity.then(|| POSITION_FROM_VELOCITY.to_owned()));
    out.extend(rollouts.caution());
    let basis = out.len();
    for row in rollouts.rows.iter().filter(|row| row.name != rollouts.relative_to).skip(1) {
        let says = |quantity: Quantity| {
            let percent = (*row.whole.difference_percent.of(quantity))?;
            let chance = (*row.whole.difference_percent_ci95.of(quantity)).is_none_or(|[low, high]| low <= 0.0 && high >= 0.0);
            let size = format!("{:.0} % {}", percent.abs(), if percent < 0.0 { "less" } else { "more" });
            let size = if percent.abs() < 0.5 { "as much".to_owned() } else { size };
            Some(format!(
                "{size} in {}{}",
                quantity.name(),
                if chance && percent.abs() >= 0.5 { " (within its interval)" } else { "" }
            ))
        };
        let found: Vec<String> = Quantity::ALL.into_iter().filter_map(says).collect();
        let (name, other) = (&row.name, &rollouts.relative_to);
        out.push(format!("The errors of {name}, summed over the horizon, beside {other}: {}.", found.join(", ")));
    }
    // The last row is the one in focus: its errors are the verdict.
    if out.len() > basis
        && let Some(verdict) = out.pop()
    {
        out.insert(0, verdict);
    }
    for row in rollouts.rows.iter().filter(|row| row.whole.diverged > 0) {
        let (diverged, n) = (row.whole.diverged, row.whole.n);
        out.push(format!(
            "Beware: {diverged} of {n} rollouts of {} diverged; their states stay where they left the bounds.",
            row.name
        ));
    }
    out
}

fn figure(rollouts: &Rollouts) -> super::Figure {
    let time: Vec<f64> = (0..=rollouts.horizon).map(|step| step as f64 * rollouts.step_s).collect();
    let line = |row: &RolloutRow| LineData {
        name: row.name.clone(),
        x: time.clone(),
        y: Quantity::ALL.map(|quantity| [0.0].iter().chain(row.error.of(quantity)).copied().collect()).into(),
    };
    // The yardstick of no change in black, the last row wide.
    let mut order: Vec<&RolloutRow> = rollouts.rows.iter().collect();
    if order.len() > 1
        && let Some(focus) = order.pop()
    {
        order.insert(1, focus);
    }
    let panels = Quantity::ALL.map(|quantity| (quantity.name().to_owned(), quantity.unit().to_owned()));
    let caption = "Mean size of the error over all starts.";
    let data: Vec<LineData> = order.into_iter().map(line).collect();
    lines("Error over the horizon", caption, "time from the start, s", &panels, &data)
}

fn error_tables(rollouts: &Rollouts) -> Vec<Part> {
    let shown = rollouts.shown();
    let table = |quantity: Quantity| {
        let unit = quantity.unit();
        let mut columns = vec![("predictor".to_owned(), String::new())];
        columns.extend(shown.iter().map(|step| (format!("h = {step}"), unit.to_owned())));
        columns.push((format!("sum 1 … {}", rollouts.horizon), unit.to_owned()));
        columns.push((format!("against {}", rollouts.relative_to), "%".to_owned()));
        columns.extend([("Theil's U".to_owned(), String::new()), ("diverged".to_owned(), String::new())]);
        let row = |row: &RolloutRow| {
            let at = |step: &usize| Cell::from(significant(row.error.of(quantity)[step - 1], 3));
            let theil = (*row.whole.theil.of(quantity)).map_or_else(|| "–".to_owned(), |value| format!("{value:.3}"));
            let rest = [sum(&row.whole, quantity), row.whole.difference_text(quantity), theil, row.whole.diverged.to_string()];
            [Cell::from(row.name.clone())].into_iter().chain(shown.iter().map(at)).chain(rest.map(Cell::from)).collect()
        };
        let caption = format!("Error in {}", quantity.name());
        Part::Table(Table { caption, columns, rows: rollouts.rows.iter().map(row).collect() })
    };
    let mut parts: Vec<Part> = Quantity::ALL.into_iter().map(table).collect();
    parts.push(Part::Text(rollouts.legend()));
    parts
}

fn manoeuvre_tables(rollouts: &Rollouts) -> Vec<Part> {
    let Some(first) = rollouts.rows.first() else { return Vec::new() };
    let table = |class: &String| {
        let mut columns = vec![("predictor".to_owned(), String::new()), ("starts".to_owned(), String::new())];
        columns.extend(Quantity::ALL.map(|quantity| (format!("sum, {}", quantity.name()), quantity.unit().to_owned())));
        columns.push(("diverged".to_owned(), String::new()));
        let row = |row: &RolloutRow| {
            let part = row.by_manoeuvre.get(class)?;
            let sums = Quantity::ALL.map(|quantity| sum(part, quantity));
            let cells = [row.name.clone(), part.n.to_string()].into_iter().chain(sums).chain([part.diverged.to_string()]);
            Some(cells.map(Cell::from).collect())
        };
        let rows = rollouts.rows.iter().filter_map(row).collect();
        Part::Table(Table { caption: format!("{class}, sums over 1 … {}", rollouts.horizon), columns, rows })
    };
    first.by_manoeuvre.keys().map(table).collect()
}

/// The sum with its interval.
fn sum(error: &RolloutError, quantity: Quantity) -> String {
    let value = significant(*error.sum.of(quantity), 3);
    match *error.sum_ci95.of(quantity) {
        Some([low, high]) => format!("{value} [{}, {}]", significant(low, 3), significant(high, 3)),
        None => value,
    }
}
