//! Layers: operations together with their named parameters and the rule by which these start.
//!
//! Initialisation is PyTorch 2.5's default for `Linear`, `Conv1d` and `LayerNorm` modules: weight and bias of a linear or
//! convolutional layer are uniform on ±1/√(fan in), where fan in counts the numbers that one output reads; a layer norm starts
//! at weight 1 and bias 0. The attention's query, key, value and output maps are four separate linear layers and follow the
//! linear rule (not the packed Xavier rule of `MultiheadAttention`).

use crate::error::Result;
use crate::tape::ops::{Conv1d, Epilogue, LayerNorm, Linear, Temporal};
use crate::tape::{Graph, Var};
use phyture_kernels::Real;
use phyture_kernels::random::Stream;

/// How one parameter tensor starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Init {
    /// Uniform on [−bound, bound).
    Uniform {
        /// Half the width of the interval.
        bound: f64,
    },
    /// One value everywhere.
    Constant(f64),
}

impl Init {
    /// ±1/√(fan in).
    fn fan_in(count: usize) -> Self {
        Self::Uniform { bound: 1.0 / (count as f64).sqrt() }
    }

    /// Starts one tensor; `stream` is its own.
    pub fn fill<T: Real>(self, stream: Stream, values: &mut [T]) {
        for (index, value) in values.iter_mut().enumerate() {
            *value = match self {
                Self::Uniform { bound } => T::of(bound * (2.0 * stream.uniform(index as u64) - 1.0)),
                Self::Constant(constant) => T::of(constant),
            };
        }
    }
}

/// Records layers on a graph and remembers how their parameters start.
pub struct Recorder<T> {
    /// The graph so far.
    pub graph: Graph<T>,
    /// One rule a parameter tensor, in the graph's order.
    pub inits: Vec<Init>,
}

impl<T: Real> Default for Recorder<T> {
    fn default() -> Self {
        Self { graph: Graph::new(), inits: Vec::new() }
    }
}

impl<T: Real> Recorder<T> {
    fn parameter(&mut self, name: &str, lengths: &[usize], init: Init) -> Result<Var> {
        let var = self.graph.parameter(name, lengths)?;
        self.inits.push(init);
        Ok(var)
    }

    /// `y[t] = W x[t] + b`, x `[n, in]` to y `[n, out]`: `name.weight` `[out, in]` and, if asked for, `name.bias` `[out]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn linear(&mut self, name: &str, x: Var, outputs: usize, bias: bool) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let init = Init::fan_in(inputs);
        let mut operands = vec![x, self.parameter(&format!("{name}.weight"), &[outputs, inputs], init)?];
        if bias {
            operands.push(self.parameter(&format!("{name}.bias"), &[outputs], init)?);
        }
        self.graph.apply(Linear, &operands)
    }

    /// y = W x + b along time, x `[n, C]` to y `[rows, C]`: `name.weight` `[rows, n]` and, if asked for, `name.bias` `[rows]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn temporal(&mut self, name: &str, x: Var, rows: usize, bias: bool) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().0;
        let init = Init::fan_in(inputs);
        let mut operands = vec![x, self.parameter(&format!("{name}.weight"), &[rows, inputs], init)?];
        if bias {
            operands.push(self.parameter(&format!("{name}.bias"), &[rows], init)?);
        }
        self.graph.apply(Temporal, &operands)
    }

    /// Layer norm over channels: `name.weight` and `name.bias` `[C]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn layer_norm(&mut self, name: &str, x: Var, eps: f64) -> Result<Var> {
        let channels = self.graph.shape(x).rows().1;
        let weight = self.parameter(&format!("{name}.weight"), &[channels], Init::Constant(1.0))?;
        let bias = self.parameter(&format!("{name}.bias"), &[channels], Init::Constant(0.0))?;
        self.graph.apply(LayerNorm { eps }, &[x, weight, bias])
    }

    /// Convolution along time with replicate padding, x [n, in] to y [n + padding − k + 1, out]: `name.weight` [out, in, k] and
    /// `name.bias` `[out]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn conv1d(
        &mut self,
        name: &str,
        x: Var,
        outputs: usize,
        kernel: usize,
        padding: (usize, usize),
        epilogue: Epilogue,
    ) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let init = Init::fan_in(inputs * kernel);
        let weight = self.graph.convolution_weight(&format!("{name}.weight"), [kernel, inputs, outputs])?;
        self.inits.push(init);
        let bias = self.parameter(&format!("{name}.bias"), &[outputs], init)?;
        self.graph.apply(Conv1d { padding, epilogue }, &[x, weight, bias])
    }
}
