//! Names of flights: a path below the data set without the ending (`chaos/flight_0`), and what a person may write for one.
//!
//! A person, and a model file from before names were paths, may give the last part alone (`flight_0`) where only one flight ends
//! in it. Names are compared; no file is looked at.

use super::Flight;

/// The last part of a flight's name: the file's own name.
pub fn own_name(name: &str) -> &str {
    name.rsplit_once('/').map_or(name, |(_, own)| own)
}

/// Which of the names `known` a person means by `wanted`: the one that is equal, or else those with the same last part, if one of the two is
/// a last part alone.
pub(crate) fn matching<'a>(wanted: &str, known: impl Iterator<Item = &'a str> + Clone) -> Vec<&'a str> {
    if let Some(exact) = known.clone().find(|name| *name == wanted) {
        return vec![exact];
    }
    let bare = |name: &str| !name.contains('/');
    let same = |name: &&str| (bare(wanted) || bare(name)) && own_name(name) == own_name(wanted);
    known.filter(same).collect()
}

/// The flights that are meant by `wanted`; more than one is for the caller to refuse.
pub fn find(flights: &[Flight], wanted: &str) -> Vec<usize> {
    let names = matching(wanted, flights.iter().map(|flight| flight.name.as_str()));
    (0..flights.len()).filter(|&index| names.contains(&flights[index].name.as_str())).collect()
}

/// Names in a sentence: each in quotes, the first few of many.
pub(crate) fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 5;
    let more = names.len().saturating_sub(SHOWN);
    let mut text = names.take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_exact_and_a_bare_name_means_what_ends_in_it() {
        let known = ["chaos/a", "hover/a", "hover/b", "a10"];
        let meant = |wanted: &str| matching(wanted, known.into_iter());
        assert_eq!(meant("chaos/a"), ["chaos/a"]);
        assert_eq!(meant("b"), ["hover/b"]);
        assert_eq!(meant("a"), ["chaos/a", "hover/a"]);
        // A log read alone keeps the number that it has in a model of the whole set.
        assert_eq!(meant("loops/a10"), ["a10"]);
        assert!(meant("turn/a").is_empty() && meant("c").is_empty());
        // A flight whose whole name is the word is meant, whatever else ends in it.
        assert_eq!(matching("a", ["a", "hover/a"].into_iter()), ["a"]);
    }
}
