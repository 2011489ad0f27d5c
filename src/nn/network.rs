//! A recorded network: an architecture on its inputs, its output in physical units, and its loss.
//!
//! Inputs of one sample, in this order whatever the architecture: S `[H, 16]` and P `[H, 6]`, both normalised per channel, and
//! the target `[P, 6]` in m/s² and rad/s². Output: `[P, 6]` in the same units. Training, normalisation and the physical baseline
//! itself are elsewhere.

use super::architecture::Architecture;
use super::layers::{Init, Recorder};
use crate::nn::error::{Error, Result};
use crate::tape::ops::{Affine, SquaredError};
use crate::tape::{Graph, Parameter, Var};
use phyture_kernels::Real;
use phyture_kernels::random::Stream;

/// Fixed affine map from the network's unit scale to physical units, one number a channel: r̂ = scale ∘ net(·) + offset.
///
/// Scale and offset are the standard deviation and the mean of the training residual (of the training target for variants that
/// predict the acceleration itself). The loss stays in physical units (eq. 13).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct OutputScale {
    /// σ, m/s² for the first three channels, rad/s² for the others.
    pub scale: Vec<f64>,
    /// μ, in the same units.
    pub offset: Vec<f64>,
}

impl OutputScale {
    /// The identity.
    pub fn unit(outputs: usize) -> Self {
        Self { scale: vec![1.0; outputs], offset: vec![0.0; outputs] }
    }
}

/// How the loss of one sample is formed, and whether S and P get gradients.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LossRule {
    /// Factor before the sum of squares.
    pub scale: f64,
    /// Divide errors by the output scale first.
    pub standardise: bool,
    /// Gradients of S and P.
    pub input_gradients: bool,
}

/// Most parameters of a network: a hostile file cannot ask for a slab that exhausts the machine.
const MOST_PARAMETERS: usize = 1 << 28;

/// A network, recorded.
pub struct Network<T> {
    architecture: Architecture,
    graph: Graph<T>,
    inits: Vec<Init>,
    output: Var,
    target: Var,
    loss: Var,
}

impl<T: Real> Network<T> {
    /// Records the network of a configuration. The loss of one sample is the squared 2-norm over the channels, averaged over the
    /// rows predicted; a session's mean over samples is then eq. 13.
    ///
    /// # Errors
    /// [`Error::Size`] if the configuration or the length of the output scale is wrong.
    ///
    /// With `standardise`, the errors of each channel are divided by its output scale first, so that channels of small and of
    /// large magnitude count alike.
    pub fn new(architecture: impl Into<Architecture>, output: &OutputScale, standardise: bool) -> Result<Self> {
        let architecture = architecture.into();
        let loss = LossRule { scale: 1.0 / architecture.horizon().max(1) as f64, standardise, input_gradients: false };
        Self::record(architecture, output, loss)
    }

    /// As [`Network::new`], with the factor before the sum of squares free, and gradients of S and P if asked for.
    pub(crate) fn record(architecture: impl Into<Architecture>, scale: &OutputScale, rule: LossRule) -> Result<Self> {
        let architecture = architecture.into();
        architecture.check()?;
        let (history, outputs) = (architecture.history(), architecture.outputs());
        if scale.scale.len() != outputs || scale.offset.len() != outputs {
            return Err(Error::Size {
                field: "output scale".into(),
                found: format!("{} scales and {} offsets", scale.scale.len(), scale.offset.len()),
                expected: format!("{outputs} of each, one an output channel"),
            });
        }
        let mut recorder = Recorder::<T>::default();
        let mut input = |name: &str, lengths: &[usize]| match rule.input_gradients {
            true => recorder.graph.input_with_gradient(name, lengths),
            false => recorder.graph.input(name, lengths),
        };
        let state = input("state", &[history, architecture.state_channels()])?;
        let physics = input("physics", &[history, architecture.physics_channels()])?;
        let target = recorder.graph.input("target", &[architecture.horizon(), outputs])?;
        let predicted = architecture.record(&mut recorder, state, physics)?;
        let Recorder { mut graph, inits } = recorder;
        if graph.parameter_count() > MOST_PARAMETERS {
            return Err(Error::Size {
                field: "sizes".into(),
                found: format!("{} parameters", graph.parameter_count()),
                expected: format!("at most {MOST_PARAMETERS}; make the network smaller"),
            });
        }
        let output = graph.apply(Affine { scale: scale.scale.clone(), offset: scale.offset.clone() }, &[predicted])?;
        let (mut judged, mut wanted) = (output, target);
        if rule.standardise {
            let unit = Affine { scale: scale.scale.iter().map(|scale| 1.0 / scale).collect(), offset: vec![0.0; outputs] };
            judged = graph.apply(unit.clone(), &[output])?;
            wanted = graph.apply(unit, &[target])?;
        }
        let loss = graph.apply(SquaredError { scale: rule.scale }, &[judged, wanted])?;
        Ok(Self { architecture, graph, inits, output, target, loss })
    }

    /// The architecture it was recorded from.
    pub const fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// The graph, for a [`Session`](crate::tape::Session).
    pub const fn graph(&self) -> &Graph<T> {
        &self.graph
    }

    /// Predicted `[P, outputs]`, in physical units.
    pub const fn output(&self) -> Var {
        self.output
    }

    /// What the output is held against, `[P, outputs]`.
    pub(crate) const fn target(&self) -> Var {
        self.target
    }

    /// Loss of one sample.
    pub const fn loss(&self) -> Var {
        self.loss
    }

    /// Parameter tensors, in the order of the flat slab.
    pub fn parameters(&self) -> &[Parameter] {
        self.graph.parameters()
    }

    /// Initial parameters: the same for the same seed, whatever the precision (up to rounding) and the machine.
    pub fn initial(&self, seed: u64) -> Vec<T> {
        let mut slab = vec![T::ZERO; self.graph.parameter_count()];
        for (index, (parameter, init)) in self.graph.parameters().iter().zip(&self.inits).enumerate() {
            let before = index.checked_sub(1).map_or(0..0, |before| self.graph.parameters()[before].range());
            // Drawn in the order of files, so that a seed's start does not depend on how a tensor lies in memory.
            let mut values = vec![T::ZERO; parameter.shape.len()];
            init.fill(Stream::new(seed, 0, index as u64, 0), &slab[before], &mut values);
            parameter.put_file_order(&values, &mut slab);
        }
        slab
    }
}
