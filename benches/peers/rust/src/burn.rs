//! Phy-Ture in burn, on its CPU backend Flex. Not a tuned program: layers are burn's own, and attention keeps its map in training, for
//! burn's fused attention has neither a backward pass nor dropout.

use crate::{AVERAGE, HEADS, KERNELS, LEAK, LEARNING_RATE, LEVELS, OUTPUTS, PAD, PHYSICS, Row, STACKS, STATES, WIDTH};
use burn::module::Module;
use burn::nn::conv::{Conv1d, Conv1dConfig};
use burn::nn::pool::{AvgPool1d, AvgPool1dConfig};
use burn::nn::{Dropout, DropoutConfig, LayerNorm, LayerNormConfig, Linear, LinearConfig};
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::ops::PadMode;
use burn::tensor::{Device, Distribution, Tensor, TensorData, activation, module, s};

#[derive(Module, Debug)]
struct Convolutions {
    conv1: Conv1d,
    conv2: Conv1d,
    dropout: Dropout,
}

impl Convolutions {
    fn new(dropout: f64, device: &Device) -> Self {
        let [conv1, conv2] = KERNELS.map(|kernel| Conv1dConfig::new(WIDTH, WIDTH, kernel).init(device));
        Self { conv1, conv2, dropout: DropoutConfig::new(dropout).init() }
    }

    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let x = activation::leaky_relu(self.conv1.forward(x.pad([(PAD, PAD)], PadMode::Edge)), LEAK);
        self.conv2.forward(self.dropout.forward(x)).tanh()
    }
}

#[derive(Module, Debug)]
struct Tree {
    phi: Convolutions,
    psi: Convolutions,
    rho: Convolutions,
    eta: Convolutions,
    /// The trees of the even and of the odd samples, or none.
    below: Vec<Tree>,
}

impl Tree {
    fn new(level: usize, dropout: f64, device: &Device) -> Self {
        let module = || Convolutions::new(dropout, device);
        let below = if level > 1 { 2 } else { 0 };
        Self {
            phi: module(),
            psi: module(),
            rho: module(),
            eta: module(),
            below: (0..below).map(|_| Tree::new(level - 1, dropout, device)).collect(),
        }
    }

    fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        let even = x.clone().slice(s![.., .., ..;2]);
        let odd = x.slice(s![.., .., 1..;2]);
        let (odd, even) = (odd.clone() * self.phi.forward(even.clone()).exp(), even * self.psi.forward(odd).exp());
        let (mut even, mut odd) = (even.clone() + self.eta.forward(odd.clone()), odd + self.rho.forward(even));
        if let [first, second] = self.below.as_slice() {
            (even, odd) = (first.forward(even), second.forward(odd));
        }
        Tensor::stack::<4>(vec![even, odd], 3).flatten(2, 3)
    }
}

#[derive(Module, Debug)]
struct PhyTure {
    state: Linear,
    physics: Linear,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
    norm: LayerNorm,
    trees: Vec<Tree>,
    average: AvgPool1d,
    trend: Linear,
    seasonal: Linear,
    head: Linear,
    dropout: Dropout,
}

impl PhyTure {
    fn new(row: &Row, device: &Device) -> Self {
        let layer = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        let dropout = row.dropout.unwrap_or(0.0).into();
        Self {
            state: layer(STATES, WIDTH),
            physics: layer(PHYSICS, WIDTH),
            query: layer(WIDTH, WIDTH),
            key: layer(WIDTH, WIDTH),
            value: layer(WIDTH, WIDTH),
            output: layer(WIDTH, WIDTH),
            norm: LayerNormConfig::new(WIDTH).init(device),
            trees: (0..STACKS).map(|_| Tree::new(LEVELS, dropout, device)).collect(),
            average: AvgPool1dConfig::new(AVERAGE).with_stride(1).init(),
            trend: layer(row.history, 1),
            seasonal: layer(row.history, 1),
            head: layer(WIDTH, OUTPUTS),
            dropout: DropoutConfig::new(dropout).init(),
        }
    }

    fn attend(&self, query: Tensor<4>, key: Tensor<4>, value: Tensor<4>) -> Tensor<4> {
        if !query.device().is_autodiff() {
            return module::attention(query, key, value, None, None, Default::default());
        }
        // The query is scaled instead of the scores: the same numbers, and one pass less over the map.
        let query = query / ((WIDTH / HEADS) as f64).sqrt();
        self.dropout.forward(activation::softmax(query.matmul(key.swap_dims(2, 3)), 3)).matmul(value)
    }

    fn forward(&self, state: Tensor<3>, physics: Tensor<3>, encoding: Tensor<3>) -> Tensor<3> {
        let [batch, rows, _] = state.dims();
        let heads = |x: Tensor<3>| x.reshape([batch, rows, HEADS, WIDTH / HEADS]).swap_dims(1, 2);
        let state = self.state.forward(state) + encoding.clone();
        let physics = self.physics.forward(physics) + encoding;
        let (key, value) = (heads(self.key.forward(physics.clone())), heads(self.value.forward(physics)));
        let mixed = self.attend(heads(self.query.forward(state.clone())), key, value).swap_dims(1, 2).flatten(2, 3);
        let mut x = self.norm.forward(self.output.forward(mixed) + state).swap_dims(1, 2);
        for tree in &self.trees {
            x = x.clone() + tree.forward(x);
        }
        let trend = self.average.forward(x.clone().pad([(AVERAGE / 2, AVERAGE / 2)], PadMode::Edge));
        let mixed = self.trend.forward(trend.clone()) + self.seasonal.forward(x - trend);
        self.head.forward(mixed.swap_dims(1, 2))
    }
}

pub fn run(row: &Row) -> Result<(Vec<f64>, usize), String> {
    let device = if row.dropout.is_some() { Device::flex().autodiff() } else { Device::flex() };
    let random = |rows, columns| Tensor::<3>::random([row.batch, rows, columns], Distribution::Uniform(-1.0, 1.0), &device);
    let (state, physics, target) = (random(row.history, STATES), random(row.history, PHYSICS), random(1, OUTPUTS));
    let encoding = Tensor::from_data(TensorData::new(row.encoding(), [1, row.history, WIDTH]), &device);
    let mut network = PhyTure::new(row, &device);
    let parameters = network.num_params();
    let mut adam = AdamConfig::new().with_epsilon(1e-8).init();
    let seconds = row.time(|| {
        let found = network.forward(state.clone(), physics.clone(), encoding.clone());
        if row.dropout.is_some() {
            let loss = (found - target.clone()).square().sum_dim(2).mean();
            let gradients = GradientsParams::from_grads(loss.backward(), &network);
            network = adam.step(LEARNING_RATE, network.clone(), gradients);
        }
        device.sync().map_err(|error| format!("{error:?}"))
    })?;
    Ok((seconds, parameters))
}
