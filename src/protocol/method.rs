//! What stands in the rows of the tables: every method by its identifier, with the sizes it is built at. How a row is computed is in
//! `experiment`.
//!
//! Every network takes history and inputs from the plan's Phy-Ture, so that all see the same rows. The peers have the widths that
//! their authors (or, for the reconstructions, we) recommend; a plan with a narrower Phy-Ture than the paper's narrows all of them by
//! the same factor.

use crate::nn::peers::{CnnConfig, CnnLstmConfig, DLinearConfig, InformerConfig, TcnConfig, TimeMixerConfig, TimesNetConfig};
use crate::nn::{Architecture, PhyTureConfig, Variant};

/// A row of a table.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Identifier in files.
    pub id: &'static str,
    /// As it stands in tables.
    pub name: &'static str,
    /// What a reader has to know of the row.
    pub note: Option<&'static str>,
    /// How it predicts.
    pub predictor: Predictor,
}

/// How a row predicts.
#[derive(Clone, Copy, Debug)]
pub enum Predictor {
    /// The calibrated model alone; `amended`: with the effects that the loop has found in the training part.
    Physics {
        /// Whether the loop comes first.
        amended: bool,
    },
    /// Backward difference of the measured velocity and rates: what the newest two rows give away.
    BackwardDifference,
    /// Centred difference, which looks one row ahead: what the targets give away, and no predictor.
    CentredDifference,
    /// Ridge regression of the accelerations on the last rows of the log; `windows`: of the networks' windows and inputs, not of every sample and
    /// gravity in body axes.
    Ridge {
        /// Whether it sees what the networks see.
        windows: bool,
    },
    /// A trained network.
    Network {
        /// The network, from the plan's Phy-Ture.
        architecture: fn(&PhyTureConfig) -> Architecture,
        /// Whether the physics below it has been amended by the loop.
        amended: bool,
        /// Whether a linear history is fitted between the two.
        linear: bool,
    },
    /// What is explainable of the flights, where it is known: no predictor.
    Floor,
}

impl Predictor {
    /// The trained network, if it has one.
    pub fn network(self, base: &PhyTureConfig) -> Option<Architecture> {
        match self {
            Self::Network { architecture, .. } => Some(architecture(base)),
            _ => None,
        }
    }

    /// Whether a linear history is fitted below the network, whatever the plan says.
    pub const fn has_linear_history(self) -> bool {
        matches!(self, Self::Network { linear: true, .. })
    }

    /// Whether the loop amends the physics first.
    pub const fn amended(self) -> bool {
        matches!(self, Self::Physics { amended: true } | Self::Network { amended: true, .. })
    }
}

const RECONSTRUCTION: Option<&str> = Some("a reconstruction: its authors' layer sizes are not public");

const fn row(id: &'static str, name: &'static str, note: Option<&'static str>, predictor: Predictor) -> Method {
    Method { id, name, note, predictor }
}

const fn network(
    id: &'static str,
    name: &'static str,
    note: Option<&'static str>,
    architecture: fn(&PhyTureConfig) -> Architecture,
) -> Method {
    row(id, name, note, Predictor::Network { architecture, amended: false, linear: false })
}

/// Every method.
pub const METHODS: &[Method] = &[
    row("physical_baseline", "Physical baseline", None, Predictor::Physics { amended: false }),
    row(
        "amended_physics",
        "Amended physics",
        Some("the baseline with the effects that `loop` found in the training part; no network"),
        Predictor::Physics { amended: true },
    ),
    row(
        "backward_difference",
        "Finite difference",
        Some("of the last two measured rows; no learning"),
        Predictor::BackwardDifference,
    ),
    row(
        "centred_difference",
        "Finite difference, zero phase",
        Some("looks one row ahead: what the targets give away, not a predictor"),
        Predictor::CentredDifference,
    ),
    row(
        "ridge",
        "Ridge regression",
        Some("of the accelerations on the last 11 rows, at every sample; no physics"),
        Predictor::Ridge { windows: false },
    ),
    row(
        "ridge_windows",
        "Ridge regression, as the networks see",
        Some(
            "of the accelerations on the last 11 rows of the networks' inputs, at their windows (fewer rows where there are few windows); no physics",
        ),
        Predictor::Ridge { windows: true },
    ),
    row(
        "floor",
        "Floor",
        Some(
            "what the simulator's explainable part leaves: gusts, turbulence and noise, which nothing tells beforehand; a method that differentiates the measured history sees gusts as they come, and can lie below",
        ),
        Predictor::Floor,
    ),
    network("cnn", "CNN hybrid", RECONSTRUCTION, |base| {
        let reference = CnnConfig::default();
        CnnConfig {
            history: base.history,
            state_channels: base.state_channels,
            channels: reference.channels.map(|channels| scaled(base, channels)),
            hidden: scaled(base, reference.hidden),
            ..reference
        }
        .into()
    }),
    network("cnn_lstm", "CNN–LSTM hybrid", RECONSTRUCTION, |base| {
        let reference = CnnLstmConfig::default();
        CnnLstmConfig {
            history: base.history,
            state_channels: base.state_channels,
            channels: reference.channels.map(|channels| scaled(base, channels)),
            hidden: scaled(base, reference.hidden),
            ..reference
        }
        .into()
    }),
    network("tcn", "TCN", None, |base| {
        let reference = TcnConfig::default();
        TcnConfig {
            history: base.history,
            state_channels: base.state_channels,
            channels: scaled(base, reference.channels),
            levels: tcn_levels(base.history),
            ..reference
        }
        .into()
    }),
    network("timesnet", "TimesNet", Some("its periods are chosen for each window by itself, not for a batch"), |base| {
        let reference = TimesNetConfig::default();
        TimesNetConfig {
            history: base.history,
            state_channels: base.state_channels,
            d_model: scaled(base, reference.d_model),
            d_ff: scaled(base, reference.d_ff),
            periods: reference.periods.min(base.history / 2),
            ..reference
        }
        .into()
    }),
    network("timemixer", "TimeMixer", None, |base| {
        let reference = TimeMixerConfig::default();
        TimeMixerConfig {
            history: base.history,
            state_channels: base.state_channels,
            d_model: scaled(base, reference.d_model),
            d_ff: scaled(base, reference.d_ff),
            ..reference
        }
        .into()
    }),
    network("dlinear", "DLinear", Some("shared over channels"), |base| {
        DLinearConfig { history: base.history, state_channels: base.state_channels, ..Default::default() }.into()
    }),
    network("informer", "Conv–Informer", Some("a reconstruction: which network the paper means is not known"), |base| {
        let reference = InformerConfig::default();
        let d_model = scaled(base, reference.d_model);
        InformerConfig {
            history: base.history,
            state_channels: base.state_channels,
            d_model,
            d_ff: scaled(base, reference.d_ff),
            heads: if d_model.is_multiple_of(reference.heads) { reference.heads } else { 2 },
            decoder_rows: reference.decoder_rows.min(base.history),
            ..reference
        }
        .into()
    }),
    network("phyture", "Phy-Ture", None, |base| base.into()),
    row(
        "phyture_amended",
        "Phy-Ture on the amended physics",
        Some("the baseline with the effects that `loop` found in the training part, under the same network"),
        Predictor::Network { architecture: |base| base.into(), amended: true, linear: false },
    ),
    row(
        "phyture_linear",
        "Linear history + Phy-Ture",
        Some("a ridge regression of what physics leaves on the last 11 rows, and the network on what that leaves"),
        Predictor::Network { architecture: |base| base.into(), amended: false, linear: true },
    ),
    network("phyture_without_dropout", "Phy-Ture without dropout", None, |base| {
        PhyTureConfig { dropout: 0.0, ..base.clone() }.into()
    }),
    network("without_paf", "Without PAF", None, |base| variant(base, Variant::WithoutPaf)),
    network("without_mstfe", "Without MSTFE", None, |base| variant(base, Variant::WithoutMstfe)),
    network(
        "without_tsdp_linear",
        "Without TSDP (temporal linear)",
        Some("reading 1: one map over time; the same functions as TSDP"),
        |base| variant(base, Variant::WithoutTsdpTemporalLinear),
    ),
    network("without_tsdp_last", "Without TSDP (last row)", Some("reading 2: the last row alone"), |base| {
        variant(base, Variant::WithoutTsdpLastRow)
    }),
    network("state_control_only", "State-Control Only", None, |base| variant(base, Variant::StateControlOnly)),
    network("direct_concatenation", "Direct Concatenation", None, |base| variant(base, Variant::DirectConcatenation)),
    network("average_5", "w = 5", None, |base| average(base, 5)),
    network("average_15", "w = 15", None, |base| average(base, 15)),
    network("average_25", "w = 25", None, |base| average(base, 25)),
    network("average_35", "w = 35", None, |base| average(base, 35)),
    network("average_45", "w = 45", None, |base| average(base, 45)),
];

fn variant(base: &PhyTureConfig, variant: Variant) -> Architecture {
    PhyTureConfig { variant, ..base.clone() }.into()
}

fn average(base: &PhyTureConfig, moving_average: usize) -> Architecture {
    PhyTureConfig { moving_average, ..base.clone() }.into()
}

/// A peer's width in a plan: as much of its own as Phy-Ture has of the paper's, even (sine and cosine come in pairs).
fn scaled(base: &PhyTureConfig, width: usize) -> usize {
    let paper = PhyTureConfig::default().d_model;
    2 * (width * base.d_model).div_ceil(2 * paper)
}

/// Blocks of the TCN: its recommended 8 at the paper's history, of a shorter one as few as see the whole of it.
fn tcn_levels(history: usize) -> usize {
    let reference = TcnConfig::default();
    if history >= PhyTureConfig::default().history {
        return reference.levels;
    }
    let sees = |levels: &usize| 1 + 2 * (reference.kernel - 1) * ((1 << levels) - 1) >= history;
    (1..reference.levels).find(sees).unwrap_or(reference.levels)
}

/// A method by its identifier.
pub fn method(id: &str) -> Option<&'static Method> {
    METHODS.iter().find(|method| method.id == id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    #[test]
    fn identifiers_are_unique() {
        for (index, method) in METHODS.iter().enumerate() {
            assert!(METHODS.iter().skip(index + 1).all(|other| other.id != method.id && other.name != method.name));
        }
    }

    #[test]
    fn every_network_can_be_built_at_the_papers_history_and_at_short_ones() -> Result<()> {
        for (history, d_model) in [(16, 8), (64, 10), (128, 32), (200, 64), (1000, 64)] {
            let base = PhyTureConfig { history, d_model, heads: 2, state_channels: 13, ..PhyTureConfig::default() };
            for method in METHODS {
                let Some(network) = method.predictor.network(&base) else { continue };
                network.check()?;
                assert_eq!((network.history(), network.state_channels()), (history, 13), "{}", method.id);
            }
        }
        Ok(())
    }

    #[test]
    fn at_the_papers_width_the_peers_have_their_own() {
        let network = |id: &str| method(id).and_then(|method| method.predictor.network(&PhyTureConfig::default()));
        assert_eq!(network("timesnet"), Some(TimesNetConfig::default().into()));
        assert_eq!(network("timemixer"), Some(TimeMixerConfig::default().into()));
        assert_eq!(network("informer"), Some(InformerConfig::default().into()));
        assert_eq!(network("cnn"), Some(CnnConfig::default().into()));
        assert_eq!(network("cnn_lstm"), Some(CnnLstmConfig::default().into()));
        assert_eq!(network("dlinear"), Some(DLinearConfig::default().into()));
        assert_eq!(network("tcn"), Some(TcnConfig::default().into()));
    }

    #[test]
    fn the_tcn_sees_the_whole_history() {
        assert_eq!((tcn_levels(1000), tcn_levels(999)), (8, 7), "1 + 12·127 = 1525 rows");
        assert_eq!(tcn_levels(128), 4);
        assert_eq!(tcn_levels(4000), 8);
    }
}
