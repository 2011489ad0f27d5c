//! Phy-Ture as a recorded graph: physics-augmented fusion (PAF), multiscale feature enhancement (MSTFE), series decomposition and
//! prediction (TSDP); paper eqs. 17–32. And its ablations and fusion variants, which leave out or replace one part.
//!
//! Sizes are in `config`; inputs, output scale and loss in `network`.

use super::config::{PhyTureConfig, Variant};
use super::configuration::Configuration;
use super::layers::Recorder;
use crate::tape::ops::{
    Add, Attention, Concatenate, Epilogue, Half, Interleave, LastRows, MovingAverage, PositionalEncoding, ScaleExp, Subtract,
};
use crate::tape::{Result, Var};
use phyture_kernels::Real;

impl Configuration for PhyTureConfig {
    fn name(&self) -> &'static str {
        self.variant.name()
    }

    fn history(&self) -> usize {
        self.history
    }

    fn state_channels(&self) -> usize {
        self.state_channels
    }

    fn physics_channels(&self) -> usize {
        self.physics_channels
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn horizon(&self) -> usize {
        self.horizon
    }

    fn predicts_residual(&self) -> bool {
        self.variant.predicts_residual()
    }

    fn reads_physics(&self) -> bool {
        self.variant.reads_physics()
    }

    fn is_random(&self) -> bool {
        self.dropout > 0.0
    }

    fn check(&self) -> crate::nn::Result<()> {
        self.check()
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, physics: Var) -> Result<Var> {
        let mut builder = Builder { recorder, config: self };
        let fused = builder.front(state, physics)?;
        let enhanced = if self.variant == Variant::WithoutMstfe { fused } else { builder.trees(fused)? };
        builder.head(enhanced)
    }
}

struct Builder<'a, T> {
    recorder: &'a mut Recorder<T>,
    config: &'a PhyTureConfig,
}

impl<T: Real> Builder<'_, T> {
    fn apply(&mut self, op: impl crate::tape::op::Op<T> + 'static, operands: &[Var]) -> Result<Var> {
        self.recorder.graph.apply(op, operands)
    }

    /// x W + PE (eqs. 17–20).
    fn embed(&mut self, name: &str, x: Var) -> Result<Var> {
        let embedded = self.recorder.linear(name, x, self.config.d_model, self.config.biases)?;
        self.apply(PositionalEncoding::new(self.config.history, self.config.d_model), &[embedded])
    }

    /// The fused sequence Ŝ (eqs. 17–24), or what the variant has in its place.
    fn front(&mut self, state: Var, physics: Var) -> Result<Var> {
        let config = self.config;
        match config.variant {
            Variant::WithoutPaf | Variant::StateControlOnly => self.embed("paf.state", state),
            Variant::DirectConcatenation => {
                let both = self.apply(Concatenate, &[state, physics])?;
                self.embed("paf.both", both)
            }
            _ => {
                let state = self.embed("paf.state", state)?;
                let physics = self.embed("paf.physics", physics)?;
                let query = self.recorder.linear("paf.query", state, config.d_model, config.biases)?;
                let key = self.recorder.linear("paf.key", physics, config.d_model, config.biases)?;
                let value = self.recorder.linear("paf.value", physics, config.d_model, config.biases)?;
                let heads = self.apply(Attention { heads: config.heads, dropout: config.dropout }, &[query, key, value])?;
                let mixed = self.recorder.linear("paf.output", heads, config.d_model, config.biases)?;
                let sum = self.apply(Add, &[mixed, state])?;
                self.recorder.layer_norm("paf.norm", sum, config.norm_eps)
            }
        }
    }

    /// Trees one after another, each added to its input.
    fn trees(&mut self, mut x: Var) -> Result<Var> {
        for stack in 0..self.config.stacks {
            let tree = self.tree(&format!("mstfe.{stack}"), "", x)?;
            x = self.apply(Add, &[x, tree])?;
        }
        Ok(x)
    }

    /// One node and all below it. `path` is the way from the root: `e` for an even child, `o` for an odd one.
    fn tree(&mut self, prefix: &str, path: &str, x: Var) -> Result<Var> {
        let name = format!("{prefix}.{}", if path.is_empty() { "root" } else { path });
        let (mut even, mut odd) = self.block(&name, x)?;
        if path.len() + 1 < self.config.levels {
            even = self.tree(prefix, &format!("{path}e"), even)?;
            odd = self.tree(prefix, &format!("{path}o"), odd)?;
        }
        self.apply(Interleave, &[even, odd])
    }

    /// One interaction of the even and the odd half (eqs. 25–28, with the printed plus signs).
    fn block(&mut self, name: &str, x: Var) -> Result<(Var, Var)> {
        let even = self.apply(Half::Even, &[x])?;
        let odd = self.apply(Half::Odd, &[x])?;
        let phi = self.module(&format!("{name}.phi"), even)?;
        let psi = self.module(&format!("{name}.psi"), odd)?;
        let odd = self.apply(ScaleExp, &[odd, phi])?;
        let even = self.apply(ScaleExp, &[even, psi])?;
        let rho = self.module(&format!("{name}.rho"), even)?;
        let eta = self.module(&format!("{name}.eta"), odd)?;
        Ok((self.apply(Add, &[even, eta])?, self.apply(Add, &[odd, rho])?))
    }

    /// Replicate padding, convolution, leaky rectifier, dropout, convolution, tanh; as long as its input.
    fn module(&mut self, name: &str, x: Var) -> Result<Var> {
        let config = self.config;
        // One padding for both convolutions: the second has none of its own.
        let padding = config.kernel1 + config.kernel2 - 2;
        let padding = (padding / 2, padding - padding / 2);
        let first = Epilogue::Leaky { leak: config.leak, dropout: config.dropout };
        let inner = self.recorder.conv1d(&format!("{name}.conv1"), x, config.hidden_channels(), config.kernel1, padding, first)?;
        self.recorder.conv1d(&format!("{name}.conv2"), inner, config.d_model, config.kernel2, (0, 0), Epilogue::Tanh)
    }

    /// Trend and seasonal part, projected along time, summed, projected to the outputs (eqs. 29–32); or one temporal map, or the
    /// last rows, in their place.
    fn head(&mut self, x: Var) -> Result<Var> {
        let config = self.config;
        let rows = match config.variant {
            Variant::WithoutTsdpTemporalLinear => self.recorder.temporal("tsdp.linear", x, config.horizon, config.biases)?,
            Variant::WithoutTsdpLastRow => self.apply(LastRows { count: config.horizon }, &[x])?,
            _ => {
                let trend = self.apply(MovingAverage { width: config.moving_average }, &[x])?;
                let seasonal = self.apply(Subtract, &[x, trend])?;
                let trend = self.recorder.temporal("tsdp.trend", trend, config.horizon, config.biases)?;
                let seasonal = self.recorder.temporal("tsdp.seasonal", seasonal, config.horizon, config.biases)?;
                self.apply(Add, &[trend, seasonal])?
            }
        };
        self.recorder.linear("tsdp.output", rows, config.outputs, config.biases)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};

    fn count(config: PhyTureConfig) -> crate::nn::Result<usize> {
        Ok(Network::<f32>::new(&config, &OutputScale::unit(6), false)?.graph().parameter_count())
    }

    #[test]
    fn parameter_counts_are_those_of_the_architecture() -> crate::nn::Result<()> {
        let base = PhyTureConfig::default;
        // Fusion 18 304, two trees of seven blocks of four modules 1 842 176, decomposition 2392.
        assert_eq!(count(base())?, 1_862_872);
        assert_eq!(count(PhyTureConfig { biases: false, ..base() })?, 1_862_480);
        // SCINet's own tree: 921 088 parameters; half or twice the hidden channels.
        assert_eq!(count(base())? - count(PhyTureConfig { stacks: 1, ..base() })?, 921_088);
        let others = 1_862_872 - 1_842_176;
        assert_eq!(count(PhyTureConfig { hidden: 0.5, ..base() })?, others + 922_880);
        assert_eq!(count(PhyTureConfig { hidden: 2.0, ..base() })?, others + 3_680_768);
        assert_eq!(count(PhyTureConfig { variant: Variant::WithoutMstfe, ..base() })?, others);
        Ok(())
    }

    #[test]
    fn initial_parameters_follow_their_bounds_and_their_seed() -> crate::nn::Result<()> {
        let config = PhyTureConfig { history: 16, moving_average: 5, ..PhyTureConfig::default() };
        let network = Network::<f64>::new(&config, &OutputScale::unit(6), false)?;
        let (first, again, other) = (network.initial(1), network.initial(1), network.initial(2));
        assert_eq!(first, again);
        for parameter in network.parameters() {
            let values = &first[parameter.range()];
            let bound = match parameter.name.as_str() {
                "paf.norm.weight" => 1.0,
                "paf.norm.bias" => 0.0,
                "paf.physics.weight" | "paf.physics.bias" => 1.0 / 6_f64.sqrt(),
                name if name.contains("conv1") => 1.0 / 320_f64.sqrt(),
                _ => continue,
            };
            assert!(values.iter().all(|value| value.abs() <= bound), "{}", parameter.name);
            if values.len() > 1000 {
                // Uniform on ±bound: the root mean square is bound/√3, here with at least 20 000 draws, so within 2 %.
                let rms = (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt();
                assert!((rms * 3_f64.sqrt() / bound - 1.0).abs() < 0.02, "{}: {rms}", parameter.name);
                assert_ne!(values, &other[parameter.range()], "{}: two seeds, one start", parameter.name);
            }
        }
        Ok(())
    }
}
