//! Predictions at the ends of windows, and what was measured there. Errors are made of them in `compare`.

use super::channels::ChannelValues;
use crate::error::{Error, Result};
use crate::flight::{Channel, Flight, PerChannel, Window};

/// The predictions of one model.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name of the model.
    pub name: String,
    /// Predicted accelerations in the order of [`Channel::ALL`](crate::flight::Channel::ALL), one entry a window, in the order of the windows.
    pub predicted: Vec<PerChannel<f64>>,
}

/// The measured accelerations at the last row of each window, in the order of [`Column::TARGETS`].
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight.
pub(super) fn measured(flights: &[Flight], windows: &[Window]) -> Result<Vec<PerChannel<f64>>> {
    let target = |window: &Window| {
        let flight = flights.get(window.flight)?;
        (window.last < flight.len()).then(|| PerChannel::from_fn(|channel| flight.column(channel.column())[window.last]))
    };
    let fault = |window: &Window| Error::Shape {
        operation: "compare",
        message: format!("a window ends at row {} of flight {}, which is not there", window.last, window.flight),
    };
    windows.iter().map(|window| target(window).ok_or_else(|| fault(window))).collect()
}

/// Standard deviation of the measured accelerations over the windows, m/s² and rad/s²: what makes errors of different channels
/// comparable. `None` for a channel that does not vary.
///
/// # Errors
/// [`Error::Shape`] if a window lies outside its flight.
pub fn deviation(flights: &[Flight], windows: &[Window]) -> Result<ChannelValues> {
    let measured = measured(flights, windows)?;
    let one = |channel| Some((variation(&measured, channel)? / measured.len() as f64).sqrt());
    Ok(ChannelValues::new(PerChannel::from_fn(one)))
}

/// Refuses a row that has not one prediction a window.
pub(super) fn check_row(row: &Row, windows: &[Window]) -> Result<()> {
    if row.predicted.len() == windows.len() {
        return Ok(());
    }
    let message =
        format!("`{}` has {} predictions for {} windows; one each is needed", row.name, row.predicted.len(), windows.len());
    Err(Error::Shape { operation: "compare", message })
}

/// Σ (y − ȳ)² of one channel; `None` if the channel is constant up to rounding, or there is nothing.
pub(super) fn variation(measured: &[PerChannel<f64>], channel: Channel) -> Option<f64> {
    let count = measured.len() as f64;
    let mean = measured.iter().map(|y| y[channel]).sum::<f64>() / count;
    let total: f64 = measured.iter().map(|y| (y[channel] - mean).powi(2)).sum();
    let rounding = count * (count * f64::EPSILON * mean.abs()).powi(2);
    (total > rounding).then_some(total)
}
