//! Kernels of phyture: numbers in, numbers out.
//!
//! Slices with shapes and row strides; no tape, no model, no input or output, no dependency (`matrixmultiply` is an oracle of
//! tests and benches), but for `mapped`, a feature: memory that lies in a file.
//!
//! Without the feature `std` (and with `libm` in its place) the crate needs `core` and `alloc` alone. Then nothing is looked up at run time: the level is
//! the one that the program is compiled for. Results differ from those with `std` by rounding. `mapped`, `peak` and the oracles
//! (`reference`, `reference_peers`) need `std`.
//!
//! All `unsafe` of the project lives in this crate: the call of a kernel compiled for an instruction-set level
//! ([`instruction_set`]), the registers of the innermost loops (`vector`), and their unchecked reads (`tile`), and that memory. Everything else is plain Rust,
//! compiled once a level and a float type, in `compiled`.
//!
//! Conventions: sequences are channels-last, `[time, channel]` row-major with a row stride, so that the odd and the even rows
//! of a sequence are views; the [`InstructionSet`] is the first argument, chosen once; backward kernels take a [`Write`] for each gradient they produce; scratch comes from the caller.

// Tests have the standard library in every configuration; what they test has not.
#![cfg_attr(not(any(feature = "std", test)), no_std)]

extern crate alloc;

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!(
    "phyture-kernels takes its maths from the standard library or from libm: turn on the feature `std` or the feature `libm`"
);

// The registers of level plain are those of SSE2, which this architecture has unless it is told not to use them.
#[cfg(all(target_arch = "x86_64", not(target_feature = "sse2")))]
compile_error!("phyture-kernels needs SSE2 on x86-64");

pub mod activation;
pub mod adam;
pub mod attention;
pub mod batch_norm;
pub mod columns;
mod compiled;
pub mod conv1d;
pub mod conv1d_general;
pub mod dropout;
pub mod elementary;
pub mod encoding;
pub mod fold;
pub mod gemm;
pub mod inception;
pub mod instruction_set;
pub mod layer_norm;
pub mod linear;
pub mod loss;
pub mod lstm;
#[cfg(feature = "mapped")]
pub mod mapped;
mod maths;
pub mod moving_average;
#[cfg(feature = "std")]
pub mod peak;
pub mod pool;
pub mod prob_sparse;
pub mod random;
pub mod real;
#[cfg(any(feature = "std", test))]
pub mod reference;
#[cfg(any(feature = "std", test))]
pub mod reference_peers;
mod registers;
mod row_reductions;
pub mod sci;
pub mod spectrum;
pub mod strided;
pub mod temporal;
pub mod temporal_each;
#[cfg(test)]
mod testing;
mod tile;
pub mod tolerance;
mod vector;
pub mod weight_norm;

pub use instruction_set::InstructionSet;
pub use real::Real;
pub use strided::{Rows, RowsMut};
pub use tolerance::Tolerance;

/// How a kernel stores a gradient: the first writer of a buffer sets it, later ones add to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Write {
    /// Overwrite what is there, whatever it is (it may be uninitialised numbers).
    Set,
    /// Add to what is there.
    Add,
}
