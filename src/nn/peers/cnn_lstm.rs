//! CNN–LSTM hybrid: convolutions over states and controls, an LSTM over time; predicts what the physical baseline leaves over.
//!
//! A reconstruction. Zhang & Liu (Nonlinear Dynamics 112, 12235–12252, 2024) join a physical model and a CNN–LSTM residually, the
//! convolutions for the dimension of states and controls, the LSTM for time, and fit physics first and then the network on the
//! same data; sizes are not public to us. Ours: two blocks of convolution, rectifier, maximum of pairs and dropout, an LSTM over the
//! 250 rows left, and a linear map of its last hidden state.

use super::common_fields;
use crate::nn::configuration::{
    ACCELERATIONS, Configuration, LARGEST_HISTORY, LARGEST_KERNEL, LARGEST_WIDTH, check_convolutions, refused,
};
use crate::nn::layers::Recorder;
use crate::tape::ops::{Dropout, Ends, GeneralConv1d, LastRows, Place, Pool};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use phyture_kernels::pool;
use serde::{Deserialize, Serialize};

/// Sizes of the CNN–LSTM hybrid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CnnLstmConfig {
    /// H, samples of the history: 1000.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Channels of the two convolutions: 64, 64.
    pub channels: [usize; 2],
    /// Their kernels, odd: 5, 3. Zeros beyond the ends.
    pub kernels: [usize; 2],
    /// Rows of which the largest is taken after each convolution: 2.
    pub pool: usize,
    /// Hidden units of the LSTM: 64.
    pub hidden: usize,
    /// Dropout after each block and on the last hidden state: 0.2.
    pub dropout: f64,
}

impl Default for CnnLstmConfig {
    fn default() -> Self {
        Self { history: 1000, state_channels: 16, channels: [64, 64], kernels: [5, 3], pool: 2, hidden: 64, dropout: 0.2 }
    }
}

impl Configuration for CnnLstmConfig {
    common_fields!();

    fn name(&self) -> &'static str {
        "CNN–LSTM hybrid"
    }

    fn predicts_residual(&self) -> bool {
        true
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("pool", self.pool, LARGEST_KERNEL),
            ("hidden", self.hidden, LARGEST_WIDTH),
        ];
        check_convolutions(&sizes, &self.channels, &self.kernels, self.dropout)?;
        if self.history < self.pool * self.pool {
            return Err(refused("pool", self.pool, "a width of which two fit into the history, one in the other"));
        }
        Ok(())
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let mut x = state;
        for (layer, (&channels, &kernel)) in self.channels.iter().zip(&self.kernels).enumerate() {
            let place = Place::Padded { padding: kernel / 2, ends: Ends::Zero };
            let op = GeneralConv1d { place, activation: Kind::Relu, ..GeneralConv1d::padded(0) };
            x = recorder.convolution(&format!("convolution.{layer}"), x, channels, kernel, op)?;
            x = recorder.graph.apply(Pool::blocks(pool::Pool::Max, self.pool), &[x])?;
            x = recorder.graph.apply(Dropout { rate: self.dropout }, &[x])?;
        }
        let states = recorder.lstm("lstm", x, self.hidden)?;
        let last = recorder.graph.apply(LastRows { count: 1 }, &[states])?;
        let last = recorder.graph.apply(Dropout { rate: self.dropout }, &[last])?;
        recorder.linear("output", last, ACCELERATIONS, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_count() -> crate::nn::Result<()> {
        let network = Network::<f32>::new(CnnLstmConfig::default(), &OutputScale::unit(6), false)?;
        // Convolutions 5184 and 12 352, LSTM 33 280, output 390.
        assert_eq!(network.graph().parameter_count(), 51_206);
        Ok(())
    }
}
