//! Reports: self-contained HTML pages with figures as SVG, for people without this program.
//!
//! Numbers come in finished from the critique; nothing is computed here that a table or a JSON file would not also say.

#[cfg(feature = "protocol")]
pub mod benchmark;
pub mod colour;
pub mod compare;
pub mod diagnose;
mod escape;
pub mod figures;
mod names;
pub mod page;
pub mod rollout;
pub mod training;

#[cfg(feature = "protocol")]
pub use benchmark::benchmark_page;
pub use compare::{CompareReport, compare_page};
pub use diagnose::{DiagnoseReport, diagnose_page};
pub use figures::Figure;
pub use page::{Cell, DATA_NOTE, Map, MapCell, Page, Part, Section, Table, page};
pub use rollout::rollout_page;
pub use training::{TrainingReport, training_page};
