//! The page of a benchmark: its tables, the error on each segment of the test flights (figure 6 of the paper), and measured against
//! predicted over one stretch (figures 7 and 8). Every number is one of the tables' files.

use super::figures::{self, LineData};
use super::page::{Cell, Map, MapCell, Page, Part, Section, Table};
use crate::critique::ChannelValues;
use crate::critique::digits::{DIGITS, significant};
use crate::flight::{Channel, Column};
use crate::protocol::table::{self, Finished, TableRow};
use crate::protocol::text::{self, basis, cell, is_best, row_name};
use crate::protocol::{Method, Outcome, Segment};

/// Methods whose lines are drawn; the first is in focus.
const SHOWN: [&str; 4] = ["phyture", "phyture_amended", "cnn_lstm", "physical_baseline"];

/// Networks whose losses are drawn: more lines cannot be told apart.
const MOST_CURVES: usize = 6;

/// A method's errors on one part of the flights.
type Errors = Vec<(&'static Method, ChannelValues)>;

/// The page of what is finished.
pub fn benchmark_page(finished: &Finished) -> Page {
    let tables = finished.tables();
    let mut sections: Vec<Section> =
        tables.iter().map(|table| Section { title: table.title.clone(), parts: table_parts(table) }).collect();
    let manoeuvres = finished.by_part(|segment| segment.manoeuvre.clone());
    if !manoeuvres.is_empty() {
        let parts = vec![Part::Map(map(finished, "by manoeuvre class", |segment| segment.manoeuvre.clone()))];
        sections.push(Section { title: "Error by manoeuvre".into(), parts });
        let name = |segment: &Segment| format!("{} {:.0} s", segment.flight, segment.start_s);
        let parts = vec![Part::Figure(segments_figure(finished, name))];
        sections.push(Section { title: "Error on each segment of the test flights".into(), parts });
    }
    sections.extend(trainings(finished));
    sections.extend(traces(finished));
    Page {
        title: format!("Every method on {}", finished.plan.data),
        summary: text::verdict(finished).into_iter().chain(basis(finished)).collect(),
        first: Vec::new(),
        sections,
    }
}

/// Place of a method's line: those shown first, in their order.
fn rank(method: &Method) -> usize {
    SHOWN.iter().position(|id| *id == method.id).unwrap_or(SHOWN.len())
}

/// Heads of the columns: channels with units, then the mean.
fn channels() -> impl Iterator<Item = (String, String)> {
    Column::TARGETS.into_iter().map(|column| (column.name().to_owned(), column.unit().to_owned()))
}

fn table_parts(table: &table::Table) -> Vec<Part> {
    let columns =
        || [("method".into(), String::new())].into_iter().chain(channels()).chain([("mean".into(), String::new())]).collect();
    let figures = |row: &TableRow| {
        let name = Cell::from(row_name(row));
        let figure = |column: usize| Cell { text: cell(row.cells[column]), best: is_best(table, row, column) };
        [name].into_iter().chain((0..7).map(figure)).collect()
    };
    let mut parts = vec![Part::Table(Table {
        caption: format!("{}. Lowest of each column marked.", table.title),
        columns: columns(),
        rows: table.rows.iter().map(figures).collect(),
    })];
    parts.extend(table.notes().into_iter().map(Part::Text));
    let leads = text::leads(table);
    parts.extend((!leads.is_empty()).then(|| Part::Text(format!("{}: {}.", text::LEADS, leads.join("; ")))));
    let printed = table.rows.iter().filter_map(|row| {
        let figures = row.paper?.map(|value| Cell::from(cell(Some(value))));
        Some([Cell::from(row.title())].into_iter().chain(figures).collect())
    });
    let printed: Vec<Vec<Cell>> = printed.collect();
    if !printed.is_empty() {
        let caption = "As the paper prints it: other flights, another budget.".into();
        parts.push(Part::Table(Table { caption, columns: columns(), rows: printed }));
    }
    parts
}

/// Mean RMSE of every method on every part, shaded.
fn map(finished: &Finished, title: &str, part: impl Fn(&Segment) -> String) -> Map {
    let parts = finished.by_part(part);
    let methods = parts.values().next().into_iter().flatten().map(|(method, _)| (method.name.to_owned(), String::new()));
    let row = |(name, errors): (&String, &Errors)| {
        let cell = |value: Option<f64>| MapCell {
            text: value.map_or_else(|| "–".into(), |value| significant(value, DIGITS)),
            detail: String::new(),
            // Errors of the worst rows are many times those of the best: the shade is their logarithm, from 0.1 to 10.
            value: value.map(|value| ((value.max(1e-9).log10() + 1.0) / 2.0).clamp(0.0, 1.0)),
            before: None,
        };
        (name.clone(), String::new(), errors.iter().map(|(_, error)| cell(error.mean)).collect())
    };
    Map {
        caption: format!("RMSE, mean of the six channels, {title}"),
        shade: "logarithm of the error, from 0.1 to 10".into(),
        full: Some(1.0),
        columns: [("manoeuvre".to_owned(), String::new())].into_iter().chain(methods).collect(),
        rows: parts.iter().map(row).collect(),
    }
}

/// Figure 6: a line a method over the segments.
fn segments_figure(finished: &Finished, part: impl Fn(&Segment) -> String) -> figures::Figure {
    let parts = finished.by_part(part);
    let methods: Vec<_> = parts.values().next().into_iter().flatten().map(|(method, _)| *method).collect();
    let line = |id: &str| {
        let values = |channel: Channel| {
            let of = |errors: &Errors| {
                let found = errors.iter().find(|(method, _)| method.id == id);
                found.and_then(|(_, error)| error.channels()[channel]).unwrap_or(f64::NAN)
            };
            parts.values().map(of).collect::<Vec<f64>>()
        };
        Channel::ALL.into_iter().map(values).collect::<Vec<_>>()
    };
    let number: Vec<f64> = (1..=parts.len()).map(|number| number as f64).collect();
    let mut order: Vec<&Method> = methods.into_iter().filter(|method| SHOWN.contains(&method.id)).collect();
    order.sort_by_key(|method| rank(method));
    let data = |method: &Method| LineData { name: method.name.into(), x: number.clone(), y: line(method.id) };
    let lines: Vec<LineData> = order.into_iter().map(data).collect();
    let panels: Vec<(String, String)> = channels().collect();
    let caption = "RMSE of each method on each segment, in the order of the file figure6.csv, which has those of all methods; mean over seeds.";
    figures::log_lines("RMSE by test segment", caption, "segment", &panels, &lines)
}

/// Losses of each network over its epochs.
fn trainings(finished: &Finished) -> Option<Section> {
    let mut trained = finished.trained();
    trained.sort_by_key(|(method, _)| rank(method));
    let row = |(method, outcomes): &(&'static Method, Vec<&Outcome>)| {
        let joined = |of: &dyn Fn(&Outcome) -> String| outcomes.iter().map(|outcome| of(outcome)).collect::<Vec<_>>().join(", ");
        vec![
            Cell::from(method.name.to_owned()),
            Cell::from(joined(&|outcome| outcome.peak_rate.map_or_else(|| "the plan's".into(), |rate| rate.to_string()))),
            Cell::from(joined(&|outcome| format!("{} of {}", outcome.epoch, outcome.curve.len()))),
            Cell::from(joined(&|outcome| {
                let kept = outcome.epoch.checked_sub(1).and_then(|epoch| outcome.curve.get(epoch)?.validation);
                kept.map_or_else(|| "–".into(), |loss| significant(loss, DIGITS))
            })),
        ]
    };
    let columns = ["network", "learning rate, by seed", "epoch kept", "validation loss there"];
    let table = Table {
        caption: "What each network was trained with, seed by seed".into(),
        columns: columns.map(|name| (name.to_owned(), String::new())).into(),
        rows: trained.iter().map(row).collect(),
    };
    let line = |(method, outcomes): &(&'static Method, Vec<&Outcome>)| {
        let curve = &outcomes.first()?.curve;
        let validation = curve.iter().map(|epoch| epoch.validation.unwrap_or(f64::NAN)).collect();
        Some(LineData {
            name: method.name.into(),
            x: (1..=curve.len()).map(|epoch| epoch as f64).collect(),
            y: vec![curve.iter().map(|epoch| epoch.training).collect(), validation],
        })
    };
    let lines: Vec<LineData> = trained.iter().filter_map(line).filter(|line| line.x.len() > 1).take(MOST_CURVES).collect();
    let mut parts = vec![Part::Table(table)];
    if !lines.is_empty() {
        let panels =
            ["training loss", "validation loss"].map(|name| (name.to_owned(), "Σ of squares over the channels".to_owned()));
        let caption = "Mean over the windows of each epoch, dropout on in training; the first seed of each network.";
        parts.push(Part::Figure(figures::log_lines("Losses by epoch", caption, "epoch", &panels, &lines)));
    }
    (!trained.is_empty()).then(|| Section { title: "How the networks were trained".into(), parts })
}

/// Figures 7 and 8.
fn traces(finished: &Finished) -> Option<Section> {
    let traces: Vec<_> = finished.traces().collect();
    let (_, first) = traces.first()?;
    let mut order: Vec<_> = traces.iter().filter(|(method, _)| SHOWN.contains(&method.id)).collect();
    order.sort_by_key(|(method, _)| rank(method));
    let measured = LineData { name: "measured".into(), x: first.time_s.clone(), y: first.measured.values().to_vec() };
    let predicted = order.into_iter().map(|(method, trace)| LineData {
        name: method.name.into(),
        x: trace.time_s.clone(),
        y: trace.predicted.values().to_vec(),
    });
    let lines: Vec<LineData> = [measured].into_iter().chain(predicted).collect();
    let panels: Vec<(String, String)> = channels().collect();
    let caption =
        "A stretch of the test part; of a network with several seeds, the first. The lines of all methods are in figures7_8.csv.";
    let figure = figures::lines(&format!("Measured and predicted, {}", first.flight), caption, "time, s", &panels, &lines);
    Some(Section { title: "Measured against predicted".into(), parts: vec![Part::Figure(figure)] })
}
