//! An accepted effect, and what it takes from others that are looked at after it.

use super::gates::{SHADOW, SMALLEST_FALL, SMALLEST_SHARE_OF_ACCEPTED, SMALLEST_SHARE_OF_RIVAL};
use super::report::Step;
use super::scored::Scored;
use crate::flight::{Channel, PerChannel};
use crate::physics::Model;
use std::collections::BTreeMap;

/// One accepted effect and the model that has it.
pub(super) struct Found {
    pub step: Step,
    pub gain: f64,
    pub model: Model,
    /// Channels in which it is worth while.
    pub channels: Vec<Channel>,
    /// Effects that it is mistaken for.
    pub confusable: &'static [&'static str],
    /// Mean squared errors before it was accepted, and what it took from them.
    pub mse_before: PerChannel<f64>,
    pub removed: PerChannel<f64>,
}

impl Found {
    /// What it takes by itself from a channel's mean squared error, of which `left` remains: from what was there when it was found, or, where all are
    /// judged at once, from what is there without it.
    pub(super) fn took(&self, channel: Channel, left: f64) -> f64 {
        let fall = self.step.held_out_mse_fall.get(channel.name()).copied().unwrap_or(0.0);
        self.removed[channel].max(left * fall / (1.0 - fall))
    }

    /// Effects that lose nearly all of their gain beside this one, while this one would lose nearly all of its beside them, cannot be
    /// told from it. `scored` are gains beside it, `earlier` those of the effects that passed when it was chosen.
    pub(super) fn shadows(&mut self, scored: &[Scored<'_>], earlier: &BTreeMap<String, f64>) {
        for other in scored {
            let Some(&alone) = earlier.get(&other.candidate.id) else { continue };
            let beside = self.gain + other.gain - alone;
            let mutual = other.gain < SHADOW * alone && beside < SHADOW * self.gain;
            if mutual && !self.step.indistinguishable.contains(&other.candidate.id) {
                self.step.indistinguishable.push(other.candidate.id.clone());
            }
        }
    }

    /// Whether a candidate removes so little beside what this effect did, in every channel in which it is worth while, that it may
    /// only mend the form of this one.
    ///
    /// The form of a property of each flight is not in doubt.
    pub(super) fn is_flawed_by(&self, other: &Scored<'_>, mse: &PerChannel<f64>) -> bool {
        let own = self.model.effect(&self.step.effect);
        if own.is_some_and(|effect| effect.coefficients.iter().any(|coefficient| coefficient.by_flight.is_some())) {
            return false;
        }
        let notes = other.candidate.definition.and_then(|definition| definition.notes);
        let related = self.confusable.contains(&other.candidate.id.as_str())
            || notes.is_some_and(|notes| notes.confusable_with.contains(&self.step.effect.as_str()));
        let share = if related { SMALLEST_SHARE_OF_RIVAL } else { SMALLEST_SHARE_OF_ACCEPTED };
        let mut worthy = other.falls.iter().filter(|(_, fall)| **fall >= SMALLEST_FALL).peekable();
        worthy.peek().is_some() && worthy.all(|(&channel, fall)| fall * mse[channel] < share * self.removed[channel])
    }
}
