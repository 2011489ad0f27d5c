//! What the streams of a log say of each other, gathered: of one flight, in short blocks, or of all together. Verdicts on single flights are the
//! business of `odd`.

use super::clocks::Halves;
use super::finding::{Finding, RELATIONS, Severity, finding};
use super::forces::Forces;
use super::gains::{AXES, FAR, Gains, ONE_SCALE};
use super::increments::Motion;
use super::mounts::{Mounts, Turns};
use super::relations::Relation;
use super::robust::median;
use super::timing::Timing;
use super::unexplained::Left;
use crate::flight::Column;
use std::collections::BTreeSet;

/// Of the relation between rates and angular targets.
const RATE_TARGETS: &str = "rate_targets";
/// Of the relation between velocity and linear targets, how a unit of the velocity is set, and how those of speeds end.
const VELOCITY_TARGETS: &str = "velocity_targets";
const UNIT_OF_VELOCITY: &str = "[units] velocity = \"";
const A_SECOND: &str = "/s\"";

/// Gains of all relations that are this far from 1 …
const OTHER_TIME: f64 = 0.2;
/// … and this near to each other say that the time runs otherwise.
const SAME: f64 = 0.1;

/// Of the relation between position and velocity, and between attitude and rates.
const POSITION_RATE: &str = "position_rate";
const ATTITUDE_RATE: &str = "attitude_rate";

/// Of the finding on a time that runs backward.
pub(super) const TIME_REVERSED: &str = "time_reversed";

/// Of the finding on gains that are all alike.
pub(super) const TIME_STEP: &str = "time_step";
/// What accelerations were made with.
pub(super) const TARGETS_STEP: &str = "targets_step";

/// A vector that is scaled.
pub(super) const SCALE: &str = "scale_";
/// What both the state of a vector and its own change say it is scaled by is no error of either relation from so far on: ten times what a sensor is calibrated
/// to.
const SCALED: f64 = 0.05;

/// A vector that stands in two relations.
struct InTwoRelations {
    name: &'static str,
    /// The relation in which it is the change of a state.
    of_state: &'static str,
    /// The relation in which it is the state that changes.
    of_change: &'static str,
    columns: [&'static str; 3],
}

const IN_TWO_RELATIONS: [InTwoRelations; 2] = [
    InTwoRelations { name: "velocity", of_state: POSITION_RATE, of_change: VELOCITY_TARGETS, columns: ["vx", "vy", "vz"] },
    InTwoRelations { name: "rates", of_state: ATTITUDE_RATE, of_change: RATE_TARGETS, columns: ["wx", "wy", "wz"] },
];

/// The accumulators of all checks that need no physics of the aircraft, and of the places of gravity.
pub(super) struct Evidence {
    pub relations: [Relation; 5],
    gains: Gains,
    pub mounts: Mounts,
    pub forces: Forces,
    pub timing: Timing,
    pub halves: Halves,
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
        let (forces, timing) = (Forces::new(quaternion), Timing::new(step_s));
        Self { relations, gains: Gains::new(), mounts: Mounts::new(), forces, timing, halves: Halves::new(step_s) }
    }

    /// Adds the one flight, in short blocks.
    pub fn add(&mut self, flight: usize, motion: &Motion) {
        self.relations.iter_mut().for_each(|relation| relation.add(flight, motion));
        self.gains.add(flight, motion);
        self.mounts.add(flight, motion);
        self.forces.add(flight, motion);
        self.timing.add(flight, motion);
        let duration_s = motion.step_s * motion.instants.len() as f64;
        self.halves = Halves::of(&self.timing, motion.step_s, duration_s);
    }

    /// How the sensors sit.
    pub fn turns(&self) -> Turns {
        self.mounts.turns()
    }

    /// Adds what another gathered, so many of its blocks as one.
    pub fn absorb(&mut self, one: &Self, together: usize) {
        self.relations.iter_mut().zip(&one.relations).for_each(|(relation, one)| relation.absorb(one, together));
        self.gains.absorb(&one.gains, together);
        self.mounts.absorb(&one.mounts, together);
        self.forces.absorb(&one.forces, together);
        self.timing.absorb(&one.timing, together);
        self.halves.absorb(&one.halves, together);
    }

    /// Whether rates and accelerations, angular and linear, all have the other sign against the changes: then it is the time that runs backward.
    /// `None` where not all of them are known.
    fn is_reversed(&self) -> Option<bool> {
        let known = self.relations.iter().filter(|relation| relation.has_blocks() && relation.name != POSITION_RATE);
        let reversed = known.map(|relation| {
            let other = relation.other_reading(self.gains.left(relation.name));
            other.is_some_and(|reading| relation.is_reversal(reading))
        });
        let reversed: Vec<bool> = reversed.collect();
        (reversed.len() == 3).then(|| reversed.iter().all(|reversed| *reversed))
    }

    /// The relations, and the gains of those that hold; an axis says nothing of which less is explained by its gain.
    pub fn kinematics(&self, least_explained: f64) -> Vec<Finding> {
        let mut findings = Vec::new();
        match self.is_reversed() {
            Some(true) => {
                let message = "rates and accelerations all have the other sign against the changes: the rows stand in the order of falling time";
                return vec![finding(TIME_REVERSED, Severity::Fault, message.into(), None)];
            }
            Some(false) => findings.push(finding(TIME_REVERSED, Severity::Ok, "the time runs forward".into(), None)),
            None => {}
        }
        for relation in &self.relations {
            let Some(finding) = relation.finding(self.gains.left(relation.name)) else { continue };
            // Gains of a relation that is known to be read wrongly, or in which nothing moves, say nothing more.
            let is_read = finding.verdict != Severity::Fault && finding.measured.is_some_and(f64::is_finite);
            findings.push(finding);
            if is_read {
                findings.extend(self.gains.findings(relation.name, least_explained));
            }
        }
        let mut findings = with_position(scaled(targets_step(time_step(without_consequences(findings)))));
        let is_sound = |relation: &str| {
            let is_faulty = |finding: &Finding| finding.verdict == Severity::Fault && finding.name.starts_with(relation);
            !findings.iter().any(|finding| is_faulty(finding) || finding.name == TIME_STEP && finding.verdict == Severity::Fault)
        };
        let is_made_of_rates = |finding: &Finding| finding.name == RATE_TARGETS && finding.verdict == Severity::Ok;
        let with_targets = findings.iter().any(is_made_of_rates);
        findings.extend(self.mounts.findings([is_sound("position_rate"), is_sound("attitude_rate")], with_targets));
        findings
    }

    /// What each relation leaves unexplained.
    pub fn unexplained(&self) -> Vec<Left> {
        self.gains.unexplained()
    }

    /// The other reading of a relation, by its place; none where single columns explain as much.
    pub fn other_reading(&self, place: usize) -> Option<usize> {
        self.relations[place].other_reading(self.gains.left(self.relations[place].name))
    }
}

/// Targets that are read as their states are known to be: one column of rates in degrees contradicts the attitude and its own derivative.
fn without_consequences(mut findings: Vec<Finding>) -> Vec<Finding> {
    let faults = || findings.iter().filter(|finding| finding.verdict == Severity::Fault);
    let of_states: BTreeSet<String> = faults().filter_map(|finding| finding.set.clone()).collect();
    for finding in &mut findings {
        let of_state = finding.set.as_ref().map(|set| set.replace("_dot", ""));
        if finding.verdict == Severity::Fault && finding.set != of_state && of_state.is_some_and(|set| of_states.contains(&set)) {
            finding.verdict = Severity::Undetermined;
            finding.message = "not judged: the state is read otherwise, as is said above".into();
            finding.set = None;
        }
    }
    findings
}

/// Gains of all relations that are the same other number are one of time, and say nothing more.
fn time_step(findings: Vec<Finding>) -> Vec<Finding> {
    let of_relation = |finding: &Finding| {
        RELATIONS.iter().find(|relation| finding.name.starts_with(**relation) && finding.name.len() > relation.len()).copied()
    };
    let is_known = |finding: &&Finding| finding.verdict != Severity::Undetermined;
    let gain = |finding: &Finding| of_relation(finding).zip(finding.measured);
    let gains: Vec<(&str, f64)> = findings.iter().filter(is_known).filter_map(gain).collect();
    let relations: BTreeSet<&str> = gains.iter().map(|gain| gain.0).collect();
    let median = median(gains.iter().map(|gain| gain.1).collect()).filter(|times| *times > 0.0);
    let Some(times) = median.filter(|_| relations.len() > 1) else { return findings };
    let is_one = (times - 1.0).abs() < OTHER_TIME;
    if is_one || gains.iter().any(|gain| (gain.1 / times - 1.0).abs() > SAME) {
        let verdict = if is_one { Severity::Ok } else { Severity::Undetermined };
        let message = if is_one { "what changes does so as fast as its rates say" } else { "the gains of single columns differ" };
        return findings.into_iter().chain([step(verdict, times, message.into(), None)]).collect();
    }
    let message = format!(
        "all that changes does so {times:.2} times as fast as its rates say: the time step is {times:.2} times as long as stamped"
    );
    let set = format!("[columns] t = \"t * {times:.3}\", with the file's name");
    let others = findings.into_iter().filter(|finding| !RELATIONS.iter().any(|relation| finding.name.starts_with(relation)));
    std::iter::once(step(Severity::Fault, times, message, Some(&set))).chain(others).collect()
}

/// Six accelerations that are all off by the same factor were made with another time step, and the rest was not.
fn targets_step(findings: Vec<Finding>) -> Vec<Finding> {
    let is_gain = |finding: &Finding| {
        let axis = |relation: &str| finding.name.strip_prefix(relation).is_some_and(|axis| !axis.is_empty());
        axis(VELOCITY_TARGETS) || axis(RATE_TARGETS)
    };
    let off = findings.iter().filter(|finding| is_gain(finding) && finding.verdict == Severity::Fault);
    let gains: Vec<f64> = off.filter_map(|finding| finding.measured).collect();
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    if gains.len() < Column::TARGETS.len() || gains.iter().any(|gain| (gain / mean - 1.0).abs() > ONE_SCALE) {
        return findings;
    }
    let message = format!(
        "what changes does so {mean:.2} times as fast as all six accelerations say: they were made with a time step {mean:.2} times as long as it is"
    );
    let lines = Column::TARGETS.map(|column| format!("{0} = \"{mean:.4} * {0}\"", column.name())).join(", ");
    let set = format!("[columns] {lines}, with the file's names");
    let others = findings.into_iter().filter(|finding| !is_gain(finding));
    let found = Finding { name: TARGETS_STEP.into(), ..step(Severity::Fault, mean, message, Some(&set)) };
    std::iter::once(found).chain(others).collect()
}

/// A vector whose three columns are all the same factor too large for what they are the change of, and for what is their change: a scale of its own, as that
/// of counts that were read with the sensitivity of another sensor. Where a unit or another reading is named already, nothing is added.
fn scaled(findings: Vec<Finding>) -> Vec<Finding> {
    let of = |InTwoRelations { name: vector, of_state, of_change, columns }: InTwoRelations| {
        let gains = |relation: &str| AXES.map(|axis| findings.iter().find(|finding| finding.name == format!("{relation}_{axis}")));
        let own = [gains(of_state), gains(of_change)];
        let off: Vec<f64> = own.iter().flatten().filter_map(|finding| scale(finding.as_ref()?)).collect();
        let factors: Vec<f64> = off.iter().enumerate().map(|(place, gain)| if place < 3 { *gain } else { 1.0 / gain }).collect();
        let mean = factors.iter().sum::<f64>() / factors.len() as f64;
        let is_one = factors.len() == 6 && factors.iter().all(|factor| (factor / mean - 1.0).abs() < ONE_SCALE);
        is_one.then(|| {
            let message = format!(
                "{vector} ({}) are {:.3} times what both the change of their state and their own change say: a scale, as of a sensor of another sensitivity",
                columns.join(", "),
                1.0 / mean
            );
            let lines = columns.map(|column| format!("{column} = \"{mean:.4} * {column}\"")).join(", ");
            let set = format!("[columns] {lines}, with the file's names");
            Finding { name: format!("{SCALE}{vector}"), ..step(Severity::Fault, mean, message, Some(&set)) }
        })
    };
    let found: Vec<Finding> = IN_TWO_RELATIONS.into_iter().filter_map(of).collect();
    found.into_iter().chain(findings.iter().cloned()).collect()
}

/// Gains that a scale explains say nothing more. Those of single flights stay: they are held against those of others.
pub(super) fn without_scaled(findings: Vec<Finding>) -> Vec<Finding> {
    let is_scaled = |vector: &str| findings.iter().any(|finding| finding.name == format!("{SCALE}{vector}"));
    let relations: Vec<&str> = IN_TWO_RELATIONS
        .into_iter()
        .filter(|vector| is_scaled(vector.name))
        .flat_map(|vector| [vector.of_state, vector.of_change])
        .collect();
    let is_gain = |name: &str| relations.iter().any(|relation| name.strip_prefix(relation).is_some_and(|axis| !axis.is_empty()));
    findings.into_iter().filter(|finding| !is_gain(&finding.name)).collect()
}

/// A gain that is certainly off 1 by more than a sensor's, and of which no unit is named.
fn scale(gain: &Finding) -> Option<f64> {
    let (value, [low, high]) = gain.measured.zip(gain.interval)?;
    let is_unit = gain.verdict == Severity::Fault && !gain.message.contains(FAR);
    (!is_unit && value > 0.0 && (low > 1.0 + SCALED || high < 1.0 - SCALED)).then_some(value)
}

fn step(verdict: Severity, times: f64, message: String, set: Option<&str>) -> Finding {
    Finding { measured: Some(times), expected: Some(1.0), unit: "1".into(), ..finding(TIME_STEP, verdict, message, set) }
}

/// A velocity in another unit with which a position goes along is of a position in that unit of length.
fn with_position(mut findings: Vec<Finding>) -> Vec<Finding> {
    let mut of_position = findings.iter().filter(|finding| finding.name.starts_with(POSITION_RATE)).peekable();
    let is_sound = of_position.peek().is_some() && of_position.all(|finding| finding.verdict == Severity::Ok);
    for finding in findings.iter_mut().filter(|finding| is_sound && finding.name.starts_with(VELOCITY_TARGETS)) {
        let unit = finding.set.as_deref().and_then(|set| set.strip_prefix(UNIT_OF_VELOCITY)?.strip_suffix(A_SECOND));
        if let Some(unit) = unit.map(str::to_owned) {
            finding.message.push_str(&format!("; the position, which changes as this velocity says, is in {unit} then"));
            finding.set = Some(format!("{UNIT_OF_VELOCITY}{unit}{A_SECOND}, position = \"{unit}\""));
        }
    }
    findings
}
