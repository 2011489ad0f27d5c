//! Whole pieces of work, as functions with plain arguments: searching flights for missing effects, training a network, comparing models and
//! networks on flights that were kept back. The command line, the benchmark and programs that embed the library call the same ones; how they
//! are asked and what a person is shown, nothing here knows.

mod contest;
#[cfg(feature = "report")]
mod provenance;
mod search;
mod training;

pub use contest::{Affordable, Contest, Judged, affordable_stride};
#[cfg(feature = "report")]
pub use provenance::provenance;
pub use search::{NetworkSearch, SearchTask, append_to_ledger, convention_fault, network_search};
pub use training::{Begun, Ended, Event, Losses, Trained, Training};
