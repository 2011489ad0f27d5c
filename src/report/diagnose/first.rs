//! The first screen: the verdict in plain words, and one strip of errors from the model as it was to the floor.

use super::super::compare::bar_of;
use super::super::figures::{self, Fall, FallPanel, Kind};
use super::super::names::{channel_panels, named, said};
use super::super::page::Part;
use super::DiagnoseReport;
use crate::critique::diagnose::sentences::{self, Told, change, percent, removable, rises, unseen};
use crate::critique::diagnose::{Bar, Confirmation, Diagnosis, Step, Verdict};
use crate::critique::prose::listed;
use crate::critique::table::{OWN_FROM_FIRST_HALF, ordinal};
use crate::flight::Channel;

/// Of as many effects the verdict says what each is; of more, those that are worth most are named.
const EXPLAINED: usize = 2;
const NAMED: usize = 3;
/// A bar that differs from the one before by less than this share of it has not moved.
const UNMOVED: f64 = 0.005;

/// The verdict in one or two sentences, and what it rests on.
pub(super) fn summary(diagnoses: &[Diagnosis]) -> Vec<String> {
    let mut out: Vec<String> = diagnoses.iter().map(verdict).collect();
    for diagnosis in diagnoses {
        // Of many effects the list says it.
        for step in diagnosis.steps.iter().filter(|_| diagnosis.steps.len() <= NAMED) {
            if !step.indistinguishable.is_empty() {
                let others = step.indistinguishable.join(", ");
                out.push(format!("These flights cannot tell {} from {others}. To tell: {}.", step.effect, step.would_tell_apart));
            }
        }
        for step in &diagnosis.steps {
            if let Some(flight) = &step.rests_on_flight {
                out.push(format!("Caution: {} rests on flight {flight} alone.", step.effect));
            }
        }
        out.extend(diagnosis.locked.as_ref().and_then(removable));
        out.extend(told_besides(diagnosis));
    }
    out
}

/// How errors changed on unseen flights where the verdict does not say it: what grew beside what was confirmed; all of it where nothing was.
fn told_besides(diagnosis: &Diagnosis) -> Option<String> {
    let locked = diagnosis.locked.as_ref()?;
    let wanted = |fall: [f64; 3]| !is_found(diagnosis) || Told::of(fall) == Told::Grows;
    let changes = locked.mse_fall.iter().filter(|(_, fall)| wanted(**fall)).map(|(channel, fall)| change(channel, *fall));
    let changes = changes.collect::<Vec<_>>().join("; ");
    let new = !changes.is_empty() && !diagnosis.summary.contains(&changes);
    new.then(|| format!("Mean squared error on {}: {changes}.", unseen(locked.kept, locked.duration_s)))
}

fn is_found(diagnosis: &Diagnosis) -> bool {
    let confirmed = matches!(diagnosis.confirmation, Some(Confirmation::Confirmed) | None);
    diagnosis.verdict == Verdict::EffectsMissing && confirmed && !diagnosis.steps.is_empty()
}

/// One diagnosis in plain words.
fn verdict(diagnosis: &Diagnosis) -> String {
    if !is_found(diagnosis) {
        let mut head = sentences::headline(diagnosis);
        head[..1].make_ascii_uppercase();
        return format!("{head}. {}", diagnosis.summary);
    }
    let count = diagnosis.steps.len();
    let what = if count <= EXPLAINED {
        let one =
            |step: &Step| if step.meaning.is_empty() { step.effect.clone() } else { format!("{} ({})", step.effect, step.meaning) };
        listed(&diagnosis.steps.iter().map(one).collect::<Vec<_>>())
    } else {
        let first: Vec<String> = diagnosis.by_worth().iter().take(NAMED).map(|(step, _)| step.effect.clone()).collect();
        if count <= NAMED { listed(&first) } else { format!("{count} effects, above all {}", listed(&first)) }
    };
    let removed = removed(diagnosis, if count == 1 { "it" } else { "them" });
    let rest = left(diagnosis).map_or_else(String::new, |rest| format!(" {rest}"));
    format!("The model lacks {what}{removed}{rest}")
}

/// How much of the error goes, on which flights.
fn removed(diagnosis: &Diagnosis, them: &str) -> String {
    let Some(locked) = &diagnosis.locked else { return ". No flights were kept to confirm it on.".into() };
    let of_steps = |channel: &String| diagnosis.steps.iter().any(|step| step.channels.contains(channel));
    let mut falls: Vec<(&String, [f64; 3])> = locked.mse_fall.iter().map(|(channel, fall)| (channel, *fall)).collect();
    falls.retain(|(channel, fall)| of_steps(channel) && matches!(Told::of(*fall), Told::Falls));
    falls.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let on = unseen(locked.kept, locked.duration_s);
    match falls.as_slice() {
        [] => format!(". On {on} no channel's error falls by more than chance."),
        [(channel, [share, low, high])] => format!(
            "; adding {them} removes {} % [{}, {}] of the squared error of {}, on {on}.",
            percent(*share),
            percent(*low),
            percent(*high),
            said(channel)
        ),
        [(worst, [least, ..]), .., (best, [most, ..])] => format!(
            "; adding {them} removes {} % ({}) to {} % ({}) of the squared error, on {on}.",
            percent(*least),
            named(worst),
            percent(*most),
            named(best)
        ),
    }
}

/// What no effect of the catalogue explains.
fn left(diagnosis: &Diagnosis) -> Option<String> {
    let of = |unknown: &crate::critique::diagnose::UnknownChannel| {
        let on = unknown.depends_on.first()?;
        Some(format!("{} still depends on {}", said(&unknown.channel), said(&on.variable)))
    };
    let found: Vec<String> = diagnosis.unknown.iter().flatten().filter_map(of).collect();
    let mut text = listed(&found);
    text.get_mut(..1)?.make_ascii_uppercase();
    Some(format!("{text}, in a way no effect of the catalogue has."))
}

/// The strip, and what has to be said beside it.
pub(super) fn strip(report: &DiagnoseReport<'_>) -> Vec<Part> {
    let bars = bars(report);
    if bars.is_empty() {
        return vec![Part::Text(
            "No flights were kept from the search, or nothing was searched: there is nothing to confirm on.".into(),
        )];
    }
    let panels =
        Channel::ALL.into_iter().zip(channel_panels()).map(|(channel, (title, unit))| panel(report, &bars, channel, title, unit));
    let panels: Vec<FallPanel> = panels.collect();
    let locked = report.told().iter().find_map(|diagnosis| diagnosis.locked.as_ref());
    let on = locked.map_or_else(String::new, |locked| unseen(locked.kept, locked.duration_s));
    let networks = report.compared.filter(|compared| !compared.comparison.shares.is_empty()).map_or_else(String::new, |compared| {
        let stride = compared.comparison.stride;
        let every = if stride > 1 { format!("every {stride}{} sample", ordinal(stride)) } else { "every sample".to_owned() };
        format!(" Networks are judged on {every} of them that has a whole history before it.")
    });
    let caption = format!(
        "Root mean square error on {on}, with its 95 % interval. Each bar adds what its name says to those above it, all numbers fitted \
         again.{networks}"
    );
    let mut parts = vec![Part::Figure(figures::falls("The error from effect to effect", &caption, &panels))];
    parts.extend(report.diagnoses.iter().filter_map(|diagnosis| rises(diagnosis.locked.as_ref()?)).map(Part::Text));
    if report.told().iter().any(|diagnosis| diagnosis.locked.as_ref().is_some_and(|locked| locked.own_from_first_half)) {
        parts.push(Part::Text(OWN_FROM_FIRST_HALF.into()));
    }
    parts
}

/// The bars of all rounds in one row.
pub(super) fn bars<'a>(report: &DiagnoseReport<'a>) -> Vec<&'a Bar> {
    let rounds = report.diagnoses.iter().filter_map(|diagnosis| diagnosis.locked.as_ref());
    rounds.enumerate().flat_map(|(round, locked)| locked.waterfall.iter().skip(usize::from(round > 0))).collect()
}

fn panel(report: &DiagnoseReport<'_>, bars: &[&Bar], channel: Channel, title: String, unit: String) -> FallPanel {
    let of_bar = |(place, bar): (usize, &&Bar)| {
        let first = place == 0;
        let value = bar.rmse.channels()[channel]?;
        let before = place.checked_sub(1).and_then(|place| bars[place].rmse.channels()[channel]);
        let unmoved = before.is_some_and(|before| (value - before).abs() < UNMOVED * before);
        Some(Fall {
            name: if first { "model before".into() } else { bar.name() },
            kind: match (first, unmoved) {
                (true, _) => Kind::Before,
                (false, true) => Kind::Unmoved,
                (false, false) => Kind::Physics,
            },
            value,
            ci95: bar.rmse_ci95.channels()[channel],
            remark: String::new(),
        })
    };
    let mut all: Vec<Fall> = bars.iter().enumerate().filter_map(of_bar).collect();
    let name = channel.name();
    let unknown = report.diagnoses.last().and_then(|diagnosis| diagnosis.unknown.as_ref());
    let suggested = unknown.into_iter().flatten().find(|unknown| unknown.channel == name && unknown.suggested_formula.is_some());
    let measured = suggested.and_then(|unknown| unknown.tried.as_ref()?.locked_rmse);
    all.extend(measured.map(|value| Fall {
        name: "+ suggested formula".into(),
        kind: Kind::Suggested,
        value,
        ci95: None,
        remark: String::new(),
    }));
    if let Some(compared) = report.compared {
        let networks =
            (0..compared.comparison.models.len()).filter_map(|index| bar_of(compared.comparison, index, channel, Kind::Physics));
        all.extend(networks.filter(|bar| bar.kind == Kind::Network));
    }
    let floor = report.told().iter().find_map(|diagnosis| diagnosis.locked.as_ref()?.floor);
    FallPanel { title, unit, bars: all, floor: floor.and_then(|floor| floor.channels()[channel]) }
}
