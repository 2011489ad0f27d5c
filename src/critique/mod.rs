//! The critique: where a model fails against the measurements, and by how much.

pub mod blocks;
pub mod compare;
pub mod locate;
pub mod regime;
pub mod table;

pub use compare::{Comparison, ModelError, PartError, PerChannel, Row, Split, compare};
pub use regime::Regime;
