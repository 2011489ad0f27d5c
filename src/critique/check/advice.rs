//! Advice against what `dataset.toml` states already: what it says is not advised again, and a unit that it states is named as what may
//! be wrong. Nothing is measured here.

use super::finding::Finding;
use crate::flight::Source;

/// Keys whose value is a word.
const WORDS: [&str; 4] = ["axes", "velocity", "targets", "quaternion"];

/// Groups of units, a column of each, and the group in whose place its unit could be wrong.
const UNITS: [(&str, &str, &str); 7] = [
    ("angles", "roll", "rates"),
    ("rates", "wx", "angles"),
    ("position", "x", "velocity"),
    ("velocity", "vx", "position"),
    ("acceleration", "vx_dot", "velocity"),
    ("angular_acceleration", "wx_dot", "rates"),
    ("controls", "u1", "controls"),
];

/// Takes back what is stated, and adds what is stated and may be wrong.
pub(super) fn heed(finding: &mut Finding, source: &Source) {
    let Some(set) = finding.set.clone().filter(|_| !source.stated.is_empty()) else { return };
    let stated = |key: &str| source.stated.get(key).map(String::as_str);
    let word = WORDS.into_iter().find(|word| stated(word).is_some_and(|value| says(&set, word, value)));
    if let Some(word) = word {
        return take_back(finding, &format!("{word} = \"{}\"", stated(word).unwrap_or_default()));
    }
    let Some((_, units)) = set.split_once("[units] ") else { return };
    let units = units.split(';').next().unwrap_or(units);
    let unit_of = |group: &str| {
        let column = UNITS.iter().find(|known| known.0 == group).map_or("", |known| known.1);
        stated(&format!("units.{group}")).or_else(|| stated(&format!("units.{column}")))
    };
    let mut doubtful = Vec::new();
    for (group, _, other) in UNITS.into_iter().filter(|known| mentions(units, known.0)) {
        match unit_of(group) {
            Some(unit) if says(units, group, unit) => return take_back(finding, &format!("[units] {group} = \"{unit}\"")),
            Some(unit) => doubtful.push(format!("{group} = \"{unit}\"")),
            None => doubtful.extend(unit_of(other).map(|unit| format!("{other} = \"{unit}\""))),
        }
    }
    doubtful.dedup();
    if !doubtful.is_empty() {
        finding.set = Some(format!("{set}; or take back {}, which dataset.toml states", doubtful.join(", ")));
    }
}

fn take_back(finding: &mut Finding, stated: &str) {
    finding.set = None;
    finding.message.push_str(&format!("; dataset.toml states {stated} already: that is not so, or something else is wrong"));
}

/// Whether an advice gives a key this very value.
fn says(advice: &str, key: &str, value: &str) -> bool {
    advice.match_indices(&format!("{key} = \"{value}\"")).any(|(at, _)| starts_word(advice, at))
}

fn mentions(advice: &str, word: &str) -> bool {
    let ends = |at: usize| !advice[at + word.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_' || c == '/');
    advice.match_indices(word).any(|(at, _)| starts_word(advice, at) && ends(at))
}

fn starts_word(text: &str, at: usize) -> bool {
    !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests {
    use super::super::finding::{Severity, Subject};
    use super::*;

    fn heeded(set: &str, stated: &[(&str, &str)]) -> (Option<String>, String) {
        let mut finding = Finding {
            name: "a".into(),
            subject: Subject::Conventions,
            verdict: Severity::Fault,
            measured: None,
            interval: None,
            expected: None,
            unit: "1".into(),
            message: "m".into(),
            set: Some(set.into()),
            flights: Vec::new(),
        };
        let stated = stated.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        heed(&mut finding, &Source { stated, ..Source::default() });
        (finding.set, finding.message)
    }

    #[test]
    fn what_is_stated_is_not_advised_again() {
        for (set, stated) in [
            ("velocity = \"inertial\"", ("velocity", "inertial")),
            ("quaternion = \"wxyz\"", ("quaternion", "wxyz")),
            ("[units] angles = \"deg\"", ("units.angles", "deg")),
            ("[units] rates = \"deg/s\"", ("units.wx", "deg/s")),
        ] {
            let (set, message) = heeded(set, &[stated]);
            assert!(set.is_none() && message.contains("dataset.toml states"), "{stated:?}: {message}");
        }
    }

    #[test]
    fn a_stated_unit_that_could_be_the_mistake_is_named_and_other_advice_stays() {
        let advice = "[units] rates = \"deg/s\"";
        assert_eq!(heeded(advice, &[]).0.as_deref(), Some(advice));
        assert_eq!(heeded(advice, &[("units.t", "ms"), ("axes", "ENU/FLU")]).0.as_deref(), Some(advice));
        let (set, _) = heeded(advice, &[("units.angles", "deg")]);
        assert_eq!(set.as_deref(), Some("[units] rates = \"deg/s\"; or take back angles = \"deg\", which dataset.toml states"));
        let (set, _) = heeded("velocity = \"inertial\"", &[("velocity", "body")]);
        assert_eq!(set.as_deref(), Some("velocity = \"inertial\""));
        let (set, _) = heeded("[units] position or velocity; or the columns of this axis are others", &[("units.vx", "ft/s")]);
        assert!(set.is_some_and(|set| set.ends_with("; or take back velocity = \"ft/s\", which dataset.toml states")));
    }
}
