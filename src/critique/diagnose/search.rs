//! What every part of a search works with: the options, the flights in blocks, the sign flips. The two roads are in `forward` and `backward`.

use super::engine::Engine;
use super::mends::Mends;
use super::significance::Flips;
use super::watch::Watch;

/// How a search is done.
#[derive(Clone, Debug)]
pub struct Options {
    /// Most effects to accept, one after the other. Without a limit, as soon as many are missing, all that apply are fitted at once and the
    /// needless left out.
    pub max_effects: Option<usize>,
    /// Seed of folds, flips and resampling.
    pub seed: u64,
    /// Candidates to leave out.
    pub without: Vec<String>,
    /// Whether a loop, once nothing of the catalogue is left, also tries the formulas that the rest of the error suggests.
    pub formulas: bool,
    /// What the description of the flights mends: what that leaves is not named.
    pub mends: Mends,
    /// Follows the search, and may stop it.
    pub watch: Watch,
}

impl Default for Options {
    fn default() -> Self {
        Self { max_effects: None, seed: 1, without: Vec::new(), formulas: false, mends: Mends::default(), watch: Watch::default() }
    }
}

/// A search on some flights.
pub(super) struct Search<'a> {
    pub engine: Engine<'a>,
    pub flips: Flips,
    pub largest_p: f64,
    pub options: &'a Options,
}
