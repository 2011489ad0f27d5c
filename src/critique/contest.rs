//! Which of several models is best, and is that more than chance? Differences of errors are paired: every model is judged on the same
//! blocks of ten seconds, so a hard block is no scatter of the difference. No prediction is made and nothing printed here.

use super::channels::{ChannelValues, Intervals};
use crate::blocks::{BlockMean, BlockSum};
use crate::flight::{Channel, PerChannel};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How far a model's RMSE is from another's, with paired 95 % intervals; positive where its error is larger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// The other model.
    pub to: String,
    /// RMSE of this one less RMSE of the other, m/s² and rad/s².
    pub rmse: ChannelValues,
    /// 95 % interval.
    pub ci95: Intervals,
}

/// Index of the best model by measure (`rmse`, `mae`, `r2`) and channel or `mean`; a channel is there only if the paired interval of every
/// other model's difference to the best lies beyond zero.
pub type Best = BTreeMap<String, BTreeMap<String, usize>>;

/// Sums of one model over the windows of each block.
#[derive(Clone, Debug)]
pub(super) struct RowSums {
    /// Σ e² by block and channel.
    pub squares: Vec<PerChannel<f64>>,
    /// Σ |e|.
    pub sizes: Vec<PerChannel<f64>>,
}

/// What is summed over a block for one statistic of one model: a combination of its block sums whose mean over windows changes with the
/// statistic, and the statistic itself.
struct Statistic {
    blocks: Vec<f64>,
    value: f64,
    /// The mean of `blocks` over windows is the statistic times this.
    scale: f64,
}

/// Which error measure is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Measure {
    /// Root of a mean of squares, by the delta method: √m moves by dm / (2 √m).
    Rmse,
    Mae,
    /// Σ e² over the variance: one minus R².
    Unexplained(PerChannel<f64>),
}

impl Measure {
    /// Of the mean over some channels.
    fn of(self, counts: &[f64], sums: &RowSums, channels: &[Channel]) -> Statistic {
        let windows: f64 = counts.iter().sum();
        let share = 1.0 / channels.len() as f64;
        let of_blocks = if self == Self::Mae { &sums.sizes } else { &sums.squares };
        let mean = |channel: Channel| of_blocks.iter().map(|sums| sums[channel]).sum::<f64>() / windows;
        // A model without any error in a channel has no scatter there either.
        let weight = |channel: Channel| match self {
            Self::Rmse => Some(0.5 / mean(channel).sqrt()).filter(|weight| weight.is_finite()).unwrap_or_default(),
            Self::Mae => 1.0,
            Self::Unexplained(variances) => 1.0 / variances[channel],
        };
        let weights: Vec<(Channel, f64)> = channels.iter().map(|&channel| (channel, share * weight(channel))).collect();
        let blocks = of_blocks.iter().map(|sums| weights.iter().map(|&(channel, weight)| weight * sums[channel]).sum()).collect();
        let value = |channel: Channel| match self {
            Self::Rmse => mean(channel).sqrt(),
            Self::Mae => mean(channel),
            Self::Unexplained(variances) => mean(channel) / variances[channel],
        };
        Statistic {
            blocks,
            value: channels.iter().map(|&channel| share * value(channel)).sum(),
            scale: if self == Self::Rmse { 0.5 } else { 1.0 },
        }
    }
}

impl Statistic {
    /// This one less another, and the half-width of its 95 % interval; none with fewer than two blocks.
    fn less(&self, other: &Self, counts: &[f64]) -> Option<(f64, Option<f64>)> {
        let sums = counts.iter().zip(self.blocks.iter().zip(&other.blocks));
        let sums: Vec<BlockSum> = sums.map(|(samples, (one, other))| BlockSum { samples: *samples, sum: one - other }).collect();
        let mean = BlockMean::new(sums.into_iter())?;
        // The interval is of the deviations of the blocks, whose mean is the statistic times its scale; they have its own size.
        let half = mean.interval().map(|[_, high]| high - mean.mean);
        let difference = self.value - other.value;
        debug_assert!(
            !(self.scale * difference).is_finite() || (mean.mean - self.scale * difference).abs() <= 1e-6 * (1.0 + mean.mean.abs())
        );
        difference.is_finite().then_some((difference, half.filter(|half| half.is_finite())))
    }
}

/// The index of the smallest statistic, if every other one's difference to it lies beyond its interval.
fn clear_best(statistics: &[Statistic], counts: &[f64]) -> Option<usize> {
    let finite = || statistics.iter().enumerate().filter(|(_, statistic)| statistic.value.is_finite());
    let (best, winner) = finite().min_by(|left, right| left.1.value.total_cmp(&right.1.value))?;
    let mut others = finite().filter(|(index, _)| *index != best).peekable();
    others.peek()?;
    let beyond = |(_, other): (usize, &Statistic)| {
        other.less(winner, counts).is_some_and(|(difference, half)| half.is_some_and(|half| difference > half))
    };
    others.all(beyond).then_some(best)
}

/// A measure for a channel, or for the mean of all; `None` where it cannot be had.
type Choose<'a> = &'a dyn Fn(Option<Channel>) -> Option<Measure>;

/// The best models on some blocks: by measure, by channel. `variances` are those of the measured channels; where one is missing there is no
/// best R² of the mean.
pub(super) fn best(counts: &[f64], rows: &[RowSums], variances: &PerChannel<Option<f64>>) -> Best {
    let all: Option<Vec<f64>> = variances.iter().copied().collect();
    let unexplained = |channel: Channel| {
        let mut of = PerChannel::splat(1.0);
        of[channel] = variances[channel]?;
        Some(Measure::Unexplained(of))
    };
    let whole = all.and_then(|all| Some(Measure::Unexplained(PerChannel::new(all.try_into().ok()?))));
    let measures: [(&str, Choose<'_>); 3] = [
        ("rmse", &|_| Some(Measure::Rmse)),
        ("mae", &|_| Some(Measure::Mae)),
        ("r2", &|channel| channel.map_or(whole, unexplained)),
    ];
    let of_measure = |(name, measure): &(&str, Choose<'_>)| {
        let column = |channel: Option<Channel>| {
            let measure = measure(channel)?;
            let channels = channel.map_or(Channel::ALL.to_vec(), |channel| vec![channel]);
            let statistics: Vec<Statistic> = rows.iter().map(|row| measure.of(counts, row, &channels)).collect();
            clear_best(&statistics, counts)
        };
        let channels = Channel::ALL.into_iter().map(|channel| (channel.name(), Some(channel))).chain([("mean", None)]);
        let found = channels.filter_map(|(name, channel)| Some((name.to_owned(), column(channel)?))).collect();
        ((*name).to_owned(), found)
    };
    measures.iter().map(of_measure).collect()
}

/// The best model by the mean RMSE of the channels.
pub(super) fn best_mean(counts: &[f64], rows: &[RowSums]) -> Option<usize> {
    let statistics: Vec<Statistic> = rows.iter().map(|row| Measure::Rmse.of(counts, row, &Channel::ALL)).collect();
    clear_best(&statistics, counts)
}

/// RMSE of `one` less that of `other`, paired.
pub(super) fn difference(counts: &[f64], one: &RowSums, other: &RowSums, to: &str) -> Difference {
    let of = |channels: &[Channel]| {
        let (one, other) = (Measure::Rmse.of(counts, one, channels), Measure::Rmse.of(counts, other, channels));
        one.less(&other, counts)
    };
    let found: PerChannel<Option<(f64, Option<f64>)>> = PerChannel::from_fn(|channel| of(&[channel]));
    let interval = |found: Option<(f64, Option<f64>)>| found.and_then(|(value, half)| Some([value - half?, value + half?]));
    let mut rmse = ChannelValues::new(found.map(|found| Some(found?.0)));
    let mean = of(&Channel::ALL);
    rmse.mean = mean.map(|(value, _)| value);
    Difference { to: to.to_owned(), rmse, ci95: Intervals::new(found.map(interval)).with_mean(interval(mean)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    /// Blocks of ten windows whose mean squared errors are `level` times a scatter that both rows share, and one of their own.
    fn row(level: f64, own: f64, seed: u64, blocks: usize) -> RowSums {
        let (shared, other) = (Stream::new(7, 0, 0, 0), Stream::new(seed, 1, 0, 0));
        let of = |block: usize| level * (1.0 + 20.0 * shared.uniform(block as u64).powi(4) + own * other.uniform(block as u64));
        let squares: Vec<PerChannel<f64>> = (0..blocks).map(|block| PerChannel::splat(10.0 * of(block))).collect();
        let sizes = squares.iter().map(|square| square.map(f64::sqrt)).collect();
        RowSums { squares, sizes }
    }

    #[test]
    fn a_small_difference_on_the_same_blocks_is_clear_though_the_errors_scatter() {
        let counts = vec![10.0; 30];
        let rows = [row(1.0, 0.1, 1, 30), row(1.1, 0.1, 2, 30)];
        let found = best(&counts, &rows, &PerChannel::splat(Some(9.0)));
        assert!(["rmse", "mae", "r2"].iter().all(|measure| found[*measure].len() == 7), "{found:?}");
        assert!(found.values().flat_map(BTreeMap::values).all(|index| *index == 0));
        let apart = difference(&counts, &rows[1], &rows[0], "first");
        assert!(
            apart.ci95.vx_dot.is_some_and(|[low, _]| low > 0.0) && apart.ci95.mean.is_some_and(|[low, _]| low > 0.0),
            "{apart:?}"
        );
        let rmse = |row: &RowSums| (row.squares.iter().map(|square| square[Channel::VxDot]).sum::<f64>() / 300.0).sqrt();
        assert!(apart.rmse.vx_dot.is_some_and(|value| (value - (rmse(&rows[1]) - rmse(&rows[0]))).abs() <= CLOSE));
    }

    #[test]
    fn a_difference_within_its_interval_has_no_best() {
        let counts = vec![10.0; 30];
        let rows = [row(1.0, 3.0, 1, 30), row(1.0, 3.0, 2, 30)];
        assert!(best(&counts, &rows, &PerChannel::splat(Some(9.0))).values().all(BTreeMap::is_empty));
        assert_eq!(best_mean(&counts, &rows), None);
        // One block, or one model, shows nothing either.
        assert!(
            best(&[10.0], &[row(1.0, 0.0, 1, 1), row(9.0, 0.0, 2, 1)], &PerChannel::splat(None)).values().all(BTreeMap::is_empty)
        );
        assert_eq!(best_mean(&counts, &rows[..1]), None);
    }

    #[test]
    fn a_third_model_that_is_as_good_takes_the_star_away() {
        let counts = vec![10.0; 30];
        let rows = [row(1.0, 0.1, 1, 30), row(1.2, 0.1, 2, 30), row(1.0, 0.1, 3, 30)];
        assert_eq!(best_mean(&counts, &rows[..2]), Some(0));
        assert_eq!(best_mean(&counts, &rows), None);
    }

    #[test]
    fn no_error_at_all_and_no_number_are_no_panic() {
        let counts = vec![10.0; 30];
        let nothing = RowSums { squares: vec![PerChannel::splat(0.0); 30], sizes: vec![PerChannel::splat(0.0); 30] };
        let broken = RowSums { squares: vec![PerChannel::splat(f64::NAN); 30], sizes: vec![PerChannel::splat(f64::NAN); 30] };
        let rows = [nothing, row(1.0, 0.1, 1, 30), broken];
        assert_eq!(best_mean(&counts, &rows), Some(0));
        assert_eq!(difference(&counts, &rows[2], &rows[0], "nothing").rmse.vx_dot, None);
    }

    /// The paired interval holds the truth in about 95 of 100 data sets: 200 draws of two models of equal error; fewer than 8 % clear
    /// bests are let pass (binomial: 16 or more of 200 come at 5 % with a probability of 4 %).
    #[test]
    fn equal_models_rarely_get_a_star() {
        let counts = vec![10.0; 40];
        let stars = (0..200_u64)
            .filter(|seed| best_mean(&counts, &[row(1.0, 3.0, 10 + seed, 40), row(1.0, 3.0, 1000 + seed, 40)]).is_some());
        let stars = stars.count();
        assert!(stars <= 16, "{stars} of 200");
    }
}
