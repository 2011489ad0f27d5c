//! Measured against predicted: error measures per channel, over all windows, by manoeuvre and by regime.
//!
//! Takes predictions as numbers, whoever made them; which windows and which channels are worth judging is the caller's
//! matter. Printing the result is `table.rs`; where in the flights the error lies is `locate.rs`.

use super::channels::{ChannelValues, Intervals};
use super::contest::{self, Best, Difference, RowSums};
use super::coverage::Coverage;
use super::predictions::{Row, check_row, measured, variation};
use super::regime::Regime;
use super::shares::Shares;
use super::uncertainty::Uncertainty;
use crate::blocks::{BlockMean, BlockSum, Blocks};
use crate::error::Result;
use crate::flight::split::Part;
use crate::flight::{Channel, Flight, PerChannel, Targets, Window};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Error over a part of the windows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PartError {
    /// Root mean square error; all `None` when the part has fewer than two windows: one says nothing.
    pub rmse: ChannelValues,
    /// 95 % interval of the RMSE.
    pub rmse_ci95: Intervals,
    /// Windows in the part.
    pub n: usize,
    /// Blocks of ten seconds that the windows lie in.
    pub blocks: usize,
}

/// Error measures of one model. With e = measured − predicted over N windows:
/// RMSE = √(Σe²/N), MAE = Σ|e|/N, max_abs = max|e|, R² = 1 − Σe²/Σ(y − ȳ)², ȳ being the mean over the same windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelError {
    /// Name of the model.
    pub name: String,
    /// Number of windows N.
    pub windows: usize,
    /// Root mean square error, m/s² and rad/s².
    pub rmse: ChannelValues,
    /// 95 % interval of the RMSE.
    pub rmse_ci95: Intervals,
    /// Mean absolute error, m/s² and rad/s².
    pub mae: ChannelValues,
    /// Largest absolute error, m/s² and rad/s²; its `mean` is the mean of the six largest errors.
    pub max_abs: ChannelValues,
    /// Coefficient of determination; `None` for a channel that does not vary.
    pub r2: ChannelValues,
    /// Windows with a prediction that is not finite. They make the measures of their channel `None`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub not_finite: usize,
    /// How far its RMSE is from that of the model with the smallest mean RMSE, paired; absent for that model itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub difference_to_best: Option<Difference>,
    /// Every manoeuvre class that has a window.
    pub by_manoeuvre: BTreeMap<String, PartError>,
    /// Every [`Regime`] by name, also those never flown (n = 0).
    pub by_regime: BTreeMap<String, PartError>,
}

/// Models side by side on the same windows: the result of `compare`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// In the order in which the predictions were given.
    pub models: Vec<ModelError>,
    /// Derived if the targets of any flight among the windows were.
    pub target: Targets,
    /// Where the windows come from.
    pub split: Part,
    /// Whether some model has numbers of each flight: each half of a flight that no fit has seen is then judged with numbers that are found from
    /// its other half; noted by whoever has the models.
    #[serde(default)]
    pub own_from_other_half: bool,
    /// Samples from one window to the next, the same for all models.
    #[serde(default = "one")]
    pub stride: usize,
    /// Blocks of ten seconds that the windows lie in: what intervals rest on.
    #[serde(default)]
    pub blocks: usize,
    /// Who is best in what, where that is more than chance.
    #[serde(default)]
    pub best: Best,
    /// Index of the model with the smallest mean RMSE in a manoeuvre class, where that is more than chance.
    #[serde(default)]
    pub best_by_manoeuvre: BTreeMap<String, usize>,
    /// The same by regime.
    #[serde(default)]
    pub best_by_regime: BTreeMap<String, usize>,
    /// RMSE that no model can go below, where the explainable part of the flights is known (see [`super::floor()`]); added by whoever has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<ChannelValues>,
    /// Who explains what, one entry a trained network; added by whoever has the network (see [`mod@super::shares`]).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shares: Vec<Shares>,
    /// How the prediction intervals do, one entry a trained network that has some; added by whoever has the network.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coverage: Vec<Coverage>,
    /// What the uncertainty of the physical coefficients does, one entry a trained network, if it was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertainty: Vec<Uncertainty>,
}

impl Comparison {
    /// Notes the floor (see [`super::floor()`]), and in the shares of each network what part of the error it is.
    pub fn set_floor(&mut self, floor: ChannelValues) {
        self.floor = Some(floor);
        for shares in &mut self.shares {
            if let Some(model) = self.models.iter().find(|model| model.name == shares.name) {
                shares.set_floor(&model.rmse, &floor);
            }
        }
    }
}

/// Lays the predictions of each row beside the measured targets at the last row of each window.
///
/// # Errors
/// [`Error::Shape`](crate::Error::Shape) if a row has not one prediction a window, or a window lies outside its flight.
///
/// # Examples
/// ```
/// # #[cfg(not(feature = "sim"))]
/// # fn main() {}
/// # #[cfg(feature = "sim")]
/// # fn main() -> phyture::Result<()> {
/// use phyture::critique::{Row, compare, finite_difference};
/// use phyture::flight::split::Part;
/// use phyture::flight::{Channel, PerChannel, Window};
/// use phyture::sim::{Simulation, simulate};
///
/// let flights = simulate(&Simulation { minutes: 2.0, ..Simulation::baseline() })?.flights;
/// let windows: Vec<Window> = (10..flights[0].len()).map(|last| Window { flight: 0, last }).collect();
/// let nothing = Row { name: "nothing".into(), predicted: vec![PerChannel::splat(0.0); windows.len()] };
/// let difference = finite_difference(&flights, &windows)?;
/// let found = compare(&flights, &windows, &[nothing, difference], Part::All)?;
/// for model in &found.models {
///     println!("{}: {:?} rad/s²", model.name, model.rmse.channels()[Channel::WzDot]);
/// }
/// assert_eq!(found.models[1].name, "finite difference");
/// # Ok(())
/// # }
/// ```
pub fn compare(flights: &[Flight], windows: &[Window], rows: &[Row], split: Part) -> Result<Comparison> {
    let measured = measured(flights, windows)?;
    let groups = Groups::new(flights, windows);
    let derived = windows.iter().any(|window| flights[window.flight].targets == Targets::Derived);
    rows.iter().try_for_each(|row| check_row(row, windows))?;
    let errors: Vec<Vec<PerChannel<f64>>> = rows.iter().map(|row| errors(row, &measured)).collect();
    let mut models: Vec<ModelError> =
        rows.iter().zip(&errors).map(|(row, errors)| model_error(row, errors, &measured, &groups)).collect();
    let whole = groups.rows_of(&errors, |_| true);
    let variances = PerChannel::from_fn(|channel| Some(variation(&measured, channel)? / measured.len() as f64));
    let smallest = models.iter().enumerate().filter_map(|(index, model)| Some((index, model.rmse.mean?)));
    if let Some((best, _)) = smallest.min_by(|left, right| left.1.total_cmp(&right.1)) {
        let to = models[best].name.clone();
        for (index, model) in models.iter_mut().enumerate().filter(|(index, _)| *index != best) {
            model.difference_to_best = Some(contest::difference(&whole.0, &whole.1[index], &whole.1[best], &to));
        }
    }
    let winners = |names: &mut dyn Iterator<Item = &str>, part: &[usize]| {
        let of = |(index, name): (usize, &str)| {
            let (counts, sums) = groups.rows_of(&errors, |window| part[window] == index);
            Some((name.to_owned(), contest::best_mean(&counts, &sums)?))
        };
        names.enumerate().filter_map(of).collect::<BTreeMap<_, _>>()
    };
    Ok(Comparison {
        best: contest::best(&whole.0, &whole.1, &variances),
        best_by_manoeuvre: winners(&mut groups.manoeuvres.iter().map(String::as_str), &groups.manoeuvre),
        best_by_regime: winners(&mut Regime::ALL.iter().map(|regime| regime.name()), &groups.regime),
        models,
        target: if derived { Targets::Derived } else { Targets::Recorded },
        split,
        own_from_other_half: false,
        stride: 1,
        blocks: groups.blocks.len(),
        floor: None,
        shares: Vec::new(),
        coverage: Vec::new(),
        uncertainty: Vec::new(),
    })
}

/// RMSE of one model less that of another on the same windows, with paired intervals.
///
/// # Errors
/// As [`compare`].
pub fn paired(flights: &[Flight], windows: &[Window], one: &Row, other: &Row) -> Result<Difference> {
    let measured = measured(flights, windows)?;
    [one, other].into_iter().try_for_each(|row| check_row(row, windows))?;
    let errors = [one, other].map(|row| errors(row, &measured));
    let (counts, sums) = Groups::new(flights, windows).rows_of(&errors, |_| true);
    Ok(contest::difference(&counts, &sums[0], &sums[1], &other.name))
}

/// Measured minus predicted, one entry a window.
fn errors(row: &Row, measured: &[PerChannel<f64>]) -> Vec<PerChannel<f64>> {
    measured.iter().zip(&row.predicted).map(|(y, p)| PerChannel::from_fn(|channel| y[channel] - p[channel])).collect()
}

/// To which block, manoeuvre and regime each window belongs.
struct Groups {
    blocks: Blocks,
    manoeuvres: Vec<String>,
    manoeuvre: Vec<usize>,
    regime: Vec<usize>,
}

impl Groups {
    fn new(flights: &[Flight], windows: &[Window]) -> Self {
        let of = |window: &Window| &flights[window.flight].manoeuvre;
        let mut manoeuvres: Vec<String> = windows.iter().map(of).cloned().collect();
        manoeuvres.sort_unstable();
        manoeuvres.dedup();
        let manoeuvre = windows.iter().map(|window| manoeuvres.partition_point(|name| name < of(window))).collect();
        let regime = windows.iter().map(|window| Regime::of(&flights[window.flight], window.last) as usize).collect();
        Self { blocks: Blocks::new(flights, windows), manoeuvres, manoeuvre, regime }
    }

    /// Windows and sums of errors of each block, over the windows that are in, for each model.
    fn rows_of(&self, errors: &[Vec<PerChannel<f64>>], is_in: impl Fn(usize) -> bool) -> (Vec<f64>, Vec<RowSums>) {
        let mut counts = vec![0.0; self.blocks.len()];
        let blank = || vec![PerChannel::splat(0.0); self.blocks.len()];
        let mut rows: Vec<RowSums> = errors.iter().map(|_| RowSums { squares: blank(), sizes: blank() }).collect();
        for (window, &block) in self.blocks.of_window.iter().enumerate().filter(|(window, _)| is_in(*window)) {
            counts[block] += 1.0;
            for (sums, errors) in rows.iter_mut().zip(errors) {
                for (channel, error) in errors[window].pairs() {
                    sums.squares[block][channel] += error * error;
                    sums.sizes[block][channel] += error.abs();
                }
            }
        }
        (counts, rows)
    }

    /// Error over each of `count` parts, `part` naming the part of each window.
    fn parts(&self, squares: &[PerChannel<f64>], part: impl Fn(usize) -> usize, count: usize) -> Vec<PartError> {
        let blocks = self.blocks.len();
        let mut sums = vec![(0_usize, PerChannel::splat(0.0)); count * blocks];
        for (window, square) in squares.iter().enumerate() {
            let (n, sum) = &mut sums[part(window) * blocks + self.blocks.of_window[window]];
            *n += 1;
            for (total, value) in sum.iter_mut().zip(square) {
                *total += value;
            }
        }
        if blocks == 0 {
            return vec![PartError::default(); count];
        }
        sums.chunks_exact(blocks).map(part_error).collect()
    }
}

/// From the number of windows and the sums of squared errors of each block.
fn part_error(blocks: &[(usize, PerChannel<f64>)]) -> PartError {
    let means: PerChannel<Option<BlockMean>> = PerChannel::from_fn(|channel| {
        BlockMean::new(blocks.iter().map(|(n, sum)| BlockSum { samples: *n as f64, sum: sum[channel] }))
    });
    let n: usize = blocks.iter().map(|(n, _)| n).sum();
    let means = if n > 1 { means } else { PerChannel::splat(None) };
    PartError {
        rmse: ChannelValues::new(means.map(|mean| Some(mean?.mean.sqrt()))),
        rmse_ci95: Intervals::new(means.map(|mean| mean?.root_interval())),
        n,
        blocks: blocks.iter().filter(|(n, _)| *n > 0).count(),
    }
}

fn model_error(row: &Row, errors: &[PerChannel<f64>], measured: &[PerChannel<f64>], groups: &Groups) -> ModelError {
    let squares: Vec<PerChannel<f64>> = errors.iter().map(|error| error.map(|value| value * value)).collect();
    let whole = groups.parts(&squares, |_| 0, 1).pop().unwrap_or_default();
    let count = errors.len() as f64;
    let over = |channel: Channel, fold: fn(f64, f64) -> f64| {
        let values = errors.iter().map(|error| error[channel].abs());
        // A fold with `max` would swallow NaN; the sum does not.
        (!errors.is_empty() && values.clone().sum::<f64>().is_finite()).then(|| values.fold(0.0, fold))
    };
    let name = |(names, parts): (Vec<String>, Vec<PartError>)| names.into_iter().zip(parts).collect();
    let by_manoeuvre = groups.parts(&squares, |window| groups.manoeuvre[window], groups.manoeuvres.len());
    let by_regime = groups.parts(&squares, |window| groups.regime[window], Regime::COUNT);
    ModelError {
        name: row.name.clone(),
        windows: errors.len(),
        rmse: whole.rmse,
        rmse_ci95: whole.rmse_ci95,
        mae: ChannelValues::new(PerChannel::from_fn(|channel| over(channel, |sum, value| sum + value).map(|sum| sum / count))),
        max_abs: ChannelValues::new(PerChannel::from_fn(|channel| over(channel, f64::max))),
        r2: ChannelValues::new(PerChannel::from_fn(|channel| {
            let residual: f64 = squares.iter().map(|square| square[channel]).sum();
            Some(1.0 - residual / variation(measured, channel)?)
        })),
        not_finite: row.predicted.iter().filter(|values| values.iter().any(|value| !value.is_finite())).count(),
        difference_to_best: None,
        by_manoeuvre: name((groups.manoeuvres.clone(), by_manoeuvre)),
        by_regime: name((Regime::ALL.map(|regime| regime.name().to_owned()).into(), by_regime)),
    }
}

/// Files of earlier versions state no stride.
const fn one() -> usize {
    1
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::error::Error;
    use crate::flight::Column;
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    /// Flights of class `a` and `b`, 100 samples of 0.5 s each (five blocks), whose targets are `target(flight, sample, channel)`.
    pub(in crate::critique) fn flights(target: impl Fn(usize, usize, usize) -> f64) -> Result<Vec<Flight>> {
        let flight = |index: usize, class: &str| {
            let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; 100]);
            for (channel, column) in Column::TARGETS.into_iter().enumerate() {
                columns[column as usize] = (0..100).map(|sample| target(index, sample, channel)).collect();
            }
            columns[Column::Z as usize] = vec![-10.0; 100];
            columns[Column::Vx as usize] = (0..100).map(|sample| f64::from(sample) / 10.0).collect();
            Flight::new(format!("f{index}"), class, 0.0, 0.5, columns, Targets::Recorded)
        };
        Ok(vec![flight(0, "a")?, flight(1, "b")?])
    }

    pub(in crate::critique) fn every_window(flights: &[Flight]) -> Vec<Window> {
        let of = |(flight, length): (usize, usize)| (0..length).map(move |last| Window { flight, last });
        flights.iter().map(Flight::len).enumerate().flat_map(of).collect()
    }

    fn close(found: Option<f64>, expected: f64) -> bool {
        found.is_some_and(|found| (found - expected).abs() <= CLOSE * expected.abs().max(1.0))
    }

    fn one_channel(values: &[f64]) -> ChannelValues {
        ChannelValues::new(PerChannel::new([values[0], 0.0, 0.0, 0.0, 0.0, 0.0]).map(Some))
    }

    #[test]
    fn four_windows_by_hand() -> Result<()> {
        // Measured 1 2 3 4 (mean 2.5, variation 5), predicted 1 1 5 4: errors 0 1 -2 0.
        let flights = flights(|_, sample, _| sample as f64 + 1.0)?;
        let windows: Vec<Window> = (0..4).map(|last| Window { flight: 0, last }).collect();
        let row = Row { name: "m".into(), predicted: [1.0, 1.0, 5.0, 4.0].map(PerChannel::splat).to_vec() };
        let found = compare(&flights, &windows, &[row], Part::All)?;
        let model = &found.models[0];
        assert!(close(model.rmse.vx_dot, (5.0_f64 / 4.0).sqrt()) && close(model.rmse.mean, (5.0_f64 / 4.0).sqrt()));
        assert!(close(model.mae.wz_dot, 0.75) && close(model.max_abs.vy_dot, 2.0) && close(model.r2.vx_dot, 0.0));
        assert_eq!((model.windows, model.by_manoeuvre.len(), model.by_regime["hover"].n), (4, 1, 4));
        assert_eq!(model.rmse_ci95.vx_dot, None, "one block has no interval");
        Ok(())
    }

    #[test]
    fn the_json_has_the_documented_shape() -> Result<()> {
        let flights = flights(|flight, sample, channel| ((flight + sample * 7 + channel) % 5) as f64)?;
        let windows = every_window(&flights);
        let row = Row { name: "paper".into(), predicted: vec![PerChannel::splat(0.0); windows.len()] };
        let found = compare(&flights, &windows, &[row], Part::Locked)?;
        let json = serde_json::to_value(&found).map_err(|error| Error::Undetermined(error.to_string()))?;
        assert_eq!((&json["target"], &json["split"]), (&"recorded".into(), &"locked".into()));
        let model = &json["models"][0];
        assert_eq!((&model["name"], &model["windows"]), (&"paper".into(), &200.into()));
        for measure in ["rmse", "mae", "max_abs", "r2"] {
            let keys: Vec<_> =
                model[measure].as_object().into_iter().flat_map(|object| object.keys().map(String::as_str)).collect();
            assert_eq!(keys.len(), 7, "{measure} has six channels and the mean");
            assert!(Column::TARGETS.iter().all(|column| model[measure][column.name()].is_number()));
            assert!(model[measure]["mean"].is_number());
        }
        assert_eq!(model["by_manoeuvre"]["b"]["n"], 100);
        assert!(model["by_manoeuvre"]["a"]["rmse"]["vz_dot"].is_number());
        assert_eq!(model["by_regime"]["inverted"]["n"], 0);
        assert!(model["by_regime"]["inverted"]["rmse"]["mean"].is_null(), "the RMSE of nothing is null");
        assert!(model.get("not_finite").is_none());
        let back: Comparison = serde_json::from_value(json).map_err(|error| Error::Undetermined(error.to_string()))?;
        assert_eq!(back.models[0].by_regime.len(), found.models[0].by_regime.len());
        Ok(())
    }

    #[test]
    fn nothing_nan_and_constants_are_null() -> Result<()> {
        let flights = flights(|_, _, _| 0.1)?;
        let empty = compare(&flights, &[], &[Row { name: "m".into(), predicted: vec![] }], Part::All)?;
        assert_eq!((empty.models[0].rmse, empty.models[0].r2), (ChannelValues::default(), ChannelValues::default()));
        let windows = every_window(&flights);
        let mut predicted = vec![PerChannel::splat(0.0); windows.len()];
        predicted[3][Channel::VzDot] = f64::NAN;
        let found = compare(&flights, &windows, &[Row { name: "m".into(), predicted }], Part::All)?;
        let model = &found.models[0];
        assert_eq!((model.not_finite, model.rmse.vz_dot, model.mae.vz_dot, model.max_abs.vz_dot), (1, None, None, None));
        assert!(close(model.rmse.vx_dot, 0.1) && model.rmse.mean.is_none() && model.r2.vx_dot.is_none());
        Ok(())
    }

    #[test]
    fn misfits_are_refused() -> Result<()> {
        let flights = flights(|_, _, _| 0.0)?;
        let short = compare(&flights, &[Window { flight: 0, last: 0 }], &[Row { name: "m".into(), predicted: vec![] }], Part::All);
        assert!(matches!(short, Err(Error::Shape { message, .. }) if message.contains("`m` has 0 predictions for 1 windows")));
        let outside = compare(&flights, &[Window { flight: 0, last: 100 }], &[], Part::All);
        assert!(matches!(outside, Err(Error::Shape { message, .. }) if message.contains("row 100 of flight 0")));
        Ok(())
    }

    #[test]
    fn one_derived_flight_makes_the_targets_derived() -> Result<()> {
        let mut flights = flights(|_, _, _| 0.0)?;
        flights[1].targets = Targets::Derived;
        let target = |flight| Ok::<_, Error>(compare(&flights, &[Window { flight, last: 0 }], &[], Part::Test)?.target);
        assert_eq!((target(0)?, target(1)?), (Targets::Recorded, Targets::Derived));
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn the_measures_hang_together(errors in prop::collection::vec(-5.0..5.0_f64, 200), scale in 0.1..10.0_f64, turn in 0..200_usize) {
            let flights = flights(|flight, sample, _| errors[flight * 100 + sample])?;
            let mut windows = every_window(&flights);
            let zero = Row { name: "zero".into(), predicted: vec![PerChannel::splat(0.0); 200] };
            let scaled = Row { name: "scaled".into(), predicted: errors.iter().map(|e| PerChannel::splat(e * (1.0 - scale))).collect() };
            let found = compare(&flights, &windows, &[zero.clone(), scaled], Part::All)?;
            let [model, other] = [&found.models[0], &found.models[1]];
            // MAE ≤ RMSE ≤ largest error; errors scaled by s scale the RMSE by s.
            let [rmse, mae, largest] = [model.rmse, model.mae, model.max_abs].map(|value| value.vx_dot.unwrap_or(f64::NAN));
            prop_assert!(mae <= rmse * (1.0 + CLOSE) && rmse <= largest * (1.0 + CLOSE));
            prop_assert!(close(other.rmse.vx_dot, rmse * scale));
            // Pooled over the parts, squared errors are those of the whole.
            for parts in [&model.by_manoeuvre, &model.by_regime] {
                let total: f64 = parts.values().map(|part| part.n as f64 * part.rmse.vx_dot.unwrap_or(0.0).powi(2)).sum();
                prop_assert_eq!(parts.values().map(|part| part.n).sum::<usize>(), 200);
                prop_assert!(close(Some((total / 200.0).sqrt()), rmse));
            }
            let inside = model.rmse_ci95.vx_dot.is_some_and(|[low, high]| low <= rmse && rmse <= high);
            prop_assert!(inside);
            // The order of the windows does not matter.
            windows.rotate_left(turn);
            let turned = compare(&flights, &windows, &[zero], Part::All)?;
            prop_assert!(close(turned.models[0].rmse.mean, model.rmse.mean.unwrap_or(f64::NAN)));
            prop_assert!(close(turned.models[0].r2.wz_dot, model.r2.wz_dot.unwrap_or(f64::NAN)));
        }
    }

    #[test]
    fn a_mean_needs_all_six() {
        assert!(close(one_channel(&[3.0]).mean, 0.5));
        assert_eq!(one_channel(&[f64::INFINITY]).mean, None);
    }
}
