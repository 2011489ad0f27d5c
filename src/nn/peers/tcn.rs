//! TCN: dilated causal convolutions with weight norm in residual blocks (Bai, Kolter & Koltun 2018, and their code).
//!
//! Block i: twice (convolution of dilation 2^i with weight norm, rectifier, dropout), plus its input (through a plain 1×1
//! convolution where the widths differ), then a rectifier. The last row goes to a linear map.
//!
//! Only the last row is wanted, and it depends on few rows: of block i's input it reads every 2^i-th row from the end. So block i
//! keeps these rows alone, its dilation becomes 1, its second convolution takes every second row, and its result is the next
//! block's input. This is exact, and at H = 1000 computes 2988 rows instead of 16 000. Dropout then falls on other elements than in
//! the whole network, by the same law.
//!
//! Initial values as they come out in the reference: its normal start of the convolutions is undone by weight norm, which
//! leaves PyTorch's default; 1×1 convolutions and the output weight do start normal with deviation 0.01.

use super::common_fields;
use crate::nn::configuration::{ACCELERATIONS, Configuration, LARGEST_HISTORY, LARGEST_KERNEL, LARGEST_WIDTH, check_ranges};
use crate::nn::layers::{Init, Recorder};
use crate::tape::ops::{Activation, Add, GeneralConv1d, LastRows, Place, SpacedRows};
use crate::tape::{Result, Var};
use phyture_kernels::Real;
use phyture_kernels::activation::Activation as Kind;
use serde::{Deserialize, Serialize};

/// Most blocks: the dilation of the last is 2^15.
const MOST_LEVELS: usize = 16;

/// Start of 1×1 convolutions and of the output weight.
const PLAIN: Init = Init::Normal { deviation: 0.01 };

/// Sizes of the TCN.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TcnConfig {
    /// H, samples of the history: 1000.
    pub history: usize,
    /// Channels of S: 16.
    pub state_channels: usize,
    /// Channels of every block: 30, the reference's for its adding problem.
    pub channels: usize,
    /// Kernel: 7.
    pub kernel: usize,
    /// Blocks: 8. The receptive field is 1 + 2·(kernel − 1)·(2^levels − 1) = 3061 rows.
    pub levels: usize,
    /// Dropout after each rectifier inside a block: 0.2.
    pub dropout: f64,
}

impl Default for TcnConfig {
    fn default() -> Self {
        Self { history: 1000, state_channels: 16, channels: 30, kernel: 7, levels: 8, dropout: 0.2 }
    }
}

/// Which rows are computed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    /// Those that the last row depends on.
    Pruned,
    /// All, as the reference does.
    #[cfg(test)]
    Whole,
}

impl TcnConfig {
    fn record_as<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, extent: Extent) -> Result<Var> {
        let mut x = state;
        for level in 0..self.levels {
            let (n, inputs) = recorder.graph.shape(x).rows();
            // Rows of the first convolution, rows of the block, rows from one of these to the next, dilation.
            let (inner, rows, stride, dilation) = match extent {
                Extent::Pruned if level + 1 < self.levels => (n, n.div_ceil(2), 2, 1),
                Extent::Pruned => (n.min(self.kernel), 1, 1, 1),
                #[cfg(test)]
                Extent::Whole => (n, n, 1, 1 << level),
            };
            let op = |rows, stride| GeneralConv1d {
                stride,
                dilation,
                place: Place::Causal { rows },
                activation: Kind::Relu,
                dropout: self.dropout,
            };
            let name = |part: &str| format!("block.{level}.{part}");
            let first = recorder.weight_normed(&name("convolution1"), x, self.channels, self.kernel, op(inner, 1))?;
            let second = recorder.weight_normed(&name("convolution2"), first, self.channels, self.kernel, op(rows, stride))?;
            let mut past = recorder.graph.apply(SpacedRows { stride, count: rows }, &[x])?;
            if inputs != self.channels {
                past = recorder.convolution_from(&name("residual"), past, self.channels, 1, GeneralConv1d::padded(0), PLAIN)?;
            }
            let sum = recorder.graph.apply(Add, &[second, past])?;
            x = recorder.graph.apply(Activation { kind: Kind::Relu }, &[sum])?;
        }
        let last = recorder.graph.apply(LastRows { count: 1 }, &[x])?;
        recorder.linear_from("output", last, ACCELERATIONS, true, PLAIN)
    }
}

impl Configuration for TcnConfig {
    common_fields!();

    fn name(&self) -> &'static str {
        "TCN"
    }

    fn check(&self) -> crate::nn::Result<()> {
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("channels", self.channels, LARGEST_WIDTH),
            ("kernel", self.kernel, LARGEST_KERNEL),
            ("levels", self.levels, MOST_LEVELS),
        ];
        check_ranges(&sizes, &[("dropout", self.dropout, 0.0, 0.95)])
    }

    fn record<T: Real>(&self, recorder: &mut Recorder<T>, state: Var, _physics: Var) -> Result<Var> {
        self.record_as(recorder, state, Extent::Pruned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Network, OutputScale};
    use crate::tape::{Session, Threads};
    use phyture_kernels::Tolerance;
    use phyture_kernels::random::Stream;

    fn count(config: TcnConfig) -> crate::nn::Result<usize> {
        Ok(Network::<f32>::new(config, &OutputScale::unit(6), false)?.graph().parameter_count())
    }

    #[test]
    fn parameter_counts() -> crate::nn::Result<()> {
        // The output map among them.
        assert_eq!(count(TcnConfig::default())?, 99_516);
        assert_eq!(count(TcnConfig { channels: 25, ..TcnConfig::default() })?, 69_806);
        assert_eq!(count(TcnConfig { channels: 64, ..TcnConfig::default() })?, 440_774);
        assert_eq!(count(TcnConfig { channels: 64, kernel: 3, ..TcnConfig::default() })?, 190_918);
        Ok(())
    }

    #[test]
    fn the_pruned_network_gives_the_last_row_of_the_whole_one() -> crate::nn::Result<()> {
        for (history, kernel, levels, state_channels) in [(50, 3, 4, 5), (37, 7, 3, 4), (8, 2, 5, 3), (1, 3, 2, 4), (33, 1, 3, 4)] {
            let config = TcnConfig { history, state_channels, channels: 4, kernel, levels, dropout: 0.0 };
            let mut found = Vec::new();
            for extent in [Extent::Pruned, Extent::Whole] {
                let mut recorder = Recorder::<f64>::default();
                let state = recorder.graph.input_with_gradient("state", &[history, state_channels])?;
                let target = recorder.graph.input("target", &[1, 6])?;
                let y = config.record_as(&mut recorder, state, extent)?;
                let loss = recorder.graph.apply(crate::tape::ops::SquaredError { scale: 1.0 }, &[y, target])?;
                let stream = Stream::new(5, 0, 0, 0);
                let parameters: Vec<f64> =
                    (0..recorder.graph.parameter_count()).map(|at| stream.uniform(at as u64) - 0.4).collect();
                let mut session = Session::train(&recorder.graph, loss, &[y], Threads(1))?;
                session.step(&parameters, 1, None, &|_, slabs: &mut [&mut [f64]]| {
                    for (index, slab) in slabs.iter_mut().enumerate() {
                        let stream = stream.sub(index as u64);
                        slab.iter_mut().enumerate().for_each(|(at, value)| *value = stream.uniform(at as u64) - 0.5);
                    }
                })?;
                found.push([session.output(0, 0)?, session.gradients(), session.input_gradient(0, 0)?].concat());
            }
            let size = found[1].iter().fold(1.0_f64, |size, value| size.max(value.abs()));
            let off = found[0].iter().zip(&found[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
            assert!(found[0].len() == found[1].len() && off < Tolerance::Close.relative_f64(), "{config:?}: {off:e}");
        }
        Ok(())
    }

    #[test]
    fn lengths_start_as_those_of_the_directions() -> crate::nn::Result<()> {
        let network = Network::<f64>::new(TcnConfig::default(), &OutputScale::unit(6), false)?;
        let initial = network.initial(3);
        let of =
            |name: &str| network.parameters().iter().find(|parameter| parameter.name == name).map(|found| &initial[found.range()]);
        let (Some(v), Some(g)) = (of("block.1.convolution1.direction"), of("block.1.convolution1.length")) else {
            return Err(crate::nn::Error::Size {
                field: "parameter".into(),
                found: "none".into(),
                expected: "that of the convolution".into(),
            });
        };
        for (v, g) in v.chunks(210).zip(g) {
            assert!((v.iter().map(|v| v * v).sum::<f64>().sqrt() - g).abs() < Tolerance::Close.relative_f64());
        }
        // Uniform on ±1/√(30·7): deviation 0.0398.
        let rms = (v.iter().map(|v| v * v).sum::<f64>() / v.len() as f64).sqrt();
        assert!((rms * (3.0 * 210.0_f64).sqrt() - 1.0).abs() < 0.03, "{rms}");
        Ok(())
    }
}
