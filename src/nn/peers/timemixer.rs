//! TimeMixer: seasonal and trend parts mixed across time scales (Wang et al. 2024, and their code), in its channel-mixing mode.
//!
//! 1. Means of pairs, three times: sequences of H, H/2, H/4 and H/8 rows. Each is split by a moving average; only the seasonal part
//!    is embedded (circular convolution of kernel 3, no bias), the trend of the raw channels goes to the output.
//! 2. Past-decomposable mixing, in every layer: split again; one map d → d_ff → d with GELU for seasonal parts and trends alike;
//!    seasonal parts are added from fine to coarse and trends from coarse to fine, each step through two linear maps over time with
//!    a GELU between; the results are added, without a residual.
//! 3. Every scale predicts: a linear map over time to one row, one shared by all scales to the six accelerations; plus its raw
//!    trend through two linear maps over time and one shared, bias-free map of the channels. The scales' predictions are summed.
//!
//! The channel map of the raw trend is ours: the reference adds it to outputs that are its inputs. A layer norm and an output map
//! in each mixing layer of the reference are never used in this mode and never receive a gradient (2·(32 + 1072) = 2208 of its
//! 7 255 826 parameters at the default sizes); they are left out.

use super::common_fields;
use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_WIDTH, check_ranges, refused};
use crate::nn::layers::{Init, Recorder};
use crate::tape::ops::{Activation, Add, Dropout, GeneralConv1d, MovingAverage, Pool, Subtract};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use phyture_kernels::pool;
use serde::{Deserialize, Serialize};

/// Longest history: the maps over time have H² parameters.
const LARGEST_HISTORY: usize = 8192;
const MOST_LAYERS: usize = 16;
const MOST_SCALES: usize = 8;

/// Sizes of TimeMixer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TimeMixerConfig {
    /// H, samples of the history: 1000; a multiple of 2^scales.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// d, width of the embedding: 16.
    pub d_model: usize,
    /// Width between the two maps of a mixing layer: 32.
    pub d_ff: usize,
    /// Mixing layers: 2.
    pub layers: usize,
    /// Times the sequence is halved: 3.
    pub scales: usize,
    /// Width of the moving average at every scale, odd: 25.
    pub moving_average: usize,
    /// Dropout on the embedding: 0.1.
    pub dropout: f64,
}

impl Default for TimeMixerConfig {
    fn default() -> Self {
        let (d_model, d_ff, layers, scales, moving_average) = (16, 32, 2, 3, 25);
        Self { history: 1000, state_channels: 16, d_model, d_ff, layers, scales, moving_average, dropout: 0.1 }
    }
}

impl Configuration for TimeMixerConfig {
    common_fields!();

    fn name(&self) -> &'static str {
        "TimeMixer"
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("d_model", self.d_model, LARGEST_WIDTH),
            ("d_ff", self.d_ff, LARGEST_WIDTH),
            ("layers", self.layers, MOST_LAYERS),
            ("scales", self.scales, MOST_SCALES),
            ("moving_average", self.moving_average, LARGEST_HISTORY),
        ];
        check_ranges(&sizes, &[("dropout", self.dropout, 0.0, 0.95)])?;
        if self.moving_average.is_multiple_of(2) {
            return Err(refused("moving_average", self.moving_average, "an odd width, so that the average is centred"));
        }
        if !self.history.is_multiple_of(1 << self.scales) {
            let expected = format!("a multiple of 2^scales = {}: each scale halves the sequence", 1 << self.scales);
            return Err(refused("history", self.history, expected));
        }
        Ok(())
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        let mut builder = Builder { recorder, config: self };
        let (mut scales, raw_trends) = builder.embed(state)?;
        for layer in 0..self.layers {
            scales = builder.mix(&format!("mixing.{layer}"), &scales)?;
        }
        builder.predict(&scales, &raw_trends)
    }
}

struct Builder<'a, T> {
    recorder: &'a mut Recorder<T>,
    config: &'a TimeMixerConfig,
}

impl<T: Real> Builder<'_, T> {
    fn apply(&mut self, op: impl crate::tape::op::Op<T> + 'static, operands: &[Var]) -> Result<Var> {
        self.recorder.graph.apply(op, operands)
    }

    /// Seasonal part and trend.
    fn split(&mut self, x: Var) -> Result<(Var, Var)> {
        let trend = self.apply(MovingAverage { width: self.config.moving_average }, &[x])?;
        Ok((self.apply(Subtract, &[x, trend])?, trend))
    }

    /// Embedded seasonal parts and raw trends, from fine to coarse.
    fn embed(&mut self, state: Var) -> Result<(Vec<Var>, Vec<Var>)> {
        let TimeMixerConfig { state_channels, d_model, dropout, scales, .. } = *self.config;
        // Kaiming's normal start, as the reference has it.
        let deviation = (2.0 / (3 * state_channels) as f64).sqrt();
        let weight = self.recorder.parameter("embedding.weight", &[d_model, state_channels, 3], Init::Normal { deviation })?;
        let (mut embedded, mut raw_trends, mut x) = (Vec::new(), Vec::new(), state);
        for scale in 0..=scales {
            if scale > 0 {
                x = self.apply(Pool::blocks(pool::Pool::Mean, 2), &[x])?;
            }
            let (seasonal, trend) = self.split(x)?;
            let wide = self.apply(GeneralConv1d::circular(), &[seasonal, weight])?;
            embedded.push(self.apply(Dropout { rate: dropout }, &[wide])?);
            raw_trends.push(trend);
        }
        Ok((embedded, raw_trends))
    }

    /// One layer of past-decomposable mixing.
    fn mix(&mut self, name: &str, scales: &[Var]) -> Result<Vec<Var>> {
        let TimeMixerConfig { d_model, d_ff, .. } = *self.config;
        let wide = self.recorder.linear_weights(&format!("{name}.channels.0"), d_model, d_ff)?;
        let back = self.recorder.linear_weights(&format!("{name}.channels.1"), d_ff, d_model)?;
        let mapped = |builder: &mut Self, x: Var| -> Result<Var> {
            let inner = builder.recorder.linear_with(x, wide)?;
            let inner = builder.apply(Activation { kind: Kind::Gelu }, &[inner])?;
            builder.recorder.linear_with(inner, back)
        };
        let (mut seasonal, mut trends) = (Vec::new(), Vec::new());
        for &x in scales {
            let (season, trend) = self.split(x)?;
            seasonal.push(mapped(self, season)?);
            trends.push(mapped(self, trend)?);
        }
        // Seasonal parts from fine to coarse, trends from coarse to fine.
        for scale in 1..seasonal.len() {
            let step = self.resample(&format!("{name}.down.{}", scale - 1), seasonal[scale - 1], seasonal[scale])?;
            seasonal[scale] = self.apply(Add, &[seasonal[scale], step])?;
        }
        for scale in (1..trends.len()).rev() {
            let step = self.resample(&format!("{name}.up.{}", scale - 1), trends[scale], trends[scale - 1])?;
            trends[scale - 1] = self.apply(Add, &[trends[scale - 1], step])?;
        }
        seasonal.into_iter().zip(trends).map(|(seasonal, trend)| self.apply(Add, &[seasonal, trend])).collect()
    }

    /// Two linear maps over time with a GELU between, to as many rows as `like` has.
    fn resample(&mut self, name: &str, x: Var, like: Var) -> Result<Var> {
        let rows = self.recorder.graph.shape(like).rows().0;
        let first = self.recorder.temporal(&format!("{name}.0"), x, rows, true)?;
        let first = self.apply(Activation { kind: Kind::Gelu }, &[first])?;
        self.recorder.temporal(&format!("{name}.1"), first, rows, true)
    }

    /// The sum of all scales' predictions.
    fn predict(&mut self, scales: &[Var], raw_trends: &[Var]) -> Result<Var> {
        let TimeMixerConfig { state_channels, d_model, .. } = *self.config;
        let output = self.recorder.linear_weights("output", d_model, ACCELERATIONS)?;
        let fan_in = Init::fan_in(state_channels);
        let channels = self.recorder.parameter("trend_output.weight", &[ACCELERATIONS, state_channels], fan_in)?;
        let mut sum = None;
        for (scale, (&x, &trend)) in scales.iter().zip(raw_trends).enumerate() {
            let row = self.recorder.temporal(&format!("predict.{scale}"), x, 1, true)?;
            let predicted = self.recorder.linear_with(row, output)?;
            let rows = self.recorder.graph.shape(trend).rows().0;
            let trend = self.recorder.temporal(&format!("trend.{scale}.0"), trend, rows, true)?;
            let trend = self.recorder.temporal(&format!("trend.{scale}.1"), trend, 1, true)?;
            let trend = self.apply(crate::tape::ops::Linear, &[trend, channels])?;
            let predicted = self.apply(Add, &[predicted, trend])?;
            sum = Some(match sum {
                Some(sum) => self.apply(Add, &[sum, predicted])?,
                None => predicted,
            });
        }
        sum.ok_or_else(|| crate::tape::Error::Shape { operation: "timemixer", message: "no scale to predict from".into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    #[test]
    fn parameter_count() -> crate::nn::Result<()> {
        let network = Network::<f32>::new(TimeMixerConfig::default(), &OutputScale::unit(6), false)?;
        // The reference's 7 255 826 without the layer norms (64) and output maps (2144) that never receive a gradient.
        assert_eq!(network.graph().parameter_count(), 7_255_826 - 64 - 2_144);
        let rows = |name: &str| {
            let found = network.parameters().iter().find(|parameter| parameter.name == name);
            found.map(|parameter| parameter.shape.lengths().to_vec())
        };
        // The way of the seasonal parts and that of the trends: 1000, 500, 250, 125.
        for (scale, (fine, coarse)) in [(1000, 500), (500, 250), (250, 125)].into_iter().enumerate() {
            assert_eq!(rows(&format!("mixing.1.down.{scale}.0.weight")), Some(vec![coarse, fine]));
            assert_eq!(rows(&format!("mixing.1.up.{scale}.0.weight")), Some(vec![fine, coarse]));
        }
        assert_eq!(rows("trend.3.0.weight"), Some(vec![125, 125]));
        Ok(())
    }
}
