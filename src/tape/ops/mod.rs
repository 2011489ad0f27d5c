//! The operations of the tape, one file each: shape rule, what is kept, forward, backward, and a gradient check.
//!
//! An operation checks shapes once, while recording, and then calls kernels; the arithmetic is in `phyture-kernels`. To add
//! one: a file with a type that implements [`Op`](super::op::Op) and [`Differentiable`](super::op::Differentiable), one
//! `gradcheck!` line at its foot, and its name here.

mod activation;
mod add_weighted;
mod affine;
mod attention;
mod batch_norm;
mod concatenate;
mod conv1d;
mod conv1d_general;
mod copy;
mod dropout;
mod encoding;
mod even_odd;
mod fft_periods;
mod flatten;
mod fold_convolution;
mod inner_product;
mod large_weight;
mod last_rows;
mod layer_norm;
mod linear;
mod lstm;
mod mean;
mod merge_kernels;
mod moving_average;
mod pool;
mod prob_sparse;
mod scale_exp;
mod spaced_rows;
mod squared_error;
mod sum;
mod temporal;
mod temporal_each;
mod weight_norm;

pub use activation::Activation;
pub use add_weighted::AddWeighted;
pub use affine::Affine;
pub use attention::Attention;
pub use batch_norm::BatchNorm;
pub use concatenate::Concatenate;
pub use conv1d::{Conv1d, Epilogue};
pub use conv1d_general::{Ends, GeneralConv1d, Place};
pub use copy::Copy;
pub use dropout::Dropout;
pub use encoding::PositionalEncoding;
pub use even_odd::{Half, Interleave};
pub use fft_periods::FftPeriods;
pub use flatten::Flatten;
pub use fold_convolution::FoldConvolution;
pub use inner_product::InnerProduct;
pub use last_rows::LastRows;
pub use layer_norm::LayerNorm;
pub use linear::Linear;
pub use lstm::Lstm;
pub use mean::Mean;
pub use merge_kernels::MergeKernels;
pub use moving_average::MovingAverage;
pub use pool::Pool;
pub use prob_sparse::ProbSparse;
pub use scale_exp::ScaleExp;
pub use spaced_rows::SpacedRows;
pub use squared_error::SquaredError;
pub use sum::{Add, Subtract};
pub use temporal::Temporal;
pub use temporal_each::TemporalEach;
pub use weight_norm::WeightNorm;

use super::op::Gradient;
use super::shape::Shape;
use phyture_kernels::{Rows, RowsMut, Write};

/// A value as packed rows of its last axis.
fn rows<'a, T>(values: &'a [T], shape: &Shape) -> Rows<'a, T> {
    let (rows, columns) = shape.rows();
    Rows::packed(values, rows, columns)
}

/// A value as packed rows of its last axis, to be written.
fn rows_mut<'a, T>(values: &'a mut [T], shape: &Shape) -> RowsMut<'a, T> {
    let (rows, columns) = shape.rows();
    RowsMut::packed(values, rows, columns)
}

/// A gradient, or, where nobody asks for it, a place for it in the scratch.
fn or_scratch<'a, T>(gradient: Option<Gradient<'a, T>>, scratch: &mut &'a mut [T], len: usize) -> Gradient<'a, T> {
    gradient.unwrap_or_else(|| {
        let (values, rest) = std::mem::take(scratch).split_at_mut(len);
        *scratch = rest;
        Gradient { values, write: Write::Set }
    })
}
