//! Where rows are lost that no gap in time shows, or parts of logs were joined: most relations of mechanics leap there in a single step. That rows of a flight do
//! not follow each other is found in `causes`; here is where, and the rules of `dataset.toml` that cut the flights there.

use super::causes::LEAPING;
use super::channels::{Channel, difference};
use super::flights::left_out;
use super::increments::Motion;
use super::robust::median;
use super::stamps::log_of;
use crate::flight::{DataSet, Flight, Source};

/// A step is a leap where it is so many times the usual one beside what says how fast a column changes.
const FAR: f64 = 12.0;
/// Pieces of a flight are so long on the average at least, s, or it is left out, …
const SHORTEST_S: f64 = 1.0;
/// … which this part of the flights may be.
const LEFT_OUT: f64 = 0.5;
/// Digits of a second: rows are no closer to each other.
const MICROSECONDS: f64 = 1e6;

/// How the finding is named.
pub(super) const ROWS: &str = "rows";

/// Rules that cut the flights where rows are lost, and leave those out that would be in shreds; `None` where there is no such place, or too many.
pub(super) fn mend(data: &DataSet) -> Option<String> {
    let mut shreds = Vec::new();
    let mut rules: Vec<String> = data.flights.iter().filter_map(|flight| rule(flight, &data.source, &mut shreds)).collect();
    if rules.is_empty() || shreds.len() as f64 > LEFT_OUT * data.flights.len() as f64 {
        return None;
    }
    rules.extend((!shreds.is_empty()).then(|| left_out(&shreds)));
    Some(rules.join("\n"))
}

/// The rule for one flight, if it leaps; one that leaps too often is among `shreds` then.
fn rule<'f>(flight: &'f Flight, source: &Source, shreds: &mut Vec<&'f str>) -> Option<String> {
    let places = places(&Motion::new(flight, source));
    flight.rest();
    if places.is_empty() {
        return None;
    }
    if flight.duration_s() < SHORTEST_S * (places.len() + 1) as f64 {
        shreds.push(&flight.name);
        return None;
    }
    let at_s = places.iter().map(|place| flight.start_s + *place as f64 * flight.step_s);
    let at: Vec<String> = at_s.map(|at_s| format!("{:?}", (at_s * MICROSECONDS).round() / MICROSECONDS)).collect();
    Some(format!("[[cut]] flights = [{:?}], at = [{}]", log_of(&flight.name), at.join(", ")))
}

/// Samples that do not follow the ones before them.
fn places(motion: &Motion) -> Vec<usize> {
    let channels = Channel::all(motion);
    let mut leaping = vec![0; motion.instants.len()];
    for channel in &channels {
        let error = |k: usize| (channel.change(&(k - 1..k)) - difference(&channel.sum, &(k - 1..k))).abs();
        let errors: Vec<f64> = (1..motion.instants.len()).map(error).collect();
        let Some(usual) = median(errors.clone()) else { continue };
        errors.iter().zip(&mut leaping[1..]).for_each(|(error, leaping)| *leaping += usize::from(*error > FAR * usual));
    }
    let is_place = |entry: &(usize, usize)| entry.1 >= LEAPING.min(channels.len().div_ceil(2));
    leaping.into_iter().enumerate().filter(is_place).map(|entry| entry.0).collect()
}
