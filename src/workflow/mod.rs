//! Whole pieces of work, as functions with plain arguments: dividing flights, calibrating, searching flights for missing effects, training,
//! predicting, comparing models and networks on flights that were kept back, and where the figures of a page come from. The command line, the
//! bindings and programs that embed the library call the same ones; how they are asked and what a person is shown, nothing here knows.

mod calibration;
mod contest;
mod division;
mod document;
mod flights;
mod judging;
#[cfg(feature = "disk")]
mod ledger;
#[cfg(feature = "files")]
mod prediction;
#[cfg(feature = "report")]
mod provenance;
mod rollout;
mod search;
#[cfg(feature = "files")]
mod training;

pub use calibration::{Calibrated, Calibrating, PartRmse};
pub use contest::{Affordable, Contest, Judged, affordable_stride, rows_needed};
pub use division::Division;
pub use document::document;
pub use flights::{SUSPECTS, without};
#[cfg(feature = "disk")]
pub use ledger::append_to_ledger;
#[cfg(feature = "files")]
pub use prediction::{PredictionSummary, PredictionTable, Predictions, Predictor, read_network};
#[cfg(feature = "report")]
pub use provenance::provenance;
pub use rollout::{FromOne, Path, Rolling};
pub use search::{Looped, NetworkSearch, SearchTask, convention_fault, network_search};
#[cfg(feature = "files")]
pub use training::{Epoch, Run, TrainedNetwork, digest, train, training_digest};
