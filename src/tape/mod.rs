//! Reverse mode: record a graph, plan it once, replay it.
//!
//! [`Graph`] records operations ([`ops`]) on copyable handles; a plan gives every buffer its place; [`Session`] replays it one
//! sample at a time and gives the loss, the outputs and the gradients. The tape knows operations, not networks.

#[macro_use]
pub mod gradcheck;
pub mod op;
pub mod ops;

pub mod error;
mod graph;
mod parameter;
mod parts;
mod plan;
mod session;
mod shape;
mod slab;
mod threads;

pub use error::{Error, Result};
pub use graph::{Graph, MAX_INPUTS, Var};
pub use parameter::{Parameter, Storage};
pub use parts::Parts;
pub use session::{DropoutKey, Fill, SHARDS, Session, instruction_set};
pub use shape::{MAX_RANK, Shape};
pub use threads::Threads;
