//! Flights as pictures: measured and predicted over time, where the error lies, what is left over against recorded variables.

use super::super::figures::{self, BinnedPanel, Figure, Trace};
use super::super::names::{channel_panels, named, said, spoken};
use super::super::page::{Map, MapCell, Part};
use super::{CompareReport, channel_columns};
use crate::critique::digits::{Kind, significant};
use crate::critique::locate::{Dependence, Stretch, Variable, dependences, stretches};
use crate::critique::{ChannelValues, ModelError, PartError, Regime, Row};
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, Window};
use std::collections::BTreeMap;

/// Lines of one panel besides the measured one, at most.
const MODELS: usize = 4;
/// Variables of a channel that are shown.
pub const VARIABLES: usize = 3;
/// How to use what a linked figure offers.
pub const USE: &str =
    "Where scripts run, the pointer or the arrow keys read values; drag or + and − zoom, a double click or 0 goes back.";

/// The worst stretch and a typical one.
pub fn traces(report: &CompareReport<'_>) -> Result<Vec<Part>> {
    let row = report.rows.get(report.focus);
    let found = row.map(|row| stretches(report.flights, report.windows, row)).transpose()?.flatten();
    let Some(found) = found else {
        return Ok(vec![Part::Text("There is no stretch to show: no windows, or no measured channel varies.".into())]);
    };
    let mut parts = vec![Part::Text(format!("Sharp departures that last longer than a gust are what a model lacks. {USE}"))];
    for (title, stretch) in [("Worst ten seconds", found.worst), ("Typical ten seconds", found.typical)] {
        let traced = report.traced.iter().find(|traced| traced.stretch.span == stretch.span);
        let (windows, rows) = traced.map_or((report.windows, report.rows), |traced| (&traced.windows, &traced.rows));
        let lines = Lines { flights: report.flights, windows, rows, focus: report.focus, yardstick: report.yardstick };
        parts.push(Part::Figure(trace_figure(title, &lines, &stretch)));
    }
    Ok(parts)
}

/// Whose lines are drawn.
pub struct Lines<'a> {
    /// The flights that the windows point into.
    pub flights: &'a [Flight],
    /// Where something was predicted.
    pub windows: &'a [Window],
    /// The predictions there.
    pub rows: &'a [Row],
    /// Index of the model in focus.
    pub focus: usize,
    /// Index of a row that is not drawn unless it is in focus.
    pub yardstick: Option<usize>,
}

/// Measured and predicted over one stretch.
pub fn trace_figure(title: &str, of: &Lines<'_>, stretch: &Stretch) -> Figure {
    let span = stretch.span;
    let flight = &of.flights[span.flight];
    let inside = |(index, window): (usize, &Window)| {
        (window.flight == span.flight && (span.start..span.end).contains(&window.last)).then_some((window.last, index))
    };
    let mut at: Vec<(usize, usize)> = of.windows.iter().enumerate().filter_map(inside).collect();
    at.sort_unstable();
    // Samples next to each other are joined; where windows are further apart, a line between them would show what nobody predicted.
    let gaps: Vec<usize> = at.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let sparse = 2 * gaps.iter().filter(|gap| **gap > 1).count() > gaps.len();
    let mut points: Vec<(usize, Option<usize>)> = Vec::new();
    for (place, (sample, index)) in at.iter().enumerate() {
        if !sparse && place > 0 && sample - at[place - 1].0 > 1 {
            points.push((at[place - 1].0 + 1, None));
        }
        points.push((*sample, Some(*index)));
    }
    // The model in focus first, so that it has the same look on every page.
    let others = (0..of.rows.len()).filter(|index| *index != of.focus && of.yardstick != Some(*index));
    let order: Vec<&Row> = [of.focus].into_iter().chain(others).take(MODELS).filter_map(|index| of.rows.get(index)).collect();
    let measured = |channel: Channel| flight.column(channel.column());
    // No number breaks a line.
    let predicted = |row: &Row, channel: Channel| -> Vec<f64> {
        points.iter().map(|(_, window)| window.map_or(f64::NAN, |window| row.predicted[window][channel])).collect()
    };
    let left = |row: &Row, channel: Channel| -> Vec<f64> {
        predicted(row, channel).iter().zip(&points).map(|(value, (sample, _))| measured(channel)[*sample] - value).collect()
    };
    let sticks = [Column::U1, Column::U2, Column::U3, Column::U4].into_iter().filter(|stick| !flight.absent.contains(stick));
    let trace = Trace {
        time_s: (span.start..span.end).map(|sample| flight.time_s(sample)).collect(),
        measured: Channel::ALL.into_iter().map(|channel| measured(channel)[span.start..span.end].to_vec()).collect(),
        predicted_s: points.iter().map(|(sample, _)| flight.time_s(*sample)).collect(),
        sparse,
        models: order
            .iter()
            .map(|row| (row.name.clone(), Channel::ALL.into_iter().map(|channel| predicted(row, channel)).collect()))
            .collect(),
        residuals: order.iter().take(2).map(|row| Channel::ALL.into_iter().map(|channel| left(row, channel)).collect()).collect(),
        sticks: sticks.map(|stick| (stick.name().to_owned(), flight.column(stick)[span.start..span.end].to_vec())).collect(),
    };
    let caption = format!(
        "Flight {}, manoeuvre {}, {:.1} s to {:.1} s. Normalised error {:.2} (1 is as bad as predicting the mean).{}",
        flight.name,
        flight.manoeuvre,
        flight.time_s(span.start),
        flight.time_s(span.end),
        stretch.error,
        if sparse { " Predictions are points: only these samples were predicted." } else { "" }
    );
    figures::traces(title, &caption, &channel_panels(), &trace)
}

/// RMSE over the standard deviation of the channel.
pub(super) fn normalised(part: &PartError, deviation: &ChannelValues) -> PerChannel<Option<f64>> {
    PerChannel::from_fn(|channel| Some(part.rmse.channels()[channel]? / deviation.channels()[channel]?))
}

/// Manoeuvre × channel and regime × channel of a model, beside those of another where there is one: in one order and on one scale.
pub fn maps(before: Option<&ModelError>, model: &ModelError, deviation: &ChannelValues) -> Vec<Part> {
    let row = |name: &str, part: &PartError, old: Option<&PartError>| {
        let (shades, old_shades) = (normalised(part, deviation), old.map(|old| normalised(old, deviation)));
        let cell = |channel: Channel| MapCell {
            text: Kind::Error.text(part.rmse.channels()[channel]),
            detail: part.rmse_ci95.channels()[channel]
                .map_or_else(String::new, |[low, high]| format!("{} … {}", significant(low, 2), significant(high, 2))),
            value: shades[channel],
            before: old.zip(old_shades).map(|(old, shades)| (Kind::Error.text(old.rmse.channels()[channel]), shades[channel])),
        };
        (
            name.to_owned(),
            format!("n = {} in {} blocks", part.n, part.blocks),
            Channel::ALL.into_iter().map(cell).collect::<Vec<_>>(),
        )
    };
    // The worst part before first.
    let score = |part: &PartError| normalised(part, deviation).into_iter().flatten().fold(0.0, f64::max);
    let first = before.unwrap_or(model);
    let rows = |of: fn(&ModelError) -> &BTreeMap<String, PartError>| {
        let mut order: Vec<&String> = of(first).iter().filter(|(_, part)| part.n > 0).map(|(name, _)| name).collect();
        order.sort_by(|a, b| score(&of(first)[*b]).total_cmp(&score(&of(first)[*a])));
        let row = |name: &&String| Some(row(name, of(model).get(*name)?, before.and_then(|before| of(before).get(*name))));
        order.iter().filter_map(row).collect::<Vec<_>>()
    };
    let (manoeuvres, regimes) = (rows(|model| &model.by_manoeuvre), rows(|model| &model.by_regime));
    let shades = manoeuvres.iter().chain(&regimes).flat_map(|(.., cells)| cells);
    let shades = shades.flat_map(|cell| [cell.value, cell.before.as_ref().and_then(|before| before.1)]).flatten();
    let full = shades.filter(|value| value.is_finite()).fold(0.0, f64::max);
    let who = before.map_or_else(
        || format!("RMSE of {}", model.name),
        |before| format!("RMSE of {} (left) and {} (right)", before.name, model.name),
    );
    let map = |what: &str, rows| {
        Part::Map(Map {
            caption: format!("{who} by {what}"),
            shade: "RMSE over the standard deviation of the channel; 1 is as bad as predicting its mean".into(),
            full: Some(full),
            columns: channel_columns(what, false, false),
            rows,
        })
    };
    let rules: Vec<String> = Regime::ALL.iter().map(|regime| format!("{}: {}", regime.name(), regime.rule())).collect();
    vec![
        Part::Text(
            "A dark row is a manoeuvre, a dark column a channel that is missed. The worst part first, by its worst channel.".into(),
        ),
        map("manoeuvre", manoeuvres),
        map("regime", regimes),
        Part::Details(
            "What the regimes are, and what the numbers rest on".into(),
            vec![Part::Text(format!(
                "A sample has the first regime whose rule holds. {}. n counts windows; one window has no figures. Intervals rest on blocks of ten \
                 seconds, as neighbouring samples are not independent; without one there is a single block.",
                rules.join("; ")
            ))],
        ),
    ]
}

/// Share of a residual below which no variable is drawn: 14 bins of pure noise reach it in a few minutes of flight.
const SHARE_SHOWN: f64 = 0.01;

/// Which variables go with the residuals of the channels, with those of another model beside them: a map of shares.
pub fn shares_map(
    caption: &str,
    found: &[(Variable, PerChannel<Dependence>)],
    before: Option<&[(Variable, PerChannel<Dependence>)]>,
    full: Option<f64>,
) -> Part {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let row = |(variable, of): &(Variable, PerChannel<Dependence>)| {
        let old = before.and_then(|before| before.iter().find(|(other, _)| other == variable));
        let cell = |channel: Channel| MapCell {
            text: percent(of[channel].share),
            value: Some(of[channel].share),
            before: old.map(|(_, old)| (percent(old[channel].share), Some(old[channel].share))),
            detail: String::new(),
        };
        let words = spoken(variable.name()).unwrap_or_default();
        (figures::with_unit(variable.name(), variable.unit()), words.to_owned(), Channel::ALL.into_iter().map(cell).collect())
    };
    Part::Map(Map {
        caption: caption.to_owned(),
        shade: "correlation ratio η² of binned means".into(),
        full,
        columns: channel_columns("variable", true, false),
        rows: found.iter().map(row).collect(),
    })
}

/// Which variables the residual goes with, and how.
pub fn residuals(report: &CompareReport<'_>) -> Result<Vec<Part>> {
    let (_, place) = report.before();
    let of = |place: usize| match report.rows.get(place) {
        Some(row) => dependences(report.flights, report.windows, row, &Variable::ALL),
        None => Ok(Vec::new()),
    };
    let (found, before) = (of(report.focus)?, of(place)?);
    if found.is_empty() {
        return Ok(vec![Part::Text("No recorded variable varies in these windows.".into())]);
    }
    let pair = (place != report.focus).then_some(before.as_slice());
    let name = |place: usize| report.rows.get(place).map_or("", |row| row.name.as_str());
    let whose = match pair {
        Some(_) => format!("{} (left) and {} (right)", name(place), name(report.focus)),
        None => name(report.focus).to_owned(),
    };
    let mut parts = vec![
        Part::Text(
            "The residual is measured − predicted. A model that has all the physics leaves one that goes with nothing.".into(),
        ),
        shares_map(&format!("Share of the residual of {whose} that goes with one variable alone"), &found, pair, None),
    ];
    let mut quiet = Vec::new();
    for channel in Channel::ALL {
        let mut order: Vec<&(Variable, PerChannel<Dependence>)> = found.iter().collect();
        order.sort_by(|a, b| b.1[channel].share.total_cmp(&a.1[channel].share));
        if order.first().is_none_or(|(_, of)| of[channel].share < SHARE_SHOWN) {
            quiet.push(said(channel.name()));
            continue;
        }
        let names: Vec<String> = order.iter().take(VARIABLES).map(|(variable, _)| named(variable.name())).collect();
        let panel = |((variable, of), name): (&&(Variable, PerChannel<Dependence>), &'_ String)| {
            (name.clone(), variable.unit(), of[channel].clone())
        };
        let panels: Vec<_> = order.iter().zip(&names).map(panel).collect();
        let panels: Vec<BinnedPanel<'_>> = panels
            .iter()
            .map(|(variable, unit, dependence)| BinnedPanel { variable, unit, dependence, change: None, after: None })
            .collect();
        let caption = format!("What is left by {}, against the variables it goes with most.", name(report.focus));
        let title = format!("Residual of {}", named(channel.name()));
        parts.push(Part::Figure(figures::binned(&title, &caption, channel.unit(), &panels)));
    }
    if !quiet.is_empty() {
        parts.push(Part::Text(format!(
            "No variable accounts for 1 % of the residual of {}: there is nothing to show.",
            quiet.join(", ")
        )));
    }
    Ok(parts)
}
