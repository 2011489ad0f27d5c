//! phyture: calibrate a first-principles model of an unmanned helicopter on recorded flights, see where it fails, and learn
//! the rest with a small network.
//!
//! Data flows one way: [`flight`] → [`physics`] → windows → network ([`nn`] on [`tape`]) → `hybrid` → `critique` → `report`.
//! Nothing to the left knows anything to its right. `sim` (the built-in truth helicopter) is an independent code path that
//! neither `physics` nor `critique` imports.
//!
//! # From flights to a missing effect
//!
//! Ten simulated minutes of a helicopter with a fin, and a model without one. `flight::read::data_set` reads recorded flights the same way.
//!
//! ```
//! # #[cfg(not(feature = "sim"))]
//! # fn main() {}
//! # #[cfg(feature = "sim")]
//! # fn main() -> phyture::Result<()> {
//! use phyture::critique::diagnose::{Options, diagnose, searched};
//! use phyture::flight::split::Split;
//! use phyture::physics::Model;
//! use phyture::sim::{INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
//!
//! let truth = Simulation { minutes: 10.0, seed: 7, ..Simulation::baseline() }.hide("weathercock", 2.0)?;
//! let set = simulate(&truth)?;
//! let model = Model::paper("helicopter", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
//!
//! // Every fifth flight is kept from the search; it judges what was found.
//! let split = Split::for_search(&set.flights, 7);
//! let outcome = diagnose(&set.flights, &model, &searched(&split), &split.test, split.tested.name(), &Options::default())?;
//! assert_eq!(outcome.diagnosis.steps[0].effect, "weathercock");
//! assert!(outcome.diagnosis.is_confirmed());
//! # Ok(())
//! # }
//! ```
//!
//! More: [`physics::calibrate`], [`critique::compare()`], [`formula::Formula`], [`tape::Graph`], [`hybrid::Hybrid`]; whole programs are in `examples/`.
//!
//! # Conventions
//!
//! Everywhere: SI units and radians; north-east-down local frame, body axes nose-starboard-down; ZYX Euler
//! angles; quaternions scalar last; velocity is the inertial velocity written in body axes; matrices are row-major.
#![forbid(unsafe_code)]

pub mod blocks;
pub mod critique;
#[cfg(feature = "disk")]
pub mod disk;
pub mod error;
pub mod flight;
pub mod formula;
pub mod hybrid;
pub mod nn;
pub mod physics;
#[cfg(feature = "protocol")]
pub mod protocol;
#[cfg(feature = "report")]
pub mod report;
#[cfg(feature = "sim")]
pub mod sim;
mod stopwatch;
pub mod student_t;
#[cfg(feature = "studio")]
pub mod studio;
pub mod suggest;
pub mod tape;
pub mod train;
pub mod workflow;

pub use error::{Error, Result};
