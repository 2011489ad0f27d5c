//! The page of `compare`: what the models get wrong, in words, one strip of errors, traces, maps, residuals and tables.
//!
//! Arranges the numbers of [`Comparison`] and of `critique::locate` on a [`Page`]; computes none of its own but percentages. Pictures of flights
//! are in `pictures.rs`, tables in `tables.rs`.

mod pictures;
mod tables;

use pictures::normalised;
pub(super) use pictures::{Lines, USE, VARIABLES, maps, shares_map, trace_figure, traces};
pub(super) use tables::{bar_of, channel_columns};
use tables::{coverage_parts, error_tables, share_parts, strip, uncertainty_parts};

use super::names::said;
use super::page::{DATA_NOTE, Page, Part, Section, Table, data_notes};
use crate::critique::digits::significant;
use crate::critique::locate::Traced;
use crate::critique::predictions::deviation;
use crate::critique::table::OWN_FROM_OTHER_HALF;
use crate::critique::{ChannelValues, Comparison, ModelError, PartError, Row, Shares, paired};
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, Targets, Window};

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
    /// The worst and a typical stretch, predicted at every sample by the same rows; where there are none, those windows are drawn that were judged.
    pub traced: &'a [Traced],
    /// Where the numbers come from: (what, value), such as the hash of the data, the seed, the model files.
    pub provenance: &'a [(String, String)],
}

/// The page of one comparison.
///
/// # Errors
/// [`Error::Shape`] if `focus` is not a row, or rows and windows do not fit; with the inputs of the comparison they do.
pub fn compare_page(report: &CompareReport<'_>) -> Result<Page> {
    let model = report.model()?;
    let deviation = deviation(report.flights, report.windows)?;
    let section = |title: &str, parts: Vec<Part>| Section { title: title.into(), parts };
    let mut sections = vec![section("Measured and predicted", pictures::traces(report)?)];
    let (before, _) = report.before();
    sections.push(section("Where the error lies", maps(before, model, &deviation)));
    sections.push(section("What the residual goes with", pictures::residuals(report)?));
    sections.extend(judged_sections(report));
    let mut parts = vec![Part::Table(provenance(report))];
    parts.extend(data_notes(report.provenance));
    sections.push(section("Where these numbers come from", parts));
    Ok(Page {
        title: format!("Measured against predicted: {}", model.name),
        summary: summary(report, model, &deviation)?,
        first: vec![Part::Figure(strip(report.comparison, report.yardstick))],
        sections,
    })
}

/// The errors as tables, who explains what, and what uncertain coefficients do: the part of a comparison that stands on the page of a search, too.
pub(super) fn judged_sections(report: &CompareReport<'_>) -> Vec<Section> {
    let section = |title: &str, parts: Vec<Part>| Section { title: title.into(), parts };
    let mut sections = vec![section("Error per channel", error_tables(report.comparison))];
    if !report.comparison.shares.is_empty() {
        sections.push(section("Who explains what", report.comparison.shares.iter().flat_map(share_parts).collect()));
    }
    if !report.comparison.coverage.is_empty() {
        sections.push(section("Prediction intervals", report.comparison.coverage.iter().flat_map(coverage_parts).collect()));
    }
    if !report.comparison.uncertainty.is_empty() {
        let parts = report.comparison.uncertainty.iter().flat_map(uncertainty_parts).collect();
        sections.push(section("What the uncertain coefficients do", parts));
    }
    sections
}

impl CompareReport<'_> {
    fn model(&self) -> Result<&ModelError> {
        let nothing = || Error::Shape { operation: "report", message: format!("there is no model {} among the rows", self.focus) };
        self.comparison.models.get(self.focus).filter(|_| self.focus < self.rows.len()).ok_or_else(nothing)
    }

    /// The first model that is neither in focus nor the yardstick: what the one in focus is seen against, and its place.
    fn before(&self) -> (Option<&ModelError>, usize) {
        let other = |index: &usize| *index != self.focus && self.yardstick != Some(*index);
        let place = (0..self.comparison.models.len()).find(other);
        (place.and_then(|place| self.comparison.models.get(place)), place.unwrap_or(self.focus))
    }
}

/// The verdict in words.
fn summary(report: &CompareReport<'_>, model: &ModelError, deviation: &ChannelValues) -> Result<Vec<String>> {
    let channels = model.rmse.channels();
    let relative: Vec<(Channel, f64)> = Channel::ALL
        .into_iter()
        .filter_map(|channel| Some((channel, channels[channel]? / deviation.channels()[channel]?)))
        .collect();
    let mut out = Vec::new();
    out.extend(report.comparison.own_from_other_half.then(|| OWN_FROM_OTHER_HALF.to_owned()));
    if model.not_finite > 0 {
        out.push(format!(
            "Beware: {} of {} predictions of {} are not finite numbers. The channels they hit have no error measure.",
            model.not_finite, model.windows, model.name
        ));
    }
    let worst = relative.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let finest = relative.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    if let (Some(worst), Some(finest)) = (worst, finest) {
        let says = |(channel, share): &(Channel, f64)| {
            let unit = channel.unit();
            let rmse = channels[*channel].map_or_else(String::new, |rmse| significant(rmse, 3));
            let name = said(channel.name());
            format!("{name}: off by {rmse} {unit}, {:.0} % of what it varies by", 100.0 * share)
        };
        let (finest, worst) = (says(finest), says(worst));
        out.insert(0, format!("{} predicts best the {finest}; worst the {worst}.", model.name));
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
    let wins: Vec<&str> = Channel::ALL
        .into_iter()
        .filter(|channel| apart.ci95.channels()[*channel].is_some_and(|[low, _]| low > 0.0))
        .map(|channel| channel.name())
        .collect();
    let beats = format!("{} beats the yardstick “{}”", model.name, other.name);
    Ok(Some(match wins.len() {
        0 => format!("{beats} in no channel beyond chance."),
        6 => format!("{beats} in all six channels."),
        count => format!("{beats} beyond chance in {count} of 6 channels: {}.", wins.join(", ")),
    }))
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
