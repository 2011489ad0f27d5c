//! The page of `diagnose` and `loop`: the verdict in words and the strip of errors first, then what was found, what is left, and pictures of
//! where the model fails.
//!
//! Arranges the numbers of [`Diagnosis`] and of the critique on a [`Page`]; it judges nothing itself. Words and strip of the first screen are
//! in `first.rs`, pictures of flights in `views.rs` and `residuals.rs`, tables of the diagnosis in `tables.rs`.

mod first;
mod residuals;
mod tables;
mod views;

use super::compare::{CompareReport, judged_sections};
use super::page::{Page, Part, Section};
use crate::critique::diagnose::{Diagnosis, Verdict};
use crate::error::{Error, Result};
use crate::flight::{Flight, Span};
use crate::physics::{Effect, Model, catalogue};

/// What [`diagnose_page`] shows.
#[derive(Clone, Copy, Debug)]
pub struct DiagnoseReport<'a> {
    /// What the page is about.
    pub title: &'a str,
    /// One for a single diagnosis, one a round for a loop.
    pub diagnoses: &'a [Diagnosis],
    /// The rounds of a loop as one (see [`crate::critique::diagnose::together`]): what is said of the whole, where it is given.
    pub together: Option<&'a Diagnosis>,
    /// The flights that the spans point into.
    pub flights: &'a [Flight],
    /// What was searched.
    pub searched: &'a [Span],
    /// What only confirms.
    pub locked: &'a [Span],
    /// The model as it was given, calibrated on what was searched.
    pub before: &'a Model,
    /// The model with what was found; equal to `before` if nothing was.
    pub after: &'a Model,
    /// Models and networks compared on the same locked flights afterwards, where that was done: their errors, shares and lines then stand on this
    /// page.
    pub compared: Option<&'a CompareReport<'a>>,
    /// Where the numbers come from: (what, value).
    pub provenance: &'a [(String, String)],
}

/// Titles of the sections that look at flights, in order.
pub const VIEWS: [&str; 6] = [
    "Measured and predicted",
    "Where the error lies",
    "What the residual goes with",
    "The residual over two variables",
    "Regions that hold the error",
    "How long the residual lasts, and whether the sticks follow it",
];

/// Titles of the last two sections.
pub const ENDS: [&str; 2] = ["What was tried and not named", "Where these numbers come from"];

impl DiagnoseReport<'_> {
    /// What is said of the whole: the rounds as one, or each for itself.
    fn told(&self) -> &[Diagnosis] {
        self.together.map_or(self.diagnoses, std::slice::from_ref)
    }

    /// The effects that the model after has and the model before has not.
    fn added(&self) -> impl Iterator<Item = (usize, &Effect)> {
        let had = |name: &str| self.before.effect(name).is_some_and(|effect| effect.enabled);
        self.after.effects.iter().enumerate().filter(move |(_, effect)| effect.enabled && !had(&effect.name))
    }
}

/// The page of a diagnosis. After a convention fault it is short: the verdict, what to set, and where it comes from.
///
/// # Errors
/// [`Error::Shape`] without a diagnosis or with spans outside the flights, and as [`Model::predict`].
pub fn diagnose_page(report: &DiagnoseReport<'_>) -> Result<Page> {
    let nothing = || Error::Shape { operation: "report", message: "a page needs a diagnosis".into() };
    let last = report.diagnoses.last().ok_or_else(nothing)?;
    let section = |title: &str, parts: Vec<Part>| Section { title: title.into(), parts };
    let (mut sections, mut first) = (Vec::new(), Vec::new());
    if last.verdict == Verdict::ConventionFault {
        let mut parts = vec![Part::Text(
            "Nothing was searched: with a wrong axis, sign or unit every effect would be named for the wrong reason. Mend the \
             description of the data and ask again."
                .into(),
        )];
        parts.extend(last.notes.iter().cloned().map(Part::Text));
        sections.push(section("What to set", parts));
    } else {
        first = first::strip(report);
        let found = tables::found(report);
        if !found.is_empty() {
            sections.push(section("What was missing", found));
        }
        let suggested = tables::suggestions(report);
        if !suggested.is_empty() {
            sections.push(section("What is left, and what to try", suggested));
        }
        let views = views::views(report)?;
        sections.extend(VIEWS.into_iter().zip(views).map(|(title, parts)| section(title, parts)));
        sections.extend(report.compared.map(judged_sections).unwrap_or_default());
        sections.push(section(ENDS[0], tables::not_named(report)));
    }
    sections.push(section(ENDS[1], tables::provenance(report)?));
    Ok(Page { title: report.title.to_owned(), summary: first::summary(report.told()), first, sections })
}

/// What the catalogue knows about an effect, if it is one of the catalogue.
fn notes(effect: &str) -> Option<&'static crate::physics::Notes> {
    catalogue::definition(effect).and_then(|definition| definition.notes.as_ref())
}
