//! phyture: calibrate a first-principles model of an unmanned helicopter on recorded flights, see where it fails, and learn
//! the rest with a small network.
//!
//! Data flows one way: [`flight`] → [`physics`] → windows → network ([`nn`] on [`tape`]) → `hybrid` → `critique` → `report`.
//! Nothing to the left knows anything to its right. `sim` (the built-in truth helicopter) is an independent code path that
//! neither `physics` nor `critique` imports.
//!
//! Conventions, everywhere: SI units and radians; north-east-down local frame, body axes nose-starboard-down; ZYX Euler
//! angles; quaternions scalar last; velocity is the inertial velocity written in body axes; matrices are row-major.
#![forbid(unsafe_code)]

pub mod blocks;
pub mod critique;
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
pub mod student_t;
#[cfg(feature = "studio")]
pub mod studio;
pub mod suggest;
pub mod tape;
pub mod train;
pub mod workflow;

pub use error::{Error, Result};
