//! Runs cases and writes a line for each.

use crate::cases::{ALIENS, CONFUSABLE, FOREIGN, PAIRS, SINGLES, SIZES, Single};
use phyture::critique::diagnose::{Diagnosis, Met, Options, diagnose, met, stepwise_and_stlsq};
use phyture::flight::split::Split;
use phyture::flight::{Channel, Column, DataSet, Flight, PerChannel};
use phyture::formula::Formula;
use phyture::physics::{Model, catalogue, evaluate};
use phyture::sim::{INERTIA_KG_M2, Level, MASS_KG, Mechanisms, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// First seed of the runs that are reported.
pub const REPORTED: u64 = 100_000;
/// First seed of development.
pub const DEVELOPMENT: u64 = 40;
/// Data sets without a hidden effect.
const NULLS: u64 = 200;

/// One run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Line {
    /// Kind of case.
    pub part: String,
    /// What is hidden, joined by `+`; `null`, or a formula.
    pub hidden: String,
    /// Aimed at.
    pub size: String,
    /// Scale of the simulator's mechanism.
    pub scale: f64,
    /// 1 or 2.
    pub level: u8,
    /// Seed.
    pub seed: u64,
    /// Removable share of the best channel, measured.
    pub share: f64,
    /// Verdict.
    pub verdict: String,
    /// Effects named, in order.
    pub accepted: Vec<String>,
    /// Those that cannot be told from the first.
    pub indistinguishable: Vec<String>,
    /// First variable of an unknown dependence, by channel.
    pub unknown: BTreeMap<String, String>,
    /// Relative error of the main number, and for times its absolute error.
    pub coefficient_error: Option<(f64, f64)>,
    /// Error removed over error removable on flights that no search saw.
    pub removed: Option<f64>,
    /// Time of the search, s.
    pub seconds: f64,
    /// Effects that stepwise regression names, and sparse regression, with and without columns of lags.
    pub stepwise: Vec<Vec<String>>,
    pub sparse: Vec<Vec<String>>,
}

impl Line {
    fn key(&self) -> String {
        format!("{} {} {} {} {}", self.part, self.hidden, self.size, self.level, self.seed)
    }
}

/// Lines of a file; none if it is not there.
pub fn read(path: &Path) -> Result<Vec<Line>> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(Vec::new()) };
    let parse =
        |line: &str| serde_json::from_str(line).map_err(|error| Error::File { path: path.into(), message: error.to_string() });
    text.lines().map(parse).collect()
}

struct Bench<'a> {
    out: &'a Path,
    done: Vec<String>,
    /// Mean squared errors of data without a hidden effect, by seed, level and whether there is wind beside it.
    floors: BTreeMap<(u64, u8, bool), PerChannel<f64>>,
    minutes: f64,
}

/// What a case hides.
struct Hidden<'a> {
    mechanisms: Vec<(&'a str, f64)>,
    alien: Option<(&'a str, &'a str)>,
}

impl Hidden<'_> {
    /// Whether a wind blows beside what is hidden.
    fn is_windy(&self, level: u8) -> bool {
        level == 2 && !self.mechanisms.iter().any(|(id, _)| *id == "wind")
    }
}

fn model() -> Model {
    Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M)
}

/// The same, knowing of wind.
fn model_with_wind() -> Model {
    let mut model = model();
    let wind = catalogue::definition("wind").expect("in the catalogue");
    model.effects.push(wind.effect(MASS_KG, ROTOR_RADIUS_M));
    model
}

impl Bench<'_> {
    fn data(&self, hidden: &Hidden<'_>, level: u8, seed: u64) -> Result<DataSet> {
        let mut simulation = Simulation {
            seed,
            minutes: self.minutes,
            mechanisms: Mechanisms::none(),
            level: if level == 1 { Level::ONE } else { Level::TWO },
            ..Simulation::default()
        };
        if hidden.is_windy(level) {
            simulation = simulation.hide("wind", 1.0)?;
        }
        for (id, scale) in &hidden.mechanisms {
            simulation = simulation.hide(id, *scale)?;
        }
        let mut set = simulate(&simulation)?;
        if let Some((channel, formula)) = hidden.alien {
            let formula = Formula::parse(formula)?;
            set.flights = set.flights.iter().map(|flight| implant(flight, channel, &formula)).collect::<Result<_>>()?;
        }
        Ok(set)
    }

    /// Of the baseline on flights that no search sees; where it blows with the wind that it finds.
    fn mse(&self, set: &DataSet, split: &Split, is_windy: bool) -> Result<PerChannel<f64>> {
        let model = if is_windy { model_with_wind() } else { model() };
        let (fitted, _) = phyture::physics::calibrate(&model, &set.flights, &split.training)?;
        let Met { models, judged, .. } = met(&set.flights, &[&fitted], &split.test)?;
        Ok(models[0].rmse(&set.flights, &judged)?.map(|error| error * error))
    }

    fn case(&mut self, part: &str, size: &str, hidden: &Hidden<'_>, level: u8, seed: u64, known: Option<&Single>) -> Result<()> {
        let names: Vec<&str> = hidden.mechanisms.iter().map(|entry| entry.0).collect();
        let mut line = Line {
            part: part.into(),
            hidden: hidden.alien.map_or_else(
                || if names.is_empty() { "null".into() } else { names.join("+") },
                |(channel, formula)| format!("{channel} = {formula}"),
            ),
            size: size.into(),
            scale: hidden.mechanisms.first().map_or(0.0, |entry| entry.1),
            level,
            seed,
            ..Line::default()
        };
        if self.done.contains(&line.key()) {
            return Ok(());
        }
        let set = self.data(hidden, level, seed)?;
        let split = Split::for_search(&set.flights, seed);
        let is_windy = hidden.is_windy(level);
        let floor = match self.floors.get(&(seed, level, is_windy)) {
            Some(floor) => *floor,
            None if line.hidden == "null" => PerChannel::splat(0.0),
            None => {
                // What is left at best: the same session without the hidden effect.
                let mechanisms = if is_windy { Vec::new() } else { vec![("wind", 0.0)] };
                let floor = self.mse(&self.data(&Hidden { mechanisms, alien: None }, level, seed)?, &split, is_windy)?;
                self.floors.insert((seed, level, is_windy), floor);
                floor
            }
        };
        if part == "textbook" {
            for dynamic in [true, false] {
                let (stepwise, sparse) = stepwise_and_stlsq(&set.flights, &model(), &split.training, dynamic)?;
                line.stepwise.push(stepwise);
                line.sparse.push(sparse);
            }
            return self.write(&line);
        }
        let outcome =
            diagnose(&set.flights, &model(), &split.training, &split.test, "test", &Options { seed, ..Options::default() })?;
        // The share is that of the hidden effect beside the wind.
        let hidden_mse = if is_windy && line.hidden != "null" { Some(self.mse(&set, &split, true)?) } else { None };
        self.fill(&mut line, &outcome.diagnosis, &floor, hidden_mse, known);
        self.write(&line)
    }

    fn fill(
        &self,
        line: &mut Line,
        diagnosis: &Diagnosis,
        floor: &PerChannel<f64>,
        alone: Option<PerChannel<f64>>,
        known: Option<&Single>,
    ) {
        line.verdict = diagnosis.verdict.words().into();
        line.accepted.clone_from(&diagnosis.accepted);
        line.indistinguishable = diagnosis.steps.first().map_or_else(Vec::new, |step| step.indistinguishable.clone());
        line.seconds = diagnosis.seconds;
        for unknown in diagnosis.unknown.iter().flatten() {
            if let Some(first) = unknown.depends_on.first() {
                line.unknown.insert(unknown.channel.clone(), first.variable.clone());
            }
        }
        let Some(locked) = &diagnosis.locked else { return };
        let squares = |values: phyture::critique::ChannelValues| values.channels().map(|value| value.unwrap_or(0.0).powi(2));
        let (before, after) = (squares(locked.rmse_before), squares(locked.rmse_after));
        let with = alone.unwrap_or(before);
        let share = |channel: Channel| 1.0 - floor[channel] / with[channel];
        let best = Channel::ALL.into_iter().max_by(|&left, &right| share(left).total_cmp(&share(right))).unwrap_or(Channel::VxDot);
        line.share = share(best);
        line.removed = Some((before[best] - after[best]) / (before[best] - floor[best]));
        let Some((single, (name, truth))) = known.and_then(|single| Some((single, single.truth?))) else { return };
        let Some(step) = diagnosis.steps.iter().find(|step| step.effect == single.id) else { return };
        let truth = if single.inverse { truth / line.scale } else { truth * line.scale };
        let coefficients = step.coefficients.iter().map(|number| (&number.name, number.value));
        let parameters = step.parameters.iter().map(|number| (&number.name, number.value));
        if let Some((_, value)) = coefficients.chain(parameters).find(|entry| entry.0 == name) {
            line.coefficient_error = Some(((value - truth).abs() / truth.abs(), (value - truth).abs()));
        }
    }

    fn write(&mut self, line: &Line) -> Result<()> {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(self.out).map_err(Error::io(self.out))?;
        let text = serde_json::to_string(line).map_err(|error| Error::Undetermined(error.to_string()))?;
        writeln!(file, "{text}").map_err(Error::io(self.out))?;
        eprintln!(
            "{:<11} L{} {:<28} {:<7} seed {:<6} share {:>5.1} %  {:<22} {} {:?} {:.1} s",
            line.part,
            line.level,
            line.hidden,
            line.size,
            line.seed,
            100.0 * line.share,
            line.verdict,
            line.accepted.join(", "),
            line.unknown,
            line.seconds
        );
        self.done.push(line.key());
        Ok(())
    }
}

fn implant(flight: &Flight, channel: &str, formula: &Formula) -> Result<Flight> {
    let added = evaluate(formula, flight)?;
    let columns = std::array::from_fn(|index| {
        let column = Column::ALL[index];
        let mut values = flight.column(column).to_vec();
        if column.name() == channel {
            values.iter_mut().zip(&added).for_each(|(value, added)| *value += added);
        }
        values
    });
    Flight::new(flight.name.clone(), flight.manoeuvre.clone(), flight.start_s, flight.step_s, columns, flight.targets)
}

fn single(id: &str) -> Option<&'static Single> {
    SINGLES.iter().find(|single| single.id == id)
}

fn wanted(id: &str, share: f64) -> (&str, f64) {
    (id, single(id).map_or(1.0, |single| single.scale(share)))
}

/// Everything, resumable.
pub fn all(out: &Path, parts: &[&str], first: u64) -> Result<()> {
    let done = read(out)?.iter().map(Line::key).collect();
    let mut bench = Bench { out, done, floors: BTreeMap::new(), minutes: 30.0 };
    // Names of effects beside the parts choose among the single ones.
    let (effects, parts): (Vec<&str>, Vec<&str>) = parts.iter().partition(|part| single(part).is_some());
    let asked = |part: &str| parts.is_empty() || parts.contains(&part);
    let level = |seed: u64| if seed.is_multiple_of(2) { 1 } else { 2 };
    if asked("nulls") {
        for seed in first + 1000..first + 1000 + NULLS {
            bench.case("null", "", &Hidden { mechanisms: Vec::new(), alien: None }, level(seed), seed, None)?;
        }
    }
    for seed in first..first + 3 {
        for single in SINGLES.iter().filter(|single| asked("singles") && (effects.is_empty() || effects.contains(&single.id))) {
            for (size, share) in SIZES {
                let hidden = Hidden { mechanisms: vec![(single.id, single.scale(share))], alien: None };
                bench.case("single", size, &hidden, level(seed), seed, Some(single))?;
            }
        }
    }
    if asked("aliens") {
        for (index, (channel, formula, _)) in ALIENS.iter().enumerate() {
            let seed = first + 200 + index as u64;
            bench.case(
                "alien",
                "",
                &Hidden { mechanisms: Vec::new(), alien: Some((channel, formula)) },
                level(seed),
                seed,
                None,
            )?;
        }
        for (index, (id, _)) in FOREIGN.iter().enumerate() {
            let seed = first + 300 + index as u64;
            bench.case("alien", "", &Hidden { mechanisms: vec![(id, 1.0)], alien: None }, level(seed), seed, None)?;
        }
    }
    if asked("pairs") {
        for seed in first + 400..first + 402 {
            for (one, other) in PAIRS {
                let hidden = Hidden { mechanisms: vec![wanted(one, 0.3), wanted(other, 0.3)], alien: None };
                bench.case("pair", "", &hidden, level(seed), seed, None)?;
            }
        }
    }
    if asked("confusables") {
        for (index, (truth, _)) in CONFUSABLE.iter().enumerate() {
            let seed = first + 500 + index as u64;
            bench.case(
                "confusable",
                "",
                &Hidden { mechanisms: vec![wanted(truth, 0.3)], alien: None },
                level(seed),
                seed,
                single(truth),
            )?;
        }
    }
    if asked("textbook") {
        for single in SINGLES {
            for (size, share) in SIZES {
                let hidden = Hidden { mechanisms: vec![(single.id, single.scale(share))], alien: None };
                bench.case("textbook", size, &hidden, 1, first, None)?;
            }
        }
        for seed in (first + 1000..first + 1020).filter(|seed| seed % 2 == 0) {
            bench.case("textbook", "", &Hidden { mechanisms: Vec::new(), alien: None }, 1, seed, None)?;
        }
    }
    Ok(())
}

/// A few cases of each kind.
pub fn few(out: &Path) -> Result<()> {
    let mut bench = Bench { out, done: Vec::new(), floors: BTreeMap::new(), minutes: 30.0 };
    for seed in 1..5 {
        bench.case("null", "", &Hidden { mechanisms: Vec::new(), alien: None }, 1 + (seed % 2) as u8, seed, None)?;
    }
    for single in SINGLES.iter().step_by(4) {
        let hidden = Hidden { mechanisms: vec![(single.id, single.scale(0.11))], alien: None };
        bench.case("single", "medium", &hidden, 1, 2, Some(single))?;
    }
    let (channel, formula, _) = ALIENS[0];
    bench.case("alien", "", &Hidden { mechanisms: Vec::new(), alien: Some((channel, formula)) }, 1, 2, None)?;
    let (one, other) = PAIRS[0];
    bench.case("pair", "", &Hidden { mechanisms: vec![wanted(one, 0.3), wanted(other, 0.3)], alien: None }, 1, 2, None)
}
