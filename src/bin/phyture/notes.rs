//! Notes of a reader, folded for a terminal: what holds for the data set is said, what was done to single flights is counted in one
//! line. Nothing is lost: `--verbose` and the pages list every note.

use std::collections::BTreeSet;

/// Fewer notes on single flights than this are said as they are.
const FEW: usize = 3;

/// The flight that a note is about and what it says; `None` for a note on the data set.
fn of_flight(note: &str) -> Option<(&str, &str)> {
    let (name, rest) = note.strip_prefix('`')?.split_once('`')?;
    Some((name, rest.strip_prefix(": ")?))
}

/// Counts of one kind of note.
#[derive(Default)]
struct Kind<'a> {
    flights: BTreeSet<&'a str>,
    count: u64,
    of: u64,
}

impl<'a> Kind<'a> {
    fn add(&mut self, flight: &'a str, count: u64, of: u64) {
        self.flights.insert(flight);
        self.count += count;
        self.of += of;
    }
}

/// The whole number at the end of a text.
fn last_number(text: &str) -> u64 {
    let digits = text.chars().rev().take_while(char::is_ascii_digit).count();
    text.get(text.len() - digits..).and_then(|digits| digits.parse().ok()).unwrap_or_default()
}

/// Sum of the counts in `8 of `m1`, 4 of `m2``.
fn cells(text: &str) -> u64 {
    let counts = text.split(" of `").collect::<Vec<_>>();
    counts.iter().take(counts.len().saturating_sub(1)).map(|before| last_number(before)).sum()
}

/// `1 piece`, `2 pieces`.
fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// The notes as they are shown without `--verbose`.
pub fn folded(notes: &[String]) -> Vec<String> {
    let single = notes.iter().filter_map(|note| of_flight(note)).count();
    if single < FEW {
        return notes.to_vec();
    }
    let [mut mended, mut lost, mut kept, mut short, mut other]: [Kind<'_>; 5] = Default::default();
    for (flight, text) in notes.iter().filter_map(|note| of_flight(note)) {
        for sentence in text.split("; ") {
            match sentence {
                _ if sentence.starts_with("bad cells interpolated") => mended.add(flight, cells(sentence), 0),
                _ if sentence.starts_with("bad cells left") => lost.add(flight, cells(sentence), 0),
                _ if sentence.starts_with("`use` keeps ") => {
                    let (count, of) = sentence.split_once(" of ").unwrap_or((sentence, ""));
                    kept.add(flight, last_number(count), of.split(' ').next().map_or(0, last_number));
                }
                _ if sentence.ends_with("left out as too short") => short.add(flight, 1, 0),
                _ => other.add(flight, 1, 0),
            }
        }
    }
    let flights = |kind: &Kind<'_>| counted(kind.flights.len() as u64, "flight");
    let told = [
        (&mended, format!("{} bad cells interpolated in {}", mended.count, flights(&mended))),
        (&lost, format!("{} bad cells left without a value in {}", lost.count, flights(&lost))),
        (&kept, format!("`use` keeps {} of {} samples of {}", kept.count, kept.of, flights(&kept))),
        (&short, format!("{} too short and left out in {}", counted(short.count, "piece"), flights(&short))),
        (&other, format!("{} on {}", counted(other.count, "other note"), flights(&other))),
    ];
    let parts: Vec<String> = told.into_iter().filter(|(kind, _)| !kind.flights.is_empty()).map(|(_, text)| text).collect();
    let line = format!("{} (--verbose lists them by flight)", parts.join("; "));
    notes.iter().filter(|note| of_flight(note).is_none()).cloned().chain([line]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(texts: &[&str]) -> Vec<String> {
        texts.iter().map(|text| (*text).to_owned()).collect()
    }

    #[test]
    fn notes_on_single_flights_become_one_line_with_counts() {
        let all = notes(&[
            "read as dataset.toml describes",
            "`yaw` is not in the logs and is zero",
            "`a`: bad cells interpolated linearly, longest run 0.020 s: 8 of `m1`, 14 of `m2`; bad cells left without a value: 4 of `m1`",
            "`a`: `use` keeps 6293 of 6532 samples, in 1 piece",
            "`b`: `use` keeps 100 of 200 samples, in 2 pieces",
            "`b`: the piece of 0.01 s (1 sample) from t = 0.51 s on is left out as too short",
            "`c`: something else",
        ]);
        let found = folded(&all);
        assert_eq!(found[..2], all[..2]);
        assert_eq!(
            found[2..],
            [
                "22 bad cells interpolated in 1 flight; 4 bad cells left without a value in 1 flight; `use` keeps 6393 of 6732 samples of 2 \
              flights; 1 piece too short and left out in 1 flight; 1 other note on 1 flight (--verbose lists them by flight)"
            ]
        );
    }

    #[test]
    fn a_few_notes_are_said_as_they_are() {
        let few = notes(&["common", "`a`: one", "`b`: two"]);
        assert_eq!(folded(&few), few);
        assert!(folded(&[]).is_empty());
    }
}
