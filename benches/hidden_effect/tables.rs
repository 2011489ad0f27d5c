//! From lines of runs to the tables that are reported.

use crate::cases::{ALIENS, FOREIGN, SINGLES};
use crate::run::{Line, read};
use phyture::Result;
use std::collections::BTreeMap;
use std::path::Path;

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn row(metric: &str, target: &str, hits: usize, of: usize) {
    println!(
        "| {metric} | {target} | {hits}/{of}{} |",
        if of == 0 { String::new() } else { format!(" ({:.1} %)", 100.0 * hits as f64 / of as f64) }
    );
}

/// Effects named beyond the truth. At level two the wind is part of the data, and naming it is right.
fn named(line: &Line) -> Vec<&str> {
    line.accepted.iter().map(String::as_str).filter(|name| !(line.level == 2 && *name == "wind" && line.hidden != "wind")).collect()
}

/// Prints the tables of a file of runs.
pub fn print(path: &Path) -> Result<()> {
    let lines = read(path)?;
    let of = |part: &str| lines.iter().filter(|line| line.part == part).collect::<Vec<_>>();
    let singles = of("single");
    println!("| metric | target | measured |\n| --- | --- | --- |");
    names(&singles, &of("null"));
    let pairs = of("pair");
    row("both effects of a pair, nothing else", "≥ 90 %", count(&pairs, &names_both), pairs.len());
    numbers(&singles);
    let aliens = of("alien");
    row("outside the catalogue: no false name", "≥ 90 %", count(&aliens, &|line| named(line).is_empty()), aliens.len());
    row("outside the catalogue: right variable first", "≥ 95 %", count(&aliens, &names_variable), aliens.len());
    let confusables = of("confusable");
    let set = |line: &Line| first(line) || line.indistinguishable.contains(&line.hidden);
    row("confusable pairs: truth in the reported set", "-", count(&confusables, &set), confusables.len());
    let seconds = median(singles.iter().map(|line| line.seconds).collect());
    println!("| median time of a search, 1800 s | - | {} s |", show_number(seconds));
    textbook(&of("textbook"), &lines);
    confusion(&singles);
    Ok(())
}

fn count(lines: &[&Line], wanted: &dyn Fn(&Line) -> bool) -> usize {
    lines.iter().filter(|line| wanted(line)).count()
}

/// Whether the truth is named first.
fn first(line: &Line) -> bool {
    named(line).first().copied() == Some(line.hidden.as_str())
}

/// Runs whose effect makes such a share of the error.
fn between<'l>(singles: &[&'l Line], low: f64, high: f64) -> Vec<&'l Line> {
    singles.iter().copied().filter(|line| line.share >= low && line.share < high).collect()
}

/// Rows on what single effects, and none, are called.
fn names(singles: &[&Line], nulls: &[&Line]) {
    let in_set = |line: &Line| {
        first(line) || line.indistinguishable.len() <= 1 && !named(line).is_empty() && line.indistinguishable.contains(&line.hidden)
    };
    let wrong = |line: &Line| !first(line) && !named(line).is_empty();
    let (strong, weak) = (between(singles, 0.05, 1.1), between(singles, 0.02, 0.05));
    let tiny = between(singles, f64::NEG_INFINITY, 0.02);
    row("right effect named first, removable share ≥ 5 %", "≥ 97 %", count(&strong, &first), strong.len());
    row("same, share 2–5 %", "≥ 88 %", count(&weak, &first), weak.len());
    row("wrong name first, share 2–5 %", "≤ 2 %", count(&weak, &wrong), weak.len());
    row("share below 2 %: right", "-", count(&tiny, &first), tiny.len());
    row("share below 2 %: wrong name first", "-", count(&tiny, &wrong), tiny.len());
    row("truth in the reported set of at most 2, share ≥ 5 %", "≥ 98 %", count(&strong, &in_set), strong.len());
    row("false alarms on data without a hidden effect", "≤ 2 of 200", count(nulls, &|line| !named(line).is_empty()), nulls.len());
    let hits: Vec<&Line> = singles.iter().copied().filter(|line| first(line)).collect();
    let extra: usize = hits.iter().map(|line| named(line).len() - 1).sum();
    println!(
        "| further effects per run that hit | ≤ 0.05 | {:.3} ({extra} in {}) |",
        extra as f64 / hits.len().max(1) as f64,
        hits.len()
    );
}

/// Whether both effects of a pair are named, and nothing else.
fn names_both(line: &Line) -> bool {
    let mut found = named(line);
    if line.hidden.split('+').any(|part| part == "wind")
        && line.accepted.iter().any(|name| name == "wind")
        && !found.contains(&"wind")
    {
        found.push("wind");
    }
    let mut truth: Vec<&str> = line.hidden.split('+').collect();
    found.sort_unstable();
    truth.sort_unstable();
    found == truth
}

/// Rows on numbers and on the error removed.
fn numbers(singles: &[&Line]) {
    for (name, low, high, target) in [("large (share ≥ 20 %)", 0.2, 1.1, "≤ 5 %"), ("small (2–5 %)", 0.02, 0.05, "≤ 15 %")]
    {
        let fixed = |line: &&Line| SINGLES.iter().any(|single| single.id == line.hidden && !single.dynamic);
        let lines = between(singles, low, high);
        let errors: Vec<f64> = lines.into_iter().filter(fixed).filter_map(|line| Some(line.coefficient_error?.0)).collect();
        let of = errors.len();
        println!("| main coefficient, median error, {name} | {target} | {} ({of} runs) |", show(median(errors)));
    }
    let is_time = |line: &&&Line| ["cyclic_lag", "ctrl_delay", "tail_lag", "collective_lag"].contains(&line.hidden.as_str());
    let times: Vec<(f64, f64)> = singles.iter().filter(is_time).filter_map(|line| line.coefficient_error).collect();
    let near = times.iter().filter(|error| error.0 <= 0.15 || error.1 <= 0.010).count();
    row("lag or delay within 10 ms or 15 %", "all", near, times.len());
    for (name, target, dynamic) in [("static", "≥ 0.97", false), ("dynamic", "≥ 0.90", true)] {
        let known = |line: &&&Line| SINGLES.iter().any(|single| single.id == line.hidden && single.dynamic == dynamic);
        let worthy = singles.iter().filter(|line| first(line) && line.share >= 0.05);
        let shares: Vec<f64> = worthy.filter(known).filter_map(|line| line.removed).collect();
        let of = shares.len();
        let middle = median(shares).map_or("-".into(), |share| format!("{share:.3}"));
        println!("| error removed / removable, median, {name} | {target} | {middle} ({of} runs) |");
    }
}

/// Whether what the error depends on is named, for an effect that is in no catalogue.
fn names_variable(line: &Line) -> bool {
    let formula = ALIENS.iter().find(|alien| line.hidden == format!("{} = {}", alien.0, alien.1));
    let right = |found: &str| {
        formula.map(|alien| found == alien.2).unwrap_or_else(|| FOREIGN.iter().any(|f| f.0 == line.hidden && f.1.contains(&found)))
    };
    match formula {
        Some(alien) => line.unknown.get(alien.0).is_some_and(|found| right(found)),
        None => line.unknown.values().any(|found| right(found)),
    }
}

/// Truth, what was named first, how often.
fn confusion(singles: &[&Line]) {
    println!("\nConfusion: truth, what was named first, how often\n");
    let mut confusion: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for line in singles {
        *confusion.entry((&line.hidden, named(line).first().copied().unwrap_or("(nothing)"))).or_default() += 1;
    }
    let mut last = "";
    for ((truth, name), count) in &confusion {
        if *truth != last {
            print!("\n{truth}:");
            last = truth;
        }
        print!(" {name} {count}");
    }
    println!();
}

fn show(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{:.1} %", 100.0 * value))
}

fn show_number(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{value:.2}"))
}

/// The two textbook methods on the same files as this program's own runs at level one.
fn textbook(lines: &[&Line], all: &[Line]) {
    if lines.is_empty() {
        return;
    }
    println!("\n| method | data | right first | named nothing on null | effects named, median |\n| --- | --- | --- | --- | --- |");
    let own = |line: &&&Line| {
        all.iter().find(|other| {
            other.part == "single" && other.hidden == line.hidden && other.size == line.size && other.seed == line.seed
        })
    };
    for (library, name) in [(0, "full library"), (1, "without lag columns")] {
        for (method, pick) in [
            (
                "stepwise F > 20 and PSE",
                (|line: &Line, library: usize| line.stepwise.get(library).cloned()) as fn(&Line, usize) -> Option<Vec<String>>,
            ),
            ("STLSQ", |line, library| line.sparse.get(library).cloned()),
        ] {
            let hidden: Vec<&&Line> = lines.iter().filter(|line| line.hidden != "null").collect();
            let null: Vec<&&Line> = lines.iter().filter(|line| line.hidden == "null").collect();
            let first = |line: &&Line| pick(line, library).and_then(|names| names.first().cloned()) == Some(line.hidden.clone());
            let right = hidden.iter().filter(|line| first(line)).count();
            let silent = null.iter().filter(|line| pick(line, library).is_some_and(|names| names.is_empty())).count();
            let counts = median(hidden.iter().filter_map(|line| pick(line, library)).map(|names| names.len() as f64).collect());
            println!(
                "| {method}, {name} | level 1 | {right}/{} | {silent}/{} | {} |",
                hidden.len(),
                null.len(),
                counts.map_or("-".into(), |count| format!("{count:.0}"))
            );
        }
    }
    let hidden: Vec<&&Line> = lines.iter().filter(|line| line.hidden != "null").collect();
    let mine: Vec<&Line> = hidden.iter().filter_map(own).collect();
    let right = mine.iter().filter(|line| named(line).first().copied() == Some(line.hidden.as_str())).count();
    let null: Vec<&Line> = all
        .iter()
        .filter(|line| line.part == "null" && lines.iter().any(|other| other.hidden == "null" && other.seed == line.seed))
        .collect();
    let silent = null.iter().filter(|line| named(line).is_empty()).count();
    let counts = median(mine.iter().map(|line| named(line).len() as f64).collect());
    println!(
        "| phyture diagnose | level 1 | {right}/{} | {silent}/{} | {} |",
        mine.len(),
        null.len(),
        counts.map_or("-".into(), |count| format!("{count:.0}"))
    );
}
