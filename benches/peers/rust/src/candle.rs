//! Phy-Ture in candle, on its own CPU kernels. Not a faithful training program: up to 0.11.1 candle's gradient of a convolution's
//! kernel is wrong for a batch of more than one (candle PR 3836). It is computed with as much work, so times are not affected.
//!
//! Only what candle can differentiate is used in training: its fused softmax and layer norm have no backward pass, and neither has its
//! average pooling at a stride of one.

use crate::{AVERAGE, HEADS, KERNELS, LEAK, LEARNING_RATE, LEVELS, OUTPUTS, PAD, PHYSICS, Row, STACKS, STATES, WIDTH};
use candle_core::{D, DType, Device, Error, Module as _, Result, Tensor};
use candle_nn::{AdamW, Conv1d, LayerNorm, Linear, Optimizer, ParamsAdamW, VarBuilder, VarMap, conv1d, linear, ops};

fn drop(x: Tensor, dropout: Option<f32>) -> Result<Tensor> {
    match dropout {
        Some(rate) if rate > 0.0 => ops::dropout(&x, rate),
        _ => Ok(x),
    }
}

struct Module {
    conv1: Conv1d,
    conv2: Conv1d,
    dropout: Option<f32>,
}

impl Module {
    fn new(dropout: Option<f32>, from: VarBuilder) -> Result<Self> {
        let conv = |name, kernel| conv1d(WIDTH, WIDTH, kernel, Default::default(), from.pp(name));
        Ok(Self { conv1: conv("conv1", KERNELS[0])?, conv2: conv("conv2", KERNELS[1])?, dropout })
    }

    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let x = self.conv1.forward(&x.pad_with_same(2, PAD, PAD)?)?;
        self.conv2.forward(&drop(ops::leaky_relu(&x, LEAK)?, self.dropout)?)?.tanh()
    }
}

struct Tree {
    /// Phi, psi, rho and eta.
    modules: [Module; 4],
    /// The trees of the even and of the odd samples.
    below: Option<Box<[Tree; 2]>>,
}

impl Tree {
    fn new(level: usize, dropout: Option<f32>, from: VarBuilder) -> Result<Self> {
        let module = |name| Module::new(dropout, from.pp(name));
        let below = |name| Tree::new(level - 1, dropout, from.pp(name));
        Ok(Self {
            modules: [module("phi")?, module("psi")?, module("rho")?, module("eta")?],
            below: if level > 1 { Some(Box::new([below("even")?, below("odd")?])) } else { None },
        })
    }

    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let [phi, psi, rho, eta] = &self.modules;
        let (batch, channels, rows) = x.dims3()?;
        let pairs = x.reshape((batch, channels, rows / 2, 2))?;
        let half = |at| pairs.narrow(3, at, 1)?.squeeze(3)?.contiguous();
        let (even, odd) = (half(0)?, half(1)?);
        let (odd, even) = ((&odd * phi.forward(&even)?.exp()?)?, (&even * psi.forward(&odd)?.exp()?)?);
        let (mut even, mut odd) = ((&even + eta.forward(&odd)?)?, (&odd + rho.forward(&even)?)?);
        if let Some([first, second]) = self.below.as_deref() {
            (even, odd) = (first.forward(&even)?, second.forward(&odd)?);
        }
        Tensor::stack(&[even, odd], 3)?.flatten_from(2)
    }
}

struct PhyTure {
    state: Linear,
    physics: Linear,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
    norm: LayerNorm,
    trees: Vec<Tree>,
    trend: Linear,
    seasonal: Linear,
    head: Linear,
    encoding: Tensor,
    dropout: Option<f32>,
}

impl PhyTure {
    fn new(row: &Row, from: VarBuilder) -> Result<Self> {
        let layer = |name, inputs, outputs| linear(inputs, outputs, from.pp(name));
        let tree = |index: usize| Tree::new(LEVELS, row.dropout, from.pp(format!("tree{index}")));
        Ok(Self {
            state: layer("state", STATES, WIDTH)?,
            physics: layer("physics", PHYSICS, WIDTH)?,
            query: layer("query", WIDTH, WIDTH)?,
            key: layer("key", WIDTH, WIDTH)?,
            value: layer("value", WIDTH, WIDTH)?,
            output: layer("output", WIDTH, WIDTH)?,
            norm: candle_nn::layer_norm(WIDTH, 1e-5, from.pp("norm"))?,
            trees: (0..STACKS).map(tree).collect::<Result<_>>()?,
            trend: layer("trend", row.history, 1)?,
            seasonal: layer("seasonal", row.history, 1)?,
            head: layer("head", WIDTH, OUTPUTS)?,
            encoding: Tensor::from_vec(row.encoding(), (row.history, WIDTH), &Device::Cpu)?,
            dropout: row.dropout,
        })
    }

    fn forward(&self, state: &Tensor, physics: &Tensor) -> Result<Tensor> {
        let (batch, rows, _) = state.dims3()?;
        let heads = |x: Tensor| x.reshape((batch, rows, HEADS, WIDTH / HEADS))?.transpose(1, 2)?.contiguous();
        let state = self.state.forward(state)?.broadcast_add(&self.encoding)?;
        let physics = self.physics.forward(physics)?.broadcast_add(&self.encoding)?;
        // The query is scaled instead of the scores: the same numbers, and one pass less over the map.
        let query = heads((self.query.forward(&state)? / ((WIDTH / HEADS) as f64).sqrt())?)?;
        let (key, value) = (heads(self.key.forward(&physics)?)?, heads(self.value.forward(&physics)?)?);
        let scores = query.matmul(&key.t()?)?;
        let scores = match self.dropout {
            Some(_) => drop(ops::softmax(&scores, D::Minus1)?, self.dropout)?,
            None => ops::softmax_last_dim(&scores)?,
        };
        let mixed = scores.matmul(&value)?.transpose(1, 2)?.flatten_from(2)?;
        let sum = (self.output.forward(&mixed)? + state)?;
        let sum = match (self.dropout, self.norm.bias()) {
            (Some(_), Some(bias)) => ops::layer_norm_slow(&sum, self.norm.weight(), bias, self.norm.eps() as f32)?,
            _ => self.norm.forward(&sum)?,
        };
        let mut x = sum.transpose(1, 2)?.contiguous()?;
        for tree in &self.trees {
            x = (&x + tree.forward(&x)?)?;
        }
        let trend = average(&x)?;
        let mixed = (self.trend.forward(&trend)? + self.seasonal.forward(&(x - trend)?)?)?;
        self.head.forward(&mixed.transpose(1, 2)?.contiguous()?)
    }
}

/// The moving average, by sums of 2, 4, 8 and 16 samples: candle's pooling has no gradient here.
fn average(x: &Tensor) -> Result<Tensor> {
    const { assert!(AVERAGE == 16 + 8 + 1) };
    let rows = x.dim(2)?;
    let one = x.pad_with_same(2, AVERAGE / 2, AVERAGE / 2)?;
    let double = |x: &Tensor, width: usize| {
        let rows = x.dim(2)? - width;
        x.narrow(2, 0, rows)? + x.narrow(2, width, rows)?
    };
    let eight = double(&double(&double(&one, 1)?, 2)?, 4)?;
    let sum = ((double(&eight, 8)?.narrow(2, 0, rows)? + eight.narrow(2, 16, rows)?)? + one.narrow(2, 24, rows)?)?;
    sum / AVERAGE as f64
}

pub fn run(row: &Row) -> Result<(Vec<f64>, usize)> {
    let device = Device::Cpu;
    let weights = VarMap::new();
    let mut network = PhyTure::new(row, VarBuilder::from_varmap(&weights, DType::F32, &device))?;
    let variables = weights.all_vars();
    let parameters = variables.iter().map(|variable| variable.elem_count()).sum();
    let random = |rows, columns| Tensor::rand(-1f32, 1f32, (row.batch, rows, columns), &device);
    let (state, physics, target) = (random(row.history, STATES)?, random(row.history, PHYSICS)?, random(1, OUTPUTS)?);
    if row.dropout.is_none() {
        // Weights that are no variables: otherwise candle keeps every intermediate result for a backward pass.
        let named = weights.data().lock().map_err(|error| Error::msg(error.to_string()))?;
        let constants = named.iter().map(|(name, value)| (name.clone(), value.detach())).collect();
        network = PhyTure::new(row, VarBuilder::from_tensors(constants, DType::F32, &device))?;
    }
    let mut adam = AdamW::new(variables, ParamsAdamW { lr: LEARNING_RATE, weight_decay: 0.0, ..ParamsAdamW::default() })?;
    let seconds = row.time(|| {
        let found = network.forward(&state, &physics)?;
        if row.dropout.is_some() {
            let loss = (found - &target)?.sqr()?.sum(2)?.mean_all()?;
            adam.step(&loss.backward()?)?;
        }
        Result::Ok(())
    })?;
    Ok((seconds, parameters))
}
