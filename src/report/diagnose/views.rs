//! Pictures of flights: measured and predicted, where the error lies, regions, and how long what is left lasts.
//!
//! Predicts each flight once with both models; the numbers are those of `compare`, `locate` and `residual_views`. What goes with recorded
//! variables is in `residuals.rs`.

use super::super::compare::{Lines, USE, channel_columns, maps, trace_figure, traces};
use super::super::figures::{self, Fall, FallPanel, Kind, LineData};
use super::super::names::{channel_panels, named, said};
use super::super::page::{Cell, Map, MapCell, Part, Table};
use super::DiagnoseReport;
use crate::critique::digits::significant;
use crate::critique::locate::stretches;
use crate::critique::predictions::deviation;
use crate::critique::residual_views::{Region, StickCorrelation, autocorrelation, regions, spectrum, stick_correlations};
use crate::critique::unknown::{ROWS_MAX, ResidualTable};
use crate::critique::{Row, compare as errors};
use crate::error::{Error, Result};
use crate::flight::windows::windows;
use crate::flight::{Accelerations, Channel, Column, PerChannel, Span, Window, split};

/// Samples that maps and binned residuals look at, at most; of more every k-th is taken.
const SAMPLES: usize = 150_000;
/// Length of a block, s, as in all intervals of a report.
const BLOCK_S: f64 = 10.0;

/// One model on all flights.
pub(super) struct Side {
    pub name: &'static str,
    pub predicted: Vec<Accelerations>,
    pub table: Option<ResidualTable>,
}

pub(super) struct Seen<'a> {
    pub report: &'a DiagnoseReport<'a>,
    /// Before, and after if something was added.
    pub sides: Vec<Side>,
}

/// The parts of the sections of [`super::VIEWS`].
pub(super) fn views(report: &DiagnoseReport<'_>) -> Result<[Vec<Part>; 6]> {
    let shape = |message: String| Error::Shape { operation: "report", message };
    for span in report.searched.iter().chain(report.locked) {
        let inside = report.flights.get(span.flight).is_some_and(|flight| span.start <= span.end && span.end <= flight.len());
        if !inside {
            return Err(shape(format!("span {span:?} lies outside the {} flights", report.flights.len())));
        }
    }
    let amended = report.added().next().is_some();
    let models = [("model before", report.before), ("model after", report.after)];
    let mut sides = Vec::new();
    for (name, model) in models.into_iter().take(1 + usize::from(amended)) {
        let predicted = report.flights.iter().map(|flight| model.predict(flight)).collect::<Result<Vec<_>>>()?;
        let residual = |flight: usize| -> Result<Accelerations> {
            let known = report.flights.get(flight).zip(predicted.get(flight));
            let (flight, predicted) = known.ok_or_else(|| shape(format!("there is no flight {flight}")))?;
            Ok(PerChannel::from_fn(|channel| {
                flight.column(channel.column()).iter().zip(&predicted[channel]).map(|(y, p)| y - p).collect()
            }))
        };
        // Too few rows, or a model that fails somewhere: the views that need the table say so.
        let table = match ResidualTable::new(report.flights, report.searched, &residual, BLOCK_S, ROWS_MAX) {
            Err(Error::Undetermined(_)) => None,
            table => Some(table?),
        };
        sides.push(Side { name: if amended { name } else { "model" }, predicted, table });
    }
    let seen = Seen { report, sides };
    Ok([seen.traces()?, seen.maps()?, seen.binned()?, seen.surface()?, seen.regions()?, seen.time()?])
}

pub(super) fn text(words: &str) -> Part {
    Part::Text(words.into())
}

impl Seen<'_> {
    /// Every k-th sample of some spans, so that there are at most [`SAMPLES`].
    pub fn windows(&self, spans: &[Span]) -> (Vec<Window>, usize) {
        let samples: usize = spans.iter().map(|span| span.end - span.start).sum();
        let stride = samples.div_ceil(SAMPLES).max(1);
        (windows(spans, 1, stride), stride)
    }

    pub fn row(&self, side: &Side, windows: &[Window]) -> Row {
        let at = |window: &Window| PerChannel::from_fn(|channel| side.predicted[window.flight][channel][window.last]);
        Row { name: side.name.into(), predicted: windows.iter().map(at).collect() }
    }

    fn rows(&self, windows: &[Window]) -> Vec<Row> {
        self.sides.iter().map(|side| self.row(side, windows)).collect()
    }

    /// Measured and predicted where no search has looked; by all that were compared, where they were.
    fn traces(&self) -> Result<Vec<Part>> {
        let report = self.report;
        if let Some(compared) = report.compared {
            return traces(compared);
        }
        let windows = windows(report.locked, 1, 1);
        if windows.is_empty() {
            return Ok(vec![text("No flights were kept from the search: there is nothing to show that it has not seen.")]);
        }
        let rows = self.rows(&windows);
        let Some(found) = rows.first().map(|row| stretches(report.flights, &windows, row)).transpose()?.flatten() else {
            return Ok(vec![text("No stretch to show: no measured channel varies.")]);
        };
        let lines = Lines { flights: report.flights, windows: &windows, rows: &rows, focus: rows.len() - 1, yardstick: None };
        let mut parts = vec![Part::Text(format!(
            "The part that no search has seen. Look for where the prediction leaves the measured line for longer than a gust lasts. {}",
            USE
        ))];
        for (title, stretch) in [("Worst ten seconds of the model before", found.worst), ("Typical ten seconds", found.typical)] {
            parts.push(Part::Figure(trace_figure(title, &lines, &stretch)));
        }
        Ok(parts)
    }

    /// Where the error lies.
    fn maps(&self) -> Result<Vec<Part>> {
        let report = self.report;
        let all: Vec<Span> = report.searched.iter().chain(report.locked).copied().collect();
        let (windows, stride) = self.windows(&all);
        if windows.is_empty() {
            return Ok(vec![text("There are no flights to look at.")]);
        }
        let comparison = errors(report.flights, &windows, &self.rows(&windows), split::Part::All)?;
        let deviation = deviation(report.flights, &windows)?;
        let [before, after] = [comparison.models.first(), comparison.models.get(1)];
        let (before, model) = if after.is_some() { (before, after) } else { (None, before) };
        let Some(model) = model else { return Ok(Vec::new()) };
        let every = if stride > 1 { format!(" Every {stride}th sample is taken.") } else { String::new() };
        let mut parts = vec![Part::Text(format!("All flights, searched and not.{every}"))];
        parts.extend(maps(before, model, &deviation));
        Ok(parts)
    }

    /// The residual of the model before, on the searched flights.
    pub fn table(&self) -> Option<&ResidualTable> {
        self.sides.first().and_then(|side| side.table.as_ref())
    }

    /// Regions of flight with much of the error that is left, as one picture.
    fn regions(&self) -> Result<Vec<Part>> {
        let last = self.sides.iter().rev().find_map(|side| Some((side.name, side.table.as_ref()?)));
        let Some((name, table)) = last else { return Ok(vec![text(NO_TABLE)]) };
        let (mut even, mut panels) = (Vec::new(), Vec::new());
        for channel in Channel::ALL {
            let tree = regions(table, channel)?;
            if tree.is_even() {
                even.push(said(channel.name()));
                continue;
            }
            let mut bars = vec![bar_of("all flights".into(), &tree)];
            bars.extend(tree.by_rule().into_iter().map(|(rules, leaf)| bar_of(rules, leaf)));
            panels.push(FallPanel { title: named(channel.name()), unit: channel.unit().to_owned(), bars, floor: None });
        }
        let mut parts = Vec::new();
        if !panels.is_empty() {
            let caption = format!(
                "RMSE of the {name} on the searched flights, parted by simple rules so that the error differs from part to part; in brackets the \
                 share of the channel's error and, behind it, of the time. A part with a larger share of the error than of the time is where the \
                 model lacks something, or the air is rougher."
            );
            parts.push(Part::Figure(figures::falls("Regions of flight", &caption, &panels)));
        }
        if !even.is_empty() {
            let even = even.join(", ");
            parts.push(Part::Text(format!("The error of {even} is even: no rule finds a region in which it is a quarter larger.")));
        }
        Ok(parts)
    }

    /// How long it lasts, its spectrum, and the sticks.
    fn time(&self) -> Result<Vec<Part>> {
        let Some(table) = self.table() else { return Ok(vec![text(NO_TABLE)]) };
        let (mut lasting, mut spectra, mut lasts) = (Vec::new(), Vec::new(), Vec::new());
        // The first line is thin and black, the second wide: after, if there is one.
        for side in &self.sides {
            let Some(table) = &side.table else { continue };
            let Some(found) = determined(autocorrelation(table))? else { return Ok(vec![text(NO_TABLE)]) };
            let x = found.first().map(|one| one.lag_s.clone()).unwrap_or_default();
            lasts.push((side.name, found.iter().map(|one| one.lasts_s).collect::<Vec<_>>()));
            let y = found.into_iter().map(|one| one.correlation).collect();
            lasting.push(LineData { name: side.name.into(), x, y });
            let found = spectrum(table)?;
            // A log axis has no place for frequency 0 and for zero density.
            let kept = |values: &[f64]| values.iter().copied().skip(1).collect::<Vec<_>>();
            let x = found.first().map(|one| kept(&one.frequency_hz)).unwrap_or_default();
            let y = found.iter().map(|one| kept(&one.density)).collect();
            spectra.push(LineData { name: side.name.into(), x, y });
        }
        let panels = channel_panels();
        let plain: Vec<(String, String)> = panels.iter().map(|(name, _)| (name.clone(), "correlation".into())).collect();
        let density: Vec<(String, String)> = panels.iter().map(|(name, unit)| (name.clone(), format!("({unit})²/Hz"))).collect();
        let rows = lasts.iter().map(|(name, of)| {
            let cells = of.iter().map(|lasts| Cell::from(lasts.map_or_else(|| "beyond 3".to_owned(), |s| significant(s, 2))));
            [Cell::from(*name)].into_iter().chain(cells).collect()
        });
        let columns = channel_columns("time to 1/e, s", true, false);
        let mut parts = vec![
            Part::Figure(figures::lines(
                "Autocorrelation of the residual",
                "Sensor noise drops at once, gusts in about half a second; a slow fall means that something with a memory, or with the \
                 pace of the manoeuvres, is missing.",
                "lag, s",
                &plain,
                &lasting,
            )),
            Part::Table(Table { caption: "How long the residual lasts".into(), columns, rows: rows.collect() }),
        ];
        if spectra.iter().any(|line| !line.x.is_empty()) {
            parts.push(Part::Figure(figures::log_lines(
                "Spectrum of the residual",
                "A hump at the pace of the manoeuvres (below 1 Hz) is physics that is missing; a narrow peak, a vibration or a lag near \
                 the stick's own frequencies.",
                "frequency, Hz",
                &density,
                &spectra,
            )));
        }
        // What is left is what a next search would face.
        let last = self.sides.iter().rev().find_map(|side| Some((side.name, side.table.as_ref()?)));
        let (name, table) = last.unwrap_or(("model", table));
        parts.extend(sticks(name, determined(stick_correlations(table))?.unwrap_or_default()));
        Ok(parts)
    }
}

pub(super) const NO_TABLE: &str = "Too few rows with finite residuals to look at.";

/// `None` where there is too little to determine it.
fn determined<T>(found: Result<T>) -> Result<Option<T>> {
    match found {
        Err(Error::Undetermined(_)) => Ok(None),
        found => found.map(Some),
    }
}

/// The bar of a region.
fn bar_of(name: String, region: &Region) -> Fall {
    let remark = format!(" ({:.0} %, {:.0} %)", 100.0 * region.share_of_error, 100.0 * region.share_of_rows);
    let whole = region.split.is_some();
    let kind = if whole { Kind::Whole } else { Kind::Region };
    Fall { name, kind, value: region.rmse, ci95: region.ci95, remark: if whole { String::new() } else { remark } }
}

/// Sticks against residuals, and the warning of feedback in words.
fn sticks(model: &str, found: Vec<StickCorrelation>) -> Vec<Part> {
    if found.is_empty() {
        return vec![text("No stick was recorded: whether sticks follow the residual cannot be seen.")];
    }
    let mut rows: Vec<(String, String, Vec<MapCell>)> = Vec::new();
    for one in &found {
        let largest = (0..one.correlation.len()).max_by(|a, b| one.correlation[*a].abs().total_cmp(&one.correlation[*b].abs()));
        let cell = largest.map_or_else(MapCell::default, |at| {
            let (correlation, lag) = (one.correlation[at], one.lag_s.get(at).copied().unwrap_or(f64::NAN));
            let inside = one.band95.get(at).is_some_and(|band| correlation.abs() <= *band);
            let detail = format!("{lag:+.1} s{}", if inside { ", within chance" } else { "" });
            MapCell { text: format!("{correlation:.2}"), detail, value: Some(correlation.abs()), before: None }
        });
        if rows.last().is_none_or(|(stick, ..)| stick != one.stick) {
            rows.push((one.stick.to_owned(), String::new(), Vec::new()));
        }
        if let Some((.., cells)) = rows.last_mut() {
            cells.push(cell);
        }
    }
    let whole = rows.iter().all(|(.., cells)| cells.len() == Column::TARGETS.len());
    let mut parts = Vec::new();
    if whole {
        parts.push(Part::Map(Map {
            caption: format!("Largest correlation of each stick with the residual of the {model}, and its lag"),
            shade: "size of the correlation; at a negative lag the residual comes first".into(),
            full: Some(0.5),
            columns: channel_columns("stick", true, false),
            rows,
        }));
    }
    let warned: Vec<String> = found
        .iter()
        .filter(|one| one.feedback_warning)
        .map(|one| format!("{} answers to the residual of {}", one.stick, one.channel))
        .collect();
    parts.push(Part::Text(if warned.is_empty() {
        "No stick clearly follows a residual: what a stick explains may be taken for its effect.".into()
    } else {
        format!(
            "Feedback: {}. The pilot or an autopilot corrects what the model does not know (gusts, missing physics). What such a stick \
             seems to explain at later lags need not be its effect; steps and doublets flown open loop would tell.",
            warned.join("; ")
        )
    }));
    parts
}
