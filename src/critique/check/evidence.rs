//! What the streams of a log say of each other, gathered: of one flight, in short blocks, or of all together. Verdicts on single flights are the
//! business of `odd`.

use super::forces::Forces;
use super::gains::Gains;
use super::increments::Motion;
use super::relations::Relation;
use super::report::{Finding, Verdict};
use super::timing::Timing;

/// The accumulators of all checks that need no physics of the aircraft, and of the places of gravity.
pub(super) struct Evidence {
    pub relations: [Relation; 5],
    gains: Gains,
    pub forces: Forces,
    pub timing: Timing,
}

impl Evidence {
    /// Of nothing yet; `quaternion` is how to say the other order, where the attitude is one.
    pub fn new(quaternion: Option<&'static str>, step_s: f64) -> Self {
        let relations = [
            Relation::position(quaternion),
            Relation::attitude(true, quaternion),
            Relation::attitude(false, quaternion),
            Relation::linear_targets(),
            Relation::angular_targets(),
        ];
        Self { relations, gains: Gains::new(), forces: Forces::new(quaternion), timing: Timing::new(step_s) }
    }

    /// Adds a flight in short blocks.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        self.relations.iter_mut().for_each(|relation| relation.add(flight, motion));
        self.gains.add(flight, motion);
        self.forces.add(flight, motion);
        self.timing.add(flight, motion);
    }

    /// Adds what another gathered, so many of its blocks as one.
    pub fn absorb(&mut self, one: &Self, together: usize) {
        self.relations.iter_mut().zip(&one.relations).for_each(|(relation, one)| relation.absorb(one, together));
        self.gains.absorb(&one.gains, together);
        self.forces.absorb(&one.forces, together);
        self.timing.absorb(&one.timing, together);
    }

    /// The relations, and the gains of those that hold; an axis says nothing of which less is explained by its gain.
    pub fn kinematics(&self, least_explained: f64) -> Vec<Finding> {
        let mut findings = Vec::new();
        for relation in &self.relations {
            let Some(finding) = relation.finding() else { continue };
            // Gains of a relation that is known to be read wrongly, or in which nothing moves, say nothing more.
            let is_read = finding.verdict != Verdict::Fault && finding.measured.is_some_and(f64::is_finite);
            findings.push(finding);
            if is_read {
                findings.extend(self.gains.findings(relation.name, least_explained));
            }
        }
        findings
    }
}
