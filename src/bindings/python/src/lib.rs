//! The extension module behind the Python package `phyture`: what crosses the border between Python and the library, and nothing that is
//! computed. What Python programs see is in `python/phyture`, which calls these functions and gives their results a shape.
//!
//! Work runs on a thread of its own, without the interpreter's lock (`work`); results cross as JSON, the very document that the command line
//! writes, and columns as bytes, so that every number keeps its bits and no other package is needed.

mod calibrating;
mod columns;
mod division;
mod error;
mod flights;
mod found;
mod judging;
mod learning;
mod model;
mod network;
mod ranges;
mod searching;
mod work;

use pyo3::pymodule;

/// The border between Python and the library.
#[pymodule]
mod _phyture {
    #[pymodule_export]
    use crate::calibrating::{calibrate, check};
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::flights::{Flights, simulate};
    #[pymodule_export]
    use crate::found::Found;
    #[pymodule_export]
    use crate::judging::{compare, rollout};
    #[pymodule_export]
    use crate::learning::{predict, train, training_config};
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::network::Network;
    #[pymodule_export]
    use crate::searching::{amend, diagnose};
    #[cfg(debug_assertions)]
    #[pymodule_export]
    use crate::work::panics;

    /// Version of the library.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
