//! The model file: a [`Model`] as TOML, read strictly and written so that it reads back the same.

use super::baseline::{self, PAPER};
use super::catalogue;
use super::correlation::Correlation;
use super::definition::Vehicle;
use super::effect::{Effect, FORMULA_COEFFICIENT, FORMULA_KIND, Parameter};
use super::evaluate::standard_names;
use super::model::{Entry, Model, ModelData};
use super::rotor_file::{read_rotor, write_rotor};
use super::signal::{SIGNALS, changeable, signal_named};
use super::toml_section::{Section, line_of, number};
use super::vehicle::{self, Assumed};
use crate::error::{Error, Result};
use crate::flight::Channel;
use crate::flight::split::Protocol;
use crate::suggest::did_you_mean;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// Aircraft of the paper's data, for a file that gives no numbers of its own: an N9-class helicopter of 4.58 kg with 720 mm
/// blades, and the usual ratios of the inertia of small helicopters (only the ratios enter the baseline).
const NOMINAL_MASS_KG: f64 = 4.58;
const NOMINAL_INERTIA: [f64; 3] = [0.18, 0.34, 0.28];
const NOMINAL_ROTOR_RADIUS_M: f64 = 0.80;

/// What effects mean: since 2 they read and change the signals of the model; since 3 a rotor that slows down takes less power
/// and damps less, and the induced flow settles sooner the more air passes; since 4 a falling mass changes accelerations, not forces.
const FORMAT: u32 = 4;

/// Effects of the catalogue that mean something else in format 3 than in format 2.
const CHANGED: [&str; 2] = ["inflow_lag", "rotor_droop"];

/// The effect of the catalogue that means something else in format 4 than in format 3 where other effects read the thrust.
const MASS: &str = "mass_drift";

/// Effects of the catalogue that, alone beside the baseline, mean since format 2 what they meant before.
const UNCHANGED: [&str; 15] = [
    "climb_inflow",
    "collective_lag",
    "ctrl_cross",
    "ctrl_nonlin",
    "dihedral_speedstab",
    "quad_drag",
    "rate_cross",
    "speed_damping",
    "tail_lag",
    "tail_rotor_inflow",
    "tail_side_force",
    "tilt_misalign",
    "vel_cross",
    "weathercock",
    "wind",
];

fn read_format(model: &Section<'_>) -> Result<u32> {
    let Some(format) = model.number("format")? else { return Ok(1) };
    if (1..=FORMAT).any(|known| format == f64::from(known)) {
        return Ok(format as u32);
    }
    Err(model.fault("format", format.to_string(), "1 to 4, the formats that this version reads"))
}

/// Refuses numbers of effects that a file of an earlier format found for other formulas.
fn check_meaning(file: &Section<'_>, effects: &[Effect], format: u32) -> Result<()> {
    let has_numbers = |effect: &&Effect| {
        let of_catalogue = catalogue::definition(&effect.kind).filter(|definition| definition.notes.is_some());
        let given = |definition: &super::definition::Definition| {
            let blank = definition.effect(1.0, 1.0);
            let moved =
                effect.parameters.iter().zip(&blank.parameters).any(|(left, right)| !left.fixed && left.value != right.value);
            moved || effect.coefficients.iter().any(|coefficient| coefficient.value != 0.0)
        };
        effect.enabled && of_catalogue.is_some_and(given)
    };
    let found: Vec<&Effect> = effects.iter().filter(has_numbers).collect();
    if format == 2
        && let Some(changed) = found.iter().find(|effect| CHANGED.contains(&effect.kind.as_str()))
    {
        return Err(file.fault(
            "model.format",
            format!("2, and numbers of `{}`, found for another formula", changed.name),
            "`format = 4` under [model], and then `phyture calibrate`: a rotor that slows down now takes less power and damps less, and induced flow \
             settles sooner at speed",
        ));
    }
    if format >= 2 {
        // A formula of the user's may read the thrust as well.
        let is_own = |effect: &Effect| effect.enabled && effect.kind == FORMULA_KIND;
        let has_others = found.len() > 1 || effects.iter().any(is_own);
        let Some(mass) = found.iter().find(|effect| effect.kind == MASS).filter(|_| has_others) else { return Ok(()) };
        return Err(file.fault(
            "model.format",
            format!("{format}, and numbers of `{}`, found beside others for another formula", mass.name),
            "`format = 4` under [model], and then `phyture calibrate`: a falling mass now changes the acceleration that the thrust makes, not its moments",
        ));
    }
    let changed = match found.as_slice() {
        [] => return Ok(()),
        [only] if UNCHANGED.contains(&only.kind.as_str()) => return Ok(()),
        [first, ..] => found.iter().find(|effect| !UNCHANGED.contains(&effect.kind.as_str())).unwrap_or(first),
    };
    Err(file.fault(
        "model.format",
        format!("nothing, and numbers of `{}`, found when effects did not see each other", changed.name),
        "`format = 4` under [model], and then `phyture calibrate`: effects now read thrust, air velocity and controls as the other effects leave them",
    ))
}

impl Model {
    /// Reads a model file.
    ///
    /// A file without `format` was written when effects did not see each other: it is read where that means the same. So is one of format 2 or 3,
    /// whose effects are those of today but for `inflow_lag` and `rotor_droop` (2) and `mass_drift` beside others.
    ///
    /// `[model]` may leave out everything but is itself needed; `mass_kg`, `inertia` and `rotor_radius_m` default to those of the
    /// paper's aircraft (4.58 kg, `[0.18, 0.34, 0.28]`, 0.80 m) and are marked in [`Model::assumed`], the name to the file's, and without `baseline` the model holds
    /// the listed effects alone. An `[[effect]]` that `baseline` already holds sets that effect's numbers.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] if it is no TOML; [`Error::Config`] with line and suggestion at an unknown key, kind or
    /// coefficient or a value of the wrong form; [`Error::Formula`] pointing at the character.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::from_toml(&std::fs::read_to_string(path).map_err(Error::io(path))?, path)
    }

    /// Reads the text of a model file; `path` is named in errors.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn from_toml(text: &str, path: &Path) -> Result<Self> {
        let parsed = DeTable::parse(text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            Error::File { path: path.into(), message: format!("line {line}: {}; a model file is TOML", error.message()) }
        })?;
        let file = Section { path, text, name: "", table: parsed.get_ref() };
        file.allow(&["model", "rotor", "data", "effect", "correlation", "provenance"])?;
        let model = file.section("model", "model")?.ok_or_else(|| file.fault("model", "no such table", "a table `[model]`"))?;
        model.allow(&["format", "name", "mass_kg", "inertia", "rotor_radius_m", "vehicle", "baseline"])?;
        let format = read_format(&model)?;
        let (mass, inertia, radius) = (model.number("mass_kg")?, model.numbers("inertia")?, model.number("rotor_radius_m")?);
        let assumed = Assumed { mass: mass.is_none(), inertia: inertia.is_none(), rotor_radius: radius.is_none() };
        let (mass_kg, rotor_radius_m) = (mass.unwrap_or(NOMINAL_MASS_KG), radius.unwrap_or(NOMINAL_ROTOR_RADIUS_M));
        let inertia = inertia.unwrap_or(NOMINAL_INERTIA);
        if let Some(vehicle::Fault { field, found, expected }) = vehicle::fault(mass_kg, inertia, rotor_radius_m) {
            return Err(model.fault(field, found, expected));
        }
        let vehicle = read_vehicle(&model)?;
        let effects = read_effects(&file, &model, (mass_kg, rotor_radius_m))?;
        if format < FORMAT {
            check_meaning(&file, &effects, format)?;
        }
        let provenance = match file.section("provenance", "provenance")? {
            Some(section) => entries(section.table),
            None => BTreeMap::new(),
        };
        let stem = path.file_stem().map_or_else(|| "model".into(), |stem| stem.to_string_lossy().into_owned());
        let result = Self {
            name: model.text("name")?.map_or(stem, str::to_owned),
            mass_kg,
            inertia,
            rotor_radius_m,
            vehicle,
            rotors: file.sections("rotor", "rotor")?.iter().map(read_rotor).collect::<Result<_>>()?,
            assumed,
            effects,
            correlations: file.sections("correlation", "correlation")?.iter().map(read_correlation).collect::<Result<_>>()?,
            data: read_data(&file)?,
            provenance,
        };
        result.check_in(&path.display().to_string())?;
        Ok(result)
    }

    /// Writes a model file, in one step: a reader sees the old file or the new one.
    ///
    /// # Errors
    /// [`Error::Io`]; as [`Model::to_toml`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let text = self.to_toml()?;
        crate::disk::write_atomically(path, |out| out.write_all(text.as_bytes()))
    }

    /// The model as the text of a model file, every effect written out.
    ///
    /// # Errors
    /// [`Error::Config`] if the model would not read back the same: an effect that is neither built in nor a single formula, or
    /// a value or interval that is no finite number.
    pub fn to_toml(&self) -> Result<String> {
        let mut text = String::new();
        let [ix, iy, iz] = self.inertia;
        self.check_numbers()?;
        // Writing to a String does not fail.
        let _ = writeln!(text, "[model]\nformat = {FORMAT}\nname = {}", quoted(&self.name));
        // A number that nobody gave stays a comment, so that whoever reads the file asks for it, too.
        let mut number = |assumed: bool, key: &str, value: String| {
            let _ = match assumed {
                false => writeln!(text, "{key} = {value}"),
                true => writeln!(text, "# {key} = {value}    # assumed; put yours here"),
            };
        };
        number(self.assumed.mass, "mass_kg", format!("{:?}", self.mass_kg));
        number(self.assumed.inertia, "inertia", format!("[{ix:?}, {iy:?}, {iz:?}]"));
        number(self.assumed.rotor_radius, "rotor_radius_m", format!("{:?}", self.rotor_radius_m));
        let _ = writeln!(text, "vehicle = {}", quoted(self.vehicle.name()));
        self.rotors.iter().for_each(|rotor| write_rotor(&mut text, rotor));
        let locked: Vec<String> = self.data.locked.iter().map(|name| quoted(name)).collect();
        let _ = writeln!(text, "\n[data]\ncontrol_delay_s = {:?}\nlocked = [{}]", self.data.control_delay_s, locked.join(", "));
        let _ = writeln!(text, "split = {}", quoted(&self.data.split.to_string()));
        for effect in &self.effects {
            write_effect(&mut text, effect);
        }
        self.correlations.iter().for_each(|group| write_correlation(&mut text, group));
        if !self.provenance.is_empty() {
            let table = toml::Table::from_iter([("provenance".to_owned(), Entry::Table(self.provenance.clone()).to_toml())]);
            let _ = write!(text, "\n{table}");
        }
        let again = Self::from_toml(&text, Path::new(&self.name))?;
        if again != *self {
            let different = self.effects.iter().zip(&again.effects).find(|(left, right)| left != right);
            let field = different.map_or("provenance".into(), |pair| format!("effect `{}`", pair.0.name));
            let expected = "an effect that a model file can hold: a built-in kind, or one formula with one coefficient".into();
            return Err(Error::Config { place: format!("model `{}`", self.name), field, found: "another form".into(), expected });
        }
        Ok(text)
    }

    /// Refuses what is no number, which no model file holds.
    fn check_numbers(&self) -> Result<()> {
        for effect in &self.effects {
            for coefficient in &effect.coefficients {
                let of_flights = coefficient.by_flight.iter().flatten().map(|(_, value)| *value);
                let mut values = std::iter::once(coefficient.value).chain(coefficient.ci95.into_iter().flatten()).chain(of_flights);
                if let Some(value) = values.find(|value| !value.is_finite()) {
                    return Err(Error::Config {
                        place: format!("model `{}`", self.name),
                        field: format!("{}.{}", effect.name, coefficient.name),
                        found: format!("{value} as its value or an end of its interval"),
                        expected: "finite numbers; calibrate on longer flights".into(),
                    });
                }
            }
        }
        Ok(())
    }
}

fn read_vehicle(model: &Section<'_>) -> Result<Vehicle> {
    let Some(name) = model.text("vehicle")? else { return Ok(Vehicle::default()) };
    Vehicle::ALL.into_iter().find(|vehicle| vehicle.name() == name).ok_or_else(|| {
        let names = Vehicle::ALL.map(Vehicle::name);
        model.fault("vehicle", format!("`{name}`{}", did_you_mean(name, names)), format!("one of `{}`", names.join("`, `")))
    })
}

fn read_data(file: &Section<'_>) -> Result<ModelData> {
    let Some(section) = file.section("data", "data")? else { return Ok(ModelData::default()) };
    section.allow(&["control_delay_s", "locked", "split"])?;
    Ok(ModelData {
        control_delay_s: section.number("control_delay_s")?.unwrap_or_default(),
        locked: section.texts("locked")?,
        split: section.text("split")?.map(|text| read_split(&section, text)).transpose()?.unwrap_or_default(),
    })
}

fn read_split(data: &Section<'_>, text: &str) -> Result<Protocol> {
    text.parse().map_err(|error| match error {
        Error::Config { found, expected, .. } => data.fault("split", found, expected),
        other => other,
    })
}

/// The effects of the baseline, if one is named, with those that the file lists in their places or behind them.
fn read_effects(file: &Section<'_>, model: &Section<'_>, (mass_kg, rotor_radius_m): (f64, f64)) -> Result<Vec<Effect>> {
    let mut effects = match model.text("baseline")? {
        None => Vec::new(),
        Some(PAPER) => baseline::definitions().iter().map(|definition| definition.effect(mass_kg, rotor_radius_m)).collect(),
        Some(other) => {
            return Err(model.fault("baseline", format!("`{other}`{}", did_you_mean(other, [PAPER])), "`paper`, or none"));
        }
    };
    let mut listed: Vec<String> = Vec::new();
    for section in file.sections("effect", "effect")? {
        let effect = read_effect(&section, mass_kg, rotor_radius_m)?;
        if listed.contains(&effect.name) {
            let found = format!("a second effect `{}`", effect.name);
            return Err(section.fault("kind", found, "effects with names of their own; set `name`"));
        }
        listed.push(effect.name.clone());
        match effects.iter_mut().find(|known| known.name == effect.name) {
            Some(known) if known.kind != effect.kind => {
                let found = format!("`{}`, the name of an effect of the baseline", effect.name);
                return Err(section.fault("name", found, "another name"));
            }
            Some(known) => *known = effect,
            None => effects.push(effect),
        }
    }
    Ok(effects)
}

/// Keys of every effect.
const COMMON_KEYS: [&str; 7] = ["kind", "name", "enabled", "ci95", "added_by", "parameters", "flights"];

/// That a key of an effect is not there.
fn missing(section: &Section<'_>, key: &str) -> Error {
    section.fault(key, "nothing", format!("`{key} = …` in this [[effect]]"))
}

fn read_effect(section: &Section<'_>, mass_kg: f64, rotor_radius_m: f64) -> Result<Effect> {
    let kind = section.text("kind")?.ok_or_else(|| missing(section, "kind"))?;
    let mut effect = match kind {
        FORMULA_KIND => read_formula(section)?,
        _ => read_known(section, kind, mass_kg, rotor_radius_m)?,
    };
    read_intervals(section, &mut effect)?;
    read_flights(section, &mut effect)?;
    effect.enabled = section.flag("enabled")?.unwrap_or(true);
    effect.added_by = section.text("added_by")?.map(str::to_owned);
    effect
        .check(&section.path.display().to_string())
        .map_err(|error| located(section, "formula", &format!("effect `{}`", effect.name), error))?;
    Ok(effect)
}

/// An effect that is a formula of the user's.
fn read_formula(section: &Section<'_>) -> Result<Effect> {
    section.allow(&[&COMMON_KEYS[..], &["channel", "changes", "formula", "coefficient", "unit"]].concat())?;
    let name = section.text("name")?.ok_or_else(|| missing(section, "name"))?;
    let formula = section.text("formula")?.ok_or_else(|| missing(section, "formula"))?;
    let value = section.number("coefficient")?.unwrap_or_default();
    let made = match (section.text("channel")?, section.text("changes")?) {
        (Some(channel), None) => Effect::formula(name, channel_named(section, channel)?, formula, value),
        (None, Some(signal)) => {
            if !changeable(signal) || (signal_named(signal).is_none() && !standard_names().contains(&signal)) {
                let names = || SIGNALS.iter().map(|signal| signal.name).filter(|name| changeable(name));
                let found = format!("`{signal}`{}", did_you_mean(signal, names()));
                return Err(section.fault("changes", found, format!("one of `{}`", names().collect::<Vec<_>>().join("`, `"))));
            }
            Effect::change(name, signal, formula, value)
        }
        (None, None) => return Err(missing(section, "channel")),
        (Some(_), Some(_)) => {
            let expected = "one of both: `channel` for an acceleration, `changes` for a signal";
            return Err(section.fault("changes", "beside `channel`", expected));
        }
    };
    let mut effect = made.map_err(|error| located(section, "formula", &format!("effect `{name}`"), error))?;
    if let (Some(unit), Some(coefficient)) = (section.text("unit")?, effect.coefficient_mut(FORMULA_COEFFICIENT)) {
        coefficient.unit = unit.into();
    }
    if let Some(parameters) = section.section("parameters", "effect.parameters")? {
        for name in parameters.keys() {
            let value = parameters.number(name)?.unwrap_or_default();
            effect.parameters.push(Parameter { name: name.into(), value, unit: String::new(), fixed: true, ci95: None });
        }
    }
    Ok(effect)
}

/// An effect of the catalogue.
fn read_known(section: &Section<'_>, kind: &str, mass_kg: f64, rotor_radius_m: f64) -> Result<Effect> {
    let definition = catalogue::definition(kind).ok_or_else(|| {
        let known: Vec<&str> = catalogue::kinds().chain([FORMULA_KIND]).collect();
        let hint = did_you_mean(kind, known.iter().copied());
        let all = || format!("one of `{}`", known.join("`, `"));
        let expected = if hint.is_empty() { all() } else { "an effect of `phyture effect list`, or `formula`".into() };
        section.fault("kind", format!("`{kind}`{hint}"), expected)
    })?;
    let mut effect = definition.effect(mass_kg, rotor_radius_m);
    section.allow(&[&COMMON_KEYS[..], &["coefficients"]].concat())?;
    if let Some(name) = section.text("name")? {
        effect.name = name.into();
    }
    if let Some(values) = section.section("coefficients", "effect.coefficients")? {
        values.allow(&names(&effect))?;
        for coefficient in &mut effect.coefficients {
            coefficient.value = values.number(&coefficient.name)?.unwrap_or_default();
        }
    }
    if let Some(values) = section.section("parameters", "effect.parameters")? {
        values.allow(&effect.parameters.iter().map(|parameter| parameter.name.as_str()).collect::<Vec<_>>())?;
        for parameter in &mut effect.parameters {
            parameter.value = values.number(&parameter.name)?.unwrap_or(parameter.value);
        }
    }
    Ok(effect)
}

fn read_intervals(section: &Section<'_>, effect: &mut Effect) -> Result<()> {
    let Some(intervals) = section.section("ci95", "effect.ci95")? else { return Ok(()) };
    intervals.allow(&numbers(effect))?;
    let of_coefficients = effect.coefficients.iter_mut().map(|c| (&c.name, &mut c.ci95));
    for (name, ci95) in of_coefficients.chain(effect.parameters.iter_mut().map(|p| (&p.name, &mut p.ci95))) {
        *ci95 = intervals.numbers(name)?;
        if let Some([low, high]) = ci95.filter(|interval| interval[0] > interval[1]) {
            return Err(intervals.fault(name, format!("[{low}, {high}]"), "the lower end first"));
        }
    }
    Ok(())
}

/// Numbers that belong to a flight.
fn read_flights(section: &Section<'_>, effect: &mut Effect) -> Result<()> {
    let Some(flights) = section.section("flights", "effect.flights")? else { return Ok(()) };
    for flight in flights.keys() {
        let Some(values) = flights.section(flight, "effect.flights")? else { continue };
        let own = effect.coefficients.iter_mut().filter_map(|c| c.by_flight.as_mut().map(|by_flight| (&c.name, by_flight)));
        let own: Vec<_> = own.collect();
        values.allow(&own.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>())?;
        for (name, by_flight) in own {
            if let Some(value) = values.number(name)? {
                by_flight.insert(flight.to_owned(), value);
            }
        }
    }
    Ok(())
}

fn read_correlation(section: &Section<'_>) -> Result<Correlation> {
    section.allow(&["numbers", "below"])?;
    let group = Correlation { numbers: section.texts("numbers")?, below: section.list("below")? };
    match group.fault() {
        Some(expected) => Err(section.fault("below", format!("{} for {}", group.below.len(), group.numbers.len()), expected)),
        None => Ok(group),
    }
}

/// One line a row.
fn write_correlation(text: &mut String, group: &Correlation) {
    let numbers: Vec<String> = group.numbers.iter().map(|number| quoted(number)).collect();
    let mut left = group.below.as_slice();
    let rows = (1..group.numbers.len()).map(|row| {
        let (own, rest) = left.split_at(row);
        left = rest;
        let values: Vec<String> = own.iter().map(|value| format!("{value:?}")).collect();
        format!("    {},\n", values.join(", "))
    });
    let rows: String = rows.collect();
    // Writing to a String does not fail.
    let _ = write!(text, "\n[[correlation]]\nnumbers = [{}]\nbelow = [\n{rows}]\n", numbers.join(", "));
}

fn names(effect: &Effect) -> Vec<&str> {
    effect.coefficients.iter().map(|coefficient| coefficient.name.as_str()).collect()
}

/// Names of everything that may have an interval.
fn numbers(effect: &Effect) -> Vec<&str> {
    names(effect).into_iter().chain(effect.parameters.iter().map(|parameter| parameter.name.as_str())).collect()
}

/// The index of an acceleration by name.
fn channel_named(section: &Section<'_>, channel: &str) -> Result<Channel> {
    let names = Channel::ALL.map(Channel::name);
    Channel::from_name(channel).ok_or_else(|| {
        let found = format!("`{channel}`{}", did_you_mean(channel, names));
        section.fault("channel", found, format!("one of `{}`", names.join("`, `")))
    })
}

/// Puts file and line before a formula error.
pub(super) fn located(section: &Section<'_>, key: &str, owner: &str, error: Error) -> Error {
    let Error::Formula { message, formula, at } = error else { return error };
    match section.fault(key, "", "") {
        Error::Config { place, .. } => {
            let own = format!("{owner}: ");
            let message = message.strip_prefix(&own).unwrap_or(&message);
            Error::Formula { message: format!("{place}, {own}{message}"), formula, at }
        }
        other => other,
    }
}

fn write_effect(text: &mut String, effect: &Effect) {
    text.push_str("\n[[effect]]\n");
    let mut line = |key: &str, value: String| {
        let _ = writeln!(text, "{key} = {value}");
    };
    line("kind", quoted(&effect.kind));
    if effect.name != effect.kind {
        line("name", quoted(&effect.name));
    }
    if !effect.enabled {
        line("enabled", "false".into());
    }
    if let Some(added_by) = &effect.added_by {
        line("added_by", quoted(added_by));
    }
    let table = |entries: Vec<(&str, String)>| {
        let entries: Vec<String> = entries.into_iter().map(|(name, value)| format!("{} = {value}", key(name))).collect();
        format!("{{ {} }}", entries.join(", "))
    };
    if effect.kind == FORMULA_KIND {
        if let Some(term) = effect.terms.first() {
            line("channel", quoted(term.channel.name()));
            line("formula", quoted(&term.regressor.to_string()));
        } else if let Some((signal, formula)) = effect.own_change() {
            line("changes", quoted(signal));
            line("formula", quoted(&formula));
        }
        if let Some(coefficient) = effect.coefficients.first() {
            line("coefficient", format!("{:?}", coefficient.value));
            line("unit", quoted(&coefficient.unit));
        }
    } else if !effect.coefficients.is_empty() {
        line("coefficients", table(effect.coefficients.iter().map(|c| (c.name.as_str(), format!("{:?}", c.value))).collect()));
    }
    if !effect.parameters.is_empty() {
        line("parameters", table(effect.parameters.iter().map(|p| (p.name.as_str(), format!("{:?}", p.value))).collect()));
    }
    let of_coefficients = effect.coefficients.iter().map(|c| (c.name.as_str(), c.ci95));
    let of_parameters = effect.parameters.iter().map(|p| (p.name.as_str(), p.ci95));
    let intervals: Vec<(&str, String)> = of_coefficients
        .chain(of_parameters)
        .filter_map(|(name, ci95)| ci95.map(|[low, high]| (name, format!("[{low:?}, {high:?}]"))))
        .collect();
    if !intervals.is_empty() {
        line("ci95", table(intervals));
    }
    let mut flights: BTreeMap<&str, Vec<(&str, String)>> = BTreeMap::new();
    for coefficient in &effect.coefficients {
        for (flight, value) in coefficient.by_flight.iter().flatten() {
            flights.entry(flight).or_default().push((&coefficient.name, format!("{value:?}")));
        }
    }
    if !flights.is_empty() {
        line("flights", table(flights.into_iter().map(|(flight, values)| (flight, table(values))).collect()));
    }
}

/// Text as a TOML string.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// A key, quoted if it must be.
fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.into() } else { quoted(name) }
}

fn entries(table: &DeTable<'_>) -> BTreeMap<String, Entry> {
    table.iter().map(|(key, value)| (key.get_ref().to_string(), Entry::from_toml(value.get_ref()))).collect()
}

impl Entry {
    fn from_toml(value: &DeValue<'_>) -> Self {
        match value {
            DeValue::String(text) => Self::Text(text.to_string()),
            DeValue::Boolean(flag) => Self::Boolean(*flag),
            DeValue::Datetime(datetime) => Self::Text(datetime.to_string()),
            DeValue::Integer(integer) => match i64::from_str_radix(integer.as_str(), integer.radix()) {
                Ok(integer) => Self::Integer(integer),
                Err(_) => Self::Text(integer.to_string()),
            },
            DeValue::Float(float) => number(value).map_or_else(|| Self::Text(float.as_str().into()), Self::Number),
            DeValue::Array(values) => Self::List(values.iter().map(|value| Self::from_toml(value.get_ref())).collect()),
            DeValue::Table(table) => Self::Table(entries(table)),
        }
    }

    fn to_toml(&self) -> toml::Value {
        match self {
            Self::Text(text) => toml::Value::String(text.clone()),
            Self::Integer(integer) => toml::Value::Integer(*integer),
            Self::Number(number) => toml::Value::Float(*number),
            Self::Boolean(flag) => toml::Value::Boolean(*flag),
            Self::List(values) => toml::Value::Array(values.iter().map(Self::to_toml).collect()),
            Self::Table(table) => toml::Value::Table(table.iter().map(|(key, value)| (key.clone(), value.to_toml())).collect()),
        }
    }
}
