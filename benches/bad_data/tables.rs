//! From lines of cases to the tables that are reported.

use crate::change::{Corruption, Part};
use crate::run::{CLEAN_HALF, CONVENTION_FAULT, HALVES, Line, Mended, NULL, UNCORRUPTED, read};
use phyture::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// An error that is larger or smaller by this factor, where no effect says so, is another verdict.
const OTHER_ERROR: f64 = 1.5;

/// What a case came to, beside the same flights with nothing wrong.
struct Judged<'a> {
    corruption: &'a Corruption,
    line: &'a Line,
    clean: &'a Line,
    /// The same without the flights that are hit.
    rest: Option<&'a Line>,
}

impl<'a> Judged<'a> {
    fn is_fault(&self) -> bool {
        self.line.verdict == CONVENTION_FAULT
    }

    /// Whether the corruption has an effect: a fault, other words, other effects, or another error.
    fn changes(&self) -> bool {
        Self::differs(self.clean, &self.line.verdict, &self.line.accepted, &self.line.rmse)
    }

    /// What the flights as they are once mended are to be held against: where some are left out, the others alone.
    fn sound(&self, mended: &Mended) -> &'a Line {
        self.rest.filter(|_| mended.description.contains("leave_out")).unwrap_or(self.clean)
    }

    fn differs(clean: &Line, verdict: &str, accepted: &[String], rmse: &[Option<f64>]) -> bool {
        let sorted = |names: &[String]| names.iter().cloned().collect::<BTreeSet<_>>();
        let other_error = rmse.iter().zip(&clean.rmse).any(|pair| match pair {
            (Some(with), Some(without)) => (with / without).ln().abs() > OTHER_ERROR.ln(),
            _ => false,
        });
        verdict != clean.verdict || sorted(accepted) != sorted(&clean.accepted) || other_error
    }

    /// Whether all is as without the corruption once what is printed is set.
    fn is_mended(&self) -> bool {
        let mended = self.line.mended.as_ref();
        mended.is_some_and(|mended| {
            mended.is_free && !Self::differs(self.sound(mended), &mended.verdict, &mended.accepted, &mended.rmse)
        })
    }

    /// Whether the right cause stands first of all that is said.
    fn leads(&self) -> bool {
        let first = self.line.faults.first().or(self.line.warnings.first());
        first.is_some_and(|said| self.corruption.is_named_by(&said.text()))
    }

    /// Effects that are neither hidden nor named without the corruption.
    fn is_false(&self) -> bool {
        self.has_false(self.clean, &self.line.accepted)
    }

    fn is_false_once_mended(&self) -> bool {
        self.line.mended.as_ref().is_some_and(|mended| self.has_false(self.sound(mended), &mended.accepted))
    }

    fn has_false(&self, clean: &Line, accepted: &[String]) -> bool {
        accepted.iter().any(|name| *name != self.line.hidden && !clean.accepted.contains(name))
    }

    fn hides(&self) -> bool {
        self.line.hidden != NULL && self.clean.accepted.contains(&self.line.hidden)
    }

    /// Whether the hidden effect is named, at once or once the fault is mended.
    fn finds(&self) -> bool {
        let mended = self.line.mended.iter().flat_map(|mended| &mended.accepted);
        self.line.accepted.iter().chain(mended).any(|name| *name == self.line.hidden)
    }
}

/// Prints the tables of a file of cases.
pub fn print(path: &Path) -> Result<()> {
    let lines = read(path)?;
    let sound = lines.iter().filter(|line| line.half == UNCORRUPTED);
    let sound: BTreeMap<(u64, &str, &str), &Line> =
        sound.map(|line| ((line.seed, line.hidden.as_str(), line.part.as_str()), line)).collect();
    for (half, corruptions) in HALVES {
        // In the order of the list.
        let own = |corruption: &'static Corruption| {
            lines.iter().filter(move |line| line.half == half && line.corruption == corruption.id).filter_map(|line| {
                let of = |part: &str| sound.get(&(line.seed, line.hidden.as_str(), part)).copied();
                Some(Judged { corruption, line, clean: of("")?, rest: of(&line.part) })
            })
        };
        let cases: Vec<Judged<'_>> = corruptions.iter().flat_map(own).collect();
        if !cases.is_empty() {
            println!("\n{half} half: {} cases\n", cases.len());
            by_corruption(&cases);
            totals(&cases);
        }
    }
    uncorrupted(&lines);
    Ok(())
}

fn by_corruption<'a>(cases: &[Judged<'a>]) {
    println!(
        "| corruption | flights | runs | right cause | said first | as fault | its flights | verdict changed | changed, no fault | false effect | effect found | mended |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut rows: Vec<(&Corruption, Part)> = Vec::new();
    for case in cases {
        if !rows.iter().any(|(corruption, _)| corruption.id == case.corruption.id) {
            rows.extend(case.corruption.parts.map(|part| (case.corruption, part)));
        }
    }
    for (Corruption { id, .. }, part) in rows {
        let is_own = |case: &&Judged<'a>| case.corruption.id == *id && case.line.part == part.name();
        let own: Vec<&Judged<'a>> = cases.iter().filter(is_own).collect();
        let count = |wanted: &dyn Fn(&Judged<'a>) -> bool| own.iter().filter(|case| wanted(case)).count();
        println!(
            "| {id} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {}/{} | {}/{} |",
            part.name(),
            own.len(),
            count(&|case| !case.line.right.is_empty()),
            count(&Judged::leads),
            count(&|case| case.line.right == "fault"),
            count(&|case| case.line.flights_named),
            count(&Judged::changes),
            count(&|case| case.changes() && !case.is_fault()),
            count(&Judged::is_false),
            count(&|case| case.hides() && case.finds()),
            count(&Judged::hides),
            count(&Judged::is_mended),
            count(&Judged::is_fault),
        );
    }
}

fn totals<'a>(cases: &[Judged<'a>]) {
    let count = |of: &dyn Fn(&Judged<'a>) -> bool, wanted: &dyn Fn(&Judged<'a>) -> bool| {
        let own: Vec<&Judged<'a>> = cases.iter().filter(|case| of(case)).collect();
        (own.iter().filter(|case| wanted(case)).count(), own.len())
    };
    println!("\n| metric | target | measured | 95 % |\n| --- | --- | --- | --- |");
    let named = |case: &Judged<'a>| !case.line.right.is_empty();
    let all = |_: &Judged<'a>| true;
    let is_hit = |part: &'static str| move |case: &Judged<'a>| case.line.part == part && case.changes();
    row("right cause named where the verdict changes", "≥ 90 %", count(&Judged::changes, &named));
    for part in ["all", "half", "one"] {
        row(&format!("same, flights hit: {part}"), "-", count(&is_hit(part), &named));
    }
    row("same, and first of all that is said", "-", count(&Judged::changes, &Judged::leads));
    row("same, of faults", "-", count(&Judged::is_fault, &named));
    row("verdict changed, no fault", "-", count(&all, &|case| case.changes() && !case.is_fault()));
    row("no false effect", "≥ 98 %", count(&all, &|case| !case.is_false()));
    row("hidden effect found, mended where that can be", "≥ 90 %", count(&Judged::hides, &Judged::finds));
    let can_be = |case: &Judged<'a>| case.line.mended.is_some();
    row("faults that can be mended as printed", "-", count(&Judged::is_fault, &can_be));
    row(
        "of these without a fault then",
        "-",
        count(&can_be, &|case| case.line.mended.as_ref().is_some_and(|mended| mended.is_free)),
    );
    row("of these as without the corruption", "-", count(&can_be, &Judged::is_mended));
    row("of these no false effect then", "-", count(&can_be, &|case| !case.is_false_once_mended()));
    row("of these the hidden effect found", "-", count(&|case| can_be(case) && case.hides(), &Judged::finds));
}

fn row(metric: &str, target: &str, (hits, of): (usize, usize)) {
    let [low, high] = wilson(hits, of).map(|share| 100.0 * share);
    let share = if of == 0 { String::new() } else { format!(" ({:.1} %)", 100.0 * hits as f64 / of as f64) };
    println!("| {metric} | {target} | {hits}/{of}{share} | {low:.1} to {high:.1} % |");
}

/// 95 % interval of a share (Wilson 1927).
fn wilson(hits: usize, of: usize) -> [f64; 2] {
    let (count, z2) = (of as f64, 1.96_f64.powi(2));
    if of == 0 {
        return [0.0, 1.0];
    }
    let share = hits as f64 / count;
    let middle = (share + z2 / (2.0 * count)) / (1.0 + z2 / count);
    let half = (z2 * (share * (1.0 - share) / count + z2 / (4.0 * count * count))).sqrt() / (1.0 + z2 / count);
    [middle - half, middle + half]
}

/// Faults claimed where nothing is wrong.
fn uncorrupted(lines: &[Line]) {
    let of = |half: &str| lines.iter().filter(|line| line.half == half).collect::<Vec<_>>();
    println!("\n| nothing wrong | target | measured | 95 % |\n| --- | --- | --- | --- |");
    for (half, metric) in
        [(CLEAN_HALF, "no fault claimed, clean sets"), (UNCORRUPTED, "no fault claimed, flights before corruption")]
    {
        let own: Vec<_> = of(half).into_iter().filter(|line| line.part.is_empty()).collect();
        row(metric, "≥ 98 %", (own.iter().filter(|line| line.faults.is_empty()).count(), own.len()));
    }
    let before: Vec<_> = of(UNCORRUPTED).into_iter().filter(|line| line.part.is_empty()).collect();
    let hidden: Vec<_> = before.iter().filter(|line| line.hidden != NULL).collect();
    row(
        "hidden effect found before corruption",
        "-",
        (hidden.iter().filter(|line| line.accepted.contains(&line.hidden)).count(), hidden.len()),
    );
    for line in of(CLEAN_HALF).into_iter().filter(|line| !line.faults.is_empty()) {
        let names: Vec<&str> = line.faults.iter().map(|said| said.name.as_str()).collect();
        println!("\nfault claimed on a clean set: {} (seed {}): {}", line.corruption, line.seed, names.join(", "));
    }
}
