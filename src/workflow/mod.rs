//! Whole pieces of work, as functions with plain arguments: searching flights for missing effects, comparing models and networks on flights
//! that were kept back, and where the figures of a page come from. The command line and programs that embed the library call the same ones; how
//! they are asked and what a person is shown, nothing here knows. (A training run is [`Training`](crate::train::Training).)

mod contest;
#[cfg(feature = "report")]
mod provenance;
mod rollout;
mod search;

pub use contest::{Affordable, Contest, Judged, affordable_stride};
#[cfg(feature = "report")]
pub use provenance::provenance;
pub use rollout::Rolling;
pub use search::{NetworkSearch, SearchTask, append_to_ledger, convention_fault, network_search};
