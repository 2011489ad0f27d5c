//! From what a check says to a `dataset.toml`, and through files to the flights that are read with it.

use phyture::critique::check::{CheckReport, Verdict};
use phyture::flight::{DataSet, Flight, read, write};
use phyture::{Error, Result};
use toml::{Table, Value};

/// What stands behind the part of a `set` line that a file can hold.
const FOR_PEOPLE: &str = ", with the file's name";

/// The `set` lines of the faults as one description; `None` if none of them can be written as it stands. What is said for some flights only, or
/// leaves a choice, cannot. Of two values for one key the first stands.
pub fn mend(report: &CheckReport) -> Option<String> {
    let mut description = Table::new();
    let faults = report.findings.iter().filter(|finding| finding.verdict == Verdict::Fault);
    for (section, items) in faults.filter_map(|finding| parsed(finding.set.as_deref()?)) {
        add(&mut description, section, items);
    }
    (!description.is_empty()).then(|| description.to_string())
}

/// A line such as `[units] angles = "deg"`: its section and what stands in it.
fn parsed(line: &str) -> Option<(&str, Table)> {
    let line = line.split(FOR_PEOPLE).next().unwrap_or(line);
    let (section, items) = match line.strip_prefix("[[repair]] ") {
        Some(items) => ("repair", items),
        None => line.strip_prefix('[').and_then(|rest| rest.split_once("] ")).unwrap_or(("", line)),
    };
    match format!("it = {{ {items} }}").parse::<Table>().ok()?.remove("it") {
        Some(Value::Table(items)) if !items.is_empty() => Some((section, items)),
        _ => None,
    }
}

fn add(description: &mut Table, section: &str, items: Table) {
    match section {
        "" => items.into_iter().for_each(|(key, value)| match (description.get_mut(&key), value) {
            // Flights that are left out and columns that are missing add up.
            (Some(Value::Array(known)), Value::Array(more)) => {
                let new: Vec<Value> = more.into_iter().filter(|item| !known.contains(item)).collect();
                known.extend(new);
            }
            (Some(_), _) => {}
            (None, value) => drop(description.insert(key, value)),
        }),
        "repair" => {
            let rules = description.entry("repair").or_insert_with(|| Value::Array(Vec::new()));
            if let Value::Array(rules) = rules {
                rules.push(Value::Table(items));
            }
        }
        section => {
            let inside = description.entry(section).or_insert_with(|| Value::Table(Table::new()));
            if let Value::Table(inside) = inside {
                items.into_iter().for_each(|(key, value)| {
                    inside.entry(key).or_insert(value);
                });
            }
        }
    }
}

/// These flights as the reader gives them back, with this description beside them.
pub fn through_files(flights: &[Flight], description: Option<&str>) -> Result<DataSet> {
    let folder = tempfile::tempdir().map_err(Error::io(std::env::temp_dir()))?;
    write::data_set_csv(folder.path(), flights)?;
    if let Some(text) = description {
        let path = folder.path().join("dataset.toml");
        std::fs::write(&path, text).map_err(Error::io(&path))?;
    }
    read::data_set(folder.path(), &read::ReadOptions::default())
}
