//! Where in the flights the error lies: the worst and a typical ten seconds, and the residual against recorded variables.
//!
//! Descriptions for a person to look at. Nothing here is a test of a hypothesis: which physical effect explains the residual,
//! and how sure that is, is asked elsewhere, on flights not looked at here.

use super::predictions::{Row, check_row, measured, variation};
use crate::blocks::{BlockMean, BlockSum, Blocks, FEW_BLOCKS};
use crate::error::Result;
use crate::flight::{Channel, Column, Flight, PerChannel, Span, Window};
use serde::Serialize;
use std::ops::Range;

/// Ten seconds of a flight and how large the error is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The samples.
    pub span: Span,
    /// √(mean over channels of MSE / variance of the measured channel over all windows); 1 is as bad as predicting the mean.
    pub error: f64,
}

/// The stretches that a report shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretches {
    /// The block with the largest normalised error.
    pub worst: Stretch,
    /// The block with the median normalised error (the lower median), or the block of another flight than the worst's that comes closest to it.
    pub typical: Stretch,
}

/// What models predict at every sample of a stretch that they can, so that lines can be drawn.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The stretch.
    pub stretch: Stretch,
    /// Its samples, as windows.
    pub windows: Vec<Window>,
    /// The predictions there.
    pub rows: Vec<Row>,
}

/// Finds the worst and the typical block of ten seconds of one model, of different flights where there are several.
///
/// Blocks with less than half of the windows of the fullest block are passed over, as a short remainder at the end of a
/// flight says little. `None` without windows, or where no channel varies or no prediction is finite.
///
/// # Errors
/// [`crate::Error::Shape`] if the row has not one prediction a window, or a window lies outside its flight.
pub fn stretches(flights: &[Flight], windows: &[Window], row: &Row) -> Result<Option<Stretches>> {
    stretches_in(flights, windows, row, PerChannel::splat(true))
}

/// As [`stretches`], by the error of some channels alone.
///
/// # Errors
/// As [`stretches`].
pub fn stretches_in(flights: &[Flight], windows: &[Window], row: &Row, channels: PerChannel<bool>) -> Result<Option<Stretches>> {
    check_row(row, windows)?;
    let measured = measured(flights, windows)?;
    let of = |channel: Channel| Some(variation(&measured, channel).filter(|_| channels[channel])? / measured.len() as f64);
    let scale: PerChannel<Option<f64>> = PerChannel::from_fn(of);
    let channels = scale.iter().flatten().count() as f64;
    let blocks = Blocks::new(flights, windows);
    let mut sums = vec![BlockSum::default(); blocks.len()];
    let mut ranges: Vec<Option<Range<usize>>> = vec![None; blocks.len()];
    for (((block, window), y), p) in blocks.of_window.iter().zip(windows).zip(&measured).zip(&row.predicted) {
        let squares = y.iter().zip(p).zip(&scale).filter_map(|((y, p), scale)| Some((y - p).powi(2) / (*scale)?));
        sums[*block].samples += 1.0;
        sums[*block].sum += squares.sum::<f64>() / channels;
        let range = &mut ranges[*block];
        let (start, end) = range.as_ref().map_or((window.last, window.last), |range| (range.start, range.end));
        *range = Some(start.min(window.last)..end.max(window.last + 1));
    }
    let fullest = sums.iter().map(|block| block.samples).fold(0.0, f64::max);
    let stretch = |(number, sum): (usize, &BlockSum)| {
        let error = (sum.sum / sum.samples).sqrt();
        let Range { start, end } = ranges[number].clone()?;
        let span = Span { flight: blocks.keys[number].0, start, end };
        (2.0 * sum.samples >= fullest && error.is_finite()).then_some(Stretch { span, error })
    };
    let mut found: Vec<Stretch> = sums.iter().enumerate().filter_map(stretch).collect();
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    let Some((worst, median)) = found.last().copied().zip(found.get(found.len().saturating_sub(1) / 2).copied()) else {
        return Ok(None);
    };
    let elsewhere = found.iter().filter(|stretch| stretch.span.flight != worst.span.flight);
    let apart = |stretch: &Stretch| (stretch.error - median.error).abs();
    let typical = elsewhere.min_by(|left, right| apart(left).total_cmp(&apart(right))).copied().unwrap_or(median);
    Ok(Some(Stretches { worst, typical }))
}

/// A recorded quantity against which residuals are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    /// A column of the log.
    Column(Column),
    /// Height above ground −z, m.
    Height,
    /// |v|, m/s. Speed over ground: in wind it is not the speed through the air.
    Airspeed,
}

impl Variable {
    /// Those that a report looks at.
    #[rustfmt::skip]
    pub const ALL: [Self; 14] = [
        Self::Column(Column::Vx), Self::Column(Column::Vy), Self::Column(Column::Vz), Self::Column(Column::Wx),
        Self::Column(Column::Wy), Self::Column(Column::Wz), Self::Column(Column::U1), Self::Column(Column::U2),
        Self::Column(Column::U3), Self::Column(Column::U4), Self::Height, Self::Airspeed, Self::Column(Column::Roll),
        Self::Column(Column::Pitch),
    ];

    /// Name as in formulas.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Column(column) => column.name(),
            Self::Height => "height",
            Self::Airspeed => "airspeed",
        }
    }

    /// SI unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Column(column) => column.unit(),
            Self::Height => "m",
            Self::Airspeed => "m/s",
        }
    }

    /// The value at one sample; `None` if the column was not recorded or the sample is not there.
    pub fn value(self, flight: &Flight, sample: usize) -> Option<f64> {
        let at = |column: Column| flight.column(column).get(sample).copied().filter(|_| !flight.absent.contains(&column));
        match self {
            Self::Column(column) => at(column),
            Self::Height => at(Column::Z).map(|z| -z),
            Self::Airspeed => Some(at(Column::Vx)?.hypot(at(Column::Vy)?).hypot(at(Column::Vz)?)),
        }
    }
}

/// The residual of one channel in one bin of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Mean of the variable in the bin.
    pub at: f64,
    /// Mean of measured − predicted, m/s² or rad/s².
    pub mean: f64,
    /// Its 95 % interval, from the scatter between blocks of ten seconds.
    pub ci95: Option<[f64; 2]>,
    /// Windows in the bin.
    pub n: usize,
    /// Blocks in the bin.
    pub blocks: usize,
}

impl Bin {
    /// Whether the bin rests on fewer than [`FEW_BLOCKS`] blocks; figures mark it.
    pub const fn is_thin(&self) -> bool {
        self.blocks < FEW_BLOCKS
    }
}

/// The residual of one channel against one variable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dependence {
    /// Bins that hold windows, in the order of the variable.
    pub bins: Vec<Bin>,
    /// Correlation ratio η²: the share of the residual's mean square about its mean that the bin means account for, 0 to 1.
    pub share: f64,
}

/// Number of bins of [`dependences`].
pub const BINS: usize = 14;

/// The residuals of the six channels of one model against each variable, in [`BINS`] bins of equal width between the 0.5 % and
/// the 99.5 % quantile of the variable; values beyond go into the outer bins, whose [`Bin::at`] tells where they lie.
///
/// Windows where the variable was not recorded, or the prediction is not finite, are left out; so are variables for which
/// nothing remains or that do not vary.
///
/// # Errors
/// [`crate::Error::Shape`] if the row has not one prediction a window, or a window lies outside its flight.
pub fn dependences(
    flights: &[Flight],
    windows: &[Window],
    row: &Row,
    variables: &[Variable],
) -> Result<Vec<(Variable, PerChannel<Dependence>)>> {
    check_row(row, windows)?;
    let measured = measured(flights, windows)?;
    let blocks = Blocks::new(flights, windows);
    let residuals: Vec<Option<PerChannel<f64>>> = measured
        .iter()
        .zip(&row.predicted)
        .map(|(y, p)| {
            Some(PerChannel::from_fn(|channel| y[channel] - p[channel]))
                .filter(|r: &PerChannel<f64>| r.iter().all(|r| r.is_finite()))
        })
        .collect();
    let of = |variable: &Variable| {
        let value = |window: &Window| variable.value(flights.get(window.flight)?, window.last);
        let used = windows.iter().zip(&blocks.of_window).zip(&residuals);
        let used: Vec<_> = used.filter_map(|((window, block), residual)| Some((value(window)?, *block, (*residual)?))).collect();
        Some((*variable, bin(&used, blocks.len())?))
    };
    Ok(variables.iter().filter_map(of).collect())
}

/// Bins residuals that come with a variable and the number of their block.
fn bin(used: &[(f64, usize, PerChannel<f64>)], blocks: usize) -> Option<PerChannel<Dependence>> {
    let mut values: Vec<f64> = used.iter().map(|(value, ..)| *value).collect();
    let last = values.len().saturating_sub(1);
    let mut quantile = |share: f64| {
        let rank = (last as f64 * share).round() as usize;
        (!values.is_empty()).then(|| *values.select_nth_unstable_by(rank, f64::total_cmp).1)
    };
    let (low, high) = (quantile(0.005)?, quantile(0.995)?);
    if high <= low {
        return None;
    }
    let mut cells = vec![(BlockSum::default(), PerChannel::splat(0.0)); BINS * blocks];
    for (value, block, residual) in used {
        let bin = ((value - low) / (high - low) * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize;
        let (of_variable, sums) = &mut cells[bin * blocks + block];
        of_variable.samples += 1.0;
        of_variable.sum += value;
        sums.iter_mut().zip(residual).for_each(|(sum, value)| *sum += value);
    }
    Some(PerChannel::from_fn(|channel| {
        let bins = cells.chunks_exact(blocks).filter_map(|cells| {
            let at = BlockMean::new(cells.iter().map(|(sum, _)| *sum))?.mean;
            let mean = BlockMean::new(cells.iter().map(|(of, sums)| BlockSum { samples: of.samples, sum: sums[channel] }))?;
            let n = cells.iter().map(|(of, _)| of.samples).sum::<f64>() as usize;
            Some(Bin { at, mean: mean.mean, ci95: mean.interval(), n, blocks: mean.blocks })
        });
        let bins: Vec<Bin> = bins.collect();
        let share = share(&bins, used.iter().map(|(.., residual)| residual[channel]));
        Dependence { bins, share }
    }))
}

/// η² = Σ_bins n (mean − grand mean)² / Σ (residual − grand mean)²; 0 for a residual that does not vary.
fn share(bins: &[Bin], residuals: impl Iterator<Item = f64> + Clone) -> f64 {
    let count: f64 = bins.iter().map(|bin| bin.n as f64).sum();
    let grand = bins.iter().map(|bin| bin.n as f64 * bin.mean).sum::<f64>() / count;
    let between: f64 = bins.iter().map(|bin| bin.n as f64 * (bin.mean - grand).powi(2)).sum();
    let total: f64 = residuals.map(|value| (value - grand).powi(2)).sum();
    if total > 0.0 { (between / total).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::compare::tests::{every_window, flights};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    fn zero(windows: &[Window]) -> Row {
        Row { name: "zero".into(), predicted: vec![PerChannel::splat(0.0); windows.len()] }
    }

    #[test]
    fn the_worst_stretch_is_where_the_error_is() -> Result<()> {
        // Blocks are 20 samples. Amplitude 1 everywhere, 5 in the third block of the second flight.
        let flights = flights(|flight, sample, _| {
            let amplitude = if flight == 1 && (40..60).contains(&sample) { 5.0 } else { 1.0 };
            if sample % 2 == 0 { amplitude } else { -amplitude }
        })?;
        let windows = every_window(&flights);
        let found = stretches(&flights, &windows, &zero(&windows))?;
        assert!(found.is_some_and(|found| found.worst.span == Span { flight: 1, start: 40, end: 60 }));
        assert!(found.is_some_and(|found| found.typical.span.flight == 0), "typical is another flight's");
        assert!(found.is_some_and(|found| (found.worst.error - 5.0 * found.typical.error).abs() <= CLOSE * found.worst.error));
        assert_eq!(stretches(&flights, &[], &zero(&[]))?, None);
        Ok(())
    }

    #[test]
    fn a_step_in_the_residual_is_seen_in_its_variable_only() -> Result<()> {
        // vx rises from 0 to 9.9 m/s in both flights: the residual is 2 above 5 m/s and 0 below.
        let flights = flights(|_, sample, channel| if channel == 0 && sample >= 50 { 2.0 } else { 0.0 })?;
        let windows = every_window(&flights);
        let variables = [Column::Roll, Column::Vx].map(Variable::Column);
        let found = dependences(&flights, &windows, &zero(&windows), &variables)?;
        // Roll does not vary and is left out.
        let [(Variable::Column(Column::Vx), of)] = found.as_slice() else { panic!("only vx varies") };
        let [vx_dot, vy_dot, ..] = of.values();
        assert_eq!(vx_dot.bins.iter().map(|bin| bin.n).sum::<usize>(), 200);
        assert!(vx_dot.bins.iter().filter(|bin| bin.at < 4.5).all(|bin| bin.mean == 0.0), "{vx_dot:?}");
        assert!(vx_dot.bins.iter().filter(|bin| bin.at > 5.5).all(|bin| (bin.mean - 2.0).abs() <= CLOSE), "{vx_dot:?}");
        assert!(vx_dot.share > 0.99 && vy_dot.share == 0.0);
        assert!(vx_dot.bins.iter().all(Bin::is_thin), "two flights give at most four blocks a bin");
        Ok(())
    }

    #[test]
    fn what_was_not_recorded_is_not_shown() -> Result<()> {
        let mut flights = flights(|_, _, _| 0.0)?;
        assert!(Variable::Height.value(&flights[0], 3).is_some_and(|height| height.to_bits() == 10.0_f64.to_bits()));
        flights[0].absent.push(Column::Z);
        assert_eq!(Variable::Height.value(&flights[0], 3), None);
        let windows = every_window(&flights);
        let found = dependences(&flights, &windows, &zero(&windows), &[Variable::Airspeed])?;
        assert!(matches!(found.as_slice(), [(Variable::Airspeed, of)] if of[Channel::VxDot].share == 0.0));
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn bins_pool_to_the_mean_residual(residuals in prop::collection::vec(-3.0..3.0_f64, 200)) {
            let flights = flights(|flight, sample, _| residuals[flight * 100 + sample])?;
            let windows = every_window(&flights);
            let found = dependences(&flights, &windows, &zero(&windows), &[Variable::Airspeed])?;
            let [(_, found)] = found.as_slice() else { return Err(TestCaseError::fail("speed varies")) };
            let pooled: f64 = found[Channel::WxDot].bins.iter().map(|bin| bin.n as f64 * bin.mean).sum();
            prop_assert!((pooled - residuals.iter().sum::<f64>()).abs() <= CLOSE * 600.0);
            prop_assert!(found.iter().all(|found| (0.0..=1.0).contains(&found.share)));
            prop_assert!(found[Channel::VxDot].bins.windows(2).all(|pair| pair[0].at < pair[1].at));
        }
    }
}
