//! Which samples may be learned from and which only judge: the paper's two protocols, one for histories that are to be compared, and a
//! chronological one for a single log.
//!
//! A split is made before anything else (calibration, scaling, windows), and what follows sees only [`Span`]s. No window
//! crosses a span, so no window crosses a partition and no time stamp is in two of them (paper section 4.1).

use super::{Flight, Span, names};
use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use phyture_kernels::random::permutation;
use std::fmt;
use std::str::FromStr;

/// Length of a segment of the benchmark split, s (paper section 4.1).
pub const SEGMENT_S: f64 = 10.0;

/// Length of a stretch of the split `stretches`, s: its first ten seconds are history, and twenty are left to judge.
pub const STRETCH_S: f64 = 30.0;

/// Seed of the benchmark split (paper section 4.1).
pub const BENCHMARK_SEED: u64 = 2030;

/// Shares of the segments that train and validate; the rest tests (paper section 4.1: 70/20/10).
const TRAINING_SHARE: f64 = 0.7;
const VALIDATION_SHARE: f64 = 0.2;

/// Of so many flights one is kept from a search.
const SEARCH_SHARE: usize = 5;
/// Of so many segments one validates where the division keeps none for that.
const VALIDATING: usize = 5;

/// How samples are divided.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Protocol {
    /// Random 10-s segments, 70 % training, 20 % validation, 10 % test (paper section 4.1). Leftovers shorter than 10 s at the
    /// end of a flight belong to no partition. Written `segments`.
    #[default]
    Segments,
    /// Random stretches of 30 s in the same shares; what is left over at the end of a flight trains. A history of 10 s fits into one, so that every
    /// history up to that is judged on the same samples. Written `stretches`.
    Stretches,
    /// The first share of every flight trains, the rest tests; no validation. Written `first 0.75`.
    First(f64),
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Segments => f.write_str("segments"),
            Self::Stretches => f.write_str("stretches"),
            Self::First(share) => write!(f, "first {share}"),
        }
    }
}

impl From<Protocol> for String {
    fn from(protocol: Protocol) -> Self {
        protocol.to_string()
    }
}

impl TryFrom<String> for Protocol {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl FromStr for Protocol {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let first = || text.strip_prefix("first")?.trim().parse().ok().filter(|share: &f64| *share > 0.0 && *share < 1.0);
        match text.trim() {
            "segments" => Ok(Self::Segments),
            "stretches" => Ok(Self::Stretches),
            _ => first().map(Self::First).ok_or_else(|| Error::Config {
                place: "split".into(),
                field: "split".into(),
                found: format!("`{text}`"),
                expected:
                    "`segments` (random 10-s segments, 70/20/10), `stretches` (of 30 s) or `first SHARE` with a share between 0 and 1, as in `first 0.75`"
                        .into(),
            }),
        }
    }
}

impl Protocol {
    /// Time at the beginning of a stretch of test samples that is history and not judged, s: the longest history that is judged on the same
    /// samples as all shorter ones. 0 where each history is judged wherever it fits.
    pub const fn lead_s(&self) -> f64 {
        match self {
            Self::Stretches => SEGMENT_S,
            Self::Segments | Self::First(_) => 0.0,
        }
    }
}

/// Which part of the data a figure is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// Flights named in the model file that no search and no training sees.
    Locked,
    /// The test partition of the protocol.
    Test,
    /// Everything.
    All,
}

impl Part {
    /// Name in files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Locked => "locked",
            Self::Test => "test",
            Self::All => "all",
        }
    }
}

/// A division of a data set into spans.
///
/// # Examples
/// ```
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// # #[cfg(feature = "sim")]
/// # fn main() -> phyture::Result<()> {
/// use phyture::flight::split::Split;
/// use phyture::sim::{Simulation, simulate};
///
/// let flights = simulate(&Simulation { minutes: 4.0, ..Simulation::baseline() })?.flights;
/// let split = Split::for_search(&flights, 3);
/// for kept in &split.test {
///     println!("{}: {} rows that no search sees", flights[kept.flight].name, kept.end - kept.start);
/// }
/// assert!(!split.test.is_empty());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Calibration, scaling and training use these only.
    pub training: Vec<Span>,
    /// Hyperparameter choice only.
    pub validation: Vec<Span>,
    /// Judged once, at the end.
    pub test: Vec<Span>,
    /// What `test` is: locked flights or the protocol's test partition.
    pub tested: Part,
}

impl Split {
    /// Divides `flights`. Where `locked` names manoeuvre classes or flights, these are the test part and *all* other flights
    /// train (the paper's manoeuvre-class protocol, section 4.4; a flight by its path, or by the last part of it where only one flight
    /// has that); otherwise `protocol` divides each flight, with `seed`.
    ///
    /// # Errors
    /// [`Error::Config`] if a locked name fits neither a class nor a flight, or several flights; [`Error::Undetermined`] if nothing is left to
    /// train on or to test on.
    pub fn new(flights: &[Flight], locked: &[String], protocol: &Protocol, seed: u64) -> Result<Self> {
        let split = if locked.is_empty() { by_protocol(flights, protocol, seed) } else { by_name(flights, locked)? };
        for (spans, part) in [(&split.training, "train"), (&split.test, "test")] {
            if spans.is_empty() {
                let rule =
                    if locked.is_empty() { format!("the split `{protocol}`") } else { format!("locking {}", locked.join(", ")) };
                return Err(Error::Undetermined(format!(
                    "{rule} leaves no samples to {part} on, of {} flight(s) and {:.0} s; give more or longer flights, or another split",
                    flights.len(),
                    flights.iter().map(Flight::duration_s).sum::<f64>()
                )));
            }
        }
        Ok(split)
    }

    /// Keeps whole flights from a search: one of every five in the order of class and name, which one by `seed`; of fewer than ten
    /// flights the last fifth of each. Nothing validates.
    pub fn for_search(flights: &[Flight], seed: u64) -> Self {
        if flights.len() < 2 * SEARCH_SHARE {
            let share = 1.0 - 1.0 / SEARCH_SHARE as f64;
            return by_protocol(flights, &Protocol::First(share), seed);
        }
        let offset = permutation(SEARCH_SHARE, seed, 0).first().map_or(0, |first| *first as usize);
        let mut order: Vec<usize> = (0..flights.len()).collect();
        order.sort_by(|&left, &right| {
            let key = |index: usize| (&flights[index].manoeuvre, &flights[index].name);
            key(left).cmp(&key(right))
        });
        let kept = |flight: usize| order.iter().position(|&other| other == flight).is_some_and(|at| at % SEARCH_SHARE == offset);
        let (test, training) = whole(flights).partition(|span| kept(span.flight));
        Self { training, validation: Vec::new(), test, tested: Part::Test }
    }

    /// The same division with a random share of the training part's 10-s segments; what is left over at the end of a training span
    /// goes with the rest.
    #[must_use]
    pub fn with_less_training(&self, flights: &[Flight], share: f64, seed: u64) -> Self {
        let of_span = |span: &Span| segments(*span, flights[span.flight].step_s, SEGMENT_S).collect::<Vec<_>>();
        let sorted: Vec<Span> = self.training.iter().flat_map(of_span).collect();
        let kept = (sorted.len() as f64 * share).round() as usize;
        let chosen = permutation(sorted.len(), seed, 0).into_iter().take(kept).map(|index| sorted[index as usize]);
        Self { training: joined(chosen.collect()), ..self.clone() }
    }

    /// The same division where nothing validates, with a fifth of the training part's segments of a length taken for that.
    #[must_use]
    pub fn with_validation(&self, flights: &[Flight], length_s: f64, seed: u64) -> Self {
        let of_span = |span: &Span| segments(*span, flights[span.flight].step_s, length_s).collect::<Vec<_>>();
        let sorted: Vec<Span> = self.training.iter().flat_map(of_span).collect();
        let count = sorted.len() / VALIDATING;
        let mut validation: Vec<Span> =
            permutation(sorted.len(), seed, 0).into_iter().take(count).map(|index| sorted[index as usize]).collect();
        validation.sort_unstable();
        let mut training = self.training.clone();
        for taken in &validation {
            let holds = |span: &Span| span.flight == taken.flight && span.start <= taken.start && taken.end <= span.end;
            let at = training.iter().position(holds).expect("it was cut from one of them");
            let span = training.remove(at);
            let parts = [Span { end: taken.start, ..span }, Span { start: taken.end, ..span }];
            training.extend(parts.into_iter().filter(|part| part.start < part.end));
        }
        training.sort_unstable();
        Self { training, validation: joined(validation), ..self.clone() }
    }
}

fn whole(flights: &[Flight]) -> impl Iterator<Item = Span> {
    flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() })
}

fn by_name(flights: &[Flight], locked: &[String]) -> Result<Split> {
    let mut kept = vec![false; flights.len()];
    for name in locked {
        let fault = |found: String, expected: String| Error::Config {
            place: "model file".into(),
            field: "data.locked".into(),
            found,
            expected,
        };
        let class = flights.iter().any(|flight| flight.manoeuvre == *name);
        let meant = names::find(flights, name);
        match meant.as_slice() {
            [] if !class => {
                let mut classes: Vec<&str> = flights.iter().map(|flight| flight.manoeuvre.as_str()).collect();
                classes.sort_unstable();
                classes.dedup();
                let known = classes.iter().copied().chain(flights.iter().map(|flight| flight.name.as_str()));
                let hint = did_you_mean(name, known);
                return Err(fault(
                    format!("`{name}`, which is no manoeuvre class and no flight of this data set"),
                    format!("one of the classes {} or a flight's name{hint}", classes.join(", ")),
                ));
            }
            [_, _, ..] if !class => {
                let candidates = names::listed(meant.iter().map(|&flight| flights[flight].name.as_str()));
                return Err(fault(
                    format!("`{name}`, which is the name of {} flights", meant.len()),
                    format!("one of them by its path: {candidates}"),
                ));
            }
            _ => meant.iter().filter(|_| meant.len() == 1).for_each(|&flight| kept[flight] = true),
        }
        kept.iter_mut().zip(flights).for_each(|(kept, flight)| *kept |= flight.manoeuvre == *name);
    }
    let (test, training) = whole(flights).partition(|span| kept[span.flight]);
    Ok(Split { training, validation: Vec::new(), test, tested: Part::Locked })
}

fn by_protocol(flights: &[Flight], protocol: &Protocol, seed: u64) -> Split {
    let mut split = Split { training: Vec::new(), validation: Vec::new(), test: Vec::new(), tested: Part::Test };
    match *protocol {
        Protocol::First(share) => {
            for span in whole(flights) {
                let cut = (span.end as f64 * share).round() as usize;
                split.training.extend((cut > 0).then_some(Span { end: cut, ..span }));
                split.test.extend((cut < span.end).then_some(Span { start: cut, ..span }));
            }
        }
        Protocol::Segments | Protocol::Stretches => {
            let (length_s, rest_trains) = if *protocol == Protocol::Segments { (SEGMENT_S, false) } else { (STRETCH_S, true) };
            let sorted: Vec<Span> = whole(flights).flat_map(|span| segments(span, flights[span.flight].step_s, length_s)).collect();
            let mut segments: Vec<Span> =
                permutation(sorted.len(), seed, 0).into_iter().map(|index| sorted[index as usize]).collect();
            let training = (segments.len() as f64 * TRAINING_SHARE).round() as usize;
            let validation = (segments.len() as f64 * VALIDATION_SHARE).round() as usize;
            // A test segment is worth more than a validation one when there are only a few.
            let validation = validation.min(segments.len().saturating_sub(training + 1));
            split.test = joined(segments.split_off(training + validation));
            split.validation = joined(segments.split_off(training));
            let rest = whole(flights).map(|span| {
                let ends = sorted.iter().rev().find(|last| last.flight == span.flight).map_or(0, |last| last.end);
                Span { start: ends, ..span }
            });
            segments.extend(rest.filter(|rest| rest_trains && rest.start < rest.end));
            split.training = joined(segments);
        }
    }
    split
}

/// The whole segments of a span.
fn segments(span: Span, step_s: f64, length_s: f64) -> impl Iterator<Item = Span> {
    let samples = (length_s / step_s).round().max(1.0) as usize;
    (0..(span.end - span.start) / samples).map(move |index| {
        let start = span.start + index * samples;
        Span { flight: span.flight, start, end: start + samples }
    })
}

/// Sorts spans and joins those that touch.
fn joined(mut spans: Vec<Span>) -> Vec<Span> {
    spans.sort_unstable();
    let mut runs: Vec<Span> = Vec::with_capacity(spans.len());
    for span in spans {
        match runs.last_mut() {
            Some(run) if run.flight == span.flight && run.end == span.start => run.end = span.end,
            _ => runs.push(span),
        }
    }
    runs
}

/// The 20 canonical classes sorted and paired, or whatever classes there are: `(held-out classes)` a fold (paper section 4.4).
pub fn class_folds(classes: &[&str], folds: usize) -> Vec<Vec<String>> {
    let mut sorted: Vec<String> = classes.iter().map(|class| (*class).to_owned()).collect();
    sorted.sort_unstable();
    sorted.dedup();
    let size = sorted.len().div_ceil(folds.max(1)).max(1);
    sorted.chunks(size).map(<[String]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Targets;
    use proptest::prelude::*;

    fn flights(lengths: &[usize]) -> Vec<Flight> {
        let flight = |(index, samples): (usize, &usize)| {
            let columns = std::array::from_fn(|_| vec![0.0; *samples]);
            Flight::new(format!("f{index}"), format!("class{}", index % 3), 0.0, 0.01, columns, Targets::Recorded)
        };
        lengths.iter().enumerate().filter_map(|pair| flight(pair).ok()).collect()
    }

    fn samples(spans: &[Span]) -> usize {
        spans.iter().map(|span| span.end - span.start).sum()
    }

    proptest! {
        #[test]
        fn segments_are_disjoint_and_of_the_stated_shares(lengths in prop::collection::vec(1usize..9000, 4..12), seed: u64) {
            let logs = flights(&lengths);
            let whole_segments: usize = lengths.iter().map(|length| length / 1000).sum();
            prop_assume!(whole_segments >= 10);
            let split = Split::new(&logs, &[], &Protocol::Segments, seed).map_err(|error| TestCaseError::fail(error.to_string()))?;
            let mut seen: Vec<Vec<u8>> = lengths.iter().map(|length| vec![0; *length]).collect();
            for span in split.training.iter().chain(&split.validation).chain(&split.test) {
                seen[span.flight][span.start..span.end].iter_mut().for_each(|count| *count += 1);
            }
            prop_assert!(seen.iter().flatten().all(|count| *count <= 1));
            prop_assert_eq!(samples(&split.training), (whole_segments as f64 * 0.7).round() as usize * 1000);
            let all = samples(&split.training) + samples(&split.validation) + samples(&split.test);
            prop_assert_eq!(all, whole_segments * 1000);
        }
    }

    proptest! {
        #[test]
        fn what_validates_is_a_fifth_of_what_trained_and_nothing_is_lost(lengths in prop::collection::vec(1usize..9000, 4..12), seed: u64) {
            let logs = flights(&lengths);
            let before = Split { validation: Vec::new(), ..Split::for_search(&logs, seed) };
            let after = before.with_validation(&logs, SEGMENT_S, seed);
            let mut seen: Vec<Vec<u8>> = lengths.iter().map(|length| vec![0; *length]).collect();
            for span in after.training.iter().chain(&after.validation) {
                prop_assert!(span.start < span.end);
                seen[span.flight][span.start..span.end].iter_mut().for_each(|count| *count += 1);
            }
            for span in &before.training {
                prop_assert!(seen[span.flight][span.start..span.end].iter().all(|count| *count == 1), "a sample lost, or taken twice");
            }
            prop_assert_eq!(samples(&after.training) + samples(&after.validation), samples(&before.training));
            prop_assert_eq!(&after.test, &before.test);
            let segments: usize =
                before.training.iter().map(|span| segments(*span, logs[span.flight].step_s, SEGMENT_S).count()).sum();
            prop_assert!(after.validation.len() <= segments / VALIDATING);
            prop_assert_eq!(after.validation.is_empty(), segments < VALIDATING);
        }
    }

    proptest! {
        #[test]
        fn stretches_take_in_a_history_of_ten_seconds_and_leave_nothing_out(lengths in prop::collection::vec(1usize..20000, 8..16), seed: u64) {
            let logs = flights(&lengths);
            let whole_stretches: usize = lengths.iter().map(|length| length / 3000).sum();
            prop_assume!(whole_stretches >= 10);
            let split = Split::new(&logs, &[], &Protocol::Stretches, seed).map_err(|error| TestCaseError::fail(error.to_string()))?;
            let all = samples(&split.training) + samples(&split.validation) + samples(&split.test);
            prop_assert_eq!(all, lengths.iter().sum::<usize>());
            prop_assert!(split.test.iter().chain(&split.validation).all(|span| (span.end - span.start).is_multiple_of(3000)));
            let lead = (Protocol::Stretches.lead_s() / 0.01).round() as usize;
            for history in [1, 128, 1000] {
                let judged = crate::flight::windows::windows(&split.test, history.max(lead), 10);
                prop_assert_eq!(judged, crate::flight::windows::windows(&split.test, 1000, 10));
            }
        }
    }

    #[test]
    fn less_training_is_a_part_of_the_training_and_leaves_the_test() -> Result<()> {
        let logs = flights(&[9000, 8500, 7000]);
        let whole = Split::new(&logs, &[], &Protocol::Segments, 3)?;
        let half = whole.with_less_training(&logs, 0.5, 3);
        assert_eq!(samples(&half.training), (samples(&whole.training) as f64 / 2000.0).round() as usize * 1000);
        let inside = |span: &Span| {
            whole.training.iter().any(|other| other.flight == span.flight && other.start <= span.start && span.end <= other.end)
        };
        assert!(half.training.iter().all(inside));
        assert_eq!((&half.test, &half.validation), (&whole.test, &whole.validation));
        Ok(())
    }

    #[test]
    fn a_flight_is_locked_by_its_path_or_by_a_name_that_is_its_alone() -> Result<()> {
        let named = |name: &str, manoeuvre: &str| {
            Flight::new(name, manoeuvre, 0.0, 0.01, std::array::from_fn(|_| vec![0.0; 10]), Targets::Recorded)
        };
        let logs = [named("chaos/f0", "chaos")?, named("hover/f0", "hover")?, named("hover/f1", "hover")?];
        let locked = |name: &str| -> Result<Vec<usize>> {
            let split = Split::new(&logs, &[name.to_owned()], &Protocol::Segments, 1)?;
            Ok(split.test.iter().map(|span| span.flight).collect())
        };
        assert_eq!((locked("hover/f0")?, locked("f1")?, locked("hover")?), (vec![1], vec![2], vec![1, 2]));
        let ambiguous = locked("f0").map_err(|error| error.to_string());
        assert!(
            matches!(ambiguous, Err(text) if text.contains("the name of 2 flights") && text.contains("`chaos/f0`, `hover/f0`"))
        );
        let unknown = locked("hover/f2").map_err(|error| error.to_string());
        assert!(matches!(unknown, Err(text) if text.contains("did you mean")));
        Ok(())
    }

    #[test]
    fn locked_flights_are_the_test_and_nothing_else_is() -> Result<()> {
        let logs = flights(&[100, 200, 300, 400]);
        let split = Split::new(&logs, &["class1".into(), "f3".into()], &Protocol::Segments, 1)?;
        assert_eq!(split.test.iter().map(|span| span.flight).collect::<Vec<_>>(), [1, 3]);
        assert_eq!(split.training.iter().map(|span| span.flight).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(split.tested, Part::Locked);
        Ok(())
    }

    #[test]
    fn an_unknown_locked_name_is_an_error_that_lists_the_classes() {
        let message = Split::new(&flights(&[100]), &["chaos".into()], &Protocol::Segments, 1).map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("`chaos`") && text.contains("class0")));
    }

    #[test]
    fn too_little_data_is_said() {
        let message = Split::new(&flights(&[900]), &[], &Protocol::Segments, 1).map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("no samples to train on")));
    }

    #[test]
    fn first_share_is_chronological_and_round_trips() -> Result<()> {
        let protocol: Protocol = "first 0.75".parse()?;
        assert_eq!(protocol.to_string(), "first 0.75");
        let split = Split::new(&flights(&[1000]), &[], &protocol, 1)?;
        assert_eq!(split.training, [Span { flight: 0, start: 0, end: 750 }]);
        assert_eq!(split.test, [Span { flight: 0, start: 750, end: 1000 }]);
        assert!("first 1.5".parse::<Protocol>().is_err());
        Ok(())
    }

    #[test]
    fn twenty_classes_make_ten_pairs() {
        let names: Vec<String> = (0..20).map(|index| format!("m{index:02}")).collect();
        let folds = class_folds(&names.iter().map(String::as_str).collect::<Vec<_>>(), 10);
        assert_eq!(folds.len(), 10);
        assert_eq!(folds[3], ["m06", "m07"]);
    }

    proptest! {
        #[test]
        fn a_search_keeps_a_fifth_of_whole_flights_from_itself(lengths in prop::collection::vec(1usize..50, 10..80), seed: u64) {
            let logs = flights(&lengths);
            let split = Split::for_search(&logs, seed);
            let mut seen: Vec<usize> = split.training.iter().chain(&split.test).map(|span| span.flight).collect();
            seen.sort_unstable();
            prop_assert_eq!(seen, (0..logs.len()).collect::<Vec<_>>());
            prop_assert!(split.training.iter().chain(&split.test).all(|span| span.start == 0 && span.end == lengths[span.flight]));
            prop_assert!(split.validation.is_empty());
            prop_assert!((split.test.len() * 5).abs_diff(logs.len()) < 5);
            prop_assert_eq!(&split.test, &Split::for_search(&logs, seed).test);
        }

        #[test]
        fn of_few_flights_a_search_keeps_the_end_of_each(lengths in prop::collection::vec(10usize..500, 1..10), seed: u64) {
            let logs = flights(&lengths);
            let split = Split::for_search(&logs, seed);
            for (flight, length) in lengths.iter().enumerate() {
                let of = |spans: &[Span]| spans.iter().copied().filter(|span| span.flight == flight).collect::<Vec<_>>();
                let (search, kept) = (of(&split.training), of(&split.test));
                prop_assert!(search.len() == 1 && kept.len() == 1);
                prop_assert_eq!((search[0].start, search[0].end, kept[0].end), (0, kept[0].start, *length));
                prop_assert!((samples(&kept) * 5).abs_diff(*length) <= 3);
            }
        }
    }
}
