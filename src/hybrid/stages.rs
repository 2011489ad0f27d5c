//! A hybrid's prediction part by part: physics alone, with the linear history, with the network. No judgement here: errors and
//! shares are made of these in `critique`.

use super::{Hybrid, sequence};
use crate::error::Result;
use crate::flight::{Accelerations, Flight, PerChannel, Window};
use crate::tape::Threads;

/// What a hybrid predicts as its parts are added one after the other; one entry a window, six channels in the order of
/// [`crate::flight::Column::TARGETS`], m/s² and rad/s².
#[derive(Clone, Debug, PartialEq)]
pub struct Stages {
    /// The calibrated model alone, a^p.
    pub physics: Vec<PerChannel<f64>>,
    /// Model and linear history, if the hybrid has one that is added to its prediction.
    pub with_linear: Option<Vec<PerChannel<f64>>>,
    /// Everything: what [`Hybrid::predict`] gives.
    pub hybrid: Vec<PerChannel<f64>>,
}

impl Hybrid {
    /// The prediction at the last row of each window, part by part.
    ///
    /// A network that predicts the acceleration itself (no residual) takes physics and linear history as inputs only; its
    /// stages are then physics, and the hybrid.
    ///
    /// # Errors
    /// As [`Hybrid::predict`].
    pub fn stages(&self, flights: &[Flight], windows: &[Window], threads: Threads) -> Result<Stages> {
        self.check_windows(flights, windows)?;
        let description = self.description();
        let sequences = sequence::sequences(flights, description)?;
        let physics: Vec<Accelerations> = flights.iter().map(|flight| description.model.predict(flight)).collect::<Result<_>>()?;
        let alone = |window: &Window| PerChannel::from_fn(|channel| physics[window.flight][channel][window.last]);
        let added = description.linear.is_some() && description.config.predicts_residual();
        let with_linear = |window: &Window| sequences[window.flight].baseline(window.last);
        Ok(Stages {
            physics: windows.iter().map(alone).collect(),
            with_linear: added.then(|| windows.iter().map(with_linear).collect()),
            hybrid: self.complete_windows(flights, &sequences, windows, threads)?,
        })
    }
}
