//! What a diagnosis holds, as data and as JSON. Its sentences are in `sentences`, its layout for a terminal in `text`; no measuring here.

use crate::critique::channels::{ChannelValues, Intervals};
use crate::critique::shares::Share;
use crate::flight::{Channel, PerChannel, Span};
use crate::physics::SignFinding;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    /// Usual values for a 5 kg helicopter, if the vehicle is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<[f64; 2]>,
    /// Whether the estimate shows the sign that physics fixes, if it fixes one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sign: Option<SignFinding>,
    /// Whether it was held on the side of zero that physics gives it, as only the other one would fit.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub held: bool,
    /// For a property of each flight: root mean square over the flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_over_flights: Option<f64>,
    /// The same flight by flight.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub by_flight: BTreeMap<String, f64>,
    /// The flight on which it hangs most, if it hangs on one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub influence: Option<Influence>,
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
    /// The flight on which it hangs most, if it hangs on one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub influence: Option<Influence>,
}

/// A flight without which a number would lie outside its own 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Influence {
    /// Name of the flight.
    pub flight: String,
    /// The number on the other flights; `None` where they do not determine it.
    pub without: Option<f64>,
}

/// One effect that was found missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// What could be wrong with the log instead, and how that would differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault_of_log: Option<String>,
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
    /// What decided its status, in words.
    #[serde(default)]
    pub reason: String,
    /// Further words, where there is more to say.
    pub note: Option<String>,
}

/// What was kept from a search to confirm on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kept {
    /// Whole flights.
    #[default]
    Flights,
    /// The last part of each flight.
    Ends,
    /// Pieces out of the middle of flights that were searched otherwise.
    Segments,
}

impl Kept {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Flights => "flights",
            Self::Ends => "ends of flights",
            Self::Segments => "segments",
        }
    }
}

/// What the part that no search has seen says of the accepted effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Confirmation {
    /// In a channel in which an effect is worth while the error falls, beyond its interval.
    Confirmed,
    /// It falls in none and grows in at least one, beyond its interval.
    Contradicted,
    /// Neither.
    Open,
    /// Nothing was kept to confirm on.
    NothingKept,
}

/// The confirmation on the part that no search has seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Locked {
    /// `locked` flights, or `test` spans of flights.
    pub part: String,
    /// What it is made of.
    #[serde(default)]
    pub kept: Kept,
    /// Length of what is judged, s.
    pub duration_s: f64,
    /// Whether some model has numbers of each flight (wind, biases): flights that no fit has seen are then judged on their second halves, those
    /// numbers being found from the first; every model of the table is judged on the same.
    #[serde(default)]
    pub own_from_first_half: bool,
    /// What is judged.
    #[serde(skip)]
    pub spans: Vec<Span>,
    /// Root mean square error before.
    pub rmse_before: ChannelValues,
    /// And with the accepted effects.
    pub rmse_after: ChannelValues,
    /// Share of the mean squared error removed, by channel, with its 95 % interval from blocks.
    pub mse_fall: BTreeMap<String, [f64; 3]>,
    /// The model as it was given, then with more and more of the accepted effects.
    pub waterfall: Vec<Bar>,
    /// Root mean square error that no model can go below, where the explainable part of the flights is known; see [`Locked::set_floor`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<ChannelValues>,
    /// With a floor: share of the mean squared error above it that was removed; its `mean` is that of the channels that have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub removable_removed: Option<ChannelValues>,
}

/// A bar of the waterfall.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bar {
    /// Effects that it adds to the bar before it; the first adds nothing.
    pub added: Vec<String>,
    /// Root mean square error with them.
    pub rmse: ChannelValues,
    /// Its 95 % interval, from the scatter between blocks; for pictures.
    #[serde(skip)]
    pub rmse_ci95: Intervals,
    /// Channels in which the mean squared error rises against the bar before by more than chance: by which share, and its interval; those of all
    /// bars hold together with 95 %.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rises: BTreeMap<String, Share>,
}

impl Bar {
    /// What it is called.
    pub fn name(&self) -> String {
        match self.added.as_slice() {
            [] => "model".into(),
            [one] => format!("+ {one}"),
            several => format!("+ {} effects", several.len()),
        }
    }
}

/// What one effect is worth on the part that no search has seen, all others being in: the model without it against the model with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Worth {
    /// Identifier.
    pub effect: String,
    /// What would come back without it: (mean squared error without it − with it) / mean squared error before anything was added, by
    /// channel, with its 95 % interval from blocks; of a channel that it does not change there is nothing.
    pub share: BTreeMap<String, Share>,
    /// The same relative to what is left: mean squared error without it over that with it, less 1.
    pub rise: BTreeMap<String, f64>,
    /// Whether the other effects were fitted again without it; otherwise they stayed as they were.
    pub refitted: bool,
}

impl Worth {
    /// What it is worth at least, in the channel where that is most.
    pub fn at_least(&self) -> f64 {
        self.share.values().map(Share::at_least).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Least share of the mean squared error that must lie above the floor before shares of it are given: of less, a share says nothing.
const LEAST_REMOVABLE: f64 = 0.05;

impl Locked {
    /// Notes the floor (a root mean square error by channel) and the share removed of what lies above it:
    /// (before² − after²) / (before² − floor²) of root mean square errors. A channel with less than 5 % of its error above the floor has none.
    pub fn set_floor(&mut self, floor: ChannelValues) {
        let square = |of: &ChannelValues, channel: Channel| of.channels()[channel].map(|rmse| rmse * rmse);
        let share = |channel: Channel| {
            let [before, after] = [&self.rmse_before, &self.rmse_after].map(|rmse| square(rmse, channel));
            let (before, after, floor) = (before?, after?, square(&floor, channel)?);
            (before - floor > LEAST_REMOVABLE * before).then(|| (before - after) / (before - floor))
        };
        let mut removed = ChannelValues::new(PerChannel::from_fn(share));
        let known: Vec<f64> = removed.channels().into_iter().flatten().collect();
        removed.mean = (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64);
        (self.floor, self.removable_removed) = (Some(floor), Some(removed));
    }
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
    /// What the part that no search has seen says of the accepted effects; absent where none was accepted.
    #[serde(default)]
    pub confirmation: Option<Confirmation>,
    /// Where the error lies that is left.
    #[serde(default)]
    pub failure: Option<Failure>,
    /// On what the rest of the error depends, if it depends on anything measured.
    pub unknown: Option<Vec<UnknownChannel>>,
    /// The confirmation.
    pub locked: Option<Locked>,
    /// What each accepted effect is worth there with all others in, by what it is at least, the largest first; empty where it was not measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub worth: Vec<Worth>,
    /// Whether all effects were fitted at once and the needless left out, after a search that adds one after the other.
    #[serde(default)]
    pub both_roads: bool,
    /// How it was searched.
    pub method: Option<Method>,
    /// What a person should know besides.
    pub notes: Vec<String>,
    /// Time taken, s; 0 where there is no clock.
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
    /// A formula to paste into the model file; only one that held on the part that no search has seen, where something was kept.
    pub suggested_formula: Option<String>,
    /// Its coefficient, calibrated on what was searched.
    pub suggested_coefficient: Option<f64>,
    /// How the formula did that was suggested by the shape, whether it held or not.
    #[serde(default)]
    pub tried: Option<TriedFormula>,
}

/// A suggested formula, calibrated on what was searched and measured on what was not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriedFormula {
    /// The formula.
    pub formula: String,
    /// Its coefficient.
    pub coefficient: f64,
    /// Share of the channel's mean squared error that it removes on searched blocks that it was not fitted to.
    pub held_out_mse_fall: f64,
    /// Share that it removes on the part that no search has seen, with its 95 % interval; absent where nothing was kept.
    pub locked_mse_fall: Option<[f64; 3]>,
    /// Root mean square error of the channel there with the formula.
    pub locked_rmse: Option<f64>,
}

impl TriedFormula {
    /// Whether it stands: its interval is above zero, or nothing was kept to measure it on.
    pub fn holds(&self) -> bool {
        self.locked_mse_fall.is_none_or(|[_, low, _]| low > 0.0)
    }
}

/// Where the error lies that is left: the fewest channels that hold most of it, each channel's error taken over its variance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// `locked`, `test` or `searched`: on which part.
    pub on: String,
    /// The channels, the worst first.
    pub channels: Vec<FailureChannel>,
}

/// One channel of a [`Failure`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailureChannel {
    /// Channel.
    pub channel: String,
    /// Its share of the error of all channels, each over its variance.
    pub share: f64,
    /// Mean squared error over the channel's variance.
    pub unexplained: f64,
    /// Measured variables on which what is left depends.
    pub depends_on: Vec<String>,
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
    /// The accepted effects in the order of what they are worth, the largest first; in order of acceptance where that was not measured.
    pub fn by_worth(&self) -> Vec<(&Step, Option<&Worth>)> {
        let place = |step: &Step| self.worth.iter().position(|worth| worth.effect == step.effect);
        let mut steps: Vec<&Step> = self.steps.iter().collect();
        steps.sort_by_key(|step| place(step).unwrap_or(usize::MAX));
        steps.into_iter().map(|step| (step, place(step).and_then(|place| self.worth.get(place)))).collect()
    }

    /// One that says nothing but its verdict, by this version of the program.
    pub fn nothing(verdict: Verdict, summary: String) -> Self {
        Self {
            verdict,
            summary,
            accepted: Vec::new(),
            steps: Vec::new(),
            candidates: Vec::new(),
            confirmation: None,
            failure: None,
            unknown: None,
            locked: None,
            worth: Vec::new(),
            both_roads: false,
            method: None,
            notes: Vec::new(),
            seconds: 0.0,
            version: env!("CARGO_PKG_VERSION").into(),
            data_sha256: String::new(),
        }
    }

    /// What the part that no search has seen says of the accepted effects: `None` where none was accepted.
    pub(super) fn confirmed(&self) -> Option<Confirmation> {
        if self.steps.is_empty() {
            return None;
        }
        let Some(locked) = &self.locked else { return Some(Confirmation::NothingKept) };
        let channels = self.steps.iter().flat_map(|step| &step.channels);
        let grows = |[_, _, high]: &[f64; 3]| *high < 0.0;
        let mut told = channels.filter_map(|channel| locked.mse_fall.get(channel));
        Some(match self.is_confirmed() {
            true => Confirmation::Confirmed,
            false if told.any(grows) => Confirmation::Contradicted,
            false => Confirmation::Open,
        })
    }

    /// Whether the part that no search has seen shows a fall of the error, beyond its 95 % interval, in a channel in which an accepted
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_removable_share_is_of_what_lies_above_the_floor() {
        let all = |value: f64| ChannelValues::new(PerChannel::splat(Some(value)));
        let mut locked = Locked { rmse_before: all(5.0), rmse_after: all(4.0), ..Locked::default() };
        // Above the floor lie 25 - 9 = 16, of which 9 were removed; in the last channel nothing to speak of lies above it.
        let mut floor = all(3.0).channels();
        floor[Channel::WzDot] = Some(4.999);
        locked.set_floor(ChannelValues::new(floor));
        let removed = locked.removable_removed.unwrap_or_default();
        assert_eq!((removed.vx_dot, removed.wz_dot, removed.mean), (Some(9.0 / 16.0), None, Some(9.0 / 16.0)));
        // A model below its floor is impossible but for chance; it is shown as it is.
        locked.rmse_after = all(2.0);
        locked.set_floor(all(3.0));
        assert_eq!(locked.removable_removed.and_then(|removed| removed.vy_dot), Some(21.0 / 16.0));
    }

    #[test]
    fn steps_come_in_the_order_of_their_worth_and_those_without_come_last() {
        let step = |effect: &str| Step { effect: effect.into(), ..Step::default() };
        let worth = |effect: &str| Worth { effect: effect.into(), ..Worth::default() };
        let diagnosis = Diagnosis {
            steps: ["a", "b", "c"].map(step).into(),
            worth: ["c", "a"].map(worth).into(),
            ..Diagnosis::nothing(Verdict::EffectsMissing, String::new())
        };
        let order: Vec<(&str, bool)> =
            diagnosis.by_worth().into_iter().map(|(step, worth)| (step.effect.as_str(), worth.is_some())).collect();
        assert_eq!(order, [("c", true), ("a", true), ("b", false)]);
    }
}
