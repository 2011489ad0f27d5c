//! Layers: operations together with their named parameters and the rule by which these start.
//!
//! Initialisation is PyTorch 2.5's default for `Linear`, `Conv1d` and `LayerNorm` modules: weight and bias of a linear or
//! convolutional layer are uniform on ±1/√(fan in), where fan in counts the numbers that one output reads; a layer norm starts
//! at weight 1 and bias 0. The attention's query, key, value and output maps are four separate linear layers and follow the
//! linear rule (not the packed Xavier rule of `MultiheadAttention`).

use crate::tape::ops::{BatchNorm, Conv1d, Epilogue, GeneralConv1d, LayerNorm, Linear, Lstm, Temporal, TemporalEach, WeightNorm};
use crate::tape::{Graph, Result, Var};
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
    /// Normal around 0.
    Normal {
        /// Standard deviation.
        deviation: f64,
    },
    /// One value everywhere.
    Constant(f64),
    /// Element o is the Euclidean length of row o of the tensor recorded before this one.
    RowLengths,
}

impl Init {
    /// ±1/√(fan in).
    pub(crate) fn fan_in(count: usize) -> Self {
        Self::Uniform { bound: 1.0 / (count as f64).sqrt() }
    }

    /// Starts one tensor; `stream` is its own, `before` the tensor recorded before it, already started.
    pub fn fill<T: Real>(self, stream: Stream, before: &[T], values: &mut [T]) {
        let each = before.len() / values.len().max(1);
        for (index, value) in values.iter_mut().enumerate() {
            let uniform = |draw: usize| stream.uniform((2 * index + draw) as u64);
            *value = match self {
                Self::Uniform { bound } => T::of(bound * (2.0 * stream.uniform(index as u64) - 1.0)),
                // Box & Muller 1958; 1 − u is never 0.
                Self::Normal { deviation } => {
                    T::of(deviation * (-2.0 * (1.0 - uniform(0)).ln()).sqrt() * (std::f64::consts::TAU * uniform(1)).cos())
                }
                Self::Constant(constant) => T::of(constant),
                Self::RowLengths => {
                    let row = before.get(index * each..(index + 1) * each).unwrap_or_default();
                    T::of(row.iter().map(|value| value.f64() * value.f64()).sum::<f64>().sqrt())
                }
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
    /// A tensor and the rule by which it starts.
    ///
    /// # Errors
    /// As [`Graph::parameter`].
    pub fn parameter(&mut self, name: &str, lengths: &[usize], init: Init) -> Result<Var> {
        let var = self.graph.parameter(name, lengths)?;
        self.inits.push(init);
        Ok(var)
    }

    /// `y[t] = W x[t] + b`, x `[n, in]` to y `[n, out]`: `name.weight` `[out, in]` and, if asked for, `name.bias` `[out]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn linear(&mut self, name: &str, x: Var, outputs: usize, bias: bool) -> Result<Var> {
        self.linear_from(name, x, outputs, bias, Init::fan_in(self.graph.shape(x).rows().1))
    }

    /// As [`Recorder::linear`], with another start of the weight.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn linear_from(&mut self, name: &str, x: Var, outputs: usize, bias: bool, init: Init) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let mut operands = vec![x, self.parameter(&format!("{name}.weight"), &[outputs, inputs], init)?];
        if bias {
            operands.push(self.parameter(&format!("{name}.bias"), &[outputs], Init::fan_in(inputs))?);
        }
        self.graph.apply(Linear, &operands)
    }

    /// Weight `[out, in]` and bias `[out]` of a linear map that is used in several places.
    ///
    /// # Errors
    /// As [`Graph::parameter`].
    pub fn linear_weights(&mut self, name: &str, inputs: usize, outputs: usize) -> Result<[Var; 2]> {
        let init = Init::fan_in(inputs);
        let weight = self.parameter(&format!("{name}.weight"), &[outputs, inputs], init)?;
        Ok([weight, self.parameter(&format!("{name}.bias"), &[outputs], init)?])
    }

    /// y = W x + b with these weights.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn linear_with(&mut self, x: Var, [weight, bias]: [Var; 2]) -> Result<Var> {
        self.graph.apply(Linear, &[x, weight, bias])
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

    /// Convolution along time of any place, stride and dilation: `name.weight` [out, in, k] and `name.bias` `[out]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn convolution(&mut self, name: &str, x: Var, outputs: usize, kernel: usize, op: GeneralConv1d) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        self.convolution_from(name, x, outputs, kernel, op, Init::fan_in(inputs * kernel))
    }

    /// As [`Recorder::convolution`], with another start of the weight.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn convolution_from(
        &mut self,
        name: &str,
        x: Var,
        outputs: usize,
        kernel: usize,
        op: GeneralConv1d,
        init: Init,
    ) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let weight = self.parameter(&format!("{name}.weight"), &[outputs, inputs, kernel], init)?;
        let bias = self.parameter(&format!("{name}.bias"), &[outputs], Init::fan_in(inputs * kernel))?;
        self.graph.apply(op, &[x, weight, bias])
    }

    /// As [`Recorder::convolution`], with weight norm: `name.direction` [out, in, k], `name.length` [out, 1, 1], `name.bias`
    /// `[out]`. The lengths start as those of the directions, so that the weight starts as that of a plain convolution.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn weight_normed(&mut self, name: &str, x: Var, outputs: usize, kernel: usize, op: GeneralConv1d) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let init = Init::fan_in(inputs * kernel);
        let direction = self.parameter(&format!("{name}.direction"), &[outputs, inputs, kernel], init)?;
        let length = self.parameter(&format!("{name}.length"), &[outputs, 1, 1], Init::RowLengths)?;
        let bias = self.parameter(&format!("{name}.bias"), &[outputs], init)?;
        let weight = self.graph.apply(WeightNorm, &[direction, length])?;
        self.graph.apply(op, &[x, weight, bias])
    }

    /// Hidden states of a long short-term memory, x [n, in] to y [n, hidden]: `name.input.weight` [4·hidden, in],
    /// `name.recurrent.weight` [4·hidden, hidden], `name.input.bias` and `name.recurrent.bias` [4·hidden], gate order input, forget,
    /// candidate, output. All start uniform on ±1/√hidden.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn lstm(&mut self, name: &str, x: Var, hidden: usize) -> Result<Var> {
        let inputs = self.graph.shape(x).rows().1;
        let init = Init::fan_in(hidden);
        let input = self.parameter(&format!("{name}.input.weight"), &[4 * hidden, inputs], init)?;
        let recurrent = self.parameter(&format!("{name}.recurrent.weight"), &[4 * hidden, hidden], init)?;
        let input_bias = self.parameter(&format!("{name}.input.bias"), &[4 * hidden], init)?;
        let recurrent_bias = self.parameter(&format!("{name}.recurrent.bias"), &[4 * hidden], init)?;
        self.graph.apply(Lstm, &[x, input, recurrent, input_bias, recurrent_bias])
    }

    /// One row from a sequence, each channel with weights of its own: `name.weight` [C, n] and `name.bias` `[C]`.
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn temporal_each(&mut self, name: &str, x: Var) -> Result<Var> {
        let (rows, channels) = self.graph.shape(x).rows();
        let init = Init::fan_in(rows);
        let weight = self.parameter(&format!("{name}.weight"), &[channels, rows], init)?;
        let bias = self.parameter(&format!("{name}.bias"), &[channels], init)?;
        self.graph.apply(TemporalEach, &[x, weight, bias])
    }

    /// Batch normalisation over all rows of a step: `name.weight` and `name.bias` `[C]`, and `name.running_mean` and
    /// `name.running_variance` `[C]`, which are not trained but kept by [`Session::settle`](crate::tape::Session::settle).
    ///
    /// # Errors
    /// As [`Graph::apply`].
    pub fn batch_norm(&mut self, name: &str, x: Var, op: BatchNorm) -> Result<Var> {
        let channels = self.graph.shape(x).rows().1;
        let mut operands = vec![x];
        for (part, start) in [("weight", 1.0), ("bias", 0.0), ("running_mean", 0.0), ("running_variance", 1.0)] {
            operands.push(self.parameter(&format!("{name}.{part}"), &[channels], Init::Constant(start))?);
        }
        self.graph.apply(op, &operands)
    }
}
