//! What a diagnosis says, as lists and tables: what was found with its numbers, what to try, what was tried and not named, and where it comes
//! from. No measuring: every number is one of [`Diagnosis`].

use super::super::compare::channel_columns;
use super::super::figures::{self, RangeRow};
use super::super::names::said;
use super::super::page::{Cell, DATA_NOTE, Part, Table, data_notes};
use super::{DiagnoseReport, first, notes};
use crate::critique::diagnose::sentences::{or_the_log, share, tried, unseen, worth};
use crate::critique::diagnose::{CandidateReport, Influence, Locked, Status, Step, number_remark};
use crate::critique::digits::{Kind, significant};
use crate::error::{Error, Result};
use crate::flight::{Channel, Span};
use crate::physics::{Vehicle, catalogue};
use std::collections::BTreeMap;

fn columns(names: &[(&str, &str)]) -> Vec<(String, String)> {
    names.iter().map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned())).collect()
}

/// Falls of the error in percent, the largest first; those that round to nothing are left out unless all do.
fn falls(falls: &BTreeMap<String, f64>) -> String {
    let mut sorted: Vec<(&String, f64)> = falls.iter().map(|(channel, fall)| (channel, 100.0 * fall)).collect();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let shown: Vec<String> =
        sorted.iter().filter(|(_, fall)| fall.abs() >= 0.1).map(|(channel, fall)| format!("{channel} {fall:.1} %")).collect();
    match (sorted.is_empty(), shown.is_empty()) {
        (true, _) => "–".into(),
        (false, true) => "less than 0.1 %".into(),
        (false, false) => shown.join(", "),
    }
}

/// On which flight a number hangs, to stand behind it.
fn influence(influence: &Option<Influence>) -> String {
    influence.as_ref().map_or_else(String::new, |influence| format!("; {influence}"))
}

/// Coefficients and parameters of an accepted effect: as found, and what is usual.
fn numbers(step: &Step) -> [String; 2] {
    let with_unit = |unit: &str| if unit == "1" { String::new() } else { format!(" {unit}") };
    let mut found = Vec::new();
    let mut usual = Vec::new();
    for number in &step.coefficients {
        let interval = number.ci95.map(|[low, high]| format!(" [{}, {}]", significant(low, 3), significant(high, 3)));
        let spread = number.rms_over_flights.map(|rms| format!(", rms over flights {}", significant(rms, 3)));
        found.push(format!(
            "{} = {}{}{}{}{}{}",
            number.name,
            significant(number.value, 4),
            interval.unwrap_or_default(),
            with_unit(&number.unit),
            spread.unwrap_or_default(),
            number_remark(number),
            influence(&number.influence)
        ));
        if let Some([low, high]) = number.expected {
            let outside = number.value < low || number.value > high;
            usual.push(format!("{} {low} to {high}{}", number.name, if outside { " (found outside)" } else { "" }));
        }
    }
    for parameter in &step.parameters {
        let how = match (parameter.fixed, parameter.profile) {
            (true, _) => "known".to_owned(),
            (false, None) => "fitted".to_owned(),
            (false, Some([low, high])) => format!("fitted, {} to {}", significant(low, 3), significant(high, 3)),
        };
        let (value, unit) = (significant(parameter.value, 4), with_unit(&parameter.unit));
        found.push(format!("{} = {value}{unit} ({how}{})", parameter.name, influence(&parameter.influence)));
    }
    [found.join("; "), usual.join("; ")].map(|text| if text.is_empty() { "–".into() } else { text })
}

/// Every effect that was found with what it is worth, its numbers beside what is usual, and its formulas; nothing where none was found.
pub(super) fn found(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let steps: Vec<&Step> = report.told().iter().flat_map(|diagnosis| &diagnosis.steps).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    let mut parts = Vec::new();
    for (round, whole) in report.told().iter().enumerate().filter(|(_, whole)| !whole.steps.is_empty()) {
        let measured = !whole.worth.is_empty();
        if measured {
            let on = whole.locked.as_ref().map_or_else(String::new, |locked| unseen(locked.kept, locked.duration_s));
            let mut order = worth(&on, whole.worth.iter().all(|worth| worth.refitted));
            order.replace_range(..1, "T");
            parts.push(Part::Text(order));
        }
        let rows = whole.by_worth().into_iter().map(|(step, of)| {
            let others = if step.indistinguishable.is_empty() { "–".to_owned() } else { step.indistinguishable.join(", ") };
            let share = of.map_or_else(|| falls(&step.held_out_mse_fall), share);
            let wins = format!("{:.0} % ({})", 100.0 * step.selection_frequency, step.stability);
            let p = format!("{:.4}", step.p_value);
            [step.effect.clone(), step.meaning.clone(), share, wins, p, others].map(Cell::from).into()
        });
        let of = if measured { "of the squared error before" } else { "held out, of the squared error" };
        let names = [
            ("effect", ""),
            ("the physics", ""),
            ("share", of),
            ("wins", "of resampled worlds"),
            ("p", ""),
            ("cannot be told from", ""),
        ];
        let caption = if report.told().len() > 1 { format!("Round {}", round + 1) } else { String::new() };
        parts.push(Part::Table(Table { caption, columns: columns(&names), rows: rows.collect() }));
    }
    let of_effects: Vec<(String, Vec<RangeRow>)> =
        steps.iter().map(|step| (step.effect.clone(), range_rows(step))).filter(|(_, rows)| !rows.is_empty()).collect();
    if !of_effects.is_empty() {
        let caption = "Each row has an axis of its own from zero; a number outside its usual range is orange.";
        parts.push(Part::Figure(figures::ranges("Numbers beside what is usual", caption, &of_effects)));
    }
    let rows = steps.iter().map(|step| {
        let [found, usual] = numbers(step);
        [step.effect.clone(), found, usual].map(Cell::from).into()
    });
    let names = [("effect", ""), ("numbers", "95 % interval"), ("usual", "5 kg helicopter")];
    let mut more = vec![Part::Table(Table { caption: String::new(), columns: columns(&names), rows: rows.collect() })];
    for step in &steps {
        more.push(Part::Text(format!("{}, with its numbers in place:", step.effect)));
        more.push(Part::Code(step.formula.clone()));
    }
    parts.push(Part::Details("The numbers with their intervals, and the effects as formulas".into(), more));
    parts.extend(step_by_step(report));
    for step in steps.iter().filter(|step| !step.indistinguishable.is_empty()) {
        let others = step.indistinguishable.join(", ");
        parts.push(Part::Text(format!("{} or {others}? These flights fit both. To tell: {}.", step.effect, step.would_tell_apart)));
    }
    let faults = steps.iter().filter_map(|step| Some(format!("{}, {}.", step.effect, or_the_log(step.fault_of_log.as_ref()?))));
    let faults: Vec<Part> = faults.map(Part::Text).collect();
    if !faults.is_empty() {
        parts.push(Part::Details("What could be wrong with the log instead".into(), faults));
    }
    parts
}

/// The numbers of an effect that were fitted.
fn range_rows(step: &Step) -> Vec<RangeRow> {
    let of_coefficients = step.coefficients.iter().map(|number| RangeRow {
        name: number.name.clone(),
        unit: number.unit.clone(),
        value: number.value,
        ci95: number.ci95,
        usual: number.expected,
        by_flight: number.by_flight.iter().map(|(flight, value)| (flight.clone(), *value)).collect(),
    });
    let of_parameters = step.parameters.iter().filter(|parameter| !parameter.fixed).map(|parameter| RangeRow {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        value: parameter.value,
        ci95: parameter.profile,
        usual: None,
        by_flight: Vec::new(),
    });
    of_coefficients.chain(of_parameters).collect()
}

/// The strip of the first screen as numbers, and what was removed.
fn step_by_step(report: &DiagnoseReport<'_>) -> Option<Part> {
    let bars = first::bars(report);
    let floor = report.told().iter().find_map(|diagnosis| diagnosis.locked.as_ref()?.floor);
    let names = bars.iter().map(|bar| (bar.name(), &bar.rmse)).chain(floor.iter().map(|floor| ("floor".to_owned(), floor)));
    let rows = names.map(|(name, rmse)| {
        let cells = rmse.channels().into_iter().map(|value| Cell::from(Kind::Error.text(value)));
        [Cell::from(name)].into_iter().chain(cells).collect()
    });
    let caption = "RMSE on the part that no search has seen".into();
    let mut parts = vec![Part::Table(Table { caption, columns: channel_columns("model", false, false), rows: rows.collect() })];
    let several = report.told().len() > 1;
    for (round, diagnosis) in report.told().iter().enumerate() {
        let Some(locked) = diagnosis.locked.as_ref().filter(|locked| !locked.mse_fall.is_empty()) else { continue };
        let round = if several { format!(", round {}", round + 1) } else { String::new() };
        parts.push(Part::Table(removed(locked, &round)));
    }
    (!bars.is_empty()).then(|| Part::Details("The error from effect to effect as numbers".into(), parts))
}

/// What to paste where something is left that no effect of the catalogue explains.
pub(super) fn suggestions(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let unknown = report.diagnoses.last().and_then(|diagnosis| diagnosis.unknown.as_ref());
    let mut parts = Vec::new();
    for unknown in unknown.into_iter().flatten() {
        let on: Vec<String> =
            unknown.depends_on.iter().take(4).map(|on| format!("{} ({:.0} %)", said(&on.variable), 100.0 * on.share)).collect();
        parts.push(Part::Text(format!(
            "What is left of {} depends on {}: measured variables predict {:.0} % of its variance on blocks that were not learned \
             from (chance reaches {:.1} % in one of twenty data sets). Shape: {}.",
            said(&unknown.channel),
            on.join(", "),
            100.0 * unknown.r2,
            100.0 * unknown.null_r2_95.max(0.0),
            unknown.shape
        )));
        if let Some(formula) = &unknown.tried {
            let locked = report.diagnoses.last().and_then(|diagnosis| diagnosis.locked.as_ref());
            let (kept, duration_s) = locked.map_or_else(Default::default, |locked| (locked.kept, locked.duration_s));
            let mut words = tried(&unknown.channel, formula, kept, duration_s);
            words.replace_range(..1, &words[..1].to_uppercase());
            parts.push(Part::Text(format!("{words}.")));
        }
        if let Some(formula) = &unknown.suggested_formula {
            parts.push(Part::Text("To try, in the model file:".into()));
            parts.push(Part::Code(format!(
                "[[effect]]\nkind = \"formula\"\nname = \"suggested_{0}\"\nchannel = \"{0}\"\nformula = \"{formula}\"\ncoefficient = {1:.4}",
                unknown.channel,
                unknown.suggested_coefficient.unwrap_or_default()
            )));
        }
    }
    parts
}

/// What was removed, by channel: of all the error and, with a floor, of what lies above it.
fn removed(locked: &Locked, round: &str) -> Table {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let above = |channel: &str| locked.removable_removed?.channels()[Channel::from_name(channel)?];
    let rows = locked.mse_fall.iter().map(|(channel, fall)| {
        let mut row: Vec<Cell> = vec![channel.as_str().into()];
        row.extend(fall.map(|share| percent(share).into()));
        row.extend(locked.floor.map(|_| Cell::from(above(channel).map_or_else(|| "–".into(), percent))));
        row
    });
    let mut names = vec![("channel", ""), ("removed", "%"), ("from", "% (95 %)"), ("to", "% (95 %)")];
    names.extend(locked.floor.map(|_| ("of the removable", "%")));
    Table {
        caption: format!("Share of the mean squared error removed on {:.0} s ({}){round}", locked.duration_s, locked.part),
        columns: columns(&names),
        rows: rows.collect(),
    }
}

/// Every effect that was tried and not named, folded: those that cannot be judged first, then those that could hide the most.
pub(super) fn not_named(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let Some(diagnosis) = report.together.or(report.diagnoses.last()) else { return Vec::new() };
    let mut candidates: Vec<&CandidateReport> =
        diagnosis.candidates.iter().filter(|candidate| candidate.status != Status::Accepted).collect();
    if candidates.is_empty() {
        return vec![Part::Text(if diagnosis.candidates.is_empty() {
            "No effect was tried, so none can be ruled out.".into()
        } else {
            "Every effect that was tried was accepted.".into()
        })];
    }
    let rank = |candidate: &CandidateReport| {
        (candidate.status == Status::NotExcited, candidate.detection_limit_mse_fall.unwrap_or_default())
    };
    candidates.sort_by(|a, b| rank(b).0.cmp(&rank(a).0).then(rank(b).1.total_cmp(&rank(a).1)));
    let silent = candidates.iter().filter(|candidate| candidate.status == Status::NotExcited).count();
    let names = [
        ("effect", ""),
        ("status", ""),
        ("would remove", "held out, of the squared error"),
        ("p", "one effect"),
        ("limit", "share of the error, 80 % power"),
        ("why", ""),
        ("the physics", ""),
        ("looks like", ""),
        ("the flights must contain", ""),
        ("the flight that would tell", ""),
    ];
    let vehicle = report.before.vehicle;
    let rows = candidates.iter().map(|candidate| row(candidate, vehicle)).collect();
    let mut parts =
        vec![Part::Table(Table { caption: "Effects that were tried and not named".into(), columns: columns(&names), rows })];
    if let Some(method) = &diagnosis.method {
        parts.push(Part::Text(format!(
            "Accepted: p at most {:.4} ({} effects in play), and at least {:.1} % of a channel's held-out error. A p-value never stands alone.",
            method.largest_p_value,
            method.effects_in_play,
            100.0 * method.smallest_fall
        )));
    }
    vec![
        Part::Text(format!(
            "That an effect was not named does not mean that it is absent: below its limit it would go unnoticed in these flights, and {silent} of \
             these {} cannot be judged at all until what excites them is flown.",
            candidates.len()
        )),
        Part::Details(format!("All {}, with why, their limits, and the flight that would tell", candidates.len()), parts),
    ]
}

fn row(candidate: &CandidateReport, vehicle: Vehicle) -> Vec<Cell> {
    let known = catalogue::definition(&candidate.effect);
    let dash = || "–".to_owned();
    let about = |text: fn(&crate::physics::Notes) -> &str| {
        notes(&candidate.effect).map(text).filter(|text| !text.is_empty()).map_or_else(dash, str::to_owned)
    };
    let flies = |other: &&str| notes(other).is_some_and(|notes| notes.vehicles.contains(&vehicle));
    let alike =
        notes(&candidate.effect).map(|notes| notes.confusable_with.iter().copied().filter(flies).collect::<Vec<_>>().join(", "));
    let alike = alike.filter(|text| !text.is_empty());
    let cells = [
        candidate.effect.clone(),
        candidate.status.words().to_owned(),
        falls(&candidate.held_out_mse_fall),
        candidate.p_value.map_or_else(dash, |p| format!("{p:.4}")),
        candidate.detection_limit_mse_fall.map_or_else(dash, |limit| format!("{:.1} %", 100.0 * limit)),
        if candidate.reason.is_empty() { dash() } else { candidate.reason.clone() },
        known.map_or_else(|| "a formula of the model file".into(), |known| known.meaning.to_owned()),
        alike.unwrap_or_else(dash),
        candidate.note.clone().unwrap_or_else(|| about(|notes| notes.excitation)),
        about(|notes| notes.would_tell_apart),
    ];
    cells.map(Cell::from).into()
}

/// Where the numbers come from.
pub(super) fn provenance(report: &DiagnoseReport<'_>) -> Result<Vec<Part>> {
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut add = |what: &str, value: String| rows.push((what.to_owned(), value));
    let seconds = |spans: &[Span]| {
        let of = |span: &Span| report.flights.get(span.flight).map_or(0.0, |flight| (span.end - span.start) as f64 * flight.step_s);
        spans.iter().map(of).sum::<f64>()
    };
    add("flights", report.flights.len().to_string());
    add("searched", format!("{:.0} s", seconds(report.searched)));
    add("kept from the search", format!("{:.0} s", seconds(report.locked)));
    if let Some(method) = report.diagnoses.last().and_then(|diagnosis| diagnosis.method.as_ref()) {
        add("seed of the search", method.seed.to_string());
        add("blocks", format!("{} of {:.1} s", method.blocks, method.block_s));
        add("residual taken as correlated over", format!("{} s", method.correlation_s));
        add("largest p-value", format!("{:.5} ({} effects in play)", method.largest_p_value, method.effects_in_play));
        add("smallest share of a channel's error", format!("{:.1} %", 100.0 * method.smallest_fall));
    }
    let time: f64 = report.diagnoses.iter().map(|diagnosis| diagnosis.seconds).sum();
    add("time of the search", format!("{time:.1} s"));
    rows.extend(report.provenance.iter().filter(|(what, _)| what != DATA_NOTE).cloned());
    let rows = rows.into_iter().map(|(what, value)| vec![what.into(), value.into()]).collect();
    let mut parts = vec![Part::Table(Table { caption: String::new(), columns: columns(&[("what", ""), ("value", "")]), rows })];
    let mut said: Vec<&String> = Vec::new();
    for note in report.diagnoses.iter().flat_map(|diagnosis| &diagnosis.notes) {
        if !said.contains(&note) {
            said.push(note);
            parts.push(Part::Text(format!("Note: {note}")));
        }
    }
    parts.extend(data_notes(report.provenance));
    let json = match report.diagnoses {
        [one] => serde_json::to_string_pretty(one),
        many => serde_json::to_string_pretty(many),
    };
    let json = json.map_err(|error| Error::Undetermined(format!("a number of the diagnosis has no JSON: {error}")))?;
    parts.push(Part::Details("The diagnosis as JSON, the numbers of this page".into(), vec![Part::Code(json)]));
    Ok(parts)
}
