//! `dataset.toml`: how logs that are not in the canonical form are to be read. Strict: an unknown key is an error.
//!
//! This file parses the description and checks what can be checked without a log; applying it is `assemble`'s. The rules for
//! bad cells and those of single logs are in `repairs` and `single_logs`. The keys:
//!
//! | key | meaning |
//! | --- | --- |
//! | `axes` | `"NED/FRD"` (default), `"ENU/FLU"`, `"NWU/FLU"`: axes of position, attitude, velocity, rates and accelerations |
//! | `quaternion` | order of `q1 q2 q3 q4`: `"xyzw"` (default, scalar last) or `"wxyz"` (scalar first) |
//! | `velocity` | `"body"` (default) or `"inertial"`: components of `vx vy vz` |
//! | `targets` | what `vx_dot vy_dot vz_dot` hold: `"derivative"` (default) of the body components; `"specific_force"`, as an accelerometer; `"inertial"`, the derivative of the inertial velocity in inertial axes; `"body_acceleration"`, the same in body axes |
//! | `target_origin` | `"recorded"` (default) or `"derived"`: accelerations in the file that were computed from `v` and `w` |
//! | `[columns]` | `vx = "v_nose"`, a column of the file, or a formula of its columns, or a list of which the first that the file can give is taken |
//! | `[units]` | unit by column or group: `angles = "deg"`, `rates = "deg/s"`, `acceleration = "g"`, `vx = "ft/s"` |
//! | `[late]` | seconds by which a group of `[units]`, or a column, comes later than the rest (negative: earlier): `angles = 0.04` |
//! | `[drift]` | how that grows along a log, s for each second since its first row: a stream with a clock of its own: `controls = -0.005` |
//! | `[[late_in]]` | `flights` and the same for those alone, on top of `[late]`: logs of one set that were joined differently |
//! | `[[cut]]` | `flights` and `at`, times in s: where rows are lost that no gap in time shows, or parts were joined; what lies before and behind becomes a flight each |
//! | `missing` | columns the logs lack: position, `yaw`, accelerations |
//! | `use` | rows to use: a formula with a comparison, or a list that must all hold, in canonical and further columns and `height airspeed alpha beta g_x g_y g_z` |
//! | `minimum_length_s` | pieces that `use` or gaps leave shorter than this are left out, with a note |
//! | `resample_hz` | rate to resample to |
//! | `cutoff_hz` | −3 dB frequency of the differentiator where accelerations are derived |
//! | `smooth_controls` | `true`: controls are held to the band of the derived accelerations |
//! | `manoeuvre` | `"folder"` (default), or `{ separator = "_", part = 1 }` of the file's name |
//! | `[classes]` | manoeuvre class = flights, by name: classes that neither folders nor names of files tell; before `manoeuvre` |
//! | `damaged` | `"refuse"` (default) or `"stop"`: a binary log that ends within a message, or is damaged, is read up to there, with a note |
//! | `exclude` | sub-folders or files that are not flights of this set |
//! | `leave_out` | flights, by their names, that are read and then left out, with a note |
//! | `ignore`, `extra` | columns not to read; the only further columns to keep |
//! | `[[repair]]` | `columns`, `valid` (comparisons of `value`), `held` (rows that repeat all of `columns` are bad), `zero` (rows in which all of them are 0), `spike` (cells that stick out by so much), `max_gap_s`: bad cells to interpolate linearly, or with `between = "cubic"`; `longer = "cut"`: where more of them follow each other the flight is cut; `set_aside_s`: rows so near a bridged cell are neither fitted nor judged |
//! | `notes` | sentences to carry to every reader of the data |

use super::attitude::{Axes, QuaternionOrder};
use super::bounds::RATES_HZ;
use super::keys::Keys;
use super::late::Late;
use super::{Column, Targets, units};
use crate::error::{Error, Result};
use crate::formula::Formula;
use repairs::repairs;
pub(crate) use repairs::{Between, Longer, Repair};
use single_logs::of_single_logs;
pub(crate) use single_logs::{Cut, LateIn, OfLog};
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

mod repairs;
mod single_logs;

/// Components the file's velocity is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frame {
    Body,
    Inertial,
}

/// What the file's `vx_dot vy_dot vz_dot` hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TargetKind {
    /// Derivative of the body components of velocity.
    Derivative,
    /// Accelerometer: non-gravitational force by mass, body axes.
    SpecificForce,
    /// Derivative of the inertial velocity, inertial axes.
    Inertial,
    /// Derivative of the inertial velocity, body axes.
    BodyAcceleration,
}

/// How a flight's manoeuvre is named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Manoeuvre {
    /// After the folder the file is in.
    Folder,
    /// After one part (counted from 1) of the file's name without its ending.
    FilePart { separator: String, part: usize },
}

/// What is done with a binary log that is damaged from some place on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Damaged {
    /// It is an error.
    Refuse,
    /// It is read up to there.
    Stop,
}

/// A parsed `dataset.toml`; the default is the canonical form.
#[derive(Clone, Debug)]
pub(crate) struct Schema {
    pub axes: Axes,
    pub velocity: Frame,
    pub targets: TargetKind,
    pub target_origin: Targets,
    /// Alternatives by canonical name: columns of the file, or formulas.
    pub columns: BTreeMap<String, Vec<String>>,
    /// What the formulas among these read. Every field of a binary log is held against it: parsing them for each would take a file of a hundred
    /// thousand fields minutes.
    pub read: BTreeSet<String>,
    /// Factor to SI by canonical name; 1 if absent.
    pub factors: BTreeMap<&'static str, f64>,
    /// By how much a column comes later than the rest.
    pub late: BTreeMap<Column, Late>,
    /// What comes on top of that in some flights.
    pub late_in: Vec<LateIn>,
    pub cuts: Vec<Cut>,
    /// Where the log at hand is cut, s.
    pub cut_at_s: Vec<f64>,
    pub missing: Vec<Column>,
    pub rows: Vec<Formula>,
    pub minimum_length_s: f64,
    pub resample_hz: Option<f64>,
    /// −3 dB frequency of the differentiator; `None` for its default, lowered where the rate demands it.
    pub cutoff_hz: Option<f64>,
    /// Whether the controls go through the low-pass that deriving is for the accelerations.
    pub smooth_controls: bool,
    pub manoeuvre: Manoeuvre,
    /// Class by flight, as a person writes it; goes before `manoeuvre`.
    pub classes: BTreeMap<String, String>,
    pub damaged: Damaged,
    pub exclude: Vec<String>,
    pub leave_out: Vec<String>,
    pub ignore: Vec<String>,
    pub extra: Option<Vec<String>>,
    pub repairs: Vec<Repair>,
    pub notes: Vec<String>,
    /// Order of `q1 q2 q3 q4`.
    pub quaternion: QuaternionOrder,
    /// What the file states, key by key; see [`super::Source::stated`].
    pub stated: BTreeMap<String, String>,
}

impl Default for Schema {
    fn default() -> Self {
        Self {
            axes: Axes::NedFrd,
            velocity: Frame::Body,
            targets: TargetKind::Derivative,
            target_origin: Targets::Recorded,
            columns: BTreeMap::new(),
            read: BTreeSet::new(),
            factors: BTreeMap::new(),
            late: BTreeMap::new(),
            late_in: Vec::new(),
            cuts: Vec::new(),
            cut_at_s: Vec::new(),
            missing: Vec::new(),
            rows: Vec::new(),
            minimum_length_s: 0.0,
            resample_hz: None,
            cutoff_hz: None,
            smooth_controls: false,
            manoeuvre: Manoeuvre::Folder,
            classes: BTreeMap::new(),
            damaged: Damaged::Refuse,
            exclude: Vec::new(),
            leave_out: Vec::new(),
            ignore: Vec::new(),
            extra: None,
            repairs: Vec::new(),
            notes: Vec::new(),
            quaternion: QuaternionOrder::ScalarLast,
            stated: BTreeMap::new(),
        }
    }
}

const FRAMES: [(&str, Frame); 2] = [("body", Frame::Body), ("inertial", Frame::Inertial)];
const ORIGINS: [(&str, Targets); 2] = [("recorded", Targets::Recorded), ("derived", Targets::Derived)];
const DAMAGED: [(&str, Damaged); 2] = [("refuse", Damaged::Refuse), ("stop", Damaged::Stop)];
const TARGETS: [(&str, TargetKind); 4] = [
    ("derivative", TargetKind::Derivative),
    ("specific_force", TargetKind::SpecificForce),
    ("inertial", TargetKind::Inertial),
    ("body_acceleration", TargetKind::BodyAcceleration),
];
/// Canonical columns that a log may lack besides the six accelerations.
const MAY_LACK: [Column; 4] = [Column::X, Column::Y, Column::Z, Column::Yaw];

/// Keys that hold for columns that are canonical already, or for whole logs.
const OF_CANONICAL_COLUMNS: [&str; 12] = [
    "use",
    "minimum_length_s",
    "resample_hz",
    "late",
    "drift",
    "late_in",
    "cut",
    "manoeuvre",
    "classes",
    "exclude",
    "leave_out",
    "notes",
];

impl Schema {
    /// Understands a `dataset.toml`; `place` is named in errors.
    ///
    /// # Errors
    /// [`Error::File`] for bytes that are not TOML; [`Error::Config`] by key; [`Error::Formula`] for a filter.
    pub fn parse(bytes: &[u8], place: &str) -> Result<Self> {
        let not_toml = |message: &str| Error::File { path: place.into(), message: format!("is not TOML: {message}") };
        let text = std::str::from_utf8(bytes).map_err(|error| not_toml(&format!("{error}, so it is not text in UTF-8")))?;
        let table: Table = text.parse().map_err(|error: toml::de::Error| not_toml(error.to_string().trim_end()))?;
        let stated = stated(&table);
        let mut keys = Keys::new(place, "", table);
        let mut schema = Self {
            axes: keys.choice("axes", &Axes::NAMES)?.unwrap_or_default(),
            velocity: keys.choice("velocity", &FRAMES)?.unwrap_or(Frame::Body),
            targets: keys.choice("targets", &TARGETS)?.unwrap_or(TargetKind::Derivative),
            target_origin: keys.choice("target_origin", &ORIGINS)?.unwrap_or(Targets::Recorded),
            rows: formulas(&keys.texts("use")?.unwrap_or_default(), &format!("{place}, `use`"), &[])?,
            minimum_length_s: keys.number("minimum_length_s", 0.0)?.unwrap_or(0.0),
            resample_hz: keys.number("resample_hz", f64::MIN_POSITIVE)?,
            cutoff_hz: keys.number("cutoff_hz", f64::MIN_POSITIVE)?,
            smooth_controls: keys.flag("smooth_controls")?.unwrap_or(false),
            quaternion: keys.choice("quaternion", &QuaternionOrder::NAMES)?.unwrap_or_default(),
            stated,
            exclude: keys.texts("exclude")?.unwrap_or_default(),
            leave_out: keys.texts("leave_out")?.unwrap_or_default(),
            ignore: keys.texts("ignore")?.unwrap_or_default(),
            extra: keys.texts("extra")?,
            notes: keys.texts("notes")?.unwrap_or_default(),
            manoeuvre: manoeuvre(&mut keys)?,
            classes: classes(&mut keys)?,
            missing: missing(&mut keys)?,
            damaged: keys.choice("damaged", &DAMAGED)?.unwrap_or(Damaged::Refuse),
            ..Self::default()
        };
        if let Some(hz) = schema.resample_hz.filter(|hz| !RATES_HZ.contains(hz)) {
            let expected = format!("a rate from {} to {} Hz", RATES_HZ.start(), RATES_HZ.end());
            return Err(keys.fault("resample_hz", hz.to_string(), expected));
        }
        if let Some(mut columns) = keys.section("columns")? {
            for name in units::column_names() {
                if let Some(sources) = columns.texts(name)? {
                    if sources.is_empty() {
                        return Err(columns.fault(name, "an empty list".into(), "a column's name or a formula".into()));
                    }
                    let formulas = sources.iter().filter_map(|source| Formula::parse(source).ok());
                    formulas.for_each(|formula| schema.read.extend(formula.names().into_iter().map(str::to_owned)));
                    schema.columns.insert(name.into(), sources);
                }
            }
            columns.finish()?;
        }
        if let Some(units) = keys.section("units")? {
            schema.factors = factors(units)?;
        }
        if let Some(mut late) = keys.section("late")? {
            schema.late = late.times()?.into_iter().map(|(column, s)| (column, Late { s, drift: 0.0 })).collect();
            late.finish()?;
        }
        if let Some(mut drift) = keys.section("drift")? {
            drift.drifts()?.into_iter().for_each(|(column, drift)| schema.late.entry(column).or_default().drift = drift);
            drift.finish()?;
        }
        (schema.late_in, schema.cuts) = of_single_logs(&mut keys)?;
        schema.repairs = repairs(&mut keys, place)?;
        for column in schema.repairs.iter().filter(|rule| rule.held).flat_map(|rule| &rule.columns) {
            schema.stated.insert(format!("held.{column}"), "interpolated".into());
        }
        keys.finish()?;
        Ok(schema)
    }

    /// The same for one log, of which it is known what is said of it alone.
    pub fn for_log(&self, own: &OfLog<'_>) -> Self {
        let mut schema = Self { cut_at_s: own.cut_at_s.clone(), ..self.clone() };
        for (&column, late_s) in own.late.iter().flat_map(|rule| &rule.late) {
            schema.late.entry(column).or_default().s += late_s;
        }
        schema.late.retain(|_, late| *late != Late::default());
        schema
    }

    /// The same for a layout that makes canonical columns by itself: what these are made of is not for the description to say.
    pub fn of_canonical_columns(&self) -> Self {
        let Self { rows, minimum_length_s, resample_hz, late, cut_at_s, .. } = self.clone();
        Self { rows, minimum_length_s, resample_hz, late, cut_at_s, ..Self::default() }
    }

    /// The keys that are stated and do not hold for such a layout.
    pub fn not_of_canonical_columns(&self) -> BTreeSet<&str> {
        let keys = self.stated.keys().filter_map(|key| key.split('.').next());
        keys.filter(|key| !OF_CANONICAL_COLUMNS.contains(key)).collect()
    }

    /// A full turn in the unit of a column of the file, if that is an angle which wraps round: a straight line over a wrap is no bridge.
    pub fn turn_of(&self, of_file: &str) -> Option<f64> {
        let is_read = |angle: &&str| match self.columns.get(*angle) {
            None => *angle == of_file,
            Some(sources) => sources.iter().any(|source| source == of_file),
        };
        let angle = ["roll", "yaw"].into_iter().find(is_read)?;
        Some(std::f64::consts::TAU / self.factor(angle))
    }

    /// Columns that come late and are made by formulas that remember.
    pub fn filtered(&self) -> BTreeSet<Column> {
        let remembers = |source: &String| Formula::parse(source).is_ok_and(|formula| formula.remembers());
        let is_filtered = |column: &&Column| self.columns.get(column.name()).is_some_and(|sources| sources.iter().any(remembers));
        self.late.keys().filter(is_filtered).copied().collect()
    }

    /// Factor to SI of a canonical column.
    pub fn factor(&self, column: &str) -> f64 {
        self.factors.get(column).copied().unwrap_or(1.0)
    }

    /// Whether a column of a file is to be read at all.
    pub fn wants(&self, name: &str) -> bool {
        if self.ignore.iter().any(|ignored| ignored == name) {
            return false;
        }
        let Some(extra) = &self.extra else { return true };
        let names = |formula: &Formula| formula.names().contains(&name);
        extra.iter().any(|kept| kept == name)
            || units::column_names().any(|canonical| canonical == name)
            || self.read.contains(name)
            || self.columns.values().flatten().any(|source| source == name)
            || self.rows.iter().any(names)
            || self.repairs.iter().any(|rule| rule.columns.iter().any(|column| column == name))
    }
}

/// The texts of a description by dotted key; the unit of a group under each of its columns, where these have none of their own.
fn stated(table: &Table) -> BTreeMap<String, String> {
    let mut stated = BTreeMap::new();
    for (key, value) in table {
        match value {
            Value::Table(inside) => {
                let text = |value: &Value| match value {
                    Value::String(text) => Some(text.clone()),
                    Value::Float(_) | Value::Integer(_) => Some(value.to_string()),
                    _ => None,
                };
                stated.extend(inside.iter().filter_map(|(name, value)| Some((format!("{key}.{name}"), text(value)?))));
            }
            Value::String(text) => {
                stated.insert(key.clone(), text.clone());
            }
            other => {
                stated.insert(key.clone(), other.to_string());
            }
        }
    }
    for group in units::GROUPS {
        let Some(unit) = stated.get(&format!("units.{}", group.name)).cloned() else { continue };
        for column in group.columns {
            stated.entry(format!("units.{column}")).or_insert_with(|| unit.clone());
        }
    }
    stated
}

/// Formulas of a key; of these names alone, where there are any.
fn formulas(texts: &[String], place: &str, names: &[&str]) -> Result<Vec<Formula>> {
    let one = |text: &String| {
        let formula = Formula::parse(text)?;
        if names.is_empty() { Ok(formula) } else { formula.check_names(names).map(|()| formula) }
    };
    texts.iter().map(one).collect::<Result<_>>().map_err(|error| error.standing_in(place))
}

fn manoeuvre(keys: &mut Keys) -> Result<Manoeuvre> {
    const EXPECTED: &str = "\"folder\", or { separator = \"_\", part = 1 } with a part counted from 1";
    match keys.take("manoeuvre") {
        None => Ok(Manoeuvre::Folder),
        Some(Value::String(text)) if text == "folder" => Ok(Manoeuvre::Folder),
        Some(Value::Table(table)) => {
            let mut rule = Keys::new(&keys.place, "manoeuvre.", table);
            let separator = rule.text("separator")?.unwrap_or_else(|| "_".into());
            let part = rule.number("part", 1.0)?.unwrap_or(1.0);
            rule.finish()?;
            if separator.is_empty() || part.fract() != 0.0 {
                return Err(keys.fault("manoeuvre", format!("separator `{separator}`, part {part}"), EXPECTED.into()));
            }
            Ok(Manoeuvre::FilePart { separator, part: part as usize })
        }
        Some(other) => Err(keys.fault("manoeuvre", other.to_string(), EXPECTED.into())),
    }
}

/// `missing`, of the columns that may be.
fn missing(keys: &mut Keys) -> Result<Vec<Column>> {
    let names = keys.texts("missing")?.unwrap_or_default();
    let allowed = || MAY_LACK.into_iter().chain(Column::TARGETS);
    let column = |name: String| {
        let names = || allowed().map(Column::name).collect::<Vec<&str>>().join(", ");
        let known = allowed().find(|column| column.name() == name);
        known.ok_or_else(|| keys.fault("missing", format!("`{name}`"), format!("one of {}", names())))
    };
    names.into_iter().map(column).collect()
}

/// `[classes]`: the class of each flight that is in a list.
fn classes(keys: &mut Keys) -> Result<BTreeMap<String, String>> {
    const EXPECTED: &str = "names of flights by class, as in hover = [\"log_12\", \"log_14\"]";
    let table = match keys.take("classes") {
        None => return Ok(BTreeMap::new()),
        Some(Value::Table(table)) => table,
        Some(other) => return Err(keys.fault("classes", other.to_string(), EXPECTED.into())),
    };
    let mut classes = BTreeMap::new();
    for (class, flights) in table {
        let flights = match flights {
            Value::Array(flights) => flights,
            one => vec![one],
        };
        for flight in flights {
            let Value::String(flight) = flight else {
                return Err(keys.fault(&format!("classes.{class}"), flight.to_string(), EXPECTED.into()));
            };
            if let Some(other) = classes.insert(flight.clone(), class.clone()).filter(|other| *other != class) {
                let found = format!("`{flight}`, which `classes.{other}` has, too");
                return Err(keys.fault(&format!("classes.{class}"), found, "each flight in one class".into()));
            }
        }
    }
    Ok(classes)
}

/// `[units]`: a group's word first, a single column's unit over it.
fn factors(mut keys: Keys) -> Result<BTreeMap<&'static str, f64>> {
    let mut factors = BTreeMap::new();
    for single in [false, true] {
        for group in units::GROUPS {
            let words: &[&'static str] = if single { group.columns } else { &[group.name] };
            for &word in words {
                let Some(unit) = keys.text(word)? else { continue };
                let Some(factor) = group.factor(&unit) else {
                    return Err(keys.fault(word, format!("`{unit}`"), format!("one of {}", group.unit_names().join(", "))));
                };
                let columns: &[&'static str] = if single { &[word] } else { group.columns };
                factors.extend(columns.iter().map(|&column| (column, factor)));
            }
        }
    }
    keys.finish()?;
    Ok(factors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        Schema::parse(text.as_bytes(), "dataset.toml").map_or_else(|error| error.to_string(), |_| "accepted".into())
    }

    #[test]
    fn every_key_is_understood() -> Result<()> {
        let schema = Schema::parse(
            r#"
            axes = "ENU/FLU"
            velocity = "inertial"
            quaternion = "wxyz"
            targets = "specific_force"
            target_origin = "derived"
            missing = ["x", "y", "z"]
            use = ["height > 0.25", "airspeed < 30"]
            minimum_length_s = 2
            resample_hz = 100
            cutoff_hz = 8.0
            manoeuvre = { separator = "-", part = 2 }
            exclude = "parquet"
            ignore = ["comment"]
            extra = ["Vbat"]
            notes = "Heading is derived."
            damaged = "stop"
            [classes]
            hover = ["log_12", "log_14"]
            climb = "log_13"
            [columns]
            vx = ["v_nose", "vn"]
            u4 = "1e-10 * (m1^2 + m2^2)"
            [units]
            angles = "deg"
            yaw = "rad"
            [[repair]]
            columns = ["m1", "m2"]
            valid = ["value > 0", "value < 170000"]
            max_gap_s = 0.1
            "#
            .as_bytes(),
            "dataset.toml",
        )?;
        assert_eq!((schema.axes, schema.velocity, schema.targets), (Axes::EnuFlu, Frame::Inertial, TargetKind::SpecificForce));
        assert_eq!((schema.rows.len(), schema.repairs.len(), schema.missing.len()), (2, 1, 3));
        assert_eq!(schema.manoeuvre, Manoeuvre::FilePart { separator: "-".into(), part: 2 });
        assert_eq!((schema.factor("yaw"), schema.factor("roll")), (1.0, std::f64::consts::PI / 180.0));
        assert_eq!((schema.quaternion, schema.damaged), (QuaternionOrder::ScalarFirst, Damaged::Stop));
        let classes: Vec<(&str, &str)> = schema.classes.iter().map(|(flight, class)| (flight.as_str(), class.as_str())).collect();
        assert_eq!(classes, [("log_12", "hover"), ("log_13", "climb"), ("log_14", "hover")]);
        let stated = |key: &str| schema.stated.get(key).map(String::as_str);
        assert_eq!((stated("units.roll"), stated("units.yaw"), stated("units.vx")), (Some("deg"), Some("rad"), None));
        assert_eq!((stated("quaternion"), stated("columns.u4")), (Some("wxyz"), Some("1e-10 * (m1^2 + m2^2)")));
        assert!(schema.wants("Vbat") && schema.wants("m2") && schema.wants("vn"));
        assert!(!schema.wants("comment") && !schema.wants("gyro_temperature"));
        Ok(())
    }

    #[test]
    fn slips_are_named_with_what_would_be_right() {
        for (text, part) in [
            ("axis = \"NED/FRD\"", "`axis` is an unknown key"),
            ("axis = \"NED/FRD\"", "did you mean `axes`?"),
            ("axes = \"NED\"", "one of NED/FRD, ENU/FLU, NWU/FLU"),
            ("[columns]\nvxx = \"a\"", "`columns.vxx` is an unknown key"),
            ("[units]\nangles = \"degrees\"", "`units.angles` is `degrees`, expected one of rad, deg"),
            ("missing = [\"vx\"]", "`missing` is `vx`, expected one of x, y, z, yaw"),
            ("resample_hz = 0", "`resample_hz` is 0, expected a number above 0"),
            ("resample_hz = 1e9", "`resample_hz` is 1000000000, expected a rate from 2 to 100000 Hz"),
            ("quaternion = \"xyzx\"", "`quaternion` is `xyzx`, expected one of xyzw, wxyz"),
            ("[[repair]]\ncolumns = [\"m1\"]", "an incomplete rule"),
            ("[[repair]]\ncolumns = [\"m1\"]\nmax_gap_s = 1\nlonger = \"split\"", "expected one of error, cut"),
            ("[drift]\ncontrols = 0.2", "`drift.controls` is 0.2, expected a drift from -0.1 to 0.1 s for each second"),
            ("[[late_in]]\ncontrols = 0.01", "`late_in` is an incomplete rule"),
            ("[[cut]]\nflights = \"a\"", "`cut` is an incomplete rule"),
            ("[[cut]]\nflights = \"a\"\nat = [\"b\"]", "`cut.at` is \"b\", expected a number"),
            ("[[late_in]]\nflights = \"a\"\ncontrol = 0.01", "did you mean `controls`?"),
            ("[[late_in]]\nflights = \"a\"\ncontrols = 2", "`late_in.controls` is 2, expected a time from -1 to 1 s"),
            ("[repair]\ncolumns = [\"m1\"]\nmax_gap_s = 1\nvalid = \"m1 > 0\"", "unknown name `m1`"),
            ("[classes]\na = [\"f\"]\nb = \"f\"", "`classes.b` is `f`, which `classes.a` has, too"),
            ("[classes]\na = 3", "`classes.a` is 3, expected names of flights"),
            ("damaged = \"mend\"", "`damaged` is `mend`, expected one of refuse, stop"),
            ("manoeuvre = \"file\"", "`manoeuvre` is \"file\", expected \"folder\""),
            ("use = \"height >\"", "formula"),
            ("use = ", "is not TOML"),
        ] {
            assert!(message(text).contains(part), "{text:?} gave: {}", message(text));
        }
    }
}
