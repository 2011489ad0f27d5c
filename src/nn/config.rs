//! Sizes and switches of Phy-Ture and its ablations, with the paper's values as defaults, and the check that they fit together.
//!
//! What the sizes mean is in `phyture`; how the network is trained is not here.

use super::configuration::{LARGEST_HISTORY, LARGEST_KERNEL, LARGEST_WIDTH, check_ranges, refused};
use crate::nn::error::Result;
use serde::{Deserialize, Serialize};

/// Phy-Ture, its ablations (paper table 4) and its fusion variants (paper table 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// The whole network: fusion, tree, decomposition; predicts the residual.
    #[default]
    PhyTure,
    /// S' = S W + PE in the place of the fusion; predicts the residual. The paper's "residual correction" is the same network.
    WithoutPaf,
    /// No trees: fusion and decomposition alone; predicts the residual.
    WithoutMstfe,
    /// One temporal linear map in the place of the decomposition; predicts the residual.
    WithoutTsdpTemporalLinear,
    /// The last row alone in the place of the decomposition; predicts the residual.
    WithoutTsdpLastRow,
    /// States and controls alone; predicts the acceleration itself, without physics.
    StateControlOnly,
    /// States, controls and physics side by side; predicts the acceleration itself.
    DirectConcatenation,
}

impl Variant {
    /// All variants.
    pub const ALL: [Self; 7] = [
        Self::PhyTure,
        Self::WithoutPaf,
        Self::WithoutMstfe,
        Self::WithoutTsdpTemporalLinear,
        Self::WithoutTsdpLastRow,
        Self::StateControlOnly,
        Self::DirectConcatenation,
    ];

    /// As it stands in the paper's tables 4 and 6.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PhyTure => "Phy-Ture",
            Self::WithoutPaf => "Without PAF",
            Self::WithoutMstfe => "Without MSTFE",
            Self::WithoutTsdpTemporalLinear => "Without TSDP (temporal linear)",
            Self::WithoutTsdpLastRow => "Without TSDP (last row)",
            Self::StateControlOnly => "State-Control Only",
            Self::DirectConcatenation => "Direct Concatenation",
        }
    }

    /// Whether the output is the residual r̂ of eq. 11 (true), to which the physical baseline is added (eq. 12), or the
    /// acceleration itself (false).
    pub const fn predicts_residual(self) -> bool {
        !matches!(self, Self::StateControlOnly | Self::DirectConcatenation)
    }

    /// Whether the history of the physical baseline is an input that reaches the output.
    pub const fn reads_physics(self) -> bool {
        !matches!(self, Self::WithoutPaf | Self::StateControlOnly)
    }
}

/// Sizes of the network. Defaults are the paper's where it states them, and SCINet's own for the two kernels and `hidden`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhyTureConfig {
    /// H, samples of the history: 1000 (10 s at 100 Hz).
    pub history: usize,
    /// Channels of S: 16 (position, Euler angles, velocity, rates, controls; eq. 10).
    pub state_channels: usize,
    /// Channels of P: 6 (eq. 16).
    pub physics_channels: usize,
    /// d_model: 64.
    pub d_model: usize,
    /// Attention heads: 4.
    pub heads: usize,
    /// Levels of a tree: 3.
    pub levels: usize,
    /// Trees one after another: 2.
    pub stacks: usize,
    /// w, width of the moving average, odd: 25.
    pub moving_average: usize,
    /// P, rows predicted: 1, the last row of the history.
    pub horizon: usize,
    /// Channels predicted: 6.
    pub outputs: usize,
    /// Kernel of the first convolution of a module: 5.
    pub kernel1: usize,
    /// Kernel of the second convolution: 3.
    pub kernel2: usize,
    /// Channels between the two convolutions, as a multiple of `d_model`, cut to an integer: 1.
    pub hidden: f64,
    /// Slope of the leaky rectifier for negative arguments: 0.01.
    pub leak: f64,
    /// ε inside the root of the layer norm: 1e-5.
    pub norm_eps: f64,
    /// Dropout between the two convolutions of a module and on attention probabilities: 0.2.
    pub dropout: f64,
    /// Whether linear, attention and temporal maps have biases (the paper's equations print none, its framework has them).
    pub biases: bool,
    /// Which network.
    pub variant: Variant,
}

impl Default for PhyTureConfig {
    fn default() -> Self {
        Self {
            history: 1000,
            state_channels: 16,
            physics_channels: 6,
            d_model: 64,
            heads: 4,
            levels: 3,
            stacks: 2,
            moving_average: 25,
            horizon: 1,
            outputs: 6,
            kernel1: 5,
            kernel2: 3,
            hidden: 1.0,
            leak: 0.01,
            norm_eps: 1e-5,
            dropout: 0.2,
            biases: true,
            variant: Variant::PhyTure,
        }
    }
}

/// Bounds of depth; those of sizes are every network's.
const MOST_LEVELS: usize = 8;
const MOST_STACKS: usize = 16;

/// Most blocks of all trees together; the paper's two trees have 14.
const MOST_BLOCKS: usize = 512;

impl PhyTureConfig {
    /// Checks each field and how they fit together.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size) with the field, its value and its range.
    pub fn check(&self) -> Result<()> {
        let refuse = |field: &str, found: String, expected: String| Err(refused(field, found, expected));
        let sizes = [
            ("history", self.history, LARGEST_HISTORY),
            ("state_channels", self.state_channels, LARGEST_WIDTH),
            ("physics_channels", self.physics_channels, LARGEST_WIDTH),
            ("d_model", self.d_model, LARGEST_WIDTH),
            ("heads", self.heads, LARGEST_WIDTH),
            ("levels", self.levels, MOST_LEVELS),
            ("stacks", self.stacks, MOST_STACKS),
            ("moving_average", self.moving_average, LARGEST_HISTORY),
            ("horizon", self.horizon, self.history),
            ("outputs", self.outputs, LARGEST_WIDTH),
            ("kernel1", self.kernel1, LARGEST_KERNEL),
            ("kernel2", self.kernel2, LARGEST_KERNEL),
        ];
        let reals = [("leak", self.leak, 0.0, 1.0), ("norm_eps", self.norm_eps, 0.0, 1.0), ("dropout", self.dropout, 0.0, 0.95)];
        check_ranges(&sizes, &reals)?;
        let blocks = self.stacks * ((1 << self.levels) - 1);
        if blocks > MOST_BLOCKS {
            let expected = format!("fewer: stacks · (2^levels − 1) is {blocks}, at most {MOST_BLOCKS} blocks are allowed");
            return refuse("levels", format!("{} with {} stacks", self.levels, self.stacks), expected);
        }
        if !self.d_model.is_multiple_of(self.heads) {
            return refuse("heads", self.heads.to_string(), format!("a divisor of d_model = {}", self.d_model));
        }
        if !self.d_model.is_multiple_of(2) {
            return refuse("d_model", self.d_model.to_string(), "an even number: positions are sine and cosine pairs".into());
        }
        if !self.history.is_multiple_of(1 << self.levels) {
            let expected = format!("a multiple of 2^levels = {}: each level halves the sequence", 1 << self.levels);
            return refuse("history", self.history.to_string(), expected);
        }
        if self.moving_average.is_multiple_of(2) {
            return refuse(
                "moving_average",
                self.moving_average.to_string(),
                "an odd width, so that the average is centred".into(),
            );
        }
        let hidden = self.hidden * self.d_model as f64;
        if !(hidden >= 1.0 && hidden <= LARGEST_WIDTH as f64) {
            let expected =
                format!("{} to {}: 1 to {LARGEST_WIDTH} channels", 1.0 / self.d_model as f64, LARGEST_WIDTH / self.d_model);
            return refuse("hidden", self.hidden.to_string(), expected);
        }
        Ok(())
    }

    /// Channels between the two convolutions of a module.
    pub fn hidden_channels(&self) -> usize {
        (self.hidden * self.d_model as f64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::error::Error;

    #[test]
    fn each_rule_names_its_field() {
        let base = PhyTureConfig::default;
        assert!(base().check().is_ok());
        let wrong = [
            ("history", PhyTureConfig { history: 1004, ..base() }),
            ("history", PhyTureConfig { history: usize::MAX, ..base() }),
            ("moving_average", PhyTureConfig { moving_average: 24, ..base() }),
            ("heads", PhyTureConfig { heads: 5, ..base() }),
            ("heads", PhyTureConfig { heads: 0, ..base() }),
            ("d_model", PhyTureConfig { d_model: 9, heads: 3, ..base() }),
            ("levels", PhyTureConfig { levels: 64, ..base() }),
            ("levels", PhyTureConfig { levels: 8, stacks: 3, history: 1024, ..base() }),
            ("hidden", PhyTureConfig { hidden: f64::NAN, ..base() }),
            ("hidden", PhyTureConfig { hidden: 1e300, ..base() }),
            ("dropout", PhyTureConfig { dropout: 1.0, ..base() }),
            ("horizon", PhyTureConfig { horizon: 1001, ..base() }),
        ];
        for (name, config) in wrong {
            assert!(matches!(config.check(), Err(Error::Size { field, .. }) if field == name), "{name}: {config:?}");
        }
    }

    #[test]
    fn unknown_fields_are_refused_and_missing_ones_are_the_papers() -> Result<(), serde_json::Error> {
        assert_eq!(serde_json::from_str::<PhyTureConfig>(r#"{"heads": 4}"#)?, PhyTureConfig::default());
        assert!(serde_json::from_str::<PhyTureConfig>(r#"{"head": 4}"#).is_err());
        for variant in Variant::ALL {
            assert_eq!(serde_json::from_str::<Variant>(&serde_json::to_string(&variant)?)?, variant);
        }
        Ok(())
    }
}
