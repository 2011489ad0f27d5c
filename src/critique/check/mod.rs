//! Before any physics: is the log what the program takes it for? Conventions, timing, excitation.
//!
//! A wrong sign or frame looks like a missing effect, and a large one; so this comes first and blocks what follows. Kinematic
//! relations need no aerodynamics (`relations`, `gains`); the places of gravity and of the Coriolis term in the accelerations need
//! little (`forces`); which stick moves which axis is asked of each flight (`sticks`). Each flight is judged by itself and against the others
//! (`odd`); columns that are frozen, held, rounded or noisy are seen by themselves (`streams`), and so are ends of ranges (`saturation`) and two sources by turns
//! (`alternation`); dropped samples (`dropouts`) and cells that cannot be (`cells`) are counted. What would mend what no reading does is looked for in single
//! columns (`causes`), in several together (`jointly`) and in what vectors have of each other (`contents`).
//! Nothing here changes the data: a finding says what to set in `dataset.toml`.

mod advice;
mod alternation;
mod blame;
mod causes;
mod cells;
mod channels;
mod clocks;
mod contents;
mod copies;
mod dead_zone;
mod demands;
mod dropouts;
mod evidence;
mod excitation;
mod finding;
mod flights;
mod forces;
mod gains;
mod groups;
mod increments;
mod jointly;
mod limits;
mod lines;
mod lost;
#[cfg(feature = "files")]
mod mending;
mod mixes;
mod mounts;
mod odd;
mod on_change;
mod packets;
mod regression;
mod relations;
mod repairs;
mod report;
mod robust;
mod saturation;
mod sequences;
mod slew;
mod stamps;
mod sticks;
mod stray;
mod streams;
mod stretches;
#[cfg(feature = "files")]
mod suggestion;
mod throws;
mod timing;
mod told;
mod trims;
mod unexplained;
mod vibration;

pub use excitation::{Collinearity, Excitation};
pub use finding::{Finding, Severity, Subject};
#[cfg(feature = "files")]
pub use mending::{Mending, mend};
pub use report::CheckReport;
#[cfg(feature = "files")]
pub use suggestion::{Open, Suggestion};
pub use timing::DelayProfile;

use crate::flight::attitude::QuaternionOrder;
use crate::flight::{Column, DataSet, Flight, Source, Targets};
use crate::physics::{Model, Vehicle};
use blame::Blamed;
use evidence::Evidence;
use finding::{RELATIONS, finding};
use flights::{CONTROLS, of_all};
use odd::{Odd, Own};
use std::collections::BTreeSet;
use sticks::Sticks;

/// Largest magnitude of a control that is still "about [−1, 1]".
const LARGEST_CONTROL: f64 = 1.5;
/// Pitch up to here, rad, is a quarter turn that is off.
const LARGEST_OFF: f64 = 2.5;
/// Share of the samples that may exceed it: glitches and full deflections are no other scale.
const RARE_SHARE: f64 = 0.01;

/// Checks conventions, timing and excitation of a data set. Of `model`, if there is one, only the control delay and the kind of vehicle are used.
///
/// Conventions: ṗ = R v; Ṙᵀ = Rᵀ × ω; recorded targets against the derivatives of v and ω; the force along x and y, which a
/// rotor keeps small; and free coefficients of gravity and −ω × v, expected to be 1 (paper eq. 14). Intervals are 95 %, from blocks of
/// 10 s. A fault is named only where another convention explains the log better by a wide margin; a modelling error alone
/// does not make one.
///
/// # Examples
/// ```
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// # #[cfg(feature = "sim")]
/// # fn main() -> phyture::Result<()> {
/// use phyture::critique::check::check;
/// use phyture::sim::{Simulation, simulate};
///
/// let report = check(&simulate(&Simulation { minutes: 4.0, ..Simulation::baseline() })?, None);
/// println!("{report}");
/// assert!(!report.fault, "{}", report.summary);
/// # Ok(())
/// # }
/// ```
pub fn check(data: &DataSet, model: Option<&Model>) -> CheckReport {
    let gathered = Gathered::new(data);
    let (mut delay, control_delay) = gathered.together.timing.control_delay(model.map(|model| model.data.control_delay_s));
    let mut findings = gathered.findings(data);
    if data.source.stated.contains_key("drift.controls") {
        clocks::began(&mut delay);
    }
    findings.push(delay);
    let Columns { excitation, collinearity, .. } = gathered.columns;
    findings.extend(excitation::findings(&excitation, &collinearity));
    findings.iter_mut().for_each(|finding| advice::heed(finding, &data.source));
    // A battery that is put in anew trims a multirotor, which its models can carry (`trim_shift`).
    if model.is_some_and(|model| model.vehicle == Vehicle::Multirotor) {
        let of_trim = findings.iter_mut().filter(|finding| finding.name.starts_with(trims::TRIMMED_STICK));
        of_trim.for_each(|finding| finding.verdict = Severity::Warning);
    }

    CheckReport {
        fault: findings.iter().any(|finding| finding.verdict == Severity::Fault),
        summary: summary(&findings),
        flights: data.flights.len(),
        duration_s: data.duration_s(),
        targets: if data.flights.iter().any(|flight| flight.targets == Targets::Derived) {
            Targets::Derived
        } else {
            Targets::Recorded
        },
        findings,
        control_delay,
        excitation,
        collinearity,
        notes: data.notes.clone(),
    }
}

/// What columns show by themselves, in all flights.
struct Columns {
    /// What is wrong with them …
    poor: Vec<Finding>,
    /// … and the flights of which single cells are.
    spoilt: BTreeSet<usize>,
    dead_zones: Vec<Finding>,
    excitation: Vec<Excitation>,
    collinearity: Vec<Collinearity>,
}

impl Columns {
    fn of(flights: &[Flight]) -> Self {
        let of_cells = || {
            let single = cells::spikes(flights).into_iter().chain(packets::findings(flights));
            let (spikes, spoilt): (Vec<Finding>, Vec<Vec<usize>>) = single.unzip();
            let found = [
                saturation::findings(flights),
                alternation::findings(flights),
                dropouts::findings(flights),
                copies::findings(flights),
                vibration::findings(flights),
            ];
            (spikes.into_iter().chain(found.into_iter().flatten()), spoilt.into_iter().flatten().collect())
        };
        let of_streams = || both(|| streams::findings(flights), of_cells);
        let moved = || (excitation::movements(flights), excitation::collinearity(flights));
        let ((streams, (cells, spoilt)), (dead_zones, (excitation, collinearity))) =
            both(of_streams, || both(|| dead_zone::findings(flights), moved));
        Self { poor: streams.into_iter().chain(cells).collect(), spoilt, dead_zones, excitation, collinearity }
    }

    /// Straight lines that the description itself draws between rows that were held are as a person wants them.
    fn with_stated(mut self, source: &Source) -> Self {
        for finding in &mut self.poor {
            let Some(column) = finding.name.strip_prefix(lines::INTERPOLATED) else { continue };
            let own = source.stated.get(&format!("columns.{column}")).map_or(column, String::as_str);
            if finding.verdict == Severity::Fault && source.stated.contains_key(&format!("held.{own}")) {
                finding.verdict = Severity::Warning;
                finding.message.push_str(", and the description draws these lines");
            }
        }
        self
    }
}

/// Two pieces of work, beside each other where there are threads.
fn both<A: Send, B: Send>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "rayon")]
    let done = rayon::join(one, other);
    #[cfg(not(feature = "rayon"))]
    let done = (one(), other());
    done
}

/// What the flights say by themselves, and those together of which nothing is known to be wrong.
struct Gathered {
    columns: Columns,
    /// Of flights that break with the others.
    odd: Vec<Finding>,
    /// All read something in the same other way.
    misread: bool,
    /// Flights that are left out of what is said of all …
    except: BTreeSet<usize>,
    /// … and those of which the sticks say nothing.
    unjudged: BTreeSet<usize>,
    together: Evidence,
    sticks: Sticks,
    /// Sticks whose values pile up at an end, by flight.
    piled: Vec<(usize, limits::Piled)>,
    /// The two sides of each stick, by flight.
    sides: Vec<(usize, throws::Uneven)>,
    /// Sticks that the rate follows, by flight.
    followed: Vec<(usize, demands::Followed)>,
    /// What relations and answers leave unexplained, by flight.
    left: Vec<unexplained::OfFlight>,
}

impl Gathered {
    fn new(data: &DataSet) -> Self {
        let quaternion = data.source.quaternion.map(other_order);
        let step_s = data.flights.first().map_or(1.0, |flight| flight.step_s);
        let (Read { each, sticks, piled, sides, followed }, columns) =
            both(|| read(data, quaternion, step_s), || Columns::of(&data.flights).with_stated(&data.source));
        let faults = columns.poor.iter().filter(|finding| finding.verdict == Severity::Fault);
        let names: BTreeSet<&String> = faults.flat_map(|finding| &finding.flights).collect();
        let unfit = |flight: &usize| names.contains(&data.flights[*flight].name);
        let mut except: BTreeSet<usize> = (0..data.flights.len()).filter(unfit).collect();
        let of = |except: &BTreeSet<usize>| {
            let mut evidence = Evidence::new(quaternion, step_s);
            each.iter().filter(|own| !except.contains(&own.flight)).for_each(|own| evidence.absorb(&own.evidence, 1));
            evidence
        };
        // A spike moves no axis; without it the rest of the flight is as good as any.
        let mut unjudged: BTreeSet<usize> = columns.spoilt.union(&except).copied().collect();
        let judged: Vec<&Own> = each.iter().filter(|own| !unjudged.contains(&own.flight)).collect();
        let all = of(&except);
        let misread = odd::is_misread(&judged, &all);
        let odd = Odd::new(&judged, &all, &data.flights);
        except.extend(&odd.flights);
        unjudged.extend(&odd.flights);
        let left = each.iter().map(|own| (own.flight, own.left.iter().cloned().chain(sticks.unexplained(own.flight)).collect()));
        let left: Vec<unexplained::OfFlight> = left.collect();
        let blamed = if misread { Blamed::default() } else { blamed(&judged, &odd, &left, data) };
        except.extend(&blamed.flights);
        unjudged.extend(&blamed.flights);
        let strange = if misread { None } else { unexplained::of_mechanics(&left, &unjudged, &data.flights) };
        let named: BTreeSet<&String> = strange.iter().flat_map(|finding| &finding.flights).collect();
        let of_strange: Vec<usize> = (0..data.flights.len()).filter(|&flight| named.contains(&data.flights[flight].name)).collect();
        except.extend(&of_strange);
        unjudged.extend(&of_strange);
        let stamps = stamps::findings(&judged, &unjudged, &data.flights);
        let odd = blamed.findings.into_iter().chain(odd.findings).chain(strange).chain(stamps).collect();
        Self { columns, odd, misread, together: of(&except), except, unjudged, sticks, piled, sides, followed, left }
    }

    /// All that is said of conventions and of streams against each other, causes before symptoms.
    fn findings(&self, data: &DataSet) -> Vec<Finding> {
        let mut findings = vec![origin(&data.flights)];
        findings.extend(self.columns.poor.iter().chain(&self.odd).cloned());
        findings.extend(evidence::without_scaled(self.together.kinematics(0.0)));
        // Of the attitude the relations know more than the force does.
        let is_read = |finding: &Finding| finding.verdict == Severity::Fault && RELATIONS[..2].contains(&finding.name.as_str());
        let known: Vec<Option<String>> =
            findings.iter().filter(|finding| is_read(finding)).map(|finding| finding.set.clone()).collect();
        let lateral = self.together.forces.lateral();
        let is_other = |finding: &Finding| !known.is_empty() && !known.contains(&finding.set) && finding.verdict == Severity::Fault;
        findings.extend(lateral.filter(|finding| !is_other(finding)));
        if !self.misread {
            findings.extend(self.columns.dead_zones.iter().cloned());
            let followed: Vec<_> = self.followed.iter().filter(|(flight, _)| !self.unjudged.contains(flight)).copied().collect();
            findings.extend(demands::findings(&followed, &data.flights));
            let cut_off = limits::findings(&self.piled, &data.flights, &self.unjudged);
            let mut of_sticks = self.sticks.findings(&data.flights, &self.unjudged);
            of_sticks.extend(stretches::findings(&self.sticks, &data.flights, &self.unjudged));
            of_sticks.extend(mixes::findings(&self.sticks, &data.flights, &self.unjudged));
            of_sticks.extend(trims::findings(&self.sticks, &data.flights, &self.unjudged));
            of_sticks.extend(throws::findings(&self.sticks, &self.sides, &data.flights, &self.unjudged));
            let faults = of_sticks.iter().filter(|finding| finding.verdict == Severity::Fault);
            let named: BTreeSet<&String> = faults.flat_map(|finding| &finding.flights).collect();
            let is_known = |flight: &usize| named.contains(&data.flights[*flight].name);
            let known = (0..data.flights.len()).filter(is_known).chain(self.unjudged.iter().copied()).collect();
            findings.extend(of_sticks);
            findings.extend(unexplained::of_answers(&self.left, &known, &data.flights));
            findings.extend(cut_off);
        }
        // What thrust does along z is known from the collective alone.
        let unsure = findings.iter().any(|finding| finding.verdict == Severity::Fault);
        findings.extend(places(self.together.forces.coefficients(), unsure));
        let rest = data.flights.iter().enumerate().filter(|(flight, _)| !self.except.contains(flight));
        findings.extend(plausibility(&rest.map(|entry| entry.1).collect::<Vec<_>>()));
        if data.source.shifts_attitude() {
            findings.extend(self.together.mounts.still_tilted());
        }
        // A stream that is held is late by half of its rest: that is said already.
        if self.columns.poor.iter().any(|finding| finding.name.starts_with(streams::HELD)) {
            findings.extend(self.together.timing.offsets(0.0));
        } else {
            let clocks = self.together.halves.findings(&|stream| data.source.stated.contains_key(&format!("drift.{stream}")));
            let is_of_controls = |finding: &Finding| finding.verdict == Severity::Fault && finding.name.ends_with(clocks::CONTROLS);
            let has_clock = clocks.iter().any(is_of_controls);
            findings.extend(clocks);
            findings.extend(odd::late_streams(&self.together.timing));
            // Of a clock that runs away the delay is a mean.
            let is_moved = data.source.stated.contains_key("late.controls");
            findings.extend(odd::late_controls(&self.together.timing, is_moved).into_iter().filter(|_| !has_clock));
        }
        if self.misread { findings.into_iter().map(symptom).collect() } else { findings }
    }
}

/// What is wrong with single columns of flights of which nothing else says more than that they do not fit.
fn blamed(judged: &[&Own], odd: &Odd, left: &[unexplained::OfFlight], data: &DataSet) -> Blamed {
    let is_named = |flight: usize| {
        let own = odd.findings.iter().filter(|finding| finding.flights.contains(&data.flights[flight].name));
        let faults: Vec<&Finding> = own.filter(|finding| finding.verdict == Severity::Fault).collect();
        let is_far = |finding: &Finding| finding.message.contains(gains::FAR);
        // A column that has nothing to do with what it should say has some offset, too.
        let is_offset = |finding: &Finding| {
            let column = finding.name.strip_prefix(gains::OFFSET);
            column.is_some_and(|column| faults.iter().any(|far| is_far(far) && far.message.contains(column)))
        };
        // That a vector points elsewhere is a symptom, if the cause is found.
        let points_elsewhere = |finding: &Finding| {
            [relations::OTHER_DIRECTION, relations::OTHER_AXES].iter().any(|says| finding.message.contains(says))
        };
        faults.iter().any(|finding| !is_far(finding) && !is_offset(finding) && !points_elsewhere(finding))
    };
    let unnamed = judged.iter().filter(|own| !is_named(own.flight));
    let causes: Vec<(usize, Option<&[causes::Cause]>)> = unnamed.map(|own| (own.flight, own.causes.as_deref())).collect();
    let mut blamed = blame::gathered(&causes, &unexplained::outstanding(left), &data.flights);
    for finding in blamed.findings.iter_mut().filter(|finding| finding.name == lost::ROWS && finding.set.is_none()) {
        finding.set = lost::mend(data);
    }
    blamed
}

/// Flights that are read side by side at most, and then leave the memory.
#[cfg(feature = "rayon")]
const BESIDE: usize = 8;

/// What each flight says by itself.
struct Read {
    each: Vec<Own>,
    sticks: Sticks,
    piled: Vec<(usize, limits::Piled)>,
    sides: Vec<(usize, throws::Uneven)>,
    followed: Vec<(usize, demands::Followed)>,
}

fn read(data: &DataSet, quaternion: Option<&'static str>, step_s: f64) -> Read {
    let one = |flight: usize| {
        let motion = increments::Motion::new(&data.flights[flight], &data.source);
        data.flights[flight].rest();
        let of_sticks = || (Sticks::of(&motion), limits::of(&motion), demands::of(&motion));
        both(|| Own::new(flight, &motion, quaternion, step_s), of_sticks)
    };
    let indices: Vec<usize> = (0..data.flights.len()).collect();
    #[cfg(feature = "rayon")]
    let found: Vec<_> = {
        use rayon::prelude::*;
        // A few threads wait for nobody.
        let some = if rayon::current_num_threads() <= BESIDE { indices.len().max(1) } else { BESIDE };
        indices
            .chunks(some)
            .flat_map(|some| some.par_iter().with_max_len(1).map(|&flight| one(flight)).collect::<Vec<_>>())
            .collect()
    };
    #[cfg(not(feature = "rayon"))]
    let found: Vec<_> = indices.into_iter().map(one).collect();
    let mut read = Read { each: Vec::new(), sticks: Sticks::new(), piled: Vec::new(), sides: Vec::new(), followed: Vec::new() };
    for (flight, (own, (sides, piled, followed))) in found.into_iter().enumerate() {
        read.each.push(own);
        read.sticks.push(flight, &sides);
        read.piled.push((flight, piled));
        read.sides.push((flight, throws::of(&sides)));
        read.followed.push((flight, followed));
    }
    read
}

/// Coefficients of gravity and of the Coriolis term; where a unit of length explains their size, that unit in their place.
fn places(coefficients: Vec<Finding>, unsure: bool) -> Vec<Finding> {
    if let Some(lengths) = odd::lengths(&coefficients).filter(|lengths| lengths.verdict == Severity::Fault) {
        let others = coefficients.into_iter().filter(|finding| finding.verdict != Severity::Fault);
        return others.chain([lengths]).collect();
    }
    coefficients.into_iter().map(|finding| if unsure { not_judged(finding) } else { finding }).collect()
}

/// How the description says the order that a quaternion is not read in.
const fn other_order(order: QuaternionOrder) -> &'static str {
    match order {
        QuaternionOrder::ScalarLast => "quaternion = \"wxyz\"",
        QuaternionOrder::ScalarFirst => "quaternion = \"xyzw\", or leave `quaternion` out",
    }
}

/// A coefficient along z that a wrong stick, or wrong cells of it, explain.
fn not_judged(finding: Finding) -> Finding {
    if finding.verdict != Severity::Fault || !finding.name.ends_with("_z") {
        return finding;
    }
    let message = "not judged, since it rests on the sticks, and something is wrong with these".into();
    Finding { verdict: Severity::Undetermined, message, set: None, ..finding }
}

/// What rests on a reading that is known to be wrong is not judged.
fn symptom(finding: Finding) -> Finding {
    let is_reading = RELATIONS.iter().any(|relation| finding.name.starts_with(relation)) || finding.name == odd::LATERAL;
    let is_known = [
        gains::OFFSET,
        gains::HEADING,
        evidence::TIME_STEP,
        evidence::TARGETS_STEP,
        evidence::SCALE,
        evidence::TIME_REVERSED,
        mounts::NAME,
        "frozen_",
        streams::HELD,
        "spikes_",
        "saturated_",
        "by_turns_",
        "rounding_",
        "noise_",
    ]
    .iter()
    .any(|start| finding.name.starts_with(start));
    if is_reading || is_known || finding.verdict < Severity::Warning {
        return finding;
    }
    let message = "not judged before what is wrong above is mended".into();
    Finding { verdict: Severity::Undetermined, message, set: None, flights: Vec::new(), ..finding }
}

/// Where the accelerations come from.
fn origin(flights: &[Flight]) -> Finding {
    let derived = flights.iter().filter(|flight| flight.targets == Targets::Derived).count();
    let message = match derived {
        0 => "accelerations are recorded".into(),
        _ => format!(
            "accelerations of {derived} of {} flights are derived from v and w: their conventions cannot be checked apart from those",
            flights.len()
        ),
    };
    finding("targets", Severity::Ok, message, None)
}

/// Ranges that no aircraft of this kind leaves.
fn plausibility(flights: &[&Flight]) -> Vec<Finding> {
    let largest = |columns: &[Column]| {
        let values = columns.iter().flat_map(|column| of_all(flights.iter().copied(), *column));
        values.fold(0.0_f64, |largest, (value, _)| largest.max(value.abs()))
    };
    let mut findings = Vec::new();
    let pitch = largest(&[Column::Pitch]);
    // Half a degree of slack for rounding in the log.
    if pitch > std::f64::consts::FRAC_PI_2 + 0.01 {
        // Degrees go far beyond; the relations between streams know better what is a little beyond.
        let (message, set) = if pitch > LARGEST_OFF {
            ("angles are in degrees, or are not ZYX Euler angles", Some("[units] angles = \"deg\""))
        } else {
            ("it has an offset or drifts at the start, or the angles are not ZYX Euler angles", None)
        };
        let message = format!("pitch reaches {pitch:.2} rad, beyond a quarter turn: {message}");
        findings.push(finding("angle_range", Severity::Fault, message, set));
    }
    let beyond = |column: Column| {
        let samples: usize = flights.iter().map(|flight| flight.len()).sum();
        of_all(flights.iter().copied(), column).filter(|(value, _)| value.abs() > LARGEST_CONTROL).count() as f64
            > RARE_SHARE * samples as f64
    };
    if CONTROLS.into_iter().any(beyond) {
        let message = format!(
            "controls reach {:.1}; the program works, but expected ranges of coefficients assume about [-1, 1]",
            largest(&CONTROLS)
        );
        let least = of_all(flights.iter().copied(), Column::U4).fold(f64::INFINITY, |least, (value, _)| least.min(value));
        let set = match largest(&CONTROLS) {
            percent if percent <= 150.0 && percent > 15.0 => "[units] controls = \"%\"",
            pulses if pulses <= 2300.0 && least >= 700.0 => {
                "[columns] u1 = \"(u1 - 1500) / 500\" and so on for pulses in us, with the file's names"
            }
            _ => "[columns] u1 = \"u1 / 1000\" or the like, with the file's names",
        };
        findings.push(finding("control_range", Severity::Warning, message, Some(set)));
    }
    let with_height: Vec<&Flight> = flights.iter().copied().filter(|flight| !flight.absent.contains(&Column::Z)).collect();
    let (below, samples) = with_height.iter().fold((0, 0), |(below, samples), flight| {
        let own = flight.column(Column::Z).iter().filter(|z| **z > 0.0).count();
        flight.rest();
        (below + own, samples + flight.len())
    });
    if 2 * below > samples {
        let message = format!(
            "z, which is down, is positive in {} % of the samples: flights below the starting point, or z is height",
            100 * below / samples.max(1)
        );
        findings.push(finding(
            "height_sign",
            Severity::Warning,
            message,
            Some("[columns] z = \"-z\", with the file's name, if z is height"),
        ));
    }
    findings
}

fn summary(findings: &[Finding]) -> String {
    let of = |verdict: Severity| findings.iter().filter(move |finding| finding.verdict == verdict);
    let names = |verdict: Severity| of(verdict).map(|finding| finding.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(first) = of(Severity::Fault).next() {
        return format!("Convention fault ({}): {}.", names(Severity::Fault), first.message);
    }
    match of(Severity::Warning).count() {
        0 => "No convention fault, no warning.".into(),
        _ => format!("No convention fault; warnings: {}.", names(Severity::Warning)),
    }
}
