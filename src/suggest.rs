//! "Did you mean": the known word nearest to an unknown one. Not a spelling corrector: nothing is ever replaced silently.

/// The candidate with the smallest edit distance to `word`, if that is small enough to be a slip (at most a third of the word,
/// at least one letter). Case and the difference between `-` and `_` cost nothing.
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let fold = |text: &str| -> Vec<char> {
        text.chars().take(64).flat_map(char::to_lowercase).map(|c| if c == '-' { '_' } else { c }).collect()
    };
    let word = fold(word);
    let allowed = (word.len() / 3).max(1);
    candidates
        .into_iter()
        .map(|candidate| (distance(&word, &fold(candidate)), candidate))
        .filter(|&(distance, _)| distance <= allowed)
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

/// The tail of a message: `; did you mean `x`?`, or nothing.
pub fn did_you_mean<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    closest(word, candidates).map(|candidate| format!("; did you mean `{candidate}`?")).unwrap_or_default()
}

/// Levenshtein distance with the transposition of neighbours as one step (optimal string alignment).
fn distance(left: &[char], right: &[char]) -> usize {
    let mut before = vec![0; right.len() + 1];
    let mut last: Vec<usize> = (0..=right.len()).collect();
    for (row, a) in left.iter().enumerate() {
        let mut next = vec![row + 1; right.len() + 1];
        for (column, b) in right.iter().enumerate() {
            let mut best = (last[column] + usize::from(a != b)).min(last[column + 1] + 1).min(next[column] + 1);
            if row > 0 && column > 0 && *a == right[column - 1] && left[row - 1] == *b {
                best = best.min(before[column - 1] + 1);
            }
            next[column + 1] = best;
        }
        before = std::mem::replace(&mut last, next);
    }
    last.last().copied().unwrap_or(left.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_found_and_strangers_are_not() {
        let known = ["mass_kg", "inertia", "rotor_radius_m", "baseline"];
        assert_eq!(closest("mas_kg", known), Some("mass_kg"));
        assert_eq!(closest("Mass-kg", known), Some("mass_kg"));
        assert_eq!(closest("intertia", known), Some("inertia"));
        assert_eq!(closest("colour", known), None);
        assert_eq!(did_you_mean("basline", known), "; did you mean `baseline`?");
        assert_eq!(closest("vz", ["zv", "vx_dot"]), Some("zv"));
    }
}
