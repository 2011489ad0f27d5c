//! The page of `compare`: what the models get wrong, in words, tables, maps, traces and residuals.
//!
//! Arranges the numbers of [`Comparison`] and of `critique::locate` on a [`Page`]; computes none of its own but percentages.

use super::figures::{self, BinnedPanel, LineData, PANELS};
use super::page::{Cell, DATA_NOTE, Map, MapCell, Page, Part, Section, Table, data_notes};
use crate::critique::channels::Intervals;
use crate::critique::digits::{Kind, significant};
use crate::critique::locate::{Dependence, Stretch, Variable, dependences, stretches};
use crate::critique::predictions::deviation;
use crate::critique::shares::bars;
use crate::critique::table::{FLOOR, LEGEND, MEASURES, OWN_FROM_FIRST_HALF};
use crate::critique::{Comparison, ModelError, PartError, PerChannel, Regime, Row, Shares, Uncertainty, paired};
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, Targets, Window};

/// What [`compare_page`] shows.
#[derive(Clone, Copy, Debug)]
pub struct CompareReport<'a> {
    /// The numbers.
    pub comparison: &'a Comparison,
    /// The flights that the windows point into.
    pub flights: &'a [Flight],
    /// The windows of the comparison.
    pub windows: &'a [Window],
    /// The predictions of the comparison, in its order.
    pub rows: &'a [Row],
    /// Index of the model whose errors the maps, traces and residuals show.
    pub focus: usize,
    /// Index of the yardstick (finite difference), which the verdict measures the model against.
    pub yardstick: Option<usize>,
    /// Where the numbers come from: (what, value), such as the hash of the data, the seed, the model files.
    pub provenance: &'a [(String, String)],
}

/// The page of one comparison.
///
/// # Errors
/// [`Error::Shape`] if `focus` is not a row, or rows and windows do not fit; with the inputs of the comparison they do.
pub fn compare_page(report: &CompareReport<'_>) -> Result<Page> {
    let nothing = || Error::Shape { operation: "report", message: format!("there is no model {} among the rows", report.focus) };
    let row = report.rows.get(report.focus).ok_or_else(nothing)?;
    let model = report.comparison.models.get(report.focus).ok_or_else(nothing)?;
    let deviation = deviation(report.flights, report.windows)?;
    let located = stretches(report.flights, report.windows, row)?;
    let mut sections = vec![Section { title: "Error per channel".into(), parts: error_tables(report.comparison) }];
    if !report.comparison.shares.is_empty() {
        let parts = report.comparison.shares.iter().flat_map(share_parts).collect();
        sections.push(Section { title: "Who explains what".into(), parts });
    }
    if !report.comparison.uncertainty.is_empty() {
        let parts = report.comparison.uncertainty.iter().flat_map(uncertainty_parts).collect();
        sections.push(Section { title: "What the uncertain coefficients do".into(), parts });
    }
    sections.push(maps(model, &deviation));
    let mut traces = Vec::new();
    if let Some(found) = located {
        traces.push(Part::Text(
            "Drag to zoom: all panels follow; double-click to go back; click a name to hide or show its line.".into(),
        ));
        for (title, stretch) in [("Worst ten seconds", found.worst), ("Typical ten seconds", found.typical)] {
            traces.push(Part::Figure(trace_figure(title, report, &stretch)));
        }
    } else {
        traces.push(Part::Text("There is no stretch to show: no windows, or no measured channel varies.".into()));
    }
    sections.push(Section { title: "Measured and predicted".into(), parts: traces });
    sections.push(residuals(report, row)?);
    let mut parts = vec![Part::Table(provenance(report))];
    parts.extend(data_notes(report.provenance));
    sections.push(Section { title: "Where these numbers come from".into(), parts });
    Ok(Page {
        title: format!("Measured against predicted: {}", model.name),
        summary: summary(report, model, &deviation)?,
        sections,
    })
}

/// The verdict in words.
fn summary(report: &CompareReport<'_>, model: &ModelError, deviation: &PerChannel) -> Result<Vec<String>> {
    let channels = model.rmse.channels();
    let relative: Vec<(usize, f64)> =
        (0..6).filter_map(|channel| Some((channel, channels[channel]? / deviation.channels()[channel]?))).collect();
    let name = |channel: usize| Column::TARGETS[channel].name();
    let mut out = vec![format!("{}.", report.comparison.basis())];
    out.extend(report.comparison.own_from_first_half.then(|| OWN_FROM_FIRST_HALF.to_owned()));
    if model.not_finite > 0 {
        out.push(format!(
            "Beware: {} of {} predictions of {} are not finite numbers. The channels they hit have no error measure.",
            model.not_finite, model.windows, model.name
        ));
    }
    let worst = relative.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let finest = relative.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    if let (Some(worst), Some(finest)) = (worst, finest) {
        let says = |(channel, share): &(usize, f64)| {
            let unit = Column::TARGETS[*channel].unit();
            let rmse = channels[*channel].map_or_else(String::new, |rmse| significant(rmse, 3));
            format!("{} (RMSE {rmse} {unit}, {:.0} % of the channel's standard deviation)", name(*channel), 100.0 * share)
        };
        out.push(format!("{} predicts {} best and {} worst.", model.name, says(finest), says(worst)));
    }
    let mean = |model: &ModelError| model.rmse.mean;
    let judged = report.comparison.models.iter().enumerate().filter(|(index, _)| report.yardstick != Some(*index));
    let best = judged.filter_map(|(index, model)| Some((index, model, mean(model)?))).min_by(|a, b| a.2.total_cmp(&b.2));
    if let (Some((index, best, error)), Some(own)) = (best, mean(model))
        && index != report.focus
    {
        let [error, own] = [error, own].map(|value| significant(value, 3));
        let apart = model.difference_to_best.as_ref().filter(|apart| apart.to == best.name).and_then(|apart| apart.ci95.mean);
        let doubt = if apart.is_some_and(|[low, _]| low > 0.0) { "" } else { ", a difference within its interval" };
        out.push(format!("Of the models here, {} has the smallest mean RMSE ({error}; {} {own}{doubt}).", best.name, model.name));
    }
    out.extend(against_yardstick(report, model)?);
    out.extend(report.comparison.shares.iter().find(|shares| shares.name == model.name).and_then(Shares::sentence));
    let worst_part = |parts: &std::collections::BTreeMap<String, PartError>| {
        let score = |part: &PartError| normalised(part, deviation).into_iter().flatten().reduce(f64::max);
        let scored = parts.iter().filter_map(|(name, part)| Some((name.clone(), score(part)?)));
        scored.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| parts.values().filter(|part| part.n > 0).count() > 1)
    };
    let manoeuvre =
        worst_part(&model.by_manoeuvre).map(|(name, score)| format!("manoeuvre {name} ({score:.1} standard deviations)"));
    let regime = worst_part(&model.by_regime).map(|(name, score)| format!("regime {name} ({score:.1})"));
    let places: Vec<String> = [manoeuvre, regime].into_iter().flatten().collect();
    if !places.is_empty() {
        out.push(format!("The largest error of any channel lies in {}.", places.join(" and in ")));
    }
    if report.comparison.target == Targets::Derived {
        out.push(
            "The accelerations were not recorded but derived from velocity and rates: their noise is part of every error here."
                .into(),
        );
    }
    Ok(out)
}

/// In which channels the model is better than the yardstick, beyond the paired interval.
fn against_yardstick(report: &CompareReport<'_>, model: &ModelError) -> Result<Option<String>> {
    let Some(yardstick) = report.yardstick.filter(|index| *index != report.focus) else { return Ok(None) };
    let (Some(own), Some(other)) = (report.rows.get(report.focus), report.rows.get(yardstick)) else { return Ok(None) };
    let apart = paired(report.flights, report.windows, other, own)?;
    let wins: Vec<&str> = (0..6)
        .filter(|channel| apart.ci95.channels()[*channel].is_some_and(|[low, _]| low > 0.0))
        .map(|channel| Column::TARGETS[channel].name())
        .collect();
    let beats = format!("{} beats the yardstick “{}”", model.name, other.name);
    Ok(Some(match wins.len() {
        0 => format!("{beats} in no channel beyond chance."),
        6 => format!("{beats} in all six channels."),
        count => format!("{beats} beyond chance in {count} of 6 channels: {}.", wins.join(", ")),
    }))
}

/// RMSE over the standard deviation of the channel.
fn normalised(part: &PartError, deviation: &PerChannel) -> [Option<f64>; 6] {
    std::array::from_fn(|channel| Some(part.rmse.channels()[channel]? / deviation.channels()[channel]?))
}

pub(super) fn channel_columns(first: &str, share: bool, mean: bool) -> Vec<(String, String)> {
    let unit = |column: &Column| if share { "" } else { column.unit() }.to_owned();
    let channels = Column::TARGETS.iter().map(|column| (column.name().to_owned(), unit(column)));
    let last = mean.then(|| ("mean".to_owned(), String::new()));
    [(first.to_owned(), String::new())].into_iter().chain(channels).chain(last).collect()
}

pub(super) fn error_tables(comparison: &Comparison) -> Vec<Part> {
    let between = |interval: Option<[f64; 2]>| {
        interval.map(|[low, high]| format!(" [{}, {}]", significant(low, 2), significant(high, 2))).unwrap_or_default()
    };
    let table = |(title, words, kind, measure): (&str, &str, Kind, fn(&ModelError) -> PerChannel)| {
        let key = match title {
            "RMSE" => "rmse",
            "MAE" => "mae",
            "R²" => "r2",
            _ => "",
        };
        let columns = channel_columns("model", kind == Kind::Share, true);
        let rows = comparison.models.iter().enumerate().map(|(row, model)| {
            let intervals = if title == "RMSE" { with_mean_of(&model.rmse_ci95) } else { vec![None; 7] };
            let cells = with_mean(&measure(model)).into_iter().zip(intervals).zip(columns.iter().skip(1));
            let cells = cells.map(|((value, interval), (name, _))| Cell {
                text: format!("{}{}", kind.text(value), between(interval)),
                best: comparison.is_best(key, name, row),
            });
            [Cell::from(model.name.clone())].into_iter().chain(cells).collect()
        });
        let floor = comparison.floor.filter(|_| title == "RMSE").map(|floor| {
            let cells = with_mean(&floor).into_iter().map(|value| Cell::from(kind.text(value)));
            [Cell::from("floor".to_owned())].into_iter().chain(cells).collect()
        });
        let rows = rows.chain(floor).collect();
        Part::Table(Table { caption: format!("{title}, {words}"), rows, columns: columns.clone() })
    };
    let note =
        format!("{LEGEND} The mean of the six mixes m/s² and rad/s²: it ranks models on the same data and means nothing else.");
    let mut parts: Vec<Part> = comparison.caution().map(Part::Text).into_iter().collect();
    parts.extend(MEASURES.into_iter().map(table));
    parts.extend(differences(comparison));
    parts.push(Part::Text(note));
    if let Some(floor) = &comparison.floor {
        parts.push(Part::Text(FLOOR.into()));
        let names: Vec<String> = comparison.models.iter().map(|model| model.name.clone()).collect();
        let values: Vec<Vec<Option<f64>>> = comparison.models.iter().map(|model| model.rmse.channels().into()).collect();
        let caption = "The dashed line is what no model can go below; what stands above it could be explained.";
        let (panels, floor) = (channel_panels(), floor.channels());
        parts.push(Part::Figure(figures::steps("RMSE above the floor", caption, &panels, &names, &values, Some(&floor))));
    }
    parts
}

/// How far each model is from the one with the smallest mean RMSE.
fn differences(comparison: &Comparison) -> Option<Part> {
    let apart = || comparison.models.iter().filter_map(|model| Some((model, model.difference_to_best.as_ref()?)));
    let (_, first) = apart().next()?;
    let rows = apart().map(|(model, apart)| {
        let cells = with_mean(&apart.rmse).into_iter().zip(with_mean_of(&apart.ci95)).map(|(value, interval)| {
            let interval = interval.map(|[low, high]| format!(" [{}, {}]", significant(low, 2), significant(high, 2)));
            let sign = if value.is_some_and(|value| value > 0.0) { "+" } else { "" };
            Cell::from(format!("{sign}{}{}", Kind::Error.text(value), interval.unwrap_or_default()))
        });
        [Cell::from(model.name.clone())].into_iter().chain(cells).collect()
    });
    let caption = format!("RMSE less that of {}, paired over {} blocks of ten seconds", first.to, comparison.blocks);
    Some(Part::Table(Table { caption, columns: channel_columns("model", false, true), rows: rows.collect() }))
}

fn with_mean_of(intervals: &Intervals) -> Vec<Option<[f64; 2]>> {
    intervals.channels().into_iter().chain([intervals.mean]).collect()
}

/// A bar and a table with intervals for one network.
fn share_parts(shares: &Shares) -> Vec<Part> {
    let (physics, neither) = (("named physics", shares.physics), ("neither", shares.neither));
    let learned = match shares.of_network {
        None => vec![("network", shares.network)],
        Some(parts) => vec![("linear history", parts.linear_history), ("network itself", parts.network_itself)],
    };
    let stacked: Vec<_> = [physics].into_iter().chain(learned).chain([neither]).collect();
    let bars = bars(&stacked.iter().map(|(_, share)| *share).collect::<Vec<_>>());
    let rows: Vec<String> = bars.iter().map(|(name, _)| name.clone()).collect();
    let values = |part: usize| bars.iter().filter_map(|(_, values)| values.get(part).copied()).collect();
    let of_parts: Vec<(String, Vec<f64>)> =
        stacked.iter().enumerate().map(|(part, (name, _))| ((*name).to_owned(), values(part))).collect();
    let mut basis = shares.basis();
    basis.replace_range(..1, "S");
    let caption = format!("{basis}. A part left of zero makes the error larger.");
    let lines = shares.lines().into_iter().map(|(name, of)| {
        let cell = |share: &Option<crate::critique::shares::Share>| {
            let Some(share) = share else { return Cell::from("–") };
            let interval = share.interval_text();
            Cell::from(if interval.is_empty() { share.text() } else { format!("{} ({interval})", share.text()) })
        };
        // Without the blanks that set off a part in plain text.
        let name = if name.starts_with(' ') { format!("of it: {}", name.trim()) } else { name.to_owned() };
        [Cell::from(name)].into_iter().chain(of.all().iter().map(cell)).collect()
    });
    let note = "Neither holds sensor noise, gusts, and physics that the network did not learn: it bounds the noise from above. The \
                intervals say how far a share would move on other flights of this kind, not with another training of the network.";
    let table = Table {
        caption: format!("Shares in percent, 95 % interval from {} blocks of ten seconds in brackets", shares.blocks),
        columns: channel_columns("part", true, true),
        rows: lines.collect(),
    };
    let figure = figures::shares("Who explains what", &caption, &rows, &of_parts);
    vec![Part::Figure(figure), Part::Table(table), Part::Text(note.into())]
}

/// Coefficient × channel, shaded by the share of the error, and the totals.
fn uncertainty_parts(uncertainty: &Uncertainty) -> Vec<Part> {
    let (sd, share) = (uncertainty.sd.channels(), uncertainty.share_of_rmse.channels());
    let cell = |channel: usize, value: Option<f64>| MapCell {
        text: Kind::Error.text(value),
        detail: String::new(),
        // sd / share is the RMSE of the channel.
        value: value
            .zip(share[channel])
            .zip(sd[channel])
            .filter(|(_, sd)| *sd > 0.0)
            .map(|((value, share), sd)| value * share / sd),
    };
    let rows = uncertainty.coefficients.iter().map(|one| {
        let [low, high] = one.ci95;
        let interval = format!("{} … {} {}", significant(low, 3), significant(high, 3), one.unit);
        let cells = one.movement.channels().into_iter().enumerate().map(|(channel, value)| cell(channel, value)).collect();
        (format!("{} {}", one.effect, one.name), interval, cells)
    });
    let map = Map {
        caption: format!("Movement of {} when a coefficient moves by half its 95 % interval, root mean square", uncertainty.name),
        shade: "movement over the RMSE of the channel".into(),
        full: None,
        columns: channel_columns("coefficient", false, false),
        rows: rows.collect(),
    };
    let totals = uncertainty.totals().into_iter().map(|(name, of, kind)| {
        [Cell::from(name)].into_iter().chain(of.channels().map(|value| Cell::from(kind.text(value)))).collect()
    });
    let table =
        Table { caption: "All coefficients together".into(), columns: channel_columns("", false, false), rows: totals.collect() };
    vec![Part::Map(map), Part::Table(table), Part::Text(uncertainty.note())]
}

fn with_mean(values: &PerChannel) -> Vec<Option<f64>> {
    values.channels().into_iter().chain([values.mean]).collect()
}

/// Manoeuvre × channel and regime × channel.
pub(super) fn maps(model: &ModelError, deviation: &PerChannel) -> Section {
    let row = |name: &str, part: &PartError| {
        let shades = normalised(part, deviation);
        let cells =
            part.rmse.channels().into_iter().zip(part.rmse_ci95.channels()).zip(shades).map(|((rmse, ci95), value)| MapCell {
                text: Kind::Error.text(rmse),
                detail: ci95.map_or_else(String::new, |[low, high]| format!("{} … {}", significant(low, 2), significant(high, 2))),
                value,
            });
        (name.to_owned(), format!("n = {} in {} blocks", part.n, part.blocks), cells.collect())
    };
    let map = |what: &str, rows: Vec<(String, String, Vec<MapCell>)>| {
        Part::Map(Map {
            caption: format!("RMSE of {} by {what}, 95 % interval below", model.name),
            shade: "RMSE over the standard deviation of the channel; 1 is as bad as predicting its mean".into(),
            full: None,
            columns: channel_columns(what, false, false),
            rows,
        })
    };
    // The worst part first.
    let score = |part: &PartError| normalised(part, deviation).into_iter().flatten().fold(0.0, f64::max);
    let mut manoeuvres: Vec<(&String, &PartError)> = model.by_manoeuvre.iter().collect();
    manoeuvres.sort_by(|a, b| score(b.1).total_cmp(&score(a.1)));
    let mut flown: Vec<(&Regime, &PartError)> = Regime::ALL
        .iter()
        .filter_map(|regime| Some((regime, model.by_regime.get(regime.name())?)))
        .filter(|(_, part)| part.n > 0)
        .collect();
    flown.sort_by(|a, b| score(b.1).total_cmp(&score(a.1)));
    let missing: Vec<&str> =
        Regime::ALL.iter().filter(|regime| flown.iter().all(|(other, _)| other != regime)).map(|regime| regime.name()).collect();
    let rules: Vec<String> = Regime::ALL.iter().map(|regime| format!("{}: {}", regime.name(), regime.rule())).collect();
    let mut parts = vec![
        map("manoeuvre", manoeuvres.iter().map(|(name, part)| row(name, part)).collect()),
        map("regime", flown.iter().map(|(regime, part)| row(regime.name(), part)).collect()),
        Part::Text(format!("A sample has the first regime whose rule holds. {}.", rules.join("; "))),
    ];
    if !missing.is_empty() {
        parts.push(Part::Text(format!("Not in these windows: {}.", missing.join(", "))));
    }
    parts.push(Part::Text(
        "Worst part first, by its worst channel. n counts windows; one window has no figures. Intervals rest on blocks of ten seconds, as neighbouring samples are not independent; without one there is a single block.".into(),
    ));
    Section { title: "Where the error lies".into(), parts }
}

pub(super) fn channel_panels() -> Vec<(String, String)> {
    Column::TARGETS.iter().map(|column| (column.name().to_owned(), column.unit().to_owned())).collect()
}

pub(super) fn trace_figure(title: &str, report: &CompareReport<'_>, stretch: &Stretch) -> figures::Figure {
    let span = stretch.span;
    let flight = &report.flights[span.flight];
    let mut at: Vec<(usize, usize)> = report
        .windows
        .iter()
        .enumerate()
        .filter_map(|(index, window)| {
            (window.flight == span.flight && (span.start..span.end).contains(&window.last)).then_some((window.last, index))
        })
        .collect();
    at.sort_unstable();
    let time = |samples: &mut dyn Iterator<Item = usize>| samples.map(|sample| flight.time_s(sample)).collect::<Vec<_>>();
    // Samples next to each other are joined; where windows are further apart, a line between them would show what nobody predicted.
    let gaps: Vec<usize> = at.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let sparse = 2 * gaps.iter().filter(|gap| **gap > 1).count() > gaps.len();
    let mut points: Vec<(f64, Option<usize>)> = Vec::new();
    for (place, (sample, index)) in at.iter().enumerate() {
        if !sparse && place > 0 && sample - at[place - 1].0 > 1 {
            points.push((flight.time_s(at[place - 1].0 + 1), None));
        }
        points.push((flight.time_s(*sample), Some(*index)));
    }
    let measured = LineData {
        name: "measured".into(),
        x: time(&mut (span.start..span.end)),
        y: Column::TARGETS.iter().map(|column| flight.column(*column)[span.start..span.end].to_vec()).collect(),
        hidden: false,
        markers: false,
    };
    // The model in focus first, so that it has the same look on every page.
    let others = (0..report.rows.len()).filter(|index| *index != report.focus);
    let order = [report.focus].into_iter().chain(others).filter_map(|index| Some((index, report.rows.get(index)?)));
    let predicted = order.map(|(index, row)| LineData {
        name: row.name.clone(),
        x: points.iter().map(|(time_s, _)| *time_s).collect(),
        // No number breaks a line.
        y: (0..6)
            .map(|channel| {
                points.iter().map(|(_, window)| window.map_or(f64::NAN, |window| row.predicted[window][channel])).collect()
            })
            .collect(),
        hidden: report.yardstick == Some(index) && index != report.focus,
        markers: sparse,
    });
    let caption = format!(
        "Flight {}, manoeuvre {}, {:.1} s to {:.1} s. Normalised error {:.2} (1 is as bad as predicting the mean).{}",
        flight.name,
        flight.manoeuvre,
        flight.time_s(span.start),
        flight.time_s(span.end),
        stretch.error,
        if sparse { " Predictions are points: only these samples were predicted." } else { "" }
    );
    let data: Vec<LineData> = [measured].into_iter().chain(predicted).collect();
    figures::lines(title, &caption, "time, s", &channel_panels(), &data)
}

/// Share of a residual below which no variable is drawn: 14 bins of pure noise reach it in a few minutes of flight.
const SHARE_SHOWN: f64 = 0.01;

/// Which variables the residual goes with, and how.
fn residuals(report: &CompareReport<'_>, row: &Row) -> Result<Section> {
    let found = dependences(report.flights, report.windows, row, &Variable::ALL)?;
    let title = "Residual against variables".to_owned();
    if found.is_empty() {
        return Ok(Section { title, parts: vec![Part::Text("No recorded variable varies in these windows.".into())] });
    }
    let rows = found.iter().map(|(variable, of)| {
        let cells = of.iter().map(|one| MapCell {
            text: format!("{:.0} %", 100.0 * one.share),
            detail: String::new(),
            value: Some(one.share),
        });
        (figures::with_unit(variable.name(), variable.unit()), String::new(), cells.collect())
    });
    let mut parts = vec![
        Part::Text(
            "The residual is measured − predicted. A model that has all the physics leaves one that goes with nothing.".into(),
        ),
        Part::Map(Map {
            caption: format!("Share of the residual of {} that goes with one variable alone", row.name),
            shade: "correlation ratio η² of binned means".into(),
            full: None,
            columns: channel_columns("variable", true, false).into_iter().map(|(name, _)| (name, String::new())).collect(),
            rows: rows.collect(),
        }),
    ];
    for (channel, column) in Column::TARGETS.iter().enumerate() {
        let panel = |(variable, of): &'_ (Variable, [Dependence; 6])| (*variable, of[channel].share);
        let mut order: Vec<(usize, (Variable, f64))> = found.iter().map(panel).enumerate().collect();
        order.sort_by(|a, b| b.1.1.total_cmp(&a.1.1));
        let largest = order.first().map_or(0.0, |(_, (_, share))| *share);
        if largest < SHARE_SHOWN {
            let text = "no variable accounts for 1 % of it; there is nothing to show";
            parts.push(Part::Text(format!("Residual of {}: {text}.", column.name())));
            continue;
        }
        let panels: Vec<BinnedPanel<'_>> = order
            .iter()
            .take(PANELS)
            .filter_map(|(index, (variable, _))| {
                let dependence = &found.get(*index)?.1[channel];
                Some(BinnedPanel { variable: variable.name(), unit: variable.unit(), dependence, curve: None, after: None })
            })
            .collect();
        let caption = "The variables it goes with most, share of the residual's variance in brackets.";
        parts.push(Part::Figure(figures::binned(&format!("Residual of {}", column.name()), caption, column.unit(), &panels)));
    }
    Ok(Section { title, parts })
}

fn provenance(report: &CompareReport<'_>) -> Table {
    let target = match report.comparison.target {
        Targets::Recorded => "recorded",
        Targets::Derived => "derived from velocity and rates by a zero-phase differentiator",
    };
    let own = [
        ("split", report.comparison.split.name().to_owned()),
        ("targets", target.to_owned()),
        ("windows", format!("{}, {} samples from one to the next", report.windows.len(), report.comparison.stride)),
        ("flights", report.flights.len().to_string()),
        ("phyture", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let own = own.into_iter().map(|(what, value)| (what.to_owned(), value));
    let given = report.provenance.iter().filter(|(what, _)| what != DATA_NOTE).cloned();
    let rows = own.chain(given).map(|(what, value)| vec![what.into(), value.into()]);
    Table {
        caption: String::new(),
        columns: vec![("what".into(), String::new()), ("value".into(), String::new())],
        rows: rows.collect(),
    }
}
