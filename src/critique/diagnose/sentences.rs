//! What a diagnosis says in words, one function a sentence. Numbers come in finished; nothing is measured or judged here but which
//! words fit a number. Text, JSON and page take their sentences from here, so that they cannot contradict each other.

use super::gates::{MOSTLY_UNEXPLAINED, SMALLEST_FALL};
use super::report::{Bar, Confirmation, Diagnosis, Failure, Kept, Locked, Step, TriedFormula, UnknownChannel, Verdict, Worth};
use crate::critique::prose::listed;
use crate::critique::shares::Share;
use crate::flight::Column;

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
    let worst = diagnosis.failure.as_ref().and_then(|failure| failure.channels.first());
    if let Some(worst) = worst.filter(|worst| diagnosis.verdict == Verdict::Explained && worst.unexplained > MOSTLY_UNEXPLAINED) {
        return format!("nothing to name, though {} is not explained", worst.channel);
    }
    let confirmation = diagnosis.confirmation.filter(|_| diagnosis.verdict == Verdict::EffectsMissing);
    match confirmation {
        Some(Confirmation::Contradicted) => "nothing to add; what fits the searched flights fails on others".into(),
        Some(Confirmation::Open) => "effects suspected, not confirmed".into(),
        Some(Confirmation::NothingKept) => "effects missing, with nothing kept to confirm them on".into(),
        Some(Confirmation::Confirmed) | None => diagnosis.verdict.words().into(),
    }
}

/// As many effects are named in a sentence; more are a list.
const NAMED: usize = 3;

/// `` `weathercock` (61 % of the error of wz_dot), then … ``; of more than three their number, and those that are worth most.
pub fn names(diagnosis: &Diagnosis) -> String {
    let one = |step: &Step| {
        let best = step.held_out_mse_fall.iter().max_by(|left, right| left.1.total_cmp(right.1));
        let share = best.map(|(channel, fall)| format!(" ({} % of the error of {channel})", percent(*fall))).unwrap_or_default();
        format!("`{}`{share}", step.effect)
    };
    let steps = &diagnosis.steps;
    if steps.len() <= NAMED {
        return steps.iter().map(one).collect::<Vec<_>>().join(", then ");
    }
    let first: Vec<String> = diagnosis.by_worth().iter().take(NAMED).map(|(step, _)| format!("`{}`", step.effect)).collect();
    let how = if diagnosis.worth.is_empty() { "first" } else { "above all" };
    format!("{} effects, {how} {}", steps.len(), listed(&first))
}

/// What a list of effects is sorted by; `of` says of which flights.
pub fn worth(of: &str, all_refitted: bool) -> String {
    let others =
        if all_refitted { "and the others were fitted again" } else { "and the others, where that is possible, fitted again" };
    format!(
        "the largest share first, by the lower end of its interval. Share: how much of the mean squared error before would come back on \
         {of} if that effect alone were taken away {others}."
    )
}

/// `wx_dot 42 % [38, 46], wy_dot 30 % [27, 33]`: what one effect is worth, by the lower ends of the intervals, the largest first. Of the other
/// channels only those of half a percent and more, and more than chance.
pub fn share(worth: &Worth) -> String {
    const SHOWN: f64 = 0.005;
    let sure = |share: &Share| share.ci95.is_none_or(|[low, high]| low > 0.0 || high < 0.0);
    let mut shares: Vec<(&String, &Share)> = worth.share.iter().filter(|(_, share)| share.share.abs() >= SHOWN).collect();
    shares.sort_by(|left, right| right.1.at_least().total_cmp(&left.1.at_least()));
    let shown = shares.into_iter().enumerate().filter(|(place, (_, share))| *place == 0 || sure(share));
    let interval =
        |share: &Share| share.ci95.map(|[low, high]| format!(" [{}, {}]", percent(low), percent(high))).unwrap_or_default();
    let one =
        |(_, (channel, share)): (usize, (&String, &Share))| format!("{channel} {} %{}", percent(share.share), interval(share));
    let list: Vec<String> = shown.map(one).collect();
    let list = if list.is_empty() { "less than 0.5 % of every channel".to_owned() } else { list.join(", ") };
    if worth.refitted { list } else { format!("{list} (the others as they were: without it the flights do not determine them)") }
}

/// More than all of what is removable: by a fiftieth and less a model may be below the floor by chance.
const BELOW: f64 = 1.02;

/// Where a bar of the waterfall rises by more than chance; nothing where none does.
pub fn rises(locked: &Locked) -> Option<String> {
    let one = |bar: &Bar| {
        let in_channels = bar.rises.iter().map(|(channel, rise)| {
            let interval = rise.ci95.map_or_else(String::new, |[low, high]| format!(" [{}, {}]", percent(low), percent(high)));
            format!("{channel} by {} %{interval}", percent(rise.share))
        });
        let rises: Vec<String> = in_channels.collect();
        (!rises.is_empty()).then(|| format!("with \"{}\" in {}", bar.name(), listed(&rises)))
    };
    let bars: Vec<String> = locked.waterfall.iter().filter_map(one).collect();
    (!bars.is_empty())
        .then(|| format!("The squared error rises {}: what an effect mends in one channel may cost in another.", listed(&bars)))
}

/// What the effects removed together of what could be removed; nothing without a floor.
pub fn removable(locked: &Locked) -> Option<String> {
    let removed = locked.removable_removed?;
    let mean = removed.mean?;
    let channels = || Column::TARGETS.iter().map(|column| column.name()).zip(removed.channels());
    let worst = channels().filter_map(|(name, share)| Some((name, share?))).min_by(|left, right| left.1.total_cmp(&right.1))?;
    let below: Vec<String> =
        channels().filter(|(_, share)| share.is_some_and(|share| share > BELOW)).map(|(name, _)| name.to_owned()).collect();
    let below = if below.is_empty() {
        String::new()
    } else {
        format!(
            " In {} the error is below the floor: numbers that each flight has for itself, and a pilot's answers, take up gusts that last.",
            listed(&below)
        )
    };
    Some(format!(
        "Of the removable error, the mean squared error before less that of the floor, {} % is removed on the mean of the channels, {} % in the \
         worst ({}). The floor is what gusts, turbulence and noise leave.{below}",
        percent(mean),
        percent(worst.1),
        worst.0
    ))
}

/// Effects that the last search of a loop named and the kept part did not confirm.
pub fn not_added(effects: &[String], on: &str) -> String {
    let names: Vec<String> = effects.iter().map(|effect| format!("`{effect}`")).collect();
    format!("found besides, but not confirmed on {on}, and so not added: {}", names.join(", "))
}

/// What was named, and what the part that no search has seen says of it.
pub fn effects(diagnosis: &Diagnosis, confirmation: Confirmation) -> String {
    let (names, steps) = (names(diagnosis), &diagnosis.steps);
    let Some(locked) = &diagnosis.locked else { return format!("The model lacks {names}. No flights were kept to confirm it on.") };
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

/// What a suggested formula is, in the place of an effect's meaning.
pub const SUGGESTED: &str = "no physics with a name: a formula that the rest of the error suggested";

/// What could be wrong with the log in the place of an effect.
pub fn or_the_log(fault: &str) -> String {
    format!("or a fault of the log: {fault}")
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
    let list = listed(&list);
    let how_much = match total {
        total if total >= 0.9 => "Of what is left nearly all is",
        total if total >= 0.6 => "Of what is left most is",
        _ => "Of what is left the largest part is",
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

/// No number of it is known well enough beside all others.
pub fn loose(share: f64) -> String {
    if share.is_finite() {
        format!("these flights leave its numbers open: the best known one to {share:.1} of its usual size")
    } else {
        "these flights leave its numbers open".into()
    }
}

/// How both roads went: what the first named before it was left, and what the second left out of that.
pub fn both_roads(tried: usize, forward: &[String], dropped: &[String]) -> String {
    let quoted = |names: &[String]| listed(&names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>());
    let first = format!(
        "much is missing at once, so all {tried} effects that apply were fitted together and the needless left out; one after the other the \
         search had begun with {}",
        quoted(forward)
    );
    if dropped.is_empty() {
        format!("{first}, and both roads name these")
    } else {
        format!("{first}, of which {} turned out to be needless beside the others", quoted(dropped))
    }
}

/// Why there was one road only where two were wanted.
pub fn one_road(why: &str) -> String {
    format!(
        "much is missing at once, but all effects together cannot be fitted: {why}; so they were looked for one after the other"
    )
}

/// Little beside an accepted effect that may only be imperfect.
pub fn mends(rival: &str) -> String {
    format!("little beside what `{rival}` removed: it may only mend its form")
}

/// Another does its work as well with fewer numbers, or better.
pub fn gave_way(other: &str) -> String {
    format!("`{other}` does in its place what it did, as well with fewer numbers or better")
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
    use crate::critique::channels::ChannelValues;

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
            mse_fall: [(channel.to_owned(), fall)].into(),
            ..Locked::default()
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
        let with = |locked: Option<Locked>| Diagnosis {
            steps: steps.clone().into(),
            locked,
            ..Diagnosis::nothing(Verdict::EffectsMissing, String::new())
        };
        let said = effects(&with(Some(locked("vz_dot", GROWS))), Confirmation::Contradicted);
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
        let said = effects(&with(Some(locked("vz_dot", FALLS))), Confirmation::Confirmed);
        assert!(said.starts_with("The model lacks `collective_lag`") && said.ends_with("vz_dot falls by 36 % [24, 46]."), "{said}");
        let said = effects(&with(Some(locked("vz_dot", OPEN))), Confirmation::Open);
        assert!(said.ends_with("which may be none: not confirmed."), "{said}");
        assert!(effects(&with(None), Confirmation::NothingKept).contains("No flights were kept"));
    }

    #[test]
    fn a_channel_that_is_mostly_left_is_not_called_explained() {
        let of = |verdict: Verdict, unexplained: f64| {
            let channels = vec![FailureChannel { channel: "wy_dot".into(), share: 0.9, unexplained, depends_on: Vec::new() }];
            let failure = Some(Failure { on: "locked".into(), channels });
            headline(&Diagnosis { failure, ..Diagnosis::nothing(verdict, String::new()) })
        };
        assert_eq!(of(Verdict::Explained, 0.49), "explained");
        assert_eq!(of(Verdict::Explained, 0.6), "nothing to name, though wy_dot is not explained");
        assert_eq!(of(Verdict::NotInCatalogue, 0.6), "not in the catalogue");
        assert_eq!(headline(&Diagnosis::nothing(Verdict::Explained, String::new())), "explained");
    }

    #[test]
    fn many_effects_are_counted_and_those_that_are_worth_most_named() {
        let of = |count: usize, worth: &[&str]| {
            let steps = ["a", "b", "c", "d", "e"].iter().take(count).map(|name| step(name, "vz_dot", 0.1));
            names(&Diagnosis {
                steps: steps.collect(),
                worth: worth.iter().map(|name| Worth { effect: (*name).into(), ..Worth::default() }).collect(),
                ..Diagnosis::nothing(Verdict::EffectsMissing, String::new())
            })
        };
        assert_eq!(of(2, &["b", "a"]), "`a` (10 % of the error of vz_dot), then `b` (10 % of the error of vz_dot)");
        assert!(of(3, &[]).contains(", then `c`"));
        assert_eq!(of(5, &["e", "c", "a", "b", "d"]), "5 effects, above all `e`, `c` and `a`");
        assert_eq!(of(4, &[]), "4 effects, first `a`, `b` and `c`");
    }

    #[test]
    fn a_share_names_its_channels_the_surest_first_and_says_where_the_others_stayed() {
        let of = |share: f64, half: f64| Share { share, ci95: Some([share - half, share + half]) };
        let shares = [
            ("vx_dot", of(0.304, 0.03)),
            ("vy_dot", of(0.1, 0.2)),
            ("wx_dot", of(0.42, 0.5)),
            ("wy_dot", of(0.004, 0.001)),
            ("wz_dot", of(-0.01, 0.002)),
        ];
        let mut worth =
            Worth { share: shares.map(|(channel, share)| (channel.to_owned(), share)).into(), refitted: true, ..Worth::default() };
        assert_eq!(
            share(&worth),
            "vx_dot 30 % [27, 33], wz_dot -1.0 % [-1.2, -0.8]",
            "the surest first, others only beyond chance"
        );
        worth.refitted = false;
        assert!(share(&worth).ends_with("(the others as they were: without it the flights do not determine them)"));
        worth = Worth { share: [("vx_dot".to_owned(), of(0.001, 0.0))].into(), refitted: true, ..Worth::default() };
        assert_eq!(share(&worth), "less than 0.5 % of every channel");
    }

    #[test]
    fn the_removable_share_is_said_with_its_worst_channel() {
        let of = |values: [f64; 6]| ChannelValues::new(values.map(Some).into());
        let mut found = Locked {
            rmse_before: of([1.0, 1.0, 1.0, 1.0, 1.0, 2.0]),
            rmse_after: of([0.6, 0.6, 0.6, 0.6, 0.6, 2.0]),
            ..Locked::default()
        };
        assert_eq!(removable(&found), None, "nothing is said of a floor that is not known");
        found.set_floor(of([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
        let said = removable(&found).unwrap_or_default();
        assert!(said.contains("53 % is removed on the mean of the channels, 0.0 % in the worst (wz_dot)"), "{said}");
        assert!(!said.contains("below the floor"), "{said}");
        found.set_floor(of([0.605, 0.0, 0.0, 0.0, 0.0, 1.0]));
        assert!(removable(&found).is_some_and(|said| !said.contains("below the floor")), "within a fiftieth");
        found.set_floor(of([0.7, 0.0, 0.0, 0.0, 0.0, 1.0]));
        assert!(removable(&found).is_some_and(|said| said.contains("In vx_dot the error is below the floor")));
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
            "Of what is left nearly all is in wx_dot (error 45 % of the channel's variance) and wy_dot (error 38 % of the channel's variance); it \
             depends on u1, u2."
        );
        let one = Failure { on: "searched".into(), channels: vec![channel("vz_dot", 0.4, &[])] };
        let said = failure(&one).unwrap_or_default();
        assert!(
            said.starts_with("Of what is left the largest part is in vz_dot")
                && said.ends_with("no measured variable tells of it.")
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
