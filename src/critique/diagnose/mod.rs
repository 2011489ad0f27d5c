//! Which physical effects are missing, and how sure is that? A grouped, constrained search over the catalogue: one effect after the other, and
//! where many are missing from the other end, all at once and the needless left out (`backward`, on the algebra of `joint`).
//!
//! Every effect is one candidate with its physical bounds. It is judged by the error on blocks of flight that its numbers have not
//! seen, by a p-value from sign flips of blocks, and by whether it removes enough to be worth while; then once more on flights that the
//! whole search has not seen. What is searched is in `candidate`, what is fitted in `fit` and `joint`, what is chance in `significance`, what each flight
//! has for itself in `own`.
//!
//! Nothing here reads a file or draws a picture, and nothing knows of the built-in simulator.

mod account;
mod amend;
mod backward;
mod candidate;
mod confirm;
mod describe;
mod design;
mod engine;
mod exchange;
mod failure;
mod fit;
mod forward;
mod found;
mod gains;
mod gates;
mod gram;
mod influence;
mod joint;
mod judged;
mod known;
mod ladder;
mod mends;
mod own;
mod refine;
mod report;
mod resample;
mod rest;
mod score;
mod scored;
mod search;
mod selection;
pub mod sentences;
mod significance;
mod signs;
mod stepwise_stlsq;
mod suggest;
mod support;
mod text;
mod verdict;
mod watch;

pub use account::{together, weigh};
pub use amend::{Amended, amend, calibrated, searched};
pub use mends::Mends;
pub use own::{Met, met, met_both_ways};
pub use report::{
    Bar, CandidateReport, Confirmation, DependsOn, Diagnosis, Failure, FailureChannel, Influence, Kept, Locked, Method, Number,
    ParameterValue, Status, Step, TriedFormula, UnknownChannel, Verdict, Worth,
};
pub use search::Options;
pub use signs::number_remark;
pub use stepwise_stlsq::{Named, stepwise_and_stlsq};
pub use text::LoopText;
pub use verdict::{Outcome, diagnose};
pub use watch::Watch;
