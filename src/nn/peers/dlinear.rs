//! DLinear: trend and seasonal part of the history, each through one linear map over time (Zeng et al. 2023, and their code).
//!
//! The trend is a moving average, the seasonal part what is left; each is mapped from H rows to one, the two are added, and a
//! linear map of the 16 channels gives the six accelerations (the last step is ours: the reference predicts its own inputs). Without
//! any nonlinearity this is a linear filter. The maps over time are shared by all channels ("DLinear") or one a channel.

use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_HISTORY, LARGEST_WIDTH, check_ranges, refused};
use crate::nn::layers::Recorder;
use crate::tape::ops::{Add, MovingAverage, Subtract};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use serde::{Deserialize, Serialize};

/// Sizes of DLinear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DLinearConfig {
    /// H, samples of the history: 1000.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Width of the moving average, odd: 25.
    pub moving_average: usize,
    /// Maps of its own for each channel: false.
    pub individual: bool,
}

impl Default for DLinearConfig {
    fn default() -> Self {
        Self { history: 1000, state_channels: 16, moving_average: 25, individual: false }
    }
}

impl Configuration for DLinearConfig {
    fn name(&self) -> &'static str {
        if self.individual { "DLinear (individual)" } else { "DLinear" }
    }

    fn history(&self) -> usize {
        self.history
    }

    fn state_channels(&self) -> usize {
        self.state_channels
    }

    fn is_random(&self) -> bool {
        false
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("moving_average", self.moving_average, LARGEST_HISTORY),
        ];
        check_ranges(&sizes, &[])?;
        if self.moving_average.is_multiple_of(2) {
            return Err(refused("moving_average", self.moving_average, "an odd width, so that the average is centred"));
        }
        Ok(())
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let trend = recorder.graph.apply(MovingAverage { width: self.moving_average }, &[state])?;
        let seasonal = recorder.graph.apply(Subtract, &[state, trend])?;
        let mut along = |name: &str, x: Var| match self.individual {
            true => recorder.temporal_each(name, x),
            false => recorder.temporal(name, x, 1, true),
        };
        let (trend, seasonal) = (along("trend", trend)?, along("seasonal", seasonal)?);
        let sum = recorder.graph.apply(Add, &[trend, seasonal])?;
        recorder.linear("output", sum, ACCELERATIONS, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_counts() -> crate::nn::Result<()> {
        let count = |config: DLinearConfig| -> crate::nn::Result<usize> {
            Ok(Network::<f32>::new(config, &OutputScale::unit(6), false)?.graph().parameter_count())
        };
        assert_eq!(count(DLinearConfig::default())?, 2_104);
        assert_eq!(count(DLinearConfig { individual: true, ..DLinearConfig::default() })?, 32_134);
        Ok(())
    }
}
