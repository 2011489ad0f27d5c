//! Flights that are read otherwise than the others: one in feet, one whose attitude comes late, one with a sign reversed. Each flight has been judged
//! by itself; what most of them keep and some break is a fault of those, and they are left out of what all together are judged by.

use super::causes::{self, Cause};
use super::clocks::{self, CLOCK};
use super::evidence::{Evidence, SCALE};
use super::finding::{Finding, RELATIONS, Severity, Subject, finding};
use super::flights::{FEWEST, MOST, WIDER, in_flights};
use super::increments::{Motion, SHORT_BLOCK_S, TOGETHER};
use super::mounts::{self, Turns};
use super::robust::{NORMAL, median};
use super::timing::{Acts, Timing};
use super::unexplained::{self, Left};
use crate::flight::Flight;
use std::collections::{BTreeMap, BTreeSet};

/// A gain that certainly differs from 1 by this much is that of another reading.
const OFF: f64 = 0.2;
/// Streams this much apart change verdicts: lags of rotor and servo are as long. s
pub(super) const LATE_S: f64 = 0.03;
/// Controls of a flight are late or early against those of the others from here on, s; estimates of a single flight scatter.
const LATER_S: f64 = 0.05;
/// Delays of flights that differ by so many times what they scatter are not those of what is flown.
const APART: f64 = 3.0;
/// A gain of a flight differs from that of the others from here on.
const SCALED: f64 = 0.04;
/// A gain of a single flight's axis is one where with it so much of the change is explained.
const EXPLAINED: f64 = 0.5;
/// Fall of the logarithm of the squared error that a shift of a stream has to bring in a single flight.
const CONVINCING_FALL: f64 = 1.0;
/// Coefficients of gravity agree with a unit of length to this factor.
const NEAR_UNIT: f64 = 1.25;

/// Units of length in metres, where accelerations are in the same.
const LENGTHS: [(f64, &str, &str); 3] = [(0.3048, "feet", "ft"), (0.01, "centimetres", "cm"), (0.001, "millimetres", "mm")];

/// What one flight says by itself.
pub(super) struct Own {
    pub flight: usize,
    pub evidence: Evidence,
    findings: Vec<Finding>,
    /// What each relation leaves unexplained here.
    pub left: Vec<Left>,
    /// When u1, u2 and u3 act.
    pub acts: [Option<Acts>; 3],
    /// How its sensors sit.
    turns: Turns,
    /// What would mend its relations, where they leave much.
    pub causes: Option<Vec<Cause>>,
}

impl Own {
    pub fn new(flight: usize, motion: &Motion, quaternion: Option<&'static str>, step_s: f64) -> Self {
        let mut short = Evidence::new(quaternion, step_s);
        short.add(flight, motion);
        let mut findings = in_part(short.kinematics(EXPLAINED), &short);
        findings.extend(short.timing.offsets(CONVINCING_FALL));
        findings.push(short.timing.control_delay(None).0);
        findings.extend(short.timing.sticks());
        findings.extend(short.halves.findings(&|_| false));
        findings.extend(short.forces.lateral());
        findings.extend(lengths(&short.forces.coefficients()));
        let mut evidence = Evidence::new(quaternion, step_s);
        // A block of usual length is longer than most manoeuvres.
        evidence.absorb(&short, TOGETHER);
        let left = short.unexplained();
        let causes = unexplained::is_worth_asking(&left).then(|| causes::of(motion));
        Self { flight, evidence, findings, left, acts: short.timing.acts(), turns: short.turns(), causes }
    }
}

/// The findings of a flight of which only a part is read otherwise say so; gains of the whole say nothing then.
fn in_part(mut findings: Vec<Finding>, short: &Evidence) -> Vec<Finding> {
    for relation in &short.relations {
        // That a vector points elsewhere is no reading yet.
        let is_read = |finding: &Finding| finding.verdict == Severity::Fault && finding.set.is_some();
        let is_open = findings.iter().any(|finding| finding.name == relation.name && !is_read(finding));
        let Some((says, is_later, block)) = is_open.then(|| relation.reading_of_part()).flatten() else { continue };
        let place = format!("{:.0} s{}", SHORT_BLOCK_S * block as f64, if is_later { " on" } else { "" });
        let message = format!("{} {place} {says}, and not in the rest of the flight", if is_later { "from" } else { "up to" });
        findings.retain(|finding| finding.name == relation.name || !finding.name.starts_with(relation.name));
        let own = findings.iter_mut().filter(|finding| finding.name == relation.name);
        own.for_each(|finding| (finding.verdict, finding.message) = (Severity::Fault, message.clone()));
    }
    findings
}

/// Shifts between streams of all flights: where one is as long as the lags of an aircraft, these cannot be told from it, and it is a fault. Of the two
/// streams of each pair that one is late that explains most: the attitude where the rates are in step with their accelerations.
pub(super) fn late_streams(timing: &Timing) -> Vec<Finding> {
    let certain = timing.offsets(CONVINCING_FALL);
    let is_late = |name: &str| certain.iter().find(|finding| finding.name == name).filter(|finding| contradicts(finding));
    let late_s = |name: &str| is_late(name).and_then(|finding| finding.measured).unwrap_or(0.0);
    let [rates, angular, linear, velocity] =
        ["rates_offset", "angular_targets_offset", "targets_offset", "velocity_offset"].map(late_s);
    let opposite = |one: f64, other: f64| one * other < 0.0 && (one + other).abs() < LATE_S;
    let cause = |name: &str| match name {
        "rates_offset" if opposite(rates, angular) => Some(("rates", rates)),
        "rates_offset" => Some(("angles", -rates)),
        "angular_targets_offset" if opposite(rates, angular) => None,
        "angular_targets_offset" => Some(("angular_acceleration", angular)),
        "targets_offset" if opposite(velocity, linear) => None,
        "targets_offset" => Some(("acceleration", linear)),
        // Of a turned velocity the attitude is a part.
        _ if rates != 0.0 => None,
        _ if opposite(velocity, linear) => Some(("velocity", velocity)),
        _ => Some(("position", -velocity)),
    };
    let told = |finding: Finding| {
        if is_late(&finding.name).is_none() {
            return finding;
        }
        match cause(&finding.name) {
            Some((stream, late_s)) => {
                let how = if late_s > 0.0 { "late" } else { "early" };
                let message = format!(
                    "{}: {stream} {how} by {:.0} ms; a lag or delay that a search named could be this",
                    finding.message,
                    1e3 * late_s.abs()
                );
                Finding { verdict: Severity::Fault, message, set: Some(format!("[late] {stream} = {late_s:.3}")), ..finding }
            }
            None => finding,
        }
    };
    timing.offsets(0.0).into_iter().map(told).collect()
}

/// Controls of all flights that are recorded after they act, where the axes are explained by them: a loop that is closed fast does not explain them.
/// `is_moved` says that the description moves them as one already: what two of them are still late by is late in all.
pub(super) fn late_controls(timing: &Timing, is_moved: bool) -> Vec<Finding> {
    let sticks = timing.sticks();
    let late: Vec<&Finding> =
        sticks.iter().filter(|finding| finding.measured.is_some_and(|at_s| at_s < 0.0) && contradicts(finding)).collect();
    let by = late.iter().filter_map(|finding| finding.measured);
    let [least, most] = [by.clone().fold(0.0, f64::min), by.fold(f64::NEG_INFINITY, f64::max)];
    let is_rest = is_moved && most - least <= SAME_S;
    if late.len() < 2 || late.len() < sticks.len() && !is_rest {
        return late.into_iter().map(late_alone).collect();
    }
    let mean_s = -late.iter().filter_map(|finding| finding.measured).sum::<f64>() / late.len() as f64;
    let message = format!("the controls come late: they are recorded {:.0} ms after they act", 1e3 * mean_s);
    vec![finding("controls_late", Severity::Fault, message, Some(&format!("[late] controls = {mean_s:.3}")))]
}

/// Delays of sticks that are one delay differ at most by this, s.
const SAME_S: f64 = 0.01;

/// A stick that is late where others are in step. Physics that the model lacks can lead it as well: an induced flow that overshoots gives its thrust
/// before the stick has moved all the way, and a pilot's hand answers what nothing explains yet. So a short delay is a warning.
fn late_alone(finding: &Finding) -> Finding {
    if finding.measured.is_some_and(|at_s| at_s <= -LATER_S) {
        return Finding { verdict: Severity::Fault, ..finding.clone() };
    }
    let message = format!(
        "{}; or something that is missing leads it, as an induced flow that overshoots does (`inflow_lag`)",
        finding.message
    );
    Finding { verdict: Severity::Warning, message, ..finding.clone() }
}

/// What breaks with the others, and in which flights.
pub(super) struct Odd {
    pub findings: Vec<Finding>,
    pub flights: BTreeSet<usize>,
}

impl Odd {
    /// `all` is what all flights say together. What they misread alike comes first: before that is mended single flights are not judged.
    pub fn new(each: &[&Own], all: &Evidence, flights: &[Flight]) -> Self {
        let mut odd = Self { findings: Vec::new(), flights: BTreeSet::new() };
        if is_misread(each, all) {
            return odd;
        }
        let mut by_name: BTreeMap<&str, Vec<(usize, &Finding)>> = BTreeMap::new();
        for own in each {
            for finding in own.findings.iter().filter(|finding| finding.verdict != Severity::Undetermined) {
                by_name.entry(&finding.name).or_default().push((own.flight, finding));
            }
        }
        for relation in RELATIONS {
            let such = scaled(relation, &by_name);
            odd.extend(relation, such, flights);
        }
        let usual = mounts::usual(each.iter().map(|own| &own.turns));
        let is_turned = |own: &&&Own| mounts::is_beyond(&own.turns, &usual);
        let turned: BTreeSet<usize> = each.iter().filter(is_turned).map(|own| own.flight).collect();
        // By name, so that clocks come before delays of the controls and of single sticks.
        let mut drifts = false;
        // What a flight says by itself of a scale, it says of each axis.
        for (name, mut of_flights) in by_name.into_iter().filter(|(name, _)| !name.starts_with(SCALE)) {
            // A mount that all share is no fault of one.
            of_flights
                .retain(|(flight, finding)| name != mounts::NAME || finding.verdict != Severity::Fault || turned.contains(flight));
            // A flight all of whose controls are late says nothing more of each.
            of_flights.retain(|(flight, _)| !name.starts_with(STICK) || !odd.flights.contains(flight));
            let are_some = |flights: usize| flights >= FEWEST && 10 * flights >= of_flights.len();
            let such = match name {
                // What is flown in it can change a delay along one flight; a clock is that of a logger.
                name if name.starts_with(CLOCK) => {
                    let mut such = broken(&of_flights);
                    such.retain(|(indices, _)| are_some(indices.len()));
                    such.iter_mut().for_each(|(indices, _)| {
                        indices.extend(alike(indices, &of_flights));
                        indices.sort_unstable();
                    });
                    drifts |= name.ends_with(clocks::CONTROLS) && !such.is_empty();
                    odd.extend(name, such, flights);
                    continue;
                }
                // Beside controls that come ever later, or earlier, those of all other flights look late.
                name if drifts && (name == CONTROLS || name.starts_with(STICK)) => continue,
                CONTROLS => shifted(&of_flights, "the controls"),
                // One stick alone may well be slower than the rest in a flight; it cannot act before it is given.
                name if name.starts_with(STICK) => {
                    let mut late = shifted(&of_flights, &name[STICK.len()..]);
                    late.retain(|shift| shift.is_late && are_some(shift.flights.len()));
                    late
                }
                _ => {
                    odd.extend(name, broken(&of_flights), flights);
                    continue;
                }
            };
            let (apart, vague): (Vec<Shift>, Vec<Shift>) = such.into_iter().partition(|shift| shift.is_apart);
            odd.extend(name, apart.into_iter().map(|shift| (shift.flights, shift.message)).collect(), flights);
            odd.findings.extend(vague.into_iter().map(|shift| {
                let message = format!("{}, or the sticks move so otherwise there that they look so", shift.message);
                Finding { verdict: Severity::Warning, ..in_flights(name, &shift.flights, &message, flights) }
            }));
        }
        odd
    }

    fn extend(&mut self, name: &str, such: Vec<(Vec<usize>, String)>, flights: &[Flight]) {
        self.flights.extend(such.iter().flat_map(|(indices, _)| indices));
        self.findings.extend(such.into_iter().map(|(indices, message)| in_flights(name, &indices, &message, flights)));
    }
}

/// Whether nearly all flights read a relation, or the place of gravity, in the same other way: that is a fault of the set.
pub(super) fn is_misread(each: &[&Own], all: &Evidence) -> bool {
    let most = |count: usize| count as f64 > MOST * each.len() as f64;
    let is_common = |place: usize| {
        let agree = |reading| each.iter().filter(|own| own.evidence.relations[place].prefers(reading)).count();
        all.other_reading(place).is_some_and(|reading| most(agree(reading)))
    };
    let columns = all.kinematics(0.0);
    let faults = columns.iter().filter(|finding| finding.verdict == Severity::Fault && finding.measured.is_some());
    let is_of_column = |finding: &Finding| {
        let own = each.iter().filter_map(|own| own.findings.iter().find(|other| other.name == finding.name));
        let told: Vec<&Finding> = own.filter(|own| own.verdict != Severity::Undetermined).collect();
        told.len() > 1 && told.iter().filter(|own| own.verdict == Severity::Fault).count() as f64 > MOST * told.len() as f64
    };
    let turned = |finding: &Finding| finding.name == LATERAL && finding.verdict == Severity::Fault;
    let is_turned = all.forces.lateral().is_some_and(|finding| turned(&finding));
    (0..all.relations.len()).any(is_common)
        || faults.into_iter().any(is_of_column)
        || is_turned && most(each.iter().filter(|own| own.findings.iter().any(turned)).count())
}

const CONTROLS: &str = "control_delay";
/// How findings of single sticks begin.
const STICK: &str = "delay_";
pub(super) const LATERAL: &str = "lateral_force";

/// Flights by what is wrong in them, where others keep the relation.
fn broken(of_flights: &[(usize, &Finding)]) -> Vec<(Vec<usize>, String)> {
    let (faulty, sound): (Vec<_>, Vec<_>) = of_flights.iter().partition(|(_, finding)| contradicts(finding));
    let sound = sound.iter().filter(|(_, finding)| finding.verdict != Severity::Fault).count();
    if faulty.len() as f64 > MOST * (faulty.len() + sound) as f64 {
        return Vec::new();
    }
    let mut kinds: BTreeMap<String, Vec<(usize, &Finding)>> = BTreeMap::new();
    for (flight, finding) in faulty {
        let kind = match finding.subject {
            Subject::Timing => finding.measured.map_or("", |late| if late > 0.0 { "late" } else { "early" }),
            Subject::Conventions | Subject::Excitation => finding.set.as_deref().unwrap_or(&finding.message),
        };
        // Numbers differ from flight to flight.
        let kind: String = kind.chars().filter(|c| !c.is_ascii_digit()).collect();
        kinds.entry(kind).or_default().push((flight, finding));
    }
    let told = |alike: Vec<(usize, &Finding)>| (alike.iter().map(|entry| entry.0).collect(), alike[0].1.message.clone());
    kinds.into_values().map(told).collect()
}

/// Flights that are less sure of the same: what was measured there is nearer to what it is in these than to nothing.
fn alike(of: &[usize], of_flights: &[(usize, &Finding)]) -> Vec<usize> {
    let known: Vec<(usize, f64)> = of_flights.iter().filter_map(|(flight, finding)| Some((*flight, finding.measured?))).collect();
    let usual = median(known.iter().filter(|(flight, _)| of.contains(flight)).map(|entry| entry.1).collect());
    let is_nearer = |value: f64| usual.is_some_and(|usual| value / usual > 0.5);
    known.into_iter().filter(|(flight, value)| !of.contains(flight) && is_nearer(*value)).map(|entry| entry.0).collect()
}

/// Flights in which the gains of a relation's axes are others than in the most, though near 1, and alike: a wrong scale is one of all three axes, where a
/// bias is another in each.
fn scaled(relation: &str, by_name: &BTreeMap<&str, Vec<(usize, &Finding)>>) -> Vec<(Vec<usize>, String)> {
    let mut of_flight: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    let mut count = 0;
    let is_gain = |name: &str| name.strip_prefix(relation).is_some_and(|axis| axis.starts_with('_'));
    for (_, axis) in by_name.iter().filter(|(name, _)| is_gain(name)) {
        count = count.max(axis.len());
        for (flight, ratio) in ratios(axis) {
            of_flight.entry(flight).or_default().push(ratio);
        }
    }
    let is_alike = |ratios: &Vec<f64>| ratios.len() > 1 && ratios.iter().all(|ratio| (ratio - ratios[0]).abs() < 0.5 * SCALED);
    let such: Vec<(usize, f64)> =
        of_flight.into_iter().filter(|entry| is_alike(&entry.1)).map(|(flight, ratios)| (flight, ratios[0])).collect();
    if such.is_empty() || such.len() as f64 > MOST * count as f64 {
        return Vec::new();
    }
    let mean = such.iter().map(|entry| entry.1).sum::<f64>() / such.len() as f64;
    let streams = match relation {
        "position_rate" => "velocity or position",
        "velocity_targets" => "acceleration or velocity",
        "rate_targets" => "angular acceleration or rates",
        _ => "rates or angles",
    };
    let message = format!("the gains of the axes are {mean:.2} times those of the others: {streams} are scaled there");
    vec![(such.into_iter().map(|entry| entry.0).collect(), message)]
}

/// Flights of which the gain of an axis certainly differs from that of the most, and how many times that it is.
fn ratios(of_flights: &[(usize, &Finding)]) -> Vec<(usize, f64)> {
    let known: Vec<(usize, f64, [f64; 2])> = of_flights
        .iter()
        .filter(|(_, finding)| !contradicts(finding))
        .filter_map(|(flight, finding)| Some((*flight, finding.measured?, finding.interval?)))
        .collect();
    let mut gains: Vec<f64> = known.iter().map(|entry| entry.1).collect();
    gains.sort_unstable_by(f64::total_cmp);
    // Mechanics asks for 1: of two halves that one is right that is nearer to it.
    let quartiles = [gains.len() / 4, gains.len() / 2, 3 * gains.len() / 4].map(|place| gains.get(place).copied());
    let usual = quartiles.into_iter().flatten().min_by(|one, other| (one - 1.0).abs().total_cmp(&(other - 1.0).abs()));
    let Some(usual) = usual else { return Vec::new() };
    let is_such = |(_, value, [low, high]): &&(usize, f64, [f64; 2])| {
        let (low, high) = (value - WIDER * (value - low), value + WIDER * (high - value));
        (value - usual).abs() > SCALED && (low > usual + 0.5 * SCALED || high < usual - 0.5 * SCALED)
    };
    known.iter().filter(is_such).map(|entry| (entry.0, entry.1 / usual)).collect()
}

/// Whether a flight by itself contradicts what is expected beyond doubt.
fn contradicts(finding: &Finding) -> bool {
    let Some((value, [low, high])) = finding.measured.zip(finding.interval) else { return finding.verdict == Severity::Fault };
    let (low, high) = (value - WIDER * (value - low), value + WIDER * (high - value));
    match finding.subject {
        Subject::Timing => finding.verdict >= Severity::Warning && value.abs() >= LATE_S && (low > 0.0 || high < 0.0),
        Subject::Conventions | Subject::Excitation if finding.expected == Some(0.0) => {
            finding.verdict == Severity::Fault && (low > 0.0 || high < 0.0)
        }
        Subject::Conventions | Subject::Excitation => finding.verdict == Severity::Fault && (low > 1.0 + OFF || high < 1.0 - OFF),
    }
}

/// Flights of which a stick, or all, come late or early against the others.
struct Shift {
    flights: Vec<usize>,
    message: String,
    is_late: bool,
    /// Farther from the others than flights scatter by what is flown in them.
    is_apart: bool,
}

/// A flight, its delay and the interval of that, s.
type Delay = (usize, f64, [f64; 2]);

/// Flights whose controls are recorded later or earlier than those of the others. When they act nobody knows beforehand, but not before they are
/// given.
fn shifted(of_flights: &[(usize, &Finding)], what: &str) -> Vec<Shift> {
    let known: Vec<Delay> =
        of_flights.iter().filter_map(|(flight, finding)| Some((*flight, finding.measured?, finding.interval?))).collect();
    let middle = |causal: bool| {
        let such = known.iter().map(|entry| entry.1).filter(|delay_s| !causal || *delay_s > -0.5 * LATE_S);
        median(such.collect())
    };
    let Some(usual) = middle(true).or_else(|| middle(false)) else { return Vec::new() };
    let of = |is_late: bool| -> Option<Shift> {
        let sign = if is_late { -1.0 } else { 1.0 };
        let is_such = |(_, value, [low, high]): &&Delay| {
            let near = if is_late { value + WIDER * (high - value) } else { value - WIDER * (value - low) };
            sign * (value - usual) > LATER_S && sign * (near - usual) > 0.5 * LATER_S
        };
        let (such, rest): (Vec<&Delay>, Vec<_>) = known.iter().partition(is_such);
        if such.is_empty() || such.len() as f64 > MOST * known.len() as f64 {
            return None;
        }
        let by = median(such.iter().map(|entry| sign * (entry.1 - usual)).collect())?;
        let scatter = NORMAL * median(rest.iter().map(|entry| (entry.1 - usual).abs()).collect())?;
        let message = format!(
            "{what} come{} {} by about {:.0} ms against the others",
            if what.contains(' ') { "" } else { "s" },
            if is_late { "late" } else { "early" },
            1e3 * by
        );
        Some(Shift { flights: such.into_iter().map(|entry| entry.0).collect(), message, is_late, is_apart: by > APART * scatter })
    };
    [true, false].into_iter().filter_map(of).collect()
}

/// Whether gravity says that all lengths of the flight are in another unit: then every stream agrees with every other, and only it has another size.
pub(super) fn lengths(coefficients: &[Finding]) -> Option<Finding> {
    let of = |name: &str| {
        let finding = coefficients.iter().find(|finding| finding.name == name)?;
        finding.measured.zip(finding.interval)
    };
    let both = [of("gravity_x")?, of("gravity_y")?];
    let is_near = |unit: f64| {
        both.iter().all(|(value, [low, high])| {
            let (low, high) = (value - WIDER * (value - low), value + WIDER * (high - value));
            (value * unit).ln().abs() < NEAR_UNIT.ln() && (low > 1.0 + OFF || high < 1.0 - OFF)
        })
    };
    let value = 0.5 * (both[0].0 + both[1].0);
    let found = LENGTHS.into_iter().find(|(unit, ..)| is_near(*unit));
    let mut finding = finding("lengths", Severity::Ok, "gravity has the size that it has in metres".into(), None);
    finding.measured = Some(value);
    finding.expected = Some(1.0);
    if let Some((_, name, unit)) = found {
        finding.verdict = Severity::Fault;
        finding.message = format!("gravity has the size that it has where all lengths are in {name}");
        finding.set = Some(format!("[units] position = \"{unit}\", velocity = \"{unit}/s\", acceleration = \"{unit}/s^2\""));
    }
    Some(finding)
}
