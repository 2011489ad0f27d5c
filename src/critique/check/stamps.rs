//! Logs of one set whose controls stand a sample or two earlier or later than those of the others: telemetry that is joined packet by packet, or started
//! by hand, comes out so. A sample is short against a servo and long against a fast loop. Delays that are as long as lags are `odd`'s.
//!
//! When a control acts nobody knows beforehand, so flights are compared: what one says of two axes at least must lie by the same whole number of samples
//! from what most say, and nearly all flights must lie at whole numbers, or the differences are those of what is flown.

use super::finding::{Finding, Severity, Subject, finding};
use super::flights::{FEWEST, MOST, named};
use super::odd::Own;
use super::robust::median;
use crate::flight::Flight;
use std::collections::{BTreeMap, BTreeSet};

/// Of the findings.
pub(super) const NAME: &str = "control_stamps";
/// Half of the interval, in samples, with which an axis has a say, and a flight.
const SHARP: [f64; 2] = [0.8, 0.4];
/// From a whole number, and of the axes from each other, samples; these also by what they are not sure of.
const NEAR: f64 = 0.35;
/// Steps of flights are the same to this share.
const SAME_STEP: f64 = 0.01;

/// Where the controls of a flight lie against those of the others, in samples that they act later.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lies {
    /// At this whole number.
    At(i64),
    /// Between, or its axes disagree.
    Between,
}

/// When an axis answers, and half of the interval of that, in samples.
type Answer = (f64, f64);

/// One finding for each number of samples by which logs differ from the most; a log that was cut into flights lies where all of these do.
pub(super) fn findings(each: &[&Own], unjudged: &BTreeSet<usize>, flights: &[Flight]) -> Vec<Finding> {
    let Some(step_s) = flights.first().map(|flight| flight.step_s) else { return Vec::new() };
    let is_judged = |own: &&&Own| {
        let flight = &flights[own.flight];
        !unjudged.contains(&own.flight) && (flight.step_s / step_s - 1.0).abs() < SAME_STEP
    };
    let answers_of = |own: &&Own| {
        own.acts.map(|acts| acts.map(|acts| (acts.at_s / step_s, acts.half_s / step_s)).filter(|answer| answer.1 <= SHARP[0]))
    };
    let judged: Vec<(&str, [Option<Answer>; 3])> =
        each.iter().filter(is_judged).map(|own| (log_of(&flights[own.flight].name), answers_of(own))).collect();
    let usual: [Option<f64>; 3] =
        std::array::from_fn(|axis| usual(&judged.iter().filter_map(|(_, answers)| answers[axis]).collect::<Vec<_>>()));
    let mut of_logs: BTreeMap<&str, Vec<Lies>> = BTreeMap::new();
    for (log, answers) in &judged {
        let against =
            answers.iter().zip(usual).filter_map(|(answer, usual)| Some((answer.as_ref()?.0 - usual?, answer.as_ref()?.1)));
        if let Some(lies) = lies(&against.collect::<Vec<_>>()) {
            of_logs.entry(log).or_default().push(lies);
        }
    }
    let at_whole: Vec<(&str, i64)> = of_logs.iter().filter_map(|(log, lies)| Some((*log, agreed(lies)?))).collect();
    if at_whole.len() < FEWEST || (at_whole.len() as f64) < MOST * of_logs.len() as f64 {
        return Vec::new();
    }
    let most = median(at_whole.iter().map(|(_, samples)| *samples as f64).collect()).map_or(0, |most| most as i64);
    let mut by_samples: BTreeMap<i64, Vec<&str>> = BTreeMap::new();
    for (log, samples) in at_whole {
        by_samples.entry(samples - most).or_default().push(log);
    }
    let of_all = of_logs.len();
    by_samples
        .into_iter()
        .filter(|(samples, _)| *samples != 0)
        .map(|(samples, logs)| told(samples, &logs, of_all, step_s))
        .collect()
}

/// When an axis usually answers: the median, moved to where the most flights lie at whole numbers of samples from it (the mean direction of their
/// fractions; Mardia & Jupp, Directional Statistics, sec. 2.2.1).
fn usual(answers: &[Answer]) -> Option<f64> {
    let [mut sine, mut cosine] = [0.0; 2];
    for (at, half) in answers {
        let weight = half.max(0.05).powi(-2);
        let (s, c) = (std::f64::consts::TAU * at).sin_cos();
        (sine, cosine) = (sine + weight * s, cosine + weight * c);
    }
    let fraction = sine.atan2(cosine) / std::f64::consts::TAU;
    let middle = median(answers.iter().map(|answer| answer.0).collect())?;
    Some((middle - fraction).round() + fraction)
}

/// Where a flight lies whose axes say this against what is usual. `None` if they say too little.
fn lies(axes: &[Answer]) -> Option<Lies> {
    let weight: f64 = axes.iter().map(|(_, half)| half.max(0.05).powi(-2)).sum();
    if axes.len() < 2 || weight.powf(-0.5) > SHARP[1] {
        return None;
    }
    let mean = axes.iter().map(|(at, half)| at * half.max(0.05).powi(-2)).sum::<f64>() / weight;
    let whole = mean.round();
    let agree = axes.iter().all(|(at, half)| (at - mean).abs() <= half.max(NEAR));
    Some(if agree && (mean - whole).abs() <= NEAR { Lies::At(whole as i64) } else { Lies::Between })
}

/// Where all flights of a log lie.
fn agreed(lies: &[Lies]) -> Option<i64> {
    match lies.split_first()? {
        (Lies::At(samples), rest) if rest.iter().all(|other| *other == Lies::At(*samples)) => Some(*samples),
        _ => None,
    }
}

/// The log that a flight is a piece of: `a/b[2]` is one of `a/b`.
pub(super) fn log_of(flight: &str) -> &str {
    match flight.strip_suffix(']').and_then(|rest| rest.rsplit_once('[')) {
        Some((log, piece)) if !piece.is_empty() && piece.bytes().all(|byte| byte.is_ascii_digit()) => log,
        _ => flight,
    }
}

fn told(samples: i64, logs: &[&str], of_all: usize, step_s: f64) -> Finding {
    // Controls that act later after they are recorded are recorded earlier.
    let late_s = -(samples as f64) * step_s;
    let message = format!(
        "in {} of {of_all} logs ({}): the controls are recorded {} sample{} ({:.0} ms) {} than in the others, by the axes that they turn; \
         no aircraft does that, the streams were joined so",
        logs.len(),
        named(logs),
        samples.abs(),
        if samples.abs() == 1 { "" } else { "s" },
        1e3 * late_s.abs(),
        if late_s > 0.0 { "later" } else { "earlier" },
    );
    let names: Vec<String> = logs.iter().map(|log| format!("{log:?}")).collect();
    let set = format!("[[late_in]] flights = [{}], controls = {}", names.join(", "), (late_s * 1e6).round() / 1e6);
    Finding {
        subject: Subject::Timing,
        measured: Some(late_s),
        unit: "s".into(),
        flights: logs.iter().map(|&log| log.to_owned()).collect(),
        ..finding(NAME, Severity::Warning, message, Some(&set))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_lies_where_its_axes_agree_at_a_whole_sample() {
        let sharp = |axes: &[f64]| lies(&axes.iter().map(|at| (*at, 0.2)).collect::<Vec<_>>());
        assert_eq!(sharp(&[1.05, 0.9, 1.2]), Some(Lies::At(1)));
        assert_eq!(sharp(&[-0.1, 0.2]), Some(Lies::At(0)));
        assert_eq!(sharp(&[0.5, 0.45]), Some(Lies::Between));
        assert_eq!(sharp(&[1.0, 0.1]), Some(Lies::Between));
        assert_eq!(sharp(&[1.0]), None);
        assert_eq!(lies(&[(1.0, 0.7), (1.0, 0.7)]), None);
    }

    #[test]
    fn the_usual_lies_at_the_fraction_that_most_share() {
        let answers: Vec<Answer> = [0.3, 1.25, 1.35, 1.3, 2.3].map(|at| (at, 0.1)).into();
        assert!(usual(&answers).is_some_and(|usual| (usual - 1.3).abs() < 0.02));
        assert_eq!(usual(&[]), None);
    }

    #[test]
    fn pieces_belong_to_their_log() {
        assert_eq!([log_of("a/b[12]"), log_of("a/b"), log_of("a[x]"), log_of("a[]")], ["a/b", "a/b", "a[x]", "a[]"]);
        assert_eq!(agreed(&[Lies::At(1), Lies::At(1)]), Some(1));
        assert_eq!(agreed(&[Lies::At(1), Lies::At(0)]), None);
    }
}
