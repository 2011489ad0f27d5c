//! Tables as Markdown, CSV and JSON, and the data of the figures as CSV. Layout alone; the same outcomes give the same bytes.

use super::cell::Cell;
use super::lead::Lead;
use super::outcome::Segment;
use super::plan::Treatment;
use super::table::{Finished, Table, TableRow};
use crate::critique::ChannelValues;
use crate::disk::write_atomically;
use crate::error::{Error, Result};
use crate::flight::Column;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// Decimals of an error, as in the paper.
const DECIMALS: usize = 2;

/// Column heads: the channels with their units, and the mean.
fn heads() -> [String; 7] {
    std::array::from_fn(|column| {
        Column::TARGETS.get(column).map_or_else(|| "mean".to_owned(), |target| format!("{}, {}", target.name(), target.unit()))
    })
}

/// A figure with its deviation; a dash where there is none.
pub fn cell(cell: Option<Cell>) -> String {
    match cell {
        None => "–".to_owned(),
        Some(Cell { mean, deviation: None }) => format!("{mean:.DECIMALS$}"),
        Some(Cell { mean, deviation: Some(deviation) }) => format!("{mean:.DECIMALS$} ± {deviation:.DECIMALS$}"),
    }
}

/// Whether a row has the lowest printed figure of a column among the rows of its measure that compete.
pub fn is_best(table: &Table, row: &TableRow, column: usize) -> bool {
    let printed = |row: &TableRow| row.cells[column].map(|cell| format!("{:.DECIMALS$}", cell.mean));
    let rivals = table.rows.iter().filter(|other| other.competes && other.measure == row.measure && other.cells[column].is_some());
    let lowest = rivals.clone().min_by(|a, b| {
        let mean = |row: &TableRow| row.cells[column].map_or(f64::INFINITY, |cell| cell.mean);
        mean(a).total_cmp(&mean(b))
    });
    row.competes && rivals.count() > 1 && lowest.is_some_and(|lowest| printed(lowest) == printed(row))
}

/// Name of a row with its measure and, where seeds are missing, how many there are.
pub fn row_name(row: &TableRow) -> String {
    let seeds = if row.seeds < row.planned { format!(" ({} of {} seeds)", row.seeds, row.planned) } else { String::new() };
    row.title() + &seeds
}

/// What all tables rest on, one sentence an entry.
pub fn basis(finished: &Finished) -> Vec<String> {
    let plan = &finished.plan;
    let mut sentences = vec![format!("{}.", plan.settings.budget(plan.step_s))];
    let judged = finished.seeds("physical_baseline", Treatment::Plain);
    if let Some(segments) = judged.first().map(|outcome| &outcome.segments) {
        let windows: usize = segments.iter().map(|segment| segment.windows).sum();
        sentences.push(format!("Benchmark division: {windows} test windows in {} segments of at most 10 s.", segments.len()));
    }
    if let Some(trained) = finished.seeds("phyture", Treatment::Plain).first() {
        sentences.push(format!(
            "Every network is trained on the same {} windows with {} steps of Adam; Phy-Ture has {} parameters here.",
            trained.training_windows, trained.steps, trained.parameters
        ));
    }
    let random =
        if plan.settings.seeds > 1 { "mean ± standard deviation over seeds" } else { "one seed, so no deviation is known" };
    sentences.push(format!("Networks: {random}. All networks see the same history and the same inputs."));
    sentences.push(
        "The paper's figures are of other flights (the Stanford set) and its own budget: orders compare, sizes do not.".into(),
    );
    if !finished.missing.is_empty() {
        sentences.push(format!(
            "INCOMPLETE: {} of {} runs are not done.",
            finished.missing.len(),
            finished.missing.len() + finished.done()
        ));
    }
    sentences
}

/// What the comparison comes to, in a sentence for the flights as they are and one with noise: Phy-Ture beside the best peer network and beside the
/// ridge regression.
pub fn verdict(finished: &Finished) -> Vec<String> {
    let one = |(treatment, where_): (Treatment, &str)| {
        let best = finished.over_best_peer(treatment)?;
        let ridge = finished.lead_over("ridge", treatment).map_or_else(String::new, |lead| format!("; {}", told(&lead)));
        Some(format!("{where_}, Phy-Ture's mean error is {}, the best peer network, {}{ridge}.", told(&best), best.claim()))
    };
    [(Treatment::Plain, "On the flights as they are"), (Treatment::StateNoise, "With noise on the states")]
        .into_iter()
        .filter_map(one)
        .collect()
}

/// What [`leads`] are.
pub const LEADS: &str =
    "Phy-Ture's mean error beside each other row's, 95 % interval over segments of flight, paired, and over seeds";

/// Phy-Ture beside each other row, in words.
pub fn leads(table: &Table) -> Vec<String> {
    table.leads.iter().map(told).collect()
}

/// A lead in words, in the direction in which it is.
fn told(lead: &Lead) -> String {
    let interval = |ends: Option<[f64; 2]>, decimals: usize| {
        ends.map_or_else(String::new, |[low, high]| format!(" [{low:.decimals$}, {high:.decimals$}]").replace('-', "−"))
    };
    let Lead { percent, percent_ci95, over_name, .. } = lead;
    if *percent <= -100.0 {
        let times = |percent: f64| 1.0 - percent / 100.0;
        let ends = percent_ci95.map(|[low, high]| [times(high), times(low)]);
        return format!("{:.1} times{} that of {over_name}", times(*percent), interval(ends, 1));
    }
    if *percent < 0.0 {
        let ends = percent_ci95.map(|[low, high]| [-high, -low]);
        return format!("{:.0} %{} above {over_name}", -percent, interval(ends, 0));
    }
    format!("{percent:.0} %{} below {over_name}", interval(*percent_ci95, 0))
}

/// A table as Markdown, the paper's rows below it.
pub fn markdown(finished: &Finished, table: &Table) -> String {
    let mut text = format!("# {}\n\n", table.title);
    for sentence in verdict(finished) {
        let _ = writeln!(text, "{sentence}");
    }
    for sentence in basis(finished) {
        let _ = writeln!(text, "{sentence}");
    }
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head: Vec<String> = ["method".to_owned()].into_iter().chain(heads()).collect();
    let rule: Vec<String> = head.iter().enumerate().map(|(index, _)| if index == 0 { "---" } else { "---:" }.to_owned()).collect();
    text.push('\n');
    text += &line(&head);
    text += &line(&rule);
    for row in &table.rows {
        let figure = |column: usize| {
            let figure = cell(row.cells[column]);
            if is_best(table, row, column) { format!("**{figure}**") } else { figure }
        };
        text += &line(&[row_name(row)].into_iter().chain((0..7).map(figure)).collect::<Vec<_>>());
    }
    let notes: String = table.notes().iter().map(|note| format!("- {note}\n")).collect();
    if !notes.is_empty() {
        let _ = write!(text, "\n{notes}");
    }
    let leads: String = leads(table).iter().map(|lead| format!("- {lead}\n")).collect();
    if !leads.is_empty() {
        let _ = write!(text, "\n{LEADS}:\n\n{leads}");
    }
    if table.rows.iter().any(|row| row.paper.is_some()) {
        text += "\nAs the paper prints it:\n\n";
        text += &line(&head);
        text += &line(&rule);
        for row in &table.rows {
            if let Some(paper) = row.paper {
                let figures = paper.map(|value| cell(Some(value)));
                text += &line(&[row.title()].into_iter().chain(figures).collect::<Vec<_>>());
            }
        }
    }
    text
}

/// A table as CSV: mean, deviation and the paper's figure of each channel.
fn csv(table: &Table) -> String {
    let names: Vec<&str> = Column::TARGETS.iter().map(|column| column.name()).chain(["mean"]).collect();
    let columns = names.iter().flat_map(|name| [(*name).to_owned(), format!("{name}_sd"), format!("{name}_paper")]);
    let mut text = format!("method,name,measure,seeds,{}\n", columns.collect::<Vec<_>>().join(","));
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for row in &table.rows {
        let figures = (0..7).flat_map(|column| {
            let cell = row.cells[column];
            [cell.map(|cell| cell.mean), cell.and_then(|cell| cell.deviation), row.paper.map(|paper| paper[column].mean)]
        });
        let figures: Vec<String> = figures.map(number).collect();
        let _ = writeln!(text, "{},{},{},{},{}", row.method, quoted(&row.name), row.measure, row.seeds, figures.join(","));
    }
    text
}

/// A field of CSV (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Errors of every method on each part of the test flights.
fn parts_csv(first: &str, finished: &Finished, part: impl Fn(&Segment) -> String) -> String {
    let names: Vec<&str> = Column::TARGETS.iter().map(|column| column.name()).chain(["mean"]).collect();
    let mut text = format!("{first},method,{}\n", names.join(","));
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for (part, methods) in finished.by_part(part) {
        for (method, error) in methods {
            let ChannelValues { mean, .. } = error;
            let figures: Vec<String> = error.channels().into_iter().chain([mean]).map(number).collect();
            let _ = writeln!(text, "{part},{},{}", method.id, figures.join(","));
        }
    }
    text
}

/// Measured and predicted over one stretch (figures 7 and 8): a row a sample, a column a channel and method; seed 1 of each network.
fn traces_csv(finished: &Finished) -> String {
    let traces: Vec<_> = finished.traces().collect();
    let Some((_, first)) = traces.first() else { return String::new() };
    let names =
        |source: &str| Column::TARGETS.iter().map(|column| format!("{source}_{}", column.name())).collect::<Vec<_>>().join(",");
    let heads: Vec<String> = ["measured"].into_iter().chain(traces.iter().map(|(method, _)| method.id)).map(names).collect();
    let mut text = format!("flight,time_s,{}\n", heads.join(","));
    for (sample, time_s) in first.time_s.iter().enumerate() {
        let columns = [&first.measured].into_iter().chain(traces.iter().map(|(_, trace)| &trace.predicted)).flatten();
        let values: Vec<String> =
            columns.map(|column| column.get(sample).map_or_else(String::new, |value| value.to_string())).collect();
        let _ = writeln!(text, "{},{time_s},{}", quoted(&first.flight), values.join(","));
    }
    text
}

/// Writes `TABLE.md`, `TABLE.csv`, `tables.json` and the data of the figures into `folder`, which exists.
///
/// # Errors
/// [`Error::Io`].
pub fn write(finished: &Finished, folder: &Path) -> Result<()> {
    #[derive(Serialize)]
    struct Everything<'a> {
        basis: Vec<String>,
        plan: &'a super::plan::Plan,
        tables: &'a [Table],
        missing: Vec<String>,
    }
    let put = |name: &str, text: &str| write_atomically(folder.join(name), |file| file.write_all(text.as_bytes()));
    let tables = finished.tables();
    for table in &tables {
        put(&format!("{}.md", table.id), &markdown(finished, table))?;
        put(&format!("{}.csv", table.id), &csv(table))?;
    }
    put("by_manoeuvre.csv", &parts_csv("manoeuvre", finished, |segment| quoted(&segment.manoeuvre)))?;
    let segment = |segment: &Segment| format!("{},{},{}", quoted(&segment.manoeuvre), quoted(&segment.flight), segment.start_s);
    put("figure6.csv", &parts_csv("manoeuvre,flight,start_s", finished, segment))?;
    put("figures7_8.csv", &traces_csv(finished))?;
    let everything = Everything {
        basis: basis(finished),
        plan: &finished.plan,
        tables: &tables,
        missing: finished.missing.iter().map(ToString::to_string).collect(),
    };
    let json = serde_json::to_string_pretty(&everything).map_err(|error| Error::Undetermined(error.to_string()))?;
    put("tables.json", &(json + "\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, mean: f64, competes: bool) -> TableRow {
        TableRow {
            method: name.replace(", ", "_"),
            name: name.into(),
            measure: "RMSE",
            note: None,
            cells: [Cell::of(&[mean]); 7],
            seeds: 1,
            planned: 2,
            competes,
            paper: Some([Cell { mean: 1.0, deviation: None }; 7]),
        }
    }

    #[test]
    fn the_lowest_that_competes_is_the_best_and_ties_share_it() {
        let rows = vec![row("a", 0.501, true), row("b", 0.499, true), row("c", 0.4, false), row("d, e", 0.6, true)];
        let table = Table { id: "t".into(), title: "t".into(), rows, leads: Vec::new() };
        let best: Vec<bool> = table.rows.iter().map(|row| is_best(&table, row, 3)).collect();
        assert_eq!(best, [true, true, false, false], "0.501 and 0.499 print alike");
        assert_eq!(row_name(&table.rows[0]), "a (1 of 2 seeds)");
        let csv = csv(&table);
        assert!(csv.lines().all(|line| line.matches(',').count() == 24 + usize::from(line.contains("\"d, e\""))), "{csv}");
    }

    #[test]
    fn a_lead_is_told_in_the_direction_in_which_it_is() {
        let lead = |percent: f64, ends: [f64; 2]| Lead {
            of: "phyture".into(),
            over: "ridge".into(),
            over_name: "Ridge".into(),
            percent,
            percent_ci95: Some(ends),
        };
        let of = vec![lead(42.0, [-5.2, 48.0]), lead(-80.0, [-95.0, -64.0]), lead(-738.0, [-770.0, -695.0])];
        let table = Table { id: "t".into(), title: "t".into(), rows: Vec::new(), leads: of };
        assert_eq!(leads(&table), ["42 % [−5, 48] below Ridge", "80 % [64, 95] above Ridge", "8.4 times [8.0, 8.7] that of Ridge"]);
    }

    #[test]
    fn figures_have_the_papers_digits() {
        assert_eq!(cell(Cell::of(&[1.0, 1.1, 1.2])), "1.10 ± 0.10");
        assert_eq!((cell(Cell::of(&[0.456])), cell(None)), ("0.46".into(), "–".into()));
    }
}
