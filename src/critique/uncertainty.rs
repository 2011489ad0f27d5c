//! What the uncertainty of the physical coefficients does to a hybrid's prediction, per coefficient and channel. The numbers of
//! single windows come from `hybrid::sensitivity`; here they become root mean squares, totals and a table.
//!
//! Totals use the correlations that the model keeps: where two coefficients are known well only together (thrust and its bias at a nearly
//! constant collective), both move the prediction far and their sum does not. The uncertainty of the network's own weights is no part of it.

use super::channels::ChannelValues;
use super::digits::{Kind, aligned};
use crate::error::{Error, Result};
use crate::flight::{Column, Flight, PerChannel, Window};
use crate::hybrid::Hybrid;
use crate::hybrid::sensitivity::{HALF_WIDTH, Movement};
use crate::tape::Threads;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How much work is put into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Windows looked at, at most; chosen evenly from those given. Reverse mode takes six forward and backward passes a window.
    pub windows: usize,
    /// Draws of all coefficients, each with one forward pass a window; 0 leaves resampling out.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Effort {
    /// For a network with this history: 30 draws, and 256 windows up to a history of 128 samples, fewer beyond, 32 at least, so that
    /// the work stays about the same.
    pub fn for_history(history: usize, seed: u64) -> Self {
        const ROWS: usize = 256 * 128;
        Self { windows: (ROWS / history.max(1)).clamp(32, 256), draws: 30, seed }
    }
}

/// What one coefficient does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OfCoefficient {
    /// Name of the effect.
    pub effect: String,
    /// Name of the coefficient.
    pub name: String,
    /// Unit of value and interval.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// 95 % interval of the calibration.
    pub ci95: [f64; 2],
    /// Root mean square over the windows of the change of the hybrid's prediction when the coefficient moves by half the width of
    /// its interval, to first order; m/s² and rad/s².
    pub movement: ChannelValues,
    /// The same of the model alone. Where it is larger, the network makes up for a wrong coefficient; where it is smaller, the
    /// network amplifies it or carries it into another channel.
    pub movement_of_physics: ChannelValues,
}

/// What the coefficients of one network's model do to its predictions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// Name of the network.
    pub name: String,
    /// Windows it was computed on.
    pub windows: usize,
    /// Draws behind `sd_resampled`.
    pub draws: usize,
    /// One entry a coefficient with an interval, in the order of the model.
    pub coefficients: Vec<OfCoefficient>,
    /// Whether the model keeps correlations of its coefficients; they count as independent where it does not.
    #[serde(default)]
    pub correlated: bool,
    /// Coefficients without an interval, as `effect.coefficient`: they are taken as known.
    pub without_interval: Vec<String>,
    /// Standard deviation of the hybrid's prediction by reverse mode, root mean square over the windows of √(Σ m_i r_ij m_j) / 1.96 with
    /// movements m and correlations r; m/s² and rad/s².
    pub sd: ChannelValues,
    /// The same of the model alone.
    pub sd_of_physics: ChannelValues,
    /// Standard deviation over hybrids with coefficients drawn anew, root mean square over the windows. It differs from `sd` by
    /// what is not linear, and by chance: about 13 % with 30 draws.
    pub sd_resampled: ChannelValues,
    /// `sd` over the RMSE of the hybrid on the same windows.
    pub share_of_rmse: ChannelValues,
}

/// How far the hybrid's predictions at the windows move with the coefficients of its model.
///
/// # Errors
/// [`Error::Undetermined`] if no coefficient of the model has an interval, or there is no window; otherwise as
/// [`Hybrid::predict`].
pub fn uncertainty(
    name: &str,
    hybrid: &Hybrid,
    flights: &[Flight],
    windows: &[Window],
    effort: Effort,
    threads: Threads,
) -> Result<Uncertainty> {
    let estimates = hybrid.estimates();
    let windows = evenly(windows, effort.windows);
    if estimates.is_empty() || windows.is_empty() {
        let what =
            if windows.is_empty() { "there is no window" } else { "no coefficient of its model has an interval; calibrate it" };
        return Err(Error::Undetermined(format!("the uncertainty of `{name}` cannot be computed: {what}")));
    }
    let movements = hybrid.movements(flights, &windows, &estimates, threads)?;
    let resampled = match effort.draws {
        0 | 1 => Vec::new(),
        draws => hybrid.resampled(flights, &windows, &estimates, draws, effort.seed, threads)?,
    };
    let errors = hybrid.predict(flights, &windows, threads)?;
    let errors = windows.iter().zip(errors).map(|(window, predicted)| {
        PerChannel::from_fn(|channel| flights[window.flight].column(channel.column())[window.last] - predicted[channel])
    });
    let rmse = root_mean_square(errors);
    let of = |pick: fn(&Movement) -> PerChannel<f64>| -> Vec<PerChannel<f64>> {
        movements.iter().map(|of_windows| root_mean_square(of_windows.iter().map(pick))).collect()
    };
    let (whole, physics) = (of(|movement| movement.hybrid), of(|movement| movement.physics));
    let correlations = hybrid.correlations(&estimates);
    let total = |pick: fn(&Movement) -> PerChannel<f64>| -> PerChannel<f64> {
        root_mean_square((0..windows.len()).map(|window| {
            PerChannel::from_fn(|channel| {
                let moved = DVector::from_fn(estimates.len(), |one, _| pick(&movements[one][window])[channel]);
                // Rounded correlations may take a little too much away.
                moved.dot(&(&correlations * &moved)).max(0.0).sqrt() / HALF_WIDTH
            })
        }))
    };
    let sd = total(|movement| movement.hybrid);
    let effects = hybrid.description().model.effects.iter().filter(|effect| effect.enabled);
    let all = effects.flat_map(|effect| effect.coefficients.iter().map(move |one| (effect, one)));
    let known = |(effect, name): (&str, &str)| estimates.iter().any(|estimate| estimate.effect == effect && estimate.name == name);
    let coefficients = estimates.iter().zip(&whole).zip(&physics).map(|((estimate, whole), physics)| OfCoefficient {
        effect: estimate.effect.clone(),
        name: estimate.name.clone(),
        unit: estimate.unit.clone(),
        value: estimate.value,
        ci95: estimate.ci95.unwrap_or([estimate.value; 2]),
        movement: per_channel(*whole),
        movement_of_physics: per_channel(*physics),
    });
    Ok(Uncertainty {
        name: name.to_owned(),
        windows: windows.len(),
        draws: if resampled.is_empty() { 0 } else { effort.draws },
        coefficients: coefficients.collect(),
        correlated: !hybrid.description().model.correlations.is_empty(),
        without_interval: all
            .filter(|(effect, one)| !known((effect.name.as_str(), one.name.as_str())))
            .map(|(effect, one)| format!("{}.{}", effect.name, one.name))
            .collect(),
        sd: per_channel(sd),
        sd_of_physics: per_channel(total(|movement| movement.physics)),
        sd_resampled: if resampled.is_empty() {
            ChannelValues::default()
        } else {
            per_channel(root_mean_square(resampled.into_iter()))
        },
        share_of_rmse: per_channel(PerChannel::from_fn(|channel| sd[channel] / rmse[channel])),
    })
}

/// At most `most` of the windows, evenly spread over them.
fn evenly(windows: &[Window], most: usize) -> Vec<Window> {
    let count = windows.len().min(most);
    (0..count).filter_map(|index| windows.get(index * windows.len() / count).copied()).collect()
}

fn per_channel(values: PerChannel<f64>) -> ChannelValues {
    ChannelValues::new(values.map(Some))
}

/// √(Σ x² / n) of each channel.
fn root_mean_square(values: impl Iterator<Item = PerChannel<f64>>) -> PerChannel<f64> {
    let (mut sums, mut count) = (PerChannel::splat(0.0), 0.0);
    for value in values {
        sums.iter_mut().zip(value).for_each(|(sum, value)| *sum += value * value);
        count += 1.0;
    }
    sums.map(|sum| (sum / count).sqrt())
}

impl Uncertainty {
    /// The totals as rows: name, values, and whether they are a share.
    pub fn totals(&self) -> Vec<(String, ChannelValues, Kind)> {
        let mut rows = vec![("all, standard deviation".to_owned(), self.sd, Kind::Error)];
        if self.draws > 0 {
            rows.push((format!("the same from {} draws", self.draws), self.sd_resampled, Kind::Error));
        }
        rows.push(("the model alone".to_owned(), self.sd_of_physics, Kind::Error));
        rows.push(("all, over the RMSE".to_owned(), self.share_of_rmse, Kind::Share));
        rows
    }

    /// What the numbers rest on, and what they leave out.
    pub fn note(&self) -> String {
        let together = if self.correlated { "vary together as the model file says" } else { "count as independent" };
        let mut note = format!("On {} windows. Coefficients {together}, weights of the network count as known.", self.windows);
        if !self.without_interval.is_empty() {
            note.push_str(&format!(" Taken as known, for want of an interval: {}.", self.without_interval.join(", ")));
        }
        note
    }
}

/// Coefficient × channel, totals below.
impl fmt::Display for Uncertainty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cells = |of: &ChannelValues, kind: Kind| of.channels().into_iter().map(|value| kind.text(value)).collect();
        let own = self.coefficients.iter().map(|one| (format!("{}.{}", one.effect, one.name), cells(&one.movement, Kind::Error)));
        let totals = self.totals().into_iter().map(|(name, of, kind)| (name, cells(&of, kind)));
        writeln!(f, "Movement of `{}` when a coefficient moves by half its 95 % interval, root mean square", self.name)?;
        let heads: Vec<(&str, &str)> = Column::TARGETS.iter().map(|column| (column.name(), column.unit())).collect();
        aligned(f, &heads, &own.chain(totals).collect::<Vec<_>>())?;
        write!(f, "  {}", self.note())
    }
}
