//! Which column of a log is which, by the names: triples whole or not at all.

use super::vocabulary::{Compass, Place, meaning};
use std::collections::BTreeMap;

/// A column of the file that stands for a canonical one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub name: String,
    /// As the name states it.
    pub unit: Option<&'static str>,
}

/// What the names say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Assigned {
    /// By canonical name.
    pub columns: BTreeMap<&'static str, Found>,
    /// Letters say which part of the quaternion is which.
    pub lettered: bool,
    /// Names say that the vertical axis points up, or down.
    pub up: Option<bool>,
    /// Names say north and east.
    pub compass: bool,
    /// Names say that the velocity is over ground.
    pub over_ground: bool,
    /// Columns that stand for nothing.
    pub others: Vec<String>,
}

/// Columns that go together or not at all.
const WHOLE: [&[&str]; 6] = [
    &["vx", "vy", "vz"],
    &["wx", "wy", "wz"],
    &["vx_dot", "vy_dot", "vz_dot"],
    &["wx_dot", "wy_dot", "wz_dot"],
    &["q1", "q2", "q3", "q4"],
    &["roll", "pitch"],
];

/// Gives the names of a header their places.
pub(super) fn assign(names: &[String]) -> Assigned {
    let mut best: BTreeMap<String, (usize, Place, Found)> = BTreeMap::new();
    for name in names {
        let Some((place, rank, unit)) = meaning(name) else { continue };
        let found = Found { name: name.clone(), unit };
        let key = format!("{place:?}");
        if best.get(&key).is_none_or(|known| rank < known.0) {
            best.insert(key, (rank, place, found));
        }
    }
    let mut assigned = Assigned::default();
    let take = |place: Place| best.get(&format!("{place:?}")).map(|entry| entry.2.clone());
    for (_, place, found) in best.values() {
        if let Place::Canonical(name) = place {
            assigned.columns.insert(name, found.clone());
        }
    }
    let triple = |assigned: &mut Assigned, targets: [&'static str; 3], places: [Place; 3]| {
        let [Some(a), Some(b), Some(c)] = places.map(take) else { return false };
        targets.into_iter().zip([a, b, c]).for_each(|(target, found)| drop(assigned.columns.insert(target, found)));
        true
    };
    for (up, order) in
        [(false, [Compass::North, Compass::East, Compass::Down]), (true, [Compass::East, Compass::North, Compass::Up])]
    {
        if triple(&mut assigned, ["vx", "vy", "vz"], order.map(Place::Velocity)) {
            (assigned.up, assigned.compass, assigned.over_ground) = (Some(up), true, true);
        }
        if triple(&mut assigned, ["x", "y", "z"], order.map(Place::Position)) {
            (assigned.up, assigned.compass) = (Some(up), true);
        }
    }
    let parts: Vec<Option<Found>> = (0..4).map(|part| take(Place::Quaternion(part))).collect();
    if let [Some(x), Some(y), Some(z), Some(w)] = parts.as_slice() {
        for (target, found) in ["q1", "q2", "q3", "q4"].into_iter().zip([x, y, z, w]) {
            assigned.columns.insert(target, found.clone());
        }
        assigned.lettered = true;
    } else if let [Some(_), Some(_), Some(_)] = ["q1", "q2", "q3"].map(|name| assigned.columns.get(name))
        && !assigned.columns.contains_key("q4")
        && let Some(zero) = names.iter().find(|name| name.eq_ignore_ascii_case("q0"))
    {
        // Counted from nought: the places move on by one.
        for (to, from) in [("q4", "q3"), ("q3", "q2"), ("q2", "q1")] {
            if let Some(found) = assigned.columns.remove(from) {
                assigned.columns.insert(to, found);
            }
        }
        assigned.columns.insert("q1", Found { name: zero.clone(), unit: None });
    }
    for group in WHOLE {
        if !group.iter().all(|name| assigned.columns.contains_key(name)) {
            group.iter().for_each(|name| drop(assigned.columns.remove(name)));
        }
    }
    if assigned.columns.contains_key("roll") {
        ["q1", "q2", "q3", "q4"].iter().for_each(|name| drop(assigned.columns.remove(name)));
    }
    let is_used = |name: &&String| !assigned.columns.values().any(|found| found.name == **name);
    assigned.others = names.iter().filter(is_used).cloned().collect();
    assigned
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &str) -> Assigned {
        assign(&names.split(' ').map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn compass_names_quaternions_and_halves_of_triples() {
        let found = of("time_ms north_m east_m down_m q0 q1 q2 q3 v_east v_north v_up p q r ax ay d_lat Vbat");
        let name = |place: &str| found.columns.get(place).map(|found| found.name.as_str());
        assert_eq!(
            (name("t"), name("x"), name("vx"), name("vz")),
            (Some("time_ms"), Some("north_m"), Some("v_east"), Some("v_up"))
        );
        assert_eq!((name("q1"), name("q4"), name("wy"), name("u1")), (Some("q0"), Some("q3"), Some("q"), Some("d_lat")));
        assert_eq!((name("vx_dot"), found.over_ground), (None, true));
        assert_eq!(found.others, ["ax", "ay", "Vbat"]);
        let found = of("t qw qx qy qz u v w");
        assert_eq!((found.columns["q1"].name.as_str(), found.columns["vz"].name.as_str(), found.lettered), ("qx", "w", true));
    }
}
