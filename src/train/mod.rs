//! Training the residual network: configuration, schedule, trainer, checkpoint, and the run folder they live in.
//!
//! Everything random is a function of the seed and of where in the run it is drawn, so a run that was interrupted and resumed is
//! bit for bit the run that was not, on any number of threads.

mod adjoint;
pub mod config;
#[cfg(feature = "disk")]
pub mod container;
mod job;
mod rollout_loss;
#[cfg(feature = "disk")]
pub mod run;
pub mod schedule;
#[cfg(feature = "files")]
mod text;
pub mod trainer;
#[cfg(feature = "disk")]
mod training;

pub use config::{RolloutConfig, TrainConfig};
pub use job::Job;
pub use rollout_loss::{RolloutLoss, RolloutRule, Rollouts};
#[cfg(feature = "disk")]
pub use run::{Checkpointed, Outcome, Report, RunFolder};
pub use trainer::{Best, EpochLoss, State, StepReport, Trainer, diverges_in};
#[cfg(feature = "disk")]
pub use training::{Begun, Ended, Event, Losses, Trained, Training};
