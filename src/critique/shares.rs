//! The network as judge: which share of the error named physics explains, which share only the network does, and what neither
//! does. Takes the stages of a hybrid as numbers; no model and no network here.
//!
//! With mean square errors over the same windows, of a reference, of the model the network was trained on, and of the hybrid:
//!
//! physics = (MSE_ref − MSE_model) / MSE_ref, network = (MSE_model − MSE_hybrid) / MSE_ref, neither = MSE_hybrid / MSE_ref.
//!
//! They add up to 1. A part that makes things worse has a negative share, which is shown as it is. "Neither" holds sensor noise,
//! gusts, and physics that the network did not learn: it bounds the noise from above and is not the noise.

use super::Row;
use super::channels::ChannelValues;
use super::digits::{aligned, significant};
use super::predictions::{check_row, measured, variation};
use super::wrap::wrapped;
use crate::blocks::{BlockMean, BlockSum, Blocks, FEW_BLOCKS};
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, Window};
use crate::hybrid::Stages;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Name of the reference where no model is one: the mean of each measured channel over the windows judged.
pub const MEAN: &str = "mean of the measurements";

/// A share of the reference's error, 1 being all of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// The share; negative where the part makes the error larger.
    pub share: f64,
    /// 95 % interval from paired sums over blocks of ten seconds; `None` with fewer than two blocks. It says how far the share
    /// would move on other flights of the same kind, not on another training of the network.
    pub ci95: Option<[f64; 2]>,
}

impl Share {
    /// What it is at least: the lower end of its interval, or itself where there is none.
    pub fn at_least(&self) -> f64 {
        self.ci95.map_or(self.share, |[low, _]| low)
    }
}

/// One part's share of each channel, and of all channels together: squared errors over the channel's variance, summed over the
/// channels. `None` where the reference has no error, or a prediction is not finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShareOf {
    /// Of d(vx)/dt.
    pub vx_dot: Option<Share>,
    /// Of d(vy)/dt.
    pub vy_dot: Option<Share>,
    /// Of d(vz)/dt.
    pub vz_dot: Option<Share>,
    /// Of d(wx)/dt.
    pub wx_dot: Option<Share>,
    /// Of d(wy)/dt.
    pub wy_dot: Option<Share>,
    /// Of d(wz)/dt.
    pub wz_dot: Option<Share>,
    /// Of all channels, each over its variance; absent if one of them is.
    pub mean: Option<Share>,
}

impl ShareOf {
    /// The six shares in the order of [`Column::TARGETS`], then the one of all channels.
    pub const fn all(&self) -> [Option<Share>; 7] {
        [self.vx_dot, self.vy_dot, self.vz_dot, self.wx_dot, self.wy_dot, self.wz_dot, self.mean]
    }

    /// What is not in it: one minus each share.
    fn rest(self) -> Self {
        let rest = |of: Share| Share { share: 1.0 - of.share, ci95: of.ci95.map(|[low, high]| [1.0 - high, 1.0 - low]) };
        Self::new(self.all().map(|share| share.map(rest)))
    }

    const fn new(all: [Option<Share>; 7]) -> Self {
        let [vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot, mean] = all;
        Self { vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot, mean }
    }
}

/// The network's share, split between the linear history and the network itself. The two add up to [`Shares::network`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OfNetwork {
    /// (MSE_model − MSE_(model + linear history)) / MSE_ref.
    pub linear_history: ShareOf,
    /// (MSE_(model + linear history) − MSE_hybrid) / MSE_ref.
    pub network_itself: ShareOf,
}

/// Who explains what, for one trained network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shares {
    /// Name of the network.
    pub name: String,
    /// Name of the model it was trained on.
    pub model: String,
    /// What the shares are of: a model's name, or [`MEAN`], whose mean square error is the variance of the measurements.
    pub reference: String,
    /// Blocks of ten seconds that the windows lie in.
    pub blocks: usize,
    /// What the named physics of the model explains.
    pub physics: ShareOf,
    /// What only the learned parts explain: the network, and the linear history if there is one.
    pub network: ShareOf,
    /// What neither explains.
    pub neither: ShareOf,
    /// The network's share in two, if the hybrid has a linear history.
    pub of_network: Option<OfNetwork>,
    /// The part of "neither" that no model can remove, where the explainable part of the flights is known; the command line sets it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<ShareOf>,
}

/// Who is judged.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    /// Name of the network.
    pub name: &'a str,
    /// Name of the model it was trained on.
    pub model: &'a str,
    /// Its predictions, part by part.
    pub stages: &'a Stages,
}

/// The shares of one network. Without a `reference` they are shares of the variance of the measurements about their mean over
/// the windows; the share of physics is then R² of the model.
///
/// Each share is a ratio of two sums over windows. Its interval treats blocks of ten seconds as independent and pairs numerator
/// and denominator block by block, so that a hard block does not count as scatter twice; mean and variance of the measurements
/// count as known. What is left over is never negative, so the intervals of "neither" and of physics (one minus what the model
/// leaves) are made on its logarithm; that of the network, a difference, is symmetric. With few blocks of very unequal error they
/// are a little short: on made-up blocks with exponential error they covered 88 % with 8 blocks and 91 to 92 % with 30.
///
/// # Errors
/// [`Error::Shape`](crate::Error::Shape) if a prediction is missing for a window, or a window lies outside its flight.
pub fn shares(flights: &[Flight], windows: &[Window], reference: Option<&Row>, judged: &Judged<'_>) -> Result<Shares> {
    let measured = measured(flights, windows)?;
    let blocks = Blocks::new(flights, windows);
    let row = |predicted: &[PerChannel<f64>]| Row { name: judged.name.to_owned(), predicted: predicted.to_vec() };
    let sums = |row: Row| {
        check_row(&row, windows)?;
        Ok::<_, crate::Error>(block_sums(&measured, &row.predicted, &blocks))
    };
    let of_reference = match reference {
        Some(reference) => sums(reference.clone())?,
        None => {
            let count = measured.len().max(1) as f64;
            let mean = PerChannel::from_fn(|channel| measured.iter().map(|y| y[channel]).sum::<f64>() / count);
            block_sums(&measured, &vec![mean; measured.len()], &blocks)
        }
    };
    let model = sums(row(&judged.stages.physics))?;
    let hybrid = sums(row(&judged.stages.hybrid))?;
    let linear = judged.stages.with_linear.as_ref().map(|predicted| sums(row(predicted))).transpose()?;
    let weights: PerChannel<Option<f64>> =
        PerChannel::from_fn(|channel| variation(&measured, channel).map(|total| measured.len() as f64 / total));
    let of = |from: &[PerChannel<f64>], to: &[PerChannel<f64>]| share_of(from, to, &of_reference, &weights);
    let left = |by: &[PerChannel<f64>]| share_left(by, &of_reference, &weights);
    Ok(Shares {
        name: judged.name.to_owned(),
        model: judged.model.to_owned(),
        reference: reference.map_or(MEAN, |row| row.name.as_str()).to_owned(),
        blocks: blocks.len(),
        physics: left(&model).rest(),
        network: of(&model, &hybrid),
        neither: left(&hybrid),
        of_network: linear.map(|linear| OfNetwork { linear_history: of(&model, &linear), network_itself: of(&linear, &hybrid) }),
        floor: None,
    })
}

/// Σ (y − ŷ)² of each block and channel.
fn block_sums(measured: &[PerChannel<f64>], predicted: &[PerChannel<f64>], blocks: &Blocks) -> Vec<PerChannel<f64>> {
    let mut sums = vec![PerChannel::splat(0.0); blocks.len()];
    for ((y, p), block) in measured.iter().zip(predicted).zip(&blocks.of_window) {
        for (sum, (y, p)) in sums[*block].iter_mut().zip(y.iter().zip(p)) {
            *sum += (y - p).powi(2);
        }
    }
    sums
}

/// Σ (from − to) / Σ reference of each channel, and of all with `weights`.
fn share_of(
    from: &[PerChannel<f64>],
    to: &[PerChannel<f64>],
    reference: &[PerChannel<f64>],
    weights: &PerChannel<Option<f64>>,
) -> ShareOf {
    let changes: Vec<PerChannel<f64>> = from.iter().zip(to).map(|(from, to)| PerChannel::from_fn(|c| from[c] - to[c])).collect();
    ratios(&changes, reference, weights, BlockMean::interval)
}

/// Σ left / Σ reference of each channel, and of all with `weights`: never negative, nor is its interval.
fn share_left(left: &[PerChannel<f64>], reference: &[PerChannel<f64>], weights: &PerChannel<Option<f64>>) -> ShareOf {
    ratios(left, reference, weights, BlockMean::positive_interval)
}

/// Sums over sums, block by block.
fn ratios(
    parts: &[PerChannel<f64>],
    reference: &[PerChannel<f64>],
    weights: &PerChannel<Option<f64>>,
    interval: fn(&BlockMean) -> Option<[f64; 2]>,
) -> ShareOf {
    let ratio = |value: &dyn Fn(&PerChannel<f64>) -> f64| {
        let sums: Vec<BlockSum> = (parts.iter().zip(reference))
            .map(|(part, reference)| BlockSum { samples: value(reference), sum: value(part) })
            .collect();
        let mean = BlockMean::ratio(sums.into_iter()).filter(|mean| mean.mean.is_finite())?;
        Some(Share { share: mean.mean, ci95: interval(&mean).filter(|bounds| bounds.iter().all(|bound| bound.is_finite())) })
    };
    let known: Option<Vec<f64>> = weights.iter().copied().collect();
    ShareOf::new(std::array::from_fn(|index| match (index, &known) {
        (6, None) => None,
        (6, Some(weights)) => ratio(&|sums| sums.iter().zip(weights).map(|(sum, weight)| sum * weight).sum()),
        (channel, _) => ratio(&|sums| sums.values()[channel]),
    }))
}

/// One row of a table of shares: what it is, and the values.
pub type Line = (&'static str, ShareOf);

impl Shares {
    /// The shares as lines, the parts of the network indented below it.
    pub fn lines(&self) -> Vec<Line> {
        let parts =
            self.of_network.map(|parts| [("  linear history", parts.linear_history), ("  network itself", parts.network_itself)]);
        let mut lines = vec![("named physics", self.physics), ("network only", self.network)];
        lines.extend(parts.into_iter().flatten());
        lines.push(("neither", self.neither));
        lines.extend(self.floor.map(|floor| ("  floor", floor)));
        lines
    }

    /// Notes the share of the floor, MSE_floor / MSE_ref = neither · (RMSE_floor / RMSE_hybrid)², from root mean square errors over the
    /// windows of the shares. It has no interval, and none for all channels together.
    pub(super) fn set_floor(&mut self, hybrid: &ChannelValues, floor: &ChannelValues) {
        let all = self.neither.all();
        self.floor = Some(ShareOf::new(std::array::from_fn(|index| {
            let channel = Channel::from_index(index)?;
            let (hybrid, floor) = (hybrid.channels()[channel]?, floor.channels()[channel]?);
            let ratio = Some((floor / hybrid).powi(2)).filter(|ratio| ratio.is_finite())?;
            Some(Share { share: all[index]?.share * ratio, ci95: None })
        })));
    }

    /// What the shares are of, in words.
    pub fn basis(&self) -> String {
        match self.reference.as_str() {
            MEAN => format!("shares of the variance of the measurements, for network `{}` on model `{}`", self.name, self.model),
            reference => {
                format!("shares of the mean square error of `{reference}`, for network `{}` on model `{}`", self.name, self.model)
            }
        }
    }

    /// The finding in one sentence, from the shares of all channels together.
    pub fn sentence(&self) -> Option<String> {
        let [physics, network, neither] = [self.physics, self.network, self.neither].map(|part| part.mean);
        let percent = |share: Share| format!("{:.0} %", 100.0 * share.share);
        let (physics, network, neither) = (percent(physics?), network?, percent(neither?));
        let of = if self.reference == MEAN { "the variance of the measurements" } else { "the reference model's error" };
        let of_physics = format!("Of {of}, named physics explains {physics}");
        Some(match network.share {
            share if share.abs() < 0.005 => format!("{of_physics}; the network changes less than 1 %, and {neither} are left."),
            share if share > 0.0 => format!("{of_physics}, the network a further {}, neither {neither}.", percent(network)),
            share => format!("{of_physics}; the network makes it worse by {:.0} %, so that {neither} are left.", -100.0 * share),
        })
    }
}

impl Share {
    /// As percent: `61.2`, `-0.4`.
    pub fn text(&self) -> String {
        let percent = 100.0 * self.share;
        if percent.abs() < 1000.0 { format!("{percent:.1}") } else { significant(percent, 3) }
    }

    /// The interval in percent: `58 … 64`; empty if there is none.
    pub fn interval_text(&self) -> String {
        self.ci95.map_or_else(String::new, |[low, high]| format!("{:.0} … {:.0}", 100.0 * low, 100.0 * high))
    }
}

/// Per channel in percent, the 95 % interval below each line.
impl fmt::Display for Shares {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heads: Vec<(&str, &str)> = Column::TARGETS.iter().map(|column| (column.name(), "")).chain([("mean", "")]).collect();
        let rows = self.lines().into_iter().flat_map(|(name, of)| {
            let text = |one: Option<Share>| one.map_or_else(|| "–".to_owned(), |share| share.text());
            let interval = |one: Option<Share>| one.map_or_else(String::new, |share| share.interval_text());
            [(name.to_owned(), of.all().map(text).to_vec()), (String::new(), of.all().map(interval).to_vec())]
        });
        let rows: Vec<_> = rows.filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty())).collect();
        if let Some(sentence) = self.sentence() {
            writeln!(f, "{}", wrapped("", &sentence))?;
        }
        writeln!(f, "{}", wrapped("", &format!("Who explains what, %: {}", self.basis())))?;
        aligned(f, &heads, &rows)?;
        let few = if self.blocks < FEW_BLOCKS { " (few: a rough guide)" } else { "" };
        write!(f, "  95 % intervals from {} blocks of ten seconds{few}; mean: channels over their variance", self.blocks)
    }
}

/// The channels' shares that a stacked bar shows: `None` if one of its parts is not known.
#[cfg(feature = "report")]
pub(crate) fn bars(parts: &[ShareOf]) -> Vec<(String, Vec<f64>)> {
    let names = Column::TARGETS.iter().map(|column| column.name()).chain(["mean"]);
    let values = |index: usize| parts.iter().map(|part| part.all()[index].map(|share| share.share)).collect::<Option<Vec<f64>>>();
    names.enumerate().filter_map(|(index, name)| Some((name.to_owned(), values(index)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::compare::tests::{every_window, flights};
    use crate::error::Error;
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;
    use proptest::prelude::*;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    fn close(found: Option<Share>, expected: f64) -> bool {
        found.is_some_and(|found| (found.share - expected).abs() <= CLOSE)
    }

    /// Predictions that miss by `error(window, channel)`.
    fn missing(measured: &[PerChannel<f64>], error: impl Fn(usize, Channel) -> f64) -> Vec<PerChannel<f64>> {
        let one = |(window, y): (usize, &PerChannel<f64>)| PerChannel::from_fn(|channel| y[channel] - error(window, channel));
        measured.iter().enumerate().map(one).collect()
    }

    fn of(flights: &[Flight], reference: Option<&Row>, stages: &Stages) -> Result<Shares> {
        shares(flights, &every_window(flights), reference, &Judged { name: "run", model: "paper", stages })
    }

    #[test]
    fn shares_by_hand() -> Result<()> {
        // Errors of 2, 1 and ½ in every window: mean squares 4, 1, ¼; with a linear history on the way ¾² = 9/16.
        let flights = flights(|_, sample, channel| ((sample * 5 + channel) % 7) as f64)?;
        let measured = measured(&flights, &every_window(&flights))?;
        let by = |error: f64| missing(&measured, |_, _| error);
        let reference = Row { name: "base".into(), predicted: by(2.0) };
        let stages = Stages { physics: by(1.0), with_linear: Some(by(0.75)), hybrid: by(0.5) };
        let found = of(&flights, Some(&reference), &stages)?;
        let parts = found.of_network.ok_or(Error::Undetermined("no parts".into()))?;
        for channel in 0..7 {
            let at = |of: ShareOf| of.all()[channel];
            assert!(close(at(found.physics), 0.75) && close(at(found.network), 0.1875) && close(at(found.neither), 0.0625));
            assert!(close(at(parts.linear_history), 0.109_375) && close(at(parts.network_itself), 0.078_125));
            // The same share in every block: no scatter.
            assert!(at(found.physics).and_then(|share| share.ci95).is_some_and(|[low, high]| (high - low).abs() <= CLOSE));
        }
        assert_eq!((found.reference.as_str(), found.blocks), ("base", 10));
        // Without a reference: of the variance. A model that predicts the mean explains nothing, a perfect one everything.
        let mean: PerChannel<f64> = PerChannel::from_fn(|channel| measured.iter().map(|y| y[channel]).sum::<f64>() / 200.0);
        let found = of(&flights, None, &Stages { physics: vec![mean; 200], with_linear: None, hybrid: measured.clone() })?;
        assert!(close(found.physics.mean, 0.0) && close(found.network.wz_dot, 1.0) && found.of_network.is_none());
        assert_eq!(found.reference, MEAN);
        Ok(())
    }

    #[test]
    fn a_perfect_model_leaves_nothing_and_a_harmful_network_is_negative() -> Result<()> {
        let flights = flights(|flight, sample, channel| ((flight + sample * 3 + channel) % 11) as f64)?;
        let measured = measured(&flights, &every_window(&flights))?;
        let perfect = Stages { physics: measured.clone(), with_linear: None, hybrid: measured.clone() };
        let found = of(&flights, None, &perfect)?;
        assert!(found.physics.all().into_iter().all(|share| close(share, 1.0)));
        assert!(found.network.all().into_iter().chain(found.neither.all()).all(|share| close(share, 0.0)));
        assert!(found.sentence().is_some_and(|text| text.ends_with("100 %; the network changes less than 1 %, and 0 % are left.")));
        let base = Row { name: "base".into(), predicted: missing(&measured, |_, _| 1.0) };
        let harmful = Stages { physics: missing(&measured, |_, _| 1.0), with_linear: None, hybrid: missing(&measured, |_, _| 1.5) };
        let found = of(&flights, Some(&base), &harmful)?;
        assert!(close(found.physics.mean, 0.0) && close(found.network.mean, -1.25) && close(found.neither.mean, 2.25));
        assert!(found.sentence().is_some_and(|text| text.contains("worse by 125 %") && text.contains("225 % are left")));
        let text = found.to_string();
        assert!(text.contains("-125.0") && text.contains("network only") && !text.contains("linear history"), "{text}");
        Ok(())
    }

    #[test]
    fn what_cannot_be_computed_is_absent() -> Result<()> {
        let constant = flights(|_, sample, channel| if channel == 2 { 0.1 } else { (sample % 5) as f64 })?;
        let measured = measured(&constant, &every_window(&constant))?;
        let mut hybrid = missing(&measured, |_, _| 0.5);
        hybrid[7][Channel::VxDot] = f64::NAN;
        let stages = Stages { physics: missing(&measured, |_, _| 1.0), with_linear: None, hybrid };
        let found = of(&constant, None, &stages)?;
        assert!(found.network.vx_dot.is_none() && found.physics.vx_dot.is_some() && found.network.mean.is_none());
        assert!(found.physics.mean.is_none(), "a channel that does not vary has no weight");
        assert!(found.sentence().is_none() && found.to_string().contains('–'));
        let short = Stages { physics: Vec::new(), with_linear: None, hybrid: Vec::new() };
        assert!(matches!(of(&constant, None, &short), Err(Error::Shape { .. })));
        Ok(())
    }

    #[test]
    fn the_floor_is_a_part_of_neither() -> Result<()> {
        let flights = flights(|flight, sample, channel| ((flight * 3 + sample * 7 + channel) % 13) as f64)?;
        let windows = every_window(&flights);
        let measured = measured(&flights, &windows)?;
        let by = |error: f64| missing(&measured, move |_, _| error);
        let stages = Stages { physics: by(2.0), with_linear: None, hybrid: by(1.0) };
        let reference = Row { name: "base".into(), predicted: by(4.0) };
        let mut found = of(&flights, Some(&reference), &stages)?;
        assert!(!found.to_string().contains("floor"));
        let mut floor = PerChannel::splat(Some(0.5));
        floor[Channel::WzDot] = None;
        found.set_floor(&ChannelValues::new(PerChannel::splat(Some(1.0))), &ChannelValues::new(floor));
        // (0.5 / 4)², where the hybrid leaves (1 / 4)².
        let shares = found.floor.map(|floor| floor.all()).unwrap_or_default();
        assert!(close(found.neither.vx_dot, 1.0 / 16.0) && close(shares[0], 1.0 / 64.0) && close(shares[4], 1.0 / 64.0));
        assert!(shares[5].is_none() && shares[6].is_none(), "{shares:?}");
        let text = found.to_string();
        let line = text.lines().find(|line| line.trim_start().starts_with("floor")).unwrap_or_default();
        assert_eq!((line.matches("1.6").count(), line.matches('–').count()), (5, 2), "{text}");
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn shares_add_up_to_one_and_lie_in_their_intervals(errors in prop::collection::vec(prop::array::uniform4(0.01..3.0_f64), 200)) {
            let flights = flights(|flight, sample, channel| ((flight * 3 + sample * 7 + channel) % 13) as f64)?;
            let measured = measured(&flights, &every_window(&flights))?;
            let by = |which: usize| missing(&measured, |window, channel| errors[window][which] * (1.0 + channel.index() as f64));
            let reference = Row { name: "base".into(), predicted: by(0) };
            let stages = Stages { physics: by(1), with_linear: Some(by(2)), hybrid: by(3) };
            for reference in [None, Some(&reference)] {
                let found = of(&flights, reference, &stages)?;
                let parts = found.of_network;
                for index in 0..7 {
                    let share = |of: ShareOf| of.all()[index].map_or(f64::NAN, |share| share.share);
                    let (whole, size) = (share(found.physics) + share(found.network) + share(found.neither), share(found.neither).abs());
                    prop_assert!((whole - 1.0).abs() <= CLOSE * (1.0 + size));
                    let sum = parts.map_or(f64::NAN, |parts| share(parts.linear_history) + share(parts.network_itself));
                    prop_assert!((sum - share(found.network)).abs() <= CLOSE * (1.0 + size));
                    for of in [found.physics, found.network, found.neither] {
                        let inside = of.all()[index].is_some_and(|s| s.ci95.is_some_and(|[low, high]| low <= s.share && s.share <= high));
                        prop_assert!(inside);
                    }
                }
            }
        }
    }

    /// Blocks whose reference error is exponential and of which model and hybrid leave random parts: the true share is E[n]/E[d].
    #[test]
    fn intervals_cover_the_share_of_the_population() {
        const TRIALS: u64 = 1000;
        for blocks in [8, 30] {
            let mut covered = [0_u32; 3];
            for trial in 0..TRIALS {
                let stream = Stream::new(17, trial, blocks, 0);
                let block = |index: u64| {
                    let reference = -(1.0 - stream.uniform(3 * index)).ln();
                    // Parts left: uniform on 0 … 0.8 and, for the hybrid, on a quarter to three quarters of that; 0.4 and 0.2.
                    let model = reference * 0.8 * stream.uniform(3 * index + 1);
                    let hybrid = model * (0.25 + 0.5 * stream.uniform(3 * index + 2));
                    [reference, model, hybrid].map(PerChannel::splat)
                };
                let all: Vec<[PerChannel<f64>; 3]> = (0..blocks).map(block).collect();
                let [reference, model, hybrid] =
                    std::array::from_fn(|which| all.iter().map(|block| block[which]).collect::<Vec<_>>());
                let weights = PerChannel::splat(Some(1.0));
                let physics = share_left(&model, &reference, &weights).rest();
                let found = [physics, share_of(&model, &hybrid, &reference, &weights), share_left(&hybrid, &reference, &weights)];
                for ((count, found), truth) in covered.iter_mut().zip(found).zip([0.6, 0.2, 0.2]) {
                    let holds = |[low, high]: [f64; 2]| low <= truth && truth <= high;
                    *count += u32::from(found.vx_dot.and_then(|share| share.ci95).is_some_and(holds));
                }
            }
            let shares = covered.map(|count| f64::from(count) / TRIALS as f64);
            println!("{blocks} blocks: {shares:?}");
            // Short of 95 %, as linearised intervals of ratios are with few blocks of very unequal error.
            let least = if blocks == 8 { 0.86 } else { 0.90 };
            assert!(shares.iter().all(|share| (least..=0.98).contains(share)), "{blocks} blocks: {shares:?}");
        }
    }
}
