//! What a diagnosis says in words, one function a sentence. Numbers come in finished; nothing is measured or judged here but which
//! words fit a number. Text, JSON and page take their sentences from here, so that they cannot contradict each other.

use super::gates::SMALLEST_FALL;
use super::report::{Confirmation, Diagnosis, Failure, Kept, Locked, Step, TriedFormula, UnknownChannel, Verdict};

/// What an interval of a share removed says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// All of it above zero: the error falls.
    Falls,
    /// All of it below zero: the error grows.
    Grows,
    /// It holds zero.
    Open,
}

impl Told {
    /// Of `[share removed, low, high]`.
    pub fn of([_, low, high]: [f64; 3]) -> Self {
        match () {
            () if low > 0.0 => Self::Falls,
            () if high < 0.0 => Self::Grows,
            () => Self::Open,
        }
    }
}

/// A share in percent with as many digits as it bears: `8.3`, `37`.
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let text = if percent.abs() < 9.95 { format!("{percent:.1}") } else { format!("{percent:.0}") };
    // No minus before nothing.
    if text == "-0.0" { "0.0".into() } else { text }
}

/// `vz_dot grows by 8.3 % [4.4, 20]`: how the error of a channel changes, by `[share removed, low, high]`.
pub fn change(channel: &str, fall: [f64; 3]) -> String {
    let [share, low, high] = fall;
    match Told::of(fall) {
        Told::Falls => format!("{channel} falls by {} % [{}, {}]", percent(share), percent(low), percent(high)),
        Told::Grows => format!("{channel} grows by {} % [{}, {}]", percent(-share), percent(-high), percent(-low)),
        Told::Open => {
            let sign = if share > 0.0 { "−" } else { "+" };
            let interval = format!("[{}, {}]", percent(-high), percent(-low));
            format!("{channel} changes by {sign}{} % {interval}, which may be none", percent(share.abs()))
        }
    }
}

/// `251 s of flights that no search has seen`.
pub fn unseen(kept: Kept, duration_s: f64) -> String {
    format!("{duration_s:.0} s of {} that no search has seen", kept.words())
}

/// The verdict in a few words, the head of everything that is said.
pub fn headline(diagnosis: &Diagnosis) -> String {
    let confirmation = diagnosis.confirmation.filter(|_| diagnosis.verdict == Verdict::EffectsMissing);
    match confirmation {
        Some(Confirmation::Contradicted) => "nothing to add; what fits the searched flights fails on others".into(),
        Some(Confirmation::Open) => "effects suspected, not confirmed".into(),
        Some(Confirmation::NothingKept) => "effects missing, with nothing kept to confirm them on".into(),
        Some(Confirmation::Confirmed) | None => diagnosis.verdict.words().into(),
    }
}

/// `` `weathercock` (61 % of the error of wz_dot), then … ``
pub fn names(steps: &[Step]) -> String {
    let one = |step: &Step| {
        let best = step.held_out_mse_fall.iter().max_by(|left, right| left.1.total_cmp(right.1));
        let share = best.map(|(channel, fall)| format!(" ({} % of the error of {channel})", percent(*fall))).unwrap_or_default();
        format!("`{}`{share}", step.effect)
    };
    steps.iter().map(one).collect::<Vec<_>>().join(", then ")
}

/// What was named, and what the part that no search has seen says of it.
pub fn effects(steps: &[Step], locked: Option<&Locked>, confirmation: Confirmation) -> String {
    let names = names(steps);
    let Some(locked) = locked else { return format!("The model lacks {names}. No flights were kept to confirm it on.") };
    let of_steps = |channel: &&String| steps.iter().any(|step| step.channels.contains(channel));
    let changes: Vec<String> = locked
        .mse_fall
        .keys()
        .filter(of_steps)
        .filter_map(|channel| Some(change(channel, *locked.mse_fall.get(channel)?)))
        .collect();
    let changes = if changes.is_empty() { "no channel changes".to_owned() } else { changes.join("; ") };
    let on = unseen(locked.kept, locked.duration_s);
    match confirmation {
        Confirmation::Confirmed => format!("The model lacks {names}. On {on} the mean squared error of {changes}."),
        Confirmation::Contradicted => {
            format!("On the searched part {names} would help, but on {on} the mean squared error of {changes}: it is not in them.")
        }
        Confirmation::Open | Confirmation::NothingKept => {
            format!("On the searched part the model lacks {names}, but on {on} the mean squared error of {changes}: not confirmed.")
        }
    }
}

/// What no effect of the catalogue explains.
pub fn not_in_catalogue(unknown: &[UnknownChannel]) -> String {
    let one = |unknown: &UnknownChannel| {
        let on = unknown.depends_on.first().map_or("?", |first| first.variable.as_str());
        format!("{} depends on {on} ({} % of what is left)", unknown.channel, percent(unknown.r2))
    };
    let parts: Vec<String> = unknown.iter().map(one).collect();
    format!("Something is missing that is not in the catalogue: {}.", parts.join("; "))
}

/// Nothing was found.
pub fn explained() -> String {
    "No effect of the catalogue is missing that these flights could show and that would be worth while.".into()
}

/// Too few blocks for a search.
pub fn too_few_blocks(found: usize, block_s: f64, needed: usize, shortest_s: f64) -> String {
    let blocks = if found == 1 { "block" } else { "blocks" };
    format!(
        "{found} {blocks} of {block_s:.0} s {} too few to tell a missing effect from chance; {needed} are needed, that is {:.0} s of \
         flight to search, beside what is kept to confirm.",
        if found == 1 { "is" } else { "are" },
        needed as f64 * shortest_s
    )
}

/// Where the model fails most, whatever was found: always said, as the largest failure may be one that no effect stands for.
pub fn failure(failure: &Failure) -> Option<String> {
    let (first, rest) = failure.channels.split_first()?;
    let total: f64 = failure.channels.iter().map(|channel| channel.share).sum();
    let list: Vec<String> = failure
        .channels
        .iter()
        .map(|channel| format!("{} (error {} % of the channel's variance)", channel.channel, percent(channel.unexplained)))
        .collect();
    let list = match list.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => list.concat(),
    };
    let how_much = match total {
        total if total >= 0.9 => "Nearly all the error is",
        total if total >= 0.6 => "Most of the error is",
        _ => "The largest part of the error is",
    };
    let mut on: Vec<&str> = Vec::new();
    for name in std::iter::once(first).chain(rest).flat_map(|channel| &channel.depends_on) {
        if !on.contains(&name.as_str()) {
            on.push(name);
        }
    }
    let why = if on.is_empty() { "no measured variable tells of it".into() } else { format!("it depends on {}", on.join(", ")) };
    Some(format!("{how_much} in {list}; {why}."))
}

/// How a suggested formula did once it was calibrated on the searched part.
pub fn tried(channel: &str, tried: &TriedFormula, kept: Kept, duration_s: f64) -> String {
    let on = unseen(kept, duration_s);
    match tried.locked_mse_fall {
        None => "not measured: no flights were kept from the search".into(),
        Some(fall) => match Told::of(fall) {
            Told::Falls => format!("measured on {on}: the mean squared error of {}", change(channel, fall)),
            Told::Grows | Told::Open => format!(
                "its shape as a formula, `{}`, does not hold on {on}: the mean squared error of {}",
                tried.formula,
                change(channel, fall)
            ),
        },
    }
}

/// The p-value does not pass the correction for all effects in play.
pub fn could_be_chance(p: f64, largest: f64) -> String {
    format!("could be chance: p {p:.4}, {largest:.4} is asked")
}

/// It would remove less than is worth while, or nothing.
pub fn too_little(channel: &str, fall: f64) -> String {
    let asked = percent(SMALLEST_FALL);
    if fall <= 0.0 {
        return "removes nothing on blocks that it was not fitted to".into();
    }
    format!("removes too little: {} % of {channel}, {asked} % is asked", percent(fall))
}

/// Too little of the flights could show it.
pub fn not_carried(blocks: usize) -> String {
    let blocks = if blocks == 1 { "1 block carries".into() } else { format!("{blocks} blocks carry") };
    format!("these flights cannot show it: {blocks} what there is of it")
}

/// Little beside an accepted effect that may only be imperfect.
pub fn mends(rival: &str) -> String {
    format!("little beside what `{rival}` removed: it may only mend its form")
}

/// It removes enough by share, but not from enough blocks.
pub fn few_blocks_gain() -> String {
    "removes error from a few blocks and adds it in the others".into()
}

/// It makes a channel worse by as much as would count as better.
pub fn makes_worse(channel: &str, fall: f64) -> String {
    format!("makes {channel} worse by {} %", percent(-fall))
}

/// Only numbers that physics forbids would fit.
pub fn forbidden(held: &[String]) -> String {
    match held {
        [] => "fits only with numbers that physics forbids, or by turning a control round".into(),
        held => format!("fits only with the wrong sign of {}", held.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::{FailureChannel, Locked};
    use super::*;
    use crate::critique::compare::PerChannel;

    const FALLS: [f64; 3] = [0.36, 0.24, 0.46];
    const GROWS: [f64; 3] = [-0.083, -0.199, -0.044];
    const OPEN: [f64; 3] = [0.02, -0.01, 0.05];

    fn step(effect: &str, channel: &str, fall: f64) -> Step {
        Step {
            effect: effect.into(),
            channels: vec![channel.into()],
            held_out_mse_fall: [(channel.to_owned(), fall)].into(),
            ..Step::default()
        }
    }

    fn locked(channel: &str, fall: [f64; 3]) -> Locked {
        Locked {
            part: "locked".into(),
            kept: Kept::Flights,
            duration_s: 251.4,
            rmse_before: PerChannel::default(),
            rmse_after: PerChannel::default(),
            mse_fall: [(channel.to_owned(), fall)].into(),
            waterfall: Vec::new(),
        }
    }

    #[test]
    fn an_interval_wholly_on_one_side_never_holds_zero() {
        assert_eq!([FALLS, GROWS, OPEN].map(Told::of), [Told::Falls, Told::Grows, Told::Open]);
        assert_eq!([[0.0, 0.0, 0.0], [0.1, 0.0, 0.2], [-0.1, -0.2, 0.0]].map(Told::of), [Told::Open; 3]);
        assert_eq!(change("vz_dot", FALLS), "vz_dot falls by 36 % [24, 46]");
        assert_eq!(change("vz_dot", GROWS), "vz_dot grows by 8.3 % [4.4, 20]");
        assert_eq!(change("vz_dot", OPEN), "vz_dot changes by −2.0 % [-5.0, 1.0], which may be none");
        assert_eq!(change("vz_dot", [-0.02, -0.05, 0.01]), "vz_dot changes by +2.0 % [-1.0, 5.0], which may be none");
    }

    #[test]
    fn percents_bear_the_digits_that_they_have() {
        assert_eq!([0.0831, 0.366, -0.000_01, 1.0].map(percent), ["8.3", "37", "0.0", "100"]);
    }

    #[test]
    fn what_unseen_flights_deny_is_not_called_missing() {
        let steps = [step("collective_lag", "vz_dot", 0.094)];
        let said = effects(&steps, Some(&locked("vz_dot", GROWS)), Confirmation::Contradicted);
        assert_eq!(
            said,
            "On the searched part `collective_lag` (9.4 % of the error of vz_dot) would help, but on 251 s of flights that no search has \
             seen the mean squared error of vz_dot grows by 8.3 % [4.4, 20]: it is not in them."
        );
        let diagnosis = Diagnosis {
            confirmation: Some(Confirmation::Contradicted),
            ..Diagnosis::nothing(Verdict::EffectsMissing, String::new())
        };
        assert!(headline(&diagnosis).starts_with("nothing to add") && !headline(&diagnosis).contains("missing"));
        let said = effects(&steps, Some(&locked("vz_dot", FALLS)), Confirmation::Confirmed);
        assert!(said.starts_with("The model lacks `collective_lag`") && said.ends_with("vz_dot falls by 36 % [24, 46]."), "{said}");
        let said = effects(&steps, Some(&locked("vz_dot", OPEN)), Confirmation::Open);
        assert!(said.ends_with("which may be none: not confirmed."), "{said}");
        assert!(effects(&steps, None, Confirmation::NothingKept).contains("No flights were kept"));
    }

    #[test]
    fn segments_are_not_called_flights() {
        assert_eq!(unseen(Kept::Segments, 60.0), "60 s of segments that no search has seen");
        assert_eq!(unseen(Kept::Ends, 60.0), "60 s of ends of flights that no search has seen");
    }

    #[test]
    fn the_largest_failure_is_named_with_what_it_depends_on() {
        let channel = |name: &str, share: f64, on: &[&str]| FailureChannel {
            channel: name.into(),
            share,
            unexplained: 0.9 * share,
            depends_on: on.iter().map(|name| (*name).to_owned()).collect(),
        };
        let both = Failure {
            on: "locked".into(),
            channels: vec![channel("wx_dot", 0.5, &["u1"]), channel("wy_dot", 0.42, &["u2", "u1"])],
        };
        assert_eq!(
            failure(&both).unwrap_or_default(),
            "Nearly all the error is in wx_dot (error 45 % of the channel's variance) and wy_dot (error 38 % of the channel's variance); it \
             depends on u1, u2."
        );
        let one = Failure { on: "searched".into(), channels: vec![channel("vz_dot", 0.4, &[])] };
        let said = failure(&one).unwrap_or_default();
        assert!(
            said.starts_with("The largest part of the error is in vz_dot") && said.ends_with("no measured variable tells of it.")
        );
        assert_eq!(failure(&Failure { on: String::new(), channels: Vec::new() }), None);
    }

    #[test]
    fn a_suggestion_is_given_with_its_measure_or_as_failed() {
        let formula = |fall| TriedFormula { formula: "u1 * abs(u1)".into(), locked_mse_fall: fall, ..TriedFormula::default() };
        let said = |fall| tried("wx_dot", &formula(fall), Kept::Flights, 251.0);
        assert_eq!(
            said(Some(FALLS)),
            "measured on 251 s of flights that no search has seen: the mean squared error of wx_dot falls by 36 % [24, 46]"
        );
        assert!(said(Some(OPEN)).contains("does not hold") && said(Some(GROWS)).contains("grows by 8.3 %"));
        assert!(said(None).contains("not measured"));
    }

    #[test]
    fn each_status_has_the_reason_that_decided() {
        assert_eq!(could_be_chance(0.0282, 0.0026), "could be chance: p 0.0282, 0.0026 is asked");
        assert_eq!(too_little("wz_dot", 0.002), "removes too little: 0.2 % of wz_dot, 1.0 % is asked");
        assert!(too_little("wz_dot", -0.2).starts_with("removes nothing"));
        assert_eq!(makes_worse("vz_dot", -0.018), "makes vz_dot worse by 1.8 %");
        assert_eq!(forbidden(&["k_tail".into()]), "fits only with the wrong sign of k_tail");
        assert!(forbidden(&[]).contains("physics forbids"));
        assert!(
            too_few_blocks(1, 5.0, 30, 5.0).contains("1 block of 5 s is too few")
                && too_few_blocks(11, 5.0, 30, 5.0).contains("150 s")
        );
    }
}
