//! What a diagnosis says, as tables: every effect that was tried, the fall of the error, what these flights cannot show, and where it
//! comes from. No measuring: every number is one of [`Diagnosis`].

use super::super::compare::{channel_columns, channel_panels};
use super::super::figures;
use super::super::page::{Cell, DATA_NOTE, Part, Table, data_notes};
use super::{DiagnoseReport, notes};
use crate::critique::diagnose::sentences::{or_the_log, removable, rises, share, tried, unseen, worth};
use crate::critique::diagnose::{CandidateReport, Diagnosis, Influence, Locked, Status, Step, number_remark};
use crate::critique::digits::{Kind, significant};
use crate::critique::table::OWN_FROM_FIRST_HALF;
use crate::error::{Error, Result};
use crate::flight::{Column, Span};
use crate::physics::catalogue;
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

/// Every effect that was found with what it is worth, as one list; nothing where that was not measured.
pub(super) fn found(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let Some(whole) = report.told().last().filter(|whole| !whole.worth.is_empty()) else { return Vec::new() };
    let on = whole.locked.as_ref().map_or_else(String::new, |locked| unseen(locked.kept, locked.duration_s));
    let all_refitted = whole.worth.iter().all(|worth| worth.refitted);
    let mut order = worth(&on, all_refitted);
    order.replace_range(..1, "T");
    let rows = whole.by_worth().into_iter().enumerate().map(|(place, (step, of))| {
        let others = if step.indistinguishable.is_empty() { "–".to_owned() } else { step.indistinguishable.join(", ") };
        let [number, share] = [(place + 1).to_string(), of.map_or_else(|| "–".into(), share)];
        let [numbers, _] = numbers(step);
        [number, step.effect.clone(), share, numbers, others, step.meaning.clone()].map(Cell::from).into()
    });
    let names = [
        ("", ""),
        ("effect", ""),
        ("share", "of the squared error before"),
        ("numbers", "95 % interval"),
        ("cannot be told from", ""),
        ("the physics", ""),
    ];
    let rows = rows.collect();
    let caption = String::new();
    vec![Part::Text(order), Part::Table(Table { caption, columns: columns(&names), rows })]
}

/// View 7.
pub(super) fn ranking(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let mut parts = vec![Part::Text(
        "Accepted effects first, then by what they would still remove. A p-value never stands alone: an effect is accepted only if it \
         cannot be chance and removes a share of the error on blocks that it was not fitted to. Competes with: for an accepted \
         effect, what these flights cannot tell from it; for others, what the catalogue knows to look alike."
            .into(),
    )];
    for (round, diagnosis) in report.diagnoses.iter().enumerate() {
        let caption = if report.diagnoses.len() > 1 { format!("Round {}", round + 1) } else { "Effects tried".into() };
        if diagnosis.candidates.is_empty() {
            parts.push(Part::Text(format!("{caption}: no effect was tried. {}", diagnosis.summary)));
            continue;
        }
        let rows = diagnosis.candidates.iter().map(|candidate| row(diagnosis, candidate)).collect();
        let names = [
            ("effect", ""),
            ("status", ""),
            ("held-out error removed", "share of the mean squared error"),
            ("p", "one effect"),
            ("the physics", ""),
            ("why", ""),
            ("competes with", ""),
            ("needs", "to show at all"),
        ];
        parts.push(Part::Table(Table { caption, columns: columns(&names), rows }));
        if !diagnosis.steps.is_empty() {
            let rows = diagnosis.steps.iter().map(|step| {
                let [found, usual] = numbers(step);
                let wins = format!("{:.0} % ({})", 100.0 * step.selection_frequency, step.stability);
                [step.effect.clone(), wins, found, usual].map(Cell::from).into()
            });
            let names =
                [("effect", ""), ("wins", "of resampled worlds"), ("numbers", "95 % interval"), ("usual", "5 kg helicopter")];
            let caption = "Numbers of the accepted effects, in order of acceptance".into();
            parts.push(Part::Table(Table { caption, columns: columns(&names), rows: rows.collect() }));
        }
        for step in &diagnosis.steps {
            parts.push(Part::Text(format!("{} as formulas, with its numbers in place:", step.effect)));
            parts.push(Part::Code(step.formula.clone()));
        }
        if let Some(method) = &diagnosis.method {
            parts.push(Part::Text(format!(
                "Accepted: p at most {:.4} ({} effects in play), and at least {:.1} % of a channel's held-out error.",
                method.largest_p_value,
                method.effects_in_play,
                100.0 * method.smallest_fall
            )));
        }
    }
    parts
}

fn row(diagnosis: &Diagnosis, candidate: &CandidateReport) -> Vec<Cell> {
    let step = diagnosis.steps.iter().find(|step| step.effect == candidate.effect);
    let known = catalogue::definition(&candidate.effect);
    let dash = || "–".to_owned();
    let competes = match (step, notes(&candidate.effect)) {
        (Some(step), _) if step.indistinguishable.is_empty() => "nothing fits as well".into(),
        (Some(step), _) => step.indistinguishable.join(", "),
        (None, Some(notes)) if !notes.confusable_with.is_empty() => notes.confusable_with.join(", "),
        (None, _) => dash(),
    };
    // The remark of a candidate that is not excited names what is wanted, too.
    let needs = || notes(&candidate.effect).map(|notes| notes.excitation.to_owned());
    let meaning = step.map(|step| step.meaning.clone()).or_else(|| known.map(|known| known.meaning.to_owned()));
    let cells = [
        candidate.effect.clone(),
        candidate.status.words().to_owned(),
        falls(&candidate.held_out_mse_fall),
        candidate.p_value.map_or_else(dash, |p| format!("{p:.4}")),
        meaning.unwrap_or_else(|| "a formula of the model file".into()),
        if candidate.reason.is_empty() { dash() } else { candidate.reason.clone() },
        competes,
        candidate.note.clone().or_else(needs).unwrap_or_else(dash),
    ];
    cells.map(Cell::from).into()
}

/// What to paste where something is left that no effect of the catalogue explains.
pub(super) fn suggestions(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let unknown = report.diagnoses.last().and_then(|diagnosis| diagnosis.unknown.as_ref());
    let mut parts = Vec::new();
    for unknown in unknown.into_iter().flatten() {
        let on: Vec<String> =
            unknown.depends_on.iter().take(4).map(|on| format!("{} ({:.0} %)", on.variable, 100.0 * on.share)).collect();
        parts.push(Part::Text(format!(
            "What is left of {} depends on {}: measured variables predict {:.0} % of its variance on blocks that were not learned \
             from (chance reaches {:.1} % in one of twenty data sets). Shape: {}.",
            unknown.channel,
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

/// View 8.
pub(super) fn waterfall(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let mut names = Vec::new();
    let mut values: Vec<Vec<Option<f64>>> = Vec::new();
    for diagnosis in report.diagnoses {
        let Some(locked) = &diagnosis.locked else { continue };
        for bar in locked.waterfall.iter().skip(usize::from(!values.is_empty())) {
            names.push(bar.name());
            values.push(bar.rmse.channels().into());
        }
    }
    if values.is_empty() {
        return vec![Part::Text(
            "No flights were kept from the search, or nothing was searched: there is nothing to confirm on.".into(),
        )];
    }
    let caption = if names.len() == 1 {
        "Nothing was added. The bar is what is left of the error on the part that no search has seen."
    } else {
        "Each bar adds what its name says to the one before, with the numbers of all that are in fitted again. Look for the step in the channels \
         that an effect changes; a bar that does not fall here, on the part that no search has seen, speaks against it."
    };
    let mut words = Vec::new();
    words.extend(report.diagnoses.iter().filter_map(|diagnosis| rises(diagnosis.locked.as_ref()?)).map(Part::Text));
    if report.told().iter().any(|diagnosis| diagnosis.locked.as_ref().is_some_and(|locked| locked.own_from_first_half)) {
        words.push(Part::Text(OWN_FROM_FIRST_HALF.into()));
    }
    let unknown = report.diagnoses.last().and_then(|diagnosis| diagnosis.unknown.as_ref());
    let measured = |channel: usize| {
        let name = Column::TARGETS[channel].name();
        let one = unknown?.iter().find(|unknown| unknown.channel == name && unknown.suggested_formula.is_some())?;
        one.tried.as_ref()?.locked_rmse
    };
    let with: Vec<Option<f64>> = (0..Column::TARGETS.len()).map(measured).collect();
    if with.iter().any(Option::is_some) {
        names.push("+ suggested formulas".into());
        values.push(with);
        words.push(Part::Text(
            "The bar of the suggested formulas is measured: each of them, calibrated by itself on what was searched. Channels without that \
             bar have none that held."
                .into(),
        ));
    }
    let floor = report.told().iter().find_map(|diagnosis| diagnosis.locked.as_ref()?.floor);
    let floor: Option<Vec<Option<f64>>> = floor.map(|floor| floor.channels().into());
    let last = floor.iter().map(|floor| ("floor", floor));
    let rows = names.iter().map(String::as_str).zip(&values).chain(last).map(|(name, values)| {
        let cells = values.iter().map(|value| Cell::from(Kind::Error.text(*value)));
        [Cell::from(name.to_owned())].into_iter().chain(cells).collect()
    });
    let table = Table {
        caption: "The same as numbers: RMSE on the part that no search has seen".into(),
        columns: channel_columns("model", false, false),
        rows: rows.collect(),
    };
    let below = if floor.is_some() {
        " The dashed line and the last bar are the floor: what gusts, turbulence and noise leave."
    } else {
        ""
    };
    let caption = format!("{caption}{below}");
    let figure = figures::steps("RMSE from effect to effect", &caption, &channel_panels(), &names, &values, floor.as_deref());
    let mut parts = vec![Part::Figure(figure), Part::Table(table)];
    parts.extend(words);
    let several = report.told().len() > 1;
    for (round, diagnosis) in report.told().iter().enumerate() {
        let Some(locked) = diagnosis.locked.as_ref().filter(|locked| !locked.mse_fall.is_empty()) else { continue };
        let round = if several { format!(", round {}", round + 1) } else { String::new() };
        parts.push(Part::Table(removed(locked, &round)));
        parts.extend(removable(locked).map(Part::Text));
    }
    parts
}

/// What was removed, by channel: of all the error and, with a floor, of what lies above it.
fn removed(locked: &Locked, round: &str) -> Table {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let above = |channel: &str| {
        let place = Column::TARGETS.iter().position(|column| column.name() == channel)?;
        locked.removable_removed?.channels()[place]
    };
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

/// View 9.
pub(super) fn not_judged(diagnosis: &Diagnosis) -> Vec<Part> {
    let mut parts = Vec::new();
    for step in diagnosis.steps.iter().filter(|step| !step.indistinguishable.is_empty()) {
        let others = step.indistinguishable.join(", ");
        parts.push(Part::Text(format!("{} or {others}? These flights fit both. To tell: {}.", step.effect, step.would_tell_apart)));
    }
    for step in &diagnosis.steps {
        let fault = step.fault_of_log.iter();
        parts.extend(fault.map(|fault| Part::Text(format!("{}, {}.", step.effect, or_the_log(fault)))));
    }
    let mut candidates: Vec<&CandidateReport> =
        diagnosis.candidates.iter().filter(|candidate| candidate.status != Status::Accepted).collect();
    if candidates.is_empty() {
        parts.push(Part::Text(if diagnosis.candidates.is_empty() {
            "No effect was tried, so none can be ruled out.".into()
        } else {
            "Every effect that was tried was accepted.".into()
        }));
        return parts;
    }
    // Those that cannot be judged at all first, then those that could hide the most.
    let rank = |candidate: &CandidateReport| {
        (candidate.status == Status::NotExcited, candidate.detection_limit_mse_fall.unwrap_or_default())
    };
    candidates.sort_by(|a, b| rank(b).0.cmp(&rank(a).0).then(rank(b).1.total_cmp(&rank(a).1)));
    let dash = || "–".to_owned();
    let rows = candidates.iter().map(|candidate| {
        let limit = candidate.detection_limit_mse_fall.map_or_else(dash, |limit| format!("{:.1} %", 100.0 * limit));
        let about = |text: fn(&crate::physics::Notes) -> &str| {
            notes(&candidate.effect).map(text).filter(|text| !text.is_empty()).map_or_else(dash, str::to_owned)
        };
        let cells = [
            candidate.effect.clone(),
            candidate.status.words().to_owned(),
            limit,
            candidate.note.clone().unwrap_or_else(|| about(|notes| notes.excitation)),
            about(|notes| notes.would_tell_apart),
        ];
        cells.map(Cell::from).into()
    });
    parts.insert(
        0,
        Part::Text(
            "That an effect was not named does not mean that it is absent. Below its limit it would go unnoticed in these flights; \
             an effect that is not excited cannot be judged at all until it is flown."
                .into(),
        ),
    );
    parts.push(Part::Table(Table {
        caption: "Effects not named: how large one could be and stay unnoticed".into(),
        columns: columns(&[
            ("effect", ""),
            ("status", ""),
            ("limit", "share of the error, 80 % power"),
            ("the flights must contain", ""),
            ("the flight that would tell", ""),
        ]),
        rows: rows.collect(),
    }));
    parts
}

/// View 10.
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
    parts.push(Part::Details("The diagnosis as JSON, the numbers of this page".into(), json));
    Ok(parts)
}
