//! The critique: where a model fails against the measurements, and by how much.

mod yardstick;

pub use yardstick::{Ridge, RidgeInput, RidgeOptions, centred_difference, finite_difference};

/// Predictions of one model, to be laid beside the measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the model, as the tables show it.
    pub name: String,
    /// One entry a window, in the order of the windows: v̇ in m/s², then ω̇ in rad/s².
    pub predicted: Vec<[f64; 6]>,
}
