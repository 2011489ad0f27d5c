//! Streams with a clock of their own: how far a stream comes later, or earlier, in the second half of flights than in the first. How late it comes on the
//! whole is in `timing`.

use super::finding::{Finding, Severity, Subject, finding};
use super::timing::Timing;

/// A delay that grows by so much along a flight changes verdicts, s.
const GROWS_S: f64 = 0.03;
/// The same where it is stated that the stream has a clock of its own: what is left of it is no chance.
const STILL_GROWS_S: f64 = 0.005;

/// What the sticks act late by beside a stated clock is taken for where it began from so much on, s: they are moved to between samples then.
const LEAST_START_S: f64 = 0.0005;

/// The sticks, as a stream.
pub(super) const CONTROLS: &str = "controls";
/// How the findings begin.
pub(super) const CLOCK: &str = "clock_";

/// The halves of flights.
pub(super) struct Halves {
    timing: [Timing; 2],
    /// Of the flights, s, and their number.
    duration_s: f64,
    flights: usize,
}

impl Halves {
    pub fn new(step_s: f64) -> Self {
        Self { timing: [Timing::new(step_s), Timing::new(step_s)], duration_s: 0.0, flights: 0 }
    }

    /// Of one flight, in the short blocks of which `whole` is made.
    pub fn of(whole: &Timing, step_s: f64, duration_s: f64) -> Self {
        let mut halves = Self { duration_s, flights: 1, ..Self::new(step_s) };
        let blocks = whole.blocks();
        halves.timing[0].absorb(&whole.part(0..blocks / 2), 1);
        halves.timing[1].absorb(&whole.part(blocks / 2..blocks), 1);
        halves
    }

    /// Adds the blocks of others, so many of them as one.
    pub fn absorb(&mut self, other: &Self, together: usize) {
        self.timing.iter_mut().zip(&other.timing).for_each(|(one, other)| one.absorb(other, together));
        self.duration_s += other.duration_s;
        self.flights += other.flights;
    }

    /// By how much the delay of each stream grows; of which ones a drift is stated.
    pub fn findings(&self, is_stated: &dyn Fn(&str) -> bool) -> Vec<Finding> {
        let late = |timing: &Timing| {
            let mut late = timing.offsets(0.0);
            late.push(timing.control_delay(None).0);
            late
        };
        let [first, second] = self.timing.each_ref().map(late);
        // From the middle of one half to that of the other.
        let apart_s = 0.5 * self.duration_s / self.flights.max(1) as f64;
        let same = |one: &Finding| second.iter().find(|other| other.name == one.name).cloned();
        let mut grown: Vec<Finding> = first.iter().filter_map(|one| grown(one, &same(one)?, apart_s, is_stated)).collect();
        // Of two streams that both drift against a third, or against each other, nothing tells which is to be moved.
        if grown.iter().filter(|finding| finding.set.is_some()).count() > 1 {
            grown.iter_mut().for_each(|finding| finding.set = None);
        }
        grown
    }
}

/// What a stream is called, by the finding on its delay.
fn stream(of: &str) -> &'static str {
    match of {
        "velocity_offset" => "velocity",
        "rates_offset" => "rates",
        "targets_offset" => "acceleration",
        "angular_targets_offset" => "angular_acceleration",
        _ => CONTROLS,
    }
}

/// Where a clock of the sticks is stated, what they act late by on the whole is where it began.
pub(super) fn began(delay: &mut Finding) {
    let Some((measured, interval)) = delay.measured.zip(delay.interval) else { return };
    let of_model_s = delay.expected.unwrap_or(0.0);
    let [low, high] = interval.map(|end| end - of_model_s);
    let late_s = measured - of_model_s;
    if late_s.abs() < LEAST_START_S || low <= 0.0 && high >= 0.0 {
        return;
    }
    let way = if late_s > 0.0 { "late" } else { "early" };
    delay.verdict = Severity::Warning;
    delay.message = format!(
        "beside the clock that is stated the controls act {:.1} ms {way}: where that clock began, or a delay of the machine, which no flight tells apart",
        1e3 * late_s.abs()
    );
    delay.set = Some(format!("[late] controls = {:.4}", -late_s));
}

fn grown(first: &Finding, second: &Finding, apart_s: f64, is_stated: &dyn Fn(&str) -> bool) -> Option<Finding> {
    let half = |finding: &Finding| Some(0.5 * (finding.interval?[1] - finding.interval?[0]));
    let by = second.measured? - first.measured?;
    let half = half(first)?.hypot(half(second)?);
    let (low, high) = (by - half, by + half);
    let stream = stream(&first.name);
    // Controls that are recorded early act late.
    let drift = by / apart_s * if stream == CONTROLS { -1.0 } else { 1.0 };
    let least_s = if is_stated(stream) { STILL_GROWS_S } else { GROWS_S };
    let is_grown = by.abs() > least_s && (low > 0.0 || high < 0.0);
    let message = format!(
        "from the first half of a flight to the second the delay of the {} grows by {:.0} ms: a clock of its own, {:.2} % {}",
        stream.replace('_', " "),
        1e3 * by,
        100.0 * drift.abs(),
        // What comes ever later has stamps that run ahead.
        if drift > 0.0 { "fast" } else { "slow" }
    );
    let set = format!("[drift] {stream} = {drift:.5}");
    let found = if is_grown {
        finding(&format!("{CLOCK}{stream}"), Severity::Fault, message, Some(&set))
    } else {
        finding(&format!("{CLOCK}{stream}"), Severity::Ok, "one clock".into(), None)
    };
    Some(Finding {
        subject: Subject::Timing,
        measured: Some(by),
        interval: Some([low, high]),
        expected: Some(0.0),
        unit: "s".into(),
        ..found
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(measured: f64, of_model_s: Option<f64>) -> Finding {
        let finding = finding(
            "control_delay",
            Severity::Ok,
            "controls act this late".into(),
            Some("control_delay_s = 0.006 under [data] in the model file"),
        );
        Finding { measured: Some(measured), interval: Some([measured - 0.001, measured + 0.001]), expected: of_model_s, ..finding }
    }

    #[test]
    fn what_the_sticks_act_late_by_beside_a_stated_clock_is_where_it_began() {
        for (measured, of_model_s, set) in [
            (0.006, None, Some("[late] controls = -0.0060")),
            (-0.004, None, Some("[late] controls = 0.0040")),
            (0.026, Some(0.02), Some("[late] controls = -0.0060")),
            (0.02, Some(0.02), None),
            (0.0008, None, None),
        ] {
            let mut finding = delay(measured, of_model_s);
            began(&mut finding);
            let moved = finding.set.as_deref().filter(|set| set.starts_with("[late]"));
            assert_eq!(moved, set, "{measured}, {of_model_s:?}");
            assert_eq!(finding.verdict == Severity::Warning, set.is_some());
        }
    }
}
