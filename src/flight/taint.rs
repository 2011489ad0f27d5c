//! Which columns of a log give an acceleration away, as `dataset.toml` computes columns: what the accelerations are made of, and what is
//! made of that. Whoever reads such a column as an input predicts a target from itself.
//!
//! Only where columns come from is judged here, never what is in them: a copy of an acceleration under a name that the description does
//! not mention cannot be known. Who must not read them is told by [`super::Flight::gives_target_away`].
//!
//! An acceleration gives away
//! 1. the file's column that it is;
//! 2. of the columns that its formula reads outside `rate(…)` (a derivative is made of a state, not the reverse), those of which no
//!    state is made; if there is no such column, all of them but those that are a state by their name alone.

use super::schema::Schema;
use super::table::RawTable;
use super::{Column, units};
use crate::formula::Formula;
use std::collections::{BTreeMap, BTreeSet};

/// Where a canonical column comes from.
enum Source {
    Column(String),
    Formula(Formula),
}

impl Source {
    /// The source that the reader takes: the first alternative that the file can give.
    fn of(table: &RawTable, schema: &Schema, name: &str) -> Option<Self> {
        let there = |name: &str| table.column(name).is_some();
        let Some(alternatives) = schema.columns.get(name) else { return there(name).then(|| Self::Column(name.into())) };
        alternatives.iter().find_map(|text| {
            if there(text) {
                return Some(Self::Column(text.clone()));
            }
            let formula = Formula::parse(text).ok()?;
            formula.names().into_iter().all(there).then_some(Self::Formula(formula))
        })
    }

    fn reads(&self) -> BTreeSet<&str> {
        match self {
            Self::Column(name) => BTreeSet::from([name.as_str()]),
            Self::Formula(formula) => formula.names().into_iter().collect(),
        }
    }
}

/// Columns that belong together: reading may turn one into another of them (axes, frames, quaternions).
const TRIPLES: [&[&str]; 4] = [&["x", "y", "z"], &["roll", "pitch", "yaw"], &["vx", "vy", "vz"], &["wx", "wy", "wz"]];

/// The columns that give an acceleration away, by their canonical name or their name in the file, each with the reason.
pub(super) fn tainted(table: &RawTable, schema: &Schema) -> BTreeMap<String, String> {
    let is_target = |name: &str| Column::TARGETS.iter().any(|target| target.name() == name);
    let sources: Vec<(&str, Source)> =
        units::column_names().filter_map(|name| Some((name, Source::of(table, schema, name)?))).collect();
    let states = || sources.iter().filter(|(name, _)| !is_target(name) && *name != "t");
    let plain: BTreeSet<&str> =
        states().filter_map(|(_, source)| if let Source::Column(name) = source { Some(name.as_str()) } else { None }).collect();
    let of_states: BTreeSet<&str> = states().flat_map(|(_, source)| source.reads()).collect();

    // An acceleration's own name gives it away even where the description takes the target from elsewhere.
    let mut raw: BTreeMap<String, String> = (table.names.iter().filter(|name| is_target(name)))
        .map(|name| (name.clone(), format!("`{name}` is an acceleration of the log")))
        .collect();
    for (target, source) in sources.iter().filter(|(name, _)| is_target(name)) {
        let given_away: Vec<&str> = match source {
            Source::Column(name) => vec![name],
            Source::Formula(formula) => {
                let direct: Vec<&str> = formula.names_outside_rates().into_iter().filter(|name| !plain.contains(name)).collect();
                let alone: Vec<&str> = direct.iter().copied().filter(|name| !of_states.contains(name)).collect();
                if alone.is_empty() { direct } else { alone }
            }
        };
        for name in given_away {
            let reason = || format!("`columns.{target}` in dataset.toml makes an acceleration of it");
            raw.entry(name.to_owned()).or_insert_with(reason);
        }
    }

    let mut canonical = BTreeMap::new();
    for (name, source) in states() {
        let Some(read) = source.reads().into_iter().find(|read| raw.contains_key(*read)) else { continue };
        let reason = format!("`columns.{name}` in dataset.toml makes it of `{read}`, and that gives an acceleration away");
        let with_it = TRIPLES.iter().find(|triple| triple.contains(name));
        let attitude = ["q1", "q2", "q3", "q4"].contains(name).then_some(&TRIPLES[1]);
        for name in with_it.or(attitude).copied().unwrap_or(std::slice::from_ref(name)) {
            canonical.entry((*name).to_owned()).or_insert_with(|| reason.clone());
        }
    }
    raw.retain(|name, _| Column::from_name(name).is_none());
    raw.extend(canonical);
    raw
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const HEADER: [&str; 26] = [
        "t", "x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4", "vx_dot", "vy_dot",
        "vz_dot", "wx_dot", "wy_dot", "wz_dot", "ax_mg", "gyro", "rpm",
    ];

    /// Names that are tainted under this `[columns]`.
    fn found(columns: &str) -> crate::Result<Vec<String>> {
        let schema = Schema::parse(format!("[columns]\n{columns}").as_bytes(), "dataset.toml")?;
        let table = RawTable {
            path: Path::new("a.csv").into(),
            names: HEADER.map(str::to_owned).into(),
            columns: vec![vec![0.0]; HEADER.len()],
            lines: vec![2],
            read: None,
        };
        Ok(tainted(&table, &schema).into_keys().collect())
    }

    #[test]
    fn what_targets_are_made_of_and_what_is_made_of_them_is_known() -> crate::Result<()> {
        let cases: [(&str, &[&str]); 10] = [
            ("", &[]),
            // The column that it is, or that its formula reads; states in the formula are states.
            ("vx_dot = \"ax_mg\"", &["ax_mg"]),
            ("vx_dot = \"0.00981 * ax_mg + wy * vz\"", &["ax_mg"]),
            ("vx_dot = [\"no such\", \"9.81 * ax_mg\"]", &["ax_mg"]),
            // A state made of an acceleration, by its name or by the column that it is made of.
            ("u1 = \"2 * vx_dot\"", &["u1"]),
            ("u1 = \"lag(rate(ax_mg), 0.1)\"\nvx_dot = \"9.81 * ax_mg\"", &["ax_mg", "u1"]),
            ("roll = \"atan2(ax_mg, 1)\"\nvx_dot = \"ax_mg\"", &["ax_mg", "pitch", "roll", "yaw"]),
            // A derivative is made of a state, not the reverse.
            ("wx = \"0.01 * gyro\"\nwx_dot = \"0.01 * rate(gyro)\"", &[]),
            // One column is a state's and one is not: the latter tells.
            ("wy = \"0.01 * gyro\"\nvx_dot = \"ax_mg + 0.01 * gyro * vz\"", &["ax_mg"]),
            ("u4 = \"rpm / 1000\"", &[]),
        ];
        for (columns, expected) in cases {
            assert_eq!(found(columns)?, expected, "{columns}");
        }
        Ok(())
    }
}
