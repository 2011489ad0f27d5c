//! The critique: where a model fails against the measurements, and by how much.

pub mod change;
pub mod channels;
pub mod check;
pub mod compare;
pub mod contest;
pub mod coverage;
pub mod diagnose;
pub mod digits;
mod floor;
#[cfg(feature = "files")]
pub mod init;
pub mod locate;
pub mod predictions;
pub mod prose;
pub mod regime;
pub mod residual_views;
pub mod rollout;
pub mod shares;
pub mod table;
pub mod uncertainty;
pub mod unknown;
pub mod wrap;
pub mod yardstick;

pub use channels::{ChannelValues, Intervals};
pub use compare::{Comparison, ModelError, PartError, compare, paired};
pub use contest::{Best, Difference};
pub use coverage::{Coverage, coverage};
pub use floor::{explainable_at, floor, floor_of_spans};
pub use predictions::Row;
pub use regime::Regime;
pub use rollout::Rollouts;
pub use shares::{Shares, shares};
pub use uncertainty::{Uncertainty, uncertainty};
pub use yardstick::{centred_difference, finite_difference, ridge};
