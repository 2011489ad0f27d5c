//! From what a check found at fault to a `dataset.toml` that mends it: what the description in force states, and the lines that the findings print.
//! Nothing is measured here, and nothing is written to a file; how lines are put into a text is [`crate::flight`]'s.
//!
//! Findings speak of columns as the program has them, in its axes and units, and of flights as they were read: a description that states something
//! already is what they come on top of. What cannot be said so, or leaves a choice, is left to a person.

use super::finding::{Finding, Severity};
use super::report::CheckReport;
use crate::critique::wrap::wrapped;
use crate::flight::{Axes, Column, Description, Frame, Schema, Source, TargetKind, Targets, column_names, columns_of};
use crate::formula::{Formula, quoted};
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

/// A description that mends what is at fault, as far as a description can.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suggestion {
    /// All of the `dataset.toml`.
    pub text: String,
    /// The findings of which the line is in it, by name, in their order.
    pub mends: Vec<String>,
    /// The others, with the reason.
    pub open: Vec<Open>,
}

/// A fault that is left to a person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Open {
    /// Of the finding.
    pub name: String,
    /// Why it is in no description.
    pub reason: String,
}

/// Where a person reads what the file is.
const TITLE: &str = "# How these flights are to be read. Above each line stands what `phyture check` found.\n";
/// What stands behind the part of a line that a file can hold.
const FOR_PEOPLE: [&str; 2] = [", with the file's name", ", or leave `quaternion` out"];
/// The column that no axes and no frame change.
const TIME: &str = "t";
/// Lists, to which findings add.
const LISTS: [&str; 3] = ["leave_out", "missing", "ignore"];
/// Sections that can stand several times.
const RULES: [&str; 3] = ["repair", "late_in", "cut"];
/// Of these lists the entries are columns as the file has them.
const OF_COLUMNS: [&str; 2] = ["missing", "ignore"];

impl CheckReport {
    /// What mends the faults that were found in flights of this source. `None` where nothing is at fault, or where the source has a description that is
    /// none.
    pub fn suggestion(&self, source: &Source) -> Option<Suggestion> {
        let is_worth_it = |name: &str| {
            name == super::stamps::NAME
                || [super::streams::SWAMPED_BY_NOISE, super::vibration::VIBRATES].iter().any(|begin| name.starts_with(begin))
        };
        // What a first estimate leaves: of controls that came late by more than is tried, of a clock that runs away, of a large tilt.
        let is_moved = source.moves_controls();
        let moves_sticks = |set: &str| ["[late] u", "[late] controls"].iter().any(|begin| set.starts_with(begin));
        let is_rest = |finding: &Finding| {
            let is_of_sticks = is_moved && finding.set.as_deref().is_some_and(moves_sticks);
            finding.verdict == Severity::Warning && (is_of_sticks || finding.name == super::mounts::STILL)
        };
        let is_mended = |finding: &&Finding| finding.verdict == Severity::Fault || is_worth_it(&finding.name) || is_rest(finding);
        let mut faults = self.findings.iter().filter(is_mended).peekable();
        faults.peek()?;
        let mut draft = Draft::new(self, source)?;
        let (mut mends, mut open) = (Vec::new(), Vec::new());
        let mut faults: Vec<&Finding> = faults.collect();
        let all = faults.clone();
        faults.sort_by_cached_key(|finding| (Tier::of(finding), std::cmp::Reverse(votes(finding, &all))));
        let mut reached = None;
        for finding in faults {
            let (name, tier) = (finding.name.clone(), Tier::of(finding));
            if reached.is_some_and(|reached| reached < tier) && finding.set.is_some() {
                open.push(Open { name, reason: "what is mended first may be its cause; `check` says whether it stays".into() });
                continue;
            }
            match draft.add(finding) {
                Ok(()) => {
                    mends.push(name);
                    reached = Some(tier);
                }
                Err(reason) => open.push(Open { name, reason }),
            }
        }
        Some(Suggestion { text: draft.made.text().to_owned(), mends, open })
    }
}

/// What is mended before what: wrong cells make whole columns look wrong, and wrong columns make flights look odd.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Tier {
    Cells,
    Columns,
    Flights,
}

impl Tier {
    fn of(finding: &Finding) -> Self {
        match finding.set.as_deref() {
            Some(line) if line.starts_with("[[repair]]") || line.starts_with("[[cut]]") => Self::Cells,
            Some(line) if line.starts_with("leave_out") => Self::Flights,
            _ => Self::Columns,
        }
    }
}

/// How many findings speak against the flights that this one leaves out, itself among them; 0 where it leaves out none. Where some flights are not as the
/// others, either may be wrong: those are left out first of which more is said.
fn votes(finding: &Finding, others: &[&Finding]) -> usize {
    let of = |finding: &Finding| -> BTreeSet<String> {
        if Tier::of(finding) == Tier::Flights { finding.flights.iter().cloned().collect() } else { BTreeSet::new() }
    };
    let own = of(finding);
    let is_alike = |other: &&&Finding| {
        let other = of(other);
        own.intersection(&other).count() as f64 > ALIKE * own.union(&other).count() as f64
    };
    others.iter().filter(is_alike).count()
}

/// Two findings are of the same flights where they have more than this part in common of what either names.
const ALIKE: f64 = 0.5;
/// Of the flights that are read, at most this part is left out at once: what more of them have is not theirs.
const LEFT_OUT: f64 = 2.0 / 3.0;

/// A key that is to have a value, in a section ("" before all sections).
type Entry = (&'static str, String, Value);

/// The description while findings are added to it.
struct Draft<'a> {
    source: &'a Source,
    /// How many flights were read.
    flights: usize,
    /// The accelerations stand in no file.
    derived: bool,
    /// As the flights were read.
    stated: Description,
    schema: Schema,
    /// With what was added, and what that set.
    made: Description,
    set: BTreeMap<(&'static str, String), Value>,
}

impl<'a> Draft<'a> {
    fn new(report: &CheckReport, source: &'a Source) -> Option<Self> {
        let stated = source.description.as_deref();
        let schema = Schema::parse(stated.unwrap_or_default().as_bytes(), "dataset.toml").ok()?;
        let derived = report.targets == Targets::Derived && schema.target_origin == Targets::Recorded;
        let made = Description::parse(stated.unwrap_or(TITLE))?;
        let flights = report.flights;
        Some(Self {
            source,
            flights,
            derived,
            stated: Description::parse(stated.unwrap_or_default())?,
            schema,
            made,
            set: BTreeMap::new(),
        })
    }

    /// Adds what a finding prints, all of it or nothing.
    fn add(&mut self, finding: &Finding) -> Result<(), String> {
        let lines = finding.set.as_deref().ok_or("no line of a description mends it")?;
        let before = (self.made.clone(), self.set.clone());
        // Of several lines the first carries the reason.
        let mut reason = comment(&format!("{}: {}", finding.name, finding.message));
        for line in lines.lines() {
            if let Err(reason) = self.add_line(line, finding, &std::mem::take(&mut reason)) {
                (self.made, self.set) = before;
                return Err(reason);
            }
        }
        Ok(())
    }

    fn add_line(&mut self, line: &str, finding: &Finding, comment: &str) -> Result<(), String> {
        let (section, items) = parsed(line, finding).ok_or_else(|| format!("it leaves a choice: {line}"))?;
        let (mut made, mut set) = (self.made.clone(), self.set.clone());
        let unusual = |key: &str| format!("dataset.toml has `{key}` in a form that is not changed here: {line}");
        let entries = match section {
            "repair" => {
                made = made.with_rule("repair", &self.rule(items)?, comment).ok_or_else(|| unusual("repair"))?;
                Vec::new()
            }
            // Rules for single flights add up.
            section @ ("late_in" | "cut") => {
                made = made.with_rule(section, &items, comment).ok_or_else(|| unusual(section))?;
                Vec::new()
            }
            section => self.entries(section, items)?,
        };
        for (place, (section, key, value)) in entries.into_iter().enumerate() {
            let full = if section.is_empty() { key.clone() } else { format!("{section}.{key}") };
            let known = set.insert((section, key.clone()), value.clone());
            if known.as_ref().is_some_and(|known| *known != value && !LISTS.contains(&key.as_str())) {
                return Err(format!("another finding sets `{full}` otherwise: {line}"));
            }
            let mut above = if place == 0 { comment.to_owned() } else { String::new() };
            if let Some(old) = self.stated.get(section, &key).filter(|old| known.is_none() && **old != value) {
                above.push_str(&self::comment(&format!("was {key} = {old}")));
            }
            made = made.with(section, &key, &value, &above).ok_or_else(|| unusual(&full))?;
        }
        Schema::parse(made.text().as_bytes(), "dataset.toml").map_err(|error| error.to_string())?;
        (self.made, self.set) = (made, set);
        Ok(())
    }

    /// What a line comes to on top of what is stated.
    fn entries(&self, section: &str, items: Table) -> Result<Vec<Entry>, String> {
        let mut entries = Vec::new();
        for (key, value) in items {
            match section {
                "" if LISTS.contains(&key.as_str()) => entries.push(("", key.clone(), self.longer(&key, value)?)),
                "" => {
                    self.check_replaced(&key, &value)?;
                    entries.push(("", key, value));
                }
                "units" => entries.extend(self.unit(&key, value)?),
                "late" => entries.extend(self.later("late", &key, &value)?),
                "drift" => entries.extend(self.later("drift", &key, &value)?),
                "columns" => entries.push(("columns", key.clone(), self.column(&key, &value)?)),
                other => return Err(format!("`{other}` is no section of dataset.toml")),
            }
        }
        Ok(entries)
    }

    /// A list with what is new behind what is in it.
    fn longer(&self, key: &str, more: Value) -> Result<Value, String> {
        let more = match more {
            Value::Array(more) => more,
            one => vec![one],
        };
        let mut all = match self.made.get("", key) {
            Some(Value::Array(known)) => known.clone(),
            Some(one) => vec![one.clone()],
            None => Vec::new(),
        };
        for item in more {
            let item = match item.as_str() {
                Some(column) if OF_COLUMNS.contains(&key) => Value::String(self.own_column(column)?),
                _ => item,
            };
            if !all.contains(&item) {
                all.push(item);
            }
        }
        let stated = self.stated.get("", key).and_then(Value::as_array).map_or(0, Vec::len);
        let more = all.len() - stated.min(all.len());
        if key == "leave_out" && more as f64 > LEFT_OUT * self.flights as f64 {
            return Err(format!("with it {more} of {} flights would be left out: what so many have may be right", self.flights));
        }
        Ok(Value::Array(all))
    }

    /// The column of the file that is read as this one without more ado.
    fn own_column(&self, name: &str) -> Result<String, String> {
        if self.schema.columns.contains_key(name) {
            return Err(format!("dataset.toml states `columns.{name}` already"));
        }
        self.of_file(name).map(|(name, _)| name.to_owned()).ok_or_else(|| self.not_of_file(name))
    }

    /// A word takes the place of what would hold without it, or of the other of two. Another one was read already, and what was found comes on top.
    fn check_replaced(&self, key: &str, value: &Value) -> Result<(), String> {
        let is_free = match key {
            "axes" => self.schema.axes == Axes::default(),
            "velocity" => self.schema.velocity == Frame::Body,
            "targets" => self.schema.targets == TargetKind::Derivative,
            "quaternion" | "resample_hz" => true,
            _ => self.stated.get("", key).is_none(),
        };
        match self.stated.get("", key) {
            Some(old) if !is_free && old != value => Err(format!("dataset.toml states {key} = {old}, which {value} contradicts")),
            _ => Ok(()),
        }
    }

    /// A unit, in the place of one that is that of the program, and of such ones of single columns.
    fn unit(&self, word: &str, unit: Value) -> Result<Vec<Entry>, String> {
        let columns = columns_of(word);
        let single = columns.iter().filter(|column| **column != word);
        let stated = || single.clone().copied().chain([word]).filter_map(|key| Some((key, self.stated.get("units", key)?)));
        if columns.iter().any(|column| self.schema.factor(column) != 1.0) {
            let old: Vec<String> = stated().map(|(key, old)| format!("{key} = {old}")).collect();
            return Err(format!("dataset.toml states [units] {}, which {word} = {unit} contradicts", old.join(", ")));
        }
        let others = stated().map(|(key, _)| key).filter(|key| *key != word);
        Ok([word].into_iter().chain(others).map(|key| ("units", key.to_owned(), unit.clone())).collect())
    }

    /// What a stream still comes late by, or drifts by, is on top of what it has been moved.
    fn later(&self, section: &'static str, word: &str, by: &Value) -> Result<Vec<Entry>, String> {
        let by = by.as_float().ok_or_else(|| format!("`{section}.{word}` is {by}"))?;
        let columns = columns_of(word);
        if section == "late"
            && let Some(column) = columns.iter().find(|column| self.is_made_in_time(column))
        {
            return Err(format!("another finding says why `{column}` comes late; `check` says whether it still does with that"));
        }
        let stated =
            |key: &str| self.stated.get(section, key).and_then(|old| old.as_float().or(old.as_integer().map(|old| old as f64)));
        // To a microsecond, so that sums are as a person writes them.
        let entry = |key: &str, from: f64| (section, key.to_owned(), Value::Float(((from + by) * 1e6).round() / 1e6));
        if let [single] = columns {
            let late = Column::from_name(single).and_then(|column| self.schema.late.get(&column).copied()).unwrap_or_default();
            return Ok(vec![entry(word, if section == "late" { late.s } else { late.drift })]);
        }
        let is_moved = |column: &&&str| self.set.contains_key(&(section, (**column).to_owned()));
        if let Some(column) = columns.iter().find(is_moved) {
            return Err(format!("another finding moves `{column}` already"));
        }
        let single = columns.iter().filter_map(|column| Some(entry(column, stated(column)?)));
        Ok([entry(word, stated(word).unwrap_or(0.0))].into_iter().chain(single).collect())
    }

    /// Whether a line that was added undoes a filter, or a clock, behind which this column is late, or has it made anew.
    fn is_made_in_time(&self, column: &str) -> bool {
        self.set.iter().any(|((section, key), value)| match *section {
            "" => key == "missing" && value.as_array().is_some_and(|all| all.iter().any(|one| one.as_str() == Some(column))),
            "drift" => columns_of(key).contains(&column),
            "columns" => {
                key == column
                    && value.as_str().and_then(|text| Formula::parse(text).ok()).is_some_and(|formula| formula.remembers())
            }
            _ => false,
        })
    }

    /// A formula of columns as the program has them in terms of the file's.
    fn column(&self, name: &str, text: &Value) -> Result<Value, String> {
        let text = text.as_str().ok_or_else(|| format!("`columns.{name}` is {text}"))?;
        let formula = Formula::parse(text).map_err(|error| error.to_string())?;
        let [read] = formula.names()[..] else { return self.of_several(text, &formula) };
        if !column_names().any(|known| known == read) {
            return Err(format!("`{read}` is no column of the log"));
        }
        self.check_moved(name, read)?;
        let is_sign = text == read || text == format!("-{read}");
        if !is_sign && self.of_file(name).is_none_or(|(_, sign)| sign != 1.0) {
            return Err(self.not_of_file(name));
        }
        let factor = self.schema.factor(name);
        let composed = |source: &String| {
            if text == read {
                return Ok(source.clone());
            }
            let inner = Formula::parse(source).or_else(|_| Formula::parse(&quoted(source)));
            let inner = inner.map_err(|_| format!("`{source}` cannot stand in a formula: {text}"))?;
            let with = |formula: &Formula, inner: &Formula| {
                formula.substitute(&|_| Some(inner.clone())).map_err(|error| error.to_string())
            };
            if is_sign || factor == 1.0 {
                return with(&formula, &inner).map(|whole| whole.to_string());
            }
            // Numbers in the formula are in the program's units, and the file has others.
            let scaled = |text: String| Formula::parse(&text).map_err(|error| error.to_string());
            let whole = with(&formula, &with(&scaled(format!("{factor:?} * value"))?, &inner)?)?;
            with(&scaled(format!("value / {factor:?}"))?, &whole).map(|whole| whole.to_string())
        };
        let own = vec![read.to_owned()];
        let sources: Vec<String> = self.schema.columns.get(read).unwrap_or(&own).iter().map(composed).collect::<Result<_, _>>()?;
        Ok(match sources.as_slice() {
            [one] => Value::String(one.clone()),
            several => Value::Array(several.iter().cloned().map(Value::String).collect()),
        })
    }

    /// A formula of several columns holds where the file has each of them as the program has it.
    fn of_several(&self, text: &str, formula: &Formula) -> Result<Value, String> {
        for read in formula.names() {
            let is_as_in_file =
                self.of_file(read).is_some_and(|(own, sign)| own == read && sign == 1.0) && self.schema.factor(read) == 1.0;
            let late = Column::from_name(read).is_some_and(|column| self.schema.late.contains_key(&column));
            if !is_as_in_file || late || self.schema.columns.contains_key(read) {
                return Err(self.not_of_file(read));
            }
        }
        Ok(Value::String(text.to_owned()))
    }

    /// Whether one column may be read from another's place: what else is done to the two has to be the same.
    fn check_moved(&self, name: &str, read: &str) -> Result<(), String> {
        let (to, from) = (self.of_file(name), self.of_file(read));
        let (Some((own, sign)), Some((other, other_sign))) = (to, from) else { return Err(self.not_of_file(name)) };
        if own != name || other != read || sign != other_sign {
            return Err(self.not_of_file(name));
        }
        let late = |name: &str| Column::from_name(name).and_then(|column| self.schema.late.get(&column).copied());
        if self.schema.factor(name) != self.schema.factor(read) || late(name) != late(read) {
            return Err(format!(
                "dataset.toml reads `{name}` and `{read}` in different units, or moves them in time by different amounts"
            ));
        }
        Ok(())
    }

    /// A rule for cells of columns as the program has them as one for those of the file.
    fn rule(&self, mut rule: Table) -> Result<Table, String> {
        let Some(Value::Array(columns)) = rule.get("columns") else { return Err("a rule without columns".into()) };
        let names: Vec<&str> = columns.iter().filter_map(Value::as_str).collect();
        let (mut of_file, mut factors) = (Vec::new(), Vec::new());
        for name in names {
            let (own, sign) = self.of_file(name).ok_or_else(|| self.not_of_file(name))?;
            factors.push(sign * self.schema.factor(own));
            of_file.push(Value::String(self.cells_of(own)?));
        }
        let factor = factors.first().copied().unwrap_or(1.0);
        if let Some(Value::Array(valid)) = rule.get_mut("valid").filter(|_| factor != 1.0) {
            for comparison in valid {
                let text = comparison.as_str().unwrap_or_default();
                let scaled = Formula::parse(&format!("{factor:?} * value"));
                let whole = Formula::parse(text).and_then(|formula| formula.substitute(&|_| scaled.as_ref().ok().cloned()));
                *comparison = Value::String(whole.map_err(|error| error.to_string())?.to_string());
            }
        }
        if let Some(Value::Float(spike)) = rule.get_mut("spike") {
            *spike /= factor.abs();
        }
        if factors.iter().any(|other| *other != factor) && (rule.contains_key("valid") || rule.contains_key("spike")) {
            return Err("a rule with numbers for columns in different units".into());
        }
        rule.insert("columns".into(), Value::Array(of_file));
        Ok(rule)
    }

    /// The column of the file that one of the log in its own axes is read from.
    fn cells_of(&self, own: &str) -> Result<String, String> {
        match self.schema.columns.get(own).map(Vec::as_slice) {
            None => Ok(own.to_owned()),
            Some([column]) if Formula::parse(column).map_or(true, |formula| formula.names() == [column.as_str()]) => {
                Ok(column.clone())
            }
            Some(_) => Err(format!("`columns.{own}` of dataset.toml is a formula or a list; the rule is for the columns in it")),
        }
    }

    /// The column of a log in its own axes that a column of the program is but for its unit and this sign; `None` if it is made of several.
    fn of_file(&self, name: &str) -> Option<(&'static str, f64)> {
        if name == TIME {
            return Some((TIME, 1.0));
        }
        let column = Column::from_name(name)?;
        let (place, axes) = (column as usize, self.schema.axes);
        let (first, axis) = (place - place % 3, place % 3);
        let of_triple = |first: usize, axis: usize, turn: fn(Axes, [f64; 3]) -> [f64; 3]| {
            let image = |own: usize| turn(axes, std::array::from_fn(|at| f64::from(u8::from(at == own))))[axis];
            (0..3).find(|own| image(*own) != 0.0).map(|own| (Column::ALL[first + own].name(), image(own)))
        };
        let is_target = Column::TARGETS.contains(&column);
        match column {
            Column::U1 | Column::U2 | Column::U3 | Column::U4 => Some((column.name(), 1.0)),
            _ if is_target && self.derived => None,
            Column::Roll | Column::Pitch | Column::Yaw if self.source.quaternion.is_some() => None,
            Column::Roll => Some((column.name(), 1.0)),
            Column::Pitch => Some((column.name(), if axes == Axes::NedFrd { 1.0 } else { -1.0 })),
            Column::Yaw => match axes {
                Axes::NedFrd => Some((column.name(), 1.0)),
                Axes::NwuFlu => Some((column.name(), -1.0)),
                // Counted from another direction.
                Axes::EnuFlu => None,
            },
            Column::X | Column::Y | Column::Z => of_triple(first, axis, Axes::inertial_to_ned),
            Column::Vx | Column::Vy | Column::Vz if self.schema.velocity == Frame::Inertial => None,
            Column::VxDot | Column::VyDot | Column::VzDot if self.schema.targets != TargetKind::Derivative => None,
            // Behind the four controls.
            _ if is_target => of_triple(place - (place - 16) % 3, (place - 16) % 3, Axes::body_to_frd),
            _ => of_triple(first, axis, Axes::body_to_frd),
        }
    }

    fn not_of_file(&self, name: &str) -> String {
        format!("`{name}` is computed from other columns of the log, so it has to be said of these")
    }
}

/// A line such as `[units] angles = "deg"`: its section and what stands in it.
fn parsed<'l>(line: &'l str, finding: &Finding) -> Option<(&'l str, Table)> {
    if line.starts_with("leave_out = ") && !finding.flights.is_empty() {
        let names = finding.flights.iter().cloned().map(Value::String).collect();
        return Some(("", Table::from_iter([("leave_out".to_owned(), Value::Array(names))])));
    }
    let line = FOR_PEOPLE.iter().fold(line, |line, end| line.split(end).next().unwrap_or(line));
    let rule = RULES.iter().find_map(|rule| Some((*rule, line.strip_prefix(&format!("[[{rule}]] "))?)));
    let (section, items) = match rule {
        Some(rule) => rule,
        None => line.strip_prefix('[').and_then(|rest| rest.split_once("] ")).unwrap_or(("", line)),
    };
    match format!("it = {{ {items} }}").parse::<Table>().ok()?.remove("it") {
        Some(Value::Table(items)) if !items.is_empty() => Some((section, items)),
        _ => None,
    }
}

/// Text as a comment of whole lines. Names of flights come from outside: what a comment cannot hold is shown as an escape.
fn comment(text: &str) -> String {
    let escaped = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    let text: String = text.chars().map(escaped).collect();
    let lines = wrapped("# ", &text);
    lines.lines().map(|line| format!("# {}\n", line.get(2..).unwrap_or_default())).collect()
}

#[cfg(test)]
mod tests {
    use super::super::finding::Subject;
    use super::*;

    /// A report with these faults: a line and the flights that it is about.
    fn report(lines: &[(&str, &[&str])]) -> CheckReport {
        let finding = |(place, (line, flights)): (usize, &(&str, &[&str]))| Finding {
            name: format!("fault_{place}"),
            subject: Subject::Conventions,
            verdict: Severity::Fault,
            measured: None,
            interval: None,
            expected: None,
            unit: "1".into(),
            message: "seen".into(),
            set: (!line.is_empty()).then(|| (*line).to_owned()),
            flights: flights.iter().map(|flight| (*flight).to_owned()).collect(),
        };
        CheckReport {
            fault: !lines.is_empty(),
            summary: String::new(),
            flights: 40,
            duration_s: 1.0,
            targets: Targets::Recorded,
            findings: lines.iter().enumerate().map(finding).collect(),
            control_delay: None,
            excitation: Vec::new(),
            collinearity: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// What is suggested to a log that is described so: all lines but comments, and what is left to a person.
    fn suggested(stated: Option<&str>, lines: &[(&str, &[&str])]) -> Option<(String, Vec<String>)> {
        let source = Source { description: stated.map(str::to_owned), ..Source::default() };
        let Suggestion { text, open, .. } = report(lines).suggestion(&source)?;
        Schema::parse(text.as_bytes(), "suggested").ok()?;
        let told = |line: &&str| !line.starts_with('#') && !line.is_empty();
        let text: Vec<&str> = text.lines().filter(told).collect();
        Some((text.join("\n"), open.into_iter().map(|open| open.reason).collect()))
    }

    fn holds(stated: Option<&str>, lines: &[(&str, &[&str])], expected: &str) {
        assert_eq!(suggested(stated, lines), Some((expected.to_owned(), Vec::new())), "{lines:?}");
    }

    fn is_left(stated: Option<&str>, line: &str, why: &str) {
        let left = suggested(stated, &[(line, &[])]).map(|(text, open)| (text, open.join("; ")));
        let (text, reasons) = left.unwrap_or_default();
        assert!(text == stated.unwrap_or_default() && reasons.contains(why), "{line}: {text:?}, {reasons}");
    }

    #[test]
    fn lines_of_every_kind_become_a_description() {
        holds(None, &[("[units] angles = \"deg\"", &[])], "[units]\nangles = \"deg\"");
        holds(None, &[("velocity = \"inertial\"", &[])], "velocity = \"inertial\"");
        holds(None, &[("leave_out = [\"a\"]", &["a"]), ("leave_out = [\"b\"]", &["b", "a"])], "leave_out = [\"a\", \"b\"]");
        let exchanged = "[columns] u1 = \"u2\", u2 = \"u1\", with the file's names";
        holds(None, &[(exchanged, &[])], "[columns]\nu1 = \"u2\"\nu2 = \"u1\"");
        holds(None, &[("[late] controls = 0.1", &[]), ("[late] rates = 0.05", &[])], "[late]\ncontrols = 0.1\nrates = 0.05");
        let rule = "[[repair]] columns = [\"u4\"], valid = [\"value > -2\", \"value < 2\"], max_gap_s = 0.1";
        let made = suggested(None, &[(rule, &[])]).map(|made| made.0).unwrap_or_default();
        assert!(made.starts_with("[[repair]]\n") && made.contains("columns = [\"u4\"]"), "{made}");
    }

    #[test]
    fn each_line_stands_below_its_reason_and_a_value_that_is_replaced_is_noted() {
        let source = Source { description: Some("# Ours.\nvelocity = \"body\" # so far\n".into()), ..Source::default() };
        let found = report(&[("velocity = \"inertial\"", &[])]).suggestion(&source);
        let expected = "# Ours.\n# fault_0: seen\n# was velocity = \"body\"\nvelocity = \"inertial\" # so far\n";
        assert_eq!(found.map(|found| found.text).as_deref(), Some(expected));
    }

    #[test]
    fn what_is_found_comes_on_top_of_what_is_stated() {
        holds(Some("leave_out = [\"a\"]"), &[("leave_out = [\"b\"]", &["b"])], "leave_out = [\"a\", \"b\"]");
        holds(Some("[late]\nrates = 0.02"), &[("[late] rates = 0.05", &[])], "[late]\nrates = 0.07");
        let exchanged = "[columns] u1 = \"u2\", u2 = \"u1\"";
        let stated = "[columns]\nu1 = \"roll_stick\"\nu2 = \"pitch_stick\"";
        holds(Some(stated), &[(exchanged, &[])], "[columns]\nu1 = \"pitch_stick\"\nu2 = \"roll_stick\"");
        let turned = "[columns] wz = \"-wz\"";
        holds(Some("[columns]\nwz = \"gyro_z / 2\""), &[(turned, &[])], "[columns]\nwz = \"-(gyro_z / 2)\"");
    }

    #[test]
    fn what_leaves_a_choice_or_contradicts_is_left_to_a_person() {
        is_left(None, "", "no line of a description");
        is_left(None, "[units] position or velocity", "leaves a choice");
        is_left(Some("[units]\nangles = \"deg\""), "[units] angles = \"rad\"", "contradicts");
        is_left(Some("velocity = \"inertial\""), "velocity = \"body\"", "contradicts");
        is_left(Some("axes = \"ENU/FLU\""), "[columns] yaw = \"-yaw\"", "computed from other columns");
        let both = suggested(None, &[("[late] rates = 0.05", &[]), ("[late] rates = 0.02", &[])]);
        assert!(both.is_some_and(|(text, open)| text.ends_with("rates = 0.05") && open[0].contains("another finding sets")));
        let names: Vec<String> = (0..40).map(|flight| format!("f{flight}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let line = "leave_out = [...]";
        let halves = suggested(None, &[(line, &names[..20]), (line, &names[20..])]);
        assert!(
            halves.is_some_and(|(text, open)| text.contains("\"f19\"") && !text.contains("f20") && open[0].contains("40 of 40"))
        );
        let outvoted = suggested(None, &[(line, &names[..20]), (line, &names[21..]), (line, &names[20..])]);
        assert!(outvoted.is_some_and(|(text, open)| text.contains("\"f39\"") && !text.contains("\"f19\"") && open.len() == 1));
    }

    #[test]
    fn nothing_at_fault_asks_for_nothing() {
        assert_eq!(report(&[]).suggestion(&Source::default()), None);
    }
}
