//! TimesNet: the sequence folded at its strongest periods, each image through two-dimensional convolutions (Wu et al. 2023, and their
//! code in Time-Series-Library).
//!
//! Embedding: circular convolution of kernel 3 without bias, sinusoidal positions, dropout. A block chooses the k strongest
//! frequencies f and, for each period p = ⌊H/f⌋: zeros up to a multiple of p, rows of p columns, an inception layer, GELU, an inception
//! layer back, cut to H rows; then adds the k results to its input, with softmax weights of their amplitudes. After each block the same
//! layer norm. The last row goes to a linear map.
//!
//! Two exact rewrites: nothing stands between the parallel kernels of an inception layer (sizes 1, 3, …, 11) and their mean, so
//! that they are one kernel of 11; and of this, rows that only meet zeros are left out.
//!
//! One deviation: the reference chooses periods from the amplitude averaged over the batch, so that a prediction depends on its
//! neighbours; here each sample has its own, in training and in prediction.

use super::common_fields;
use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_WIDTH, check_ranges, refused};
use crate::nn::layers::{Init, Recorder};
use crate::tape::ops::{
    Activation, AddWeighted, Dropout, FftPeriods, FoldConvolution, GeneralConv1d, LastRows, LayerNorm, Mean, MergeKernels,
    PositionalEncoding,
};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use phyture_kernels::fold::Fold;
use phyture_kernels::inception;
use serde::{Deserialize, Serialize};

const LARGEST_HISTORY: usize = 16_384;
const MOST_LAYERS: usize = 16;
const MOST_PERIODS: usize = 64;
const NORM_EPS: f64 = 1e-5;

/// Sizes of TimesNet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TimesNetConfig {
    /// H, samples of the history: 1000; even, as positions are.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Width of the embedding, even: 32.
    pub d_model: usize,
    /// Width between the two inception layers of a block: 32.
    pub d_ff: usize,
    /// k, periods of a block: 5.
    pub periods: usize,
    /// Kernels of an inception layer, the j-th of side 2j − 1: 6.
    pub kernels: usize,
    /// Blocks: 2.
    pub layers: usize,
    /// Dropout on the embedding: 0.1.
    pub dropout: f64,
}

impl Default for TimesNetConfig {
    fn default() -> Self {
        Self { history: 1000, state_channels: 16, d_model: 32, d_ff: 32, periods: 5, kernels: 6, layers: 2, dropout: 0.1 }
    }
}

impl Configuration for TimesNetConfig {
    common_fields!();

    fn name(&self) -> &'static str {
        "TimesNet"
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("d_model", self.d_model, LARGEST_WIDTH),
            ("d_ff", self.d_ff, LARGEST_WIDTH),
            ("periods", self.periods, (self.history / 2).min(MOST_PERIODS)),
            ("kernels", self.kernels, inception::MOST_KERNELS),
            ("layers", self.layers, MOST_LAYERS),
        ];
        check_ranges(&sizes, &[("dropout", self.dropout, 0.0, 0.95)])?;
        if !self.d_model.is_multiple_of(2) {
            return Err(refused("d_model", self.d_model, "an even number: positions are sine and cosine pairs"));
        }
        Ok(())
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let deviation = (2.0 / (3 * self.state_channels) as f64).sqrt();
        let shape = [self.d_model, self.state_channels, 3];
        let weight = recorder.parameter("embedding.weight", &shape, Init::Normal { deviation })?;
        let x = recorder.graph.apply(GeneralConv1d::circular(), &[state, weight])?;
        let x = recorder.graph.apply(PositionalEncoding::new(self.history, self.d_model), &[x])?;
        let mut x = recorder.graph.apply(Dropout { rate: self.dropout }, &[x])?;
        let norm_weight = recorder.parameter("norm.weight", &[self.d_model], Init::Constant(1.0))?;
        let norm_bias = recorder.parameter("norm.bias", &[self.d_model], Init::Constant(0.0))?;
        for layer in 0..self.layers {
            let sum = self.block(recorder, &format!("block.{layer}"), x)?;
            x = recorder.graph.apply(LayerNorm { eps: NORM_EPS }, &[sum, norm_weight, norm_bias])?;
        }
        let last = recorder.graph.apply(LastRows { count: 1 }, &[x])?;
        recorder.linear("output", last, ACCELERATIONS, true)
    }
}

impl TimesNetConfig {
    /// x plus the weighted results of all its periods.
    fn block<T: Real>(&self, recorder: &mut Recorder<T>, name: &str, x: Var) -> Result<Var> {
        let periods = recorder.graph.apply(FftPeriods::new(self.periods, self.history), &[x])?;
        let (first, first_bias) = self.inception(recorder, &format!("{name}.inception.0"), self.d_model, self.d_ff)?;
        let (second, second_bias) = self.inception(recorder, &format!("{name}.inception.1"), self.d_ff, self.d_model)?;
        let mut sum = x;
        for index in 0..self.periods {
            // Room for the longest image; what lies behind a shorter one is zero and stays so.
            let wide = FoldConvolution { index, length: self.history, rows: Fold::most_positions(self.history) };
            let inner = recorder.graph.apply(wide, &[x, periods, first, first_bias])?;
            let inner = recorder.graph.apply(Activation { kind: Kind::Gelu }, &[inner])?;
            let back = FoldConvolution { rows: self.history, ..wide };
            let result = recorder.graph.apply(back, &[inner, periods, second, second_bias])?;
            sum = recorder.graph.apply(AddWeighted { index }, &[sum, result, periods])?;
        }
        Ok(sum)
    }

    /// Merged weight and bias of an inception layer: `name.j.weight` [out, in, (2j + 1)²] and `name.j.bias` `[out]`. Weights start
    /// normal with deviation √(2/(out·(2j + 1)²)), biases at 0.
    fn inception<T: Real>(&self, recorder: &mut Recorder<T>, name: &str, inputs: usize, outputs: usize) -> Result<(Var, Var)> {
        let (mut weights, mut biases) = (Vec::new(), Vec::new());
        for kernel in 0..self.kernels {
            let taps = inception::taps(kernel + 1);
            let init = Init::Normal { deviation: (2.0 / (outputs * taps) as f64).sqrt() };
            weights.push(recorder.parameter(&format!("{name}.{kernel}.weight"), &[outputs, inputs, taps], init)?);
            biases.push(recorder.parameter(&format!("{name}.{kernel}.bias"), &[outputs], Init::Constant(0.0))?);
        }
        Ok((recorder.graph.apply(MergeKernels, &weights)?, recorder.graph.apply(Mean, &biases)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_counts() -> crate::nn::Result<()> {
        let count = |config: TimesNetConfig| -> crate::nn::Result<usize> {
            Ok(Network::<f32>::new(config, &OutputScale::unit(6), false)?.graph().parameter_count())
        };
        let base = TimesNetConfig::default;
        // Embedding 1536, two blocks of 586 112, layer norm 64, output 198.
        assert_eq!(count(base())?, 1_174_022);
        assert_eq!(count(base())? - count(TimesNetConfig { layers: 1, ..base() })?, 586_112);
        let wide = TimesNetConfig { d_model: 64, d_ff: 64, ..base() };
        assert_eq!(count(wide.clone())? - count(TimesNetConfig { layers: 1, ..wide })?, 2_343_680);
        Ok(())
    }
}
