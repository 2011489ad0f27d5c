//! The page of `diagnose` and `loop`: the verdict in words, then ten views of what the model got wrong and what was found missing.
//!
//! Arranges the numbers of [`Diagnosis`] and of the critique on a [`Page`]; it judges nothing itself. Views that look at flights are in
//! `views.rs`, tables of the diagnosis in `tables.rs`.

mod tables;
mod views;

use super::page::{Page, Part, Section};
use crate::critique::diagnose::sentences::{self, change, unseen};
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
    /// Where the numbers come from: (what, value).
    pub provenance: &'a [(String, String)],
}

/// Titles of the ten views, in order.
pub const VIEWS: [&str; 10] = [
    "1 Measured and predicted",
    "2 Where the error lies",
    "3 Residual against each variable",
    "4 Residual over two variables",
    "5 Regions that hold the error",
    "6 How long the residual lasts, and whether the sticks follow it",
    "7 Every effect that was tried",
    "8 How the error falls from effect to effect",
    "9 What cannot be judged, and which flight would tell",
    "10 Where these numbers come from",
];

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
    let section = |number: usize, parts: Vec<Part>| Section { title: VIEWS[number].into(), parts };
    let mut sections = Vec::new();
    if last.verdict == Verdict::ConventionFault {
        let mut parts = vec![Part::Text(
            "Nothing was searched: with a wrong axis, sign or unit every effect would be named for the wrong reason. Mend the \
             description of the data and ask again."
                .into(),
        )];
        parts.extend(last.notes.iter().cloned().map(Part::Text));
        sections.push(Section { title: "What to set".into(), parts });
    } else {
        let found = tables::found(report);
        if !found.is_empty() {
            sections.push(Section { title: "Effects found, the largest first".into(), parts: found });
        }
        let suggested = tables::suggestions(report);
        if !suggested.is_empty() {
            sections.push(Section { title: "What to try next".into(), parts: suggested });
        }
        let views = views::views(report)?;
        sections.extend(views.into_iter().enumerate().map(|(number, parts)| section(number, parts)));
        sections.push(section(6, tables::ranking(report)));
        sections.push(section(7, tables::waterfall(report)));
        sections.push(section(8, tables::not_judged(report.together.unwrap_or(last))));
    }
    sections.push(section(9, tables::provenance(report)?));
    Ok(Page { title: report.title.to_owned(), summary: summary(report.told()), sections })
}

/// Of as many effects the summary says what they cannot be told from; of more the list does.
const MOST_IN_SUMMARY: usize = 3;

/// The verdict in words.
fn summary(diagnoses: &[Diagnosis]) -> Vec<String> {
    let mut out = Vec::new();
    for (round, diagnosis) in diagnoses.iter().enumerate() {
        let round = if diagnoses.len() > 1 { format!("Round {}: ", round + 1) } else { "Verdict: ".into() };
        out.push(format!("{round}{}. {}", sentences::headline(diagnosis), diagnosis.summary));
        // Of many effects the list says it.
        let listed = diagnosis.steps.len() > MOST_IN_SUMMARY;
        for step in &diagnosis.steps {
            if !step.indistinguishable.is_empty() && !listed {
                let others = step.indistinguishable.join(", ");
                out.push(format!("These flights cannot tell {} from {others}. To tell: {}.", step.effect, step.would_tell_apart));
            }
            if let Some(flight) = &step.rests_on_flight {
                out.push(format!("Caution: {} rests on flight {flight} alone.", step.effect));
            }
        }
    }
    for diagnosis in diagnoses {
        let Some(locked) = diagnosis.locked.as_ref().filter(|locked| !locked.mse_fall.is_empty()) else { continue };
        let changes: Vec<String> = locked.mse_fall.iter().map(|(channel, fall)| change(channel, *fall)).collect();
        let changes = changes.join("; ");
        // The verdict gives those of the channels in which an effect is worth while, often all.
        if !diagnosis.summary.contains(&changes) {
            out.push(format!("Mean squared error on {}: {changes}.", unseen(locked.kept, locked.duration_s)));
        }
        out.extend(sentences::removable(locked));
    }
    out
}

/// What the catalogue knows about an effect, if it is one of the catalogue.
fn notes(effect: &str) -> Option<&'static crate::physics::Notes> {
    catalogue::definition(effect).and_then(|definition| definition.notes.as_ref())
}
