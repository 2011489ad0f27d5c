//! Two groups of flights far apart in one number, each close together: two ways of writing a log. What the number is, and what follows, is elsewhere.

use super::robust::{NORMAL, median};

/// Groups are told from this many times what the flights of each scatter …
const APART: f64 = 6.0;
/// … with nothing between them in this part of the way.
const EMPTY: f64 = 0.4;

/// What a flight says of a number.
pub(super) struct Of {
    pub flight: usize,
    pub value: f64,
    /// Half of its interval.
    pub half: f64,
}

/// The flights of the smaller of two groups, in order, and by how much it differs from the other, which is more than `least`; `None` where there is one group.
pub(super) fn apart(mut all: Vec<Of>, least: f64) -> Option<(Vec<usize>, f64)> {
    all.sort_unstable_by(|one, other| one.value.total_cmp(&other.value));
    let gap = |at: usize| all[at].value - all[at - 1].value;
    let split = (1..all.len()).max_by(|one, other| gap(*one).total_cmp(&gap(*other)))?;
    let gap = gap(split);
    let high = all.split_off(split);
    let middle = |group: &[Of]| median(group.iter().map(|one| one.value).collect());
    let [below, above] = [middle(&all)?, middle(&high)?];
    let scatter = all.iter().map(|one| one.value - below).chain(high.iter().map(|one| one.value - above));
    let scatter = NORMAL * median(scatter.map(f64::abs).collect())?;
    let by = above - below;
    let (fewer, by) = if high.len() <= all.len() { (high, by) } else { (all, -by) };
    let unsure = median(fewer.iter().map(|one| one.half).collect())?;
    let mut flights: Vec<usize> = fewer.iter().map(|one| one.flight).collect();
    flights.sort_unstable();
    (by.abs() > least + unsure && by.abs() > APART * scatter && gap > EMPTY * by.abs()).then_some((flights, by))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(of: &[f64]) -> Vec<Of> {
        of.iter().enumerate().map(|(flight, &value)| Of { flight, value, half: 0.01 }).collect()
    }

    #[test]
    fn two_groups_are_told_and_one_that_scatters_is_not() {
        let (fewer, by) = apart(values(&[0.01, 0.21, -0.01, 0.0, 0.02]), 0.05).expect("two groups");
        assert_eq!(fewer, [1]);
        assert!((by - 0.2).abs() < 0.02, "{by}");
        let (fewer, by) = apart(values(&[0.2, 0.0, 0.21, 0.01, 0.0]), 0.05).expect("two groups");
        assert_eq!(fewer, [0, 2]);
        assert!(by > 0.15);
        assert!(apart(values(&[0.0, 0.1, -0.1, 0.2, -0.05]), 0.05).is_none());
    }
}
