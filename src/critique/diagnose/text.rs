//! A diagnosis as text for a person at a terminal: `{}` folds the effects that were not named into counts, `{:#}` lists them. Lines of
//! at most 120 characters. No words of its own but labels; sentences are in `sentences`.

use super::report::{CandidateReport, Diagnosis, Locked, Method, Number, ParameterValue, Status, Step, UnknownChannel};
use super::sentences;
use super::signs::number_remark;
use crate::critique::compare::PerChannel;
use crate::critique::wrap::{clipped, wrapped};
use crate::flight::Column;
use std::collections::BTreeMap;
use std::fmt;

fn falls(falls: &BTreeMap<String, f64>) -> String {
    let parts: Vec<String> = falls.iter().map(|(channel, fall)| format!("{channel} {:.1} %", 100.0 * fall)).collect();
    if parts.is_empty() { "-".into() } else { parts.join(", ") }
}

/// A coefficient with interval, unit, usual values and what there is to say of its sign.
fn number_text(number: &Number) -> String {
    let ci = number.ci95.map(|[low, high]| format!(" [{low:.4}, {high:.4}]")).unwrap_or_default();
    let usual = number.expected.map(|[low, high]| format!("; usual {low} to {high}")).unwrap_or_default();
    let spread = number.rms_over_flights.map(|rms| format!("; rms over flights {rms:.4}")).unwrap_or_default();
    format!("{} = {:.4}{ci} {}{usual}{spread}{}", number.name, number.value, number.unit, number_remark(number))
}

fn parameter_text(parameter: &ParameterValue) -> String {
    let how = if parameter.fixed {
        "known".into()
    } else {
        parameter.profile.map_or("fitted".into(), |[low, high]| format!("fitted, {low:.4} to {high:.4}"))
    };
    format!("{} = {:.4} {} ({how})", parameter.name, parameter.value, parameter.unit)
}

fn step(f: &mut fmt::Formatter<'_>, number: usize, step: &Step) -> fmt::Result {
    writeln!(f, "\n{}", wrapped(&format!("{number}. "), &format!("{}: {}", step.effect, step.meaning)))?;
    let mut line = |text: &str| writeln!(f, "{}", wrapped("   ", text));
    line(&format!("held-out error falls: {}", falls(&step.held_out_mse_fall)))?;
    let wins = 100.0 * step.selection_frequency;
    line(&format!("p = {:.4}; wins in {wins:.0} % of resampled worlds ({})", step.p_value, step.stability))?;
    step.coefficients.iter().try_for_each(|number| line(&number_text(number)))?;
    step.parameters.iter().try_for_each(|parameter| line(&parameter_text(parameter)))?;
    if step.indistinguishable.is_empty() {
        line("nothing else fits as well")?;
    } else {
        let others = step.indistinguishable.join(", ");
        line(&format!("these flights cannot tell it from {others}; to tell: {}", step.would_tell_apart))?;
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

fn confirmation(f: &mut fmt::Formatter<'_>, diagnosis: &Diagnosis, locked: &Locked) -> fmt::Result {
    writeln!(f, "\nOn {} ({}):", sentences::unseen(locked.kept, locked.duration_s), locked.part)?;
    let cell = |value: &Option<f64>| value.map_or_else(|| format!("{:>9}", "-"), |value| format!("{value:>9.4}"));
    let row = |values: &PerChannel| values.channels().iter().map(cell).collect::<String>();
    writeln!(f, "   {:<28}{}", "RMSE", Column::TARGETS.map(|column| format!("{:>9}", column.name())).concat())?;
    for (step, values) in locked.waterfall.iter().enumerate() {
        let name = match step {
            0 => "model".into(),
            step => diagnosis.accepted.get(step - 1).map_or_else(String::new, |id| format!("+ {id}")),
        };
        writeln!(f, "   {:<28}{}", clipped(&name, 28), row(values))?;
    }
    for (channel, fall) in &locked.mse_fall {
        let [share, low, high] = fall.map(|share| 100.0 * share);
        writeln!(f, "   {channel}: error removed {share:.1} % [{low:.1}, {high:.1}]")?;
    }
    Ok(())
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

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", wrapped("Verdict: ", &format!("{}. {}", sentences::headline(self), self.summary)))?;
        self.steps.iter().enumerate().try_for_each(|(number, one)| step(f, number + 1, one))?;
        self.unknown.iter().flatten().try_for_each(|one| unknown(f, one, self.locked.as_ref()))?;
        if let Some(locked) = &self.locked {
            confirmation(f, self, locked)?;
        }
        candidates(f, &self.candidates)?;
        if let Some(method) = &self.method {
            writeln!(f, "{}{}", if f.alternate() { "\n" } else { "" }, wrapped("", &method_text(method)))?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "{}", wrapped("note: ", note)))?;
        write!(f, "{:.1} s", self.seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::{Confirmation, Kept, Verdict};
    use super::*;

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
        };
        use crate::physics::SignFinding::{NotDetermined, Physical};
        assert!(number_text(&number(Some(NotDetermined), false)).ends_with("rad/(m s); sign not determined"));
        assert!(number_text(&number(Some(Physical), false)).ends_with("rad/(m s)"));
        assert!(number_text(&number(Some(NotDetermined), true)).contains("held at the sign that physics gives it"));
    }

    #[test]
    fn an_effect_that_unseen_flights_deny_is_not_announced_as_missing() {
        let denied = Diagnosis {
            confirmation: Some(Confirmation::Contradicted),
            locked: Some(Locked {
                part: "test".into(),
                kept: Kept::Segments,
                duration_s: 60.0,
                rmse_before: PerChannel::default(),
                rmse_after: PerChannel::default(),
                mse_fall: [("vz_dot".to_owned(), [-0.083, -0.199, -0.044])].into(),
                waterfall: vec![PerChannel::default()],
            }),
            ..Diagnosis::nothing(Verdict::EffectsMissing, "Said.".into())
        };
        let text = denied.to_string();
        assert!(text.starts_with("Verdict: nothing to add") && !text.contains("effects missing"), "{text}");
        assert!(text.contains("On 60 s of segments that no search has seen (test)"), "{text}");
    }
}
