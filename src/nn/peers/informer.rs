//! Conv–Informer: a convolutional front end before an Informer (Zhou et al. 2021, and their code Informer2020).
//!
//! A reconstruction: which network the paper calls by this name is not public to us; a plausible source is Wang, Song & Cheng (Frontiers
//! in Energy Research 2022), a CNN before an Informer for wind power. The Informer itself follows its code, without the time marks.
//!
//! 1. Two convolutions of kernel 3 with rectifiers; embedding: circular convolution of kernel 3, sinusoidal positions, dropout.
//! 2. Encoder layers: ProbSparse attention, dropout, sum, layer norm; two linear maps with GELU and dropouts, sum, layer norm. Between
//!    layers the sequence is distilled to half its length: circular convolution of kernel 3, batch norm, ELU, maximum of three rows
//!    at stride 2. A last layer norm.
//! 3. One decoder on the last rows of S, row t included (nothing about the target is hidden, so there are no zero rows to fill in):
//!    embedding as above; masked ProbSparse attention, full attention to the encoder's result, linear maps as above, each with sum and
//!    layer norm; a last layer norm, and a linear map of the last row.
//!
//! Heads keep their columns throughout; the reference's transposed reshape in the decoder is not repeated.

use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_HISTORY, LARGEST_WIDTH, check_ranges, refused};
use crate::nn::layers::{Init, Recorder};
use crate::tape::ops::{
    Activation, Add, Attention, BatchNorm, Dropout, Ends, GeneralConv1d, LastRows, Place, Pool, PositionalEncoding, ProbSparse,
};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use phyture_kernels::pool::{self, Geometry};
use phyture_kernels::prob_sparse::Sparse;
use serde::{Deserialize, Serialize};

const MOST_LAYERS: usize = 16;
const LARGEST_FACTOR: usize = 1000;
const NORM_EPS: f64 = 1e-5;

/// Weight of a step in the running values of batch norm.
const MOMENTUM: f64 = 0.1;

/// Sizes of the Conv–Informer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InformerConfig {
    /// H, samples of the history: 1000.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Width throughout, even: 64.
    pub d_model: usize,
    /// Width between the two linear maps of a layer: 256.
    pub d_ff: usize,
    /// Attention heads: 4.
    pub heads: usize,
    /// Encoder layers: 2. The sequence is halved between them.
    pub encoder_layers: usize,
    /// Decoder layers: 1.
    pub decoder_layers: usize,
    /// Rows of S that the decoder reads: 48.
    pub decoder_rows: usize,
    /// Factor before the logarithm of the length, for sampled keys and for chosen queries: 5.
    pub factor: usize,
    /// Dropout everywhere but in ProbSparse attention: 0.05.
    pub dropout: f64,
    /// Of the keys that are sampled when predicting: 0.
    pub seed: u64,
}

impl Default for InformerConfig {
    fn default() -> Self {
        Self {
            history: 1000,
            state_channels: 16,
            d_model: 64,
            d_ff: 256,
            heads: 4,
            encoder_layers: 2,
            decoder_layers: 1,
            decoder_rows: 48,
            factor: 5,
            dropout: 0.05,
            seed: 0,
        }
    }
}

impl Configuration for InformerConfig {
    fn name(&self) -> &'static str {
        "Conv–Informer"
    }

    fn history(&self) -> usize {
        self.history
    }

    fn state_channels(&self) -> usize {
        self.state_channels
    }

    /// Always: keys are sampled, and batch norm tells training from prediction.
    fn is_random(&self) -> bool {
        true
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("d_model", self.d_model, LARGEST_WIDTH),
            ("d_ff", self.d_ff, LARGEST_WIDTH),
            ("heads", self.heads, LARGEST_WIDTH),
            ("encoder_layers", self.encoder_layers, MOST_LAYERS),
            ("decoder_layers", self.decoder_layers, MOST_LAYERS),
            ("decoder_rows", self.decoder_rows, self.history),
            ("factor", self.factor, LARGEST_FACTOR),
        ];
        check_ranges(&sizes, &[("dropout", self.dropout, 0.0, 0.95)])?;
        if !self.d_model.is_multiple_of(self.heads) {
            return Err(refused("heads", self.heads, format!("a divisor of d_model = {}", self.d_model)));
        }
        if !self.d_model.is_multiple_of(2) {
            return Err(refused("d_model", self.d_model, "an even number: positions are sine and cosine pairs"));
        }
        Ok(())
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let mut builder = Builder { recorder, config: self, layers: 0 };
        let encoded = builder.encoder(state)?;
        let decoded = builder.decoder(state, encoded)?;
        let last = builder.apply(LastRows { count: 1 }, &[decoded])?;
        builder.recorder.linear("output", last, ACCELERATIONS, true)
    }
}

struct Builder<'a, T> {
    recorder: &'a mut Recorder<T>,
    config: &'a InformerConfig,
    /// ProbSparse attentions so far: each has a sample of its own.
    layers: u64,
}

impl<T: Real> Builder<'_, T> {
    fn apply(&mut self, op: impl crate::tape::op::Op<T> + 'static, operands: &[Var]) -> Result<Var> {
        self.recorder.graph.apply(op, operands)
    }

    fn dropped(&mut self, x: Var) -> Result<Var> {
        self.apply(Dropout { rate: self.config.dropout }, &[x])
    }

    fn normed(&mut self, name: &str, x: Var) -> Result<Var> {
        self.recorder.layer_norm(name, x, NORM_EPS)
    }

    /// Circular convolution of kernel 3, positions, dropout. Starts normal with deviation √(2/(3·in)).
    fn embed(&mut self, name: &str, x: Var) -> Result<Var> {
        let ((rows, inputs), d_model) = (self.recorder.graph.shape(x).rows(), self.config.d_model);
        let init = Init::Normal { deviation: (2.0 / (3 * inputs) as f64).sqrt() };
        let x = self.recorder.convolution_from(name, x, d_model, 3, GeneralConv1d::circular(), init)?;
        let x = self.apply(PositionalEncoding::new(rows, d_model), &[x])?;
        self.dropped(x)
    }

    fn encoder(&mut self, state: Var) -> Result<Var> {
        let (d_model, layers) = (self.config.d_model, self.config.encoder_layers);
        let place = Place::Padded { padding: 1, ends: Ends::Zero };
        let front = GeneralConv1d { place, activation: Kind::Relu, ..GeneralConv1d::padded(1) };
        let x = self.recorder.convolution("front.0", state, d_model, 3, front)?;
        let x = self.recorder.convolution("front.1", x, d_model, 3, front)?;
        let mut x = self.embed("encoder.embedding", x)?;
        for layer in 0..layers {
            let name = format!("encoder.{layer}");
            let attended = self.attention(&format!("{name}.attention"), x, x, Some(false))?;
            x = self.residual(&format!("{name}.norm1"), x, attended)?;
            x = self.mapped(&name, "norm2", x)?;
            if layer + 1 < layers {
                x = self.distilled(&format!("{name}.distilling"), x)?;
            }
        }
        self.normed("encoder.norm", x)
    }

    fn decoder(&mut self, state: Var, encoded: Var) -> Result<Var> {
        let rows = self.apply(LastRows { count: self.config.decoder_rows }, &[state])?;
        let mut x = self.embed("decoder.embedding", rows)?;
        for layer in 0..self.config.decoder_layers {
            let name = format!("decoder.{layer}");
            let attended = self.attention(&format!("{name}.attention"), x, x, Some(true))?;
            x = self.residual(&format!("{name}.norm1"), x, attended)?;
            let attended = self.attention(&format!("{name}.cross"), x, encoded, None)?;
            x = self.residual(&format!("{name}.norm2"), x, attended)?;
            x = self.mapped(&name, "norm3", x)?;
        }
        self.normed("decoder.norm", x)
    }

    /// Attention of x to `memory`: ProbSparse, masked or not, or full.
    fn attention(&mut self, name: &str, x: Var, memory: Var, sparse: Option<bool>) -> Result<Var> {
        let InformerConfig { d_model, heads, factor, dropout, seed, .. } = *self.config;
        let query = self.recorder.linear(&format!("{name}.query"), x, d_model, true)?;
        let key = self.recorder.linear(&format!("{name}.key"), memory, d_model, true)?;
        let value = self.recorder.linear(&format!("{name}.value"), memory, d_model, true)?;
        let mixed = match sparse {
            Some(masked) => {
                self.layers += 1;
                let op = ProbSparse { sparse: Sparse { heads, factor, masked }, seed: seed.wrapping_add(self.layers) };
                self.apply(op, &[query, key, value])?
            }
            None => self.apply(Attention { heads, dropout }, &[query, key, value])?,
        };
        self.recorder.linear(&format!("{name}.output"), mixed, d_model, true)
    }

    /// LayerNorm(x + dropout(y)).
    fn residual(&mut self, name: &str, x: Var, y: Var) -> Result<Var> {
        let y = self.dropped(y)?;
        let sum = self.apply(Add, &[x, y])?;
        self.normed(name, sum)
    }

    /// Two linear maps (the reference's convolutions of kernel 1), GELU and dropouts, sum and layer norm.
    fn mapped(&mut self, name: &str, norm: &str, x: Var) -> Result<Var> {
        let inner = self.recorder.linear(&format!("{name}.map.0"), x, self.config.d_ff, true)?;
        let inner = self.apply(Activation { kind: Kind::Gelu }, &[inner])?;
        let inner = self.dropped(inner)?;
        let back = self.recorder.linear(&format!("{name}.map.1"), inner, self.config.d_model, true)?;
        self.residual(&format!("{name}.{norm}"), x, back)
    }

    /// Half as many rows.
    fn distilled(&mut self, name: &str, x: Var) -> Result<Var> {
        let d_model = self.config.d_model;
        let x = self.recorder.convolution(name, x, d_model, 3, GeneralConv1d::circular())?;
        let x = self.recorder.batch_norm(&format!("{name}.norm"), x, BatchNorm { eps: NORM_EPS, momentum: MOMENTUM })?;
        let x = self.apply(Activation { kind: Kind::Elu }, &[x])?;
        self.apply(Pool { kind: pool::Pool::Max, geometry: Geometry { width: 3, stride: 2, padding: 1 } }, &[x])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_count() -> crate::nn::Result<()> {
        let network = Network::<f32>::new(InformerConfig::default(), &OutputScale::unit(6), false)?;
        let running: usize =
            network.parameters().iter().filter(|parameter| parameter.name.contains("running")).map(|p| p.shape.len()).sum();
        // The running mean and variance of one batch norm are stored beside the parameters, but not trained.
        assert_eq!(running, 128);
        // Front end 3136 + 12 352, embeddings 12 352 and 3136, the reference's encoder, decoder and output map.
        assert_eq!(network.graph().parameter_count() - running, 15_488 + 15_488 + 112_576 + 66_880 + 390);
        Ok(())
    }

    #[test]
    fn distilling_halves_the_sequence() -> crate::nn::Result<()> {
        let config = InformerConfig { encoder_layers: 3, ..InformerConfig::default() };
        let mut recorder = Recorder::<f32>::default();
        let state = recorder.graph.input("state", &[1000, 16])?;
        let encoded = Builder { recorder: &mut recorder, config: &config, layers: 0 }.encoder(state)?;
        assert_eq!(recorder.graph.shape(encoded).lengths(), [250, 64]);
        Ok(())
    }
}
