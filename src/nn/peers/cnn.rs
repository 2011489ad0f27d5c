//! CNN hybrid: a deep convolutional network on the history, which predicts what the physical baseline leaves over.
//!
//! A reconstruction. Kang, Chen, Wang & Cao, "Deep Convolutional Identifier for Dynamic Modeling and Adaptive Control of Unmanned
//! Helicopter" (IEEE TNNLS, DOI 10.1109/TNNLS.2018.2844173), represent hidden states by a deep CNN on the Stanford data; the sizes
//! of their layers are not public to us. Ours: four convolutions that halve the sequence, then two linear layers on all that is
//! left, because the target belongs to the last row and an average over time would lose the place.
//!
//! The rows are flattened time by time; PyTorch's `flatten` of `[C, n]` goes channel by channel, a permutation of the hidden
//! layer's columns.

use super::common_fields;
use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_HISTORY, LARGEST_WIDTH, check_convolutions};
use crate::nn::layers::Recorder;
use crate::tape::ops::{Activation, Dropout, Ends, Flatten, GeneralConv1d, Place};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use serde::{Deserialize, Serialize};

/// Sizes of the CNN hybrid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CnnConfig {
    /// H, samples of the history: 1000.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Channels of the four convolutions: 32, 64, 64, 128.
    pub channels: [usize; 4],
    /// Their kernels, odd: 7, 5, 3, 3. Stride 2, zeros beyond the ends.
    pub kernels: [usize; 4],
    /// Width of the hidden linear layer: 128.
    pub hidden: usize,
    /// Dropout after each convolution and after the hidden layer: 0.2.
    pub dropout: f64,
}

impl Default for CnnConfig {
    fn default() -> Self {
        let (channels, kernels) = ([32, 64, 64, 128], [7, 5, 3, 3]);
        Self { history: 1000, state_channels: 16, channels, kernels, hidden: 128, dropout: 0.2 }
    }
}

impl Configuration for CnnConfig {
    common_fields!();

    fn name(&self) -> &'static str {
        "CNN hybrid"
    }

    fn predicts_residual(&self) -> bool {
        true
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("hidden", self.hidden, LARGEST_WIDTH),
        ];
        check_convolutions(&sizes, &self.channels, &self.kernels, self.dropout)
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let mut x = state;
        for (layer, (&channels, &kernel)) in self.channels.iter().zip(&self.kernels).enumerate() {
            let place = Place::Padded { padding: kernel / 2, ends: Ends::Zero };
            let op = GeneralConv1d { stride: 2, dilation: 1, place, activation: Kind::Relu, dropout: self.dropout };
            x = recorder.convolution(&format!("convolution.{layer}"), x, channels, kernel, op)?;
        }
        let flat = recorder.graph.apply(Flatten, &[x])?;
        let hidden = recorder.linear("hidden", flat, self.hidden, true)?;
        let hidden = recorder.graph.apply(Activation { kind: Kind::Relu }, &[hidden])?;
        let hidden = recorder.graph.apply(Dropout { rate: self.dropout }, &[hidden])?;
        recorder.linear("output", hidden, ACCELERATIONS, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_count() -> crate::nn::Result<()> {
        let network = Network::<f32>::new(CnnConfig::default(), &OutputScale::unit(6), false)?;
        // Convolutions 50 976, hidden layer 1 032 320, output 774.
        assert_eq!(network.graph().parameter_count(), 1_084_070);
        Ok(())
    }
}
