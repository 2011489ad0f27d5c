//! What came of a candidate beside a model: gain, shares of the error, p-value, and which gate decided. Measured in `score`.

use super::candidate::Candidate;
use super::engine::Trial;
use super::gates::SMALLEST_FALL;
use super::report::Status;
use super::sentences;
use crate::flight::Channel;
use std::collections::BTreeMap;

/// One candidate on one step.
pub(super) struct Scored<'a> {
    pub candidate: &'a Candidate,
    /// The variant with the largest gain.
    pub best: Trial,
    pub gains: Vec<f64>,
    pub gain: f64,
    pub falls: BTreeMap<Channel, f64>,
    pub p_value: f64,
    pub detection: Option<f64>,
    pub excited: bool,
    pub plausible: bool,
    pub carrying: usize,
    /// An accepted effect whose flaw it describes.
    pub rival: Option<String>,
    /// Values of each open parameter that are as good as the best; empty before refinement.
    pub profiles: BTreeMap<String, [f64; 2]>,
}

impl Scored<'_> {
    pub(super) fn largest_fall(&self) -> f64 {
        self.falls.values().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether no channel is predicted worse by as much as would count as better.
    fn harms_nothing(&self) -> bool {
        self.falls.values().all(|fall| *fall > -SMALLEST_FALL)
    }

    pub(super) fn passes(&self, largest_p: f64) -> bool {
        self.harms_nothing()
            && self.rival.is_none()
            && self.excited
            && self.plausible
            && self.gain > 0.0
            && self.p_value <= largest_p
            && self.largest_fall() >= SMALLEST_FALL
    }

    pub(super) fn status(&self, largest_p: f64) -> Status {
        match () {
            () if !self.excited => Status::NotExcited,
            () if self.p_value > largest_p => Status::NotSignificant,
            () if !self.plausible || !self.harms_nothing() => Status::Implausible,
            () if self.rival.is_some() && self.largest_fall() >= SMALLEST_FALL => Status::SamePhysics,
            () => Status::Negligible,
        }
    }

    /// What decided that status, in words. `held` are coefficients held at the sign that physics gives them.
    pub(super) fn reason(&self, largest_p: f64, held: &[(String, String)]) -> String {
        match self.status(largest_p) {
            Status::NotExcited => sentences::not_carried(self.carrying),
            Status::NotSignificant => sentences::could_be_chance(self.p_value, largest_p),
            Status::Implausible if !self.plausible => {
                let own = held.iter().filter(|(kind, _)| *kind == self.candidate.effect.kind).map(|(_, name)| name.clone());
                sentences::forbidden(&own.collect::<Vec<_>>())
            }
            Status::Implausible => {
                let worst = self.falls.iter().min_by(|left, right| left.1.total_cmp(right.1));
                worst.map_or_else(String::new, |(&channel, &fall)| sentences::makes_worse(channel.name(), fall))
            }
            Status::SamePhysics => sentences::mends(self.rival.as_deref().unwrap_or("?")),
            Status::Negligible if self.largest_fall() >= SMALLEST_FALL => sentences::few_blocks_gain(),
            Status::Accepted | Status::Negligible => {
                let best = self.falls.iter().max_by(|left, right| left.1.total_cmp(right.1));
                best.map_or_else(String::new, |(&channel, &fall)| sentences::too_little(channel.name(), fall))
            }
        }
    }
}
