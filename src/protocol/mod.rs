//! The paper's experiments: every method on the same splits, several seeds, and the tables that come of them.
//!
//! A [`Plan`] is a list of independent [`Run`]s. Each run trains at most one network and ends in one [`Outcome`], a file of sums of errors
//! by ten-second segment; every table is arithmetic on outcomes. So runs may be made in any order, on any machine, and killed at any
//! moment. Nothing here parses a command line or draws a page.

pub mod cell;
pub mod estimate;
pub mod experiment;
pub mod folder;
pub mod lead;
pub mod method;
pub mod outcome;
pub mod paper;
pub mod plan;
pub mod settings;
pub mod slurm;
pub mod table;
pub mod text;

pub use cell::Cell;
pub use experiment::{Experiment, Extent};
pub use folder::{Folder, instruction_set};
pub use lead::Lead;
pub use method::{METHODS, Method, Predictor, method};
pub use outcome::{Outcome, Segment, Trace};
pub use plan::{Division, Plan, Run, TableId, Treatment};
pub use settings::Settings;
pub use slurm::JobArray;
pub use table::{Finished, Table, TableRow};
