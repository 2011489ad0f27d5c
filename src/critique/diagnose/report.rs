//! What a diagnosis says: the verdict in words, then its figures, and the same as JSON. No measuring here.

use crate::critique::compare::PerChannel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Outcome of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At least one effect of the catalogue is missing.
    EffectsMissing,
    /// Nothing worthwhile is missing.
    Explained,
    /// The error depends on something measured, but on no effect of the catalogue.
    NotInCatalogue,
    /// Too few blocks to judge anything.
    TooLittleData,
    /// The log is not what the program takes it for; nothing was searched.
    ConventionFault,
}

/// What became of one candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Found missing.
    Accepted,
    /// As good as certain to be there, but it would remove less than what is worth while. Also an effect that was accepted and is no longer
    /// worth while beside those accepted later.
    Negligible,
    /// Could be chance.
    NotSignificant,
    /// These flights cannot show it.
    NotExcited,
    /// Fits only with numbers that physics forbids.
    Implausible,
    /// It describes what an accepted effect describes, in other words.
    SamePhysics,
}

/// A number of an accepted effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// Name in the effect.
    pub name: String,
    /// Value; for a property of each flight the mean over the flights.
    pub value: f64,
    /// 95 % interval from resampled blocks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ci95: Option<[f64; 2]>,
    /// Unit.
    pub unit: String,
    /// Usual values for a 5 kg helicopter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<[f64; 2]>,
    /// For a property of each flight: root mean square over the flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_over_flights: Option<f64>,
}

/// A parameter of an accepted effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterValue {
    /// Name in the effect.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Known beforehand.
    pub fixed: bool,
    /// Unit.
    pub unit: String,
    /// Values whose held-out gain is within two standard errors of the best.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<[f64; 2]>,
}

/// One effect that was found missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Identifier.
    pub effect: String,
    /// The physics in one sentence.
    pub meaning: String,
    /// Channels in which it is worth while.
    pub channels: Vec<String>,
    /// Share of the held-out mean squared error that it removes, by channel that it changes.
    pub held_out_mse_fall: BTreeMap<String, f64>,
    /// From sign flips of block scores, over the effect's grid; not corrected for the number of effects.
    pub p_value: f64,
    /// Share of resampled worlds in which it wins.
    pub selection_frequency: f64,
    /// `stable`, `likely` or `tentative`, by selection frequency.
    pub stability: String,
    /// Effects that these flights cannot tell from it.
    pub indistinguishable: Vec<String>,
    /// Numbers that were fitted.
    pub coefficients: Vec<Number>,
    /// Numbers inside its formulas.
    pub parameters: Vec<ParameterValue>,
    /// The manoeuvre that would tell it from what it is mistaken for.
    pub would_tell_apart: String,
    /// The effect as formulas with its numbers in place.
    pub formula: String,
    /// A flight without which its sign would change, if there is one.
    pub rests_on_flight: Option<String>,
}

/// One effect that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CandidateReport {
    /// Identifier.
    pub effect: String,
    /// What became of it.
    pub status: Status,
    /// Share of the held-out mean squared error that it would remove, by channel that it changes, beside all accepted effects.
    pub held_out_mse_fall: BTreeMap<String, f64>,
    /// As of [`Step::p_value`]; absent where it could not be tried.
    pub p_value: Option<f64>,
    /// Share of the error that it would have to remove to be found in four of five data sets like this one.
    pub detection_limit_mse_fall: Option<f64>,
    /// Why, in words, where there is more to say.
    pub note: Option<String>,
}

/// The confirmation on flights that no search has seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Locked {
    /// `locked` flights, or `test` spans of flights.
    pub part: String,
    /// Length, s.
    pub duration_s: f64,
    /// Root mean square error before.
    pub rmse_before: PerChannel,
    /// And with the accepted effects.
    pub rmse_after: PerChannel,
    /// Share of the mean squared error removed, by channel, with its 95 % interval from blocks.
    pub mse_fall: BTreeMap<String, [f64; 3]>,
    /// Root mean square error with none, one, two … of the accepted effects, in order of acceptance.
    pub waterfall: Vec<PerChannel>,
}

/// What the search looked at and how it decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Method {
    /// Blocks searched.
    pub blocks: usize,
    /// Their length, s.
    pub block_s: f64,
    /// Time over which residuals are correlated, s.
    pub correlation_s: f64,
    /// Time searched, s.
    pub searched_s: f64,
    /// Seed of folds, flips and resampling.
    pub seed: u64,
    /// Effects in play, for the correction of p-values.
    pub effects_in_play: usize,
    /// Largest p-value of an accepted effect.
    pub largest_p_value: f64,
    /// Smallest share of a channel's held-out error that is worth an effect.
    pub smallest_fall: f64,
}

/// Result of `diagnose`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Outcome.
    pub verdict: Verdict,
    /// One or two sentences for a person.
    pub summary: String,
    /// Effects found missing, in order.
    pub accepted: Vec<String>,
    /// The same with their figures.
    pub steps: Vec<Step>,
    /// Every effect that was tried.
    pub candidates: Vec<CandidateReport>,
    /// On what the rest of the error depends, if it depends on anything measured.
    pub unknown: Option<Vec<UnknownChannel>>,
    /// The confirmation.
    pub locked: Option<Locked>,
    /// How it was searched.
    pub method: Option<Method>,
    /// What a person should know besides.
    pub notes: Vec<String>,
    /// Time taken, s.
    pub seconds: f64,
    /// Version of this program.
    pub version: String,
    /// Hash of the data.
    pub data_sha256: String,
}

/// On what the rest of one channel's error depends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnknownChannel {
    /// Channel.
    pub channel: String,
    /// Share of the rest's variance that measured variables predict on blocks not learned from.
    pub r2: f64,
    /// What R² reaches by chance in one of twenty data sets.
    pub null_r2_95: f64,
    /// The most important variables first.
    pub depends_on: Vec<DependsOn>,
    /// The shape in words.
    pub shape: String,
    /// A formula to paste into the model file.
    pub suggested_formula: Option<String>,
    /// Its coefficient, to start from.
    pub suggested_coefficient: Option<f64>,
}

/// One variable of an unknown dependence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DependsOn {
    /// Name.
    pub variable: String,
    /// Its share of the dependence.
    pub share: f64,
}

impl Diagnosis {
    /// One that says nothing but its verdict, by this version of the program.
    pub fn nothing(verdict: Verdict, summary: String) -> Self {
        Self {
            verdict,
            summary,
            accepted: Vec::new(),
            steps: Vec::new(),
            candidates: Vec::new(),
            unknown: None,
            locked: None,
            method: None,
            notes: Vec::new(),
            seconds: 0.0,
            version: env!("CARGO_PKG_VERSION").into(),
            data_sha256: String::new(),
        }
    }

    /// Whether the flights that no search has seen show a fall of the error, beyond its 95 % interval, in a channel in which an accepted
    /// effect is worth while. Without such flights nothing is confirmed.
    pub fn is_confirmed(&self) -> bool {
        let Some(locked) = &self.locked else { return false };
        let mut channels = self.steps.iter().flat_map(|step| &step.channels);
        channels.any(|channel| locked.mse_fall.get(channel).is_some_and(|[_, low, _]| *low > 0.0))
    }
}

impl Verdict {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::EffectsMissing => "effects missing",
            Self::Explained => "explained",
            Self::NotInCatalogue => "not in the catalogue",
            Self::TooLittleData => "too little data",
            Self::ConventionFault => "convention fault",
        }
    }
}

impl Status {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Negligible => "negligible",
            Self::NotSignificant => "not significant",
            Self::NotExcited => "not excited",
            Self::Implausible => "implausible",
            Self::SamePhysics => "same physics",
        }
    }
}

fn percent(falls: &BTreeMap<String, f64>) -> String {
    let parts: Vec<String> = falls.iter().map(|(channel, fall)| format!("{channel} {:.1} %", 100.0 * fall)).collect();
    if parts.is_empty() { "-".into() } else { parts.join(", ") }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Verdict: {}. {}", self.verdict.words(), self.summary)?;
        for (number, step) in self.steps.iter().enumerate() {
            writeln!(f, "\n{}. {}: {}", number + 1, step.effect, step.meaning)?;
            writeln!(f, "   held-out error falls: {}", percent(&step.held_out_mse_fall))?;
            writeln!(
                f,
                "   p = {:.4}; wins in {:.0} % of resampled worlds ({})",
                step.p_value,
                100.0 * step.selection_frequency,
                step.stability
            )?;
            for number in &step.coefficients {
                let ci = number.ci95.map(|[low, high]| format!(" [{low:.4}, {high:.4}]")).unwrap_or_default();
                let usual = number.expected.map(|[low, high]| format!("; usual {low} to {high}")).unwrap_or_default();
                let spread = number.rms_over_flights.map(|rms| format!("; rms over flights {rms:.4}")).unwrap_or_default();
                writeln!(f, "   {} = {:.4}{ci} {}{usual}{spread}", number.name, number.value, number.unit)?;
            }
            for parameter in &step.parameters {
                let how = if parameter.fixed {
                    "known".into()
                } else {
                    parameter.profile.map_or("fitted".into(), |[low, high]| format!("fitted, {low:.4} to {high:.4}"))
                };
                writeln!(f, "   {} = {:.4} {} ({how})", parameter.name, parameter.value, parameter.unit)?;
            }
            if step.indistinguishable.is_empty() {
                writeln!(f, "   nothing else fits as well")?;
            } else {
                writeln!(
                    f,
                    "   these flights cannot tell it from {}; to tell: {}",
                    step.indistinguishable.join(", "),
                    step.would_tell_apart
                )?;
            }
            if let Some(flight) = &step.rests_on_flight {
                writeln!(f, "   CAUTION: rests on flight `{flight}` alone")?;
            }
        }
        for unknown in self.unknown.iter().flatten() {
            let on: Vec<String> =
                unknown.depends_on.iter().take(3).map(|on| format!("{} ({:.0} %)", on.variable, 100.0 * on.share)).collect();
            writeln!(f, "\nUnknown: {} depends on {} (R2 {:.2})", unknown.channel, on.join(", "), unknown.r2)?;
            writeln!(f, "   {}", unknown.shape)?;
            if let Some(formula) = &unknown.suggested_formula {
                writeln!(
                    f,
                    "   to try, in the model file:\n     [[effect]]\n     kind = \"formula\"\n     name = \"suggested_{0}\"\n     \
                     channel = \"{0}\"\n     formula = \"{formula}\"\n     coefficient = {1:.4}",
                    unknown.channel,
                    unknown.suggested_coefficient.unwrap_or_default()
                )?;
            }
        }
        if let Some(locked) = &self.locked {
            writeln!(f, "\nOn {:.0} s that no search has seen ({}):", locked.duration_s, locked.part)?;
            let row = |values: &PerChannel| {
                values
                    .channels()
                    .iter()
                    .map(|value| value.map_or_else(|| format!("{:>9}", "-"), |value| format!("{value:>9.4}")))
                    .collect::<String>()
            };
            writeln!(
                f,
                "   {:<28}{}",
                "RMSE",
                crate::flight::Column::TARGETS.map(|column| format!("{:>9}", column.name())).concat()
            )?;
            for (step, values) in locked.waterfall.iter().enumerate() {
                let name = if step == 0 {
                    "model".into()
                } else {
                    self.accepted.get(step - 1).map_or_else(String::new, |id| format!("+ {id}"))
                };
                writeln!(f, "   {name:<28}{}", row(values))?;
            }
            for (channel, [fall, low, high]) in &locked.mse_fall {
                writeln!(f, "   {channel}: error removed {:.1} % [{:.1}, {:.1}]", 100.0 * fall, 100.0 * low, 100.0 * high)?;
            }
        }
        writeln!(f, "\n{:<20}{:<17}{:>9}{:>12}  fall", "effect", "status", "p", "limit")?;
        for candidate in &self.candidates {
            let p = candidate.p_value.map_or("-".into(), |p| format!("{p:.4}"));
            let limit = candidate.detection_limit_mse_fall.map_or("-".into(), |limit| format!("{:.1} %", 100.0 * limit));
            let note = candidate.note.as_ref().map(|note| format!("  {note}")).unwrap_or_default();
            writeln!(
                f,
                "{:<20}{:<17}{p:>9}{limit:>12}  {}{note}",
                candidate.effect,
                candidate.status.words(),
                percent(&candidate.held_out_mse_fall)
            )?;
        }
        if let Some(method) = &self.method {
            writeln!(
                f,
                "\n{} blocks of {:.1} s, {:.0} s searched; accepted: p <= {:.4} ({} effects in play) and at least {:.1} % of a channel's held-out error",
                method.blocks,
                method.block_s,
                method.searched_s,
                method.largest_p_value,
                method.effects_in_play,
                100.0 * method.smallest_fall
            )?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))?;
        write!(f, "{:.1} s", self.seconds)
    }
}
