//! Kernels of phyture: numbers in, numbers out.
//!
//! Slices with shapes and row strides; no tape, no model, no input or output, no dependency but `matrixmultiply` (oracle,
//! f64 and cold path). All `unsafe` and all SIMD of the project live in this crate.
//!
//! Conventions: sequences are channels-last, `[time, channel]` row-major with a row stride, so that the odd and the even rows
//! of a sequence are views; backward kernels take a [`Write`] for each gradient they produce; scratch comes from the caller.

pub mod real;
pub mod tolerance;

pub use real::Real;
pub use tolerance::Tolerance;

/// How a kernel stores a gradient: the first writer of a buffer sets it, later ones add to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Write {
    /// Overwrite what is there, whatever it is (it may be uninitialised numbers).
    Set,
    /// Add to what is there.
    Add,
}
