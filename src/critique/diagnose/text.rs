//! A diagnosis as text for a person at a terminal: `{}` folds the effects that were not named into counts, `{:#}` lists them. Lines of
//! at most 120 characters. No words of its own but labels; sentences are in `sentences`.

use super::describe::STABLE;
use super::report::{CandidateReport, Diagnosis, Locked, Method, Number, ParameterValue, Status, Step, UnknownChannel, Worth};
use super::sentences::{self, percent};
use super::signs::number_remark;
use crate::critique::channels::ChannelValues;
use crate::critique::table::OWN_FROM_FIRST_HALF;
use crate::critique::wrap::{clipped, wrapped};
use crate::flight::{Channel, PerChannel};
use crate::physics::digits::printer;
use std::collections::BTreeMap;
use std::fmt;

fn falls(falls: &BTreeMap<String, f64>) -> String {
    let parts: Vec<String> = falls.iter().map(|(channel, fall)| format!("{channel} {:.1} %", 100.0 * fall)).collect();
    if parts.is_empty() { "-".into() } else { parts.join(", ") }
}

/// A unit after its number; a pure number has none.
fn unit_text(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}

/// A coefficient with interval, unit and what there is to say of its sign. At length with what is usual, a remark after the other; in short
/// with what is usual where the number lies outside, in brackets.
fn number_text(number: &Number, long: bool) -> String {
    let shown = printer(4, number.ci95.iter().flatten().copied().chain([number.value]));
    let ci = number.ci95.map(|[low, high]| format!(" [{}, {}]", shown(low), shown(high))).unwrap_or_default();
    let outside = |[low, high]: [f64; 2]| !(low..=high).contains(&number.value);
    let usual = match number.expected {
        Some([low, high]) if long => Some(format!("usual {low} to {high}")),
        Some([low, high]) if outside([low, high]) => Some(format!("outside the usual {low} to {high}")),
        _ => None,
    };
    let spread = number.rms_over_flights.map(|rms| format!("rms over flights {rms:.4}"));
    let remark = Some(number_remark(number).trim_start_matches("; ").to_owned()).filter(|remark| !remark.is_empty());
    let influence = number.influence.as_ref().map(ToString::to_string);
    let remarks: Vec<String> = [usual, spread, remark, influence].into_iter().flatten().collect();
    let value = format!("{} = {}{ci}{}", number.name, shown(number.value), unit_text(&number.unit));
    match remarks.join("; ") {
        remarks if remarks.is_empty() => value,
        remarks if long => format!("{value}; {remarks}"),
        remarks => format!("{value} ({remarks})"),
    }
}

fn parameter_text(parameter: &ParameterValue) -> String {
    let how = if parameter.fixed {
        "known".into()
    } else {
        parameter.profile.map_or("fitted".into(), |[low, high]| format!("fitted, {low:.4} to {high:.4}"))
    };
    let influence = parameter.influence.as_ref().map_or_else(String::new, |influence| format!("; {influence}"));
    format!("{} = {:.4}{} ({how}{influence})", parameter.name, parameter.value, unit_text(&parameter.unit))
}

/// As many effects are told at length without being asked; of more, each takes few lines.
const AT_LENGTH: usize = 3;

/// All effects that were found, as one list.
fn effects(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis) -> fmt::Result {
    let steps = diagnosis.by_worth();
    let long = f.alternate() || steps.len() <= AT_LENGTH;
    if let Some(locked) = diagnosis.locked.as_ref().filter(|_| !diagnosis.worth.is_empty()) {
        let on = sentences::unseen(locked.kept, locked.duration_s);
        let all_refitted = diagnosis.worth.iter().all(|worth| worth.refitted);
        writeln!(f, "\n{}", wrapped("", &format!("Effects found, {}", sentences::worth(&on, all_refitted))))?;
    }
    steps.into_iter().enumerate().try_for_each(|(number, (one, worth))| step(f, number + 1, one, worth, long))
}

fn step(f: &mut fmt::Formatter<'_>, number: usize, step: &Step, worth: Option<&Worth>, long: bool) -> fmt::Result {
    let first = format!("{number}. ");
    let indent = " ".repeat(first.len());
    writeln!(f, "\n{}", wrapped(&first, &format!("{}: {}", step.effect, step.meaning)))?;
    let mut line = |text: &str| writeln!(f, "{}", wrapped(&indent, text));
    if let Some(worth) = worth {
        line(&format!("share: {}", sentences::share(worth)))?;
    }
    if long || worth.is_none() {
        line(&format!("held-out error falls: {}", falls(&step.held_out_mse_fall)))?;
    }
    let wins = format!("wins in {:.0} % of resampled worlds ({})", 100.0 * step.selection_frequency, step.stability);
    let numbers = step.coefficients.iter().map(|number| number_text(number, long));
    let mut numbers = numbers.chain(step.parameters.iter().map(parameter_text));
    if long {
        line(&format!("p = {:.4}; {wins}", step.p_value))?;
        numbers.try_for_each(|number| line(&number))?;
    } else {
        let list: Vec<String> = numbers.collect();
        if !list.is_empty() {
            line(&list.join(", "))?;
        }
        if step.stability != STABLE {
            line(&wins)?;
        }
    }
    match step.indistinguishable.as_slice() {
        [] if long => line("nothing else fits as well")?,
        [] => {}
        others => {
            line(&format!("these flights cannot tell it from {}; to tell: {}", others.join(", "), step.would_tell_apart))?;
        }
    }
    if let Some(fault) = step.fault_of_log.as_ref().filter(|_| long) {
        line(&sentences::or_the_log(fault))?;
    }
    match &step.rests_on_flight {
        Some(flight) => line(&format!("CAUTION: rests on flight `{flight}` alone")),
        None => Ok(()),
    }
}

fn unknown(f: &mut fmt::Formatter<'_>, unknown: &UnknownChannel, locked: Option<&Locked>) -> fmt::Result {
    let on: Vec<String> =
        unknown.depends_on.iter().take(3).map(|on| format!("{} ({:.0} %)", on.variable, 100.0 * on.share)).collect();
    writeln!(f, "\n{}", wrapped("Unknown: ", &format!("{} depends on {} (R2 {:.2})", unknown.channel, on.join(", "), unknown.r2)))?;
    writeln!(f, "{}", wrapped("   ", &unknown.shape))?;
    if let Some(tried) = &unknown.tried {
        let (kept, duration_s) = locked.map_or_else(Default::default, |locked| (locked.kept, locked.duration_s));
        writeln!(f, "{}", wrapped("   ", &sentences::tried(&unknown.channel, tried, kept, duration_s)))?;
    }
    let Some(formula) = &unknown.suggested_formula else { return Ok(()) };
    writeln!(
        f,
        "   to try, in the model file:\n     [[effect]]\n     kind = \"formula\"\n     name = \"suggested_{0}\"\n     \
         channel = \"{0}\"\n     formula = \"{formula}\"\n     coefficient = {1:.4}",
        unknown.channel,
        unknown.suggested_coefficient.unwrap_or_default()
    )
}

/// A table of the six channels: rows of texts under the channels' names.
fn table(f: &mut fmt::Formatter<'_>, head: &str, rows: &[(String, PerChannel<String>)]) -> fmt::Result {
    let line = |cells: &PerChannel<String>| cells.iter().map(|cell| format!("{cell:>13}")).collect::<String>();
    writeln!(f, "   {head:<28}{}", line(&PerChannel::from_fn(|channel| channel.name().to_owned())))?;
    rows.iter().try_for_each(|(name, cells)| writeln!(f, "   {:<28}{}", clipped(name, 28), line(cells)))
}

/// On what part of the flights a table rests, where it is not the whole.
fn halves(f: &mut fmt::Formatter<'_>, locked: &Locked) -> fmt::Result {
    if locked.own_from_first_half { writeln!(f, "{}", wrapped("   ", OWN_FROM_FIRST_HALF)) } else { Ok(()) }
}

/// What was removed on the kept part by channel: its share with interval and, with a floor, the floor and the share of what lies above it.
fn removed(locked: &Locked) -> Vec<(String, PerChannel<String>)> {
    let fall = |channel: Channel| locked.mse_fall.get(channel.name());
    let row = |name: &str, cell: &dyn Fn(Channel) -> Option<String>| {
        (name.to_owned(), PerChannel::from_fn(|channel| cell(channel).unwrap_or_else(|| "–".into())))
    };
    let mut rows = Vec::new();
    if let Some(floor) = &locked.floor {
        rows.push(row("floor", &|channel| Some(format!("{:.4}", floor.channels()[channel]?))));
    }
    if !locked.mse_fall.is_empty() {
        rows.push(row("squared error removed, %", &|channel| Some(percent(fall(channel)?[0]))));
        rows.push(row("   95 % interval", &|channel| {
            fall(channel).map(|[_, low, high]| format!("[{}, {}]", percent(*low), percent(*high)))
        }));
    }
    if let Some(share) = locked.removable_removed.as_ref().filter(|_| !locked.mse_fall.is_empty()) {
        rows.push(row("removable error removed, %", &|channel| Some(percent(share.channels()[channel]?))));
    }
    rows
}

fn rmse_row(name: String, values: &ChannelValues) -> (String, PerChannel<String>) {
    (name, values.channels().map(|value| value.map_or_else(|| "–".into(), |value| format!("{value:.4}"))))
}

/// The errors on the kept part with none, one, two … of the effects.
fn confirmation(f: &mut fmt::Formatter<'_>, locked: &Locked) -> fmt::Result {
    writeln!(f, "\nOn {} ({}):", sentences::unseen(locked.kept, locked.duration_s), locked.part)?;
    let bars = locked.waterfall.iter().map(|bar| rmse_row(bar.name(), &bar.rmse));
    let rows: Vec<_> = bars.chain(removed(locked)).collect();
    table(f, "RMSE", &rows)?;
    halves(f, locked)?;
    sentences::rises(locked).map_or(Ok(()), |text| writeln!(f, "{}", wrapped("   ", &text)))?;
    sentences::removable(locked)
        .filter(|_| !locked.mse_fall.is_empty())
        .map_or(Ok(()), |text| writeln!(f, "{}", wrapped("   ", &text)))
}

/// What a loop did to the errors on the kept part, by channel.
fn before_and_after(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis, locked: &Locked) -> fmt::Result {
    let units = ("".to_owned(), PerChannel::from_fn(|channel| channel.unit().to_owned()));
    let rows = [units, rmse_row("before".into(), &locked.rmse_before), rmse_row("after".into(), &locked.rmse_after)];
    let rows: Vec<_> = rows.into_iter().chain(removed(locked)).collect();
    let count = diagnosis.accepted.len();
    let added = if count == 1 { "one effect added".into() } else { format!("{count} effects added") };
    writeln!(f, "\n{}", wrapped("", &format!("RMSE on {}; {added}", sentences::unseen(locked.kept, locked.duration_s))))?;
    table(f, "", &rows)?;
    halves(f, locked)?;
    sentences::removable(locked).map_or(Ok(()), |text| writeln!(f, "{}", wrapped("   ", &text)))
}

/// The effects that were tried: in short as counts, at length one a line with the reason that decided.
fn candidates(f: &mut fmt::Formatter<'_>, candidates: &[CandidateReport]) -> fmt::Result {
    if candidates.is_empty() {
        return Ok(());
    }
    if !f.alternate() {
        let mut counts: Vec<(Status, usize)> = Vec::new();
        for candidate in candidates {
            match counts.iter_mut().find(|(status, _)| *status == candidate.status) {
                Some((_, count)) => *count += 1,
                None => counts.push((candidate.status, 1)),
            }
        }
        let parts: Vec<String> = counts.iter().map(|(status, count)| format!("{count} {}", status.words())).collect();
        let text = format!("{} effects tried: {} (--verbose lists them with reasons)", candidates.len(), parts.join(", "));
        return writeln!(f, "\n{}", wrapped("", &text));
    }
    writeln!(f, "\n{:<20}{:<17}{:>8}{:>9}  why", "effect", "status", "p", "limit")?;
    for candidate in candidates {
        let p = candidate.p_value.map_or("-".into(), |p| format!("{p:.4}"));
        let limit = candidate.detection_limit_mse_fall.map_or("-".into(), |limit| format!("{:.1} %", 100.0 * limit));
        let head = format!("{:<20}{:<17}{p:>8}{limit:>9}  ", clipped(&candidate.effect, 19), candidate.status.words());
        let mut why = candidate.reason.clone();
        for more in candidate.note.iter().filter(|note| **note != candidate.reason) {
            why = if why.is_empty() { more.clone() } else { format!("{why}; {more}") };
        }
        if !candidate.held_out_mse_fall.is_empty() {
            why = format!("{why} ({})", falls(&candidate.held_out_mse_fall));
        }
        writeln!(f, "{}", wrapped(&head, &why))?;
    }
    Ok(())
}

fn method_text(method: &Method) -> String {
    format!(
        "{} blocks of {:.1} s, {:.0} s searched; accepted: p <= {:.4} ({} effects in play) and at least {:.1} % of a channel's held-out \
         error",
        method.blocks,
        method.block_s,
        method.searched_s,
        method.largest_p_value,
        method.effects_in_play,
        100.0 * method.smallest_fall
    )
}

/// Verdict, effects and what no effect explains.
fn findings(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis) -> fmt::Result {
    writeln!(f, "{}", wrapped("Verdict: ", &format!("{}. {}", sentences::headline(diagnosis), diagnosis.summary)))?;
    effects(f, diagnosis)?;
    diagnosis.unknown.iter().flatten().try_for_each(|one| unknown(f, one, diagnosis.locked.as_ref()))
}

/// How it was searched, and what there is to say besides.
fn remarks(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis) -> fmt::Result {
    candidates(f, &diagnosis.candidates)?;
    if let Some(method) = &diagnosis.method {
        writeln!(f, "{}{}", if f.alternate() { "\n" } else { "" }, wrapped("", &method_text(method)))?;
    }
    diagnosis.notes.iter().try_for_each(|note| writeln!(f, "{}", wrapped("note: ", note)))?;
    write!(f, "{:.1} s", diagnosis.seconds)
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        findings(f, self)?;
        if let Some(locked) = &self.locked {
            confirmation(f, locked)?;
        }
        remarks(f, self)
    }
}

/// The end of a loop as text: its rounds as one diagnosis (see [`super::together`]), with the errors before and after last of all.
#[derive(Clone, Copy, Debug)]
pub struct LoopText<'a>(pub &'a Diagnosis);

impl fmt::Display for LoopText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(whole) = *self;
        findings(f, whole)?;
        match &whole.locked {
            // Nothing was added: what was tried, and why not.
            Some(locked) if !whole.is_confirmed() => {
                confirmation(f, locked)?;
                remarks(f, whole)?;
                write!(f, "\n\nNothing was added: the model is the one given, calibrated")
            }
            Some(locked) => {
                if f.alternate() {
                    confirmation(f, locked)?;
                }
                remarks(f, whole)?;
                writeln!(f)?;
                before_and_after(f, whole, locked)
            }
            None => {
                remarks(f, whole)?;
                write!(f, "\n\nNothing was added: no flights were kept to confirm anything on")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::{Bar, Confirmation, Kept, Verdict};
    use super::*;
    use crate::critique::shares::Share;

    fn candidate(effect: &str, status: Status, reason: &str) -> CandidateReport {
        CandidateReport {
            effect: effect.into(),
            status,
            held_out_mse_fall: [("wx_dot".to_owned(), 0.002), ("wy_dot".to_owned(), -0.1)].into(),
            p_value: Some(0.0001),
            detection_limit_mse_fall: Some(0.01),
            reason: reason.into(),
            note: Some("a long remark ".repeat(12)),
        }
    }

    fn diagnosis() -> Diagnosis {
        Diagnosis {
            candidates: vec![
                candidate("cyclic_lag", Status::Negligible, "removes too little: 0.2 % of wx_dot, 1.0 % is asked"),
                candidate("wind", Status::NotSignificant, "could be chance: p 0.5000, 0.0026 is asked"),
                candidate("sync", Status::NotSignificant, "could be chance: p 0.0100, 0.0026 is asked"),
            ],
            notes: vec!["a note ".repeat(40)],
            ..Diagnosis::nothing(Verdict::Explained, "A sentence of some length. ".repeat(9))
        }
    }

    #[test]
    fn what_was_not_named_is_folded_and_listed_when_asked() {
        let (short, long) = (diagnosis().to_string(), format!("{:#}", diagnosis()));
        assert!(short.contains("3 effects tried: 1 negligible, 2 not significant (--verbose"), "{short}");
        assert!(!short.contains("cyclic_lag") && !short.contains("removes too little"), "{short}");
        assert!(long.contains("cyclic_lag") && long.contains("removes too little: 0.2 % of wx_dot"), "{long}");
        for text in [short, long] {
            assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
        }
    }

    #[test]
    fn a_number_says_what_is_known_of_its_sign() {
        let number = |sign, held| Number {
            name: "k_tail".into(),
            value: -0.0035,
            ci95: Some([-0.0081, 0.0003]),
            unit: "rad/(m s)".into(),
            expected: None,
            sign,
            held,
            rms_over_flights: None,
            by_flight: Default::default(),
            influence: None,
        };
        use crate::physics::SignFinding::{NotDetermined, Physical};
        assert!(number_text(&number(Some(NotDetermined), false), true).ends_with("rad/(m s); sign not determined"));
        assert!(number_text(&number(Some(Physical), false), true).ends_with("rad/(m s)"));
        assert!(number_text(&number(Some(NotDetermined), true), true).contains("held at the sign that physics gives it"));
    }

    #[test]
    fn an_effect_that_unseen_flights_deny_is_not_announced_as_missing() {
        let denied = Diagnosis {
            confirmation: Some(Confirmation::Contradicted),
            locked: Some(Locked {
                part: "test".into(),
                kept: Kept::Segments,
                duration_s: 60.0,
                mse_fall: [("vz_dot".to_owned(), [-0.083, -0.199, -0.044])].into(),
                waterfall: vec![Bar::default()],
                ..Locked::default()
            }),
            ..Diagnosis::nothing(Verdict::EffectsMissing, "Said.".into())
        };
        let text = denied.to_string();
        assert!(text.starts_with("Verdict: nothing to add") && !text.contains("effects missing"), "{text}");
        assert!(text.contains("On 60 s of segments that no search has seen (test)"), "{text}");
    }

    fn many(count: usize) -> Diagnosis {
        let name = |place: usize| format!("effect_{place}");
        let share = |place: usize| Share { share: 0.1 * place as f64, ci95: Some([0.09 * place as f64, 0.11 * place as f64]) };
        let number = Number {
            name: "k".into(),
            value: 7.5,
            ci95: Some([7.0, 8.0]),
            unit: "1".into(),
            expected: Some([1.0, 2.0]),
            sign: None,
            held: false,
            rms_over_flights: None,
            by_flight: Default::default(),
            influence: None,
        };
        let step = |place: usize| Step {
            effect: name(place),
            meaning: "what it is".into(),
            channels: vec!["vx_dot".into()],
            coefficients: vec![number.clone()],
            stability: if place == 1 { "likely" } else { "stable" }.into(),
            ..Step::default()
        };
        let worth = |place: usize| Worth {
            effect: name(place),
            share: [("vx_dot".to_owned(), share(place))].into(),
            refitted: true,
            ..Worth::default()
        };
        let rmse = |value: f64| ChannelValues::new(PerChannel::splat(Some(value)));
        let mut locked = Locked {
            part: "locked".into(),
            duration_s: 60.0,
            rmse_before: rmse(2.0),
            rmse_after: rmse(1.0),
            mse_fall: [("vx_dot".to_owned(), [0.75, 0.7, 0.8])].into(),
            waterfall: (0..=count)
                .map(|place| Bar {
                    added: if place == 0 { Vec::new() } else { vec![name(place)] },
                    rmse: rmse(2.0 - place as f64 / count as f64),
                    ..Bar::default()
                })
                .collect(),
            ..Locked::default()
        };
        locked.set_floor(rmse(0.5));
        Diagnosis {
            accepted: (1..=count).map(name).collect(),
            steps: (1..=count).map(step).collect(),
            worth: (1..=count).rev().map(worth).collect(),
            locked: Some(locked),
            candidates: vec![candidate("wind", Status::NotSignificant, "could be chance: p 0.5000, 0.0026 is asked")],
            ..Diagnosis::nothing(Verdict::EffectsMissing, "Said.".into())
        }
    }

    #[test]
    fn effects_are_one_list_the_largest_first_with_the_floor_below_the_waterfall() {
        let text = many(12).to_string();
        let list: Vec<&str> = text.lines().filter(|line| line.contains(": what it is")).collect();
        assert_eq!(list.len(), 12, "{text}");
        assert!(list[0].starts_with("1. effect_12: ") && list[11].starts_with("12. effect_1: "), "{text}");
        assert!(
            text.contains("   share: vx_dot 120 % [108, 132]\n   k = 7.5000 [7.0000, 8.0000] (outside the usual 1 to 2)\n\n2."),
            "{text}"
        );
        // At length only a few or on request; a doubt is said anyway.
        assert!(!text.contains("p = ") && text.matches("wins in").count() == 1, "{text}");
        assert!(format!("{:#}", many(12)).matches("p = ").count() == 12 && many(3).to_string().matches("p = ").count() == 3);
        let below: Vec<&str> = text.lines().skip_while(|line| !line.contains("+ effect_12")).take(5).collect();
        assert!(below[1].trim_start().starts_with("floor") && below[1].matches("0.5000").count() == 6, "{text}");
        assert!(
            below[2].contains("squared error removed, %") && below[2].contains("75") && below[3].contains("[70, 80]"),
            "{text}"
        );
        // (4 − 1) / (4 − 0.25)
        assert!(below[4].contains("removable error removed, %") && below[4].matches("80").count() == 6, "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    }

    #[test]
    fn a_loop_ends_with_before_and_after_and_not_with_every_bar() {
        let whole = many(12);
        let text = LoopText(&whole).to_string();
        assert!(!text.contains("+ effect_") && format!("{:#}", LoopText(&whole)).contains("+ effect_12"), "{text}");
        let table: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("RMSE on 60 s of flights")).collect();
        assert!(table[0].ends_with("12 effects added") && table[1].contains("wz_dot") && table[2].contains("rad/s²"), "{text}");
        assert!(table[3].contains("before") && table[3].matches("2.0000").count() == 6 && table[4].matches("1.0000").count() == 6);
        assert!(table.iter().any(|line| line.contains("Of the removable error")), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
        // What was not confirmed was not added, whatever fits the searched flights.
        let denied = Diagnosis {
            locked: Some(Locked { mse_fall: [("vx_dot".to_owned(), [0.0, -0.1, 0.1])].into(), ..Locked::default() }),
            ..many(2)
        };
        let text = LoopText(&denied).to_string();
        assert!(text.contains("Nothing was added: the model is the one given") && !text.contains("before  "), "{text}");
        let text = LoopText(&Diagnosis { locked: None, ..many(2) }).to_string();
        assert!(text.contains("no flights were kept"), "{text}");
    }
}
