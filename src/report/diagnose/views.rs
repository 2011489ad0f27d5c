//! Views 1 to 6 of a diagnosis: what the model before and after makes of the flights, and what is left.
//!
//! Predicts each flight once with both models; the numbers are those of `compare`, `locate` and `residual_views`.

use super::super::compare::{CompareReport, channel_columns, channel_panels, error_tables, maps, trace_figure};
use super::super::figures::{self, BinnedPanel, LineData, PANELS, with_unit};
use super::super::page::{Cell, Map, MapCell, Part, Table};
use super::DiagnoseReport;
use crate::critique::digits::significant;
use crate::critique::locate::{Dependence, Variable, dependences, stretches};
use crate::critique::predictions::deviation;
use crate::critique::residual_views::{
    Region, StickCorrelation, autocorrelation, informative_pair, regions, spectrum, stick_correlations, surface,
};
use crate::critique::unknown::{ROWS_MAX, ResidualTable};
use crate::critique::{Row, compare};
use crate::error::{Error, Result};
use crate::flight::windows::windows;
use crate::flight::{Accelerations, Column, Flight, Span, Window, split};
use crate::physics::Effect;

/// Samples that maps and binned residuals look at, at most; of more every k-th is taken.
const SAMPLES: usize = 150_000;
/// Length of a block, s, as in all intervals of a report.
const BLOCK_S: f64 = 10.0;
/// Variables of a channel that are shown besides those that an added effect reads.
const TELLING: usize = 3;
/// Share of a residual that the darkest shade stands for at least: below it all is noise.
const LEAST_DARKEST: f64 = 0.1;
/// RMSE of the loudest region over that of all flights from which regions are shown.
const UNEVEN: f64 = 1.25;
/// Share of a residual below which a variable is not shown, unless an added effect reads it.
const SHARE_SHOWN: f64 = 0.01;

/// A curve through bins: its name, the variable, the residual.
type Curve = (String, Vec<f64>, Vec<f64>);

/// One model on all flights.
struct Side {
    name: &'static str,
    predicted: Vec<Accelerations>,
    table: Option<ResidualTable>,
}

struct Seen<'a> {
    report: &'a DiagnoseReport<'a>,
    /// Before, and after if something was added.
    sides: Vec<Side>,
}

/// The parts of views 1 to 6.
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
            Ok(std::array::from_fn(|channel| {
                flight.column(Column::TARGETS[channel]).iter().zip(&predicted[channel]).map(|(y, p)| y - p).collect()
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

fn text(words: &str) -> Part {
    Part::Text(words.into())
}

impl Seen<'_> {
    /// Every k-th sample of some spans, so that there are at most [`SAMPLES`].
    fn windows(&self, spans: &[Span]) -> (Vec<Window>, usize) {
        let samples: usize = spans.iter().map(|span| span.end - span.start).sum();
        let stride = samples.div_ceil(SAMPLES).max(1);
        (windows(spans, 1, stride), stride)
    }

    fn row(&self, side: &Side, windows: &[Window]) -> Row {
        let at = |window: &Window| std::array::from_fn(|channel| side.predicted[window.flight][channel][window.last]);
        Row { name: side.name.into(), predicted: windows.iter().map(at).collect() }
    }

    fn rows(&self, windows: &[Window]) -> Vec<Row> {
        self.sides.iter().map(|side| self.row(side, windows)).collect()
    }

    /// View 1.
    fn traces(&self) -> Result<Vec<Part>> {
        let report = self.report;
        let windows = windows(report.locked, 1, 1);
        if windows.is_empty() {
            return Ok(vec![text("No flights were kept from the search: there is nothing to show that it has not seen.")]);
        }
        let rows = self.rows(&windows);
        let part = match report.diagnoses.iter().filter_map(|diagnosis| diagnosis.locked.as_ref()).next() {
            Some(locked) if locked.part == split::Part::Locked.name() => split::Part::Locked,
            _ => split::Part::Test,
        };
        let comparison = compare(report.flights, &windows, &rows, part)?;
        let compared = CompareReport {
            comparison: &comparison,
            flights: report.flights,
            windows: &windows,
            rows: &rows,
            focus: rows.len() - 1,
            yardstick: None,
            provenance: &[],
        };
        let mut parts = vec![text(
            "The part that no search has seen. Look for where the prediction leaves the measured line for longer than a gust lasts. \
             Drag to zoom: all panels follow; double-click to go back; click a name to hide or show its line.",
        )];
        match rows.first().map(|row| stretches(report.flights, &windows, row)).transpose()?.flatten() {
            None => parts.push(text("No stretch to show: no measured channel varies.")),
            Some(found) => {
                for (title, stretch) in
                    [("Worst ten seconds of the model as it was", found.worst), ("Typical ten seconds", found.typical)]
                {
                    parts.push(Part::Figure(trace_figure(title, &compared, &stretch)));
                }
            }
        }
        parts.extend(error_tables(&comparison));
        Ok(parts)
    }

    /// View 2.
    fn maps(&self) -> Result<Vec<Part>> {
        let report = self.report;
        let all: Vec<Span> = report.searched.iter().chain(report.locked).copied().collect();
        let (windows, stride) = self.windows(&all);
        if windows.is_empty() {
            return Ok(vec![text("There are no flights to look at.")]);
        }
        let comparison = compare(report.flights, &windows, &self.rows(&windows), split::Part::All)?;
        let deviation = deviation(report.flights, &windows)?;
        let every = if stride > 1 { format!(" Every {stride}th sample is taken.") } else { String::new() };
        let mut parts = vec![Part::Text(format!(
            "All flights, searched and not. A dark row is a manoeuvre, a dark column a channel that the model misses. All maps have one \
             scale.{every}"
        ))];
        parts.extend(comparison.models.iter().flat_map(|model| maps(model, &deviation).parts));
        let values = |part: &Part| match part {
            Part::Map(map) => map.rows.iter().flat_map(|(.., cells)| cells).filter_map(|cell| cell.value).fold(0.0, f64::max),
            _ => 0.0,
        };
        let darkest = parts.iter().map(values).fold(0.0, f64::max);
        for part in &mut parts {
            if let Part::Map(map) = part {
                map.full = Some(darkest);
            }
        }
        // The same words stand under each model; once is enough.
        let mut said: Vec<String> = Vec::new();
        parts.retain(|part| match part {
            Part::Text(words) if said.contains(words) => false,
            Part::Text(words) => {
                said.push(words.clone());
                true
            }
            _ => true,
        });
        Ok(parts)
    }

    /// View 3.
    fn binned(&self) -> Result<Vec<Part>> {
        let report = self.report;
        let (windows, _) = self.windows(report.searched);
        let of_side = |side: &Side| dependences(report.flights, &windows, &self.row(side, &windows), &Variable::ALL);
        let found = self.sides.iter().map(of_side).collect::<Result<Vec<_>>>()?;
        let Some(before) = found.first().filter(|found| !found.is_empty()) else {
            return Ok(vec![text("No recorded variable varies in these flights.")]);
        };
        let after = found.get(1);
        let mut parts = vec![text(
            "The residual is measured − predicted, on the searched flights. With all the physics in the model it goes with nothing: \
             every interval holds zero. Hollow points rest on fewer than five blocks of ten seconds and say little. A dashed line is \
             an added effect's own contribution, about its mean; coefficients fitted beside it may take up a part of it.",
        )];
        let shares = before.iter().flat_map(|(_, of)| of.iter().map(|one| one.share));
        let darkest = shares.fold(LEAST_DARKEST, f64::max);
        for (side, found) in self.sides.iter().zip(&found) {
            let rows = found.iter().map(|(variable, of)| {
                let cells = of.iter().map(|one| MapCell {
                    text: format!("{:.0} %", 100.0 * one.share),
                    detail: String::new(),
                    value: Some(one.share),
                });
                (with_unit(variable.name(), variable.unit()), String::new(), cells.collect())
            });
            parts.push(Part::Map(Map {
                caption: format!("Share of the residual of the {} that goes with one variable alone", side.name),
                shade: "correlation ratio η² of binned means".into(),
                full: Some(darkest),
                columns: channel_columns("variable", true, false),
                rows: rows.collect(),
            }));
        }
        let mut quiet = Vec::new();
        for (channel, column) in Column::TARGETS.iter().enumerate() {
            let mut order: Vec<(f64, usize)> =
                before.iter().enumerate().map(|(index, (_, of))| (of[channel].share, index)).collect();
            order.sort_by(|a, b| b.0.total_cmp(&a.0));
            let read = |index: usize| self.added(channel).any(|(_, effect)| reads(effect, channel, before[index].0));
            let told = order.iter().take(TELLING).filter(|(share, _)| *share >= SHARE_SHOWN).map(|(_, index)| *index);
            let mut shown: Vec<usize> = told.collect();
            shown.extend(order.iter().map(|(_, index)| *index).filter(|index| read(*index)));
            let mut once = Vec::new();
            shown.retain(|index| {
                !once.contains(index) && once.len() < PANELS && {
                    once.push(*index);
                    true
                }
            });
            if shown.is_empty() {
                quiet.push(column.name());
                continue;
            }
            let curves = self.curves(channel, &windows, before, &shown)?;
            let panels: Vec<BinnedPanel<'_>> = shown
                .iter()
                .zip(curves)
                .filter_map(|(index, curve)| {
                    let (variable, of) = before.get(*index)?;
                    let after = after.and_then(|after| after.iter().find(|(other, _)| other == variable));
                    let (variable, unit) = (variable.name(), variable.unit());
                    Some(BinnedPanel { variable, unit, dependence: &of[channel], curve, after: after.map(|(_, of)| &of[channel]) })
                })
                .collect();
            let caption = "Share of the residual's variance before in brackets.";
            parts.push(Part::Figure(figures::binned(&format!("Residual of {}", column.name()), caption, column.unit(), &panels)));
        }
        if !quiet.is_empty() {
            parts.push(Part::Text(format!("{}: no variable accounts for 1 % of the residual.", quiet.join(", "))));
        }
        Ok(parts)
    }

    /// Added effects that act in a channel.
    fn added(&self, channel: usize) -> impl Iterator<Item = (usize, &Effect)> {
        let acts = move |index: usize| self.report.after.acts(index).is_ok_and(|acts| acts[channel]);
        self.report.added().filter(move |(index, _)| acts(*index))
    }

    /// For each of the variables the contribution of the first added effect that reads it, binned as the residual is.
    fn curves(
        &self,
        channel: usize,
        windows: &[Window],
        before: &[(Variable, [Dependence; 6])],
        shown: &[usize],
    ) -> Result<Vec<Option<Curve>>> {
        let mut curves = vec![None; shown.len()];
        for (index, effect) in self.added(channel) {
            let wanted: Vec<(usize, Variable)> = shown
                .iter()
                .enumerate()
                .filter_map(|(place, variable)| Some((place, before.get(*variable)?.0)))
                .filter(|(place, variable)| curves[*place].is_none() && reads(effect, channel, *variable))
                .collect();
            if wanted.is_empty() {
                continue;
            }
            let contribution = self.contribution(index, channel)?;
            let flights = self.report.flights;
            // As if the effect were all that the model misses: its residual is the contribution.
            let predicted = |window: &Window| {
                let mut predicted = [0.0; 6];
                let measured = flights[window.flight].column(Column::TARGETS[channel])[window.last];
                predicted[channel] = measured - contribution[window.flight].get(window.last).copied().unwrap_or(f64::NAN);
                predicted
            };
            let row = Row { name: effect.name.clone(), predicted: windows.iter().map(predicted).collect() };
            let variables: Vec<Variable> = wanted.iter().map(|(_, variable)| *variable).collect();
            for (variable, of) in dependences(flights, windows, &row, &variables)? {
                let bins = &of[channel].bins;
                let count: f64 = bins.iter().map(|bin| bin.n as f64).sum();
                let mean = bins.iter().map(|bin| bin.n as f64 * bin.mean).sum::<f64>() / count;
                let curve = bins.iter().map(|bin| (bin.at, bin.mean - mean)).unzip();
                if let Some((place, _)) = wanted.iter().find(|(_, wanted)| *wanted == variable) {
                    curves[*place] = Some((effect.name.clone(), curve.0, curve.1));
                }
            }
        }
        Ok(curves)
    }

    /// What an effect of the model after adds to a channel, flight by flight; empty where a flight is in no span.
    fn contribution(&self, index: usize, channel: usize) -> Result<Vec<Vec<f64>>> {
        let mut without = self.report.after.clone();
        without.effects[index].enabled = false;
        let of = |(number, flight): (usize, &Flight)| {
            if !self.report.searched.iter().any(|span| span.flight == number) {
                return Ok(Vec::new());
            }
            let (with, without) = (self.report.after.predict(flight)?, without.predict(flight)?);
            Ok(with[channel].iter().zip(&without[channel]).map(|(with, without)| with - without).collect())
        };
        self.report.flights.iter().enumerate().map(of).collect()
    }

    /// The residual of the model before, on the searched flights.
    fn table(&self) -> Option<&ResidualTable> {
        self.sides.first().and_then(|side| side.table.as_ref())
    }

    /// View 4.
    fn surface(&self) -> Result<Vec<Part>> {
        let Some(table) = self.table() else { return Ok(vec![text(NO_TABLE)]) };
        let mut best = None;
        for channel in 0..Column::TARGETS.len() {
            let Some(pair) = informative_pair(table, channel)? else { continue };
            let Some(found) = surface(table, channel, [&pair[0], &pair[1]])? else { continue };
            if best.as_ref().is_none_or(|(_, share, _)| found.share > *share) {
                best = Some((channel, found.share, pair));
            }
        }
        let Some((channel, _, pair)) = best else { return Ok(vec![text("Fewer than two recorded variables vary.")]) };
        let mut found = Vec::new();
        for side in &self.sides {
            let of = side.table.as_ref().map(|table| surface(table, channel, [&pair[0], &pair[1]])).transpose()?.flatten();
            found.extend(of.map(|of| (format!("{} (η² {:.0} %)", side.name, 100.0 * of.share), of)));
        }
        let axis = |name: &String| {
            let unit = table.names.iter().position(|known| known == name).and_then(|index| table.units.get(index));
            with_unit(name, unit.map_or("1", String::as_str))
        };
        let [x, y] = [axis(&pair[0]), axis(&pair[1])];
        let panels: Vec<_> = found.iter().map(|(title, of)| (title.clone(), of)).collect();
        let column = Column::TARGETS[channel];
        let title = format!("Residual of {} over {} and {}", column.name(), pair[0], pair[1]);
        let caption = "The channel and the two variables with which the residual goes most. Stripes along one axis: one variable is \
                       enough; a checked pattern: their product matters. Both panels have one colour scale.";
        let note = "A choice of axes, not a finding: in pure noise these are the two that go with it by chance, and so many cells take \
                    some per cent of any noise.";
        Ok(vec![Part::Figure(figures::surfaces(&title, caption, column.unit(), [&x, &y], &panels)), text(note)])
    }

    /// View 5.
    fn regions(&self) -> Result<Vec<Part>> {
        if self.table().is_none() {
            return Ok(vec![text(NO_TABLE)]);
        }
        let mut parts = vec![text(
            "Flights parted by simple rules so that the error differs from part to part; each part holds at least five blocks. Look for \
             a part with a larger share of the error than of the time: there the model lacks something, or the air is rougher.",
        )];
        for side in &self.sides {
            let Some(table) = &side.table else { continue };
            let mut even = Vec::new();
            for (channel, column) in Column::TARGETS.iter().enumerate() {
                let tree = regions(table, channel)?;
                let loudest = tree.leaves().iter().map(|leaf| leaf.rmse).fold(0.0, f64::max);
                if tree.split.is_none() || loudest < UNEVEN * tree.rmse {
                    even.push(column.name());
                    continue;
                }
                let mut rows = Vec::new();
                region_rows(&tree, "all flights".into(), 0, &mut rows);
                let unit = column.unit();
                let columns = [
                    ("region", ""),
                    ("RMSE", unit),
                    ("95 % interval", unit),
                    ("share of error", "%"),
                    ("share of time", "%"),
                    ("n", "rows"),
                    ("blocks", ""),
                ];
                let columns = columns.map(|(name, unit)| (name.to_owned(), unit.to_owned())).into();
                parts.push(Part::Table(Table { caption: format!("{}, {}", column.name(), side.name), columns, rows }));
            }
            if !even.is_empty() {
                parts.push(Part::Text(format!(
                    "{}: the error of {} is even; no rule finds a region in which it is a quarter larger.",
                    side.name,
                    even.join(", ")
                )));
            }
        }
        Ok(parts)
    }

    /// View 6.
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
            lasting.push(LineData { name: side.name.into(), x, y, hidden: false, markers: false });
            let found = spectrum(table)?;
            // A log axis has no place for frequency 0 and for zero density.
            let kept = |values: &[f64]| values.iter().copied().skip(1).collect::<Vec<_>>();
            let x = found.first().map(|one| kept(&one.frequency_hz)).unwrap_or_default();
            let y = found.iter().map(|one| kept(&one.density)).collect();
            spectra.push(LineData { name: side.name.into(), x, y, hidden: false, markers: false });
        }
        let panels = channel_panels();
        let plain: Vec<(String, String)> = panels.iter().map(|(name, _)| (name.clone(), "correlation".into())).collect();
        let density: Vec<(String, String)> = panels.iter().map(|(name, unit)| (name.clone(), format!("({unit})²/Hz"))).collect();
        let rows = lasts.iter().map(|(name, of)| {
            let cells = of.iter().map(|lasts| Cell::from(lasts.map_or_else(|| "beyond 3".to_owned(), |s| significant(s, 2))));
            [Cell::from(*name)].into_iter().chain(cells).collect()
        });
        let columns = channel_columns("time to 1/e", true, false).into_iter().enumerate();
        let columns = columns.map(|(index, (name, _))| (name, if index > 0 { "s".into() } else { String::new() })).collect();
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

const NO_TABLE: &str = "Too few rows with finite residuals to look at.";

/// `None` where there is too little to determine it.
fn determined<T>(found: Result<T>) -> Result<Option<T>> {
    match found {
        Err(Error::Undetermined(_)) => Ok(None),
        found => found.map(Some),
    }
}

/// Whether an effect acts on a channel without memory and reads the variable there.
fn reads(effect: &Effect, channel: usize, variable: Variable) -> bool {
    let formulas = || {
        let terms = effect.terms.iter().filter(|term| term.channel == channel).map(|term| &term.regressor);
        terms.chain(effect.swaps.iter().map(|swap| &swap.with))
    };
    let stands_for = |name: &str| {
        name.strip_prefix("air_").unwrap_or(name) == variable.name() || (variable == Variable::Height && name == Column::Z.name())
    };
    formulas().all(|formula| !formula.remembers()) && formulas().any(|formula| formula.names().into_iter().any(stands_for))
}

/// A region and, indented, its parts.
fn region_rows(region: &Region, name: String, depth: usize, rows: &mut Vec<Vec<Cell>>) {
    let indent = "\u{2003}".repeat(depth);
    let interval = region.ci95.map(|[low, high]| format!("{} … {}", significant(low, 3), significant(high, 3)));
    let cells = [
        format!("{indent}{name}"),
        significant(region.rmse, 3),
        interval.unwrap_or_else(|| "–".into()),
        format!("{:.0}", 100.0 * region.share_of_error),
        format!("{:.0}", 100.0 * region.share_of_rows),
        region.n.to_string(),
        region.blocks.to_string(),
    ];
    rows.push(cells.map(Cell::from).into());
    if let Some(split) = &region.split {
        let unit = if split.unit == "1" { String::new() } else { format!(" {}", split.unit) };
        for (part, sign) in region.parts.iter().zip(["≤", ">"]) {
            let name = format!("{} {sign} {}{unit}", split.variable, significant(split.threshold, 3));
            region_rows(part, name, depth + 1, rows);
        }
    }
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
            MapCell { text: format!("{correlation:.2}"), detail, value: Some(correlation.abs()) }
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
