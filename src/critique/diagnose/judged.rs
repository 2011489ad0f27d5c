//! What the backward road says of an effect beside all others, and the model that it comes to. Measured in `backward`.

use super::gates::{LOOSE, SMALLEST_AMPLITUDE, SMALLEST_AMPLITUDE_OF_RIVAL, SMALLEST_FALL};
use super::influence::Influences;
use crate::flight::Channel;
use crate::physics::{Model, catalogue};
use std::collections::BTreeMap;

/// An effect, and what it brings beside all others that are in.
pub(super) struct Judged {
    pub effect: String,
    /// Gain of each block.
    pub gains: Vec<f64>,
    /// Share of the held-out error without it that it removes, by channel that it changes.
    pub falls: BTreeMap<Channel, f64>,
    pub p_value: f64,
    /// Standard error of its best known number, in usual sizes.
    pub looseness: f64,
    /// A flight without which its gain would be gone.
    pub rests_on: Option<String>,
    /// Whether its numbers belong to each flight.
    pub by_flight: bool,
    /// An effect whose form it may only mend.
    pub mends: Option<String>,
    /// An effect that took its place.
    pub gave_way_to: Option<String>,
    /// Effects that would fit as well in its place.
    pub ties: Vec<String>,
}

impl Judged {
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }

    pub fn largest_fall(&self) -> f64 {
        self.falls.values().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// What it removes of a channel's error, in units of what is left with it.
    fn removed(&self, channel: Channel) -> f64 {
        self.falls.get(&channel).map_or(0.0, |fall| fall / (1.0 - fall))
    }

    /// The effect whose form this one may only mend: in every channel in which it is worth while, some other removes so much more that
    /// its form need be wrong by little. The form of a property of each flight is not in doubt.
    pub fn flaw_of<'j>(&self, others: impl Iterator<Item = &'j Judged> + Clone) -> Option<&'j str> {
        let stronger = |channel: Channel| {
            others.clone().filter(|other| other.effect != self.effect && !other.by_flight).find(|other| {
                let amplitude = if related(&self.effect, &other.effect) { SMALLEST_AMPLITUDE_OF_RIVAL } else { SMALLEST_AMPLITUDE };
                self.removed(channel) < amplitude * amplitude * other.removed(channel)
            })
        };
        let worthy = self.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL);
        let found: Vec<Option<&Judged>> = worthy.map(|(&channel, _)| stronger(channel)).collect();
        found.iter().all(Option::is_some).then(|| found.first().copied().flatten().map(|other| other.effect.as_str()))?
    }

    /// Whether these flights could show it.
    pub fn is_excited(&self) -> bool {
        self.looseness <= LOOSE
    }
}

/// Whether two effects are known to be mistaken for each other.
pub(super) fn related(one: &str, other: &str) -> bool {
    let notes = |kind: &str| catalogue::definition(kind).and_then(|definition| definition.notes);
    let listed = |one: &str, other: &str| notes(one).is_some_and(|notes| notes.confusable_with.contains(&other));
    listed(one, other) || listed(other, one)
}

/// A model whose numbers and intervals are from all that was searched, and those of them that hang on one flight.
pub(super) struct Fitted {
    pub model: Model,
    pub influences: Influences,
}
