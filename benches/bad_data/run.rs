//! Runs cases and writes a line for each.

use crate::cases::{SINGLES, Single};
use crate::change::{Chance, Change, Corruption, Log, Part};
use crate::corruptions;
use crate::eighth::EIGHTH;
use crate::fifth::FIFTH;
use crate::fourth::FOURTH;
use crate::further::FURTHER;
use crate::mend::through_files;
use crate::ninth::NINTH;
use crate::second::SECOND;
use crate::seventh::SEVENTH;
use crate::sixth::SIXTH;
use crate::tenth::TENTH;
use crate::third::THIRD;
use phyture::critique::check::{self, CheckReport, check, mend};
use phyture::critique::diagnose::{Mends, Options, diagnose};
use phyture::flight::split::Split;
use phyture::flight::{DataSet, Flight};
use phyture::physics::Model;
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, Mechanisms, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::{Error, Result};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

/// Which cases, and how many.
pub struct Plan {
    /// Of each a data set to corrupt without a hidden effect, and one with it.
    pub seeds: Range<u64>,
    /// Data sets with nothing wrong.
    pub clean: u64,
    /// Each so-manieth corruption.
    pub every: usize,
}

/// What is reported. Seeds 80000 to 80002, 83000 to 83006, 85000 to 85018 and 85501 to 85515, with clean sets 81000 to 81399, 84000 to 84399, 86100 to 86499, 86600 to
/// 86999 and 87100 to 87499, were spent: looked at before the checks were as they are.
pub const REPORTED: Plan = Plan { seeds: 88_000..88_010, clean: 400, every: 1 };
/// On which checks are tuned.
pub const DEVELOPMENT: Plan = Plan { seeds: 500..502, clean: 400, every: 1 };
/// Some minutes.
pub const FEW: Plan = Plan { seeds: 500..501, clean: 8, every: 5 };

/// Seeds of clean sets begin so far behind the first.
const CLEAN: u64 = 1000;
/// Length of a data set that is corrupted, min.
const MINUTES: f64 = 20.0;
/// Lengths of clean sets, min.
const CLEAN_MINUTES: [f64; 4] = [20.0, 5.0, 45.0, 10.0];
/// Flown in some of the clean sets alone.
const AEROBATICS: [&str; 6] = ["chaos", "flips", "freestyle_aggressive", "loops", "rolls", "stall_turns"];

/// Hidden effects, by turns.
const HIDDEN: [&str; 8] =
    ["collective_torque", "weathercock", "rate_cross", "dihedral_speedstab", "ctrl_cross", "transl_lift", "tail_lag", "quad_drag"];
/// The effect that is a fault of the log as well.
const LATE_ATTITUDE: &str = "sync";
/// Share of the error that a hidden effect makes: large.
const SHARE: f64 = 0.5;

/// All corruptions, by the round in which they were written.
pub const HALVES: [(&str, &[Corruption]); 11] = [
    ("development", corruptions::DEVELOPMENT),
    ("further", FURTHER),
    ("second", SECOND),
    ("third", THIRD),
    ("fourth", FOURTH),
    ("fifth", FIFTH),
    ("sixth", SIXTH),
    ("seventh", SEVENTH),
    ("eighth", EIGHTH),
    ("ninth", NINTH),
    ("tenth", TENTH),
];

/// What `diagnose` says where `check` found a fault.
pub const CONVENTION_FAULT: &str = "convention fault";
/// In the place of a hidden effect.
pub const NULL: &str = "null";
/// Half of what is not corrupted: the ground of comparison, and what only `check` looks at.
pub const UNCORRUPTED: &str = "uncorrupted";
pub const CLEAN_HALF: &str = "clean";

/// A fault or a warning.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Said {
    pub name: String,
    pub message: String,
    pub set: Option<String>,
}

impl Said {
    /// All of it.
    pub fn text(&self) -> String {
        format!("{} {} {}", self.name, self.message, self.set.as_deref().unwrap_or_default())
    }
}

/// What became of a case once the lines that `check` prints were set.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Mended {
    /// The description.
    pub description: String,
    /// `check` finds no more fault.
    pub is_free: bool,
    /// What `diagnose` then says.
    pub verdict: String,
    pub accepted: Vec<String>,
    /// As of [`Line::rmse`].
    pub rmse: Vec<Option<f64>>,
}

/// One case.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Line {
    /// `development`, `further`, `second`, `third`, `fourth`, `fifth`, `sixth`, `seventh`, `eighth`, `ninth`, `tenth`, `uncorrupted` or `clean`.
    pub half: String,
    /// Identifier; of a clean set what flies in it.
    pub corruption: String,
    /// `all`, `half`, `one`.
    pub part: String,
    pub seed: u64,
    /// Hidden effect, or `null`.
    pub hidden: String,
    pub faults: Vec<Said>,
    pub warnings: Vec<Said>,
    /// Where the right cause is named: `fault`, `warning`, `note`, or nothing.
    pub right: String,
    /// Some of the flights that are hit are named with it, and no others.
    pub flights_named: bool,
    pub verdict: String,
    pub accepted: Vec<String>,
    /// Of the reader and of the diagnosis.
    pub notes: Vec<String>,
    /// Error on flights that no search saw, by channel.
    pub rmse: Vec<Option<f64>>,
    pub mended: Option<Mended>,
    pub check_s: f64,
    pub seconds: f64,
}

impl Line {
    fn key(&self) -> String {
        format!("{} {} {} {} {}", self.half, self.corruption, self.part, self.seed, self.hidden)
    }
}

/// Lines of a file; none if it is not there.
pub fn read(path: &Path) -> Result<Vec<Line>> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(Vec::new()) };
    let parse =
        |line: &str| serde_json::from_str(line).map_err(|error| Error::File { path: path.into(), message: error.to_string() });
    text.lines().map(parse).collect()
}

fn model() -> Model {
    Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

/// Flights of level two in calm air.
pub fn simulated(seed: u64, minutes: f64, hidden: Option<&str>) -> Result<DataSet> {
    let mut simulation = Simulation { seed, minutes, mechanisms: Mechanisms::none(), level: Level::TWO, ..Simulation::default() };
    if let Some(id) = hidden {
        simulation = simulation.hide(id, scale(id))?;
    }
    simulate(&simulation)
}

fn scale(id: &str) -> f64 {
    SINGLES.iter().find(|single| single.id == id).map_or(1.0, |single| single.scale(SHARE))
}

/// A data set after a corruption, and the flights that it hit.
struct Corrupted {
    set: DataSet,
    hit: Vec<String>,
}

fn corrupted(set: &DataSet, corruption: &Corruption, part: Part, seed: u64) -> Result<Corrupted> {
    let (mut flights, mut hit) = (Vec::new(), Vec::new());
    for (index, flight) in set.flights.iter().enumerate() {
        if !part.holds(index, set.flights.len(), seed) {
            flights.push(flight.clone());
            continue;
        }
        hit.push(flight.name.clone());
        let mut chance = Chance::new(seed, index);
        match corruption.change {
            Change::Columns(change) => flights.push(changed(flight, change, &mut chance)?),
            Change::Copies(change) => {
                let copy = changed(flight, change, &mut chance)?;
                let names = ["again", "once_more"].map(|word| format!("{}_{word}", flight.name));
                flights.push(flight.clone());
                flights.extend(names.into_iter().filter_map(|name| copy.slice(0..copy.len(), name)));
            }
        }
    }
    let set = match corruption.change {
        Change::Columns(_) => DataSet { flights, ..set.clone() },
        Change::Copies(_) => through_files(&flights, None)?,
    };
    Ok(Corrupted { set, hit })
}

/// The flights with nothing wrong that a case is held against: all of them, and what is left where those that are hit are left out.
const UNTOUCHED: [Option<Part>; 3] = [None, Some(Part::Half), Some(Part::One)];

fn untouched(set: &DataSet, hit: Option<Part>, seed: u64) -> DataSet {
    let count = set.flights.len();
    let is_left = |index: &usize| hit.is_none_or(|part| !part.holds(*index, count, seed));
    DataSet { flights: (0..count).filter(is_left).map(|index| set.flights[index].clone()).collect(), ..set.clone() }
}

fn changed(flight: &Flight, change: fn(&mut Log, &mut Chance), chance: &mut Chance) -> Result<Flight> {
    let mut log = Log::of(flight);
    change(&mut log, chance);
    log.into_flight(flight)
}

/// Checks, and where there is no fault diagnoses, as the command line does; notes both. What cannot be diagnosed is a verdict of its own.
fn judge(line: &mut Line, set: &DataSet, searches: bool) -> CheckReport {
    let begun = Instant::now();
    let report = check(set, Some(&model()));
    line.check_s = begun.elapsed().as_secs_f64();
    let of = |verdict| report.findings.iter().filter(move |finding| finding.verdict == verdict).map(said).collect();
    (line.faults, line.warnings) = (of(check::Severity::Fault), of(check::Severity::Warning));
    line.notes.clone_from(&set.notes);
    if report.fault {
        line.verdict = CONVENTION_FAULT.into();
    } else if searches {
        search(line, set);
    }
    line.seconds = begun.elapsed().as_secs_f64();
    report
}

fn said(finding: &check::Finding) -> Said {
    Said { name: finding.name.clone(), message: finding.message.clone(), set: finding.set.clone() }
}

fn search(line: &mut Line, set: &DataSet) {
    let split = Split::for_search(&set.flights, line.seed);
    let options = Options { seed: line.seed, mends: Mends::of(&set.source), ..Options::default() };
    match diagnose(&set.flights, &model(), &split.training, &split.test, "test", &options) {
        Ok(outcome) => {
            let diagnosis = outcome.diagnosis;
            line.verdict = diagnosis.verdict.words().into();
            line.accepted = diagnosis.accepted;
            line.notes.extend(diagnosis.notes);
            line.rmse = diagnosis.locked.map_or_else(Vec::new, |locked| locked.rmse_after.channels().values().to_vec());
        }
        Err(error) => line.verdict = format!("error: {error}"),
    }
}

/// Where the right cause is named, the most serious first, and with the right flights.
fn recognise(line: &mut Line, corruption: &Corruption, set: &DataSet, hit: &[String]) {
    let right = |text: &str| corruption.is_named_by(text);
    let of = |said: &[Said]| said.iter().map(Said::text).find(|text| right(text));
    let named = [("fault", of(&line.faults)), ("warning", of(&line.warnings))];
    let note = ("note", set.notes.iter().find(|note| right(note)).cloned());
    let Some((how, text)) = named.into_iter().chain([note]).find_map(|(how, text)| Some((how, text?))) else { return };
    line.right = how.into();
    let holds = |name: &String| text.contains(name.as_str());
    let others = set.flights.iter().map(|flight| flight.name.rsplit('/').next().unwrap_or_default().to_owned());
    line.flights_named = hit.iter().any(holds) && !others.filter(|name| !hit.contains(name)).any(|name| holds(&name));
}

/// The same flights with what `check` says to set, round after round, as `check --suggest` does; `None` where it says nothing that a file can hold.
fn mended(line: &Line, report: &CheckReport, set: &DataSet) -> Option<Mended> {
    let flights = &set.flights;
    let made = mend(set, report, Some(&model()), |text| through_files(flights, Some(text)))?;
    let mut after = Line { seed: line.seed, ..Line::default() };
    match &made.set {
        Some(set) => drop(judge(&mut after, set, true)),
        None => after.verdict = "error: the flights cannot be read with it".into(),
    }
    let is_free = after.faults.is_empty() && !after.verdict.starts_with("error");
    let description = made.suggestion.text;
    Some(Mended { description, is_free, verdict: after.verdict, accepted: after.accepted, rmse: after.rmse })
}

/// One corruption of a data set, judged, and mended where that can be.
fn case(mut line: Line, corruption: &Corruption, part: Part, set: &DataSet) -> Result<Line> {
    let Corrupted { set, hit } = corrupted(set, corruption, part, line.seed)?;
    let report = judge(&mut line, &set, true);
    recognise(&mut line, corruption, &set, &hit);
    line.mended = mended(&line, &report, &set);
    Ok(line)
}

/// So many cases of a data set side by side: much of each is done by one thread.
const BESIDE: usize = 2;

/// Cases that are there, and the file for those that are made.
struct Bench<'a> {
    out: &'a Path,
    done: Vec<String>,
}

impl Bench<'_> {
    fn write(&mut self, line: &Line) -> Result<()> {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(self.out).map_err(Error::io(self.out))?;
        let text = serde_json::to_string(line).map_err(|error| Error::Undetermined(error.to_string()))?;
        writeln!(file, "{text}").map_err(Error::io(self.out))?;
        let faults: Vec<&str> = line.faults.iter().map(|said| said.name.as_str()).collect();
        eprintln!(
            "{:<24} {:<4} seed {:<6} {:<18} right: {:<8} {} [{}] [{}] {:.1} s",
            line.corruption,
            line.part,
            line.seed,
            line.hidden,
            line.right,
            line.verdict,
            faults.join(", "),
            line.accepted.join(", "),
            line.seconds
        );
        self.done.push(line.key());
        Ok(())
    }

    /// One data set without anything wrong, then each corruption of it that is not done.
    fn corruptions(&mut self, list: &[(&str, &Corruption)], seed: u64, hidden: Option<&str>) -> Result<()> {
        let hidden_name = hidden.unwrap_or(NULL);
        let new = |half: &str, corruption: &str, part: &str| Line {
            half: half.into(),
            corruption: corruption.into(),
            part: part.into(),
            seed,
            hidden: hidden_name.into(),
            ..Line::default()
        };
        let cases = list
            .iter()
            .flat_map(|(half, corruption)| corruption.parts.map(|part| (new(half, corruption.id, part.name()), *corruption, part)));
        let is_open = |line: &Line, done: &[String]| !done.contains(&line.key());
        let open: Vec<_> = cases.filter(|(line, ..)| is_open(line, &self.done)).collect();
        let sound = UNTOUCHED.map(|part| (new(UNCORRUPTED, UNCORRUPTED, part.map_or("", Part::name)), part));
        if open.is_empty() && sound.iter().all(|(line, _)| !is_open(line, &self.done)) {
            return Ok(());
        }
        let set = simulated(seed, MINUTES, hidden)?;
        for (mut line, part) in sound.into_iter().filter(|(line, _)| is_open(line, &self.done)).collect::<Vec<_>>() {
            judge(&mut line, &untouched(&set, part, seed), true);
            self.write(&line)?;
        }
        for some in open.chunks(BESIDE) {
            let lines: Vec<Result<Line>> = std::thread::scope(|scope| {
                let mut begun = Vec::new();
                for (line, corruption, part) in some {
                    let set = &set;
                    begun.push(scope.spawn(move || case(line.clone(), corruption, *part, set)));
                }
                let ended = |case: std::thread::ScopedJoinHandle<'_, Result<Line>>| {
                    case.join().unwrap_or_else(|_| Err(Error::Undetermined("a case ended in a panic".into())))
                };
                begun.into_iter().map(ended).collect()
            });
            for line in lines {
                self.write(&line?)?;
            }
        }
        Ok(())
    }

    /// A data set with nothing wrong: levels one and two, calm and windy, short and long, single effects and all of them, now and then only
    /// aerobatics.
    fn clean(&mut self, index: u64, seed: u64) -> Result<()> {
        let level = if index.is_multiple_of(2) { Level::ONE } else { Level::TWO };
        let minutes = CLEAN_MINUTES[(index / 2) as usize % CLEAN_MINUTES.len()];
        let mut simulation = Simulation { seed, minutes, mechanisms: Mechanisms::none(), level, ..Simulation::default() };
        // A late attitude is something wrong with the data.
        let singles: Vec<&Single> = SINGLES.iter().filter(|single| single.id != LATE_ATTITUDE).collect();
        let single = singles[(index / 5) as usize % singles.len()];
        let flies = match index % 5 {
            0 => NULL,
            1 => "wind",
            2 | 3 => single.id,
            _ => "all",
        };
        match flies {
            NULL => {}
            "all" => simulation.mechanisms = Mechanisms::all(),
            id => simulation = simulation.hide(id, scale(id))?,
        }
        let aerobatic = index % 7 == 3;
        if aerobatic {
            simulation.classes = Some(AEROBATICS.map(str::to_owned).to_vec());
        }
        let mut line = Line {
            half: CLEAN_HALF.into(),
            corruption: format!("{flies}, {minutes} min{}", if aerobatic { ", aerobatics" } else { "" }),
            seed,
            hidden: flies.into(),
            ..Line::default()
        };
        if self.done.contains(&line.key()) {
            return Ok(());
        }
        judge(&mut line, &simulate(&simulation)?, false);
        self.write(&line)
    }
}

/// Writes the flights of one case as CSV files into a folder, to look at with the program itself.
pub fn write_case(folder: &Path, id: &str, part: &str, seed: u64, hidden: Option<&str>) -> Result<()> {
    let unknown = |what: String| Error::Undetermined(what);
    let mut every = HALVES.iter().flat_map(|(_, list)| list.iter());
    let corruption = every.find(|corruption| corruption.id == id).ok_or_else(|| unknown(format!("no corruption `{id}`")))?;
    let part = [Part::All, Part::Half, Part::One].into_iter().find(|each| each.name() == part);
    let part = part.ok_or_else(|| unknown("the part is none of all, half and one".into()))?;
    let Corrupted { set, .. } = corrupted(&simulated(seed, MINUTES, hidden)?, corruption, part, seed)?;
    phyture::flight::write::data_set_csv(folder, &set.flights)?;
    model().write(folder.join("model.toml"))
}

/// Runs a plan, or of it only what is asked for: identifiers of corruptions, and `clean`.
pub fn all(out: &Path, plan: &Plan, what: &[&str]) -> Result<()> {
    let done = read(out)?.iter().map(Line::key).collect();
    let mut bench = Bench { out, done };
    let asked = |id: &str| what.is_empty() || what.contains(&id);
    let of = |half: &'static str, list: &'static [Corruption]| list.iter().map(move |corruption| (half, corruption));
    let every = HALVES.into_iter().flat_map(|(half, list)| of(half, list));
    let list: Vec<_> = every.filter(|(_, corruption)| asked(corruption.id)).step_by(plan.every).collect();
    for seed in plan.seeds.clone() {
        let hidden = HIDDEN[seed as usize % HIDDEN.len()];
        bench.corruptions(&list, seed, None)?;
        bench.corruptions(&list, seed, Some(hidden))?;
    }
    for index in (0..plan.clean).filter(|_| asked(CLEAN_HALF)) {
        bench.clean(index, plan.seeds.start.next_multiple_of(100) + CLEAN + index)?;
    }
    Ok(())
}
